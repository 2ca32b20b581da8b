"""bench/history.py: lines are added, compared with those of the same processor, and plotted."""

import io
import json

import pytest
from PIL import Image

from bench import history


def line(ratios, cpu="A", date="2026-01-01") -> dict:
    return {"date": date, "version": "0", "commit": "abc", "note": "", "machine": {"cpu": cpu}, "ratios": ratios}


def test_a_line_is_added(folder, capsys):
    name = "teapot Gouraud"
    arguments = ["--file", "h.jsonl", "--add", "--note", "first", "--cases", name, "--frames", "3", "--seconds", "0.1"]
    assert history.main(arguments) == 0
    (found,) = history.read_history(folder / "h.jsonl")
    assert found["note"] == "first" and set(found["ratios"]) == {name} and found["ratios"][name] > 0
    assert found["machine"]["cpu"] and len(found["date"]) == 10
    assert "to before" in capsys.readouterr().out
    assert history.main(["--file", "none.jsonl"]) == 0 and "no lines yet" in capsys.readouterr().out


def test_what_is_slower_is_named(folder, capsys):
    lines = [line({"a": 1.0, "b": 2.0}), line({"a": 9.0, "b": 9.0}, cpu="B"), line({"a": 1.2, "b": 1.9, "c": 3.0})]
    (folder / "h.jsonl").write_text("".join(json.dumps(each) + "\n" for each in lines))
    assert history.main(["--file", "h.jsonl"]) == 1
    out = capsys.readouterr().out
    assert "slower: a, 1.20 times the line before" in out and "slower: b" not in out
    (folder / "h.jsonl").write_text("".join(json.dumps(each) + "\n" for each in lines[:2]))
    assert history.main(["--file", "h.jsonl"]) == 0, "another processor says nothing"


def test_plot(folder):
    pytest.importorskip("matplotlib")
    lines = [line({"a": 1.0, "b": 2.0}), line({"a": 0.8})]
    assert Image.open(io.BytesIO(history.plot(lines, ".png"))).width > 800


def test_the_history_that_is_kept_can_be_read():
    lines = history.read_history(history.HISTORY)
    assert all(set(each["ratios"]) <= set(history.CASES) for each in lines)
