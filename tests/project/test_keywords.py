"""Keywords that a function doesn't have: one error, which names the nearest that it has."""

import inspect
import re
import traceback

import numpy as np
import pytest
from helpers.odd_format import odd_format

import rasterizer as rz

TRIANGLE = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


CALLS = (
    (lambda **k: rz.render(TRIANGLE, 8, **k), "tolerence", "tolerance"),
    (lambda **k: rz.render(TRIANGLE, 8, **k), "Shading", "shading"),
    (lambda **k: rz.render(TRIANGLE, 8, **k), "light", "lights"),
    (lambda **k: rz.render(TRIANGLE, 8, **k), "width", "size"),
    (lambda **k: rz.render(TRIANGLE, 8, **k), "bg", "background"),
    (lambda **k: rz.Renderer(TRIANGLE, 8, **k), "sample", "samples"),
    (lambda **k: rz.Renderer(TRIANGLE, 8, shading="gouraud").render(**k), "azimut", "azimuth"),
    (lambda **k: rz.explain(TRIANGLE, 4, 4, 8, **k), "shadings", "shading"),
    (lambda **k: rz.load(TRIANGLE, **k), "crease", "crease_angle"),
    (lambda **k: rz.Camera.framing(np.eye(3), **k), "elev", "elevation"),
    (lambda **k: rz.Camera.orbit(np.eye(3), **k), "azimuth", "azimuths"),
    (lambda **k: rz.Camera(position=(0, 0, 1), **k), "field", None),
    (lambda **k: rz.Options(**k), "thread", "threads"),
    (lambda **k: rz.Material(**k), "color", "diffuse"),
    (lambda **k: rz.Material.named("gold", **k), "roughnes", "roughness"),
    (lambda **k: rz.Mesh(*TRIANGLE, **k), "uvs", "uv"),
    (lambda **k: rz.Scene(TRIANGLE, **k), "light", "lights"),
    (lambda **k: rz.PointLight((0, 0, 1), **k), "intensity", "color"),
    (lambda **k: rz.Shadow(**k), "sizes", "size"),
    (lambda **k: rz.DepthCue(2, **k), "begin", None),
)


def test_the_nearest_keyword_is_named():
    for call, given, meant in CALLS:
        with pytest.raises(rz.OptionError) as caught:
            call(**{given: 1})
        text = str(caught.value)
        assert f"has no option {given!r}: " in text and "Options are " in text, text
        assert (f"did you mean {meant}?" in text) if meant else ("did you mean" not in text), text


# What others call the options of a picture.
MEANT = {
    "samples": ("aa", "antialiasing", "multisample", "spp", "supersampling"), "outputs": ("buffers",),
    "size": ("height", "resolution", "shape"), "shading": ("mode",), "threads": ("workers",),
}  # fmt: skip


def test_words_of_others_are_understood():
    for meant, words in MEANT.items():
        for given in words:
            with pytest.raises(rz.OptionError, match=rf"{given}'.*did you mean {meant}\?"):
                rz.render("x.obj", **{given: 1})


def test_a_word_that_another_function_has_is_said():
    for given in ("material", "preset", "shadows", "fov", "margin", "view", "colour", "subdivide", "texture"):
        for call in (rz.load, rz.Scene, rz.render if given in ("colour", "texture") else rz.Scene):
            with pytest.raises(rz.OptionError) as caught:
                call("x.obj", **{given: 1})
            text = str(caught.value)
            assert "did you mean" not in text and text.partition(f"{given!r}: ")[2].partition(". Options are ")[1], text


def test_a_message_of_many_options_is_short():
    for call in (rz.render, rz.Renderer, rz.turntable):
        with pytest.raises(rz.OptionError, match=r"Options are those of help\(rz\.\w+\)") as caught:
            call("x.obj", nonsense=1)
        assert len(str(caught.value)) < 300


def test_it_is_an_error_of_the_package_and_one_of_python():
    with pytest.raises(TypeError):
        rz.Material(colour="red")
    with pytest.raises(rz.RasterizerError):
        rz.Material(colour="red")


def test_a_traceback_ends_at_the_line_of_the_user_and_one_of_ours(tmp_path):
    holed = ([[0, 0, 0], [1, 0, 0], [0, float("nan"), 0]], [[0, 1, 2]])
    frame = rz.render(TRIANGLE, 8)
    calls = (
        lambda: rz.render(None),
        lambda: rz.render("none.obj"),
        lambda: rz.render(holed),
        lambda: rz.render(TRIANGLE, -1),
        lambda: rz.render(TRIANGLE, 8, camera=3),
        lambda: rz.load(TRIANGLE, up="w"),
        lambda: rz.Mesh(*holed),
        lambda: rz.Material(diffuse=(255, 0, 0)),
        lambda: rz.save(3, "none.json"),
        lambda: rz.render(TRIANGLE, 8, material="cheese"),
        lambda: rz.render(TRIANGLE, 8, eye=(1, 2, 3), view="top"),
        lambda: rz.render(TRIANGLE, 8, nonsense=3),
        lambda: rz.Renderer(TRIANGLE, 8, shadows=3),
        lambda: rz.turntable(TRIANGLE, shading="none"),
        lambda: rz.sheet([3]),
        lambda: frame.save("x.foo"),
    )
    for call in calls:
        with pytest.raises(rz.RasterizerError) as caught:
            call()
        files = [each.filename for each in traceback.extract_tb(caught.tb)]
        assert files[:2] == [__file__] * 2 and len(files) == 3, f"{caught.value}: {files}"

    (tmp_path / "a.odd").write_bytes(b"any")
    with odd_format(ZeroDivisionError("of ours")), pytest.raises(rz.ModelError, match="internal error") as caught:
        rz.load(tmp_path / "a.odd")
    assert len(traceback.extract_tb(caught.value.__cause__.__traceback__)) > 1, "a fault of ours keeps all of it"


def test_signatures_fit_a_screen_and_the_text_says_what_each_word_is():
    for function in (rz.render, rz.Renderer, rz.load, rz.explain, rz.turntable):
        text = str(inspect.signature(function))
        assert "_typing" not in text and len(text) < 1000, text
    text = inspect.getdoc(rz.render)
    for name in inspect.signature(rz.render).parameters:
        assert re.search(rf"^(\w+, )*{name}(, \w+)* : ", text, re.MULTILINE), name


def test_signatures_are_those_that_are_written():
    """Editors and `help` show the parameters, not (*args, **kwargs)."""
    for function in (
        rz.render, rz.load, rz.Renderer, rz.Renderer.render, rz.turntable, rz.Material, rz.Camera.framing, rz.Options,
    ):  # fmt: skip
        kinds = {each.kind for each in inspect.signature(function).parameters.values()}
        assert not kinds & {inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL}
        assert inspect.getdoc(function)
