"""Check the threads that share work: all of it is done, once, and errors and the end of it are told."""

import gc
import threading
import time

import pytest

from rasterizer.cores import Workers


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
