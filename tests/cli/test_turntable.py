"""`raster turntable`: files of every format, their frames and times, and what is refused before anything is drawn."""

import json
import os
import shutil

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.command import CUBE, GEAR, assert_refused, one_error, raster
from helpers.model_bytes import rich_gltf
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz
from rasterizer.cli.parser import make_command_parser
from rasterizer.scene.camera import turned_cameras

pytestmark = pytest.mark.usefixtures("folder")
LIFE = ROOT / "models" / "still_life.obj"
FEW = ["-s", "48x36", "--threads", "1", "--frames", "6", "--no-ground"]


def run(*argv):
    return raster("turntable", *FEW, *argv)


def pictures(name):
    image = Image.open(name)
    found = []
    for k in range(image.n_frames):
        image.seek(k)
        found.append(np.asarray(image.convert("RGBA")))
    return found


def test_a_file_turns(capsys):
    for output in (None, "x.webp", "x.png"):
        name = output or "still_life-turntable.gif"
        assert run(LIFE, *(["-o", output] if output else []), "--seconds", "1.2", "--json") == 0
        record = json.loads(capsys.readouterr().out)
        assert (record["output"], record["frames"], record["duration"]) == (name, 6, 1.2) and record["coverage"] > 0.1
        frames = pictures(name)
        assert len({frame.tobytes() for frame in frames}) == 6 and frames[0].shape == (36, 48, 4), name
        assert frames[0][0, 0, 3] == 0, f"{name}: the background is transparent"
        image = Image.open(name)
        image.load()
        assert image.info["duration"] == pytest.approx(200), name
    assert raster("turntable", CUBE, "-s", "8", "--fps", "4", "--seconds", "2", "--loop", "3", "--no-ground") == 0
    image = Image.open("cube-turntable.gif")
    assert (image.n_frames, image.info["duration"]) == (8, 250) and image.info["loop"] == 2, "shown three times"


def test_a_frame_each(folder, capsys):
    assert run(LIFE, GEAR, "-o", "f/{stem}-{frame:03}.png", "--background", "white") == 0
    assert sorted(os.listdir("f")) == [f"{stem}-{k:03}.png" for stem in ("gear", "still_life") for k in range(6)]
    assert len({(folder / "f" / f"still_life-{k:03}.png").read_bytes() for k in range(6)}) == 6
    assert_refused(capsys, [([CUBE, "-o", "f/{frame}{nothing}.png"], "{ext}, {folder}, {view}, {frame}")], "turntable")


def test_a_video_has_a_background():
    av = pytest.importorskip("av", reason="the extra video is not installed")
    assert run(CUBE, "-o", "x.mp4", "--fps", "12") == 0
    with av.open("x.mp4") as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 6 and (frames[0][0, 0] >= 250).all(), "white where nothing is"


def test_a_full_turn_ends_before_it_begins_again_and_may_go_the_other_way():
    assert run(LIFE, "-o", "there.png", "--turn", "360") == 0 and run(LIFE, "-o", "back.png", "--turn", "-360") == 0
    there, back = pictures("there.png"), pictures("back.png")
    assert not differences(there[0], back[0])
    off = max(np.abs(there[k].astype(int) - back[-k]).mean() for k in range(1, 6))
    assert off < 1.0, f"the same pictures in another order, off by {off:.2f} levels"


def test_stdout_takes_a_gif(capfdbinary):
    assert run(CUBE, "-o", "-") == 0
    assert capfdbinary.readouterr().out.startswith(b"GIF89a")


def test_what_is_not_legal_is_told_before_anything_is_drawn(capsys):
    assert_refused(capsys, [([CUBE, *argv.split()], words) for argv, words in (
        ("--frames 0", "--frames must be within 1..100000; given 0"),
        ("--frames 9 --fps 3 --seconds 3", "two of them say the third"),
        ("--seconds 0", "--seconds must be within"),
        ("--fps 60", "a .gif file shows at most 50 frames a second; given 180 in 3 s: try --fps 50, or -o "),
        ("--frames 200", "given 200 in 3 s: try --seconds 4, or -o cube"),
        ("--loop -1", "--loop must be within"),
        ("-o x.jpg", "x.jpg: moving pictures are written as .gif"),
        ("-o x", "the name has no suffix"),
        ("-o f-{frame}.npz", "pictures are written, no arrays"),
        ("--elevation 95", "elevation must be within"),
        ("--zoom 0", "--zoom must be above 0"),
        ("--view top", "unrecognized arguments"),
        ("--fov 200", "fov must be at least 1e-06 and below 180"),
        ("--target 1,2,3", "--target needs --eye"),
        ("--eye 1,2,3 --azimuth 9", "can't be used with --view, --azimuth, --elevation or --margin"),
        ("--eye 1,2,3 --target 1,2,3", "position and target must differ"),
        ("--camera file", "the model brings no camera"),
        ("--camera file --fov 9", "a picture has a camera, or words that frame it; given --camera, --fov"),
    )], "turntable")  # fmt: skip
    assert run("nope.obj", CUBE, "-q") == 1, "a model that fails doesn't stop the rest"
    assert one_error(capsys) == "raster: error: nope.obj: no such file\n" and os.path.exists("cube-turntable.gif")
    assert run("nope.obj") == 3


# --- the same turntable as rz.turntable's ---------------------------------------------------------------------------

PLAIN = ["--preset", "studio", "--shading", "gouraud", "--threads", "1"]
ROUND = [
    ([], {}),
    (["--elevation", "-40", "--fov", "55", "--samples", "1"], {"elevation": -40, "fov": 55, "samples": 1}),
    (["--elevation", "90", "--background", "red"], {"elevation": 90, "background": "red"}),
    (
        ["--eye", "9,7,5", "--target", "1,0,2", "--fov", "40"],
        {"camera": rz.Camera.look_at((9, 7, 5), (1, 0, 2), "y", 40)},
    ),
    (
        ["--camera", "camera.json", "--zoom", "2"],
        {"camera": rz.Camera.orthographic((5, 9, 0), (0, 1, 0), (0, 0.6, 0.8), 6.0, 0.5, 90.0)},
    ),
]


def test_it_is_that_of_the_library_byte_for_byte(folder):
    camera = {"position": [5, 9, 0], "target": [0, 1, 0], "up": [0, 0.6, 0.8], "height": 12.0, "near": 0.5, "far": 90.0}
    (folder / "camera.json").write_text(json.dumps(camera))
    for k, (argv, settings) in enumerate(ROUND):
        model = (LIFE, ROOT / "models" / "gear.stl")[k % 2]
        if model.suffix == ".stl" and "--camera" not in argv:
            argv = [*argv, "--up", "y"]
        scene = rz.load(model, up="y" if "--up" in argv else None, background=settings.get("background"))
        settings = {key: value for key, value in settings.items() if key != "background"}
        assert run(model, *PLAIN, *argv, "-o", "x.png") == 0
        drawn = rz.turntable(scene, (48, 36), 6, threads=1, **{"shading": "gouraud"} | settings).frames
        assert all(np.array_equal(a, b) for a, b in zip(pictures("x.png"), drawn, strict=True)), argv


def test_a_camera_that_knows_only_a_direction_goes_round_the_middle_of_the_model(folder):
    """glTF cameras have no target; what they look at lies as far away as the model. Half a round later the box that is
    its own mirror image covers the same pixels."""
    (folder / "rich.gltf").write_bytes(rich_gltf())
    assert run("rich.gltf", "--camera", "file", "--frames", "2", "--turn", "360", "-o", "x.png") == 0
    front, back = (frame[..., 3] > 0 for frame in pictures("x.png"))
    assert front.any() and not differences(front, back)


def test_a_camera_file_may_say_how_to_frame_the_model(folder):
    (folder / "framing.json").write_text(json.dumps({"azimuth": 10, "elevation": 60, "margin": 0.2}))
    assert run(LIFE, "--camera", "framing.json", "-o", "a.png") == 0
    assert run(LIFE, "--azimuth", "10", "--elevation", "60", "--margin", "0.2", "-o", "b.png") == 0
    assert open("a.png", "rb").read() == open("b.png", "rb").read()


def test_the_camera_of_a_scene_file_is_used_where_it_is_asked_for_as_the_help_says():
    cube = rz.load(CUBE)
    for camera in (None, rz.Camera.perspective((4, 3, 2), (0, 0, 0))):
        rz.save(rz.Scene(cube.meshes, lights=cube.lights, camera=camera), name := f"{camera is None}.json")
        assert run(name, "-o", "{stem}.png") == 0
    assert open("True.png", "rb").read() == open("False.png", "rb").read()
    for command, is_used in (("turntable", False), ("render", True)):
        text = " ".join(make_command_parser(command).format_help().split())
        assert ("The camera of a scene file is used unless" in text) is is_used, command


def test_a_camera_that_looks_down_the_axis_turns_its_picture():
    camera = rz.Camera.look_at((0, 5, 0), (0, 0, 0), "y")
    tops = [c.view().up for c in turned_cameras(camera, [0, 90, 180], (0, 1, 0), np.zeros(3))]
    assert not deviations(tops, [[0, 0, -1], [-1, 0, 0], [0, 0, 1]], rtol=0, atol=1e-12)


def test_a_transparent_gif_has_no_soft_shadow_and_that_is_said_of_each_model(capsys):
    def turn(*argv):
        few = ["-s", "48x36", "--threads", "1", "--frames", "2", "--shading", "gouraud", "--preset", "tabletop"]
        assert raster("turntable", CUBE, *few, *argv) == 0
        return capsys.readouterr().err.count("no shadow on the ground")

    shutil.copy(CUBE, "again.obj")
    assert turn("again.obj", "-o", "{stem}.gif", "--ground") == 2
    kept = open("cube.gif", "rb").read()
    for argv in (["--no-ground"], ["-q", "--ground"]):
        assert turn("-o", "cube.gif", *argv) == 0 and open("cube.gif", "rb").read() == kept, argv
    assert turn("-o", "x.GIF", "--ground") == 1 and open("x.GIF", "rb").read() == kept
    assert turn("-o", "x.webp", "--ground") == 0
    assert turn("-o", "x.gif", "--ground", "--background", "white") == 0
    white = pictures("x.gif")[0][..., :3].astype(int)
    assert ((white > 130) & (white < 250)).all(axis=2).sum() > 100, "soft greys on the ground"


def test_a_round_goes_on_with_the_frames_that_are_missing(folder, capsys):
    assert run(LIFE, "-o", "{frame}.png") == 0
    expected = {name: (folder / name).read_bytes() for name in os.listdir(folder)}
    assert len(set(expected.values())) == len(expected) == 6
    for name in ("1.png", "4.png"):
        os.unlink(name)
    assert run(LIFE, "-o", "{frame}.png", "--skip-existing") == 0
    assert {name: (folder / name).read_bytes() for name in os.listdir(folder)} == expected
    assert "4 of 6 outputs are there already" in capsys.readouterr().err
