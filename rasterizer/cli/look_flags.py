"""Flags that say how a model looks. Every field of `Options` is a flag."""

import argparse

from .. import choices
from ..options import MAX_WAVES, MIN_WAVES, Options
from . import values
from .defaults import UNSAID
from .edge_arguments import add_edges
from .flags import add_loading, add_tolerance
from .material_arguments import material


def add_drawing(parser):
    """Add how pictures look, and how exactly and quickly they are drawn; return the group of the latter."""
    look = parser.add_argument_group("look")
    add_method(look)
    add_look(look)
    add_ground(look)
    add_edges(look)
    exactness = parser.add_argument_group("exactness and speed")
    add_tolerance(exactness)
    add_loading(exactness)
    return exactness


def add_method(group) -> None:
    """Add how surfaces are shaded and sampled."""
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
        help=f"samples a pixel (default {Options.samples}); buffers have one",
    )
    add(
        "--antialias",
        choices=choices.ANTIALIASES,
        help=f"light and textures for every sample, or once for each polygon in a pixel (default {Options.antialias})",
    )


def add_ground(group) -> None:
    """Add the ground under the model."""
    group.add_argument(
        "--ground",
        action=argparse.BooleanOptionalAction,
        help="the tabletop: a key light with its shadow in place of the studio's, and a soft shadow on the ground, "
        "in pictures' alpha",
    )


def add_look(group) -> None:
    """Add materials, lights and colours."""
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
    add(
        "--color",
        dest="materials",
        action="append",
        type=lambda text: {"diffuse": values.color(text)},
        metavar="COLOR",
        help="short for --material diffuse=...",
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
    add("--shadow-size", type=int, metavar="N", help="texels along the side of shadow maps, 16 to 8192 (default 1024)")
    add("--shadow-filter", type=int, metavar="N", help="texels that soften the edges of shadows, odd, 1 (hard) to 9")


def _add_range(group) -> None:
    add = group.add_argument
    add(
        "-b",
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
        help=f"compute with N samples of the spectrum, {MIN_WAVES} to {MAX_WAVES} (default: 81 where a light or "
        "material has one, else three colours)",
    )
    add(
        "--cull",
        choices=choices.CULLS,
        help=f"leave out faces seen from behind (default {Options.cull})",
    )
