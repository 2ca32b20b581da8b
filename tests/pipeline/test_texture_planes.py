"""The planes of texture coordinates: slopes copied as plain Python does, references that are exact, bounded errors."""

import numba
import numpy as np
import pytest

from rasterizer.compiler.kernels import kernel
from rasterizer.pipeline.simd import PlaneGroup, evaluate_planes
from rasterizer.pipeline.texture_planes import evaluate_slopes, texcoord_error, texcoord_references
from rasterizer.pipeline.texture_sampling import WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT


@kernel
def evaluate(entries, group, x, y, out, start, stride):
    """Call evaluate_slopes from a kernel."""
    evaluate_slopes(entries, group, x, y, out, start, stride)


@kernel
def evaluate_alone(entries, group, x, y, out, start, stride):
    """Call evaluate_planes from a kernel."""
    evaluate_planes(entries, group, x, y, out, start, stride)


WAYS = {
    "vectors": evaluate,
    "plain": np.errstate(all="ignore")(evaluate_slopes.py_func),
    "compiled": numba.njit(evaluate_slopes.py_func),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("column", [4, 16])
@pytest.mark.parametrize("n", [0, 1, 3, 4, 5, 64, 127])
def test_slopes_are_copied_bit_for_bit(n, column, way):
    rng, shift, n_record, mask, stride = np.random.default_rng(n), 5, 40, (1 << 23) - 1, 160
    numbers = rng.integers(-(2**31), 2**31, n_record << shift).astype(np.int32).view(np.float32)
    entries = (rng.integers(0, 2**38, 128) << 25 | 1 << 24 | rng.integers(0, n_record, 128)).astype(np.int64)[:n]
    entries[::5] &= ~np.int64(1 << 24)  # intensities: record 0 is read, whatever the bits say
    records = np.where(entries & 1 << 24, entries & mask, 0)
    out = np.full(10 * stride + 8, 7, np.float32)
    group = PlaneGroup(numbers, np.int64(mask), np.uint64(shift), np.uint64(column))
    place = np.int64(11), np.int64(-3), out, np.uint64(5), np.uint64(stride)
    WAYS[way](entries, group, *place)
    untouched, bits = np.ones(len(out), bool), numbers.view(np.int32).reshape(n_record, -1)
    values = out.copy()
    evaluate_alone(entries, group, *place)
    for i in range(4):
        first = 5 + i * stride
        same = np.array_equal(out[first : first + n], values[first : first + n], equal_nan=True)
        assert same, "the planes are not those of evaluate_planes"
        untouched[first : first + -(-n // 4) * 4] = False
    for i, source in enumerate((4, 5, 6, 8, 9, 10), start=4):
        first = 5 + i * stride
        expected = bits[records, column + source]
        assert out.view(np.int32)[first : first + n].tolist() == expected.tolist()
        untouched[first : first + -(-n // 4) * 4] = False
    assert (out[untouched] == 7).all(), "wrote beyond the next multiple of four"


@pytest.mark.parametrize("wrap", [WRAP_REPEAT, WRAP_MIRROR, WRAP_CLAMP])
@pytest.mark.parametrize("n_texel", [1, 7, 1024, 16384])
def test_references_are_near_and_exactly_what_their_number_says(n_texel, wrap):
    rng = np.random.default_rng(1)
    period = 2 * n_texel if wrap == WRAP_MIRROR else n_texel
    texcoords = np.concatenate([rng.uniform(-9, 9, 50), [0.0, 0.5, 1.0, -0.5, 1e6, -1e6, 1.5, 2.0]]) * n_texel
    for s, t in rng.permutation(np.stack([texcoords, texcoords[::-1]], axis=1)):
        s_ref, t_ref, number = texcoord_references((s, t), (float(n_texel), float(n_texel)), (wrap, wrap))
        assert number == int(number) and 0 <= number < 2**24
        for texcoord, reference, whole in ((s, s_ref, int(number) & 0xFFF), (t, t_ref, int(number) >> 12)):
            nearest = min(max(texcoord, 0.0), n_texel) if wrap == WRAP_CLAMP else texcoord
            assert abs(reference - nearest) <= period * 2.0**-12
            off = whole / 2.0**11 - reference / period
            assert (off if wrap == WRAP_CLAMP else off % 1.0) == 0.0


@pytest.mark.parametrize("texcoord", [np.nan, np.inf, -np.inf, 1e300])
def test_a_reference_is_a_number_whatever_the_texcoord_is(texcoord):
    for wrap in (WRAP_REPEAT, WRAP_MIRROR, WRAP_CLAMP):
        s_ref, t_ref, number = texcoord_references((texcoord, 3.0), (8.0, 8.0), (wrap, wrap))
        assert 0.0 <= s_ref <= 16.0 and abs(t_ref - 3.0) < 0.01 and 0 <= number < 2**24


def test_quotients_of_planes_are_within_their_error():
    """Of planes that err as far as they may, each way, and with the roundings of the look-up."""
    rng = np.random.default_rng(2)
    n, size = 20000, np.float32(37)
    inv_w = rng.uniform(0.1, 4, n)
    offset = rng.uniform(-50, 50, n)
    numerator = offset * inv_w
    worst = 0.0
    for e_s, e_d in ((0.0, 0.0), (1e-6, 0.0), (0.0, 1e-7), (1e-5, 3e-7)):
        s = np.float32(numerator + e_s * rng.choice([-1, 1], n))
        d = np.float32(inv_w + e_d * rng.choice([-1, 1], n))
        w = np.float32(1) / d
        found = (s * w) * (np.float32(1) / size)
        off = abs(found * 37.0 - offset)
        rounded = 2.0**-24 * abs(s), 2.0**-24 * d  # the planes are float32
        bound = texcoord_error(e_s + rounded[0], e_d + rounded[1], d - e_d - rounded[1], abs(offset))
        worst = max(worst, (off / bound).max())
    assert 0.3 < worst <= 1.0, f"{worst:.3f} of the bound"
