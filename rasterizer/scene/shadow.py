"""How a light casts shadows: the size and the filter of its shadow maps."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from ..errors import SceneError, shown
from .validate import is_whole
from .value_class import value_class

MOST_TEXELS = 8192  # along a side of a shadow map
MOST_TAPS = 9  # along a side of its filter


@value_class
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

    def __post_init__(self) -> None:
        for field, kind, low, high, step in (
            ("size", "a whole", 16, MOST_TEXELS, 1),
            ("filter", "an odd", 1, MOST_TAPS, 2),
        ):
            value = getattr(self, field)
            if not (is_whole(value, low, high) and (value - low) % step == 0):
                raise SceneError(
                    f"the shadow's {field} must be {kind} number within {low}..{high}; given {shown(value)}"
                )
            object.__setattr__(self, field, int(value))


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


def with_shadow_fields(lights: Iterable[Any], **fields: int) -> tuple:
    """Return lights whose shadows, where they cast any, have other fields."""

    def changed(light: Any) -> Any:
        shadow = getattr(light, "shadow", None)
        return light if shadow is None else replace(light, shadow=replace(shadow, **fields))

    return tuple(map(changed, lights))


def without_shadows(lights: Iterable[Any]) -> tuple[Any, ...]:
    """Return lights that cast no shadows."""
    return tuple(replace(light, shadow=None) if hasattr(light, "shadow") else light for light in lights)
