"""A plug-in: a light from the sky and from the ground, and Minnaert's reflection model with its exponent."""

from dataclasses import dataclass, replace

import numpy as np

from rasterizer.registries import (
    Color,
    CustomLight,
    CustomReflection,
    ReflectionModel,
    Vector,
    add_light,
    add_reflection,
    linear_rgb,
    unit3,
)


@dataclass(frozen=True)
class HemisphereLight(CustomLight):
    """Ambient light that is `color` from above and `ground` from below."""

    color: Color = 1.0
    ground: Color = 0.2
    up: Vector = (0.0, 1.0, 0.0)
    needs_position = False

    def __post_init__(self):
        for name in ("color", "ground"):
            object.__setattr__(self, name, linear_rgb(getattr(self, name), f"the hemisphere light's {name}"))
        object.__setattr__(self, "up", unit3(self.up, "the hemisphere light's up"))

    def parts(self):
        below = tuple(-component for component in self.up)
        return replace(self, ground=0.0), replace(self, color=self.ground, ground=0.0, up=below)

    def numbers(self, frame):
        return frame.vector(self.up)

    @staticmethod
    def share(normal, position, up):
        return 0.5 + 0.5 * (normal[0] * up[0] + normal[1] * up[1] + normal[2] * up[2])

    def reference(self, points, normals, frame):
        sky = (1.0 + normals @ frame.vector(self.up)) / 2.0
        return [(self.color, None, sky), (self.ground, None, 1.0 - sky)]


@dataclass(frozen=True)
class HastyLight(HemisphereLight):
    """One whose numbers can't be had."""

    def numbers(self, frame):
        return {}["numbers"] if self.color != (1.0, 1.0, 1.0) else frame.vector(self.up)


class Minnaert(CustomReflection):
    """Minnaert 1941: (N·L)^k (N·V)^(k - 1); k is the model's own number, 1 is Lambert's."""

    has_highlight = False
    model = ReflectionModel(numbers=(1.0,))

    @staticmethod
    def reflect(normal, light_dir, view_dir, coefficients):
        n_dot_l = normal[0] * light_dir[0] + normal[1] * light_dir[1] + normal[2] * light_dir[2]
        n_dot_v = normal[0] * view_dir[0] + normal[1] * view_dir[1] + normal[2] * view_dir[2]
        k = coefficients.numbers[0]
        return n_dot_l**k * max(n_dot_v, 1e-3) ** (k - 1.0), 0.0 * k

    def reference(self, materials, normals, light_dirs, view_dirs):
        n_dot_l, n_dot_v = ((normals * each).sum(axis=1) for each in (light_dirs, view_dirs))
        k = materials["numbers"][:, 0]
        return np.maximum(n_dot_l, 0.0) ** k * np.maximum(n_dot_v, 1e-3) ** (k - 1.0), np.zeros(len(normals))


def enter_hemisphere():
    """Enter the light."""
    add_light("hemisphere", HemisphereLight)


def enter_minnaert():
    """Enter the reflection model."""
    add_reflection("minnaert", Minnaert)


def enter_hasty():
    """Enter a light that fails when it is drawn."""
    add_light("hasty", HastyLight, examples=[HastyLight()])


def enter_nothing_and_fail():
    """Fail."""
    raise RuntimeError("the moon is down")
