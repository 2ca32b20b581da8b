"""The flags of `raster warmup`."""

from .. import choices
from .flags import add_messages


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.description = "Compile the kernels of all shading methods and keep them on disk."
    parser.add_argument(
        "--into",
        metavar="FOLDER",
        help="make a store that can be shipped: it is found where FOLDER is the installed package's folder `kernels`",
    )
    parser.add_argument(
        "--cpu", choices=choices.PROCESSOR_LEVELS, help="what the code shall run on (default: this machine's processor)"
    )
    add_messages(parser)
