"""Read PLY, ASCII and binary: vertices, polygons, triangle strips, normals, colours, texture coordinates.

    header ─ elements, each with its rows and properties ─ columns of numbers, lists as (counts, items) ─ a part
                                                            ply_rows.py

Read are of vertices `x y z`, `nx ny nz`, colours `red green blue alpha` (also `r g b`, `diffuse_red` …; bytes, 16 bits,
or floats from 0 to 1) and texture coordinates (`s t`, `u v`, `texture_u texture_v`, `texture_s texture_t`); of faces
their `vertex_indices` (or `vertex_index`, or the only list of whole numbers), their colours, and `texcoord`, two
numbers for each corner (MeshLab: wedge coordinates); `tristrips`, where -1 ends a strip. Pictures are those of
`comment TextureFile NAME`, of several the one of a face's `texnumber`. Other elements and properties are left out.
Where a file has faces and strips, what belongs to its faces and their corners alone (colours, `texcoord`) isn't used:
strips have none.

What the header promises is compared with the length of the file before memory is spent. Format: Turk 1994, The PLY
Polygon File Format, Stanford University.
"""

import re
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import counted
from ..scene.material import Material
from .model_file import WHITE, Contents, ModelFile, Part, bytes_of, check_indices, cut_faces
from .ply_rows import Bytes, List, Text, read_header

_PICTURE = re.compile(rb"^comment\s+TextureFile[ \t]+(.*?)[ \t\r]*$", re.MULTILINE)
_DRAWN = ("vertex", "face", "tristrips")
_INDICES = ("vertex_indices", "vertex_index")
_COLORS = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
_WEDGES = ("texcoord", "texture_coordinates")
_UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))


def read_ply(model: ModelFile) -> Contents:
    """Read a PLY file; one part, or none where it has no faces.

    Raises
    ------
    ModelError : the file is broken

    Warns
    -----
    UserWarning : polygons that cross themselves
    """
    if model.data[:3].lower() != b"ply":
        raise model.error("not a PLY file: it does not begin with 'ply'")
    order, elements, start, n_line = read_header(model)
    read = Text(model, elements, start, n_line) if order == "" else Bytes(model, start, order)
    tables = {}
    for element in elements:
        tables.setdefault(element.name, read.element(element))
    if "vertex" not in tables:
        raise model.error("no vertices")
    parts = _make_parts(model, {e.name: e for e in reversed(elements)}, tables, read.line_of)
    names = [name.decode("utf-8", "surrogateescape") for name in _PICTURE.findall(model.data[:start])]
    for part in parts:
        number = part.pop("picture", None)
        part |= _with_pictures(model, names, number) if "uv" in part and names else {}
    rows = {element.name: element.n_row for element in elements}
    return Contents(
        parts,
        n_point=0 if parts else rows["vertex"],
        n_line=rows.get("edge", 0),
        left_out=tuple(_left_out(elements, parts[0] if parts else {})),
    )


def _with_pictures(model, names, number) -> dict:
    """Return the materials of pictures by their names, and which each triangle has, (n,) int64 or None.

    Those that can't be read are warned of; triangles with the number of none have a plain material.
    """
    from .mtl import Maps

    maps = Maps(model.log)
    textures = [maps.texture(model, f"TextureFile {k}", (name, "repeat"), None) for k, name in enumerate(names)]
    materials = tuple(replace(WHITE, texture=texture) for texture in (*textures, None))
    if number is None or (number == 0).all():
        return {"material": materials[0]}
    number = np.where((number >= 0) & (number < len(names)), number, len(names)).astype(np.int32)
    return {"materials": materials, "face_material": number, "material": materials[0]}


def _left_out(elements, part) -> list[str]:
    """Name the elements and properties of the file that no part of it was made of."""
    known = {"x", "y", "z", *_INDICES}
    if "normals" in part:
        known |= {"nx", "ny", "nz"}
    if "uv" in part:
        known |= {"texnumber", *_WEDGES}.union(*_UV)
    if "colors" in part or "face_colors" in part:
        known |= {"alpha", "diffuse_alpha", "a"}.union(*_COLORS)
    found = []
    for element in elements:
        names = [each.name for each in element.properties if each.name not in known]
        if element.name not in (*_DRAWN, "edge") and element.n_row:
            found.append(f"elements '{element.name}'")
        elif element.name in _DRAWN[:2] and names and part:
            found.append(f"{element.name} properties {', '.join(names)}")
    return found


# --- what the columns mean ----------------------------------------------------------------------------------


def _make_parts(model, elements, tables, line_of) -> list[Part]:
    """Turn the tables of a file into a part, if it has faces or strips."""
    vertex, face = tables["vertex"], tables.get("face", {})
    points = _columns(vertex, [("x", "y", "z")])
    if points is None:
        raise model.error("the vertices have no x, y and z", elements["vertex"].line)
    indices = _indices_of(face)
    counts = np.empty(0, np.int64) if indices is None else indices.counts
    corners = np.empty(0, np.int64) if indices is None else _whole(model, indices.items, "face")

    def place(row):
        line = line_of("face", row)
        return f": face {row}" if line is None else f":{line}: the face"

    check_indices(model, corners, counts, len(points), place)
    strips = _strips(model, tables.get("tristrips", {}), len(points))
    if counts.max(initial=0) < 3 and len(strips) == 0:
        return []
    points = points.astype(np.float64)
    cut = cut_faces(model, points, corners, counts, place)
    part = {"vertices": points, "faces": corners[cut.corners], "name": "", "material": Material()}
    if counts.max(initial=0) > 3:
        part["polygons"] = cut.polygons
    part |= _vertex_attributes(vertex, elements["vertex"])
    if len(strips):
        part["faces"] = np.concatenate([part["faces"], strips])
        if "polygons" in part:
            more = np.arange(len(strips), dtype=np.int32) + len(counts)
            part["polygons"] = np.concatenate([part["polygons"], more])
    else:
        part |= _face_attributes(model, face, elements["face"], cut, counts)
    return [part]


def _strips(model, table, n_point) -> np.ndarray:
    """Return the triangles (n, 3) of all strips."""
    strips = _indices_of(table)
    if strips is None:
        return np.empty((0, 3), np.int64)
    triangles = _strip_triangles(_whole(model, strips.items, "tristrips"), strips.counts)
    check_indices(model, triangles.ravel(), np.full(len(triangles), 3), n_point, lambda row: ": a triangle strip")
    return triangles


def _columns(table, choices) -> np.ndarray | None:
    """Return the first choice of columns that are all there, side by side."""
    for names in choices:
        if all(isinstance(table.get(name), np.ndarray) for name in names):
            return np.stack([table[name] for name in names], axis=1)
    return None


def _indices_of(table) -> List | None:
    """Return the list of vertices of faces or strips."""
    lists = {name: column for name, column in table.items() if isinstance(column, List)}
    named = [lists[name] for name in _INDICES if name in lists]
    others = [column for name, column in lists.items() if name not in _WEDGES]
    return (named or others or [None])[0]


def _whole(model, numbers, what) -> np.ndarray:
    """Return indices as int64."""
    if numbers.dtype.kind == "f":
        with np.errstate(invalid="ignore"):
            is_bad = ~((np.abs(numbers) < 2.0**53) & (numbers == np.rint(numbers)))
        if is_bad.any():
            raise model.error(f"a {what} refers to vertex {numbers[int(is_bad.argmax())]}, which is no index")
    return numbers.astype(np.int64)


def _colors(table, element) -> np.ndarray | None:
    """Return colours as bytes, (n, 3 or 4)."""
    for names in _COLORS:
        full = [*names, names[0].replace("red", "alpha") if "red" in names[0] else "a"]
        colors = _columns(table, [full, names])
        if colors is None:
            continue
        types = {each.name: each.type for each in element.properties}
        kind = types[names[0]]
        if kind[0] == "f":
            return bytes_of(colors)
        most = np.iinfo(kind).max if kind in ("u2", "u4") else 255
        return np.rint(np.clip(colors.astype(np.float64), 0, most) * (255.0 / most)).astype(np.uint8)
    return None


def _vertex_attributes(table, element) -> dict:
    """Return normals, colours and texture coordinates of the vertices, as far as there are any."""
    part = {}
    normals, uv, colors = _columns(table, [("nx", "ny", "nz")]), _columns(table, _UV), _colors(table, element)
    if normals is not None:
        part["normals"] = normals.astype(np.float64)
    if uv is not None:
        part["uv"] = uv.astype(np.float64)
    if colors is not None:
        part |= {"colors": colors, "material": WHITE}
    return part


def _face_attributes(model, table, element, cut, counts) -> dict:
    """Return colours and texture coordinates of the faces, as far as there are any."""
    part = {}
    colors = _colors(table, element)
    if colors is not None:
        part |= {"face_colors": colors[cut.polygons], "material": WHITE}
    if isinstance(table.get("texnumber"), np.ndarray):
        part["picture"] = _whole_numbers(table["texnumber"])[cut.polygons]
    for name in _WEDGES:
        wedge = table.get(name)
        if not isinstance(wedge, List):
            continue
        is_there = (wedge.counts == 2 * counts)[cut.polygons]
        if not is_there.all():
            n = int((wedge.counts != 2 * counts).sum())
            model.log(
                f"{model.name}: {counted(n, 'face')} without two texture coordinates for each corner: drawn with 0, 0"
            )
        # The place of a corner in the list of corners, counted within its face.
        at = cut.corners - (np.cumsum(counts) - counts)[cut.polygons][:, None]
        place = (np.cumsum(wedge.counts) - wedge.counts)[cut.polygons][:, None] + 2 * at
        place = np.where(is_there[:, None], place, 0)
        if len(wedge.items) >= 2:
            uv = np.stack([wedge.items[place], wedge.items[place + 1]], axis=2).astype(np.float64)
            part["uv"] = np.where(is_there[:, None, None], uv, 0.0)
    return part


def _strip_triangles(items, counts) -> np.ndarray:
    """Return the triangles of strips, without those that repeat a corner; -1 ends a strip, and so does its list."""
    ends = np.cumsum(counts)
    items = np.insert(items, ends, -1)  # so that none reaches into the next
    triangles = np.stack([items[:-2], items[1:-1], items[2:]], axis=1)
    is_end = items < 0
    begin = np.maximum.accumulate(np.where(is_end, np.arange(len(items)) + 1, 0))[:-2]
    is_odd = (np.arange(len(triangles)) - begin) % 2 == 1
    triangles[is_odd] = triangles[is_odd][:, [1, 0, 2]]
    is_good = (triangles >= 0).all(axis=1)
    is_good &= (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return triangles[is_good]


def _whole_numbers(values: NDArray) -> NDArray[np.int64]:
    """Return the whole parts of numbers; -1 of those that are no index at all."""
    is_index = (values >= 0) & (values < 2**31)
    return np.where(is_index, values, -1).astype(np.int64)
