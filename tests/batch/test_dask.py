"""The workers of Dask draw: the same bytes, whatever becomes of one of them."""

import os
import signal
import time

import pytest
from helpers.command import raster
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.batch.pools import DaskPool

MODELS = [str(ROOT / "models" / name) for name in ("cube.obj", "cone.obj", "gear.stl", "torus.glb")]
SMALL = {"size": (32, 24), "shading": "phong"}

pytestmark = pytest.mark.usefixtures("folder")


@pytest.fixture(scope="module")
def dask():
    return pytest.importorskip("dask.distributed", reason="the extra distributed is not installed")


@pytest.fixture(scope="module")
def cluster(dask):
    """Two worker processes; another one is started where one of them dies."""
    made = dask.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
    with made, dask.Client(made) as client:
        client.wait_for_workers(2)
        yield client


def tasks_of(sources, folder, views):
    for k, source in enumerate(sources):
        for view in views:
            yield rz.RenderTask(source, f"{folder}/{k}-{view}.png", view, options=SMALL)


def files_in(folder) -> dict[str, bytes]:
    return {name: open(f"{folder}/{name}", "rb").read() for name in os.listdir(folder)}


def assert_same_bytes(client, sources, views):
    """Draw as the library alone does, and by Dask."""
    with_dask = list(rz.render_many(tasks_of(sources, "far", views), client))
    assert {record.status for record in with_dask} == {"drawn"}, [record.error for record in with_dask]
    local = list(rz.render_many(tasks_of(sources, "local", views), n_process=1))
    assert len(local) == len(with_dask) and files_in("local") == files_in("far")


def assert_same_dataset(client):
    """Several files of each random view, and the manifest of all."""

    def dataset(folder):
        for seed in range(6):
            files = {"rgb": f"{folder}/{seed}.png", "depth": f"{folder}/{seed}.npy", "object": f"{folder}/{seed}.npz"}
            yield rz.RenderTask(MODELS[seed // 3], files, "random", options=SMALL, lights="random", seed=seed)

    with_dask = list(rz.render_many(dataset("set-far"), client, manifest="set-far/m.jsonl"))
    assert {record.status for record in with_dask} == {"drawn"}, [record.error for record in with_dask]
    list(rz.render_many(dataset("set-local"), n_process=2, manifest="set-local/m.jsonl"))
    assert files_in("set-local") == files_in("set-far") and len(files_in("set-far")) == 19


def test_a_thread_of_dask_draws_the_same_bytes(dask):
    with dask.Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None) as client:
        assert_same_bytes(client, [MODELS[0], rz.load(MODELS[1])], ("front", "iso"))
        assert_same_dataset(client)
        pool = DaskPool(client)
        assert pool.n_slot == 2 and DaskPool(client, 3).n_slot == 6
        pool.close()
        assert client.status == "running"


@pytest.mark.nightly
def test_the_bytes_are_those_of_local_processes(cluster):
    assert_same_bytes(cluster, [*MODELS, rz.load(MODELS[0]), rz.load(MODELS[2]).meshes[0]], ("front", "iso"))
    assert_same_dataset(cluster)
    by_address = rz.render_many(tasks_of(MODELS[:1], "address", ("front",)), cluster.scheduler.address)
    assert [record.status for record in by_address] == ["drawn"]
    assert files_in("address")["0-front.png"] == files_in("far")["0-front.png"]


def scenes_in(cluster) -> list[tuple[str, ...]]:
    """Return the addresses of the workers that hold it, a scene each."""
    return [addresses for key, addresses in cluster.who_has().items() if str(key).startswith("Scene")]


@pytest.mark.nightly
def test_a_worker_that_is_killed_half_way_loses_nothing(cluster, alone):
    """The worker that has the scattered model is the one that dies: it must be sent anew."""
    views = [(angle, 20) for angle in range(0, 360, 9)]
    scene = rz.load(MODELS[2])
    local = list(rz.render_many(tasks_of([scene], "local", views), n_process=1))
    while scenes_in(cluster):  # those of the test before, which is over
        time.sleep(0.01)
    batch = rz.render_many(tasks_of([scene], "far", views), cluster)
    records = [next(batch)]
    ((address,),) = scenes_in(cluster)
    (pid,) = (worker.pid for worker in cluster.cluster.workers.values() if worker.worker_address == address)
    os.kill(pid, signal.SIGKILL)  # as the system does that has no memory left
    records += list(batch)
    assert [record.error for record in records] == [None] * len(local)
    assert files_in("local") == files_in("far") and len(files_in("far")) == 40
    cluster.wait_for_workers(2)


@pytest.mark.nightly
def test_the_command_line_draws_there(cluster, capsys):
    flags = ["-s", "32x24", "--view", "iso", "--view", "top", "-q"]
    assert raster("batch", *MODELS[:2], "-o", "far/", "--scheduler", cluster.scheduler.address, *flags) == 0
    os.mkdir("local")
    assert raster("render", *MODELS[:2], "-o", "local/", *flags) == 0
    assert files_in("far") == files_in("local") and len(files_in("far")) == 4
    assert capsys.readouterr() == ("", "")
