"""The crew of local processes, and what they and their leader say to each other."""

import io
import os
import pickle
import sys
import time

import pytest
from helpers.deadly import Deadly

from rasterizer.batch import processes
from rasterizer.batch.crew import Died, Done, Failed, SharedObject, Unit, work_through
from rasterizer.batch.processes import LocalProcesses
from rasterizer.batch.worker import MOST_SHARED, pack_answer, read_message, serve, write_message
from rasterizer.errors import RasterizerError


def add(argument, shared, kept):
    """What units do here."""
    kept["n"] = kept.get("n", 0) + 1
    return argument + (shared or 0), kept["n"], os.getpid()


def fail(argument, _shared, _kept):
    raise OddError(argument, "x")


class OddError(Exception):
    """Can be pickled, but not unpickled."""

    def __init__(self, one, two):
        super().__init__(f"{one} {two}")


@pytest.fixture
def crew():
    made = LocalProcesses(1)
    yield made
    made.close()


def ask(crew, *units):
    """The outcomes of units, one after the other."""
    found = []
    for unit in units:
        crew.submit(unit)
        found.append(crew.wait()[1])
    return found


def test_units_share_what_a_process_keeps(crew):
    shared = [SharedObject(10 * k, str(k)) for k in range(MOST_SHARED + 1)]
    outcomes = ask(crew, *(Unit(add, 1, each) for each in (shared[0], shared[0], *shared, shared[0])))
    assert [outcome.value[:2] for outcome in outcomes] == [(1, 1), (1, 2), (1, 3), (11, 4), (21, 5), (1, 6)]
    assert len({outcome.value[2] for outcome in outcomes}) == 1


def test_what_a_process_has_is_not_sent_again(crew, monkeypatch):
    sizes = []
    write = processes.write_message
    monkeypatch.setattr(processes, "write_message", lambda stream, text: sizes.append(len(text)) or write(stream, text))
    shared = SharedObject(1, "one")
    shared.sent = pickle.dumps(1) + bytes(10**6)  # pickle stops before the zeros
    ask(crew, Unit(add, 1, shared), Unit(add, 1, shared))
    assert max(sizes) > 10**6 and sizes[-1] < 10**3


def test_errors_come_back_and_the_process_goes_on(crew):
    failed, unsendable, done = ask(crew, Unit(fail, 7), Unit(add, lambda: 0), Unit(add, 2))
    assert isinstance(failed, Failed) and "OddError: 7 x" in str(failed.error)
    assert isinstance(unsendable, Failed) and isinstance(done, Done)


def test_a_process_that_dies_is_replaced(crew):
    first, died, second = ask(crew, Unit(add, 1), Unit(add, Deadly()), Unit(add, 1))
    assert died == Died("ended with exit code 9") and first.value[2] != second.value[2]


def test_the_first_unit_is_alone_where_no_kernel_is_stored(monkeypatch):
    monkeypatch.setattr(processes, "has_kernels", lambda: False)
    crew = LocalProcesses(3)
    assert crew.n_slot == 1 or not processes.STORE.is_kept
    ask(crew, Unit(add, 1))
    assert crew.n_slot == 3
    crew.close()
    assert crew.n_running == 0


def test_processes_that_can_not_be_started_are_told(monkeypatch):
    monkeypatch.setattr(processes, "_PROGRAM", "import sys; sys.exit(5)")
    crew = LocalProcesses(1)
    with pytest.raises(RasterizerError, match="can't be started: the first one ended with exit code 5"):
        ask(crew, Unit(add, 1))
    crew.close()
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    with pytest.raises(RasterizerError, match="no process can be started"):
        ask(LocalProcesses(1), Unit(add, 1))


def wait_long(argument, _shared, _kept):
    time.sleep(argument)


def test_closing_ends_what_is_running():
    crew = LocalProcesses(2)
    ask(crew, Unit(add, 1))
    crew.submit(Unit(wait_long, 60))
    running = [worker._process for worker in crew._workers]
    start = time.monotonic()
    crew.close()
    assert all(process.poll() is not None for process in running) and time.monotonic() - start < 15


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


def test_a_message_that_is_no_unit_is_answered():
    messages, answers = io.BytesIO(), io.BytesIO()
    write_message(messages, b"nonsense")
    messages.seek(0)
    with pytest.raises(EOFError):
        serve(messages, answers)
    answers.seek(0)
    assert pickle.loads(read_message(answers))[0] is False


class ToyCrew:
    """Does each unit when it is waited for, the last one first; a unit's argument says how often it dies."""

    is_here, n_slot = True, 2

    def __init__(self):
        self.units, self.most = [], 0

    @property
    def n_running(self):
        return len(self.units)

    def submit(self, unit):
        self.units.append(unit)
        self.most = max(self.most, len(self.units))

    def wait(self):
        unit = self.units.pop()
        if unit.argument > 0:
            return unit, Died("died")
        return unit, Done(unit.note)


def test_work_goes_on_until_nothing_is_left():
    def units():
        for k in range(7):
            if k == 3:
                yield "passed on"
            unit = Unit(add, k % 3)
            unit.note = k
            yield unit

    def once_more(unit, outcome):
        if isinstance(outcome, Done):
            return []
        again = Unit(add, unit.argument - 1)
        again.note = unit.note
        return [again]

    crew = ToyCrew()
    found = list(work_through(crew, units(), once_more))
    assert crew.most == 2 and ("passed on", None) in found
    assert sorted(outcome.value for _, outcome in found if outcome is not None) == list(range(7))
