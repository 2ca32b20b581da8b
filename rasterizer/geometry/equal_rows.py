"""Equal rows of arrays, found by a hash table: the compiled part of weld.py."""

import os

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import index, kernel

_SHIFT = np.uint64(29)


class Finder:
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
