"""A band that was never scanned, resolved: help for the tests of the resolve and the encode stage."""

import numpy as np

from rasterizer.pipeline.resolve import RANGE_CLAMP, Encoding, make_grid, resolve, with_blank
from rasterizer.pipeline.visibility import CLEAR
from rasterizer.pipeline.workspace import WorkspaceShape, make_picture, make_workspace
from rasterizer.scene.color import srgb_from_linear


def encoding(policy=RANGE_CLAMP, background=None, scale=1.0, tint=(1.0, 1.0, 1.0)):
    """How linear colour becomes 8 bits."""
    behind = np.array(background or (0, 0, 0), np.float32)
    return with_blank(Encoding(False, np.array(tint, np.float32), behind, background is not None, policy, scale))


def fill(covered, radiance, dtype=np.float32):
    """A workspace with the intensities (n_channel, rows, columns) where `covered`, rubbish elsewhere."""
    n_row, width = covered.shape
    workspace = make_workspace(WorkspaceShape(width, n_row, len(radiance), 1, np.dtype(dtype), 0, False), 1)
    visibility = workspace.visibility
    workspace.radiance[:] = 77.0
    workspace.radiance.reshape(len(radiance), n_row, visibility.pitch)[:, :, :width] = np.where(covered, radiance, 1e9)
    packed = visibility.packed.reshape(n_row, visibility.pitch)
    packed[:, :width][covered] = np.arange(covered.sum()) + 5
    for row, columns in enumerate(covered):
        if columns.any():
            visibility.left[row >> 3] = min(visibility.left[row >> 3], np.argmax(columns))
            visibility.right[row >> 3] = max(visibility.right[row >> 3], width - np.argmax(columns[::-1]))
    # What lanes read and write back behind a row.
    packed[:, width:] = CLEAR
    return workspace


def run(covered, radiance, how, factor=1, dtype=np.float32, with_color=True, height=None, y_start=0):
    """Resolve one band; return (picture, bytes (h, w, 4), workspace, samples covered)."""
    workspace = fill(covered, radiance, dtype)
    n_row, width = covered.shape[0] // factor, covered.shape[1] // factor
    picture = make_picture((width, height or n_row), with_color)
    for array in picture:
        array.fill(0)
    rows, grid = (y_start, y_start + n_row), make_grid(factor)
    n_covered = resolve(workspace.visibility, workspace.radiance, None, rows, grid, how, workspace.pixels, picture)
    return picture, picture.rgba.view(np.uint8).reshape(*picture.rgba.shape, 4), workspace, n_covered


def levels(linear):
    """The nearest level of the sRGB curve in float64."""
    return np.rint(255 * srgb_from_linear(np.clip(np.asarray(linear, np.float64), 0, 1))).astype(int)
