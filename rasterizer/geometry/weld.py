"""Join the vertices that stand at one position, so that normals can be averaged across them; find equal rows of arrays.

Formats repeat a vertex for each of its triangles (STL), and where its texture coordinates or colours change (glTF, and
exporters of all others). A surface that is smooth there would show a seam.

Equal rows are found by compiled code, on threads (equal_rows.py). Few are sorted by their hashes instead, so that
nobody waits for a compiler to read a small file. Of triangles that share nothing, equal corners are found in each block
of them first: most are repeated by triangles that are near them in the file, so that memory grows with the distinct
ones.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..cores import Workers, n_core

FEW = 1 << 16  # rows that are sorted
BLOCK = 1 << 16  # rows
SOME = 1 << 9  # rows of a block, by which it is known whether many are repeated near each other


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


def weld_triangles(read: Callable[[int, int], NDArray], n_face: int) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Join the corners of triangles that share nothing, where they stand at one position.

    Parameters
    ----------
    read : function of the first and the end of some triangles, which returns their corners, (n, 3, 3), float32 or
        float64, contiguous or not; it is called on threads
    n_face : how many triangles there are

    Returns
    -------
    vertices : (n_vertex, 3), in the order of their first use; -0 is 0
    faces : (n_face, 3)
    """
    if 3 * n_face < FEW:
        corners = read(0, n_face).reshape(-1, 3)
        first, numbers = unique_rows(corners)
        return corners[first].astype(np.float64) + 0.0, numbers.reshape(-1, 3)
    from .equal_rows import find_equal_rows

    size = BLOCK // 3
    blocks = [(begin, min(begin + size, n_face)) for begin in range(0, n_face, size)]
    faces, alone = np.empty((n_face, 3), np.uint32), Workers(1)

    def join_near(block: tuple[int, int]) -> NDArray:
        rows, of_block = _unsigned(read(*block).reshape(-1, 3)), faces[slice(*block)].reshape(-1)
        some, _ = find_equal_rows(rows[:SOME], alone)
        if len(some) == len(rows[:SOME]):
            of_block[:] = np.arange(len(rows))
            return rows
        first, _ = find_equal_rows(rows, alone, of_block)
        return rows.take(first, axis=0)

    with Workers(n_core()) as workers:
        distinct = workers.map(join_near, blocks)
        offsets = np.cumsum([0, *map(len, distinct)])
        # Where blocks have no equal corners, there are most often none at all: then these are the vertices already.
        joined = np.empty((offsets[-1], 3), np.float64 if offsets[-1] == 3 * n_face else distinct[0].dtype)

        def place(k: int) -> None:
            joined[offsets[k] : offsets[k + 1]], distinct[k] = distinct[k], None

        workers.map(place, range(len(blocks)))
        first, numbers = find_equal_rows(joined, workers)

        def renumber(k: int) -> None:
            of_block = faces[slice(*blocks[k])]
            np.take(numbers[offsets[k] : offsets[k + 1]], of_block, out=of_block, mode="clip")

        workers.map(renumber, range(len(blocks)))
        if len(first) == len(joined) and joined.dtype == np.float64:
            return joined, faces
        vertices = np.empty((len(first), 3))

        def gather(part: tuple[int, int]) -> None:
            vertices[slice(*part)] = joined.take(first[slice(*part)], axis=0)

        workers.map(gather, workers.ranges(len(first)))
    return vertices, faces


def unique_rows(rows: NDArray) -> tuple[NDArray[np.integer], NDArray[np.uint32]]:
    """Find equal rows, bit by bit; but -0 is 0.

    Parameters
    ----------
    rows : (n, k) real, contiguous or not; integers below 2^53

    Returns
    -------
    first : (n_unique,) row at which each distinct row appears first, ascending
    inverse : (n,) with rows[first][inverse] equal to rows
    """
    rows = _unsigned(rows)
    if len(rows) < FEW:
        return _sort_rows(rows.view(f"u{rows.itemsize}"))
    from .equal_rows import find_equal_rows

    with Workers(n_core()) as workers:
        return find_equal_rows(rows, workers)


def _unsigned(rows: NDArray) -> NDArray[np.floating]:
    """Return rows, contiguous, as float32 or float64 with 0 for -0."""
    with np.errstate(invalid="ignore"):  # of signalling NaNs
        return np.add(rows, 0.0, order="C", dtype=np.result_type(rows, np.float32))


def _sort_rows(bits: NDArray[np.unsignedinteger]) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Return what `unique_rows` does of few rows, given as their bits.

    Hash: a multiplication between two shifts a column, as in SplitMix64, see equal_rows.py.
    """
    hashes = np.zeros(len(bits), np.uint64)
    for column in bits.T:
        hashes = hashes ^ column
        hashes = (hashes ^ hashes >> np.uint64(32)) * np.uint64(0xBF58476D1CE4E5B9)
        hashes ^= hashes >> np.uint64(29)
    order = np.argsort(hashes)  # equal rows side by side
    is_new, is_other = _differ(bits[order]), _differ(hashes[order, None])
    if (is_new & ~is_other).any():  # rows that differ share a hash, and may stand between equal ones
        order = np.lexsort(bits.T)
        is_new = _differ(bits[order])
    if is_new.all():  # as most are, of files of many small meshes
        return np.arange(len(order)), np.arange(len(order), dtype=np.uint32)
    first_of = np.empty(len(order), np.int64)
    first_of[order] = np.minimum.reduceat(order, np.flatnonzero(is_new))[np.cumsum(is_new) - 1]
    is_first = first_of == np.arange(len(order))
    return np.flatnonzero(is_first), (np.cumsum(is_first, dtype=np.uint32) - np.uint32(1))[first_of]


def _differ(rows: NDArray) -> NDArray[np.bool_]:
    """Tell which rows differ from the one before; the first one does."""
    found = np.ones(len(rows), np.bool_)
    found[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    return found
