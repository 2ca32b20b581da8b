"""The tables of bench/README.md are what bench/results/ say."""

import io
import json

import pytest

from bench import tables


def test_the_page_says_what_was_measured():
    page = tables.PAGE.read_text(encoding="utf-8")
    assert len(tables.MARKED.findall(page)) == page.count("<!-- results/") > 0
    assert not tables.wrong_tables(page), "python bench/tables.py writes them"


def test_results_tell_their_machine_and_no_folders():
    for path in tables.RESULTS.glob("*.json"):
        record = json.loads(path.read_text(encoding="utf-8"))
        assert record["bench"] == path.stem and record["rows"]
        assert {"cpu", "cores", "python", "numba", "load"} <= set(record["machine"]), path.name
        assert tables.without_folders(record) == record, path.name


@pytest.fixture
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(tables, "PAGE", tmp_path / "README.md")
    return tmp_path


MACHINE = {"cpu": "C", "cores": 2, "python": "3", "numpy": "2", "numba": "0", "load": 0.0}


def test_what_is_kept_comes_into_the_page(own_folder, monkeypatch, capsys):
    row = {"case": "a", "why": "b.", "error": 1e-3, "bound": 2e-3}
    record = {"bench": "hard_cases", "machine": MACHINE, "settings": {"model": "/a/b/scan.obj"}, "rows": [row]}
    monkeypatch.setattr("sys.stdin", io.StringIO("a table\n" + json.dumps(record) + "\n"))
    assert tables.main(["--keep", "-"]) == 0
    assert tables.load("hard_cases")["settings"]["model"] == "scan.obj"
    tables.PAGE.write_text("x\n<!-- results/hard_cases.json: hard cases -->\nold\n<!-- end -->\ny\n")
    assert tables.main(["--check"]) == 1 and "hard cases is not what" in capsys.readouterr().out
    assert tables.main([]) == 0 and tables.main(["--check"]) == 0
    page = tables.PAGE.read_text()
    assert "| a | b. | 1.0e-03 | 2.0e-03 |" in page and "old" not in page and "on 2 cores of C" in page


def test_tables_of_rows():
    row = {"triangles": 8, "rms": 0.1, "slope": 1.5, "silhouette_slope": 2.0}
    rows = [
        row | {"surface": surface, "shading": shading} for surface in ("sphere", "torus") for shading in tables.SHADINGS
    ]
    assert tables.slopes(rows)[2] == "| flat | 1 | 1.50 | 1.50 |"
    peer = {
        "case": "c",
        "triangles": 69451,
        "peer": "p",
        "ms_ours": 1.0,
        "ms_peer": 2.5,
        "ratio": 2.5,
        "ratio_of_cpu": 2.0,
    }
    assert tables.peers([peer, {"speck": "x"}])[2:] == ["| `c` | 69 451 | p | 1.00 | 2.50 | 2.5 | 2.0 |"]
    speck = {"speck": "toon", "shading": "phong", "ratio_of_cpu": 1.02}
    assert tables.specks([peer, speck])[2:] == ["| toon |  | 1.02 |"]
