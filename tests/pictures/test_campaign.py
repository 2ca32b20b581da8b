"""Random scenes over every light, model, texture, layer, camera and unit keep every promise; see campaign.py."""

import os

import numpy as np
import pytest
from helpers.campaign import climb, find_faults, report
from helpers.campaign_scenes import make_case

SEED = 8
N_CASE = int(os.environ.get("RASTERIZER_FUZZ_CASES", 3000))
N_SHOWN = 12  # faults, at most
LEAST_SINGLE = 0.25  # share of the pictures that are lit in float32
N_CLIMB, N_STEP = 24, 80


def told(faults) -> str:
    """The first faults, in words."""
    return f"{len(faults)} scenes at fault\n" + "\n".join(faults[:N_SHOWN])


def test_random_scenes_keep_their_promises(capsys):
    """Each with its own tolerance, with tolerance 0, and by the reference."""
    faults, n_single, n_compared, n_step, worst = [], 0, 0, 0, 0.0
    for index in range(N_CASE):
        case = make_case(SEED, index)
        outcome = find_faults(case)
        n_single += outcome.dtype == np.float32
        n_compared, n_step = n_compared + outcome.n_compared, n_step + outcome.n_step
        worst = max(worst, outcome.ratio) if not outcome.faults else worst
        if outcome.faults:
            faults.append(report(case, outcome))
    with capsys.disabled():
        print(
            f"\n{N_CASE} scenes, {n_single} in float32; {n_compared} pixels, {n_step} next to a step; "
            f"error/bound <= {worst:.3g}"
        )
    assert not faults, told(faults)
    assert n_single >= LEAST_SINGLE * N_CASE, f"{n_single} of {N_CASE} pictures in float32 < {LEAST_SINGLE:.0%}"
    assert n_step <= 0.002 * n_compared, f"{n_step} of {n_compared} pixels left out, next to a step"


@pytest.mark.slow
def test_nobody_climbs_above_a_bound():
    """From the scenes whose errors come nearest to their bounds, numbers are changed a little, and what raises the
    error is kept."""
    heights = []
    for index in range(400):
        outcome = find_faults(make_case(SEED + 1, index))
        heights.append((min(outcome.ratio, 1.0), index) if outcome.dtype == np.float32 else (0.0, index))
    faults = []
    for _, index in sorted(heights, reverse=True)[:N_CLIMB]:
        case, outcome = climb(make_case(SEED + 1, index), N_STEP)
        if outcome.faults:
            faults.append(report(case, outcome, f" {index + 1} {N_STEP}"))
    assert not faults, told(faults)


def test_cases_are_what_their_numbers_say():
    """The same two numbers make the same picture, another index another one."""
    one, same, other = make_case(SEED, 5), make_case(SEED, 5), make_case(SEED, 6)
    assert one.words == same.words and one.options == same.options and one.scene.lights == same.scene.lights
    assert (one.scene.meshes[0].vertices == same.scene.meshes[0].vertices).all()
    assert one.words != other.words
