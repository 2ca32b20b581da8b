"""The flags of each command: their types, defaults and help. Every field of `Options` is a flag."""

from dataclasses import fields

from .. import choices
from ..io import formats
from ..options import LEAST_WAVES, MOST_WAVES, Options
from . import values
from .defaults import AZIMUTH, COMPARED_SIZE, ELEVATION, FOV, PICTURE_SAMPLES, UNSAID, VIEWS
from .material_arguments import material
from .messages import NORMAL, QUIET, VERBOSE


def add_flags(parser, command: str) -> None:
    """Add the flags of a command to its parser."""
    adders = {"render": _add_render, "compare": _add_compare, "bench": _add_bench, "warmup": _add_warmup}
    adders[command](parser)


def fill_in_defaults(arguments) -> None:
    """Remember in `given` which options were given, because a scene file's come before the defaults; fill in those.

    "samples" and "outputs" stay None where they depend on what is written.
    """
    names = [field.name for field in fields(Options) if hasattr(arguments, field.name)]
    arguments.given = frozenset(name for name in names if getattr(arguments, name) is not None)
    defaults = {field.name: field.default for field in fields(Options)}
    defaults |= {"samples": None, "outputs": None, "size": getattr(arguments, "default_size", None)}
    for name in names:
        if name not in arguments.given:
            setattr(arguments, name, defaults[name])


def _add_render(parser) -> None:
    _add_files(parser, "{stem}", Options.size)
    _add_array(parser)
    _add_camera(parser)
    look = parser.add_argument_group("look")
    _add_method(look)
    _add_look(look)
    exactness = parser.add_argument_group("exactness and speed")
    _add_tolerance(exactness)
    _add_loading(exactness)
    _add_messages(parser)


def _add_compare(parser) -> None:
    _add_files(parser, "{stem}-compare", COMPARED_SIZE)
    _add_reference(parser)
    _add_camera(parser)
    _add_look(parser.add_argument_group("look"))
    _add_loading(parser.add_argument_group("loading and speed"))
    _add_messages(parser)


def _add_bench(parser) -> None:
    parser.set_defaults(outputs=None, default_name=None, default_size=Options.size)
    _add_models(parser)
    parser.add_argument(
        "--plot",
        dest="output",
        metavar="OUT",
        help="draw time against error, as .png, .svg or .pdf; with {stem} or {view} for several (needs matplotlib)",
    )
    _add_size(parser, Options.size)
    parser.add_argument("--json", action="store_true", help="print a line of JSON for each model instead of the table")
    _add_measured(parser.add_argument_group("what is measured", "Lists have commas between their values."))
    _add_camera(parser)
    _add_look(parser.add_argument_group("look"))
    _add_loading(parser.add_argument_group("loading and speed"))
    _add_messages(parser)


def _add_measured(group) -> None:
    add = group.add_argument
    add(
        "--shadings",
        type=values.list_of(str, choices.SHADINGS),
        default=("flat", "gouraud", "phong"),
        metavar="LIST",
        help="(default flat,gouraud,phong)",
    )
    add(
        "--subdivisions",
        type=values.list_of(values.whole, range(16)),
        default=(0, 1, 2),
        metavar="LIST",
        help="times that triangles are cut in four for gouraud (default 0,1,2)",
    )
    add(
        "--samples",
        dest="list_of_samples",
        type=values.list_of(values.whole, choices.SAMPLES),
        default=(1, 4, 16),
        metavar="LIST",
        help="samples a pixel (default 1,4,16)",
    )
    add(
        "--tolerances",
        type=values.list_of(values.fraction),
        default=(0.0, Options.tolerance, 1 / 64),
        metavar="LIST",
        help="(default 0,1/4096,1/64)",
    )
    add(
        "--no-axes",
        dest="has_axes",
        action="store_false",
        help="leave out what else the scene has: reflection, shadow maps, area lights, textures, spectra",
    )
    add(
        "--flip", dest="with_flip", action="store_true", help="also FLIP, 0 to 1 (needs flip-evaluator; a second a row)"
    )
    add("--seconds", type=values.number, default=50.0, metavar="N", help="time limit (default 50); compiling is extra")


def _add_warmup(parser) -> None:
    parser.add_argument(
        "--into",
        metavar="FOLDER",
        help="make a store that can be shipped: it is found where FOLDER is the installed package's folder `kernels`",
    )
    parser.add_argument(
        "--cpu", choices=choices.PROCESSOR_LEVELS, help="what the code shall run on (default: this machine's processor)"
    )
    _add_messages(parser)


def _add_models(parser) -> None:
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


def _add_size(parser, size) -> None:
    parser.add_argument(
        "-s",
        "--size",
        type=values.picture_size,
        metavar="WxH",
        help=f"pixels, or one number for a square (default {size[0]}x{size[1]})",
    )


def _add_files(parser, default_name, size) -> None:
    parser.set_defaults(default_name=default_name, default_size=size)
    _add_models(parser)
    add = parser.add_argument
    add(
        "-o",
        "--output",
        metavar="OUT",
        help=f"the picture's name (default {default_name.replace('{stem}', 'MODEL')}.png in the current folder, "
        "-VIEW before .png for several views), a folder, a template with {stem} {ext} {view}, or - for stdout; "
        "the suffix chooses the format; a .tif or .npy that is larger than the memory is written while it is drawn",
    )
    _add_size(parser, size)
    add(
        "--json",
        action="store_true",
        help="print a line of JSON for each picture on stdout (on stderr with -o -)",
    )


def _add_array(parser) -> None:
    parser.add_argument(
        "--array",
        dest="outputs",
        choices=tuple(dict.fromkeys((*choices.OUTPUTS, *choices.BUFFERS))),
        help="write this array of the picture as .npy (default MODEL.npy): color is linear float32, rgb uint8, "
        + "".join(f"{name} {text}, " for name, text in choices.BUFFERS.items()).rstrip(", ")
        + "; one sample a pixel, but for color and rgb with --samples",
    )


def _add_reference(parser) -> None:
    parser.set_defaults(outputs=None)  # a sheet of pictures, no array
    parser.add_argument(
        "--methods",
        type=values.list_of(values.method),
        default=("flat", "gouraud", "phong"),
        metavar="LIST",
        help="what is compared, with commas between; gouraud+N cuts triangles in four N times before "
        "(default flat,gouraud,phong)",
    )
    parser.add_argument(
        "--no-reference",
        dest="has_reference",
        action="store_false",
        help="compare with Phong's shading as rendered, which is quicker",
    )


def _add_camera(parser) -> None:
    group = parser.add_argument_group(
        "camera",
        "Unless --eye is given, the model fills the picture. A camera that a file brings along is used where none of "
        "these but --zoom is given.",
    )
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
        type=values.number,
        metavar="A",
        help=f"degrees about the up axis, 0 = front (default {AZIMUTH:g})",
    )
    add("--elevation", type=values.number, metavar="A", help=f"degrees above the horizon (default {ELEVATION:g})")
    add(
        "--fov",
        type=values.number,
        metavar="A",
        help=f"vertical field of view, degrees (default {FOV:g})",
    )
    add("--ortho", action="store_true", help="without perspective; with --eye, the target keeps its size")
    add("--zoom", type=values.number, default=1.0, metavar="F", help="enlarge the middle of the picture F times")
    add("--eye", type=values.vector, metavar="X,Y,Z", help="where the camera stands")
    add("--target", type=values.vector, metavar="X,Y,Z", help="what it looks at (default: the model's middle)")
    add(
        "--up",
        choices=("auto", *choices.AXES),
        help="up axis (default auto: z for stl and 3mf, y for other models, that of a scene file)",
    )


def _add_method(group) -> None:
    add = group.add_argument
    add(
        "--shading",
        choices=choices.SHADINGS,
        help=f"light polygons (flat or lambert), vertices (gouraud) or samples (phong) (default {Options.shading})",
    )
    add(
        "--samples",
        type=int,
        choices=choices.SAMPLES,
        help=f"samples a pixel (default {PICTURE_SAMPLES}, {Options.samples} for arrays)",
    )
    add(
        "--antialias",
        choices=choices.ANTIALIASES,
        help=f"light and textures for every sample, or once for each polygon in a pixel (default {Options.antialias})",
    )


def _add_look(group) -> None:
    add = group.add_argument
    add(
        "--crease-angle",
        type=values.number,
        metavar="A",
        help="edges between faces that meet at more degrees stay sharp (default: as the file says, else 30)",
    )
    add(
        "--weighting",
        choices=choices.WEIGHTINGS,
        help="what faces count by where normals are averaged (default: as a scene file says, else angle)",
    )
    add(
        "--subdivide",
        type=int,
        default=0,
        metavar="N",
        help="cut every triangle in four, N times, up to 15: for highlights with gouraud (default 0)",
    )
    add(
        "--material",
        dest="materials",
        action="append",
        type=material,
        default=[],
        metavar="[NAME,]KEY=VALUE,...",
        help="replace this in every material of the model; "
        "NAME is one of the classic table: gold, jade, red plastic ...",
    )
    models = ",".join(choices.REFLECTIONS)
    add("--reflection", metavar=f"{{{models}}}", help="short for --material reflection=...")
    _add_lights(group)
    _add_range(group)


def _add_lights(group) -> None:
    add = group.add_argument
    add(
        "--preset",
        choices=choices.PRESETS,
        help="ready-made lights (default: the file's own, else studio, or none beside --light)",
    )
    add(
        "--light",
        dest="lights",
        action="append",
        default=[],
        metavar="KIND:...",
        help="add a light",
    )
    add("--shadows", action="store_true", help="all lights but ambient ones cast shadows, unless one says shadow=no")
    add("--shadow-size", type=int, metavar="N", help="texels along the side of their maps, 16 to 8192 (default 1024)")
    add("--shadow-filter", type=int, metavar="N", help="texels that soften their edges, odd, 1 (hard, default) to 9")


def _add_range(group) -> None:
    add = group.add_argument
    add(
        "--background",
        type=values.color,
        metavar="COLOR",
        help="colour, or transparent (default, but for a scene file with a background)",
    )
    add(
        "--depth-cue",
        type=values.depth_cue,
        default=UNSAID,
        metavar="D[,start=S][,color=C]",
        help="let what is further away fade to the colour C (default black): d units behind S (default 0), D/(D+d) is "
        "left; none = not even as the scene file says",
    )
    add(
        "--color-range",
        choices=choices.COLOR_RANGES,
        help="what becomes of colours too bright: cut off, the picture darkened, or the pixel darkened "
        f"(default {Options.color_range})",
    )
    add(
        "--exposure",
        type=values.number,
        metavar="STOPS",
        help="multiply the light by 2^STOPS, the background not (default 0)",
    )
    add(
        "--spectral",
        type=int,
        metavar="N",
        help=f"compute with N samples of the spectrum, {LEAST_WAVES} to {MOST_WAVES} (default: 81 where a light or "
        "material has one, else three colours)",
    )
    add(
        "--cull",
        choices=choices.CULLS,
        help=f"leave out faces seen from behind (default {Options.cull})",
    )


def _add_tolerance(group) -> None:
    group.add_argument(
        "--tolerance",
        type=values.fraction,
        metavar="T",
        help="error accepted, in linear intensity with white = 1; 0 = as exact as float64 (default 1/4096: "
        "8-bit values are off by one level at most, but next to steps of the light)",
    )


def _add_loading(group) -> None:
    add = group.add_argument
    add(
        "--threads",
        type=int,
        metavar="N",
        help="(default: all that the process may use)",
    )
    add("--drop-bad-faces", action="store_true", help="leave out faces with NaN or infinite coordinates")
    add(
        "--allow-outside",
        action="store_true",
        help="also read textures, buffers and parts of scenes that lie outside the folder of the file that names them",
    )


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
    group.add_argument("-q", "--quiet", dest="level", action="store_const", const=QUIET, help="say nothing but errors")
