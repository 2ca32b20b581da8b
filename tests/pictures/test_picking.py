"""What a pixel shows: by frames with and without buffers, and by a Renderer without a picture."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from helpers.pixels import skewed
from helpers.small_scenes import cube, drawn, floor, scene_of

import rasterizer as rz
from rasterizer.choices import BUFFERS
from rasterizer.picking import PICKED

SIZE = (40, 30)


@pytest.fixture(scope="module")
def scene() -> rz.Scene:
    """A cube of two materials over a floor that is clipped."""
    box = replace(
        cube(),
        name="box",
        face_material=np.arange(12) % 2,
        materials=(rz.Material.named("gold"), rz.Material(name="red")),
    )
    return scene_of(box, replace(floor(diffuse="navy"), name="floor", uv=None))


def pixels():
    """Columns and rows all over the picture, the corners among them."""
    return [(x, y) for y in (0, 7, 14, 16, 22, 29) for x in (0, 5, 19, 20, 33, 39)]


INSIDE = rz.Camera.perspective((0.3, 0.1, 0.2), (0.0, -0.2, -1.0), fov=90, near=0.05)


@pytest.mark.parametrize("shading, cull, camera", [("flat", "auto", None), ("gouraud", "back", INSIDE)])
def test_every_way_to_pick_gives_what_the_buffers_say(scene, shading, cull, camera):
    """Also where faces that are left out lie before those that are seen."""
    scene, options = replace(scene, camera=camera or scene.camera), {"shading": shading, "cull": cull}
    full = rz.render(scene, SIZE, outputs=PICKED, **options)
    bare = rz.render(scene, SIZE, outputs="rgb", samples=4, **options)
    n_seen = 0
    with rz.Renderer(scene, SIZE, outputs="rgb", **options) as renderer:
        for x, y in pixels():
            found = full.pick(x, y)
            assert found == bare.pick(x, y) == renderer.pick(x, y) == renderer.pick(x, y, scene.camera), (x, y)
            assert (found is None) == (full.face[y, x] < 0)
            if found is None:
                continue
            n_seen += 1
            assert (found.x, found.y, found.face, found.object) == (x, y, full.face[y, x], full.object[y, x])
            assert found.depth == full.depth[y, x] and found.position == tuple(full.position[y, x].tolist())
            mesh = scene.meshes[found.object]
            assert found.object_name == mesh.name and found.face == found.object_face + scene.face_offsets[found.object]
            assert found.material_name == scene.materials[found.material].name
            assert (found.uv is None) == (mesh.uv is None)
            assert {type(value) for value in (*found.normal, *found.barycentric, found.depth)} == {float}
    assert 10 < n_seen < len(pixels())


def test_what_is_picked_lies_below_the_pointer():
    """Also through a camera with skew: OpenCV's formula places it there."""
    scene, _ = drawn()["many lights"]
    scene = replace(scene, camera=skewed(scene.camera_for(SIZE), SIZE, 0.7))
    frame = rz.render(scene, SIZE, outputs=PICKED)
    K, R, t = scene.camera.to_opencv(SIZE)
    found = [picked for x, y in pixels() if (picked := frame.pick(x, y))]
    assert len(found) > 10
    for picked in found:
        u, v, w = K @ (R @ picked.position + t)
        assert np.abs((u / w - picked.x, v / w - picked.y)).max() <= 1 / 512 + 1e-4


def test_another_camera_picks_another_surface(scene):
    above = rz.Camera.perspective((0.1, 6, 0.1), (0, 0, 0))
    with rz.Renderer(scene, SIZE, outputs="rgb") as renderer:
        found = renderer.pick(20, 15, above)
        assert found.object_name == "box" and found.normal == pytest.approx((0, 1, 0), abs=1e-6)
        assert found.position[1] == pytest.approx(1, abs=1e-5)
        assert renderer.render(above).pick(20, 15) == found
    with pytest.raises(rz.SceneError, match="this Renderer is closed"):
        renderer.pick(0, 0)


def test_a_pixel_that_is_not_there_is_refused(scene):
    frame = rz.render(scene, SIZE, outputs="rgb")
    with rz.Renderer(scene, SIZE) as renderer:
        for given in ((-1, 0), (40, 0), (0, 30), (0.5, 1), ("1", 2), (None, 0), (True, 0), (np.nan, 0)):
            with pytest.raises(rz.SceneError, match="a pixel is a column of 0 to 39 and a row of 0 to 29; given"):
                frame.pick(*given)
            with pytest.raises(rz.SceneError, match="a pixel is a column"):
                renderer.pick(*given)
    assert frame.pick(np.int64(20), np.uint8(15)) == frame.pick(20, 15) is not None


def test_a_pickled_frame_leaves_its_scene_behind(scene):
    bare = pickle.loads(pickle.dumps(rz.render(scene, SIZE, outputs="rgb")))
    with pytest.raises(rz.SceneError, match=r"doesn't know its scene: to pick, ask for outputs=\('depth', 'face'"):
        bare.pick(1, 1)
    frame = rz.render(scene, SIZE, outputs=PICKED)
    again = pickle.loads(pickle.dumps(frame))
    found, expected = again.pick(20, 15), frame.pick(20, 15)
    assert found.object_name is found.material_name is found.object_face is None
    assert replace(expected, object_name=None, material_name=None, object_face=None) == found
    assert len(pickle.dumps(frame)) < len(pickle.dumps((frame, scene)))


def test_what_is_picked_are_buffers():
    assert set(PICKED) == set(BUFFERS) - {"mask"}
