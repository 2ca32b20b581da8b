"""Stage 4, bands: the triangles of every band of scanlines, in face order.

In:  `Visible` of the cull stage: triangles, each with the first and the last band that it reaches.
Out: `Bands`: a list of triangles for every band.

A counting sort by band: the classic bucket-sorted edge table with bands instead of scanlines. A band is the unit of
parallel work, and so small that its visibility buffer stays in the L2 cache. The order within a band is the order of
the faces, whatever the number of threads, so the picture can't depend on it.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import index, kernel


class Bands(NamedTuple):
    """Lists of triangles, one after the other: those of band b are faces[starts[b]:starts[b + 1]]."""

    faces: np.ndarray  # (n,) uint32
    starts: np.ndarray  # (n_band + 1,) int64


class Band(NamedTuple):
    """Rows y_start..y_end of samples of the picture, and the triangles that meet them."""

    faces: np.ndarray  # (n,) uint32, ascending
    y_start: int
    y_end: int

    @property
    def n_row(self) -> int:
        """Rows of samples."""
        return self.y_end - self.y_start


class Rows(NamedTuple):
    """Rows y_start..y_end of samples."""

    y_start: int
    y_end: int


def sort_into_bands(parts, workers) -> Bands:
    """Sort the visible triangles of all parts into bands.

    Parameters
    ----------
    parts : list of cull.Visible, one for each range of faces, in order
    """
    counts = np.stack([part.histogram for part in parts])  # (n_part, n_band)
    per_band = counts.sum(axis=0)
    starts = np.concatenate([[0], np.cumsum(per_band)])
    # Part p writes its triangles of band b behind those of the parts before it.
    cursors = starts[:-1] + np.cumsum(counts, axis=0) - counts
    faces = np.empty(starts[-1], np.uint32)
    workers.map(
        lambda p: scatter(parts[p].faces, parts[p].first_bands, parts[p].last_bands, cursors[p], faces),
        range(len(parts)),
    )
    return Bands(faces, starts)


@kernel
def scatter(faces, first_bands, last_bands, cursors, out_faces):
    """Append every triangle to the lists of the bands that it reaches.

    Parameters
    ----------
    faces : (n,) uint32
    first_bands, last_bands : (n,) uint16 or uint32, inclusive
    cursors : (n_band,) int64, where in `out_faces` each list's next entry goes; moved on
    out_faces : (n_listed,) uint32
    """
    for k in range(len(faces)):
        for band in range(index(first_bands[k]), index(last_bands[k]) + index(1)):
            out_faces[index(cursors[band])] = faces[k]
            cursors[band] += 1
