"""Which models are read and where their pictures go: folders, names that collide, what is there already."""

import json
import os
import shutil

import pytest
from helpers.command import CUBE, GEAR, PLAIN, SMALL, errors, one_error, picture, run
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.cli import main

pytestmark = pytest.mark.usefixtures("folder")


@pytest.fixture
def tree(folder):
    """Models in folders below each other, a hidden one, and files that are no models."""
    for name in ("a/x.obj", "a/b/x.obj", "a/b/x.stl", "a/.hidden/y.obj", "a/c {1}/y.obj", "empty/z.txt", "a/own.json"):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(GEAR if name.endswith("stl") else CUBE, path)
    return folder


def found(below):
    """The files below a folder, by their names from there."""
    names = (os.path.relpath(os.path.join(path, name), below) for path, _, names in os.walk(below) for name in names)
    return sorted(name.replace(os.sep, "/") for name in names)


def test_folders_of_outputs_are_made(folder):
    assert run(CUBE, "-o", "new/deep er/ü/{stem}.png") == 0 and os.path.exists("new/deep er/ü/cube.png")
    assert run(CUBE, "-o", "other/") == 0 and os.listdir("other") == ["cube.png"]
    assert run("nope.obj", "-o", "never/x.png") == 3 and not os.path.exists("never")


def test_a_folder_is_told_from_a_file_without_a_suffix(folder, capsys):
    assert run(CUBE, GEAR, "-o", "thumbs") == 2
    assert one_error(capsys).endswith(f"; a folder is written {os.path.join('thumbs', '')}\n")
    assert run(".") == 3 and ".: is a folder; give the models in it" in one_error(capsys)


@pytest.mark.parametrize(
    ("argv", "way_out"),
    [
        (["x.obj", "b/x.obj", "-o", "out/"], "--recursive with the folder above them keeps folders"),
        (["x.obj", "b/x.obj", "-o", "{stem}-{view}-{ext}.png"], "--recursive with the folder above them keeps folders"),
        (["x.obj", "x.obj"], "a model is drawn once"),
        (["x.obj", "y.obj", "-o", "out.png"], "template such as '{stem}.png'"),
        (["x.obj", "x.stl", "-o", "{stem}.png"], "template such as '{stem}-{ext}.png'"),
        (["x.obj", "-o", "out.png", "--view", "top,front"], "template such as '{stem}-{view}.png'"),
        (["x.obj", "y.stl", "-o", "a.png", "--view", "top,front"], "template such as '{stem}-{view}.png'"),
    ],
)
def test_the_way_out_of_one_name_for_two_pictures_leads_out(folder, capsys, argv, way_out):
    os.makedirs("b")
    for name in ("x.obj", "b/x.obj", "y.obj"):
        shutil.copy(CUBE, name)
    for name in ("x.stl", "y.stl"):
        shutil.copy(GEAR, name)
    assert run(*argv) == 2
    text = one_error(capsys)
    assert "would both be written to" in text and way_out in text
    if "template" in text:
        argv[argv.index("-o") + 1] = text.split("'")[-2]
        assert run(*argv, "-q") == 0


def test_a_folder_that_cannot_be_made_is_told_before_anything_is_drawn(folder, capsys):
    (folder / "file").write_text("x")
    assert run("nope.obj", "-o", "file/deep/x.png") == 4
    assert one_error(capsys).endswith("file is no folder\n")


def test_models_that_differ_in_their_suffix_alone_get_it(folder):
    shutil.copy(CUBE, "part.obj")
    shutil.copy(GEAR, "part.stl")
    assert run("part.obj", "part.stl", CUBE, "-q") == 0
    assert {"part-obj.png", "part-stl.png", "cube.png"} < set(os.listdir(folder))
    assert run("part.obj", "part.stl", "-o", "out/", "--view", "top,front") == 0
    assert found("out") == ["part-obj-front.png", "part-obj-top.png", "part-stl-front.png", "part-stl-top.png"]


def test_recursive_takes_all_models_below_and_keeps_their_folders(tree, capsys):
    assert run("a", "-o", "out/", "--recursive") == 0
    assert found("out") == ["b/x-obj.png", "b/x-stl.png", "c {1}/y.png", "x.png"]
    assert run("a", "--recursive", "-o", "flat/{stem}-{ext}.png") == 2
    assert "would both be written" in one_error(capsys)
    assert run("empty", "--recursive") == 2
    assert "empty: there is no model in this folder, nor below; legal are obj" in one_error(capsys)
    assert run("a") == 3 and "or --recursive" in one_error(capsys)
    assert main(["info", "a", "--recursive", "--json"]) == 0
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
    expected = rz.render(rz.load(CUBE, camera=camera), (24, 16), samples=4).rgba  # as PLAIN has it
    for name in ("cam.json", "alone.json"):
        assert run(CUBE, "--camera", name, "-o", "x.png", *PLAIN) == 0 and (picture("x.png") == expected).all(), name
    assert (
        run(CUBE, "--camera", "framing.json", "-o", "x.png", *PLAIN) == 0
        and run(CUBE, "--view", "right", "-o", "y.png", *PLAIN) == 0
    )
    assert (picture("x.png") == picture("y.png")).all()
    assert run("cam.json", "--camera", "file", "-o", "x.png", *PLAIN) == 0 and (picture("x.png") == expected).all()
    assert run("cam.json", "--camera", "frame", "-o", "x.png", *PLAIN) == 0 and run(CUBE, "-o", "y.png", *PLAIN) == 0
    assert (picture("x.png") == picture("y.png")).all()
    for argv, code, words in (
        (["--camera", "none.json"], 2, "none.json: the scene has no camera"),
        (["--camera", "gone.json"], 3, "gone.json"),
        (["--camera", "file"], 2, "the model brings no camera"),
        (["--camera", "cam.json", "--view", "top"], 2, "can't be used with other flags"),
        (["--camera", "cam.json", "-o", "cam.json"], 2, "no format to write"),
    ):
        assert run(CUBE, *argv) == code and words in one_error(capsys)
    os.rename("cam.json", "cam.png")
    os.link("cam.png", "linked.json")
    assert run(CUBE, "--camera", "linked.json", "-o", "cam.png") == 4 and "which is read" in one_error(capsys)


def test_flags_that_people_type():
    def same(*pairs):
        for number, argv in enumerate(pairs):
            assert main(["render", CUBE, "--threads", "1", "-o", f"{number}.png", *argv]) == 0
        first, *others = (picture(f"{number}.png") for number in range(len(pairs)))
        assert all(first.shape == other.shape and (first == other).all() for other in others)

    same(["-s", "24x16"], ["-s", "24,16"], ["-s", "24X16"], ["-s", "24*16"])
    same([*SMALL, "--color", "orange"], [*SMALL, "--material", "diffuse=orange"])
    same([*SMALL, "-b", "white"], [*SMALL, "--background", "white"])
    same([*SMALL, "--up", "+Z"], [*SMALL, "--up", "z"], [*SMALL, "--up=Z"])
    same([*SMALL, "--up", "-Z"], [*SMALL, "--up", "-z"])
    same([*SMALL, "--margin", "0.2"], [*SMALL, "--margin", "20%"])


def test_the_margin_stays_empty(capsys):
    for margin in ("10%", "25%"):
        assert (
            main(["render", CUBE, "-s", "200", "--margin", margin, "-o", "x.png", "--view", "front", "--no-ground"])
            == 0
        )
        rows = picture("x.png")[..., 3].any(axis=1).nonzero()[0]
        empty = rows[0] / 200
        assert abs(empty - float(margin[:-1]) / 100) <= 1 / 100, f"{margin}: {empty:.3f} of the picture is empty"
    assert run(CUBE, "--margin", "0.5") == 2 and "margin must be at least 0 and below 0.5" in one_error(capsys)


def test_no_new_command_replaces_what_it_reads(capsys):
    shutil.copy(ROOT / "models" / "torus.glb", "torus.gif")
    for command in ("turntable", "sheet", "render"):
        assert main([command, "torus.gif", "--input-format", "glb", "-o", "torus.gif"]) == 4
        assert "which is read" in one_error(capsys)
    assert open("torus.gif", "rb").read(4) == b"glTF"


def test_a_picture_in_the_place_of_a_model_is_told(capsys):
    """The picture's name would be that of the model: which is the lesser of the two faults."""
    open("pic.png", "wb").write(b"\x89PNG")
    for argv in ([], ["render"], ["sheet"], ["batch"], ["render", "-o", "."]):
        assert main([*argv, "pic.png"]) == 3, argv
        assert "pic.png: unknown format 'png'" in (words := one_error(capsys)) and "outputs stand behind -o" in words
    assert os.listdir() == ["pic.png"] and open("pic.png", "rb").read() == b"\x89PNG"
