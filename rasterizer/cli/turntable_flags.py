"""The flags of `raster turntable`."""

from . import values
from .defaults import TURNTABLE_FRAMES, TURNTABLE_SECONDS, TURNTABLE_SIZE
from .flags import add_files, add_messages, add_side
from .look_flags import add_drawing

_HELP = """\
Turn each model round once, in a moving picture. The camera keeps one distance, the smallest that shows
the model in every frame. With --eye or --camera the first frame is that camera's; from there it goes round the up
axis through what it looks at.
"""

_EXAMPLES = """\
examples:
  raster turntable part.stl                                  part-turntable.gif, here: 36 frames, 3 seconds
  raster turntable part.obj -o part.webp --frames 72 --seconds 6
  raster turntable part.obj -o part.mp4 -s 1920x1080 --fps 30 --background white
  raster turntable 'parts/*.glb' -o 'turns/{stem}.gif' -s 256 --turn -360 --elevation 10
  raster turntable room.obj -o room.webp --eye 4,2,6 --target 0,1,0 --fov 50
  raster turntable part.obj -o 'frames/{stem}-{frame:03}.png' --frames 120

A GIF file has one palette of 255 colours for all frames, and no half-covered pixels, so that it has no shadow on the
ground without --background; WebP and APNG have all colours and an alpha channel.
MP4, MOV and MKV need the extra `video`, and have no alpha: without --background they are white.

exit codes: 0 done, 1 some models failed and the rest was done, 2 usage, 3 a model can't be read or is empty,
4 an output can't be written, 130 interrupted
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster turntable MODEL... [-o OUT] [options]"
    parser.description, parser.epilog = _HELP, _EXAMPLES
    add_files(
        parser, "{stem}-turntable", TURNTABLE_SIZE, suffix=".gif", fields="{stem} {ext}, or {frame} for a file each"
    )
    parser.set_defaults(outputs=None, views=[])
    group = parser.add_argument_group("the turn")
    add = group.add_argument
    add(
        "--frames",
        type=values.whole,
        default=None,
        metavar="N",
        help=f"pictures of one round (default {TURNTABLE_FRAMES}, or as many as --fps and --seconds make)",
    )
    add("--seconds", type=values.number, metavar="S", help=f"that a round takes (default {TURNTABLE_SECONDS:g})")
    add("--fps", type=values.number, metavar="N", help="frames a second, instead of --frames or of --seconds")
    add("--turn", type=values.number, default=360.0, metavar="A", help="degrees of the round, or with a minus sign the "
        "other way round (default 360)")  # fmt: skip
    add("--loop", type=values.whole, default=0, metavar="N", help="how often it is shown (default 0: again and again)")
    add_side(group, "at the first frame", "frame = show all of the model in every frame (default)")
    add_drawing(parser)
    add_messages(parser)
