"""`raster sheet`: which pictures stand where, their labels, and what is left of a model that fails."""

import json
import os
import shutil

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.command import CUBE, GEAR, assert_refused, picture, raster
from helpers.raster import ROOT
from PIL import ImageFont

import rasterizer as rz
from rasterizer.analysis.contact_sheet import GAP

pytestmark = pytest.mark.usefixtures("folder")
SMALL = ["-s", "40x30", "--threads", "1", "--preset", "studio"]
ROOM = ROOT / "models" / "room.json"


def run(*argv):
    return raster("sheet", *SMALL, *argv)


def drawn(model, view=None, *argv):
    """The same picture by `raster render`."""
    assert raster("render", *SMALL, model, "-o", "one.png", *(["--view", view] if view else []), *argv) == 0
    return picture("one.png")


def test_every_picture_stands_in_its_cell_above_its_label():
    six = ("iso", "front", "right", "back", "left", "top")
    shutil.copy(CUBE, "x.obj")
    shutil.copy(GEAR, "x.stl")
    wide = ["-s", "90x30"]
    for argv, cells, columns, labels in (
        ([CUBE], [drawn(CUBE, view) for view in six], 3, six),
        ([CUBE, "--view", "top", "-o", "sheet.png"], [drawn(CUBE, "top")], 1, ["cube"]),
        ([CUBE, GEAR, "--rows", "1"], [drawn(CUBE), drawn(GEAR)], 2, ["cube", "gear"]),
        ([CUBE, GEAR, "--columns", "1", "--no-labels"], [drawn(CUBE), drawn(GEAR)], 1, None),
        ([CUBE, GEAR, "--view", "front,top,iso", *wide],
         [drawn(model, view, *wide) for model in (CUBE, GEAR) for view in ("front", "top", "iso")], 3,
         [f"{name} {view}" for name in ("cube", "gear") for view in ("front", "top", "iso")]),
        (["x.obj", "x.stl", *wide], [drawn(CUBE, None, *wide), drawn(GEAR, None, *wide)], 2, ["x.obj", "x.stl"]),
        ([ROOM, CUBE, "--columns", "2"], [drawn(ROOM), drawn(CUBE)], 2, ["room", "cube"]),
    ):  # fmt: skip
        assert run(*argv) == 0
        (name,) = (name for name in os.listdir() if name.endswith("sheet.png"))
        expected = np.asarray(rz.sheet(cells, columns, labels=labels))
        found = picture(name)
        assert found.shape == expected.shape and (found == expected).all(), argv
        os.unlink(name)


def test_there_are_no_more_rows_than_asked_for():
    """And no more columns than these need."""
    views = ["iso", "front", "right", "back", "left", "top"]
    for n in (5, 6):
        one = [np.zeros((30, 40, 4), np.uint8)] * n
        for n_row in range(1, n + 2):
            columns = min(k for k in range(1, n + 1) if k * n_row >= n)
            assert run(CUBE, "--view", ",".join(views[:n]), "--rows", str(n_row), "--no-labels", "-o", "x.png") == 0
            found, expected = picture("x.png").shape, np.shape(rz.sheet(one, columns))
            assert found == expected, f"{n} pictures in {n_row} rows: a sheet of {found} instead of {expected}"
            os.unlink("x.png")


def test_a_long_name_is_cut_in_its_middle_and_paper_has_a_colour():
    name = "a_very_long_name_of_a_part_with_its_number_at_the_end_0047"
    shutil.copy(CUBE, f"{name}.obj")
    assert run(f"{name}.obj", "--view", "top", "--background", "white", "--gap", "6", "-o", "x.png") == 0
    cuts = [f"{name[: (n + 1) // 2]}...{name[len(name) - n // 2 :]}" for n in range(2, len(name) - 1)]
    width = ImageFont.load_default().getlength
    label = max((cut for cut in cuts if width(cut) <= 40 + 6), key=len)
    cell = drawn(CUBE, "top", "--background", "white")
    expected = np.asarray(rz.sheet([cell], gap=6, background="white", labels=[label]))
    assert not differences(picture("x.png"), expected) and expected.shape[2] == 3


def test_a_model_that_fails_leaves_its_cell_empty(capsys):
    assert run("nope.obj", CUBE, "--columns", "2", "--no-labels", "--json") == 1
    out, err = capsys.readouterr()
    error, record = map(json.loads, out.splitlines())
    assert error["model"] == "nope.obj" and record["models"][0]["model"] == CUBE and err.count("\n") == 1
    whole = picture("sheet.png")
    assert not differences(whole[:, : GAP + 40], 0) and whole[:, GAP + 40 :].any()
    assert run("nope.obj", CUBE, "-s", "90x30", "--columns", "2", "-o", "x.png") == 1
    labels = np.asarray(rz.sheet([np.zeros((30, 90, 4), np.uint8)] * 2, 2, labels=["nope: failed", "cube"]))
    assert not differences(picture("x.png")[30 + GAP :], labels[30 + GAP :])
    os.unlink("sheet.png")
    assert run("nope.obj", "none.stl") == 3 and not os.path.exists("sheet.png")


def test_the_output_replaces_no_model_and_goes_to_stdout(capfdbinary):
    rz.save(rz.Scene(rz.load(CUBE).meshes), "own.json")
    os.rename("own.json", "own.png")
    assert run("own.png", "--input-format", "json", "-o", "own.png") == 4
    assert b"which is read" in capfdbinary.readouterr().err
    assert run(CUBE, "-o", "-") == 0
    assert capfdbinary.readouterr().out.startswith(b"\x89PNG")


def test_what_is_not_legal_is_told_before_anything_is_drawn(capsys):
    assert_refused(capsys, [([CUBE, *argv.split()], words) for argv, words in (
        ("--columns 0", "--columns must be at least 1; given 0"),
        ("--columns 2 --rows 2", "one of them says the other"),
        ("--gap -1", "--gap must be at least 0"),
        ("-o x.foo", "no format to write"),
        ("-o x.npy", "pictures are written, no arrays; given x.npy"),
        ("-o x.exr", "pictures are written, no arrays"),
        ("--view front,side", "given 'front,side'"),
        ("--zoom -1", "--zoom must be above 0"),
    )], "sheet")  # fmt: skip


def test_a_camera_of_a_file_makes_one_picture(folder):
    (folder / "front.json").write_text('{"view": "front"}')
    assert raster("sheet", CUBE, *SMALL, "--camera", "front.json", "--gap", "0", "--no-labels", "-o", "one.png") == 0
    assert raster("render", CUBE, *SMALL, "--view", "front", "-o", "front.png") == 0
    assert np.array_equal(picture("one.png"), picture("front.png"))
