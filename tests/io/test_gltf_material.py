"""Materials of glTF files: where the bytes of textures are, samplers, alpha modes, texture coordinates, and what is
missing; how surfaces reflect, by metallic and roughness and the extensions, and what is left out."""

import json
import math
import warnings
from contextlib import nullcontext

import numpy as np
import pytest
from helpers.arrays import deviations
from helpers.gltf import add_array, add_view, glb, picture_uri, png
from helpers.model_bytes import box, gltf_with
from helpers.refusals import assert_refused

from rasterizer.errors import ModelError
from rasterizer.io.loader import load
from rasterizer.scene.texture import Texture

PIXELS = np.array([[[255, 0, 0, 255], [0, 255, 0, 128]], [[0, 0, 255, 51], [90, 90, 90, 0]]], np.uint8)
UV = np.array([(k / 8, k / 16) for k in range(8)], np.float32)


def textured(image=None, sampler=None, use=(), uv=UV, uv_set=0, more=None, pbr=(), **material) -> bytes:
    """A glTF box with a texture."""

    def change(tree, primitive):
        tree["images"] = [{"uri": picture_uri(PIXELS)} if image is None else image]
        tree["textures"] = [{"source": 0}]
        if sampler is not None:
            tree["samplers"], tree["textures"][0]["sampler"] = [sampler], 0
        surface = {"baseColorTexture": {"index": 0, **dict(use)}, **dict(pbr)}
        tree["materials"], primitive["material"] = [{"pbrMetallicRoughness": surface} | material], 0
        if uv is not None:
            primitive["attributes"][f"TEXCOORD_{uv_set}"] = add_array(tree, uv, type="VEC2")
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
    (tmp_path / "my wood.png").write_bytes(png(PIXELS))
    (tmp_path / "m.gltf").write_bytes(textured(image={"uri": "my%20wood.png"}))
    (mesh,) = load(tmp_path / "m.gltf").meshes
    assert mesh.material.texture.image.shape == (2, 2, 4) and mesh.material.texture.name == "my%20wood.png"
    data = b"xyz" + png(PIXELS)

    def more(tree, _primitive):
        tree["images"][0]["bufferView"] = add_view(tree, data, byteOffset=3, byteLength=len(data) - 3)

    assert texture_of(image={"mimeType": "image/png", "name": "wood"}, more=more).name == "wood"


def test_a_texture_in_the_binary_chunk_of_a_glb():
    tree, picture = json.loads(textured(image={"mimeType": "image/png"})), png(PIXELS)
    tree["buffers"].insert(0, {"byteLength": len(picture)})
    for view in tree["bufferViews"]:
        view["buffer"] += 1
    tree["images"][0]["bufferView"] = len(tree["bufferViews"])
    tree["bufferViews"].append({"buffer": 0, "byteLength": len(picture)})
    (mesh,) = load(glb(tree, picture), format="glb").meshes
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
    contents = {"a.png": png(PIXELS), "cut.png": png(PIXELS)[:60], "b.png": png(PIXELS[::-1])}
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
    for dtype, scale in (("u1", 255), ("<u2", 65535)):  # fractions as integers
        uv = np.array([(k * scale // 8, k) for k in range(8)], dtype)
        rows = np.pad(uv, ((0, 0), (0, 2))) if dtype == "u1" else uv  # begin at multiples of four bytes

        def strided(tree, primitive, size=rows.itemsize * rows.shape[1]):
            accessor = tree["accessors"][primitive["attributes"]["TEXCOORD_0"]]
            accessor["normalized"] = True
            tree["bufferViews"][accessor["bufferView"]]["byteStride"] = size

        found = rounded(uv_of(uv=rows, more=strided))
        assert found == rounded((u / scale, 1 - v / scale) for u, v in uv.tolist()), dtype


def test_sets_and_transforms_of_coordinates():
    """Scale, then a quarter turn counter-clockwise as seen with v down, (1, 0) to (0, -1), then the offset."""

    def more(tree, primitive):
        primitive["attributes"]["TEXCOORD_0"] = add_array(tree, np.zeros_like(UV))

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


# --- how surfaces reflect ------------------------------------------------------------------------------------

BASE = (0.5, 0.25, 1.0)


def gltf(material, picture=None, change=None, is_by_trimesh=False) -> bytes:
    """A box with a material; `picture` is texture 0."""

    def changed(tree, primitive):
        if not is_by_trimesh:
            tree["asset"] = {"version": "2.0"}
        if picture is not None:
            tree["images"], tree["textures"] = [{"uri": picture_uri(picture)}], [{"source": 0}]
        tree["materials"], primitive["material"] = [material], 0
        if change is not None:
            change(tree, primitive)

    return gltf_with(changed)


def material_of(source, *args, **kwargs):
    (mesh,) = load(gltf(source, *args, **kwargs), format="gltf").meshes
    return mesh.material


def with_uv(tree, primitive):
    """Give the box texture coordinates."""
    primitive["attributes"]["TEXCOORD_0"] = add_array(tree, np.linspace(0, 1, 16, dtype=np.float32).reshape(8, 2))


def metal(**surface) -> dict:
    return {"pbrMetallicRoughness": {"baseColorFactor": [*BASE, 1], **surface}}


def with_extension(source, name, **fields) -> dict:
    return source | {"extensions": {**source.get("extensions", {}), f"KHR_materials_{name}": fields}}


def test_metallic_and_roughness_become_cook_torrance():
    """Factors beyond their range go to its end."""
    for metallic, roughness in ((0.0, 0.0), (0.25, 0.3), (1.0, 1.0), (-1, 7), (7, 0.5)):
        material, what = material_of(metal(metallicFactor=metallic, roughnessFactor=roughness)), (metallic, roughness)
        metallic, roughness = min(max(metallic, 0), 1), min(max(roughness, 0), 1)
        assert material.reflection == "cook-torrance" and material.distribution == "ggx"
        assert material.roughness == max(0.001, roughness**2), f"{what}: {material.roughness}"
        np.testing.assert_allclose(material.diffuse, np.array(BASE) * (1 - metallic) * 0.96, err_msg=str(what))
        f0 = 0.04 + (np.array(BASE) - 0.04) * metallic
        np.testing.assert_allclose(np.broadcast_to(material.fresnel, 3), f0, err_msg=str(what))
        np.testing.assert_allclose(material.ambient, np.array(material.diffuse) + f0, err_msg=str(what))
        assert material.specular == (1, 1, 1)


def test_what_is_not_given_is_rough_metal_as_the_specification_says():
    """trimesh leaves metallic out of what is no metal."""
    material = material_of({"name": "bare"})
    assert material.fresnel == 1.0 and material.roughness == 1.0 and material.diffuse == (0, 0, 0)
    precise = {"baseColorFactor": [0.001, 0.5, 1, 0.25]}
    source = {"pbrMetallicRoughness": precise, "emissiveFactor": [0, 0.003, 0], "name": "m", "alphaMode": "BLEND"}
    material = material_of(source)
    assert material.fresnel == material.ambient == (0.001, 0.5, 1.0)
    assert (material.emissive, material.opacity, material.name) == ((0, 0.003, 0), 0.25, "m")
    assert material_of(metal(), is_by_trimesh=True).diffuse == (0.48, 0.24, 0.96)
    assert material_of(metal(metallicFactor=1), is_by_trimesh=True).diffuse == (0, 0, 0)
    assert material_of(metal()).diffuse == (0, 0, 0)


def test_textures_of_metallic_and_roughness_are_kept_but_for_what_has_no_texture_coordinates():
    """There their means count, as where all texels are the same."""
    picture = [[(9, 255, 0), (9, 0, 255)], [(9, 255, 255), (9, 255, 0)]]  # green is roughness, blue metallic
    source = metal(metallicRoughnessTexture={"index": 0}, roughnessFactor=0.8)
    material = material_of(source, picture, with_uv)
    assert (material.roughness, material.metallic, material.metal) == (pytest.approx(0.8**2), 1.0, BASE)
    np.testing.assert_allclose(material.metallic_roughness.image[..., 1:3] * 255, np.array(picture)[..., 1:])
    np.testing.assert_allclose(material.diffuse, np.array(BASE) * 0.96)
    assert material.texture.image.tolist() == [[[1, 1, 1, 1]]], "it stands for the base colour, which has none"
    with pytest.warns(UserWarning, match="no texture coordinates"):
        material = material_of(source, picture)
    assert material.roughness == pytest.approx(0.6**2) and material.metallic == pytest.approx(0.5)
    with pytest.warns(UserWarning, match="no texture coordinates"):
        grey = material_of(source, [[255, 0]])
    assert grey.roughness == pytest.approx(0.4**2)
    even = material_of(source, [[(9, 255, 0), (1, 255, 0)]], with_uv)
    assert (even.metallic_roughness, even.texture, even.roughness) == (None, None, pytest.approx(0.8**2))
    with pytest.warns(UserWarning, match="gone"):
        material = material_of(
            source, [[255]], lambda tree, _: tree.update(images=[{"uri": "data:,gone", "name": "gone"}])
        )
    assert material.roughness == pytest.approx(0.8**2)


def test_ior_and_specular():
    plastic = metal(metallicFactor=0)
    assert material_of(with_extension(plastic, "ior", ior=2.0)).fresnel == pytest.approx(1 / 9)
    assert material_of(with_extension(plastic, "ior", ior=0)).fresnel == 1.0
    none = material_of(with_extension(plastic, "specular", specularFactor=0.0))
    assert none.specular == (0, 0, 0) and none.diffuse == BASE
    tinted = material_of(with_extension(plastic, "specular", specularColorFactor=[1, 0.5, 99], specularFactor=0.5))
    np.testing.assert_allclose(tinted.fresnel, (0.04, 0.02, 1))
    assert tinted.specular == (0.5, 0.5, 0.5) and tinted.diffuse == (0.25, 0.125, 0.5)
    assert material_of(with_extension(metal(), "specular", specularFactor=0.0)).specular == (1, 1, 1), "metals keep it"


def test_emission_and_its_strength():
    source = metal() | {"emissiveFactor": [0.5, 0, 1]}
    assert material_of(source).emissive == (0.5, 0, 1)
    assert material_of(with_extension(source, "emissive_strength", emissiveStrength=4)).emissive == (2, 0, 4)
    assert material_of(source | {"emissiveTexture": {"index": 0}}, [[0]]).emissive == (0, 0, 0), (
        "it says where it glows"
    )


def test_unlit_surfaces_show_their_colour():
    source = with_extension(metal(), "unlit")
    material = material_of(source)
    assert material.emissive == BASE and material.diffuse == material.ambient == material.specular == (0, 0, 0)

    def colored(tree, primitive):
        primitive["attributes"]["COLOR_0"] = primitive["attributes"]["POSITION"]

    with pytest.warns(UserWarning, match="8 colours outside the legal range"):
        material_of(source, None, colored)


def test_specular_and_glossiness():
    glossy = {"diffuseFactor": [0.5, 0.25, 1, 1], "specularFactor": [0.2, 0.1, 0.1], "glossinessFactor": 0.75}
    material = material_of(with_extension({}, "pbrSpecularGlossiness", **glossy))
    assert material.roughness == 0.0625 and material.fresnel == (0.2, 0.1, 0.1)
    np.testing.assert_allclose(material.diffuse, (0.4, 0.2, 0.8))
    textured = glossy | {"specularGlossinessTexture": {"index": 0}}
    material = material_of(with_extension({}, "pbrSpecularGlossiness", **textured), [[(255, 255, 0, 102)]])
    np.testing.assert_allclose(material.fresnel, (0.2, 0.1, 0.0))
    assert material.roughness == pytest.approx((1 - 0.75 * 0.4) ** 2)


def test_what_is_not_legal_is_refused():
    nan, inf = float("nan"), float("inf")
    wrong = {
        "metallicFactor": ["much", nan], "roughnessFactor": [[1], nan],
        "baseColorFactor": [[1, 1, 1], 1, [1, 1, 1, inf]], "metallicRoughnessTexture": [{"index": "x"}, 1],
    }  # fmt: skip
    cases = [(metal(**{name: value}) | {"alphaMode": "BLEND"}, "") for name in wrong for value in wrong[name]]
    cases += [(metal() | {"alphaMode": "DITHER"}, "alphaMode must be OPAQUE, MASK or BLEND; given 'DITHER'")]
    assert_refused(material_of, cases, ModelError, "model: ")


def test_what_is_left_out_is_said():
    def change(tree, primitive):
        tree["animations"], tree["extensionsUsed"] = [{}], ["KHR_lights_punctual", "KHR_materials_clearcoat"]
        primitive["targets"] = [{}]
        tree["meshes"][0]["primitives"] += [
            {"attributes": {"POSITION": primitive["attributes"]["POSITION"]}, "mode": mode} for mode in range(4)
        ]

    source = with_extension(metal(metallicRoughnessTexture={"index": 0}), "sheen") | {
        "normalTexture": {"index": 0}, "occlusionTexture": {"index": 0}, "emissiveTexture": {"index": 0}
    }  # fmt: skip
    facts = []
    said = "not used: 8 points, 19 lines, normal textures, .* \\(8 in all\\)"
    with pytest.warns(UserWarning, match=said):
        load(gltf(source, [[0]], change), format="gltf", log=facts.append)
    (fact,) = facts
    assert fact.partition("; not used: ")[2].split(", ") == [
        "8 points", "19 lines", "normal textures", "occlusion textures", "emissive textures", "with their emission",
        "the extension KHR_materials_clearcoat", "the extension KHR_materials_sheen", "animations",
        "doubleSided = false (backs are drawn unless they are culled)",
    ]  # fmt: skip
