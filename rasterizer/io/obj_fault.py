"""Find the first line of an OBJ file that is at fault, after reading has failed; it may take its time."""

from itertools import islice

from .model_file import text_of
from .obj_corners import NO_NUMBER, without_signs

_N_NUMBERS = {"v": 3, "vn": 3, "vt": 1}
_KINDS = {"v": "vertex", "vt": "texture coordinate", "vn": "normal"}


def find_fault(data: bytes) -> tuple[int, str] | None:
    """Return the number of the first faulty line and what is wrong with it, or None if every line is legal.

    Parameters
    ----------
    data : the bytes of an OBJ file
    """
    lines = list(_numbered_lines(without_signs(text_of(data))))
    total = dict.fromkeys(_KINDS, 0)
    for _, words in lines:
        if words[0] in total:
            total[words[0]] += 1
    so_far = dict.fromkeys(_KINDS, 0)
    for number, words in lines:
        key, rest = words[0], words[1:]
        if key in _KINDS:
            so_far[key] += 1
            fault = _vector_fault(key, rest)
        elif key == "f":
            fault = _face_fault(rest, total, so_far)
        else:
            fault = None
        if fault:
            return number, fault
    return None


def line_of_face(data: bytes, face: int) -> int:
    """Return the number of the line of a face, counted from 0."""
    faces = (number for number, words in _numbered_lines(text_of(data)) if words[0] == "f" and len(words) > 1)
    return next(islice(faces, face, None), 0)


def _numbered_lines(text):
    """Yield the number and the words of every line that has any; a backslash joins a line to the next."""
    begun, start = "", None
    for number, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), 1):
        start = number if start is None else start
        if line.endswith("\\"):
            begun += line[:-1] + " "
            continue
        words = (begun + line).partition("#")[0].split()
        if words:
            yield start, words
        begun, start = "", None


def _vector_fault(key, words) -> str | None:
    """Return what is wrong with the numbers of a v, vt or vn line."""
    for word in words:
        if not _is_number(word):
            return f"'{word}' is not a number"
    if len(words) < _N_NUMBERS[key]:
        return f"a {_KINDS[key]} has {len(words)} numbers, {_N_NUMBERS[key]} are needed"
    return None


def _is_number(word) -> bool:
    try:
        float(word)
    except ValueError:
        return NO_NUMBER.fullmatch(word.lower()) is not None
    return "_" not in word


def _face_fault(words, total, so_far) -> str | None:
    """Return what is wrong with the corners of a face."""
    for word in words:
        for kind, index in zip(_KINDS, word.split("/"), strict=False):
            if not index and kind != "v":
                continue
            digits = index.removeprefix("-")
            if not (digits.isascii() and digits.isdigit() and len(digits) < 19):  # within int64
                return f"'{word}' is not a corner of a face (v, v/vt, v//vn or v/vt/vn)"
            fault = _index_fault(kind, int(index), total[kind], so_far[kind])
            if fault:
                return fault
    return None


def _index_fault(kind, index, total, so_far) -> str | None:
    """Return what is wrong with one index; a vt is not looked at, and 0 may stand for no normal."""
    if kind == "vt" or (kind == "vn" and index == 0):
        return None
    name = _KINDS[kind]
    if index == 0:
        return f"face refers to {name} 0, the first one is 1"
    if index < -so_far:
        return f"face refers to {name} {index}, only {so_far} stand before it"
    if index > total:
        return f"face refers to {name} {index}, the file has {total}"
    return None
