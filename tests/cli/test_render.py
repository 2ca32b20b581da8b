"""The command line: what it writes and says, how it ends. Pictures are small; runs are in-process."""

import glob
import io
import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.command import CUBE, GEAR, PLAIN, SMALL, assert_refused, errors, loaded, one_error, picture, raster, run
from helpers.odd_format import odd_format
from PIL import Image

import rasterizer as rz

pytestmark = pytest.mark.usefixtures("folder")


# --- what is written ----------------------------------------------------------------------------------------


def test_the_default_picture(folder, capsys):
    assert raster("render", *SMALL, CUBE) == 0 and errors(capsys) == ""
    assert os.listdir(folder) == ["cube.png"]
    image = Image.open("cube.png")
    assert (image.size, image.mode, image.format) == ((24, 16), "RGBA", "PNG")
    assert not differences(picture("cube.png"), rz.render(CUBE, (24, 16)).rgba)
    assert raster("render", *SMALL, CUBE, "--ground", "-o", "ground.png") == 0
    assert not differences(picture("ground.png"), rz.render(CUBE, (24, 16), ground=True).rgba)
    alpha = picture("cube.png")[..., 3]
    assert alpha[0, 0] == 0 and alpha[8, 12] == 255
    for threads in (1, 3):
        assert raster("render", CUBE, "-s", "60", "--threads", str(threads), "-o", f"{threads}.png") == 0
    assert Path("1.png").read_bytes() == Path("3.png").read_bytes()


def test_the_suffix_chooses_the_format(capsys):
    names = {"jpg": "JPEG", "webp": "WEBP", "bmp": "BMP", "tif": "TIFF", "PNG": "PNG"}
    for suffix, name in names.items():
        assert run(CUBE, "-o", f"x.{suffix}", "--background", "white") == 0
        image = Image.open(f"x.{suffix}")
        assert (image.size, image.format) == ((24, 16), name)
    assert errors(capsys) == ""
    shown = np.asarray(Image.open("x.jpg").convert("RGB")).astype(int)
    assert np.abs(shown - picture("x.PNG")[..., :3]).mean() < 3


def test_stdin_and_stdout(monkeypatch, capfdbinary):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(Path(CUBE).read_bytes())))
    assert run("-", "--input-format", "obj", "-o", "-", "--json", *PLAIN) == 0
    out, err = capfdbinary.readouterr()
    image = Image.open(io.BytesIO(out))
    assert image.format == "PNG" and not differences(
        image, rz.render(rz.load(CUBE), (24, 16), samples=4, shading="gouraud")
    )
    assert json.loads(err)["output"] == "-"


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


def test_terminals_are_refused(monkeypatch, capsys):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert_refused(capsys, [([CUBE, "-o", "-"], "stdout is a terminal")], "render")
    stdin = io.TextIOWrapper(io.BytesIO())
    stdin.isatty = lambda: True
    monkeypatch.setattr(sys, "stdin", stdin)
    assert_refused(capsys, [(["-", "--input-format", "obj"], "stdin is a terminal")], "render")


# --- the look where nothing asks for another, and the tabletop of --ground -------------------------------------


def test_the_ground_brings_its_lights_where_the_model_has_none():
    assert loaded(CUBE).scene.lights == rz.studio()
    assert loaded(CUBE, "--ground").scene.lights == rz.tabletop()
    for flags in ("--preset headlight", "--light directional:0,-1,0"):
        assert loaded(CUBE, "--ground", *flags.split()).scene.lights == loaded(CUBE, *flags.split()).scene.lights, flags
    for shading in ("flat", "gouraud"):
        lights = loaded(CUBE, "--ground", "--shading", shading).scene.lights
        assert all(getattr(light, "shadow", None) is None for light in lights), shading
    shadows = {light.shadow for light in loaded(CUBE, "--ground", "--shadows", "--shadow-size", "64").scene.lights[1:]}
    assert shadows == {rz.Shadow(64)}, "flags for shadows come first"


def test_a_scene_file_keeps_its_lights_and_may_ask_for_the_ground(folder):
    cube = {"vertices": rz.load(CUBE).meshes[0].vertices.tolist(), "faces": rz.load(CUBE).meshes[0].faces.tolist()}
    table = {"meshes": [cube], "lights": ["headlight"]}
    (folder / "scene.json").write_text(json.dumps(table))
    assert loaded("scene.json", "--ground").scene.lights == rz.headlight()
    (folder / "ground.json").write_text(json.dumps(table | {"options": {"ground": True}}))
    for name, flags in (("flag.png", ["scene.json", "--ground"]), ("file.png", ["ground.json"])):
        assert raster("render", *SMALL, *flags, "-o", name) == 0
    assert raster("render", *SMALL, "ground.json", "--no-ground", "-o", "none.png") == 0
    assert not differences(picture("file.png"), picture("flag.png")) and differences(
        picture("none.png"), picture("flag.png")
    )


def test_an_array_has_no_ground_and_the_same_camera(capsys):
    assert raster("render", *SMALL, CUBE, "-o", "x.png", "--ground") == 0
    assert raster("render", *SMALL, CUBE, "--ground", "--array", "face", "-o", "x.npy") == 0
    covered = np.load("x.npy") >= 0
    assert picture("x.png")[..., 3][covered].min() > 100
    capsys.readouterr()
    coverages = []
    for flags in ([], ["--ground"]):
        assert raster("render", *SMALL, CUBE, "--json", "--eye", "3,3,5", *flags) == 0
        coverages.append(json.loads(capsys.readouterr().out)["coverage"])
    assert coverages[0] == coverages[1], "coverage counts the model alone"


# --- what is said -------------------------------------------------------------------------------------------


def test_json_has_a_line_for_each_picture_and_each_failure(capsys):
    assert run(CUBE, "nope.obj", "--json") == 1
    out, err = capsys.readouterr()
    first, second = map(json.loads, out.splitlines())
    assert second == {"status": "failed", "model": "nope.obj", "error": "nope.obj: no such file"} and "nope.obj" in err
    assert first.pop("seconds") > 0 and 0 < first.pop("coverage") < 1 and 0 <= first.pop("error_bound") < 0.01
    assert first == {
        "status": "drawn", "model": CUBE, "view": None, "seed": None, "output": "cube.png", "arrays": None,
        "size": [24, 16], "faces": 12, "warnings": [],
    }  # fmt: skip


def test_verbose_and_quiet(capsys):
    assert run(CUBE, "-v") == 0
    err = errors(capsys)
    assert "cube.obj: 12 faces" in err and "cube.png, <Frame 24x16 rgb, 12 faces" in err and "\x1b" not in err
    assert "4 samples a pixel" in err and len(err.splitlines()) == 4 and "float32" not in err
    assert run(CUBE, "-vv") == 0
    assert "1 channel; " in (err := errors(capsys)) and "1 material, all in float32" in err
    away = ["--eye", "9,9,9", "--target", "20,20,20"]
    assert run(CUBE, "-q", *away, "--json") == 0
    out, err = capsys.readouterr()
    assert err == "" and json.loads(out)["coverage"] == 0 and "is empty" in json.loads(out)["warnings"][0]


def test_doubtful_pictures(folder, capsys):
    face = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (folder / "edge.obj").write_text(face)
    (folder / "away.obj").write_text("v 0 0 0\nv 0 1 0\nv 1 0 0\nf 1 2 3\n")
    (folder / "black.mtl").write_text("newmtl black\nKd 0 0 0\n")
    (folder / "black.obj").write_text("mtllib black.mtl\nusemtl black\n" + face)
    (folder / "dark.obj").write_text("v 0 0 0 0 0 0\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n")
    (folder / "lost.obj").write_text("mtllib lost.mtl\nusemtl red\n" + face)
    camera = rz.Camera.perspective((9, 9, 9), (20, 20, 20))
    rz.save(rz.Scene(rz.load(CUBE).meshes, camera=camera), "away.json")
    rz.save(rz.Scene(rz.load(CUBE).meshes, camera=replace(camera, target=(0, 0, 0), near=0.1, far=1.0)), "far.json")
    rz.save(rz.Scene(rz.load(CUBE).meshes, camera=replace(camera, target=(0, 0, 0), near=90.0)), "near.json")
    away = "the picture is empty: the camera looks away, all of the model is behind it; the model reaches from "
    for argv, words in (
        (f"{CUBE} --zoom 9 --eye 9,9,9 --target 20,20,20", away + "(-1, -1, -1) to (1, 1, 1); try another --eye"),
        (f"{CUBE} --light ambient:0", "cube.obj: the picture is black: no light reaches what is seen"),
        (f"{CUBE} --exposure 12", "cube.obj: the picture is white: its lights are too bright"),
        ("black.obj", "the picture is black: so are its materials or colours"),
        ("dark.obj", "the picture is black: so are its materials or colours"),
        ("away.obj --cull back --view front", "seen from behind; try --cull none"),
        ("edge.obj --view left", "the model covers no sample; try a larger --size"),
        (f"{CUBE} --material opacity=0", "every material is invisible, its opacity is 0"),
        ("away.json", "the camera of the file sees nothing of it; try --view iso"),
        ("far.json", "beyond the far plane at 1, 1"),
        ("near.json", "before the near plane at 90"),
        ("lost.obj", "lost.mtl"),
    ):
        assert run(*argv.split(), "-o", "x.png") == 0
        err = errors(capsys)
        assert err.startswith("raster: warning: ") and err.count("\n") == 1 and words in err, f"{argv}: {err}"


# --- how it ends --------------------------------------------------------------------------------------------


# What stands behind `raster render cube.obj`, and a word of what is said of it.
REFUSED = """
--shadin flat | --shadin
-s 10by10 | WIDTHxHEIGHT
-s 0x10 | 131072
--samples 2 | choice
--tolerance nan | finite
--zoom 0 | --zoom
--eye 1,2 | X,Y,Z
--eye 0,0,0 | differ
--eye 1,2,3 --view top | --eye
--target 1,2,3 | --eye
--background blurple | --background
--subdivide some | --subdivide
--depth-cue far | finite
--depth-cue 1,end=3 | start=
--edges outline | silhouette
--edges all --edge-color blurple | blurple
--color 255,128,0 | #ff8000
--light sun:1 | directional
--light ambient:1,1,1 | color
--light point:1,2,3,color=255/128/0 | #ff8000
--light point:0,1,2,size=3 | size=3
--light point:0,1,2,amplify=maybe | yes or no
--light point:1,2,3,shadow=maybe | SIZE/FILTER
--light directional:0,1 | three numbers
--light directional:0,1,0,amplify=yes | attached=
--light spot:0,1,2 | direction
--light area:0,1,2,edge_u=1/0/0 | edge_v
--light area:0,1,2,edge_u=1/0/0,edge_v=0/1/0,resolution=4 | M/N
--preset studio --shadow-size 64 | --shadow-size
--shading gouraud --shadow-filter 3 | --shadow-filter
--material colour=1 | diffuse=
--material diffuse= | diffuse=
--material name=x | diffuse=
--material diffuse=1,foo=2 | foo=2
--material diffuse=blurple | diffuse
--material diffuse=1/2 | three numbers
--material shininess=shiny | finite
--material levels=1.5 | whole
--material normalized=maybe | yes or no
--material reflection=gouraud | blinn
--material reflection=cook-torrance,roughness=0.1/0.2/0.3 | roughness
--material golden,shininess=3 | brass
-q -v | not allowed
-o x.foo | '.foo'
-o x | without a suffix
-o x.jpg --array depth | .npy
--array depth --array mask -o a.npy | one array
--array uv -o a.png | 'uv'
--array all -o a.png | one array
--array rgb -o a.exr | 'color'
--array deep | deep
--scale 1 | --scale
--array depth --scale 1 -o a.npy | --scale
--array depth --scale 0 -o a.png | above 0
--array depth --scale far -o a.png | finite
"""


def test_what_is_not_legal_is_told_before_anything_is_drawn(capsys):
    cases = [line.split(" | ") for line in REFUSED.strip().splitlines()]
    assert_refused(capsys, [([CUBE, *flags.split()], word) for flags, word in cases], "render")
    assert_refused(capsys, [
        ([], "MODEL"), ([CUBE, "-o", ""], "-o"), (["-"], "--input-format"), ([CUBE, "--edges", ""], "wire"),
        (["-", "-", "--input-format", "obj"], "once"), ([CUBE, GEAR, "-o", "-"], "stdout"),
        ([CUBE, CUBE], "cube.png"),
    ], "render")  # fmt: skip
    assert_refused(capsys, [([CUBE, "--subdivide", "15"], "cube.obj")], "render", code=3)


def test_unreadable_scalars(folder, capsys):
    def npy(head, body=b""):
        return b"\x93NUMPY\1\0" + len(head).to_bytes(2, "little") + head + body

    said = "{{'descr': {}, 'fortran_order': False, 'shape': {}}}\n"
    heads = [("'<f8'", "(2"), ("'<f8'", "(10**99,)"), ("'<f8'", "(1e9,)"), ("'<f8'", f"({10**30},)"), ("'|O'", "(1,)")]
    heads += [("'<f8'", "()"), ("'<U2'", "(1,)"), ("'<M8[s]'", "(1,)"), ("'<f8'", f"({2**40},)"), ("'<f8'", "(-1,)")]
    for k, (descr, shape) in enumerate(heads):
        (folder / f"{k}.npy").write_bytes(npy(said.format(descr, shape).encode(), bytes(8)))
        assert_refused(capsys, [([CUBE, "--scalars", f"{k}.npy"], f"{k}.npy: ")], "render", code=3)


def test_unreadable_models(folder, capsys):
    contents = {
        "empty.obj": (b"", "empty"),
        "points.obj": (b"v 0 0 0\n", "faces"),
        "nan.obj": (b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "nan.obj"),
        "short.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "short.obj:4"),
        "noise.stl": (b"\x00\xff" * 500, "noise.stl"),
        "model.xyz": (b"1 2 3", "unknown format 'xyz'"),
        "model": (b"1 2 3", "--input-format"),
    }
    for name, (content, _) in contents.items():
        (folder / name).write_bytes(content)
    assert_refused(capsys, [([name], words) for name, (_, words) in contents.items()], "render", code=3)
    missing = [(["nope.obj"], "no such file"), (["*.ply"], "no such file"), ([folder], "is a folder")]
    assert_refused(capsys, missing, "render", code=3)
    (folder / "nan.obj").write_text("v nan 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 4 2 3\n")
    assert run("nan.obj", "--drop-bad-faces", "--json") == 0
    assert json.loads(capsys.readouterr().out)["faces"] == 1


def test_one_bad_model_does_not_stop_the_others(folder, capsys):
    assert run("nope.obj", CUBE) == 1
    assert one_error(capsys) and os.listdir(folder) == ["cube.png"]
    assert run("nope.obj", "nada.obj") == 3
    assert errors(capsys).count("raster: error: ") == 2
    os.mkdir("taken.png")
    assert run(CUBE, "-o", "{stem}.png") == 0, "a folder of another name is in nobody's way"


def test_textures_outside_of_the_folder_need_a_flag(folder, capsys):
    (folder / "parts").mkdir()
    Image.new("RGB", (2, 2), "red").save("skin.png")
    (folder / "parts" / "b.mtl").write_text("newmtl m\nmap_Kd ../skin.png\n")
    lines = "mtllib b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n"
    (folder / "parts" / "b.obj").write_text(lines)
    seen = []
    for flags in ([], ["--allow-outside"]):
        assert run("parts/b.obj", "--view", "front", *flags) == 0
        seen.append((picture("b.png")[8, 12, :3].tolist(), "skin.png" in errors(capsys)))
    (grey, is_warned), (red, is_warned_too) = seen
    assert len(set(grey)) == 1 and is_warned and red[0] > 0 == red[1] == red[2] and not is_warned_too


def test_an_interrupt_ends_it_and_too_little_memory_is_told(folder, capsys, monkeypatch):
    (folder / "a.odd").write_bytes(Path(CUBE).read_bytes())
    for fault, code, words in (
        (KeyboardInterrupt(), 130, "raster: error: interrupted\n"),
        (MemoryError("Unable to allocate 9 TiB"), 3, "raster: error: a.odd: needs more memory than there is"),
    ):
        with odd_format(fault):
            assert run("a.odd", *([CUBE] if code == 130 else [])) == code
        assert one_error(capsys).startswith(words) and os.listdir(folder) == ["a.odd"], fault

    def fail(*_, **__):
        raise MemoryError("Unable to allocate 9 TiB")

    monkeypatch.setattr(glob, "glob", fail)  # outside of any model: what the system is asked for first
    assert run("*.obj") == 2
    assert one_error(capsys) == "raster: error: not enough memory for command line: Unable to allocate 9 TiB\n"


def test_a_fault_of_ours_is_one_line_and_the_next_model(folder, capsys):
    (folder / "a.odd").write_bytes(Path(CUBE).read_bytes())
    with odd_format(ZeroDivisionError("of\nours"), IndexError("too far"), IndexError("too far")):
        assert run("a.odd", CUBE) == 1 and sorted(os.listdir(folder)) == ["a.odd", "cube.png"]
        assert one_error(capsys) == (
            "raster: error: a.odd: internal error: ZeroDivisionError: of ours (run with -v for the traceback, and "
            "please report it)\n"
        )
        assert run("a.odd", CUBE, "--json") == 1
        out, err = capsys.readouterr()
        failed, drawn = map(json.loads, out.splitlines())
        assert err.count("internal error: IndexError: too far") == 1 and err.count("\n") == 1
        assert "internal error" in failed["error"] and drawn["faces"] == 12
        assert run("a.odd", "-v") == 1, "the program's own fault"
        err = capsys.readouterr().err
        assert "Traceback (most recent call last)" in err and "in read_odd" in err
        assert run("a.odd") == 0
