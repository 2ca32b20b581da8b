"""The functions and classes that people call by hand are wrapped: of a keyword that one doesn't have, the error names
the nearest one that it has.

Python's own error says what is wrong, and before 3.13 no more. What editors and type checkers see of the functions
stays what is written. This file is apart from errors.py because `typing`, which it needs, is more than `raster --help`
waits for.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from .choices import nearest_word
from .errors import OptionError

if TYPE_CHECKING:
    if sys.version_info >= (3, 11):
        from typing import Unpack as Unpack
    else:
        from typing_extensions import Unpack as Unpack

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T", bound=type)


def checked_keywords(function: Callable[P, R], words: tuple[str, ...] = ()) -> Callable[P, R]:
    """Let a function raise OptionError where it is given a keyword that it doesn't have; `words` are those that it
    takes as **words."""
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
        return function(*args, **kwargs)

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
    near = nearest_word(keyword, legal)
    hint = f"did you mean {near}? " if near else ""
    listed = ", ".join(legal)
    listed = listed if len(listed) <= _MAX_LISTED else f"those of help(rz.{name})"
    return OptionError(f"{name} has no option {keyword!r}: {hint}Options are {listed}")


_MAX_LISTED = 200  # letters
