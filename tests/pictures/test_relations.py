"""Random scenes with everything together, told in other ways, have the pictures that they must; see relations.py."""

import os

import pytest
from helpers.relations import find_faults, is_small, make_full_case, report

SEED = 26
N_CASE = int(os.environ.get("RASTERIZER_FUZZ_CASES", 200))
NIGHTLY = 5000
N_RELATION = 4  # of each scene, by turns
N_SHOWN = 12  # faults, at most


def check_cases(indices) -> None:
    """Draw scenes in other ways."""
    told = []
    for index in indices:
        case = make_full_case(SEED, index)
        faults = find_faults(case, N_RELATION) if is_small(case) else []
        told += [report(case, faults)] if faults else []
    assert not told, f"{len(told)} scenes at fault\n" + "\n".join(told[:N_SHOWN])


def test_random_scenes_look_the_same_however_they_are_told():
    check_cases(range(N_CASE))


@pytest.mark.nightly
def test_many_more_random_scenes_look_the_same():
    check_cases(range(N_CASE, NIGHTLY))
