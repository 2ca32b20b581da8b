"""`raster demo`: a picture right after an install."""

import os

import numpy as np
import pytest
from helpers.command import one_error, picture

import rasterizer as rz
from rasterizer.cli import main

pytestmark = pytest.mark.usefixtures("folder")


def test_the_model_of_the_package_is_drawn_in_the_current_folder(folder):
    assert main(["demo", "-s", "64x40", "--threads", "1", "--preset", "studio"]) == 0
    assert os.listdir(folder) == ["demo.png"]
    expected = rz.render(rz.load(rz.demo_model()), (64, 40), shading="phong", samples=4).rgba
    assert (picture("demo.png") == expected).all()


def test_flags_of_render_work_and_models_are_refused(capsys):
    assert main(["demo", "-s", "24x16", "-o", "x.jpg", "--shading", "flat", "--view", "top", "-v"]) == 0
    out, err = capsys.readouterr()
    assert out == "" and "flat shading" in err and "raster render MODEL draws one of yours" in err
    assert np.unique(picture("x.jpg")).size > 20
    assert main(["demo", "cube.obj"]) == 2 and "unrecognized arguments: cube.obj" in one_error(capsys)


def test_a_package_without_its_model_says_so(folder, monkeypatch, capsys):
    from rasterizer.cli import demo_command

    monkeypatch.setattr(demo_command, "demo_model", lambda: folder / "gone.obj")
    assert main(["demo"]) == 3 and "gone.obj: no such file" in one_error(capsys)
