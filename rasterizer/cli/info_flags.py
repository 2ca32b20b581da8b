"""The flags of `raster info`."""

from .flags import add_messages, add_models

_HELP = """\
Say what is in each model, without drawing it.

  faces, vertices    triangles, and the different positions that they use
  bounds             lowest and highest corner, in scene units
  watertight         whether every edge has triangles on both sides; else what is in the way
  bodies             parts that share no edge
  up                 the axis that `raster render` takes, and what the shape says
  not drawn          what the file holds and no picture shows
"""

_EXAMPLES = """\
examples:
  raster info part.stl
  raster info 'parts/*.obj' --json                           a line a model
  cat part.stl | raster info - --input-format stl

exit codes: 0 done, 1 some models failed and the rest was done, 2 usage, 3 a model can't be read or is empty,
130 interrupted
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster info MODEL... [options]"
    parser.description, parser.epilog = _HELP, _EXAMPLES
    add_models(parser)
    add = parser.add_argument
    add("--json", action="store_true", help="print a line of JSON for each model")
    add("--drop-bad-faces", action="store_true", help="leave out faces with NaN or infinite coordinates")
    add(
        "--allow-outside",
        action="store_true",
        help="also read textures, buffers and parts of scenes that lie outside the folder of the file that names them",
    )
    add_messages(parser)
