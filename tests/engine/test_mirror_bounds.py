"""Climb for the largest value and the steepest slopes of the highlights of mirrors, against what their bounds say."""

import numpy as np
import pytest
from helpers.pinhole import unit

import rasterizer as rz
from rasterizer.engine.mirror_bounds import bound_lobe
from rasterizer.engine.reflection_table import entry_of

ROUGHNESSES = (0.06, 0.15, 0.3, 0.6, 1.0)
SUMS = (0.0, 0.01, 0.3, 1.0, 1.6, 2.0)
QUANTITIES = ("peak", "normal_slope", "light_slope")


def beckmann_visible(cosine, m):
    """G1(θ)/cos θ of Walter et al. 2007, equation 27."""
    slope = m * np.sqrt(np.maximum(1 - cosine * cosine, 1e-12))
    a, whole = cosine / slope, 1 / np.maximum(cosine, 1e-12)
    fraction = (3.535 + 2.181 * a) / (1 + a * (2.276 + a * 2.577)) / slope
    return np.where(a < 1.6, np.minimum(fraction, whole), whole)


def highlight(distribution, roughness, normals, to_light, to_viewer):
    """π D G/(4 N·V) for F = 1, (n,)."""
    half, square = to_light + to_viewer, roughness * roughness
    n_dot_l, n_dot_v = (np.maximum((normals * side).sum(axis=1), 0.0) for side in (to_light, to_viewer))
    half_square = (half * half).sum(axis=1)
    along = np.maximum((normals * half).sum(axis=1), 1e-6 * np.sqrt(half_square) + 1e-100)
    across = (np.cross(normals, half) ** 2).sum(axis=1)
    if distribution == "ggx":
        spread = square * along**2 + across
        x, y = n_dot_l, n_dot_v
        masked = x / (x + np.sqrt(square + (1 - square) * x * x)) / (y + np.sqrt(square + (1 - square) * y * y))
        return square * (half_square / spread) ** 2 * masked
    mirrors = np.exp(-across / along**2 / square) / square * (half_square / along**2) ** 2
    return mirrors * n_dot_l * beckmann_visible(n_dot_l, roughness) * beckmann_visible(n_dot_v, roughness) / 4


def steepness(function, directions, angle=1e-6):
    """The length of the gradient of a function of unit vectors, by differences over a small angle."""
    one = unit(np.cross(directions, (0.3, 0.5, 0.8)))
    parts = []
    for way in (one, np.cross(directions, one)):
        ends = [function(unit(directions + sign * angle * way)) for sign in (-1, 1)]
        parts.append((ends[1] - ends[0]) / (2 * angle))
    return np.hypot(*parts)


def quantities(distribution, roughness, angles):
    """The three quantities at points that are given by θ, δ and the azimuth of N about H, (3, n); 0 where N·V <= 0."""
    theta, delta, azimuth = angles.T
    nothing = np.zeros_like(theta)
    to_light, to_viewer = (np.stack([s * np.sin(theta), nothing, np.cos(theta)], axis=1) for s in (1, -1))
    across = np.sin(delta)[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth), nothing], axis=1)
    normals = across + np.cos(delta)[:, None] * np.array([0.0, 0.0, 1.0])
    of_normal = steepness(lambda n: highlight(distribution, roughness, n, to_light, to_viewer), normals)
    of_light = steepness(lambda l: highlight(distribution, roughness, normals, l, to_viewer), to_light)
    found = np.stack([highlight(distribution, roughness, normals, to_light, to_viewer), of_normal, of_light])
    return found * ((normals * to_viewer).sum(axis=1) > 1e-5)


def climb(rng, distribution, roughness, least_sum, quantity, n=3000, n_best=120, n_step=40):
    """The largest value of a quantity that is found where |L + V| >= least_sum."""
    widest = np.arccos(least_sum / 2)
    theta = np.where(rng.random(n) < 0.5, widest, np.arccos(rng.uniform(least_sum, 2, n) / 2))
    delta = np.abs(roughness * rng.normal(size=n) * rng.choice([0.3, 1, 2], n))
    angles = np.stack([theta, np.minimum(delta, 1.5), rng.uniform(0, 2 * np.pi, n)], axis=1)
    values = quantities(distribution, roughness, angles)[quantity]
    best = np.argsort(-values)[:n_best]
    angles, values = angles[best], values[best]
    for step in 0.1 * 0.92 ** np.arange(n_step):
        moved = angles + step * rng.normal(size=angles.shape) * (1.0, roughness, 1.0)
        moved = np.clip(moved, (0, 0, -10), (widest, 1.57, 10))
        found = quantities(distribution, roughness, moved)[quantity]
        angles = np.where((found > values)[:, None], moved, angles)
        values = np.maximum(found, values)
    return values.max()


@pytest.mark.parametrize("least_sum", SUMS)
@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
def test_no_highlight_is_larger_or_steeper_than_its_bound(distribution, least_sum):
    rng = np.random.default_rng(3)
    for roughness in ROUGHNESSES:
        bounds = bound_lobe(distribution, roughness, np.array([least_sum]))
        for number, name in enumerate(QUANTITIES):
            worst, bound = climb(rng, distribution, roughness, least_sum, number), getattr(bounds, name)[0]
            assert worst <= bound * (1 + 1e-5), f"{name}, roughness {roughness}: {worst:.4g} > {bound:.4g}"
            assert worst > 0.05 * bound, f"{name}, roughness {roughness}: {worst:.4g} is far below {bound:.4g}"


def test_the_peak_is_found_where_light_and_viewer_are_one():
    """There N = H is brightest: 1/(4 α²)."""
    for roughness in (0.06, 0.3, 0.7):
        for distribution in ("ggx", "beckmann"):
            peak = bound_lobe(distribution, roughness, np.array([2.0])).peak[0]
            assert peak == pytest.approx(1 / (4 * roughness**2), rel=0.08)


def test_bounds_fall_with_the_least_sum_and_are_below_the_brightest_highlight():
    sums = np.linspace(0, 2, 41)
    for distribution in ("ggx", "beckmann"):
        for roughness in (0.001, 0.05, 0.3, 1.0):
            material = rz.Material(reflection="cook-torrance", roughness=roughness, distribution=distribution)
            bounds = bound_lobe(distribution, roughness, sums)
            for name, values in zip(bounds._fields, bounds, strict=True):
                assert np.isfinite(values).all() and (np.diff(values) <= 1e-12 * values[:-1]).all(), name
            assert (entry_of(material).highlight_bounds(material, 2.0**-24, sums).peaks <= 1.0).all()
            assert bounds.peak[0] <= 1.001 * entry_of(material).brightest_highlight(material)
