"""Small models of COLLADA, 3DXML and XAML, for the tests of loading."""

import io
import zipfile

from PIL import Image

from helpers.model_bytes import zipped

MATERIAL = """<library_images><image id="i"><init_from>IMAGE</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>
<technique sid="c"><phong><emission><color>0.1 0 0 1</color></emission>
<diffuse>DIFFUSE</diffuse></phong></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>"""
PICTURED, RED = '<texture texture="t" texcoord="UV"/>', "<color>0.8 0.1 0.1 0.5</color>"
GEOMETRY = """<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 2 0 0 2 1 0 0 1 0</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<source id="u"><float_array id="ua" count="8">0 0 1 0 1 1 0 1</float_array><technique_common>
<accessor source="#ua" count="4" stride="2"><param name="S" type="float"/><param name="T" type="float"/></accessor>
</technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="1" material="m"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="TEXCOORD" source="#u" offset="1" set="0"/><vcount>4</vcount><p>0 0 1 1 2 2 3 3</p></polylist>
</mesh></geometry></library_geometries>"""
SHOWN = """<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="m" target="#m"/>
</technique_common></bind_material></instance_geometry>"""
NODES = f'<node id="n"><translate>0 0 5</translate><node id="o"><scale>2 2 2</scale>{SHOWN}</node></node>'


def dae(nodes=NODES, image="wood.png", diffuse=PICTURED, more="", asset="<up_axis>Z_UP</up_axis>") -> str:
    """A rectangle of 2 x 1 in COLLADA."""
    material = MATERIAL.replace("IMAGE", image).replace("DIFFUSE", diffuse)
    return (
        '<?xml version="1.0" encoding="utf-8"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" '
        f'version="1.4.1"><asset><unit name="inch" meter="0.0254"/>{asset}</asset>{material}{GEOMETRY}{more}'
        f'<library_visual_scenes><visual_scene id="w">{nodes}</visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#w"/></scene></COLLADA>'
    )


def png(color=(0, 255, 0)) -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (4, 2), color).save(stream, "png")
    return stream.getvalue()


REP = """<XMLRepresentation xmlns:xsi="x"><Root><Rep>
<Faces><SurfaceAttributes/><Face triangles="0 1 2"><SurfaceAttributes><Color xsi:type="RGBAColorType" red="1" green="0"
blue="0"/></SurfaceAttributes></Face><Face fans="0 2 3"/></Faces><VertexBuffer>
<Positions>0 0 0,2 0 0,2 1 0,0 1 0</Positions><Normals>0 0 1,0 0 1,0 0 1,0 0 1</Normals></VertexBuffer></Rep></Root>
</XMLRepresentation>"""
PRODUCT = """<Model_3dxml xmlns:xsi="x"><ProductStructure root="1"><Reference3D id="1" name="all"/>
<Reference3D id="2" name="plate"/>{instances}<ReferenceRep id="3" associatedFile="urn:3DXML:a.3DRep"
format="TESSELLATED"/><InstanceRep id="4"><IsAggregatedBy>2</IsAggregatedBy><IsInstanceOf>3</IsInstanceOf></InstanceRep>
</ProductStructure></Model_3dxml>"""
INSTANCE = """<Instance3D id="{id}" name="plate"><IsAggregatedBy>{above}</IsAggregatedBy><IsInstanceOf>{below}
</IsInstanceOf><RelativeMatrix>1 0 0 0 1 0 0 0 1 {x} 0 0</RelativeMatrix></Instance3D>""".replace("\n<", "<")


def threedxml(instances=None, method=zipfile.ZIP_DEFLATED, **others) -> bytes:
    if instances is None:
        instances = "".join(INSTANCE.format(id=5 + k, above=1, below=2, x=3 * k) for k in range(2))
    files = {
        "Manifest.xml": "<Manifest><Root>p.3dxml</Root></Manifest>", "p.3dxml": PRODUCT.format(instances=instances),
        "a.3DRep": REP,
    }  # fmt: skip
    return zipped(files | others, method)


XAML = """<Viewport3D xmlns="http://schemas.microsoft.com/winfx/2006/xaml/presentation"><ModelVisual3D>
<ModelVisual3D.Transform><MatrixTransform3D Matrix="1 0 0 0 0 1 0 0 0 0 1 0 7 0 0 1"/></ModelVisual3D.Transform>
<GeometryModel3D><GeometryModel3D.Material><DiffuseMaterial><DiffuseMaterial.Brush><SolidColorBrush Color="#00FF00"
Opacity="1"/></DiffuseMaterial.Brush></DiffuseMaterial></GeometryModel3D.Material><GeometryModel3D.Geometry>
<MeshGeometry3D Positions="0,0,0 2,0,0 2,1,0" Normals="0,0,1 0,0,1 0,0,1" TriangleIndices="0 1 2"/>
</GeometryModel3D.Geometry></GeometryModel3D></ModelVisual3D></Viewport3D>"""
