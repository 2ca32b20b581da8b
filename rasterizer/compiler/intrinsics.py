"""Functions of kernels whose instructions are written here, in LLVM's own terms: kernels.spelled_out asks for them.

Some inner loops of the pipeline are vector instructions. The compiler turns long loops into vector instructions by
itself, but not loops of eight or four: left to it, these take two to four times as long. The functions in Python that
they stand in for are in pipeline/simd.py and texture_planes.py, with what the parameters are; those of the other
two are in kernels.py.

Seen in llvmlite 0.44 to 0.50: `ir` with typed pointers (`.type.pointee`), and `cgutils` of numba.
"""

import numba
from llvmlite import ir
from numba import types

from .fingerprint import is_seen
from .vectors import FLOATS, data_of, in_fours, load, shuffle, splat, transpose
from .widths import ID_BIT, LANES, PLANE_GROUP

if is_seen(numba.__version__):
    from numba.core import cgutils

_EDGES = ir.VectorType(ir.IntType(32), LANES)
_ENTRIES = ir.VectorType(ir.IntType(64), LANES)
_WHOLES = ir.VectorType(ir.IntType(32), PLANE_GROUP)
_ANCHOR = 1, 2  # where the first four numbers of a record have its anchor, x and y


def build_merge_box(typing_context, entries, start, pitch, n_row, plane, edges, depth_mask):
    """Build `simd.merge_box`: a row of LANES samples at a time."""
    if not (isinstance(entries, types.Array) and entries.dtype == types.int64 and entries.layout == "C"):
        return None
    unsigned, signed = types.uint64, types.int64
    three, nine = types.UniTuple(unsigned, 3), types.UniTuple(signed, 9)
    signature = types.void(entries, unsigned, unsigned, signed, three, nine, signed)

    def generate(context, builder, signature, arguments):
        data = data_of(context, builder, signature.args[0], arguments[0])
        value, dx, dy = cgutils.unpack_tuple(builder, arguments[4])
        states = [_Ramp(builder, _ENTRIES, value, dx, dy)]
        edges = [builder.trunc(edge, ir.IntType(32)) for edge in cgutils.unpack_tuple(builder, arguments[5])]
        states += [_Ramp(builder, _EDGES, *edges[k : k + 3]) for k in (0, 3, 6)]
        position = cgutils.alloca_once_value(builder, arguments[1])
        mask = splat(builder, _ENTRIES, arguments[6])
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
    """Build `simd.evaluate_planes`."""
    return _build_evaluation(entries, group, out, has_slopes=False)


def build_evaluate_slopes(typing_context, entries, group, x, y, out, start, stride):
    """Build `texture_planes.evaluate_slopes`."""
    return _build_evaluation(entries, group, out, has_slopes=True)


def _build_evaluation(entries, group, out, has_slopes):
    """Build a loop that evaluates planes: four samples at a time, each with its four planes, which are then transposed.

    `has_slopes` says whether the slopes of the first three planes are written, too: d/dx of each, then d/dy.
    """
    numbers, *layout = group
    is_single = all(kind.dtype == types.float32 for kind in (numbers, out)) and out.layout == "C"
    if not is_single or layout != [types.int64, types.uint64, types.uint64]:
        return None
    signature = types.void(entries, group, types.int64, types.int64, out, types.uint64, types.uint64)

    def generate(context, builder, signature, arguments):
        out = data_of(context, builder, signature.args[4], arguments[4])
        reader = _PlaneReader(context, builder, signature, arguments)
        with in_fours(builder, reader.n_entry) as (first, four):
            position = reader.begin_four()
            samples = [reader.read(position, j, k, has_slopes) for j, k in enumerate(four)]
            target = builder.add(arguments[5], first)
            for n_row, vectors in zip((PLANE_GROUP, *[PLANE_GROUP - 1] * 2), zip(*samples, strict=True), strict=False):
                for values in transpose(builder, vectors)[:n_row]:
                    builder.store(values, builder.bitcast(builder.gep(out, [target]), FLOATS.as_pointer()), align=4)
                    target = builder.add(target, arguments[6])
        return context.get_dummy_value()

    return signature, generate


class _PlaneReader:
    """The records that entries show, and where the samples of a row lie in them."""

    def __init__(self, context, builder, signature, arguments):
        entries = context.make_array(signature.args[0])(context, builder, arguments[0])
        numbers, self._mask, self._shift, self._column = cgutils.unpack_tuple(builder, arguments[1])
        self._numbers = data_of(context, builder, signature.args[1][0], numbers)
        self._builder, self._entries, self.n_entry = builder, entries.data, entries.nitems
        first = ir.Constant(_WHOLES, [0] * PLANE_GROUP)
        for lane, coordinate in zip(_ANCHOR, arguments[2:4], strict=True):
            first = builder.insert_element(first, builder.trunc(coordinate, ir.IntType(32)), ir.IntType(32)(lane))
        self._position = cgutils.alloca_once_value(builder, first)

    def begin_four(self):
        """The position of the first of four samples, where a record has its anchor; moves on by four."""
        position = self._builder.load(self._position)
        self._builder.store(self._moved(position, PLANE_GROUP), self._position)
        return position

    def _moved(self, position, n):
        return self._builder.add(position, ir.Constant(_WHOLES, [n if lane == _ANCHOR[0] else 0 for lane in range(4)]))

    def read(self, position, j, k, has_slopes):
        """The values of four planes at sample number k, the j-th of four; and their slopes, where these are asked
        for."""
        builder = self._builder
        number = _record_number(builder, builder.load(builder.gep(self._entries, [k])), self._mask)
        record = builder.gep(self._numbers, [builder.shl(number, self._shift)])
        anchor = load(builder, record, 0, _WHOLES)
        offset = builder.sitofp(builder.sub(self._moved(position, j), anchor), FLOATS)
        across, down = (shuffle(builder, offset, offset, [lane] * PLANE_GROUP) for lane in _ANCHOR)
        planes = builder.gep(record, [self._column])
        value, dx, dy = (load(builder, planes, part * PLANE_GROUP, FLOATS) for part in range(3))
        value = builder.fadd(builder.fadd(value, builder.fmul(across, dx)), builder.fmul(down, dy))
        return (value, dx, dy) if has_slopes else (value,)


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


class _Ramp:
    """A vector value, value + dx, value + 2 dx, ... that moves by dy from row to row."""

    def __init__(self, builder, kind, value, dx, dy):
        lanes = ir.Constant(kind, list(range(LANES)))
        first = builder.add(splat(builder, kind, value), builder.mul(splat(builder, kind, dx), lanes))
        self._state = cgutils.alloca_once_value(builder, first)
        self._step = splat(builder, kind, dy)

    def next(self, builder):
        """The vector of this row; moves on to the next."""
        value = builder.load(self._state)
        builder.store(builder.add(value, self._step), self._state)
        return value
