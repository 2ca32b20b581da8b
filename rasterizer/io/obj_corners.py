"""The table of corners of an OBJ file: which vertex, texture coordinate and normal each corner of each face line names.

In: the tidy text of the file, every line begun by a keyword. Out: `Corners`, and the rows of its v, vt and vn lines.
"""

import re
import warnings
from typing import NamedTuple

import numpy as np

# Ways to write a corner: slashes of one corner * 2 + whether two of them touch. The numbers say which columns
# are v, vt and vn.
_MARK = -8765432109
NO_NUMBER = re.compile(r"[+-]?nan\(.*\)")
_PATTERNS = {0: ("v",), 2: ("v", "vt"), 4: ("v", "vt", "vn"), 5: ("v", "vn")}


class MisreadError(Exception):
    """Lines of the file can't be read."""


class Corners(NamedTuple):
    """What the face lines say, indices counted from 0."""

    v: np.ndarray  # (n_corner,) int64
    vt: np.ndarray  # (n_corner,) int64, -1 where a corner has none
    vn: np.ndarray  # (n_corner,) int64, -1 where a corner has none
    n_corner: np.ndarray  # (n_face,) int64
    smoothing: np.ndarray  # (n_face,) int64, 0 = none


def without_signs(text) -> str:
    """Write nan for `1.#QNAN`, `-1.#IND` and the like, whose '#' begins no comment."""
    return re.sub(r"\d\.#[A-Za-z]+\d*", "nan", text) if ".#" in text else text


def read_corners(text) -> Corners:
    """Read the face lines, and which smoothing group is in force at each.

    Raises
    ------
    MisreadError : lines that are no list of corners
    """
    faces = re.findall(r"\nf (.*)", text)
    n_corner, pattern = _patterns(faces)
    columns = None if pattern is None else _read_uniform(faces, pattern, int(n_corner.sum()))
    columns = _read_mixed(faces, int(n_corner.sum())) if columns is None else columns
    indices = {}
    for kind in ("v", "vt", "vn"):
        column = columns.get(kind)
        if column is not None and column.min(initial=1) < 0:
            column = _count_from_start(column, text, kind, n_corner)
        indices[kind] = np.full(int(n_corner.sum()), -1) if column is None else column - 1
    if indices["v"].min(initial=0) < 0:
        raise MisreadError("a face refers to a vertex before the first")
    smoothing = in_force(text, "s", _smoothing_group, 0, len(faces))
    return Corners(**indices, n_corner=n_corner, smoothing=smoothing)


def _patterns(faces):
    """Return the number of corners of each face line, and their pattern, None if there are several."""
    blob = np.frombuffer("\n".join(faces).encode("utf-8", "replace"), np.uint8)
    is_gap = blob <= ord(" ")
    starts = np.flatnonzero(~is_gap & np.concatenate(([True], is_gap[:-1])))
    line_of_byte = np.cumsum(blob == ord("\n"), dtype=np.int32)
    n_corner = np.bincount(line_of_byte[starts], minlength=len(faces))
    if not len(starts):
        return n_corner, ("v",)
    is_slash = blob == ord("/")
    is_double = is_slash & np.concatenate(([False], is_slash[:-1]))
    code = 2 * np.add.reduceat(is_slash, starts, dtype=np.int32) + np.add.reduceat(is_double, starts, dtype=np.int32)
    return n_corner, _PATTERNS.get(int(code[0])) if (code == code[0]).all() else None


def numbers_in(text, dtype) -> np.ndarray | None:
    """Return the numbers of a text with blanks between them, None where it holds anything else; numpy before 2.4 only
    warns."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            return np.fromstring(text, dtype=dtype, sep=" ")
    except (ValueError, DeprecationWarning):
        return None


def _read_uniform(faces, pattern, n_corner) -> dict | None:
    """Read face lines whose corners are all written alike; return the columns by kind, as in the file; None where a
    corner, as `1//` or `1/2/`, has slashes without a number behind them."""
    text = " ".join(faces)
    numbers = _count_digits(text)
    if numbers is None:
        numbers = numbers_in(text.replace("//", " ").replace("/", " "), np.int64)
    if numbers is None or len(numbers) != n_corner * len(pattern):
        return None
    return dict(zip(pattern, numbers.reshape(-1, len(pattern)).T, strict=True))


def _count_digits(text) -> np.ndarray | None:
    """Return the numbers of a text of digits, blanks and slashes, None where it holds anything else; faster than
    `numbers_in`."""
    blob = np.frombuffer(text.encode("utf-8", "replace"), np.uint8)
    is_digit = blob - np.uint8(ord("0")) < 10  # what lies before '0' wraps round
    if not (is_digit | (blob == ord(" ")) | (blob == ord("/"))).all():
        return None
    change = np.flatnonzero(np.diff(is_digit, prepend=False, append=False))
    starts, ends = change[::2], change[1::2]
    length = ends - starts
    if length.max(initial=0) > 18:  # beyond int64
        return None
    numbers, scale = np.zeros(len(starts), np.int64), 1
    for place in range(1, length.max(initial=0) + 1):
        digit = blob[np.maximum(ends - place, starts)] - np.uint8(ord("0"))
        numbers += np.where(place <= length, digit, 0).astype(np.int64) * scale
        scale *= 10
    return numbers


def _read_mixed(faces, n_corner) -> dict:
    """Read face lines whose corners are written in different ways, a missing number as 0."""
    words = [[*word.split("/"), "", ""][:3] for word in " ".join(faces).split()]
    if len(words) != n_corner:
        raise MisreadError("a face line holds a blank that is none of ASCII's")
    try:
        table = np.array([[int(number or 0) for number in word] for word in words], np.int64)
    except (ValueError, OverflowError) as fault:
        raise MisreadError("a face line holds something that is no number") from fault
    return dict(zip(("v", "vt", "vn"), table.reshape(-1, 3).T, strict=True))


def _count_from_start(column, text, kind, n_corner):
    """Turn negative numbers, which count back from their line, into numbers from 1; 0 if there are none."""
    given_at = [match.start() for match in re.finditer(f"\n{kind} ", text)]
    face_at = [match.start() for match in re.finditer("\nf ", text)]
    so_far = np.repeat(np.searchsorted(given_at, face_at), n_corner)
    return np.where(column < 0, np.maximum(so_far + column + 1, 0), column)


def in_force(text, keyword, value_of, default, n_face):
    """Return for each face line the value of the last line before it that begins with the keyword."""
    values, n_before, place = [default], [], 0
    for match in re.finditer(rf"\n{keyword} (.*)", text):
        n_before.append(text.count("\nf ", place, match.start() + 1))
        values.append(value_of(match[1].strip()))
        place = match.start()
    n_before = np.cumsum(n_before, dtype=np.int64)
    return np.repeat(np.array(values, np.int64), np.diff(n_before, prepend=0, append=n_face))


def _smoothing_group(word: str) -> int:
    """Return the number of a smoothing group: `off` and anything unknown are 0, `on` is 1."""
    if word == "on":
        return 1
    is_number = word.isascii() and word.isdigit() and len(word) < 10  # within int32
    return int(word) if is_number else 0


def read_vectors(text, keyword, least) -> np.ndarray:
    """Return the numbers of every line with a keyword, (n, width) float64: as many as all lines have.

    Parameters
    ----------
    text : tidy
    keyword : "v", "vn" or "vt"
    least : how many a line must have

    Raises
    ------
    MisreadError : a line with fewer numbers, or with something else
    """
    rows = re.findall(rf"\n{keyword} (.*)", text)
    width = len(rows[0].split()) if rows else least
    # A number that no file has between the lines shows whether all are equally long.
    numbers = numbers_in(f" {_MARK} ".join([*rows, ""]), np.float64) if rows else np.empty(0)
    is_even = numbers is not None and len(numbers) == (width + 1) * len(rows)
    if is_even and (numbers[width :: width + 1] == _MARK).all():
        table = numbers.reshape(len(rows), width + 1)[:, :width]
    else:
        words = [row.split() for row in rows]
        width = min(map(len, words))
        table = np.array([[_number(word) for word in line[:width]] for line in words], np.float64).reshape(
            len(rows), width
        )
    if width < least:
        raise MisreadError(f"a line '{keyword}' has {width} numbers")
    return table


def _number(word) -> float:
    """Return the number that a word stands for; what C libraries write where there is none is not a number."""
    try:
        return float(word)
    except ValueError:
        if NO_NUMBER.fullmatch(word.lower()):
            return float("nan")
        raise MisreadError(f"'{word[:40]}' is not a number") from None


def read_texture_coordinates(text) -> np.ndarray:
    """Return the first two numbers of every vt line, (n, 2) float64; the second is 0 where a line has one."""
    rows = re.findall(r"\nvt (.*)", text)
    if len(rows) and not all(map(str.strip, rows)):
        raise MisreadError("a texture coordinate has no number")
    table = read_vectors(text, "vt", 1)
    if table.shape[1] == 1 and len(rows):  # some lines, or all, have but one
        table = np.array([[_number(word) for word in [*row.split(), "0"][:2]] for row in rows])
    return np.ascontiguousarray(table[:, :2]) if len(rows) else np.zeros((0, 2))
