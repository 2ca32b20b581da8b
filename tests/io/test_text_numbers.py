"""Tests of numbers in text: each is what Python reads, to the last bit."""

import random
import re

import numpy as np
import pytest
from helpers.arrays import differences

from rasterizer.io.files import LONG
from rasterizer.io.text_numbers import LEAD, divide, numbers_in, read_decimals, read_integers, split_words

HARD = """
0 -0 -0.0 .5 +1. 1. -.5 . - + -. nan -NAN inf -Infinity nan(ind) -nan(snan) nan( 1e999 -1e999 1e-999 4.9e-324
1e5 1E+05 9007199254740993 9007199254740992 0.9007199254740993 900719925474099.3 90071992547409.91 1..2 1.2.3
--1 +-1 1_0 0x1 1e 1d5 123456789012345678 1234567890123456789 0.123456789012345678 1.7976931348623157e308
00000000000000000000000.5 8.5/ :1 /1 1a
"""


def words_of(texts):
    letters = np.frombuffer(b" " * LEAD + " ".join(texts).encode("latin-1") + b" ", np.uint8)
    words = split_words(letters, np.array([LEAD]))
    assert [words.text(k) for k in range(len(words.starts))] == list(texts)
    return words


def random_words(random, n):
    yield from HARD.split()
    for _ in range(n):
        value = random.uniform(-1, 1) * 10.0 ** random.randrange(-5, 9)
        yield random.choice(
            [
                f"{value:.{random.randrange(20)}f}", repr(value), f"{value:g}", f"{value:.{random.randrange(18)}e}",
                str(random.randrange(-(10 ** random.randrange(1, 25)), 10**24)),
                str(random.randrange(10**random.randrange(1, 20))),
                "".join(random.choice("0123456789.-+e_ax:/") for _ in range(random.randrange(1, 12))),
            ]
        )  # fmt: skip


def plain_decimal(word):
    try:
        return float(word) if "_" not in word else None
    except ValueError:
        return None


def test_decimals_are_those_of_python_to_the_last_bit():
    texts = list(random_words(random.Random(1), 6_000))
    values, is_number = read_decimals(words_of(texts))
    for text, value, is_one in zip(texts, values, is_number, strict=True):
        expected = plain_decimal(text)
        assert is_one == (expected is not None), f"{text}: {is_one} != {expected is not None}"
        if expected is not None:
            assert value.tobytes() == np.float64(expected).tobytes() or (value != value and expected != expected), text


def test_integers_have_a_sign_and_up_to_18_digits():
    texts = list(random_words(random.Random(2), 4_000))
    values, is_integer = read_integers(words_of(texts))
    for text, value, is_one in zip(texts, values, is_integer, strict=True):
        assert is_one == bool(re.fullmatch(r"[+-]?[0-9]{1,18}", text)), text
        assert not is_one or value == int(text), text


def test_pieces_of_words_may_be_empty_and_are_0():
    texts = ["1/2", "3", "/4", "5//-6", "7/", "//", "+8"]
    pieces = divide(words_of(texts), b"/")
    values, is_integer = read_integers(pieces)
    of_word = np.split(values, pieces.first[1:-1])
    assert [each.tolist() for each in of_word] == [[1, 2], [3], [0, 4], [5, 0, -6], [7, 0], [0, 0, 0], [8]]
    assert not differences(is_integer, True) and pieces.first[-1] == len(values)
    assert divide(words_of(["1", "2"]), b"/").first.tolist() == [0, 1, 2]


@pytest.mark.parametrize("long", [LONG, 0])
def test_numbers_of_a_text_stand_between_any_blanks(long, monkeypatch):
    """Also of a text that is read in several blocks of 2^18 letters, and of one that compiled code reads."""
    monkeypatch.setattr("rasterizer.io.text_numbers.LONG", long)
    for n in (0, 3, 100, 30_000):
        values = [k / 7 for k in range(n)]
        text = "".join(f"{value!r}{blank}" for value, blank in zip(values, " \n\t\v\f\r" * n, strict=False))
        np.testing.assert_array_equal(numbers_in(text.encode()), values, err_msg=f"{n} numbers")
        for bad in ("x", "1_0", "\u0663", "\0", "1,5", "\u00a0"):
            assert numbers_in(f"{text} {bad}".encode()) is None, f"{n} numbers, and {bad!r}"
    for text in (b"", b" \n ", b"\n" * 1000):
        assert numbers_in(text).tolist() == [], repr(text)
