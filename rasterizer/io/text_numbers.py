"""Read numbers in text by whole arrays, exactly rounded; in long texts by compiled code (text_kernels.py).

In: a text as an array of letters, whose first LEAD belong to no word. Out: the values of its words.

Digits are read eight at a time: the eight letters before a word's end are one integer, in which neighbours are joined
three times (Lemire 2021, Number parsing at a gigabyte per second, Software: Practice and Experience 51(8)). A decimal
number is its digits as one whole number m over a power of ten. Where m <= 2^53 both are float64 without rounding, so
one division rounds correctly (Clinger 1990, How to read floating point numbers accurately, PLDI). Python reads the
others.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..cores import Workers, n_core
from .files import LONG
from .model_file import report_progress

LEAD = 24  # so that the eight letters before the end of a word are there, three times
MAX_DIGITS = 18  # of a whole number within int64
BLANK, NEWLINE = b" \n"
_BLANKS = bytes.maketrans(b"\t\n\v\f\r", b" " * 5)  # what C's isspace calls so
_BLOCK = 1 << 18  # letters read in one go: their arrays stay in the cache
_SHORT = 1 << 8  # letters of a text whose words are sooner read one by one
_DIGIT, _PLUS, _MINUS, _POINT = b"0+-."
_POWERS = 10 ** np.arange(MAX_DIGITS + 1)
_BYTES = 0x0101010101010101
# The highest bit of a byte is set above 9 once 0x76 is added, if it wasn't before.
_ZEROS, _TO_HIGH, _HIGH = (np.uint64(byte * _BYTES) for byte in (_DIGIT, 0x76, 0x80))
# Neighbours become one number in the higher place: times 10 plus itself a place further, moved down, the rest cleared.
_JOINS = tuple(
    (np.uint64(10**n * 2 ** (8 * n) + 1), np.uint64(8 * n), np.uint64(kept))
    for n, kept in ((1, 0x00FF00FF00FF00FF), (2, 0x0000FFFF0000FFFF), (4, 0x00000000FFFFFFFF))
)
_KEPT = np.array([(_BYTES * 255 << 8 * (8 - n)) % 2**64 for n in range(9)], np.uint64)  # the last n of eight letters


class Words(NamedTuple):
    """Words in a text, half-open ranges of letters."""

    letters: NDArray[np.uint8]
    starts: NDArray[np.int64]  # (n_word,) ascending
    ends: NDArray[np.int64]  # (n_word,)
    first: NDArray[np.int64]  # (n + 1,) which word is the first of each line; of pieces, of each word

    def text(self, word: int) -> str:
        """Return one word."""
        return self.letters[self.starts[word] : self.ends[word]].tobytes().decode("utf-8", "replace")


def split_words(letters: NDArray[np.uint8], line_starts: NDArray[np.int64]) -> Words:
    """Split a text at blanks and newlines, with which it begins and ends; `line_starts` (n_line,) ascend."""
    is_gap = (letters == BLANK) | (letters == NEWLINE)
    changes = np.flatnonzero(is_gap[1:] != is_gap[:-1])
    changes += 1
    starts, ends = changes[::2], changes[1::2]
    return Words(letters, starts, ends, np.append(np.searchsorted(starts, line_starts), len(starts)))


def divide(words: Words, separator: bytes) -> Words:
    """Return the pieces of words between separators, some of them empty."""
    is_separator = words.letters == separator[0]
    if not is_separator.any():
        return words._replace(first=np.arange(len(words.starts) + 1))
    places = np.flatnonzero(is_separator)
    starts, ends = np.concatenate((words.starts, places + 1)), np.concatenate((words.ends, places))
    starts.sort(kind="stable")  # each word and each separator begins a piece
    ends.sort(kind="stable")
    return Words(words.letters, starts, ends, np.append(np.searchsorted(starts, words.starts), len(starts)))


def read_integers(words: Words) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Read words as whole numbers, with or without a sign, of up to MAX_DIGITS digits; an empty word is 0.

    Returns
    -------
    values : (n_word,) int64, and is_integer : (n_word,) bool, False for what is none
    """
    begins, is_negative = _skip_sign(words)
    values, is_integer = _read_digits(words.letters, words.ends, words.ends - begins)
    is_integer &= (begins < words.ends) | (begins == words.starts)
    return np.negative(values, where=is_negative, out=values), is_integer


def read_decimals(words: Words) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Read words as Python's `float` does; but underscores are not legal.

    Parameters
    ----------
    words : all words of a text, none of them empty

    Returns
    -------
    values : (n_word,) float64, and is_number : (n_word,) bool, False for what is none
    """
    letters, starts, ends, _ = words
    begins, is_negative = _skip_sign(words)
    points = np.flatnonzero(letters == _POINT)
    pointed = slice(None)  # the words that have one: most often all of them
    if len(points) != len(ends) or ((points < starts) | (points >= ends)).any():
        pointed = np.searchsorted(starts, points, side="right") - 1
    n_behind, n_digit = np.zeros(len(ends), np.int64), ends - begins
    n_tail = n_digit.copy()  # letters behind the point, all where there is none
    n_behind[pointed] = n_tail[pointed] = ends[pointed] - points - 1
    n_digit -= n_tail < n_digit
    mantissa, is_number = _read_digits(letters, ends, n_digit, n_tail)
    is_number &= (n_digit > 0) & (mantissa <= 2**53)
    values = mantissa / _POWERS.take(n_behind, mode="clip")
    np.negative(values, where=is_negative, out=values)
    others = np.flatnonzero(~is_number)
    if len(others):
        text = letters.tobytes()
        numbers = [_number(text[a:b]) for a, b in zip(starts[others].tolist(), ends[others].tolist(), strict=True)]
        values[others] = [np.nan if number is None else number for number in numbers]
        is_number[others] = [number is not None for number in numbers]
    return values, is_number


def numbers_in(text: bytes) -> NDArray[np.float64] | None:
    """Return the numbers of a text with blanks or newlines between them, None where it holds anything else."""
    data = text.translate(_BLANKS)
    if len(data) < _SHORT:
        numbers = [_number(word) for word in data.split(b" ") if word]
        return None if None in numbers else np.array(numbers, np.float64)
    cuts, is_long = [0], len(data) >= LONG
    while cuts[-1] < len(data):
        end = data.find(b" ", cuts[-1] + _BLOCK)
        cuts.append(len(data) if end < 0 else end)

    def read(block: tuple[int, int]) -> NDArray[np.float64] | None:
        report_progress(block[0], len(data), "reading numbers")
        letters = np.frombuffer(b" " * LEAD + data[slice(*block)] + b" ", np.uint8)
        if is_long:
            from .text_kernels import POWERS, read_numbers

            values = np.empty(len(letters))
            if (n := read_numbers(letters, POWERS, values)) >= 0:
                return values[:n].copy()
        values, is_number = read_decimals(split_words(letters, np.array([LEAD])))
        return values if is_number.all() else None

    with Workers(n_core() if is_long else 1) as workers:
        tables = workers.map(read, list(zip(cuts[:-1], cuts[1:], strict=True)))
    return None if any(table is None for table in tables) else np.concatenate(tables)


def _skip_sign(words) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return where words begin behind their sign, and which are negative."""
    sign = words.letters.take(words.starts, mode="clip")
    is_negative = sign == _MINUS
    has_sign = (is_negative | (sign == _PLUS)) & (words.starts < words.ends)
    return words.starts + has_sign, is_negative & has_sign


def _read_digits(letters, ends, n_digit, n_tail=None) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Read the last letters before some places as whole numbers, and tell which are such numbers.

    Parameters
    ----------
    ends : (n,) int64 places
    n_digit : (n,) int64, how many letters each number has; none is 0
    n_tail : (n,) int64, how many of them stand behind a letter that is left out, the point; None = none is left out

    Returns
    -------
    values : (n,) int64, and is_whole : (n,) bool, False for what has another letter than a digit, or too many
    """
    eights = np.ndarray(len(letters) - 7, "<u8", letters, 0, (1,))  # the eight letters from each place on
    values, is_whole = np.zeros(len(ends), np.int64), n_digit <= MAX_DIGITS
    for done in range(0, min(int(n_digit.max(initial=0)), MAX_DIGITS), 8):
        places = ends - (done + 8)
        eight = eights[places]
        if n_tail is not None:  # what stands before the point moves up by one letter
            moved = eights[places - 1]
            moved ^= eight
            moved &= ~_KEPT.take(n_tail - done, mode="clip")
            eight ^= moved
        eight ^= _ZEROS  # '0'..'9' are 0x30..0x39, and become 0..9; what is no digit becomes more
        eight &= _KEPT.take(n_digit - done, mode="clip")
        is_whole &= (((eight + _TO_HIGH) | eight) & _HIGH) == 0
        for factor, shift, kept in _JOINS:
            eight *= factor
            eight >>= shift
            eight &= kept
        values += eight.view(np.int64) * 10**done if done else eight.view(np.int64)
    return values, is_whole


def _number(word: bytes) -> float | None:
    """Return the number that a word stands for, None where it stands for none."""
    try:
        return float(word) if b"_" not in word else None
    except ValueError:
        return None
