"""Options: defaults, what is legal, what a message says."""

import math

import numpy as np
import pytest

from rasterizer.errors import SceneError
from rasterizer.options import CULLS, DEFAULT_TOLERANCE, MOST_PIXELS, OUTPUTS, SAMPLES, SHADINGS, Options


def test_defaults():
    options = Options()
    assert options == Options(
        size=(640, 480),
        shading="gouraud",
        tolerance=DEFAULT_TOLERANCE,
        samples=1,
        outputs=("color",),
        cull="none",
        color_range="clamp",
        threads=None,
    )
    assert options.n_thread >= 1 and options.factor == 1 and not options.is_flat


@pytest.mark.parametrize("size", [64, np.int32(64), (64, 64), [64, np.int64(64)]])
def test_a_size_is_a_pair_or_one_number(size):
    options = Options(size=size)
    assert options.size == (64, 64) and all(type(side) is int for side in options.size)


@pytest.mark.parametrize("size", [0, -1, (64,), (64, 64, 3), (64, 0), (64.0, 64), "64", None, True, MOST_PIXELS + 1])
def test_illegal_sizes(size):
    with pytest.raises(SceneError, match="size must be"):
        Options(size=size)


def test_samples_count_towards_the_largest_size():
    assert Options(size=MOST_PIXELS).size == (MOST_PIXELS, MOST_PIXELS)
    with pytest.raises(SceneError, match=f"1 to {MOST_PIXELS // 2} px with 4 samples"):
        Options(size=MOST_PIXELS, samples=4)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("shading", "toon"),
        ("shading", None),
        ("samples", 2),
        ("cull", "front"),
        ("color_range", "wrap"),
        ("outputs", ()),
        ("outputs", ("color", "uv")),
        ("outputs", "uv"),
        ("tolerance", -1e-9),
        ("tolerance", math.nan),
        ("tolerance", math.inf),
        ("tolerance", "fine"),
        ("tolerance", None),
        ("threads", 0),
        ("threads", 1.5),
        ("threads", True),
        ("threads", 1025),
    ],
)
def test_illegal_values(name, value):
    with pytest.raises(SceneError, match=f"^{name} must "):
        Options(**{name: value})


def test_legal_words():
    for shading in SHADINGS:
        assert Options(shading=shading).is_flat == (shading in ("flat", "lambert"))
    for samples in SAMPLES:
        assert Options(samples=samples).factor ** 2 == samples
    for cull in CULLS:
        assert Options(cull=cull).cull == cull
    for output in OUTPUTS:
        assert Options(outputs=output).outputs == (output,)
    assert Options(tolerance=0).tolerance == 0.0 and Options(threads=3).n_thread == 3


def test_options_are_values():
    assert Options() == Options() and hash(Options()) == hash(Options())
    with pytest.raises(AttributeError):
        Options().samples = 4
