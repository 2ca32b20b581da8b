"""Read MTL material files: those that an OBJ file names, and of them the materials that it uses.

How a file's values become a `Material` is said in `scene/of_mtl.py`; what is marked (w) is warned of, with file and
line. Options of maps:

    -clamp   on: "clamp", else "repeat"
    -s -o    texture coordinates times -s plus -o, of map_Kd for both
    others   are not applied: -t and -mm (w) where they would change the picture, a -colorspace other than sRGB (w),
             else reported. Other maps are not drawn (w)

A picture that is missing or unreadable is warned of, and the material keeps its plain colour. Names of files are
relative to the MTL file; which of them are read is said in `files.py`. With illum 0 a texture needs light all the same.

Format: Wavefront, MTL specification 4.2, 1995.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from io import BytesIO
from itertools import chain
from pathlib import Path

import numpy as np

from ..errors import ModelError, cut
from ..scene.material import Material
from ..scene.of_mtl import COLORS, NUMBERS, material_of, value_of
from ..scene.texture import Texture, decode_ahead, read_picture
from ..scene.triangulation import listed
from .files import OutsideError, identity_of
from .model_file import ModelFile, name_in, text_of

LONGEST_NAME = 4096  # letters of a file's name, with its folders; no system takes longer ones
MAX_LIBRARIES = 256  # material files that an OBJ file may name
_MAPS = ("map_", "bump", "disp", "decal", "refl", "norm")  # the first letters of all keywords that name a picture
# How many words follow an option at most; where that is more than one, the second and third must be numbers.
_OPTIONS = {"-s": 3, "-o": 3, "-t": 3, "-mm": 2} | dict.fromkeys(
    ("-blendu", "-blendv", "-boost", "-cc", "-clamp", "-colorspace", "-imfchan", "-texres", "-bm", "-type"), 1
)
_PHYSICAL = ("pr", "pm", "ps", "pc", "pcr", "aniso", "anisor")  # of roughness, metals, sheen, coats
# Values of those options that would change what is drawn, with which they don't.
_NEUTRAL = {"-t": [0.0, 0.0, 0.0], "-mm": [0.0, 1.0]}

Place = tuple[
    tuple[float, float], tuple[float, float]
]  # of a picture: texture coordinates times the first, plus the second


def find_materials(
    model: ModelFile, libraries: list[str], names: list[str]
) -> tuple[dict[str, Material], dict[str, Place]]:
    """Read the MTL files that an OBJ file names.

    Parameters
    ----------
    model : the OBJ file
    libraries : what stands on its `mtllib` lines: a name, which may hold blanks, or several
    names : those of the materials that it uses, each once

    Returns
    -------
    dict, name to Material, of those that were found; and dict, name to Place, of those whose textures are laid
    otherwise than the texture coordinates say

    Warns
    -----
    UserWarning : files or materials that are missing
    """
    materials, missing, maps = {}, [], Maps(model)
    wanted = list(dict.fromkeys(libraries))[:MAX_LIBRARIES]
    # A name with blanks is written like several names; what was read to find out is not read again.
    known = {}  # under several names it is one file
    found = {name: _library(model, name, known) for name in wanted if len(name) < 256}
    named = list(dict.fromkeys(chain(*([name] if found.get(name) else name.split() for name in wanted))))
    if len(named) > MAX_LIBRARIES:
        model.warn(f"names {len(named)} material files; the first {MAX_LIBRARIES} are looked for")
    read = set()
    for name in named[:MAX_LIBRARIES]:
        library = found[name] if name in found else _library(model, name, known)
        if library is None:
            missing.append(name)
        elif id(library) not in read:
            read.add(id(library))
            materials |= read_materials(library, set(names), maps)
    unknown = [name for name in names if name not in materials]
    lacking = []
    if missing:
        lacking.append(f"material file {listed([_quoted(name) for name in missing])} not found")
    if unknown:
        lacking.append(f"no definition of material {listed([_quoted(name) for name in unknown])}; the default is used")
    if lacking:
        model.warn("; ".join(lacking))
    return materials, maps.places


def _quoted(name: str) -> str:
    """Return a name for a message."""
    return f"'{name[:80]}'"


def _library(model, name, known) -> ModelFile | None:
    """Return an MTL file beside the model, or None; `known` are those that were read, by their identity."""
    if len(name) > LONGEST_NAME:
        return None
    try:
        path = model.beside.find_alike(name)
        identity = identity_of(path)
        if identity in known:
            return known[identity]
        data = model.beside.read_bytes(path)
    except OutsideError as fault:
        model.warn(f"material file '{cut(name, 80)}' {fault}")
        return None
    except (OSError, ValueError):
        return None
    beside = model.beside.below(path.parent)
    known[identity] = ModelFile(str(path), "mtl", data, beside, model.log, model.limits)
    return known[identity]


def read_materials(library: ModelFile, used: set[str], maps: "Maps") -> dict[str, Material]:
    """Read the materials of an MTL file.

    Parameters
    ----------
    library : ModelFile with the bytes of the MTL file; its folder is where textures are looked for
    used : names of the materials that are read; of the others nothing is made or warned of
    maps : the pictures read so far

    Returns
    -------
    dict, name to Material

    Warns
    -----
    UserWarning : a line that can't be read or is taken otherwise than it stands there, with file and line; a texture
        that can't be
    """
    doubts, found = set(), {}  # pairs of a line and what is doubtful about it
    blocks = _blocks(library)
    is_opacity = _is_tr_opacity(library, [values for _, values, _ in blocks])
    ambient = [values["ka"] for _, values, _ in blocks if "ka" in values]
    if ambient and not any(any(color) for color, _ in ambient):
        library.tell("'Ka 0 0 0' of all materials is taken as their Kd", ambient[0][1])
        for _, values, _ in blocks:
            values.pop("ka", None)
    needed = [block for block in blocks if block[0] in used]
    maps.decode_ahead(library, [values[key] for _, values, _ in needed for key in ("map_kd", "map_d") if key in values])
    for name, values, faults in needed:
        texture = maps.texture(library, name, values.get("map_kd"), values.get("map_d"))
        doubts.update(faults)
        found[name] = material_of(name_in(name), values, texture, is_opacity, doubts, library.tell)
        used_map = values.get("map_kd") or values.get("map_d")
        if used_map is not None and used_map[2] is not None:
            maps.places[name] = used_map[2]
    for line, text in sorted(doubts):
        library.warn(text, line or None)
    return found


def _blocks(library) -> list[tuple[str, dict, list]]:
    """Return the name, the values and the faults of every material; a value is (number or colour, line), a map (name,
    wrap)."""
    blocks, name, values, faults, physical = [], None, {}, [], {}
    lines = text_of(library.data).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    for line_number, line in enumerate(lines, 1):
        key, _, rest = line.strip().replace("\t", " ").partition(" ")
        key, rest = key.lower(), rest.strip()
        if key == "newmtl":
            if name is not None:
                blocks.append((name, values, faults))
            name, values, faults = rest, {}, []
        elif key in COLORS + NUMBERS:
            number, fault = value_of(key, rest)
            if fault:
                faults.append((line_number, fault))
            if number is not None:
                values[key] = number, line_number
        elif key in _PHYSICAL:
            physical.setdefault(key.title(), line_number)
        elif key.startswith(_MAPS) and not rest:
            faults.append((line_number, f"{key} names no picture; the line is left out"))
        elif key in ("map_kd", "map_d", "map_ka"):
            values[key], ignored = _map_line(library, line_number, key, rest)
            faults += [(line_number, fault) for fault in ignored]
        elif key.startswith(_MAPS):
            faults.append((line_number, f"the texture '{cut(rest, 80)}' ({key}) is not drawn"))
    if name is not None:
        blocks.append((name, values, faults))
    for key, line_number in physical.items():
        library.tell(f"{key} is not used: materials of MTL files are lit by Kd, Ks and Ns", line_number)
    for name, values, faults in blocks:
        ambient = values.pop("map_ka", None)
        if ambient is not None and "map_kd" not in values:
            values["map_kd"] = ambient
            faults.append((0, f"'{cut(name, 80)}' has a map_Ka and no map_Kd: it is taken as that"))
    return blocks


def _is_tr_opacity(library, blocks) -> bool:
    """Tell whether `Tr` is the opacity in a file; see the module's docstring. Files have three digits or more."""
    pairs = [(values["d"][0], values["tr"][0]) for values in blocks if "d" in values and "tr" in values]
    as_opacity = sum(abs(d - tr) < 1e-3 <= abs(1 - d - tr) for d, tr in pairs)
    as_rest = sum(abs(1 - d - tr) < 1e-3 <= abs(d - tr) for d, tr in pairs)
    if as_opacity != as_rest:
        return as_opacity > as_rest
    alone = [values["tr"][0] for values in blocks if "tr" in values and "d" not in values]
    comments = re.findall(rb"#[^\r\n]*", library.data)
    return any(b"meshlab" in comment.lower() for comment in comments) or (1.0 in alone and 0.0 not in alone)


def _map_line(library, line_number, key, rest) -> tuple[tuple[str, str, Place | None], list[str]]:
    """Return the name of the picture that a line gives, which may hold blanks, how it is wrapped and laid, and
    doubts. Options stand before the name, or behind it."""
    options, words = _options_in(rest.split(), 1)
    behind = next((k for k, word in enumerate(words) if k and word.lower() in _OPTIONS), len(words))
    more, others = _options_in(words[behind:], 0)
    if not others:
        options, words = options + more, words[:behind]
    wrap, scale, offset, ignored = "repeat", (1.0, 1.0), (0.0, 0.0), []
    for option, values in options:
        numbers = [*map(float, values)] if all(map(_is_number, values)) else []
        if option == "-clamp":
            wrap = "clamp" if values and values[0].lower() == "on" else "repeat"
        elif option == "-s" and numbers:
            scale = (*numbers[:2], 1.0)[:2]
        elif option == "-o" and numbers:
            offset = (*numbers[:2], 0.0)[:2]
        elif option != "-colorspace" or "srgb" not in "".join(values).lower():
            fault = f"the option '{option} {' '.join(values)}' of {key} is not applied"
            neutral = _NEUTRAL.get(option, [])[: len(values)]
            if option == "-colorspace" or (neutral and numbers and numbers != neutral):
                ignored.append(fault)
            else:
                library.tell(fault, line_number)
    is_moved = (scale, offset) != ((1.0, 1.0), (0.0, 0.0)) and np.isfinite((scale, offset)).all()
    return (" ".join(words), wrap, (scale, offset) if is_moved else None), ignored


def _options_in(words, n_kept) -> tuple[list[tuple[str, list[str]]], list[str]]:
    """Return the options that words begin with, with their values, and what follows: at least `n_kept` words."""
    found, at, last = [], 0, len(words) - n_kept
    while at < last and words[at].lower() in _OPTIONS:
        option, end = words[at].lower(), min(at + 2, last)
        while end - at - 1 < _OPTIONS[option] and end < last and _is_number(words[end]):
            end += 1
        found.append((option, words[at + 1 : end]))
        at = end
    return found, words[at:]


def _is_number(word) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


# --- textures -----------------------------------------------------------------------------------------------


@dataclass(eq=False)
class Maps:
    """Read the textures of materials, every picture once; materials with the same maps share a `Texture`.

    Parameters
    ----------
    model : ModelFile that names the material files, or the pictures
    """

    model: ModelFile
    places: dict[str, Place] = field(default_factory=dict)
    _pictures: dict[Path, np.ndarray | None] = field(default_factory=dict)
    _textures: dict[tuple, Texture | None] = field(default_factory=dict)
    _contents: dict[Path, bytes] = field(default_factory=dict)
    _decoded: dict[Path, np.ndarray] = field(default_factory=dict)

    def decode_ahead(self, library, maps) -> None:
        """Decode the pictures of maps (name, wrap) on threads."""
        self._decoded = decode_ahead(self._list_pictures(library, maps))

    def _list_pictures(self, library, maps) -> Iterator[tuple[Path, bytes]]:
        """Yield the path and the bytes of each picture, up to one that can't be found."""
        try:
            for name, *_ in maps:
                path = library.beside.find_alike(name)
                if path not in self._pictures and path not in self._contents:
                    self._contents[path] = library.beside.read_bytes(path)
                    yield path, self._contents[path]
        except (OSError, ValueError):
            return  # what is wrong is said where it is read

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
            self._textures[key] = self.model.textures.add(self._mix(*key))
        return self._textures[key]

    def _path(self, library, material, given) -> Path | None:
        """Return the file of a map once it has been read; None, and a warning, where that fails."""
        if given is None:
            return None
        what = f"texture '{cut(given[0], 80)}' of material '{cut(material, 80)}'"
        try:
            if len(given[0]) > LONGEST_NAME:
                raise ValueError("too long a name")
            path = library.beside.find_alike(given[0])
            content = self._contents.pop(path, None)
            if content is None and path not in self._pictures:
                content = library.beside.read_bytes(path)
        except (OSError, ValueError) as fault:  # also a name that the system refuses
            reason = fault if isinstance(fault, OutsideError) else "not found"
            library.warn(f"{what} {reason}; the material keeps its plain colour")
            return None
        if path not in self._pictures:
            try:
                decoded = self._decoded.pop(path, None)
                self._pictures[path] = read_picture(BytesIO(content), path.name, self.model.textures, decoded)
            except ModelError as fault:
                self._pictures[path] = None
                library.warn(f"{what}: {fault}; the material keeps its plain colour")
        return None if self._pictures[path] is None else path

    def _mix(self, color_path, alpha_path, wrap) -> Texture:
        """Make the texture of one or two pictures that have been read; they are fitted to the file's budget."""
        fitted = self.model.textures.fitted
        if color_path is None:
            grey = _grey(fitted(self._pictures[alpha_path]))
            image = np.ones((*grey.shape, 4), np.float32)
            image[..., 3] = grey
            return Texture(image, wrap=wrap, name=str(alpha_path))
        texture = Texture(fitted(self._pictures[color_path]), wrap=wrap, name=str(color_path))
        if alpha_path is None or alpha_path == color_path:
            return texture
        grey = _grey(fitted(self._pictures[alpha_path]))
        height, width = np.maximum(grey.shape, texture.shape)
        layers = [*np.moveaxis(texture.image[..., :3], 2, 0), grey]
        return replace(texture, image=np.dstack([_resized(layer, width, height) for layer in layers]))


def _resized(layer, width, height) -> np.ndarray:
    """Return an array (h, w) float32 in another size, bilinearly: itself where it is the same."""
    from PIL import Image

    if layer.shape == (height, width):
        return layer
    return np.asarray(Image.fromarray(layer).resize((width, height), Image.Resampling.BILINEAR))


def _grey(picture) -> np.ndarray:
    """The values of a picture (h, w) float32 within 0..1, as they are, not decoded; of colours their mean."""
    colors = picture if picture.ndim == 2 else picture[..., : 1 if picture.shape[2] == 2 else 3].mean(axis=2)
    return (colors / 255.0).astype(np.float32)
