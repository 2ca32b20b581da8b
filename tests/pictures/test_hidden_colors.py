"""Of the colours of clear texels nothing is seen, by any filter, mip level, shading and background."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import differences

import rasterizer as rz
from rasterizer import reference
from rasterizer.scene.texture import FILTERS, WRAPS

CARD = rz.Mesh(
    [(-1, -1, 0), (1, -1, 0), (1, 1, 0.4), (-1, 1, 0.4)],
    [(0, 1, 2, 3)],
    uv=[(-0.4, 0), (1.7, 0), (1.7, 1.6), (-0.4, 1.6)],
)
LIGHTS = [rz.AmbientLight(0.3), rz.DirectionalLight((0.3, -0.2, -1))]


def card_of(image, filter, wrap, **material):
    texture = rz.Texture(image, filter=filter, wrap=wrap)
    return replace(CARD, material=rz.Material(diffuse=1.0, specular=0.3, texture=texture, **material))


def holed(seed, as_floats):
    """Two pictures that differ in the colours of clear texels alone."""
    rng = np.random.default_rng(seed)
    size = tuple(rng.integers(1, 40, 2))
    image = rng.integers(0, 256, (*size, 4), np.uint8)
    image[..., 3] = rng.choice([0, 0, 255, 255, 90], size)
    other = image.copy()
    other[image[..., 3] == 0, :3] = rng.integers(0, 256, 3)
    return [each / np.float32(255) if as_floats else each for each in (image, other)]


@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
def test_pictures_are_the_same_whatever_clear_texels_hold(shading):
    rng = np.random.default_rng(len(shading))
    for case in range(12):
        images, filter, wrap = holed(case, case % 3 == 0), FILTERS[case % 3], WRAPS[case // 3 % 3]
        camera = rz.Camera.perspective((0.2, -0.4, float(rng.choice([2, 9, 60]))), fov=40)
        options = {"shading": shading, "samples": (1, 4)[case % 2], "tolerance": (0, 1 / 4096)[case // 2 % 2]}
        background = (None, "white")[case % 2]
        scenes = [rz.Scene(card_of(each, filter, wrap), LIGHTS, camera, background=background) for each in images]
        frames = [rz.render(scene, (60, 44), outputs=("color", "rgb"), **options) for scene in scenes]
        assert not differences(frames[0].color, frames[1].color), f"{case}: {filter} {wrap} {options}"
        judged = [reference.render(scene, (60, 44), shading=shading, samples=options["samples"]) for scene in scenes]
        assert not differences(judged[0].color, judged[1].color)
        error = np.abs(frames[0].color - judged[0].color) * judged[0].alpha[..., None]
        assert error.max() <= frames[0].stats.error_bound + 1e-6, f"{case}: {error.max():.3g}"


def test_a_green_disc_on_white_has_no_fringe():
    """Where it is half covered it is half green, half white: green is full everywhere."""
    y, x = np.mgrid[-1:1:64j, -1:1:64j]
    image = np.zeros((64, 64, 4), np.uint8)
    image[x * x + y * y < 0.6] = (0, 255, 0, 255)
    for filter in FILTERS:
        card = card_of(image, filter, "clamp")
        card = replace(card, material=replace(card.material, specular=0.0, ambient=1.0, diffuse=0.0))
        scene = rz.Scene(card, rz.AmbientLight(1.0), rz.Camera.perspective((0, 0, 3), fov=40), background="white")
        for size in (20, 300):
            assert rz.render(scene, (size, size)).rgb[..., 1].min() == 255, f"{filter} at {size}"


def test_a_picture_that_was_halved_shows_none_either():
    for as_floats in (False, True):
        images = [rz.Texture(each).halved(1).image for each in holed(5, as_floats)]
        visible = images[0][..., 3] > 0
        assert not differences(images[0][visible], images[1][visible])
