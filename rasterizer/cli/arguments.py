"""The commands and their arguments: `raster --help` lists commands, and flags are made of the one that is called."""

import argparse
import re

from ..errors import SceneError
from ..version import __version__
from .help_texts import BENCH, COMPARE, EXAMPLES

_COMMANDS = {  # name: what `raster --help` says, and the arguments of its parser
    "render": (
        "draw models, one picture a file",
        {
            "usage": "raster render MODEL... [-o OUT] [options]",
            "description": "Draw each model and write a picture of it, or an array.",
            "epilog": EXAMPLES,
            "formatter_class": argparse.RawDescriptionHelpFormatter,
        },
    ),
    "compare": (
        "show flat, Gouraud's and Phong's shading beside the reference, with error maps",
        {
            "usage": "raster compare MODEL... [-o OUT] [options]",
            "description": COMPARE,
            "formatter_class": argparse.RawDescriptionHelpFormatter,
        },
    ),
    "bench": (
        "measure time against error of each way to draw a model, on this machine",
        {
            "usage": "raster bench MODEL... [--plot OUT] [options]",
            "description": BENCH,
            "formatter_class": argparse.RawDescriptionHelpFormatter,
        },
    ),
    "warmup": (
        "compile all kernels now, so that the first picture doesn't wait for it",
        {"description": "Compile the kernels of all shading methods and keep them on disk."},
    ),
}


def parse(argv) -> argparse.Namespace:
    """Parse the arguments; SceneError where they are not legal.

    Models and flags may come in any order. A value may begin with a minus sign: `--eye -1,2,3`, `--up -z`.
    """
    argv = _joined_values(list(argv))
    if argv and argv[0] in _COMMANDS:
        from .flags import add_flags, fill_in_defaults

        _, settings = _COMMANDS[argv[0]]
        parser = _Parser(f"raster {argv[0]}", allow_abbrev=False, **settings)
        add_flags(parser, argv[0])
        arguments = parser.parse_intermixed_args(argv[1:])
        arguments.command = argv[0]
        fill_in_defaults(arguments)
        return arguments
    _make_parser().parse_args(argv)  # help, the version, or an error
    raise SceneError(f"a command is missing: {' or '.join(_COMMANDS)} (see raster --help)")


def _joined_values(argv) -> list[str]:
    """Join a flag and a value that argparse would take for another flag: -1,2,3 or -z."""
    joined = []
    is_after_end = False
    for word in argv:
        is_after_end = is_after_end or word == "--"
        if is_after_end or not word.startswith("-"):
            joined.append(word)
            continue
        if re.fullmatch(r"-(\w|-[a-z-]+=|\w=)--", word):  # argparse would make a list of it
            raise SceneError(f"{word[:-2].removesuffix('=')} can't have the value -- (see raster --help)")
        is_value = joined and re.fullmatch(r"--[a-z]+(-[a-z]+)*", joined[-1]) and re.match(r"-(\.?\d|[xyz]$)", word)
        if is_value:
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are ours: one line, and the exit code chosen in one place."""

    def error(self, message):
        raise SceneError(f"{message} (see {self.prog} --help)")


def _make_parser() -> _Parser:
    """Make the parser of the program, which knows its commands by name alone."""
    parser = _Parser("raster", description="Draw 3-D models, without GPU, OpenGL or display.", allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"raster {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", title="commands", parser_class=_Parser)
    for name, (text, _) in _COMMANDS.items():
        commands.add_parser(name, help=text, add_help=False)
    return parser
