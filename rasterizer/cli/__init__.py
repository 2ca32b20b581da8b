"""The command line, `raster COMMAND MODEL...`. A command is the file of its name: its flags, and `run`.

    parser     the commands, how a command line is read, the help
    flags      the flags that several commands have, in groups
    values     what is written behind flags: numbers, colours, materials, lights
    request    what the arguments ask for; whatever runs is handed that
    models     which models are read, and how
    outputs    which pictures there are: their names, their formats, their files
    drawing    one model after another is drawn; processes: several at a time
    messages   what is said, and what failed

`raster --help` lists the exit codes. Where all models failed, the code is that of the first. Whatever a user may do
wrong ends in one line on stderr; so does a fault of the program's own, whose traceback is shown with -v.

Only the standard library is imported before a command runs, so that `raster --help` is quick; and next to nothing
before `main` does, so that an interrupt at any time ends in one line, too.
"""

import os
import sys

DONE, SOME_FAILED, USAGE, BAD_MODEL, NO_OUTPUT, INTERRUPTED = 0, 1, 2, 3, 4, 130
TERMINATED = 128 + 15  # by SIGTERM


def main(argv=None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : list of text, the arguments without the program's name; None = those of the process

    Returns
    -------
    int, the exit code; `--help` and `--version` raise SystemExit, as argparse does
    """
    try:
        return _run_as_program() if argv is None else _guarded(argv, lambda: None)
    except KeyboardInterrupt:
        return _interrupted()


def _run_as_program() -> int:
    """Run with the process's own arguments.

    A signal that comes while modules are imported ends the process at once: nothing is written yet, and libraries would
    make another error of it, or swallow it. Later it is raised, so that no half file stays.

    What imports make lives as long as the process. The collector of cyclic garbage has no business with it: looking
    through it would take time, while modules are imported and at the end. Nor are there threads for linear algebra, of
    which commands do little: to start them takes a fifth of the import of NumPy.

    One picture touches most of its memory once, and asks for no huge pages: to a virtual machine whose host takes back
    what is free they come late, and with them a command on a million triangles or large textures takes 1.05 to 1.35
    times as long. Many pictures of ten million triangles are drawn 1.4 times as fast with them.
    """
    import gc
    import signal

    from ..memory import keep_what_is_freed

    is_importing = True
    gc.disable()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    keep_what_is_freed()
    if sys.argv[1:2] == ["render"]:
        os.environ.setdefault("NUMPY_MADVISE_HUGEPAGE", "0")

    def is_imported():
        nonlocal is_importing
        is_importing = False
        gc.freeze()
        gc.enable()

    def end(number, _):
        if is_importing:
            os._exit(_interrupted() if number == signal.SIGINT else TERMINATED)
        raise KeyboardInterrupt if number == signal.SIGINT else SystemExit(TERMINATED)

    signal.signal(signal.SIGTERM, end)
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:  # as for a process that was started in the background
        signal.signal(signal.SIGINT, end)
    try:
        code = _guarded(sys.argv[1:], is_imported)
    except KeyboardInterrupt:
        code = _interrupted()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process ends: nothing is left to interrupt
    gc.freeze()  # and nothing to collect
    return code


def _interrupted() -> int:
    if sys.stderr is not None:
        print("raster: error: interrupted", file=sys.stderr, flush=True)
    return INTERRUPTED


def _guarded(argv, is_imported) -> int:
    """Run the command, and say what went wrong; `is_imported` is called when its modules are there."""
    from ..errors import RasterizerError
    from .messages import Messages, write_stdout
    from .parser import parse

    messages = Messages()
    try:
        try:
            arguments = parse(argv)
            messages.level = arguments.level
            with messages.shown_warnings():
                return _run(arguments, messages, is_imported)
        finally:
            if sys.stdout is not None:
                write_stdout(b"")  # help is flushed here, where a fault can still be said
    except BrokenPipeError:  # the reader has seen enough
        return NO_OUTPUT
    except RasterizerError as error:
        messages.error(error)
        return exit_code(error)
    except Exception as error:  # noqa: BLE001  whatever it is ends in one line
        from ..errors import error_of

        failure = error_of("command line", error)
        messages.error(failure)
        messages.traceback(error)
        return exit_code(failure)


def exit_code(error) -> int:
    """The code of a failure."""
    from ..errors import ModelError, OutputError

    if isinstance(error, ModelError):
        return SOME_FAILED if error.is_internal else BAD_MODEL
    return NO_OUTPUT if isinstance(error, OutputError) else USAGE


def _run(arguments, messages, is_imported) -> int:
    """Run the command; each one imports what it uses, what it draws with before it is run. Before a long file that is
    done while the file is read: most of which is done without the GIL."""
    from importlib import import_module
    from threading import Thread

    from ..io.files import LONG
    from .parser import command_module

    command = command_module(arguments.command)
    names = getattr(command, "IMPORTS", ())
    for name in names:
        import_module(f"{__package__}.{name}")
    if "drawing" in names:
        model = next(iter(getattr(arguments, "models", ())), "")
        if os.path.isfile(model) and os.path.getsize(model) >= LONG:
            Thread(target=_import_renderer).start()
        else:
            _import_renderer()
    request, own = _read(arguments)
    is_imported()
    if getattr(request, "is_seed_assumed", False):
        messages.notice("what is random has the seed 0; --seed N makes others")
    failures, n_model = command.run(request, messages, **own)
    if failures and len(failures) < n_model:
        return SOME_FAILED
    return exit_code(failures[0]) if failures else DONE


def _read(arguments) -> tuple:
    """Return the Request, of a command that has models, and the flags of the command's own."""
    if hasattr(arguments, "models"):
        from .request import make_request

        return make_request(arguments)
    return None, {name: value for name, value in vars(arguments).items() if name not in ("command", "level")}


def _import_renderer() -> None:
    from contextlib import suppress
    from importlib import import_module

    with suppress(Exception):  # it is raised where a Renderer is made
        import_module("..renderer", __package__)
