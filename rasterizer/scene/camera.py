"""Cameras: where the picture is taken from, and how a point of the world gets its pixel.

    in:  position, target, up; a field of view, a height, or an OpenCV calibration; or something to be framed
    out: View (eye and unit axes, world space) and Projection (scale and centre, pixels)

The camera's frame is right-handed and the camera looks down its own -z:

         up                  right = forward × up,  up = right × forward,  right × up = -forward
          |   forward
          |  /               r = p - eye,  w = r·forward  (orthographic: w = 1)
          | /                x = center_x + scale_x (r·right) / w
      eye +------ right      y = center_y - scale_y (r·up) / w        row 0 is the top

Pixel (i, j) has its sample at (i + ½, j + ½): the picture's corners are (0, 0) and (width, height).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..choices import AXES, Axis
from ..errors import SceneError, shown
from . import framing
from .arrays import VectorLike
from .calibration import read_calibration
from .validate import choice, number, picture_size, position3, unit3

MOST_ASPECT = 1e9  # of a picture: beyond it framing would divide by nothing
LEAST_FOV = 1e-6  # degrees: a hair in 10 km


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
        return np.stack([self.right, self.up, -self.forward]).T


class Projection(NamedTuple):
    """How a point in the camera's frame gets its pixel; pixels, or pixels a scene unit where orthographic."""

    scale_x: float
    scale_y: float
    center_x: float
    center_y: float
    is_perspective: bool


@dataclass(frozen=True, kw_only=True)
class Camera:
    """Hold a camera; made by `perspective`, `orthographic`, `framing` or `from_opencv`.

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
    near, far : distances along the view, scene units; None = fitted to the scene, near to 2^-20 of the furthest
        distance at least. near > 0 for a perspective camera, near < far. What is nearer or further is clipped,
        and nothing else depends on them. With perspective, surfaces at the distance w are told apart that are
        2^-38 · w/n of it from each other, n the nearest distance that is seen; what is further than 2^40 n is
        clipped
    intrinsics : (fx, fy, cx, cy) of an OpenCV calibration, pixels of `size`; `fov` is then taken from fy
    size : (width, height) in pixels of the pictures that `intrinsics` belong to; None without intrinsics

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
        ) -> None: ...

    def __post_init__(self) -> None:
        self._set("position", position3(self.position, "the camera's position"))
        self._set("target", position3(self.target, "the camera's target"))
        up = AXES[choice(self.up, tuple(AXES), "the camera's up")] if isinstance(self.up, str) else self.up
        self._set("up", unit3(up, "the camera's up"))
        if self.position == self.target:
            raise SceneError(f"the camera's position and target must differ; given {self.position} for both")
        self._check_lens()
        self._check_depth_range()

    def _set(self, field: str, value: object) -> None:
        object.__setattr__(self, field, value)

    def _check_lens(self) -> None:
        """Check the field of view, the height or the intrinsics, of which one rules."""
        if self.intrinsics is not None:
            self._check_intrinsics()
        elif self.size is not None:
            raise SceneError("the camera's size goes with its intrinsics; a picture's size is given to the renderer")
        if (self.fov is None) == (self.height is None):
            raise SceneError(
                "a camera needs either fov (perspective) or height (orthographic); "
                f"given fov={shown(self.fov)}, height={shown(self.height)}"
            )
        if self.fov is not None:
            self._set("fov", _checked_fov(self.fov))
        else:
            height = number(self.height, "the camera's height")
            if height <= 0.0:
                raise SceneError(f"the camera's height must be above 0 scene units; given {shown(self.height)}")
            self._set("height", height)

    def _check_intrinsics(self) -> None:
        """Check the OpenCV intrinsics and the size that they belong to, and derive the field of view."""
        given: Any = self.intrinsics
        try:
            values = tuple(given)
        except TypeError:
            values = ()
        if len(values) != 4:
            given = shown(self.intrinsics)
            raise SceneError(f"the camera's intrinsics must be (fx, fy, cx, cy) in pixels; given {given}")
        fx, fy, cx, cy = (number(v, "each of the camera's intrinsics (fx, fy, cx, cy)") for v in values)
        if fx <= 0.0 or fy <= 0.0:
            raise SceneError(
                f"the camera's focal lengths fx, fy must be above 0 pixels; given {shown(fx)}, {shown(fy)}"
            )
        width, height = picture_size(self.size)
        self._set("intrinsics", (fx, fy, cx, cy))
        self._set("size", (width, height))
        self._set("fov", math.degrees(2.0 * math.atan(0.5 * height / fy)))

    def _check_depth_range(self) -> None:
        """Check near and far, where given."""
        for field in ("near", "far"):
            value = getattr(self, field)
            if value is not None:
                value = number(value, f"the camera's {field}")
                if value <= 0.0 and self.is_perspective:
                    raise SceneError(
                        f"the {field} of a perspective camera must be above 0 scene units; given {shown(value)}"
                    )
                self._set(field, value)
        if self.near is not None and self.far is not None and self.near >= self.far:
            raise SceneError(
                f"the camera's near must be below its far; given near={shown(self.near)}, far={shown(self.far)}"
            )

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
        fov: float = 45.0,
        near: float | None = None,
        far: float | None = None,
    ) -> "Camera":
        """Make a perspective camera that looks at `target`; parameters and errors as in the class."""
        return cls(position=position, target=target, up=up, fov=fov, near=near, far=far)

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
    def framing(
        cls,
        subject: Any,
        azimuth: float = 35.0,
        elevation: float = 25.0,
        fov: float = 30.0,
        up: Axis = "y",
        margin: float = 0.05,
        orthographic: bool = False,
        aspect: float = 4 / 3,
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
        up : "x", "y", "z", "-x", "-y", "-z"
        margin : share of the picture's width and height that stays empty on each side, at least 0, below 0.5
        orthographic : whether to do without perspective
        aspect : width / height of the picture

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
        axes = framing.orbit_axes(azimuth, elevation, choice(up, tuple(AXES), "up"))
        margin = number(margin, "the margin")
        if not 0.0 <= margin < 0.5:
            raise SceneError(f"the margin must be at least 0 and below 0.5 of the picture; given {shown(margin)}")
        aspect = number(aspect, "the aspect (width / height)")
        if not 1.0 / MOST_ASPECT <= aspect <= MOST_ASPECT:
            legal = f"above 0, and within 1/{MOST_ASPECT:g}..{MOST_ASPECT:g}"
            raise SceneError(f"the aspect (width / height) must be {legal}; given {aspect}")
        filled = 1.0 - 2.0 * margin
        if not isinstance(orthographic, (bool, np.bool_)):
            raise SceneError(f"orthographic must be True or False; given {shown(orthographic)}")
        if orthographic:
            eye, target, height = framing.fit_orthographic(subject, axes, aspect * filled, filled)
            return cls(position=eye, target=target, up=axes[1], height=height)
        slope = filled * math.tan(math.radians(_checked_fov(fov)) / 2.0)
        eye, target = framing.fit_perspective(subject, axes, aspect * slope, slope)
        return cls(position=eye, target=target, up=axes[1], fov=fov)

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
        K : (3, 3) [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels; OpenCV counts from the centre of the first
            pixel, so its (cx, cy) is (cx + ½, cy + ½) here. Skew is not supported
        R : (3, 3) rotation from world to camera; the nearest exact rotation is taken
        t : (3,) or (3, 1), scene units
        size : (width, height) of the pictures that K belongs to, pixels
        near, far : as in the class

        Raises
        ------
        SceneError : shapes, values that are not finite, skew, a matrix R that is no rotation
        """
        (fx, fy, cx, cy), R, t = read_calibration(K, R, t)
        size = picture_size(size)
        eye = -R.T @ t
        # a target about as far away as the eye is from the origin keeps every digit of the direction
        target = eye + R[2] * max(1.0, float(np.abs(eye).max()))
        return cls(position=eye, target=target, up=-R[1], near=near, far=far, intrinsics=(fx, fy, cx, cy), size=size)

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
        scale_x, scale_y, center_x, center_y, _ = self.projection(size)
        K = np.array([[scale_x, 0.0, center_x - 0.5], [0.0, scale_y, center_y - 0.5], [0.0, 0.0, 1.0]])
        R = np.stack([right, -up, forward])
        return K, R, -R @ eye

    def view(self) -> View:
        """Return the eye and the camera's axes, world space, float64."""
        way = tuple(to - at for to, at in zip(self.target, self.position, strict=True))
        forward = unit3(way, "the way from the camera's position to its target")
        up: VectorLike = self.up
        if math.hypot(*_cross(forward, up)) < 1e-8:  # parallel but for rounding
            up = framing.top_when_parallel(np.array(forward), np.array(up))
        right = unit3(_cross(forward, up), "the camera's right")
        return View(*(np.array(axis) for axis in (self.position, right, _cross(right, forward), forward)))

    def projection(self, size: Sequence[int]) -> Projection:
        """Return the scale and centre for a picture of `size` (width, height) pixels.

        The vertical field of view rules and pixels are square. A camera with intrinsics has them scaled, each
        axis by itself, from the size that they belong to.

        Raises
        ------
        SceneError : a size that is not legal
        """
        width, height = picture_size(size)
        if self.intrinsics is not None and self.size is not None:
            fx, fy, cx, cy = self.intrinsics
            grow_x, grow_y = width / self.size[0], height / self.size[1]
            return Projection(fx * grow_x, fy * grow_y, (cx + 0.5) * grow_x, (cy + 0.5) * grow_y, True)
        if self.height is not None:
            scale = height / self.height
        elif self.fov is not None:
            scale = 0.5 * height / math.tan(math.radians(self.fov) / 2.0)
        return Projection(scale, scale, 0.5 * width, 0.5 * height, self.is_perspective)


def _cross(a: VectorLike, b: VectorLike) -> tuple[float, float, float]:
    """The cross product; numpy's takes as long as a thousand vertices."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _checked_fov(fov: object) -> float:
    """Return the field of view as a float between 0 and 180 degrees; a smaller one would magnify roundings only."""
    value = number(fov, "the camera's fov")
    if not LEAST_FOV <= value < 180.0:
        raise SceneError(
            f"the camera's fov must be between 0 and 180 degrees, {LEAST_FOV:g} at least; given {shown(fov)}"
        )
    return value
