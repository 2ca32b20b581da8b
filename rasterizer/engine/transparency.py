"""Bands with transparent surfaces: what is opaque is shaded as everywhere, and what is before it is put in front
(pipeline/a_buffer.py)."""

from typing import NamedTuple

import numpy as np

from ..pipeline import a_buffer as a
from ..pipeline.a_buffer import ABuffer, Fragments, Translucent
from ..pipeline.buffers import clear_band
from ..pipeline.cull import Band, Rows
from ..pipeline.gradients import HAS_COLORS, IN_PACKED, IN_PLANES
from ..pipeline.scan import Deferred, ScanCounts, make_deferred, scan
from ..pipeline.triangle_setups import TriangleSetups
from ..pipeline.visibility import STRIP_SHIFT, VisibilityBuffer, forget_extents, make_extents
from ..pipeline.workspace import Workspace, WorkspacePool, WorkspaceShape
from .passes import Drawn, Pass

MAX_SHADED = 2**15  # samples whose layers are shaded at a time: what is kept of them stays in a usual L2 cache


class Task(NamedTuple):
    """A band, and how it is drawn."""

    band: Band
    drawn: Drawn
    render_pass: Pass
    workspace: Workspace
    pool: WorkspacePool  # for another one
    shape: WorkspaceShape


class Surfaces(NamedTuple):
    """What the scan stage left of a band."""

    visibility: VisibilityBuffer  # of the opaque triangles
    setups: TriangleSetups
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
    band, drawn, render_pass, workspace, pool, shape = task
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
    a_buffer = a.make_a_buffer(deferred.extents, band.n_row, render_pass.n_channel_of(everything))
    surfaces, second = Surfaces(workspace.visibility, workspace.setups, deferred), None
    fragments = list_before(task, surfaces, a_buffer)
    if fragments.found[1]:
        # The order at equal depth isn't known: the band is scanned once more, so that the packed samples of all opaque
        # surfaces hold indices. They decide which of two surfaces at equal depth has the lower one.
        second = pool.acquire(shape, len(band.faces) * render_pass.units_per_setup)
        coding, others = render_pass.coding, make_deferred(len(band.faces), second.extents)
        coding = coding._replace(paths=np.where(coding.paths == IN_PACKED, np.uint8(IN_PLANES), coding.paths))
        scan(band, drawn.drawables, coding, second.block, second.visibility, second.setups, others)
        surfaces = Surfaces(second.visibility, second.setups, others.listed())
        fragments = list_before(task, surfaces, a_buffer)
    translucent = composite_band(task, surfaces, in_front, a_buffer, fragments)
    if second is not None:
        forget_extents(second.extents)
        clear_band(second.visibility, band.n_row)
        pool.release(shape, second)
    forget_extents(deferred.extents)
    return everything, translucent


def list_before(task: Task, surfaces: Surfaces, a_buffer: ABuffer) -> Fragments:
    """List what transparent triangles show before the opaque ones."""
    workspace = task.workspace
    return a.gather_fragments(
        task.band,
        surfaces.deferred,
        task.drawn.drawables,
        workspace.block,
        surfaces.visibility,
        a_buffer,
        workspace.room,
    )


def composite_band(
    task: Task, surfaces: Surfaces, counts: ScanCounts, a_buffer: ABuffer, fragments: Fragments
) -> Translucent | None:
    """Sort the fragments and put what they show in front of the opaque surfaces.

    Parameters
    ----------
    counts : what the scan stage found of transparent triangles
    """
    n_fragment = int(fragments.found[0])
    if n_fragment == 0:
        return None
    n_row, extents, is_any = task.band.n_row, make_extents(task.band.n_row), False
    translucent = Translucent(a_buffer.opacity, a_buffer.columns, extents.left, extents.right)
    packed = task.workspace.room.sorted[:n_fragment]
    a.sort_fragments(fragments, a_buffer.starts, packed)

    # Strips of rows, as many at a time as have MAX_SHADED samples.
    strip, first_samples, at_a_time = 1 << STRIP_SHIFT, a_buffer.first_samples, n_row
    if first_samples[n_row] > MAX_SHADED:
        at_a_time = max(MAX_SHADED // int(np.diff(first_samples).max()) // strip, 1) * strip
    for y in range(0, n_row, at_a_time):
        rows = Rows(y, min(y + at_a_time, n_row))
        is_any |= composite_rows(task, surfaces, counts, a_buffer, packed, rows, translucent)
    return translucent if is_any else None


def composite_rows(task: Task, surfaces: Surfaces, counts, a_buffer, packed, rows: Rows, translucent) -> bool:
    """Shade one layer after the other, nearest first, sum them up, and put the opaque surfaces behind; tell whether any
    sample has none. `packed` are the lists of the band's samples."""
    band, render_pass, workspace = task.band, task.render_pass, task.workspace
    radiance = workspace.radiance[: len(a_buffer.color)]
    layer = a.make_layer(surfaces.deferred.extents, rows, radiance, workspace.alphas)
    shaded = workspace._replace(
        visibility=layer.visibility, setups=surfaces.setups, radiance=layer.radiance, alphas=layer.alphas,
    )  # fmt: skip
    of_picture = Band(band.faces, band.y_start + rows.y_start, band.y_start + rows.y_end)
    opacity, number = render_pass.opacity, 0
    while a.show_layer(number, layer, packed, a_buffer, opacity.min_transmittance):
        render_pass.shade(shaded, of_picture, counts)
        a.composite(layer, surfaces.setups, a_buffer, opacity)
        number += 1
    return a.put_behind(*rows, workspace.visibility, a_buffer, radiance, translucent)
