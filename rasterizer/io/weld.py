"""Join the vertices that stand at one position, so that normals can be averaged across them.

Formats repeat a vertex for each of its triangles (STL), and where its texture coordinates or colours change (glTF, and
exporters of all others). A surface that is smooth there would show a seam.

    rows of coordinates ─ blocks ─┬─ distinct rows of each ─┬─ distinct rows of all
                                  └─ which of them each is ─┴─ which of these each is

Memory grows with the distinct rows, not with all of them. Blocks are small enough for the cache: most vertices are
repeated by triangles that are near them in the file.
"""

import numpy as np
from numpy.typing import NDArray

from .model_file import report_progress

_BLOCK = 1 << 18  # rows sorted in one go
_SEEDS = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_SHIFT = np.uint64(31)


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
    firsts, kept, hashes, ends = [], [], [], [0]
    for begin in range(0, len(rows), step):
        bits = _bits_of(rows[begin : begin + step].reshape(-1, width))
        row = begin * per_item
        mixed = _hash_rows(bits)
        first, inverse[row : row + len(bits)] = _unique_bits(bits, mixed)
        firsts.append(first + row)
        kept.append(bits[first])
        hashes.append(mixed[first])
        ends.append(ends[-1] + len(first))
        report_progress(row, len(inverse), "joining vertices")
    if len(firsts) < 2:
        return firsts[0] if firsts else np.empty(0, np.int64), inverse
    candidates = np.concatenate(firsts)
    first, of_candidate = _unique_bits(np.concatenate(kept), np.concatenate(hashes))
    for number, row in enumerate(range(0, len(inverse), step * per_item)):
        block = inverse[row : row + step * per_item]
        block[...] = of_candidate[ends[number] : ends[number + 1]][block]
    return candidates[first], inverse


def _bits_of(rows) -> NDArray:
    """Return the bits of rows as unsigned integers of their size."""
    rows = np.ascontiguousarray(rows) + 0.0  # turns -0 into 0
    return rows.view(f"u{rows.itemsize}")


def _hash_rows(bits) -> NDArray[np.uint64]:
    """Return a hash of each row: a multiplication and a shift a column, as in Steele, Lea & Flood 2014, Fast splittable
    pseudorandom number generators (SplitMix64), OOPSLA."""
    mixed = np.zeros(len(bits), np.uint64)
    for number, column in enumerate(bits.T):
        mixed ^= column
        mixed *= _SEEDS[number % 2]
        mixed ^= mixed >> _SHIFT
    return mixed


def _unique_bits(bits, mixed) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Return `first` and `inverse` of `unique_rows` for rows of bits and their hashes."""
    order = np.argsort(mixed)
    mixed = mixed[order]
    starts = np.flatnonzero(np.concatenate(([True], mixed[1:] != mixed[:-1])))
    first = np.minimum.reduceat(order, starts)
    counts = np.diff(starts, append=len(mixed))
    found = _in_order(first, order, counts)
    if np.array_equal(bits[found[0]][found[1]], bits):
        return found
    # Two different rows share a hash.
    _, first, numbers, counts = np.unique(bits, axis=0, return_index=True, return_inverse=True, return_counts=True)
    return _in_order(first, np.argsort(numbers.reshape(-1), kind="stable"), counts)


def _in_order(first, order, counts) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Number different rows by the first of each; `order` lists equal rows together, `counts` how many there are."""
    is_first = np.zeros(len(order), bool)
    is_first[first] = True
    rank = np.cumsum(is_first, dtype=np.uint32)
    inverse = np.empty(len(order), np.uint32)
    inverse[order] = np.repeat(rank[first] - np.uint32(1), counts)
    return np.flatnonzero(is_first), inverse
