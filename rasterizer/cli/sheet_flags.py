"""The flags of `raster sheet`."""

from . import values
from .defaults import SHEET_SIZE, SHEET_VIEWS
from .flags import add_camera, add_files, add_messages
from .look_flags import add_drawing

_HELP = f"""\
Lay pictures on one sheet, with labels: several views of one model ({", ".join(SHEET_VIEWS)} unless --view
says others), or many models from one side; with many models and several views each model has a row.
"""

_EXAMPLES = """\
examples:
  raster sheet part.stl                                      part-sheet.png, here: six views
  raster sheet 'parts/*.stl' -o parts.png --columns 5        one picture a model
  raster sheet a.obj b.obj --view front,top -o both.png      a row for each model
  raster sheet part.obj --view iso -s 512 --no-labels --background white -o - > part.png

exit codes: 0 done, 1 some models failed and the rest was done, 2 usage, 3 no model can be read,
4 the sheet can't be written, 130 interrupted
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster sheet MODEL... [-o OUT] [options]"
    parser.description, parser.epilog = _HELP, _EXAMPLES
    add_files(parser, "{stem}-sheet", SHEET_SIZE, fields="{stem} {ext}")
    parser.set_defaults(outputs=None)
    add = parser.add_argument_group("the sheet").add_argument
    add("--columns", type=values.whole, metavar="N", help="pictures in a row (default: as many as views, or as rows)")
    add("--rows", type=values.whole, metavar="N", help="rows, instead of --columns")
    add("--gap", type=values.whole, default=8, metavar="N", help="pixels between pictures (default 8)")
    add("--no-labels", dest="has_labels", action="store_false", help="without names below the pictures")
    add_camera(parser)
    add_drawing(parser)
    add_messages(parser)
