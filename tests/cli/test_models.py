"""What flags make of a model: materials, shadows, finer meshes; and the cameras, lights and options that files bring
along."""

import io
import itertools
import json
import math
import shutil
import sys
from dataclasses import fields, replace

import numpy as np
import pytest
from helpers.command import CUBE, assert_refused, loaded, one_error, picture, raster, request_of
from helpers.model_bytes import rich_gltf
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz
from rasterizer.cli.values import MATERIAL_FIELDS

LIFE = str(ROOT / "models" / "still_life.obj")
SHADOW = rz.Shadow()

pytestmark = pytest.mark.usefixtures("folder")


def materials(model, *argv):
    return [material for mesh in loaded(model, *argv).scene.meshes for material in mesh.palette]


def write(folder, table, name="scene.json") -> str:
    """Write a scene file beside a model that it may name; without meshes it shows that model."""
    shutil.copy(CUBE, folder / "cube.obj")
    (folder / name).write_text(json.dumps({"meshes": [{"file": "cube.obj"}]} | table))
    return name


TRIANGLE = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}


# --- materials ----------------------------------------------------------------------------------------------


def test_material_flags():
    assert set(MATERIAL_FIELDS) == {field.name for field in fields(rz.Material)} - {"name"}
    for text, expected in (
        ("diffuse=#f80", {"diffuse": "#f80"}),
        ("diffuse=rgb(255,136,0),specular=0.5", {"diffuse": "rgb(255, 136, 0)", "specular": 0.5}),
        ("ambient=1/0.5/0,diffuse=0.25", {"ambient": (1, 0.5, 0), "diffuse": 0.25}),
        ("emissive=orange,shininess=7.5,opacity=0.5", {"emissive": "orange", "shininess": 7.5, "opacity": 0.5}),
        ("reflection=cook-torrance,distribution=beckmann,roughness=.3",
         {"reflection": "cook-torrance", "distribution": "beckmann", "roughness": 0.3}),
        ("reflection=cook-torrance,roughness=0.1/0.4,tangent=0/1/0,fresnel=#ffd080",
         {"reflection": "cook-torrance", "roughness": (0.1, 0.4), "tangent": (0, 1, 0), "fresnel": "#ffd080"}),
        ("reflection=toon,levels=5,normalized=yes,fresnel=0.04",
         {"reflection": "toon", "levels": 5, "normalized": True, "fresnel": 0.04}),
        ("fresnel=none,texture=none,normalized=no", {}),
    ):  # fmt: skip
        assert materials(CUBE, "--material", text) == [rz.Material(**expected)], text


def test_all_materials_change_and_keep_the_rest(folder):
    before = materials(LIFE)
    after = materials(LIFE, "--material", "shininess=9,specular=1", "--material", "shininess=5")
    assert len({m.diffuse for m in before}) > 1
    for old, new in zip(before, after, strict=True):
        assert new == replace(old, shininess=5, specular=1)
    assert {m.ambient for m in materials(LIFE, "--material", "diffuse=0.3")} == {(0.3,) * 3}
    assert {m.ambient for m in materials(LIFE, "--material", "diffuse=0.3,ambient=0.1")} == {(0.1,) * 3}
    assert materials(CUBE, "--reflection", "blinn", "--material", "levels=4") == [
        rz.Material(reflection="blinn", levels=4)
    ]
    faces = {"faces": [[0, 1, 2], [2, 1, 0]], "face_material": [0, 1], "materials": [{"diffuse": 0.5}, {"diffuse": 1}]}
    mesh = loaded(write(folder, {"meshes": [TRIANGLE | faces]}), "--reflection", "toon").scene.meshes[0]
    assert [m.reflection for m in mesh.palette] == ["toon", "toon"] and mesh.face_material.tolist() == [0, 1]


def test_a_texture_needs_a_file_and_coordinates(folder, capsys):
    Image.new("RGB", (2, 1), "red").save("red, white.png")
    name = write(folder, {"meshes": [TRIANGLE | {"uv": [[0, 0], [1, 0], [0, 1]]}]})
    (made,) = materials(name, "--material", "texture=red, white.png,diffuse=1")
    assert made.diffuse == (1, 1, 1) and made.texture.image[0, 0].tolist() == [1, 0, 0, 1]
    given = "reflection=cook-torrance,metallic=0.5,metallic_roughness=red, white.png"
    (metal,) = materials(name, "--material", given)
    assert metal.metallic == 0.5 and metal.metallic_roughness.image[0, 0].tolist() == [1, 0, 0, 1]
    bare = write(folder, {"meshes": [TRIANGLE]}, "bare.json")
    assert_refused(capsys, [
        ([bare, "--material", "texture=red, white.png"], "bare.json: a mesh has no texture coordinates (uv)"),
        ([CUBE, "--material", "texture=no.png"], "--material: no.png"),
    ], "render", code=3)  # fmt: skip


# --- shadows ------------------------------------------------------------------------------------------------


def lights_of(*argv):
    request = request_of(CUBE, *argv)
    return request.appearance.change(rz.load(CUBE), shadow_fields=request.shadow_fields).lights


def shadows_of(*argv) -> list:
    return [getattr(light, "shadow", None) for light in loaded(*argv).scene.lights]


def test_lights_say_whether_they_cast_shadows():
    light = "directional:0,-1,0"
    for flag, shadow in (("yes", SHADOW), ("no", False), ("512", rz.Shadow(512)), ("64/5", rz.Shadow(64, 5))):
        found = lights_of("--light", f"{light},shadow={flag}")
        assert found == (rz.DirectionalLight((0, -1, 0), shadow=shadow),), flag
    assert lights_of("--light", light) == (rz.DirectionalLight((0, -1, 0)),)
    for text in ("point:1,2,3", "spot:1,2,3,direction=0/-1/0", "area:1,2,3,edge_u=1/0/0,edge_v=0/0/1"):
        assert (got := lights_of("--light", f"{text},shadow=yes")[0].shadow) == SHADOW, f"{text}: {got} != {SHADOW}"


def test_all_lights_cast_shadows_but_those_that_do_not(folder):
    flags = ["--light", "ambient:0.1", "--light", "point:1,2,3", "--light", "point:1,2,3,shadow=no"]
    flags += ["--light", "point:1,2,3,shadow=64", "--light", "point:1,2,3,shadow=yes"]
    made = lights_of(*flags, "--shadows", "--shadow-size", "256", "--shadow-filter", "3")
    assert made[0] == rz.AmbientLight(0.1)
    assert [light.shadow for light in made[1:]] == [rz.Shadow(256, 3), False, rz.Shadow(64), rz.Shadow(256, 3)]
    assert [light.shadow for light in lights_of(*flags)[1:]] == [None, False, rz.Shadow(64), SHADOW]
    for flags in (["--shading", "gouraud"], ["--preset", "headlight"], ["--preset", "studio"]):
        ambient, *others = shadows_of(CUBE, *flags, "--shadows")
        assert ambient is None and set(others) == {SHADOW} and set(shadows_of(CUBE, *flags)) == {None}, flags
    point = {"kind": "point", "position": [0, 1, 9]}
    lights = [point, point | {"shadow": False}, point | {"shadow": {"size": 32}}]
    name = write(folder, {"lights": ["headlight", *lights]})
    assert shadows_of(name, "--shadows") == [None, SHADOW, SHADOW, False, rz.Shadow(32)]


def test_shadows_have_the_size_and_the_filter_of_the_flags(folder):
    """Without --shadows, those that lights cast anyway: the tabletop's key light, a preset's, a file's, and one that
    says shadow=yes. One that says the size itself keeps it."""

    def cast(*argv):
        return [shadow for shadow in shadows_of(*argv) if shadow]

    flags = ["--shadow-size", "64", "--shadow-filter", "3"]
    assert cast(CUBE) == [] and cast(CUBE, "--ground") == [rz.Shadow(1024, 5)]
    for look in (["--preset", "tabletop"], ["--light", "point:1,2,3,shadow=yes"]):
        assert cast(CUBE, *look, *flags) == [rz.Shadow(64, 3)], look
    assert cast(CUBE, "--preset", "tabletop", "--shadow-size", "64") == [rz.Shadow(64, 5)]
    assert cast(CUBE, "--preset", "tabletop", "--shading", "gouraud") == []  # by Phong's method alone
    assert cast(CUBE, "--light", "point:1,2,3,shadow=32/1", *flags) == [rz.Shadow(32, 1)]
    point = {"kind": "point", "position": [0, 1, 9]}
    name = write(folder, {"lights": [point, point | {"shadow": {"filter": 7}}]})
    assert shadows_of(name) == [None, rz.Shadow(1024, 7)]
    assert shadows_of(name, "--shadow-size", "64") == [None, rz.Shadow(64, 7)]


# --- what files bring along ---------------------------------------------------------------------------------


CAMERA = {"position": [3, 2, 5], "target": [0, 0, 1], "up": [0, 1, 0], "fov": 40}


def assert_seen_through(camera, *argv):
    """A picture of the cube is taken through a camera: its depth is."""
    assert raster("render", *argv, "-s", "30x20", "--array", "depth", "-o", "x.npy") == 0
    expected = rz.render(replace(rz.load(CUBE), camera=camera), (30, 20), outputs="depth", samples=1).depth
    assert np.isfinite(expected).any() and np.array_equal(np.load("x.npy"), expected), argv


def test_a_camera_of_the_file_is_used_unless_a_flag_asks_for_another(folder):
    name, own, cube = write(folder, {"camera": CAMERA}), rz.Camera(**CAMERA), rz.load(CUBE)
    zoomed = replace(own, fov=math.degrees(2 * math.atan(math.tan(math.radians(20)) / 2)))
    for flags, expected in (
        ("", own),
        ("--zoom 2", zoomed),
        ("--view top", rz.Camera.framing(cube, 0, 90, aspect=1.5)),
        ("--fov 30", rz.Camera.framing(cube, aspect=1.5)),
        ("--ortho", rz.Camera.framing(cube, orthographic=True, aspect=1.5)),
        ("--up z", rz.Camera.framing(cube, up="z", aspect=1.5)),
        ("--eye 1,2,3", rz.Camera.perspective((1, 2, 3), (0, 0, 0), fov=30)),
    ):
        assert_seen_through(expected, name, *flags.split())


def test_zoom_of_a_calibrated_camera_keeps_the_middle():
    camera = rz.Camera.from_opencv([[80, 7, 40], [0, 90, 20], [0, 0, 1]], np.eye(3), [0, 0, 5], (100, 60))
    scene = rz.Scene(rz.load(CUBE).meshes, camera=camera)
    near = request_of(CUBE, "--zoom", "2").camera_of(None, scene)
    wide, near = camera.projection((100, 60)), near.projection((100, 60))
    assert (near.scale_x, near.scale_y, near.skew) == (2 * wide.scale_x, 2 * wide.scale_y, 2 * 7)
    for middle, before, after in ((50, wide.center_x, near.center_x), (30, wide.center_y, near.center_y)):
        assert after - middle == pytest.approx(2 * (before - middle))


def test_what_a_file_says_of_the_scene_is_used_unless_flags_say_otherwise(folder):
    name = write(folder, {"lights": [{"kind": "ambient"}], "background": "white", "up": "z"})
    own = loaded(name).scene
    assert own.lights == (rz.AmbientLight(),) and own.background == (1, 1, 1) and own.up == "z"
    assert loaded(name, "--preset", "studio").scene.lights == rz.studio()
    assert loaded(name, "--light", "ambient:0.5").scene.lights == (rz.AmbientLight(0.5),)
    assert loaded(name, "--background", "0.5").scene.background == (0.5, 0.5, 0.5)
    assert loaded(name, "--background", "transparent").scene.background is None
    assert loaded(name, "--up", "x").scene.up == "x" and loaded(name, "--up", "auto").scene.up == "z"
    assert loaded(name, "--crease-angle", "7").scene.meshes[0].crease_angle == 7
    (cube,) = rz.load(CUBE).meshes
    rz.save(rz.Scene(rz.Mesh(cube.vertices, cube.faces, weighting="uniform"), depth_cue=rz.DepthCue(3, 1)), "own.json")
    for model, flags, weighting, cue in (
        (CUBE, "", "angle", None),
        (CUBE, "--weighting area --depth-cue 2", "area", rz.DepthCue(2)),
        (CUBE, "--depth-cue 2.5,start=1,color=#fff", "angle", rz.DepthCue(2.5, 1, "white")),
        ("own.json", "", "uniform", rz.DepthCue(3, 1)),
        ("own.json", "--weighting area --depth-cue none", "area", None),
        ("own.json", "--depth-cue 7", "uniform", rz.DepthCue(7)),
    ):
        scene = loaded(model, *flags.split()).scene
        assert (scene.meshes[0].weighting, scene.depth_cue) == (weighting, cue), f"{model} {flags}"
    assert loaded(CUBE, "--subdivide", "2").scene.n_face == 16 * rz.load(CUBE).n_face


def test_lights_of_a_model_are_used_and_its_camera_where_a_flag_asks_for_it(folder, capsys):
    (folder / "rich.gltf").write_bytes(rich_gltf())
    own, found = rz.load("rich.gltf", camera="file"), loaded("rich.gltf")
    assert "the file has a camera; the model is framed, --camera file looks through it" in capsys.readouterr().err
    assert found.scene.camera is None is rz.load("rich.gltf").camera and found.scene.lights == own.lights != rz.studio()
    assert loaded("rich.gltf", "--camera", "file").scene.camera == own.camera is not None
    assert capsys.readouterr().err == ""
    assert loaded("rich.gltf", "--preset", "headlight").scene.lights == rz.headlight()


def test_another_axis_that_the_shape_says_is_told(folder, capsys):
    """A pyramid stands on the plane z = 0; a box says nothing, nor does a file whose format says what is up."""
    rows = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 1 1 3\nf 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"
    (folder / "pyramid.obj").write_text(rows)
    for model, flags, is_told in (("pyramid.obj", (), True), ("pyramid.obj", ("--up", "z"), False), (CUBE, (), False)):
        loaded(model, *flags)
        err = capsys.readouterr().err
        assert ("drawn with y upwards; by its shape z is up" in err and "try --up z" in err) == is_told, (model, flags)
        assert is_told or not err


def test_the_outputs_of_a_file_count_where_arrays_are_written_alone(folder):
    options = {"size": [20, 10], "samples": 1, "outputs": ["depth"]}
    name = write(folder, {"options": options, "lights": [{"kind": "point", "position": [1, 2, 3]}]})
    assert raster("render", name, "-o", "x.png") == 0
    scene = replace(rz.load(CUBE), lights=(rz.PointLight((1, 2, 3)),))
    assert np.array_equal(picture("x.png"), rz.render(scene, (20, 10), samples=1).rgba)
    for flags, output in (([], "depth"), (["--array", "face"], "face")):
        assert raster("render", name, *flags, "-o", "x.npy") == 0
        expected = getattr(rz.render(scene, (20, 10), outputs=output, samples=1), output)
        assert np.array_equal(np.load("x.npy"), expected), output


def test_a_scene_file_from_stdin(folder, monkeypatch):
    name = write(folder, {"camera": CAMERA})
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO((folder / name).read_bytes())))
    assert_seen_through(rz.Camera(**CAMERA), "-", "--input-format", "json")


def test_faults_of_scene_files_are_one_line_that_names_the_file(folder, capsys):
    (folder / "bad.json").write_text("{")
    Image.new("RGB", (2, 2)).save("x.png")
    nested = write(folder, {"meshes": [{"file": "no.obj"}]}, "nested.json")
    unknown = write(folder, {"mesh": []}, "unknown.json")
    assert_refused(capsys, [
        (["bad.json"], "bad.json: is not legal JSON"), (["none.json"], "none.json: no such file"),
        ([nested], "meshes[0]: file: no.obj: no such file"),
    ], "render", code=3)  # fmt: skip
    assert_refused(capsys, [([unknown], "unknown.json: unknown key 'mesh'")], "render")
    for table, word in (
        ({"options": {"tolerance": 10**400}}, "tolerance"),
        ({"camera": {"position": [0, 0, 5], "fov": 5e-324}}, "fov"),
        ({"materials": {"a": {"texture": {"file": "x.png", "wrap": [{}, []]}}}}, "wrap"),
        ({"meshes": [{"file": "x" * 300}]}, "read"),
        ({"meshes": [{"file": "a\0b"}]}, "file"),
    ):
        assert raster("render", "-q", write(folder, table), "-o", "x.npy") in (2, 3), table
        err = one_error(capsys)
        assert "scene.json" in err and word in err and "internal" not in err, err


@pytest.mark.parametrize(("is_terminal", "flags"), [(True, []), (False, []), (True, ["-q"])])
def test_a_bar_is_shown_while_a_large_file_is_read(monkeypatch, folder, is_terminal, flags):
    stream, clock = io.StringIO(), itertools.count(0.0, 2.0)
    stream.isatty = lambda: is_terminal
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr("rasterizer.cli.messages.perf_counter", lambda: next(clock))  # a file that takes long
    assert raster("render", CUBE, "-s", "8", "--preset", "studio", *flags) == 0
    before, _, after = stream.getvalue().partition("reading lines")
    assert bool(after) == (is_terminal and not flags)
    assert ("\r\x1b[K" in after) == bool(after), "it is taken away at the end"
