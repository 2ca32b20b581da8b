"""The plan of a picture: what this scene needs, and nothing else.

Found here, from the scene alone: how bright it may be, the colour that one channel is enough for, its textures and
transparent surfaces, which functions are compiled. What each material needs, its channels, its type and its way to the
samples, is found in plan.py. What a view says is added later (view_plans.py).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..geometry.points import number_materials
from ..options import Options
from ..pipeline import gradients as g
from ..pipeline import textures as texturing
from ..pipeline.a_buffer import Opacity, min_transmittance
from ..pipeline.shade import Cue
from ..pipeline.textures import PackedTextures, Textures, pack_textures
from ..pipeline.visibility import LEVEL_MASK
from . import lights as light_table
from . import reflections as reflection_table
from .bounds import WRITTEN, Brightness, Distances, compute_brightness, rounding_errors
from .reflections import has_colored_fresnel, has_highlight
from .rounding import SINGLE

# ----------------------------------------------------------------
# What surfaces are beside their illumination, as arrays that the pipeline reads: textures, opacities, depth cueing.


def list_opacities(materials, least) -> Opacity:
    """How transparent the materials are; see pipeline/a_buffer.py for `least`."""
    return Opacity(
        np.array([material.opacity for material in materials]),
        np.array([material.is_opaque for material in materials], np.bool_),
        np.array([material.texture is not None for material in materials], np.bool_),
        least,
    )


def list_textures(materials) -> Textures:
    """Lay the textures of materials, at least one, behind each other; those that are shared, once."""
    different = {id(material.texture): material.texture for material in materials if material.texture is not None}
    number = {key: k for k, key in enumerate(different)}
    levels = [level for texture in different.values() for level in texture.pyramid]
    first = np.cumsum([0] + [level.shape[0] * level.shape[1] for level in levels])
    filters = {
        "nearest": texturing.FILTER_NEAREST,
        "bilinear": texturing.FILTER_BILINEAR,
        "trilinear": texturing.FILTER_TRILINEAR,
    }
    wraps = {"repeat": texturing.WRAP_REPEAT, "clamp": texturing.WRAP_CLAMP, "mirror": texturing.WRAP_MIRROR}
    return Textures(
        np.concatenate([level.ravel() for level in levels]),
        np.array(
            [(start, level.shape[1], level.shape[0]) for start, level in zip(first, levels, strict=False)], np.int64
        ),
        np.cumsum([0] + [len(texture.pyramid) for texture in different.values()]).astype(np.int64),
        np.array([filters[texture.filter] for texture in different.values()], np.int64),
        np.array([[wraps[word] for word in texture.wrap] for texture in different.values()], np.int64),
        np.array([number.get(id(material.texture), -1) for material in materials], np.int64),
    )


def brightest_texel(materials) -> float:
    """The largest component of any texture, at least 1."""
    images = [material.texture.image for material in materials if material.texture is not None]
    return max((float(image[..., :3].max()) for image in images), default=1.0)


def make_cue(cue, n_channel) -> Cue:
    """Depth cueing as the pipeline takes it; with one channel its colour is a multiple of the tint, whose largest
    component is 1."""
    return Cue(cue.scale, cue.start, np.array(cue.color if n_channel == 3 else [max(cue.color)], np.float64))


# ----------------------------------------------------------------
# The colour that all intensities of a picture share, if they do: then one channel is enough.


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
    if any(has_colored_fresnel(material) for material in materials):
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


# ----------------------------------------------------------------
# Spectral colour: light and colours are multiplied wavelength by wavelength, and seen by the standard observer at
# the.
# end.
#
# The illumination equation is a sum of products of colours, each times a factor that geometry alone decides (cosines,
# powers, attenuation, shadows). The observer's response is linear. So it may be applied to the products before
# anything
# is drawn:
#
#     RGB(Σ_i g_i · kd·Ip_i) = Σ_i g_i · RGB(kd·Ip_i)
#
# which gives what an evaluation of every sample of the spectrum at every pixel would give, for the price of three
# channels. A specular reflection function with a spectrum F0 is no such product, but affine in F0: W = F0·(1 - s) +
# s, s
# = (1 - cos θ)^5. So two products serve, ks·Ip·F0 and ks·Ip·(1 - F0): the highlight is that of W = 1 with the first,
# and
# times s with the second.


class Products(NamedTuple):
    """Products of the colours of materials and lights, as linear RGB; of spectra components may be negative."""

    is_spectral: bool
    emissive: NDArray[np.float64]  # (n_material, 3)
    ambient: NDArray[np.float64]  # (n_material, 3): ka·Ia
    diffuse: NDArray[np.float64]  # (n_material, n_light, 3): kd·Ip; of an ambient share ka·Ip
    specular: NDArray[np.float64]  # (n_material, n_light, 3): ks·Ip; with a coloured F0 ks·Ip·F0
    grazing: NDArray[np.float64]  # (n_material, n_light, 3): ks·Ip·(1 - F0); 0 where F0 has no colour


def multiply_colors(
    materials: Sequence[Any], lights: Sequence[Any], ambient_lights: Sequence[Any], options: Options
) -> Products | None:
    """Multiply what materials reflect by what lights give.

    None where channels do it later: no colour is a spectrum, no samples are asked for, and no light is an ambient
    share, which is weighted with another coefficient than the other lights.
    """
    fields = ("emissive", "ambient", "diffuse", "specular")
    colors = [getattr(material, field) for material in materials for field in (*fields, "fresnel")]
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
    given = np.array([_channels_of(light.color, n) for light in lights]).reshape(-1, n or 3)
    first, rest = split_fresnel(materials, n)
    directed = np.where(is_share[:, None], 0.0, given)
    return Products(
        is_spectral,
        emissive @ weights,
        (ambient * around) @ weights,
        np.where(is_share[:, None], ambient[:, None] * given, diffuse[:, None] * given) @ weights,
        ((specular * first)[:, None] * directed) @ weights,
        ((specular * rest)[:, None] * directed) @ weights,
    )


def split_fresnel(materials: Sequence[Any], n: int | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return F0 and 1 - F0 of materials whose F0 is a colour, 1 and 0 of the others.

    Parameters
    ----------
    n : samples of the spectrum; None = linear RGB

    Returns
    -------
    two (n_material, n or 3) float64
    """
    first = np.ones((len(materials), n or 3))
    for row, material in zip(first, materials, strict=True):
        if has_colored_fresnel(material):
            row[:] = _channels_of(material.fresnel, n)
    return first, 1.0 - first


def _channels_of(color, n: int | None) -> NDArray[np.float64]:
    """Return a colour as n samples of its spectrum; as linear RGB where n is None."""
    if n is None:
        return np.array(color, np.float64)
    from ..scene.spectrum import samples_of

    return samples_of(color, n)


# ----------------------------------------------------------------
# What each material of a scene needs: one channel or three, float32 or float64, the cheapest way to its samples.
# What one object needs costs its own samples and no others. The bounds that justify a cheaper way stand beside the
# choice.

SMALL, LARGE = 2.0**-40, 2.0**60  # scene units: squares of lengths between them keep their digits in float32
TOO_MUCH = "rounding beyond half of the tolerance"
MOST_TURN = 2.0**-12  # radians: how far planes may turn a normal where that decides whether a point lies in a shadow


class MaterialPlans(NamedTuple):
    """A row for each material."""

    ways: NDArray[np.uint8]  # (n,): the cheapest that attributes may take to the samples, see pipeline/gradients.py
    needs: NDArray[np.uint8]  # (n,): bits, as there
    n_attributes: NDArray[np.int64]  # (n,): how many of the attributes are read
    normal_limits: NDArray[np.float64]  # (n,): how far float32 planes may turn a normal, as there
    roundings: NDArray[np.float64]  # (n,): what rounding may add to an intensity, linear; see view_plans.py
    has_albedo: NDArray[np.bool_]  # (n,): colours are given with the model, or a texture
    reasons: tuple[tuple[str, ...], ...]  # why float32 won't do; none where it does

    @property
    def is_double(self) -> NDArray[np.bool_]:
        """Which need float64."""
        return (self.needs & g.DOUBLE_PRECISION) != 0

    def dtype_of(self, material: int) -> np.dtype:
        """The type that a material is lit in."""
        return np.dtype(np.float64 if self.needs[material] & g.DOUBLE_PRECISION else np.float32)

    @property
    def is_looked_up(self) -> NDArray[np.bool_]:
        """Which have textures whose coordinates may stand in planes."""
        return ((self.needs & g.HAS_TEXTURE) != 0) & ~self.is_double

    @property
    def reads_double(self) -> NDArray[np.bool_]:
        """Which have attributes in float64: also texture coordinates, of which large pictures need many digits."""
        return self.is_double | self.is_looked_up

    @property
    def is_colored(self) -> NDArray[np.bool_]:
        """Which need three channels."""
        return (self.needs & g.HAS_COLORS) != 0

    def is_like(self, other: "MaterialPlans") -> bool:
        """Tell whether others need the same, whatever rounding adds."""
        return self.needs is other.needs or bool((self.needs == other.needs).all() and (self.ways == other.ways).all())

    def doubled(self, which: NDArray[np.bool_], reason: str) -> "MaterialPlans":
        """Return the same with float64 for some materials."""
        singles = np.uint8(255 - g.SINGLE_PRECISION)
        needs = np.where(which, self.needs & singles | np.uint8(g.DOUBLE_PRECISION), self.needs)
        reasons = [(*old, reason) if new else old for new, old in zip(which, self.reasons, strict=True)]
        return self._replace(
            needs=needs.astype(np.uint8), ways=np.where(which, np.uint8(g.EXACT), self.ways), reasons=tuple(reasons)
        )


class Facts(NamedTuple):
    """What is known of a material's surfaces, a row a material."""

    has_albedo: NDArray[np.bool_]  # colours are given with the model, or a texture
    has_vertex_colors: NDArray[np.bool_]  # colours are given with the model
    has_colors: NDArray[np.bool_]  # not only grey ones
    tints: Sequence[NDArray[np.float64] | None]  # (3,): what all intensities are multiples of, None where there is none


def plan_materials(
    sources: Any,
    brightest: Brightness,
    roundings: NDArray[np.float64],
    options: Any,
    facts: Facts,
    tint: NDArray | None,
) -> MaterialPlans:
    """Find out what each material needs.

    Parameters
    ----------
    sources : Sources of the scene (engine/plan.py)
    brightest : as bright as lights are at their clearances
    roundings : (n_material,) the least that float32 adds to an intensity in any view
    options : Options
    tint : (3,) the colour of what has one channel; None where all has three
    """
    materials, bounds = sources.materials, brightest.of_materials
    angles = options.tolerance / 4 / np.maximum(brightest.turn_slopes, 1e-30)
    if sources.has_shadows:  # which depend on normals, however dim the lights are
        angles = np.minimum(angles, MOST_TURN)
    normal_limits = angles / (np.sqrt(3.0) * SINGLE)
    ways, needs, n_attributes, reasons = [], [], [], []
    for k, material in enumerate(materials):
        why = reasons_of(material, sources.lights_of(k), options.tolerance, roundings[k], bounds[k])
        is_colored = tint is None or facts.tints[k] is None or common_tint(facts.tints[k], tint) is None
        ways.append(choose_way(why, options, is_colored or not material.is_opaque, normal_limits[k], bounds.max()))
        needs.append(list_needs(material, bool(why), is_colored, facts.has_vertex_colors[k]))
        n_attributes.append(count_attributes(material, options, sources, facts, k, is_colored))
        reasons.append(why)
    return MaterialPlans(
        np.array(ways, np.uint8), np.array(needs, np.uint8), np.array(n_attributes, np.int64), normal_limits,
        roundings, facts.has_albedo, tuple(reasons),
    )  # fmt: skip


def reasons_of(
    material: Any, lights: Sequence[Any], tolerance: float, rounding: float, bound: float
) -> tuple[str, ...]:
    """Say why float32 won't do for a material in any view, in a few words each; nothing where it does.

    Parameters
    ----------
    lights : those that it reflects
    rounding : the least that float32 adds to an intensity of it
    bound : the largest intensity that it may have; infinite where a light amplifies without limit
    """
    lengths = [length for light in lights for length in light_table.entry_of(light).lengths(light)]
    reasons = {
        "tolerance 0": tolerance == 0,
        TOO_MUCH: not rounding <= tolerance / 2,
        "lights without bound": not np.isfinite(bound),
        "numbers of lights beyond float32": not are_single(lengths),
        reflection_table.entry_of(material).reason_for_float64(material): True,
    }
    return tuple(reason for reason, holds in reasons.items() if reason and holds)


def are_single(lengths: Sequence[float]) -> bool:
    """Tell whether lengths, and their products with squares of lengths, keep their digits in float32."""
    return all(SMALL <= length <= LARGE for length in lengths)


def choose_way(reasons, options, needs_planes: bool, normal_limit: float, bound: float) -> int:
    """Choose the cheapest way that the attributes of a material may take to the samples."""
    if reasons:
        return g.EXACT
    if options.shading == "phong":
        return g.IN_PLANES if normal_limit > 3.0 else g.EXACT
    if not np.isfinite(bound):
        return g.EXACT
    return g.IN_PLANES if needs_planes else g.IN_ENTRIES


def list_needs(material: Any, is_double: bool, is_colored: bool, has_vertex_colors: bool) -> int:
    """Return what a material needs, as bits."""
    needs = g.DOUBLE_PRECISION if is_double else g.SINGLE_PRECISION
    needs |= g.HAS_COLORS if is_colored else 0
    needs |= g.HAS_ALBEDO if has_vertex_colors else 0
    if material.texture is not None:
        is_nearest = material.texture.filter == "nearest" and not is_double
        needs |= g.HAS_TEXTURE | (g.HAS_CORNERS if is_nearest else 0)
    needs |= 0 if material.is_opaque else g.IS_TRANSPARENT if material.opacity > 0.0 else g.IS_INVISIBLE
    return needs


def count_attributes(material: Any, options: Any, sources: Any, facts: Facts, k: int, is_colored: bool) -> int:
    """Return how many attributes of the surfaces of material k are read: see engine/attributes.py."""
    if options.shading != "phong":
        return 8 if material.texture is not None else 3 if is_colored else 1
    if material.is_anisotropic and material.tangent == "u":
        return 6 + 3 * bool(facts.has_albedo.any()) + 2 * sources.is_textured
    return 8 if material.texture is not None else 6 if facts.has_albedo[k] else 3


LARGEST = float(np.finfo(np.float32).max)  # that a picture can hold


class Plan(NamedTuple):
    """What this scene needs, whatever the camera."""

    n_channel: int  # the most that any material needs
    tint: np.ndarray  # (3,) float32: the colour of what has one channel
    of_materials: MaterialPlans
    level_scale: float  # levels a unit of intensity
    bound: float  # the largest intensity that any point can have
    brightness: Brightness  # how bright each light makes each material, where nothing weakens it
    clearances: np.ndarray  # (n_material, n_light) scene units: no lit point may come nearer to a light
    is_lit: np.ndarray  # (n_material, n_light) bool: the material may reflect something of the light
    n_left_out: int  # lights that no material reflects anything of: black ones, which aren't listed, and others
    brightest_background: float  # largest component of what lies behind the picture, or of what it fades to with depth
    is_flat: bool
    is_lit_per_sample: bool
    ambient: np.ndarray  # (3,) float64, the sum of the ambient lights
    lights: tuple  # the others; those of an area light one by one
    materials: tuple  # the different ones of all meshes
    has_albedo: bool
    has_shadows: bool  # some light casts shadows, and is reflected
    has_tangents: bool  # some material is brushed along u
    textures: Textures | None  # None where the scene has none
    packed_textures: PackedTextures | None  # the same for look-ups in float32; None where there are none
    opacity: Opacity | None  # None where all is opaque
    products: Products | None  # None where colours are multiplied channel by channel
    cue: Cue | None  # None where nothing fades with depth

    @property
    def dtype(self) -> np.dtype:
        """The type of intensities: float64 where all materials need it."""
        return np.dtype(np.float64 if self.of_materials.is_double.all() else np.float32)

    @property
    def dtypes(self) -> tuple[np.dtype, ...]:
        """The types that materials are lit in."""
        is_double = self.of_materials.is_double
        found = (np.float32, not is_double.all()), (np.float64, is_double.any())
        return tuple(np.dtype(dtype) for dtype, is_used in found if is_used)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why float32 won't do for some material, each reason once."""
        return tuple(dict.fromkeys(reason for reasons in self.of_materials.reasons for reason in reasons))

    @property
    def reflected_lights(self) -> tuple:
        """The lights that some material reflects something of."""
        return tuple(light for light, is_lit in zip(self.lights, self.is_lit.any(axis=0), strict=True) if is_lit)

    @property
    def needs_position(self) -> bool:
        """Lighting reads the positions of points."""
        functions = [light_table.entry_of(light).function(light) for light in self.reflected_lights]
        return self.has_shadows or any(function.needs_position for function in functions)

    @property
    def sample_time(self) -> int:
        """Nanoseconds that it takes to shade a sample, roughly, where a quarter of all samples show something."""
        of_light = (2 + 4 * self.has_shadows) * self.is_lit_per_sample
        return of_light * len(self.lights) + 12 * (self.textures is not None) + 8 * (self.opacity is not None)


class Sources(NamedTuple):
    """Where the light of a scene comes from, and what it falls on."""

    ambient: np.ndarray  # (3,) float64, the sum of the ambient lights
    lights: tuple  # the others; those of an area light one by one
    materials: tuple  # the different ones of all meshes
    products: Products | None  # of colours, the exposure included: see `multiply_colors`
    is_lit: np.ndarray  # (n_material, n_light) bool: the material reflects something of the light
    n_black: int  # lights that are black, and no part of `lights`

    @property
    def has_shadows(self) -> bool:
        """Some light casts shadows, and is reflected."""
        casts = [light_table.shadow_of(light) is not None for light in self.lights]
        return bool((self.is_lit.any(axis=0) & np.array(casts, np.bool_)).any())

    def lights_of(self, k: int) -> tuple:
        """The lights that material k reflects something of."""
        return tuple(light for light, is_lit in zip(self.lights, self.is_lit[k].tolist(), strict=True) if is_lit)

    @property
    def is_textured(self) -> bool:
        """Some material has a texture."""
        return any(material.texture is not None for material in self.materials)

    @property
    def is_opaque(self) -> bool:
        """Nothing shows through anything."""
        return all(material.is_opaque for material in self.materials)


def make_plan(scene, options: Options, albedo, clearances=None, colored=None) -> Plan:
    """Find out what a scene needs.

    Parameters
    ----------
    albedo : (n_point, 3) float64, linear colours given with the model, or no rows
    clearances : (n_material, n_light) float64, distances that no lit point of a material comes nearer to the lights
        than; None = 0, so that those that amplify without limit need float64
    colored : (n_material,) bool, which materials have points whose albedo isn't grey; None = all if any

    Raises SceneError where the picture's intensities may be too large for float32.
    """
    sources = gather_sources(scene, options)
    materials, cue = sources.materials, scene.depth_cue
    clearances = np.zeros(sources.is_lit.shape) if clearances is None else clearances
    facts = gather_facts(scene, sources, albedo, colored)
    tint = choose_tint(facts.tints)
    fades_to = max(cue.color) if cue is not None else 0.0
    with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is refused
        most_albedo = albedo.max(initial=1.0) * brightest_texel(materials)
        brightness = compute_brightness(materials, sources.lights, sources.ambient, most_albedo, sources.products)
        check_brightness(max(brightness.of_materials.max(initial=0.0), fades_to))
        brightest = brightness.at(clearances)
        bound = max(float(brightest.of_materials.max(initial=0.0)), fades_to)
    behind = max(fades_to, *(scene.background or (0.0,)))
    # The least that float32 adds in any view: lights are far from surfaces, and no normal errs.
    best = Distances(np.zeros(len(materials)), np.full(sources.is_lit.shape, np.inf))
    roundings = rounding_errors(brightness, best, SINGLE) + WRITTEN * (
        behind + brightness.at(best.clearances).of_materials
    )
    of_materials = plan_materials(sources, brightest, roundings, options, facts, tint)
    n_channel = 3 if of_materials.is_colored.any() else 1
    most_level = bound * (1.0 + options.tolerance) + options.tolerance  # rounding may add half of the tolerance
    least = min_transmittance(bound)
    textures = list_textures(materials) if sources.is_textured else None
    return Plan(
        n_channel=n_channel,
        tint=np.ones(3, np.float32) if tint is None else tint.astype(np.float32),
        of_materials=of_materials,
        level_scale=(int(LEVEL_MASK) - 1) / most_level if 0.0 < most_level < np.inf else 1.0,
        bound=bound,
        brightness=brightness,
        clearances=clearances,
        is_lit=sources.is_lit,
        n_left_out=sources.n_black + int((~sources.is_lit.any(axis=0)).sum()),
        brightest_background=behind,
        is_flat=options.is_flat,
        is_lit_per_sample=options.shading == "phong",
        ambient=sources.ambient,
        lights=sources.lights,
        materials=materials,
        has_albedo=len(albedo) > 0,
        has_shadows=sources.has_shadows,
        has_tangents=any(material.is_anisotropic and material.tangent == "u" for material in materials),
        textures=textures,
        packed_textures=pack_textures(textures) if of_materials.is_looked_up.any() else None,
        opacity=None if sources.is_opaque else list_opacities(materials, least),
        products=sources.products,
        cue=None if cue is None else make_cue(cue, n_channel),
    )


def gather_facts(scene, sources: "Sources", albedo, colored) -> Facts:
    """Find out which materials have colours that are given with the model, and which have one channel."""
    materials = sources.materials
    has_texture = np.array([material.texture is not None for material in materials], np.bool_)
    has_vertex_colors = np.zeros(len(materials), np.bool_)
    if len(albedo) > 0:
        given = number_materials(scene.meshes)[1]
        for mesh, numbers in zip(scene.meshes, given, strict=True):
            if mesh.colors is not None or mesh.face_colors is not None:
                has_vertex_colors[numbers] = True
    if colored is None:
        colored = np.full(len(materials), len(albedo) > 0 and bool(np.ptp(albedo, axis=1).any()))
    tints = [None if has_colors else tint_of(k, sources, scene.depth_cue) for k, has_colors in enumerate(colored)]
    return Facts(has_texture | has_vertex_colors, has_vertex_colors, colored, tints)


def tint_of(k: int, sources: "Sources", cue) -> np.ndarray | None:
    """Return the RGB triple that all intensities of material k are multiples of; None where there is none."""
    material = sources.materials[k]
    if (sources.products is not None and sources.products.is_spectral) or material.texture is not None:
        return None
    tint = common_color([material], sources.lights_of(k), sources.ambient)
    return tint if cue is None or tint is None else common_tint(tint, cue.color)


def choose_tint(tints) -> np.ndarray | None:
    """Choose the tint that most materials have, so that one channel is enough for these; None where none has one."""
    groups: dict[tuple, int] = {}
    for tint in tints:
        if tint is not None:
            groups[tuple(tint)] = groups.get(tuple(tint), 0) + 1
    return np.array(max(groups, key=lambda tint: groups[tint])) if groups else None


def list_lights(scene) -> tuple[tuple, int]:
    """List the lights that aren't ambient, those of an area light one by one, without black ones; and how many of these
    there are."""
    lights = tuple(part for light in scene.lights for part in light_table.entry_of(light).expand(light))
    shining = tuple(light for light in lights if not light_table.is_black(light))
    return shining, len(lights) - len(shining)


def gather_sources(scene, options: Options) -> Sources:
    """List lights and materials, and which lights count for which materials; the exposure is included."""
    ambient_lights = tuple(light for light in scene.lights if light_table.entry_of(light).is_ambient)
    (lights, n_black), materials = list_lights(scene), number_materials(scene.meshes)[0]
    products = multiply_colors(materials, lights, ambient_lights, options)
    if products is None and options.exposure != 0.0:
        ambient_lights, lights, materials = expose(ambient_lights, lights, materials, 2.0**options.exposure)
    ambient = sum((np.array(light.color) for light in ambient_lights), np.zeros(3))
    if products is None:
        is_reflecting = [[any(material.diffuse) or any(material.specular)] for material in materials]
    else:
        is_reflecting = [products.diffuse.any(axis=2), products.specular.any(axis=2), products.grazing.any(axis=2)]
        is_reflecting = np.logical_or.reduce(is_reflecting)
    is_lit = np.ones((len(materials), len(lights)), np.bool_) & np.array(is_reflecting, np.bool_)
    return Sources(ambient, lights, materials, products, is_lit, n_black)


def expose(ambient_lights, lights, materials, scale):
    """Lights and emissive materials with all intensities multiplied: the illumination equation is linear in them."""

    def brighter(source, field):
        return replace(source, **{field: tuple(scale * component for component in getattr(source, field))})

    return (
        tuple(brighter(light, "color") for light in ambient_lights),
        tuple(brighter(light, "color") for light in lights),
        tuple(brighter(material, "emissive") for material in materials),
    )


def check_brightness(bound) -> None:
    """Refuse a scene whose intensities a picture can't hold."""
    if not bound <= LARGEST:
        raise SceneError(
            f"the scene's lights and materials may give intensities up to {bound:.3g}; legal is up to {LARGEST:.3g}, "
            "the largest float32: give lights and materials smaller colors"
        )
