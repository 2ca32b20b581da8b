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
from .vectors import FLOATS, data_of, half, in_fours, load, shuffle, splat, transpose
from .widths import ID_BIT, LANES, PLANE_GROUP, POINT_UNIT

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
    """Build `simd.evaluate_planes`, or `evaluate_planes_at`."""
    return _build_evaluation(_values, entries, group, (x, y), out)


def build_evaluate_values(typing_context, entries, group, x, y, out, start, stride, weights):
    """Build `simd.evaluate_values`, or `evaluate_values_at`."""
    return _build_evaluation(_weighted_values, entries, group, (x, y), out, types.uint64)


def build_evaluate_slopes(typing_context, entries, group, x, y, out, start, stride):
    """Build `texture_planes.evaluate_slopes`, or `evaluate_slopes_at`."""
    return _build_evaluation(_values_and_slopes, entries, group, (x, y), out)


def build_evaluate_with_slopes(typing_context, entries, group, first, out, start, stride, behind, behind_start):
    """Build `screen_points.evaluate_with_slopes`: eight planes of a sample side by side."""
    is_list, unsigned = isinstance(first, types.NamedTuple), types.uint64
    axes = (types.int32, types.int32) if is_list else (types.int64, types.int64)
    if tuple(getattr(axis, "dtype", axis) for axis in tuple(first)[:2]) != axes or not _is_known(group, out, behind):
        return None
    signature = types.void(entries, group, first, out, unsigned, unsigned, behind, unsigned)

    def generate(context, builder, signature, arguments):
        out, behind = (data_of(context, builder, signature.args[k], arguments[k]) for k in (3, 6))
        place = cgutils.unpack_tuple(builder, arguments[2])[:2]
        if is_list:
            place = [data_of(context, builder, kind, axis) for kind, axis in zip(first, place, strict=False)]
        reader, n = _make_reader(context, builder, signature, arguments, place, is_list, out)
        with in_fours(builder, n) as (first_of_four, four):
            position = reader.begin_four()
            samples = [_pair_and_slopes(reader, reader.at(position, j, k)) for j, k in enumerate(four)]
            pairs, slopes = (transpose(builder, vectors) for vectors in zip(*samples, strict=True))
            rows = [half(builder, pair, 0) for pair in pairs]
            rows_behind = [half(builder, pair, 1) for pair in pairs]
            rows_behind += [half(builder, slope, side) for side in (0, 1) for slope in slopes[:-1]]
            for data, start, some in ((out, arguments[4], rows), (behind, arguments[7], rows_behind)):
                _store_rows(builder, data, builder.add(start, first_of_four), arguments[5], some)
        return context.get_dummy_value()

    return signature, generate


def _is_known(group, *outs):
    """Whether the types of a group of planes, and of what is written, are those that instructions are written for."""
    numbers, *layout = group
    is_single = all(kind.dtype == types.float32 for kind in (numbers, *outs))
    return is_single and all(out.layout == "C" for out in outs) and layout == [types.int64, types.uint64, types.uint64]


def _make_reader(context, builder, signature, arguments, place, is_list, out):
    """A reader of the records that entries show, which are the first two arguments; and the number of entries."""
    entries = context.make_array(signature.args[0])(context, builder, arguments[0])
    numbers, *layout = cgutils.unpack_tuple(builder, arguments[1])
    numbers = data_of(context, builder, signature.args[1][0], numbers)
    kind = _PointReader if is_list else _PlaneReader
    return kind(builder, entries.data, (numbers, *layout), place, out), entries.nitems


def _store_rows(builder, data, target, stride, rows):
    """Store four samples of each row; `target` is where those of the first one begin."""
    for values in rows:
        builder.store(values, builder.bitcast(builder.gep(data, [target]), FLOATS.as_pointer()), align=4)
        target = builder.add(target, stride)


def _build_evaluation(sample, entries, group, place, out, *others):
    """Build a loop that evaluates planes: four samples at a time, each with its four planes, which are then transposed.

    sample : (_PlaneReader, place of the sample, its number, *others) -> vectors of four: planes, slopes of three
    place : types of x and y: of the first sample of a row; or of arrays, of points that lie anywhere
    others : types of further arguments
    """
    unsigned, signed = types.uint64, types.int64
    if not _is_known(group, out):
        return None
    is_list = isinstance(place[0], types.Array)
    if is_list and any(axis.dtype != types.int32 for axis in place):
        return None
    place = place if is_list else (signed, signed)
    signature = types.void(entries, group, *place, out, unsigned, unsigned, *others)

    def generate(context, builder, signature, arguments):
        out, place = data_of(context, builder, signature.args[4], arguments[4]), arguments[2:4]
        if is_list:
            place = [data_of(context, builder, signature.args[axis], arguments[axis]) for axis in (2, 3)]
        reader, n = _make_reader(context, builder, signature, arguments, place, is_list, out)
        with in_fours(builder, n) as (first, four):
            position, rows = reader.begin_four(), []
            samples = [sample(reader, reader.at(position, j, k), k, *arguments[7:]) for j, k in enumerate(four)]
            for n_row, vectors in zip((PLANE_GROUP, *[PLANE_GROUP - 1] * 2), zip(*samples, strict=True), strict=False):
                rows += transpose(builder, vectors)[:n_row]
            _store_rows(builder, out, builder.add(arguments[5], first), arguments[6], rows)
        return context.get_dummy_value()

    return signature, generate


class _PlaneReader:
    """The records that entries show, and where the samples of a row lie in them; `out` is what is written."""

    def __init__(self, builder, entries, group, first, out):
        self.builder, self._entries, (self._numbers, self._mask, self._shift, self._column) = builder, entries, group
        self.out = out
        self._begin(first)

    def _begin(self, first):
        self._position = cgutils.alloca_once_value(self.builder, self._placed(first))

    def _placed(self, coordinates):
        """A vector that has coordinates where a record has its anchor."""
        position = ir.Constant(_WHOLES, [0] * PLANE_GROUP)
        for lane, coordinate in zip(_ANCHOR, coordinates, strict=True):
            if coordinate.type != ir.IntType(32):
                coordinate = self.builder.trunc(coordinate, ir.IntType(32))
            position = self.builder.insert_element(position, coordinate, ir.IntType(32)(lane))
        return position

    def begin_four(self):
        """The position of the first of four samples, where a record has its anchor; moves on by four."""
        position = self.builder.load(self._position)
        self.builder.store(self._moved(position, PLANE_GROUP), self._position)
        return position

    def _moved(self, position, n):
        return self.builder.add(position, ir.Constant(_WHOLES, [n if lane == _ANCHOR[0] else 0 for lane in range(4)]))

    def at(self, position, j, k):
        """The planes of sample number k, the j-th of four, and how far it lies from the anchor, across and down."""
        builder = self.builder
        number = _record_number(builder, builder.load(builder.gep(self._entries, [k])), self._mask)
        record = builder.gep(self._numbers, [builder.shl(number, self._shift)])
        offset = self._offset(load(builder, record, 0, _WHOLES), position, j, k)
        across, down = (shuffle(builder, offset, offset, [lane] * PLANE_GROUP) for lane in _ANCHOR)
        return builder.gep(record, [self._column]), across, down

    def _offset(self, anchor, position, j, k):
        return self.builder.sitofp(self.builder.sub(self._moved(position, j), anchor), FLOATS)

    def part(self, planes, number):
        """Four numbers of a group: values, d/dx, d/dy, least, greatest."""
        return load(self.builder, planes, number * PLANE_GROUP, FLOATS)


class _PointReader(_PlaneReader):
    """The same for points that lie anywhere, in 1/POINT_UNIT of a sample's width."""

    def _begin(self, first):
        self._points = first

    def begin_four(self):
        """Nothing: each point tells where it lies."""

    def _offset(self, anchor, position, j, k):
        builder = self.builder
        point = self._placed([builder.load(builder.gep(axis, [k])) for axis in self._points])
        parts = builder.mul(anchor, ir.Constant(_WHOLES, [POINT_UNIT] * PLANE_GROUP))
        unit = ir.Constant(FLOATS, [1.0 / POINT_UNIT] * PLANE_GROUP)
        return builder.fmul(builder.sitofp(builder.sub(point, parts), FLOATS), unit)


def _plane_values(reader, place):
    """The values of four planes at a sample."""
    builder, (planes, across, down) = reader.builder, place
    value = builder.fadd(reader.part(planes, 0), builder.fmul(across, reader.part(planes, 1)))
    return builder.fadd(value, builder.fmul(down, reader.part(planes, 2)))


def _values(reader, place, k):
    """The four planes of a sample."""
    return (_plane_values(reader, place),)


def _weighted_values(reader, place, k, weights):
    """The four planes of a sample, multiplied and kept within a range."""
    builder = reader.builder
    weight = splat(builder, FLOATS, builder.load(builder.gep(reader.out, [builder.add(weights, k)])))
    value = builder.fmul(_plane_values(reader, place), weight)
    least, greatest = reader.part(place[0], 3), reader.part(place[0], 4)
    value = builder.select(builder.fcmp_ordered(">", value, least), value, least)
    return (builder.select(builder.fcmp_ordered("<", value, greatest), value, greatest),)


def _values_and_slopes(reader, place, k):
    """The four planes of a sample, and the slopes of three of them."""
    return _plane_values(reader, place), reader.part(place[0], 1), reader.part(place[0], 2)


def _pair_and_slopes(reader, place):
    """The planes of a group and of the one behind it, eight of a sample, and the slopes of the latter."""
    builder, (planes, across, down) = reader.builder, place
    both, behind = list(range(2 * PLANE_GROUP)), builder.gep(planes, [ir.IntType(64)(3 * PLANE_GROUP)])
    value, dx, dy = (
        shuffle(builder, reader.part(planes, number), reader.part(behind, number), both) for number in range(3)
    )
    across, down = (shuffle(builder, offset, offset, [k % PLANE_GROUP for k in both]) for offset in (across, down))
    value = builder.fadd(value, builder.fmul(across, dx))
    slopes = shuffle(builder, reader.part(behind, 1), reader.part(behind, 2), both)
    return builder.fadd(value, builder.fmul(down, dy)), slopes


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
