"""What the engine asks of every reflection model; the models are in reflection_table.py."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..pipeline import reflection as pipeline
from .rounding import Step, times


class HighlightBounds(NamedTuple):
    """What a highlight of height 1 is and does at most, (n_light,) or (n_material, n_light) float64."""

    peaks: NDArray[np.float64]  # its largest value, at most 1
    roundings: NDArray[np.float64]  # how far it is off by rounding, at most 1
    normal_slopes: NDArray[np.float64]  # what it changes by for each radian that the normal turns
    light_slopes: NDArray[np.float64]  # the same for the direction to the light


class ReflectionEntry:
    """Hold what the engine knows of a reflection model.

    Every method takes a Material that names the model. What is said here holds for a model without a highlight, whose
    diffuse term errs by no more than N·L does.
    """

    is_lambert_when_dull = False  # with a black `specular` it reflects as Lambert's model does
    default_fresnel = 1.0  # F0 of a material that gives none
    needs_least_sums = False  # its bounds depend on how nearly light and viewer are opposite

    def function(self, material: Any) -> pipeline.ReflectionFunction:
        """Return the pipeline's function for the material, and what it needs."""
        raise NotImplementedError(f"{type(self).__name__} has no function")

    def has_highlight(self, material: Any) -> bool:
        """Tell whether the material has a highlight."""
        return max(material.specular) > 0 and self.function(material).has_highlight

    def reason_for_float64(self, material: Any) -> str:
        """Return why float32 won't do, in a few words; empty where it does."""
        return ""

    def highlight_scale(self, material: Any) -> float:
        """Return the factor of a normalised highlight, beside N·L; 0 for a classic one."""
        return 0.0

    def brightest_highlight(self, material: Any) -> float:
        """Return the largest value of a highlight where `specular` is 1."""
        return 0.0

    def diffuse_slope(self, material: Any) -> float:
        """Return how far the diffuse term magnifies an error of the directions, beyond Lambert's."""
        return 0.0

    def turn_slope(self, material: Any) -> float:
        """Return what a highlight of height 1 changes by, at most, for each radian that the normal turns."""
        return 0.0

    def highlight_rounding(self, material: Any, u: float) -> float:
        """Return how far a highlight of height 1 is off by rounding, at most 1."""
        return 0.0

    def highlight_change(self, material: Any, angle: ArrayLike, beside: float = 0.0) -> NDArray[np.float64]:
        """Return what a highlight of height 1 changes by, at most, where the normal turns by an angle, at most 1.

        Parameters
        ----------
        angle : (...) radians
        beside : what else it changes by for each radian, in the light's strength

        Returns
        -------
        (...) float64
        """
        return np.minimum(1.0, times(self.turn_slope(material) + beside, angle))

    def light_slopes(self, material: Any, u: float, least_sums: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what a highlight of height 1 changes by, at most, for each radian that the direction to the light
        turns, (n_light,).

        Parameters
        ----------
        least_sums : (n_light,) float64, |L + V| is nowhere less
        """
        return np.full(least_sums.shape, self.turn_slope(material))

    def highlight_bounds(self, material: Any, u: float, least_sums: NDArray[np.float64]) -> "HighlightBounds":
        """Return what is known of the highlight where |L + V| is nowhere less than `least_sums`, (n_light,)."""
        ones = np.ones(least_sums.shape)
        return HighlightBounds(
            peaks=ones,
            roundings=self.highlight_rounding(material, u) * ones,
            normal_slopes=self.turn_slope(material) * ones,
            light_slopes=self.light_slopes(material, u, least_sums),
        )

    def diffuse_steps(self, material: Any, u: float) -> tuple[Step, ...]:
        """Return where the diffuse term jumps."""
        return ()

    def highlight_steps(self, material: Any, u: float) -> tuple[Step, ...]:
        """Return where a highlight jumps."""
        return ()
