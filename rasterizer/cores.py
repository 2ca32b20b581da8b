"""How many processors this process may use, and work beside that of the caller; nothing but the standard library is
imported."""

import os
import threading
from collections.abc import Iterable, Iterator
from contextvars import copy_context
from queue import SimpleQueue
from typing import TypeVar

_T = TypeVar("_T")


def n_core() -> int:
    """Return how many threads or processes can work at the same time."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def ahead(items: Iterable[_T], n_item: int) -> Iterator[_T]:
    """Yield items that a thread of their own takes from an iterable, up to `n_item` of them before they are asked for.

    What that raises is raised here. With one processor nothing is taken ahead.
    """
    if n_core() == 1:
        yield from items
        return
    taken: SimpleQueue = SimpleQueue()  # pairs of an item, or what was raised, and whether it is an item
    room, is_over = threading.Semaphore(n_item), threading.Event()

    def take() -> None:
        end: BaseException | None = None
        try:
            for item in items:
                taken.put((item, True))
                room.acquire()
                if is_over.is_set():
                    return
        except BaseException as fault:  # noqa: BLE001  raised where items are asked for
            end = fault
        taken.put((end, False))

    helper = threading.Thread(target=copy_context().run, args=(take,), daemon=True)
    helper.start()
    try:
        while (got := taken.get())[1]:
            yield got[0]
            room.release()
        if got[0] is not None:
            raise got[0]
    finally:  # also where no more items are wanted
        is_over.set()
        room.release()
        helper.join()
