"""What is said of each picture that is done: a line on a terminal, and a bar where there are many.

    raster: [37/200] thumbs/part.png, 640x480, 35.1 kB, 0.12 s

The bar is that of tqdm, the extra `progress`; without it the lines count alone. Nothing is said where stderr is no
terminal, where -q or -v is given, or where lines of JSON say more.
"""

import sys

from .messages import NORMAL, byte_words

_MANY = 5  # pictures from which on there is a bar


class Results:
    """Tell what is done; a context manager.

    Parameters
    ----------
    messages : Messages, whose lines go through the bar while it is there
    n : how many pictures there will be
    is_told : whether anybody wants lines
    """

    def __init__(self, messages, n: int, is_told: bool = True):
        is_terminal = sys.stderr is not None and sys.stderr.isatty()
        self._messages, self._n, self._n_done = messages, n, 0
        self._is_told = is_told and is_terminal and messages.level == NORMAL
        self._bar = None

    def __enter__(self):
        if self._is_told and self._n >= _MANY:
            self._bar = _make_bar(self._n)
            self._messages.bar = self._bar
        return self

    def __exit__(self, *_):
        if self._bar is not None:
            self._messages.bar = None
            self._bar.close()

    def tell(self, output: str | None, size, n_byte: int | None, seconds: float) -> None:
        """Say that a picture is done.

        Parameters
        ----------
        output : path, - for stdout, or None where no file is written
        size : (width, height), pixels
        n_byte : of the file; None = none is written
        seconds : that it took
        """
        self._n_done += 1
        if self._is_told and output is not None:
            count = f"[{self._n_done}/{self._n}] " if self._n > 1 else ""
            name = "stdout" if output == "-" else output
            width, height = size
            size_words = f", {byte_words(n_byte)}" if n_byte is not None else ""
            self._messages.notice(f"{count}{name}, {width}x{height}{size_words}, {seconds:.2f} s")
        if self._bar is not None:
            self._bar.update()


def _make_bar(n):
    """The bar of tqdm; None where it isn't installed."""
    try:
        from tqdm import tqdm
    except ImportError:
        return None
    return tqdm(total=n, file=sys.stderr, unit="picture", leave=False, dynamic_ncols=True)
