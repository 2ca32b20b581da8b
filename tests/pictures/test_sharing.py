"""Check Renderers that are shared: by threads, with forked processes, through pickle, and after pictures that failed
half-way."""

import os
import pickle
import signal
import sys
import threading
import time

import numpy as np
import pytest
from helpers.pinhole import octasphere
from helpers.processes import at_once
from helpers.raster import COLORED, GREY

import rasterizer as rz
from rasterizer.cores import Workers

SIZE = (60, 45)
CAMERAS = [rz.Camera.perspective((4 * np.cos(a), 1.5, 4 * np.sin(a)), fov=40) for a in np.linspace(0, 6, 8)]
HAS_FORK = hasattr(os, "fork")
forking = pytest.mark.skipif(not HAS_FORK, reason="this system can't fork")
LAMPS = (
    *GREY,
    rz.PointLight((2, 3, 3), 0.4, attached="camera", shadow=True),
    rz.DirectionalLight((1, -1, 0), 0.3, shadow=True),
)


def scene_of(kind):
    vertices, faces = octasphere(2)
    opacity = 0.5 if kind == "layered" else 1.0
    ball = rz.Mesh(vertices, faces, material=rz.Material(specular=0.4, shininess=30, opacity=opacity))
    floor = rz.Mesh([(-3, -1, -3), (3, -1, -3), (3, -1, 3), (-3, -1, 3)], [[0, 3, 2, 1]])
    return rz.Scene([ball, floor], {"plain": GREY, "near light": COLORED}.get(kind, LAMPS), CAMERAS[0])


def bytes_of(frame):
    return frame.color.tobytes() + frame.rgba.tobytes()


@pytest.mark.parametrize("kind, shading", [("shadows", "phong"), ("layered", "gouraud")])
def test_threads_that_share_a_renderer_take_turns(kind, shading):
    """24 pictures of eight cameras; each is that of a Renderer of its own."""
    with rz.Renderer(scene_of(kind), SIZE, shading=shading, threads=2, samples=1) as renderer:
        expected = [bytes_of(renderer.render(camera)) for camera in CAMERAS]
    order = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        with rz.Renderer(scene_of(kind), SIZE, shading=shading, threads=2, samples=1) as renderer:

            def draw(first):
                return [bytes_of(renderer.render(CAMERAS[k % 8])) != expected[k % 8] for k in range(first, first + 6)]

            wrong = np.sum(at_once(draw, 4))
    finally:
        sys.setswitchinterval(order)
    assert not wrong, f"{wrong} of 24 pictures differ"


def test_close_waits_for_the_picture_that_is_being_drawn(alone):
    renderer, outcomes = rz.Renderer(scene_of("plain"), (400, 300), shading="phong", threads=2, samples=1), []

    def draw(k):
        if k == 3:
            time.sleep(0.05)
            return renderer.close()
        try:
            for _ in range(1000):
                outcomes.append(renderer.render().stats.covered)
        except rz.SceneError as fault:
            outcomes.append(str(fault))

    at_once(draw, 4)
    assert sum(isinstance(outcome, str) and "closed" in outcome for outcome in outcomes) == 3, outcomes[-3:]
    assert len({outcome for outcome in outcomes if not isinstance(outcome, str)}) <= 1


# ── processes ───────────────────────────────────────────────────────────────────────────────────────────


def ends_well(function) -> bool:
    """Tell whether a function returns True in a forked process, in time."""
    child = os.fork()
    if child == 0:
        signal.alarm(60)  # ends the process where something waits for ever
        is_good = False
        try:
            is_good = function()
        finally:
            os._exit(0 if is_good else 1)
    return os.waitpid(child, 0)[1] == 0


@forking
@pytest.mark.parametrize("n_thread", [1, 3])
def test_a_forked_process_draws_on(n_thread, alone):
    with rz.Renderer(scene_of("shadows"), SIZE, threads=n_thread, samples=1) as renderer:
        expected = bytes_of(renderer.render())

        def child():
            is_same = all(bytes_of(renderer.render()) == expected for _ in range(3))
            grandchild = ends_well(lambda: bytes_of(renderer.render()) == expected)
            renderer.close()
            return is_same and grandchild

        assert ends_well(child) and bytes_of(renderer.render()) == expected


@pytest.mark.parametrize("kind", ["plain", "layered"])
def test_a_pickled_renderer_is_one_of_the_same_scene_and_options(kind):
    options = {"shading": "phong", "tolerance": 0.01, "samples": 4, "cull": "back", "threads": 2, "exposure": 0.5}
    with rz.Renderer(scene_of(kind), SIZE, outputs=("rgb", "color", "depth"), **{"samples": 1} | options) as renderer:
        expected = renderer.render()
        with pickle.loads(pickle.dumps(renderer)) as other:
            assert other.options == renderer.options
            frame = other.render()
    assert bytes_of(frame) == bytes_of(expected) and frame.depth.tobytes() == expected.depth.tobytes()


# ── pictures that fail ──────────────────────────────────────────────────────────────────────────────────


def test_nothing_runs_on_after_an_error(alone):
    """Neither when an item fails nor when the caller is interrupted while it waits, which counts more than an error."""
    workers = Workers(3)
    for fault in (ValueError, KeyboardInterrupt):
        running, done = threading.Semaphore(0), []

        def work(item, running=running, done=done, fault=fault):
            if item < 2:
                time.sleep(0.01 * (item == 0))
                raise (fault, ValueError)[item]
            running.release()
            time.sleep(0.01)
            done.append(item)

        with pytest.raises(fault):
            workers.map(work, range(200))
        n_done = len(done)
        assert n_done < 50, f"{n_done} items were done after the fault"
        time.sleep(0.05)
        assert len(done) == n_done, "items are still being done"
    assert workers.map(abs, [-1, -2]) == [1, 2]
    workers.close()


@pytest.mark.skipif(os.name != "posix", reason="needs signals to a process of its own")
@pytest.mark.parametrize("kind, n_thread", [("shadows", 2), ("layered", 2), ("plain", 1)])
def test_an_interrupt_in_the_middle_of_a_picture(kind, n_thread, alone):
    """Ctrl-C at any time: the Renderer draws the right picture afterwards, a z-buffer half full is cleared."""
    with rz.Renderer(scene_of(kind), (300, 200), shading="phong", threads=n_thread, samples=1) as renderer:
        expected, rng = bytes_of(renderer.render()), np.random.default_rng(4)
        previous = signal.signal(signal.SIGALRM, signal.default_int_handler)
        try:
            n_interrupted = n_try = 0
            # Where Python can't raise it, as while something is freed, an interrupt is lost.
            while n_interrupted < 10 and n_try < 50:
                n_try += 1
                signal.setitimer(signal.ITIMER_REAL, float(rng.uniform(1e-4, 0.03)))
                try:
                    for _ in range(100):
                        renderer.render(CAMERAS[3])
                except KeyboardInterrupt:
                    n_interrupted += 1
                finally:
                    signal.setitimer(signal.ITIMER_REAL, 0)
                assert bytes_of(renderer.render()) == expected
        finally:
            signal.signal(signal.SIGALRM, previous)
    assert n_interrupted == 10, f"{n_interrupted} of {n_try} pictures were interrupted"
