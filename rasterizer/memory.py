"""What the system does for a process's memory. Nothing but the standard library is imported, and only processes of our
own ask for any of this.
"""

import os
import sys

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # malloc.h


def keep_what_is_freed() -> None:
    """Let the C library hand out again what was freed, on any thread: of a model of millions of triangles, clearing new
    pages takes the system a third of all time, and of many small pictures a twentieth. Arrays of more than 32 MB go
    back at once all the same.

    Source: mallopt(3); other libraries than glibc have no such call.
    """
    import ctypes

    set_option = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if set_option is not None:
        for option, value in ((_M_MMAP_THRESHOLD, 2**25), (_M_TRIM_THRESHOLD, 2**30), (_M_ARENA_MAX, 1)):
            set_option(option, value)


def take_small_pages() -> None:
    """Let NumPy, which isn't imported yet, ask for no huge pages: those of a process that soon ends are mostly touched
    once. To a virtual machine, whose host takes back what is free, huge pages come late: there the command takes 0.75
    to 0.95 of the time without them, from a million triangles or some large textures on. Many pictures of ten million
    triangles are drawn faster with them, 1.4 times.

    Source: NumPy's manual, "Global configuration options", Madvise hugepage on Linux.
    """
    os.environ.setdefault("NUMPY_MADVISE_HUGEPAGE", "0")
