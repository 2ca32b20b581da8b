"""Values of points that are means of others: the centres of polygons, see geometry/centers.py.

In:  values of points, those of the centres, which are the last ones, still empty.
Out: the same, filled.
"""

import numpy as np

from ..compiler.kernels import kernel


@kernel
def fill_means(values, first, offsets, points, start, end):
    """Give the centres start..end the means of their points' values.

    A mean can leave the range of its values by a rounding only; it may not.

    Parameters
    ----------
    values : (n_point, n_value) float32 or float64, changed
    first : the point that centre 0 is
    offsets : (n_center + 1,) int64 into `points`
    points : (n_corner,) int64, the points of each centre, one centre's behind the other's
    """
    for center in range(start, end):
        corner_start, corner_end = offsets[center], offsets[center + 1]
        for k in range(values.shape[1]):
            total, low, high = 0.0, np.inf, -np.inf
            for corner in range(corner_start, corner_end):
                value = values[points[corner], k]
                total += value
                low, high = min(low, value), max(high, value)
            values[first + center, k] = min(max(total / (corner_end - corner_start), low), high)
