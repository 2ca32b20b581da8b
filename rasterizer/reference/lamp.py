"""What arrives of a light at a point, in plain numpy float64, as RGB or in samples of the spectrum.

In: the lights of a scene. Out: `Lamp`s, each of which shines from one point or direction, and what they send to points.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..scene.camera import View
from ..scene.lights import AmbientLight, AreaLight, DirectionalLight, Light, PointLight, SpotLight
from .reflection import GRAZING
from .vectors import dot, length, unit


class Lamp(NamedTuple):
    """A light that shines from a single point or direction, in the world's frame."""

    light: PointLight | SpotLight | AreaLight | DirectionalLight  # of an area light this is a cell
    color: NDArray[np.float64]  # (n_channel,)
    axis: NDArray[np.float64]  # (3,) unit: the way the light travels; 0 for a point light
    position: NDArray[np.float64] | None  # (3,); None where the light is infinitely far away
    index: int = 0  # of the light in its scene


def place_lamps(lights: Iterable[Light], view: View, channels_of: Callable[[object], NDArray]) -> list[Lamp]:
    """Place the lights of a scene in the world; an area light becomes a point light in the centre of each of its cells.

    Parameters
    ----------
    lights : of the scene; ambient ones are left out, as they come from nowhere
    view : lights that are attached to the camera move with it
    channels_of : function from a colour to its (n_channel,) values

    Returns
    -------
    list of Lamp

    Raises
    ------
    SceneError : a light of another kind
    """
    lamps = []
    for index, light in enumerate(lights):
        if isinstance(light, AmbientLight):
            continue
        if not isinstance(light, DirectionalLight | PointLight | SpotLight | AreaLight):
            raise SceneError(f"the reference renderer knows no {type(light).__name__}")
        is_carried = light.attached == "camera"
        axes = np.array([view.right, view.up, -view.forward]) if is_carried else np.eye(3)
        origin = view.eye if is_carried else np.zeros(3)
        if isinstance(light, AreaLight):
            corner, u, v = (np.array(vector) @ axes for vector in (light.corner, light.edge_u, light.edge_v))
            m, n = light.resolution
            share = channels_of(light.color) / (m * n)
            for s, t in np.ndindex(m, n):
                lamps.append(
                    Lamp(light, share, np.zeros(3), origin + corner + u * (s + 0.5) / m + v * (t + 0.5) / n, index)
                )
        elif isinstance(light, DirectionalLight):
            lamps.append(Lamp(light, channels_of(light.color), np.array(light.direction) @ axes, None, index))
        else:
            axis = np.array(light.direction) @ axes if isinstance(light, SpotLight) else np.zeros(3)
            lamps.append(Lamp(light, channels_of(light.color), axis, origin + np.array(light.position) @ axes, index))
    return lamps


def shine(lamp: Lamp, points: NDArray) -> tuple[NDArray, NDArray]:
    """Return the unit vectors (n, 3) from points (n, 3) to a lamp, and its weakened colour, (n, n_channel) or
    (n_channel,)."""
    light_dirs, attenuation = attenuate(lamp, points)
    return light_dirs, lamp.color if attenuation is None else lamp.color * attenuation


def attenuate(lamp: Lamp, points: NDArray) -> tuple[NDArray, NDArray | None]:
    """Return the unit vectors (n, 3) from points (n, 3) to a lamp, and what distance and cone leave of it, (n, 1).

    None instead of the latter where the light is infinitely far away: nothing weakens it.
    """
    if lamp.position is None:
        return np.broadcast_to(-lamp.axis, points.shape), None
    light, to_light = lamp.light, lamp.position - points
    distance = length(to_light)
    constant, linear, quadratic = light.attenuation
    with np.errstate(divide="ignore"):
        attenuation = 1.0 / (constant + linear * distance + quadratic * distance**2)
    if not light.amplify:
        attenuation = np.minimum(attenuation, 1.0)
    if light.range is not None:
        attenuation = np.where(distance < light.range, attenuation * (1.0 - (distance / light.range) ** 4), 0.0)
    if isinstance(light, SpotLight):
        attenuation = attenuation * _cone(light, lamp.axis, unit(to_light))
    return unit(to_light), attenuation


def _cone(light: SpotLight, axis: NDArray, light_dirs: NDArray) -> NDArray[np.float64]:
    """Return the part of a spot light (n, 1) that goes into the directions opposite to light_dirs (n, 3)."""
    cosine = -dot(light_dirs, axis)[:, None]
    inner, outer = np.cos(np.radians([light.inner, light.outer]))
    t = np.clip((cosine - outer) / (inner - outer), 0.0, 1.0) if inner > outer else 1.0 * (cosine >= outer - GRAZING)
    return (t**2 * (3.0 - 2.0 * t)) ** light.falloff * np.clip(cosine, 0.0, 1.0) ** light.exponent
