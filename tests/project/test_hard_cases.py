"""The hard cases of bench/hard_scenes.py, in small: all are right."""

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
