"""Equal rows of arrays, found by a hash table: the compiled part of weld.py."""

import os

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import index, kernel

_SHIFT = np.uint64(29)


class Finder:
    """Find equal rows among all that it is given, some at a time.

    Parameters
    ----------
    n_word : of a row, 32 bits each
    n_row : distinct rows to have room for; there may be more
    n_given : rows that are given at a time, at most
    """

    def __init__(self, n_word: int, n_row: int, n_given: int):
        self._n_row, self._rows = 0, np.empty((n_row + n_given, n_word), np.uint32)
        self._table = np.zeros(1 << (2 * len(self._rows) - 1).bit_length(), np.uint32)
        self._first = np.empty(n_given, np.int64)
        # A seed that no file's maker knows: rows that share a hash would take the square of their number.
        self._seed = np.frombuffer(os.urandom(8), np.uint64)[0]

    @property
    def rows(self) -> NDArray[np.uint32]:
        """The distinct rows, in the order of their first appearance."""
        return self._rows[: self._n_row]

    def forget(self) -> None:
        """Find what comes from now on among itself alone."""
        self._n_row = 0
        self._table.fill(0)

    def find(self, bits: NDArray[np.uint32], out: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Write for each row which distinct one it is; return at which rows new ones appear, until the next call."""
        if self._n_row + len(bits) > len(self._rows):
            self._grow()
        n_known = self._n_row
        self._n_row = number_rows(bits, self._seed, self._table, self._rows, n_known, self._first, out)
        return self._first[: self._n_row - n_known]

    def _grow(self) -> None:
        """Make room for twice as many distinct rows."""
        rows, n_given = self.rows, len(self._first)
        self._rows = np.empty((2 * len(rows) + n_given, rows.shape[1]), np.uint32)
        self._table = np.zeros(1 << (2 * len(self._rows) - 1).bit_length(), np.uint32)
        numbers = np.empty(n_given, np.uint32)
        for begin in range(0, len(rows), n_given):
            some = rows[begin : begin + n_given]
            number_rows(some, self._seed, self._table, self._rows, begin, self._first, numbers)


@kernel
def number_rows(bits, seed, table, rows, n_row, first, out):
    """Number distinct rows in the order of their first appearance; return how many are known then.

    bits (n, k) u32; seed u64; table (2^m,) u32 holds for `n_row` rows that are known their number + 1, else 0, and is
    twice as long as these and n at least; rows (n_row + n, k) u32 holds the known ones and takes the new ones; first
    (n,) i64 takes the places of the new ones, out (n,) u32 the number of each.

    Open addressing: Knuth, TAOCP 3, 6.4, algorithm L. The hash, a multiplication and a shift a column, is made as in
    Steele, Lea & Flood 2014, Fast splittable pseudorandom number generators (SplitMix64), OOPSLA.
    """
    mask, n_column = index(len(table) - 1), index(bits.shape[1])
    n_known = index(n_row)
    n_row = n_known
    for row in range(index(len(bits))):
        mixed = seed
        for column in range(n_column):
            mixed = (mixed ^ bits[row, column]) * np.uint64(0xBF58476D1CE4E5B9)
            mixed ^= mixed >> _SHIFT
        slot = mixed & mask
        while True:
            number = index(table[slot])
            if number == index(0):
                for column in range(n_column):
                    rows[n_row, column] = bits[row, column]
                first[n_row - n_known] = row
                out[row] = n_row
                n_row += index(1)
                table[slot] = n_row
                break
            number -= index(1)
            is_equal = True
            for column in range(n_column):
                is_equal &= bits[row, column] == rows[number, column]
            if is_equal:
                out[row] = number
                break
            slot = (slot + index(1)) & mask
    return np.int64(n_row)
