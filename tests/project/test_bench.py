"""The scripts of bench/ run, and their last line is JSON with what they promise. All but one of them run at night."""

import json
import shlex
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import pytest
from helpers.raster import ROOT

import rasterizer as rz
from bench import fuzz, peers

QUICK = ["--frames", "3", "--seconds", "0.01"]
PAIR = [*QUICK, "--pairs", "1", "--threads", "1"]
# Each script with arguments that are little work, and how many rows it prints.
RUNS = [
    ("frame", "cube quads-back --sizes 32 --threads 1 --shadings gouraud phong --stages", QUICK, 4),
    ("before_after", f"{ROOT} cube --size 32", PAIR, 4),
    ("paths", "'one channel' --scan cube --scenes scan,quads", PAIR, 2),
    ("features", "--model cube --size 40", QUICK, 30),
    ("encode", "cube --sizes 32 --levels 1 6 --rounds 3 --seconds 0.01", [], 6),
    ("throughput", "--models 2 --workers 1 2 --size 16 --rounds 1", [], 2),
    ("scale", "lights objects --most 4 --seconds 0.01", [], 5),
    ("scale", "--many 20", [], 10),
    ("startup", "models/cube.obj --size 32x24 --runs 1 --cold 0", [], 7),
    ("whole", "--models layers --runs 1", [], 1),
    ("tolerance", "cube --size 40x30 --shadings gouraud --tolerances 0 1/256", QUICK, 3),
    ("choices", "cube --size 32x24 --seconds 2", [], 30),
    ("refinement", "plane --quads 4 8 --finest 16 --size 64 --seconds 0.1", [], 6),
    ("hard_cases", "--small --only slivers", [], 1),
    ("peers", "--cases specks --model torus --size 96x72", PAIR, 10),
]


def rows_of(capsys, name: str, arguments: list[str]) -> list[dict]:
    """Run a script; return the rows of the JSON line that it has printed last."""
    assert import_module(f"bench.{name}").main(arguments) == 0
    record = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert set(record) == {"bench", "machine", "code", "settings", "rows"} and record["bench"] == name
    assert record["machine"]["rasterizer"] == rz.__version__
    return record["rows"]


@pytest.mark.parametrize("k", [pytest.param(k, marks=[pytest.mark.nightly] if k else []) for k in range(len(RUNS))])
def test_a_script_prints_what_it_has_measured(k, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    name, arguments, more, least = RUNS[k]
    rows = rows_of(capsys, name, [*shlex.split(arguments), *more])
    assert len(rows) >= least, f"{name} {arguments}: {len(rows)} rows < {least}"
    times = [value for row in rows for key, value in row.items() if "ms" in key.split("_") and value is not None]
    assert not [time for time in times if time < 0] and (times or name != "frame")
    assert all(row["max"] <= row["bound"] for row in rows if "bound" in row and "max" in row)
    assert {row["bytes"] for row in rows if name == "before_after"} <= {"same"}


@pytest.mark.nightly
def test_errors_fall_as_theory_says(capsys):
    arguments = "'teapot patch' --quads 32 64 --finest 512 --size 160 --seconds 0.1"
    rows = {(row["shading"], row["quads"]): row for row in rows_of(capsys, "refinement", shlex.split(arguments))}
    for shading, power in (("flat", 1), ("gouraud", 2), ("phong", 2)):
        slope = np.log2(rows[shading, 32]["rms"] / rows[shading, 64]["rms"])
        assert slope == pytest.approx(power, abs=0.1), f"{shading}: {slope}"


@pytest.mark.nightly
def test_fuzz_goes_on_where_it_was_ended(folder, capsys):
    few = ["--cases", "6", "--batch", "2", "--climbs", "1", "--steps", "2", "--processes", "1"]
    assert fuzz.main([*few, "--cases", "2"]) == 0 == fuzz.main(few)
    lines = (folder / "fuzz.jsonl").read_text().split("\n")
    found = [(json.loads(line)["first"], json.loads(line)["stop"]) for line in lines if line]
    assert found == [(0, 2), (2, 4), (4, 6)]
    (folder / "fuzz.jsonl").write_text("\n".join(lines)[:-30])  # it was ended while writing
    capsys.readouterr()
    assert fuzz.main(few) == 0
    out = capsys.readouterr().out
    assert out.count("[") == 1 and "[3/3] 2 scenes up to number 5" in out and "6 scenes" in out and "0 faults" in out
    assert fuzz.main(["--report"]) == 0 and "6 scenes" in capsys.readouterr().out


# ---------------------------------------------------------------- other renderers


@pytest.mark.nightly
@pytest.mark.skipif(not find_spec("moderngl"), reason="moderngl is not installed")
def test_a_peer_draws_the_same(tmp_path, capsys):
    """Textured and plain, by Gouraud's and Phong's shading: the same pixels, the same colours; else the exit is 1."""
    arguments = ["--cases", *peers.CASES, "--model", "torus", "--size", "480x360", *PAIR, "--save", str(tmp_path)]
    code = peers.main(arguments)
    out = capsys.readouterr().out
    if code and "can't draw it" in out:
        pytest.skip(out.splitlines()[-1])
    assert code == 0 and len(list(tmp_path.glob("*.png"))) == len(peers.CASES), out
