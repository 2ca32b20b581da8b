"""The reflection models: how much of a light a surface sends to the viewer, in plain numpy float64.

In: normals, directions, and for each point a row of the table of materials (`read_materials`). Out: D, S and M,
which light.py multiplies by colours.

Letters: N normal, L to the light, V to the viewer, R mirror of L about N, H halfway between L and V.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..choices import DISTRIBUTIONS
from ..errors import SceneError
from ..scene.material import MAX_NUMBERS, Material
from ..scene.scene import Scene
from ..scene.spectrum import samples_of
from ..vectors import length, unit
from .vectors import dot

# A cosine up to this counts as 0 where a model jumps at 0, and one up to this above a step as lying on it: the rounding
# of normals and directions must not decide for each point by itself on which side it is. A thousand roundings of 2^-53
# are 2^-43.
GRAZING = 2.0**-40


def reflect(
    table: NDArray, normals: NDArray, light_dirs: NDArray, view_dirs: NDArray, tangents: NDArray | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return D, S and M (n, n_channel) of the material of each row of `table`; of no meaning where N.L <= 0.

    M is what the surface's own colour a multiplies beside D: of a metal F0 = metal·a, so that with the share m of it

        W = W(F0 = 0) + (1 - (1 - cos theta)^5) ((1 - m) F0 + m metal a)

    Parameters
    ----------
    table : (n,) records of `read_materials`
    normals, light_dirs, view_dirs : (n, 3) float64, unit
    tangents : (n, 3) float64 of any length, the direction that anisotropic materials are brushed along; None = no such
        materials
    """
    diffuse, specular, metal = np.zeros((3, *table["fresnel"].shape))
    tangents = np.zeros_like(normals) if tangents is None else tangents
    for model in np.unique(table["reflection"]):
        at = table["reflection"] == model
        sides = normals[at], light_dirs[at], view_dirs[at], tangents[at]
        d, s, cosine = REFERENCE_MODELS[str(model)].function(table[at], *sides)
        d, s, share = np.reshape(d, (-1, 1)), np.reshape(s, (-1, 1)), table[at]["metallic"][:, None]
        diffuse[at] = (1 - share) * d
        if cosine is None:
            specular[at] = s
            continue
        specular[at] = s * _schlick((1 - share) * table[at]["fresnel"], cosine)
        metal[at] = s * share * table[at]["metal"] * (1 - _schlick(0.0, cosine))
    return diffuse, specular, metal


def _reflect_lambert(_table, normals, light_dirs, _view_dirs, _tangents):
    """Lambert 1760: the cosine of the angle of incidence."""
    return dot(normals, light_dirs), np.zeros(len(normals)), None


def _reflect_phong(table, normals, light_dirs, view_dirs, _tangents):
    """Phong 1975, Comm. ACM 18(6), 311-317: max(R.V, 0)^n. Normalised: Lafortune & Willems 1994, TR CW197, K.U.
    Leuven."""
    n_dot_l, n = dot(normals, light_dirs), table["shininess"]
    highlight = np.clip(dot(2 * n_dot_l[:, None] * normals - light_dirs, view_dirs), 0, 1) ** n
    highlight = np.where(table["normalized"] | (n_dot_l > GRAZING), highlight, 0.0)
    return n_dot_l, highlight * np.where(table["normalized"], (n / 2 + 1) * n_dot_l, 1.0), n_dot_l


def _reflect_blinn(table, normals, light_dirs, view_dirs, _tangents):
    """Blinn 1977, Proc. SIGGRAPH, 192-198: max(N.H, 0)^n. Normalised: Giesen 2009, Phong Normalization Factor
    derivation."""
    n_dot_l, n = dot(normals, light_dirs), table["shininess"]
    highlight = np.clip(dot(normals, unit(light_dirs + view_dirs)), 0, 1) ** n
    highlight = np.where(table["normalized"] | (n_dot_l > GRAZING), highlight, 0.0)
    peak = (n + 2) * (n + 4) / (8 * (np.exp2(-n / 2) + n))
    return n_dot_l, highlight * np.where(table["normalized"], peak * n_dot_l, 1.0), n_dot_l


def _reflect_oren_nayar(table, normals, light_dirs, view_dirs, _tangents):
    """Oren & Nayar 1994, Proc. SIGGRAPH, 239-246, equation 30, by angles; cos beta is 1/64 at least."""
    theta_l, theta_v = _angle(normals, light_dirs), _angle(normals, view_dirs)
    across_l, across_v = (unit(d - dot(d, normals)[:, None] * normals) for d in (light_dirs, view_dirs))
    variance = table["roughness"] ** 2
    a, b = 1 - variance / (2 * (variance + 0.33)), 0.45 * variance / (variance + 0.09)
    alpha, beta = np.maximum(theta_l, theta_v), np.minimum(theta_l, theta_v)
    tangent = np.sin(beta) / np.maximum(np.cos(beta), 1 / 64)
    diffuse = np.cos(theta_l) * (a + b * np.maximum(dot(across_l, across_v), 0) * np.sin(alpha) * tangent)
    return diffuse, np.zeros(len(normals)), None


def _reflect_cook_torrance(table, normals, light_dirs, view_dirs, tangents):
    """Return pi D G / (4 N.V): Cook & Torrance 1981; Walter et al. 2007, EGSR, 195-206, equations 25, 27, 33 and 34."""
    half = unit(light_dirs + view_dirs)
    m, m_light, m_viewer = _roughness_towards(table, normals, half, light_dirs, view_dirs, tangents)
    n_dot_l = dot(normals, light_dirs)
    # Beyond the silhouette the limit at 90 degrees is taken.
    theta_h, theta_l, theta_v = (_angle(normals, d) for d in (half, light_dirs, view_dirs))
    theta_l, theta_v = np.minimum(theta_l, np.pi / 2 - 1e-12), np.minimum(theta_v, np.pi / 2 - 1e-12)
    is_ggx, is_ahead = table["distribution"] == "ggx", theta_h < np.pi / 2
    slope = np.tan(np.where(is_ahead, theta_h, 0.0)) / m
    with np.errstate(over="ignore", under="ignore"):
        shape = np.where(is_ggx, 1 / (1 + slope**2) ** 2, np.exp(-(slope**2)))
        facets = np.where(is_ahead, shape / (table["roughness"] * table["across"] * np.cos(theta_h) ** 4), 0.0)
    masked = np.ones_like(m)
    for theta, m_side in ((theta_l, m_light), (theta_v, m_viewer)):
        tangent = m_side * np.tan(theta)
        a = 1 / np.maximum(tangent, 1e-12)
        beckmann = np.where(a < 1.6, np.minimum((3.535 * a + 2.181 * a**2) / (1 + 2.276 * a + 2.577 * a**2), 1), 1)
        masked *= np.where(is_ggx, 2 / (1 + np.hypot(1, tangent)), beckmann)
    return n_dot_l, facets * masked / (4 * np.cos(theta_v)), dot(light_dirs, half)


def _roughness_towards(table, normals, half, light_dirs, view_dirs, tangents):
    """Return alpha (n,) as it counts for the tilt towards half, and for the masking towards the light and the viewer.

    Heitz 2014, JCGT 3(2), section 5.3: an anisotropic surface is an isotropic one stretched, so in the plane of N and a
    direction it has one roughness: with the azimuth phi from the tangent, the slopes' root of (cos phi/ax)^2 + (sin
    phi/ay)^2 is 1/alpha of the tilt, and that of (ax cos phi)^2 + (ay sin phi)^2 alpha of the masking. Where a tangent
    has no part in the surface, or one of less than 2^-40 of its length, which rounding could make up, alpha is the
    geometric mean.
    """
    ax, ay = table["roughness"], table["across"]
    along = tangents - dot(tangents, normals)[:, None] * normals
    has_tangent = length(along)[:, 0] > 2.0**-40 * length(tangents)[:, 0]
    along = unit(along)
    mean = np.where(ax == ay, ax, np.sqrt(ax * ay))
    found = []
    for direction, is_tilt in ((half, True), (light_dirs, False), (view_dirs, False)):
        x, y = dot(direction, along), dot(direction, np.cross(normals, along))
        size = np.hypot(x, y)
        x, y = x / np.where(size > 0, size, 1), y / np.where(size > 0, size, 1)
        own = 1 / np.maximum(np.hypot(x / ax, y / ay), 1e-300) if is_tilt else np.hypot(ax * x, ay * y)
        found.append(np.where((ax != ay) & has_tangent & (size > 0), own, mean))
    return found


def _reflect_toon(table, normals, light_dirs, view_dirs, _tangents):
    """Return N.L raised to a multiple of 1/levels, and 1 or 0 where (R.V)^n is above or below one half."""
    n_dot_l, levels = dot(normals, light_dirs), table["levels"]
    steps = np.arange(1, levels.max() + 1)
    step = 1 + (steps < levels[:, None] * (n_dot_l[:, None] - GRAZING)).sum(axis=1)
    mirrored = dot(2 * n_dot_l[:, None] * normals - light_dirs, view_dirs)
    is_bright = mirrored >= 0.5 ** (1 / table["shininess"]) - GRAZING  # (R.V)^n >= 1/2
    is_lit = n_dot_l > GRAZING
    return np.where(is_lit, np.minimum(step, levels) / levels, 0.0), np.where(is_lit & is_bright, 1.0, 0.0), None


def _schlick(fresnel, cosine):
    """Schlick 1994, Computer Graphics Forum 13(3), 233-246: W = F0 + (1 - F0)(1 - cos theta)^5, (n, n_channel)."""
    return fresnel + (1 - fresnel) * np.clip(1 - cosine, 0, 1)[:, None] ** 5


def _angle(a, b):
    """Return the angles (n,) between vectors (n, 3); exact for small ones and right ones."""
    return np.arctan2(length(np.cross(a, b))[:, 0], dot(a, b))


class ReferenceModel(NamedTuple):
    """How a reflection model is evaluated.

    Parameters
    ----------
    function : (table, normals, light_dirs, view_dirs, tangents) -> D (n,), S (n,) and the cosine (n,) of the angle of
        incidence, by whose W(theta) S is multiplied; None = by 1. The arguments are those of `reflect`
    default_fresnel : F0 of a material that gives none
    """

    function: Callable
    default_fresnel: float = 1.0


# By the words of scene.material.REFLECTION_MODELS. It shares nothing with the table of the engine, which it judges.
REFERENCE_MODELS: dict[str, ReferenceModel] = {
    "lambert": ReferenceModel(_reflect_lambert),
    "phong": ReferenceModel(_reflect_phong),
    "blinn": ReferenceModel(_reflect_blinn),
    "oren-nayar": ReferenceModel(_reflect_oren_nayar),
    "cook-torrance": ReferenceModel(_reflect_cook_torrance, default_fresnel=0.04),
    "toon": ReferenceModel(_reflect_toon),
}


def reference_model_of(material: Any) -> ReferenceModel:
    """Return how a material's reflection model is evaluated.

    Raises
    ------
    SceneError : the reference doesn't know the model; the message lists those that it knows
    """
    if material.reflection not in REFERENCE_MODELS:
        legal = ", ".join(REFERENCE_MODELS)
        raise SceneError(f"the reference knows the reflection models {legal}; given {material.reflection!r}")
    return REFERENCE_MODELS[material.reflection]


# --- the table of materials: reflection coefficients, with colours as RGB or as samples of the spectrum ------

N_WAVE = 81  # samples of the spectrum where a scene has spectra and nobody chose


def palette_of(scene: Scene) -> list[Material]:
    """Return the materials of all meshes, one palette after the other: `Surface.material` counts them through."""
    return [material for mesh in scene.meshes for material in mesh.palette]


def count_waves(scene: Scene, spectral: int | None) -> int | None:
    """Return the number of wavelengths: as asked for, else 81 where a colour is a spectrum, else None for RGB."""
    colors = [light.color for light in scene.lights]
    for material in palette_of(scene):
        colors += [material.ambient, material.diffuse, material.specular, material.emissive, material.fresnel]
        colors += [material.metal]
    has_spectrum = any(hasattr(color, "wavelengths") for color in colors)
    return N_WAVE if spectral is None and has_spectrum else spectral


def read_materials(scene: Scene, n_wave: int | None = None, is_lit_per_sample: bool = True) -> NDArray:
    """Return the reflection coefficients of the materials of `palette_of`.

    Returns
    -------
    (n_material,) records; colours have `n_wave` values, or three where that is None
    """
    palette = [material.as_lit(is_lit_per_sample) for material in palette_of(scene)]
    names = "ambient", "diffuse", "specular", "emissive", "fresnel", "metal"
    colors = [(name, np.float64, 3 if n_wave is None else n_wave) for name in names]
    numbers = [(name, np.float64) for name in ("shininess", "levels", "opacity", "metallic")]
    longest = max(map(len, (*REFERENCE_MODELS, *DISTRIBUTIONS)))
    words = [("reflection", f"U{longest}"), ("distribution", f"U{longest}"), ("normalized", bool), ("is_cut_out", bool)]
    brush = [("roughness", np.float64), ("across", np.float64), ("axis", np.float64, 3), ("is_by_u", bool)]
    brush += [("numbers", np.float64, MAX_NUMBERS)]
    table = np.zeros(len(palette), [*colors, *numbers, *words, *brush])
    for row, material in zip(table, palette, strict=True):
        for name in names[:4]:
            row[name] = channels_of(getattr(material, name), n_wave)
        row["metal"] = channels_of(material.diffuse if material.metal is None else material.metal, n_wave)
        for name, _ in numbers + words:
            row[name] = getattr(material, name)
        absent = reference_model_of(material).default_fresnel
        fresnel = absent if material.fresnel is None else material.fresnel
        row["fresnel"] = channels_of(fresnel, n_wave) if isinstance(fresnel, tuple) else fresnel
        row["roughness"], row["across"] = np.broadcast_to(material.roughness, 2)
        row["numbers"][: len(material.numbers or ())] = material.numbers or ()
        row["is_by_u"] = material.tangent == "u"
        if material.tangent != "u":
            row["axis"] = material.tangent
    return table


def channels_of(color: object, n_wave: int | None) -> NDArray[np.float64]:
    """Return a colour as red, green and blue (3,), or as samples of its spectrum (n_wave,)."""
    return np.array(color, np.float64) if n_wave is None else samples_of(color, n_wave)
