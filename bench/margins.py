"""Where a picture's surfaces lie so near to each other that depth can't tell which one is in front.

There the renderer and the reference may each show the other surface, and no difference of colour says anything.
"""

import numpy as np

from rasterizer.engine.depth_range import screen_of
from rasterizer.engine.points import gather_geometry

UNITS = 2.0**14  # steps of the z-buffer: half a step of rounding for each sample of the largest box


def depth_resolution(scene, size, depth, units=UNITS) -> np.ndarray:
    """Depth (h, w) that `units` of the z-buffer stand for at the depths (h, w) of a picture."""
    camera, bounds = scene.camera_for(size), np.stack([mesh.bounds for mesh in scene.meshes])
    screen, _ = screen_of(camera, camera.view(), size, gather_geometry(scene.meshes, True), bounds)
    step = units / abs(screen.z_scale) if screen.z_scale != 0.0 else 0.0
    return np.where(np.isfinite(depth), depth, 0.0) ** 2 * step if camera.is_perspective else np.full(depth.shape, step)


def clear_pixels(scene, size, samples, draw, units=UNITS) -> np.ndarray:
    """Tell of which pixels (h, w) every sample shows clearly what is in front.

    Parameters
    ----------
    scene : Scene
    size : (width, height) in pixels
    samples : 1, 4, 9 or 16 samples a pixel
    draw : function from a size to the reference's picture of the scene with one sample a pixel
    units : steps of the z-buffer that surfaces must lie apart
    """
    per_axis = round(samples**0.5)
    grid = size[0] * per_axis, size[1] * per_axis
    fine = draw(grid)
    is_clear = fine.margin > depth_resolution(scene, grid, fine.depth, units)
    return is_clear.reshape(size[1], per_axis, size[0], per_axis).all(axis=(1, 3))
