"""The illumination equation over rows of surface points: the one place where it is evaluated, for every shading method.

    I = ke + albedo·(ka·Ia + Σ kd·Ip·DIFFUSE) + Σ ks·Ip·SPECULAR          summed over the lights

Source: Phong 1975; Foley, van Dam, Feiner & Hughes 1990, section 16.1. The terms that depend on a light alone are found
by the light's row function (light_kinds.py), those that depend on the material by the reflection model's
(reflection.py).
"""

from typing import NamedTuple

import numpy as np
from numba.extending import overload

from ..compiler.kernels import borrow, call_row, helper, kernel
from .fragments import (
    ALBEDO,
    CHUNK,
    DIFFUSE,
    DIFFUSE_SUM,
    INTENSITY,
    LIFT,
    N_DOT_V,
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
    SPECULAR,
    SPECULAR_SUM,
    TANGENT_X,
    TANGENT_Y,
    TANGENT_Z,
    VIEW_X,
    VIEW_Y,
    VIEW_Z,
)
from .reflection import N_MATERIAL_NUMBER

# A material's numbers: those that its row function reads (reflection.py), then its coefficients, a column a channel.
EMISSIVE, AMBIENT, DIFFUSE_COLOR, SPECULAR_COLOR = (N_MATERIAL_NUMBER + 3 * k for k in range(4))
N_MATERIAL_COLUMN = N_MATERIAL_NUMBER + 12


class Lighting(NamedTuple):
    """What lights the scene, as arrays; the numbers are float32 or float64, as the rows are."""

    light_function: np.ndarray  # (n_light,) int64, addresses of row functions
    light: np.ndarray  # (n_light, lights.N_NUMBER)
    reflection_function: np.ndarray  # (n_material, n_light) int64, addresses of row functions
    material: np.ndarray  # (n_material, N_MATERIAL_COLUMN); AMBIENT is ka·Ia
    is_shiny: np.ndarray  # (n_material,) bool: the material has a highlight
    is_view_dependent: np.ndarray  # (n_material,) bool: its row function reads N·V and the view directions
    n_channel: int
    n_light_channel: int  # 1 where all lights are grey: then the sums over the lights need one channel only
    needs_view: bool  # some material is view-dependent
    needs_position: bool  # some light has a place
    has_albedo: bool  # colours are given with the model
    color: (
        np.ndarray
    )  # (1 or n_material, n_light, 6): what D, and what the highlight, is multiplied by, a column a channel
    shadow_function: int  # address of the row function that casts shadows
    shadow: (
        np.ndarray
    )  # (n_light,) int64, addresses of shadow maps (shadow_lookup.py), 0 for none; empty where no light has one


class ShadowedLighting(Lighting):
    """Lights some of which cast shadows. Only with these are shadows compiled."""


class BrushedLighting(Lighting):
    """Light on materials some of which need tangents of the points. Only with these are tangents compiled."""


class ShadowedBrushedLighting(ShadowedLighting):
    """Both."""


BRUSHED = (BrushedLighting, ShadowedBrushedLighting)


@helper
def normalize_normals(rows, n):
    """Scale the normals to unit length; a normal that is zero stays zero."""
    zero, one = rows.dtype.type(0), rows.dtype.type(1)
    for k in range(np.uint64(n)):
        x, y, z = rows[NORMAL_X + k], rows[NORMAL_Y + k], rows[NORMAL_Z + k]
        square = x * x + y * y + z * z
        scale = one / np.sqrt(square) if square > zero else zero
        rows[NORMAL_X + k], rows[NORMAL_Y + k], rows[NORMAL_Z + k] = x * scale, y * scale, z * scale


@helper
def view_from_position(rows, n):
    """Fill the view directions for an eye at the origin of the positions."""
    zero, one = rows.dtype.type(0), rows.dtype.type(1)
    for k in range(np.uint64(n)):
        x, y, z = rows[POSITION_X + k], rows[POSITION_Y + k], rows[POSITION_Z + k]
        square = x * x + y * y + z * z
        scale = -one / np.sqrt(square) if square > zero else zero
        rows[VIEW_X + k], rows[VIEW_Y + k], rows[VIEW_Z + k] = x * scale, y * scale, z * scale


@helper
def view_from_direction(rows, n, x, y, z):
    """Fill the view directions for an eye at infinity in the direction (x, y, z)."""
    for k in range(np.uint64(n)):
        rows[VIEW_X + k], rows[VIEW_Y + k], rows[VIEW_Z + k] = x, y, z


@helper
def find_n_dot_v(rows, n):
    """Fill N·V."""
    for k in range(np.uint64(n)):
        rows[N_DOT_V + k] = (
            rows[NORMAL_X + k] * rows[VIEW_X + k]
            + rows[NORMAL_Y + k] * rows[VIEW_Y + k]
            + rows[NORMAL_Z + k] * rows[VIEW_Z + k]
        )


@helper
def light_rows(rows, n, lighting, material):
    """Evaluate the illumination equation for n points of one material; the intensities fill the rows INTENSITY."""
    zero = rows.dtype.type(0)
    is_shiny = lighting.is_shiny[material]
    number = lighting.material[material]
    set_of_colors = min(np.uint64(material), np.uint64(lighting.color.shape[0] - 1))
    if lighting.is_view_dependent[material]:
        find_n_dot_v(rows, n)
    if len(lighting.light_function) == 0:
        for k in range(np.uint64(n)):
            rows[DIFFUSE_SUM + k] = rows[SPECULAR_SUM + k] = zero
    for light in range(np.uint64(len(lighting.light_function))):
        call_row(lighting.light_function[light], rows.ctypes.data, n, lighting.light[light].ctypes.data)
        cast_shadow(rows, n, lighting, light)
        call_row(lighting.reflection_function[material, light], rows.ctypes.data, n, number.ctypes.data)
        for channel in range(np.uint64(lighting.n_light_channel)):
            matte = lighting.color[set_of_colors, light, channel]
            add_light(rows, n, DIFFUSE_SUM + channel * NEXT_CHANNEL, DIFFUSE, matte, light == 0)
            if is_shiny:
                shine = lighting.color[set_of_colors, light, np.uint64(3) + channel]
                add_light(rows, n, SPECULAR_SUM + channel * NEXT_CHANNEL, SPECULAR, shine, light == 0)
    for channel in range(np.uint64(lighting.n_channel)):
        # With grey lights all channels read the sums of channel 0.
        source = channel if lighting.n_light_channel > 1 else np.uint64(0)
        compose(rows, n, channel, source, number, lighting.has_albedo, is_shiny)


def cast_shadow(rows, n, lighting, light):
    """Multiply STRENGTH by the part of a light that arrives."""
    raise NotImplementedError("compiled code only")


@overload(cast_shadow)
def _overload_cast_shadow(rows, n, lighting, light):
    if issubclass(lighting.instance_class, ShadowedLighting):
        return look_up_shadow
    return lambda rows, n, lighting, light: None


def look_up_shadow(rows, n, lighting, light):
    """Ask the light's shadow map, if it has one."""
    if lighting.shadow[light] != 0:
        call_row(lighting.shadow_function, rows.ctypes.data, n, lighting.shadow[light])


@helper
def add_light(rows, n, sums, reflected, color, is_first):
    """Add one light's reflection to the sums of one channel; the first one starts them."""
    zero = rows.dtype.type(0)
    for k in range(np.uint64(n)):
        before = zero if is_first else rows[sums + k]
        rows[sums + k] = before + color * rows[reflected + k]


@helper
def compose(rows, n, channel, source, number, has_albedo, is_shiny):
    """Turn the sums of one channel into intensities."""
    emissive, ambient = number[np.uint64(EMISSIVE) + channel], number[np.uint64(AMBIENT) + channel]
    diffuse, specular = number[np.uint64(DIFFUSE_COLOR) + channel], number[np.uint64(SPECULAR_COLOR) + channel]
    zero = rows.dtype.type(0)
    albedo_row, out_row = ALBEDO + channel * NEXT_CHANNEL, INTENSITY + channel * NEXT_CHANNEL
    diffuse_row, specular_row = DIFFUSE_SUM + source * NEXT_CHANNEL, SPECULAR_SUM + source * NEXT_CHANNEL
    for k in range(np.uint64(n)):
        matte = ambient + diffuse * rows[diffuse_row + k]
        if has_albedo:
            matte *= rows[albedo_row + k]
        shine = specular * rows[specular_row + k] if is_shiny else zero
        rows[out_row + k] = emissive + matte + shine


@kernel
def light_points(positions, normals, albedo, lift, start, stop, screen, side, lighting, material, rows, out_intensity):
    """Evaluate the illumination equation at surface points: the vertices of Gouraud's method, the centroids of flat
    shading.

    Parameters
    ----------
    positions, normals : (3, n) float64, world space; the normals have unit length. With BRUSHED lighting `normals` is
        (6, n): the tangents stand behind
    albedo : (n, n_channel) float64, read only if lighting.has_albedo
    lift : (n,) float64, scene units, see shadow_lookup.py; read only if a light casts shadows
    start, stop : the points to light
    side : 1 or -1, a factor of the normals; 0 flips every normal towards the viewer
    out_intensity : (n, n_channel) float32 or float64
    """
    number = rows.dtype.type
    positions, normals, rows = borrow(positions), borrow(normals), borrow(rows)
    back_x, back_y, back_z = -screen.forward
    for first in range(start, stop, CHUNK):
        n = min(CHUNK, stop - first)
        chunk = slice(np.uint64(first), np.uint64(first + n))
        take_points(positions[0, chunk], positions[1, chunk], positions[2, chunk], screen.eye, rows)
        if side == 0:
            turn_normals(positions[:, chunk], normals[:, chunk], screen, rows)
        else:
            take_normals(normals[0, chunk], normals[1, chunk], normals[2, chunk], float(side), rows)
        if lighting.has_albedo:
            for channel in range(np.uint64(lighting.n_channel)):
                for k in range(np.uint64(n)):
                    rows[ALBEDO + channel * NEXT_CHANNEL + k] = number(albedo[np.uint64(first) + k, channel])
        if lighting.needs_view and screen.is_perspective:
            view_from_position(rows, n)
        elif lighting.needs_view:
            view_from_direction(rows, n, number(back_x), number(back_y), number(back_z))
        take_shapes(lighting, lift, np.uint64(first), n, rows)
        take_tangents(lighting, normals, np.uint64(first), n, rows)
        light_rows(rows, n, lighting, material)
        for channel in range(np.uint64(lighting.n_channel)):
            for k in range(np.uint64(n)):
                out_intensity[np.uint64(first) + k, channel] = rows[INTENSITY + channel * NEXT_CHANNEL + k]


@helper
def take_points(x, y, z, eye, rows):
    """Copy positions, relative to the eye: subtracted in float64, before digits are dropped."""
    eye_x, eye_y, eye_z = eye
    for k in range(np.uint64(len(x))):
        rows[POSITION_X + k] = x[k] - eye_x
        rows[POSITION_Y + k] = y[k] - eye_y
        rows[POSITION_Z + k] = z[k] - eye_z


@helper
def take_normals(x, y, z, sign, rows):
    """Copy normals, or their opposites."""
    for k in range(np.uint64(len(x))):
        rows[NORMAL_X + k] = sign * x[k]
        rows[NORMAL_Y + k] = sign * y[k]
        rows[NORMAL_Z + k] = sign * z[k]


def take_tangents(lighting, normals, first, n, rows):
    """Fill the rows of tangents, which materials brushed along u need."""
    raise NotImplementedError("compiled code only")


@overload(take_tangents)
def _overload_take_tangents(lighting, normals, first, n, rows):
    if lighting.instance_class in BRUSHED:
        return copy_tangents
    return lambda lighting, normals, first, n, rows: None


def copy_tangents(lighting, normals, first, n, rows):
    """Copy the tangents, which stand behind the normals."""
    for k in range(np.uint64(n)):
        rows[TANGENT_X + k] = normals[3, first + k]
        rows[TANGENT_Y + k] = normals[4, first + k]
        rows[TANGENT_Z + k] = normals[5, first + k]


def take_shapes(lighting, lift, first, n, rows):
    """Fill the rows of planes and lifts, which shadows need."""
    raise NotImplementedError("compiled code only")


@overload(take_shapes)
def _overload_take_shapes(lighting, lift, first, n, rows):
    if issubclass(lighting.instance_class, ShadowedLighting):
        return take_own_planes
    return lambda lighting, lift, first, n, rows: None


def take_own_planes(lighting, lift, first, n, rows):
    """Of a point alone, its own normal is that of the surface's plane."""
    for k in range(np.uint64(n)):
        x, y, z = rows[NORMAL_X + k], rows[NORMAL_Y + k], rows[NORMAL_Z + k]
        rows[PLANE_X + k], rows[PLANE_Y + k], rows[PLANE_Z + k] = x, y, z
        rows[OFFSET + k] = x * rows[POSITION_X + k] + y * rows[POSITION_Y + k] + z * rows[POSITION_Z + k]
        rows[LIFT + k] = lift[first + k]


@helper
def turn_normals(positions, normals, screen, rows):
    """Copy normals, each turned to the side that the eye, or the viewer at infinity, is on.

    In float64: of a face that is far away and seen at a grazing angle, N·(P - eye) is the small difference of large
    numbers.
    """
    eye_x, eye_y, eye_z = screen.eye
    forward_x, forward_y, forward_z = screen.forward
    for k in range(np.uint64(positions.shape[1])):
        x, y, z = normals[0, k], normals[1, k], normals[2, k]
        away = x * forward_x + y * forward_y + z * forward_z
        if screen.is_perspective:
            away = x * (positions[0, k] - eye_x) + y * (positions[1, k] - eye_y) + z * (positions[2, k] - eye_z)
        sign = -1.0 if away > 0.0 else 1.0
        rows[NORMAL_X + k], rows[NORMAL_Y + k], rows[NORMAL_Z + k] = sign * x, sign * y, sign * z
