"""Bands with transparent surfaces: what is opaque is shaded as everywhere, and what is before it is put in front
(pipeline/a_buffer.py)."""

import contextlib
from typing import NamedTuple

import numpy as np

from ..pipeline.a_buffer import (
    FEW,
    ABuffer,
    FragmentLists,
    Translucent,
    composite,
    divide_room,
    list_fragments,
    make_a_buffer,
    make_layer,
    order_by_depth,
    put_behind,
    show_layer,
    sort_lists,
    split_samples,
)
from ..pipeline.buffers import clear_band
from ..pipeline.cull import Band, Rows
from ..pipeline.gradients import HAS_COLORS, IN_ENTRIES, IN_PLANES
from ..pipeline.records import Records
from ..pipeline.scan import Deferred, ScanCounts, make_deferred, scan
from ..pipeline.visibility import STRIP_SHIFT, VisibilityBuffer, forget_extents, make_extents
from ..pipeline.workspace import Workspace, WorkspacePool, WorkspaceShape
from .drawn import Drawn
from .passes import Pass

MAX_SHADED = 2**15  # samples whose layers are shaded at a time: what is kept of them stays in a usual L2 cache


class Memory(NamedTuple):
    """What a band is drawn in."""

    workspace: Workspace
    pool: WorkspacePool  # for another one
    shape: WorkspaceShape


class Task(NamedTuple):
    """A band, and how it is drawn."""

    band: Band
    drawn: Drawn
    render_pass: Pass
    memory: Memory


class Surfaces(NamedTuple):
    """What the scan stage left of a band."""

    visibility: VisibilityBuffer  # of the opaque triangles
    records: Records
    deferred: Deferred  # the transparent ones


def draw_transparent_band(task: Task, found: ScanCounts, deferred: Deferred) -> tuple[ScanCounts, Translucent | None]:
    """Shade the opaque surfaces of a band, and put the transparent ones in front.

    Parameters
    ----------
    found : what the scan stage found
    deferred : what it has left to be listed

    Returns
    -------
    what was found, with the features of transparent surfaces, too; None where something opaque is behind all of them
    """
    band, drawn, render_pass, (workspace, *_) = task
    in_front = deferred.counts
    everything = found._replace(features=found.features | in_front.features)
    colors = everything.features & HAS_COLORS  # channels are those of the band
    behind = found._replace(
        n_plane=found.n_plane - in_front.n_plane,
        n_exact=found.n_exact - in_front.n_exact,
        features=found.features | colors,
    )
    in_front = in_front._replace(features=in_front.features | colors)
    render_pass.shade(workspace, band, behind)
    a_buffer = make_a_buffer(workspace.room, deferred.extents, band.n_row, render_pass.n_channel_of(everything))
    surfaces = Surfaces(workspace.visibility, workspace.records, deferred)
    if count_fragments(task, surfaces, a_buffer):
        with scan_by_index(task) as surfaces:
            count_fragments(task, surfaces, a_buffer)
            translucent = composite_band(task, surfaces, in_front, a_buffer)
    else:
        translucent = composite_band(task, surfaces, in_front, a_buffer)
    forget_extents(deferred.extents)
    return everything, translucent


@contextlib.contextmanager
def scan_by_index(task: Task):
    """Scan a band once more, so that the entries of all opaque surfaces hold indices; yield Surfaces.

    They decide which of two surfaces at equal depth has the lower one.
    """
    band, drawn, render_pass, (workspace, pool, shape) = task
    second = pool.acquire(shape, render_pass.max_records(len(band.faces)))
    coding, deferred = render_pass.coding, make_deferred(len(band.faces), second.extents)
    coding = coding._replace(paths=np.where(coding.paths == IN_ENTRIES, np.uint8(IN_PLANES), coding.paths))
    scan(band, drawn.drawables, coding, second.block, second.visibility, second.records, deferred)
    yield Surfaces(second.visibility, second.records, deferred.listed())
    forget_extents(second.extents)
    clear_band(second.visibility, band.n_row)
    pool.release(shape, second)


def count_fragments(task: Task, surfaces: Surfaces, a_buffer: ABuffer) -> bool:
    """Count the fragments of each sample; tell whether any is as deep as an opaque surface whose index isn't known."""
    n_sample, no_entries, ties = len(a_buffer.cursors), np.empty(0, np.int64), np.zeros(1, np.int64)
    a_buffer.cursors.fill(0)
    lists = FragmentLists(0, n_sample, 0, no_entries, *a_buffer.lists, True, ties)
    list_rows(task, surfaces, lists, Rows(0, task.band.n_row))
    return bool(ties[0])


def list_rows(task: Task, surfaces: Surfaces, lists: FragmentLists, rows: Rows) -> None:
    """Count or list the fragments of some rows of a band."""
    band, (triangles, vertices, *_), block = task.band, task.drawn.drawables, task.memory.workspace.block
    of_picture = Rows(band.y_start + rows.y_start, band.y_start + rows.y_end)
    list_fragments(band.y_start, surfaces.deferred, triangles, vertices, of_picture, block, surfaces.visibility, lists)


def composite_band(task: Task, surfaces: Surfaces, counts: ScanCounts, a_buffer: ABuffer) -> Translucent | None:
    """Divide the room among the lists, fill them and put what they show in front of the opaque surfaces.

    Parameters
    ----------
    counts : what the scan stage found of transparent triangles
    a_buffer : with the lengths of the lists
    """
    n_fragment, n_list = divide_room(a_buffer.cursors, a_buffer.starts)
    if n_fragment > FEW * n_list:
        surfaces = surfaces._replace(deferred=order_by_depth(surfaces.deferred, task.drawn.drawables))
    extents, is_any = make_extents(task.band.n_row), False
    translucent = Translucent(a_buffer.opacity, a_buffer.columns, extents.left, extents.right)
    for first, end in split_samples(a_buffer.starts, a_buffer.first_samples):
        base, stop = int(a_buffer.starts[first]), int(a_buffer.starts[end])
        if base < stop:
            entries = task.memory.workspace.room.array("fragments", (stop - base,))
            lists = FragmentLists(first, end, base, entries, *a_buffer.lists, False, np.zeros(1, np.int64))
            rows = rows_of(lists, a_buffer)
            list_rows(task, surfaces, lists, rows)
            for some in split_rows(rows, a_buffer):
                is_any |= composite_rows(task, surfaces, counts, a_buffer, lists, some, translucent)
    return translucent if is_any else None


def rows_of(lists: FragmentLists, a_buffer: ABuffer) -> Rows:
    """Return the rows of the band that a range of samples reaches."""
    if lists.end - lists.first == len(a_buffer.cursors):
        return Rows(0, len(a_buffer.columns))
    y_start = int(np.searchsorted(a_buffer.first_samples, lists.first, side="right")) - 1
    return Rows(y_start, int(np.searchsorted(a_buffer.first_samples, lists.end)))


def split_rows(rows: Rows, a_buffer: ABuffer):
    """Divide rows of a band into strips, as many at a time as have MAX_SHADED samples."""
    strip, first_samples = 1 << STRIP_SHIFT, a_buffer.first_samples
    if first_samples[rows.y_end] - first_samples[rows.y_start] <= MAX_SHADED:
        yield Rows(rows.y_start // strip * strip, rows.y_end)
        return
    widest = int(np.diff(first_samples[rows.y_start : rows.y_end + 1]).max())
    n_row = max(MAX_SHADED // widest // strip, 1) * strip
    for y in range(rows.y_start // strip * strip, rows.y_end, n_row):
        yield Rows(y, min(y + n_row, rows.y_end))


def composite_rows(task: Task, surfaces: Surfaces, counts, a_buffer, lists, rows: Rows, translucent) -> bool:
    """Shade one layer after the other, nearest first, sum them up, and put the opaque surfaces behind; tell whether any
    sample has none."""
    band, drawn, render_pass, (workspace, *_) = task
    first, end = (int(a_buffer.first_samples[y]) for y in rows)
    lists = lists._replace(first=max(lists.first, first), end=min(lists.end, end))
    if lists.first >= lists.end:
        return False
    sort_lists(lists)
    radiance = workspace.radiance[: len(a_buffer.color)]
    layer = make_layer(workspace.room, surfaces.deferred.extents, rows, radiance, workspace.alphas)
    shaded = workspace._replace(
        visibility=layer.visibility, records=surfaces.records, radiance=layer.radiance, alphas=layer.alphas,
    )  # fmt: skip
    of_picture = Band(band.faces, band.y_start + rows.y_start, band.y_start + rows.y_end)
    opacity, number = render_pass.opacity, 0
    while show_layer(number, layer, lists, a_buffer.transmittance, opacity.min_transmittance):
        render_pass.shade(shaded, of_picture, counts)
        composite(layer, surfaces.records, a_buffer, opacity)
        number += 1
    return put_behind(*rows, workspace.visibility, lists, a_buffer, radiance, translucent)
