"""`raster completion`: the script by which a shell completes commands, flags, their words and names of files; made of
the parsers by shtab."""

from ..errors import import_extra, install_command
from .flags import add_messages
from .messages import print_text
from .parser import make_parser

SHELLS = ("bash", "zsh", "fish", "powershell")  # those to which shtab tells flags of commands
_FILES = ("MODEL", "OUT", "FILE", "FOLDER")  # what stands for a file in the help
_EXAMPLES = f"""\
examples:
  raster completion bash > ~/.local/share/bash-completion/completions/raster
  raster completion zsh > ~/.zfunc/_raster      in fpath before compinit
  raster completion fish > ~/.config/fish/completions/raster.fish
  source <(raster completion bash)              for this shell alone

It takes the extra completion: {install_command("completion")}
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = f"raster completion {'|'.join(SHELLS)}"
    parser.description = "Print what a shell needs to complete commands of raster, their flags, and what these take."
    parser.epilog = _EXAMPLES
    parser.add_argument("shell", choices=SHELLS, help="which shell")
    add_messages(parser)


def run(_request, _messages, *, shell) -> tuple[list, int]:
    """Print the script for a shell; RasterizerError where shtab isn't installed. Nothing else fails."""
    shtab = import_extra("shtab", "completion", "completion")
    parser = make_parser(is_whole=True)
    for command in parser.commands.values():
        for action in command._actions:
            metavar = str(action.metavar)
            if words := action.choices or getattr(action.type, "legal", ()):
                action.choices = [str(word) for word in words]
            elif metavar.startswith("{"):  # words to which others may be added
                action.choices = metavar[1:-1].split(",")
            elif metavar in _FILES:
                action.complete = shtab.FILE
    print_text(shtab.complete(parser, shell) + "\n")
    return [], 0
