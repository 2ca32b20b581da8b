"""The render plan: what this scene needs, and nothing else.

    tables ─ make_plan: what holds in any view ─ Plan.with_shares: float64 where one view asks for it

Found here: the type, the channels and the path to the samples of each material. So what one object needs costs its own
samples, and not those of others. When float32 is enough stands in domains.py. Below that stands the plan in words and
counts, for a person who asks what was done and why.
"""

from collections import Counter
from collections.abc import Callable
from itertools import chain, compress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError, counted
from ..options import Options
from ..pipeline import gradients as g
from ..pipeline.a_buffer import Opacity, min_transmittance
from ..pipeline.shade import Cue
from ..pipeline.textures import Textures
from ..pipeline.visibility import INTENSITY_MASK
from . import domains
from .domains import Intensities
from .scene_tables import SceneTables, common_direction
from .texture_tables import make_textures

PICTURES = frozenset(("color", "rgb"))  # the other outputs are exact buffers
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
    dtypes: tuple[np.dtype, ...]  # those that materials are lit in


class Plan(NamedTuple):
    """What this scene needs."""

    tables: SceneTables
    options: Options
    of_materials: MaterialTable
    dtype: np.dtype  # of intensities: float64 where all materials need it
    clearances: NDArray[np.float64]  # (n_material, n_light), see domains.py
    intensities: Intensities
    is_lit_per_sample: bool  # by Phong's method
    n_channel: int  # the most that any material needs
    tint: NDArray[np.float32]  # (3,): the colour of what has one channel
    intensity_scale: float  # intensity steps a unit
    bound: float  # the largest intensity that any point can have
    needs_position: bool  # lighting reads the positions of points
    has_tangents: bool  # some material is brushed along u
    textures: Textures | None  # None where the scene has none, or nobody reads them
    metals: Textures | None  # of how metallic and rough materials are; None where the scene has none
    opacity: Opacity | None  # None where all is opaque
    cue: Cue | None  # None where nothing fades with depth

    def with_shares(self, shares: NDArray[np.float64], why: str) -> "Plan":
        """Return the plan with other shares of the tolerance, (n_material,), infinite where float64 is needed; `why` is
        the reason of those that need it now."""
        table, is_double = self.of_materials, np.isinf(shares)
        reasons = list(table.reasons)
        for k in np.flatnonzero(is_double & ~table.is_double):
            reasons[k] = (*reasons[k], why)
        of_type = np.where(is_double, g.DOUBLE_PRECISION, g.SINGLE_PRECISION).astype(np.uint8)
        table = table._replace(
            paths=np.where(is_double, np.uint8(g.EXACT), table.paths),
            features=table.features & np.uint8(255 - g.DOUBLE_PRECISION - g.SINGLE_PRECISION) | of_type,
            shares=shares,
            reasons=tuple(reasons),
            is_double=is_double,
            dtypes=(FLOAT32,) * bool((~is_double).any()) + (FLOAT64,) * bool(is_double.any()),
        )
        return self._replace(of_materials=table, dtype=table.dtypes[0])


def make_plan(
    tables: SceneTables,
    options: Options,
    clearances: NDArray[np.float64] | None = None,
    run: Callable = map,
    like: Plan | None = None,
) -> Plan:
    """Find out what a scene needs.

    Parameters
    ----------
    clearances : (n_material, n_light), how near lights are; None = as `domains.measure_clearances` finds it
    run : see `make_textures`
    like : of the same meshes and options, whose textures are taken

    Raises SceneError where the picture's intensities may be too large for float32.
    """
    materials, cue = tables.materials, tables.depth_cue
    clearances = domains.measure_clearances(tables) if clearances is None else clearances
    fades_to = max(cue.color) if cue is not None else 0.0
    with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is refused
        intensities = domains.bound_intensities(tables, clearances, options.shading == "phong")
    brightest = max(intensities.unweakened, fades_to)
    if not brightest <= LARGEST:
        raise SceneError(
            f"the scene's lights and materials may give intensities up to {brightest:.3g}; legal is up to "
            f"{LARGEST:.3g}, the largest float32: give lights and materials smaller colors"
        )
    bound = max(float(intensities.of_materials.max(initial=0.0)), fades_to)
    tint, is_colored = choose_tint(tables)
    table = list_needs(tables, options, intensities, is_colored)
    n_channel = 3 if is_colored.any() else 1
    max_level = bound * (1.0 + options.tolerance) + options.tolerance  # rounding may add half of the tolerance
    needs_position, has_tangents, textures, metals = tables.has_shadows, False, None, None
    for i in tables.lit_by:
        needs_position |= bool(tables.light_types[i].needs_position)
    for material in materials:
        has_tangents |= material.is_anisotropic and material.tangent == "u"
    # Of buffers alone nobody sees colours.
    needs_texels = bool(PICTURES & set(options.outputs)) or tables.has_cut_outs or options.min_opacity > 0.0
    if like is not None:
        textures, metals = like.textures, like.metals
    elif tables.has_texture.any() and needs_texels:
        textures = make_textures([material.texture for material in materials], run=run)
        metals = make_textures([material.metallic_roughness for material in materials], tables.n_texcoord, run)
    if cue is not None:  # with one channel its colour is a multiple of the tint, whose largest component is 1
        cue = Cue(cue.scale, cue.start, np.array(cue.color if n_channel == 3 else [max(cue.color)], np.float64))
    plan = Plan(
        tables=tables,
        options=options,
        of_materials=table,
        dtype=FLOAT32,
        clearances=clearances,
        intensities=intensities,
        is_lit_per_sample=options.shading == "phong",
        n_channel=n_channel,
        tint=tint,
        intensity_scale=(int(INTENSITY_MASK) - 1) / max_level if 0.0 < max_level < np.inf else 1.0,
        bound=bound,
        needs_position=needs_position,
        has_tangents=has_tangents,
        textures=textures,
        metals=metals,
        opacity=None if tables.is_opaque else list_opacities(tables, min_transmittance(bound)),
        cue=cue,
    )
    return plan.with_shares(np.where(table.is_double, np.inf, table.shares), "")


def choose_tint(tables: SceneTables) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Choose the tint (3,) that most materials have, so that one channel is enough for these; return it, and which
    materials need three channels, (n_material,)."""
    tints, counts = [*map(tables.tint_of, range(len(tables.materials)))], Counter()
    for tint in tints:
        if tint is not None:
            counts[tuple(tint)] += 1
    is_colored = np.ones(len(tints), np.bool_)
    if not counts:
        return np.ones(3, np.float32), is_colored
    chosen = np.array(max(counts, key=counts.__getitem__))
    for k, tint in enumerate(tints):
        is_colored[k] = tint is None or common_direction([tint, chosen]) is None
    return chosen.astype(np.float32), is_colored


def list_opacities(tables: SceneTables, least: float) -> Opacity:
    """How transparent the materials are; see pipeline/a_buffer.py for `least`."""
    opacity = np.array([material.opacity for material in tables.materials])
    is_opaque = np.array([material.is_opaque for material in tables.materials], np.bool_)
    return Opacity(opacity, is_opaque, tables.has_texture, least)


# ---------------------------------------------------------------- what each material needs


def list_needs(
    tables: SceneTables, options: Options, intensities: Intensities, is_colored: NDArray[np.bool_]
) -> MaterialTable:
    """Find out what each material needs in any view, but for what its type decides: see `Plan.with_shares`.

    No error of texture coordinates is small enough next to the border of texels that are not blended, and of alpha, as
    it weights all that is behind, once for each layer: so such materials have exact setups.
    """
    is_phong, tolerance = options.shading == "phong", options.tolerance
    angles = tolerance / 4 / np.maximum(intensities.slopes, 1e-30)
    if tables.has_shadows:  # which depend on normals, however dim the lights are
        angles = np.minimum(angles, MAX_TURN)
    normal_limits = angles / (np.sqrt(3.0) * domains.SINGLE)
    shares = domains.share_of_tolerance(intensities.roundings, tolerance)
    has_albedo, has_texture = tables.has_vertex_colors | tables.has_texture, tables.has_texture
    with_tangents = 6 + 3 * bool(has_albedo.any()) + tables.n_texcoord * bool(has_texture.any())
    features = g.HAS_COLORS * is_colored + g.HAS_ALBEDO * tables.has_vertex_colors + g.HAS_TEXTURE * has_texture
    # Attributes, see `join_attributes`: normals, colours, texture coordinates, tangents; or intensities, and these.
    n_attributes = np.where(has_albedo, 6, 3) if is_phong else np.where(is_colored, 3, 1)
    n_attributes[has_texture] = 8
    paths = np.full(len(features), g.IN_PLANES)
    if is_phong:
        paths[~(normal_limits > 3.0)] = g.EXACT
    reasons: list[tuple[str, ...]] = []
    for k, material in enumerate(tables.materials):
        if not is_phong and material.is_opaque and not is_colored[k]:
            paths[k] = g.IN_PACKED
        if not material.is_opaque:
            features[k] += g.IS_TRANSPARENT if material.opacity > 0.0 else g.IS_INVISIBLE
        if material.texture is not None and (material.texture.filter == "nearest" or material.texture.has_alpha):
            paths[k] = g.EXACT
        if is_phong and material.is_anisotropic and material.tangent == "u":
            n_attributes[k] = with_tangents
        if material.metallic_roughness is not None:
            n_attributes[k] = 6 + tables.n_texcoord
        reasons.append(domains.reasons_of(tables, k, tolerance, shares[k], intensities.of_materials[k]))
    return MaterialTable(
        paths.astype(np.uint8), features.astype(np.uint8), n_attributes, normal_limits, shares, tuple(reasons),
        has_albedo, is_colored, np.array([*map(bool, reasons)]), (),
    )  # fmt: skip


# ---------------------------------------------------------------- the plan in words and counts


class PathCounts(NamedTuple):
    """Triangles by the path that their attributes took, counted in each band that they meet.

    Parameters
    ----------
    packed : those with intensities in the packed samples of the visibility buffer
    planes : those with setups of planes
    exact : those with exact setups
    """

    packed: int
    planes: int
    exact: int


class PlanSummary(NamedTuple):
    """What a picture needed, and nothing else was computed.

    Parameters
    ----------
    shading : "flat", "gouraud" or "phong"
    channels : 1 where every colour of the picture is a multiple of one RGB triple, else 3
    dtype : the type of the illumination: "float32", or "float64" where all materials need that
    materials : how many different ones there are
    doubles : how many of these are lit in float64
    reasons : why some material needs float64; empty where none does
    path : the cheapest one that attributes of any material may take from the vertices to the samples
    features : what else the scene uses: "textures", "shadows", "transparency", "depth cueing", "spectra", "tangents"
    bound : the largest intensity that any point may have, linear
    lights : how many lights are reflected; of an area light each of its cells counts
    left_out : how many lights were left out of everything: black ones, and others of which nothing is reflected
    paths : how many triangles took which path; None before anything was drawn
    """

    shading: str
    channels: int
    dtype: str
    materials: int
    doubles: int
    reasons: tuple[str, ...]
    path: str
    features: tuple[str, ...]
    bound: float
    lights: int
    left_out: int
    paths: PathCounts | None = None

    def __repr__(self) -> str:
        why = f" because of {', '.join(self.reasons)}" if self.reasons else ""
        of_doubles = f"{self.doubles} in float64{why}" if self.doubles else "all in float32"
        lines = [
            f"{self.shading} shading, {counted(self.channels, 'channel')}; {self.path}",
            f"{counted(self.materials, 'material')}, {of_doubles}; {counted(self.lights, 'light')}",
            f"also: {', '.join(self.features) or 'nothing'}",
            f"largest intensity: {self.bound:.4g}",
        ]
        if self.left_out:
            lines.append(f"left out: {counted(self.left_out, 'light')} that no surface shows")
        if self.paths is not None:
            packed, planes, exact = self.paths
            counts = f"{packed} by packed samples, {planes} by planes, {exact} by exact setups"
            lines.append(f"triangles in their bands: {counts}")
        return "\n".join(lines)


def summarize(plan: Plan) -> PlanSummary:
    """Put a plan into words."""
    tables, table, n_light = plan.tables, plan.of_materials, len(plan.tables.reflected_lights)
    features = {
        "textures": bool(tables.has_texture.any()),
        "shadows": tables.has_shadows,
        "transparency": plan.opacity is not None,
        "depth cueing": plan.cue is not None,
        "spectra": tables.products is not None,
        "tangents": plan.has_tangents,
    }
    path = "exact setups"
    if (table.paths == g.IN_PACKED).any():
        path = "one intensity in each packed sample"
    elif (table.paths == g.IN_PLANES).any():
        path = "planes of the normals" if plan.is_lit_per_sample else "planes of the intensities"
    return PlanSummary(
        shading=plan.options.shading,
        channels=plan.n_channel,
        dtype=str(plan.dtype),
        materials=len(tables.materials),
        doubles=int(table.is_double.sum()),
        reasons=tuple(dict.fromkeys(chain(*table.reasons))),
        path=path,
        features=tuple(compress(features, features.values())),
        bound=plan.bound,
        lights=n_light,
        left_out=tables.n_black + len(tables.lights) - n_light,
    )
