"""Sheets: every picture in its place, paper between them."""

import numpy as np
import pytest
from helpers.arrays import differences
from PIL import Image

import rasterizer as rz
from rasterizer.frame import Frame, Stats


def picture(value, width=4, height=3, alpha=255):
    return np.full((height, width, 4), (value, value, value, alpha), np.uint8)


def test_pictures_are_laid_out_row_by_row():
    pictures = [picture(10 * i) for i in range(1, 6)]
    image = np.asarray(rz.sheet(pictures, columns=2, gap=1))
    assert image.shape == (1 + 3 * 4, 1 + 2 * 5, 4)
    for i, given in enumerate(pictures):
        y, x = 1 + i // 2 * 4, 1 + i % 2 * 5
        assert not differences(image[y : y + 3, x : x + 4], given)
    assert np.count_nonzero(image[..., 3]) == 5 * 12


def test_the_default_is_about_square():
    for n, columns in ((1, 1), (2, 2), (3, 2), (4, 2), (5, 3), (9, 3), (10, 4)):
        width = rz.sheet([picture(0, 1, 1)] * n, gap=0).width
        assert width == columns, f"{n} pictures in {width} columns, not {columns}"


def test_frames_images_and_arrays_of_any_size():
    frame = Frame(picture(50, 2, 1), {}, Stats(1, 0, 0, 1, 1, 1, 1, 0.0), (2, 1))
    image = np.asarray(rz.sheet([frame, Image.new("L", (4, 3), 70), picture(90)[..., :3]], columns=3, gap=0))
    assert image.shape == (3, 12, 4)
    assert np.argwhere(image[:, :4, 3]).tolist() == [[1, 1], [1, 2]]
    assert not differences(image[:, 4:8], (70, 70, 70, 255)) and not differences(image[:, 8:], (90, 90, 90, 255))


def test_a_background_is_blended_in_linear_light():
    image = rz.sheet([picture(255, alpha=0), picture(255, alpha=51), picture(7)], columns=3, gap=1, background="#000")
    assert image.mode == "RGB"
    # 0.2 of white: 1.055 0.2^(1/2.4) - 0.055 = 0.4845
    assert [image.getpixel((x, 2))[0] for x in (0, 2, 7, 12)] == [0, 0, 124, 7]


def test_labels_are_written_below():
    plain, labelled = rz.sheet([picture(0, 60)] * 2), rz.sheet([picture(0, 60)] * 2, labels=["front", 7])
    assert labelled.width == plain.width and labelled.height > plain.height
    below = np.asarray(labelled)[plain.height - 8 :, :, 3]
    assert below[:, :60].any() and below[:, 76:].any()
    assert rz.sheet([picture(0, 60)], labels=["front"], background="white").mode == "RGB"


def test_illegal_arguments():
    for frames, settings, message in (
        ([], {}, "at least one"),
        (["a.png"], {}, "PIL.Image.*given str"),
        ([np.zeros((2, 2, 3))], {}, "uint8"),
        ([picture(0)], {"columns": 0}, "columns"),
        ([picture(0)], {"gap": -1}, "gap"),
        ([picture(0)], {"labels": ["a", "b"]}, "2 for 1"),
        ([picture(0)], {"background": "nocolour"}, "background"),
        ([picture(0)] * 4, {"gap": 10**6}, "too large"),
    ):
        with pytest.raises(rz.SceneError, match=message):
            rz.sheet(frames, **settings)
