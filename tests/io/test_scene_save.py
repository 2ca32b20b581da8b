"""Scenes written to files: what is read again is what was written, number by number; and nothing is half-written."""

import os
from dataclasses import fields, replace

import numpy as np
import pytest
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.io.scene_file import ARRAYS

SQUARE = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
UV = SQUARE[:, :2]
TWO = [[0, 1, 2], [0, 2, 3]]
BYTES = np.random.default_rng(1).integers(0, 256, (3, 5, 4), np.uint8)


def assert_same(one, two):
    """Two scenes hold the same; textures are compared by what they hold, as each is equal to itself alone."""
    assert (one.lights, one.camera, one.background, one.up) == (two.lights, two.camera, two.background, two.up)
    assert one.depth_cue == two.depth_cue
    assert len(one.meshes) == len(two.meshes)
    for a, b in zip(one.meshes, two.meshes, strict=True):
        for key in ("name", "crease_angle", "weighting", "drop_bad_faces"):
            assert getattr(a, key) == getattr(b, key), f"{key}: {getattr(a, key)} != {getattr(b, key)}"
        for key in ARRAYS:
            x, y = getattr(a, key), getattr(b, key)
            assert (x is None) == (y is None), f"{key}: {x is None} != {y is None}"
            assert x is None or (x.dtype == y.dtype and x.tobytes() == y.tobytes() and x.shape == y.shape), key
            assert y is None or not y.flags.writeable
        assert (a.materials is None) == (b.materials is None) and len(a.palette) == len(b.palette)
        for m, n in zip(a.palette, b.palette, strict=True):
            plain = {"texture": None, "metallic_roughness": None}
            assert replace(m, **plain) == replace(n, **plain)
            assert [type(getattr(m, f.name)) for f in fields(m)] == [type(getattr(n, f.name)) for f in fields(n)]
            for one, other in ((m.texture, n.texture), (m.metallic_roughness, n.metallic_roughness)):
                assert (one is None) == (other is None)
                if one is not None:
                    assert len({(t.filter, t.wrap, t.name) for t in (one, other)}) == 1
                    assert one.image.tobytes() == other.image.tobytes()


def round_trip(scene, folder):
    path = folder / "scene.json"
    assert rz.save(scene, path) == path
    again = rz.load(path)
    assert_same(scene, again)
    return again


def test_models_and_all_kinds_of_arrays(tmp_path):
    for name in ("still_life.obj", "gear.stl"):
        round_trip(rz.load(ROOT / "models" / name), tmp_path)
    rng = np.random.default_rng(3)
    colors = rng.random((4, 4))
    meshes = [
        rz.Mesh(SQUARE, [[0, 1, 2, 3]], normals=rng.normal(size=(4, 3)), colors=colors, uv=UV, name="a"),
        rz.Mesh(SQUARE, TWO, normals=rng.normal(size=(2, 3, 3)), uv=rng.random((2, 3, 2)), crease_angle=0.1 + 0.2),
        rz.Mesh(SQUARE, TWO, face_colors=colors[:2], smoothing=[1, 0], polygons=[0, 0]),
        rz.Mesh(SQUARE, TWO, colors=rng.random((2, 3, 4))),
        rz.Mesh(SQUARE, TWO, normals=[[0, 0, 0], [0, 0, 1], [1, 2, 3], [1e-5, 1, 0]]),
        rz.Mesh(np.vstack([SQUARE, [[np.nan] * 3]]), [[0, 1, 2], [0, 2, 4]], drop_bad_faces=True),
    ]
    round_trip(rz.Scene(meshes), tmp_path)


def test_materials_and_lights_to_the_last_bit(tmp_path):
    """Coloured and spectral coefficients, brushed materials, weightings, the shape of a spot's fall, a depth cue; a
    material is written once."""
    ramp = rz.Spectrum([400, 510.5, 700], [0.1, 1 / 3, 0.7])
    brushed = {"reflection": "cook-torrance", "roughness": (0.1, 1 / 3)}
    looks = [
        rz.Material(fresnel=(0.1, 0.2, 1 / 3)), rz.Material(fresnel=ramp), rz.Material(fresnel="white"),
        rz.Material.named("gold"), rz.Material(diffuse=ramp, specular=ramp),
        rz.Material(**brushed), rz.Material(**brushed, tangent=(1, 2, 3), fresnel=(1, 0.5, 0)),
        *(rz.Material(**brushed, tangent=axis) for axis in np.random.default_rng(2).normal(size=(9, 3))),
    ]  # fmt: skip
    words = ("angle", "area", "uniform")
    meshes = [rz.Mesh(SQUARE, TWO, uv=UV, material=look, weighting=words[k % 3]) for k, look in enumerate(looks)]
    lights = [rz.SpotLight((1, 2, 3), (1, 2, 3), falloff=1 / 3), rz.SpotLight((1, 2, 3), (0, 0, 1), color=ramp)]
    for cue in (None, 2.0, rz.DepthCue(1 / 3, 0.1, (0.1, 0.2, 0.3)), rz.DepthCue(1, color=ramp)):
        again = round_trip(rz.Scene(meshes, lights, depth_cue=cue), tmp_path)
    assert isinstance(again.lights[1].color, rz.Spectrum) and isinstance(again.meshes[4].material.diffuse, rz.Spectrum)
    red = rz.Material(diffuse="red", name='the "red"\n\\ one\x7f é☃')
    odd = rz.Material(reflection="toon", levels=7, fresnel=0.25)
    many = rz.Mesh(SQUARE, TWO, materials=[red, odd, red], face_material=[0, 2])
    again = round_trip(rz.Scene([many, rz.Mesh(SQUARE, [[0, 1, 2]], material=odd)]), tmp_path)
    first, second, third = again.meshes[0].materials
    assert first is third and again.meshes[1].material is second


def test_textures(tmp_path):
    images = [BYTES, BYTES[..., :3], BYTES[..., 0], np.random.default_rng(2).random((4, 2, 3)), np.full((1, 1, 3), 7.5)]
    textures = [rz.Texture(image, "nearest", ("clamp", "mirror"), name=f"t{i}") for i, image in enumerate(images)]
    textures.append(rz.Texture(BYTES[:1]))
    almost = rz.Texture(BYTES).image.copy()
    almost[1, 2, 0] = np.nextafter(almost[1, 2, 0], np.float32(2))
    textures += [rz.Texture(np.arange(256, dtype=np.uint8).reshape(16, 16)), rz.Texture(almost)]
    meshes = [rz.Mesh(SQUARE, [[0, 1, 2]], uv=UV, material=rz.Material(texture=texture)) for texture in textures]
    metal = {"reflection": "cook-torrance", "metallic": 0.75, "metal": (0.9, 0.5, 0.25)}
    numbers = textures[1], rz.Texture.of_numbers(BYTES, name="of numbers")
    made = [rz.Material(texture=textures[1], metallic_roughness=each, **metal) for each in numbers]
    meshes += [rz.Mesh(SQUARE, [[0, 1, 2]], uv=np.tile(UV, 2), material=each) for each in made]
    shared = rz.Material(texture=textures[0], diffuse=1.0)
    again = round_trip(rz.Scene([*meshes, rz.Mesh(SQUARE, [[0, 1, 2]], uv=UV, material=shared)]), tmp_path)
    pictures = sorted(name for name in os.listdir(tmp_path) if name.endswith(".png"))
    assert pictures == [f"scene-texture{i}.png" for i in (0, 1, 2, 5, 6)], "the others are not of 8 bits"
    first, last = again.meshes[0].material.texture, again.meshes[-1].material.texture
    assert first.image.tobytes() == last.image.tobytes()


def test_lights_of_all_kinds_and_cameras_of_all_lenses(tmp_path):
    falling = {
        "color": (1 / 3, 0, 9), "attenuation": (0.1, 1 / 3, 2), "attached": "camera", "amplify": True, "range": 1 / 3,
        "shadow": rz.Shadow(64, 3),
    }  # fmt: skip
    lights = [
        rz.AmbientLight(1 / 3), rz.DirectionalLight((1, 2, 3), 0.1, "camera", rz.Shadow()),
        rz.PointLight((1 / 3, 2, 3), **falling), rz.PointLight((0, 0, 1)),
        rz.SpotLight((1, 2, 3), (3, 2, 1), inner=1 / 3, outer=40.1, exponent=1 / 3, **falling),
        rz.AreaLight((0, 0, 1 / 3), (1, 0.5, 0), (0, 0.1, 3), resolution=(2, 9), **falling),
    ]  # fmt: skip
    of_pixels = {"intrinsics": (800.1, 799.9, 1 / 3, 99), "size": (640, 480), "skew": -1 / 3}
    for lens in ({"fov": 100 / 3, "near": 0.1, "far": 9.1}, {"height": 1 / 3, "aspect": 0.3}, of_pixels):
        camera = rz.Camera(position=(1 / 3, 2, 3), target=(7e7, 0, 0), up=(1, 2, 3), **lens)
        round_trip(rz.Scene(rz.Mesh(SQUARE, TWO), lights, camera, (0.1, 1 / 3, 0), up="-z"), tmp_path)


# --- the files themselves -----------------------------------------------------------------------------------


def test_files_are_few_and_the_same_on_every_day(tmp_path, monkeypatch, pass_days):
    scene = rz.load(ROOT / "models" / "cube.obj")
    monkeypatch.chdir(tmp_path)
    rz.save(scene, "a.json")
    contents = {name: (tmp_path / name).read_bytes() for name in os.listdir()}
    assert set(contents) == {"a.json", "a.npz"}
    pass_days(100)
    rz.save(scene, "a.json")
    assert contents == {name: (tmp_path / name).read_bytes() for name in os.listdir()}
    text = contents["a.json"].decode()
    assert "shadow" not in text and text.endswith("\n")
    monkeypatch.chdir(ROOT)
    assert_same(rz.load(tmp_path / "a.json"), scene)


def test_what_cannot_be_written(tmp_path, monkeypatch):
    scene = rz.Scene(rz.Mesh(SQUARE, [[0, 1, 2]]))
    with pytest.raises(rz.SceneError, match="saved as .json; given 'a.toml'"):
        rz.save(scene, tmp_path / "a.toml")
    with pytest.raises(rz.OutputError, match="there is no folder"):
        rz.save(scene, tmp_path / "none" / "a.json")
    assert os.listdir(tmp_path) == []
    lost = rz.Scene(rz.Mesh(SQUARE, [[0, 1, 2]], name="\ud800"))
    assert_same(rz.load(rz.save(lost, tmp_path / "a.json")), lost)


def test_a_fault_while_writing_leaves_the_old_files(tmp_path, monkeypatch):
    """The system's disk is full."""
    path = rz.save(rz.Scene(rz.Mesh(SQUARE, [[0, 1, 2]])), tmp_path / "a.json")
    before = {name: (tmp_path / name).read_bytes() for name in os.listdir(tmp_path)}

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(rz.OutputError, match="No space left on device"):
        rz.save(rz.Scene(rz.Mesh(SQUARE + 1, [[0, 1, 2]])), path)
    assert before == {name: (tmp_path / name).read_bytes() for name in os.listdir(tmp_path)}


def test_damaged_arrays(tmp_path):
    path = rz.save(rz.Scene(rz.Mesh(SQUARE, [[0, 1, 2]])), tmp_path / "a.json")
    content = (tmp_path / "a.npz").read_bytes()
    for damaged in (b"", content[:100], content[:-30], content.replace(b"mesh0_faces", b"mesh9_faces")):
        (tmp_path / "a.npz").write_bytes(damaged)
        with pytest.raises(rz.ModelError, match=r"a.json: meshes\[0\]: arrays: "):
            rz.load(path)
    np.savez(tmp_path / "a.npz", mesh0_vertices=np.array([object()]), mesh0_faces=[[0, 1, 2]])
    with pytest.raises(rz.ModelError, match="can't be read as .npz"):
        rz.load(path)
