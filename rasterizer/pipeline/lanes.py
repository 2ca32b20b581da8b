"""A small box of samples as vector instructions: the inner loop of the scan stage for small triangles.

The compiler turns long loops into vector instructions by itself, but not loops of eight: left to it, this one takes four times
as long. So it is spelled out in LLVM's own vector operations. In Python it reads

    for row in range(n_row):
        for k in range(LANES):
            word = word_0 + k * word_x + row * word_y
            is_inside = (e0 + k * e0_x + row * e0_y) | (e1 + ...) | (e2 + ...) >= 0
            if is_inside and word < words[start + row * pitch + k] & depth_mask:
                words[start + row * pitch + k] = word

with words of 64 bits whose arithmetic wraps, and edge functions of 32 bits; tests/test_lanes.py compares the two.
"""

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 8
# Edge functions of a box up to so many samples wide and high fit 32 bits: 2 · (16 · 256) · (128 · 256) = 2^28.
MOST_WIDE, MOST_HIGH = 2 * LANES, 128
_EDGES = ir.VectorType(ir.IntType(32), LANES)
_WORDS = ir.VectorType(ir.IntType(64), LANES)


@intrinsic
def merge_box(typing_context, words, start, pitch, n_row, word, edges, depth_mask):
    """Merge a box LANES samples wide into a z-buffer.

    words : (n,) int64 · start, pitch : uint64 · n_row : int64 · word : (value, d/dx, d/dy) uint64
    edges : (value, d/dx, d/dy) of each of the three edges, nine int64 · depth_mask : int64
    """
    if not (isinstance(words, types.Array) and words.dtype == types.int64 and words.layout == "C"):
        return None
    signature = types.void(
        words, types.uint64, types.uint64, types.int64, types.UniTuple(types.uint64, 3), types.UniTuple(types.int64, 9), types.int64
    )

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        value, step_x, step_y = cgutils.unpack_tuple(builder, arguments[4])
        states = [_Ramp(builder, _WORDS, value, step_x, step_y)]
        numbers = [builder.trunc(number, ir.IntType(32)) for number in cgutils.unpack_tuple(builder, arguments[5])]
        states += [_Ramp(builder, _EDGES, *numbers[k : k + 3]) for k in (0, 3, 6)]
        place = cgutils.alloca_once_value(builder, arguments[1])
        mask = _splat(builder, _WORDS, arguments[6])
        with cgutils.for_range(builder, arguments[3]):
            here = builder.load(place)
            address = builder.bitcast(builder.gep(data, [here]), _WORDS.as_pointer())
            new, e0, e1, e2 = (state.next(builder) for state in states)
            old = builder.load(address, align=8)
            is_inside = builder.icmp_signed(">=", builder.or_(e0, builder.or_(e1, e2)), ir.Constant(_EDGES, [0] * LANES))
            is_nearer = builder.icmp_signed("<", new, builder.and_(old, mask))
            builder.store(builder.select(builder.and_(is_inside, is_nearer), new, old), address, align=8)
            builder.store(builder.add(here, arguments[2]), place)
        return context.get_dummy_value()

    return signature, generate


class _Ramp:
    """A vector value, value + step_x, value + 2 step_x, ... that moves by step_y from row to row."""

    def __init__(self, builder, kind, value, step_x, step_y):
        lanes = ir.Constant(kind, list(range(LANES)))
        first = builder.add(_splat(builder, kind, value), builder.mul(_splat(builder, kind, step_x), lanes))
        self._state = cgutils.alloca_once_value(builder, first)
        self._step = _splat(builder, kind, step_y)

    def next(self, builder):
        """The vector of this row; moves on to the next."""
        value = builder.load(self._state)
        builder.store(builder.add(value, self._step), self._state)
        return value


def _splat(builder, kind, value):
    """A vector with the same value in every lane."""
    nothing = ir.Constant(kind, ir.Undefined)
    first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))
