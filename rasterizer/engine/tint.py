"""The colour that all intensities of a picture share, if they do: then one channel is enough."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .reflection_table import has_colored_fresnel, has_highlight


def common_color(
    materials: Sequence[Any], lights: Sequence[Any], ambient: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the RGB triple, its largest component 1, of which every intensity of the picture is a multiple; None if
    there is none.

    Intensities are products of a material's and a light's colour, so it is enough that all lights are grey and all the
    materials' colours multiples of one triple, or the other way round.

    Parameters
    ----------
    ambient : (3,) float64, the sum of the ambient lights
    """
    if any(has_colored_fresnel(material) for material in materials):
        return None
    of_lights = [np.array(light.color) for light in lights] + [ambient]
    of_materials = [np.array(getattr(m, name)) for m in materials for name in ("ambient", "diffuse")]
    of_materials += [np.array(m.specular) for m in materials if has_highlight(m)]
    emission = [np.array(m.emissive) for m in materials]
    if _direction(of_lights) is not None and np.ptp(_direction(of_lights)) == 0.0:
        return _direction(of_materials + emission)
    if _direction(of_materials) is not None and np.ptp(_direction(of_materials)) == 0.0:
        return _direction(of_lights + emission)
    return None


def common_tint(tint: NDArray[np.float64], color: Sequence[float]) -> NDArray[np.float64] | None:
    """Return the tint (3,) if a colour is a multiple of it, else None."""
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
