"""What `Stats.error_bounds` says of each output of a picture, against the reference: help for the campaign."""

import numpy as np

from helpers.campaign_steps import next_to_step


def output_ratios(case, frame, expected, is_clear, find_clear) -> dict[str, float]:
    """Return the largest error of each output over its bound, {name: ratio}.

    Compared are pixels in which it is clear which surface is in front, and bytes that don't lie next to a step.

    Parameters
    ----------
    case : helpers.campaign_scenes.Case without shadows
    frame : with all outputs
    expected : reference.Picture
    is_clear : (height, width) bool, of the pixels' centres
    find_clear : what returns the same of all samples, where bytes are off
    """
    bounds = frame.stats.error_bounds
    is_seen = is_clear & (expected.face >= 0)
    found = {"face": largest((frame.face != expected.face)[is_seen], bounds.face)}
    depth, true = frame.depth[is_seen].astype(float), expected.depth[is_seen]
    found["depth"] = largest(np.abs(depth - true), bounds.depth)
    found["depth_share"] = largest(np.abs(depth - true) / np.abs(true), bounds.depth_share)
    normal = np.abs(frame.normal - expected.normal).max(axis=-1)
    is_unit = is_seen & (np.linalg.norm(expected.normal, axis=-1) > 0.5)
    found["normal"] = largest(normal[is_unit], bounds.normal)
    is_whole = is_clear & (expected.alpha == 1.0) & (frame.alpha == 1.0)
    levels = np.abs(frame.rgb.astype(int) - expected.rgb.astype(int)).max(axis=-1)
    if bounds.rgb is not None and (is_whole & (levels > bounds.rgb)).any():
        is_whole &= find_clear() & ~next_to_step(case, frame.stats.steps)
    found["rgb"] = largest(levels[is_whole], bounds.rgb)
    return found


def largest(errors, bound) -> float:
    """Return the largest error over its bound; 0 where both are 0, or no bound is stated."""
    if bound is None:
        return 0.0
    error = float(errors.max(initial=0.0))
    return error / bound if bound else (np.inf if error else 0.0)
