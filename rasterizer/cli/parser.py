"""The commands, their parsers and their help.

    raster --help             the commands, exit codes
    raster render --help      the flags of a command, in groups

Flags are made of the command that is called alone, so that help and errors come at once.
"""

import argparse
import os
import re
from importlib import import_module

from .. import __version__
from ..errors import SceneError

# Each command is the module of this folder that has its name, imported when it is called: `add_flags(parser)` adds its
# flags and says what its help says; `run(request, messages, **own)`, which gets the flags of its own by their names,
# returns the failures, one error for each model that failed, and the number of models; `IMPORTS`, where there is one,
# names other modules of this folder that it runs on.
COMMANDS = {
    "render": "draw models, one picture a file",
    "batch": "draw many models in several processes, or on many machines",
    "compare": "show flat, Gouraud's and Phong's shading beside the reference, with error maps",
    "bench": "measure time against error of each method, on this machine",
    "turntable": "turn models round, in a moving picture: GIF, WebP, APNG, MP4",
    "sheet": "lay views of a model, or many models, on one labelled picture",
    "info": "say what is in models: faces, bounds, materials, whether they are watertight",
    "doctor": "say what is installed, and where compiled kernels are kept",
    "view": "turn a model in a page of your browser, and pick its faces",
    "demo": "draw the model that comes with the package",
    "completion": "print what a shell needs to complete commands, flags and values",
    "warmup": "compile all kernels now, so that the first picture doesn't wait for it",
}

_EPILOG = """\
Without a command, render is meant: raster part.stl. Models and flags come in any order. Results go to stdout,
messages to stderr. raster COMMAND --help says more of each.

exit codes:
  0    done
  1    some models failed and the others were done, or the program itself is at
       fault (-v shows more)
  2    the command line is wrong, or a value is not legal
  3    no model could be drawn: the first can't be read, or is empty
  4    an output can't be written
  130  interrupted

raster doctor --help lists the variables of the environment that are read.
"""


def command_module(name):
    """Import the module of a command."""
    return import_module(f"{__package__}.{name}")


def parse(argv) -> argparse.Namespace:
    """Parse the arguments; SceneError where they are not legal.

    Models and flags may come in any order. A value may begin with a minus sign: `--eye -1,2,3`, `--up -z`. Without a
    command, models are drawn.
    """
    argv = _with_command(_joined_values(list(argv)))
    if argv[0] not in COMMANDS:
        make_parser().parse_args(argv)  # help, or the version
    arguments = make_command_parser(argv[0]).parse_intermixed_args(argv[1:])
    arguments.command = argv[0]
    return arguments


def _with_command(argv) -> list[str]:
    """Put a command, or a flag of the program's own, in the first place: help without arguments, `render` before
    models."""
    if argv[:1] in ([], ["help"]):
        return [*argv[1:2], "--help"]
    first = argv[0]
    if first in COMMANDS or first in ("-h", "--help", "--version"):
        return argv
    if re.fullmatch(r"\w+", first) and not os.path.exists(first):
        commands = ", ".join(COMMANDS)
        raise SceneError(f"there is no command and no file {first!r} (commands are {commands}) (see raster --help)")
    return ["render", *argv]


def _joined_values(argv) -> list[str]:
    """Join a flag and a value that argparse would take for another flag: -1,2,3 or -z. What stands behind "--" is a
    name, never a flag."""
    joined = []
    for number, word in enumerate(argv):
        if word == "--":
            names = argv[number + 1 :]
            return joined + [os.path.join(".", name) if name[:1] == "-" and name != "-" else name for name in names]
        if not word.startswith("-"):
            joined.append(word)
            continue
        is_value = joined and re.fullmatch(r"--[a-z]+(-[a-z]+)*", joined[-1]) and re.match(r"-(\.?\d|[xyzXYZ]$)", word)
        if is_value:
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def make_parser(is_whole=False) -> "Parser":
    """Make the parser of the program, which knows its commands by name alone, or (whole) with their flags."""
    parser = Parser("raster", description="Draw 3-D models, without GPU, OpenGL or display.", epilog=_EPILOG)
    parser.add_argument(
        "--version", action="version", version=f"raster {__version__}", help="say which version this is"
    )
    commands = parser.add_subparsers(metavar="COMMAND", title="commands", parser_class=Parser)
    for name, summary in COMMANDS.items():
        command = commands.add_parser(name, help=summary, has_help=is_whole)
        if is_whole:
            command_module(name).add_flags(command)
    parser.commands = commands.choices  # the parser of each, by its name
    return parser


def make_command_parser(name) -> "Parser":
    """Make the parser of a command."""
    parser = Parser(f"raster {name}")
    command_module(name).add_flags(parser)
    return parser


class Parser(argparse.ArgumentParser):
    """A parser whose errors are ours: one line, and the exit code chosen in one place."""

    def __init__(self, prog, has_help=True, **settings):
        super().__init__(prog, allow_abbrev=False, add_help=False, formatter_class=_Formatter, **settings)
        if has_help:
            # As a parser's own flag it would be tried on a formatter, which measures the terminal: 6 modules.
            self._optionals.add_argument("-h", "--help", action="help", help="show this help")

    def error(self, message):
        """Raise SceneError, with the flag that was probably meant."""
        if unknown := re.match(r"unrecognized arguments: -*([^\s=]+)", message):
            from ..choices import nearest_word

            flags = {}
            for action in self._actions:
                for flag in action.option_strings:
                    flags[flag.lstrip("-").replace("-", "_")] = flag
            near = nearest_word(unknown[1].replace("-", "_"), flags)
            message += f"; did you mean {flags[near]}?" if near else ""
        raise SceneError(f"{message} (see {self.prog} --help)")


class _Formatter(argparse.HelpFormatter):
    """Wrap the paragraphs of a text, but for those with lines that begin with blanks: these are laid out."""

    def _fill_text(self, text, width, indent):
        parts = []
        for paragraph in text.strip("\n").split("\n\n"):
            if re.search("^ ", paragraph, re.MULTILINE):
                parts.append("\n".join(indent + line for line in paragraph.split("\n")))
            else:
                parts.append(super()._fill_text(paragraph, width, indent))
        return "\n\n".join(parts)
