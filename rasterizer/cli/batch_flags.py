"""The flags of `raster batch`: those of `raster render`, and how many processes draw, where, and what."""

from ..options import Options
from .arrays import add_arrays
from .flags import add_camera, add_files, add_messages
from .help_texts import BATCH
from .look_flags import add_drawing
from .render_flags import add_processes


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster batch MODEL... [-o OUT] [-j N] [options]"
    parser.description = "Draw each model in one of several processes, and write a picture of it, or an array."
    parser.epilog = BATCH
    add_files(parser, "{stem}", Options.size)
    add_arrays(parser)
    _add_work(parser.add_argument_group("work"))
    add_camera(parser)
    add_drawing(parser)
    add_messages(parser)


def _add_work(group) -> None:
    add_processes(group)
    add = group.add_argument
    add(
        "--scheduler",
        metavar="ADDRESS",
        help="draw on the workers of this scheduler of Dask, tcp://HOST:PORT (extra distributed)",
    )
    add(
        "--resume",
        dest="is_resumed",
        action="store_true",
        help="leave out pictures whose file is there and no older than the model's",
    )
