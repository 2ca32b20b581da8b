"""Which axis of a model points upwards, by its shape: things stand on a level base."""

import numpy as np
from numpy.typing import NDArray

from ..choices import AXES

_NEAR = 1e-3  # of the extent: what lies within it of the lowest point stands on the ground
_LEVEL = 0.99  # cosine: such faces lie level, within 8 degrees
_EVIDENCE = 0.02  # share of the area that has to lie on the ground before it says what is down


def guess_up(points: NDArray[np.float64], faces: NDArray, bounds: NDArray[np.float64]) -> tuple[str | None, str]:
    """Guess which axis of a model points upwards: things stand on a level base.

    Parameters
    ----------
    points : (n_vertex, 3) float64
    faces : (n_face, 3) integers, all or some
    bounds : (2, 3) float64, lowest and highest corner of the box round the model

    Returns
    -------
    "y", "z", "-y" or "-z", or None where nothing tells; and the reason, a text

    The evidence for an axis is the area of the faces that lie level at its lowest end and face down, less that of those
    at its other end that face up: a box has as much of either, and says nothing.
    """
    corners, (low, high) = points[faces], bounds
    opposite = {"y": "-y", "z": "-z", "-y": "y", "-z": "z"}
    with np.errstate(all="ignore"):
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.linalg.norm(normals, axis=1)
        shares = {}
        for name in opposite:
            axis, sign = "xyz".index(name[-1]), float(np.sum(AXES[name]))
            bottom = low[axis] if sign > 0 else high[axis]
            is_base = (np.abs(corners[:, :, axis] - bottom) <= _NEAR * (high - low).max()).all(axis=1)
            is_base &= high[axis] - low[axis] > _NEAR * (high - low).max()  # a flat thing lies on either side
            is_base &= -sign * normals[:, axis] >= _LEVEL * areas
            shares[name] = float(areas[is_base].sum() / areas.sum())
        evidence = {name: share - shares[opposite[name]] for name, share in shares.items()}
    best = max(evidence, key=lambda name: evidence[name])
    if not evidence[best] >= _EVIDENCE:
        return None, "no level base tells"
    return best, f"{100.0 * shares[best]:.0f} % of the area is a level base"
