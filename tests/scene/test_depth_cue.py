"""Depth cueing: against its formula by the depth buffer, against the judge, and two parallel surfaces that it parts."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.pinhole import octasphere
from helpers.refusals import assert_refused

import rasterizer as rz
from rasterizer.errors import SceneError

SIZE = (32, 26)
CUE = rz.DepthCue(0.8, 2.5, (0.1, 0.2, 0.5))
CAMERAS = {
    "perspective": rz.Camera.perspective((0.5, 1, 4)),
    "orthographic": rz.Camera.orthographic((0.5, 1, 4), height=2.5),
}
BOTH = pytest.mark.parametrize("camera", CAMERAS)


def scene(camera="perspective", depth_cue=CUE, **material):
    """A ball before a wall that reaches past the near plane."""
    vertices, faces = octasphere(2)
    wall = rz.Mesh([[-3, -1, -3], [3, -1, -3], [3, -0.8, 5], [-3, -0.8, 5]], [[0, 1, 2, 3]])
    uv = vertices[:, :2] / 2 + 0.5 if "texture" in material else None
    ball = rz.Mesh(vertices, faces, uv=uv, material=rz.Material(**material))
    return rz.Scene([ball, wall], camera=CAMERAS[camera], depth_cue=depth_cue)


@BOTH
def test_it_is_the_formula_of_the_depth_buffer(camera):
    shown = scene(camera)
    options = {"shading": "phong", "tolerance": 0, "outputs": ("color", "depth"), "samples": 1}
    cued, plain = rz.render(shown, SIZE, **options), rz.render(replace(shown, depth_cue=None), SIZE, **options)
    is_seen = np.isfinite(cued.depth)
    share = (0.8 / (0.8 + np.maximum(cued.depth.astype(float) - 2.5, 0)))[..., None]
    expected = share * plain.color + (1 - share) * np.array(CUE.color)
    error = np.abs(cued.color - expected)[is_seen].max()
    assert error < 3e-7, f"{error:.3g} > 3e-7"
    assert (cued.color[~is_seen] == plain.color[~is_seen]).all(), "the background has faded"


def test_forms_and_refusals():
    assert scene(depth_cue=2).depth_cue == rz.DepthCue(2.0, 0.0, 0.0)
    wrong = [(0,), (-1,), ("far",), (1, -1), (1, 0, "nocolour"), (np.inf,)]
    assert_refused(lambda given: rz.DepthCue(*given), [(each, "depth cue's") for each in wrong], SceneError)
    with pytest.raises(SceneError, match="a DepthCue, a number"):
        scene(depth_cue="thick")
