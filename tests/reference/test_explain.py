"""A pixel, explained: the shares of the lights add up to what the reference draws, and the text says what there is."""

import re
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from helpers.campaign_scenes import make_case

import rasterizer as rz
from rasterizer import reference
from rasterizer.errors import SceneError

EXACT = 1e-12  # of linear light, relative where it is above 1: the same terms, summed in another order
SEED = 23
QUAD = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])


def summed(explanation):
    """The linear value and the alpha of a pixel, from the shares alone."""
    colors, alphas = [], []
    for sample in explanation.samples:
        color = np.zeros(3)
        for layer in sample.layers:
            shares = [layer.ambient, layer.emission, layer.depth_cue]
            shares += [share for light in layer.lights for share in (light.diffuse, light.specular)]
            color += layer.visible * np.sum(shares, axis=0)
        colors.append(color)
        alphas.append(sum(layer.visible for layer in sample.layers))
    alpha = np.mean(alphas)
    color = np.sum(colors, axis=0) / (sum(alphas) or 1.0)
    if explanation.background is None:
        return color, alpha
    return color * alpha + np.array(explanation.background) * (1 - alpha), 1.0


def check(scene, x, y, size, picture, **options):
    """Hold an explanation against the picture that the reference draws."""
    found = rz.explain(scene, x, y, size, **{"samples": 1} | options)
    color, alpha = summed(found)
    limit = EXACT * max(1.0, float(np.abs(picture.color[y, x]).max()))
    for error, what in (
        (np.abs(color - picture.color[y, x]).max(), "sum of the shares"),
        (np.abs(np.array(found.linear) - picture.color[y, x]).max(), "linear value"),
        (abs(alpha - picture.alpha[y, x]), "alpha of the layers"),
        (abs(found.alpha - picture.alpha[y, x]), "alpha"),
    ):
        assert error <= limit, f"{what} at ({x}, {y}): {error:.3g} > {limit:.3g}\n{found}"
    assert found.rgb == tuple(picture.rgb[y, x])
    if len(found.samples) == 1:
        layers = found.layers
        assert (layers[0].face if layers else -1) == picture.face[y, x]
        if layers:
            assert layers[0].depth == pytest.approx(picture.depth[y, x], rel=1e-14)
            assert np.abs(np.array(layers[0].normal) - picture.normal[y, x]).max() <= EXACT
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
    layers = rz.explain(scene, 12, 9, size, shading=shading, **{"samples": 1} | options).layers
    assert [layer.mesh_name for layer in layers] == ["quad 0", "quad 1", "quad 2"]
    assert [light.kind for light in layers[0].lights] == ["directional", "point", "spot", "area"]
    assert [light.index for light in layers[0].lights] == [1, 2, 3, 4]


def test_a_shadow_is_told():
    """A quad between a light and the floor: the floor below it gets nothing, and the one beside it all."""
    floor = rz.Mesh(QUAD * 4, [(0, 1, 2, 3)], name="floor")
    lid = rz.Mesh(QUAD * 0.5 + (0, 0, 1), [(0, 1, 2, 3)])
    light = rz.PointLight((0, 0, 2.0), 1.0, shadow=rz.Shadow())
    scene = rz.Scene([floor, lid], [light], rz.Camera.perspective((0, -6, 0.4), (0, 0, 0), (0, 0, 1), fov=20))
    found = [rz.explain(scene, x, 24, (64, 48), shading="phong", samples=1).layers[0] for x in (32, 2)]
    assert [layer.mesh_name for layer in found] == ["floor", "floor"]
    assert [layer.lights[0].unshadowed for layer in found] == [0.0, 1.0]
    assert found[0].lights[0].n_dot_l > 0 and not any(found[0].lights[0].diffuse) and all(found[1].lights[0].diffuse)


def test_what_faces_away_at_a_corner_is_in_no_shadow():
    """Of the corners that Gouraud's method lights, those count that face the light."""
    normals = np.array([(0, 0, 1.0), (0, 0, 1.0), (1.0, 0, 0.1), (0, 0, 1.0)])
    light = rz.DirectionalLight((1, 0, -1), shadow=rz.Shadow())
    scene = rz.Scene(rz.Mesh(QUAD, [(0, 1, 2), (0, 2, 3)], normals=normals), light, rz.Camera.perspective((0, 0, 4)))
    (layer,) = rz.explain(scene, 10, 8, 16, shading="gouraud", samples=1).layers
    assert layer.lights[0].unshadowed == pytest.approx(1.0) and 0.0 < layer.lights[0].n_dot_l < 0.7


def test_faces_meshes_and_materials_are_those_that_were_loaded():
    red, blue = rz.Material(diffuse=(1, 0, 0), name="red"), rz.Material(diffuse=(0, 0, 1), name="blue")
    left = rz.Mesh(QUAD - (1.5, 0, 0), [(0, 1, 2, 3)], name="left")
    right = rz.Mesh(
        QUAD + (1.5, 0, 0), [(0, 1, 2), (0, 2, 3)], materials=(red, blue), face_material=[0, 1], name="right"
    )
    scene = rz.Scene(
        [left, right], [rz.DirectionalLight((0, 0, -1))], rz.Camera.orthographic((0, 0, 5), (0, 0, 0), (0, 1, 0), 4)
    )
    (layer,) = rz.explain(scene, 44, 20, (64, 32), samples=1).layers
    assert (layer.face, layer.mesh, layer.mesh_face, layer.material_index) == (2, 1, 0, 0)
    (other,) = rz.explain(scene, 40, 12, (64, 32), samples=1).layers
    assert (other.face, other.mesh, other.mesh_face, other.material) == (3, 1, 1, blue)
    assert (
        layer.lights[0].direction == (0, 0, 1)
        and layer.lights[0].n_dot_l == pytest.approx(1)
        and layer.position[2] == 0
    )


def test_the_text_says_what_is_seen():
    scene = lit_quads()
    text = str(rz.explain(scene, 12, 9, (24, 18), shading="phong", samples=1))
    assert text == repr(rz.explain(scene, 12, 9, (24, 18), shading="phong", samples=1))
    for words in (
        "pixel (12, 9) of 24 x 18, phong shading, 1 sample",
        "1. face 0: face 0 of mesh 0 'quad 0', material 0 'glass'",
        "1 directional",
        "N.L",
        "attenuation",
        "unshadowed",
        "background: transparent",
    ):
        assert words in text, f"{words!r} is missing:\n{text}"
    assert re.search(r"sRGB \(\d+, \d+, \d+\), #[0-9a-f]{6}$", text)
    assert len(max(text.splitlines(), key=len)) <= 160


def test_what_gouraud_interpolates_is_told_as_the_textbooks_write_it():
    """I_Q = 5/8 I_C + 3/8 I_A on the left edge, I_R = 5/8 I_C + 3/8 I_B on the right one, a third of the way to it."""
    corners, colors = [(-2.0, -2, 0), (2, -2, 0), (-2, 2, 0)], [[0.1] * 3, [0.3] * 3, [0.9] * 3]
    mesh = rz.Mesh(corners, [(0, 1, 2)], colors=colors, material=rz.Material(diffuse=1.0))
    flat = rz.Camera.orthographic((0, 0, 5), (0, 0, 0), (0, 1, 0), 4)
    for camera in (flat, rz.Camera.perspective((0, 0, 2), (0, 0, 0), (0, 1, 0), 90)):
        found = rz.explain(rz.Scene(mesh, rz.AmbientLight(1.0), camera), 0, 1, 4, shading="gouraud", samples=1)
        (layer,) = found.layers
        assert np.allclose(layer.corners, colors) and np.allclose(layer.color, 0.625)
        left, right, share = layer.scan_line
        assert left.edge == (2, 0) and right.edge == (1, 2) and share == pytest.approx(1 / 3)
        assert (left.share, right.share) == pytest.approx((3 / 8, 5 / 8))
        assert (left.intensity[0], right.intensity[0]) == pytest.approx((0.6, 0.675))
    for words in ("I_A 0.1, I_B 0.3, I_C 0.9", "I_Q = 0.375 I_A + 0.625 I_C = 0.6", "I_R + 0.666667 I_Q = 0.625"):
        assert words in str(found), f"{words!r} is missing:\n{found}"


def test_one_of_several_samples_is_shown_and_reflection_is_called_so():
    found = rz.explain(lit_quads(), 12, 9, (24, 18), shading="gouraud", samples=4)
    assert str(found).count("sample at") == 1 and str(found.samples[0]) in str(found)
    assert "samples[k]), k from 0 to 3" in str(found) and str(found.samples[3]).startswith("sample at 12.75, 9.75 px")
    assert "gouraud shading" in str(found) and "\n     reflection phong: ambient" in str(found)
    cued = found.samples[0].layers[0]
    expected = np.array(cued.weights) @ np.array(cued.corners) + cued.depth_cue
    assert np.allclose(expected, cued.color, atol=1e-12)


def test_a_pixel_with_nothing_says_so():
    empty = rz.explain(lit_quads(background=(1, 0, 0)), 0, 0, (24, 18), samples=1)
    assert empty.layers == () and "nothing is seen here" in str(empty) and "background: (1, 0, 0)" in str(empty)
    assert empty.linear == (1, 0, 0) and empty.alpha == 1 and empty.rgb == (255, 0, 0)
    clear = rz.explain(lit_quads(), 0, 0, (24, 18), samples=1)
    assert clear.background is None and clear.alpha == 0 and "transparent" in str(clear)


def test_another_camera_and_anything_that_is_a_scene():
    mesh = rz.Mesh(QUAD, [(0, 1, 2, 3)])
    camera = rz.Camera.orthographic((0, 0, 5), (0, 0, 0), (0, 1, 0), 4)
    found = rz.explain(mesh, 8, 8, 16, camera=camera, tolerance=0, outputs=("rgb",), threads=2, samples=1)
    assert found.size == (16, 16) and found.layers[0].depth == 5 and found.path == "exact record"
    assert rz.explain(mesh, 0, 0, 16, camera=camera, samples=1).layers == ()
    with pytest.raises(FrozenInstanceError):
        found.path = "exact record"


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
