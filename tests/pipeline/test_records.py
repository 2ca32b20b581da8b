"""Check what triangles carry to their samples: range, constants and error of levels and planes."""

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.stages import (
    KINDS,
    covered,
    entries_of,
    perspective_weights,
    plain_coding,
    plain_screen,
    random_triangles,
    scan_alone,
    slivers,
)

from rasterizer.pipeline import records as r
from rasterizer.pipeline.samples import PLANE_GROUP
from rasterizer.pipeline.setup import DEPTH_PLANE_ROUNDING
from rasterizer.pipeline.visibility import CLEAR, IS_EXACT, IS_ID, IS_WEIGHTED, LEVEL_MASK, PAYLOAD_BITS, RECORD_MASK

SIZE, WIDE = (120, 90), (8300, 24)
LEVELS = float(LEVEL_MASK - 1)  # intensities up to 1
DEPTHS = (1.0, 4.0)
ALWAYS = 1e9  # a tolerance at which planes are taken however wrong they are

SHAPES = {
    "tiny": lambda rng: (random_triangles(rng, 30, SIZE, 1.5), SIZE),
    "small": lambda rng: (random_triangles(rng, 30, SIZE, 8.0), SIZE),
    "large": lambda rng: (random_triangles(rng, 16, SIZE, 150.0), SIZE),
    "far out": lambda rng: (random_triangles(rng, 80, SIZE, 2.0**15), SIZE),
    "thin": lambda rng: (slivers(rng, 30, SIZE, 60, 300), SIZE),
    "sliver": lambda rng: (slivers(rng, 30, SIZE, 500, 4), SIZE),
    "needle": lambda rng: (slivers(rng, 250, SIZE, 2**18, 2), SIZE),
    "8192 px": lambda rng: (wide_triangles(rng, 6), WIDE),
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


def groups_of(workspace, n_value):
    """The groups of record 0, arrays (parts, PLANE_GROUP): of normals or of intensities, and of the rest. Of affine
    intensities the last two parts are those of no record."""
    first, numbers = r.FIRST_GROUP, workspace.records.float_planes
    lengths = [r.VALUE_GROUP] if n_value <= 3 else [r.PLAIN_GROUP, r.VALUE_GROUP]
    return [
        numbers[sum(lengths[:k]) + first : sum(lengths[: k + 1]) + first].reshape(-1, PLANE_GROUP)
        for k in range(len(lengths))
    ]


def steps_to(workspace, rows, columns):
    """Columns and rows (n,) float32 from the anchor of record 0 to samples."""
    ints = workspace.records.int_planes
    return (columns - ints[r.PLANES_ANCHOR_X]).astype(np.float32), (rows - ints[r.PLANES_ANCHOR_Y]).astype(np.float32)


def plane_values(group, steps):
    """The first three planes of a group at samples, float32 rounded after each operation: (3, n)."""
    value, dx, dy = group[:3, :3, None]
    return value + steps[0] * dx + steps[1] * dy


def weights_at(entries, coding):
    """1/r, from the depths of entries, float32."""
    z = (entries >> PAYLOAD_BITS).astype(float)
    return np.float32(1) / (coding.depths.ratio_offset + coding.depths.ratio_scale * z).astype(np.float32)


def values_at(workspace, group, coding, entries, rows, columns):
    """Values (3, n) of a weighted group at samples, float32: a plane of a·r over r, kept within the range."""
    values = plane_values(group, steps_to(workspace, rows, columns)) * weights_at(entries, coding)
    return np.clip(values, group[3, :3, None], group[4, :3, None])


def drawn_values(case, coding, screen):
    """(intensities (n_attribute, n) float64 or None where the record is exact, exact ones, workspace)."""
    triangle, depth, values, size = case
    workspace, counts = scan_alone([triangle], depth[None], values[None], coding, screen, size)
    rows, columns, edges = covered(triangle, size)
    weights = perspective_weights(edges, depth, screen.is_perspective)
    entries = entries_of(workspace, size)[rows, columns]
    assert entries.max() < CLEAR and entries.min() >= 0
    is_id = (entries & IS_ID) != 0
    assert is_id.all() or not is_id.any()
    is_exact = bool((entries & IS_EXACT)[is_id].any())
    found = counts.n_level, counts.n_plane, counts.n_exact
    assert found == (int(not is_id.any()), int(is_id.any() and not is_exact), int(is_exact)), found
    expected = np.einsum("cn,ca->an", weights, values.astype(float))
    if is_id.any() and (entries & IS_EXACT).all():
        assert not differences(entries & RECORD_MASK, 0)
        return None, expected, workspace
    if is_id.any():
        (group,) = groups_of(workspace, values.shape[1])
        found = plane_values(group, steps_to(workspace, rows, columns))
        if (entries & IS_WEIGHTED).any():
            found = values_at(workspace, group, coding, entries, rows, columns)
        found = found[: values.shape[1]]
        return found.astype(float), expected, workspace
    return (entries & LEVEL_MASK)[None] / LEVELS, expected, workspace


@pytest.mark.parametrize("shape", SHAPES)
def test_intensities_stay_in_range_and_within_the_tolerance(shape):
    """At every sample, also of planes that nobody would take; a constant stays constant."""
    turn = list(SHAPES).index(shape) % 2 == 0
    for kind, n_attribute, is_perspective in (("entries", 1, turn), ("values", 1, not turn), ("values", 3, turn)):
        screen, n_coded, n_refused = plain_screen(is_perspective, DEPTHS), 0, 0
        for case in cases(shape, n_attribute, is_perspective):
            low, high = case[2].min(axis=0)[:, None], case[2].max(axis=0)[:, None]
            for tolerance in (ALWAYS, 1 / 64, 1 / 4096):
                coding = plain_coding(kind, screen, n_attribute, level_scale=LEVELS, tolerance=tolerance)
                values, expected, workspace = drawn_values(case, coding, screen)
                if values is None:
                    n_refused += 1
                    continue
                n_coded += 1
                slack = 0.5 / LEVELS if (workspace.records.int_planes == 0).all() else 0.0  # rounded to whole levels
                found = f"{values.min()}..{values.max()} not in {low}..{high}, {kind}, {is_perspective=}: {case}"
                assert (values >= low - slack).all() and (values <= high + slack).all(), found
                error = np.abs(values - expected).max()
                assert error <= tolerance, f"error {error:.3g} > {tolerance:.3g}, {kind}, {is_perspective=}: {case}"
        assert n_refused > 50 if shape == "needle" else n_coded > 5, f"{n_coded} coded, {n_refused} refused, {kind}"


# The largest w of a triangle over its least, and how far off an intensity may be.
RATIOS, TOLERANCES = (1.0, 1.01, 1.5, 4.0, 100.0, 1e4), (1 / 64, 1 / 1024, 1 / 4096, 2.0**-16)


@pytest.mark.parametrize("ratio", RATIOS)
def test_spans_in_pieces_err_by_the_tolerance_at_most(ratio):
    """Whatever w spans, of triangles of a few samples and of thousands, that reach out of the picture or don't; and
    levels stay within the range of the vertices. Only slivers have exact records."""
    screen, rng, n_exact, n_triangle = plain_screen(True, (1.0, ratio * 1.01)), np.random.default_rng(9), 0, 0
    shapes = [(triangle, SIZE) for reach in (4.0, 30.0, 200.0) for triangle in random_triangles(rng, 12, SIZE, reach)]
    shapes += [(triangle, WIDE) for triangle in wide_triangles(rng, 6)]
    for triangle, size in shapes:
        depth = np.array([1.0, ratio, np.exp(rng.uniform(0, np.log(ratio)))])[rng.permutation(3)]
        values = random_values(rng, 1, 1)[0]
        for tolerance in TOLERANCES if len(covered(triangle, size)[0]) else ():
            coding = plain_coding("entries", screen, 1, level_scale=LEVELS, tolerance=tolerance)
            found, expected, _ = drawn_values((triangle, depth, values, size), coding, screen)
            n_triangle, n_exact = n_triangle + 1, n_exact + (found is None)
            if found is not None:
                case = f"{triangle.tolist()}, {depth.tolist()}, {values.ravel().tolist()}, {tolerance}"
                assert np.abs(found - expected).max() <= tolerance, case
                slack = 0.5 / LEVELS  # of a constant: it is rounded to whole levels
                assert found.min() >= values.min() - slack and found.max() <= values.max() + slack, case
    assert n_triangle > 100 and n_exact < 0.15 * n_triangle, f"{n_exact} of {n_triangle} are exact"


def test_spans_in_pieces_stay_in_range_where_there_is_little_of_one():
    """What is nearly black, and what is nearly as bright as may be: roundings have less room than they take."""
    screen, rng, n_level = plain_screen(True, (1.0, 400.0)), np.random.default_rng(11), 0
    for triangle in random_triangles(rng, 200, SIZE, 30.0):
        depth, values = np.exp(rng.uniform(0, np.log(400.0), 3)), 60 / LEVELS * rng.random((3, 1))
        for ends in (values, 1.0 - values) if len(covered(triangle, SIZE)[0]) else ():
            coding = plain_coding("entries", screen, 1, level_scale=LEVELS, tolerance=80 / LEVELS)
            found, expected, _ = drawn_values((triangle, depth, ends.astype(np.float32), SIZE), coding, screen)
            if found is not None:
                n_level += 1
                low, high = (np.float32(end) for end in (ends.min(), ends.max()))
                assert found.min() >= low - 0.5 / LEVELS and found.max() <= high + 0.5 / LEVELS, (triangle, depth, ends)
                assert np.abs(found - expected).max() <= 80 / LEVELS
    assert n_level > 150


def test_spans_in_pieces_are_the_same_in_every_band():
    """Pieces end at columns of the picture and at the triangle's own edges, wherever a band begins or the picture
    ends."""
    screen, rng, n_compared = plain_screen(True, DEPTHS), np.random.default_rng(10), 0
    for triangle in random_triangles(rng, 20, SIZE, 200.0):
        depth, values = rng.uniform(*DEPTHS, 3), rng.random((1, 3, 1)).astype(np.float32)
        coding = plain_coding("entries", screen, 1, level_scale=LEVELS, tolerance=1 / 4096)
        workspace, _ = scan_alone([triangle], depth[None], values, coding, screen, SIZE)
        whole = entries_of(workspace, SIZE)
        for top, height, width in ((0, 7, SIZE[0]), (33, 20, SIZE[0]), (60, 30, 53)):
            workspace, _ = scan_alone([triangle], depth[None], values, coding, screen, (width, height), y_start=top)
            part = entries_of(workspace, (width, height))
            assert not differences(part, whole[top : top + height, :width])
            n_compared += (part < CLEAR).sum()
    assert n_compared > 10_000


@pytest.mark.parametrize("is_affine", [False, True])
def test_planes_of_intensities_err_as_little_as_they_say_in_any_perspective(is_affine):
    """By what gradients.py derives, from the roundings of planes and depths; whatever w spans. What is accepted
    decides whether planes are affine: with much perspective, if it is much."""
    for ratio in (1.0, 1.5, 4.0, 100.0, 1e4):
        screen, rng, worst, n_compared = plain_screen(True, (1.0, ratio * 1.01)), np.random.default_rng(8), 0.0, 0
        tolerance = 2.0 * ratio if is_affine else 2.0**-6 * max(ratio - 1.0, 0.1) / ratio
        coding = plain_coding("values", screen, 3, level_scale=LEVELS, tolerance=tolerance)
        for triangle in random_triangles(rng, 25, SIZE, 60.0):
            depth = np.array([1.0, ratio, np.exp(rng.uniform(0, np.log(ratio)))])[rng.permutation(3)]
            values = rng.random((3, 3)).astype(np.float32)
            rows, columns, _ = covered(triangle, SIZE)
            if not len(rows):
                continue
            found, expected, workspace = drawn_values((triangle, depth, values, SIZE), coding, screen)
            entry = entries_of(workspace, SIZE)[rows[0], columns[0]]
            if found is None or bool(entry & IS_WEIGHTED) == is_affine:
                continue
            bound = bound_of_values(triangle, depth, values, screen, coding, is_affine)
            assert bound <= tolerance, f"ratio {ratio}: the bound {bound:.3g} > {tolerance:.3g} was accepted"
            worst, n_compared = max(worst, np.abs(found - expected).max() / bound), n_compared + len(rows)
        # Nothing is bent where all is equally far away; then there is nothing to weight.
        assert n_compared > 1000 or (ratio == 1.0 and not is_affine and n_compared == 0), (ratio, n_compared)
        assert worst <= 1, f"ratio {ratio}: {worst:.3g} > 1 times the bound"


def bound_of_values(triangle, depth, values, screen, coding, is_affine):
    """How far float32 planes of values (3, 3) may be off."""
    near = 1.0 / ((2.0**23 - screen.z_offset) / screen.z_scale)  # about 1: w_0, at the margin of the z-buffer
    u, inverse, most = 2.0**-24, near / depth, np.abs(values).max()
    if is_affine:
        rise, spread = rise_over_box(triangle, values).max(), np.ptp(values, axis=0).max()
        return 2 * u * (4 * most + 5 * rise) + spread * (inverse.max() / inverse.min() - 1) / 4
    rise = rise_over_box(triangle, values * inverse[:, None]).max()
    box = np.ptp(triangle, axis=0).sum() / 256 + 2
    shift = (0.5 * box + DEPTH_PLANE_ROUNDING) * abs(coding.depths.ratio_scale)
    return (u * (3 * most * inverse.max() + 4 * rise) + most * shift) / inverse.min() + 3 * u * most


def test_the_bound_takes_a_triangle_where_it_may():
    """The bound is not so cautious that nothing is ever coded: flat and gentle triangles are."""
    screen = plain_screen(True, DEPTHS)
    triangle = np.array([[1000, 500], [30000, 9000], [5000, 22000]])
    gentle = np.array([[0.2], [0.5], [0.9]], np.float32)
    for depth, values, kind, is_level in (
        ((2.0, 2.001, 2.0005), gentle, "entries", True),
        ((2.0, 2.5, 3.0), gentle, "entries", True),
        ((1.0, 4.0, 2.0), gentle, "entries", True),
        ((1.0, 4.0, 2.0), np.full((3, 1), 0.3, np.float32), "entries", True),
        ((1.0, 4.0, 2.0), gentle * np.float32(1e-4) + np.float32(0.5), "entries", True),
        ((2.0, 2.001, 2.0005), gentle, "values", False),
        ((1.0, 4.0, 2.0), gentle, "values", False),
    ):
        coding = plain_coding(kind, screen, 1, level_scale=LEVELS, tolerance=1 / 4096)
        workspace, counts = scan_alone([triangle], [depth], values[None], coding, screen, SIZE)
        assert counts[:3] == (int(is_level), int(not is_level), 0), f"{depth}, {kind}: {counts}"


def test_depths_that_float32_has_no_inverse_for_are_left_to_exact_records():
    """A triangle 2^41 times as far away as the nearest thing; unless it is of one colour."""
    triangle = np.array([[1000, 500], [30000, 9000], [5000, 22000]])
    screen = plain_screen(True, (1.0, 2.0**50))
    for exponent, is_plane in ((20, True), (30, True), (39.9, True), (41, False), (49, False)):
        # Perspective bends these by more than is accepted: the planes are weighted.
        depth, values = 2.0**exponent * np.array([[1.0, 2.0**-19, 0.75]]), np.eye(3, dtype=np.float32)[None]
        coding = plain_coding("values", screen, 3, level_scale=LEVELS, tolerance=2.0**17)
        for given, expected in ((values, is_plane), (np.full_like(values, 0.25), True)):
            _, counts = scan_alone([triangle], depth, given, coding, screen, SIZE)
            assert counts.n_plane == expected and counts.n_exact == (not expected), f"2^{exponent}: {counts}"


def test_depths_beside_levels_are_those_of_the_plane():
    """No level carries into the bits of depth, which is off by half a step for each sample of the box."""
    screen, worst = plain_screen(True, DEPTHS), 0.0
    coding = plain_coding("entries", screen, level_scale=LEVELS, tolerance=ALWAYS)
    for shape in [shape for shape in SHAPES if shape != "needle"]:
        for triangle, depth, values, size in cases(shape, 1, True):
            workspace, *_ = scan_alone([triangle], depth[None], values[None], coding, screen, size)
            rows, columns, edges = covered(triangle, size)
            z = (edges / edges.sum(axis=0) * (screen.z_offset + screen.z_scale / depth)[:, None]).sum(axis=0)
            box = np.ptp(triangle, axis=0).sum() / 256 + 2
            off = np.abs((entries_of(workspace, size)[rows, columns] >> PAYLOAD_BITS) - z).max() / (box / 2 + 32)
            assert off <= 1, f"{shape}: {off:.3g} > 1 times half a step a sample"
            worst = max(worst, off)
    assert worst > 0


def random_normals(rng, n, dtype=np.float32):
    """Unit normals (n, 3, 3) at the corners, similar ones and three equal ones among them."""
    normals = rng.normal(size=(n, 3, 3))
    normals[::3] = normals[::3, :1] + 0.1 * normals[::3]
    normals[::5] = normals[::5, :1]
    return (normals / np.linalg.norm(normals, axis=2, keepdims=True)).astype(dtype)


def planes_at(workspace, coding, entries, rows, columns):
    """What the float32 planes of record 0 give at samples: normals, albedo, (6, n)."""
    normals, albedo = groups_of(workspace, 6)
    found = plane_values(normals, steps_to(workspace, rows, columns))
    return np.concatenate([found, values_at(workspace, albedo, coding, entries, rows, columns)])


def rise_over_box(triangle, values):
    """How much planes with the corner values (3, n) rise over a triangle's box and a sample beyond it."""
    edges = (triangle[1:] - triangle[0]) / 256
    slopes = np.linalg.solve(edges, values[1:] - values[0])
    return np.abs(slopes).T @ (np.ptp(triangle, axis=0) / 256 + 1)


@pytest.mark.parametrize("shape", ["tiny", "small", "large", "far out", "thin", "8192 px"])
def test_normal_planes_err_as_little_as_they_say(shape):
    """By 2^-24·(3 + 4 s) where the plane rises by s over its box; albedo behind them by the tolerance."""
    is_perspective = list(SHAPES).index(shape) % 2 == 0
    screen = plain_screen(is_perspective, DEPTHS)
    rng = np.random.default_rng(17)
    n_compared = n_flat = n_within = 0
    for k, (triangle, depth, _, size) in enumerate(cases(shape, 1, is_perspective)):
        normals, albedo = random_normals(rng, 6)[k % 6], rng.random((3, 3)).astype(np.float32)
        if k % 4 == 0:
            albedo[:] = albedo[0]
        for tolerance in (ALWAYS, 1 / 4096):
            coding = plain_coding("normals", screen, 6, tolerance=tolerance, normal_limit=1e30)
            values = np.concatenate([normals, albedo], axis=1)
            workspace, counts = scan_alone([triangle], depth[None], values[None], coding, screen, size)
            rows, columns, edges = covered(triangle, size)
            entries = entries_of(workspace, size)[rows, columns]
            if (entries & IS_EXACT).any():
                assert counts.n_exact == 1
                continue
            assert counts.n_plane == 1 and not differences(entries & (IS_ID | RECORD_MASK), IS_ID)
            is_front = np.linalg.det([triangle[1] - triangle[0], triangle[2] - triangle[0]]) < 0
            inv_w = 1 / depth if is_perspective else np.ones(3)
            is_flat = (normals == normals[0]).all()
            n_flat += is_flat
            corners = normals * (1 if is_flat else (inv_w / inv_w.max())[:, None]) * (1 if is_front else -1)
            bound = 2.0**-24 * (3 + 4 * rise_over_box(triangle, corners)[:, None])
            found = planes_at(workspace, coding, entries, rows, columns)
            share = (np.abs(found[:3] - np.einsum("cn,ca->an", edges / edges.sum(axis=0), corners)) / bound).max()
            assert share <= 1, f"{triangle.tolist()}: {share} > 1 times the bound"
            if is_flat:
                assert (found[:3] == found[:3, :1]).all(), "three equal normals do not stay constant"
            colors = np.einsum("cn,ca->an", perspective_weights(edges, depth, is_perspective), albedo.astype(float))
            off = np.abs(found[3:] - colors).max()
            assert off <= tolerance, f"{triangle.tolist()}: albedo is off by {off} > {tolerance}"
            low, high = albedo.min(axis=0)[:, None], albedo.max(axis=0)[:, None]
            assert (found[3:] >= low).all() and (found[3:] <= high).all(), "albedo leaves the range of the vertices"
            n_compared, n_within = n_compared + len(rows), n_within + (tolerance < 1)
    assert n_compared > 20 and n_flat > 0 and n_within > 0


def test_distances_from_entries_err_by_ten_units_at_most():
    """Of 2^-24 of themselves, where a triangle's record holds planes: 8 of its depth, 2 of rounding."""
    for far, is_perspective in ((2.0, True), (20.0, False), (1e3, True), (1e3, False)):
        screen, rng = plain_screen(is_perspective, (1.0, far)), np.random.default_rng(4)
        coding = plain_coding("normals", screen, 3, tolerance=1, normal_limit=1e30, needs_distance=True)
        n_plane, worst, depths = 0, 0.0, coding.depths
        for triangle in random_triangles(rng, 40, SIZE, 40.0):
            depth = np.sort(np.exp(rng.uniform(0, np.log(far), 3)))
            rows, columns, edges = covered(triangle, SIZE)
            workspace, counts = scan_alone([triangle], depth[None], random_normals(rng, 1), coding, screen, SIZE)
            if not len(rows) or counts.n_exact:
                continue
            z = (entries_of(workspace, SIZE)[rows, columns] >> PAYLOAD_BITS).astype(float)
            found = np.float32(1) / (depths.inv_w_offset + depths.inv_w_scale * z).astype(np.float32)
            expected = 1 / (edges / edges.sum(axis=0) / depth[:, None]).sum(axis=0)
            if not is_perspective:
                found = (depths.depth_offset + depths.depth_scale * z).astype(np.float32)
                expected = (edges / edges.sum(axis=0) * depth[:, None]).sum(axis=0)
            worst, n_plane = max(worst, np.abs(found / expected - 1).max() * 2**24), n_plane + 1
        assert n_plane > 12 and worst <= 10, f"{worst:.3g} > 10 units of 2^-24, {far=}, {is_perspective=}, {n_plane}"


def test_a_distance_that_depth_has_too_few_digits_for_is_left_to_exact_records():
    """1/w of a far triangle is small beside a step of the z-buffer."""
    triangle, screen = np.array([[1000, 500], [30000, 9000], [5000, 22000]]), plain_screen(True, (1.0, 1e5))
    for depth, is_exact in ((2.0, False), (50.0, False), (5e4, True)):
        for needs_distance in (False, True):
            coding = plain_coding("normals", screen, 3, normal_limit=1e30, needs_distance=needs_distance)
            values = random_normals(np.random.default_rng(3), 1)
            _, counts = scan_alone([triangle], np.full((1, 3), depth), values, coding, screen, SIZE)
            assert counts.n_exact == (is_exact and needs_distance), f"at {depth}: {counts}"


def test_a_steep_normal_or_much_perspective_is_left_to_exact_records():
    screen, triangle = plain_screen(True, DEPTHS), np.array([[1000, 500], [30000, 9000], [5000, 22000]])
    normals = random_normals(np.random.default_rng(3), 4)[3:4]
    rise = rise_over_box(triangle, normals[0].astype(float)).max()

    def is_exact(depth, limit, albedo=0.0, tolerance=0.01):
        values = np.concatenate([normals, albedo * np.eye(3, dtype=np.float32)[None]], axis=2) if albedo else normals
        coding = plain_coding("normals", screen, values.shape[2], tolerance=tolerance, normal_limit=limit)
        workspace, counts = scan_alone([triangle], [depth], values, coding, screen, SIZE)
        entries = workspace.visibility.entries[workspace.visibility.entries < CLEAR]
        assert len(entries) > 1000 and counts.n_plane + counts.n_exact == 1
        return bool((entries & IS_EXACT).all())

    # The error of the planes over the least length that is known of the normals between the corners.
    cosine = min((normals[0, i].astype(float) * normals[0, j]).sum() for i, j in ((0, 1), (1, 2), (2, 0)))
    limit = (3 + 4 * rise) / np.sqrt((1 + 2 * cosine) / 3)
    assert is_exact((2, 2, 2), 0.99 * limit) and not is_exact((2, 2, 2), 1.01 * limit)
    assert is_exact((1, 4, 2), 2 * limit), "the normal is four times as short at the far end"
    assert not is_exact((1, 4, 2), 9 * limit)
    # Albedo knows perspective, and is as good as float32: what is asked of it decides.
    assert not is_exact((2, 2.5, 2), 9 * limit, albedo=0.5) and is_exact((2, 2.5, 2), 9 * limit, 0.5, 2.0**-25)


@pytest.mark.parametrize("kind", ["exact", "normals"])
def test_normals_are_turned_to_the_side_that_is_seen(kind):
    """Two faces in one band: their records say which face they are of, and which side is seen."""
    screen, normals = plain_screen(True, DEPTHS), np.full((2, 3, 3), [0.0, 0.6, 0.8], np.float32)
    coding = plain_coding(kind, screen, 3, normal_limit=1e9)
    for turn, inverted in ((1, (0, 1)), (1, (1, 0)), (-1, (0, 1)), (-1, (1, 0))):
        triangle = np.array([[1000, 500], [5000, 22000], [30000, 9000]])[::turn]  # counter-clockwise as seen for turn 1
        workspace, counts = scan_alone(
            [triangle, triangle], np.full((2, 3), 2.0), normals, coding, screen, SIZE, is_inverted=inverted
        )
        assert (counts.n_exact, counts.n_plane) == ((2, 0) if kind == "exact" else (0, 2))
        for face, is_inverted in enumerate(inverted):
            side, case = turn * (-1 if is_inverted else 1), f"face {face}, {turn=}, {inverted=}"
            if kind == "exact":
                integers, reals = workspace.records.integers[face], workspace.records.reals[face]
                assert integers[r.FACE] == face and integers[r.SIDE] == side, case
                assert reals[r.ATTRIBUTE + 3 : r.ATTRIBUTE + 6].tolist() == [np.float32(0.6)] * 3, case
                assert np.abs(reals[r.INV_W : r.INV_W + 3] - 0.5).max() < 1e-6, case
                continue
            assert workspace.records.int_planes[face * r.UNIT + r.PLANES_FACE] == face, case
            first = face * r.UNIT + r.FIRST_GROUP
            group = workspace.records.float_planes[first : first + r.PLAIN_GROUP].reshape(3, PLANE_GROUP)[:, :3]
            assert (group[0] == [0, side * np.float32(0.6), side * np.float32(0.8)]).all(), case
            assert not np.any(group[1:]), case


# ---------------------------------------------------------------- several materials in a band


def mixed_band(seed, n=150):
    """Triangles of every shape, of eight materials, in turns and in runs: triangles, depths, attributes, materials."""
    rng = np.random.default_rng(seed)
    found = [random_triangles(rng, n // 3, SIZE, reach) for reach in (3.0, 12.0, 80.0)] + [slivers(rng, 9, SIZE, 50, 9)]
    triangles = rng.permutation(np.concatenate(found))
    depth = np.exp(rng.uniform(0, np.log(4.0), (len(triangles), 1))) * rng.uniform(1, 1.05, (len(triangles), 3))
    values = rng.random((len(triangles), 3, 8))
    values[::3] = values[::3, :1]
    material = rng.integers(0, 8, len(triangles)).astype(np.uint32)
    material[20:60] = material[20]
    return triangles, depth.clip(*DEPTHS), values, material


MIXED = [1, 3, 6, 8] * 2  # attributes of materials
TYPES = [np.float32] * 3 + [np.float64] * 5


def mixed_coding(kind, screen):
    """A coding with eight materials, of 1, 3, 6 and 8 attributes, three of them in float32."""
    n_attributes = [max(n, 3) if kind == "normals" else n for n in MIXED]
    options = {"level_scale": LEVELS, "tolerance": 1 / 256, "normal_limit": 4e3}
    return plain_coding(kind, screen, n_attributes, TYPES, **options, needs_distance=kind == "normals")


def test_what_is_too_far_for_albedo_in_planes_may_have_normals_there():
    """Whatever else is in its block: r has no inverse in float32, but nothing of this material is divided by it."""
    triangle, screen = np.array([[1000, 500], [30000, 9000], [5000, 22000]]), plain_screen(True, (1.0, 2.0**50))
    values = np.zeros((2, 3, 6), np.float32)
    values[..., :3], values[..., 3:] = random_normals(np.random.default_rng(3), 2)[1], 0.5
    coding = plain_coding("normals", screen, [3, 6], tolerance=1.0, normal_limit=1e9)
    for material in ([0, 0], [0, 1], [1, 0]):
        _, counts = scan_alone(
            [triangle] * 2, [[2.0**45] * 3] * 2, values, coding, screen, SIZE, material=np.array(material, np.uint32)
        )
        assert (counts.n_plane, counts.n_exact) == (2 - sum(material), sum(material)), material


@pytest.mark.parametrize("kind", KINDS)
def test_records_stay_within_the_room_that_a_pass_gives_them(kind):
    """As many units a triangle as `max_units` says, of blocks whose materials have any number of attributes;
    what lies behind is left as it is."""
    screen = plain_screen(True, DEPTHS)
    coding = mixed_coding(kind, screen)._replace(limits=np.full(8, 1e30), albedo_tolerance=1e30)
    for seed in range(2):
        triangles, depth, attributes, material = mixed_band(seed)
        for chosen in (np.arange(8), np.array([0, 3, 4]), np.array([2, 7]), np.array([0])):
            n = len(triangles) * r.max_units(coding)
            with_guard, counts = scan_alone(
                triangles, depth, attributes, coding, screen, SIZE, material=chosen[material % len(chosen)],
                room=n + 3 * len(triangles), fill=77,
            )  # fmt: skip
            for array in (with_guard.records.integers[n:], with_guard.records.int_planes[n << r.UNIT_SHIFT :]):
                assert (array == 77).all(), f"materials {chosen}: written behind {n} units, {counts}"
