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
    row = {"case": "a", "why": "b.", "result": "right", "of_bound": 0.5, "path": "packed, exact"}
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


def test_scripts_take_the_arguments_of_every_run():
    for name, command in measure_all.list_runs("scan", "textured").items():
        for arguments in (command, measure_all.quickened(name, command)):
            parser = measure_all.parser_of(command[0])
            assert parser.parse_args([*arguments[1:], "--json", "x.json"]).json.name == "x.json"
