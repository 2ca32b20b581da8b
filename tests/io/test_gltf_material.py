"""Tests of textures in glTF files: where their bytes are, samplers, alpha modes, texture coordinates, and what is
missing."""

import base64
import io
import json
import math
import struct
import warnings

import numpy as np
import pytest
import trimesh
from helpers.model_bytes import box, embedded_gltf, gltf_with
from PIL import Image

from rasterizer.errors import ModelError
from rasterizer.io.gltf_material import uv_from_gltf
from rasterizer.io.loader import load
from rasterizer.scene.texture import Texture

PIXELS = np.array([[[255, 0, 0, 255], [0, 255, 0, 128]], [[0, 0, 255, 51], [90, 90, 90, 0]]], np.uint8)
UV = np.array([(k / 8, k / 16) for k in range(8)], np.float32)


def png(pixels=PIXELS) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "png")
    return stream.getvalue()


def data_uri(data) -> str:
    return "data:image/png;base64," + base64.b64encode(data).decode()


def add_accessor(tree, array, kind, component) -> int:
    uri = "data:;base64," + base64.b64encode(array.tobytes()).decode()
    tree["buffers"].append({"uri": uri, "byteLength": array.nbytes})
    tree["bufferViews"].append({"buffer": len(tree["buffers"]) - 1, "byteLength": array.nbytes})
    view = len(tree["bufferViews"]) - 1
    tree["accessors"].append({"bufferView": view, "componentType": component, "count": len(array), "type": kind})
    return len(tree["accessors"]) - 1


def textured(image=None, sampler=None, material=(), use=(), uv=UV, component=5126, uv_set=0, more=None) -> bytes:
    """A glTF box with a texture."""

    def change(tree, primitive):
        tree["images"] = [{"uri": data_uri(png())} if image is None else image]
        tree["textures"] = [{"source": 0}]
        if sampler is not None:
            tree["samplers"], tree["textures"][0]["sampler"] = [sampler], 0
        surface = {"baseColorTexture": {"index": 0, **dict(use)}, **dict(material).pop("pbr", {})}
        tree["materials"] = [
            {"pbrMetallicRoughness": surface} | {k: v for k, v in dict(material).items() if k != "pbr"}
        ]
        primitive["material"] = 0
        if uv is not None:
            primitive["attributes"][f"TEXCOORD_{uv_set}"] = add_accessor(tree, uv, "VEC2", component)
        if more:
            more(tree, primitive)

    return gltf_with(change)


def only_mesh(data, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (mesh,) = load(data, format="gltf", **options).meshes
    return mesh


def texture_of(**parts) -> Texture:
    return only_mesh(textured(**parts)).material.texture


def uv_of(mesh):
    """Texture coordinates of each corner."""
    return mesh.uv if mesh.uv.ndim == 3 else mesh.uv[mesh.faces]


# --- where the bytes are ------------------------------------------------------------------------------------


def test_a_texture_in_a_data_uri():
    mesh = only_mesh(textured(material={"pbr": {"baseColorFactor": [0.5, 0.25, 1, 0.5]}}))
    expected = Texture(PIXELS)
    np.testing.assert_array_equal(mesh.material.texture.image[..., :3], expected.image[..., :3])
    assert mesh.material.diffuse == (0.48, 0.24, 0.96) and np.allclose(mesh.material.ambient, (0.52, 0.28, 1.0))
    assert mesh.material.opacity == 1.0 and mesh.material.texture.name == "image 0"


def test_a_texture_beside_the_model(tmp_path):
    (tmp_path / "my wood.png").write_bytes(png())
    (tmp_path / "m.gltf").write_bytes(textured(image={"uri": "my%20wood.png"}))
    (mesh,) = load(tmp_path / "m.gltf").meshes
    assert mesh.material.texture.image.shape == (2, 2, 4) and mesh.material.texture.name == "my%20wood.png"


def test_a_texture_in_a_buffer_view():
    data = b"xyz" + png()

    def more(tree, _primitive):
        tree["buffers"].append({"uri": "data:;base64," + base64.b64encode(data).decode(), "byteLength": len(data)})
        tree["bufferViews"].append({"buffer": len(tree["buffers"]) - 1, "byteOffset": 3, "byteLength": len(data) - 3})
        tree["images"][0]["bufferView"] = len(tree["bufferViews"]) - 1

    assert texture_of(image={"mimeType": "image/png", "name": "wood"}, more=more).name == "wood"


def test_a_texture_in_the_binary_chunk_of_a_glb():
    picture = png()
    tree = embedded_gltf(trimesh.Scene(box()))
    chunk = picture + b"\0" * (-len(picture) % 4)
    tree["buffers"].insert(0, {"byteLength": len(chunk)})
    for view in tree["bufferViews"]:
        view["buffer"] += 1
    tree["bufferViews"].append({"buffer": 0, "byteLength": len(picture)})
    tree["images"] = [{"bufferView": len(tree["bufferViews"]) - 1, "mimeType": "image/png"}]
    tree["textures"] = [{"source": 0}]
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    primitive = tree["meshes"][0]["primitives"][0]
    primitive["material"] = 0
    primitive["attributes"]["TEXCOORD_0"] = add_accessor(tree, UV, "VEC2", 5126)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(chunk)
    data = struct.pack("<5I", 0x46546C67, 2, total, len(text), 0x4E4F534A) + text
    data += struct.pack("<2I", len(chunk), 0x004E4942) + chunk
    (mesh,) = load(data, format="glb").meshes
    np.testing.assert_array_equal(mesh.material.texture.image[..., :3], Texture(PIXELS).image[..., :3])


def test_materials_share_a_texture_and_a_picture_is_read_once(monkeypatch):
    from rasterizer.io import gltf_material

    reads = []
    monkeypatch.setattr(gltf_material, "read_picture", lambda *given: reads.append(given) or PIXELS)

    def more(tree, primitive):
        tree["materials"] += [dict(tree["materials"][0]), tree["materials"][0] | {"alphaMode": "BLEND"}]
        tree["meshes"][0]["primitives"] += [primitive | {"material": 1}, primitive | {"material": 2}]

    first, second, third = (mesh.material.texture for mesh in load(textured(more=more), format="gltf").meshes)
    assert first is second and third is not first and len(reads) == 1


def test_materials_that_no_mesh_uses_need_no_pictures():
    def more(tree, primitive):
        tree["materials"].append({})
        primitive["material"] = 1

    assert only_mesh(textured(image={"uri": "gone.png"}, more=more)).material.texture is None


# --- samplers and alpha -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sampler", "filter"),
    [
        (None, "trilinear"),
        ({}, "trilinear"),
        ({"magFilter": 9728}, "nearest"),
        ({"magFilter": 9728, "minFilter": 9987}, "nearest"),
        ({"minFilter": 9728}, "nearest"),
        ({"magFilter": 9729}, "trilinear"),
        ({"magFilter": 9729, "minFilter": 9729}, "bilinear"),
        ({"magFilter": 9729, "minFilter": 9728}, "bilinear"),
        ({"minFilter": 9729}, "bilinear"),
        ({"magFilter": 9729, "minFilter": 9985}, "trilinear"),
    ],
)
def test_filters(sampler, filter):
    assert texture_of(sampler=sampler).filter == filter


def test_wraps():
    assert texture_of().wrap == ("repeat", "repeat")
    assert texture_of(sampler={"wrapS": 33071, "wrapT": 33648}).wrap == ("clamp", "mirror")
    with pytest.raises(ModelError, match="not a readable glTF file"):
        texture_of(sampler={"wrapS": 7})


ALPHA = PIXELS[..., 3] / np.float32(255)


@pytest.mark.parametrize(
    ("material", "alpha", "opacity"),
    [
        ({}, np.ones((2, 2)), 1.0),
        ({"alphaMode": "OPAQUE"}, np.ones((2, 2)), 1.0),
        ({"alphaMode": "BLEND"}, ALPHA, 0.5),
        ({"alphaMode": "MASK"}, ALPHA * 0.5 >= 0.5, 1.0),
        ({"alphaMode": "MASK", "alphaCutoff": 0.25}, ALPHA * 0.5 >= 0.25, 1.0),
        ({"alphaMode": "MASK", "alphaCutoff": 0}, np.ones((2, 2)), 1.0),
    ],
)
def test_alpha_modes(material, alpha, opacity):
    pbr = {"pbr": {"baseColorFactor": [1, 1, 1, 0.5]}}
    found = only_mesh(textured(material=material | pbr)).material
    np.testing.assert_array_equal(found.texture.image[..., 3], np.asarray(alpha, np.float32))
    assert found.opacity == opacity


@pytest.mark.parametrize(
    ("mode", "alpha", "opacity"), [("OPAQUE", 0.3, 1), ("BLEND", 0.3, 0.3), ("MASK", 0.3, 0), ("MASK", 0.5, 1)]
)
def test_alpha_modes_without_a_texture(mode, alpha, opacity):
    def change(tree, primitive):
        tree["materials"] = [{"alphaMode": mode, "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, alpha]}}]
        primitive["material"] = 0

    assert only_mesh(gltf_with(change)).material.opacity == opacity


def test_unknown_alpha_mode():
    with pytest.raises(ModelError, match="alphaMode must be OPAQUE, MASK or BLEND; given 'DITHER'"):
        texture_of(material={"alphaMode": "DITHER"})


# --- texture coordinates ------------------------------------------------------------------------------------


def test_v_points_up():
    mesh = only_mesh(textured())
    corners = uv_of(mesh).reshape(-1, 2)
    assert {tuple(pair) for pair in corners} <= {(float(u), 1.0 - float(v)) for u, v in UV}
    # the vertices of the box are distinct, so each has kept its own
    positions = {tuple(p): tuple(t) for p, t in zip(box().vertices.tolist(), UV.tolist(), strict=True)}
    for position, (u, v) in zip(mesh.vertices[mesh.faces].reshape(-1, 3).tolist(), corners.tolist(), strict=True):
        assert positions[tuple(position)] == (u, 1.0 - v)


@pytest.mark.parametrize(("dtype", "component", "scale"), [("u1", 5121, 255), ("<u2", 5123, 65535)])
def test_normalised_integers(dtype, component, scale):
    # rows of an accessor begin at multiples of four bytes
    uv = np.array([(k * scale // 8, k) for k in range(8)], dtype)

    if dtype == "u1":
        np.testing.assert_allclose(uv_from_gltf(uv, None), [(u / scale, 1 - v / scale) for u, v in uv.tolist()])
        return
    corners = uv_of(only_mesh(textured(uv=uv, component=component))).reshape(-1, 2)
    assert {tuple(np.round(c, 9)) for c in corners} == {
        tuple(np.round((u / scale, 1 - v / scale), 9)) for u, v in uv.tolist()
    }


def test_other_sets_of_coordinates():
    def more(tree, primitive):
        primitive["attributes"]["TEXCOORD_0"] = add_accessor(tree, np.zeros_like(UV), "VEC2", 5126)

    mesh = only_mesh(textured(uv_set=1, use={"texCoord": 1}, more=more))
    assert uv_of(mesh)[..., 0].max() > 0.5
    transform = {"extensions": {"KHR_texture_transform": {"texCoord": 1}}}
    assert uv_of(only_mesh(textured(uv_set=1, use=transform, more=more)))[..., 0].max() > 0.5
    assert uv_of(only_mesh(textured(uv_set=1, more=more)))[..., 0].max() == 0


def test_texture_transform():
    """Scale, then a quarter turn counter-clockwise as seen with v down, (1, 0) to (0, -1), then the offset."""
    change = {"offset": [0.25, 0.5], "rotation": math.pi / 2, "scale": [2, 3]}
    mesh = only_mesh(textured(use={"extensions": {"KHR_texture_transform": change}}))
    expected = {tuple(np.round((0.25 + 3 * v, 1 - (0.5 - 2 * u)), 6)) for u, v in UV.astype(float)}
    assert {tuple(np.round(pair, 6)) for pair in uv_of(mesh).reshape(-1, 2)} == expected


# --- what is missing ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("image", "fault"),
    [
        ({"uri": "gone.png"}, r"texture 'gone\.png': needs the file 'gone\.png'"),
        ({"uri": data_uri(b"hello"), "name": "wood"}, "texture 'wood': image 0: can't be read as a picture"),
        ({"uri": "data:image/png;base64,!!!"}, "texture 'image 0': "),
    ],
)
def test_a_missing_picture_is_warned_of_and_the_plain_colour_kept(tmp_path, image, fault):
    path = tmp_path / "m.gltf"
    path.write_bytes(textured(image=image, material={"pbr": {"baseColorFactor": [0.5, 0, 0, 1]}}))
    with pytest.warns(UserWarning, match=fault) as caught:
        (mesh,) = load(path).meshes
    assert mesh.material.texture is None and mesh.material.diffuse == (0.48, 0, 0)
    assert len(caught) == 1 and str(caught[0].message).count(str(path)) <= 2


def test_a_texture_without_an_image():
    def more(tree, _primitive):
        tree["textures"] = [{}]

    with pytest.warns(UserWarning, match="the texture has no image"):
        load(textured(more=more), format="gltf")


def test_the_source_of_an_extension_is_tried():
    def more(tree, _primitive):
        tree["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]

    assert texture_of(more=more) is not None


def test_a_mesh_without_coordinates_loses_the_texture():
    with pytest.warns(UserWarning, match="mesh '.*' has no texture coordinates; .* the texture of its material 'wood'"):
        (mesh,) = load(textured(uv=None, material={"name": "wood"}), format="gltf").meshes
    assert mesh.material.texture is None and mesh.material.name == "wood"


@pytest.mark.parametrize("key", ["textures", "images"])
def test_references_to_what_is_not_there(key):
    def more(tree, _primitive):
        tree[key] = []

    with pytest.raises(ModelError, match=f"not a readable glTF file .*{key} has no number 0"):
        load(textured(more=more), format="gltf")


def test_facts_count_textures():
    facts = []
    only_mesh(textured(), log=facts.append)
    assert "1 texture" in facts[-1]
