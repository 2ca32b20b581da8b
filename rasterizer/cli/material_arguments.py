"""`--material [NAME,]KEY=VALUE,...`: fields of every material of a model, as written, or of one that has a name."""

import argparse
import re

from ..choices import DISTRIBUTIONS
from ..errors import SceneError
from . import values
from .suggestions import did_you_mean


def _or_none(read):
    """The type of what may be left out by the word none."""
    return lambda text: None if text == "none" else read(text)


def _roughness(text):
    """A number, or two as A/B."""
    if text.count("/") == 1:
        return tuple(values.number(part) for part in text.split("/"))
    return values.number(text)


def _tangent(text):
    """The letter u, or an axis X/Y/Z."""
    return text if text == "u" else values.vector(text, "/")


FIELDS = {  # all of a Material but its name: how each is read
    "ambient": values.color,
    "diffuse": values.color,
    "specular": values.color,
    "shininess": values.number,
    "emissive": values.color,
    "opacity": values.number,
    "texture": _or_none(str),
    "reflection": str,  # which models there are is known once the scene is imported
    "roughness": _roughness,
    "tangent": _tangent,
    "distribution": values.word_of(DISTRIBUTIONS),
    "fresnel": _or_none(values.color),
    "normalized": values.yes_or_no,
    "levels": values.whole,
}


def material(text) -> dict:
    """KEY=VALUE,..., before it the name of a material of the classic table, or that alone.

    A comma that no KEY= follows belongs to the value, as in rgb(1,2,3) or a file's name.
    """
    settings, parts = {}, re.split(r",(?=\s*\w+=)", text)
    if "=" not in parts[0]:
        from ..scene.material import named_fields  # help is shown without it, and so without numpy

        try:
            settings = named_fields(parts.pop(0).strip())
        except SceneError as fault:
            legal = ", ".join(f"{name}=..." for name in FIELDS)
            raise argparse.ArgumentTypeError(f"a material takes {legal}; {fault}") from None
    for part in parts:
        key, sign, value = part.strip().partition("=")
        if key not in FIELDS or not sign or not value:
            legal = ", ".join(f"{name}=..." for name in FIELDS)
            meant = did_you_mean(key, FIELDS)
            raise argparse.ArgumentTypeError(f"a material takes {legal}; given {part!r}{meant}")
        try:
            settings[key] = FIELDS[key](value)
        except argparse.ArgumentTypeError as fault:
            raise argparse.ArgumentTypeError(f"{key}: {fault}") from None
    return settings
