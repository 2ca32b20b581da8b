"""The A-buffer: what is seen through transparent surfaces, for scenes that have any. It takes the place of the scan
stage's one pass.

In:  the band's transparent triangles, which the scan stage has left, and its opaque surfaces, which it has drawn.
Out: every sample's colour, weighted by its opacity, and its opacity: all surfaces that are seen there, nearest first,
     up to the first opaque one.

First the opaque surfaces are drawn, and the transparent ones noted (scan.py). Then every sample gets a list of
fragments, the entries of all transparent surfaces before that (Carpenter 1984, "The A-buffer, an antialiased hidden
surface method"): they are counted, room is divided, the lists are filled and sorted. Entries hold depth above the
index of the triangle's record, so they order all surfaces at a sample, whatever their order in the file: at equal depth
the lower index lies in front, as everywhere. The lists of a range of samples are worked on at a time, so that a thread
needs no more than MOST_FRAGMENTS entries. Then one layer after the other is shaded, the k-th fragments of all samples,
and summed up (Porter & Duff 1984, `over`):

    color += transmittance · a · c      opacity += transmittance · a      transmittance *= 1 - a

    sample   0    1    2    3    4
    nearest  a1   -    a2   a2   b1     1st layer
             b1        a1   |    |      2nd layer          Lists stand one behind the other: those of sample k are
             |              b1          3rd layer          entries[starts[k]:starts[k + 1]].
    opaque   O    O    -    O    O

A surface of opacity 0 is not there. A sample is done when its opaque surface is drawn, or when t, what is still
transmitted, is so small that what lies behind can't be seen. It could add r <= a·B to the weighted colour s and a <= t
to the opacity o = 1 - t, B being the largest intensity. Both s/o and r/a are at most B, so the colour s/o is off by

    |(s + r)/(o + a) - s/o| = |r/a - s/o| · a/(o + a) <= B·t/(1 - t) <= 2 B t     for t <= 1/2,

and the opacity by t. `Opacity.least` says which t that is.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from . import setup as s
from .fill import fill_spans
from .records import material_of
from .scan import Deferred, Payload, box_of, surface_of
from .visibility import (
    CLEAR,
    MAX_RECORDS,
    NO_END,
    NO_START,
    STRIP_SHIFT,
    VisibilityBuffer,
    note_extent,
    record_of,
    strip_of,
)

MOST_FRAGMENTS = 2**22  # of all lists that a thread works on at a time: 32 MB; more where a sample alone has more
FEW = 32  # lists that are longer on the average are filled in the order of depth, so that little is left to sort
PATIENCE = 8  # steps a fragment that a list may cost before it is sorted in another way
# What is transmitted when no more is looked for: float32 shows no opacity from there to 1, and a colour is off by a
# 2^-25th of the brightest; or a sixteenth of a level of the alpha byte.
INVISIBLE = 2.0**-26
INVISIBLE_ALPHA = 2.0**-12


class ABuffer(NamedTuple):
    """What is kept of a band, a value a sample; nothing where the scene is opaque."""

    layer: VisibilityBuffer  # what is shaded: of the range of samples that is worked on, rows counted from its first
    cursors: np.ndarray  # (n_row * pitch,) int64: the length of each sample's list, then where its next entry goes
    starts: np.ndarray  # (n_row * pitch + 1,) int64: where each sample's list begins, were all kept at a time
    transmittance: np.ndarray  # (n_row * pitch,) float64: the part of the light from behind that arrives
    opacity: np.ndarray  # (n_row * pitch,) float64: summed up, because 1 - transmittance loses the digits of small ones
    color: np.ndarray  # (n_channel, n_row * pitch) float64; anything where the opacity is 0

    def of_channels(self, n_channel: int) -> "ABuffer":
        """Return the same with so many channels."""
        return self._replace(color=self.color[:n_channel])


class FragmentLists(NamedTuple):
    """The lists of a range of samples."""

    first: int  # samples first..last of the band
    last: int
    first_row: int  # the rows of the band that they reach, half-open, counted from its first
    end_row: int
    entries: np.ndarray  # (n_fragment,) int64, one list behind the other
    cursors: np.ndarray  # see ABuffer
    starts: np.ndarray
    is_counting: bool  # how long the lists are to be, before there is room for them


class Opacity(NamedTuple):
    """How transparent the materials are."""

    opacity: np.ndarray  # (n_material,) float64
    is_opaque: np.ndarray  # (n_material,) bool: also the texture is
    is_textured: np.ndarray  # (n_material,) bool
    least: float  # when no more is transmitted, what lies behind is left out


def make_a_buffer(visibility, n_channel, is_used) -> ABuffer:
    """Return the A-buffer of a band with this visibility buffer; without room where it isn't used."""
    n_sample = len(visibility.entries) if is_used else 0
    whole, real = (lambda n: np.zeros(n, np.int64)), (lambda *shape: np.zeros(shape))
    left, right = np.zeros_like(visibility.left), np.zeros_like(visibility.right)
    layer = visibility._replace(
        entries=whole(n_sample),
        left=left,
        right=right,
        other_left=left,
        other_right=right,  # any materials
    )
    return ABuffer(
        layer, whole(n_sample), whole(n_sample + 1), real(n_sample), real(n_sample), real(n_channel, n_sample)
    )


def least_transmittance(tolerance, bound, is_single) -> float:
    """Return what may still be transmitted where a sample is done.

    In float32 colours are off by at most half of the tolerance, of which lighting has the other half, and in float64 by
    a 2^-25th of `bound`, the largest intensity; 0 if that is infinite.
    """
    if not np.isfinite(bound):
        return 0.0
    return min(tolerance / (4.0 * max(bound, 1.0)), INVISIBLE_ALPHA) if is_single else INVISIBLE


def order_by_depth(transparent: Deferred, drawables) -> Deferred:
    """Order transparent triangles by the least depth of each."""
    z = drawables.vertices.z[drawables.triangles.vertex_idx[:, transparent.faces]]
    order = np.argsort(z.min(axis=0), kind="stable")
    return transparent._replace(faces=transparent.faces[order], payloads=transparent.payloads[order])


def split_samples(starts, pitch):
    """Divide the samples of a band into ranges (first, last) whose lists have MOST_FRAGMENTS fragments at most.

    But at least a sample each; whole rows where possible. Samples behind the last list belong to the last range.

    Parameters
    ----------
    starts : (n_sample + 1,) int64, where each sample's list begins
    """
    first, n_sample = 0, len(starts) - 1
    while first < n_sample:
        last = int(np.searchsorted(starts, starts[first] + MOST_FRAGMENTS, side="right")) - 1
        whole_rows = last // pitch * pitch
        last = max(whole_rows if whole_rows > first else last, first + 1)
        yield first, last
        first = last


# ---------------------------------------------------------------- lists of fragments


@kernel
def list_fragments(y_start, transparent, triangles, vertices, rows, block, visibility, lists):
    """Count or list the fragments of a band's transparent triangles that lie before the opaque surfaces.

    Parameters
    ----------
    y_start : the band's first row in the picture, samples
    transparent : Deferred, the triangles through which what is behind them is seen
    triangles, vertices : all of the picture
    rows : Rows of the picture, those of the band that are worked on
    visibility : VisibilityBuffer, the opaque surfaces; its extents are widened where fragments are counted
    lists : FragmentLists
    """
    faces, payloads = transparent.faces, transparent.payloads
    for first in range(0, len(faces), s.BLOCK):
        n = index(min(len(faces) - first, s.BLOCK))
        s.gather_vertices(faces[index(first) : index(first) + n], triangles, vertices, block)
        s.order_vertices(block)
        s.compute_boxes(rows, visibility.width, block)
        s.compute_depth_planes(block)
        for k in range(n):
            box = box_of(k, block)
            if box.left < box.right and box.top < box.bottom:
                if lists.is_counting:
                    note_extent(visibility, box.left, box.right, box.top - y_start, box.bottom - y_start)
                surface = surface_of(k, Payload(payloads[index(first) + k], np.int64(0), np.int64(0)), block)
                fill_spans(visibility, y_start, box, surface, lists)


@kernel
def open_lists(a_buffer):
    """Begin with empty lists, and with nothing shown; the rest of a sample is written with its first layer."""
    cursors, opacity = a_buffer.cursors, a_buffer.opacity
    for k in range(index(len(cursors))):
        cursors[k], opacity[k] = 0, 0.0


@kernel
def divide_room(a_buffer, n_sample):
    """Turn the lengths of the lists into where they begin; return how many fragments there are, and how many lists."""
    cursors, starts = a_buffer.cursors, a_buffer.starts
    total = n_list = np.int64(0)
    for k in range(index(n_sample)):
        n = cursors[k]
        starts[k], cursors[k] = total, total
        total += n
        n_list += n > 0
    starts[index(n_sample)] = total
    return total, n_list


# ---------------------------------------------------------------- layers


@kernel
def show_nearest(visibility, a_buffer, lists):
    """Sort the lists of a range of samples; make the nearest fragments the layer that is shaded.

    Parameters
    ----------
    visibility : VisibilityBuffer, the opaque surfaces
    lists : FragmentLists
    """
    layer = a_buffer.layer
    opaque, entries = visibility.entries, layer.entries
    fragments, starts = lists.entries, lists.starts
    base = starts[index(lists.first)]
    for strip in range(index(len(layer.left))):
        layer.left[strip], layer.right[strip] = NO_START, NO_END
    for row in range(lists.first_row, lists.end_row):
        strip, band_strip = strip_of(row - lists.first_row), strip_of(row)
        layer.left[strip] = min(layer.left[strip], visibility.left[band_strip])
        layer.right[strip] = max(layer.right[strip], visibility.right[band_strip])
    for row in range(lists.first_row, lists.end_row):
        strip, start = strip_of(row - lists.first_row), (row - lists.first_row) * visibility.pitch
        for x in range(layer.left[strip], layer.right[strip]):
            sample = row * visibility.pitch + x
            k, entry = index(sample), CLEAR
            if lists.first <= sample < lists.last:
                begin, end = index(starts[k] - base), index(starts[k + index(1)] - base)
                if end - begin > index(1):
                    sort(fragments[begin:end])
                entry = fragments[begin] if begin < end else opaque[k]
            entries[index(start + x)] = entry


@kernel
def composite(visibility, records, a_buffer, lists, depth, radiance, texels, opacity):
    """Put layer number `depth`, which is shaded, behind those before; show the next one; return whether there is any.

    Parameters
    ----------
    visibility : VisibilityBuffer, the opaque surfaces
    lists : FragmentLists
    radiance : (n_channel, n_row * pitch) of the layer
    texels : (4, n_row * pitch), of which the last is alpha; (0, n_row * pitch) where the scene has no textures
    opacity : Opacity
    """
    layer = a_buffer.layer
    opaque, entries = visibility.entries, layer.entries
    fragments, starts = lists.entries, lists.starts
    transmittance, opacities, color = a_buffer.transmittance, a_buffer.opacity, a_buffer.color
    base = starts[index(lists.first)]
    is_more, is_textured = False, False
    last_record, last_alpha = index(MAX_RECORDS), 0.0  # neighbours often show the same triangle
    n_row = lists.end_row - lists.first_row
    for first in range(0, n_row, 1 << STRIP_SHIFT):
        strip = strip_of(first)
        left, right = layer.left[strip], layer.right[strip]
        next_left, next_right = NO_START, NO_END
        for row in range(first, min(first + (1 << STRIP_SHIFT), n_row)):
            for x in range(left, right):
                k, sample = index(row * visibility.pitch + x), index((lists.first_row + row) * visibility.pitch + x)
                entry = entries[k]
                if entry >= CLEAR:
                    continue
                alpha = 1.0
                if entry != opaque[sample]:
                    record = record_of(entry)
                    if record != last_record:
                        material = material_of(entry, records)
                        last_record, last_alpha = record, opacity.opacity[material]
                        is_textured = opacity.is_textured[material]
                    alpha = last_alpha
                    if is_textured:
                        alpha *= texels[3, k]
                before = transmittance[sample] if depth > 0 else 1.0
                share, after = before * alpha, before * (1.0 - alpha)
                for channel in range(index(color.shape[0])):
                    so_far = color[channel, sample] if depth > 0 else 0.0
                    color[channel, sample] = so_far + share * radiance[channel, k]
                transmittance[sample] = after
                opacities[sample] = 1.0 if alpha == 1.0 else min(opacities[sample] + share, 1.0)
                begin, end, entry = starts[sample] - base, starts[sample + index(1)] - base, CLEAR
                if begin + depth < end and after > opacity.least:
                    entry = fragments[index(begin + depth + 1)] if begin + depth + 1 < end else opaque[sample]
                entries[k] = entry
                if entry < CLEAR:
                    next_left, next_right, is_more = min(next_left, x), max(next_right, x + 1), True
        layer.left[strip], layer.right[strip] = next_left, next_right
    return is_more


@helper
def sort(entries):
    """Sort a list: by insertion, which is fastest for short ones and for those that are nearly sorted, else as a heap.

    Source: Williams 1964, "Algorithm 232: Heapsort", CACM 7(6), 347-348.
    """
    n, patience = np.int64(len(entries)), PATIENCE * np.int64(len(entries)) + 64
    for k in range(1, n):
        entry, i = entries[index(k)], k
        while i > 0 and entries[index(i - 1)] > entry:
            entries[index(i)] = entries[index(i - 1)]
            i -= 1
        entries[index(i)] = entry
        patience -= k - i
        if patience < 0:
            break
    if patience >= 0:
        return
    for k in range(n // 2 - 1, -1, -1):
        sift(entries, k, n)
    for k in range(n - 1, 0, -1):
        entries[0], entries[k] = entries[k], entries[0]
        sift(entries, np.int64(0), k)


@helper
def sift(entries, k, n):
    """Let an entry sink until both below it in the heap of n entries are smaller."""
    entry = entries[k]
    while 2 * k + 1 < n:
        child = 2 * k + 1
        if child + 1 < n and entries[child + 1] > entries[child]:
            child += 1
        if entries[child] <= entry:
            break
        entries[k] = entries[child]
        k = child
    entries[k] = entry
