"""Eight samples side by side as vector instructions: the inner step of the scan stage for small triangles.

The compiler turns long loops into vector instructions by itself, but not loops of eight: left to it, this step takes 3.5 times
as long. So it is spelled out in LLVM's own vector operations. In Python it reads

    for k in range(LANES):
        word = word_0 + k * word_x
        is_inside = (e0 + k * e0_x) | (e1 + k * e1_x) | (e2 + k * e2_x) >= 0
        if is_inside and word < words[start + k] & DEPTH_MASK:
            words[start + k] = word

with 64-bit arithmetic that wraps; tests/test_lanes.py compares the two.
"""

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

LANES = 8
_INT = ir.IntType(64)
_VECTOR = ir.VectorType(_INT, LANES)


@intrinsic
def merge_lanes(typing_context, words, start, word, word_x, e0, e0_x, e1, e1_x, e2, e2_x, depth_mask):
    """Merge a row of LANES samples into words[start:start + LANES]; all numbers 64-bit integers, `start` unsigned."""
    if not (isinstance(words, types.Array) and words.dtype == types.int64 and words.layout == "C"):
        return None
    signature = types.void(words, types.uint64, *[types.int64] * 9)

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        address = builder.bitcast(builder.gep(data, [arguments[1]]), _VECTOR.as_pointer())
        word, word_x, e0, e0_x, e1, e1_x, e2, e2_x, depth_mask = arguments[2:]
        new = _ramp(builder, word, word_x)
        edges = builder.or_(_ramp(builder, e0, e0_x), builder.or_(_ramp(builder, e1, e1_x), _ramp(builder, e2, e2_x)))
        old = builder.load(address, align=8)
        is_inside = builder.icmp_signed(">=", edges, ir.Constant(_VECTOR, [0] * LANES))
        is_nearer = builder.icmp_signed("<", new, builder.and_(old, _splat(builder, depth_mask)))
        builder.store(builder.select(builder.and_(is_inside, is_nearer), new, old), address, align=8)
        return context.get_dummy_value()

    return signature, generate


def _splat(builder, value):
    """A vector with the same value in every lane."""
    first = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, ir.Constant(_VECTOR, ir.Undefined), zeros)


def _ramp(builder, value, step):
    """The vector value, value + step, value + 2 step, ..."""
    lane = ir.Constant(_VECTOR, list(range(LANES)))
    return builder.add(_splat(builder, value), builder.mul(_splat(builder, step), lane))
