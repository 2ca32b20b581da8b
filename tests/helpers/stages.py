"""Stages of the pipeline fed by hand, one at a time: help for their tests."""

from fractions import Fraction

import numpy as np

import rasterizer as rz
from rasterizer.engine.plan import make_plan
from rasterizer.engine.uniforms import make_lighting
from rasterizer.options import Options
from rasterizer.pipeline.bands import Band
from rasterizer.pipeline.drawables import Drawables, Triangles
from rasterizer.pipeline.gradients import CODINGS
from rasterizer.pipeline.scan import scan
from rasterizer.pipeline.threads import Workers
from rasterizer.pipeline.transform import Vertices, make_screen
from rasterizer.pipeline.workspace import WorkspaceKind, make_workspace
from rasterizer.reference import coverage
from rasterizer.scene.camera import Projection, View

SERIAL = Workers(1)
NOTHING = np.empty((0, 3))


def plain_screen(is_perspective=True, depths=(1.0, 100.0), far_clip=np.inf, scale=1.0, center=(0.0, 0.0)):
    """A screen whose camera at the origin looks down -z; orthographic, scale 1: one unit is one pixel."""
    view = View(np.zeros(3), *np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, -1.0]]))
    return screen_of(view, Projection(scale, scale, *center, is_perspective), depths, far_clip)


def screen_of(view, projection, depths, far_clip=np.inf):
    """A screen that clips at the nearest of its depths."""
    return make_screen(view, projection, depths, depths[0], far_clip)


def plain_coding(kind, screen, level_scale=1.0, tolerance=0.0, normal_limit=0.0, needs_distance=False):
    """What entries and records hold, for a screen; `tolerance` in units of intensity."""
    inverse = 1.0 / screen.z_scale
    line = (-screen.z_offset * inverse, inverse)
    of_w, of_depth = (line, (0.0, 0.0)) if screen.is_perspective else ((1.0, 0.0), line)
    return CODINGS[kind](
        kind, level_scale, tolerance * level_scale, normal_limit, tolerance, needs_distance, *of_w, *of_depth
    )


def drawables_of(triangles, z, attributes, is_inverted=None):
    """Separate triangles (n, 3, 2), in 1/256 px, with z (n, 3), z-buffer units, and attributes (side, n, 3, k)."""
    triangles, n = np.asarray(triangles, np.int32), len(triangles)
    vertices = Vertices(*(np.ascontiguousarray(triangles[..., k].ravel()) for k in range(2)), z.ravel())
    columns = np.ascontiguousarray(np.arange(3 * n, dtype=np.uint32).reshape(n, 3).T)
    is_inverted = np.zeros(n, np.uint8) if is_inverted is None else np.asarray(is_inverted, np.uint8)
    n_side, *_, n_attribute = attributes.shape
    rows = np.ascontiguousarray(attributes.reshape(n_side, 3 * n, n_attribute))
    return Drawables(Triangles(columns, columns, is_inverted), vertices, rows)


def scan_alone(triangles, depth, attributes, coding, screen, size, is_inverted=None, n_group=0, n_channel=0):
    """Scan triangles (n, 3, 2), in 1/256 px, with depths (n, 3) and attributes (n, 3, k), into one band.

    Returns the workspace, how many records were written, and how many of them are exact.
    """
    depth, n, n_attribute = np.asarray(depth, float), len(triangles), attributes.shape[2]
    z = screen.z_offset + screen.z_scale * (1.0 / depth if screen.is_perspective else depth)
    dtype, n_channel = attributes.dtype, n_channel or n_attribute
    kind = WorkspaceKind(size[0], size[1], n_channel, n_attribute, n_group, dtype, False, False)
    workspace = make_workspace(kind, n)
    band = Band(np.arange(n, dtype=np.uint32), 0, size[1])
    drawables = drawables_of(triangles, z, attributes[None], is_inverted)
    counts = scan(band, drawables, coding, workspace.block, workspace.visibility, workspace.records)
    return workspace, *counts


def interpret(monkeypatch, *modules):
    """Let the interpreter run modules' kernels and helpers: compiled helpers have no entry for Python."""
    for module in modules:
        for name, value in list(vars(module).items()):
            if hasattr(value, "py_func"):
                monkeypatch.setattr(module, name, value.py_func)


def entries_of(workspace, size):
    """The visibility buffer without its padding, (rows, columns) int64."""
    visibility = workspace.visibility
    return visibility.entries.reshape(size[1], visibility.pitch)[:, : size[0]]


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


def lighting_of(lights, materials, view, dtype, albedo=NOTHING):
    """(Lighting, plan) of materials under lights, computed in `dtype`."""
    triangle = np.eye(3), [[0, 1, 2]]
    scene = rz.Scene([rz.Mesh(*triangle, material=material) for material in materials], lights)
    plan = make_plan(scene, Options(shading="phong"), albedo)._replace(dtype=np.dtype(dtype))
    return make_lighting(plan, view), plan


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
