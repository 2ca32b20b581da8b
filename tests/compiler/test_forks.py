"""Forks at random moments, while another thread draws or loads kernels that are stored: child and parent go on. A child
that inherited one of our locks locked would wait for it for ever."""

import os
import random
import subprocess
import time

import pytest
from helpers.stores import start

from rasterizer.compiler import kernels

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
LIMIT = 60  # seconds, of a child and of its parent, on a machine that is busy

# `work()` is what the parent does first, so that all is imported and compiled, and then the other thread, the children
# and the parent again. Half of the forks come close together.
PROGRAM = """
import hashlib, os, random, signal, sys, threading, time, warnings

warnings.simplefilter("ignore")  # newer versions of Python warn of every fork of a process with threads
seed, n_fork, limit = map(int, sys.argv[1:])
chance = random.Random(seed)


def ends_well(child):
    end = time.monotonic() + limit
    while (found := os.waitpid(child, os.WNOHANG)) == (0, 0):
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return False
        time.sleep(0.005)
    return found[1] == 0


def run(work):
    expected, results, is_over = work(), [], threading.Event()

    def go_on():
        while True:
            results.append(work())
            if is_over.is_set():
                return

    other = threading.Thread(target=go_on, daemon=True)
    other.start()
    children = []
    for k in range(n_fork):
        time.sleep(chance.choice((0.003, 0.3)) * chance.random())
        child = os.fork()
        if child == 0:
            found = work()
            os._exit(found != expected)
        children.append(child)
        if len(children) == 3 or k == n_fork - 1:
            assert all([ends_well(each) for each in children]), (seed, k)
            children.clear()
    is_over.set()
    other.join(limit)
    assert not other.is_alive() and {*results, work()} == {expected}
"""
DRAW = """
def work():
    import rasterizer as rz
    square = rz.Mesh([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [[0, 1, 2], [0, 2, 3]])
    return hashlib.sha256(rz.render(rz.Scene([square]), (24, 18), threads=2).encode(".png")).hexdigest()
"""
# Of a viewer: the size of each picture is another, so that each is drawn.
VIEW = """
import rasterizer as rz
from rasterizer.viewer.session import Session
session = Session(rz.Scene([rz.Mesh([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [[0, 1, 2], [0, 2, 3]])]))

def work():
    for width in (32, 48):
        message = {"size": [width, 32], "background": "#ffffff", "is_rest": True, "events": []}
        found = session.answer(message).content
    return hashlib.sha256(found).hexdigest()
"""
# Each time as in a process that has met no kernel yet.
LOAD = """
import ctypes
import numpy as np
from rasterizer.compiler import kernels
from rasterizer.geometry.normals import list_corners
from rasterizer.pipeline.reflection import lambert
corners = np.array([2, 0, 2, 1], np.uint32)


def work():
    kernel = kernels.kernel(list_corners.py_func)
    starts, ordered = np.zeros(5, np.uint32), np.zeros(4, np.uint32)
    n = kernel(corners, starts, ordered)
    return n, starts.tobytes(), ordered.tobytes(), kernels.BatchFunction(lambert, np.dtype("float32")).address != 0
"""
PHASES = {"drawing": DRAW, "viewing": VIEW, "loading": LOAD}


def campaign(phase, seed, n_fork, tmp_path):
    folder = kernels.STORE.own and kernels.STORE.own.parent
    program = PROGRAM + PHASES[phase] + "run(work)"
    with start(program, tmp_path, seed, n_fork, LIMIT, RASTER_STORE=folder) as process:
        try:
            out, complaint = process.communicate(timeout=LIMIT + 2 * LIMIT * n_fork)
        except subprocess.TimeoutExpired:
            process.kill()
            pytest.fail(f"{phase}, seed {seed}: the parent hangs")
    assert (process.returncode, out, complaint) == (0, "", ""), f"{phase}, seed {seed}: {complaint[-1500:]}"


@pytest.mark.parametrize("phase", PHASES)
def test_a_fork_at_any_moment_leaves_child_and_parent_at_work(phase, tmp_path, alone):
    campaign(phase, random.Random(phase).randrange(1000), 6, tmp_path)


@pytest.mark.nightly
@pytest.mark.parametrize("phase", PHASES)
def test_many_forks_at_any_moment(phase, tmp_path, alone):
    end = time.monotonic() + 120
    for seed in range(1000, 1200):
        campaign(phase, seed, 12, tmp_path)
        if time.monotonic() > end:
            break
