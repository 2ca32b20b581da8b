"""3MF files: places, colours, materials, textures, units, and what is left out; with lib3mf, and without."""

import io
import sys

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.model_bytes import CORE, MATERIALS, THREEMF, relationships, threemf
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
NAMES = (
    f'xmlns="{CORE}" xmlns:m="{MATERIALS}" xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06"'
)


@pytest.fixture(autouse=True)
def _formats():
    """Skip the tests, one by one, where the extra is missing."""
    pytest.importorskip("lib3mf", reason="the extra formats is not installed")


def model(first="", second="", own="", groups=GROUPS, unit="", build='<item objectid="1"/>') -> str:
    """A quadrangle of two triangles, each with attributes, and so the object."""
    triangles = f'<triangle v1="0" v2="1" v3="2" {first}/><triangle v1="0" v2="2" v3="3" {second}/>'
    mesh = f"<mesh><vertices>{POINTS}</vertices><triangles>{triangles}</triangles></mesh>"
    return (
        f'<model {unit} {NAMES}><resources>{groups}<object id="1" name="q" {own}>{mesh}</object></resources>'
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


@pytest.fixture(params=["lib3mf", "trimesh"])
def reader(request, monkeypatch):
    """Who reads the file."""
    if request.param == "trimesh":
        pytest.importorskip("lxml")
        monkeypatch.setitem(sys.modules, "lib3mf", None)
    return request.param


def test_objects_are_placed_by_components_and_build(reader):
    scene = load(threemf(), format="3mf")
    assert scene.up == "z" and [mesh.name for mesh in scene.meshes] == ["tip"] * 3
    corners = [mesh.bounds.tolist() for mesh in scene.meshes]
    expected = [[[5, 10, 0], [7, 11, 1]], [[0, 10, 0], [1, 11, 1]], [[0, 0, 0], [1, 1, 1]]]
    assert sorted(corners) == sorted(expected)
    turned = THREEMF.replace('transform="1 0 0 0 1 0 0 0 1 0 10 0"', 'transform="0 1 0 -1 0 0 0 0 1 0 10 0"')
    corners = [mesh.bounds.tolist() for mesh in load(threemf(turned), format="3mf").meshes]
    assert [[-1, 15, 0], [0, 17, 1]] in corners, "moved and stretched by the component, then turned by the build"


def test_parts_in_other_files():
    """The production extension: what is built, or a component, may stand in another part of the file."""
    for build in ('<item objectid="1" p:path="/3D/other.model"/>', '<item objectid="7"/>'):
        whole = '<object id="7"><components><component objectid="1" p:path="/3D/other.model"/></components></object>'
        text = f"<model {NAMES}><resources>{whole}</resources><build>{build}</build></model>"
        files = {
            "3D/other.model": model(),
            "3D/_rels/3dmodel.model.rels": relationships(**{"3dmodel": "/3D/other.model"}),
        }
        (mesh,) = load(threemf(text, **files), format="3mf").meshes
        assert mesh.n_face == 2 and mesh.name == "q", build


def test_without_lib3mf_shapes_alone_are_read(monkeypatch):
    monkeypatch.setitem(sys.modules, "lib3mf", None)
    said = r"model: colours and materials are left out: lib3mf is missing \(pip install .*\[formats\]'\)"
    facts = []
    with pytest.warns(UserWarning, match=said):
        scene = load(threemf(model('pid="9" p1="0"', unit='unit="inch"')), format="3mf", log=facts.append)
    assert scene.n_face == 2 and scene.meshes[0].face_colors is None
    assert "unit inch" in facts[0] and facts[0].endswith("not used: colours and materials")
    assert_refused(lambda text: load(threemf(text), format="3mf"), [
        (model(build='<item p:path="/3D/b.model" objectid="1"/>'), "parts in other files, which lib3mf alone reads"),
        (THREEMF.replace("<vertex x", "<vertex y"), "not a readable 3mf file"),
        (THREEMF.replace('x="1"', 'x="one"'), "not a readable 3mf file"),
        ("<model", "its XML: "),
    ], ModelError, "model: ")  # fmt: skip


def test_what_lib3mf_refuses_trimesh_reads():
    loose = threemf(model('pid="9" p1="0"'), **{"[Content_Types].xml": "<Types/>"})
    with pytest.warns(UserWarning, match="colours and materials are left out: lib3mf refuses the file"):
        assert load(loose, format="3mf").n_face == 2
    assert load(threemf(**{"[Content_Types].xml": "<Types/>"}), format="3mf").n_face == 12, "which has no colours"


def test_colours_of_corners_triangles_and_objects():
    mesh = loaded('pid="9" p1="0" p2="1" p3="2"', 'pid="9" p1="2" p2="2" p3="0"')
    assert mesh.face_colors is None and mesh.material.diffuse == (1, 1, 1)
    assert not differences(mesh.colors, [linear(RED, GREEN, BLUE), linear(BLUE, BLUE, RED)])
    mesh = loaded('pid="9" p1="1"', 'pid="9" p1="2"')
    assert mesh.colors is None and not differences(mesh.face_colors, linear(GREEN, BLUE))
    mesh = loaded('pid="9" p1="0"', own='pid="9" pindex="2"')  # what a triangle doesn't say its object does
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


def test_textures():
    files = {"3D/Textures/a.png": png()}
    mesh = loaded('pid="4" p1="0" p2="1" p3="1"', 'pid="9" p1="1"', groups=UVS + GROUPS, files=files)
    texture = next(material.texture for material in mesh.palette if material.texture is not None)
    assert texture.image.shape == (2, 4, 4) and texture.wrap == ("mirror", "repeat") and texture.filter == "nearest"
    assert mesh.uv[0].tolist() == [[0, 0], [1, 0.5], [1, 0.5]]
    said = r"model: the texture can't be read \(texture '3D/Textures/a.png': can't be read as a picture.* drawn white"
    with pytest.warns(UserWarning, match=said):
        broken = loaded(own='pid="4" pindex="0"', groups=UVS, files={"3D/Textures/a.png": b"no picture"})
    assert broken.material.diffuse == (1, 1, 1)


def test_composites_are_means_and_layers_are_blended():
    groups = (
        '<m:compositematerials id="7" matid="5" matindices="0 1">'
        '<m:composite values="0 1"/><m:composite values="0.5 0.5"/></m:compositematerials>'
        '<m:colorgroup id="8"><m:color color="#00FF0080"/></m:colorgroup>'
        '<m:multiproperties id="2" pids="5 8"><m:multi pindices="0 0"/></m:multiproperties>'
        '<m:multiproperties id="6" pids="5 8" blendmethods="multiply"><m:multi pindices="1 0"/></m:multiproperties>'
    )
    mesh = loaded('pid="7" p1="0"', 'pid="7" p1="1"', groups=GROUPS + groups)
    expected = [linear(WHITE)[0], (linear(WHITE) + linear(OAK))[0] / 2]
    np.testing.assert_allclose(mesh.face_colors, expected, atol=0.005)
    mesh = loaded('pid="2" p1="0"', 'pid="6" p1="0"', groups=GROUPS + groups)
    assert not differences(mesh.face_colors, linear((64, 168, 16), (0, 255, 0)))
    facts = []
    text = model('pid="7" p1="0"', groups=GROUPS + groups.replace('matindices="0 1"', 'matindices="1 0"'))
    (mesh,) = load(threemf(text), format="3mf", log=facts.append).meshes
    assert mesh.material == Material() and "not used: the group of properties" in facts[0], "which lib3mf reads wrongly"


def test_a_file_whose_only_color_is_invisible_is_drawn_opaque():
    base = '<basematerials id="5"><base name="a" displaycolor="#FF000000"/></basematerials>'
    with pytest.warns(UserWarning, match="opacity 0: drawn as if they were opaque"):
        mesh = loaded(own='pid="5" pindex="0"', groups=base)
    assert mesh.material.opacity == 1.0 and mesh.material.diffuse[0] == 1.0


def test_unit_and_what_is_left_out_are_said():
    facts = []
    groups = GROUPS + '<m:colorgroup id="2"><m:color color="#FF000011"/></m:colorgroup>'
    text = model('pid="2" p1="0"', unit='unit="inch"', groups=groups)
    load(threemf(text), format="3mf", log=facts.append)
    load(threemf(model()), format="3mf", log=facts.append)
    assert "unit inch" in facts[0] and facts[0].endswith("not used: the alpha of colors")
    assert facts[1] == "model: 2 faces, no file normals, unit millimeter"


@pytest.mark.filterwarnings("ignore:.*included but not defined")
def test_what_is_not_drawn_is_said():
    names = 'xmlns="http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02" radius="0.1" minlength="0.01"'
    beams = f'<beamlattice {names}><beams><beam v1="0" v2="1"/></beams></beamlattice>'
    with pytest.warns(UserWarning, match="not used: beam lattices"):
        assert load(threemf(THREEMF.replace("</mesh>", beams + "</mesh>")), format="3mf").n_face == 12
    start, end = THREEMF.index("<build>"), THREEMF.index("</build>")
    for build in ("", "<build/>"):
        with pytest.raises(ModelError, match="its build has no item"):
            load(threemf(THREEMF[:start] + build + THREEMF[end + 8 :]), format="3mf")


def test_what_is_broken_is_named():
    assert_refused(lambda text: load(threemf(text), format="3mf"), [
        ("<model", "its XML: "),
        ('<!DOCTYPE model [<!ENTITY a "aaaa">]><model>&a;</model>', "document type"),
        (THREEMF.replace('objectid="1"', 'objectid="7"'), "not a readable 3mf file|no faces"),
        (THREEMF.replace('v1="0"', 'v1="9"'), "refers to vertex 9"),
        (THREEMF.replace('x="0"', 'x="zero"'), "not a readable 3mf file"),
        (THREEMF.replace("<item", "<thing").replace("</build>", "</build>"), "no faces"),
        (model(build="<item/>"), "a 'item' element has no 'objectid'"),
    ], ModelError, "model: ")  # fmt: skip


def test_groups_by_the_thousand_take_no_time():
    groups = "".join(f'<m:colorgroup id="{k}"><m:color color="#FF0000"/></m:colorgroup>' for k in range(20, 2000))
    triangles = "".join(f'<triangle v1="0" v2="1" v3="2" pid="{20 + k % 1980}" p1="0"/>' for k in range(4000))
    text = model(groups=groups).replace("</triangles>", f"{triangles}</triangles>")
    (mesh,) = load(threemf(text), format="3mf").meshes
    assert mesh.n_face == 4002 and mesh.face_colors[2:].tolist() == [[1, 0, 0]] * 4000
    rows, layers = 3000, 1000
    row = '<m:multi pindices="0"/>'
    deep = f'<m:multiproperties id="6" pids="{"4 " * layers}">{row * rows}</m:multiproperties>'
    triangles = "".join(f'<triangle v1="0" v2="1" v3="2" pid="6" p1="{k}"/>' for k in range(rows))
    text = model(groups=UVS + deep).replace("</triangles>", f"{triangles}</triangles>")
    with pytest.raises(ModelError, match="asks for .* bytes of arrays: too many"):
        load(threemf(text, **{"3D/Textures/a.png": png()}), format="3mf")


def test_relationships_name_the_part_to_begin_with():
    data = threemf(model().replace('name="q"', 'name="other"'), "3D/start.model")
    assert load(data, format="3mf").meshes[0].name == "other"
