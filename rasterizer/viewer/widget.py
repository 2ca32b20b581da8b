"""`rz.view`: the viewer in a cell of a notebook. anywidget carries messages between the cell and the kernel (the extra
`notebook`)."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from ..appearance import Appearance
from ..errors import SceneError, error_of, import_extra
from ..frame import Frame
from ..io.camera_file import viewpoint_of
from ..keywords import divided, takes_words
from ..options import Options
from ..picking import Pick
from ..renderer import load_with_appearance, render
from ..scene.camera import Camera
from ..scene.scene import Scene
from ..viewpoint import Viewpoint
from .session import Session

if TYPE_CHECKING:
    from ..keywords import Unpack
    from ..words import RenderWords

_SIZE = (800, 600)
_FOLDER = Path(__file__).parent / "page"


class SceneView(Protocol):
    """A widget that shows a scene: what `view` returns. Packages of widgets have no types; this is what it adds."""

    @property
    def scene(self) -> Scene:
        """The scene that is shown."""

    @property
    def camera(self) -> Camera:
        """The camera as it stands now: `rz.render(widget.scene, camera=widget.camera)` draws what is seen."""

    @property
    def picked(self) -> Pick | None:
        """What was clicked last, as `Frame.pick` tells it; None if nothing was."""

    @property
    def frame(self) -> Frame | None:
        """The last picture at rest, with the buffers face, depth and normal; None before the first one."""

    def close(self) -> None:
        """Take the widget out of the notebook, and end the threads that draw."""


@takes_words(Viewpoint, Appearance, Options, but=("size", "outputs"))
def view(
    scene: Any,
    size: int | Sequence[int] = _SIZE,
    *,
    options: Options | None = None,
    **words: Unpack[RenderWords],
) -> SceneView:
    """Show a scene in a cell of a notebook: drag to turn it, click to pick a face.

    Parameters
    ----------
    scene : Scene, or whatever `load` takes: a path, a mesh, a trimesh object
    size : (width, height) of the view in CSS pixels, or one number for a square; it is narrower where the cell is
    options, words : those of `render`, but `outputs`. Where it is taken from, and `shading`, are so at first; `samples`
        are those of pictures at rest

    Returns
    -------
    SceneView, a widget that a cell shows; its `camera`, `picked` and `frame` tell what is seen

    Raises
    ------
    SceneError : an option that is not legal; anywidget is missing
    ModelError : a model that can't be read
    """
    anywidget: Any = import_extra("anywidget", "notebook", "view", SceneError)
    traitlets: Any = import_extra("traitlets", "notebook", "view", SceneError)

    class Widget(anywidget.AnyWidget):  # a SceneView
        _esm = _FOLDER / "viewer.js"
        _css = _FOLDER / "viewer.css"
        size = traitlets.Tuple(traitlets.Int(), traitlets.Int()).tag(sync=True)
        scene = property(lambda self: session.scene)
        camera = property(lambda self: session.camera)
        picked = property(lambda self: session.picked)
        frame = property(lambda self: session.frame)

        def _repr_mimebundle_(self, **words: Any) -> Any:
            """What is shown; where no widget can be, as in a notebook that was saved, a picture of what is seen now."""
            bundle = super()._repr_mimebundle_(**words)
            data, metadata = bundle if isinstance(bundle, tuple) else (bundle or {}, {})
            now = settings | {"shading": session.shading, "outputs": "rgb"}
            picture = render(session.scene_now, self.size, camera=session.camera, **now)
            return data | {"image/png": b64encode(picture.encode()).decode("ascii")}, metadata

        def close(self) -> None:
            super().close()
            session.close()

    if TYPE_CHECKING:  # how Jedi finds the words
        render(scene, **words)
    view_words, others = divided(words, Viewpoint)
    viewpoint = viewpoint_of(view_words)
    scene, made, framing, _ = load_with_appearance(scene, others, size, options, viewpoint.of_file)
    title = ", ".join(dict.fromkeys(mesh.name for mesh in scene.meshes if mesh.name))
    settings = {name: value for name, value in vars(made).items() if name not in ("size", "outputs")}
    session = Session(scene, title=title[:80], **settings)
    if view_words or framing:
        session.look_through(viewpoint.over(framing).camera_of(scene, made.size, session.subject))
    widget = Widget(size=made.size)
    widget.on_msg(lambda _, content, __: _answer(session, widget, content))
    return widget


def _answer(session: Session, widget: Any, content: Any) -> None:
    """Answer a message of one of the cells that show a widget."""
    if not isinstance(content, dict) or "view" not in content:
        return  # not from viewer.js
    number = content["view"]
    try:
        reply = session.answer(content.get("message"))
    except Exception as fault:  # noqa: BLE001  whatever it is, the cell says it
        widget.send({"view": number, "error": str(error_of(session.title, fault))})
        return
    status = {**reply.status, "type": reply.media_type}
    widget.send({"view": number, "status": status}, [reply.content])
