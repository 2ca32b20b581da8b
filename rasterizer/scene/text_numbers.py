"""Read numbers in text by whole arrays, exactly rounded.

In: the letters of a text, and where its words begin and end. Out: their values, and which words are numbers.

Digits are read eight at a time: the eight bytes of a word's end are one integer, whose halves are joined three times
(Lemire 2021, Number parsing at a gigabyte per second, Software: Practice and Experience 51(8)). A decimal number is
its digits as one whole number m over a power of ten; where m <= 2^53 both are float64 without rounding, so one
division rounds correctly (Clinger 1990, How to read floating point numbers accurately, PLDI). Python reads the others.
"""

import re
import warnings

import numpy as np
from numpy.typing import NDArray

LEAD = 24  # blanks that a text must begin with, so that the eight letters before a word's end are there, three times
MOST_DIGITS = 18  # of a whole number within int64
_NEVER = re.compile(rb"[+-]?nan\(.*\)", re.IGNORECASE)  # what C libraries write where there is no number
_DIGIT, _PLUS, _MINUS, _POINT = b"0+-."
_BYTES = 0x0101010101010101
_ZEROS, _SIXES, _HIGHS, _THREES = (np.uint64(byte * _BYTES) for byte in (_DIGIT, 0x06, 0xF0, 0x33))
_KEPT = np.array([(_BYTES * 255 << 8 * (8 - n)) % 2**64 for n in range(9)], np.uint64)  # the last n of eight letters
_POWERS = 10 ** np.arange(MOST_DIGITS + 1)


def read_whole(
    letters: NDArray[np.uint8], starts: NDArray, ends: NDArray
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Read words as whole numbers without a sign.

    Parameters
    ----------
    letters : (n_letter,) uint8, ASCII; the first LEAD belong to no word
    starts, ends : (n_word,) int64, places of the words, half-open; an empty word is 0

    Returns
    -------
    values : (n_word,) int64, and is_whole : (n_word,) bool, False for words with other letters, or too many digits
    """
    eights = np.ndarray(len(letters) - 7, "<u8", letters, 0, (1,))  # the eight letters from each place on
    n_digit = ends - starts
    values, is_whole = np.zeros(len(starts), np.int64), n_digit <= MOST_DIGITS
    for done in range(0, min(int(n_digit.max(initial=0)), MOST_DIGITS), 8):
        kept = _KEPT.take(n_digit - done, mode="clip")
        eight = (eights[ends - (done + 8)] & kept) | (_ZEROS & ~kept)
        # '0'..'9' are 0x30..0x39: the high half of each byte is 3, and still is when 6 is added.
        highs = (eight & _HIGHS) | ((eight + _SIXES & _HIGHS) >> np.uint64(4))
        is_whole &= highs == _THREES
        eight = (eight & np.uint64(0x0F * _BYTES)) * np.uint64(10 * 2**8 + 1) >> np.uint64(8)
        eight = (eight & np.uint64(0x00FF00FF00FF00FF)) * np.uint64(100 * 2**16 + 1) >> np.uint64(16)
        eight = (eight & np.uint64(0x0000FFFF0000FFFF)) * np.uint64(10000 * 2**32 + 1) >> np.uint64(32)
        values += eight.view(np.int64) * 10**done
    return values, is_whole


def read_decimals(
    letters: NDArray[np.uint8], starts: NDArray, ends: NDArray
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Read words as decimal numbers, as Python's `float` does; underscores are not legal, `nan(ind)` and the like are
    nan.

    Parameters
    ----------
    letters : (n_letter,) uint8, ASCII; the first LEAD belong to no word; a point stands in a word
    starts, ends : (n_word,) int64, places of the words, half-open and ascending; no word is empty

    Returns
    -------
    values : (n_word,) float64, and is_number : (n_word,) bool, False for what is no number
    """
    sign = letters[starts]
    is_negative = sign == _MINUS
    begins = starts + (is_negative | (sign == _PLUS))
    points = np.flatnonzero(letters == _POINT)
    middles = ends.copy()
    middles[np.searchsorted(starts, points, side="right") - 1] = points
    n_behind = np.maximum(ends - middles - 1, 0)
    n_digit = middles - begins + n_behind
    values, is_whole = read_whole(letters, begins, middles)
    behind, is_number = read_whole(letters, ends - n_behind, ends)
    values = values * _POWERS.take(n_behind, mode="clip") + behind
    is_number &= is_whole & (n_digit > 0) & (n_digit <= MOST_DIGITS) & (values <= 2**53)
    values = values / _POWERS.take(n_behind, mode="clip")
    np.negative(values, where=is_negative, out=values)
    others = np.flatnonzero(~is_number)
    if len(others):
        text = letters.tobytes()
        words = [text[a:b] for a, b in zip(starts[others].tolist(), ends[others].tolist(), strict=True)]
        numbers = [_number(word) for word in words]
        values[others] = [np.nan if number is None else number for number in numbers]
        is_number[others] = [number is not None for number in numbers]
    return values, is_number


def _number(word: bytes) -> float | None:
    """Return the number that a word stands for, None where it stands for none."""
    try:
        return float(word) if b"_" not in word else None
    except ValueError:
        return float("nan") if _NEVER.fullmatch(word) else None


def numbers_in(text: str, dtype) -> np.ndarray | None:
    """Return the numbers of a text with blanks between them, None where it holds anything else; numpy before 2.4 only
    warns."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            return np.fromstring(text, dtype=dtype, sep=" ")
    except (ValueError, DeprecationWarning):
        return None
