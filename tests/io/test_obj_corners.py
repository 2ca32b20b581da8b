"""Tests of the table of corners: face lines of every form, and the rows of vt and vn lines."""

import numpy as np
import pytest
from rasterizer.io.obj_corners import MisreadError, in_force, read_corners, read_texture_coordinates, read_vectors


@pytest.mark.parametrize(
    ("line", "v", "vt", "vn"),
    [
        ("1 2 3", [0, 1, 2], [-1] * 3, [-1] * 3),
        ("1/3 2/2 3/1", [0, 1, 2], [2, 1, 0], [-1] * 3),
        ("1//3 2//2 3//1", [0, 1, 2], [-1] * 3, [2, 1, 0]),
        ("1/1/3 2/1/2 3/2/1", [0, 1, 2], [0, 0, 1], [2, 1, 0]),
        ("1/2 2 3//1", [0, 1, 2], [1, -1, -1], [-1, -1, 0]),
    ],
)
def test_forms_of_a_corner(line, v, vt, vn):
    corners = read_corners(f"\nv 0 0 0\nf {line}\n")
    assert (corners.v.tolist(), corners.vt.tolist(), corners.vn.tolist()) == (v, vt, vn)
    assert corners.n_corner.tolist() == [3]


def test_numbers_below_0_count_back_from_their_line():
    corners = read_corners("\nv a\nv b\nvt a\nf -1/-1 -2/-1 1/-1\nv c\nvt b\nf -1/-1 -2/-2 -3/1\n")
    assert corners.v.tolist() == [1, 0, 0, 2, 1, 0] and corners.vt.tolist() == [0, 0, 0, 1, 0, 0]


def test_values_in_force_hold_until_the_next():
    values = in_force("\nf 1\nk 5\nk 6\nf 2\nf 3\nk 7\nf 4\n", "k", int, -1, 4)
    assert values.tolist() == [-1, 6, 6, 7]


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (["0.5 0.25", "1 2"], [(0.5, 0.25), (1, 2)]),
        (["0.5 0.25 9", "1 2 8"], [(0.5, 0.25), (1, 2)]),
        (["0.5", "1"], [(0.5, 0), (1, 0)]),
        (["0.5", "1 2", "3 4 5"], [(0.5, 0), (1, 2), (3, 4)]),
        (["1 2 3", "4 5", "6"], [(1, 2), (4, 5), (6, 0)]),
        (["1 2 3 4"], [(1, 2)]),
        ([], np.zeros((0, 2))),
    ],
)
def test_texture_coordinates(rows, expected):
    text = "".join(f"\nvt {row}" for row in rows) + "\n"
    np.testing.assert_array_equal(read_texture_coordinates(text), expected)


@pytest.mark.parametrize("text", ["\nvt x 1\n", "\nvt 1 2\nvt \n"])
def test_texture_coordinates_that_are_none(text):
    with pytest.raises(MisreadError):
        read_texture_coordinates(text)


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["1 2 3", "4 5 6"], [(1, 2, 3), (4, 5, 6)]),
        (["1 2 3 9", "4 5 6"], [(1, 2, 3), (4, 5, 6)]),
        (["1 2 3", "4 5 6 7 8", "7 8 9 1"], [(1, 2, 3), (4, 5, 6), (7, 8, 9)]),
        (["1 2 3 4 5", "4 5 6"], [(1, 2, 3), (4, 5, 6)]),  # eight numbers, as two lines of four have
        (["1 2 3 4", "5 6 7 8"], [(1, 2, 3, 4), (5, 6, 7, 8)]),
        (["1 nan -nan(snan)", "+1e-3 inf nan(ind)"], [(1, np.nan, np.nan), (1e-3, np.inf, np.nan)]),
    ],
)
def test_rows_of_numbers(lines, expected):
    text = "".join(f"\nvn {line}\nv 0 0 0" for line in lines) + "\n"
    np.testing.assert_array_equal(read_vectors(text, "vn", 3), expected)


@pytest.mark.parametrize("line", ["1 2", "1 2 x", "1,5 2 3", "1 2 0x", "\u00a0"])
def test_rows_that_are_no_numbers(line):
    with pytest.raises(MisreadError):
        read_vectors(f"\nv 1 2 3\nv {line}\n", "v", 3)


@pytest.mark.parametrize(
    ("line", "vt", "vn"),
    [("1// 2// 3//", [-1] * 3, [-1] * 3), ("1/ 2/ 3/", [-1] * 3, [-1] * 3), ("1/2/ 2/2/ 3/1/", [1, 1, 0], [-1] * 3),
     ("1/2/ 2//3 3", [1, -1, -1], [-1, 2, -1])],
)  # fmt: skip
def test_corners_written_short(line, vt, vn):
    corners = read_corners(f"\nf {line}\n")
    assert (corners.v.tolist(), corners.vt.tolist(), corners.vn.tolist()) == ([0, 1, 2], vt, vn)


@pytest.mark.parametrize("line", ["1/2/3 4/5 6/7/8/9 a", "1 2 x/", "0 1 2"])
def test_lines_that_are_no_list_of_corners(line):
    with pytest.raises(MisreadError):
        read_corners(f"\nv\nf {line}\n")
