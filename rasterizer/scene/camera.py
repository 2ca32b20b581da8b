"""Cameras: where the picture is taken from, and how a point of the world gets its pixel.

    in:  position, target, up; a field of view, a height, or an OpenCV calibration; or something to be framed
    out: View (eye and unit axes, world space) and Projection (scale and centre, pixels)

The camera's frame is right-handed and the camera looks down its own -z:

         up                  right = forward × up,  up = right × forward,  right × up = -forward
          |   forward
          |  /               r = p - eye,  w = r·forward  (orthographic: w = 1)
          | /                x = center_x + (scale_x (r·right) - skew (r·up)) / w
      eye +------ right      y = center_y - scale_y (r·up) / w        row 0 is the top

Only a calibration may have skew. Pixel (i, j) has its sample at (i + ½, j + ½): the picture's corners are (0, 0) and
(width, height).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..choices import AXES, POSE_FRAMES, Axis, PoseFrame
from ..errors import SceneError, shown
from ..keywords import checked_keywords
from ..vectors import cross
from . import framing
from .arrays import VectorLike, real_array
from .random_numbers import VIEW, checked_range, elevation_at, uniform_numbers, within
from .validate import at_unit_length, choice, items_of, number, picture_size, position3, store, unit3, value_class

_MAX_SKEW = 1024.0  # of fx: columns that lean by more than 89.94 degrees show nothing


class View(NamedTuple):
    """Where the camera is and its axes: (3,) float64 each, world space; the axes are orthonormal."""

    eye: NDArray[np.float64]
    right: NDArray[np.float64]
    up: NDArray[np.float64]
    forward: NDArray[np.float64]

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(3, 3) float64: its columns are the axes right, up and backwards of the camera's frame, world space.

        A direction of the camera's frame (x right, y up, looking down -z) is `world_from_camera @ direction` in the
        world; a point is that plus `eye`.
        """
        return np.array([self.right, self.up, -self.forward]).T


class Projection(NamedTuple):
    """How a point in the camera's frame gets its pixel; pixels, or pixels a scene unit where orthographic."""

    scale_x: float
    scale_y: float
    center_x: float
    center_y: float
    is_perspective: bool
    skew: float = 0.0  # px that a scene unit upwards takes off x at depth 1; K[0, 1] of OpenCV; 0 without perspective

    def ray_axes(self, view: View) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return what a step of 1/scale_x, 1/scale_y of a pixel moves a point at depth 1 by, (3,) float64 each, world
        space: the ray through (x, y) is

            (x - center_x)/scale_x · across + (center_y - y)/scale_y · upward + forward

        They are the camera's right and up; with skew what stays in one column leans, by skew/scale_x to the right.
        """
        if self.skew == 0.0:
            return view.right, view.up
        return view.right, view.up + (self.skew / self.scale_x) * view.right


@value_class
@dataclass(frozen=True, kw_only=True)
class Camera:
    """Hold a camera; made by `look_at`, `perspective`, `orthographic`, `framing`, `orbit`, `random`, `from_pose` or
    `from_opencv`.

    Parameters
    ----------
    position : three numbers, the eye, scene units, world space
    target : three numbers, the point looked at, other than `position`
    up : three numbers or "x", "y", "z", "-x", "-y", "-z": the direction that shall point upwards in the
        picture. Where it is parallel to the view, the picture's top is what it is for `framing` at azimuth 0
        about the axis nearest to `up`: with y-up the camera that looks straight down has -z on top, with z-up
        it has +y on top, as on a map
    fov : vertical field of view in degrees, at least 1e-6, below 180; None for an orthographic camera
    height : scene units that the picture is high, above 0; None for a perspective camera
    aspect : width / height of the frame that `fov` or `height` is that of, and that every picture shows as a whole: a
        wider picture shows more at the sides, a narrower one more above and below. None = the picture's own, whose
        height is always that of the frame
    near, far : distances along the view, scene units; None = fitted to the scene, near to 2^-20 of the furthest
        distance at least. near > 0 for a perspective camera, near < far. What is nearer or further is clipped,
        and nothing else depends on them. With perspective, depth has steps of 2^-38·1.04·w/n
        of the distance w, n the nearest distance that is seen; what is further than 2^40 n is clipped
    intrinsics : (fx, fy, cx, cy) of an OpenCV calibration, pixels of `size`; `fov` is then taken from fy
    size : (width, height) in pixels of the pictures that `intrinsics` belong to; None without intrinsics
    skew : K[0, 1] of the calibration, pixels of `size`, at most 1024 fx either way; 0 without intrinsics

    Raises
    ------
    SceneError : a value that is not legal, neither or both of `fov` and `height`
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    fov: float | None = None
    height: float | None = None
    near: float | None = None
    far: float | None = None
    intrinsics: tuple[float, float, float, float] | None = None
    size: tuple[int, int] | None = None
    skew: float = 0.0
    aspect: float | None = None

    if TYPE_CHECKING:  # more may be given than is stored

        def __init__(
            self,
            *,
            position: VectorLike,
            target: VectorLike = ...,
            up: VectorLike | Axis = ...,
            fov: float | None = ...,
            height: float | None = ...,
            near: float | None = ...,
            far: float | None = ...,
            intrinsics: Sequence[float] | None = ...,
            size: Sequence[int] | None = ...,
            skew: float = ...,
            aspect: float | None = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        position = position3(self.position, "the camera's position")
        target = position3(self.target, "the camera's target")
        up = AXES[choice(self.up, AXES, "the camera's up")] if isinstance(self.up, str) else self.up
        if position == target:
            raise SceneError(f"the camera's position and target must differ; given {position} for both")
        store(self, position=position, target=target, up=unit3(up, "the camera's up"))
        store(self, skew=number(self.skew, "the camera's skew"))
        if self.aspect is not None:
            store(self, aspect=framing.checked_aspect(self.aspect))
        if self.intrinsics is not None:
            self._check_intrinsics()
        elif self.size is not None:
            raise SceneError("the camera's size goes with its intrinsics; a picture's size is given to the renderer")
        elif self.skew != 0.0:
            raise SceneError(f"the camera's skew goes with its intrinsics; given {shown(self.skew)} without any")
        if (self.fov is None) == (self.height is None):
            given = f"given fov={shown(self.fov)}, height={shown(self.height)}"
            raise SceneError(f"a camera needs either fov (perspective) or height (orthographic); {given}")
        if self.height is None:
            store(self, fov=framing.checked_fov(self.fov))
        else:
            store(self, height=number(self.height, "the camera's height", above=0, unit=" scene units"))
        legal: Any = {"above": 0, "unit": " with perspective"} if self.is_perspective else {}
        for field in ("near", "far"):
            if getattr(self, field) is not None:
                store(self, **{field: number(getattr(self, field), f"the camera's {field}", **legal)})
        if self.near is not None and self.far is not None and self.near >= self.far:
            raise SceneError(f"the camera's near must be below its far; given near={self.near}, far={self.far}")

    def _check_intrinsics(self) -> None:
        """Check the OpenCV intrinsics, their size and the range of skew; derive the field of view."""
        values = items_of(self.intrinsics)
        if len(values) != 4:
            given = shown(self.intrinsics)
            raise SceneError(f"the camera's intrinsics must be (fx, fy, cx, cy) in pixels; given {given}")
        fx, fy, cx, cy = (number(value, "each of the camera's intrinsics (fx, fy, cx, cy)") for value in values)
        if fx <= 0.0 or fy <= 0.0:
            legal = "above 0 pixels"
            raise SceneError(f"the camera's focal lengths fx, fy must be {legal}; given {shown(fx)}, {shown(fy)}")
        if abs(self.skew) > _MAX_SKEW * fx:
            legal = f"at most {_MAX_SKEW:g} times its fx, {shown(fx)} pixels"
            raise SceneError(f"the camera's skew must be {legal}; given {shown(self.skew)}")
        if self.aspect is not None:
            raise SceneError(f"a camera with intrinsics has the aspect of their size; given aspect={self.aspect}")
        size = picture_size(self.size)
        store(self, intrinsics=(fx, fy, cx, cy), size=size, fov=math.degrees(2.0 * math.atan(0.5 * size[1] / fy)))

    @property
    def is_perspective(self) -> bool:
        """Whether things far away look smaller."""
        return self.height is None

    @classmethod
    def perspective(
        cls,
        position: VectorLike,
        target: VectorLike = (0, 0, 0),
        up: VectorLike | Axis = (0, 1, 0),
        fov: float | None = None,
        near: float | None = None,
        far: float | None = None,
        *,
        fov_x: float | None = None,
        size: Sequence[int] | None = None,
    ) -> "Camera":
        """Make a perspective camera that looks at `target`; parameters and errors as in the class.

        `fov` is 45 degrees where none is given. In its place may stand `fov_x`, the horizontal field of view in degrees
        of pictures of `size`, (width, height); every picture shows at least what these do.
        """
        lens = _lens(fov, None, fov_x, size)
        return cls(position=position, target=target, up=up, near=near, far=far, **lens)

    @classmethod
    def orthographic(
        cls,
        position: VectorLike,
        target: VectorLike = (0, 0, 0),
        up: VectorLike | Axis = (0, 1, 0),
        height: float = 2.0,
        near: float | None = None,
        far: float | None = None,
    ) -> "Camera":
        """Make a camera without perspective that looks at `target`; parameters and errors as in the class."""
        return cls(position=position, target=target, up=up, height=height, near=near, far=far)

    @classmethod
    @checked_keywords
    def look_at(
        cls,
        position: VectorLike,
        target: VectorLike = (0, 0, 0),
        up: VectorLike | Axis = "y",
        fov: float | None = None,
        height: float | None = None,
        near: float | None = None,
        far: float | None = None,
    ) -> "Camera":
        """Make a camera at `position` that looks at `target`: with perspective, unless a `height` is given.

        `fov` is 45 degrees where neither is given; the other parameters and errors are as in the class.
        """
        lens = _lens(fov, height, None, None)
        return cls(position=position, target=target, up=up, near=near, far=far, **lens)

    @classmethod
    @checked_keywords
    def framing(
        cls,
        subject: Any,
        azimuth: float = 35.0,
        elevation: float = 25.0,
        fov: float = 30.0,
        up: Axis | None = None,
        margin: float = 0.05,
        orthographic: bool = False,
        aspect: float | None = None,
        *,
        size: int | Sequence[int] | None = None,
    ) -> "Camera":
        """Make the camera with the smallest view from a given side that shows all of a subject, centred.

        Parameters
        ----------
        subject : what to frame: bounds (2, 3) (lowest and highest corner of a box), points (n, 3), a Mesh, a
            Scene, or anything with `vertices`; of a Mesh only the vertices that a face uses count
        azimuth : degrees about the up axis; 0 looks at the front (the camera stands on +z for y-up, on -y for
            z-up), positive turns the camera to the right (towards +x)
        elevation : degrees above the horizon, -90..90
        fov : vertical field of view in degrees; without meaning for an orthographic camera
        up : "x", "y", "z", "-x", "-y", "-z"; None = that of a Scene, y for anything else
        margin : share of the picture's width and height that stays empty on each side, at least 0, below 0.5
        orthographic : whether to do without perspective
        aspect : width / height of the picture; None = that of `size`, else 4/3
        size : (width, height) of the picture in pixels, or one number for a square, in place of `aspect`

        Returns
        -------
        Camera whose picture the subject fills up to the margin in at least one of width and height, and is
        centred in both. A subject that tapers towards the eye more sharply than the view keeps its distance,
        and then fills less.

        Raises
        ------
        SceneError : a value that is not legal, no points, points that are not finite

        Source: derivation at `rasterizer.scene.framing.fit_perspective`.
        """
        axes = framing.orbit_axes(azimuth, elevation, framing.up_axis(subject, up))
        lens = framing.checked_lens(orthographic, fov, margin, aspect, size)
        cloud = framing.Cloud(framing.point_sets(subject), axes)
        eye, target, height = lens.fit(cloud)
        return cls(position=cloud.to_world(eye), target=cloud.to_world(target), up=axes[1], fov=lens.fov, height=height)

    @classmethod
    @checked_keywords
    def orbit(
        cls,
        subject: Any,
        azimuths: int | Sequence[float] = 36,
        elevation: float = 25.0,
        fov: float = 30.0,
        up: Axis | None = None,
        margin: float = 0.05,
        orthographic: bool = False,
        aspect: float | None = None,
        *,
        size: int | Sequence[int] | None = None,
    ) -> "list[Camera]":
        """Make the cameras of a turntable: all at one distance, and looking at one point, so that nothing jumps.

        Parameters
        ----------
        subject : what to frame, as in `framing`
        azimuths : how many cameras, evenly round the whole turn from 35 degrees on; or the angle of each in degrees,
            as in `framing`
        elevation, fov, up, margin, orthographic, aspect, size : as in `framing`

        Returns
        -------
        list of Camera, the nearest from which the picture holds the subject up to the margin from all sides, not just
        those of `azimuths`. They turn about the upright axis through the middle of the subject's box, and look at a
        point of it

        Raises
        ------
        SceneError : a value that is not legal, no points, points that are not finite

        Source: derivation at `rasterizer.scene.framing.SweptCloud`.
        """
        axis = framing.up_axis(subject, up)
        lens = framing.checked_lens(orthographic, fov, margin, aspect, size)
        all_axes = [framing.orbit_axes(a, elevation, axis) for a in framing.checked_azimuths(azimuths)]
        cloud = framing.SweptCloud(framing.point_sets(subject), all_axes[0], AXES[axis])
        eye, target, height = lens.fit(cloud)
        target = cloud.seen_of_axis(eye, target)
        places = [(cloud.to_world(eye, axes), cloud.to_world(target, axes), axes[1]) for axes in all_axes]
        return [cls(position=p, target=t, up=upward, fov=lens.fov, height=height) for p, t, upward in places]

    @classmethod
    @checked_keywords
    def random(
        cls,
        subject: Any,
        seed: int = 0,
        *,
        elevation: float | Sequence[float] = (-90.0, 90.0),
        distance: float | Sequence[float] = 1.0,
        fov: float | Sequence[float] = 30.0,
        roll: float | Sequence[float] = 0.0,
        up: Axis | None = None,
        margin: float = 0.05,
        aspect: float | None = None,
        size: int | Sequence[int] | None = None,
    ) -> "Camera":
        """Make a camera that looks at a subject from a random side, all sides of the sphere alike; the same for a seed.

        Parameters
        ----------
        subject : what to frame, as in `framing`
        seed : whole number, at least 0
        elevation : degrees above the horizon; here, and below, a number or the ends of a range, from which one is
            taken at random, evenly (of elevations: so that equal areas of the sphere have equally many)
        distance : of the eye, as a multiple of that from which the picture just holds the subject, above 0 to 1000
        fov : vertical field of view in degrees
        roll : degrees by which the camera is turned about its view, counter-clockwise
        up, margin, aspect, size : as in `framing`

        Raises
        ------
        SceneError : a value that is not legal, no points, points that are not finite
        """
        elevations, rolls = checked_range(elevation, "elevation", -90, 90), checked_range(roll, "roll", -360, 360)
        fovs = checked_range(fov, "fov", framing.MIN_FOV, 180)
        distances = checked_range(distance, "distance", 1e-3, 1e3)
        numbers = uniform_numbers(seed, VIEW, 5)
        camera = cls.framing(
            subject, 360.0 * numbers[0], elevation_at(elevations, numbers[1]), within(fovs, numbers[2]), up, margin,
            aspect=aspect, size=size,
        )  # fmt: skip
        eye, _, upward, forward = camera.view()
        target = np.array(camera.target)
        position = target + within(distances, numbers[3]) * (eye - target)
        turned = framing.rotation(forward, -within(rolls, numbers[4])) @ upward
        return cls(position=position, target=target, up=turned, fov=camera.fov)

    @classmethod
    @checked_keywords
    def from_pose(
        cls,
        pose: ArrayLike,
        fov: float | None = None,
        height: float | None = None,
        near: float | None = None,
        far: float | None = None,
        frame: PoseFrame = "opengl",
        *,
        fov_x: float | None = None,
        K: ArrayLike | None = None,
        size: Sequence[int] | None = None,
    ) -> "Camera":
        """Make a camera from its pose, the matrix that takes points of the camera's frame to the world.

        Parameters
        ----------
        pose : (4, 4) world-from-camera: a rotation and the eye's position, the last row (0, 0, 0, 1), as pyrender,
            trimesh, glTF and Blender have it; the nearest exact rotation is taken
        fov : vertical field of view in degrees; None = 45, unless a height is given
        height : scene units that the picture is high, for a camera without perspective
        near, far : as in the class
        frame : "opengl": x to the right, y up, looking down -z; "opencv": x to the right, y down, looking down +z
        fov_x : horizontal field of view in degrees, in the place of `fov`
        K : (3, 3) in pixels, in the place of a field of view, as in `from_opencv`
        size : (width, height) in pixels of the pictures that `fov_x` or K belongs to

        Raises
        ------
        SceneError : a value that is not legal, a matrix that scales, mirrors or isn't affine
        """
        choice(frame, POSE_FRAMES, "the pose's frame")
        matrix = _checked_matrix(pose, (4, 4), "the pose")
        if (matrix[3] != (0.0, 0.0, 0.0, 1.0)).any():
            raise SceneError(f"the pose's last row must be (0, 0, 0, 1); given {shown(matrix[3].tolist())}")
        rotation, eye = _nearest_rotation(matrix[:3, :3], "the pose's upper left (3, 3)"), matrix[:3, 3]
        if frame == "opencv":
            rotation = rotation * (1.0, -1.0, -1.0)
        if K is not None:
            if fov is not None or height is not None or fov_x is not None:
                raise SceneError("K says the field of view; given fov, fov_x or height beside it")
            R = rotation.T * np.array([[1.0], [-1.0], [-1.0]])
            return cls.from_opencv(K, R, -R @ eye, _needed_size(size, "K"), near, far)
        lens = _lens(fov, height, fov_x, size)
        target = _target(eye, -rotation[:, 2])
        return cls(position=eye, target=target, up=rotation[:, 1], near=near, far=far, **lens)

    @property
    def pose(self) -> NDArray[np.float64]:
        """(4, 4) float64 world-from-camera: x to the right, y up, looking down -z, as `from_pose` reads it."""
        view, pose = self.view(), np.eye(4)
        pose[:3, :3], pose[:3, 3] = view.world_from_camera, view.eye
        return pose

    @classmethod
    def from_opencv(
        cls,
        K: ArrayLike,
        R: ArrayLike,
        t: ArrayLike,
        size: Sequence[int],
        near: float | None = None,
        far: float | None = None,
    ) -> "Camera":
        """Make a camera from an OpenCV calibration: x_cam = R x_world + t, in a frame with x right, y down, z
        forward.

        Parameters
        ----------
        K : (3, 3) [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] in pixels; OpenCV counts from the centre of the first
            pixel, so its (cx, cy) is (cx + ½, cy + ½) here. There is no distortion of lenses: undistort pictures
            first, `cv2.undistort(picture, K, distortion)`, which then have the same K
        R : (3, 3) rotation from world to camera; the nearest exact rotation is taken
        t : (3,) or (3, 1), scene units
        size : (width, height) of the pictures that K belongs to, pixels
        near, far : as in the class

        Raises
        ------
        SceneError : shapes, values that are not finite, another form of K, a matrix R that is no rotation
        """
        K, R, t = _checked_matrix(K, (3, 3), "K"), _checked_matrix(R, (3, 3), "R"), _checked_matrix(t, (3,), "t")
        (fx, skew, cx), (_, fy, cy), _ = K.tolist()
        ideal = np.array([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        if np.abs(K - ideal).max() > 1e-9 * max(abs(fx), 1.0):
            raise SceneError(f"K must be [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]; given {shown(K.tolist())}")
        R = _nearest_rotation(R, "R")
        eye = -R.T @ t
        lens = {"intrinsics": (fx, fy, cx, cy), "size": size, "skew": skew}
        return cls(position=eye, target=_target(eye, R[2]), up=-R[1], near=near, far=far, **lens)

    def to_opencv(self, size: Sequence[int]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return K (3, 3), R (3, 3), t (3,), float64, as OpenCV writes this camera for pictures of `size`
        (width, height) pixels.

        Raises
        ------
        SceneError : an orthographic camera, a size that is not legal
        """
        if not self.is_perspective:
            raise SceneError("an orthographic camera has no OpenCV form; make a perspective one")
        eye, right, up, forward = self.view()
        scale_x, scale_y, center_x, center_y, _, skew = self.projection(size)
        K = np.array([[scale_x, skew, center_x - 0.5], [0.0, scale_y, center_y - 0.5], [0.0, 0.0, 1.0]])
        R = np.stack([right, -up, forward])
        return K, R, -R @ eye

    @checked_keywords
    def project(self, points: ArrayLike, size: Sequence[int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where points are in a picture, and how far away.

        Parameters
        ----------
        points : (..., 3) numbers, world space, such as `Mesh.vertices`, or `frame.position`
        size : (width, height) of the picture in pixels

        Returns
        -------
        pixels (..., 2) float64: x to the right, y down; the picture's corner is (0, 0), the centre of its first pixel
            (0.5, 0.5), as everywhere here and in COLMAP. OpenCV counts from that centre: take 0.5 off. NaN for what
            isn't before a camera with perspective
        depth (...,) float64: along the viewing axis, scene units, as `frame.depth`

        Raises
        ------
        SceneError : points that are none, a size that is not legal
        """
        array = real_array(points)
        if array is None or array.ndim == 0 or array.shape[-1] != 3:
            raise SceneError(f"points must be numbers of the shape (..., 3); given {shown(points)}")
        view, lens = self.view(), self.projection(size)
        local = array.astype(np.float64) - view.eye
        across, upward, depth = local @ view.right, local @ view.up, local @ view.forward
        w = np.where(depth > 0.0, depth, np.nan) if lens.is_perspective else np.ones_like(depth)
        x = lens.center_x + (lens.scale_x * across - lens.skew * upward) / w
        return np.stack([x, lens.center_y - lens.scale_y * upward / w], axis=-1), depth

    def view(self) -> View:
        """Return the eye and the camera's axes: View, of (3,) float64 each, world space."""
        (x, y, z), (to_x, to_y, to_z) = self.position, self.target
        forward = at_unit_length((to_x - x, to_y - y, to_z - z), "the way from the camera's position to its target")
        up: VectorLike = self.up
        if math.hypot(*cross(forward, up)) < 1e-8:  # parallel but for rounding
            up = framing.top_when_parallel(np.array(forward), np.array(up))
        right = at_unit_length(cross(forward, up), "the camera's right")
        return View(*np.array((self.position, right, cross(right, forward), forward)))

    def projection(self, size: Sequence[int]) -> Projection:
        """Return the scale and centre for a picture of `size` (width, height) pixels.

        The vertical field of view rules and pixels are square; in a picture that is narrower than the camera's
        aspect the horizontal one does. A camera with intrinsics has them scaled, each axis by itself, from the size
        that they belong to.

        Raises
        ------
        SceneError : a size that is not legal
        """
        width, height = picture_size(size)
        if self.intrinsics is not None and self.size is not None:
            fx, fy, cx, cy = self.intrinsics
            grow_x, grow_y = width / self.size[0], height / self.size[1]
            center = (cx + 0.5) * grow_x, (cy + 0.5) * grow_y
            return Projection(fx * grow_x, fy * grow_y, *center, True, self.skew * grow_x)
        frame_height = height if self.aspect is None else min(height, width / self.aspect)
        if self.height is not None:
            scale = frame_height / self.height
        elif self.fov is not None:
            scale = 0.5 * frame_height / math.tan(math.radians(self.fov) / 2.0)
        return Projection(scale, scale, 0.5 * width, 0.5 * height, self.is_perspective)


def _lens(fov: float | None, height: float | None, fov_x: float | None, size: Sequence[int] | None) -> dict[str, Any]:
    """Return the fields of a camera that say how much it shows: a `fov` of 45 degrees where nothing is given."""
    if fov_x is None:
        if size is not None:
            raise SceneError(f"size goes with fov_x or K: it is that of their pictures; given {shown(size)} alone")
        return {"fov": 45.0 if fov is None and height is None else fov, "height": height}
    if fov is not None or height is not None:
        raise SceneError("a camera has one of fov, fov_x and height; given two")
    width, rows = picture_size(_needed_size(size, "fov_x"))
    slope = math.tan(math.radians(framing.checked_fov(fov_x)) / 2.0) * rows / width
    return {"fov": math.degrees(2.0 * math.atan(slope)), "aspect": width / rows}


def _needed_size(size: Sequence[int] | None, what: str) -> Sequence[int]:
    """Return the size of the pictures that something belongs to; SceneError where there is none."""
    if size is None:
        raise SceneError(f"{what} needs size=(width, height), that of its pictures in pixels; given none")
    return size


def _target(eye: NDArray[np.float64], forward: NDArray[np.float64]) -> NDArray[np.float64]:
    """A point to look at, about as far away as the eye is from the origin: that keeps every digit of the direction."""
    with np.errstate(over="ignore"):  # a camera refuses what isn't finite
        return eye + forward * max(1.0, float(np.abs(eye).max()))


# --- cameras that are turned ---------------------------------------------------------------------------------


def turned_cameras(
    camera: Camera, angles: Sequence[float], pole: ArrayLike, pivot: NDArray[np.float64]
) -> list[Camera]:
    """Return a camera turned about an axis, at each of several angles; at 0 it is the one given.

    Parameters
    ----------
    camera : Camera
    angles : degrees, counter-clockwise as seen from the axis' tip, as azimuths are
    pole : (3,) unit vector along the axis, world space
    pivot : (3,) a point of the axis, world space
    """
    # The top of a view along the axis is one that the camera's `up` doesn't say: it turns, too.
    up = camera.view().up
    found = []
    for angle in angles:
        turn = framing.rotation(pole, angle)
        position, target = (pivot + turn @ (np.array(p) - pivot) for p in (camera.position, camera.target))
        moved: dict[str, Any] = {"position": position, "target": target, "up": turn @ up}
        found.append(camera if angle == 0.0 else replace(camera, **moved))
    return found


def pivot_of(camera: Camera, bounds: NDArray[np.float64], nearest: float = 0.0) -> NDArray[np.float64]:
    """Return the point (3,), world space, that a camera turns about: what it looks at.

    The target of a camera that was made of a calibration lies anywhere on its axis. It turns about the point of its
    axis that is as far away as the scene's middle.

    Parameters
    ----------
    camera : Camera
    bounds : (2, 3) of the scene
    nearest : that the point of such a camera is away at least, in diagonals of the scene's box
    """
    if camera.intrinsics is None:
        return np.array(camera.target)
    eye, _, _, forward = camera.view()
    low, high = bounds
    distance = max(float(np.dot(0.5 * (low + high) - eye, forward)), nearest * math.dist(low, high))
    return eye + distance * forward


def aimed(camera: Camera, bounds: NDArray[np.float64]) -> Camera:
    """Return a camera whose target is as far ahead as the middle of a box (2, 3), world space. A file says where its
    camera looks, but not how far; whoever turns a camera turns it about its target.

    Behind the eye, or nearer than 2^-20 of the eye's own coordinates, the middle counts for nothing: so the direction,
    which is computed from both points, keeps 32 bits.
    """
    eye, target = np.array(camera.position), np.array(camera.target)
    ahead = (target - eye) / np.linalg.norm(target - eye)
    distance = float((bounds.mean(axis=0) - eye) @ ahead)
    if not distance > 2.0**-20 * float(np.abs(eye).max()):
        return camera
    return replace(camera, target=tuple((eye + distance * ahead).tolist()))


# --- what a camera is given, checked -------------------------------------------------------------------------


def _checked_matrix(value: ArrayLike, shape: tuple[int, ...], what: str) -> NDArray[np.float64]:
    """Return a finite float64 array of the given shape; a vector may be a column, as OpenCV writes it."""
    matrix = real_array(value)
    if matrix is not None and matrix.shape == (*shape, 1) and len(shape) == 1:
        matrix = matrix[:, 0]
    if matrix is None or matrix.shape != shape or not np.isfinite(matrix).all():
        raise SceneError(f"{what} must be finite numbers of the shape {shape}; given {shown(value)}")
    return matrix.astype(np.float64)


def _nearest_rotation(matrix: NDArray[np.float64], what: str) -> NDArray[np.float64]:
    """Return the rotation nearest to a matrix that is one up to a few digits.

    Source: Schönemann 1966, Psychometrika 31, 1-10: U Vᵀ of the singular value decomposition.
    """
    u, stretch, vt = np.linalg.svd(matrix)
    rotation = u @ vt
    if np.abs(stretch - 1.0).max() > 1e-3 or np.linalg.det(rotation) < 0.0:
        legal = "a rotation (perpendicular unit rows, determinant 1)"
        raise SceneError(f"{what} must be {legal}; given {shown(matrix.tolist())}")
    return rotation
