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
metallic_roughness (pictures), reflection distribution (words), normalized (yes or no). Where ambient or metal isn't
given, it is the diffuse colour. A name first, as in gold,shininess=80, takes the rest from the classic table.
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
no, SIZE or SIZE/FILTER: texels along its map, and along the square that softens its edge.
"""


_HELD = {"color": "linear float32", "rgb": "uint8", **choices.BUFFERS, EVERY: "color and every buffer"}
_ARRAYS = "".join(f"\n  {name:<17}{text}" for name, text in _HELD.items())
_Z_UP = " and ".join(each.name for each in formats.FORMATS.values() if each.up == "z")

# Each flag takes a line for what it is, and one for what the help says.
# fmt: off


def add_models(parser) -> None:
    """Add the models that are read, and how."""
    group = parser.add_argument_group("models", "A scene file (.json) holds models, materials, lights, "
                                      "camera, background, depth cue and options; flags come first.")
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
        help="of a folder, take all models in it and below; outputs stay in folders")
    add_loading(group)


def add_loading(group) -> None:
    """Add what is accepted of models."""
    add = group.add_argument
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
    several = "; several -o, each after its --array, write what one frame shows" if has_arrays else ""
    group = parser.add_argument_group("output")
    default = f"{default_name.replace('{stem}', 'MODEL')}{suffix} in the current folder"
    default += ", -VIEW before .png for several views" if "{view}" in fields else ""
    group.add_argument(
        "-o", "--output", metavar="OUT", action=_Outputs if has_arrays else "store",
        help=f"the picture's name (default {default}), a folder, a template with {fields}, or - for stdout; the suffix "
        f"chooses the format{several}")
    add_size(group, size)
    if has_arrays:
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
        help="say what a file had, what was used, and how long it took; -vv: also how it was drawn")
    add("-q", "--quiet", dest="level", action="store_const", const=QUIET, help="say nothing but errors")


def add_arrays(parser) -> None:
    """Add arrays, in place of pictures or beside them."""
    group = parser.add_argument_group(
        "array", "-o '{stem}.{array}.png' makes a file of each, as an -o after each does. Arrays have one sample a "
        f"pixel, but for color and rgb with --samples.\n{_ARRAYS}")
    add = group.add_argument
    add("--array", dest="outputs", action="append", choices=tuple(_HELD), metavar="NAME",
        help="write this array of the picture, as .npy, .png or .exr (default MODEL.npy), or several, as .npz or .exr "
        "(repeat it; default MODEL.npz)")
    add("--scale", type=values.number, metavar="UNITS",
        help="scene units of 1 in a .png of the depth, which takes 1 to 65535 (default 0.001)")
    _add_option(group, "min_opacity", "from which opacity on a surface counts for arrays but color and rgb "
                "(default 0: all do)", type=values.fraction, metavar="A")


def add_processes(group) -> None:
    """Add how many processes draw."""
    group.add_argument(
        "-j", "--processes", dest="n_process", type=values.processes, metavar="N",
        help="draw N models at a time, each in a process of its own with one thread (unless --threads says more)")


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
        "camera", "The model fills the picture, unless --eye is given. A scene file's camera is used where none of "
        "these but --zoom is given; a model's is, with --camera file.").add_argument
    parser.set_defaults(views=[])
    if views:
        legal = (*choices.VIEWS, "random:N") if has_seed else tuple(choices.VIEWS)
        add("--view", dest="views", action="extend", default=[], metavar="LIST",
            type=values.views if has_seed else values.list_of(str, legal),
            help=f"from {', '.join(legal)}; several, with commas, make a picture each")
    if has_seed:
        add("--seed", type=values.seed, metavar="N",
            help="of random:N and --light random: N, N+1, ... for each model's views")
    add("--azimuth", type=values.number, metavar="A", help=f"degrees {azimuth}, 0 = front (default {AZIMUTH:g})")
    add("--elevation", type=values.number, metavar="A", help=f"degrees above the horizon (default {ELEVATION:g})")
    add("--fov", type=values.number, metavar="A", help=f"vertical field of view, degrees (default {FOV:g})")
    add("--ortho", action="store_true", help="no perspective; with --eye, the target keeps its size")
    add("--zoom", type=values.number, default=1.0, metavar="F",
        help="enlarge the middle of the picture F times (default 1)")
    add("--margin", type=values.percentage, metavar="M",
        help="share that stays empty on each side (default 5%%)")
    add("--camera", metavar="FILE",
        help=f"a camera out of a scene file, or one in JSON; file = the model's own; {frame}")
    add("--eye", type=values.vector, metavar="X,Y,Z", help="where the camera stands")
    add("--target", type=values.vector, metavar="X,Y,Z", help="what it looks at (default: the model's middle)")
    add("--up", type=values.axis, choices=("auto", *choices.AXES),
        help=f"up axis (default auto: that of a scene file or a dae, z for {_Z_UP}, else y)")


def add_look(parser, is_compared=False):
    """Add how models look, and how exactly and quickly they are drawn; return the group of the latter.

    Parameters
    ----------
    is_compared : leave out what methods that are compared say themselves, and what isn't compared
    """
    group = parser.add_argument_group("shading")
    if not is_compared:
        _add_option(group, "shading", "light polygons (flat or lambert), vertices (gouraud) or samples (phong)")
        _add_option(group, "samples", "samples a pixel; buffers have one")
    add = group.add_argument
    add("--crease-angle", type=values.number, metavar="A",
        help="edges between faces that meet at more degrees stay sharp (default: as the file says, else 30)")
    add("--weighting", choices=choices.WEIGHTINGS,
        help="what faces count by where normals are averaged (default: as a scene file says, else angle)")
    add("--subdivide", type=int, default=0, metavar="N",
        help="cut every triangle in four, N times, up to 15: for highlights with gouraud (default 0)")
    _add_option(group, "cull", "leave out what closed bodies hide, nothing, or all faces seen from behind")

    add = parser.add_argument_group("material", _MATERIAL).add_argument
    add("--material", dest="materials", action="append", type=values.material, default=[],
        metavar="[NAME,]KEY=VALUE,...",
        help="replace this in every material of the model; NAME is one of the classic table: gold, jade, red plastic "
        "... (default: the file's materials, else neutral grey)")
    add("--color", type=values.color, metavar="COLOR",
        help="the colour of everything, in place of textures and the file's colours, which --material diffuse=... "
        "multiplies")
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
        help="add a light; in raster render and batch also random, for lights by --seed in place of the file's")

    group = parser.add_argument_group("shadow")
    add = group.add_argument
    add("--shadows", action="store_true", help="all lights but ambient ones cast shadows, unless one says shadow=no")
    add("--shadow-size", type=int, metavar="N", help="texels along the side of shadow maps, 16 to 8192 (default 1024)")
    add("--shadow-filter", type=int, metavar="N",
        help="texels that soften the edges of shadows, odd, 1 (hard) to 9 (default 1)")
    if not is_compared:
        _add_option(group, "ground", "the tabletop: a key light with its shadow in place of the studio's, and a soft "
                    "shadow on the ground, in pictures' alpha (default: none, or as a scene file says)")

    group = parser.add_argument_group("picture")
    add = group.add_argument
    add("-b", "--background", type=values.color, metavar="COLOR",
        help="colour, or transparent (default, but for a scene file with a background)")
    add("--depth-cue", type=values.depth_cue, default=UNSAID, metavar="D[,start=S][,color=C]",
        help="let what is further away fade to the colour C (default black): d units behind S (default 0), D/(D+d) is "
        "left; none = not even as the scene file says")
    _add_option(group, "color_range",
                "what becomes of colours too bright: cut off, the picture darkened, or the pixel darkened")
    _add_option(group, "exposure", "multiply the light by 2^STOPS, the background not (default 0)", metavar="STOPS")
    _add_option(group, "spectral", f"compute with N samples of the spectrum, {MIN_WAVES} to {MAX_WAVES} "
                "(default: 81 where a light or material has one, else three colours)", metavar="N")
    if not is_compared:
        _add_option(group, "edges", "edges of polygons drawn over the picture where nothing hides them, with commas "
                    "between: wire (all), crease (where faces meet at more than the crease angle, or end), silhouette, "
                    "all (default: none)", type=values.edge_types, metavar="LIST")
        _add_option(group, "edge_color", "of the edges (default black)", type=values.color, metavar="COLOR")
        _add_option(group, "edge_width", "of the edges, in pixels", metavar="PX")

    group = parser.add_argument_group("speed")
    if not is_compared:
        _add_option(group, "tolerance", "error accepted, in linear intensity with white = 1; 0 = all in float64 "
                    "(default 1/4096: 8-bit values are off by one level at most, but next to steps of the light)",
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
