"""Small models as the bytes of files, for the tests of loading."""

import json
import zipfile
from functools import cache
from io import BytesIO

import numpy as np
import trimesh

from helpers.gltf import add_array, picture_uri, uri

PLY_HEADER = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face {n_face}
property list uchar int vertex_indices
{face_properties}end_header
0 0 0
1 0 0
1 1 0
0 1 0
"""


def box():
    return trimesh.creation.box(extents=(1, 2, 3))


def exported(geometry, format, **options) -> bytes:
    data = geometry.export(file_type=format, **options)
    return data.encode() if isinstance(data, str) else data


def embedded_gltf(scene) -> dict:
    """Return the tree of a glTF file that holds its own buffers."""
    files = scene.export(file_type="gltf")
    tree = json.loads(files["model.gltf"])
    for buffer in tree["buffers"]:
        buffer["uri"] = uri(files[buffer["uri"]], "application/octet-stream")
    return tree


@cache
def _box_tree() -> str:
    return json.dumps(embedded_gltf(trimesh.Scene(box())))


def gltf_with(change=lambda tree, primitive: None) -> bytes:
    """Return a glTF box whose tree has been changed."""
    tree = json.loads(_box_tree())
    change(tree, tree["meshes"][0]["primitives"][0])
    return json.dumps(tree).encode()


def rich_gltf() -> bytes:
    """Return a glTF box with a texture of one texel, a light of each kind and a camera."""

    def change(tree, primitive):
        primitive["attributes"]["TEXCOORD_0"] = add_array(tree, np.arange(16, dtype="<f4").reshape(8, 2) / 16)
        primitive["material"] = 0
        tree["images"], tree["textures"] = [{"uri": picture_uri([[(255, 0, 0)]])}], [{"source": 0, "sampler": 0}]
        tree["samplers"] = [{"wrapS": 33071, "magFilter": 9729, "minFilter": 9729}]
        surface = {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 1, 0.5]}
        tree["materials"] = [{"alphaMode": "MASK", "alphaCutoff": 0.5, "pbrMetallicRoughness": surface}]
        lights = [{"type": kind, "intensity": 2, "color": [1, 0.5, 0]} for kind in ("directional", "point", "spot")]
        tree["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
        tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1, "zfar": 50}}]
        first = len(tree["nodes"])
        tree["nodes"] += [
            {"extensions": {"KHR_lights_punctual": {"light": k}}, "translation": [k, 2, 3]} for k in range(3)
        ]
        tree["nodes"].append({"camera": 0, "rotation": [0, 0, 0, 1], "translation": [0, 0, 9]})
        tree["scenes"][0]["nodes"] += range(first, first + 4)

    return gltf_with(change)


CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
MATERIALS = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02"
COLORED_THREEMF = f"""<model unit="inch" xmlns="{CORE}" xmlns:m="{MATERIALS}"><resources>
<basematerials id="1"><base name="a" displaycolor="#805020"/><base name="b" displaycolor="#FFFFFF80"/></basematerials>
<m:colorgroup id="2"><m:color color="#FF0000"/><m:color color="#00ff0080"/></m:colorgroup>
<m:texture2d id="3" path="/3D/a.png" contenttype="image/png" tilestyleu="mirror"/>
<m:texture2dgroup id="4" texid="3"><m:tex2coord u="0" v="0"/><m:tex2coord u="1" v="0.5"/></m:texture2dgroup>
<m:compositematerials id="5" matid="1" matindices="0 1"><m:composite values="0.25 0.75"/></m:compositematerials>
<m:multiproperties id="6" pids="5 2" blendmethods="multiply"><m:multi pindices="0 1"/></m:multiproperties>
<object id="9" pid="1" pindex="1"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
<vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/>
<triangle v1="0" v2="1" v3="3" pid="2" p1="0" p2="1" p3="0"/><triangle v1="1" v2="2" v3="3" pid="4" p1="0" p2="1"
p3="1"/><triangle v1="2" v2="0" v3="3" pid="5" p1="0"/><triangle v1="2" v2="0" v3="3" pid="6" p1="0"/></triangles>
</mesh></object></resources><build><item objectid="9"/></build></model>
"""

THREEMF = f"""<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xmlns="{CORE}"><resources>
<object id="1" name="tip" type="model"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
<vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/>
<triangle v1="0" v2="1" v3="3"/><triangle v1="1" v2="2" v3="3"/><triangle v1="2" v2="0" v3="3"/></triangles></mesh>
</object><object id="2"><components><component objectid="1" transform="2 0 0 0 1 0 0 0 1 5 0 0"/>
<component objectid="1"/></components></object>
</resources><build><item objectid="2" transform="1 0 0 0 1 0 0 0 1 0 10 0"/><item objectid="1"/></build></model>
"""

_TYPES = (
    '<?xml version="1.0" encoding="UTF-8"?>'
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>'
    '<Default Extension="png" ContentType="image/png"/></Types>'
)


def relationships(**targets) -> str:
    """Return the relationships of a 3MF file: names of types, and what they point to."""
    start = "http://schemas.microsoft.com/3dmanufacturing/2013/01/"
    links = "".join(
        f'<Relationship Target="{target}" Id="r{k}" Type="{start}{name}"/>'
        for k, (name, target) in enumerate(targets.items())
    )
    names = "http://schemas.openxmlformats.org/package/2006/relationships"
    return f'<?xml version="1.0" encoding="UTF-8"?><Relationships xmlns="{names}">{links}</Relationships>'


def zipped(contents: dict, method=zipfile.ZIP_DEFLATED) -> bytes:
    """Return a zip file of contents by name, of a fixed date."""
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for path, content in contents.items():
            archive.writestr(zipfile.ZipInfo(path), content, method)
    return stream.getvalue()


def threemf(text=THREEMF, name="3D/3dmodel.model", *, method=zipfile.ZIP_DEFLATED, **others) -> bytes:
    """Return a 3MF file of one model part, and of other files by name; its textures are pictures among them."""
    pictures = [each for each in others if each.endswith(".png")]
    usual = {"[Content_Types].xml": _TYPES, "_rels/.rels": relationships(**{"3dmodel": f"/{name}"}), name: text}
    if pictures:
        usual["3D/_rels/3dmodel.model.rels"] = relationships(**{"3dtexture": f"/{pictures[0]}"})
    return zipped(usual | others, method)


GLB = exported(trimesh.Scene(box()), "glb", include_normals=False)
