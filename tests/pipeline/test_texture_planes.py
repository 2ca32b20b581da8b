"""The planes of texture coordinates: references that are exact, and bounded errors. test_simd.py has their slopes."""

import numpy as np
import pytest

from rasterizer.pipeline.texture_sampling import WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT
from rasterizer.pipeline.textures import texcoord_error, texcoord_references


@pytest.mark.parametrize("wrap", [WRAP_REPEAT, WRAP_MIRROR, WRAP_CLAMP], ids=["repeat", "mirror", "clamp"])
def test_references_are_near_and_exactly_what_their_number_says(wrap):
    rng = np.random.default_rng(1)
    for n_texel in (1, 7, 16384):
        period = 2 * n_texel if wrap == WRAP_MIRROR else n_texel
        texcoords = np.concatenate([rng.uniform(-9, 9, 50), [0.0, 0.5, 1.0, -0.5, 1e6, -1e6, 1.5, 2.0]]) * n_texel
        for s, t in rng.permutation(np.stack([texcoords, texcoords[::-1]], axis=1)):
            s_ref, t_ref, number = texcoord_references((s, t), (float(n_texel), float(n_texel)), (wrap, wrap))
            assert number == int(number) and 0 <= number < 2**24
            for texcoord, reference, whole in ((s, s_ref, int(number) & 0xFFF), (t, t_ref, int(number) >> 12)):
                nearest = min(max(texcoord, 0.0), n_texel) if wrap == WRAP_CLAMP else texcoord
                assert abs(reference - nearest) <= period * 2.0**-12, f"{reference} for {texcoord} of {n_texel}"
                off = whole / 2.0**11 - reference / period
                assert (off if wrap == WRAP_CLAMP else off % 1.0) == 0.0, f"{whole} for {reference} of {n_texel}"


def test_a_reference_is_a_number_whatever_the_texcoord_is():
    for texcoord in (np.nan, np.inf, -np.inf, 1e300):
        for wrap in (WRAP_REPEAT, WRAP_MIRROR, WRAP_CLAMP):
            found = s_ref, t_ref, number = texcoord_references((texcoord, 3.0), (8.0, 8.0), (wrap, wrap))
            assert 0.0 <= s_ref <= 16.0 and abs(t_ref - 3.0) < 0.01 and 0 <= number < 2**24, f"{texcoord}: {found}"


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
