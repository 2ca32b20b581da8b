"""The workers of Dask draw: the same bytes, whatever becomes of one of them."""

import os
import signal

import pytest
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.batch.executors import DaskCrew
from rasterizer.cli import main

MODELS = [str(ROOT / "models" / name) for name in ("cube.obj", "cone.obj", "gear.stl", "torus.glb")]
SMALL = {"size": (32, 24), "shading": "phong"}

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.slow]


@pytest.fixture(scope="module")
def cluster():
    """Two worker processes; another one is started where one of them dies."""
    distributed = pytest.importorskip("dask.distributed", reason="the extra distributed is not installed")
    made = distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
    with made, distributed.Client(made) as client:
        client.wait_for_workers(2)
        yield client


def tasks_of(sources, folder, views):
    for k, source in enumerate(sources):
        for view in views:
            yield rz.RenderTask(source, f"{folder}/{k}-{view}.png", view, options=SMALL)


def files_in(folder) -> dict[str, bytes]:
    return {name: open(f"{folder}/{name}", "rb").read() for name in os.listdir(folder)}


def kill_worker(client, address=None):
    """Kill the process of a worker as the system does that has no memory left."""
    for worker in client.cluster.workers.values():
        if address is None or worker.worker_address == address:
            os.kill(worker.pid, signal.SIGKILL)
            return
    raise AssertionError(f"no worker at {address}")


def test_the_bytes_are_those_of_local_processes(cluster):
    sources = [*MODELS, rz.load(MODELS[0]), rz.load(MODELS[2]).meshes[0]]
    local = list(rz.render_many(tasks_of(sources, "local", ("front", "iso")), n_process=1))
    far = list(rz.render_many(tasks_of(sources, "far", ("front", "iso")), cluster))
    assert {record.status for record in (*local, *far)} == {"drawn"}, [record.error for record in far]
    assert files_in("local") == files_in("far") and len(files_in("far")) == 12
    by_address = rz.render_many(tasks_of(MODELS[:1], "address", ("front",)), cluster.scheduler.address)
    assert [record.status for record in by_address] == ["drawn"]
    assert files_in("address")["0-front.png"] == files_in("far")["0-front.png"]


def test_a_worker_that_is_killed_half_way_loses_nothing(cluster):
    """The worker that has the scattered model is the one that dies: it must be sent anew."""
    views = [(angle, 20) for angle in range(0, 360, 9)]
    scene = rz.load(MODELS[2])
    local = list(rz.render_many(tasks_of([scene], "local", views), n_process=1))
    batch = rz.render_many(tasks_of([scene], "far", views), cluster)
    records = [next(batch)]
    (addresses,) = cluster.who_has(next(iter(batch._objects.values())).sent).values()
    kill_worker(cluster, addresses[0])
    records += list(batch)
    assert [record.error for record in records] == [None] * len(local)
    assert files_in("local") == files_in("far") and len(files_in("far")) == 40


def test_a_model_goes_to_each_worker_once(cluster, monkeypatch):
    sent = []
    scatter = cluster.scatter
    monkeypatch.setattr(cluster, "scatter", lambda value, **settings: sent.append(value) or scatter(value, **settings))
    scene = rz.load(MODELS[0])
    views = [(angle, 20) for angle in range(0, 360, 15)]
    assert {record.status for record in rz.render_many(tasks_of([scene], "far", views), cluster)} == {"drawn"}
    assert sent == [scene]


def test_a_model_that_workers_do_not_see_is_sent(cluster, monkeypatch):
    """What a worker finds at the path is not the file that is here: another time of change."""
    monkeypatch.setattr("rasterizer.batch.rendering.identify", lambda path: (1, 2))
    list(rz.render_many(tasks_of(MODELS[:2], "local", ("front", "iso")), n_process=1))
    records = list(rz.render_many(tasks_of(MODELS[:2], "far", ("front", "iso")), cluster))
    assert [record.error for record in records] == [None] * 4
    assert files_in("local") == files_in("far")


def test_one_bad_model_does_not_stop_the_rest(cluster, folder):
    (folder / "bad.obj").write_text("v 1 2\n")
    tasks = [*tasks_of(["bad.obj", "nope.obj", MODELS[0]], "far", ("front",))]
    by_index = {record.index: record for record in rz.render_many(tasks, cluster)}
    assert "bad.obj:1" in str(by_index[0].error) and "nope.obj: no such file" in str(by_index[1].error)
    assert by_index[2].status == "drawn"


def test_the_command_line_draws_there(cluster, capsys):
    flags = ["-s", "32x24", "--view", "iso", "--view", "top", "-q"]
    assert main(["batch", *MODELS[:2], "-o", "far/", "--scheduler", cluster.scheduler.address, *flags]) == 0
    os.mkdir("local")
    assert main(["render", *MODELS[:2], "-o", "local/", *flags]) == 0
    assert files_in("far") == files_in("local") and len(files_in("far")) == 4
    assert capsys.readouterr() == ("", "")


def test_the_crew_has_work_for_each_thread(cluster):
    cluster.wait_for_workers(2)  # another test has killed one
    crew = DaskCrew(cluster)
    assert crew.n_slot == 4 and DaskCrew(cluster, 3).n_slot == 6
    crew.close()
    assert cluster.status == "running"


def test_tiles_are_drawn_there(cluster):
    for output, source in (("a.tif", MODELS[2]), ("b.tif", rz.load(MODELS[2]))):
        task = rz.RenderTask(source, output, "iso", options=SMALL | {"color_range": "global", "exposure": 2.0})
        rz.render_tiles(task, cluster, n_tile=6)
    list(rz.render_many([rz.RenderTask(MODELS[2], "c.tif", "iso", options=task.options)], n_process=1))
    assert open("a.tif", "rb").read() == open("b.tif", "rb").read() == open("c.tif", "rb").read()
