"""Types of arguments: text to value, ArgumentTypeError where it is none. They import nothing heavy."""

import argparse
import re

from .suggestions import did_you_mean


def number(text) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf"):
        raise argparse.ArgumentTypeError(f"a finite number is needed; given {text!r}")
    return value


def fraction(text) -> float:
    """A finite number, or one over another: 1/4096."""
    above, slash, below = text.partition("/")
    if slash and number(below) == 0.0:
        raise argparse.ArgumentTypeError(f"a finite number is needed, such as 0.001 or 1/4096; given {text!r}")
    return number(above) / number(below) if slash else number(text)


def method(text) -> str:
    """A shading method, with +N behind Gouraud's for a model whose triangles are cut in four N times."""
    if not re.fullmatch(r"flat|lambert|phong|gouraud(\+([1-9]|1[0-5]))?", text):
        legal = "flat, lambert, gouraud, gouraud+N with N from 1 to 15, phong"
        raise argparse.ArgumentTypeError(f"one or several of {legal}, with commas, are needed; given {text!r}")
    return text


def list_of(read, legal=None):
    """The type of values between commas, each once; `read` makes one of a text."""

    def values(text) -> tuple:
        found = tuple(dict.fromkeys(read(part) for part in text.split(",")))
        for value in found:
            if legal is not None and value not in legal:
                words = ", ".join(map(str, legal))
                meant = did_you_mean(str(value), map(str, legal))
                raise argparse.ArgumentTypeError(
                    f"one or several of {words}, with commas, are needed; given {text!r}{meant}"
                )
        return found

    values.legal = legal or ()  # for the completion of shells
    return values


def whole(text) -> int:
    """A whole number."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"a whole number is needed; given {text!r}") from None


def vector(text, separator=",") -> tuple[float, ...]:
    """Three numbers."""
    parts = text.split(separator)
    if len(parts) != 3:
        form = separator.join("XYZ")
        raise argparse.ArgumentTypeError(f"three numbers {form} are needed; given {text!r}")
    return tuple(number(part) for part in parts)


def share(text) -> float:
    """A share as a number, or in per cent: 0.1 or 10%."""
    return number(text[:-1]) / 100.0 if text.endswith("%") else number(text)


def axis(text) -> str:
    """The name of an axis, in small letters and without a plus sign."""
    return text.lower().removeprefix("+")


def picture_size(text) -> tuple[int, int]:
    """800x600, 800,600, or 512 for a square."""
    match = re.fullmatch(r"(\d{1,9})(?:[xX×,*](\d{1,9}))?", text)
    if not match:
        raise argparse.ArgumentTypeError(f"WIDTHxHEIGHT or one number is needed, in pixels; given {text!r}")
    width, height = match.groups()
    return int(width), int(height or width)


def color(text):
    """A linear grey or triple as numbers; anything else stays text, to be read as hex or a CSS name."""
    if re.fullmatch(r"[-+.\d]+([eE][-+]?\d+)?", text):
        return number(text)
    return vector(text, "/") if "/" in text else text


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


def yes_or_no(text) -> bool:
    """A truth value."""
    if text not in ("yes", "no"):
        raise argparse.ArgumentTypeError(f"yes or no is needed; given {text!r}")
    return text == "yes"


def word_of(legal):
    """The type of a word out of `legal`."""

    def word(text) -> str:
        if text not in legal:
            meant = did_you_mean(text, legal)
            raise argparse.ArgumentTypeError(f"one of {', '.join(legal)} is needed; given {text!r}{meant}")
        return text

    return word
