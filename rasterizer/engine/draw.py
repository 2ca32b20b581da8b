"""A triangle's path from the scene to the picture, one stage after the other.

    Scene ─ geometry ─ transform ─ clip ─ cull ─ bands ─ light ─ scan ─ shade ─ resolve ─ Frame
            normals    1/256 px          boxes   by y    seen    z-test         8 bits

Every stage hands plain arrays to the next; `draw` is the path from transform on. What is drawn, how it is shaded and
what becomes of a finished band is said by the pass (passes.py): a picture, exact buffers, or the map of a shadow.
Exact buffers beside a picture are a pass of their own.
"""

from functools import partial
from time import perf_counter
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ..errors import SceneError
from ..pipeline.clip import clip
from ..pipeline.cull import Band, BandLists, Grid, find_visible, join_lists, sort_into_bands
from ..pipeline.scan import make_deferred
from ..pipeline.transform import Drawables, Triangles, Vertices, transform
from ..pipeline.visibility import MAX_SETUPS
from ..pipeline.workspace import WorkspacePool, WorkspaceShape
from .passes import Drawn, Pass
from .plan import PathCounts
from .transparency import Task, draw_transparent_band

BAND_SAMPLES = 2**17  # a band's visibility buffer is about 1 MB: half of a usual L2 cache
FACE_TIME = 40  # nanoseconds of a triangle, roughly, from scan on: every other one is hidden
MIN_THREADED_TIME = 400_000  # of bands that are drawn on several threads: four times what waking one takes
MAX_FACES = 2**31 - 1  # setups hold the numbers of triangles in 32 bits
NO_SOURCES = np.empty(0, np.uint32)  # of triangles none of which was clipped


class Counts(NamedTuple):
    """What was drawn, for `Stats`."""

    faces: int
    clipped: int
    culled: int
    drawn: int
    covered: int
    samples: int
    paths: PathCounts


class Clock:
    """Milliseconds of each stage, in order."""

    def __init__(self) -> None:
        self.milliseconds: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, stage: str) -> None:
        """Add the time since the last lap to a stage."""
        now = perf_counter()
        self.milliseconds[stage] = self.milliseconds.get(stage, 0.0) + 1000.0 * (now - self._last)
        self._last = now


NO_CLOCK = SimpleNamespace(lap=lambda stage: None)  # for passes whose stages are not those of the picture


def draw(geometry, render_pass: Pass, screen, workspaces: WorkspacePool, threads, clock) -> Counts:
    """Send every triangle of the scene through the stages.

    Parameters
    ----------
    geometry : Geometry of the scene, world space
    render_pass : what is drawn, and what becomes of it; takes the attributes that it lights
    screen : Screen of the view
    workspaces : from which each band takes the memory that it is drawn in
    threads : Workers
    clock : Clock, which notes the milliseconds of each stage

    Raises SceneError where the scene has more triangles than setups can number.
    """
    vertices, n_outside = transform(geometry.positions, screen, threads)
    clock.lap("transform")
    n_face, n_clipped, source = geometry.vertex.shape[1], 0, NO_SOURCES
    if n_outside:
        clipped = clip(geometry.positions, geometry.vertex, vertices, screen)
        vertices, n_clipped, source = clipped.vertices, clipped.n_clipped, clipped.faces
        render_pass = render_pass.of_clipped(clipped, geometry.corner)
        geometry = geometry._replace(  # new vertices and points stand behind all others
            vertex=clipped.rows_of(geometry.vertex, len(geometry.positions)),
            corner=clipped.rows_of(geometry.corner, len(geometry.normals)),
            is_inverted=geometry.is_inverted[source],
            face_material=geometry.face_material[source] if len(geometry.face_material) else geometry.face_material,
        )
        clock.lap("clip")
    n_triangle, (width, height) = geometry.vertex.shape[1], render_pass.n_sample
    if n_triangle > MAX_FACES:
        raise SceneError(f"a scene may have {MAX_FACES} triangles; this one has {n_triangle}")
    if not render_pass.keeps_planes:
        vertices.true_x[:], vertices.true_y[:] = vertices.x, vertices.y
    triangles = Triangles(geometry.vertex, geometry.corner, geometry.is_inverted, geometry.face_material)
    lists, n_row = cull(triangles, vertices, render_pass, threads)
    clock.lap("cull, bands")
    if render_pass.light is not None:
        render_pass.attributes = render_pass.light(lists.faces)
        clock.lap("light")
    drawn = Drawn(Drawables(triangles, vertices, render_pass.attributes, render_pass.cut_outs), source)
    shape = WorkspaceShape(
        width, n_row, render_pass.n_channel, render_pass.attributes.shape[2], render_pass.dtype,
        render_pass.is_textured, render_pass.opacity is not None,
    )  # fmt: skip
    scan_shade_resolve = partial(draw_band, drawn=drawn, render_pass=render_pass, workspaces=workspaces, shape=shape)
    counts = threads.map(scan_shade_resolve, list_bands(lists, n_row, render_pass.rows or (0, height)))
    clock.lap("scan, shade, resolve")
    covered, *paths = map(sum, zip(*counts, strict=True))
    of_faces = n_face, n_clipped, lists.n_culled, lists.n_visible
    return Counts(*of_faces, covered, width * height, PathCounts(*paths))


def draw_band(
    band: Band, drawn: Drawn, render_pass: Pass, workspaces: WorkspacePool, shape: WorkspaceShape
) -> tuple[int, int, int, int]:
    """Draw the rows of one band: find what is visible, shade it, write it.

    Returns how many samples are covered, and triangles by the path that their attributes took, as `PathCounts`.
    """
    workspace = workspaces.acquire(shape, len(band.faces) * render_pass.units_per_setup)

    # Scan: the nearest opaque triangle of each sample goes into the visibility buffer, transparent ones are deferred.
    deferred = make_deferred(len(band.faces), workspace.extents) if render_pass.opacity is not None else None
    found = render_pass.scan(workspace, band, drawn, deferred)

    # Shade: the radiance of the visible samples.
    translucent = None
    if deferred is None or deferred.is_empty:
        render_pass.shade(workspace, band, found)
    else:
        task = Task(band, drawn, render_pass, workspace, workspaces, shape)
        found, translucent = draw_transparent_band(task, found, deferred.listed())

    # Resolve: the rows of the picture.
    n_covered = render_pass.finish(workspace, band, found, translucent, drawn)
    workspaces.release(shape, workspace)
    return n_covered, found.n_level, found.n_plane, found.n_exact


# ---------------------------------------------------------------- bands


def cull(triangles: Triangles, vertices: Vertices, render_pass: Pass, threads) -> tuple[BandLists, int]:
    """Find the triangles that may touch a sample, sorted into bands.

    No band may have more triangles than there are setup numbers: where one would, bands are made less high.

    Returns the lists of the triangles, and the number of rows of samples in a band.
    """
    factor, (width, height) = render_pass.factor, render_pass.n_sample
    n_face, hidden_sides = triangles.vertex_idx.shape[1], render_pass.hidden_sides
    if hidden_sides is None:
        hidden_sides = np.zeros(n_face, np.int8)
    is_long = n_face * FACE_TIME + width * height * render_pass.sample_time > MIN_THREADED_TIME
    n_row = choose_band_rows(width, height, threads.n_thread if is_long else 1, factor)
    if render_pass.opacity is not None and is_mostly_clear(triangles.material, render_pass.opacity.is_opaque):
        n_row = max(factor, n_row // 4 // factor * factor)  # a sample has a fragment for each transparent surface
    while True:
        grid = Grid(width, height, n_row)
        parts = find_visible(triangles.vertex_idx, vertices, grid, hidden_sides, threads, sort_into_bands)
        lists = join_lists(parts)
        n_max = int(np.diff(lists.starts).max(initial=0))
        if n_max * render_pass.units_per_setup <= MAX_SETUPS:
            return lists, n_row
        if n_row == factor:
            raise SceneError(
                f"{n_max} polygons meet one row of pixels; legal are {MAX_SETUPS // render_pass.units_per_setup}: "
                "draw a larger picture"
            )
        n_row = max(factor, n_row // 2 // factor * factor)


def is_mostly_clear(material, is_opaque) -> bool:
    """Tell whether most triangles are transparent, by some of them; `material` (n,) is empty where all have one."""
    some = material[:: max(1, len(material) // 256)] if len(material) else np.zeros(1, np.uint32)
    return 2 * np.count_nonzero(is_opaque[some]) < len(some)


def choose_band_rows(width, height, n_thread, factor) -> int:
    """Choose the height of a band in rows of samples, a multiple of `factor`: its visibility buffer fits the L2 cache,
    and there are two bands for each thread at least: each costs its thread some time in Python, where others wait."""
    n_row = max(8, BAND_SAMPLES // width)
    if n_thread > 1:
        n_row = min(n_row, max(16, -(-height // (2 * n_thread))))
    return max(1, min(n_row, height) // factor) * factor


def list_bands(lists: BandLists, n_row: int, rows: tuple[int, int]) -> list[Band]:
    """List the bands that have some of the rows first..end, cut to these; those with most triangles first: so no thread
    is left with a big one at the end."""
    (first, end), bands = rows, []
    for k in np.argsort(-np.diff(lists.starts), kind="stable").tolist():
        if first // n_row <= k < -(-end // n_row):
            faces = lists.faces[lists.starts[k] : lists.starts[k + 1]]
            bands.append(Band(faces, max(k * n_row, first), min((k + 1) * n_row, end)))
    return bands
