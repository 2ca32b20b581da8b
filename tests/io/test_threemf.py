"""Tests of 3MF files: colours, materials, textures, units, and what is left out."""

import io
import warnings

import numpy as np
import pytest
from helpers.model_bytes import threemf
from PIL import Image

from rasterizer.errors import ModelError
from rasterizer.io.loader import load
from rasterizer.scene.color import linear_from_srgb_bytes
from rasterizer.scene.material import Material

RED, GREEN, BLUE = (255, 0, 0), (0, 255, 0), (0, 0, 255)
POINTS = "".join(f'<vertex x="{x}" y="{y}" z="{x * y}"/>' for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
COLORS = "".join(f'<m:color color="{text}"/>' for text in ("#FF0000", "#00ff00FF", "#0000FF"))
COLORS = f'<m:colorgroup id="9">{COLORS}</m:colorgroup>'
BASES = (
    '<basematerials id="5"><base name="oak" displaycolor="#805020"/>'
    '<base name="glass" displaycolor="#FFFFFF80"/></basematerials>'
)
UVS = (
    '<m:texture2d id="3" path="/3D/Textures/a.png" contenttype="image/png" tilestyleu="mirror" filter="nearest"/>'
    '<m:texture2dgroup id="4" texid="3"><m:tex2coord u="0" v="0"/><m:tex2coord u="1" v="0.5"/></m:texture2dgroup>'
)


def model(first="", second="", own="", groups=COLORS + BASES, unit="", build="") -> str:
    """A quadrangle of two triangles, each with attributes, and so the object."""
    triangles = f'<triangle v1="0" v2="1" v3="2" {first}/><triangle v1="0" v2="2" v3="3" {second}/>'
    mesh = f"<mesh><vertices>{POINTS}</vertices><triangles>{triangles}</triangles></mesh>"
    return (
        f'<model {unit} xmlns:m="m"><resources>{groups}<object id="1" name="q" {own}>{mesh}</object></resources>'
        f'<build><item objectid="1"/>{build}</build></model>'
    )


def loaded(*args, files=(), **kwargs):
    (mesh,) = load(threemf(model(*args, **kwargs), **dict(files)), format="3mf").meshes
    return mesh


def linear(*rows):
    return linear_from_srgb_bytes(np.array(rows, np.uint8))


def test_colours_of_corners():
    mesh = loaded('pid="9" p1="0" p2="1" p3="2"', 'pid="9" p1="2" p2="2" p3="0"')
    assert mesh.face_colors is None and mesh.material.diffuse == (1, 1, 1)
    assert np.array_equal(mesh.colors, [linear(RED, GREEN, BLUE), linear(BLUE, BLUE, RED)])


def test_one_property_stands_for_all_corners():
    mesh = loaded('pid="9" p1="1"', 'pid="9" p1="2"')
    assert mesh.colors is None and np.array_equal(mesh.face_colors, linear(GREEN, BLUE))


def test_what_a_triangle_does_not_say_its_object_does():
    mesh = loaded('p1="0"', own='pid="9" pindex="2"')
    assert np.array_equal(mesh.face_colors, linear(RED, BLUE))
    mesh = loaded('pid="5"', own='pid="9" pindex="1"')
    assert [material.name for material in mesh.palette] == ["glass", ""] and mesh.face_material.tolist() == [0, 1]


def test_base_materials_are_materials():
    mesh = loaded('pid="5" p1="0"', 'pid="5" p1="1"')
    oak, glass = (mesh.palette[number] for number in mesh.face_material)
    assert (oak.name, oak.opacity, glass.name) == ("oak", 1.0, "glass") and glass.opacity == 128 / 255
    np.testing.assert_allclose(oak.diffuse, linear((0x80, 0x50, 0x20))[0])
    assert mesh.colors is None and mesh.face_colors is None
    assert loaded(own='pid="5" pindex="0"').material == oak


def test_faces_without_a_property_keep_the_default_material():
    mesh = loaded('pid="9" p1="0"')
    assert mesh.palette[mesh.face_material[1]] == Material()
    assert np.array_equal(mesh.face_colors, linear(RED, (255, 255, 255)))


def test_textures():
    stream = io.BytesIO()
    Image.new("RGB", (4, 2), RED).save(stream, "png")
    files = {"3D/textures/A.png": stream.getvalue()}
    mesh = loaded('pid="4" p1="0" p2="1" p3="1"', 'pid="9" p1="1"', groups=UVS + COLORS, files=files)
    texture = mesh.palette[0].texture
    assert texture.image.shape == (2, 4, 4) and texture.wrap == ("mirror", "repeat") and texture.filter == "nearest"
    assert mesh.uv[0].tolist() == [[0, 0], [1, 0.5], [1, 0.5]] and mesh.palette[1].texture is None
    for broken in ({}, {"3D/Textures/a.png": b"no picture"}):
        with pytest.warns(UserWarning, match=r"model: the texture 3 can't be read .*; its triangles are drawn white"):
            assert loaded(own='pid="4" pindex="0"', groups=UVS, files=broken).material.diffuse == (1, 1, 1)


def test_composites_are_means_of_base_materials():
    composites = (
        '<m:compositematerials id="7" matid="5" matindices="1 0">'
        '<m:composite values="3 0"/><m:composite values="1 1"/></m:compositematerials>'
    )
    mesh = loaded('pid="7" p1="0"', 'pid="7" p1="1"', groups=BASES + composites)
    np.testing.assert_allclose(mesh.face_colors[0], 1.0)
    mean = (linear((255, 255, 255)) + linear((0x80, 0x50, 0x20)))[0] / 2
    np.testing.assert_allclose(mesh.face_colors[1], mean, atol=0.005)


def test_layers_are_blended():
    groups = (
        '<m:colorgroup id="8"><m:color color="#00FF0080"/></m:colorgroup>'
        '<m:multiproperties id="7" pids="9 8"><m:multi pindices="0 0"/></m:multiproperties>'
        '<m:multiproperties id="6" pids="9 9" blendmethods="multiply"><m:multi pindices="1 0"/></m:multiproperties>'
    )
    mesh = loaded('pid="7" p1="0"', 'pid="6" p1="0"', groups=COLORS + groups)
    assert np.array_equal(mesh.face_colors, linear((127, 128, 0), (0, 0, 0)))


def test_unit_and_what_is_left_out_are_said():
    facts = []
    groups = COLORS + '<x:slicestack id="3"/><m:colorgroup id="2"><m:color color="#FF000011"/></m:colorgroup>'
    text = model('pid="77" p1="0"', 'pid="2" p1="0"', unit='unit="inch" xmlns:x="x"', groups=groups)
    load(threemf(text), format="3mf", log=facts.append)
    (fact,) = facts
    assert "unit inch" in fact
    assert fact.endswith("not used: the alpha of colors, the group of properties 77, 'slicestack' elements")
    load(threemf(model()), format="3mf", log=facts.append)
    assert facts[1] == "model: 2 faces, no file normals, unit millimeter"


def test_a_component_keeps_its_colours_and_its_place():
    parts = (
        '<object id="2"><components><component objectid="1" transform="2 0 0 0 2 0 0 0 2 9 0 0"/></components></object>'
    )
    text = model(own='pid="5" pindex="0"').replace("</resources>", f"{parts}</resources>")
    (mesh,) = load(threemf(text.replace('<item objectid="1"/>', '<item objectid="2"/>')), format="3mf").meshes
    assert mesh.material.name == "oak" and mesh.bounds.tolist() == [[9, 0, 0], [11, 2, 2]]


SHARES = '<m:compositematerials id="7" matid="5" matindices="0 1"><m:composite values="1 -1"/></m:compositematerials>'
OF_ITSELF = '<m:multiproperties id="7" pids="7"><m:multi pindices="0"/></m:multiproperties>'


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (model('pid="9" p1="3"'), "a triangle refers to property 3 of a group of 3"),
        (model('pid="9" p1="-1"'), "a triangle refers to property -1"),
        (model('pid="9" p1="x"'), "invalid literal"),
        (model(own='pid="9" pindex="99999999999999999999"'), "refers to property 9+ of"),
        (model('pid="2" p1="0"', groups='<m:colorgroup id="2"><m:color color="red"/></m:colorgroup>'), "given 'red'"),
        (model('pid="2" p1="0"', groups='<m:colorgroup id="2"/>'), "of a group of 0"),
        (model('pid="2" p1="0"', groups='<m:colorgroup id="2"><m:color/></m:colorgroup>'), "has no 'color'"),
        (model('pid="7" p1="0"', groups=BASES + SHARES), "the shares of a composite must be numbers of at least 0"),
        (model('pid="7" p1="0"', groups=OF_ITSELF), None),
    ],
)  # fmt: skip
def test_broken_properties_are_refused(text, fault):
    files = {"3D/Textures/a.png": b""}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        if fault is None:  # a group of itself: said, and left out
            assert load(threemf(text, **files), format="3mf").meshes[0].material == Material()
            return
        with pytest.raises(ModelError, match=f"^model: .*{fault}"):
            load(threemf(text, **files), format="3mf")


def test_a_thousand_groups_take_no_square_of_their_number():
    groups = "".join(f'<m:colorgroup id="{k}"><m:color color="#FF0000"/></m:colorgroup>' for k in range(2, 2000))
    triangles = "".join(f'<triangle v1="0" v2="1" v3="2" pid="{2 + k % 1998}" p1="0"/>' for k in range(20000))
    mesh = loaded(groups=groups + '<object id="x"><mesh/></object>')
    text = model(groups=groups).replace("</triangles>", f"{triangles}</triangles>")
    (mesh,) = load(threemf(text), format="3mf").meshes
    assert mesh.n_face == 20002 and mesh.face_colors[2:].tolist() == [[1, 0, 0]] * 20000


def placed(build, extra="") -> str:
    return model().replace('<item objectid="1"/>', build).replace("</resources>", f"{extra}</resources>")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (placed('<item objectid="7"/>'), r"there is no object '7' in '3D/3dmodel\.model'"),
        (placed("<item/>"), "a 'item' element has no 'objectid'"),
        (placed('<item p:path="/3D/b.model" xmlns:p="p" objectid="1"/>'), "there is no part '3D/b.model' in it"),
        (placed('<item objectid="2"/>', '<object id="2"><components><component objectid="3"/></components></object>'),
         "there is no object '3' in"),
        (model().replace('x="1"', ""), "a 'vertex' element has no 'x'"),
        (model().replace('v2="1"', ""), "a 'triangle' element has no 'v2'"),
        (placed('<item objectid="1" transform="1 2"/>'), "a transform must have 12 finite numbers; given '1 2'"),
    ],
)  # fmt: skip
def test_what_is_missing_is_named(text, fault):
    with pytest.raises(ModelError, match=rf"^model: not a readable 3MF file \({fault}"):
        load(threemf(text), format="3mf")


@pytest.mark.parametrize(
    ("what", "fault"),
    [
        ("", "there is no texture2d '3'"),
        ('<texture2d id="3"/>', "it has no 'path'"),
        ('<texture2d id="3" path="b.png"/>', "there is no 'b.png' in it"),
        ('<texture2d id="3" path="a.png" tilestyleu="round"/>', "a tile style must be one of .*; given 'round'"),
    ],
)
def test_a_broken_texture_is_named(what, fault):
    texture = f'{what}<m:texture2dgroup id="4" texid="3"><m:tex2coord u="0" v="0"/></m:texture2dgroup>'
    text = model('pid="4" p1="0"', groups=texture)
    picture = io.BytesIO()
    Image.new("RGB", (2, 2)).save(picture, "PNG")
    with pytest.warns(UserWarning, match=f"the texture 3 can't be read \\({fault}\\)"):
        load(threemf(text, **{"a.png": picture.getvalue()}), format="3mf")


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
    with pytest.raises(ModelError, match=r"there is no none\.model in it"):
        load(threemf(model(), "3D/start.model", **{"_rels/.rels": relationships("/none.model")}), format="3mf")
    with pytest.raises(ModelError, match="a document type is not legal"):
        load(threemf(model(), **{"_rels/.rels": "<!DOCTYPE a><a/>"}), format="3mf")
