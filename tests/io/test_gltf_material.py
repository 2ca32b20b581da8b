"""Textures in glTF files: where their bytes are, samplers, alpha modes, texture coordinates, and what is missing."""

import base64
import io
import json
import math
import struct
import warnings
from contextlib import nullcontext

import numpy as np
import pytest
import trimesh
from helpers.arrays import deviations
from helpers.model_bytes import box, embedded_gltf, gltf_with
from helpers.refusals import assert_refused
from PIL import Image

from rasterizer.errors import ModelError
from rasterizer.io.loader import load
from rasterizer.scene.texture import Texture

PIXELS = np.array([[[255, 0, 0, 255], [0, 255, 0, 128]], [[0, 0, 255, 51], [90, 90, 90, 0]]], np.uint8)
UV = np.array([(k / 8, k / 16) for k in range(8)], np.float32)


def png(pixels=PIXELS) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "png")
    return stream.getvalue()


def uri(data, kind="image/png") -> str:
    return f"data:{kind};base64," + base64.b64encode(data).decode()


def add_accessor(tree, array, component=5126) -> int:
    tree["buffers"].append({"uri": uri(array.tobytes(), ""), "byteLength": array.nbytes})
    tree["bufferViews"].append({"buffer": len(tree["buffers"]) - 1, "byteLength": array.nbytes})
    view = len(tree["bufferViews"]) - 1
    tree["accessors"].append({"bufferView": view, "componentType": component, "count": len(array), "type": "VEC2"})
    return len(tree["accessors"]) - 1


def textured(image=None, sampler=None, use=(), uv=UV, component=5126, uv_set=0, more=None, pbr=(), **material) -> bytes:
    """A glTF box with a texture."""

    def change(tree, primitive):
        tree["images"] = [{"uri": uri(png())} if image is None else image]
        tree["textures"] = [{"source": 0}]
        if sampler is not None:
            tree["samplers"], tree["textures"][0]["sampler"] = [sampler], 0
        surface = {"baseColorTexture": {"index": 0, **dict(use)}, **dict(pbr)}
        tree["materials"], primitive["material"] = [{"pbrMetallicRoughness": surface} | material], 0
        if uv is not None:
            primitive["attributes"][f"TEXCOORD_{uv_set}"] = add_accessor(tree, uv, component)
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


def uv_of(**parts):
    """Texture coordinates of each corner."""
    mesh = only_mesh(textured(**parts))
    return (mesh.uv if mesh.uv.ndim == 3 else mesh.uv[mesh.faces]).reshape(-1, 2)


def rounded(pairs):
    return {tuple(np.round(pair, 6)) for pair in pairs}


# --- where the bytes are ------------------------------------------------------------------------------------


def test_a_texture_in_a_data_uri_multiplies_the_base_colour():
    facts = []
    mesh = only_mesh(textured(pbr={"baseColorFactor": [0.5, 0.25, 1, 0.5]}), log=facts.append)
    np.testing.assert_array_equal(mesh.material.texture.image[..., :3], Texture(PIXELS).image[..., :3])
    assert mesh.material.diffuse == (0.48, 0.24, 0.96)
    assert not deviations(mesh.material.ambient, (0.52, 0.28, 1.0))
    assert mesh.material.opacity == 1.0 and mesh.material.texture.name == "image 0" and "1 texture" in facts[-1]


def test_a_texture_beside_the_model_or_in_a_buffer_view(tmp_path):
    (tmp_path / "my wood.png").write_bytes(png())
    (tmp_path / "m.gltf").write_bytes(textured(image={"uri": "my%20wood.png"}))
    (mesh,) = load(tmp_path / "m.gltf").meshes
    assert mesh.material.texture.image.shape == (2, 2, 4) and mesh.material.texture.name == "my%20wood.png"
    data = b"xyz" + png()

    def more(tree, _primitive):
        tree["buffers"].append({"uri": uri(data, ""), "byteLength": len(data)})
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
    primitive["attributes"]["TEXCOORD_0"] = add_accessor(tree, UV)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    data = struct.pack("<5I", 0x46546C67, 2, 28 + len(text) + len(chunk), len(text), 0x4E4F534A) + text
    data += struct.pack("<2I", len(chunk), 0x004E4942) + chunk
    (mesh,) = load(data, format="glb").meshes
    np.testing.assert_array_equal(mesh.material.texture.image[..., :3], Texture(PIXELS).image[..., :3])


def test_materials_share_a_texture_and_unused_ones_need_no_pictures():
    def more(tree, primitive):
        tree["textures"].append({"source": 0})  # another one that is the same
        other = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}}
        tree["materials"] += [other, tree["materials"][0] | {"alphaMode": "BLEND"}]
        tree["meshes"][0]["primitives"] += [primitive | {"material": 1}, primitive | {"material": 2}]

    first, second, third = (mesh.material.texture for mesh in load(textured(more=more), format="gltf").meshes)
    assert first is second and third is not first

    def unused(tree, primitive):
        tree["materials"].append({})
        primitive["material"] = 1

    assert texture_of(image={"uri": "gone.png"}, more=unused) is None


def test_what_is_wrong_with_a_picture_is_said_in_the_order_of_materials(tmp_path):
    """Those before it and behind it are shown, each of which is read once."""
    contents = {"a.png": png(), "cut.png": png()[:60], "b.png": png(PIXELS[::-1])}
    for name, data in contents.items():
        (tmp_path / name).write_bytes(data)

    def more(tree, primitive):
        names = ["b.png", "cut.png", "gone.png", "a.png"]
        tree["images"] += [{"uri": name} for name in names]
        tree["textures"] += [{"source": k} for k in range(1, 5)]
        tree["materials"] += [{"pbrMetallicRoughness": {"baseColorTexture": {"index": k}}} for k in range(1, 5)]
        tree["meshes"][0]["primitives"] += [primitive | {"material": k} for k in range(1, 5)]

    path, files = tmp_path / "box.gltf", []
    path.write_bytes(textured(image={"uri": "a.png"}, more=more))
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        textures = [mesh.material.texture for mesh in load(path, files_read=files).meshes]
    assert [name in str(each.message) for name, each in zip(("cut", "gone"), warned, strict=True)] == [True, True]
    shown = [None if texture is None else texture.encoded[..., :3].tolist() for texture in textures]
    first = PIXELS[..., :3].tolist()
    assert shown == [first, first[::-1], None, None, first]
    assert [file.rpartition("/")[2] for file in files] == ["a.png", "b.png", "cut.png", "a.png"]


# --- samplers and alpha -------------------------------------------------------------------------------------


def test_filters_and_wraps():
    for sampler, filter in (
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
    ):
        texture = texture_of(sampler=sampler)
        assert texture.filter == filter and texture.wrap == ("repeat", "repeat"), f"{sampler}: {texture}"
    assert texture_of(sampler={"wrapS": 33071, "wrapT": 33648}).wrap == ("clamp", "mirror")


def test_alpha_modes():
    alpha = PIXELS[..., 3] / np.float32(255)
    pbr = {"baseColorFactor": [1, 1, 1, 0.5]}
    for material, expected, *numbers in (
        ({}, np.ones((2, 2)), 1.0, None),
        ({"alphaMode": "OPAQUE"}, np.ones((2, 2)), 1.0, None),
        ({"alphaMode": "BLEND"}, alpha, 0.5, None),
        ({"alphaMode": "MASK"}, alpha, 0.5, 0.5),
        ({"alphaMode": "MASK", "alphaCutoff": 0.25}, alpha, 0.5, 0.25),
        ({"alphaMode": "MASK", "alphaCutoff": 0}, alpha, 0.5, 0.0),
    ):
        found = only_mesh(textured(pbr=pbr, **material)).material
        np.testing.assert_array_equal(found.texture.image[..., 3], np.float32(expected), err_msg=str(material))
        assert [found.opacity, found.alpha_cutoff] == numbers, str(material)
    for mode, alpha, opacity in (("OPAQUE", 0.3, 1), ("BLEND", 0.3, 0.3), ("MASK", 0.3, 0.3), ("MASK", 0.5, 0.5)):

        def change(tree, primitive, mode=mode, alpha=alpha):
            tree["materials"] = [{"alphaMode": mode, "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, alpha]}}]
            primitive["material"] = 0

        is_gone = mode == "MASK" and alpha < 0.5
        with nullcontext() if not is_gone else pytest.warns(UserWarning, match="all its materials are invisible"):
            found = load(gltf_with(change), format="gltf").meshes[0].material.opacity
        assert found == opacity, f"{mode} {alpha}: {found} != {opacity}"


# --- texture coordinates ------------------------------------------------------------------------------------


def test_v_points_up_and_vertices_keep_their_own():
    mesh = only_mesh(textured())
    corners = (mesh.uv if mesh.uv.ndim == 3 else mesh.uv[mesh.faces]).reshape(-1, 2)
    positions = {tuple(p): tuple(t) for p, t in zip(box().vertices.tolist(), UV.tolist(), strict=True)}
    for position, (u, v) in zip(mesh.vertices[mesh.faces].reshape(-1, 3).tolist(), corners.tolist(), strict=True):
        assert positions[tuple(position)] == (u, 1.0 - v)
    for dtype, component, scale in (("u1", 5121, 255), ("<u2", 5123, 65535)):  # fractions as integers
        uv = np.array([(k * scale // 8, k) for k in range(8)], dtype)
        rows = np.pad(uv, ((0, 0), (0, 2))) if dtype == "u1" else uv  # begin at multiples of four bytes

        def strided(tree, primitive, size=rows.itemsize * rows.shape[1]):
            view = tree["accessors"][primitive["attributes"]["TEXCOORD_0"]]["bufferView"]
            tree["bufferViews"][view]["byteStride"] = size

        found = rounded(uv_of(uv=rows, component=component, more=strided))
        assert found == rounded((u / scale, 1 - v / scale) for u, v in uv.tolist()), dtype


def test_sets_and_transforms_of_coordinates():
    """Scale, then a quarter turn counter-clockwise as seen with v down, (1, 0) to (0, -1), then the offset."""

    def more(tree, primitive):
        primitive["attributes"]["TEXCOORD_0"] = add_accessor(tree, np.zeros_like(UV))

    transform = {"extensions": {"KHR_texture_transform": {"texCoord": 1}}}
    for use, most in (({"texCoord": 1}, 0.875), (transform, 0.875), ({}, 0.0)):
        assert uv_of(uv_set=1, use=use, more=more)[:, 0].max() == most, use
    change = {"offset": [0.25, 0.5], "rotation": math.pi / 2, "scale": [2, 3]}
    found = uv_of(use={"extensions": {"KHR_texture_transform": change}})
    assert rounded(found) == rounded((0.25 + 3 * v, 1 - (0.5 - 2 * u)) for u, v in UV.astype(float))


# --- what is missing ----------------------------------------------------------------------------------------


def test_a_texture_may_have_its_image_by_an_extension_or_none():
    source = {"extensions": {"EXT_texture_webp": {"source": 0}}}
    assert texture_of(more=lambda tree, _: tree.update(textures=[source])) is not None
    with pytest.warns(UserWarning, match="the texture has no image"):
        load(textured(more=lambda tree, _: tree.update(textures=[{}])), format="gltf")


def test_what_is_not_legal_is_refused():
    cases = [
        ({"alphaMode": "DITHER"}, "alphaMode must be OPAQUE, MASK or BLEND; given 'DITHER'"),
    ]
    assert_refused(lambda parts: texture_of(**parts), cases, ModelError)


def test_what_a_texture_refers_to_in_vain_is_warned_of():
    for parts, said in (
        ({"sampler": {"wrapS": 7}}, "1 texture of a wrap that glTF doesn't have: repeated"),
        ({"more": lambda tree, _: tree["textures"][0].update(sampler=9)}, "1 texture of a sampler that isn't there"),
        ({"more": lambda tree, _: tree.update(textures=[])}, "texture 0': .*keep their plain colour"),
        ({"more": lambda tree, _: tree.update(images=[])}, "image 0': .*keep their plain colour"),
    ):
        with pytest.warns(UserWarning, match=said) as caught:
            assert load(textured(**parts), format="gltf").n_face == 12
        assert len(caught) == 1, said
