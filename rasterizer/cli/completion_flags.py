"""The flags of `raster completion`."""

from .flags import add_messages

SHELLS = ("bash", "zsh", "fish")
_HELP = """\
Print what a shell needs to complete the commands of raster, their flags, and the values that these take.
"""

_EXAMPLES = """\
examples:
  raster completion bash > ~/.local/share/bash-completion/completions/raster
  raster completion zsh > ~/.zfunc/_raster                   where ~/.zfunc stands in fpath before compinit
  raster completion fish > ~/.config/fish/completions/raster.fish
  source <(raster completion bash)                           for this shell alone

exit codes: 0 done, 2 usage, 4 stdout can't be written, 130 interrupted
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = f"raster completion {'|'.join(SHELLS)}"
    parser.description, parser.epilog = _HELP, _EXAMPLES
    parser.add_argument("shell", choices=SHELLS, help="which shell")
    add_messages(parser)
