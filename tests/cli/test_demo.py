"""`raster demo`: a picture right after an install."""

import os

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.command import assert_refused, picture, raster

import rasterizer as rz

pytestmark = pytest.mark.usefixtures("folder")


def test_the_model_of_the_package_is_drawn_in_the_current_folder(folder, capsys):
    assert raster("demo", "-s", "64x40", "--threads", "1", "--preset", "studio") == 0
    assert os.listdir(folder) == ["demo.png"]
    expected = rz.render(rz.load(rz.demo_model()), (64, 40), shading="phong", samples=4).rgba
    assert not differences(picture("demo.png"), expected)
    capsys.readouterr()
    assert raster("demo", "-s", "24x16", "-o", "x.jpg", "--shading", "flat", "--view", "top", "-v", "--no-ground") == 0
    out, err = capsys.readouterr()
    assert out == "" and "flat shading" in err and "raster render MODEL draws one of yours" in err
    assert np.unique(picture("x.jpg")).size > 20
    assert_refused(capsys, [(["cube.obj"], "unrecognized arguments: cube.obj")], "demo")
