"""The plan of a picture: what this scene needs, and nothing else.

Found here, from the scene alone: how bright it may be, the colour that one channel is enough for, its textures and
transparent surfaces, which functions are compiled. What each material needs, its channels, its type and its way to the
samples, is found in material_plans.py. What a view says is added later (view_plans.py).
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..errors import SceneError
from ..geometry.points import number_materials
from ..options import Options
from ..pipeline.depth_cueing import Cue
from ..pipeline.layers import Opacity, least_transmittance
from ..pipeline.texture_packing import PackedTextures, pack_textures
from ..pipeline.textures import Textures
from ..pipeline.visibility import LEVEL_MASK
from . import light_table
from .bounds import WRITTEN, Brightness, Distances, compute_brightness, rounding_errors
from .material_plans import Facts, MaterialPlans, plan_materials
from .rounding import SINGLE
from .spectral_products import Products, multiply_spectra
from .surface_arrays import brightest_texel, list_opacities, list_textures, make_cue
from .tint import common_color, common_tint

LARGEST = float(np.finfo(np.float32).max)  # that a picture can hold


class Plan(NamedTuple):
    """What this scene needs, whatever the camera."""

    n_channel: int  # the most that any material needs
    tint: np.ndarray  # (3,) float32: the colour of what has one channel
    of_materials: MaterialPlans
    level_scale: float  # levels a unit of intensity
    bound: float  # the largest intensity that any point can have
    brightness: Brightness  # how bright each light makes each material, where nothing weakens it
    clearances: np.ndarray  # (n_material, n_light) scene units: no lit point may come nearer to a light
    is_lit: np.ndarray  # (n_material, n_light) bool: the material may reflect something of the light
    n_left_out: int  # lights that no material reflects anything of: black ones, which aren't listed, and others
    brightest_background: float  # largest component of what lies behind the picture, or of what it fades to with depth
    is_flat: bool
    is_lit_per_sample: bool
    ambient: np.ndarray  # (3,) float64, the sum of the ambient lights
    lights: tuple  # the others; those of an area light one by one
    materials: tuple  # the different ones of all meshes
    has_albedo: bool
    has_shadows: bool  # some light casts shadows, and is reflected
    has_tangents: bool  # some material is brushed along u
    textures: Textures | None  # None where the scene has none
    packed_textures: PackedTextures | None  # the same for look-ups in float32; None where there are none
    opacity: Opacity | None  # None where all is opaque
    products: Products | None  # None where colours are multiplied channel by channel
    cue: Cue | None  # None where nothing fades with depth

    @property
    def dtype(self) -> np.dtype:
        """The type of intensities: float64 where all materials need it."""
        return np.dtype(np.float64 if self.of_materials.is_double.all() else np.float32)

    @property
    def dtypes(self) -> tuple[np.dtype, ...]:
        """The types that materials are lit in."""
        is_double = self.of_materials.is_double
        found = (np.float32, not is_double.all()), (np.float64, is_double.any())
        return tuple(np.dtype(dtype) for dtype, is_used in found if is_used)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why float32 won't do for some material, each reason once."""
        return tuple(dict.fromkeys(reason for reasons in self.of_materials.reasons for reason in reasons))

    @property
    def reflected_lights(self) -> tuple:
        """The lights that some material reflects something of."""
        return tuple(light for light, is_lit in zip(self.lights, self.is_lit.any(axis=0), strict=True) if is_lit)

    @property
    def needs_position(self) -> bool:
        """Lighting reads the positions of points."""
        functions = [light_table.entry_of(light).function(light) for light in self.reflected_lights]
        return self.has_shadows or any(function.needs_position for function in functions)

    @property
    def sample_time(self) -> int:
        """Nanoseconds that it takes to shade a sample, roughly, where a quarter of all samples show something."""
        of_light = (2 + 4 * self.has_shadows) * self.is_lit_per_sample
        return of_light * len(self.lights) + 12 * (self.textures is not None) + 8 * (self.opacity is not None)


class Sources(NamedTuple):
    """Where the light of a scene comes from, and what it falls on."""

    ambient: np.ndarray  # (3,) float64, the sum of the ambient lights
    lights: tuple  # the others; those of an area light one by one
    materials: tuple  # the different ones of all meshes
    products: Products | None  # those of spectra, in which the exposure is included
    is_lit: np.ndarray  # (n_material, n_light) bool: the material reflects something of the light
    n_black: int  # lights that are black, and no part of `lights`

    @property
    def has_shadows(self) -> bool:
        """Some light casts shadows, and is reflected."""
        casts = [light_table.shadow_of(light) is not None for light in self.lights]
        return bool((self.is_lit.any(axis=0) & np.array(casts, np.bool_)).any())

    def lights_of(self, k: int) -> tuple:
        """The lights that material k reflects something of."""
        return tuple(light for light, is_lit in zip(self.lights, self.is_lit[k].tolist(), strict=True) if is_lit)

    @property
    def is_textured(self) -> bool:
        """Some material has a texture."""
        return any(material.texture is not None for material in self.materials)

    @property
    def is_opaque(self) -> bool:
        """Nothing shows through anything."""
        return all(material.is_opaque for material in self.materials)


def make_plan(scene, options: Options, albedo, clearances=None, colored=None) -> Plan:
    """Find out what a scene needs.

    Parameters
    ----------
    albedo : (n_point, 3) float64, linear colours given with the model, or no rows
    clearances : (n_material, n_light) float64, distances that no lit point of a material comes nearer to the lights
        than; None = 0, so that those that amplify without limit need float64
    colored : (n_material,) bool, which materials have points whose albedo isn't grey; None = all if any

    Raises SceneError where the picture's intensities may be too large for float32.
    """
    sources = gather_sources(scene, options)
    materials, cue = sources.materials, scene.depth_cue
    clearances = np.zeros(sources.is_lit.shape) if clearances is None else clearances
    facts = gather_facts(scene, sources, albedo, colored)
    tint = choose_tint(facts.tints)
    fades_to = max(cue.color) if cue is not None else 0.0
    with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is refused
        most_albedo = albedo.max(initial=1.0) * brightest_texel(materials)
        brightness = compute_brightness(materials, sources.lights, sources.ambient, most_albedo, sources.products)
        check_brightness(max(brightness.of_materials.max(initial=0.0), fades_to))
        brightest = brightness.at(clearances)
        bound = max(float(brightest.of_materials.max(initial=0.0)), fades_to)
    behind = max(fades_to, *(scene.background or (0.0,)))
    # The least that float32 adds in any view: lights are far from surfaces, and no normal errs.
    best = Distances(np.zeros(len(materials)), np.full(sources.is_lit.shape, np.inf))
    roundings = rounding_errors(brightness, best, SINGLE) + WRITTEN * (
        behind + brightness.at(best.clearances).of_materials
    )
    of_materials = plan_materials(sources, brightest, roundings, options, facts, tint)
    n_channel = 3 if of_materials.is_colored.any() else 1
    most_level = bound * (1.0 + options.tolerance) + options.tolerance  # rounding may add half of the tolerance
    least = least_transmittance(bound)
    textures = list_textures(materials) if sources.is_textured else None
    return Plan(
        n_channel=n_channel,
        tint=np.ones(3, np.float32) if tint is None else tint.astype(np.float32),
        of_materials=of_materials,
        level_scale=(int(LEVEL_MASK) - 1) / most_level if 0.0 < most_level < np.inf else 1.0,
        bound=bound,
        brightness=brightness,
        clearances=clearances,
        is_lit=sources.is_lit,
        n_left_out=sources.n_black + int((~sources.is_lit.any(axis=0)).sum()),
        brightest_background=behind,
        is_flat=options.is_flat,
        is_lit_per_sample=options.shading == "phong",
        ambient=sources.ambient,
        lights=sources.lights,
        materials=materials,
        has_albedo=len(albedo) > 0,
        has_shadows=sources.has_shadows,
        has_tangents=any(material.is_anisotropic and material.tangent == "u" for material in materials),
        textures=textures,
        packed_textures=pack_textures(textures) if of_materials.is_looked_up.any() else None,
        opacity=None if sources.is_opaque else list_opacities(materials, least),
        products=sources.products,
        cue=None if cue is None else make_cue(cue, n_channel),
    )


def gather_facts(scene, sources: "Sources", albedo, colored) -> Facts:
    """Find out which materials have colours that are given with the model, and which have one channel."""
    materials = sources.materials
    has_texture = np.array([material.texture is not None for material in materials], np.bool_)
    has_vertex_colors = np.zeros(len(materials), np.bool_)
    if len(albedo) > 0:
        given = number_materials(scene.meshes)[1]
        for mesh, numbers in zip(scene.meshes, given, strict=True):
            if mesh.colors is not None or mesh.face_colors is not None:
                has_vertex_colors[numbers] = True
    if colored is None:
        colored = np.full(len(materials), len(albedo) > 0 and bool(np.ptp(albedo, axis=1).any()))
    tints = [None if has_colors else tint_of(k, sources, scene.depth_cue) for k, has_colors in enumerate(colored)]
    return Facts(has_texture | has_vertex_colors, has_vertex_colors, colored, tints)


def tint_of(k: int, sources: "Sources", cue) -> np.ndarray | None:
    """Return the RGB triple that all intensities of material k are multiples of; None where there is none."""
    material = sources.materials[k]
    if sources.products is not None or material.texture is not None:
        return None
    tint = common_color([material], sources.lights_of(k), sources.ambient)
    return tint if cue is None or tint is None else common_tint(tint, cue.color)


def choose_tint(tints) -> np.ndarray | None:
    """Choose the tint that most materials have, so that one channel is enough for these; None where none has one."""
    groups: dict[tuple, int] = {}
    for tint in tints:
        if tint is not None:
            groups[tuple(tint)] = groups.get(tuple(tint), 0) + 1
    return np.array(max(groups, key=lambda tint: groups[tint])) if groups else None


def list_lights(scene) -> tuple[tuple, int]:
    """List the lights that aren't ambient, those of an area light one by one, without black ones; and how many of these
    there are."""
    lights = tuple(part for light in scene.lights for part in light_table.entry_of(light).expand(light))
    shining = tuple(light for light in lights if not light_table.is_black(light))
    return shining, len(lights) - len(shining)


def gather_sources(scene, options: Options) -> Sources:
    """List lights and materials, and which lights count for which materials; the exposure is included."""
    ambient_lights = tuple(light for light in scene.lights if light_table.entry_of(light).is_ambient)
    (lights, n_black), materials = list_lights(scene), number_materials(scene.meshes)[0]
    products = multiply_spectra(materials, lights, ambient_lights, options)
    if products is None and options.exposure != 0.0:
        ambient_lights, lights, materials = expose(ambient_lights, lights, materials, 2.0**options.exposure)
    ambient = sum((np.array(light.color) for light in ambient_lights), np.zeros(3))
    if products is None:
        is_reflecting = [[any(material.diffuse) or any(material.specular)] for material in materials]
    else:
        is_reflecting = [products.diffuse.any(axis=2), products.specular.any(axis=2), products.grazing.any(axis=2)]
        is_reflecting = np.logical_or.reduce(is_reflecting)
    is_lit = np.ones((len(materials), len(lights)), np.bool_) & np.array(is_reflecting, np.bool_)
    return Sources(ambient, lights, materials, products, is_lit, n_black)


def expose(ambient_lights, lights, materials, scale):
    """Lights and emissive materials with all intensities multiplied: the illumination equation is linear in them."""

    def brighter(source, field):
        return replace(source, **{field: tuple(scale * component for component in getattr(source, field))})

    return (
        tuple(brighter(light, "color") for light in ambient_lights),
        tuple(brighter(light, "color") for light in lights),
        tuple(brighter(material, "emissive") for material in materials),
    )


def check_brightness(bound) -> None:
    """Refuse a scene whose intensities a picture can't hold."""
    if not bound <= LARGEST:
        raise SceneError(
            f"the scene's lights and materials may give intensities up to {bound:.3g}; legal is up to {LARGEST:.3g}, "
            "the largest float32: give lights and materials smaller colors"
        )
