"""The scripts of bench/ run, and their last line is JSON with what they promise. All but one of them run at night."""

import io
import json

import numpy as np
import pytest
from helpers import true_surfaces
from helpers.raster import ROOT
from PIL import Image

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
    refinement,
    scale,
    scenes,
    stages,
    startup,
    surfaces,
    table_rows,
    throughput,
    tolerance,
    tolerance_modes,
)
from rasterizer import reference
from rasterizer.analysis.comparison import root_mean_square
from rasterizer.analysis.timing import LEAST_ROUNDS, take_turns

nightly = pytest.mark.nightly
QUICK = ["--frames", "3", "--seconds", "0.01"]
MACHINE = {"cpu", "cores", "system", "python", "numpy", "numba", "llvmlite", "rasterizer", "load", "others"}


def record_of(capsys, bench) -> dict:
    """Return the JSON line that a script has printed last."""
    record = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert set(record) == {"bench", "machine", "settings", "rows", "peak_mib"}
    assert record["bench"] == bench and set(record["machine"]) == MACHINE
    return record


# ---------------------------------------------------------------- times


def test_frame(capsys):
    """The one that stands for all."""
    arguments = ["cube", "quads-back", "--sizes", "32", "48x20", "--threads", "1", "--shadings", "gouraud", "phong"]
    assert frame.main([*arguments, "--channels", "rgb", "--stages", *QUICK]) == 0
    rows = record_of(capsys, "frame")["rows"]
    assert [(row["case"], row["shading"], row["size"]) for row in rows] == [
        (case, shading, size)
        for case in ("cube", "quads-back")
        for size in ("32x32", "48x20")
        for shading in ("gouraud", "phong")
    ]
    for row in rows:
        assert row["ms_1"] > 0 and row["n_frame"] == 3 and set(row["stages"]) == {"1"}
        assert (row["coverage"] == 1.0) == (row["case"] == "quads-back")


@nightly
def test_frame_in_fresh_processes(capsys):
    assert frame.main(["cube", "--sizes", "32", "--shadings", "flat", "--threads", "1", "--memory"]) == 0
    (row,) = record_of(capsys, "frame")["rows"]
    assert (
        all(row[f"{step}_ms"] > 0 for step in ("import", "build", "prepare", "first", "warm")) and row["peak_mib"] > 1
    )


@nightly
def test_before_after(capsys):
    """A version compared with itself."""
    assert before_after.main([str(ROOT), "cube", "--size", "32", "--frames", "3", "--pairs", "1"]) == 0
    rows = record_of(capsys, "before_after")["rows"]
    assert [(row["shading"], row["channels"]) for row in rows] == list(before_after.KINDS)
    assert all(row["case"] == "cube" and row["ratio"] > 0 and row["ratio_of_best"] > 0 for row in rows)
    with pytest.raises(SystemExit, match="can't draw"):
        before_after.Version(ROOT, ("no such scene", "32", "flat", "mono", "none", 1))


@nightly
def test_features_and_throughput(capsys, tmp_path):
    assert features.main(["--model", "cube", "--size", "40", *QUICK]) == 0
    rows = record_of(capsys, "features")["rows"]
    costs = {row["feature"]: row for row in rows if "feature" in row}
    assert set(costs) == set(features.list_features()) and all(row["ms"] > 0 for row in costs.values())
    assert costs["plain"]["ns_more"] is None and costs["plain"]["dtype"] == "float32"
    assert [row["triangles"] for row in rows if "light" in row] == [12, 12]
    assert [row["outputs"] for row in rows if "outputs" in row] == 2 * list(features.BUFFERS)
    kept = tmp_path / "throughput.json"
    arguments = ["--models", "2", "--workers", "1", "2", "--size", "16", "--rounds", "1", "--json", str(kept)]
    assert throughput.main(arguments) == 0
    rows = record_of(capsys, "throughput")["rows"]
    assert [row["processes"] for row in rows] == [1, 2] and rows[0]["gain"] == 1.0
    assert all(row["pictures"] == 8 and row["per_second"] > 0 for row in rows)
    assert json.loads(kept.read_text())["rows"] == rows and table_rows.throughput(rows)[2].startswith("| 1 | ")


@nightly
def test_encode_and_what_is_kept(capsys, folder):
    arguments = ["cube", "noise", "--sizes", "40x30", "--levels", "1", "6", "--threads", "1", "--json", "a/encode.json"]
    assert encode.main([*arguments, "--rounds", "3", "--seconds", "0.01"]) == 0
    record = record_of(capsys, "encode")
    assert [row["writer"] for row in record["rows"]] == ["own 1T", "Pillow 1", "Pillow 6"] * 3
    assert all(row["ms"] > 0 and row["kib"] > 0 for row in record["rows"])
    text = (folder / "a" / "encode.json").read_text()
    assert json.loads(text) == record and "json" not in record["settings"]
    assert sum(line.startswith('  {"case"') for line in text.splitlines()) == len(record["rows"]), "a row a line"


@nightly
def test_startup(capsys):
    """With the kernels that are there: compiling them takes too long here."""
    assert startup.main([str(ROOT / "models/cube.obj"), "--size", "32x24", "--runs", "1", "--cold", "0"]) == 0
    out, err = capsys.readouterr()
    assert "no function was found" not in err, f"hooks of bench/stages.py are out of date: {err}"
    record = json.loads(out.splitlines()[-1])
    programs = {row["program"]: row for row in record["rows"] if "program" in row}
    assert {"import numba", "python alone", "raster --help", "raster render", "in a worker"} <= set(programs)
    assert all(row["ms"] > 0 for row in programs.values()) and programs["import numba"]["yards"] == 1.0
    of_stages = {row["stage"]: row for row in record["rows"] if "stage" in row}
    expected = {"python", "numpy", "own modules", "read", "normals", "kernels", "draw", "encode", "write", "exit"}
    assert expected <= set(of_stages) <= {*stages.STAGES, "whole process"}
    whole = of_stages.pop("whole process")["warm_ms"]
    total = sum(row["warm_ms"] for row in of_stages.values())
    assert total <= whole, f"stages take {total:.0f} > {whole:.0f} ms of the whole process"


def test_calls_take_turns():
    order = []
    calls = {name: lambda name=name: order.append(name) for name in "ab"}
    times = take_turns(calls, 0.0, 25)
    assert order == list("ab") * LEAST_ROUNDS and len(times["a"][0]) == LEAST_ROUNDS


# ---------------------------------------------------------------- growth


@nightly
def test_scale(capsys, folder):
    """The beginning of each axis; every point is a process of its own."""
    assert scale.main(["lights", "objects", "--most", "4", *QUICK]) == 0
    rows = record_of(capsys, "scale")["rows"]
    points = [(row["axis"], row["n"]) for row in rows if "n" in row]
    assert points == [("lights", 1), ("lights", 4), ("objects", 1)]
    assert scale.main(["--many", "20"]) == 0
    rows = record_of(capsys, "scale")["rows"]
    assert [row["n"] for row in rows] == list(range(2, 21, 2)) and all(row["mib"] > 10 for row in rows)
    assert scale.main(["--large", "256"]) == 0
    rows = record_of(capsys, "scale")["rows"]
    assert [row["n"] for row in rows] == [32, 64, 128, 256] and not list(folder.iterdir())


def test_a_slope_is_the_power_with_which_a_cost_grows():
    for power, floor in ((1.0, 0.0), (2.0, 0.0), (0.5, 0.0), (1.0, 5.0)):
        rows = [{"n": n, "ms": floor + 0.1 * n**power} for n in (1, 10, 100, 1000, 10_000)]
        assert scale.slope_of(rows, "ms", 1.0) == pytest.approx(power, abs=0.15)
        assert scale.slope_of(rows, "ms", 1e9) is None and scale.slope_of([], "ms", 1.0) is None
    counted = {
        "lights": lambda scene: len(scene.lights) >= 20,
        "shadows": lambda scene: sum(light.shadow is not None for light in scene.lights) == 20,
        "materials": lambda scene: len(scene.meshes[0].palette) == 20,
        "objects": lambda scene: len(scene.meshes) == 20,
    }
    for name, is_large in counted.items():
        small, large = (scale.AXES[name].make(n).scene for n in (1, 20))
        assert is_large(large) and not is_large(small), name


@nightly
def test_what_is_slower_is_named(folder, capsys):
    name = "teapot Gouraud"
    arguments = ["--file", "h.jsonl", "--add", "--note", "first", "--cases", name, "--frames", "3", "--seconds", "0.1"]
    assert history.main(arguments) == 0
    (found,) = history.read_history(folder / "h.jsonl")
    assert found["note"] == "first" and set(found["ratios"]) == {name} and found["ratios"][name] > 0
    lines = [{**found, "ratios": ratios, "machine": {"cpu": cpu}} for ratios, cpu in (
        ({"a": 1.0, "b": 2.0}, "A"), ({"a": 9.0, "b": 9.0}, "B"), ({"a": 1.2, "b": 1.9, "c": 3.0}, "A"))]  # fmt: skip
    for many, code in ((lines, 1), (lines[:2], 0)):  # another processor says nothing
        (folder / "h.jsonl").write_text("".join(json.dumps(each) + "\n" for each in many))
        capsys.readouterr()
        assert history.main(["--file", "h.jsonl"]) == code
        out = capsys.readouterr().out
        assert ("slower: a, 1.20 times the line before" in out) == bool(code) and "slower: b" not in out
    assert history.main(["--file", "none.jsonl"]) == 0 and "no lines yet" in capsys.readouterr().out
    assert all(set(each["ratios"]) <= set(history.CASES) for each in history.read_history(history.HISTORY))


@nightly
def test_plots(folder):
    pytest.importorskip("matplotlib")
    rows = [{"feature": f"thing {k}", "ns_more": k - 1.0, "dtype": "float32"} for k in range(4)]
    measure.write_plot(folder / "plots" / "x.png", features.plot, rows)
    assert Image.open(folder / "plots" / "x.png").mode == "P"
    measure.write_plot(folder / "x.svg", features.plot, rows)
    assert (folder / "x.svg").read_bytes().startswith(b"<?xml")
    measure.write_plot(None, features.plot, rows)
    point = {"build_ms": 1.0, "prepare_ms": 2.0, "cpu_ms": 3.0, "mib": None}
    rows = [row for name in ("a", "b") for row in [*({"axis": name, "n": n} | point for n in (1, 10)),
                                                   {"axis": name, "slopes": {}}]]  # fmt: skip
    assert len(scale.plot(rows, ".png")) > 1000
    line = {"date": "2026-01-01", "version": "0", "commit": "abc", "note": "", "machine": {"cpu": "A"}}
    lines = [line | {"ratios": ratios} for ratios in ({"a": 1.0, "b": 2.0}, {"a": 0.8})]  # fmt: skip
    assert Image.open(io.BytesIO(history.plot(lines, ".png"))).width > 800
    rows = [{"surface": "sphere", "shading": shading, "triangles": 2 * n * n, "quads": n, "rms": 1 / n, "ms": float(n)}
            for shading in refinement.SHADINGS for n in (4, 8, 16)]  # fmt: skip
    assert Image.open(io.BytesIO(refinement.plot(rows, ".png"))).height > 500


# ---------------------------------------------------------------- errors


@nightly
def test_tolerance(capsys):
    arguments = ["cube", "--size", "40x30", "--shadings", "gouraud", "--tolerances", "0", "1/256"]
    assert tolerance.main([*arguments, "--samples", "1", "4", *QUICK]) == 0
    for row in record_of(capsys, "tolerance")["rows"]:
        assert row["rms"] <= row["max"] <= row["bound"] and row["of_bound"] == row["max"] / row["bound"], row
        assert 0 < row["vertices"] < 0.01 and row["ms"] > 0 and (row["of_first"] == 1.0) == (row["tolerance"] == "0"), (
            row
        )
    assert tolerance_modes.main(["--models", "cube@24", "--size", "24x16", "--turns", "1"]) == 0
    rows = record_of(capsys, "tolerance_modes")["rows"]
    modes = [row for row in rows if "mode" in row]
    assert {row["mode"] for row in modes} == set(tolerance_modes.list_modes((24, 16)))
    assert all(0 <= row["used"] <= 1 and row["ms"] > 0 for row in modes)
    assert table_rows.tolerance_modes(rows)[0].count("|") == 7 and len(table_rows.mixed(rows)) == 6


@nightly
def test_choices(capsys):
    assert choices.main(["cube", "table", "--size", "32x24", "--seconds", "2"]) == 0
    rows = record_of(capsys, "choices")["rows"]
    methods = [row for row in rows if row["what"] == "method"]
    assert {row["model"] for row in methods} == {"cube"} and {row["samples"] for row in methods} == {1, 4, 16}
    assert all(row["triangles"] == 12 * 4 ** row["subdivisions"] for row in methods)
    others = {row["what"] for row in rows} - {"method"}
    assert others == {"shadow map", "shadow filter", "antialias", "reflection"}
    pytest.importorskip("matplotlib")
    assert choices.plot(rows, ".svg").startswith(b"<?xml")


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


def test_shapes_are_closed_and_wound_outwards():
    for vertices, faces in (scenes.icosphere(2), scenes.uv_sphere(6, 9), scenes.torus(5, 7)):
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).tolist()
        assert len(set(map(tuple, edges))) == len(edges) and {(b, a) for a, b in edges} == set(map(tuple, edges))
        a, b, c = vertices[faces].astype(float).transpose(1, 0, 2)
        assert np.sum(a * np.cross(b, c)) > 0
    for name in surfaces.SURFACES:
        mesh = surfaces.make_mesh(name, 24)
        corners = mesh.vertices[mesh.faces]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        cosine = np.einsum("ij,ij->i", area, mesh.normals[mesh.faces[:, 0]]) / np.linalg.norm(area, axis=1)
        assert cosine.min() > 0.9, f"{name}: a normal that looks away, {cosine.min():.3g} <= 0.9"


@nightly
def test_true_surfaces_are_what_meshes_approximate():
    """Rays that meet the sphere or torus itself, against coarse meshes; and against the finest, off by its rounding."""
    size = (48, 36)
    for name, samples in (("sphere", 1), ("torus", 4)):
        scene = scenes.build(name, size)
        assert true_surfaces.find_surface(scene) == name
        truth = true_surfaces.draw(name, scene, size, samples)
        drawn = rz.render(scene, size, shading="phong", samples=samples, outputs=("color", "depth"))
        with np.errstate(invalid="ignore"):  # inf - inf where nothing is
            is_near = (drawn.depth - truth.nearest < 0.3) & (truth.furthest - drawn.depth < 0.3)
        error = np.abs(drawn.color - truth.color)[(truth.alpha == 1) & (drawn.alpha > 1 - 1e-6) & is_near]
        assert 0 < root_mean_square(error) < 0.01 and error.max() < 0.2, name
    scene = rz.Scene([surfaces.make_mesh("torus", 512, rz.Material())], rz.studio())
    drawn = rz.render(scene, size, shading="phong", tolerance=0, outputs=("color", "depth"))
    truth = true_surfaces.draw("torus", scene, size, 1)
    truth_depth = np.where(np.isfinite(truth.nearest), truth.nearest, 0.0)
    is_inner = (truth.alpha == 1) & (drawn.alpha == 1) & (np.abs(drawn.depth - truth_depth) < 0.05)
    rms = np.sqrt(np.mean((drawn.color - truth.color)[is_inner] ** 2))
    assert is_inner.sum() > 300 and rms < 1e-4, f"{rms:.3g} > 1e-4"


@nightly
def test_errors_fall_as_theory_says(capsys):
    arguments = ["teapot patch", "--quads", "16", "32", "64", "--finest", "512", "--size", "160", "--seconds", "0.1"]
    assert refinement.main(arguments) == 0
    rows = record_of(capsys, "refinement")["rows"]
    for shading in refinement.SHADINGS:
        slope = refinement.last_slopes(rows, shading)[0]
        assert slope == pytest.approx(refinement.THEORY[shading], abs=0.1), f"{shading}: {slope}"
    by = {(row["shading"], row["quads"]): row["rms"] for row in rows}
    assert all(by["flat", n] > by["gouraud", n] > by["phong", n] for n in (16, 32, 64))
    assert refinement.main(["plane", "--quads", "4", "8", "--finest", "16", "--size", "64", "--seconds", "0.1"]) == 0
    rows = record_of(capsys, "refinement")["rows"]
    assert all(row["rms"] < 1e-6 and "slope" not in row for row in rows), "a plane has no error"


# ---------------------------------------------------------------- fuzz

FEW = ["--cases", "6", "--batch", "2", "--climbs", "1", "--steps", "2", "--processes", "1"]


@nightly
def test_fuzz_goes_on_where_it_was_ended_and_tells_faults(folder, capsys, monkeypatch):
    import helpers.campaign

    assert fuzz.main([*FEW, "--cases", "2"]) == 0
    assert fuzz.main(FEW) == 0
    lines = (folder / "fuzz.jsonl").read_text().splitlines()
    assert [(json.loads(line)["first"], json.loads(line)["stop"]) for line in lines] == [(0, 2), (2, 4), (4, 6)]
    (folder / "fuzz.jsonl").write_text("\n".join([*lines[:2], lines[2][:30]]))  # it was ended while writing
    capsys.readouterr()
    assert fuzz.main(FEW) == 0
    out = capsys.readouterr().out
    assert out.count("[") == 1 and "[3/3] scenes 4 to 5" in out and "6 scenes, " in out and "0 faults" in out
    assert fuzz.main([*FEW, "--cases", "2", "--seed", "5", "--report"]) == 0
    assert "nothing is done yet" in capsys.readouterr().out
    fuzz.main([*FEW, "--state", "two.jsonl", "--processes", "2"])
    one, two = ([{**json.loads(line), "seconds": 0} for line in (folder / name).read_text().splitlines()]
                for name in ("fuzz.jsonl", "two.jsonl"))  # fmt: skip
    assert one == two
    real = helpers.campaign.find_faults

    def find_faults(case):
        outcome = real(case)
        return outcome._replace(faults=["it is green"]) if case.index == 1 else outcome

    monkeypatch.setattr(helpers.campaign, "find_faults", find_faults)  # the tests' own: a scene that is wrong
    assert fuzz.main([*FEW, "--state", "green.jsonl", "--cases", "2", "--climbs", "0"]) == 1
    out = capsys.readouterr().out
    assert "it is green" in out and "python -m helpers.campaign 1 1" in out and "1 faults" in out
