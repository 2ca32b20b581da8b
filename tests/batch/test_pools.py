"""The pool of local processes, and what they and their leader say to each other."""

import io
import os
import pickle
import subprocess
import sys
import time

import pytest
from helpers.deadly import Deadly
from helpers.stores import environment_with

from rasterizer.batch.pools import work_through
from rasterizer.errors import RasterizerError
from rasterizer.processes import (
    MAX_SHARED,
    Died,
    Done,
    Failed,
    Job,
    ProcessPool,
    SharedObject,
    pack_answer,
    read_message,
    serve,
    write_message,
)


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


@pytest.fixture(scope="module")
def pool():
    """One process, for all tests that leave one behind."""
    made = ProcessPool(1)
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
    shared = [SharedObject(Counted(10 * k, tmp_path / "sent"), str(k)) for k in range(MAX_SHARED + 1)]
    outcomes = ask(pool, *(Job(add, 1, each) for each in (shared[0], shared[0], *shared, shared[0])))
    sums, numbers, processes = zip(*(outcome.value for outcome in outcomes), strict=True)
    assert sums == (1, 1, 1, 11, 21, 1) and len(set(processes)) == 1
    assert numbers == tuple(range(numbers[0], numbers[0] + 6)), "what a process keeps stays"
    sent = (tmp_path / "sent").read_text().split()
    assert sent == ["0", "10", "20", "0"], "only what it had to forget is sent again"


def test_errors_come_back_and_the_process_goes_on(pool):
    failed, unsendable, done = ask(pool, Job(fail, 7), Job(add, lambda: 0), Job(add, 2))
    assert isinstance(failed, Failed) and "OddError: 7 x" in str(failed.error)
    assert isinstance(unsendable, Failed) and isinstance(done, Done)


def test_a_process_that_dies_is_replaced(pool):
    first, died, second = ask(pool, Job(add, 1), Job(add, Deadly()), Job(add, 1))
    assert died == Died("ended with exit code 9") and first.value[2] != second.value[2]


def test_the_first_job_is_alone_where_no_kernel_is_stored(tmp_path):
    """In a process whose store is empty; what is worked on is a method of text, which needs no kernel."""
    program = """
from rasterizer.batch.pools import Job, local_pool
from rasterizer.compiler.kernels import STORE
pool = local_pool(3)
assert STORE.is_kept and not pool.is_warm
n_slot = pool.n_slot
pool.submit(Job("{} {} {}".format, 1))
print(n_slot, pool.wait()[1].value, pool.n_slot)
pool.close()
"""
    environment = environment_with(RASTER_STORE=tmp_path / "store")
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
    assert done.stdout == "1 1 None {} 3\n", done.stderr


@pytest.mark.skipif(os.name != "posix", reason="a program that is a script")
def test_processes_that_can_not_be_started_are_told(monkeypatch, tmp_path):
    (tmp_path / "python").write_text("#!/bin/sh\nexit 5\n")
    (tmp_path / "python").chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))  # a Python that is broken, and none
    pool = ProcessPool(1)
    with pytest.raises(RasterizerError, match="can't be started: the first one ended with exit code 5"):
        ask(pool, Job(add, 1))
    pool.close()
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    with pytest.raises(RasterizerError, match="no process can be started"):
        ask(ProcessPool(1), Job(add, 1))


def wait_long(argument, _shared, _kept):
    time.sleep(argument)


@pytest.mark.skipif(os.name != "posix", reason="processes are looked for by a signal of POSIX")
def test_closing_ends_what_is_running(alone):
    pool = ProcessPool(1)
    (done,) = ask(pool, Job(add, 1))
    pool.submit(Job(wait_long, 60))
    start = time.monotonic()
    pool.close()
    with pytest.raises(ProcessLookupError):
        os.kill(done.value[2], 0)
    assert time.monotonic() - start < 15, "it waits for what was begun"


def test_messages_are_whole_or_none():
    stream = io.BytesIO()
    write_message(stream, b"")
    write_message(stream, bytes(range(256)) * 5)
    whole = stream.getvalue()
    stream.seek(0)
    assert read_message(stream) == b"" and read_message(stream) == bytes(range(256)) * 5
    for end in (0, 7, 12, len(whole) - 1):
        stream = io.BytesIO(whole[:end])
        with pytest.raises(EOFError):
            read_message(stream), read_message(stream)


def test_an_answer_that_can_not_be_sent_becomes_an_error():
    is_done, error = pickle.loads(pack_answer(True, lambda: 0))
    assert not is_done and "can't be sent" in str(error)
    assert pickle.loads(pack_answer(True, 5)) == (True, 5)


def test_a_message_that_is_no_job_is_answered():
    messages, answers = io.BytesIO(), io.BytesIO()
    write_message(messages, b"nonsense")
    messages.seek(0)
    with pytest.raises(EOFError):
        serve(messages, lambda answer: write_message(answers, answer))
    answers.seek(0)
    assert pickle.loads(read_message(answers))[0] is False


class ToyPool:
    """Does each job when it is waited for, the last one first; a job's argument says how often it dies."""

    is_here, n_slot = True, 2

    def __init__(self):
        self.jobs, self.most = [], 0

    @property
    def n_running(self):
        return len(self.jobs)

    def submit(self, job):
        self.jobs.append(job)
        self.most = max(self.most, len(self.jobs))

    def wait(self):
        job = self.jobs.pop()
        if job.argument > 0:
            return job, Died("died")
        return job, Done(job.note)


def test_work_goes_on_until_nothing_is_left():
    def jobs():
        for k in range(7):
            if k == 3:
                yield "passed on"
            job = Job(add, k % 3)
            job.note = k
            yield job

    def once_more(job, outcome):
        if isinstance(outcome, Done):
            return []
        again = Job(add, job.argument - 1)
        again.note = job.note
        return [again]

    pool = ToyPool()
    found = list(work_through(pool, jobs(), once_more))
    assert pool.most == 2 and ("passed on", None) in found
    assert sorted(outcome.value for _, outcome in found if outcome is not None) == list(range(7))
