"""Cameras with skew: what is seen lies where K says, and all that is promised of a picture holds."""

from dataclasses import replace

import numpy as np
from helpers.campaign_scenes import Case
from helpers.pixels import skewed
from helpers.small_scenes import drawn

import rasterizer as rz

SIZE = (60, 44)
SUBPIXEL = 256
PLAIN = {"samples": 1, "cull": "none", "color_range": "clamp", "exposure": 0.0, "spectral": None}


def random_calibration(rng):
    """K with a skew of up to twice fx, R and t: the origin is about six units away, near the picture's middle."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    R = q * np.sign(np.diag(r))
    R = R if np.linalg.det(R) > 0 else -R
    fx, fy = rng.uniform(20, 120, 2)
    K = [[fx, fx * rng.uniform(-2, 2), rng.uniform(10, 50)], [0, fy, rng.uniform(5, 40)], [0, 0, 1]]
    return np.array(K), R, np.append(rng.uniform(-0.3, 0.3, 2), 6.0)


def pixels_of(points, K, R, t):
    """Where OpenCV sees points (..., 3), in pixels from the picture's corner."""
    uvw = (np.asarray(points, float) @ R.T + t) @ K.T
    return uvw[..., :2] / uvw[..., 2:] + 0.5


def covered_by(corners, size):
    """The samples that triangles (n, 3, 2) cover, by edge functions in whole numbers with the top-left rule."""
    y, x = np.mgrid[: size[1], : size[0]] * SUBPIXEL + SUBPIXEL // 2
    covered = np.zeros((size[1], size[0]), bool)
    for triangle in np.rint(np.asarray(corners) * SUBPIXEL).astype(np.int64):
        (ax, ay), (bx, by), (cx, cy) = triangle.tolist()
        if (bx - ax) * (cy - ay) < (cx - ax) * (by - ay):
            triangle = triangle[::-1]
        inside = np.ones_like(covered)
        for (ax, ay), (bx, by) in zip(triangle.tolist(), np.roll(triangle, -1, axis=0).tolist(), strict=True):
            is_kept = by < ay or (by == ay and bx > ax)  # a left edge goes up, a top edge to the right
            inside &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= (0 if is_kept else 1)
        covered |= inside
    return covered


def test_samples_are_covered_where_k_puts_the_triangles():
    for seed in range(10):
        check_covered_samples(np.random.default_rng(seed), seed)


def check_covered_samples(rng, seed):
    """Compare the samples that random triangles cover with edge functions over OpenCV's pixels."""
    matrices = random_calibration(rng)
    points = rng.normal(0, 1.5, (20, 3, 3)).clip(-5, 5)
    depth = (points @ matrices[1].T + matrices[2])[..., 2]
    points = points[(depth > 0.05).all(axis=1)]
    camera = rz.Camera.from_opencv(*matrices, SIZE, near=0.01)
    mesh = rz.Mesh(points.reshape(-1, 3), np.arange(3 * len(points)).reshape(-1, 3))
    frame = rz.render(rz.Scene(mesh, camera=camera), SIZE, shading="flat", outputs="mask")
    expected = covered_by(pixels_of(points, *matrices), SIZE)
    assert 0 < expected.sum() and (frame.mask == expected).all(), (
        f"seed {seed}: {(frame.mask != expected).sum()} samples"
    )


SCENES = drawn()


def skewed_case(name, lean, **options) -> Case:
    """A small scene, seen through a camera with skew, as one of the campaign."""
    scene, own = SCENES[name]
    camera = skewed(scene.camera_for(SIZE), SIZE, lean)
    return Case(0, 16, f"{name}, {lean}", replace(scene, camera=camera), SIZE, PLAIN | own | options)


def test_what_is_picked_lies_below_the_pointer():
    scene = skewed_case("many lights", 0.7).scene
    camera = scene.camera
    frame = rz.render(scene, SIZE, outputs=("face", "depth", "normal", "position"))
    K, R, t = camera.to_opencv(SIZE)
    n_seen = 0
    for x, y in ((3, 40), (30, 22), (31, 30), (55, 41), (20, 12), (44, 25)):
        picked = frame.pick(x, y)
        assert (picked is None) == (frame.face[y, x] < 0)
        if picked is None:
            continue
        n_seen += 1
        assert np.abs(pixels_of(picked.position, K, R, t) - (x + 0.5, y + 0.5)).max() <= 1 / 512 + 1e-4
        assert picked.face == frame.face[y, x]
    assert n_seen >= 4
