"""Read PLY, ASCII and binary: vertices, polygons, triangle strips, normals, colours, texture coordinates.

    header ─ elements, each with its rows and properties ─ columns of numbers, lists as (counts, items) ─ a part

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

import codecs
import re
import struct
from array import array
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..errors import ModelError, counted, cut
from ..scene.arrays import distinct
from ..scene.material import WHITE, Material
from ..scene.scalars import Fields
from .model_file import Contents, ModelFile, Part, bytes_of, check_indices, cut_faces, numbers_in, text_of

_PICTURE = re.compile(rb"^comment\s+TextureFile[ \t](.*)$", re.MULTILINE)
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
    if model.data.startswith(codecs.BOM_UTF8):
        model = replace(model, data=model.data[len(codecs.BOM_UTF8) :])
    if model.data[:3].lower() != b"ply":
        raise model.error("not a PLY file: it does not begin with 'ply'")
    order, elements, start, n_line = read_header(model)
    if order == "":
        read = TextRows(model, elements, start, n_line)
        tables = read.tables()
    else:
        read = Rows(model, model.data, start, order)
        tables = read.elements(elements)
    if "vertex" not in tables:
        raise model.error("no vertices")
    parts = _make_parts(model, {e.name: e for e in reversed(elements)}, tables, read.line_of)
    names = [
        name.decode("utf-8", "surrogateescape").strip() for name in _PICTURE.findall(model.data[:start])[:MAX_PICTURES]
    ]
    if names and parts and "uv" not in parts[0]:
        model.warn(f"texture '{cut(names[0], 80)}', but no texture coordinates: drawn without it")
    for part in parts:
        number = part.pop("picture", None)
        part |= _with_pictures(model, names, number) if "uv" in part and names else {}
    rows = {element.name: element.n_row for element in elements}
    return Contents(
        parts,
        n_point=0 if parts else rows["vertex"],
        n_line=rows.get("edge", 0),
        unused=tuple(_left_out(elements, parts[0] if parts else {})),
    )


def _with_pictures(model, names, number) -> dict:
    """Return the materials of pictures by their names, and which each triangle has, (n,) int64 or None.

    Those that can't be read are warned of; triangles with the number of none have a plain material.
    """
    from .mtl import Maps

    maps = Maps(model)
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
            found.append(f"elements '{cut(element.name, 40)}'")
        elif element.name in _DRAWN[:2] and names and part:
            found.append(f"{element.name} properties {cut(', '.join(names), 100)}")
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
    faces = cut.of_corners(corners)
    part = {"vertices": points, "faces": faces, "name": "", "material": Material()}
    part["fields"] = Fields(_numbers_of(vertex), _numbers_of(face))
    if counts.max(initial=0) > 3:
        part["polygons"] = cut.polygons
    part |= _vertex_attributes(model, vertex, elements["vertex"])
    if len(strips):
        part["faces"] = np.concatenate([part["faces"], strips])
        if "polygons" in part:
            more = np.arange(len(strips), dtype=np.int32) + len(counts)
            part["polygons"] = np.concatenate([part["polygons"], more])
    else:
        of_faces = _face_attributes(model, face, elements["face"], cut, counts)
        if "colors" in part and of_faces.pop("face_colors", None) is not None:
            model.tell("colours of faces beside those of vertices are not used")
        part |= of_faces
    return [part]


def _numbers_of(table) -> dict[str, np.ndarray]:
    """Return the columns of a table that are no lists."""
    return {name: column for name, column in table.items() if isinstance(column, np.ndarray)}


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


def _indices_of(table) -> "List | None":
    """Return the list of vertices of faces or strips."""
    lists = {name: column for name, column in table.items() if isinstance(column, List)}
    named = [lists[name] for name in _INDICES if name in lists]
    others = [column for name, column in lists.items() if name not in _WEDGES]
    return (named or others or [None])[0]


def _whole(model, numbers, what) -> np.ndarray:
    """Return indices as int64, or int32 where they are."""
    if numbers.dtype.kind == "f":
        with np.errstate(invalid="ignore"):
            is_bad = ~((np.abs(numbers) < 2.0**53) & (numbers == np.rint(numbers)))
        if is_bad.any():
            raise model.error(f"a {what} refers to vertex {numbers[int(is_bad.argmax())]}, which is no index")
    return numbers if numbers.dtype == np.int32 else numbers.astype(np.int64)


def _colors(model, table, element) -> np.ndarray | None:
    """Return colours as bytes, (n, 3 or 4)."""
    for names in _COLORS:
        full = [*names, names[0].replace("red", "alpha") if "red" in names[0] else "a"]
        colors = _columns(table, [full, names])
        if colors is None:
            continue
        types = {each.name: each.type for each in element.properties}
        dtype = types[names[0]]
        most = 255 if dtype == "u1" else colors[:, :3].max(initial=0)
        white = 255.0
        if dtype[0] == "f":
            white = None
        elif most <= 1:
            white = 1.0
            model.mend("colour", "of whole numbers up to 1: taken as 0..1", len(colors))
        elif most > 255 and dtype[0] == "u":
            white = np.iinfo(dtype).max
        return bytes_of(model, colors, white)
    return None


def _vertex_attributes(model, table, element) -> dict:
    """Return normals, colours and texture coordinates of the vertices, as far as there are any."""
    part = {}
    normals, uv, colors = _columns(table, [("nx", "ny", "nz")]), _columns(table, _UV), _colors(model, table, element)
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
    colors = _colors(model, table, element)
    if colors is not None:
        part |= {"face_colors": cut.of_polygons(colors), "material": WHITE}
    if isinstance(table.get("texnumber"), np.ndarray):
        number = table["texnumber"]
        is_index = (number >= 0) & (number < 2**31)  # False for nan
        part["picture"] = cut.of_polygons(np.where(is_index, number, -1).astype(np.int64))
    for name in _WEDGES:
        wedge = table.get(name)
        if not isinstance(wedge, List):
            continue
        is_there = cut.of_polygons(wedge.counts == 2 * counts)
        if not is_there.all():
            n = int((wedge.counts != 2 * counts).sum())
            model.tell(f"{counted(n, 'face')} without two texture coordinates for each corner: drawn with 0, 0")
        # The place of a corner in the list of corners, counted within its face.
        at = cut.of_corners(np.arange(counts.sum())) - cut.of_polygons(np.cumsum(counts) - counts)[:, None]
        place = cut.of_polygons(np.cumsum(wedge.counts) - wedge.counts)[:, None] + 2 * at
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


# ----------------------------------------------------------------
# The header and the rows of a file: for each element its properties as columns of numbers; lists as `List`.

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q", "f4": "f", "f8": "d"}
MAX_PICTURES = 256  # of a file
MAX_PROPERTIES = 256  # of an element, and elements of a file
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


class Property(NamedTuple):
    """A property of an element: a number in each row, or a list."""

    name: str
    type: str  # numpy's, without the order of bytes
    count_type: str | None  # of a list's length; None where it is no list


class Element(NamedTuple):
    """An element of the header: so many rows of the same properties."""

    name: str
    n_row: int
    properties: list
    line: int  # of the header


class List(NamedTuple):
    """A property that is a list in each row."""

    counts: np.ndarray  # (n_row,) int64
    items: np.ndarray  # all rows' items, one behind the other


def read_header(model):
    """Return the order of bytes, the elements, where the data begins, and how many lines the header has."""
    end = model.data.find(b"end_header")
    if end < 0:
        raise model.error("the PLY header has no 'end_header'")
    head = model.data[:end].decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
    order, elements = None, []
    for line, text in enumerate(head.split("\n"), 1):
        words = text.split()
        key = words[0].lower() if words else ""
        try:
            if key == "format":
                order = _ORDERS[words[1]]
            elif key == "element":
                elements.append(Element(words[1], int(words[2]), [], line))
            elif key == "property" and words[1] == "list":
                elements[-1].properties.append(Property(words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif key == "property":
                elements[-1].properties.append(Property(words[2], _TYPES[words[1]], None))
        except (IndexError, KeyError, ValueError):
            raise model.error(f"'{text.strip()[:60]}' is not a line of a PLY header", line) from None
        properties = elements[-1].properties if key == "property" else []
        if max(len(elements), len(properties)) > MAX_PROPERTIES:
            raise model.error(f"more than {MAX_PROPERTIES} elements or properties", line)
        if len({each.name for each in properties}) < len(properties):
            raise model.error(f"the property '{cut(properties[-1].name, 40)}' is there twice", line)
        if elements and elements[-1].n_row < 0:
            raise model.error(f"{elements[-1].n_row} {cut(elements[-1].name, 40)} lines; none is the least", line)
    if order is None:
        raise model.error("the PLY header has no line 'format'")
    start = end + len(b"end_header")
    while start < len(model.data) and model.data[start] in b" \t":
        start += 1
    start += 2 if model.data[start : start + 2] == b"\r\n" else 1
    return order, elements, start, head.count("\n") + 1


class Rows:
    """The rows of a binary file, element by element."""

    def __init__(self, model, data, at, order):
        self.model, self.data, self.at, self.order = model, data, at, order

    def elements(self, elements) -> dict[str, dict]:
        """Return the columns of all elements, of two with one name those of the first."""
        tables = {}
        for element in elements:
            tables.setdefault(element.name, self.element(element))
        return tables

    def dtype(self, type) -> np.dtype:
        """Return how a number is stored whose type is one of the header's."""
        return np.dtype(self.order + type)

    def element(self, element) -> dict:
        """Return the columns of the next element by name."""
        if not element.properties:
            return {}
        least = sum(self.dtype(each.count_type or each.type).itemsize for each in element.properties)
        if element.n_row * least > len(self.data) - self.at:  # a list has at least its length
            raise self.is_short(element, max(len(self.data) - self.at, 0) // least)
        even = self._even_rows(element)
        return self._uneven_rows(element) if even is None else even

    def _even_rows(self, element):
        """Return the columns of rows whose lists are all as long as those of the first; None where they are not."""
        fields, at = [], self.at
        for number, each in enumerate(element.properties):
            dtype = self.dtype(each.type)
            if each.count_type is not None:
                count_dtype = self.dtype(each.count_type)
                at += count_dtype.itemsize
                if element.n_row == 0 or at > len(self.data):
                    return None
                length = np.frombuffer(self.data, count_dtype, 1, at - count_dtype.itemsize)[0]
                if not 0 <= length <= (len(self.data) - at) // dtype.itemsize:  # nan compares as false
                    return None
                fields += [(f"n{number}", count_dtype), (f"p{number}", dtype, (int(length),))]
                at += int(length) * dtype.itemsize
            else:
                fields.append((f"p{number}", dtype))
                at += dtype.itemsize
        rows = np.dtype(fields)
        if element.n_row * rows.itemsize > len(self.data) - self.at:
            return None
        table = np.frombuffer(self.data, rows, element.n_row, self.at)
        found = {}
        for number, each in enumerate(element.properties):
            column = table[f"p{number}"]
            if each.count_type is None:
                found[each.name] = column
                continue
            if (table[f"n{number}"] != column.shape[1]).any():
                return None
            found[each.name] = List(np.full(element.n_row, column.shape[1]), column.ravel())
        self.at += element.n_row * rows.itemsize
        return found

    def _uneven_rows(self, element):
        """Return the columns of rows whose lists have any lengths: where each property begins is found row by row, the
        rest for all rows at once."""
        at, data = self.at, self.data
        begins, counts = ([array("q") for _ in element.properties] for _ in range(2))
        kinds = []  # of each property the size of a number, and how the length of its list is read
        for each in element.properties:
            length = (
                None
                if each.count_type is None
                else struct.Struct(self.order + _CODES[self.dtype(each.count_type).str[1:]])
            )
            kinds.append((self.dtype(each.type).itemsize, length))
        for row in range(element.n_row):
            for k, (size, length) in enumerate(kinds):
                count = 1
                if length is not None:
                    at += length.size
                    count = length.unpack_from(data, at - length.size)[0] if at <= len(data) else -1
                if not (0 <= count <= (len(data) - at) // size and count == int(count)):
                    self.at = at
                    raise self.fault(element, row)
                begins[k].append(at)
                counts[k].append(int(count))
                at += size * int(count)
        self.at, found = at, {}
        for each, begin, count in zip(element.properties, begins, counts, strict=True):
            begin, count, dtype = np.array(begin, np.int64), np.array(count, np.int64), self.dtype(each.type)
            items, first = np.empty(int(count.sum()), dtype), np.cumsum(count) - count
            for n in distinct(count).tolist():
                rows = np.flatnonzero(count == n)
                items[first[rows, None] + np.arange(n)] = self._gather(begin[rows], dtype, n)
            found[each.name] = items if each.count_type is None else List(count, items)
        return found

    def _gather(self, begins, dtype, n) -> np.ndarray:
        """Return n numbers of a type from each of some places on, (n_place, n)."""
        if len(begins) < n * dtype.itemsize:
            rows = [np.frombuffer(self.data, dtype, n, begin) for begin in begins.tolist()]
            return np.stack(rows) if rows else np.empty((0, n), dtype)
        letters = np.frombuffer(self.data, np.uint8)
        columns = np.empty((len(begins), n * dtype.itemsize), np.uint8)
        for k in range(n * dtype.itemsize):
            columns[:, k] = letters[begins + k]
        return columns.view(dtype) if n else np.empty((len(begins), 0), dtype)

    def line_of(self, _name, _row) -> int | None:
        """Return the number of the line where a row stands; a binary file has no lines."""
        return None

    def is_short(self, element, n_found):
        """Make the error where an element has fewer rows than the header says."""
        text = f"{element.n_row} {element.name} rows promised, room for at most {n_found}"
        return self.model.error(f"binary PLY of another length than its header says: {text}", element.line)

    def fault(self, element, row):
        """Make the error for a row that ends too early, or whose list has no legal length."""
        text = f"it ends in {element.name} row {row} of {element.n_row}"
        return self.model.error(f"binary PLY of another length than its header says: {text}", element.line)


class TextRows(Rows):
    """The rows of an ASCII file: its numbers as float64, one after the other, whatever the lines; but where that isn't
    what the header says, and each row has a line, lines may hold more than it says."""

    def __init__(self, model, elements, start, n_line):
        self.elements_of_file, self.n_line = elements, n_line
        self.text = model.data[start:]
        numbers = numbers_in(self.text)
        if numbers is None:
            raise _no_number(model, self.text, n_line)
        super().__init__(model, numbers.view(np.uint8), 0, "")

    def tables(self) -> dict[str, dict]:
        """Return the columns of all elements."""
        try:
            tables = self.elements(self.elements_of_file)
            if self.at == len(self.data):
                return tables
        except ModelError:
            if not self._keep_named():
                raise
            tables = None
        if tables is None or self._keep_named():
            self.model.warn("rows hold more values than the header names: these are left out")
            self.at = 0
            tables = self.elements(self.elements_of_file)
        return tables

    def _keep_named(self) -> bool:
        """Keep of each line what the header names; return False where a line has less, or none has more."""
        lines = [line for line in self.text.splitlines() if line and not line.isspace()]
        elements, kept, n_more = [each for each in self.elements_of_file if each.properties], array("d"), 0
        if sum(element.n_row for element in elements) > len(lines):
            return False
        rows = (element for element in elements for _ in range(element.n_row))
        for element, words in zip(rows, map(bytes.split, lines), strict=False):
            end = 0
            for each in element.properties:
                length = 1
                if each.count_type is not None and end < len(words):
                    count = float(words[end])
                    length += int(count) if 0 <= count < len(words) else len(words)
                end += length
            if end > len(words):
                return False
            kept.extend(map(float, words[:end]))
            n_more += len(words) - end
        if n_more == 0:
            return False
        self.data = np.frombuffer(kept, np.uint8)
        return True

    def dtype(self, _type) -> np.dtype:
        """Return float64."""
        return np.dtype(np.float64)

    def line_of(self, name, row) -> int | None:
        """Return the number of the line of an element's row, if every row has a line."""
        before = 0
        for element in self.elements_of_file:
            if element.name == name:
                break
            before += element.n_row
        lines = [number for number, line in enumerate(self.text.splitlines(), self.n_line + 1) if line.split()]
        return lines[before + row] if before + row < len(lines) else None

    def is_short(self, element, n_found):
        """Make the error where an element has fewer rows than the header says."""
        text = f"the header promises {element.n_row} {element.name} lines, the file has {n_found}"
        return self.model.error(text, element.line)

    def fault(self, element, row):
        """Make the error for a row that ends too early, or whose list has no legal length."""
        if self.at >= len(self.data):
            return self.is_short(element, row)
        length = np.frombuffer(self.data, np.float64, 1, self.at - 8)[0]
        text = f"{element.name} {row}: {length:g} is not how long its list is"
        return self.model.error(text, self.line_of(element.name, row))


def _no_number(model, text, n_line):
    """Make the error that names the first word of a text that is no number."""
    lines = enumerate(text.splitlines(), n_line + 1)
    line_number, line = next((number, line) for number, line in lines if numbers_in(line) is None)
    word = next(word for word in line.split() if numbers_in(word) is None)
    return model.error(f"'{text_of(word)[:40]}' is not a number", line_number)
