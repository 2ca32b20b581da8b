"""`render_many`: files and records of many tasks, whatever happens to one of them."""

import os
import signal
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest
from helpers.deadly import Deadly
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.batch import draw_run

CUBE, CONE, GEAR = (str(ROOT / "models" / name) for name in ("cube.obj", "cone.obj", "gear.stl"))
SMALL = {"size": (24, 16)}

pytestmark = pytest.mark.usefixtures("folder")


def tasks_of(models=(CUBE, CONE), views=("front", "iso"), folder="out"):
    for model in models:
        for view in views:
            yield rz.RenderTask(model, f"{folder}/{os.path.basename(model)}-{view}.png", view, options=SMALL)


def draw(tasks, executor=None, **settings):
    """All records, in the order of the tasks."""
    return sorted(rz.render_many(tasks, executor, **{"n_process": 1} | settings), key=lambda record: record.index)


def hidden_files(folder="."):
    return [name for _, _, names in os.walk(folder) for name in names if name.startswith(".raster-")]


def test_each_file_holds_what_one_render_writes():
    records = draw(tasks_of(), n_process=2)
    assert [record.status for record in records] == ["drawn"] * 4
    for record, task in zip(records, tasks_of(), strict=True):
        scene = rz.load(task.source)
        angles = {"front": (0, 0), "iso": (45.0, 35.264389682754654)}[task.view]
        camera = rz.Camera.framing(scene, *angles, up=scene.up, aspect=24 / 16)
        with rz.Renderer(scene, (24, 16), outputs="rgb", samples=4, threads=1) as renderer:
            renderer.render(camera).save("one.png")
        assert record.path == task.output and record.source == task.source
        assert open(record.path, "rb").read() == open("one.png", "rb").read()
        assert record.stats.coverage > 0 and record.seconds > 0 and record.error is None


def test_models_may_be_whatever_load_takes():
    scene, mesh = rz.load(CUBE), rz.load(CONE).meshes[0]
    arrays = (np.eye(3), [[0, 1, 2]])
    content = open(GEAR, "rb").read()
    tasks = [
        rz.RenderTask(scene, "scene.png", options=SMALL),
        rz.RenderTask(mesh, "mesh.png", "top", options=SMALL),
        rz.RenderTask(arrays, "arrays.png", options=SMALL),
        rz.RenderTask(content, "bytes.png", options=SMALL, load={"format": "stl"}),
        rz.RenderTask(open(GEAR, "rb"), "file.png", options=SMALL),
        rz.RenderTask(scene, "camera.tif", camera=rz.Camera.framing(scene, azimuth=80), options=SMALL),
        rz.RenderTask(scene, "angles.jpg", (10, -20), options=rz.Options(size=(24, 16), shading="phong")),
        rz.RenderTask(scene, "depth.npy", "front", options=SMALL, array="depth"),
        rz.RenderTask(scene, "color.npy", "front", options=SMALL),
    ]
    assert [record.error for record in draw(tasks)] == [None] * len(tasks)
    depth, color = np.load("depth.npy"), np.load("color.npy")
    assert depth.shape == (16, 24) and np.isfinite(depth).any() and color.shape == (16, 24, 3)
    expected = rz.render(scene, (24, 16), outputs="depth").depth.shape
    assert depth.shape == expected


def test_one_that_fails_does_not_stop_the_others():
    bad = [
        (rz.RenderTask("nope.obj", "a.png"), "no such file"),
        (rz.RenderTask(CUBE, "b.xyz"), "no format to write"),
        (rz.RenderTask(CUBE, "c.png", options={"sise": 3}), "did you mean size"),
        (rz.RenderTask(CUBE, "d.png", "up"), "view must be one of"),
        (rz.RenderTask(CUBE, "e.png", "top", camera=rz.Camera.framing(np.eye(3))), "not both"),
        (rz.RenderTask(CUBE, "f.png", options=[]), "options must be"),
        (rz.RenderTask(CUBE, 5), "output must be"),
        (rz.RenderTask(CUBE, "g.png", load={"creaze": 3}), "creaze"),
        (rz.RenderTask(CUBE, "h.png", load={"log": lambda text: None}), "can't be drawn by another"),
        (rz.RenderTask(object(), "i.png"), "a mesh must be"),
        (rz.RenderTask(CUBE, "j.png", (1, 2, 3)), "azimuth"),
        (rz.RenderTask(CUBE, "k.png", array="depth"), "written as .npy"),
        (rz.RenderTask(CUBE, "l.png", load=None), "load must be"),
        (rz.RenderTask(CUBE, "m.png", camera=5), "camera must be"),
        (rz.RenderTask(CUBE, "no\0name.png"), "no"),
    ]
    tasks = [task for task, _ in bad] + list(tasks_of())
    batch = rz.render_many(tasks, n_process=1)
    records = sorted(batch, key=lambda record: record.index)
    assert [record.index for record in records] == list(range(len(tasks)))
    for record, (_, words) in zip(records, bad, strict=False):
        assert record.status == "failed" and isinstance(record.error, rz.RasterizerError)
        assert words in str(record.error), record.error
    assert all(record.status == "drawn" for record in records[len(bad) :])
    assert (batch.summary.drawn, batch.summary.failed, batch.summary.exit_code) == (4, len(bad), 1)
    assert str(batch.summary).startswith(f"4 pictures drawn, {len(bad)} failed in ")


def test_a_process_that_dies_takes_nothing_else_with_it_and_its_task_is_named():
    deadly = rz.RenderTask(CUBE, "deadly.png", load={"lights": Deadly()}, options=SMALL)
    records = draw([*tasks_of(), deadly, *tasks_of(folder="later")], n_process=2)
    assert [record.status for record in records] == ["drawn"] * 4 + ["failed"] + ["drawn"] * 4
    assert "cube.obj: the process that drew it ended with exit code 9, twice" in str(records[4].error)


def test_a_task_whose_process_died_once_is_drawn_by_another_one(folder):
    tasks = [*tasks_of(), rz.RenderTask(CUBE, "once.png", load={"lights": Deadly(str(folder / "m"))}, options=SMALL)]
    assert [record.status for record in draw(tasks)] == ["drawn"] * 5
    assert (folder / "m").exists() and (folder / "once.png").stat().st_size > 0


def test_a_process_that_is_killed_half_way_loses_nothing():
    batch, n = rz.render_many(tasks_of(views=("front", "iso", "top", "left", "right")), n_process=2), 0
    for record in batch:
        assert record.status == "drawn"
        n += 1
        if n == 1:
            os.kill(batch._crew._workers[0]._process.pid, signal.SIGKILL)
    assert n == 10 == len(os.listdir("out"))


def test_what_is_there_is_skipped():
    assert {record.status for record in draw(tasks_of())} == {"drawn"}
    os.unlink("out/cube.obj-iso.png")
    open("out/cone.obj-front.png", "w").close()  # empty: no picture
    records = draw(tasks_of(), existing="skip")
    assert [record.status for record in records] == ["skipped", "drawn", "drawn", "skipped"]


def test_what_is_newer_than_its_model_is_skipped(folder):
    (folder / "own.obj").write_bytes(open(CUBE, "rb").read())
    tasks = list(tasks_of(("own.obj",)))
    draw(tasks)
    assert {record.status for record in draw(tasks, existing="skip-newer")} == {"skipped"}
    later = time.time() + 10
    os.utime("own.obj", (later, later))
    assert {record.status for record in draw(tasks, existing="skip-newer")} == {"drawn"}


def test_no_file_is_written_twice_nor_over_a_model(folder):
    (folder / "own.obj").write_bytes(open(CUBE, "rb").read())
    (folder / "own.png").write_bytes(open(CUBE, "rb").read())
    tasks = [
        rz.RenderTask(CUBE, "same.png", options=SMALL),
        rz.RenderTask(CONE, "./same.png", options=SMALL),
        rz.RenderTask("own.png", "./own.png", load={"format": "obj"}, options=SMALL),
        rz.RenderTask("own.obj", "own.obj/below.png", options=SMALL),
    ]
    records = draw(tasks)
    assert "task 0 of the batch writes it, too" in str(records[1].error)
    assert "can't write ./own.png: it is the model, which is read" in str(records[2].error)
    assert "can't write own.obj/below.png" in str(records[3].error)
    assert all((folder / name).read_bytes() == open(CUBE, "rb").read() for name in ("own.obj", "own.png"))
    assert not hidden_files()


def test_tasks_are_taken_as_they_are_needed():
    taken = []

    def endless():
        for k in range(10**9):
            taken.append(k)
            yield rz.RenderTask(CUBE, f"out/{k}.png", (k % 360, 0), options=SMALL)

    with rz.render_many(endless(), n_process=1) as batch:
        for _ in range(3):
            next(batch)
        processes = [worker._process for worker in batch._crew._workers]
    assert len(taken) <= 40, f"{len(taken)} tasks were taken for 3 pictures"
    assert processes and all(process.poll() is not None for process in processes)
    assert not hidden_files()


def test_a_generator_that_raises_ends_the_processes():
    def broken():
        yield from tasks_of()
        raise KeyError("mine")

    batch = rz.render_many(broken(), n_process=1)
    with pytest.raises(KeyError, match="mine"):
        list(batch)
    assert batch._crew.n_running == 0 and not batch._crew._workers


def test_a_broken_model_is_read_once_for_all_its_views(folder):
    (folder / "bad.obj").write_text("v 1 2\nf 1 2 3\n")
    records = draw(tasks_of(("bad.obj",), ("front", "top", "iso")))
    assert len({str(record.error) for record in records}) == 1 and "bad.obj:1" in str(records[0].error)


def test_warnings_of_a_model_are_in_its_records(folder):
    (folder / "own.obj").write_text("mtllib missing.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\n")
    (record,) = draw([rz.RenderTask("own.obj", "own.png", options=SMALL)])
    assert record.status == "drawn" and "missing.mtl" in record.warnings[0]
    assert record.as_dict()["warnings"] == list(record.warnings) and record.as_dict()["error"] is None


def test_names_may_have_any_letters(folder):
    name = "größe 'x' \N{SNOWMAN}.obj"
    (folder / name).write_bytes(open(CUBE, "rb").read())
    (record,) = draw([rz.RenderTask(folder / name, folder / "ü b" / "\N{SNOWMAN}.png", options=SMALL)])
    assert record.status == "drawn" and (folder / "ü b" / "\N{SNOWMAN}.png").exists()


def test_nothing_is_nothing():
    batch = rz.render_many([])
    assert list(batch) == [] and batch.summary.exit_code == 0 and str(batch.summary).startswith("0 pictures drawn")
    assert not batch._crew._workers


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((5,), "an iterable"),
        (([], 5), "executor must be"),
        (([], "host:1"), "tcp://"),
    ],
)
def test_arguments_that_are_not_legal(arguments, words):
    with pytest.raises(rz.SceneError, match=words):
        rz.render_many(*arguments)
    with pytest.raises(rz.SceneError, match="n_process"):
        rz.render_many([], n_process=0)
    with pytest.raises(rz.SceneError, match="replace"):
        rz.render_many([], existing="keep")
    with pytest.raises(rz.SceneError, match="number 1 is 'x'"):
        list(rz.render_many([next(tasks_of()), "x"], n_process=1))


def test_an_executor_draws_the_same_bytes():
    draw(tasks_of())
    with ThreadPoolExecutor(2) as executor:
        records = draw(tasks_of(folder="threads"), executor, n_process=None)
    assert {record.status for record in records} == {"drawn"}
    for name in os.listdir("out"):
        assert open(f"out/{name}", "rb").read() == open(f"threads/{name}", "rb").read()


def test_too_little_memory_stops_one_picture_and_is_tried_again_for_the_next(monkeypatch):
    load, faults = draw_run.load, [MemoryError("Unable to allocate 9 TiB"), MemoryError()]

    def load_or_fail(*args, **settings):
        if faults:
            raise faults.pop(0)
        return load(*args, **settings)

    monkeypatch.setattr(draw_run, "load", load_or_fail)
    with ThreadPoolExecutor(1) as executor:
        records = draw(tasks_of((CUBE, CONE), ("front", "iso", "top")), executor)
    assert [record.status for record in records] == ["failed", "failed", "drawn", "drawn", "drawn", "drawn"]
    assert str(records[0].error) == f"not enough memory for {CUBE}: Unable to allocate 9 TiB"
    assert str(records[1].error) == f"not enough memory for {CUBE}"


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit])
def test_an_interrupt_ends_the_batch_and_leaves_nothing_half_written(monkeypatch, stop):
    encode, n_drawn = draw_run.encode, []

    def encode_or_stop(*args):
        n_drawn.append(args)
        if len(n_drawn) == 2:
            raise stop
        return encode(*args)

    monkeypatch.setattr(draw_run, "encode", encode_or_stop)
    with ThreadPoolExecutor(1) as executor, pytest.raises(stop):
        draw(tasks_of((CUBE, CONE, GEAR), ("front",)), executor)
    assert len(n_drawn) <= 3 and not hidden_files()


def test_an_executor_that_is_shut_down_is_told():
    executor = ThreadPoolExecutor(1)
    executor.shutdown()
    with pytest.raises(rz.RasterizerError, match="takes no tasks any more"):
        draw(tasks_of(), executor)


@pytest.mark.slow
def test_a_pool_that_breaks_is_told(folder):
    """Starts a pool of multiprocessing, whose process imports the package anew."""
    from multiprocessing import get_context

    deadly = rz.RenderTask(CUBE, "deadly.png", load={"lights": Deadly()}, options=SMALL)
    with ProcessPoolExecutor(1, get_context("spawn")) as executor:
        assert {record.status for record in draw(tasks_of(), executor)} == {"drawn"}
        with pytest.raises(rz.RasterizerError, match="takes no tasks any more"):
            draw([deadly], executor)


def test_a_batch_may_be_drawn_beside_another_one():
    found = []
    threads = [threading.Thread(target=lambda k=k: found.extend(draw(tasks_of(folder=f"t{k}")))) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [record.status for record in found] == ["drawn"] * 8
