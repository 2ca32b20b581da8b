"""What a command line asks for: one Request, made once of the arguments, and handed to everything behind.

arguments ─ make_request ─ Request, of all models ─ over(file) ─ Request of one model
argparse                                            what a scene file says, where no flag does
"""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple, TypeGuard

import numpy as np

from ..appearance import TEXTURES, Appearance
from ..choices import ARRAY_SUFFIXES, BUFFERS, RANDOM
from ..errors import ModelError, SceneError, cut, named_in_errors
from ..io.array_files import read_npy
from ..io.camera_file import viewpoint_of
from ..io.loader import SceneFile
from ..options import Options
from ..scene.camera import Camera
from ..scene.color import linear_rgb
from ..scene.lights import Shadow
from ..scene.scalars import ScalarWords
from ..scene.scene import DepthCue, Scene
from ..viewpoint import Viewpoint, check_words, is_path, words_given, zoomed
from .flags import EVERY, UNSAID
from .messages import STDIO
from .values import make_light


class Files(NamedTuple):
    """What is written."""

    asked: tuple[tuple[str | None, tuple[str, ...] | None], ...] = (
        (None, None),
    )  # of each -o its name, and its arrays
    default_name: str = "{stem}"  # the template of a name without suffix, where none is asked for
    default_suffix: str = ".png"
    always_writes: bool = False  # also where none is asked for
    scale: float | str | None = None  # of depth in PNG files
    skip_existing: bool = False
    colorbar: bool = False  # whether pictures have one
    format: str | None = None  # of files whose names aren't asked for; None = the default suffix, or that of arrays
    may_be_empty: bool = False  # whether a folder without models is no fault

    @property
    def output(self) -> str | None:
        """The name behind the last -o."""
        return self.asked[-1][0]

    def named(self, output: str | None) -> str | None:
        """Return an output, or a name with the suffix that --format says, where it is a folder, stdout or left out."""
        if self.format is None or (output != STDIO and is_name(output)):
            return output
        return f"{output if output == STDIO else 'x'}.{self.format.lstrip('.')}"

    @property
    def holds_arrays(self) -> bool:
        """Whether arrays are written, and no picture alone."""
        return any(arrays for _, arrays in self.asked) or suffix_of(self.named(self.output)) in ARRAY_SUFFIXES

    @property
    def needed(self) -> tuple[str, ...]:
        """The outputs of `Options` that the files need."""
        names = tuple(dict.fromkeys(name for _, arrays in self.asked for name in arrays or ()))
        if not names:
            return ("color",) if self.holds_arrays else ("rgb",)
        is_picture = any(not arrays for _, arrays in self.asked)
        return names if "rgb" in names or not is_picture else ("rgb", *names)


@dataclass(frozen=True, kw_only=True)
class Request:
    """Hold what is asked for: of all models, or, once it is laid over what a scene file says, of one."""

    models: tuple[str, ...] = ()  # files, patterns and folders
    is_recursive: bool = False
    options: Options
    of_file: frozenset[str]  # names of the options that a scene file decides
    appearance: Appearance
    shadow_fields: Mapping[str, int]  # fields of Shadow to replace, of lights that cast one
    is_compared: bool  # shading is what a command compares, no option
    viewpoint: Viewpoint  # but for the view
    views: tuple[str | None, ...]  # names of views, and random-SEED; None = where the other words say
    framing: Viewpoint | None = None  # that a scene file asks for
    is_view_given: bool  # whether any flag but --zoom and --camera says where the picture is taken from, and how
    is_up_given: bool
    seed_of_lights: int | None  # of random lights, where they are asked for
    is_seed_assumed: bool = False  # whether something is random, and no seed was given
    read: tuple[str, ...]  # files that flags name, but for the models
    files: Files
    is_json: bool
    level: int  # of messages
    n_process: int | None

    def over(self, file: SceneFile) -> "Request":
        """Return what is asked for of a file: what it says itself, changed by what the flags say."""
        if not file.options and file.appearance is file.framing is None:
            return self
        own = {name: value for name, value in file.options.items() if name in self.of_file}
        options = replace(self.options, **own) if own else self.options
        return replace(self, options=options, appearance=self.appearance.over(file.appearance), framing=file.framing)

    def at(self, view: str | None) -> Viewpoint:
        """Return where a view is taken from, by its name."""
        viewpoint = self.viewpoint if view is None else replace(self.viewpoint, view=view)
        return viewpoint.over(self.framing)

    def camera_of(self, view: str | None, scene: Scene, subject: Callable[[], Any] | None = None) -> Camera:
        """Make the camera for a view of a scene; `subject` is that of `Viewpoint.camera_of`."""
        seed = seed_of(view)
        if seed is not None:
            return zoomed(Camera.random(scene, seed, size=self.options.size), self.viewpoint.zoom)
        return self.at(view).camera_of(scene, self.options.size, subject)


def make_request(arguments: Any) -> tuple[Request, dict[str, Any]]:
    """Make the Request of the arguments that argparse has found.

    Returns
    -------
    the request; and the values of the flags that are the command's own

    Raises
    ------
    SceneError : an argument that is wrong for every model
    ModelError : a texture or a camera that can't be read
    """
    left = dict(vars(arguments))
    take = left.pop
    can_be_random, is_compared = "seed" in left, "shading" not in left
    asked = _asked_files(take("files", ()), take("output", None), take("outputs", None))
    files = Files(asked, **{name: left.pop(name) for name in Files._fields if name in left})
    is_shown = any(
        suffix_of(files.named(name)) not in ARRAY_SUFFIXES and "rgb" in (arrays or ("rgb",)) for name, arrays in asked
    )
    if files.colorbar and not is_shown:
        raise SceneError("--colorbar is drawn beside a picture: give -o a picture, or --array rgb")
    size, names = take("default_size", None), {field.name for field in fields(Options)} & {*left, "outputs"}
    given = {name: left.pop(name) for name in names if name in left}
    given = {name: value for name, value in given.items() if value is not None}
    default = {} if size is None else {"size": size}
    options = Options(**default | given | {"outputs": files.needed})
    # Which outputs there are, a scene file decides where a file of arrays is written.
    of_file = names.difference(given, () if files.holds_arrays and not any(a for _, a in asked) else ("outputs",))
    up, lights, materials = take("up", None), take("lights", []), take("materials", [])
    is_random = can_be_random and RANDOM in lights
    if is_random and len(lights) > 1:
        raise SceneError("--light random takes the place of all lights; given another --light beside it")
    view_words = {each.name: take(each.name, each.default) for each in fields(Viewpoint) if each.name != "view"}
    given_seed = take("seed", None)
    views, seed = _numbered_views(take("views", []), given_seed, is_random)
    shadow_fields = {"size": take("shadow_size", None), "filter": take("shadow_filter", None)}
    shadow_fields = {name: value for name, value in shadow_fields.items() if value is not None}
    shadow = Shadow(**shadow_fields)  # of lights that cast one and don't say its size and filter themselves
    has_shadows = take("shadows", False)
    cue = take("depth_cue", UNSAID)
    words = {each.name: left.pop(each.name) for each in fields(Appearance) if each.name in left}
    words |= {"format": take("input_format", None), "up": up}
    words |= {"shadows": shadow if has_shadows else False, "depth_cue": None if cue == UNSAID else _depth_cue(cue)}
    scalars = words.get("scalars")
    if suffix_of(scalars) == "npy":
        words["scalars"] = _read_array(scalars)
    words["lights"] = None if is_random else tuple(make_light(text, shadow) for text in lights) or None
    request = Request(
        models=tuple(take("models", ())),
        is_recursive=take("recursive", False),
        options=options,
        of_file=frozenset(of_file),
        appearance=_make_appearance(words, materials),
        shadow_fields={} if has_shadows else shadow_fields,
        is_compared=is_compared,
        viewpoint=_make_viewpoint(view_words, views, up, options.size),
        views=views,
        is_view_given=bool(views != (None,) or up is not None or words_given({"view": None} | view_words)),
        is_up_given=up is not None,
        seed_of_lights=seed if is_random else None,
        is_seed_assumed=seed is not None and given_seed is None,
        read=tuple(_files_named(materials, view_words["camera"], scalars)),
        files=files,
        is_json=take("json", False),
        level=take("level", None),
        n_process=take("n_process", None),
    )
    take("command", None)
    return request, left


# --- what is written --------------------------------------------------------------------------------------------------


def is_name(output: str | None) -> TypeGuard[str]:
    """Tell whether what -o says is the name of a file, or stdout, and no folder."""
    return output is not None and not (output.endswith(("/", os.sep)) or os.path.isdir(output))


def suffix_of(output: str | None) -> str:
    """Return the suffix of an output, small letters without the point; "" where there is no output."""
    return Path(output or "").suffix.lower().lstrip(".")


def _asked_files(files: Any, output: str | None, arrays: Any) -> tuple[Any, ...]:
    """Return (output, arrays) for each -o; SceneError where --array stands after the last of several, or an output has
    none that needs some."""
    if len(files) < 2:
        return ((output, _expanded(arrays) if arrays else None),)
    if sum(len(names) for _, names in files) < len(arrays or ()):
        raise SceneError(
            f"with several -o, --array stands before the -o of its file; given one after -o {files[-1][0]}"
        )
    for name, names in files:
        if not names and suffix_of(name) in ARRAY_SUFFIXES:
            raise SceneError(f"with several -o, --array stands before the -o of its file; given none before -o {name}")
    return tuple((name, _expanded(names)) for name, names in files)


def _expanded(names: Iterable[str] | None) -> tuple[str, ...] | None:
    """Return the arrays that are asked for, each once; None where none are named."""
    every = ("color", *BUFFERS)
    return (
        tuple(dict.fromkeys(name for given in names or () for name in (every if given == EVERY else (given,)))) or None
    )


def _files_named(materials: list[dict[str, Any]], camera: str | None, scalars: str | None) -> Iterable[str]:
    """Yield the files that flags name for reading."""
    for given in materials:
        yield from (given[name] for name in TEXTURES if given.get(name))
    if is_path(camera):
        yield camera
    if suffix_of(scalars) == "npy":
        yield scalars


def _read_array(path: str) -> Any:
    """Read the scalars of a .npy file."""
    try:
        array = read_npy(path)
        ScalarWords(scalars=array)  # which checks it
    except (OSError, ValueError, SceneError) as fault:
        raise ModelError(f"{path}: can't be read as .npy ({getattr(fault, 'strerror', None) or cut(fault)})") from fault
    return array


# --- how it looks, and where from -------------------------------------------------------------------------------------


def _make_appearance(words: dict[str, Any], materials: list[dict[str, Any]]) -> Appearance:
    """Make the Appearance; of materials the later fields count."""
    if words.get("background") not in (None, "transparent"):
        linear_rgb(words["background"], "--background")
    material, reflection = {}, words.get("reflection")
    for given in materials:
        material |= given
    if not material:
        return Appearance(**words)
    with named_in_errors("--material"):
        fields_of_material = Appearance(material=material, reflection=reflection).material
    return Appearance(**words | {"material": fields_of_material})


def _depth_cue(given: Any) -> Any:
    """Return what Appearance takes for --depth-cue."""
    if given is None:
        return "none"
    with named_in_errors("--depth-cue"):
        return DepthCue(**given)


def seed_of(view: str | None) -> int | None:
    """Return the seed of a random view by its name; None of others."""
    return int(view.rpartition("-")[2]) if view and view.startswith(f"{RANDOM}-") else None


def _numbered_views(words: Any, seed: int | None, has_random_lights: bool) -> tuple[tuple[str | None, ...], int | None]:
    """Return the names of views, random ones with their seeds; 0 where none is given; SceneError for a seed in vain."""
    is_random = has_random_lights or any(word.startswith(RANDOM) for word in words)
    if seed is not None and not is_random:
        raise SceneError("--seed needs something that is random: --view random:N, or --light random")
    seed = 0 if seed is None and is_random else seed
    names, number = [], seed
    for word in words:
        first, _, count = word.partition(":")
        if first != RANDOM:
            names.append(word)
            continue
        names += [f"{RANDOM}-{number + k:04}" for k in range(int(count or 1))]
        number += int(count or 1)
    return tuple(dict.fromkeys(names)) or (None,), seed


def _make_viewpoint(view_words: dict[str, Any], views: Any, up: str | None, size: tuple[int, int]) -> Viewpoint:
    """Make the Viewpoint of all views; SceneError where no model could be looked at like this: something stands in for
    the model."""
    named = [view for view in views if seed_of(view) is None]
    for view in named:
        check_words(view_words | {"view": view}, "--")
    if len(named) < len(views):
        check_words(view_words | {"view": None}, "--")
        given = ["camera"] * (view_words["camera"] not in (None, "frame")) + words_given(view_words | {"view": None})
        if given:
            raise SceneError(f"a random view is framed by its seed; given --view random, --{', --'.join(given)}")
    viewpoint = viewpoint_of(view_words)
    if view_words["camera"] != "file" and (named != [None] or words_given(view_words | {"view": None})):
        box = np.array([[1.0, 2.0, 3.0], [2.0, 3.0, 4.0]]) + (view_words["eye"] or (0.0, 0.0, 0.0))
        scene = SimpleNamespace(camera=None, bounds=box, up="y" if up in (None, "auto") else up)
        viewpoint.camera_of(scene, size, lambda: box)
    return viewpoint
