"""The functions and classes that people call by hand are wrapped: what is wrong is said where they are called.

Of a keyword that a function doesn't have the error names the nearest one that it has: Python's own error for it says
what is wrong, and before 3.13 no more. And the traceback of a user's error ends at the user's line and the wrapper's:
where in this package it was found is of no use to them. What editors and type checkers see of the functions stays what
is written. This file is apart from errors.py because `typing`, which it needs, is more than `raster --help` waits for.
"""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from .errors import ModelError, OptionError, RasterizerError

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T", bound=type)


def checked_keywords(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function raise OptionError where it is given a keyword that it doesn't have, and errors of this package as
    if they came from where it was called."""
    code = function.__code__
    n_parameter = code.co_argcount + code.co_kwonlyargcount
    legal = tuple(name for name in code.co_varnames[:n_parameter] if name not in ("self", "cls"))
    name, takes_any = function.__qualname__.removesuffix(".__init__"), code.co_flags & 0x08  # CO_VARKEYWORDS of inspect

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
    return OptionError(f"{name} has no option {keyword!r}: {hint}Options are {', '.join(legal)}")


# What other programs call it.
_SYNONYMS = {
    "aa": "samples",
    "alpha": "opacity",
    "antialiasing": "samples",
    "azim": "azimuth",
    "base_color": "diffuse",
    "bg": "background",
    "buffers": "outputs",
    "color": "diffuse",
    "colour": "diffuse",
    "elev": "elevation",
    "height": "size",
    "intensity": "color",
    "mode": "shading",
    "multisample": "samples",
    "resolution": "size",
    "shape": "size",
    "spp": "samples",
    "supersampling": "samples",
    "vertex_colors": "colors",
    "width": "size",
    "workers": "threads",
}

# What is no option, but set elsewhere: the command line has flags of these names.
_ELSEWHERE = {
    "color": "a material has it: mesh.with_material(Material(diffuse=...))",
    "colour": "a material has it: mesh.with_material(Material(diffuse=...))",
    "crease_angle": "Mesh and load() have it",
    "depth_cue": "Scene and load() have it",
    "fov": "a camera has it: camera=Camera.framing(scene, fov=...)",
    "margin": "a camera has it: camera=Camera.framing(scene, margin=...)",
    "material": "a mesh has it: mesh.with_material(...)",
    "preset": "lights=studio(), headlight() or tabletop()",
    "shadow": "lights cast them: DirectionalLight(..., shadow=Shadow())",
    "shadows": "lights cast them: DirectionalLight(..., shadow=Shadow())",
    "subdivide": "a mesh has it: mesh.subdivide()",
    "texture": "a material has it: Material(texture=...)",
    "view": "azimuth and elevation say it",
}
