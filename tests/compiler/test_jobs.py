"""Compiling in several processes: each kernel once, the largest first; what fails in a process costs no picture."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from helpers.stores import environment_with, run, start

from rasterizer.compiler import jobs, kernels, store
from rasterizer.compiler.store import Store
from rasterizer.geometry.creases import list_corners
from rasterizer.pipeline.bands import scatter
from rasterizer.pipeline.reflection import lambert

COLUMN = ("array", "uint32", 1, "C")
JOBS = [(lambert, ("batch function", "float32")), (list_corners.py_func, (COLUMN, COLUMN, COLUMN))]


@pytest.fixture
def own_store(tmp_path):
    tmp_path.chmod(0o700)
    return Store.into(tmp_path / "store")


def together(own_store, many=JOBS) -> list:
    """Compile; return what was noticed."""
    told = []
    jobs.compile_together(many, own_store.own, lambda *notice: told.append(notice))
    return told


def fake(monkeypatch, program):
    """Let processes run another program, or none."""
    monkeypatch.setattr(jobs, "_PROGRAM", program)


# ---------------------------------------------------------------- all goes well


def test_every_job_is_done_and_told_the_largest_first(own_store):
    told = together(own_store)
    assert [name for name, *_ in told] == ["list_corners", "lambert"], "the larger one goes first"
    counts = [n_done for _, n_done, _ in told]
    assert counts == sorted(counts) and all(n_job == len(JOBS) for *_, n_job in told)
    assert kernels.missing_in(own_store, dict.fromkeys(JOBS)) == []
    assert not list(own_store.own.glob(f"*{store.HALF_WRITTEN}"))


def test_one_process_does_many_jobs(own_store, monkeypatch):
    monkeypatch.setattr(jobs, "n_core", lambda: 1)
    many = [*JOBS, (lambert, ("batch function", "float64"))]
    assert [n_done for _, n_done, _ in together(own_store, many)] == [0, 1, 2]
    assert kernels.missing_in(own_store, dict.fromkeys(many)) == []


def test_nothing_to_do_starts_nothing(own_store, monkeypatch):
    monkeypatch.setattr(jobs, "start_worker", None)
    assert together(own_store, []) == []


def test_what_a_function_calls_counts_for_its_size():
    assert jobs.measure_code(scatter.py_func) == len(scatter.py_func.__code__.co_code)
    assert jobs.measure_code(lambert) > len(lambert.__code__.co_code)  # as_array


# ---------------------------------------------------------------- what goes wrong

ENDS = "import sys; sys.stdin.readline()"
NONSENSE = """
import sys
for line in sys.stdin:
    sys.stdout.buffer.write(b"\\xff\\xfe nonsense " * 500 + b"\\n")
    sys.stdout.flush()
"""
TROUBLE = {
    "ends at once": "",
    "ends when asked": ENDS,
    "ends with a fault": "import sys; sys.exit('a fault')",
    "is killed when asked": "import os, signal, sys; sys.stdin.readline(); os.kill(os.getpid(), signal.SIGTERM)",
    "answers nonsense": NONSENSE,
    "closes its input": "import os, sys, time; os.close(0); print('done', flush=True); time.sleep(0.2)",
    "closes its output": "import os, sys; os.close(1); sys.stdin.readline()",
    "is no program": "this is no Python",
}


@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("kind", TROUBLE)
def test_a_process_that_fails_is_told_and_done_without(own_store, monkeypatch, caplog, kind):
    caplog.set_level("INFO", "rasterizer")
    fake(monkeypatch, TROUBLE[kind])
    together(own_store)
    assert len(kernels.missing_in(own_store, dict.fromkeys(JOBS))) == 2
    assert (
        caplog.messages and all("not compiled ahead" in line for line in caplog.messages) or kind == "closes its input"
    )


@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("executable", ["/nowhere/python", "", "/dev/null"])
def test_a_process_that_cannot_be_started_is_told_and_done_without(own_store, monkeypatch, caplog, executable):
    caplog.set_level("INFO", "rasterizer")
    monkeypatch.setattr(sys, "executable", executable)
    together(own_store)
    assert len(caplog.messages) == 2 and all("not compiled ahead" in line for line in caplog.messages)


def test_a_job_that_fails_does_not_stop_the_others(own_store, monkeypatch, caplog):
    caplog.set_level("INFO", "rasterizer")
    monkeypatch.setattr(jobs, "n_core", lambda: 1)
    wrong = [(list_corners.py_func, ("int64",)), (lambert, ("batch function", "no dtype"))]
    together(own_store, [*wrong, *JOBS])
    assert kernels.missing_in(own_store, dict.fromkeys(JOBS)) == []
    assert sum("not compiled ahead: TypingError" in line or "TypeError" in line for line in caplog.messages) == 2


def test_a_worker_of_another_store_says_so_by_its_code(tmp_path):
    program = "import sys; from rasterizer.compiler.worker import main; sys.exit(main('/another/store'))"
    with start(program, tmp_path, RASTER_STORE=tmp_path / "store") as process:
        out, complaint = process.communicate()
    assert (process.returncode, out, complaint) == (2, "", "")


def test_what_stands_in_the_current_folder_is_not_imported(tmp_path):
    """A picture may be drawn in a folder of somebody else's."""
    here = tmp_path / "here"
    here.mkdir()
    for name in ("numba", "numpy", "logging", "ast", "rasterizer", "llvmlite"):
        (here / f"{name}.py").write_text(f"open({str(tmp_path / 'imported')!r}, 'w')\n")
    program = """
import sys
sys.path.remove("")
import os
from rasterizer.compiler import jobs, kernels
from rasterizer.pipeline.reflection import lambert
jobs.compile_together([(lambert, ("batch function", "float32"))], kernels.STORE.own, lambda *notice: None)
print(any(kernels.STORE.find("reflection.lambert", ("batch function", "float32"))))
"""
    assert run(program, here, RASTER_STORE=tmp_path / "store") == "True"
    assert not (tmp_path / "imported").exists()


DRAWS = """
import logging, sys
logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stdout)
import numpy as np
from rasterizer.compiler import jobs, kernels
from rasterizer.geometry.creases import list_corners

jobs._PROGRAM = sys.argv[1]
corners = np.array([2, 0, 2, 1], np.uint32)
with kernels.compiling_ahead(lambda: {}):
    assert list_corners(corners, np.zeros(5, np.uint32), np.zeros(4, np.uint32)) == 2
"""


@pytest.mark.parametrize("kind", ["ends when asked", "answers nonsense"])
def test_what_no_process_has_compiled_is_compiled_where_it_is_needed(tmp_path, kind):
    told = run(DRAWS, tmp_path, TROUBLE[kind], RASTER_STORE=tmp_path / "store")
    assert "kernel list_corners is not compiled ahead" in told
    assert len(list(tmp_path.rglob(f"*{store.SUFFIX}"))) == 1


# ---------------------------------------------------------------- ends

WAITS = (
    "import sys, time; open(sys.argv[2] + '/begun', 'a').write(str(__import__('os').getpid()) + ' '); time.sleep(99)"
)


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupting_ends_all_processes(tmp_path, number):
    """Ctrl-C at once, by the program itself; where it is killed, by the end of their input."""
    program = DRAWS.replace("sys.argv[1]", repr(WAITS if number == signal.SIGINT else None)).replace(
        "jobs._PROGRAM = None\n", ""
    )
    program = f"import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n{program}"
    environment = environment_with(RASTER_STORE=tmp_path / "store")
    command = [sys.executable, "-c", program]
    process = subprocess.Popen(command, env=environment, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 60
    while not (workers := workers_of(process.pid)) or (number == signal.SIGINT and not list(tmp_path.rglob("begun"))):
        assert time.monotonic() < end and process.poll() is None, "no process was started"
        time.sleep(0.02)
    process.send_signal(number)
    _, complaint = process.communicate(timeout=60)
    assert process.returncode and ("KeyboardInterrupt" in complaint) == (number == signal.SIGINT), complaint
    while any(is_running(worker) for worker in workers):
        assert time.monotonic() < end, f"processes {workers} run on"
        time.sleep(0.05)


def workers_of(number) -> list[int]:
    """The processes that a process has started."""
    told = subprocess.run(["ps", "-o", "pid=", "--ppid", str(number)], capture_output=True, text=True, check=False)
    return [int(each) for each in told.stdout.split()]


def is_running(number) -> bool:
    told = subprocess.run(["ps", "-o", "stat=", "-p", str(number)], capture_output=True, text=True, check=False)
    return told.stdout.strip() != "" and not told.stdout.startswith("Z")


def test_n_core_is_at_least_one_and_at_most_all():
    assert 1 <= jobs.n_core() <= os.cpu_count()
    assert np.dtype("uint32").name == COLUMN[1]
