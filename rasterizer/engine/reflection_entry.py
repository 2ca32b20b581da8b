"""What the engine asks of every reflection model; the models are in reflection_table.py."""

from typing import Any

from ..pipeline import reflection as pipeline
from .rounding import Step


class ReflectionEntry:
    """Hold what the engine knows of a reflection model.

    Every method takes a Material that names the model. What is said here holds for a model without a highlight, whose
    diffuse term errs by no more than N·L does. Of a highlight three numbers count, for one whose largest value is 1:
    what rounding adds, and how far it moves when the normal or the light's direction turns (engine/bounds.py).
    """

    is_lambert_when_dull = False  # with a black `specular` it reflects as Lambert's model does
    default_fresnel = 1.0  # F0 of a material that gives none

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

    def highlight_rounding(self, material: Any, u: float) -> float:
        """Return how far a highlight of height 1 is off by rounding; u is the unit roundoff."""
        return 0.0

    def turn_slope(self, material: Any) -> float:
        """Return what a highlight of height 1 changes by, at most, for each radian that the normal turns."""
        return 0.0

    def light_slope(self, material: Any, u: float) -> float:
        """Return the same for the direction to the light."""
        return self.turn_slope(material)

    def weight(self, material: Any, u: float) -> float:
        """Return the share of its height that a highlight has at most where these bounds hold, see `steps`."""
        return 1.0

    def steps(self, material: Any, u: float) -> tuple[Step, ...]:
        """Return where the model jumps."""
        return ()
