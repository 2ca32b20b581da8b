"""The flags of `raster bench`."""

from .. import choices
from ..options import Options
from . import values
from .flags import add_camera, add_loading, add_messages, add_models, add_size
from .help_texts import BENCH
from .look_flags import add_look


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster bench MODEL... [--plot OUT] [options]"
    parser.description = BENCH
    parser.set_defaults(outputs=None, default_name="{stem}-bench", default_suffix=".png", always_writes=False)
    parser.set_defaults(default_size=Options.size)
    add_models(parser)
    parser.add_argument(
        "--plot",
        dest="output",
        metavar="OUT",
        help="draw time against error, as .png, .svg or .pdf; with {stem} or {view} for several (needs matplotlib)",
    )
    add_size(parser, Options.size)
    parser.add_argument("--json", action="store_true", help="print a line of JSON for each model instead of the table")
    _add_measured(parser.add_argument_group("what is measured", "Lists have commas between their values."))
    add_camera(parser)
    add_look(parser.add_argument_group("look"))
    add_loading(parser.add_argument_group("loading and speed"))
    add_messages(parser)


def _add_measured(group) -> None:
    add = group.add_argument
    add(
        "--shadings",
        type=values.list_of(str, choices.SHADINGS),
        default=("flat", "gouraud", "phong"),
        metavar="LIST",
        help="shading methods (default flat,gouraud,phong)",
    )
    add(
        "--subdivisions",
        type=values.list_of(values.whole, range(16)),
        default=(0, 1, 2),
        metavar="LIST",
        help="times that triangles are cut in four for gouraud (default 0,1,2)",
    )
    add(
        "--samples",
        dest="list_of_samples",
        type=values.list_of(values.whole, choices.SAMPLES),
        default=(1, 4, 16),
        metavar="LIST",
        help="samples a pixel (default 1,4,16)",
    )
    add(
        "--tolerances",
        type=values.list_of(values.fraction),
        default=(0.0, Options.tolerance, 1 / 64),
        metavar="LIST",
        help="errors accepted (default 0,1/4096,1/64)",
    )
    add(
        "--flip", dest="with_flip", action="store_true", help="also FLIP, 0 to 1 (needs flip-evaluator; a second a row)"
    )
    add("--seconds", type=values.number, default=50.0, metavar="N", help="time limit (default 50); compiling is extra")
