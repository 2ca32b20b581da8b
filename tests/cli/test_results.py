"""What is said of each picture on a terminal, and that nothing is said elsewhere."""

import re
import sys

import pytest
from helpers.command import CUBE, GEAR, SMALL, raster, run

pytestmark = pytest.mark.usefixtures("folder")


@pytest.fixture
def terminal(monkeypatch, capsys):
    """Stderr that says that it is a terminal."""
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda _: True)


def lines(capsys):
    return [line for line in re.split(r"[\r\n]+", capsys.readouterr().err) if line.startswith("raster: ")]


def test_a_picture_has_a_line(terminal, capsys):
    assert run(CUBE) == 0
    (line,) = lines(capsys)
    assert re.fullmatch(r"raster: cube\.png, 24x16, (\d+ bytes|[\d.]+ kB), \d+\.\d\d s", line)


def test_many_pictures_are_counted(terminal, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "tqdm", None)  # without the extra: lines alone
    assert run(CUBE, GEAR, "--view", "top,front,left") == 0
    assert [re.match(r"raster: \[(\d)/6\] ", line)[1] for line in lines(capsys)] == list("123456")


def test_a_bar_stands_below_the_lines(terminal, capsys):
    pytest.importorskip("tqdm", reason="the extra progress is not installed")
    assert run(CUBE, "nope.obj", GEAR, "--view", "top,front,left") == 1
    err = capsys.readouterr().err
    assert "picture" in err and "raster: [6/9] gear-left.png" in err and "raster: error: nope.obj: no such file" in err


def test_nothing_is_said_where_it_is_not_wanted(capsys, monkeypatch):
    assert run(CUBE) == 0 and capsys.readouterr().err == "", "stderr is no terminal"
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda _: True)
    for flags in (["-q"], ["--json"]):
        assert run(CUBE, *flags) == 0 and lines(capsys) == [], flags


def test_sheets_and_turntables_have_a_line_too(terminal, capsys):
    for argv, name in ((["sheet", CUBE], "cube-sheet.png"), (["turntable", CUBE, "--frames", "2"], "turntable.gif")):
        assert raster(*argv, *SMALL) == 0
        assert f"{name}, " in capsys.readouterr().err
