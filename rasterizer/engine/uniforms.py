"""The illumination of a scene as arrays, for one view: what the row functions of lights and materials read
(pipeline/lighting.py)."""

import numpy as np

from ..compiler.kernels import row_function
from ..pipeline.fresnel import no_second_part
from ..pipeline.light_kinds import N_NUMBER, same_again
from ..pipeline.lighting import (
    AMBIENT,
    DIFFUSE_COLOR,
    EMISSIVE,
    N_MATERIAL_COLUMN,
    SPECULAR_COLOR,
    BrushedLighting,
    Lighting,
    ShadowedBrushedLighting,
    ShadowedLighting,
)
from ..pipeline.reflection import (
    BRUSH,
    FRESNEL,
    LEVELS,
    ROUGHNESS,
    ROUGHNESS_ACROSS,
    SCALE,
    SHININESS,
)
from ..pipeline.shadow_lookup import cast
from . import light_table, reflection_table
from .plan import Plan
from .reflection_table import first_fresnel, has_colored_fresnel, has_highlight
from .spectral_products import split_fresnel

LIGHTINGS = {  # by whether a light casts shadows, and whether a material needs tangents from u
    (False, False): Lighting,
    (True, False): ShadowedLighting,
    (False, True): BrushedLighting,
    (True, True): ShadowedBrushedLighting,
}
_COLUMNS = (EMISSIVE, AMBIENT, DIFFUSE_COLOR, SPECULAR_COLOR)


def make_lighting(plan: Plan, view, shadows=(), is_perspective=True) -> Lighting:
    """Write lights and materials as arrays, for one view.

    `shadows` holds a light's shadow map (see engine/shadow_maps.py), or None, for each light; nothing where no light
    has one. Whoever draws keeps it until the picture is done.
    """
    light, material = _list_lights(plan, view), _list_materials(plan)
    color, n_light_channel = _color_lights(plan)
    is_shiny = np.array([has_highlight(source) for source in plan.materials], np.bool_)
    models = [reflection_table.entry_of(source).function(source) for source in plan.materials]
    is_view_dependent = np.array([model.needs_view for model in models], np.bool_)
    of_lights, of_materials = row_functions_of(plan, is_perspective)
    if is_parted(plan):  # each light is followed by itself
        light = np.repeat(light, 2, axis=0)
        shadows = [part for shadow in shadows for part in (shadow, None)]
    return LIGHTINGS[plan.has_shadows, plan.has_tangents](
        light_function=_addresses(of_lights, plan.dtype),
        light=light.astype(plan.dtype),
        reflection_function=np.stack([_addresses(functions, plan.dtype) for functions in of_materials]),
        material=material.astype(plan.dtype),
        is_shiny=is_shiny,
        is_view_dependent=is_view_dependent,
        n_channel=plan.n_channel,
        n_light_channel=n_light_channel,
        needs_view=bool(is_view_dependent.any()),
        needs_position=plan.has_shadows
        or any(light_table.entry_of(source).function(source).needs_position for source in plan.lights),
        has_albedo=plan.has_albedo,
        color=color.astype(plan.dtype),
        shadow_function=row_function(cast, plan.dtype).address if plan.has_shadows else 0,
        shadow=np.array([0 if shadow is None else shadow.block.ctypes.data for shadow in shadows], np.int64),
    )


def _list_lights(plan, view) -> np.ndarray:
    """The coefficients of each light, a row a light."""
    coefficients = np.zeros((len(plan.lights), N_NUMBER))
    for row, source in zip(coefficients, plan.lights, strict=True):
        light_table.entry_of(source).write(row, source, view, plan.dtype)
    return coefficients


def _list_materials(plan) -> np.ndarray:
    """A row of numbers for each material: those of its model, then its coefficients, as far as lights are no part of
    them."""
    material = np.zeros((len(plan.materials), N_MATERIAL_COLUMN))
    for k, (row, source) in enumerate(zip(material, plan.materials, strict=True)):
        row[SHININESS], row[LEVELS] = source.shininess, source.levels
        row[ROUGHNESS] = row[ROUGHNESS_ACROSS] = source.roughness if isinstance(source.roughness, float) else 0.0
        if isinstance(source.roughness, tuple):
            row[ROUGHNESS], row[ROUGHNESS_ACROSS] = source.roughness
        if not isinstance(source.tangent, str):
            row[BRUSH : BRUSH + 3] = source.tangent
        row[FRESNEL], row[SCALE] = first_fresnel(source), reflection_table.entry_of(source).highlight_scale(source)
        colors = (source.emissive, np.array(source.ambient) * plan.ambient, source.diffuse, source.specular)
        if plan.products is not None:
            colors = (plan.products.emissive[k], plan.products.ambient[k], (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
        for column, color in zip(_COLUMNS, colors, strict=True):
            row[column : column + 3] = color
        if plan.n_channel == 1:  # the largest component: all are grey or multiples of the picture's tint
            for column in _COLUMNS:
                row[column] = row[column : column + 3].max()
    if plan.dtype == np.float32:
        # An exponent that float32 has no number for raises all cosines to 0 or 1, as the nearest one that it has does.
        limits = np.finfo(np.float32)
        np.clip(material[:, SHININESS], limits.tiny, limits.max, out=material[:, SHININESS])
    return material


def _color_lights(plan) -> tuple[np.ndarray, int]:
    """What the sums over the lights are weighted with, (1 or n_material, n_light, 6), and how many channels they need.

    With two terms a light (see `is_parted`), n_light is twice the number of lights.
    """
    n_light = len(plan.lights)
    if is_parted(plan):
        return _color_parts(plan), 3
    if plan.products is not None:
        return np.concatenate([plan.products.diffuse, plan.products.specular], axis=2), 3
    colors = np.array([light.color for light in plan.lights]).reshape(n_light, 3)
    is_grey = bool((np.ptp(colors, axis=1) == 0).all()) if n_light else True
    if plan.n_channel == 1:
        colors = np.repeat(colors.max(axis=1, keepdims=True, initial=0.0), 3, axis=1)
    return np.concatenate([colors, colors], axis=1)[None], 1 if is_grey or plan.n_channel == 1 else 3


def is_parted(plan: Plan) -> bool:
    """Tell whether the light of each light is summed in two terms, because some material's F0 has a colour.

    The second term is that of pipeline/fresnel.py; it follows the first as if it were another light's.
    """
    return any(has_colored_fresnel(material) for material in plan.materials)


def _color_parts(plan) -> np.ndarray:
    """What the sums over both terms of the lights are weighted with, (n_material, 2·n_light, 6)."""
    color = np.zeros((len(plan.materials), 2 * len(plan.lights), 6))
    if plan.products is not None:
        color[:, ::2, :3], color[:, ::2, 3:] = plan.products.diffuse, plan.products.specular
        color[:, 1::2, 3:] = plan.products.grazing
        return color
    of_lights = np.array([light.color for light in plan.lights]).reshape(1, -1, 3)
    first, rest = split_fresnel(plan.materials)
    color[:, ::2, :3], color[:, ::2, 3:] = of_lights, of_lights * first[:, None]
    color[:, 1::2, 3:] = of_lights * rest[:, None]
    return color


def row_functions_of(plan: Plan, is_perspective: bool) -> tuple[list, list]:
    """The row functions that a scene uses; nothing else is compiled: one for each light, and for each material one a
    light.

    With two terms a light (see `is_parted`), each is followed by that of its second term.
    """
    lights = [light_table.entry_of(source) for source in plan.lights]
    of_lights = [entry.function(source).row_function for entry, source in zip(lights, plan.lights, strict=True)]
    of_materials = []
    for material in plan.materials:
        model = reflection_table.entry_of(material)
        usual = model.function(material).row_function
        distant = usual if is_perspective else model.distant_function(material)
        of_materials.append([distant if entry.is_distant else usual for entry in lights])
    if not is_parted(plan):
        return of_lights, of_materials
    seconds = [_second_function(material) for material in plan.materials]
    of_materials = [
        [part for function in functions for part in (function, second)]
        for functions, second in zip(of_materials, seconds, strict=True)
    ]
    return [part for function in of_lights for part in (function, same_again)], of_materials


def _second_function(material):
    """The function of the second term of a material's highlight, in a scene where some material has one."""
    return reflection_table.entry_of(material).second_function if has_colored_fresnel(material) else no_second_part


def _addresses(functions, dtype) -> np.ndarray:
    """Compile row functions; return their addresses, int64."""
    return np.array([row_function(function, dtype).address for function in functions], np.int64)
