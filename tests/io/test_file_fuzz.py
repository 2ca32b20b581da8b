"""The fuzz of files: thousands of damaged and generated files, in two processes of their own whose memory and time are
capped."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.fuzz_cases import MAKERS, make_case

TESTS = Path(__file__).parents[1]
COUNT = 10_000  # of cases in each of two processes


def run(*argv):
    command = [sys.executable, "-m", "helpers.file_fuzz", *map(str, argv)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=TESTS)


@pytest.mark.slow
def test_any_file_is_drawn_or_refused_by_an_error_that_names_it():
    processes = [run(COUNT * k, COUNT) for k in range(2)]
    total = {"drawn": 0, "empty": 0, "refused": 0, "faults": 0}
    for process in processes:
        out, err = process.communicate(timeout=900)
        assert process.returncode == 0 and err == "", f"exit {process.returncode}, {err[-2000:]}\n{out[-4000:]}"
        counts = json.loads(out.splitlines()[-1])
        total = {key: total[key] + counts[key] for key in total}
    assert sum(total.values()) == 2 * COUNT and total["faults"] == 0
    # Most damage is noticed; a fuzz whose files were all refused, or all empty, would test nothing.
    assert total["drawn"] > 2 * COUNT // 10 and total["empty"] < total["drawn"] // 20, total


def test_cases_are_the_same_whenever_their_seed_is(pass_days):
    cases = [make_case(np.random.default_rng(seed)) for seed in range(200)]
    pass_days(100)
    different = [seed for seed in range(200) if make_case(np.random.default_rng(seed)) != cases[seed]]
    assert not different, f"seeds {different}"
    assert len({name for name, _ in cases}) == 9
    assert len(MAKERS) == 17
