"""Stages of the pipeline fed by hand, one at a time: help for their tests."""

from fractions import Fraction

import numpy as np

from rasterizer.cores import Workers
from rasterizer.engine.depth_range import scale_depths
from rasterizer.pipeline.cull import Band
from rasterizer.pipeline.gradients import (
    DOUBLE_PRECISION,
    EXACT,
    HAS_ALBEDO,
    HAS_COLORS,
    IN_PACKED,
    IN_PLANES,
    SINGLE_PRECISION,
    Coding,
)
from rasterizer.pipeline.interpolate import ScannedBand
from rasterizer.pipeline.scan import ScanCounts, scan
from rasterizer.pipeline.transform import Drawables, PixelWidth, Triangles, Vertices, make_screen
from rasterizer.pipeline.triangle_setups import UNIT, max_units
from rasterizer.pipeline.workspace import WorkspaceShape, make_workspace
from rasterizer.reference import coverage
from rasterizer.scene.camera import Projection, View

SERIAL = Workers(1)
NO_MATERIALS = np.empty(0, np.uint32)


def plain_screen(is_perspective=True, depths=(1.0, 100.0), far_clip=np.inf, scale=1.0):
    """A screen whose camera at the origin looks down -z; orthographic, scale 1: one unit is one pixel."""
    view = View(np.zeros(3), *np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, -1.0]]))
    return screen_of(view, Projection(scale, scale, 0.0, 0.0, is_perspective), depths, far_clip)


def screen_of(view, projection, depths, far_clip=np.inf):
    """A screen that clips at the nearest of its depths."""
    return make_screen(view, projection, depths, depths[0], far_clip)


# What a coding of tests is made of, and the path that all of its materials ask for: exact setups · intensities in
# packed samples · intensities in planes · normals, and albedo behind them, in planes.
KINDS = {
    "exact": EXACT,
    "packed": IN_PACKED,
    "values": IN_PLANES,
    "normals": IN_PLANES,
}


def plain_coding(
    kind, screen, n_attributes=1, dtypes=np.float32, *, intensity_scale=1.0, tolerance=0.0, normal_limit=0.0, **options
):
    """What packed samples and setups hold, for a screen.

    Parameters
    ----------
    kind : one of KINDS
    n_attributes, dtypes : of each material; a number, or a type, for one material, which all triangles have
    tolerance : units of intensity, or of albedo · normal_limit : see gradients.Coding
    options : needs_distance; features, bits that all materials have beside their type
    """
    path, n_attributes = KINDS[kind], np.atleast_1d(n_attributes).astype(np.int64)
    types = dtypes if isinstance(dtypes, (list, tuple)) else [dtypes]
    is_double = np.array([np.dtype(dtype) == np.float64 for dtype in types]) | np.zeros(len(n_attributes), bool)
    features = np.where(is_double, DOUBLE_PRECISION, SINGLE_PRECISION) | np.where(n_attributes >= 3, HAS_COLORS, 0)
    features = features | HAS_COLORS if kind == "normals" else features
    features = features | np.where(n_attributes >= 6, HAS_ALBEDO, 0) if kind in ("exact", "normals") else features
    paths = np.where((path == IN_PACKED) & (n_attributes >= 3), IN_PLANES, path)  # a packed sample has one channel
    return Coding(
        paths=np.where(is_double, EXACT, paths).astype(np.uint8),
        features=(features | options.get("features", 0)).astype(np.uint8),
        reads_double=is_double,
        n_attributes=n_attributes,
        limits=np.full(len(n_attributes), float(normal_limit if kind == "normals" else tolerance)),
        intensity_scale=0.0 if kind == "normals" else float(intensity_scale),
        albedo_tolerance=float(tolerance),
        needs_distance=options.get("needs_distance", False),
        textures=None,
        depths=scale_depths(screen),
        is_exact=kind == "exact",
    )


def drawables_of(triangles, z, attributes, is_inverted=None, material=NO_MATERIALS):
    """Separate triangles (n, 3, 2), in 1/256 px, with z (n, 3), z-buffer units.

    `attributes` is (side, n, 3, k).
    """
    triangles, n = np.asarray(triangles, np.int32), len(triangles)
    x, y = (np.ascontiguousarray(triangles[..., k].ravel()) for k in range(2))
    vertices = Vertices(x, y, z.ravel(), x.astype(float), y.astype(float), PixelWidth(0.0, 0.0, 0.0))
    columns = np.ascontiguousarray(np.arange(3 * n, dtype=np.uint32).reshape(n, 3).T)
    is_inverted = np.zeros(n, np.uint8) if is_inverted is None else np.asarray(is_inverted, np.uint8)
    rows = np.ascontiguousarray(attributes, np.float64).reshape(len(attributes), 3 * n, attributes.shape[3])
    return Drawables(Triangles(columns, columns, is_inverted, np.asarray(material, np.uint32)), vertices, rows)


def scan_alone(triangles, depth, attributes, coding, screen, size, material=NO_MATERIALS, **options):
    """Scan triangles (n, 3, 2), in 1/256 px, with depths (n, 3) and attributes (n, 3, k) into one band.

    Parameters
    ----------
    material : (n,) of each triangle
    options : deferred, where transparent triangles go; y_start, of the band; room for setups, units; fill, what is
        there before, a number, or one for each place of a unit; run, in place of `scan`

    Returns
    -------
    the workspace, and ScanCounts
    """
    depth, n = np.asarray(depth, float), len(triangles)
    attributes = np.asarray(attributes)
    z = screen.z_offset + screen.z_scale * (1.0 / depth if screen.is_perspective else depth)
    n_attribute = attributes.shape[2]
    dtype = np.dtype(np.float64 if coding.reads_double.all() else np.float32)
    kind = WorkspaceShape(size[0], size[1], n_attribute, n_attribute, dtype, 0, False)
    workspace = make_workspace(kind, options.get("room", n * max_units(coding)))
    fill = options.get("fill", 0)
    workspace.setups.integers.fill(np.max(fill))
    workspace.setups.int_planes.reshape(-1, UNIT)[...] = fill
    y_start = options.get("y_start", 0)
    band = Band(np.arange(n, dtype=np.uint32), y_start, y_start + size[1])
    drawables = drawables_of(triangles, z, attributes[None], material=material)
    counts = options.get("run", scan)(
        band, drawables, coding, workspace.block, workspace.visibility, workspace.setups, options.get("deferred")
    )
    return workspace, ScanCounts(*counts)


def band_of(workspace, coding, counts, n_row, y_start=0):
    """What a scan left, for the stages behind it."""
    return ScannedBand(workspace.visibility, workspace.setups, coding, counts, y_start, n_row)


def packed_of(workspace, size):
    """The visibility buffer without its padding, (rows, columns) int64."""
    visibility = workspace.visibility
    return visibility.packed.reshape(size[1], visibility.pitch)[:, : size[0]]


def covered(triangle, size):
    """Rows, columns (n,) of the samples that a triangle covers, and its edge functions there (3, n) int64."""
    rows, columns = np.nonzero(coverage(triangle, *size))
    corners = [tuple(int(v) for v in corner) for corner in triangle]
    x, y = 256 * columns + 128, 256 * rows + 128
    edges = [
        (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
        for a, b in ((corners[1], corners[2]), (corners[2], corners[0]), (corners[0], corners[1]))
    ]
    edges = np.array(edges, np.int64).reshape(3, -1)
    return rows, columns, edges * (-1 if edges.sum() < 0 else 1)


def perspective_weights(edges, depth, is_perspective=True):
    """Weights (3, n) of the corners at samples with edge functions (3, n) int64, float64."""
    q = edges / (np.asarray(depth, float)[:, None] if is_perspective else 1.0)
    return q / q.sum(axis=0)


def exact_means(edges, depth, values, is_perspective=True):
    """Means (n,) of the corners' values in rational numbers, rounded once."""
    inverse = [1 / Fraction(float(d)) if is_perspective else Fraction(1) for d in depth]
    values = [Fraction(float(value)) for value in values]
    means = []
    for column in edges.T:
        q = [int(e) * w for e, w in zip(column, inverse, strict=True)]
        means.append(float(sum(a * b for a, b in zip(q, values, strict=True)) / sum(q)))
    return np.array(means)


def random_triangles(rng, n, size, reach):
    """Integer triangles (n, 3, 2), in 1/256 px, corners up to `reach` pixels from places in the picture."""
    center = rng.uniform(0, 256 * np.array(size), (n, 1, 2))
    return np.rint(center + 256 * reach * rng.uniform(-1, 1, (n, 3, 2))).astype(np.int64)


def slivers(rng, n, size, reach, width):
    """Triangles (n, 3, 2) up to `width` sub-pixels wide and `2 * reach` pixels long, through the picture."""
    middle = rng.uniform(0, 256 * np.array(size), (n, 2))
    angle = rng.uniform(0, np.pi, n)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) * reach * 256
    third = middle + along * rng.uniform(-0.9, 0.9, (n, 1)) + rng.integers(-width, width + 1, (n, 2))
    return np.rint(np.stack([middle - along, middle + along, third], axis=1)).astype(np.int64)
