"""Flags that several commands share: models, outputs, camera, exactness, loading, messages."""

from dataclasses import fields

from .. import choices
from ..io import formats
from ..options import Options
from . import values
from .defaults import AZIMUTH, ELEVATION, FOV, VIEWS
from .messages import NORMAL, QUIET, VERBOSE


def fill_in_defaults(arguments) -> None:
    """Remember in `given` which options were given, because a scene file's come before the defaults; fill in those.

    "outputs" stays None where it depends on what is written.
    """
    names = [field.name for field in fields(Options) if hasattr(arguments, field.name)]
    arguments.given = frozenset(name for name in names if getattr(arguments, name) is not None)
    defaults = {field.name: field.default for field in fields(Options)}
    defaults |= {"outputs": None, "size": getattr(arguments, "default_size", None)}
    for name in names:
        if name not in arguments.given:
            setattr(arguments, name, defaults[name])


def add_models(parser) -> None:
    """Add the models that are read."""
    models, scenes = (", ".join(formats.names(is_scene=is_scene)) for is_scene in (False, True))
    parser.add_argument(
        "models",
        nargs="+",
        metavar="MODEL",
        help=f"{models} files, scene files ({scenes}), or patterns such as 'parts/*.stl'; - is stdin",
    )
    parser.add_argument(
        "--input-format", choices=formats.names(), help="of the models, whatever their suffix; needed for stdin"
    )
    parser.add_argument(
        "--recursive", action="store_true", help="of a folder, take all models in it and below; outputs stay in folders"
    )


def add_size(parser, size) -> None:
    """Add the size of a picture, and its default (width, height)."""
    parser.add_argument(
        "-s",
        "--size",
        type=values.picture_size,
        metavar="WxH",
        help=f"pixels, also as W,H, or one number for a square (default {size[0]}x{size[1]})",
    )


def add_files(parser, default_name, size, suffix=".png", fields="{stem} {ext} {view}") -> None:
    """Add the models, what is written of each and its size.

    Parameters
    ----------
    default_name : template of a name without suffix
    size : (width, height), the default
    suffix : of pictures, the default
    fields : what a template may hold
    """
    add_models(parser)
    add_output(parser, default_name, size, suffix, fields)


def add_output(parser, default_name, size, suffix=".png", fields="{stem} {ext} {view}") -> None:
    """Add what is written and its size; parameters are those of `add_files`."""
    parser.set_defaults(default_name=default_name, default_suffix=suffix, always_writes=True, default_size=size)
    add = parser.add_argument
    add(
        "-o",
        "--output",
        metavar="OUT",
        help=f"the picture's name (default {default_name.replace('{stem}', 'MODEL')}{suffix} in the current folder"
        + (", -VIEW before .png for several views" if "{view}" in fields else "")
        + f"), a folder, a template with {fields}, or - for stdout; the suffix chooses the format",
    )
    add_size(parser, size)
    add("--skip-existing", action="store_true", help="leave out outputs that are there already")
    add(
        "--json",
        action="store_true",
        help="print a line of JSON for each picture on stdout (on stderr with -o -)",
    )


def add_preview(parser) -> None:
    """Add the picture in the terminal."""
    parser.add_argument(
        "--preview",
        action="store_true",
        help="show the picture in the terminal, in half blocks; without -o no file is written; honours NO_COLOR",
    )


def add_camera(parser) -> None:
    """Add where a picture is taken from."""
    group = parser.add_argument_group(
        "camera",
        "Unless --eye is given, the model fills the picture. A camera that a file brings along is used where none of "
        "these but --zoom is given.",
    )
    add = group.add_argument
    add(
        "--view",
        dest="views",
        action="extend",
        type=values.list_of(str, tuple(VIEWS)),
        default=[],
        metavar="LIST",
        help=f"where from: {', '.join(VIEWS)}; several, with commas, make a picture each",
    )
    add_side(group, "about the up axis", "frame = fill the picture although the model brings a camera")


def add_side(group, azimuth, frame) -> None:
    """Add the side that a model is framed from, and cameras that stand somewhere, whatever they show.

    Parameters
    ----------
    azimuth, frame : text, what the degrees of --azimuth are, and what --camera frame does
    """
    add = group.add_argument
    add(
        "--azimuth",
        type=values.number,
        metavar="A",
        help=f"degrees {azimuth}, 0 = front (default {AZIMUTH:g})",
    )
    add("--elevation", type=values.number, metavar="A", help=f"degrees above the horizon (default {ELEVATION:g})")
    add_lens(group)
    add_margin(group)
    add(
        "--camera",
        metavar="FILE",
        help="a camera out of a scene file, or one by itself in JSON; file = the model's own, which must have one; "
        + frame,
    )
    add("--eye", type=values.vector, metavar="X,Y,Z", help="where the camera stands")
    add("--target", type=values.vector, metavar="X,Y,Z", help="what it looks at (default: the model's middle)")
    add_up(group)


def add_lens(group) -> None:
    """Add the field of view."""
    add = group.add_argument
    add(
        "--fov",
        type=values.number,
        metavar="A",
        help=f"vertical field of view, degrees (default {FOV:g})",
    )
    add("--ortho", action="store_true", help="without perspective; with --eye, the target keeps its size")
    add("--zoom", type=values.number, default=1.0, metavar="F", help="enlarge the middle of the picture F times")


def add_margin(group) -> None:
    """Add what stays empty around a model."""
    group.add_argument(
        "--margin",
        type=values.share,
        metavar="M",
        help="share of the picture that stays empty on each side, 0.1 or 10%% (default 5%%)",
    )


def add_up(group) -> None:
    """Add the up axis."""
    group.add_argument(
        "--up",
        type=values.axis,
        choices=("auto", *choices.AXES),
        help="up axis (default auto: z for stl and 3mf, y for other models, that of a scene file)",
    )


def add_tolerance(group) -> None:
    """Add the error that is accepted."""
    group.add_argument(
        "--tolerance",
        type=values.fraction,
        metavar="T",
        help="error accepted, in linear intensity with white = 1; 0 = as exact as float64 (default 1/4096: "
        "8-bit values are off by one level at most, but next to steps of the light)",
    )


def add_loading(group) -> None:
    """Add how models are loaded, and the threads."""
    add = group.add_argument
    add(
        "--threads",
        type=int,
        metavar="N",
        help="threads that draw a picture (default: all that the process may use)",
    )
    add("--drop-bad-faces", action="store_true", help="leave out faces with NaN or infinite coordinates")
    add(
        "--allow-outside",
        action="store_true",
        help="also read textures, buffers and parts of scenes that lie outside the folder of the file that names them",
    )


def add_messages(parser) -> None:
    """Add how much is said."""
    group = parser.add_mutually_exclusive_group()
    group.add_argument(
        "-v",
        "--verbose",
        dest="level",
        action="store_const",
        const=VERBOSE,
        default=NORMAL,
        help="say what a file had, what was used, and how long it took",
    )
    group.add_argument("-q", "--quiet", dest="level", action="store_const", const=QUIET, help="say nothing but errors")
