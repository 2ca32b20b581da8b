"""Read numbers in text, exactly rounded: in long texts by compiled code (text_kernels.py), else by Python's `float`."""

import numpy as np
from numpy.typing import NDArray

from ..cores import Workers, n_core
from .model_file import report_progress

FEW = 1 << 18  # letters of a text that is read without waiting for a compiler, or for the code that it made
_BLANKS = bytes.maketrans(b"\t\n\v\f\r", b" " * 5)  # what C's isspace calls so
_BLOCK = 1 << 18  # letters that a thread reads


def read_words(words: list[bytes]) -> NDArray[np.float64] | None:
    """Return the numbers that words stand for, as `float` reads them; but underscores are not legal. None where one
    stands for none."""
    if b"_" in b"".join(words):
        return None
    try:
        return np.fromiter(map(float, words), np.float64, len(words))
    except ValueError:
        return None


def numbers_in(text: bytes) -> NDArray[np.float64] | None:
    """Return the numbers of a text with blanks or newlines between them, None where it holds anything else."""
    data = text.translate(_BLANKS)
    if len(data) < FEW:
        return read_words(data.split())
    cuts = [0]
    while cuts[-1] < len(data):
        end = data.find(b" ", cuts[-1] + _BLOCK)
        cuts.append(len(data) if end < 0 else end)

    def read(block: tuple[int, int]) -> NDArray[np.float64] | None:
        from .text_kernels import POWERS, read_numbers

        report_progress(block[0], len(data), "reading numbers")
        letters = data[slice(*block)] + b" "
        values = np.empty(len(letters))
        n = read_numbers(np.frombuffer(letters, np.uint8), POWERS, values)
        return read_words(letters.split()) if n < 0 else values[:n].copy()

    with Workers(n_core()) as workers:
        tables = workers.map(read, list(zip(cuts[:-1], cuts[1:], strict=True)))
    return None if any(table is None for table in tables) else np.concatenate(tables)
