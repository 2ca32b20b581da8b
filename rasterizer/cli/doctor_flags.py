"""The flags of `raster doctor`."""

from .flags import add_messages

_HELP = """\
Say what a report of a fault should say: versions, processor, threads, where compiled kernels are kept and how large
they are, which optional packages are there, and which settings the environment has. Nothing is drawn.
"""

_EXAMPLES = """\
examples:
  raster doctor
  raster doctor --json > machine.json
  raster doctor --clear                                      removes compiled kernels; raster warmup makes them again

exit codes: 0 all is well, 1 something is missing or broken, which is told, 2 usage, 4 kernels can't be removed,
130 interrupted
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster doctor [options]"
    parser.description, parser.epilog = _HELP, _EXAMPLES
    parser.add_argument("--clear", action="store_true", help="remove all compiled kernels, of other versions, too")
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    add_messages(parser)
