"""Stage 4, bands: the triangles of every band of scanlines, in face order.

A counting sort by band: the classic bucket-sorted edge table with bands instead of scanlines. A band is the unit of
parallel work, and so small that its z-buffer stays in the L2 cache. The order within a band is the order of the faces,
whatever the number of threads, so the picture can't depend on it.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import kernel


class Bands(NamedTuple):
    """Lists of triangles, one after the other: those of band b are face[start[b]:start[b + 1]]."""

    face: np.ndarray  # (n,) uint32
    start: np.ndarray  # (n_band + 1,) int64


def sort_into_bands(parts, workers) -> Bands:
    """Sort the visible triangles of all parts (a list of setup.Visible) into bands."""
    counts = np.stack([part.histogram for part in parts])  # (n_part, n_band)
    per_band = counts.sum(axis=0)
    start = np.concatenate([[0], np.cumsum(per_band)])
    # Part p writes its triangles of band b behind those of the parts before it.
    cursors = start[:-1] + np.cumsum(counts, axis=0) - counts
    face = np.empty(start[-1], np.uint32)
    workers.map(
        lambda p: scatter(parts[p].face, parts[p].first_band, parts[p].last_band, cursors[p], face), range(len(parts))
    )
    return Bands(face, start)


@kernel
def scatter(face, first_band, last_band, cursor, out_face):
    """Append every triangle to the lists of the bands it reaches; `cursor` holds the place of each list's next
    entry."""
    for k in range(len(face)):
        for band in range(np.uint64(first_band[k]), np.uint64(last_band[k]) + np.uint64(1)):
            out_face[np.uint64(cursor[band])] = face[k]
            cursor[band] += 1
