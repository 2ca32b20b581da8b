"""The textures of a scene as arrays that the pipeline reads: those that share one have it once.

In float32 with mip levels, made of the bytes or floats of a picture, strip by strip.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..pipeline import textures as t
from ..pipeline.textures import Textures
from ..scene.texture import Texture, halve_rows

_FILTERS = {"nearest": t.FILTER_NEAREST, "bilinear": t.FILTER_BILINEAR, "trilinear": t.FILTER_TRILINEAR}
_WRAPS = {"repeat": t.WRAP_REPEAT, "clamp": t.WRAP_CLAMP, "mirror": t.WRAP_MIRROR}


def make_textures(of_materials: Sequence[Texture | None], n_texcoord: int = 2, run: Callable = map) -> Textures | None:
    """Lay the textures of materials behind each other, each once, with the mip levels that their filters need.

    Parameters
    ----------
    of_materials : the texture of each material, or None
    n_texcoord : texture coordinates of a point, of which the last two are those of these textures
    run : calls a function with every item of a sequence: `map`, or `Workers.map` on threads

    Returns
    -------
    None where no material has one
    """
    textures = list({id(texture): texture for texture in of_materials if texture is not None}.values())
    if not textures:
        return None
    numbers = {id(texture): number for number, texture in enumerate(textures)}
    sizes = np.array([(*texture.shape[::-1], texture.n_level) for texture in textures], np.int64)
    first_texels = np.cumsum([0, *(t.first_texel(*map(np.int32, size)) for size in sizes)]).astype(np.int64)
    wraps = np.array([[_WRAPS[word] for word in texture.wrap] for texture in textures], np.int64)
    texels, errors = np.zeros((int(first_texels[-1]), 4), np.float32), np.zeros((len(textures), 4))
    for k, texture in enumerate(textures):
        errors[k] = _fill(texture, wraps[k], texels[first_texels[k] : first_texels[k + 1]], run)
    return Textures(
        texels.ravel(),
        first_texels,
        sizes,
        np.array([_FILTERS[texture.filter] for texture in textures], np.int64),
        wraps,
        errors,
        np.array([texture.has_alpha for texture in textures], np.bool_),
        np.array([numbers.get(id(texture), -1) for texture in of_materials], np.int64),
        t.FIRST_TEXCOORD + n_texcoord - 2,
    )


def _fill(texture: Texture, wraps: NDArray[np.int64], texels: NDArray[np.float32], run: Callable) -> tuple[float, ...]:
    """Write all mip levels of a texture; return its row of `errors`, see pipeline/textures.py."""
    levels = [_bordered(texels, texture.shape, number) for number in range(texture.n_level)]
    differences = [t.fill_level(levels[0], wraps, _writer(texture, levels[0]), run)]
    for source, half in zip(levels, levels[1:], strict=False):
        differences.append(t.fill_level(half, wraps, _halver(source, half), run))
    sizes = [(level.shape[1] - 2, level.shape[0] - 2) for level in levels]
    return t.error_factors(sizes, differences, max(texture.brightest, 1.0))


def _bordered(texels: NDArray[np.float32], shape: tuple[int, int], level: int) -> NDArray[np.float32]:
    """Return the part (h + 2, w + 2, 4) of a texture's texels that is one mip level."""
    height, width = (max(n >> level, 1) for n in shape)
    first = int(t.first_texel(np.int32(shape[1]), np.int32(shape[0]), np.int32(level)))
    return texels[first : first + (width + 2) * (height + 2)].reshape(height + 2, width + 2, 4)


def _writer(texture: Texture, level: NDArray[np.float32]) -> Callable[[int, int], None]:
    """Return what writes rows of a texture's picture to its first mip level."""
    rows, encoded = level.reshape(len(level), -1), texture.encoded

    def write(first, end):
        if encoded is None:
            level[first + 1 : end + 1, 1:-1] = texture.image[first:end]
        else:
            part, n_channel = encoded[first:end], encoded.shape[2]
            t.decode_texels(part.reshape(end - first, -1), n_channel, texture.decoded, rows[first + 1 : end + 1])
        if texture.has_alpha:
            level[first + 1 : end + 1, 1:-1, :3] *= level[first + 1 : end + 1, 1:-1, 3:]

    return write


def _halver(source: NDArray[np.float32], half: NDArray[np.float32]) -> Callable[[int, int], None]:
    """Return what writes rows of the mip level behind `source`; both have borders."""
    height, width = (n - 2 for n in source.shape[:2])
    rows, out = source.reshape(height + 2, -1), half.reshape(len(half), -1)

    def write(first, end):
        if height % 2 == 1 or width % 2 == 1:
            needed = source[2 * first + 1 : min(2 * end + 1, height) + 1, 1:-1]
            halve_rows(needed, height, first, half[first + 1 : end + 1, 1:-1])
        else:
            t.halve_texels(rows[2 * first + 1 : 2 * end + 1], out[first + 1 : end + 1])

    return write
