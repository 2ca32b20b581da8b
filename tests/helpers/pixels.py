"""What the camera tests share: the six axes, and pixels straight from the definitions."""

import numpy as np

AXIS = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
AXIS |= {f"-{name}": tuple(-c for c in axis) for name, axis in AXIS.items()}


def project(camera, points, size):
    """Return (n, 2) pixels and (n,) depths of points, straight from the definitions."""
    eye, right, up, forward = camera.view()
    scale_x, scale_y, center_x, center_y, is_perspective = camera.projection(size)
    r = np.asarray(points, dtype=np.float64) - eye
    depth = r @ forward
    w = depth if is_perspective else np.ones(len(r))
    return np.stack([center_x + scale_x * (r @ right) / w, center_y - scale_y * (r @ up) / w], axis=1), depth
