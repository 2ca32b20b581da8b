"""The lights of the judge: what arrives at a point, in plain numpy float64, as RGB or in samples of the spectrum."""

from typing import NamedTuple

import numpy as np

from ..errors import SceneError
from ..scene.camera import View
from ..scene.lights import AmbientLight, AreaLight, DirectionalLight, PointLight, SpotLight
from .reflection import GRAZING
from .vectors import dot, length, unit


class Lamp(NamedTuple):
    """A light that shines from a single point or direction, in the world's frame."""

    light: PointLight | SpotLight | AreaLight | DirectionalLight  # of an area light this is a cell
    color: np.ndarray  # (n_channel,) float64
    axis: np.ndarray  # (3,) float64, unit: the way the light travels; 0 for a point light
    position: np.ndarray | None  # (3,) float64; None where the light is infinitely far away


def place_lamps(lights, view: View, channels_of) -> list[Lamp]:
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
    for light in lights:
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
                lamps.append(Lamp(light, share, np.zeros(3), origin + corner + u * (s + 0.5) / m + v * (t + 0.5) / n))
        elif isinstance(light, DirectionalLight):
            lamps.append(Lamp(light, channels_of(light.color), np.array(light.direction) @ axes, None))
        else:
            axis = np.array(light.direction) @ axes if isinstance(light, SpotLight) else np.zeros(3)
            lamps.append(Lamp(light, channels_of(light.color), axis, origin + np.array(light.position) @ axes))
    return lamps


def shine(lamp: Lamp, points):
    """Return the unit vectors (n, 3) from points (n, 3) to a lamp, and its weakened colour, (n, n_channel) or
    (n_channel,)."""
    if lamp.position is None:
        return np.broadcast_to(-lamp.axis, points.shape), lamp.color
    light, to_light = lamp.light, lamp.position - points
    distance = length(to_light)
    constant, linear, quadratic = light.attenuation
    with np.errstate(divide="ignore"):
        attenuation = 1.0 / (constant + linear * distance + quadratic * distance**2)
    strength = attenuation if light.amplify else np.minimum(attenuation, 1.0)
    if light.range is not None:
        strength = np.where(distance < light.range, strength * (1.0 - (distance / light.range) ** 4), 0.0)
    if isinstance(light, SpotLight):
        strength = strength * _cone(light, lamp.axis, unit(to_light))
    return unit(to_light), lamp.color * strength


def _cone(light, axis, light_dirs) -> np.ndarray:
    """Return the part of a spot light (n, 1) that goes into the directions opposite to light_dirs (n, 3)."""
    cosine = -dot(light_dirs, axis)[:, None]
    inner, outer = np.cos(np.radians([light.inner, light.outer]))
    t = np.clip((cosine - outer) / (inner - outer), 0.0, 1.0) if inner > outer else 1.0 * (cosine >= outer - GRAZING)
    return (t**2 * (3.0 - 2.0 * t)) ** light.falloff * np.clip(cosine, 0.0, 1.0) ** light.exponent
