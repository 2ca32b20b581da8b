"""The textures of a scene as arrays that the pipeline reads: those that share one have it once.

In 16 bits with mip levels for look-ups in float32, made of the bytes of a picture, strip by strip; in float32 only
those that are looked up in float64.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..pipeline.textures import (
    FILTER_BILINEAR,
    FILTER_NEAREST,
    FILTER_TRILINEAR,
    FIRST_TEXCOORD,
    WRAP_CLAMP,
    WRAP_MIRROR,
    WRAP_REPEAT,
    PackedTextures,
    Textures,
    decode_rows,
    error_factors,
    first_texel,
    halve_texels,
    halve_weighted_texels,
    pack_level,
    strips_of,
)
from ..scene.texture import COLORS_OF_BYTES, Texture, halve_rows

_FILTERS = {"nearest": FILTER_NEAREST, "bilinear": FILTER_BILINEAR, "trilinear": FILTER_TRILINEAR}
DARKEST = 2.0**-40  # what a black texture counts as bright as
_WRAPS = {"repeat": WRAP_REPEAT, "clamp": WRAP_CLAMP, "mirror": WRAP_MIRROR}


class TextureList(NamedTuple):
    """The different textures of materials."""

    textures: tuple[Texture, ...]
    of_materials: NDArray[np.int64]  # (n_material,): the texture of each, -1 for none
    texcoord: int  # the attribute that is u; v follows

    @property
    def filters(self) -> NDArray[np.int64]:
        """(n_texture,): FILTER_... of each."""
        return np.array([_FILTERS[texture.filter] for texture in self.textures], np.int64)

    @property
    def wraps(self) -> NDArray[np.int64]:
        """(n_texture, 2): WRAP_... of each, along u and v."""
        wraps = [[_WRAPS[word] for word in texture.wrap] for texture in self.textures]
        return np.array(wraps, np.int64).reshape(-1, 2)


def list_textures(of_materials: Sequence[Texture | None], n_texcoord: int = 2) -> TextureList:
    """List the textures of materials, or None, each once; the last two of `n_texcoord` texture coordinates are
    theirs."""
    different = {id(texture): texture for texture in of_materials if texture is not None}
    number = {key: k for k, key in enumerate(different)}
    numbers = np.array([number.get(id(texture), -1) for texture in of_materials], np.int64)
    return TextureList(tuple(different.values()), numbers, FIRST_TEXCOORD + n_texcoord - 2)


def lay_textures(listed: TextureList, of_materials: NDArray[np.int64] | None = None, run: Callable = map) -> Textures:
    """Lay textures behind each other: pictures of bytes, and then what is float32.

    Parameters
    ----------
    of_materials : (n_material,) the texture of each that is looked up, -1 for none: no other textures are laid;
        None = all
    run : calls a function with every item of a sequence: `map`, or `Workers.map` on threads
    """
    used = listed.of_materials if of_materials is None else of_materials
    shown = [texture if k in used else None for k, texture in enumerate(listed.textures)]
    decoded = next((each.decoded for each in shown if each is not None and each.encoded is not None), COLORS_OF_BYTES)
    # Bytes of the other kind, where there are both, are laid as what they mean.
    shown = [None if t is None else t if t.encoded is None or t.decoded is decoded else replace(t) for t in shown]
    n_encoded = sum(math.prod(each.shape) for each in shown if each is not None and each.encoded is not None)
    encoded, texels = np.empty((n_encoded, 4), np.uint8), np.empty((sum(map(_n_single, shown)), 4), np.float32)
    rows, first_byte, first = [], 0, 0
    for texture in shown:
        if texture is None:
            continue
        height, width = texture.shape
        n = height * width
        if texture.encoded is not None:
            _write_bytes(texture.encoded.reshape(n, -1), encoded[first_byte : first_byte + n], run)
            rows.append((first_byte, width, height))
            first_byte += n
        else:
            texels[first : first + n] = texture.image.reshape(n, 4)
            rows.append((n_encoded + first, width, height))
            first += n
        for level in _mip_levels(texture, run, texels[first:]):
            height, width = level.shape[:2]
            rows.append((n_encoded + first, width, height))
            first += height * width
    return Textures(
        encoded.ravel(),
        decoded,
        texels.ravel(),
        np.array(rows, np.int64).reshape(-1, 3),
        np.cumsum([0] + [0 if texture is None else texture.n_level for texture in shown]).astype(np.int64),
        listed.filters,
        listed.wraps,
        used,
        listed.texcoord,
    )


def _n_single(texture: Texture | None) -> int:
    """How many texels of a texture are laid in float32."""
    if texture is None:
        return 0
    height, width = texture.shape
    first = 0 if texture.encoded is None else 1
    return sum(max(height >> k, 1) * max(width >> k, 1) for k in range(first, texture.n_level))


def _picture_of(texture: Texture) -> NDArray:
    """The picture of a texture, uint8 where it is of bytes."""
    return texture.image if texture.encoded is None else texture.encoded


def _mip_levels(texture: Texture, run: Callable, room: NDArray[np.float32]) -> Iterator[NDArray[np.float32]]:
    """Write the mip levels below the picture to a room (n, 4), one behind the other, as `Texture.pyramid` has them."""
    level = _picture_of(texture)
    for _ in range(1, texture.n_level):
        height, width = (max(n // 2, 1) for n in level.shape[:2])
        half, room = room[: height * width].reshape(height, width, 4), room[height * width :]
        level = _halve(level, texture, half, run)
        yield level


def _halve(level: NDArray, texture: Texture, half: NDArray[np.float32], run: Callable) -> NDArray[np.float32]:
    """Write the next mip level of one of a texture's, which may be uint8, and return it."""
    height, width = level.shape[:2]

    def halve(strip):
        first, end = strip
        rows, out = decode_rows(level, texture.decoded, 2 * first, min(2 * end + 1, height)), half[first:end]
        if height % 2 == 1 or width % 2 == 1:
            halve_rows(rows.reshape(len(rows), width, 4), height, first, out)
        elif texture.has_alpha:
            halve_weighted_texels(rows, out.reshape(len(out), -1))
        else:
            halve_texels(rows, out.reshape(len(out), -1))

    list(run(halve, strips_of(len(half), 2 * width)))
    return half


def _write_bytes(encoded: NDArray[np.uint8], out: NDArray[np.uint8], run: Callable) -> None:
    """Write bytes (n, 1..4) as red, green, blue and alpha."""
    n_channel = encoded.shape[1]
    has_alpha = n_channel in (2, 4)

    def write(strip):
        source, target = encoded[slice(*strip)], out[slice(*strip)]
        for k in range(3):
            target[:, k] = source[:, min(k, n_channel - has_alpha - 1)]
        target[:, 3] = source[:, -1] if has_alpha else 255

    list(run(write, strips_of(len(out), 1)))


def pack_textures(
    listed: TextureList, of_materials: NDArray[np.int64] | None = None, run: Callable = map
) -> PackedTextures:
    """Pack textures, with the mip levels that their filters need. Errors of those that aren't are infinite.

    A texture whose colours are at most 2^k, k >= 0 or less, has steps of 2^k/65535.

    Parameters
    ----------
    of_materials, run : see `lay_textures`
    """
    textures, filters, wraps = listed.textures, listed.filters, listed.wraps
    sizes = np.array([(*texture.shape[::-1], texture.n_level) for texture in textures], np.int64).reshape(-1, 3)
    used = listed.of_materials if of_materials is None else of_materials
    is_packed = np.isin(np.arange(len(textures)), used)
    counts = [first_texel(*map(np.int32, size)) if packed else 0 for size, packed in zip(sizes, is_packed, strict=True)]
    first_texels = np.cumsum([0, *counts]).astype(np.int64)
    texels = np.zeros((int(first_texels[-1]), 4), np.int16)
    steps, errors = np.zeros(len(textures), np.float32), np.full((len(textures), 4), np.inf)
    packed = np.flatnonzero(is_packed).tolist()
    room = np.empty((max((_n_single(textures[k]) for k in packed), default=0), 4), np.float32)
    for k in packed:
        texture = textures[k]
        scale = 2.0 ** np.ceil(np.log2(max(texture.brightest, DARKEST)))
        steps[k] = scale / 65535.0
        out, shapes, differences = texels[first_texels[k] : first_texels[k + 1]], [], []
        for number, level in enumerate(chain([_picture_of(texture)], _mip_levels(texture, run, room))):
            shapes.append(level.shape)
            differences.append(
                pack_level(level, texture.decoded, wraps[k], scale, _bordered(out, sizes[k], number), run)
            )
        errors[k] = error_factors(shapes, differences, scale, filters[k])
    return PackedTextures(texels.ravel(), first_texels, sizes, filters, wraps, steps, errors)


def _bordered(texels, size, level) -> NDArray[np.int16]:
    """Return the part (h + 2, w + 2, 4) of a texture's texels that is one mip level."""
    width, height = max(int(size[0]) >> level, 1), max(int(size[1]) >> level, 1)
    first = int(first_texel(np.int32(size[0]), np.int32(size[1]), np.int32(level)))
    return texels[first : first + (width + 2) * (height + 2)].reshape(height + 2, width + 2, 4)
