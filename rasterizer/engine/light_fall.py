"""How the strength of a light falls with the distance and the angle from its axis, as far as bounds need it.

s(d) = 1/(kc + kl d + kq d²), see `light_from_point`; for spot lights times S^p and cos^e, see `keep_to_cone` and
`weaken_off_axis` (pipeline/light_kinds.py).
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray


def cone_cosines(light: Any) -> tuple[float, float]:
    """Return the cosines of a spot light's inner and outer angle."""
    return math.cos(math.radians(light.inner)), math.cos(math.radians(light.outer))


def strength_at(light: Any, distance: NDArray[np.float64], least: float = 0.0) -> NDArray[np.float64]:
    """Return 1/(kc + kl d + kq d²) of a light at distances (...), or `least` where that is more; infinite where the sum
    is 0."""
    total, _ = _fall_and_rise(light, distance)
    with np.errstate(divide="ignore"):
        return np.maximum(1.0 / total, least)


def fall_at(light: Any, distance: NDArray[np.float64], slope: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (slope + ρ)·s/d of `PointEntry.sway` at distances (...)."""
    total, rise = _fall_and_rise(light, distance)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(np.isfinite(total), rise / total, 2.0)
        return (slope + share) / total / distance


def _fall_and_rise(light, distance) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """q = kc + kl d + kq d² and d q'; what is 0 stays 0 at any distance."""
    constant, linear, quadratic = light.attenuation
    with np.errstate(over="ignore"):
        total, rise = constant + np.zeros_like(distance), np.zeros_like(distance)
        if linear > 0.0:
            total, rise = total + linear * distance, linear * distance
        if quadratic > 0.0:
            of_square = quadratic * distance * distance
            total, rise = total + of_square, rise + 2.0 * of_square
    return total, rise


def unweakened_to(light: Any) -> float:
    """Return the distance up to which kc + kl d + kq d² <= 1, so that a light that may not amplify is not weakened."""
    constant, linear, quadratic = light.attenuation
    rest = 1.0 - constant
    if rest <= 0.0:
        return 0.0
    root = math.hypot(linear, 2.0 * math.sqrt(quadratic) * math.sqrt(rest))
    return 2.0 * rest / (linear + root) if linear + root > 0.0 else math.inf


def fall_rise(light: Any) -> float:
    """Return what the fall between a spot light's cones rises by for each unit of the cosine; infinite if that has no
    bound."""
    inner, outer = cone_cosines(light)
    p = light.falloff
    rise = 1.5 * p if p >= 1.0 else 6.0 * p if p >= 0.5 else np.inf
    return rise / (inner - outer) if inner > outer else np.inf


def exponent_rise(light: Any) -> float:
    """Return what cos^e of a spot light rises by for each unit of the cosine."""
    inner, outer = cone_cosines(light)
    exponent = light.exponent
    if 0.0 < exponent < 1.0:
        at_edge = 3.0 / inner**2 if inner > 0.0 and light.falloff >= 1.0 else np.inf
        exponent *= min(outer ** (exponent - 1.0) if outer > 1e-15 else np.inf, at_edge)
    return exponent
