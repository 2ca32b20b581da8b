"""`raster view`: a page of one's own browser in which a model is turned, and its faces are picked."""

import os
from dataclasses import fields

from ..errors import SceneError
from ..options import Options
from ..viewer.server import Server
from ..viewer.session import PAPER, Session
from .cameras_lights import camera_of, check_camera, is_camera_given
from .load_scene import load_scene, make_settings, with_options
from .messages import compilation_shown, print_text
from .targets import list_models
from .view_flags import MOST_PORT
from .warnings import find_doubts

_SIZE = (800, 600)  # of the first picture, which shows whether there is one; the page has a size of its own
_NAMES = {field.name for field in fields(Options)} - {"size", "outputs"}


def view_model(arguments, messages) -> tuple[list, int]:
    """Serve a model's page until it is closed, with --once, or until the program is interrupted; parameters are those
    of `render_models`.

    Returns
    -------
    no failures, of one model

    Raises
    ------
    SceneError : an argument that is not legal, or more than one model or view
    ModelError : a model that can't be read
    OutputError : a port that can't be listened on
    """
    if not 0 <= arguments.port <= MOST_PORT:
        raise SceneError(f"--port must be within 0..{MOST_PORT}; given {arguments.port}")
    settings = make_settings(arguments)
    arguments.size = _SIZE
    check_camera(arguments)
    (model, *others), (view, *other_views) = list_models(arguments), arguments.views or [None]
    if others or other_views:
        given = f"{1 + len(others)} models, {1 + len(other_views)} views"
        raise SceneError(f"view shows one model, from one side at first; given {given}")
    session = _open_session(model, view, arguments, settings, messages)
    server = Server(session, arguments.port, is_once=arguments.is_once, note=messages.warn)
    try:
        print_text(f"{server.url}\n", False)
        end = "close the page or press Ctrl-C" if arguments.is_once else "press Ctrl-C"
        messages.notice(f"{model} is shown at this address, to this machine alone; {end} to end")
        if arguments.is_opened:
            _open_browser(server.url, messages)
        server.serve()
    finally:
        server.server_close()
    return [], 1


def _open_session(model, view, arguments, settings, messages) -> Session:
    """Load the model and draw it once, so that what is wrong is said here, and all kernels are compiled."""
    loaded, _, own_options, framing = load_scene(model, arguments, settings, messages)
    arguments = with_options(arguments, own_options, _NAMES, model)
    options = {name: getattr(arguments, name) for name in _NAMES}
    is_own = loaded.camera is None and framing is None and not is_camera_given(arguments) and arguments.zoom == 1.0
    camera = None if is_own else camera_of(arguments, view, loaded, framing)
    session = Session(loaded, camera=camera, title=os.path.basename(model), **options)
    with compilation_shown(messages):
        for is_rest in (False, True):
            session.answer({"size": list(_SIZE), "background": PAPER, "is_rest": is_rest, "events": []})
    for text in find_doubts(session.frame.stats, not session.frame.rgb.any(), loaded, arguments, session.camera):
        messages.warn(f"{model}: {text}")
    return session


def _open_browser(url, messages) -> None:
    """Open the page; a machine without a browser is no error."""
    import webbrowser

    if not webbrowser.open(url):
        messages.warn("no browser could be opened: open the address yourself")
