"""Whatever a caller has becomes a scene that is looked at as the caller says: what `render` does before it draws."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..scene.camera import Camera
from ..scene.scene import Scene, SceneLike
from ..scene.validate import number
from .loader import FileLike, load

AZIMUTH, ELEVATION = 35.0, 25.0  # degrees; those of `Camera.framing`, a test holds that


def scene_of(source: SceneLike | FileLike, **settings: Any) -> Scene:
    """Return whatever `load` takes as a scene.

    Parameters
    ----------
    source : Scene, or anything else that `load` takes
    settings : arguments of `load`; None = as the source has it

    Returns
    -------
    Scene, the one given where nothing changes

    Raises
    ------
    ModelError, SceneError : as `load`
    """
    settings = {name: value for name, value in settings.items() if value is not None}
    return source if isinstance(source, Scene) and not settings else load(source, **settings)


def framed_from(
    scene: Scene,
    size: tuple[int, int],
    azimuth: float | None = None,
    elevation: float | None = None,
    subject: Scene | NDArray[np.float64] | None = None,
) -> Camera:
    """Return the camera that frames a scene from a side, for a picture of a size (width, height); `subject` may be
    points (n, 3) that are framed in its place.

    Raises
    ------
    SceneError : angles that are not legal

    Angles are those of `Camera.framing`, and have its defaults where one is None.
    """
    azimuth = AZIMUTH if azimuth is None else number(azimuth, "the azimuth")
    elevation = ELEVATION if elevation is None else number(elevation, "the elevation")
    subject, aspect = scene if subject is None else subject, size[0] / size[1]
    if subject is scene and (azimuth, elevation) == (AZIMUTH, ELEVATION):
        return scene.framed(aspect)  # which is kept
    return Camera.framing(subject, azimuth, elevation, aspect=aspect, up=scene.up)


def check_one_view(camera: Camera | None, **angles: float | None) -> None:
    """Refuse a camera beside angles, which ask for another one; SceneError names them."""
    given = [name for name, value in angles.items() if value is not None]
    if camera is not None and given:
        raise SceneError(f"a picture has a camera, or a side that it is framed from; given camera, {', '.join(given)}")
