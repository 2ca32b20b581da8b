"""A format of models whose reader does what a test wants: it raises, or reads the file as OBJ."""

from contextlib import contextmanager

from rasterizer.io import formats
from rasterizer.io.obj import read_obj

_to_raise: list[BaseException] = []


@contextmanager
def odd_format(*faults):
    """Read files that end with .odd inside the block; the first of them raise the faults, one each."""
    _to_raise[:] = faults
    formats.FORMATS["odd"] = formats.Format(name="odd", reader="helpers.odd_format:read_odd")
    try:
        yield
    finally:
        del formats.FORMATS["odd"]


def read_odd(model):
    """Read a model, or raise what is to be raised next."""
    if _to_raise:
        raise _to_raise.pop(0)
    return read_obj(model)
