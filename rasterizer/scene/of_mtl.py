"""What the values of an MTL material say, in our terms: for its reader, and for foreign meshes that keep them.

How a file's values become a `Material`; coefficients are linear, one number stands for a grey. What is marked (w) is
warned of, with file and line; a line that can't be read (no number, not finite, negative) counts as if it weren't there
(w).

    Kd       diffuse; missing: the default grey
    Ka       ambient; missing: as Kd. So is 1 1 1 beside another Kd: Blender writes it for every material, and would
             bleach all that is coloured (reported). So is 0 0 0 where no material has more: exporters write it unasked,
             and what no lamp reaches would be black (reported)
    Ks       specular; missing: none
    Ke       emissive; missing: none
    above 1  Ka Kd Ks in whole numbers up to 255 are bytes: divided by 255 (w); else divided by their largest component
    (w):
             no surface reflects more than it gets. Ke may be as bright as it likes
    xyz      CIE XYZ, brought to linear RGB, negative components 0; `spectral` files are not read: as if missing (w)
    two      numbers of a colour: the blue is that of the first, as the format says (w)
    Ns       shininess; missing: the default. Below 1, also the 0 of diffuse surfaces: no highlight (w, if Ks is not
             0), since (R·V)^0 is 1 all over the lit side and burns it out. Above 10^6: 10^6 (w, likewise)
    d        opacity, within 0..1 (w); d 0 is invisible (w)
    Tr       without d: 1 - Tr by the format's later custom; but exporters disagree, so the file's own evidence counts
             first:
             1. materials with both d and Tr show whether Tr is d or 1 - d;
             2. else, if a comment names MeshLab, or some Tr is 1 and none is 0, Tr is the opacity: MeshLab writes it
                so, `Tr 1` for what is opaque, and nobody exports what can't be seen;
             3. else it is 1 - opacity, but Tr 1 is opaque all the same.
             Where that makes Tr an opacity (w). With d, Tr is not looked at
    illum 0  the plain colour Kd (+ Ke), not lit at all: it becomes emissive, and everything else 0
    illum 1  no specular; all other models, 2 to 10: the equation as usual; any other number: as 2 (w)
    illum 4, 6, 7, 9 (glass) ask for rays; without d or Tr such a material is opaque
    map_Kd   texture, sRGB: it multiplies Kd and Ka; a missing Kd is 1 then. The alpha of the picture, if it has any,
             multiplies d
    map_Ka   without a map_Kd: taken as that (w)
    map_d    another picture than that of map_Kd: its grey (8 bits / 255, not decoded) becomes the texture's alpha, both
             in the larger size; the same picture: its own alpha

Format: Wavefront, MTL specification 4.2, 1995.
"""

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from .material import GREY_DIFFUSE, Material
from .texture import Texture

MAX_SHININESS = 1e6  # a highlight of 0.1 degrees: smaller than a pixel of any picture
_HAIR = 1e-3  # what a colour may be below 0 by rounding
COLORS = ("ka", "kd", "ks", "ke")
NUMBERS = ("ns", "d", "tr", "illum")

Values: TypeAlias = dict[str, Any]  # a value is (number or colour, line)
Doubts: TypeAlias = set[tuple[int, str]]  # a line, and what is doubtful about it


def value_of(key: str, rest: str) -> tuple[Any, str | None]:
    """Return the number or colour of one line, None where it has none, and what is doubtful about it."""
    words = [word for word in rest.partition("#")[0].split() if word.lower() != "-halo"]
    form = words[0].lower() if key in COLORS and words else ""
    spelt = key if key in ("d", "illum") else key.capitalize()
    if form == "spectral":
        return None, f"'{spelt} {rest[:60]}': the spectral form of a colour is not read; it counts as missing"
    words = words[1:] if form == "xyz" else words
    try:
        numbers = [float(word) for word in words[: 3 if key in COLORS else 1]]
    except ValueError:
        numbers = []
    is_hair = key in COLORS and any(-_HAIR <= number < 0.0 for number in numbers)
    numbers = [0.0 if is_hair and -_HAIR <= number < 0.0 else number for number in numbers]
    if not numbers or not all(math.isfinite(number) and number >= 0.0 for number in numbers):
        what = (
            "numbers that are finite and not negative" if key in COLORS else "a number that is finite and not negative"
        )
        return None, f"'{spelt}' takes {what}, not '{rest[:60]}'; the line is left out"
    if key in NUMBERS:
        return numbers[0], None
    fault = (
        f"'{spelt} {rest[:60]}': a colour of two numbers; the third is taken as the first"
        if len(numbers) == 2
        else f"'{spelt} {rest[:60]}' is a hair below 0, which is taken"
        if is_hair
        else None
    )
    color = (numbers + [numbers[0]] * 2)[:3]
    if form == "xyz":
        from .spectrum import rgb_from_xyz  # only here: few files need it

        # The sRGB primaries with the white D65 (IEC 61966-2-1:1999).
        matrix = rgb_from_xyz(np.array([0.95047, 1.0, 1.08883]))
        color = np.clip(matrix @ np.array(color), 0.0, None).tolist()
    return tuple(color), fault


def material_of(
    name: str,
    values: Values,
    texture: Texture | None,
    is_tr_opacity: bool,
    doubts: Doubts,
    tell: Callable[[str, int], object],
) -> Material:
    """Turn the values of one material into the coefficients of the illumination equation.

    Parameters
    ----------
    name : text
    values : dict, a keyword in small letters to what `value_of` returns of it, and the line
    texture : that of map_Kd and map_d
    is_tr_opacity : whether Tr is the opacity
    doubts : gets what is doubtful
    tell : function of a fact that need not be warned of, and its line
    """
    emissive = values["ke"][0] if "ke" in values else 0.0
    coefficients: dict[str, Any] = {"name": name, "texture": texture, "specular": 0.0, "emissive": emissive}
    for key, field_name in (("kd", "diffuse"), ("ka", "ambient"), ("ks", "specular")):
        if key in values:
            coefficients[field_name] = _share(key, values[key], doubts)
    if "kd" not in values and "map_kd" not in values:
        coefficients["diffuse"] = GREY_DIFFUSE  # also under a map_d
    if coefficients.get("ambient") == (1.0, 1.0, 1.0) and coefficients.get("diffuse", 1.0) not in (
        (1.0, 1.0, 1.0),
        1.0,
    ):
        del coefficients["ambient"]
        tell(f"'Ka 1 1 1' of material '{name}' is taken as its Kd", values["ka"][1])
    illum, line = values.get("illum", (2.0, 0))
    if illum not in range(11):
        doubts.add((line, f"illum {illum:g} is none of 0..10; the material '{name}' is drawn as with illum 2"))
    if illum in (0.0, 1.0):
        coefficients["specular"] = 0.0
    _add_shininess(name, values, coefficients, doubts)
    coefficients["opacity"] = _opacity(name, values, is_tr_opacity, doubts)
    if illum == 0.0 and texture is not None:
        tell(f"material '{name}' has illum 0 and a texture: it is lit all the same", line)
    elif illum == 0.0:
        plain: Any = Material(**coefficients)
        emission = tuple(kd + ke for kd, ke in zip(plain.diffuse, plain.emissive, strict=True))
        coefficients |= {"ambient": 0.0, "diffuse": 0.0, "specular": 0.0, "emissive": emission}
    return Material(**coefficients)


def _share(key: str, given: Any, doubts: Doubts) -> Any:
    """Return a coefficient of reflection, none of its components above 1."""
    color, line = given
    largest = max(color)
    if largest <= 1.0:
        return color
    shown = " ".join([key.capitalize(), *(f"{component:g}" for component in color)])
    if largest <= 255.0 and all(component == int(component) for component in color):
        doubts.add((line, f"'{shown}' reads as bytes; it is divided by 255"))
        return tuple(component / 255.0 for component in color)
    doubts.add((line, f"'{shown}' would reflect more light than there is; it is divided by {largest:g}"))
    return tuple(component / largest for component in color)


def _add_shininess(name: str, values: Values, coefficients: dict[str, Any], doubts: Doubts) -> None:
    """Put the exponent of the highlight among the coefficients, or take the highlight away."""
    if "ns" not in values:
        return
    exponent, line = values["ns"]
    has_highlight = coefficients["specular"] != 0.0 and max(coefficients["specular"]) > 0.0
    if exponent < 1.0 and has_highlight:
        what = f"Ns {exponent:g} would spread the highlight of '{name}' over all that is lit"
        doubts.add((line, f"{what}; it is drawn without one"))
        coefficients["specular"] = 0.0
    elif exponent > MAX_SHININESS and has_highlight:
        doubts.add((line, f"Ns {exponent:g} of '{name}' is beyond {MAX_SHININESS:g}, which is taken"))
    coefficients["shininess"] = min(max(exponent, 1.0), MAX_SHININESS)


def _opacity(name: str, values: Values, is_tr_opacity: bool, doubts: Doubts) -> float:
    """Return the opacity of a material; see the module's docstring."""
    if "d" in values:
        opacity, line = values["d"]
    elif "tr" in values:
        tr, line = values["tr"]
        opacity = tr if is_tr_opacity or tr >= 1.0 else 1.0 - tr
        if opacity == tr and tr != 0.5:
            doubts.add((line, f"Tr {tr:g} of '{name}' is taken as its opacity, as MeshLab writes it: there is no d"))
    else:
        return 1.0
    if opacity > 1.0:
        doubts.add((line, f"an opacity of {opacity:g} of '{name}' is beyond 1, which is taken"))
    if opacity <= 0.0:
        doubts.add((line, f"the material '{name}' is invisible: opacity 0"))
    return min(max(opacity, 0.0), 1.0)
