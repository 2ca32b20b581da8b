"""Depths: between which the scene lies, which are clipped, and how the z-buffer is fitted to those that are seen."""

import numpy as np

from ..errors import SceneError, warn_caller
from ..pipeline.clip import find_nearest
from ..pipeline.setup import DepthScale
from ..pipeline.transform import DEPTH_MARGIN, Screen, make_screen

# The fitted near plane is never nearer than this part of the furthest distance, so that depth keeps 2^-18 there; but
# for the sake of a vertex that is seen it is, down to the second.
NEAREST, NEAREST_VERTEX = 2.0**-20, 2.0**-26
MAX_DEPTH_RATIO = 2.0**40  # what is further than so many times the nearest depth that is seen is clipped
# Distances down to NEAREST of a scene's extent keep their digits in their squares, which are 2^-1000 then.
MIN_EXTENT = 2.0**-480
DEEP = 2.0**-10  # where the box round the scene spans more than this, the depths that are seen are looked for


def screen_of(camera, view, n_sample, geometry, bounds) -> tuple[Screen, bool]:
    """Return the screen of a camera, its depth fitted to the scene, and whether the fitted near plane cuts what would
    be seen; `view` is the camera's.

    Parameters
    ----------
    n_sample : (width, height) of the picture in samples
    bounds : (n_mesh, 2, 3) float64, boxes round the meshes, world space
    """
    depths, projection = depths_of_boxes(view, bounds), camera.projection(n_sample)
    (near, far), far_clip = fit_depth_range(camera, depths)
    screen, seen = fit_screen(view, projection, (near, far), far_clip, geometry, n_sample, depths)
    if camera.near is not None or seen >= near:
        return screen, False
    before = nearest_vertex(geometry.positions, view, projection, n_sample, (far * NEAREST_VERTEX, near))
    if before < near:
        screen, seen = fit_screen(view, projection, (before, far), far_clip, geometry, n_sample, depths)
    return screen, seen < before


def warn_of_cut(screen, view, projection, n_sample, positions) -> None:
    """Warn where the near plane cuts off a vertex that would be in the picture: with it, things vanish."""
    if nearest_vertex(positions, view, projection, n_sample, (np.finfo(float).tiny, screen.near)) < screen.near:
        warn_caller(
            f"what is nearer than {screen.near:.3g} isn't drawn, for the sake of depth: give the camera a near plane"
        )


def nearest_vertex(positions, view, projection, n_sample, depths) -> float:
    """Return how far away the nearest vertex in the picture lies that is between two depths, a little less; the second
    where none is."""
    least, near = depths
    distance = (positions - view.eye) @ view.forward
    relative = positions[(distance >= least) & (distance < near)] - view.eye
    depth, upward = relative @ view.forward, (relative @ view.up)
    y = projection.center_y - projection.scale_y * upward / depth
    across = relative @ view.right - projection.skew * upward * projection.scale_y / projection.scale_x
    x = projection.center_x + projection.scale_x * across / depth
    is_seen = (x >= 0) & (x <= n_sample[0]) & (y >= 0) & (y <= n_sample[1])
    return float(depth[is_seen].min() * (1 - NEAREST)) if is_seen.any() else near


def fit_depth_range(camera, depths) -> tuple[tuple[float, float], float]:
    """Return ((near, far), clip distance) in scene units: the camera's own, else fitted to the scene.

    Parameters
    ----------
    depths : (nearest, furthest) of the boxes round the meshes, scene units
    """
    nearest, furthest = depths
    if camera.is_perspective:
        furthest = furthest if furthest > 0 else 1.0
        # A little more room, so that rounding clips nothing. What a far plane cuts off does not push the near one away.
        deepest = furthest if camera.far is None else min(furthest, camera.far)
        near, far = max(nearest * (1 - NEAREST), deepest * NEAREST), furthest * (1 + NEAREST)
    else:
        margin = NEAREST * (furthest - nearest)
        near, far = max(nearest - margin, 0.0), max(furthest + margin, 0.0)
    near = near if camera.near is None else camera.near
    if camera.far is not None:
        return (near, camera.far), camera.far
    return (near, max(far, near)), np.inf


def depths_of_boxes(view, bounds) -> tuple[float, float]:
    """The depths between which boxes lie, scene units."""
    shares = (bounds - view.eye) * view.forward  # of each axis, at both ends
    return float(shares.min(axis=1).sum(axis=1).min()), float(shares.max(axis=1).sum(axis=1).max())


def are_seen_from_outside(view, screen, size, bounds) -> np.ndarray:
    """Tell of which boxes nothing lies between the eye and the part of the near plane that is in the picture: (n_mesh,)
    bool.

    That is so beyond the near plane; with perspective also where the eye is further from a box than from any corner of
    that part.

    Parameters
    ----------
    size : (width, height) of the picture in samples
    """
    is_beyond = ((bounds - view.eye) * view.forward).min(axis=1).sum(axis=1) >= screen.near
    if is_beyond.all() or not screen.is_perspective:
        return is_beyond
    x, y = np.array([0.0, size[0]]), np.array([[0.0], [size[1]]])
    upward = (screen.center_y - y) / screen.scale_y
    across = (x - screen.center_x + screen.skew * upward) / screen.scale_x
    reach = screen.near * np.sqrt(across * across + upward * upward + 1.0).max()
    return is_beyond | (np.maximum(bounds[:, 0] - view.eye, view.eye - bounds[:, 1]).max(axis=1) > reach)


def fit_screen(view, projection, depth_range, far_clip, geometry, size, depths=None) -> tuple[Screen, float]:
    """Return the screen of a view: what is nearer than `depth_range` is clipped, and the z-buffer is fitted to the
    depths that are seen; and the nearest depth that would be seen without that near plane, where it was looked for.

    So planes that somebody gives far before or behind the scene cost no digits of depth. With perspective the
    z-buffer's 38 bits are even in 1/w: they leave 2^-38 · w/near of the depth w, so near counts most. Where it is small
    beside far, the nearest depth that is seen is looked for. 1/w is rounded to 2^-53 of the nearest one, twice: a
    relative error of 2^-52 · w/near, which `Stats.error_bound` counts. What is further than MAX_DEPTH_RATIO times
    as far as the nearest that is seen is clipped: depth tells nothing of it any more.

    What lies between the near plane and the nearest depth that is seen needs a depth, too, for the planes of triangles
    that reach there; the near plane is brought so near to the range that such depths leave it by no more than 2^20
    times.

    Parameters
    ----------
    depth_range : (near, far), scene units; `far` clips only as `far_clip`
    size : (width, height) of the picture in samples
    depths : (nearest, furthest) of the boxes round the meshes, scene units; None where `depth_range` is fitted to them
        already
    """
    near, far = depth_range
    nearest, furthest = depth_range if depths is None else depths
    if not projection.is_perspective:
        margin = NEAREST * (furthest - nearest)
        fitted = max(near, nearest - margin), min(far, furthest + margin)
        return make_screen(view, projection, fitted if fitted[0] < fitted[1] else depth_range, near, far_clip), np.inf
    far = min(far, furthest * (1 + NEAREST)) if near < furthest else far
    near_clip, seen = near, np.inf
    if near < far * DEEP:
        before = min(near, far / MAX_DEPTH_RATIO)
        screen = make_screen(view, projection, (before, far), before, far_clip)
        seen = find_nearest(geometry.positions, geometry.vertex, screen, *size)
        fitted = seen * (1 - NEAREST)
        near = fitted if near < fitted < far else near
    if near * MAX_DEPTH_RATIO < far:
        far = far_clip = near * MAX_DEPTH_RATIO
    return make_screen(view, projection, (near, far), max(near_clip, near * NEAREST), far_clip), seen


def scale_depths(screen: Screen) -> DepthScale:
    """Say what the z of a packed sample means in one view."""
    has_range = screen.z_scale != 0
    inverse = 1.0 / screen.z_scale if has_range else 0.0
    line = (-screen.z_offset * inverse, inverse)
    if not screen.is_perspective:
        return DepthScale(1.0, 0.0, *(line if has_range else (screen.near, 0.0)), 1.0, 0.0, False)
    if not has_range:
        return DepthScale(1.0 / screen.near, 0.0, 0.0, 0.0, 1.0, 0.0, True)
    nearest = screen.z_scale / (DEPTH_MARGIN - screen.z_offset)  # that a z-buffer has room for
    return DepthScale(*line, 0.0, 0.0, nearest * line[0], nearest * line[1], True)


def check_extent(bounds) -> None:
    """Refuse a scene that is so small that float64 can't hold what is computed of it; `bounds` are (n_mesh, 2, 3)."""
    extent = float((bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)).max())
    if 0.0 < extent < MIN_EXTENT:
        raise SceneError(
            f"the scene is {extent:.3g} scene units large; it must be at least {MIN_EXTENT:.3g}: scale the scene"
        )


def check_depths(camera, view, bounds) -> None:
    """Refuse a scene whose depths a float32 buffer can't hold."""
    depths = np.abs((bounds - view.eye) * view.forward).max(axis=1).sum(axis=1)
    largest = min(float(depths.max()), np.inf if camera.far is None else camera.far)
    least, greatest = float(np.finfo(np.float32).tiny), float(np.finfo(np.float32).max)
    if largest != 0.0 and not least <= largest <= greatest:
        raise SceneError(
            f"the scene's depths reach {largest:.3g} scene units; the depth buffer holds {least:.3g} to "
            f"{greatest:.3g}: scale the scene, or leave depth out of the outputs"
        )
