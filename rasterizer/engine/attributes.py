"""What goes from the points of surfaces to the samples: attributes, and how visibility entries and records hold them.

Attributes are interpolated over the triangles. Flat shading lights the centroids of faces, Gouraud's method the
vertices, before anything is drawn: these hand on intensities. Phong's method hands on the normals, and behind them what
else a sample needs: colours, texture coordinates, tangents. A coding says which materials have attributes in entries,
in planes or in exact records, and how far each may be off; an encoding how linear colour becomes 8 bits.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..cores import MIN_PART
from ..pipeline.fragments import make_batch
from ..pipeline.gradients import (
    EXACT,
    HAS_ALBEDO,
    HAS_COLORS,
    Coding,
    DepthScale,
)
from ..pipeline.lighting import SurfacePoints, light_points
from ..pipeline.resolve import RANGE_CLAMP, RANGE_GLOBAL, RANGE_LOCAL, Encoding, with_blank
from ..pipeline.textures import TextureCoding
from ..pipeline.transform import DEPTH_MARGIN
from .plan import Plan
from .reflections import is_metallic

NONE = np.empty((1, 0, 0))  # no attributes
DARKEST = 2.0**-40  # what a black texture counts as bright as


def light_all(geometry, plan, lightings, screen, n_side, normal_offsets, threads) -> NDArray[np.float64]:
    """Evaluate the illumination equation at all points, before they are drawn.

    Parameters
    ----------
    lightings : {dtype: Lighting}, for each of the plan's types
    n_side : 1, or 2 where normals may have to be flipped: side 1 has the intensities of flipped normals
    normal_offsets : (2, n_point) float64, scene units, see geometry/surfaces.py; empty where no light casts shadows

    Returns
    -------
    (n_side, n_point, n_attribute): n_channel intensities, linear, computed in the type of their material; of one with
    one channel the first is written alone. With textures 2 n_channel + 2: of textured surfaces what a black one gives
    off, what the whole one gives off, texture coordinates
    """
    groups = list_groups(geometry)
    textured = [group for group in groups if plan.tables.materials[group.material].texture is not None]

    def light_here(geometry, groups):
        return light(geometry, plan, lightings, screen, n_side, normal_offsets, threads, groups)

    found = light_here(geometry, groups)
    if textured:
        # What is left where nothing is reflected diffusely: the texture doesn't weaken it.
        rest = light_here(geometry._replace(albedo=blank(geometry.albedo.shape, textured)), textured)
        found = join(geometry.uv, groups, textured, found, rest)
    return found


def join(uv, groups, textured, whole, rest) -> NDArray[np.float64]:
    """Put what groups of points have side by side where some are textured: see `light_all`.

    `whole` are the intensities of all groups, `rest` those of black surfaces, of the textured groups.
    """
    n_side, n_point, n_channel = whole.shape
    out = blank((n_side, n_point, 2 * n_channel + 2), groups)
    for group in groups:
        here = slice(group.start, group.end)
        out[:, here, :n_channel] = whole[:, here]
    for group in textured:
        here = slice(group.start, group.end)
        out[:, here, : rest.shape[2]] = rest[:, here]
        out[:, here, n_channel : 2 * n_channel] = whole[:, here]
        out[:, here, 2 * n_channel :] = uv[here, :2]
    return out


def blank(shape, groups) -> NDArray[np.float64]:
    """Return an array (..., n_point, n_value) that holds zeros for the points of some groups, and anything for others:
    a few points in a large scene are cheap."""
    out = np.empty(shape)
    for group in groups:
        out[..., group.start : group.end, :] = 0
    return out


class Group(NamedTuple):
    """Points start..end, all of one material."""

    material: int
    start: int
    end: int


def list_groups(geometry) -> list[Group]:
    """List the groups of points of a geometry."""
    offsets = geometry.point_offsets.tolist()
    return [Group(*group) for group in zip(geometry.group_material.tolist(), offsets[:-1], offsets[1:], strict=True)]


def light(geometry, plan, lightings, screen, n_side, normal_offsets, threads, groups) -> NDArray[np.float64]:
    """Light the points of some groups: (n_side, n_point, n_channel); see `light_all`."""
    of_materials = plan.of_materials
    n_channel = 3 if any(of_materials.features[group.material] & HAS_COLORS for group in groups) else 1
    intensities = blank((n_side, len(geometry.normals), n_channel), groups)
    tangents = geometry.tangents if plan.has_tangents else None
    points = SurfacePoints(geometry.points, geometry.normals, tangents, geometry.albedo, normal_offsets)
    least = MIN_PART // max(1, len(plan.tables.lights))  # points that are worth a thread of its own
    pieces = [
        Group(group.material, group.start + first, group.start + end)
        for group in groups
        for first, end in threads.ranges(group.end - group.start, least)
    ]

    def light_bundle(bundle):
        batches = {dtype: make_batch(dtype) for dtype in lightings}
        for side, out in enumerate(intensities):
            sign = 0 if plan.options.is_flat else 1 - 2 * side
            for material, start, end in bundle:
                dtype = np.dtype(np.float64 if of_materials.is_double[material] else np.float32)
                light_points(points, (start, end), screen, sign, lightings[dtype], material, batches[dtype], out)

    threads.map(light_bundle, bundles_of(pieces, least))
    return intensities


def bundles_of(pieces: list[Group], least: int) -> list[list[Group]]:
    """Put neighbouring pieces together, until a bundle has `least` points."""
    bundles: list[list[Group]] = []
    room = 0
    for piece in pieces:
        if room <= 0:
            bundles.append([])
            room = least
        bundles[-1].append(piece)
        room -= piece.end - piece.start
    return bundles


def join_attributes(geometry, n_attribute: int) -> NDArray[np.float64]:
    """Return the first attributes of all points, (1, n_point, n_attribute): normals, behind them the model's colours,
    texture coordinates and tangents, 3 to 13."""
    columns = [geometry.normals]
    for column in (geometry.albedo, geometry.uv, geometry.tangents):
        if len(column) == len(geometry.normals) and n_attribute > 3:
            columns.append(column)
    joined = np.concatenate(columns, axis=1) if len(columns) > 1 else geometry.normals
    return np.ascontiguousarray(joined[None, :, :n_attribute])


def turn_to_viewer(geometry, view, screen) -> NDArray[np.float64]:
    """Return normals of flat faces, towards the viewer, (2, n_point, 3); side 1 is reversed: that is flipped."""
    away = (geometry.points - view.eye) if screen.is_perspective else view.forward
    toward = np.where((geometry.normals * away).sum(axis=1, keepdims=True) > 0.0, -geometry.normals, geometry.normals)
    return np.stack([toward, -toward])


# ---------------------------------------------------------------- how entries, records and bytes hold them

NO_DEPTHS = DepthScale(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, True)  # of no view


def make_coding(plan: Plan, tolerance) -> Coding:
    """Say what entries and records hold, but for depths, which each view has of its own: `scale_depths`.

    What rounding leaves of the tolerance is shared: a quarter is for normals, a quarter for colours that are given with
    the model, the rest for textures. Or all is for intensities; with textures a quarter: where a triangle bends them by
    more they have weights, and err by next to nothing. Texture coordinates aren't rounded to float32: large pictures
    need many digits of them.
    """
    of_materials, n_material = plan.of_materials, len(plan.tables.materials)
    reads_double = of_materials.is_double | of_materials.is_textured
    rows = of_materials.paths, of_materials.features, reads_double, of_materials.n_attributes
    level_scale = 0.0 if plan.is_lit_per_sample else float(plan.level_scale)
    if of_materials.is_double.all():
        return Coding(*rows, np.zeros(n_material), level_scale, 0.0, False, None, NO_DEPTHS, is_exact=True)
    left = tolerance * (1.0 - np.where(of_materials.is_double, 1.0, of_materials.shares))
    brightest = max(plan.bound, 1e-30)
    if plan.is_lit_per_sample:
        has_albedo = (of_materials.features & HAS_ALBEDO) != 0
        of_textures = left - np.where(has_albedo, tolerance / 2, tolerance / 4)
        albedo_tolerance = float(tolerance / 4 / brightest)
        needs_distance = plan.needs_position or plan.cue is not None
        textures = code_textures(plan, of_textures)
        rest = albedo_tolerance, needs_distance, textures, NO_DEPTHS
        return Coding(*rows, of_materials.normal_limits, level_scale, *rest, is_exact=False)
    limits = np.where(of_materials.is_textured, left / 4, left)
    textures = code_textures(plan, left * 3 / 4)
    return Coding(*rows, limits, level_scale, 0.0, plan.cue is not None, textures, NO_DEPTHS, is_exact=False)


def code_textures(plan: Plan, limits) -> TextureCoding | None:
    """Say which texture coordinates may stand in planes; `limits` are those of errors of intensities, (n,)."""
    if plan.textures is None or not (plan.of_materials.is_textured & (plan.of_materials.paths != EXACT)).any():
        return None
    slopes = texel_slopes(plan) / max(plan.tables.max_texel, DARKEST)
    return TextureCoding(plan.textures, limits / np.maximum(slopes, 1e-30))


def texel_slopes(plan: Plan) -> NDArray[np.float64]:
    """Return what an intensity of each material changes by, at most, where its texture changes by the largest component
    of all textures, (n_material,): that is in what they reflect.

    Colours multiply what is reflected diffusely, and F0 of a metal; other highlights keep their light.
    """
    intensities = plan.intensities
    is_metal = np.array([is_metallic(material) for material in plan.tables.materials])
    with np.errstate(over="ignore"):
        metal = np.where(is_metal, intensities.specular.sum(axis=1), 0.0)
        return intensities.undirected + intensities.diffuse.sum(axis=1) + metal


def scale_depths(screen) -> DepthScale:
    """Say what the z of an entry means in one view."""
    has_range = screen.z_scale != 0
    inverse = 1.0 / screen.z_scale if has_range else 0.0
    line = (-screen.z_offset * inverse, inverse)
    if not screen.is_perspective:
        return DepthScale(1.0, 0.0, *(line if has_range else (screen.near, 0.0)), 1.0, 0.0, False)
    if not has_range:
        return DepthScale(1.0 / screen.near, 0.0, 0.0, 0.0, 1.0, 0.0, True)
    nearest = screen.z_scale / (DEPTH_MARGIN - screen.z_offset)  # that a z-buffer has room for
    return DepthScale(*line, 0.0, 0.0, nearest * line[0], nearest * line[1], True)


def make_encoding(plan: Plan, background, color_range, scale=1.0) -> Encoding:
    """Say how linear colour becomes 8 bits; `background` is a linear colour or None."""
    behind = np.array(background or (0, 0, 0), np.float32)
    policy = {"clamp": RANGE_CLAMP, "global": RANGE_GLOBAL, "local": RANGE_LOCAL}[color_range]
    is_grey = bool(np.ptp(plan.tint) == 0.0 and np.ptp(behind) == 0.0)
    return with_blank(Encoding(is_grey, plan.tint, behind, background is not None, policy, scale))
