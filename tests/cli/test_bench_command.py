"""`raster bench`: the table, the record, the plot, and what is refused."""

import io
import json
import sys

import pytest
from helpers.raster import ROOT
from PIL import Image

from rasterizer.analysis.ground_truth import Errors
from rasterizer.analysis.speed_error import Method, Row, Study, printed
from rasterizer.cli import bench_command, main

BALL, CUBE, GLOBE = (str(ROOT / "models" / name) for name in ("sphere.obj", "cube.obj", "globe.obj"))
FEW = ["-s", "48x36", "--seconds", "2", "--threads", "1", "--samples", "1,4", "--tolerances", "0,1/4096"]

pytestmark = pytest.mark.usefixtures("folder")


def run(*argv) -> int:
    return main(["bench", *FEW, *map(str, argv)])


def test_table_and_advice(folder, capsys):
    assert run(CUBE, "--subdivisions", "0,1", "--seconds", "20") == 0
    out, _ = capsys.readouterr()
    assert list(folder.iterdir()) == []
    title, *_, last = lines = out.splitlines()
    assert title.startswith(f"{CUBE}: 12 triangles, 48x36, 1 thread on ")
    assert last.startswith("Choose ") and "tolerance" in last
    head = next(line for line in lines if line.lstrip().startswith("shading"))
    assert head.split()[:6] == ["shading", "samples", "tolerance", "ms", "ns/tri", "ns/px"]
    rows = [line for line in lines if line[:1].isdigit() or line.startswith("<")]
    assert len(rows) == (3 + 1) * 2 * 2
    numbers = [int(line.split()[0]) for line in rows if line[0].isdigit()]
    assert numbers == list(range(1, len(numbers) + 1)) and rows[: len(numbers)] == [r for r in rows if r[0].isdigit()]
    assert all(1 <= int(line.split()[0][1:]) <= len(numbers) for line in rows[len(numbers) :])
    assert len({line.index("1/4096") + 6 for line in rows if "1/4096" in line}) == 1, "columns stand below each other"
    assert "toon" in out and "shade-once" in out


def test_the_record_holds_all_rows(capsys):
    assert run(BALL, "--json", "--shadings", "gouraud,phong", "--subdivisions", "0", "--no-axes") == 0
    record = json.loads(capsys.readouterr().out)
    assert record["axes_left_out"] == []
    assert (record["path"], record["size"], record["faces"]) == (BALL, [48, 36], 5120)
    rows = record["rows"]
    assert len(rows) == 2 * 2 * 2 and record["axes"] == [] and record["left_out"] == []
    for row in rows:
        others = [
            o for o in rows if o["ms"] <= row["ms"] and printed(o["error"]["rms"]) <= printed(row["error"]["rms"])
        ]
        assert row["is_beaten"] == (len(others) > 1)
        assert row["ns_triangle"] == pytest.approx(1e6 * row["ms"] / 5120)
        assert row["shading"] in ("gouraud", "phong") and row["samples"] in (1, 4) and row["error"]["flip"] is None
    assert [row["is_beaten"] for row in rows] == sorted(row["is_beaten"] for row in rows)
    assert record["machine"]["cores"] >= 1 and record["advice"].startswith("Choose ")


def test_what_is_beyond_a_bound_next_to_a_step_is_marked():
    """Without a step it would be a fault: no mark excuses that."""
    errors = Errors(0.1, 0.1, 0, 0.0, 0.0, 0.0, 0.0, 1)
    rows = [
        Row(Method("phong", 0, 4, 0.1), ms, 1.0, 1.0, errors, 0.0, 0.0, rounding, 1e-3, ms > 1, has_steps)
        for ms, rounding, has_steps in ((1.0, 2e-3, True), (2.0, 1e-4, True), (3.0, 3e-3, False))
    ]
    lines = bench_command._table(Study(rows, [], "", None, 0.0))
    assert [line.count("*") for line in lines] == [0, 1, 0, 0, 0, 0, 1]
    assert "2.0e-03*  1.0e-03" in lines[1] and "1.0e-04   1.0e-03" in lines[4]
    assert lines[-1].startswith("*: next to a step")
    lines = bench_command._table(Study([rows[2]._replace(is_beaten=False)], [], "", None, 0.0))
    assert "3.0e-03  1.0e-03" in lines[1] and not any("*" in line for line in lines)


def test_what_else_a_scene_has(capsys):
    lights = ["--light", "directional:-1,-2,-1,shadow=64", "--light", "area:1,3,2,edge_u=1/0/0,edge_v=0/0/1"]
    flags = ["--json", "--shadings", "phong", "--samples", "1", "--subdivisions", "0", "--seconds", "12"]
    assert run(GLOBE, *lights, *flags) == 0
    axes = json.loads(capsys.readouterr().out)["axes"]
    names = list(dict.fromkeys(row["axis"] for row in axes))
    assert names == ["shadow map", "shadow filter", "area light", "texture filter", "antialias", "reflection"]
    of = {name: [row for row in axes if row["axis"] == name] for name in names}
    assert [row["value"] for row in of["shadow map"]][:2] == ["64²", "256²"]
    # Rays where there is time for them, which a busy machine may not have.
    assert all(row["against"].startswith(("rays, in ", "maps of ")) for name in names[:2] for row in of[name])
    errors = [row["error"]["rms"] for row in of["area light"]]
    assert errors == sorted(errors, reverse=True) and errors[-1] < errors[0], "more cells, less error"
    assert all(row["error"] is None for row in of["reflection"]), "another look is no error"
    assert all(row["error"]["rms"] > 0 for row in of["texture filter"])


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_plot(folder, capsys, suffix):
    pytest.importorskip("matplotlib")
    assert run(CUBE, "--subdivisions", "0", "--no-axes", "--view", "iso", "--view", "top", "-q",
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


def test_a_missing_library_is_told_before_anything_is_measured(capsys, monkeypatch):
    for flag, module in (("--plot", "matplotlib"), ("--flip", "flip_evaluator")):
        monkeypatch.setitem(sys.modules, module, None)
        assert run("nope.obj", *([flag, "x.png"] if flag == "--plot" else [flag])) == 2
        err = capsys.readouterr().err
        assert "pip install" in err and err.count("\n") == 1


def test_flip(capsys):
    pytest.importorskip("flip_evaluator")
    assert (
        run(CUBE, "--flip", "--json", "--shadings", "flat,phong", "--samples", "4", "--no-axes", "--tolerances", "0")
        == 0
    )
    flat, phong = sorted(json.loads(capsys.readouterr().out)["rows"], key=lambda row: row["shading"])
    assert 0.0 < phong["error"]["flip"] < flat["error"]["flip"] < 1.0


@pytest.mark.parametrize(
    ("argv", "code", "message"),
    [
        (["--shadings", "flat,nope"], 2, "flat, lambert, gouraud, phong"),
        (["--samples", "3"], 2, "1, 4, 9, 16"),
        (["--tolerances", "1/0"], 2, "1/4096"),
        (["--tolerances", "1/4096,-1"], 2, "tolerance must be"),
        (["--seconds", "0"], 2, "--seconds"),
        (["--subdivisions", "16"], 2, "subdivisions"),
        (["--plot", "x.gif"], 2, ".svg"),
        (["--plot", f"{CUBE}/x.svg"], 4, "no folder"),
        (["--shading", "flat"], 2, "--shading"),
    ],
)
def test_what_is_refused(folder, capsys, argv, code, message):
    if "--plot" in argv:
        pytest.importorskip("matplotlib")
    assert run(CUBE, *argv) == code
    err = capsys.readouterr().err
    assert message in err and err.startswith("raster: error: ") and err.count("\n") == 1
    assert list(folder.iterdir()) == []


def test_a_model_that_fails_does_not_stop_the_rest(capsys):
    few = ["--shadings", "flat", "--samples", "1", "--no-axes"]
    assert run("nope.obj", CUBE, *few) == 1
    out, err = capsys.readouterr()
    assert "nope.obj: no such file" in err and out.startswith(f"{CUBE}: 12 triangles")


def test_two_plots_of_one_name_are_refused(capsys):
    pytest.importorskip("matplotlib")
    assert run(CUBE, CUBE, "--plot", "same.svg") == 2
    assert "both be written" in capsys.readouterr().err


def test_an_empty_picture_has_rows_without_errors(capsys):
    assert run(CUBE, "--eye", "0,0,9", "--target", "0,0,18", "--json", "--no-axes", "--shadings", "flat") == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert all(row["error"]["n_pixel"] == 0 and row["error"]["rms"] == 0 for row in rows)


def test_help(capsys):
    with pytest.raises(SystemExit):
        main(["bench", "--help"])
    text = capsys.readouterr().out
    assert "--tolerances" in text and "CIEDE2000" in text
