"""The command line: what it writes and says, how it ends. Pictures are small; most runs are in-process."""

import io
import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.command import CUBE, GEAR, PLAIN, SMALL, errors, one_error, picture, run
from PIL import Image

import rasterizer as rz
from rasterizer.cli import main, render_command
from rasterizer.frame import Frame
from rasterizer.renderer import Renderer

pytestmark = pytest.mark.usefixtures("folder")


# --- what is written ----------------------------------------------------------------------------------------


def test_the_default_picture(folder, capsys):
    assert run(CUBE) == 0 and errors(capsys) == ""
    assert os.listdir(folder) == ["cube.png"]
    image = Image.open("cube.png")
    assert (image.size, image.mode, image.format) == ((24, 16), "RGBA", "PNG")
    scene = rz.load(CUBE, lights=rz.tabletop())
    grey = rz.Material(diffuse=0.5)
    scene = replace(scene, meshes=tuple(replace(mesh, material=grey) for mesh in scene.meshes))
    ground = rz.GroundShadow(scene)
    camera = rz.Camera.framing(np.concatenate([scene.meshes[0].vertices, ground.outline()]), aspect=24 / 16)
    expected = rz.render(replace(scene, camera=camera), (24, 16), samples=4, shading="phong")
    expected = ground.under(expected, camera)
    assert np.array_equal(picture("cube.png"), expected.rgba)
    alpha = picture("cube.png")[..., 3]
    assert alpha[0, 0] == 0 and alpha[8, 12] == 255


@pytest.mark.parametrize("suffix", ["jpg", "webp", "bmp", "tif"])
def test_the_suffix_chooses_the_format(suffix, capsys):
    assert run(CUBE, "-o", f"x.{suffix}", "--background", "white") == 0 and errors(capsys) == ""
    assert Image.open(f"x.{suffix}").size == (24, 16)


@pytest.mark.parametrize(
    ("array", "dtype", "shape"),
    [
        ("color", "f4", (16, 24, 3)),
        ("rgb", "u1", (16, 24, 3)),
        ("depth", "f4", (16, 24)),
        ("face", "i4", (16, 24)),
        ("normal", "f4", (16, 24, 3)),
    ],
)
def test_arrays(array, dtype, shape, capsys):
    assert run(CUBE, "--array", array, *PLAIN) == 0 and errors(capsys) == ""
    saved = np.load("cube.npy")
    assert saved.dtype == dtype and saved.shape == shape
    frame = rz.render(rz.load(CUBE), (24, 16), outputs=(array,), samples=1)
    assert np.array_equal(saved, getattr(frame, array))


def test_npy_alone_is_linear_color(capsys):
    assert run(CUBE, "-o", "x.npy", *PLAIN) == 0 and errors(capsys) == ""
    assert np.array_equal(np.load("x.npy"), rz.render(rz.load(CUBE), (24, 16), samples=1).color)


def test_many_models_and_views(folder, capsys):
    assert run(CUBE, GEAR, "--view", "iso", "--view", "top") == 0 and errors(capsys) == ""
    assert sorted(os.listdir(folder)) == ["cube-iso.png", "cube-top.png", "gear-iso.png", "gear-top.png"]


def test_templates_and_folders(folder, capsys):
    os.mkdir("out")
    assert run(CUBE, "-o", "out/{view}_{stem:_>6}.{ext}.png", "--view", "left") == 0
    assert run(CUBE, GEAR, "-o", "out") == 0 and run(CUBE, "-o", "out/", "--array", "face") == 0
    assert errors(capsys) == ""
    assert sorted(os.listdir("out")) == ["cube.npy", "cube.png", "gear.png", "left___cube.obj.png"]


def test_patterns_and_flags_in_any_order(folder, capsys):
    for name in ("b.obj", "a.obj", "{c}.obj", "[d].obj"):
        (folder / name).write_bytes(Path(CUBE).read_bytes())
    assert run("*.obj", "-o", "{stem}.png") == 0
    assert main(["render", *SMALL, "[d].obj", "--shading", "flat", "-o", "{stem}-flat.png", "./a.obj"]) == 0
    assert errors(capsys) == ""
    pictures = {name for name in os.listdir() if name.endswith("png")}
    assert pictures == {"a.png", "b.png", "{c}.png", "[d].png", "[d]-flat.png", "a-flat.png"}


def test_stdin_and_stdout(monkeypatch, capfdbinary):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(Path(CUBE).read_bytes())))
    assert run("-", "--input-format", "obj", "-o", "-", "--json", *PLAIN) == 0
    out, err = capfdbinary.readouterr()
    image = Image.open(io.BytesIO(out))
    assert image.format == "PNG" and np.array_equal(image, rz.render(rz.load(CUBE), (24, 16), samples=4))
    assert json.loads(err)["output"] == "-"


def test_an_array_on_stdout(capfdbinary):
    assert run(CUBE, "-o", "-", "--array", "face") == 0
    assert np.load(io.BytesIO(capfdbinary.readouterr().out)).dtype == np.int32


def test_a_stream_that_takes_a_part_at_a_time(monkeypatch):
    taken = []

    class Stream(io.RawIOBase):
        def write(self, content):
            taken.append(bytes(content[:100]))
            return len(taken[-1])

    class Stdout(io.StringIO):
        buffer = Stream()

    monkeypatch.setattr(sys, "stdout", Stdout())
    assert run(CUBE, "-o", "-") == 0 and run(CUBE) == 0
    assert len(taken) > 1 and b"".join(taken) == Path("cube.png").read_bytes()


def test_the_bound_of_each_output_is_told(capsys, tmp_path):
    scene = rz.Scene(rz.load(CUBE).meshes, [rz.PointLight((1, 2, 3), shadow=rz.Shadow(size=64))])
    scene.save("lit.json")
    assert run("lit.json", "--array", "depth", "-o", "a.npy", "--json", "-v") == 0
    out, err = capsys.readouterr()
    found = json.loads(out)["error_bounds"]
    assert set(found) == {"depth", "depth_share"} and 5e-8 < found["depth_share"] < 7e-8
    assert f"{found['depth']:.2g} scene units of depth ({found['depth_share']:.2g} of itself)" in err
    assert run("lit.json", "-o", "a.png", "--json", "-v") == 0
    out, err = capsys.readouterr()
    (shadow,) = json.loads(out)["error_bounds"]["shadows"]
    assert shadow["light"] == "PointLight" and 0 < shadow["texel"] <= shadow["near"] < 1
    assert "level of 8 bits" in err and "not counted: shadows of PointLights" in err


def test_json(capsys):
    assert run(CUBE, "nope.obj", "--json") == 1
    out, err = capsys.readouterr()
    first, second = map(json.loads, out.splitlines())
    assert second == {"path": "nope.obj", "error": "nope.obj: no such file"} and "nope.obj" in err
    assert first.pop("seconds") > 0 and 0 < first.pop("coverage") < 1 and 0 <= first.pop("error_bound") < 0.01
    bounds = first.pop("error_bounds")
    assert bounds["rgb"] == 1 and [each["light"] for each in bounds["shadows"]] == ["DirectionalLight"]
    assert first == {
        "path": CUBE,
        "view": None,
        "output": "cube.png",
        "size": [24, 16],
        "faces": 12,
        "warnings": [],
    }


def test_the_file_is_the_same_every_time(capsys):
    for threads in (1, 3):
        assert main(["render", CUBE, "-s", "60", "--threads", str(threads), "-o", f"{threads}.png"]) == 0
    assert Path("1.png").read_bytes() == Path("3.png").read_bytes()


# --- what is said -------------------------------------------------------------------------------------------


def test_verbose_and_quiet(capsys):
    assert run(CUBE, "-v") == 0
    err = errors(capsys)
    assert "cube.obj: 12 faces" in err and "cube.png, <Frame 24x16 rgb, 12 faces" in err
    assert run(CUBE, "--zoom", "9", "--eye", "9,9,9", "--target", "20,20,20") == 0
    assert (
        "the picture is empty: the camera looks away, all of the model is behind it; the model reaches from (-1, -1, -1) to"  # noqa: E501
        in errors(capsys)
    )
    assert run(CUBE, "-q", "--eye", "9,9,9", "--target", "20,20,20", "--json") == 0
    out, err = capsys.readouterr()
    assert err == "" and json.loads(out)["coverage"] == 0 and "is empty" in json.loads(out)["warnings"][0]


def test_doubtful_pictures(folder, capsys):
    assert run(CUBE, "--light", "ambient:0") == 0
    assert "the picture is black" in errors(capsys)
    (folder / "away.obj").write_text("v 0 0 0\nv 0 1 0\nv 1 0 0\nf 1 2 3\n")
    assert run("away.obj", "--cull", "back", "--view", "front") == 0
    assert "seen from behind; try --cull none" in errors(capsys)
    (folder / "edge.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert run("edge.obj", "--view", "left") == 0
    assert "try a larger --size" in errors(capsys)
    (folder / "lost.obj").write_text("mtllib lost.mtl\nusemtl red\n" + (folder / "edge.obj").read_text())
    assert run("lost.obj") == 0
    assert errors(capsys).startswith("raster: warning: lost.obj: ")


def test_no_colour_codes(capsys):
    assert run("nope.obj") == 3 and run(CUBE, "-v") == 0
    assert "\x1b" not in errors(capsys)


# --- how it ends --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        ([], "MODEL"),
        ([CUBE, "--shadin", "flat"], "unrecognized arguments: --shadin"),
        ([CUBE, "--shading", "toon"], "invalid choice: 'toon'"),
        ([CUBE, "-s", "10by10"], "WIDTHxHEIGHT"),
        ([CUBE, "-s", "0x10"], "each 1 to 131072 px"),
        ([CUBE, "-s", "199999"], "each 1 to 131072 px"),
        ([CUBE, "--samples", "2"], "invalid choice: 2"),
        ([CUBE, "--threads", "0"], "threads must be"),
        ([CUBE, "--tolerance", "-1"], "tolerance must be"),
        ([CUBE, "--tolerance", "nan"], "finite number"),
        ([CUBE, "--crease-angle", "181"], "--crease-angle"),
        ([CUBE, "--fov", "180"], "fov must be between 0 and 180"),
        ([CUBE, "--elevation", "91"], "elevation"),
        ([CUBE, "--zoom", "0"], "--zoom"),
        ([CUBE, "--up", "w"], "invalid choice: 'w'"),
        ([CUBE, "--eye", "1,2"], "three numbers X,Y,Z"),
        ([CUBE, "--eye", "0,0,0"], "must differ"),
        ([CUBE, "--eye", "1,2,3", "--view", "top"], "--eye and --target"),
        ([CUBE, "--target", "1,2,3"], "--target needs --eye"),
        ([CUBE, "--background", "blurple"], "--background"),
        ([CUBE, "--light", "sun:1"], "ambient:..., directional:..., point:..."),
        ([CUBE, "--light", "ambient:-1"], "negative"),
        ([CUBE, "--light", "ambient:1,1,1"], "color"),
        ([CUBE, "--light", "directional:0,0,0"], "must have a length"),
        ([CUBE, "--light", "directional:0,1"], "three numbers"),
        ([CUBE, "--light", "point:0,1,2,attenuation=0/0/0"], "not all 0"),
        ([CUBE, "--light", "point:0,1,2,size=3"], "'size=3'"),
        ([CUBE, "--light", "point:0,1,2,attenuation=1/d^3"], '"1/d^2"'),
        ([CUBE, "--light", "point:0,1,2,amplify=maybe"], "yes or no"),
        ([CUBE, "--light", "spot:0,1,2"], "needs direction"),
        ([CUBE, "--light", "spot:0,1,2,direction=0/1/0,inner=50"], "inner angle"),
        ([CUBE, "--light", "area:0,1,2,edge_u=1/0/0"], "needs edge_v"),
        ([CUBE, "--light", "area:0,1,2,edge_u=1/0/0,edge_v=0/1/0,resolution=4"], "M/N"),
        ([CUBE, "--light", "point:0,1,2,attached=wall"], "attached"),
        ([CUBE, "-q", "-v"], "not allowed with"),
        ([CUBE, "-o", "x.foo"], "'.foo' is unknown"),
        ([CUBE, "-o", "x"], "without a suffix"),
        ([CUBE, "-o", ""], "-o needs a name"),
        ([CUBE, "-o", "{name}.png"], "may hold {stem}, {ext}, {view}"),
        ([CUBE, "-o", "{stem.png"], "may hold"),
        ([CUBE, "-o", "{stem.upper}.png"], "may hold"),
        ([CUBE, "-o", "x.jpg", "--array", "depth"], "written as .npy"),
        ([CUBE, CUBE], "would both be written to cube.png"),
        ([CUBE, GEAR, "-o", "x.png"], "would both be written to x.png"),
        ([CUBE, "--view", "top", "--view", "left", "-o", "x.png"], "(top) and"),
        ([CUBE, GEAR, "-o", "-"], "stdout takes one picture"),
        (["-"], "--input-format"),
        (["-", "-", "--input-format", "obj"], "once only"),
    ],
)
def test_usage(argv, words, folder, capsys):
    assert run(*argv) == 2
    assert words in one_error(capsys) and not os.listdir(folder)


@pytest.mark.parametrize("argv", [["draw"], ["--foo"], ["-q"]])
def test_a_command_is_needed(argv, capsys):
    assert main(argv) == 2
    assert "raster --help" in one_error(capsys)


def test_terminals_are_refused(monkeypatch, capsys):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert run(CUBE, "-o", "-") == 2 and "stdout is a terminal" in one_error(capsys)
    stdin = io.TextIOWrapper(io.BytesIO())
    stdin.isatty = lambda: True
    monkeypatch.setattr(sys, "stdin", stdin)
    assert run("-", "--input-format", "obj") == 2 and "stdin is a terminal" in one_error(capsys)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("nope.obj", None, "no such file"),
        ("*.obj", None, "no such file"),
        ("empty.obj", b"", "empty"),
        ("points.obj", b"v 0 0 0\n", "faces"),
        ("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "nan.obj"),
        ("short.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "short.obj:4"),
        ("noise.stl", b"\x00\xff" * 500, "noise.stl"),
        ("model.xyz", b"1 2 3", "unknown format 'xyz'"),
        ("model", b"1 2 3", "--input-format"),
    ],
)
def test_unreadable_models(name, content, words, folder, capsys):
    if content is not None:
        (folder / name).write_bytes(content)
    assert run(name) == 3
    assert words in one_error(capsys)
    assert os.listdir(folder) == ([name] if content is not None else [])


def test_a_folder_is_no_model(folder, capsys):
    assert run(folder) == 3 and "is a folder" in one_error(capsys)


def test_bad_faces_can_be_dropped(folder, capsys):
    (folder / "nan.obj").write_text("v nan 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 4 2 3\n")
    assert run("nan.obj", "--drop-bad-faces", "--json") == 0
    assert json.loads(capsys.readouterr().out)["faces"] == 1


def test_one_bad_model_does_not_stop_the_others(folder, capsys):
    assert run("nope.obj", CUBE) == 1
    assert one_error(capsys) and os.listdir(folder) == ["cube.png"]
    assert run("nope.obj", "nada.obj") == 3
    assert errors(capsys).count("raster: error: ") == 2


def test_outputs_that_cannot_be_written(folder, capsys, monkeypatch):
    assert run(CUBE, "-o", f"{CUBE}/x.png") == 4 and "no folder" in one_error(capsys)
    os.mkdir("taken.png")
    assert run(CUBE, "-o", "{stem}.png") == 0

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("rasterizer.frame.os.replace", full)
    assert run(CUBE, "-o", "x.png") == 4 and "No space left" in one_error(capsys)
    assert sorted(os.listdir(folder)) == ["cube.png", "taken.png"]


def test_an_interrupt(folder, capsys, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Renderer, "render", stop)
    assert run(CUBE) == 130
    assert "interrupted" in one_error(capsys) and not os.listdir(folder)


def test_too_little_memory(capsys, monkeypatch):
    def fail(*_):
        raise MemoryError("Unable to allocate 9 TiB")

    monkeypatch.setattr(Renderer, "render", fail)
    assert run(CUBE) == 2 and "not enough memory" in one_error(capsys)
    monkeypatch.setattr(render_command, "draw_models", fail)  # outside of any model
    assert run(CUBE) == 2
    assert one_error(capsys) == "raster: error: not enough memory for command line: Unable to allocate 9 TiB\n"


def test_a_fault_of_ours_in_one_model_is_one_line_and_the_next_model(monkeypatch, folder, capsys):
    encode, calls = Frame.encode, []

    def fail_once(*args, **settings):
        calls.append(args)
        if len(calls) == 1:
            raise ZeroDivisionError("of\nours")
        return encode(*args, **settings)

    monkeypatch.setattr(Frame, "encode", fail_once)
    assert run(CUBE, GEAR) == 1 and os.listdir(folder) == ["gear.png"]
    assert one_error(capsys) == (
        f"raster: error: {CUBE}: internal error: ZeroDivisionError: of ours (run with -v for the traceback, and please report it)\n"  # noqa: E501
    )
    calls.clear()
    assert run(CUBE, "-v") == 1
    err = capsys.readouterr().err
    assert "Traceback (most recent call last)" in err and "in fail_once" in err


def test_a_fault_of_ours_in_a_reader_is_one_line_and_the_next_model(monkeypatch, folder, capsys):
    def fail(_model):
        raise IndexError("too far")

    monkeypatch.setattr("rasterizer.io.obj.read_obj", fail)
    assert run(CUBE, GEAR, "--json") == 1 and os.listdir(folder) == ["gear.png"]
    out, err = capsys.readouterr()
    assert err.count("internal error: IndexError: too far") == 1 and err.count("\n") == 1
    failed, drawn = map(json.loads, out.splitlines())
    assert "internal error" in failed["error"] and drawn["faces"]
    assert run(CUBE, "-v") == 1 and "in fail" in capsys.readouterr().err
