"""Read STL and OFF. What their headers promise is compared with the file before memory is spent."""

import codecs
import re

import numpy as np

from ..errors import counted
from ..scene.material import Material
from .model_file import WHITE, Contents, ModelFile, Part, bytes_of, check_indices, cut_faces, text_of
from .text_numbers import numbers_in
from .weld import weld_triangles

_STL_HEADER, _STL_FACE = 84, 50  # bytes
_STL_ROW = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(model: ModelFile) -> list[Part]:
    """Read binary or ASCII STL; its triangles share the vertices that are equal.

    A binary file may begin with 'solid', too. One that holds whole faces, though not as many as it says, is read as far
    as it goes; what stands behind the last face is left out. Both are reported.
    """
    data, length = model.data, len(model.data)
    n_face = int.from_bytes(data[80:84], "little")
    expected = _STL_HEADER + _STL_FACE * n_face
    is_text = (
        data.removeprefix(codecs.BOM_UTF8).lstrip()[:5].lower() == b"solid"
        and length != expected
        and b"\0" not in data[:4096]
    )
    if is_text:
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
        model.log(f"{model.name}: binary STL of another length than its header says; {counted(n_face, 'face')} read")
    if n_face == 0:
        return []
    rows = np.frombuffer(data, _STL_ROW, n_face, _STL_HEADER)
    part = _soup(rows["corners"], "")
    return [part | _stl_colors(data[:80], rows["attribute"])]


def _soup(corners, name) -> Part:
    """Make a part of triangles (n, 3, 3)."""
    vertices, faces = weld_triangles(corners)
    return {"vertices": vertices, "faces": faces, "name": name, "material": Material()}


def _read_ascii_stl(model) -> list[Part]:
    """Read the solids of an ASCII file, keywords in any case."""
    text = text_of(model.data).replace("\r\n", "\n").replace("\r", "\n")
    lower = text.lower()  # of ASCII letters alone, so that places stay the same
    if len(lower) != len(text):
        lower = "".join(letter.lower() if letter.isascii() else letter for letter in text)
    if "endsolid" not in lower:
        raise model.error("ASCII STL without 'endsolid': the file is cut off")
    parts, begin = [], 0
    for end in re.finditer(r"endsolid[^\n]*", lower):
        solid = lower[begin : end.start()]
        rows = re.findall(r"\bvertex ([^\n]*)", solid.replace("\t", " "))
        numbers = numbers_in(" ".join(rows)) if rows else np.empty(0)
        if numbers is None or len(numbers) != 3 * len(rows) or len(rows) % 3 or len(rows) != 3 * solid.count("endloop"):
            raise _stl_fault(model, lower, begin, end.start())
        first = text[begin : begin + len(solid)].lstrip().split("\n", 1)[0].split(None, 1)
        name = first[1].strip() if len(first) == 2 and first[0].lower() == "solid" else ""
        if len(rows):
            parts.append(_soup(numbers.reshape(-1, 3, 3), name))
        begin = end.end()
    return parts


def _stl_fault(model, text, begin, end):
    """Return the error for the first line at fault between two places."""
    n_before, n_in_loop = text.count("\n", 0, begin), 0
    for line, row in enumerate(text[begin:end].split("\n"), n_before + 1):
        words = row.split()
        if words[:1] == ["vertex"]:
            n_in_loop += 1
            if len(words) != 4 or numbers_in(" ".join(words[1:])) is None:
                return model.error(f"'{row.strip()[:60]}' is not a vertex of three numbers", line)
        elif words[:1] == ["endloop"]:
            if n_in_loop != 3:
                return model.error(f"a facet has {n_in_loop} vertices, 3 are needed", line)
            n_in_loop = 0
    return model.error("ASCII STL whose last facet is cut off", text.count("\n", 0, end) + 1)


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


# --- OFF ----------------------------------------------------------------------------------------------------

_OFF_WORD = re.compile(r"\s*(?:#[^\n]*\n\s*)*(ST)?(C)?(N)?(4)?(n)?OFF\b(\s+BINARY\b)?", re.ASCII)


def read_off(model: ModelFile) -> Contents:
    """Read OFF with its polygons; of COFF, NOFF, STOFF the colours, normals and texture coordinates of the vertices,
    and the colours of faces where each has one.

    Format: Geomview manual 1.9, "OFF Files": a vertex is its place, its normal, its colour, its texture coordinates.
    """
    text = text_of(model.data)
    word = _OFF_WORD.match(text)
    if not word:
        raise model.error("not an OFF file: 'OFF' is missing at its start")
    has_uv, has_color, has_normal, has_w, is_n, is_binary = (group is not None for group in word.groups())
    if is_n or is_binary:
        raise model.error(f"{'n' if is_n else 'binary '}OFF, which is not read")
    n_before = text.count("\n", 0, word.end())
    lines = [(n, line.partition("#")[0]) for n, line in enumerate(text[word.end() :].split("\n"), n_before + 1)]
    lines = [(n, line) for n, line in lines if line and not line.isspace()]
    n_vertex, n_face = _off_counts(model, lines)
    rows, face_rows = lines[1 : 1 + n_vertex], lines[1 + n_vertex : 1 + n_vertex + n_face]
    width = 3 + has_w + 3 * has_normal + 3 * has_color + 2 * has_uv
    table = _off_vertices(model, rows, width, width - 2 * has_uv if has_color else None)
    points = table[:, :3] / table[:, 3:4] if has_w else table[:, :3]
    corners, counts, extra = _off_faces(model, face_rows)

    def place(row):
        return f":{face_rows[row][0]}: the face"

    check_indices(model, corners, counts, n_vertex, place)
    n_point, n_line = int((counts == 1).sum()), int((counts == 2).sum())
    if counts.max(initial=0) < 3:
        return Contents([], n_point=n_vertex, n_line=n_line)
    cut = cut_faces(model, points, corners, counts, place)
    part = {"vertices": np.ascontiguousarray(points), "faces": corners[cut.corners], "name": "", "material": Material()}
    if counts.max() > 3:
        part["polygons"] = cut.polygons
    at = 3 + has_w
    if has_normal:
        part["normals"] = np.ascontiguousarray(table[:, at : at + 3])
    at += 3 * has_normal
    if has_color:
        part |= {"colors": bytes_of(table[:, at : at + 3]), "material": WHITE}
    elif extra is not None:
        part |= {"face_colors": bytes_of(extra)[cut.polygons], "material": WHITE}
    if has_uv:
        part["uv"] = np.ascontiguousarray(table[:, -2:])
    return Contents([part], n_point=n_point, n_line=n_line)


def _off_counts(model, lines) -> tuple[int, int]:
    """Return how many vertices and faces there are, which the file must have room for."""
    if not lines:
        raise model.error("not a readable OFF file: no line says how many vertices and faces it has")
    line, text = lines[0]
    words = text.split()
    if len(words) < 2 or not all(word.isascii() and word.isdigit() and len(word) < 19 for word in words[:2]):
        raise model.error(f"'{text.strip()[:60]}' does not say how many vertices and faces there are", line)
    n_vertex, n_face = int(words[0]), int(words[1])
    if n_vertex + n_face > len(lines) - 1:
        found = f"{min(n_vertex, len(lines) - 1)} and {max(0, len(lines) - 1 - n_vertex)}"
        raise model.error(f"the header promises {n_vertex} vertices and {n_face} faces, the file has {found}", line)
    return n_vertex, n_face


def _off_vertices(model, rows, width, alpha_at) -> np.ndarray:
    """Return the numbers of the vertices, (n, width), without a colour's fourth, its alpha, which stands at
    `alpha_at`."""
    numbers = numbers_in(" ".join(line for _, line in rows)) if rows else np.empty(0)
    if numbers is not None and len(numbers) == width * len(rows) and len(rows) and len(rows[0][1].split()) == width:
        lengths = {len(line.split()) for _, line in rows}
        if lengths == {width}:
            return numbers.reshape(-1, width)
    table = np.empty((len(rows), width))
    for k, (number, line) in enumerate(rows):
        words = line.split()
        if alpha_at is not None and len(words) == width + 1:
            del words[alpha_at]
        found = numbers_in(" ".join(words[:width]))
        if found is None or len(found) < width:
            raise model.error(f"'{line.strip()[:60]}' is not a vertex of {width} numbers", number)
        table[k] = found
    return table


def _off_faces(model, rows):
    """Return all corners, how many each face has, and colours (n, 3) where every face has three or four numbers
    more."""
    sizes = np.array([len(line.split()) for _, line in rows], np.int64)
    numbers = numbers_in(" ".join(line for _, line in rows)) if rows else np.empty(0)
    starts = np.cumsum(sizes) - sizes
    if numbers is None or len(numbers) != sizes.sum():
        for number, line in rows:
            if numbers_in(line) is None:
                raise model.error(f"'{line.strip()[:60]}' holds something that is no number", number)
        raise model.error("not a readable OFF file: a face line holds something that is no number")
    counts = numbers[starts]
    is_bad = ~((counts >= 0) & (counts < sizes) & (counts == np.rint(counts)))
    if is_bad.any():
        row = int(is_bad.argmax())
        raise model.error(
            f"not a readable OFF file: a face line has fewer corners than it says, {counts[row]:g}", rows[row][0]
        )
    counts = counts.astype(np.int64)
    step = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    corners = numbers[np.repeat(starts + 1, counts) + step]
    if not ((np.abs(corners) < 2.0**53) & (corners == np.rint(corners))).all():
        bad = np.flatnonzero(~((np.abs(corners) < 2.0**53) & (corners == np.rint(corners))))[0]
        row = int(np.searchsorted(np.cumsum(counts), bad, side="right"))
        raise model.error(f"the face refers to vertex {corners[bad]:g}, which is no index", rows[row][0])
    left = sizes - 1 - counts
    extra = None
    if len(left) and (left >= 3).all() and (left <= 4).all():
        extra = numbers[(starts + 1 + counts)[:, None] + np.arange(3)]
    return corners.astype(np.int64), counts, extra
