"""`render_many`: files and records of many tasks, whatever happens to one of them."""

import os
import signal
import sys
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import suppress
from glob import glob
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from helpers.deadly import Deadly, Unreadable
from helpers.model_bytes import rich_gltf
from helpers.odd_format import odd_format
from helpers.processes import at_once
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz
from rasterizer.batch.tasks import RenderSummary

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


def children() -> set[int]:
    """The processes that this one has started, whichever of its threads did."""
    found = set()
    for path in glob(f"/proc/{os.getpid()}/task/*/children"):
        with suppress(OSError), open(path) as stream:  # a thread may have ended
            found |= set(map(int, stream.read().split()))
    return found


needs_proc = pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")


def test_tasks_of_one_view_and_options_share_a_frame():
    options, files = SMALL | {"outputs": ("rgb", "depth")}, ((".png", None), (".npy", "depth"))
    tasks = [
        rz.RenderTask(CUBE, f"{azimuth}{end}", (azimuth, 20), options=options, array=array)
        for azimuth in range(6)  # more files than a job has pictures
        for end, array in files
    ]
    times = [record.stats.milliseconds for record in draw(tasks)]
    assert [times.count(each) for each in times] == [2] * 12
    frame = rz.render(CUBE, (24, 16), azimuth=5, elevation=20, outputs=("rgb", "depth"))
    assert np.array_equal(np.load("5.npy"), frame.depth) and open("5.png", "rb").read() == frame.encode("PNG")


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
        (rz.RenderTask(CUBE, "d.png", "up"), "view must be one of"),
        (rz.RenderTask(CUBE, "e.png", "top", camera=rz.Camera.framing(np.eye(3))), "given camera, view"),
        (rz.RenderTask(CUBE, "h.png", load={"log": lambda text: None}), "can't be drawn by another"),
        (rz.RenderTask(CUBE, "u.png", load={"lights": Unreadable()}), "can't be drawn by another"),
        (rz.RenderTask(CUBE, "k.png", array="uv"), "a PNG file can't hold 'uv'"),
        (rz.RenderTask(CUBE, "k.npz", array=("depth", "z")), "array must be one of"),
        (rz.RenderTask(CUBE, {"rgb": "k.png", "depth": "k.png"}), "a .png file holds one array"),
        (rz.RenderTask(CUBE, {"rgb": "k.png", "depth": "./k.png"}), "another file of the task"),
        (rz.RenderTask(CUBE, {"rgb": "k.png"}, array="depth"), "not in both"),
        (rz.RenderTask(CUBE, {"rgb": "k.png"}, scale=0.01), "none is written"),
        (rz.RenderTask(CUBE, {"depth": "k.png"}, scale=1e-9), "with scale 1e-09 a PNG file holds depths"),
        (rz.RenderTask(CUBE, "k.png", "random", seed=-1), "seed must be"),
        (rz.RenderTask(CUBE, "o.png", {"distanze": 3}, seed=1), "did you mean distance"),
        (rz.RenderTask(CUBE, "p.png", lights="sun"), "lights must be"),
        (rz.RenderTask(CUBE, "no\0name.png"), "no"),
    ]
    tasks = [task for task, _ in bad] + list(tasks_of())
    batch = rz.render_many(tasks, n_process=1)
    records = sorted(batch, key=lambda record: record.index)
    assert [record.index for record in records] == list(range(len(tasks)))
    for record, (_, words) in zip(records, bad, strict=False):
        assert record.status == "failed" and isinstance(record.error, rz.RasterizerError)
        assert words in str(record.error), record.error
    assert [record for record in records[len(bad) :] if record.status != "drawn"] == []
    assert (batch.summary.drawn, batch.summary.failed, batch.summary.exit_code) == (4, len(bad), 1)
    assert str(batch.summary).startswith(f"4 pictures drawn, {len(bad)} failed in ")
    assert str(batch.summary).endswith(f"; the first failure: {batch.summary.first_error}")


def test_the_exit_code_says_whether_anything_failed():
    for drawn, failed in product((0, 1, 2), (0, 1, 2, 256)):
        assert RenderSummary(drawn=drawn, failed=failed).exit_code == (1 if failed else 0), f"{failed} failed"


def test_a_process_that_dies_takes_nothing_else_with_it_and_its_task_is_named(folder):
    """One that dies again and again is named; one that died once is drawn by another process."""
    deadly = rz.RenderTask(CUBE, "deadly.png", load={"lights": Deadly()}, options=SMALL)
    once = rz.RenderTask(CUBE, "once.png", load={"lights": Deadly(str(folder / "m"))}, options=SMALL)
    records = draw([*tasks_of(), deadly, once, *tasks_of(folder="later")])
    assert [record.status for record in records] == ["drawn"] * 4 + ["failed"] + ["drawn"] * 5
    assert "cube.obj: the process that drew it ended with exit code 9, twice" in str(records[4].error)
    assert (folder / "m").exists() and (folder / "once.png").stat().st_size > 0


class DeadlyElsewhere(Executor):
    """An executor whose processes don't see the models' files, and end as many times as it says when they have one."""

    def __init__(self, n_death):
        self.n_left, self.n_sent = n_death, 0

    def submit(self, call, function, run, shared):
        future, self.n_sent = Future(), self.n_sent + 1
        assert self.n_sent < 50, "it is sent again and again"
        if shared is not None and self.n_left:
            self.n_left -= 1
            future.set_exception(BrokenExecutor("ended"))
        else:
            future.set_result(call(function, run._replace(identity=run.identity and (0, 0)), shared))
        return future


def test_a_picture_that_ends_processes_elsewhere_is_named_too():
    for n_death, words in ((1, "drawn once more"), (99, "the process that drew it ended, twice")):
        batch = rz.render_many([rz.RenderTask(CUBE, "x.png", options=SMALL)], DeadlyElsewhere(n_death), n_process=1)
        with suppress(rz.RasterizerError):
            (record,) = batch
        said = batch.summary.first_error or "; ".join(record.warnings)
        assert words in said and batch.summary.failed == (n_death > 2), said


@needs_proc
def test_a_process_that_is_killed_half_way_loses_nothing(alone):
    before, batch = children(), rz.render_many(tasks_of(views=("front", "iso", "top", "left", "right")), n_process=2)
    statuses = [next(batch).status]
    os.kill(min(children() - before), signal.SIGKILL)
    statuses += [record.status for record in batch]
    assert statuses == ["drawn"] * 10 and len(os.listdir("out")) == 10


def test_what_is_there_or_newer_than_its_model_is_skipped(folder):
    (folder / "own.obj").write_bytes(open(CUBE, "rb").read())
    tasks = list(tasks_of(("own.obj", CONE)))

    def statuses(**settings):
        with ThreadPoolExecutor(1) as executor:
            return [record.status for record in draw(tasks, executor, **settings)]

    assert statuses() == ["drawn"] * 4
    os.unlink("out/own.obj-iso.png")
    open("out/cone.obj-front.png", "w").close()  # empty: no picture
    assert statuses(existing="skip") == ["skipped", "drawn", "drawn", "skipped"]
    assert statuses(existing="changed") == ["skipped"] * 4
    later = time.time() + 10
    os.utime("own.obj", (later, later))
    assert statuses(existing="changed") == ["drawn", "drawn", "skipped", "skipped"]
    assert statuses(existing="skip") == ["skipped"] * 4 and statuses(existing="replace") == ["drawn"] * 4


def test_a_picture_is_made_anew_where_a_file_that_its_task_names_is_newer(folder):
    Image.new("RGB", (2, 2), "red").save("a.png")
    Image.new("RGB", (2, 2), "red").save("file", "png")  # what a camera that is no file is called
    Path("own.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    Path("a.json").write_text('{"eye": [3, 2, 5], "target": [0, 0, 0]}')
    tasks = [
        rz.RenderTask("own.obj", "texture.png", options={"material": {"texture": "a.png"}, "size": 8}),
        rz.RenderTask(
            "own.obj",
            "metal.png",
            options={"material": {"metallic_roughness": "file", "reflection": "cook-torrance"}, "size": 8},
        ),
        rz.RenderTask(GEAR, "camera.png", camera="a.json", options={"size": 8}),
        rz.RenderTask(GEAR, "framed.png", camera="frame", options={"size": 8}),
    ]

    def statuses():
        with ThreadPoolExecutor(1) as executor:
            return [record.status for record in draw(tasks, executor, existing="changed")]

    assert statuses() == ["drawn"] * 4 and statuses() == ["skipped"] * 4
    for name, n_before, n_newer in (("a.png", 0, 1), ("file", 1, 1), ("a.json", 2, 1)):
        later = time.time() + 10
        os.utime(name, (later, later))
        assert statuses() == ["skipped"] * n_before + ["drawn"] * n_newer + ["skipped"] * (4 - n_before - n_newer), name
        os.utime(name, (0, 0))


def test_dicts_may_be_changed_for_the_next_task(folder):
    options, output, tasks = dict(SMALL), {}, []
    for k in range(3):
        options["size"], output["rgb"] = 8 + k, f"{k}.png"
        tasks.append(rz.RenderTask(CUBE, output, options=options))
    draw(tasks)
    assert [Image.open(f"{k}.png").size for k in range(3)] == [(8 + k, 8 + k) for k in range(3)]


def test_no_file_is_written_twice_nor_over_what_is_read(folder):
    Image.new("RGB", (2, 2), "red").save("a.png")
    pixels, of_uv = Path("a.png").read_bytes(), np.eye(3)[:, :2]
    textured = SMALL | {"material": {"texture": "a.png"}}
    (folder / "own.obj").write_bytes(open(CUBE, "rb").read())
    (folder / "own.png").write_bytes(open(CUBE, "rb").read())
    tasks = [
        rz.RenderTask(CUBE, "same.png", options=SMALL),
        rz.RenderTask(CONE, "./same.png", options=SMALL),
        rz.RenderTask("own.png", "./own.png", load={"format": "obj"}, options=SMALL),
        rz.RenderTask("own.obj", "own.obj/below.png", options=SMALL),
        rz.RenderTask(rz.Mesh(np.eye(3), [[0, 1, 2]], uv=of_uv), "./a.png", options=textured),
        rz.RenderTask(CUBE, "link/same.png", options=SMALL),
    ]
    (folder / "link").symlink_to(".")
    with ThreadPoolExecutor(1) as executor:
        records = draw(tasks, executor)
    assert all("task 0 of the batch writes it, too" in str(records[k].error) for k in (1, 5))
    assert "can't write ./own.png: it is own.png, which is read" in str(records[2].error)
    assert "can't write own.obj/below.png" in str(records[3].error)
    assert "can't write ./a.png: it is a.png, which is read" in str(records[4].error)
    assert Path("a.png").read_bytes() == pixels
    assert [name for name in ("own.obj", "own.png") if (folder / name).read_bytes() != open(CUBE, "rb").read()] == []
    assert not hidden_files()


@needs_proc
def test_tasks_are_taken_as_they_are_needed_and_processes_end_with_the_batch(alone):
    before, taken = children(), []

    def endless():
        for k in range(10**9):
            taken.append(k)
            yield rz.RenderTask(CUBE, f"out/{k}.png", (k % 360, 0), options=SMALL)

    with rz.render_many(endless(), n_process=1) as batch:
        for _ in range(3):
            next(batch)
        assert len(children() - before) == 1
    assert len(taken) <= 40, f"{len(taken)} tasks were taken for 3 pictures"
    assert not children() - before and not hidden_files()

    def broken():
        yield from tasks_of()
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        list(rz.render_many(broken(), n_process=1))
    assert not children() - before, "a generator that raises ends them, too"
    batch = rz.render_many([])
    assert list(batch) == [] and batch.summary.exit_code == 0 and str(batch.summary).startswith("0 pictures drawn")
    assert not children() - before, "nothing is nothing"


def test_models_with_faults_warnings_and_odd_names(folder):
    (folder / "bad.obj").write_text("v 1 2\nf 1 2 3\n")
    (folder / "own.obj").write_text("mtllib missing.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\n")
    name = "größe 'x' \N{SNOWMAN}.obj"
    (folder / name).write_bytes(open(CUBE, "rb").read())
    odd = rz.RenderTask(folder / name, folder / "ü b" / "\N{SNOWMAN}.png", options=SMALL)
    tasks = [*tasks_of(("bad.obj",), ("front", "top", "iso")), rz.RenderTask("own.obj", "own.png", options=SMALL), odd]
    with ThreadPoolExecutor(1) as executor:
        *broken, warned, odd = draw(tasks, executor)
    assert len({str(record.error) for record in broken}) == 1 and "bad.obj:1" in str(broken[0].error)
    assert warned.status == "drawn" and "missing.mtl" in warned.warnings[0]
    assert warned.as_dict()["warnings"] == list(warned.warnings) and warned.as_dict()["error"] is None
    assert odd.status == "drawn" and (folder / "ü b" / "\N{SNOWMAN}.png").exists()


def test_arguments_that_are_not_legal():
    for arguments, settings, words in (
        ((5,), {}, "an iterable"),
        (([], 5), {}, "executor must be"),
        (([], "host:1"), {}, "tcp://"),
        (([],), {"n_process": 0}, "n_process"),
        (([],), {"n_process": 1025}, "n_process"),
        (([],), {"existing": "keep"}, "replace"),
    ):
        with pytest.raises(rz.SceneError, match=words):
            rz.render_many(*arguments, **settings)
    with pytest.raises(rz.SceneError, match="number 1 is 'x'"), ThreadPoolExecutor(1) as executor:
        list(rz.render_many([next(tasks_of()), "x"], executor))


def test_too_little_memory_stops_one_picture_alone(monkeypatch):
    faults, save = [MemoryError("Unable to allocate 9 TiB"), MemoryError()], Image.Image.save

    def save_or_fail(*arguments, **settings):
        if faults:
            raise faults.pop(0)
        save(*arguments, **settings)

    monkeypatch.setattr(Image.Image, "save", save_or_fail)  # of Pillow, which asks the system for memory
    tasks = [rz.RenderTask(CUBE, f"{k}.jpg", (k, 0), options=SMALL) for k in range(4)]
    with ThreadPoolExecutor(1) as executor:
        records = draw(tasks, executor)
    assert [record.status for record in records] == ["failed", "failed", "drawn", "drawn"]
    assert str(records[0].error) == f"not enough memory for {CUBE}: Unable to allocate 9 TiB"
    assert str(records[1].error) == f"not enough memory for {CUBE}"


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit])
def test_an_interrupt_ends_the_batch_and_leaves_nothing_half_written(folder, stop):
    (folder / "a.odd").write_bytes(open(CUBE, "rb").read())
    tasks = tasks_of((CONE, "a.odd", GEAR), ("front",))
    with odd_format(stop()), ThreadPoolExecutor(1) as executor, pytest.raises(stop):
        draw(tasks, executor)
    assert os.listdir("out") == ["cone.obj-front.png"] and not hidden_files()


class Elsewhere(Executor):
    """Draws at once, where a model's file is another one: of a later time."""

    def submit(self, function, *arguments):
        changed = os.stat("own.obj").st_mtime_ns + 10**9
        os.utime("own.obj", ns=(changed, changed))
        (future := Future()).set_result(function(*arguments))
        return future


def test_a_model_that_others_do_not_see_is_sent_to_them(folder):
    (folder / "own.obj").write_text("mtllib missing.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\n")
    (folder / "bad.obj").write_text("v 1 2\n")
    tasks = tasks_of(("own.obj", "bad.obj"), ("front", "iso"))
    records = draw(tasks, Elsewhere())
    assert [record.status for record in records] == ["drawn"] * 2 + ["failed"] * 2
    assert [record for record in records[:2] if "missing.mtl" not in record.warnings[0]] == []
    assert "bad.obj:1" in str(records[2].error)
    with ThreadPoolExecutor(1) as executor:
        draw(tasks_of(("own.obj",), folder="seen"), executor)
    for name in os.listdir("seen"):
        assert open(f"out/{name}", "rb").read() == open(f"seen/{name}", "rb").read()


def test_an_executor_that_is_shut_down_is_told():
    executor = ThreadPoolExecutor(1)
    executor.shutdown()
    with pytest.raises(rz.RasterizerError, match="takes no tasks any more"):
        draw(tasks_of(), executor)


@pytest.mark.nightly
def test_a_pool_that_breaks_is_told(folder):
    """Starts a pool of multiprocessing, whose process imports the package anew."""
    from multiprocessing import get_context

    deadly = rz.RenderTask(CUBE, "deadly.png", load={"lights": Deadly()}, options=SMALL)
    with ProcessPoolExecutor(1, get_context("spawn")) as executor:
        assert {record.status for record in draw(tasks_of(), executor)} == {"drawn"}
        with pytest.raises(rz.RasterizerError, match="takes no tasks any more"):
            draw([deadly], executor)


def test_a_batch_may_be_drawn_beside_another_one_by_any_executor():
    """Local processes and a pool of threads, at one time; the bytes are the same."""
    with ThreadPoolExecutor(2) as executor:
        ways = ("processes", {"n_process": 1}), ("threads", {"executor": executor, "n_process": None})
        found = at_once(lambda k: draw(tasks_of(folder=ways[k][0]), **ways[k][1]), 2)
    assert [record.status for each in found for record in each] == ["drawn"] * 8
    for name in os.listdir("processes"):
        assert open(f"processes/{name}", "rb").read() == open(f"threads/{name}", "rb").read(), name


def test_a_task_takes_the_cameras_that_render_takes(folder):
    (folder / "a.gltf").write_bytes(rich_gltf())
    (folder / "eye.json").write_text('{"position": [3, 2, 4], "fov": 50}')
    (folder / "side.json").write_text('{"view": "left", "zoom": 2}')
    cameras = ("file", None, "frame", "eye.json", Path("side.json"), "file", "nope.json", "", 3)
    options = {"size": (24, 16), "samples": 1}
    tasks = [rz.RenderTask("a.gltf", f"{k}.png", camera=each, options=options) for k, each in enumerate(cameras)]
    with ThreadPoolExecutor(1) as executor:
        records = sorted(rz.render_many(tasks, executor), key=lambda record: record.index)
    errors = [None] * 6 + [rz.ModelError, rz.SceneError, rz.SceneError]
    assert [record.error and type(record.error) for record in records] == errors
    for record, camera in zip(records[:6], cameras, strict=False):
        expected = rz.render("a.gltf", **options, camera=camera, outputs="rgb").save("x.png")
        assert Path(record.output).read_bytes() == expected.read_bytes(), camera
    assert Path("0.png").read_bytes() == Path("5.png").read_bytes() != Path("1.png").read_bytes()
    with pytest.raises(rz.OptionError, match="RenderTask has no option 'size'"):
        rz.RenderTask("a.gltf", "x.png", size=3)
    with pytest.raises(rz.OptionError, match="did you mean existing"):
        rz.render_many(tasks, skip_existing=True)
