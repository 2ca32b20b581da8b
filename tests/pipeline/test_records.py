"""Check what triangles carry to their samples: range, constants and error of levels and planes."""

import numpy as np
import pytest
from helpers.stages import (
    covered,
    entries_of,
    perspective_weights,
    plain_coding,
    plain_screen,
    random_triangles,
    scan_alone,
    slivers,
)

from rasterizer.pipeline.gradients import EXACT, IN_ENTRIES, LEVEL_PLANES, NORMAL_PLANES
from rasterizer.pipeline.records import (
    ATTRIBUTE,
    DISTANCE,
    FACE,
    FIRST_PLANE,
    INV_W,
    PLANES_ANCHOR_X,
    PLANES_ANCHOR_Y,
    PLANES_FACE,
    SIDE,
)
from rasterizer.pipeline.simd import PLANE_GROUP
from rasterizer.pipeline.visibility import CLEAR, IS_EXACT, IS_ID, LEVEL_MASK, PAYLOAD_BITS, RECORD_MASK

SIZE, WIDE = (120, 90), (8300, 24)
LEVELS = float(LEVEL_MASK - 1)  # intensities up to 1
DEPTHS = (1.0, 4.0)
ALWAYS = 1e9  # a tolerance at which planes are taken however wrong they are

SHAPES = {
    "tiny": lambda rng: (random_triangles(rng, 60, SIZE, 1.5), SIZE),
    "small": lambda rng: (random_triangles(rng, 60, SIZE, 8.0), SIZE),
    "large": lambda rng: (random_triangles(rng, 40, SIZE, 150.0), SIZE),
    "far out": lambda rng: (random_triangles(rng, 150, SIZE, 2.0**15), SIZE),
    "thin": lambda rng: (slivers(rng, 60, SIZE, 60, 300), SIZE),
    "sliver": lambda rng: (slivers(rng, 60, SIZE, 500, 4), SIZE),
    "needle": lambda rng: (slivers(rng, 300, SIZE, 2**18, 2), SIZE),
    "8192 px": lambda rng: (wide_triangles(rng, 12), WIDE),
}


def wide_triangles(rng, n):
    """Triangles that span 8192 pixels, as high as the picture, or a few sub-pixels."""
    left = rng.integers(0, 256 * 50, (n, 1))
    x = np.concatenate([left, left + 8192 * 256, left + rng.integers(0, 8192 * 256, (n, 1))], axis=1)
    y = rng.integers(0, 256 * WIDE[1], (n, 3))
    y[: n // 3] = y[: n // 3, :1] + rng.integers(0, 500, (n // 3, 3))
    return np.stack([x, y], axis=-1)


def random_values(rng, n, n_attribute):
    """Intensities (n, 3, n_attribute) float32 within 0..1: wide, narrow, at the ends, and constant."""
    wide = rng.random((n, 3, n_attribute))
    narrow = wide[:, :1] + 2.0 ** rng.uniform(-26, -8, (n, 1, 1)) * rng.random((n, 3, n_attribute))
    ends = rng.integers(0, 2, wide.shape)
    kinds = np.stack([wide, narrow.clip(0, 1), ends, np.broadcast_to(wide[:, :1], wide.shape)])
    return kinds[rng.integers(0, 4, n), np.arange(n)].astype(np.float32)


def cases(shape, n_attribute, is_perspective):
    """(triangle, depths, values, size) of one shape."""
    rng = np.random.default_rng(len(shape) + 10 * n_attribute)
    triangles, size = SHAPES[shape](rng)
    depth = np.exp(rng.uniform(*np.log(DEPTHS), (len(triangles), 3)))
    depth[::3] = depth[::3, :1] * rng.uniform(1, 1.003, depth[::3].shape).clip(
        None, DEPTHS[1]
    )  # hardly any perspective
    for case in zip(triangles, depth.clip(*DEPTHS), random_values(rng, len(triangles), n_attribute), strict=True):
        if len(covered(case[0], size)[0]):
            yield *case, size


def wrapped(values):
    """Integers cut to 32 bits, as numpy int64."""
    return (values + 2**31) % 2**32 - 2**31


def levels_at(workspace, rows, columns):
    """Levels (3, n) of the planes of record 0 at samples."""
    record = workspace.records.int_planes[: 1 << workspace.records.plane_shift].astype(np.int64)
    x, y = columns - record[PLANES_ANCHOR_X], rows - record[PLANES_ANCHOR_Y]
    value, value_x, value_y = record[FIRST_PLANE : FIRST_PLANE + 3 * PLANE_GROUP].reshape(3, PLANE_GROUP, 1)[:, :3]
    return wrapped(value + x * value_x + y * value_y)


def drawn_levels(kind, case, coding, screen):
    """(levels (n_attribute, n) or None where the record is exact, exact intensities, rows, columns)."""
    triangle, depth, values, size = case
    workspace, n_record, n_exact = scan_alone(
        [triangle], depth[None], values[None], coding, screen, size, n_group=int(kind == LEVEL_PLANES)
    )
    rows, columns, edges = covered(triangle, size)
    weights = perspective_weights(edges, depth, screen.is_perspective)
    entries = entries_of(workspace, size)[rows, columns]
    assert (entries < CLEAR).all() and (entries >= 0).all()
    is_id = (entries & IS_ID) != 0
    assert is_id.all() or not is_id.any()
    assert n_record == is_id.any() and n_exact == bool((entries & IS_EXACT)[is_id].any())
    expected = np.einsum("cn,ca->an", weights, values.astype(float))
    if is_id.any() and (entries & IS_EXACT).all():
        assert (entries & RECORD_MASK == 0).all()
        return None, expected, workspace
    levels = levels_at(workspace, rows, columns) if kind == LEVEL_PLANES else (entries & LEVEL_MASK)[None]
    return levels, expected, workspace


@pytest.mark.parametrize("is_perspective", [True, False])
@pytest.mark.parametrize("kind", [IN_ENTRIES, LEVEL_PLANES])
@pytest.mark.parametrize("shape", SHAPES)
def test_levels_stay_in_range_and_within_the_tolerance(shape, kind, is_perspective):
    """At every sample, also of planes that nobody would take; a constant stays constant."""
    screen = plain_screen(is_perspective, DEPTHS)
    n_coded = n_refused = 0
    for case in cases(shape, 3 if kind == LEVEL_PLANES else 1, is_perspective):
        low, high = (np.rint(f(case[2].astype(float) * LEVELS, axis=0))[:, None] for f in (np.min, np.max))
        for tolerance in (ALWAYS, 1 / 64, 1 / 4096):
            coding = plain_coding(kind, screen, LEVELS, tolerance)
            levels, expected, _ = drawn_levels(kind, case, coding, screen)
            if levels is None:
                n_refused += 1
                continue
            n_coded += 1
            assert (levels >= low).all() and (levels <= high).all(), (
                f"{case}: {levels.min()}..{levels.max()} not in {low}..{high}"
            )
            error = np.abs(levels / LEVELS - expected).max()
            assert error <= tolerance, f"{case}: error {error} > {tolerance}"
    assert n_coded + n_refused >= 15
    assert n_refused > 100 if shape == "needle" else n_coded > 10, f"{n_coded} coded, {n_refused} refused"


def test_the_bound_takes_a_triangle_where_it_may():
    """The bound is not so cautious that nothing is ever coded: flat and gentle triangles are."""
    screen = plain_screen(True, DEPTHS)
    coding = plain_coding(IN_ENTRIES, screen, LEVELS, 1 / 4096)
    triangle = np.array([[1000, 500], [30000, 9000], [5000, 22000]])
    gentle = np.array([[0.2], [0.5], [0.9]], np.float32)
    for depth, values, is_coded in (
        ((2.0, 2.001, 2.0005), gentle, True),
        ((2.0, 2.5, 3.0), gentle, False),
        ((1.0, 4.0, 2.0), np.full((3, 1), 0.3, np.float32), True),
        ((1.0, 4.0, 2.0), gentle * np.float32(1e-4) + np.float32(0.5), True),
    ):
        levels, _, _ = drawn_levels(IN_ENTRIES, (triangle, np.array(depth), values, SIZE), coding, screen)
        assert (levels is not None) == is_coded


@pytest.mark.parametrize("shape", [shape for shape in SHAPES if shape != "needle"])
def test_depths_beside_levels_are_those_of_the_plane(shape):
    """No level carries into the bits of depth, which is off by half a step for each sample of the box."""
    screen = plain_screen(True, DEPTHS)
    coding = plain_coding(IN_ENTRIES, screen, LEVELS, ALWAYS)
    worst = 0.0
    for triangle, depth, values, size in cases(shape, 1, True):
        workspace, *_ = scan_alone([triangle], depth[None], values[None], coding, screen, size)
        rows, columns, edges = covered(triangle, size)
        z = (edges / edges.sum(axis=0) * (screen.z_offset + screen.z_scale / depth)[:, None]).sum(axis=0)
        box = np.ptp(triangle, axis=0).sum() / 256 + 2
        off = np.abs((entries_of(workspace, size)[rows, columns] >> PAYLOAD_BITS) - z).max() / (box / 2 + 32)
        worst = max(worst, off)
    assert 0 < worst <= 1, f"{worst} > 1 times half a step a sample"


def random_normals(rng, n, dtype=np.float32):
    """Unit normals (n, 3, 3) at the corners, similar ones and three equal ones among them."""
    normals = rng.normal(size=(n, 3, 3))
    normals[::3] = normals[::3, :1] + 0.1 * normals[::3]
    normals[::5] = normals[::5, :1]
    return (normals / np.linalg.norm(normals, axis=2, keepdims=True)).astype(dtype)


def planes_at(workspace, rows, columns):
    """The float32 planes of record 0 at samples: normals, albedo, distance, (7, n)."""
    record = slice(0, 1 << workspace.records.plane_shift)
    anchor_x, anchor_y = workspace.records.int_planes[PLANES_ANCHOR_X], workspace.records.int_planes[PLANES_ANCHOR_Y]
    x, y = (
        (columns - anchor_x).astype(np.float32),
        (rows - anchor_y).astype(np.float32),
    )
    planes = workspace.records.float_planes[record][FIRST_PLANE : FIRST_PLANE + 6 * PLANE_GROUP].reshape(
        2, 3, PLANE_GROUP, 1
    )
    found = (planes[:, 0] + x * planes[:, 1] + y * planes[:, 2]).reshape(2 * PLANE_GROUP, -1)
    return found[[0, 1, 2, 4, 5, 6, DISTANCE]]


def rise_over_box(triangle, values):
    """How much planes with the corner values (3, n) rise over a triangle's box and a sample beyond it."""
    edges = (triangle[1:] - triangle[0]) / 256
    slopes = np.linalg.solve(edges, values[1:] - values[0])
    return np.abs(slopes).T @ (np.ptp(triangle, axis=0) / 256 + 1)


@pytest.mark.parametrize("is_perspective", [True, False])
@pytest.mark.parametrize("shape", ["tiny", "small", "large", "far out", "thin", "8192 px"])
def test_normal_planes_err_as_little_as_they_say(shape, is_perspective):
    """By 2^-24·(3 + 4 s) where the plane rises by s over its box; 1/w and depth, by their size."""
    screen = plain_screen(is_perspective, DEPTHS)
    coding = plain_coding(NORMAL_PLANES, screen, tolerance=ALWAYS, normal_limit=1e30, needs_distance=True)
    rng = np.random.default_rng(17)
    n_compared = n_flat = 0
    for k, (triangle, depth, _, size) in enumerate(cases(shape, 1, is_perspective)):
        while np.ptp(1 / depth) > 0.1 * np.min(1 / depth):
            depth = np.sqrt(depth)  # else it is left to exact records
        normals, albedo = random_normals(rng, 6)[k % 6], rng.random((3, 3)).astype(np.float32)
        values = np.concatenate([normals, albedo], axis=1)
        workspace, n_record, _ = scan_alone([triangle], depth[None], values[None], coding, screen, size, n_group=2)
        rows, columns, edges = covered(triangle, size)
        entries = entries_of(workspace, size)[rows, columns]
        if (entries & IS_EXACT).any():
            continue
        assert n_record == 1 and (entries & (IS_ID | LEVEL_MASK) == IS_ID).all()
        weights = edges / edges.sum(axis=0)
        is_front = np.linalg.det([triangle[1] - triangle[0], triangle[2] - triangle[0]]) < 0
        inv_w = 1 / depth if is_perspective else np.ones(3)
        is_flat = (normals == normals[0]).all()
        n_flat += is_flat
        scaled = normals * (1 if is_flat else (inv_w / inv_w.max())[:, None]) * (1 if is_front else -1)
        last = (inv_w if is_perspective else depth)[:, None]
        corners = np.concatenate([scaled, albedo, last], axis=1)
        size_of = np.array([1.0] * 6 + [last.max()])[:, None]
        bound = 2.0**-24 * (3 * size_of + 4 * rise_over_box(triangle, corners)[:, None])
        found, expected = planes_at(workspace, rows, columns), np.einsum("cn,ca->an", weights, corners)
        share = (np.abs(found - expected) / bound).max()
        assert share <= 1, f"{triangle.tolist()}: {share} > 1 times the bound"
        if is_flat:
            assert (found[:3] == found[:3, :1]).all(), "three equal normals do not stay constant"
        n_compared += len(rows)
    assert n_compared > 20 and n_flat > 0


def test_a_steep_normal_or_much_perspective_is_left_to_exact_records():
    screen, triangle = plain_screen(True, DEPTHS), np.array([[1000, 500], [30000, 9000], [5000, 22000]])
    normals = random_normals(np.random.default_rng(3), 4)[3:4]
    rise = rise_over_box(triangle, normals[0].astype(float)).max()

    def is_exact(depth, limit, needs_distance=False, albedo=0.0):
        values = np.concatenate([normals, albedo * np.eye(3, dtype=np.float32)[None]], axis=2) if albedo else normals
        coding = plain_coding(NORMAL_PLANES, screen, tolerance=0.01, normal_limit=limit, needs_distance=needs_distance)
        workspace, n_record, _ = scan_alone([triangle], [depth], values, coding, screen, SIZE, n_group=2)
        entries = workspace.visibility.entries[workspace.visibility.entries < CLEAR]
        assert len(entries) > 1000 and n_record == 1
        return bool((entries & IS_EXACT).all())

    # The error of the planes over the least length that is known of the normals between the corners.
    cosine = min((normals[0, i].astype(float) * normals[0, j]).sum() for i, j in ((0, 1), (1, 2), (2, 0)))
    limit = (3 + 4 * rise) / np.sqrt((1 + 2 * cosine) / 3)
    assert is_exact((2, 2, 2), 0.99 * limit) and not is_exact((2, 2, 2), 1.01 * limit)
    assert is_exact((1, 4, 2), 2 * limit), "the normal is four times as short at the far end"
    assert not is_exact((1, 4, 2), 9 * limit) and is_exact((1, 4, 2), 9 * limit, needs_distance=True)
    assert not is_exact((2, 2.02, 2), 9 * limit, albedo=0.5) and is_exact((2, 2.5, 2), 9 * limit, albedo=0.5)


@pytest.mark.parametrize("is_inverted", [0, 1])
@pytest.mark.parametrize("turn", [1, -1])
@pytest.mark.parametrize("kind", [EXACT, NORMAL_PLANES])
def test_normals_are_turned_to_the_side_that_is_seen(kind, turn, is_inverted):
    """Two faces in one band: their records say which face they are of, and which side is seen."""
    screen = plain_screen(True, DEPTHS)
    triangle = np.array([[1000, 500], [5000, 22000], [30000, 9000]])[::turn]  # counter-clockwise as seen for turn 1
    normals = np.full((2, 3, 3), [0.0, 0.6, 0.8], np.float32)
    workspace, n_record, _ = scan_alone(
        [triangle, triangle], np.full((2, 3), 2.0), normals, plain_coding(kind, screen, normal_limit=1e9),
        screen, SIZE, is_inverted=[is_inverted, 1 - is_inverted], n_group=int(kind != EXACT),
    )  # fmt: skip
    assert n_record == 2
    for face in range(2):
        side = turn * (-1 if (is_inverted, 1 - is_inverted)[face] else 1)
        if kind == EXACT:
            integers, reals = workspace.records.integers[face], workspace.records.reals[face]
            assert integers[FACE] == face and integers[SIDE] == side
            assert reals[ATTRIBUTE + 3 : ATTRIBUTE + 6].tolist() == [np.float32(0.6)] * 3
            assert np.abs(reals[INV_W : INV_W + 3] - 0.5).max() < 1e-6
        else:
            row = face << workspace.records.plane_shift
            assert workspace.records.int_planes[row + PLANES_FACE] == face
            value, *slopes = workspace.records.float_planes[
                row + FIRST_PLANE : row + FIRST_PLANE + 3 * PLANE_GROUP
            ].reshape(3, PLANE_GROUP)[:, :3]
            assert (value == [0, side * np.float32(0.6), side * np.float32(0.8)]).all()
            assert not np.any(slopes)
