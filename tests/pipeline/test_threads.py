"""Check that the picture is the same, byte for byte, for any number of threads and height of the bands."""

import gc
import threading
import time

import numpy as np
import pytest
from helpers.against_reference import BUFFERS
from helpers.pinhole import SHADINGS, octasphere, torus
from helpers.raster import COLORED, GREY

import rasterizer as rz
from rasterizer.engine import draw
from rasterizer.pipeline.threads import MIN_PART, Workers

SIZE = (203, 157)  # no multiple of anything
CAMERA = rz.Camera.perspective((1.5, 2, 4), fov=40)


def scene(lights):
    """Two meshes of different materials, in perspective."""
    vertices, faces = octasphere(3)
    shiny = rz.Material(specular=0.5, shininess=60, reflection="blinn")
    return rz.Scene([rz.Mesh(*torus(24, 12)), rz.Mesh(vertices * 0.6, faces, material=shiny)], lights, CAMERA)


def assert_same(frames):
    """Refuse frames that differ in any bit."""
    assert frames[0].alpha.sum() > 1000 and np.ptp(frames[0].color) > 0.1
    for other in frames[1:]:
        for name in (*BUFFERS, "alpha", "rgba"):
            here, there = getattr(frames[0], name), getattr(other, name)
            assert here.tobytes() == there.tobytes(), f"{name} differs in {(here != there).sum()} values"


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 4, 9])
def test_threads_do_not_change_a_bit(shading, samples):
    for lights in (GREY, COLORED):
        for tolerance in (0.0, 1 / 4096):
            assert_same(
                [
                    rz.render(
                        scene(lights),
                        SIZE,
                        shading=shading,
                        samples=samples,
                        tolerance=tolerance,
                        threads=threads,
                        outputs=BUFFERS,
                    )
                    for threads in (1, 2, 4, 7)
                ]
            )


@pytest.mark.parametrize("shading", SHADINGS)
def test_the_height_of_bands_does_not_change_a_bit(shading, monkeypatch):
    for tolerance in (0.0, 1 / 4096):
        frames = []
        for n_entry in (1, 11 * SIZE[0], 29 * SIZE[0], 2**17, 2**24):
            monkeypatch.setattr(draw, "BAND_ENTRIES", n_entry)
            frames.append(
                rz.render(scene(COLORED), SIZE, shading=shading, tolerance=tolerance, threads=1, outputs=BUFFERS)
            )
        assert_same(frames)


@pytest.mark.parametrize("shading", SHADINGS)
def test_a_neighbour_does_not_change_a_bit(shading):
    """A pixel is a function of its polygon alone: what is drawn beside it must not move it."""
    vertices, faces = octasphere(3)
    far_left = rz.Mesh(vertices * 0.1 - (1.6, 0, 0), faces)
    for lights in (GREY, COLORED):
        for tolerance in (0.0, 1 / 4096):
            alone, accompanied = (
                rz.render(
                    rz.Scene([rz.Mesh(vertices, faces), *others], lights, CAMERA),
                    SIZE,
                    shading=shading,
                    tolerance=tolerance,
                    outputs=("color", "face"),
                )
                for others in ((), (far_left,))
            )
            is_same = (alone.face == accompanied.face) & (alone.face >= 0)
            assert is_same.sum() > 1000 and (accompanied.face >= len(faces)).any()
            assert (alone.color[is_same] == accompanied.color[is_same]).all()


def test_a_second_run_gives_the_same_bytes():
    for shading in SHADINGS:
        assert_same([rz.render(scene(COLORED), SIZE, shading=shading, outputs=BUFFERS) for _ in range(2)])


def test_many_vertices_are_divided_among_threads():
    """Enough vertices and faces that every stage has parts to divide."""
    vertices, faces = octasphere(7)
    assert len(vertices) > MIN_PART
    mesh = rz.Mesh(vertices, faces)
    for lights in (GREY, COLORED):
        assert_same(
            [
                rz.render(rz.Scene([mesh], lights, CAMERA), SIZE, threads=threads, outputs=BUFFERS)
                for threads in (1, 2, 5)
            ]
        )


def test_ranges_are_whole_and_in_order():
    for n_thread in (1, 2, 3, 8):
        workers = Workers(n_thread)
        for n in (0, 1, MIN_PART - 1, MIN_PART * 3 + 7, 10 * MIN_PART * n_thread):
            ranges = workers.ranges(n)
            assert np.concatenate([np.arange(*part) for part in ranges]).tolist() == list(range(n))
            assert len(ranges) <= 4 * n_thread
        workers.close()


@pytest.mark.parametrize("n_thread", [1, 2, 5])
def test_every_item_is_done_once_and_results_are_in_order(n_thread):
    workers, done = Workers(n_thread), []
    results = workers.map(lambda item: done.append(item) or 10 * item, range(100))
    workers.close()
    assert results == list(range(0, 1000, 10)) and sorted(done) == list(range(100))


@pytest.mark.parametrize("n_thread", [1, 2, 5])
def test_an_error_on_any_thread_is_raised(n_thread):
    workers = Workers(n_thread)
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


@pytest.mark.parametrize("n_started", [0, 1, 2])
def test_where_no_more_threads_can_be_started_those_there_are_do_it_all(n_started, monkeypatch):
    """As in a process that may have no more of them, or in one that is ending."""
    workers, started, start = Workers(5), [], threading.Thread.start

    def refuse(thread):
        if len(started) == n_started:
            raise RuntimeError("can't start new thread")
        started.append(thread)
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", refuse)
    for _ in range(2):
        assert workers.map(lambda item: 10 * item, range(100)) == list(range(0, 1000, 10))
    workers.close()
    assert len(started) <= n_started


def test_threads_end_when_their_workers_do():
    """Closed once, twice or never: in the end no thread is left, and a call afterwards is made on the caller's."""
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


def test_what_was_drawn_is_not_kept_by_threads_that_wait():
    class Picture:
        living = 0

        def __init__(self):
            Picture.living += 1

        def __del__(self):
            Picture.living -= 1

    workers, picture = Workers(3), Picture()
    workers.map(lambda item, picture=picture: picture and item, range(20))
    del picture
    end = time.monotonic() + 5
    while Picture.living and time.monotonic() < end:
        time.sleep(0.01)
    workers.close()
    assert Picture.living == 0
