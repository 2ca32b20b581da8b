"""Scenes in a notebook: `view` shows one to be turned."""

from typing import TYPE_CHECKING, Any, Protocol

from .errors import SceneError
from .io.loader import load
from .options import Options
from .scene.camera import Camera
from .scene.scene import Scene
from .viewer.session import Session

if TYPE_CHECKING:
    from .frame import Frame
    from .viewer.controls import Picked

_SIZE = (800, 600)


class SceneView(Protocol):
    """A widget that shows a scene: what `view` returns. Packages of widgets have no types; this is what it adds."""

    @property
    def scene(self) -> Scene:
        """The scene that is shown."""

    @property
    def camera(self) -> Camera:
        """The camera as it stands now: `rz.render(widget.scene, camera=widget.camera)` draws what is seen."""

    @property
    def picked(self) -> "Picked | None":
        """The point that was clicked last: its face, object, position and normal; None if there is none."""

    @property
    def frame(self) -> "Frame | None":
        """The last picture at rest, with the buffers face, depth and normal; None before the first one."""

    def close(self) -> None:
        """Take the widget out of the notebook, and end the threads that draw."""


def view(
    scene: Any,
    size: int | tuple[int, int] = _SIZE,
    *,
    camera: Camera | None = None,
    shading: str = "phong",
    **options: Any,
) -> SceneView:
    """Show a scene in a cell of a notebook: drag to turn it, click to pick a face.

    Parameters
    ----------
    scene : Scene, or whatever `load` takes: a path, a mesh, a trimesh object
    size : (width, height) of the view in CSS pixels, or one number for a square; it is narrower where the cell is
    camera : Camera that is looked through at first; None = the scene's own, or one that shows all of it
    shading : "flat", "gouraud" or "phong", at first
    options : other options of `render` but `outputs`; `samples` are those of pictures at rest

    Returns
    -------
    SceneView, a widget that a cell shows; its `camera`, `picked` and `frame` tell what is seen

    Raises
    ------
    SceneError : an option that is not legal; anywidget is missing
    ModelError : a model that can't be read
    """
    try:
        from .viewer.widget import ViewerWidget
    except ModuleNotFoundError as fault:
        if fault.name not in ("anywidget", "traitlets"):
            raise
        raise SceneError(f"view needs {fault.name}: the extra `notebook` brings it") from fault
    scene = scene if isinstance(scene, Scene) else load(scene)
    checked = Options(size=size)
    title = ", ".join(dict.fromkeys(mesh.name for mesh in scene.meshes if mesh.name))
    session = Session(scene, camera=camera, title=title[:80], shading=shading, **options)
    return ViewerWidget(session, checked.size)
