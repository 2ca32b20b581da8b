"""Which batch function serves a light or a material, and how bright a highlight can get; see engine/error_bounds.py for
what that bounds."""

import math

import numpy as np

from ..pipeline.reflection import LEAST_COSINE, reflection_function_of
from ..scene.lights import DirectionalLight, PointLight, SpotLight


def kind_of(light) -> str:
    """Name of the light's batch function."""
    kind = {DirectionalLight: "directional", PointLight: "point", SpotLight: "spot"}[type(light)]
    return "shaped spot" if getattr(light, "falloff", 1.0) != 1.0 else kind


def model_of(material) -> str:
    """Name of the material's reflection model: a dull material needs no exponent, and what isn't asked for costs
    nothing."""
    if material.reflection in ("lambert", "oren-nayar", "toon"):
        return material.reflection
    if max(material.specular) == 0:
        return "lambert"
    if material.is_anisotropic:
        return "anisotropic ggx" if material.tangent == "u" else "anisotropic ggx by axis"
    if material.reflection == "cook-torrance":
        return material.distribution
    is_weighted = material.normalized or isinstance(material.fresnel, float)
    return f"weighted {material.reflection}" if is_weighted else material.reflection


def has_highlight(material) -> bool:
    """Tell whether a material has a highlight."""
    return max(material.specular) > 0 and reflection_function_of(model_of(material)).has_highlight


def has_colored_fresnel(material) -> bool:
    """Tell whether a material's F0 is a colour: then its highlight is two sums, see pipeline/fresnel.py."""
    return isinstance(material.fresnel, tuple) and has_highlight(material) and material.reflection != "toon"


def first_fresnel(material) -> float:
    """F0 of a material's specular reflection function W(θ), as batch functions take it; with 1, W is 1: also of a
    coloured F0, which is part of what the sums are weighted with."""
    if material.fresnel is not None:
        return 1.0 if isinstance(material.fresnel, tuple) else material.fresnel
    return 0.04 if material.reflection == "cook-torrance" else 1.0


def highlight_scale(material) -> float:
    """The factor of a normalised highlight, beside N·L; 0 for a classic one. Sources: see `Material`."""
    n = material.shininess
    if not material.normalized:
        return 0.0
    return (n + 2) / 2 if material.reflection == "phong" else (n + 2) * (n + 4) / (8 * (2 ** (-n / 2) + n))


def highlight_bounds(material) -> tuple[float, float]:
    """Largest value of a material's highlight for ks = 1, and how far it magnifies an error of the directions, relative
    to that.

    A power h^n magnifies a relative error of h by n (that of directions by less: see engine/error_bounds.py), W(θ) by 5
    at most, N·L by 1. Cook-Torrance with GGX: π D <= 1/α², N·L G1(L)/(2 N·L) <= 1/2, G1(V)/(2 N·V) <= 1/α. ln D rises
    by at most 2/α a radian, and G by 1/α. With Beckmann's D: π D has its maximum at tan² = max(0, 2 m² - 1), and
    G1(V)/N·V <= 3.535/m. Anisotropic: π D <= 1/(αx αy), and the root in G1(V) is at least the smaller α; ln D rises by
    at most 2/α a radian of that one, as far as the tangent stands still. A coloured F0 has W <= 1 in every channel,
    too, because F0 <= 1.
    """
    model, r = model_of(material), material.roughness
    if model == "ggx":
        return 1.0 / (2.0 * r**3), 4.0 / r + 5.0
    if model.startswith("anisotropic"):
        return 1.0 / (2.0 * r[0] * r[1] * min(r)), 4.0 / min(r) + 5.0
    if model == "beckmann":
        tangent_square = max(0.0, 2.0 * r * r - 1.0)
        return math.exp(-tangent_square / r**2) * (1.0 + tangent_square) ** 2 / r**3 * (3.535 / 4.0), 4.0 / r + 5.0
    if not has_highlight(material):
        return 0.0, 0.0
    fresnel = 5.0 if material.fresnel is not None else 0.0
    return max(highlight_scale(material), 1.0), material.shininess + fresnel + (1.0 if material.normalized else 0.0)


def matte_magnification(material) -> float:
    """How far a material's matte reflection magnifies an error of the directions, beyond Lambert's: tan β of Oren-Nayar
    does."""
    if material.reflection != "oren-nayar":
        return 0.0
    square = material.roughness**2
    return 0.45 * square / (square + 0.09) / LEAST_COSINE


def common_color(materials, lights, ambient):
    """Return the RGB triple, its largest component 1, of which every intensity of the picture is a multiple; None if
    there is none.

    Intensities are products of a material's and a light's colour, so it is enough that all lights are grey and all the
    materials' colours multiples of one triple, or the other way round.
    """
    if any(has_colored_fresnel(material) for material in materials):
        return None
    of_lights = [np.array(light.color) for light in lights] + [ambient]
    of_materials = [np.array(getattr(m, name)) for m in materials for name in ("ambient", "diffuse")]
    of_materials += [np.array(m.specular) for m in materials if has_highlight(m)]
    glow = [np.array(m.emissive) for m in materials]
    if _direction(of_lights) is not None and np.ptp(_direction(of_lights)) == 0.0:
        return _direction(of_materials + glow)
    if _direction(of_materials) is not None and np.ptp(_direction(of_materials)) == 0.0:
        return _direction(of_lights + glow)
    return None


def common_tint(tint, color):
    """Return the tint if a colour is a multiple of it, else None."""
    return _direction([tint, np.array(color)])


def _direction(colors):
    """The triple, its largest component 1, of which all colours are multiples (to float64 rounding); None if there is
    none."""
    colors = np.array([color for color in colors if color.max() > 0.0]).reshape(-1, 3)
    if len(colors) == 0:
        return np.ones(3)
    scaled = colors / colors.max(axis=1, keepdims=True)
    # Quotients of equal colours differ by a rounding error each.
    return scaled[0] if np.ptp(scaled, axis=0).max() <= 4 * np.finfo(float).eps else None


def cone_cosines(light) -> tuple[float, float]:
    """Cosines of a spot light's inner and outer angle."""
    return math.cos(math.radians(light.inner)), math.cos(math.radians(light.outer))
