"""Stage 4, bands: the triangles of every band of scanlines, in face order.

In:  `Visible` of the cull stage: triangles, each with the first and the last band that it reaches.
Out: `BandLists`: a list of triangles for every band. Every part of the range of faces has its own, which the thread
     sorts that has found them: no thread waits for another one. `join_lists` puts those of a band together.

A counting sort by band: the classic bucket-sorted edge table with bands instead of scanlines. A band is the unit of
parallel work, and so small that its visibility buffer stays in the L2 cache. The order within a band is the order of
the faces, whatever the number of threads, so the picture can't depend on it.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import index, kernel


class BandLists(NamedTuple):
    """Lists of the triangles of a part, one after the other: those of band b are faces[starts[b]:starts[b + 1]]."""

    faces: np.ndarray  # (n,) uint32
    starts: np.ndarray  # (n_band + 1,) int64
    n_visible: int  # triangles
    n_culled: int


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


def sort_into_bands(visible) -> BandLists:
    """Sort the visible triangles of a part into bands.

    Parameters
    ----------
    visible : cull.Visible
    """
    starts = np.zeros(len(visible.histogram) + 1, np.int64)
    np.cumsum(visible.histogram, out=starts[1:])
    faces = np.empty(starts[-1], np.uint32)
    scatter(visible.faces, visible.first_bands, visible.last_bands, starts[:-1].copy(), faces)
    return BandLists(faces, starts, len(visible.faces), visible.n_culled)


def join_lists(parts) -> BandLists:
    """Put the lists of all parts together: those of a band one after the other, its triangles ascending.

    It is done once, before the bands are drawn: numpy gives the GIL away for a copy, and threads that copied between
    bands would wait for it.

    Parameters
    ----------
    parts : list of BandLists, one for each part of the range of faces, in order
    """
    if len(parts) == 1:
        return parts[0]
    starts, cuts = sum(part.starts for part in parts), [part.starts.tolist() for part in parts]
    lists = [part.faces[cut[k] : cut[k + 1]]
             for k in range(len(starts) - 1) for part, cut in zip(parts, cuts, strict=True)]  # fmt: skip
    n_visible, n_culled = sum(part.n_visible for part in parts), sum(part.n_culled for part in parts)
    return BandLists(np.concatenate(lists), starts, n_visible, n_culled)


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
