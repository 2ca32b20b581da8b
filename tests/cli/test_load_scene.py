"""What flags make of a model: materials, shadows, finer meshes; and the cameras, lights and options that files bring
along.

Most tests look at the Scene and Camera that a renderer is given, not at pixels.
"""

import io
import json
import shutil
from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz
from rasterizer import choices
from rasterizer.cli import arguments, compare_command, defaults, main, material_arguments, render_command
from rasterizer.cli.cameras_lights import camera_of, check_camera, make_lights
from rasterizer.cli.default_look import NEUTRAL
from rasterizer.cli.load_scene import load_scene, make_settings
from rasterizer.cli.messages import Messages
from rasterizer.engine.output_bounds import ErrorBounds
from rasterizer.scene.material import DISTRIBUTIONS, REFLECTION_MODELS

CUBE, LIFE = (str(ROOT / "models" / name) for name in ("cube.obj", "still_life.obj"))
SHADOW = rz.Shadow()

pytestmark = pytest.mark.usefixtures("folder")


def loaded(model, *argv):
    """What is loaded of a model with flags."""
    parsed = arguments.parse(["render", str(model), *argv])
    return load_scene(str(model), parsed, make_settings(parsed), Messages())


def materials(model, *argv):
    return [material for mesh in loaded(model, *argv).scene.meshes for material in mesh.palette]


def error_of(capsys, *argv, code=2) -> str:
    assert main(["render", "-s", "24x16", *map(str, argv)]) == code
    err = capsys.readouterr().err
    assert err.startswith("raster: error: ") and err.count("\n") == 1
    return err


def write(folder, table, name="scene.json") -> str:
    """Write a scene file beside a model that it may name."""
    shutil.copy(CUBE, folder / "cube.obj")
    (folder / name).write_text(json.dumps(table))
    return name


# --- materials ----------------------------------------------------------------------------------------------


def test_the_fields_and_words_are_those_of_a_material():
    assert set(material_arguments.FIELDS) == {field.name for field in fields(rz.Material)} - {"name"}
    assert choices.REFLECTIONS == tuple(REFLECTION_MODELS) and choices.DISTRIBUTIONS == DISTRIBUTIONS


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("diffuse=#f80", {"diffuse": "#f80"}),
        ("diffuse=rgb(255,136,0),specular=0.5", {"diffuse": "rgb(255, 136, 0)", "specular": 0.5}),
        ("ambient=1/0.5/0,diffuse=0.25", {"ambient": (1, 0.5, 0), "diffuse": 0.25}),
        ("emissive=orange,shininess=7.5,opacity=0.5", {"emissive": "orange", "shininess": 7.5, "opacity": 0.5}),
        ("reflection=cook-torrance,distribution=beckmann,roughness=.3", {
            "reflection": "cook-torrance", "distribution": "beckmann", "roughness": 0.3}),
        ("reflection=toon,levels=5,normalized=yes,fresnel=0.04", {
            "reflection": "toon", "levels": 5, "normalized": True, "fresnel": 0.04}),
        ("fresnel=none,texture=none,normalized=no", {}),
    ],
)  # fmt: skip
def test_material_flags(text, expected):
    assert materials(CUBE, "--material", text) == [rz.Material(**{"diffuse": NEUTRAL} | expected)]


def test_all_materials_change_and_keep_the_rest():
    before, after = (
        materials(LIFE),
        materials(LIFE, "--material", "shininess=9,specular=1", "--material", "shininess=5"),
    )
    assert len({m.diffuse for m in before}) > 1
    for old, new in zip(before, after, strict=True):
        assert new.shininess == 5 and new.specular == (1, 1, 1)
        assert (new.diffuse, new.ambient, new.name) == (old.diffuse, old.ambient, old.name)
    assert {m.ambient for m in materials(LIFE, "--material", "diffuse=0.3")} == {(0.3,) * 3}
    assert {m.ambient for m in materials(LIFE, "--material", "diffuse=0.3,ambient=0.1")} == {(0.1,) * 3}
    assert materials(CUBE, "--reflection", "blinn", "--material", "levels=4") == [
        rz.Material(diffuse=NEUTRAL, reflection="blinn", levels=4)
    ]


def test_faces_with_materials_of_their_own_change_too(folder):
    mesh = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2], [2, 1, 0]], "face_material": [0, 1]}
    name = write(folder, {"meshes": [mesh | {"materials": [{"diffuse": 0.5}, {"diffuse": 0.25}]}]})
    assert [m.reflection for m in materials(name, "--reflection", "toon")] == ["toon", "toon"]
    assert loaded(name, "--reflection", "toon").scene.meshes[0].face_material.tolist() == [0, 1]


def test_a_texture_needs_a_file_and_coordinates(folder, capsys):
    Image.new("RGB", (2, 1), "red").save("red, white.png")
    triangle = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}
    name = write(folder, {"meshes": [triangle | {"uv": [[0, 0], [1, 0], [0, 1]]}]})
    (made,) = materials(name, "--material", "texture=red, white.png,diffuse=1")
    assert made.diffuse == (1, 1, 1) and made.texture.image[0, 0].tolist() == [1, 0, 0, 1]
    message = error_of(capsys, write(folder, {"meshes": [triangle]}), "--material", "texture=red, white.png", code=3)
    assert "scene.json: a mesh has no texture coordinates (uv)" in message
    assert "--material texture: no.png" in error_of(capsys, CUBE, "--material", "texture=no.png", code=3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("colour=1", "ambient=..., diffuse=..."),
        ("diffuse", "ambient=..., diffuse=..."),
        ("diffuse=", "ambient=..., diffuse=..."),
        ("name=x", "ambient=..., diffuse=..."),
        ("diffuse=1,foo=2", "'foo=2'"),
        ("diffuse=blurple", "material's diffuse"),
        ("diffuse=1/2", "diffuse: three numbers"),
        ("shininess=shiny", "shininess: a finite number"),
        ("shininess=0", "shininess must be above 0"),
        ("opacity=2", "within 0..1"),
        ("levels=1.5", "levels: a whole number"),
        ("normalized=maybe", "normalized: yes or no"),
        ("reflection=gouraud", "reflection: one of phong, blinn"),
        ("distribution=gauss", "distribution: one of ggx, beckmann"),
        ("fresnel=-1", "fresnel must be within 0..1"),
        ("fresnel=0.1/0.2/1.3", "fresnel must be within 0..1"),
        ("roughness=0.1/0.2", "roughness must be one number, or two"),
        ("reflection=cook-torrance,roughness=0.1/0.2/0.3", "roughness: a finite number"),
        ("tangent=v", "tangent: three numbers"),
        ("golden,shininess=3", "a named material is one of brass"),
    ],
)
def test_bad_materials(folder, capsys, text, words):
    message = error_of(capsys, CUBE, "--material", text)
    assert words in message and "--material" in message and not list(folder.iterdir())


# --- shadows ------------------------------------------------------------------------------------------------


def lights_of(*argv):
    return make_lights(arguments.parse(["render", CUBE, *argv]))


def test_lights_say_whether_they_cast_shadows():
    light = "directional:0,-1,0"
    for flag, shadow in (("yes", SHADOW), ("no", None), ("512", rz.Shadow(512)), ("64/5", rz.Shadow(64, 5))):
        assert lights_of("--light", f"{light},shadow={flag}") == (rz.DirectionalLight((0, -1, 0), shadow=shadow),)
    assert lights_of("--light", light) == (rz.DirectionalLight((0, -1, 0)),)
    for text in ("point:1,2,3", "spot:1,2,3,direction=0/-1/0", "area:1,2,3,edge_u=1/0/0,edge_v=0/0/1"):
        (made,) = lights_of("--light", f"{text},shadow=yes")
        assert made.shadow == SHADOW


def test_all_lights_cast_shadows_but_those_that_do_not():
    flags = ["--light", "ambient:0.1", "--light", "point:1,2,3", "--light", "point:1,2,3,shadow=no"]
    flags += ["--light", "point:1,2,3,shadow=64", "--light", "point:1,2,3,shadow=yes"]
    made = lights_of(*flags, "--shadows", "--shadow-size", "256", "--shadow-filter", "3")
    assert made[0] == rz.AmbientLight(0.1)
    assert [light.shadow for light in made[1:]] == [rz.Shadow(256, 3), None, rz.Shadow(64), rz.Shadow(256, 3)]
    assert [light.shadow for light in lights_of(*flags)[1:]] == [None, None, rz.Shadow(64), SHADOW]


@pytest.mark.parametrize("flags", [["--shading", "gouraud"], ["--preset", "headlight"], ["--preset", "studio"]])
def test_presets_cast_shadows(flags):
    scene = loaded(CUBE, *flags, "--shadows").scene
    assert len(scene.lights) > 1
    assert {light.shadow for light in scene.lights if not isinstance(light, rz.AmbientLight)} == {SHADOW}
    assert all(getattr(light, "shadow", None) is None for light in loaded(CUBE, *flags).scene.lights)


def test_lights_of_a_file_cast_shadows_but_those_that_do_not(folder):
    lights = [
        {"kind": "point", "position": [0, 1, 9]} | own for own in ({}, {"shadow": False}, {"shadow": {"size": 32}})
    ]
    name = write(folder, {"meshes": [{"file": "cube.obj"}], "lights": ["headlight", *lights]})
    shadows = [getattr(light, "shadow", None) for light in loaded(name, "--shadows").scene.lights]
    assert shadows == [None, SHADOW, SHADOW, None, rz.Shadow(32)]


def test_shadows_have_the_size_and_the_filter_of_the_flags(folder):
    """Without --shadows, those that lights cast anyway: the tabletop's key light, a preset's, a file's, and one that
    says shadow=yes. One that says the size itself keeps it."""

    def shadows_of(*argv):
        return [light.shadow for light in loaded(*argv).scene.lights if getattr(light, "shadow", None)]

    flags = ["--shadow-size", "64", "--shadow-filter", "3"]
    assert shadows_of(CUBE) == [rz.Shadow(1024, 5)]
    for look in ([], ["--preset", "tabletop"], ["--light", "point:1,2,3,shadow=yes"]):
        assert shadows_of(CUBE, *look, *flags) == [rz.Shadow(64, 3)]
    assert shadows_of(CUBE, "--shadow-size", "64") == [rz.Shadow(64, 5)]
    assert shadows_of(CUBE, "--light", "point:1,2,3,shadow=32/1", *flags) == [rz.Shadow(32, 1)]
    point = {"kind": "point", "position": [0, 1, 9]}
    name = write(folder, {"meshes": [{"file": "cube.obj"}], "lights": [point, point | {"shadow": {"filter": 7}}]})
    assert shadows_of(name) == [rz.Shadow(1024, 7)] and shadows_of(name, "--shadow-size", "64") == [rz.Shadow(64, 7)]
    assert loaded(name, "--shadow-size", "64").scene.lights[0].shadow is None


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--preset", "studio", "--shadow-size", "64"], "--shadow-size needs a light that casts a shadow; with --"),
        (["--shading", "gouraud", "--shadow-filter", "3"], "--shadow-filter needs a light that casts a shadow"),
        (["--light", "point:1,2,3", "--shadow-size", "64"], "--shadow-size needs a light"),
        (["--shadow-size", "8"], "size must be a whole number within 16..8192"),
        (["--shadows", "--shadow-size", "8"], "size must be a whole number within 16..8192"),
        (["--shadows", "--shadow-filter", "2"], "filter must be an odd number within 1..9"),
        (["--light", "point:1,2,3,shadow=maybe"], "shadow: yes, no, SIZE or SIZE/FILTER"),
        (["--light", "point:1,2,3,shadow=64/4"], "filter must be an odd number"),
        (["--light", "directional:0,1,0,amplify=yes"], "color=..., attached=..., shadow=..."),
        (["--subdivide", "16"], "--subdivide must be within 0..15; given 16"),
        (["--subdivide", "-1"], "--subdivide must be within 0..15; given -1"),
        (["--subdivide", "some"], "--subdivide"),
        (["--exposure", "65"], "exposure must be"),
        (["--spectral", "2"], "spectral must be 3 to 401"),
    ],
)
def test_usage(capsys, argv, words):
    assert words in error_of(capsys, CUBE, *argv)


def test_subdivided_meshes(folder, capsys):
    assert loaded(CUBE, "--subdivide", "2").scene.n_face == 16 * rz.load(CUBE).n_face
    assert main(["compare", CUBE, "-s", "24x16", "--subdivide", "1", "--no-reference", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["faces"] == 48
    assert "cube.obj: a mesh may have up to" in error_of(capsys, CUBE, "--subdivide", "15", code=3)


# --- what files bring along ---------------------------------------------------------------------------------


@pytest.fixture
def given(monkeypatch):
    """Scenes, options and cameras that renderers are given."""
    found = []

    class Renderer:
        def __init__(self, scene, **options):
            self.scene, self.options = scene, options

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def render(self, camera=None):
            found.append(SimpleNamespace(scene=self.scene, options=self.options, camera=camera or self.scene.camera))
            width, height = self.options["size"]
            stats = SimpleNamespace(
                coverage=1.0,
                faces=1,
                culled=0,
                error_bound=0.0,
                steps=(),
                milliseconds={},
                plan=None,
                error_bounds=ErrorBounds(),
            )
            rgba = np.full((height, width, 4), 255, np.uint8)
            arrays = {"color": rgba[..., :3] / np.float32(255), "face": np.zeros((height, width), np.int32)}
            return rz.Frame(rgba, arrays | {"depth": arrays["color"][..., 0]}, stats, (width, height))

    monkeypatch.setattr(render_command, "Renderer", Renderer)
    monkeypatch.setattr(compare_command, "Renderer", Renderer)
    return found


CAMERA = {"position": [3, 2, 5], "target": [0, 0, 1], "up": [0, 1, 0], "fov": 40}


def test_a_camera_of_the_file_is_used_unless_a_flag_asks_for_another(folder, given):
    name = write(folder, {"meshes": [{"file": "cube.obj"}], "camera": CAMERA})
    own = rz.Camera(**CAMERA)
    for flags in (
        [],
        ["--zoom", "2"],
        ["--view", "top"],
        ["--fov", "30"],
        ["--ortho"],
        ["--up", "z"],
        ["--eye", "1,2,3"],
    ):
        assert main(["render", name, "-s", "30x20", *flags]) == 0
    plain, zoomed, top, *others = (draw.camera for draw in given)
    assert plain == own
    scales = [camera.projection((9, 9)).scale_y for camera in (own, zoomed)]
    assert zoomed.position == own.position and scales[1] == pytest.approx(2 * scales[0])
    assert top.view().forward == pytest.approx((0, -1, 0)) and own not in others and len(set(others)) == 4
    assert main(["compare", name, "--no-reference", "-q"]) == 0 and given[-1].camera == own


def test_zoom_of_a_calibrated_camera_keeps_the_middle():
    camera = rz.Camera.from_opencv([[80, 7, 40], [0, 90, 20], [0, 0, 1]], np.eye(3), [0, 0, 5], (100, 60))
    scene = rz.Scene(rz.load(CUBE).meshes, camera=camera)
    near = camera_of(arguments.parse(["render", CUBE, "--zoom", "2"]), None, scene)
    wide, near = camera.projection((100, 60)), near.projection((100, 60))
    assert (near.scale_x, near.scale_y, near.skew) == (2 * wide.scale_x, 2 * wide.scale_y, 2 * 7)
    for middle, before, after in ((50, wide.center_x, near.center_x), (30, wide.center_y, near.center_y)):
        assert after - middle == pytest.approx(2 * (before - middle))


def test_framing_of_the_file_comes_after_flags(folder, given):
    framing = {"azimuth": 10, "elevation": 20, "fov": 50, "margin": 0.2}
    name = write(folder, {"meshes": [{"file": "cube.obj"}], "camera": framing})
    cube = rz.load(CUBE)
    for flags, settings in (
        ([], framing),
        (["--azimuth", "5"], framing | {"azimuth": 5}),
        (["--fov", "20"], framing | {"fov": 20}),
        (["--view", "left"], framing | {"azimuth": -90, "elevation": 0}),
        (["--ortho"], framing | {"orthographic": True}),
    ):
        assert main(["render", name, "-s", "40x20", *flags]) == 0
        assert given[-1].camera == rz.Camera.framing(cube, aspect=2.0, **settings), flags


def test_lights_and_background_of_the_file_are_used_unless_flags_ask_for_others(folder):
    name = write(
        folder, {"meshes": [{"file": "cube.obj"}], "lights": [{"kind": "ambient"}], "background": "white", "up": "z"}
    )
    own = loaded(name).scene
    assert own.lights == (rz.AmbientLight(),) and own.background == (1, 1, 1) and own.up == "z"
    assert loaded(name, "--preset", "studio").scene.lights == rz.studio()
    assert loaded(name, "--light", "ambient:0.5").scene.lights == (rz.AmbientLight(0.5),)
    assert loaded(name, "--background", "0.5").scene.background == (0.5, 0.5, 0.5)
    assert loaded(name, "--background", "transparent").scene.background is None
    assert loaded(name, "--up", "x").scene.up == "x" and loaded(name, "--up", "auto").scene.up == "z"
    assert loaded(name, "--crease-angle", "7").scene.meshes[0].crease_angle == 7


def test_a_camera_and_lights_of_a_model_are_used(monkeypatch, given):
    brought = {"camera": rz.Camera(**CAMERA), "lights": [rz.AmbientLight(0.25)]}

    def load(source, *, lights, **settings):
        settings = {key: value for key, value in settings.items() if key in ("background", "up") and value}
        return rz.Scene(rz.load(source).meshes, lights or brought["lights"], brought["camera"], **settings)

    monkeypatch.setattr("rasterizer.cli.load_scene.load", load)
    for flags in ([], ["--preset", "headlight", "--view", "iso"]):
        assert main(["render", CUBE, *flags]) == 0
    assert given[0].camera == brought["camera"] and given[0].scene.lights == tuple(brought["lights"])
    assert given[1].camera != brought["camera"] and given[1].scene.lights == rz.headlight()


def test_options_of_the_file_come_before_defaults_and_after_flags(folder, given, capsys):
    options = {
        "size": [20, 10],
        "shading": "phong",
        "samples": 1,
        "color_range": "local",
        "exposure": 1.5,
        "outputs": ["depth"],
    }
    name = write(folder, {"meshes": [{"file": "cube.obj"}], "options": options})
    assert main(["render", name]) == 0
    own = given[-1].options
    assert (own["size"], own["shading"], own["samples"], own["color_range"]) == ((20, 10), "phong", 1, "local")
    assert own["exposure"] == 1.5 and own["outputs"] == ("rgb",) and own["cull"] == "none"
    assert given[-1].camera == rz.Camera.framing(rz.load(CUBE), aspect=2.0)
    assert main(["render", name, "-s", "16x16", "--shading", "gouraud", "--samples", "4", "--exposure", "0"]) == 0
    own = given[-1].options
    assert (own["size"], own["shading"], own["samples"], own["exposure"]) == ((16, 16), "gouraud", 4, 0.0)
    assert main(["render", name, "-o", "x.npy"]) == 0 and given[-1].options["outputs"] == ("depth",)
    assert main(["render", name, "--array", "face"]) == 0 and given[-1].options["outputs"] == ("face",)
    assert main(["compare", name, "--no-reference", "-q"]) == 0
    assert given[-1].options["size"] == defaults.COMPARED_SIZE and given[-1].options["exposure"] == 1.5
    square = write(folder, {"meshes": [{"file": "cube.obj"}], "options": {"size": 12}}, "square.json")
    assert main(["render", square]) == 0 and given[-1].options["size"] == (12, 12)
    bad = write(folder, {"meshes": [{"file": "cube.obj"}], "options": {"samples": 5}}, "bad.json")
    assert "bad.json: options: samples must be one of 1, 4, 9, 16; given 5" in error_of(capsys, bad)


def test_a_scene_file_from_stdin(folder, monkeypatch, given):
    import io
    import sys

    shutil.copy(CUBE, folder / "cube.obj")
    content = json.dumps({"meshes": [{"file": "cube.obj"}], "camera": CAMERA}).encode()
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(content)))
    assert main(["render", "-", "--input-format", "json"]) == 0 and given[-1].camera == rz.Camera(**CAMERA)


def test_faults_of_scene_files(folder, capsys):
    (folder / "bad.json").write_text("{")
    assert "bad.json: is not legal JSON" in error_of(capsys, "bad.json", code=3)
    assert "none.toml: no such file" in error_of(capsys, "none.toml", code=3)
    assert "scene.json: mesh: unknown key" in error_of(capsys, write(folder, {"mesh": [], "meshes": []}), code=2)
    assert "meshes[0].file: no.obj: no such file" in error_of(
        capsys, write(folder, {"meshes": [{"file": "no.obj"}]}), code=3
    )


def test_an_empty_picture_by_the_files_camera_says_so(folder, capsys):
    away = {"position": [9, 9, 9], "target": [20, 20, 20], "fov": 30}
    name = write(folder, {"meshes": [{"file": "cube.obj"}], "camera": away})
    assert main(["render", name, "-s", "24x16"]) == 0
    assert "the camera of the file sees nothing of it; try --view iso" in capsys.readouterr().err


def test_a_camera_flag_is_checked_before_models_are_loaded():
    with pytest.raises(rz.SceneError, match="fov"):
        check_camera(arguments.parse(["render", "x.obj", "--fov", "200"]))


# --- depth cueing and weightings ----------------------------------------------------------------------------


def scene_of(*argv, model=CUBE):
    """The scene that the arguments make of a model."""
    parsed = arguments.parse(["render", str(model), *argv])
    return load_scene(str(model), parsed, make_settings(parsed), Messages()).scene


def test_depth_cue_flags(folder, capsys):
    assert scene_of().depth_cue is None and scene_of("--depth-cue", "2").depth_cue == rz.DepthCue(2)
    assert scene_of("--depth-cue", "2.5,start=1,color=#fff").depth_cue == rz.DepthCue(2.5, 1, "white")
    rz.Scene(rz.load(CUBE).meshes, depth_cue=rz.DepthCue(3, 1)).save("cued.json")
    assert scene_of(model="cued.json").depth_cue == rz.DepthCue(3, 1)
    assert scene_of("--depth-cue", "none", model="cued.json").depth_cue is None
    assert scene_of("--depth-cue", "7", model="cued.json").depth_cue == rz.DepthCue(7)
    for wrong, words in (
        ("0", "scale must be above 0"),
        ("far", "finite number"),
        ("1,end=3", "SCALE[,start=S]"),
        ("1,color=x", "color"),
    ):
        assert words in error_of(capsys, CUBE, "--depth-cue", wrong)


def test_weighting_flags(folder):
    assert [mesh.weighting for mesh in scene_of().meshes] == ["angle"]
    assert [mesh.weighting for mesh in scene_of("--weighting", "area").meshes] == ["area"]
    rz.Scene([rz.Mesh(mesh.vertices, mesh.faces, weighting="uniform") for mesh in rz.load(CUBE).meshes]).save(
        "own.json"
    )
    assert scene_of(model="own.json").meshes[0].weighting == "uniform"
    assert scene_of("--weighting", "area", model="own.json").meshes[0].weighting == "area"


def test_the_rest_of_the_look_reaches_the_scene(folder):
    brushed = "reflection=cook-torrance,roughness=0.1/0.4,tangent=0/1/0,fresnel=#ffd080"
    (material,) = {mesh.material for mesh in scene_of("--material", brushed).meshes}
    expected = rz.Material(reflection="cook-torrance", roughness=(0.1, 0.4), tangent=(0, 1, 0), fresnel="#ffd080")
    assert (material.roughness, material.tangent, material.fresnel) == (
        expected.roughness,
        expected.tangent,
        expected.fresnel,
    )


@pytest.mark.parametrize(("is_terminal", "level", "is_shown"), [(True, 0, True), (False, 0, False), (True, -1, False)])
def test_a_bar_is_shown_while_a_large_file_is_read(monkeypatch, is_terminal, level, is_shown):
    stream = io.StringIO()
    stream.isatty = lambda: is_terminal
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setattr("rasterizer.cli.load_scene.LONG", -1.0)
    parsed = arguments.parse(["render", str(ROOT / "models" / "gear.stl")])
    load_scene(parsed.models[0], parsed, make_settings(parsed), Messages(level))
    assert ("joining vertices" in stream.getvalue()) == is_shown
    assert stream.getvalue().endswith("\r\x1b[K") == is_shown, "it is taken away at the end"
