"""Scene files as people write them: what each entry becomes, and what is said of each fault."""

import json

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.raster import ROOT
from helpers.refusals import assert_refused
from PIL import Image

import rasterizer as rz
from rasterizer.engine import shadow_maps
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
    monkeypatch.chdir(ROOT)
    scenes = [rz.load(tmp_path / "scene.json")]
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

PLACE = {"position": [0, 0, 5], "fov": 30}
POINT = {"kind": "point", "position": [1, 2, 3]}
SPOT = POINT | {"kind": "spot", "direction": [0, 0, 1]}
AREA = {"kind": "area", "corner": [0, 0, 0], "edge_u": [1, 0, 0], "edge_v": [0, 1, 0]}
TABLES = [
    ({}, "scene: meshes is missing"),
    ({"scene": 1}, "scene: unknown key 'scene'; legal are meshes, materials"),
    ({"shadow": True}, r"unknown key 'shadow': did you mean shadows\?"),
    ({"shading": "flat"}, "unknown key shading: options has it"),
    ({"meshes": []}, "meshes must hold at least one"),
    ({"meshes": [7]}, r"meshes\[0\]: must be a table; given 7"),
    ({"lights": "sun"}, r"lights\[0\]: .*'studio', 'headlight', 'tabletop'; given 'sun'"),
    ({"camera": "front"}, r'camera: must be a table, such as {"view": "iso"}; given'),
    ({"camera": {"position": [0, 0, 5]}}, "camera: a camera needs either fov"),
    ({"camera": {"target": [0, 0, 0]}}, "camera: target needs eye"),
    ({"camera": PLACE | {"zoom": 2}}, "camera: unknown key 'zoom'; legal are position"),
    ({"material": {"texture": "no.png"}}, r"material: texture: no\.png: no such file"),
]
# Tables of fields: what holds them, with one value that none of them takes.
FIELDS = [
    ({}, None, ("preset", "shadows", "material", "reflection", "weighting", "subdivide", "drop_bad_faces")),
    ({"material": {}}, "material", ("diffuse", "shininess", "normalized", "texture", "roughness", "name")),
    ({"camera": PLACE}, "camera", ("position", "target", "up", "fov", "near")),
    ({"camera": {}}, "camera", ("view", "azimuth", "elevation", "fov", "ortho", "orthographic", "zoom", "margin")),
    ({"options": {}}, "options", ("size", "shading", "samples", "tolerance", "edges", "ground", "spectral")),
    ({"depth_cue": {"scale": 1}}, "depth_cue", ("scale", "start", "color")),
    ({"shadows": {}}, "shadows", ("size", "filter")),
    ({"lights": [{"kind": "ambient"}]}, "lights", ("kind", "color")),
    ({"lights": [POINT]}, "lights", ("position", "color", "attenuation", "attached", "amplify", "range", "shadow")),
    ({"lights": [SPOT]}, "lights", ("direction", "inner", "outer", "exponent", "falloff")),
    ({"lights": [AREA]}, "lights", ("corner", "edge_u", "resolution")),
    ({"meshes": [TRIANGLE]}, "meshes", (*TRIANGLE, "colors", "polygons", "uv", "name", "crease_angle", "weighting")),
    ({"meshes": [TRIANGLE | {"transform": {}}]}, "transform", ("translate", "scale", "rotate")),
    ({"meshes": [{"file": "cube.obj"}]}, "meshes", ("file", "material", "materials", "transform", "drop_bad_faces")),
]
MESHES = [
    ({}, ": a mesh needs one of file"),
    ({"file": "cube.obj"} | TRIANGLE, ": a mesh needs one of file"),
    ({"file": "room.json"}, "file: must be a model, no scene file"),
    ({"file": "cube.obj", "colour": 1}, "unknown key 'colour'; legal are file, transform"),
    ({"file": "cube.obj", "materials": {"x": {}}}, r"materials\.x: the model has no material of this name"),
    ({"file": "cube.obj", "materials": {}, "material": {}}, "given both"),
    ({"file": "cube.obj", "material": "red"}, r"material: must be a table, or the name of one .*\(none\)"),
    ({"vertices": []}, "faces is missing"),
    (TRIANGLE | {"faces": [[0, 1, 7]]}, "face 0 refers to vertex 7"),
    (TRIANGLE | {"vertices": [[0, 0], [1]]}, "vertices must be a list of lists of numbers"),
    (TRIANGLE | {"transform": [1]}, "transform: must be 4 rows"),
    (TRIANGLE | {"transform": {"shift": 1}}, "transform: unknown key 'shift'; legal are translate"),
    (TRIANGLE | {"transform": {"rotate": {"axis": [0, 0, 1]}}}, "transform: rotate: angle is missing"),
    (TRIANGLE | {"transform": {"rotate": {"axis": [0, 0, 0], "angle": 1}}}, "rotate: the axis must have a length"),
    ({"arrays": "no.npz", "mesh": 0}, "arrays: no.npz: no such file"),
    ({"arrays": "cube.obj", "mesh": 0}, "can't be read as .npz"),
    ({"arrays": "x.npz", "mesh": True}, "mesh must be a whole number"),
]
MATERIALS = [
    ({"shine": 1}, r"unknown key 'shine': did you mean shininess\?; legal are ambient, diffuse"),
    ({"texture": {"filter": "cubic"}}, "texture: a texture needs either file"),
    ({"diffuse": {"values": [1]}}, "diffuse: wavelengths is missing"),
    ({"diffuse": {"wavelengths": [5, 4], "values": [1, 1]}}, "diffuse: .*wavelengths"),
]
LIGHTS = [
    ({"kind": "point"}, "position is missing"),
    ({"kind": "ambient", "shadow": True}, "unknown key 'shadow'"),
    (POINT | {"shadow": {"size": 5}}, "shadow: .*size"),
]


def read_with_mesh(table):
    read({"meshes": [TRIANGLE]} | table if isinstance(table, dict) and table else table)


def test_faults_name_file_table_and_what_is_legal(folder):
    cases = list(TABLES)
    cases += [({"meshes": [mesh]}, r"meshes\[0\]: .*" + said.removeprefix(": ")) for mesh, said in MESHES]
    cases += [({"materials": {"a b": material}}, "materials.a b: .*" + said) for material, said in MATERIALS]
    cases += [({"lights": ["studio", light]}, r"lights\[1\]: .*" + said) for light, said in LIGHTS]
    assert_refused(read_with_mesh, cases, (rz.SceneError, rz.ModelError), "scene: ")


@pytest.mark.parametrize("bad", [{"x": 1}, [[]], "\x1b[0m"])
def test_every_field_is_checked_and_a_fault_names_it(bad):
    """Whatever the field, and whatever stands there, the error names the file, the table and the field."""
    for table, where, names in FIELDS:
        for name in names:
            if isinstance(bad, str) and name in ("name", "crease_angle"):
                continue
            whole = json.loads(json.dumps({"meshes": [TRIANGLE]} | table))
            inner = whole if where is None else whole.get(where, whole["meshes"][0].get(where))
            (inner[0] if isinstance(inner, list) else inner)[name] = bad
            with pytest.raises((rz.SceneError, rz.ModelError)) as told:
                read(whole)
            said = str(told.value)
            word = {"orthographic": "ortho", "crease_angle": "crease angle"}.get(name, name)
            assert said.startswith("scene: ") and (where or "") in said and word in said and said.isprintable(), said


def test_what_a_file_asks_for_is_bounded_before_it_is_spent(monkeypatch):
    sphere, shadowed = (
        {"file": "sphere.obj"},
        {"kind": "directional", "direction": [0, -1, 0], "shadow": {"size": 8192}},
    )
    cases = [
        ({"options": {"size": [65536, 65536]}}, "options: size: .*67108864 pixels"),
        ({"options": {"size": 65536}}, "options: size: .*67108864 pixels"),
        ({"meshes": [sphere], "subdivide": 6}, "subdivide: 6 times makes 20971520 faces; .* may have 2097152"),
        ({"subdivide": 15}, "subdivide: 15 times makes 1073741824 faces"),
        ({"lights": ["studio"] * 16385}, "lights may be up to 16384"),
        ({"lights": [AREA | {"resolution": [64, 64], "shadow": True}] * 2}, "4096 lights that cast shadows"),
    ]
    assert_refused(read_with_mesh, cases, (rz.SceneError, rz.ModelError), "scene: ")
    scene = read({"meshes": [TRIANGLE], "lights": [shadowed] * 5}).scene
    monkeypatch.setattr(shadow_maps, "draw_layer", None)  # no map is drawn
    with pytest.raises(rz.SceneError, match="shadow maps of all lights may have 268435456 texels"):
        rz.render(scene, 8)


def test_text_that_is_no_scene(tmp_path):
    texts = [
        (b"", "the file is empty"),
        (b"{", "is not legal JSON"),
        (b'{"meshes": [], "meshes": []}', "is not legal JSON: duplicate key 'meshes'"),
        (b'{"meshes": NaN}', ".*NaN is no number of JSON"),
        (b'{"up": ' + b"9" * 5000 + b"}", ".*not legal JSON"),
        (b'"\xff"', "is not UTF-8 text"),
    ]

    def load(text):
        (tmp_path / "a.json").write_bytes(text)
        rz.load(tmp_path / "a.json")

    assert_refused(load, [(text, f"a.json: {said}") for text, said in texts], rz.ModelError)
    (tmp_path / "b.json").mkdir()
    (tmp_path / "c.toml").write_text("meshes = []")
    cases = [
        (tmp_path / "none.json", "none.json: no such file"), (tmp_path / "b.json", "b.json: is a folder"),
        (tmp_path / "c.toml", "c.toml: unknown format 'toml'.*a scene file is written in JSON"),
    ]  # fmt: skip
    assert_refused(rz.load, cases, rz.ModelError)
