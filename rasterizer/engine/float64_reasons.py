"""Why a material is lit in float64: reasons that are its own, or that of its lights."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from . import light_table, reflection_table

SMALL, LARGE = 2.0**-40, 2.0**60  # scene units: squares of lengths between them keep their digits in float32


def reasons_of(
    material: Any, lights: Sequence[Any], tolerance: float, rounding: float, bound: float
) -> tuple[str, ...]:
    """Say why float32 won't do for a material, in a few words each; nothing where it does.

    Float32 may spend half of the tolerance on rounding, a quarter each on normals and on colours between the corners;
    or the rest on intensities between them.

    Parameters
    ----------
    lights : those that may reach it
    rounding : what float32 may add to an intensity of it, linear
    bound : the largest intensity that it may have; infinite where a light amplifies without limit
    """
    reasons = {
        "tolerance 0": tolerance == 0,
        "rounding beyond half of the tolerance": not rounding <= tolerance / 2,
        "lights without bound": not np.isfinite(bound),
        "numbers of lights beyond float32": not are_single(lights),
        reflection_table.entry_of(material).reason_for_float64(material): True,
    }
    return tuple(reason for reason, holds in reasons.items() if reason and holds)


def are_single(lights: Sequence[Any]) -> bool:
    """Tell whether the coefficients of lights keep their digits in float32, and their products with squares of lengths,
    too."""
    return all(SMALL <= length <= LARGE for light in lights for length in light_table.entry_of(light).lengths(light))
