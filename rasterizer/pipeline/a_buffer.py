"""The A-buffer: lists of the transparent fragments of a band, for scenes that have any.

In:  the band's transparent triangles, which the scan stage has left, and its opaque surfaces, which it has drawn.
Out: for every sample the entries of all transparent surfaces before the opaque one, nearest first (Carpenter 1984, "The
     A-buffer, an antialiased hidden surface method"). What becomes of them is said in layers.py.

Only samples in the extents of the transparent triangles have lists: `extents`, the columns left..right of each strip of
8 rows. Those samples are numbered row by row, without gaps:

    columns   left     right           The sample in column x of the band's row j has the number columns[j] + x; those
               |         |             of the row are numbers first_samples[j]..first_samples[j + 1]. What is kept for
    row j    . 0  1  2  3 .            samples, has room for as many as there are, and lists hold nothing opaque.
    row j+1  . 4  5  6  7 .

Lists are counted, room is divided, they are filled and sorted. They stand one behind the other: that of sample k is
entries[starts[k] - base:starts[k + 1] - base]. Entries hold depth above the index of the triangle's record, so they
order all surfaces at a sample, whatever their order in the file: at equal depth the lower index lies in front, as
everywhere. The lists of a range of samples are worked on at a time, so that a thread needs no more than MOST_FRAGMENTS
entries.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from . import setup as s
from .scan import Deferred, Payload, box_of, fill_spans, surface_of
from .visibility import strip_of

MOST_FRAGMENTS = 2**22  # of all lists that a thread works on at a time: 32 MB; more where a sample alone has more
FEW = 32  # lists that are longer on the average are filled in the order of depth, so that little is left to sort
PATIENCE = 8  # steps a fragment that a list may cost before it is sorted in another way


class Room:
    """A thread's memory for arrays by name: each grows to the largest size that it was asked for."""

    def __init__(self):
        self._arrays: dict[str, np.ndarray] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype=np.int64) -> np.ndarray:
        """Return an array that holds anything; one of the same name is lost."""
        n = math.prod(shape)
        if name not in self._arrays or len(self._arrays[name]) < n or self._arrays[name].dtype != dtype:
            self._arrays[name] = np.empty(n, dtype)
        return self._arrays[name][:n].reshape(shape)

    @property
    def n_byte(self) -> int:
        """How much memory that is."""
        return sum(array.nbytes for array in self._arrays.values())


class ABuffer(NamedTuple):
    """What is kept of the samples of a band that transparent surfaces may cover."""

    columns: np.ndarray  # (n_row,) int64: see above
    first_samples: np.ndarray  # (n_row + 1,) int64
    cursors: np.ndarray  # (n_sample,) int64: the length of each sample's list, then where its next entry goes
    starts: np.ndarray  # (n_sample + 1,) int64: where each sample's list begins, were all kept at a time
    transmittance: np.ndarray  # (n_sample,) float64: the part of the light from behind that arrives
    opacity: np.ndarray  # (n_sample,) float64: summed up, because 1 - transmittance loses the digits of small ones
    color: np.ndarray  # (n_channel, n_sample) float64: what the layers show, weighted by their opacity

    @property
    def lists(self) -> tuple:
        """Where lists begin and end: fields of FragmentLists."""
        return self.columns, self.cursors, self.starts


class FragmentLists(NamedTuple):
    """The lists of a range of samples."""

    first: int  # samples first..end
    end: int
    base: int  # where entries[0] would stand, were the lists of all samples kept at a time
    entries: np.ndarray  # (n_fragment,) int64
    columns: np.ndarray  # see ABuffer
    cursors: np.ndarray
    starts: np.ndarray
    is_counting: bool  # how long the lists are to be, before there is room for them
    ties: np.ndarray  # (1,) int64: not 0 if a fragment is as deep as an opaque surface whose index isn't known


def make_a_buffer(room: Room, extents, n_row, n_channel) -> ABuffer:
    """Return the A-buffer of a band: nothing is listed, and nothing is shown.

    Parameters
    ----------
    extents : VisibilityBuffer, of which only the extents are read
    """
    columns, first_samples = np.empty(n_row, np.int64), np.empty(n_row + 1, np.int64)
    n_sample = number_samples(extents, columns, first_samples)
    a_buffer = ABuffer(
        columns,
        first_samples,
        room.array("cursors", (n_sample,)),
        room.array("starts", (n_sample + 1,)),
        room.array("transmittance", (n_sample,), np.float64),
        room.array("opacity", (n_sample,), np.float64),
        room.array("color", (n_channel, n_sample), np.float64),
    )
    a_buffer.transmittance.fill(1.0)
    a_buffer.opacity.fill(0.0)
    a_buffer.color.fill(0.0)
    return a_buffer


def order_by_depth(transparent: Deferred, drawables) -> Deferred:
    """Order transparent triangles by the least depth of each."""
    z = drawables.vertices.z[drawables.triangles.vertex_idx[:, transparent.faces]]
    order = np.argsort(z.min(axis=0), kind="stable")
    return transparent._replace(faces=transparent.faces[order], payloads=transparent.payloads[order])


def split_samples(starts, first_samples):
    """Divide the samples of a band into ranges (first, end) whose lists have MOST_FRAGMENTS fragments at most.

    But at least a sample each; whole rows where possible. Samples behind the last list belong to the last range.

    Parameters
    ----------
    starts : (n_sample + 1,) int64, where each sample's list begins
    first_samples : (n_row + 1,) int64, the first sample of each row
    """
    first, n_sample = 0, len(starts) - 1
    while first < n_sample:
        end = int(np.searchsorted(starts, starts[first] + MOST_FRAGMENTS, side="right")) - 1
        whole_rows = int(first_samples[np.searchsorted(first_samples, end, side="right") - 1])
        end = max(whole_rows if whole_rows > first else end, first + 1)
        yield first, end
        first = end


# ---------------------------------------------------------------- kernels


@kernel
def number_samples(extents, out_columns, out_first_samples):
    """Number the samples in the extents of a band; return how many there are.

    `out_columns` is (n_row,) int64, `out_first_samples` (n_row + 1,).
    """
    n_sample = np.int64(0)
    for row in range(len(out_columns)):
        left, right = extents.left[strip_of(row)], extents.right[strip_of(row)]
        out_columns[index(row)], out_first_samples[index(row)] = n_sample - left, n_sample
        n_sample += max(right - left, 0)
    out_first_samples[index(len(out_columns))] = n_sample
    return n_sample


@kernel
def list_fragments(y_start, transparent, triangles, vertices, rows, block, visibility, lists):
    """Count or list the fragments of a band's transparent triangles that lie before the opaque surfaces.

    Parameters
    ----------
    y_start : the band's first row in the picture, samples
    transparent : Deferred, the triangles through which what is behind them is seen
    triangles, vertices : all of the picture
    rows : Rows of the picture, those of the band that are worked on
    visibility : VisibilityBuffer, the opaque surfaces
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
                surface = surface_of(k, Payload(payloads[index(first) + k], np.int64(0), np.int64(0)), block)
                fill_spans(visibility, y_start, box, surface, lists)


@kernel
def divide_room(cursors, starts):
    """Turn the lengths of the lists into where they begin; return how many fragments there are, and how many lists."""
    total = n_list = np.int64(0)
    for k in range(index(len(cursors))):
        n = cursors[k]
        starts[k], cursors[k] = total, total
        total += n
        n_list += n > 0
    starts[index(len(cursors))] = total
    return total, n_list


@kernel
def sort_lists(lists):
    """Sort the lists of samples, nearest first."""
    fragments, starts = lists.entries, lists.starts
    for sample in range(index(lists.first), index(lists.end)):
        begin, end = index(starts[sample] - lists.base), index(starts[sample + index(1)] - lists.base)
        if end - begin > index(1):
            sort(fragments[begin:end])


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
