"""The render plan: what this scene needs, and nothing else.

    tables ─ make_plan: what holds in any view ─ Plan.with_shares: float64 where one view asks for it

Found here: the type, the channels and the path to the samples of each material. So what one object needs costs its own
samples, and not those of others. When float32 is enough stands in domains.py.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..options import Options
from ..pipeline import gradients as g
from ..pipeline.a_buffer import Opacity, min_transmittance
from ..pipeline.shade import Cue
from ..pipeline.textures import Textures
from ..pipeline.visibility import LEVEL_MASK
from . import domains
from . import lights as light_table
from . import reflections as reflection_table
from .domains import Intensities
from .scene_tables import SceneTables, choose_tint, common_tint, list_opacities, make_cue
from .texture_tables import make_textures

LARGEST = float(np.finfo(np.float32).max)  # that a picture can hold
FLOAT32, FLOAT64 = np.dtype(np.float32), np.dtype(np.float64)
MAX_TURN = 2.0**-12  # radians: how far planes may turn a normal where that decides whether a point lies in a shadow


class MaterialTable(NamedTuple):
    """What each material needs, a row for each."""

    paths: NDArray[np.uint8]  # (n,): the cheapest that attributes may take to the samples, see pipeline/gradients.py
    features: NDArray[np.uint8]  # (n,): bits, as there
    n_attributes: NDArray[np.int64]  # (n,): how many of the attributes are read
    normal_limits: NDArray[np.float64]  # (n,): how far float32 planes may turn a normal, as there
    shares: NDArray[np.float64]  # (n,): of the tolerance, which rounding takes; infinite in float64
    reasons: tuple[tuple[str, ...], ...]  # why float32 won't do; none where it does
    has_albedo: NDArray[np.bool_]  # (n,): colours come with the model, or a texture
    is_colored: NDArray[np.bool_]  # (n,): three channels are needed
    is_double: NDArray[np.bool_]  # (n,): float64 is needed
    is_textured: NDArray[np.bool_]  # (n,): it has a texture
    dtypes: tuple[np.dtype, ...]  # those that materials are lit in

    def with_shares(self, shares: NDArray[np.float64], why: str) -> "MaterialTable":
        """Return the same with other shares; `why` is the reason of those that need float64 now."""
        is_double, reasons = np.isinf(shares), list(self.reasons)
        for k in np.flatnonzero(is_double & ~self.is_double):
            reasons[k] = (*reasons[k], why)
        of_type = np.where(is_double, g.DOUBLE_PRECISION, g.SINGLE_PRECISION).astype(np.uint8)
        features = self.features & np.uint8(255 - g.DOUBLE_PRECISION - g.SINGLE_PRECISION) | of_type
        return self._replace(
            paths=np.where(is_double, np.uint8(g.EXACT), self.paths),
            features=features,
            shares=shares,
            reasons=tuple(reasons),
            is_double=is_double,
            dtypes=(FLOAT32,) * bool((~is_double).any()) + (FLOAT64,) * bool(is_double.any()),
        )


class Plan(NamedTuple):
    """What this scene needs."""

    tables: SceneTables
    options: Options
    of_materials: MaterialTable
    clearances: NDArray[np.float64]  # (n_material, n_light), see domains.py
    intensities: Intensities
    is_lit_per_sample: bool  # by Phong's method
    n_channel: int  # the most that any material needs
    tint: NDArray[np.float32]  # (3,): the colour of what has one channel
    level_scale: float  # levels a unit of intensity
    bound: float  # the largest intensity that any point can have
    needs_position: bool  # lighting reads the positions of points
    has_tangents: bool  # some material is brushed along u
    textures: Textures | None  # None where the scene has none
    metals: Textures | None  # of how metallic and rough materials are; None where the scene has none
    opacity: Opacity | None  # None where all is opaque
    cue: Cue | None  # None where nothing fades with depth

    @property
    def dtype(self) -> np.dtype:
        """The type of intensities: float64 where all materials need it."""
        return self.of_materials.dtypes[0]

    @property
    def sample_time(self) -> int:
        """Nanoseconds that it takes to shade a sample, roughly, where a quarter of all samples show something."""
        of_light = (2 + 4 * self.tables.has_shadows) * self.is_lit_per_sample
        return of_light * len(self.tables.lights) + 12 * (self.textures is not None) + 8 * (self.opacity is not None)

    def shares_at(self, roundings: NDArray[np.float64], is_far: bool) -> NDArray[np.float64]:
        """Return the share of the tolerance that rounding takes of each material in a view, (n_material,); infinite in
        float64.

        Parameters
        ----------
        roundings : (n_material,) how many u rounding adds there, see domains.py
        is_far : float32 won't do for anything there
        """
        shares = domains.share_of_tolerance(roundings, self.options.tolerance)
        return np.where(self.of_materials.is_double | is_far, np.inf, shares)

    def with_shares(self, shares: NDArray[np.float64], is_far: bool) -> "Plan":
        """Return the plan for a view, with float64 for the materials for which float32 has too few digits there."""
        why = light_table.FAR if is_far else domains.TOO_MUCH
        return self._replace(of_materials=self.of_materials.with_shares(shares, why))


def make_plan(
    tables: SceneTables, options: Options, clearances: NDArray[np.float64] | None = None, run: Callable = map
) -> Plan:
    """Find out what a scene needs.

    Parameters
    ----------
    clearances : (n_material, n_light), how near lights are; None = as `domains.measure_clearances` finds it
    run : see `make_textures`

    Raises SceneError where the picture's intensities may be too large for float32.
    """
    materials, cue = tables.materials, tables.depth_cue
    clearances = domains.measure_clearances(tables) if clearances is None else clearances
    fades_to = max(cue.color) if cue is not None else 0.0
    with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is refused
        intensities = domains.bound_intensities(tables, clearances, options.shading == "phong")
    check_brightness(max(intensities.unweakened, fades_to))
    bound = max(float(intensities.of_materials.max(initial=0.0)), fades_to)
    table, tint = list_materials(tables, options, intensities)
    n_channel = 3 if table.is_colored.any() else 1
    max_level = bound * (1.0 + options.tolerance) + options.tolerance  # rounding may add half of the tolerance
    needs_position, has_tangents, maps, metals = tables.has_shadows, False, [], []
    for light in tables.reflected_lights:
        needs_position |= light_table.entry_of(light).needs_position
    for material in materials:
        has_tangents |= material.is_anisotropic and material.tangent == "u"
        maps.append(material.texture)
        metals.append(material.metallic_roughness)
    return Plan(
        tables=tables,
        options=options,
        of_materials=table,
        clearances=clearances,
        intensities=intensities,
        is_lit_per_sample=options.shading == "phong",
        n_channel=n_channel,
        tint=tint,
        level_scale=(int(LEVEL_MASK) - 1) / max_level if 0.0 < max_level < np.inf else 1.0,
        bound=bound,
        needs_position=needs_position,
        has_tangents=has_tangents,
        textures=make_textures(maps, run=run),
        metals=make_textures(metals, tables.n_texcoord, run),
        opacity=None if tables.is_opaque else list_opacities(materials, min_transmittance(bound)),
        cue=None if cue is None else make_cue(cue, n_channel),
    )


def check_brightness(bound: float) -> None:
    """Refuse a scene whose intensities a picture can't hold."""
    if not bound <= LARGEST:
        raise SceneError(
            f"the scene's lights and materials may give intensities up to {bound:.3g}; legal is up to {LARGEST:.3g}, "
            "the largest float32: give lights and materials smaller colors"
        )


# ---------------------------------------------------------------- what each material needs


def list_materials(
    tables: SceneTables, options: Options, intensities: Intensities
) -> tuple[MaterialTable, NDArray[np.float32]]:
    """Find out what each material needs in any view, and the tint (3,) of what has one channel."""
    materials, is_lit_per_sample = tables.materials, options.shading == "phong"
    tints = list(map(tables.tint_of, range(len(materials))))
    tint = choose_tint(tints)
    angles = options.tolerance / 4 / np.maximum(intensities.slopes, 1e-30)
    if tables.has_shadows:  # which depend on normals, however dim the lights are
        angles = np.minimum(angles, MAX_TURN)
    normal_limits = angles / (np.sqrt(3.0) * domains.SINGLE)
    shares = domains.share_of_tolerance(intensities.roundings, options.tolerance)
    has_vertex_colors = tables.has_vertex_colors
    has_albedo = has_vertex_colors | tables.has_texture
    with_tangents = 6 + 3 * bool(has_albedo.any()) + tables.n_texcoord * bool(tables.has_texture.any())
    is_colored = np.ones(len(materials), np.bool_)
    paths, features, n_attributes, reasons = [], [], [], []
    for k, material in enumerate(materials):
        is_colored[k] = tint is None or tints[k] is None or common_tint(tints[k], tint) is None
        why = reasons_of(material, tables.lights_of(k), options.tolerance, shares[k], intensities.of_materials[k])
        if why or needs_exact_texcoords(material.texture):
            path = g.EXACT
        elif is_lit_per_sample:
            path = g.IN_PLANES if normal_limits[k] > 3.0 else g.EXACT
        else:
            path = g.IN_PLANES if is_colored[k] or not material.is_opaque else g.IN_ENTRIES
        own = count_attributes(material, options.shading, is_colored[k], has_albedo[k], with_tangents)
        paths.append(path)
        features.append(list_features(material, bool(why), is_colored[k], has_vertex_colors[k]))
        n_attributes.append(6 + tables.n_texcoord if material.metallic_roughness is not None else own)
        reasons.append(why)
    is_double = np.array(list(map(bool, reasons)))
    table = MaterialTable(
        np.array(paths, np.uint8), np.array(features, np.uint8), np.array(n_attributes, np.int64), normal_limits,
        shares, tuple(reasons), has_albedo, is_colored, is_double, tables.has_texture, (),
    )  # fmt: skip
    table = table.with_shares(np.where(is_double, np.inf, shares), "")
    return table, np.ones(3, np.float32) if tint is None else tint.astype(np.float32)


def reasons_of(material: Any, lights: tuple, tolerance: float, share: float, bound: float) -> tuple[str, ...]:
    """Say why float32 won't do for a material in any view, in a few words each; nothing where it does.

    Parameters
    ----------
    lights : those that it reflects
    share : of the tolerance, which rounding takes at least
    bound : the largest intensity that it may have; infinite where a light amplifies without limit
    """
    found = ["tolerance 0" if tolerance == 0 else domains.TOO_MUCH if np.isinf(share) else ""]
    found.append("" if np.isfinite(bound) else domains.UNBOUNDED)
    for light in lights:
        found.append(light_table.entry_of(light).limits(light).reason)
    found.append(reflection_table.entry_of(material).limits(material).reason)
    return tuple(filter(None, dict.fromkeys(found)))


def needs_exact_texcoords(texture: Any) -> bool:
    """Tell whether no error of texture coordinates is small enough: next to the border of texels that are not blended,
    and of alpha, as it weights all that is behind, once for each layer."""
    return texture is not None and (texture.filter == "nearest" or texture.has_alpha)


def list_features(material: Any, is_double: bool, is_colored: bool, has_vertex_colors: bool) -> int:
    """Return what a material needs, as bits."""
    features = g.DOUBLE_PRECISION if is_double else g.SINGLE_PRECISION
    features |= g.HAS_COLORS if is_colored else 0
    features |= g.HAS_ALBEDO if has_vertex_colors else 0
    if material.texture is not None:
        features |= g.HAS_TEXTURE
    return features | (0 if material.is_opaque else g.IS_TRANSPARENT if material.opacity > 0.0 else g.IS_INVISIBLE)


def count_attributes(material: Any, shading: str, is_colored: bool, has_albedo: bool, with_tangents: int) -> int:
    """Return how many attributes of the surfaces of a material are read, see attributes.py; `with_tangents` are all,
    the tangents behind the others."""
    if shading != "phong":
        return 8 if material.texture is not None else 3 if is_colored else 1
    if material.is_anisotropic and material.tangent == "u":
        return with_tangents
    return 8 if material.texture is not None else 6 if has_albedo else 3
