"""Drawn edges: how much of each sample they cover, of the surface that is seen there.

In:  edges on the screen, and the depth at each sample.
Out: a share of each sample. Where edges overlap, the largest counts.

        d │╲              A line runs along an edge. A sample's distance from it is its edge function over the length of
      e ──┼──╲─────       the gradient, beyond an end the distance from that. The line covers the sample as far as that
    ──────┘    ╲          lies within half of its width. An edge that is seen from one side alone, as an outline is, has
       surface  ╲         its line beside it there: so nothing is drawn beside the surface, and all are equally wide.

What is less wide than a sample is drawn as wide as one, and fainter. A line beside its edge ends at the edge, where
samples end, too: it covers all of the first sample. That may lie up to 1 from the edge: so a line that is less wide
than a sample ends between 1 - width/2 and 1 + width/2, and has its width in the mean.

An edge is drawn on the surface that it is an edge of, and not on one before or behind it. What a sample sees has the
depths z_low to z_high at the 3x3 samples around it, and goes on as steeply as it is there: a point at the distance d
belongs to it if it lies between z_low - s and z_high + s, s = (d + 1/2) (z_high - z_low). One of the samples around it
lies on its face, further up or down: so a plane's depth changes by no more than d (z_high - z_low), and the half is for
rounding. The edge's nearest point must belong to what the sample next to it sees, and to what the covered sample sees,
which may lie before it by 2 s: the depth of a sphere of radius R falls by √(2 R d) from its outline to a sample, where
its slope is √(R/2d) and z_high - z_low is twice that. That is d times as much, and facets need more.
"""

import numpy as np

from ..compiler.kernels import helper, kernel

ROUNDING = 2.0**-20  # of a depth: float32 keeps 2^-24 of it, and of each coordinate in files


def place_lines(segments, sides, width):
    """Find where the lines of edges run.

    Parameters
    ----------
    segments : (n, 6) float64, see `draw_edges`
    sides : (n,) float64: 0 for an edge seen from both sides, else the sign of its edge function where its faces are
    width : samples

    Returns
    -------
    (n, 3) float64: how far the middle of the line lies beside the edge, x and y, and how far it reaches from there
    """
    end = max(width, 0.5 + 0.5 * width)
    shift, half_width = (
        np.where(sides != 0.0, 0.5 * end - 0.25, 0.0),
        np.where(sides != 0.0, 0.5 * end + 0.25, 0.5 * width),
    )
    along = segments[:, 3:5] - segments[:, :2]
    size = np.hypot(along[:, 0], along[:, 1])
    scale = sides * shift / np.where(size > 0.0, size, np.inf)
    return np.stack([-scale * along[:, 1], scale * along[:, 0], half_width], axis=1)


@kernel
def draw_edges(segments, lines, max_share, is_perspective, rows, depth, out):
    """Find the share of each sample of some rows that lines along edges cover.

    Parameters
    ----------
    segments : (n, 6) float64, edges: x, y (samples) and nearness of both ends; nearness is 1/depth, without perspective
        the depth
    lines : (n, 3) float64, see `place_lines`
    max_share : the largest share, 0..1
    is_perspective : whether nearness is 1/depth
    rows : (first, end)
    depth : (height, width) float32, inf where nothing is seen
    out : the same, comes in as 0
    """
    n_column, (top, bottom) = depth.shape[1], rows
    for k in range(len(segments)):
        aside_x, aside_y, half_width = lines[k, 0], lines[k, 1], lines[k, 2]
        x0, y0, near0 = segments[k, 0] + aside_x, segments[k, 1] + aside_y, segments[k, 2]
        dx, dy, d_near = segments[k, 3] + aside_x - x0, segments[k, 4] + aside_y - y0, segments[k, 5] - near0
        square = dx * dx + dy * dy
        inverse = 1.0 / square if square > 0.0 else 0.0
        around = half_width + 1.0  # where no more than nothing is covered
        low, high = min(x0, x0 + dx) - around, max(x0, x0 + dx) + around
        half = around * np.sqrt(square) / abs(dy) if dy != 0.0 else np.inf  # along a row
        first = min(max(min(y0, y0 + dy) - around, float(top)), float(bottom))
        end = min(max(y0, y0 + dy) + around, float(bottom))
        for row in range(int(first), int(max(end, 0.0))):
            y, left, right = row + 0.5, low, high
            if half < np.inf:
                middle = x0 + (y - y0) * dx / dy
                left, right = max(low, middle - half), min(high, middle + half)
            for column in range(int(max(left, 0.0)), int(max(min(right, float(n_column)), 0.0))):
                x = column + 0.5
                t = min(max(((x - x0) * dx + (y - y0) * dy) * inverse, 0.0), 1.0)
                near_x, near_y, nearness = x0 + t * dx, y0 + t * dy, near0 + t * d_near
                share = min(half_width + 0.5 - np.sqrt((x - near_x) ** 2 + (y - near_y) ** 2), max_share)
                if share > out[row, column] and depth[row, column] < np.inf:
                    z = 1.0 / nearness if is_perspective else nearness
                    point = near_x - aside_x, near_y - aside_y, z
                    if is_on_surface(point, point[0], point[1], 1.0, depth) and is_on_surface(point, x, y, 2.0, depth):
                        out[row, column] = share


@helper
def is_on_surface(point, at_x, at_y, bend, depth):
    """Tell whether a point (x, y, z) of an edge belongs to what the sample next to (at_x, at_y) sees, which may bend
    away `bend` times as much as the slack; also where that lies beside nothing."""
    (x, y, z), (n_row, n_column) = point, depth.shape
    row, column = int(min(max(at_y, 0.0), n_row - 1.0)), int(min(max(at_x, 0.0), n_column - 1.0))
    distance = np.sqrt((x - column - 0.5) ** 2 + (y - row - 0.5) ** 2)
    low, high = np.inf, -np.inf
    for j in range(max(row - 1, 0), min(row + 2, n_row)):
        for i in range(max(column - 1, 0), min(column + 2, n_column)):
            low, high = min(low, depth[j, i]), max(high, depth[j, i])
    slack = (distance + 0.5) * (high - low) + ROUNDING * abs(z)
    return high == np.inf or (z >= low - slack and z <= high + bend * slack)
