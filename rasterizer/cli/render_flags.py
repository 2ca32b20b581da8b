"""The flags of `raster render`."""

import argparse

from ..options import Options
from .arrays import add_arrays
from .flags import add_camera, add_files, add_messages, add_preview
from .help_texts import RENDER
from .look_flags import add_drawing

MOST_PROCESSES = 1024


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster render MODEL... [-o OUT] [options]"
    parser.description = "Draw each model and write a picture of it, or an array."
    parser.epilog = RENDER
    add_files(parser, "{stem}", Options.size)
    add_arrays(parser)
    add_preview(parser)
    add_camera(parser)
    add_processes(add_drawing(parser))
    add_messages(parser)


def add_processes(group) -> None:
    """Add how many processes draw."""
    group.add_argument(
        "-j",
        "--processes",
        dest="n_process",
        type=processes,
        metavar="N",
        help="draw N models at a time, each in a process of its own with one thread (unless --threads says more)",
    )


def processes(text) -> int:
    """How many processes."""
    if not text.isdecimal() or not 1 <= int(text[:9]) <= MOST_PROCESSES:
        raise argparse.ArgumentTypeError(f"1 to {MOST_PROCESSES} processes are legal; given {text!r}")
    return int(text)
