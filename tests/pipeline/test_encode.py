"""Check how linear colour becomes bytes: the nearest level of the sRGB curve for every float there is."""

import numpy as np
from helpers.arrays import differences
from helpers.bands import encoding, levels, run

from rasterizer.pipeline.resolve import (
    BUCKET_SHIFT,
    LEAST,
    LEVEL_TABLE,
    RANGE_CLAMP,
    RANGE_GLOBAL,
    RANGE_LOCAL,
    encode_picture,
    srgb_thresholds,
)


def neighbours(values, reach=4):
    """The float32 numbers next to values, on both sides."""
    bits = np.asarray(values, np.float32).view(np.int32)
    return (bits[:, None] + np.arange(-reach, reach + 1)).ravel().astype(np.int32).view(np.float32)


def bucket_starts():
    """The least float32 of every bucket of the level table."""
    first = LEAST.view(np.int32) >> BUCKET_SHIFT
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


def test_every_threshold_is_the_least_float_of_its_level():
    threshold = srgb_thresholds()
    assert not differences(levels(threshold), np.arange(1, 256))
    below = np.nextafter(threshold, np.float32(0))
    assert not differences(levels(below), np.arange(255))


def test_no_bucket_holds_two_thresholds():
    starts = bucket_starts()
    inside = np.searchsorted(srgb_thresholds(), np.append(starts[1:], np.float32(1)), "left")
    inside -= np.searchsorted(srgb_thresholds(), starts, "right")
    assert inside.max() == 1 and starts[0] == LEAST < srgb_thresholds()[0]


def test_what_is_out_of_range_or_no_number():
    values = np.array([[-1.0, -1e-30, 1.0000001, 2.0, 1e30, np.inf, -np.inf, np.nan]])
    _, rgba, _, _ = run(np.ones(values.shape, bool), np.stack([values] * 3), encoding())
    assert rgba[0, :, 0].tolist() == [0, 0, 255, 255, 255, 255, 0, 0]
    assert not differences(rgba[..., :3], rgba[..., :1].repeat(3, axis=-1))


def test_a_blank_pixel_has_the_bytes_of_the_background():
    """With alpha 255; without a background it is transparent black."""
    behind = (0.2, 0.5, 1.5)
    assert encoding().blank == 0
    for policy, scale in ((RANGE_CLAMP, 1.0), (RANGE_LOCAL, 1.0), (RANGE_GLOBAL, 0.5)):
        how = encoding(policy, behind, scale)
        color, rgba = np.array(behind, np.float32).reshape(1, 1, 3), np.empty((1, 1), np.uint32)
        encode_picture(color, np.ones((1, 1), np.float32), how, rgba)
        assert how.blank == rgba[0, 0] and how.blank >> 24 == 255
