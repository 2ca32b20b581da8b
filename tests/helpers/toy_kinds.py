"""A light and a reflection model that the package doesn't have, said in every layer: help for the test of registries.

slab        parallel rays that are strongest in a plane across them: strength 1/(1 + (s/width)²), s the distance
            from the plane through `position`
minnaert    D = (N·L)² N·V, Minnaert 1941 with k = 2, as of the moon near full; and a highlight N·L N·V
"""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numba import carray

from rasterizer import registries
from rasterizer.compiler.kernels import index
from rasterizer.engine.lights import Beam, LightEntry, is_carried, to_world, world_direction
from rasterizer.engine.reflections import ReflectionEntry
from rasterizer.geometry.vectors import dot
from rasterizer.pipeline import fragments as f
from rasterizer.pipeline import light_kinds
from rasterizer.pipeline.fragments import get_vector, read_vector, set_vector
from rasterizer.pipeline.reflection import ReflectionFunction
from rasterizer.reference import vectors
from rasterizer.reference.lamp import LampKind
from rasterizer.reference.reflection import ReflectionKind
from rasterizer.scene.color import linear_rgb
from rasterizer.scene.lights import Color, Shadow, Vector, checked_shadow
from rasterizer.scene.validate import choice, number, position3, unit3

# ---------------------------------------------------------------- the light

OFFSET, INVERSE_WIDTH = light_kinds.MOST, light_kinds.INVERSE_RANGE  # coefficients whose room a slab uses


@dataclass(frozen=True)
class SlabLight:
    """Parallel rays that are strongest in a plane."""

    direction: Vector
    position: Vector = (0.0, 0.0, 0.0)
    width: float = 1.0
    color: Color = 1.0
    attached: Literal["world", "camera"] = "world"
    shadow: Shadow | None = None

    def __post_init__(self):
        choice(self.attached, ("world", "camera"), "the slab light's attached")
        for name, value in (
            ("direction", unit3(self.direction, "the slab light's direction")),
            ("position", position3(self.position, "the slab light's position")),
            ("width", number(self.width, "the slab light's width")),
            ("color", linear_rgb(self.color, "the slab light's color")),
            ("shadow", checked_shadow(self.shadow, "the slab light's")),
        ):
            object.__setattr__(self, name, value)


def slab(batch, n, light):
    """The pipeline's function: VECTOR is the unit direction to the light."""
    batch, light = carray(batch, f.BATCH_SHAPE), carray(light, light_kinds.LIGHT_SHAPE)
    one = light.dtype.type(1)
    light_dir = read_vector(light, light_kinds.VECTOR)
    for k in range(index(n)):
        share = (dot(get_vector(batch, f.POSITION, k), light_dir) - light[OFFSET]) * light[INVERSE_WIDTH]
        batch[f.N_DOT_L + k] = dot(get_vector(batch, f.NORMAL, k), light_dir)
        set_vector(batch, f.LIGHT_DIR, k, light_dir)
        batch[f.STRENGTH + k] = one / (one + share * share)


class SlabEntry(LightEntry):
    """What the engine knows of a slab light."""

    is_distant = True

    def function(self, light):
        return light_kinds.LightFunction(slab, needs_position=True)

    def write(self, coefficients, light, view, dtype):
        to_light = -world_direction(light, view)
        position = to_world(light.position, light, view)
        relative = position if is_carried(light) else position - view.eye
        coefficients[light_kinds.VECTOR : light_kinds.VECTOR + 3] = to_light
        coefficients[OFFSET], coefficients[INVERSE_WIDTH] = relative @ to_light, 1.0 / light.width

    def beam(self, light, view):
        return Beam(None, world_direction(light, view), 0.0)

    def clearance(self, light, view, distance):
        return light.width  # the relative slope 2 s/width² / (1 + (s/width)²) is 1/width at most

    def lengths(self, light):
        return (light.width, 1.0 / light.width)


class SlabKind(LampKind):
    """How the reference evaluates a slab light."""

    def lamps_of(self, light, frame, color, index):
        (lamp,) = super().lamps_of(light, frame, color, index)
        return [lamp._replace(light=replace(light, position=tuple(frame.point(light.position))))]

    def attenuate(self, lamp, points):
        light_dirs, _ = super().attenuate(lamp, points)
        height = vectors.dot(points - np.array(lamp.light.position), -lamp.axis)[:, None]
        return light_dirs, 1.0 / (1.0 + (height / lamp.light.width) ** 2)


# ---------------------------------------------------------------- the reflection model


def minnaert(batch, n, _material):
    """The pipeline's function."""
    batch = carray(batch, f.BATCH_SHAPE)
    zero = batch.dtype.type(0)
    for k in range(index(n)):
        n_dot_l, strength = batch[f.N_DOT_L + k], batch[f.STRENGTH + k]
        product = n_dot_l * max(batch[f.N_DOT_V + k], zero)
        batch[f.DIFFUSE + k] = strength * (n_dot_l * product) if n_dot_l > zero else zero
        batch[f.SPECULAR + k] = strength * product if n_dot_l > zero else zero


class MinnaertEntry(ReflectionEntry):
    """What the engine knows of Minnaert's model."""

    def function(self, material):
        return ReflectionFunction(minnaert, needs_view=True, has_highlight=True)

    def brightest_highlight(self, material):
        return 1.0

    def diffuse_slope(self, material):
        return 2.0  # three cosines instead of one

    def turn_slope(self, material):
        return 2.0  # two cosines

    def highlight_rounding(self, material, u):
        return 60.0 * u  # N·L 16 u, N·V 22 u, the strength 5 u, products, and to spare


def reflect_minnaert(_table, normals, light_dirs, view_dirs, _tangents):
    """The reference's D and S; S is weighted with 1."""
    n_dot_l = vectors.dot(normals, light_dirs)
    n_dot_v = np.maximum(vectors.dot(normals, view_dirs), 0.0)
    return n_dot_l**2 * n_dot_v, n_dot_l * n_dot_v, None


# ---------------------------------------------------------------- both


def add_slab():
    """Register the light."""
    return registries.add_light("slab", SlabLight, drawn=SlabEntry(), reference=SlabKind())


def add_minnaert():
    """Register the reflection model."""
    return registries.add_reflection("minnaert", drawn=MinnaertEntry(), reference=ReflectionKind(reflect_minnaert))


def slab_strength(points, position, direction, width):
    """What arrives of a slab light of the world at points (n, 3), by hand."""
    direction = np.asarray(direction, float) / math.hypot(*direction)
    return 1.0 / (1.0 + (((points - np.asarray(position)) @ direction) / width) ** 2)
