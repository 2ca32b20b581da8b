"""A triangle's path from the scene to the picture, one stage after the other.

    Scene ─ geometry ─ light ─ transform ─ clip ─ cull ─ bands ─ scan ─ shade ─ resolve ─ Frame
            normals            1/256 px          boxes   by y    z-test         8 bits

Every stage hands plain arrays to the next; `draw` is the path from transform on. What is drawn, how it is shaded and
what becomes of a finished band is said by the pass (passes.py): a picture, exact buffers, or the map of a shadow.
Exact buffers beside a picture are a pass of their own.
"""

import numpy as np

from ..errors import SceneError
from ..pipeline.clip import Clipped, clip
from ..pipeline.cull import Band, BandLists, Grid, find_visible, join_lists, sort_into_bands
from ..pipeline.scan import make_deferred
from ..pipeline.transform import Drawables, Triangles, Vertices, transform
from ..pipeline.visibility import MAX_RECORDS
from ..pipeline.workspace import WorkspacePool, WorkspaceShape
from .drawn import BandCounts, Counts, Drawn
from .passes import Pass
from .transparency import Memory, Task, draw_transparent_band

BAND_ENTRIES = 2**17  # a band's visibility buffer is about 1 MB: half of a usual L2 cache
FACE_TIME = 40  # nanoseconds of a triangle, roughly, from scan on: every other one is hidden
MIN_THREADED_TIME = 400_000  # of bands that are drawn on several threads: four times what waking one takes
MAX_FACES = 2**31 - 1  # records hold the numbers of triangles in 32 bits
NO_SOURCES = np.empty(0, np.uint32)  # of triangles none of which was clipped


def draw(geometry, render_pass: Pass, screen, workspaces: WorkspacePool, threads, clock) -> Counts:
    """Send every triangle of the scene through the stages.

    Parameters
    ----------
    geometry : Geometry of the scene, world space
    render_pass : what is drawn, and what becomes of it
    screen : Screen of the view
    workspaces : from which each band takes the memory that it is drawn in
    threads : Workers
    clock : Clock, which notes the milliseconds of each stage

    Raises SceneError where the scene has more triangles than records can number.
    """
    vertices, n_outside = transform(geometry.positions, screen, threads)
    clock.lap("transform")
    n_face, n_clipped, source = geometry.vertex.shape[1], 0, NO_SOURCES
    if n_outside:
        clipped = clip(geometry.positions, geometry.vertex, vertices, screen)
        vertices, n_clipped, source = clipped.vertices, clipped.n_clipped, clipped.faces
        render_pass = render_pass.of_clipped(clipped, geometry.corner)
        geometry = clip_geometry(geometry, clipped)
        clock.lap("clip")
    if not render_pass.keeps_planes:
        vertices.true_x[:], vertices.true_y[:] = vertices.x, vertices.y
    drawn = gather_drawn(geometry, vertices, render_pass, source)
    lists, n_row = cull(drawn, render_pass, threads)
    clock.lap("cull, bands")
    shape = render_pass.workspace_shape(n_row)

    def scan_shade_resolve(band: Band) -> BandCounts:
        return draw_band(band, drawn, render_pass, workspaces, shape)

    counts = threads.map(scan_shade_resolve, list_bands(lists, n_row, render_pass))
    clock.lap("scan, shade, resolve")
    return Counts.of((n_face, n_clipped), lists, render_pass.n_sample, counts)


def draw_band(
    band: Band, drawn: Drawn, render_pass: Pass, workspaces: WorkspacePool, shape: WorkspaceShape
) -> BandCounts:
    """Draw the rows of one band: find what is visible, shade it, write it."""
    workspace = workspaces.acquire(shape, render_pass.max_records(len(band.faces)))

    # Scan: the nearest opaque triangle of each sample goes into the visibility buffer, transparent ones are deferred.
    deferred = make_deferred(len(band.faces), workspace.extents) if render_pass.opacity is not None else None
    found = render_pass.scan(workspace, band, drawn, deferred)

    # Shade: the radiance of the visible samples.
    translucent = None
    if deferred is None or deferred.is_empty:
        render_pass.shade(workspace, band, found)
    else:
        task = Task(band, drawn, render_pass, Memory(workspace, workspaces, shape))
        found, translucent = draw_transparent_band(task, found, deferred.listed())

    # Resolve: the rows of the picture.
    n_covered = render_pass.finish(workspace, band, found, translucent, drawn)
    workspaces.release(shape, workspace)
    return BandCounts(n_covered, found.n_level, found.n_plane, found.n_exact)


# ---------------------------------------------------------------- the triangles of a view


def clip_geometry(geometry, clipped: Clipped):
    """Return the Geometry of the triangles that are left; their new vertices and points stand behind all others."""
    faces = clipped.faces
    return geometry._replace(
        vertex=clipped.rows_of(geometry.vertex, len(geometry.positions)),
        corner=clipped.rows_of(geometry.corner, len(geometry.normals)),
        is_inverted=geometry.is_inverted[faces],
        face_material=geometry.face_material[faces] if len(geometry.face_material) else geometry.face_material,
    )


def gather_drawn(geometry, vertices: Vertices, render_pass: Pass, source: np.ndarray = NO_SOURCES) -> Drawn:
    """Gather the triangles of a Geometry for the stages after clip; SceneError where records can't number them all."""
    n = geometry.vertex.shape[1]
    if n > MAX_FACES:
        raise SceneError(f"a scene may have {MAX_FACES} triangles; this one has {n}")
    triangles = Triangles(geometry.vertex, geometry.corner, geometry.is_inverted, geometry.face_material)
    return Drawn(Drawables(triangles, vertices, render_pass.attributes), source)


# ---------------------------------------------------------------- bands


def cull(drawn: Drawn, render_pass: Pass, threads) -> tuple[BandLists, int]:
    """Find the triangles that may touch a sample, sorted into bands.

    No band may have more triangles than there are record numbers: where one would, bands are made less high.

    Returns the lists of the triangles, and the number of rows of samples in a band.
    """
    factor, (width, height) = render_pass.factor, render_pass.n_sample
    triangles, vertices = drawn.drawables.triangles, drawn.drawables.vertices
    n_face, hidden_sides = triangles.vertex_idx.shape[1], render_pass.hidden_sides
    if hidden_sides is None:
        hidden_sides = np.zeros(n_face, np.int8)
    is_long = n_face * FACE_TIME + width * height * render_pass.sample_time > MIN_THREADED_TIME
    n_row = choose_band_rows(width, height, threads.n_thread if is_long else 1, factor)
    while True:
        grid = Grid(width, height, n_row)
        parts = find_visible(triangles.vertex_idx, vertices, grid, hidden_sides, threads, sort_into_bands)
        lists = join_lists(parts)
        n_max = int(np.diff(lists.starts).max(initial=0))
        if render_pass.max_records(n_max) <= MAX_RECORDS:
            return lists, n_row
        if n_row == factor:
            raise SceneError(
                f"{n_max} polygons meet one row of pixels; legal are {MAX_RECORDS // render_pass.max_records(1)}: "
                "draw a larger picture"
            )
        n_row = max(factor, n_row // 2 // factor * factor)


def choose_band_rows(width, height, n_thread, factor) -> int:
    """Choose the height of a band in rows of samples, a multiple of `factor`: its visibility buffer fits the L2 cache,
    and there are two bands for each thread at least: each costs its thread some time in Python, where others wait."""
    n_row = max(8, BAND_ENTRIES // width)
    if n_thread > 1:
        n_row = min(n_row, max(16, -(-height // (2 * n_thread))))
    return max(1, min(n_row, height) // factor) * factor


def list_bands(lists: BandLists, n_row: int, render_pass: Pass) -> list[Band]:
    """List the bands to draw, those with most triangles first: so no thread is left with a big one at the end. Those
    without triangles are drawn where the pass fills them."""
    (first, end), starts = render_pass.drawn_rows, lists.starts.tolist()
    n_in_band = [end - start for start, end in zip(starts[:-1], starts[1:], strict=True)]
    return [
        Band(lists.faces[starts[k] : starts[k + 1]], max(k * n_row, first), min((k + 1) * n_row, end))
        for k in sorted(range(len(n_in_band)), key=n_in_band.__getitem__, reverse=True)
        if first // n_row <= k < -(-end // n_row) and (render_pass.is_filled or n_in_band[k] > 0)
    ]
