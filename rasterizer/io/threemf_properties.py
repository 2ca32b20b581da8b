"""Colours and materials of a 3MF file: its groups of properties, and what they make of a mesh.

    basematerials        a name and a display color each: a material; its alpha is the opacity
    m:colorgroup         colors, one for each corner of a triangle
    m:texture2dgroup     texture coordinates, for the picture of an m:texture2d
    m:compositematerials mixtures of base materials: the mean of their colors, weighted by their shares
    m:multiproperties    layers of the others: colors are mixed by the upper one's alpha, or multiplied; the first of
                         a picture counts alone

A triangle names a group, and one of its properties for all corners, or for each; else its object does. Colors are sRGB.
Formats: 3MF Consortium, Core Specification 1.3, 2021, 5; Materials and Properties Extension 1.2, 2021.
"""

import re
import zipfile
import zlib
from collections.abc import Callable
from io import BytesIO
from typing import NamedTuple

import numpy as np

from ..errors import ModelError, warn_caller
from ..scene.color import linear_from_srgb_bytes
from ..scene.material import Material
from ..scene.texture import Budget, Texture, read_picture
from .model_file import WHITE, Part

_GROUPS = {
    "basematerials": "base", "colorgroup": "color", "texture2dgroup": "tex2coord", "compositematerials": "composite",
    "multiproperties": "multi",
}  # fmt: skip
_COLOR = re.compile("#([0-9A-Fa-f]{6})([0-9A-Fa-f]{2})?")
_WRAPS = {"wrap": "repeat", "mirror": "mirror", "clamp": "clamp", "none": "clamp"}
_DEEPEST = 4  # groups of groups: layers of mixtures of base materials
UNSET = -1


class Properties(NamedTuple):
    """The properties of a group."""

    colors: np.ndarray  # (n, 4) uint8, sRGB and alpha
    names: tuple[str, ...] = ()  # of base materials
    uv: np.ndarray | None = None  # (n, 2) of a texture
    texture: Texture | None = None


class PropertyGroups:
    """The groups of one .model part.

    Parameters
    ----------
    read : function of a path in the zip file, which returns its bytes; LookupError where there are none
    left_out : set that gets texts about what isn't used
    name : of the file, for warnings
    """

    def __init__(self, read: Callable[[str], bytes], left_out: set[str], name: str):
        self._read, self._left_out, self._name = read, left_out, name
        self._sources, self._open, self._pictures = {}, None, {}
        self._made, self._textures, self._budget = {}, {}, Budget()

    def start(self, word: str, attributes: dict) -> None:
        """Take an element of the XML."""
        if word in _GROUPS:
            self._open = self._sources[attributes["id"]] = (word, attributes, [])
        elif word == "texture2d":
            self._pictures[attributes["id"]] = attributes
        elif self._open is not None and word == _GROUPS[self._open[0]]:
            self._open[2].append(attributes)

    def end(self, word: str) -> None:
        """Take the end of an element."""
        self._open = None if word in _GROUPS else self._open

    def find(self, number: str, depth: int = 0) -> Properties | None:
        """Return the properties of a group; None for one of a kind that isn't read.

        Raises ValueError, LookupError or ModelError for one that is broken.
        """
        if number not in self._sources or depth > _DEEPEST:
            self._left_out.add(f"the group of properties {number[:40]}")
            return None
        if number not in self._made:
            word, attributes, rows = self._sources[number]
            try:
                self._made[number] = getattr(self, f"_make_{word}")(attributes, rows, depth + 1)
            except KeyError as fault:
                raise ValueError(f"an element of the {word} '{number[:40]}', or itself, has no {fault}") from fault
        return self._made[number]

    def _make_basematerials(self, _, rows, _depth) -> Properties:
        return Properties(_colors(row["displaycolor"] for row in rows), tuple(row.get("name", "") for row in rows))

    def _make_colorgroup(self, _, rows, _depth) -> Properties:
        colors = _colors(row["color"] for row in rows)
        if (colors[:, 3] < 255).any():
            self._left_out.add("the alpha of colors")
        return Properties(colors)

    def _make_texture2dgroup(self, attributes, rows, _depth) -> Properties | None:
        texture = self._texture(attributes["texid"])
        uv = np.array([(float(row["u"]), float(row["v"])) for row in rows]).reshape(-1, 2)
        return Properties(np.full((len(rows), 4), 255, np.uint8), uv=uv, texture=texture)

    def _make_compositematerials(self, attributes, rows, depth) -> Properties | None:
        base = self.find(attributes["matid"], depth)
        if base is None:
            return None
        chosen = base.colors[_indices(attributes["matindices"], len(base.colors))].astype(np.float64)
        shares = np.array([[float(word) for word in row["values"].split()] for row in rows]).reshape(-1, len(chosen))
        totals = shares.sum(axis=1, keepdims=True)
        if not ((shares >= 0.0).all() and (totals > 0.0).all() and np.isfinite(totals).all()):
            raise ValueError("the shares of a composite must be numbers of at least 0, one of them above")
        mixed = np.concatenate([linear_from_srgb_bytes(chosen[:, :3].astype(np.uint8)), chosen[:, 3:] / 255.0], axis=1)
        return Properties(_encoded(shares / totals @ mixed))

    def _make_multiproperties(self, attributes, rows, depth) -> Properties | None:
        layers = [self.find(number, depth) for number in attributes["pids"].split()]
        methods = ["", *attributes.get("blendmethods", "").split(), *["mix"] * len(layers)]
        indices = np.array([_padded(row["pindices"], len(layers)) for row in rows], np.int64).reshape(-1, len(layers))
        found = None
        for layer, method, index in zip(layers, methods, indices.T, strict=False):
            if layer is None or len(index) == 0:
                continue
            _check_range(index, len(layer.colors), "a multi")
            if found is None:
                found = layer._replace(
                    colors=layer.colors[index],
                    names=tuple(layer.names[k] for k in index.tolist()) if layer.names else (),
                    uv=None if layer.uv is None else layer.uv[index],
                )
            elif found.texture is not None or layer.texture is not None:
                self._left_out.add("layers over or under pictures")
            else:
                found = Properties(_blended(found.colors, layer.colors[index], method))
        return found

    def _texture(self, number) -> Texture | None:
        """Return the picture of an m:texture2d; None, and a UserWarning, where it can't be read."""
        if number not in self._textures:
            try:
                self._textures[number] = self._read_texture(number)
            except (
                ModelError,
                OSError,
                LookupError,
                ValueError,
                RuntimeError,
                EOFError,
                zipfile.BadZipFile,
                zlib.error,
            ) as fault:
                what = f"{self._name}: the texture {number[:40]} can't be read ({fault})"
                warn_caller(f"{what}; its triangles are drawn white")
                self._textures[number] = None
        return self._textures[number]

    def _read_texture(self, number) -> Texture:
        if number not in self._pictures:
            raise ValueError(f"there is no texture2d '{number[:40]}'")
        source = self._pictures[number]
        if "path" not in source:
            raise ValueError("it has no 'path'")
        name = source["path"].lstrip("/")
        pixels = read_picture(BytesIO(self._read(name)), f"texture '{name}'", self._budget)
        self._budget.take(pixels.shape[0] * pixels.shape[1], f"texture '{name}'")
        wraps = tuple(_wrap(source.get(key, "wrap")) for key in ("tilestyleu", "tilestylev"))
        filtered = "nearest" if source.get("filter") == "nearest" else "trilinear"
        return Texture(pixels, filter=filtered, wrap=wraps, name=name)


def paint(n_face: int, properties: dict[int, Properties], groups: np.ndarray, indices: np.ndarray) -> Part:
    """Return the fields of a part that say what its triangles look like.

    Parameters
    ----------
    properties : by the number of their group
    groups : (n_face,) int64, number of each triangle's group, UNSET where it has none
    indices : (n_face, 3) int64, the property at each corner
    """
    palette, face_material = {}, np.zeros(n_face, np.int32)
    colors, uv = np.full((n_face, 3, 3), 255, np.uint8), np.zeros((n_face, 3, 2))

    def number_of(material):
        return palette.setdefault(material, len(palette))

    order = np.argsort(groups, kind="stable")
    borders = np.flatnonzero(np.diff(groups[order])) + 1
    for faces in np.split(order, borders):
        found, index = properties.get(int(groups[faces[0]])), indices[faces]
        if found is None:
            face_material[faces] = number_of(Material())
            continue
        _check_range(index, len(found.colors), "a triangle")
        if found.names:  # one for the whole triangle
            rows, kinds = np.unique(index[:, 0], return_inverse=True)
            face_material[faces] = np.array([number_of(_base(found, row)) for row in rows.tolist()])[kinds.reshape(-1)]
        elif found.texture is not None:
            face_material[faces] = number_of(Material(diffuse=1.0, texture=found.texture))
            uv[faces] = found.uv[index]
        else:
            face_material[faces] = number_of(WHITE)
            colors[faces] = found.colors[index, :3]
    part = {"material": next(iter(palette))}
    if len(palette) > 1:
        part |= {"materials": tuple(palette), "face_material": face_material}
        del part["material"]
    if any(found is not None and found.texture is not None for found in properties.values()):
        part["uv"] = uv
    if (colors < 255).any():
        is_even = (colors == colors[:, :1]).all()
        part |= {"face_colors": colors[:, 0]} if is_even else {"colors": colors}
    return part


def _base(found, row) -> Material:
    """Return the material that a base material is."""
    diffuse = linear_from_srgb_bytes(found.colors[row : row + 1, :3])[0]
    return Material(diffuse=tuple(diffuse.tolist()), opacity=float(found.colors[row, 3]) / 255.0, name=found.names[row])


def _colors(texts) -> np.ndarray:
    """Return colors (n, 4) uint8 written as #RRGGBB or #RRGGBBAA."""
    rows = []
    for text in texts:
        found = _COLOR.fullmatch(text.strip())
        if not found:
            raise ValueError(f"a color must be #RRGGBB or #RRGGBBAA; given {text[:40]!r}")
        rows.append(bytes.fromhex(found[1] + (found[2] or "ff")))
    return np.frombuffer(b"".join(rows), np.uint8).reshape(-1, 4)


def _blended(below, above, method) -> np.ndarray:
    """Put colors (n, 4) above others."""
    below, above = below.astype(np.float64), above.astype(np.float64)
    alpha = above[:, 3:] / 255.0
    found = below * above / 255.0 if method == "multiply" else below + (above - below) * alpha
    found[:, 3] = below[:, 3] if method == "multiply" else np.maximum(below[:, 3], above[:, 3])
    return np.rint(found).astype(np.uint8)


def _encoded(linear) -> np.ndarray:
    """Return linear colors (n, 4) within 0..1 as sRGB bytes: IEC 61966-2-1."""
    srgb = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0.0) ** (1 / 2.4) - 0.055)
    srgb[:, 3] = linear[:, 3]
    return np.rint(255.0 * np.clip(srgb, 0.0, 1.0)).astype(np.uint8)


def _wrap(word) -> str:
    """Return our word for what becomes of a texture beside itself."""
    if word not in _WRAPS:
        raise ValueError(f"a tile style must be one of {', '.join(_WRAPS)}; given {word[:40]!r}")
    return _WRAPS[word]


def _indices(text, n) -> np.ndarray:
    indices = np.array([int(word) for word in text.split()], np.int64)
    _check_range(indices, n, "a group of composites")
    return indices


def _padded(text, n) -> list[int]:
    """Return the indices of the layers of a multi; layers that it doesn't name have index 0."""
    return ([int(word) for word in text.split()] + [0] * n)[:n]


def _check_range(indices, n, what) -> None:
    bad = indices[(indices < 0) | (indices >= n)]
    if bad.size:
        raise ValueError(f"{what} refers to property {bad.flat[0]} of a group of {n}")
