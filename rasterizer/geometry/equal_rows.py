"""Equal rows of arrays, found by hash tables that fit into the cache, on threads: the compiled part of weld.py.

    rows ─ ranges ─ dealt to parts by their hash ─ parts ─ the first row of those that are equal ─ numbered in order
           side by side                            side by side

Equal rows come into one part, so that no table needs to know of another one. Source: the partitioned hash join of
Shatdal, Kant & Naughton 1994, "Cache conscious algorithms for relational query processing", VLDB.
"""

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import helper, kernel

PART = 1 << 16  # rows, whose table of twice as many slots of 8 bytes stays in the caches of a core
MAX_PARTS = 1 << 10  # for more of them, places to write to would leave the cache themselves

_LOW = np.uint64(0xFFFFFFFF)
_HIGH, _SHIFT = np.uint64(32), np.uint64(29)


def find_equal_rows(
    rows: NDArray, workers: Any, out: NDArray[np.uint32] | None = None
) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Find equal rows, bit by bit.

    Parameters
    ----------
    rows : (n, k) float32 or float64, contiguous, fewer than 2^32 - 1
    workers : Workers, threads to find them on
    out : (n,), which becomes `inverse`; None = a new array

    Returns
    -------
    first : (n_unique,) row at which each distinct row appears first, ascending
    inverse : (n,) with rows[first][inverse] equal to rows
    """
    n_row, bits = len(rows), rows.view(np.uint32)
    n_part = min(MAX_PARTS, 1 << (n_row // PART).bit_length())
    # A seed that no file's maker knows: rows that share a hash would take the square of their number.
    seed = np.frombuffer(os.urandom(8), np.uint64)[0]
    keys, inverse = np.empty(n_row, np.uint64), np.empty(n_row, np.uint32) if out is None else out

    def deal(part: tuple[int, int]) -> list[NDArray[np.uint64]]:
        here, ends = slice(*part), np.zeros(n_part + 1, np.uint32)
        deal_rows(bits[here], part[0], seed, inverse[here], ends, keys[here])
        return np.split(keys[here], ends[1:-1])

    def match(pieces: tuple[NDArray[np.uint64], ...]) -> None:
        table = np.zeros(1 << (2 * sum(map(len, pieces))).bit_length(), np.uint64)
        for piece in pieces:
            match_rows(piece, bits, table, inverse)

    workers.map(match, zip(*workers.map(deal, workers.ranges(n_row)), strict=True))
    first = keys.view(np.uint32)[:n_row]  # nobody needs the keys any more
    return first[: number_rows(inverse, first)], inverse


@helper
def hash_of_row(bits, row, seed):
    """Return a number below 2^32, which rows that differ share by chance alone.

    A multiplication and a shift a column: Steele, Lea & Flood 2014, Fast splittable pseudorandom number generators
    (SplitMix64), OOPSLA.
    """
    mixed = seed
    for column in range(np.uint64(bits.shape[1])):
        mixed = (mixed ^ bits[row, column]) * np.uint64(0xBF58476D1CE4E5B9)
        mixed ^= mixed >> _SHIFT
    return mixed >> _HIGH


@kernel
def deal_rows(bits, first_row, seed, hashes, out_ends, out_keys):
    """Deal rows to 2^m parts by the upper bits of their hash, each part's in their order.

    bits (n, k) u32; first_row: the number of the first one; seed u64; hashes (n,) u32, working space; out_ends
    (2^m + 1,) u32 comes in as zero; out_keys (n,) u64, each hash << 32 | the row's number: those of part p are
    out_keys[out_ends[p] : out_ends[p + 1]].
    """
    n_row, n_part = np.uint64(len(bits)), np.uint64(len(out_ends) - 1)
    # Count one entry further on, and begin to fill there: that moves each part's start to where the next one's is.
    for row in range(n_row):
        mixed = hash_of_row(bits, row, seed)
        hashes[row] = mixed
        out_ends[(mixed * n_part >> _HIGH) + np.uint64(1)] += np.uint32(1)
    n_before = np.uint32(0)
    for part in range(n_part):
        n_here = out_ends[part + np.uint64(1)]
        out_ends[part + np.uint64(1)] = n_before
        n_before += n_here
    for row in range(n_row):
        mixed = np.uint64(hashes[row])
        part = (mixed * n_part >> _HIGH) + np.uint64(1)
        out_keys[out_ends[part]] = mixed << _HIGH | (row + np.uint64(first_row))
        out_ends[part] += np.uint32(1)


@kernel
def match_rows(keys, bits, table, out_first):
    """Find for each row of a part the first one that is equal to it.

    keys (n,) u64, of `deal_rows`, in the order of rows; bits (n_row, k) u32; table (2^m,) u64 holds for each distinct
    row of the part that is known its key + 1, else 0, and is longer than the part; out_first (n_row,) u32.

    Open addressing: Knuth, TAOCP 3, 6.4, algorithm L.
    """
    mask, n_column = np.uint64(len(table) - 1), np.uint64(bits.shape[1])
    for k in range(np.uint64(len(keys))):
        key = keys[k]
        row, slot = key & _LOW, (key >> _HIGH) & mask
        while True:
            other = table[slot]
            if other == np.uint64(0):
                table[slot] = key + np.uint64(1)
                out_first[row] = row
                break
            other -= np.uint64(1)
            if other >> _HIGH == key >> _HIGH:
                first, is_equal = other & _LOW, True
                for column in range(n_column):
                    is_equal &= bits[row, column] == bits[first, column]
                if is_equal:
                    out_first[row] = first
                    break
            slot = (slot + np.uint64(1)) & mask


@kernel
def number_rows(numbers, out_first):
    """Number distinct rows in the order of their first appearance; return how many there are.

    numbers (n,) u32 holds for each row the first one that is equal to it, and takes its number; out_first (n,) u32
    takes the first row of each number.
    """
    n_distinct = np.uint64(0)
    for row in range(np.uint64(len(numbers))):
        if numbers[row] == row:
            out_first[n_distinct] = row
            numbers[row] = n_distinct
            n_distinct += np.uint64(1)
        else:
            numbers[row] = numbers[numbers[row]]
    return np.int64(n_distinct)
