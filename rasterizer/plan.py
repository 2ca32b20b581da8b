"""The plan of a picture: what this scene needs, and nothing else, as the arrays and small numbers that the pipeline takes.

Found here, from the scene alone: one channel or three, float32 or float64, whether words may carry intensities, which
row functions are compiled, where the z-buffer's range lies. The bounds that justify a cheaper path stand beside the choice.
"""

from typing import NamedTuple

import numpy as np

from ._kernel import row_function
from .options import Options
from .pipeline.lighting import AMBIENT, DIFFUSE_COLOR, EMISSIVE, N_MATERIAL_COLUMN, SPECULAR_COLOR, Lighting
from .pipeline.lights import ATTENUATION, COLOR, LIGHTS, MOST, N_NUMBER, VECTOR
from .pipeline.reflection import REFLECTIONS, SHININESS
from .pipeline.resolve import CLAMP, GLOBAL, LOCAL, Encoding, make_srgb_tables
from .pipeline.scan import LEVEL_MASK, Coding
from .scene.lights import AmbientLight, DirectionalLight, PointLight

NEAREST = 2.0**-20  # the fitted near plane is never nearer than this part of the furthest distance: depth keeps 2^-18 there
BAND_WORDS = 2**17  # a band's z-buffer is about 1 MB: half of a usual L2 cache


class Plan(NamedTuple):
    """What this scene needs, whatever the camera."""

    n_channel: int
    tint: np.ndarray  # (3,) float32: the colour of a picture with one channel
    dtype: np.dtype
    coding_levels: float  # levels a unit of intensity, 0 where words carry record numbers only
    error_bound: float  # linear intensity
    is_lit_per_sample: bool
    ambient: np.ndarray  # (3,) float64, the sum of the ambient lights
    lights: tuple  # the others
    materials: tuple  # one a mesh
    has_albedo: bool
    row_functions: tuple  # numba CFuncs: the lights', then the materials'; kept alive with the plan


def make_plan(scene, options: Options, albedo) -> Plan:
    """Find out what a scene needs.

    Parameters
    ----------
    albedo : (n_point, 3) float64, linear colours given with the model, or no rows
    """
    ambient = sum((np.array(light.color) for light in scene.lights if isinstance(light, AmbientLight)), np.zeros(3))
    lights = tuple(light for light in scene.lights if not isinstance(light, AmbientLight))
    materials = tuple(mesh.material for mesh in scene.meshes)
    has_albedo = len(albedo) > 0
    tint = None if has_albedo else common_color(materials, lights, ambient)
    bound, rounding = intensity_bounds(materials, lights, ambient, albedo.max(initial=1.0))
    is_single = options.tolerance > 0 and rounding <= options.tolerance / 4
    dtype = np.dtype(np.float32 if is_single else np.float64)
    is_lit_per_sample = options.shading == "phong"
    may_code = tint is not None and not is_lit_per_sample and is_single and np.isfinite(bound)
    levels = int(LEVEL_MASK) / bound if may_code and bound > 0 else float(may_code)
    kinds = [LIGHTS[_kind(light)].row_function for light in lights]
    models = [REFLECTIONS[_model(material)] for material in materials]
    compiled = {function: row_function(function, dtype) for function in dict.fromkeys(kinds + models)}
    return Plan(
        n_channel=3 if tint is None else 1,
        tint=np.ones(3, np.float32) if tint is None else tint.astype(np.float32),
        dtype=dtype,
        coding_levels=levels,
        error_bound=options.tolerance if may_code else min(rounding, options.tolerance) if is_single else 1e-6,
        is_lit_per_sample=is_lit_per_sample,
        ambient=ambient,
        lights=lights,
        materials=materials,
        has_albedo=has_albedo,
        row_functions=tuple(compiled[function] for function in kinds + models),
    )


def _kind(light) -> str:
    """Name of the light's row function."""
    return {DirectionalLight: "directional", PointLight: "point"}[type(light)]


def _model(material) -> str:
    """Name of the material's row function: a dull material needs no exponent."""
    return material.reflection if max(material.specular) > 0 else "lambert"


def common_color(materials, lights, ambient):
    """Return the RGB triple, its largest component 1, of which every intensity of the picture is a multiple; None if there is none.

    Intensities are products of a material's and a light's colour, so it is enough that all lights are grey and all the
    materials' colours multiples of one triple, or the other way round.
    """
    of_lights = [np.array(light.color) for light in lights] + [ambient]
    of_materials = [np.array(getattr(m, name)) for m in materials for name in ("ambient", "diffuse", "specular")]
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
    """Largest intensity that any point can have, and a bound of what float32 rounding adds to it.

    A power h^n multiplies the relative error of h by n. Each of the about sixteen roundings on the way to h costs 2^-24, of
    which at most about eight fall together; the matte terms take about sixteen.
    """
    bound = rounding = 0.0
    ulp = 2.0**-24
    for material in materials:
        matte = max(material.ambient) * ambient.max() * most_albedo + max(material.emissive)
        shine = 0.0
        for light in lights:
            most = np.inf if getattr(light, "amplify", False) and light.attenuation[0] < 1.0 else 1.0
            matte += most * max(light.color) * max(material.diffuse) * most_albedo
            shine += most * max(light.color) * max(material.specular)
        bound = max(bound, matte + shine)
        rounding = max(rounding, ulp * (16.0 * (matte + shine) + 8.0 * material.shininess * shine))
    return bound, rounding


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
            row[VECTOR : VECTOR + 3] = -(np.array(source.direction) @ axes if in_camera else np.array(source.direction))
        else:
            position = np.array(source.position)
            row[VECTOR : VECTOR + 3] = position @ axes if in_camera else position - view.eye
            row[ATTENUATION : ATTENUATION + 3] = source.attenuation
            row[MOST] = np.inf if source.amplify else 1.0
    material = np.zeros((len(plan.materials), N_MATERIAL_COLUMN))
    for row, source in zip(material, plan.materials, strict=True):
        row[SHININESS] = source.shininess
        for column, color in (
            (EMISSIVE, source.emissive),
            (AMBIENT, np.array(source.ambient) * plan.ambient),
            (DIFFUSE_COLOR, source.diffuse),
            (SPECULAR_COLOR, source.specular),
        ):
            row[column : column + 3] = color
    if plan.n_channel == 1:
        _reduce_to_one_channel(light, material, is_grey)
    is_shiny = material[:, SPECULAR_COLOR : SPECULAR_COLOR + 3].max(axis=1) > 0
    addresses = np.array([function.address for function in plan.row_functions], np.int64)
    return Lighting(
        addresses[:n_light], light.astype(plan.dtype), addresses[n_light:], material.astype(plan.dtype), is_shiny,
        len(channels), 1 if is_grey or plan.n_channel == 1 else 3, bool(is_shiny.any()),
        any(LIGHTS[_kind(source)].needs_position for source in plan.lights), plan.has_albedo,
    )  # fmt: skip


def _reduce_to_one_channel(light, material, is_grey) -> None:
    """Put the largest component of every colour first: all of them are grey or multiples of the picture's tint."""
    light[:, COLOR] = light[:, COLOR : COLOR + 3].max(axis=1, initial=0.0)
    for column in (EMISSIVE, AMBIENT, DIFFUSE_COLOR, SPECULAR_COLOR):
        material[:, column] = material[:, column : column + 3].max(axis=1)


def make_coding(plan: Plan, screen, tolerance) -> Coding:
    """Say what words and records hold, for one view."""
    if screen.is_perspective and screen.z_scale != 0:
        inv_w_scale, inv_w_offset = 1.0 / screen.z_scale, -screen.z_offset / screen.z_scale
    elif screen.is_perspective:
        inv_w_scale, inv_w_offset = 0.0, 1.0 / screen.near
    else:
        inv_w_scale, inv_w_offset = 0.0, 1.0
    has_levels = plan.coding_levels > 0
    return Coding(has_levels, plan.coding_levels, tolerance * plan.coding_levels, inv_w_offset, inv_w_scale)


def make_encoding(plan: Plan, scene, color_range, scale=1.0) -> Encoding:
    """Say how linear colour becomes 8 bits."""
    background = np.array(scene.background or (0, 0, 0), np.float32)
    policy = {"clamp": CLAMP, "global": GLOBAL, "local": LOCAL}[color_range]
    return Encoding(plan.tint, background, scene.background is not None, policy, scale, *make_srgb_tables())


def fit_depth_range(camera, view, bounds) -> tuple[tuple[float, float], float]:
    """Return ((near, far), clip distance) in scene units: the camera's own, else fitted to the scene.

    Parameters
    ----------
    bounds : (n_mesh, 2, 3) float64, boxes round the meshes, world space
    """
    x, y, z = np.meshgrid([0, 1], [0, 1], [0, 1])
    corners = np.stack([bounds[:, x, 0], bounds[:, y, 1], bounds[:, z, 2]], axis=-1).reshape(-1, 3)
    depth = (corners - view.eye) @ view.forward
    nearest, furthest = depth.min(), depth.max()
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
