"""The plan of a picture: what this scene needs, and nothing else, as the arrays and small numbers that the pipeline takes.

Found here, from the scene alone: one channel or three, float32 or float64, whether words may carry intensities, which
row functions are compiled, where the z-buffer's range lies. The bounds that justify a cheaper path stand beside the choice.
"""

import math
from typing import NamedTuple

import numpy as np

from ._kernel import row_function
from .options import Options
from .pipeline.lighting import AMBIENT, DIFFUSE_COLOR, EMISSIVE, N_MATERIAL_COLUMN, SPECULAR_COLOR, Lighting
from .pipeline.lights import (
    ATTENUATION,
    AXIS,
    COLOR,
    CONE_EXPONENT,
    CONE_SCALE,
    COS_OUTER,
    INVERSE_RANGE,
    LIGHTS,
    MOST,
    N_NUMBER,
    VECTOR,
)
from .pipeline.records import CODINGS, EXACT, IN_PLANES, IN_WORDS, LEVEL_MASK, NORMAL_PLANES, Coding
from .pipeline.reflection import FRESNEL, LEAST_COSINE, LEVELS, REFLECTIONS, ROUGHNESS, SCALE, SHININESS
from .pipeline.resolve import CLAMP, GLOBAL, LOCAL, Encoding
from .scene.lights import AmbientLight, AreaLight, DirectionalLight, PointLight, SpotLight

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
    materials: tuple  # one a mesh
    has_albedo: bool


def make_plan(scene, options: Options, albedo, is_precise=False) -> Plan:
    """Find out what a scene needs.

    Parameters
    ----------
    albedo : (n_point, 3) float64, linear colours given with the model, or no rows
    is_precise : use float64 even where the scene alone does not ask for it; see `is_too_close`
    """
    ambient = sum((np.array(light.color) for light in scene.lights if isinstance(light, AmbientLight)), np.zeros(3))
    others = [light for light in scene.lights if not isinstance(light, AmbientLight)]
    lights = tuple(part for light in others for part in (light.cells() if isinstance(light, AreaLight) else (light,)))
    materials = tuple(mesh.material for mesh in scene.meshes)
    has_albedo = len(albedo) > 0
    tint = None if has_albedo else common_color(materials, lights, ambient)
    bound, shine = intensity_bounds(materials, lights, ambient, albedo.max(initial=1.0))
    # Float32 may spend half of the tolerance on the lighting, a quarter on normals; affine interpolation the rest.
    rounding = ULP * (16.0 * bound + 8.0 * shine)
    is_stepped = any(material.reflection == "toon" for material in materials)  # next to a step, no error is small
    is_single = options.tolerance > 0 and rounding <= options.tolerance / 2 and not is_precise and not is_stepped
    dtype = np.dtype(np.float32 if is_single else np.float64)
    is_lit_per_sample = options.shading == "phong"
    coding, normal_limit = EXACT, 0.0
    if is_lit_per_sample and is_single:
        normal_limit = ((options.tolerance / 4) / (ULP * max(bound + 2.0 * shine, 1e-30)) - 3.0) / 4.0
        coding = NORMAL_PLANES if normal_limit > 0.0 else EXACT
    elif is_single and np.isfinite(bound):
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
    )


def _kind(light) -> str:
    """Name of the light's row function."""
    return {DirectionalLight: "directional", PointLight: "point", SpotLight: "spot"}[type(light)]


def _model(material) -> str:
    """Name of the material's reflection model: a dull material needs no exponent, and what isn't asked for costs nothing."""
    if material.reflection in ("lambert", "oren-nayar", "toon"):
        return material.reflection
    if max(material.specular) == 0:
        return "lambert"
    if material.reflection == "cook-torrance":
        return material.distribution
    return f"weighted {material.reflection}" if material.normalized or material.fresnel is not None else material.reflection


def _has_highlight(material) -> bool:
    """Tell whether a material has a highlight."""
    return max(material.specular) > 0 and REFLECTIONS[_model(material)].has_highlight


def first_fresnel(material) -> float:
    """F0 of a material's specular reflection function W(θ); with 1, W is 1."""
    if material.fresnel is not None:
        return material.fresnel
    return 0.04 if material.reflection == "cook-torrance" else 1.0


def highlight_scale(material) -> float:
    """The factor of a normalised highlight, beside N·L; 0 for a classic one. Sources: see `Material`."""
    n = material.shininess
    if not material.normalized:
        return 0.0
    return (n + 2) / 2 if material.reflection == "phong" else (n + 2) * (n + 4) / (8 * (2 ** (-n / 2) + n))


def highlight_bounds(material) -> tuple[float, float]:
    """Largest value of a material's highlight for ks = 1, and how far it magnifies a relative error of the directions.

    A power h^n magnifies by n, W(θ) by 5 at most, N·L by 1.
    Cook-Torrance with GGX: π D <= 1/α², N·L G1(L)/(2 N·L) <= 1/2, G1(V)/(2 N·V) <= 1/α. ln D rises by at most 2/α a radian, and
    G by 1/α. With Beckmann's D: π D has its maximum at tan² = max(0, 2 m² - 1), and G1(V)/N·V <= 3.535/m.
    """
    model, r = _model(material), material.roughness
    if model == "ggx":
        return 1.0 / (2.0 * r**3), 4.0 / r + 5.0
    if model == "beckmann":
        tangent_square = max(0.0, 2.0 * r * r - 1.0)
        return math.exp(-tangent_square / r**2) * (1.0 + tangent_square) ** 2 / r**3 * (3.535 / 4.0), 4.0 / r + 5.0
    if not _has_highlight(material):
        return 0.0, 0.0
    fresnel = 5.0 if material.fresnel is not None else 0.0
    return max(highlight_scale(material), 1.0), material.shininess + fresnel + (1.0 if material.normalized else 0.0)


def matte_magnification(material) -> float:
    """How far a material's matte reflection magnifies an error of the directions, beyond Lambert's: tan β of Oren-Nayar does."""
    square = material.roughness**2
    return 0.45 * square / (square + 0.09) / LEAST_COSINE if material.reflection == "oren-nayar" else 0.0


def common_color(materials, lights, ambient):
    """Return the RGB triple, its largest component 1, of which every intensity of the picture is a multiple; None if there is none.

    Intensities are products of a material's and a light's colour, so it is enough that all lights are grey and all the
    materials' colours multiples of one triple, or the other way round.
    """
    of_lights = [np.array(light.color) for light in lights] + [ambient]
    of_materials = [np.array(getattr(m, name)) for m in materials for name in ("ambient", "diffuse")]
    of_materials += [np.array(m.specular) for m in materials if _has_highlight(m)]
    glow = [np.array(m.emissive) for m in materials]
    if _direction(of_lights) is not None and np.ptp(_direction(of_lights)) == 0.0:
        return _direction(of_materials + glow)
    if _direction(of_materials) is not None and np.ptp(_direction(of_materials)) == 0.0:
        return _direction(of_lights + glow)
    return None


def _direction(colors):
    """The triple, its largest component 1, of which all colours are multiples (to float64 rounding); None if there is none."""
    colors = np.array([color for color in colors if color.max() > 0.0]).reshape(-1, 3)
    if len(colors) == 0:
        return np.ones(3)
    scaled = colors / colors.max(axis=1, keepdims=True)
    # Quotients of equal colours differ by a rounding error each.
    return scaled[0] if np.ptp(scaled, axis=0).max() <= 4 * np.finfo(float).eps else None


def intensity_bounds(materials, lights, ambient, most_albedo) -> tuple[float, float]:
    """Largest intensity that any point can have, and the largest sum of highlights, each times its exponent or what stands for it.

    The second says how far an error of the directions is magnified: a power h^n multiplies the relative error of h by n. Each of
    the roundings on the way to h costs 2^-24, of which about eight fall together; the matte terms take about sixteen.
    """
    bound = magnified = 0.0
    for material in materials:
        matte = max(material.ambient) * ambient.max() * most_albedo + max(material.emissive)
        peak, magnification = highlight_bounds(material)
        specular = peak * max(material.specular)
        shine = steep = rough = 0.0
        for light in lights:
            most = np.inf if getattr(light, "amplify", False) and light.attenuation[0] < 1.0 else 1.0
            # A light that gives nothing can't be amplified: no 0 times infinity.
            matte += most * max(light.color) * max(material.diffuse) * most_albedo if max(light.color) > 0 else 0.0
            shine += most * max(light.color) * specular if max(light.color) > 0 and specular > 0 else 0.0
            if max(light.color) > 0 and (slope := max(material.diffuse) * matte_magnification(material)) > 0:
                rough += slope * most * max(light.color) * most_albedo
            if max(light.color) > 0 and (slope := steepness(light)) > 0:
                steep += slope * most * max(light.color) * (max(material.diffuse) * most_albedo + specular)
        bound = max(bound, matte + shine)
        magnified = max(magnified, shine * magnification + rough + steep)
    return bound, magnified


def steepness(light) -> float:
    """How far the factors of a light's cone and range magnify an error of its direction, or a relative one of its distance.

    t² (3 - 2 t) rises by at most 3/2 of what t does, c^e by at most e; (d/r)^4 by four times the relative error of d, twice that
    of d². Infinite for a sharp cone: its edge is drawn in float64.
    """
    slope = 4.0 if getattr(light, "range", None) is not None else 0.0
    if isinstance(light, SpotLight):
        inner, outer = cone_cosines(light)
        slope += light.exponent + (1.5 / (inner - outer) if inner > outer else np.inf)
    return slope


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


def make_lighting(plan: Plan, view) -> Lighting:
    """Write lights and materials as arrays, for one view: lights that move with the camera, and positions relative to the eye."""
    n_light, channels = len(plan.lights), range(plan.n_channel)
    axes = np.stack([view.right, view.up, -view.forward])  # rows: the camera's axes in the world
    light_colors = np.array([light.color for light in plan.lights]).reshape(-1, 3)
    is_grey = bool((np.ptp(light_colors, axis=1) == 0).all()) if n_light else True
    light = np.zeros((n_light, N_NUMBER))
    for row, source in zip(light, plan.lights, strict=True):
        row[COLOR : COLOR + 3] = source.color
        in_camera = source.attached == "camera"
        if isinstance(source, DirectionalLight):
            row[VECTOR : VECTOR + 3] = _to_world(np.array(source.direction), axes, in_camera) * -1.0
            continue
        position = np.array(source.position)
        row[VECTOR : VECTOR + 3] = position @ axes if in_camera else position - view.eye
        row[ATTENUATION : ATTENUATION + 3] = source.attenuation
        row[MOST] = np.inf if source.amplify else 1.0
        row[INVERSE_RANGE] = 1.0 / source.range if source.range is not None else 0.0
        if isinstance(source, SpotLight):
            row[AXIS : AXIS + 3] = _to_world(np.array(source.direction), axes, in_camera)
            inner, outer = cone_cosines(source)
            row[COS_OUTER], row[CONE_EXPONENT] = outer, source.exponent
            row[CONE_SCALE] = 1.0 / (inner - outer) if inner > outer else np.inf
    material = np.zeros((len(plan.materials), N_MATERIAL_COLUMN))
    for row, source in zip(material, plan.materials, strict=True):
        row[SHININESS], row[ROUGHNESS], row[LEVELS] = source.shininess, source.roughness, source.levels
        row[FRESNEL], row[SCALE] = first_fresnel(source), highlight_scale(source)
        for column, color in (
            (EMISSIVE, source.emissive),
            (AMBIENT, np.array(source.ambient) * plan.ambient),
            (DIFFUSE_COLOR, source.diffuse),
            (SPECULAR_COLOR, source.specular),
        ):
            row[column : column + 3] = color
    if plan.n_channel == 1:
        _reduce_to_one_channel(light, material, is_grey)
    is_shiny = np.array([_has_highlight(source) for source in plan.materials], np.bool_)
    models = [REFLECTIONS[_model(source)] for source in plan.materials]
    is_view_dependent = np.array([model.needs_view for model in models], np.bool_)
    addresses = np.array([row_function(function, plan.dtype).address for function in row_functions_of(plan)], np.int64)
    return Lighting(
        addresses[:n_light], light.astype(plan.dtype), addresses[n_light:], material.astype(plan.dtype),
        is_shiny, is_view_dependent, len(channels), 1 if is_grey or plan.n_channel == 1 else 3, bool(is_view_dependent.any()),
        any(LIGHTS[_kind(source)].needs_position for source in plan.lights), plan.has_albedo,
    )  # fmt: skip


def row_functions_of(plan: Plan) -> list:
    """The row functions that a scene uses, and nothing else is compiled: of its lights one by one, then of its materials."""
    of_lights = [LIGHTS[_kind(source)].row_function for source in plan.lights]
    return of_lights + [REFLECTIONS[_model(source)].row_function for source in plan.materials]


def _to_world(direction, axes, in_camera):
    """A direction that may be given in the camera's frame."""
    return direction @ axes if in_camera else direction


def cone_cosines(light) -> tuple[float, float]:
    """Cosines of a spot light's inner and outer angle."""
    return math.cos(math.radians(light.inner)), math.cos(math.radians(light.outer))


def _reduce_to_one_channel(light, material, is_grey) -> None:
    """Put the largest component of every colour first: all of them are grey or multiples of the picture's tint."""
    light[:, COLOR] = light[:, COLOR : COLOR + 3].max(axis=1, initial=0.0)
    for column in (EMISSIVE, AMBIENT, DIFFUSE_COLOR, SPECULAR_COLOR):
        material[:, column] = material[:, column : column + 3].max(axis=1)


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
        needs_distance=plan.coding == NORMAL_PLANES and any(LIGHTS[_kind(light)].needs_position for light in plan.lights),
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


def choose_band_rows(width, height, n_thread, factor) -> int:
    """Choose the height of a band in rows of samples, a multiple of `factor`: its z-buffer fits the L2 cache, and there are
    several bands for each thread."""
    rows = max(8, BAND_WORDS // width)
    if n_thread > 1:
        rows = min(rows, max(16, -(-height // (4 * n_thread))))
    return max(1, min(rows, height) // factor) * factor
