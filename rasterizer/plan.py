"""The plan of a picture: what this scene needs, and nothing else, as the arrays and small numbers that the pipeline takes.

Found here, from the scene alone: one channel or three, float32 or float64, whether words may carry intensities, which
row functions are compiled, where the z-buffer's range lies. The bounds that justify a cheaper path stand beside the choice.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .bounds import common_color, common_tint, intensity_bounds, kind_of
from .options import Options
from .pipeline import texture as texturing
from .pipeline.clip import find_nearest
from .pipeline.cue import Cue
from .pipeline.layers import Opacity
from .pipeline.lights import LIGHTS
from .pipeline.records import CODINGS, EXACT, IN_PLANES, IN_WORDS, LEVEL_MASK, NORMAL_PLANES, Coding
from .pipeline.resolve import CLAMP, GLOBAL, LOCAL, Encoding
from .pipeline.texture import Textures
from .pipeline.transform import make_screen
from .scene.geometry import number_materials
from .scene.lights import AmbientLight, AreaLight
from .spectral import Products, multiply_spectra

ULP = 2.0**-24  # relative rounding error of float32
NEAREST = 2.0**-20  # the fitted near plane is never nearer than this part of the furthest distance: depth keeps 2^-18 there
DEEP = 2.0**-10  # where the box round the scene spans more than this, the depths that are seen are looked for
BAND_WORDS = 2**17  # a band's z-buffer is about 1 MB: half of a usual L2 cache


class Plan(NamedTuple):
    """What this scene needs, whatever the camera."""

    n_channel: int
    tint: np.ndarray  # (3,) float32: the colour of a picture with one channel
    dtype: np.dtype
    coding: int  # the cheapest way that attributes may take to the samples; see pipeline/records.py
    level_scale: float  # levels a unit of intensity
    normal_limit: float  # largest rise of a normal over a triangle's box for which float32 planes are good enough
    bound: float  # the largest intensity that any point can have
    magnified: float  # the largest sum of highlights, each times its exponent
    rounding: float  # what float32 may add to an intensity
    error_bound: float  # linear intensity
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


def make_plan(scene, options: Options, albedo, is_precise=False) -> Plan:
    """Find out what a scene needs.

    Parameters
    ----------
    albedo : (n_point, 3) float64, linear colours given with the model, or no rows
    is_precise : use float64 even where the scene alone does not ask for it; see `is_too_close`
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
    bound, shine = intensity_bounds(materials, lights, ambient, albedo.max(initial=1.0) * brightest_texel(materials))
    bound = bound if cue is None else max(bound, *cue.color)
    # Float32 may spend half of the tolerance on the lighting, a quarter on normals; affine interpolation the rest.
    rounding = ULP * (16.0 * bound + 8.0 * shine)
    has_shadows = any(light.shadow is not None for light in lights)
    # Next to a step no error is small: the levels of a toon, the edges of shadows and of texels.
    is_stepped = has_shadows or is_textured or any(material.reflection == "toon" for material in materials)
    # And none has a bound where a tangent nearly stands upright on the surface.
    # Depth cueing reads depths from exact records.
    is_stepped = is_stepped or any(material.is_anisotropic for material in materials) or cue is not None
    is_single = options.tolerance > 0 and rounding <= options.tolerance / 2 and not (is_precise or is_stepped or products)
    dtype = np.dtype(np.float32 if is_single else np.float64)
    is_lit_per_sample = options.shading == "phong"
    is_opaque = all(material.is_opaque for material in materials)
    coding, normal_limit = EXACT, 0.0
    if is_lit_per_sample and is_single and is_opaque:
        normal_limit = ((options.tolerance / 4) / (ULP * max(bound + 2.0 * shine, 1e-30)) - 3.0) / 4.0
        coding = NORMAL_PLANES if normal_limit > 0.0 else EXACT
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
        magnified=shine,
        rounding=rounding,
        # In float64 what is left is the rounding of the float32 output.
        error_bound=options.tolerance if is_single else 2.0 * ULP * max(bound, 1.0),
        is_lit_per_sample=is_lit_per_sample,
        ambient=ambient,
        lights=lights,
        materials=materials,
        has_albedo=has_albedo,
        has_shadows=has_shadows,
        has_tangents=any(material.is_anisotropic and material.tangent == "u" for material in materials),
        textures=list_textures(materials) if is_textured else None,
        opacity=None if is_opaque else list_opacities(materials),
        products=products,
        cue=None if cue is None else make_cue(cue, 3 if tint is None else 1),
    )


def make_cue(cue, n_channel) -> Cue:
    """Depth cueing as the pipeline takes it; with one channel its colour is a multiple of the tint, whose largest component is 1."""
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


def list_opacities(materials) -> Opacity:
    """How transparent the materials are."""
    return Opacity(
        np.array([material.opacity for material in materials]),
        np.array([material.is_opaque for material in materials], np.bool_),
    )


def list_textures(materials) -> Textures:
    """Lay the textures of materials, at least one, behind each other; those that are shared, once."""
    different = {id(material.texture): material.texture for material in materials if material.texture is not None}
    number = {key: k for k, key in enumerate(different)}
    levels = [level for texture in different.values() for level in texture.pyramid]
    first = np.cumsum([0] + [level.shape[0] * level.shape[1] for level in levels])
    filters = {"nearest": texturing.NEAREST, "bilinear": texturing.BILINEAR, "trilinear": texturing.TRILINEAR}
    wraps = {"repeat": texturing.REPEAT, "clamp": texturing.CLAMP, "mirror": texturing.MIRROR}
    return Textures(
        np.concatenate([level.ravel() for level in levels]),
        np.array([(start, level.shape[1], level.shape[0]) for start, level in zip(first, levels, strict=False)], np.int64),
        np.cumsum([0] + [len(texture.pyramid) for texture in different.values()]).astype(np.int64),
        np.array([filters[texture.filter] for texture in different.values()], np.int64),
        np.array([[wraps[word] for word in texture.wrap] for texture in different.values()], np.int64),
        np.array([number.get(id(material.texture), -1) for material in materials], np.int64),
    )


def is_too_close(plan: Plan, tolerance, furthest, clearance) -> bool:
    """Tell whether a point light is so close to a surface that float32 positions would be visible.

    Positions are relative to the eye: at the furthest depth they err by about 2^-22 of it. With d the light's clearance, that
    turns its direction by error/d and changes its attenuation by at most twice that share.

    Parameters
    ----------
    furthest : depth of the furthest vertex, scene units
    clearance : distance that no surface comes nearer to any point light than, scene units
    """
    magnification = 3.0 * plan.bound + 2.0 * plan.magnified
    return 2.0**-22 * furthest * magnification > tolerance / 4 * clearance


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
        needs_distance=plan.coding == NORMAL_PLANES and any(LIGHTS[kind_of(light)].needs_position for light in plan.lights),
        inv_w_offset=inv_w_offset,
        inv_w_scale=inv_w_scale,
        depth_offset=depth_offset,
        depth_scale=depth_scale,
    )


def make_encoding(plan: Plan, background, color_range, scale=1.0) -> Encoding:
    """Say how linear colour becomes 8 bits; `background` is a linear colour or None."""
    behind = np.array(background or (0, 0, 0), np.float32)
    policy = {"clamp": CLAMP, "global": GLOBAL, "local": LOCAL}[color_range]
    is_grey = plan.n_channel == 1 and np.ptp(plan.tint) == 0.0 and np.ptp(behind) == 0.0
    return Encoding(is_grey, plan.tint, behind, background is not None, policy, scale)


def fit_depth_range(camera, view, bounds) -> tuple[tuple[float, float], float]:
    """Return ((near, far), clip distance) in scene units: the camera's own, else fitted to the scene.

    Parameters
    ----------
    bounds : (n_mesh, 2, 3) float64, boxes round the meshes, world space
    """
    depth = (bounds - view.eye) * view.forward  # (n_mesh, 2, 3): an axis' share of the depth at both ends of each box
    nearest, furthest = depth.min(axis=1).sum(axis=1).min(), depth.max(axis=1).sum(axis=1).max()
    if camera.is_perspective:
        furthest = furthest if furthest > 0 else 1.0
        # A little more room, so that rounding clips nothing.
        near, far = max(nearest * (1 - NEAREST), furthest * NEAREST), furthest * (1 + NEAREST)
    else:
        margin = NEAREST * (furthest - nearest)
        near, far = max(nearest - margin, 0.0), max(furthest + margin, 0.0)
    near = near if camera.near is None else camera.near
    if camera.far is not None:
        return (near, camera.far), camera.far
    return (near, max(far, near)), np.inf


def fit_screen(view, projection, depth_range, far_clip, geometry, size):
    """The screen of a view with perspective whose depth range is fitted to a box: where that spans much, to what is seen in it.

    Parameters
    ----------
    depth_range : (near, far) of the box, scene units
    size : (width, height) of the picture in samples
    """
    near, far = depth_range
    if near < far * DEEP:
        # The box round the scene says little about the depths that are seen.
        screen = make_screen(view, projection, depth_range, near, far_clip)
        nearest = find_nearest(geometry.positions, geometry.vertex, screen, *size) * (1 - NEAREST)
        if near < nearest < far:
            depth_range = (nearest, far)
    return make_screen(view, projection, depth_range, near, far_clip)


def choose_band_rows(width, height, n_thread, factor) -> int:
    """Choose the height of a band in rows of samples, a multiple of `factor`: its z-buffer fits the L2 cache, and there are
    several bands for each thread."""
    rows = max(8, BAND_WORDS // width)
    if n_thread > 1:
        rows = min(rows, max(16, -(-height // (4 * n_thread))))
    return max(1, min(rows, height) // factor) * factor
