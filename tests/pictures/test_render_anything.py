"""`render` takes whatever `load` takes, and looks at it as it is told."""

import inspect
import io
import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from helpers.raster import ROOT

import rasterizer as rz

CUBE, TORUS = ROOT / "models" / "cube.obj", ROOT / "models" / "torus.glb"
MESH = rz.load(CUBE).meshes[0]
SIZE = (40, 30)


def bytes_of(*args, **options):
    return rz.render(*args, **options).rgba.tobytes()


def sources():
    trimesh = pytest.importorskip("trimesh")
    body = trimesh.Trimesh(MESH.vertices, MESH.faces, process=False)
    return {
        "path": CUBE, "text": str(CUBE), "file": CUBE.open("rb"), "stream": io.BytesIO(CUBE.read_bytes()),
        "bytes": CUBE.read_bytes(), "scene": rz.load(CUBE), "mesh": MESH, "list": [MESH], "generator": iter([MESH]),
        "arrays": (MESH.vertices, MESH.faces), "lists": (MESH.vertices.tolist(), MESH.faces.tolist()),
        "trimesh": body, "trimesh scene": trimesh.Scene(body), "list of trimesh": [body],
    }  # fmt: skip


def test_every_source_makes_a_picture_of_the_same_cube():
    covered = {}
    for name, source in sources().items():
        options = {"format": "obj"} if name in ("stream", "bytes") else {}
        covered[name] = rz.render(source, SIZE, shading="flat", **options).stats.covered
    assert len(set(covered.values())) == 1 and covered["path"] > 500, covered


def test_what_render_is_told_is_what_a_scene_says():
    lamp, camera = rz.headlight(), rz.Camera.perspective((3, 4, 5))
    scene = rz.Scene(MESH, lamp, camera, "#102030")
    assert bytes_of(scene, SIZE) == bytes_of(MESH, SIZE, lights=lamp, camera=camera, background="#102030")
    assert bytes_of(rz.Scene(MESH, lights=()), SIZE) == bytes_of(MESH, SIZE, lights=())


@pytest.mark.parametrize("up", ["y", "z", "-x"])
def test_angles_frame_the_scene_for_the_size(up):
    scene = rz.Scene(MESH, up=up)
    camera = rz.Camera.framing(MESH, 70, 10, up=up, size=SIZE)
    expected = bytes_of(replace(scene, camera=camera), SIZE)
    assert (
        expected
        == bytes_of(MESH, SIZE, up=up, azimuth=70, elevation=10)
        == bytes_of(scene, SIZE, azimuth=70, elevation=10)
    )
    with rz.Renderer(scene, SIZE) as renderer:
        assert renderer.render(azimuth=70, elevation=10).rgba.tobytes() == expected
        assert renderer.render().rgba.tobytes() == bytes_of(MESH, SIZE, up=up)


def test_angles_and_up_come_before_the_camera_of_a_scene():
    scene = rz.Scene(MESH, camera=rz.Camera.perspective((9, 0, 0)))
    framed = rz.Scene(MESH)
    assert bytes_of(scene, SIZE) != bytes_of(framed, SIZE) == bytes_of(scene, SIZE, azimuth=35)
    assert bytes_of(scene, SIZE, up="z") == bytes_of(framed, SIZE, up="z")


def test_pictures_have_four_samples_and_pictures_beside_buffers_one():
    picture, both = (
        rz.render(MESH, SIZE, shading="gouraud"),
        rz.render(MESH, SIZE, outputs=("color", "face"), shading="gouraud", samples=1),
    )
    assert picture.stats.samples == 4 * SIZE[0] * SIZE[1] and both.stats.samples == SIZE[0] * SIZE[1]
    assert bytes_of(MESH, SIZE) == bytes_of(MESH, SIZE, samples=4)
    with rz.Renderer(MESH, SIZE, shading="gouraud") as renderer:
        assert renderer.render().rgba.tobytes() == picture.rgba.tobytes()


def test_what_is_no_model(folder):
    for source, error, words in (
        ("none.obj", rz.ModelError, "none.obj: no such file"),
        (b"v 0 0 0", rz.RasterizerError, "format"),
        ([], rz.ModelError, "at least one mesh; given an empty sequence"),
        ([1, 2, 3], rz.ModelError, "a mesh must be"),
        (["a.obj", "b.obj"], rz.ModelError, "a mesh must be"),
        (np.zeros((4, 3)), rz.ModelError, "a mesh needs faces: points and lines alone are not drawn"),
        (trimesh.PointCloud(np.eye(3)), rz.ModelError, "a mesh needs faces: points and lines alone are not drawn"),
        (None, rz.ModelError, r"a mesh must be .*render\(\) take a file .*; given None"),
        (
            ([(0, 0, 0), (1, 0, 0), (0, np.nan, 0)], [(0, 1, 2)]),
            rz.ModelError,
            "--drop-bad-faces",
        ),
        ({}, rz.ModelError, "a mesh must be"),
    ):
        with pytest.raises(error, match=words):
            rz.render(source, 8, shading="gouraud")


# --- the frame ------------------------------------------------------------------------------------------------------


def test_pillow_takes_a_frame_for_an_image():
    from PIL import Image

    frame = rz.render(MESH, SIZE, shading="gouraud")
    image = Image.fromarray(frame)
    assert (image.mode, image.size) == ("RGBA", SIZE) == ("RGBA", (frame.width, frame.height))
    assert image.tobytes() == frame.rgba.tobytes() == frame.tobytes()
    assert np.shares_memory(np.asarray(frame), frame.rgba) and not np.shares_memory(np.array(frame), frame.rgba)
    assert np.asarray(frame, np.float32).dtype == np.float32


def test_what_a_frame_does_not_have_can_be_asked_for():
    frame = rz.render(MESH, 8, outputs=("rgb", "depth"), shading="gouraud", samples=1)
    assert hasattr(frame, "depth") and not hasattr(frame, "position") and getattr(frame, "normal", None) is None
    assert dict(inspect.getmembers(frame))["width"] == 8
    with pytest.raises(rz.SceneError, match="ask for it with outputs"):
        frame.position  # noqa: B018
    with pytest.raises(rz.SceneError, match=r"frame.encode\(\) gives its bytes"):
        frame.save(io.BytesIO())


def test_show_opens_a_program_or_says_what_to_do(monkeypatch):
    from PIL import ImageShow

    frame, shown = rz.render(MESH, SIZE, shading="gouraud"), []
    monkeypatch.setattr(ImageShow, "show", lambda image: shown.append(image) or True)
    frame.show()
    assert shown[0].size == SIZE
    monkeypatch.setattr(ImageShow, "show", lambda image: False)
    with pytest.raises(rz.OutputError, match=r"frame\.save\('picture.png'\)"):
        frame.show()


def test_show_in_a_notebook_shows_it_in_the_cell(monkeypatch):
    from types import SimpleNamespace

    shown = []
    display = SimpleNamespace(display=shown.append)
    python = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=1), display=display)
    monkeypatch.setitem(sys.modules, "IPython", python)
    frame = rz.render(MESH, SIZE, shading="gouraud")
    frame.show()
    assert [image.tobytes() for image in shown] == [frame.to_pil().tobytes()]
