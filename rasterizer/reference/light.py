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
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.camera import Projection, View
from ..scene.lights import Light
from ..scene.scene import DepthCue, Scene
from ..scene.spectrum import rgb_of
from ..scene.texture import Texture
from ..vectors import unit
from .cut_outs import are_there
from .lamp import Lamp, lamp_type_of, make_lamps
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


class Points(NamedTuple):
    """Points at which the illumination equation is evaluated."""

    positions: NDArray[np.float64]  # (n, 3) world
    normals: NDArray[np.float64]  # (n, 3) unit, to the viewer
    material: NDArray[np.int64]  # (n,) row of the table of materials
    albedo: NDArray[np.float64] | None = None  # (n, 3) linear RGB that multiplies the diffuse part
    origins: NDArray[np.float64] | None = None  # (n, 3) where the rays to the lights start; None = none are in shadow
    owner: NDArray[np.int64] | None = None  # (n,) whose these are, see `Casters`
    tangents: NDArray[np.float64] | None = None  # (n, 3) None where no material is brushed along u
    metals: NDArray[np.float64] | None = None  # (n, 2) what textures multiply metallic and roughness by; None = 1


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
        if any(material.alpha_cutoff is not None for material in palette):
            casters = casters._replace(are_there=partial(are_there, surface, palette))
    if all(texture is None for texture in textures):
        textures = ()
    is_lit_per_sample = shading == "phong"
    metals = tuple(material.as_lit(is_lit_per_sample).metallic_roughness for material in palette)
    metals = metals if any(texture is not None for texture in metals) else ()
    table = read_materials(scene, n_wave, is_lit_per_sample)
    return Lighting(
        view, projection, table, scene.lights, shading, textures, metals, casters, n_wave, scene.depth_cue, exposure
    )


def light_points(points: Points, lighting: Lighting) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Evaluate the illumination equation.

    I = ke + a ka Ia + sum over the lights of S f_att Ip lit (a (kd D + ks M) + ks F), per channel, with D, F and M
    as `reflect` computes them; lit means N.L > 0: no highlight from a light behind the surface. a is the surface's
    colour; S is 0 in shadow, else 1.

    Returns
    -------
    diffuse : (n, 3) float64, linear RGB: what a multiplies
    specular : (n, 3) float64, linear RGB
    """
    diffuse, specular = ambient_light(points.material, lighting), lighting.materials["emissive"][points.material]
    for each in contributions(points, lighting):
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


def materials_at(points: Points, lighting: Lighting) -> NDArray:
    """Return the row of each point's material, with what textures make metallic and rough."""
    table, metals = lighting.materials[points.material], points.metals
    if metals is not None:
        table["metallic"] *= metals[:, 0]
        has_texture = np.array([texture is not None for texture in lighting.metals])[points.material]
        alpha = np.where(has_texture, np.maximum(table["roughness"] * metals[:, 1], 0.001), table["roughness"])
        table["roughness"], table["across"] = alpha, np.where(has_texture, alpha, table["across"])
    return table


def contributions(points: Points, lighting: Lighting) -> Iterator[Contribution]:
    """Compute what each lamp adds, one after the other."""
    positions, normals, n, origins = points.positions, points.normals, len(points.positions), points.origins
    table, view_dirs, brush = materials_at(points, lighting), to_viewer(positions, lighting), points.tangents
    brush = table["axis"] if brush is None else np.where(table["is_by_u"][:, None], brush, table["axis"])

    def channels(color: object) -> NDArray:
        return channels_of(color, lighting.n_wave)

    for lamp in make_lamps(lighting.lights, lighting.view, channels):
        for arrival in lamp_type_of(lamp.light).arrivals(lamp, positions, normals, channels):
            color = arrival.color if arrival.strength is None else arrival.color * arrival.strength
            left = np.ones(n) if arrival.strength is None else arrival.strength[:, 0]
            if arrival.light_dirs is None:  # light from all sides has no direction, and its N.L counts as 1
                diffuse, everywhere = color * table["ambient"], np.ones(n, bool)
                yield Contribution(
                    lamp, np.zeros((n, 3)), np.ones(n), left, everywhere, diffuse, np.zeros_like(diffuse)
                )
                continue
            n_dot_l = dot(normals, arrival.light_dirs)
            is_lit = n_dot_l > 0
            if origins is not None and lighting.casters is not None and getattr(lamp.light, "shadow", None):
                starts, is_finite = origins[is_lit], lamp.position is not None
                to_light = lamp.position - starts if is_finite else arrival.light_dirs[is_lit]
                is_lit[is_lit] = reaches(lighting.casters, starts, points.owner[is_lit], to_light, is_finite)
            diffuse, specular, metal = reflect(table, normals, arrival.light_dirs, view_dirs, brush)
            with np.errstate(invalid="ignore"):  # an amplifying light in the very point
                of_color = table["diffuse"] * diffuse + table["specular"] * metal
                reflected = color * of_color, color * table["specular"] * specular
            diffuse, specular = (np.where(is_lit[:, None], part, 0) for part in reflected)
            yield Contribution(lamp, arrival.light_dirs, n_dot_l, left, is_lit, diffuse, specular)


def as_rgb(light: NDArray, lighting: Lighting) -> NDArray[np.float64]:
    """Return light (n, n_channel) as linear RGB (n, 3)."""
    return light if lighting.n_wave is None else rgb_of(light)


def to_viewer(points: NDArray, lighting: Lighting) -> NDArray[np.float64]:
    """Return the unit vectors (n, 3) from points to the viewer."""
    if lighting.projection.is_perspective:
        return unit(lighting.view.eye - points)
    return np.broadcast_to(-lighting.view.forward, points.shape)
