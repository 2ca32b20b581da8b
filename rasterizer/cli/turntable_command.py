"""`raster turntable`: each model turns round once, in a moving picture.

load ─ cameras on a circle ─ one Renderer ─ frames ─┬─ a moving picture (io/animation.py)
                                                               └─ a picture each, with {frame} in the name
"""

from dataclasses import fields, replace
from functools import cached_property
from pathlib import Path
from time import perf_counter

from ..choices import AXES
from ..errors import SceneError, counted
from ..io import formats
from ..io.animation import Timing, animation_format, encode_animation
from ..options import Options
from ..renderer import Renderer
from ..scene.camera import Camera, middle_on_axis, pivot_of, turned_cameras
from .cameras_lights import camera_of, framing_settings, zoomed
from .defaults import TURNTABLE_FRAMES, TURNTABLE_SECONDS
from .load_scene import load_scene, with_options
from .messages import Bar, print_record
from .render_command import draw_models, encode_picture, make_options
from .targets import STDIO, check_picture, writes_frames
from .warnings import find_doubts

_IN_MEMORY = 2**30  # bytes of frames; where they are more, they are drawn again each time that they are looked at
_MOST_FRAMES = 100_000


def turn_models(arguments, messages) -> tuple[list, int]:
    """Turn every model; parameters, result and errors are those of `render_models`."""
    _fill_in_timing(arguments)
    make_options(arguments)  # what is not legal is told before a model is loaded

    def check_animation(output, _) -> None:
        _check_animation(output, arguments)

    check = check_picture if writes_frames(arguments) else check_animation
    return draw_models(arguments, messages, _turn_model, check)


def _fill_in_timing(arguments) -> None:
    """Work out the frames and the seconds of a round, of which --fps stands for one."""
    frames, seconds, fps = arguments.frames, arguments.seconds, arguments.fps
    for name, value in (("seconds", seconds), ("fps", fps)):
        if value is not None and not 1e-3 <= value <= 1e6:
            raise SceneError(f"--{name} must be within 0.001..1000000; given {value:g}")
    if None not in (frames, seconds, fps):
        raise SceneError("--frames, --seconds and --fps: two of them say the third; given all")
    if frames is None:
        frames = TURNTABLE_FRAMES if fps is None else round(fps * (seconds or TURNTABLE_SECONDS))
    if not 1 <= frames <= _MOST_FRAMES:
        raise SceneError(f"--frames must be within 1..{_MOST_FRAMES}; given {frames}")
    if seconds is None:
        seconds = TURNTABLE_SECONDS if fps is None else frames / fps
    if not 0 <= arguments.loop <= 65535:
        raise SceneError(f"--loop must be within 0..65535, 0 = again and again; given {arguments.loop}")
    arguments.frames, arguments.seconds = frames, seconds


def _check_animation(output, arguments) -> None:
    """Refuse what is no moving picture, or can't be so fast, before anything is drawn."""
    try:
        format = animation_format(_suffix_of(output))
    except SceneError as error:
        raise SceneError(f"{output}: {error}; or a picture a frame, with {{frame}} in the name") from None
    format.check_timing(arguments.frames, arguments.seconds)


def _suffix_of(output) -> str:
    """The suffix that chooses the format; GIF for stdout."""
    return ".gif" if output == STDIO else Path(output).suffix


def _cameras(arguments, model, loaded, subject) -> list:
    """The cameras of a round; a full one ends a step before it would begin again."""
    n, scene, framing = arguments.frames, loaded.scene, loaded.framing
    angles = [arguments.turn * k / n for k in range(n)]
    if isinstance(arguments.camera, tuple):
        is_standing, framing = arguments.camera[0] is not None, arguments.camera[1]
    else:
        is_standing = arguments.eye is not None or (arguments.camera == "file" and framing is None)
        framing = None if arguments.camera == "frame" else framing
    if is_standing:
        camera = camera_of(arguments, None, scene, framing, subject)
        return turned_cameras(camera, angles, AXES[scene.up], _pivot(arguments, model, camera, scene))
    settings = framing_settings(arguments, None, scene.up, framing)
    start = settings.pop("azimuth")
    cameras = Camera.orbit(subject, [start + angle for angle in angles], **settings)
    return [zoomed(camera, arguments.zoom) for camera in cameras]


def _pivot(arguments, model, camera, scene):
    """The point (3,) that a camera goes round: what it looks at. A model's own camera has a target in scene files
    alone; other formats know a direction."""
    entry = formats.find(arguments.input_format or Path(model).suffix)
    if arguments.camera == "file" and not (entry is not None and entry.is_scene):
        return middle_on_axis(camera, scene.bounds)
    return pivot_of(camera, scene.bounds)


class _Frames:
    """The frames of a round, drawn when they are asked for, and kept where they are few.

    Parameters
    ----------
    renderer : Renderer
    cameras : sequence of Camera
    show : called with how many frames are drawn, and how many there are
    """

    def __init__(self, renderer, cameras, show):
        self._renderer, self._cameras, self._show = renderer, cameras, show
        width, height = renderer.options.size
        self._is_kept, self._kept = 4 * width * height * len(cameras) <= _IN_MEMORY, []

    def __len__(self):
        return len(self._cameras)

    def __contains__(self, frame):
        return any(frame is each for each in self._kept)

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
            if number < len(self._kept):
                yield self._kept[number]
                continue
            picture = self.draw(number).rgba
            if self._is_kept and number == len(self._kept):
                self._kept.append(picture)
            yield picture


def _turn_model(targets, arguments, settings, messages, output) -> None:
    """Turn one model."""
    start = perf_counter()
    loaded = load_scene(targets[0].model, arguments, settings, messages, output.files_read)
    scene = loaded.scene
    names = {field.name for field in fields(Options)} - {"outputs"}
    arguments = with_options(arguments, loaded.options, names, targets[0].model)
    suffix = _suffix_of(targets[0].output)
    is_apart = len(targets) > 1 or writes_frames(arguments)
    if scene.background is None and not (is_apart or animation_format(suffix).has_alpha):
        scene = replace(scene, background="white")
    options = make_options(arguments)
    # A pixel of a GIF file is transparent or not: a soft shadow would be a black spot, or a pattern of dots.
    is_hard = suffix == ".gif" and not is_apart and scene.background is None
    if is_hard and options.ground:
        options = replace(options, ground=False)
        messages.notice_once("a transparent GIF has no shadow on the ground; with --background, or as .webp, it has")
    keywords = {field.name: getattr(options, field.name) for field in fields(options)}
    with Renderer(scene, **keywords) as renderer, Bar(messages) as bar:
        cameras = _cameras(arguments, targets[0].model, loaded, renderer.subject)
        frames = _Frames(renderer, cameras, lambda k, n: bar.show(k, n, f"drawing {targets[0].model}"))
        doubts = _doubts(frames.first, scene, arguments, cameras[0], targets[0].model)
        for text in doubts:
            messages.warn(text)
        if writes_frames(arguments):
            for number, target in enumerate(targets):
                content = encode_picture(frames.draw(number), target.output)
                output.write(content, target.output)
                bar.end()
                output.results.tell(target.output, options.size, len(content), perf_counter() - start)
        else:
            content = encode_animation(frames, suffix, Timing(arguments.seconds, arguments.loop))
            output.write(content, targets[0].output)
            bar.end()
            output.results.tell(targets[0].output, options.size, len(content), perf_counter() - start)
    seconds = perf_counter() - start
    n_frame = counted(len(cameras), "frame")
    messages.detail(f"{targets[0].model}: {targets[-1].output}, {n_frame}, {seconds:.2f} s in all")
    if arguments.json:
        record = {
            "path": targets[0].model,
            "output": targets[0].output,
            "size": list(options.size),
            "frames": len(cameras),
            "duration": arguments.seconds,
            "faces": scene.n_face,
            "coverage": frames.first.stats.coverage,
            "seconds": round(seconds, 4),
            "warnings": loaded.warnings + doubts,
        }
        print_record(record, targets[0].output == STDIO)


def _doubts(frame, scene, arguments, camera, model) -> list[str]:
    """What looks like a mistake in the first frame."""
    is_black = not frame.rgb.any()
    return [f"{model}: {text}" for text in find_doubts(frame.stats, is_black, scene, arguments, camera)]
