"""Check that nothing is lost with the clusters that a view skips: against all triangles, in integers."""

import numpy as np
from helpers.pinhole import SHADINGS
from helpers.pixels import skewed
from helpers.stages import SERIAL, screen_of

import rasterizer as rz
from bench.scenes import icosphere, torus
from rasterizer.geometry import clusters as c
from rasterizer.pipeline.clusters import find_seen
from rasterizer.pipeline.cull import Grid, find_visible
from rasterizer.pipeline.transform import OUTSIDE, transform

SIZE = (64, 48)


def with_faults(vertices, faces):
    """The same mesh, every second cluster wound the other way, some corners not finite, some triangles degenerate."""
    vertices, faces = np.array(vertices, float), np.array(faces)
    is_turned = np.arange(len(faces)) // c.CLUSTER % 2 == 1
    faces[is_turned] = faces[is_turned][:, ::-1]
    faces[5 * c.CLUSTER + 3 :: 9 * c.CLUSTER, 1] = faces[5 * c.CLUSTER + 3 :: 9 * c.CLUSTER, 0]
    bad = faces[2 * c.CLUSTER :: 11 * c.CLUSTER, 0]
    vertices[bad, 0] = np.resize([np.nan, np.inf, -np.inf], len(bad))
    return vertices, faces


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


def arrays_of(mesh):
    """Positions, index columns and clusters of (vertices, faces)."""
    positions, columns = (
        np.ascontiguousarray(np.array(values, dtype).T) for values, dtype in zip(mesh, (float, np.uint32), strict=True)
    )
    return positions, columns, c.make_clusters(positions, columns, SERIAL)


def test_what_is_skipped_covers_no_sample():
    """For every view the triangles of seen clusters that are visible are all that are, with the vertices they need;
    counts of what is culled and clipped are right."""
    for mesh in (icosphere(3), torus(48, 24), with_faults(*icosphere(4))):
        positions, columns, clusters = arrays_of(mesh)
        n_skipped = n_culled = n_clipped = 0
        for screen in views(np.random.default_rng(len(mesh[1])), 60):
            with np.errstate(all="ignore"):
                here, _ = transform(positions, screen, SERIAL)
            [whole] = find_visible(columns, here, Grid(*SIZE, 16), True, SERIAL)
            seen = find_seen(clusters, positions.shape[1], screen, SIZE, True)
            [rest] = find_visible(columns, here, Grid(*SIZE, 16), True, SERIAL, seen.clusters)
            assert rest.faces.tobytes() == whole.faces.tobytes() and (rest.histogram == whole.histogram).all(), screen
            assert rest.n_culled + seen.n_culled <= whole.n_culled, screen
            is_outside = (here.x[columns] == OUTSIDE).all(axis=0)
            is_outside[seen.faces] = False
            assert seen.n_clipped == is_outside.sum(), f"{seen.n_clipped} != {is_outside.sum()}, {screen}"
            needed = np.zeros(positions.shape[1], bool)
            for start, end in seen.vertex_runs or [(0, positions.shape[1])]:
                needed[start:end] = True
            assert needed[columns[:, seen.faces]].all(), screen
            n_skipped += columns.shape[1] - len(seen.faces)
            n_culled, n_clipped = n_culled + seen.n_culled, n_clipped + seen.n_clipped
        assert n_skipped > 5000 and n_clipped > 100 and n_skipped > n_culled + n_clipped, (
            n_skipped,
            n_culled,
            n_clipped,
        )


def test_a_few_kinds_of_views_skip_what_they_should():
    """Not only safe, but of use."""
    positions, columns, clusters = arrays_of(icosphere(5))

    def share(camera, cull_back, near=1e-3):
        screen = screen_of(camera.view(), camera.projection((512, 512)), (near, 99.0))
        return len(find_seen(clusters, positions.shape[1], screen, (512, 512), cull_back).faces) / columns.shape[1]

    outside = rz.Camera.perspective((0, 0, 3), fov=50)
    assert share(outside, False) == 1.0 and share(outside, True) < 0.5
    assert share(rz.Camera.orthographic((0, 0, 3), height=2.2), True) < 0.65
    assert share(rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=60), False) < 0.35
    assert share(rz.Camera.perspective((0, 0, 3), (0, 0, 9), fov=60), False) == 0.0
    assert share(outside, False, near=3.0) < 0.65


def test_pictures_are_the_same_to_the_last_bit_with_and_without_clusters():
    """A mesh, and the same one beside another that isn't seen: together they have enough triangles for clusters."""
    names, (vertices, faces) = ("color", "rgb", "depth", "face", "normal"), icosphere(4)
    checks = rz.Texture(np.random.default_rng(0).uniform(0, 1, (8, 8, 3)))
    looks = rz.Material(diffuse=(0.8, 0.3, 0.2)), rz.Material(texture=checks), rz.Material(opacity=0.5)
    views = (rz.Camera.perspective((0.4, 1.2, 3.0), fov=40, near=0.1, far=9),
             rz.Camera.perspective((0.9, 0.1, 0.2), (0.0, 0.3, -0.5), fov=100, near=0.1, far=9),
             rz.Camera.orthographic((1.0, 2.0, 3.0), height=1.3, near=0.1, far=9))  # fmt: skip
    lights = rz.AmbientLight(0.2), rz.DirectionalLight((-0.3, -0.5, -0.8), 0.7)
    for k, camera in enumerate(views):
        mesh = rz.Mesh(vertices, faces, uv=vertices[:, :2], material=looks[k])
        unseen = rz.Mesh(vertices + (0, -60, 0), faces, uv=vertices[:, :2], material=looks[k])
        assert len(faces) < c.LEAST_FACES < 2 * len(faces)
        for shading in SHADINGS:
            options = {
                "shading": shading,
                "cull": "none" if k == 1 else "back",
                "outputs": names,
                "threads": 2,
                "tolerance": 0,
            }
            plain, frame = (
                rz.render(rz.Scene(meshes, lights, camera), SIZE, **options) for meshes in ([mesh], [mesh, unseen])
            )
            for name in names:
                is_same = getattr(frame, name).tobytes() == getattr(plain, name).tobytes()
                assert is_same, f"{name} of view {k}, {shading}"
            assert frame.stats.covered == plain.stats.covered > 100, f"view {k}, {shading}"
