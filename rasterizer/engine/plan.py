"""The plan of a picture: what this scene needs, and nothing else.

    tables, albedo ─ Plan: what holds in any view ─ ViewPlan: float64 where one view asks for it, and the error bound

Found here: how bright the scene may be, the type, the channels and the path to the samples of each material, so that
what one object needs costs its own samples and no others. The bounds that justify a cheaper path stand in bounds.py.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..geometry.surfaces import compute_clearance, compute_point_clearance, find_shortest_normal
from ..locks import cached_property
from ..options import Options
from ..pipeline import gradients as g
from ..pipeline.a_buffer import Opacity, min_transmittance
from ..pipeline.setup import DEPTH_PLANE_ROUNDING
from ..pipeline.shade import DEPTH_ERROR, Cue
from ..pipeline.textures import PackedTextures, Textures
from ..pipeline.visibility import LEVEL_MASK
from ..scene.camera import View
from . import bounds as b
from . import lights as light_table
from . import reflections as reflection_table
from .rounding import DOUBLE, SINGLE, Discontinuity
from .scene_tables import (
    Products,
    SceneTables,
    brightest_texel,
    choose_tint,
    common_tint,
    has_alpha,
    list_opacities,
    make_cue,
)
from .texture_tables import TextureList, lay_textures, list_textures, pack_textures

SMALL, LARGE = 2.0**-40, 2.0**60  # scene units: squares of lengths between them keep their digits in float32
LARGEST = float(np.finfo(np.float32).max)  # that a picture can hold
TOO_MUCH = "rounding beyond half of the tolerance"
MAX_TURN = 2.0**-12  # radians: how far planes may turn a normal where that decides whether a point lies in a shadow
ANYWHERE = View(np.zeros(3), *np.eye(3))  # for lights that don't move with the camera
PER_OCTAVE = 16  # views whose distances differ by less than this part of an octave are planned alike
N_KEPT = 64  # plans of views: while a camera goes round a scene, it comes through some twenty such parts


# ---------------------------------------------------------------- the plan of a scene, whatever the camera


class Plan(NamedTuple):
    """What this scene needs, whatever the camera."""

    n_channel: int  # the most that any material needs
    tint: np.ndarray  # (3,) float32: the colour of what has one channel
    of_materials: "MaterialPlans"
    level_scale: float  # levels a unit of intensity
    bound: float  # the largest intensity that any point can have
    brightness: b.Brightness  # how bright each light makes each material, where nothing weakens it
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
    textures: TextureList | None  # None where the scene has none
    metals: Textures | None  # of how metallic and rough materials are; None where the scene has none
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
    def n_texel(self) -> int:
        """Rows of texels that a workspace needs."""
        return 0 if self.textures is None else 4 if self.metals is None else 8

    @property
    def of_metals(self) -> NDArray[np.int64] | None:
        """(n_material,): the metallic-roughness texture of each, -1 for none; None where there are none."""
        return None if self.metals is None else self.metals.of_materials

    @property
    def sample_time(self) -> int:
        """Nanoseconds that it takes to shade a sample, roughly, where a quarter of all samples show something."""
        of_light = (2 + 4 * self.has_shadows) * self.is_lit_per_sample
        return of_light * len(self.lights) + 12 * (self.textures is not None) + 8 * (self.opacity is not None)


def make_plan(
    tables: SceneTables, options: Options, albedo, clearances=None, colored=None, run: Callable = map
) -> Plan:
    """Find out what a scene needs.

    Parameters
    ----------
    albedo : (n_point, 3) float64, linear colours given with the model, or no rows
    clearances : (n_material, n_light) float64, distances that no lit point of a material comes nearer to the lights
        than; None = 0, so that those that amplify without limit need float64
    colored : (n_material,) bool, which materials have points whose albedo isn't grey; None = all if any
    run : see `pack_textures`

    Raises SceneError where the picture's intensities may be too large for float32.
    """
    materials, cue, shape = tables.materials, tables.depth_cue, tables.is_lit.shape
    clearances = np.zeros(shape) if clearances is None else clearances
    if colored is None:
        colored = np.full(len(materials), _has_hues(albedo))
    tints = [None if has_colors else tables.tint_of(k) for k, has_colors in enumerate(colored)]
    tint = choose_tint(tints)
    fades_to = max(cue.color) if cue is not None else 0.0
    with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is refused
        max_albedo = albedo.max(initial=1.0) * brightest_texel(materials)
        brightness = b.compute_brightness(tables, max_albedo)
        check_brightness(max(brightness.of_materials.max(initial=0.0), fades_to))
        brightest = brightness.at(clearances)
        bound = max(float(brightest.of_materials.max(initial=0.0)), fades_to)
    behind = max(fades_to, *(tables.background or (0.0,)))
    # The least that float32 adds in any view: lights are far from surfaces, and no normal errs.
    best = b.Distances(np.zeros(len(materials)), np.full(shape, np.inf))
    roundings = b.rounding_errors(brightness, best, SINGLE) + b.WRITTEN * (
        behind + brightness.at(best.clearances).of_materials
    )
    has_vertex_colors = tables.has_vertex_colors if len(albedo) else np.zeros(len(materials), np.bool_)
    of_materials = plan_materials(tables, brightest, roundings, options, has_vertex_colors, (tint, tints))
    n_channel = 3 if of_materials.is_colored.any() else 1
    max_level = bound * (1.0 + options.tolerance) + options.tolerance  # rounding may add half of the tolerance
    textures = list_textures([material.texture for material in materials]) if tables.is_textured else None
    of_metals = [material.metallic_roughness for material in materials]
    is_looked_up = of_materials.is_looked_up
    return Plan(
        n_channel=n_channel,
        tint=np.ones(3, np.float32) if tint is None else tint.astype(np.float32),
        of_materials=of_materials,
        level_scale=(int(LEVEL_MASK) - 1) / max_level if 0.0 < max_level < np.inf else 1.0,
        bound=bound,
        brightness=brightness,
        clearances=clearances,
        is_lit=tables.is_lit,
        n_left_out=tables.n_black + int((~tables.is_lit.any(axis=0)).sum()),
        brightest_background=behind,
        is_flat=options.is_flat,
        is_lit_per_sample=options.shading == "phong",
        ambient=tables.ambient,
        lights=tables.lights,
        materials=materials,
        has_albedo=len(albedo) > 0,
        has_shadows=tables.has_shadows,
        has_tangents=any(material.is_anisotropic and material.tangent == "u" for material in materials),
        textures=textures,
        metals=lay_textures(list_textures(of_metals, tables.n_texcoord), run=run) if any(of_metals) else None,
        packed_textures=None
        if not is_looked_up.any()
        else pack_textures(textures, np.where(is_looked_up & ~has_alpha(materials), textures.of_materials, -1), run),
        opacity=None if tables.is_opaque else list_opacities(materials, min_transmittance(bound)),
        products=tables.products,
        cue=None if cue is None else make_cue(cue, n_channel),
    )


def check_brightness(bound) -> None:
    """Refuse a scene whose intensities a picture can't hold."""
    if not bound <= LARGEST:
        raise SceneError(
            f"the scene's lights and materials may give intensities up to {bound:.3g}; legal is up to {LARGEST:.3g}, "
            "the largest float32: give lights and materials smaller colors"
        )


# ---------------------------------------------------------------- what each material needs


class MaterialPlans(NamedTuple):
    """A row for each material."""

    paths: NDArray[np.uint8]  # (n,): the cheapest that attributes may take to the samples, see pipeline/gradients.py
    features: NDArray[np.uint8]  # (n,): bits, as there
    n_attributes: NDArray[np.int64]  # (n,): how many of the attributes are read
    normal_limits: NDArray[np.float64]  # (n,): how far float32 planes may turn a normal, as there
    roundings: NDArray[np.float64]  # (n,): what rounding may add to an intensity, linear; see bounds.py
    has_albedo: NDArray[np.bool_]  # (n,): colours come with the model, or a texture
    reasons: tuple[tuple[str, ...], ...]  # why float32 won't do; none where it does

    @property
    def is_double(self) -> NDArray[np.bool_]:
        """Which need float64."""
        return (self.features & g.DOUBLE_PRECISION) != 0

    def dtype_of(self, material: int) -> np.dtype:
        """The type that a material is lit in."""
        return np.dtype(np.float64 if self.features[material] & g.DOUBLE_PRECISION else np.float32)

    @property
    def is_looked_up(self) -> NDArray[np.bool_]:
        """Which have textures whose coordinates may stand in planes."""
        return ((self.features & g.HAS_TEXTURE) != 0) & ~self.is_double

    @property
    def reads_double(self) -> NDArray[np.bool_]:
        """Which have attributes that aren't rounded to float32: also texture coordinates, of which large pictures need
        many digits."""
        return self.is_double | self.is_looked_up

    @property
    def is_colored(self) -> NDArray[np.bool_]:
        """Which need three channels."""
        return (self.features & g.HAS_COLORS) != 0

    def doubled(self, which: NDArray[np.bool_], reason: str) -> "MaterialPlans":
        """Return the same with float64 for some materials."""
        singles = np.uint8(255 - g.SINGLE_PRECISION)
        features = np.where(which, self.features & singles | np.uint8(g.DOUBLE_PRECISION), self.features)
        reasons = [(*old, reason) if new else old for new, old in zip(which, self.reasons, strict=True)]
        return self._replace(
            features=features.astype(np.uint8),
            paths=np.where(which, np.uint8(g.EXACT), self.paths),
            reasons=tuple(reasons),
        )


def plan_materials(
    tables: SceneTables,
    brightest: b.Brightness,
    roundings: NDArray[np.float64],
    options: Options,
    has_vertex_colors: NDArray[np.bool_],
    tints: tuple[NDArray | None, Sequence[NDArray | None]],
) -> MaterialPlans:
    """Find out what each material needs.

    Parameters
    ----------
    brightest : as bright as lights are at their clearances
    roundings : (n_material,) the least that float32 adds to an intensity in any view
    has_vertex_colors : (n_material,) colours are given with the model
    tints : (3,) the colour of what has one channel, None where all has three; and that of each material
    """
    tint, of_material = tints
    max_intensities = brightest.of_materials
    angles = options.tolerance / 4 / np.maximum(brightest.turn_slopes, 1e-30)
    if tables.has_shadows:  # which depend on normals, however dim the lights are
        angles = np.minimum(angles, MAX_TURN)
    normal_limits = angles / (np.sqrt(3.0) * SINGLE)
    has_texture = np.array([material.texture is not None for material in tables.materials], np.bool_)
    has_albedo = has_texture | has_vertex_colors
    n_texcoord = tables.n_texcoord
    with_tangents = 6 + 3 * bool(has_albedo.any()) + n_texcoord * tables.is_textured
    paths, features, n_attributes, reasons = [], [], [], []
    for k, material in enumerate(tables.materials):
        why = reasons_of(material, tables.lights_of(k), options.tolerance, roundings[k], max_intensities[k])
        is_colored = tint is None or of_material[k] is None or common_tint(of_material[k], tint) is None
        needs_planes = is_colored or not material.is_opaque
        paths.append(choose_path(why, options.shading, needs_planes, normal_limits[k], max_intensities.max()))
        features.append(list_features(material, bool(why), is_colored, has_vertex_colors[k]))
        own = count_attributes(material, options.shading, is_colored, has_albedo[k], with_tangents)
        n_attributes.append(6 + n_texcoord if material.metallic_roughness is not None else own)
        reasons.append(why)
    return MaterialPlans(
        np.array(paths, np.uint8), np.array(features, np.uint8), np.array(n_attributes, np.int64), normal_limits,
        roundings, has_albedo, tuple(reasons),
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


def choose_path(reasons: Sequence[str], shading: str, needs_planes: bool, normal_limit: float, bound: float) -> int:
    """Choose the cheapest path that the attributes of a material may take to the samples."""
    if reasons:
        return g.EXACT
    if shading == "phong":
        return g.IN_PLANES if normal_limit > 3.0 else g.EXACT
    if not np.isfinite(bound):
        return g.EXACT
    return g.IN_PLANES if needs_planes else g.IN_ENTRIES


def list_features(material: Any, is_double: bool, is_colored: bool, has_vertex_colors: bool) -> int:
    """Return what a material needs, as bits."""
    features = g.DOUBLE_PRECISION if is_double else g.SINGLE_PRECISION
    features |= g.HAS_COLORS if is_colored else 0
    features |= g.HAS_ALBEDO if has_vertex_colors else 0
    if material.texture is not None:
        is_nearest = material.texture.filter == "nearest" and not is_double
        features |= g.HAS_TEXTURE | (g.HAS_CORNERS if is_nearest else 0)
    return features | (0 if material.is_opaque else g.IS_TRANSPARENT if material.opacity > 0.0 else g.IS_INVISIBLE)


def count_attributes(material: Any, shading: str, is_colored: bool, has_albedo: bool, with_tangents: int) -> int:
    """Return how many attributes of the surfaces of a material are read, see attributes.py; `with_tangents` are all,
    the tangents behind the others."""
    if shading != "phong":
        return 8 if material.texture is not None else 3 if is_colored else 1
    if material.is_anisotropic and material.tangent == "u":
        return with_tangents
    return 8 if material.texture is not None else 6 if has_albedo else 3


# ---------------------------------------------------------------- the plan of a view


class ViewPlan(NamedTuple):
    """What one view needs."""

    plan: Plan
    error_bound: float | None  # linear intensity, see `Stats`
    steps: tuple  # where no error is small, and why none is stated, see `Stats`
    filters: tuple[b.FilterBound, ...]


class ViewPlans:
    """The plans of a scene, kept from view to view: what was found for one usually holds for others."""

    def __init__(self, tables: SceneTables, options: Options, geometry, run: Callable = map) -> None:
        self._options, self._geometry, self._bounds = options, geometry, tables.bounds
        self._is_lit_per_sample = options.shading == "phong"
        n_material, bounds = len(tables.materials), self._bounds
        has = [[k in palette for palette in tables.palettes] for k in range(n_material)]
        self._boxes = np.array([(bounds[of_k, 0].min(axis=0), bounds[of_k, 1].max(axis=0)) for of_k in has])
        self._lit = list_lit(geometry, n_material, self._is_lit_per_sample)
        self._lights = tables.lights
        self._clearances = np.zeros((n_material, len(self._lights)))
        for i, light in enumerate(self._lights):
            if not light_table.is_carried(light):
                self._clearances[:, i] = self._clearances_from(light, ANYWHERE)
            elif math.isinf(light_table.entry_of(light).clearance(light, ANYWHERE, lambda position: 0.0)):
                self._clearances[:, i] = np.inf  # in any view
        self._is_parallel = bool(np.isinf(self._clearances).all())
        colored = find_colored(geometry, n_material)
        self.plan = make_plan(tables, options, geometry.albedo, 0.5 * self._clearances, colored, run)
        self._kept: dict[tuple, ViewPlan] = {}
        self._shortest = 1.0
        if self._is_lit_per_sample and self.plan.brightness.turn_slopes.max(initial=0.0) > 0.0:
            self._shortest = self.shortest_normal

    @cached_property
    def shortest_normal(self) -> float:
        """The least length of a mean of a face's normals."""
        return float(find_shortest_normal(self._geometry.normals, self._geometry.corner))

    def plan_for(self, view, screen, shadow_shift: Callable[[], float] | None = None) -> ViewPlan:
        """The plan for a view, or one with float64 where float32 has too few digits for it.

        Parameters
        ----------
        shadow_shift : returns how far float32 moves what shadows are asked for in this view, scene units, and infinity
            where float32 can't be taken; it is called where that counts
        """
        shift = 0.0
        if shadow_shift is not None and self.plan.has_shadows and not self.plan.of_materials.is_double.all():
            shift = _up(shadow_shift())
        distances = self._measure(view, screen, shift)
        arrays = {name: getattr(distances, name).tobytes() for name in ("furthest", "clearances")}
        key = distances._replace(**arrays), screen.is_perspective
        return self._kept.get(key) or keep(self._kept, key, self._make_plan(distances))

    def _make_plan(self, distances: b.Distances) -> ViewPlan:
        plan = plan_of_view(self.plan, self._options.tolerance, distances)
        stated = error_bounds_of(plan, self._options.tolerance)
        reasons = list_unstated(plan, self._options, stated)
        everywhere = tuple(Discontinuity(reason, np.inf, "everywhere") for reason in reasons)
        steps = b.list_discontinuities(plan, distances) + everywhere
        error_bound = None if reasons else float(stated.max(initial=0.0))
        return ViewPlan(plan, error_bound, steps, b.bound_filters(plan))

    def _measure(self, view, screen, shadow_shift) -> b.Distances:
        """What this view says about positions; distances are rounded to the unsafe side, to 1/16 of an octave."""
        furthest = b.furthest_of(self._bounds, view.eye)
        each = [math.hypot(*extent) for extent in np.abs(self._boxes - view.eye).max(axis=1).tolist()]
        clearances = self._clearances
        if self._is_parallel and are_single(each):
            each = [1.0] * len(each)  # positions play no part
        elif not self._is_parallel:
            clearances = self._clearances_in(view, b.position_shift(screen, furthest, self._is_lit_per_sample))
        return b.Distances(
            furthest=np.array([_up(away) for away in each]),
            clearances=clearances,
            shortest=self._shortest,
            is_lit_per_sample=self._is_lit_per_sample,
            ratio=_up(b.furthest_over_nearest(screen, furthest)),
            fading=self._fading(screen),
            lean=abs(screen.skew) / screen.scale_x if self._is_lit_per_sample else 0.0,
            shadow_shift=shadow_shift,
        )

    def _clearances_in(self, view, beside: float) -> NDArray[np.float64]:
        """The clearances in one view, (n_material, n_light), where a sample's point may lie `beside` its triangle."""
        clearances = self._clearances.copy()
        for i, light in enumerate(self._lights):
            if light_table.is_carried(light):
                clearances[:, i] = self._clearances_from(light, view)
        with np.errstate(divide="ignore"):
            octaves = np.floor(PER_OCTAVE * np.log2(np.maximum(clearances - beside, 0.0)))
        return np.exp2(octaves / PER_OCTAVE)

    def _clearances_from(self, light, view) -> list[float]:
        """The distances that no lit point of each material comes nearer to a light than; see `LightEntry.clearance`."""
        compute = compute_clearance if self._is_lit_per_sample else compute_point_clearance
        distances = [lambda position, lit=lit: compute(*lit, *map(float, position)) for lit in self._lit]
        return [light_table.entry_of(light).clearance(light, view, distance) for distance in distances]

    def _fading(self, screen) -> float:
        """How far off the share may be that depth cueing leaves of an intensity, where depths are those of entries.

        Without perspective these err by half a unit of the z-buffer for each step from a triangle's first sample, along
        both axes, and by DEPTH_PLANE_ROUNDING; over the cue's scale that is a change of the share.
        """
        cue, (width, height), factor = self.plan.cue, self._options.size, self._options.factor
        if cue is None or screen.z_scale == 0.0:
            return 0.0
        if screen.is_perspective:
            return DEPTH_ERROR * (0.25 + max(cue.start, 0.0) / cue.scale)
        return (0.5 * factor * (width + height) + DEPTH_PLANE_ROUNDING) / abs(screen.z_scale) / cue.scale


def keep(kept: dict, key: Any, value: Any) -> Any:
    """Keep what was made for a view, with that of the last N_KEPT views; return it."""
    if len(kept) >= N_KEPT:
        del kept[next(iter(kept))]
    kept[key] = value
    return value


def _up(value: float) -> float:
    """A number, at least 0, rounded up to a sixteenth of an octave."""
    return float(2.0 ** (np.ceil(PER_OCTAVE * np.log2(value)) / PER_OCTAVE)) if value > 0.0 else 0.0


def list_lit(geometry, n_material, is_lit_per_sample) -> list[tuple]:
    """List what is lit of each material: surfaces (positions, triangles), or points, as `compute_clearance` and
    `compute_point_clearance` take them."""
    if is_lit_per_sample:
        of_face, vertex = geometry.face_material, geometry.vertex
        if not len(of_face):
            return [(geometry.positions, vertex)]
        return [(geometry.positions, np.ascontiguousarray(vertex[:, of_face == k])) for k in range(n_material)]
    of_point = np.repeat(geometry.group_material, np.diff(geometry.point_offsets))
    lit = geometry.points[: len(of_point)]
    return [(lit[of_point == k],) for k in range(n_material)]


def find_colored(geometry, n_material) -> NDArray[np.bool_]:
    """Find the materials that have points whose albedo isn't grey, (n_material,)."""
    colored = np.zeros(n_material, np.bool_)
    if len(geometry.albedo):
        offsets = geometry.point_offsets.tolist()
        for material, start, end in zip(geometry.group_material, offsets[:-1], offsets[1:], strict=True):
            colored[material] |= _has_hues(geometry.albedo[start:end])
    return colored


def _has_hues(albedo) -> bool:
    """Tell whether any of these colours, (n, 3), isn't grey."""
    return bool((albedo[:, 1:] != albedo[:, :1]).any())


def plan_of_view(plan: Plan, tolerance, distances: b.Distances) -> Plan:
    """Return the plan with float64 for the materials for which float32 has too few digits in one view.

    Rounding may take half of the tolerance. Lengths and their squares must keep their digits, from the nearest point to
    a light to the furthest one from the eye. Nothing is kept back here: where a normal vanishes or a light lies on a
    surface, float64 is right.
    """
    of_materials, fades_to = plan.of_materials, 0.0 if plan.cue is None else float(plan.cue.color.max())
    written = b.WRITTEN * (plan.brightest_background + plan.brightness.at(plan.clearances).of_materials)
    single = b.rounding_errors(plan.brightness, distances, SINGLE, fades_to) + written
    lit = plan.brightness.at(distances.kept().clearances)
    with np.errstate(invalid="ignore"):  # NaN, no bound, of light that has none
        double = b.rounding_errors(plan.brightness, distances, DOUBLE)
        double /= np.maximum(lit.of_materials, 1.0)  # of full scale
    double[lit.undirected + lit.diffuse.sum(axis=1) > b.MAX_LIGHT] = np.inf
    if plan.opacity is not None:
        single += 2.0 * plan.opacity.min_transmittance * plan.bound  # of layers that are left out: pipeline/a_buffer.py
        double += 2.0 * plan.opacity.min_transmittance
    places = distances.clearances[plan.is_lit & np.isfinite(distances.clearances)]
    is_lost = not are_single([*distances.furthest.tolist(), *places.tolist()]) or not np.isfinite(
        distances.shadow_shift
    )
    is_lost |= bool((distances.clearances < plan.clearances)[plan.is_lit].any()) or distances.shortest <= 0.0
    lost = ~of_materials.is_double & (is_lost | ~(single <= tolerance / 2))
    if lost.any():
        of_materials = of_materials.doubled(lost, TOO_MUCH)
    roundings = np.where(of_materials.is_double, double, single)
    return plan._replace(of_materials=of_materials._replace(roundings=roundings))


def error_bounds_of(plan: Plan, tolerance) -> NDArray[np.float64]:
    """The largest error of an intensity of each material in one view, (n_material,), against the exact evaluation of
    the same polygons, see `Stats`; NaN where none is stated. The plan's roundings are those of the view.

    Of float64 that is EXACT. Float32 adds half a level where a polygon has one intensity in its visibility entries, a
    quarter of the tolerance for the normals' planes and one for colours'; or all that rounding leaves of it, for what
    Gouraud's method has between the corners, and for textures.
    """
    of_materials, roundings = plan.of_materials, plan.of_materials.roundings
    rest = np.maximum(tolerance - roundings, 0.0)
    if plan.is_lit_per_sample:
        has_colors = (of_materials.features & g.HAS_ALBEDO) != 0
        approximated = np.where(has_colors, tolerance / 2, tolerance / 4)
    elif plan.is_flat:
        approximated = np.where(of_materials.paths == g.IN_ENTRIES, 0.5 / plan.level_scale, 0.0)
    else:
        approximated = rest
    approximated = np.where(of_materials.is_looked_up, rest, approximated)
    single = roundings + np.where(of_materials.paths == g.EXACT, 0.0, approximated)
    is_rounded = single <= tolerance * (1.0 + 4.0 * DOUBLE)  # a sum may round to more than the tolerance that it is
    single = np.where(is_rounded, np.minimum(single, tolerance), single)
    return np.where(of_materials.is_double, np.where(roundings <= b.ROUNDED, b.EXACT, np.nan), single)


def list_unstated(plan: Plan, options: Options, stated: NDArray[np.float64]) -> list[str]:
    """Say why no bound is stated, in a sentence each; nothing where one is."""
    found = []
    silent = [
        type(light).__name__ for light in plan.reflected_lights if not light_table.entry_of(light).has_bound(light)
    ]
    silent += [m.reflection for m, is_lit in zip(plan.materials, plan.is_lit, strict=True)
               if is_lit.any() and not reflection_table.entry_of(m).has_bound]  # fmt: skip
    for name in dict.fromkeys(silent):
        found.append(f"no bound is stated: {name}, which is registered, says none")
    if np.isnan(stated).any() and not silent:
        found.append(
            "no bound is stated: a light, a highlight or the depths of the scene magnify the rounding of float64 "
            f"beyond {b.EXACT:.0e}"
        )
    return found
