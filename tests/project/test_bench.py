"""The scripts of bench/ run, and their last line is JSON with what they promise."""

import json
import threading
from pathlib import Path

import numpy as np
import pytest
from helpers import true_surfaces
from PIL import Image

import rasterizer as rz
from bench import (
    before_after,
    choices,
    encode,
    features,
    frame,
    margins,
    measure,
    scale,
    scenes,
    stages,
    startup,
    table_rows,
    throughput,
    tolerance,
    tolerance_modes,
)
from rasterizer import reference
from rasterizer.analysis.comparison import root_mean_square
from rasterizer.analysis.timing import LEAST_ROUNDS, take_turns

ROOT = Path(__file__).resolve().parents[2]
QUICK = ["--frames", "3", "--seconds", "0.01"]
MACHINE = {"cpu", "cores", "system", "python", "numpy", "numba", "llvmlite", "rasterizer", "load", "others"}


def record_of(capsys, bench) -> dict:
    """Return the JSON line that a script has printed last."""
    record = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert set(record) == {"bench", "machine", "settings", "rows", "peak_mib"}
    assert record["bench"] == bench and set(record["machine"]) == MACHINE
    return record


def test_frame(capsys):
    shadings = ["gouraud", "phong"]
    arguments = [
        "cube",
        str(ROOT / "models/torus.glb"),
        "quads-back",
        "--sizes",
        "32",
        "48x20",
        "--threads",
        "1",
        "2",
    ]
    assert frame.main([*arguments, "--shadings", *shadings, "--channels", "rgb", "--stages", *QUICK]) == 0
    rows = record_of(capsys, "frame")["rows"]
    assert [row["case"] for row in rows[::4]] == ["cube", "torus", "quads-back"]
    assert [row["shading"] for row in rows] == shadings * 6 and [row["size"] for row in rows[::2]] == [
        "32x32",
        "48x20",
    ] * 3
    for row in rows:
        assert set(row) == {"case", "triangles", "size", "shading", "prepare_ms", "first_ms", "ms_1", "ms_2", "n_frame",
                            "spread",
                            "yard_ms", "yards", "gain", "ns_triangle", "ns_pixel", "coverage", "stages"}  # fmt: skip
        assert row["ms_1"] > 0 and row["n_frame"] == 3 and set(row["stages"]) == {"1", "2"}
        assert (row["coverage"] == 1.0) == (row["case"] == "quads-back")


def test_tolerance_modes(capsys):
    assert tolerance_modes.main(["--models", "cube@24", "--size", "24x16", "--turns", "1"]) == 0
    rows = record_of(capsys, "tolerance_modes")["rows"]
    modes = [row for row in rows if "mode" in row]
    assert {row["mode"] for row in modes} == set(tolerance_modes.list_modes((24, 16)))
    assert [row["tolerance"] for row in modes[:5]] == list(tolerance_modes.TOLERANCES)
    assert all(0 <= row["used"] <= 1 and row["ms"] > 0 for row in modes)
    mixed = [row for row in rows if "model" in row]
    assert [(row["model"], row["size"]) for row in mixed] == 4 * [("cube", "24x24")]
    assert all(0 <= row["saved"] <= row["samples"] <= 1 for row in mixed)
    assert table_rows.tolerance_modes(rows)[0].count("|") == 7 and len(table_rows.mixed(rows)) == 6


@pytest.mark.slow
def test_features(capsys):
    assert features.main(["--model", "cube", "--size", "40", "--seconds", "0.01", "--frames", "3"]) == 0
    rows = record_of(capsys, "features")["rows"]
    costs = {row["feature"]: row for row in rows if "feature" in row}
    assert set(costs) == set(features.list_features()) and all(row["ms"] > 0 for row in costs.values())
    assert costs["plain"]["ns_more"] is None and costs["plain"]["dtype"] == "float32"
    assert costs["shadow, look-up"]["dtype"] == costs["shadow, six maps"]["dtype"] == "float32"
    maps = [row for row in rows if "light" in row]
    assert [row["triangles"] for row in maps] == [12, 12] and all(row["ms_1"] > 0 and row["ms_2"] > 0 for row in maps)
    buffers = [row for row in rows if "outputs" in row]
    assert [row["outputs"] for row in buffers] == 2 * list(features.BUFFERS)
    assert all(row["ms_1"] > 0 and row["ms_2"] > 0 for row in buffers) and buffers[0]["ratio_1"] == 1.0


def test_before_after(capsys):
    """A version compared with itself."""
    assert before_after.main([str(ROOT), "cube", "--size", "32", "--frames", "3", "--pairs", "1"]) == 0
    rows = record_of(capsys, "before_after")["rows"]
    assert [(row["shading"], row["channels"]) for row in rows] == list(before_after.KINDS)
    assert all(row["case"] == "cube" and row["ratio"] > 0 and row["ratio_of_best"] > 0 for row in rows)
    with pytest.raises(SystemExit, match="can't draw"):
        before_after.Version(ROOT, ("no such scene", "32", "flat", "mono", "none", 1))


def test_frame_in_fresh_processes(capsys):
    assert frame.main(["cube", "--sizes", "32", "--shadings", "flat", "--threads", "1", "--memory"]) == 0
    (row,) = record_of(capsys, "frame")["rows"]
    steps = {"import_ms", "build_ms", "prepare_ms", "first_ms", "warm_ms"}
    assert set(row) == {"case", "triangles", "size", "shading", "threads", "peak_mib"} | steps
    assert all(row[step] > 0 for step in steps) and row["triangles"] == 12


AXES = ("triangles", "pixels", "lights", "shadows", "materials", "textures", "objects", "threads")


@pytest.mark.slow
def test_scale(capsys):
    """The beginning of each axis; every point is a process of its own."""
    assert tuple(scale.AXES) == AXES
    assert scale.main(["lights", "objects", "--most", "4", "--seconds", "0.01", "--frames", "3"]) == 0
    rows = record_of(capsys, "scale")["rows"]
    points = [(row["axis"], row["n"]) for row in rows if "n" in row]
    assert points == [("lights", 1), ("lights", 4), ("objects", 1)]
    for row in rows:
        if "n" in row:
            assert set(row) == {"axis", "n", "build_ms", "prepare_ms", "cpu_ms", "best_ms", "mib"}
            assert row["best_ms"] > 0 and row["cpu_ms"] > 0
        else:
            assert set(row["slopes"]) == {"build_ms", "prepare_ms", "cpu_ms", "mib"}


@pytest.mark.parametrize("name", AXES[1:])
def test_what_grows_is_what_its_axis_says(name):
    small, large = (scale.AXES[name].make(n).scene for n in (1, 20))
    assert scale.AXES[name].counts == tuple(sorted(scale.AXES[name].counts))
    counted = {
        "lights": lambda scene: len(scene.lights) >= 20,
        "shadows": lambda scene: sum(light.shadow is not None for light in scene.lights) == 20,
        "materials": lambda scene: len(scene.meshes[0].palette) == 20,
        "textures": lambda scene: len({id(material.texture) for material in scene.meshes[0].palette}) == 20,
        "objects": lambda scene: len(scene.meshes) == 20,
    }
    if name in counted:
        assert counted[name](large) and not counted[name](small)
    else:
        assert small.n_face == large.n_face


def test_spheres_have_the_triangles_that_are_asked_for():
    for n in (1000, 10_000, 100_000):
        assert abs(scale.triangles(n).scene.n_face / n - 1) < 0.1


@pytest.mark.parametrize(("power", "floor"), [(1.0, 0.0), (2.0, 0.0), (0.5, 0.0), (1.0, 5.0)])
def test_a_slope_is_the_power_with_which_a_cost_grows(power, floor):
    rows = [{"n": n, "ms": floor + 0.1 * n**power} for n in (1, 10, 100, 1000, 10_000)]
    assert scale.slope_of(rows, "ms", 1.0) == pytest.approx(power, abs=0.15)
    assert scale.slope_of(rows, "ms", 1e9) is None and scale.slope_of([], "ms", 1.0) is None


def test_scale_draws_many_and_large_pictures(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert scale.main(["--many", "20"]) == 0
    rows = record_of(capsys, "scale")["rows"]
    assert [row["n"] for row in rows] == list(range(2, 21, 2)) and all(row["mib"] > 10 for row in rows)
    assert scale.main(["--large", "256"]) == 0
    rows = record_of(capsys, "scale")["rows"]
    assert [row["n"] for row in rows] == [32, 64, 128, 256] and not list(tmp_path.iterdir())
    assert all(row["s"] > 0 and row["mib"] > 10 and row["ns_pixel"] > 0 for row in rows)


def test_scale_plots_what_it_has_measured():
    pytest.importorskip("matplotlib")
    point = {"build_ms": 1.0, "prepare_ms": 2.0, "cpu_ms": 3.0, "mib": None}
    rows = [row for name in ("a", "b") for row in [*({"axis": name, "n": n} | point for n in (1, 10)),
                                                   {"axis": name, "slopes": {}}]]  # fmt: skip
    assert len(scale.plot(rows, ".png")) > 1000


def test_encode(capsys):
    arguments = ["cube", "noise", "--sizes", "40x30", "64", "--levels", "1", "6", "--threads", "1", "2"]
    assert encode.main([*arguments, "--rounds", "3", "--seconds", "0.01"]) == 0
    rows = record_of(capsys, "encode")["rows"]
    writers = ["own 1T", "own 2T", "Pillow 1", "Pillow 6"]
    assert [row["writer"] for row in rows] == writers * 6
    assert [row["case"] for row in rows[::4]] == ["cube", "noise", "mean"] * 2
    assert [row["size"] for row in rows[::12]] == ["40x30", "64x64"]
    for row in rows:
        assert row["ms"] > 0 and row["kib"] > 0 and (row["share"] == 1.0 or row["writer"] != "Pillow 6")
        assert set(row) == {"case", "size", "writer", "ms", "kib", "share"}


@pytest.mark.slow
def test_startup(capsys):
    """With the kernels that are there: compiling them takes too long here."""
    assert startup.main([str(ROOT / "models/cube.obj"), "--size", "32x24", "--runs", "1", "--cold", "0"]) == 0
    out, err = capsys.readouterr()
    assert "no function was found" not in err, f"hooks of bench/stages.py are out of date: {err}"
    record = json.loads(out.splitlines()[-1])
    assert record["bench"] == "startup" and set(record["machine"]) == MACHINE
    programs = {row["program"]: row for row in record["rows"] if "program" in row}
    assert {"import numba", "python alone", "raster --help", "raster render", "in a worker"} <= set(programs)
    assert programs["import numba"]["yards"] == 1.0
    for name, row in programs.items():
        assert row["ms"] > 0 and (row["peak_mib"] is None or row["peak_mib"] > 1), name
    for name in ("first picture", "in a worker"):
        assert all(programs[name][f"{step}_ms"] >= 0 for step in ("process", "import", "first", "next")), name
    of_stages = {row["stage"]: row for row in record["rows"] if "stage" in row}
    expected = {"python", "numpy", "own modules", "read", "normals", "kernels", "draw", "encode", "write", "exit"}
    assert expected <= set(of_stages) <= {*stages.STAGES, "whole process"}
    whole = of_stages.pop("whole process")["warm_ms"]
    total = sum(row["warm_ms"] for row in of_stages.values())
    assert total <= whole, f"stages take {total:.0f} > {whole:.0f} ms of the whole process"
    assert all(row["cold_ms"] is None for row in of_stages.values())


def test_time_belongs_to_the_innermost_stage_of_the_main_thread(monkeypatch):
    ticks = iter(range(0, 100_000_000, 1_000_000))
    monkeypatch.setattr(stages, "monotonic_ns", lambda: next(ticks))
    clock = stages.Clock(-2_000_000)
    encode = clock.around(lambda: None, "encode")
    draw = clock.around(lambda n: [encode() for _ in range(n)], "draw")
    draw(2)
    with pytest.raises(ZeroDivisionError):
        clock.around(lambda: 1 / 0, "write")()
    thread = threading.Thread(target=draw, args=(3,))
    thread.start()
    thread.join()
    spent = {stage: n // 1_000_000 for stage, n in clock.nanoseconds.items() if n}
    assert spent == {"python": 3, "draw": 3, "encode": 2, "write": 1}


def test_tolerance(capsys):
    arguments = ["cube", "torus", "--size", "40x30", "--shadings", "gouraud", "--tolerances", "0", "1/256"]
    assert tolerance.main([*arguments, "--samples", "1", "4", *QUICK]) == 0
    rows = record_of(capsys, "tolerance")["rows"]
    assert len(rows) == 8
    for row in rows:
        assert row["rms"] <= row["max"] <= row["bound"] and row["of_bound"] == row["max"] / row["bound"], row
        assert 0 < row["vertices"] < 0.01 and row["ms"] > 0, row
        assert (row["of_first"] == 1.0) == (row["tolerance"] == "0"), row


def test_choices(capsys):
    assert choices.main(["cube", "table", "--size", "32x24", "--seconds", "2"]) == 0
    rows = record_of(capsys, "choices")["rows"]
    methods = [row for row in rows if row["what"] == "method"]
    assert {row["model"] for row in methods} == {"cube"} and {row["samples"] for row in methods} == {1, 4, 16}
    assert all(row["triangles"] == 12 * 4 ** row["subdivisions"] for row in methods)
    others = [row for row in rows if row["what"] != "method"]
    assert {row["what"] for row in others} == {"shadow map", "shadow filter", "antialias", "reflection"}
    pytest.importorskip("matplotlib")
    assert choices.plot(rows, ".svg").startswith(b"<?xml")


def test_results_are_kept_a_row_a_line(capsys, folder):
    arguments = ["cube", "--sizes", "32", "--levels", "6", "--threads", "1", "--rounds", "3", "--seconds", "0.01"]
    assert encode.main([*arguments, "--json", "results/encode.json"]) == 0
    record = record_of(capsys, "encode")
    text = (folder / "results" / "encode.json").read_text()
    assert json.loads(text) == record and "json" not in record["settings"]
    assert sum(line.startswith('  {"case"') for line in text.splitlines()) == len(record["rows"])


def test_plots_are_written_in_few_colours(folder):
    pytest.importorskip("matplotlib")
    rows = [{"feature": f"thing {k}", "ns_more": k - 1.0, "dtype": "float32"} for k in range(4)]
    measure.write_plot(folder / "plots" / "x.png", features.plot, rows)
    assert Image.open(folder / "plots" / "x.png").mode == "P"
    measure.write_plot(folder / "x.svg", features.plot, rows)
    assert (folder / "x.svg").read_bytes().startswith(b"<?xml")
    measure.write_plot(None, features.plot, rows)


@pytest.mark.parametrize("seed", [12, 21, 22])
def test_errors_are_not_measured_where_depth_cannot_tell_what_is_in_front(seed):
    """Squares that cross each other, drawn with coarse depth: along their edges the reference may show the other
    one."""
    rng, size, settings = np.random.default_rng(seed), (96, 72), {"shading": "flat", "samples": 4}
    square, meshes = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float), []
    for _ in range(12):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        meshes.append(rz.Mesh(square @ turn, [[0, 1, 2, 3]], material=rz.Material(diffuse=rng.random(3))))
    scene = rz.Scene(meshes, camera=rz.Camera.perspective((0, 0, 3), near=1e-4))
    expected = reference.render(scene, size, **settings)
    is_clear = margins.clear_pixels(scene, size, 4, lambda grid: reference.render(scene, grid, shading="flat"))
    frame = rz.render(scene, size, tolerance=0, outputs=("color", "face"), **{"samples": 1} | settings)
    row = tolerance.compare_with_reference(frame, expected, is_clear)
    assert row["max"] <= row["bound"], f"{row['max']:.3g} > {row['bound']:.3g}"
    assert row["other"] <= 0.05 * is_clear.size, f"{row['other']} pixels left out > 5 %"


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("name", ["sphere", "torus"])
def test_true_surface_is_what_the_mesh_approximates(name, samples):
    size = (48, 36)
    scene = scenes.build(name, size)
    assert true_surfaces.find_surface(scene) == name and true_surfaces.find_surface(scenes.build("cube", size)) is None
    truth = true_surfaces.draw(name, scene, size, samples)
    with rz.Renderer(scene, size, shading="phong", samples=samples, outputs=("color", "depth")) as renderer:
        drawn = renderer.render()
    assert np.abs(truth.alpha - drawn.alpha).mean() < 0.01
    with np.errstate(invalid="ignore"):  # inf - inf where nothing is
        is_near = (drawn.depth - truth.nearest < 0.3) & (truth.furthest - drawn.depth < 0.3)
    error = np.abs(drawn.color - truth.color)[(truth.alpha == 1) & (drawn.alpha > 1 - 1e-6) & is_near]
    assert 0 < root_mean_square(error) < 0.01 and error.max() < 0.2


@pytest.mark.parametrize(
    ("shape", "n_face"),
    [(scenes.icosphere(2), 320), (scenes.uv_sphere(6, 9), 90), (scenes.torus(5, 7), 70)],
)
def test_generated_shapes_are_closed_and_wound_outwards(shape, n_face):
    vertices, faces = shape
    assert vertices.dtype == np.float32 and faces.dtype == np.uint32 and len(faces) == n_face
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).tolist()
    assert len(set(map(tuple, edges))) == len(edges) and {(b, a) for a, b in edges} == set(map(tuple, edges))
    a, b, c = vertices[faces].astype(float).transpose(1, 0, 2)
    assert np.sum(a * np.cross(b, c)) > 0


def test_every_quad_of_a_stack_fills_the_picture():
    for name, nearest in (("quads-front", 0), ("quads-back", scenes.N_QUAD - 1)):
        scene = scenes.build(name, (40, 30))
        with rz.Renderer(scene, (40, 30), outputs=("face",)) as renderer:
            assert set(np.unique(renderer.render().face) // 2) == {nearest}


def test_calls_take_turns():
    order = []
    calls = {name: lambda name=name: order.append(name) for name in "ab"}
    times = take_turns(calls, 0.0, 25)
    assert order == list("ab") * LEAST_ROUNDS and len(times["a"][0]) == LEAST_ROUNDS


def test_throughput(capsys, tmp_path):
    kept = tmp_path / "throughput.json"
    arguments = ["--models", "2", "--workers", "1", "2", "--size", "16", "--rounds", "1", "--json", str(kept)]
    assert throughput.main(arguments) == 0
    rows = record_of(capsys, "throughput")["rows"]
    assert [row["processes"] for row in rows] == [1, 2] and rows[0]["gain"] == 1.0
    assert all(row["pictures"] == 8 and row["per_second"] > 0 for row in rows)
    assert json.loads(kept.read_text())["rows"] == rows
    assert table_rows.throughput(rows)[2].startswith("| 1 | ")
