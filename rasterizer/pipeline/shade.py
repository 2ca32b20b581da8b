"""Stage 6, shade: the intensities of a band's visible samples.

In:  the band's visibility entries and records (scan.py, records.py).
Out: `radiance`, linear intensities, a plane a channel; samples where nothing is visible hold anything.

`shade_interpolated` serves flat shading and Gouraud's method: intensities stand in the entries or are interpolated.
`shade_lit` is Phong's method: normals are interpolated, and the illumination equation is evaluated at every visible
sample. Both work on a batch of a row's samples at a time. What entries and planes hold is evaluated in one loop without
branches, whatever the samples show; exact records, if the band has any, are then put in run by run.

Letters: q_i perspective weights of a triangle's corners, p_i the same with Σ p_i = 1 (interpolate.py); w distance along
the viewing axis, scene units.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from ..geometry.vectors import add, dot, scale
from . import fragments as f
from .fragments import BATCH_SIZE, read_vector, set_vector
from .gradients import IN_ENTRIES, LEVEL_PLANES, NORMAL_PLANES
from .interpolate import (
    corner_values,
    corner_vectors,
    corner_weights,
    exact_triangle,
    has_exact,
    inverse_sum,
    is_exact,
    mean,
    mean_vector,
    next_exact_run,
    rounded,
    row_extent,
)
from .lighting import light_batch, normalize_normals, view_from_direction
from .records import ATTRIBUTE, DEPTH, FACE, FIRST_PLANE, PLANES_FACE, SIDE
from .simd import PLANE_GROUP, PlaneGroup, evaluate_planes
from .visibility import IS_ID, LEVEL_MASK, RECORD_MASK

FURTHEST_COLUMN = 2.0**23  # integers up to this are exact in float32


class FaceTable(NamedTuple):
    """What is known of every triangle beside its corners; an array that isn't needed has no rows."""

    materials: np.ndarray  # (n_face,) uint32, empty where all have one material
    planes: np.ndarray  # (n_face, 5) float64: plane and normal offset, see shadow_lookup.py; read only for shadows

    def of_parts(self, faces) -> "FaceTable":
        """Return the table of triangles that are parts of the faces `faces`, (n,) indices."""
        return FaceTable(*(rows[faces] if len(rows) else rows for rows in self))


# ---------------------------------------------------------------- flat shading and Gouraud's method


@kernel
def shade_interpolated(band, n_channel, level_step, out_radiance):
    """Turn visibility entries and records into intensities.

    Parameters
    ----------
    band : ScannedBand, of any kind but NORMAL_PLANES
    n_channel : 1 or 3
    level_step : intensity of a level
    out_radiance : (n_channel, n_row * pitch) float32 or float64, linear
    """
    visibility, records = band.visibility, band.records
    level_step = out_radiance.dtype.type(level_step)
    for j in range(band.n_row):
        left, right = row_extent(visibility, j)
        for first in range(left, right, BATCH_SIZE):
            start, n = index(j * visibility.pitch + first), index(min(right - first, BATCH_SIZE))
            entries = visibility.entries[start : start + n]
            if band.kind == IN_ENTRIES:
                decode_levels(entries, level_step, out_radiance[0, start : start + n])
            elif band.kind == LEVEL_PLANES:
                group = plane_group(records, records.int_planes, 0, level_step)
                evaluate_planes(
                    entries, group, first, band.y_start + j, out_radiance, start, index(out_radiance.shape[1])
                )
            if band.n_exact > 0 and has_exact(entries):
                out = out_radiance[:, start : start + n]
                interpolate_intensities(entries, records, (first, band.y_start + j), n_channel, out)


@helper
def decode_levels(entries, level_step, out):
    """Fill intensities that stand in the entries."""
    for k in range(index(len(entries))):
        out[k] = out.dtype.type(np.int32(entries[k] & LEVEL_MASK)) * level_step


@helper
def interpolate_intensities(entries, records, first, n_channel, out):
    """Put in the intensities of exact records; `first` is the sample (x, y) of the first entry."""
    real, last_record = out.dtype.type, index(len(records.integers) - 1)
    start, end = next_exact_run(entries, index(0))
    while start < end:
        # Where levels stand in entries, a record's number is a matter of arithmetic: whatever it is, nothing else is
        # read.
        record = min(index(entries[start] & RECORD_MASK), last_record)
        triangle = exact_triangle(records, record)
        red = corner_values(records.reals, record, index(ATTRIBUTE))
        green = corner_values(records.reals, record, index(ATTRIBUTE + 3)) if n_channel > 1 else red
        blue = corner_values(records.reals, record, index(ATTRIBUTE + 6)) if n_channel > 1 else red
        for k in range(start, end):
            q = corner_weights(triangle, first[0] + np.int64(k), first[1])
            p = rounded(scale(q, inverse_sum(q)), real)
            out[0, k] = mean(red, p)
            if n_channel > 1:
                out[1, k] = mean(green, p)
                out[2, k] = mean(blue, p)
        start, end = next_exact_run(entries, end)


# ---------------------------------------------------------------- Phong's method


@kernel
def shade_lit(band, screen, lighting, faces, tangent_attribute, texels, batch, out_radiance):
    """Interpolate normals and evaluate the illumination equation at every visible sample.

    Parameters
    ----------
    band : ScannedBand of kind EXACT or NORMAL_PLANES. Attributes 0-2 of its records are the normals, 3-5 the albedo
        (only if lighting.has_albedo)
    faces : FaceTable
    tangent_attribute : the first of three attributes that are tangents, of records all of which are exact; None where
        no material needs them: then they are not compiled
    texels : (4, n_row * pitch), see texture_sampling.py; None where there are no textures
    batch : see fragments.py, in the type of the radiance
    out_radiance : (n_channel, n_row * pitch) float32 or float64, linear
    """
    visibility = band.visibility
    for j in range(band.n_row):
        y, (first, right) = band.y_start + j, row_extent(visibility, j)
        while first < right:
            start = index(j * visibility.pitch + first)
            entries = visibility.entries[start : start + index(min(right - first, BATCH_SIZE))]
            n, material = run_of_material(entries, band.records, faces.materials)
            entries = entries[: index(n)]
            gather_fragments(entries, band, (first, y), lighting.has_albedo, screen, lighting.needs_position, batch)
            interpolate_tangents(entries, band.records, (first, y), tangent_attribute, batch)
            if texels is not None:
                for channel in range(index(3)):
                    weight_albedo(batch, n, channel, texels[channel, start : start + index(n)])
            gather_face_planes(entries, band.records, lighting.shadows, faces.planes, screen.eye, batch)
            normalize_normals(batch, n)
            if lighting.needs_view or lighting.needs_position:
                fill_positions(screen, (first, y), n, lighting.needs_position, batch)
            light_batch(batch, n, lighting, material)
            for channel in range(index(lighting.n_channel)):
                for k in range(index(n)):
                    out_radiance[channel, start + k] = batch[f.INTENSITY + channel * f.NEXT + k]
            first += n


@helper
def run_of_material(entries, records, face_materials):
    """Return the length of the run of samples that show one material, and the material.

    Samples that show nothing belong to any run.
    """
    material = np.int64(-1)
    if len(face_materials) == 0:
        return len(entries), np.int64(0)
    for k in range(index(len(entries))):
        if entries[k] & IS_ID:
            here = np.int64(face_materials[face_of(entries[k], records)])
            if material >= 0 and here != material:
                return np.int64(k), material
            material = here
    return len(entries), max(material, np.int64(0))


@helper
def face_of(entry, records):
    """Return the triangle that an entry's record belongs to."""
    record = index(entry & RECORD_MASK)
    if is_exact(entry):
        return index(records.integers[record, index(FACE)])
    return index(records.int_planes[(record << index(records.plane_shift)) + index(PLANES_FACE)])


@helper
def gather_fragments(entries, band, first, has_albedo, screen, needs_position, batch):
    """Fill normals, distances and albedo of the samples; `first` is the sample (x, y) of the first entry.

    Samples that show nothing get anything.
    """
    records = band.records
    if band.kind == NORMAL_PLANES:
        (x, y), one = first, batch.dtype.type(1)
        group = plane_group(records, records.float_planes, 0, one)
        evaluate_planes(entries, group, x, y, batch, f.NORMAL, f.NEXT)
        if has_albedo:
            group = plane_group(records, records.float_planes, 1, one)
            evaluate_planes(entries, group, x, y, batch, f.ALBEDO, f.NEXT)
        if needs_position and screen.is_perspective:
            invert_distances(batch, len(entries))
    if band.n_exact > 0 and has_exact(entries):
        interpolate_fragments(entries, records, first, has_albedo, screen.is_perspective, batch)


@helper
def plane_group(records, planes, number, scale):
    """Return group `number` of four planes of the records; `planes` are their numbers, of int32 or of float32."""
    column = index(FIRST_PLANE + 3 * PLANE_GROUP * number)
    return PlaneGroup(planes, RECORD_MASK, index(records.plane_shift), column, scale)


@helper
def invert_distances(batch, n):
    """Turn 1/w into w."""
    one = batch.dtype.type(1)
    for k in range(index(n)):
        batch[f.DISTANCE + k] = one / batch[f.DISTANCE + k]


@helper
def interpolate_fragments(entries, records, first, has_albedo, is_perspective, batch):
    """Put in the normals, distances and albedo of exact records; `first` is the sample (x, y) of the first entry."""
    real = batch.dtype.type
    start, end = next_exact_run(entries, index(0))
    while start < end:
        record = index(entries[start] & RECORD_MASK)
        triangle, side = exact_triangle(records, record), real(records.integers[record, index(SIDE)])
        normals = corner_vectors(records, record, index(0))
        depths = corner_values(records.reals, record, index(DEPTH))
        colors = corner_vectors(records, record, index(3)) if has_albedo else normals
        # Component by component: by vector helpers and a choice between two values this loop takes a tenth longer.
        for k in range(start, end):
            q0, q1, q2 = corner_weights(triangle, first[0] + np.int64(k), first[1])
            inverse = 1.0 / (q0 + q1 + q2)
            p = real(q0 * inverse), real(q1 * inverse), real(q2 * inverse)
            batch[f.NORMAL + k] = side * mean(normals[0], p)
            batch[f.NORMAL + f.NEXT + k] = side * mean(normals[1], p)
            batch[f.NORMAL + f.NEXT + f.NEXT + k] = side * mean(normals[2], p)
            # w = Σ e_i / Σ (e_i / w_i); without perspective depth itself is interpolated.
            if is_perspective:
                batch[f.DISTANCE + k] = real(triangle.area * inverse)
            else:
                batch[f.DISTANCE + k] = mean(depths, p)
            if has_albedo:
                set_vector(batch, f.ALBEDO, k, mean_vector(colors, p))
        start, end = next_exact_run(entries, end)


@helper
def interpolate_tangents(entries, records, first, tangent_attribute, batch):
    """Put in the tangents, if there are any, of exact records; their sign doesn't matter."""
    if tangent_attribute is not None:
        real = batch.dtype.type
        start, end = next_exact_run(entries, index(0))
        while start < end:
            record = index(entries[start] & RECORD_MASK)
            triangle = exact_triangle(records, record)
            tangents = corner_vectors(records, record, index(tangent_attribute))
            for k in range(start, end):
                q = corner_weights(triangle, first[0] + np.int64(k), first[1])
                p = rounded(scale(q, inverse_sum(q)), real)
                set_vector(batch, f.TANGENT, k, mean_vector(tangents, p))
            start, end = next_exact_run(entries, end)


@helper
def weight_albedo(batch, n, channel, texels):
    """Multiply one channel of the albedo by the texture."""
    first = f.ALBEDO + channel * f.NEXT
    for k in range(index(n)):
        batch[first + k] *= texels[k]


@helper
def gather_face_planes(entries, records, shadows, face_planes, eye, batch):
    """Fill what shadows need, if there are any: the planes of the visible polygons, relative to the eye, and the normal
    offsets."""
    if shadows is not None:
        eye = read_vector(eye, 0)
        for k in range(index(len(entries))):
            face = face_of(entries[k], records) if entries[k] & IS_ID else index(0)
            normal = face_planes[face, 0], face_planes[face, 1], face_planes[face, 2]
            set_vector(batch, f.FACE_NORMAL, k, normal)
            batch[f.FACE_OFFSET + k] = face_planes[face, 3] - dot(normal, eye)
            batch[f.NORMAL_OFFSET + k] = face_planes[face, 4]


# ---------------------------------------------------------------- where the samples lie in the world


@helper
def fill_positions(screen, first, n, needs_position, batch):
    """Fill positions and view directions: where the rays through the samples meet the surface.

    Perspective: P = w·ray, with ray·forward = 1; the direction to the viewer is that of -ray. Orthographic: P is the
    sample's point of the picture plane plus depth·forward; the viewer is at infinity. DISTANCE holds w or depth. A ray
    is a function of column and row alone, wherever the batch begins; `first` is the sample (x, y) of fragment 0.

    Columns are counted from the one next to the picture's centre. So a ray is the sum of parts that are not longer than
    it is itself, whatever the field of view: with 4 roundings each, of a part, its product and two sums, and |x| + |y|
    + |z| <= √3 times the length, a ray errs by 7 u of its length, u = 2^-24 or 2^-53.
    """
    real, (x, y) = batch.dtype.type, first
    along = 1.0 if screen.is_perspective else 0.0
    step = 1.0 / screen.scale_x
    # Of a centre far beside the picture all columns are far: then none has digits to lose.
    middle = np.int64(min(max(screen.center_x, -FURTHEST_COLUMN), FURTHEST_COLUMN))
    across, upward = (float(middle) + 0.5 - screen.center_x) * step, (screen.center_y - (y + 0.5)) / screen.scale_y
    at_middle = add(add(scale(screen.right, across), scale(screen.up, upward)), scale(screen.forward, along))
    ray_start, ray_step = rounded(at_middle, real), rounded(scale(screen.right, step), real)
    forward, one = rounded(screen.forward, real), real(1)
    if screen.is_perspective:
        for k in range(index(n)):
            column = real(np.int32(x + np.int64(k) - middle))
            ray = add(ray_start, scale(ray_step, column))
            set_vector(batch, f.VIEW_DIR, k, scale(ray, -one / np.sqrt(dot(ray, ray))))
            if needs_position:
                set_vector(batch, f.POSITION, k, scale(ray, batch[f.DISTANCE + k]))
        return
    view_from_direction(batch, n, scale(forward, -one))
    if needs_position:
        for k in range(index(n)):
            column = real(np.int32(x + np.int64(k) - middle))
            on_plane = add(ray_start, scale(ray_step, column))
            set_vector(batch, f.POSITION, k, add(on_plane, scale(forward, batch[f.DISTANCE + k])))
