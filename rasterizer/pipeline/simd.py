"""Two inner loops as vector instructions: a small box of samples, and the planes of one sample.

The compiler turns long loops into vector instructions by itself, but not loops of eight or four: left to it, these take
two to four times as long. So they are spelled out in LLVM's own vector operations; tests/pipeline/test_simd.py compares
them with plain Python.
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
GROUP = 4  # planes that are evaluated side by side


@intrinsic
def merge_box(typing_context, words, start, pitch, n_row, word, edges, depth_mask):
    """Merge a box LANES samples wide into a z-buffer: the inner loop of the scan stage for small triangles. In Python
    it reads

        for row in range(n_row):
            for k in range(LANES):
                word = word_0 + k * word_x + row * word_y
                is_inside = (e0 + k * e0_x + row * e0_y) | (e1 + ...) | (e2 + ...) >= 0
                if is_inside and word < words[start + row * pitch + k] & depth_mask:
                    words[start + row * pitch + k] = word

    with words of 64 bits whose arithmetic wraps, and edge functions of 32 bits.

    words : (n,) int64 · start, pitch : uint64 · n_row : int64 · word : (value, d/dx, d/dy) uint64
    edges : (value, d/dx, d/dy) of each of the three edges, nine int64 · depth_mask : int64
    """
    if not (isinstance(words, types.Array) and words.dtype == types.int64 and words.layout == "C"):
        return None
    signature = types.void(
        words,
        types.uint64,
        types.uint64,
        types.int64,
        types.UniTuple(types.uint64, 3),
        types.UniTuple(types.int64, 9),
        types.int64,
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
            is_inside = builder.icmp_signed(
                ">=", builder.or_(e0, builder.or_(e1, e2)), ir.Constant(_EDGES, [0] * LANES)
            )
            is_nearer = builder.icmp_signed("<", new, builder.and_(old, mask))
            builder.store(builder.select(builder.and_(is_inside, is_nearer), new, old), address, align=8)
            builder.store(builder.add(here, arguments[2]), place)
        return context.get_dummy_value()

    return signature, generate


@intrinsic
def take_planes(typing_context, words, n, record_mask, numbers, shift, column, x, y, scale, out, place, stride):
    """Evaluate a group of four planes at every sample of a row: the inner loop of the shade stage. In Python it reads

        for k in range(n):
            record = (words[k] & record_mask) << shift
            across, down = x + k - numbers[record + 1], y - numbers[record + 2]
            for i in range(GROUP):
                value, value_x, value_y = (numbers[record + column + part * GROUP + i] for part in range(3))
                out[place + i * stride + k] = value + across * value_x + down * value_y

    where numbers[record + 1] and [record + 2] are integers whatever the others are. Int32 wraps, and is multiplied by
    `scale` at the end; its fourth plane is left out. Float32 is rounded after each operation, in this order. Samples up
    to the next multiple of GROUP are read and written, too.

    words : (n,) int64 · numbers : int32 or float32 · out : float32 or float64 · scale : as out · the others : 64 bits
    """
    if numbers.dtype not in (types.int32, types.float32) or out.dtype not in (types.float32, types.float64):
        return None
    number = types.uint64
    signature = types.void(
        words, number, types.int64, numbers, number, number, types.int64, types.int64, out.dtype, out, number, number
    )
    is_integer = numbers.dtype == types.int32

    def generate(context, builder, signature, arguments):
        words, n, mask, numbers, shift, column, x, y, scale, out, place, stride = (
            context.make_array(kind)(context, builder, value).data if isinstance(kind, types.Array) else value
            for kind, value in zip(signature.args, arguments, strict=True)
        )
        whole, index = ir.IntType(32), ir.IntType(64)
        kind = ir.VectorType(whole if is_integer else ir.FloatType(), GROUP)
        out_kind = ir.VectorType(out.type.pointee, GROUP)
        add = builder.add if is_integer else builder.fadd
        x, y, scale = builder.trunc(x, whole), builder.trunc(y, whole), _splat(builder, out_kind, scale)

        def load(address, offset, kind):
            return builder.load(
                builder.bitcast(builder.gep(address, [ir.Constant(index, offset)]), kind.as_pointer()), align=4
            )

        def times(steps, planes):
            if is_integer:
                return builder.mul(_splat(builder, kind, steps), planes)
            return builder.fmul(_splat(builder, kind, builder.sitofp(steps, ir.FloatType())), planes)

        def sample(k):
            record = builder.gep(
                numbers, [builder.shl(builder.and_(builder.load(builder.gep(words, [k])), mask), shift)]
            )
            across = builder.sub(builder.add(x, builder.trunc(k, whole)), load(record, 1, whole))
            down = builder.sub(y, load(record, 2, whole))
            planes = builder.gep(record, [column])
            value = add(load(planes, 0, kind), times(across, load(planes, GROUP, kind)))
            return add(value, times(down, load(planes, 2 * GROUP, kind)))

        def finish(values):
            if is_integer:
                return builder.fmul(builder.sitofp(values, out_kind), scale)
            return values if out_kind == kind else builder.fpext(values, out_kind)

        group = ir.Constant(index, GROUP)
        count = builder.udiv(builder.add(n, ir.Constant(index, GROUP - 1)), group)
        with cgutils.for_range(builder, count) as loop:
            first = builder.mul(loop.index, group)
            samples = [sample(builder.add(first, ir.Constant(index, k))) for k in range(GROUP)]
            target = builder.add(place, first)
            for values in _transpose(builder, samples)[: 3 if is_integer else GROUP]:
                address = builder.bitcast(builder.gep(out, [target]), out_kind.as_pointer())
                builder.store(finish(values), address, align=out.type.pointee.get_abi_alignment(context.target_data))
                target = builder.add(target, stride)
        return context.get_dummy_value()

    return signature, generate


def _transpose(builder, rows):
    """Turn four vectors of four into their columns."""

    def mix(a, b, order):
        return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), GROUP), order))

    low = [mix(rows[k], rows[k + 1], [0, 4, 1, 5]) for k in (0, 2)]
    high = [mix(rows[k], rows[k + 1], [2, 6, 3, 7]) for k in (0, 2)]
    return [mix(*pair, order) for pair in (low, high) for order in ([0, 1, 4, 5], [2, 3, 6, 7])]


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
    return builder.shuffle_vector(
        first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), kind.count), [0] * kind.count)
    )
