"""One rule of colours for all entries: 8 bits and text are sRGB, floats linear; what is given is drawn as it is, unless
a material or a word says otherwise."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import rasterizer as rz
from rasterizer.cli import main

VERTICES = np.array([[-2, -1, 0], [2, -1, 0], [2, 1, 0], [-2, 1, 0]], float)
FACES = [[0, 1, 2], [0, 2, 3]]
UV = [[0, 0], [1, 0], [1, 1], [0, 1]]
GREEN = np.full((4, 3), (0, 200, 0), np.uint8)
PIXELS = np.full((2, 2, 3), (0, 200, 0), np.uint8)
# Light 1 that falls onto the quad, which fills the picture: white gives 255.
LIGHT = {"lights": rz.AmbientLight(1.0), "camera": rz.Camera.perspective((0, 0, 2), (0, 0, 0))}
RED = [255, 0, 0]


def shown(source, **words):
    return rz.render(source, 4, **LIGHT | words).rgb[2, 2].tolist()


def written(tmp_path, suffix):
    path = tmp_path / f"quad.{suffix}"
    if suffix == "obj":
        rows = [f"v {x} {y} {z} 0 0.784313725 0" for x, y, z in VERTICES]
        path.write_text("\n".join([*rows, "f 1 2 3 4"]))
    elif suffix == "ply":
        head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        head += "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
        rows = [f"{x} {y} {z} 0 200 0" for x, y, z in VERTICES]
        path.write_text(head + "property list uchar int vertex_indices\nend_header\n" + "\n".join([*rows, "4 0 1 2 3"]))
    else:
        rz.save(rz.Scene(rz.Mesh(VERTICES, FACES, colors=GREEN)), path)
    return path


def entries(tmp_path):
    linear = rz.srgb(GREEN)
    yield "bytes", rz.Mesh(VERTICES, FACES, colors=GREEN)
    yield "floats", rz.Mesh(VERTICES, FACES, colors=linear)
    yield "a face", rz.Mesh(VERTICES, FACES, face_colors=GREEN[:2])
    yield "a corner", rz.Mesh(VERTICES, FACES, colors=GREEN[np.array(FACES)])
    yield "a colormap", rz.Mesh(VERTICES, FACES, colors=rz.srgb(GREEN / 255.0))
    yield "later", replace(rz.Mesh(VERTICES, FACES), colors=GREEN)
    yield "a texture", rz.Mesh(VERTICES, FACES, uv=UV, material=rz.Material(texture=PIXELS))
    for suffix in ("obj", "ply", "json"):
        yield suffix, written(tmp_path, suffix)
    trimesh = pytest.importorskip("trimesh")
    yield "trimesh", trimesh.Trimesh(VERTICES, FACES, vertex_colors=GREEN, process=False)


def test_what_is_given_without_a_material_is_drawn_as_it_is(tmp_path):
    for name, source in entries(tmp_path):
        assert shown(source) == [0, 200, 0], name
    assert shown(rz.Mesh(VERTICES, FACES, uv=UV), material={"texture": PIXELS}) == [0, 200, 0]


def test_a_colour_asked_for_comes_out_and_a_diffuse_coefficient_multiplies(tmp_path):
    for name, source in entries(tmp_path):
        assert shown(source, color="red") == RED, name
        half = shown(source, material={"diffuse": 0.5})
        assert half[0] == half[2] == 0 and 130 < half[1] < 160, (name, half)
    unlit = rz.Mesh(VERTICES, FACES, material=rz.Material(diffuse=0, ambient=0, specular=0, emissive=(0, 1, 0)))
    assert shown(unlit, color="red") == RED
    assert shown(rz.Mesh(VERTICES, FACES, uv=UV), material={"texture": PIXELS}, color=(1, 1, 1)) == [0, 200, 0]


def test_the_command_line_and_scene_files_follow_the_rule(tmp_path):
    def pixel(*flags):
        flags = [*flags, "--light", "ambient:color=1", "--eye", "0,0,2", "--target", "0,0,0", "-s", "4", "-q"]
        assert main(["render", *flags, "-o", str(tmp_path / "a.png")]) == 0
        return np.asarray(Image.open(tmp_path / "a.png").convert("RGB"))[2, 2].tolist()

    for suffix in ("obj", "ply", "json"):
        path = str(written(tmp_path, suffix))
        assert pixel(path) == [0, 200, 0] and pixel(path, "--color", "red") == RED, suffix
        assert 130 < pixel(path, "--material", "diffuse=0.5")[1] < 160
    (tmp_path / "red.json").write_text('{"meshes": [{"file": "quad.ply"}], "color": "red"}')
    assert pixel(str(tmp_path / "red.json")) == RED
    assert pixel(str(tmp_path / "red.json"), "--material", "diffuse=blue") != RED


def test_floats_that_are_bytes_are_refused():
    for colors in (np.full((4, 3), 128.0), np.full((4, 3), 2.0), [[255.0, 0, 0]] * 4):
        for key in ("colors", "face_colors"):
            with pytest.raises(rz.ModelError, match="uint8"):
                rz.Mesh(VERTICES, FACES, **{key: colors[:2] if key == "face_colors" else colors})
    assert rz.Mesh(VERTICES, FACES, colors=np.full((4, 3), 1.5)).colors.max() == 1.5  # brighter than white


def test_a_frame_gives_pixels_without_gaps():
    rgb = rz.render((VERTICES, FACES), 8).rgb
    assert rgb.flags.c_contiguous and rgb.flags.writeable
