"""Check that nothing is lost with the clusters that a view skips: against all triangles, in integers."""

import numpy as np
import pytest
from helpers.pixels import skewed
from helpers.stages import SERIAL, screen_of

import rasterizer as rz
from bench.scenes import icosphere, torus
from rasterizer.geometry import clusters as c
from rasterizer.pipeline import clusters as stage
from rasterizer.pipeline.clusters import CLIPPED_AWAY, FACING_AWAY, SEEN, SKIPPED, find_seen, leaves_out, list_runs
from rasterizer.pipeline.cull import Grid, find_visible
from rasterizer.pipeline.transform import OUTSIDE, transform

SIZE = (64, 48)


def terrain(n, height):
    """A rough sheet of 2 n² triangles about the origin, y upwards."""
    z, x = np.mgrid[: n + 1, : n + 1]
    rng = np.random.default_rng(n)
    points = np.stack([x / n - 0.5, height * rng.uniform(-0.5, 0.5, x.shape), z / n - 0.5], axis=-1).reshape(-1, 3)
    corner = (z * (n + 1) + x)[:-1, :-1].ravel()
    quads = np.stack([corner, corner + n + 1, corner + n + 2, corner + 1], axis=1)
    return points, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def soup(n):
    """Triangles of all sizes and shapes, without neighbours; some without area."""
    rng = np.random.default_rng(n)
    points = rng.uniform(-1, 1, (n, 1, 3)) + rng.uniform(-1, 1, (n, 3, 3)) * 10.0 ** rng.uniform(-5, -0.3, (n, 1, 1))
    points[::17, 2] = points[::17, 1]
    points[1::17, 2] = 0.5 * (points[1::17, 0] + points[1::17, 1])
    return points.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)


def with_faults(vertices, faces):
    """The same mesh, every second cluster wound the other way, some corners not finite, some triangles degenerate."""
    vertices, faces = np.array(vertices, float), np.array(faces)
    is_turned = np.arange(len(faces)) // c.CLUSTER % 2 == 1
    faces[is_turned] = faces[is_turned][:, ::-1]
    faces[5 * c.CLUSTER + 3 :: 9 * c.CLUSTER, 1] = faces[5 * c.CLUSTER + 3 :: 9 * c.CLUSTER, 0]
    bad = faces[2 * c.CLUSTER :: 11 * c.CLUSTER, 0]
    vertices[bad, 0] = np.resize([np.nan, np.inf, -np.inf], len(bad))
    return vertices, faces


MESHES = {
    "sphere": lambda: icosphere(4),
    "torus": lambda: torus(96, 40),
    "terrain": lambda: terrain(48, 0.02),
    "soup": lambda: soup(3000),
    "faults": lambda: with_faults(*icosphere(4)),
    "slivers": lambda: (icosphere(4)[0] * (1.0, 1e-3, 1.0), icosphere(4)[1]),
}


def views(rng, n):
    """Cameras of all kinds: far, near, on the surface, inside, wide, narrow, parallel, with planes through the mesh."""
    for k in range(n):
        eye = rng.normal(size=3) * 10.0 ** rng.uniform(-1.5, 2.0)
        target = rng.uniform(-1, 1, 3) * rng.choice([0.1, 1.0, 3.0])
        distance = np.linalg.norm(target - eye)
        near, far = [(1e-3, np.inf), (0.3 * distance, 1.1 * distance), (1e-6, 0.8 * distance)][k % 3]
        if k % 4 == 0:
            camera = rz.Camera.orthographic(eye, target, height=10.0 ** rng.uniform(-1, 1.5))
        else:
            camera = rz.Camera.perspective(eye, target, fov=rng.choice([1.0, 30.0, 60.0, 120.0, 175.0]))
        if k % 4 == 1:
            camera = skewed(camera, SIZE, rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-2.0, 1.5))
        deepest = min(far, 1e3)
        yield screen_of(camera.view(), camera.projection(SIZE), (min(near, 0.5 * deepest), deepest), far)


def areas_of(vertices, faces):
    """Twice the signed areas of triangles on the screen, exact integers; clockwise is positive."""
    x, y = (np.asarray(column, np.int64)[faces] for column in (vertices.x, vertices.y))
    return (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])


@pytest.mark.parametrize("name", MESHES)
def test_what_is_skipped_covers_no_sample(name):
    """For every view: what faces away is clockwise once rounded, what lies beside the picture holds no sample, what is
    clipped away has no vertex on the screen. Counts stay what they are without clusters."""
    vertices, faces = MESHES[name]()
    positions, columns = np.ascontiguousarray(np.array(vertices, float).T), np.ascontiguousarray(faces.T, np.uint32)
    clusters = c.make_clusters(positions, columns, SERIAL)
    n = np.zeros(4, int)
    for screen in views(np.random.default_rng(len(name)), 150):
        with np.errstate(all="ignore"):
            here, _ = transform(positions, screen, SERIAL)
        fates = np.empty(clusters.shapes.shape[1], np.uint8)
        stage.decide_clusters(clusters.shapes, stage.make_view(screen, SIZE, True), fates)
        n += np.bincount(fates, minlength=4)
        fate_of_face = np.repeat(fates, c.CLUSTER)[: columns.shape[1]]
        is_outside = here.x[columns] == OUTSIDE
        assert is_outside[:, fate_of_face == CLIPPED_AWAY].all()
        assert not is_outside[:, (fate_of_face == FACING_AWAY) | (fate_of_face == SKIPPED)].any()
        away = columns[:, fate_of_face == FACING_AWAY]
        assert areas_of(here, away).min(initial=1) > 0
        grid = Grid(*SIZE, 16)
        [whole] = find_visible(columns, here, grid, False, SERIAL)
        lost = whole.faces[fate_of_face[whole.faces] == SKIPPED]
        assert len(lost) == 0, f"triangles {lost[:5]} lie in the picture and were skipped"
        [whole] = find_visible(columns, here, grid, True, SERIAL)
        seen = find_seen(clusters, positions.shape[1], screen, SIZE, True)
        [rest] = find_visible(columns, here, grid, True, SERIAL, seen.clusters)
        assert rest.faces.tobytes() == whole.faces.tobytes() and (rest.histogram == whole.histogram).all()
        assert rest.n_culled + seen.n_culled <= whole.n_culled
        assert seen.n_culled == away.shape[1] and seen.n_clipped == (fate_of_face == CLIPPED_AWAY).sum()
        needed = np.zeros(positions.shape[1], bool)
        for start, end in seen.vertex_runs or [(0, positions.shape[1])]:
            needed[start:end] = True
        assert needed[columns[:, seen.faces]].all()
    assert n[SEEN] > 0 and n[CLIPPED_AWAY] > 0, n
    assert n[SKIPPED] > 100 or name == "soup", n
    assert n[FACING_AWAY] > 100 or name in ("soup", "slivers", "torus"), n  # a strip round the tube looks to all sides


def test_rounding_turns_triangles_round_so_that_slack_is_needed():
    """Seen from so far that triangles are a few sub-pixels wide: some that face away are counter-clockwise once they
    are rounded, and none of these is in a cluster that was skipped."""
    vertices, faces = icosphere(5)
    positions, columns = np.ascontiguousarray(np.array(vertices, float).T), np.ascontiguousarray(faces.T, np.uint32)
    clusters = c.make_clusters(positions, columns, SERIAL)
    n_turned = n_skipped = 0
    for distance in 10.0 ** np.linspace(0.5, 3.5, 40):
        camera = rz.Camera.perspective((0.3 * distance, 0.1 * distance, distance), fov=20)
        screen = screen_of(camera.view(), camera.projection(SIZE), (0.1 * distance, 9 * distance))
        here, _ = transform(positions, screen, SERIAL)
        fates = np.empty(clusters.shapes.shape[1], np.uint8)
        stage.decide_clusters(clusters.shapes, stage.make_view(screen, SIZE, True), fates)
        corners = positions.T[columns.T] - screen.eye
        faces_away = np.einsum("ij,ij->i", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2]) > 0
        areas = areas_of(here, columns)
        is_skipped = np.repeat(fates == FACING_AWAY, c.CLUSTER)[: len(areas)]
        assert areas[is_skipped].min(initial=1) > 0
        n_turned += (faces_away & (areas <= 0)).sum()
        n_skipped += is_skipped.sum()
    assert n_turned > 1000 and n_skipped > 100_000


def test_a_mirrored_screen_culls_nothing_by_cones():
    vertices, faces = icosphere(3)
    positions, columns = np.ascontiguousarray(np.array(vertices, float).T), np.ascontiguousarray(faces.T, np.uint32)
    clusters = c.make_clusters(positions, columns, SERIAL)
    camera = rz.Camera.perspective((0, 0, 4))
    screen = screen_of(camera.view(), camera.projection(SIZE), (1.0, 9.0))
    assert find_seen(clusters, positions.shape[1], screen, SIZE, True).n_culled > 0
    mirrored = screen._replace(right=-screen.right)
    assert find_seen(clusters, positions.shape[1], mirrored, SIZE, True).n_culled == 0


def test_a_few_kinds_of_views_skip_what_they_should():
    """Not only safe, but of use."""
    vertices, faces = icosphere(5)
    positions, columns = np.ascontiguousarray(np.array(vertices, float).T), np.ascontiguousarray(faces.T, np.uint32)
    clusters = c.make_clusters(positions, columns, SERIAL)

    def share(camera, cull_back, near=1e-3):
        screen = screen_of(camera.view(), camera.projection((512, 512)), (near, 99.0))
        return len(find_seen(clusters, positions.shape[1], screen, (512, 512), cull_back).faces) / len(faces)

    outside = rz.Camera.perspective((0, 0, 3), fov=50)
    assert share(outside, False) == 1.0 and share(outside, True) < 0.5
    assert share(rz.Camera.orthographic((0, 0, 3), height=2.2), True) < 0.65
    assert share(rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=60), False) < 0.35
    assert share(rz.Camera.perspective((0, 0, 3), (0, 0, 9), fov=60), False) == 0.0
    assert share(outside, False, near=3.0) < 0.65


@pytest.mark.parametrize("n_vertex", [64, 6400, 6377])
def test_runs_hold_the_needed_blocks_and_close_short_gaps(n_vertex):
    rng, n_block = np.random.default_rng(n_vertex), -(-n_vertex // c.VERTEX_BLOCK)
    for density in (0.0, 0.02, 0.2, 1.0):
        is_needed = (rng.uniform(size=n_block) < density).astype(np.uint8)
        runs = list_runs(is_needed, n_vertex)
        covered = np.zeros(n_block * c.VERTEX_BLOCK, bool)
        for start, end in runs:
            assert start < end <= n_vertex and not covered[start:end].any()
            covered[start:end] = True
        assert covered[:n_vertex][np.repeat(is_needed, c.VERTEX_BLOCK)[:n_vertex] == 1].all()
        gaps = [b[0] - a[1] for a, b in zip(runs, runs[1:], strict=False)]
        assert all(gap > stage.SHORTEST_GAP * c.VERTEX_BLOCK for gap in gaps)
        assert (len(runs) == 0) == (not is_needed.any())


def test_a_view_leaves_out_what_lies_beside_the_picture_or_beyond_its_depths():
    """A cube of points whose outermost tenth, on each side, is in the picture or is not."""
    points = np.random.default_rng(0).uniform(-1, 1, (3, 5000))
    for make, depths, inside, outside in (
        (lambda value: rz.Camera.orthographic((0, 0, 5), height=value), (1.0, 99.0), 2.001, 1.8),
        (lambda value: rz.Camera.perspective((0, 0, value), fov=90), (0.1, 99.0), 2.001, 1.3),
        (lambda value: rz.Camera.orthographic((0, 0, value), height=9), (1.0, 99.0), 2.001, 1.8),
        (lambda value: rz.Camera.orthographic((0, 0, 5), height=9), (1.0, 5.8), None, None),
    ):
        for value, expected in ((inside, False), (outside, True)):
            camera = make(value)
            far = np.inf if value is not None or not expected else 5.8
            screen = screen_of(camera.view(), camera.projection((50, 50)), depths, far)
            assert leaves_out(points, screen, (50, 50)) == expected
    assert leaves_out(np.full((3, 10), np.nan), screen, (50, 50))
    assert not leaves_out(np.zeros((3, 1)), screen, (50, 50))


# ---------------------------------------------------------------- pictures


def cameras():
    """Views in which clusters are skipped for every reason."""
    yield rz.Camera.perspective((0.4, 1.2, 3.0), fov=40)
    yield rz.Camera.perspective((0.9, 0.1, 0.2), (0.0, 0.3, -0.5), fov=100)
    yield rz.Camera.perspective((0.0, 0.02, 0.0), (1.0, 0.0, 0.3), fov=175)
    yield rz.Camera.perspective((0.4, 1.2, 3.0), fov=40, near=2.9, far=3.4)
    yield rz.Camera.orthographic((1.0, 2.0, 3.0), height=1.3)


EVERY = ("color", "rgb", "depth", "face", "normal")


@pytest.mark.parametrize("cull", ["none", "back"])
@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
def test_pictures_are_the_same_to_the_last_bit_with_and_without_clusters(monkeypatch, shading, cull):
    parts = [icosphere(4), torus(48, 24), terrain(40, 0.05)]
    meshes = [rz.Mesh(*part, material=rz.Material(diffuse=color)) for part, color in zip(parts, np.eye(3), strict=True)]
    for camera in cameras():
        frames = []
        for least, n_thread in ((10**9, 1), (1, 1), (1, 3)):
            monkeypatch.setattr(c, "LEAST_FACES", least)
            frames.append(
                rz.render(rz.Scene(meshes, camera=camera), (70, 50), shading=shading, cull=cull, outputs=EVERY,
                          threads=n_thread)
            )  # fmt: skip
        plain = frames[0]
        for frame in frames[1:]:
            for name in EVERY:
                assert getattr(frame, name).tobytes() == getattr(plain, name).tobytes(), name
            assert frame.stats.clipped == plain.stats.clipped and frame.stats.drawn == plain.stats.drawn
            assert frame.stats.culled <= plain.stats.culled and frame.stats.covered == plain.stats.covered > 100


def test_transparent_textured_and_centred_polygons_are_the_same_with_clusters(monkeypatch):
    """What else reads the points that aren't lit: nothing of it may be seen."""
    vertices, faces = terrain(40, 0.05)
    quads = np.concatenate([faces[::2], faces[1::2, 2:]], axis=1)
    uv = vertices[:, [0, 2]] + 0.5
    checks = rz.Texture(np.random.default_rng(0).uniform(0, 1, (8, 8, 3)))
    meshes = [
        rz.Mesh(vertices, quads, uv=uv, material=rz.Material(texture=checks)),
        rz.Mesh(*icosphere(3), material=rz.Material(opacity=0.5)),
    ]
    for camera in cameras():
        frames = []
        for least in (10**9, 1):
            monkeypatch.setattr(c, "LEAST_FACES", least)
            frames += [
                rz.render(rz.Scene(meshes, camera=camera), (70, 50), shading=shading, cull="back", outputs=EVERY)
                for shading in ("gouraud", "phong")
            ]
        for plain, frame in zip(frames[:2], frames[2:], strict=True):
            assert all(getattr(frame, name).tobytes() == getattr(plain, name).tobytes() for name in EVERY)
