"""Depth cueing: what is further away fades towards a colour."""

from dataclasses import dataclass

from ..errors import SceneError, shown
from .color import ColorLike, linear_rgb
from .validate import number
from .value_class import value_class


@value_class
@dataclass(frozen=True)
class DepthCue:
    """Let what is seen fade with its depth d: s·I + (1 - s)·`color`, with s = scale / (scale + max(d - start, 0)).

    That is the fall-off 1/(d + d0) by the viewer's distance of the textbooks (Rogers 1985, section 5.2), d0 being
    `scale`, and 1 where it begins. It tells parallel surfaces of one material apart that all light falls on alike. The
    depth is that of `Frame.depth`: the distance from the camera along the viewing axis. Everything that a surface sends
    out fades, ambient and emissive light too; the background does not. Exposure has no part in `color`. Pictures with a
    cue are computed in float64.

    Parameters
    ----------
    scale : number above 0, scene units: at the depth start + scale half of the surface's own light is left
    start : number, at least 0, scene units: nothing nearer fades
    color : colour as of a background, usually the same: a number, three linear numbers, hex or CSS text, or a Spectrum

    Raises
    ------
    SceneError : a value that is not legal
    """

    scale: float
    start: float = 0.0
    color: ColorLike = 0.0

    def __post_init__(self) -> None:
        scale = number(self.scale, "the depth cue's scale")
        if scale <= 0.0:
            raise SceneError(f"the depth cue's scale must be above 0; given {shown(self.scale)}")
        start = number(self.start, "the depth cue's start")
        if start < 0.0:
            raise SceneError(f"the depth cue's start must be at least 0; given {shown(self.start)}")
        object.__setattr__(self, "scale", scale)
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "color", linear_rgb(self.color, "the depth cue's color"))


def checked_cue(cue: DepthCue | float | None) -> DepthCue | None:
    """Return a DepthCue, of a number alone the one with that scale; None stays None.

    Raises SceneError for anything else.
    """
    if cue is None or isinstance(cue, DepthCue):
        return cue
    if isinstance(cue, (int, float)) and not isinstance(cue, bool):
        return DepthCue(cue)
    raise SceneError(f"the depth cue must be a DepthCue, a number (its scale), or None; given {shown(cue)}")
