"""Compare the loops that read texels with plain Python: what is spelled out for the compiler, and what stands in for
it."""

import numpy as np
import pytest

from rasterizer.compiler.kernels import kernel
from rasterizer.pipeline import texture_lookup as texel_blend
from rasterizer.pipeline.fragments import BATCH_SIZE

STEP, STRIDE, START = np.float32(3.0 / 65535.0), 300, 5
FETCH, BLEND, MIX = range(3)


@kernel
def read(form, texels, batch, rows, n, out, start, stride, step):
    """Call one of the three loops from a kernel."""
    if form == FETCH:
        texel_blend.fetch_texels(texels, batch, (rows[0],), n, out, start, stride, step)
    elif form == BLEND:
        texel_blend.blend_texels(texels, batch, (rows[0], rows[1], rows[2], rows[3]), n, out, start, stride, step)
    else:
        texel_blend.blend_mip_levels(texels, batch, rows, n, out, start, stride, step)


WAYS = {"vectors": read, "plain": np.errstate(over="ignore")(getattr(read, "py_func", read))}
ROWS = tuple(np.uint64(k * BATCH_SIZE) for k in range(9))


def weights_of(rng, n):
    """Four weights each, (4, n): negative, adding up to -2^15, the largest ones among them."""
    shares = np.sort(rng.integers(0, 2**15 + 1, (3, n)), axis=0)
    shares[:, :4] = [[0, 0, 0, 32768], [0, 0, 32768, 32768], [0, 32768, 32768, 32768]]
    return -np.diff(np.vstack([np.zeros(n, int), shares, np.full(n, 2**15)]), axis=0)


def packed(low, high):
    """Two numbers of 16 bits in one of 32."""
    return ((low & 0xFFFF) | (high << 16)).astype(np.int32)


def a_batch(rng, n_texel):
    """A batch with texels and weights of two mip levels, and shares; and the weights, (2, 4, BATCH_SIZE)."""
    batch = np.zeros(12 * BATCH_SIZE, np.float32)
    whole, weights = batch.view(np.int32).reshape(12, -1), np.stack([weights_of(rng, BATCH_SIZE) for _ in range(2)])
    for level in (0, 1):
        whole[4 * level : 4 * level + 2] = rng.integers(0, n_texel - 1, (2, BATCH_SIZE))
        whole[4 * level + 2] = packed(weights[level][0], weights[level][1])  # left: top, bottom
        whole[4 * level + 3] = packed(weights[level][2], weights[level][3])
    batch.reshape(12, -1)[8] = rng.uniform(0, 1, BATCH_SIZE)
    return batch, weights


def mean_plainly(texels, whole, weights):
    """Weighted sums (4, n) of whole numbers; `whole` are top and bottom."""
    top, bottom = whole.astype(int)
    corners = texels[top], texels[bottom], texels[top + 1], texels[bottom + 1]
    total = sum(weight[:, None] * corner for weight, corner in zip(weights, corners, strict=True))
    return np.float32(total).T


def finished(values, factor):
    """Linear colours of sums of steps."""
    steps = np.array([STEP, STEP, STEP, texel_blend.ALPHA_STEP], np.float32)[:, None]
    return values * (np.float32(factor) * steps) + np.float32(2.0**15) * steps


@pytest.mark.parametrize("way", WAYS)
def test_texels_are_read_and_blended_as_plain_python_does(way):
    """Nothing is written beyond the next multiple of four."""
    for n in (0, 1, 3, 4, 5, 64, 255):
        rng = np.random.default_rng(n)
        texels = rng.integers(-(2**15), 2**15, (500, 4)).astype(np.int16)
        texels[rng.integers(500, size=100)] = rng.choice([-(2**15), 2**15 - 1], (100, 4))
        batch, weights = a_batch(rng, 500)
        whole = batch.view(np.int32).reshape(12, -1)
        finer = mean_plainly(texels.astype(int), whole[:2], weights[0])
        coarser = mean_plainly(texels.astype(int), whole[4:6], weights[1])
        share = batch.reshape(12, -1)[8]
        expected = {
            FETCH: finished(np.float32(texels[whole[0]]).T, 1.0),
            BLEND: finished(finer, -(2.0**-15)),
            MIX: finished(finer + share * (coarser - finer), -(2.0**-15)),
        }
        for form, colors in expected.items():
            out, given = np.full(4 * STRIDE + START, 7, np.float32), batch.copy()
            WAYS[way](form, texels.ravel(), given, ROWS, np.uint64(n), out, np.uint64(START), np.uint64(STRIDE), STEP)
            for channel in range(4):
                first = START + channel * STRIDE
                same = out[first : first + n].tobytes() == colors[channel, :n].tobytes()
                assert same, f"loop {form}, {n} samples, channel {channel}"
                out[first : first + -(-n // 4) * 4] = 7
            assert (out == 7).all(), f"loop {form}, {n} samples: wrote beyond the next multiple of four"
            assert given.tobytes() == batch.tobytes(), f"loop {form}, {n} samples: wrote into the batch"
