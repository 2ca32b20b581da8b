"""Bands of scenes with transparent surfaces: the A-buffer takes the place of the one scan (pipeline/a_buffer.py)."""

import numpy as np

from ..pipeline.a_buffer import (
    FEW,
    FragmentLists,
    composite,
    divide_room,
    list_fragments,
    open_lists,
    order_by_depth,
    show_nearest,
    split_samples,
)
from ..pipeline.bands import Band, Rows
from ..pipeline.scan import Deferred
from .passes import Pass


def draw_transparent_band(band: Band, drawn, render_pass: Pass, workspace, counts, transparent: Deferred) -> None:
    """List the fragments of a band's transparent triangles before the opaque surfaces, which are drawn, and composite
    what each sample shows.

    Parameters
    ----------
    drawn : the triangles (draw.py)
    counts : ScanCounts of the band
    transparent : what the scan stage has left to be listed
    """
    transparent = count_fragments(band, drawn, workspace, transparent)
    pitch = workspace.visibility.pitch
    for first, last in split_samples(workspace.a_buffer.starts[: band.n_row * pitch + 1], pitch):
        composite_range(band, drawn, render_pass, workspace, counts, transparent, (first, last))


def count_fragments(band: Band, drawn, workspace, transparent: Deferred) -> Deferred:
    """Count the fragments of each sample and divide the room among their lists; return the transparent triangles in the
    order in which the lists are filled."""
    a_buffer, n_sample = workspace.a_buffer, band.n_row * workspace.visibility.pitch
    counting = FragmentLists(0, n_sample, 0, band.n_row, np.empty(0, np.int64), a_buffer.cursors, a_buffer.starts, True)
    rows = Rows(band.y_start, band.y_end)
    open_lists(a_buffer)
    triangles, vertices, *_ = drawn.drawables
    list_fragments(
        band.y_start, transparent, triangles, vertices, rows, workspace.block, workspace.visibility, counting
    )
    n_fragment, n_list = divide_room(a_buffer, n_sample)
    if n_fragment > FEW * n_list:
        return order_by_depth(transparent, drawn.drawables)
    return transparent


def composite_range(band: Band, drawn, render_pass: Pass, workspace, counts, transparent, samples) -> None:
    """Fill the lists of the samples first..last of a band, then shade one layer after the other, nearest first, and sum
    them up."""
    visibility, a_buffer, (first, last) = workspace.visibility, workspace.a_buffer, samples
    first_row, end_row = first // visibility.pitch, -(-last // visibility.pitch)
    rows = Rows(band.y_start + first_row, band.y_start + end_row)
    entries = np.empty(a_buffer.starts[last] - a_buffer.starts[first], np.int64)
    lists = FragmentLists(first, last, first_row, end_row, entries, a_buffer.cursors, a_buffer.starts, False)
    triangles, vertices, *_ = drawn.drawables
    list_fragments(band.y_start, transparent, triangles, vertices, rows, workspace.block, visibility, lists)
    show_nearest(visibility, a_buffer, lists)
    layer, n_channel = workspace._replace(visibility=a_buffer.layer), render_pass.n_channel_of(counts)
    n_composited, is_more = 0, True
    while is_more:
        render_pass.shade(layer, Band(band.faces, *rows), counts, drawn.face_table)
        is_more = composite(
            visibility, workspace.records, a_buffer.of_channels(n_channel), lists, n_composited,
            workspace.radiance[:n_channel], workspace.texels,
            render_pass.opacity,
        )  # fmt: skip
        n_composited += 1
