"""Join the vertices that stand at one position, so that normals can be averaged across them; find equal rows of arrays.

Formats repeat a vertex for each of its triangles (STL), and where its texture coordinates or colours change (glTF, and
exporters of all others). A surface that is smooth there would show a seam.

    rows ─ blocks ─┬─ distinct rows of each ─┬─ distinct rows of all
                   └─ which of them each is ─┴─ which of these each is

Memory grows with the distinct rows, not with all of them. Rows of a block are found in a table that fits into the
cache, by compiled code (equal_rows.py): most vertices are repeated by triangles that are near them in the file. Few
rows are sorted instead, so that nobody waits for a compiler to read a small file.
"""

import numpy as np
from numpy.typing import NDArray

FEW = 1 << 14  # rows that are sorted
_BLOCK = 1 << 16  # rows whose table fits into the cache


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


def weld_triangles(corners: NDArray) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Return vertices (n_vertex, 3) and faces (n_face, 3) of triangles (n_face, 3, 3), float32 or float64, that share
    nothing.

    Vertices are in the order of their first use.
    """
    first, inverse = unique_rows(corners)
    return corners[first // 3, first % 3].astype(np.float64), inverse.reshape(-1, 3)


def unique_rows(rows: NDArray) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Find equal rows, bit by bit; but -0 is 0.

    Parameters
    ----------
    rows : (n, k), or (m, n / m, k), float32 or float64, contiguous or not

    Returns
    -------
    first : (n_unique,) row at which each distinct row appears first, ascending
    inverse : (n,) with rows[first][inverse] equal to rows
    """
    width, per_item = rows.shape[-1], int(np.prod(rows.shape[1:-1]))
    if len(rows) * per_item < FEW:
        return _sort_rows(_bits_of(rows.reshape(-1, width)))
    from .equal_rows import Finder

    inverse = np.empty(len(rows) * per_item, np.uint32)
    step = max(1, _BLOCK // per_item)
    finder = Finder(min(len(inverse), step * per_item))
    firsts, kept = [np.empty(0, np.int64)], []
    for begin in range(0, len(rows), step):
        bits = _bits_of(rows[begin : begin + step].reshape(-1, width))
        row = begin * per_item
        first = finder.find(bits, inverse[row : row + len(bits)])
        firsts.append(first + row)
        kept.append(bits[first])
    if len(kept) < 2:
        return firsts[-1], inverse
    of_candidate = np.empty(sum(map(len, kept)), np.uint32)
    first = Finder(len(of_candidate)).find(np.concatenate(kept), of_candidate)
    end = 0
    for number, row in enumerate(range(0, len(inverse), step * per_item)):
        block = inverse[row : row + step * per_item]
        begin, end = end, end + len(kept[number])
        np.take(of_candidate[begin:end], block, out=block)
    return np.concatenate(firsts)[first], inverse


def _bits_of(rows) -> NDArray[np.uint32]:
    """Return the bits of rows, 32 at a time."""
    return (np.ascontiguousarray(rows) + 0.0).view(np.uint32)  # the sum turns -0 into 0


def _sort_rows(bits: NDArray[np.uint32]) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Return what `unique_rows` does."""
    order = np.lexsort(bits.T)  # equal rows side by side, the first of them first
    is_new = np.ones(len(order), np.bool_)
    is_new[1:] = (bits[order[1:]] != bits[order[:-1]]).any(axis=1)
    first = np.sort(order[is_new])
    numbers = np.searchsorted(first, order[is_new])
    inverse = np.empty(len(order), np.uint32)
    inverse[order] = np.repeat(numbers, np.diff(np.flatnonzero(is_new), append=len(order)))
    return first, inverse
