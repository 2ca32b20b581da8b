"""`raster completion`: scripts for shells, made from the parsers, so that they know what the commands know.

table of commands ─ their parsers ─ words of each flag ─ bash, zsh or fish
"""

import shlex
from typing import NamedTuple

from .arguments import make_command_parser
from .commands import COMMANDS
from .messages import print_text


class Flag(NamedTuple):
    """A flag as shells know it."""

    names: tuple[str, ...]  # "-s", "--size"
    words: tuple[str, ...]  # values that it takes; none where it takes any, or none at all
    takes_value: bool
    text: str  # one line


class Completed(NamedTuple):
    """A command as shells know it."""

    name: str
    text: str
    flags: tuple[Flag, ...]
    words: tuple[str, ...]  # that stand without a flag; none where these are files


def print_completion(arguments, _messages) -> tuple[list, int]:
    """Print the script for a shell; nothing fails."""
    write = {"bash": write_bash, "zsh": write_zsh, "fish": write_fish}[arguments.shell]
    print_text(write(list_commands()), False)
    return [], 0


def list_commands() -> list[Completed]:
    """List all commands with their flags."""
    found = []
    for command in COMMANDS.values():
        actions = make_command_parser(command)._actions
        flags = tuple(_flag(action) for action in actions if action.option_strings)
        words = tuple(word for action in actions if not action.option_strings for word in action.choices or ())
        found.append(Completed(command.name, command.summary, flags, words))
    return found


def _flag(action) -> Flag:
    metavar = action.metavar or ""
    words = action.choices or getattr(action.type, "legal", None) or ()
    if not words and metavar.startswith("{") and metavar.endswith("}"):
        words = metavar[1:-1].split(",")
    text = " ".join((action.help or "").replace("%%", "%").split())
    return Flag(tuple(action.option_strings), tuple(map(str, words)), action.nargs != 0, text)


# --- bash -----------------------------------------------------------------------------------------------------------

_BASH = """\
# Completion of raster for bash, made by `raster completion bash`.
_raster() {{
    local cur="${{COMP_WORDS[COMP_CWORD]}}" prev="${{COMP_WORDS[COMP_CWORD-1]}}" command="" word
    # --flag=value comes as three words.
    if [[ $cur == "=" ]]; then cur=""; elif [[ $prev == "=" ]]; then prev="${{COMP_WORDS[COMP_CWORD-2]}}"; fi
    for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
        case "$word" in {commands}) command="$word"; break ;; esac
    done
    COMPREPLY=()
    case "$command $prev" in
{values}
    esac
    case "$command" in
{flags}
    "") if [[ $COMP_CWORD -eq 1 ]]; then COMPREPLY=($(compgen -W {first} -- "$cur")); fi ;;
    esac
}}
complete -o bashdefault -o default -F _raster raster
"""


def write_bash(commands) -> str:
    """Write the script for bash; where it has no words, names of files are completed."""
    values, flags = [], []
    for command in commands:
        for flag in command.flags:
            names = "|".join(f'"{command.name} {name}"' for name in flag.names)
            if flag.words:
                reply = f'COMPREPLY=($(compgen -W {shlex.quote(" ".join(flag.words))} -- "$cur")); return'
                values.append(f"    {names}) {reply} ;;")
            elif flag.takes_value:
                values.append(f"    {names}) return ;;")
        names = " ".join(name for flag in command.flags for name in flag.names)
        reply = f'if [[ $cur == -* ]]; then COMPREPLY=($(compgen -W {shlex.quote(names)} -- "$cur"))'
        if command.words:
            reply += f'; else COMPREPLY=($(compgen -W {shlex.quote(" ".join(command.words))} -- "$cur"))'
        flags.append(f"    {command.name}) {reply}; fi ;;")
    names = [command.name for command in commands]
    first = shlex.quote(" ".join([*names, "help", "--help", "--version"]))
    return _BASH.format(commands="|".join(names), values="\n".join(values), flags="\n".join(flags), first=first)


# --- zsh ------------------------------------------------------------------------------------------------------------

_ZSH = """\
#compdef raster
# Completion of raster for zsh, made by `raster completion zsh`.
_raster() {{
    local curcontext="$curcontext" state line
    local -a commands=(
{commands}
    )
    _arguments -C '(- *)--help[show help]' '(- *)--version[show the version]' '1: :->first' '*:: :->rest'
    case $state in
    first) _describe -t commands command commands; _files ;;
    rest)
        case $words[1] in
{flags}
        *) _files ;;
        esac ;;
    esac
}}
if [[ $funcstack[1] == _raster ]]; then _raster "$@"; else compdef _raster raster; fi
"""


def write_zsh(commands) -> str:
    """Write the script for zsh."""
    named = "\n".join(f"        {shlex.quote(f'{command.name}:{command.text}')}" for command in commands)
    flags = []
    for command in commands:
        specs = [_zsh_spec(flag, name) for flag in command.flags for name in flag.names]
        rest = f"'*:value:({' '.join(command.words)})'" if command.words else "'*:file:_files'"
        flags.append(f"        {command.name}) _arguments -S {' '.join(specs)} {rest} ;;")
    return _ZSH.format(commands=named, flags="\n".join(flags))


def _zsh_spec(flag, name) -> str:
    """A flag as `_arguments` takes it: *--name[what it does]:value:(words)."""
    text = flag.text.translate(str.maketrans({"[": "\\[", "]": "\\]", ":": "\\:", "\\": "\\\\"}))
    spec = f"*{name}{'=' if flag.takes_value and name.startswith('--') else ''}[{text}]"
    if flag.takes_value:
        spec += f":value:({' '.join(flag.words)})" if flag.words else ":value:_files"
    return shlex.quote(spec)


# --- fish -----------------------------------------------------------------------------------------------------------


def write_fish(commands) -> str:
    """Write the script for fish."""
    lines = ["# Completion of raster for fish, made by `raster completion fish`."]
    for command in commands:
        named = f"complete -c raster -n __fish_use_subcommand -a {command.name} -d {_fish(command.text)}"
        lines.append(named)
        condition = _fish(f"__fish_seen_subcommand_from {command.name}")
        if command.words:
            lines.append(f"complete -c raster -n {condition} -f -a {_fish(' '.join(command.words))}")
        for flag in command.flags:
            names = " ".join(f"-l {n[2:]}" if n.startswith("--") else f"-s {n[1:]}" for n in flag.names)
            value = f" -x -a {_fish(' '.join(flag.words))}" if flag.words else " -r" if flag.takes_value else ""
            lines.append(f"complete -c raster -n {condition} {names}{value} -d {_fish(flag.text)}")
    return "\n".join(lines) + "\n"


def _fish(text) -> str:
    """Quote text for fish, where a backslash stands before quotes and backslashes alone."""
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    return f"'{escaped}'"
