"""Depth cueing: against its formula by the depth buffer, against the judge, and two parallel surfaces that it parts."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.against_reference import EXACT, assert_matches_reference
from helpers.pinhole import octasphere
from helpers.raster import ROOT
from helpers.refusals import assert_refused

import rasterizer as rz
from rasterizer.engine.plan import make_plan
from rasterizer.engine.scene_tables import SceneTables
from rasterizer.errors import SceneError
from rasterizer.options import Options

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


@pytest.mark.parametrize(
    ("camera", "shading"), [("perspective", "gouraud"), ("orthographic", "phong"), ("perspective", "flat")]
)
def test_pictures_agree_with_the_judge(camera, shading):
    opaque, clear = scene(camera), scene(camera, opacity=0.5)
    for tolerance in (0, 1 / 4096):
        budget = max(EXACT, tolerance)
        assert_matches_reference(opaque, SIZE, budget, ignored=0.01, shading=shading, tolerance=tolerance, exposure=0.7)
    assert_matches_reference(clear, SIZE, EXACT, ignored=0.05, shading=shading, tolerance=0)
    assert_matches_reference(opaque, SIZE, EXACT, ignored=0.05, shading=shading, tolerance=0, samples=4)
    if shading != "flat":
        textured = scene(camera, texture=np.linspace(0, 1, 64).reshape(8, 8))
        assert_matches_reference(textured, SIZE, EXACT, ignored=0.01, shading=shading, tolerance=0, far=0.01)


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


def test_two_parallel_surfaces_of_one_material_are_told_apart():
    """A directional light gives both the same intensity, to the bit; attenuation or a cue parts them, as the formulas
    say."""
    flat = rz.load(ROOT / "models" / "parallel.json")
    near, far = (15, 20), (32, 10)  # pixels (x, y) of both squares

    def seen(shown):
        frame = rz.render(shown, (40, 30), shading="phong", tolerance=0, outputs=("color", "depth"))
        return [(frame.color[y, x, 0], frame.depth[y, x]) for x, y in (near, far)]

    (a, near_depth), (b, far_depth) = seen(flat)
    assert a == b > 0.5 and near_depth == pytest.approx(6) and far_depth == pytest.approx(8)
    (a, _), (b, _) = seen(replace(flat, depth_cue=3))
    assert a == pytest.approx(0.64 * 3 / 9, abs=1e-6) and b == pytest.approx(0.64 * 3 / 11, abs=1e-6)
    # A far lamp on the axis, so that the cosine is 1 to the digits that are compared.
    lamp = rz.PointLight((0, 0, 10_000), 10_000, "1/(d+2)", amplify=True)
    (a, _), (b, _) = seen(replace(flat, lights=[lamp]))
    assert a == pytest.approx(0.8 * 10_000 / 10_002, rel=1e-6) and b == pytest.approx(0.8 * 10_000 / 10_004, rel=1e-6)


@BOTH
def test_depths_of_entries_fade_within_the_bound(camera):
    """The default tolerance reads depths from entries; tolerance 0 from exact records. The second cue begins far away
    for its scale, so that rounding counts most."""
    for cue in (CUE, rz.DepthCue(0.1, 3.0, (0.2, 0.4, 0.9))):
        shown = scene(camera, cue)
        fast, exact = (rz.render(shown, SIZE, shading="phong", tolerance=t, samples=1) for t in (Options.tolerance, 0))
        plan = fast.stats.plan
        assert plan.dtype == "float32" and plan.paths.exact < sum(plan.paths)
        error, bound = np.abs(fast.color - exact.color).max(), fast.stats.error_bound + exact.stats.error_bound
        assert error <= bound, f"{error:.3g} > {bound:.3g}"
    steep = scene("perspective", rz.DepthCue(1e-3, 3.0))
    assert rz.render(steep, SIZE, samples=1).stats.plan.dtype == "float64"


def test_grey_pictures_keep_one_channel_and_others_pay_nothing():
    def planned(cue, **material):
        shown = scene(depth_cue=cue, **material)
        return make_plan(SceneTables(replace(shown, meshes=shown.meshes[:1]), Options()), Options())

    assert planned(0.5).n_channel == planned(rz.DepthCue(1, color="gray")).n_channel == 1
    assert planned(CUE).n_channel == 3
    assert planned(None).cue is None and planned(None).dtype == np.float32
    assert planned(rz.DepthCue(1, color=5.0)).bound == 5.0
    tint = {"diffuse": (0.8, 0.4, 0.2), "specular": 0}
    assert planned(rz.DepthCue(1, 0, (0.4, 0.2, 0.1)), **tint).n_channel == 1


def test_forms_and_refusals():
    assert scene(depth_cue=2).depth_cue == rz.DepthCue(2.0, 0.0, 0.0)
    wrong = [(0,), (-1,), ("far",), (1, -1), (1, 0, "nocolour"), (np.inf,)]
    assert_refused(lambda given: rz.DepthCue(*given), [(each, "depth cue's") for each in wrong], SceneError)
    with pytest.raises(SceneError, match="a DepthCue, a number"):
        scene(depth_cue="thick")
