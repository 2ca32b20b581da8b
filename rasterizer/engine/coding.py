"""How one view is coded: what visibility entries and records hold, and how linear colour becomes 8 bits."""

import numpy as np

from ..pipeline.encode import RANGE_CLAMP, RANGE_GLOBAL, RANGE_LOCAL, Encoding, with_blank
from ..pipeline.gradients import (
    IN_ENTRIES,
    IN_PLANES,
    NEEDS_ALBEDO,
    NEEDS_CORNERS,
    NEEDS_DOUBLE,
    NEEDS_SINGLE,
    BufferCoding,
    Coding,
    DepthScale,
    LevelCoding,
    NormalCoding,
)
from ..pipeline.texture_packing import ALWAYS
from ..pipeline.texture_planes import TextureCoding
from ..pipeline.textures import FILTER_NEAREST, Textures
from ..pipeline.transform import DEPTH_MARGIN
from .plan import Plan

NO_DEPTHS = DepthScale(1.0, 0.0, 0.0, 0.0, 1.0, 0.0)  # of no view


def make_coding(plan: Plan, tolerance, step=1.0) -> Coding:
    """Say what entries and records hold, but for depths, which each view has of its own: `scale_depths`.

    `step` is what `lookup_step` returns.

    What rounding leaves of the tolerance is shared: a quarter is for normals, a quarter for colours that are given with
    the model, the rest for textures. Or all is for intensities; with textures a quarter: where a triangle bends them by
    more they have weights, and err by next to nothing.
    """
    of_materials, n_material = plan.of_materials, len(plan.materials)
    rows = of_materials.ways, of_materials.needs, of_materials.reads_double, of_materials.n_attributes
    if of_materials.is_double.all():  # so all are exact
        return Coding(*rows, np.zeros(n_material), None, 0.0, False, None, NO_DEPTHS)
    left, brightest = np.maximum(0.0, tolerance - of_materials.roundings), max(plan.bound, 1e-30)
    if plan.is_lit_per_sample:
        has_albedo = (of_materials.needs & NEEDS_ALBEDO) != 0
        of_textures = left - np.where(has_albedo, tolerance / 2, tolerance / 4)
        albedo_tolerance = float(tolerance / 4 / brightest)
        return NormalCoding(
            *rows, of_materials.normal_limits, None, albedo_tolerance, plan.needs_position or plan.cue is not None,
            code_textures(plan, of_textures, step), NO_DEPTHS,
        )  # fmt: skip
    limits = np.where(of_materials.is_looked_up, left / 4, left)
    textures = code_textures(plan, left * 3 / 4, step)
    return LevelCoding(*rows, limits, float(plan.level_scale), 0.0, plan.cue is not None, textures, NO_DEPTHS)


def lookup_step(factor, is_shaded_once) -> float:
    """Return how many samples it is from one look-up of a texture to the next: a pixel's where it is shaded once.

    Slopes are multiplied by that in float32: rounded by u = 2^-24 where it is 3. That is an eighth of what
    `texture_planes.slope_rounding` counts, and is added.
    """
    return factor * (1.0 + 1.0 / 8.0) if is_shaded_once and factor > 1 else 1.0


def code_textures(plan: Plan, limits, step) -> TextureCoding | None:
    """Say which materials have texture coordinates that may stand in planes; `limits` are those of errors of
    intensities, (n,); `step` what `lookup_step` returns.

    Where a texture lets light through, that is of none: an error of alpha weights all that is behind, once for each
    layer, so that no share of the tolerance is enough for any number of them.
    """
    if plan.packed_textures is None:
        return None
    has_alpha = [material.texture is not None and material.texture.has_alpha for material in plan.materials]
    limits = np.where(has_alpha, 0.0, limits / max(plan.bound, 1.0))
    of_materials = np.where(plan.of_materials.is_looked_up, plan.textures.of_materials, -1)
    is_good = of_materials >= 0
    packed, textures = plan.packed_textures, of_materials[is_good]
    is_blended = packed.filters[textures] != FILTER_NEAREST  # next to a texel's edge, nothing but exact will do
    is_good[is_good] = is_blended & (packed.errors[textures, int(ALWAYS)] <= limits[is_good])
    return TextureCoding(packed, of_materials, limits, is_good, step)


def sampled_in_double(textures: Textures, coding: Coding) -> Textures | None:
    """The textures without those that exact records look up in float32, too; None where there are no others."""
    looked_up = getattr(coding, "textures", None)
    if looked_up is None:
        return textures
    of_materials = np.where(looked_up.is_exact_looked_up, -1, textures.of_materials)
    return textures._replace(of_materials=of_materials) if (of_materials >= 0).any() else None


def make_buffer_coding(screen, n_attribute) -> BufferCoding:
    """Say that entries hold indices of triangles, as for buffers; with attributes all have exact records, too."""
    needs = NEEDS_DOUBLE | (NEEDS_CORNERS if n_attribute > 0 else 0)
    return _plain_coding(BufferCoding, IN_PLANES, needs, n_attribute, None, screen)


def make_map_coding(screen) -> Coding:
    """Say that entries hold depths and nothing else, as for shadow maps."""
    return _plain_coding(LevelCoding, IN_ENTRIES, NEEDS_SINGLE, 0, 1.0, screen)


def _plain_coding(kind, way, needs, n_attribute, level_scale, screen) -> Coding:
    """The coding of passes in which all is of one material."""
    is_double = needs & NEEDS_DOUBLE != 0
    rows = np.array([way], np.uint8), np.array([needs], np.uint8), np.array([is_double]), np.array([n_attribute])
    return kind(*rows, np.full(1, np.inf), level_scale, 0.0, False, None, scale_depths(screen))


def scale_depths(screen) -> DepthScale:
    """Say what the z of an entry means in one view."""
    has_range = screen.z_scale != 0
    inverse = 1.0 / screen.z_scale if has_range else 0.0
    line = (-screen.z_offset * inverse, inverse)
    if not screen.is_perspective:
        return DepthScale(1.0, 0.0, *(line if has_range else (screen.near, 0.0)), 1.0, 0.0)
    if not has_range:
        return DepthScale(1.0 / screen.near, 0.0, 0.0, 0.0, 1.0, 0.0)
    nearest = screen.z_scale / (DEPTH_MARGIN - screen.z_offset)  # that a z-buffer has room for
    return DepthScale(*line, 0.0, 0.0, nearest * line[0], nearest * line[1])


def make_encoding(plan: Plan, background, color_range, scale=1.0) -> Encoding:
    """Say how linear colour becomes 8 bits; `background` is a linear colour or None."""
    behind = np.array(background or (0, 0, 0), np.float32)
    policy = {"clamp": RANGE_CLAMP, "global": RANGE_GLOBAL, "local": RANGE_LOCAL}[color_range]
    is_grey = bool(np.ptp(plan.tint) == 0.0 and np.ptp(behind) == 0.0)
    return with_blank(Encoding(is_grey, plan.tint, behind, background is not None, policy, scale))
