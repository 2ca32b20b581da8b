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
    illum 4, 6, 7, 9 (glass) ask for rays; without d or Tr such a material is opaque
    map_Kd   texture, sRGB: it multiplies Kd and Ka; a missing Kd is 1 then. The alpha of the picture, if it has any, multiplies d
    map_d    another picture than that of map_Kd: its grey (8 bits / 255, not decoded) becomes the texture's alpha; the same
             picture: its own alpha
    -clamp   on: "clamp", else "repeat"; the other options and maps are not applied: reported

A picture that is missing or unreadable is warned of, and the material keeps its plain colour. Names of files are relative to
the MTL file; which of them are read is said in `_files`. With illum 0 a texture needs light all the same.

Format: Wavefront, MTL specification 4.2, 1995.
"""

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path

import numpy as np

from rasterizer.errors import ModelError, SceneError
from rasterizer.scene._files import OutsideError
from rasterizer.scene.material import Material
from rasterizer.scene.parse import ModelFile, text_of
from rasterizer.scene.texture import Budget, Texture, read_picture

_COLORS = ("ka", "kd", "ks", "ke")
_NUMBERS = ("ns", "d", "tr", "illum")
_MAPS = ("map_", "bump", "disp", "decal", "refl", "norm")  # the first letters of all keywords that name a picture
# How many words follow an option at most; where that is more than one, the second and third must be numbers.
_OPTIONS = {"-s": 3, "-o": 3, "-t": 3, "-mm": 2} | dict.fromkeys(
    ("-blendu", "-blendv", "-boost", "-cc", "-clamp", "-imfchan", "-texres", "-bm", "-type"), 1
)


def read_materials(library: ModelFile, used=None, maps=None) -> dict[str, Material]:
    """Read the materials of an MTL file.

    Parameters
    ----------
    library : ModelFile with the bytes of the MTL file; its folder is where textures are looked for
    used : set of names of the materials whose textures are read; None = all
    maps : Maps, the pictures read so far

    Returns
    -------
    dict, name to Material

    Raises
    ------
    ModelError : a coefficient is not a number, negative or not finite; the message names the file and the
        line

    Warns
    -----
    UserWarning : a texture is missing or can't be read
    """
    maps = Maps(library.log) if maps is None else maps
    found = {}
    for name, values in _blocks(library):
        is_used = used is None or name in used
        texture = maps.texture(library, name, values.get("map_kd"), values.get("map_d")) if is_used else None
        found[name] = _material(library, name, values, texture)
    return found


def _blocks(library) -> list[tuple[str, dict]]:
    """Return the name and the values of every material."""
    blocks, name, values = [], None, {}
    for line_number, line in enumerate(text_of(library.data).replace("\r\n", "\n").split("\n"), 1):
        key, _, rest = line.strip().replace("\t", " ").partition(" ")
        key, rest = key.lower(), rest.strip()
        if key == "newmtl":
            if name is not None:
                blocks.append((name, values))
            name, values = rest, {}
        elif key in _COLORS + _NUMBERS:
            values[key] = _numbers(library, line_number, key, rest)
        elif key in ("map_kd", "map_d"):
            values[key] = _map_line(library, line_number, key, rest)
        elif key.startswith(_MAPS):
            library.log(f"{library.name}: texture '{rest}' ({key}) of material '{name}' is not drawn by this version")
    if name is not None:
        blocks.append((name, values))
    return blocks


def _map_line(library, line_number, key, rest) -> tuple[str, str]:
    """Return the name of the picture that a line gives, which may hold blanks, and how it is wrapped."""
    words, wrap = rest.split(), "repeat"
    while len(words) > 1 and words[0].lower() in _OPTIONS:
        option = words.pop(0).lower()
        values = [words.pop(0)] if len(words) > 1 else []
        while len(values) < _OPTIONS[option] and len(words) > 1 and _is_number(words[0]):
            values.append(words.pop(0))
        if option == "-clamp":
            wrap = "clamp" if values and values[0].lower() == "on" else "repeat"
        else:
            library.log(f"{library.name}:{line_number}: the option '{option} {' '.join(values)}' of {key} is not applied")
    return " ".join(words), wrap


def _is_number(word) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


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


def _material(library, name, values, texture) -> Material:
    """Turn the values of one material into the coefficients of the illumination equation."""
    given = {key: value for key, value in values.items() if value is not None}
    coefficients = {"specular": given.get("ks", 0.0), "emissive": given.get("ke", 0.0), "name": name, "texture": texture}
    if "kd" in given:
        coefficients["diffuse"] = given["kd"]
    elif texture is not None and "map_kd" in given:
        coefficients["diffuse"] = 1.0
    if "ka" in given:
        coefficients["ambient"] = given["ka"]
    if "ns" in given:
        coefficients["shininess"] = max(given["ns"], 1.0)
    opacity = given.get("d", 1.0 - given.get("tr", 0.0))
    coefficients["opacity"] = min(max(opacity, 0.0), 1.0)
    if given.get("illum") == 0.0 and texture is not None:
        library.log(f"{library.name}: material '{name}' has illum 0 and a texture: it is lit all the same")
        coefficients["specular"] = 0.0
    elif given.get("illum") == 0.0:
        plain = Material(**coefficients)
        glow = tuple(kd + ke for kd, ke in zip(plain.diffuse, plain.emissive, strict=True))
        coefficients |= {"ambient": 0.0, "diffuse": 0.0, "specular": 0.0, "emissive": glow}
    elif given.get("illum") == 1.0:
        coefficients["specular"] = 0.0
    return Material(**coefficients)


# --- textures -----------------------------------------------------------------------------------------------


@dataclass(eq=False)
class Maps:
    """Read the textures of materials, every picture once; materials with the same maps share a `Texture`.

    Parameters
    ----------
    log : function of one text, called with what is ignored
    """

    log: Callable[[str], None]
    _pictures: dict[Path, np.ndarray | None] = field(default_factory=dict)
    _textures: dict[tuple, Texture | None] = field(default_factory=dict)
    _budget: Budget = field(default_factory=Budget)

    def texture(self, library, material, color, alpha) -> Texture | None:
        """Return the texture of a material, or None where it has none that can be read.

        Parameters
        ----------
        library : ModelFile of the MTL file
        material : text, the name of the material
        color, alpha : (name of the picture, wrap) of map_Kd and map_d, or None

        Raises
        ------
        ModelError : a picture that is larger than a texture may be

        Warns
        -----
        UserWarning : a picture is missing or can't be read
        """
        if color is None and alpha is None:
            return None
        color_path, alpha_path = (self._path(library, material, each) for each in (color, alpha))
        if color_path is None and alpha_path is None:
            return None
        key = (color_path, alpha_path, (color or alpha)[1])
        if key not in self._textures:
            self._textures[key] = self._make(library, material, *key)
        return self._textures[key]

    def _path(self, library, material, given) -> Path | None:
        """Return the file of a map once it has been read; None, and a warning, where that fails."""
        if given is None:
            return None
        what = f"{library.name}: texture '{given[0]}' of material '{material}'"
        try:
            path = library.beside.find_alike(given[0])
            content = None if path in self._pictures else library.beside.read_bytes(path)
        except (OSError, ValueError) as fault:  # also a name that the system refuses
            reason = fault if isinstance(fault, OutsideError) else "not found"
            warnings.warn(f"{what} {reason}; the material keeps its plain colour", stacklevel=2)
            return None
        if path not in self._pictures:
            try:
                self._pictures[path] = read_picture(BytesIO(content), str(path), self._budget)
            except ModelError as fault:
                self._pictures[path] = None
                warnings.warn(f"{what}: {fault}; the material keeps its plain colour", stacklevel=2)
        return None if self._pictures[path] is None else path

    def _make(self, library, material, color_path, alpha_path, wrap) -> Texture:
        """Make the texture of one or two pictures that have been read."""
        first = alpha_path if color_path is None else color_path
        self._budget.take(math.prod(self._pictures[first].shape[:2]), f"{library.name}: texture '{first.name}'")
        if color_path is None:
            grey = _grey(self._pictures[alpha_path])
            image = np.ones((*grey.shape, 4), np.float32)
            image[..., 3] = grey
            return _texture(alpha_path, image, wrap)
        texture = _texture(color_path, self._pictures[color_path], wrap)
        if alpha_path is None or alpha_path == color_path:
            return texture
        grey = _grey(self._pictures[alpha_path])
        if grey.shape != texture.image.shape[:2]:
            what = f"{library.name}: map_d '{alpha_path.name}' of material '{material}'"
            self.log(f"{what} has another size than its map_Kd; it is not applied")
            return texture
        return replace(texture, image=np.dstack([texture.image[..., :3], grey]))


def _texture(path, image, wrap) -> Texture:
    """Make a texture that is named after its file."""
    try:
        return Texture(image, wrap=wrap, name=str(path))
    except SceneError as fault:
        raise ModelError(f"{path}: {fault}") from fault


def _grey(picture) -> np.ndarray:
    """The values of a picture (h, w) float32 within 0..1, as they are, not decoded; of colours their mean."""
    colors = picture if picture.ndim == 2 else picture[..., : 1 if picture.shape[2] == 2 else 3].mean(axis=2)
    return (colors / 255.0).astype(np.float32)
