"""The scripts of bench/ run, and their last line is JSON with what they promise. All but one of them run at night."""

import json

import numpy as np
import pytest
from faults.faults import FAULTS, HELD_OUT
from helpers.raster import ROOT

import rasterizer as rz
from bench import (
    before_after,
    choices,
    encode,
    features,
    frame,
    fuzz,
    history,
    margins,
    measure,
    paths,
    refinement,
    scale,
    startup,
    throughput,
    tolerance,
    tolerance_modes,
)
from rasterizer import reference
from rasterizer.analysis.timing import MIN_ROUNDS, take_turns

QUICK = ["--frames", "3", "--seconds", "0.01"]
MACHINE = {"cpu", "cores", "system", "python", "numpy", "numba", "llvmlite", "rasterizer", "load", "others"}
SMALL = ["--sizes", "32", "--threads", "1"]
# Each script with arguments that are little work, and how many rows it prints.
RUNS = [
    (frame, ["cube", "quads-back", *SMALL, "--shadings", "gouraud", "phong", "--stages", *QUICK], 4),
    (frame, ["cube", *SMALL, "--shadings", "flat", "--memory"], 1),
    (before_after, [str(ROOT), "cube", "--size", "32", "--frames", "3", "--pairs", "1"], len(before_after.KINDS)),
    (paths, ["one channel", "--scan", "cube", "--scenes", "scan,quads", "--frames", "3"], 2),
    (features, ["--model", "cube", "--size", "40", *QUICK], len(features.list_features())),
    (encode, ["cube", "noise", *SMALL, "--levels", "1", "6", "--rounds", "3", "--seconds", "0.01"], 9),
    (throughput, ["--models", "2", "--workers", "1", "2", "--size", "16", "--rounds", "1"], 2),
    (scale, ["lights", "objects", "--most", "4", *QUICK], 3),
    (scale, ["--many", "20"], 10),
    (startup, [str(ROOT / "models/cube.obj"), "--size", "32x24", "--runs", "1", "--cold", "0"], 10),
    (tolerance, ["cube", "--size", "40x30", "--shadings", "gouraud", "--tolerances", "0", "1/256", *QUICK], 2),
    (tolerance_modes, ["--models", "cube@24", "--size", "24x16", "--turns", "1"], 8),
    (choices, ["cube", "table", "--size", "32x24", "--seconds", "2"], 10),
    (refinement, ["plane", "--quads", "4", "8", "--finest", "16", "--size", "64", "--seconds", "0.1"], 6),
]


def rows_of(capsys, module, arguments) -> list[dict]:
    """Run a script; return the rows of the JSON line that it has printed last."""
    assert module.main(arguments) == 0
    out, err = capsys.readouterr()
    assert "no function was found" not in err, f"hooks of bench/stages.py are out of date: {err}"
    record = json.loads(out.splitlines()[-1])
    assert set(record) == {"bench", "machine", "settings", "rows", "peak_mib"} and set(record["machine"]) == MACHINE
    assert record["bench"] == module.__name__.rpartition(".")[2]
    return record["rows"]


@pytest.mark.parametrize("k", [pytest.param(k, marks=[pytest.mark.nightly] if k else []) for k in range(len(RUNS))])
def test_a_script_prints_what_it_has_measured(k, folder, capsys):
    module, arguments, least = RUNS[k]
    rows = rows_of(capsys, module, arguments)
    assert len(rows) >= least, f"{module.__name__} {arguments}: {len(rows)} rows < {least}"
    times = [value for row in rows for key, value in row.items() if key.endswith("ms") and value is not None]
    assert not [time for time in times if time < 0] and (times or module is not frame)
    assert all(row["max"] <= row["bound"] for row in rows if "bound" in row and "max" in row)


@pytest.mark.nightly
def test_errors_fall_as_theory_says(capsys):
    arguments = ["teapot patch", "--quads", "16", "32", "64", "--finest", "512", "--size", "160", "--seconds", "0.1"]
    rows = rows_of(capsys, refinement, arguments)
    for shading in refinement.SHADINGS:
        slope = refinement.last_slopes(rows, shading)[0]
        assert slope == pytest.approx(refinement.THEORY[shading], abs=0.1), f"{shading}: {slope}"


@pytest.mark.nightly
def test_what_is_measured_is_kept_and_plotted(folder, capsys):
    arguments = ["--file", "h.jsonl", "--add", "--note", "first", "--cases", "teapot Gouraud", *QUICK]
    assert history.main(arguments) == 0
    (found,) = history.read_history(folder / "h.jsonl")
    lines = [{**found, "ratios": ratios, "machine": {"cpu": cpu}} for ratios, cpu in (
        ({"a": 1.0, "b": 2.0}, "A"), ({"a": 9.0, "b": 9.0}, "B"), ({"a": 1.2, "b": 1.9, "c": 3.0}, "A"))]  # fmt: skip
    for many, code in ((lines, 1), (lines[:2], 0)):  # another processor says nothing
        (folder / "h.jsonl").write_text("".join(json.dumps(each) + "\n" for each in many))
        capsys.readouterr()
        assert history.main(["--file", "h.jsonl"]) == code
        assert ("slower: a, 1.20 times the line before" in capsys.readouterr().out) == bool(code)
    rows = rows_of(capsys, encode, [*RUNS[5][1], "--json", "a/encode.json"])
    text = (folder / "a" / "encode.json").read_text()
    assert json.loads(text)["rows"] == rows
    assert sum(line.startswith('  {"case"') for line in text.splitlines()) == len(rows), "a row a line"
    pytest.importorskip("matplotlib")
    rows = [{"feature": f"thing {k}", "ns_more": k - 1.0, "dtype": "float32"} for k in range(4)]
    measure.write_plot(folder / "x.svg", features.plot, rows)
    assert (folder / "x.svg").read_bytes().startswith(b"<?xml")


@pytest.mark.nightly
def test_fuzz_goes_on_where_it_was_ended(folder, capsys):
    few = ["--cases", "6", "--batch", "2", "--climbs", "1", "--steps", "2", "--processes", "1"]
    assert fuzz.main([*few, "--cases", "2"]) == 0 == fuzz.main(few)
    lines = (folder / "fuzz.jsonl").read_text().splitlines()
    assert [(json.loads(line)["first"], json.loads(line)["stop"]) for line in lines] == [(0, 2), (2, 4), (4, 6)]
    (folder / "fuzz.jsonl").write_text("\n".join([*lines[:2], lines[2][:30]]))  # it was ended while writing
    capsys.readouterr()
    assert fuzz.main(few) == 0
    out = capsys.readouterr().out
    assert out.count("[") == 1 and "[3/3] scenes 4 to 5" in out and "6 scenes, " in out and "0 faults" in out


# ---------------------------------------------------------------- what measurements stand on


def test_what_paths_and_faults_put_in_the_place_of_lines_finds_these_lines():
    edits = [(path.name, file, before) for path in paths.PATHS for file, before, _ in path.edits]
    edits += [(fault.what, fault.file, fault.before) for fault in (*FAULTS, *HELD_OUT)]
    for name, file, before in edits:
        count = (ROOT / "rasterizer" / file).read_text(encoding="utf-8").count(before)
        assert count == 1, f"{name}: {before!r} stands {count} times in {file}"


def test_calls_take_turns():
    order = []
    calls = {name: lambda name=name: order.append(name) for name in "ab"}
    times = take_turns(calls, 0.0, 25)
    assert order == list("ab") * MIN_ROUNDS and len(times["a"][0]) == MIN_ROUNDS


def test_a_slope_is_the_power_with_which_a_cost_grows():
    for power, floor in ((1.0, 0.0), (2.0, 0.0), (0.5, 0.0), (1.0, 5.0)):
        rows = [{"n": n, "ms": floor + 0.1 * n**power} for n in (1, 10, 100, 1000, 10_000)]
        assert scale.slope_of(rows, "ms", 1.0) == pytest.approx(power, abs=0.15)


def test_errors_are_not_measured_where_depth_cannot_tell_what_is_in_front():
    """Squares that cross each other, drawn with coarse depth: along their edges the reference may show the other
    one."""
    rng, size, settings = np.random.default_rng(12), (48, 36), {"shading": "flat", "samples": 4}
    square, meshes = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float), []
    for _ in range(12):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        meshes.append(rz.Mesh(square @ turn, [[0, 1, 2, 3]], material=rz.Material(diffuse=rng.random(3))))
    scene = rz.Scene(meshes, camera=rz.Camera.perspective((0, 0, 3), near=1e-4))
    expected = reference.render(scene, size, **settings)
    is_clear = margins.clear_pixels(scene, size, 4, lambda grid: reference.render(scene, grid, shading="flat"))
    drawn = rz.render(scene, size, tolerance=0, outputs=("color", "face"), **settings)
    row = tolerance.compare_with_reference(drawn, expected, is_clear)
    assert row["max"] <= row["bound"], f"{row['max']:.3g} > {row['bound']:.3g}"
    assert row["other"] <= 0.1 * is_clear.size, f"{row['other']} pixels left out > 10 %"


def test_normals_of_surfaces_look_outwards():
    for name in refinement.SURFACES:
        mesh = refinement.make_mesh(name, 24)
        corners = mesh.vertices[mesh.faces]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        cosine = np.einsum("ij,ij->i", area, mesh.normals[mesh.faces[:, 0]]) / np.linalg.norm(area, axis=1)
        assert cosine.min() > 0.9, f"{name}: a normal that looks away, {cosine.min():.3g} <= 0.9"
