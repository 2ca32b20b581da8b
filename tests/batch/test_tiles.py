"""`render_tiles`: one picture by many processes, the same file as one process writes."""

import os
from concurrent.futures import ThreadPoolExecutor

import pytest
from helpers.command import raster
from helpers.deadly import Deadly
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.frame import Stats

pytestmark = pytest.mark.usefixtures("folder")

STILL_LIFE = str(ROOT / "models" / "still_life.obj")


@pytest.fixture(scope="module")
def executor():
    """Threads of this process, so that no test waits for another one to start; local processes are tested below."""
    with ThreadPoolExecutor(1) as made:
        yield made


def alone(task) -> tuple[bytes, Stats]:
    """The file that one process writes, and what it counted."""
    with rz.Renderer(rz.load(STILL_LIFE), **vars(task.check())) as renderer:
        frame = renderer.render(task.camera)
        frame.save("alone" + os.path.splitext(task.output)[1], array=task.array)
    return open("alone" + os.path.splitext(task.output)[1], "rb").read(), frame.stats


def test_the_file_is_that_of_one_process(executor):
    for output, array, options in (
        ("a.png", None, {}),
        ("a.tif", None, {"color_range": "global", "shading": "phong"}),
        ("a.npy", "color", {"samples": 4}),
        ("a.npy", "depth", {}),
        ("a.npy", "face", {}),
    ):
        task = rz.RenderTask(STILL_LIFE, output, options={"size": (32, 25)} | options, array=array)
        stats = rz.render_tiles(task, executor, n_tile=3)
        written, expected = alone(task)
        assert open(output, "rb").read() == written, f"{output} {array} {options}"
        assert 0 < stats.covered < stats.samples == 32 * 25 * task.check().samples
        for name in ("faces", "covered", "samples", "error_bound", "steps", "error_bounds"):
            found, whole = getattr(stats, name), getattr(expected, name)
            assert found == whole, f"{output} {array} {options}: {name} is {found} instead of {whole}"


def test_local_processes_draw_a_model_that_is_sent():
    task = rz.RenderTask(rz.load(STILL_LIFE), "out/a.tif", options={"size": (32, 25), "shading": "phong"})
    rz.render_tiles(task, n_process=1, n_tile=5)
    assert open("out/a.tif", "rb").read() == alone(task)[0]


def test_what_goes_wrong_is_raised_and_leaves_no_file(executor, folder):
    (folder / "bad.obj").write_text("v 1 2\n")
    for source, kind, words in [("nope.obj", rz.ModelError, "no such file"), ("bad.obj", rz.ModelError, "bad.obj:1")]:
        with pytest.raises(kind, match=words):
            rz.render_tiles(rz.RenderTask(source, "a.tif"), executor)
    with pytest.raises(rz.SceneError, match="n_tile"):
        rz.render_tiles(rz.RenderTask(STILL_LIFE, "a.tif", options={"size": 4}), executor, n_tile=5)
    with pytest.raises(rz.SceneError, match="a RenderTask"):
        rz.render_tiles(STILL_LIFE)
    with pytest.raises(rz.OutputError, match="no format"):
        rz.render_tiles(rz.RenderTask(STILL_LIFE, "a.obj"), executor)
    assert os.listdir() == ["bad.obj"]


@pytest.mark.nightly
def test_a_process_that_dies_twice_ends_it():
    deadly = rz.RenderTask(STILL_LIFE, "a.tif", load={"lights": Deadly()})
    with pytest.raises(rz.RasterizerError, match="the process that drew rows 0 to .* exit code 9, twice"):
        rz.render_tiles(deadly, n_process=1)
    assert os.listdir() == []


@pytest.mark.nightly
def test_the_command_line_writes_the_same_files(capsys):
    look = ["-s", "48x36", "--shading", "phong", "--color-range", "global", "--view", "iso", "--view", "top", "-q"]
    assert raster("batch", STILL_LIFE, "nope.obj", "--tiles", "-j", "1", "-o", "tiles/", *look) == 1
    os.mkdir("whole")
    assert raster("render", STILL_LIFE, "-o", "whole/", *look) == 0
    assert sorted(os.listdir("tiles")) == ["still_life-iso.png", "still_life-top.png"]
    for name in os.listdir("tiles"):
        assert open(f"tiles/{name}", "rb").read() == open(f"whole/{name}", "rb").read()
    assert "nope.obj: no such file" in capsys.readouterr().err
