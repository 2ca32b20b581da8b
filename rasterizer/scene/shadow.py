"""How a light casts shadows: the size and the filter of its shadow maps."""

import operator
from dataclasses import dataclass
from typing import Any

from ..errors import SceneError
from .validate import shown

MOST_TEXELS = 8192  # along a side of a shadow map
MOST_TAPS = 9  # along a side of its filter


@dataclass(frozen=True)
class Shadow:
    """How a light casts shadows: by shadow maps (Williams 1978), depths of the scene as the light sees it.

    Parameters
    ----------
    size : texels along each side of the map, 16 to 8192. A directional light has one map, fitted to the scene; a light
        with a place has one if the scene, or its cone, fits into a view of 63 degrees to each side, else six. The cells
        of an area light have maps of half the size, but at least 16
    filter : side of the square of texels whose comparisons are averaged (percentage-closer filtering, Reeves, Salesin &
        Cook 1987): an odd number, 1 (hard edges) to 9

    Raises
    ------
    SceneError : a value that is not legal
    """

    size: int = 1024
    filter: int = 1

    def __post_init__(self):
        for field, low, high, step in (("size", 16, MOST_TEXELS, 1), ("filter", 1, MOST_TAPS, 2)):
            value = getattr(self, field)
            try:
                count = -1 if isinstance(value, bool) else operator.index(value)
            except TypeError:
                count = -1
            if not (low <= count <= high and (count - low) % step == 0):
                what = "an odd" if step == 2 else "a whole"
                raise SceneError(
                    f"the shadow's {field} must be {what} number within {low}..{high}; given {shown(value)}"
                )
            object.__setattr__(self, field, count)


def checked_shadow(shadow: Any, whose: str) -> Shadow | None:
    """Return what a light's field `shadow` is stored as: a Shadow, or None for a light that casts none.

    Parameters
    ----------
    shadow : Shadow, True, False or None
    whose : text, the light's name in messages, such as "the point light's"

    Raises
    ------
    SceneError : anything else
    """
    if shadow is None or shadow is False:
        return None
    if shadow is True:
        return Shadow()
    if not isinstance(shadow, Shadow):
        raise SceneError(f"{whose} shadow must be a Shadow, True, False or None; given {shown(shadow)}")
    return shadow
