"""Check what a block of triangles holds: order, boxes, attributes and planes of depth, against plain integers and
fractions."""

from fractions import Fraction

import numpy as np
import pytest
from helpers.stages import NO_MATERIALS, drawables_of, random_triangles, slivers

from rasterizer.compiler.kernels import kernel
from rasterizer.pipeline import setup as s
from rasterizer.pipeline.cull import Band, first_sample
from rasterizer.pipeline.setup import DEPTH_PLANE_ROUNDING

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


def block_of(corners, z, attributes, n_side=1, material=NO_MATERIALS, is_double=(True,)):
    """Set up triangles (n, 3, 2) with z-buffer depths (n, 3); return the block, and which triangles are inverted."""
    n = len(corners)
    inverted = (np.arange(n) % 3 == 0).astype(np.uint8)
    values = attributes.reshape(n_side, n, 3, attributes.shape[-1])
    block = s.make_block()
    band = Band(np.arange(n, dtype=np.uint32), *ROWS)
    drawables = drawables_of(corners, z, values, inverted, material)
    set_up(band, drawables, SIZE[0], values.shape[3], np.array(is_double), block)
    return block, inverted


def row(array, first, n):
    """The first n columns of a row."""
    return array[int(first) : int(first) + n]


@pytest.mark.parametrize("turned", [[0, 1, 2], [1, 2, 0], [2, 1, 0]])
def test_vertices_are_clockwise_and_the_topmost_is_first(turned):
    """Whatever order they are listed in: the same rows, but for the side that is seen."""
    for seed, n in ((0, s.BLOCK), (1, 17), (2, 1)):
        corners = triangles(seed)[:n]
        z, values = np.random.default_rng(seed).random((n, 3)), np.random.default_rng(seed + 9).random((2, n, 3, 2))
        block, inverted = block_of(corners[:, turned], z[:, turned], values[:, :, turned], 2)
        for k in range(n):
            (ax, ay), (bx, by), (cx, cy) = (map(int, corner) for corner in corners[k])
            cross = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
            if cross == 0:
                continue
            order = sorted(range(3), key=lambda i, k=k: (corners[k, i, 1], corners[k, i, 0]))[:1]
            order += [(order[0] + step) % 3 for step in ((1, 2) if cross > 0 else (2, 1))]
            is_front = (cross < 0) != (turned == [2, 1, 0])
            is_flipped = is_front == bool(inverted[k])
            found = [[block.ints[int(f) + k] for f in pair] for pair in ((s.X0, s.Y0), (s.X1, s.Y1), (s.X2, s.Y2))]
            assert found == corners[k, order].tolist(), f"corners of {corners[k].tolist()}: {found}"
            assert [block.reals[int(f) + k] for f in (s.Z0, s.Z1, s.Z2)] == z[k, order].tolist()
            assert bool(block.ints[int(s.IS_FLIPPED) + k]) == is_flipped, f"side of {corners[k].tolist()}"
            carried = [block.reals[int(s.ATTRIBUTE) + i * s.BLOCK + k] for i in range(6)]
            assert carried == values[int(is_flipped), k, order].T.ravel().tolist()


def test_each_triangle_has_the_attributes_of_its_material():
    """Rounded to float32 where its material doesn't need more."""
    corners, rng = triangles(2), np.random.default_rng(5)
    n = len(corners)
    values = rng.random((2, n, 3, 8))
    single, is_double = values.astype(np.float32), (False, True, False)
    material = rng.integers(0, 3, n).astype(np.uint32)
    block, _ = block_of(corners, rng.random((n, 3)), values, 2, material, is_double)
    assert row(block.ints, s.MATERIAL, n).tolist() == material.tolist()
    rows = row(block.reals, s.ATTRIBUTE, 24 * s.BLOCK).reshape(8, 3, s.BLOCK)
    for k in range(n):
        is_flipped = int(block.ints[int(s.IS_FLIPPED) + k])
        wanted = (values if is_double[material[k]] else single)[is_flipped, k]
        assert sorted(rows[:, :, k].T.tolist()) == sorted(wanted.astype(float).tolist())


def test_boxes_hold_the_samples_of_the_band():
    corners = triangles(7)
    n = len(corners)
    block, _ = block_of(corners, np.zeros((n, 3)), np.zeros((n, 3, 0)))
    low = [[first_sample.py_func(v) for v in corners[:, :, k].min(axis=1)] for k in range(2)]
    high = [[first_sample.py_func(v) for v in corners[:, :, k].max(axis=1)] for k in range(2)]
    for name, first in zip((s.ANCHOR_X, s.ANCHOR_Y), low, strict=True):
        assert row(block.ints, name, n).tolist() == np.maximum(first, 0).tolist()
    assert row(block.ints, s.EXTENT_X, n).tolist() == np.subtract(high[0], low[0]).tolist()
    assert row(block.ints, s.EXTENT_Y, n).tolist() == np.subtract(high[1], low[1]).tolist()
    assert row(block.ints, s.LEFT, n).tolist() == np.maximum(low[0], 0).tolist()
    assert row(block.ints, s.RIGHT, n).tolist() == np.minimum(high[0], SIZE[0]).tolist()
    assert row(block.ints, s.TOP, n).tolist() == np.maximum(low[1], ROWS[0]).tolist()
    assert row(block.ints, s.BOTTOM, n).tolist() == np.minimum(high[1], ROWS[1]).tolist()


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
        block, _ = block_of(corners, z, np.zeros((len(corners), 3, 0)))
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


def thin_triangles(rng, n, elongation, reach):
    """Triangles (n, 3, 2) about `reach` px long in a box that is up to `elongation` times as large as they are."""
    found = []
    while len(found) < n:
        along = (256 * reach * rng.uniform(0.2, 1.0, 2)).astype(np.int64)
        aside = np.array([-along[1], along[0]]) / np.hypot(*along)
        third = rng.random() * along + aside * (along.prod() / elongation * rng.uniform(0.8, 1.6) / np.hypot(*along))
        corners = np.array([[0, 0], along, np.rint(third).astype(np.int64)]) * [rng.choice([-1, 1]), 1]
        corners += rng.integers(0, 256, 2) - corners.min(axis=0)
        area = abs(int(np.linalg.det((corners[1:] - corners[0]).astype(float))))
        if area and elongation / 2 < np.ptp(corners, axis=0).astype(float).prod() / area <= elongation:
            found.append(corners)
    return np.array(found)


@pytest.mark.parametrize("rise", [2.0**38, 2.0**44, 2.0**50])
def test_planes_of_depth_err_by_no_more_than_is_counted(rise):
    """Thin triangles, as thin as they may be for what their depth rises by; a corner may lie far before all that is
    seen. What float64 takes is seen where a plane has its value."""
    rng, worst, n_plane, n_sliver = np.random.default_rng(int(np.log2(rise))), 0.0, 0, 0
    for _ in range(12):
        elongation = min(s.MAX_LEVERAGE / rise, s.MAX_ELONGATION) * 2.0 ** rng.integers(-1, 2)
        corners = thin_triangles(rng, s.BLOCK, elongation, 2.0 ** rng.integers(10, 19))
        z = np.clip(rng.uniform(-0.5, 1.5, (s.BLOCK, 3)), 2.0**-15, 1.0 - 2.0**-15) * 2.0**38
        z[np.arange(s.BLOCK), rng.integers(0, 3, s.BLOCK)] -= rise if rise > 2.0**38 else 0.0
        block, _ = block_of(corners, z, np.zeros((s.BLOCK, 3, 0)))
        for k in range(s.BLOCK):
            if block.ints[int(s.IS_SLIVER) + k]:
                n_sliver += 1
                continue
            n_plane += 1
            anchor, value, _, _ = plane_of(block, k)
            worst = max(worst, float(abs(value - exact_plane(corners[k], z[k])[0](*anchor))))
    assert n_plane > 100 and n_sliver > 20, (n_plane, n_sliver)
    assert worst <= DEPTH_PLANE_ROUNDING, f"{worst} > {DEPTH_PLANE_ROUNDING} units"
    assert worst > 0.04 * DEPTH_PLANE_ROUNDING, f"{worst} units: more than 25 times as much is counted"
