"""Lights: ambient, directional and point lights, and two ready-made sets that move with the camera.

A light is attached to the world or to the camera. Attached to the camera, its direction and position are
given in the camera's frame (x right, y up, the camera looks down -z), so the light goes where the camera
goes.

Conventions: a direction is the one in which the light travels; intensities are linear, per channel, never
negative.
"""

from dataclasses import dataclass

from rasterizer.errors import SceneError
from rasterizer.scene._check import choice, shown, unit3, vector3
from rasterizer.scene.color import linear_rgb

ATTACHMENTS = ("world", "camera")


@dataclass(frozen=True)
class AmbientLight:
    """Light a surface evenly from all sides.

    Parameters
    ----------
    color : intensity Ia, linear: a number, three numbers, hex or CSS text

    Raises
    ------
    SceneError : a colour that is not legal
    """

    color: object = 1.0

    def __post_init__(self):
        object.__setattr__(self, "color", linear_rgb(self.color, "the ambient light's color"))


@dataclass(frozen=True)
class DirectionalLight:
    """Light with parallel rays, from infinitely far away; it never gets weaker.

    Parameters
    ----------
    direction : three numbers, the direction in which the light travels; any length, stored as a unit vector
    color : intensity Ip, linear: a number, three numbers, hex or CSS text
    attached : "world", or "camera" where `direction` is given in the camera's frame

    Raises
    ------
    SceneError : a direction without length or not finite, a colour or attachment that is not legal
    """

    direction: tuple[float, float, float]
    color: object = 1.0
    attached: str = "world"

    def __post_init__(self):
        object.__setattr__(self, "direction", unit3(self.direction, "the directional light's direction"))
        object.__setattr__(self, "color", linear_rgb(self.color, "the directional light's color"))
        choice(self.attached, ATTACHMENTS, "the directional light's attached")


@dataclass(frozen=True)
class PointLight:
    """Light that shines from one point to all sides, and may get weaker with the distance d.

    The intensity at distance d is `color` times min(1, 1 / (kc + kl d + kq d²)); with `amplify` the minimum
    is left out, so that a surface nearer than the unit distance gets more than `color`.

    Parameters
    ----------
    position : three numbers, scene units
    color : intensity Ip, linear: a number, three numbers, hex or CSS text
    attenuation : (kc, kl, kq), finite, at least 0, not all 0; (1, 0, 0) = no fall-off, (0, 0, 1) = inverse
        square
    attached : "world", or "camera" where `position` is given in the camera's frame
    amplify : whether the attenuation may exceed 1

    Raises
    ------
    SceneError : a position, colour, attenuation or attachment that is not legal
    """

    position: tuple[float, float, float]
    color: object = 1.0
    attenuation: tuple[float, float, float] = (1.0, 0.0, 0.0)
    attached: str = "world"
    amplify: bool = False

    def __post_init__(self):
        object.__setattr__(self, "position", vector3(self.position, "the point light's position"))
        object.__setattr__(self, "color", linear_rgb(self.color, "the point light's color"))
        attenuation = vector3(self.attenuation, "the point light's attenuation (kc, kl, kq)")
        if min(attenuation) < 0.0 or max(attenuation) == 0.0:
            legal = "at least 0 and not all 0"
            raise SceneError(
                f"the point light's attenuation (kc, kl, kq) must be {legal}; given {shown(self.attenuation)}"
            )
        object.__setattr__(self, "attenuation", attenuation)
        choice(self.attached, ATTACHMENTS, "the point light's attached")
        object.__setattr__(self, "amplify", bool(self.amplify))


Light = AmbientLight | DirectionalLight | PointLight


def studio() -> tuple[Light, ...]:
    """Return the default lights: key from the upper left, weaker fill from the right, rim from behind and
    above, low ambient.

    They move with the camera and are exactly neutral, so that a grey scene needs one channel. The intensities
    are chosen so that the default material stays below 1 whichever way a surface faces, highlight included.
    """
    return (
        AmbientLight(0.08),
        DirectionalLight((0.55, -0.65, -0.75), 0.85, "camera"),
        DirectionalLight((-0.85, -0.10, -0.50), 0.20, "camera"),
        DirectionalLight((0.15, -0.70, 0.70), 0.30, "camera"),
    )


def headlight() -> tuple[Light, ...]:
    """Return one directional light along the view and a low ambient, both neutral: nothing seen is dark."""
    return (AmbientLight(0.15), DirectionalLight((0.0, 0.0, -1.0), 0.80, "camera"))
