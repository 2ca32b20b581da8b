"""Textures: what a picture laid over the surface shows at every visible sample of a band. Between scan and shade, where
a scene has any.

In:  the band's z-buffer and its exact records (records.py), two attributes of which are texture coordinates.
Out: `texels`, red, green, blue and alpha of the texture, a plane each; 1 where the visible surface has none.

Texture coordinates are interpolated in perspective (interpolate.py). The mipmap is chosen by the larger of the lengths,
in texels, that one step of the sample to the right and one down move on the texture (Williams 1983, "Pyramidal
parametrics"; Heckbert 1983): with u = U/D, both linear on the screen, du/dx = (U_x - u·D_x)/D.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import borrow, helper, kernel
from .fragments import CHUNK
from .interpolate import corner_weights, corners_of, is_exact, mean, run_end, weight_steps, weights_of
from .records import ATTRIBUTE, FACE, borrow_records
from .transform import HALF, SUBPIXEL
from .visibility import RECORD_MASK, STRIP_SHIFT

NEAREST, BILINEAR, TRILINEAR = 0, 1, 2  # filters
REPEAT, CLAMP, MIRROR = 0, 1, 2  # what lies outside the picture
# Rows of a chunk of samples: texture coordinates, the place within the picture from the left and from the top, 1 / Σ q,
# the mipmap.
PLACE_U, PLACE_V, PLACE_S, PLACE_T, WEIGHT, DETAIL = (np.uint64(CHUNK * k) for k in range(6))
LIGHT_COLUMNS = 6  # attributes in front of the texture coordinates


class Textures(NamedTuple):
    """All textures of a scene, level by level in one array."""

    texel: np.ndarray  # (4 * n_texel,) float32: linear red, green, blue, and alpha of each
    level: np.ndarray  # (n_level, 3) int64: first texel, width, height
    first_level: np.ndarray  # (n_texture + 1,) int64
    filter: np.ndarray  # (n_texture,) int64
    wrap: np.ndarray  # (n_texture, 2) int64, along u and v
    of_material: np.ndarray  # (n_material,) int64, -1 for none


@kernel
def take_texels(canvas, records, y_start, n_row, textures, face_material, rows, out_texels):
    """Look the texture up at every sample of the band; `face_material` is that of each triangle, or empty where there
    is one.

    `rows` are those of lighting, in float64, for what is computed on the way.
    """
    words, left, right = borrow(canvas.entries), borrow(canvas.left), borrow(canvas.right)
    records, face_material, texels = borrow_records(records), borrow(face_material), borrow(out_texels)
    rows = borrow(rows)
    textures = Textures(
        borrow(textures.texel), borrow(textures.level), borrow(textures.first_level), borrow(textures.filter),
        borrow(textures.wrap), borrow(textures.of_material),
    )  # fmt: skip
    one = texels.dtype.type(1)
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(STRIP_SHIFT)
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
                for first in range(k, stop, np.uint64(CHUNK)):
                    end = min(first + np.uint64(CHUNK), stop)
                    x, out = left[group] + np.int64(first), texels[:, start + first : start + end]
                    take_run(records, record, x, y_start + j, textures, np.uint64(number), rows, out)
            else:
                for channel in range(np.uint64(4)):
                    for i in range(start + k, start + stop):
                        texels[channel, i] = one
            k = stop


@helper
def take_run(records, record, x, y, textures, number, rows, out):
    """Look a texture up along a run of samples of one triangle that begins at (x, y)."""
    n = np.uint64(out.shape[1])
    first, last = textures.first_level[number], textures.first_level[number + np.uint64(1)] - 1
    kind, wrap_u, wrap_v = textures.filter[number], textures.wrap[number, 0], textures.wrap[number, 1]
    find_places(records, record, x, y, n, wrap_u, wrap_v, rows)
    if kind == TRILINEAR:
        find_details(records, record, n, place_of_level(textures, first), float(last - first), rows)
    for k in range(n):
        if kind == NEAREST:
            color = nearest(textures, first, rows[PLACE_S + k], rows[PLACE_T + k])
        else:
            level, part = first, 0.0
            if kind == TRILINEAR:
                level, part = first + np.int64(rows[DETAIL + k]), rows[DETAIL + k] - np.floor(rows[DETAIL + k])
            color = bilinear(textures, level, wrap_u, wrap_v, rows[PLACE_S + k], rows[PLACE_T + k])
            if part > 0.0:
                coarse = bilinear(textures, level + 1, wrap_u, wrap_v, rows[PLACE_S + k], rows[PLACE_T + k])
                color = mix(color, coarse, part)
        out[0, k], out[1, k], out[2, k], out[3, k] = color


@helper
def find_places(records, record, x, y, n, wrap_u, wrap_v, rows):
    """Fill the rows of texture coordinates, as they are and within the picture, and of 1 / Σ q."""
    weights = weights_of(records, record)
    us = corners_of(records.reals, record, ATTRIBUTE + 3 * LIGHT_COLUMNS)
    vs = corners_of(records.reals, record, ATTRIBUTE + 3 * LIGHT_COLUMNS + 3)
    for k in range(n):
        q0, q1, q2 = corner_weights(weights, (x + np.int64(k)) * SUBPIXEL + HALF, y * SUBPIXEL + HALF)
        scale = 1.0 / (q0 + q1 + q2)
        u, v = mean(us, q0 * scale, q1 * scale, q2 * scale), mean(vs, q0 * scale, q1 * scale, q2 * scale)
        rows[WEIGHT + k], rows[PLACE_U + k], rows[PLACE_V + k] = scale, u, v
        rows[PLACE_S + k], rows[PLACE_T + k] = into_picture(u, wrap_u), into_picture(1.0 - v, wrap_v)


@helper
def find_details(records, record, n, size, most, rows):
    """Fill the row of the mipmaps' numbers: whole ones are the levels, what lies between is a mixture of two."""
    _, width, height = size
    along_x, along_y = weight_steps(weights_of(records, record))
    us = corners_of(records.reals, record, ATTRIBUTE + 3 * LIGHT_COLUMNS)
    vs = corners_of(records.reals, record, ATTRIBUTE + 3 * LIGHT_COLUMNS + 3)
    d_x, u_x, v_x = steps(along_x, us, vs)
    d_y, u_y, v_y = steps(along_y, us, vs)
    wide, high = float(width), float(height)
    for k in range(n):
        u, v, scale = rows[PLACE_U + k], rows[PLACE_V + k], rows[WEIGHT + k]
        across_u, across_v = (u_x - u * d_x) * scale * wide, (v_x - v * d_x) * scale * high
        down_u, down_v = (u_y - u * d_y) * scale * wide, (v_y - v * d_y) * scale * high
        rows[DETAIL + k] = max(across_u * across_u + across_v * across_v, down_u * down_u + down_v * down_v)
    for k in range(n):
        # Within 0..most for any square, also for one that is no number: a comparison with that is false.
        square = rows[DETAIL + k]
        rows[DETAIL + k] = min(0.5 * np.log2(square), most) if square > 1.0 else 0.0


@helper
def steps(along, us, vs):
    """What the sums Σ q, Σ q·u and Σ q·v grow by where the weights grow by `along`."""
    q0, q1, q2 = along
    return q0 + q1 + q2, q0 * us[0] + q1 * us[1] + q2 * us[2], q0 * vs[0] + q1 * vs[1] + q2 * vs[2]


@helper
def into_picture(x, wrap):
    """The place within 0..1 that stands for any place along an axis, from the left or from the top; 0 for what is no
    number.

    Texels are found by what this returns: whatever x is, infinite or no number, it must lie within 0..1. Then the
    texels floor(s·n), and floor(s·n - ½) and its neighbour, lie within -1..n, and are moved by a texel at most.
    """
    if wrap == CLAMP:
        place = min(max(x, 0.0), 1.0)
    elif wrap == MIRROR:
        x = x - 2.0 * np.floor(0.5 * x)
        place = min(x, 2.0 - x)
    else:
        place = x - np.floor(x)
    return place if (place >= 0.0) & (place <= 1.0) else 0.0


@helper
def nearest(textures, level, s, t):
    """The texel that a point lies in; the picture's right and lower border belong to the last one."""
    start, width, height = place_of_level(textures, level)
    return texel_at(
        textures, start + min(np.int64(t * height), height - 1) * width + min(np.int64(s * width), width - 1)
    )


@helper
def bilinear(textures, level, wrap_u, wrap_v, s, t):
    """Mean of the four texels whose centres are about a point."""
    start, width, height = place_of_level(textures, level)
    x, y = s * width - 0.5, t * height - 0.5
    left, top = np.floor(x), np.floor(y)
    across, down = x - left, y - top
    i0, i1 = neighbours(np.int64(left), width, wrap_u)
    j0, j1 = neighbours(np.int64(top), height, wrap_v)
    above = mix(texel_at(textures, start + j0 * width + i0), texel_at(textures, start + j0 * width + i1), across)
    below = mix(texel_at(textures, start + j1 * width + i0), texel_at(textures, start + j1 * width + i1), across)
    return mix(above, below, down)


@helper
def neighbours(i, n, wrap):
    """The texels i and i + 1, of which one may lie a step outside the picture: mirrored, that is the one at the border
    again."""
    low, high = i, i + 1
    if wrap == REPEAT:
        return n - 1 if low < 0 else low, np.int64(0) if high >= n else high
    return max(low, np.int64(0)), min(high, n - 1)


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
    i = np.uint64(index) << np.uint64(2)
    texel = textures.texel
    return (
        float(texel[i]), float(texel[i + np.uint64(1)]), float(texel[i + np.uint64(2)]), float(texel[i + np.uint64(3)]),
    )  # fmt: skip


@kernel
def shade_textured(canvas, records, y_start, n_row, texels, out_radiance):
    """Flat shading and Gouraud's method with textures: interpolate the light that the texture weakens and the rest
    apart.

    Attributes 0-2 of the records are what a black surface gives off, 3-5 what the whole one gives off.
    """
    words, left, right = borrow(canvas.entries), borrow(canvas.left), borrow(canvas.right)
    records, texels, radiance = borrow_records(records), borrow(texels), borrow(out_radiance)
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(STRIP_SHIFT)
        if left[group] >= right[group]:
            continue
        start = np.uint64(j * canvas.pitch + left[group])
        n = np.uint64(right[group] - left[group])
        row, k = words[start : start + n], np.uint64(0)
        while k < n:
            stop = run_end(row, k)
            if is_exact(row[k]):
                record = np.uint64(row[k] & RECORD_MASK)
                weights = weights_of(records, record)
                for i in range(k, stop):
                    x = left[group] + np.int64(i)
                    q0, q1, q2 = corner_weights(weights, x * SUBPIXEL + HALF, (y_start + j) * SUBPIXEL + HALF)
                    scale = 1.0 / (q0 + q1 + q2)
                    for channel in range(np.uint64(3)):
                        column = np.uint64(ATTRIBUTE) + np.uint64(3) * channel
                        of_rest = corners_of(records.reals, record, column)
                        of_whole = corners_of(records.reals, record, column + np.uint64(9))
                        rest = mean(of_rest, q0 * scale, q1 * scale, q2 * scale)
                        whole = mean(of_whole, q0 * scale, q1 * scale, q2 * scale)
                        radiance[channel, start + i] = rest + (whole - rest) * texels[channel, start + i]
            k = stop
