"""What is written behind flags, as values: numbers, colours, materials `NAME,KEY=VALUE,...`, lights `TYPE:...`.

Each function is the type of an argument: text to value, ArgumentTypeError where it is none. Nothing heavy is imported
before a light is made.
"""

import argparse
import re

from ..choices import EDGE_TYPES, VIEWS
from ..errors import SceneError, faults_of

_MAX_PROCESSES = 1024


def number(text) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf"):
        raise argparse.ArgumentTypeError(f"a finite number is needed; given {text!r}")
    return value


def scale(text) -> float | str:
    """A finite number, or auto."""
    return text if text == "auto" else number(text)


def fraction(text) -> float:
    """A finite number, or one over another: 1/4096."""
    above, slash, below = text.partition("/")
    if slash and number(below) == 0.0:
        raise argparse.ArgumentTypeError(f"a finite number is needed, such as 0.001 or 1/4096; given {text!r}")
    return number(above) / number(below) if slash else number(text)


def percentage(text) -> float:
    """A number, or per cent: 0.1 or 10%."""
    return number(text[:-1]) / 100.0 if text.endswith("%") else number(text)


def whole(text) -> int:
    """A whole number."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"a whole number is needed; given {text!r}") from None


def processes(text) -> int:
    """How many processes."""
    if not text.isdecimal() or not 1 <= int(text[:9]) <= _MAX_PROCESSES:
        raise argparse.ArgumentTypeError(f"1 to {_MAX_PROCESSES} processes are legal; given {text!r}")
    return int(text)


def picture_size(text) -> tuple[int, int]:
    """800x600, 800,600, or 512 for a square."""
    match = re.fullmatch(r"(\d{1,9})(?:[xX×,*](\d{1,9}))?", text)
    if not match:
        raise argparse.ArgumentTypeError(f"WIDTHxHEIGHT or one number is needed, in pixels; given {text!r}")
    width, height = match.groups()
    return int(width), int(height or width)


def vector(text, separator=",") -> tuple[float, ...]:
    """Three numbers."""
    parts = text.split(separator)
    if len(parts) != 3:
        form = separator.join("XYZ")
        raise argparse.ArgumentTypeError(f"three numbers {form} are needed; given {text!r}")
    return tuple(number(part) for part in parts)


def limits(text) -> tuple[float, ...]:
    """Read two numbers with a comma between."""
    values = tuple(map(number, text.split(",")))
    if len(values) != 2:
        raise argparse.ArgumentTypeError(f"two numbers with a comma between are needed; given {text!r}")
    return values


def axis(text) -> str:
    """The name of an axis, in small letters and without a plus sign."""
    return text.lower().removeprefix("+")


def yes_or_no(text) -> bool:
    """A truth value."""
    if text not in ("yes", "no"):
        raise argparse.ArgumentTypeError(f"yes or no is needed; given {text!r}")
    return text == "yes"


def color(text):
    """A linear grey or triple as numbers; anything else stays text, to be read as hex or a CSS name."""
    if re.fullmatch(r"\d+([/,]\d+){2}", text) and max(levels := [int(each) for each in re.split("[/,]", text)]) > 1:
        hint = 'sRGB is written "#{:02x}{:02x}{:02x}"'.format(*levels) if max(levels) <= 255 else "sRGB is #rrggbb"
        raise argparse.ArgumentTypeError(f"a color is linear, 1 is white; given {text!r}: {hint}, 2.0 is above white")
    if re.fullmatch(r"[-+.\d]+([eE][-+]?\d+)?", text):
        return number(text)
    return vector(text, "/") if "/" in text else text


def shading_method(text) -> str:
    """A shading method, with +N behind Gouraud's for a model whose triangles are cut in four N times."""
    if not re.fullmatch(r"flat|lambert|phong|gouraud(\+([1-9]|1[0-5]))?", text):
        legal = "flat, lambert, gouraud, gouraud+N with N from 1 to 15, phong"
        raise argparse.ArgumentTypeError(f"one or several of {legal}, with commas, are needed; given {text!r}")
    return text


def list_of(read, legal=()):
    """The type of values between commas, each once; `read` makes one of a text, `legal` has them all where they are
    few."""

    def values(text) -> tuple:
        found = tuple(dict.fromkeys(read(part) for part in text.split(",")))
        for value in found:
            if legal and value not in legal:
                words = list(map(str, legal))
                needed = f"one or several of {', '.join(words)}, with commas, are needed"
                raise argparse.ArgumentTypeError(f"{needed}; given {text!r}")
        return found

    values.legal = legal  # for the completion of shells
    return values


edge_types = list_of(str, EDGE_TYPES)
_MAX_VIEWS = 1_000_000


def views(text) -> tuple[str, ...]:
    """Names of views between commas, and random:N for N random ones."""
    named = list_of(str, (*VIEWS, "random:20"))
    for word in text.split(","):
        match = re.fullmatch(r"random(?::(\d{1,9}))?", word)
        if not match:
            named(word)
        elif not 1 <= int(match[1] or 1) <= _MAX_VIEWS:
            raise argparse.ArgumentTypeError(f"random:N makes 1 to {_MAX_VIEWS} views; given {word!r}")
    return tuple(text.split(","))


views.legal = (*VIEWS, "random:20")  # for the completion of shells


def seed(text) -> int:
    """A whole number of at least 0."""
    if not re.fullmatch(r"\d{1,18}", text):
        raise argparse.ArgumentTypeError(f"a whole number of at least 0 is needed; given {text!r}")
    return int(text)


def depth_cue(text):
    """SCALE[,start=S][,color=C] as the arguments of a DepthCue, or none."""
    if text == "none":
        return None
    first, *rest = text.split(",")
    settings, readers = {"scale": number(first)}, {"start": number, "color": color}
    for part in rest:
        key, _, value = part.partition("=")
        if key not in readers or not value:
            raise argparse.ArgumentTypeError(f"SCALE[,start=S][,color=C] or none is needed; given {text!r}")
        settings[key] = readers[key](value)
    return settings


def _read_settings(parts, readers, what) -> dict:
    """Read NAME=VALUE texts, each by the reader of its name; a fault says what is at fault, and `what` takes."""
    settings = {}
    for part in parts:
        name, _, text = part.strip().partition("=")
        if name not in readers or not text:
            legal = ", ".join(f"{name}=..." for name in readers)
            raise argparse.ArgumentTypeError(f"{what} takes {legal}; given {part!r}")
        try:
            settings[name] = readers[name](text)
        except argparse.ArgumentTypeError as fault:
            raise argparse.ArgumentTypeError(f"{name}: {fault}") from None
    return settings


_NEXT = r",(?=\s*\w+=)"  # a comma that no NAME= follows belongs to the value, as in rgb(1,2,3) or a file's name


# --- materials --------------------------------------------------------------------------------------------------------


def material(text) -> dict:
    """KEY=VALUE,..., before it the name of a material of the classic table, or that alone: fields of a Material."""
    settings, parts = {}, re.split(_NEXT, text)
    if "=" not in parts[0] and parts[0].strip() not in MATERIAL_FIELDS:
        from ..scene.material import named_fields

        try:
            settings = named_fields(parts.pop(0).strip())
        except SceneError as fault:
            raise argparse.ArgumentTypeError(f"{fault}; or KEY=VALUE, see --help") from None
    return settings | _read_settings(parts, MATERIAL_FIELDS, "a material")


def _or_none(read):
    """The type of what may be left out by the word none."""
    return lambda text: None if text == "none" else read(text)


def _roughness(text):
    """A number, or two as A/B."""
    if text.count("/") == 1:
        return tuple(number(part) for part in text.split("/"))
    return number(text)


def _slashed_vector(text):
    """X/Y/Z."""
    return vector(text, "/")


def _tangent(text):
    """The letter u, or an axis X/Y/Z."""
    return text if text == "u" else _slashed_vector(text)


MATERIAL_FIELDS = {  # all of a Material but its name: how each is read
    "ambient": color,
    "diffuse": color,
    "specular": color,
    "shininess": number,
    "emissive": color,
    "opacity": number,
    "texture": _or_none(str),
    "alpha_cutoff": _or_none(number),
    "reflection": str,  # words are checked by the Material: which models there are is known once the scene is imported
    "roughness": _roughness,
    "tangent": _tangent,
    "distribution": str,
    "fresnel": _or_none(color),
    "metallic": number,
    "metal": _or_none(color),
    "metallic_roughness": _or_none(str),
    "normalized": yes_or_no,
    "levels": whole,
    "numbers": lambda text: tuple(map(number, text.split("/"))),
}


# --- lights -----------------------------------------------------------------------------------------------------------


def make_light(text, shadow):
    """Make a light of what follows --light: its type, then the values of its class's fields.

        point:1,2,3,color=#f80,shadow=512/3
        type  first field, then NAME=VALUE

    Types and fields are those of the scene's table, so one that is added there can be written here at once.

    Parameters
    ----------
    shadow : Shadow of a light that says shadow=yes

    Returns
    -------
    a light

    Raises
    ------
    SceneError : an unknown type or name, or a value that is not legal; the message lists what is
    """
    from ..scene.lights import LIGHT_TYPES, Shadow, describe_fields
    from ..scene.plugins import find_plugin

    word, _, rest = text.partition(":")
    find_plugin(word, LIGHT_TYPES)
    if word not in LIGHT_TYPES:
        legal = ", ".join(f"{each}:..." for each in LIGHT_TYPES)
        raise SceneError(f"argument --light: a light is one of {legal}; given {text!r}")
    cls = LIGHT_TYPES[word]
    described = describe_fields(cls)
    try:
        settings = _read_light(rest, described, f"a {word} light")
    except argparse.ArgumentTypeError as fault:
        raise SceneError(f"argument --light: {fault}") from None
    for name, field in described.items():
        if field.is_needed and name not in settings:
            form = _FORMS.get(field.holds, "VALUE")
            raise SceneError(f"argument --light: a {word} light needs {name}={form}; given {text!r}")
    if own := settings.get("shadow"):  # True, or (size, filter)
        settings["shadow"] = shadow if own is True else Shadow(*own)
    with faults_of(f"{cls.__module__}.{cls.__qualname__}"):
        return cls(**settings)


def _read_light(text, described, what) -> dict:
    """Read the values of a light, by the names of its class's fields; the first may stand without its name."""
    readers = {name: _READERS.get(field.holds, str) for name, field in described.items()}
    first = next(iter(described))
    head, *parts = re.split(_NEXT, text)
    if "=" in head:
        return _read_settings([head, *parts], readers, what)
    settings = {}
    if head or described[first].is_needed:
        if described[first].holds == "vector":
            settings[first] = vector(head)  # written with commas, as for --eye
        else:
            settings = _read_settings([f"{first}={head}"], readers, what)
    return settings | _read_settings(parts, readers, what)


def _attenuation(text):
    """KC/KL/KQ as numbers; what else there is stays text, as the classes of lights read it."""
    return text if text.startswith("1/(") or "d" in text or "/" not in text else _slashed_vector(text)


def _cells(text) -> tuple[int, ...]:
    """M/N, two whole numbers."""
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


# By what a field holds, see `describe_fields`; words and text are checked by the class.
_READERS = {
    "number": number,
    "whole": whole,
    "flag": yes_or_no,
    "vector": _slashed_vector,
    "cells": _cells,
    "color": color,
    "attenuation": _attenuation,
    "shadow": _shadow,
}
_FORMS = {"vector": "X/Y/Z", "cells": "M/N", "flag": "yes", "color": "COLOR", "attenuation": "KC/KL/KQ"}
