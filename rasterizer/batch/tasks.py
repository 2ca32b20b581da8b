"""What a batch draws, and what it says of each picture."""

import os
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from inspect import signature
from typing import Any, Literal, get_args

from ..appearance import READING, TEXTURES, Appearance
from ..choices import ARRAY_SUFFIXES, RANDOM, SAVED_ARRAYS, VIEWS, SavedArray, Scale
from ..errors import SceneError, counted, cut, shown
from ..frame import Stats
from ..io.formats import picture_format
from ..io.loader import load
from ..keywords import checked_fields, divided, unknown_keyword
from ..options import Options
from ..scene.camera import Camera
from ..scene.validate import store, whole
from ..viewpoint import Viewpoint, is_path

Existing = Literal["replace", "skip", "changed"]
EXISTING: tuple[str, ...] = get_args(Existing)
_LOADING = tuple(name for name in signature(load).parameters if name not in ("source", "files_read"))


@checked_fields
@dataclass(frozen=True)
class RenderTask:
    """Say what one picture of a batch shows, and where it goes.

    Parameters
    ----------
    source : whatever `load` takes: a path, bytes, a Mesh, a Scene, a trimesh object …
    output : path of the file; the suffix chooses the format, folders are made. Or a dict of array names and paths, such
        as {"rgb": "a.png", "depth": "a.depth.png", "normal": "a.npy"}: all come from one frame, each as
        `Frame.save(path, array=name)` writes it ("rgb" in a format of pictures alone: as `Frame.save(path)`); names
        that share a path of .npz or .exr share the file. They appear together or not at all
    view : one of the named views, such as "front"; a pair (azimuth, elevation) in degrees; "random", or a dict of other
        arguments of `Camera.random`, such as {"distance": (1, 2)}, for a view by `seed`; None = the camera below, or
        the scene's own
    camera : Camera, "file", "frame" or the path of one, as `render` takes it; None = by the view
    options : Options, or a dict of words of `render`, but `view` and `camera`, which stand here, and those that say
        how a file is read, which stand in `load`. A dict replaces some of the options that a scene file has, Options
        all. `threads` is 1 unless it is given. With a dict of paths the outputs are what the files hold, whatever is
        said here; with one path and where a dict doesn't name them, too: of a picture "rgb"
    load : dict of other arguments of `load`: format, crease_angle, up, lights, background, allow_outside …
    array : which array a file at one path holds, or which ones, as in `Frame.save`; None = the picture; in a .npy file
        the first of the outputs, in .npz and .exr files all of them
    scale : of the depth in PNG files: the scene units that 1 stands for, as in `Frame.save`; None = 0.001; "auto" = so
        that the furthest of the picture just fits: the manifest has it
    lights : in place of the model's, which is read once for all: a light or several; "random", or a dict of other
        arguments of `random_lights`, for lights by `seed`; None = the model's
    seed : whole number, at least 0, of what is random; None = the task's number in its batch, 0, 1 …; its record and
        the manifest have it
    category : what its model is, for the manifest and COCO: text, or a dict of meshes' names and their categories; of
        None, and of what a dict doesn't name, a file with one mesh is one by the file's name, else each mesh by its own

    Dicts are copied, so that one may be changed for the next task. Nothing is checked before the task is done, so that
    one that is not legal doesn't stop the others.
    """

    source: Any
    output: str | os.PathLike[str] | Mapping[str, str | os.PathLike[str]]
    view: str | tuple[float, float] | Mapping[str, Any] | None = None
    camera: Camera | str | os.PathLike[str] | None = None
    options: Options | Mapping[str, Any] = field(default_factory=dict)
    load: Mapping[str, Any] = field(default_factory=dict)
    array: SavedArray | Sequence[SavedArray] | None = None
    scale: Scale = None
    lights: Any = None
    seed: int | None = None
    category: str | Mapping[str, str] | None = None

    def __post_init__(self) -> None:
        store(self, **{name: dict(value) for name, value in vars(self).items() if isinstance(value, Mapping)})

    @property
    def name(self) -> str:
        """What messages call it: its model's path, or else its first output."""
        return str(self.source) if isinstance(self.source, (str, os.PathLike)) else self.path

    @property
    def path(self) -> str:
        """Of its first file, whether or not that is legal."""
        first = next(iter(self.output.values()), "") if isinstance(self.output, Mapping) else self.output
        return os.fspath(first) if isinstance(first, os.PathLike) else str(first)

    def files(self, options: Options) -> dict[str, tuple[str, ...]]:
        """Return the names of the arrays that each file holds, by its path; none where it holds what `Frame.save`
        writes unless arrays are named: a picture, or all of them.

        Parameters
        ----------
        options : complete, as `check` returns them
        """
        if not isinstance(self.output, Mapping):
            is_npy = self.path.lower().endswith(".npy")
            return {self.path: self._names or (options.outputs[:1] if is_npy else ())}
        found: dict[str, tuple[str, ...]] = {}
        for name, path in self.output.items():
            found[os.fspath(path)] = (*found.get(os.fspath(path), ()), name)
        return found

    def named_files(self, options: Options) -> dict[str, str]:
        """Return the path of each array's file by its name, that of a picture as "rgb"."""
        found: dict[str, str] = {}
        for path, names in self.files(options).items():
            is_all = os.path.splitext(path)[1].lower()[1:] in ARRAY_SUFFIXES
            found |= dict.fromkeys(names or (options.outputs if is_all else ("rgb",)), path)
        return found

    def check(self) -> Options:
        """Return the options of the picture, complete but for those of a scene file.

        Raises
        ------
        SceneError : a value that is not legal
        OutputError : a format that can't be written
        """
        self._check_output()
        if not isinstance(self.load, Mapping) or not all(isinstance(name, str) for name in self.load):
            raise SceneError(f"load must be a dict of arguments of rz.load; given {shown(self.load)}")
        if unknown := [name for name in self.load if name not in _LOADING]:
            raise unknown_keyword("load", unknown[0], _LOADING)
        if self.camera is not None and is_random(self.view):
            raise SceneError("a picture has a camera, or a random view; given both")
        if isinstance(self.view, str) and self.view not in (*VIEWS, RANDOM):
            legal = f"{', '.join(VIEWS)}, {RANDOM}, or (azimuth, elevation)"
            raise SceneError(f"view must be one of {legal}; given {self.view!r}")
        if isinstance(self.lights, str) and self.lights != RANDOM:
            legal = f"lights, {RANDOM!r}, or arguments of random_lights"
            raise SceneError(f"lights must be {legal}; given {self.lights!r}")
        if self.seed is not None:
            whole(self.seed, "seed", 0)
        named = self.category if isinstance(self.category, Mapping) else {"": self.category or ""}
        if not all(isinstance(text, str) for text in (*named, *named.values())):
            raise SceneError(
                f"category must be text, or a dict of meshes' names and texts; given {shown(self.category)}"
            )
        from ..io.array_files import check_arrays
        from ..io.camera_file import viewpoint_of

        viewpoint_of(self.view_words)
        options = self.options_over({})
        files = self.files(options)
        for path, names in files.items():
            suffix = os.path.splitext(path)[1].lower()
            is_picture = not names or (names in (("rgb",), ("rgba",)) and suffix != ".png")
            if is_picture and suffix[1:] not in ARRAY_SUFFIXES:
                picture_format(suffix)
            else:
                held = names or tuple(name for name in options.outputs if name != "rgb" or suffix == ".npz")
                check_arrays(held, suffix[1:], self.scale_in(path, names))
        if self.scale is not None and not any(self.scale_in(*each) for each in files.items()):
            raise SceneError(f"scale is that of depth in a PNG file, and none is written; given {shown(self.scale)}")
        pickle.dumps((self.view_words, self.appearance, self.view, self.lights))  # other processes get them
        return options

    def scale_in(self, path: str, names: tuple[str, ...]) -> Any:
        """Return the scale that a file is written with; None for all but depth in a PNG file."""
        return self.scale if names == ("depth",) and path.lower().endswith(".png") else None

    def _check_output(self) -> None:
        """Refuse outputs and arrays that are none; raises SceneError."""
        paths: list[Any] = list(self.output.values()) if isinstance(self.output, Mapping) else [self.output]
        if not paths or not all(isinstance(path, (str, os.PathLike)) and os.fspath(path) for path in paths):
            legal = "the path of a file, or a dict of array names and paths"
            raise SceneError(f"output must be {legal}; given {shown(self.output)}")
        if isinstance(self.output, Mapping) and self.array is not None:
            raise SceneError(f"a task names its arrays in output or in array, not in both; given {shown(self.array)}")
        for name in self.output if isinstance(self.output, Mapping) else self._names:
            if not isinstance(name, str) or name not in SAVED_ARRAYS:
                raise SceneError(f"array must be one of {', '.join(SAVED_ARRAYS)}; given {shown(name)}")

    @property
    def _names(self) -> tuple[Any, ...]:
        """The arrays that are asked for; none where `array` is None."""
        if self.array is None:
            return ()
        return tuple(self.array) if isinstance(self.array, (list, tuple)) else (self.array,)

    def options_over(self, own: Mapping[str, Any]) -> Options:
        """Return the options of the picture, complete; `own` are those of a scene file, of which its words replace
        some."""
        return Options(**(dict(own) if isinstance(self.options, Mapping) else {}) | self._option_words())

    def _option_words(self) -> dict[str, Any]:
        """The options that it gives, by their names."""
        if isinstance(self.options, Options):
            values = dict(vars(self.options))
        elif isinstance(self.options, Mapping) and all(isinstance(name, str) for name in self.options):
            values = divided(divided(self.options, Viewpoint)[1], Appearance)[1]
            fields = {"view", "camera"} if self.lights is None else {"view", "camera", "lights"}
            if elsewhere := sorted((fields | {*READING}) & {*self.options}):
                raise SceneError(f"a task has {elsewhere[0]} as a field, or in `load`; given in its options")
        else:
            raise SceneError(f"options must be Options or a dict of some; given {shown(self.options)}")
        if isinstance(self.output, Mapping) or "outputs" not in values:
            names = self.output if isinstance(self.output, Mapping) else self._names
            is_array = os.path.splitext(self.path)[1].lower()[1:] in ARRAY_SUFFIXES
            names = tuple(names) or (() if is_array else ("rgb",))
            needed = tuple(dict.fromkeys({"rgba": "rgb", "alpha": "color"}.get(name, name) for name in names))
            values |= {"outputs": needed} if needed else {}
        if values.get("threads") is None:
            values["threads"] = 1
        return values

    @property
    def loading(self) -> dict[str, Any]:
        """The arguments of `load` that it gives."""
        return dict(self.load) | ({"camera": "file"} if self.is_of_file else {})

    @property
    def is_of_file(self) -> bool:
        """Whether it asks for the camera of its model's file."""
        return isinstance(self.camera, str) and self.camera == "file"

    @property
    def appearance(self) -> dict[str, Any]:
        """The words of its options that change how its model looks."""
        return divided(self.options, Appearance)[0] if isinstance(self.options, Mapping) else {}

    @property
    def files_named(self) -> tuple[str, ...]:
        """The files beside its model that its picture is made of: textures and a camera."""
        material = self.appearance.get("material")
        named = [material.get(name) for name in TEXTURES] if isinstance(material, Mapping) else []
        named += [self.camera] if is_path(self.camera) else []
        return tuple(os.fspath(each) for each in named if isinstance(each, (str, os.PathLike)))

    @property
    def view_words(self) -> dict[str, Any]:
        """The words that say where its picture is taken from, but for a random view."""
        words = divided(self.options, Viewpoint)[0] if isinstance(self.options, Mapping) else {}
        return words | {"view": None if is_random(self.view) else self.view, "camera": self.camera}


def is_random(value: object) -> bool:
    """Tell whether a view, or lights, are by the seed of a task: the word, or arguments of what makes them."""
    return isinstance(value, Mapping) or (isinstance(value, str) and value == RANDOM)


@dataclass(frozen=True)
class RenderRecord:
    """Say what became of a task.

    Attributes
    ----------
    index : which one it was, counted from 0
    output : path of its first file, text
    status : "drawn", "skipped" (its files were there) or "failed"
    seconds : that it took where it was drawn, its model's loading included if it was the first of that model
    error : Exception, where it failed; then none of its files was written
    stats : Stats of the picture, where it was drawn
    model : path, text; None where it was no file
    warnings : what its model was warned of, and that it was lost with a process once, texts
    files : paths of all that it writes, texts, in the order in which they were given
    seed : of what was random; None where nothing was
    remarks : what else is said of it by the command that drew it; None elsewhere
    """

    index: int
    output: str
    status: Literal["drawn", "skipped", "failed"]
    seconds: float = 0.0
    error: Exception | None = None
    stats: Stats | None = None
    model: str | None = None
    warnings: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    seed: int | None = None
    remarks: Any = field(default=None, repr=False, compare=False)

    def as_dict(self) -> dict[str, Any]:
        """Return it as a dict that can be written as JSON; its names are those of the lines of `--json`."""
        found: dict[str, Any] = {"index": self.index, "status": self.status, "model": self.model}
        found |= {"output": self.output, "files": list(self.files)}
        found |= {"seconds": round(self.seconds, 4), "error": None if self.error is None else str(self.error)}
        coverage = None if self.stats is None else self.stats.coverage
        return found | {"seed": self.seed, "coverage": coverage, "warnings": list(self.warnings)}


@dataclass
class RenderSummary:
    """Count what became of the tasks of a batch.

    Attributes
    ----------
    drawn, skipped, failed : how many
    seconds : since the batch began
    first_error : text, why the first one failed; None where none did
    """

    drawn: int = 0
    skipped: int = 0
    failed: int = 0
    seconds: float = 0.0
    first_error: str | None = None

    def __str__(self) -> str:
        return self.describe("picture")

    def describe(self, noun: str) -> str:
        """Say it in a line; `noun` is what is counted."""
        parts = [f"{counted(self.drawn, noun)} drawn"]
        parts += [f"{self.skipped} skipped"] if self.skipped else []
        parts += [f"{self.failed} failed"] if self.failed else []
        rate = f" ({self.drawn / self.seconds:.3g} a second)" if self.drawn and self.seconds > 0 else ""
        why = f"; the first failure: {cut(self.first_error)}" if self.first_error else ""
        return f"{', '.join(parts)} in {self.seconds:.3g} s{rate}{why}"

    @property
    def exit_code(self) -> int:
        """What a program may end with: 0 where nothing failed, 1 where something did."""
        return int(self.failed > 0)
