"""The tables of the pages are what bench/results/ say."""

import json
from importlib import import_module

import pytest
from faults.faults import FAULTS
from helpers.campaign_scenes import DEFAULT_RUN
from helpers.raster import ROOT

from bench import measure, measure_all, tables


def test_the_pages_say_what_was_measured():
    for path in tables.PAGES:
        page = path.read_text(encoding="utf-8")
        assert len(tables.MARKED.findall(page)) == page.count("<!-- results/") == page.count("<!-- end -->") > 0, path
        wrong = tables.wrong_tables(page)
        assert not wrong, f"{path}: {wrong} differ from bench/results; python bench/tables.py writes them"


def test_every_table_is_shown_and_every_result_is_measured():
    """Results that no table shows are those that a sentence refers to."""
    text = "".join(path.read_text(encoding="utf-8") for path in tables.PAGES)
    shown = list(tables.MARKED.finditer(text))
    assert {found[3] for found in shown} == {*tables.TABLES, tables.MACHINE}
    names = {path.stem for path in tables.RESULTS.glob("*.json")}
    assert names == set(measure_all.list_runs("scan", "textured"))
    untold = [name for name in names - {found[2] for found in shown} if f"results/{name}.json`" not in text]
    assert not untold, f"no page tells of {untold}"


def test_results_tell_their_machine_and_no_folders():
    for path in tables.RESULTS.glob("*.json"):
        record = json.loads(path.read_text(encoding="utf-8"))
        assert path.stem.startswith(record["bench"]) and record["rows"], path.name
        assert {"cpu", "cores", "python", "numba", "load"} <= set(record["machine"]), path.name
        assert measure.without_folders(record) == record, path.name


def column(name, key="ratio", **wanted) -> list[float]:
    """A column of those rows of a result that have it, and these values."""
    rows = [row for row in tables.load(name)["rows"] if key in row]
    return [row[key] for row in rows if all(row.get(field) == value for field, value in wanted.items())]


def sentences():
    """What pages repeat in words of the results, and of the tests: where, and how it must read."""
    guide, bench, front = "rasterizer/README.md", "bench/README.md", "README.md"
    for path, scene, text in (
        ("packed entries", "dense", "Without it a fine sphere takes {:.1f} times as long"),
        ("planes", "scan", "With exact records alone a scan takes {:.1f} times as long"),
        ("boxes filled whole", "scan", "Without that a scan takes {:.1f} times as long"),
    ):
        yield guide, text.format(*column("paths", path=path, scene=scene))
    found = column("paths", path="float32")
    yield guide, f"Without it frames take {min(found):.1f} to {max(found):.1f} times as long"
    yield guide, "draw {:.2f} times as fast as one".format(*column("throughput", "gain", processes=2))
    (found,) = column("startup", "yards", program="first picture")
    yield guide, f"takes {found:.2f} of the time of `import numba`"
    found = column("frame", "ms_1", case="stanford-bunny")
    fast = min(column("frame", "ms_2", case="stanford-bunny"))
    yield front, f"takes {fast:.0f} to {max(found):.0f} ms at 1920×1080"
    found = column("peers", peer="llvmpipe")
    yield front, f"llvmpipe takes {min(found):.1f} to {max(found):.1f} times as long"
    found = [row["ratio_of_cpu"] for row in tables.load("peers")["rows"] if row.get("speck", "plain") != "plain"]
    yield guide, f"costs at most {100.0 * max(found) - 100.0:.0f} %"
    found = [100.0 * saved for saved in column("tolerance_modes", "saved", tolerance="1/4096")]
    yield bench, f"would save {min(found):.0f} to {max(found):.0f} % of the time at most"
    yield "tests/README.md", f"{len(FAULTS)} small faults"
    yield "tests/README.md", f"{DEFAULT_RUN} scenes of the campaign"


def test_sentences_repeat_what_was_measured_and_counted():
    for page, text in sentences():
        said = " ".join((ROOT / page).read_text(encoding="utf-8").split())
        assert text in said, f"{page} doesn't say {text!r}, as the results do"


@pytest.fixture
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(tables, "PAGES", (tmp_path / "README.md",))
    return tmp_path


MACHINE = {"cpu": "C", "cores": 2, "python": "3", "numpy": "2", "numba": "0", "load": 0.0, "others": 0.0}


def test_what_is_kept_comes_into_the_page(own_folder, capsys):
    row = {"case": "a", "why": "b.", "result": "right", "of_bound": 0.5, "path": "entries, exact"}
    record = {"bench": "hard_cases", "machine": MACHINE, "settings": {"model": "/a/b/scan.obj"}, "rows": [row]}
    measure.keep(record, tables.RESULTS / "hard_cases.json")
    assert tables.load("hard_cases") == record | {"settings": {"model": "scan.obj"}}
    (page,) = tables.PAGES
    page.write_text("x\n<!-- results/hard_cases.json: hard cases -->\nold\n<!-- end -->\ny\n")
    assert tables.main(["--check"]) == 1 and "hard cases is not what" in capsys.readouterr().out
    assert tables.main([]) == 0 and tables.main(["--check"]) == 0
    text = page.read_text()
    assert "| right | 1 | 1 | 0 | 1 | 0.50 |" in text and "old" not in text and "on 2 cores of C" in text
    assert "Other work" not in text and "Other work took 30 %" in tables.said_of(MACHINE | {"others": 0.3})


def test_figures_have_two_digits():
    for value, text in (
        (0.0, "0"), (None, ""), (2.3e-4, "2.3·10⁻⁴"), (3e-8, "3.0·10⁻⁸"), (0.0996, "0.10"), (9.96, "10"), (99.6, "100"),
    ):  # fmt: skip
        assert tables.figure(value) == text


def test_figures_are_the_nearest_with_their_digits():
    for k in range(-30, 31):
        for digits in (1.0, 1.25, 3.14159, 9.949, 9.96, 9.996):
            text = tables.figure(digits * 10.0**k, 3)
            number, _, power = text.partition("·10")
            power = int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))) if power else 0
            assert float(number) * 10.0**power == pytest.approx(digits * 10.0**k, rel=0.005), text


def test_tables_of_rows():
    peer = {"case": "c", "triangles": 69451, "peer": "p", "ms_ours": 1.0, "ms_peer": 2.5, "ratio": 2.5,
            "ratio_of_cpu": 2.0}  # fmt: skip
    assert tables.peers([peer, {"speck": "x"}])[2:] == ["| `c` | 69 451 | p | 1.00 | 2.50 | 2.5 | 2.0 |"]
    speck = {"speck": "toon", "shading": "phong", "ratio_of_cpu": 1.02}
    assert tables.specks([peer, speck]) == ["|  | toon |", "| --- | --- |", "| Gouraud |  |", "| Phong | 1.02 |"]
    feature = {"feature": "plain", "ms": 2.0, "dtype": "float32"}
    more = [{"feature": str(k), "ms": 3.0, "ns_more": 4.0, "dtype": "float64"} for k in range(2)]
    assert tables.features([feature, *more])[2:] == [
        "| plain | 1.0 |  | 1, float64 | 1.5 | 4.0 |", "| 0, float64 | 1.5 | 4.0 |  |  |  |",
    ]  # fmt: skip


def test_methods_and_tolerances_stand_side_by_side():
    row = {"what": "method", "model": "m", "shading": "phong", "subdivisions": 0, "triangles": 8, "delta_e": 0.1}
    rows = [row | {"samples": n, "value": f"Phong, {n} samples", "ms": n, "rms": 1 / n} for n in (1, 4)]
    assert tables.methods(rows) == [
        "| method | m, 8 triangles |",
        "| --- | --- |",
        "| Phong | 4.00 · 0.25 · 0.10 |",
    ]
    assert tables.samples(rows)[2:] == ["| m | 4.0 · 0.25 |"]
    row = {"model": "m", "shading": "flat", "ms": 2.0, "max": 0.5, "of_bound": 0.1, "vertices": 0.0}
    rows = [row | {"tolerance": name, "of_first": ratio} for name, ratio in (("0", 1.0), ("1/64", 0.5))]
    assert tables.tolerances(rows)[2:] == ["| m | flat | 2.00 | 0.50 | 0.50 · 0.50 · 0.10 | 0 |"]


def test_a_finer_mesh_is_compared_with_a_coarser_one():
    rows = [{"surface": surface, "shading": shading, "triangles": n, "ms": ms, "rms": rms}
            for surface in ("sphere", "torus")
            for shading, n, ms, rms in (("phong", 8, 2.0, 0.1), ("gouraud", 32, 3.0, 0.05), ("gouraud", 8, 1.0, 0.2),
                                        ("phong", 32, 9.0, 0.01))]  # fmt: skip
    assert tables.finer(rows)[2:] == ["| 32 / 8 | 1.5 · 0.50 | 1.5 · 0.50 |"]


def test_growth_has_both_ends_and_the_slope():
    point = {"axis": "lights", "build_ms": 1.0, "prepare_ms": 2.0, "cpu_ms": 3.0, "mib": 4.0}
    slopes = dict.fromkeys(("build_ms", "prepare_ms", "mib")) | {"cpu_ms": 0.9}
    rows = [point | {"n": 1}, point | {"n": 10, "cpu_ms": 30.0}, {"axis": "lights", "slopes": slopes}]
    assert tables.growth(rows)[2:] == ["| lights | 1, 10 | 1.0, 1.0 | 2.0, 2.0 | 3.0, 30 · 0.90 | 4.0, 4.0 |"]


def test_a_quick_run_measures_less():
    command = ["x.py", "--seconds", "15", "--runs", "11", "model"]
    assert measure_all.quickened(command) == ["x.py", "--seconds", "3", "--runs", "3", "model"]


def test_scripts_take_the_arguments_of_every_run():
    for name, (script, *arguments) in measure_all.list_runs("scan", "textured").items():
        parser = import_module(f"bench.{script.removesuffix('.py')}").make_parser()
        assert parser.parse_args([*arguments, "--json", "x.json"]).json.name == "x.json"
        parser.parse_args(measure_all.quickened(arguments))
        if name in measure_all.PLOTTED:
            assert parser.parse_args([*arguments, "--plot", "x.png"]).plot.name == "x.png"
