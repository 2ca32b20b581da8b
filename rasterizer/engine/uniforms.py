"""The illumination of a scene as arrays, for one view: what the batch functions of lights and materials read
(pipeline/lighting.py)."""

import numpy as np

from ..compiler.kernels import batch_function
from ..pipeline import material_coefficients as m
from ..pipeline.fresnel import no_second_term
from ..pipeline.light_kinds import (
    ATTENUATION,
    AXIS,
    CONE_EXPONENT,
    CONE_FALLOFF,
    CONE_SCALE,
    COS_OUTER,
    INVERSE_RANGE,
    MOST,
    N_LIGHT_COEFFICIENT,
    VECTOR,
    light_function_of,
    same_light_again,
)
from ..pipeline.lighting import Lighting, ShadowMaps
from ..pipeline.reflection import reflection_function_of
from ..pipeline.shadow_lookup import occlude
from ..scene.lights import DirectionalLight, SpotLight
from .intensity_bounds import (
    cone_cosines,
    first_fresnel,
    has_colored_fresnel,
    has_highlight,
    highlight_scale,
    kind_of,
    model_of,
)
from .plan import Plan
from .spectral_products import split_fresnel

_COLUMNS = (m.EMISSION, m.AMBIENT, m.DIFFUSE, m.SPECULAR)


def make_lighting(plan: Plan, view, shadows=(), is_perspective=True) -> Lighting:
    """Write lights and materials as arrays, for one view.

    `shadows` holds a light's shadow map (see engine/shadow_maps.py), or None, for each light; nothing where no light
    has one. Whoever draws keeps it until the picture is done.
    """
    light, material = _list_lights(plan, view), _list_materials(plan)
    color, n_light_channel = _color_lights(plan)
    highlights = np.array([has_highlight(source) for source in plan.materials], np.bool_)
    models = [reflection_function_of(model_of(source)) for source in plan.materials]
    is_view_dependent = np.array([model.needs_view for model in models], np.bool_)
    of_lights, of_materials = batch_functions_of(plan, is_perspective)
    if is_parted(plan):  # each light is followed by itself
        light = np.repeat(light, 2, axis=0)
        shadows = [part for shadow in shadows for part in (shadow, None)]
    return Lighting(
        light_functions=_addresses(of_lights, plan.dtype),
        lights=light.astype(plan.dtype),
        reflection_functions=np.stack([_addresses(functions, plan.dtype) for functions in of_materials]),
        materials=material.astype(plan.dtype),
        has_highlight=highlights,
        is_view_dependent=is_view_dependent,
        n_channel=plan.n_channel,
        n_light_channel=n_light_channel,
        needs_view=bool(is_view_dependent.any()),
        needs_position=plan.has_shadows
        or any(light_function_of(kind_of(source)).needs_position for source in plan.lights),
        has_albedo=plan.has_albedo,
        colors=color.astype(plan.dtype),
        shadows=_list_shadows(shadows, plan.dtype) if plan.has_shadows else None,
    )


def _list_shadows(shadows, dtype) -> ShadowMaps:
    """The addresses of the lights' shadow maps, and of what looks them up."""
    maps = [0 if shadow is None else shadow.block.ctypes.data for shadow in shadows]
    return ShadowMaps(batch_function(occlude, dtype).address, np.array(maps, np.int64))


def _list_lights(plan, view) -> np.ndarray:
    """A row of numbers for each light; those that move with the camera are turned to the world, positions are relative
    to the eye."""
    light = np.zeros((len(plan.lights), N_LIGHT_COEFFICIENT))
    for row, source in zip(light, plan.lights, strict=True):
        if isinstance(source, DirectionalLight):
            row[VECTOR : VECTOR + 3] = world_direction(source, view) * -1.0
            continue
        position = _to_world(source.position, source, view)
        row[VECTOR : VECTOR + 3] = position if source.attached == "camera" else position - view.eye
        row[ATTENUATION : ATTENUATION + 3] = source.attenuation
        row[MOST] = np.inf if source.amplify else 1.0
        row[INVERSE_RANGE] = 1.0 / source.range if source.range is not None else 0.0
        if isinstance(source, SpotLight):
            row[AXIS : AXIS + 3] = world_direction(source, view)
            inner, outer = cone_cosines(source)
            row[COS_OUTER], row[CONE_EXPONENT], row[CONE_FALLOFF] = outer, source.exponent, source.falloff
            row[CONE_SCALE] = 1.0 / (inner - outer) if inner > outer else np.inf
            if plan.dtype == np.float32:
                row[CONE_EXPONENT] = min(row[CONE_EXPONENT], np.finfo(np.float32).max)
    return light


def _list_materials(plan) -> np.ndarray:
    """A row of numbers for each material: those of its model, then its coefficients, as far as lights are no part of
    them."""
    material = np.zeros((len(plan.materials), m.N_MATERIAL_COEFFICIENT))
    for k, (row, source) in enumerate(zip(material, plan.materials, strict=True)):
        row[m.SHININESS], row[m.TOON_LEVELS] = source.shininess, source.levels
        row[m.ROUGHNESS] = row[m.ROUGHNESS_ACROSS] = source.roughness if isinstance(source.roughness, float) else 0.0
        if isinstance(source.roughness, tuple):
            row[m.ROUGHNESS], row[m.ROUGHNESS_ACROSS] = source.roughness
        if not isinstance(source.tangent, str):
            row[m.TANGENT_AXIS : m.TANGENT_AXIS + 3] = source.tangent
        row[m.FRESNEL], row[m.HIGHLIGHT_SCALE] = first_fresnel(source), highlight_scale(source)
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
        np.clip(material[:, m.SHININESS], limits.tiny, limits.max, out=material[:, m.SHININESS])
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


def batch_functions_of(plan: Plan, is_perspective: bool) -> tuple[list, list]:
    """The batch functions that a scene uses; nothing else is compiled: one for each light, and for each material one a
    light.

    With two terms a light (see `is_parted`), each is followed by that of its second term.
    """
    of_lights = [light_function_of(kind_of(source)).evaluate for source in plan.lights]
    of_materials = []
    for material in plan.materials:
        model = reflection_function_of(model_of(material))
        usual = model.evaluate
        distant = usual if is_perspective else model.distant or usual
        of_materials.append([distant if isinstance(source, DirectionalLight) else usual for source in plan.lights])
    if not is_parted(plan):
        return of_lights, of_materials
    seconds = [
        reflection_function_of(model_of(source)).second_term if has_colored_fresnel(source) else no_second_term
        for source in plan.materials
    ]
    of_materials = [
        [part for function in functions for part in (function, second)]
        for functions, second in zip(of_materials, seconds, strict=True)
    ]
    return [part for function in of_lights for part in (function, same_light_again)], of_materials


def _addresses(functions, dtype) -> np.ndarray:
    """Compile batch functions; return their addresses, int64."""
    return np.array([batch_function(function, dtype).address for function in functions], np.int64)


def world_position(light, view) -> np.ndarray:
    """The position of a light in the world, (3,) float64, also of one that moves with the camera."""
    position = _to_world(light.position, light, view)
    return view.eye + position if light.attached == "camera" else position


def world_direction(light, view) -> np.ndarray:
    """The direction of a light in the world, (3,) float64, also of one that moves with the camera."""
    return _to_world(light.direction, light, view)


def _to_world(vector, light, view) -> np.ndarray:
    """A vector along the world's axes that may be given along those of the camera."""
    if light.attached != "camera":
        return np.array(vector)
    return np.array(vector) @ np.stack([view.right, view.up, -view.forward])  # rows: the camera's axes in the world
