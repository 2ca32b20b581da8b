"""Tests of numbers in text: each is what Python reads, to the last bit."""

import random

import numpy as np
import pytest

from rasterizer.io.model_file import FEW, numbers_in, read_words

HARD = """
0 -0 -0.0 .5 +1. 1. -.5 . - + -. nan -NAN inf -Infinity nan(ind) -nan(snan) nan( 1e999 -1e999 1e-999 4.9e-324
1e5 1E+05 9007199254740993 9007199254740992 0.9007199254740993 900719925474099.3 90071992547409.91 1..2 1.2.3
--1 +-1 1_0 0x1 1e 1d5 123456789012345678 1234567890123456789 0.123456789012345678 1.7976931348623157e308
00000000000000000000000.5 8.5/ :1 /1 1a
"""


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


def test_words_are_numbers_as_python_reads_them():
    for text in random_words(random.Random(1), 6_000):
        expected, found = plain_decimal(text), read_words([b"1", text.encode("latin-1")])
        assert (found is None) == (expected is None), text
        if expected is not None:
            np.testing.assert_array_equal(found, [1.0, expected], err_msg=text)


@pytest.mark.parametrize("few", [FEW, 1])
def test_numbers_of_a_text_stand_between_any_blanks(few, monkeypatch):
    """Also of a text that is read in several blocks of 2^18 letters, and of one that compiled code reads."""
    monkeypatch.setattr("rasterizer.io.model_file.FEW", few)
    for n in (0, 3, 100, 30_000):
        values = [k / 7 for k in range(n)]
        text = "".join(f"{value!r}{blank}" for value, blank in zip(values, " \n\t\v\f\r" * n, strict=False))
        np.testing.assert_array_equal(numbers_in(text.encode()), values, err_msg=f"{n} numbers")
        for bad in ("x", "1_0", "\u0663", "\0", "1,5", "\u00a0"):
            assert numbers_in(f"{text} {bad}".encode()) is None, f"{n} numbers, and {bad!r}"
    for text in (b"", b" \n ", b"\n" * 1000):
        assert numbers_in(text).tolist() == [], repr(text)
