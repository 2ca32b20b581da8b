"""Layers: what is seen through transparent surfaces, summed up from the lists of the A-buffer (a_buffer.py).

In:  the sorted lists of fragments of a band's samples, and the radiance of its opaque surfaces.
Out: radiance with the transparent surfaces in front; and of samples that nothing opaque is behind, the opacity.

One layer after the other is shaded, the k-th fragments of all samples, and summed up (Porter & Duff 1984, `over`):

    color += transmittance · a · c      opacity += transmittance · a      transmittance *= 1 - a

    sample   0    1    2    3    4
    nearest  a1   -    a2   a2   b1     1st layer
             b1        a1   |    |      2nd layer
             |              b1          3rd layer
    opaque   O    O    -    O    O      shaded once, as in a band without transparent surfaces

Then what is opaque is put behind: color + transmittance · O. Where nothing is, the radiance is color/opacity, that of
the surfaces alone.

A surface of opacity 0 is not there. A sample is done when t, what is still transmitted, is so small that the fragments
behind can't be seen. They could change the light from behind, t·O or t·0, by no more than t·B, B being the largest
intensity. Where nothing opaque is behind, they could add r <= a·B to the weighted colour s and a <= t to the opacity
o = 1 - t. Both s/o and r/a are at most B, so the colour s/o is off by

    |(s + r)/(o + a) - s/o| = |r/a - s/o| · a/(o + a) <= B·t/(1 - t) <= 2 B t     for t <= 1/2,

and the opacity by t. `Opacity.least` says which t that is.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from .records import material_of
from .simd import PLANE_GROUP
from .visibility import (
    CLEAR,
    MAX_RECORDS,
    NO_END,
    NO_START,
    PADDING,
    STRIP_SHIFT,
    VisibilityBuffer,
    record_of,
    stretch_of,
    strip_of,
    widen_extent,
)

# What is transmitted when no more is looked for: float32 shows no opacity from there to 1, and a colour is off by a
# 2^-25th of the brightest.
INVISIBLE = 2.0**-26


class Opacity(NamedTuple):
    """How transparent the materials are."""

    opacity: np.ndarray  # (n_material,) float64
    is_opaque: np.ndarray  # (n_material,) bool: also the texture is
    is_textured: np.ndarray  # (n_material,) bool
    least: float  # when no more is transmitted, what lies behind is left out


class Layer(NamedTuple):
    """The fragments of one layer in some rows of a band, and their light."""

    visibility: VisibilityBuffer
    first_row: int  # of the band, half-open
    end_row: int
    radiance: np.ndarray  # (n_channel, n) float32 or float64, linear; n = rows * pitch, and some before
    texels: np.ndarray  # (4, n) float64, of which the last is alpha; (0, n) where the scene has no textures
    shares: np.ndarray  # (pitch,) float64, scratch: how much of each sample of a row is seen


class Translucent(NamedTuple):
    """The samples of a band that nothing opaque is behind, but something transparent before."""

    opacity: np.ndarray  # (n_sample,) float64, numbered as in the A-buffer; 0 where a sample shows nothing
    columns: np.ndarray  # (n_row,) int64: the number of the sample in column 0 of a row
    left: np.ndarray  # (n_strip,) int64: they lie in the columns left..right of a strip
    right: np.ndarray  # (n_strip,) int64


def least_transmittance(bound) -> float:
    """Return what may still be transmitted where a sample is done; 0 where `bound`, the largest intensity, is infinite.

    The tolerance doesn't count: every layer before has used its own share of it.
    """
    return INVISIBLE if np.isfinite(bound) else 0.0


def make_layer(room, extents, rows, radiance, texels) -> Layer:
    """Return a layer with room for some rows of a band; no more columns than transparent surfaces cover.

    Parameters
    ----------
    room : Room
    extents : VisibilityBuffer, of which only the extents and the materials are read
    rows : Rows of the band, the first one the first of a strip
    radiance, texels : those of the band, for their types
    """
    strips = slice(rows.y_start >> STRIP_SHIFT, ((rows.y_end - 1) >> STRIP_SHIFT) + 1)
    left, right = extents.left[strips].copy(), extents.right[strips].copy()
    first = min(int(left.min()), max(int(right.max()), 0))
    pitch = (max(int(right.max()) - first, 0) + PADDING + 7) // 8 * 8
    # Entries are found by row · pitch + column: those before the first column are never touched.
    n = first + (rows.y_end - rows.y_start) * pitch
    visibility = VisibilityBuffer(
        room.array("entries", (n,)), pitch, extents.width, left, right, extents.materials[strips],
        extents.other_left[strips], extents.other_right[strips],
    )  # fmt: skip
    return Layer(
        visibility, rows.y_start, rows.y_end, room.array("radiance", (len(radiance), n), radiance.dtype),
        room.array("texels", (len(texels), n), texels.dtype), room.array("shares", (pitch,), np.float64),
    )  # fmt: skip


@kernel
def show_layer(number, layer, lists, transmittance, least):
    """Make fragment `number` of each list the layer that is shaded, of samples that aren't done; return whether there
    is any.

    Parameters
    ----------
    layer : Layer, whose extents are narrowed; samples that are not in `lists` show nothing
    lists : FragmentLists, with a fragment at least
    transmittance : (n_sample,) float64
    least : see Opacity
    """
    visibility, is_any = layer.visibility, False
    for strip in range(index(len(visibility.left))):
        left, right = visibility.left[strip], visibility.right[strip]
        next_left, next_right = NO_START, NO_END
        first_row = layer.first_row + np.int64(strip << index(STRIP_SHIFT))
        for row in range(first_row, min(first_row + (1 << STRIP_SHIFT), layer.end_row)):
            start = index((row - layer.first_row) * visibility.pitch + left)
            entries = visibility.entries[start : start + index(max(right - left, 0))]
            if left < right:
                for k in range(start + index(right - left), start + index(right - left + PLANE_GROUP)):
                    visibility.entries[k] = CLEAR  # planes are evaluated for some samples more
            show_row(entries, lists.columns[index(row)] + left, number, lists, transmittance, least)
            first, end = shown_extent(entries)
            next_left = min(next_left, left + first if first < end else NO_START)
            next_right = max(next_right, left + end if first < end else NO_END)
        visibility.left[strip], visibility.right[strip] = next_left, next_right
        is_any |= next_left < next_right
    return is_any


@helper
def show_row(entries, first_sample, number, lists, transmittance, least):
    """Fill the entries of a row with fragment `number` of each list; CLEAR where there is none, or none is seen."""
    n = np.int64(len(entries))
    first, end = max(lists.first - first_sample, 0), min(lists.end - first_sample, n)
    for k in range(index(0), index(min(max(first, 0), n))):
        entries[k] = CLEAR
    for k in range(index(max(end, 0)), index(n)):
        entries[k] = CLEAR
    if first >= end:
        return
    start, n = index(first_sample + first), index(end - first)
    out, fragments, skipped = entries[index(first) : index(end)], lists.entries, number - lists.base
    starts, ends = lists.starts[start : start + n], lists.starts[start + index(1) : start + index(1) + n]
    arriving = transmittance[start : start + n]
    for k in range(n):
        fragment = starts[k] + skipped
        is_shown = (fragment < ends[k] - lists.base) & (arriving[k] > least)
        entry = fragments[index(fragment if is_shown else np.int64(0))]
        out[k] = entry if is_shown else CLEAR


@helper
def shown_extent(entries):
    """Return the first entry that shows something, and where the last one ends; n and 0 where none does."""
    n = np.int64(len(entries))
    first, end = np.int64(0), n
    while first < n and entries[index(first)] >= CLEAR:
        first += 1
    while end > first and entries[index(end - 1)] >= CLEAR:
        end -= 1
    return first, end


@kernel
def composite(layer, records, a_buffer, opacity):
    """Put a layer, which is shaded, behind those before.

    Parameters
    ----------
    layer : Layer
    records : Records of what it shows
    a_buffer : ABuffer, of which transmittance, opacity and color are changed
    opacity : Opacity
    """
    visibility, n_channel = layer.visibility, index(len(a_buffer.color))
    for row in range(layer.first_row, layer.end_row):
        strip = strip_of(row - layer.first_row)
        left, right = visibility.left[strip], visibility.right[strip]
        if left >= right:
            continue
        start, n = index((row - layer.first_row) * visibility.pitch + left), index(right - left)
        sample = index(a_buffer.columns[index(row)] + left)
        fill_alphas(layer, strip, start, left, right, records, opacity)
        transmit(layer.shares[:n], a_buffer.transmittance[sample : sample + n], a_buffer.opacity[sample : sample + n])
        for channel in range(n_channel):
            color, radiance = a_buffer.color[channel, sample : sample + n], layer.radiance[channel, start : start + n]
            for k in range(n):
                color[k] += layer.shares[k] * radiance[k] if layer.shares[k] > 0.0 else 0.0


@helper
def fill_alphas(layer, strip, start, left, right, records, opacity):
    """Fill the shares with the opacities of the fragments in columns left..right of a row; 0 where there is none.

    `start` is the row's entry in column `left`.
    """
    visibility, alphas, first = layer.visibility, layer.shares, left
    while first < right:
        end, material = stretch_of(visibility, strip, first, right, np.int64(-1))
        k, n = index(first - left), index(end - first)
        entries, out = visibility.entries[start + k : start + k + n], alphas[k : k + n]
        if material >= 0:
            alpha = opacity.opacity[material]
            for i in range(n):
                out[i] = alpha if entries[i] < CLEAR else 0.0
            if opacity.is_textured[material]:
                for i in range(n):
                    out[i] *= layer.texels[3, start + k + i] if entries[i] < CLEAR else 0.0
        else:
            fill_alphas_of_many(entries, records, layer.texels, start + k, opacity, out)
        first = end


@helper
def fill_alphas_of_many(entries, records, texels, start, opacity, out):
    """Fill the opacities of a row's fragments, which may be of any materials."""
    is_textured = False
    last_record, last_alpha = index(MAX_RECORDS), 0.0  # neighbours often show the same triangle
    for k in range(index(len(entries))):
        if entries[k] >= CLEAR:
            out[k] = 0.0
            continue
        record = record_of(entries[k])
        if record != last_record:
            material = material_of(entries[k], records)
            last_record, last_alpha = record, opacity.opacity[material]
            is_textured = opacity.is_textured[material]
        out[k] = last_alpha * texels[3, start + k] if is_textured else last_alpha


@helper
def transmit(shares, transmittance, opacity):
    """Turn opacities of fragments into shares of the light that arrives, and sum up what comes of it."""
    for k in range(index(len(shares))):
        alpha, arriving = shares[k], transmittance[k]
        share = arriving * alpha
        opacity[k] = 1.0 if alpha == 1.0 else min(opacity[k] + share, 1.0)
        transmittance[k] = arriving * (1.0 - alpha)
        shares[k] = share


# ---------------------------------------------------------------- what is behind


@kernel
def put_behind(first_row, end_row, visibility, lists, a_buffer, radiance, translucent):
    """Put the opaque surfaces behind all layers; return whether any sample has none.

    Parameters
    ----------
    first_row, end_row : rows of the band
    visibility : VisibilityBuffer of the opaque surfaces; its extents are widened to the samples that have none
    lists : FragmentLists, of which only the range is read
    radiance : (n_channel, n_row * pitch) float32 or float64, that of the opaque surfaces; changed where layers are seen
    translucent : Translucent, whose extents are widened
    """
    is_any = False
    for row in range(first_row, end_row):
        column, first_sample, end_sample = a_buffer.columns[index(row)], lists.first, lists.end
        first_sample = max(first_sample, a_buffer.first_samples[index(row)])
        end_sample = min(end_sample, a_buffer.first_samples[index(row + 1)])
        if first_sample >= end_sample:
            continue
        sample, n, left = index(first_sample), index(end_sample - first_sample), first_sample - column
        start, end = index(row * visibility.pitch + left), index(row * visibility.pitch + left) + n
        entries, opacity = visibility.entries[start:end], a_buffer.opacity[sample : sample + n]
        transmittance = a_buffer.transmittance[sample : sample + n]
        for channel in range(index(len(radiance))):
            color = a_buffer.color[channel, sample : sample + n]
            merge_behind(entries, opacity, transmittance, color, radiance[channel, start:end])
        first, end = translucent_extent(entries, opacity)
        if first < end:
            widen_extent(visibility, strip_of(row), left + first, left + end)
            widen_extent(translucent, strip_of(row), left + first, left + end)
            is_any = True
    return is_any


@helper
def merge_behind(entries, opacity, transmittance, color, radiance):
    """Merge a channel of the layers of a row with that of the opaque surfaces; samples without layers stay as they
    are."""
    zero = radiance.dtype.type(0)
    for k in range(index(len(entries))):
        is_opaque = entries[k] < CLEAR
        behind = radiance[k] if is_opaque else zero
        seen = color[k] + transmittance[k] * behind if is_opaque else color[k] * (1.0 / opacity[k])
        radiance[k] = seen if opacity[k] > 0.0 else radiance[k]


@helper
def translucent_extent(entries, opacity):
    """Return the first sample of a row that shows something transparent and nothing opaque, and where the last one
    ends; first >= end where there is none."""
    n = np.int64(len(entries))
    first, end = np.int64(0), n
    while first < n and (entries[index(first)] < CLEAR or opacity[index(first)] == 0.0):
        first += 1
    while end > first and (entries[index(end - 1)] < CLEAR or opacity[index(end - 1)] == 0.0):
        end -= 1
    return first, end
