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
from ..pipeline.textures import PackedTextures, Textures
from ..pipeline.visibility import LEVEL_MASK
from . import domains
from . import lights as light_table
from . import reflections as reflection_table
from .domains import Brightness, Roundings
from .scene_tables import SceneTables, choose_tint, common_tint, has_alpha, list_opacities, make_cue
from .texture_tables import TextureList, lay_textures, list_textures, pack_textures

LARGEST = float(np.finfo(np.float32).max)  # that a picture can hold
MAX_TURN = 2.0**-12  # radians: how far planes may turn a normal where that decides whether a point lies in a shadow


class MaterialTable(NamedTuple):
    """What each material needs, a row for each."""

    paths: NDArray[np.uint8]  # (n,): the cheapest that attributes may take to the samples, see pipeline/gradients.py
    features: NDArray[np.uint8]  # (n,): bits, as there
    n_attributes: NDArray[np.int64]  # (n,): how many of the attributes are read
    normal_limits: NDArray[np.float64]  # (n,): how far float32 planes may turn a normal, as there
    shares: NDArray[np.float64]  # (n,): of the tolerance, which rounding takes; infinite in float64
    has_albedo: NDArray[np.bool_]  # (n,): colours come with the model, or a texture
    reasons: tuple[tuple[str, ...], ...]  # why float32 won't do; none where it does

    @property
    def is_double(self) -> NDArray[np.bool_]:
        """Which need float64."""
        return (self.features & g.DOUBLE_PRECISION) != 0

    @property
    def is_looked_up(self) -> NDArray[np.bool_]:
        """Which have textures whose coordinates may stand in planes."""
        return ((self.features & g.HAS_TEXTURE) != 0) & ~self.is_double

    @property
    def is_colored(self) -> NDArray[np.bool_]:
        """Which need three channels."""
        return (self.features & g.HAS_COLORS) != 0


class Plan(NamedTuple):
    """What this scene needs."""

    tables: SceneTables
    options: Options
    of_materials: MaterialTable
    brightness: Brightness
    roundings: Roundings
    n_channel: int  # the most that any material needs
    tint: NDArray[np.float32]  # (3,): the colour of what has one channel
    level_scale: float  # levels a unit of intensity
    bound: float  # the largest intensity that any point can have
    textures: TextureList | None  # None where the scene has none
    metals: Textures | None  # of how metallic and rough materials are; None where the scene has none
    packed_textures: PackedTextures | None  # the same for look-ups in float32; None where there are none
    opacity: Opacity | None  # None where all is opaque
    cue: Cue | None  # None where nothing fades with depth

    @property
    def is_lit_per_sample(self) -> bool:
        """By Phong's method."""
        return self.options.shading == "phong"

    @property
    def dtypes(self) -> tuple[np.dtype, ...]:
        """The types that materials are lit in."""
        return tuple(np.dtype(np.float64 if each else np.float32) for each in np.unique(self.of_materials.is_double))

    @property
    def dtype(self) -> np.dtype:
        """The type of intensities: float64 where all materials need it."""
        return self.dtypes[0]

    @property
    def reflected_lights(self) -> tuple:
        """The lights that some material reflects something of."""
        return tuple(
            light for light, is_lit in zip(self.tables.lights, self.tables.is_lit.any(axis=0), strict=True) if is_lit
        )

    @property
    def needs_position(self) -> bool:
        """Lighting reads the positions of points."""
        rows = [light_table.entry_of(light) for light in self.reflected_lights]
        return self.tables.has_shadows or any(row.needs_position for row in rows)

    @property
    def has_tangents(self) -> bool:
        """Some material is brushed along u."""
        return any(material.is_anisotropic and material.tangent == "u" for material in self.tables.materials)

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
        table, is_double = self.of_materials, np.isinf(shares)
        lost, why = is_double & ~table.is_double, light_table.FAR if is_far else domains.TOO_MUCH
        of_type = np.where(is_double, g.DOUBLE_PRECISION, g.SINGLE_PRECISION).astype(np.uint8)
        features = table.features & np.uint8(255 - g.DOUBLE_PRECISION - g.SINGLE_PRECISION) | of_type
        reasons = [(*old, why) if new else old for new, old in zip(lost, table.reasons, strict=True)]
        paths = np.where(is_double, np.uint8(g.EXACT), table.paths)
        table = table._replace(paths=paths, features=features, shares=shares, reasons=tuple(reasons))
        return self._replace(of_materials=table)


def make_plan(
    tables: SceneTables, options: Options, clearances: NDArray[np.float64] | None = None, run: Callable = map
) -> Plan:
    """Find out what a scene needs.

    Parameters
    ----------
    clearances : (n_material, n_light), as `domains.measure_clearances` returns them; None = 0
    run : see `pack_textures`

    Raises SceneError where the picture's intensities may be too large for float32.
    """
    materials, cue = tables.materials, tables.depth_cue
    clearances = np.zeros(tables.is_lit.shape) if clearances is None else clearances
    fades_to = max(cue.color) if cue is not None else 0.0
    with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is refused
        brightness = domains.compute_brightness(tables)
        check_brightness(max(brightness.of_materials.max(initial=0.0), fades_to))
        brightness = domains.weaken(brightness, tables, clearances)
        bound = max(float(brightness.of_materials.max(initial=0.0)), fades_to)
    roundings = domains.count_roundings(tables, brightness, options.shading == "phong")
    table, tint = list_materials(tables, options, brightness, roundings)
    n_channel = 3 if table.is_colored.any() else 1
    max_level = bound * (1.0 + options.tolerance) + options.tolerance  # rounding may add half of the tolerance
    textures = list_textures([material.texture for material in materials]) if tables.is_textured else None
    of_metals = [material.metallic_roughness for material in materials]
    is_looked_up = table.is_looked_up
    return Plan(
        tables=tables,
        options=options,
        of_materials=table,
        brightness=brightness,
        roundings=roundings,
        n_channel=n_channel,
        tint=tint,
        level_scale=(int(LEVEL_MASK) - 1) / max_level if 0.0 < max_level < np.inf else 1.0,
        bound=bound,
        textures=textures,
        metals=lay_textures(list_textures(of_metals, tables.n_texcoord), run=run) if any(of_metals) else None,
        packed_textures=None
        if not is_looked_up.any()
        else pack_textures(textures, np.where(is_looked_up & ~has_alpha(materials), textures.of_materials, -1), run),
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
    tables: SceneTables, options: Options, brightness: Brightness, roundings: Roundings
) -> tuple[MaterialTable, NDArray[np.float32]]:
    """Find out what each material needs in any view, and the tint (3,) of what has one channel."""
    materials, is_lit_per_sample = tables.materials, options.shading == "phong"
    tints = [None if has_hues else tables.tint_of(k) for k, has_hues in enumerate(tables.has_hues)]
    tint = choose_tint(tints)
    is_colored = [tint is None or own is None or common_tint(own, tint) is None for own in tints]
    angles = options.tolerance / 4 / np.maximum(domains.slopes_of(tables, brightness), 1e-30)
    if tables.has_shadows:  # which depend on normals, however dim the lights are
        angles = np.minimum(angles, MAX_TURN)
    normal_limits = angles / (np.sqrt(3.0) * domains.SINGLE)
    shares = domains.share_of_tolerance(roundings.own, options.tolerance)
    has_vertex_colors = tables.has_vertex_colors
    has_albedo = has_vertex_colors | np.array([material.texture is not None for material in materials], np.bool_)
    with_tangents = 6 + 3 * bool(has_albedo.any()) + tables.n_texcoord * tables.is_textured
    paths, features, n_attributes, reasons = [], [], [], []
    for k, material in enumerate(materials):
        why = reasons_of(material, tables.lights_of(k), options.tolerance, shares[k], brightness.of_materials[k])
        if why:
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
    table = MaterialTable(
        np.array(paths, np.uint8), np.array(features, np.uint8), np.array(n_attributes, np.int64), normal_limits,
        np.where([bool(why) for why in reasons], np.inf, shares), has_albedo, tuple(reasons),
    )  # fmt: skip
    return table, np.ones(3, np.float32) if tint is None else tint.astype(np.float32)


def reasons_of(material: Any, lights: tuple, tolerance: float, share: float, bound: float) -> tuple[str, ...]:
    """Say why float32 won't do for a material in any view, in a few words each; nothing where it does.

    Parameters
    ----------
    lights : those that it reflects
    share : of the tolerance, which rounding takes at least
    bound : the largest intensity that it may have; infinite where a light amplifies without limit
    """
    found = ["tolerance 0"] if tolerance == 0 else [domains.TOO_MUCH] if np.isinf(share) else []
    found += [] if np.isfinite(bound) else [domains.UNBOUNDED]
    found += [light_table.entry_of(light).reason_for_float64(light) for light in lights]
    found.append(reflection_table.entry_of(material).reason_for_float64(material))
    return tuple(dict.fromkeys(reason for reason in found if reason))


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
