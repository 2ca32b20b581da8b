"""The flags of `raster demo`."""

from .defaults import DEMO_SIZE
from .flags import add_camera, add_messages, add_output, add_preview
from .look_flags import add_drawing

_HELP = """\
Draw the model that comes with the package, so that there is a picture right after an install. All flags of
raster render work.
"""

_EXAMPLES = """\
examples:
  raster demo                                                demo.png, here
  raster demo --shading flat --background white -o flat.jpg
  raster demo --preview                                      in the terminal

exit codes: 0 done, 2 usage, 3 the model is missing from the package, 4 the picture can't be written, 130 interrupted
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster demo [-o OUT] [options]"
    parser.description, parser.epilog = _HELP, _EXAMPLES
    add_output(parser, "demo", DEMO_SIZE)
    parser.set_defaults(outputs=None, scale=None, models=(), input_format=None, n_process=None)
    add_preview(parser)
    add_camera(parser)
    add_drawing(parser)
    add_messages(parser)
