"""Read STL. What its header promises is compared with the file before memory is spent."""

import codecs
import re

import numpy as np
from numpy.typing import NDArray

from ..cores import Workers, n_core
from ..errors import counted
from ..geometry.weld import weld_triangles
from ..scene.material import WHITE, Material
from .model_file import FEW, ModelFile, Part, numbers_in, report_progress, text_of

_STL_HEADER, _STL_FACE = 84, 50  # bytes
_HEAD = 4096  # bytes in which a text shows that it is one
_VERTEX = b"vertex "
_TEXT = re.compile(rb"(?:\xef\xbb\xbf)?(?:\s|#[^\r\n]*[\r\n])*solid", re.IGNORECASE)
_LIMIT = re.compile(rb"^ *(?:end)?solid(?![a-z0-9_])[^\n]*", re.MULTILINE)  # a line where a solid begins or ends
_PARTED = re.compile(rb"\b(end) +(loop|facet|solid)\b", re.IGNORECASE)
_BLOCK = 1 << 20  # letters that a thread reads
_STL_ROW = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(model: ModelFile) -> list[Part]:
    """Read binary or ASCII STL; its triangles share the vertices that are equal.

    A binary file may begin with 'solid', too. One that holds whole faces, though not as many as it says, is read as far
    as it goes; what stands behind the last face is left out. Both are reported.
    """
    data, length = model.data, len(model.data)
    header, head = data[:_STL_HEADER], data[:_HEAD]
    n_face = int.from_bytes(header[80:], "little")
    expected = _STL_HEADER + _STL_FACE * n_face
    if _TEXT.match(head) and length != expected and b"\0" not in head:
        return _read_ascii_stl(model)
    if length < _STL_HEADER:
        raise model.error(
            f"not an STL file: {length} bytes, a binary one has at least {_STL_HEADER}, "
            "an ASCII one begins with 'solid'"
        )
    n_found, rest = divmod(length - _STL_HEADER, _STL_FACE)
    if length < expected and rest:
        raise model.error(f"binary STL of {counted(n_face, 'face')} must have {expected} bytes, the file has {length}")
    if length != expected:
        n_face = n_found if rest == 0 else n_face
        model.tell(f"binary STL of another length than its header says; {counted(n_face, 'face')} read")
    if n_face == 0:
        return []
    attributes = np.empty(n_face, np.uint16)

    def read(begin, end):
        rows = np.frombuffer(data[_row(begin) : _row(end)], _STL_ROW)
        attributes[begin:end] = rows["attribute"]
        return rows["corners"]

    part = _soup(read, n_face, "")
    return [part | _stl_colors(header, attributes)]


def _row(face: int) -> int:
    """Return the place of a face in a binary file."""
    return _STL_HEADER + _STL_FACE * face


def _soup(read, n_face, name) -> Part:
    """Make a part of triangles; parameters as in `weld_triangles`."""
    vertices, faces = weld_triangles(read, n_face)
    return {"vertices": vertices, "faces": faces, "name": name, "material": Material()}


def _read_ascii_stl(model) -> list[Part]:
    """Read the solids of an ASCII file, keywords in any case: what stands between lines 'solid' and 'endsolid'."""
    data = model.data[:].removeprefix(codecs.BOM_UTF8)
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\t", b" ")
    if b"end " in data.lower():
        data = _PARTED.sub(rb"\1\2", data)
    text = data.lower() + b" " * len(_VERTEX)
    lines = [*_LIMIT.finditer(text)]
    ends = [line.start() for line in lines[1:]] + [len(text)]
    found = [(line, end) for line, end in zip(lines, ends, strict=False) if text.find(b"facet", line.end(), end) >= 0]
    parts = []
    model.limits.count_meshes(len(found))
    for line, end in found:
        corners = _corners_in(text, line.end(), end)
        if corners is None or (end == len(text) and not text.rstrip().endswith(b"endfacet")):
            raise _stl_fault(model, text, line.end(), end)
        words = text_of(data[line.start() : line.end()]).split(None, 1)
        name = words[1].strip() if len(words) == 2 and words[0].lower() == "solid" else ""
        if len(corners):
            parts.append(_soup(lambda begin, end, corners=corners: corners[begin:end], len(corners), name))
    if found and found[-1][1] == len(text):
        model.warn("ASCII STL without 'endsolid' at its end: it may be cut off")
    return parts


def _corners_in(text: bytes, begin: int, end: int) -> NDArray[np.float64] | None:
    """Return the corners (n, 3, 3) of the facets between two places of a text in small letters; None where a line is at
    fault. Of a long text compiled code reads the lines that hold nothing unusual."""
    n_loop, letters = text.count(b"endloop", begin, end), np.frombuffer(text, np.uint8)

    def read(start: int) -> NDArray[np.float64]:
        from .text_kernels import POWERS, read_rows

        report_progress(start - begin, end - begin, "reading numbers")
        places = np.flatnonzero(letters[start : min(start + _BLOCK, end)] == _VERTEX[0]) + start
        for k in range(1, len(_VERTEX)):  # the text has blanks behind its end
            places = places[letters[places + k] == _VERTEX[k]]
        rows = np.empty((len(places), 3))
        return rows if read_rows(letters, places + len(_VERTEX), POWERS, rows) else rows[:0]

    if end - begin >= FEW:
        with Workers(n_core()) as workers:
            rows = np.concatenate(workers.map(read, range(begin, end, _BLOCK)))
        if len(rows) == 3 * n_loop:
            return rows.reshape(-1, 3, 3)
    found = re.findall(rb"\bvertex ([^\n]*)", text[begin:end])
    numbers = numbers_in(b" ".join(found)) if found else np.empty(0)
    is_whole = numbers is not None and len(numbers) == 3 * len(found) and len(found) == 3 * n_loop
    return numbers.reshape(-1, 3, 3) if is_whole else None


def _stl_fault(model, text, begin, end):
    """Return the error for the first line at fault between two places."""
    n_before, n_in_loop = text.count(b"\n", 0, begin), 0
    for line, row in enumerate(text[begin:end].split(b"\n"), n_before + 1):
        words = row.split()
        if words[:1] == [b"vertex"]:
            n_in_loop += 1
            if len(words) != 4 or numbers_in(b" ".join(words[1:])) is None:
                return model.error(f"'{text_of(row).strip()[:60]}' is not a vertex of three numbers", line)
        elif words[:1] == [b"endloop"]:
            if n_in_loop != 3:
                return model.error(f"a facet has {n_in_loop} vertices, 3 are needed", line)
            n_in_loop = 0
    return model.error("ASCII STL whose last facet is cut off", text.count(b"\n", 0, end) + 1)


def _stl_colors(header: bytes, attributes) -> dict:
    """Decode the colours that two conventions keep in the 16 attribute bits of a binary STL face.

    VisCAM and SolidView: bit 15 set where the face has a colour, then red, green, blue from the high bits
    down, 5 bits each. Materialise Magics: the header holds `COLOR=` and the part's RGBA, bit 15 *clear* where
    the face has its own, red lowest.
    """
    is_own = attributes >= 0x8000
    start = header.find(b"COLOR=")
    has_common = 0 <= start <= 70
    if not has_common and not is_own.any():
        return {}
    red, green, blue = ((attributes >> shift) & 31 for shift in (10, 5, 0))
    common = (255, 255, 255)
    if has_common:
        red, blue, is_own = blue, red, ~is_own
        common = tuple(header[start + 6 : start + 9])
    own = np.stack([red, green, blue], axis=1) * 255 // 31
    colors = np.where(is_own[:, None], own, np.array(common))
    return {"face_colors": colors.astype(np.uint8), "material": WHITE}
