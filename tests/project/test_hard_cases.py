"""The hard cases of bench/hard_scenes.py, in small: all are right."""

import numpy as np

import rasterizer as rz
from bench import hard_cases, hard_scenes


def check(case) -> list[str]:
    """Draw a case in small; return what is wrong with it."""
    row, frame = hard_cases.measure_case(case, is_small=True)
    faults = [f"{case.name}: {fault}" for fault in row["faults"]]
    if frame is None:
        return faults if row["result"] == "refused" else [*faults, f"{case.name}: {row['result']}"]
    if row.get("is_at_step") and not row["steps"]:
        faults.append(f"{case.name}: its error is above its bound, and there is no step to blame")
    if not frame.stats.coverage or (case.is_shown and not frame.rgb.any()):
        faults.append(f"{case.name}: its picture shows nothing")
    return faults


def test_hard_cases_are_right():
    """Each has a name of its own."""
    faults = [fault for case in hard_scenes.CASES for fault in check(case)]
    assert not faults, "; ".join(faults)
    assert len({hard_cases.slug(case.name) for case in hard_scenes.CASES}) == len(hard_scenes.CASES)


def test_a_wrong_picture_is_a_fault():
    """The comparison would see another face, a colour beyond its bound, a depth that is off."""
    made = hard_scenes.inside_out(True)
    for change in ("face", "color", "depth"):
        frame, exact = hard_cases.draw(made), hard_cases.draw(made, tolerance=0.0)
        y, x = np.argwhere(frame.face >= 0)[40]
        frame.array(change)[y, x] += 1
        faults = []
        hard_cases.compare(made, frame, exact, faults, hard_cases.reference_picture(made))
        assert len(faults) == 1, (change, faults)


def test_the_command_line(capsys):
    assert hard_cases.main(["--small", "--only", "slivers"]) == 0
    out = capsys.readouterr().out
    assert "slivers of 1/256 px by 8000 px" in out and rz.__version__ in out.splitlines()[-1]
