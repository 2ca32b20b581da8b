"""Stage 6, shade: the intensities of a band's visible samples.

In:  the band's z-buffer and records (scan.py).
Out: `radiance`, linear intensities, a plane a channel; samples where nothing is visible hold anything.

`shade_interpolated` serves flat shading and Gouraud's method: the intensities stand in the words, or are interpolated between
the three corners of a record. `shade_lit` is Phong's method: normals are interpolated, and the illumination equation is
evaluated at every visible sample, a chunk of a row at a time.

Interpolation is perspective-correct: with the exact edge functions e_i of a sample, q_i = e_i / w_i, an attribute is
Σ q_i·a_i / Σ q_i (Blinn 1992, "Hyperbolic interpolation"); one division a sample. Nothing is extrapolated, and e_i are exact integers
below 2^53 for triangles up to 2^18 px, so slivers are as good as any.

Samples are looked at BLOCK at a time: mostly one triangle covers them all, and its record is fetched once.
"""

import numpy as np

from .._kernel import helper, kernel
from .lighting import light_rows, normalize_normals, view_from_direction, view_from_position
from .rows import (
    ALBEDO,
    CHUNK,
    DIFFUSE_SUM,
    NEXT_CHANNEL,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    POSITION_X,
    POSITION_Y,
    POSITION_Z,
)
from .scan import (
    ATTRIBUTE,
    DX1,
    DX2,
    DY1,
    DY2,
    FACE,
    GROUP_SHIFT,
    INV_W,
    IS_ID,
    LEVEL_MASK,
    PAYLOAD_BITS,
    SIDE,
    X0,
    Y0,
)
from .transform import HALF, SUBPIXEL

BLOCK = 8


@helper
def corner_weights(integers, numbers, sx, sy):
    """Perspective weights q_i = e_i / w_i of the three corners at the sample (sx, sy) (1/256 px); not normalised."""
    ux, uy = float(sx - integers[X0]), float(sy - integers[Y0])
    dx1, dy1, dx2, dy2 = float(integers[DX1]), float(integers[DY1]), float(integers[DX2]), float(integers[DY2])
    e1 = ux * dy2 - uy * dx2
    e2 = uy * dx1 - ux * dy1
    e0 = max((dx1 * dy2 - dx2 * dy1) - e1 - e2, 0.0)
    number = numbers.dtype.type
    return number(e0) * numbers[INV_W], number(e1) * numbers[INV_W + 1], number(e2) * numbers[INV_W + 2]


@helper
def interpolate(numbers, attribute, p0, p1, p2):
    """Mean of an attribute's three values, weighted by p_i with Σ p_i = 1; never outside their range, whatever is rounded."""
    column = np.uint64(ATTRIBUTE) + np.uint64(3) * attribute
    a0, a1, a2 = numbers[column], numbers[column + np.uint64(1)], numbers[column + np.uint64(2)]
    value = p0 * a0 + p1 * a1 + p2 * a2
    return min(max(value, min(a0, a1, a2)), max(a0, a1, a2))


@helper
def is_uniform(words):
    """Tell whether a block of words holds one record number throughout."""
    difference = np.int64(0)
    for k in range(np.uint64(1), np.uint64(BLOCK)):
        difference |= words[k] ^ words[np.uint64(0)]
    return (difference & (IS_ID | LEVEL_MASK)) == 0 and (words[np.uint64(0)] & IS_ID) != 0


@helper
def has_records(words):
    """Tell whether any word of a block holds a record number."""
    union = np.int64(0)
    for k in range(np.uint64(BLOCK)):
        union |= words[k]
    return (union & IS_ID) != 0


# ---------------------------------------------------------------- flat shading and Gouraud's method


@kernel
def shade_interpolated(canvas, records, y_start, n_row, n_channel, level_step, out_radiance):
    """Turn words into intensities: levels times `level_step`, or the interpolated attributes of records."""
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(GROUP_SHIFT)
        sy = (y_start + j) * SUBPIXEL + HALF
        for left in range(canvas.left[group], canvas.right[group], BLOCK):
            place = np.uint64(j * canvas.pitch + left)
            words = canvas.words[place : place + np.uint64(BLOCK)]
            out = out_radiance[:, place : place + np.uint64(BLOCK)]
            if not has_records(words):
                for k in range(np.uint64(BLOCK)):
                    out[0, k] = out.dtype.type(words[k] & LEVEL_MASK) * level_step
            elif is_uniform(words):
                record = np.uint64(words[np.uint64(0)] & LEVEL_MASK)
                integers, numbers = records.integers[record], records.numbers[record]
                for k in range(np.uint64(BLOCK)):
                    shade_sample(integers, numbers, left + np.int64(k), sy, n_channel, k, out)
            else:
                for k in range(np.uint64(BLOCK)):
                    if words[k] & IS_ID:
                        record = np.uint64(words[k] & LEVEL_MASK)
                        shade_sample(
                            records.integers[record], records.numbers[record], left + np.int64(k), sy, n_channel, k, out
                        )
                    else:
                        out[0, k] = out.dtype.type(words[k] & LEVEL_MASK) * level_step


@helper
def shade_sample(integers, numbers, i, sy, n_channel, k, out):
    """Interpolate a record's channels at one sample."""
    q0, q1, q2 = corner_weights(integers, numbers, i * SUBPIXEL + HALF, sy)
    scale = numbers.dtype.type(1) / (q0 + q1 + q2)
    p0, p1, p2 = q0 * scale, q1 * scale, q2 * scale
    out[0, k] = interpolate(numbers, np.uint64(0), p0, p1, p2)
    if n_channel == 3:
        out[1, k] = interpolate(numbers, np.uint64(1), p0, p1, p2)
        out[2, k] = interpolate(numbers, np.uint64(2), p0, p1, p2)


# ---------------------------------------------------------------- Phong's method


@kernel
def shade_lit(canvas, records, y_start, n_row, screen, lighting, face_material, rows, out_radiance):
    """Interpolate normals and evaluate the illumination equation at every visible sample.

    Attributes 0-2 of the records are the normals, 3-5 the albedo (only if lighting.has_albedo). `face_material` is the material
    of every triangle, or empty where there is one material.
    """
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(GROUP_SHIFT)
        left, right = canvas.left[group], canvas.right[group]
        while left < right:
            start = np.uint64(j * canvas.pitch + left)
            words = canvas.words[start : start + np.uint64(min(right - left, CHUNK))]
            n, material = run_of_material(words, records, face_material)
            fetch_normals(canvas, records, left, y_start + j, n, start, lighting.has_albedo, rows)
            normalize_normals(rows, n)
            if lighting.needs_view or lighting.needs_position:
                fill_positions(screen, canvas, left, y_start + j, n, start, lighting.needs_position, rows)
            light_rows(rows, n, lighting, material)
            for channel in range(np.uint64(lighting.n_channel)):
                for k in range(np.uint64(n)):
                    out_radiance[channel, start + k] = rows[DIFFUSE_SUM + channel * NEXT_CHANNEL + k]
            left += n


@helper
def run_of_material(words, records, face_material):
    """Length of the run of samples that show one material, and the material; samples that show nothing belong to any run."""
    material = np.int64(-1)
    if len(face_material) == 0:
        return len(words), np.int64(0)
    for k in range(np.uint64(len(words))):
        if words[k] & IS_ID:
            face = np.uint64(records.integers[np.uint64(words[k] & LEVEL_MASK), FACE])
            here = np.int64(face_material[face])
            if material >= 0 and here != material:
                return np.int64(k), material
            material = here
    return len(words), max(material, np.int64(0))


@helper
def fetch_normals(canvas, records, left, j, n, start, has_albedo, rows):
    """Interpolate the normals (and the albedo) of n samples from their records; POSITION_Z receives the distance w."""
    sy = j * SUBPIXEL + HALF
    for first in range(np.uint64(0), np.uint64(n), np.uint64(BLOCK)):
        words = canvas.words[start + first : start + first + np.uint64(BLOCK)]
        i = left + np.int64(first)
        if is_uniform(words):
            record = np.uint64(words[np.uint64(0)] & LEVEL_MASK)
            integers, numbers = records.integers[record], records.numbers[record]
            for k in range(np.uint64(BLOCK)):
                fetch_sample(integers, numbers, i + np.int64(k), sy, has_albedo, first + k, rows)
        else:
            for k in range(np.uint64(BLOCK)):
                # A sample that shows nothing reads record 0: cheaper than a branch.
                record = np.uint64(words[k] & LEVEL_MASK)
                fetch_sample(
                    records.integers[record], records.numbers[record], i + np.int64(k), sy, has_albedo, first + k, rows
                )


@helper
def fetch_sample(integers, numbers, i, sy, has_albedo, k, rows):
    """Interpolate one sample's normal, not normalised, its distance w and its albedo."""
    q0, q1, q2 = corner_weights(integers, numbers, i * SUBPIXEL + HALF, sy)
    side = numbers.dtype.type(integers[SIDE])
    a = ATTRIBUTE
    rows[NORMAL_X + k] = side * (q0 * numbers[a] + q1 * numbers[a + 1] + q2 * numbers[a + 2])
    rows[NORMAL_Y + k] = side * (q0 * numbers[a + 3] + q1 * numbers[a + 4] + q2 * numbers[a + 5])
    rows[NORMAL_Z + k] = side * (q0 * numbers[a + 6] + q1 * numbers[a + 7] + q2 * numbers[a + 8])
    scale = numbers.dtype.type(1) / (q0 + q1 + q2)
    area = float(integers[DX1]) * float(integers[DY2]) - float(integers[DX2]) * float(integers[DY1])
    rows[POSITION_Z + k] = numbers.dtype.type(area) * scale  # w = Σ e_i / Σ (e_i / w_i)
    if has_albedo:
        p0, p1, p2 = q0 * scale, q1 * scale, q2 * scale
        rows[ALBEDO + k] = interpolate(numbers, np.uint64(3), p0, p1, p2)
        rows[ALBEDO + NEXT_CHANNEL + k] = interpolate(numbers, np.uint64(4), p0, p1, p2)
        rows[ALBEDO + NEXT_CHANNEL + NEXT_CHANNEL + k] = interpolate(numbers, np.uint64(5), p0, p1, p2)


@helper
def fill_positions(screen, canvas, left, j, n, start, needs_position, rows):
    """Fill the rows of positions and view directions: where the rays through the samples meet the surface.

    Perspective: P = w·ray, with ray·forward = 1; the direction to the viewer is that of -ray. Orthographic: P is the sample's
    point of the picture plane plus depth·forward; the viewer is at infinity.
    """
    number = rows.dtype.type
    right_x, right_y, right_z = screen.right
    up_x, up_y, up_z = screen.up
    forward_x, forward_y, forward_z = screen.forward
    step = 1.0 / screen.scale_x
    across = (left + 0.5 - screen.center_x) * step
    upward = (screen.center_y - (j + 0.5)) / screen.scale_y
    x_first = number(right_x * across + up_x * upward + (forward_x if screen.is_perspective else 0.0))
    y_first = number(right_y * across + up_y * upward + (forward_y if screen.is_perspective else 0.0))
    z_first = number(right_z * across + up_z * upward + (forward_z if screen.is_perspective else 0.0))
    step_x, step_y, step_z = number(right_x * step), number(right_y * step), number(right_z * step)
    if screen.is_perspective:
        # The rays first, as if they were positions: they give the view directions.
        for k in range(np.uint64(n)):
            w, i = rows[POSITION_Z + k] if needs_position else number(1), number(np.int32(k))
            rows[POSITION_X + k] = w * (x_first + i * step_x)
            rows[POSITION_Y + k] = w * (y_first + i * step_y)
            rows[POSITION_Z + k] = w * (z_first + i * step_z)
        view_from_position(rows, n)
        return
    fx, fy, fz = number(forward_x), number(forward_y), number(forward_z)
    view_from_direction(rows, n, -fx, -fy, -fz)
    if needs_position:
        for k in range(np.uint64(n)):
            z, i = float(canvas.words[start + k] >> PAYLOAD_BITS), number(np.int32(k))
            depth = number((z - screen.z_offset) / screen.z_scale if screen.z_scale > 0 else screen.near)
            rows[POSITION_X + k] = x_first + i * step_x + depth * fx
            rows[POSITION_Y + k] = y_first + i * step_y + depth * fy
            rows[POSITION_Z + k] = z_first + i * step_z + depth * fz
