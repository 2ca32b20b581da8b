"""The ground under a model: its shadow, and what of it a picture shows."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..frame import Frame
from ..renderer import Renderer
from ..scene.camera import Camera
from ..scene.scene import Scene

if TYPE_CHECKING:
    from ..ground_shadow import GroundShadow


def make_ground(arguments, scene: Scene, threads: int | None) -> "GroundShadow | None":
    """Return the shadow under a model, or None where no ground is wanted."""
    if not arguments.ground:
        return None
    from ..ground_shadow import GroundShadow

    return GroundShadow(scene, threads=threads)


def framed_points(scene: Scene, ground: "GroundShadow | None") -> Scene | NDArray[np.float64]:
    """Return what a picture of a scene is framed on: the scene, or its vertices and most of the shadow under it.

    Arrays are framed as pictures are, so that their pixels are those of the picture.
    """
    if ground is None:
        return scene
    return np.concatenate([*(mesh.used_vertices for mesh in scene.meshes), ground.outline()])


class OnGround:
    """Draw pictures as a Renderer does, with the shadow under them.

    Parameters
    ----------
    renderer : Renderer of the scene, without a background where there is a ground
    ground : GroundShadow; None = pictures are left as they are
    background : of the scene
    """

    def __init__(self, renderer: Renderer, ground: "GroundShadow | None", background) -> None:
        self.options = renderer.options
        self._renderer, self._ground, self._background = renderer, ground, background

    def render(self, camera: Camera) -> Frame:
        """Draw the picture through a camera."""
        frame = self._renderer.render(camera)
        return frame if self._ground is None else self._ground.under(frame, camera, self._background)


def bare(scene: Scene, ground: "GroundShadow | None") -> Scene:
    """Return the scene as it is drawn: where there is a ground, the background comes behind it."""
    return scene if ground is None else replace(scene, background=None)
