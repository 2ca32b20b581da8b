"""A camera as flags of `raster render`, so that what was found by hand can be drawn again."""

import math

import numpy as np

from ..choices import Axis
from ..scene.camera import Camera

_SAME = 1e-9  # of an axis: what is lost where an angle is turned into flags and back


def camera_flags(camera: Camera, up: Axis) -> str:
    """Return the flags that say what a camera sees of a scene with this up axis.

    Returns
    -------
    text; "" where no flags say it: a calibration, a range of depth, a camera that is tilted or stands at a pole
    """
    if camera.intrinsics is not None or camera.near is not None or camera.far is not None:
        return ""
    level = Camera.perspective(camera.position, camera.target, up)
    if not np.allclose(np.stack(level.view()[1:]), np.stack(camera.view()[1:]), rtol=0.0, atol=_SAME):
        return ""
    fov = camera.fov
    if camera.height is not None:
        fov = math.degrees(2.0 * math.atan(camera.height / (2.0 * math.dist(camera.position, camera.target))))
    eye, target = (",".join(f"{value + 0.0!r}" for value in point) for point in (camera.position, camera.target))
    lens = f"--fov {fov!r}" + (" --ortho" if camera.height is not None else "")
    return f"--eye {eye} --target {target} --up {up} {lens}"
