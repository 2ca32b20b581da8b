"""Textures: what a picture laid over the surface shows at every visible sample of a band. Between scan and shade, where
a scene has any.

In:  the band's visibility entries and its exact records (records.py), two attributes of which are texture coordinates.
Out: `texels`, red, green, blue and alpha of the texture, a plane each; anything where the visible surface has none, and
     where texturing.py looks exact texture coordinates up in float32.

    u, v   texture coordinates, any number; v points up      s, t   the same within the picture, 0..1; t points down

Texture coordinates are interpolated in perspective (interpolate.py). The mip level is chosen by the larger of the
lengths, in texels, that one step of the sample to the right and one down move on the texture (Williams 1983, "Pyramidal
parametrics"; Heckbert 1983): with u = U/D, both linear on the screen, du/dx = (U_x - u·D_x)/D.
"""

import numpy as np

from ..compiler.kernels import helper, index, kernel
from ..geometry.vectors import scale
from .fragments import BATCH_SIZE, get_vector, set_vector
from .interpolate import (
    corner_values,
    exact_triangle,
    has_exact,
    inverse_sum,
    mean,
    next_exact_run,
    row_extent,
    sample_weights,
    weight_steps,
)
from .records import ATTRIBUTE, material_of
from .samples import skip_to
from .textures import FILTER_NEAREST, FILTER_TRILINEAR, WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT
from .visibility import record_of, stretch_of, strip_of

# Quantities of a batch, in place of those of lighting (fragments.py): texture coordinates, the same within the picture,
# 1 / Σ q, the mip level, whole or between two, and the weights of the three corners, whose sum is 1.
TEXCOORD_U, TEXCOORD_V, TEXCOORD_S, TEXCOORD_T, INVERSE_SUM, MIP_LEVEL = (index(BATCH_SIZE * k) for k in range(6))
BARYCENTRIC = index(BATCH_SIZE * 6)


@kernel
def sample_textures(band, textures, batch, out_texels):
    """Look textures up at every sample of a band.

    Parameters
    ----------
    band : ScannedBand, whose coding is not read; the records of textured surfaces are exact
    textures : Textures
    batch : see fragments.py, float64, for what is computed on the way
    out_texels : (4, n_row * pitch) float64; only the samples of textured surfaces are written
    """
    visibility, records = band.visibility, band.records
    for j in range(band.n_row):
        first, right = row_extent(visibility, j)
        while first < right:
            end, material = stretch_of(visibility, strip_of(j), first, right, band.counts.material)
            start = index(j * visibility.pitch + first)
            if material < 0 or textures.of_materials[material] >= 0:
                out = out_texels[:, start : start + index(end - first)]
                entries = visibility.entries[start : start + index(end - first)]
                if has_exact(entries):
                    where = first, band.y_start + j
                    sample_stretch(entries, records, where, textures, batch, out)
            first = end


@helper
def sample_stretch(entries, records, first, textures, batch, out):
    """Look textures up at the samples of a row; `first` says where they lie (samples.py)."""
    start, end = next_exact_run(entries, index(0))
    while start < end:
        record = record_of(entries[start])
        texture = textures.of_materials[material_of(entries[start], records)]
        if texture >= 0:
            for k in range(start, end, index(BATCH_SIZE)):
                last = min(k + index(BATCH_SIZE), end)
                sample_run(records, record, skip_to(first, k), textures, index(texture), batch, out[:, k:last])
        start, end = next_exact_run(entries, end)


@helper
def sample_run(records, record, first, textures, texture, batch, out):
    """Look a texture up along a run of samples of one triangle; `first` says where they
    lie (samples.py).

    out : (4, n), n <= BATCH_SIZE
    """
    n = index(out.shape[1])
    first_level, last_level = textures.first_levels[texture], textures.first_levels[texture + index(1)] - 1
    filtering, wraps = textures.filters[texture], (textures.wraps[texture, 0], textures.wraps[texture, 1])
    fill_barycentric(records, record, first, n, batch)
    corners = corner_texcoords(records, record, textures.texcoord)
    fill_texcoords(corners, n, wraps, batch)
    if filtering == FILTER_TRILINEAR:
        size, coarsest = mip_level_size(textures, first_level), float(last_level - first_level)
        fill_squares(exact_triangle(records, record), corners, n, (size[1], size[2]), batch)
        fill_mip_levels(n, coarsest, batch)
    for k in range(n):
        s, t = batch[TEXCOORD_S + k], batch[TEXCOORD_T + k]
        if filtering == FILTER_NEAREST:
            color = sample_nearest(textures, first_level, s, t)
        else:
            level, fraction = first_level, 0.0
            if filtering == FILTER_TRILINEAR:
                mip_level = batch[MIP_LEVEL + k]
                level, fraction = first_level + np.int64(mip_level), mip_level - np.floor(mip_level)
            color = sample_bilinear(textures, level, wraps, s, t)
            if fraction > 0.0:
                color = mix(color, sample_bilinear(textures, level + 1, wraps, s, t), fraction)
        out[0, k], out[1, k], out[2, k], out[3, k] = color


@helper
def fill_texcoords(corners, n, wraps, batch):
    """Fill texture coordinates, as they are and within the picture, after `fill_barycentric`; `corners` is what
    `corner_texcoords` returns."""
    us, vs = corners
    for k in range(n):
        p = get_vector(batch, BARYCENTRIC, k)
        u, v = mean(us, p), mean(vs, p)
        batch[TEXCOORD_U + k], batch[TEXCOORD_V + k] = u, v
        batch[TEXCOORD_S + k] = wrap_texcoord(u, wraps[0])
        batch[TEXCOORD_T + k] = wrap_texcoord(1.0 - v, wraps[1])


@helper
def fill_barycentric(records, record, first, n, batch):
    """Fill the weights of an exact record's corners, in perspective and with the sum 1, and 1 / Σ q.

    Apart from what is weighted: so each loop becomes vector instructions.
    """
    triangle = exact_triangle(records, record)
    for k in range(n):
        q = sample_weights(triangle, first, k)
        inverse = inverse_sum(q)
        batch[INVERSE_SUM + k] = inverse
        set_vector(batch, BARYCENTRIC, k, scale(q, inverse))


@helper
def fill_mip_levels(n, coarsest, batch):
    """Fill the mip levels, after `fill_squares`: 0 is the texture itself, what lies between whole numbers is a mixture
    of two levels; `coarsest` is the last one."""
    for k in range(n):
        # Within 0..coarsest for any square, also for one that is no number: a comparison with that is false.
        square = batch[MIP_LEVEL + k]
        batch[MIP_LEVEL + k] = min(0.5 * np.log2(square), coarsest) if square > 1.0 else 0.0


@helper
def fill_squares(triangle, corners, n, size, batch):
    """Fill in the place of mip levels the square of how many texels the longer side of a sample covers, after
    `fill_texcoords`.

    `triangle` is what `exact_triangle` returns, `corners` what `corner_texcoords` does, `size` is the width and the
    height of level 0, `step` how many samples it is to the next point that is looked up.
    """
    steps_x, steps_y = weight_steps(triangle)
    us, vs = corners
    d_x, u_x, v_x = step_sums(steps_x, us, vs)
    d_y, u_y, v_y = step_sums(steps_y, us, vs)
    width, height = float(size[0]), float(size[1])
    for k in range(n):
        u, v, inverse = batch[TEXCOORD_U + k], batch[TEXCOORD_V + k], batch[INVERSE_SUM + k]
        across_u, across_v = (u_x - u * d_x) * inverse * width, (v_x - v * d_x) * inverse * height
        down_u, down_v = (u_y - u * d_y) * inverse * width, (v_y - v * d_y) * inverse * height
        batch[MIP_LEVEL + k] = max(across_u * across_u + across_v * across_v, down_u * down_u + down_v * down_v)


@helper
def corner_texcoords(records, record, attribute):
    """Return u and v of an exact record, each at the three corners; `attribute` is that which is u."""
    column = index(ATTRIBUTE) + index(3) * index(attribute)
    return corner_values(records.reals, record, column), corner_values(records.reals, record, column + index(3))


@helper
def step_sums(steps, us, vs):
    """Return what Σ q, Σ q·u and Σ q·v grow by where the weights grow by `steps`."""
    q0, q1, q2 = steps
    return q0 + q1 + q2, q0 * us[0] + q1 * us[1] + q2 * us[2], q0 * vs[0] + q1 * vs[1] + q2 * vs[2]


@helper
def wrap_texcoord(x, wrap):
    """Return the texture coordinate within 0..1 that stands for any along an axis, from the left or from the top.

    Texels are found by what this returns: whatever x is, infinite or no number, it must lie within 0..1; what is no
    number is 0. Then the texels floor(s·n), and floor(s·n - ½) and its neighbour, lie within -1..n, and are moved by a
    texel at most.
    """
    if wrap == WRAP_CLAMP:
        wrapped = min(max(x, 0.0), 1.0)
    elif wrap == WRAP_MIRROR:
        x = x - 2.0 * np.floor(0.5 * x)
        wrapped = min(x, 2.0 - x)
    else:
        wrapped = x - np.floor(x)
    return wrapped if (wrapped >= 0.0) & (wrapped <= 1.0) else 0.0


@helper
def sample_nearest(textures, level, s, t):
    """Return the texel that a point lies in; the picture's right and lower border belong to the last one."""
    start, width, height = mip_level_size(textures, level)
    i, j = min(np.int64(s * width), width - 1), min(np.int64(t * height), height - 1)
    return texel_at(textures, start + j * width + i)


@helper
def sample_bilinear(textures, level, wraps, s, t):
    """Return the mean of the four texels whose centres are about a point."""
    start, width, height = mip_level_size(textures, level)
    x, y = s * width - 0.5, t * height - 0.5
    left, top = np.floor(x), np.floor(y)
    across, down = x - left, y - top
    i0, i1 = neighbours(np.int64(left), width, wraps[0])
    j0, j1 = neighbours(np.int64(top), height, wraps[1])
    above = mix(texel_at(textures, start + j0 * width + i0), texel_at(textures, start + j0 * width + i1), across)
    below = mix(texel_at(textures, start + j1 * width + i0), texel_at(textures, start + j1 * width + i1), across)
    return mix(above, below, down)


@helper
def neighbours(i, n, wrap):
    """Return the texels i and i + 1, of which one may lie a step outside the picture.

    Mirrored, that is the one at the border again.
    """
    low, high = i, i + 1
    if wrap == WRAP_REPEAT:
        return n - 1 if low < 0 else low, np.int64(0) if high >= n else high
    return max(low, np.int64(0)), min(high, n - 1)


@helper
def mix(a, b, fraction):
    """Return the colour, four channels, that lies the fraction 0..1 of the way from a to b."""
    return (
        a[0] + fraction * (b[0] - a[0]),
        a[1] + fraction * (b[1] - a[1]),
        a[2] + fraction * (b[2] - a[2]),
        a[3] + fraction * (b[3] - a[3]),
    )


@helper
def mip_level_size(textures, level):
    """Return first texel, width and height of a mip level."""
    row = index(level)
    return textures.mip_levels[row, 0], textures.mip_levels[row, 1], textures.mip_levels[row, 2]


@helper
def texel_at(textures, texel):
    """Return a texel's red, green, blue and alpha, float64."""
    i, encoded, end = index(texel) << index(2), textures.encoded, index(len(textures.encoded))
    if i < end:
        of_color, alpha = textures.decoded[0], textures.decoded[1, encoded[i + index(3)]]
        red, green, blue = of_color[encoded[i]], of_color[encoded[i + index(1)]], of_color[encoded[i + index(2)]]
        return float(red), float(green), float(blue), float(alpha)
    i, texels = i - end, textures.texels
    return float(texels[i]), float(texels[i + index(1)]), float(texels[i + index(2)]), float(texels[i + index(3)])
