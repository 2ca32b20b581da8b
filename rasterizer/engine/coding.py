"""How one view is coded: what visibility entries and records hold, and how linear colour becomes 8 bits."""

import numpy as np

from ..pipeline.encode import RANGE_CLAMP, RANGE_GLOBAL, RANGE_LOCAL, Encoding, with_blank
from ..pipeline.gradients import (
    EXACT,
    IN_ENTRIES,
    NEEDS_DOUBLE,
    NEEDS_SINGLE,
    Coding,
    DepthScale,
    LevelCoding,
    NormalCoding,
)
from ..pipeline.transform import DEPTH_MARGIN
from .light_table import entry_of
from .plan import Plan


def make_coding(plan: Plan, screen, tolerance) -> Coding:
    """Say what entries and records hold, for one view."""
    of_materials, depths = plan.of_materials, scale_depths(screen)
    rows = of_materials.ways, of_materials.needs, of_materials.is_double, of_materials.n_attributes
    if (of_materials.ways == EXACT).all():
        return Coding(*rows, np.zeros(len(rows[0])), None, 0.0, False, depths)
    if plan.is_lit_per_sample:
        needs_distance = any(entry_of(light).function(light).needs_position for light in plan.lights)
        albedo_tolerance = float(tolerance / 4 / max(plan.bound, 1e-30))
        return NormalCoding(*rows, of_materials.normal_limits, None, albedo_tolerance, needs_distance, depths)
    limits = np.maximum(0.0, tolerance - of_materials.roundings)
    return LevelCoding(*rows, limits, float(plan.level_scale), 0.0, False, depths)


def make_exact_coding(screen, n_attribute) -> Coding:
    """Say that all records are exact, as for buffers."""
    return _plain_coding(Coding, EXACT, True, n_attribute, None, screen)


def make_map_coding(screen) -> Coding:
    """Say that entries hold depths and nothing else, as for shadow maps."""
    return _plain_coding(LevelCoding, IN_ENTRIES, False, 0, 1.0, screen)


def _plain_coding(kind, way, is_double, n_attribute, level_scale, screen) -> Coding:
    """The coding of passes in which all is of one material."""
    needs = NEEDS_DOUBLE if is_double else NEEDS_SINGLE
    rows = np.array([way], np.uint8), np.array([needs], np.uint8), np.array([is_double]), np.array([n_attribute])
    return kind(*rows, np.full(1, np.inf), level_scale, 0.0, False, scale_depths(screen))


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
