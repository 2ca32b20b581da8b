"""The flags that several commands have, each once, in groups: models, output, array, camera, shading, material, light,
shadow, picture, speed.

Every field of `Options` is a flag. Its name, its words and its default are those of the field; where it isn't given it
is None: the default is filled in where the Request is made.
"""

import argparse
from typing import Literal, get_args, get_origin

from .. import choices
from ..choices import AZIMUTH, ELEVATION, FOV
from ..io import formats
from ..options import MAX_WAVES, MIN_WAVES, Options
from . import values
from .messages import NORMAL, QUIET

EVERY = "all"  # of arrays: color and every buffer
UNSAID = ("unsaid",)  # the default of a flag for which None is a value; no text, which argparse would read
_MATERIAL = """\
KEY is ambient diffuse specular emissive fresnel metal (colours), shininess opacity alpha_cutoff levels metallic
(numbers), roughness (a number, or two, A/B, along the tangent and across), tangent (u or X/Y/Z), texture
metallic_roughness (pictures), reflection distribution (words), normalized (yes or no). ambient and metal
are the diffuse colour unless they are given. With a name first, as in gold,shininess=80, the other fields are those of
that material.
"""

_LIGHT = """\
A light is one of these, in scene units; COLOR is #f80, orange, 0.5 (linear grey) or 1/0.9/0.8 (linear):

  ambient:COLOR
  directional:X,Y,Z[,color=COLOR][,attached=camera][,shadow=yes]
  point:X,Y,Z[,color=COLOR][,attenuation=KC/KL/KQ][,range=R][,amplify=yes]
        [,attached=camera][,shadow=yes]
  spot:X,Y,Z,direction=X/Y/Z[,inner=A][,outer=A][,exponent=E][,falloff=P]
        [, and as for point]
  area:X,Y,Z,edge_u=X/Y/Z,edge_v=X/Y/Z[,resolution=M/N][, and as for point]

A direction is the one in which light travels; angles are in degrees; an area has a corner and two edges. attenuation is
1/(KC + KL d + KQ d^2), never above 1 without amplify; 1, 1/d, 1/(d+3) and 1/d^2 may be written as such. shadow is yes,
no, SIZE or SIZE/FILTER: texels along a side of the shadow map, and of the square over which edges are softened.
"""


_HELD = {"color": "linear float32", "rgb": "uint8", **choices.BUFFERS, EVERY: "color and every buffer"}
_ARRAYS = "".join(f"\n  {name:<17}{text}" for name, text in _HELD.items())
_Z_UP = " and ".join(each.name for each in formats.FORMATS.values() if each.up == "z")

# Each flag takes a line for what it is, and one for what the help says.
# fmt: off


def add_models(parser) -> None:
    """Add the models that are read, and how."""
    group = parser.add_argument_group("models", "A scene file (.json) holds models, materials, lights, "
                                      "a camera, background, depth cue and options; flags override them.")
    models, scenes = [], []
    for entry in formats.FORMATS.values():
        (scenes if entry.is_scene else models).append(entry.name)
    add = group.add_argument
    add("models", nargs="+", metavar="MODEL",
        help=f"{', '.join(models)} files, scene files ({', '.join(scenes)}), "
        "or patterns such as 'parts/*.stl'; - is stdin")
    add("--input-format", choices=tuple(formats.FORMATS), metavar="NAME",
        help="format of the models, whatever their suffix; needed for stdin")
    add("--recursive", action="store_true",
        help="search folders, and those below, for models; outputs are put into folders of the same names")
    add("--drop-bad-faces", action="store_true", help="leave out faces with NaN or infinite coordinates")
    add("--allow-outside", action="store_true",
        help="also read textures, buffers and parts of scenes that lie outside the folder of the file that names them")


def add_output(parser, default_name, size, suffix=".png", fields="{stem} {ext} {view}", has_arrays=False) -> None:
    """Add what is written and what is said.

    Parameters
    ----------
    default_name : template of a name without suffix
    size : (width, height), the default
    suffix : of pictures, the default
    fields : what a template may hold
    has_arrays : whether `add_arrays` follows, so that there may be several files of a picture
    """
    parser.set_defaults(default_name=default_name, default_suffix=suffix, always_writes=True, outputs=None, files=())
    fields += " {array}" if has_arrays else ""
    several = ". Several pairs of --array NAME -o OUT write files of one picture" if has_arrays else ""
    group = parser.add_argument_group("output")
    default = f"{default_name.replace('{stem}', 'MODEL')}{suffix} in the current folder"
    default += ", -VIEW before .png for several views" if "{view}" in fields else ""
    group.add_argument(
        "-o", "--output", metavar="OUT", action=_Outputs if has_arrays else "store",
        help=f"the picture's name (default {default}), a folder, a template with {fields}, or - for stdout; the suffix "
        f"chooses the format{several}")
    add_size(group, size)
    if has_arrays:
        group.add_argument("--format", metavar="NAME",
            help="format of files in a folder, without -o or on stdout: png (default), jpg, webp ..., or of arrays")
        group.add_argument("--colorbar", action="store_true", help="draw a colour bar beside pictures of --scalars")
    group.add_argument("--skip-existing", action="store_true", help="leave out outputs that are there already")
    add_json(group, "print a line of JSON for each picture on stdout (on stderr with -o -)")
    add_messages(group)


def add_size(group, size) -> None:
    """Add the size of a picture, and its default (width, height)."""
    group.set_defaults(default_size=size)
    group.add_argument("-s", "--size", type=values.picture_size, metavar="WxH",
                       help=f"pixels, also as W,H, or one number for a square (default {size[0]}x{size[1]})")


def add_json(group, text) -> None:
    """Add lines of JSON."""
    group.add_argument("--json", action="store_true", help=text)


def add_messages(group) -> None:
    """Add how much is said."""
    add = group.add_mutually_exclusive_group().add_argument
    add("-v", "--verbose", dest="level", action="count", default=NORMAL,
        help="also say what each file holds, what of it is used, and how long it took; -vv: also how it is drawn")
    add("-q", "--quiet", dest="level", action="store_const", const=QUIET, help="say nothing but errors")


def add_arrays(parser) -> None:
    """Add arrays, in place of pictures or beside them."""
    group = parser.add_argument_group(
        "array", "With {array} in its name, as in -o '{stem}.{array}.png', each array gets a file. Arrays have one "
        f"sample a pixel; color and rgb have as many as --samples says.\n{_ARRAYS}")
    add = group.add_argument
    add("--array", dest="outputs", action="append", choices=tuple(_HELD), metavar="NAME",
        help="write this array of the picture, as .npy, .png or .exr (default MODEL.npy), or several, as .npz or .exr "
        "(repeat it; default MODEL.npz)")
    add("--scale", type=values.scale, metavar="UNITS",
        help="scene units for each step of a depth in a .png, which has the steps 1 to 65535 (default 0.001); auto = "
        "as fine as the furthest depth of each picture allows")
    _add_option(group, "min_opacity", "the least opacity of a surface that arrays other than color and rgb show "
                "(default 0: all)", type=values.fraction, metavar="A")


def add_processes(group) -> None:
    """Add how many processes draw."""
    group.add_argument(
        "-j", "--processes", dest="n_process", type=values.processes, metavar="N",
        help="draw in N processes, each with one thread unless --threads says more")


def add_camera(parser, views=True, azimuth="about the up axis",
               frame="frame = fill the picture although the model brings a camera", has_seed=False) -> None:
    """Add where a picture is taken from.

    Parameters
    ----------
    views : whether there may be several, by their names
    azimuth, frame : text, what the degrees of --azimuth are, and what --camera frame does
    has_seed : whether views and lights may be random
    """
    add = parser.add_argument_group(
        "camera", "Without --eye the camera stands where the model fills the picture. " + (
            "The camera of a scene file is used unless one of these flags other than --zoom is given; that of a model "
            "file is used with --camera file alone." if views else
            "The camera of a scene file, or of a model file, is used with --camera file alone.")).add_argument
    parser.set_defaults(views=[])
    if views:
        legal = (*choices.VIEWS, "random:N") if has_seed else tuple(choices.VIEWS)
        add("--view", dest="views", action="extend", default=[], metavar="LIST",
            type=values.views if has_seed else values.list_of(str, legal),
            help=f"from {', '.join(legal)}; several, with commas, make a picture each")
    if has_seed:
        add("--seed", type=values.seed, metavar="N",
            help="seed of random views, which are N, N+1, ... for each model, and of --light random (default 0)")
    add("--azimuth", type=values.number, metavar="A", help=f"degrees {azimuth}, 0 = front (default {AZIMUTH:g})")
    add("--elevation", type=values.number, metavar="A", help=f"degrees above the horizon (default {ELEVATION:g})")
    add("--fov", type=values.number, metavar="A", help=f"vertical field of view, degrees (default {FOV:g})")
    add("--ortho", action="store_true", help="no perspective; with --eye, the target keeps its size")
    add("--zoom", type=values.number, default=1.0, metavar="F",
        help="enlarge the middle of the picture F times (default 1)")
    add("--margin", type=values.percentage, metavar="M",
        help="share of the picture that stays empty at each border (default 5%%)")
    add("--camera", metavar="FILE",
        help=f"a scene file, whose camera is taken, or a JSON file of a camera alone; file = the model's own; {frame}")
    add("--eye", type=values.vector, metavar="X,Y,Z", help="where the camera stands")
    add("--target", type=values.vector, metavar="X,Y,Z", help="what it looks at (default: the model's middle)")
    add("--up", type=values.axis, choices=("auto", *choices.AXES),
        help="up axis; auto: by the shape, where a format doesn't say it (default: that of a scene file or a dae, z "
        f"for {_Z_UP}, else y)")


def add_appearance(parser, is_compared=False, is_measured=False):
    """Add how models look, and how exactly and quickly they are drawn; return the group of the latter.

    Parameters
    ----------
    is_compared : leave out what methods that are compared say themselves, and what isn't compared
    is_measured : leave out what changes no linear intensity, which alone is measured
    """
    group = parser.add_argument_group("shading")
    if not is_compared:
        _add_option(group, "shading", "compute light for polygons (flat or lambert), vertices (gouraud) or samples "
                    "(phong)")
        _add_option(group, "samples", "samples a pixel; buffers have one")
    add = group.add_argument
    add("--crease-angle", type=values.number, metavar="A",
        help="edges between faces that meet at more degrees stay sharp (default: as the file says, else 30)")
    add("--weighting", choices=choices.WEIGHTINGS,
        help="the weight of faces where normals are averaged (default: as a scene file says, else angle)")
    add("--subdivide", type=int, default=0, metavar="N",
        help="cut every triangle in four, N times, up to 15: for highlights with gouraud (default 0)")
    _add_option(group, "cull", "leave out the inner sides of closed bodies, nothing, or all faces seen from behind")

    add = parser.add_argument_group("material", _MATERIAL).add_argument
    add("--material", dest="materials", action="append", type=values.material, default=[],
        metavar="[NAME,]KEY=VALUE,...",
        help="set these fields of every material; NAME is a material of the classic table: gold, jade, red plastic ... "
        "(default: the file's materials, else neutral grey)")
    add("--color", type=values.color, metavar="COLOR",
        help="one colour for everything, in place of textures and the file's colours; --material diffuse=... "
        "multiplies these")
    add("--reflection", metavar=f"{{{','.join(choices.REFLECTIONS)}}}", help="short for --material reflection=...")

    add = parser.add_argument_group(
        "scalar field", "One number a vertex or face, shown by a colormap in the place of the model's colours."
    ).add_argument
    add("--scalars", metavar="NAME",
        help="a property of a PLY file or an attribute of glTF, by its name; or a .npy file of numbers")
    add("--cmap", metavar="NAME", help="colormap, as the package cmap names it (default viridis)")
    add("--clim", type=values.limits, metavar="LOW,HIGH",
        help="values at the colormap's ends (default: the least and the largest)")

    add = parser.add_argument_group("light", _LIGHT).add_argument
    add("--preset", choices=choices.PRESETS,
        help="ready-made lights (default: the file's own, else studio, or none beside --light)")
    add("--light", dest="lights", action="append", default=[], metavar="KIND:...",
        help="add a light; with render and batch, random puts lights made by --seed in the place of the file's")

    group = parser.add_argument_group("shadow")
    add = group.add_argument
    add("--shadows", action="store_true", help="all lights but ambient ones cast shadows, unless one says shadow=no")
    add("--shadow-size", type=int, metavar="N", help="texels along the side of shadow maps, 16 to 8192 (default 1024)")
    add("--shadow-filter", type=int, metavar="N",
        help="texels along the square over which edges of shadows are softened, odd, 1 (hard) to 9 (default 1)")
    if not is_compared:
        _add_option(group, "ground", "stand the model on a ground: a soft shadow lies under it, also in pictures' "
                    "alpha, and the tabletop's lights replace the studio's (default: as a scene file says, else not)")

    group = parser.add_argument_group("picture")
    add = group.add_argument
    add("-b", "--background", type=values.color, metavar="COLOR",
        help="colour behind the model, or transparent (default: that of a scene file, else transparent)")
    add("--depth-cue", type=values.depth_cue, default=UNSAID, metavar="D[,start=S][,color=C]",
        help="fade to the colour C (default black) with distance: d units beyond S (default 0) the share D/(D+d) of a "
        "colour is left; none = no depth cue, whatever a scene file says")
    if not is_measured:
        _add_option(group, "color_range",
                    "colours brighter than white are cut off, or the picture is darkened, or the pixel")
    _add_option(group, "exposure", "multiply the light by 2^STOPS, but not the background (default 0)", metavar="STOPS")
    _add_option(group, "spectral", f"compute with N samples of the spectrum, {MIN_WAVES} to {MAX_WAVES} "
                "(default: 81 where a light or material has one, else three colours)", metavar="N")
    if not is_compared:
        _add_option(group, "edges", "draw edges of polygons over the picture where nothing hides them, with commas "
                    "between: wire (all), crease (where faces meet at more than the crease angle, or end), silhouette, "
                    "all (default: none)", type=values.edge_types, metavar="LIST")
        _add_option(group, "edge_color", "colour of the edges (default black)", type=values.color, metavar="COLOR")
        _add_option(group, "edge_width", "width of the edges, in pixels", metavar="PX")

    group = parser.add_argument_group("speed")
    if not is_compared:
        _add_option(group, "tolerance", "error accepted, in linear intensity with white = 1; 0 = all in float64 "
                    "(default 1/4096: 8-bit values are off by one level at most, except next to steps of the light)",
                    type=values.fraction, metavar="T")
    _add_option(group, "threads", "threads that draw a picture (default: all that the process may use)", metavar="N")
    return group


# fmt: on


class _Outputs(argparse.Action):
    """Remember each -o, and the --array that stand between it and the one before; `output` is the last."""

    def __call__(self, _parser, namespace, value, _flag=None):
        n_before = 0
        for _, names in namespace.files:
            n_before += len(names)
        namespace.files = (*namespace.files, (value, tuple(namespace.outputs or ())[n_before:]))
        namespace.output = value


def _add_option(group, name, text, **settings) -> None:
    """Add the flag of a field of Options: its words and, where the text doesn't speak of it, its default are the
    field's."""
    field = Options.__dataclass_fields__[name]
    if get_origin(field.type) is Literal:
        words = get_args(field.type)
        settings |= {"choices": words, "type": type(words[0])}
    elif field.type is bool:
        settings["action"] = argparse.BooleanOptionalAction
    else:
        settings.setdefault("type", values.number if field.type is float else int)
    text += "" if "default" in text else f" (default {field.default})"
    group.add_argument(f"--{name.replace('_', '-')}", default=None, help=text, **settings)
