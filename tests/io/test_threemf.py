"""3MF files: places, colours, materials, textures, units, and what is left out."""

import io

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.model_bytes import THREEMF, threemf
from helpers.refusals import assert_refused
from PIL import Image

from rasterizer.errors import ModelError
from rasterizer.io.loader import load
from rasterizer.scene.color import linear_from_srgb_bytes
from rasterizer.scene.material import Material

RED, GREEN, BLUE, WHITE, OAK = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255), (0x80, 0x50, 0x20)
POINTS = "".join(f'<vertex x="{x}" y="{y}" z="{x * y}"/>' for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
COLORS = "".join(f'<m:color color="{text}"/>' for text in ("#FF0000", "#00ff00FF", "#0000FF"))
GROUPS = (
    f'<m:colorgroup id="9">{COLORS}</m:colorgroup><basematerials id="5"><base name="oak" displaycolor="#805020"/>'
    '<base name="glass" displaycolor="#FFFFFF80"/></basematerials>'
)
UVS = (
    '<m:texture2d id="3" path="/3D/Textures/a.png" contenttype="image/png" tilestyleu="mirror" filter="nearest"/>'
    '<m:texture2dgroup id="4" texid="3"><m:tex2coord u="0" v="0"/><m:tex2coord u="1" v="0.5"/></m:texture2dgroup>'
)


def model(first="", second="", own="", groups=GROUPS, unit="", build='<item objectid="1"/>') -> str:
    """A quadrangle of two triangles, each with attributes, and so the object."""
    triangles = f'<triangle v1="0" v2="1" v3="2" {first}/><triangle v1="0" v2="2" v3="3" {second}/>'
    mesh = f"<mesh><vertices>{POINTS}</vertices><triangles>{triangles}</triangles></mesh>"
    return (
        f'<model {unit} xmlns:m="m"><resources>{groups}<object id="1" name="q" {own}>{mesh}</object></resources>'
        f"<build>{build}</build></model>"
    )


def loaded(*args, files=(), **kwargs):
    (mesh,) = load(threemf(model(*args, **kwargs), **dict(files)), format="3mf").meshes
    return mesh


def linear(*rows):
    return linear_from_srgb_bytes(np.array(rows, np.uint8))


def png() -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (4, 2), RED).save(stream, "png")
    return stream.getvalue()


def test_objects_are_placed_by_components_and_build():
    scene = load(threemf(), format="3mf")
    assert scene.up == "z" and [mesh.name for mesh in scene.meshes] == ["tip"] * 3
    corners = [mesh.bounds.tolist() for mesh in scene.meshes]
    assert corners == [[[5, 10, 0], [7, 11, 1]], [[0, 10, 0], [1, 11, 1]], [[0, 0, 0], [1, 1, 1]]]
    elsewhere = '<model><resources/><build><item objectid="1" p:path="/3D/other.model" xmlns:p="p"/></build></model>'
    assert load(threemf(elsewhere, **{"3D/other.model": THREEMF}), format="3mf").n_face == 4


def test_colours_of_corners_triangles_and_objects():
    mesh = loaded('pid="9" p1="0" p2="1" p3="2"', 'pid="9" p1="2" p2="2" p3="0"')
    assert mesh.face_colors is None and mesh.material.diffuse == (1, 1, 1)
    assert not differences(mesh.colors, [linear(RED, GREEN, BLUE), linear(BLUE, BLUE, RED)])
    mesh = loaded('pid="9" p1="1"', 'pid="9" p1="2"')
    assert mesh.colors is None and not differences(mesh.face_colors, linear(GREEN, BLUE))
    mesh = loaded('p1="0"', own='pid="9" pindex="2"')  # what a triangle doesn't say its object does
    assert not differences(mesh.face_colors, linear(RED, BLUE))
    mesh = loaded('pid="9" p1="0"')
    assert mesh.palette[mesh.face_material[1]] == Material()
    assert not differences(mesh.face_colors, linear(RED, WHITE))


def test_base_materials_are_materials():
    mesh = loaded('pid="5" p1="0"', 'pid="5" p1="1"')
    oak, glass = (mesh.palette[number] for number in mesh.face_material)
    assert (oak.name, oak.opacity, glass.name) == ("oak", 1.0, "glass") and glass.opacity == 128 / 255
    np.testing.assert_allclose(oak.diffuse, linear(OAK)[0])
    assert mesh.colors is None and mesh.face_colors is None
    assert loaded(own='pid="5" pindex="0"').material == oak
    mesh = loaded('pid="5"', own='pid="9" pindex="1"')
    assert [material.name for material in mesh.palette] == ["glass", ""] and mesh.face_material.tolist() == [0, 1]


def test_textures():
    files = {"3D/textures/A.png": png()}
    mesh = loaded('pid="4" p1="0" p2="1" p3="1"', 'pid="9" p1="1"', groups=UVS + GROUPS, files=files)
    texture = mesh.palette[0].texture
    assert texture.image.shape == (2, 4, 4) and texture.wrap == ("mirror", "repeat") and texture.filter == "nearest"
    assert mesh.uv[0].tolist() == [[0, 0], [1, 0.5], [1, 0.5]] and mesh.palette[1].texture is None
    for broken, fault in (
        (UVS.replace("a.png", "b.png"), "there is no '3D/Textures/b.png' in it"),
        (UVS.replace('<m:texture2d id="3"', '<m:texture2d id="2"'), "there is no texture2d '3'"),
        (UVS.replace("path=", "p="), "it has no 'path'"),
        (UVS.replace("mirror", "round"), "a tile style must be one of .*; given 'round'"),
    ):
        with pytest.warns(UserWarning, match=rf"model: the texture 3 can't be read \({fault}\); .* drawn white"):
            assert loaded(own='pid="4" pindex="0"', groups=broken, files=files).material.diffuse == (1, 1, 1)


def test_composites_are_means_and_layers_are_blended():
    groups = (
        '<m:compositematerials id="7" matid="5" matindices="1 0">'
        '<m:composite values="3 0"/><m:composite values="1 1"/></m:compositematerials>'
        '<m:colorgroup id="8"><m:color color="#00FF0080"/></m:colorgroup>'
        '<m:multiproperties id="2" pids="9 8"><m:multi pindices="0 0"/></m:multiproperties>'
        '<m:multiproperties id="6" pids="9 9" blendmethods="multiply"><m:multi pindices="1 0"/></m:multiproperties>'
    )
    mesh = loaded('pid="7" p1="0"', 'pid="7" p1="1"', groups=GROUPS + groups)
    expected = [linear(WHITE)[0], (linear(WHITE) + linear(OAK))[0] / 2]
    np.testing.assert_allclose(mesh.face_colors, expected, atol=0.005)
    mesh = loaded('pid="2" p1="0"', 'pid="6" p1="0"', groups=GROUPS + groups)
    assert not differences(mesh.face_colors, linear((127, 128, 0), (0, 0, 0)))


def test_unit_and_what_is_left_out_are_said():
    facts = []
    groups = GROUPS + '<x:slicestack id="3"/><m:colorgroup id="2"><m:color color="#FF000011"/></m:colorgroup>'
    text = model('pid="77" p1="0"', 'pid="2" p1="0"', unit='unit="inch" xmlns:x="x"', groups=groups)
    load(threemf(text), format="3mf", log=facts.append)
    load(threemf(model()), format="3mf", log=facts.append)
    left_out = "not used: the alpha of colors, the group of properties 77, 'slicestack' elements"
    assert "unit inch" in facts[0] and facts[0].endswith(left_out)
    assert facts[1] == "model: 2 faces, no file normals, unit millimeter"


def test_what_is_broken_is_named():
    def groups(text):
        return model('pid="2" p1="0"', groups=text)

    shares = (
        '<m:compositematerials id="2" matid="5" matindices="0 1"><m:composite values="1 -1"/></m:compositematerials>'
    )
    assert_refused(lambda text: load(threemf(text), format="3mf"), [
        ("<model", "its XML: "),
        ('<!DOCTYPE model [<!ENTITY a "aaaa">]><model>&a;</model>', "document type is not legal"),
        (THREEMF.replace('<component objectid="1"/>', '<component objectid="2"/>'), "nested more than 100 deep"),
        (THREEMF.replace('objectid="1"', 'objectid="7"'), r"there is no object '7' in '3D/3dmodel\.model'"),
        (THREEMF.replace('v1="0"', 'v1="9"'), "refers to vertex 9"),
        (THREEMF.replace('x="0"', 'x="zero"'), "could not convert"),
        (THREEMF.replace('x="1"', ""), "a 'vertex' element has no 'x'"),
        (THREEMF.replace('v2="1"', ""), "a 'triangle' element has no 'v2'"),
        (THREEMF.replace("1 0 10 0", "1 0 nan 0"), "12 finite numbers"),
        (THREEMF.replace("<item", "<thing"), "no faces"),
        (model(build="<item/>"), "a 'item' element has no 'objectid'"),
        (model(build='<item p:path="/3D/b.model" xmlns:p="p" objectid="1"/>'), "there is no part '3D/b.model' in it"),
        (model(build='<item objectid="1" transform="1 2"/>'), "transform must have 12 finite numbers; given '1 2'"),
        (model('pid="9" p1="3"'), "a triangle refers to property 3 of a group of 3"),
        (model('pid="9" p1="-1"'), "a triangle refers to property -1"),
        (model('pid="9" p1="x"'), "invalid literal"),
        (model(own='pid="9" pindex="99999999999999999999"'), "refers to property 9+ of"),
        (groups('<m:colorgroup id="2"><m:color color="red"/></m:colorgroup>'), "given 'red'"),
        (groups('<m:colorgroup id="2"/>'), "of a group of 0"),
        (groups('<m:colorgroup id="2"><m:color/></m:colorgroup>'), "has no 'color'"),
        (groups(GROUPS + shares), "the shares of a composite must be numbers of at least 0"),
    ], ModelError, "model: ")  # fmt: skip
    of_itself = '<m:multiproperties id="2" pids="2"><m:multi pindices="0"/></m:multiproperties>'
    assert load(threemf(groups(of_itself)), format="3mf").meshes[0].material == Material(), "left out"


def test_objects_that_double_and_groups_by_the_thousand_take_no_time():
    double = "".join(
        f'<object id="{k}"><components>{f"""<component objectid="{k - 1}"/>""" * 2}</components></object>'
        for k in range(3, 42)
    )
    text = THREEMF.replace("</resources>", double + "</resources>").replace('<item objectid="2"', '<item objectid="41"')
    with pytest.raises(ModelError, match="repeat too many objects"):
        load(threemf(text), format="3mf")
    groups = "".join(f'<m:colorgroup id="{k}"><m:color color="#FF0000"/></m:colorgroup>' for k in range(20, 2000))
    triangles = "".join(f'<triangle v1="0" v2="1" v3="2" pid="{20 + k % 1980}" p1="0"/>' for k in range(4000))
    text = model(groups=groups).replace("</triangles>", f"{triangles}</triangles>")
    (mesh,) = load(threemf(text), format="3mf").meshes
    assert mesh.n_face == 4002 and mesh.face_colors[2:].tolist() == [[1, 0, 0]] * 4000


def relationships(target, kind="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel") -> str:
    link = f'<Relationship Target="{target}" Id="r0" Type="{kind}"/>'
    names = "http://schemas.openxmlformats.org/package/2006/relationships"
    return f'<Relationships xmlns="{names}">{link}</Relationships>'


def test_relationships_name_the_part_to_begin_with():
    other = model().replace('name="q"', 'name="other"')
    for name, target in (("3D/start.model", "/3D/start.model"), ("a/B.MODEL", "/a/b.model")):
        data = threemf(**{name: other, "_rels/.rels": relationships(target)})
        assert load(data, format="3mf").meshes[0].name == "other"
    # What isn't a model's relationship, or names a part that isn't there, doesn't count where there is the usual one.
    for links in (relationships("/3D/start.model", "thumbnail"), relationships("/none.model")):
        data = threemf(model(), **{"3D/start.model": other, "_rels/.rels": links})
        assert load(data, format="3mf").meshes[0].name == "q"
    for name, links, fault in (
        ("3D/start.model", relationships("/none.model"), r"there is no none\.model in it"),
        ("3D/3dmodel.model", "<!DOCTYPE a><a/>", "a document type is not legal"),
    ):
        with pytest.raises(ModelError, match=fault):
            load(threemf(model(), name, **{"_rels/.rels": links}), format="3mf")
