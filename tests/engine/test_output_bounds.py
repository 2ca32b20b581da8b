"""`Stats.error_bounds` holds for every output, and says apart what shadow maps and texture filters add.

Random scenes hold it, output by output: tests/pictures/test_campaign.py."""

import json
import pickle
from itertools import product

import numpy as np
import pytest

import rasterizer as rz
from rasterizer import reference
from rasterizer.engine.bounds import ErrorBounds, FilterBound, bound_levels
from rasterizer.scene.color import srgb_from_linear

OUTPUTS = ("color", "depth", "face", "normal")
FLOOR = rz.Mesh([[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], [[0, 1, 2, 3]], material=rz.Material(diffuse=1.0))
PLATE = rz.Mesh([[-0.5, 1, 0.5], [0.5, 1, 0.5], [0.5, 1, -0.5], [-0.5, 1, -0.5]], [[0, 1, 2, 3]])


def test_each_output_that_is_asked_for_has_a_bound_and_no_other():
    scene = rz.Scene(FLOOR)
    asked = {
        ("rgb",): {"rgb"},
        ("color",): {"color", "rgb"},
        ("depth",): {"depth", "depth_share"},
        ("normal", "face"): {"normal", "face"},
        OUTPUTS: {"color", "rgb", "depth", "depth_share", "normal", "face"},
    }
    for outputs, names in asked.items():
        frame = rz.render(scene, (32, 24), outputs=outputs, samples=4, shading="gouraud")
        bounds = frame.stats.error_bounds
        assert set(bounds.as_json()) == names, outputs
        assert bounds.color in (None, frame.stats.error_bound) and bounds.face in (None, 0)
        assert pickle.loads(pickle.dumps(frame.stats)) == frame.stats
        json.dumps(bounds.as_json(), allow_nan=False)


def test_depths_without_perspective_have_a_share_only_where_none_is_0():
    shares = []
    for height in (3.0, 0.0):
        camera = rz.Camera.orthographic((0, height, 0), (0, height - 1, 0), (0, 0, 1), height=3)
        bounds = rz.render(
            rz.Scene(FLOOR, camera=camera), (8, 8), outputs="depth", shading="gouraud", samples=1
        ).stats.error_bounds
        shares.append(bounds.depth_share)
        assert np.isfinite(bounds.depth) and bounds.as_json()["depth_share"] in (None, bounds.depth_share)
    assert shares[0] == pytest.approx(2.0**-24, rel=1e-3) and shares[1] == np.inf


def test_bytes_are_no_further_off_than_an_intensity_lets_them():
    rng = np.random.default_rng(5)
    for color_range, error in product(("clamp", "global", "local"), (0.0, 1e-7, 1e-4, 1 / 4096, 1e-3, 0.02, 0.4)):
        true = rng.random((4000, 3)) ** 3 * (1.0 if color_range == "clamp" else 3.0)
        found = np.maximum(true + error * rng.uniform(-1, 1, true.shape), 0.0)
        levels = []
        for colors in (true, found):
            if color_range == "global":
                colors = colors / max(1.0, colors.max())
            elif color_range == "local":
                colors = colors / np.maximum(1.0, colors.max(axis=1, keepdims=True))
            levels.append(np.rint(255 * srgb_from_linear(np.clip(colors, 0, 1))))
        most, bound = np.abs(levels[0] - levels[1]).max(), bound_levels(error, color_range)
        assert most <= bound, f"{color_range}, {error}: {most} levels > {bound}"
        assert bound_levels(np.inf, color_range) == 255 and bound_levels(0.0, color_range) == 0


@pytest.mark.parametrize("kind", ["directional", "point", "spot", "area"])
def test_errors_lie_within_the_stated_distance_of_the_edges_of_shadows(kind):
    """A plate over a floor, lit from straight above: where its shadow ends, is known."""
    shadow, height = rz.Shadow(size=128, filter=3), 4.0
    light = {
        "directional": rz.DirectionalLight((0, -1, 0), 0.8, shadow=shadow),
        "point": rz.PointLight((0, height, 0), 0.8, shadow=shadow),
        "spot": rz.SpotLight((0, height, 0), (0, -1, 0), 0.8, outer=50.0, shadow=shadow),
        "area": rz.AreaLight((0, height, 0), (0.001, 0, 0), (0, 0, 0.001), 0.8, resolution=(1, 1), shadow=shadow),
    }[kind]
    scene = rz.Scene([FLOOR, PLATE], [light], rz.Camera.perspective((0, 1.5, 3.5), (0, 0, 0)))
    frame = rz.render(scene, (160, 120), shading="phong", outputs=("color", "face", "depth"), samples=1)
    (found,) = frame.stats.error_bounds.shadows
    expected = reference.render(scene, (160, 120), shading="phong")
    error = np.abs(frame.color - expected.color).max(axis=-1)
    edge = 0.5 * (1.0 if kind == "directional" else height / (height - 1.0))
    x, z = floor_points(scene, frame)
    beside = np.abs(np.maximum(np.abs(x), np.abs(z)) - edge)  # along a side of the map
    is_bad = (frame.face < 2) & (error > frame.stats.error_bound + 1e-7)
    assert is_bad.any() and 0.0 < found.texel <= found.near
    assert beside[is_bad].max() <= found.near, f"{beside[is_bad].max():.3g} > {found.near:.3g}"
    assert beside[is_bad].max() >= found.near / 8, "the bound says next to nothing"


def floor_points(scene, frame):
    """Return x and z (h, w) of what the pixels see, by their depths."""
    view, (width, height) = scene.camera.view(), frame.size
    projection = scene.camera.projection(frame.size)
    across = (np.arange(width) + 0.5 - projection.center_x) / projection.scale_x
    upward = (projection.center_y - np.arange(height) - 0.5) / projection.scale_y
    ray = across[None, :, None] * view.right + upward[:, None, None] * view.up + view.forward
    points = view.eye + np.where(np.isfinite(frame.depth), frame.depth, 0.0)[..., None] * ray
    return points[..., 0], points[..., 2]


@pytest.mark.parametrize("kind", ["nearest", "bilinear", "trilinear"])
def test_a_filter_is_no_further_from_the_average_than_is_said(kind):
    """Black and white checks, many of them a pixel: their average is grey."""
    image = (255 * (np.indices((64, 64)).sum(axis=0) % 2)).astype(np.uint8)
    floor = rz.Mesh(
        FLOOR.vertices, FLOOR.faces, uv=[[0, 0], [1, 0], [1, 1], [0, 1]],
        material=rz.Material(diffuse=0.9, ambient=0.9, texture=rz.Texture(image, filter=kind)),
    )  # fmt: skip
    scene = rz.Scene([floor, PLATE], [rz.AmbientLight(0.7)], rz.Camera.perspective((0, 3, 1), (0, 0, 0)))
    frame = rz.render(scene, (48, 48), outputs=("color", "face"), shading="gouraud", samples=1)
    ((name, most, near),) = frame.stats.error_bounds.filters
    error = np.abs(frame.color[frame.face == 0] - 0.5 * 0.9 * 0.7).max()
    assert (name, near > 0) == (kind, kind == "nearest")
    assert error <= most <= 0.9 * 0.7 * (1 + 1e-9) and (kind == "trilinear" or error > most / 4)


def test_what_is_infinite_is_no_number_in_json():
    bounds = ErrorBounds(color=np.inf, rgb=255, filters=(FilterBound("nearest", np.inf, 0.5),))
    expected = {"color": None, "rgb": 255, "filters": [{"filter": "nearest", "most": None, "near": 0.5}]}
    assert bounds.as_json() == expected
