"""The fuzz of files: files of a grammar a format, in processes of their own whose memory and time are capped."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.file_grammar import GRAMMARS, make_case

TESTS = Path(__file__).parents[1]
NIGHTLY = 20_000  # files of each format: half an hour of one processor
FIRST = int(os.environ.get("RASTERIZER_FUZZ_FIRST", 0))  # seed of the nightly run


def assert_good(first: int, n: int, *groups: list[str]):
    """Run `n` cases of each format, a process for each group of these: any file is drawn, or refused by an error that
    names it."""
    command = [sys.executable, "-m", "helpers.file_fuzz", str(first), str(n), "--of"]
    processes = [
        subprocess.Popen([*command, ",".join(group)], stdout=-1, stderr=-1, text=True, cwd=TESTS) for group in groups
    ]
    for group, process in zip(groups, processes, strict=True):
        out, err = process.communicate(timeout=3600)  # what libtiff says of pictures goes to stderr
        assert process.returncode == 0, f"{out[-4000:]}\nexit {process.returncode}, {err[-2000:]}"
        found = json.loads(out.splitlines()[-1])
        assert list(found) == group
        for format, counts in found.items():
            drawn, refused = counts["drawn"], counts["refused"]
            assert sum(counts[key] for key in ("drawn", "empty", "refused", "faults")) == n, f"{format}: {counts}"
            # Most damage is noticed; a fuzz whose files were all refused, or all empty, would test nothing.
            assert drawn > n // 10 and counts["empty"] <= max(drawn // 4, 3), f"{format}: {counts}"
            assert refused > 0 or format in ("mtl", "pictures"), f"{format}: {counts}"


def test_any_file_is_drawn_or_refused_by_an_error_that_names_it():
    assert_good(0, 100, list(GRAMMARS))


def test_a_case_is_the_same_whenever_it_is_made():
    for format in GRAMMARS:
        first = [make_case(format, seed) for seed in range(20)]
        assert first == [make_case(format, seed) for seed in range(20)], format


@pytest.mark.nightly
def test_any_of_many_files_is_drawn_or_refused_by_an_error_that_names_it():
    assert_good(FIRST, NIGHTLY, list(GRAMMARS)[::2], list(GRAMMARS)[1::2])
