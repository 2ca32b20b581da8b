"""The visibility buffer of a band: a packed sample for every sample, which says how deep it is and what is visible
there.

A packed sample is depth and payload in one integer, so that one integer addition advances both along a span, and one
comparison decides visibility and writes both. (Burns & Hunt 2013, "The visibility buffer", JCGT 2(2), keep a triangle's
index for every sample, too, and shade later.)

    63        62 ............ 25   24     23 ............. 0
    sign (0)  z (38 bits)          is_id  intensity, or the index of a setup, (bit 1) is_weighted, (bit 0) is_exact

Where nothing is visible, the packed sample is CLEAR: behind every depth. Extents, the columns that may have been
written, are kept for strips of 8 rows: so nobody looks at the rest of a band, and whoever turns the band into output
clears no more than was written.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from .transform import DEPTH_BITS

INTENSITY_BITS = 24
PAYLOAD_BITS = INTENSITY_BITS + 1
IS_ID = np.int64(1 << INTENSITY_BITS)  # the payload is the index of a setup, not an intensity
# ... of an exact setup; of planes of intensities that a sample multiplies by its 1/r. These are the lowest bits, so
# that at equal depth packed samples are ordered by index.
IS_EXACT, IS_WEIGHTED = np.int64(1), np.int64(2)
SETUP_SHIFT = 2  # where the index begins
INTENSITY_MASK = np.int64(IS_ID - 1)
SETUP_MASK = np.int64(INTENSITY_MASK - IS_EXACT - IS_WEIGHTED)
MAX_SETUPS = 1 << (INTENSITY_BITS - SETUP_SHIFT)
DEPTH_MASK = np.int64(-(1 << PAYLOAD_BITS))
CLEAR = np.int64(((1 << DEPTH_BITS) - 1) << PAYLOAD_BITS)

GAP = 32  # packed samples in a row that are left out where none shows anything: extents have gaps between things

STRIP_SHIFT = 3  # log2 of the rows of a strip
NO_START, NO_END = np.int64(1 << 30), np.int64(-1)  # the extent of a strip in which nothing was written
LANES = 8  # samples that are merged side by side, of a small box, and whose planes are evaluated so
PADDING = 2 * LANES  # packed samples behind each row that lanes may read and write back


class VisibilityBuffer(NamedTuple):
    """The packed samples of one band, private to a thread and clear between bands."""

    packed: np.ndarray  # (n_row * pitch,) int64
    pitch: int  # packed samples from row to row
    width: int  # samples of a row
    left: np.ndarray  # (n_strip,) int64: columns left..right of a strip may have been written
    right: np.ndarray  # (n_strip,) int64
    # Where a picture has several materials:
    materials: np.ndarray  # (n_strip,) int64: the first one that was drawn in a strip, -1 before
    other_left: np.ndarray  # (n_strip,) int64: others may have been written in columns other_left..other_right
    other_right: np.ndarray  # (n_strip,) int64


def make_visibility_buffer(width, n_row) -> VisibilityBuffer:
    """Return a clear buffer for bands of `n_row` rows of `width` samples."""
    pitch = (width + PADDING + 7) // 8 * 8
    return make_extents(n_row)._replace(packed=np.full(n_row * pitch, CLEAR), pitch=pitch, width=width)


def make_extents(n_row) -> VisibilityBuffer:
    """Return the clear extents of a band of `n_row` rows: a buffer without room for packed samples."""
    n_strip = (n_row >> STRIP_SHIFT) + 1
    starts, ends = (np.full((2, n_strip), edge) for edge in (NO_START, NO_END))
    materials = np.full(n_strip, np.int64(-1))
    return VisibilityBuffer(np.empty(0, np.int64), 0, 0, starts[0], ends[0], materials, starts[1], ends[1])


@helper
def pack(z, payload):
    """Put z above the payload: a packed sample, or what a step adds to one; both int64, the result uint64.

    Unsigned, because products of a plane may overflow on the way: signed overflow is undefined.
    """
    return (np.uint64(np.int64(z)) << np.uint64(PAYLOAD_BITS)) + np.uint64(payload)


@helper
def id_payload(setup, flags):
    """Return what stands below the depth where a setup is visible: its index, and its flags: IS_EXACT, IS_WEIGHTED
    or 0."""
    return IS_ID | (np.int64(setup) << SETUP_SHIFT) | flags


@helper
def is_exact(packed):
    """Tell whether a packed sample holds the index of an exact setup."""
    return packed & (IS_ID | IS_EXACT) == IS_ID | IS_EXACT


@helper
def setup_of(packed):
    """Return the index of the setup that a packed sample shows; of other packed samples any index."""
    return (packed & SETUP_MASK) >> SETUP_SHIFT


@helper
def strip_of(row):
    """Return the strip of a row of the band."""
    return row >> STRIP_SHIFT


@helper
def note_extent(visibility, left, right, first_row, end_row):
    """Note that the columns left..right of the band's rows first_row..end_row are written."""
    first, last = strip_of(first_row), strip_of(end_row - 1)
    # The two ends without asking whether they differ: for small triangles that would be a coin toss.
    widen_extent(visibility, first, left, right)
    widen_extent(visibility, last, left, right)
    for strip in range(first + 1, last):
        widen_extent(visibility, strip, left, right)


@helper
def widen_extent(visibility, strip, left, right):
    """Note that columns left..right of a strip are written."""
    visibility.left[strip] = min(visibility.left[strip], left)
    visibility.right[strip] = max(visibility.right[strip], right)


@helper
def extent_of_pixels(extents, row, factor, width):
    """Return the columns of pixels that the extents of `factor` rows reach, half-open; where there are none, 0 and
    0."""
    left, right = np.int64(width), np.int64(0)
    for sub in range(row, row + factor):
        strip = strip_of(sub)
        left, right = min(left, extents.left[strip]), max(right, extents.right[strip])
    return (left // factor, (right + factor - 1) // factor) if left < right else (np.int64(0), np.int64(0))


@helper
def note_material(visibility, left, right, first_row, end_row, material):
    """Note that a material is drawn in the columns left..right of the band's rows first_row..end_row."""
    first, last = strip_of(first_row), strip_of(end_row - 1)
    # The two ends without asking whether they differ, see `note_extent`.
    note_in_strip(visibility, first, left, right, material)
    note_in_strip(visibility, last, left, right, material)
    for strip in range(first + 1, last):
        note_in_strip(visibility, strip, left, right, material)


@helper
def note_in_strip(visibility, strip, left, right, material):
    """Note that a material is drawn in columns left..right of a strip."""
    if visibility.materials[strip] != material:
        if visibility.materials[strip] < 0:
            visibility.materials[strip] = material
        else:
            visibility.other_left[strip] = min(visibility.other_left[strip], left)
            visibility.other_right[strip] = max(visibility.other_right[strip], right)


@helper
def stretch_of(visibility, strip, first, end, material):
    """Return how far, from column `first` to `end`, a row shows one material, and which; -1 where there may be several.

    `material` is that of the whole band, or -1.
    """
    if material >= 0:
        return end, material
    left, right = visibility.other_left[strip], visibility.other_right[strip]
    if left <= first < right:
        return min(end, right), np.int64(-1)
    return min(end, left) if first < left else end, visibility.materials[strip]


@helper
def next_stretch(packed):
    """Return how many of the first packed samples show nothing; or, where the first one shows something, how many there
    are up to a block of GAP that shows nothing, without those in front of it that show nothing, too. Tell which of
    both."""
    n, end, is_blank = len(packed), 0, packed[0] >= CLEAR
    if is_blank:
        while end + GAP <= n and shows_nothing(packed[end : end + GAP]):
            end += GAP
        while end < n and packed[end] >= CLEAR:
            end += 1
    else:
        while end < n and not shows_nothing(packed[end : end + GAP]):
            end = min(end + GAP, n)
        while packed[end - 1] >= CLEAR:
            end -= 1
    return np.int64(end), is_blank


@helper
def shows_nothing(packed):
    """Tell whether none of some packed samples shows anything; most blocks that do show something at one of their
    ends."""
    if packed[0] < CLEAR or packed[len(packed) - 1] < CLEAR:
        return False
    nearest = CLEAR
    for k in range(len(packed)):
        nearest = min(nearest, packed[k])
    return nearest >= CLEAR


@helper
def clear(visibility, n_row):
    """Clear the first `n_row` rows where they were written, padding included, and forget all extents; return how many
    samples were covered."""
    packed, n_covered = visibility.packed, 0
    for row in range(n_row):
        strip = strip_of(row)
        left, right = visibility.left[strip], visibility.right[strip]
        if left < right:
            start = row * visibility.pitch
            for k in range(start + left, start + right):
                n_covered += packed[k] < CLEAR
                packed[k] = CLEAR
            for k in range(start + right, start + right + PADDING):
                packed[k] = CLEAR
    forget(visibility)
    return n_covered


@helper
def forget(visibility):
    """Forget all extents and materials."""
    for strip in range(len(visibility.left)):
        visibility.left[strip], visibility.right[strip] = NO_START, NO_END
        visibility.other_left[strip], visibility.other_right[strip] = NO_START, NO_END
        visibility.materials[strip] = -1


@kernel
def forget_extents(visibility):
    """Forget all extents and materials of a VisibilityBuffer without packed samples."""
    forget(visibility)
