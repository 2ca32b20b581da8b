"""Check what triangles carry to their samples: range, constants and error of intensity steps and planes."""

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.stages import (
    KINDS,
    covered,
    packed_of,
    perspective_weights,
    plain_coding,
    plain_screen,
    random_triangles,
    scan_alone,
    slivers,
)

from rasterizer.pipeline import triangle_setups as r
from rasterizer.pipeline.samples import PLANE_GROUP
from rasterizer.pipeline.visibility import CLEAR, INTENSITY_MASK, IS_EXACT, IS_ID, IS_WEIGHTED, PAYLOAD_BITS, SETUP_MASK

SIZE, WIDE = (120, 90), (8300, 24)
STEPS = float(INTENSITY_MASK - 1)  # intensities up to 1
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
    """The groups of setup 0, arrays (parts, PLANE_GROUP): of normals or of intensities, and of the rest. Of affine
    intensities the last two parts are those of no setup."""
    first, numbers = r.FIRST_GROUP, workspace.setups.float_planes
    lengths = [r.VALUE_GROUP] if n_value <= 3 else [r.PLAIN_GROUP, r.VALUE_GROUP]
    return [
        numbers[sum(lengths[:k]) + first : sum(lengths[: k + 1]) + first].reshape(-1, PLANE_GROUP)
        for k in range(len(lengths))
    ]


def steps_to(workspace, rows, columns):
    """Columns and rows (n,) float32 from the anchor of setup 0 to samples."""
    ints = workspace.setups.int_planes
    return (columns - ints[r.PLANES_ANCHOR_X]).astype(np.float32), (rows - ints[r.PLANES_ANCHOR_Y]).astype(np.float32)


def plane_values(group, steps):
    """The first three planes of a group at samples, float32 rounded after each operation: (3, n)."""
    value, dx, dy = group[:3, :3, None]
    return value + steps[0] * dx + steps[1] * dy


def weights_at(packed, coding):
    """1/r, from the depths of packed samples, float32."""
    z = (packed >> PAYLOAD_BITS).astype(float)
    return np.float32(1) / (coding.depths.ratio_offset + coding.depths.ratio_scale * z).astype(np.float32)


def values_at(workspace, group, coding, packed, rows, columns):
    """Values (3, n) of a weighted group at samples, float32: a plane of a·r over r, kept within the range."""
    values = plane_values(group, steps_to(workspace, rows, columns)) * weights_at(packed, coding)
    return np.clip(values, group[3, :3, None], group[4, :3, None])


def drawn_values(case, coding, screen):
    """(intensities (n_attribute, n) float64 or None where the setup is exact, exact ones, workspace)."""
    triangle, depth, values, size = case
    workspace, counts = scan_alone([triangle], depth[None], values[None], coding, screen, size)
    rows, columns, edges = covered(triangle, size)
    weights = perspective_weights(edges, depth, screen.is_perspective)
    packed = packed_of(workspace, size)[rows, columns]
    assert packed.max() < CLEAR and packed.min() >= 0
    is_id = (packed & IS_ID) != 0
    assert is_id.all() or not is_id.any()
    is_exact = bool((packed & IS_EXACT)[is_id].any())
    found = counts.n_level, counts.n_plane, counts.n_exact
    assert found == (int(not is_id.any()), int(is_id.any() and not is_exact), int(is_exact)), found
    expected = np.einsum("cn,ca->an", weights, values.astype(float))
    if is_id.any() and (packed & IS_EXACT).all():
        assert not differences(packed & SETUP_MASK, 0)
        return None, expected, workspace
    if is_id.any():
        (group,) = groups_of(workspace, values.shape[1])
        found = plane_values(group, steps_to(workspace, rows, columns))
        if (packed & IS_WEIGHTED).any():
            found = values_at(workspace, group, coding, packed, rows, columns)
        found = found[: values.shape[1]]
        return found.astype(float), expected, workspace
    return (packed & INTENSITY_MASK)[None] / STEPS, expected, workspace


@pytest.mark.parametrize("shape", SHAPES)
def test_intensities_stay_in_range_and_within_the_tolerance(shape):
    """At every sample, also of planes that nobody would take; a constant stays constant."""
    turn = list(SHAPES).index(shape) % 2 == 0
    for kind, n_attribute, is_perspective in (
        ("packed", 1, turn),
        ("values", 1, not turn),
        ("values", 3, turn),
    ):
        screen, n_coded, n_refused = plain_screen(is_perspective, DEPTHS), 0, 0
        for case in cases(shape, n_attribute, is_perspective):
            low, high = case[2].min(axis=0)[:, None], case[2].max(axis=0)[:, None]
            for tolerance in (ALWAYS, 1 / 64, 1 / 4096):
                coding = plain_coding(kind, screen, n_attribute, intensity_scale=STEPS, tolerance=tolerance)
                values, expected, workspace = drawn_values(case, coding, screen)
                if values is None:
                    n_refused += 1
                    continue
                n_coded += 1
                # What stands in packed samples is rounded to whole intensity steps.
                slack = 0.5 / STEPS if (workspace.setups.int_planes == 0).all() else 0.0
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
    intensity steps stay within the range of the vertices. Only slivers have exact setups."""
    screen, rng, n_exact, n_triangle = plain_screen(True, (1.0, ratio * 1.01)), np.random.default_rng(9), 0, 0
    shapes = [(triangle, SIZE) for reach in (4.0, 30.0, 200.0) for triangle in random_triangles(rng, 12, SIZE, reach)]
    shapes += [(triangle, WIDE) for triangle in wide_triangles(rng, 6)]
    for triangle, size in shapes:
        depth = np.array([1.0, ratio, np.exp(rng.uniform(0, np.log(ratio)))])[rng.permutation(3)]
        values = random_values(rng, 1, 1)[0]
        for tolerance in TOLERANCES if len(covered(triangle, size)[0]) else ():
            coding = plain_coding("packed", screen, 1, intensity_scale=STEPS, tolerance=tolerance)
            found, expected, _ = drawn_values((triangle, depth, values, size), coding, screen)
            n_triangle, n_exact = n_triangle + 1, n_exact + (found is None)
            if found is not None:
                case = f"{triangle.tolist()}, {depth.tolist()}, {values.ravel().tolist()}, {tolerance}"
                assert np.abs(found - expected).max() <= tolerance, case
                slack = 0.5 / STEPS  # of a constant: it is rounded to whole intensity steps
                assert found.min() >= values.min() - slack and found.max() <= values.max() + slack, case
    assert n_triangle > 100 and n_exact < 0.15 * n_triangle, f"{n_exact} of {n_triangle} are exact"


def test_spans_in_pieces_stay_in_range_where_there_is_little_of_one():
    """What is nearly black, and what is nearly as bright as may be: roundings have less room than they take."""
    screen, rng, n_level = plain_screen(True, (1.0, 400.0)), np.random.default_rng(11), 0
    for triangle in random_triangles(rng, 200, SIZE, 30.0):
        depth, values = np.exp(rng.uniform(0, np.log(400.0), 3)), 60 / STEPS * rng.random((3, 1))
        for ends in (values, 1.0 - values) if len(covered(triangle, SIZE)[0]) else ():
            coding = plain_coding("packed", screen, 1, intensity_scale=STEPS, tolerance=80 / STEPS)
            found, expected, _ = drawn_values((triangle, depth, ends.astype(np.float32), SIZE), coding, screen)
            if found is not None:
                n_level += 1
                low, high = (np.float32(end) for end in (ends.min(), ends.max()))
                assert found.min() >= low - 0.5 / STEPS and found.max() <= high + 0.5 / STEPS, (triangle, depth, ends)
                assert np.abs(found - expected).max() <= 80 / STEPS
    assert n_level > 150


def test_spans_in_pieces_are_the_same_in_every_band():
    """Pieces end at columns of the picture and at the triangle's own edges, wherever a band begins or the picture
    ends."""
    screen, rng, n_compared = plain_screen(True, DEPTHS), np.random.default_rng(10), 0
    for triangle in random_triangles(rng, 20, SIZE, 200.0):
        depth, values = rng.uniform(*DEPTHS, 3), rng.random((1, 3, 1)).astype(np.float32)
        coding = plain_coding("packed", screen, 1, intensity_scale=STEPS, tolerance=1 / 4096)
        workspace, _ = scan_alone([triangle], depth[None], values, coding, screen, SIZE)
        whole = packed_of(workspace, SIZE)
        for top, height, width in ((0, 7, SIZE[0]), (33, 20, SIZE[0]), (60, 30, 53)):
            workspace, _ = scan_alone([triangle], depth[None], values, coding, screen, (width, height), y_start=top)
            part = packed_of(workspace, (width, height))
            assert not differences(part, whole[top : top + height, :width])
            n_compared += (part < CLEAR).sum()
    assert n_compared > 10_000


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
    options = {"intensity_scale": STEPS, "tolerance": 1 / 256, "normal_limit": 4e3}
    return plain_coding(kind, screen, n_attributes, TYPES, **options, needs_distance=kind == "normals")


@pytest.mark.parametrize("kind", KINDS)
def test_setups_stay_within_the_room_that_a_pass_gives_them(kind):
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
            for array in (with_guard.setups.integers[n:], with_guard.setups.int_planes[n << r.UNIT_SHIFT :]):
                assert (array == 77).all(), f"materials {chosen}: written behind {n} units, {counts}"
