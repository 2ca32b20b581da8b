"""What may be written into a dataclass of the scene: the names of its fields, what each holds, and which are needed.

The command line and scene files read and write lights by this description. So a class that is added needs no code
there, if its fields are annotated with the types listed at `describe_fields`.
"""

import types
from collections.abc import Sequence
from dataclasses import MISSING, fields, is_dataclass
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, Union, get_args, get_origin, get_type_hints

from .color import ColorLike
from .validate import VectorLike

# What a class may be given. Once checked it is stored as three floats, as two ints, as linear RGB or a Spectrum, and as
# three floats (kc, kl, kq).
Vector: TypeAlias = Annotated[VectorLike, "vector"]
Cells: TypeAlias = Annotated[Sequence[int], "cells"]  # numbers of cells along two edges
Color: TypeAlias = Annotated[ColorLike, "color"]
Attenuation: TypeAlias = Annotated[str | VectorLike, "attenuation"]

_PLAIN = {float: "number", int: "whole", bool: "flag", str: "text"}


class Field(NamedTuple):
    """One field of a dataclass."""

    holds: str  # "number", "whole", "flag", "text", "word", "vector", "cells", "color", "attenuation" or "shadow"
    is_needed: bool  # it has no default
    words: tuple[str, ...] = ()  # the legal ones of a "word"


def describe_fields(cls: type) -> dict[str, Field]:
    """Describe the fields of a dataclass, in their order.

    What a field holds is said by its annotation: float ("number"), int ("whole"), bool ("flag"), str ("text"), a
    Literal of words ("word"), `Vector`, `Cells`, `Color`, `Attenuation`, or a dataclass such as `Shadow` (its name in
    small letters). `T | None` holds what T does; so does `Shadow | bool | None`.

    Parameters
    ----------
    cls : a dataclass

    Returns
    -------
    dict of the field's name to Field

    Raises
    ------
    TypeError : no dataclass, or an annotation that is none of these
    """
    if not (isinstance(cls, type) and is_dataclass(cls)):
        raise TypeError(f"a dataclass is needed; given {cls!r}")
    hints = get_type_hints(cls, include_extras=True)
    described = {}
    for field in fields(cls):
        annotation = _without_none(hints[field.name])
        holds = _what_holds(annotation)
        if holds is None:
            legal = "float, int, bool, str, a Literal, Vector, Cells, Color, Attenuation or a dataclass"
            raise TypeError(f"{cls.__name__}.{field.name} must be annotated with {legal}; given {annotation!r}")
        words = get_args(annotation) if holds == "word" else ()
        is_needed = field.default is MISSING and field.default_factory is MISSING
        described[field.name] = Field(holds, is_needed, words)
    return described


def _without_none(annotation: Any) -> Any:
    """Return T of T | None, else the annotation itself."""
    if get_origin(annotation) in (Union, types.UnionType):
        others = [member for member in get_args(annotation) if member is not type(None)]
        others = [member for member in others if member is not bool] or others
        return others[0] if len(others) == 1 else annotation
    return annotation


def _what_holds(annotation: Any) -> str | None:
    """Return the word for what a field with this annotation holds; None where there is none."""
    if get_origin(annotation) is Annotated:
        return next((word for word in annotation.__metadata__ if isinstance(word, str)), None)
    if get_origin(annotation) is Literal:
        return "word"
    if isinstance(annotation, type) and is_dataclass(annotation):
        return annotation.__name__.lower()
    return _PLAIN.get(annotation)
