"""Functions of kernels whose instructions are written here, in LLVM's own terms: kernels.spelled_out asks for them.

Some inner loops of the pipeline are vector instructions. The compiler turns long loops into vector instructions by
itself, but not loops of eight or four: left to it, these take two to four times as long. The functions in Python that
they stand in for are in pipeline/simd.py, texture_planes.py and texel_blend.py, with what the parameters are; those of
the other two are in kernels.py.

Seen in llvmlite 0.44 to 0.50: `ir` with typed pointers (`.type.pointee`), and `cgutils` of numba.
"""

from contextlib import contextmanager
from functools import partial

import numba
import numpy as np
from llvmlite import ir
from numba import types

from .fingerprint import is_seen
from .widths import ID_BIT, LANES, PLANE_GROUP, POINT_UNIT, TEXELS_AHEAD

if is_seen(numba.__version__):
    from numba.core import cgutils

_EDGES = ir.VectorType(ir.IntType(32), LANES)
_ENTRIES = ir.VectorType(ir.IntType(64), LANES)
_FLOATS = ir.VectorType(ir.FloatType(), PLANE_GROUP)


def build_merge_box(typing_context, entries, start, pitch, n_row, plane, edges, depth_mask):
    """Build `simd.merge_box`: a row of LANES samples at a time."""
    if not (isinstance(entries, types.Array) and entries.dtype == types.int64 and entries.layout == "C"):
        return None
    unsigned, signed = types.uint64, types.int64
    three, nine = types.UniTuple(unsigned, 3), types.UniTuple(signed, 9)
    signature = types.void(entries, unsigned, unsigned, signed, three, nine, signed)

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        value, dx, dy = cgutils.unpack_tuple(builder, arguments[4])
        states = [_Ramp(builder, _ENTRIES, value, dx, dy)]
        edges = [builder.trunc(edge, ir.IntType(32)) for edge in cgutils.unpack_tuple(builder, arguments[5])]
        states += [_Ramp(builder, _EDGES, *edges[k : k + 3]) for k in (0, 3, 6)]
        position = cgutils.alloca_once_value(builder, arguments[1])
        mask = _splat(builder, _ENTRIES, arguments[6])
        with cgutils.for_range(builder, arguments[3]):
            here = builder.load(position)
            address = builder.bitcast(builder.gep(data, [here]), _ENTRIES.as_pointer())
            new, e0, e1, e2 = (state.next(builder) for state in states)
            old = builder.load(address, align=8)
            is_inside = builder.icmp_signed(
                ">=", builder.or_(e0, builder.or_(e1, e2)), ir.Constant(_EDGES, [0] * LANES)
            )
            is_nearer = builder.icmp_signed("<", new, builder.and_(old, mask))
            builder.store(builder.select(builder.and_(is_inside, is_nearer), new, old), address, align=8)
            builder.store(builder.add(here, arguments[2]), position)
        return context.get_dummy_value()

    return signature, generate


def build_evaluate_planes(typing_context, entries, group, x, y, out, start, stride):
    """Build `simd.evaluate_planes`, or `evaluate_planes_at`."""
    return _evaluate(entries, group, x, y, out, start, stride)


def build_evaluate_values(typing_context, entries, group, x, y, out, start, stride, weights):
    """Build `simd.evaluate_values`, or `evaluate_values_at`."""
    return _evaluate(entries, group, x, y, out, start, stride, weights)


def _evaluate(entries, group, x, y, out, start, stride, *weights):
    """Build the evaluation of planes: four samples at a time, each with its four planes, which are then transposed.

    x and y are the first sample of a row; or arrays, of points that lie anywhere. With `weights` values are multiplied
    by them and kept within a range.
    """
    unsigned, signed = types.uint64, types.int64
    numbers, *others = group
    if numbers.dtype != types.float32 or out.dtype != types.float32 or out.layout != "C":
        return None
    if tuple(others) != (signed, unsigned, unsigned):
        return None
    is_list = isinstance(x, types.Array)
    if is_list and not x.dtype == y.dtype == types.int32:
        return None
    place = (x, y) if is_list else (signed, signed)
    signature = types.void(entries, group, *place, out, unsigned, unsigned, *[unsigned] * len(weights))

    def generate(context, builder, signature, arguments):
        def array_of(kind, value):
            return context.make_array(kind)(context, builder, value)

        entries, out = array_of(signature.args[0], arguments[0]), array_of(signature.args[4], arguments[4]).data
        entries, n = entries.data, entries.nitems
        x, y, start, stride = (arguments[k] for k in (2, 3, 5, 6))
        numbers, mask, shift, column = cgutils.unpack_tuple(builder, arguments[1])
        numbers = array_of(signature.args[1][0], numbers).data
        whole, real = ir.IntType(32), ir.FloatType()
        kind = ir.VectorType(real, PLANE_GROUP)
        load = partial(_load, builder)
        if is_list:
            x, y = (array_of(signature.args[axis], arguments[axis]).data for axis in (2, 3))
        else:
            x, y = (builder.trunc(x, whole), True), (builder.trunc(y, whole), False)

        def times(steps, planes):
            return builder.fmul(_splat(builder, kind, steps), planes)

        def sample(k):
            entry = builder.load(builder.gep(entries, [k]))
            record = builder.gep(numbers, [builder.shl(_record_number(builder, entry, mask), shift)])
            across, down = (_distance(builder, at, k, load(record, i, whole)) for i, at in ((1, x), (2, y)))
            planes = builder.gep(record, [column])
            value = builder.fadd(load(planes, 0, kind), times(across, load(planes, PLANE_GROUP, kind)))
            value = builder.fadd(value, times(down, load(planes, 2 * PLANE_GROUP, kind)))
            if not weights:
                return value
            weight = builder.load(builder.gep(out, [builder.add(arguments[7], k)]))
            value = builder.fmul(value, _splat(builder, kind, weight))
            least, greatest = load(planes, 3 * PLANE_GROUP, kind), load(planes, 4 * PLANE_GROUP, kind)
            value = builder.select(builder.fcmp_ordered(">", value, least), value, least)
            return builder.select(builder.fcmp_ordered("<", value, greatest), value, greatest)

        with _in_fours(builder, n) as (first, four):
            samples = [sample(k) for k in four]
            target = builder.add(start, first)
            for values in _transpose(builder, samples):
                address = builder.bitcast(builder.gep(out, [target]), kind.as_pointer())
                builder.store(values, address, align=4)
                target = builder.add(target, stride)
        return context.get_dummy_value()

    return signature, generate


def _distance(builder, position, k, anchor):
    """How far sample k lies from the sample `anchor`, in samples, along an axis.

    position : that of the first sample of a row and whether the next ones follow it; or a pointer to those of points
    """
    whole, real = ir.IntType(32), ir.FloatType()
    if isinstance(position, tuple):
        first, is_along = position
        here = builder.add(first, builder.trunc(k, whole)) if is_along else first
        return builder.sitofp(builder.sub(here, anchor), real)
    parts = builder.mul(anchor, ir.Constant(whole, POINT_UNIT))
    parts = builder.sitofp(builder.sub(builder.load(builder.gep(position, [k])), parts), real)
    return builder.fmul(parts, ir.Constant(real, 1.0 / POINT_UNIT))


def build_gather_slopes(typing_context, entries, group, out, start, stride):
    """Build `texture_planes.gather_slopes`: four samples at a time, each with its eight numbers, which are then
    transposed."""
    unsigned, signed = types.uint64, types.int64
    if (group[0].dtype, out.dtype, *tuple(group)[1:]) != (types.float32, types.float32, signed, unsigned, unsigned):
        return None
    signature = types.void(entries, group, out, unsigned, unsigned)

    def generate(context, builder, signature, arguments):
        def array_of(kind, value):
            return context.make_array(kind)(context, builder, value)

        entries, out = array_of(signature.args[0], arguments[0]), array_of(signature.args[2], arguments[2]).data
        numbers, mask, shift, column = cgutils.unpack_tuple(builder, arguments[1])
        numbers = array_of(signature.args[1][0], numbers).data

        def sample(k):
            record = _record_number(builder, builder.load(builder.gep(entries.data, [k])), mask)
            planes = builder.gep(numbers, [builder.add(builder.shl(record, shift), column)])
            return [_load(builder, planes, part * PLANE_GROUP, _FLOATS) for part in (1, 2)]

        with _in_fours(builder, entries.nitems) as (first, four):
            target = builder.add(arguments[3], first)
            for slopes in zip(*(sample(k) for k in four), strict=True):
                for values in _transpose(builder, slopes)[: PLANE_GROUP - 1]:
                    address = builder.bitcast(builder.gep(out, [target]), _FLOATS.as_pointer())
                    builder.store(values, address, align=4)
                    target = builder.add(target, arguments[4])
        return context.get_dummy_value()

    return signature, generate


def build_fetch_texels(typing_context, texels, batch, rows, n, out, start, stride, step):
    """Build `texel_blend.fetch_texels`."""
    return _build_texels(_fetch, 1.0, texels, batch, rows, out)


def build_blend_texels(typing_context, texels, batch, rows, n, out, start, stride, step):
    """Build `texel_blend.blend_texels`."""
    return _build_texels(_mean, -(2.0**-15), texels, batch, rows, out)


def build_blend_mip_levels(typing_context, texels, batch, rows, n, out, start, stride, step):
    """Build `texel_blend.blend_mip_levels`."""
    return _build_texels(_mix_means, -(2.0**-15), texels, batch, rows, out)


def _build_texels(sample, factor, texels, batch, rows, out):
    """Build a loop that reads texels: four samples, one after the other, which are then transposed.

    sample : (_TexelReader, number of the sample) -> its four channels
    factor : what they are multiplied by, beside the step
    """
    if texels.dtype != types.int16 or batch.dtype != types.float32 or out.dtype != types.float32:
        return None
    if any(row != types.uint64 for row in rows):
        return None
    unsigned = types.uint64
    signature = types.void(texels, batch, rows, unsigned, out, unsigned, unsigned, types.float32)

    def generate(context, builder, signature, arguments):
        def data_of(k):
            return context.make_array(signature.args[k])(context, builder, arguments[k]).data

        n, out, start, stride, step = arguments[3], data_of(4), *arguments[5:]
        reader = _TexelReader(builder, data_of(0), data_of(1), cgutils.unpack_tuple(builder, arguments[2]))
        alpha_step = ir.Constant(ir.FloatType(), float(np.float32(1.0 / 65535.0)))
        with _in_fours(builder, n) as (first, four):
            samples = [sample(reader, k) for k in four]
            target = builder.add(start, first)
            for channel, values in enumerate(_transpose(builder, samples)):
                of_one = step if channel < 3 else alpha_step
                per_value = builder.fmul(ir.Constant(ir.FloatType(), factor), of_one)
                zero = builder.fmul(ir.Constant(ir.FloatType(), 2.0**15), of_one)
                values = builder.fmul(values, _splat(builder, _FLOATS, per_value))
                values = builder.fadd(values, _splat(builder, _FLOATS, zero))
                builder.store(values, builder.bitcast(builder.gep(out, [target]), _FLOATS.as_pointer()), align=4)
                target = builder.add(target, stride)
        return context.get_dummy_value()

    return signature, generate


class _TexelReader:
    """The texels, and the rows of a batch that say which to read."""

    def __init__(self, builder, texels, batch, rows):
        self.builder, self._texels, self._batch, self._rows = builder, texels, batch, rows

    def share(self, row, k):
        """The number of sample k in a row."""
        return self.builder.load(self.builder.gep(self._batch, [self.builder.add(self._rows[row], k)]))

    def bits(self, row, k):
        """The whole number of sample k in a row."""
        return self.builder.bitcast(self.share(row, k), ir.IntType(32))

    def load(self, row, k, kind):
        """The texels from sample k's texel in a row on."""
        return self.builder.load(self.builder.bitcast(self._address(row, k), kind.as_pointer()), align=2)

    def prefetch(self, row, k):
        """Have the texels of a later sample brought near; behind the last sample any address will do."""
        byte, whole = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte, whole, whole, whole])
        function = self.builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        later = self.builder.add(k, ir.Constant(ir.IntType(64), TEXELS_AHEAD))
        address = self.builder.bitcast(self._address(row, later), byte)
        self.builder.call(function, [address, whole(0), whole(3), whole(1)])  # for reading, to stay, data

    def _address(self, row, k):
        texel = self.builder.zext(self.bits(row, k), ir.IntType(64))
        return self.builder.gep(self._texels, [self.builder.shl(texel, ir.Constant(ir.IntType(64), 2))])


def _fetch(reader, k):
    """The values of the texel of sample k."""
    values = reader.load(0, k, ir.VectorType(ir.IntType(16), 4))
    return reader.builder.sitofp(values, _FLOATS)


def _mean(reader, k):
    """The mean of four texels of sample k; the lower two of a later sample are asked for: the upper ones have often
    been the lower ones of the row of samples before."""
    reader.prefetch(1, k)
    return _weighted_sums(reader, k, 0)


def _weighted_sums(reader, k, first):
    """The weighted sums of four texels of sample k; rows from `first` on.

    Values of the upper and of the lower texel take turns, and so do weights: products are added pair by pair, for which
    many processors have an instruction, and the compiler finds it.
    """
    builder, shorts, longs = reader.builder, ir.VectorType(ir.IntType(16), 8), ir.VectorType(ir.IntType(32), 8)
    top, bottom = (reader.load(first + row, k, shorts) for row in (0, 1))
    sums = []
    for side in (0, 1):
        order = [4 * side + i + 8 * (j % 2) for i in range(4) for j in (0, 1)]
        values = _shuffle(builder, top, bottom, order)
        weights = _splat(builder, ir.VectorType(ir.IntType(32), 4), reader.bits(first + 2 + side, k))
        products = builder.mul(builder.sext(values, longs), builder.sext(builder.bitcast(weights, shorts), longs))
        even, odd = (_shuffle(builder, products, products, [i, i + 2, i + 4, i + 6]) for i in (0, 1))
        sums.append(builder.add(even, odd))
    return builder.sitofp(builder.add(*sums), _FLOATS)


def _mix_means(reader, k):
    """The mixture of the means of two mip levels."""
    builder, a, b = reader.builder, _mean(reader, k), _weighted_sums(reader, k, 4)
    share = _splat(builder, _FLOATS, reader.share(8, k))
    return builder.fadd(a, builder.fmul(share, builder.fsub(b, a)))


def _record_number(builder, entry, mask):
    """The bits of an entry that are the index of a record; 0 where it holds none, as the next samples of a row may."""
    one, bit = (ir.Constant(ir.IntType(64), number) for number in (1, ID_BIT))
    is_id = builder.and_(builder.lshr(entry, bit), one)
    return builder.and_(builder.and_(entry, mask), builder.neg(is_id))


def build_array(typing_context, pointer, shape):
    """Build `kernels.as_array`: the struct of an array that nobody owns, at a pointer."""
    kind = types.Array(pointer.dtype, len(shape), "C")

    def generate(context, builder, signature, arguments):
        array = context.make_array(kind)(context, builder)
        lengths = cgutils.unpack_tuple(builder, arguments[1])
        step = ir.Constant(ir.IntType(64), context.get_abi_sizeof(context.get_data_type(kind.dtype)))
        steps, n_item = [], ir.Constant(ir.IntType(64), 1)
        for length in reversed(lengths):
            steps.append(builder.mul(n_item, step))
            n_item = builder.mul(n_item, length)
        array.data, array.itemsize, array.nitems = arguments[0], step, n_item
        array.shape = cgutils.pack_array(builder, lengths)
        array.strides = cgutils.pack_array(builder, steps[::-1])
        array.meminfo, array.parent = (cgutils.get_null_value(x.type) for x in (array.meminfo, array.parent))
        return array._getvalue()

    return kind(pointer, shape), generate


def build_call(typing_context, address, batch, n, coefficients):
    """Build `kernels.call_batch_function`: a call through a pointer to a function."""
    signature = types.void(types.intp, types.intp, types.intp, types.intp)

    def generate(context, builder, _signature, arguments):
        whole = ir.IntType(64)
        function_type = ir.FunctionType(ir.VoidType(), [whole, whole, whole])
        builder.call(builder.inttoptr(arguments[0], function_type.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return signature, generate


def _load(builder, address, offset, kind):
    """Load a value of a kind, `offset` numbers behind an address."""
    element = builder.gep(address, [ir.Constant(ir.IntType(64), offset)])
    return builder.load(builder.bitcast(element, kind.as_pointer()), align=4)


@contextmanager
def _in_fours(builder, n):
    """Loop over n samples, PLANE_GROUP at a time; yield the number of the first one, and of each."""
    long = ir.IntType(64)
    step = ir.Constant(long, PLANE_GROUP)
    count = builder.udiv(builder.add(n, ir.Constant(long, PLANE_GROUP - 1)), step)
    with cgutils.for_range(builder, count) as loop:
        first = builder.mul(loop.index, step)
        yield first, [builder.add(first, ir.Constant(long, k)) for k in range(PLANE_GROUP)]


def _shuffle(builder, a, b, order):
    """A vector of elements of two others, which are counted through."""
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), len(order)), order))


def _transpose(builder, rows):
    """Turn four vectors of four into their columns."""
    low = [_shuffle(builder, rows[k], rows[k + 1], [0, 4, 1, 5]) for k in (0, 2)]
    high = [_shuffle(builder, rows[k], rows[k + 1], [2, 6, 3, 7]) for k in (0, 2)]
    return [_shuffle(builder, *pair, order) for pair in (low, high) for order in ([0, 1, 4, 5], [2, 3, 6, 7])]


class _Ramp:
    """A vector value, value + dx, value + 2 dx, ... that moves by dy from row to row."""

    def __init__(self, builder, kind, value, dx, dy):
        lanes = ir.Constant(kind, list(range(LANES)))
        first = builder.add(_splat(builder, kind, value), builder.mul(_splat(builder, kind, dx), lanes))
        self._state = cgutils.alloca_once_value(builder, first)
        self._step = _splat(builder, kind, dy)

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
