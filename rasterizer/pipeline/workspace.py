"""What a thread needs to draw a band, kept from band to band and from picture to picture."""

from typing import NamedTuple

import numpy as np

from .a_buffer import Room
from .fragments import BATCH_SHAPE
from .resolve import Picture, PixelBatch, make_pixel_batch
from .setup import Block, make_block
from .texcoords import make_lookup_batch
from .triangle_setups import TriangleSetups, make_triangle_setups
from .visibility import VisibilityBuffer, make_extents, make_visibility_buffer


class Workspace(NamedTuple):
    """What one thread works on."""

    visibility: VisibilityBuffer
    setups: TriangleSetups
    block: Block  # of triangles, for the scan stage
    radiance: np.ndarray  # (n_channel, n_row * pitch), linear intensities
    batch: np.ndarray  # of fragments, float32, for lighting
    double_batch: np.ndarray  # the same in float64
    lookup_batch: np.ndarray  # of samples, for looking textures up
    pixels: PixelBatch  # for the resolve stage
    alphas: np.ndarray  # (n_row * pitch,) float32, what textures let through; no rows where none of either is there
    # None where the scene has no transparent surfaces:
    room: Room | None  # for the A-buffer
    extents: VisibilityBuffer | None  # clear, without packed samples: for those of transparent surfaces


class WorkspaceShape(NamedTuple):
    """What a workspace is made for."""

    width: int  # samples
    n_row: int  # of a band
    n_channel: int
    n_attribute: int
    dtype: np.dtype  # of intensities
    is_textured: bool
    is_transparent: bool


class WorkspacePool:
    """Workspaces that are free. Taking from a list and giving back are atomic, so threads may share it.

    What is taken and not given back, because drawing failed half-way, is forgotten: a visibility buffer that isn't
    clear is never used again.
    """

    def __init__(self):
        self._free = {}

    def acquire(self, shape: WorkspaceShape, n_setup: int) -> Workspace:
        """Return a clear workspace with room for `n_setup` setups; a new one where none of its shape is free."""
        try:
            workspace = self._free.setdefault(shape, []).pop()
        except IndexError:  # asking first whether there is one would leave room for another thread to take it
            workspace = make_workspace(shape, n_setup)
        if len(workspace.setups.integers) < n_setup:
            setups = make_triangle_setups(n_setup, shape.n_attribute)
            workspace = workspace._replace(setups=setups)
        return workspace

    def release(self, shape: WorkspaceShape, workspace: Workspace) -> None:
        """Return a workspace to the pool; its visibility buffer is clear."""
        self._free[shape].append(workspace)


def make_workspace(shape: WorkspaceShape, n_setup: int) -> Workspace:
    """Return a clear workspace with room for `n_setup` setups."""
    visibility = make_visibility_buffer(shape.width, shape.n_row)
    n_sample = len(visibility.packed)
    return Workspace(
        visibility,
        make_triangle_setups(max(n_setup, 1), shape.n_attribute),
        make_block(),
        np.zeros((shape.n_channel, n_sample), shape.dtype),
        np.zeros(BATCH_SHAPE, np.float32),
        np.zeros(BATCH_SHAPE),
        make_lookup_batch() if shape.is_textured else np.zeros(0, np.float32),
        make_pixel_batch(),
        np.zeros(n_sample if shape.is_textured and shape.is_transparent else 0, np.float32),
        Room() if shape.is_transparent else None,
        make_extents(shape.n_row) if shape.is_transparent else None,
    )


def make_picture(size, with_color, rgba=None) -> Picture:
    """Return room for a picture of `size` = (width, height) pixels; every pixel of it is written.

    `rgba` is what takes its bytes, (height, width) uint32, or None for a new array.
    """
    width, height = size
    n_row = height if with_color else 0
    return Picture(
        np.empty((n_row, width, 3), np.float32),
        np.empty((height, width), np.uint32) if rgba is None else rgba,
        np.empty((n_row, width), np.float32),
    )
