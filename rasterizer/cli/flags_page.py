"""The page of all commands and flags, made from the parsers: `python -m rasterizer.cli.flags_page > README.md`.

table of commands ─ their parsers ─┬─ flags of one command alone, in its chapter
                                   └─ flags that several share, once, by group

Kept as rasterizer/cli/README.md; a test compares that with what is made here.
"""

import re
import sys
from typing import Any, NamedTuple

from . import BAD_MODEL, DONE, INTERRUPTED, NO_OUTPUT, SOME_FAILED, USAGE
from .arguments import make_command_parser
from .commands import COMMANDS
from .environment import ENVIRONMENT

EXIT_CODES = {
    DONE: "done",
    SOME_FAILED: "some inputs failed and the rest was done, or the fault is the program's own (`-v` shows more)",
    USAGE: "the command line is wrong, or a value is not legal",
    BAD_MODEL: "no model could be drawn: it can't be read, or is empty",
    NO_OUTPUT: "an output can't be written",
    INTERRUPTED: "interrupted by Ctrl-C",
}
_COMMAND = "python -m rasterizer.cli.flags_page > rasterizer/cli/README.md"
_INTRODUCTION = f"""\
# The command line

`raster COMMAND [options]`. A command that is left out is `render`. Each command's `--help` says what stands here.
Models and flags come in any order; a flag's name is written in full; `--flag VALUE` and `--flag=VALUE` are the same.
Messages go to stderr, results to stdout. The [examples](../README.md#in-a-shell) are run by the tests.

This page is made from the parsers, by `{_COMMAND}`.
"""
_MODELS = "models and output"  # the group of what has no title
_MESSAGES = "messages"


class Flag(NamedTuple):
    """A flag, or what stands without one, as the page shows it."""

    written: str  # `-o`, `--output OUT`
    text: str  # what it does, in one line
    group: str  # title of the group that the help has it in

    @property
    def row(self) -> str:
        """The flag as a row of a table."""
        return f"| {self.written} | {self.text} |"


def make_page() -> str:
    """Make the page: text in Markdown."""
    parsers = {name: make_command_parser(command) for name, command in COMMANDS.items()}
    flags = {name: list_flags(parser) for name, parser in parsers.items()}
    shared = _list_shared(flags)
    parts = [_INTRODUCTION, _table("command", ((f"[{n}](#raster-{n})", c.summary) for n, c in COMMANDS.items()))]
    for name, parser in parsers.items():
        parts += _describe_command(name, parser, flags[name], shared)
    parts.append("## Flags of several commands\n")
    for group in dict.fromkeys(flag.group for flag in shared):
        rows = "\n".join(flag.row for flag in shared if flag.group == group)
        parts.append(f"### {_title(group)}\n\n| flag | what it does |\n| --- | --- |\n{rows}\n")
    parts += ["## Exit codes\n", _table("code", ((str(code), text) for code, text in EXIT_CODES.items()))]
    parts += ["## Environment\n", _table("variable", ((f"`{name}`", text) for name, text in ENVIRONMENT.items()))]
    return "\n".join(parts)


def list_flags(parser: Any) -> list[Flag]:
    """List what a command takes, in the order of its help, without the help itself."""
    titles = {
        action: group.title for group in parser._action_groups[2:] for action in group._group_actions if group.title
    }
    return [
        Flag(_written(action), _text(action), titles.get(action, _MODELS if action.dest != "level" else _MESSAGES))
        for action in parser._actions
        if action.dest != "help"
    ]


def _written(action: Any) -> str:
    """Return how a flag is written, with the name of its value."""
    if not action.option_strings:
        return f"`{action.metavar or action.dest}`"
    value = "" if action.nargs == 0 else f" {_value_name(action)}"
    *others, last = action.option_strings
    return ", ".join([f"`{name}`" for name in others] + [f"`{last}{value}`"])


def _value_name(action: Any) -> str:
    metavar = action.metavar or action.dest.upper()
    return "WORD" if action.choices or metavar.startswith("{") else metavar


def _text(action: Any) -> str:
    """Return what a flag does, and the words that it takes, in one line without marks of tables."""
    text = " ".join(((action.help or "") % {**vars(action), "prog": "raster"}).split())
    metavar = action.metavar or ""
    words = [str(word) for word in action.choices or ()] or (
        metavar[1:-1].split(",") if metavar.startswith("{") else []
    )
    if words:
        text += f"{'; ' if text else ''}one of {', '.join(f'`{word}`' for word in words)}"
    return text.replace("|", r"\|").replace("*", r"\*").replace("<", "&lt;")


def _list_shared(flags: dict[str, list[Flag]]) -> list[Flag]:
    """List the flags that several commands have with the same words, in the order in which they first come; of one
    that some of them describe otherwise the first description."""
    seen: dict[str, list[Flag]] = {}
    for each in flags.values():
        for flag in each:
            seen.setdefault(flag.written, []).append(flag)
    return [found[0] for found in seen.values() if sum(flag.text == found[0].text for flag in found) > 1]


def _describe_command(name: str, parser: Any, flags: list[Flag], shared: list[Flag]) -> list[str]:
    """Return the chapter of a command."""
    usage = parser.usage or f"{parser.prog} [options]"
    parts = [f"## raster {name}\n", f"    {usage}\n", _plain_text(parser.description)]
    by_words = {(flag.written, flag.text): flag.group for flag in shared}
    own = [flag for flag in flags if (flag.written, flag.text) not in by_words]
    if own:
        parts.append("| flag | what it does |\n| --- | --- |\n" + "\n".join(flag.row for flag in own) + "\n")
    groups = dict.fromkeys(group for flag in flags if (group := by_words.get((flag.written, flag.text))))
    also = [
        f"- [{_title(group)}](#{_anchor(group)}): "
        + ", ".join(f"`{_name_of(flag)}`" for flag in flags if by_words.get((flag.written, flag.text)) == group)
        for group in groups
    ]
    parts.append("Flags of several commands:\n\n" + "\n".join(also) + "\n")
    return [*parts, *_describe_epilog(parser.epilog or "")]


def _describe_epilog(epilog: str) -> list[str]:
    """Return the longer texts of a command's help: sentences as they are, what is laid out in columns as it stands."""
    parts = []
    for paragraph in epilog.strip("\n").split("\n\n"):
        if not paragraph:
            continue
        if re.search(r"^  ", paragraph, re.MULTILINE):
            first, _, rest = paragraph.partition("\n")
            parts.append(f"{_sentence(first)}\n\n```text\n{_dedented(rest)}\n```\n")
        else:
            parts.append(f"{_sentence(paragraph)}\n")
    return parts


def _plain_text(text: str) -> str:
    """Return a description: paragraphs as they are, tables as they stand."""
    parts = []
    for paragraph in (text or "").strip("\n").split("\n\n"):
        is_laid_out = paragraph.startswith("  ")
        parts.append(f"```text\n{_dedented(paragraph)}\n```\n" if is_laid_out else f"{_sentence(paragraph)}\n")
    return "\n".join(parts)


def _sentence(text: str) -> str:
    """Return a paragraph with a capital at its start."""
    text = " ".join(text.split()).replace("<", "&lt;").replace("*", r"\*")
    return text[:1].upper() + text[1:]


def _dedented(text: str) -> str:
    lines = text.split("\n")
    return "\n".join(line.removeprefix("  ") for line in lines)


def _name_of(flag: Flag) -> str:
    """Return the long name of a flag, or what stands without one."""
    names = re.findall(r"`([^` ]+)", flag.written)
    return next((name for name in names if name.startswith("--") and not name.startswith("--no-")), names[-1])


def _title(group: str) -> str:
    return group[:1].upper() + group[1:]


def _anchor(group: str) -> str:
    return group.lower().replace(" ", "-")


def _table(title: str, rows: Any) -> str:
    """Return a table with two columns."""
    return f"| {title} | |\n| --- | --- |\n" + "\n".join(f"| {first} | {second} |" for first, second in rows) + "\n"


if __name__ == "__main__":
    sys.stdout.write(make_page())
