"""`--light KIND:...`: a light as written, which is made only once its class may be imported."""

import argparse
import re
from typing import NamedTuple

from . import values

_FALLING = ("attenuation", "range", "amplify", "attached", "shadow")  # what lights with a place take

LIGHTS = {  # kind: (numbers it is given, names it takes besides)
    "ambient": (None, ()),
    "directional": ("direction", ("color", "attached", "shadow")),
    "point": ("position", ("color", *_FALLING)),
    "spot": ("position", ("direction", "color", "inner", "outer", "exponent", "falloff", *_FALLING)),
    "area": ("corner", ("edge_u", "edge_v", "color", "resolution", *_FALLING)),
}
_NEEDED = {"spot": ("direction",), "area": ("edge_u", "edge_v")}  # without them there is no such light


class LightArgument(NamedTuple):
    """A light as written: its kind, and the arguments of its class.

    Colours are not read yet, and a shadow is True, False or (size, filter).
    """

    kind: str
    settings: dict


def light(text) -> LightArgument:
    """KIND:numbers,name=value,..."""
    kind, _, rest = text.partition(":")
    if kind not in LIGHTS:
        legal = ", ".join(f"{name}:..." for name in LIGHTS)
        raise argparse.ArgumentTypeError(f"a light is one of {legal}; given {text!r}")
    numbers, names = LIGHTS[kind]
    if numbers is None:
        return LightArgument(kind, {"color": values.color(rest.removeprefix("color=") or "1")})
    parts = rest.split(",")
    settings = {numbers: values.vector(",".join(parts[:3]))}
    for part in parts[3:]:
        name, _, value = part.partition("=")
        if name not in names or not value:
            legal = ", ".join(f"{name}=..." for name in names)
            raise argparse.ArgumentTypeError(f"a {kind} light takes {legal}; given {part!r}")
        try:
            settings[name] = _READERS.get(name, str)(value)
        except argparse.ArgumentTypeError as fault:
            raise argparse.ArgumentTypeError(f"{name}: {fault}") from None
    for name in _NEEDED.get(kind, ()):
        if name not in settings:
            raise argparse.ArgumentTypeError(f"a {kind} light needs {name}=X/Y/Z; given {text!r}")
    return LightArgument(kind, settings)


def _slashed(text) -> tuple[float, ...]:
    return values.vector(text, "/")


def _attenuation(text):
    """KC/KL/KQ as numbers; what else there is stays text, as the classes of lights read it."""
    return text if text.startswith("1/(") or "d" in text or "/" not in text else _slashed(text)


def _resolution(text) -> tuple[int, ...]:
    if not re.fullmatch(r"\d{1,9}/\d{1,9}", text):
        raise argparse.ArgumentTypeError(f"M/N is needed, two whole numbers; given {text!r}")
    return tuple(map(int, text.split("/")))


def _shadow(text):
    """True, False, or (size, filter)."""
    if text in ("yes", "no"):
        return text == "yes"
    match = re.fullmatch(r"(\d{1,9})(?:/(\d{1,9}))?", text)
    if not match:
        raise argparse.ArgumentTypeError(f"yes, no, SIZE or SIZE/FILTER is needed; given {text!r}")
    return int(match[1]), int(match[2] or 1)


_READERS = {
    "color": values.color,
    "direction": _slashed,
    "edge_u": _slashed,
    "edge_v": _slashed,
    "attenuation": _attenuation,
    "inner": values.number,
    "outer": values.number,
    "exponent": values.number,
    "falloff": values.number,
    "range": values.number,
    "resolution": _resolution,
    "amplify": values.yes_or_no,
    "shadow": _shadow,
}
