"""How much memory a frame takes, and whether the machine has it: systems promise more than they have, and end the
process that asks them to keep it."""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError, shown
from ..options import Options
from .buffers import BUFFER_TABLE

ALWAYS_THERE = 2**28  # bytes; for less the system is not asked
EDGE_BYTES = 8  # a sample, where edges are drawn: its depth, and the share that they cover
MEMORY_INFO = "/proc/meminfo"  # Linux: "MemAvailable" is what is free, or can be freed
MEMORY_LIMIT = "/sys/fs/cgroup/memory.max"  # of a container


def check_memory(options: Options, has_out: bool) -> None:
    """Refuse a picture that this machine's memory can't hold, before the system ends the process for it.

    Parameters
    ----------
    options : what is drawn
    has_out : whether the caller has brought the room for the bytes

    Raises SceneError, which says what to do.
    """
    width, height = options.size
    needed = width * height * count_pixel_bytes(options, has_out)
    if needed <= ALWAYS_THERE:
        return
    available = available_memory()
    if available is not None and needed > available:
        raise SceneError(
            f"a picture of {width}x{height} pixels takes {needed / 1e9:.3g} GB in memory, and {available / 1e9:.3g} GB "
            "are there: draw a smaller one"
        )


def count_pixel_bytes(options: Options, has_out: bool) -> int:
    """Return how many bytes of memory a pixel of a frame takes; the caller has brought those of its colour where
    `has_out`."""
    outputs, n_byte = set(options.outputs), 0
    if outputs & {"color", "rgb"}:
        n_byte += 0 if has_out else 4
        n_byte += 16 if "color" in outputs or options.color_range == "global" else 0
    n_byte += EDGE_BYTES * options.factor**2 if options.edges else 0
    buffers = [BUFFER_TABLE[name] for name in outputs - {"color", "rgb"}]
    return n_byte + sum(np.dtype(buffer.dtype).itemsize * buffer.n_component for buffer in buffers)


def available_memory() -> int | None:
    """Return how many bytes this process may ask for; None where the system doesn't tell."""
    found = []
    try:
        words = Path(MEMORY_INFO).read_text().split()
        found.append(1024 * int(words[words.index("MemAvailable:") + 1]))
        found.append(int(Path(MEMORY_LIMIT).read_text()))
    except (OSError, ValueError):  # another system, or no limit
        pass
    if not found and hasattr(os, "sysconf") and {"SC_PHYS_PAGES", "SC_PAGE_SIZE"} <= set(os.sysconf_names):
        found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    return min(found, default=None)


def checked_out(out: object, options: Options) -> NDArray[np.uint32]:
    """Return the array that takes the bytes of a picture, as (height, width) uint32."""
    width, height = options.size
    if not {"color", "rgb"} & set(options.outputs):
        raise SceneError("out takes a picture: ask for it with outputs=('color', ...) or ('rgb', ...)")
    is_fit = isinstance(out, np.ndarray) and out.shape == (height, width, 4) and out.dtype == np.uint8
    if not (is_fit and out.flags.c_contiguous and out.flags.writeable and out.ctypes.data % 4 == 0):
        given = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else shown(out)
        legal = f"a writable array ({height}, {width}, 4) of uint8, without gaps, at a multiple of 4 bytes"
        raise SceneError(f"out must be {legal}; given {given}")
    return np.asarray(out).view(np.uint32).reshape(height, width)
