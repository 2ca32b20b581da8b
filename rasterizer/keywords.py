"""The functions and classes that people call by hand are wrapped: what is wrong is said where they are called.

Of a keyword that a function doesn't have the error names the nearest one that it has: Python's own error for it says
what is wrong, and before 3.13 no more. And the traceback of a user's error ends at the user's line and the wrapper's:
where in this package it was found is of no use to them. What editors and type checkers see of the functions stays what
is written. This file is apart from errors.py because `typing`, which it needs, is more than `raster --help` waits for.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from .errors import ModelError, OptionError, RasterizerError

if TYPE_CHECKING:
    if sys.version_info >= (3, 11):
        from typing import Unpack as Unpack
    else:
        from typing_extensions import Unpack as Unpack

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T", bound=type)


def checked_keywords(function: Callable[P, R], words: tuple[str, ...] = ()) -> Callable[P, R]:
    """Let a function raise OptionError where it is given a keyword that it doesn't have, and errors of this package as
    if they came from where it was called; `words` are those that it takes as **words."""
    code = function.__code__
    n_parameter = code.co_argcount + code.co_kwonlyargcount
    legal = tuple(name for name in code.co_varnames[:n_parameter] if name not in ("self", "cls")) + words
    name = function.__qualname__.removesuffix(".__init__")
    takes_any = code.co_flags & 0x08 and not words  # CO_VARKEYWORDS of inspect

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        for keyword in () if takes_any else kwargs:
            if keyword not in legal:
                raise unknown_keyword(name, keyword, legal)
        try:
            return function(*args, **kwargs)
        except RasterizerError as error:
            if isinstance(error, ModelError) and error.is_internal:  # of ours: where it was found is what counts
                raise
            raise error.with_traceback(None)  # noqa: B904  it is the same error

    return checked


def takes_words(*groups: type, but: tuple[str, ...] = ()) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let a function take as **words the fields of dataclasses, except `but` some, and check them as `checked_keywords`
    does.

    The signature that `help` and notebooks show has all of them, each with its default, and no types: those are said by
    its text, and by what type checkers read, the TypedDict of each of the groups.
    """
    words = {each.name: each.default for group in groups for each in fields(group)}
    words = {name: default for name, default in words.items() if name not in but}

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        from inspect import Parameter, signature

        checked: Any = checked_keywords(function, tuple(words))
        plain = signature(function)
        own = [each.replace(annotation=Parameter.empty) for each in plain.parameters.values()]
        keywords = [Parameter(name, Parameter.KEYWORD_ONLY, default=default) for name, default in words.items()]
        shown = [each for each in own if each.kind is not each.VAR_KEYWORD] + keywords
        checked.__signature__ = plain.replace(parameters=shown)
        return checked

    return decorate


def divided(words: Mapping[str, Any], group: type) -> tuple[dict[str, Any], dict[str, Any]]:
    """Divide words into those that are fields of a dataclass, and the others."""
    own: dict[str, Any] = {}
    others: dict[str, Any] = {}
    for name, value in words.items():
        (own if name in group.__dataclass_fields__ else others)[name] = value  # type: ignore[attr-defined]
    return own, others


def checked_fields(cls: T) -> T:
    """Let a dataclass raise OptionError where it is given a field that it doesn't have."""
    cls.__init__ = checked_keywords(cls.__init__)  # type: ignore[misc]
    return cls


def unknown_keyword(name: str, keyword: str, legal: tuple[str, ...]) -> OptionError:
    """Make the error for a keyword that a function called `name` doesn't have.

    Parameters
    ----------
    name : what was called
    keyword : what it was given
    legal : the keywords that it has
    """
    from difflib import get_close_matches

    near = _SYNONYMS.get(keyword.lower())
    found = [near] if near in legal else get_close_matches(keyword.lower(), legal, n=1)
    where = None if near in legal else _ELSEWHERE.get(keyword.lower())
    hint = f"{where}. " if where else f"did you mean {found[0]}? " if found else ""
    listed = ", ".join(legal)
    listed = listed if len(listed) <= _MAX_LISTED else f"those of help(rz.{name})"
    return OptionError(f"{name} has no option {keyword!r}: {hint}Options are {listed}")


_MAX_LISTED = 200  # letters


# What other programs, and the command line, call it.
_SYNONYMS = {
    "aa": "samples",
    "alpha": "opacity",
    "antialiasing": "samples",
    "azim": "azimuth",
    "base_color": "diffuse",
    "bg": "background",
    "array": "outputs",
    "buffers": "outputs",
    "color": "diffuse",
    "colour": "diffuse",
    "elev": "elevation",
    "frames": "n_frame",
    "height": "size",
    "input_format": "format",
    "intensity": "color",
    "mode": "shading",
    "multisample": "samples",
    "orthographic": "ortho",
    "processes": "n_process",
    "resolution": "size",
    "shape": "size",
    "spp": "samples",
    "supersampling": "samples",
    "vertex_colors": "colors",
    "width": "size",
    "workers": "threads",
}

# What is no option, but set elsewhere, or asked of another function: the command line has flags of these names.
_ELSEWHERE = {
    "color": "a material has it, Material(diffuse=...), and render()",
    "colour": "a material has it, Material(diffuse=...), and render() as color",
    "crease_angle": "Mesh, load() and render() have it",
    "depth_cue": "Scene, load() and render() have it",
    "edges": "render() has it",
    "fov": "a camera has it, Camera.framing(scene, fov=...), and render()",
    "ground": "render() has it",
    "json": "frame.stats says it",
    "margin": "a camera has it, Camera.framing(scene, margin=...), and render()",
    "material": "a mesh has it, mesh.with_material(...), and render()",
    "output": "the frame is written by render(...).save(path)",
    "preset": "render() has it; lights=studio(), headlight() or tabletop()",
    "processes": "render_many(tasks, n_process=...)",
    "quiet": "nothing is said but warnings",
    "recursive": "a call takes one model: Path(folder).rglob('*.stl') lists them",
    "scale": "the frame's save() and encode() have it",
    "seed": "Camera.random(scene, seed) and random_lights(seed) have it, and RenderTask",
    "shadow": "a light has it, DirectionalLight(..., shadow=True); shadows=True of render() is of all",
    "shadow_filter": "shadows=Shadow(filter=...)",
    "shadow_size": "shadows=Shadow(size=...)",
    "shadows": "render() has it; a light's is DirectionalLight(..., shadow=True)",
    "skip_existing": 'render_many(tasks, existing="skip")',
    "subdivide": "a mesh has it, mesh.subdivide(), and render()",
    "texture": "a material has it: material={'texture': ...}",
    "verbose": "load(path, log=print) says what a file has, frame.stats the rest",
    "view": "render() has it; elsewhere azimuth and elevation say it",
}
