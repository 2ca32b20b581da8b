"""Check the reflection models against closed forms, and powers against the bounds in their docstrings."""

import numpy as np
import pytest
from helpers.batches import (
    DIFFUSE,
    DTYPES,
    REFLECTION_FUNCTIONS,
    directions_of,
    reflect,
    unit,
)
from helpers.pairs import pairs

from rasterizer.compiler.kernels import kernel
from rasterizer.pipeline.power import power

ULP = 2.0**-24


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


@pytest.mark.parametrize("dtype", DTYPES)
def test_powers_of_anything_are_between_0_and_1(dtype):
    """No base and no exponent may give what is no intensity: it could end up in the bits of a visibility packed
    sample."""
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
