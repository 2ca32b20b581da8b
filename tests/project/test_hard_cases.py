"""The hard cases of bench/hard_scenes.py, in small: all are right."""

import numpy as np
import pytest

import rasterizer as rz
from bench import hard_cases, hard_limits, hard_scenes


@pytest.mark.parametrize("case", hard_limits.CASES, ids=lambda case: case.name)
def test_hard_case(case):
    row, frame = hard_cases.measure_case(case, is_small=True)
    assert not row["faults"], row
    if frame is None:
        assert row["result"] == "refused"
        return
    assert not row.get("is_at_step") or row["steps"], "an error above its bound has a step to blame"
    assert (frame.stats.coverage > 0) and case.why.endswith(".")
    if case.is_shown:
        assert frame.rgb.any(), "its picture shows something"


def test_cases_have_names_of_their_own():
    names = [case.name for case in hard_limits.CASES]
    assert len(set(names)) == len(names) and len({hard_cases.slug(name) for name in names}) == len(names)


def test_a_wrong_picture_is_a_fault():
    """The comparison would see another face, a colour beyond its bound, a depth that is off."""
    made = hard_scenes.inside_out(True)
    for change in ("face", "color", "depth"):
        frame, exact = hard_cases.draw(made), hard_cases.draw(made, tolerance=0.0)
        y, x = np.argwhere(frame.face >= 0)[40]
        frame.array(change)[y, x] += 1
        faults = []
        hard_cases.compare(made, frame, exact, faults)
        assert len(faults) == 1, (change, faults)


def test_the_command_line(capsys):
    assert hard_cases.main(["--small", "--only", "slivers"]) == 0
    out = capsys.readouterr().out
    assert "slivers of 1/256 px by 8000 px" in out and rz.__version__ in out.splitlines()[-1]
