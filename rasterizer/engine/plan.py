"""The plan of a picture: what this scene needs, and nothing else, as the arrays and small numbers that the pipeline
takes.

Found here, from the scene alone: one channel or three, float32 or float64, whether words may carry intensities, which
row functions are compiled, where the z-buffer's range lies. The bounds that justify a cheaper path stand beside the
choice.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..errors import SceneError
from ..geometry.points import number_materials
from ..options import Options
from ..pipeline import texture_sampling as texturing
from ..pipeline.a_buffer import Opacity, least_transmitted
from ..pipeline.clip import find_nearest
from ..pipeline.depth_cueing import Cue
from ..pipeline.encode import RANGE_CLAMP, RANGE_GLOBAL, RANGE_LOCAL, Encoding
from ..pipeline.light_kinds import light_function_of
from ..pipeline.records import CODINGS, EXACT, IN_PLANES, IN_WORDS, LEVEL_MASK, NORMAL_PLANES, Coding
from ..pipeline.texture_sampling import Textures
from ..pipeline.transform import make_screen
from ..scene.lights import AmbientLight, AreaLight
from .error_bounds import (
    DOUBLE,
    EXPONENTS,
    SINGLE,
    WRITTEN,
    Reflected,
    Surroundings,
    find_most,
    find_reflected,
    frame_error,
    lighting_error,
)
from .intensity_bounds import common_color, common_tint, has_highlight, kind_of, model_of
from .spectral_products import Products, multiply_spectra

LARGEST = float(np.finfo(np.float32).max)  # that a picture can hold
SMALL, LARGE = 2.0**-40, 2.0**60  # scene units: squares of lengths between them keep their digits in float32
NEAREST = (
    2.0**-20
)  # the fitted near plane is never nearer than this part of the furthest distance: depth keeps 2^-18 there
MOST_DEEP = 2.0**40  # what is further than so many times the nearest depth that is seen is clipped
DEEP = 2.0**-10  # where the box round the scene spans more than this, the depths that are seen are looked for
BAND_WORDS = 2**17  # a band's z-buffer is about 1 MB: half of a usual L2 cache


class Plan(NamedTuple):
    """What this scene needs, whatever the camera."""

    n_channel: int
    tint: np.ndarray  # (3,) float32: the colour of a picture with one channel
    dtype: np.dtype
    coding: int  # the cheapest way that attributes may take to the samples; see pipeline/records.py
    level_scale: float  # levels a unit of intensity
    normal_limit: float  # how far float32 planes may turn a normal, see find_normals in pipeline/records.py
    bound: float  # the largest intensity that any point can have
    reflected: Reflected  # how bright each light makes each material, not amplified
    most: np.ndarray  # (n_light,): how much each light amplifies at most
    brightest_background: (
        float  # the largest component of what lies behind the picture, or of what it fades to with depth
    )
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


def make_plan(scene, options: Options, albedo, is_precise=False, clearances=None) -> Plan:
    """Find out what a scene needs.

    Parameters
    ----------
    albedo : (n_point, 3) float64, linear colours given with the model, or no rows
    is_precise : use float64 even where the scene alone does not ask for it; see `fits_float32`
    clearances : (n_light,) float64, distances that no lit point comes nearer to the lights than, or None: lights that
        amplify without limit need float64 then

    Raises SceneError where the picture's intensities may be too large for float32.
    """
    ambient_lights, lights, materials = list_parts(scene)
    products = multiply_spectra(materials, lights, ambient_lights, options)
    if products is None and options.exposure != 0.0:
        ambient_lights, lights, materials = expose(ambient_lights, lights, materials, 2.0**options.exposure)
    ambient = sum((np.array(light.color) for light in ambient_lights), np.zeros(3))
    is_textured = any(material.texture is not None for material in materials)
    has_albedo = len(albedo) > 0
    is_tinted = products is None and not is_textured and not (has_albedo and np.ptp(albedo, axis=1).any())
    tint = common_color(materials, lights, ambient) if is_tinted else None
    cue = scene.depth_cue
    tint = tint if cue is None or tint is None else common_tint(tint, cue.color)
    with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is refused
        most_albedo = albedo.max(initial=1.0) * brightest_texel(materials)
        reflected = find_reflected(materials, lights, ambient, most_albedo, products)
    most = find_most(lights, clearances)
    greatest = reflected.amplified(most)
    fades_to = max(cue.color) if cue is not None else 0.0
    bound, behind = max(greatest.bound, fades_to), max(fades_to, *(scene.background or (0.0,)))
    check_brightness(max(reflected.bound, fades_to))
    # Float32 may spend half of the tolerance on rounding, a quarter each on normals and on colours between the corners;
    # or the rest on intensities between them.
    rounding = lighting_error(greatest, SINGLE) + WRITTEN * SINGLE * (behind + bound)
    has_shadows = any(light.shadow is not None for light in lights)
    # Next to a step no error is small: the levels of a toon, the edges of shadows and of texels.
    is_stepped = has_shadows or is_textured or any(material.reflection == "toon" for material in materials)
    # And none has a bound where a tangent nearly stands upright on the surface.
    # Depth cueing reads depths from exact records.
    is_stepped = is_stepped or any(material.is_anisotropic for material in materials) or cue is not None
    is_steep = any(m.shininess < 1.0 and has_highlight(m) and model_of(m) in EXPONENTS for m in materials)
    is_single = options.tolerance > 0 and rounding <= options.tolerance / 2 and are_single(lights)
    is_single = is_single and not (is_precise or is_stepped or is_steep or products)
    dtype = np.dtype(np.float32 if is_single else np.float64)
    is_lit_per_sample = options.shading == "phong"
    is_opaque = all(material.is_opaque for material in materials)
    coding, normal_limit = EXACT, 0.0
    if is_lit_per_sample and is_single and is_opaque:
        normal_limit = options.tolerance / 4 / (np.sqrt(3.0) * SINGLE * max(greatest.turned, 1e-30))
        coding = NORMAL_PLANES if normal_limit > 3.0 else EXACT
    elif is_single and is_opaque and np.isfinite(bound):
        coding = IN_WORDS if tint is not None else IN_PLANES
    return Plan(
        n_channel=3 if tint is None else 1,
        tint=np.ones(3, np.float32) if tint is None else tint.astype(np.float32),
        dtype=dtype,
        coding=coding,
        level_scale=(int(LEVEL_MASK) - 1) / (bound + rounding) if 0.0 < bound + rounding < np.inf else 1.0,
        normal_limit=normal_limit,
        bound=bound,
        reflected=reflected,
        most=most,
        brightest_background=behind,
        rounding=rounding,
        is_flat=options.is_flat,
        is_lit_per_sample=is_lit_per_sample,
        ambient=ambient,
        lights=lights,
        materials=materials,
        has_albedo=has_albedo,
        has_shadows=has_shadows,
        has_tangents=any(material.is_anisotropic and material.tangent == "u" for material in materials),
        textures=list_textures(materials) if is_textured else None,
        opacity=None
        if is_opaque
        else list_opacities(materials, least_transmitted(options.tolerance, bound, is_single)),
        products=products,
        cue=None if cue is None else make_cue(cue, 3 if tint is None else 1),
    )


def make_cue(cue, n_channel) -> Cue:
    """Depth cueing as the pipeline takes it; with one channel its colour is a multiple of the tint, whose largest
    component is 1."""
    return Cue(cue.scale, cue.start, np.array(cue.color if n_channel == 3 else [max(cue.color)], np.float64))


def list_parts(scene):
    """The ambient lights, the others (those of an area light one by one), and the different materials."""
    ambient = tuple(light for light in scene.lights if isinstance(light, AmbientLight))
    others = [light for light in scene.lights if not isinstance(light, AmbientLight)]
    lights = tuple(part for light in others for part in (light.cells() if isinstance(light, AreaLight) else (light,)))
    return ambient, lights, number_materials(scene.meshes)[0]


def expose(ambient_lights, lights, materials, scale):
    """Lights and glowing materials with all intensities multiplied: the illumination equation is linear in them."""

    def brighter(source, field):
        return replace(source, **{field: tuple(scale * component for component in getattr(source, field))})

    return (
        tuple(brighter(light, "color") for light in ambient_lights),
        tuple(brighter(light, "color") for light in lights),
        tuple(brighter(material, "emissive") for material in materials),
    )


def brightest_texel(materials) -> float:
    """The largest component of any texture, at least 1."""
    images = [material.texture.image for material in materials if material.texture is not None]
    return max((float(image[..., :3].max()) for image in images), default=1.0)


def list_opacities(materials, least) -> Opacity:
    """How transparent the materials are; see pipeline/a_buffer.py for `least`."""
    return Opacity(
        np.array([material.opacity for material in materials]),
        np.array([material.is_opaque for material in materials], np.bool_),
        least,
    )


def list_textures(materials) -> Textures:
    """Lay the textures of materials, at least one, behind each other; those that are shared, once."""
    different = {id(material.texture): material.texture for material in materials if material.texture is not None}
    number = {key: k for k, key in enumerate(different)}
    levels = [level for texture in different.values() for level in texture.pyramid]
    first = np.cumsum([0] + [level.shape[0] * level.shape[1] for level in levels])
    filters = {
        "nearest": texturing.FILTER_NEAREST, "bilinear": texturing.FILTER_BILINEAR,
        "trilinear": texturing.FILTER_TRILINEAR,
    }  # fmt: skip
    wraps = {"repeat": texturing.WRAP_REPEAT, "clamp": texturing.WRAP_CLAMP, "mirror": texturing.WRAP_MIRROR}
    return Textures(
        np.concatenate([level.ravel() for level in levels]),
        np.array(
            [(start, level.shape[1], level.shape[0]) for start, level in zip(first, levels, strict=False)], np.int64
        ),
        np.cumsum([0] + [len(texture.pyramid) for texture in different.values()]).astype(np.int64),
        np.array([filters[texture.filter] for texture in different.values()], np.int64),
        np.array([[wraps[word] for word in texture.wrap] for texture in different.values()], np.int64),
        np.array([number.get(id(material.texture), -1) for material in materials], np.int64),
    )


def check_brightness(bound) -> None:
    """Refuse a scene whose intensities a picture can't hold."""
    if not bound <= LARGEST:
        raise SceneError(
            f"the scene's lights and materials may give intensities up to {bound:.3g}; legal is up to {LARGEST:.3g}, the largest "
            "float32: give lights and materials smaller colors"
        )


def are_single(lights) -> bool:
    """Tell whether the numbers of lights have a place in float32, and their products with squares of lengths, too."""
    numbers = [number for light in lights for number in getattr(light, "attenuation", ()) if number > 0.0]
    numbers += [light.range for light in lights if getattr(light, "range", None) is not None]
    return all(SMALL <= number <= LARGE for number in numbers)


def fits_float32(plan: Plan, tolerance, surroundings: Surroundings) -> bool:
    """Tell whether float32 leaves room enough for a plan's approximations in one view, see `make_plan`.

    Lengths and their squares must keep their digits, from the nearest point to a light to the furthest one from the
    eye; a light that is further away than LARGE is found by the furthest point's clearance.
    """
    with_places = surroundings.clearances[np.isfinite(surroundings.clearances)]
    lengths = [surroundings.furthest, *with_places]
    if not all(SMALL <= length <= LARGE for length in lengths):
        return False
    if (find_most(plan.lights, surroundings.clearances) > plan.most).any():
        return False
    # Nothing is kept back here: where a normal vanishes or a light lies on a surface, float64 is right.
    if surroundings.is_lit_per_sample and surroundings.shortest <= 0.0:
        return False
    return rounding_of(plan, surroundings) <= tolerance / 2


def rounding_of(plan: Plan, surroundings: Surroundings) -> float:
    """What rounding may add to an intensity in one view, in the plan's type, and in the float32 of the picture."""
    u = SINGLE if plan.dtype == np.float32 else DOUBLE
    reflected = plan.reflected.amplified(find_most(plan.lights, surroundings.kept().clearances))
    written = WRITTEN * SINGLE * (plan.brightest_background + reflected.bound)
    return frame_error(reflected, surroundings, u) + written


def error_bound_of(plan: Plan, tolerance, surroundings: Surroundings) -> float:
    """The largest error of an intensity in one view, against the exact evaluation of the same polygons; see `Stats`.

    Float64 leaves the rounding alone. Float32 adds half a level where a polygon has one intensity in its words, a
    quarter of the tolerance for the normals' planes and one for colours', or all of it for what Gouraud's method has
    between the corners.
    """
    rounding, approximated = rounding_of(plan, surroundings), 0.0
    if plan.coding != EXACT:
        approximated = tolerance / 4 * (2 if plan.has_albedo else 1) if plan.is_lit_per_sample else tolerance - rounding
        approximated = 0.5 / plan.level_scale if plan.is_flat else max(approximated, 0.0)
    return float(rounding + approximated)


def make_coding(plan: Plan, screen, tolerance) -> Coding:
    """Say what words and records hold, for one view."""
    depth_scale = depth_offset = 0.0
    if not screen.is_perspective:
        depth_scale = 1.0 / screen.z_scale if screen.z_scale != 0 else 0.0
        depth_offset = -screen.z_offset * depth_scale if screen.z_scale != 0 else screen.near
    if screen.is_perspective and screen.z_scale != 0:
        inv_w_scale, inv_w_offset = 1.0 / screen.z_scale, -screen.z_offset / screen.z_scale
    elif screen.is_perspective:
        inv_w_scale, inv_w_offset = 0.0, 1.0 / screen.near
    else:
        inv_w_scale, inv_w_offset = 0.0, 1.0
    return CODINGS[plan.coding](
        kind=plan.coding,
        level_scale=plan.level_scale,
        level_tolerance=max(0.0, tolerance - plan.rounding) * plan.level_scale,
        normal_limit=plan.normal_limit,
        albedo_tolerance=tolerance / 4 / max(plan.bound, 1e-30),
        needs_distance=plan.coding == NORMAL_PLANES
        and any(light_function_of(kind_of(light)).needs_position for light in plan.lights),
        inv_w_offset=inv_w_offset,
        inv_w_scale=inv_w_scale,
        depth_offset=depth_offset,
        depth_scale=depth_scale,
    )


def make_encoding(plan: Plan, background, color_range, scale=1.0) -> Encoding:
    """Say how linear colour becomes 8 bits; `background` is a linear colour or None."""
    behind = np.array(background or (0, 0, 0), np.float32)
    policy = {"clamp": RANGE_CLAMP, "global": RANGE_GLOBAL, "local": RANGE_LOCAL}[color_range]
    is_grey = plan.n_channel == 1 and np.ptp(plan.tint) == 0.0 and np.ptp(behind) == 0.0
    return Encoding(is_grey, plan.tint, behind, background is not None, policy, scale)


def fit_depth_range(camera, view, bounds) -> tuple[tuple[float, float], float]:
    """Return ((near, far), clip distance) in scene units: the camera's own, else fitted to the scene.

    Parameters
    ----------
    bounds : (n_mesh, 2, 3) float64, boxes round the meshes, world space
    """
    nearest, furthest = depths_of_boxes(view, bounds)
    if camera.is_perspective:
        furthest = furthest if furthest > 0 else 1.0
        # A little more room, so that rounding clips nothing. What a far plane cuts off does not push the near one away.
        deepest = furthest if camera.far is None else min(furthest, camera.far)
        near, far = max(nearest * (1 - NEAREST), deepest * NEAREST), furthest * (1 + NEAREST)
    else:
        margin = NEAREST * (furthest - nearest)
        near, far = max(nearest - margin, 0.0), max(furthest + margin, 0.0)
    near = near if camera.near is None else camera.near
    if camera.far is not None:
        return (near, camera.far), camera.far
    return (near, max(far, near)), np.inf


def depths_of_boxes(view, bounds) -> tuple[float, float]:
    """The depths between which boxes lie, scene units."""
    depth = (bounds - view.eye) * view.forward  # (n_mesh, 2, 3): an axis' share of the depth at both ends of each box
    return float(depth.min(axis=1).sum(axis=1).min()), float(depth.max(axis=1).sum(axis=1).max())


def fit_screen(view, projection, depth_range, far_clip, geometry, size, bounds=None):
    """The screen of a view: what is nearer than `depth_range` is clipped, and the z-buffer is fitted to the depths that
    are seen.

    So planes that somebody gives far before or behind the scene cost no digits of depth. With perspective the
    z-buffer's 38 bits are even in 1/w: they leave 2^-38 · w/near of the depth w, so near counts most. Where it is small
    beside far, the nearest depth that is seen is looked for. 1/w is rounded to 2^-53 of the nearest one, twice: a
    relative error of 2^-52 · w/near, which `Stats.error_bound` counts. What is further than MOST_DEEP times as far as
    the nearest that is seen is clipped: depth tells nothing of it any more.

    What lies between the near plane and the nearest depth that is seen needs a depth, too, for the planes of triangles
    that reach there; the near plane is brought so near to the range that such depths leave it by no more than 2^20
    times.

    Parameters
    ----------
    depth_range : (near, far), scene units; `far` clips only as `far_clip`
    size : (width, height) of the picture in samples
    bounds : (n_mesh, 2, 3) float64, boxes round the meshes, world space; None where `depth_range` is fitted to them
        already
    """
    near, far = depth_range
    nearest, furthest = depth_range if bounds is None else depths_of_boxes(view, bounds)
    if not projection.is_perspective:
        margin = NEAREST * (furthest - nearest)
        fitted = max(near, nearest - margin), min(far, furthest + margin)
        return make_screen(view, projection, fitted if fitted[0] < fitted[1] else depth_range, near, far_clip)
    far = min(far, furthest * (1 + NEAREST)) if near < furthest else far
    near_clip = near
    if near < far * DEEP:
        screen = make_screen(view, projection, (near, far), near, far_clip)
        seen = find_nearest(geometry.positions, geometry.vertex, screen, *size) * (1 - NEAREST)
        near = seen if near < seen < far else near
    if near * MOST_DEEP < far:
        far = far_clip = near * MOST_DEEP
    return make_screen(view, projection, (near, far), max(near_clip, near * NEAREST), far_clip)


def choose_band_rows(width, height, n_thread, factor) -> int:
    """Choose the height of a band in rows of samples, a multiple of `factor`: its z-buffer fits the L2 cache, and there
    are several bands for each thread."""
    rows = max(8, BAND_WORDS // width)
    if n_thread > 1:
        rows = min(rows, max(16, -(-height // (4 * n_thread))))
    return max(1, min(rows, height) // factor) * factor
