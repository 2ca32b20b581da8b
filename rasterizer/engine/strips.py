"""Some rows of a picture, as the whole one has them: a strip.

    whole picture   +-------------+
                    |             |      All triangles take the way of the whole picture up to the bands: vertices are
         first row  +-------------+      rounded where they lie there, and planes have their values there. Then only
                    |    strip    |      the bands that hold rows of the strip are drawn, and of these only its rows.
          end row   +-------------+
                    |             |      What a sample shows doesn't depend on the band that it is drawn in. So the
                    +-------------+      bytes of a strip are those of the picture.

So several processes may draw a picture that is too large for one. Where colours depend on the brightest pixel
(`color_range="global"`), each strip tells the brightest of its own first.
"""

from functools import partial
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from ..pipeline.encode import with_blank
from ..pipeline.transform import Screen
from ..pipeline.workspace import make_picture
from ..scene.camera import Camera
from .depth_range import screen_of
from .draw import Counts, draw
from .output_buffers import BUFFER_TABLE
from .passes import RowSink
from .prepared_scene import Brightest, DrawnPicture, PreparedScene, scale_of


def draw_strip(prepared: PreparedScene, camera: Camera, clock, rows, brightest: float = 0.0) -> DrawnPicture:
    """Draw some rows of the picture: the colour of every pixel, and the exact buffers that are asked for.

    Parameters
    ----------
    clock : Clock, which notes the milliseconds of each stage
    rows : (first, end) of the pixels, `end` is the one behind the last
    brightest : largest component of the whole picture, for color_range "global"
    """
    options, (first, end) = prepared.options, rows
    with_color = "color" in options.outputs
    part = make_picture((options.size[0], end - first), with_color)

    def keep(y_start, drawn):
        for kept, new in zip(part, drawn, strict=True):
            if len(new):
                kept[y_start - first : y_start - first + len(new)] = new

    sink = RowSink(keep, with_color)
    encoding = {"scale": scale_of(brightest)} if options.color_range == "global" else {}
    counts, view_plan, buffers, screen = _draw(prepared, camera, clock, rows, sink, encoding)
    rgba = part.rgba.view(np.uint8).reshape(*part.rgba.shape, 4)
    return DrawnPicture(rgba, part.color, part.alpha, counts, view_plan, buffers, screen)


def compute_brightest(prepared: PreparedScene, camera: Camera, clock, rows) -> float:
    """Return the largest component of the linear colours of some rows (first, end) of the picture."""
    found = Brightest()
    _draw(prepared, camera, clock, rows, RowSink(found.note, True), {}, with_buffers=False)
    return found.largest


def _draw(prepared, camera, clock, rows, sink, encoding, with_buffers=True):
    """Draw the rows; return their Counts, the ViewPlan, the buffers by name, None where there are none, and
    the screen."""
    options, geometry, view = prepared.options, prepared.geometry, camera.view()
    factor, width = options.factor, options.size[0]
    screen = screen_of(camera, view, options.size, factor, geometry, prepared.bounds)
    view_plan = prepared.view_plans.plan_for(view, screen)
    render_pass = prepared.color_pass(view, screen, view_plan.plan, make_picture((0, 0), False), clock)
    render_pass.rows, render_pass.sink = (rows[0] * factor, rows[1] * factor), sink
    if encoding:
        render_pass.encoding = with_blank(render_pass.encoding._replace(**encoding))
    is_beside = with_buffers and bool(prepared.buffer_names) and factor == 1  # buffers have one sample a pixel
    parts = make_parts(prepared.buffer_names, width, rows)
    beside = None
    if is_beside:
        make = partial(_make_strip, parts, rows[0])
        beside = prepared.buffer_pass(camera, view, screen, make_buffers=make)
    counts = draw(geometry, render_pass, screen, prepared.workspaces, prepared.threads, clock, beside)
    return counts, view_plan, parts if is_beside else None, screen


def draw_buffer_strip(
    prepared: PreparedScene, camera: Camera, clock, rows
) -> tuple[dict[str, NDArray], Counts, Screen]:
    """Draw some rows (first, end) of the exact buffers, by name, without a picture: one sample a pixel; and count."""
    parts = make_parts(prepared.buffer_names, prepared.options.size[0], rows)
    make = partial(_make_strip, parts, rows[0])
    _, counts, screen = prepared.draw_buffers(camera, clock, rows=rows, make_buffers=make)
    return parts, counts, screen


def _make_strip(parts, first, names, size) -> dict[str, NDArray]:
    """Return the parts as buffers of a whole picture."""
    return as_whole(parts, first, size[1])


def make_parts(names, width, rows) -> dict[str, NDArray]:
    """Return room for some rows (first, end) of exact buffers, by name."""
    return {name: BUFFER_TABLE[name].make((width, rows[1] - rows[0])) for name in names}


def as_whole(parts: dict[str, NDArray], first: int, height: int) -> dict[str, NDArray]:
    """Return arrays of `height` rows, whose rows from `first` on are those of the parts.

    Kernels write a pixel where it stands in the whole picture. The other rows don't exist: nobody may touch them.
    """
    return {name: _shifted(part, first, height) for name, part in parts.items()}


def _shifted(part: NDArray, first: int, height: int) -> NDArray:
    """The part as an array that begins `first` rows before it."""
    interface = part.__array_interface__
    address = interface["data"][0] - first * part.strides[0]
    whole = interface | {"data": (address, False), "shape": (height, *part.shape[1:])}
    return np.asarray(SimpleNamespace(__array_interface__=whole, part=part))  # which it keeps alive
