"""A scene as tables: read once, and handed on in its place.

    Scene ─ tables (here) ─ plan (plan.py) ─ geometry (geometry/points.py) ─ passes (passes.py)

Its different materials and its lights are listed and numbered, area lights are taken apart, the exposure is multiplied
in, and where colours are spectra the products of materials and lights. Below that stands what surfaces are beside
their illumination, as arrays that the pipeline reads, and the tint that one channel is enough for.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..geometry.points import count_texcoords, number_materials
from ..locks import cached_property
from ..options import Options
from ..pipeline.a_buffer import Opacity
from ..pipeline.shade import Cue
from ..scene.mesh import Mesh
from ..scene.scene import DepthCue, Scene
from . import lights as light_table
from .reflections import count_terms, fresnel_of, has_highlight, has_hued_fresnel, is_metallic

N_BOX = 2**12  # boxes round faces of a mesh, at most: their distances from lights are found in a moment


class SceneTables:
    """What a scene is made of, under the options of a picture; each table is made when it is asked for first.

    Parameters
    ----------
    scene : Scene, of which nothing else is read later
    options : of which exposure and spectral count. Light and what materials emit are multiplied by the exposure: the
        illumination equation is linear in them
    """

    def __init__(self, scene: Scene, options: Options) -> None:
        self.meshes: tuple[Mesh, ...] = scene.meshes
        self.background: tuple[float, float, float] | None = scene.background  # linear
        self.depth_cue: DepthCue | None = scene.depth_cue
        self._options = options
        materials, self.palettes = number_materials(self.meshes)  # for each mesh the numbers of its materials
        is_lit_per_sample = options.shading == "phong"
        self._materials = tuple(each.as_lit(is_lit_per_sample) for each in materials)
        expanded = [part for light in scene.lights for part in light_table.entry_of(light).expand(light)]
        self._lights = tuple(light for light in expanded if not light_table.is_black(light))
        self._ambient_lights = tuple(light for light in scene.lights if light_table.entry_of(light).is_ambient)
        self.n_black = len(expanded) - len(self._lights)  # which are no part of `lights`

    @cached_property
    def materials(self) -> tuple:
        """The different ones of all meshes."""
        return self._exposed(self._materials, "emissive")

    @cached_property
    def lights(self) -> tuple:
        """All but ambient and black ones; those of an area light one by one."""
        return self._exposed(self._lights, "color")

    @cached_property
    def ambient(self) -> NDArray[np.float64]:
        """(3,), the sum of the ambient lights."""
        return sum((np.array(light.color) for light in self._exposed(self._ambient_lights, "color")), np.zeros(3))

    @cached_property
    def products(self) -> "Products | None":
        """Those of colours, in which the exposure is included; None where it is done later: see `multiply_colors`."""
        return multiply_colors(self._materials, self._lights, self._ambient_lights, self._options)

    def _exposed(self, sources: tuple, field: str) -> tuple:
        """Lights or materials with one of their colours multiplied by the exposure."""
        if self.products is not None or self._options.exposure == 0.0:
            return sources
        scale = 2.0**self._options.exposure
        colors = [tuple(scale * component for component in getattr(source, field)) for source in sources]
        return tuple(replace(source, **{field: color}) for source, color in zip(sources, colors, strict=True))

    @cached_property
    def is_lit(self) -> NDArray[np.bool_]:
        """(n_material, n_light): the material reflects something of the light."""
        products = self.products
        if products is None:
            is_reflecting = np.array([[any(material.diffuse) or any(material.specular)] for material in self.materials])
        else:
            is_reflecting = products.diffuse.any(axis=2) | products.specular.any(axis=2) | products.grazing.any(axis=2)
        return np.ones((len(self.materials), len(self.lights)), np.bool_) & is_reflecting

    def lights_of(self, k: int) -> tuple:
        """The lights that material k reflects something of."""
        return tuple(light for light, is_lit in zip(self.lights, self.is_lit[k].tolist(), strict=True) if is_lit)

    def tint_of(self, k: int) -> NDArray[np.float64] | None:
        """The RGB triple that all intensities of material k are multiples of, where points have no colours of their
        own; None where there is none."""
        if (self.products is not None and self.products.is_spectral) or self.materials[k].texture is not None:
            return None
        tint = common_color([self.materials[k]], self.lights_of(k), self.ambient)
        return tint if self.depth_cue is None or tint is None else common_tint(tint, self.depth_cue.color)

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """(n_mesh, 2, 3) boxes round the meshes, world space."""
        return np.stack([mesh.bounds for mesh in self.meshes])

    @cached_property
    def face_offsets(self) -> NDArray[np.int64]:
        """(n_mesh + 1,): face f of mesh m has the index face_offsets[m] + f in the scene."""
        return np.cumsum([0] + [mesh.n_face for mesh in self.meshes], dtype=np.int64)

    @cached_property
    def material_boxes(self) -> NDArray[np.float64]:
        """(n_material, 2, 3) boxes round the meshes that have them, world space."""
        low, high = np.full((2, len(self.materials), 3), [[[np.inf]], [[-np.inf]]])
        for (low_here, high_here), numbers in zip(self.bounds, self.palettes, strict=True):
            low[numbers], high[numbers] = np.minimum(low[numbers], low_here), np.maximum(high[numbers], high_here)
        return np.stack([low, high], axis=1)

    @cached_property
    def face_boxes(self) -> list[NDArray[np.float64]]:
        """Of each material (n, 2, 3) boxes, round some of its faces each, world space."""
        found: list[list] = [[] for _ in self.materials]
        for mesh, numbers in zip(self.meshes, self.palettes, strict=True):
            for k, number in enumerate(numbers.tolist()):
                faces = mesh.faces if mesh.face_material is None else mesh.faces[mesh.face_material == k]
                if len(faces):
                    corners, starts = mesh.vertices[faces], np.arange(0, len(faces), -(-len(faces) // N_BOX))
                    low = np.minimum.reduceat(corners.min(axis=1), starts)
                    found[number].append(np.stack([low, np.maximum.reduceat(corners.max(axis=1), starts)], axis=1))
        return [np.concatenate(boxes) if boxes else np.empty((0, 2, 3)) for boxes in found]

    @cached_property
    def colors_of_meshes(self) -> list[NDArray[np.float64] | None]:
        """The linear colours (n, 3) that each mesh has at its vertices or faces; None where it has none."""
        given = [mesh.face_colors if mesh.colors is None else mesh.colors for mesh in self.meshes]
        return [None if colors is None else colors[..., :3].reshape(-1, 3) for colors in given]

    @cached_property
    def max_albedo(self) -> float:
        """The largest component of the colours that multiply what materials reflect, textures' included."""
        given = [float(colors.max(initial=1.0)) for colors in self.colors_of_meshes if colors is not None]
        return max(given, default=1.0) * brightest_texel(self.materials)

    @cached_property
    def has_vertex_colors(self) -> NDArray[np.bool_]:
        """(n_material,): which materials are those of meshes with colours."""
        return self._materials_of([colors is not None for colors in self.colors_of_meshes])

    @cached_property
    def has_hues(self) -> NDArray[np.bool_]:
        """(n_material,): which materials are those of meshes with colours that aren't grey."""
        given = self.colors_of_meshes
        return self._materials_of([c is not None and bool((c[:, 1:] != c[:, :1]).any()) for c in given])

    def _materials_of(self, is_asked: Sequence[bool]) -> NDArray[np.bool_]:
        """(n_material,): which materials some of the meshes have."""
        found = np.zeros(len(self.materials), np.bool_)
        for numbers, is_one in zip(self.palettes, is_asked, strict=True):
            found[numbers] |= is_one
        return found

    @property
    def is_textured(self) -> bool:
        """Some material has a texture."""
        return any(material.texture is not None for material in self.materials)

    @property
    def n_texcoord(self) -> int:
        """Texture coordinates of a point."""
        return count_texcoords(self.meshes)

    @property
    def is_opaque(self) -> bool:
        """Nothing shows through anything."""
        return all(material.is_opaque for material in self.materials)

    @property
    def has_shadows(self) -> bool:
        """Some light casts shadows, and is reflected."""
        casts = [light_table.shadow_of(light) is not None for light in self.lights]
        return bool((self.is_lit.any(axis=0) & np.array(casts, np.bool_)).any())


# ---------------------------------------------------------------- surfaces, as arrays that the pipeline reads


def list_opacities(materials, least) -> Opacity:
    """How transparent the materials are; see pipeline/a_buffer.py for `least`."""
    return Opacity(
        np.array([material.opacity for material in materials]),
        np.array([material.is_opaque for material in materials], np.bool_),
        np.array([material.texture is not None for material in materials], np.bool_),
        least,
    )


def has_alpha(materials) -> NDArray[np.bool_]:
    """(n_material,): which have a texture that lets light through."""
    return np.array([material.texture is not None and material.texture.has_alpha for material in materials], np.bool_)


def brightest_texel(materials) -> float:
    """The largest component of any texture; 1 where there is none."""
    return max((material.texture.brightest for material in materials if material.texture is not None), default=1.0)


def make_cue(cue, n_channel) -> Cue:
    """Depth cueing as the pipeline takes it; with one channel its colour is a multiple of the tint, whose largest
    component is 1."""
    return Cue(cue.scale, cue.start, np.array(cue.color if n_channel == 3 else [max(cue.color)], np.float64))


# ---------------------------------------------------------------- the tint that one channel is enough for


def choose_tint(tints) -> np.ndarray | None:
    """Choose the tint that most materials have, so that one channel is enough for these; None where none has one."""
    groups: dict[tuple, int] = {}
    for tint in tints:
        if tint is not None:
            groups[tuple(tint)] = groups.get(tuple(tint), 0) + 1
    return np.array(max(groups, key=lambda tint: groups[tint])) if groups else None


def common_color(
    materials: Sequence[Any], lights: Sequence[Any], ambient: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the RGB triple, its largest component 1, of which every intensity of the picture is a multiple; None if
    there is none.

    Intensities are products of a material's and a light's colour, so it is enough that all lights are grey and all the
    materials' colours multiples of one triple, or the other way round.

    Parameters
    ----------
    ambient : (3,) float64, the sum of the ambient lights
    """
    if any(has_hued_fresnel(material) for material in materials):
        return None
    of_lights = [np.array(light.color) for light in lights] + [ambient]
    of_materials = [np.array(getattr(m, name)) for m in materials for name in ("ambient", "diffuse")]
    of_materials += [np.array(m.specular) for m in materials if has_highlight(m)]
    emission = [np.array(m.emissive) for m in materials]
    if _direction(of_lights) is not None and np.ptp(_direction(of_lights)) == 0.0:
        return _direction(of_materials + emission)
    if _direction(of_materials) is not None and np.ptp(_direction(of_materials)) == 0.0:
        return _direction(of_lights + emission)
    return None


def common_tint(tint: NDArray[np.float64], color: Sequence[float]) -> NDArray[np.float64] | None:
    """Return the tint (3,) if a colour is a multiple of it, else None."""
    return _direction([tint, np.array(color)])


def _direction(colors):
    """The triple, its largest component 1, of which all colours are multiples (to float64 rounding); None if there is
    none."""
    colors = np.array([color for color in colors if color.max() > 0.0]).reshape(-1, 3)
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
    materials: Sequence[Any], lights: Sequence[Any], ambient_lights: Sequence[Any], options: Options
) -> Products | None:
    """Multiply what materials reflect by what lights give.

    None where channels do it later: no colour is a spectrum, no samples are asked for, and no light is an ambient
    share, which is weighted with another coefficient than the other lights.
    """
    fields = ("emissive", "ambient", "diffuse", "specular")
    colors = [getattr(material, field) for material in materials for field in (*fields, "fresnel", "metal_color")]
    colors += [light.color for light in (*lights, *ambient_lights)]
    is_spectral = options.spectral is not None or any(hasattr(color, "wavelengths") for color in colors)
    is_share = np.array([light_table.entry_of(light).is_share for light in lights], np.bool_)
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
    first, rest, metal = split_fresnel(materials, n)
    diffuse = diffuse * diffuse_shares(materials)[:, None]
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


def diffuse_shares(materials: Sequence[Any]) -> NDArray[np.float64]:
    """Return the share of each material that is no metal, and reflects diffusely, (n_material,); 1 where a texture says
    at every sample how much that is."""
    return np.array([1.0 if each.metallic_roughness is not None else 1.0 - each.metallic for each in materials])


def split_fresnel(materials: Sequence[Any], n: int | None = None) -> tuple[NDArray[np.float64], ...]:
    """Return what SPECULAR, GRAZING and METAL are weighted with, beside ks·Ip.

    F0, 1 and 0; F0·(1 - m), 1 and m·M of metals; F0, 1 and M where a texture says how much is metal, by which the terms
    are weighted sample by sample; 1, 0 and 0 where W(θ) is 1.

    Parameters
    ----------
    n : samples of the spectrum; None = linear RGB

    Returns
    -------
    three (n_material, n or 3) float64
    """
    first, metal = np.ones((len(materials), n or 3)), np.zeros((len(materials), n or 3))
    rest = np.zeros_like(first)
    for k, material in enumerate(materials):
        if count_terms(material) < 3:
            continue
        f0 = fresnel_of(material)
        first[k] = _channels_of(f0, n) if isinstance(f0, tuple) else f0
        if is_metallic(material):
            is_even = material.metallic_roughness is None
            metal[k] = _channels_of(material.metal_color, n) * (material.metallic if is_even else 1.0)
            first[k] *= 1.0 - material.metallic if is_even else 1.0
        rest[k] = 1.0
    return first, rest, metal


def _channels_of(color, n: int | None) -> NDArray[np.float64]:
    """Return a colour as n samples of its spectrum; as linear RGB where n is None."""
    if n is None:
        return np.array(color, np.float64)
    from ..scene.spectrum import samples_of

    return samples_of(color, n)
