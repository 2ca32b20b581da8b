"""Functions of kernels that read and blend texels, as instructions: see intrinsics.py.

The functions in Python that they stand in for are in pipeline/texel_blend.py.
"""

import numba
import numpy as np
from llvmlite import ir
from numba import types

from .fingerprint import is_seen
from .vectors import FLOATS, data_of, half, in_fours, shuffle, splat, transpose
from .widths import PLANE_GROUP, TEXELS_AHEAD

if is_seen(numba.__version__):
    from numba.core import cgutils


def build_fetch_texels(typing_context, texels, batch, rows, n, out, start, stride, step):  # noqa: PLR0917 - numba's context comes first
    """Build `texel_blend.fetch_texels`."""
    return _build_texels(_fetch, (0,), 1.0, texels, batch, rows, out)


def build_blend_texels(typing_context, texels, batch, rows, n, out, start, stride, step):  # noqa: PLR0917 - numba's context comes first
    """Build `texel_blend.blend_texels`."""
    return _build_texels(_means, (0, 1), -(2.0**-15), texels, batch, rows, out)


def build_blend_mip_levels(typing_context, texels, batch, rows, n, out, start, stride, step):  # noqa: PLR0917 - numba's context comes first
    """Build `texel_blend.blend_mip_levels`."""
    return _build_texels(_mixed_means, (0, 1, 4, 5), -(2.0**-15), texels, batch, rows, out)


def _build_texels(sample, positions, factor, texels, batch, rows, out):
    """Build a loop that reads texels: four samples, one after the other, which are then transposed.

    The memory is asked for the texels of the sample TEXELS_AHEAD behind each, and at first for those of as many: large
    textures stay in no cache.

    sample : (_TexelReader, numbers of four samples) -> four channels of each
    positions : which of the rows say where texels are
    factor : what they are multiplied by, beside the step
    """
    if texels.dtype != types.int16 or batch.dtype != types.float32 or out.dtype != types.float32:
        return None
    if any(row != types.uint64 for row in rows):
        return None
    unsigned = types.uint64
    signature = types.void(texels, batch, rows, unsigned, out, unsigned, unsigned, types.float32)

    def generate(context, builder, signature, arguments):
        texels, batch, out = (data_of(context, builder, signature.args[k], arguments[k]) for k in (0, 1, 4))
        n, start, stride, step = arguments[3], *arguments[5:]
        reader = _TexelReader(builder, texels, batch, cgutils.unpack_tuple(builder, arguments[2]))
        alpha_step = ir.Constant(ir.FloatType(), float(np.float32(1.0 / 65535.0)))
        ahead = ir.Constant(ir.IntType(64), TEXELS_AHEAD)
        n_ahead = builder.select(builder.icmp_unsigned("<", n, ahead), n, ahead)
        with cgutils.for_range(builder, n_ahead) as loop:
            reader.prefetch(positions, loop.index)
        with in_fours(builder, n) as (first, four):
            for k in four:
                reader.prefetch(positions, builder.add(k, ahead))
            samples = sample(reader, four)
            target = builder.add(start, first)
            for channel, values in enumerate(transpose(builder, samples)):
                of_one = step if channel < 3 else alpha_step
                per_value = builder.fmul(ir.Constant(ir.FloatType(), factor), of_one)
                zero = builder.fmul(ir.Constant(ir.FloatType(), 2.0**15), of_one)
                values = builder.fmul(values, splat(builder, FLOATS, per_value))
                values = builder.fadd(values, splat(builder, FLOATS, zero))
                builder.store(values, builder.bitcast(builder.gep(out, [target]), FLOATS.as_pointer()), align=4)
                target = builder.add(target, stride)
        return context.get_dummy_value()

    return signature, generate


class _TexelReader:
    """The texels, and the rows of a batch that say which to read."""

    def __init__(self, builder, texels, batch, rows):
        self.builder, self._texels, self._batch, self._rows = builder, texels, batch, rows

    def load_row(self, row, k, kind):
        """The numbers of a row from sample k on."""
        address = self.builder.gep(self._batch, [self.builder.add(self._rows[row], k)])
        return self.builder.load(self.builder.bitcast(address, kind.as_pointer()), align=4)

    def load(self, row, k, kind):
        """The texels from sample k's texel in a row on."""
        return self.builder.load(self.builder.bitcast(self._address(row, k), kind.as_pointer()), align=2)

    def prefetch(self, rows, k):
        """Have the texels of sample k in some rows brought near; of one behind the last any address will do."""
        byte, whole = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte, whole, whole, whole])
        function = self.builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        for row in rows:
            address = self.builder.bitcast(self._address(row, k), byte)
            self.builder.call(function, [address, whole(0), whole(3), whole(1)])  # for reading, to stay, data

    def _address(self, row, k):
        texel = self.builder.zext(self.load_row(row, k, ir.IntType(32)), ir.IntType(64))
        return self.builder.gep(self._texels, [self.builder.shl(texel, ir.Constant(ir.IntType(64), 2))])


def _fetch(reader, four):
    """The values of the texels of four samples."""
    texels = [reader.load(0, k, ir.VectorType(ir.IntType(16), 4)) for k in four]
    return [reader.builder.sitofp(values, FLOATS) for values in texels]


def _means(reader, four):
    """The means of four texels each of four samples."""
    sums = []
    for j in (0, 2):
        pair = _weighted_sums(reader, four, ((0, j), (0, j + 1)))
        sums += [half(reader.builder, pair, side) for side in (0, 1)]
    return sums


def _mixed_means(reader, four):
    """The mixtures of the means of two mip levels, of four samples; that of one level where all shares are 0."""
    builder = reader.builder
    shares = reader.load_row(8, four[0], FLOATS)
    bits = builder.bitcast(shares, ir.IntType(32 * PLANE_GROUP))
    with builder.if_else(builder.icmp_unsigned("!=", bits, bits.type(0))) as (are_some, are_none):
        with are_some:
            mixed, of_mixed = _mix_levels(reader, four, shares), builder.block
        with are_none:
            means, of_means = _means(reader, four), builder.block
    found = [builder.phi(FLOATS) for _ in four]
    for result, a, b in zip(found, mixed, means, strict=True):
        result.add_incoming(a, of_mixed)
        result.add_incoming(b, of_means)
    return found


def _mix_levels(reader, four, shares):
    """The means of two mip levels, mixed by shares of the second one."""
    builder, mixed = reader.builder, []
    for j in range(PLANE_GROUP):
        pair = _weighted_sums(reader, four, ((0, j), (4, j)))
        a, b = (half(builder, pair, side) for side in (0, 1))
        share = shuffle(builder, shares, shares, [j] * PLANE_GROUP)
        mixed.append(builder.fadd(a, builder.fmul(share, builder.fsub(b, a))))
    return mixed


def _weighted_sums(reader, four, pair):
    """The weighted sums of four texels each, twice, side by side.

    Values of the upper and of the lower texel take turns, and so do weights: products are added pair by pair, for which
    many processors have an instruction, and the compiler finds it.

    pair : (the first row of a mip level, which of the four samples), two of them
    """
    builder, shorts, longs = reader.builder, ir.VectorType(ir.IntType(16), 16), ir.VectorType(ir.IntType(32), 16)
    texels = ir.VectorType(ir.IntType(16), 8)
    top, bottom = (
        shuffle(builder, *(reader.load(first + row, four[j], texels) for first, j in pair), list(range(16)))
        for row in (0, 1)
    )
    sums = []
    for side in (0, 1):
        order = [8 * half + 4 * side + i + 16 * j for half in (0, 1) for i in range(4) for j in (0, 1)]
        values = shuffle(builder, top, bottom, order)
        rows = [reader.load_row(first + 2 + side, four[0], ir.VectorType(ir.IntType(32), 4)) for first, _ in pair]
        weights = shuffle(builder, *rows, [pair[0][1]] * 4 + [4 + pair[1][1]] * 4)
        products = builder.mul(builder.sext(values, longs), builder.sext(builder.bitcast(weights, shorts), longs))
        even, odd = (shuffle(builder, products, products, list(range(i, 16, 2))) for i in (0, 1))
        sums.append(builder.add(even, odd))
    return builder.sitofp(builder.add(*sums), ir.VectorType(ir.FloatType(), 8))
