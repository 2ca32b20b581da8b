"""Textures: what a picture laid over the surface shows at every visible sample of a band. Between scan and shade, where a scene has any.

In:  the band's z-buffer and its exact records (records.py), two attributes of which are texture coordinates.
Out: `texels`, red, green, blue and alpha of the texture, a plane each; 1 where the visible surface has none.

Texture coordinates are interpolated in perspective (exact.py). The mipmap is chosen by the larger of the lengths, in texels, that
one step of the sample to the right and one down move on the texture (Williams 1983, "Pyramidal parametrics"; Heckbert 1983): with
u = U/D, both linear on the screen, du/dx = (U_x - u·D_x)/D.
"""

from typing import NamedTuple

import numpy as np

from .._kernel import borrow, helper, kernel
from .exact import corner_weights, corners_of, is_exact, mean, place_of, run_end
from .records import ATTRIBUTE, FACE, INV_W, RECORD_MASK, borrow_records
from .scan import GROUP_SHIFT
from .transform import HALF, SUBPIXEL

NEAREST, BILINEAR, TRILINEAR = 0, 1, 2  # filters
REPEAT, CLAMP, MIRROR = 0, 1, 2  # what lies outside the picture
LIGHT_COLUMNS = 6  # attributes in front of the texture coordinates


class Textures(NamedTuple):
    """All textures of a scene, level by level in one array."""

    texel: np.ndarray  # (n_texel, 4) float32, linear red, green, blue, and alpha
    level: np.ndarray  # (n_level, 3) int64: first texel, width, height
    first_level: np.ndarray  # (n_texture + 1,) int64
    filter: np.ndarray  # (n_texture,) int64
    wrap: np.ndarray  # (n_texture, 2) int64, along u and v
    of_material: np.ndarray  # (n_material,) int64, -1 for none


def make_textures(materials) -> Textures:
    """Lay the textures of materials behind each other; those that are shared, once."""
    different = {id(material.texture): material.texture for material in materials if material.texture is not None}
    number = {key: k for k, key in enumerate(different)}
    levels = [level for texture in different.values() for level in texture.pyramid]
    shapes = np.array([level.shape[:2] for level in levels], np.int64).reshape(-1, 2)
    first = np.cumsum([0] + [level.shape[0] * level.shape[1] for level in levels])
    filters, wraps = ("nearest", "bilinear", "trilinear"), ("repeat", "clamp", "mirror")
    return Textures(
        np.concatenate([level.reshape(-1, 4) for level in levels]) if levels else np.empty((0, 4), np.float32),
        np.column_stack([first[:-1], shapes[:, 1], shapes[:, 0]]).astype(np.int64),
        np.cumsum([0] + [len(texture.pyramid) for texture in different.values()]).astype(np.int64),
        np.array([filters.index(texture.filter) for texture in different.values()], np.int64),
        np.array([[wraps.index(word) for word in texture.wrap] for texture in different.values()], np.int64).reshape(-1, 2),
        np.array([number.get(id(material.texture), -1) for material in materials], np.int64),
    )


@kernel
def take_texels(canvas, records, y_start, n_row, textures, face_material, out_texels):
    """Look the texture up at every sample of the band; `face_material` is that of each triangle, or empty where there is one."""
    words, left, right = borrow(canvas.words), borrow(canvas.left), borrow(canvas.right)
    records, face_material, texels = borrow_records(records), borrow(face_material), borrow(out_texels)
    textures = Textures(
        borrow(textures.texel), borrow(textures.level), borrow(textures.first_level), borrow(textures.filter),
        borrow(textures.wrap), borrow(textures.of_material),
    )  # fmt: skip
    one = texels.dtype.type(1)
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(GROUP_SHIFT)
        if left[group] >= right[group]:
            continue
        start = np.uint64(j * canvas.pitch + left[group])
        n = np.uint64(right[group] - left[group])
        row, k = words[start : start + n], np.uint64(0)
        while k < n:
            stop = run_end(row, k)
            number = np.int64(-1)
            if is_exact(row[k]):
                record = np.uint64(row[k] & RECORD_MASK)
                face = np.uint64(records.integers[record, np.uint64(FACE)])
                number = textures.of_material[face_material[face] if len(face_material) > 0 else np.uint32(0)]
            if number >= 0:
                out = texels[:, start + k : start + stop]
                take_run(records, record, left[group] + np.int64(k), y_start + j, textures, np.uint64(number), out)
            else:
                for channel in range(np.uint64(4)):
                    for i in range(start + k, start + stop):
                        texels[channel, i] = one
            k = stop


@helper
def take_run(records, record, x, y, textures, number, out):
    """Look a texture up along a run of samples of one triangle that begins at (x, y)."""
    place, inv_w = place_of(records.integers, record), corners_of(records.numbers, record, INV_W)
    us = corners_of(records.numbers, record, ATTRIBUTE + 3 * LIGHT_COLUMNS)
    vs = corners_of(records.numbers, record, ATTRIBUTE + 3 * LIGHT_COLUMNS + 3)
    first, last = textures.first_level[number], textures.first_level[number + np.uint64(1)] - 1
    kind = textures.filter[number]
    wrap_u, wrap_v = textures.wrap[number, 0], textures.wrap[number, 1]
    width, height = float(textures.level[np.uint64(first), 1]), float(textures.level[np.uint64(first), 2])
    _, _, dx1, dy1, dx2, dy2 = place
    # What one step of a sample, to the right and down, adds to the weights of corners 1 and 2; corner 0 loses both.
    d_x, u_x, v_x = steps(float(dy2 * SUBPIXEL), float(-dy1 * SUBPIXEL), inv_w, us, vs)
    d_y, u_y, v_y = steps(float(-dx2 * SUBPIXEL), float(dx1 * SUBPIXEL), inv_w, us, vs)
    for k in range(np.uint64(out.shape[1])):
        q0, q1, q2 = corner_weights(place, inv_w, (x + np.int64(k)) * SUBPIXEL + HALF, y * SUBPIXEL + HALF)
        scale = 1.0 / (q0 + q1 + q2)
        u, v = mean(us, q0 * scale, q1 * scale, q2 * scale), mean(vs, q0 * scale, q1 * scale, q2 * scale)
        level, part = first, 0.0
        if kind == TRILINEAR:
            across = ((u_x - u * d_x) * scale * width, (v_x - v * d_x) * scale * height)
            down = ((u_y - u * d_y) * scale * width, (v_y - v * d_y) * scale * height)
            square = max(across[0] * across[0] + across[1] * across[1], down[0] * down[0] + down[1] * down[1])
            detail = min(0.5 * np.log2(square), float(last - first)) if square > 1.0 else 0.0
            level, part = first + np.int64(detail), detail - np.floor(detail)
        if kind == NEAREST:
            red, green, blue, alpha = nearest(textures, level, wrap_u, wrap_v, u, v)
        else:
            red, green, blue, alpha = bilinear(textures, level, wrap_u, wrap_v, u, v)
        if part > 0.0:
            coarse = bilinear(textures, level + 1, wrap_u, wrap_v, u, v)
            red, green = red + part * (coarse[0] - red), green + part * (coarse[1] - green)
            blue, alpha = blue + part * (coarse[2] - blue), alpha + part * (coarse[3] - alpha)
        out[0, k], out[1, k], out[2, k], out[3, k] = red, green, blue, alpha


@helper
def steps(e1, e2, inv_w, us, vs):
    """What the sums Σ q, Σ q·u and Σ q·v grow by where the edge functions of corners 1 and 2 grow by e1 and e2."""
    q0, q1, q2 = -(e1 + e2) * inv_w[0], e1 * inv_w[1], e2 * inv_w[2]
    return q0 + q1 + q2, q0 * us[0] + q1 * us[1] + q2 * us[2], q0 * vs[0] + q1 * vs[1] + q2 * vs[2]


@helper
def nearest(textures, level, wrap_u, wrap_v, u, v):
    """The texel that a point lies in."""
    start, width, height = place_of_level(textures, level)
    i, j = wrapped(np.int64(np.floor(u * width)), width, wrap_u), wrapped(np.int64(np.floor((1.0 - v) * height)), height, wrap_v)
    return texel_at(textures, start + j * width + i)


@helper
def bilinear(textures, level, wrap_u, wrap_v, u, v):
    """Mean of the four texels whose centres are about a point."""
    start, width, height = place_of_level(textures, level)
    x, y = u * width - 0.5, (1.0 - v) * height - 0.5
    left, top = np.floor(x), np.floor(y)
    across, down = x - left, y - top
    i0, i1 = wrapped(np.int64(left), width, wrap_u), wrapped(np.int64(left) + 1, width, wrap_u)
    j0, j1 = wrapped(np.int64(top), height, wrap_v), wrapped(np.int64(top) + 1, height, wrap_v)
    above = mix(texel_at(textures, start + j0 * width + i0), texel_at(textures, start + j0 * width + i1), across)
    below = mix(texel_at(textures, start + j1 * width + i0), texel_at(textures, start + j1 * width + i1), across)
    return mix(above, below, down)


@helper
def mix(a, b, part):
    """Go the share `part` of the way from colour a to b."""
    return (
        a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), a[2] + part * (b[2] - a[2]), a[3] + part * (b[3] - a[3]),
    )  # fmt: skip


@helper
def place_of_level(textures, level):
    """First texel, width and height of a level."""
    row = textures.level[np.uint64(level)]
    return row[0], row[1], row[2]


@helper
def texel_at(textures, index):
    """One texel."""
    row = textures.texel[np.uint64(index)]
    return float(row[0]), float(row[1]), float(row[2]), float(row[3])


@helper
def wrapped(i, n, wrap):
    """The index within 0..n-1 that stands for any index."""
    if wrap == CLAMP:
        return min(max(i, np.int64(0)), n - 1)
    if wrap == MIRROR:
        i = i % (2 * n)
        return min(i, 2 * n - 1 - i)
    return i % n


@kernel
def shade_textured(canvas, records, y_start, n_row, texels, out_radiance):
    """Flat shading and Gouraud's method with textures: interpolate the light that the texture weakens and the rest apart.

    The attributes are those of make_attributes: what a black surface gives off (0-2) and what the whole one gives off (3-5).
    """
    words, left, right = borrow(canvas.words), borrow(canvas.left), borrow(canvas.right)
    records, texels, radiance = borrow_records(records), borrow(texels), borrow(out_radiance)
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(GROUP_SHIFT)
        if left[group] >= right[group]:
            continue
        start = np.uint64(j * canvas.pitch + left[group])
        n = np.uint64(right[group] - left[group])
        row, k = words[start : start + n], np.uint64(0)
        while k < n:
            stop = run_end(row, k)
            if is_exact(row[k]):
                record = np.uint64(row[k] & RECORD_MASK)
                place, inv_w = place_of(records.integers, record), corners_of(records.numbers, record, INV_W)
                for i in range(k, stop):
                    x = left[group] + np.int64(i)
                    q0, q1, q2 = corner_weights(place, inv_w, x * SUBPIXEL + HALF, (y_start + j) * SUBPIXEL + HALF)
                    scale = 1.0 / (q0 + q1 + q2)
                    for channel in range(np.uint64(3)):
                        column = np.uint64(ATTRIBUTE) + np.uint64(3) * channel
                        rest = mean(corners_of(records.numbers, record, column), q0 * scale, q1 * scale, q2 * scale)
                        whole = mean(corners_of(records.numbers, record, column + np.uint64(9)), q0 * scale, q1 * scale, q2 * scale)
                        radiance[channel, start + i] = rest + (whole - rest) * texels[channel, start + i]
            k = stop
