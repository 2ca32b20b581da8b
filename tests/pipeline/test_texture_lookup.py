"""Look textures up at planes of coordinates, and compare with the reference: within the bound, and never beside a
texel."""

from itertools import product

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pairs import pairs

from rasterizer.compiler.kernels import kernel
from rasterizer.engine.texture_tables import make_textures
from rasterizer.pipeline import texcoords as b
from rasterizer.pipeline import textures as laying
from rasterizer.pipeline.fragments import BATCH_SIZE
from rasterizer.pipeline.texcoords import compute_texcoords, fixed_point
from rasterizer.pipeline.texture_lookup import product_of, read_texels
from rasterizer.pipeline.textures import texcoord_error, texcoord_references
from rasterizer.pipeline.visibility import LANES
from rasterizer.reference.textures import sample_texture
from rasterizer.scene.material import Material
from rasterizer.scene.texture import Texture

WRAPS = ("repeat", "clamp", "mirror", ("repeat", "mirror"), ("clamp", "repeat"))
FILTERS = ("nearest", "bilinear", "trilinear")
SIZES = ((16, 16), (1, 1), (1, 7), (9, 1), (5, 3), (37, 64), (300, 200), (2, 2))  # (w, h)


@kernel
def look_up(batch, n, textures, material):
    """Look the texture of a material up."""
    one = laying.texture_of(textures, material)
    compute_texcoords(batch, n, one)
    read_texels(batch, n, one)


as_plain = np.errstate(all="ignore")(getattr(look_up, "py_func", look_up))


def textures_of(image, filter="trilinear", wrap="repeat"):
    """One texture, and as it is looked up."""
    texture = Texture(image, filter, wrap)
    return texture, make_textures([texture])


def shown(batch, n=BATCH_SIZE):
    """What n samples of a batch show, (4, n)."""
    first = int(b.TEXEL) // BATCH_SIZE
    return batch.reshape(-1, BATCH_SIZE)[first : first + 4, :n]


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
        *references, number = texcoord_references(np.asarray(near) / self.sizes, tuple(packed.wraps[0]))
        self.batch = b.make_lookup_batch()
        rows = self.batch.reshape(-1, BATCH_SIZE)[:10]
        rows[:, : self.n] = [*planes, inv_w, np.full(self.n, number), *derivatives[0], *derivatives[1]]
        with np.errstate(all="ignore"):
            self.offsets = planes.astype(float) / inv_w
            self.texcoords = self.offsets + (references * self.sizes)[:, None]
            self.steps = (derivatives[:, :2] - self.offsets * derivatives[:, 2:].astype(float)) / inv_w
            square = np.nan_to_num((self.steps**2).sum(axis=1).max(axis=0), nan=1.0, posinf=1e300)
        n_level = packed.sizes[0, 2]
        self.mip_levels = np.clip(0.5 * np.log2(np.maximum(square, 1.0)), 0, n_level - 1)

    def found(self, packed):
        """What is found (4, n), colours as they are seen: times alpha."""
        batch = self.batch.copy()
        look_up(batch, self.n, packed, 0)
        return seen(shown(batch, self.n).astype(float))

    def expected(self, texture, moved=0.0):
        """What the reference finds (4, n) where texture coordinates are moved by (2, n) or (2, 1) texels."""
        s, t = (self.texcoords + moved) / self.sizes[:, None]
        steps = np.zeros((self.n, 2, 2))
        steps[:, 0, 0] = 2.0**self.mip_levels / self.sizes[0]
        return seen(sample_texture(texture, np.stack([s, 1.0 - t], axis=1), steps).T)

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
                laying.texture_error(packed, 0, own[0][k] + errors[0], own[1][k] + errors[1], of_level[k])
                for k in range(self.n)
            ]
        )


def seen(texels):
    """Colours (4, n) times their alpha, and alpha."""
    return np.concatenate([texels[:3] * texels[3], texels[3:]])


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
            found = samples.found(packed)
            worst = (np.abs(found - samples.expected(texture)).max(axis=0) / samples.bounds(packed)).max()
            assert worst <= 1.0, f"{kind} {size} {wrap}: {worst:.3f} > 1 times the bound"


# ---------------------------------------------------------------- what must hold exactly


@pytest.mark.parametrize("filter", FILTERS)
def test_any_number_finds_a_texel_of_the_texture(filter):
    """Whatever stands in the batch: texels of other textures before and behind are never read."""
    rng = np.random.default_rng(5)
    hard = np.array([0.0, -0.0, 1.0, -1.0, 1e-45, 1e30, -1e30, np.inf, -np.inf, np.nan, 3e38, 2.0**31, -(2.0**31)])
    for wrap in ("repeat", "clamp", "mirror"):
        inside = Texture(rng.uniform(0.25, 0.75, (5, 7, 4)), filter, wrap)
        around = [Texture(np.zeros((9, 4, 4)), filter), Texture(np.ones((3, 3, 4)), filter)]
        materials = [Material(texture=texture) for texture in (around[0], inside, around[1])]
        packed = make_textures([material.texture for material in materials])
        for _ in range(20):
            batch = b.make_lookup_batch()
            rows = batch.reshape(-1, BATCH_SIZE)
            rows[:10] = rng.choice(hard, (10, BATCH_SIZE))
            rows[rng.integers(10)] = rng.uniform(-2, 2, BATCH_SIZE)
            if rng.uniform() < 0.5:
                rows[3] = rng.integers(0, 2**24, BATCH_SIZE)
            look_up(batch, BATCH_SIZE, packed, 1)
            out = shown(batch)
            assert out.min() >= 0.24 and out.max() <= 0.76, f"{wrap}: {out.min()}..{out.max()}"


def test_a_sample_does_not_depend_on_its_neighbours():
    """The level of one sample decides what the batch is looked up by; what each finds is the same, also without the
    compiler. Beyond the last one, and the next multiple of LANES, nothing is written."""
    rng = np.random.default_rng(10)
    _, packed = textures_of(image_of("noise", (16, 16), rng))
    near, far = random_samples(packed, rng, level=-3.0), random_samples(packed, rng, level=2.0)
    both = near.batch.copy()
    rows, of_far = both.reshape(-1, BATCH_SIZE), far.batch.reshape(-1, BATCH_SIZE)
    rows[:10, ::2] = of_far[:10, ::2]
    look_up(both, BATCH_SIZE, packed, 0)
    found = seen(shown(both).astype(float))
    assert not differences(found[:, 1::2], near.found(packed)[:, 1::2])
    assert not differences(found[:, ::2], far.found(packed)[:, ::2])
    for filter, n in product(FILTERS, (1, 3, 4, 5, 21)):
        _, packed = textures_of(image_of("noise", (8, 8), rng), filter)
        samples, found = random_samples(packed, rng, n), []
        for way in (look_up, as_plain):
            batch = samples.batch.copy()
            shown(batch)[:] = 7
            way(batch, n, packed, 0)
            out = shown(batch)
            assert (out[:, -(-n // LANES) * LANES :] == 7).all() and (out[:, :n] != 7).all(), f"{filter}, {n} samples"
            found.append(out[:, :n].tobytes())
        assert found[0] == found[1], f"{filter}, {n} samples: without the compiler, something else is found"


def test_the_border_of_two_texels_belongs_to_the_second_one():
    for n in (1, 2, 3, 5, 7, 10, 640, 1000, 4095, 12345, 16384):
        for k in range(0, n, max(1, n // 50)):
            column = product_of(fixed_point(k / n), np.int32(n))[0] >> 16
            assert column == k, f"the border before texel {k} of {n} lies in {column}"
