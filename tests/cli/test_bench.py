"""`raster bench`: the table, the record, the plot, and what is refused."""

import io
import json
import sys

import pytest
from helpers.command import CUBE, assert_refused, raster
from PIL import Image

from rasterizer.analysis.speed_error import printed

FEW = ["-s", "32x24", "--seconds", "0.3", "--threads", "1", "--samples", "1,4", "--tolerances", "0,1/4096"]

pytestmark = pytest.mark.usefixtures("folder")


def run(*argv) -> int:
    return raster("bench", *FEW, *argv)


def test_table_and_advice(folder, capsys):
    few = ["--shadings", "flat,gouraud", "--subdivisions", "0,1", "--samples", "4", "--seconds", "9"]
    assert run(CUBE, *few) == 0
    *_, others, _, last = capsys.readouterr().out.splitlines()
    assert "--all" in others and last.startswith("Choose ")
    assert run(CUBE, *few, "--all") == 0
    out, _ = capsys.readouterr()
    assert list(folder.iterdir()) == []
    title, *_, last = lines = out.splitlines()
    assert title.startswith(f"{CUBE}: 12 triangles, 32x24, 1 thread on ")
    assert last.startswith("Choose ") and "tolerance" in last
    head = next(line for line in lines if line.lstrip().startswith("shading"))
    assert head.split()[:6] == ["shading", "samples", "tolerance", "ms", "rms", "max"]
    rows = [line for line in lines if "%" in line]
    assert len(rows) == (2 + 1) * 2


def test_the_record_holds_all_rows_also_where_another_model_fails(capsys):
    assert run("nope.obj", CUBE, "--json", "--shadings", "gouraud,phong", "--subdivisions", "0") == 1
    out, err = capsys.readouterr()
    failed, record = map(json.loads, out.splitlines())
    assert "nope.obj: no such file" in err and failed["model"] == "nope.obj"
    assert (record["model"], record["size"], record["faces"]) == (CUBE, [32, 24], 12)
    rows = record["rows"]
    assert len(rows) == 2 * 2 * 2 and record["left_out"] == []
    for row in rows:
        mine = row["ms"], printed(row["error"]["rms"])
        all_of = [(other["ms"], printed(other["error"]["rms"])) for other in rows]
        beaten = any(other != mine and other[0] <= mine[0] and other[1] <= mine[1] for other in all_of)
        assert row["is_beaten"] == beaten
        assert row["shading"] in ("gouraud", "phong") and row["samples"] in (1, 4) and row["error"]["flip"] is None
    assert [row["is_beaten"] for row in rows] == sorted(row["is_beaten"] for row in rows)
    assert record["machine"]["cores"] >= 1 and record["advice"].startswith("Choose ")


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_plot(folder, capsys, suffix):
    pytest.importorskip("matplotlib")
    assert run(CUBE, "--subdivisions", "0", "--view", "iso", "--view", "top", "-q",
               "--plot", f"{{stem}}-{{view}}.{suffix}") == 0  # fmt: skip
    assert capsys.readouterr() == ("", "")
    names = sorted(path.name for path in folder.iterdir())
    assert names == [f"cube-iso.{suffix}", f"cube-top.{suffix}"]
    content = (folder / names[0]).read_bytes()
    if suffix == "png":
        assert Image.open(io.BytesIO(content)).width > 900
    else:
        text = content.decode()
        assert "milliseconds a frame" in text and "front" in text and "Gouraud" in text


def test_flip(capsys):
    pytest.importorskip("flip_evaluator")
    flags = ["--flip", "--json", "--shadings", "flat,phong", "--samples", "4", "--tolerances", "0"]
    assert run(CUBE, *flags) == 0
    flat, phong = sorted(json.loads(capsys.readouterr().out)["rows"], key=lambda row: row["shading"])
    assert 0.0 < phong["error"]["flip"] < flat["error"]["flip"] < 1.0


def test_what_is_refused_before_anything_is_measured(capsys, monkeypatch):
    assert_refused(capsys, [([CUBE, *argv.split()], words) for argv, words in (
        ("--shadings flat,nope", "flat, lambert, gouraud, phong"),
        ("--samples 3", "1, 4, 9, 16"),
        ("--tolerances 1/0", "1/4096"),
        ("--tolerances 1/4096,-1", "tolerance must be"),
        ("--seconds 0", "--seconds"),
        ("--subdivisions 16", "subdivisions"),
        ("--shading flat", "--shading"),
        ("--color-range scene", "unrecognized arguments"),
    )], "bench")  # fmt: skip
    for flag, module in (("--plot x.png", "matplotlib"), ("--flip", "flip_evaluator")):
        monkeypatch.setitem(sys.modules, module, None)  # as where it isn't installed
        assert_refused(capsys, [(["nope.obj", *flag.split()], "pip install")], "bench")


def test_a_model_that_is_too_large_in_every_row_is_told(capsys):
    assert run(CUBE, "--shadings", "gouraud", "--subdivisions", "15") == 2
    assert "nothing is measured: the subdivided model is too large" in capsys.readouterr().err


def test_plots_that_can_not_be_written_are_refused(capsys):
    pytest.importorskip("matplotlib")
    assert_refused(capsys, [
        ([CUBE, "--plot", "x.gif"], ".svg"), ([CUBE, CUBE, "--plot", "same.svg"], "both be written")
    ], "bench")  # fmt: skip
    assert_refused(capsys, [([CUBE, "--plot", f"{CUBE}/x.svg"], "no folder")], "bench", code=4)


def test_an_empty_picture_has_rows_without_errors(capsys):
    flags = ["--json", "--shadings", "flat", "--subdivisions", "0", "--samples", "1"]
    assert run(CUBE, "--eye", "0,0,9", "--target", "0,0,18", *flags) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert len(rows) == 2 and all(row["error"]["max"] == row["error"]["rms"] == 0 for row in rows)
