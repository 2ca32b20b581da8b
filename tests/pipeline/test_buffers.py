"""Check the exact buffers: depth against rational numbers, faces, normals, the clean-up; depths that entries tell."""

from types import SimpleNamespace

import numpy as np
from helpers.arrays import differences
from helpers.stages import (
    covered,
    drawables_of,
    entries_of,
    exact_means,
    perspective_weights,
    plain_coding,
    plain_screen,
    random_triangles,
    scan_alone,
    slivers,
)

from rasterizer.engine.buffers import BUFFER_TABLE
from rasterizer.pipeline.buffers import (
    LONG_RUN,
    VisibleSurfaces,
    clear_band,
    fill_depths,
    line_of_run,
    put_run_of_depths,
    write_depth,
)
from rasterizer.pipeline.cull import Band
from rasterizer.pipeline.interpolate import ExactTriangle, corner_weights, mean_depth
from rasterizer.pipeline.scan import scan_index
from rasterizer.pipeline.transform import compute_z
from rasterizer.pipeline.visibility import CLEAR, IS_EXACT, NO_END, NO_START

SIZE = (90, 70)
DEPTHS = (1.0, 40.0)
ALL = ("depth", "face", "normal")
NO_FACE = np.empty(0, np.uint32)


def write(triangles, depth, normals, screen, names=ALL, sources=NO_FACE, is_inverted=None, all_exact=False):
    """Scan and write the buffers, from entries that are all marked as exact or not; return (buffers, workspace, samples
    covered)."""
    workspace, surfaces = scan_for_buffers(triangles, depth, normals, screen, is_inverted)
    if all_exact:
        entries = workspace.visibility.entries
        entries[entries < CLEAR] |= IS_EXACT
    surfaces, out = surfaces._replace(sources=sources), SimpleNamespace()
    for name in names:
        buffer = BUFFER_TABLE[name].make(SIZE)
        buffer[...] = BUFFER_TABLE[name].empty
        BUFFER_TABLE[name].write(surfaces, Band(np.arange(len(triangles), dtype=np.uint32), 0, SIZE[1]), buffer)
        setattr(out, name, buffer)
    return out, workspace, clear_band(workspace.visibility, SIZE[1])


def scan_places(band, drawables, _coding, block, visibility, *_):
    """`scan_index`, called as `scan` is."""
    scan_index(band, drawables, block, visibility)
    return 0, 0, 0, 0, -1


def scan_for_buffers(triangles, depth, normals, screen, is_inverted=None):
    """Scan; return the workspace and VisibleSurfaces."""
    coding = plain_coding("exact", screen, 3, np.float64)
    workspace, _ = scan_alone(triangles, depth, normals, coding, screen, SIZE, is_inverted, run=scan_places)
    z = compute_z(np.asarray(depth, float), screen)
    drawables = drawables_of(triangles, z, normals[None], is_inverted)
    surfaces = VisibleSurfaces(
        workspace.visibility, np.arange(len(triangles), dtype=np.uint32), drawables, NO_FACE,
        coding.depths, screen.is_perspective, workspace.batch,
    )  # fmt: skip
    return workspace, surfaces


def unit_normals(rng, n):
    normals = rng.normal(size=(n, 3, 3))
    return normals / np.linalg.norm(normals, axis=2, keepdims=True)


def test_depths_and_normals_are_exact_to_float32():
    """One by one; depth is rounded once, so off by half a step of float32, and within the corners' range."""
    rng = np.random.default_rng(0)
    parts = [random_triangles(rng, 20, SIZE, 8.0), random_triangles(rng, 6, SIZE, 90.0)]
    needles = slivers(rng, 150, SIZE, 2**18, 1).clip(-(2**28), 2**28)
    for is_perspective in (True, False):
        screen, n_sample = plain_screen(is_perspective, DEPTHS), 0
        for triangle in np.concatenate([*parts, needles]):
            rows, columns, edges = covered(triangle, SIZE)
            if not len(rows):
                continue
            case, depth, normals = (
                f"{is_perspective=}, {triangle.tolist()}",
                rng.uniform(*DEPTHS, 3),
                unit_normals(rng, 1),
            )
            out, _, n_covered = write([triangle], depth[None], normals, screen)
            assert n_covered == len(rows), case
            found = out.depth[rows, columns].astype(float)
            low, high = np.float32(depth.min() * (1 - 1e-9)), np.float32(depth.max() * (1 + 1e-9))
            assert (found >= low).all() and (found <= high).all(), case
            some = rng.permutation(len(rows))[:30]
            expected = exact_means(edges[:, some], depth, depth, is_perspective)
            error = np.abs(found[some] / expected - 1).max()
            assert error <= 2.0**-24 * 1.001, f"{case}: depth is off by {error:.3g} > half a step of float32"
            normal = np.einsum("cn,ca->na", perspective_weights(edges, depth, is_perspective), normals[0])
            length = np.linalg.norm(normal, axis=1, keepdims=True)
            a, b = triangle[1] - triangle[0], triangle[2] - triangle[0]
            side = 1 if int(a[0]) * int(b[1]) - int(b[0]) * int(a[1]) < 0 else -1
            error = np.abs(out.normal[rows, columns] - side * normal / length)[length[:, 0] > 0.01].max(initial=0)
            assert error <= 2.0**-24, f"{case}: the normal is off by {error:.3g} > 2^-24"
            n_sample += len(some)
            is_hit = np.zeros(SIZE[::-1], bool)
            is_hit[rows, columns] = True
            assert np.isinf(out.depth[~is_hit]).all() and not out.normal[~is_hit].any(), case
            assert (out.face == np.where(is_hit, 0, -1)).all(), case
        assert n_sample > 200


def test_depths_that_entries_tell_are_those_of_exact_interpolation():
    """Of small triangles the depth comes from z nearly everywhere."""
    for depths, is_perspective in (
        ((1.0, 40.0), True), ((5.0, 6.0), False), ((1e4, 1e4 + 1e-3), True), ((1.0, 1e7), True), ((1.0, 1e7), False),
    ):  # fmt: skip
        rng, screen = np.random.default_rng(4), plain_screen(is_perspective, depths)
        parts = [random_triangles(rng, n, SIZE, reach) for n, reach in ((400, 2.0), (100, 5.0), (30, 30.0), (9, 200.0))]
        triangles = np.concatenate([slivers(rng, 50, SIZE, 60, 3), *parts])
        share = np.linspace(0.0, 0.9, len(triangles))[:, None] + rng.uniform(
            0, 0.1, (len(triangles), 3)
        )  # large ones last
        depth, normals = depths[0] * (depths[1] / depths[0]) ** share, unit_normals(rng, len(triangles))
        is_inverted = rng.integers(0, 2, len(triangles))
        expected, _, n_covered = write(triangles, depth, normals, screen, is_inverted=is_inverted, all_exact=True)
        assert n_covered > 4000 and len(np.unique(expected.face)) > 100
        found, _, _ = write(triangles, depth, normals, screen, is_inverted=is_inverted)
        for buffer in ALL:
            is_same = getattr(found, buffer).tobytes() == getattr(expected, buffer).tobytes()
            assert is_same, f"{buffer}, depths {depths}, {is_perspective=}"


def test_small_triangles_tell_their_depths_by_their_entries():
    """Few depths are interpolated, and only their triangles are fetched again."""
    for is_perspective in (True, False):
        rng, screen = np.random.default_rng(5), plain_screen(is_perspective, (5.0, 6.0))
        triangles, depth = random_triangles(rng, 2000, SIZE, 4.0), rng.uniform(5, 6, (2000, 3))
        workspace, surfaces = scan_for_buffers(triangles, depth, unit_normals(rng, 2000), screen)
        entries = workspace.visibility.entries[workspace.visibility.entries < CLEAR]
        assert len(entries) > 4000 and not differences(entries & IS_EXACT, 0)
        lost = surfaces.drawables._replace(vertices=surfaces.drawables.vertices._replace(z=np.full(6000, np.nan)))
        out = BUFFER_TABLE["depth"].make(SIZE)
        write_depth(surfaces._replace(drawables=lost), Band(np.arange(2000, dtype=np.uint32), 0, SIZE[1]), out)
        share = np.isnan(out[entries_of(workspace, SIZE) < CLEAR]).mean()
        assert 0 < share < 0.02, f"{is_perspective=}: {share:.2%} of the depths are interpolated > 2%"


def edge_functions(corner, edges, x, y):
    """Of a sample, and of a triangle that begins at a corner, with two edges that leave it."""
    (dx1, dy1), (dx2, dy2) = edges
    ux, uy = 256 * x + 128 - corner[0], 256 * y + 128 - corner[1]
    e1, e2 = ux * dy2 - uy * dx2, uy * dx1 - ux * dy1
    return dx1 * dy2 - dx2 * dy1 - e1 - e2, e1, e2


def random_run(rng, is_perspective):
    """A large triangle, and a run of samples of a row in it: (triangle, depths, x, y, length)."""
    size, length = 256 * int(2.0 ** rng.uniform(5, 20)), 0
    while length < LONG_RUN:
        corner, *edges = [tuple(pair) for pair in rng.integers(-size, size, (3, 2)).tolist()]
        p = rng.dirichlet((1, 1, 1))[1:]
        x, y = (int(corner[k] + p[0] * edges[0][k] + p[1] * edges[1][k]) // 256 for k in range(2))
        inside = [len({each > 0 for each in edge_functions(corner, edges, x + k, y)}) == 1 for k in range(256)]
        length = inside.index(False) if False in inside else 256
    depths = 10.0 ** rng.uniform(-3, 6) * 10.0 ** -rng.uniform(0, rng.choice([0.1, 3.0, 9.0]), 3)
    inv_w = tuple((1.0 / depths).tolist()) if is_perspective else (1.0, 1.0, 1.0)
    area = float(sum(edge_functions(corner, edges, x, y)))
    triangle = ExactTriangle(*corner, *edges[0], *edges[1], inv_w, area)
    return triangle, tuple(depths.tolist()), x, y, length


def test_a_run_of_depths_is_that_of_exact_interpolation():
    """And the line that it follows is off by no more than is said."""
    for is_perspective in (True, False):
        rng, n_line, worst = np.random.default_rng(5), 0, 0.0
        for _ in range(60):
            triangle, depths, x, y, length = random_run(rng, is_perspective)
            found, expected = np.empty(length, np.float32), np.empty(length, np.float32)
            put_run_of_depths(triangle, depths, is_perspective, x, y, found)
            fill_depths(triangle, depths, is_perspective, x, y, expected)
            assert np.array_equal(found, expected), f"{is_perspective=}, {triangle}"
            first, step, slack = line_of_run(triangle, depths, is_perspective, x, y)
            n_line += slack < np.inf
            for k in {0, length // 2, length - 1} if slack < np.inf else ():
                exact = mean_depth(triangle, depths, corner_weights(triangle, x + k, y), is_perspective)
                depth = 1.0 / (first + k * step) if is_perspective else first + k * step
                worst = max(worst, abs(depth - exact) / (depth * slack if is_perspective else slack))
        assert n_line > 40 and 0.01 < worst < 1, f"{n_line} lines, {worst:.3f} of what is said"


def test_faces_are_those_of_the_file():
    """The nearest face at each sample; parts of a clipped face carry its number."""
    rng, screen = np.random.default_rng(2), plain_screen(True, DEPTHS)
    triangles, depth = (
        random_triangles(rng, 25, SIZE, 25.0),
        np.repeat(rng.uniform(*DEPTHS, (25, 1)), 3, axis=1),
    )
    nearest, expected = np.full(SIZE[::-1], np.inf), np.full(SIZE[::-1], -1)
    for face in range(25):
        rows, columns, _ = covered(triangles[face], SIZE)
        wins = depth[face, 0] < nearest[rows, columns]
        nearest[rows[wins], columns[wins]], expected[rows[wins], columns[wins]] = depth[face, 0], face
    normals = unit_normals(rng, 25)
    out, workspace, n_covered = write(triangles, depth, normals, screen)
    visibility = workspace.visibility
    assert (visibility.entries == CLEAR).all(), "the band isn't clear for the next one"
    assert not differences(visibility.left, NO_START) and not differences(visibility.right, NO_END)
    assert not differences(out.face, expected) and n_covered == (expected >= 0).sum() > 1000
    loaded = (np.arange(25) // 3 + 100).astype(np.uint32)
    out, _, _ = write(triangles, depth, normals, screen, sources=loaded)
    assert not differences(out.face, np.where(expected >= 0, expected // 3 + 100, -1))


def test_normals_look_to_the_viewer():
    """By the winding, or the other way round where the file's normals contradict it; no length stays none."""
    screen, triangle = plain_screen(True, DEPTHS), np.array([[1000, 500], [5000, 15000], [20000, 900]])
    normals = np.full((1, 3, 3), [0.0, 0.6, 0.8])
    for turn, is_inverted, sign in ((1, 0, 1), (1, 1, -1), (-1, 0, -1), (-1, 1, 1)):
        out, _, _ = write([triangle[::turn]], np.full((1, 3), 2.0), normals, screen, is_inverted=[is_inverted])
        assert np.abs(out.normal[out.face == 0] - sign * normals[0, 0]).max() <= 2.0**-24
    out, _, n_covered = write([triangle], np.full((1, 3), 2.0), 0 * normals, screen)
    assert n_covered > 1000 and not differences(out.normal, 0)
