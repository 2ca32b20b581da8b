"""`raster view`: a page of one's own browser in which a model is turned, and its faces are picked."""

import os
from dataclasses import replace

from ..errors import SceneError
from . import values
from .flags import add_appearance, add_camera, add_messages, add_models
from .messages import compilation_shown, print_text

IMPORTS = ("drawing",)
_DESCRIPTION = """\
Show a model in a page of your browser, to be turned, moved and zoomed. A click tells which face is seen, of which
object, and its position and normal. At rest it is drawn as raster render draws it, on the page's colour where
it has no background. While something moves it is drawn with one sample a pixel, and smaller where that takes long. The
page shows the flags of raster render that draw the same view.
"""
_PAGE = """\
The address on stdout is served to this machine alone, and holds a random token. Over SSH: ssh -L 8000:localhost:8000
HOST, then there raster view MODEL --port 8000.
"""
_SIZE = (800, 600)  # of the first picture, which shows whether there is one; the page has a size of its own
_MAX_PORT = 65535


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster view MODEL [options]"
    parser.description = _DESCRIPTION
    parser.set_defaults(default_size=_SIZE)
    add_models(parser)
    page = parser.add_argument_group("page", _PAGE)
    page.add_argument("--open", dest="is_opened", action="store_true", help="open the page in a browser")
    page.add_argument("--once", dest="is_once", action="store_true", help="end when the page is closed")
    page.add_argument("--port", type=values.whole, default=0, metavar="N",
        help="where the page is served (default: one that is free)")  # fmt: skip
    add_messages(page)
    add_camera(parser)
    add_appearance(parser)


def run(request, messages, *, is_opened, is_once, port) -> tuple[list, int]:
    """Serve a model's page until it is closed, with --once, or until the program is interrupted.

    Returns
    -------
    no failures, of one model

    Raises
    ------
    SceneError : an argument that is not legal, or more than one model or view
    ModelError : a model that can't be read
    OutputError : a port that can't be listened on
    """
    from ..viewer.server import Server
    from .models import list_models

    if not 0 <= port <= _MAX_PORT:
        raise SceneError(f"--port must be within 0..{_MAX_PORT}; given {port}")
    request = replace(request, of_file=request.of_file - {"size"})
    (model, *others), (view, *other_views) = list_models(request), request.views
    if others or other_views:
        given = f"{1 + len(others)} models, {1 + len(other_views)} views"
        raise SceneError(f"view shows one model, from one view at first; given {given}")
    session = _open_session(model, view, request, messages)
    server = Server(session, port, is_once=is_once, note=messages.warn)
    try:
        print_text(f"{server.url}\n")
        end = "close the page or press Ctrl-C" if is_once else "press Ctrl-C"
        messages.notice(f"{model} is shown at this address, to this machine alone; {end} to end")
        if is_opened:
            import webbrowser

            if not webbrowser.open(server.url):  # a machine without a browser is no error
                messages.warn("no browser could be opened: open the address yourself")
        server.serve()
    finally:
        server.server_close()
    return [], 1


def _open_session(model, view, request, messages):
    """Load the model and draw it once, so that what is wrong is said here, and all kernels are compiled; return the
    Session."""
    from ..viewer.session import PAPER, Session
    from .drawing import picture_warnings
    from .models import load_scene

    loaded = load_scene(model, request, messages)
    scene, request = loaded.scene, loaded.request
    options = {name: value for name, value in vars(request.options).items() if name not in ("size", "outputs")}
    is_framed = scene.camera is None and request.framing is None and not request.is_view_given
    session = Session(scene, title=os.path.basename(model), **options)
    if not is_framed or request.viewpoint.zoom != 1.0:
        session.look_through(request.camera_of(view, scene, session.subject))
    with compilation_shown(messages):
        for is_rest in (False, True):
            session.answer({"size": list(_SIZE), "background": PAPER, "is_rest": is_rest, "events": []})
    messages.warn(*picture_warnings(session.frame, scene, request, session.camera, model))
    return session
