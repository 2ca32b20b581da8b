"""`raster compare`: the shading methods beside the reference, with error maps, times and Mach-band figures.

flat     Gouraud   Phong    reference        pictures, one sample a pixel, computed in float64
error    error     error    scale            false colours, one scale for all
"""

import math
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any, NamedTuple

from ..errors import counted
from . import values
from .flags import add_appearance, add_camera, add_models, add_output
from .messages import QUIET, STDIO, aligned, print_text

IMPORTS = ("drawing",)
SIZE = (320, 240)  # four pictures beside each other, one of them by the reference, which is slow
_DESCRIPTION = """\
Draw each model with flat, Gouraud's and Phong's shading (or --methods) and with the reference, one sample a pixel, side
by side on one sheet. Below them are their errors, in false colours on one scale: the difference of linear intensity
from the reference's Phong shading. A table is printed on stdout.
"""
_TABLE = """\
The table says of each method:

  ms                 a frame, median, with the default tolerance
  max, rms           error, in linear intensity where white is 1
  levels over 1      8-bit values, three a pixel, more than one level off
  value, slope jump  Mach bands: the largest jump of the intensity, and of its
                     slope per pixel, across the edge of two polygons where
                     the surface is smooth; slope rms: over all such places
"""
_REFERENCE = "reference: Phong, float64"
# A face takes the reference as long as many pixels, counted as 60. Beyond this it takes a while.
_SLOW = 20_000  # faces and pixels / 60 together
_OPTIONS = ("cull", "color_range", "exposure", "spectral", "threads")
_PAPER = "white"
_QUANTILE = 0.99  # of the covered pixels have errors on the maps' scale
_SECONDS, _MAX_ROUNDS = 1.0, 15  # in which methods are timed
# Black, violet, red, orange, white: rising in lightness, so that it reads in print and without colour vision too.
_HEAT = ((0, 0, 0), (58, 20, 110), (190, 35, 75), (250, 150, 30), (255, 255, 235))


class Drawn(NamedTuple):
    """A picture by one method, of one sample a pixel."""

    rgba: Any  # (height, width, 4) uint8
    color: Any  # (height, width, 3) linear
    face: Any  # (height, width) integers, -1 where nothing is


class Figures(NamedTuple):
    """What is said of a method; None for the time of the reference, for the errors of what it is compared with, and for
    jumps where no edge was measured."""

    ms: float | None
    max: float | None
    rms: float | None
    over_one: int | None
    value_jump: float | None
    slope_jump: float | None
    slope_rms: float | None


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster compare MODEL... [-o OUT] [options]"
    parser.description = _DESCRIPTION
    add_models(parser)
    add_output(parser, "{stem}-compare", SIZE)
    add = parser.add_argument_group("comparison", _TABLE).add_argument
    add("--methods", type=values.list_of(values.shading_method), default=("flat", "gouraud", "phong"), metavar="LIST",
        help="what is compared, with commas between; gouraud+N cuts triangles in four N times before "
        "(default flat,gouraud,phong)")  # fmt: skip
    add("--no-reference", dest="has_reference", action="store_false",
        help="compare with Phong's shading as rendered, which is quicker")  # fmt: skip
    add_camera(parser)
    add_appearance(parser, is_compared=True)


def run(request, messages, *, methods, has_reference) -> tuple[list, int]:
    """Compare the methods on every model; parameters, result and errors are those of `drawing.draw_models`."""
    from .drawing import draw_models
    from .outputs import check_picture

    request = replace(request, of_file=request.of_file - {"size"})  # a scene file's is that of one picture
    compare = partial(_compare_model, methods=methods, has_reference=has_reference)
    return draw_models(request, messages, compare, check_picture)


def _compare_model(targets, request, messages, output, methods, has_reference) -> None:
    """Compare the methods in all views of one model."""
    from .drawing import picture_warnings
    from .models import load_scene
    from .outputs import encode_sheet

    start = perf_counter()
    model = targets[0].model
    loaded = load_scene(model, request, messages, output.files_read)
    options = loaded.request.options
    for target in targets:
        scene = replace(loaded.scene, camera=loaded.request.camera_of(target.view, loaded.scene))
        drawn, times, frame = _draw_methods(scene, methods, options)
        warnings = picture_warnings(frame, loaded.scene, request, scene.camera, model)
        messages.warn(*warnings)
        against = "phong" if "phong" in drawn else next(reversed(drawn))
        if has_reference:
            against = "reference"
            if scene.n_face + options.size[0] * options.size[1] / 60 > _SLOW:
                wait = "drawing the reference, which takes a while; --no-reference leaves it out"
                messages.notice(f"{model}: {wait}")
            drawn[against] = _draw_reference(scene, options)
        figures = {
            method: _measure(picture, drawn[against], _scene_of(method, scene), times.get(method))
            for method, picture in drawn.items()
        }
        figures[against] = figures[against]._replace(max=None, rms=None, over_one=None)
        image, scale = _lay_out(drawn, against, figures, scene.background)
        output.write({target.output: encode_sheet(image, target.output)})
        seconds, start = perf_counter() - start, perf_counter()
        messages.detail(f"{model}: {target.output}, {counted(scene.n_face, 'face')}, {seconds:.2f} s in all")
        if request.is_json:
            record = {
                "status": "drawn",
                "model": model,
                "view": target.view,
                "output": target.output,
                "size": list(options.size),
                "faces": scene.n_face,
                "seconds": round(seconds, 4),
                "warnings": loaded.warnings + warnings,
                "against": against,
                "scale": scale,
                "methods": {method: of_method._asdict() for method, of_method in figures.items()},
            }
            messages.record(record, target.output == STDIO)
        elif request.level > QUIET:
            print_text(_table(target, figures), target.output == STDIO)


def _draw_methods(scene, methods, chosen) -> tuple[dict, dict, Any]:
    """Draw a scene by every method; return the pictures, the milliseconds of a warm frame of each, with the default
    tolerance, and the last one's frame."""
    from contextlib import ExitStack

    import numpy as np

    from ..analysis.timing import take_turns
    from ..renderer import Renderer

    options, drawn, calls = _options_of(chosen), {}, {}
    with ExitStack() as stack:
        for method in methods:
            finer = _scene_of(method, scene)
            settings = options | {"shading": method.partition("+")[0]}
            frame = _draw_exactly(finer, settings)
            drawn[method] = Drawn(frame.rgba, frame.color, frame.face)
            calls[method] = stack.enter_context(Renderer(finer, **settings, outputs=("rgb",))).render
            calls[method]()  # compiles and allocates
        taken = take_turns(calls, _SECONDS, _MAX_ROUNDS)
    return drawn, {method: float(np.median(times)) for method, (times, _) in taken.items()}, frame


def _options_of(chosen) -> dict:
    """The options of every picture."""
    return {name: getattr(chosen, name) for name in ("size", *_OPTIONS)} | {"samples": 1}


def _draw_exactly(scene, options):
    """Return the Frame of a scene with tolerance 0."""
    from ..renderer import Renderer

    with Renderer(scene, **options, tolerance=0.0, outputs=("color", "face")) as renderer:
        return renderer.render()


def _scene_of(method, scene):
    """What a method draws: the scene, or a finer one for gouraud+2."""
    from ..analysis.speed_error import subdivided

    return subdivided(scene, int(method.partition("+")[2] or 0))


def _name_of(method) -> str:
    """A method as a title."""
    from ..analysis.speed_error import Method

    shading, _, times = method.partition("+")
    return _REFERENCE if method == "reference" else Method(shading, int(times or 0), 1, 0.0).name


def _draw_reference(scene, chosen) -> Drawn:
    import numpy as np

    from .. import reference

    options = {name: getattr(chosen, name) for name in _OPTIONS if name != "threads"}
    picture = reference.render(scene, chosen.size, shading="phong", **options)
    alpha = np.rint(255.0 * picture.alpha).astype(np.uint8)
    return Drawn(np.dstack([picture.rgb, alpha]), picture.color, picture.face)


def _measure(picture, expected, scene, ms) -> Figures:
    """Measure a picture's errors against the one that is expected, and its Mach bands; `ms` goes along."""
    from ..analysis.comparison import compare
    from ..analysis.mach import mach_bands

    error, bands = compare(picture.color, expected.color), mach_bands(picture, scene)
    over_one = compare(picture.rgba[..., :3], expected.rgba[..., :3]).over_one
    jumps = (bands.value_jump, bands.slope_jump, bands.slope_rms) if bands.n_place else (None, None, None)
    return Figures(ms, error.max, error.rms, over_one, *jumps)


# --- the sheet ----------------------------------------------------------------------------------------------


def _lay_out(drawn, against, figures, background):
    """Lay pictures and error maps on a sheet; return it, and the error from which on the maps are white."""
    import numpy as np

    from ..analysis.contact_sheet import GAP, sheet

    shape = drawn[against].face.shape
    errors = {m: np.abs(drawn[m].color.astype(float) - drawn[against].color).max(axis=2) for m in drawn if m != against}
    is_covered = drawn[against].face >= 0
    # The largest error is often that of a few pixels at an outline; the rest would be black on its scale.
    quantiles = [np.quantile(error[is_covered], _QUANTILE) for error in errors.values() if is_covered.any()]
    scale = _rounded_up(max(quantiles, default=0.0))
    pictures, labels = [picture.rgba for picture in drawn.values()], []
    for method, of_method in figures.items():
        jump = "" if of_method.slope_rms is None else f", slope jumps {of_method.slope_rms:.2g}"
        labels.append(f"{_name_of(method)}{jump}")
    for method, error in errors.items():
        pictures.append(_heat(error / scale, is_covered))
        labels.append(f"error: rms {figures[method].rms:.2g}, max {figures[method].max:.2g}")
    ramp = np.linspace(0.0, 1.0, shape[1])[None].repeat(max(shape[0] // 12, 1), axis=0)
    pictures.append(_heat(ramp, np.ones(ramp.shape, bool)))
    labels.append(f"0 to {scale:g} of linear intensity")
    paper = _PAPER if background is None else background
    return sheet(pictures, columns=len(drawn), gap=GAP, background=paper, labels=labels), scale


def _rounded_up(value) -> float:
    """The next of 1, 2, 5, 10, ... times a power of ten; 1e-6, below which float32 pictures tell nothing, at least."""
    value = max(value, 1e-6)
    power = math.floor(math.log10(value))
    steps = (float(f"{digit}e{power}") for digit in (1, 2, 5, 10))
    return next(step for step in steps if step >= value)


def _heat(share, is_covered):
    """False colours (h, w, 4) uint8 of values from 0 to 1; transparent where nothing is covered."""
    import numpy as np

    stops = np.linspace(0.0, 1.0, len(_HEAT))
    rgb = np.stack([np.interp(share, stops, column) for column in zip(*_HEAT, strict=True)], axis=2)
    return np.dstack([np.rint(rgb), np.where(is_covered, 255, 0)]).astype(np.uint8)


# --- the figures --------------------------------------------------------------------------------------------


def _table(target, figures) -> str:
    """The figures of a picture, a line a method."""
    rows = [("", "ms", "max", "rms", "levels over 1", "value jump", "slope jump", "slope rms")]
    for method, of_method in figures.items():
        cells = (
            "-" if value is None else f"{value}" if isinstance(value, int) else f"{value:.3g}" for value in of_method
        )
        rows.append((method, *cells))
    view = f" {target.view}" if target.view else ""
    return "\n".join([f"{target.model}{view}: {target.output}", *aligned(rows)]) + "\n"
