"""Without perspective the depth of a sample errs by a length, whatever its distance: checked by fractions."""

from fractions import Fraction

import numpy as np
import pytest

import rasterizer as rz
from rasterizer import reference
from rasterizer.engine import intensity_bounds
from rasterizer.engine.coding import scale_depths
from rasterizer.engine.depth_range import fit_screen
from rasterizer.engine.error_bounds import LEAST_SHARE, Surroundings, frame_error, straight_rounding
from rasterizer.engine.rounding import DOUBLE
from rasterizer.pipeline.transform import compute_z


@pytest.mark.parametrize("seed", range(8))
def test_depths_of_means_err_by_no_more_than_is_said(seed):
    """Corners anywhere in the range of depths, weights that are whole numbers: as `mean_depth` computes them."""
    rng, worst = np.random.default_rng(seed), 0.0
    for _ in range(150):
        eye = rng.normal(size=3) * 10.0 ** rng.uniform(-3, 3)
        camera = rz.Camera.orthographic(eye, eye + rng.normal(size=3), height=2.0)
        view = camera.view()
        spread = 10.0 ** rng.uniform(-2, 4)
        points = view.eye + rng.normal(size=(3, 3)) * spread + view.forward * 4 * spread
        furthest = float(np.linalg.norm(points - view.eye, axis=1).max())
        depths = (points - view.eye) @ view.forward
        if depths.min() <= 0.0:
            continue
        nearest = float(depths.min()) * rng.choice([1.0, 2.0**-20])
        screen = fit_screen(view, camera.projection((64, 48)), (nearest, furthest), np.inf, None, (64, 48))
        line = scale_depths(screen)
        found = [line.depth_offset + line.depth_scale * float(compute_z(float(depth), screen)) for depth in depths]
        straight = view.eye.tolist(), view.forward.tolist()
        weights = rng.integers(1, 2**40, 3)
        q = weights.astype(float)
        mean = (q[0] * found[0] + q[1] * found[1] + q[2] * found[2]) / (q[0] + q[1] + q[2])
        exact = [
            sum((Fraction(p) - Fraction(e)) * Fraction(f) for p, e, f in zip(point, *straight, strict=True))
            for point in points.tolist()
        ]
        true = sum(int(w) * d for w, d in zip(weights, exact, strict=True)) / int(weights.sum())
        worst = max(worst, float(abs(Fraction(mean) - true)) / straight_rounding(furthest))
    assert 0.001 < worst <= 1.0, f"{worst:.3g} of the bound"


def test_a_lamp_next_to_the_eye_feels_it():
    """A lamp 2^-19 of the range of depths from the eye: the shift turns its light by as much as it is near."""
    lamp, furthest = rz.PointLight((0, 0, 0), 1.0), 1.0
    material = rz.Material(diffuse=1.0, specular=0.0)
    reflected = intensity_bounds.compute_reflected((material,), (lamp,), np.zeros(3), 1.0)
    clearance = 2.0 * LEAST_SHARE * furthest
    around = Surroundings(furthest, np.full((1, 1), clearance), 1.0, True, eye_distances=np.array([clearance]))
    before, after = (
        float(frame_error(reflected, around._replace(depth_shift=shift).rounded(), DOUBLE)[0])
        for shift in (0.0, straight_rounding(furthest))
    )
    assert after - before >= 0.9 * straight_rounding(furthest) / clearance, f"{before:.3g}, {after:.3g}"
    assert around._replace(depth_shift=1e-9).key() != around.key()


def test_a_picture_from_next_to_a_lamp_keeps_its_bound():
    """Without perspective, with tolerance 0: a floor from under the eye to far away."""
    floor = rz.Mesh([[-4, -2e-6, 1e-7], [4, -2e-6, 1e-7], [4, -2e-6, -8], [-4, -2e-6, -8]], [[0, 1, 2, 3]])
    camera = rz.Camera.orthographic((0, 0, 0), (0, -1, -2.0), height=1e-5)
    scene = rz.Scene(floor, [rz.PointLight((0, 1e-5, 0), 0.9)], camera)
    options = {"shading": "phong"}
    frame = rz.render(scene, (48, 36), tolerance=0.0, samples=1, **options)
    expected = reference.render(scene, (48, 36), **options)
    assert np.abs(frame.color - expected.color).max() <= frame.stats.error_bound + 2.0**-23
