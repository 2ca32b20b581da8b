"""`raster sheet`: which pictures stand where, their labels, and what is left of a model that fails."""

import json
import os

import numpy as np
import pytest
from helpers.command import CUBE, GEAR, one_error, picture, start
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.analysis.contact_sheet import GAP, label_width
from rasterizer.cli import main, sheet_command

pytestmark = pytest.mark.usefixtures("folder")
SMALL = ["-s", "40x30", "--threads", "1"]
ROOM = ROOT / "models" / "room.json"


def run(*argv):
    return main(["sheet", *SMALL, *map(str, argv)])


def cells(name, columns, rows):
    """The pictures on a sheet without labels, row by row."""
    whole = picture(name)
    assert whole.shape[:2] == (rows * (30 + GAP) + GAP, columns * (40 + GAP) + GAP)
    corners = [(GAP + r * (30 + GAP), GAP + c * (40 + GAP)) for r in range(rows) for c in range(columns)]
    return [whole[y : y + 30, x : x + 40] for y, x in corners]


def drawn(model, view):
    """The same picture by `raster render`."""
    assert main(["render", *SMALL, str(model), "-o", "one.png", *(["--view", view] if view else [])]) == 0
    return picture("one.png")


def test_one_model_is_seen_from_six_sides():
    assert run(CUBE, "--no-labels") == 0
    found = cells("cube-sheet.png", 3, 2)
    for cell, view in zip(found, ("iso", "front", "right", "back", "left", "top"), strict=True):
        assert (cell == drawn(CUBE, view)).all(), view


def test_many_models_have_a_cell_or_a_row_each():
    assert run(CUBE, GEAR, "--no-labels", "--rows", "1") == 0
    assert all((a == drawn(m, None)).all() for a, m in zip(cells("sheet.png", 2, 1), (CUBE, GEAR), strict=True))
    assert run(CUBE, GEAR, "--no-labels", "--view", "front,top,iso", "-o", "x.png") == 0
    found = cells("x.png", 3, 2)
    assert (found[1] == drawn(CUBE, "top")).all() and (found[3] == drawn(GEAR, "front")).all()


def test_a_scene_file_has_its_own_camera_but_the_sheet_s_size():
    assert run(ROOM, CUBE, "--no-labels", "--columns", "2") == 0
    assert (cells("sheet.png", 2, 1)[0] == drawn(ROOM, None)).all()


def test_a_model_that_fails_leaves_its_cell_empty(capsys):
    assert run("nope.obj", CUBE, "--columns", "2", "--no-labels", "--json") == 1
    out, err = capsys.readouterr()
    error, record = map(json.loads, out.splitlines())
    assert error["path"] == "nope.obj" and record["models"][0]["path"] == CUBE and err.count("\n") == 1
    empty, cube = cells("sheet.png", 2, 1)
    assert not empty.any() and cube.any()
    os.unlink("sheet.png")
    assert run("nope.obj", "none.stl") == 3 and not os.path.exists("sheet.png")


def test_labels_name_what_differs_and_fit():
    name = sheet_command._short_names
    assert name(["a/x.obj", "b/y.stl", "-"]) == ["x", "y", "stdin"]
    assert name(["a/x.obj", "a/x.stl", "y.off"]) == ["a/x.obj", "a/x.stl", "y"]
    for label in ("short", "a_very_long_name_of_a_part_with_its_number_at_the_end_0047", "ü" * 60):
        cut = sheet_command._fitted(label, 90)
        assert label_width(cut) <= 90 and (cut == label or "..." in cut) and cut[0] == label[0] and cut[-1] == label[-1]
    assert sheet_command._fitted("anything", 1) == ""


def test_labels_make_room_and_paper_has_a_colour():
    assert run(CUBE, GEAR, "--background", "white") == 0
    whole = picture("sheet.png")
    assert whole.shape[2] == 3 and (whole[0, 0] == 255).all() and whole.shape[0] > 30 + 2 * GAP
    assert (np.asarray(whole[30 + GAP :]) < 200).any(), "text below"


def test_the_output_replaces_no_model_and_goes_to_stdout(folder, capsys):
    rz.Scene(rz.load(CUBE).meshes).save("own.json")
    os.rename("own.json", "own.png")
    assert main(["sheet", "own.png", "--input-format", "json", "-o", "own.png"]) == 4
    assert "which is read" in one_error(capsys)
    done = start("sheet", CUBE, *SMALL, "-o", "-", cwd=folder)
    assert done.returncode == 0 and done.stdout.startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--columns", "0"], "--columns must be at least 1; given 0"),
        (["--columns", "2", "--rows", "2"], "one of them says the other"),
        (["--gap", "-1"], "--gap must be at least 0"),
        (["-o", "x.foo"], "no format to write"),
        (["--view", "front,side"], "given 'front,side'"),
        (["--zoom", "-1"], "--zoom must be above 0"),
    ],
)
def test_what_is_not_legal_is_told_before_anything_is_drawn(argv, words, capsys, folder):
    assert main(["sheet", CUBE, *argv]) == 2
    assert words in one_error(capsys) and not os.listdir(folder)
