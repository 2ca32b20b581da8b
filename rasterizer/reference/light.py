"""The illumination equation, in plain numpy float64 and in world space.

In: points with normals and materials, and the lights of a scene (`Lighting`). Out: the linear light that goes to the
viewer.

    lamp         what arrives from a light           shadow       whether anything lies between
    reflection   what goes on to the viewer, and the table of materials

Light is split in two. The *diffuse* part, ambient and diffuse reflection, is multiplied by the surface's colour. The
*specular* part, highlights and emission, is not: intensity = texel·diffuse + specular, with the texel of the very
sample in all methods of shading. With spectra the equation is evaluated for each wavelength; both parts then become
RGB, and vertex colours and textures, which are RGB and no spectra, multiply the diffuse part's RGB.

Letters: N normal, L to the light, V to the viewer.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.camera import Projection, View
from ..scene.lights import Light
from ..scene.scene import DepthCue, Scene
from ..scene.spectrum import rgb_of
from ..scene.texture import Texture
from ..vectors import unit
from .lamp import Arrival, Lamp, lamp_type_of, make_lamps
from .reflection import channels_of, count_waves, palette_of, read_materials, reflect
from .shadow import Casters, gather_casters, reaches
from .surface import Surface
from .vectors import dot


class Lighting(NamedTuple):
    """Everything that lighting needs beside the surface, for one grid of samples."""

    view: View
    projection: Projection
    materials: NDArray  # (n_material,) records of `read_materials`
    lights: tuple[Light, ...]
    shading: str
    textures: tuple[Texture | None, ...] = ()  # of each material; empty where no face has one
    metals: tuple[Texture | None, ...] = ()  # the same of the textures that say how metallic and rough a surface is
    casters: Casters | None = None  # None where no light casts shadows
    n_wave: int | None = None  # samples of the spectrum; None = red, green and blue
    cue: DepthCue | None = None  # None where nothing fades with depth
    exposure: float = 0.0  # stops, by which light is multiplied, but not the colour of the cue


class RayOrigins(NamedTuple):
    """Where the rays to the lights start."""

    points: NDArray[np.float64]  # (n, 3) world
    owner: NDArray[np.int64]  # (n,) see `Casters`


class Contribution(NamedTuple):
    """What one lamp adds to points; of an ambient share the direction is 0, and N.L counts as 1."""

    lamp: Lamp
    light_dirs: NDArray[np.float64]  # (n, 3) unit, to the light
    n_dot_l: NDArray[np.float64]  # (n,)
    attenuation: NDArray[np.float64]  # (n,) what arrives of the light: what distance and cone leave; 1 = all of it
    is_lit: NDArray[np.bool_]  # (n,) the point faces the light, and nothing lies between
    diffuse: NDArray[np.float64]  # (n, n_channel) to be multiplied by the surface's colour
    specular: NDArray[np.float64]  # (n, n_channel)


def make_lighting(
    scene: Scene,
    surface: Surface,
    view: View,
    projection: Projection,
    shading: str,
    spectral: int | None,
    exposure: float = 0.0,
) -> Lighting:
    """Gather what lighting needs, for one grid of samples; `spectral` is the number of wavelengths asked for, or
    None."""
    palette = palette_of(scene)
    n_wave = count_waves(scene, spectral)
    textures = tuple(material.texture for material in palette)
    casters = None
    if any(getattr(light, "shadow", None) for light in scene.lights):
        is_opaque = np.array([material.is_opaque for material in palette])[surface.material]
        owner = surface.polygon if shading == "flat" else np.arange(len(surface.corners))
        casters = gather_casters(surface.corners, owner, is_opaque)
    if all(texture is None for texture in textures):
        textures = ()
    is_lit_per_sample = shading == "phong"
    metals = tuple(material.as_lit(is_lit_per_sample).metallic_roughness for material in palette)
    metals = metals if any(texture is not None for texture in metals) else ()
    table = read_materials(scene, n_wave, is_lit_per_sample)
    return Lighting(
        view, projection, table, scene.lights, shading, textures, metals, casters, n_wave, scene.depth_cue, exposure
    )


def light_points(
    points: NDArray, normals: NDArray, material: NDArray, lighting: Lighting,
    origins: RayOrigins | None = None, tangents: NDArray | None = None, metals: NDArray | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
    """Evaluate the illumination equation.

    I = ke + a ka Ia + sum over the lights of S f_att Ip lit (a (kd D + ks M) + ks F), per channel, with D, F and M
    as `reflect` computes them; lit means N.L > 0: no highlight from a light behind the surface. a is the surface's
    colour; S is 0 in shadow, else 1.

    Parameters
    ----------
    points : (n, 3) float64, world
    normals : (n, 3) float64, unit
    material : (n,) int, rows of the table of materials
    lighting : all else
    origins : where rays to the lights start; None = nothing lies in shadow
    tangents : (n, 3) float64, the directions in which u grows; None where the scene has no texture coordinates
    metals : (n, 2) float64, what textures multiply metallic and roughness by; None = 1

    Returns
    -------
    diffuse : (n, 3) float64, linear RGB: what a multiplies
    specular : (n, 3) float64, linear RGB
    """
    diffuse, specular = ambient_light(material, lighting), lighting.materials["emissive"][material]
    for each in contributions(points, normals, material, lighting, origins, tangents, metals):
        diffuse += each.diffuse
        specular += each.specular
    return as_rgb(diffuse, lighting), as_rgb(specular, lighting)


def ambient_light(material: NDArray, lighting: Lighting) -> NDArray[np.float64]:
    """Return the ambient light that materials (n,) reflect, (n, n_channel)."""
    coefficients = lighting.materials["ambient"][material]
    total = np.zeros_like(coefficients)
    for light in lighting.lights:
        if lamp_type_of(light).is_ambient:
            total += coefficients * channels_of(light.color, lighting.n_wave)
    return total


def materials_at(material: NDArray, lighting: Lighting, metals: NDArray | None) -> NDArray:
    """Return the row of each point's material, with what textures make metallic and rough; see `light_points`."""
    table = lighting.materials[material]
    if metals is not None:
        table["metallic"] *= metals[:, 0]
        has_texture = np.array([texture is not None for texture in lighting.metals])[material]
        alpha = np.where(has_texture, np.maximum(table["roughness"] * metals[:, 1], 0.001), table["roughness"])
        table["roughness"], table["across"] = alpha, np.where(has_texture, alpha, table["across"])
    return table


def contributions(
    points: NDArray, normals: NDArray, material: NDArray, lighting: Lighting,
    origins: RayOrigins | None = None, tangents: NDArray | None = None, metals: NDArray | None = None,
) -> Iterator[Contribution]:  # fmt: skip
    """Compute what each lamp adds, one after the other; parameters are those of `light_points`."""
    table = materials_at(material, lighting, metals)
    view_dirs = to_viewer(points, lighting)
    brush = table["axis"] if tangents is None else np.where(table["is_by_u"][:, None], tangents, table["axis"])

    def channels(color: object) -> NDArray:
        return channels_of(color, lighting.n_wave)

    for lamp in make_lamps(lighting.lights, lighting.view, channels):
        for arrival in lamp_type_of(lamp.light).arrivals(lamp, points, normals, channels):
            color = arrival.color if arrival.strength is None else arrival.color * arrival.strength
            left = np.ones(len(points)) if arrival.strength is None else arrival.strength[:, 0]
            if arrival.light_dirs is None:
                yield _ambient_share(lamp, color, left, table)
                continue
            n_dot_l = dot(normals, arrival.light_dirs)
            is_lit = n_dot_l > 0
            if origins is not None and lighting.casters is not None and getattr(lamp.light, "shadow", None):
                is_lit[is_lit] = _is_reached(lamp, arrival, origins, is_lit, lighting.casters)
            diffuse, specular, metal = reflect(table, normals, arrival.light_dirs, view_dirs, brush)
            with np.errstate(invalid="ignore"):  # an amplifying light in the very point
                of_color = table["diffuse"] * diffuse + table["specular"] * metal
                reflected = color * of_color, color * table["specular"] * specular
            diffuse, specular = (np.where(is_lit[:, None], part, 0) for part in reflected)
            yield Contribution(lamp, arrival.light_dirs, n_dot_l, left, is_lit, diffuse, specular)


def _ambient_share(lamp: Lamp, color: NDArray, left: NDArray, table: NDArray) -> Contribution:
    """Return what light from all sides adds to points: it has no direction, and its N.L counts as 1."""
    diffuse = color * table["ambient"]
    n = len(left)
    return Contribution(
        lamp, np.zeros((n, 3)), np.ones(n), left, np.ones(n, bool), diffuse, np.zeros_like(diffuse)
    )  # fmt: skip


def as_rgb(light: NDArray, lighting: Lighting) -> NDArray[np.float64]:
    """Return light (n, n_channel) as linear RGB (n, 3)."""
    return light if lighting.n_wave is None else rgb_of(light)


def to_viewer(points: NDArray, lighting: Lighting) -> NDArray[np.float64]:
    """Return the unit vectors (n, 3) from points to the viewer."""
    if lighting.projection.is_perspective:
        return unit(lighting.view.eye - points)
    return np.broadcast_to(-lighting.view.forward, points.shape)


def _is_reached(lamp: Lamp, arrival: Arrival, origins: RayOrigins, at: NDArray, casters: Casters) -> NDArray[np.bool_]:
    """Tell of the origins `at` (n,) bool which ones a lamp reaches."""
    points = origins.points[at]
    is_finite = lamp.position is not None
    to_light = lamp.position - points if is_finite else arrival.light_dirs[at]
    return reaches(casters, points, origins.owner[at], to_light, is_finite)
