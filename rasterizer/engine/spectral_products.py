"""Spectral colour: light and colours are multiplied wavelength by wavelength, and seen by the standard observer at the
end.

The illumination equation is a sum of products of colours, each times a factor that geometry alone decides (cosines,
powers, attenuation, shadows). The observer's response is linear. So it may be applied to the products before anything
is drawn:

    RGB(Σ_i g_i · kd·Ip_i) = Σ_i g_i · RGB(kd·Ip_i)

which gives what an evaluation of every sample of the spectrum at every pixel would give, for the price of three
channels. A specular reflection function with a spectrum F0 is no such product, but affine in F0: W = F0·(1 - s) + s, s
= (1 - cos θ)^5. So two products serve, ks·Ip·F0 and ks·Ip·(1 - F0): the highlight is that of W = 1 with the first, and
times s with the second.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..options import Options
from .reflection_table import has_colored_fresnel


class Products(NamedTuple):
    """Products of the spectra of materials and lights, as linear RGB; components may be negative."""

    emissive: NDArray[np.float64]  # (n_material, 3)
    ambient: NDArray[np.float64]  # (n_material, 3): ka·Ia
    diffuse: NDArray[np.float64]  # (n_material, n_light, 3): kd·Ip
    specular: NDArray[np.float64]  # (n_material, n_light, 3): ks·Ip; with a coloured F0 ks·Ip·F0
    grazing: NDArray[np.float64]  # (n_material, n_light, 3): ks·Ip·(1 - F0); 0 where F0 has no colour


def multiply_spectra(
    materials: Sequence[Any], lights: Sequence[Any], ambient_lights: Sequence[Any], options: Options
) -> Products | None:
    """Multiply what materials reflect by what lights give; None where no colour is a spectrum and no samples are asked
    for."""
    fields = ("emissive", "ambient", "diffuse", "specular")
    colors = [getattr(material, field) for material in materials for field in (*fields, "fresnel")]
    colors += [light.color for light in (*lights, *ambient_lights)]
    if options.spectral is None and not any(hasattr(color, "wavelengths") for color in colors):
        return None
    from ..scene.spectrum import N_TABLE, rgb_weights

    n = options.spectral or N_TABLE  # samples: every 5 nm, as the tables have them
    weights = rgb_weights(n) * 2.0**options.exposure
    emissive, ambient, diffuse, specular = (
        np.array([_samples_of(getattr(material, field), n) for material in materials]) for field in fields
    )
    around = sum((_samples_of(light.color, n) for light in ambient_lights), np.zeros(n))
    given = np.array([_samples_of(light.color, n) for light in lights]).reshape(-1, n)
    first, rest = split_fresnel(materials, n)
    return Products(
        emissive @ weights,
        (ambient * around) @ weights,
        (diffuse[:, None] * given) @ weights,
        ((specular * first)[:, None] * given) @ weights,
        ((specular * rest)[:, None] * given) @ weights,
    )


def split_fresnel(materials: Sequence[Any], n: int | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return F0 and 1 - F0 of materials whose F0 is a colour, 1 and 0 of the others.

    Parameters
    ----------
    n : samples of the spectrum; None = linear RGB

    Returns
    -------
    two (n_material, n or 3) float64
    """
    first = np.ones((len(materials), n or 3))
    for row, material in zip(first, materials, strict=True):
        if has_colored_fresnel(material):
            row[:] = material.fresnel if n is None else _samples_of(material.fresnel, n)
    return first, 1.0 - first


def _samples_of(color, n: int) -> NDArray[np.float64]:
    from ..scene.spectrum import samples_of

    return samples_of(color, n)
