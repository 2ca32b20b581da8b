"""Tests of the lines of OBJ files as arrays: rows of numbers, corners of every form, faults; against a plain reader."""

import random
from fractions import Fraction

import numpy as np
import pytest
from helpers import plain_obj

from rasterizer.errors import ModelError
from rasterizer.io.loader import load
from rasterizer.io.model_file import noticing_progress
from rasterizer.io.obj import FEW, ObjLines
from rasterizer.io.text_kernels import POWERS, read_rows

N_FILE = 240  # of random files, half of them damaged


# --- against the plain reader ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("few", [0, FEW])  # with compiled code, and without
@pytest.mark.parametrize("is_damaged", [False, True])
def test_random_files_are_read_as_the_plain_reader_does(is_damaged, few):
    n_fault = 0
    for seed in range(N_FILE // 2):
        data = plain_obj.make_file(random.Random(2 * seed + is_damaged), is_damaged)
        expected, lines = plain_obj.read(data), ObjLines(data, few)
        fault = lines.first_fault()
        fault = fault and (lines.number_of(fault[0]), fault[1])
        assert fault == expected.fault, f"seed {seed}"
        n_fault += fault is not None
        if fault is None:
            assert_same(lines, expected, f"seed {seed}")
    # A comment that is continued swallows a vertex now and then, which some face names.
    least, most = (N_FILE // 10, N_FILE // 2) if is_damaged else (0, N_FILE // 20)
    assert least <= n_fault < most, f"{n_fault} files at fault, not {least}..{most}"


def assert_same(lines, expected, label):
    for kind, rows in expected.rows.items():
        if rows:
            np.testing.assert_array_equal(lines.rows_of(kind), rows, err_msg=f"{label}, {kind}")
    corners = lines.corners()
    assert [lines.number_of(line) for line in corners.lines] == [line for line, _ in expected.faces], label
    assert corners.counts.tolist() == [len(face) for _, face in expected.faces], label
    flat = [corner for _, face in expected.faces for corner in face]
    for place, column in enumerate((corners.v, corners.vt, corners.vn)):
        indices = [corner[place] for corner in flat]
        if column is None:  # the file has none
            assert not expected.rows[["v", "vt", "vn"][place]], label
        else:
            assert column.tolist() == indices, f"{label}: {column.tolist()} != {indices}"


def test_loading_random_files_names_the_line_that_the_plain_reader_names():
    n_fault = 0
    for seed in range(N_FILE // 2):
        data = plain_obj.make_file(random.Random(seed), True)
        expected = plain_obj.read(data)
        faulty_faces = [line for line, face in expected.faces if any(isinstance(corner, str) for corner in face)]
        if faulty_faces:  # faults of normals and texture coordinates that no face uses don't matter
            n_fault += 1
            with pytest.raises(ModelError) as caught:
                load(data, format="obj")
            assert str(caught.value) == f"model:{expected.fault[0]}: {expected.fault[1]}", f"seed {seed}"
    assert n_fault > N_FILE // 20, f"{n_fault} files at fault"


def test_blocks_of_lines_are_read_as_one():
    """More lines than are read in one go, the last ones shorter, with faces that count back across the border."""
    n = 40_000
    text = "".join(f"v {k} {k / 8} {-k} 1\nvn 0 0 {k}\n" for k in range(n)) + "v 1 2 3\nvn 4 5 6\n"
    text += "".join(f"f -1//-{k + 1} {-n - 1}//1 {k + 1}//1\n" for k in range(n))
    lines = ObjLines(text.encode())
    points, normals, corners = lines.rows_of("v"), lines.rows_of("vn"), lines.corners()
    assert points.shape == normals.shape == (n + 1, 3)
    assert points[n - 1].tolist() == [n - 1, (n - 1) / 8, 1 - n] and normals[-1].tolist() == [4, 5, 6]
    k = np.arange(n)
    np.testing.assert_array_equal(corners.v.reshape(-1, 3), np.stack([np.full(n, n), 0 * k, k], axis=1))
    np.testing.assert_array_equal(corners.vn.reshape(-1, 3), np.stack([n - k, 0 * k, 0 * k], axis=1))
    assert corners.vt is None and lines.number_of(corners.lines[-1]) == 3 * n + 2
    broken = ObjLines((text + "f 1 2 x\n").encode())
    assert broken.first_fault() == (3 * n + 2, plain_obj.NO_CORNER.format("x"))


# --- compiled code --------------------------------------------------------------------------------------------------

UNUSUAL = [*plain_obj.NUMBERS, *plain_obj.INDICES, "1e22", "1e23", "9007199254740993e1", "1#", "#", "1.5#c", "\u00b2"]


def random_numbers(random, n):
    for _ in range(n):
        value = random.uniform(-1, 1) * 10.0 ** random.randrange(-24, 24)
        yield random.choice(
            [
                f"{value:.{random.randrange(20)}f}", repr(value), f"{value:g}", f"{value:+.{random.randrange(18)}E}",
                str(random.randrange(10 ** random.randrange(1, 22))), random.choice(UNUSUAL),
                "".join(random.choice("0123456789.-+e") for _ in range(random.randrange(1, 9))),
            ]
        )  # fmt: skip


def test_rows_that_compiled_code_reads_are_those_of_python_to_the_last_bit():
    n_read, words = 0, list(random_numbers(random.Random(3), 6_000))
    for word in words:
        text, out = np.frombuffer(f"v  {word} 2 \n".encode(), np.uint8), np.empty((1, 2))
        if read_rows(text, np.array([1]), POWERS, out):
            n_read += 1
            assert out.tobytes() == np.array([float(word), 2.0]).tobytes(), word
    assert n_read > len(words) // 3
    text = np.frombuffer(b"1 2\n3\n4 5 6\n7 8 #9\n1_0 2\n", np.uint8)
    for start in (4, 6, 12, 19):  # too few numbers, too many, and what is no number
        assert not read_rows(text, np.array([0, start]), POWERS, np.empty((2, 2)))


def ties(random, n):
    """Numbers that lie in the middle between two float64, and their neighbours."""
    while n > 0:
        middle = Fraction(2 * random.getrandbits(52) + 2**53 + 1) * Fraction(2) ** random.randrange(-31, 8)
        power = middle.denominator.bit_length() - 1
        if (digits := middle.numerator * 5**power) < 10**19 - 1:
            yield from (f"{digits + step}e-{power}" for step in (-1, 0, 1))
            n -= 1


def test_numbers_of_all_digits_are_read_by_compiled_code():
    """As numpy and Python write them; but for those that lie in the middle between two float64."""
    random_ = random.Random(5)
    values = [random_.gauss(0, 1) * 10.0 ** random_.randrange(-30, 30) for _ in range(4_000)]
    words = [*map(repr, values), *(f"{value:.18e}" for value in values), *(f"{value:.17f}" for value in values[:99])]
    for word in [*words, *(tied := list(ties(random_, 400)))]:
        text, out = np.frombuffer(f"{word}\n".encode(), np.uint8), np.empty((1, 1))
        if read_rows(text, np.array([0]), POWERS, out):
            assert out[0, 0] == float(word), word
        else:
            assert word in tied[1::3] or len(word.split("e")[0].lstrip("-0.").replace(".", "")) > 19, word


# --- rows of numbers ------------------------------------------------------------------------------------------------


def test_progress_is_told_within_its_block_only():
    told, text = [], b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    for _ in range(2):
        with noticing_progress(lambda n_done, n, what: told.append((n_done, n, what))):
            load(text, format="obj")
        load(text, format="obj")
    assert told == [(0, 1, "reading lines 'f'"), (0, 3, "reading lines 'v'")] * 2
