"""How one view is coded: what visibility entries and records hold, and how linear colour becomes 8 bits."""

import numpy as np

from ..pipeline.encode import RANGE_CLAMP, RANGE_GLOBAL, RANGE_LOCAL, Encoding, with_blank
from ..pipeline.gradients import CODINGS, IN_ENTRIES, LEVEL_PLANES, NORMAL_PLANES, Coding
from .light_table import entry_of
from .plan import Plan


def make_coding(plan: Plan, screen, tolerance) -> Coding:
    """Say what words and records hold, for one view."""
    depth_scale = depth_offset = 0.0
    if not screen.is_perspective:
        depth_scale = 1.0 / screen.z_scale if screen.z_scale != 0 else 0.0
        depth_offset = -screen.z_offset * depth_scale if screen.z_scale != 0 else screen.near
    if screen.is_perspective and screen.z_scale != 0:
        inv_w_scale, inv_w_offset = 1.0 / screen.z_scale, -screen.z_offset / screen.z_scale
    elif screen.is_perspective:
        inv_w_scale, inv_w_offset = 0.0, 1.0 / screen.near
    else:
        inv_w_scale, inv_w_offset = 0.0, 1.0
    return CODINGS[plan.coding](
        kind=plan.coding,
        level_scale=plan.level_scale if plan.coding in (IN_ENTRIES, LEVEL_PLANES) else None,
        level_tolerance=float(max(0.0, tolerance - plan.rounding) * plan.level_scale),
        normal_limit=float(plan.normal_limit) if plan.coding == NORMAL_PLANES else None,
        albedo_tolerance=tolerance / 4 / max(plan.bound, 1e-30),
        needs_distance=plan.coding == NORMAL_PLANES
        and (plan.has_shadows or any(entry_of(light).function(light).needs_position for light in plan.lights)),
        inv_w_offset=inv_w_offset,
        inv_w_scale=inv_w_scale,
        depth_offset=depth_offset,
        depth_scale=depth_scale,
    )


def make_encoding(plan: Plan, background, color_range, scale=1.0) -> Encoding:
    """Say how linear colour becomes 8 bits; `background` is a linear colour or None."""
    behind = np.array(background or (0, 0, 0), np.float32)
    policy = {"clamp": RANGE_CLAMP, "global": RANGE_GLOBAL, "local": RANGE_LOCAL}[color_range]
    is_grey = bool(plan.n_channel == 1 and np.ptp(plan.tint) == 0.0 and np.ptp(behind) == 0.0)
    return with_blank(Encoding(is_grey, plan.tint, behind, background is not None, policy, scale))
