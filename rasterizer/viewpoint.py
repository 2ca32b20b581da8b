"""Where a picture is taken from: words such as `view="front"` or `eye=(3, 2, 4)`, of a program or of the command line,
become a Camera."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, TypeGuard

import numpy as np

from .choices import AXES, AZIMUTH, ELEVATION, FOV, VIEWS, ViewName
from .errors import SceneError, shown
from .keywords import checked_fields
from .scene.camera import Camera, pivot_of, turned_cameras
from .scene.validate import flag, number, store

if TYPE_CHECKING:
    from .scene.arrays import VectorLike
    from .scene.scene import Scene

_FRAMED = frozenset(("view", "azimuth", "elevation", "margin"))  # fields that say how a subject is framed


@checked_fields
@dataclass(frozen=True, kw_only=True)
class Viewpoint:
    """Hold where a picture is taken from; `render` says what each field is.

    A path of a camera is read before, by `io.camera_file.viewpoint_of`. The words of a Viewpoint that is given as the
    camera become those of this one.

    Raises
    ------
    SceneError : a value that is not legal, or fields that contradict each other
    """

    camera: Camera | str | os.PathLike[str] | None = None
    view: ViewName | Sequence[float] | None = None
    azimuth: float | None = None
    elevation: float | None = None
    fov: float | None = None
    ortho: bool = False
    zoom: float = 1.0
    margin: float | None = None
    eye: VectorLike | None = None
    target: VectorLike | None = None

    def __post_init__(self) -> None:
        check_words(vars(self))
        camera = self.camera
        if is_path(camera):
            raise TypeError(f"the camera in {camera} must be read first, see io/camera_file.py")
        if isinstance(camera, Viewpoint):
            store(self, **vars(camera) | {"zoom": camera.zoom * self.zoom})

    @property
    def of_file(self) -> Literal["file"] | None:
        """What `load` takes as its `camera`: "file" where the model's own is asked for."""
        return "file" if isinstance(self.camera, str) and self.camera == "file" else None

    def over(self, other: Viewpoint | None) -> Viewpoint:
        """Return the viewpoint that a scene file asks for, if it does, changed by what this one says."""
        if other is None or not (self.camera is None or self.of_file):
            return self
        given = {name: getattr(self, name) for name in words_given(vars(self))}
        dropped = tuple(_FRAMED) if "eye" in given else ()
        if not given.keys().isdisjoint(("view", "azimuth", "elevation")):
            dropped = ("azimuth", "elevation", "eye", "target") if "view" in given else ("eye", "target")
        return replace(other, **dict.fromkeys(dropped) | given, zoom=other.zoom * self.zoom)

    def camera_of(self, scene: Scene, size: tuple[int, int], subject: Callable[[], Any] | None = None) -> Camera:
        """Make the camera for a picture of a scene: the scene's own where there is one and no word asks for another.

        Parameters
        ----------
        scene : Scene
        size : (width, height) of the picture, pixels
        subject : function that returns what is framed, Scene or points (n, 3), called where something is; None = the
            scene

        Raises
        ------
        SceneError : a value that is not legal
        """
        own, given = scene.camera, words_given(vars(self))
        if isinstance(self.camera, Camera):
            return zoomed(self.camera, self.zoom)
        if self.camera == "file" and own is None:
            raise SceneError('camera "file": the model brings no camera; leave it out to fill the picture')
        if own is not None and self.camera != "frame" and not given:
            return zoomed(own, self.zoom)
        if self.eye is not None:
            return zoomed(self._standing(scene), self.zoom)
        framed = scene if subject is None else subject()
        if not given and framed is scene:
            return zoomed(scene.framed(size[0] / size[1]), self.zoom)  # which is kept
        camera = Camera.framing(framed, **self.framing(scene.up, size))
        return zoomed(camera, self.zoom)

    def framing(self, up: str, size: tuple[int, int]) -> dict[str, Any]:
        """Return the arguments of `Camera.framing`, but for the subject: of words, else the defaults."""
        settings: dict[str, Any] = {"azimuth": AZIMUTH, "elevation": ELEVATION, "fov": FOV}
        if self.view is not None:
            settings["azimuth"], settings["elevation"] = VIEWS[self.view] if isinstance(self.view, str) else self.view
        for name in ("azimuth", "elevation", "fov", "margin"):
            if getattr(self, name) is not None:
                settings[name] = getattr(self, name)
        return settings | {"orthographic": bool(self.ortho), "up": up, "aspect": size[0] / size[1]}

    def _standing(self, scene: Scene) -> Camera:
        """Make the camera at `eye`; an orthographic one shows of the target's plane what it would with perspective."""
        fov = FOV if self.fov is None else self.fov
        target = scene.bounds.mean(axis=0) if self.target is None else self.target
        camera = Camera.perspective(self.eye, target, scene.up, fov)
        if not self.ortho:
            return camera
        distance = math.dist(camera.position, camera.target)
        height = 2.0 * distance * math.tan(math.radians(fov) / 2.0)
        return Camera.orthographic(self.eye, target, scene.up, height)

    def cameras_round(
        self,
        angles: Sequence[float],
        scene: Scene,
        size: tuple[int, int],
        subject: Callable[[], Any] | None = None,
    ) -> list[Camera]:
        """Make the cameras of a turntable, as many degrees from the first one as the angles say: they keep a distance
        that shows the subject from all sides, or one that is given goes round what it looks at.

        Parameters
        ----------
        angles : degrees
        scene, size, subject : as in `camera_of`
        """
        if self.of_file or self.eye is not None or isinstance(self.camera, Camera):
            camera = self.camera_of(scene, size, subject)
            pivot = pivot_of(camera, scene.bounds)
            return turned_cameras(camera, angles, AXES[scene.up], pivot)
        settings = self.framing(scene.up, size)
        start = settings.pop("azimuth")
        cameras = Camera.orbit(scene if subject is None else subject(), [start + angle for angle in angles], **settings)
        return [zoomed(camera, self.zoom) for camera in cameras]


def is_path(camera: object) -> TypeGuard[str | os.PathLike[str]]:
    """Tell whether what is given as `camera` is the path of a file, and none of the words "file" and "frame"."""
    return isinstance(camera, (str, os.PathLike)) and camera not in ("file", "frame")


def words_given(words: Mapping[str, Any]) -> list[str]:
    """List which fields of `Viewpoint` say where the picture is taken from, and how: all that are given but `camera`
    and `zoom`."""
    names = ("view", "azimuth", "elevation", "fov", "eye", "target", "margin")
    return [name for name in names if words[name] is not None] + ["ortho"] * bool(words["ortho"])


def check_words(words: Mapping[str, Any], mark: str = "") -> None:
    """Raise SceneError where the fields of `Viewpoint` can't be together, or are no words; `mark` is what stands before
    their names, -- on the command line."""
    camera, view = words["camera"], words["view"]
    is_empty = isinstance(camera, str) and not camera
    if is_empty or not (camera is None or isinstance(camera, (Camera, Viewpoint, str, os.PathLike))):
        raise SceneError(f'{mark}camera must be a Camera, "file", "frame", a path or None; given {shown(camera)}')
    if isinstance(camera, str) and camera in VIEWS:
        raise SceneError(f"{camera!r} is a view, no camera: give it as {mark}view")
    is_pair = view.shape == (2,) if isinstance(view, np.ndarray) else isinstance(view, (tuple, list)) and len(view) == 2
    if not (view is None or is_pair or (isinstance(view, str) and view in VIEWS)):
        raise SceneError(f"{mark}view must be one of {', '.join(VIEWS)}, or (azimuth, elevation); given {shown(view)}")
    number(words["zoom"], f"{mark}zoom", above=0)
    flag(words["ortho"], f"{mark}ortho")
    given = words_given(words)
    if given and camera is not None and not (isinstance(camera, str) and camera == "frame"):
        others = ", ".join(mark + name for name in given)
        raise SceneError(f"a picture has a camera, or words that frame it; given {mark}camera, {others}")
    if words["eye"] is None and words["target"] is not None:
        raise SceneError(f"{mark}target needs {mark}eye")
    if words["eye"] is not None and not _FRAMED.isdisjoint(given):
        others = f"{mark}view, {mark}azimuth, {mark}elevation or {mark}margin"
        raise SceneError(f"{mark}eye and {mark}target can't be used with {others}")


def zoomed(camera: Camera, zoom: float) -> Camera:
    """Make everything `zoom` times larger in the picture, from the same place."""
    if zoom == 1.0:
        return camera
    if camera.intrinsics is not None and camera.size is not None:
        fx, fy, cx, cy = camera.intrinsics
        (width, height), (x, y) = camera.size, (cx + 0.5, cy + 0.5)
        # The middle of the picture stays where it is; OpenCV counts from the centre of the first pixel.
        x, y = width / 2 + (x - width / 2) * zoom, height / 2 + (y - height / 2) * zoom
        return replace(camera, intrinsics=(fx * zoom, fy * zoom, x - 0.5, y - 0.5), skew=camera.skew * zoom)
    if camera.height is not None:
        return replace(camera, height=camera.height / zoom)
    slope = math.tan(math.radians(camera.fov or 0.0) / 2.0) / zoom
    return replace(camera, fov=math.degrees(2.0 * math.atan(slope)))
