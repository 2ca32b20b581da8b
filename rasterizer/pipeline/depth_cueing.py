"""Depth cueing: what is further away fades towards a colour.

In:  a band's shaded samples, its visibility entries, all of which hold numbers of exact records, and the records.
Out: the samples' intensities I, mixed with the colour C of the cue by their depth d:

    I' = s·I + (1 - s)·C      s = d0 / (d0 + max(d - start, 0))

Source of the mix: Foley, van Dam, Feiner & Hughes 1990, section 16.1.3; of s: the attenuation 1/(d + d0) by the
viewer's distance, Rogers 1985, section 5.2, scaled to 1 where it begins.

The depth is found from the exact record, in float64, as that of the depth buffer is: 1/w errs by about 2^-52 of the
nearest one's, so d by far/near·2^-52 <= 2^-32 of itself. As d·|ds/dd| <= 1/4, that moves I' by 2^-34·(I + C): below the
rounding of the output.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import index, kernel
from .interpolate import corner_weights, depth_at, exact_triangle, row_extent
from .visibility import CLEAR, record_of


class Cue(NamedTuple):
    """How a picture fades with depth."""

    scale: float  # d0, scene units: s is 1/2 at start + scale
    start: float  # scene units
    color: np.ndarray  # (n_channel,) float64, linear


@kernel
def fade(band, is_perspective, cue, out_radiance):
    """Fade the samples of a band; those that show nothing are left alone.

    Parameters
    ----------
    band : ScannedBand, all of its records exact
    cue : Cue
    out_radiance : (n_channel, n_row * pitch) float64, linear, changed
    """
    color = cue.color
    visibility, records = band.visibility, band.records
    for j in range(band.n_row):
        left, right = row_extent(visibility, j)
        for i in range(left, right):
            sample = index(j * visibility.pitch + i)
            entry = visibility.entries[sample]
            if entry >= CLEAR:
                continue
            record = record_of(entry)
            triangle = exact_triangle(records, record)
            q = corner_weights(triangle, i, band.y_start + j)
            depth = depth_at(records, record, triangle, q, is_perspective)
            share = cue.scale / (cue.scale + max(depth - cue.start, 0.0))
            for channel in range(index(out_radiance.shape[0])):
                out_radiance[channel, sample] = share * out_radiance[channel, sample] + (1.0 - share) * color[channel]
