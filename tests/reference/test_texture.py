"""Check the reference's textures: texels by hand, a checkerboard in perspective, levels of detail in closed form."""

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.pinhole import QUAD, SHADINGS, at_pixel, draw, sample_rays, sheet_camera

from rasterizer.reference.textures import compute_mip_level, sample_texture
from rasterizer.scene.lights import AmbientLight, DirectionalLight, PointLight
from rasterizer.scene.material import Material
from rasterizer.scene.texture import Texture

UV = np.array([[0.0, 1], [1, 1], [1, 0], [0, 0]])  # of the corners of `sheet`: the picture upright, once
ROWS = np.random.default_rng(7).random((3, 4, 3)).astype(np.float32)  # a picture of 4 x 3 texels
STILL = np.zeros((1, 2, 2))


def sheet(size, is_perspective=True):
    """The corners of a sheet that fills the picture exactly, from the upper left one clockwise."""
    width, height = size
    places = ((0, 0), (width, 0), (width, height), (0, height))
    return [at_pixel(size, *place, 2.0, is_perspective) for place in places]


def painted():
    """A material that shows a texture as it is under the light of `draw`."""
    return Material(ambient=1.0, diffuse=0.0, specular=0.0, texture=Texture(ROWS, "nearest", "repeat"))


def at(texture, u, v):
    """Look up a single point, magnified."""
    return sample_texture(texture, np.array([[u, v]], float), STILL)[0]


# ── texels ──────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("shading, is_perspective", [("flat", True), ("gouraud", False), ("phong", True)])
def test_a_sheet_shows_its_texels(shading, is_perspective):
    camera = None if is_perspective else sheet_camera(6)
    corners = sheet((8, 6), is_perspective=is_perspective)
    picture = draw(corners, QUAD, (8, 6), camera=camera, material=painted(), shading=shading, uv=UV)
    assert not differences(picture.color, np.repeat(np.repeat(ROWS, 2, axis=0), 2, axis=1))
    assert not differences(picture.alpha, 1)
    per_corner = draw(corners, QUAD, (8, 6), camera=camera, material=painted(), shading=shading, uv=UV[QUAD])
    assert not differences(per_corner.color, picture.color)


def test_wraps():
    line = np.arange(4.0, dtype=np.float32).reshape(1, 4)
    outside = np.arange(-5, 9)
    for wrap, expected in (
        ("repeat", [3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0]),
        ("clamp", [0, 0, 0, 0, 0, 0, 1, 2, 3, 3, 3, 3, 3, 3]),
        ("mirror", [3, 3, 2, 1, 0, 0, 1, 2, 3, 3, 2, 1, 0, 0]),
    ):
        across, down = Texture(line, "nearest", (wrap, "clamp")), Texture(line.T[::-1], "nearest", ("clamp", wrap))
        assert [at(across, (i + 0.5) / 4, 0.5)[0] for i in outside] == expected, wrap
        assert [at(down, 0.5, (i + 0.5) / 4)[0] for i in outside] == expected, wrap


def test_bilinear_is_the_mean_of_four():
    texture = Texture(ROWS, "bilinear", "clamp")
    between = (ROWS[1, 1] + ROWS[1, 2]) / 2  # columns 1 and 2, amidst row 1
    assert not deviations(at(texture, 0.5, 0.5)[:3], between)
    assert not deviations(at(texture, 2 / 4, 2 / 3)[:3], ROWS[:2, 1:3].mean(axis=(0, 1)))
    assert not deviations(at(texture, 0.0, 0.0)[:3], ROWS[2, 0])
    # an eighth of a texel right of the centre of column 3: the neighbour is column 0, 3 or 3
    u = (3.5 + 0.125) / 4
    for wrap, neighbour in (("repeat", 0), ("clamp", 3), ("mirror", 3)):
        expected = 0.875 * ROWS[1, 3] + 0.125 * ROWS[1, neighbour]
        assert np.allclose(at(Texture(ROWS, "bilinear", wrap), u, 0.5)[:3], expected), wrap


def test_colors_are_interpolated_with_their_alpha_as_weight():
    image = np.array([[[1, 0, 0, 1.0], [0, 1, 0, 0.25]]], np.float32)
    assert not deviations(at(Texture(image, "bilinear", "clamp"), 0.5, 0.5), (0.8, 0.2, 0, 0.625))


# ── perspective ─────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("samples, first", [(1, -3.0), (4, 1.0)])
def test_the_mip_level_of_a_slanted_plane(samples, first):
    # `first` is the depth where the floor begins: before the eye, or behind it, to be clipped. The floor is that above,
    # with a picture whose value is its level: u = (x/8 + ½), v = (depth - 1)/8, both in perspective;
    # depth = 1/s for the slope s below the horizon, so dv/ds = -depth²/8 and du/dx = depth/8 for each unit of the
    # screen
    size, per_axis = (64, 48), round(samples**0.5)
    floor = np.array([(-4, -1, -first), (4, -1, -first), (4, -1, -9), (-4, -1, -9)])
    uv = np.array([[0.0, (first - 1) / 8], [1, (first - 1) / 8], [1, 1], [0, 1]])
    texture = Texture(np.zeros((64, 256), np.float32))
    levels = tuple(np.full((*level.shape[:2], 4), (k, k, k, 1), np.float32) for k, level in enumerate(texture.pyramid))
    object.__setattr__(texture, "pyramid", levels)
    material = Material(ambient=1.0, diffuse=0.0, specular=0.0, texture=texture)
    picture = draw(floor, [[0, 1, 2], [0, 2, 3]], size, material=material, uv=uv, samples=samples)
    fine = (size[0] * per_axis, size[1] * per_axis)
    x, y, _ = np.moveaxis(sample_rays(fine), -1, 0)
    with np.errstate(divide="ignore"):
        depth = -1 / y
    step = 2 / fine[1]  # of a sample, on the screen at depth 1
    across = depth / 8 * step * 256
    down = np.hypot(x * depth**2 / 8 * step * 256, depth**2 / 8 * step * 64)  # x·depth moves too where depth does
    expected = np.clip(np.log2(np.maximum(across, down)), 0, 8)
    expected = expected.reshape(size[1], per_axis, size[0], per_axis).mean(axis=(1, 3))
    is_whole = (picture.alpha == 1) & (picture.face >= 0)
    assert is_whole.sum() > 700 and expected[is_whole].max() > 4 and np.ptp(picture.color[is_whole, 0]) > 2
    # vertices are rounded to 1/256 px: where the floor is far, that moves the depth by up to 9/24/512 of itself
    np.testing.assert_allclose(picture.color[is_whole, 0], expected[is_whole], atol=0.01)


def test_levels_are_mixed_and_end():
    texture = Texture(np.random.default_rng(3).random((8, 8, 3)).astype(np.float32))
    uv = np.array([[0.3, 0.6]])
    by_level = [sample_texture(Texture(level, "bilinear"), uv, STILL)[0] for level in texture.pyramid]
    for texels, level in ((0.25, 0), (1.0, 0), (2.0, 1), (2.0**1.25, 1.25), (4.0, 2), (8.0, 3), (100.0, 3)):
        steps = np.array([[[0, texels / 8], [0.1 * texels / 8, 0]]])
        low, part = int(level), level % 1
        expected = (1 - part) * by_level[low] + part * by_level[min(low + 1, 3)]
        assert np.allclose(sample_texture(texture, uv, steps)[0], expected), texels
        assert compute_mip_level(texture, steps)[0] == pytest.approx(level)


# ── light ───────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("shading", SHADINGS)
def test_the_texture_multiplies_the_diffuse_part_alone(shading):
    coefficients = {"ambient": 0.3, "diffuse": 0.5, "specular": 0.4, "shininess": 3, "emissive": 0.1}
    lights = (AmbientLight(0.5), DirectionalLight((0.3, 0.1, -1), (1.0, 0.9, 0.8)), PointLight((0.2, 0.3, 0.0), 0.4))
    options = {"lights": lights, "shading": shading, "uv": UV}
    corners, colors = sheet((8, 6)), np.random.default_rng(2).random((4, 3))

    def color(**changes):
        material = Material(**(coefficients | changes))
        return draw(corners, QUAD, (8, 6), material=material, colors=colors, **options).color

    specular = color(ambient=0.0, diffuse=0.0)
    diffuse = color(specular=0.0, emissive=0.0)
    texels = np.repeat(np.repeat(ROWS, 2, axis=0), 2, axis=1)
    assert specular.min() > 0.1 and diffuse.max() > 0.1
    np.testing.assert_allclose(color(texture=Texture(ROWS, "nearest")), diffuse * texels + specular, atol=1e-14)
