"""Check the light functions against closed forms, in both floating-point types."""

from itertools import product

import numpy as np
from helpers.batches import DTYPES, axes_of, call, read, write
from helpers.pairs import pairs

from rasterizer.pipeline import fragments as f
from rasterizer.pipeline import lights
from rasterizer.pipeline.lights import (
    ATTENUATION,
    AXIS,
    CONE_EXPONENT,
    CONE_FALLOFF,
    CONE_SCALE,
    COS_OUTER,
    INVERSE_RANGE,
    MAX_STRENGTH,
    N_LIGHT_COEFFICIENT,
    VECTOR,
)

WRITTEN = (*axes_of(f.LIGHT_DIR), f.N_DOT_L, f.STRENGTH)


def points(seed, n, dtype):
    """A batch of random points; returns it, and normals and positions, (n, 3) each."""
    rng = np.random.default_rng(seed)
    batch = f.make_batch(dtype)
    batch[:] = 55.0  # nothing may be taken over from before
    vectors = rng.normal(size=(2, n, 3))
    vectors[0] /= np.linalg.norm(vectors[0], axis=1, keepdims=True)
    vectors[1] *= 3
    quantities = axes_of(f.NORMAL), axes_of(f.POSITION)
    for axes, values in zip(quantities, vectors, strict=True):
        write(batch, axes, values.T)
    return batch, *(read(batch, axes, n).T for axes in quantities)


def light(dtype, vector, attenuation=(1, 0, 0), most=1.0):
    """A light's coefficients."""
    coefficients = np.zeros(N_LIGHT_COEFFICIENT, dtype)
    coefficients[VECTOR : VECTOR + 3], coefficients[ATTENUATION : ATTENUATION + 3] = vector, attenuation
    coefficients[MAX_STRENGTH], coefficients[CONE_FALLOFF] = most, 1.0
    return coefficients


def test_directional_light_is_the_same_everywhere():
    for n, dtype in product((0, 1, 7, f.BATCH_SIZE), DTYPES):
        batch, normals, _ = points(n, n, dtype)
        before, case = batch.copy(), f"{n} points, {dtype.__name__}"
        direction = np.array([0.6, -0.48, 0.64])
        call(lights.directional, batch, n, light(dtype, direction))
        *light_dir, n_dot_l, strength = read(batch, WRITTEN, n)
        error, budget = np.abs(n_dot_l - normals @ direction).max(initial=0), 4 * np.finfo(dtype).eps
        assert error <= budget, f"{case}: {error:.3g} > {budget:.3g}"
        assert (np.transpose(light_dir) == direction.astype(dtype)).all() and (strength == 1).all(), case
        for first in WRITTEN:
            before[int(first) : int(first) + n] = batch[int(first) : int(first) + n]
        assert (batch == before).all(), f"{case}: something else was written"


def test_point_light_falls_off_in_closed_form():
    n, position = 200, np.array([1.0, -2.0, 0.5])
    falls = (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0.1, 0.05), (0.01, 0, 0.3), (0.5, 0, 0)
    for attenuation, most, dtype in product(falls, (1.0, np.inf), DTYPES):
        batch, normals, positions = points(1, n, dtype)
        call(lights.point, batch, n, light(dtype, position, attenuation, most))
        *found, n_dot_l, strength = read(batch, WRITTEN, n)
        light_dir = position - positions
        distance = np.linalg.norm(light_dir, axis=1)
        light_dir /= distance[:, None]
        kc, kl, kq = np.array(attenuation, dtype).astype(float)
        expected, eps = np.minimum(most, 1 / (kc + kl * distance + kq * distance**2)), np.finfo(dtype).eps
        # Half an eps for each of: the difference, 3.5 on the way to 1/distance, the product; 5.5 halves.
        for name, error, budget in (
            ("strength", np.abs(strength / expected - 1).max(), 6 * eps),
            ("N·L", np.abs(n_dot_l - (normals * light_dir).sum(axis=1)).max(), 6 * eps),
            ("L", np.linalg.norm(np.transpose(found) - light_dir, axis=1).max(), 3 * eps),
        ):
            assert error <= budget, f"{name}: {error:.3g} > {budget:.3g}, {attenuation}, {most=}, {dtype.__name__}"


def test_point_light_at_a_known_distance():
    """Straight above the surface: direction, cosine and strength are right to the last bit."""
    for distance, dtype in product((0.25, 1.0, 2.0, 1000.0), DTYPES):
        batch = f.make_batch(dtype)
        batch[axes_of(f.NORMAL)[2]] = 1
        for attenuation, strength in (((0, 0, 1), distance**-2), ((0, 2, 0), 0.5 / distance), ((4, 0, 0), 0.25)):
            for side, most in ((1.0, np.inf), (-1.0, 1.0)):
                lamp = light(dtype, (0, 0, side * distance), attenuation, most)
                call(lights.point, batch, 1, lamp)
                wanted = [0.0, 0.0, side, side, min(most, dtype(strength))]
                assert read(batch, WRITTEN, 1)[:, 0].tolist() == wanted, f"{distance}, {attenuation}, {dtype.__name__}"


def test_a_light_in_the_surface_point_lights_nothing():
    """It comes from nowhere: direction and cosine are 0, and nothing is no number."""
    for dtype, most, attenuation in product(DTYPES, (1.0, np.inf), ((1, 0, 0), (0, 0, 1), (0, 1, 0))):
        batch = points(3, 5, dtype)[0]
        position = read(batch, axes_of(f.POSITION), 5)[:, 2]
        call(lights.point, batch, 5, light(dtype, position, attenuation, most))
        found, case = read(batch, WRITTEN, 5), f"{attenuation}, {most=}, {dtype.__name__}"
        assert (found[:4, 2] == 0).all() and not np.isnan(found).any(), case
        assert found[4, 2] == min(most, np.inf if attenuation[0] == 0 else 1.0), case
        coefficients = cone(light(dtype, position, attenuation, most), (0, 0, 1), 10, 20, 3)
        coefficients[INVERSE_RANGE] = 0.5
        call(lights.spot, batch, 5, coefficients)
        found = read(batch, WRITTEN, 5)
        assert not np.isnan(found).any() and (found[:, 2] == 0).all(), f"spot, {case}"


def cone(coefficients, axis, inner, outer, exponent):
    """Make a spot light of a point light's coefficients; angles in degrees."""
    c_inner, c_outer = np.cos(np.radians([inner, outer]))
    coefficients[AXIS : AXIS + 3], coefficients[COS_OUTER], coefficients[CONE_EXPONENT] = axis, c_outer, exponent
    coefficients[CONE_SCALE] = 1 / (c_inner - c_outer) if inner < outer else np.inf
    return coefficients


def test_the_strength_ends_at_the_range():
    n, position = 200, np.array([1.0, -2.0, 0.5])
    for kind, reach, dtype in product(("point", "spot"), (0.5, 3.0, 100.0), DTYPES):
        batch, _, positions = points(4, n, dtype)
        coefficients = cone(light(dtype, position, (0, 0, 1), np.inf), (1, 0, 0), 0, 180, 0)
        call(lights.point, batch, n, coefficients)
        before = read(batch, WRITTEN, n)[4]
        coefficients[INVERSE_RANGE] = 1 / reach
        coefficients[COS_OUTER], coefficients[CONE_SCALE] = -2, np.inf  # a cone that holds everything
        call({"point": lights.point, "spot": lights.spot}[kind], batch, n, coefficients)
        strength = read(batch, WRITTEN, n)[4]
        share = np.linalg.norm(position - positions, axis=1) / reach
        error = np.abs(strength - before * np.maximum(0, 1 - share**4)).max()
        # The relative error of (d/r)^4 is four times that of d/r.
        budget = ((before * np.minimum(share, 1) ** 4).max() * 10 + before.max()) * np.finfo(dtype).eps
        case = f"{kind}, range {reach}, {dtype.__name__}"
        assert error <= budget, f"{case}: {error:.3g} > {budget:.3g}"
        assert (strength[share > 1 + 1e-6] == 0).all() and (strength[share < 1 - 1e-6] > 0).all(), case


def test_a_spot_light_is_a_point_light_in_a_cone():
    """Also one whose fall is raised to a power."""
    n, position, axis = f.BATCH_SIZE, np.array([0.5, 1.0, -0.25]), np.array([0.36, -0.48, 0.8])
    for (inner, outer), exponent, falloff, dtype in pairs(
        angles=((0, 90), (10, 30), (29, 30), (20, 20), (45, 45), (0, 5)), exponent=(0, 1, 7.5, 128),
        falloff=(1.0, 1.7, 2.5), dtype=DTYPES,
    ):  # fmt: skip
        rng, eps = np.random.default_rng(outer), np.finfo(dtype).eps
        batch, normals, _ = points(5, n, dtype)
        # Points all over the cone, and somewhat beyond.
        angle, azimuth = rng.uniform(0, 1.3 * np.radians(outer), n), rng.uniform(0, 2 * np.pi, n)
        side = np.cross(axis, [0, 0, 1]) / np.linalg.norm(np.cross(axis, [0, 0, 1]))
        across = side * np.cos(azimuth)[:, None] + np.cross(axis, side) * np.sin(azimuth)[:, None]
        ways = axis * np.cos(angle)[:, None] + across * np.sin(angle)[:, None]
        write(batch, axes_of(f.POSITION), (position + rng.uniform(0.5, 4, n)[:, None] * ways).T)
        coefficients = light(dtype, position, (0, 1, 0))
        call(lights.point, batch, n, coefficients)
        of_point = read(batch, WRITTEN, n)
        coefficients[CONE_FALLOFF] = falloff
        name, function = ("spot", lights.spot) if falloff == 1.0 else ("shaped spot", lights.shaped_spot)
        call(function, batch, n, cone(coefficients, axis, inner, outer, exponent))
        found, case = read(batch, WRITTEN, n), f"{name}, {inner}°..{outer}°, {exponent=}, {falloff=}, {dtype.__name__}"
        assert (found[:4] == of_point[:4]).all(), case
        c, (c_inner, c_outer) = -(found[:3].T @ axis), np.cos(np.radians([inner, outer]))
        t = np.clip((c - c_outer) / (c_inner - c_outer), 0, 1) if inner < outer else 1.0 * (c >= c_outer)
        expected = of_point[4] * (t**2 * (3 - 2 * t)) ** falloff * np.clip(c, 0, 1) ** exponent
        # Eight roundings on the way to c, magnified by the slopes of the cone and the exponents.
        steepness = (1.5 * falloff / (c_inner - c_outer) if inner < outer else 0) + exponent
        budget = (8 + 8 * steepness) * eps
        is_sure = np.abs(c - c_outer) > (8 * eps if inner == outer else -1)
        error = np.abs(found[4] - expected)[is_sure].max()
        assert error <= budget, f"{case}: {error:.3g} > {budget:.3g}"
        assert is_sure.sum() > n - 5 and (expected == 0).sum() > 20 and (expected > 0).sum() > 20, case
