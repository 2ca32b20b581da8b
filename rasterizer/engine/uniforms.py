"""The illumination of a scene as arrays, for one view: what light and reflection functions read (pipeline/lighting.py).

Lights and materials write their own coefficients, see engine/light_table.py and engine/reflection_table.py.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import row_function
from ..pipeline import material_coefficients as m
from ..pipeline.fresnel import no_second_term
from ..pipeline.light_kinds import N_LIGHT_COEFFICIENT, same_light_again
from ..pipeline.lighting import Lighting, ShadowMaps
from ..pipeline.shadow_lookup import occlude
from ..scene.camera import View
from . import light_table, reflection_table
from .plan import Plan
from .reflection_table import has_colored_fresnel, has_highlight
from .spectral_products import split_fresnel

if TYPE_CHECKING:  # shadow maps are drawn, and what is drawn is lit
    from .shadow_maps import ShadowMap

_COLORS = (m.EMISSION, m.AMBIENT, m.DIFFUSE, m.SPECULAR)


def make_lighting(
    plan: Plan, view: View, shadows: "Sequence[ShadowMap | None]" = (), is_perspective: bool = True
) -> Lighting:
    """Write lights and materials as arrays, for one view.

    Parameters
    ----------
    shadows : the shadow map of each light, or None; nothing where no light has one. Whoever draws keeps them until the
        picture is done
    is_perspective : whether the viewer has a position
    """
    lights, materials = _light_coefficients(plan, view), _material_coefficients(plan)
    colors, n_light_channel = _light_colors(plan)
    functions = [reflection_table.entry_of(material).function(material) for material in plan.materials]
    is_view_dependent = np.array([function.needs_view for function in functions], np.bool_)
    of_lights, of_materials = functions_of(plan, is_perspective)
    if has_two_terms(plan):  # each light is followed by itself
        lights = np.repeat(lights, 2, axis=0)
        shadows = [part for shadow in shadows for part in (shadow, None)]
    return Lighting(
        light_functions=_addresses(of_lights, plan.dtype),
        lights=lights.astype(plan.dtype),
        reflection_functions=np.stack([_addresses(functions, plan.dtype) for functions in of_materials]),
        materials=materials.astype(plan.dtype),
        has_highlight=np.array([has_highlight(material) for material in plan.materials], np.bool_),
        is_view_dependent=is_view_dependent,
        n_channel=plan.n_channel,
        n_light_channel=n_light_channel,
        needs_view=bool(is_view_dependent.any()),
        needs_position=plan.has_shadows or light_table.any_needs_position(plan.lights),
        has_albedo=plan.has_albedo,
        colors=colors.astype(plan.dtype),
        shadows=_shadow_addresses(shadows, plan.dtype) if plan.has_shadows else None,
    )


def _shadow_addresses(shadows, dtype) -> ShadowMaps:
    """The addresses of the lights' shadow maps, and of what looks them up."""
    maps = [0 if shadow is None else shadow.block.ctypes.data for shadow in shadows]
    return ShadowMaps(row_function(occlude, dtype).address, np.array(maps, np.int64))


def _light_coefficients(plan, view) -> NDArray[np.float64]:
    """The coefficients of each light, (n_light, N_LIGHT_COEFFICIENT)."""
    coefficients = np.zeros((len(plan.lights), N_LIGHT_COEFFICIENT))
    for row, light in zip(coefficients, plan.lights, strict=True):
        light_table.entry_of(light).write(row, light, view, plan.dtype)
    return coefficients


def _material_coefficients(plan) -> NDArray[np.float64]:
    """The coefficients of each material, as far as lights are no part of them, (n_material, N_MATERIAL_COEFFICIENT)."""
    coefficients = np.zeros((len(plan.materials), m.N_MATERIAL_COEFFICIENT))
    for k, (row, material) in enumerate(zip(coefficients, plan.materials, strict=True)):
        reflection_table.entry_of(material).write(row, material)
        colors = material.emissive, np.array(material.ambient) * plan.ambient, material.diffuse, material.specular
        if plan.products is not None:
            colors = plan.products.emissive[k], plan.products.ambient[k], (1.0, 1.0, 1.0), (1.0, 1.0, 1.0)
        for first, color in zip(_COLORS, colors, strict=True):
            row[first : first + 3] = color
        if plan.n_channel == 1:  # the largest component: all are grey or multiples of the picture's tint
            for first in _COLORS:
                row[first] = row[first : first + 3].max()
    if plan.dtype == np.float32:
        # An exponent that float32 has no number for raises all cosines to 0 or 1, as the nearest one that it has does.
        limits = np.finfo(np.float32)
        np.clip(coefficients[:, m.SHININESS], limits.tiny, limits.max, out=coefficients[:, m.SHININESS])
    return coefficients


def _light_colors(plan) -> tuple[NDArray[np.float64], int]:
    """What the sums over the lights are weighted with, (1 or n_material, n_light, 6), and how many channels they need.

    With two terms a light (see `has_two_terms`), n_light is twice the number of lights.
    """
    n_light = len(plan.lights)
    if has_two_terms(plan):
        return _term_colors(plan), 3
    if plan.products is not None:
        return np.concatenate([plan.products.diffuse, plan.products.specular], axis=2), 3
    colors = np.array([light.color for light in plan.lights]).reshape(n_light, 3)
    is_grey = bool((np.ptp(colors, axis=1) == 0).all()) if n_light else True
    if plan.n_channel == 1:
        colors = np.repeat(colors.max(axis=1, keepdims=True, initial=0.0), 3, axis=1)
    return np.concatenate([colors, colors], axis=1)[None], 1 if is_grey or plan.n_channel == 1 else 3


def has_two_terms(plan: Plan) -> bool:
    """Tell whether the light of each light is summed in two terms, because some material's F0 has a colour.

    The second term is that of pipeline/fresnel.py; it follows the first as if it were another light's.
    """
    return any(has_colored_fresnel(material) for material in plan.materials)


def _term_colors(plan) -> NDArray[np.float64]:
    """What the sums over both terms of the lights are weighted with, (n_material, 2·n_light, 6)."""
    colors = np.zeros((len(plan.materials), 2 * len(plan.lights), 6))
    if plan.products is not None:
        colors[:, ::2, :3], colors[:, ::2, 3:] = plan.products.diffuse, plan.products.specular
        colors[:, 1::2, 3:] = plan.products.grazing
        return colors
    of_lights = np.array([light.color for light in plan.lights]).reshape(1, -1, 3)
    first, rest = split_fresnel(plan.materials)
    colors[:, ::2, :3], colors[:, ::2, 3:] = of_lights, of_lights * first[:, None]
    colors[:, 1::2, 3:] = of_lights * rest[:, None]
    return colors


def functions_of(plan: Plan, is_perspective: bool) -> tuple[list[Callable], list[list[Callable]]]:
    """List the functions that a scene uses; nothing else is compiled.

    Returns
    -------
    light functions : one a light
    reflection functions : for each material, one a light; with two terms a light (see `has_two_terms`), each is
        followed by that of its second term
    """
    entries = [light_table.entry_of(light) for light in plan.lights]
    of_lights = [entry.function(light).evaluate for entry, light in zip(entries, plan.lights, strict=True)]
    of_materials = []
    for material in plan.materials:
        function = reflection_table.entry_of(material).function(material)
        distant = function.evaluate if is_perspective or function.distant is None else function.distant
        of_materials.append([distant if entry.is_distant else function.evaluate for entry in entries])
    if not has_two_terms(plan):
        return of_lights, of_materials
    for material, functions in zip(plan.materials, of_materials, strict=True):
        functions[:] = [part for function in functions for part in (function, _second_term(material))]
    return [part for function in of_lights for part in (function, same_light_again)], of_materials


def _second_term(material) -> Callable:
    """The function of the second term of a material's highlight, in a scene where some material has one."""
    function = reflection_table.entry_of(material).function(material)
    return function.second_term if has_colored_fresnel(material) else no_second_term


def _addresses(functions, dtype) -> NDArray[np.int64]:
    """Compile functions for batches; return their addresses."""
    return np.array([row_function(function, dtype).address for function in functions], np.int64)
