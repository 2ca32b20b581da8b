"""Cameras from the arguments: flags have the names of the words of `Viewpoint`."""

from types import SimpleNamespace

import numpy as np

from ..errors import SceneError
from ..io.camera_file import viewpoint_of
from ..scene.camera import Camera
from ..viewpoint import Viewpoint, check_words, words_given, zoomed
from .values import seed_of

_WORDS = ("camera", "azimuth", "elevation", "fov", "ortho", "zoom", "margin", "eye", "target")


def _words_of(arguments, view=None) -> dict:
    """The words of `Viewpoint` that the flags are."""
    view = view if seed_of(view) is None else None
    return {"view": view} | {name: getattr(arguments, name) for name in _WORDS}


def is_camera_given(arguments) -> bool:
    """Tell whether any flag but --zoom and --camera says where the picture is taken from, and how."""
    return bool(arguments.views or arguments.up is not None or words_given(_words_of(arguments)))


def check_camera(arguments) -> None:
    """Raise SceneError where no model could be looked at like this; something stands in for the model.

    A file of --camera is read, and what it holds is kept in the arguments.
    """
    for view in arguments.views or [None]:
        words = _words_of(arguments, view)
        check_words(words, "--")
        if seed_of(view) is not None:
            given = ["camera"] * (arguments.camera not in (None, "frame")) + words_given(words)
            if given:
                raise SceneError(f"a random view is framed by its seed; given --view random, --{', --'.join(given)}")
            continue
        viewpoint = viewpoint_of(words)
        if isinstance(arguments.camera, str) and arguments.camera not in ("file", "frame"):
            held = viewpoint_of({"camera": arguments.camera})
            arguments.camera_file = arguments.camera
            arguments.camera = held.camera if isinstance(held.camera, Camera) else held
        if arguments.camera != "file":
            box = np.array([[1.0, 2.0, 3.0], [2.0, 3.0, 4.0]]) + (arguments.eye or (0.0, 0.0, 0.0))
            up = "y" if arguments.up in (None, "auto") else arguments.up
            viewpoint.camera_of(SimpleNamespace(camera=None, bounds=box, up=up), arguments.size, lambda box=box: box)


def camera_of(arguments, view, scene, framing=None, subject=None) -> Camera:
    """Make the camera for a view of a scene, by its name or None; `framing` is a scene file's, the others are those
    of `Viewpoint.camera_of`."""
    if (seed := seed_of(view)) is not None:
        return zoomed(Camera.random(scene, seed, size=arguments.size), arguments.zoom)
    return Viewpoint(**_words_of(arguments, view)).over(framing).camera_of(scene, arguments.size, subject)


def cameras_round(arguments, angles, scene, framing, subject, has_target) -> list[Camera]:
    """Make the cameras of a turntable; the parameters are those of `Viewpoint.cameras_round`."""
    viewpoint = Viewpoint(**_words_of(arguments)).over(framing)
    return viewpoint.cameras_round(angles, scene, arguments.size, subject, has_target=has_target)
