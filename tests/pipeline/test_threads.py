"""Check that the picture is the same, byte for byte, for any number of threads and height of the bands."""

import gc
import threading
import time

import numpy as np
import pytest
from helpers.against_reference import BUFFERS
from helpers.pairs import pairs
from helpers.pinhole import SHADINGS, octasphere, torus
from helpers.raster import COLORED, GREY

import rasterizer as rz
from rasterizer.cores import Workers
from rasterizer.engine.draw import choose_band_rows

SIZE = (103, 157)  # no multiple of anything
CAMERA = rz.Camera.perspective((1.5, 2, 4), fov=40)
THREADS = 1, 1, 2, 7  # a second run is as the first
TOLERANCES = 0.0, 1 / 4096


def assert_same(case, scene, **options):
    """Refuse frames that differ in any bit."""
    frames = [rz.render(scene, SIZE, threads=n, outputs=BUFFERS, **options) for n in THREADS]
    assert frames[0].alpha.sum() > 500 and np.ptp(frames[0].color) > 0.1
    for n, other in zip(THREADS[1:], frames[1:], strict=True):
        for name in (*BUFFERS, "alpha", "rgba"):
            here, there = getattr(frames[0], name), getattr(other, name)
            assert here.tobytes() == there.tobytes(), (
                f"{case}, {n} threads: {name} differs {(here != there).sum()} times"
            )


@pytest.mark.parametrize("shading", SHADINGS)
def test_threads_do_not_change_a_bit(shading):
    """Two meshes of different materials. Bands are lower with more threads."""
    vertices, faces = octasphere(3)
    shiny = rz.Material(specular=0.5, shininess=60, reflection="blinn")
    meshes = [rz.Mesh(*torus(24, 12)), rz.Mesh(vertices * 0.6, faces, material=shiny)]
    assert len({choose_band_rows(*SIZE, n, 1) for n in THREADS}) == len(set(THREADS))
    for samples, lights, tolerance in pairs(samples=(1, 4, 9), lights=(GREY, COLORED), tolerance=TOLERANCES):
        case = f"{samples=}, {len(lights)} lights, {tolerance=}"
        assert_same(case, rz.Scene(meshes, lights, CAMERA), shading=shading, samples=samples, tolerance=tolerance)


@pytest.mark.parametrize("shading", SHADINGS)
def test_a_neighbour_does_not_change_a_bit(shading):
    """A pixel is a function of its polygon alone: what is drawn beside or before it must not move it, neither where
    rows show one triangle nor where they show many."""
    vertices, faces = octasphere(3)
    wall = rz.Mesh([[-9, -9, -2], [9, -9, -3], [9, 9, -2], [-9, 9, -1]], [[0, 1, 2], [0, 2, 3]])
    card = np.array([[0.7, 0.6, 2.2], [0.9, 0.6, 2.2], [0.8, 1.6, 2.2]])
    # What comes along is not nearer than anything, nor further away: the z-buffer is the same.
    scenes = (
        ([rz.Mesh(vertices, faces)], rz.Mesh(vertices * 0.1 - (1.3, 0, 0), faces)),
        ([wall, rz.Mesh(card, [[0, 1, 2]])], rz.Mesh(card - 0.2 * CAMERA.view().right, [[0, 1, 2]])),
    )
    for k, lights, tolerance in pairs(scene=(0, 1), lights=(GREY, COLORED), tolerance=TOLERANCES):
        meshes, other = scenes[k]
        alone, accompanied = (
            rz.render(
                rz.Scene(some, lights, CAMERA), SIZE, shading=shading, tolerance=tolerance, samples=1,
                outputs=("color", "face"),
            )
            for some in (meshes, [*meshes, other])
        )  # fmt: skip
        n_face = sum(len(mesh.faces) for mesh in meshes)
        is_same = (alone.face == accompanied.face) & (alone.face >= 0)
        assert is_same.sum() > 1000 and (accompanied.face >= n_face).sum() > 10
        n_different = (alone.color[is_same] != accompanied.color[is_same]).sum()
        assert n_different == 0, f"{n_different} values differ, {n_face} faces, {len(lights)} lights, {tolerance=}"


@pytest.mark.parametrize("n_thread", [1, 2, 5])
def test_every_item_is_done_once_results_are_in_order_and_an_error_on_any_thread_is_raised(n_thread):
    workers, done = Workers(n_thread), []
    results = workers.map(lambda item: done.append(item) or 10 * item, range(100))
    assert results == list(range(0, 1000, 10)) and sorted(done) == list(range(100))
    for wrong in (0, 7, 19):
        with pytest.raises(ZeroDivisionError):
            workers.map(lambda item, wrong=wrong: 1 / (item - wrong), range(20))
    assert workers.map(abs, [-1, -2]) == [1, 2]
    workers.close()


def test_an_interrupt_is_raised_rather_than_other_errors():
    workers = Workers(2)

    def fail(item):
        time.sleep(0.01 * (item == 0))
        raise (KeyboardInterrupt if item == 0 else ValueError)

    for _ in range(5):
        with pytest.raises(KeyboardInterrupt):
            workers.map(fail, range(2))
    workers.close()


def test_where_no_more_threads_can_be_started_those_there_are_do_it_all(monkeypatch):
    """As in a process that may have no more of them, or in one that is ending."""
    start = threading.Thread.start
    for n_started in (0, 1, 2):
        workers, started = Workers(5), []

        def refuse(thread, n_started=n_started, started=started):
            if len(started) == n_started:
                raise RuntimeError("can't start new thread")
            started.append(thread)
            start(thread)

        monkeypatch.setattr(threading.Thread, "start", refuse)  # the system that has no more of them
        for _ in range(2):
            assert workers.map(lambda item: 10 * item, range(100)) == list(range(0, 1000, 10)), f"{n_started} threads"
        workers.close()
        assert len(started) <= n_started


def test_threads_end_when_their_workers_do():
    """Closed once, twice or never: in the end no thread is left, and a call afterwards is made on the caller's."""
    gc.collect()  # the threads of workers that others have forgotten may end meanwhile
    time.sleep(0.05)
    before = threading.active_count()
    workers = Workers(4)
    workers.map(abs, range(40))
    assert before < threading.active_count() <= before + 3
    workers.close()
    workers.close()
    assert threading.active_count() == before and workers.map(abs, range(-3, 0)) == [3, 2, 1]
    forgotten = Workers(4)
    forgotten.map(abs, range(40))
    del forgotten
    gc.collect()
    end = time.monotonic() + 5
    while threading.active_count() > before and time.monotonic() < end:
        time.sleep(0.01)
    assert threading.active_count() == before
