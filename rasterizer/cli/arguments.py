"""The arguments: flags, their types and defaults, and the help. Every field of `Options` is a flag."""

import argparse
import re
from typing import NamedTuple

from .._version import __version__
from ..errors import SceneError
from ..options import COLOR_RANGES, CULLS, OUTPUTS, SAMPLES, SHADINGS, Options
from .messages import NORMAL, QUIET, VERBOSE

FORMATS = ("obj", "stl", "ply", "off", "glb", "gltf", "3mf")
AXES = ("x", "y", "z", "-x", "-y", "-z")
PRESETS = ("studio", "headlight")
REFLECTIONS = ("phong", "blinn", "lambert", "oren-nayar", "cook-torrance", "toon")
AZIMUTH, ELEVATION, FOV = 35.0, 25.0, 30.0  # those of Camera.framing; a test holds that
COMPARED_SIZE = (320, 240)  # four pictures beside each other, one of them by the reference, which is slow
PICTURE_SAMPLES = 4  # a picture is to look good; an array is to be exact, with Options' one sample

# name: (azimuth, elevation) in degrees; front is seen from +z with y up, from -y with z up
VIEWS = {
    "iso": (45.0, 35.264389682754654),  # atan(1/√2): the three axes look equally long
    "front": (0.0, 0.0),
    "back": (180.0, 0.0),
    "left": (-90.0, 0.0),
    "right": (90.0, 0.0),
    "top": (0.0, 90.0),
    "bottom": (0.0, -90.0),
}

LIGHTS = {  # kind: (numbers it is given, names it takes besides)
    "ambient": (None, ()),
    "directional": ("direction", ("color", "attached")),
    "point": ("position", ("color", "attenuation", "range", "amplify", "attached")),
    "spot": (
        "position",
        ("direction", "color", "inner", "outer", "exponent", "attenuation", "range", "amplify", "attached"),
    ),
    "area": ("corner", ("edge_u", "edge_v", "color", "resolution", "attenuation", "range", "amplify", "attached")),
}
_NEEDED = {"spot": ("direction",), "area": ("edge_u", "edge_v")}  # without them there is no such light


class LightArgument(NamedTuple):
    """A light as written: its kind, and the arguments of its class, of which colours are not read yet."""

    kind: str
    settings: dict


def parse(argv) -> argparse.Namespace:
    """Parse the arguments; SceneError where they are not legal.

    Models and flags may come in any order. A value may begin with a minus sign: `--eye -1,2,3`, `--up -z`.
    """
    parser, commands = _make_parsers()
    argv = _joined_values(list(argv))
    if argv and argv[0] in commands:
        arguments = commands[argv[0]].parse_intermixed_args(argv[1:])
        arguments.command = argv[0]
        return arguments
    parser.parse_args(argv)  # help, the version, or an error
    raise SceneError(f"a command is missing: {' or '.join(commands)} (see raster --help)")


def _joined_values(argv) -> list[str]:
    """Join a flag and a value that argparse would take for another flag: -1,2,3 or -z."""
    joined = []
    is_after_end = False
    for word in argv:
        is_after_end = is_after_end or word == "--"
        is_value = (
            re.match(r"-(\.?\d|[xyz]$)", word) and joined and re.fullmatch(r"--[a-z]+(-[a-z]+)*", joined[-1])
        )
        if is_value and not is_after_end:
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are ours: one line, and the exit code chosen in one place."""

    def error(self, message):
        raise SceneError(f"{message} (see {self.prog} --help)")


def _make_parsers() -> tuple[_Parser, dict[str, _Parser]]:
    """Make the parser of the program, and of its commands by name."""
    parser = _Parser(
        "raster", description="Draw 3-D models, without GPU, OpenGL or display.", allow_abbrev=False
    )
    parser.add_argument("--version", action="version", version=f"raster {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", title="commands", parser_class=_Parser)
    render = commands.add_parser(
        "render",
        help="draw models, one picture a file",
        usage="raster render MODEL... [-o OUT] [options]",
        description="Draw each model and write a picture of it, or an array.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    _add_files(render, "{stem}", Options.size)
    _add_array(render)
    _add_camera(render)
    look = render.add_argument_group("look")
    _add_method(look)
    _add_look(look)
    exactness = render.add_argument_group("exactness and speed")
    _add_tolerance(exactness)
    _add_loading(exactness)
    _add_messages(render)
    compare = commands.add_parser(
        "compare",
        help="show flat, Gouraud's and Phong's shading beside the reference, with error maps",
        usage="raster compare MODEL... [-o OUT] [options]",
        description=_COMPARE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    _add_files(compare, "{stem}-compare", COMPARED_SIZE)
    _add_reference(compare)
    _add_camera(compare)
    _add_look(compare.add_argument_group("look"))
    _add_loading(compare.add_argument_group("loading and speed"))
    _add_messages(compare)
    warmup = commands.add_parser(
        "warmup",
        help="compile all kernels now, so that the first picture doesn't wait for it",
        description="Compile the kernels of all shading methods and keep them on disk.",
        allow_abbrev=False,
    )
    _add_messages(warmup)
    return parser, {"render": render, "compare": compare, "warmup": warmup}


_EXAMPLES = """\
examples:
  raster render part.stl                                     part.png, here
  raster render part.stl -o side.jpg --view left --ortho -s 1920x1080 --background white
  raster render 'parts/*.stl' -o 'thumbs/{stem}-{view}.png' --view iso --view top -s 256 --json
  raster render part.obj --light ambient:0.2 --light directional:1,-1,0,color=#ffddaa
  raster render part.obj --array depth -o depth.npy          float32, inf where nothing is
  cat part.stl | raster render - --input-format stl -o - > part.png

lights, in scene units, colours #f80, orange, 0.5 (linear grey) or 1/0.9/0.8 (linear):
  ambient:COLOR
  directional:X,Y,Z[,color=COLOR][,attached=camera]          the way the light goes
  point:X,Y,Z[,color=COLOR][,attenuation=KC/KL/KQ][,range=R][,amplify=yes][,attached=camera]
  spot:X,Y,Z,direction=X/Y/Z[,inner=A][,outer=A][,exponent=E][, and as for point]     angles in degrees from the axis
  area:X,Y,Z,edge_u=X/Y/Z,edge_v=X/Y/Z[,resolution=M/N][, and as for point]           corner and two edges
attenuation is 1/(KC + KL d + KQ d^2), never above 1 without amplify; 1, 1/(d+3) and 1/d^2 may be written as such

exit codes: 0 done, 1 some models failed and the rest was done, 2 usage, 3 a model can't be read or is empty,
4 an output can't be written, 130 interrupted
"""


_COMPARE = """\
Draw each model with flat, Gouraud's and Phong's shading and with the reference, one sample a pixel, side by
side on one sheet. Below them are their errors, in false colours on one scale: the difference of linear
intensity from the reference's Phong shading. On stdout goes a table:

  max, rms           error, in linear intensity where white is 1
  levels over 1      8-bit values, three a pixel, that are more than one level off
  value, slope jump  Mach bands: the largest jump of the intensity, and of its slope per pixel, across the edge
                     of two polygons where the surface is smooth
"""


def _add_files(parser, default_name, size) -> None:
    parser.set_defaults(default_name=default_name)
    add = parser.add_argument
    add(
        "models",
        nargs="+",
        metavar="MODEL",
        help=f"{', '.join(FORMATS)} files, or patterns such as 'parts/*.stl'; - is stdin",
    )
    add(
        "-o",
        "--output",
        metavar="OUT",
        help=f"the picture's name (default {default_name.replace('{stem}', 'MODEL')}.png in the current folder), a "
        "folder, a template with {stem} {ext} {view}, or - for stdout; the suffix chooses the format",
    )
    add(
        "-s",
        "--size",
        type=_size,
        default=size,
        metavar="WxH",
        help=f"pixels, or one number for a square (default {size[0]}x{size[1]})",
    )
    add(
        "--json",
        action="store_true",
        help="print a line of JSON for each picture on stdout (on stderr with -o -)",
    )
    add("--input-format", choices=FORMATS, help="of the models, whatever their suffix; needed for stdin")


def _add_array(parser) -> None:
    parser.add_argument(
        "--array",
        dest="outputs",
        choices=OUTPUTS,
        help="write this array of the picture as .npy (default MODEL.npy): color is linear float32, rgb "
        "uint8, depth in scene units, face the face's index or -1, normal in world space; one sample a pixel",
    )


def _add_reference(parser) -> None:
    parser.set_defaults(outputs=None)  # a sheet of pictures, no array
    parser.add_argument(
        "--no-reference",
        dest="has_reference",
        action="store_false",
        help="compare with Phong's shading as rendered, which takes no time",
    )


def _add_camera(parser) -> None:
    group = parser.add_argument_group("camera", "Unless --eye is given, the model fills the picture.")
    add = group.add_argument
    add(
        "--view",
        dest="views",
        action="append",
        choices=tuple(VIEWS),
        default=[],
        help="where from; several make a picture each",
    )
    add(
        "--azimuth",
        type=_number,
        metavar="A",
        help=f"degrees about the up axis, 0 = front (default {AZIMUTH:g})",
    )
    add("--elevation", type=_number, metavar="A", help=f"degrees above the horizon (default {ELEVATION:g})")
    add(
        "--fov",
        type=_number,
        default=FOV,
        metavar="A",
        help=f"vertical field of view, degrees (default {FOV:g})",
    )
    add("--ortho", action="store_true", help="without perspective; with --eye, the target keeps its size")
    add("--zoom", type=_number, default=1.0, metavar="F", help="enlarge the middle of the picture F times")
    add("--eye", type=_vector, metavar="X,Y,Z", help="where the camera stands")
    add("--target", type=_vector, metavar="X,Y,Z", help="what it looks at (default: the model's middle)")
    add(
        "--up",
        choices=("auto", *AXES),
        default="auto",
        help="up axis (default auto: z for stl and 3mf, else y)",
    )


def _add_method(group) -> None:
    add = group.add_argument
    add(
        "--shading",
        choices=SHADINGS,
        default=Options.shading,
        help="light polygons (flat or lambert), vertices (gouraud) or samples (phong) "
        f"(default {Options.shading})",
    )
    add(
        "--samples",
        type=int,
        choices=SAMPLES,
        help=f"samples a pixel (default {PICTURE_SAMPLES}, {Options.samples} for arrays)",
    )


def _add_look(group) -> None:
    add = group.add_argument
    add(
        "--crease-angle",
        type=_number,
        metavar="A",
        help="edges between faces that meet at more degrees stay sharp (default: as the file says, else 30)",
    )
    add("--reflection", choices=REFLECTIONS, help="reflection model (default: the material's)")
    add("--preset", choices=PRESETS, help="ready-made lights (default studio, or none beside --light)")
    add(
        "--light",
        dest="lights",
        action="append",
        type=_light,
        default=[],
        metavar="KIND:...",
        help="add a light",
    )
    add(
        "--background",
        type=_color,
        default="transparent",
        metavar="COLOR",
        help="colour, or transparent (default)",
    )
    add(
        "--color-range",
        choices=COLOR_RANGES,
        default=Options.color_range,
        help="what becomes of colours too bright: cut off, the picture darkened, or the pixel darkened "
        f"(default {Options.color_range})",
    )
    add(
        "--cull",
        choices=CULLS,
        default=Options.cull,
        help=f"leave out faces seen from behind (default {Options.cull})",
    )


def _add_tolerance(group) -> None:
    group.add_argument(
        "--tolerance",
        type=_number,
        default=Options.tolerance,
        metavar="T",
        help="error accepted, in linear intensity with white = 1; 0 = as exact as float64 (default 1/4096: "
        "8-bit values are off by one level at most)",
    )


def _add_loading(group) -> None:
    add = group.add_argument
    add(
        "--threads",
        type=int,
        default=Options.threads,
        metavar="N",
        help="(default: all that the process may use)",
    )
    add("--drop-bad-faces", action="store_true", help="leave out faces with NaN or infinite coordinates")


def _add_messages(parser) -> None:
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
    group.add_argument(
        "-q", "--quiet", dest="level", action="store_const", const=QUIET, help="say nothing but errors"
    )


# --- types: text to value, ArgumentTypeError where it is none ----------------------------------------------


def _number(text) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf"):
        raise argparse.ArgumentTypeError(f"a finite number is needed; given {text!r}")
    return value


def _vector(text, separator=",") -> tuple[float, ...]:
    """Three numbers."""
    parts = text.split(separator)
    if len(parts) != 3:
        form = separator.join("XYZ")
        raise argparse.ArgumentTypeError(f"three numbers {form} are needed; given {text!r}")
    return tuple(_number(part) for part in parts)


def _size(text) -> tuple[int, int]:
    """800x600, or 512 for a square."""
    match = re.fullmatch(r"(\d{1,9})(?:[xX×](\d{1,9}))?", text)
    if not match:
        raise argparse.ArgumentTypeError(f"WIDTHxHEIGHT or one number is needed, in pixels; given {text!r}")
    width, height = match.groups()
    return int(width), int(height or width)


def _color(text):
    """A linear grey or triple as numbers; anything else stays text, to be read as hex or a CSS name."""
    if re.fullmatch(r"[-+.\d]+([eE][-+]?\d+)?", text):
        return _number(text)
    return _vector(text, "/") if "/" in text else text


def _light(text) -> LightArgument:
    """KIND:numbers,name=value,..."""
    kind, _, rest = text.partition(":")
    if kind not in LIGHTS:
        legal = ", ".join(f"{name}:..." for name in LIGHTS)
        raise argparse.ArgumentTypeError(f"a light is one of {legal}; given {text!r}")
    numbers, names = LIGHTS[kind]
    if numbers is None:
        return LightArgument(kind, {"color": _color(rest.removeprefix("color=") or "1")})
    parts = rest.split(",")
    settings = {numbers: _vector(",".join(parts[:3]))}
    for part in parts[3:]:
        name, _, value = part.partition("=")
        if name not in names or not value:
            legal = ", ".join(f"{name}=..." for name in names)
            raise argparse.ArgumentTypeError(f"a {kind} light takes {legal}; given {part!r}")
        settings[name] = _light_value(name, value)
    for name in _NEEDED.get(kind, ()):
        if name not in settings:
            raise argparse.ArgumentTypeError(f"a {kind} light needs {name}=X/Y/Z; given {text!r}")
    return LightArgument(kind, settings)


def _light_value(name, value):
    """One value of a light, as its class takes it."""
    if name == "color":
        return _color(value)
    if name in ("direction", "edge_u", "edge_v"):
        return _vector(value, "/")
    if name == "attenuation":
        return value if value.startswith("1/(") or "d" in value or "/" not in value else _vector(value, "/")
    if name in ("inner", "outer", "exponent", "range"):
        return _number(value)
    if name == "resolution":
        if not re.fullmatch(r"\d+/\d+", value):
            raise argparse.ArgumentTypeError(f"a resolution is M/N, two whole numbers; given {value!r}")
        return tuple(int(count) for count in value.split("/"))
    if name == "amplify":
        if value not in ("yes", "no"):
            raise argparse.ArgumentTypeError(f"amplify is yes or no; given {value!r}")
        return value == "yes"
    return value
