"""Two inner loops as vector instructions: a small box of samples, and the planes of one sample.

The compiler turns long loops into vector instructions by itself, but not loops of eight or four: left to it, these take
two to four times as long. So they are spelled out in LLVM's own vector operations. Each stands here twice: as plain
Python, which says what it does and runs where nothing is compiled, and as the intrinsic that kernels get in its place;
tests/pipeline/test_simd.py compares the two.
"""

from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload

from ..compiler.kernels import index

LANES = 8
# Edge functions of a box up to so many samples wide and high fit 32 bits: 2 · (16 · 256) · (128 · 256) = 2^28.
MOST_WIDE, MOST_HIGH = 2 * LANES, 128
PLANE_GROUP = 4  # planes that are evaluated side by side
_EDGES = ir.VectorType(ir.IntType(32), LANES)
_ENTRIES = ir.VectorType(ir.IntType(64), LANES)


def merge_box(entries, start, pitch, n_row, plane, edges, depth_mask):
    """Merge a box LANES samples wide into a visibility buffer: the inner loop of the scan stage for small triangles.

    Entries have 64 bits and edge functions 32; both wrap.

    Parameters
    ----------
    entries : (n,) int64
    start, pitch : uint64, the box's first entry, and how many there are from row to row
    n_row : int64
    plane : (value, d/dx, d/dy) of the entries, three uint64
    edges : (value, d/dx, d/dy) of each of the three edges, nine int64; >= 0 is inside
    depth_mask : int64, the bits of an entry that decide what is nearer
    """
    value, plane_dx, plane_dy = (int(number) for number in plane)
    edges, start, pitch = [int(number) for number in edges], int(start), int(pitch)
    for row in range(n_row):
        for lane in range(LANES):
            k = start + row * pitch + lane
            entry = _wrap(value + lane * plane_dx + row * plane_dy, 64)
            is_inside = all(_wrap(edges[e] + lane * edges[e + 1] + row * edges[e + 2], 32) >= 0 for e in (0, 3, 6))
            if is_inside and entry < entries[k] & depth_mask:
                entries[k] = entry


class PlaneGroup(NamedTuple):
    """Four planes of every record, side by side."""

    planes: np.ndarray  # (n << shift,) int32 or float32, the records, 2^shift numbers each
    record_mask: int  # int64, the bits of an entry that are the index of a record
    shift: int  # uint64
    column: int  # uint64, where the group begins in a record
    scale: float  # of integers: what a value is multiplied by


def evaluate_planes(entries, group, x, y, out, start, stride):
    """Evaluate four planes at every sample of a row: the inner loop of the shade stage.

    Int32 wraps, and is multiplied by the scale at the end; its fourth plane is left out. Float32 is rounded after each
    operation, in this order. Compiled, samples up to the next multiple of PLANE_GROUP are read and written, too.

    Parameters
    ----------
    entries : (n,) int64, which hold indices of records
    group : PlaneGroup; numbers 1 and 2 of a record are integers whatever the others are: column and row of the sample
        where its planes are anchored
    x, y : int64, the first sample
    out : float32 or float64; plane i of sample k goes to out[start + i * stride + k]
    start, stride : uint64
    """
    planes = group.planes
    anchors, dtype = planes.view(np.int32), planes.dtype.type
    is_integer = dtype is np.int32
    for k in range(len(entries)):
        record = int(entries[k] & group.record_mask) << int(group.shift)
        across, down = int(x) + k - int(anchors[record + 1]), int(y) - int(anchors[record + 2])
        for i in range(PLANE_GROUP - is_integer):
            first = record + int(group.column) + i
            value, dx, dy = planes[first], planes[first + PLANE_GROUP], planes[first + 2 * PLANE_GROUP]
            target = int(start) + i * int(stride) + k
            if is_integer:
                out[target] = out.dtype.type(_wrap(int(value) + across * int(dx) + down * int(dy), 32)) * group.scale
            else:
                out[target] = value + dtype(across) * dx + dtype(down) * dy


def _wrap(value, bits):
    """Return the lowest bits of a Python integer, in two's complement."""
    return (value + (1 << bits - 1)) % (1 << bits) - (1 << bits - 1)


# ---------------------------------------------------------------- the same as vector instructions


@overload(merge_box, jit_options={"forceinline": True})
def _compile_merge_box(entries, start, pitch, n_row, plane, edges, depth_mask):
    return lambda entries, start, pitch, n_row, plane, edges, depth_mask: _merge_box(
        entries, start, pitch, n_row, plane, edges, depth_mask
    )


@overload(evaluate_planes, jit_options={"forceinline": True})
def _compile_evaluate_planes(entries, group, x, y, out, start, stride):
    return lambda entries, group, x, y, out, start, stride: _evaluate_planes(
        entries, index(len(entries)), group, x, y, out, start, stride
    )


@intrinsic
def _merge_box(typing_context, entries, start, pitch, n_row, plane, edges, depth_mask):
    """Build `merge_box`."""
    if not (isinstance(entries, types.Array) and entries.dtype == types.int64 and entries.layout == "C"):
        return None
    unsigned, signed = types.uint64, types.int64
    three, nine = types.UniTuple(unsigned, 3), types.UniTuple(signed, 9)
    signature = types.void(entries, unsigned, unsigned, signed, three, nine, signed)

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        value, plane_dx, plane_dy = cgutils.unpack_tuple(builder, arguments[4])
        states = [_Ramp(builder, _ENTRIES, value, plane_dx, plane_dy)]
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


@intrinsic
def _evaluate_planes(typing_context, entries, n, group, x, y, out, start, stride):
    """Build `evaluate_planes`."""
    planes = group[0]
    if planes.dtype not in (types.int32, types.float32) or out.dtype not in (types.float32, types.float64):
        return None
    unsigned, signed = types.uint64, types.int64
    group = types.NamedTuple([planes, signed, unsigned, unsigned, out.dtype], PlaneGroup)
    signature = types.void(entries, unsigned, group, signed, signed, out, unsigned, unsigned)
    is_integer = planes.dtype == types.int32

    def generate(context, builder, signature, arguments):
        def data_of(kind, array):
            return context.make_array(kind)(context, builder, array).data

        entries, out = data_of(signature.args[0], arguments[0]), data_of(signature.args[5], arguments[5])
        n, x, y, start, stride = (arguments[k] for k in (1, 3, 4, 6, 7))
        planes, mask, shift, column, scale = cgutils.unpack_tuple(builder, arguments[2])
        planes = data_of(signature.args[2][0], planes)
        whole, long = ir.IntType(32), ir.IntType(64)
        kind = ir.VectorType(whole if is_integer else ir.FloatType(), PLANE_GROUP)
        out_kind = ir.VectorType(out.type.pointee, PLANE_GROUP)
        add = builder.add if is_integer else builder.fadd
        x, y, scale = builder.trunc(x, whole), builder.trunc(y, whole), _splat(builder, out_kind, scale)

        def load(address, offset, kind):
            return builder.load(
                builder.bitcast(builder.gep(address, [ir.Constant(long, offset)]), kind.as_pointer()), align=4
            )

        def times(steps, slopes):
            if is_integer:
                return builder.mul(_splat(builder, kind, steps), slopes)
            return builder.fmul(_splat(builder, kind, builder.sitofp(steps, ir.FloatType())), slopes)

        def sample(k):
            record = builder.gep(
                planes, [builder.shl(builder.and_(builder.load(builder.gep(entries, [k])), mask), shift)]
            )
            across = builder.sub(builder.add(x, builder.trunc(k, whole)), load(record, 1, whole))
            down = builder.sub(y, load(record, 2, whole))
            first = builder.gep(record, [column])
            value = add(load(first, 0, kind), times(across, load(first, PLANE_GROUP, kind)))
            return add(value, times(down, load(first, 2 * PLANE_GROUP, kind)))

        def finish(values):
            if is_integer:
                return builder.fmul(builder.sitofp(values, out_kind), scale)
            return values if out_kind == kind else builder.fpext(values, out_kind)

        step = ir.Constant(long, PLANE_GROUP)
        count = builder.udiv(builder.add(n, ir.Constant(long, PLANE_GROUP - 1)), step)
        with cgutils.for_range(builder, count) as loop:
            first = builder.mul(loop.index, step)
            samples = [sample(builder.add(first, ir.Constant(long, k))) for k in range(PLANE_GROUP)]
            target = builder.add(start, first)
            for values in _transpose(builder, samples)[: 3 if is_integer else PLANE_GROUP]:
                address = builder.bitcast(builder.gep(out, [target]), out_kind.as_pointer())
                builder.store(finish(values), address, align=out.type.pointee.get_abi_alignment(context.target_data))
                target = builder.add(target, stride)
        return context.get_dummy_value()

    return signature, generate


def _transpose(builder, rows):
    """Transpose four vectors of four."""

    def mix(a, b, order):
        return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), PLANE_GROUP), order))

    low = [mix(rows[k], rows[k + 1], [0, 4, 1, 5]) for k in (0, 2)]
    high = [mix(rows[k], rows[k + 1], [2, 6, 3, 7]) for k in (0, 2)]
    return [mix(*pair, order) for pair in (low, high) for order in ([0, 1, 4, 5], [2, 3, 6, 7])]


class _Ramp:
    """A vector value, value + dx, value + 2 dx, ... that moves by dy from row to row."""

    def __init__(self, builder, kind, value, dx, dy):
        lanes = ir.Constant(kind, list(range(LANES)))
        first = builder.add(_splat(builder, kind, value), builder.mul(_splat(builder, kind, dx), lanes))
        self._state = cgutils.alloca_once_value(builder, first)
        self._step = _splat(builder, kind, dy)

    def next(self, builder):
        """Return the vector of this row; move on to the next."""
        value = builder.load(self._state)
        builder.store(builder.add(value, self._step), self._state)
        return value


def _splat(builder, kind, value):
    """Return a vector with the same value in every lane."""
    nothing = ir.Constant(kind, ir.Undefined)
    first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(
        first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), kind.count), [0] * kind.count)
    )
