"""What a thread needs to draw a band, kept from band to band and from picture to picture."""

from typing import NamedTuple

import numpy as np

from .a_buffer import Layers, make_layers
from .buffers import Buffers
from .clip import NO_PLANES
from .fragments import make_batch
from .records import ATTRIBUTE, N_INTEGER, PLANE, Records
from .resolve import Picture
from .scan import CLEAR, GROUP_SHIFT, PADDING, Canvas
from .setup import Block, make_block
from .simd import GROUP


class Bench(NamedTuple):
    """One thread's working place."""

    canvas: Canvas
    records: Records
    block: Block  # the scan stage's rows
    radiance: np.ndarray  # (n_channel, rows * pitch)
    batch: np.ndarray  # see fragments.py
    texels: np.ndarray  # (4, rows * pitch), no planes where the scene has no textures
    layers: Layers  # with room only where the scene has transparent surfaces


class BenchKind(NamedTuple):
    """What a working place is made for."""

    width: int
    n_row: int
    n_channel: int
    n_attribute: int
    n_group: int  # of planes in a record
    dtype: np.dtype
    is_textured: bool
    is_layered: bool


class Scratch:
    """Working places that are free. Taking from a list and giving back are atomic, so threads may share it.

    What is taken and not given back, because drawing failed half-way, is forgotten: a z-buffer that isn't clean is
    never used again.
    """

    def __init__(self):
        self._free = {}

    def take(self, kind, n_record) -> Bench:
        """Return a working place of this kind that is clean, with room for the records; a new one where none is
        free."""
        try:
            bench = self._free.setdefault(kind, []).pop()
        except IndexError:  # asking first whether there is one would leave room for another thread to take it
            bench = _make_bench(kind)
        if len(bench.records.integers) < n_record:
            bench = bench._replace(records=_make_records(n_record, kind.n_attribute, kind.n_group, kind.dtype))
        return bench

    def give_back(self, kind, bench: Bench) -> None:
        """Return a working place; its z-buffer is clean."""
        self._free[kind].append(bench)


def _make_bench(kind) -> Bench:
    width, n_row = kind.width, kind.n_row
    pitch = (width + PADDING + 7) // 8 * 8
    n_group = (n_row >> GROUP_SHIFT) + 1
    left, right = np.full(n_group, 1 << 30, np.int64), np.full(n_group, -1, np.int64)
    canvas = Canvas(np.full(n_row * pitch, CLEAR), pitch, width, left, right)
    radiance = np.zeros((kind.n_channel, n_row * pitch), kind.dtype)
    records = _make_records(1, kind.n_attribute, kind.n_group, kind.dtype)
    n_sample = n_row * pitch
    n_layered = n_sample if kind.is_layered else 0
    texels = np.zeros((4 if kind.is_textured else 0, n_sample), kind.dtype)
    layers = make_layers(n_layered, n_group, kind.n_channel)
    return Bench(canvas, records, make_block(), radiance, make_batch(kind.dtype), texels, layers)


def _make_records(n, n_attribute, n_group, dtype) -> Records:
    # Only what is written to becomes memory, so both kinds of records may have room for every triangle.
    shift = (PLANE + 3 * GROUP * n_group - 1).bit_length()
    levels = np.zeros(n << shift, np.int32)
    return Records(
        np.zeros((n, N_INTEGER), np.int32), np.zeros((n, ATTRIBUTE + 3 * n_attribute), dtype), levels, levels.view(np.float32),
        shift, NO_PLANES,
    )  # fmt: skip


def make_picture(size, with_color) -> Picture:
    """Room for a picture; every pixel of it is written."""
    width, height = size
    n_row = height if with_color else 0
    return Picture(
        np.empty((n_row, width, 3), np.float32),
        np.empty((height, width), np.uint32),
        np.empty((n_row, width), np.float32),
    )


def empty_buffers(size, names) -> Buffers:
    """Buffers with nothing visible; those that aren't named have no rows."""
    width, height = size

    def rows(name):
        return height if name in names else 0

    return Buffers(
        np.full((rows("depth"), width), np.inf, np.float32),
        np.full((rows("face"), width), -1, np.int32),
        np.zeros((rows("normal"), width, 3), np.float32),
    )
