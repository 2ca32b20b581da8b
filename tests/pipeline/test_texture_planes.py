"""The planes of texture coordinates: gathered as plain Python does, references that are exact, bounded errors."""

import numba
import numpy as np
import pytest

from rasterizer.compiler.kernels import kernel
from rasterizer.pipeline.simd import PlaneGroup
from rasterizer.pipeline.texture_planes import gather_texture_planes, texcoord_error, texcoord_reference
from rasterizer.pipeline.texture_sampling import WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT


@kernel
def gather(entries, group, x, y, out, start, stride):
    """Call gather_texture_planes from a kernel."""
    gather_texture_planes(entries, group, x, y, out, start, stride)


WAYS = {
    "vectors": gather,
    "plain": gather_texture_planes.py_func,
    "compiled": numba.njit(gather_texture_planes.py_func),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("column", [4, 16])
@pytest.mark.parametrize("n", [0, 1, 3, 4, 5, 64, 127])
def test_planes_are_evaluated_and_the_rest_is_copied(n, column, way):
    rng, shift, n_record, mask, stride = np.random.default_rng(n), 5, 40, (1 << 23) - 1, 160
    numbers = rng.normal(size=n_record << shift).astype(np.float32)
    whole = numbers.view(np.int32).reshape(n_record, -1)
    whole[:, 1:3] = rng.integers(-(2**20), 2**20, (n_record, 2))
    whole[:, [column + 3, column + 7]] = rng.integers(-(2**31), 2**31, (n_record, 2))  # some are no numbers
    entries = (rng.integers(0, 2**38, 128) << 25 | 1 << 24 | rng.integers(0, n_record, 128)).astype(np.int64)[:n]
    out = np.full(12 * stride + 8, 7, np.float32)
    group = PlaneGroup(numbers, np.int64(mask), np.uint64(shift), np.uint64(column), np.float32(1))
    WAYS[way](entries, group, np.int64(1900), np.int64(33), out, np.uint64(5), np.uint64(stride))
    untouched = np.ones(len(out), bool)
    for k, entry in enumerate(entries):
        record = numbers[(int(entry) & mask) << shift :]
        anchor = record.view(np.int32)
        across, down = np.float32(1900 + k - int(anchor[1])), np.float32(33 - int(anchor[2]))
        for i in range(12):
            expected = record[column + i]
            if i < 3:
                expected = expected + across * record[column + 4 + i] + down * record[column + 8 + i]
            found = out[5 + i * stride + k]
            assert np.float32(found).tobytes() == np.float32(expected).tobytes()
    for i in range(12):
        untouched[5 + i * stride : 5 + i * stride + -(-n // 4) * 4] = False
    assert (out[untouched] == 7).all(), "wrote beyond the next multiple of four"


@pytest.mark.parametrize("wrap", [WRAP_REPEAT, WRAP_MIRROR, WRAP_CLAMP])
@pytest.mark.parametrize("n_texel", [1, 7, 1024, 16384])
def test_references_are_near_and_exactly_what_their_number_says(n_texel, wrap):
    rng = np.random.default_rng(1)
    texcoords = np.concatenate([rng.uniform(-9, 9, 50), [0.0, 0.5, 1.0, -0.5, 1e6, -1e6, 1.5, 2.0]]) * n_texel
    for texcoord in texcoords:
        reference, whole = texcoord_reference(texcoord, float(n_texel), wrap)
        nearest = min(max(texcoord, 0.0), n_texel) if wrap == WRAP_CLAMP else texcoord
        assert abs(reference - nearest) <= n_texel * (2.0**-30 + 2.0**-52 * abs(nearest / n_texel))
        unit = {WRAP_REPEAT: 2.0**-32, WRAP_MIRROR: 2.0**-31, WRAP_CLAMP: 2.0**-29}[wrap]
        period = {WRAP_REPEAT: 1.0, WRAP_MIRROR: 2.0, WRAP_CLAMP: np.inf}[wrap]
        off = int(whole) * unit - reference / n_texel
        assert (off if wrap == WRAP_CLAMP else off % period) == 0.0


@pytest.mark.parametrize("texcoord", [np.nan, np.inf, -np.inf, 1e300])
def test_a_reference_is_a_number_whatever_the_texcoord_is(texcoord):
    for wrap in (WRAP_REPEAT, WRAP_MIRROR, WRAP_CLAMP):
        reference, whole = texcoord_reference(texcoord, 8.0, wrap)
        assert 0.0 <= reference <= 8.0 and -(2**31) <= whole < 2**31


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
