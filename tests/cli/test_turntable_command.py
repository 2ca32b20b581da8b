"""`raster turntable`: files of every format, their frames and times, and what is refused before anything is drawn."""

import json
import os
import signal

import numpy as np
import pytest
from helpers.command import CUBE, GEAR, end_by_signal, one_error, start, start_with
from helpers.raster import ROOT
from PIL import Image

from rasterizer.cli import main, turntable_command

pytestmark = pytest.mark.usefixtures("folder")
LIFE = ROOT / "models" / "still_life.obj"
FEW = ["-s", "48x36", "--threads", "1", "--frames", "6"]


def run(*argv):
    return main(["turntable", *FEW, *map(str, argv)])


def pictures(name):
    image = Image.open(name)
    found = []
    for k in range(image.n_frames):
        image.seek(k)
        found.append(np.asarray(image.convert("RGBA")))
    return found


@pytest.mark.parametrize("name", ["still_life-turntable.gif", "x.webp", "x.png"])
def test_a_file_turns(name, capsys):
    assert run(LIFE, *([] if name.startswith("still") else ["-o", name]), "--seconds", "1.2", "--json") == 0
    record = json.loads(capsys.readouterr().out)
    assert record["output"] == name and record["frames"] == 6 and record["duration"] == 1.2
    frames = pictures(name)
    assert len(frames) == 6 and frames[0].shape == (36, 48, 4)
    assert frames[0][0, 0, 3] == 0, "the background is transparent"
    assert len({frame.tobytes() for frame in frames}) == 6
    image = Image.open(name)
    image.load()
    assert image.info["duration"] == pytest.approx(200)


def test_a_frame_each(folder, capsys):
    (folder / "f").mkdir()
    assert run(LIFE, GEAR, "-o", "f/{stem}-{frame:03}.png", "--background", "white") == 0
    assert sorted(os.listdir("f")) == [f"{stem}-{k:03}.png" for stem in ("gear", "still_life") for k in range(6)]
    assert len({(folder / "f" / f"still_life-{k:03}.png").read_bytes() for k in range(6)}) == 6
    assert run(CUBE, "-o", "f/{frame}{nothing}.png") == 2
    assert "{stem}, {ext}, {view}, {frame}" in one_error(capsys)


def test_a_video_has_a_background():
    av = pytest.importorskip("av", reason="the extra video is not installed")
    assert run(CUBE, "-o", "x.mp4", "--fps", "12") == 0
    with av.open("x.mp4") as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 6 and (frames[0][0, 0] >= 250).all(), "white where nothing is"


def test_a_full_turn_ends_before_it_begins_again_and_may_go_the_other_way():
    assert run(LIFE, "-o", "there.png", "--turn", "360") == 0 and run(LIFE, "-o", "back.png", "--turn", "-360") == 0
    there, back = pictures("there.png"), pictures("back.png")
    assert (there[0] == back[0]).all()
    off = max(np.abs(there[k].astype(int) - back[-k]).mean() for k in range(1, 6))
    assert off < 1.0, f"the same pictures in another order, off by {off:.2f} levels"


def test_frames_that_are_not_kept_are_the_same(monkeypatch):
    assert run(CUBE, "-o", "kept.gif") == 0
    monkeypatch.setattr(turntable_command, "_IN_MEMORY", 0)
    assert run(CUBE, "-o", "again.gif") == 0
    kept, again = pictures("kept.gif"), pictures("again.gif")
    assert all((a == b).all() for a, b in zip(kept, again, strict=True))


def test_stdout_takes_a_gif(folder):
    done = start("turntable", CUBE, *FEW, "-o", "-", cwd=folder)
    assert done.returncode == 0 and done.stdout.startswith(b"GIF89a")


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--frames", "0"], "--frames must be within 1..100000; given 0"),
        (["--frames", "9", "--fps", "3", "--seconds", "3"], "two of them say the third"),
        (["--seconds", "0"], "--seconds must be within"),
        (["--fps", "60"], "a .gif file shows at most 50 frames a second; given 180 in 3 s"),
        (["--loop", "-1"], "--loop must be within"),
        (["-o", "x.jpg"], "x.jpg: moving pictures are written as .gif"),
        (["-o", "x"], "the name has no suffix"),
        (["--elevation", "95"], "elevation must be within"),
        (["--zoom", "0"], "--zoom must be above 0"),
        (["--view", "top"], "unrecognized arguments"),
        (["--fov", "200"], "fov must be between"),
    ],
)
def test_what_is_not_legal_is_told_before_anything_is_drawn(argv, words, capsys, folder):
    assert main(["turntable", CUBE, *argv]) == 2
    assert words in one_error(capsys) and not os.listdir(folder)


def test_a_model_that_fails_does_not_stop_the_rest(capsys):
    assert run("nope.obj", CUBE, "-q") == 1
    assert one_error(capsys) == "raster: error: nope.obj: no such file\n" and os.path.exists("cube-turntable.gif")
    assert run("nope.obj") == 3


def test_an_interrupt_leaves_nothing_half_written(folder):
    process = start_with(
        "import sys; from rasterizer.cli import main\n"
        "sys.argv[1:] = ['turntable', sys.argv[1], '-s', '400', '--frames', '5000', '--seconds', '500', '-v']\n"
        "sys.exit(main())"
    )
    process.stderr.readline()  # the model is loaded
    end_by_signal(process, signal.SIGINT)
    assert not os.listdir(folder)


def test_a_scene_file_brings_its_own_look():
    assert run(ROOT / "models" / "room.json", "-o", "room.webp", "--frames", "2") == 0
    assert len(pictures("room.webp")) == 2
