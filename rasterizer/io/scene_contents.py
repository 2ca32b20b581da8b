"""What a scene file holds; who loads a model imports this alone, and no reader of scene files."""

from dataclasses import replace
from typing import NamedTuple

from ..scene.camera import Camera
from ..scene.scene import Scene
from ..scene.validate import picture_size


class SceneFile(NamedTuple):
    """What a scene file holds.

    Parameters
    ----------
    scene : Scene; without a camera where the file asks for framing
    options : dict of options of a picture by name, not checked
    framing : dict of arguments of `Camera.framing`, or None where the file has a camera or none at all
    unshadowed : places of those lights that say `shadow = false`, other than those that say nothing
    """

    scene: Scene
    options: dict = {}
    framing: dict | None = None
    unshadowed: tuple[int, ...] = ()

    def framed_scene(self) -> Scene:
        """Return the scene with a camera where the file asks for framing: for a picture of the file's size, else of
        4:3."""
        if self.framing is None:
            return self.scene
        size = self.options.get("size", (4, 3))
        width, height = picture_size(size if isinstance(size, tuple) else (size, size))
        camera = Camera.framing(self.scene, up=self.scene.up, aspect=width / height, **self.framing)
        return replace(self.scene, camera=camera)
