"""Scene files as people write them: what each entry becomes, and what is said of each fault."""

import json
import math
import sys
from dataclasses import fields

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.raster import HAS_TOML, ROOT
from helpers.refusals import assert_refused
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

import rasterizer as rz
from rasterizer.io.scene_file import read_scene
from rasterizer.viewpoint import Viewpoint

LIFE, GEAR = (str(ROOT / "models" / name) for name in ("still_life.obj", "gear.stl"))
TRIANGLE = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}


def read(table, folder=ROOT / "models", **settings):
    return read_scene(json.dumps(table).encode(), folder, **settings)


def scene_of(**table):
    return read({"meshes": [TRIANGLE]} | table).scene


def mesh_of(**mesh):
    (mesh,) = read({"meshes": [mesh]}).scene.meshes
    return mesh


# --- meshes -------------------------------------------------------------------------------------------------


def test_models_are_found_beside_the_scene_file(tmp_path, monkeypatch):
    (tmp_path / "part.obj").write_bytes((ROOT / "models" / "cube.obj").read_bytes())
    (tmp_path / "scene.json").write_text('{"meshes": [{"file": "part.obj", "name": "part", "crease_angle": 7}]}')
    (tmp_path / "scene.toml").write_text('[[meshes]]\nfile = "part.obj"\nname = "part"\ncrease_angle = 7\n')
    monkeypatch.chdir(ROOT)
    scenes = [rz.load(tmp_path / "scene.json")]
    if HAS_TOML:
        scenes.append(rz.load(str(tmp_path / "scene.toml")))
    with open(tmp_path / "scene.json", "rb") as stream:
        scenes.append(rz.load(stream))
    scenes.append(read_scene((tmp_path / "scene.json").read_bytes(), tmp_path).scene)
    for scene in scenes:
        (mesh,) = scene.meshes
        assert (mesh.n_face, mesh.name, mesh.crease_angle) == (12, "part", 7) and scene.camera is None
        assert scene.lights == rz.studio()
    assert rz.load(tmp_path / "scene.json", crease_angle=9, background="white", up="x").meshes[0].crease_angle == 9
    assert rz.load(tmp_path / "scene.json", background="white", up="x").background == (1, 1, 1)


def test_inline_meshes():
    mesh = mesh_of(
        vertices=[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], faces=[[0, 1, 2, 3], [0, 1, 2]],
        normals=[[0, 0, 2]] * 4, colors=[[1, 0, 0]] * 4, uv=[[0, 0], [1, 0], [1, 1], [0, 1]], smoothing=[1, 2],
        face_material=[1, 0], materials=[{"diffuse": 0.5}, {"diffuse": "orange"}], name="flag",
    )  # fmt: skip
    assert mesh.n_face == 3 and mesh.polygons.tolist() == [0, 0, 1] and mesh.face_material.tolist() == [1, 1, 0]
    assert mesh.normals.tolist() == [[0, 0, 1]] * 4 and mesh.colors.tolist() == [[1, 0, 0]] * 4
    assert mesh.materials == (rz.Material(diffuse=0.5), rz.Material(diffuse="orange")) and mesh.name == "flag"


def test_transforms():
    turned = {"axis": [0, 0, 3], "angle": 90}
    corners = np.array(TRIANGLE["vertices"], float)

    def moved(transform):
        return mesh_of(**TRIANGLE, transform=transform).vertices

    assert not differences(moved({}), corners)
    assert not differences(moved({"translate": [1, 2, 3]}), corners + (1, 2, 3))
    assert not differences(moved({"scale": 2}), corners * 2)
    assert not differences(moved({"scale": [2, 3, 4]}), corners * (2, 3, 4))
    assert moved({"rotate": turned}) == pytest.approx(np.array([(0, 0, 0), (0, 1, 0), (-1, 0, 0)]), abs=1e-15)
    all_three = moved({"scale": 2, "translate": [1, 0, 0], "rotate": turned})
    expected = pytest.approx(np.array([(1, 0, 0), (1, 2, 0), (-1, 0, 0)]), abs=1e-15)
    assert all_three == expected, "scaled, turned, then moved"
    stretched = moved({"rotate": turned, "scale": [2, 3, 1]})
    assert stretched == pytest.approx(np.array([(0, 0, 0), (0, 2, 0), (-3, 0, 0)]), abs=1e-15), "scaled, then turned"
    matrix = [[0, -2, 0, 1], [2, 0, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]]
    assert moved(matrix) == pytest.approx(all_three, abs=1e-15)
    third = np.array(moved({"rotate": {"axis": [1, 1, 1], "angle": 120}}))
    assert third == pytest.approx(corners[:, [2, 0, 1]], abs=1e-15), "x goes to y, y to z"


def test_materials_replace_those_of_a_model():
    table = {"red": {"diffuse": "red"}, "own": {"diffuse": 0.1, "name": "mine"}}
    before = rz.load(LIFE).meshes
    all_red = read({"meshes": [{"file": "still_life.obj", "material": "red"}], "materials": table}).scene.meshes
    assert {m for mesh in all_red for m in mesh.palette} == {rz.Material(diffuse="red", name="red")}
    name = before[0].palette[0].name
    one = read({"meshes": [{"file": "still_life.obj", "materials": {name: "own"}}], "materials": table}).scene.meshes
    for old, new in zip(before, one, strict=True):
        for was, now in zip(old.palette, new.palette, strict=True):
            assert now == (rz.Material(diffuse=0.1, name="mine") if was.name == name else was)
    assert mesh_of(**TRIANGLE, material={"shininess": 3}).material == rz.Material(shininess=3)


def test_textures(tmp_path):
    Image.new("RGB", (2, 2), "red").save(tmp_path / "red.png")
    mesh = TRIANGLE | {"uv": [[0, 0], [1, 0], [0, 1]]}
    full = {"file": "red.png", "filter": "nearest", "wrap": ["clamp", "mirror"], "name": "brick"}
    table = {
        "materials": {"a": {"texture": "red.png"}},
        "meshes": [mesh | {"material": m} for m in ("a", {"texture": full})],
    }
    plain, own = (mesh.material.texture for mesh in read(table, folder=tmp_path).scene.meshes)
    assert plain.image[0, 0].tolist() == [1, 0, 0, 1] and plain.filter == "trilinear" and plain.name.endswith("red.png")
    assert (own.filter, own.wrap, own.name) == ("nearest", ("clamp", "mirror"), "brick")


def test_the_up_axis_is_that_of_the_models():
    def up(*meshes, **rest):
        return read({"meshes": list(meshes)} | rest).scene.up

    assert up({"file": "gear.stl"}) == "z" and up({"file": "cube.obj"}) == "y" and up(TRIANGLE) == "y"
    assert up({"file": "gear.stl"}, {"file": "cube.obj"}) == "y" and up({"file": "gear.stl"}, up="-x") == "-x"


# --- lights, camera, the rest -------------------------------------------------------------------------------


def test_lights():
    lights = [
        "headlight",
        {"kind": "ambient", "color": 0.1},
        {"kind": "directional", "direction": [0, -2, 0], "color": "#f80", "attached": "camera", "shadow": True},
        {"kind": "point", "position": [1, 2, 3], "attenuation": "1/d^2", "range": 9, "amplify": True, "shadow": False},
        {"kind": "spot", "position": [1, 2, 3], "direction": [0, -1, 0], "inner": 5, "outer": 20, "exponent": 2},
        {"kind": "area", "corner": [0, 9, 0], "edge_u": [1, 0, 0], "edge_v": [0, 0, 1], "resolution": [2, 3],
         "shadow": {"size": 64, "filter": 3}},
    ]  # fmt: skip
    found = read({"meshes": [TRIANGLE], "lights": lights})
    assert found.scene.lights == (
        *rz.headlight(),
        rz.AmbientLight(0.1),
        rz.DirectionalLight((0, -1, 0), "#f80", "camera", rz.Shadow()),
        rz.PointLight((1, 2, 3), 1, "1/d^2", "world", True, 9, shadow=False),
        rz.SpotLight((1, 2, 3), (0, -1, 0), 1, 5, 20, 2),
        rz.AreaLight((0, 9, 0), (1, 0, 0), (0, 0, 1), resolution=(2, 3), shadow=rz.Shadow(64, 3)),
    )
    assert scene_of(lights="studio").lights == rz.studio() and scene_of(lights=[]).lights == ()


def test_spectra():
    spectrum = {"wavelengths": [400, 500, 700], "values": [0.1, 0.5, 0.2]}
    light = scene_of(lights=[{"kind": "ambient", "color": spectrum}]).lights[0]
    assert light.color == rz.Spectrum([400, 500, 700], [0.1, 0.5, 0.2]) and isinstance(light.color, rz.Spectrum)
    assert isinstance(mesh_of(**TRIANGLE, material={"diffuse": spectrum}).material.diffuse, rz.Spectrum)


def test_cameras():
    place = {"position": [0, 0, 5], "target": [0, 1, 0]}
    expected = rz.Camera.perspective((0, 0, 5), (0, 1, 0), fov=40, near=1, far=9)
    assert scene_of(camera=place | {"fov": 40, "near": 1, "far": 9}).camera == expected
    assert scene_of(camera=place | {"height": 3, "up": "x"}).camera == rz.Camera.orthographic(
        (0, 0, 5), (0, 1, 0), "x", 3
    )
    intrinsics = {"intrinsics": [80, 90, 40, 20], "size": [100, 60]}
    plain, leaning = (scene_of(camera=place | intrinsics | more).camera for more in ({}, {"skew": -7.5}))
    assert plain.intrinsics == leaning.intrinsics == (80, 90, 40, 20) and (plain.skew, leaning.skew) == (0.0, -7.5)


def test_framing():
    framing = {"azimuth": 10, "elevation": 5, "fov": 20, "margin": 0.1, "orthographic": False}
    found = read({"meshes": [{"file": "gear.stl"}], "camera": framing})
    assert found.scene.camera is None
    gear = rz.load(GEAR)
    assert found.finished_scene().camera == rz.Camera.framing(gear, up="z", **framing)
    for words, meant in (
        ({"view": "left", "fov": 20}, {"view": "left", "fov": 20}),
        ({"elevation": 5, "orthographic": True}, {"elevation": 5, "ortho": True}),
    ):
        assert read({"meshes": [TRIANGLE], "camera": words}).framing == Viewpoint(camera="frame", **meant), words
    sized = read({"meshes": [{"file": "gear.stl"}], "camera": framing, "options": {"size": [400, 100]}})
    assert sized.finished_scene().camera == rz.Camera.framing(gear, up="z", aspect=4.0, **framing)


def test_background_and_options():
    assert scene_of(background="#fff").background == (1, 1, 1) and scene_of(background=None).background is None
    found = read({"meshes": [TRIANGLE], "options": {"size": [4, 3], "tolerance": 0, "spectral": None}})
    assert found.options == {"size": (4, 3), "tolerance": 0}


# --- faults -------------------------------------------------------------------------------------------------

PLACE = {"position": [0, 0, 5]}
TABLES = [
    ({}, "scene: meshes is missing"),
    ([], "scene: must be a table"),
    ({"meshes": []}, "scene: meshes: must hold at least one mesh"),
    ({"meshes": {}}, "meshes: must be a list"),
    ({"meshes": [7]}, r"meshes\[0\]: must be a table; given 7"),
    ({"background": "blurple"}, "background: the color must be"),
    ({"up": "w"}, "up: the scene's up must be one of"),
    ({"up": 3}, "up: must be text"),
    ({"options": {"shade": 1}}, r"options\.shade: unknown key: did you mean shading\?; legal are size"),
    ({"scene": 1}, "scene: scene: unknown key; legal are meshes, materials"),
    ({"camera": PLACE}, "camera: a camera needs either fov"),
    ({"camera": PLACE | {"fov": 200}}, r"camera\.fov: the camera's fov must be at least 1e-06 and below 180"),
    ({"camera": PLACE | {"zoom": 2}}, r"camera\.zoom: unknown key; legal are position"),
    ({"camera": {"near": 1}}, "camera: position is missing, which goes with near"),
    ({"camera": {"target": [0, 0, 0]}}, r"camera\.target: target needs eye"),
    ({"camera": {"eye": [0, 0, 1], "view": "top"}}, r"camera\.eye: eye and target can't be used with view"),
    ({"camera": {"zoom": 0}}, r"camera\.zoom: zoom must be above 0"),
    ({"preset": "sun"}, "preset: preset must be one of 'studio'"),
    ({"shadows": 1}, "shadows: must be true, false, or a table"),
    ({"material": "cheese"}, "material: a named material is one of"),
    ({"material": {"shininess": "x"}}, r"material\.shininess: the material's shininess must be"),
    ({"material": {"texture": "no.png"}}, r"material\.texture: no\.png: no such file"),
    ({"color": [255, 0, 0]}, "color: the material's diffuse"),
    ({"reflection": "shiny"}, "reflection: the material's reflection must be one of"),
    ({"crease_angle": 200}, "crease_angle: "),
    ({"weighting": "heavy"}, "weighting: must be one of angle"),
    ({"subdivide": 16}, "subdivide: subdivide must be a whole number within 0..15"),
    ({"drop_bad_faces": 1}, "drop_bad_faces: must be true or false"),
    ({"format": "obj"}, "format: unknown key; legal are meshes"),
    ({"shadow": True}, r"shadow: unknown key: did you mean shadows\?"),
    ({"fov": 30}, "fov: unknown key, which camera has;"),
    ({"shading": "flat"}, "shading: unknown key, which options has;"),
    ({"camera": "front"}, r'camera: must be a table, such as {view = "iso"}; given'),
    ({"material": ["gold"]}, "material: must be a table, or the name of a material"),
    ({"camera": {"azimuth": "left"}}, r"camera\.azimuth: "),
    ({"camera": {"orthographic": 1}}, r"camera\.orthographic: must be true or false"),
    ({"camera": {"ortho": 1}}, r"camera\.ortho: must be true or false"),
    ({"camera": {"view": "up"}}, r"camera\.view: view must be one of iso, front, .*; given 'up'"),
    ({"camera": {"elevation": 100}}, r"camera\.elevation: the elevation must be within -90"),
]
MESHES = [
    ({}, ": a mesh needs one of file"),
    ({"file": "cube.obj"} | TRIANGLE, ": a mesh needs one of file"),
    ({"file": 5}, ".file: must be text; given 5"),
    ({"file": ""}, ".file: must be the name of a file"),
    ({"file": "other.json"}, ".file: must be a model, no scene file"),
    ({"file": "cube.obj", "colour": 1}, ".colour: unknown key; legal are file, transform"),
    ({"file": "cube.obj", "name": 1}, ".name: must be text"),
    ({"file": "cube.obj", "crease_angle": 200}, ".*: .*crease angle must be within 0..180"),
    ({"file": "cube.obj", "materials": {"x": {}}}, ".materials.x: the model has no material of this name"),
    ({"file": "cube.obj", "materials": {}, "material": {}}, ": .*given both"),
    ({"file": "cube.obj", "material": "red"}, r".material: must be a table, or the name of one .*\(none\)"),
    ({"vertices": []}, ": faces is missing"),
    (TRIANGLE | {"faces": [[0, 1, 7]]}, ".*face 0 refers to vertex 7"),
    (TRIANGLE | {"vertices": [[0, 0], [1]]}, ".vertices: must be a list of lists of numbers"),
    (TRIANGLE | {"vertices": "many"}, ".vertices: must be a list"),
    (TRIANGLE | {"uv": [[0, 0]]}, ".uv: uv must have the shape"),
    (TRIANGLE | {"transform": [1]}, ".transform: must be 4 rows"),
    (TRIANGLE | {"transform": {"shift": 1}}, ".transform.shift: unknown key; legal are translate"),
    (TRIANGLE | {"transform": {"scale": "big"}}, ".transform.scale: .*must be a finite number"),
    (TRIANGLE | {"transform": {"scale": 0}}, ".transform: "),
    (TRIANGLE | {"transform": {"rotate": {"axis": [0, 0, 1]}}}, ".transform.rotate: angle is missing"),
    (TRIANGLE | {"transform": {"rotate": {"axis": [0, 0, 0], "angle": 1}}}, ".*rotate.axis: .*must have a length"),
    ({"arrays": "no.npz", "mesh": 0}, ".arrays: no.npz: no such file"),
    ({"arrays": "cube.obj", "mesh": 0}, ".*can't be read as .npz"),
    ({"arrays": "x.npz"}, ": mesh is missing"),
    ({"arrays": "x.npz", "mesh": True}, ".mesh: must be a whole number"),
]
MATERIALS = [
    ({"shine": 1}, r".shine: unknown key: did you mean shininess\?; legal are ambient, diffuse"),
    ({"shininess": 0}, ".shininess: the material's shininess must be above 0"),
    ({"texture": 5}, ".texture: must be text"),
    ({"texture": "no.png"}, ".texture: no.png: no such file"),
    ({"texture": {"filter": "cubic"}}, ".texture: a texture needs either file"),
    ({"diffuse": {"values": [1]}}, ".diffuse: wavelengths is missing"),
    ({"diffuse": {"wavelengths": [5, 4], "values": [1, 1]}}, ".diffuse.wavelengths: "),
]
POINT = {"kind": "point", "position": [1, 2, 3]}
LIGHTS = [
    ({"color": 1}, ": kind is missing; legal are ambient, directional"),
    ({"kind": "sun"}, ".kind: must be one of ambient"),
    ({"kind": "point"}, ": position is missing"),
    ({"kind": "ambient", "shadow": True}, ".shadow: unknown key; legal are kind, color"),
    ({"kind": "ambient", "color": -1}, ".color: .*must not be negative"),
    (POINT | {"position": [1, 2]}, ".position: .*three finite numbers"),
    (POINT | {"amplify": 1}, ".amplify: must be true or false"),
    (POINT | {"shadow": "soft"}, ".shadow: must be true, false, or"),
    (POINT | {"shadow": {"size": 5}}, ".shadow.size: "),
]


def test_faults_name_file_place_and_what_is_legal(folder):
    def read_with_mesh(table):
        read({"meshes": [TRIANGLE]} | table if isinstance(table, dict) and table else table)

    sun = "lights: must be a table, or one of studio, headlight, tabletop; given 'sun'"
    cases = [*TABLES, ({"lights": "sun"}, sun)]
    cases += [({"meshes": [mesh]}, r"meshes\[0\]" + said) for mesh, said in MESHES]
    cases += [({"materials": {"a b": material}}, "materials.'a b'" + said) for material, said in MATERIALS]
    cases += [({"lights": ["studio", light]}, r"lights\[1\]" + said) for light, said in LIGHTS]
    assert_refused(read_with_mesh, cases, (rz.SceneError, rz.ModelError), "scene: ")


def test_text_that_is_no_scene(tmp_path):
    texts = [
        ("json", b"", "the file is empty"),
        ("json", b"{", "is not legal JSON"),
        ("json", b'{"meshes": [], "meshes": []}', "is not legal JSON: duplicate key 'meshes'"),
        ("json", b'{"meshes": NaN}', ".*NaN is no number of JSON"),
        ("json", b'{"up": ' + b"9" * 5000 + b"}", ".*not legal JSON"),
        ("json", b'"\xff"', "is not UTF-8 text"),
    ]
    if HAS_TOML:
        texts += [("toml", text, "is not legal TOML") for text in (b"meshes = [", b'up = "x"\nup = "y"')]

    def load(given):
        (tmp_path / f"a.{given[0]}").write_bytes(given[1])
        rz.load(tmp_path / f"a.{given[0]}")

    assert_refused(load, [(each, f"a.{each[0]}: {each[2]}") for each in texts], rz.ModelError)
    (tmp_path / "b.json").mkdir()
    cases = [(tmp_path / "none.json", "none.json: no such file"), (tmp_path / "b.json", "b.json: is a folder")]
    assert_refused(rz.load, cases, rz.ModelError)
    with pytest.raises(rz.ModelError, match="unknown format 'yaml' of a scene file"):
        read({}, format="yaml")


def test_without_a_parser_of_toml_the_error_says_what_to_do(tmp_path, monkeypatch):
    (tmp_path / "a.toml").write_text("meshes = []")
    monkeypatch.setitem(sys.modules, "tomllib", None)  # a Python without it
    monkeypatch.setitem(sys.modules, "tomli", None)
    with pytest.raises(rz.ModelError, match=r"Python 3\.11, or tomli: pip install tomli"):
        rz.load(tmp_path / "a.toml")


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 2**70) | st.floats(-1e300, 1e300) | st.text(max_size=3),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["kind", "size", "file"]), inner, max_size=2)
    ),
    max_leaves=6,
)
FULL = {
    "meshes": [TRIANGLE | {"transform": {"scale": 1, "rotate": {"axis": [0, 0, 1], "angle": 3}},
    "uv": [[0, 0], [1, 0], [0, 1]],
                           "normals": [[0, 0, 1]] * 3, "colors": [[1, 1, 1]] * 3, "crease_angle": 5,
                           "material": {"levels": 2}}],
    "materials": {"a": {field.name: None for field in fields(rz.Material)} | {"diffuse": 1}},
    "lights": [{"kind": "spot", "position": [0, 0, 0], "direction": [0, 0, 1], "inner": 1, "outer": 2, "exponent": 0,
    "color": 1,
                "attenuation": [1, 0, 0], "attached": "world", "amplify": False, "range": 5, "shadow": {"size": 64}}],
    "camera": {"position": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 30, "near": 1, "far": 9},
    "background": 0.5, "up": "y", "options": {"size": [4, 3]},
}  # fmt: skip
WORDS = {
    "meshes": [TRIANGLE], "preset": "studio", "shadows": {"size": 64, "filter": 3}, "color": "red", "subdivide": 1,
    "material": {"diffuse": [1, 0, 0], "shininess": 3}, "reflection": "blinn", "crease_angle": 30, "weighting": "area",
    "drop_bad_faces": True, "depth_cue": {"scale": 2},
    "camera": {"eye": [1, 2, 3], "target": [0, 0, 0], "fov": 30, "ortho": True, "zoom": 2, "margin": 0.1},
}  # fmt: skip


def places(value, way=()):
    yield way
    for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        yield from places(value[key], (*way, key))


@settings(max_examples=50, deadline=None)
@given(place=st.sampled_from([(table, way) for table in (FULL, WORDS) for way in places(table) if way]), value=VALUES)
def test_any_other_value_is_taken_or_refused_with_its_place(place, value):
    table, way = json.loads(json.dumps(place[0])), place[1]
    table["materials"] = {"a": {"diffuse": 1}}
    if way[:2] == ("materials", "a"):
        way = ("materials", "a", *way[2:])
    target = table
    for key in way[:-1]:
        target = target[key]
    target[way[-1]] = value
    try:
        scene = read(table).finished_scene()
    except (rz.SceneError, rz.ModelError) as fault:
        assert str(fault).startswith("scene: ")
    else:
        assert scene.meshes and math.isfinite(scene.bounds.sum())
