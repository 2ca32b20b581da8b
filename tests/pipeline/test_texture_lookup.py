"""Look textures up in float32, and compare with the exact way, float64: within the bound, and never beside a texel."""

import numpy as np
import pytest

from rasterizer.compiler.kernels import helper, index, kernel
from rasterizer.engine.surface_arrays import list_textures
from rasterizer.pipeline import lookup_batch as b
from rasterizer.pipeline import texture_packing as packing
from rasterizer.pipeline import texture_sampling as exact
from rasterizer.pipeline.fragments import BATCH_SIZE
from rasterizer.pipeline.texture_lookup import sample_batch, texcoord_reference
from rasterizer.scene.material import Material
from rasterizer.scene.texture import Texture

WRAPS = ("repeat", "clamp", "mirror", ("repeat", "mirror"), ("clamp", "repeat"))
SIZES = ((16, 16), (1, 1), (1, 7), (9, 1), (5, 3), (37, 64), (300, 200), (2, 2))  # (w, h)


# ---------------------------------------------------------------- both ways


@kernel
def look_up(batch, n, packed, texture, out):
    """Look a texture up in float32."""
    return sample_batch(batch, n, packing.packed_texture(packed, index(texture)), out, index(0), index(BATCH_SIZE))


@kernel
def look_up_exactly(textures, texture, s, t, mip_levels, out):
    """Look a texture up in float64, by the functions of the exact way; s and t are in pictures here."""
    first = textures.first_levels[texture]
    wraps = (textures.wraps[texture, 0], textures.wraps[texture, 1])
    for k in range(len(s)):
        x, y = exact.wrap_texcoord(s[k], wraps[0]), exact.wrap_texcoord(t[k], wraps[1])
        if textures.filters[texture] == exact.FILTER_NEAREST:
            color = exact.sample_nearest(textures, first, x, y)
        else:
            level, share = first + np.int64(mip_levels[k]), mip_levels[k] - np.floor(mip_levels[k])
            color = exact.sample_bilinear(textures, level, wraps, x, y)
            if share > 0.0:
                color = exact.mix(color, exact.sample_bilinear(textures, level + 1, wraps, x, y), share)
        out[0, k], out[1, k], out[2, k], out[3, k] = color


def textures_of(image, filter="trilinear", wrap="repeat"):
    """One texture for the exact way, and packed."""
    textures = list_textures([Material(texture=Texture(image, filter, wrap))])
    return textures, packing.pack_textures(textures)


class Samples:
    """Samples of one texture: the rows of a batch, and the same numbers in float64.

    offsets : (2, n), s' and t' · inv_w : (n,) · derivatives : (2, 3, n), those of S, T and D along x and y
    references : (s_ref, t_ref), texels
    """

    def __init__(self, packed, offsets, references=(0.0, 0.0), inv_w=1.0, derivatives=0.0, error=0.0):
        self.n, self.sizes, wraps = np.shape(offsets)[1], packed.sizes[0, :2], packed.wraps[0]
        inv_w = np.float32(np.broadcast_to(inv_w, self.n))
        planes = np.float32(np.asarray(offsets) * inv_w)
        derivatives = np.float32(np.broadcast_to(derivatives, (2, 3, self.n)))
        known = [texcoord_reference(x, n, wrap) for x, n, wrap in zip(references, self.sizes, wraps, strict=True)]
        self.batch = b.make_lookup_batch()
        rows = self.batch.reshape(-1, BATCH_SIZE)[:12]
        whole = [np.int32([number]).view(np.float32)[0] for _, number in known]
        rows[:, : self.n] = [
            [*values, np.broadcast_to(last, self.n)][i]
            for values, last in (
                ([*planes, inv_w], whole[0]),
                ([*derivatives[0]], whole[1]),
                ([*derivatives[1]], np.float32(error)),
            )
            for i in range(4)
        ]
        with np.errstate(all="ignore"):
            self.offsets = planes.astype(float) / inv_w
            self.texcoords = self.offsets + np.array([[reference] for reference, _ in known])
            self.steps = (derivatives[:, :2] - self.offsets * derivatives[:, 2:].astype(float)) / inv_w
            square = np.nan_to_num((self.steps**2).sum(axis=1).max(axis=0), nan=1.0, posinf=1e300)
        n_level = packed.sizes[0, 2]
        self.mip_levels = np.clip(0.5 * np.log2(np.maximum(square, 1.0)), 0, n_level - 1)

    def found(self, packed, texture=0):
        """What the float32 way finds (4, n), and which samples are doubtful."""
        out, batch = np.full((4, BATCH_SIZE), np.nan, np.float32), self.batch.copy()
        is_any = look_up(batch, self.n, packed, texture, out)
        is_doubtful = np.zeros(self.n, bool)
        if packed.filters[texture] == exact.FILTER_NEAREST:
            is_doubtful = batch.view(np.int32)[int(b.IS_DOUBTFUL) :][: self.n] != 0
        assert is_any == is_doubtful.any()
        return out[:, : self.n].astype(float), is_doubtful

    def expected(self, textures, moved=0.0):
        """What the exact way finds (4, n) where texture coordinates are moved by (2, n) or (2, 1) texels."""
        s, t = (self.texcoords + moved) / self.sizes[:, None]
        out = np.empty((4, self.n))
        look_up_exactly(textures, index(0), s, t, self.mip_levels, out)
        return out

    def bounds(self, packed, errors=(0.0, 0.0)):
        """The bound of each sample, its own roundings and further errors of s and t (in texels) counted."""
        own = [packing.texcoord_error(0.0, 0.0, 1.0, abs(offset)) for offset in self.offsets]
        # Rounding of the derivatives: of both products, the difference and the product with w, see `fill_mip_levels`.
        sizes = np.abs(self.batch.reshape(-1, BATCH_SIZE)[:11, : self.n].astype(float))
        of_steps = [
            (sizes[4 * k + i] + 6.0 * abs(self.offsets[i - 0]) * sizes[4 * k + 2]) / sizes[2] * 2.0**-23
            for k in (1, 2)
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
    return Samples(packed, offsets, references, inv_w, steps, error=0.0)


# ---------------------------------------------------------------- within the bound


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("filter", ["bilinear", "trilinear"])
@pytest.mark.parametrize("kind", KINDS)
def test_colours_are_within_their_bound(kind, filter, size):
    rng = np.random.default_rng(abs(hash((len(kind), filter == "bilinear", size))))
    worst = 0.0
    for wrap in WRAPS:
        textures, packed = textures_of(image_of(kind, size, rng), filter, wrap)
        for _ in range(12):
            samples = random_samples(packed, rng)
            found, _ = samples.found(packed)
            off = np.abs(found - samples.expected(textures)).max(axis=0)
            worst = max(worst, (off / samples.bounds(packed)).max())
    assert worst <= 1.0, f"{worst:.3f} > 1 times the bound"
