"""What a shadow map holds, against rational numbers: planes of depth whose steps are whole units of the z-buffer."""

from fractions import Fraction

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.engine.shadow_maps import Casters, draw_shadow_map
from rasterizer.geometry.points import gather_geometry
from rasterizer.pipeline import shadow_lookup as lookup
from rasterizer.pipeline.threads import Workers
from rasterizer.pipeline.workspace import WorkspacePool
from rasterizer.scene.camera import View

RANGE = (-40.0, 40.0)  # of what casts shadows along the light's direction, scene units


def gentle_triangle(rng):
    """Three corners in a square of 2 x 2 before the light, which is far above: large or small, sloped a little."""
    side = 2.0 ** rng.uniform(-3, 0)
    corners = rng.uniform(-1, 1, (3, 2)) * side + rng.uniform(side - 1, 1 - side, 2)
    slopes = rng.normal(size=2) * 2.0 ** rng.uniform(-10, 0)
    return np.column_stack([corners, corners @ slopes + rng.uniform(-30, 30)])


def drawn_map(corners, light, size):
    """(texels (size, size), row of the header) of a map that a triangle alone casts into, fitted to 2 x 2 x RANGE."""
    scene = rz.Scene(rz.Mesh(corners, [[0, 1, 2]]), light)
    box = np.array([[(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in RANGE]])
    casters = Casters(gather_geometry(scene, False), box)
    view = View(np.zeros(3), *np.eye(3))
    found = draw_shadow_map(light, view, casters, np.dtype(float), WorkspacePool(), Workers(1))
    row = found.block[lookup.MAPS : lookup.MAPS + lookup.N_MAP_COLUMN]
    return found.block[lookup.HEADER :].reshape(size, size), row, found.origin


def worst_error(corners, light, size, rng):
    """The largest error of some texels over what the header says, and the header's figure over the map's range."""
    texels, row, origin = drawn_map(corners, light, size)
    is_perspective = isinstance(light, rz.SpotLight)
    right, up, forward = (row[start : start + 3] for start in (lookup.RIGHT, lookup.UP, lookup.FORWARD))
    away = corners - origin
    depth = away @ forward
    x = row[lookup.CENTER_X] + row[lookup.SCALE_X] * (away @ right) / (depth if is_perspective else 1.0)
    y = row[lookup.CENTER_Y] - row[lookup.SCALE_Y] * (away @ up) / (depth if is_perspective else 1.0)
    values = [1 / Fraction(d) if is_perspective else -Fraction(d) for d in depth.tolist()]
    points = [(int(256 * a), int(256 * b)) for a, b in zip(np.rint(256 * x) / 256, np.rint(256 * y) / 256, strict=True)]
    rows, columns = np.nonzero(np.isfinite(texels))
    if not len(rows):
        return 0.0
    chosen = np.unique([*rng.integers(0, len(rows), 40), 0, len(rows) - 1, columns.argmin(), columns.argmax()])
    worst = Fraction(0)
    for k in chosen.tolist():
        i, j = int(columns[k]), int(rows[k])
        expected = plane_at(points, values, 256 * i + 128, 256 * j + 128)
        worst = max(worst, abs(Fraction(float(texels[j, i])) - expected))
    # A texel is rounded in float64, and so are its corners.
    return float(worst - Fraction(2) ** -50 * max(map(abs, values))) / row[lookup.ROUNDING]


def plane_at(points, values, x, y):
    """The plane through three points with values, at (x, y), all in rational numbers."""
    (ax, ay), (bx, by), (cx, cy) = points
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    b = Fraction((x - ax) * (cy - ay) - (y - ay) * (cx - ax), area)
    c = Fraction((y - ay) * (bx - ax) - (x - ax) * (by - ay), area)
    return values[0] + b * (values[1] - values[0]) + c * (values[2] - values[0])


LIGHTS = {
    "directional": lambda shadow: rz.DirectionalLight((0.0, 0.0, -1.0), shadow=shadow),
    "spot": lambda shadow: rz.SpotLight((0.0, 0.0, 60.0), (0.0, 0.0, -1.0), outer=20.0, inner=10.0, shadow=shadow),
}


@pytest.mark.parametrize("size", [16, 100, 512, 1024])
@pytest.mark.parametrize("kind", LIGHTS)
def test_texels_err_by_no_more_than_their_map_says(kind, size):
    """Whatever size, slope and place; and what it says is no more than a few times what is met."""
    rng, light = np.random.default_rng(size), LIGHTS[kind](rz.Shadow(size))
    worst = max(worst_error(gentle_triangle(rng), light, size, rng) for _ in range(30))
    assert worst <= 1, f"{worst} > 1 times the rounding that the header says"
    least = 0.1 if size > 500 else 0.02  # in small maps, what slivers would err by is most of it
    assert worst > least, f"{worst}: the header says {1 / worst:.0f} times what is met"
