"""Numbers in text, read where they stand: the compiled part of obj.py, stl.py and model_file.py.

Long files are read here as most programs write them: numbers with blanks between them, and nothing else. Where a line
holds anything else, or a number that can't be rounded exactly here, a kernel says so, and its caller reads it. What is
read is what the caller would read, to the last bit.

A text has a newline behind each line, and no other blanks than ' '. `at` is a place in it.
"""

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import helper, kernel

_BLANK, _NEWLINE, _ZERO, _PLUS, _MINUS, _POINT, _SLASH, _E = (np.uint64(ord(letter)) for letter in " \n0+-./e")
_LOWER = np.uint64(32)  # turns E into e, and nothing else into it
_MAX_DIGITS, _MAX_MANTISSA = 19, 2**53  # digits of a uint64; a float64 holds all whole numbers up to it
_MAX_INDEX_DIGITS = 9  # within int32
_MAX_POWER = 60  # of ten, up or down
_LOW, _HALF = np.uint64(0xFFFFFFFF), np.uint64(32)


class Powers(NamedTuple):
    """Powers that numbers are read with."""

    tens: NDArray[np.float64]  # 10^k, as far as float64 holds it exactly
    # 10^(k - _MAX_POWER) = (high 2^64 + low + less than 1) 2^(exponent - 127): 128 binary digits, the first of them 1
    high: NDArray[np.uint64]
    low: NDArray[np.uint64]
    exponents: NDArray[np.int64]
    twos: NDArray[np.float64]  # 2^(k - 512)


def _make_powers() -> Powers:
    rows = []
    for k in range(-_MAX_POWER, _MAX_POWER + 1):
        power = Fraction(10) ** k
        exponent = power.numerator.bit_length() - power.denominator.bit_length()
        exponent -= power < Fraction(2) ** exponent
        digits = math.floor(power * Fraction(2) ** (127 - exponent))
        rows.append((digits >> 64, digits & (2**64 - 1), exponent))
    high, low, exponents = zip(*rows, strict=True)
    arrays = np.array(high, np.uint64), np.array(low, np.uint64), np.array(exponents, np.int64)
    return Powers(10.0 ** np.arange(23), *arrays, 2.0 ** np.arange(-512, 512))


POWERS = _make_powers()


@kernel
def read_rows(text, starts, powers, out):
    """Read the numbers of lines; return whether each line has as many as a row, all of them exactly rounded.

    text (n_letter,) u8; starts (n,) i64, where the numbers of each line begin; powers: Powers; out (n, k) f64.
    """
    n_column = np.uint64(out.shape[1])
    for row in range(np.uint64(len(starts))):
        at = np.uint64(starts[row])
        for column in range(n_column):
            number, at, is_read = read_decimal(text, skip_blanks(text, at), powers)
            if not is_read or not ends_word(text, at):
                return False
            out[row, column] = number
        if text[skip_blanks(text, at)] != _NEWLINE:
            return False
    return True


@kernel
def read_numbers(text, powers, out):
    """Read all words of a text as numbers; return how many they are, -1 where one isn't exactly rounded.

    text (n_letter,) u8 ends with a blank; powers: Powers; out (n,) f64, n at least half as many as the letters.
    """
    at, n = np.uint64(0), np.uint64(0)
    while at < np.uint64(len(text)):
        if ends_word(text, at):
            at += np.uint64(1)
            continue
        out[n], at, is_read = read_decimal(text, at, powers)
        if not is_read or not ends_word(text, at):
            return np.int64(-1)
        n += np.uint64(1)
    return np.int64(n)


@kernel
def read_corners(text, starts, out_counts, out):
    """Read the corners of faces: v, v/vt, v//vn or v/vt/vn; return how many, -1 where a line holds anything else.

    text, starts: as above; out_counts (n,) i64, corners of each face; out (3, m) i32, their v, vt and vn as they stand
    there, 0 for what is missing; m is at least half as many as the letters of these lines.
    """
    corner = np.uint64(0)
    for row in range(np.uint64(len(starts))):
        first, at = corner, skip_blanks(text, np.uint64(starts[row]))
        while text[at] != _NEWLINE:
            out[0, corner], out[1, corner], out[2, corner] = 0, 0, 0
            for column in range(np.uint64(3)):
                is_negative, start = skip_sign(text, at)
                number, end = read_digits(text, start, np.uint64(0))
                is_empty = end == at
                if end - start > np.uint64(_MAX_INDEX_DIGITS) or (
                    end == start and (column == np.uint64(0) or not is_empty)
                ):
                    return np.int64(-1)
                out[column, corner] = -np.int32(number) if is_negative else np.int32(number)
                at = end
                if text[at] != _SLASH or column == np.uint64(2):
                    break
                at += np.uint64(1)
            if not ends_word(text, at):
                return np.int64(-1)
            corner += np.uint64(1)
            at = skip_blanks(text, at)
        out_counts[row] = corner - first
    return np.int64(corner)


@helper
def read_decimal(text, at, powers):
    """Return the decimal number at a place, the place behind it, and whether there is one that is exactly rounded.

    It is a whole number times or over a power of ten. Where both are float64 without rounding, one operation rounds
    correctly (Clinger 1990, How to read floating point numbers accurately, PLDI); else see `multiply_by_power`.
    """
    is_negative, start = skip_sign(text, at)
    mantissa, at = read_digits(text, start, np.uint64(0))
    n_digit, power = at - start, np.int64(0)
    if text[at] == _POINT:
        mantissa, end = read_digits(text, at + np.uint64(1), mantissa)
        n_behind = end - at - np.uint64(1)
        n_digit, power, at = n_digit + n_behind, -np.int64(n_behind), end
    n_zero = np.uint64(0)  # in front
    while text[start] == _ZERO or text[start] == _POINT:
        n_zero += np.uint64(text[start] == _ZERO)
        start += np.uint64(1)
    is_read = n_digit > np.uint64(0) and n_digit - n_zero <= np.uint64(_MAX_DIGITS)
    if text[at] | _LOWER == _E:
        is_down, start = skip_sign(text, at + np.uint64(1))
        exponent, at = read_digits(text, start, np.uint64(0))
        is_read &= at > start and at - start <= np.uint64(_MAX_INDEX_DIGITS)
        power += -np.int64(exponent) if is_down else np.int64(exponent)
    size, number = np.uint64(abs(power)), 0.0
    if mantissa <= np.uint64(_MAX_MANTISSA) and size < np.uint64(len(powers.tens)):
        number = mantissa / powers.tens[size] if power < 0 else mantissa * powers.tens[size]
    elif size <= np.uint64(_MAX_POWER) and mantissa > np.uint64(0):
        number, is_certain = multiply_by_power(mantissa, np.uint64(power + np.int64(_MAX_POWER)), powers)
        is_read &= is_certain
    else:
        is_read = False
    return -number if is_negative else number, at, is_read


@helper
def multiply_by_power(mantissa, k, powers):
    """Return a whole number of 64 binary digits or fewer times 10^(k - _MAX_POWER), rounded once, and whether that is
    certain.

    The number, shifted until its first digit is 1, times the 128 digits of the power: of the 192 digits of the product
    the first 53 are kept. The power is less than one of its last digits larger than they say, so that the product is
    less than one 128th digit larger: it is rounded as they say, but where the next 75 digits are 0111… or 1000….

    Source: Lemire 2021, Number parsing at a gigabyte per second, Software: Practice and Experience 51(8).
    """
    n_shift = np.uint64(0)
    while mantissa >> np.uint64(63) == np.uint64(0):
        mantissa <<= np.uint64(1)
        n_shift += np.uint64(1)
    first, second = multiply_wide(mantissa, powers.high[k])
    carried, _ = multiply_wide(mantissa, powers.low[k])
    second += carried
    first += np.uint64(second < carried)
    is_long = first >> np.uint64(63)
    n_rest = np.uint64(10) + is_long
    kept, rest, half = (
        first >> n_rest,
        first & ((np.uint64(1) << n_rest) - np.uint64(1)),
        np.uint64(1) << (n_rest - np.uint64(1)),
    )
    is_below = rest == half - np.uint64(1) and second == ~np.uint64(0)
    is_certain = not (is_below or (rest == half and second == np.uint64(0)))
    kept += np.uint64(rest >= half)
    exponent = np.int64(is_long) - np.int64(n_shift) + powers.exponents[k] + np.int64(11)
    return float(kept) * powers.twos[exponent + np.int64(512)], is_certain


@helper
def multiply_wide(a, b):
    """Return the product of two uint64: its upper and its lower 64 binary digits."""
    low_a, low_b, high_a, high_b = a & _LOW, b & _LOW, a >> _HALF, b >> _HALF
    low, cross, other = low_a * low_b, high_a * low_b, low_a * high_b
    middle = (low >> _HALF) + (cross & _LOW) + (other & _LOW)
    high = high_a * high_b + (cross >> _HALF) + (other >> _HALF) + (middle >> _HALF)
    return high, (middle << _HALF) | (low & _LOW)


@helper
def read_digits(text, at, number):
    """Append the digits from a place on to a whole number; return it and the place behind them."""
    digit = text[at] - _ZERO  # unsigned: what is below '0' becomes large
    while digit <= np.uint64(9):
        number = number * np.uint64(10) + digit
        at += np.uint64(1)
        digit = text[at] - _ZERO
    return number, at


@helper
def skip_sign(text, at):
    """Return whether a minus stands at a place, and the place behind it or a plus."""
    is_negative = text[at] == _MINUS
    return is_negative, at + np.uint64(is_negative or text[at] == _PLUS)


@helper
def skip_blanks(text, at):
    """Return the first place from one on that is no blank."""
    while text[at] == _BLANK:
        at += np.uint64(1)
    return at


@helper
def ends_word(text, at):
    """Tell whether a word ends before a place."""
    return text[at] == _BLANK or text[at] == _NEWLINE
