"""The illumination equation over batches of surface points: the one place where it is evaluated, for all shadings.

    I = ke + albedo·(ka·Ia + Σ kd·Ip·DIFFUSE) + Σ ks·Ip·SPECULAR          summed over the lights

Where W(θ) weights a highlight, ks·Ip·F0·SPECULAR + ks·Ip·GRAZING stands there; metals add ks·Ip·m·M·METAL to what the
albedo multiplies (reflection.py).

In:  surface points: positions, normals, and what materials and shadows need beside (fragments.py).
Out: linear intensities.

What depends on a light alone is found by its light function (lights.py), what depends on the material by its
reflection function (reflection.py). Source: Phong 1975; Foley, van Dam, Feiner & Hughes 1990, section 16.1.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import call_batch_function, helper, kernel
from ..geometry.vectors import dot, scale, subtract, vector_of_row
from . import fragments as f
from . import material_coefficients as m
from .fragments import BATCH_SIZE, count_side_by_side, get_vector, read_vector, set_vector


class ShadowMaps(NamedTuple):
    """How the lights' shadows are looked up; see shadow_lookup.py."""

    function: int  # address of the function that weakens a light where it is occluded
    maps: np.ndarray  # (n_light,) int64, addresses of shadow maps, 0 for none


class Lighting(NamedTuple):
    """What lights the scene, as arrays; reals are float32 or float64, as the batch is."""

    light_functions: np.ndarray  # (n_light,) int64, addresses of light functions
    lights: np.ndarray  # (n_light, N_LIGHT_COEFFICIENT), see lights.py
    n_lights: np.ndarray  # (n_material,) int64: how many lights light the material
    light_idx: np.ndarray  # (n_material, n_light) int64: these lights, ascending, then anything
    reflection_functions: np.ndarray  # (n_material, n_light) int64, addresses of reflection functions
    materials: np.ndarray  # (n_material, N_MATERIAL_COEFFICIENT), see material_coefficients.py
    n_terms: np.ndarray  # (n_material,) int64: of DIFFUSE, SPECULAR, GRAZING and METAL so many are summed
    is_view_dependent: np.ndarray  # (n_material,) bool: the reflection functions read N·V and the view directions
    n_channels: np.ndarray  # (n_material,) int64: 1 or 3
    n_sums: np.ndarray  # (n_material,) int64: the sums over the lights have so many, 1 where all their factors are grey
    tint: np.ndarray  # (3,) float32, the colour of what has one channel, where a band has three
    needs_view: bool  # some material is view-dependent
    needs_position: bool  # some light has a position
    has_albedo: np.ndarray  # (n_material,) bool: colours are given with the model
    colors: np.ndarray  # (1 or n_material, n_light, 12): factors of these four, three channels each
    shadows: ShadowMaps | None  # None where no light casts any: then shadows are not compiled


class SurfacePoints(NamedTuple):
    """Points that are lit before anything is drawn: Gouraud's vertices, the centroids of flat shading."""

    positions: np.ndarray  # (n, 3) float64, world space
    normals: np.ndarray  # (n, 3) float64, world space, unit length
    tangents: np.ndarray | None  # (n, 3) float64; None where no material needs them: then they are not compiled
    albedo: np.ndarray  # (n, n_channel) float64, read only if the material has one
    normal_offsets: np.ndarray  # (2, n) float64, scene units, on the side of the normal and on the other, see
    # geometry/surfaces.py; read only if a light casts shadows


# ---------------------------------------------------------------- one batch


@helper
def normalize_normals(batch, n):
    """Scale the normals to unit length; a normal that is zero stays zero."""
    zero, one = batch.dtype.type(0), batch.dtype.type(1)
    for k in range(n):
        normal = get_vector(batch, f.NORMAL, k)
        square = dot(normal, normal)
        set_vector(batch, f.NORMAL, k, scale(normal, one / np.sqrt(square) if square > zero else zero))


@helper
def view_from_position(batch, n):
    """Fill the view directions for an eye at the origin of the positions."""
    zero, one = batch.dtype.type(0), batch.dtype.type(1)
    for k in range(n):
        position = get_vector(batch, f.POSITION, k)
        square = dot(position, position)
        set_vector(batch, f.VIEW_DIR, k, scale(position, -one / np.sqrt(square) if square > zero else zero))


@helper
def view_from_direction(batch, n, view_dir):
    """Fill the view directions for an eye at infinity."""
    for k in range(n):
        set_vector(batch, f.VIEW_DIR, k, view_dir)


@helper
def compute_n_dot_v(batch, n):
    """Fill N·V."""
    for k in range(n):
        batch[f.N_DOT_V + k] = dot(get_vector(batch, f.NORMAL, k), get_vector(batch, f.VIEW_DIR, k))


@helper
def light_batch(batch, n, lighting, material):
    """Evaluate the illumination equation for n points of one material; the intensities fill INTENSITY."""
    n_side = count_side_by_side(batch, n)
    if lighting.is_view_dependent[material]:
        compute_n_dot_v(batch, n_side)
    sum_lights(batch, n, n_side, lighting, material)
    for channel in range(lighting.n_channels[material]):
        combine_channel(batch, n_side, channel, lighting, material)


@helper
def sum_lights(batch, n, n_side, lighting, material):
    """Sum what all lights reflect, into DIFFUSE_SUM and SPECULAR_SUM.

    A light that doesn't arrive at any of the n points adds 0: it is left out. Shadows are looked up for these alone,
    all else is computed for `n_side`.
    """
    zero = batch.dtype.type(0)
    for channel in range(lighting.n_sums[material]):
        for k in range(n_side):
            batch[f.DIFFUSE_SUM + channel * f.NEXT + k] = batch[f.SPECULAR_SUM + channel * f.NEXT + k] = zero
    for nth in range(lighting.n_lights[material]):
        light = lighting.light_idx[material, nth]
        coefficients = lighting.lights[light].ctypes.data
        call_batch_function(lighting.light_functions[light], batch.ctypes.data, n_side, coefficients)
        if arrives(batch, n):
            cast_shadow(batch, n, lighting.shadows, light)
            add_reflected(batch, n_side, lighting, material, light)


@helper
def arrives(batch, n):
    """Tell whether a light arrives at any point: reflection functions write 0 for one that is behind, N·L <= 0, or has
    no strength there."""
    zero, is_lit = batch.dtype.type(0), False
    for k in range(n):
        is_lit |= (batch[f.N_DOT_L + k] > zero) & (batch[f.STRENGTH + k] != zero)
    return is_lit


@helper
def add_reflected(batch, n, lighting, material, light):
    """Add what a light, after its function and its shadow, reflects to the sums."""
    color_set = min(material, lighting.colors.shape[0] - 1)
    call_batch_function(
        lighting.reflection_functions[material, light],
        batch.ctypes.data, n, lighting.materials[material].ctypes.data,
    )  # fmt: skip
    colors, n_term = lighting.colors[color_set, light], lighting.n_terms[material]
    for channel in range(lighting.n_sums[material]):
        diffuse_sums, specular_sums = f.DIFFUSE_SUM + channel * f.NEXT, f.SPECULAR_SUM + channel * f.NEXT
        add_light(batch, n, diffuse_sums, f.DIFFUSE, colors[channel])
        if n_term > 1:
            add_light(batch, n, specular_sums, f.SPECULAR, colors[3 + channel])
        if n_term > 2:
            add_light(batch, n, specular_sums, f.GRAZING, colors[6 + channel])
        if n_term > 3:
            add_light(batch, n, diffuse_sums, f.METAL, colors[9 + channel])


@helper
def cast_shadow(batch, n, shadows, light):
    """Multiply STRENGTH by the part of a light that arrives, if it has a shadow map."""
    if shadows is not None and shadows.maps[light] != 0:
        call_batch_function(shadows.function, batch.ctypes.data, n, shadows.maps[light])


@helper
def add_light(batch, n, sums, reflected, color):
    """Add a term of one light's reflection to the sums of one channel."""
    for k in range(n):
        batch[sums + k] += color * batch[reflected + k]


@helper
def combine_channel(batch, n, channel, lighting, material):
    """Combine the sums over the lights, emission and ambient light of one channel into intensities."""
    materials, zero = lighting.materials, batch.dtype.type(0)
    emission, ambient = (
        materials[material, m.EMISSION + channel],
        materials[material, m.AMBIENT + channel],
    )
    kd, ks = materials[material, m.DIFFUSE + channel], materials[material, m.SPECULAR + channel]
    summed = min(channel, lighting.n_sums[material] - 1) * f.NEXT
    diffuse_sums, specular_sums = f.DIFFUSE_SUM + summed, f.SPECULAR_SUM + summed
    albedo, out = f.ALBEDO + channel * f.NEXT, f.INTENSITY + channel * f.NEXT
    has_albedo, has_highlight = lighting.has_albedo[material], lighting.n_terms[material] > 1
    for k in range(n):
        diffuse = ambient + kd * batch[diffuse_sums + k]
        if has_albedo:
            diffuse *= batch[albedo + k]
        specular = ks * batch[specular_sums + k] if has_highlight else zero
        batch[out + k] = emission + diffuse + specular


# ---------------------------------------------------------------- points that are lit before they are drawn


@kernel
def light_points(points, which, screen, side, lighting, material, batch, out_intensities):
    """Evaluate the illumination equation at surface points, all of one material.

    Parameters
    ----------
    points : SurfacePoints
    which : (n,) int64, the numbers of the points that are lit
    side : 1 or -1, a factor of the normals; 0 flips every normal towards the viewer
    material : row of lighting.materials
    batch : see fragments.py, of the lighting's dtype
    out_intensities : (n_point, n_channel), linear; the first channel where the material has one
    """
    for first in range(0, len(which), BATCH_SIZE):
        some = which[first : first + BATCH_SIZE]
        n = len(some)
        gather_positions(points.positions, some, screen.eye, batch)
        if side == 0:
            gather_normals_to_viewer(points, some, screen, batch)
        else:
            gather_normals(points.normals, some, float(side), batch)
        if lighting.has_albedo[material]:
            gather_albedo(points.albedo, some, lighting.n_channels[material], batch)
        if lighting.needs_view and screen.is_perspective:
            view_from_position(batch, n)
        elif lighting.needs_view:
            forward, real = screen.forward, batch.dtype.type
            view_from_direction(batch, n, (-real(forward[0]), -real(forward[1]), -real(forward[2])))
        gather_tangents(points.tangents, some, batch)
        gather_planes(lighting.shadows, points, some, batch)
        light_batch(batch, n, lighting, material)
        for channel in range(lighting.n_channels[material]):
            for k in range(n):
                out_intensities[some[k], channel] = batch[f.INTENSITY + channel * f.NEXT + k]


@kernel
def flag_seen(faces, corner_idx, out):
    """Flag the points that triangles have at their corners.

    Parameters
    ----------
    faces : (n,) uint32, the triangles
    corner_idx : (3, n_face) uint32, the points at their corners; (1, n_face) where these are one
    out : (n_point,) bool, clear; written
    """
    for corner in range(len(corner_idx)):
        points = corner_idx[corner]
        for k in range(len(faces)):
            out[points[faces[k]]] = True


@helper
def gather_positions(positions, some, eye, batch):
    """Copy positions, relative to the eye: subtracted in float64, before digits are dropped."""
    eye = read_vector(eye, 0)
    for k in range(len(some)):
        set_vector(batch, f.POSITION, k, subtract(vector_of_row(positions, some[k]), eye))


@helper
def gather_normals(normals, some, sign, batch):
    """Copy normals, or their opposites."""
    for k in range(len(some)):
        set_vector(batch, f.NORMAL, k, scale(vector_of_row(normals, some[k]), sign))


@helper
def gather_normals_to_viewer(points, some, screen, batch):
    """Copy normals, each flipped to the side that the eye, or the viewer at infinity, is on.

    In float64: of a face that is far away and seen at a grazing angle, N·(P - eye) is the small difference of large
    numbers.
    """
    positions, normals = points.positions, points.normals
    eye, forward = read_vector(screen.eye, 0), read_vector(screen.forward, 0)
    for k in range(len(some)):
        normal = vector_of_row(normals, some[k])
        away = dot(normal, forward)
        if screen.is_perspective:
            away = dot(normal, subtract(vector_of_row(positions, some[k]), eye))
        set_vector(batch, f.NORMAL, k, scale(normal, -1.0 if away > 0.0 else 1.0))


@helper
def gather_albedo(albedo, some, n_channel, batch):
    """Copy the albedo."""
    real = batch.dtype.type
    for channel in range(n_channel):
        for k in range(len(some)):
            batch[f.ALBEDO + channel * f.NEXT + k] = real(albedo[some[k], channel])


@helper
def gather_tangents(tangents, some, batch):
    """Copy the tangents, if there are any."""
    if tangents is not None:
        for k in range(len(some)):
            set_vector(batch, f.TANGENT, k, vector_of_row(tangents, some[k]))


@helper
def gather_planes(shadows, points, some, batch):
    """Fill what shadows need, if there are any: of a point alone, its own normal is that of the surface's plane, which
    its normal offset moves."""
    if shadows is not None:
        for k in range(len(some)):
            normal = get_vector(batch, f.NORMAL, k)
            set_vector(batch, f.FACE_NORMAL, k, normal)
            is_turned = np.int64(dot(normal, vector_of_row(points.normals, some[k])) < 0.0)
            height = dot(normal, get_vector(batch, f.POSITION, k))
            batch[f.FACE_OFFSET + k] = height + points.normal_offsets[is_turned, some[k]]
            batch[f.FACE_SIDE + k] = 0
