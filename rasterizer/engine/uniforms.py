"""The illumination of a scene as arrays, for one view: what the batch functions of lights and materials read
(pipeline/lighting.py)."""

from itertools import chain

import numpy as np

from ..compiler.kernels import batch_function
from ..pipeline import material_coefficients as m
from ..pipeline.lighting import Lighting, ShadowMaps
from ..pipeline.lights import N_LIGHT_COEFFICIENT
from ..pipeline.reflection import ambient_share
from ..pipeline.shadow_lookup import occlude
from . import lights as light_table
from . import reflections as reflection_table
from .plan import Plan
from .reflections import count_terms
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
    lights = np.zeros((len(plan.tables.lights), N_LIGHT_COEFFICIENT))
    for k in np.flatnonzero(plan.tables.is_lit.any(axis=0)):
        light_table.entry_of(plan.tables.lights[k]).write(lights[k], plan.tables.lights[k], view, dtype)
    return lighting._replace(
        lights=lights.astype(dtype),
        shadows=_list_shadows(shadows, dtype) if plan.tables.has_shadows else None,
    )


def list_materials(plan: Plan, dtype) -> Lighting:
    """Write what doesn't depend on the view: materials, which lights light each, and what they are weighted with.

    The coefficients of lights and the addresses of functions are zeros, and no light casts shadows.
    """
    material = _material_rows(plan, dtype)
    models = [reflection_table.entry_of(source) for source in plan.tables.materials]
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
        n_terms=np.array([count_terms(source) for source in plan.tables.materials]),
        is_view_dependent=is_view_dependent,
        n_channels=np.where(plan.of_materials.is_colored, 3, 1),
        tint=plan.tint,
        needs_view=bool(is_view_dependent.any()),
        needs_position=plan.needs_position,
        has_albedo=plan.of_materials.has_albedo,
        colors=_color_lights(plan).astype(dtype),
        shadows=None,
    )


def is_lit_in(plan: Plan, dtype) -> np.ndarray:
    """Tell which materials are lit in a type, and by which lights: (n_material, n_light) bool."""
    return plan.tables.is_lit & (plan.of_materials.is_double == (dtype == np.float64))[:, None]


def used_functions(plan: Plan, dtype) -> list[list]:
    """The batch functions that light in a type, or None in the place of one that lights nothing; nothing else is
    compiled: a row of those of the lights, and one a light for each material."""
    is_lit, of_lights = is_lit_in(plan, dtype), []
    for light, is_used in zip(plan.tables.lights, is_lit.any(axis=0), strict=True):
        of_lights.append(light_table.entry_of(light).function(light) if is_used else None)
    rows = [of_lights]
    for material, is_used in zip(plan.tables.materials, is_lit, strict=True):
        function, row = reflection_table.entry_of(material).function(material), []
        for light, is_one in zip(plan.tables.lights, is_used, strict=True):
            own = ambient_share if light_table.entry_of(light).is_share else function
            row.append(own if is_one else None)
        rows.append(row)
    return rows


def with_functions(lighting: Lighting, plan: Plan, dtype) -> Lighting:
    """Put in the addresses of the functions that light in a type; those that aren't there are compiled."""
    rows, known = used_functions(plan, dtype), {None: 0}
    for function in chain(*rows):
        if function not in known:
            known[function] = batch_function(function, dtype).address
    found = np.array([known[function] for function in chain(*rows)], np.int64).reshape(len(rows), -1)
    return lighting._replace(light_functions=found[0], reflection_functions=np.ascontiguousarray(found[1:]))


def _list_shadows(shadows, dtype) -> ShadowMaps:
    """The addresses of the lights' shadow maps, and of what looks them up."""
    maps = [0 if shadow is None else shadow.block.ctypes.data for shadow in shadows]
    return ShadowMaps(batch_function(occlude, dtype).address, np.array(maps, np.int64))


def _material_rows(plan, dtype) -> np.ndarray:
    """A row of numbers for each material: those of its model, then its coefficients, as far as lights are no part of
    them."""
    material, products = np.zeros((len(plan.tables.materials), m.N_MATERIAL_COEFFICIENT)), plan.tables.products
    for k, (row, source) in enumerate(zip(material, plan.tables.materials, strict=True)):
        row[m.SHININESS], row[m.TOON_LEVELS] = source.shininess, source.levels
        row[m.ROUGHNESS] = row[m.ROUGHNESS_ACROSS] = source.roughness if isinstance(source.roughness, float) else 0.0
        if isinstance(source.roughness, tuple):
            row[m.ROUGHNESS], row[m.ROUGHNESS_ACROSS] = source.roughness
        if not isinstance(source.tangent, str):
            row[m.TANGENT_AXIS : m.TANGENT_AXIS + 3] = source.tangent
        entry = reflection_table.entry_of(source)
        row[m.METALLIC] = source.metallic
        row[m.HAS_FRESNEL], row[m.HIGHLIGHT_SCALE] = count_terms(source) > 2, entry.highlight_scale(source)
        diffuse = (1.0 - source.metallic) * np.array(source.diffuse)
        colors = (source.emissive, np.array(source.ambient) * plan.tables.ambient, diffuse, source.specular)
        if count_terms(source) == 4:  # whose sums have all colours: see `_color_lights`
            colors = (*colors[:2], (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
        if products is not None:
            colors = (products.emissive[k], products.ambient[k], (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
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
    """What the terms of each light are weighted with in the sums, (1 or n_material, n_light, 12): see Lighting."""
    products, is_colored = plan.tables.products, plan.of_materials.is_colored
    if products is not None:
        return _in_channels([products.diffuse, products.specular, products.grazing, products.metal], is_colored)
    colors = np.array([light.color for light in plan.tables.lights]).reshape(1, -1, 3)
    colors = colors * plan.tables.is_lit.any(axis=0)[:, None]
    n_terms = [count_terms(material) for material in plan.tables.materials]
    if max(n_terms) <= 2 and (colors == colors.max(axis=2, keepdims=True)).all():
        return np.tile(colors, (1, 1, 4))
    first, rest, metal = split_fresnel(plan.tables.materials)
    diffuse, shares = np.ones_like(first), diffuse_shares(plan.tables.materials)
    for k, material in enumerate(plan.tables.materials):
        if n_terms[k] == 4:  # W has the albedo's colour in it, so all coefficients stand here
            diffuse[k] = shares[k] * np.array(material.diffuse)
            for weights in (first, rest, metal):
                weights[k] *= material.specular
    return _in_channels([colors * weights[:, None] for weights in (diffuse, first, rest, metal)], is_colored)


def _in_channels(terms, is_colored) -> np.ndarray:
    """Put the four terms (n_material, n_light, 3) side by side; of materials with one channel the largest component in
    all three."""
    whole = np.stack(terms, axis=2)
    whole = np.where(is_colored[:, None, None, None], whole, whole.max(axis=3, keepdims=True))
    return whole.reshape(*whole.shape[:2], 12)
