"""Numbers in lines of OBJ, read where they stand in the text: the compiled part of obj.py.

Lines of a long file are read here as most programs write them: numbers with blanks between them, and nothing else.
Where a line holds anything else, or a number that can't be rounded exactly here, a kernel says so, and obj.py reads it.
What is read is what obj.py would read, to the last bit.

A text has a newline behind each line, and no other blanks than ' '. `at` is a place in it.
"""

import numpy as np

from ..compiler.kernels import helper, index, kernel

_BLANK, _NEWLINE, _ZERO, _PLUS, _MINUS, _POINT, _SLASH, _E = (np.uint64(ord(letter)) for letter in " \n0+-./e")
_LOWER = np.uint64(32)  # turns E into e, and nothing else into it
_MAX_DIGITS, _MAX_MANTISSA = 19, 2**53  # digits of a uint64; a float64 holds all whole numbers up to it
_MAX_INDEX_DIGITS = 9  # within int32
POWERS = 10.0 ** np.arange(23)  # of ten that a float64 holds exactly


@kernel
def read_rows(text, starts, powers, out):
    """Read the numbers of lines; return whether each line has as many as a row, all of them exactly rounded.

    text (n_letter,) u8; starts (n,) i64, where the numbers of each line begin; powers: POWERS; out (n, k) f64.
    """
    n_column = index(out.shape[1])
    for row in range(index(len(starts))):
        at = index(starts[row])
        for column in range(n_column):
            number, at, is_read = read_decimal(text, skip_blanks(text, at), powers)
            if not is_read or not ends_word(text, at):
                return False
            out[row, column] = number
        if text[skip_blanks(text, at)] != _NEWLINE:
            return False
    return True


@kernel
def read_corners(text, starts, out_counts, out):
    """Read the corners of faces: v, v/vt, v//vn or v/vt/vn; return how many, -1 where a line holds anything else.

    text, starts: as above; out_counts (n,) i64, corners of each face; out (3, m) i32, their v, vt and vn as they stand
    there, 0 for what is missing; m is at least half as many as the letters of these lines.
    """
    corner = index(0)
    for row in range(index(len(starts))):
        first, at = corner, skip_blanks(text, index(starts[row]))
        while text[at] != _NEWLINE:
            out[0, corner], out[1, corner], out[2, corner] = 0, 0, 0
            for column in range(index(3)):
                is_negative, start = skip_sign(text, at)
                number, end = read_digits(text, start, index(0))
                is_empty = end == at
                if end - start > index(_MAX_INDEX_DIGITS) or (end == start and (column == index(0) or not is_empty)):
                    return np.int64(-1)
                out[column, corner] = -np.int32(number) if is_negative else np.int32(number)
                at = end
                if text[at] != _SLASH or column == index(2):
                    break
                at += index(1)
            if not ends_word(text, at):
                return np.int64(-1)
            corner += index(1)
            at = skip_blanks(text, at)
        out_counts[row] = corner - first
    return np.int64(corner)


@helper
def read_decimal(text, at, powers):
    """Return the decimal number at a place, the place behind it, and whether there is one that is exactly rounded.

    It is a whole number times or over a power of ten. Where both are float64 without rounding, one operation rounds
    correctly (Clinger 1990, How to read floating point numbers accurately, PLDI).
    """
    is_negative, start = skip_sign(text, at)
    mantissa, at = read_digits(text, start, index(0))
    n_digit, power = at - start, np.int64(0)
    if text[at] == _POINT:
        mantissa, end = read_digits(text, at + index(1), mantissa)
        n_behind = end - at - index(1)
        n_digit, power, at = n_digit + n_behind, -np.int64(n_behind), end
    is_read = n_digit > index(0) and n_digit <= index(_MAX_DIGITS) and mantissa <= index(_MAX_MANTISSA)
    if text[at] | _LOWER == _E:
        is_down, start = skip_sign(text, at + index(1))
        exponent, at = read_digits(text, start, index(0))
        is_read &= at > start and at - start <= index(_MAX_INDEX_DIGITS)
        power += -np.int64(exponent) if is_down else np.int64(exponent)
    size, number = index(abs(power)), 0.0
    is_read &= size < index(len(powers))
    if is_read:
        number = mantissa / powers[size] if power < 0 else mantissa * powers[size]
    return -number if is_negative else number, at, is_read


@helper
def read_digits(text, at, number):
    """Append the digits from a place on to a whole number; return it and the place behind them."""
    digit = text[at] - _ZERO  # unsigned: what is below '0' becomes large
    while digit <= index(9):
        number = number * index(10) + digit
        at += index(1)
        digit = text[at] - _ZERO
    return number, at


@helper
def skip_sign(text, at):
    """Return whether a minus stands at a place, and the place behind it or a plus."""
    is_negative = text[at] == _MINUS
    return is_negative, at + index(is_negative or text[at] == _PLUS)


@helper
def skip_blanks(text, at):
    """Return the first place from one on that is no blank."""
    while text[at] == _BLANK:
        at += index(1)
    return at


@helper
def ends_word(text, at):
    """Tell whether a word ends before a place."""
    return text[at] == _BLANK or text[at] == _NEWLINE
