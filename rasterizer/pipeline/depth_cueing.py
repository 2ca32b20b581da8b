"""Depth cueing: what is further away fades towards a colour.

In:  a band's shaded samples, its words, all of which hold numbers of exact records, and the records.
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

from ..compiler.kernels import borrow, kernel
from .interpolate import corner_weights, depth_of, weights_of
from .records import borrow_records
from .transform import HALF, SUBPIXEL
from .visibility import CLEAR, RECORD_MASK, STRIP_SHIFT


class Cue(NamedTuple):
    """How a picture fades with depth."""

    scale: float  # d0, scene units: s is 1/2 at start + scale
    start: float  # scene units
    color: np.ndarray  # (n_channel,) float64, linear


@kernel
def fade(canvas, records, y_start, n_row, is_perspective, cue, out_radiance):
    """Fade n_row rows of samples from y_start on; those that show nothing are left alone."""
    words, records = borrow(canvas.entries), borrow_records(records)
    radiance, color = borrow(out_radiance), borrow(cue.color)
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(STRIP_SHIFT)
        sy = (y_start + j) * SUBPIXEL + HALF
        for i in range(canvas.left[group], canvas.right[group]):
            sample = np.uint64(j * canvas.pitch + i)
            word = words[sample]
            if word >= CLEAR:
                continue
            record = np.uint64(word & RECORD_MASK)
            weights = weights_of(records, record)
            q0, q1, q2 = corner_weights(weights, i * SUBPIXEL + HALF, sy)
            depth = depth_of(records, record, weights, q0, q1, q2, is_perspective)
            share = cue.scale / (cue.scale + max(depth - cue.start, 0.0))
            for channel in range(np.uint64(radiance.shape[0])):
                radiance[channel, sample] = share * radiance[channel, sample] + (1.0 - share) * color[channel]
