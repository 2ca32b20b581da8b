"""`raster turntable`: each model turns round once, in a moving picture.

load ─ cameras on a circle ─ one Renderer ─ frames ─┬─ a moving picture (io/animation.py)
                                                    └─ a picture each, with {frame} in the name
"""

import math
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter

from ..errors import SceneError, counted
from ..locks import cached_property
from . import values
from .flags import add_appearance, add_camera, add_models, add_output
from .messages import STDIO, Bar

IMPORTS = ("drawing",)
_SIZE, _FRAMES, _SECONDS = (512, 512), 36, 3.0
_MAX_FRAMES = 100_000
_DESCRIPTION = """\
Turn each model round once, in a moving picture. The camera keeps one distance, the smallest that shows the model in
every frame. With --eye or --camera the first frame is that camera's; from there it goes round the up axis through what
it looks at.
"""
_EXAMPLES = """\
examples:
  raster turntable part.stl                 part-turntable.gif, 3 seconds
  raster turntable part.obj -o part.webp --frames 72 --seconds 6
  raster turntable part.obj -o part.mp4 -s 1920x1080 --fps 30 --background white
  raster turntable 'parts/*.glb' -o 'turns/{stem}.gif' --turn -360
  raster turntable room.obj -o room.webp --eye 4,2,6 --target 0,1,0 --fov 50
  raster turntable part.obj -o 'frames/{stem}-{frame:03}.png' --frames 120

A GIF file has one palette of 255 colours for all frames, and no half-covered pixels, so that it has no shadow on the
ground without --background; WebP and APNG have all colours and an alpha channel. MP4, MOV and MKV need the extra
`video`, and have no alpha: without --background they are white.
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster turntable MODEL... [-o OUT] [options]"
    parser.description, parser.epilog = _DESCRIPTION, _EXAMPLES
    add_models(parser)
    add_output(parser, "{stem}-turntable", _SIZE, suffix=".gif", fields="{stem} {ext}, or {frame} for a file each")
    add = parser.add_argument_group("turn").add_argument
    add("--frames", type=values.whole, metavar="N",
        help=f"pictures of one round (default {_FRAMES}, or as many as --fps and --seconds make)")  # fmt: skip
    add("--seconds", type=values.number, metavar="S", help=f"length of a round (default {_SECONDS:g})")
    add("--fps", type=values.number, metavar="N", help="frames a second, in place of --frames or --seconds")
    add("--turn", type=values.number, default=360.0, metavar="A",
        help="degrees of the round; with a minus sign it goes the other way (default 360)")  # fmt: skip
    add("--loop", type=values.whole, default=0, metavar="N", help="how often it is played (default 0: again and again)")
    add_camera(parser, False, "at the first frame", "frame = show all of the model in every frame (default)")
    add_appearance(parser)


def run(request, messages, *, frames, seconds, fps, turn, loop) -> tuple[list, int]:
    """Turn every model; parameters, result and errors are those of `drawing.draw_models`."""
    from ..io.animation import Timing
    from .drawing import draw_models
    from .outputs import check_picture, writes_frames

    frames, seconds = _work_out(frames, seconds, fps)
    if not 0 <= loop <= 65535:
        raise SceneError(f"--loop must be within 0..65535, 0 = again and again; given {loop}")
    angles = [turn * k / frames for k in range(frames)]
    check = partial(_check_animation, frames=frames, seconds=seconds, fps=fps)
    check = check_picture if writes_frames(request) else check
    draw = partial(_turn_model, angles=angles, timing=Timing(seconds, loop))
    return draw_models(request, messages, draw, check, frames)


def _work_out(frames, seconds, fps) -> tuple[int, float]:
    """Return the frames and the seconds of a round, of which --fps stands for one."""
    for name, value in (("seconds", seconds), ("fps", fps)):
        if value is not None and not 1e-3 <= value <= 1e6:
            raise SceneError(f"--{name} must be within 0.001..1000000; given {value:g}")
    if None not in (frames, seconds, fps):
        raise SceneError("--frames, --seconds and --fps: two of them say the third; given all")
    if frames is None:
        frames = _FRAMES if fps is None else round(fps * (seconds or _SECONDS))
    if not 1 <= frames <= _MAX_FRAMES:
        raise SceneError(f"--frames must be within 1..{_MAX_FRAMES}; given {frames}")
    if seconds is None:
        seconds = _SECONDS if fps is None else frames / fps
    return frames, seconds


def _check_animation(output, _arrays, frames, seconds, fps) -> None:
    """Refuse what is no moving picture, or can't be so fast, before anything is drawn."""
    from ..io.animation import animation_format

    try:
        format = animation_format(_suffix_of(output))
    except SceneError as error:
        raise SceneError(f"{output}: {error}; or a picture a frame, with {{frame}} in the name") from None
    try:
        format.check_timing(frames, seconds)
    except SceneError as error:
        slower = f"--seconds {math.ceil(frames / format.max_fps)}" if fps is None else f"--fps {format.max_fps:g}"
        raise SceneError(f"{error}: try {slower}, or -o {Path(output).stem}.webp") from None


def _suffix_of(output) -> str:
    """The suffix that chooses the format; GIF for stdout."""
    return ".gif" if output == STDIO else Path(output).suffix.lower()


class _Frames:
    """The frames of a round, drawn when they are asked for.

    Parameters
    ----------
    renderer : Renderer
    cameras : sequence of Camera
    show : called with how many frames are drawn, and how many there are
    """

    def __init__(self, renderer, cameras, show):
        self._renderer, self._cameras, self._show = renderer, cameras, show

    def __len__(self):
        return len(self._cameras)

    @cached_property
    def first(self):
        """The Frame of the first camera."""
        return self._renderer.render(self._cameras[0])

    def draw(self, number):
        """Return the Frame of a camera."""
        self._show(number, len(self))
        return self.first if number == 0 else self._renderer.render(self._cameras[number])

    def __iter__(self):
        """Yield the pictures, (height, width, 4) uint8."""
        for number in range(len(self)):
            yield self.draw(number).rgba


def _turn_model(targets, request, messages, output, angles, timing) -> None:
    """Turn one model."""
    from ..io.animation import animation_format, encode_animation
    from ..renderer import Renderer
    from .drawing import picture_warnings
    from .models import load_scene
    from .outputs import encode_picture, writes_frames

    start, model = perf_counter(), targets[0].model
    loaded = load_scene(model, request, messages, output.files_read)
    scene, options, is_apart = loaded.scene, loaded.request.options, writes_frames(request)
    suffix = _suffix_of(targets[0].output)
    if scene.background is None and not (is_apart or animation_format(suffix).has_alpha):
        scene = replace(scene, background="white")
    # A pixel of a GIF file is transparent or not: a soft shadow would be a black spot, or a pattern of dots.
    is_hard = suffix == ".gif" and not is_apart and scene.background is None
    if is_hard and options.ground:
        options = replace(options, ground=False)
        messages.notice(
            f"{model}: a transparent GIF has no shadow on the ground; with --background, or as .webp, it has"
        )
    with Renderer(scene, options=options) as renderer, closing(Bar(messages)) as bar:
        viewpoint = loaded.request.at(None)
        cameras = viewpoint.cameras_round(angles, loaded.scene, options.size, lambda: renderer.subject)
        frames = _Frames(renderer, cameras, lambda k, n: bar.show(k, n, f"drawing {model}"))
        warnings = picture_warnings(frames.first, scene, request, cameras[0], model)
        messages.warn(*warnings)
        for target in targets:
            if is_apart:
                content = encode_picture(frames.draw(target.frame), target.output)
            else:
                content = encode_animation(frames, suffix, timing)
            output.write({target.output: content})
            bar.close()
            output.results.tell(target.output, options.size, len(content), perf_counter() - start)
    seconds = perf_counter() - start
    messages.detail(f"{model}: {targets[-1].output}, {counted(len(cameras), 'frame')}, {seconds:.2f} s in all")
    if request.is_json:
        record = {
            "status": "drawn",
            "model": model,
            "output": targets[0].output,
            "size": list(options.size),
            "frames": len(cameras),
            "duration": timing.seconds,
            "faces": scene.n_face,
            "coverage": frames.first.stats.coverage,
            "seconds": round(seconds, 4),
            "warnings": loaded.warnings + warnings,
        }
        messages.record(record, targets[0].output == STDIO)
