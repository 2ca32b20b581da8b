"""Check how intensities become pixels: the box filter, backgrounds, ranges, and the clean-up."""

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.bands import encoding, fill, levels, run
from helpers.pairs import pairs

from rasterizer.pipeline.fragments import BATCH_SIZE
from rasterizer.pipeline.resolve import (
    BUCKET_SHIFT,
    LEVEL_TABLE,
    MIN_VALUE,
    RANGE_GLOBAL,
    RANGE_LOCAL,
    encode_picture,
    make_grid,
    resolve,
    srgb_thresholds,
)
from rasterizer.pipeline.workspace import make_picture
from rasterizer.scene.color import srgb_from_linear


def random_band(seed, n_channel, shape, factor):
    """Coverage and intensities of a band: empty rows, full ones, and a ragged rest."""
    rng = np.random.default_rng(seed)
    covered = rng.random(shape) < 0.6
    covered[: 8 * factor] = False
    covered[-2 * factor :] = True
    covered[:, : 3 * factor] = False
    return covered, rng.random((n_channel, *shape)) * 1.2


def blocks(samples, factor):
    """Samples (..., h·f, w·f) as (..., h, w, f·f)."""
    *head, rows, columns = samples.shape
    divided = samples.reshape(*head, rows // factor, factor, columns // factor, factor)
    return np.moveaxis(divided, -3, -2).reshape(*head, rows // factor, columns // factor, factor * factor)


def mean_colors(covered, radiance, factor, tint):
    """Colour (h, w, 3) and alpha (h, w) of the box filter, float64."""
    share, samples = blocks(covered, factor), blocks(np.where(covered, radiance, 0.0), factor)
    color = samples.sum(axis=-1) / np.maximum(share.sum(axis=-1), 1)
    color = np.moveaxis(color, 0, -1) if len(radiance) == 3 else color[0][..., None] * np.array(tint, np.float32)
    return color, share.mean(axis=-1)


TINT = (1.0, 0.5, 0.2)
SHAPE = (19, BATCH_SIZE + 37)  # pixels; more than a batch, in groups of rows that aren't full
CHOICES = pairs(
    factor=(1, 2, 3, 4),
    n_channel=(1, 3),
    background=(None, (0.2, 0.5, 0.05)),
    dtype=(np.float32, np.float64),
)


@pytest.mark.parametrize("factor, n_channel, background, dtype", CHOICES)
def test_pixels_are_means_of_their_covered_samples(factor, n_channel, background, dtype):
    covered, radiance = random_band(factor, n_channel, (SHAPE[0] * factor, SHAPE[1] * factor), factor)
    picture, rgba, _, n_covered = run(covered, radiance, encoding(background=background, tint=TINT), factor, dtype)
    color, alpha = mean_colors(covered, radiance, factor, TINT)
    assert n_covered == covered.sum()
    if background is not None:
        color = color * alpha[..., None] + np.array(background) * (1 - alpha[..., None])
        alpha = np.ones_like(alpha)
    off = np.abs(picture.color - color).max()
    assert off <= (2 + factor**2) * 2.0**-24 * 1.2 * 2, f"{off} > rounding of float32"
    off = np.abs(picture.alpha - alpha).max()
    assert off <= 2.0**-24, f"alpha is off by {off} > 2^-24"
    assert not differences(rgba[..., :3], levels(picture.color))
    assert not differences(rgba[..., 3], np.floor(255 * picture.alpha.astype(float) + 0.5))
    blank = 0 if background is None else levels(np.array(background, np.float32))
    assert (rgba[:8, :, :3] == blank).all(), "rows in which nothing is drawn"


def test_every_pixel_of_the_band_is_written():
    """Whatever stood in the picture's memory before, also where nothing is drawn."""
    covered = np.zeros((24, 60), bool)
    covered[3:5, 10:20] = True
    for with_color in (True, False):
        workspace, picture = fill(covered, np.full((1, 24, 60), 0.5)), make_picture((60, 24), with_color)
        for array in picture:
            array.fill(77)
        resolve(
            workspace.visibility, workspace.radiance, None, (0, 24), make_grid(1), encoding(), workspace.pixels, picture
        )
        assert not differences(picture.rgba[~covered], 0) and np.count_nonzero(picture.rgba[covered] == 77) == 0
        assert not with_color or not picture.color[~covered].any() and (picture.alpha == covered).all()


def test_policies_bring_colors_into_range():
    """Local: by the pixel's largest component. Global: by one scale. Linear colours stay as they are."""
    for factor in (1, 2):
        covered, radiance = random_band(7, 3, (20 * factor, 90 * factor), factor)
        radiance = radiance * 3
        clamped = run(covered, radiance, encoding(), factor)[0]
        local, local_bytes, _, _ = run(covered, radiance, encoding(RANGE_LOCAL), factor)
        assert not differences(local.color, clamped.color) and clamped.color.max() > 3
        color = clamped.color.astype(float)
        scale = 1 / color.max()
        how = encoding(RANGE_GLOBAL, scale=float(scale))
        global_bytes = run(covered, radiance, how, factor)[1]
        of_local = color / np.maximum(color.max(axis=2, keepdims=True), 1)
        # A scale in float32 may move a value by a rounding error across the border between two levels.
        for name, found, linear in (("local", local_bytes, of_local), ("global", global_bytes, color * scale)):
            off = np.abs(found[..., :3] - 255 * srgb_from_linear(linear)).max()
            assert off <= 0.5 + 255 * 2 * 2.0**-23, f"{name}, {factor=}: {off} levels > 0.5"
        again = np.zeros_like(clamped.rgba)
        encode_picture(clamped.color, clamped.alpha, how, again)
        assert not differences(again.view(np.uint8).reshape(global_bytes.shape), global_bytes)


# ---------------------------------------------------------------- encode

# Check how linear colour becomes bytes: the nearest level of the sRGB curve for every float there is.


def neighbours(values, reach=4):
    """The float32 numbers next to values, on both sides."""
    bits = np.asarray(values, np.float32).view(np.int32)
    return (bits[:, None] + np.arange(-reach, reach + 1)).ravel().astype(np.int32).view(np.float32)


def bucket_starts():
    """The least float32 of every bucket of the level table."""
    first = MIN_VALUE.view(np.int32) >> BUCKET_SHIFT
    return (np.arange(first, first + len(LEVEL_TABLE), dtype=np.int32) << BUCKET_SHIFT).view(np.float32)


def test_every_float_at_a_threshold_is_rounded_to_the_nearest_level():
    """All thresholds between levels, all ends of buckets, their float32 neighbours, and many others."""
    rng = np.random.default_rng(0)
    values = np.concatenate([
        neighbours(srgb_thresholds()), neighbours(bucket_starts()), neighbours([0.0031308, 0.04045 / 12.92, 1.0]),
        [0.0, -0.0, 1e-45, 1e-30], rng.random(50_000), 2.0 ** rng.uniform(-20, 0, 50_000),
    ]).astype(np.float32)  # fmt: skip
    columns = 700
    values = np.resize(values, (-(-len(values) // columns), columns))
    radiance = np.stack([values, values[::-1], values[:, ::-1]])
    for dtype in (np.float32, np.float64):
        for with_color in (False, True):  # in one loop, and by way of linear colours
            _, rgba, _, _ = run(np.ones(values.shape, bool), radiance, encoding(), dtype=dtype, with_color=with_color)
            wrong = rgba[..., :3] != levels(np.moveaxis(radiance, 0, -1))
            assert not wrong.any(), f"{wrong.sum()} of {wrong.size} levels wrong > 0"
            assert not differences(rgba[..., 3], 255)


def test_what_is_out_of_range_or_no_number():
    values = np.array([[-1.0, -1e-30, 1.0000001, 2.0, 1e30, np.inf, -np.inf, np.nan]])
    _, rgba, _, _ = run(np.ones(values.shape, bool), np.stack([values] * 3), encoding())
    assert rgba[0, :, 0].tolist() == [0, 0, 255, 255, 255, 255, 0, 0]
    assert not differences(rgba[..., :3], rgba[..., :1].repeat(3, axis=-1))
