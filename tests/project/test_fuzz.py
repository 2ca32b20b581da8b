"""bench/fuzz.py: batches are kept, the rest goes on, and faults are told."""

import json

import pytest

from bench import fuzz

FEW = ["--cases", "6", "--batch", "2", "--climbs", "1", "--steps", "2", "--processes", "1"]


def test_it_goes_on_where_it_was_ended(folder, capsys):
    assert fuzz.main([*FEW, "--cases", "2"]) == 0
    assert fuzz.main(FEW) == 0
    lines = (folder / "fuzz.jsonl").read_text().splitlines()
    assert [(json.loads(line)["first"], json.loads(line)["stop"]) for line in lines] == [(0, 2), (2, 4), (4, 6)]
    (folder / "fuzz.jsonl").write_text("\n".join([*lines[:2], lines[2][:30]]))  # it was ended while writing
    capsys.readouterr()
    assert fuzz.main(FEW) == 0
    out = capsys.readouterr().out
    assert out.count("[") == 1 and "[3/3] scenes 4 to 5" in out and "6 scenes, " in out and "0 faults" in out
    capsys.readouterr()
    assert fuzz.main(FEW) == 0
    assert "[" not in capsys.readouterr().out, "all is done"


def test_another_seed_begins_anew(folder, capsys):
    assert fuzz.main([*FEW, "--cases", "2"]) == 0
    capsys.readouterr()
    assert fuzz.main([*FEW, "--cases", "2", "--seed", "5", "--report"]) == 0
    assert "nothing is done yet" in capsys.readouterr().out


def test_faults_are_told_and_kept(folder, capsys, monkeypatch):
    import helpers.campaign

    real = helpers.campaign.find_faults

    def find_faults(case):
        outcome = real(case)
        return outcome._replace(faults=["it is green"]) if case.index == 1 else outcome

    monkeypatch.setattr(helpers.campaign, "find_faults", find_faults)
    assert fuzz.main([*FEW, "--cases", "2", "--climbs", "0"]) == 1
    assert fuzz.main([*FEW, "--report"]) == 1
    out = capsys.readouterr().out
    assert "it is green" in out and "python -m helpers.campaign 1 1" in out and "1 faults" in out


@pytest.mark.slow
def test_processes_find_the_same(folder):
    fuzz.main([*FEW, "--state", "one.jsonl"])
    fuzz.main([*FEW, "--state", "two.jsonl", "--processes", "2"])
    one, two = (
        [{**json.loads(line), "seconds": 0} for line in (folder / name).read_text().splitlines()]
        for name in ("one.jsonl", "two.jsonl")
    )
    assert one == two
