"""`raster batch`: many models in several processes, or on many machines."""

from time import perf_counter

from ..errors import SceneError
from ..options import Options
from .flags import add_arrays, add_camera, add_look, add_models, add_output, add_processes

IMPORTS = ("drawing", "processes")
_EXAMPLES = """\
examples:
  raster batch 'parts/*.stl' -o 'thumbs/{stem}-{view}.png' --view front,top -j 4
  raster batch parts --recursive -o thumbs/ --skip-existing  below thumbs/
  raster batch 'scans/*.obj' -o pictures/ --scheduler tcp://10.0.0.1:8786 --json

One picture that can't be drawn doesn't stop the others, whatever the reason. A file appears whole or not at all, so a
batch that was interrupted goes on with --resume or --skip-existing; these don't ask how a file was made. The last line
on stderr, and with --json the last on stdout, counts what was drawn, skipped and failed.

Dask's workers read models themselves where they see the same file, of the same length and time of change; else it is
loaded here and sent. Files are written here.
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster batch MODEL... [-o OUT] [-j N] [options]"
    parser.description = "Draw each model in one of several processes, and write a picture of it, or an array."
    parser.epilog = _EXAMPLES
    add_models(parser)
    add_output(parser, "{stem}", Options.size)
    add_arrays(parser)
    group = parser.add_topic("work", is_own=True)
    add_processes(group)
    add = group.add_argument
    add("--scheduler", metavar="ADDRESS",
        help="draw on the workers of this scheduler of Dask, tcp://HOST:PORT (extra distributed)")  # fmt: skip
    add("--resume", dest="is_resumed", action="store_true",
        help="leave out pictures whose file is there and no older than the model's")  # fmt: skip
    add_camera(parser)
    add_look(parser)


def run(arguments, messages) -> tuple[list, int]:
    """Draw every model; parameters, result and errors are those of `drawing.draw_models`."""
    from ..batch.rendering import is_there
    from .outputs import plan_targets, without
    from .processes import can_use_processes, draw_in_processes
    from .render import check_options, render_model

    def is_left_out(target) -> bool:
        if arguments.skip_existing:
            return is_there(target.output, None)
        return arguments.is_resumed and is_there(target.output, target.model)

    start = perf_counter()
    check_options(arguments)
    if not can_use_processes(arguments):
        raise SceneError("raster batch reads and writes files; for stdin and stdout there is raster render")
    plan, n_left_out = without(plan_targets(arguments), is_left_out)
    failures, n_model, summary = draw_in_processes(arguments, messages, plan, render_model, arguments.scheduler)
    summary.skipped, summary.seconds = n_left_out, perf_counter() - start
    messages.notice(str(summary))
    if arguments.json:
        messages.record(vars(summary) | {"seconds": round(summary.seconds, 4)})
    return failures, n_model
