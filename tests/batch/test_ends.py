"""Processes that hang are given up, and none outlives the one that started it by more than a second."""

import os
import signal
import sys
import time

import pytest
from helpers.processes import is_running, workers_of
from helpers.stores import start

from rasterizer.compiler import kernels
from rasterizer.processes import Died, Done, Job, ProcessPool

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are those that ps shows")


def stop_itself(argument, _shared, _kept):
    os.kill(os.getpid(), signal.SIGSTOP)


def work_long(argument, _shared, _kept):
    time.sleep(argument)
    return argument


def test_a_process_that_hangs_is_given_up_and_one_that_is_slow_is_not(alone):
    pool = ProcessPool(2, silence=3.0)
    pool.submit(Job(stop_itself, 0))
    pool.submit(Job(work_long, 6.0))
    begun, outcomes = time.monotonic(), [pool.wait()[1] for _ in range(2)]
    pool.close()
    assert sorted(outcomes, key=lambda each: isinstance(each, Died)) == [
        Done(6.0),
        Died("gave no sign of life for 3 s"),
    ]
    assert time.monotonic() - begun < 30


DRAWS = """
import rasterizer as rz, sys
ball = rz.Mesh([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [[0, 1, 2], [0, 2, 3]])
tasks = [rz.RenderTask(ball, f"{k}.png", options={"size": (6000, 6000), "samples": 16}) for k in range(999)]
for _ in rz.render_many(tasks, n_process=2):
    pass
"""
WARMS = "from rasterizer.cli import main; main(['warmup', '-q'])"


@pytest.mark.parametrize(
    "program, number, is_warm",
    [
        (DRAWS, signal.SIGKILL, True),
        pytest.param("import sys\n" + WARMS, signal.SIGKILL, False, marks=pytest.mark.nightly),
        pytest.param(DRAWS, signal.SIGTERM, True, marks=pytest.mark.nightly),
        pytest.param(DRAWS, signal.SIGINT, True, marks=pytest.mark.nightly),
        pytest.param("import sys\n" + WARMS, signal.SIGTERM, False, marks=pytest.mark.nightly),
        pytest.param("import sys\n" + WARMS, signal.SIGINT, False, marks=pytest.mark.nightly),
    ],
)
def test_no_process_outlives_the_one_that_started_it(program, number, is_warm, tmp_path, alone):
    store = kernels.STORE.own.parent if is_warm and kernels.STORE.own else tmp_path / "store"
    with start(program, tmp_path, RASTER_STORE=store) as process:
        end = time.monotonic() + 60
        while not (workers := workers_of(process.pid)):
            assert time.monotonic() < end and process.poll() is None, process.communicate()[1]
            time.sleep(0.05)
        time.sleep(2.0)  # at work
        process.send_signal(number)
        process.wait(20)
        ended = time.monotonic()
        while any(map(is_running, workers)):
            assert time.monotonic() < ended + 1.0, f"{workers} run on"
            time.sleep(0.02)
