"""The command line: `raster render MODEL...`, `raster compare MODEL...` and `raster warmup`.

    arguments ─ models, outputs ─ cameras, lights ─ load ─ Renderer ─ file
    argparse    globs, names      before anything    one model after the other
                                  is loaded

Exit codes: 0 done · 1 some inputs failed, the rest was done · 2 usage · 3 a model can't be read or is empty
· 4 an output can't be written · 130 interrupted. Whatever a user may do wrong ends in one line on stderr.

Only the standard library is imported before a command runs, so that `raster --help` is quick.
"""

import sys

from ..errors import ModelError, OutputError, RasterizerError
from .arguments import parse
from .messages import Messages, write_stdout

DONE, SOME_FAILED, USAGE, BAD_MODEL, NO_OUTPUT, INTERRUPTED = 0, 1, 2, 3, 4, 130


def main(argv=None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : list of text, the arguments without the program's name; None = those of the process

    Returns
    -------
    int, the exit code; `--help` and `--version` raise SystemExit, as argparse does
    """
    messages = Messages()
    try:
        try:
            arguments = parse(sys.argv[1:] if argv is None else argv)
            messages.level = arguments.level
            return _run(arguments, messages)
        finally:
            if sys.stdout is not None:
                write_stdout(b"")  # help is flushed here, where a fault can still be told
    except BrokenPipeError:  # the reader has seen enough
        return NO_OUTPUT
    except KeyboardInterrupt:
        messages.error("interrupted")
        return INTERRUPTED
    except RasterizerError as error:
        messages.error(error)
        return exit_code(error)


def exit_code(error) -> int:
    """The code of a failure."""
    if isinstance(error, ModelError):
        return BAD_MODEL
    return NO_OUTPUT if isinstance(error, OutputError) else USAGE


def _run(arguments, messages) -> int:
    """Run the command; each one imports what it needs."""
    if arguments.command == "warmup":
        from .warmup import warm_up

        warm_up(messages)
        return DONE
    if arguments.command == "compare":
        from .compare import compare_models as run
    else:
        from .render import render_models as run
    failures, n_model = run(arguments, messages)
    if failures and len(failures) < n_model:
        return SOME_FAILED
    return exit_code(failures[0]) if failures else DONE
