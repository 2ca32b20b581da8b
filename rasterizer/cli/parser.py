"""The commands, their parsers and their help.

    raster --help                     the commands, exit codes
    raster render --help              the usual flags, and the names of all others by topic
    raster render --help camera       the flags of a topic; `all` has everything

Flags are made of the command that is called alone, so that help and errors come at once.
"""

import argparse
import glob
import os
import re
import sys
from importlib import import_module

from .. import __version__
from ..errors import SceneError

# Each command is the module of this folder that has its name, imported when it is called: `add_flags(parser)` adds its
# flags and says what its help says; `run(arguments, messages)` returns the failures, one error for each model that
# failed, and the number of models; `IMPORTS`, where there is one, names other modules of this folder that it runs on.
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
A command that is left out is render: raster part.stl. Models and flags come in any order. Results go to stdout,
messages to stderr. raster COMMAND --help says more of each.

exit codes:
  0    done
  1    some models failed and the rest was done, or the fault is the program's
       own (-v shows more)
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
        make_parser().parse_args(argv)  # help, the version, or an error
        raise SceneError(f"a command is missing: {' or '.join(COMMANDS)} (see raster --help)")
    arguments = make_command_parser(argv[0]).parse_intermixed_args(argv[1:])
    arguments.command = argv[0]
    _fill_in_defaults(arguments)
    if hasattr(arguments, "seed"):
        _take_seed(arguments)
    return arguments


def _fill_in_defaults(arguments) -> None:
    """Remember in `explicit` which fields of Options flags give, because a scene file's come before the defaults; fill
    in those.

    "outputs" stays None where it depends on what is written.
    """
    from dataclasses import fields

    from ..options import Options

    explicit, own_defaults = [], {"outputs": None, "size": getattr(arguments, "default_size", None)}
    for field in fields(Options):
        if getattr(arguments, field.name, None) is not None:
            explicit.append(field.name)
        elif field.name in own_defaults or field.name in arguments:
            setattr(arguments, field.name, own_defaults.get(field.name, field.default))
    arguments.explicit = frozenset(explicit)


def _take_seed(arguments) -> None:
    """Give random views their names; SceneError for a seed that is missing, or in vain."""
    from ..choices import RANDOM

    is_random = RANDOM in arguments.lights
    for view in arguments.views:
        is_random = is_random or view.startswith(RANDOM)
    if is_random and arguments.seed is None:
        raise SceneError("what is random needs --seed N, a whole number of at least 0")
    if arguments.seed is not None and not is_random:
        raise SceneError("--seed is that of random views and lights: --view random:N, --light random")
    if RANDOM in arguments.lights and len(arguments.lights) > 1:
        raise SceneError("--light random takes the place of all lights; given another --light beside it")
    names, seed = [], arguments.seed
    for word in arguments.views:
        first, _, count = word.partition(":")
        if first != RANDOM:
            names.append(word)
            continue
        names += [f"{RANDOM}-{seed + k:04}" for k in range(int(count or 1))]
        seed += int(count or 1)
    arguments.views = names


def _with_command(argv) -> list[str]:
    """Put a command, or a flag of the program's own, in the first place: help without arguments, `render` before
    models."""
    if not argv or argv == ["help"]:
        return ["--help"]
    first = argv[0]
    if first in ("help", "-h", "--help") and argv[1:] and argv[1] in COMMANDS:
        return [argv[1], "--help", *argv[2:3]]
    if first in COMMANDS or first in ("-h", "--help", "--version"):
        return argv
    if first == "help":
        return _with_command(argv[1:])
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


_USUAL = frozenset({
    "MODEL", "--help", "--output", "--plot", "--size", "--view", "--azimuth", "--elevation", "--shading", "--samples",
    "--color", "--background", "--ground", "--processes", "--json", "--verbose", "--quiet",
})  # what the first help of a command shows  # fmt: skip


class Parser(argparse.ArgumentParser):
    """A parser whose help has topics, and whose errors are ours: one line, and the exit code chosen in one place.

    Groups of arguments with a title of our own are its topics. Where there are some, the first help shows usual flags,
    and all of the groups in `own`; of others the names.
    """

    own, commands = (), {}

    def __init__(self, prog, has_help=True, **settings):
        super().__init__(prog, allow_abbrev=False, add_help=False, formatter_class=_Formatter, **settings)
        if has_help:
            # As a parser's own flag it would be tried on a formatter, which measures the terminal: 6 modules.
            self._optionals.add_argument("-h", "--help", action=_Help, nargs=0, help="show this help")

    def add_topic(self, title, description=None, is_own=False):
        """Add a group of flags; the first help shows it as a whole where it is the command's own."""
        group = self.add_argument_group(title, description)
        help_flag = self._actions[0]
        help_flag.nargs, help_flag.metavar, help_flag.help = "?", "TOPIC", "show this help, or all flags of a topic"
        if is_own:
            self.own = (*self.own, group)
        return group

    def topics(self) -> dict:
        """Return the groups of flags by their titles."""
        return {group.title: group for group in self._action_groups[2:] if group.title != "commands"}

    def format_help(self, topic=None) -> str:
        """Return the help, or what it says of a topic; a word that is none gets the first help, which lists them."""
        topics = self.topics()
        if not topics or topic == "all":
            return super().format_help()
        formatter = self._get_formatter()
        if topic == "examples" and self.epilog:
            formatter.add_text(self.epilog)
        elif topic in topics:
            formatter.start_section(topic)
            formatter.add_text(topics[topic].description)
            formatter.add_arguments(topics[topic]._group_actions)
            formatter.end_section()
        else:
            self._add_first_help(formatter, topics)
        return formatter.format_help()

    def _add_first_help(self, formatter, topics):
        import textwrap

        formatter.add_usage(self.usage, self._actions, self._mutually_exclusive_groups)
        formatter.add_text(self.description)
        formatter.start_section("usual flags")
        of_own = [each for group in self.own for each in group._group_actions]
        others = [each for each in (*self._actions[1:], self._actions[0]) if each not in of_own]
        formatter.add_arguments(each for each in others if _USUAL.intersection(_names_of(each)))
        formatter.end_section()
        for group in self.own:
            formatter.start_section(group.title)
            formatter.add_arguments(group._group_actions)
            formatter.end_section()
        width = max(map(len, (*topics, "examples"))) + 2
        lines = [f"all flags, by {self.prog} --help TOPIC:"]
        for title, group in topics.items():
            head, names = f"  {title:<{width}}", " ".join(_title_of(each) for each in group._group_actions)
            indents = {"initial_indent": head, "subsequent_indent": " " * len(head)}
            lines += textwrap.wrap(names, formatter._width, **indents, break_on_hyphens=False)
        lines += [f"  {'examples':<{width}}of commands, and remarks"] if self.epilog else []
        lines += [f"  {'all':<{width}}everything"]
        formatter.add_text("\n".join(lines))

    def error(self, message):
        """Raise SceneError, with what was probably meant."""
        if message.startswith("unrecognized arguments: "):
            flags = [flag for action in self._actions for flag in action.option_strings]
            message += _nearest_flag(message.partition(": ")[2].split(), flags)
        elif chosen := re.match(r"argument (\S+): invalid choice: '?(.*?)'? \(choose from ", message, re.DOTALL):
            names = set(chosen[1].split("/"))
            choices = [action.choices for action in self._actions if names & set(action.option_strings)]
            message += did_you_mean(chosen[2], map(str, choices[0])) if choices else ""
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


class _Help(argparse.Action):
    """Print the help, or a topic of it, and end."""

    def __init__(self, option_strings, dest, **settings):
        super().__init__(option_strings, argparse.SUPPRESS, default=argparse.SUPPRESS, **settings)

    def __call__(self, parser, _namespace, topic, _flag=None):
        parser._print_message(parser.format_help(topic or None), sys.stdout)
        parser.exit()


def _names_of(action) -> tuple[str, ...]:
    """The flags of an argument; of one without flags what stands for it."""
    return tuple(action.option_strings) or (action.metavar or action.dest,)


def _title_of(action) -> str:
    """The first long flag of an argument, or what stands for it."""
    names = _names_of(action)
    return next((name for name in names if name.startswith("--")), names[0])


# --- what somebody probably meant who wrote a word that isn't there -------------------------------------------------

# Flags of other programs, by which people call ours.
_HABITS = {
    "--bg": "--background", "--background-color": "--background", "--width": "--size", "--height": "--size",
    "--resolution": "--size", "--res": "--size", "--dimensions": "--size", "--out": "--output", "--outfile": "--output",
    "--aa": "--samples", "--msaa": "--samples", "--supersample": "--samples", "--anti-aliasing": "--samples",
    "--smooth": "--shading", "--camera-position": "--eye", "--position": "--eye", "--look-at": "--target",
    "--orthographic": "--ortho", "--perspective": "--fov", "--elev": "--elevation", "--azim": "--azimuth",
    "--jobs": "--threads", "--workers": "--threads", "--silent": "--quiet", "--format": "--input-format",
}  # fmt: skip


def did_you_mean(word: str, legal) -> str:
    """Return "; did you mean X?" with the nearest of the legal words: one that is alike but for its case, begins like
    the word, or has most letters in common with it. Return nothing where none is near."""
    import difflib

    letters = word.lower().lstrip("-")
    bare = {each.lower().lstrip("-"): each for each in legal if len(each.lstrip("-")) > 1}
    begun = [name for name in bare if len(letters) >= 3 and name.startswith(letters)]
    near = [letters] if letters in bare else begun or difflib.get_close_matches(letters, bare, n=1)
    return f"; did you mean {bare[near[0]]}?" if near else ""


def _nearest_flag(words, flags) -> str:
    """Return the same for the first of some words that is no flag; flags of other programs are known, too."""
    for word in words:
        name = word.partition("=")[0]
        if name.startswith("-"):
            habit = _HABITS.get(name.lower())
            return f"; did you mean {habit}?" if habit in flags else did_you_mean(name, flags)
    return ""
