"""Layers: what is seen through transparent surfaces, for scenes that have any. It takes the place of the scan stage's
one pass.

In:  the band's list of triangles, which of them are opaque.
Out: every sample's colour, weighted by its opacity, and its opacity: all surfaces that are seen there, nearest first,
up to the
     first opaque one.

First the opaque surfaces are drawn. Then every sample gets a list of the words of all transparent surfaces before that
(Carpenter 1984, "The A-buffer"): their numbers are counted, room is divided, the lists are filled and sorted. Words
hold depth above the triangle's number, so they order all surfaces at a sample, whatever their order in the file: at
equal depth the lower number lies in front, as everywhere. The lists of a range of samples are worked on at a time, so
that a thread needs no more than MOST_FRAGMENTS words; then one layer after the other is shaded:

    color += transmitted · a · c      opacity += transmitted · a      transmitted *= 1 - a      (Porter & Duff 1984, `over`)

A surface of opacity 0 is not there. A sample is done when its opaque surface is drawn, or when t, what is still
transmitted, is so small that what lies behind can't be seen. It could add r <= a·B to the weighted colour s and a <= t
to the opacity o = 1 - t, B being the largest intensity. Both s/o and r/a are at most B, so the colour s/o is off by

    |(s + r)/(o + a) - s/o| = |r/a - s/o| · a/(o + a) <= B·t/(1 - t) <= 2 B t     for t <= 1/2,

and the opacity by t. `Opacity.least` says which t that is.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import borrow, helper, kernel
from .records import FACE, IS_EXACT, IS_ID, RECORD_MASK, borrow_records, write_exact
from .scan import CLEAR, GROUP_SHIFT, Canvas, depths_of, fill, fill_spans, note_extent, plane_of, triangle_of
from .setup import (
    BLOCK,
    BOTTOM,
    IS_SLIVER,
    LEFT,
    RIGHT,
    TOP,
    Block,
    borrow_polygons,
    gather_attributes,
    gather_vertices,
    order_vertices,
    set_up_boxes,
    set_up_depths,
)
from .transform import Vertices

MOST_FRAGMENTS = 2**22  # words of lists that a thread works on at a time: 32 MB; more where a sample alone has more
FEW = 32  # lists that are longer on the average are filled in the order of depth, so that little is left to sort
PATIENCE = 8  # steps a fragment that a list may cost before it is sorted in another way
INVISIBLE = (
    2.0**-26
)  # transmitted: float32 shows no opacity from there to 1, and a colour is off by a 2^-25th of the brightest
INVISIBLE_ALPHA = 2.0**-12  # transmitted: a sixteenth of a level of the alpha byte


class Layers(NamedTuple):
    """What is kept of a band, a value a sample; nothing where the scene is opaque. The first four are of the range of
    samples that is worked on, in rows counted from its first."""

    words: np.ndarray  # (rows * pitch,) int64: the layer that is shaded
    left: np.ndarray  # (groups,) int64: samples left..right of a group of 8 rows may show something there
    right: np.ndarray  # (groups,) int64
    cursor: np.ndarray  # (rows * pitch,) int64: the length of each sample's list, then where its next word goes
    start: np.ndarray  # (rows * pitch + 1,) int64: where each sample's list begins, were all kept at a time
    transmitted: np.ndarray  # (rows * pitch,) float64: the part of the light from behind that arrives
    opacity: np.ndarray  # (rows * pitch,) float64: summed up, because 1 - transmitted loses the digits of small ones
    color: np.ndarray  # (n_channel, rows * pitch) float64; anything where the opacity is 0


class Fragments(NamedTuple):
    """The lists of a range of samples."""

    first: int  # samples first..last of the band
    last: int
    words: np.ndarray  # one list behind the other
    cursor: np.ndarray  # see Layers
    start: np.ndarray
    is_counting: bool  # how long the lists are to be, before there is room for them


class Opacity(NamedTuple):
    """How transparent the materials are."""

    opacity: np.ndarray  # (n_material,) float64
    is_opaque: np.ndarray  # (n_material,) bool: also the texture is
    least: float  # when no more is transmitted, what lies behind is left out


def make_layers(n_sample, n_group, n_channel) -> Layers:
    """Room for a band."""
    whole, real = (lambda n: np.zeros(n, np.int64)), (lambda *n: np.zeros(n))
    return Layers(
        whole(n_sample), whole(n_group), whole(n_group), whole(n_sample), whole(n_sample + 1), real(n_sample), real(n_sample),
        real(n_channel, n_sample),
    )  # fmt: skip


def least_transmitted(tolerance, bound, is_single) -> float:
    """What may still be transmitted where a sample is done, so that colours are off by at most half of the tolerance in
    float32, of which lighting has the other half, and by a 2^-25th of `bound`, the largest intensity, in float64; 0 if
    that is infinite.
    """
    if not np.isfinite(bound):
        return 0.0
    return min(tolerance / (4.0 * max(bound, 1.0)), INVISIBLE_ALPHA) if is_single else INVISIBLE


def in_order_of_depth(places, faces, polygons, vertices) -> np.ndarray:
    """The places ordered by the least depth of their triangles."""
    return places[np.argsort(vertices.z[polygons.vertex[:, faces[places]]].min(axis=0), kind="stable")]


def ranges_of(start, pitch):
    """Divide the samples of a band into ranges (first, last) whose lists have MOST_FRAGMENTS words at most, but at
    least a sample each; whole rows where possible. Samples behind the last list belong to the last range."""
    first, n_sample = 0, len(start) - 1
    while first < n_sample:
        last = int(np.searchsorted(start, start[first] + MOST_FRAGMENTS, side="right")) - 1
        whole_rows = last // pitch * pitch
        last = max(whole_rows if whole_rows > first else last, first + 1)
        yield first, last
        first = last


@kernel
def scan_opaque(
    faces,
    polygons,
    vertices,
    attributes,
    coding,
    y_start,
    y_stop,
    block,
    canvas,
    records,
    opacity,
    material,
    out_places,
):
    """Write an exact record for every triangle, its number the place in the list; draw those that are opaque.

    `out_places` gets the places, int64, of those that are neither opaque nor invisible; return how many.
    """
    faces, attributes, records = borrow(faces), borrow(attributes), borrow_records(records)
    vertices, polygons, canvas, block = borrow_all(vertices, polygons, canvas, block)
    n_place = np.uint64(0)
    for first in range(0, len(faces), BLOCK):
        some = faces[np.uint64(first) : np.uint64(min(first + BLOCK, len(faces)))]
        gather_vertices(some, polygons, vertices, block)
        order_vertices(block)
        gather_attributes(len(some), attributes, block)
        set_up_boxes(y_start, y_stop, canvas.width, block)
        set_up_depths(block)
        for k in range(np.uint64(len(some))):
            write_exact(records, first + np.int64(k), k, some[k], attributes.shape[2], coding, block)
            left, right, top, bottom = box_of(k, block)
            look = material_of(some[k], material)
            out_places[n_place] = first + np.int64(k)
            n_place += np.uint64(not opacity.is_opaque[look] and opacity.opacity[look] > 0.0)
            if left < right and top < bottom and opacity.is_opaque[look]:
                note_extent(canvas, left, right, top - y_start, bottom - y_start)
                payload = (IS_ID | IS_EXACT | (first + np.int64(k)), np.int64(0), np.int64(0))
                fill(canvas, (left, right, top, bottom, (top - y_start) * canvas.pitch), k, payload, block)
    return n_place


@kernel
def take_fragments(faces, places, polygons, vertices, y_start, row_start, row_stop, block, canvas, fragments):
    """Count or take the words of the transparent triangles faces[places] in the rows row_start..row_stop of the band,
    where they lie before the opaque surfaces in the canvas."""
    faces, places = borrow(faces), borrow(places)
    vertices, polygons, canvas, block = borrow_all(vertices, polygons, canvas, block)
    fragments = Fragments(
        fragments.first, fragments.last, borrow(fragments.words), borrow(fragments.cursor), borrow(fragments.start),
        fragments.is_counting,
    )  # fmt: skip
    some = np.empty(BLOCK, faces.dtype)
    for first in range(0, len(places), BLOCK):
        n = np.uint64(min(len(places) - first, BLOCK))
        for k in range(n):
            some[k] = faces[np.uint64(places[np.uint64(first) + k])]
        gather_vertices(some[:n], polygons, vertices, block)
        order_vertices(block)
        set_up_boxes(y_start + row_start, y_start + row_stop, canvas.width, block)
        set_up_depths(block)
        for k in range(n):
            left, right, top, bottom = box_of(k, block)
            if left < right and top < bottom:
                if fragments.is_counting:
                    note_extent(canvas, left, right, top - y_start, bottom - y_start)
                box = (left, right, top, bottom, (top - y_start) * canvas.pitch)
                payload = (IS_ID | IS_EXACT | places[np.uint64(first) + k], np.int64(0), np.int64(0))
                plane, is_sliver = plane_of(k, payload, block), block.ints[IS_SLIVER + k] != 0
                fill_spans(
                    canvas, box, triangle_of(k, block), plane, is_sliver, depths_of(k, block), payload[0], fragments
                )


@helper
def borrow_all(vertices, polygons, canvas, block):
    """The arrays of these, without counted references."""
    return (
        Vertices(borrow(vertices.x), borrow(vertices.y), borrow(vertices.z)),
        borrow_polygons(polygons),
        Canvas(borrow(canvas.words), canvas.pitch, canvas.width, borrow(canvas.left), borrow(canvas.right)),
        Block(borrow(block.ints), borrow(block.longs), borrow(block.reals)),
    )


@helper
def box_of(k, block):
    """The box of triangle k of the block, clipped to the band."""
    return (
        np.int64(block.ints[LEFT + k]), np.int64(block.ints[RIGHT + k]),
        np.int64(block.ints[TOP + k]), np.int64(block.ints[BOTTOM + k]),
    )  # fmt: skip


@helper
def material_of(face, material):
    """The material of a triangle; `material` is empty where there is one."""
    return material[face] if len(material) > 0 else np.uint32(0)


@kernel
def open_layers(layers):
    """Begin with empty lists, and with nothing shown; the rest of a sample is written with its first layer."""
    cursor, opacity = borrow(layers.cursor), borrow(layers.opacity)
    for k in range(np.uint64(len(cursor))):
        cursor[k], opacity[k] = 0, 0.0


@kernel
def divide_room(layers, n_sample):
    """Turn the lengths of the lists into where they begin; return how many words there are, and how many lists."""
    cursor, start = borrow(layers.cursor), borrow(layers.start)
    total = n_list = np.int64(0)
    for k in range(np.uint64(n_sample)):
        n = cursor[k]
        start[k], cursor[k] = total, total
        total += n
        n_list += n > 0
    start[np.uint64(n_sample)] = total
    return total, n_list


@kernel
def show_first(canvas, layers, fragments, first_row, n_row):
    """Sort the lists of a range of samples in the rows first_row..first_row + n_row of the band; show the first
    layer."""
    opaque, words = borrow(canvas.words), borrow(layers.words)
    list_words, start = borrow(fragments.words), borrow(fragments.start)
    base = start[np.uint64(fragments.first)]
    for group in range(np.uint64(len(layers.left))):
        layers.left[group], layers.right[group] = np.int64(1 << 30), np.int64(-1)
    for j in range(n_row):
        group, band_group = np.uint64(j) >> np.uint64(GROUP_SHIFT), np.uint64(first_row + j) >> np.uint64(GROUP_SHIFT)
        layers.left[group] = min(layers.left[group], canvas.left[band_group])
        layers.right[group] = max(layers.right[group], canvas.right[band_group])
    for j in range(n_row):
        group, row, band_row = np.uint64(j) >> np.uint64(GROUP_SHIFT), j * canvas.pitch, (first_row + j) * canvas.pitch
        for i in range(layers.left[group], layers.right[group]):
            k, word = np.uint64(band_row + i), CLEAR
            if fragments.first <= band_row + i < fragments.last:
                begin, end = np.uint64(start[k] - base), np.uint64(start[k + np.uint64(1)] - base)
                if end - begin > np.uint64(1):
                    sort(list_words[begin:end])
                word = list_words[begin] if begin < end else opaque[k]
            words[np.uint64(row + i)] = word


@kernel
def composite(canvas, records, layers, fragments, first_row, n_row, depth, radiance, texels, opacity, material):
    """Put the layer number `depth`, which is shaded, behind those before; show the next one; return whether there is
    any."""
    opaque, words = borrow(canvas.words), borrow(layers.words)
    list_words, start = borrow(fragments.words), borrow(fragments.start)
    records, material, radiance, texels = borrow_records(records), borrow(material), borrow(radiance), borrow(texels)
    transmitted, out_opacity, color = borrow(layers.transmitted), borrow(layers.opacity), borrow(layers.color)
    base = start[np.uint64(fragments.first)]
    is_more, last_record, last_alpha = False, np.uint64(RECORD_MASK + 1), 0.0  # neighbours often show the same triangle
    for first in range(0, n_row, 1 << GROUP_SHIFT):
        group = np.uint64(first) >> np.uint64(GROUP_SHIFT)
        left, right = layers.left[group], layers.right[group]
        next_left, next_right = np.int64(1 << 30), np.int64(-1)
        for j in range(first, min(first + (1 << GROUP_SHIFT), n_row)):
            for i in range(left, right):
                k, place = np.uint64(j * canvas.pitch + i), np.uint64((first_row + j) * canvas.pitch + i)
                word = words[k]
                if word >= CLEAR:
                    continue
                alpha = 1.0
                if word != opaque[place]:
                    record = np.uint64(word & RECORD_MASK)
                    if record != last_record:
                        face = np.uint64(records.integers[record, np.uint64(FACE)])
                        last_record, last_alpha = record, opacity.opacity[material_of(face, material)]
                    alpha = last_alpha
                    if texels.shape[0] > 0:
                        alpha *= texels[3, k]
                before = transmitted[place] if depth > 0 else 1.0
                share, after = before * alpha, before * (1.0 - alpha)
                for channel in range(np.uint64(color.shape[0])):
                    so_far = color[channel, place] if depth > 0 else 0.0
                    color[channel, place] = so_far + share * radiance[channel, k]
                transmitted[place] = after
                out_opacity[place] = 1.0 if alpha == 1.0 else min(out_opacity[place] + share, 1.0)
                begin, end, word = start[place] - base, start[place + np.uint64(1)] - base, CLEAR
                if begin + depth < end and after > opacity.least:
                    word = list_words[np.uint64(begin + depth + 1)] if begin + depth + 1 < end else opaque[place]
                words[k] = word
                if word < CLEAR:
                    next_left, next_right, is_more = min(next_left, i), max(next_right, i + 1), True
        layers.left[group], layers.right[group] = next_left, next_right
    return is_more


@helper
def sort(words):
    """Sort a list: by insertion, which is fastest for short ones and for those that are nearly sorted, else as a heap
    (Williams
    1964)."""
    n, patience = np.int64(len(words)), PATIENCE * np.int64(len(words)) + 64
    for k in range(1, n):
        word, i = words[np.uint64(k)], k
        while i > 0 and words[np.uint64(i - 1)] > word:
            words[np.uint64(i)] = words[np.uint64(i - 1)]
            i -= 1
        words[np.uint64(i)] = word
        patience -= k - i
        if patience < 0:
            break
    if patience >= 0:
        return
    for k in range(n // 2 - 1, -1, -1):
        sift(words, k, n)
    for k in range(n - 1, 0, -1):
        words[np.uint64(0)], words[np.uint64(k)] = words[np.uint64(k)], words[np.uint64(0)]
        sift(words, np.int64(0), k)


@helper
def sift(words, k, n):
    """Let a word sink until both words below it in the heap of n words are smaller."""
    word = words[np.uint64(k)]
    while 2 * k + 1 < n:
        child = 2 * k + 1
        if child + 1 < n and words[np.uint64(child + 1)] > words[np.uint64(child)]:
            child += 1
        if words[np.uint64(child)] <= word:
            break
        words[np.uint64(k)] = words[np.uint64(child)]
        k = child
    words[np.uint64(k)] = word
