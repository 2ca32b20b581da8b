"""The flags of `raster view`."""

from . import values
from .edge_arguments import add_edges
from .flags import add_camera, add_loading, add_messages, add_models, add_tolerance
from .help_texts import VIEW
from .look_flags import add_ground, add_look, add_method

MOST_PORT = 65535


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster view MODEL [options]"
    parser.description = VIEW
    parser.set_defaults(outputs=None, default_size=None)
    add_models(parser)
    page = parser.add_argument_group("page")
    page.add_argument("--open", dest="is_opened", action="store_true", help="open the page in a browser")
    page.add_argument("--once", dest="is_once", action="store_true", help="end when the page is closed")
    page.add_argument(
        "--port", type=values.whole, default=0, metavar="N", help="where the page is served (default: one that is free)"
    )
    add_camera(parser)
    look = parser.add_argument_group("look at first")
    add_method(look)
    add_look(look)
    add_ground(look)
    add_edges(look)
    exactness = parser.add_argument_group("exactness and speed")
    add_tolerance(exactness)
    add_loading(exactness)
    add_messages(parser)
