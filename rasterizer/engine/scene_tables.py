"""A scene as tables: read once, and handed on in its place.

    Scene ─ tables (here) ─ plan (plan.py) ─ geometry (points.py) ─ passes (passes.py)

Its different materials and its lights are listed and numbered, area lights are taken apart, the exposure is multiplied
in, and where colours are spectra the products of materials and lights. Below that stands what surfaces are beside
their illumination, as arrays that the pipeline reads, and the tint that one channel is enough for.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..locks import cached_property
from ..options import Options
from ..scene.mesh import Mesh
from ..scene.scene import DepthCue, Scene
from . import lights as light_table
from . import reflections as reflection_table
from .points import count_texcoords, number_materials
from .reflections import count_terms, fresnel_of, is_metallic

N_BOX = 2**12  # boxes round faces of a mesh, at most: their distances from lights are found in a moment


class SceneTables:
    """What a scene is made of, under the options of a picture.

    Parameters
    ----------
    scene : Scene, of which nothing else is read later
    options : of which shading, exposure and spectral count. Light and what materials emit are multiplied by the
        exposure: the illumination equation is linear in them

    Attributes
    ----------
    meshes, background, depth_cue : as the scene has them
    bounds : (n_mesh, 2, 3) float64, boxes round the meshes, world space
    materials : the different ones of all meshes, as they are lit
    models : what the engine knows of each material's reflection model, see reflections.py
    n_terms : of each material, see `count_terms`
    palettes : for each mesh the numbers of its materials
    lights : all but ambient and black ones; those of an area light one by one
    light_types : what the engine knows of the type of each, see lights.py
    n_black : how many are black
    ambient : (3,) float64, the sum of the ambient lights
    products : those of colours, in which the exposure is included; None where it is done later: see `multiply_colors`
    is_lit : (n_material, n_light) bool: the material reflects something of the light
    lit_by : numbers of the lights that some material reflects something of
    reflected_lights : these lights
    has_shadows : some of these cast shadows
    is_opaque : nothing shows through anything
    has_cut_outs : some material has an `alpha_cutoff`
    has_texture, has_vertex_colors, has_hues : (n_material,) bool: it has a texture; it is one of meshes with colours;
        some of these aren't grey
    n_texcoord : texture coordinates of a point
    max_texel : the largest component of any texture, 1 where there is none
    max_albedo : the same of the colours that multiply what materials reflect, textures' included
    material_boxes : (n_material, 2, 3) float64, boxes round the meshes that have them, world space
    """

    def __init__(self, scene: Scene, options: Options) -> None:
        self.meshes: tuple[Mesh, ...] = scene.meshes
        self.background: tuple[float, float, float] | None = scene.background  # linear
        self.depth_cue: DepthCue | None = scene.depth_cue

        # Materials are listed and numbered, area lights are taken apart, black ones are left out.
        listed, self.palettes = number_materials(self.meshes)
        materials, lights, ambient_lights, self.light_types, self.n_black = [], [], [], [], 0
        for material in listed:
            materials.append(material.as_lit(options.shading == "phong"))
        for light in scene.lights:
            row = light_table.entry_of(light)
            if row.is_ambient:
                ambient_lights.append(light)
            for part in row.expand(light):
                if light_table.is_black(part):
                    self.n_black += 1
                else:
                    lights.append(part)
                    self.light_types.append(row if part is light else light_table.entry_of(part))
        self.models = [*map(reflection_table.entry_of, materials)]

        # The exposure is in the products of colours, else in the light and in what materials emit.
        is_share = np.zeros(len(lights), np.bool_)
        for k, row in enumerate(self.light_types):
            is_share[k] = row.is_share
        self.products = multiply_colors(materials, lights, is_share, ambient_lights, options)
        if self.products is None and options.exposure != 0.0:
            materials = exposed(materials, "emissive", options.exposure)
            lights = exposed(lights, "color", options.exposure)
            ambient_lights = exposed(ambient_lights, "color", options.exposure)
        self.materials, self.lights, self.ambient = tuple(materials), tuple(lights), np.zeros(3)
        self.n_terms = [*map(count_terms, materials)]
        for light in ambient_lights:
            self.ambient = self.ambient + np.array(light.color)
        self._read_surfaces()
        self.lit_by = np.flatnonzero(self.is_lit.any(axis=0)).tolist()
        self.reflected_lights = tuple(self.lights[i] for i in self.lit_by)
        self.has_shadows = any(map(light_table.shadow_of, self.reflected_lights))

    def _read_surfaces(self) -> None:
        """Find out what materials need, how large meshes are, and what colours textures and meshes bring."""
        n_material, products, largest = len(self.materials), self.products, 1.0
        self.is_opaque, self.has_cut_outs, self.max_texel, self.n_texcoord = True, False, 1.0, 2
        self.has_texture, self.has_vertex_colors, self.has_hues, is_reflecting = np.zeros((4, n_material), np.bool_)
        for k, material in enumerate(self.materials):
            self.is_opaque &= material.is_opaque
            self.has_cut_outs |= material.is_cut_out
            is_reflecting[k] = any(material.diffuse) or any(material.specular)
            self.has_texture[k] = material.texture is not None
        if self.has_texture.any():
            self.max_texel = max(material.texture.brightest for material in compress(self.materials, self.has_texture))
            self.n_texcoord = count_texcoords(self.meshes)
        self.is_lit = np.repeat(is_reflecting[:, None], len(self.lights), axis=1)
        if products is not None:
            self.is_lit = products.diffuse.any(axis=2) | products.specular.any(axis=2) | products.grazing.any(axis=2)
        self.bounds = np.stack([mesh.bounds for mesh in self.meshes])
        self.material_boxes = np.tile([[np.inf], [-np.inf]], (n_material, 1, 3))
        numbers, boxes = np.concatenate(self.palettes), np.repeat(self.bounds, [*map(len, self.palettes)], axis=0)
        np.minimum.at(self.material_boxes[:, 0], numbers, boxes[:, 0])
        np.maximum.at(self.material_boxes[:, 1], numbers, boxes[:, 1])
        for mesh, numbers in zip(self.meshes, self.palettes, strict=True):
            given = mesh.face_colors if mesh.colors is None else mesh.colors
            if given is not None:
                colors = given[..., :3].reshape(-1, 3)
                largest = max(largest, float(colors.max(initial=0.0)))
                self.has_vertex_colors[numbers] = True
                self.has_hues[numbers] |= bool((colors[:, 1:] != colors[:, :1]).any())
        self.max_albedo = largest * self.max_texel

    def tint_of(self, k: int) -> NDArray[np.float64] | None:
        """The RGB triple, its largest component 1, of which all intensities of material k are multiples; None if there
        is none.

        Intensities are products of the material's and a light's colour, so it is enough that all lights are grey and
        the material's colours multiples of one triple, or the other way round.
        """
        material, n_term = self.materials[k], self.n_terms[k]
        is_spectral = self.products is not None and self.products.is_spectral
        if is_spectral or self.has_texture[k] or self.has_hues[k]:
            return None
        if n_term == 4 or (n_term == 3 and isinstance(material.fresnel, tuple)):  # the highlight has another colour
            return None
        of_lights, of_material = [tuple(self.ambient)], [material.ambient, material.diffuse]
        of_material += [material.specular] * (n_term > 1)
        for light in compress(self.lights, self.is_lit[k]):
            of_lights.append(light.color)
        of_light, own = common_direction(of_lights), common_direction(of_material)
        if of_light is not None and np.ptp(of_light) == 0.0:
            tint = common_direction([*of_material, material.emissive])
        elif own is not None and np.ptp(own) == 0.0:
            tint = common_direction([*of_lights, material.emissive])
        else:
            return None
        return tint if self.depth_cue is None or tint is None else common_direction([tint, self.depth_cue.color])

    @cached_property
    def face_boxes(self) -> list[NDArray[np.float64]]:
        """Of each material (n, 2, 3) boxes, round some of its faces each, world space."""
        found: list[list] = [[] for _ in self.materials]
        for mesh, numbers in zip(self.meshes, self.palettes, strict=True):
            for k, number in enumerate(numbers.tolist()):
                faces = mesh.faces if mesh.face_material is None else mesh.faces[mesh.face_material == k]
                if len(faces):
                    corners = mesh.vertices[faces.ravel()]
                    starts = np.arange(0, len(corners), 3 * -(-len(faces) // N_BOX))
                    low, high = np.minimum.reduceat(corners, starts), np.maximum.reduceat(corners, starts)
                    found[number].append(np.stack([low, high], axis=1))
        return [np.concatenate(boxes) if boxes else np.empty((0, 2, 3)) for boxes in found]


def exposed(sources: Sequence[Any], field: str, stops: float) -> list[Any]:
    """Return lights or materials with one of their colours multiplied by 2^stops."""
    scale = 2.0**stops
    return [
        replace(source, **{field: tuple(scale * component for component in getattr(source, field))})
        for source in sources
    ]


def common_direction(colors: Sequence[Sequence[float] | NDArray]) -> NDArray[np.float64] | None:
    """Return the triple (3,), its largest component 1, of which all colours are multiples (to float64 rounding); None
    if there is none."""
    colors = np.array(colors).reshape(-1, 3)
    colors = colors[colors.max(axis=1) > 0.0]
    if len(colors) == 0:
        return np.ones(3)
    scaled = colors / colors.max(axis=1, keepdims=True)
    # Quotients of equal colours differ by a rounding error each.
    return scaled[0] if np.ptp(scaled, axis=0).max() <= 4 * np.finfo(float).eps else None


# ---------------------------------------------------------------- spectral colour
#
# Light and colours are multiplied wavelength by wavelength, and seen by the standard observer at the end. The
# illumination equation is a sum of products of colours, each times a factor that geometry alone decides (cosines,
# powers, attenuation, shadows). The observer's response is linear. So it may be applied to the products before anything
# is drawn:
#
#     RGB(Σ_i g_i · kd·Ip_i) = Σ_i g_i · RGB(kd·Ip_i)
#
# which gives what an evaluation of every sample of the spectrum at every pixel would give, for the price of three
# channels. A specular reflection function with a spectrum F0 is no such product, but a sum of two, W = F0·(1 - s) + s:
# pipeline/reflection.py. Of metals there is a third.


class Products(NamedTuple):
    """Products of the colours of materials and lights, as linear RGB; of spectra components may be negative."""

    is_spectral: bool
    emissive: NDArray[np.float64]  # (n_material, 3)
    ambient: NDArray[np.float64]  # (n_material, 3): ka·Ia
    diffuse: NDArray[np.float64]  # (n_material, n_light, 3): kd·Ip; of an ambient share ka·Ip
    specular: NDArray[np.float64]  # (n_material, n_light, 3): ks·Ip·F0; F0 is 1 where W(θ) is
    grazing: NDArray[np.float64]  # (n_material, n_light, 3): ks·Ip; 0 where W(θ) is 1
    metal: NDArray[np.float64]  # (n_material, n_light, 3): ks·Ip·m·M; 0 where nothing is metal


def multiply_colors(
    materials: Sequence[Any], lights: Sequence[Any], is_share: NDArray, ambient_lights: Sequence[Any], options: Options
) -> Products | None:
    """Multiply what materials reflect by what lights give.

    None where channels do it later: no colour is a spectrum, no samples are asked for, and no light is an ambient
    share, which is weighted with another coefficient than the other lights: `is_share` (n_light,) tells which are.
    """
    fields, is_spectral = ("emissive", "ambient", "diffuse", "specular"), options.spectral is not None
    for light in (*lights, *ambient_lights):
        is_spectral |= hasattr(light.color, "wavelengths")
    for material in materials:
        for field in (*fields, "fresnel", "metal_color"):
            is_spectral |= hasattr(getattr(material, field), "wavelengths")
    if not is_spectral and not is_share.any():
        return None
    n, weights = None, np.eye(3)
    if is_spectral:
        from ..scene.spectrum import N_TABLE, rgb_weights

        n = options.spectral or N_TABLE  # samples: every 5 nm, as the tables have them
        weights = rgb_weights(n)
    weights = weights * 2.0**options.exposure
    emissive, ambient, diffuse, specular = (
        np.array([_channels_of(getattr(material, field), n) for material in materials]) for field in fields
    )
    around = sum((_channels_of(light.color, n) for light in ambient_lights), np.zeros(n or 3))
    of_lights = np.array([_channels_of(light.color, n) for light in lights]).reshape(-1, n or 3)
    shares, first, rest, metal = split_fresnel(materials, n)
    diffuse = diffuse * shares
    directed = np.where(is_share[:, None], 0.0, of_lights)
    return Products(
        is_spectral,
        emissive @ weights,
        (ambient * around) @ weights,
        np.where(is_share[:, None], ambient[:, None] * of_lights, diffuse[:, None] * of_lights) @ weights,
        ((specular * first)[:, None] * directed) @ weights,
        ((specular * rest)[:, None] * directed) @ weights,
        ((specular * metal)[:, None] * directed) @ weights,
    )


def split_fresnel(materials: Sequence[Any], n: int | None = None) -> tuple[NDArray[np.float64], ...]:
    """Return what DIFFUSE is weighted with, beside kd·Ip, and SPECULAR, GRAZING and METAL, beside ks·Ip.

    The share that is no metal; then F0, 1 and 0; F0·(1 - m), 1 and m·M of metals; F0, 1 and M where a texture says how
    much is metal, by which the terms are weighted sample by sample; 1, 0 and 0 where W(θ) is 1.

    Parameters
    ----------
    n : samples of the spectrum; None = linear RGB

    Returns
    -------
    (n_material, 1) float64, and three (n_material, n or 3)
    """
    shape = len(materials), n or 3
    shares, first, rest, metal = np.ones((len(materials), 1)), np.ones(shape), np.zeros(shape), np.zeros(shape)
    for k, material in enumerate(materials):
        of_metal = material.metallic if material.metallic_roughness is None else 1.0
        shares[k] = 1.0 - material.metallic if material.metallic_roughness is None else 1.0
        if count_terms(material) > 2:
            f0 = fresnel_of(material)
            first[k], rest[k] = _channels_of(f0, n) if isinstance(f0, tuple) else f0, 1.0
            if is_metallic(material):
                metal[k] = _channels_of(material.metal_color, n) * of_metal
                first[k] *= shares[k]
    return shares, first, rest, metal


def _channels_of(color, n: int | None) -> NDArray[np.float64]:
    """Return a colour as n samples of its spectrum; as linear RGB where n is None."""
    if n is None:
        return np.array(color, np.float64)
    from ..scene.spectrum import samples_of

    return samples_of(color, n)
