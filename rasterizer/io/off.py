"""Read OFF: vertices, polygons, normals, colours, texture coordinates.

    numbers of the file ─ rows of vertices ─ polygons, cut as those of OBJ and PLY are ─ a part

The letters of its first word say what a vertex has behind x y z: 4 w, by which they are divided; N a normal; C a
colour; ST texture coordinates, whatever their order. MeshLab writes NCOFF, with the colour before the normal: what is
longer than a normal is that. Lines count for colours alone: 3 or 4 numbers more on the line of a vertex, or behind
the corners of a face, are its colour. An index of a colour is left out: the format has no table of them.
Format: Geomview manual, 1.9.5, OFF.
"""

import re

import numpy as np
from numpy.typing import NDArray

from ..errors import cut
from ..scene.material import WHITE, Material
from .model_file import Contents, ModelFile, Part, bytes_of, check_indices, cut_faces, numbers_in, text_of

_HEAD = re.compile(r"(?:\s|#[^\n]*\n)*((?:ST|C|N)*)(4)?(n)?OFF(?![A-Za-z_])(\s+BINARY\b)?", re.ASCII)
_COLOR = (3, 4)  # how many numbers a colour has
LONGEST_NORMAL = 1.01  # along an axis: unit length, written with two digits


def read_off(model: ModelFile) -> Contents:
    """Read an OFF file; one part, or none where it has no faces."""
    text = text_of(model.data).replace("\r\n", "\n").replace("\r", "\n")
    head = _HEAD.match(text)
    if not head:
        raise model.error("not an OFF file: 'OFF' is missing at its start")
    has_uv, has_color, has_normal = (letter in head[1] for letter in "SCN")
    has_w, is_n, is_binary = (group is not None for group in head.groups()[1:])
    if is_n or is_binary:
        raise model.error(f"{'binary ' if is_binary else '4' * has_w + 'n'}OFF, which is not read")
    numbers, ends, words = _numbers(model, text[head.end() :], 1 + text.count("\n", 0, head.end()))
    n_count = 2 if ends[:1] == [2] else 3
    counts = numbers[:n_count]
    if len(counts) < n_count or not ((counts >= 0) & (counts < 2**31) & (counts == np.rint(counts))).all():
        raise model.error(f"'{cut(words)}' does not say how many vertices and faces there are")
    n_vertex, n_face = map(int, counts[:2])
    least = 3 + has_w + 3 * has_normal + 2 * has_uv
    widths = np.diff(ends[: n_vertex + 1])
    is_by_line = ends[:1] == [n_count] and len(widths) == n_vertex > 0 and (widths == widths[0]).all()
    width = int(widths[0]) if is_by_line and widths[0] >= least else least + 4 * has_color
    begin = n_count + n_vertex * width
    corners = _faces(numbers.tolist(), ends, begin, n_face)
    if begin > len(numbers) or len(corners) < n_face:
        found = f"{min(n_vertex, (len(numbers) - n_count) // width)} and {len(corners)}"
        raise model.error(f"the header promises {n_vertex} vertices and {n_face} faces, the file has {found}")
    if n_face == 0:
        return Contents([], n_point=n_vertex)
    table = numbers[n_count:begin].reshape(n_vertex, width)
    points, table = table[:, :3], table[:, 3:]
    if has_w:
        with np.errstate(all="ignore"):
            points, table = points / table[:, :1], table[:, 1:]
    if head[1].startswith("NC") and table.shape[1] >= 7:
        is_unit = [bool((np.abs(table[:, k : k + 3]) <= LONGEST_NORMAL).all()) for k in (0, 4)]
        if is_unit == [False, True]:
            table = np.hstack([table[:, 4:7], table[:, :4], table[:, 7:]])
    part = {"normals": table[:, :3]} if has_normal else {}
    table = table[:, 3 * has_normal :]
    if has_uv:
        part["uv"], table = table[:, -2:], table[:, :-2]
    if table.shape[1] in _COLOR:
        part["colors"] = bytes_of(model, table)
    return _contents(model, points, part, numbers, corners)


def _numbers(model, text: str, first_line: int) -> tuple[NDArray[np.float64], list[int], str]:
    """Return the numbers of a text without comments, how many stand up to the end of each line that has any, and the
    first of these lines."""
    rows = [line.partition("#")[0] for line in text.split("\n")]
    numbers = numbers_in("\n".join(rows).encode("utf-8", "replace"))
    if numbers is None:
        is_bad = [numbers_in(row.encode("utf-8", "replace")) is None for row in rows]
        number = is_bad.index(True)
        words = [word for word in rows[number].split(" ") if numbers_in(word.encode("utf-8", "replace")) is None]
        raise model.error(f"'{cut((words or rows[number : number + 1])[0], 40)}' is not a number", first_line + number)
    letters = np.frombuffer(" \n".join(["", *rows, ""]).encode("utf-8", "replace"), np.uint8)
    is_letter = letters > ord(" ")
    n_word = np.cumsum(is_letter[1:] & ~is_letter[:-1])  # up to each letter
    ends = np.unique(n_word[letters[1:] == ord("\n")])
    return numbers, ends[ends > 0].tolist(), next((row.strip() for row in rows if row.strip()), "")


def _faces(numbers: list[float], ends: list[int], begin: int, n_face: int) -> list[tuple[int, int, int]]:
    """Return where each face begins, where its corners end, and where its colour does: with its line, unless faces
    share lines. Of a file with too few, those that there are."""
    found = []
    for is_colored in (True, False):
        found, place, line = [], begin, 0
        while len(found) < n_face and place < len(numbers) and 0 <= numbers[place] < len(numbers) - place:
            end = place + 1 + int(numbers[place])
            while is_colored and ends[line] < end:
                line += 1
            stop = ends[line] if is_colored else end
            if stop - end > max(_COLOR):
                break
            found.append((place, end, stop))
            place = stop
        if len(found) == n_face:
            break
    return found


def _contents(model, points, part: Part, numbers, faces) -> Contents:
    """Make the part of vertices, with what they have, and faces."""
    begins, ends, stops = np.array(faces).T
    counts, left_out = ends - begins - 1, []
    corners = numbers[np.repeat(ends - np.cumsum(counts), counts) + np.arange(counts.sum())]
    if not (corners == np.rint(corners)).all():
        raise model.error(f"a face refers to vertex {corners[corners != np.rint(corners)][0]}, which is no index")
    corners = np.clip(corners, -1.0, 2.0**53).astype(np.int64)

    def place(face):
        return f": face {face}"

    check_indices(model, corners, counts, len(points), place)
    if counts.max() < 3:
        return Contents([], n_line=len(counts))
    pieces = cut_faces(model, points, corners, counts, place)
    widths = stops - ends
    is_colored = np.isin(widths, _COLOR)
    if ((widths > 0) & ~is_colored).any():
        left_out.append("indices of colours")
    if is_colored.any() and "colors" in part:
        left_out.append("colours of faces beside those of vertices")
    elif is_colored.any():
        colors = np.full((len(faces), int(widths[is_colored].min())), 255, np.uint8)
        colors[is_colored] = bytes_of(model, numbers[ends[is_colored, None] + np.arange(colors.shape[1])])
        part["face_colors"] = pieces.of_polygons(colors)
    if counts.max() > 3:
        part["polygons"] = pieces.polygons
    material = WHITE if "colors" in part or "face_colors" in part else Material()
    part |= {"vertices": points, "faces": pieces.of_corners(corners), "name": "", "material": material}
    return Contents([part], n_line=int((counts < 3).sum()), left_out=tuple(left_out))
