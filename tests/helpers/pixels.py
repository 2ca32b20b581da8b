"""The six axes, pixels straight from the definitions, cameras with skew, and the thinnest triangles round a sample."""

import math
from dataclasses import replace

import numpy as np

from rasterizer.scene.camera import Camera

AXIS = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
AXIS |= {f"-{name}": tuple(-c for c in axis) for name, axis in AXIS.items()}


def project(camera, points, size):
    """Return (n, 2) pixels and (n,) depths of points, straight from the definitions."""
    eye, right, up, forward = camera.view()
    scale_x, scale_y, center_x, center_y, is_perspective, skew = camera.projection(size)
    r = np.asarray(points, dtype=np.float64) - eye
    depth = r @ forward
    w = depth if is_perspective else np.ones(len(r))
    x, y = center_x + (scale_x * (r @ right) - skew * (r @ up)) / w, center_y - scale_y * (r @ up) / w
    return np.stack([x, y], axis=1), depth


def needle(rng, bits, size) -> np.ndarray:
    """A triangle round one sample of a picture, of doubled area 3: no thinner one can hold a sample.

    Returns (3, 2) int64, in 1/256 px; its sides are about 2^bits long.
    """
    a, b = 0, 0
    while math.gcd(a, b) != 1 or b < 2:
        a, b = (int(v) for v in rng.integers(2 ** (bits - 1), 2**bits, 2))
    d = pow(a, -1, b)
    c = (a * d - 1) // b
    sample = 256 * rng.integers(0, size) + 128
    return np.array([sample + (a, b), sample + (c, d), sample - (a + c, b + d)])


def skewed(camera, size, lean) -> Camera:
    """A perspective camera made a calibrated one of pictures of `size`, with the skew `lean` times its fx."""
    scale_x, scale_y, center_x, center_y, *_ = camera.projection(size)
    lens = {"intrinsics": (scale_x, scale_y, center_x - 0.5, center_y - 0.5), "size": size, "skew": lean * scale_x}
    return replace(camera, **lens)
