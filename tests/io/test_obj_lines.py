"""Tests of the lines of OBJ files as arrays: rows of numbers, corners of every form, faults; against a plain reader."""

import random
from fractions import Fraction

import numpy as np
import pytest
from helpers import plain_obj
from helpers.refusals import assert_refused

from rasterizer.errors import ModelError
from rasterizer.io.loader import load
from rasterizer.io.model_file import noticing_progress
from rasterizer.io.obj import FEW, LineError, ObjLines
from rasterizer.io.text_kernels import POWERS, read_corners, read_rows

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


def test_corners_that_compiled_code_reads_are_those_of_the_plain_reader():
    random_, n_read = random.Random(4), 0
    total = dict.fromkeys(plain_obj.KINDS, 10**9)
    for _ in range(6_000):
        numbers = (str(random_.randrange(-9, 10 ** random_.randrange(1, 11))) for _ in range(random_.randrange(1, 5)))
        pieces = [random_.choice([number, "7", "", random_.choice(UNUSUAL)]) for number in numbers]
        word, counts, out = "/".join(pieces) or "1", np.empty(1, np.int64), np.empty((3, 20), np.int32)
        n = read_corners(np.frombuffer(f"f {word}  2\n".encode(), np.uint8), np.array([1]), counts, out)
        if n < 0:
            continue
        n_read += 1
        assert n == counts[0] == 2 and out[:, 1].tolist() == [2, 0, 0], word
        expected = plain_obj.corner(word, total, total)
        found = [total["v"] + number if number < 0 else number - 1 for number in out[:, 0].tolist()]
        assert expected == (found if out[0, 0] else "face refers to vertex 0, the first one is 1"), word
    assert n_read > 1_000


# --- corners --------------------------------------------------------------------------------------------------------

GIVEN = "v 0 0 0\n" * 3 + "vt 0 0\n" * 3 + "vn 0 0 1\n" * 3


def corners_of(line, given=GIVEN):
    corners = ObjLines(f"{given}f {line}\n".encode()).corners()
    return corners.v.tolist(), corners.vt.tolist(), corners.vn.tolist()


NONE = [-1, -1, -1]


def test_forms_of_a_corner():
    for line, *expected in (
        ("1 2 3", [0, 1, 2], NONE, NONE),
        ("1/3 2/2 3/1", [0, 1, 2], [2, 1, 0], NONE),
        ("1//3 2//2 3//1", [0, 1, 2], NONE, [2, 1, 0]),
        ("1/1/3 2/1/2 3/2/1", [0, 1, 2], [0, 0, 1], [2, 1, 0]),
        ("1/2 2 3//1", [0, 1, 2], [1, -1, -1], [-1, -1, 0]),
        ("1// 2// 3//", [0, 1, 2], NONE, NONE),
        ("1/ 2/ 3/", [0, 1, 2], NONE, NONE),
        ("1/2/ 2/2/ 3/1/", [0, 1, 2], [1, 1, 0], NONE),
        ("1/2/ 2//3 3", [0, 1, 2], [1, -1, -1], [-1, 2, -1]),
        ("1/2/3/x 2/2/2/ +3/-9/-9", [0, 1, 2], [1, 1, -1], [2, 1, -1]),
    ):
        assert list(corners_of(line)) == expected, f"{line!r}: {corners_of(line)} != {expected}"
    for end in ("", "\n", "\\", "\\\n", "\\\r\n", " \\\n\\\n", "\r", " # end", "#"):
        assert ObjLines(f"{GIVEN}f 1 2 3{end}".encode()).corners().v.tolist() == [0, 1, 2], f"ended by {end!r}"
    wrong = ["1/2/3 4/5 6/7/8/9 a", "1 2 x/", "0 1 2", "1 2 /1", "1 2 -", "1_0 2 3", "1 2 1.0"]
    assert_refused(corners_of, [(line, "") for line in wrong], LineError)


def test_numbers_below_0_count_back_from_their_line():
    lines = ObjLines(b"v 1\nv 2\nvt 1\nf -1/-1 -2/-1 1/-1\nv 3\nvt 2\nf -1/-1 -2/-2 -3/1\n")
    assert lines.corners().v.tolist() == [1, 0, 0, 2, 1, 0] and lines.corners().vt.tolist() == [0, 0, 0, 1, 0, 0]


def test_lines_of_a_keyword_are_those_where_a_blank_follows_it():
    lines = ObjLines(b"o\no a\n  o  b c \nob\n\to\td\\ \ne\n#o f \\\no #g\no h\\\ni")
    assert lines.names_of("o")[1] == ["a", "b c", "d e", "#g", "h i"]
    assert [lines.number_of(line) for line in lines.lines_of("o")] == [2, 3, 5, 8, 9]


# --- rows of numbers ------------------------------------------------------------------------------------------------


def test_rows_have_the_numbers_that_all_lines_have():
    for lines, expected in (
        (["0.5 0.25", "1 2"], [(0.5, 0.25), (1, 2)]),
        (["0.5 0.25 9", "1 2 8"], [(0.5, 0.25, 9), (1, 2, 8)]),
        (["0.5", "1"], [(0.5, 0), (1, 0)]),
        (["0.5", "1 2", "3 4 5"], [(0.5, 0), (1, 2), (3, 4)]),
        (["1 2 3", "4 5", "6"], [(1, 2), (4, 5), (6, 0)]),
        ([], np.zeros((0, 2))),
    ):
        text = "".join(f"vt {line}\n" for line in lines)
        np.testing.assert_array_equal(ObjLines(text.encode()).rows_of("vt"), expected, err_msg=text)
    for lines, expected in (
        (["1 2 3", "4 5 6"], [(1, 2, 3), (4, 5, 6)]),
        (["1 2 3 9", "4 5 6"], [(1, 2, 3), (4, 5, 6)]),
        (["1 2 3", "4 5 6 7 8", "7 8 9 1"], [(1, 2, 3), (4, 5, 6), (7, 8, 9)]),
        (["1 2 3 4 5", "4 5 6"], [(1, 2, 3), (4, 5, 6)]),  # eight numbers, as two lines of four have
        (["1 2 3 4", "5 6 7 8"], [(1, 2, 3, 4), (5, 6, 7, 8)]),
        (["1 2 3", "4 5 6 x"], [(1, 2, 3), (4, 5, 6)]),  # what not all lines have is not looked at
        (["1 nan -nan", "+1e-3 inf nan"], [(1, np.nan, np.nan), (1e-3, np.inf, np.nan)]),
        (["0 1 2 # 3", "4 5 6#"], [(0, 1, 2), (4, 5, 6)]),
    ):
        text = "".join(f"vn {line}\nv 0 0 0\n" for line in lines)
        np.testing.assert_array_equal(ObjLines(text.encode()).rows_of("vn"), expected, err_msg=text)


def test_rows_that_are_no_numbers_are_refused():
    wrong = ["1 2", "1 2 x", "1,5 2 3", "1 2 0x", "\u00a0", "1 2 3_0", "1 2 3/4", "1 2 \u0663"]
    cases = [("v", f"v 1 2 3\nv {line}\n") for line in wrong]
    cases += [("vt", "vt x 1\n"), ("vt", "vt 1 2\nvt \n")]
    assert_refused(
        lambda given: ObjLines(given[1].encode()).rows_of(given[0]), [(each, "") for each in cases], LineError
    )


def test_progress_is_told_within_its_block_only():
    told, text = [], b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    for _ in range(2):
        with noticing_progress(lambda n_done, n, what: told.append((n_done, n, what))):
            load(text, format="obj")
        load(text, format="obj")
    assert told == [(0, 1, "reading lines 'f'"), (0, 3, "reading lines 'v'")] * 2
