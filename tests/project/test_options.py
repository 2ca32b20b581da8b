"""Options: defaults, what is legal, what a message says."""

import math
import re
from dataclasses import fields, replace

import numpy as np
import pytest
from helpers.arrays import differences

import rasterizer as rz
from rasterizer.errors import SceneError
from rasterizer.options import DEFAULT_TOLERANCE, MAX_PIXELS, SHADINGS, Options

FRONT = rz.Camera.orthographic((0, 0, 2), (0, 0, 0), height=1.0)
QUAD = rz.Mesh([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [(0, 1, 2, 3)])
DEFAULTS = {
    "size": (640, 480),
    "shading": "phong",
    "tolerance": 1 / 4096,
    "samples": 4,
    "outputs": ("color",),
    "cull": "auto",
    "color_range": "clamp",
    "exposure": 0.0,
    "spectral": None,
    "threads": None,
    "edges": (),
    "edge_color": (0.0, 0.0, 0.0),
    "edge_width": 1.0,
    "ground": False,
    "min_opacity": 0.0,
}


def test_defaults_are_those_of_the_manual():
    """Each by its value: a new option must be listed here, too."""
    options = Options()
    assert {field.name: getattr(options, field.name) for field in fields(Options)} == DEFAULTS
    assert options.n_thread >= 1 and options.factor == 2 and not options.is_flat and DEFAULT_TOLERANCE == 1 / 4096


def pictures_of(scene, *settings) -> list:
    """Linear colours of small pictures, one for each of the settings."""
    return [rz.render(scene, (24, 18), **{"samples": 1} | given).color for given in settings]


def test_the_default_number_of_spectral_samples_is_that_of_the_manual():
    """81 where something has a spectrum, red, green and blue alone where nothing has."""
    power = np.exp(-(((np.arange(380, 781, 5) - 520) / 15.0) ** 2))
    lamp = rz.AmbientLight(rz.Spectrum(np.arange(380, 781, 5), power))
    paint = replace(QUAD, material=rz.Material(diffuse=(0.9, 0.5, 0.1)))
    usual, wanted, other = pictures_of(rz.Scene([paint], (lamp,), FRONT), {}, {"spectral": 81}, {"spectral": 9})
    assert usual.max() > 0.05 and not differences(usual, wanted) and np.abs(usual - other).max() > 1e-3
    usual, spectral = pictures_of(rz.Scene([paint], (rz.AmbientLight((0.9, 0.2, 0.1)),), FRONT), {}, {"spectral": 81})
    assert usual[9, 12] == pytest.approx((0.81, 0.1, 0.01), rel=1e-3) and np.abs(usual - spectral).max() > 1e-3


def test_a_size_is_a_pair_or_one_number():
    for size in (64, np.int32(64), (64, 64), [64, np.int64(64)]):
        options = Options(size=size)
        assert options.size == (64, 64) and all(type(side) is int for side in options.size), repr(size)


ILLEGAL = {
    "size": (0, -1, (64,), (64, 64, 3), (64, 0), (64.0, 64), "64", None, True, MAX_PIXELS + 1),
    "shading": ("toon", None), "cull": ("front",), "color_range": ("wrap",),
    "samples": (2, True, np.True_, "4", 3, np.int64(3), 4.5, math.nan, [4], (1,), np.array([4, 4])),
    "outputs": ((), ("color", "uvw"), "uvw"), "tolerance": (-1e-9, math.nan, math.inf, "fine", None),
    "threads": (0, 1.5, True, 1025), "exposure": (math.nan, "bright", 65), "edge_width": (0, math.nan),
    "spectral": (2, 1.5, "many"), "edges": ("contour",),
}  # fmt: skip


def test_illegal_values_are_refused_by_name():
    for name, values in ILLEGAL.items():
        for value in values:
            with pytest.raises(SceneError) as caught:
                Options(**{name: value})
            assert re.match(rf"{name} must ", str(caught.value)), f"{name}={value!r}: {caught.value}"
    with pytest.raises(SceneError, match="samples must be one of 1, 4, 9, 16; given 3"):
        Options(samples=3)


def test_samples_count_towards_the_largest_size():
    assert Options(size=MAX_PIXELS, samples=1).size == (MAX_PIXELS, MAX_PIXELS)
    with pytest.raises(SceneError, match=f"1 to {MAX_PIXELS // 2} px with 4 samples"):
        Options(size=MAX_PIXELS, samples=4)


@pytest.mark.parametrize("shading", SHADINGS)
def test_an_output_never_changes_another(shading):
    """A picture has four samples a pixel, buffers have one, whatever is asked for beside them."""
    names = ("rgb", "color", "depth", "face", "normal", "mask")
    alone = {name: getattr(rz.render(QUAD, (24, 18), shading=shading, outputs=name), name) for name in names}
    for outputs in (("rgb", "color"), ("rgb", "depth"), ("face", "color"), ("normal", "mask"), names):
        frame = rz.render(QUAD, (24, 18), shading=shading, outputs=outputs)
        for name in outputs:
            assert not differences(getattr(frame, name), alone[name]), f"{name} beside {outputs}"


WHOLE, FRACTIONS = ("size", "samples", "spectral", "threads"), ("tolerance", "exposure", "edge_width", "edge_color")


def test_numpy_numbers_count_as_those_of_python():
    """Whatever is given, the same is stored, so that options are equal and can be keys."""
    cases = [(name, 4, make) for name in WHOLE for make in (np.int64, np.uint8, np.array)]
    cases += [(name, 0.5, make) for name in FRACTIONS for make in (np.float32, np.float64, np.array)]
    for name, value, make in cases:
        given, plain = Options(**{name: make(value)}), Options(**{name: value})
        assert given == plain and hash(given) == hash(plain), f"{name} of {make}"
        assert type(getattr(given, name)) is type(getattr(plain, name)), f"{name} of {make}"
