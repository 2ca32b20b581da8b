"""A polygon's way from the scene to the picture, one stage after the other.

    Scene ─ geometry ─ light ─ transform ─ clip ─ setup ─ bands ─ scan ─ shade ─ resolve ─ Frame
            normals            1/256 px          cull    by y    z-test          8 bits

Every stage hands plain arrays to the next; `draw` is the way from transform on. Flat shading and Gouraud's method light
the points before they are drawn; Phong's method hands normals on, and lights the visible samples in the shade stage.
"""

from typing import NamedTuple

import numpy as np

from ..errors import SceneError
from ..pipeline.a_buffer import (
    FEW,
    Fragments,
    Opacity,
    composite,
    divide_room,
    in_order_of_depth,
    open_layers,
    ranges_of,
    scan_opaque,
    show_first,
    take_fragments,
)
from ..pipeline.bands import sort_into_bands
from ..pipeline.buffers import write_buffers
from ..pipeline.clip import NO_PLANES, clip
from ..pipeline.cull import Faces, find_visible
from ..pipeline.depth_cueing import Cue, fade
from ..pipeline.fragments import make_batch
from ..pipeline.interpolate import ScannedBand
from ..pipeline.lighting import SurfacePoints, light_points
from ..pipeline.means import fill_means
from ..pipeline.records import EXACT, MAX_RECORDS, Coding
from ..pipeline.resolve import resolve
from ..pipeline.scan import Canvas, scan
from ..pipeline.setup import Polygons
from ..pipeline.shade import FaceTable, shade_interpolated, shade_lit
from ..pipeline.shadow_lookup import write_map
from ..pipeline.texture_sampling import sample_textures, shade_textured
from ..pipeline.transform import transform
from ..pipeline.workspace import BenchKind
from .plan import choose_band_rows

MOST_FACES = 2**31 - 1  # records hold the numbers of triangles in 32 bits


NO_TABLE = FaceTable(np.empty(0, np.uint32), np.empty((0, 5)))


class Job(NamedTuple):
    """One way through the pipeline: what is drawn, how words are coded, and how a finished band becomes output."""

    attributes: np.ndarray  # (side, n_point, n_attribute), interpolated over the polygons
    coding: Coding
    n_channel: int  # of the intensities of a band
    is_culled: bool
    factor: int  # samples a pixel along each axis
    size: tuple  # (width, height) in pixels
    shade: object  # (bench, n_exact, table, y_start, n_row): fills bench.radiance for the visible samples
    finish: object  # (bench, loaded_face, y_start, y_stop) -> samples covered: writes the rows y_start..y_stop
    is_filled: bool  # bands without polygons are written too
    table: FaceTable = NO_TABLE
    is_textured: bool = False
    opacity: Opacity | None = None  # None where all is opaque
    cue: Cue | None = None  # None where nothing fades with depth


class Counts(NamedTuple):
    """What went the way, for Frame.stats."""

    faces: int
    clipped: int
    culled: int
    drawn: int
    covered: int
    samples: int


def draw(geometry, job, screen, scratch, workers, clock) -> Counts:
    """Send every polygon of the scene through the pipeline."""
    job = job if job.cue is None else job._replace(shade=_with_cue(job, screen))
    vertices, n_outside = transform(geometry.positions, screen, workers)
    clock.lap("transform")

    polygons = Polygons(geometry.vertex, geometry.corner, geometry.is_inverted)
    loaded_face, planes, n_clipped, table = geometry.face, NO_PLANES, 0, job.table
    if n_outside:
        clipped = clip(geometry.positions, *polygons[:2], vertices, screen)
        vertices, planes, n_clipped = clipped.vertices, clipped.planes, clipped.n_clipped
        loaded_face = geometry.face[clipped.face] if len(geometry.face) else clipped.face
        polygons = Polygons(
            clipped.vertex, clipped.corner, geometry.is_inverted[clipped.face], clipped.cut, clipped.ends
        )
        table = table.of_parts(clipped.face)
        clock.lap("clip")
    if polygons.vertex.shape[1] > MOST_FACES:
        raise SceneError(f"a scene may have {MOST_FACES} triangles; this one has {polygons.vertex.shape[1]}")

    width, height = job.size[0] * job.factor, job.size[1] * job.factor
    visible, rows = set_up(polygons, vertices, width, height, job, workers)
    clock.lap("setup")
    bands = sort_into_bands(visible, workers)
    clock.lap("bands")

    attributes = job.attributes
    n_attribute = attributes.shape[2]
    n_group = -(-n_attribute // 3) if job.coding.kind != EXACT else 0  # the normals, or the three channels; the albedo
    is_layered = job.opacity is not None
    kind = BenchKind(width, rows, job.n_channel, n_attribute, n_group, attributes.dtype, job.is_textured, is_layered)

    def draw_band(band):
        faces = bands.face[bands.start[band] : bands.start[band + 1]]
        y_start, y_stop = band * rows, min((band + 1) * rows, height)
        bench = scratch.take(kind, len(faces))
        bench = bench._replace(records=bench.records._replace(cut=planes))
        if is_layered:
            peel(faces, polygons, vertices, attributes, job, table, y_start, y_stop, bench)
        else:
            _, n_exact = scan(
                faces,
                polygons,
                vertices,
                attributes,
                job.coding,
                y_start,
                y_stop,
                bench.block,
                bench.canvas,
                bench.records,
            )
            job.shade(bench, n_exact, table, y_start, y_stop - y_start)
        n_covered = job.finish(bench, loaded_face, y_start, y_stop)
        scratch.give_back(kind, bench)
        return n_covered

    # The bands with most triangles first, so that no thread is left with a big one at the end.
    n_in_band = np.diff(bands.start)
    order = np.argsort(-n_in_band, kind="stable")
    covered = workers.map(draw_band, [band for band in order.tolist() if job.is_filled or n_in_band[band] > 0])
    clock.lap("scan, shade, resolve")
    n_culled = sum(part.n_culled for part in visible)
    n_drawn = sum(len(part.face) for part in visible)
    return Counts(geometry.n_loaded, n_clipped, n_culled, n_drawn, sum(covered), width * height)


def peel(faces, polygons, vertices, attributes, job, table, y_start, y_stop, bench) -> None:
    """Draw a band of a scene with transparent surfaces: list what is seen through at every sample, shade one layer
    after the other, nearest first, and sum them up."""
    canvas, layers, n_row = bench.canvas, bench.layers, y_stop - y_start
    places, n_sample = np.empty(len(faces), np.int64), n_row * canvas.pitch
    n_place = scan_opaque(
        faces, polygons, vertices, attributes, job.coding, y_start, y_stop, bench.block, canvas, bench.records,
        job.opacity, table.materials, places,
    )  # fmt: skip
    places = places[:n_place]
    fragments = Fragments(0, n_sample, np.empty(0, np.int64), layers.cursor, layers.start, True)
    open_layers(layers)
    take_fragments(faces, places, polygons, vertices, y_start, 0, n_row, bench.block, canvas, fragments)
    n_fragment, n_list = divide_room(layers, n_sample)
    if n_fragment > FEW * n_list:
        places = in_order_of_depth(places, faces, polygons, vertices)

    shown = bench._replace(canvas=Canvas(layers.words, canvas.pitch, canvas.width, layers.left, layers.right))
    for first, last in ranges_of(layers.start[: n_sample + 1], canvas.pitch):
        first_row, stop_row = first // canvas.pitch, -(-last // canvas.pitch)
        words = np.empty(layers.start[last] - layers.start[first], np.int64)
        fragments = Fragments(first, last, words, layers.cursor, layers.start, False)
        take_fragments(faces, places, polygons, vertices, y_start, first_row, stop_row, bench.block, canvas, fragments)
        show_first(canvas, layers, fragments, first_row, stop_row - first_row)
        depth, is_more = 0, True
        while is_more:
            job.shade(shown, len(faces), table, y_start + first_row, stop_row - first_row)
            is_more = composite(
                canvas, bench.records, layers, fragments, first_row, stop_row - first_row, depth, bench.radiance, bench.texels,
                job.opacity, table.materials,
            )  # fmt: skip
            depth += 1


def set_up(polygons, vertices, width, height, job, workers):
    """Find what is visible, and how many rows of samples a band has: no band may have more polygons than record
    numbers."""
    rows = choose_band_rows(width, height, workers.n_thread, job.factor)
    while True:
        visible = find_visible(Faces(*polygons.vertex), vertices, width, height, rows, job.is_culled, workers)
        most = int(np.sum([part.histogram for part in visible], axis=0).max(initial=0))
        if most <= MAX_RECORDS:
            return visible, rows
        if rows == job.factor:
            raise SceneError(f"{most} polygons meet one row of pixels; legal are {MAX_RECORDS}: draw a larger picture")
        rows = max(job.factor, rows // 2 // job.factor * job.factor)


def light(geometry, lift, plan, lighting, screen, is_flat, n_side, workers) -> np.ndarray:
    """Evaluate the illumination equation at all points: (n_side, n_point, n_channel) intensities, with flipped normals
    on side 1.

    `lift` is (n_point,), how far points are lifted where lights cast shadows, else empty.
    """
    intensities = np.empty((n_side, geometry.points.shape[1], plan.n_channel), plan.dtype)
    starts = geometry.point_offsets[:-1]
    tangents = geometry.tangents if plan.has_tangents else None
    points = SurfacePoints(geometry.points, geometry.normals, tangents, geometry.albedo, lift)
    for material, start, stop in zip(geometry.group_material.tolist(), starts, geometry.point_offsets[1:], strict=True):
        n = int(stop - start)
        for side, out in enumerate(intensities):
            sign = 0 if is_flat else 1 - 2 * side
            workers.map(
                lambda part, material=material, start=int(start), sign=sign, out=out: light_points(
                    points, start + part[0], start + part[1], screen, sign, lighting, material, make_batch(plan.dtype), out,
                ),
                workers.ranges(n),
            )  # fmt: skip
    return intensities


def fill_centers(values, centers, workers) -> np.ndarray:
    """Give the points that are means of others their values (side, n_point, n_value); nothing is lit there."""
    if centers is not None:
        for side in values:
            workers.map(
                lambda part, side=side: fill_means(side, centers.first, centers.offsets, centers.points, *part),
                workers.ranges(len(centers.offsets) - 1),
            )
    return values


def interpolated_job(intensities, plan, coding, options, encoding, picture, table) -> Job:
    """Flat shading and Gouraud's method: intensities of polygons or vertices are interpolated."""
    level_step = plan.dtype.type(1.0 / plan.level_scale)

    def shade(bench, n_exact, table, y_start, n_row):
        band = ScannedBand(bench.canvas, bench.records, coding.kind, n_exact, y_start, n_row)
        if plan.textures is None:
            shade_interpolated(band, plan.n_channel, level_step, bench.radiance)
        else:
            sample_textures(band, plan.textures, table.materials, bench.batch, bench.texels)
            shade_textured(band, bench.texels, bench.radiance)

    return _picture_job(intensities, coding, plan, options, encoding, picture, shade, table)


def lit_job(normals, plan, coding, options, encoding, picture, screen, lighting, table) -> Job:
    """Phong's method: normals are interpolated and every visible sample is lit."""

    tangent_attribute = normals.shape[2] - 3 if plan.has_tangents else None

    def shade(bench, n_exact, table, y_start, n_row):
        band, texels = ScannedBand(bench.canvas, bench.records, coding.kind, n_exact, y_start, n_row), None
        if plan.textures is not None:
            texels = bench.texels
            sample_textures(band, plan.textures, table.materials, bench.batch, texels)
        shade_lit(band, screen, lighting, table, tangent_attribute, texels, bench.batch, bench.radiance)

    return _picture_job(normals, coding, plan, options, encoding, picture, shade, table)


def _picture_job(attributes, coding, plan, options, encoding, picture, shade, table) -> Job:
    factor = options.factor

    def finish(bench, _loaded_face, y_start, y_stop):
        layers = bench.layers if plan.opacity is not None else None
        return resolve(
            bench.canvas, bench.radiance, layers, y_start // factor, y_stop // factor, factor, encoding, picture
        )

    return Job(
        attributes, coding, plan.n_channel, options.cull == "back", factor, options.size, shade, finish, True, table,
        plan.textures is not None, plan.opacity, plan.cue,
    )  # fmt: skip


def _with_cue(job, screen):
    """Shade as the job does, then let what is further away fade."""

    def shade(bench, n_exact, table, y_start, n_row):
        job.shade(bench, n_exact, table, y_start, n_row)
        band = ScannedBand(bench.canvas, bench.records, job.coding.kind, n_exact, y_start, n_row)
        fade(band, screen.is_perspective, job.cue, bench.radiance)

    return shade


def buffers_job(normals, coding, options, screen, buffers) -> Job:
    """Exact buffers: one sample a pixel, at its centre, and a record for every polygon."""

    def finish(bench, loaded_face, y_start, y_stop):
        return write_buffers(bench.canvas, bench.records, loaded_face, y_start, y_stop - y_start, screen, buffers)

    return Job(normals, coding, 0, options.cull == "back", 1, options.size, _shade_nothing, finish, False)


def shadow_job(nothing, coding, screen, texels) -> Job:
    """What a light sees: a texel for every sample of a square map, and nothing interpolated."""
    depth = (-coding.depth_offset, -coding.depth_scale)
    if screen.is_perspective:
        depth = (coding.inv_w_offset, coding.inv_w_scale)

    def finish(bench, _loaded_face, y_start, y_stop):
        write_map(bench.canvas, y_start, y_stop - y_start, depth, texels)
        return 0

    return Job(nothing, coding, 0, False, 1, texels.shape[::-1], _shade_nothing, finish, True)


def _shade_nothing(_bench, _n_exact, _table, _y_start, _n_row) -> None:
    """For what is drawn without light."""
