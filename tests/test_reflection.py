"""Check the reflection models against closed forms, and powers against the bounds in their docstrings."""

import numpy as np
import pytest
from test_light_rows import DTYPES, call, take

from rasterizer._kernel import kernel
from rasterizer.pipeline import rows as r
from rasterizer.pipeline.reflection import (
    MOST_SQUARED,
    N_MATERIAL_NUMBER,
    REFLECTIONS,
    SHININESS,
    power_single,
)

WRITTEN = (r.DIFFUSE, r.SPECULAR)
ULP = 2.0**-24


def reflect(model, dtype, n_dot_l, n_dot_v, l_dot_v, strength=1.0, shininess=8.0):
    """Evaluate a reflection model; return DIFFUSE and SPECULAR as computed in `dtype`, (2, n) float64."""
    columns = np.broadcast_arrays(*np.atleast_1d(n_dot_l, n_dot_v, l_dot_v, strength))
    n, results = len(columns[0]), []
    numbers = np.zeros(N_MATERIAL_NUMBER, dtype)
    numbers[SHININESS] = shininess
    for start in range(0, n, r.CHUNK):
        rows = r.make_rows(dtype)
        rows[:] = np.nan  # nothing may be taken over from before
        part = [column[start : start + r.CHUNK] for column in columns]
        for first, values in zip((r.N_DOT_L, r.N_DOT_V, r.L_DOT_V, r.STRENGTH), part, strict=True):
            rows[int(first) : int(first) + len(values)] = values
        call(REFLECTIONS[model], rows, len(part[0]), numbers)
        results.append(take(rows, WRITTEN, len(part[0])))
    return np.concatenate(results, axis=1)


def directions(seed, n, dtype):
    """Cosines (N·L, N·V, L·V) of random directions, rounded to `dtype`, float64."""
    rng = np.random.default_rng(seed)
    n_, l_, v_ = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in rng.normal(size=(3, n, 3)))
    cosines = (n_ * l_).sum(axis=1), (n_ * v_).sum(axis=1), (l_ * v_).sum(axis=1)
    return [c.astype(dtype).astype(float) for c in cosines]


def highlight(model, n_dot_l, n_dot_v, l_dot_v):
    """The cosine that is raised to the exponent."""
    if model == "phong":
        return 2 * n_dot_l * n_dot_v - l_dot_v
    return (n_dot_l + n_dot_v) / np.sqrt(2 + 2 * l_dot_v)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("model", REFLECTIONS)
def test_matte_part_is_lamberts_cosine(model, dtype):
    cosines = directions(0, 1000, dtype)
    for strength in (1.0, 0.25, 3.0):
        diffuse = reflect(model, dtype, *cosines, strength)[0]
        expected = strength * np.maximum(cosines[0], 0)
        assert np.abs(diffuse - expected).max() <= strength * np.finfo(dtype).eps
        assert (diffuse[cosines[0] <= 0] == 0).all()


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("shininess", [0.5, 1, 1.5, 2, 3, 8, 32, 33.3, 80, 255, 1000])
@pytest.mark.parametrize("model", ["phong", "blinn"])
def test_highlights_in_closed_form(model, shininess, dtype):
    """The relative error of the cosine is magnified by the exponent; that of the power comes on top."""
    n_dot_l, n_dot_v, l_dot_v = directions(1, 20_000, dtype)
    # Where L and V look against each other the half vector has no digits left; a test of its own looks there.
    is_sound = l_dot_v > -0.5
    n_dot_l, n_dot_v, l_dot_v = n_dot_l[is_sound], n_dot_v[is_sound], l_dot_v[is_sound]
    _, specular = reflect(model, dtype, n_dot_l, n_dot_v, l_dot_v, 0.5, shininess)
    cosine = np.maximum(highlight(model, n_dot_l, n_dot_v, l_dot_v), 0)
    expected = np.where(n_dot_l > 0, 0.5 * cosine**shininess, 0)
    # 4 roundings of the cosine, whose size is up to 3 before it is subtracted.
    eps = np.finfo(dtype).eps
    bound = (
        0.5 * ((cosine + 6 * eps) ** shininess - cosine**shininess)
        + 8 * eps * expected * (1 + shininess)
        + 2.0**-28
    )
    worst = (np.abs(specular - expected) / bound).max()
    assert worst <= 1, f"{worst} > 1 times the bound"
    assert (specular > 1e-6).sum() > 20


def test_the_mirror_direction_and_the_normal():
    """On the axis of the highlight it is 1 whatever the exponent; at a right angle to it, 0."""
    for dtype in DTYPES:
        for shininess in (1, 32, 33.3, 4096):
            for n_dot_l in (0.25, 0.5, 1.0):
                mirror = 2 * n_dot_l * n_dot_l - 1
                for model in ("phong", "blinn"):
                    found = reflect(model, dtype, n_dot_l, n_dot_l, mirror, 0.75, shininess)[1]
                    assert abs(found[0] - 0.75) <= 4 * shininess * np.finfo(dtype).eps
            assert reflect("phong", dtype, 0.5, 0.5, 0.9, 1.0, shininess)[1][0] == 0
    assert reflect("blinn", np.float64, 0.6, 0.8, 0.5, 1.0, 1)[1][0] == pytest.approx(
        1.4 / np.sqrt(3), rel=1e-15
    )


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("model", ["phong", "blinn"])
def test_no_highlight_from_behind(model, dtype):
    """N·L <= 0: nothing, also where R·V or N·H are large, and where the strength is infinite."""
    for n_dot_l in (0.0, -0.0, -1e-7, -0.3, -1.0):
        for strength in (1.0, np.inf):
            for l_dot_v in (-1.0, -0.99, 0.0, 1.0):
                for shininess in (1, 2.5, 40):
                    found = reflect(model, dtype, n_dot_l, 0.9, l_dot_v, strength, shininess)
                    assert found.ravel().tolist() == [0, 0]


def dot(a, b):
    """Dot products of rows, added in the order in which the kernels do."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("model", REFLECTIONS)
def test_no_directions_give_what_is_no_number(model, dtype):
    """All triples of directions out of a set with opposite, equal and nearly equal ones."""
    rng = np.random.default_rng(4)
    steps = np.concatenate([np.eye(3), -np.eye(3), [[0.6, 0, 0.8], [-0.6, 0, -0.8]], rng.normal(size=(4, 3))])
    steps = np.concatenate(
        [steps, steps + 1e-4 * rng.normal(size=steps.shape), steps + 1e-7 * rng.normal(size=steps.shape)]
    )
    steps = (steps / np.linalg.norm(steps, axis=1, keepdims=True)).astype(dtype)
    normal, to_light, to_viewer = (steps[k.ravel()] for k in np.meshgrid(*[np.arange(len(steps))] * 3))
    for shininess in (0.5, 1, 8, 33.3):
        found = reflect(
            model,
            dtype,
            dot(normal, to_light),
            dot(normal, to_viewer),
            dot(to_light, to_viewer),
            1.0,
            shininess,
        )[: 1 if model == "lambert" else 2]
        assert np.isfinite(found).all() and (found >= 0).all()


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("model", ["phong", "blinn"])
def test_no_highlight_is_brighter_than_its_light(model, dtype):
    """The sun on the horizon, straight ahead, down to where L + V is all rounding: no spark."""
    rng = np.random.default_rng(5)
    up, across = 10.0 ** rng.uniform(-5, -1, (2, 20_000)), 1e-4 * rng.normal(size=(2, 20_000))
    to_light, to_viewer = (
        np.stack([side * np.cos(u) * np.cos(a), np.cos(u) * np.sin(a), np.sin(u)], axis=1).astype(dtype)
        for side, u, a in zip((1, -1), up, across, strict=True)
    )
    for shininess in (1, 32, 33.3, 200):
        found = reflect(
            model, dtype, to_light[:, 2], to_viewer[:, 2], dot(to_light, to_viewer), 1.0, shininess
        )[1]
        most = 1 + 8 * shininess * np.finfo(dtype).eps
        assert found.max() <= most, f"{shininess}: {found.max():.4g} > {most:.4g}"


@pytest.mark.parametrize("shininess", [20, 80.5, 250])
@pytest.mark.parametrize("elevation", [0.05, 2.0, 10.0, 20.0])
@pytest.mark.parametrize("model", ["phong", "blinn"])
def test_highlights_of_grazing_light_have_the_digits_that_the_plan_counts_on(model, elevation, shininess):
    """A low sun ahead, over a floor: L is nearly -V. The plan allows 2^-24·8·exponent for a highlight.

    Unit vectors are rounded to float32, as in the rows, and so are their dot products.
    """
    rng = np.random.default_rng(2)
    n = 2000
    up = np.radians(elevation) * rng.uniform(0.5, 1.5, (2, n))
    across = np.radians(3.0) * rng.normal(size=(2, n))
    to_light, to_viewer = (
        np.stack([side * np.cos(u) * np.cos(a), np.cos(u) * np.sin(a), np.sin(u)], axis=1).astype(np.float32)
        for side, u, a in zip((1, -1), up, across, strict=True)
    )
    exact = [
        v.astype(float) / np.linalg.norm(v.astype(float), axis=1, keepdims=True)
        for v in (to_light, to_viewer)
    ]
    l_dot_v = dot(to_light, to_viewer)
    found = reflect(model, np.float32, to_light[:, 2], to_viewer[:, 2], l_dot_v, 1.0, shininess)[1]
    if model == "phong":
        cosine = 2 * exact[0][:, 2] * exact[1][:, 2] - (exact[0] * exact[1]).sum(axis=1)
    else:
        half = exact[0] + exact[1]
        cosine = half[:, 2] / np.linalg.norm(half, axis=1)
    error = np.abs(found - np.maximum(cosine, 0) ** shininess).max()
    budget = ULP * (16 + 8 * shininess)
    assert error <= budget, f"{error:.3g} > {budget:.3g}"


# ---------------------------------------------------------------- powers


@kernel
def powers(bases, exponent, out):
    """power_single of many."""
    for k in range(len(bases)):
        out[k] = power_single(bases[k], exponent)


def bases():
    """Float32 from 0 to a little above 1: near 1, at the ends of the mantissa's range, and all over."""
    one = np.float32(1).view(np.int32)
    near_one = np.arange(one - 3000, one + 40, dtype=np.int32).view(np.float32)
    root = np.float32(np.sqrt(0.5)).view(np.int32)
    ends = np.concatenate(
        [np.arange(root - 200, root + 200, dtype=np.int32) - (k << 23) for k in range(8)]
    ).astype(np.int32)
    rng = np.random.default_rng(3)
    return np.concatenate(
        [near_one, ends.view(np.float32), rng.random(60_000), 2.0 ** rng.uniform(-30, 0, 5000)]
    ).astype(np.float32)


@pytest.mark.parametrize("exponent", [0.5, 0.7, 1, 1.5, 2, 2.2, 5, 10.5, 33.3, 100, 333.3, 500.5, 1000])
def test_power_in_float32_keeps_the_bound_of_its_docstring(exponent):
    base, exponent = bases(), np.float32(exponent)
    found = np.empty_like(base)
    powers(base, exponent, found)
    log2 = np.log2(base.astype(float))
    expected = np.exp2(float(exponent) * log2)
    is_normal = float(exponent) * log2 > -125.9
    # The series, then the rounding of float32, relative to the result.
    series = 5.2e-9 + float(exponent) * np.log(2) * 1.1e-9
    bound = series + ULP * (4 + 3 * float(exponent) * np.abs(log2))
    share = np.abs(found[is_normal] / expected[is_normal] - 1) / bound[is_normal]
    worst = int(share.argmax())
    assert share[worst] <= 1, (
        f"{share[worst]:.3g} > 1 times the bound, for {base[is_normal][worst]!r} ** {exponent}"
    )
    assert (found[float(exponent) * log2 < -126.1] == 0).all() and is_normal.sum() > 3000


def test_power_of_what_is_not_positive_is_zero():
    base = np.array([0.0, -0.0, -1e-30, -0.5, -1.0, -1e30, np.float32(1e-45), np.nan], np.float32)
    for exponent in (0.5, 1, 33.3, 1000):
        found = np.full_like(base, 7)
        powers(base, np.float32(exponent), found)
        assert (found[:6] == 0).all() and np.isfinite(found).all()
        assert found[6] == 0 or exponent <= 1


def test_one_to_any_power_is_one():
    found = np.empty(1, np.float32)
    for exponent in np.linspace(0.5, 1000, 500, dtype=np.float32):
        powers(np.ones(1, np.float32), exponent, found)
        assert found[0] == 1


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("exponent", [1, 2, 3, 5, 8, 17, 100, 255, 256, 999, 1000, MOST_SQUARED])
def test_whole_exponents_by_squaring(exponent, dtype):
    """A product of `exponent` factors has that many roundings, less one; what is below 2^-28 is 0."""
    base = bases().astype(dtype)
    base = np.concatenate([base, -base[:100], np.zeros(1, dtype)])
    # Phong with N·V = 0: the cosine is -L·V, exactly.
    found = reflect("phong", dtype, 1.0, 0.0, -base.astype(float), 1.0, exponent)[1]
    expected = np.where(base > 0, np.maximum(base.astype(float), 0) ** exponent, 0)
    is_seen = expected > 2.0**-28 * 1.01
    bound = exponent * np.finfo(dtype).eps / 2 * 1.01 + 4e-16 * exponent
    error = np.abs(found[is_seen] / expected[is_seen] - 1).max()
    assert error <= bound, f"{error:.3g} > {bound:.3g}"
    assert (found[expected < 2.0**-28 * 0.99] == 0).all() and is_seen.sum() > 2000
    between = found[~is_seen]
    assert ((between == 0) | (between > 2.0**-28 * 0.98)).all()
