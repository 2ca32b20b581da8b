"""The commands and their arguments: `raster --help` lists commands, and flags are made of the one that is called."""

import argparse
import glob
import os
import re

from .. import __version__
from ..errors import SceneError
from .commands import COMMANDS
from .suggestions import did_you_mean, nearest_flag


def parse(argv) -> argparse.Namespace:
    """Parse the arguments; SceneError where they are not legal.

    Models and flags may come in any order. A value may begin with a minus sign: `--eye -1,2,3`, `--up -z`. Without a
    command, models are drawn.
    """
    argv = _with_command(_joined_values(list(argv)))
    if argv[0] not in COMMANDS:
        _make_parser().parse_args(argv)  # help, the version, or an error
        raise SceneError(f"a command is missing: {' or '.join(COMMANDS)} (see raster --help)")
    from .flags import fill_in_defaults

    parser = make_command_parser(COMMANDS[argv[0]])
    arguments = parser.parse_intermixed_args(argv[1:])
    arguments.command = argv[0]
    fill_in_defaults(arguments)
    return arguments


def _with_command(argv) -> list[str]:
    """Put a command, or a flag of the program's own, in the first place: help without arguments, `render` before
    models."""
    if not argv or argv == ["help"]:
        return ["--help"]
    first = argv[0]
    if first in COMMANDS or first in ("-h", "--help", "--version"):
        return argv
    if first == "help":
        return [argv[1], "--help"] if argv[1] in COMMANDS else _with_command(argv[1:])
    if first.startswith("-") and first != "-":
        for word in argv[1:]:
            if word in COMMANDS and not os.path.exists(word):
                raise SceneError(f"the command comes first: raster {word} {first} ... (see raster --help)")
        return ["render", *argv] if any(map(_is_model, argv)) else argv
    if _is_model(first):
        return ["render", *argv]
    commands, meant = ", ".join(COMMANDS), did_you_mean(first, COMMANDS)
    raise SceneError(f"there is no command and no file {first!r} (commands are {commands}){meant} (see raster --help)")


def _is_model(word) -> bool:
    """Tell whether a word names a file or stdin rather than a command: it is there, or looks like a path."""
    if word.startswith("-") and word != "-":
        return False
    return word == "-" or os.path.exists(word) or glob.has_magic(word) or bool(re.search(r"[./\\]", word))


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
        is_value = joined and re.fullmatch(r"--[a-z]+(-[a-z]+)*", joined[-1]) and re.match(r"-(\.?\d|[xyzXYZ]$)", word)
        if is_value:
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are ours: one line, and the exit code chosen in one place."""

    def error(self, message):
        """Raise SceneError, with what was probably meant."""
        if message.startswith("unrecognized arguments: "):
            flags = [flag for action in self._actions for flag in action.option_strings]
            message += nearest_flag(message.partition(": ")[2].split(), flags)
        elif chosen := re.match(r"argument (\S+): invalid choice: '?(.*?)'? \(choose from ", message, re.DOTALL):
            names = set(chosen[1].split("/"))
            choices = [action.choices for action in self._actions if names & set(action.option_strings)]
            message += did_you_mean(chosen[2], map(str, choices[0])) if choices else ""
        raise SceneError(f"{message} (see {self.prog} --help)")


def _make_parser() -> _Parser:
    """Make the parser of the program, which knows its commands by name alone."""
    parser = _Parser("raster", description="Draw 3-D models, without GPU, OpenGL or display.", allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"raster {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", title="commands", parser_class=_Parser)
    for command in COMMANDS.values():
        commands.add_parser(command.name, help=command.summary, add_help=False)
    return parser


def make_command_parser(command) -> _Parser:
    """Make the parser of a command."""
    parser = _Parser(f"raster {command.name}", allow_abbrev=False, formatter_class=argparse.RawDescriptionHelpFormatter)
    command.add_flags(parser)
    return parser
