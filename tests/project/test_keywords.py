"""Keywords that a function doesn't have: one error, which names the nearest that it has."""

import inspect

import numpy as np
import pytest

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


def test_it_is_an_error_of_the_package_and_one_of_python():
    with pytest.raises(TypeError):
        rz.Material(colour="red")
    with pytest.raises(rz.RasterizerError):
        rz.Material(colour="red")


def test_signatures_are_those_that_are_written():
    """Editors and `help` show the parameters, not (*args, **kwargs)."""
    for function in (
        rz.render, rz.load, rz.Renderer, rz.Renderer.render, rz.turntable, rz.Material, rz.Camera.framing, rz.Options,
    ):  # fmt: skip
        kinds = {each.kind for each in inspect.signature(function).parameters.values()}
        assert not kinds & {inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL}
        assert inspect.getdoc(function)
