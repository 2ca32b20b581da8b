"""What trimesh reads: COLLADA, 3DXML and XAML. What arrives, which files are read beside them, and what is refused
before trimesh gets it."""

import zipfile

import numpy as np
import pytest
from helpers.model_bytes import box, exported, threemf, zipped
from helpers.other_models import NODES, RED, REP, SHOWN, XAML, dae, png, threedxml
from helpers.refusals import assert_refused

import rasterizer as rz
from rasterizer.io.formats import FORMATS
from rasterizer.io.loader import load


@pytest.fixture(autouse=True)
def _formats():
    """Skip the tests, one by one, where the extra is missing."""
    pytest.importorskip("collada", reason="the extra formats is not installed")
    pytest.importorskip("lxml", reason="the extra formats is not installed")


def one(data, format, **options):
    (mesh,) = load(data if isinstance(data, bytes) else data.encode(), format=format, **options).meshes
    return mesh


# --- what arrives -----------------------------------------------------------------------------------------------------


def test_boxes_that_trimesh_writes_come_back():
    colored = box()
    colored.visual.vertex_colors = np.arange(32, dtype=np.uint8).reshape(8, 4) * 8
    for format in ("dae", "3mf"):
        mesh = one(exported(colored, format), format)
        assert mesh.n_face == 12 and np.allclose(mesh.bounds, [[-0.5, -1, -1.5], [0.5, 1, 1.5]]), format
        assert rz.render(mesh, 16, samples=1).stats.covered, format
    mesh = one(exported(colored, "dae"), "dae")
    corner = mesh.colors[np.abs(mesh.vertices[mesh.faces] - colored.vertices[5]).sum(axis=2) < 1e-6][0, :3]
    whole = rz.Mesh(colored.vertices, colored.faces, colors=colored.visual.vertex_colors[:, :3]).colors[5]
    assert np.allclose(corner, whole, atol=1e-3)


def test_collada_materials_textures_nodes_and_units(tmp_path):
    (tmp_path / "a.dae").write_text(dae())
    (tmp_path / "wood.png").write_bytes(png())
    facts, read = [], []
    scene = load(tmp_path / "a.dae", log=facts.append, files_read=read)
    (mesh,) = scene.meshes
    assert scene.up == "z" and mesh.bounds.tolist() == [[0, 0, 5], [4, 2, 5]]
    assert mesh.material.texture.image[0, 0, :3].tolist() == [0, 1, 0] and mesh.material.emissive == (0.1, 0, 0)
    assert read == [str(tmp_path / "wood.png")] and "unit 0.0254 meter" in facts[0]
    frame = rz.render(scene, 24, samples=1)
    assert frame.rgb[frame.alpha > 0][:, 1].min() > frame.rgb[frame.alpha > 0][:, 2].max(), "green"
    plain = one(dae(diffuse=RED, asset="", more="<library_lights/>"), "dae")
    node = (
        f"<node><lookat>1 2 3 1 7 3 0 0 8</lookat>{SHOWN}</node>"  # from an eye along y: x is right, z is up, y is -z
    )
    assert np.allclose(one(dae(node, diffuse=RED), "dae").bounds, [[1, 2, 3], [3, 2, 4]])
    red, green, blue = plain.material.diffuse
    assert red > 7 * green == 7 * blue and plain.material.texture is None
    assert load(dae(diffuse=RED, asset="").encode(), format="dae").up == "y"


def test_collada_says_what_is_missing_and_draws_the_rest():
    def lit(text):
        return one(text, "dae").material

    whole, grey = dae(diffuse=RED), rz.Material().diffuse
    for text, said in (
        (whole.replace('target="#m"', 'target="#z"'), "Material #z not found: it is grey"),
        (whole.replace('url="#e"', 'url="#z"'), "Effect not found: #z"),
        (dae(diffuse="<color>0.8 x 0 1</color>"), "Effect #e can't be read"),
        (dae(diffuse="<float>x</float>"), "Effect #e can't be read"),
        (whole.replace('symbol="m"', 'symbol="z"'), "1 mesh whose material isn't bound: drawn grey"),
    ):
        with pytest.warns(UserWarning) as said_of:
            assert lit(text).diffuse == grey, said
        assert any(said in str(each.message) for each in said_of), said
    with pytest.warns(UserWarning, match="1 texture of a sampler that isn't there: drawn without"):
        assert lit(dae(diffuse='<texture texture="z" texcoord="t"/>')).texture is None
    holes = "<ph><p>0 0 1 1 2 2 3 3</p><h>0 0 1 1 2 2</h></ph>"
    polygons = whole.replace("polylist", "polygons").replace("<vcount>4</vcount><p>0 0 1 1 2 2 3 3</p>", holes)
    controller = NODES + '<node><instance_controller url="#z"/></node>'
    for text, said in (
        (polygons, "not used: holes of polygons"),
        (dae(diffuse=RED, nodes=NODES + '<node><instance_geometry url="#z"/></node>'), "Geometry #z not found"),
        (dae(diffuse=RED, nodes=NODES + '<node><instance_node url="#z"/></node>'), "Node #z not found"),
        (dae(diffuse=RED, nodes=controller), "Controller #z not found"),
    ):
        with pytest.warns(UserWarning) as said_of:
            assert one(text, "dae").n_face == 2, said
        assert any(said in str(each.message) for each in said_of), said
    assert_refused(lambda text: one(text, "dae"), [
        (whole.replace('source="#u"', 'source="#z"'), 'no faces: Source input id "#z" not found'),
        (whole.replace("2 2 3 3", "2 2 9 3"), "beyond the limits"),
        (whole.replace("2 2 3 3", "2 2"), "3 corners, 4 are stated"),
        (whole.replace("2 2 3 3", "2 2 -1 3"), "refers to vertex -1"),
        (whole.replace("0 0 0 2 0 0", "0 0 0 two 0 0"), "numbers are wanted"),
    ], rz.ModelError, "model: ")  # fmt: skip


def test_a_constant_effect_of_collada_shows_its_emission_whatever_the_light():
    text = dae(diffuse=RED).replace("phong", "constant")
    material = one(text, "dae").material
    assert material.emissive == (0.1, 0, 0) and not any((*material.diffuse, *material.specular))


def test_collada_polygons_are_cut_as_they_are():
    ell = dae(diffuse=RED).replace("0 0 0 2 0 0 2 1 0 0 1 0", "0 0 0 4 0 0 1 1 0 0 4 0")
    mesh = one(ell, "dae")
    corners = mesh.vertices[mesh.faces]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0).all()


SKIN = """<library_controllers><controller id="k"><skin source="#g"><bind_shape_matrix>1 0 0 7 0 1 0 0 0 0 1 0 0 0 0 1
</bind_shape_matrix><source id="j"><Name_array id="ja" count="1">b</Name_array><technique_common><accessor source="#ja"
count="1" stride="1"><param name="JOINT" type="name"/></accessor></technique_common></source><source id="b"><float_array
id="ba" count="16">1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</float_array><technique_common><accessor source="#ba" count="1"
stride="16"><param name="TRANSFORM" type="float4x4"/></accessor></technique_common></source><source id="y"><float_array
id="ya" count="1">1</float_array><technique_common><accessor source="#ya" count="1" stride="1"><param name="WEIGHT"
type="float"/></accessor></technique_common></source><joints><input semantic="JOINT" source="#j"/><input
semantic="INV_BIND_MATRIX" source="#b"/></joints><vertex_weights count="4"><input semantic="JOINT" source="#j"
offset="0"/><input semantic="WEIGHT" source="#y" offset="1"/><vcount>1 1 1 1</vcount><v>0 0 0 0 0 0 0 0</v>
</vertex_weights></skin></controller></library_controllers>"""


def test_collada_skins_stand_in_their_bind_shape():
    nodes = f"<node>{SHOWN}</node>".replace("instance_geometry", "instance_controller").replace("#g", "#k")
    with pytest.warns(UserWarning, match="skins and morphs, but for their bind shape"):
        mesh = one(dae(diffuse=RED, nodes=nodes, more=SKIN), "dae")
    assert mesh.bounds.tolist() == [[7, 0, 0], [9, 1, 0]] and mesh.material.name == "m"


@pytest.mark.parametrize("amount", [None, 0.5, 0.0])
@pytest.mark.parametrize("mode", [None, "A_ONE", "A_ZERO", "RGB_ONE", "RGB_ZERO", "alone"])
def test_collada_opacity_in_all_its_forms(mode, amount):
    """COLLADA 1.4.1, p. 7-5; 1.5.0, p. 249. The first mesh is as told, the second opaque: not all are invisible."""
    color, luminance, alpha = "0.5 0.25 0.75 0.6", 0.5 * 0.212671 + 0.25 * 0.71516 + 0.75 * 0.072169, 0.6
    told = "" if mode is None else f' opaque="{mode}"'
    text = "" if mode == "alone" else f"<transparent{told}><color>{color}</color></transparent>"
    text += "" if amount is None else f"<transparency><float>{amount}</float></transparency>"
    share = 1.0 if amount is None else amount
    share *= {"alone": 1.0, "RGB_ONE": luminance, "RGB_ZERO": luminance}.get(mode, alpha)
    expected = 1.0 - share if mode in ("A_ZERO", "RGB_ZERO") else share
    plain = dae(diffuse=RED, nodes=NODES.replace('target="#m"', 'target="#opaque"') + NODES)
    more = '<library_effects><effect id="f"><profile_COMMON><technique sid="c"><phong><diffuse><color>1 1 1 1</color>'
    more += "</diffuse></phong></technique></profile_COMMON></effect></library_effects>"
    materials = '<library_materials><material id="opaque"><instance_effect url="#f"/></material>'
    document = plain.replace("</phong>", f"{text}</phong>").replace("<library_materials>", more + materials)
    opaque, mesh = load(document.encode(), format="dae").meshes
    assert opaque.material.opacity == 1.0 and mesh.material.opacity == pytest.approx(expected)


def test_zae_is_packed_collada():
    mesh = one(zipped({"a/b.dae": dae(image="../pictures/Wood.png"), "pictures/wood.png": png((255, 0, 0))}), "zae")
    assert mesh.material.texture.image[0, 0, :3].tolist() == [1, 0, 0]
    assert_refused(lambda data: one(data, "zae"), [
        (zipped({"a.txt": "x"}), "there is no .dae file in it"),
        (b"PK\x03\x04 and nothing else", "not a readable zae file"),
        (zipped({"a.dae": "<COLLADA"}), "its XML: "),
    ], rz.ModelError, "model: ")  # fmt: skip


def test_3dxml_places_coloured_faces():
    scene = load(threedxml(), format="3dxml")
    assert [mesh.bounds[0, 0] for mesh in scene.meshes] == [0, 3]
    mesh = scene.meshes[0]
    assert mesh.n_face == 2 and mesh.face_colors[0].tolist() == [1, 0, 0] and mesh.normals is not None
    assert_refused(lambda data: load(data, format="3dxml"), [
        (threedxml(**{"Manifest.xml": "<Manifest/>"}), "not a readable 3dxml file"),
        (threedxml(**{"a.3DRep": REP.replace("2 1 0,0", "2 one 0,0")}), "not a readable 3dxml file"),
        (threedxml(**{"p.3dxml": "<!DOCTYPE x><x/>"}), "document type"),
    ], rz.ModelError, "model: ")  # fmt: skip


def test_xaml_has_a_colour_a_mesh():
    mesh = one(XAML, "xaml")
    assert mesh.bounds.tolist() == [[7, 0, 0], [9, 1, 0]] and mesh.face_colors.tolist() == [[0, 1, 0]]
    assert_refused(lambda text: one(text, "xaml"), [
        ("<Viewport3D", "its XML: "),
        (XAML.replace("<MeshGeometry3D", "<Other"), "its XML|not a readable xaml file"),
        (XAML.replace("0 1 2", "0 1 9"), "refers to vertex 9|not a readable xaml"),
        (XAML.replace("2,0,0", "2,zero,0"), "not a readable xaml file"),
        ('<!DOCTYPE a [<!ENTITY b "c">]>' + XAML, "document type"),
    ], rz.ModelError, "model: ")  # fmt: skip


# --- which files are read ---------------------------------------------------------------------------------------------


def test_textures_are_found_by_names_from_other_machines(tmp_path):
    """Which files may be read is tested in test_files.py."""
    (tmp_path / "wood.png").write_bytes(png())
    for name in ("wood.png", "./WOOD.PNG", "w%6fod.png", "file:///C:/Users/x/wood.png", r"C:\x\wood.png"):
        (tmp_path / "a.dae").write_text(dae(image=name))
        assert load(tmp_path / "a.dae").meshes[0].material.texture is not None, name
    with pytest.warns(UserWarning, match="keep their plain colour"):
        load(dae().encode(), format="dae")  # given without a folder


# --- what is refused before trimesh gets it ---------------------------------------------------------------------------


def test_members_packed_without_a_limit_are_refused():
    for method in (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        files = {
            "zae": zipped({"a.dae": dae()}, method),
            "3dxml": threedxml(method=method),
            "3mf": threemf(method=method),
        }
        for format, data in files.items():
            with pytest.raises(rz.ModelError, match="is packed by method 1[24], not by deflate"):
                load(data, format=format)


# --- packages ---------------------------------------------------------------------------------------------------------


def test_a_format_whose_packages_are_missing_says_what_brings_them(monkeypatch):
    lacking = FORMATS["dae"]._replace(packages=(("no_such_package",),))
    monkeypatch.setitem(FORMATS, "dae", lacking)
    said = r"dae files are read by packages that are missing, no_such_package: pip install .*\[formats\]'"
    with pytest.raises(rz.ModelError, match=said):
        load(dae().encode(), format="dae")
