"""What a batch draws, and what it says of each picture."""

import os
import pickle
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from ..choices import SAVED_ARRAYS, SavedArray
from ..errors import SceneError, counted, shown
from ..frame import Stats
from ..io.formats import picture_format
from ..keywords import divided
from ..look import Look
from ..options import Options
from ..scene.camera import Camera
from ..viewpoint import Viewpoint

Existing = Literal["replace", "skip", "skip-newer"]
EXISTING: tuple[str, ...] = get_args(Existing)
_OF_LOADING = ("format", "crease_angle", "weighting", "drop_bad_faces", "allow_outside", "up")  # what `load` takes


@dataclass(frozen=True)
class RenderTask:
    """Say what one picture of a batch shows, and where it goes.

    Parameters
    ----------
    source : whatever `load` takes: a path, bytes, a Mesh, a Scene, a trimesh object …
    output : path of the file; the suffix chooses the format, folders are made
    view : one of the named views, such as "front", or a pair (azimuth, elevation) in degrees; None = the camera below,
        or the scene's own
    camera : Camera; None = by the view
    options : Options, or a dict of words of `render`, but `view` and `camera`, which stand above, and those that say
        how a file is read, which stand in `load`. Where a dict names no outputs, they are what the file holds: of a
        picture "rgb", of a .npy file its array. `threads` is 1 unless it is given
    load : dict of other arguments of `load`: format, crease_angle, up, lights, background, allow_outside …
    array : which array a .npy file holds, as in `Frame.save`; None = the first of the outputs, or "color"

    Nothing is checked before the task is done, so that one that is not legal doesn't stop the others.
    """

    source: Any
    output: str | os.PathLike[str]
    view: str | tuple[float, float] | None = None
    camera: Camera | None = None
    options: Options | Mapping[str, Any] = field(default_factory=dict)
    load: Mapping[str, Any] = field(default_factory=dict)
    array: SavedArray | None = None

    @property
    def name(self) -> str:
        """What messages call it: its model's path, or else its output."""
        return str(self.source if isinstance(self.source, (str, os.PathLike)) else self.output)

    def check(self) -> Options:
        """Return the options of the picture, complete.

        Raises
        ------
        SceneError : a value that is not legal
        OutputError : a format that can't be written
        """
        if not isinstance(self.output, (str, os.PathLike)) or not os.fspath(self.output):
            raise SceneError(f"output must be the path of a file; given {shown(self.output)}")
        if not isinstance(self.load, Mapping) or not all(isinstance(name, str) for name in self.load):
            raise SceneError(f"load must be a dict of arguments of rz.load; given {shown(self.load)}")
        if self.camera is not None and not isinstance(self.camera, Camera):
            raise SceneError(f"camera must be a Camera or None; given {shown(self.camera)}")
        if self.array is not None and self.array not in SAVED_ARRAYS:
            raise SceneError(f"array must be one of {', '.join(SAVED_ARRAYS)}; given {shown(self.array)}")
        if self.array is not None and not self.is_array:
            raise SceneError(f"arrays are written as .npy; given {shown(self.output)} for the array {self.array!r}")
        if not self.is_array:
            picture_format(os.path.splitext(os.fspath(self.output))[1])
        options = self.options
        if isinstance(options, Options):
            values = dict(vars(options))
        elif isinstance(options, Mapping) and all(isinstance(name, str) for name in options):
            values = self._default_outputs() | divided(divided(options, Viewpoint)[1], Look)[1]
            if elsewhere := sorted({"view", "camera", *_OF_LOADING} & {*options}):
                raise SceneError(f"a task has {elsewhere[0]} as a field, or in `load`; given in its options")
        else:
            raise SceneError(f"options must be Options or a dict of some; given {shown(options)}")
        if values.get("threads") is None:
            values["threads"] = 1
        Viewpoint(**self.side)
        pickle.dumps((self.side, self.look))  # other processes get them
        return Options(**values)

    @property
    def look(self) -> dict[str, Any]:
        """The words of its options that change how its model looks."""
        return {} if isinstance(self.options, Options) else divided(self.options, Look)[0]

    @property
    def side(self) -> dict[str, Any]:
        """The words that say where its picture is taken from."""
        words = {} if isinstance(self.options, Options) else divided(self.options, Viewpoint)[0]
        return words | {"view": self.view, "camera": self.camera}

    @property
    def is_array(self) -> bool:
        """Whether its file holds an array."""
        return os.fspath(self.output).lower().endswith(".npy")

    def _default_outputs(self) -> dict[str, Any]:
        """The outputs where a dict of options doesn't name them: those of a picture, or of an array."""
        name = (self.array or "color") if self.is_array else "rgb"
        return {"outputs": {"rgba": "rgb", "alpha": "color"}.get(name, name)}


@dataclass(frozen=True)
class RenderRecord:
    """Say what became of a task.

    Attributes
    ----------
    index : which one it was, counted from 0
    path : of its output, text
    status : "drawn", "skipped" (its file was there) or "failed"
    seconds : that it took where it was drawn, its model's loading included if it was the first of that model
    error : Exception, where it failed; nothing was written then
    stats : Stats of the picture, where it was drawn
    source : path of its model, text; None where it was no file
    warnings : what its model was warned of, texts
    """

    index: int
    path: str
    status: Literal["drawn", "skipped", "failed"]
    seconds: float = 0.0
    error: Exception | None = None
    stats: Stats | None = None
    source: str | None = None
    warnings: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return it as a dict that can be written as JSON."""
        found = {"index": self.index, "path": self.path, "source": self.source, "status": self.status}
        found |= {"seconds": round(self.seconds, 4), "error": None if self.error is None else str(self.error)}
        coverage = None if self.stats is None else self.stats.coverage
        return found | {"coverage": coverage, "warnings": list(self.warnings)}


@dataclass
class RenderSummary:
    """Count what became of the tasks of a batch.

    Attributes
    ----------
    drawn, skipped, failed : how many
    seconds : since the batch began
    """

    drawn: int = 0
    skipped: int = 0
    failed: int = 0
    seconds: float = 0.0

    def __str__(self) -> str:
        parts = [f"{counted(self.drawn, 'picture')} drawn"]
        parts += [f"{self.skipped} skipped"] if self.skipped else []
        parts += [f"{self.failed} failed"] if self.failed else []
        rate = f" ({self.drawn / self.seconds:.3g} a second)" if self.drawn and self.seconds > 0 else ""
        return f"{', '.join(parts)} in {self.seconds:.3g} s{rate}"

    @property
    def exit_code(self) -> int:
        """What a program may end with: 0 where nothing failed, 1 where something did."""
        return int(self.failed > 0)
