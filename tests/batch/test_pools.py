"""Processes of this machine, and the order in which work is given to whoever draws."""

import os
import subprocess
import sys

import pytest
from helpers.stores import environment_with

from rasterizer.batch.pools import MAX_SHARED, Job, LocalPool, SharedObject


def add(argument, shared, kept):
    """What jobs do here."""
    kept["n"] = kept.get("n", 0) + 1
    return argument + shared, kept["n"], os.getpid()


class Counted:
    """A number that leaves a line in a file each time that it is unpickled."""

    def __init__(self, value, path):
        self.value, self.path = value, str(path)

    def __reduce__(self):
        return unpickle_counted, (self.value, self.path)


def unpickle_counted(value, path):
    with open(path, "a") as file:
        file.write(f"{value}\n")
    return value


def test_jobs_share_what_a_process_keeps_and_it_is_sent_once(tmp_path):
    pool, outcomes = LocalPool(1), []
    shared = [SharedObject(Counted(10 * k, tmp_path / "sent")) for k in range(MAX_SHARED + 1)]
    for each in (shared[0], shared[0], *shared, shared[0]):
        pool.submit(Job(add, 1, each))
        outcomes.append(pool.wait()[1].value)
    assert outcomes == [(total, k, outcomes[0][2]) for k, total in enumerate((1, 1, 1, 11, 21, 1), 1)]
    assert (tmp_path / "sent").read_text().split() == ["0", "10", "20", "0"], "what it had to forget is read again"
    folder = os.path.dirname(shared[0].sent)
    assert len(os.listdir(folder)) == len(shared)
    shared.clear()
    del each
    assert os.listdir(folder) == [], "what nobody needs any more goes away"
    pool.close()


@pytest.mark.skipif(os.name != "posix", reason="a program that is a script")
@pytest.mark.parametrize("program", ["#!/bin/sh\nexit 5\n", None])
def test_processes_that_can_not_be_started_are_told(program, tmp_path):
    """By a Python that is broken, or none, in a program of its own: loky keeps what it has started."""
    (tmp_path / "python").write_text(program or "")
    (tmp_path / "python").chmod(0o700 if program else 0)
    code = f"""
import sys
sys.executable = {str(tmp_path / "python")!r}
import rasterizer as rz
try:
    list(rz.render_many([rz.RenderTask("a.obj", f"{{k}}.png") for k in range(9)], n_process=2))
except rz.RasterizerError as fault:
    print(fault)
"""
    command, environment = [sys.executable, "-W", "ignore", "-c", code], environment_with()
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert "process" in done.stdout and "be started" in done.stdout, done.stderr


@pytest.mark.skipif(os.name != "posix", reason="descriptors of POSIX")
@pytest.mark.parametrize("closed", ["2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_a_batch_is_drawn_without_standard_streams(closed, folder):
    code = (
        "import rasterizer as rz; mesh = rz.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [[0, 1, 2]]); "
        "list(rz.render_many([rz.RenderTask(mesh, f'{k}.png', options={'size': 20}) for k in range(4)], n_process=2))"
    )
    subprocess.run(["sh", "-c", f'"{sys.executable}" -c "{code}" {closed}'], env=environment_with(), timeout=120)
    assert sorted(os.listdir()) == [f"{k}.png" for k in range(4)]
