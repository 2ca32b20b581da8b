"""The command line: what it writes and says, how it ends. Pictures are small; most runs are in-process."""

import inspect
import io
import json
import os
import re
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import rasterizer as rz
from rasterizer import _kernel
from rasterizer.cli import arguments, main, render, warmup
from rasterizer.cli.messages import Messages, compiling_announced
from rasterizer.frame import Frame
from rasterizer.options import Options
from rasterizer.renderer import Renderer
from rasterizer.scene import file, lights, load, material
from rasterizer.scene._check import AXES

ROOT = Path(__file__).parent.parent
CUBE = str(ROOT / "models" / "cube.obj")
GEAR = str(ROOT / "models" / "gear.stl")
SMALL = ["-s", "24x16", "--threads", "1"]


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Kernels are compiled before the first test, so that no test sees it announced."""
    warmup.draw_all_kinds()


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Every test has an empty current folder of its own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*argv) -> int:
    """Draw a small picture in this process."""
    return main(["render", *SMALL, *map(str, argv)])


def start(*argv, cwd=None, **options):
    """Run the program itself."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "rasterizer", *argv]
    return subprocess.run(command, capture_output=True, env=environment, cwd=cwd, **options)


def errors(capsys) -> str:
    """What was said on stderr; nothing was said on stdout, and nothing looks like a traceback."""
    out, err = capsys.readouterr()
    assert out == "" and "Traceback" not in err
    assert all(line.startswith("raster: ") for line in err.splitlines())
    return err


def one_error(capsys) -> str:
    err = errors(capsys)
    assert err.startswith("raster: error: ") and err.count("\n") == 1, err
    return err


def picture(name) -> np.ndarray:
    return np.asarray(Image.open(name))


# --- what is written ----------------------------------------------------------------------------------------


def test_the_default_picture(folder, capsys):
    assert run(CUBE) == 0 and errors(capsys) == ""
    assert os.listdir(folder) == ["cube.png"]
    image = Image.open("cube.png")
    assert (image.size, image.mode, image.format) == ((24, 16), "RGBA", "PNG")
    expected = rz.render(rz.load(CUBE), (24, 16), samples=4)
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
    assert run(CUBE, "--array", array) == 0 and errors(capsys) == ""
    saved = np.load("cube.npy")
    assert saved.dtype == dtype and saved.shape == shape
    frame = rz.render(rz.load(CUBE), (24, 16), outputs=(array,))
    assert np.array_equal(saved, getattr(frame, array))


def test_npy_alone_is_linear_color(capsys):
    assert run(CUBE, "-o", "x.npy") == 0 and errors(capsys) == ""
    assert np.array_equal(np.load("x.npy"), rz.render(rz.load(CUBE), (24, 16)).color)


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
    assert run("-", "--input-format", "obj", "-o", "-", "--json") == 0
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


def test_json(capsys):
    assert run(CUBE, "nope.obj", "--json") == 1
    out, err = capsys.readouterr()
    first, second = map(json.loads, out.splitlines())
    assert second == {"path": "nope.obj", "error": "nope.obj: no such file"} and "nope.obj" in err
    assert first.pop("seconds") > 0 and 0 < first.pop("coverage") < 1 and 0 <= first.pop("error_bound") < 0.01
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


# --- flags --------------------------------------------------------------------------------------------------


def test_every_option_is_a_flag():
    defaults = vars(arguments.parse(["render", "x.obj"]))
    for field in fields(Options):
        assert field.name in defaults
        if field.name not in (
            "samples",
            "outputs",
        ):  # they depend on whether a picture or an array is written
            assert defaults[field.name] == field.default, field.name
    assert render.make_options(arguments.parse(["render", "x.obj"])) == Options(samples=4, outputs="rgb")
    assert render.make_options(arguments.parse(["render", "x.obj", "--array", "face"])) == Options(
        outputs="face"
    )
    assert render.make_options(arguments.parse(["render", "x.obj", "-o", "x.npy"])) == Options()


def test_words_and_numbers_of_the_help_are_those_of_the_scene():
    framing = inspect.signature(rz.Camera.framing).parameters
    assert [framing[name].default for name in ("azimuth", "elevation", "fov")] == [
        arguments.AZIMUTH,
        arguments.ELEVATION,
        arguments.FOV,
    ]
    assert tuple(AXES) == arguments.AXES and arguments.REFLECTIONS == material.REFLECTIONS
    assert tuple(load._READERS) == arguments.FORMATS and arguments.SCENE_FORMATS == file.FORMATS
    assert all(getattr(lights, name)() for name in arguments.PRESETS)


def camera_of(*argv, aspect=1.5):
    """The camera that the arguments make for the cube."""
    from rasterizer.cli.view import check_camera, make_camera

    parsed = arguments.parse(["render", CUBE, "-s", "300x200", *argv])
    check_camera(parsed)
    scene = rz.load(CUBE)
    view = parsed.views[0] if parsed.views else None
    return make_camera(parsed, view, scene, scene.bounds, parsed.up or "y")


@pytest.mark.parametrize(
    ("view", "forward"),
    [
        ("front", (0, 0, -1)),
        ("back", (0, 0, 1)),
        ("left", (1, 0, 0)),
        ("right", (-1, 0, 0)),
        ("top", (0, -1, 0)),
        ("bottom", (0, 1, 0)),
        ("iso", (-(3**-0.5), -(3**-0.5), -(3**-0.5))),
    ],
)
def test_views(view, forward):
    assert camera_of("--view", view).view().forward == pytest.approx(forward, abs=1e-12)
    assert set(arguments.VIEWS) == {"front", "back", "left", "right", "top", "bottom", "iso"}


def test_cameras():
    assert camera_of() == rz.Camera.framing(rz.load(CUBE), aspect=1.5)
    assert camera_of(
        "--azimuth", "-30", "--elevation", "-10", "--fov", "50", "--up", "-z"
    ) == rz.Camera.framing(rz.load(CUBE), -30, -10, 50, "-z", aspect=1.5)
    assert camera_of("--view", "left", "--elevation", "5") == rz.Camera.framing(
        rz.load(CUBE), -90, 5, aspect=1.5
    )
    assert camera_of("--eye", "-3,2,4", "--fov", "40") == rz.Camera.perspective((-3, 2, 4), fov=40)
    eye = camera_of("--eye", "0,0,4", "--target", "-.5,0,0", "--up", "x", "--fov", "60")
    assert eye == rz.Camera.perspective((0, 0, 4), (-0.5, 0, 0), "x", 60)


@pytest.mark.parametrize("lens", [[], ["--ortho"]])
@pytest.mark.parametrize("place", [[], ["--eye", "3,2,5"]])
def test_zoom_enlarges(lens, place):
    wide, near = camera_of(*lens, *place), camera_of(*lens, *place, "--zoom", "2.5")
    assert near.position == wide.position and wide.is_perspective == (not lens)
    assert near.projection((300, 200)).scale_y == pytest.approx(2.5 * wide.projection((300, 200)).scale_y)


def test_orthographic_keeps_the_size_of_the_target():
    place = ["--eye", "3,2,5", "--target", "0,1,0"]
    with_perspective, without = camera_of(*place), camera_of(*place, "--ortho")
    distance = np.linalg.norm(np.subtract((3, 2, 5), (0, 1, 0)))
    assert without.projection((300, 200)).scale_y == pytest.approx(
        with_perspective.projection((300, 200)).scale_y / distance
    )


def lights_of(*argv):
    from rasterizer.cli.view import make_lights

    return make_lights(arguments.parse(["render", CUBE, *argv]))


def test_lights():
    assert lights_of() is None and lights_of("--preset", "studio") == rz.studio()
    assert lights_of("--preset", "headlight") == rz.headlight()
    assert lights_of("--light", "ambient:0.2") == (rz.AmbientLight(0.2),)
    assert lights_of("--light", "ambient:color=#fff") == (rz.AmbientLight(1.0),)
    assert lights_of("--preset", "headlight", "--light", "ambient:1/0.5/0") == (
        *rz.headlight(),
        rz.AmbientLight((1, 0.5, 0)),
    )
    assert lights_of("--light", "directional:-1,-1,0,color=orange,attached=camera") == (
        rz.DirectionalLight((-1, -1, 0), "orange", "camera"),
    )
    assert lights_of(
        "--light", "spot:1,2,3,direction=0/-1/0,inner=10,outer=20,exponent=2,attenuation=1/d^2,range=9,amplify=yes",
    ) == (rz.SpotLight((1, 2, 3), (0, -1, 0), 1, 10, 20, 2, "1/d^2", "world", True, 9),)  # fmt: skip
    assert lights_of("--light", "area:1,2,3,edge_u=1/0/0,edge_v=0/0/-1,resolution=8/4,attenuation=1/(d+2),color=0.5") == (
        rz.AreaLight((1, 2, 3), (1, 0, 0), (0, 0, -1), 0.5, (8, 4), (2, 1, 0)),
    )
    assert lights_of("--light", "point:1,2,3", "--light", "point:1,2,3,attenuation=1/0.5/.25,color=3e-1") == (
        rz.PointLight((1, 2, 3)),
        rz.PointLight((1, 2, 3), 0.3, (1, 0.5, 0.25)),
    )


def test_the_look_reaches_the_picture(capsys):
    looks = {
        "default": [],
        "flat": ["--shading", "flat"],
        "crease": ["--crease-angle", "1"],
        "blinn": ["--reflection", "blinn", "--shading", "phong"],
        "phong": ["--shading", "phong"],
        "light": ["--light", "directional:0,-1,0"],
        "background": ["--background", "0.2/0.1/0"],
        "samples": ["--samples", "1"],
    }
    torus = ROOT / "models" / "torus.obj"
    for name, flags in looks.items():
        assert run(torus, "-o", f"{name}.png", *flags) == 0
    assert errors(capsys) == ""
    assert len({picture(f"{name}.png").tobytes() for name in looks}) == len(looks)
    scene = rz.load(torus)
    mesh = scene.meshes[0]
    scene = replace(scene, meshes=[replace(mesh, material=replace(mesh.material, reflection="blinn"))])
    assert np.array_equal(picture("blinn.png"), rz.render(scene, (24, 16), shading="phong", samples=4))
    corner = picture("background.png")[0, 0].tolist()
    assert corner == rz.render(rz.load(CUBE, background=(0.2, 0.1, 0)), 8).rgb[0, 0].tolist()


# --- what is said -------------------------------------------------------------------------------------------


def test_verbose_and_quiet(capsys):
    assert run(CUBE, "-v") == 0
    err = errors(capsys)
    assert "cube.obj: 12 faces" in err and "cube.png, <Frame 24x16 rgb, 12 faces" in err
    assert run(CUBE, "--zoom", "9", "--eye", "9,9,9", "--target", "20,20,20") == 0
    assert "the picture is empty: the model reaches from (-1, -1, -1) to (1, 1, 1)" in errors(capsys)
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
        ([CUBE, "-s", "0x10"], "each 1 to 8192 px"),
        ([CUBE, "-s", "99999"], "each 1 to 8192 px"),
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
        ([CUBE, "-o", "x.png", "--array", "depth"], "written as .npy"),
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


@pytest.mark.parametrize("argv", [[], ["draw"], ["--foo"], [CUBE]])
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
    assert run(CUBE, "-o", "missing/x.png") == 4 and "no folder" in one_error(capsys)
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


def test_faults_of_ours_are_not_hidden(monkeypatch):
    def fail(*_, **__):
        raise ZeroDivisionError

    monkeypatch.setattr(Frame, "encode", fail)
    with pytest.raises(ZeroDivisionError):
        run(CUBE)


# --- help, kernels, and the program itself ------------------------------------------------------------------


@pytest.mark.parametrize("argv", [["--help"], ["render", "--help"], ["warmup", "-h"], ["--version"]])
def test_help(argv, capsys):
    with pytest.raises(SystemExit) as stop:
        main(argv)
    out, err = capsys.readouterr()
    assert stop.value.code == 0 and err == "" and out
    if argv == ["--version"]:
        assert out == f"raster {rz.__version__}\n"


def test_the_examples_of_the_help_parse(capsys):
    with pytest.raises(SystemExit):
        main(["render", "--help"])
    examples = re.findall(r"raster (render .*?)(?:   .*| > .*)?$", capsys.readouterr().out, re.MULTILINE)
    examples = [example for example in examples if "MODEL..." not in example]
    assert len(examples) == 8
    for example in examples:
        arguments.parse(example.replace("'", "").split())


def test_warmup_leaves_nothing_to_compile(capsys):
    with compiling_announced(Messages()) as announced:
        for model in ("still_life.obj", "knot.ply", "gear.stl", "torus.glb"):
            path = ROOT / "models" / model
            for flags in (
                ["--shading", "phong"],
                ["--shading", "phong", "--light", "point:1,1,1", "--tolerance", "0", "--crease-angle", "60"],
                [
                    "--shading",
                    "flat",
                    "--light",
                    "directional:1,1,1,color=#f00",
                    "--samples",
                    "9",
                    "--cull",
                    "back",
                ],
                [
                    "--eye",
                    "0.1,0,0.2",
                    "--target",
                    "5,1,0",
                    "--color-range",
                    "local",
                    "--background",
                    "white",
                ],
                ["--eye", "0.1,0,0.2", "--array", "face", "--ortho"],
                ["--array", "normal"],
                ["--array", "depth", "--shading", "flat"],
            ):
                output = "x.npy" if "--array" in flags else "x.png"
                assert run(path, *flags, "-o", output, "-q") == 0
    assert announced == [] and capsys.readouterr().err == ""


def test_compiling_is_announced_once(capsys):
    import numba

    with compiling_announced(Messages()) as announced:
        for increment in (1, 2):
            numba.njit(lambda x, increment=increment: x + increment)(1)
    assert len(announced) == 1
    assert errors(capsys).startswith("raster: compiling kernels for the first time")


def test_warmup_says_where_kernels_are(capsys, monkeypatch):
    assert main(["warmup"]) == 0
    assert re.match(r"raster: kernels were ready already after [\d.]+ s, in ", errors(capsys))
    monkeypatch.setattr(_kernel, "CACHE_FOLDER", None)
    assert main(["warmup"]) == 4 and "NUMBA_CACHE_DIR" in one_error(capsys)


def test_a_cache_folder_that_cannot_be_written_breaks_nothing(folder):
    (folder / "file").write_bytes(b"")
    code = "from rasterizer import _kernel; print(_kernel.CACHE_FOLDER, _kernel.is_cache_cold())"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "file" / "below")}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment, check=True)
    assert done.stdout == "None True\n"


def test_help_imports_neither_numpy_nor_numba_nor_trimesh():
    code = (
        "import sys; from rasterizer.cli import main\n"
        "try: main(['render', '--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'numba', 'llvmlite', 'trimesh', 'PIL', 'scipy'} & set(sys.modules)\n"
        "print(sorted(heavy), len(sys.modules), file=sys.stderr)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    heavy, n_module = result.stderr.strip().rsplit(" ", 1)
    assert heavy == "[]" and int(n_module) < 150


def test_the_program_itself(folder):
    done = start("render", CUBE, *SMALL, "-o", "-", cwd=folder)
    assert done.returncode == 0 and done.stdout.startswith(b"\x89PNG") and b"error" not in done.stderr
    failed = start("render", "nope.obj", cwd=folder)
    assert failed.returncode == 3 and failed.stderr == b"raster: error: nope.obj: no such file\n"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_a_full_disk_behind_stdout(folder):
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": ""}
    command = [sys.executable, "-m", "rasterizer", "--help"]
    with open("/dev/full", "wb") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, env=environment, cwd=folder)
    assert (
        done.returncode == 4
        and done.stderr == b"raster: error: can't write to stdout: No space left on device\n"
    )


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
def test_a_reader_that_has_gone(folder):
    reader, writer = os.pipe()
    os.close(reader)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "rasterizer", "render", CUBE, *SMALL, "--json", "-q"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, env=environment, cwd=folder)
    os.close(writer)
    assert done.returncode == 4 and done.stderr == b""
