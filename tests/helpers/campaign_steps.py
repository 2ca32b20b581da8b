"""Where pictures jump, as frames state it: help for the campaign.

`frame.stats.steps` lists causes, and how near to each of them no bound holds. Here the reference draws the scene again,
and what is lit so near to a step becomes NaN: whatever pixel that reaches is next to a step.
"""

from contextlib import ExitStack
from unittest.mock import patch

import numpy as np

from rasterizer import reference
from rasterizer.reference import lamp as lamps
from rasterizer.reference import shading
from rasterizer.reference.light import to_viewer
from rasterizer.reference.reflection import channels_of
from rasterizer.reference.vectors import blend, dot, length, unit

# Words that the causes of `frame.stats.steps` are known by.
LEVELS, GRAZES, HALF, AWAY, CONE = "toon", "grazes", "half vector", "looks away from the viewer, N·H = 0", "sharp spot"
BASE = "exponent below 1"
OPPOSITE = "opposite to him"
TEXELS, NEAR_LIGHT, SHORT, SHADOW = "texels", "light on a surface", "without length", "shadow"
CAUSES = (LEVELS, GRAZES, HALF, AWAY, OPPOSITE, CONE, TEXELS, NEAR_LIGHT, SHORT, SHADOW, BASE)


def next_to_step(case, steps) -> np.ndarray:
    """Tell which pixels (h, w) have a sample next to one of the steps (cause, near, unit) that a frame states."""
    near = {}
    for cause, distance, _ in steps:
        if not np.isfinite(distance):
            continue  # no step, but why nothing is stated
        (word,) = (word for word in CAUSES if word in cause)
        near[word] = max(distance, near.get(word, 0.0))
    if not near:
        return np.zeros((case.size[1], case.size[0]), bool)
    marker = Marker(near)
    settings = {name: value for name, value in case.options.items() if name != "tolerance"}
    with ExitStack() as stack, np.errstate(all="ignore"):
        for name in ("light_points", "sample_normals", "sample_texture"):
            stack.enter_context(patch.object(shading, name, getattr(marker, name)))
        color = reference.render(case.scene, case.size, **settings).color
    return ~np.isfinite(color).all(axis=-1)


class Marker:
    """Stands in for functions of the reference, and marks what lies next to a step with NaN.

    `near` is a dict from a cause's word to how near to it no bound holds.
    """

    def __init__(self, near: dict):
        self.near = near
        self._normals, self._light, self._texels = shading.sample_normals, shading.light_points, shading.sample_texture
        self._is_short = None  # of the samples whose normals were found last

    def sample_normals(self, surface, part, *others):
        """Normals, remembering which of them were interpolated to almost nothing."""
        if SHORT in self.near:
            self._is_short = length(blend(part.weights, surface.normals[part.face]))[:, 0] < self.near[SHORT]
        return self._normals(surface, part, *others)

    def sample_texture(self, texture, uv, steps):
        """Texels; NaN next to the border of one."""
        texels = self._texels(texture, uv, steps)
        if TEXELS in self.near and texture.filter == "nearest":
            height, width = texture.image.shape[:2]
            places = np.stack([uv[:, 0] * width, (1.0 - uv[:, 1]) * height], axis=1)
            texels[(np.abs(places - np.rint(places)) <= self.near[TEXELS]).any(axis=1)] = np.nan
        return texels

    def light_points(self, points, normals, material, lighting, *others):
        """Both parts of the light; NaN next to a step."""
        diffuse, specular = self._light(points, normals, material, lighting, *others)
        is_near = np.zeros(len(points), bool)
        if self._is_short is not None and len(self._is_short) == len(points):
            is_near |= self._is_short
            self._is_short = None
        table, view_dirs = lighting.materials[material], to_viewer(points, lighting)
        for lamp in lamps.make_lamps(lighting.lights, lighting.view, lambda color: channels_of(color, lighting.n_wave)):
            to_light, _ = lamps.arriving_light(lamp, points)
            if NEAR_LIGHT in self.near and lamp.position is not None:
                is_near |= length(lamp.position - points)[:, 0] < self.near[NEAR_LIGHT]
            if CONE in self.near and hasattr(lamp.light, "outer"):
                inner, outer = np.cos(np.radians([lamp.light.inner, lamp.light.outer]))
                cosines, near = -dot(to_light, lamp.axis), self.near[CONE]
                is_edge = (outer - near <= cosines) & (cosines <= (inner if inner - outer < near else outer) + near)
                is_near |= is_edge
            is_near |= self._is_near_model_step(table, normals, to_light, view_dirs)
        return np.where(is_near[:, None], np.nan, diffuse), specular

    def _is_near_model_step(self, table, normals, to_light, view_dirs):
        """Tell of points whether their material's model jumps near them, (n,) bool."""
        model, near = table["reflection"], self.near
        is_near = np.zeros(len(table), bool)
        n_dot_l = dot(normals, to_light)
        if LEVELS in near:
            steps = table["levels"] * n_dot_l
            mirrored = dot(2 * n_dot_l[:, None] * normals - to_light, view_dirs)
            is_at = np.abs(steps - np.rint(steps)) <= table["levels"] * near[LEVELS]
            is_at |= np.abs(mirrored - 0.5 ** (1 / table["shininess"])) <= near[LEVELS]
            is_near |= (model == "toon") & is_at
        if GRAZES in near:
            is_near |= np.isin(model, ("phong", "blinn")) & ~table["normalized"] & (np.abs(n_dot_l) <= near[GRAZES])
        if BASE in near:
            halves = dot(normals, unit(to_light + view_dirs))
            bases = np.where(model == "blinn", halves, dot(2 * n_dot_l[:, None] * normals - to_light, view_dirs))
            is_begun = np.isin(model, ("phong", "blinn")) & (table["shininess"] < 1.0)
            is_near |= is_begun & (np.abs(bases) <= near[BASE])
        if HALF in near:
            is_near |= (model == "blinn") & (length(to_light + view_dirs)[:, 0] < near[HALF])
        if OPPOSITE in near:
            is_near |= (model == "cook-torrance") & (length(to_light + view_dirs)[:, 0] < near[OPPOSITE])
        if AWAY in near:
            is_near |= (model == "cook-torrance") & (np.abs(dot(normals, unit(to_light + view_dirs))) <= near[AWAY])
        return is_near
