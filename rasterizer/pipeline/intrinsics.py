"""Inner loops of the pipeline as vector instructions, in LLVM's own terms: kernels.spelled_out asks for them.

The compiler turns long loops into vector instructions by itself, but not loops of eight or four: left to it, frames
take up to 2.5 times as long (bench/README.md). A function here is the instructions of the plain function that names it:
those of scan.py, samples.py and texture_lookup.py, where the parameters are explained. It is loaded
only where one is compiled.

Seen in llvmlite 0.44 to 0.50: `ir` with typed pointers (`.type.pointee`), and `cgutils` of numba.
"""

import math
from contextlib import contextmanager
from itertools import tee
from typing import NamedTuple

from llvmlite import ir
from numba import types
from numba.core import cgutils

from .fragments import BATCH_SIZE
from .samples import PLANE_GROUP
from .visibility import INTENSITY_BITS, IS_WEIGHTED, LANES

TEXELS_AHEAD = 96  # samples by which texels are asked for before they are read
FLOATS = ir.VectorType(ir.FloatType(), PLANE_GROUP)
_EDGES = ir.VectorType(ir.IntType(32), LANES)
_PACKED = ir.VectorType(ir.IntType(64), LANES)
_REALS = ir.VectorType(ir.FloatType(), LANES)
_WHOLES = ir.VectorType(ir.IntType(32), PLANE_GROUP)
_ANCHOR = 1, 2  # where the first four numbers of a setup have its anchor, x and y


# ---------------------------------------------------------------- small boxes


def build_merge_box(typing_context, packed, start, pitch, n_row, plane, edges, depth_mask):
    """Build `merge_box`: a row of LANES samples at a time."""
    if not (isinstance(packed, types.Array) and packed.dtype == types.int64 and packed.layout == "C"):
        return None
    unsigned, signed = types.uint64, types.int64
    three, nine = types.UniTuple(unsigned, 3), types.UniTuple(signed, 9)
    signature = types.void(packed, signed, signed, signed, three, nine, signed)

    def generate(context, builder, signature, arguments):
        data = data_of(context, builder, signature.args[0], arguments[0])
        packed = _Ramp(builder, _PACKED, *cgutils.unpack_tuple(builder, arguments[4]))
        edges = [builder.trunc(edge, ir.IntType(32)) for edge in cgutils.unpack_tuple(builder, arguments[5])]
        edges = [_Ramp(builder, _EDGES, *edges[k : k + 3]) for k in (0, 3, 6)]
        position = cgutils.alloca_once_value(builder, arguments[1])
        mask = splat(builder, _PACKED, arguments[6])
        with cgutils.for_range(builder, arguments[3]):
            here = builder.load(position)
            new, e0, e1, e2 = (ramp.next(builder) for ramp in (packed, *edges))
            is_inside = builder.icmp_signed(
                ">=", builder.or_(e0, builder.or_(e1, e2)), ir.Constant(_EDGES, [0] * LANES)
            )
            _merge(builder, builder.gep(data, [here]), new, is_inside, mask)
            builder.store(builder.add(here, arguments[2]), position)
        return context.get_dummy_value()

    return signature, generate


def build_fill_span(typing_context, span, packed, step, depth_mask):
    """Build `fill_span`: LANES samples at a time. A sample is inside while some of the span are left."""
    if not (isinstance(span, types.Array) and span.dtype == types.int64 and span.layout == "C"):
        return None

    def generate(context, builder, signature, arguments):
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        n, (packed, step, depth_mask) = array.nitems, arguments[1:]
        n_before = builder.and_(builder.sub(n, n.type(1)), n.type(-LANES))  # up to the last LANES, or fewer
        ramp = _Ramp(builder, _PACKED, packed, step, builder.mul(step, step.type(LANES)))
        mask = splat(builder, _PACKED, depth_mask)
        with cgutils.for_range_slice(builder, n.type(0), n_before, n.type(LANES), n.type) as (first, _):
            _merge(builder, builder.gep(array.data, [first]), ramp.next(builder), None, mask)
        left = builder.trunc(builder.sub(n, n_before), ir.IntType(32))
        lanes = ir.Constant(_EDGES, list(range(LANES)))
        is_inside = builder.icmp_signed("<", lanes, splat(builder, _EDGES, left))
        _merge(builder, builder.gep(array.data, [n_before]), ramp.next(builder), is_inside, mask)
        return context.get_dummy_value()

    return types.void(span, types.uint64, types.uint64, types.int64), generate


def _merge(builder, address, new, is_inside, mask):
    """Write LANES packed samples to an address, where they are inside and nearer than what is there.

    What is written back as it was may not become a masked store: on processors with AVX2 that takes several times as
    long, and what is read next from there waits for it.

    Parameters
    ----------
    is_inside : vector of booleans; None where all are inside
    mask : the bits of packed samples that are compared, in all lanes
    """
    address = builder.bitcast(address, _PACKED.as_pointer())
    old = freeze(builder, builder.load(address, align=8))
    is_written = builder.icmp_signed("<", new, builder.and_(old, mask))
    if is_inside is not None:
        is_written = builder.and_(is_inside, is_written)
    builder.store(builder.select(is_written, new, old), address, align=8)


class _Ramp:
    """A vector value, value + dx, value + 2 dx, ... that moves by dy from row to row."""

    def __init__(self, builder, llvm_type, value, dx, dy):
        lanes = ir.Constant(llvm_type, list(range(LANES)))
        first = builder.add(splat(builder, llvm_type, value), builder.mul(splat(builder, llvm_type, dx), lanes))
        self._state = cgutils.alloca_once_value(builder, first)
        self._step = splat(builder, llvm_type, dy)

    def next(self, builder):
        """The vector of this row; moves on to the next."""
        value = builder.load(self._state)
        builder.store(builder.add(value, self._step), self._state)
        return value


# ---------------------------------------------------------------- planes


def build_planes_of_row(typing_context, packed, group, first, out, start):
    """Build `samples.evaluate_planes`."""
    return _build_evaluation((_Rows(out, 0, has_slopes=False),), packed, group)


def build_slopes_of_row(typing_context, packed, group, first, out, start):
    """Build `samples.evaluate_slopes`."""
    return _build_evaluation((_Rows(out, 0, has_slopes=True),), packed, group)


def build_both_of_row(typing_context, packed, group, first, out, start, behind, behind_start):
    """Build `samples.evaluate_with_slopes`."""
    slopes = _Rows(behind, 3 * PLANE_GROUP, has_slopes=True)
    return _build_evaluation((_Rows(out, 0, has_slopes=False), slopes), packed, group)


def build_values_of_row(typing_context, packed, group, first, out, start, weights):
    """Build `samples.evaluate_values`."""
    return _build_evaluation((_Rows(out, 0, has_slopes=False, has_range=True),), packed, group)


class _Rows(NamedTuple):
    """What is written of a group of planes: their values, or these, d/dx of the first three, and d/dy of these; or
    their values times a factor, within their ranges."""

    out: object  # the type of the array
    column: int  # of the group, behind the first one of the setup
    has_slopes: bool
    has_range: bool = False


def _build_evaluation(groups, packed, group):
    """Build a loop that evaluates planes: LANES samples at a time, each with its four planes, which are then
    transposed."""
    numbers, *layout = group
    is_single = all(array.dtype == types.float32 for array in (numbers, *(rows.out for rows in groups)))
    is_flat = all(rows.out.layout == "C" for rows in groups)
    if not is_single or not is_flat or layout != [types.int64, types.int64, types.int64]:
        return None
    places = [each for rows in groups for each in (rows.out, types.int64)] + [types.int64] * groups[0].has_range
    first = types.UniTuple(types.int64, 2)
    signature = types.void(packed, group, first, *places)

    def generate(context, builder, signature, arguments):
        places, stride = range(3, 3 + 2 * len(groups), 2), ir.Constant(ir.IntType(64), BATCH_SIZE)
        outs = [(data_of(context, builder, signature.args[k], arguments[k]), arguments[k + 1]) for k in places]
        reader = _PlaneReader(context, builder, signature, arguments)
        with side_by_side(builder, reader.n_packed, LANES) as (first, samples):
            located = tee(reader.locate(samples), len(groups))
            for rows, pairs, (out, start) in zip(groups, located, outs, strict=True):
                if rows.has_range:
                    factors = _eight_at(builder, out, builder.add(arguments[5], first))
                    parts = [[reader.read_within(pair, samples, j, factors) for j, pair in enumerate(pairs)]]
                else:
                    parts = zip(*(reader.read(pair, rows) for pair in pairs), strict=True)
                target = builder.add(start, first)
                for n_row, vectors in zip((PLANE_GROUP, *[PLANE_GROUP - 1] * 2), parts, strict=False):
                    for values in transpose(builder, vectors)[:n_row]:
                        builder.store(values, builder.bitcast(builder.gep(out, [target]), _REALS.as_pointer()), align=4)
                        target = builder.add(target, stride)
        return context.get_dummy_value()

    return signature, generate


class _PlaneReader:
    """The setups that packed samples show, and where the samples of a row lie in them."""

    def __init__(self, context, builder, signature, arguments):
        packed = context.make_array(signature.args[0])(context, builder, arguments[0])
        numbers, self._mask, self._shift, self._column = cgutils.unpack_tuple(builder, arguments[1])
        self._numbers = data_of(context, builder, signature.args[1][0], numbers)
        self._builder, self._packed, self.n_packed = builder, packed.data, packed.nitems
        unlimited = ir.Constant(_REALS, [-math.inf] * PLANE_GROUP + [math.inf] * PLANE_GROUP)
        unlimited = cgutils.alloca_once_value(builder, unlimited)
        self._unlimited = builder.bitcast(unlimited, ir.FloatType().as_pointer())
        first = ir.Constant(_EDGES, [0] * LANES)
        for lane, coordinate in zip(_ANCHOR, cgutils.unpack_tuple(builder, arguments[2]), strict=True):
            for place in (lane, lane + PLANE_GROUP):
                whole = builder.trunc(coordinate, ir.IntType(32))
                first = builder.insert_element(first, whole, ir.IntType(32)(place))
        self._position = cgutils.alloca_once_value(builder, builder.add(first, _right(0, PLANE_GROUP)))

    def locate(self, samples):
        """The setups of LANES samples, and how far these lie across and down in them: of each of the first four and of
        the fourth after it, side by side. Moves on by as many; a pair is looked for when it is asked for."""
        builder = self._builder
        position = builder.load(self._position)
        builder.store(builder.add(position, _right(LANES, LANES)), self._position)
        for j in range(PLANE_GROUP):
            setups = [self._setup(samples[k]) for k in (j, j + PLANE_GROUP)]
            here = builder.add(position, _right(j, j))
            offset = builder.sitofp(builder.sub(here, self._load(setups, 0, _WHOLES)), _REALS)
            across, down = (
                shuffle(builder, offset, offset, [lane] * PLANE_GROUP + [lane + PLANE_GROUP] * PLANE_GROUP)
                for lane in _ANCHOR
            )
            yield setups, across, down

    def _setup(self, k):
        """The address of the setup that sample k shows."""
        number = _setup_number(self._builder, self._builder.load(self._builder.gep(self._packed, [k])), self._mask)
        return self._builder.gep(self._numbers, [self._builder.shl(number, self._shift)])

    def read(self, located, rows):
        """The values of four planes at two samples; and their slopes, where these are asked for."""
        builder, (setups, across, down) = self._builder, located
        column = builder.add(self._column, ir.Constant(ir.IntType(64), rows.column))
        planes = [builder.gep(setup, [column]) for setup in setups]
        value, dx, dy = (self._load(planes, part * PLANE_GROUP, FLOATS) for part in range(3))
        value = builder.fadd(builder.fadd(value, builder.fmul(across, dx)), builder.fmul(down, dy))
        return (value, dx, dy) if rows.has_slopes else (value,)

    def read_within(self, located, samples, j, factors):
        """The values of four planes at samples j and j + 4, times the factors of these, within their ranges."""
        builder, pair = self._builder, (j, j + PLANE_GROUP)
        (value,) = self.read(located, _Rows(None, 0, has_slopes=False))
        lanes = [lane for lane in pair for _ in range(PLANE_GROUP)]
        value = builder.fmul(value, shuffle(builder, factors, factors, lanes))
        ranges = [self._range(samples[k], setup) for k, setup in zip(pair, located[0], strict=True)]
        for comparison, part in ((">", 0), ("<", 1)):  # of what is no number the least
            limit = self._load(ranges, part * PLANE_GROUP, FLOATS)
            value = builder.select(builder.fcmp_ordered(comparison, value, limit), value, limit)
        return value

    def _range(self, k, setup):
        """The address of the least and greatest values of sample k: behind weighted planes; others have none."""
        builder, weighted_bit = self._builder, ir.Constant(ir.IntType(64), int(IS_WEIGHTED))
        packed = builder.load(builder.gep(self._packed, [k]))
        is_weighted = builder.icmp_unsigned("!=", builder.and_(packed, weighted_bit), weighted_bit.type(0))
        behind = builder.add(self._column, ir.Constant(ir.IntType(64), 3 * PLANE_GROUP))
        return builder.select(is_weighted, builder.gep(setup, [behind]), self._unlimited)

    def _load(self, addresses, offset, llvm_type):
        """Four numbers each from two addresses, side by side."""
        both = (load(self._builder, address, offset, llvm_type) for address in addresses)
        return shuffle(self._builder, *both, list(range(LANES)))


def _eight_at(builder, data, start):
    """LANES numbers from a place on."""
    return builder.load(builder.bitcast(builder.gep(data, [start]), _REALS.as_pointer()), align=4)


def _right(first, second):
    """What moves two positions side by side to the right."""
    x = _ANCHOR[0]
    return ir.Constant(_EDGES, [step if lane == x else 0 for step in (first, second) for lane in range(PLANE_GROUP)])


def _setup_number(builder, packed, mask):
    """The bits of a packed sample that are the index of a setup; 0 where it holds none, as the next samples of a row
    may."""
    one, bit = (ir.Constant(ir.IntType(64), number) for number in (1, INTENSITY_BITS))
    is_id = builder.and_(builder.lshr(packed, bit), one)
    return builder.and_(builder.and_(packed, mask), builder.neg(is_id))


# ---------------------------------------------------------------- texels


def build_fetch_texels(typing_context, texels, batch, rows, n, out):
    """Build `texture_lookup.fetch_texels`."""
    return _build_texels(_fetch, (0,), texels, batch, rows)


def build_blend_texels(typing_context, texels, batch, rows, n, out):
    """Build `texture_lookup.blend_texels`."""
    return _build_texels(_means, (0, 1), texels, batch, rows)


def build_blend_mip_levels(typing_context, texels, batch, rows, n, out):
    """Build `texture_lookup.blend_mip_levels`."""
    return _build_texels(_mixed_means, (0, 1, 4, 5), texels, batch, rows)


def _build_texels(sample, positions, texels, batch, rows):
    """Build a loop that reads texels: four samples, one after the other, which are then transposed.

    The memory is asked for the texels of the sample TEXELS_AHEAD behind each, and at first for those of as many: large
    textures stay in no cache.

    sample : (_TexelReader, numbers of four samples) -> four channels of each
    positions : which of the rows say where texels are
    """
    if texels.dtype != types.float32 or batch.dtype != types.float32:
        return None
    if any(row != types.int64 for row in rows):
        return None
    signature = types.void(texels, batch, rows, types.int64, types.int64)

    def generate(context, builder, signature, arguments):
        texels, batch = (data_of(context, builder, signature.args[k], arguments[k]) for k in (0, 1))
        rows, n, out = arguments[2:]
        reader = _TexelReader(builder, texels, batch, cgutils.unpack_tuple(builder, rows))
        ahead, stride = (ir.Constant(ir.IntType(64), number) for number in (TEXELS_AHEAD, BATCH_SIZE))
        n_ahead = builder.select(builder.icmp_unsigned("<", n, ahead), n, ahead)
        with cgutils.for_range(builder, n_ahead) as loop:
            reader.prefetch(positions, loop.index)
        with side_by_side(builder, n, PLANE_GROUP) as (first, four):
            for k in four:
                reader.prefetch(positions, builder.add(k, ahead))
            target = builder.add(out, first)
            for values in transpose(builder, sample(reader, four)):
                builder.store(values, builder.bitcast(builder.gep(batch, [target]), FLOATS.as_pointer()), align=4)
                target = builder.add(target, stride)
        return context.get_dummy_value()

    return signature, generate


class _TexelReader:
    """The texels, and the rows of a batch that say which to read."""

    def __init__(self, builder, texels, batch, rows):
        self.builder, self._texels, self._batch, self._rows = builder, texels, batch, rows

    def load_row(self, row, k, llvm_type):
        """The numbers of a row from sample k on."""
        address = self.builder.gep(self._batch, [self.builder.add(self._rows[row], k)])
        return self.builder.load(self.builder.bitcast(address, llvm_type.as_pointer()), align=4)

    def load(self, row, k, llvm_type):
        """The texels from sample k's texel in a row on."""
        return load(self.builder, self._address(row, k), 0, llvm_type)

    def prefetch(self, rows, k):
        """Have the texels of sample k in some rows brought near; of one behind the last any address will do."""
        byte, whole = ir.IntType(8).as_pointer(), ir.IntType(32)
        llvm_type = ir.FunctionType(ir.VoidType(), [byte, whole, whole, whole])
        function = self.builder.module.declare_intrinsic("llvm.prefetch", [byte], llvm_type)
        for row in rows:
            address = self.builder.bitcast(self._address(row, k), byte)
            self.builder.call(function, [address, whole(0), whole(3), whole(1)])  # for reading, to stay, data

    def _address(self, row, k):
        texel = self.builder.zext(self.load_row(row, k, ir.IntType(32)), ir.IntType(64))
        return self.builder.gep(self._texels, [self.builder.shl(texel, ir.Constant(ir.IntType(64), 2))])


def _fetch(reader, four):
    """The texels of four samples."""
    return [reader.load(0, k, FLOATS) for k in four]


def _means(reader, four):
    """The means of four texels each of four samples."""
    found = []
    for j in (0, 2):
        pair = _pair_of_means(reader, ((0, four[j]), (0, four[j + 1])))
        found += [half(reader.builder, pair, side) for side in (0, 1)]
    return found


def _mixed_means(reader, four):
    """The mixtures of the means of two mip levels, of four samples; that of one level where all fractions are 0."""
    builder = reader.builder
    fractions = reader.load_row(8, four[0], FLOATS)
    bits = builder.bitcast(fractions, ir.IntType(32 * PLANE_GROUP))
    with builder.if_else(builder.icmp_unsigned("!=", bits, bits.type(0))) as (are_some, are_none):
        with are_some:
            mixed, of_mixed = _mix_levels(reader, four, fractions), builder.block
        with are_none:
            means, of_means = _means(reader, four), builder.block
    found = [builder.phi(FLOATS) for _ in four]
    for result, a, b in zip(found, mixed, means, strict=True):
        result.add_incoming(a, of_mixed)
        result.add_incoming(b, of_means)
    return found


def _mix_levels(reader, four, fractions):
    """The means of two mip levels, mixed by fractions of the second one."""
    builder, mixed = reader.builder, []
    for j, k in enumerate(four):
        pair = _pair_of_means(reader, ((0, k), (4, k)))
        fraction = shuffle(builder, fractions, fractions, [j] * PLANE_GROUP)
        mixed.append(_mix(builder, *(half(builder, pair, side) for side in (0, 1)), fraction))
    return mixed


def _pair_of_means(reader, pair):
    """Two means of four texels each, side by side.

    A texel and the one to its right stand side by side, too: the upper ones are mixed with the lower ones, and then the
    left halves with the right ones.

    pair : (the first row of a mip level, number of the sample), two of them
    """
    builder, columns, shares = reader.builder, [], []
    for row, k in pair:
        top, bottom = (reader.load(row + side, k, _REALS) for side in (0, 1))
        right, down = (reader.load_row(row + side, k, ir.FloatType()) for side in (2, 3))
        columns.append(_mix(builder, top, bottom, splat(builder, _REALS, down)))
        shares.append(splat(builder, FLOATS, right))
    left, right = (
        shuffle(builder, *columns, [8 * j + 4 * side + i for j in (0, 1) for i in range(4)]) for side in (0, 1)
    )
    return _mix(builder, left, right, shuffle(builder, *shares, list(range(LANES))))


def _mix(builder, a, b, fraction):
    """What lies the fraction of the way from a to b."""
    return builder.fadd(a, builder.fmul(fraction, builder.fsub(b, a)))


# ---------------------------------------------------------------- vectors


def data_of(context, builder, array_type, array):
    """The address of an array's first element."""
    return context.make_array(array_type)(context, builder, array).data


def load(builder, address, offset, llvm_type):
    """Load a value of a type, `offset` numbers behind an address."""
    element = builder.gep(address, [ir.Constant(ir.IntType(64), offset)])
    return builder.load(builder.bitcast(element, llvm_type.as_pointer()), align=4)


@contextmanager
def side_by_side(builder, n, size):
    """Loop over n samples, `size` at a time; yield the number of the first one, and of each."""
    long = ir.IntType(64)
    step = ir.Constant(long, size)
    count = builder.udiv(builder.add(n, ir.Constant(long, size - 1)), step)
    with cgutils.for_range(builder, count) as loop:
        first = builder.mul(loop.index, step)
        yield first, [builder.add(first, ir.Constant(long, k)) for k in range(size)]


def freeze(builder, value):
    """The same value, as LLVM's instruction `freeze` gives it: see `_merge`."""
    instruction = ir.instructions.Instruction(builder.block, value.type, "freeze", [value])
    builder._insert(instruction)
    return instruction


def splat(builder, llvm_type, value):
    """A vector with the same value in every lane."""
    undefined = ir.Constant(llvm_type, ir.Undefined)
    first = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(
        first, undefined, ir.Constant(ir.VectorType(ir.IntType(32), llvm_type.count), [0] * llvm_type.count)
    )


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
