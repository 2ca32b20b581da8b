"""Check the exact buffers: depth against rational numbers, faces, normals, the clean-up; depths that packed samples
tell."""

from types import SimpleNamespace

import numpy as np
from helpers.stages import (
    covered,
    drawables_of,
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
    VisibleSurfaces,
    clear_band,
)
from rasterizer.pipeline.cull import Band
from rasterizer.pipeline.scan import scan_index
from rasterizer.pipeline.transform import compute_z

SIZE = (90, 70)
DEPTHS = (1.0, 40.0)
ALL = ("depth", "face", "normal")
NO_FACE = np.empty(0, np.uint32)


def write(triangles, depth, normals, screen):
    """Scan and write the buffers; return them, and how many samples are covered."""
    coding = plain_coding("exact", screen, 3, np.float64)
    workspace, _ = scan_alone(triangles, depth, normals, coding, screen, SIZE, run=scan_places)
    drawables = drawables_of(triangles, compute_z(np.asarray(depth, float), screen), normals[None])
    every = np.arange(len(triangles), dtype=np.uint32)
    surfaces = VisibleSurfaces(
        workspace.visibility, every, drawables, NO_FACE, coding.depths, screen.is_perspective, workspace.batch
    )
    out = SimpleNamespace()
    for name in ALL:
        buffer = BUFFER_TABLE[name].make(SIZE)
        buffer[...] = BUFFER_TABLE[name].empty
        BUFFER_TABLE[name].write(surfaces, Band(every, 0, SIZE[1]), buffer)
        setattr(out, name, buffer)
    return out, clear_band(workspace.visibility, SIZE[1])


def scan_places(band, drawables, _coding, block, visibility, *_):
    """`scan_index`, called as `scan` is."""
    scan_index(band, drawables, block, visibility)
    return 0, 0, 0, 0, -1


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
            out, n_covered = write([triangle], depth[None], normals, screen)
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
