"""Read OBJ: vertices, polygons, normals, texture coordinates, smoothing groups, objects, materials.

    lines ─ triangles (scene/triangulation.py) with their attributes ─ parts, one an object

Each `o` line with faces begins a part, which may have several materials; groups (`g`) only name faces, so normals go
across their borders. Faces keep the order of the file. Points, lines, faces with fewer than three corners, and curved
surfaces are left out.

Read as other programs do: corners written short (`1/`, `1//`, `2/2/`) have what they name. A `v` of four or five
numbers is a position, of six or more a position and its colour (0..1, or 0..255 where one is above 1); vertices without
one beside others of their object are white. Texture coordinates and normals that a face names and the file doesn't have
are none, which is warned of. Format: Wavefront, Advanced Visualizer manual, appendix B1, 1995.
"""

import re
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..cores import Workers, n_core
from ..errors import counted, cut
from ..scene.arrays import distinct
from ..scene.material import WHITE, Material
from ..scene.mesh_arrays import has_area
from .model_file import (
    FEW,
    Contents,
    ModelFile,
    Part,
    bytes_of,
    cut_faces,
    mend_unused,
    name_in,
    read_words,
    report_progress,
    text_of,
)


def read_obj(model: ModelFile) -> Contents:
    """Read an OBJ file, the MTL files that it names, and the textures that those name.

    Returns
    -------
    Contents with one part for each object, in the order of the file

    Raises
    ------
    ModelError : naming the first line that is at fault

    Warns
    -----
    UserWarning : materials, textures or texture coordinates that are missing
    """
    lines = ObjLines(model.data)
    try:
        parts = _read_parts(model, lines)
    except LineError:
        parts = []
    if not parts and (fault := lines.first_fault()):
        line, reason = fault
        raise model.error(reason, lines.number_of(line))
    return _with_others(parts, lines)


def _with_others(parts, lines) -> Contents:
    """Say what the file has beside faces that are drawn."""
    n_point, curved = 0, []
    for words in lines.names_of("p")[1]:
        n_point += len(words.partition("#")[0].split())
    for keyword in ("curv", "curv2", "surf"):
        curved += [keyword] * (len(lines.lines_of(keyword)) > 0)
    n_line = len(lines.lines_of("l")) + lines.n_short_face
    if not parts and n_point + n_line == 0 and not curved:
        n_point = len(lines.lines_of("v"))
    left_out = (f"curved elements ({', '.join(curved)})",) if curved else ()
    return Contents(parts, n_point=n_point, n_line=n_line, left_out=left_out)


def _read_parts(model, lines) -> list[Part]:
    """Read the triangles of the file, and divide them into objects."""
    corners = lines.corners()
    if corners.counts.max(initial=0) < 3:
        return []
    for what, n in lines.missing.items():
        if n:
            model.warn(f"{counted(n, 'face')} with {what} that the file doesn't have: drawn without")
    points = lines.rows_of("v")

    def place(face):
        return f":{lines.number_of(corners.lines[face])}: the face"

    cut = cut_faces(model, points[:, :3], corners.v, corners.counts, place)
    whole = _make_part(model, lines, points, corners, cut)
    mend_unused(model, points[:, :3], whole["faces"])  # counts them; parts have those alone that they use
    face_lines = cut.of_polygons(corners.lines)
    material_begins, names = _in_force(lines, "usemtl", face_lines)
    object_begins, objects = _in_force(lines, "o", face_lines)
    # A material has one number, however often its name stands there; an object is another each time.
    numbers = dict(zip(dict.fromkeys(names), range(len(names)), strict=False))
    whole["face_material"] = np.repeat([-1, *map(numbers.get, names)], np.diff(material_begins))
    materials, places = {}, {}
    if numbers:
        from .mtl import find_materials

        materials, places = find_materials(model, lines.names_of("mtllib")[1], list(numbers))

    @cache
    def palette_of(is_colored):
        default = WHITE if is_colored else Material()
        return [*(materials.get(name) or replace(default, name=name_in(name)) for name in numbers), default]

    groups = set(lines.names_of("g")[1])
    objects.append(groups.pop() if len(groups) == 1 else "")  # the only group names what stands before the first object
    if cut.polygons is not None:
        whole["polygons"] = cut.polygons
    group_begins, groups = _in_force(lines, "s", face_lines)
    if groups:
        of_groups = np.array([0, *map(_smoothing_group, groups)], np.int32)
        whole["smoothing"] = np.repeat(of_groups, np.diff(group_begins))
    ranges, parts = _object_ranges(whole, object_begins), []
    model.limits.count_meshes(len(ranges))
    laid = {numbers[name]: place for name, place in places.items()}
    for number, begin, end in ranges:
        part = _take_range(whole, begin, end)
        palette = palette_of("colors" in part)
        parts.append(_with_materials(model, _laid(part, laid) if laid else part, palette, objects[number]))
    return parts


def _make_part(model, lines, points, corners: "Corners", cut) -> Part:
    """Put all triangles of the file in one part; of normals and texture coordinates a table, and which row of it each
    corner has, (n, 3), -1 for none."""
    faces = cut.of_corners(corners.v)
    part = {"vertices": points[:, :3], "faces": faces}
    if points.shape[1] >= COLORED:
        is_used = np.zeros(len(points), bool)
        is_used[faces] = True
        is_used &= points[:, 5] != NO_COLOR
        colors = np.full((len(points), 3), 255, np.uint8)  # white beside others of an object
        colors[is_used] = bytes_of(model, points[is_used, 3:6])
        part |= {"colors": colors, "is_colored": is_used}
    for key, keyword, n, indices in (("normals", "vn", 3, corners.vn), ("uv", "vt", 2, corners.vt)):
        if indices is not None and indices.max() >= 0:
            part[key] = lines.rows_of(keyword)[:, :n], cut.of_corners(indices)
    return part


def _in_force(lines, keyword, face_lines) -> tuple[list[int], list[str]]:
    """Return between which triangles the lines of a keyword stand: 0, the first triangle behind each, and how many
    there are; and what the lines say. So what a line says holds for the triangles from its entry to the next."""
    places, names = lines.names_of(keyword)
    return [0, *np.searchsorted(face_lines, places).tolist(), len(face_lines)], names


def _smoothing_group(name: str) -> int:
    """Return the number of a smoothing group: `off` and anything unknown are 0, `on` is 1."""
    name = name.partition("#")[0].strip()
    is_number = name.isascii() and name.isdigit() and len(name) < 10  # within int32
    return int(name) if is_number else int(name == "on")


# --- objects --------------------------------------------------------------------------------------------------------


def _object_ranges(whole: Part, edges: list[int]) -> list[tuple[int, int, int]]:
    """Return for each object its number, -1 of what stands before the first, and where its triangles begin and end.

    Objects without a face that has an area go with their neighbour, so that the faces keep their numbers: a mesh must
    have such a face.
    """
    found = np.flatnonzero(np.diff(edges))
    begins = np.array(edges)[found]
    if len(found) > 1:
        is_kept = np.logical_or.reduceat(has_area(whole["vertices"], whole["faces"]), begins)
        is_kept[is_kept.argmax()] = True
        found, begins = found[is_kept], begins[is_kept]
    between = begins[1:].tolist()
    return list(zip((found - 1).tolist(), [0, *between], [*between, edges[-1]], strict=True))


def _take_range(whole: Part, begin, end) -> Part:
    """Return the triangles from `begin` to `end` with the vertices that they use; what some lack is left out."""
    used, faces = _compact(whole["faces"][begin:end])
    part = {"vertices": whole["vertices"][used], "faces": faces, "face_material": whole["face_material"][begin:end]}
    if "colors" in whole and whole["is_colored"][used].any():
        part["colors"] = whole["colors"][used]
    if "normals" in whole:
        table, indices = whole["normals"][0], whole["normals"][1][begin:end]
        if indices.max() >= 0:  # corners without one get a normal of 0: what is computed takes its place
            part["normals"] = _rows_of(table, indices, faces, len(part["vertices"]))
    if "uv" in whole:
        table, indices = whole["uv"][0], whole["uv"][1][begin:end]
        has_uv = (indices >= 0).all(axis=1)
        if "polygons" in whole and not has_uv.all():  # a polygon has them at all its corners, or is drawn without
            polygons = whole["polygons"][begin:end]
            has_uv = ~np.isin(polygons, polygons[~has_uv])
        if has_uv.any():
            part["uv"] = _rows_of(table, indices, faces, len(part["vertices"]))
            part["has_uv"] = None if has_uv.all() else has_uv
    if "polygons" in whole:
        polygons = np.cumsum(np.diff(whole["polygons"][begin:end], prepend=whole["polygons"][begin]) > 0)
        if polygons[-1] + 1 < len(polygons):
            part["polygons"] = polygons.astype(np.int32)
    if "smoothing" in whole and whole["smoothing"][begin:end].any():
        part["smoothing"] = whole["smoothing"][begin:end]
    return part


def _rows_of(table, indices, faces, n_vertex) -> np.ndarray:
    """Return the rows of a table that corners have, 0 for none: (n_vertex, k) where all corners at each vertex have the
    same, (n_face, 3, k) elsewhere."""
    of_vertex = np.empty(n_vertex, indices.dtype)
    of_vertex[faces] = indices
    if np.array_equal(of_vertex[faces], indices):
        indices = of_vertex
    rows = table[indices]
    if indices.min() < 0:
        rows[indices < 0] = 0.0
    return rows


def _compact(faces) -> tuple[np.ndarray | slice, np.ndarray]:
    """Return which vertices faces use, ascending, and the faces with their numbers among these."""
    first, span = int(faces.min()), int(np.ptp(faces)) + 1
    if span > 8 * faces.size:  # few faces, far apart: sorting them is less than looking at all between
        used, faces_of_used = np.unique(faces, return_inverse=True)
        return used, faces_of_used.reshape(faces.shape)
    is_used, faces = np.zeros(span, bool), faces - first if first else faces
    is_used[faces] = True
    if is_used.all():
        return slice(first, first + span), faces
    return np.flatnonzero(is_used) + first, (np.cumsum(is_used) - 1)[faces]


# --- materials ------------------------------------------------------------------------------------------------------


def _laid(part: Part, places) -> Part:
    """Move the texture coordinates of faces with some materials; `places` says how by the number of the material."""
    numbers = part["face_material"]
    moved = [number for number in distinct(numbers).tolist() if number in places] if "uv" in part else ()
    for number in moved:
        uv = part["uv"] if part["uv"].ndim == 3 else part["uv"][part["faces"]]
        scale, offset = places[number]
        part["uv"] = np.where((numbers == number)[:, None, None], uv * scale + offset, uv)
    return part


def _with_materials(model, part: Part, palette, name) -> Part:
    """Give a part its name and, of a palette, the materials that its faces use, in the order of their first use.

    Faces without texture coordinates get their material without its texture.
    """
    numbers = part.pop("face_material")
    has_uv = part.pop("has_uv", None)
    if has_uv is not None:
        numbers, palette = numbers.copy(), list(palette)
        for number in distinct(numbers[~has_uv]).tolist():
            if palette[number].texture is not None:
                is_bare = (numbers == number) & ~has_uv
                palette.insert(-1, replace(palette[number], texture=None))  # the last one is the unnamed, -1
                numbers[is_bare] = len(palette) - 2
                model.warn(
                    f"{counted(int(is_bare.sum()), 'face')} of mesh '{cut(name, 80)}' without texture "
                    f"coordinates, with the material '{cut(palette[number].name, 80)}': drawn without its texture"
                )
    part["name"] = name
    if (numbers == numbers[0]).all():
        return part | {"material": palette[numbers[0]]}
    used, first, inverse = np.unique(numbers, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.argsort(order).astype(np.int32)
    return part | {"materials": tuple(palette[used[k]] for k in order), "face_material": rank[inverse]}


# ----------------------------------------------------------------
# The lines of a file as arrays: numbers, corners of faces, names; or which line is at fault.
#
# bytes ─ tidy text ─ lines of a keyword ─┬─ words, some lines at a time ─┬─ rows of v, vn, vt
#                                         └─ names of o, g, s, usemtl …   └─ corners of f
#
# Of a long file compiled code reads the lines that hold nothing unusual (text_kernels.py); what it leaves is read as a
# short file is.

_ATTRIBUTES = {"v": "vertex", "vt": "texture coordinate", "vn": "normal"}  # in the order of a corner
_LEAST = {"v": 3, "vt": 1, "vn": 3}  # numbers of a line
COLORED, NO_COLOR = 6, -np.inf  # numbers of a vertex with a colour; each of the last three where it has none
_BLOCK = 1 << 13  # lines that a thread reads
_LETTERS = 1 << 18  # that are looked at in one go: their arrays stay in the cache
_CORNER = re.compile(rb"([+-]?\d{1,18})(?:/([+-]?\d{1,18})?(?:/([+-]?\d{1,18})?(?:/.*)?)?)?")


class LineError(Exception):
    """A line can't be read; its arguments are which line, from 0, and why."""


class Corners(NamedTuple):
    """What the face lines say; indices count from 0, -1 where a corner has none; None where the file has none."""

    lines: NDArray[np.int64]  # (n_face,) of the file, from 0
    counts: NDArray[np.int64]  # (n_face,) how many corners each has
    v: NDArray[np.signedinteger]  # (n_corner,)
    vt: NDArray[np.signedinteger] | None  # (n_corner,)
    vn: NDArray[np.signedinteger] | None  # (n_corner,)


class ObjLines:
    """Hold the lines of an OBJ file, given as bytes; compiled code reads those of a file with `few` letters or more."""

    # Once `corners` has been called: faces with fewer than three corners, and those that refer to what there is not.
    n_short_face = 0
    missing: dict[str, int] = {}

    def __init__(self, data: bytes, few: int = FEW):
        self._is_long = len(data) >= few
        self._workers = Workers(n_core() if self._is_long else 1)
        text, self._joints = _tidy(data if data.isascii() else text_of(data).encode())
        self._index(text)
        if (self._heads & 255 == ord(" ")).any():
            self._index(re.sub(rb"^ +", b"", text, flags=re.MULTILINE))

    def _index(self, text) -> None:
        """Find where the lines of a text begin and end, and the first two letters of each as one number."""
        self._text, self._letters = text, np.frombuffer(text, np.uint8)
        blocks = self._workers.map(self._lines_from, range(0, len(text), _LETTERS))
        ends, heads = map(np.concatenate, zip(*blocks, strict=True))
        self._ends, self._starts = ends, np.concatenate(([0], ends[:-1] + 1))
        first = np.array([int.from_bytes(text[:2], "little")], np.uint16)
        self._heads = np.concatenate((first, heads[:-1]))

    def _lines_from(self, begin: int) -> tuple[NDArray[np.int64], NDArray[np.uint16]]:
        """Return where lines end in some letters, and the first two letters of the line behind each of them."""
        ends = np.flatnonzero(self._letters[begin : begin + _LETTERS] == ord("\n")) + begin
        first, second = self._letters.take(ends + 1, mode="clip"), self._letters.take(ends + 2, mode="clip")
        return ends, first | second.astype(np.uint16) << 8

    def number_of(self, line: int) -> int:
        """Return the number of a line in the file, from 1; of lines that a backslash joins the first."""
        return int(line) + 1 + bisect_left(self._joints, line)

    def lines_of(self, keyword: str) -> NDArray[np.int64]:
        """Return which lines begin with a keyword and a blank: (n,) ascending, from 0."""
        head, rest = f"{keyword} ".encode()[:2], f"{keyword} ".encode()[2:]
        lines = np.flatnonzero(self._heads == int.from_bytes(head, "little"))
        for place, letter in enumerate(rest, 2):
            lines = lines[self._letters.take(self._starts[lines] + place, mode="clip") == letter]
        return lines

    def names_of(self, keyword: str) -> tuple[NDArray[np.int64], list[str]]:
        """Return the lines of a keyword as `lines_of` does, and what stands behind it on each."""
        lines = self.lines_of(keyword)
        places = zip((self._starts[lines] + len(keyword)).tolist(), self._ends[lines].tolist(), strict=True)
        return lines, [self._text[start:end].decode().strip() for start, end in places]

    def rows_of(self, keyword: str) -> NDArray[np.float64]:
        """Return the numbers of all lines of v, vt or vn.

        Returns
        -------
        (n_line, k) float64: as many numbers as all lines have, at least 3, of vt 2: a second one that is missing is 0.
        Where some lines of v have a colour, the others have NO_COLOR for each of its numbers

        Raises
        ------
        LineError : a line with too few numbers, or with something else
        """
        tables = self._read_lines(keyword, self.lines_of(keyword))
        if len(tables) == 1:
            return tables[0]
        widths = [table.shape[1] for table in tables]
        width = COLORED if keyword == "v" and max(widths) >= COLORED else min(widths)
        return np.concatenate([_widened(table, width) for table in tables])

    def corners(self) -> Corners:
        """Return the corners of all face lines; of a corner with more than three numbers the first three count.

        Raises
        ------
        LineError : a word that is no corner, or refers to a vertex that there is not
        """
        self._given = dict(zip(_ATTRIBUTES, map(self.lines_of, _ATTRIBUTES), strict=True))
        face_lines = self.lines_of("f")
        columns = [*zip(*self._read_lines("f", face_lines), strict=True)]
        counts, missing = np.concatenate(columns[0]), np.sum(columns[-1], axis=0).tolist()
        self.n_short_face = int((counts < 3).sum())
        self.missing = dict(zip(("texture coordinates", "normals"), missing, strict=True))
        indices = [None if column[0] is None else np.concatenate(column) for column in columns[1:-1]]
        return Corners(face_lines, counts, *indices)

    def first_fault(self) -> tuple[int, str] | None:
        """Return the first line that can't be read, from 0, and why; None where all can be."""
        faults = []
        for keyword in (*_ATTRIBUTES, "f"):
            try:
                self.corners() if keyword == "f" else self.rows_of(keyword)
            except LineError as fault:
                faults.append(fault.args)
        return min(faults, default=None)

    def _read_lines(self, keyword, lines) -> list:
        """Read the lines of v, vt, vn or f, some at a time, on threads where the file is long; what `_read_some` makes
        of each, and of none where there are none."""
        begins = range(0, max(len(lines), 1), _BLOCK)
        return self._workers.map(partial(self._read_some, keyword, lines), begins)

    def _read_some(self, keyword, lines, begin) -> Any:
        report_progress(begin, len(lines), f"reading lines '{keyword}'")
        lines = lines[begin : begin + _BLOCK]
        return self._corners_in(lines) if keyword == "f" else self._rows_in(keyword, lines)

    def _rows_in(self, keyword, lines) -> NDArray[np.float64]:
        """Return the numbers of some lines, as many as all of these have."""
        if self._is_long and len(lines):
            from .text_kernels import POWERS, read_rows

            starts = self._starts[lines] + len(keyword)
            n_column = len(self._text[starts[0] : self._ends[lines[0]]].split())
            out = np.empty((len(lines), n_column))
            if n_column >= max(_LEAST[keyword], 2) and read_rows(self._letters, starts, POWERS, out):
                return out
        return _read_rows(keyword, lines, self._words_in(keyword, lines))

    def _corners_in(self, lines) -> tuple[NDArray, ...]:
        """Return what `Corners` holds of some face lines, but for these, and how many name a vt, and a vn, that the
        file doesn't have."""
        if self._is_long and len(lines):
            from .text_kernels import read_corners

            starts, counts = self._starts[lines] + 1, np.empty(len(lines), np.int64)
            n_letter = int((self._ends[lines] - starts).sum())
            out = np.empty((3, n_letter // 2 + 1), np.int32)
            n_corner = read_corners(self._letters, starts, counts, out)
            if n_corner >= 0:
                indices, missing, is_bad = _find_vertices(self._given, lines, counts, out[:, :n_corner])
                if not is_bad.any():
                    return counts, *indices, missing
        return _read_corners(self._given, lines, self._words_in("f", lines))

    def _words_in(self, keyword, lines) -> list[list[bytes]]:
        """Return the words of each line, without keyword and comment."""
        first, last = (int(lines[k]) if len(lines) else 0 for k in (0, -1))
        text = self._text[self._starts[first] : self._ends[last]]
        if last - first + 1 == len(lines) and b"#" not in text:
            # As nearly always, lines of one keyword stand together, and have as many words each.
            words, n = text.split(), len(self._text[self._starts[first] : self._ends[first]].split())
            if len(words) == n * len(lines) and words[::n].count(keyword.encode()) == len(lines):
                return [words[k + 1 : k + n] for k in range(0, len(words), n)]
        places = zip((self._starts[lines] + len(keyword)).tolist(), self._ends[lines].tolist(), strict=True)
        return [self._text[start:end].partition(b"#")[0].split() for start, end in places]


def _tidy(data) -> tuple[bytes, list[int]]:
    """Return the text with a newline behind each line and no other blanks than ' '; and the lines to which a backslash
    at their end joined the next, ascending, each as often as it did."""
    data, joints = data if data.endswith(b"\n") else data + b"\n", []
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if b"\\" in data:
        pieces, n_line = re.split(rb"\\[ \t\v\f]*\n", data), 0
        for k, piece in enumerate(pieces[:-1]):
            n_line += piece.count(b"\n")
            if b"#" in piece[piece.rfind(b"\n") + 1 :]:  # a comment ends with its line, whatever stands there
                pieces[k], n_line = piece + b"\n", n_line + 1
            else:
                pieces[k] = piece + b" "
                joints.append(n_line)
        data = b"".join(pieces) + b"\n"  # the last line may have been one that is joined
    for blank in b"\t\v\f":
        data = data.replace(bytes([blank]), b" ")
    return data, joints


def _widened(table, width) -> NDArray[np.float64]:
    """Return as many columns of a table (n, k); those that it lacks are NO_COLOR."""
    n_lacking = width - table.shape[1]
    return np.pad(table, ((0, 0), (0, n_lacking)), constant_values=NO_COLOR) if n_lacking > 0 else table[:, :width]


def _read_rows(keyword, lines, rows) -> NDArray[np.float64]:
    """Return the numbers of some lines, as many as all of these have; of v six where some have a colour, the others
    NO_COLOR for it. `rows` are their words."""
    least, widths = _LEAST[keyword], {*map(len, rows)}
    n_least = min(widths, default=least)
    width = max(n_least, least, 2)
    if keyword == "v" and n_least < COLORED <= max(widths, default=0):
        width, rest = COLORED, [b"-inf"] * COLORED  # NO_COLOR
        rows = [row if len(row) >= COLORED else row[:least] for row in rows]
    else:
        rest = [b"0"]  # the second number of a vt may be missing
    even = rows if widths == {width} else [[*row, *rest][:width] for row in rows]
    values = read_words([*chain.from_iterable(even)])
    if values is not None and n_least >= least:
        return values.reshape(-1, width)
    raise next(_faults(keyword, lines, [row[:width] for row in rows]))


def _faults(keyword, lines, rows) -> Iterator[LineError]:
    """Yield what is wrong with the numbers of some lines."""
    for line, row in zip(lines.tolist(), rows, strict=True):
        for word in row:
            if read_words([word]) is None:
                yield LineError(line, f"'{_shown(word)}' is not a number")
        if len(row) < _LEAST[keyword]:
            yield LineError(line, f"a {_ATTRIBUTES[keyword]} has {len(row)} numbers, {_LEAST[keyword]} are needed")


class _Corners(dict):
    """Number the different corners that faces have, as they are met; `numbers` holds v, vt and vn of each, 0 where it
    has none, and where the word is no corner."""

    def __init__(self):
        super().__init__()
        self.numbers: list[tuple[int, ...]] = []

    def __missing__(self, word: bytes) -> int:
        if word.isdigit() and len(word) < 10:  # as most often: no slash, and an index that there may be
            self.numbers.append((int(word), 0, 0))
        else:
            found = _CORNER.fullmatch(word)
            v, vt, vn = found.groups("0") if found else "000"
            self.numbers.append((int(v), int(vt), int(vn)))
        return self.setdefault(word, len(self))


def _read_corners(given, lines, rows) -> tuple[NDArray, ...]:
    """Return the same of words that may be anything; `given` are all lines of v, vt and vn."""
    words, known = [*chain.from_iterable(rows)], _Corners()
    counts = np.fromiter(map(len, rows), np.int64, len(rows))
    which = np.fromiter(map(known.__getitem__, words), np.int64, len(words))
    numbers = np.array(known.numbers, np.int64).reshape(-1, len(given))[which].T
    indices, missing, is_bad = _find_vertices(given, lines, counts, numbers)
    if is_bad.any():
        corner = int(is_bad.argmax())
        line = int(lines[np.searchsorted(np.cumsum(counts), corner, side="right")])
        if _CORNER.fullmatch(words[corner]) is None:
            raise LineError(line, f"'{_shown(words[corner])}' is not a corner of a face (v, v/vt, v//vn or v/vt/vn)")
        so_far, bad = np.searchsorted(given["v"], line), int(numbers[0, corner])
        what = f"only {so_far} stand before it" if bad < 0 else f"the file has {len(given['v'])}"
        raise LineError(line, f"face refers to vertex {bad}, {what if bad else 'the first one is 1'}")
    return counts, *indices, missing


def _shown(word: bytes) -> str:
    """Return a word of a line for a message."""
    return cut(word.decode("utf-8", "replace"), 60)


def _find_vertices(given, lines, counts, numbers) -> tuple[list[NDArray | None], list[int], NDArray[np.bool_]]:
    """Turn the numbers that stand in the corners of faces into indices.

    Parameters
    ----------
    given : all lines of v, vt and vn
    lines, counts : (n_face,) lines of faces, and how many corners each has
    numbers : (3, n_corner) of each corner's v, vt and vn, 0 where it has none

    Returns
    -------
    indices : of v, vt and vn, (n_corner,) each, -1 where there is none; None where the file has none
    missing : how many faces name a vt, and a vn, that the file doesn't have
    is_bad : (3, n_corner), True for a v that the file doesn't have
    """
    indices, missing, is_bad = [], [0, 0], np.zeros(numbers.shape, np.bool_)
    for k, (number, given_lines) in enumerate(zip(numbers, given.values(), strict=True)):
        total, index = len(given_lines), number - 1
        if number.min(initial=0) < 0:  # it counts back from the last before the face
            so_far = np.repeat(np.searchsorted(given_lines, lines), counts)
            index = np.where(number < 0, np.maximum(so_far + number, -1), index)
        if k == 0:
            is_bad[k] = (index < 0) | (index >= total)
        else:
            is_missing = (index >= total) | ((number < 0) & (index < 0))
            if is_missing.any():
                index = np.where(is_missing, -1, index)
                missing[k - 1] = len(distinct(np.repeat(np.arange(len(counts)), counts)[is_missing]))
        indices.append(index if k == 0 or total else None)
    return indices, missing, is_bad
