"""How bright a picture can be: what each light makes of each material at most, before anything is drawn."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import light_table, reflection_table
from .highlight_tables import HighlightTables
from .light_sets import LightSets, all_lights
from .rounding import times
from .spectral_products import Products


class Reflected(NamedTuple):
    """How bright a scene's lights make its materials at most, linear intensity, the largest of all channels.

    What a light gives to a material that it doesn't reach is 0. Sums over the lights are those over lights that may
    reach one point together.
    """

    undirected: NDArray[np.float64]  # (n_material,): what needs no light with a direction: ambient and emissive
    diffuse: NDArray[np.float64]  # (n_material, n_light)
    specular: NDArray[np.float64]  # (n_material, n_light): highlights
    diffuse_slopes: NDArray[np.float64]  # (n_material,): how far diffuse terms magnify errors of directions, see tables
    steepnesses: NDArray[np.float64]  # (n_light,): how far the factors of cone and range magnify errors
    materials: tuple
    lights: tuple
    sets: LightSets  # which lights reach which materials, and one point
    highlights: HighlightTables  # of the materials

    @property
    def bounds(self) -> NDArray[np.float64]:
        """The largest intensity that any point of a material can have, (n_material,)."""
        with np.errstate(over="ignore"):  # infinite where no bound holds
            return self.undirected + self.sum_lights(self.diffuse + self.specular)

    @property
    def bound(self) -> float:
        """The largest intensity that any point can have."""
        return float(self.bounds.max(initial=0.0))

    @property
    def turn_slopes(self) -> NDArray[np.float64]:
        """What an intensity of each material changes by, at most, for each radian that the normal turns, (n_material,);
        infinite where that has no limit."""
        slopes = [reflection_table.entry_of(material).turn_slope(material) for material in self.materials]
        of_diffuse = times(self.diffuse, 1.0 + self.diffuse_slopes[:, None])
        return self.sum_lights(of_diffuse + times(self.specular, np.array(slopes)[:, None]))

    def sum_lights(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the largest sum over lights that reach one point of (n_material, n_light) values, (n_material,)."""
        return self.sets.largest_sums(values)

    @property
    def turn_slope(self) -> float:
        """The largest of `turn_slopes`."""
        return float(self.turn_slopes.max(initial=0.0))

    def amplified(self, amplifications: NDArray[np.float64]) -> "Reflected":
        """Return the same under lights that are amplified by `amplifications`, (n_light,) or (n_material, n_light)."""
        return self._replace(diffuse=times(self.diffuse, amplifications), specular=times(self.specular, amplifications))


def compute_reflected(
    materials: Sequence[Any],
    lights: Sequence[Any],
    ambient: NDArray[np.float64],
    most_albedo: float,
    products: Products | None = None,
    sets: LightSets | None = None,
) -> Reflected:
    """Compute how bright each light makes each material at most, where nothing is amplified.

    Parameters
    ----------
    ambient : (3,) float64, the sum of the ambient lights
    most_albedo : largest component of the colours that multiply what materials reflect, textures' included
    products : those of spectra (engine/spectral_products.py), in which the exposure is included, or None
    sets : which lights reach what; None = every light every point
    """
    sets = all_lights(len(materials), len(lights)) if sets is None else sets
    undirected = np.array([max(m.ambient) * ambient.max() * most_albedo + max(m.emissive) for m in materials])
    colors = np.array([max(light.color) for light in lights], float)
    diffuse = np.array([max(m.diffuse) for m in materials])[:, None] * colors
    specular = np.array([max(m.specular) for m in materials])[:, None] * colors
    if products is not None:
        undirected = np.abs(products.ambient).max(axis=1) * most_albedo + np.abs(products.emissive).max(axis=1)
        diffuse = np.abs(products.diffuse).max(axis=2)
        specular = (np.abs(products.specular) + np.abs(products.grazing)).max(axis=2)
    peaks = np.array([_highlight_peak(material) for material in materials])
    slopes = np.array([reflection_table.entry_of(material).diffuse_slope(material) for material in materials])
    steepnesses = np.array([light_table.entry_of(light).steepness(light) for light in lights], float)
    diffuse = np.where(sets.reaches, diffuse * most_albedo, 0.0)
    specular = np.where(sets.reaches, specular * peaks[:, None], 0.0)
    highlights = HighlightTables(materials)
    return Reflected(
        undirected, diffuse, specular, slopes, steepnesses, tuple(materials), tuple(lights), sets, highlights
    )


def _highlight_peak(material) -> float:
    """The largest value of a material's highlight where `specular` is 1; 0 where it has none."""
    entry = reflection_table.entry_of(material)
    return entry.brightest_highlight(material) if entry.has_highlight(material) else 0.0


def compute_amplifications(lights: Sequence[Any], clearances: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """Compute how much each light amplifies at most, where no lit point is nearer to it than its clearance.

    Parameters
    ----------
    clearances : (n_light,) or (n_material, n_light), scene units; None = 0 of all of them

    Returns
    -------
    float64 of the shape of `clearances`; (n_light,) without
    """
    distances = np.zeros(len(lights)) if clearances is None else clearances
    found = np.ones(distances.shape)
    for number, light in enumerate(lights):
        found[..., number] = light_table.entry_of(light).amplification(light, distances[..., number])
    return found
