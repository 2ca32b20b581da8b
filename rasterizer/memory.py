"""What the C library does with memory that was freed. Nothing but the standard library is imported."""

import sys

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # malloc.h


def keep_what_is_freed() -> None:
    """Let the C library hand out again what was freed, on any thread: of a model of millions of triangles, clearing new
    pages takes the system a third of all time, and of many small pictures a twentieth. Arrays of more than 32 MB go
    back at once all the same. Only processes of our own ask for that.

    Source: mallopt(3); other libraries than glibc have no such call.
    """
    import ctypes

    set_option = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if set_option is not None:
        for option, value in ((_M_MMAP_THRESHOLD, 2**25), (_M_TRIM_THRESHOLD, 2**30), (_M_ARENA_MAX, 1)):
            set_option(option, value)
