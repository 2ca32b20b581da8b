"""The viewer in a cell of a notebook. anywidget carries messages between the cell and the kernel (the extra
`notebook`)."""

from pathlib import Path
from typing import Any

import anywidget
import traitlets

from ..errors import error_of
from ..frame import Frame
from ..scene.camera import Camera
from ..scene.scene import Scene
from .controls import Picked
from .session import Session

_FOLDER = Path(__file__).parent / "page"


class ViewerWidget(anywidget.AnyWidget):
    """Show a scene in a cell of a notebook, to be turned and picked from.

    Parameters
    ----------
    session : Session that is looked at
    size : (width, height) of the view in CSS pixels; it is narrower where the cell is
    """

    _esm = _FOLDER / "viewer.js"
    _css = _FOLDER / "viewer.css"
    size = traitlets.Tuple(traitlets.Int(), traitlets.Int()).tag(sync=True)

    def __init__(self, session: Session, size: tuple[int, int]) -> None:
        self._session = session
        super().__init__(size=size)
        self.on_msg(self._answer)

    @property
    def scene(self) -> Scene:
        """The scene that is shown."""
        return self._session.scene

    @property
    def camera(self) -> Camera:
        """The camera as it stands now: `rz.render(widget.scene, camera=...)` draws what is seen."""
        return self._session.camera

    @property
    def picked(self) -> Picked | None:
        """The point that was clicked last: its face, object, position and normal; None if there is none."""
        return self._session.picked

    @property
    def frame(self) -> Frame | None:
        """The last picture at rest, with the buffers face, depth and normal; None before the first one."""
        return self._session.frame

    def close(self) -> None:
        """Take the widget out of the notebook, and end the threads that draw."""
        super().close()
        self._session.close()

    def _answer(self, _: object, content: Any, __: object) -> None:
        """Answer a message of one of the cells that show this widget."""
        if not isinstance(content, dict) or "view" not in content:
            return  # not from viewer.js
        view = content["view"]
        try:
            reply = self._session.answer(content.get("message"))
        except Exception as fault:  # noqa: BLE001  whatever it is, the cell says it
            self.send({"view": view, "error": str(error_of(self._session.title, fault))})
            return
        status = {**reply.status, "type": reply.media_type}
        self.send({"view": view, "status": status}, [reply.content])
