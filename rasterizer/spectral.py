"""Spectral colour: light and colours are multiplied wavelength by wavelength, and seen by the standard observer at the end.

The illumination equation is a sum of products of colours, each times a factor that geometry alone decides (cosines, powers,
attenuation, shadows). The observer's response is linear. So it may be applied to the products before anything is drawn:

    RGB(Σ_i g_i · kd·Ip_i) = Σ_i g_i · RGB(kd·Ip_i)

which gives what an evaluation of every sample of the spectrum at every pixel would give, for the price of three channels.
"""

from typing import NamedTuple

import numpy as np


class Products(NamedTuple):
    """Products of the spectra of materials and lights, as linear RGB; components may be negative."""

    emissive: np.ndarray  # (n_material, 3)
    ambient: np.ndarray  # (n_material, 3): ka·Ia
    diffuse: np.ndarray  # (n_material, n_light, 3): kd·Ip
    specular: np.ndarray  # (n_material, n_light, 3): ks·Ip


def multiply_spectra(materials, lights, ambient_lights, options) -> Products | None:
    """Multiply what materials reflect by what lights give; None where no colour is a spectrum and no samples are asked for."""
    fields = ("emissive", "ambient", "diffuse", "specular")
    colors = [getattr(material, field) for material in materials for field in fields]
    colors += [light.color for light in (*lights, *ambient_lights)]
    if options.spectral is None and not any(hasattr(color, "wavelengths") for color in colors):
        return None
    from .scene.spectrum import N_TABLE, rgb_weights, samples_of

    n = options.spectral or N_TABLE  # samples: every 5 nm, as the tables have them
    weights = rgb_weights(n) * 2.0**options.exposure
    emissive, ambient, diffuse, specular = (
        np.array([samples_of(getattr(material, field), n) for material in materials]) for field in fields
    )
    around = sum((samples_of(light.color, n) for light in ambient_lights), np.zeros(n))
    given = np.array([samples_of(light.color, n) for light in lights]).reshape(-1, n)
    return Products(
        emissive @ weights,
        (ambient * around) @ weights,
        (diffuse[:, None] * given) @ weights,
        (specular[:, None] * given) @ weights,
    )
