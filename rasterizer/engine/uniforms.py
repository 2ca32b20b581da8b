"""The illumination of a scene as arrays, for one view: what the batch functions of lights and materials read
(pipeline/lighting.py)."""

import numpy as np

from ..compiler.kernels import batch_function
from ..pipeline import material_coefficients as m
from ..pipeline.lighting import Lighting, ShadowMaps
from ..pipeline.lights import N_LIGHT_COEFFICIENT, same_light_again
from ..pipeline.reflection import ambient_share, no_second_term
from ..pipeline.shadow_lookup import occlude
from . import lights as light_table
from . import reflections as reflection_table
from .plan import Plan
from .reflections import first_fresnel, has_highlight, has_two_terms, is_metallic
from .scene_tables import diffuse_shares, split_fresnel

_COLUMNS = (m.EMISSION, m.AMBIENT, m.DIFFUSE, m.SPECULAR)


def make_lighting(plan: Plan, view, dtype, shadows=()) -> Lighting:
    """Write lights and materials as arrays, for one view; only the rows of materials that are lit in `dtype` are read.

    `shadows` holds a light's shadow map (see engine/shadow_maps.py), or None, for each light; nothing where no light
    has one. Whoever draws keeps it until the picture is done.
    """
    return light_view(with_functions(list_materials(plan, dtype), plan, dtype), plan, view, shadows)


def light_view(lighting: Lighting, plan: Plan, view, shadows=()) -> Lighting:
    """Put what a view says of the lights into what `list_materials` returns."""
    dtype = lighting.materials.dtype
    lights = np.zeros((len(plan.lights), N_LIGHT_COEFFICIENT))
    for k in np.flatnonzero(plan.is_lit.any(axis=0)):
        light_table.entry_of(plan.lights[k]).write(lights[k], plan.lights[k], view, dtype)
    if len(lighting.lights) > len(plan.lights):  # each light is followed by itself, see `is_parted`
        lights = np.repeat(lights, 2, axis=0)
        shadows = [part for shadow in shadows for part in (shadow, None)]
    return lighting._replace(
        lights=lights.astype(dtype),
        shadows=_list_shadows(shadows, dtype) if plan.has_shadows else None,
    )


def list_materials(plan: Plan, dtype) -> Lighting:
    """Write what doesn't depend on the view: materials, which lights light each, and what they are weighted with.

    The coefficients of lights and the addresses of functions are zeros, and no light casts shadows.
    """
    material = _material_rows(plan, dtype)
    highlights = np.array([has_highlight(source) for source in plan.materials], np.bool_)
    models = [reflection_table.entry_of(source).function(source) for source in plan.materials]
    is_view_dependent = np.array([model.needs_view for model in models], np.bool_)
    is_lit = is_lit_in(plan, dtype)
    n_light = is_lit.shape[1]
    return Lighting(
        light_functions=np.zeros(n_light, np.int64),
        lights=np.zeros((n_light, N_LIGHT_COEFFICIENT), dtype),
        n_lights=is_lit.sum(axis=1),
        light_idx=np.argsort(~is_lit, axis=1, kind="stable"),
        reflection_functions=np.zeros(is_lit.shape, np.int64),
        materials=material.astype(dtype),
        has_highlight=highlights,
        is_view_dependent=is_view_dependent,
        n_channels=np.where(plan.of_materials.is_colored, 3, 1),
        tint=plan.tint,
        needs_view=bool(is_view_dependent.any()),
        needs_position=plan.needs_position,
        has_albedo=plan.of_materials.has_albedo,
        colors=_color_lights(plan).astype(dtype),
        shadows=None,
    )


def is_lit_in(plan: Plan, dtype=None) -> np.ndarray:
    """Tell which materials are lit in a type, None = any, and by which lights: (n_material, n_light) bool; with two
    terms a light (see `is_parted`) there are twice as many."""
    is_lit = plan.is_lit
    if dtype is not None:
        is_lit = is_lit & (plan.of_materials.is_double == (dtype == np.float64))[:, None]
    return np.repeat(is_lit, 2, axis=1) if is_parted(plan) else is_lit


def used_functions(plan: Plan, dtype=None) -> list[list]:
    """The batch functions that light in a type, None = any; or None in the place of one that lights nothing: a row of
    those of the lights, and one for each material."""
    of_lights, of_materials = batch_functions_of(plan)
    is_lit = is_lit_in(plan, dtype)
    rows = zip([of_lights, *of_materials], [is_lit.any(axis=0), *is_lit], strict=True)
    return [[f if is_used else None for f, is_used in zip(row, used, strict=True)] for row, used in rows]


def with_functions(lighting: Lighting, plan: Plan, dtype) -> Lighting:
    """Put in the addresses of the functions that light in a type; those that aren't there are compiled."""
    rows = used_functions(plan, dtype)
    known = {f: 0 if f is None else batch_function(f, dtype).address for f in {f for row in rows for f in row}}
    found = np.array([[known[f] for f in row] for row in rows], np.int64).reshape(len(rows), -1)
    return lighting._replace(light_functions=found[0], reflection_functions=np.ascontiguousarray(found[1:]))


def _list_shadows(shadows, dtype) -> ShadowMaps:
    """The addresses of the lights' shadow maps, and of what looks them up."""
    maps = [0 if shadow is None else shadow.block.ctypes.data for shadow in shadows]
    return ShadowMaps(batch_function(occlude, dtype).address, np.array(maps, np.int64))


def _material_rows(plan, dtype) -> np.ndarray:
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
        entry = reflection_table.entry_of(source)
        row[m.METALLIC] = source.metallic
        row[m.FRESNEL], row[m.HIGHLIGHT_SCALE] = first_fresnel(source), entry.highlight_scale(source)
        diffuse = (1.0 - source.metallic) * np.array(source.diffuse)
        colors = (source.emissive, np.array(source.ambient) * plan.ambient, diffuse, source.specular)
        if has_two_terms(source) and is_metallic(source):  # whose sums have all colours: see `_color_parts`
            colors = (*colors[:2], (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
        if plan.products is not None:
            colors = (plan.products.emissive[k], plan.products.ambient[k], (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
        for column, color in zip(_COLUMNS, colors, strict=True):
            row[column : column + 3] = color
        if not plan.of_materials.is_colored[
            k
        ]:  # the largest component: all are grey or multiples of the picture's tint
            for column in _COLUMNS:
                row[column] = row[column : column + 3].max()
    if dtype == np.float32:
        # An exponent that float32 has no number for raises all cosines to 0 or 1, as the nearest one that it has does.
        limits = np.finfo(np.float32)
        np.clip(material[:, m.SHININESS], limits.tiny, limits.max, out=material[:, m.SHININESS])
    return material


def _color_lights(plan) -> np.ndarray:
    """What the sums over the lights are weighted with, (1 or n_material, n_light, 6).

    With two terms a light (see `is_parted`), n_light is twice the number of lights.
    """
    n_light, is_colored = len(plan.lights), plan.of_materials.is_colored
    if is_parted(plan):
        return _in_channels(_color_parts(plan), is_colored)
    if plan.products is not None:
        return _in_channels(np.concatenate([plan.products.diffuse, plan.products.specular], axis=2), is_colored)
    colors = np.array([light.color for light in plan.lights]).reshape(n_light, 3) * plan.is_lit.any(axis=0)[:, None]
    greys = np.repeat(colors.max(axis=1, keepdims=True, initial=0.0), 3, axis=1)
    if (colors == greys).all():
        return np.concatenate([greys, greys], axis=1)[None]
    rows = np.where(is_colored[:, None, None], colors, greys)
    return np.concatenate([rows, rows], axis=2)


def _in_channels(colors, is_colored) -> np.ndarray:
    """Put the largest component into all three channels, for materials that have one: (n_material, n_light, 6)."""
    pairs = colors.reshape(*colors.shape[:2], 2, 3)
    return np.where(is_colored[:, None, None, None], pairs, pairs.max(axis=3, keepdims=True)).reshape(colors.shape)


def is_parted(plan: Plan) -> bool:
    """Tell whether the light of each light is summed in two terms, because some material's highlight is two sums.

    The second term is that of pipeline/reflection.py; it follows the first as if it were another light's.
    """
    return any(has_two_terms(material) for material in plan.materials)


def _color_parts(plan) -> np.ndarray:
    """What the sums over both terms of the lights are weighted with, (n_material, 2·n_light, 6)."""
    color = np.zeros((len(plan.materials), 2 * len(plan.lights), 6))
    if plan.products is not None:
        color[:, ::2, :3], color[:, ::2, 3:] = plan.products.diffuse, plan.products.specular
        color[:, 1::2, :3], color[:, 1::2, 3:] = plan.products.metal, plan.products.grazing
        return color
    of_lights = np.array([light.color for light in plan.lights]).reshape(1, -1, 3)
    first, rest, metal = split_fresnel(plan.materials)
    diffuse, shares = np.ones_like(first), diffuse_shares(plan.materials)
    for k, material in enumerate(plan.materials):
        if has_two_terms(material) and is_metallic(material):
            diffuse[k] = shares[k] * np.array(material.diffuse)
            for weights in (first, rest, metal):
                weights[k] *= material.specular
    color[:, ::2, :3], color[:, ::2, 3:] = of_lights * diffuse[:, None], of_lights * first[:, None]
    color[:, 1::2, :3], color[:, 1::2, 3:] = of_lights * metal[:, None], of_lights * rest[:, None]
    return color


def batch_functions_of(plan: Plan) -> tuple[list, list]:
    """The batch functions that a scene uses; nothing else is compiled: one for each light, and for each material one a
    light.

    With two terms a light (see `is_parted`), each is followed by that of its second term.
    """
    lights = [light_table.entry_of(source) for source in plan.lights]
    of_lights = [entry.function(source).evaluate for entry, source in zip(lights, plan.lights, strict=True)]
    of_materials = []
    for material in plan.materials:
        function = reflection_table.entry_of(material).function(material)
        of_materials.append([ambient_share if entry.is_share else function.evaluate for entry in lights])
    if not is_parted(plan):
        return of_lights, of_materials
    of_materials = [
        [part for f, entry in zip(functions, lights, strict=True)
         for part in (f, no_second_term if entry.is_share else _second_term(material))]
        for functions, material in zip(of_materials, plan.materials, strict=True)
    ]  # fmt: skip
    return [part for function in of_lights for part in (function, same_light_again)], of_materials


def _second_term(material):
    """The function of the second term of a material's highlight, in a scene where some material has one."""
    if not has_two_terms(material):
        return no_second_term
    return reflection_table.entry_of(material).function(material).second_term
