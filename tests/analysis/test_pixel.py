"""`rz.explain`: the reference's account of a pixel, for what the words of a picture say."""

import pickle
import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.pinhole import octasphere

import rasterizer as rz
from rasterizer.analysis.pixel import where_they_part
from rasterizer.engine.sample_path import draw_sample
from rasterizer.reference import explain as explaining

SIZE = (40, 30)
CAMERA = rz.Camera.perspective((0, 0, 4), fov=40)
LIGHT = rz.DirectionalLight((0.2, -0.3, -1))


def ball(**material):
    return rz.Scene([rz.Mesh(*octasphere(3), crease_angle=180, material=rz.Material(**material))], [LIGHT], CAMERA)


def test_it_is_what_the_reference_says():
    scene, options = ball(specular=0.3, opacity=0.5), {"shading": "phong", "samples": 4}
    found = rz.explain(scene, 18, 13, SIZE, **options)
    expected = explaining.explain(scene, 18, 13, rz.Options(size=SIZE, **options))
    assert found.rows[: len(expected.rows)] == expected.rows and found.samples == expected.samples


def test_a_camera_of_its_own_and_the_value_of_the_picture():
    camera = rz.Camera.orthographic((1, 2, 4), height=3)
    frame = rz.render(replace(ball(), camera=camera), SIZE, shading="phong", tolerance=0, samples=1)
    for x, y in ((20, 15), (17, 12), (24, 19)):
        found = rz.explain(ball(), x, y, SIZE, camera=camera, shading="phong", tolerance=0, samples=1)
        error = np.abs(np.array(dict(found.rows)["linear"]) - frame.color[y, x]).max()
        assert error <= frame.stats.error_bound + 1e-7, f"{error:.3g} > {frame.stats.error_bound:.3g}"


def test_a_pixel_outside_is_refused():
    for x, y in ((-1, 0), (40, 0), (0, 30), (1.5, 0), ("a", 0)):
        with pytest.raises(rz.SceneError, match="within 0..(39|29)"):
            rz.explain(ball(), x, y, SIZE, samples=1)


def test_the_last_rows_are_what_the_picture_shows_and_how_it_was_drawn():
    """Large triangles in perspective are cut, small and orthographic ones are not; colours and normals have planes."""
    wide = rz.Mesh(
        [(-2, -1, 1), (2, -1, -1), (0, 2, 0)], [(0, 1, 2)], normals=[(0, 0, 1), (0.6, 0, 0.8), (0, 0.6, 0.8)]
    )
    behind = rz.Mesh([(-9, -9, -2), (9, -9, -2), (0, 9, -2)], [(0, 1, 2)])
    colored = replace(wide, material=rz.Material(diffuse=(0.8, 0.5, 0.3)))
    glass = replace(behind, vertices=behind.vertices + (0, 0, 3.5), material=rz.Material(opacity=0.4))
    flat_on = rz.Camera.orthographic((0, 0, 4), height=4)
    cases = [
        ([behind, wide], CAMERA, {"shading": "gouraud"}, "between columns"),
        ([behind, wide, glass], CAMERA, {"shading": "gouraud"}, "between columns"),
        ([behind, wide], flat_on, {"shading": "gouraud"}, "over the triangle"),
        ([behind, wide], CAMERA, {"shading": "flat"}, "over the triangle"),
        ([behind, colored], CAMERA, {"shading": "gouraud"}, "planes of the intensities over w"),
        ([behind, wide], CAMERA, {"shading": "phong"}, "planes of the normals"),
        ([behind, wide], CAMERA, {"shading": "phong", "tolerance": 0}, "exact"),
    ]
    for meshes, camera, words, path in cases:
        scene = rz.Scene(meshes, [LIGHT], camera)
        frame = rz.render(scene, (200, 150), samples=4, **words)
        x, y = 97, 80
        rows = dict(rz.explain(scene, x, y, (200, 150), samples=4, **words).rows)
        assert rows["picture"] == tuple(frame.color[y, x].tolist()), words
        assert rows["difference"] <= frame.stats.error_bound + 1e-7
        assert path in rows["drawn"], f"{words}: {rows['drawn']}"
    scene = rz.Scene([glass], [LIGHT], CAMERA)
    assert "drawn" not in dict(rz.explain(scene, 20, 15, SIZE).rows)


def test_it_says_where_the_picture_and_the_reference_part():
    """A drawn pixel is changed stage by stage; a coarse shadow map parts from rays by itself."""
    scene, options, (x, y) = ball(), rz.Options(size=SIZE, samples=4), (18, 13)
    found, drawn = explaining.explain(scene, x, y, options), draw_sample(scene, options, CAMERA, x, y)
    other = drawn.color + np.float32(0.1)
    cases = [
        ({}, 0.0, "nowhere: the difference is within the bound that is stated"),
        ({"rgba": 255 - drawn.rgba}, 0.0, "in clamping and encoding"),
        ({"faces": np.where([[0, 0], [1, 0]], 7, drawn.faces)}, 0.1, "in what is seen: at 18.25, 13.75 px .* face 7, "),
        ({"faces": np.full((2, 2), -1)}, 0.1, "in what is seen: .* the picture has nothing, the reference face "),
        ({"positions": drawn.positions + np.float32(0.1)}, 0.1, "in the position"),
        ({"normals": -drawn.normals}, 0.1, "in the normal"),
        ({}, 0.1, "in the tolerance of 0.000244141, without which"),
    ]
    for changes, difference, expected in cases:
        changed = drawn._replace(color=other if difference else drawn.color, **changes)
        said = where_they_part(scene, options, CAMERA, (x, y), found, changed, difference)
        assert re.match(expected, said), f"{expected}: {said}"
    floor = rz.Mesh([(-4, -1, 4), (4, -1, 4), (4, -1, -4), (-4, -1, -4)], [(0, 1, 2, 3)])
    lamp = rz.DirectionalLight((0.5, -1, -0.4), shadow=rz.Shadow(size=64))
    frame = rz.render(rz.Scene([*ball().meshes, floor], [lamp], CAMERA), SIZE, samples=1, outputs=("color", "rgb"))
    exact = rz.reference.render(rz.Scene([*ball().meshes, floor], [lamp], CAMERA), SIZE, shading="phong")
    y, x = np.unravel_index(np.abs(frame.color - exact.color).max(axis=2).argmax(), frame.alpha.shape)
    assert dict(rz.explain(frame, int(x), int(y)).rows)["part"] == "in shadows, without which they agree"


def test_a_frame_is_explained_as_it_was_drawn():
    frame = rz.render(ball(specular=0.4), SIZE, shading="gouraud", view=(20, 10), edges="silhouette")
    found = rz.explain(frame, 18, 13)
    words = {"shading": "gouraud", "view": (20, 10)}
    assert found.rows[:-1] == rz.explain(ball(specular=0.4), 18, 13, SIZE, **words).rows
    assert dict(found.rows)["frame"].endswith(", as it is drawn")
    row, column = np.argwhere((frame.rgba[..., :3] == 0).all(axis=2) & (frame.alpha == 1))[0].tolist()
    assert dict(rz.explain(frame, column, row).rows)["frame"].endswith(": edges")
    for bad, given in ((frame, {"shading": "flat"}), (pickle.loads(pickle.dumps(frame)), {})):
        with pytest.raises(rz.SceneError, match="frame"):
            rz.explain(bad, 18, 13, **given)
