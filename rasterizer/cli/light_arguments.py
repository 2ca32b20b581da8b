"""`--light KIND:...`: a light as it is written becomes one of the scene's.

    point:1,2,3,color=#f80,shadow=512/3
    kind  first names and values, as each field of the kind's class is written
          field

The kinds and their fields are those of the scene's table, so one that is added there can be written here at once.
"""

import argparse
import re
from typing import Any

from ..errors import SceneError
from ..scene.lights import LIGHT_TYPES, Field, Shadow, describe_fields
from . import values
from .suggestions import did_you_mean


def make_light(text: str, casts: bool, shadow: Shadow) -> Any:
    """Make a light of what follows --light.

    Parameters
    ----------
    text : KIND:VALUE,NAME=VALUE,...; the first value is that of the class' first field
    casts : whether a light that doesn't speak of shadows casts one
    shadow : that of such a light, and of one that says shadow=yes

    Returns
    -------
    an object of the kind's class

    Raises
    ------
    SceneError : an unknown kind or name, or a value that is not legal; the message lists what is
    """
    kind, _, rest = text.partition(":")
    if kind not in LIGHT_TYPES:
        legal = ", ".join(f"{word}:..." for word in LIGHT_TYPES)
        meant = did_you_mean(kind, LIGHT_TYPES)
        raise SceneError(f"argument --light: a light is one of {legal}; given {text!r}{meant}")
    described = describe_fields(LIGHT_TYPES[kind])
    try:
        settings = _read_settings(kind, rest, described)
    except argparse.ArgumentTypeError as fault:
        raise SceneError(f"argument --light: {fault}") from None
    for name, field in described.items():
        if field.is_needed and name not in settings:
            raise SceneError(
                f"argument --light: a {kind} light needs {name}={_FORMS.get(field.holds, 'VALUE')}; given {text!r}"
            )
    if "shadow" in described:
        settings["shadow"] = _chosen_shadow(settings.get("shadow", casts), shadow)
    return LIGHT_TYPES[kind](**settings)


def _read_settings(kind: str, rest: str, described: dict[str, Field]) -> dict[str, Any]:
    """Read the values behind the kind, by the names of the class' fields."""
    first = next(iter(described))
    head, *parts = re.split(r",(?=\s*\w+=)", rest)  # a comma that no NAME= follows belongs to the value
    settings = {}
    if "=" in head:
        parts.insert(0, head)
    elif head or described[first].is_needed:
        is_vector = described[first].holds == "vector"  # written with commas, as for --eye
        settings[first] = values.vector(head) if is_vector else _read(first, head, described[first])
    for part in parts:
        name, _, value = part.strip().partition("=")
        if name not in described or not value:
            legal = ", ".join(f"{name}=..." for name in described)
            meant = did_you_mean(name, described)
            raise argparse.ArgumentTypeError(f"a {kind} light takes {legal}; given {part!r}{meant}")
        settings[name] = _read(name, value, described[name])
    return settings


def _read(name: str, text: str, field: Field) -> Any:
    """Read a field's value; a fault names the field."""
    try:
        return _READERS.get(field.holds, str)(text)
    except argparse.ArgumentTypeError as fault:
        raise argparse.ArgumentTypeError(f"{name}: {fault}") from None


def _chosen_shadow(own: bool | tuple[int, int], shadow: Shadow) -> Shadow | None:
    """Return the shadow of a light that says yes, no or (size, filter)."""
    if isinstance(own, tuple):
        return Shadow(*own)
    return shadow if own else None


def _vector(text: str) -> tuple[float, ...]:
    return values.vector(text, "/")


def _attenuation(text: str) -> str | tuple[float, ...]:
    """KC/KL/KQ as numbers; what else there is stays text, as the classes of lights read it."""
    return text if text.startswith("1/(") or "d" in text or "/" not in text else _vector(text)


def _cells(text: str) -> tuple[int, ...]:
    """M/N, two whole numbers."""
    if not re.fullmatch(r"\d{1,9}/\d{1,9}", text):
        raise argparse.ArgumentTypeError(f"M/N is needed, two whole numbers; given {text!r}")
    return tuple(map(int, text.split("/")))


def _shadow(text: str) -> bool | tuple[int, int]:
    """True, False, or (size, filter)."""
    if text in ("yes", "no"):
        return text == "yes"
    match = re.fullmatch(r"(\d{1,9})(?:/(\d{1,9}))?", text)
    if not match:
        raise argparse.ArgumentTypeError(f"yes, no, SIZE or SIZE/FILTER is needed; given {text!r}")
    return int(match[1]), int(match[2] or 1)


# By what a field holds, see `describe_fields`; words and text are checked by the class.
_READERS = {
    "number": values.number,
    "whole": values.whole,
    "flag": values.yes_or_no,
    "vector": _vector,
    "cells": _cells,
    "color": values.color,
    "attenuation": _attenuation,
    "shadow": _shadow,
}
_FORMS = {"vector": "X/Y/Z", "cells": "M/N", "flag": "yes", "color": "COLOR", "attenuation": "KC/KL/KQ"}
