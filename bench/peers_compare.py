"""Did two renderers draw the same? Covered pixels are counted, and pictures compared where no silhouette is.

A silhouette is where a pixel or one of its eight neighbours isn't covered in full, or where depth jumps: renderers
round vertices differently, and then see another surface there.
"""

import numpy as np
from PIL import Image

# A surface whose depth changes by more widths of a pixel from one pixel to the next is a silhouette: it is seen at less
# than 7°, and a step of 1/256 px, by which vertices may differ, is 1/32 px in depth.
STEEPEST = 8.0
# Part of the covered pixels by which counts may differ. An edge that is rounded otherwise lies 1/256 px away at most,
# so 1/256 of a silhouette's pixels change; where a quarter of the covered pixels belong to one, 1/1024 of them.
MAX_MORE = 0.001
# Part of the pixels compared that may differ by more than one level: texels and colours are rounded to 8 bits, and both
# roundings together may make more than one level.
MAX_OVER_ONE = 0.01
AMPLIFIED = 32  # times the difference in the pictures that are saved


def compare(ours: dict, peer: dict, setup) -> dict:
    """Compare two pictures.

    Parameters
    ----------
    ours : `rgba` (height, width, 4) uint8, and `depth` (height, width) float32, scene units, inf where nothing is
    peer : `rgba`
    setup : the camera's

    Returns
    -------
    covered : pixels covered by us, in fractions where a pixel has several samples; covered_peer by the other
    compared : pixels compared; max, rms of their differences in 8-bit sRGB levels; over_one the part of those pixels
    that differ by more than one level. None where nothing is compared
    """
    counts = [float(picture["rgba"][..., 3].sum(dtype=np.int64)) / 255 for picture in (ours, peer)]
    away = ~_silhouettes(ours, peer, setup)
    found = {"covered": counts[0], "covered_peer": counts[1], "compared": int(away.sum())}
    if not away.any():
        return found | {"max": None, "rms": None, "over_one": None}
    difference = _difference(ours, peer)[away]
    return found | {"max": int(difference.max()), "rms": float(np.sqrt(np.mean(difference.astype(np.float64) ** 2))),
                    "over_one": float(np.mean(difference.max(axis=1) > 1))}  # fmt: skip


def warnings_of(found: dict) -> list[str]:
    """Say what differs by more than it should."""
    warnings = []
    more = abs(found["covered"] - found["covered_peer"])
    if more > MAX_MORE * max(found["covered"], found["covered_peer"]):
        warnings.append(f"{found['covered']:.0f} pixels are covered by ours, {found['covered_peer']:.0f} by the other")
    if found["over_one"] is None:
        warnings.append("no pixel is away from silhouettes: nothing was compared")
    elif found["over_one"] > MAX_OVER_ONE:
        warnings.append(f"{found['over_one']:.1%} of the pixels differ by more than one level, up to {found['max']}")
    return warnings


def save_sheet(path, ours: dict, peer: dict) -> None:
    """Write ours, the other picture, and their difference, amplified, side by side."""
    difference = np.minimum(AMPLIFIED * _difference(ours, peer), 255).astype(np.uint8)
    Image.fromarray(np.concatenate([ours["rgba"][..., :3], peer["rgba"][..., :3], difference], axis=1)).save(path)


def _difference(ours: dict, peer: dict) -> np.ndarray:
    """Absolute differences of the colours, (height, width, 3) int16."""
    return np.abs(ours["rgba"][..., :3].astype(np.int16) - peer["rgba"][..., :3])


def _silhouettes(ours: dict, peer: dict, setup) -> np.ndarray:
    """Tell which pixels are near a silhouette, (height, width) bool."""
    is_full = (ours["rgba"][..., 3] == 255) & (peer["rgba"][..., 3] == 255)
    depth = np.where(np.isfinite(ours["depth"]), ours["depth"], 0.0).astype(np.float64)
    pixel = 2.0 * depth * np.tan(np.radians(setup.fov) / 2.0) / setup.size[1]  # its width on the surface, facing us
    # From one end of the 3 × 3 pixels to the other are two steps.
    jumps = _around(depth, np.maximum) - _around(depth, np.minimum) > 2.0 * STEEPEST * pixel
    return ~_around(is_full, np.logical_and) | jumps


def _around(values: np.ndarray, join) -> np.ndarray:
    """Join each pixel with its eight neighbours by a ufunc of two arguments; the border has itself as neighbour."""
    wide = np.pad(values, 1, mode="edge")
    rows = join(join(wide[:-2], wide[1:-1]), wide[2:])
    return join(join(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:])
