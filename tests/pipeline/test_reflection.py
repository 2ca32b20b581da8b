"""Check the reflection models against closed forms, and powers against the bounds in their docstrings."""

import numpy as np
import pytest
from helpers.batches import DTYPES, UP, directions_of, dot, polar, random_directions, reflect, unit

from rasterizer.compiler.kernels import kernel
from rasterizer.errors import SceneError
from rasterizer.pipeline import fragments as f
from rasterizer.pipeline.power import exponential_single, power, power_single
from rasterizer.pipeline.reflection import (
    MOST_SQUARED,
    REFLECTION_FUNCTIONS,
    reflection_function_of,
    square_and_multiply,
)

ULP = 2.0**-24


def highlight(model, normal, light_dir, view_dir):
    """The cosine that is raised to the exponent, in float64."""
    normal, light_dir, view_dir = (v.astype(float) for v in (normal, light_dir, view_dir))
    if model == "phong":
        return 2 * dot(normal, light_dir) * dot(normal, view_dir) - dot(light_dir, view_dir)
    half = light_dir + view_dir
    return dot(normal, half) / np.linalg.norm(half, axis=1)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("model", [model for model in REFLECTION_FUNCTIONS if model not in ("oren-nayar", "toon")])
def test_the_diffuse_part_is_lamberts_cosine(model, dtype):
    sides = random_directions(0, 1000, dtype)
    cosine = dot(sides[0].astype(float), sides[1].astype(float))
    for strength in (1.0, 0.25, 3.0):
        diffuse = reflect(model, *sides, strength)[0]
        expected = strength * np.maximum(cosine, 0)
        error, budget = np.abs(diffuse - expected).max(), strength * np.finfo(dtype).eps
        assert error <= budget, f"{error:.3g} > {budget:.3g}"
        assert (diffuse[cosine <= 0] == 0).all()


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("shininess", [0.5, 1, 1.5, 2, 3, 8, 32, 33.3, 80, 255, 1000])
@pytest.mark.parametrize("model", ["phong", "blinn"])
def test_highlights_in_closed_form(model, shininess, dtype):
    """The relative error of the cosine is magnified by the exponent; that of the power comes on top."""
    sides = random_directions(1, 20_000, dtype)
    _, specular = reflect(model, *sides, 0.5, shininess)
    cosine = np.maximum(highlight(model, *sides), 0)
    is_lit = dot(sides[0].astype(float), sides[1].astype(float)) > 0
    expected = np.where(is_lit, 0.5 * cosine**shininess, 0)
    # Roundings of the cosine, half an eps each. R·V: 3 of up to 2 in 2 (N·L)(N·V), 3 in L·V, 1 in the difference.
    # N·H: 1 in L + V, 3 in the product, 2.5 in the length, 1 in the quotient. Wherever L and V look.
    eps = np.finfo(dtype).eps
    bound = (
        0.5 * ((cosine + 6 * eps) ** shininess - cosine**shininess) + 8 * eps * expected * (1 + shininess) + 2.0**-28
    )
    worst = (np.abs(specular - expected) / bound).max()
    assert worst <= 1, f"{worst} > 1 times the bound"
    assert (specular > 1e-6).sum() > 20


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


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("model", ["phong", "blinn"])
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
                assert (reflect(model, *sides, strength, shininess) == 0).all()


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("model", REFLECTION_FUNCTIONS)
def test_no_directions_give_what_is_no_number(model, dtype):
    """All triples of directions out of a set with opposite, equal and nearly equal ones, and with none."""
    rng = np.random.default_rng(4)
    steps = np.concatenate([np.eye(3), -np.eye(3), [[0.6, 0, 0.8], [-0.6, 0, -0.8]], rng.normal(size=(4, 3))])
    steps = np.concatenate(
        [steps, steps + 1e-4 * rng.normal(size=steps.shape), steps + 1e-7 * rng.normal(size=steps.shape)]
    )
    # A point without a normal, in the light or in the eye: the kernels write zeros.
    steps = np.concatenate([unit(steps), np.zeros((1, 3))])
    sides = directions_of(dtype, *(steps[k.ravel()] for k in np.meshgrid(*[np.arange(len(steps))] * 3)))
    for shininess in (0.5, 1, 8, 33.3):
        for has_kernels_cosines in (False, True):
            found = reflect(model, *sides, 1.0, shininess, has_kernels_cosines)
            found = found[: 2 if reflection_function_of(model).has_highlight else 1]
            assert np.isfinite(found).all() and (found >= 0).all()


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("model", ["phong", "blinn"])
def test_no_highlight_is_brighter_than_its_light(model, dtype):
    """The sun on the horizon, straight ahead, down to where L + V is all rounding: no spark."""
    rng = np.random.default_rng(5)
    up, across = 10.0 ** rng.uniform(-5, -1, (2, 20_000)), 1e-4 * rng.normal(size=(2, 20_000))
    light_dir, view_dir = (
        np.stack([side * np.cos(u) * np.cos(a), np.cos(u) * np.sin(a), np.sin(u)], axis=1)
        for side, u, a in zip((1, -1), up, across, strict=True)
    )
    sides = directions_of(dtype, UP, light_dir, view_dir)
    for shininess in (1, 32, 33.3, 200):
        found = reflect(model, *sides, 1.0, shininess, has_kernels_cosines=True)[1]
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
    light_dir, view_dir = (
        np.stack([side * np.cos(u) * np.cos(a), np.cos(u) * np.sin(a), np.sin(u)], axis=1)
        for side, u, a in zip((1, -1), up, across, strict=True)
    )
    sides = directions_of(np.float32, UP, light_dir, view_dir)
    found = reflect(model, *sides, 1.0, shininess, has_kernels_cosines=True)[1]
    cosine = highlight(model, *(unit(side.astype(float)) for side in sides))
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
    ends = np.concatenate([np.arange(root - 200, root + 200, dtype=np.int32) - (k << 23) for k in range(8)]).astype(
        np.int32
    )
    rng = np.random.default_rng(3)
    return np.concatenate(
        [near_one, ends.view(np.float32), rng.random(60_000), 2.0 ** rng.uniform(-30, 0, 5000)]
    ).astype(np.float32)


@pytest.mark.parametrize("exponent", [0.5, 0.7, 1, 1.5, 2, 2.2, 5, 10.5, 33.3, 100, 333.3, 500.5, 1000])
def test_power_in_float32_keeps_the_bound_of_its_docstring(exponent):
    base, exponent = bases(), np.float32(exponent)
    found = np.empty_like(base)
    powers(base, exponent, found)
    log2 = np.minimum(np.log2(base.astype(float)), 0.0)  # a cosine above 1 is 1
    expected = np.exp2(float(exponent) * log2)
    is_normal = float(exponent) * log2 > -125.9
    # The series, then the rounding of float32, relative to the result.
    series = 5.2e-9 + float(exponent) * np.log(2) * 1.1e-9
    bound = series + ULP * (4 + 3 * float(exponent) * np.abs(log2))
    share = np.abs(found[is_normal] / expected[is_normal] - 1) / bound[is_normal]
    worst = int(share.argmax())
    assert share[worst] <= 1, f"{share[worst]:.3g} > 1 times the bound, for {base[is_normal][worst]!r} ** {exponent}"
    assert (found[float(exponent) * log2 < -126.1] == 0).all() and is_normal.sum() > 3000


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
    assert (found[:4] == 0).all()


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


@kernel
def squares(batch, n, exponent):
    """square_and_multiply of a batch."""
    square_and_multiply(batch, n, exponent)


@kernel
def any_powers(bases, exponent, out):
    """power of many, of their own type."""
    for k in range(len(bases)):
        out[k] = power(bases[k], exponent)


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
        any_powers(base, dtype(exponent), out)
        assert ((out >= 0) & (out <= 1)).all(), (
            f"{base[~((out >= 0) & (out <= 1))]} ** {exponent}: {out.min()}..{out.max()}"
        )
        assert (out[~(base > 0)] == 0).all() and (out[base >= 1] == 1).all()
        with np.errstate(under="ignore"):
            expected = np.minimum(base[base > 1e-30].astype(float), 1) ** float(dtype(exponent))
        assert np.abs(out[base > 1e-30] - expected).max() <= 8 * limits.eps


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("model", ["phong", "blinn", "weighted phong", "weighted blinn"])
def test_highlights_of_any_exponent_are_between_0_and_1(model, dtype):
    """Directions that mirror each other to the last digit, where the cosine may come out above 1."""
    rng = np.random.default_rng(7)
    normal, across = unit(rng.normal(size=(2, 4000, 3)))
    light_dir = unit(normal + rng.uniform(0, 2, (4000, 1)) * across)
    mirrored = 2 * (normal * light_dir).sum(axis=1, keepdims=True) * normal - light_dir
    sides = directions_of(dtype, normal, light_dir, mirrored)
    for shininess in (1e-50, 1e-3, 0.5, 1, 7.7, 4096, 1e5, 3e8, 1e11, 1e30, 1e300):
        limits = np.finfo(dtype)
        exponent = min(max(shininess, float(limits.tiny)), float(limits.max))
        found = reflect(model, *sides, 1.0, exponent, has_kernels_cosines=True)[1]
        assert ((found >= 0) & (found <= 1)).all(), f"{shininess}: {found.min()}..{found.max()}"


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("exponent", [1, 2, 3, 5, 8, 17, 100, 255, 256, 999, 1000, MOST_SQUARED])
def test_whole_exponents_by_squaring(exponent, dtype):
    """A product of `exponent` factors has that many roundings, less one; what is below 2^-28 is 0."""
    base = np.minimum(bases(), 1).astype(dtype)
    base = np.concatenate([base, -base[:100], np.zeros(1, dtype), np.full(1, np.nan, dtype)])
    found = np.empty_like(base)
    for start in range(0, len(base), f.BATCH_SIZE):
        batch, part = f.make_batch(dtype), base[start : start + f.BATCH_SIZE]
        batch[int(f.SPECULAR) : int(f.SPECULAR) + len(part)] = part
        squares(batch, len(part), exponent)
        found[start : start + f.BATCH_SIZE] = batch[int(f.SPECULAR) : int(f.SPECULAR) + len(part)]
    expected = np.where(base > 0, np.maximum(base.astype(float), 0) ** exponent, 0)
    is_seen = expected > 2.0**-28 * 1.01
    bound = exponent * np.finfo(dtype).eps / 2 * 1.01 + 4e-16 * exponent
    error = np.abs(found[is_seen] / expected[is_seen] - 1).max()
    assert error <= bound, f"{error:.3g} > {bound:.3g}"
    assert (found[expected < 2.0**-28 * 0.99] == 0).all() and is_seen.sum() > 2000
    between = found[~is_seen]
    assert ((between == 0) | (between > 2.0**-28 * 0.98)).all()


def test_an_unknown_model_is_an_error_that_lists_the_known_ones():
    with pytest.raises(SceneError, match=r"'velvet'; there are anisotropic ggx, .*, weighted phong"):
        reflection_function_of("velvet")


def test_only_highlights_have_second_terms_and_distant_forms():
    """Where F0 has a colour, every highlight whose formula has F0 is two sums."""
    for model, function in REFLECTION_FUNCTIONS.items():
        assert (function.second_term is not None) == (function.has_highlight and model != "toon"), model
        assert function.needs_view or not function.has_highlight, model
        assert function.distant is None or model.endswith("blinn"), model
