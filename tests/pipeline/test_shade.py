"""Check the shade stage: exact interpolation, light, and that batches and neighbours don't change a bit."""

import numpy as np
import pytest
from helpers.stages import (
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
from rasterizer.pipeline.gradients import EXACT, IN_ENTRIES, LEVEL_PLANES, NORMAL_PLANES
from rasterizer.pipeline.interpolate import ScannedBand
from rasterizer.pipeline.shade import FaceTable, shade_interpolated, shade_lit
from rasterizer.pipeline.visibility import CLEAR, IS_EXACT, IS_ID, LEVEL_MASK
from rasterizer.reference import light as reference_light
from rasterizer.reference.light import Lighting
from rasterizer.reference.materials import read_materials
from rasterizer.scene.camera import Projection, View

SIZE, WIDE = (120, 90), (3 * BATCH_SIZE + 50, 12)
LEVELS = float(LEVEL_MASK - 1)
DEPTHS = (1.0, 4.0)
DTYPES = [np.float32, np.float64]
ONE_MATERIAL = FaceTable(np.empty(0, np.uint32), np.empty((0, 5)))
MAYBE_EXACT = 1  # how many records are exact: the shade stage looks for them unless it is told that there are none


def shade(workspace, kind, size, n_channel):
    """Intensities (n_channel, rows, columns) of a band of entries, planes or exact records."""
    real = workspace.radiance.dtype.type
    workspace.radiance[:] = np.nan
    shade_interpolated(band_of(workspace, kind, size), n_channel, real(1 / LEVELS), workspace.radiance)
    return workspace.radiance.reshape(n_channel, size[1], -1)[:, :, : size[0]]


def shade_by_phong(workspace, kind, size, screen, lighting, faces=ONE_MATERIAL):
    """Intensities (3, rows, columns) of a band, every sample of which is lit."""
    workspace.radiance[:] = np.nan
    shade_lit(band_of(workspace, kind, size), screen, lighting, faces, None, None, workspace.batch, workspace.radiance)
    return workspace.radiance.reshape(3, size[1], -1)[:, :, : size[0]]


def band_of(workspace, kind, size):
    """The whole picture as one band."""
    return ScannedBand(workspace.visibility, workspace.records, kind, MAYBE_EXACT, 0, size[1])


SHAPES = {
    "small": lambda rng: random_triangles(rng, 12, SIZE, 6.0),
    "large": lambda rng: random_triangles(rng, 3, SIZE, 60.0),
    "far out": lambda rng: random_triangles(rng, 8, SIZE, 2.0**18).clip(-(2**28), 2**28),
    "sliver": lambda rng: slivers(rng, 80, SIZE, 500, 4),
    "needle": lambda rng: slivers(rng, 400, SIZE, 2**19, 1).clip(-(2**28), 2**28),
}


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("is_perspective", [True, False])
@pytest.mark.parametrize("n_channel", [1, 3])
@pytest.mark.parametrize("shape", SHAPES)
def test_exact_interpolation_is_that_of_rational_numbers(shape, n_channel, is_perspective, dtype):
    rng, screen = np.random.default_rng(1), plain_screen(is_perspective, DEPTHS)
    worst, n_sample = 0.0, 0
    for triangle in SHAPES[shape](rng):
        rows, columns, edges = covered(triangle, SIZE)
        if not len(rows) or n_sample > 3000:
            continue
        depth, values = rng.uniform(*DEPTHS, 3), rng.random((3, n_channel)).astype(dtype)
        workspace, *_ = scan_alone([triangle], depth[None], values[None], plain_coding(EXACT, screen), screen, SIZE)
        found = shade(workspace, EXACT, SIZE, n_channel)[:, rows, columns]
        assert (found >= values.min(axis=0)[:, None]).all() and (found <= values.max(axis=0)[:, None]).all()
        some = rng.permutation(len(rows))[:40]
        n_sample += len(some)
        for channel in range(n_channel):
            expected = exact_means(edges[:, some], depth, values[:, channel], is_perspective)
            worst = max(worst, np.abs(found[channel, some] - expected).max())
    budget = 16 * np.finfo(dtype).eps / 2
    assert n_sample > 30 and worst <= budget, f"{worst:.3g} > {budget:.3g}, {n_sample} samples"


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("shape", SHAPES)
def test_constants_stay_constant(shape, dtype):
    rng, screen = np.random.default_rng(2), plain_screen(True, DEPTHS)
    for triangle in SHAPES[shape](rng):
        rows, columns, _ = covered(triangle, SIZE)
        values = np.full((3, 1), rng.random(), dtype)
        workspace, *_ = scan_alone(
            [triangle], rng.uniform(*DEPTHS, (1, 3)), values[None], plain_coding(EXACT, screen), screen, SIZE
        )
        assert (shade(workspace, EXACT, SIZE, 1)[0, rows, columns] == values[0]).all()


def test_levels_in_entries_become_intensities():
    screen, triangle = (
        plain_screen(True, DEPTHS),
        np.array([[-9000, -500], [2000 * 256, 900], [300, 256 * 20]]),
    )
    values = np.array([[0.2], [0.9], [0.5]], np.float32)
    workspace, n_record, _ = scan_alone(
        [triangle],
        np.full((1, 3), 2.0),
        values[None],
        plain_coding(IN_ENTRIES, screen, LEVELS, 1.0),
        screen,
        WIDE,
    )
    assert n_record == 0
    rows, columns, _ = covered(triangle, WIDE)
    levels = entries_of(workspace, WIDE)[rows, columns] & LEVEL_MASK
    found = shade(workspace, IN_ENTRIES, WIDE, 1)[0, rows, columns]
    assert (found == levels.astype(np.float32) * np.float32(1 / LEVELS)).all() and len(rows) > 2 * BATCH_SIZE


# ---------------------------------------------------------------- one triangle over a batch, and many

FLOOR = np.array([[-9000, -500], [256 * 2 * WIDE[0], -700], [300, 256 * 40]])
COLORED = (
    rz.AmbientLight((0.1, 0.2, 0.1)),
    rz.PointLight((1, 2, 3), (0.8, 0.5, 0.4), (1, 0.1, 0.02)),
    rz.DirectionalLight((1, -2, -2), 0.3),
)
SHINY = rz.Material(specular=0.4, shininess=20)
SMALLEST = 2.0**-28  # highlights below it become 0, see reflection.square_and_multiply
DULL = rz.Material(diffuse=(0.2, 0.5, 0.9), specular=(0.5, 0.1, 0.1), reflection="blinn", shininess=7.5)


def view_of(screen):
    """The camera of a screen."""
    return View(screen.eye, screen.right, screen.up, screen.forward)


def over_floor(n_front, rng):
    """FLOOR with n small triangles before it: (triangles, depths)."""
    x = rng.integers(0, 256 * WIDE[0], (n_front, 1)) + np.array([0, 700, 300])
    y = rng.integers(0, 256 * (WIDE[1] - 2), (n_front, 1)) + np.array([0, 200, 900])
    triangles = np.concatenate([FLOOR[None], np.stack([x, y], axis=-1)])
    depth = np.concatenate([[[2.0, 2.6, 2.3]], np.full((n_front, 3), 1.2)])
    return triangles, depth


def shade_floor(n_front, kind, is_perspective, draw):
    """(entries, intensities) of FLOOR behind some small triangles; `draw` takes (workspace, screen)."""
    rng = np.random.default_rng(n_front)
    triangles, depth = over_floor(n_front, rng)
    n_attribute = 3 if kind == LEVEL_PLANES else 6
    values = np.random.default_rng(7).normal(size=(1, 3, n_attribute))
    values = (
        np.concatenate([np.abs(values) / 3, np.abs(rng.normal(size=(n_front, 3, n_attribute)) / 3)])
        .clip(0, 1)
        .astype(np.float32)
    )
    screen = plain_screen(is_perspective, DEPTHS, scale=40.0, center=(100.0, 6.0))
    coding = plain_coding(kind, screen, LEVELS, 1e9, 1e30, needs_distance=kind == NORMAL_PLANES)
    workspace, *_ = scan_alone(triangles, depth, values, coding, screen, WIDE, n_group=2, n_channel=3)
    entries = entries_of(workspace, WIDE).copy()
    assert not (entries[entries < CLEAR] & IS_ID & ((entries[entries < CLEAR] & IS_EXACT) << 1)).any(), (
        "a record is exact"
    )
    return entries, draw(workspace, screen)


def draw_levels(workspace, _):
    return shade(workspace, LEVEL_PLANES, WIDE, 3)


def draw_lit(workspace, screen):
    lighting, _ = lighting_of(COLORED, [SHINY], view_of(screen), np.float32, np.ones((1, 3)))
    assert lighting.needs_position and lighting.has_albedo and lighting.n_channel == 3
    return shade_by_phong(workspace, NORMAL_PLANES, WIDE, screen, lighting)


@pytest.mark.parametrize("is_perspective", [True, False])
@pytest.mark.parametrize("kind, draw", [(LEVEL_PLANES, draw_levels), (NORMAL_PLANES, draw_lit)])
def test_one_triangle_over_a_batch_and_many_give_the_same_bits(kind, draw, is_perspective):
    """Alone, a triangle's planes are fetched once for a batch; among others, sample by sample."""
    alone, expected = shade_floor(0, kind, is_perspective, draw)
    is_whole = (alone < CLEAR).all(axis=1)
    assert is_whole.sum() > 5, "batches of one triangle"
    assert np.isfinite(expected[:, alone < CLEAR]).all() and np.ptp(expected[:, alone < CLEAR], axis=1).min() > 0.001
    for n_front in (1, 3, 60):
        entries, found = shade_floor(n_front, kind, is_perspective, draw)
        is_floor = (entries < CLEAR) & (entries & LEVEL_MASK == 0)
        assert is_floor.sum() > 3000 and ((entries < CLEAR) & ~is_floor).any()
        different = (found[:, is_floor] != expected[:, is_floor]).sum()
        assert different == 0, f"{different} values differ > 0"


# ---------------------------------------------------------------- Phong's method


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
    diffuse, specular = reference_light.light_points(points, normal, np.zeros(len(rows), int), lighting)
    return rows, columns, colors * diffuse + specular


@pytest.mark.parametrize("material", [SHINY, DULL, rz.Material(specular=0)])
@pytest.mark.parametrize("is_perspective", [True, False])
@pytest.mark.parametrize(
    "kind, dtype, budget",
    [(EXACT, np.float64, SMALLEST), (EXACT, np.float32, 2e-5), (NORMAL_PLANES, np.float32, 4e-5)],
)
def test_samples_are_lit_as_the_judge_lights_them(kind, dtype, budget, is_perspective, material):
    rng = np.random.default_rng(5)
    screen = plain_screen(is_perspective, DEPTHS, scale=60.0, center=(61.0, 43.0))
    lighting, plan = lighting_of(COLORED, [material], view_of(screen), dtype, np.ones((1, 3)))
    assert plan.has_albedo and lighting.needs_view == (max(material.specular) > 0)
    coding = plain_coding(kind, screen, tolerance=1e9, normal_limit=1e30, needs_distance=kind == NORMAL_PLANES)
    worst = n_sample = 0
    for triangle in random_triangles(rng, 12, SIZE, 50.0):
        depth = rng.uniform(2.0, 3.5, 3)
        if kind == NORMAL_PLANES:
            depth[:] = depth[0]  # the albedo's planes know no perspective
        normals = rng.normal(size=3) + 0.3 * rng.normal(size=(3, 3))
        values = np.concatenate(
            [normals / np.linalg.norm(normals, axis=1, keepdims=True), rng.random((3, 3))], axis=1
        ).astype(dtype)
        workspace, *_ = scan_alone([triangle], depth[None], values[None], coding, screen, SIZE, n_group=2, n_channel=3)
        picture = shade_by_phong(workspace, kind, SIZE, screen, lighting)
        rows, columns, expected = expected_light(
            screen, SIZE, triangle, depth, values[:, :3], values[:, 3:], COLORED, material
        )
        found = picture[:, rows, columns].T
        worst, n_sample = max(worst, np.abs(found - expected).max(initial=0)), n_sample + len(rows)
    assert n_sample > 3000 and worst <= budget, f"{worst:.3g} > {budget:.3g}"


@pytest.mark.parametrize("kind", [EXACT, NORMAL_PLANES])
def test_each_sample_takes_the_material_of_its_own_face(kind):
    """Two materials in one batch, by turns: as if each face were drawn with its material alone."""
    rng = np.random.default_rng(6)
    triangles, depth = over_floor(40, rng)
    normals = np.abs(rng.normal(size=(41, 3, 3)))
    normals = (normals / np.linalg.norm(normals, axis=2, keepdims=True)).astype(np.float32)
    screen = plain_screen(True, DEPTHS, scale=40.0, center=(100.0, 6.0))
    coding = plain_coding(kind, screen, tolerance=1e9, normal_limit=1e30, needs_distance=kind == NORMAL_PLANES)
    lighting, _ = lighting_of(COLORED, [SHINY, DULL], view_of(screen), np.float32)
    pictures = []
    face_material = (np.arange(41) % 2).astype(np.uint32)
    for material in (face_material, np.zeros(41, np.uint32), np.ones(41, np.uint32)):
        workspace, *_ = scan_alone(triangles, depth, normals, coding, screen, WIDE, n_group=2, n_channel=3)
        entries = entries_of(workspace, WIDE).copy()
        faces = ONE_MATERIAL._replace(materials=material)
        pictures.append(shade_by_phong(workspace, kind, WIDE, screen, lighting, faces).copy())
    # Every triangle has a record of its number: none is dropped.
    of_sample = (entries & (IS_EXACT - 1)) % 2
    mixed, *alone = pictures
    for k, picture in enumerate(alone):
        here = (entries < CLEAR) & (of_sample == k)
        assert here.sum() > 50 and (mixed[:, here] == picture[:, here]).all()
    assert (alone[0][:, entries < CLEAR] != alone[1][:, entries < CLEAR]).any(axis=0).mean() > 0.9
