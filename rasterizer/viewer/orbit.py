"""The camera of the viewer: it turns about a pivot, moves sideways and comes nearer.

    in:  a Camera, and what is done to it in pixels or degrees     out: a Camera

The eye stands at pivot - distance · forward. What is moved by pixels is measured in the plane through the pivot that is
parallel to the picture, so that what lies in that plane stays below the pointer.
"""

import math
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..choices import AXES, Axis
from ..scene.camera import Camera, View, pivot_of
from ..scene.framing import rotation
from ..scene.scene import Scene

Array: TypeAlias = NDArray[np.float64]
Size: TypeAlias = tuple[int, int]

NEAREST, FURTHEST = 1e-4, 1e4  # distances and heights of the view, in sizes of the scene
_SAME = 1e-9  # of an axis: what is lost where an angle is turned into flags and back
_FOV = 30.0  # degrees, where a camera without perspective gets one; that of Camera.framing
_AT_POLE = 1e-8  # sine of the angle to the pole, below which rounding decides what is to the side


@dataclass(frozen=True, eq=False)
class Orbit:
    """Hold a camera that can be moved.

    Parameters
    ----------
    lens : Camera, whose field of view, height, aspect, intrinsics and range of depth are used
    pivot : (3,) float64, what the camera turns about, world space
    axes : (3, 3) float64, the camera's right, up, forward, world space
    distance : from the eye to the pivot, scene units
    pole : (3,) float64, what is upwards in the world
    extent : length of the diagonal of the scene's box, scene units
    is_moved : whether the lens stands elsewhere by now
    former : Camera with perspective, whose lens comes back when the projection is changed again; None = of _FOV
    """

    lens: Camera
    pivot: Array
    axes: Array
    distance: float
    pole: Array
    extent: float
    is_moved: bool = False
    former: Camera | None = None

    @classmethod
    def of(cls, camera: Camera, scene: Scene) -> "Orbit":
        """Make the orbit of a camera about what it looks at in a scene.

        It turns about the point that `pivot_of` names.
        """
        eye, *axes = camera.view()
        pivot = pivot_of(camera, scene.bounds, NEAREST)
        distance, extent = math.dist(eye, pivot), math.dist(*scene.bounds)
        return cls(camera, pivot, np.stack(axes), distance, np.array(AXES[scene.up]), extent)

    @property
    def camera(self) -> Camera:
        """The camera where it stands now; as it was given until it is moved."""
        if not self.is_moved:
            return self.lens
        eye = self.pivot - self.distance * self.axes[2]
        return replace(self.lens, position=tuple(eye), target=tuple(self.pivot), up=tuple(self.axes[1]))

    def turned(self, azimuth: float, elevation: float) -> "Orbit":
        """Return the orbit with the camera moved to the right and upwards, in degrees; it stops above and below.

        The camera turns about the pole, and about the horizontal axis to its side. So a horizon stays level, and one
        that a given camera has tilted stays as it is.
        """
        forward = self.axes[2]
        now = math.degrees(math.asin(max(-1.0, min(1.0, -float(forward @ self.pole)))))
        elevation = max(-90.0, min(90.0, now + elevation)) - now
        side = np.cross(forward, self.pole)
        length = float(np.linalg.norm(side))
        side = side / length if length > _AT_POLE else self.axes[0]
        axes = self.axes @ rotation(side, -elevation).T
        return self._moved(axes=_orthonormal(axes @ rotation(self.pole, azimuth).T))

    def panned(self, dx: float, dy: float, size: Size) -> "Orbit":
        """Return the orbit with the picture moved by pixels, to the right and downwards."""
        scale_x, scale_y = self._pixels_per_unit(size)
        right, up = self._ray_axes(size)
        shift = -dx / scale_x * right + dy / scale_y * up
        return self._moved(pivot=self.pivot + shift)

    def zoomed(self, factor: float, x: float, y: float, size: Size) -> "Orbit":
        """Return the orbit with all enlarged `factor` times about a point of the picture, in pixels."""
        now = self.distance if self.lens.is_perspective else float(self.lens.height or 1.0)
        new = max(NEAREST * self.extent, min(FURTHEST * self.extent, now / factor))
        scale_x, scale_y = self._pixels_per_unit(size)
        projection = self.lens.projection(size)
        across, upwards = (x - projection.center_x) / scale_x, (projection.center_y - y) / scale_y
        right, up = self._ray_axes(size)
        shift = (1.0 - new / now) * (across * right + upwards * up)
        moved = self._moved(pivot=self.pivot + shift)
        if self.lens.is_perspective:
            return replace(moved, distance=new)
        return replace(moved, lens=replace(self.lens, height=new))

    def about(self, point: Array) -> "Orbit":
        """Return the orbit about another pivot (3,), world space, which comes to the middle of the picture."""
        return self._moved(pivot=np.array(point, np.float64))

    def with_other_projection(self) -> "Orbit":
        """Return the orbit with perspective where it has none, or without; what lies at the pivot keeps its size."""
        lens = self.lens
        if lens.height is None:
            height = 2.0 * self.distance * math.tan(math.radians(lens.fov or _FOV) / 2.0)
            flat = replace(lens, fov=None, height=height, intrinsics=None, size=None, skew=0.0)
            return self._moved(lens=flat, former=lens)
        former = self.former or replace(lens, fov=_FOV, height=None, near=None, far=None)
        distance = lens.height / (2.0 * math.tan(math.radians(former.fov or _FOV) / 2.0))
        # The eye moves, and planes that cut the scene stay; behind the eye there is none.
        near, far = (
            None if plane is None or plane <= self.distance - distance else plane + distance - self.distance
            for plane in (lens.near, lens.far)
        )
        return self._moved(lens=replace(former, near=near, far=far), distance=distance)

    def position_of(self, p_world: Array, size: Size) -> tuple[float, float] | None:
        """Return where a point (3,), world space, is seen: in pixels of a picture of `size`; None behind the eye."""
        (x, y), _ = self.camera.project(p_world, size)
        return None if np.isnan(x) else (float(x), float(y))

    def _pixels_per_unit(self, size: Size) -> tuple[float, float]:
        """Pixels for each scene unit in the plane through the pivot, across and upwards."""
        projection = self.lens.projection(size)
        w = self.distance if projection.is_perspective else 1.0
        return projection.scale_x / w, projection.scale_y / w

    def _ray_axes(self, size: Size) -> tuple[Array, Array]:
        """The directions in the world in which rows and columns of the picture go; see `Projection.ray_axes`."""
        return self.lens.projection(size).ray_axes(View(self.pivot, *self.axes))

    def _moved(self, **changes: object) -> "Orbit":
        return replace(self, is_moved=True, **changes)  # type: ignore[arg-type]


def camera_flags(camera: Camera, up: Axis) -> str:
    """Return the flags of `raster render` that say what a camera sees of a scene with this up axis, so that what was
    found by hand can be drawn again.

    Returns
    -------
    text; "" where no flags say it: a calibration, an aspect, a range of depth, a camera that is tilted or stands at a
    pole
    """
    if any(value is not None for value in (camera.intrinsics, camera.aspect, camera.near, camera.far)):
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


def _orthonormal(axes: Array) -> Array:
    """Take rounding out of axes right, up, forward (3, 3), so that it doesn't add up from turn to turn."""
    forward = axes[2] / np.linalg.norm(axes[2])
    right = np.cross(forward, axes[1])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])
