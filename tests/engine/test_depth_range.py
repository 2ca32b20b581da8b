"""Depths at the ends of what float64 holds: drawn right, or refused."""

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.engine.depth_range import LEAST_EXTENT

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
FACES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
LIGHTS = (rz.AmbientLight(0.1), rz.DirectionalLight((-0.4, -0.5, -0.8), 0.8))


def draw(scale, **options):
    scene = rz.Scene([rz.Mesh(scale * CORNERS, FACES, crease_angle=0)], LIGHTS)
    return rz.render(scene, (64, 48), outputs=("color", "face"), tolerance=0, **{"samples": 1} | options)


@pytest.mark.parametrize("samples", [1, 16])
@pytest.mark.parametrize("power", [-479, -300, -100, 100, 300, 330])
def test_the_unit_of_a_scene_changes_nothing(power, samples):
    """A power of two is exact: the same picture, but for lights, whose rounding differs with the way they are taken."""
    usual, scaled = draw(1.0, samples=samples), draw(2.0**power, samples=samples)
    assert (usual.face == scaled.face).all() and (usual.alpha == scaled.alpha).all()
    assert np.abs(usual.color - scaled.color).max() <= 1e-6


@pytest.mark.parametrize("scale", [0.5 * LEAST_EXTENT, 1e-160, 1e-310, 5e-324])
def test_what_is_too_small_for_float64_is_refused(scale):
    with pytest.raises(rz.SceneError, match="scale the scene"):
        draw(scale)
