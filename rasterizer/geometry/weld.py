"""Join the vertices that stand at one position, so that normals can be averaged across them; find equal rows of arrays.

Formats repeat a vertex for each of its triangles (STL), and where its texture coordinates or colours change (glTF, and
exporters of all others). A surface that is smooth there would show a seam.

    rows ─ blocks ─┬─ distinct rows of each ─┬─ distinct rows of all
                   └─ which of them each is ─┴─ which of these each is

Memory grows with the distinct rows, not with all of them. A block's table fits into the cache: most vertices are
repeated by triangles that are near them in the file.
"""

import os

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import index, kernel

_BLOCK = 1 << 16  # rows whose table fits into the cache
_SHIFT = np.uint64(29)


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
    inverse = np.empty(len(rows) * per_item, np.uint32)
    step = max(1, _BLOCK // per_item)
    finder = _Finder(min(len(inverse), step * per_item))
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
    first = _Finder(len(of_candidate)).find(np.concatenate(kept), of_candidate)
    end = 0
    for number, row in enumerate(range(0, len(inverse), step * per_item)):
        block = inverse[row : row + step * per_item]
        begin, end = end, end + len(kept[number])
        np.take(of_candidate[begin:end], block, out=block)
    return np.concatenate(firsts)[first], inverse


def _bits_of(rows) -> NDArray[np.uint32]:
    """Return the bits of rows, 32 at a time."""
    return (np.ascontiguousarray(rows) + 0.0).view(np.uint32)  # the sum turns -0 into 0


class _Finder:
    """Find equal rows among up to `capacity`."""

    def __init__(self, capacity: int):
        self._table = np.empty(1 << max(4, (2 * capacity - 1).bit_length()), np.uint32)
        self._first = np.empty(capacity, np.int64)
        # A seed that no file's maker knows: rows that share a hash would take the square of their number.
        self._seed = np.frombuffer(os.urandom(8), np.uint64)[0]

    def find(self, bits: NDArray[np.uint32], out: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Write for each row which distinct one it is; return where each of these appears first."""
        self._table.fill(0)
        n_unique = number_rows(bits, self._seed, self._table, self._first, out)
        return self._first[:n_unique].copy()


@kernel
def number_rows(bits, seed, table, first, out):
    """Number distinct rows in the order of their first appearance; return how many there are.

    bits (n, k) u32; seed u64; table (2^m,) u32 comes in as zero, twice as large as n at least; first (n,) i64 takes the
    row at which each appears first, out (n,) u32 the number of each.

    Open addressing: Knuth, TAOCP 3, 6.4, algorithm L. The hash, a multiplication and a shift a column, is made as in
    Steele, Lea & Flood 2014, Fast splittable pseudorandom number generators (SplitMix64), OOPSLA.
    """
    mask, n_column = index(len(table) - 1), index(bits.shape[1])
    n_unique = np.uint32(0)
    for row in range(index(len(bits))):
        mixed = seed
        for column in range(n_column):
            mixed = (mixed ^ bits[row, column]) * np.uint64(0xBF58476D1CE4E5B9)
            mixed ^= mixed >> _SHIFT
        slot = mixed & mask
        while True:
            number = table[slot]
            if number == 0:
                first[n_unique] = row
                out[row] = n_unique
                n_unique += np.uint32(1)
                table[slot] = n_unique
                break
            other, is_equal = index(first[number - np.uint32(1)]), True
            for column in range(n_column):
                is_equal &= bits[row, column] == bits[other, column]
            if is_equal:
                out[row] = number - np.uint32(1)
                break
            slot = (slot + index(1)) & mask
    return np.int64(n_unique)
