"""Tests of how surfaces of glTF files reflect: metallic and roughness, the extensions, and what is left out."""

import base64
import io

import numpy as np
import pytest
from helpers.model_bytes import gltf_with
from helpers.refusals import assert_refused
from PIL import Image

from rasterizer.errors import ModelError
from rasterizer.io.loader import load

BASE = (0.5, 0.25, 1.0)


def png(pixels) -> str:
    stream = io.BytesIO()
    Image.fromarray(np.array(pixels, np.uint8)).save(stream, "png")
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()


def gltf(material, picture=None, change=None, is_by_trimesh=False) -> bytes:
    """A box with a material; `picture` is texture 0."""

    def changed(tree, primitive):
        if not is_by_trimesh:
            tree["asset"] = {"version": "2.0"}
        if picture is not None:
            tree["images"], tree["textures"] = [{"uri": png(picture)}], [{"source": 0}]
        tree["materials"], primitive["material"] = [material], 0
        if change is not None:
            change(tree, primitive)

    return gltf_with(changed)


def material_of(source, *args, **kwargs):
    (mesh,) = load(gltf(source, *args, **kwargs), format="gltf").meshes
    return mesh.material


def with_uv(tree, primitive):
    """Give the box texture coordinates."""
    uv = base64.b64encode(np.linspace(0, 1, 16, dtype=np.float32).tobytes()).decode()
    tree["buffers"].append({"uri": f"data:;base64,{uv}", "byteLength": 64})
    tree["bufferViews"].append({"buffer": len(tree["buffers"]) - 1, "byteLength": 64})
    view = len(tree["bufferViews"]) - 1
    tree["accessors"].append({"bufferView": view, "componentType": 5126, "count": 8, "type": "VEC2"})
    primitive["attributes"]["TEXCOORD_0"] = len(tree["accessors"]) - 1


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


def test_what_is_no_number_is_refused():
    nan, inf = float("nan"), float("inf")
    wrong = {
        "metallicFactor": ["much", nan], "roughnessFactor": [[1], nan],
        "baseColorFactor": [[1, 1, 1], 1, [1, 1, 1, inf]], "metallicRoughnessTexture": [{"index": "x"}, 1],
    }  # fmt: skip
    cases = [({name: value}, "") for name, values in wrong.items() for value in values]
    assert_refused(lambda each: material_of(metal(**each) | {"alphaMode": "BLEND"}), cases, ModelError, "model: ")


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
