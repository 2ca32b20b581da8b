"""Check that a light is left out for a batch only where its function writes a strength of exactly 0 at every point."""

from itertools import product

import numpy as np
import pytest
from helpers.batches import DTYPES, axes_of, call, read, unit, write

import rasterizer as rz
from rasterizer.engine.light_table import entry_of
from rasterizer.engine.uniforms import light_limits_of
from rasterizer.pipeline import fragments as f
from rasterizer.pipeline import light_kinds
from rasterizer.pipeline.light_limits import bound_positions, is_within

VIEW = rz.Camera.perspective((1.0, 2.0, 6.0), (0, 0, 0)).view()


def batch_of(points, dtype):
    """A batch whose points (n, 3), at most BATCH_SIZE, have positions and normals."""
    batch = f.make_batch(dtype)
    write(batch, axes_of(f.POSITION), points.T)
    write(batch, axes_of(f.NORMAL), np.repeat([[0.0], [0.0], [1.0]], len(points), axis=1))
    return batch


def rows_of(light, dtype):
    """The coefficients of a light and its limits, in a type."""
    coefficients = np.zeros(light_kinds.N_LIGHT_COEFFICIENT)
    entry_of(light).write(coefficients, light, VIEW, np.dtype(dtype))
    return coefficients.astype(dtype), light_limits_of(light, coefficients).astype(dtype)


def random_light(rng):
    place, way = rng.normal(size=3), unit(rng.normal(size=3))
    reach = float(10.0 ** rng.uniform(-1, 1))
    if rng.random() < 0.4:
        return rz.PointLight(place, 1.0, range=reach)
    outer = float(10.0 ** rng.uniform(-2, np.log10(90.0)))
    inner = float(rng.choice([outer, 0.5 * outer]))
    return rz.SpotLight(place, way, 1.0, inner, outer, range=reach if rng.random() < 0.3 else None)


def points_at_the_edge(rng, light, n):
    """Points in a small box next to where a light ends, beyond by 10^-7 to 1 of the way, from the eye; or on a line
    straight towards that end, whose box is no larger than it."""
    off, size = 10.0 ** rng.uniform(-7, 0) * rng.choice([-0.3, 1.0]), 10.0 ** rng.uniform(-6, -0.5)
    way, far = unit(rng.normal(size=3)), 10.0 ** rng.uniform(-1, 1)
    towards = way
    if isinstance(light, rz.SpotLight):
        axis = np.array(light.direction)
        across = unit(np.cross(axis, way))
        angle = min(np.radians(light.outer) + off, 3.0)
        way = np.cos(angle) * axis + np.sin(angle) * across
        towards = np.cos(np.radians(light.outer)) * across - np.sin(np.radians(light.outer)) * axis
    else:
        far = light.range * (1.0 + off)
    spread = rng.uniform(-1, 1, (n, 3)) if rng.random() < 0.5 else np.linspace(-1, 1, n)[:, None] * towards
    return np.array(light.position) + far * way + size * far * spread - VIEW.eye


@pytest.mark.parametrize("dtype", DTYPES)
def test_what_is_left_out_has_no_strength(dtype):
    rng, n_out, n_dark = np.random.default_rng(3), 0, 0
    for _ in range(800):
        light, n = random_light(rng), int(rng.integers(1, 60))
        points = points_at_the_edge(rng, light, n)
        coefficients, limits = rows_of(light, dtype)
        batch = batch_of(points, dtype)
        is_kept = is_within(bound_positions(batch, n), limits)
        call(entry_of(light).function(light).evaluate, batch, n, coefficients)
        found = read(batch, [f.STRENGTH], n)[0]
        assert is_kept or (found == 0.0).all(), f"{light}: {found.max():.3g} > 0"
        n_out, n_dark = n_out + (not is_kept), n_dark + bool((found == 0.0).all())
    assert n_out > 0.5 * n_dark > 50, f"{n_out} left out of {n_dark} batches without light"


def test_the_box_holds_all_points_and_is_no_larger():
    rng = np.random.default_rng(4)
    for n, dtype in product((1, 7, 256), DTYPES):
        points = (rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-20, 15, (n, 1))).astype(dtype)
        points[rng.random((n, 3)) < 0.05] = 0.0
        low, high = bound_positions(batch_of(points, dtype), n)
        assert np.array_equal(low, points.min(axis=0)) and np.array_equal(high, points.max(axis=0)), (n, dtype)


def test_lights_without_an_end_are_never_left_out():
    box = ((-1e9, 3.0, 0.0), (-1e8, 5.0, 1.0))
    for light in (rz.DirectionalLight((0, 0, -1)), rz.PointLight((0, 0, 0))):
        assert is_within(box, rows_of(light, np.float64)[1]), light


def test_a_range_whose_square_has_no_number_is_kept():
    limits = rows_of(rz.PointLight((0, 0, 0), range=1e-200), np.float64)[1]
    assert is_within(((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), limits)
