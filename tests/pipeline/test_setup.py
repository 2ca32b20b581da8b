"""Check what a block of triangles holds: order, boxes, attributes and planes of depth, against plain integers and
fractions."""

from fractions import Fraction

import numpy as np
from helpers.stages import drawables_of, random_triangles, slivers

from rasterizer.compiler.kernels import kernel
from rasterizer.pipeline import setup as s
from rasterizer.pipeline.cull import Band

SIZE, ROWS = (120, 90), (16, 80)


@kernel
def set_up(band, drawables, width, n_attribute, is_double, block):
    """The first part of the scan stage, for one block."""
    s.gather_vertices(band.faces, drawables.triangles, drawables.vertices, block)
    s.order_vertices(drawables.vertices.pixel, block)
    s.gather_attributes(len(band.faces), n_attribute, drawables, is_double, block)
    s.compute_boxes(band, width, block)
    s.compute_depth_planes(block)


def triangles(seed):
    """A full block of triangles (64, 3, 2), both windings, equal heights among them."""
    rng = np.random.default_rng(seed)
    found = np.concatenate([
        random_triangles(rng, 20, SIZE, 2.0), random_triangles(rng, 20, SIZE, 50.0),
        random_triangles(rng, 8, SIZE, 2.0**19),
        slivers(rng, 16, SIZE, 500, 3),
    ]).clip(-(2**28), 2**28)  # fmt: skip
    found[::7, 1, 1] = found[::7, 0, 1]
    found[::11, 2] = found[::11, 0] + (256, 0)
    return found


def block_of(corners, z):
    """Set up triangles (n, 3, 2) with z-buffer depths (n, 3), every third of them inverted; return the block."""
    n, block = len(corners), s.make_block()
    band = Band(np.arange(n, dtype=np.uint32), *ROWS)
    drawables = drawables_of(corners, z, np.zeros((1, n, 3, 0)), np.arange(n) % 3 == 0)
    set_up(band, drawables, SIZE[0], 0, np.array([True]), block)
    return block


def exact_plane(corners, z):
    """The plane of depth through three corners, in fractions: a function of the column and row of a sample, its two
    slopes, and how far its box is larger than the triangle; None without area."""
    (ax, ay), (bx, by), (cx, cy) = ([int(v) for v in corner] for corner in corners)
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if area == 0:
        return None
    za, zb, zc = map(Fraction, z)
    z_x = 256 * ((zb - za) * (cy - ay) - (zc - za) * (by - ay)) / area
    z_y = 256 * ((zc - za) * (bx - ax) - (zb - za) * (cx - ax)) / area
    wide, high = np.ptp(corners.astype(object), axis=0)

    def depth_at(x, y):
        return za + (z_x * (256 * x + 128 - ax) + z_y * (256 * y + 128 - ay)) / 256

    return depth_at, z_x, z_y, Fraction(wide * high, abs(area))


def plane_of(block, k):
    """The plane of triangle k as it is kept: where its value is, (column, row), value and slopes."""
    anchor = tuple(int(block.ints[int(f) + k]) for f in (s.ANCHOR_X, s.ANCHOR_Y))
    return anchor, *(int(block.longs[int(f) + k]) for f in (s.PLANE_Z, s.PLANE_Z_DX, s.PLANE_Z_DY))


def rise_of(corners, z):
    """The larger rise along the two edges that leave the first vertex, the topmost and then leftmost."""
    first = min(range(3), key=lambda i: (corners[i, 1], corners[i, 0]))
    return max(abs(z[(first + 1) % 3] - z[first]), abs(z[(first + 2) % 3] - z[first]))


def test_planes_of_depth_are_those_of_fractions():
    """Value and slopes are rounded to whole steps; what is too long and thin, or too steep, is said to be."""
    n_plane = 0
    for seed in (0, 1):
        corners, rng = triangles(seed), np.random.default_rng(seed)
        z = rng.uniform(2.0**23, 2.0**38 - 2.0**23, (len(corners), 3))
        block = block_of(corners, z)
        for k, plane in enumerate(map(exact_plane, corners, z)):
            if plane is None:
                continue
            depth_at, z_x, z_y, elongation = plane
            is_sliver = elongation * Fraction(rise_of(corners[k], z[k])) > s.MAX_LEVERAGE
            assert bool(block.ints[int(s.IS_SLIVER) + k]) == is_sliver == (not block.ints[int(s.HAS_PLANES) + k])
            if is_sliver:
                continue
            n_plane += 1
            anchor, *found = plane_of(block, k)
            # Half a step of rounding, and a few float64 roundings of numbers as large as these.
            budget = 0.5 + 16 * Fraction(max(abs(z[k]))) * (1 + elongation) * Fraction(2) ** -53
            off = max(abs(a - b) for a, b in zip(found, (depth_at(*anchor), z_x, z_y), strict=True))
            assert off <= budget, f"{corners[k].tolist()}: {float(off)} > {float(budget)} units"
    assert n_plane > 60
