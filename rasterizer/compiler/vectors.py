"""Vectors in LLVM's own terms: what intrinsics.py and texel_intrinsics.py build instructions of."""

from contextlib import contextmanager

import numba
from llvmlite import ir

from .fingerprint import is_seen
from .widths import PLANE_GROUP

if is_seen(numba.__version__):
    from numba.core import cgutils

FLOATS = ir.VectorType(ir.FloatType(), PLANE_GROUP)


def data_of(context, builder, kind, array):
    """The address of an array's first element."""
    return context.make_array(kind)(context, builder, array).data


def load(builder, address, offset, kind):
    """Load a value of a kind, `offset` numbers behind an address."""
    element = builder.gep(address, [ir.Constant(ir.IntType(64), offset)])
    return builder.load(builder.bitcast(element, kind.as_pointer()), align=4)


@contextmanager
def in_fours(builder, n):
    """Loop over n samples, PLANE_GROUP at a time; yield the number of the first one, and of each."""
    long = ir.IntType(64)
    step = ir.Constant(long, PLANE_GROUP)
    count = builder.udiv(builder.add(n, ir.Constant(long, PLANE_GROUP - 1)), step)
    with cgutils.for_range(builder, count) as loop:
        first = builder.mul(loop.index, step)
        yield first, [builder.add(first, ir.Constant(long, k)) for k in range(PLANE_GROUP)]


def shuffle(builder, a, b, order):
    """A vector of elements of two others, which are counted through."""
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), len(order)), order))


def transpose(builder, rows):
    """Turn four vectors of four into their columns; of four vectors of eight, the first halves and the second ones."""
    low = [_interleave(builder, rows[k], rows[k + 1], [0, 4, 1, 5]) for k in (0, 2)]
    high = [_interleave(builder, rows[k], rows[k + 1], [2, 6, 3, 7]) for k in (0, 2)]
    return [_interleave(builder, *pair, order) for pair in (low, high) for order in ([0, 1, 4, 5], [2, 3, 6, 7])]


def _interleave(builder, a, b, order):
    """Shuffle each four elements of two vectors alike; 4 to 7 are those of the second one."""
    n = a.type.count
    return shuffle(builder, a, b, [k + j if j < 4 else n + k + j - 4 for k in range(0, n, 4) for j in order])


def half(builder, eight, side):
    """The first four elements of eight, or the others."""
    return shuffle(builder, eight, eight, [4 * side + k for k in range(4)])


def splat(builder, kind, value):
    """A vector with the same value in every lane."""
    nothing = ir.Constant(kind, ir.Undefined)
    first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(
        first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), kind.count), [0] * kind.count)
    )
