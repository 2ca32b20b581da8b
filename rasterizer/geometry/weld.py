"""Join the vertices that stand at one position, so that normals can be averaged across them; find equal rows of arrays.

Formats repeat a vertex for each of its triangles (STL), and where its texture coordinates or colours change (glTF, and
exporters of all others). A surface that is smooth there would show a seam.

    rows ─ blocks ─┬─ distinct rows of each ─┬─ distinct rows of all
                   └─ which of them each is ─┴─ which of these each is
           on a thread of its own              on the caller's

Memory grows with the distinct rows, not with all of them. Rows of a block are found in a table that fits into the
cache, by compiled code (equal_rows.py): most vertices are repeated by triangles that are near them in the file. Few
rows are sorted instead, so that nobody waits for a compiler to read a small file.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from ..cores import ahead

FEW = 1 << 14  # rows that are sorted
BLOCK = 1 << 16  # rows whose table fits into the cache
_N_AHEAD = 4  # blocks


def weld(part: dict) -> dict:
    """Join the vertices of a part at equal positions; normals, texture coordinates and colours in which they differ
    become those of the faces' corners.

    Positions are equal where all bits are, but that -0 is 0. A part whose faces refer to vertices that are not there is
    left for `Mesh` to refuse.
    """
    corners, n_vertex = part["faces"], len(part["vertices"])
    if len(corners) == 0 or corners.min() < 0 or corners.max() >= n_vertex:
        return part
    first, inverse = unique_rows(part["vertices"])
    if len(first) == n_vertex:
        return part
    welded = {**part, "vertices": part["vertices"][first], "faces": inverse[corners]}
    for attribute in ("normals", "uv", "colors"):
        values = part.get(attribute)
        if values is None or values.ndim == 3:
            continue
        one = values[first]
        is_same = np.array_equal(one[inverse], values, equal_nan=values.dtype.kind == "f")
        welded[attribute] = one if is_same else values[corners]
    return welded


def weld_triangles(blocks: Iterable[NDArray], n_face: int) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Join the corners of triangles that share nothing, where they stand at one position.

    Parameters
    ----------
    blocks : (n, 3, 3) each, float32 or float64, contiguous or not, of BLOCK // 3 triangles at most
    n_face : how many triangles they have

    Returns
    -------
    vertices : (n_vertex, 3), in the order of their first use; -0 is 0
    faces : (n_face, 3)
    """
    _, faces, vertices = _number_rows((block.reshape(-1, 3) for block in blocks), 3 * n_face)
    return vertices.astype(np.float64), faces.reshape(-1, 3)


def unique_rows(rows: NDArray) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Find equal rows, bit by bit; but -0 is 0.

    Parameters
    ----------
    rows : (n, k), float32 or float64, contiguous or not

    Returns
    -------
    first : (n_unique,) row at which each distinct row appears first, ascending
    inverse : (n,) with rows[first][inverse] equal to rows
    """
    starts = range(0, max(len(rows), 1), BLOCK)
    return _number_rows((rows[begin : begin + BLOCK] for begin in starts), len(rows))[:2]


def _number_rows(blocks, n_row) -> tuple[NDArray[np.int64], NDArray[np.uint32], NDArray]:
    """Return what `unique_rows` does of rows that come in blocks of BLOCK rows at most, and the distinct rows."""
    if n_row < FEW:
        rows = np.ascontiguousarray(np.concatenate(list(blocks))) + 0.0  # the sum turns -0 into 0
        first, inverse = _sort_rows(rows.view(np.uint32))
        return first, inverse, rows[first]
    from .equal_rows import Finder

    inverse, firsts, numbers, known = np.empty(n_row, np.uint32), [], np.empty(BLOCK, np.uint32), None
    for begin, end, rows, first in ahead(_distinct_in_blocks(blocks, inverse), _N_AHEAD):
        bits, block = rows.view(np.uint32), inverse[begin:end]
        if known is None:  # the first block tells how many rows there will be
            known = Finder(bits.shape[1], len(rows) * n_row // len(block), BLOCK)
        if first is None:
            firsts.append(known.find(bits, block) + begin)
        else:
            firsts.append(first[known.find(bits, numbers)] + begin)
            np.take(numbers, block, out=block, mode="clip")
    return np.concatenate(firsts), inverse, known.rows.view(rows.dtype)


def _distinct_in_blocks(blocks, inverse) -> Iterator[tuple[int, int, NDArray, NDArray[np.int64] | None]]:
    """Yield where each block begins and ends, its distinct rows, and where in it they appear first; write for each row
    which of these it is. Where most rows of the first block are distinct, so are those of the others: they are yielded
    as they are, with None."""
    from .equal_rows import Finder

    begin, near, is_repeated = 0, None, True
    for block in blocks:
        rows, end = np.ascontiguousarray(block) + 0.0, begin + len(block)
        near = near or Finder(rows.view(np.uint32).shape[1], 0, BLOCK)
        if is_repeated:
            near.forget()
            first = near.find(rows.view(np.uint32), inverse[begin:end])
            yield begin, end, near.rows.view(rows.dtype).copy(), first.copy()
            is_repeated = begin > 0 or 2 * len(first) < len(block)
        else:
            yield begin, end, rows, None
        begin = end


def _sort_rows(bits: NDArray[np.uint32]) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Return what `unique_rows` does of few rows, given as their bits."""
    order = np.lexsort(bits.T)  # equal rows side by side, the first of them first
    is_new = np.ones(len(order), np.bool_)
    is_new[1:] = (bits[order[1:]] != bits[order[:-1]]).any(axis=1)
    first = np.sort(order[is_new])
    numbers = np.searchsorted(first, order[is_new])
    inverse = np.empty(len(order), np.uint32)
    inverse[order] = np.repeat(numbers, np.diff(np.flatnonzero(is_new), append=len(order)))
    return first, inverse
