"""Read the lines of an OBJ file as arrays: numbers, corners of faces, names; or say which line is at fault.

bytes ─ tidy text ─ lines of a keyword ─┬─ words, some lines at a time ─┬─ rows of v, vn, vt
                                        └─ names of o, g, s, usemtl …   └─ corners of f
"""

import re
from bisect import bisect_left
from collections.abc import Iterator
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .model_file import text_of
from .progress import report
from .text_numbers import BLANK, LEAD, NEWLINE, Words, divide, read_decimals, read_integers, split_words

_KINDS = {"v": "vertex", "vt": "texture coordinate", "vn": "normal"}  # in the order of a corner
_LEAST = {"v": 3, "vt": 1, "vn": 3}  # numbers of a line
_BLOCK = 1 << 13  # lines at a time: their arrays stay in the cache
_NO_COMMENT = re.compile(rb"\d\.#[A-Za-z]+\d*")  # 1.#QNAN, 1.#IND: what C libraries write for what is no number


class LineError(Exception):
    """A line can't be read; its arguments are which line, from 0, and why."""


class Corners(NamedTuple):
    """What the face lines say; indices count from 0, -1 where a corner has none; None where the file has none."""

    lines: NDArray[np.int64]  # (n_face,) of the file, from 0
    counts: NDArray[np.int64]  # (n_face,) how many corners each has
    v: NDArray[np.int64]  # (n_corner,)
    vt: NDArray[np.int64] | None  # (n_corner,)
    vn: NDArray[np.int64] | None  # (n_corner,)


class ObjLines:
    """Hold the lines of an OBJ file, given as bytes."""

    n_short_face = 0  # faces with fewer than three corners, once `corners` has been called

    def __init__(self, data: bytes):
        text, self._joints = _tidy(data if data.isascii() else text_of(data).encode())
        self._index(text)
        if (self._first_letters == BLANK).any():
            self._index(re.sub(rb"^ +", b"", text, flags=re.MULTILINE))

    def _index(self, text) -> None:
        """Find where the lines of a text begin and end."""
        self._text, self._letters = text, np.frombuffer(text, np.uint8)
        self._ends = np.flatnonzero(self._letters == NEWLINE)
        self._starts = np.concatenate(([0], self._ends[:-1] + 1))
        self._first_letters = self._letters[self._starts]

    def number_of(self, line: int) -> int:
        """Return the number of a line in the file, from 1; of lines that a backslash joins the first."""
        return int(line) + 1 + bisect_left(self._joints, line)

    def lines_of(self, keyword: str) -> NDArray[np.int64]:
        """Return which lines begin with a keyword and a blank: (n,) ascending, from 0."""
        lines = np.flatnonzero(self._first_letters == ord(keyword[0]))
        for place, letter in enumerate(f"{keyword} ".encode()):
            lines = lines[self._letters.take(self._starts[lines] + place, mode="clip") == letter]
        return lines

    def names_of(self, keyword: str) -> tuple[NDArray[np.int64], list[str]]:
        """Return the lines of a keyword as `lines_of` does, and what stands behind it on each."""
        lines = self.lines_of(keyword)
        places = zip((self._starts[lines] + len(keyword)).tolist(), self._ends[lines].tolist(), strict=True)
        return lines, [self._text[start:end].decode().strip() for start, end in places]

    def count_words(self, keyword: str) -> int:
        """Return how many words stand behind a keyword, on all its lines."""
        return sum(len(name.partition("#")[0].split()) for name in self.names_of(keyword)[1])

    def rows_of(self, keyword: str) -> NDArray[np.float64]:
        """Return the numbers of all lines of v, vt or vn.

        Returns
        -------
        (n_line, k) float64: as many numbers as all lines have, at least 3, of vt 2: a second one that is missing is 0

        Raises
        ------
        LineError : a line with too few numbers, or with something else
        """
        tables = [_read_rows(keyword, lines, words) for lines, words in self._words_of(keyword)]
        width = min(table.shape[1] for table in tables)
        return np.concatenate([table[:, :width] for table in tables])

    def corners(self) -> Corners:
        """Return the corners of all face lines; of a corner with more than three numbers the first three count.

        Raises
        ------
        LineError : a word that is no corner, or refers to a vertex or, if drawn, a normal that there is not
        """
        given = {kind: self.lines_of(kind) for kind in _KINDS}
        blocks = [_read_corners(given, lines, words) for lines, words in self._words_of("f")]
        columns = list(zip(*blocks, strict=True))
        self.n_short_face = sum(int((counts < 3).sum()) for counts in columns[1])
        return Corners(*(None if column[0] is None else np.concatenate(column) for column in columns))

    def first_fault(self) -> tuple[int, str] | None:
        """Return the first line that can't be read, from 0, and why; None where all can be."""
        faults = []
        for keyword in (*_KINDS, "f"):
            try:
                self.corners() if keyword == "f" else self.rows_of(keyword)
            except LineError as fault:
                faults.append(fault.args)
        return min(faults, default=None)

    def _words_of(self, keyword) -> Iterator[tuple[NDArray[np.int64], Words]]:
        """Yield lines of v, vt, vn or f, and their words without keyword and comments; one item at least."""
        lines_of_file = self.lines_of(keyword)
        for begin in range(0, max(len(lines_of_file), 1), _BLOCK):
            lines = lines_of_file[begin : begin + _BLOCK]
            is_next = np.diff(lines) == 1
            starts = self._starts[lines[np.append(True, ~is_next)[: len(lines)]]].tolist()
            ends = self._ends[lines[np.append(~is_next, True)[: len(lines)]]].tolist()
            text = b" " * LEAD + b"".join([self._text[a : b + 1] for a, b in zip(starts, ends, strict=True)])
            if b"#" in text:
                text = _NO_COMMENT.sub(lambda found: b"nan".ljust(len(found[0])), text)
                text = re.sub(rb"#.*", lambda found: b" " * len(found[0]), text)
            letters = np.frombuffer(bytearray(text), np.uint8)
            lengths = self._ends[lines] + 1 - self._starts[lines]
            line_starts = np.cumsum(lengths) - lengths + LEAD
            letters[line_starts[:, None] + np.arange(len(keyword))] = BLANK
            yield lines, split_words(letters, line_starts)
            report(begin, len(lines_of_file), f"reading lines '{keyword}'")


def _tidy(data) -> tuple[bytes, list[int]]:
    """Return the text with a newline behind each line and no other blanks than ' '; and the lines to which a backslash
    joined the next, ascending, each as often as it did."""
    data, joints = data if data.endswith(b"\n") else data + b"\n", []
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if b"\\" in data:
        pieces = data.split(b"\\\n")
        data = b" ".join(pieces) + b"\n"  # the last line may have been one that is joined
        joints = list(accumulate(piece.count(b"\n") for piece in pieces[:-1]))
    for blank in b"\t\v\f":
        data = data.replace(bytes([blank]), b" ")
    return data, joints


def _read_rows(keyword, lines, words) -> NDArray[np.float64]:
    """Return the numbers of some lines, as many as all of these have."""
    counts, least = np.diff(words.first), _LEAST[keyword]
    column = np.arange(max(int(counts.min(initial=len(words.starts))), least, 2))
    values, is_number = read_decimals(words)
    if is_number.all() and (counts == len(column)).all():  # as nearly always
        return values.reshape(-1, len(column))
    places = np.where(column < counts[:, None], words.first[:-1, None] + column, -1)
    is_bad = np.append(~is_number, False)[places]
    if is_bad.any() or counts.min(initial=least) < least:
        row = int(((counts < least) | is_bad.any(axis=1)).argmax())
        if is_bad[row].any():
            raise LineError(int(lines[row]), f"'{words.text(places[row, is_bad[row].argmax()])}' is not a number")
        raise LineError(int(lines[row]), f"a {_KINDS[keyword]} has {counts[row]} numbers, {least} are needed")
    return np.append(values, 0.0)[places]


def _read_corners(given, lines, words) -> tuple[NDArray[np.int64], ...]:
    """Return what `Corners` holds of some face lines; `given` are all lines of v, vt and vn."""
    pieces = divide(words, b"/")
    numbers, is_number = read_integers(pieces)
    counts, indices, faults = np.diff(words.first), [], []
    for k, (kind, given_lines) in enumerate(given.items()):
        total = len(given_lines)
        if k > 0 and len(numbers) == len(words.starts):  # no corner has a slash
            indices.append(np.full(len(numbers), -1) if total else None)
            continue
        place = pieces.first[:-1] + k
        place = np.where(place < pieces.first[1:], place, -1)
        number, is_bad = np.append(numbers, 0)[place], np.append(~is_number, False)[place]
        index = number - 1
        if number.min(initial=0) < 0:  # it counts back from the last before the face
            so_far = np.repeat(np.searchsorted(given_lines, lines), counts)
            index = np.where(number < 0, np.maximum(so_far + number, -1), index)
        if kind == "v":
            is_bad |= (index < 0) | (index >= total)
        elif kind == "vn":  # those of faces that are left out are of no concern
            is_bad |= (index >= total) & np.repeat(counts >= 3, counts)
        if is_bad.any():
            corner = int(is_bad.argmax())
            line = int(lines[np.searchsorted(words.first, corner, side="right") - 1])
            so_far, bad = np.searchsorted(given_lines, line), int(number[corner])
            what = "the first one is 1" if bad == 0 else f"only {so_far} stand before it"
            reason = f"face refers to {_KINDS[kind]} {bad}, {what if bad <= 0 else f'the file has {total}'}"
            word = words.text(corner)
            if word.startswith("/") or not is_number[place[corner]]:
                reason = f"'{word}' is not a corner of a face (v, v/vt, v//vn or v/vt/vn)"
            faults.append((corner, k, line, reason))
        indices.append(index if kind == "v" or total else None)
    if faults:
        raise LineError(*min(faults)[2:])
    return lines, counts, *indices
