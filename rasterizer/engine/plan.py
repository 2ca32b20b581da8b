"""The plan of a picture: what this scene needs, and nothing else.

Found here, from the scene alone: one channel or three, float32 or float64, whether the entries of the visibility buffer
may carry intensities, which functions are compiled. The bounds that justify a cheaper way stand beside the choice. What
a view says is added later (view_plans.py).
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..errors import SceneError
from ..geometry.points import number_materials
from ..options import Options
from ..pipeline.a_buffer import Opacity, least_transmittance
from ..pipeline.depth_cueing import Cue
from ..pipeline.gradients import EXACT, IN_ENTRIES, LEVEL_PLANES, NORMAL_PLANES
from ..pipeline.texture_sampling import Textures
from ..pipeline.visibility import LEVEL_MASK
from . import light_table, reflection_table
from .error_bounds import WRITTEN, lighting_error
from .intensity_bounds import Reflected, compute_amplifications, compute_reflected
from .rounding import SINGLE
from .spectral_products import Products, multiply_spectra
from .surface_arrays import brightest_texel, list_opacities, list_textures, make_cue
from .tint import common_color, common_tint

LARGEST = float(np.finfo(np.float32).max)  # that a picture can hold
MOST_TURNED = 2.0**-12  # radians: a normal's error where shadows are looked up
SMALL, LARGE = 2.0**-40, 2.0**60  # scene units: squares of lengths between them keep their digits in float32


class Plan(NamedTuple):
    """What this scene needs, whatever the camera."""

    n_channel: int
    tint: np.ndarray  # (3,) float32: the colour of a picture with one channel
    dtype: np.dtype
    reasons: tuple[str, ...]  # why float32 won't do; none where it does
    coding: int  # the cheapest way that attributes may take to the samples; see pipeline/gradients.py
    level_scale: float  # levels a unit of intensity
    normal_limit: float  # how far float32 planes may turn a normal, see pipeline/gradients.py
    bound: float  # the largest intensity that any point can have
    reflected: Reflected  # how bright each light makes each material, not amplified
    most: np.ndarray  # (n_light,): how much each light amplifies at most
    brightest_background: float  # largest component of what lies behind the picture, or of what it fades to with depth
    rounding: float  # what rounding may add to an intensity, linear, before it is known where lights and surfaces are
    is_flat: bool
    is_lit_per_sample: bool
    ambient: np.ndarray  # (3,) float64, the sum of the ambient lights
    lights: tuple  # the others; those of an area light one by one
    materials: tuple  # the different ones of all meshes
    has_albedo: bool
    has_shadows: bool
    has_tangents: bool  # some material is brushed along u
    textures: Textures | None  # None where the scene has none
    opacity: Opacity | None  # None where all is opaque
    products: Products | None  # None where colours are multiplied channel by channel
    cue: Cue | None  # None where nothing fades with depth


class Sources(NamedTuple):
    """Where the light of a scene comes from, and what it falls on."""

    ambient: np.ndarray  # (3,) float64, the sum of the ambient lights
    lights: tuple  # the others; those of an area light one by one
    materials: tuple  # the different ones of all meshes
    products: Products | None  # those of spectra, in which the exposure is included

    @property
    def has_shadows(self) -> bool:
        """Some light casts shadows."""
        return any(light_table.shadow_of(light) is not None for light in self.lights)

    @property
    def is_textured(self) -> bool:
        """Some material has a texture."""
        return any(material.texture is not None for material in self.materials)

    @property
    def is_opaque(self) -> bool:
        """Nothing shows through anything."""
        return all(material.is_opaque for material in self.materials)


class Brightness(NamedTuple):
    """The largest intensities of a scene, linear."""

    reflected: Reflected  # not amplified
    most: np.ndarray  # (n_light,): how much each light amplifies at most
    greatest: Reflected  # amplified
    bound: float  # of any point, the colour of the depth cue included
    behind: float  # of the background, or of the colour of the depth cue
    rounding: float  # of float32: what it may add to an intensity


def make_plan(scene, options: Options, albedo, is_precise=False, clearances=None) -> Plan:
    """Find out what a scene needs.

    Parameters
    ----------
    albedo : (n_point, 3) float64, linear colours given with the model, or no rows
    is_precise : use float64 even where the scene alone does not ask for it; see view_plans.py
    clearances : (n_light,) float64, distances that no lit point comes nearer to the lights than, or None: lights that
        amplify without limit need float64 then

    Raises SceneError where the picture's intensities may be too large for float32.
    """
    sources = gather_sources(scene, options)
    tint = find_tint(sources, albedo, scene.depth_cue)
    brightness = bound_brightness(scene, sources, albedo, clearances)
    reasons = reasons_for_float64(sources, brightness, options, scene.depth_cue, is_precise)
    coding, normal_limit = choose_coding(sources, brightness, options, tint, not reasons)
    most_level, n_channel = brightness.bound + brightness.rounding, 3 if tint is None else 1
    least = least_transmittance(options.tolerance, brightness.bound, not reasons)
    materials = sources.materials
    return Plan(
        n_channel=n_channel,
        tint=np.ones(3, np.float32) if tint is None else tint.astype(np.float32),
        dtype=np.dtype(np.float64 if reasons else np.float32),
        reasons=reasons,
        coding=coding,
        level_scale=(int(LEVEL_MASK) - 1) / most_level if 0.0 < most_level < np.inf else 1.0,
        normal_limit=normal_limit,
        bound=brightness.bound,
        reflected=brightness.reflected,
        most=brightness.most,
        brightest_background=brightness.behind,
        rounding=brightness.rounding,
        is_flat=options.is_flat,
        is_lit_per_sample=options.shading == "phong",
        ambient=sources.ambient,
        lights=sources.lights,
        materials=materials,
        has_albedo=len(albedo) > 0,
        has_shadows=sources.has_shadows,
        has_tangents=any(material.is_anisotropic and material.tangent == "u" for material in materials),
        textures=list_textures(materials) if sources.is_textured else None,
        opacity=None if sources.is_opaque else list_opacities(materials, least),
        products=sources.products,
        cue=None if scene.depth_cue is None else make_cue(scene.depth_cue, n_channel),
    )


def gather_sources(scene, options: Options) -> Sources:
    """List lights and materials, those of an area light one by one; the exposure is included."""
    ambient_lights = tuple(light for light in scene.lights if light_table.entry_of(light).is_ambient)
    lights = tuple(part for light in scene.lights for part in light_table.entry_of(light).expand(light))
    materials = number_materials(scene.meshes)[0]
    products = multiply_spectra(materials, lights, ambient_lights, options)
    if products is None and options.exposure != 0.0:
        ambient_lights, lights, materials = expose(ambient_lights, lights, materials, 2.0**options.exposure)
    ambient = sum((np.array(light.color) for light in ambient_lights), np.zeros(3))
    return Sources(ambient, lights, materials, products)


def expose(ambient_lights, lights, materials, scale):
    """Lights and emissive materials with all intensities multiplied: the illumination equation is linear in them."""

    def brighter(source, field):
        return replace(source, **{field: tuple(scale * component for component in getattr(source, field))})

    return (
        tuple(brighter(light, "color") for light in ambient_lights),
        tuple(brighter(light, "color") for light in lights),
        tuple(brighter(material, "emissive") for material in materials),
    )


def find_tint(sources: Sources, albedo, cue) -> np.ndarray | None:
    """The RGB triple that all intensities are multiples of, so that one channel is enough; None where there is none."""
    is_colored = len(albedo) > 0 and bool(np.ptp(albedo, axis=1).any())
    if sources.products is not None or sources.is_textured or is_colored:
        return None
    tint = common_color(sources.materials, sources.lights, sources.ambient)
    return tint if cue is None or tint is None else common_tint(tint, cue.color)


def bound_brightness(scene, sources: Sources, albedo, clearances) -> Brightness:
    """Bound the intensities that a scene may have; SceneError where a picture can't hold them."""
    fades_to = max(scene.depth_cue.color) if scene.depth_cue is not None else 0.0
    with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is refused
        most_albedo = albedo.max(initial=1.0) * brightest_texel(sources.materials)
        reflected = compute_reflected(sources.materials, sources.lights, sources.ambient, most_albedo, sources.products)
    check_brightness(max(reflected.bound, fades_to))
    most = compute_amplifications(sources.lights, clearances)
    greatest = reflected.amplified(most)
    bound, behind = max(greatest.bound, fades_to), max(fades_to, *(scene.background or (0.0,)))
    rounding = lighting_error(greatest, SINGLE) + WRITTEN * SINGLE * (behind + bound)
    return Brightness(reflected, most, greatest, bound, behind, rounding)


def check_brightness(bound) -> None:
    """Refuse a scene whose intensities a picture can't hold."""
    if not bound <= LARGEST:
        raise SceneError(
            f"the scene's lights and materials may give intensities up to {bound:.3g}; legal is up to {LARGEST:.3g}, "
            "the largest float32: give lights and materials smaller colors"
        )


def reasons_for_float64(sources: Sources, brightness: Brightness, options, cue, is_precise) -> tuple[str, ...]:
    """Say why float32 won't do; nothing where it does.

    Float32 may spend half of the tolerance on rounding, a quarter each on normals and on colours between the corners;
    or the rest on intensities between them.
    """
    reasons = {
        "tolerance 0": options.tolerance == 0,
        "rounding beyond half of the tolerance": not brightness.rounding <= options.tolerance / 2,
        "numbers of lights beyond float32": not are_single(sources.lights),
        "this view": is_precise,
        # Next to a step no error is small: the edges of texels.
        "textures": sources.is_textured,
    }
    reasons |= {reflection_table.entry_of(m).reason_for_float64(m): True for m in sources.materials}
    # Depth cueing reads depths from exact records.
    reasons |= {"depth cueing": cue is not None, "spectra": bool(sources.products)}
    return tuple(reason for reason, holds in reasons.items() if reason and holds)


def are_single(lights) -> bool:
    """Tell whether the coefficients of lights keep their digits in float32, and their products with squares of lengths,
    too."""
    return all(SMALL <= length <= LARGE for light in lights for length in light_table.entry_of(light).lengths(light))


def choose_coding(sources: Sources, brightness: Brightness, options, tint, is_single) -> tuple[int, float]:
    """Choose the cheapest way that attributes may take to the samples, and how far planes may turn a normal, in u."""
    if not is_single or not sources.is_opaque:
        return EXACT, 0.0
    if options.shading == "phong":
        turned = max(brightness.greatest.turn_slope, 1e-30)
        angle = options.tolerance / 4 / turned
        if sources.has_shadows:  # they depend on normals, however dim the lights are
            angle = min(angle, MOST_TURNED)
        normal_limit = angle / (np.sqrt(3.0) * SINGLE)
        return (NORMAL_PLANES if normal_limit > 3.0 else EXACT), normal_limit
    if not np.isfinite(brightness.bound):
        return EXACT, 0.0
    return (IN_ENTRIES if tint is not None else LEVEL_PLANES), 0.0
