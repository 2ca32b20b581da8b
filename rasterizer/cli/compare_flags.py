"""The flags of `raster compare`."""

from . import values
from .defaults import COMPARED_SIZE
from .flags import add_camera, add_files, add_loading, add_messages
from .help_texts import COMPARE
from .look_flags import add_look


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster compare MODEL... [-o OUT] [options]"
    parser.description = COMPARE
    add_files(parser, "{stem}-compare", COMPARED_SIZE)
    _add_reference(parser)
    add_camera(parser)
    add_look(parser.add_argument_group("look"))
    add_loading(parser.add_argument_group("loading and speed"))
    add_messages(parser)


def _add_reference(parser) -> None:
    parser.set_defaults(outputs=None)  # a sheet of pictures, no array
    parser.add_argument(
        "--methods",
        type=values.list_of(values.method),
        default=("flat", "gouraud", "phong"),
        metavar="LIST",
        help="what is compared, with commas between; gouraud+N cuts triangles in four N times before "
        "(default flat,gouraud,phong)",
    )
    parser.add_argument(
        "--no-reference",
        dest="has_reference",
        action="store_false",
        help="compare with Phong's shading as rendered, which is quicker",
    )
