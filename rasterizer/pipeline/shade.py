"""Stage 6, shade: the intensities of a band's visible samples.

In:  the band's z-buffer and records (scan.py, records.py).
Out: `radiance`, linear intensities, a plane a channel; samples where nothing is visible hold anything.

`shade_interpolated` serves flat shading and Gouraud's method: intensities stand in the words or are interpolated. `shade_lit` is
Phong's method: normals are interpolated, and the illumination equation is evaluated at every visible sample. Both work on a
chunk of a row at a time. Samples of words and planes are taken in one loop without branches, whatever they show; the few of exact
records are then put in run by run.
"""

import numpy as np

from .._kernel import borrow, helper, kernel
from .exact import corner_weights, corners_of, has_exact, is_exact, mean, place_of, run_end
from .lighting import light_rows, normalize_normals, view_from_direction, view_from_position
from .records import (
    ANCHOR_SHIFT,
    ATTRIBUTE,
    DEPTH,
    FACE,
    IN_PLANES,
    IN_WORDS,
    INV_W,
    IS_ID,
    LEVEL_MASK,
    NORMAL_PLANES,
    PLANE,
    PLANE_FACE,
    RECORD_MASK,
    SIDE,
    borrow_records,
)
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
from .scan import GROUP_SHIFT
from .transform import HALF, SUBPIXEL

# ---------------------------------------------------------------- flat shading and Gouraud's method


@kernel
def shade_interpolated(canvas, records, kind, y_start, n_row, n_channel, level_step, rows, out_radiance):
    """Turn words and records into intensities; levels are multiples of `level_step`. Uses the rows DIFFUSE_SUM."""
    words, left, right, rows = borrow(canvas.words), borrow(canvas.left), borrow(canvas.right), borrow(rows)
    radiance = borrow(out_radiance)
    records = borrow_records(records)
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(GROUP_SHIFT)
        for first in range(left[group], right[group], CHUNK):
            start = np.uint64(j * canvas.pitch + first)
            n = np.uint64(min(right[group] - first, CHUNK))
            chunk = words[start : start + n]
            if kind == IN_WORDS:
                take_levels(chunk, level_step, rows)
            elif kind == IN_PLANES:
                take_level_planes(chunk, records, first, y_start + j, level_step, rows)
            if has_exact(chunk):
                interpolate_runs(chunk, records, first, y_start + j, n_channel, rows)
            for channel in range(np.uint64(n_channel)):
                for k in range(n):
                    radiance[channel, start + k] = rows[DIFFUSE_SUM + channel * NEXT_CHANNEL + k]


@helper
def take_levels(words, level_step, rows):
    """Intensities that stand in the words."""
    for k in range(np.uint64(len(words))):
        rows[DIFFUSE_SUM + k] = rows.dtype.type(np.int32(words[k] & LEVEL_MASK)) * level_step


@helper
def take_level_planes(words, records, first, y, level_step, rows):
    """Three channels from integer planes; a sample that shows nothing, or an exact record, takes any."""
    levels, shift = records.levels, np.uint64(records.plane_shift)
    n = np.uint64(len(words)) if not is_uniform(words) else np.uint64(0)
    for k in range(n):
        record = np.uint64(words[k] & RECORD_MASK) << shift
        x, dy = from_anchor(levels[record], first, k, y)
        red, green, blue = record + np.uint64(PLANE), record + np.uint64(PLANE + 3), record + np.uint64(PLANE + 6)
        rows[DIFFUSE_SUM + k] = rows.dtype.type(level_at(levels, red, x, dy)) * level_step
        rows[DIFFUSE_SUM + NEXT_CHANNEL + k] = rows.dtype.type(level_at(levels, green, x, dy)) * level_step
        rows[DIFFUSE_SUM + NEXT_CHANNEL + NEXT_CHANNEL + k] = rows.dtype.type(level_at(levels, blue, x, dy)) * level_step
    if n == np.uint64(0):
        # One triangle covers the whole chunk: fetch its planes once, and the loops become vector instructions.
        record = np.uint64(words[0] & RECORD_MASK) << shift
        x, dy = from_anchor(levels[record], first, 0, y)
        for channel in range(np.uint64(3)):
            column = record + np.uint64(PLANE) + np.uint64(3) * channel
            level, step = level_at(levels, column, x, dy), levels[column + np.uint64(1)]
            for k in range(np.uint64(len(words))):
                rows[DIFFUSE_SUM + channel * NEXT_CHANNEL + k] = rows.dtype.type(level) * level_step
                level = np.int32(level + step)


@helper
def is_uniform(words):
    """Tell whether all samples show the same record."""
    difference = np.int64(0)
    for k in range(np.uint64(len(words))):
        difference |= words[k] ^ words[0]
    return difference & LEVEL_MASK == 0


@helper
def level_at(levels, column, x, dy):
    """Value of an integer plane; modulo 2^32 on the way, see records.write_planes."""
    return np.int32(levels[column] + x * levels[column + np.uint64(1)] + dy * levels[column + np.uint64(2)])


@helper
def from_anchor(anchor, first, k, y):
    """Samples from a record's anchor to sample k of a chunk, across and down, int32."""
    return np.int32(first + np.int64(k) - (anchor & 0xFFFF)), np.int32(y - (anchor >> ANCHOR_SHIFT))


@helper
def interpolate_runs(words, records, first, y, n_channel, rows):
    """Put in the intensities of exact records, one run of samples after the other."""
    sy = y * SUBPIXEL + HALF
    number = rows.dtype.type
    start = np.uint64(0)
    while start < np.uint64(len(words)):
        stop = run_end(words, start)
        if is_exact(words[start]):
            record = np.uint64(words[start] & RECORD_MASK)
            place, inv_w = place_of(records.integers, record), corners_of(records.numbers, record, INV_W)
            red = corners_of(records.numbers, record, ATTRIBUTE)
            green = corners_of(records.numbers, record, ATTRIBUTE + 3) if n_channel > 1 else red
            blue = corners_of(records.numbers, record, ATTRIBUTE + 6) if n_channel > 1 else red
            for k in range(start, stop):
                q0, q1, q2 = corner_weights(place, inv_w, (first + np.int64(k)) * SUBPIXEL + HALF, sy)
                scale = 1.0 / (q0 + q1 + q2)
                p0, p1, p2 = number(q0 * scale), number(q1 * scale), number(q2 * scale)
                rows[DIFFUSE_SUM + k] = mean(red, p0, p1, p2)
                if n_channel > 1:
                    rows[DIFFUSE_SUM + NEXT_CHANNEL + k] = mean(green, p0, p1, p2)
                    rows[DIFFUSE_SUM + NEXT_CHANNEL + NEXT_CHANNEL + k] = mean(blue, p0, p1, p2)
        start = stop


# ---------------------------------------------------------------- Phong's method


@kernel
def shade_lit(canvas, records, kind, y_start, n_row, screen, lighting, face_material, rows, out_radiance):
    """Interpolate normals and evaluate the illumination equation at every visible sample.

    Attributes 0-2 of the records are the normals, 3-5 the albedo (only if lighting.has_albedo). `face_material` is the material
    of every triangle, or empty where there is one material.
    """
    words, left, right, rows = borrow(canvas.words), borrow(canvas.left), borrow(canvas.right), borrow(rows)
    radiance, face_material = borrow(out_radiance), borrow(face_material)
    records = borrow_records(records)
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(GROUP_SHIFT)
        y, first = y_start + j, left[group]
        while first < right[group]:
            start = np.uint64(j * canvas.pitch + first)
            chunk = words[start : start + np.uint64(min(right[group] - first, CHUNK))]
            n, material = run_of_material(chunk, records, face_material)
            chunk = chunk[: np.uint64(n)]
            if kind == NORMAL_PLANES:
                take_normal_planes(chunk, records, first, y, lighting.has_albedo, lighting.needs_position, rows)
                if lighting.needs_position and screen.is_perspective:
                    invert_distances(rows, n)
            if has_exact(chunk):
                interpolate_normal_runs(chunk, records, first, y, lighting.has_albedo, screen.is_perspective, rows)
            normalize_normals(rows, n)
            if lighting.needs_view or lighting.needs_position:
                fill_positions(screen, first, y, n, lighting.needs_position, rows)
            light_rows(rows, n, lighting, material)
            for channel in range(np.uint64(lighting.n_channel)):
                for k in range(np.uint64(n)):
                    radiance[channel, start + k] = rows[DIFFUSE_SUM + channel * NEXT_CHANNEL + k]
            first += n


@helper
def run_of_material(words, records, face_material):
    """Length of the run of samples that show one material, and the material; samples that show nothing belong to any run."""
    material = np.int64(-1)
    if len(face_material) == 0:
        return len(words), np.int64(0)
    for k in range(np.uint64(len(words))):
        if words[k] & IS_ID:
            here = np.int64(face_material[face_of(words[k], records)])
            if material >= 0 and here != material:
                return np.int64(k), material
            material = here
    return len(words), max(material, np.int64(0))


@helper
def face_of(word, records):
    """The triangle that a word's record belongs to."""
    record = np.uint64(word & RECORD_MASK)
    if is_exact(word):
        return np.uint64(records.integers[record, np.uint64(FACE)])
    return np.uint64(records.levels[(record << np.uint64(records.plane_shift)) + np.uint64(PLANE_FACE)])


@helper
def take_normal_planes(words, records, first, y, has_albedo, needs_distance, rows):
    """Normals (and albedo, and 1/w or depth, into POSITION_Z) from float planes; other samples take any."""
    take_three_planes(words, records, PLANE, first, y, NORMAL_X, rows)
    if has_albedo:
        take_three_planes(words, records, PLANE + 9, first, y, ALBEDO, rows)
    if needs_distance:
        take_distances(words, records, PLANE + (18 if has_albedo else 9), first, y, rows)


@helper
def take_three_planes(words, records, column, first, y, row, rows):
    """Three attributes of a chunk of samples from their planes, into three rows."""
    levels, planes, shift = records.levels, records.planes, np.uint64(records.plane_shift)
    column = np.uint64(column)
    n = np.uint64(len(words)) if not is_uniform(words) else np.uint64(0)
    for k in range(n):
        record = np.uint64(words[k] & RECORD_MASK) << shift
        across, down = from_anchor(levels[record], first, k, y)
        x, dy = np.float32(across), np.float32(down)
        c = record + column
        rows[row + k] = planes[c] + x * planes[c + np.uint64(1)] + dy * planes[c + np.uint64(2)]
        rows[row + NEXT_CHANNEL + k] = planes[c + np.uint64(3)] + x * planes[c + np.uint64(4)] + dy * planes[c + np.uint64(5)]
        rows[row + NEXT_CHANNEL + NEXT_CHANNEL + k] = (
            planes[c + np.uint64(6)] + x * planes[c + np.uint64(7)] + dy * planes[c + np.uint64(8)]
        )
    if n == np.uint64(0):
        # One triangle covers the whole chunk: fetch its planes once. The same operations in the same order give the same bits.
        record = np.uint64(words[0] & RECORD_MASK) << shift
        across, down = from_anchor(levels[record], first, 0, y)
        for plane in range(np.uint64(3)):
            c = record + column + np.uint64(3) * plane
            value, step, below = planes[c], planes[c + np.uint64(1)], np.float32(down) * planes[c + np.uint64(2)]
            for k in range(np.uint64(len(words))):
                rows[row + plane * NEXT_CHANNEL + k] = value + np.float32(np.int32(across + np.int32(k))) * step + below


@helper
def take_distances(words, records, column, first, y, rows):
    """1/w, or depth without perspective, of a chunk of samples from its plane, into POSITION_Z."""
    levels, planes, shift = records.levels, records.planes, np.uint64(records.plane_shift)
    for k in range(np.uint64(len(words))):
        record = np.uint64(words[k] & RECORD_MASK) << shift
        across, down = from_anchor(levels[record], first, k, y)
        c = record + np.uint64(column)
        rows[POSITION_Z + k] = (
            planes[c] + np.float32(across) * planes[c + np.uint64(1)] + np.float32(down) * planes[c + np.uint64(2)]
        )


@helper
def invert_distances(rows, n):
    """Turn 1/w into w."""
    one = rows.dtype.type(1)
    for k in range(np.uint64(n)):
        rows[POSITION_Z + k] = one / rows[POSITION_Z + k]


@helper
def interpolate_normal_runs(words, records, first, y, has_albedo, is_perspective, rows):
    """Put in the normals, distances and albedo of exact records, one run of samples after the other."""
    sy = y * SUBPIXEL + HALF
    number = rows.dtype.type
    start = np.uint64(0)
    while start < np.uint64(len(words)):
        stop = run_end(words, start)
        if is_exact(words[start]):
            record = np.uint64(words[start] & RECORD_MASK)
            place, inv_w = place_of(records.integers, record), corners_of(records.numbers, record, INV_W)
            side = float(records.integers[record, np.uint64(SIDE)])
            nx = corners_of(records.numbers, record, ATTRIBUTE)
            ny = corners_of(records.numbers, record, ATTRIBUTE + 3)
            nz = corners_of(records.numbers, record, ATTRIBUTE + 6)
            area = float(place[2] * place[5] - place[4] * place[3])
            depths = corners_of(records.numbers, record, DEPTH)
            red = corners_of(records.numbers, record, ATTRIBUTE + 9) if has_albedo else depths
            green = corners_of(records.numbers, record, ATTRIBUTE + 12) if has_albedo else depths
            blue = corners_of(records.numbers, record, ATTRIBUTE + 15) if has_albedo else depths
            for k in range(start, stop):
                q0, q1, q2 = corner_weights(place, inv_w, (first + np.int64(k)) * SUBPIXEL + HALF, sy)
                scale = 1.0 / (q0 + q1 + q2)
                p0, p1, p2 = number(q0 * scale), number(q1 * scale), number(q2 * scale)
                rows[NORMAL_X + k] = number(side) * mean(nx, p0, p1, p2)
                rows[NORMAL_Y + k] = number(side) * mean(ny, p0, p1, p2)
                rows[NORMAL_Z + k] = number(side) * mean(nz, p0, p1, p2)
                # w = Σ e_i / Σ (e_i / w_i); without perspective depth itself is interpolated.
                rows[POSITION_Z + k] = number(area * scale) if is_perspective else mean(depths, p0, p1, p2)
                if has_albedo:
                    rows[ALBEDO + k] = mean(red, p0, p1, p2)
                    rows[ALBEDO + NEXT_CHANNEL + k] = mean(green, p0, p1, p2)
                    rows[ALBEDO + NEXT_CHANNEL + NEXT_CHANNEL + k] = mean(blue, p0, p1, p2)
        start = stop


@helper
def fill_positions(screen, first, y, n, needs_position, rows):
    """Fill the rows of positions and view directions: where the rays through the samples meet the surface.

    Perspective: P = w·ray, with ray·forward = 1; the direction to the viewer is that of -ray. Orthographic: P is the sample's
    point of the picture plane plus depth·forward; the viewer is at infinity. POSITION_Z holds w or depth. A ray is a function of
    column and row alone, wherever the chunk begins.
    """
    number = rows.dtype.type
    right_x, right_y, right_z = screen.right
    up_x, up_y, up_z = screen.up
    forward_x, forward_y, forward_z = screen.forward
    along = 1.0 if screen.is_perspective else 0.0
    step = 1.0 / screen.scale_x
    across, upward = (0.5 - screen.center_x) * step, (screen.center_y - (y + 0.5)) / screen.scale_y
    x_zero = number(right_x * across + up_x * upward + forward_x * along)
    y_zero = number(right_y * across + up_y * upward + forward_y * along)
    z_zero = number(right_z * across + up_z * upward + forward_z * along)
    step_x, step_y, step_z = number(right_x * step), number(right_y * step), number(right_z * step)
    if screen.is_perspective:
        # The rays first, as if they were positions: they give the view directions.
        for k in range(np.uint64(n)):
            w, i = rows[POSITION_Z + k] if needs_position else number(1), number(np.int32(first + np.int64(k)))
            rows[POSITION_X + k] = w * (x_zero + i * step_x)
            rows[POSITION_Y + k] = w * (y_zero + i * step_y)
            rows[POSITION_Z + k] = w * (z_zero + i * step_z)
        view_from_position(rows, n)
        return
    fx, fy, fz = number(forward_x), number(forward_y), number(forward_z)
    view_from_direction(rows, n, -fx, -fy, -fz)
    if needs_position:
        for k in range(np.uint64(n)):
            depth, i = rows[POSITION_Z + k], number(np.int32(first + np.int64(k)))
            rows[POSITION_X + k] = x_zero + i * step_x + depth * fx
            rows[POSITION_Y + k] = y_zero + i * step_y + depth * fy
            rows[POSITION_Z + k] = z_zero + i * step_z + depth * fz
