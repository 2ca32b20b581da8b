"""The materials of a scene as a table of reflection coefficients, with colours as RGB or as samples of the spectrum."""

import numpy as np
from numpy.typing import NDArray

from ..scene.material import DISTRIBUTIONS, Material
from ..scene.scene import Scene
from ..scene.spectrum import samples_of
from .reflection import REFLECTION_KINDS, reflection_kind_of

N_WAVE = 81  # samples of the spectrum where a scene has spectra and nobody chose


def palette_of(scene: Scene) -> list[Material]:
    """Return the materials of all meshes, one palette after the other: `Surface.material` counts them through."""
    return [material for mesh in scene.meshes for material in mesh.palette]


def count_waves(scene: Scene, spectral: int | None) -> int | None:
    """Return the number of wavelengths: as asked for, else 81 where a colour is a spectrum, else None for RGB."""
    colors = [light.color for light in scene.lights]
    for material in palette_of(scene):
        colors += [material.ambient, material.diffuse, material.specular, material.emissive, material.fresnel]
    has_spectrum = any(hasattr(color, "wavelengths") for color in colors)
    return N_WAVE if spectral is None and has_spectrum else spectral


def read_materials(scene: Scene, n_wave: int | None = None) -> NDArray:
    """Return the reflection coefficients of the materials of `palette_of`.

    Returns
    -------
    (n_material,) records; colours have `n_wave` values, or three where that is None
    """
    palette = palette_of(scene)
    colors = [
        (name, np.float64, 3 if n_wave is None else n_wave) for name in ("ambient", "diffuse", "specular", "emissive")
    ]
    colors += [("fresnel", *colors[0][1:])]
    numbers = [(name, np.float64) for name in ("shininess", "levels", "opacity")]
    longest = max(map(len, (*REFLECTION_KINDS, *DISTRIBUTIONS)))
    words = [("reflection", f"U{longest}"), ("distribution", f"U{longest}"), ("normalized", bool)]
    brush = [("roughness", np.float64), ("across", np.float64), ("axis", np.float64, 3), ("is_by_u", bool)]
    table = np.zeros(len(palette), [*colors, *numbers, *words, *brush])
    for row, material in zip(table, palette, strict=True):
        for name, *_ in colors[:-1]:
            row[name] = channels_of(getattr(material, name), n_wave)
        for name, _ in numbers + words:
            row[name] = getattr(material, name)
        absent = reflection_kind_of(material).default_fresnel
        fresnel = absent if material.fresnel is None else material.fresnel
        row["fresnel"] = channels_of(fresnel, n_wave) if isinstance(fresnel, tuple) else fresnel
        row["roughness"], row["across"] = np.broadcast_to(material.roughness, 2)
        row["is_by_u"] = material.tangent == "u"
        if material.tangent != "u":
            row["axis"] = material.tangent
    return table


def channels_of(color: object, n_wave: int | None) -> NDArray[np.float64]:
    """Return a colour as red, green and blue (3,), or as samples of its spectrum (n_wave,)."""
    return np.array(color, np.float64) if n_wave is None else samples_of(color, n_wave)
