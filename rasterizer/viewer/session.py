"""One look at a scene: messages of a page come in, pictures go out.

    read_message ─ apply (each event) ─ render ─ encode
                          └─ pick       full at rest, smaller while something moves

While something moves, a picture has one sample a pixel and is a JPEG file. At rest it has all samples and is a PNG
file: the picture that `rasterizer.render` draws through the same camera, byte for byte.
"""

import math
import threading
from collections import OrderedDict
from dataclasses import replace
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..frame import Frame
from ..locks import renew_in_child
from ..options import Options
from ..picking import Pick
from ..renderer import Renderer
from ..scene.camera import Camera
from ..scene.color import linear_rgb
from ..scene.lights import PRESETS, studio
from ..scene.scene import Scene
from ..viewpoint import Viewpoint
from .controls import LIGHTS, Aim, State, apply, describe_pick, projection_of, read_message
from .orbit import Orbit, camera_flags

PAPER = "#ffffff"  # behind the scene until a page says what its own is
_QUALITY = 85  # of JPEG files
_MAX_RENDERERS = 3  # kept: for pictures at rest, for those that move, and the one used before

DIVISORS = (1, 2, 4, 8)  # of the sides of the picture
BUDGET = 30.0  # milliseconds for a picture: 33 a second
_MARGIN = 1.25  # a picture may take that much longer before a smaller one is tried: times vary
_KEPT = 0.7  # share of what was known in a mean of times, so that one slow picture counts little


class Reply(NamedTuple):
    """What a message is answered with: what the page shows beside the picture, as JSON may be, and the picture."""

    status: dict[str, Any]
    content: bytes
    media_type: str


class Session:
    """Look at one scene. Threads that share a session take turns.

    Parameters
    ----------
    scene : Scene
    camera : Camera that is looked through at first; None = the scene's own, or one that shows all of it
    title : text, what the scene is called
    shading : "flat" ("lambert"), "gouraud" or "phong", at first
    samples : samples a pixel at rest: 1, 4, 9 or 16
    options : other options of `render`, but for `size` and `outputs`, which are the viewer's own

    Raises
    ------
    SceneError : an option that is not legal
    """

    def __init__(
        self,
        scene: Scene,
        *,
        camera: Camera | None = None,
        title: str = "",
        shading: str = Options.shading,
        samples: int = Options.samples,
        **options: Any,
    ) -> None:
        shading = "flat" if shading == "lambert" else shading
        Options(shading=shading, samples=samples, **options)  # type: ignore[arg-type]  # what is not legal is refused at once
        self.scene, self.title = scene, title or "scene"
        self._camera, self._samples, self._options = camera, samples, options
        self._state = State(None, shading, LIGHTS[0])
        self._size, self._background = Options.size, PAPER
        self._subject: Scene | NDArray[np.float64] | None = None  # with its shadow, on a ground
        self._framed: tuple[tuple[int, int], Camera] | None = None  # the camera at first, for pictures of a size
        self._resolution = Resolution()
        self._renderers: OrderedDict[tuple, Renderer] = OrderedDict()
        self._n_made = 0  # renderers
        self._at_rest: tuple[tuple, Frame, bytes, float] | None = None  # what it shows, picture, file, seconds
        self.renew()
        renew_in_child(self)

    def renew(self) -> None:
        """Let the next one have its turn, in a forked process: whoever had it isn't there."""
        self._turn = threading.Lock()

    @property
    def camera(self) -> Camera:
        """The camera as it stands now."""
        return self._home() if self._state.orbit is None else self._state.orbit.camera

    @property
    def shading(self) -> str:
        """The shading that is chosen now."""
        return self._state.shading

    @property
    def scene_now(self) -> Scene:
        """The scene in the light that is chosen now."""
        lights = self._state.lights
        return replace(self.scene, lights=PRESETS[lights]()) if lights in PRESETS else self.scene

    @property
    def picked(self) -> Pick | None:
        """The point that was picked last; None if there is none."""
        return self._state.picked

    @property
    def frame(self) -> Frame | None:
        """The last picture at rest, with the buffers face, depth and normal; None before the first one."""
        return self._at_rest and self._at_rest[1]

    def look_through(self, camera: Camera) -> None:
        """Take a camera as that which is looked through at first."""
        self._camera, self._framed = camera, None

    def close(self) -> None:
        """End the threads that draw. The session goes on when it is asked for a picture once more."""
        with self._turn:
            while self._renderers:
                self._renderers.popitem()[1].close()

    def answer(self, content: object) -> Reply:
        """Do what a message says, and draw the picture.

        Parameters
        ----------
        content : the message, as JSON may be; see controls.py

        Returns
        -------
        Reply

        Raises
        ------
        SceneError : what is no message; a picture that can't be drawn
        """
        message = read_message(content)
        with self._turn:
            self._size, self._background = message.size, message.background
            is_at_rest, said = message.is_rest, []
            for event in message.events:
                self._state, aim = apply(event, self._state, self.scene, self._home(), self._size, self.subject)
                if aim is not None:
                    self._pick(aim)
                    is_at_rest = True
                said.append(self._state.said)
            reply = self._reply_at_rest() if is_at_rest else self._reply_moving()
            reply.status["said"] = ". ".join(filter(None, dict.fromkeys(said)))
            return reply

    def subject(self) -> Scene | NDArray[np.float64]:
        """Return what a picture is framed on: see `Renderer.subject`."""
        if not self._options.get("ground"):
            return self.scene
        if self._subject is None:
            with Renderer(self.scene, **self._options) as renderer:
                self._subject = renderer.subject
        return self._subject

    def _home(self) -> Camera:
        if self._framed is None or self._framed[0] != self._size:
            self._framed = self._size, self._camera or Viewpoint().camera_of(self.scene, self._size, self.subject)
        return self._framed[1]

    def _pick(self, aim: Aim) -> None:
        """Pick what is seen at a pixel, and turn about it from now on if that is asked for."""
        x, y, (width, height) = math.floor(aim.x), math.floor(aim.y), self._size
        is_inside = 0 <= x < width and 0 <= y < height
        picked = self._renderer_at_rest().pick(x, y, self.camera) if is_inside else None
        orbit = self._state.orbit
        if aim.is_pivot and picked is not None:
            orbit = (orbit or Orbit.of(self._home(), self.scene)).about(np.array(picked.position))
        said = "nothing is there" if picked is None else describe_pick(picked)
        self._state = self._state._replace(picked=picked, orbit=orbit, said=said)

    def _reply_at_rest(self) -> Reply:
        _, content, seconds = self._draw_at_rest()
        return Reply(self._status(1, True, seconds), content, "image/png")

    def _reply_moving(self) -> Reply:
        divisor, n_made = self._resolution.divisor, self._n_made
        settings = {"size": self._resolution.size_of(self._size), "samples": 1, "outputs": ("rgb",)}
        renderer = self._renderer(settings)
        start = perf_counter()
        content = renderer.render(self.camera).encode("JPEG", quality=_QUALITY)
        seconds = perf_counter() - start
        if n_made == self._n_made:  # a first picture also compiles and allocates
            self._resolution.note(1e3 * seconds)
        return Reply(self._status(divisor, False, seconds), content, "image/jpeg")

    def _draw_at_rest(self) -> tuple[Frame, bytes, float]:
        """Draw the picture as good as it gets, with buffers, and tell the seconds that it took; one that is drawn is
        returned."""
        shown_now = (self.camera, self._state.shading, self._state.lights, self._size, self._background)
        if self._at_rest is None or self._at_rest[0] != shown_now:
            renderer, start = self._renderer_at_rest(), perf_counter()
            frame = renderer.render(self.camera)
            content = frame.encode("PNG")
            self._at_rest = shown_now, frame, content, perf_counter() - start
        return self._at_rest[1:]

    def _renderer_at_rest(self) -> Renderer:
        outputs = ("rgb", "face", "depth", "normal")
        return self._renderer({"size": self._size, "samples": self._samples, "outputs": outputs})

    def _renderer(self, settings: dict[str, Any]) -> Renderer:
        """Return what draws such pictures, which is kept for the next one."""
        state = self._state
        key = (state.shading, state.lights, self._background, *settings.values())
        renderer = self._renderers.pop(key, None)
        if renderer is None:
            while len(self._renderers) >= _MAX_RENDERERS:
                self._renderers.popitem(last=False)[1].close()
            self._n_made += 1
            renderer = Renderer(self._scene(), shading=state.shading, **settings, **self._options)  # type: ignore[arg-type]
        self._renderers[key] = renderer
        return renderer

    def _scene(self) -> Scene:
        """Return the scene in the light that is chosen, on the page's background where it has none of its own."""
        scene = self.scene_now
        return replace(scene, background=linear_rgb(self._background)) if scene.background is None else scene

    def _flags(self) -> str:
        """The flags of `raster render` that draw what is seen; "" where none do."""
        flags, lights = camera_flags(self.camera, self.scene.up), self._state.lights
        if lights not in PRESETS and self.scene.lights == studio():
            lights = "studio"
        preset = f" --preset {lights}" if lights in PRESETS else ""
        return flags and f"{flags} --shading {self._state.shading}{preset}"

    def _status(self, divisor: int, is_full: bool, seconds: float) -> dict[str, Any]:
        """Return what the page shows beside the picture."""
        state = self._state
        orbit = state.orbit or Orbit.of(self._home(), self.scene)
        picked = state.picked
        return {
            "title": self.title,
            "n_face": self.scene.n_face,
            "size": list(self._size),
            "divisor": divisor,
            "is_full": is_full,
            "milliseconds": round(1e3 * seconds, 1),
            "switches": {
                "shading": state.shading,
                "lights": state.lights,
                "projection": projection_of(state, self._home()),
            },
            "picked": None if picked is None else describe_pick(picked),
            "marker": None if picked is None else orbit.position_of(np.array(picked.position), self._size),
            "camera": self._flags(),
        }


class Resolution:
    """Choose the size of pictures that are drawn while something moves.

    A picture of half the sides costs a quarter at the least, and as much at the most: transforming vertices doesn't get
    cheaper with fewer pixels. So a larger one is drawn only where four times the time of the smaller one is within the
    budget: then it can't be too slow, and sizes don't alternate.
    """

    def __init__(self) -> None:
        self._level = 0  # in DIVISORS
        self._mean: float | None = None  # milliseconds of pictures of this size

    @property
    def divisor(self) -> int:
        """What the sides of the whole picture are divided by."""
        return DIVISORS[self._level]

    def size_of(self, size: tuple[int, int]) -> tuple[int, int]:
        """Return the (width, height) to draw, in pixels, for a picture of `size`."""
        width, height = (-(-side // self.divisor) for side in size)
        return width, height

    def note(self, milliseconds: float) -> None:
        """Take down how long a picture of this size has taken, and choose the next one's."""
        mean = milliseconds if self._mean is None else _KEPT * self._mean + (1.0 - _KEPT) * milliseconds
        self._mean = mean
        if mean > _MARGIN * BUDGET and self._level + 1 < len(DIVISORS):
            self._level += 1
            self._mean = None
        elif 4.0 * mean <= BUDGET and self._level > 0:
            self._level -= 1
            self._mean = None
