"""Compiling in several processes: each kernel once; what fails in a process costs no picture.

That all goes well, the largest first, is seen in test_kernels.py."""

import io
import os
import re
import signal
import subprocess
import sys
import time

import pytest
from helpers.processes import is_running, workers_of
from helpers.stores import environment_with, run

from rasterizer.compiler import jobs, kernels
from rasterizer.compiler.store import Store
from rasterizer.geometry.normals import list_corners
from rasterizer.pipeline.reflection import lambert

COLUMN = ("array", "uint32", 1, "C")
JOBS = [(lambert, ("batch function", "float32")), (list_corners.py_func, (COLUMN, COLUMN, COLUMN))]
posix = pytest.mark.skipif(os.name != "posix", reason="scripts and signals of POSIX")


@pytest.fixture
def own_store(tmp_path):
    tmp_path.chmod(0o700)
    return Store.into(tmp_path / "store")


def together(own_store, many=JOBS) -> list:
    """Compile; return what was noticed."""
    told = []
    jobs.compile_together(many, own_store.own, lambda *notice: told.append(notice))
    return told


# ---------------------------------------------------------------- what goes wrong

TROUBLE = {
    "ends at once": "",
    "ends with a fault": "import sys; sys.exit('a fault')",
    "is killed": "import os, signal; os.kill(os.getpid(), signal.SIGTERM)",
    "is no program": "this is no Python",
}
# Where Python is broken, so is that of what cleans up after processes.
died = pytest.mark.filterwarnings("ignore:resource_tracker")


def python_that(folder, trouble):
    """Make a Python that runs another program than it is asked to; return its path."""
    path = folder / "python"
    path.write_text(f"#!{sys.executable} -S\n{trouble}\n")
    path.chmod(0o755)
    return str(path)


@posix
@died
@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_process_that_fails_or_cannot_be_started_is_told_and_done_without(own_store, tmp_path, monkeypatch, caplog):
    caplog.set_level("INFO", "rasterizer")
    # What is outside of the package is the Python that it starts.
    pythons = {kind: lambda each=each: python_that(tmp_path, each) for kind, each in TROUBLE.items()}
    pythons |= {f"is {name!r}": lambda name=name: name for name in ("/nowhere/python", "", "/dev/null")}
    for kind, make in pythons.items():
        monkeypatch.setattr(sys, "executable", make())
        caplog.clear()
        together(own_store)
        assert len(kernels.missing_in(own_store, dict.fromkeys(JOBS))) == 2, kind
        assert any("not compiled ahead" in line for line in caplog.messages), f"{kind}: {caplog.messages}"
    assert together(own_store, []) == []


class Terminal(io.StringIO):
    def isatty(self):
        return True


@posix
@died
def test_a_program_shows_a_line_that_ends_with_the_last_kernel(own_store, tmp_path, monkeypatch):
    """Where nobody has asked to be told; on a terminal it counts."""
    monkeypatch.setattr(sys, "executable", python_that(tmp_path, ""))
    for stream in (io.StringIO(), Terminal()):
        monkeypatch.setattr(sys, "stderr", stream)
        jobs.compile_together(JOBS, own_store.own, None)
        line = r"rasterizer: compiling 2 kernels for the first time: "
        counted = rf"(\r{line}\d done)+\r{line}" if stream.isatty() else ""
        assert re.fullmatch(rf"{line}{counted}[\d.]+ s *\n", stream.getvalue()), stream.getvalue()
    monkeypatch.setattr(sys, "stderr", None)  # as in a process that was started without one
    jobs.compile_together(JOBS, own_store.own, None)


def test_a_job_that_fails_does_not_stop_the_others(own_store, caplog, alone):
    """One processor, and so one process, does them all."""
    caplog.set_level("INFO", "rasterizer")
    wrong = [(list_corners.py_func, ("int64",)), (lambert, ("batch function", "no dtype"))]
    before = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    try:
        if before:
            os.sched_setaffinity(0, {min(before)})
        told = together(own_store, [*wrong, *JOBS])
    finally:
        if before:
            os.sched_setaffinity(0, before)
    assert before is None or [n_done for _, n_done, _ in told] == [0, 1, 2, 3]
    assert [name for name, *_ in told] == ["list_corners"] * 2 + ["lambert"] * 2, "the larger ones go first"
    assert kernels.missing_in(own_store, dict.fromkeys(JOBS)) == []
    assert sum("not compiled ahead: TypingError" in line or "TypeError" in line for line in caplog.messages) == 2


DRAWS = """
import sys
sys.path.remove("")
import logging
logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stdout)
import numpy as np
from rasterizer.compiler import kernels
from rasterizer.geometry.normals import list_corners

sys.executable = sys.argv[1] or sys.executable
corners = np.array([2, 0, 2, 1], np.uint32)
with kernels.compiling_ahead(lambda: {}):
    assert list_corners(corners, np.zeros(5, np.uint32), np.zeros(4, np.uint32)) == 2
print("numba" in sys.modules)
"""


def test_what_stands_in_the_current_folder_is_not_imported(tmp_path):
    """A picture may be drawn in a folder of somebody else's. Nor does the program compile what a process has."""
    here = tmp_path / "here"
    here.mkdir()
    for name in ("numba", "numpy", "logging", "ast", "rasterizer", "llvmlite"):
        (here / f"{name}.py").write_text(f"open({str(tmp_path / 'imported')!r}, 'w')\n")
    assert run(DRAWS, here, "", RASTER_STORE=tmp_path / "store") == "False"
    assert not (tmp_path / "imported").exists()


@posix
@pytest.mark.nightly  # a process that compiles
def test_what_no_process_has_compiled_is_compiled_where_it_is_needed(tmp_path):
    told = run(DRAWS, tmp_path, python_that(tmp_path, ""), RASTER_STORE=tmp_path / "store", PYTHONWARNINGS="ignore")
    assert "not compiled ahead" in told and told.endswith("True"), told


# ---------------------------------------------------------------- ends


@posix
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.nightly)])
def test_interrupting_ends_all_processes(tmp_path, number, alone):
    """By the program, which hears of an interrupt; where it is killed, by themselves."""
    program = f"import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n{DRAWS}"
    environment = environment_with(RASTER_STORE=tmp_path / "store")
    command = [sys.executable, "-c", program, ""]
    process = subprocess.Popen(command, env=environment, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 60
    while not (workers := workers_of(process.pid)):
        assert time.monotonic() < end and process.poll() is None, "no process was started"
        time.sleep(0.02)
    process.send_signal(number)
    _, complaint = process.communicate(timeout=60)
    assert process.returncode and ("KeyboardInterrupt" in complaint) == (number == signal.SIGINT), complaint
    ended = time.monotonic()
    while any(is_running(worker) for worker in workers):
        assert time.monotonic() < ended + 3, f"processes {workers} run on"
        time.sleep(0.05)
