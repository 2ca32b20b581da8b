"""Processes of this machine, and the order in which work is given to whoever draws."""

import os
import subprocess
import sys

import pytest
from helpers.stores import environment_with

from rasterizer.batch.pools import MAX_SHARED, Done, Failed, Job, LocalPool, SharedObject


def add(argument, shared, kept):
    """What jobs do here."""
    kept["n"] = kept.get("n", 0) + 1
    return argument + (shared or 0), kept["n"], os.getpid()


def fail(argument, _shared, _kept):
    raise OddError(argument, "x")


class OddError(Exception):
    """Can be pickled, but not unpickled."""

    def __init__(self, one, two):
        super().__init__(f"{one} {two}")


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


class Unreadable:
    """Can be sent, but not be unpickled."""

    def __reduce__(self):
        return fail, (1, 2, 3)


@pytest.fixture(scope="module")
def pool():
    """One process, for all tests that leave one behind."""
    made = LocalPool(1)
    yield made
    made.close()
    assert made.n_running == 0


def ask(pool, *jobs):
    """The outcomes of jobs, one after the other."""
    found = []
    for job in jobs:
        pool.submit(job)
        found.append(pool.wait()[1])
    return found


def test_jobs_share_what_a_process_keeps_and_it_is_sent_once(pool, tmp_path):
    shared = [SharedObject(Counted(10 * k, tmp_path / "sent")) for k in range(MAX_SHARED + 1)]
    outcomes = ask(pool, *(Job(add, 1, each) for each in (shared[0], shared[0], *shared, shared[0])))
    sums, numbers, processes = zip(*(outcome.value for outcome in outcomes), strict=True)
    assert sums == (1, 1, 1, 11, 21, 1) and len(set(processes)) == 1
    assert numbers == tuple(range(numbers[0], numbers[0] + 6)), "what a process keeps stays"
    sent = (tmp_path / "sent").read_text().split()
    assert sent == ["0", "10", "20", "0"], "only what it had to forget is read again"
    folder = os.path.dirname(shared[0].sent)
    assert len(os.listdir(folder)) == len(shared)
    del shared, outcomes
    assert os.listdir(folder) == [], "what nobody needs any more goes away"


def test_errors_come_back_and_the_process_goes_on(pool):
    ((_, _, before),) = [outcome.value for outcome in ask(pool, Job(add, 1))]
    failed, unsendable, unreadable, unreturned, done = ask(
        pool, Job(fail, 7), Job(add, lambda: 0), Job(add, Unreadable()), Job("{0.__class__}".__format__, 1), Job(add, 2)
    )
    assert isinstance(failed, Failed) and "OddError: 7 x" in str(failed.error)
    assert {type(each) for each in (unsendable, unreadable, unreturned)} == {Failed}
    assert isinstance(done, Done) and done.value[2] == before


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
