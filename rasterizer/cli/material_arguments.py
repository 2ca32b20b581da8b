"""`--material KEY=VALUE,...`: fields of every material of a model, as written."""

import argparse
import re

from . import values

REFLECTIONS = ("phong", "blinn", "lambert", "oren-nayar", "cook-torrance", "toon")
DISTRIBUTIONS = ("ggx", "beckmann")


def _or_none(read):
    """The type of what may be left out by the word none."""
    return lambda text: None if text == "none" else read(text)


FIELDS = {  # all of a Material but its name: how each is read
    "ambient": values.color,
    "diffuse": values.color,
    "specular": values.color,
    "shininess": values.number,
    "emissive": values.color,
    "opacity": values.number,
    "texture": _or_none(str),
    "reflection": values.word_of(REFLECTIONS),
    "roughness": values.number,
    "distribution": values.word_of(DISTRIBUTIONS),
    "fresnel": _or_none(values.number),
    "normalized": values.yes_or_no,
    "levels": values.whole,
}


def material(text) -> dict:
    """KEY=VALUE,...; a comma that no KEY= follows belongs to the value, as in rgb(1,2,3) or a file's name."""
    settings = {}
    for part in re.split(r",(?=\s*\w+=)", text):
        key, sign, value = part.strip().partition("=")
        if key not in FIELDS or not sign or not value:
            legal = ", ".join(f"{name}=..." for name in FIELDS)
            raise argparse.ArgumentTypeError(f"a material takes {legal}; given {part!r}")
        try:
            settings[key] = FIELDS[key](value)
        except argparse.ArgumentTypeError as fault:
            raise argparse.ArgumentTypeError(f"{key}: {fault}") from None
    return settings
