"""What arrives of a light at a point, in plain numpy float64, as RGB or in samples of the spectrum.

In: the lights of a scene. Out: `Lamp`s, each of which shines from one point or direction, and what they send to points.
Every type of light is one class and one line in LAMP_TYPES. Light of one's own is a class that derives from
`registries.CustomLight`; CustomLamp asks it.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..scene.camera import View
from ..scene.lights import light_type_of
from ..vectors import length, unit
from .reflection import GRAZING
from .vectors import dot

ChannelsOf = Callable[[object], NDArray]  # from a colour to its (n_channel,) values


class Lamp(NamedTuple):
    """A light that shines from a single point or direction, in the world's frame."""

    light: Any  # as in the scene; of an area light this is a cell
    color: NDArray[np.float64]  # (n_channel,)
    axis: NDArray[np.float64]  # (3,) unit: the direction in which the light travels; 0 where it has none
    position: NDArray[np.float64] | None  # (3,); None where the light is infinitely far away
    index: int = 0  # of the light in its scene
    frame: "Frame | None" = None  # that of the light's vectors; None where nobody asks


class Arrival(NamedTuple):
    """What arrives at points: of light with a direction, or an ambient share."""

    color: NDArray[np.float64]  # (n_channel,)
    light_dirs: NDArray[np.float64] | None  # (n, 3) unit, to the light; None = from all sides: an ambient share
    strength: NDArray[np.float64] | None  # (n, 1) what arrives of the colour; None = all


class Frame(NamedTuple):
    """The frame in which the vectors of a light are given: the world's, or that of the camera which carries it."""

    origin: NDArray[np.float64]  # (3,) world
    axes: NDArray[np.float64]  # (3, 3) rows: its x, y and z axis in the world

    def point(self, position: Sequence[float]) -> NDArray[np.float64]:
        """Return a position in the world."""
        return self.origin + np.array(position) @ self.axes

    def vector(self, direction: Sequence[float]) -> NDArray[np.float64]:
        """Return a direction in the world."""
        return np.array(direction) @ self.axes


class LampType:
    """Say how a type of light is evaluated. What is said here holds for parallel rays that nothing weakens."""

    is_ambient = False  # the light comes from nowhere: only its colour counts

    def lamps_of(self, light: Any, frame: Frame, color: NDArray, index: int) -> list[Lamp]:
        """Return the lamps of a light with this colour (n_channel,); `index` is that of the light in its scene."""
        return [Lamp(light, color, frame.vector(light.direction), None, index)]

    def attenuate(self, lamp: Lamp, points: NDArray) -> tuple[NDArray, NDArray | None]:
        """Return the unit vectors (n, 3) float64 from points (n, 3), world space, to a lamp, and what is left of its
        light there, (n, 1) float64; None instead of the latter where nothing weakens it."""
        return np.broadcast_to(-lamp.axis, points.shape), None

    def arrivals(self, lamp: Lamp, points: NDArray, normals: NDArray, channels_of: ChannelsOf) -> list["Arrival"]:
        """Return what arrives of a lamp at points (n, 3) with unit normals (n, 3), world space."""
        return [Arrival(lamp.color, *self.attenuate(lamp, points))]


class AmbientLamp(LampType):
    """Light from all sides: no lamp."""

    is_ambient = True

    def lamps_of(self, light: Any, frame: Frame, color: NDArray, index: int) -> list[Lamp]:
        """Return no lamp."""
        return []


class PointLamp(LampType):
    """Light from one point to all sides."""

    def lamps_of(self, light: Any, frame: Frame, color: NDArray, index: int) -> list[Lamp]:
        """Return one lamp without an axis."""
        return [Lamp(light, color, np.zeros(3), frame.point(light.position), index)]

    def attenuate(self, lamp: Lamp, points: NDArray) -> tuple[NDArray, NDArray | None]:
        """Weaken the light by 1/(kc + kl d + kq d^2), and to nothing at its range: 1 - (d/r)^4."""
        light, to_light = lamp.light, lamp.position - points
        distance = length(to_light)
        constant, linear, quadratic = light.attenuation
        with np.errstate(divide="ignore"):
            attenuation = 1.0 / (constant + linear * distance + quadratic * distance**2)
        if not light.amplify:
            attenuation = np.minimum(attenuation, 1.0)
        if light.range is not None:
            attenuation = np.where(distance < light.range, attenuation * (1.0 - (distance / light.range) ** 4), 0.0)
        return unit(to_light), attenuation


class SpotLamp(PointLamp):
    """Light from one point into a cone."""

    def lamps_of(self, light: Any, frame: Frame, color: NDArray, index: int) -> list[Lamp]:
        """Return one lamp with an axis."""
        return [Lamp(light, color, frame.vector(light.direction), frame.point(light.position), index)]

    def attenuate(self, lamp: Lamp, points: NDArray) -> tuple[NDArray, NDArray | None]:
        """Weaken the light as that of a point, and by the angle from the axis."""
        light_dirs, attenuation = super().attenuate(lamp, points)
        return light_dirs, attenuation * _cone(lamp.light, lamp.axis, light_dirs)


class AreaLamp(PointLamp):
    """Light from a parallelogram: that of a point in the centre of each of its cells."""

    def lamps_of(self, light: Any, frame: Frame, color: NDArray, index: int) -> list[Lamp]:
        """Return one lamp a cell, each with its share of the colour."""
        corner = frame.origin + frame.vector(light.corner)
        u, v = frame.vector(light.edge_u), frame.vector(light.edge_v)
        m, n = light.resolution
        share = color / (m * n)
        centers = [corner + u * (s + 0.5) / m + v * (t + 0.5) / n for s, t in np.ndindex(m, n)]
        return [Lamp(light, share, np.zeros(3), center, index) for center in centers]


class CustomLamp(LampType):
    """Light of one's own: what its class says, a `registries.CustomLight`."""

    def lamps_of(self, light: Any, frame: Frame, color: NDArray, index: int) -> list[Lamp]:
        """Return one lamp, whatever parts the engine draws."""
        place = light.reference_position(frame)
        return [Lamp(light, color, np.zeros(3), None if place is None else np.asarray(place, float), index, frame)]

    def arrivals(self, lamp: Lamp, points: NDArray, normals: NDArray, channels_of: ChannelsOf) -> list[Arrival]:
        """Return what the class says of these points."""
        found = []
        for color, light_dirs, strength in lamp.light.reference(points, normals, lamp.frame):
            column = np.broadcast_to(np.asarray(strength, np.float64), len(points))[:, None]
            found.append(Arrival(channels_of(color), light_dirs, column))
        return found


# By the words of scene.lights.LIGHT_TYPES. It shares nothing with the table of the engine, which it judges.
LAMP_TYPES: dict[str, LampType] = {
    "ambient": AmbientLamp(),
    "directional": LampType(),
    "point": PointLamp(),
    "spot": SpotLamp(),
    "area": AreaLamp(),
}


def lamp_type_of(light: Any) -> LampType:
    """Return how a light is evaluated.

    Raises
    ------
    SceneError : the type is unknown, to scenes or to the reference; the message lists those that are known
    """
    name = light_type_of(light)
    if name not in LAMP_TYPES:
        raise SceneError(f"the reference knows lights of the types {', '.join(LAMP_TYPES)}; given one of type {name!r}")
    return LAMP_TYPES[name]


def make_lamps(lights: Iterable[Any], view: View, channels_of: ChannelsOf) -> list[Lamp]:
    """Place the lights of a scene in the world; an area light becomes a point light in the centre of each of its cells.

    Parameters
    ----------
    lights : of the scene; ambient ones have no lamps, as they come from nowhere
    view : lights that are attached to the camera move with it
    channels_of : function from a colour to its (n_channel,) values

    Returns
    -------
    list of Lamp

    Raises
    ------
    SceneError : a light of another type
    """
    camera = Frame(view.eye, np.array([view.right, view.up, -view.forward]))
    world = Frame(np.zeros(3), np.eye(3))
    lamps = []
    for index, light in enumerate(lights):
        frame = camera if getattr(light, "attached", "world") == "camera" else world
        lamps += lamp_type_of(light).lamps_of(light, frame, channels_of(light.color), index)
    return lamps


def _cone(light: Any, axis: NDArray, light_dirs: NDArray) -> NDArray[np.float64]:
    """Return the part of a spot light (n, 1) that goes into the directions opposite to light_dirs (n, 3)."""
    cosine = -dot(light_dirs, axis)[:, None]
    inner, outer = np.cos(np.radians([light.inner, light.outer]))
    t = np.clip((cosine - outer) / (inner - outer), 0.0, 1.0) if inner > outer else 1.0 * (cosine >= outer - GRAZING)
    return (t**2 * (3.0 - 2.0 * t)) ** light.falloff * np.clip(cosine, 0.0, 1.0) ** light.exponent
