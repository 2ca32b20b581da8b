"""A pixel, explained: the shares of the lights add up to what the reference draws, and the text says what there is."""

import re

import numpy as np
import pytest
from helpers.campaign_scenes import make_case

import rasterizer as rz
from rasterizer import reference
from rasterizer.errors import SceneError

EXACT = 1e-12  # of linear light, relative where it is above 1: the same terms, summed in another order
SEED = 23
QUAD = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])


def layers_of(rows):
    """The rows of each layer of a sample, or of a pixel's first one, by their labels."""
    layers = []
    for label, value in rows.rows:
        if label.startswith("layer "):
            layers.append({"face": value})
        elif layers and label.startswith(("sample", "background")):
            break
        elif layers:
            layers[-1][label] = value
    return layers


def light_of(layer, index):
    """The words and the numbers of a light: its cosine N.L, attenuation, and unshadowed part."""
    (text,) = [value for label, value in layer.items() if re.fullmatch(f"{index} (?!diffuse|specular).*", label)]
    return [
        float(number) for number in re.fullmatch(r"to .*, N.L (.*), attenuation (.*), unshadowed (.*)", text).groups()
    ]


def summed(explanation):
    """The linear value and the alpha of a pixel, from the shares alone."""
    colors, alphas = [], []
    for sample in explanation.samples:
        color, alpha = np.zeros(3), 0.0
        for layer in layers_of(sample):
            shares = [
                value
                for label, value in layer.items()
                if label in ("ambient", "emission", "depth cue") or label.endswith((" diffuse", " specular"))
            ]
            assert np.allclose(layer["sum"], np.sum(shares, axis=0), rtol=1e-14, atol=1e-14)
            color += layer["visible"] * np.sum(shares, axis=0)
            alpha += layer["visible"]
        colors.append(color)
        alphas.append(alpha)
    alpha, background = np.mean(alphas), dict(explanation.rows)["background"]
    color = np.sum(colors, axis=0) / (sum(alphas) or 1.0)
    if background == "transparent":
        return color, alpha
    return color * alpha + np.array(background) * (1 - alpha), 1.0


def check(scene, x, y, size, picture, **options):
    """Hold an explanation against the picture that the reference draws."""
    found = rz.explain(scene, x, y, size, **{"samples": 1} | options)
    (color, alpha), said = summed(found), dict(found.rows)
    limit = EXACT * max(1.0, float(np.abs(picture.color[y, x]).max()))
    for error, what in (
        (np.abs(color - picture.color[y, x]).max(), "sum of the shares"),
        (np.abs(np.array(said["linear"]) - picture.color[y, x]).max(), "linear value"),
        (abs(alpha - picture.alpha[y, x]), "alpha of the layers"),
        (abs(said["alpha"] - picture.alpha[y, x]), "alpha"),
    ):
        assert error <= limit, f"{what} at ({x}, {y}): {error:.3g} > {limit:.3g}\n{found}"
    assert said["sRGB"] == tuple(picture.rgb[y, x])
    if len(found.samples) == 1:
        layers = layers_of(found)
        assert (int(re.match(r"face (\d+):", layers[0]["face"])[1]) if layers else -1) == picture.face[y, x]
        if layers:
            assert layers[0]["depth"] == pytest.approx(picture.depth[y, x], rel=1e-14)
            assert np.abs(np.array(layers[0]["normal"]) - picture.normal[y, x]).max() <= EXACT
    return found


def test_the_shares_add_up_to_the_picture():
    """Every kind of light, material, texture, shadow, opacity and camera, as the seeded campaign makes them."""
    for index in range(12):
        check_case(index)


@pytest.mark.nightly
def test_the_shares_of_many_pictures_add_up():
    for index in range(20, 300):
        check_case(index)


def check_case(index):
    """Hold explanations of a few pixels of one scene against the picture."""
    case = make_case(SEED, index)
    if len(case.scene.lights) > 20 and index < 20:
        return  # a number of lights is the night's
    options = {name: value for name, value in case.options.items() if name not in ("tolerance", "threads", "outputs")}
    picture = reference.render(case.scene, case.size, **options)
    rows, columns = np.nonzero(picture.face >= 0)
    rng = np.random.default_rng(index)
    some = rng.permutation(len(rows))[:3]
    for y, x in [*zip(rows[some], columns[some], strict=True), (0, 0), (case.size[1] - 1, case.size[0] - 1)]:
        check(case.scene, int(x), int(y), case.size, picture, **options)


def lit_quads(**options):
    """Two clear polygons in front of a third, under every kind of light."""
    texture = rz.Texture(np.linspace(0.2, 1, 48).reshape(4, 4, 3).astype(np.float32))
    uv = QUAD[:, :2] / 2 + 0.5
    looks = rz.Material(opacity=0.5, name="glass"), rz.Material(texture=texture, opacity=0.7), rz.Material(specular=0.4)
    meshes = [
        rz.Mesh(QUAD + (0.1 * k, 0, z), [(0, 1, 2, 3)], uv=uv, material=look, name=f"quad {k}")
        for k, (z, look) in enumerate(zip((1.0, 0.5, 0.0), looks, strict=True))
    ]
    shadow = rz.Shadow()
    lights = [
        rz.AmbientLight(0.1),
        rz.DirectionalLight((0.2, -0.3, -1), (1, 0.9, 0.8), shadow=shadow),
        rz.PointLight((0.3, 0.4, 0.2), 0.5, attenuation=(1, 0.1, 0.1), shadow=shadow),
        rz.SpotLight((0.5, 0.5, 4), (0, 0, -1), 0.7, inner=5, outer=30),
        rz.AreaLight((-1, 2, 2), (2, 0, 0), (0, 0, 1), 0.6, resolution=(3, 2), shadow=shadow),
    ]
    return rz.Scene(meshes, lights, rz.Camera.perspective((0.2, 0.1, 6), (0, 0, 0), fov=30), **options)


@pytest.mark.parametrize("shading, options", [
    ("lambert", {}),
    ("phong", {"samples": 4}),
    ("gouraud", {"exposure": 1.5, "color_range": "global"}),
    ("phong", {"spectral": 9, "color_range": "local"}),
    ("flat", {"cull": "back", "samples": 4}),
])  # fmt: skip
def test_layers_lights_and_samples_are_explained(shading, options):
    scene, size = lit_quads(depth_cue=rz.DepthCue(20.0, 1.0, (0.2, 0.3, 0.4)), background=(0.1, 0.2, 0.3)), (24, 18)
    picture = reference.render(scene, size, shading=shading, **options)
    for x, y in ((12, 9), (16, 12), (0, 0)):
        found = check(scene, x, y, size, picture, shading=shading, **options)
        assert len(found.samples) == options.get("samples", 1)
    layers = layers_of(rz.explain(scene, 12, 9, size, shading=shading, **{"samples": 1} | options))
    assert [re.search(r"'quad \d'", layer["face"])[0] for layer in layers] == ["'quad 0'", "'quad 1'", "'quad 2'"]
    lights = [label for label in layers[0] if label[0].isdigit() and not label.endswith(("diffuse", "specular"))]
    assert lights == ["1 directional", "2 point", "3 spot", "4 area"]


def test_a_shadow_is_told():
    """A quad between a light and the floor: the floor below it gets nothing, and the one beside it all."""
    floor = rz.Mesh(QUAD * 4, [(0, 1, 2, 3)], name="floor")
    lid = rz.Mesh(QUAD * 0.5 + (0, 0, 1), [(0, 1, 2, 3)])
    light = rz.PointLight((0, 0, 2.0), 1.0, shadow=rz.Shadow())
    scene = rz.Scene([floor, lid], [light], rz.Camera.perspective((0, -6, 0.4), (0, 0, 0), (0, 0, 1), fov=20))
    found = [layers_of(rz.explain(scene, x, 24, (64, 48), shading="phong", samples=1))[0] for x in (32, 2)]
    assert ["'floor'" in layer["face"] for layer in found] == [True, True]
    assert [light_of(layer, 0)[2] for layer in found] == [0.0, 1.0]
    assert light_of(found[0], 0)[0] > 0 and not any(found[0]["0 diffuse"]) and all(found[1]["0 diffuse"])


@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
def test_numbers_of_polygons_may_lie_far_apart(shading):
    corners, camera = [*QUAD, (0.0, 0, -1)], rz.Camera.perspective((0.3, 0.2, 4))
    near, far = (
        rz.Mesh(corners, [(0, 1, 2), (0, 2, 3), (0, 1, 4)], polygons=polygons, colors=np.abs(corners))
        for polygons in ([0, 0, 1], [0, 0, 2**31 - 1])
    )
    scenes = [rz.Scene([mesh, near], rz.studio(), camera) for mesh in (near, far)]
    few, many = (rz.explain(scene, 8, 8, (16, 16), shading=shading).rows for scene in scenes)
    assert few == many


def test_the_text_says_what_is_seen():
    scene = lit_quads()
    text = str(rz.explain(scene, 12, 9, (24, 18), shading="phong", samples=1))
    assert text == repr(rz.explain(scene, 12, 9, (24, 18), shading="phong", samples=1))
    for words in (
        "pixel (12, 9)           of 24 x 18, phong shading, 1 sample",
        "layer 1                 face 0: face 0 of mesh 0 'quad 0', material 0 'glass'",
        "1 directional",
        "N.L",
        "attenuation",
        "unshadowed",
        "background              transparent",
    ):
        assert words in text, f"{words!r} is missing:\n{text}"
    assert re.search(r"sRGB +\(\d+, \d+, \d+\)\ncode +#[0-9a-f]{6}\npicture +", text)
    assert len(max(text.splitlines(), key=len)) <= 160


def test_a_pixel_with_nothing_says_so():
    empty = rz.explain(lit_quads(background=(1, 0, 0)), 0, 0, (24, 18), samples=1)
    assert "nothing is seen here" in str(empty) and "background              (1, 0, 0)" in str(empty)
    said = dict(empty.rows)
    assert (said["linear"], said["alpha"], said["sRGB"], said["code"]) == ((1, 0, 0), 1, (255, 0, 0), "#ff0000")
    clear = dict(rz.explain(lit_quads(), 0, 0, (24, 18), samples=1).rows)
    assert (clear["background"], clear["alpha"]) == ("transparent", 0)


def test_a_pixel_outside_is_refused():
    for x, y, message in (
        (24, 0, r"x must be a whole number within 0\.\.23.*given 24"),
        (-1, 0, r"x must be .*given -1"),
        (0, 18, r"y must be a whole number within 0\.\.17, as the picture has 18 rows; given 18"),
        (0.5, 0, r"x must be .*given 0\.5"),
        (0, "1", r"y must be .*given '1'"),
        (True, 0, r"x must be .*given True"),
    ):
        with pytest.raises(SceneError, match=message):
            rz.explain(lit_quads(), x, y, (24, 18), samples=1)


def test_options_that_are_not_legal_are_refused():
    for options in ({"shading": "toon"}, {"samples": 5}, {"cull": "front"}, {"tolerance": -1}, {"spectral": 2}):
        with pytest.raises(SceneError, match=next(iter(options))):
            rz.explain(lit_quads(), 0, 0, (24, 18), **{"samples": 1} | options)
