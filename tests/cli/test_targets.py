"""Which models are read and where their pictures go: folders, names that collide, what is there already."""

import json
import os
import shutil
from pathlib import Path

import pytest
from helpers.command import CUBE, GEAR, PLAIN, SMALL, assert_refused, errors, one_error, picture, raster, run
from helpers.raster import ROOT

import rasterizer as rz

pytestmark = pytest.mark.usefixtures("folder")


def found(below):
    """The files below a folder, by their names from there."""
    names = (os.path.relpath(os.path.join(path, name), below) for path, _, names in os.walk(below) for name in names)
    return sorted(name.replace(os.sep, "/") for name in names)


def test_templates_folders_and_patterns(folder, capsys):
    os.mkdir("out")
    assert run(CUBE, "-o", "out/{view}_{stem:_>6}.{ext}.png", "--view", "left") == 0
    assert run(CUBE, GEAR, "-o", "out") == 0 and run(CUBE, "-o", "out/", "--array", "face") == 0
    assert sorted(os.listdir("out")) == ["cube.npy", "cube.png", "gear.png", "left___cube.obj.png"]
    assert run(CUBE, GEAR, "--view", "iso", "--view", "top", "-o", "new/deep er/ü/") == 0, "folders are made"
    assert found("new/deep er/ü") == ["cube-iso.png", "cube-top.png", "gear-iso.png", "gear-top.png"]
    assert run(CUBE, "-o", "{stem:_>9}{{}}.png") == 0 and os.path.exists("_____cube{}.png")
    for name in ("b.obj", "a.obj", "{c}.obj", "[d].obj"):
        shutil.copy(CUBE, name)
    assert run("*.obj", "-o", "{stem}.png") == 0
    assert raster("render", *SMALL, "[d].obj", "--shading", "flat", "-o", "{stem}-flat.png", "./a.obj") == 0
    assert errors(capsys) == ""
    assert set(Path().glob("*.png")) == set(
        map(Path, ["a.png", "b.png", "{c}.png", "[d].png", "[d]-flat.png", "a-flat.png", "_____cube{}.png"])
    )


def test_names_that_no_output_can_have(folder, capsys):
    templates = """{stem:>99999999999}.png {stem:{view}}.png {stem!r}.png {0}.png {}.png {stem.a}.png {stem[0]}.png
        {frame:03}.png }.png {stem:_>9999}.png {stem:e}.png {name}.png {stem.png {stem.upper}.png"""
    legal = "-o may hold {stem}, {ext}, {view}, padded as in"
    assert_refused(capsys, [([CUBE, "-o", template], legal) for template in templates.split()], "render")
    assert_refused(capsys, [([CUBE, "-o", "{stem:>255}.png"], "too long")], "render", code=4)
    assert run(CUBE, *SMALL, "-o", "{stem:>300}.png") == 0, "no name is padded beyond what file systems take"
    (folder / "file").write_text("x")
    assert_refused(capsys, [
        (["nope.obj", "-o", "file/deep/x.png"], "file is no folder\n"),
        ([CUBE, "-o", f"{CUBE}/x.png"], "no folder"),
    ], "render", code=4)  # fmt: skip
    assert_refused(capsys, [(["nope.obj", "-o", "never/x.png"], "no such file")], "render", code=3)
    assert_refused(
        capsys, [([CUBE, GEAR, "-o", "thumbs"], f"; a folder is written {os.path.join('thumbs', '')}\n")], "render"
    )


def test_the_way_out_of_one_name_for_two_pictures_leads_out(folder, capsys):
    os.makedirs("b")
    for name in ("x.obj", "b/x.obj", "y.obj"):
        shutil.copy(CUBE, name)
    for name in ("x.stl", "y.stl"):
        shutil.copy(GEAR, name)
    folders = "--recursive with the folder above them keeps folders"
    for words, way_out in (
        ("x.obj b/x.obj -o out/", folders),
        ("x.obj b/x.obj -o {stem}-{view}-{ext}.png", folders),
        ("x.obj x.obj", "a model is drawn once"),
        ("x.obj y.obj -o out.png", "template such as '{stem}.png'"),
        ("x.obj x.stl -o {stem}.png", "template such as '{stem}-{ext}.png'"),
        ("x.obj -o out.png --view top,front", "x.obj (top) and x.obj (front) would both be written to out.png"),
        ("x.obj -o out.png --view top,front", "template such as '{stem}-{view}.png'"),
        ("x.obj y.stl -o a.png --view top,front", "template such as '{stem}-{view}.png'"),
    ):
        argv = words.split()
        assert_refused(capsys, [(argv, "would both be written to")], "render")
        assert run(*argv) == 2 and way_out in (text := one_error(capsys)), words
        if "template" in text:
            argv[argv.index("-o") + 1] = text.split("'")[-2]
            assert run(*argv, "-q") == 0
    (folder / "a.png").write_bytes(b"")
    os.link(folder / "a.png", folder / "z.png")
    os.rename("x.obj", "a.obj")
    os.rename("y.obj", "z.obj")
    assert_refused(capsys, [(["a.obj", "z.obj"], "would both be written")], "render")


def test_models_that_differ_in_their_suffix_alone_get_it(folder):
    shutil.copy(CUBE, "part.obj")
    shutil.copy(GEAR, "part.stl")
    assert run("part.obj", "part.stl", CUBE, "-q") == 0
    assert {"part-obj.png", "part-stl.png", "cube.png"} < set(os.listdir(folder))
    assert run("part.obj", "part.stl", "-o", "out/", "--view", "top,front") == 0
    assert found("out") == ["part-obj-front.png", "part-obj-top.png", "part-stl-front.png", "part-stl-top.png"]


def test_recursive_takes_all_models_below_and_keeps_their_folders(folder, capsys):
    for name in ("a/x.obj", "a/b/x.obj", "a/b/x.stl", "a/.hidden/y.obj", "a/c {1}/y.obj", "empty/z.txt", "a/own.json"):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(GEAR if name.endswith("stl") else CUBE, path)
    assert run("a", "-o", "out/", "--recursive") == 0
    assert found("out") == ["b/x-obj.png", "b/x-stl.png", "c {1}/y.png", "x.png"]
    assert_refused(capsys, [
        (["a", "--recursive", "-o", "flat/{stem}-{ext}.png"], "would both be written"),
        (["empty", "--recursive"], "empty: there is no model in this folder, nor below; legal are obj"),
    ], "render")  # fmt: skip
    assert_refused(capsys, [(["a"], "a: is a folder; give the models in it"), (["a"], "or --recursive")], "render",
                   code=3)  # fmt: skip
    assert raster("info", "a", "--recursive", "--json") == 0
    assert len(capsys.readouterr().out.splitlines()) == 4


def test_what_is_there_already_can_be_left_out(folder, capsys):
    assert run(CUBE, "--view", "top") == 0
    before = os.stat("cube.png").st_mtime_ns
    assert run(CUBE, GEAR, "nope.obj", "--skip-existing") == 1
    assert "1 of 3 outputs are there already" in errors(capsys)
    assert os.stat("cube.png").st_mtime_ns == before and os.path.exists("gear.png")
    assert run(CUBE, GEAR, "--skip-existing", "-q") == 0 and errors(capsys) == ""


def test_a_camera_comes_from_a_file(folder, capsys):
    scene = rz.load(CUBE)
    camera = rz.Camera.perspective((4, 3, 2), fov=40)
    rz.Scene(scene.meshes, camera=camera).save("cam.json")
    (folder / "alone.json").write_text(json.dumps({"position": [4, 3, 2], "fov": 40}))
    (folder / "framing.json").write_text(json.dumps({"camera": {"azimuth": 90, "elevation": 0}}))
    rz.Scene(scene.meshes).save("none.json")
    for model, flags, through in (
        (CUBE, "--camera cam.json", camera),
        (CUBE, "--camera alone.json", camera),
        (CUBE, "--camera framing.json", rz.Camera.framing(scene, 90, 0, aspect=1.5)),
        ("cam.json", "--camera file", camera),
        ("cam.json", "--camera frame", rz.Camera.framing(scene, aspect=1.5)),
    ):
        assert run(model, *flags.split(), "-o", "x.png", *PLAIN) == 0
        expected = rz.render(
            rz.load(CUBE, camera=through), (24, 16), samples=4, shading="gouraud"
        ).rgba  # as PLAIN has it
        assert (picture("x.png") == expected).all(), f"{model} {flags}"
    assert_refused(capsys, [
        ([CUBE, "--camera", "none.json"], "none.json: the scene has no camera"),
        ([CUBE, "--camera", "file"], "the model brings no camera"),
        ([CUBE, "--camera", "cam.json", "--view", "top"], "can't be used with other flags"),
        ([CUBE, "--camera", "cam.json", "-o", "cam.json"], "no format to write"),
    ], "render")  # fmt: skip
    assert_refused(capsys, [([CUBE, "--camera", "gone.json"], "gone.json")], "render", code=3)
    os.rename("cam.json", "cam.png")
    os.link("cam.png", "linked.json")
    assert_refused(capsys, [([CUBE, "--camera", "linked.json", "-o", "cam.png"], "which is read")], "render", code=4)


def test_flags_that_people_type(capsys):
    for ways in (
        ("-s 24x16", "-s 24,16", "-s 24X16", "-s 24*16"),
        ("-s 16 --color orange", "-s 16 --material diffuse=orange"),
        ("-s 16 -b white", "-s 16 --background white"),
        ("-s 16 --up +Z", "-s 16 --up z", "-s 16 --up=Z"),
        ("-s 16 --up -Z", "-s 16 --up -z"),
        ("-s 16 --margin 0.2", "-s 16 --margin 20%"),
    ):
        pictures = []
        for argv in ways:
            assert raster("render", CUBE, "--threads", "1", "--no-ground", "-o", "x.png", *argv.split()) == 0
            pictures.append(picture("x.png"))
        same = [each.shape == pictures[0].shape and (each == pictures[0]).all() for each in pictures]
        assert all(same), f"{ways}: {same}"
    for margin in (10, 25):
        flags = ["--margin", f"{margin}%", "--view", "front", "--no-ground"]
        assert raster("render", CUBE, "-s", "100", "-o", "x.png", *flags) == 0
        empty = picture("x.png")[..., 3].any(axis=1).nonzero()[0][0]
        assert abs(empty - margin) <= 1, f"--margin {margin}%: {empty} % of the picture is empty"
    assert_refused(capsys, [([CUBE, "--margin", "0.5"], "margin must be at least 0 and below 0.5")], "render")
    for command in ("render", "compare"):
        for flag in ("-o=--", "-o--", "--output=--", "--size=--", "-s=--", "--light=--"):
            assert_refused(capsys, [([CUBE, flag], "can't have the value --")], command)


def test_a_picture_in_the_place_of_a_model_is_told(capsys):
    """The picture's name would be that of the model: which is the lesser of the two faults."""
    open("pic.png", "wb").write(b"\x89PNG")
    for argv in ([], ["render"], ["sheet"], ["batch"], ["render", "-o", "."]):
        assert raster(*argv, "pic.png") == 3
        assert "pic.png: unknown format 'png'" in (words := one_error(capsys)) and "outputs stand behind -o" in words
    assert os.listdir() == ["pic.png"] and open("pic.png", "rb").read() == b"\x89PNG"
    shutil.copy(ROOT / "models" / "torus.glb", "torus.gif")
    for command in ("turntable", "sheet", "render"):
        argv = ["torus.gif", "--input-format", "glb", "-o", "torus.gif"]
        assert_refused(capsys, [(argv, "which is read")], command, code=4)
    assert open("torus.gif", "rb").read(4) == b"glTF"
