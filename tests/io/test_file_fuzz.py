"""The fuzz of files: damaged and generated files, in processes of their own whose memory and time are capped."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]


def assert_good(*seeds: range):
    """Run cases, a process for each range of seeds: any file is drawn, or refused by an error that names it."""
    command = [sys.executable, "-m", "helpers.file_fuzz"]
    processes = [
        subprocess.Popen([*command, str(each.start), str(len(each))], stdout=-1, stderr=-1, text=True, cwd=TESTS)
        for each in seeds
    ]
    total = {"drawn": 0, "empty": 0, "refused": 0, "faults": 0}
    for process in processes:
        out, err = process.communicate(timeout=900)
        assert process.returncode == 0 and err == "", f"{out[-4000:]}\nexit {process.returncode}, {err[-2000:]}"
        counts = json.loads(out.splitlines()[-1])
        total = {key: total[key] + counts[key] for key in total}
    n = sum(map(len, seeds))
    assert sum(total.values()) == n, f"{total}: {sum(total.values())} != {n}"
    assert total["faults"] == 0, total
    # Most damage is noticed; a fuzz whose files were all refused, or all empty, would test nothing.
    assert total["drawn"] > n // 10 and total["empty"] < total["drawn"] // 10, total


def test_any_file_is_drawn_or_refused_by_an_error_that_names_it():
    assert_good(range(1000))


@pytest.mark.nightly
def test_any_of_many_files_is_drawn_or_refused_by_an_error_that_names_it():
    assert_good(range(10_000), range(10_000, 20_000))
