"""Look textures up in float32, and compare with the reference, float64: within the bound, and never beside a texel."""

from itertools import product

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pairs import pairs

from rasterizer.compiler.kernels import index, kernel
from rasterizer.engine.texture_tables import list_textures, pack_textures
from rasterizer.pipeline import texture_lookup as b
from rasterizer.pipeline import texture_lookup as texel_blend
from rasterizer.pipeline import textures as packing
from rasterizer.pipeline.fragments import BATCH_SIZE
from rasterizer.pipeline.texture_lookup import compute_texcoords, read_texels
from rasterizer.pipeline.textures import FILTER_NEAREST, NEAREST_ERROR, texcoord_error, texcoord_references
from rasterizer.pipeline.visibility import LANES
from rasterizer.reference.shading import sample_texture
from rasterizer.scene.material import Material
from rasterizer.scene.texture import Texture

WRAPS = ("repeat", "clamp", "mirror", ("repeat", "mirror"), ("clamp", "repeat"))
FILTERS = ("nearest", "bilinear", "trilinear")
SIZES = ((16, 16), (1, 1), (1, 7), (9, 1), (5, 3), (37, 64), (300, 200), (2, 2))  # (w, h)


@kernel
def look_up(batch, n, packed, texture, out):
    """Look a texture up in float32."""
    one = packing.packed_texture(packed, index(texture))
    compute_texcoords(batch, n, one)
    return read_texels(batch, n, one, out, index(0), index(BATCH_SIZE))


as_plain = np.errstate(all="ignore")(getattr(look_up, "py_func", look_up))


def textures_of(image, filter="trilinear", wrap="repeat"):
    """One texture, and packed."""
    texture = Texture(image, filter, wrap)
    return texture, pack_textures(list_textures([texture]))


class Samples:
    """Samples of one texture: the rows of a batch, and the same numbers in float64.

    offsets : (2, n), s' and t' · inv_w : (n,) · derivatives : (2, 3, n), those of S, T and D along x and y
    near : what the references are near to, texels
    """

    def __init__(self, packed, offsets, near=(0.0, 0.0), inv_w=1.0, derivatives=0.0):
        self.n, self.sizes = np.shape(offsets)[1], packed.sizes[0, :2]
        inv_w = np.float32(np.broadcast_to(inv_w, self.n))
        planes = np.float32(np.asarray(offsets) * inv_w)
        derivatives = np.float32(np.broadcast_to(derivatives, (2, 3, self.n)))
        *references, number = texcoord_references(near, self.sizes.astype(float), tuple(packed.wraps[0]))
        self.batch = b.make_lookup_batch()
        rows = self.batch.reshape(-1, BATCH_SIZE)[:10]
        rows[:, : self.n] = [*planes, inv_w, np.full(self.n, number), *derivatives[0], *derivatives[1]]
        with np.errstate(all="ignore"):
            self.offsets = planes.astype(float) / inv_w
            self.texcoords = self.offsets + np.array(references)[:, None]
            self.steps = (derivatives[:, :2] - self.offsets * derivatives[:, 2:].astype(float)) / inv_w
            square = np.nan_to_num((self.steps**2).sum(axis=1).max(axis=0), nan=1.0, posinf=1e300)
        n_level = packed.sizes[0, 2]
        self.mip_levels = np.clip(0.5 * np.log2(np.maximum(square, 1.0)), 0, n_level - 1)

    def found(self, packed, texture=0):
        """What the float32 way finds (4, n), and which samples are doubtful."""
        out, batch = np.full((4, BATCH_SIZE), np.nan, np.float32), self.batch.copy()
        is_any = look_up(batch, self.n, packed, texture, out)
        is_doubtful = np.zeros(self.n, bool)
        if packed.filters[texture] == FILTER_NEAREST:
            is_doubtful = batch.view(np.int32)[int(b.IS_DOUBTFUL) :][: self.n] != 0
        assert is_any == is_doubtful.any()
        return out[:, : self.n].astype(float), is_doubtful

    def expected(self, texture, moved=0.0):
        """What the reference finds (4, n) where texture coordinates are moved by (2, n) or (2, 1) texels."""
        s, t = (self.texcoords + moved) / self.sizes[:, None]
        steps = np.zeros((self.n, 2, 2))
        steps[:, 0, 0] = 2.0**self.mip_levels / self.sizes[0]
        return sample_texture(texture, np.stack([s, 1.0 - t], axis=1), steps).T

    def bounds(self, packed, errors=(0.0, 0.0)):
        """The bound of each sample, its own roundings and further errors of s and t (in texels) counted."""
        own = [texcoord_error(0.0, 0.0, 1.0, abs(offset)) for offset in self.offsets]
        # Rounding of the derivatives, see `divide_with_slopes`: of both products, the difference, the product with w.
        rows = np.abs(self.batch.reshape(-1, BATCH_SIZE)[:10, : self.n].astype(float))
        of_steps = [
            (rows[first + i] + 6.0 * abs(self.offsets[i]) * rows[first + 2]) / rows[2] * 2.0**-23
            for first in (4, 7)
            for i in (0, 1)
        ]
        of_level = 1.45 * np.sum(of_steps, axis=0)
        return np.array(
            [
                packing.texture_error(packed, 0, own[0][k] + errors[0], own[1][k] + errors[1], of_level[k])
                for k in range(self.n)
            ]
        )


def image_of(kind, size, rng):
    """An image (h, w, 4) with what is hard for a filter."""
    width, height = size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    if kind == "noise":
        return rng.uniform(0, 1, (height, width, 4))
    if kind == "checkerboard":
        return np.repeat(((x + y) % 2.0)[..., None], 4, axis=2)
    if kind == "gradient":
        return np.stack([x / width, y / height, x / width * 0.5, 1 - y / (2 * height)], axis=2)
    if kind == "bright":
        return rng.uniform(0, 1, (height, width, 4)) * (300.0, 20.0, 0.1, 1.0)
    return (rng.uniform(0, 1, (height, width, 4)) > 0.9).astype(float) * (1e-3, 1e-3, 1e-4, 1.0)  # dark


KINDS = ("noise", "checkerboard", "gradient", "bright", "dark")


def random_samples(packed, rng, n=BATCH_SIZE, reach=None, level=None):
    """Samples of a triangle: offsets up to some reach, w ratios up to 30, derivatives for levels around one."""
    size = packed.sizes[0, :2].astype(float)
    reach = rng.choice([1e-3, 0.5, 3.0, 40.0]) * size[:, None] if reach is None else reach
    references = rng.choice([0.3, -7.2, 1234.56, 0.0, 1.0]) * size
    inv_w = rng.uniform(1, rng.choice([1.01, 30]), n) * 2.0 ** rng.integers(-8, 8)
    offsets = rng.uniform(-1, 1, (2, n)) * reach
    near = rng.integers(4, size=n)  # some lie at the centres and at the borders of texels
    offsets[:, near == 0] = np.round(2 * offsets[:, near == 0]) / 2
    level = rng.uniform(-2, packed.sizes[0, 2] + 1) if level is None else level
    steps = rng.normal(size=(2, 3, n)) * 2.0**level * inv_w
    steps[:, 2] = rng.normal(size=(2, n)) * 1e-2 * inv_w * rng.choice([0, 1])
    return Samples(packed, offsets, references, inv_w, steps)


# ---------------------------------------------------------------- within the bound


@pytest.mark.parametrize("filter", ["bilinear", "trilinear"])
def test_colours_are_within_their_bound(filter):
    """Of pictures, sizes and wraps by pairs; and of a texture as large as can be."""
    cases = [*pairs(kind=KINDS, size=SIZES, wrap=WRAPS), ("checkerboard", (16384, 3), "clamp")]
    for number, (kind, size, wrap) in enumerate(cases):
        rng = np.random.default_rng([number, len(filter)])
        texture, packed = textures_of(image_of(kind, size, rng), filter, wrap)
        for k in range(2):
            reach = np.array([[20.0], [2.0]]) if size[0] == 16384 else None
            samples = random_samples(packed, rng, reach=reach, level=1.0 if k == 0 else None)
            found, _ = samples.found(packed)
            worst = (np.abs(found - samples.expected(texture)).max(axis=0) / samples.bounds(packed)).max()
            assert worst <= 1.0, f"{kind} {size} {wrap}: {worst:.3f} > 1 times the bound"


@pytest.mark.parametrize(
    "filter, kind, wrap",
    [("bilinear", "noise", "repeat"), ("bilinear", "checkerboard", "clamp"), ("trilinear", "checkerboard", "mirror")],
)
def test_the_bound_holds_where_texture_coordinates_err(filter, kind, wrap):
    """Climb: move exact coordinates by up to the error, where the difference is largest go on from there."""
    rng = np.random.default_rng(7)
    texture, packed = textures_of(image_of(kind, (24, 18), rng), filter, wrap)
    errors, worst = np.array([3e-4, 7e-4]), 0.0
    for _ in range(6):
        samples = random_samples(packed, rng, reach=np.array([[5.0], [4.0]]))
        found, _ = samples.found(packed)
        bounds, best = samples.bounds(packed, errors), np.zeros((2, samples.n))
        highest = np.zeros(samples.n)
        for step in range(40):
            way = rng.choice([-1.0, 0.0, 1.0], (2, samples.n)) * (1.0 if step < 20 else rng.uniform())
            moved = np.clip(best + way * errors[:, None], -errors[:, None], errors[:, None])
            off = np.abs(found - samples.expected(texture, moved)).max(axis=0)
            best, highest = np.where(off > highest, moved, best), np.maximum(off, highest)
        worst = max(worst, (highest / bounds).max())
    assert 0.5 < worst <= 1.0, f"{worst:.3f} of the bound"


def test_mip_levels_lose_no_more_than_they_are_said_to():
    """Of slopes of one axis, whose squares are exact but for rounding, up to the coarsest level and beyond."""
    rng = np.random.default_rng(12)
    for width in (2, 64, 16384):
        _, packed = textures_of(np.zeros((1, width, 3)))
        coarsest, worst = packed.sizes[0, 2] - 1, 0.0
        for _ in range(60):
            slopes = np.float32(2.0 ** rng.uniform(-1, coarsest + 1, BATCH_SIZE))
            batch = b.make_lookup_batch()
            rows = batch.reshape(-1, BATCH_SIZE)
            rows[int(b.INV_W) // BATCH_SIZE], rows[int(b.S_DX) // BATCH_SIZE] = 1.0, slopes
            look_up(batch, BATCH_SIZE, packed, 0, np.empty((4, BATCH_SIZE), np.float32))
            found = rows[int(b.MIP_LEVEL) // BATCH_SIZE].astype(float)
            worst = max(worst, abs(found - np.clip(np.log2(slopes.astype(float)), 0, coarsest)).max())
        assert worst <= packing.LEVEL_ERROR, f"{width}: {worst:.3g} > {packing.LEVEL_ERROR:.3g}"


# ---------------------------------------------------------------- nearest texels


def test_the_nearest_texel_is_the_exact_one_or_doubtful():
    """Of coordinates that err by no more than they are said to; a few texels are doubtful, those at borders."""
    for size, wrap in product(SIZES, WRAPS):
        rng = np.random.default_rng(len(wrap))
        texture, packed = textures_of(rng.uniform(0, 1, (size[1], size[0], 4)), "nearest", wrap)
        n_doubtful = n_wrong = n_sample = 0
        for _ in range(3):
            samples = random_samples(packed, rng, reach=rng.choice([0.6, 3.0]) * np.array(size)[:, None])
            own = np.array([[texcoord_error(0.0, 0.0, 1.0, most)] for most in abs(samples.offsets).max(axis=1)])
            found, is_doubtful = samples.found(packed)
            moved = rng.uniform(-1, 1, (2, samples.n)) * (NEAREST_ERROR - own)
            off = np.abs(found - samples.expected(texture, moved)).max(axis=0)
            n_wrong += (off[~is_doubtful] > packed.errors[0, packing.ALWAYS]).sum()
            n_doubtful, n_sample = n_doubtful + is_doubtful.sum(), n_sample + samples.n
        assert n_wrong == 0, f"{size} {wrap}: {n_wrong} samples wrong"
        # a quarter of the samples was put onto borders, or centres
        assert n_doubtful < 0.5 * n_sample, f"{size} {wrap}: {n_doubtful} of {n_sample} doubtful"


def test_samples_at_borders_are_doubtful_unless_nothing_lies_behind():
    rng = np.random.default_rng(2)
    for wrap in ("repeat", "clamp", "mirror"):
        _, packed = textures_of(rng.uniform(0, 1, (4, 4, 4)), "nearest", wrap)
        positions = [0.0, 1.0, 1.5, 2.0, 4.0, -3.0, 1.0 + 1.2 * NEAREST_ERROR]
        repeats = wrap == "repeat"
        outside = wrap != "clamp"  # -3 is a border inside the mirrored picture
        expected = [repeats, True, False, True, repeats, outside, False]
        for axis in (0, 1):
            offsets = np.full((2, len(positions)), 0.5)
            offsets[axis] = positions
            _, is_doubtful = Samples(packed, offsets).found(packed)
            assert is_doubtful.tolist() == expected, f"{wrap}, axis {axis}: {is_doubtful.tolist()}"


def test_the_bound_is_infinite_where_coordinates_err_too_much():
    for filter, errors in (
        ("nearest", (1.01 * NEAREST_ERROR, 1e9, np.inf, np.nan)),
        ("bilinear", (np.inf, np.nan)),
        ("trilinear", (np.inf, np.nan)),
    ):
        _, packed = textures_of(np.eye(8), filter)
        for error in errors:
            for pair in ((error, 0.0), (0.0, error)):
                found = packing.texture_error(packed, 0, *pair, 0.0)
                assert found == np.inf, f"{filter}, {pair}: {found}"
    _, packed = textures_of(np.ones((8, 8, 4)), "nearest")
    good = packing.texture_error(packed, 0, NEAREST_ERROR, NEAREST_ERROR, np.inf)
    assert good == packed.errors[0, packing.ALWAYS]


# ---------------------------------------------------------------- what must hold exactly


@pytest.mark.parametrize("filter", FILTERS)
def test_a_constant_texture_is_constant_and_nothing_leaves_the_range_of_the_texels(filter):
    """Black and white, opaque and clear: neither is passed by a rounding error."""
    rng = np.random.default_rng(3)
    for value in (0.0, 1.0, 0.2, 200.0):
        _, packed = textures_of(np.broadcast_to([value, value, value, 1.0], (6, 9, 4)), filter)
        for _ in range(3):
            found, _ = random_samples(packed, rng).found(packed)
            spread = np.ptp(found, axis=1).max()
            assert spread <= abs(found).max() * 2.0**-23, f"{value} varies by {spread:.3g}"
            assert (found[3] == 1.0).all(), f"alpha {found[3].min()} != 1"
            assert value not in (0.0, 1.0) or (found[:3] == value).all(), f"{found[:3].max()} != {value}"
    _, packed = textures_of(image_of("checkerboard", (12, 7), rng), filter)
    for _ in range(10):
        found, _ = random_samples(packed, rng).found(packed)
        assert found.min() >= 0.0 and found.max() <= 1.0, f"{found.min()}..{found.max()} leaves 0..1"


@pytest.mark.parametrize("filter", FILTERS)
def test_any_number_finds_a_texel_of_the_texture(filter):
    """Whatever stands in the batch: texels of other textures before and behind are never read."""
    rng = np.random.default_rng(5)
    hard = np.array([0.0, -0.0, 1.0, -1.0, 1e-45, 1e30, -1e30, np.inf, -np.inf, np.nan, 3e38, 2.0**31, -(2.0**31)])
    for wrap in ("repeat", "clamp", "mirror"):
        inside = Texture(rng.uniform(0.25, 0.75, (5, 7, 4)), filter, wrap)
        around = [Texture(np.zeros((9, 4, 4)), filter), Texture(np.ones((3, 3, 4)), filter)]
        materials = [Material(texture=texture) for texture in (around[0], inside, around[1])]
        packed = pack_textures(list_textures([material.texture for material in materials]))
        for _ in range(20):
            batch = b.make_lookup_batch()
            rows = batch.reshape(-1, BATCH_SIZE)
            rows[:10] = rng.choice(hard, (10, BATCH_SIZE))
            rows[rng.integers(10)] = rng.uniform(-2, 2, BATCH_SIZE)
            if rng.uniform() < 0.5:
                rows[3] = rng.integers(0, 2**24, BATCH_SIZE)
            out = np.full((4, BATCH_SIZE), np.nan, np.float32)
            look_up(batch, BATCH_SIZE, packed, 1, out)
            assert out.min() >= 0.24 and out.max() <= 0.76, f"{wrap}: {out.min()}..{out.max()}"


def test_a_sample_does_not_depend_on_its_neighbours():
    """The level of one sample decides what the batch is looked up by; what each finds is the same, also without the
    compiler. Beyond the last one, and the next multiple of LANES, nothing is written."""
    rng = np.random.default_rng(10)
    _, packed = textures_of(image_of("noise", (16, 16), rng))
    near, far = random_samples(packed, rng, level=-3.0), random_samples(packed, rng, level=2.0)
    mixed = near.batch.copy()
    rows, of_far = mixed.reshape(-1, BATCH_SIZE), far.batch.reshape(-1, BATCH_SIZE)
    rows[:10, ::2] = of_far[:10, ::2]
    out = np.empty((4, BATCH_SIZE), np.float32)
    look_up(mixed, BATCH_SIZE, packed, 0, out)
    assert not differences(out[:, 1::2], np.float32(near.found(packed)[0][:, 1::2]))
    assert not differences(out[:, ::2], np.float32(far.found(packed)[0][:, ::2]))
    for filter, n in product(FILTERS, (1, 3, 4, 5, 21)):
        _, packed = textures_of(image_of("noise", (8, 8), rng), filter)
        samples, found = random_samples(packed, rng, n), []
        for way in (look_up, as_plain):
            out = np.full((4, BATCH_SIZE), 7, np.float32)
            is_doubtful = way(samples.batch.copy(), n, packed, 0, out)
            assert (out[:, -(-n // LANES) * LANES :] == 7).all() and (out[:, :n] != 7).all(), f"{filter}, {n} samples"
            found.append((bool(is_doubtful), out[:, :n].tobytes()))
        assert found[0] == found[1], f"{filter}, {n} samples: without the compiler, something else is found"


# ---------------------------------------------------------------- texel blend

# Compare the loops that read texels with plain Python: what is spelled out for the compiler, and what stands in for
# it.


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
