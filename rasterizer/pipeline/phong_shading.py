"""Stage 6, shade, of Phong's method: the illumination of a band's visible samples.

In:  the band's packed samples and setups (scan.py, triangle_setups.py).
Out: `radiance`, linear intensities, a plane a channel; samples where nothing is visible hold anything.

Normals are interpolated, and the illumination equation (lighting.py) is evaluated at every visible sample: in batches
of a row's samples that show one material. Materials are lit in float32 or in float64, whichever they need; a band that
shows both is gone through twice.

Letters: see shade.py; w distance along the viewing axis, scene units.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import by_type, helper, kernel
from ..geometry.vectors import add, dot, scale
from . import fragments as f
from .fragments import BATCH_SIZE, count_side_by_side, read_vector, set_vector
from .gradients import DOUBLE_PRECISION, HAS_ALBEDO, HAS_TEXTURE, SINGLE_PRECISION
from .interpolate import (
    corner_values,
    corner_vectors,
    exact_triangle,
    has_exact,
    has_planes,
    mean,
    mean_vector,
    next_exact_run,
    plane_inverse,
    rounded,
    row_extent,
    sample_weights,
)
from .lighting import light_batch, normalize_normals, view_from_direction
from .samples import evaluate_planes, evaluate_values, evaluate_with_slopes
from .setup import inverse_sum
from .shade import fill_weights
from .texcoords import S_PLANE
from .texturing import RED, look_up_colors, put_in_metals
from .triangle_setups import BEHIND_NORMALS, DEPTH, NORMALS, PLAIN_GROUP, SIDE, face_of, material_of, plane_group
from .visibility import IS_ID, PAYLOAD_BITS, next_stretch, setup_of, stretch_of, strip_of

FURTHEST_COLUMN = 2.0**23  # integers up to this are exact in float32


@kernel
def shade_lit(band, screen, lighting, face_planes, tangent_attribute, texturing, batch, out_radiance):
    """Interpolate normals and evaluate the illumination equation at the visible samples of materials that are computed
    in the type of the batch.

    Where a band has both, float32 comes first: it writes anything to the samples that float64 is needed for.

    Parameters
    ----------
    band : ScannedBand. Attributes 0-2 of its setups are the normals, 3-5 the albedo (only of materials that have one)
    screen : Screen
    lighting : Lighting (lighting.py)
    face_planes : (n_face, 5) float64: plane and longest side of every triangle, see shadow_lookup.py; read only for
        shadows
    tangent_attribute : the first of three attributes that are tangents, of setups all of which are exact; None where
        no material needs them: then they are not compiled
    texturing : Texturing; None where there are no textures
    batch : see fragments.py, float32 or float64
    out_radiance : (n_channel, n_row * pitch) float32 or float64, linear
    """
    is_double = batch.itemsize == 8
    visibility, shown = band.visibility, select_materials(band, is_double)
    for j in range(band.n_row):
        y, (first, right) = band.y_start + j, row_extent(visibility, j)
        while first < right:
            start = j * visibility.pitch + first
            end, material = stretch_of(visibility, strip_of(j), first, right, shown.material)
            n = min(end - first, BATCH_SIZE)
            n, is_blank = next_stretch(visibility.packed[start : start + n])
            if is_blank:
                material = -1
            elif material < 0:
                n, material = run_of_material(visibility.packed[start : start + n], band, shown)
            elif not is_lit_here(material, band, shown):
                n, material = end - first, -1
            packed = visibility.packed[start : start + n]
            if material >= 0:
                where = first, y
                is_in_planes = gather_fragments(batch, packed, band, where, material, texturing, screen)
                interpolate_tangents(packed, band.setups, where, tangent_attribute, batch)
                weight_albedo(packed, band, where, material, texturing, start, is_in_planes, batch)
                gather_face_planes(packed, band.setups, lighting.shadows, face_planes, screen.eye, batch)
                n_side = count_side_by_side(batch, n)
                normalize_normals(batch, n_side)
                if lighting.needs_view or lighting.needs_position:
                    fill_positions(screen, where, n_side, lighting.needs_position, batch)
                light_batch(batch, n, lighting, material)
                write_radiance(batch, n, lighting.n_channels[material], lighting.tint, out_radiance, start)
            first += n


class Shown(NamedTuple):
    """Which materials of a band a call is for."""

    material: int  # that of all samples; -1 where there are several
    is_all: bool  # all materials are
    is_double: bool  # those that need float64, or those that don't


@helper
def select_materials(band, is_double):
    """Return which materials of a band a call is for."""
    counts, both = band.counts, SINGLE_PRECISION | DOUBLE_PRECISION
    return Shown(counts.material, (counts.features & both) != both, is_double)


@helper
def is_lit_here(material, band, shown):
    """Tell whether a call is for a material."""
    return shown.is_all or bool(band.coding.features[material] & DOUBLE_PRECISION) == shown.is_double


@helper
def run_of_material(packed, band, shown):
    """Return the length of a run of samples, and the one material that is to be lit there; -1 where there is none.

    Samples that show nothing, or what is not lit by this call, belong to any run. But those that were lit by the call
    before, in float32, belong to none.
    """
    material, is_second = -1, shown.is_double and not shown.is_all
    for k in range(len(packed)):
        here = -1
        if packed[k] & IS_ID:
            here = material_of(packed[k], band.setups)
            here = here if is_lit_here(here, band, shown) else -1
        if here != material and (here >= 0 or is_second):
            if material >= 0 or (is_second and k > 0):
                return k, material
            material = here
    return len(packed), material


@helper
def write_radiance(batch, n, n_channel, tint, out_radiance, start):
    """Write the intensities of a run of n samples, which have one channel or three, to as many, or to three."""
    for channel in range(out_radiance.shape[0]):
        out = out_radiance[channel, start : start + n]
        if n_channel == out_radiance.shape[0]:
            source = f.INTENSITY + channel * f.NEXT
            for k in range(n):
                out[k] = batch[source + k]
        else:
            factor = batch.dtype.type(tint[channel])
            for k in range(n):
                out[k] = batch[f.INTENSITY + k] * factor


@helper
def gather_single(batch, packed, band, first, material, texturing, screen):
    """Fill normals, distances and albedo of the samples in float32, and evaluate planes of texture coordinates for
    them; `first` says where they lie (samples.py). Return whether any sample shows planes.

    Samples that show nothing get anything.
    """
    shows_planes = band.counts.n_exact == 0 or has_planes(packed)
    if shows_planes:
        evaluate_fragments(packed, band, first, material, texturing, screen.is_perspective, batch)
    gather_exact(batch, packed, band, first, material, texturing, screen)
    return shows_planes


@helper
def gather_exact(batch, packed, band, first, material, texturing, screen):
    """The same where no sample shows planes, in either type: what is lit in float64 stands in exact setups."""
    has_albedo = band.coding.features[material] & HAS_ALBEDO != 0
    if band.counts.n_exact > 0 and has_exact(packed):
        interpolate_fragments(packed, band, first, has_albedo, screen.is_perspective, batch)
    return False


gather_fragments = by_type(gather_single, gather_exact)


@helper
def evaluate_fragments(packed, band, first, material, texturing, is_perspective, batch):
    """Fill what stands in planes: normals, texture coordinates, albedo; and distances."""
    depths, features = band.coding.depths, band.coding.features[material]
    group = plane_group(band.setups, NORMALS)
    if texturing is None:
        evaluate_planes(packed, group, first, batch, f.NORMAL)
    elif features & HAS_TEXTURE:  # texture coordinates stand right behind the normals, so both come in one go
        evaluate_with_slopes(packed, group, first, batch, f.NORMAL, texturing.batch, S_PLANE)
    else:
        evaluate_planes(packed, group, first, batch, f.NORMAL)
    evaluate_albedo(packed, band, first, features, band.coding.albedo_tolerance, batch)
    if band.coding.needs_distance:
        offset, step = depths.inv_w_offset, depths.inv_w_scale
        for k in range(len(packed)):
            z = float(packed[k] >> PAYLOAD_BITS)
            inverse = np.float32(1) / np.float32(offset + step * z)
            along = np.float32(depths.depth_offset + depths.depth_scale * z)
            batch[f.DISTANCE + k] = inverse if is_perspective else along


@helper
def evaluate_albedo(packed, band, first, features, tolerance, batch):
    """Fill the albedo of what has one; `tolerance` is None where no material has."""
    if tolerance is not None:
        if features & HAS_ALBEDO:
            fill_weights(packed, band.coding.depths, batch)
            group = plane_group(band.setups, BEHIND_NORMALS + (PLAIN_GROUP if features & HAS_TEXTURE else 0))
            evaluate_values(packed, group, first, batch, f.ALBEDO, f.WEIGHT)


@helper
def interpolate_fragments(packed, band, first, has_albedo, is_perspective, batch):
    """Put in the normals, distances and albedo of exact setups; `first` says where they lie (samples.py)."""
    setups, real, is_double = band.setups, batch.dtype.type, batch.itemsize == 8
    start, end = next_exact_run(packed, 0)
    while start < end:
        if bool(band.coding.features[material_of(packed[start], setups)] & DOUBLE_PRECISION) != is_double:
            start, end = next_exact_run(packed, end)
            continue
        setup = setup_of(packed[start])
        triangle, side = exact_triangle(setups, setup), real(setups.integers[setup, SIDE])
        normals = rounded_vectors(corner_vectors(setups, setup, 0), real)
        exact_depths = corner_values(setups.reals, setup, DEPTH)
        depths = rounded(exact_depths, real)
        colors = rounded_vectors(corner_vectors(setups, setup, 3), real) if has_albedo else normals
        # Component by component: by vector helpers and a choice between two values this loop takes longer.
        for k in range(start, end):
            q0, q1, q2 = sample_weights(triangle, first, k)
            inverse = 1.0 / (q0 + q1 + q2)
            p = real(q0 * inverse), real(q1 * inverse), real(q2 * inverse)
            batch[f.NORMAL + k] = side * mean(normals[0], p)
            batch[f.NORMAL + f.NEXT + k] = side * mean(normals[1], p)
            batch[f.NORMAL + f.NEXT + f.NEXT + k] = side * mean(normals[2], p)
            if is_perspective:
                batch[f.DISTANCE + k] = real(1.0 / plane_inverse(triangle, exact_depths, (q0, q1, q2)))
            else:
                batch[f.DISTANCE + k] = mean(depths, p)
            if has_albedo:
                set_vector(batch, f.ALBEDO, k, mean_vector(colors, p))
        start, end = next_exact_run(packed, end)


@helper
def rounded_vectors(corners, real):
    """Return three attributes, each at the three corners, in a type."""
    return rounded(corners[0], real), rounded(corners[1], real), rounded(corners[2], real)


@helper
def interpolate_tangents(packed, setups, first, tangent_attribute, batch):
    """Put in the tangents, if there are any, of exact setups; their sign doesn't matter."""
    if tangent_attribute is not None:
        real = batch.dtype.type
        start, end = next_exact_run(packed, 0)
        while start < end:
            setup = setup_of(packed[start])
            triangle = exact_triangle(setups, setup)
            tangents = corner_vectors(setups, setup, tangent_attribute)
            for k in range(start, end):
                q = sample_weights(triangle, first, k)
                p = rounded(scale(q, inverse_sum(q)), real)
                set_vector(batch, f.TANGENT, k, mean_vector(tangents, p))
            start, end = next_exact_run(packed, end)


@helper
def weight_albedo(packed, band, first, material, texturing, start, is_in_planes, batch):
    """Multiply the albedo by the texture, if there is one; where no colours are given with the model, it is that.

    Put in what says how metallic and rough the surface is, too.
    """
    features, n = band.coding.features[material], len(packed)
    if texturing is not None:
        if features & HAS_TEXTURE:
            look_up_colors(packed, band, first, material, texturing, start, is_in_planes)
            for channel in range(3):
                albedo, texel = f.ALBEDO + channel * f.NEXT, RED + channel * f.NEXT
                if features & HAS_ALBEDO:
                    for k in range(n):
                        batch[albedo + k] *= texturing.batch[texel + k]
                else:
                    for k in range(n):
                        batch[albedo + k] = texturing.batch[texel + k]
        put_in_metals(texturing.metals, packed, band, first, material, texturing, batch)


@helper
def gather_face_planes(packed, setups, shadows, face_planes, eye, batch):
    """Fill what shadows need, if there are any: the planes of the visible polygons, relative to the eye, and their
    longest sides."""
    if shadows is not None:
        eye = read_vector(eye, 0)
        for k in range(len(packed)):
            face = face_of(packed[k], setups) if packed[k] & IS_ID else 0
            normal = face_planes[face, 0], face_planes[face, 1], face_planes[face, 2]
            set_vector(batch, f.FACE_NORMAL, k, normal)
            batch[f.FACE_OFFSET + k] = face_planes[face, 3] - dot(normal, eye)
            batch[f.FACE_SIDE + k] = face_planes[face, 4]


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

    Skew moves the column that lies straight above or below the picture's centre: the middle is the one that does so in
    this row. What it moves a ray by to the right, skew·upward/scale_x, has 4 roundings in float64: a difference, a
    quotient, a product, a sum. Upward being a part of the ray, that is up to 4·2^-53·|skew|/scale_x of its length more.
    """
    real, (x, y) = batch.dtype.type, first
    along = 1.0 if screen.is_perspective else 0.0
    step = 1.0 / screen.scale_x
    # Of a centre far beside the picture all columns are far: then none has digits to lose.
    upward = (screen.center_y - (y + 0.5)) / screen.scale_y
    aside = screen.skew * upward
    middle = np.int64(min(max(screen.center_x - aside, -FURTHEST_COLUMN), FURTHEST_COLUMN))
    across = ((float(middle) + 0.5 - screen.center_x) + aside) * step
    at_middle = add(add(scale(screen.right, across), scale(screen.up, upward)), scale(screen.forward, along))
    ray_start, ray_step = rounded(at_middle, real), rounded(scale(screen.right, step), real)
    forward, one = rounded(screen.forward, real), real(1)
    if screen.is_perspective:
        for k in range(n):
            ray = add(ray_start, scale(ray_step, real(np.int32(x + k - middle))))
            set_vector(batch, f.VIEW_DIR, k, scale(ray, -one / np.sqrt(dot(ray, ray))))
        if needs_position:  # in a loop of its own: one store that depends on a choice slows all of a loop down
            for k in range(n):
                ray = add(ray_start, scale(ray_step, real(np.int32(x + k - middle))))
                set_vector(batch, f.POSITION, k, scale(ray, batch[f.DISTANCE + k]))
        return
    view_from_direction(batch, n, scale(forward, -one))
    if needs_position:
        for k in range(n):
            column = real(np.int32(x + k - middle))
            on_plane = add(ray_start, scale(ray_step, column))
            set_vector(batch, f.POSITION, k, add(on_plane, scale(forward, batch[f.DISTANCE + k])))
