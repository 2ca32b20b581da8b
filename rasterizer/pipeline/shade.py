"""Stage 6, shade: the intensities of a band's visible samples.

In:  the band's z-buffer and records (scan.py, records.py).
Out: `radiance`, linear intensities, a plane a channel; samples where nothing is visible hold anything.

`shade_interpolated` serves flat shading and Gouraud's method: intensities stand in the words or are interpolated.
`shade_lit` is Phong's method: normals are interpolated, and the illumination equation is evaluated at every visible
sample. Both work on a chunk of a row at a time. Samples of words and planes are taken in one loop without branches,
whatever they show; those of exact records, if the band has any, are then put in run by run.
"""

import numpy as np
from numba.extending import overload

from ..compiler.kernels import borrow, helper, kernel
from .fragments import (
    ALBEDO,
    CHUNK,
    DISTANCE,
    INTENSITY,
    LIFT,
    NEXT_CHANNEL,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    OFFSET,
    PLANE_X,
    PLANE_Y,
    PLANE_Z,
    POSITION_X,
    POSITION_Y,
    POSITION_Z,
    TANGENT_X,
    TANGENT_Y,
    TANGENT_Z,
    VIEW_X,
    VIEW_Y,
    VIEW_Z,
)
from .gradients import IN_ENTRIES, LEVEL_PLANES, NORMAL_PLANES
from .interpolate import corner_weights, corners_of, has_exact, is_exact, mean, run_end, weights_of
from .lighting import BRUSHED, ShadowedLighting, light_rows, normalize_normals, view_from_direction
from .records import ATTRIBUTE, DEPTH, FACE, FIRST_PLANE, PLANES_FACE, SIDE, borrow_records
from .simd import PLANE_GROUP, PlaneGroup, evaluate_planes
from .transform import HALF, SUBPIXEL
from .visibility import IS_ID, LEVEL_MASK, RECORD_MASK, STRIP_SHIFT

FURTHEST_COLUMN = 2.0**23  # integers up to this are exact in float32

# ---------------------------------------------------------------- flat shading and Gouraud's method


@kernel
def shade_interpolated(canvas, records, n_exact, kind, y_start, n_row, n_channel, level_step, out_radiance):
    """Turn words and records, `n_exact` of which are exact, into intensities; levels are multiples of `level_step`."""
    words, left, right = borrow(canvas.entries), borrow(canvas.left), borrow(canvas.right)
    radiance, records = borrow(out_radiance), borrow_records(records)
    flat = radiance.reshape(radiance.size)
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(STRIP_SHIFT)
        for first in range(left[group], right[group], CHUNK):
            start = np.uint64(j * canvas.pitch + first)
            n = np.uint64(min(right[group] - first, CHUNK))
            chunk = words[start : start + n]
            if kind == IN_ENTRIES:
                take_levels(chunk, level_step, radiance[0, start : start + n])
            elif kind == LEVEL_PLANES:
                planes = PlaneGroup(
                    records.int_planes, RECORD_MASK, np.uint64(records.plane_shift), np.uint64(FIRST_PLANE), level_step
                )
                evaluate_planes(chunk, planes, first, y_start + j, flat, start, np.uint64(radiance.shape[1]))
            if n_exact > 0 and has_exact(chunk):
                interpolate_runs(chunk, records, first, y_start + j, n_channel, radiance[:, start : start + n])


@helper
def take_levels(words, level_step, out):
    """Intensities that stand in the words."""
    for k in range(np.uint64(len(words))):
        out[k] = out.dtype.type(np.int32(words[k] & LEVEL_MASK)) * level_step


@helper
def interpolate_runs(words, records, first, y, n_channel, out):
    """Put in the intensities of exact records, one run of samples after the other."""
    sy = y * SUBPIXEL + HALF
    number = out.dtype.type
    last_record = np.uint64(len(records.integers) - 1)
    start = np.uint64(0)
    while start < np.uint64(len(words)):
        stop = start + np.uint64(1)
        if is_exact(words[start]):
            stop = run_end(words, start)
            # Where levels stand in words, a record's number is a matter of arithmetic: whatever it is, nothing else is
            # read.
            record = min(np.uint64(words[start] & RECORD_MASK), last_record)
            weights = weights_of(records, record)
            red = corners_of(records.reals, record, ATTRIBUTE)
            green = corners_of(records.reals, record, ATTRIBUTE + 3) if n_channel > 1 else red
            blue = corners_of(records.reals, record, ATTRIBUTE + 6) if n_channel > 1 else red
            for k in range(start, stop):
                q0, q1, q2 = corner_weights(weights, (first + np.int64(k)) * SUBPIXEL + HALF, sy)
                scale = 1.0 / (q0 + q1 + q2)
                p0, p1, p2 = number(q0 * scale), number(q1 * scale), number(q2 * scale)
                out[0, k] = mean(red, p0, p1, p2)
                if n_channel > 1:
                    out[1, k] = mean(green, p0, p1, p2)
                    out[2, k] = mean(blue, p0, p1, p2)
        start = stop


# ---------------------------------------------------------------- Phong's method


@kernel
def shade_lit(
    canvas,
    records,
    n_exact,
    kind,
    y_start,
    n_row,
    screen,
    lighting,
    face_material,
    face_shape,
    texels,
    rows,
    out_radiance,
):
    """Interpolate normals and evaluate the illumination equation at every visible sample.

    Attributes 0-2 of the records are the normals, 3-5 the albedo (only if lighting.has_albedo), the last three the
    tangents (only with BRUSHED lighting, all of whose records are exact). `face_material` is the material
    of every triangle, or empty where there is one material; `face_shape` is read only where lights cast shadows;
    `texels` is None where there are no textures. `n_exact` records of the band are exact.
    """
    words, left, right, rows = borrow(canvas.entries), borrow(canvas.left), borrow(canvas.right), borrow(rows)
    radiance, face_material = borrow(out_radiance), borrow(face_material)
    face_shape = borrow(face_shape)
    records = borrow_records(records)
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(STRIP_SHIFT)
        y, first = y_start + j, left[group]
        while first < right[group]:
            start = np.uint64(j * canvas.pitch + first)
            chunk = words[start : start + np.uint64(min(right[group] - first, CHUNK))]
            n, material = run_of_material(chunk, records, face_material)
            chunk = chunk[: np.uint64(n)]
            if kind == NORMAL_PLANES:
                take_attributes(chunk, records, 0, first, y, NORMAL_X, rows)
                if lighting.has_albedo:
                    take_attributes(chunk, records, 1, first, y, ALBEDO, rows)
                if lighting.needs_position and screen.is_perspective:
                    invert_distances(rows, n)
            if n_exact > 0 and has_exact(chunk):
                interpolate_normal_runs(chunk, records, first, y, lighting.has_albedo, screen.is_perspective, rows)
                interpolate_tangents(lighting, chunk, records, first, y, rows)
            if texels is not None:
                for channel in range(np.uint64(3)):
                    weigh_albedo(rows, n, channel, borrow(texels)[channel, start : start + np.uint64(n)])
            take_shapes(lighting, chunk, records, face_shape, screen.eye, rows)
            normalize_normals(rows, n)
            if lighting.needs_view or lighting.needs_position:
                fill_positions(screen, first, y, n, lighting.needs_position, rows)
            light_rows(rows, n, lighting, material)
            for channel in range(np.uint64(lighting.n_channel)):
                for k in range(np.uint64(n)):
                    radiance[channel, start + k] = rows[INTENSITY + channel * NEXT_CHANNEL + k]
            first += n


@helper
def weigh_albedo(rows, n, channel, texels):
    """Multiply one channel of the albedo by the texture."""
    row = ALBEDO + channel * NEXT_CHANNEL
    for k in range(np.uint64(n)):
        rows[row + k] *= texels[k]


def take_shapes(lighting, words, records, face_shape, eye, rows):
    """Fill the rows of planes and lifts, which shadows need."""
    raise NotImplementedError("compiled code only")


@overload(take_shapes)
def _overload_take_shapes(lighting, words, records, face_shape, eye, rows):
    if issubclass(lighting.instance_class, ShadowedLighting):
        return take_face_shapes
    return lambda lighting, words, records, face_shape, eye, rows: None


def take_face_shapes(lighting, words, records, face_shape, eye, rows):
    """The planes of the visible polygons, relative to the eye, and how far points are lifted above them."""
    for k in range(np.uint64(len(words))):
        face = face_of(words[k], records) if words[k] & IS_ID else np.uint64(0)
        x, y, z = face_shape[face, 0], face_shape[face, 1], face_shape[face, 2]
        rows[PLANE_X + k], rows[PLANE_Y + k], rows[PLANE_Z + k] = x, y, z
        rows[OFFSET + k] = face_shape[face, 3] - (x * eye[0] + y * eye[1] + z * eye[2])
        rows[LIFT + k] = face_shape[face, 4]


@helper
def run_of_material(words, records, face_material):
    """Length of the run of samples that show one material, and the material; samples that show nothing belong to any
    run."""
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
    return np.uint64(records.int_planes[(record << np.uint64(records.plane_shift)) + np.uint64(PLANES_FACE)])


@helper
def take_attributes(words, records, group, first, y, row, rows):
    """Attributes from a group of planes, into four rows from `row` on; samples that show no planes take anything."""
    column, one = np.uint64(FIRST_PLANE + 3 * PLANE_GROUP * group), rows.dtype.type(1)
    planes = PlaneGroup(records.float_planes, RECORD_MASK, np.uint64(records.plane_shift), column, one)
    evaluate_planes(words, planes, first, y, rows, row, np.uint64(CHUNK))


@helper
def invert_distances(rows, n):
    """Turn 1/w into w."""
    one = rows.dtype.type(1)
    for k in range(np.uint64(n)):
        rows[DISTANCE + k] = one / rows[DISTANCE + k]


@helper
def interpolate_normal_runs(words, records, first, y, has_albedo, is_perspective, rows):
    """Put in the normals, distances and albedo of exact records, one run of samples after the other."""
    sy = y * SUBPIXEL + HALF
    number = rows.dtype.type
    start = np.uint64(0)
    while start < np.uint64(len(words)):
        stop = start + np.uint64(1)
        if is_exact(words[start]):
            stop = run_end(words, start)
            record = np.uint64(words[start] & RECORD_MASK)
            weights = weights_of(records, record)
            side = float(records.integers[record, np.uint64(SIDE)])
            nx = corners_of(records.reals, record, ATTRIBUTE)
            ny = corners_of(records.reals, record, ATTRIBUTE + 3)
            nz = corners_of(records.reals, record, ATTRIBUTE + 6)
            depths = corners_of(records.reals, record, DEPTH)
            red = corners_of(records.reals, record, ATTRIBUTE + 9) if has_albedo else depths
            green = corners_of(records.reals, record, ATTRIBUTE + 12) if has_albedo else depths
            blue = corners_of(records.reals, record, ATTRIBUTE + 15) if has_albedo else depths
            for k in range(start, stop):
                q0, q1, q2 = corner_weights(weights, (first + np.int64(k)) * SUBPIXEL + HALF, sy)
                scale = 1.0 / (q0 + q1 + q2)
                p0, p1, p2 = number(q0 * scale), number(q1 * scale), number(q2 * scale)
                rows[NORMAL_X + k] = number(side) * mean(nx, p0, p1, p2)
                rows[NORMAL_Y + k] = number(side) * mean(ny, p0, p1, p2)
                rows[NORMAL_Z + k] = number(side) * mean(nz, p0, p1, p2)
                # w = Σ e_i / Σ (e_i / w_i); without perspective depth itself is interpolated.
                rows[DISTANCE + k] = number(weights.area * scale) if is_perspective else mean(depths, p0, p1, p2)
                if has_albedo:
                    rows[ALBEDO + k] = mean(red, p0, p1, p2)
                    rows[ALBEDO + NEXT_CHANNEL + k] = mean(green, p0, p1, p2)
                    rows[ALBEDO + NEXT_CHANNEL + NEXT_CHANNEL + k] = mean(blue, p0, p1, p2)
        start = stop


def interpolate_tangents(lighting, words, records, first, y, rows):
    """Fill the rows of tangents, which materials brushed along u need."""
    raise NotImplementedError("compiled code only")


@overload(interpolate_tangents)
def _overload_interpolate_tangents(lighting, words, records, first, y, rows):
    if lighting.instance_class in BRUSHED:
        return interpolate_tangent_runs
    return lambda lighting, words, records, first, y, rows: None


def interpolate_tangent_runs(lighting, words, records, first, y, rows):
    """Interpolate the tangents of exact records, one run of samples after the other; their sign doesn't matter."""
    sy = y * SUBPIXEL + HALF
    number = rows.dtype.type
    column = records.reals.shape[1] - 9
    start = np.uint64(0)
    while start < np.uint64(len(words)):
        stop = start + np.uint64(1)
        if is_exact(words[start]):
            stop = run_end(words, start)
            record = np.uint64(words[start] & RECORD_MASK)
            weights = weights_of(records, record)
            tx = corners_of(records.reals, record, column)
            ty = corners_of(records.reals, record, column + 3)
            tz = corners_of(records.reals, record, column + 6)
            for k in range(start, stop):
                q0, q1, q2 = corner_weights(weights, (first + np.int64(k)) * SUBPIXEL + HALF, sy)
                scale = 1.0 / (q0 + q1 + q2)
                p0, p1, p2 = number(q0 * scale), number(q1 * scale), number(q2 * scale)
                rows[TANGENT_X + k] = mean(tx, p0, p1, p2)
                rows[TANGENT_Y + k] = mean(ty, p0, p1, p2)
                rows[TANGENT_Z + k] = mean(tz, p0, p1, p2)
        start = stop


@helper
def fill_positions(screen, first, y, n, needs_position, rows):
    """Fill the rows of positions and view directions: where the rays through the samples meet the surface.

    Perspective: P = w·ray, with ray·forward = 1; the direction to the viewer is that of -ray. Orthographic: P is the
    sample's point of the picture plane plus depth·forward; the viewer is at infinity. DISTANCE holds w or depth. A ray
    is a function of column and row alone, wherever the chunk begins.

    Columns are counted from the one next to the picture's centre. So a ray is the sum of parts that are not longer than
    it is itself, whatever the field of view: with 4 roundings each, of a part, its product and two sums, and |x| + |y|
    + |z| <= √3 times the length, a ray errs by 7 u of its length, u = 2^-24 or 2^-53.
    """
    number = rows.dtype.type
    right_x, right_y, right_z = screen.right
    up_x, up_y, up_z = screen.up
    forward_x, forward_y, forward_z = screen.forward
    along = 1.0 if screen.is_perspective else 0.0
    step = 1.0 / screen.scale_x
    # Of a centre far beside the picture all columns are far: then none has digits to lose.
    middle = np.int64(min(max(screen.center_x, -FURTHEST_COLUMN), FURTHEST_COLUMN))
    across, upward = (float(middle) + 0.5 - screen.center_x) * step, (screen.center_y - (y + 0.5)) / screen.scale_y
    x_zero = number(right_x * across + up_x * upward + forward_x * along)
    y_zero = number(right_y * across + up_y * upward + forward_y * along)
    z_zero = number(right_z * across + up_z * upward + forward_z * along)
    step_x, step_y, step_z = number(right_x * step), number(right_y * step), number(right_z * step)
    if screen.is_perspective:
        one = number(1)
        for k in range(np.uint64(n)):
            i = number(np.int32(first + np.int64(k) - middle))
            x, y, z = x_zero + i * step_x, y_zero + i * step_y, z_zero + i * step_z
            scale = -one / np.sqrt(x * x + y * y + z * z)
            rows[VIEW_X + k], rows[VIEW_Y + k], rows[VIEW_Z + k] = x * scale, y * scale, z * scale
            if needs_position:
                w = rows[DISTANCE + k]
                rows[POSITION_X + k], rows[POSITION_Y + k], rows[POSITION_Z + k] = w * x, w * y, w * z
        return
    fx, fy, fz = number(forward_x), number(forward_y), number(forward_z)
    view_from_direction(rows, n, -fx, -fy, -fz)
    if needs_position:
        for k in range(np.uint64(n)):
            depth, i = rows[DISTANCE + k], number(np.int32(first + np.int64(k) - middle))
            rows[POSITION_X + k] = x_zero + i * step_x + depth * fx
            rows[POSITION_Y + k] = y_zero + i * step_y + depth * fy
            rows[POSITION_Z + k] = z_zero + i * step_z + depth * fz
