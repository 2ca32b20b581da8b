"""The plan as arrays that kernels read: lights and materials (pipeline/lighting.py), and how packed samples, setups and
bytes hold what is interpolated."""

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import batch_function
from ..pipeline import material_coefficients as m
from ..pipeline.cut_outs import CutOuts
from ..pipeline.gradients import EXACT, HAS_ALBEDO, Coding, DepthScale
from ..pipeline.lighting import Lighting, ShadowMaps
from ..pipeline.lights import N_LIGHT_COEFFICIENT
from ..pipeline.reflection import ambient_share
from ..pipeline.resolve import RANGE_CLAMP, RANGE_GLOBAL, RANGE_LOCAL, Encoding, with_blank
from ..pipeline.shadow_lookup import occlude
from ..pipeline.textures import TextureCoding
from .plan import Plan
from .points import Geometry
from .reflections import is_metallic
from .scene_tables import split_fresnel

WHITE = (1.0, 1.0, 1.0)
DARKEST = 2.0**-40  # what a black texture counts as bright as
NO_DEPTHS = DepthScale(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, True)  # of no view


# ---------------------------------------------------------------- lights and materials


def make_lighting(plan: Plan, dtype: np.dtype) -> Lighting:
    """Write what holds in any view of the materials that are lit in `dtype`: their coefficients, which lights light
    each, and the addresses of the functions for that, which are compiled where they aren't there.

    The coefficients of lights are zeros, and no light casts shadows: see `light_view`.
    """
    tables, of_materials = plan.tables, plan.of_materials
    is_lit = tables.is_lit & (of_materials.is_double == (dtype == np.float64))[:, None]
    n_material, n_light = is_lit.shape
    is_share, needs_view = np.zeros(n_light, np.bool_), np.zeros(n_material, np.bool_)
    light_functions, reflection_functions = np.zeros(n_light, np.int64), np.zeros(is_lit.shape, np.int64)
    for i in np.flatnonzero(is_lit.any(axis=0)):
        is_share[i] = tables.light_types[i].is_share
        light_functions[i] = batch_function(tables.light_types[i].function(tables.lights[i]), dtype).address
    for k, (material, model) in enumerate(zip(tables.materials, tables.models, strict=True)):
        needs_view[k] = model.needs_view
        if (is_lit[k] & ~is_share).any():
            reflection_functions[k, is_lit[k]] = batch_function(model.function(material), dtype).address
    if is_share.any():
        reflection_functions[is_lit & is_share] = batch_function(ambient_share, dtype).address
    n_channels, colors = np.where(of_materials.is_colored, 3, 1), color_lights(plan).astype(dtype)
    by_channel = colors.reshape(len(colors), -1, 3)
    is_grey = (by_channel == by_channel[..., :1]).all(axis=(1, 2))
    return Lighting(
        light_functions=light_functions,
        lights=np.zeros((n_light, N_LIGHT_COEFFICIENT), dtype),
        n_lights=is_lit.sum(axis=1),
        light_idx=np.argsort(~is_lit, axis=1, kind="stable"),
        reflection_functions=reflection_functions,
        materials=list_materials(plan, dtype),
        n_terms=np.array(tables.n_terms),
        is_view_dependent=needs_view,
        n_channels=n_channels,
        n_sums=np.where(is_grey, 1, n_channels),
        tint=plan.tint,
        needs_view=bool(needs_view.any()),
        needs_position=plan.needs_position,
        has_albedo=of_materials.has_albedo,
        colors=colors,
        shadows=None,
    )


def light_view(lighting: Lighting, plan: Plan, view, shadows=()) -> Lighting:
    """Put in what a view says of the lights.

    `shadows` holds a light's shadow map (see engine/shadow_maps.py), or None, for each light; nothing where no light
    has one. Whoever draws keeps it until the picture is done.
    """
    tables, dtype = plan.tables, lighting.materials.dtype
    lights = np.zeros(lighting.lights.shape)
    for i in tables.lit_by:
        tables.light_types[i].write(lights[i], tables.lights[i], view, dtype)
    maps = None
    if tables.has_shadows:
        blocks = [0 if shadow is None else shadow.block.ctypes.data for shadow in shadows]
        maps = ShadowMaps(batch_function(occlude, dtype).address, np.array(blocks, np.int64))
    return lighting._replace(lights=lights.astype(dtype), shadows=maps)


def list_materials(plan: Plan, dtype: np.dtype) -> NDArray:
    """Write a row of numbers for each material: those of its model, then its coefficients, as far as lights are no part
    of them; of one with one channel the largest component stands for all."""
    tables = plan.tables
    rows, products = np.zeros((len(tables.materials), m.N_MATERIAL_COEFFICIENT)), tables.products
    for k, (row, source) in enumerate(zip(rows, tables.materials, strict=True)):
        row[m.SHININESS], row[m.TOON_LEVELS], row[m.METALLIC] = source.shininess, source.levels, source.metallic
        row[[m.ROUGHNESS, m.ROUGHNESS_ACROSS]] = source.roughness
        if not isinstance(source.tangent, str):
            row[m.TANGENT_AXIS : m.TANGENT_AXIS + 3] = source.tangent
        if tables.models[k].is_own:
            row[m.OWN_NUMBERS : m.OWN_NUMBERS + m.N_OWN_NUMBER] = 0.0
            row[m.OWN_NUMBERS : m.OWN_NUMBERS + len(source.numbers or ())] = source.numbers or ()
        row[m.HAS_FRESNEL], row[m.HIGHLIGHT_SCALE] = tables.n_terms[k] > 2, tables.models[k].highlight_scale(source)
        emissive, ambient = source.emissive, np.array(source.ambient) * tables.ambient
        if products is not None:
            emissive, ambient = products.emissive[k], products.ambient[k]
        diffuse, specular = (1.0 - source.metallic) * np.array(source.diffuse), source.specular
        if products is not None or tables.n_terms[k] == 4:  # whose sums have all colours: see `color_lights`
            diffuse, specular = WHITE, WHITE
        columns = (m.EMISSION, emissive), (m.AMBIENT, ambient), (m.DIFFUSE, diffuse), (m.SPECULAR, specular)
        for column, color in columns:
            row[column : column + 3] = color if plan.of_materials.is_colored[k] else max(color)
    if dtype == np.float32:
        # An exponent that float32 has no number for raises all cosines to 0 or 1, as the nearest one that it has does.
        limits = np.finfo(np.float32)
        np.clip(rows[:, m.SHININESS], limits.tiny, limits.max, out=rows[:, m.SHININESS])
    return rows.astype(dtype)


def color_lights(plan: Plan) -> NDArray[np.float64]:
    """Write what the terms of each light are weighted with in the sums, (1 or n_material, n_light, 12): see Lighting.

    The four terms stand side by side; of materials with one channel the largest component is in all three.
    """
    tables, products = plan.tables, plan.tables.products
    if products is not None:
        terms = [products.diffuse, products.specular, products.grazing, products.metal]
    else:
        colors = np.zeros((1, len(tables.lights), 3))
        for i in tables.lit_by:
            colors[0, i] = tables.lights[i].color
        if max(tables.n_terms) <= 2 and (colors == colors.max(axis=2, keepdims=True)).all():
            return np.tile(colors, (1, 1, 4))
        shares, first, rest, metal = split_fresnel(tables.materials)
        diffuse = np.ones_like(first)
        for k in np.flatnonzero(np.array(tables.n_terms) == 4):  # W has the albedo's colour in it: all stand here
            diffuse[k] = shares[k] * np.array(tables.materials[k].diffuse)
            for weights in (first, rest, metal):
                weights[k] *= tables.materials[k].specular
        terms = [colors * weights[:, None] for weights in (diffuse, first, rest, metal)]
    whole = np.stack(terms, axis=2)
    whole = np.where(plan.of_materials.is_colored[:, None, None, None], whole, whole.max(axis=3, keepdims=True))
    return whole.reshape(*whole.shape[:2], 12)


# ---------------------------------------------------------------- how packed samples, setups and bytes hold the rest


def make_coding(plan: Plan) -> Coding:
    """Say what packed samples and setups hold, but for depths, which each view has of its own: `scale_depths`.

    A coding says which materials have attributes in packed samples, in planes or in exact setups, and how far each may
    be off. What rounding leaves of the tolerance is shared: a quarter is for normals, a quarter for colours that are
    given with the model, the rest for textures. Or all is for intensities; with textures a quarter: where a triangle
    bends them by more they have weights, and err by next to nothing. Texture coordinates aren't rounded to float32:
    large pictures need many digits of them.
    """
    of_materials, tolerance, has_cue = plan.of_materials, plan.options.tolerance, plan.cue is not None
    reads_double = of_materials.is_double | plan.tables.has_texture
    rows = of_materials.paths, of_materials.features, reads_double, of_materials.n_attributes
    intensity_scale = 0.0 if plan.is_lit_per_sample else float(plan.intensity_scale)
    if of_materials.is_double.all():
        limits = np.zeros(len(reads_double))
        return Coding(*rows, limits, intensity_scale, None, False, None, NO_DEPTHS, is_exact=True)
    left = tolerance * (1.0 - np.where(of_materials.is_double, 1.0, of_materials.shares))
    if plan.is_lit_per_sample:
        has_albedo = (of_materials.features & HAS_ALBEDO) != 0
        limits, of_textures = of_materials.normal_limits, left - np.where(has_albedo, tolerance / 2, tolerance / 4)
        is_longer = (of_materials.n_attributes > 3).any()
        behind_normals = float(tolerance / 4 / max(plan.bound, 1e-30)) if is_longer else None
        rest = behind_normals, plan.needs_position or has_cue
    else:
        limits, of_textures = np.where(plan.tables.has_texture, left / 4, left), left * 3 / 4
        rest = None, has_cue
    textures = None if plan.textures is None else code_textures(plan, of_textures)
    return Coding(*rows, limits, intensity_scale, *rest, textures, NO_DEPTHS, is_exact=False)


def code_textures(plan: Plan, limits: NDArray[np.float64]) -> TextureCoding | None:
    """Say which texture coordinates may stand in planes; `limits` are those of errors of intensities, (n_material,).

    A slope is what an intensity changes by, at most, where its texture changes by the largest component of all
    textures: that is in what they reflect. Colours multiply what is reflected diffusely, and F0 of a metal; other
    highlights keep their light.
    """
    if not (plan.tables.has_texture & (plan.of_materials.paths != EXACT)).any():
        return None
    is_metal, intensities = np.array([*map(is_metallic, plan.tables.materials)]), plan.intensities
    with np.errstate(over="ignore"):
        metal = np.where(is_metal, intensities.specular.sum(axis=1), 0.0)
        slopes = intensities.undirected + intensities.diffuse.sum(axis=1) + metal
    slopes = slopes / max(plan.tables.max_texel, DARKEST)
    return TextureCoding(plan.textures, limits / np.maximum(slopes, 1e-30))


def make_cut_outs(plan: Plan, geometry: Geometry, depths: DepthScale, min_opacity: float = 0.0) -> CutOuts | None:
    """Return which samples of cut-outs are there, see pipeline/cut_outs.py; None where all are.

    Parameters
    ----------
    min_opacity : what has less isn't there, either, but for cut-outs: what these leave is opaque
    """
    if min_opacity == 0.0 and not plan.tables.has_cut_outs:
        return None
    thresholds = np.zeros(len(plan.tables.materials))
    for k, material in enumerate(plan.tables.materials):
        least = min_opacity if material.alpha_cutoff is None else material.alpha_cutoff
        has_alpha = material.texture is not None and material.texture.has_alpha
        if least > material.opacity:
            thresholds[k] = np.inf
        elif has_alpha and least > 0.0:
            thresholds[k] = least / material.opacity
    return CutOuts(thresholds, plan.textures, geometry.uv, depths) if thresholds.any() else None


def make_encoding(plan: Plan) -> Encoding:
    """Say how linear colour becomes 8 bits."""
    background = plan.tables.background
    behind = np.array(background or (0, 0, 0), np.float32)
    policies = {"clamp": RANGE_CLAMP, "global": RANGE_GLOBAL, "local": RANGE_LOCAL}
    is_grey = bool(np.ptp(plan.tint) == 0.0 and np.ptp(behind) == 0.0)
    policy = policies[plan.options.color_range]
    return with_blank(Encoding(is_grey, plan.tint, behind, background is not None, policy, 1.0))
