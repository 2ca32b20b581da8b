"""Check the reflection models against closed forms, and powers against the bounds in their docstrings."""

from itertools import product

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.batches import (
    CLASSIC,
    COEFFICIENTS,
    DIFFUSE,
    DTYPES,
    REFLECTION_FUNCTIONS,
    UP,
    directions_of,
    dot,
    polar,
    random_directions,
    reflect,
    unit,
)
from helpers.pairs import pairs

from rasterizer.compiler.kernels import kernel
from rasterizer.pipeline.power import exponential_single, power
from rasterizer.pipeline.reflection import MAX_SQUARED

ULP = 2.0**-24
HIGHLIGHTS = list(product(("phong", "blinn"), DTYPES))


def highlight(model, normal, light_dir, view_dir):
    """The cosine that is raised to the exponent, in float64."""
    normal, light_dir, view_dir = (v.astype(float) for v in (normal, light_dir, view_dir))
    if model == "phong":
        return 2 * dot(normal, light_dir) * dot(normal, view_dir) - dot(light_dir, view_dir)
    half = light_dir + view_dir
    return dot(normal, half) / np.linalg.norm(half, axis=1)


def test_the_diffuse_part_is_lamberts_cosine():
    for model, dtype in product(
        [model for model in REFLECTION_FUNCTIONS if model not in ("oren-nayar", "toon")], DTYPES
    ):
        sides = random_directions(0, 300, dtype)
        cosine = dot(sides[0].astype(float), sides[1].astype(float))
        for strength in (1.0, 0.25, 3.0):
            diffuse, case = reflect(model, *sides, strength)[0], f"{model}, {dtype.__name__}, strength {strength}"
            error, budget = np.abs(diffuse - strength * np.maximum(cosine, 0)).max(), strength * np.finfo(dtype).eps
            assert error <= budget, f"{case}: {error:.3g} > {budget:.3g}"
            assert (diffuse[cosine <= 0] == 0).all(), case


@pytest.mark.parametrize("model, dtype", HIGHLIGHTS)
def test_highlights_in_closed_form(model, dtype):
    """The relative error of the cosine is magnified by the exponent; that of the power comes on top."""
    sides, eps = random_directions(1, 10_000, dtype), np.finfo(dtype).eps
    cosine = np.maximum(highlight(model, *sides), 0)
    is_lit = dot(sides[0].astype(float), sides[1].astype(float)) > 0
    for shininess in (0.5, 1, 1.5, 2, 3, 8, 33.3, 80, 255, 1000):
        _, specular = reflect(model, *sides, 0.5, shininess)
        expected = np.where(is_lit, 0.5 * cosine**shininess, 0)
        # Roundings of the cosine, half an eps each. R·V: 3 of up to 2 in 2 (N·L)(N·V), 3 in L·V, 1 in the difference.
        # N·H: 1 in L + V, 3 in the product, 2.5 in the length, 1 in the quotient. Wherever L and V look.
        magnified = 0.5 * ((cosine + 6 * eps) ** shininess - cosine**shininess)
        bound = magnified + 8 * eps * expected * (1 + shininess) + 2.0**-28
        worst = (np.abs(specular - expected) / bound).max()
        assert worst <= 1, f"exponent {shininess}: {worst:.3g} > 1 times the bound"
        assert (specular > 1e-6).sum() > 10, shininess


def test_the_mirror_direction_and_the_normal():
    """On the axis of the highlight it is 1 whatever the exponent; at a right angle to it, 0."""
    for dtype in DTYPES:
        for shininess in (1, 32, 33.3, 4096):
            budget = 4 * shininess * np.finfo(dtype).eps
            for cosine in (0.25, 0.5, 1.0):
                for azimuth in (0.0, 0.7):
                    sides = directions_of(dtype, UP, polar(cosine, azimuth), polar(cosine, azimuth + np.pi))
                    for model in ("phong", "blinn"):
                        error = abs(reflect(model, *sides, 0.75, shininess)[1][0] - 0.75)
                        assert error <= budget, f"{model}: {error:.3g} > {budget:.3g}"
            # L·V = 0.9: more than a right angle from the mirror direction.
            aside = directions_of(dtype, UP, polar(0.5), polar(0.5, np.arccos(0.65 / 0.75)))
            assert reflect("phong", *aside, 1.0, shininess)[1][0] == 0
    # L·V = 0.5
    sides = directions_of(np.float64, UP, polar(0.6), polar(0.8, np.arccos(0.02 / 0.48)))
    assert reflect("blinn", *sides, 1.0, 1)[1][0] == pytest.approx(1.4 / np.sqrt(3), rel=1e-15)


@pytest.mark.parametrize("model, dtype", HIGHLIGHTS)
def test_no_highlight_from_behind(model, dtype):
    """N·L <= 0: nothing, also where R·V or N·H are large, and where the strength is infinite."""
    for n_dot_l in (0.0, -0.0, -1e-7, -0.3, -1.0):
        # With these signs of zero all three products, and so N·L, are -0.0 where it is asked for.
        light_dir = np.array([-np.sqrt(1 - n_dot_l**2), -0.0, n_dot_l])
        viewers = [polar(0.9, azimuth) for azimuth in (0.0, 1.0, np.pi)] + [UP]
        viewers += [light_dir, -light_dir, light_dir * (-1, -1, 1)]  # the last: in the mirror direction, R·V = 1
        sides = directions_of(dtype, UP, light_dir, viewers)
        assert np.signbit(dot(sides[0], sides[1])).all() == np.signbit(n_dot_l)
        with np.errstate(invalid="ignore"):
            cosine = np.nanmax(highlight(model, *sides))  # there is no half vector of L and -L
        assert cosine > 0.4 or n_dot_l == -1.0
        for strength in (1.0, np.inf):
            for shininess in (1, 2.5, 40):
                assert (reflect(model, *sides, strength, shininess) == 0).all(), (n_dot_l, strength, shininess)


def test_no_directions_give_what_is_no_number():
    """All triples of directions out of a set with opposite, equal and nearly equal ones, and with none."""
    rng = np.random.default_rng(4)
    steps = np.concatenate([np.eye(3), -np.eye(3), [[0.6, 0, 0.8], [-0.6, 0, -0.8]], rng.normal(size=(1, 3))])
    steps = np.concatenate([steps, *(steps + size * rng.normal(size=steps.shape) for size in (1e-4, 1e-7))])
    # A point without a normal, in the light or in the eye: the kernels write zeros.
    steps = np.concatenate([unit(steps), np.zeros((1, 3))])
    triples = [steps[k.ravel()] for k in np.meshgrid(*[np.arange(len(steps))] * 3)]
    for model, dtype, shininess, has_kernels_cosines in pairs(
        model=tuple(REFLECTION_FUNCTIONS), dtype=DTYPES, shininess=(0.5, 1, 8, 33.3), has_kernels_cosines=(False, True)
    ):
        found = reflect(model, *directions_of(dtype, *triples), 1.0, shininess, has_kernels_cosines)
        found = found[: 1 if model in DIFFUSE else 2]
        case = f"{model}, {dtype.__name__}, exponent {shininess}, {has_kernels_cosines=}"
        assert np.isfinite(found).all() and (found >= 0).all(), case


def along_the_horizon(light_up, view_up, across):
    """Directions to a light and to a viewer that look at each other, at elevations in radians, off by some across."""
    return (
        np.stack([side * np.cos(u) * np.cos(a), np.cos(u) * np.sin(a), np.sin(u)], axis=1)
        for side, u, a in zip((1, -1), (light_up, view_up), across, strict=True)
    )


@pytest.mark.parametrize("model", ["phong", "blinn"])
def test_highlights_of_grazing_light_have_the_digits_that_the_plan_counts_on(model):
    """A low sun ahead, over a floor: L is nearly -V. The plan allows 2^-24·8·exponent for a highlight.

    Unit vectors are rounded to float32, as in the rows, and so are their dot products.
    """
    for elevation, shininess in product((0.05, 2.0, 20.0), (20, 80.5, 250)):
        rng = np.random.default_rng(2)
        up = np.radians(elevation) * rng.uniform(0.5, 1.5, (2, 2000))
        light_dir, view_dir = along_the_horizon(*up, np.radians(3.0) * rng.normal(size=(2, 2000)))
        sides = directions_of(np.float32, UP, light_dir, view_dir)
        found = reflect(model, *sides, 1.0, shininess, has_kernels_cosines=True)[1]
        cosine = highlight(model, *(unit(side.astype(float)) for side in sides))
        error, budget = np.abs(found - np.maximum(cosine, 0) ** shininess).max(), ULP * (16 + 8 * shininess)
        assert error <= budget, f"sun at {elevation}°, exponent {shininess}: {error:.3g} > {budget:.3g}"


# ---------------------------------------------------------------- powers


@kernel
def powers(bases, exponent, out):
    """power of many, of their own type."""
    for k in range(len(bases)):
        out[k] = power(bases[k], exponent)


def bases():
    """Float32 from 0 to a little above 1: near 1, at the ends of the mantissa's range, and all over."""
    one = np.float32(1).view(np.int32)
    near_one = np.arange(one - 3000, one + 40, dtype=np.int32).view(np.float32)
    root = np.float32(np.sqrt(0.5)).view(np.int32)
    ends = np.concatenate([np.arange(root - 200, root + 200, dtype=np.int32) - (k << 23) for k in range(8)]).astype(
        np.int32
    )
    rng = np.random.default_rng(3)
    return np.concatenate(
        [near_one, ends.view(np.float32), rng.random(60_000), 2.0 ** rng.uniform(-30, 0, 5000)]
    ).astype(np.float32)


def test_power_in_float32_keeps_the_bound_of_its_docstring():
    base = bases()
    found, log2 = np.empty_like(base), np.minimum(np.log2(base.astype(float)), 0.0)  # a cosine above 1 is 1
    for exponent in np.float32((0.5, 0.7, 1, 1.5, 2, 2.2, 5, 10.5, 33.3, 100, 500.5, 1000)):
        powers(base, exponent, found)
        y = float(exponent) * log2
        is_normal = y > -125.9
        # The series, then the rounding of float32, relative to the result.
        bound = 5.2e-9 + float(exponent) * np.log(2) * 1.1e-9 + ULP * (4 + 3 * np.abs(y))
        share = np.abs(found[is_normal] / np.exp2(y)[is_normal] - 1) / bound[is_normal]
        worst = int(share.argmax())
        assert share[worst] <= 1, f"{share[worst]:.3g} > 1 times the bound: {base[is_normal][worst]!r} ** {exponent}"
        assert (found[y < -126.1] == 0).all() and is_normal.sum() > 2000, exponent


@kernel
def exponentials(exponents, out):
    """exponential_single of many."""
    for k in range(len(exponents)):
        out[k] = exponential_single(exponents[k])


def test_exponential_in_float32_keeps_the_bound_of_its_docstring():
    x = -np.concatenate([np.linspace(0, 41, 40_001), 2.0 ** np.linspace(-30, 5, 1000)]).astype(np.float32)
    found = np.empty_like(x)
    exponentials(x, found)
    share = np.abs(found / np.exp(x.astype(float)) - 1) / (5.2e-9 + ULP * 2 * (2 + np.abs(x)))
    assert share.max() <= 1, f"{share.max():.3g} > 1 times the bound, for {x[share.argmax()]!r}"
    far = -np.array([41.7, 100, 1e10, np.inf], np.float32)
    exponentials(far, found[:4])
    assert not differences(found[:4], 0)


@pytest.mark.parametrize("dtype", DTYPES)
def test_powers_of_anything_are_between_0_and_1(dtype):
    """No base and no exponent may give what is no intensity: it could end up in the bits of a visibility entry."""
    limits = np.finfo(dtype)
    near_one = np.concatenate([1 + limits.eps * np.arange(-40, 41) / 2, [0.5, 0.7, 2**-0.5]])
    odd = [0.0, -0.0, 1e-45, limits.tiny, 1e-30, 1e-20, 2, 1e10, limits.max, np.inf, np.nan]
    base = np.concatenate([near_one, odd, -np.array(odd), -near_one]).astype(dtype)
    exponents = 10.0 ** np.linspace(-300, 300, 241)
    exponents = np.concatenate([exponents, 2.0 ** np.arange(-10, 45), [1e11, 3e8, 4095, 4096, 4097, 1e-50]])
    out = np.empty_like(base)
    for exponent in exponents:
        exponent = min(max(exponent, float(limits.tiny)), float(limits.max))  # as lights and materials are laid down
        powers(base, dtype(exponent), out)
        assert ((out >= 0) & (out <= 1)).all(), (
            f"{base[~((out >= 0) & (out <= 1))]} ** {exponent}: {out.min()}..{out.max()}"
        )
        assert (out[~(base > 0)] == 0).all() and (out[base >= 1] == 1).all(), exponent
        with np.errstate(under="ignore"):
            expected = np.minimum(base[base > 1e-30].astype(float), 1) ** float(dtype(exponent))
        error = np.abs(out[base > 1e-30] - expected).max()
        assert error <= 8 * limits.eps, f"exponent {exponent}: {error:.3g} > {8 * limits.eps:.3g}"


@pytest.mark.parametrize("dtype", DTYPES)
def test_highlights_of_any_exponent_are_between_0_and_1(dtype):
    """Directions that mirror each other to the last digit, where the cosine may come out above 1."""
    rng, limits = np.random.default_rng(7), np.finfo(dtype)
    normal, across = unit(rng.normal(size=(2, 2000, 3)))
    light_dir = unit(normal + rng.uniform(0, 2, (2000, 1)) * across)
    mirrored = 2 * (normal * light_dir).sum(axis=1, keepdims=True) * normal - light_dir
    sides = directions_of(dtype, normal, light_dir, mirrored)
    for model, given in product(("phong", "blinn"), (CLASSIC, COEFFICIENTS)):
        for shininess in (1e-50, 1e-3, 0.5, 1, 7.7, 4096, 1e5, 3e8, 1e11, 1e30, 1e300):
            exponent = min(max(shininess, float(limits.tiny)), float(limits.max))
            found = reflect(model, *sides, 1.0, exponent, True, given)[1]
            is_share = ((found >= 0) & (found <= 1)).all()
            assert is_share, f"{model}, exponent {shininess}: {found.min()}..{found.max()} not in 0..1"


def test_whole_exponents_by_squaring():
    """Of Phong's highlight along a normal: N = L, so R = L. A product of n factors has that many roundings, less one;
    what is below 2^-28 is 0."""
    for dtype, exponent in pairs(dtype=DTYPES, exponent=(1, 2, 3, 5, 8, 17, 100, 255, 256, 999, MAX_SQUARED)):
        case, x = f"{dtype.__name__}, exponent {exponent}", np.linspace(0, 1.6, 4000).astype(dtype)
        base = dtype(1) - dtype(0.5) * (x * x)  # 1 - |R - V|²/2, of V = (x, 0, 1), as the function finds it
        sides = directions_of(dtype, UP, UP, np.stack([x, 0 * x, 0 * x + 1], axis=1))
        found = reflect("phong", *sides, 1.0, exponent)[1]
        expected = np.where(base > 0, np.maximum(base.astype(float), 0) ** exponent, 0)
        is_seen = expected > 2.0**-28 * 1.01
        bound = exponent * np.finfo(dtype).eps / 2 * 1.01 + 4e-16 * exponent
        error = np.abs(found[is_seen] / expected[is_seen] - 1).max()
        assert error <= bound, f"{case}: {error:.3g} > {bound:.3g}"
        assert (found[expected < 2.0**-28 * 0.99] == 0).all() and is_seen.sum() > 50, case
