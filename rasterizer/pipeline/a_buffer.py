"""The A-buffer: lists of the transparent fragments of a band, and what is seen through them.

In:  the band's transparent triangles, which the scan stage has left, its opaque surfaces, which it has drawn, and the
     radiance of these.
Out: for every sample the packed samples of all transparent surfaces before the opaque one, nearest first (Carpenter
     1984, "The A-buffer, an antialiased hidden surface method"); then radiance with these surfaces in front; and of
     samples that nothing opaque is behind, the opacity.

Only samples in the extents of the transparent triangles have lists: `extents`, the columns left..right of each strip of
8 rows. Those samples are numbered row by row, without gaps:

    columns   left     right           The sample in column x of the band's row j has the number columns[j] + x; those
               |         |             of the row are numbers first_samples[j]..first_samples[j + 1]. What is kept for
    row j    . 0  1  2  3 .            samples, has room for as many as there are, and lists hold nothing opaque.
    row j+1  . 4  5  6  7 .

Every span of a transparent triangle appends its fragments to one array, each with the number of the one before at the
same sample (Yang et al. 2010, "Real-time concurrent linked list construction on the GPU", CGF 29(4), 1297-1304).
Kernels can't make arrays: one that has no room for the next triangle says so, and goes on in a larger one. Then the
lists are put one behind the other and sorted: that of sample k is packed[starts[k]:starts[k + 1]]. Packed samples hold
depth above the index of the triangle's setup, so they order all surfaces at a sample, whatever their order in the file:
at equal depth the lower index lies in front, as everywhere.

Then one layer after the other is shaded, the k-th fragments of all samples, and summed up (Porter & Duff 1984, `over`):

    color += transmittance · a · c      opacity += transmittance · a      transmittance *= 1 - a

    sample   0    1    2    3    4
    nearest  a1   -    a2   a2   b1     1st layer
             b1        a1   |    |      2nd layer
             |              b1          3rd layer
    opaque   O    O    -    O    O      shaded as in a band without transparent surfaces

Then what is opaque is put behind: color + transmittance · O. Where nothing is, the radiance is color/opacity, that of
the surfaces alone.

A surface of opacity 0 is not there. A sample is done when t, what is still transmitted, is so small that the fragments
behind can't be seen. They could change the light from behind, t·O or t·0, by no more than t·B, B being the largest
intensity. Where nothing opaque is behind, they could add r <= a·B to the weighted colour s and a <= t to the opacity
o = 1 - t. Both s/o and r/a are at most B, so the colour s/o is off by

    |(s + r)/(o + a) - s/o| = |r/a - s/o| · a/(o + a) <= B·t/(1 - t) <= 2 B t     for t <= 1/2,

and the opacity by t. `Opacity.min_transmittance` says which t that is.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from ..errors import SceneError
from ..geometry.normals import sort
from . import setup as s
from .scan import Deferred, Payload, box_of, fill_spans, surface_of
from .triangle_setups import material_of
from .visibility import (
    CLEAR,
    LANES,
    MAX_SETUPS,
    NO_END,
    NO_START,
    PADDING,
    STRIP_SHIFT,
    VisibilityBuffer,
    setup_of,
    strip_of,
    widen_extent,
)

MAX_FRAGMENTS = 2**26  # of a band: more are refused; 20 bytes each


class Room:
    """A thread's memory for fragments, which grows to the most that a band had: new memory takes as long as sorting."""

    def __init__(self):
        self.before, self.packed, self.sorted = (np.empty(0, dtype) for dtype in (np.int32, np.int64, np.int64))

    def grow(self, n: int) -> None:
        """Make room for `n` fragments; those that there are stay."""
        before, packed, n_kept = self.before, self.packed, len(self.before)
        if n_kept < n:
            self.before, self.packed, self.sorted = (np.empty(n, each.dtype) for each in (before, packed, packed))
            self.before[:n_kept], self.packed[:n_kept] = before, packed


class ABuffer(NamedTuple):
    """What is kept of the samples of a band that transparent surfaces may cover."""

    columns: np.ndarray  # (n_row,) int64: see above
    first_samples: np.ndarray  # (n_row + 1,) int64
    starts: np.ndarray  # (n_sample + 1,) int64: where each sample's list begins, and the last one ends
    transmittance: np.ndarray  # (n_sample,) float64: the part of the light from behind that arrives
    opacity: np.ndarray  # (n_sample,) float64: summed up, because 1 - transmittance loses the digits of small ones
    color: np.ndarray  # (n_channel, n_sample) float64: what the layers show, weighted by their opacity


class Fragments(NamedTuple):
    """What a band's transparent triangles show before the opaque surfaces: linked lists."""

    columns: np.ndarray  # see ABuffer
    last: np.ndarray  # (n_sample,) int32: the last fragment of each sample; -1 for none
    before: np.ndarray  # (n,) int32: of each fragment the one before at its sample; -1 for none
    packed: np.ndarray  # (n,) int64
    # (2,) int64: how many there are; not 0 if one is as deep as an opaque surface whose index isn't known
    found: np.ndarray


def make_a_buffer(extents, n_row, n_channel) -> ABuffer:
    """Return the A-buffer of a band: nothing is listed, and nothing is shown.

    Parameters
    ----------
    extents : VisibilityBuffer, of which only the extents are read
    """
    columns, first_samples = np.empty(n_row, np.int64), np.empty(n_row + 1, np.int64)
    n = number_samples(extents, columns, first_samples)
    return ABuffer(columns, first_samples, np.empty(n + 1, np.int64), np.ones(n), np.zeros(n), np.zeros((n_channel, n)))


def gather_fragments(
    band, transparent: Deferred, drawables, block, visibility, a_buffer: ABuffer, room: Room, most=MAX_FRAGMENTS
) -> Fragments:
    """List the fragments of a band's transparent triangles that lie before the opaque surfaces, in any order.

    Parameters
    ----------
    band : Band
    transparent : Deferred, the triangles through which what is behind them is seen
    drawables : Drawables, all of the picture
    block : Block, scratch
    visibility : VisibilityBuffer, the opaque surfaces
    room : for the fragments
    most : how many there may be, roughly

    Raises SceneError where there are more.
    """
    # From the furthest to the nearest by one of their corners: so little is left to sort.
    order = np.argsort(-drawables.vertices.z[drawables.triangles.vertex_idx[0, transparent.faces]])
    transparent = transparent._replace(faces=transparent.faces[order], payloads=transparent.payloads[order])
    n, first, rest = len(a_buffer.transmittance), 0, (drawables, block, visibility)
    room.grow(n)
    last, found = np.full(n, -1, np.int32), np.zeros(2, np.int64)
    fragments = Fragments(a_buffer.columns, last, room.before, room.packed, found)
    while (first := list_fragments(band, transparent, first, *rest, fragments)) < len(transparent.faces):
        # A triangle covers no more than all samples: twice the room is enough for the next one.
        n = 2 * len(room.packed)
        if n > most:
            raise SceneError(
                f"transparent surfaces cover more than {most} samples in {band.n_row} rows, too many to sort: make "
                "some of them opaque, or leave them out"
            )
        room.grow(n)
        fragments = fragments._replace(before=room.before, packed=room.packed)
    return fragments


# ---------------------------------------------------------------- lists


@kernel
def number_samples(extents, out_columns, out_first_samples):
    """Number the samples in the extents of a band; return how many there are.

    Parameters
    ----------
    extents : VisibilityBuffer, of which only the extents are read
    out_columns : (n_row,) int64, see ABuffer
    out_first_samples : (n_row + 1,) int64
    """
    n_sample = 0
    for row in range(len(out_columns)):
        left, right = extents.left[strip_of(row)], extents.right[strip_of(row)]
        out_columns[row], out_first_samples[row] = n_sample - left, n_sample
        n_sample += max(right - left, 0)
    out_first_samples[len(out_columns)] = n_sample
    return n_sample


@kernel
def list_fragments(band, transparent, start, drawables, block, visibility, fragments):
    """Append the fragments of the triangles from number `start` on, as far as there is room; return which comes next.

    Parameters
    ----------
    fragments : Fragments, changed; see `gather_fragments` for the others
    """
    faces, payloads, found = transparent.faces, transparent.payloads, fragments.found
    for first in range(start, len(faces), s.BLOCK):
        n = min(len(faces) - first, s.BLOCK)
        s.gather_vertices(faces[first : first + n], drawables.triangles, drawables.vertices, block)
        s.order_vertices(drawables.vertices.pixel, block)
        s.compute_boxes(band, visibility.width, block)
        s.compute_depth_planes(block)
        for k in range(n):
            box = box_of(k, block)
            if box.left < box.right and box.top < box.bottom:
                if found[0] + (box.right - box.left) * (box.bottom - box.top) > len(fragments.packed):
                    return first + k
                surface = surface_of(k, Payload(payloads[first + k], 0, 0), block)
                fill_spans(visibility, band.y_start, box, surface, fragments, None)
    return len(faces)


@kernel
def sort_fragments(fragments, starts, out_packed):
    """Put the lists of all samples one behind the other, and sort each, nearest first.

    Parameters
    ----------
    fragments : Fragments
    starts : (n_sample + 1,) int64, written: see ABuffer
    out_packed : (n,) int64, written; as many as `found` says
    """
    n = 0
    for sample in range(len(fragments.last)):
        starts[sample] = n
        fragment = fragments.last[sample]
        while fragment >= 0:
            out_packed[n], fragment = fragments.packed[fragment], fragments.before[fragment]
            n += 1
        sort(out_packed[starts[sample] : n])
    starts[len(fragments.last)] = n


# ---------------------------------------------------------------- layers

# What is transmitted when no more is looked for: float32 shows no opacity from there to 1, and a colour is off by a
# 2^-25th of the brightest.
INVISIBLE = 2.0**-26


class Opacity(NamedTuple):
    """How transparent the materials are."""

    opacity: np.ndarray  # (n_material,) float64
    is_opaque: np.ndarray  # (n_material,) bool: also the texture is
    is_textured: np.ndarray  # (n_material,) bool
    min_transmittance: float  # when no more is transmitted, what lies behind is left out


class Layer(NamedTuple):
    """The fragments of one layer in some rows of a band, and their light."""

    visibility: VisibilityBuffer
    first_row: int  # of the band, half-open
    end_row: int
    radiance: np.ndarray  # (n_channel, n) float32 or float64, linear; n = rows * pitch, and some before
    alphas: np.ndarray  # (n,) float32, of textures; no rows where the scene has none
    weights: np.ndarray  # (pitch,) float64, scratch: how much of each sample of a row is seen


def min_transmittance(bound) -> float:
    """Return what may still be transmitted where a sample is done; 0 where `bound`, the largest intensity, is infinite.

    The tolerance doesn't count: every layer before has used its own share of it.
    """
    return INVISIBLE if np.isfinite(bound) else 0.0


def make_layer(extents, rows, radiance, alphas) -> Layer:
    """Return a layer with room for some rows of a band; no more columns than transparent surfaces cover.

    Parameters
    ----------
    extents : VisibilityBuffer, of which only the extents and the materials are read
    rows : Rows of the band, the first one the first of a strip
    radiance, alphas : those of the band, for their types
    """
    strips = slice(rows.y_start >> STRIP_SHIFT, ((rows.y_end - 1) >> STRIP_SHIFT) + 1)
    left, right = extents.left[strips].copy(), extents.right[strips].copy()
    first = min(int(left.min()), max(int(right.max()), 0))
    pitch = (max(int(right.max()) - first, 0) + PADDING + 7) // 8 * 8
    # Packed samples are found by row · pitch + column: those before the first column are never touched.
    n = first + (rows.y_end - rows.y_start) * pitch
    visibility = VisibilityBuffer(
        np.empty(n, np.int64), pitch, extents.width, left, right, extents.materials[strips],
        extents.other_left[strips], extents.other_right[strips],
    )  # fmt: skip
    return Layer(
        visibility, rows.y_start, rows.y_end, np.empty((len(radiance), n), radiance.dtype),
        np.empty(n if len(alphas) else 0, alphas.dtype), np.empty(pitch),
    )  # fmt: skip


@kernel
def show_layer(number, layer, packed, a_buffer, min_transmittance):
    """Make fragment `number` of each list the layer that is shaded, of samples that aren't done; return whether there
    is any.

    Parameters
    ----------
    layer : Layer, whose extents are narrowed
    packed : (n,) int64, all lists; one fragment at least
    a_buffer : ABuffer
    min_transmittance : see Opacity
    """
    visibility, is_any = layer.visibility, False
    for strip in range(len(visibility.left)):
        left, right = visibility.left[strip], visibility.right[strip]
        next_left, next_right = NO_START, NO_END
        first_row = layer.first_row + np.int64(strip << STRIP_SHIFT)
        for row in range(first_row, min(first_row + (1 << STRIP_SHIFT), layer.end_row) if left < right else first_row):
            start = (row - layer.first_row) * visibility.pitch + left
            end = start + right - left
            for k in range(end, end + LANES):
                visibility.packed[k] = CLEAR  # planes are evaluated for some samples more
            shown, sample = visibility.packed[start:end], a_buffer.columns[row] + left
            show_row(shown, sample, number, packed, a_buffer, min_transmittance)
            first, end_shown = shown_extent(shown)
            next_left = min(next_left, left + first if first < end_shown else NO_START)
            next_right = max(next_right, left + end_shown if first < end_shown else NO_END)
        visibility.left[strip], visibility.right[strip] = next_left, next_right
        is_any |= next_left < next_right
    return is_any


@helper
def show_row(out, sample, number, packed, a_buffer, min_transmittance):
    """Fill a row with fragment `number` of each list, from `sample` on; CLEAR where there is none, or none is seen."""
    n = len(out)
    starts, ends = a_buffer.starts[sample : sample + n], a_buffer.starts[sample + 1 : sample + 1 + n]
    arriving = a_buffer.transmittance[sample : sample + n]
    for k in range(n):
        fragment = starts[k] + number
        is_shown = (fragment < ends[k]) & (arriving[k] > min_transmittance)
        here = packed[fragment if is_shown else 0]
        out[k] = here if is_shown else CLEAR


@helper
def shown_extent(packed):
    """Return the first packed sample that shows something, and where the last one ends; n and 0 where none does."""
    n = len(packed)
    first, end = 0, n
    while first < n and packed[first] >= CLEAR:
        first += 1
    while end > first and packed[end - 1] >= CLEAR:
        end -= 1
    return first, end


@kernel
def composite(layer, setups, a_buffer, opacity):
    """Put a layer, which is shaded, behind those before.

    Parameters
    ----------
    layer : Layer
    setups : TriangleSetups of what it shows
    a_buffer : ABuffer, of which transmittance, opacity and color are changed
    opacity : Opacity
    """
    visibility, n_channel = layer.visibility, len(a_buffer.color)
    for row in range(layer.first_row, layer.end_row):
        strip = strip_of(row - layer.first_row)
        left, right = visibility.left[strip], visibility.right[strip]
        if left >= right:
            continue
        start, n = (row - layer.first_row) * visibility.pitch + left, right - left
        sample = a_buffer.columns[row] + left
        fill_alphas(visibility.packed[start : start + n], setups, layer.alphas, start, opacity, layer.weights)
        transmit(layer.weights[:n], a_buffer.transmittance[sample : sample + n], a_buffer.opacity[sample : sample + n])
        for channel in range(n_channel):
            color, radiance = a_buffer.color[channel, sample : sample + n], layer.radiance[channel, start : start + n]
            for k in range(n):
                color[k] += layer.weights[k] * radiance[k] if layer.weights[k] > 0.0 else 0.0


@helper
def fill_alphas(packed, setups, alphas, start, opacity, out):
    """Fill the opacities of a row's fragments, which begin at `start`; 0 where there is none."""
    is_textured = False
    last_setup, last_alpha = MAX_SETUPS, 0.0  # neighbours often show the same triangle
    for k in range(len(packed)):
        if packed[k] >= CLEAR:
            out[k] = 0.0
            continue
        setup = setup_of(packed[k])
        if setup != last_setup:
            material = material_of(packed[k], setups)
            last_setup, last_alpha = setup, opacity.opacity[material]
            is_textured = opacity.is_textured[material]
        out[k] = last_alpha * alphas[start + k] if is_textured else last_alpha


@helper
def transmit(weights, transmittance, opacity):
    """Turn opacities of fragments into weights of the light that arrives, and sum up what comes of it."""
    for k in range(len(weights)):
        alpha, arriving = weights[k], transmittance[k]
        share = arriving * alpha
        opacity[k] = 1.0 if alpha == 1.0 else min(opacity[k] + share, 1.0)
        transmittance[k] = arriving * (1.0 - alpha)
        weights[k] = share


# ---------------------------------------------------------------- what is behind


class Translucent(NamedTuple):
    """The samples of a band that nothing opaque is behind, but something transparent before."""

    opacity: np.ndarray  # (n_sample,) float64, numbered as in the A-buffer; 0 where a sample shows nothing
    columns: np.ndarray  # (n_row,) int64: the number of the sample in column 0 of a row
    left: np.ndarray  # (n_strip,) int64: they lie in the columns left..right of a strip
    right: np.ndarray  # (n_strip,) int64


@kernel
def put_behind(first_row, end_row, visibility, a_buffer, radiance, translucent):
    """Put the opaque surfaces behind all layers; return whether any sample has none.

    Parameters
    ----------
    first_row, end_row : rows of the band
    visibility : VisibilityBuffer of the opaque surfaces; its extents are widened to the samples that have none
    a_buffer : ABuffer, all of its layers composited
    radiance : (n_channel, n_row * pitch) float32 or float64, that of the opaque surfaces; changed where layers are seen
    translucent : Translucent, whose extents are widened
    """
    is_any, columns, first_samples = False, a_buffer.columns, a_buffer.first_samples
    for row in range(first_row, end_row):
        first_sample, end_sample = first_samples[row], first_samples[row + 1]
        if first_sample >= end_sample:
            continue
        left, sample, n = first_sample - columns[row], first_sample, end_sample - first_sample
        start, end = row * visibility.pitch + left, (row * visibility.pitch + left) + n
        packed, opacity = visibility.packed[start:end], a_buffer.opacity[sample : sample + n]
        transmittance = a_buffer.transmittance[sample : sample + n]
        for channel in range(len(radiance)):
            color = a_buffer.color[channel, sample : sample + n]
            merge_behind(packed, opacity, transmittance, color, radiance[channel, start:end])
        first, end = translucent_extent(packed, opacity)
        if first < end:
            widen_extent(visibility, strip_of(row), left + first, left + end)
            widen_extent(translucent, strip_of(row), left + first, left + end)
            is_any = True
    return is_any


@helper
def merge_behind(packed, opacity, transmittance, color, radiance):
    """Merge a channel of the layers of a row with that of the opaque surfaces; samples without layers stay as they
    are."""
    zero = radiance.dtype.type(0)
    for k in range(len(packed)):
        is_opaque = packed[k] < CLEAR
        behind = radiance[k] if is_opaque else zero
        seen = color[k] + transmittance[k] * behind if is_opaque else color[k] / opacity[k]
        radiance[k] = seen if opacity[k] > 0.0 else radiance[k]


@helper
def translucent_extent(packed, opacity):
    """Return the first sample of a row that shows something transparent and nothing opaque, and where the last one
    ends; first >= end where there is none."""
    n = len(packed)
    first, end = 0, n
    while first < n and (packed[first] < CLEAR or opacity[first] == 0.0):
        first += 1
    while end > first and (packed[end - 1] < CLEAR or opacity[end - 1] == 0.0):
        end -= 1
    return first, end
