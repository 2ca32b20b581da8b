"""A light and a reflection model that the package doesn't have: help for the test of registries.

slab        parallel rays that are strongest in a plane across them: strength 1/(1 + (s/width)²), s the distance
            from the plane through `position`
minnaert    D = (N·L)² N·V, Minnaert 1941 with k = 2, as of the moon near full; and a highlight N·L N·V
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rasterizer import registries
from rasterizer.engine.lights import to_world
from rasterizer.geometry.vectors import dot, subtract
from rasterizer.pipeline.fragments import read_vector
from rasterizer.reference import vectors
from rasterizer.scene.color import linear_rgb
from rasterizer.scene.lights import Color, Shadow, Vector, checked_shadow
from rasterizer.scene.validate import choice, number, position3, unit3


@dataclass(frozen=True)
class SlabLight(registries.CustomLight):
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

    def numbers(self, frame):
        return [*-frame.vector(self.direction), *frame.point(self.position), 1.0 / self.width]

    @staticmethod
    def arrival(_normal, position, numbers):
        light_dir, one = read_vector(numbers, 0), numbers.dtype.type(1)
        share = dot(subtract(position, read_vector(numbers, 3)), light_dir) * numbers[6]
        return light_dir, one / (one + share * share)

    def beam(self, view):
        return registries.Beam(None, to_world(self.direction, self, view), 0.0)

    def reference(self, points, normals, frame):
        axis = frame.vector(self.direction)
        height = (points - frame.point(self.position)) @ axis
        return [(self.color, np.broadcast_to(-axis, points.shape), 1.0 / (1.0 + (height / self.width) ** 2))]


class Minnaert(registries.CustomReflection):
    """Minnaert's model, and a highlight."""

    @staticmethod
    def reflect(normal, light_dir, view_dir, _coefficients):
        n_dot_l, n_dot_v = dot(normal, light_dir), dot(normal, view_dir)
        product = n_dot_l * max(n_dot_v, n_dot_v - n_dot_v)
        return n_dot_l * product, product

    def reference(self, _materials, normals, light_dirs, view_dirs):
        n_dot_l = vectors.dot(normals, light_dirs)
        n_dot_v = np.maximum(vectors.dot(normals, view_dirs), 0.0)
        return n_dot_l**2 * n_dot_v, n_dot_l * n_dot_v


def add_slab():
    """Register the light."""
    return registries.add_light("slab", SlabLight)


def add_minnaert():
    """Register the reflection model."""
    return registries.add_reflection("minnaert", Minnaert)
