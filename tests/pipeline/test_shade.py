"""Check the shade stage: exact interpolation, light, and that batches and neighbours don't change a bit."""

from functools import partial

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pairs import pairs
from helpers.stages import (
    band_of,
    covered,
    entries_of,
    exact_means,
    lighting_of,
    perspective_weights,
    plain_coding,
    plain_screen,
    random_triangles,
    scan_alone,
    slivers,
)

import rasterizer as rz
from rasterizer.pipeline.fragments import BATCH_SIZE
from rasterizer.pipeline.gradients import EXACT, HAS_COLORS
from rasterizer.pipeline.phong_shading import shade_lit
from rasterizer.pipeline.records import FACE, PLANES_FACE, UNIT_SHIFT
from rasterizer.pipeline.shade import shade_interpolated
from rasterizer.pipeline.visibility import CLEAR, IS_EXACT, IS_ID, LEVEL_MASK, RECORD_MASK, RECORD_SHIFT
from rasterizer.reference import light as reference_light
from rasterizer.reference.light import Lighting, Points
from rasterizer.reference.reflection import read_materials
from rasterizer.scene.camera import Projection, View

SIZE, WIDE = (120, 90), (3 * BATCH_SIZE + 50, 12)
LEVELS = float(LEVEL_MASK - 1)
DEPTHS = (1.0, 4.0)
DTYPES = [np.float32, np.float64]
NO_FACES = np.empty((0, 5))
WHITE = np.ones(3, np.float32)


def shade(scanned, coding, size, n_channel, tint=WHITE):
    """Intensities (n_channel, rows, columns) of a band of entries, planes or exact records."""
    workspace, counts = scanned
    workspace.radiance[:] = np.nan
    band = band_of(workspace, coding, counts, size[1])
    shade_interpolated(band, tint, workspace.batch, workspace.radiance[:n_channel])
    return workspace.radiance[:n_channel].reshape(n_channel, size[1], -1)[:, :, : size[0]]


def shade_by_phong(scanned, coding, size, screen, lighting, is_double):
    """Intensities (3, rows, columns) of a band, every sample of which is lit."""
    workspace, counts = scanned
    workspace.radiance[:] = np.nan
    batch = workspace.double_batch if is_double else workspace.batch
    band = band_of(workspace, coding, counts, size[1])
    shade_lit(band, screen, lighting, NO_FACES, None, None, batch, workspace.radiance[:3])
    return workspace.radiance[:3].reshape(3, size[1], -1)[:, :, : size[0]]


def exact_coding(base, screen, n_attributes, dtypes=np.float32, **options):
    """A coding under which all records are exact: in float32 that of intensities ("values") or of normals, as scenes
    have it."""
    if dtypes is np.float64:
        return plain_coding("exact", screen, n_attributes, dtypes, **options)
    coding = plain_coding(base, screen, n_attributes, dtypes, **options)
    return coding._replace(paths=np.full_like(coding.paths, EXACT))


SHAPES = {
    "small": lambda rng: random_triangles(rng, 12, SIZE, 6.0),
    "large": lambda rng: random_triangles(rng, 3, SIZE, 60.0),
    "far out": lambda rng: random_triangles(rng, 8, SIZE, 2.0**18).clip(-(2**28), 2**28),
    "sliver": lambda rng: slivers(rng, 80, SIZE, 500, 4),
    "needle": lambda rng: slivers(rng, 400, SIZE, 2**19, 1).clip(-(2**28), 2**28),
}


@pytest.mark.parametrize(
    "shape, n_channel, is_perspective, dtype",
    pairs(shape=SHAPES, n_channel=(1, 3), is_perspective=(True, False), dtype=DTYPES),
)
def test_exact_interpolation_is_that_of_rational_numbers(shape, n_channel, is_perspective, dtype):
    rng, screen = np.random.default_rng(1), plain_screen(is_perspective, DEPTHS)
    coding = exact_coding("values", screen, n_channel, dtype)
    worst, n_sample = 0.0, 0
    for triangle in SHAPES[shape](rng):
        rows, columns, edges = covered(triangle, SIZE)
        if not len(rows) or n_sample > 1000:
            continue
        depth, values = rng.uniform(*DEPTHS, 3), rng.random((3, n_channel)).astype(dtype)
        values[:, 0] = values[0, 0] if len(rows) % 2 else values[:, 0]  # a constant stays one
        scanned = scan_alone([triangle], depth[None], values[None], coding, screen, SIZE)
        found = shade(scanned, coding, SIZE, n_channel)[:, rows, columns]
        assert not differences(found >= values.min(axis=0)[:, None], True)
        assert not differences(found <= values.max(axis=0)[:, None], True)
        some = rng.permutation(len(rows))[:20]
        n_sample += len(some)
        for channel in range(n_channel):
            expected = exact_means(edges[:, some], depth, values[:, channel], is_perspective)
            worst = max(worst, np.abs(found[channel, some] - expected).max())
    budget = 16 * np.finfo(dtype).eps / 2
    assert n_sample > 30 and worst <= budget, f"{worst:.3g} > {budget:.3g}, {n_sample} samples"


def test_levels_in_entries_become_intensities():
    screen, triangle = (
        plain_screen(True, DEPTHS),
        np.array([[-9000, -500], [2000 * 256, 900], [300, 256 * 20]]),
    )
    values = np.array([[0.2], [0.9], [0.5]], np.float32)
    coding = plain_coding("entries", screen, level_scale=LEVELS, tolerance=1.0)
    scanned = scan_alone([triangle], np.full((1, 3), 2.0), values[None], coding, screen, WIDE, n_channel=3)
    assert scanned[1][:3] == (1, 0, 0)
    rows, columns, _ = covered(triangle, WIDE)
    levels = entries_of(scanned[0], WIDE)[rows, columns] & LEVEL_MASK
    expected = levels.astype(np.float32) * np.float32(1 / LEVELS)
    found = shade(scanned, coding, WIDE, 1)[0, rows, columns]
    assert not differences(found, expected) and len(rows) > 2 * BATCH_SIZE
    # Three channels are multiples of the tint, rounded as the resolve stage would.
    found = shade(scanned, coding, WIDE, 3, TINT)[:, rows, columns]
    assert not differences(found, expected * TINT[:, None])


TINT = np.array([1.0, 0.3, 0.07], np.float32)


@pytest.mark.parametrize("kind", ["exact", "entries", "values"])
def test_what_has_one_channel_is_tinted_beside_what_has_three(kind):
    """In a band of three channels; in one of one, it has the same intensities, not tinted yet."""
    rng, screen = np.random.default_rng(9), plain_screen(True, DEPTHS)
    triangles, depth = random_triangles(rng, 60, SIZE, 30.0), rng.uniform(*DEPTHS, (60, 3))
    depth[::2] = depth[::2, :1]
    values, material = rng.random((60, 3, 3)).astype(np.float32), rng.integers(0, 2, 60).astype(np.uint32)
    make = partial(exact_coding, "values") if kind == "exact" else partial(plain_coding, kind)
    coding = make(screen, [1, 3], level_scale=LEVELS, tolerance=1 / 256)
    scanned = scan_alone(triangles, depth, values, coding, screen, SIZE, material=material)
    both = shade(scanned, coding, SIZE, 3, TINT).copy()
    workspace, counts = scanned
    assert counts.features & HAS_COLORS and counts.material == -1
    entries, plain = entries_of(workspace, SIZE).copy(), np.zeros(SIZE[::-1], bool)
    for y, x in np.argwhere(entries < CLEAR):
        plain[y, x] = not entries[y, x] & IS_ID or material[face_at(workspace, entries[y, x])] == 0
    assert plain.sum() > 300 and ((entries < CLEAR) & ~plain).sum() > 300
    # The same triangles, all of one channel: those of the other material in the same places.
    alone = make(screen, [1, 1], level_scale=LEVELS, tolerance=1 / 256)
    one = shade(scan_alone(triangles, depth, values, alone, screen, SIZE, material=material), alone, SIZE, 1)[0]
    assert not differences(both[:, plain], one[plain] * TINT[:, None])
    assert not (both[1:, ~plain & (entries < CLEAR)] == one[~plain & (entries < CLEAR)] * TINT[1:, None]).all()


def face_at(workspace, entry):
    """The triangle whose record an entry shows."""
    record, kept = (int(entry) & int(RECORD_MASK)) >> RECORD_SHIFT, workspace.records
    return kept.integers[record, FACE] if entry & IS_EXACT else kept.int_planes[(record << UNIT_SHIFT) + PLANES_FACE]


# ---------------------------------------------------------------- Phong's method

COLORED = (
    rz.AmbientLight((0.1, 0.2, 0.1)),
    rz.PointLight((1, 2, 3), (0.8, 0.5, 0.4), (1, 0.1, 0.02)),
    rz.DirectionalLight((1, -2, -2), 0.3),
)
SHINY = rz.Material(specular=0.4, shininess=20)
SMALLEST = 2.0**-28  # highlights below it become 0, see reflection.square_and_multiply
DULL = rz.Material(diffuse=(0.2, 0.5, 0.9), specular=(0.5, 0.1, 0.1), reflection="blinn", shininess=7.5)
FLAT = rz.Material(specular=0)


def view_of(screen):
    """The camera of a screen."""
    return View(screen.eye, screen.right, screen.up, screen.forward)


def expected_light(screen, size, triangle, depth, normals, albedo, lights, material):
    """What the judge's equation gives at the samples of a triangle: (rows, columns, (n, 3) intensities)."""
    rows, columns, edges = covered(triangle, size)
    weights = perspective_weights(edges, depth, screen.is_perspective)
    corner = triangle.astype(int)
    a, b = corner[1] - corner[0], corner[2] - corner[0]
    side = 1 if a[0] * b[1] - b[0] * a[1] < 0 else -1
    normal = np.einsum("cn,ca->na", weights, normals.astype(float)) * side
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    w = (
        (weights * depth[:, None]).sum(axis=0)
        if screen.is_perspective
        else (edges / edges.sum(axis=0) * depth[:, None]).sum(axis=0)
    )
    across, upward = (
        (columns + 0.5 - screen.center_x) / screen.scale_x,
        (screen.center_y - rows - 0.5) / screen.scale_y,
    )
    stretch = w if screen.is_perspective else 1.0
    points = np.stack([across * stretch, upward * stretch, -w], axis=1)
    colors = np.einsum("cn,ca->na", weights, albedo.astype(float))
    scene = rz.Scene([rz.Mesh(np.eye(3), [[0, 1, 2]], material=material)], lights)
    projection = Projection(screen.scale_x, screen.scale_y, screen.center_x, screen.center_y, screen.is_perspective)
    lighting = Lighting(view_of(screen), projection, read_materials(scene), tuple(lights), "phong")
    diffuse, specular = reference_light.light_points(Points(points, normal, np.zeros(len(rows), int)), lighting)
    return rows, columns, colors * diffuse + specular


@pytest.mark.parametrize("kind, dtype, budget, is_perspective, material", [
    ("exact", np.float64, SMALLEST, True, SHINY), ("exact", np.float64, SMALLEST, False, DULL),
    ("exact", np.float32, 2e-5, True, DULL), ("exact", np.float32, 2e-5, False, FLAT),
    ("normals", np.float32, 4e-5, True, SHINY), ("normals", np.float32, 4e-5, False, DULL),
    ("normals", np.float32, 4e-5, True, FLAT),
])  # fmt: skip
def test_samples_are_lit_as_the_judge_lights_them(kind, dtype, budget, is_perspective, material):
    rng = np.random.default_rng(5)
    screen = plain_screen(is_perspective, DEPTHS, scale=60.0, center=(61.0, 43.0))
    lighting, plan = lighting_of(COLORED, [material], view_of(screen), dtype, np.ones((1, 3)))
    assert lighting.needs_view == (max(material.specular) > 0)
    options = {"tolerance": 1e9, "normal_limit": 1e30, "needs_distance": kind == "normals"}
    make = partial(exact_coding, "normals") if kind == "exact" else partial(plain_coding, kind)
    coding = make(screen, 6, dtype, **options)
    worst = n_sample = 0
    for triangle in random_triangles(rng, 12, SIZE, 50.0):
        depth = rng.uniform(2.0, 3.5, 3)
        normals = rng.normal(size=3) + 0.3 * rng.normal(size=(3, 3))
        values = np.concatenate(
            [normals / np.linalg.norm(normals, axis=1, keepdims=True), rng.random((3, 3))], axis=1
        ).astype(dtype)
        scanned = scan_alone([triangle], depth[None], values[None], coding, screen, SIZE, n_channel=3)
        picture = shade_by_phong(scanned, coding, SIZE, screen, lighting, dtype is np.float64)
        rows, columns, expected = expected_light(
            screen, SIZE, triangle, depth, values[:, :3], values[:, 3:], COLORED, material
        )
        found = picture[:, rows, columns].T
        worst, n_sample = max(worst, np.abs(found - expected).max(initial=0)), n_sample + len(rows)
    assert n_sample > 3000 and worst <= budget, f"{worst:.3g} > {budget:.3g}"
