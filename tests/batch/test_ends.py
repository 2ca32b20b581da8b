"""How a batch ends: early, by a signal, or with the program; no process outlives the one that started it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers.processes import is_running, workers_of
from helpers.raster import ROOT
from helpers.stores import environment_with, start

from rasterizer.compiler import kernels

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are those that ps shows")

# A plain script: nothing keeps what it does from being done again in each process that imports it.
BATCH = """
import rasterizer as rz, sys
ball = rz.Mesh([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [[0, 1, 2], [0, 2, 3]])
tasks = [rz.RenderTask(ball, f"{k}.png", options={"size": (300, 300), "samples": 16}) for k in range(99)]
print("begun", flush=True)
batch = rz.render_many(tasks, n_process=2)
"""
DROPPED = f"""
import gc, os, time
sys.path.append({str(ROOT / "tests")!r})
from helpers.processes import workers_of
gc.disable()
next(batch)
n, end = len(workers_of(os.getpid())), time.monotonic() + 10
del batch
while len(workers_of(os.getpid())) > n - 2:  # what keeps count of what is shared stays
    assert time.monotonic() < end, "its processes run on"
print("on")
"""
ENDS = {
    "break": ("for record in batch: break", 0),
    "an exception": ("for record in batch: raise KeyError('mine')", 1),
    "sys.exit": ("for record in batch: sys.exit(7)", 7),
    "a dropped iterator": (DROPPED, 0),
    "the end of the program": ("next(batch)", 0),
}


def own_store(tmp_path):
    return kernels.STORE.own.parent if kernels.STORE.own else tmp_path / "store"


def assert_ends(tmp_path, way):
    """Run a script that leaves a batch early: nothing is said but by itself, and all files are whole."""
    line, code = ENDS[way]
    script = tmp_path / "script.py"
    script.write_text(BATCH + line)
    environment = environment_with(RASTER_STORE=own_store(tmp_path))
    begun = time.monotonic()
    done = subprocess.run([sys.executable, script], cwd=tmp_path, env=environment, capture_output=True, text=True)
    told = done.stderr.splitlines()
    assert done.returncode == code, f"{way}: {done.returncode}, {done.stderr}"
    assert told[-1:] == (["KeyError: 'mine'"] if code == 1 else []), f"{way}: {done.stderr}"
    assert done.stdout.split() == ["begun"] + ["on"] * (line == DROPPED), f"{way}: {done.stdout}"
    written = os.listdir(tmp_path)
    assert any(name.endswith(".png") for name in written) and len(written) < 99, way
    assert not [name for name in written if name.startswith(".raster-")], way
    assert time.monotonic() - begun < 30, way


def test_a_batch_is_left_early_whichever_way(tmp_path, alone):
    for way in ENDS:
        (tmp_path / way).mkdir()
        assert_ends(tmp_path / way, way)


@pytest.mark.nightly
def test_a_batch_is_left_early_again_and_again(tmp_path, alone):
    for turn in range(10):
        for way in ENDS:
            (folder := tmp_path / f"{way} {turn}").mkdir()
            assert_ends(folder, way)


DRAWS = BATCH.replace("(300, 300)", "(6000, 6000)") + "for _ in batch: pass"
COMMAND = f"""import sys
from rasterizer.cli import main
words = "-o {{view}}.png --view random:99 --seed 1 -j 2 -s 3000 -q"
sys.exit(main(["batch", {str(ROOT / "models" / "teapot.obj")!r}, *words.split()]))
"""
WARMS = "import sys; from rasterizer.cli import main; main(['warmup', '-q'])"


@pytest.mark.parametrize(
    "program, number, is_warm",
    [
        (DRAWS, signal.SIGKILL, True),
        pytest.param(WARMS, signal.SIGKILL, False, marks=pytest.mark.nightly),
        pytest.param(COMMAND, signal.SIGINT, True, marks=pytest.mark.nightly),
        pytest.param(DRAWS, signal.SIGTERM, True, marks=pytest.mark.nightly),
        pytest.param(DRAWS, signal.SIGINT, True, marks=pytest.mark.nightly),
        pytest.param(WARMS, signal.SIGTERM, False, marks=pytest.mark.nightly),
        pytest.param(WARMS, signal.SIGINT, False, marks=pytest.mark.nightly),
    ],
)
def test_no_process_outlives_the_one_that_started_it(program, number, is_warm, tmp_path, alone):
    """Nor does what it was sent stay."""
    store, folder = own_store(tmp_path) if is_warm else tmp_path / "store", tmp_path / "models"
    folder.mkdir()
    with start(program, tmp_path, RASTER_STORE=store, TMPDIR=folder) as process:
        end = time.monotonic() + 60
        while len(workers := workers_of(process.pid)) < 3 or (program == DRAWS and not os.listdir(folder)):
            assert time.monotonic() < end and process.poll() is None, process.communicate()[1]
            time.sleep(0.05)
        time.sleep(2.0)  # at work
        workers = workers_of(process.pid)
        process.send_signal(number)
        process.wait(20)
        ended = time.monotonic()
        while any(map(is_running, workers)) or list(Path(folder).iterdir()):
            assert time.monotonic() < ended + 3.0, f"{workers} run on, or {os.listdir(folder)} stays"
            time.sleep(0.02)
    if program == COMMAND:
        assert process.returncode == 130 and not list(tmp_path.glob(".raster-*"))
