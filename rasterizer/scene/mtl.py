"""Read MTL material files: trimesh rounds Ka Kd Ks to 8 bits, and leaves Ke d Tr illum as text.

How a file's values become a `Material`; coefficients are linear, one number stands for a grey:

    Kd       diffuse; missing: the default grey
    Ka       ambient, as the file says, also the 0 0 0 or 1 1 1 that exporters write unasked; missing: as Kd
    Ks       specular; missing: none
    Ns       shininess, at least 1; missing: the default
    Ke       emissive; missing: none
    d, Tr    opacity d, or 1 - Tr; d wins where both are given
    illum 0  the plain colour Kd (+ Ke), not lit at all: it becomes emissive, and everything else 0
    illum 1  no specular; all other models: the equation as usual
    map_..   textures are not drawn: reported

Format: Wavefront, MTL specification 4.2, 1995.
"""

import math

from rasterizer.scene.material import Material
from rasterizer.scene.parse import ModelFile, text_of

_COLORS = ("ka", "kd", "ks", "ke")
_NUMBERS = ("ns", "d", "tr", "illum")


def read_materials(library: ModelFile) -> dict[str, Material]:
    """Read the materials of an MTL file.

    Parameters
    ----------
    library : ModelFile with the bytes of the MTL file

    Returns
    -------
    dict, name to Material

    Raises
    ------
    ModelError : a coefficient is not a number, negative or not finite; the message names the file and the
        line
    """
    materials, name, values = {}, None, {}
    for line_number, line in enumerate(text_of(library.data).replace("\r\n", "\n").split("\n"), 1):
        key, _, rest = line.strip().replace("\t", " ").partition(" ")
        key, rest = key.lower(), rest.strip()
        if key == "newmtl":
            if name is not None:
                materials[name] = _material(name, values)
            name, values = rest, {}
        elif key in _COLORS + _NUMBERS:
            values[key] = _numbers(library, line_number, key, rest)
        elif key.startswith(("map_k", "map_d")):
            library.log(f"{library.name}: texture '{rest}' of material '{name}' is not drawn by this version")
    if name is not None:
        materials[name] = _material(name, values)
    return materials


def _numbers(library, line_number, key, rest):
    """Return the numbers of one line: three for a colour, else one; None for a spectral or xyz colour."""
    words = rest.split("#")[0].split()
    if key in _COLORS and words[:1] and words[0].lower() in ("spectral", "xyz"):
        library.log(f"{library.name}:{line_number}: the {words[0]} form of a colour is not read")
        return None
    words = [word for word in words if word.lower() != "-halo"]
    try:
        numbers = [float(word) for word in words[: 3 if key in _COLORS else 1]]
    except ValueError:
        numbers = []
    if not numbers or not all(math.isfinite(number) and number >= 0.0 for number in numbers):
        raise library.error(
            f"'{key}' takes numbers that are finite and not negative, not '{rest}'", line_number
        )
    if key in _NUMBERS:
        return numbers[0]
    return tuple(numbers) if len(numbers) == 3 else (numbers[0],) * 3


def _material(name, values) -> Material:
    """Turn the values of one material into the coefficients of the illumination equation."""
    given = {key: value for key, value in values.items() if value is not None}
    coefficients = {"specular": given.get("ks", 0.0), "emissive": given.get("ke", 0.0), "name": name}
    if "kd" in given:
        coefficients["diffuse"] = given["kd"]
    if "ka" in given:
        coefficients["ambient"] = given["ka"]
    if "ns" in given:
        coefficients["shininess"] = max(given["ns"], 1.0)
    opacity = given.get("d", 1.0 - given.get("tr", 0.0))
    coefficients["opacity"] = min(max(opacity, 0.0), 1.0)
    if given.get("illum") == 0.0:
        plain = Material(**coefficients)
        glow = tuple(kd + ke for kd, ke in zip(plain.diffuse, plain.emissive, strict=True))
        coefficients |= {"ambient": 0.0, "diffuse": 0.0, "specular": 0.0, "emissive": glow}
    elif given.get("illum") == 1.0:
        coefficients["specular"] = 0.0
    return Material(**coefficients)
