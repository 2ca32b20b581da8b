"""Scalar fields: one number a vertex or face, shown by the colours of a colormap.

    parts, each with its fields ─ values ─ texture coordinates along a texture of one row ─ parts as any textured ones

A value becomes the coordinate u of a point, and the colormap a texture. So values are interpolated, and each sample's
value is coloured: colours are never mixed between vertices.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ModelError, SceneError, counted, cut, install_command, shown
from .arrays import plain_array, real_array
from .material import WHITE
from .texture import Texture
from .validate import number, store

if TYPE_CHECKING:
    from .mesh import Mesh

DEFAULT_COLORMAP = "viridis"
NO_VALUE = (169, 169, 169)  # sRGB, of faces that have a corner without a finite value
MAX_COLORS = 2**12
Colormap: TypeAlias = str | ArrayLike


class Fields(NamedTuple):
    """The arrays that a part of a model has by name, of any dtype, or functions that return them; and the name of that
    which its library shows."""

    of_points: Mapping[str, Any] = {}
    of_faces: Mapping[str, Any] = {}
    active: str | None = None


@dataclass(frozen=True, eq=False, repr=False)
class ColorScale(Texture):
    """A colormap over a range of values, as the texture that a scalar field is drawn with.

    Parameters
    ----------
    image : (1, n, 3) or (2, n, 3) uint8 sRGB, the colours of n equal steps from `low` to `high`; a second row has the
        colour of what has no value
    low, high : numbers, the values at both ends; what lies beyond has the colour of the nearer end
    """

    low: float = 0.0
    high: float = 1.0

    def coordinates(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the texture coordinates (..., 2) of values; what isn't finite lies in the second row."""
        is_there = np.isfinite(values)
        u = (np.where(is_there, values, self.low) - self.low) / (self.high - self.low)
        return np.stack([u, np.where(is_there, 1.0, 0.0)], axis=-1)


@dataclass(frozen=True)
class ScalarWords:
    """What is asked for of a scalar field; `render` says what each word is.

    Raises
    ------
    SceneError : a word that is not legal
    """

    scalars: Any = None
    cmap: Any = None
    clim: Any = None

    def __post_init__(self) -> None:
        if self.clim is not None:
            given: Any = self.clim
            is_pair = isinstance(given, (tuple, list)) or (isinstance(given, np.ndarray) and given.ndim == 1)
            if not is_pair or len(given) != 2:
                raise SceneError(f"clim must be two numbers, the least value and the largest; given {shown(self.clim)}")
            low, high = number(given[0], "clim"), number(given[1], "clim")
            if not (low < high and np.isfinite(high - low)):
                raise SceneError(f"clim must rise from the first number to the second; given {shown(self.clim)}")
            store(self, clim=(low, high))
        if self.scalars is not None and not isinstance(self.scalars, str):
            values = _column(self.scalars)
            if values is None:
                legal = "a name, or one number for each vertex or face, (n,)"
                raise SceneError(f"scalars must be {legal}; given {_described(self.scalars)}")
            store(self, scalars=values.astype(np.float64))
        if self.cmap is not None:
            store(self, cmap=colors_of(self.cmap))

    def lay(self, parts: Iterable[dict[str, Any]]) -> None:
        """Let parts of a model show their values in the place of their colours and textures: those asked for, else the
        active ones of each.

        Parameters
        ----------
        parts : dicts of the arguments of Mesh, which are changed; their `fields` are taken out

        Raises
        ------
        ModelError : no array of that name, an array of another length, no finite value
        """
        parts = list(parts)
        fields = [part.pop("fields", Fields()) for part in parts]
        found: list[NDArray[np.float64] | None] = []
        if isinstance(self.scalars, np.ndarray):
            found += _divided(self.scalars, parts)
        else:
            found += [
                _values_of(part, each, self.scalars or each.active) for part, each in zip(parts, fields, strict=True)
            ]
        values = [each for each in found if each is not None]
        if not values and self.scalars is not None:
            names = dict.fromkeys(name for each in fields for name in (*each.of_points, *each.of_faces))
            has = (
                f"it has {cut(', '.join(names), 200)}"
                if names
                else "it has none by a name; those of a file are taken where it is read"
            )
            raise ModelError(f"there are no scalars {shown(self.scalars)}: {has}")
        material = replace(WHITE, texture=self._scale(values, fields)) if values else None
        for part, each in zip(parts, found, strict=True):
            if each is not None:
                _show(part, each, material)

    def _scale(self, found: list[NDArray[np.float64]], fields: list[Fields]) -> ColorScale:
        """Return the colour scale of all values."""
        colors = colors_of(DEFAULT_COLORMAP) if self.cmap is None else self.cmap
        finite = [values[np.isfinite(values)] for values in found]
        if not any(map(len, finite)):
            raise ModelError("none of the scalars is finite")
        low, high = self.clim or (
            min(float(values.min()) for values in finite if len(values)),
            max(float(values.max()) for values in finite if len(values)),
        )
        if not np.isfinite(high - low):
            raise ModelError(f"scalars from {low:g} to {high:g} have no range that float64 holds: give clim")
        if low == high:  # one value is in the middle of a range as wide as itself
            low, high = low - (abs(low) / 2 or 0.5), high + (abs(high) / 2 or 0.5)
        with np.errstate(over="ignore"):
            ends = [(np.array([each.min(), each.max()]) - low) / (high - low) for each in finite if len(each)]
        if not np.isfinite(np.array(ends)).all():
            raise ModelError(f"clim from {low:g} to {high:g} is too narrow for these scalars")
        name = self.scalars if isinstance(self.scalars, str) else ""
        if self.scalars is None:
            name = next(each.active for each in fields if each.active) or ""
        rows = np.stack([colors, np.full_like(colors, NO_VALUE)])
        has_all = sum(map(len, finite)) == sum(map(len, found))
        return ColorScale(rows[:1] if has_all else rows, "nearest", ("clamp", "clamp"), name, low, high)


NO_SCALARS = ScalarWords()  # but the active ones of foreign meshes


def colors_of(cmap: Colormap) -> NDArray[np.uint8]:
    """Return the colours of a colormap, (n, 3) uint8 sRGB, from low to high.

    Parameters
    ----------
    cmap : name of one, as the package `cmap` knows them ("viridis" needs no package); or its colours (n, 3 or 4), whole
        numbers of sRGB within 0..255 or floats within 0..1, which share the range evenly

    Raises
    ------
    SceneError : an unknown name, the package is missing, or no such array
    """
    if isinstance(cmap, str):
        if cmap == DEFAULT_COLORMAP:
            text = (Path(__file__).parent / "viridis.txt").read_text(encoding="ascii")
            return np.frombuffer(bytes.fromhex(text.split("\n", 1)[1]), np.uint8).reshape(-1, 3)
        return _named_colors(cmap)
    array = real_array(cmap)
    if array is None or array.ndim != 2 or array.shape[1] not in (3, 4) or not 1 <= len(array) <= MAX_COLORS:
        legal = f"a name, or colours (n, 3) with n up to {MAX_COLORS}"
        raise SceneError(f"cmap must be {legal}; given {_described(cmap)}")
    if array.dtype == np.uint8 or (array.dtype.kind in "iu" and array.min() >= 0 and 1 < array.max() <= 255):
        return array[:, :3].astype(np.uint8)
    if not (array.min() >= 0 and array.max() <= 1):  # nan neither
        raise SceneError(f"cmap: its floats must be within 0..1; given {array.min():g} to {array.max():g}")
    return np.rint(array[:, :3] * 255.0).astype(np.uint8)


def _named_colors(name: str) -> NDArray[np.uint8]:
    try:
        from cmap import Colormap as Named
    except ImportError:
        missing = f"{install_command('scalars')} for names other than {DEFAULT_COLORMAP}, or give its colours (n, 3)"
        raise SceneError(f"cmap {shown(name)}: the package cmap is missing: {missing}") from None
    for full_name in (f"matplotlib:{name}", name):  # of several by one name that of matplotlib
        try:
            found = Named(full_name)
        except (ValueError, TypeError):
            continue
        n = found.num_colors if found.interpolation == "nearest" else 256
        return np.rint(np.asarray(found.lut(n))[:, :3] * 255.0).astype(np.uint8)
    raise SceneError(f"cmap {shown(name)} is unknown: legal are the names of the package cmap, or colours (n, 3)")


def _numbers(values: Any) -> NDArray:
    """Return values as an array; truth values as 0 and 1."""
    array = plain_array(values)
    return array.astype(np.uint8) if array.dtype == bool else array


def _column(values: Any) -> NDArray | None:
    """Return values as (n,) where they are one number each, else None."""
    array = real_array(values, _numbers)
    if array is not None and array.ndim == 2 and array.shape[1] == 1:
        array = array[:, 0]
    return None if array is None or array.ndim != 1 else array


def _described(values: Any) -> str:
    """Say what was given: the shape of an array, which its first numbers don't tell."""
    shape = getattr(values, "shape", None)
    return f"the shape {tuple(shape)}" if shape is not None and len(shape) != 1 else shown(values)


def _counts(part: dict[str, Any]) -> tuple[int, int, int]:
    """Return how many vertices, triangles and polygons a part has."""
    polygons = part.get("polygons")
    n_face = len(part["faces"])
    return len(part["vertices"]), n_face, n_face if polygons is None else int(polygons.max()) + 1


def _divided(values: NDArray[np.float64], parts: list[dict[str, Any]]) -> list[NDArray[np.float64]]:
    """Divide an array among parts: by their vertices, else their triangles, else their polygons."""
    counts = np.array([_counts(part) for part in parts])
    for kind in range(3):
        if counts[:, kind].sum() == len(values):
            pieces = np.split(values, np.cumsum(counts[:, kind])[:-1])
            return [_by_corner(part, piece, kind) for part, piece in zip(parts, pieces, strict=True)]
    n_vertex, n_face, n_polygon = counts.sum(axis=0)
    legal = f"{counted(n_vertex, 'vertex')} and {counted(n_face, 'face')}"
    legal += f" of {counted(n_polygon, 'polygon')}" if n_polygon != n_face else ""
    raise ModelError(
        f"scalars must be one number for each vertex or face, of which there are {legal}; given {len(values)}"
    )


def _values_of(part: dict[str, Any], fields: Fields, name: str | None) -> NDArray[np.float64] | None:
    """Return the values by a name, one a vertex (n,) or one a corner (n_face, 3); None where there are none."""
    counts = _counts(part)
    for table, kinds in ((fields.of_points, (0,)), (fields.of_faces, (1, 2))):
        given = None if name is None else table.get(name)
        if given is None:
            continue
        given = given() if callable(given) else given
        values = _column(given)
        if values is None:
            has = f"it has the shape {np.shape(given)}"
            raise ModelError(f"scalars {shown(name)} must be one number for each vertex or face; {has}")
        for kind in kinds:
            if len(values) == counts[kind]:
                return _by_corner(part, values.astype(np.float64), kind)
        raise ModelError(f"scalars {shown(name)}: {len(values)} numbers for {counts[kinds[-1]]}")
    return None


def _by_corner(part: dict[str, Any], values: NDArray[np.float64], kind: int) -> NDArray[np.float64]:
    """Return values as they are where each is a vertex', else those of a face at each of its corners (n_face, 3)."""
    if kind == 0:
        if np.isfinite(values).all():
            return values
        return values[part["faces"]]
    if kind == 2:
        values = values[part["polygons"]]
    return np.repeat(values[:, None], 3, axis=1)


def _show(part: dict[str, Any], values: NDArray[np.float64], material: Any) -> None:
    """Let a part show values by a material whose texture is a colour scale."""
    if values.ndim == 2:  # a face of which a corner has no value has none
        values = np.where(np.isfinite(values).all(axis=1, keepdims=True), values, np.nan)
    for key in ("colors", "face_colors", "materials", "face_material"):
        part.pop(key, None)
    part["uv"], part["material"] = material.texture.coordinates(values), material


def with_one_scale(meshes: "list[Mesh]") -> "list[Mesh]":
    """Return meshes of which those that show scalar fields by scales of different ranges share one over all of them."""
    scales = {id(mesh.material.texture): mesh.material.texture for mesh in meshes}
    found: list[Any] = [scale for scale in scales.values() if isinstance(scale, ColorScale)]
    if len({(scale.low, scale.high) for scale in found}) < 2:
        return meshes
    low, high = min(scale.low for scale in found), max(scale.high for scale in found)
    wide = {id(each): ColorScale(each.encoded, each.filter, each.wrap, each.name, low, high) for each in found}

    def widened(mesh: "Mesh") -> "Mesh":
        scale = mesh.material.texture
        if not isinstance(scale, ColorScale):
            return mesh
        uv = np.array(mesh.uv)
        uv[..., 0] = (scale.low + uv[..., 0] * (scale.high - scale.low) - low) / (high - low)
        return replace(mesh, uv=uv, material=replace(WHITE, texture=wide[id(scale)]))

    return list(map(widened, meshes))
