"""Outputs: which models are read and where pictures go; arrays; whole files, never in the place of what is read, and
nothing is left over."""

import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.command import (
    CUBE,
    GEAR,
    PLAIN,
    SMALL,
    assert_refused,
    end_once_it_says_now,
    errors,
    one_error,
    picture,
    raster,
    run,
)
from helpers.odd_format import odd_format
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz
from rasterizer.choices import BUFFERS

GLOBE = ("globe.obj", "globe.mtl", "globe.png")
pytestmark = pytest.mark.usefixtures("folder")


# --- names ------------------------------------------------------------------------------------------------------------


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
    templates = """{stem:>99999999999}.png {stem:{view}}.png {0}.png {}.png {stem.a}.png {stem[0]}.png
        {frame:03}.png }.png {stem:e}.png {name}.png {stem.png {stem.upper}.png"""
    legal = "-o may hold {stem}, {ext}, {folder}, {view}, padded as in"
    assert_refused(capsys, [([CUBE, "-o", template], legal) for template in templates.split()], "render")
    assert_refused(capsys, [([CUBE, "-o", "{stem:>300}.png"], "too long")], "render", code=4)
    (folder / "file").write_text("x")
    assert_refused(capsys, [
        (["nope.obj", "-o", "file/deep/x.png"], "file is no folder\n"),
        ([CUBE, "-o", f"{CUBE}/x.png"], "no folder"),
    ], "render", code=4)  # fmt: skip
    assert_refused(capsys, [(["nope.obj", "-o", "never/x.png"], "no such file")], "render", code=3)
    assert_refused(
        capsys, [([CUBE, GEAR, "-o", "thumbs"], f"; a folder is written {os.path.join('thumbs', '')}\n")], "render"
    )


def test_two_pictures_of_one_name_are_refused(folder, capsys):
    os.makedirs("b")
    for name in ("x.obj", "b/x.obj", "y.obj"):
        shutil.copy(CUBE, name)
    shutil.copy(GEAR, "x.stl")
    (folder / "a.png").write_bytes(b"")
    os.link(folder / "a.png", folder / "z.png")
    for words in (
        "x.obj b/x.obj -o out/",
        "x.obj x.obj",
        "x.obj y.obj -o out.png",
        "x.obj x.stl -o {stem}.png",
        "x.obj -o out.png --view top,front",
        "x.obj y.obj -o a.png --view top",
    ):
        assert_refused(capsys, [(words.split(), "would both be written to")], "render")
        assert run(*words.split()) == 2 and "{stem}, {view}, {ext}" in one_error(capsys)
    assert run("x.obj", "y.obj", "x.stl", "--view", "top,front", "-q", "-o", "{stem}-{view}-{ext}.png") == 0
    for name in ("a.obj", "z.obj"):
        shutil.copy(CUBE, name)
    assert_refused(capsys, [(["a.obj", "z.obj"], "would both be written")], "render")


def test_models_of_one_name_are_told_apart_by_the_template(folder, capsys):
    """Names never depend on what else is drawn."""
    shutil.copy(CUBE, "part.obj")
    shutil.copy(GEAR, "part.stl")
    assert_refused(capsys, [(["part.obj", "part.stl", CUBE], "{ext}")], "render")
    assert run("part.obj", "part.stl", CUBE, "-q", "-o", "{stem}-{ext}.png") == 0
    assert {"part-obj.png", "part-stl.png", "cube-obj.png"} < set(os.listdir(folder))


def test_recursive_takes_all_models_below_and_keeps_their_folders(folder, capsys):
    for name in ("a/x.obj", "a/b/x.obj", "a/b/x.stl", "a/.hidden/y.obj", "a/c {1}/y.obj", "empty/z.txt", "a/own.json"):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(GEAR if name.endswith("stl") else CUBE, path)
    assert run("a", "-o", "out/", "--recursive") == 0
    assert found("out") == ["b/x.obj.png", "b/x.stl.png", "c {1}/y.obj.png", "x.obj.png"]
    assert run("a", "-o", "jpg/{folder}/{stem}.{ext}.jpg", "--recursive") == 0
    assert found("jpg") == ["b/x.obj.jpg", "b/x.stl.jpg", "c {1}/y.obj.jpg", "x.obj.jpg"]
    assert run("a", "-o", "webp/", "--format", "WEBP", "--recursive") == 0
    assert found("webp") == ["b/x.obj.webp", "b/x.stl.webp", "c {1}/y.obj.webp", "x.obj.webp"]
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
    for command in ("render", "sheet", "compare", "demo", "turntable", "batch"):
        name = "x.gif" if command == "turntable" else "x.png"
        (folder / name).write_bytes(b"old")
        model = [] if command == "demo" else [CUBE]
        assert raster(command, *model, "-s", "8", "-o", name, "--skip-existing") == 0
        assert (folder / name).read_bytes() == b"old", command


def test_a_camera_comes_from_a_file(folder, capsys):
    scene = rz.load(CUBE)
    camera = rz.Camera.perspective((4, 3, 2), fov=40)
    rz.save(rz.Scene(scene.meshes, camera=camera), "cam.json")
    (folder / "alone.json").write_text(json.dumps({"position": [4, 3, 2], "fov": 40}))
    (folder / "framing.json").write_text(json.dumps({"camera": {"azimuth": 90, "elevation": 0}}))
    rz.save(rz.Scene(scene.meshes), "none.json")
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
        ([CUBE, "--camera", "cam.json", "--view", "top"], "given --camera, --view"),
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


# --- arrays -----------------------------------------------------------------------------------------------------------


def test_arrays_are_those_of_the_library(capsys):
    cube = rz.load(CUBE)
    for name, dtype in (("color", "f4"), ("rgb", "u1"), ("depth", "f4"), ("face", "i4"), ("normal", "f4")):
        assert run(CUBE, "--array", name, *PLAIN) == 0
        saved, expected = (
            np.load("cube.npy"),
            getattr(rz.render(cube, (24, 16), outputs=(name,), shading="gouraud"), name),
        )
        assert saved.dtype == dtype and np.array_equal(saved, expected), name
    assert run(CUBE, "-o", "x.npy", *PLAIN) == 0, "the suffix alone asks for linear colours"
    assert not differences(np.load("x.npy"), rz.render(cube, (24, 16), shading="gouraud").color)
    assert errors(capsys) == ""


def test_one_array_is_an_npy_and_several_are_an_npz(folder):
    assert run(CUBE, "--array", "mask") == 0 and np.load("cube.npy").dtype == bool
    assert run(CUBE, "--array", "depth", "--array", "object", "--array", "depth") == 0
    with np.load("cube.npz") as found:
        assert list(found) == ["depth", "object"] and found["object"].max() == 0
    assert run(CUBE, "--array", "all", "-o", "all.npz") == 0
    with np.load("all.npz") as found:
        assert set(found) == {"color", *BUFFERS} and found["position_camera"].shape == (16, 24, 3)


def test_depth_is_written_in_millimetres_or_at_a_given_scale(folder, capsys):
    assert run(CUBE, "--array", "depth", "-o", "a.npy") == 0
    depth = np.load("a.npy").astype(float)
    for name, scale, flags in (("mm.png", 0.001, ()), ("cm.png", 0.01, ("--scale", "0.01"))):
        assert run(CUBE, "--array", "depth", "-o", name, *flags) == 0
        with Image.open(name) as image:
            assert float(image.text["scale"]) == scale
            stored = np.asarray(image).astype(int)
        assert np.array_equal(stored, np.where(np.isfinite(depth), np.rint(depth / scale), 0)), name
    assert run(CUBE, "--array", "depth", "--scale", "1e-6", "-o", "b.png") == 4
    assert "scale=" in one_error(capsys) and not (folder / "b.png").exists()


def test_exr_files_hold_the_picture_or_arrays():
    exr = pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    for flags, channels in (
        ("", {*"RGBA"}),
        ("--array color --array face", {*"RGBA", "id.face"}),
        ("--array depth --array face", {"Z", "id.face"}),
    ):
        assert run(CUBE, "-o", "a.exr", *flags.split()) == 0
        with exr.File("a.exr", separate_channels=True) as file:
            assert (got := set(file.channels())) == channels, f"{flags}: {got}"


def test_stdout_takes_one_array_or_several(capfdbinary):
    assert run(CUBE, "-o", "-", "--array", "face") == 0
    assert np.load(io.BytesIO(capfdbinary.readouterr().out)).dtype == np.int32
    assert run(CUBE, "-q", "--array", "mask", "--array", "face", "-o", "-") == 0
    with np.load(io.BytesIO(capfdbinary.readouterr().out)) as found:
        assert list(found) == ["mask", "face"]


def test_a_format_is_that_of_stdout_or_refused(capfdbinary):
    for argv, start in (("", b"\x89PNG"), ("--format jpg", b"\xff\xd8"), ("--format .WEBP", b"RIFF"),
                        ("--format npz", b"PK"), ("--array depth --format png --scale 1", b"\x89PNG")):  # fmt: skip
        assert run(CUBE, "-o", "-", *argv.split()) == 0
        assert capfdbinary.readouterr().out.startswith(start), argv
    for name, format in (("x.jpg", "JPG"), ("x.jpeg", "jpg"), ("x.tif", "tiff")):
        assert run(CUBE, "-o", name, "--format", format) == 0
    for place in (".", "out/", "my.dir/"):
        assert run(CUBE, "-o", place, "--format", "npy") == 0
        assert np.load(f"{place}/cube.npy").dtype == np.float32, "as of -o x.npy"
        assert run(CUBE, "-o", place, *["--array", "depth", "--format", "png", "--scale", "0.001"]) == 0


def test_a_format_that_no_output_takes_is_refused(capsys):
    assert_refused(capsys, [([CUBE, *argv.split()], words) for argv, words in (
        ("-o x --format jpg", "a folder is written x"),
        ("-o out/ -o bare --format jpg", "a folder is written bare"),
        ("-o= --format jpg", "-o needs a name"),
        ("-o x.png --format jpg", "given --format jpg and -o x.png"),
        ("-o - --format nope", "no format to write"),
        ("--format npy --colorbar", "is drawn beside a picture"),
        ("-o - --format exr --array rgb --array depth", "exr"),
    )], "render")  # fmt: skip


@pytest.fixture
def globe(folder):
    """A textured model, whose default picture would be named like its texture."""
    for name in GLOBE:
        shutil.copy(ROOT / "models" / name, folder / name)
    return folder


# --- what is read is not replaced ---------------------------------------------------------------------------


def test_a_texture_is_not_replaced_by_any_name_or_link(globe, capsys):
    (globe / "soft.png").symlink_to("globe.png")
    os.link(globe / "globe.png", globe / "hard.png")
    (globe / "again").symlink_to(".")
    before = (globe / "globe.png").read_bytes()
    outputs = ("globe.png", "./globe.png", "{stem}.png", ".", "soft.png", "hard.png", "again/globe.png")
    cases = [["globe.obj", "-s", "8", "--no-ground", "-o", output] for output in outputs]
    for argv in (*cases, cases[0][:-2], [*cases[0], "--view", "iso"]):
        assert_refused(capsys, [(argv, "which is read; give another name")], "render", code=4)
    argv = ["globe.obj", "-s", "8", "-o", "hard.png", "--no-reference", "--methods", "flat,phong"]
    assert_refused(capsys, [(argv, "which is read; give another name")], "compare", code=4)
    assert raster("render", *cases[0][:-2], "--json") == 4 and (globe / "globe.png").read_bytes() == before


def test_models_scenes_and_textures_of_flags_are_not_replaced(folder, capsys):
    shutil.copy(CUBE, folder / "cube.png")  # a model by any name
    shutil.copy(CUBE, folder / "part.png")
    (folder / "scene.json").write_text(json.dumps({"meshes": [{"file": "part.obj"}]}))
    (folder / "part.obj").symlink_to("part.png")
    Image.new("RGB", (2, 2)).save(folder / "t.png")
    shutil.copy(ROOT / "models" / "globe.obj", folder / "g.obj")
    assert_refused(capsys, [
        (["-q", "cube.png", "--input-format", "obj"], "it is cube.png, which is read"),
        (["-q", "scene.json", "-o", "part.png"], "which is read"),
        (["-q", "g.obj", "--material", "texture=t.png", "-o", "t.png"], "it is t.png, which is read"),
    ], "render", code=4)  # fmt: skip
    assert (folder / "part.png").read_bytes() == open(CUBE, "rb").read()


def test_what_an_earlier_model_has_read_is_not_replaced_by_a_later_one(folder, capsys):
    one, two = folder / "one", folder / "two"
    one.mkdir()
    two.mkdir()
    shutil.copy(CUBE, one / "a.obj")
    for name in GLOBE:
        shutil.copy(ROOT / "models" / name, two / ("a.png" if name == "globe.png" else name))
    (two / "globe.mtl").write_text((two / "globe.mtl").read_text().replace("globe.png", "a.png"))
    texture = (two / "a.png").read_bytes()
    assert run("two/globe.obj", "one/a.obj", "-o", "two/{stem}.png") == 1
    err = capsys.readouterr().err
    assert "can't write two/a.png: it is" in err and "globe.png" not in err
    assert (two / "a.png").read_bytes() == texture and Image.open(two / "globe.png").size == (24, 16)


def test_pictures_of_an_earlier_run_are_replaced_also_where_this_one_is_interrupted(globe):
    shutil.copy(CUBE, globe / "a.obj")
    for size in ("8", "12"):
        assert raster("render", "a.obj", "globe.obj", "--no-ground", "-s", size, "-o", "{stem}-drawn.png") == 0
        sizes = {name: Image.open(globe / name).size for name in ("a-drawn.png", "globe-drawn.png")}
        assert set(sizes.values()) == {(int(size), int(size))}, sizes
    shutil.copy(CUBE, globe / "b.odd")
    with odd_format(KeyboardInterrupt()):
        assert raster("render", "a.obj", "b.odd", "--no-ground", "-s", "9", "-o", "{stem}-drawn.png") == 130
    assert Image.open(globe / "a-drawn.png").size == (9, 9), "what had been drawn is written"


# --- modes, and what is left over ---------------------------------------------------------------------------


def test_a_full_disk_or_an_interrupt_leaves_no_half_file(folder, capsys, monkeypatch):
    """The system's `os.replace`, by which a whole file comes to its place, fails or doesn't return."""
    for fault, code, words in (
        (OSError(28, "No space left on device"), 4, "can't write x.png: No space left on device"),
        (KeyboardInterrupt(), 130, "raster: error: interrupted\n"),
        (MemoryError("Unable to allocate 9 TiB"), 2, f"not enough memory for {CUBE} at (24, 16): Unable to allocate 9"),
    ):

        def fail(*_, fault=fault):
            raise fault

        monkeypatch.setattr(os, "replace", fail)
        assert run(CUBE, "-o", "x.png") == code
        assert words in one_error(capsys) and not os.listdir(folder), fault


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_signal_while_writing_leaves_nothing(folder, alone):
    code = (
        "import os, sys, time\n"
        "from rasterizer.cli import main\n"
        "real = os.replace\n"
        "def replace(*places):\n"
        "    print('now', flush=True); time.sleep(30); real(*places)\n"
        "os.replace = replace\n"
        "sys.argv[1:] = ['render', sys.argv[1], '-s', '16', '-o', 'x.png', '--preset', 'studio']\n"
        "sys.exit(main())"
    )
    end_once_it_says_now(code)
    assert not os.listdir(folder)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(
    "delays", [(0.0, 0.15), pytest.param((0.01, 0.02, 0.05, 0.1, 0.2, 0.4), marks=pytest.mark.nightly)]
)
def test_an_interrupt_at_any_time_shows_no_traceback(folder, delays, alone):
    """From the moment on at which the package is reached; before that, the process is Python's."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    for delay in delays:
        code = "import sys, rasterizer.cli as c; print('now', flush=True); sys.exit(c.main())"
        command = [sys.executable, "-c", code, "render", CUBE, "-s", "2000", "-o", "x.png"]
        process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        process.stdout.readline()
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
        if err.startswith(b"Traceback") and b"cli" not in err:
            continue  # it came before `main` was entered
        assert b"Traceback" not in err and process.returncode in (0, 130), (delay, err.decode())
        if process.returncode == 130:
            assert err.endswith(b"raster: error: interrupted\n")


def test_names_of_files_as_long_as_no_system_takes_them(folder, capsys):
    long = "x" * 300
    for argv, code in (([f"{long}.obj"], 3), ([f"{long}.json"], 3), ([CUBE, "-o", f"{long}.png"], 4)):
        assert run(*argv) == code and "too long" in one_error(capsys).lower(), argv[-1][-5:]


def test_libraries_say_nothing_on_stderr(folder, capfd):
    """Neither do those in C."""
    (folder / "m.obj").write_bytes(
        b"mtllib m.mtl\nv 0 0 0\nv 1e99 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nf 1 2 3\n"
    )
    (folder / "m.mtl").write_text("newmtl a\nmap_Kd t.tif\n")
    Image.new("RGB", (4, 4)).save(folder / "t.tif", compression="tiff_lzw")
    data = bytearray((folder / "t.tif").read_bytes())
    data[-20:] = b"\xff" * 20
    (folder / "t.tif").write_bytes(data)
    run("m.obj")
    err = capfd.readouterr().err
    assert err and all(line.startswith("raster: ") for line in err.splitlines()), err
