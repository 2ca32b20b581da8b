"""Depth cueing: what is further away fades towards a colour.

In:  a band's shaded samples, its visibility entries, and the records that these hold the numbers of.
Out: the samples' intensities I, mixed with the colour C of the cue by their depth d:

    I' = s·I + (1 - s)·C      s = d0 / (d0 + max(d - start, 0))

Source of the mix: Foley, van Dam, Feiner & Hughes 1990, section 16.1.3; of s: the attenuation 1/(d + d0) by the
viewer's distance, Rogers 1985, section 5.2, scaled to 1 where it begins.

The depth of what has an exact record is found from it, in float64, as that of the depth buffer is: 1/w errs by about
2^-52 of the nearest one's. Elsewhere it is that of the entry, which errs by DEPTH_ERROR of itself at most (with
perspective: see `check_distances` in gradients.py). A relative error e of d moves s by no more than

    d·|ds/dd|·e = d·d0/(d0 + d - start)²·e <= (1/4 + start/d0)·e

since with t = d - start >= 0 the quotient is t d0/(d0 + t)² + start d0/(d0 + t)². It moves I' by as much of |I - C|.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import index, kernel
from .interpolate import corner_weights, depth_at, exact_triangle, row_extent
from .visibility import CLEAR, PAYLOAD_BITS, is_exact, record_of

DEPTH_ERROR = 10 * 2.0**-24  # with perspective: how far off the depth of an entry may be, of itself


class Cue(NamedTuple):
    """How a picture fades with depth."""

    scale: float  # d0, scene units: s is 1/2 at start + scale
    start: float  # scene units
    color: np.ndarray  # (n_channel,) float64, linear


@kernel
def fade(band, depths, is_perspective, cue, out_radiance):
    """Fade the samples of a band; those that show nothing are left alone.

    Parameters
    ----------
    band : ScannedBand, whose coding is not read
    depths : DepthScale
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
            if is_exact(entry):
                record = record_of(entry)
                triangle = exact_triangle(records, record)
                q = corner_weights(triangle, i, band.y_start + j)
                depth = depth_at(records, record, triangle, q, is_perspective)
            else:
                z = float(entry >> PAYLOAD_BITS)
                inverse = depths.inv_w_offset + depths.inv_w_scale * z
                depth = 1.0 / inverse if is_perspective else depths.depth_offset + depths.depth_scale * z
            share = cue.scale / (cue.scale + max(depth - cue.start, 0.0))
            for channel in range(index(out_radiance.shape[0])):
                out_radiance[channel, sample] = share * out_radiance[channel, sample] + (1.0 - share) * color[channel]
