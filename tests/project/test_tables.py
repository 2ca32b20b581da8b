"""What is measured is kept, comes into the pages, and is told to be old where the code has changed."""

import pytest

from bench import measure, measure_all, tables


def test_every_table_is_shown_and_every_result_is_measured():
    """Results that no table shows are those that a sentence refers to."""
    shown = [found for path in tables.PAGES for found in tables.MARKED.finditer(path.read_text(encoding="utf-8"))]
    assert {found[3] for found in shown} == {*tables.TABLES, tables.MACHINE}
    names = {path.stem for path in tables.RESULTS.glob("*.json")}
    assert names == set(measure_all.list_runs("scan", "textured")) == {found[2] for found in shown}


@pytest.fixture
def own_folder(tmp_path, monkeypatch):
    """A page and results of their own; the page says a figure in a sentence."""
    monkeypatch.setattr(tables, "ROOT", tmp_path)
    monkeypatch.setattr(tables, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(tables, "PAGES", (tmp_path / "README.md",))
    sentence = ("README.md", "{} cases hold, the worst by {}", lambda: ["1", "0.50"])
    monkeypatch.setattr(tables, "SENTENCES", (sentence,))
    return tmp_path


MACHINE = {"cpu": "C", "cores": 2, "python": "3", "numpy": "2", "numba": "0", "rasterizer": "9.8", "others": 0.0}


def test_what_is_kept_comes_into_the_page(own_folder, capsys):
    row = {"case": "a", "why": "b.", "result": "right", "of_bound": 0.5, "path": "entries, exact"}
    record = {"bench": "hard_cases", "machine": MACHINE, "settings": {"model": "/a/b/scan.obj"}, "rows": [row]}
    for name in ("hard_cases", tables.USUAL):
        measure.keep(record | {"code": measure.code_hash()}, tables.RESULTS / f"{name}.json")
    assert tables.load("hard_cases")["settings"] == {"model": "scan.obj"}
    (page,) = tables.PAGES
    page.write_text(
        "7 cases\nhold, the worst by 0.9.\n<!-- results/hard_cases.json: hard cases -->\nold\n<!-- end -->\n"
    )
    assert tables.main(["--check"]) == 1
    out = capsys.readouterr().out
    assert "'hard cases'" in out and "1, 0.50" in out and "older" not in out
    assert tables.main([]) == 0 and tables.main(["--check"]) == 0
    text = page.read_text()
    assert "| right | 1 | 1 | 0 | 1 | 0.50 |" in text and "old" not in text.replace("hold", "")
    assert text.startswith("1 cases\nhold, the worst by 0.50.\n")
    page.write_text(text.replace("hold", "held"))
    assert tables.main([]) == 1 and "doesn't say" in capsys.readouterr().out
    assert "Other work took 30 %" in tables.said_of(MACHINE | {"others": 0.3})


def test_a_result_of_other_code_is_named_with_what_measures_it(own_folder, capsys):
    """That is no fault: between two releases most of them are old."""
    for name, code in (("frame", {"code": measure.code_hash()}), ("scale", {"code": "0123"}), ("whole", {})):
        measure.keep({"machine": MACHINE, "rows": []} | code, tables.RESULTS / f"{name}.json")
    (own_folder / "README.md").write_text("1 cases hold, the worst by 0.50")
    assert tables.main(["--check"]) == 0
    out = capsys.readouterr().out
    assert "measure_all.py --only scale whole" in out and "version 9.8" in out


def test_the_hash_is_that_of_the_packages_code(tmp_path, monkeypatch):
    monkeypatch.setattr(measure, "ROOT", tmp_path)
    (tmp_path / "rasterizer").mkdir()
    found = [measure.code_hash()]
    for name, text in (("a.py", "x = 1"), ("a.py", "x = 2"), ("b.py", ""), ("README.md", "z")):
        (tmp_path / "rasterizer" / name).write_text(text)
        found.append(measure.code_hash())
    assert len(set(found[:4])) == 4 and found[4] == found[3], "a page is no code"


def test_figures_are_the_nearest_with_their_digits():
    for value, text in (
        (0.0, "0"), (None, ""), (2.3e-4, "2.3·10⁻⁴"), (3e-8, "3.0·10⁻⁸"), (0.0996, "0.10"), (9.96, "10"), (99.6, "100"),
    ):  # fmt: skip
        assert tables.figure(value) == text
    for k in range(-30, 31):
        for digits in (1.0, 1.25, 3.14159, 9.949, 9.96, 9.996):
            text = tables.figure(digits * 10.0**k, 3)
            number, _, power = text.partition("·10")
            power = int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))) if power else 0
            assert float(number) * 10.0**power == pytest.approx(digits * 10.0**k, rel=0.005), text


def test_tables_of_rows():
    peer = {"case": "c", "triangles": 69451, "peer": "p", "ms_ours": 1.0, "ms_peer": 2.5, "ratio": 2.5,
            "ratio_of_cpu": 2.0}  # fmt: skip
    assert tables.TABLES["peers"]([peer, {"speck": "x"}])[2:] == ["| `c` | 69 451 | p | 1.00 | 2.50 | 2.5 | 2.0 |"]
    speck = {"speck": "toon", "shading": "phong", "ratio_of_cpu": 1.02}
    assert tables.specks([peer, speck]) == ["|  | toon |", "| --- | --- |", "| Phong | 1.02 |"]
    feature = {"feature": "plain", "ms": 2.0, "dtype": "float32"}
    more = [{"feature": str(k), "ms": 3.0, "ns_more": 4.0, "dtype": "float64"} for k in range(2)]
    assert tables.features([feature, *more])[2:] == [
        "| plain | 1.0 |  | 1, float64 | 1.5 | 4.0 |", "| 0, float64 | 1.5 | 4.0 |  |  |  |",
    ]  # fmt: skip
    row = {"what": "method", "model": "m", "shading": "phong", "subdivisions": 0, "triangles": 8, "delta_e": 0.1}
    rows = [row | {"samples": n, "value": f"Phong, {n} samples", "ms": n, "rms": 1 / n} for n in (1, 4)]
    assert tables.methods(rows)[::2] == ["| method | m, 8 triangles |", "| Phong | 4.00 · 0.25 · 0.10 |"]
    assert tables.samples(rows)[2:] == ["| m | 4.0 · 0.25 |"]
    row = {"model": "m", "shading": "flat", "ms": 2.0, "max": 0.5, "of_bound": 0.1, "vertices": 0.0}
    rows = [row | {"tolerance": name, "of_first": ratio} for name, ratio in (("0", 1.0), ("1/64", 0.5))]
    assert tables.tolerances(rows)[2:] == ["| m | flat | 2.00 | 0.50 | 0.50 · 0.50 · 0.10 | 0 |"]
    rows = [{"surface": surface, "shading": shading, "triangles": n, "ms": ms, "rms": rms}
            for surface in ("sphere", "torus")
            for shading, n, ms, rms in (("phong", 8, 2.0, 0.1), ("gouraud", 32, 3.0, 0.05), ("gouraud", 8, 1.0, 0.2),
                                        ("phong", 32, 9.0, 0.01))]  # fmt: skip
    assert tables.finer(rows)[2:] == ["| 32 / 8 | 1.5 · 0.50 | 1.5 · 0.50 |"]
    point = {"axis": "lights", "build_ms": 1.0, "prepare_ms": 2.0, "cpu_ms": 3.0, "mib": 4.0}
    slopes = dict.fromkeys(("build_ms", "prepare_ms", "mib")) | {"cpu_ms": 0.9}
    rows = [point | {"n": 1}, point | {"n": 10, "cpu_ms": 30.0}, {"axis": "lights", "slopes": slopes}]
    assert tables.growth(rows)[2:] == ["| lights | 1, 10 | 1.0, 1.0 | 2.0, 2.0 | 3.0, 30 · 0.90 | 4.0, 4.0 |"]


def test_scripts_take_the_arguments_of_every_run():
    for name, command in measure_all.list_runs("scan", "textured").items():
        for arguments in (command, measure_all.quickened(name, command)):
            parser = measure_all.parser_of(command[0])
            assert parser.parse_args([*arguments[1:], "--json", "x.json"]).json.name == "x.json"
