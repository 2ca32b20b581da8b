"""Metals: their F0 follows the base colour, how metallic and rough they are a texture, at every sample."""

import numpy as np
import pytest
from helpers.against_reference import assert_matches_reference
from helpers.gltf import file_of, picture_uri
from helpers.pinhole import SHADINGS, octasphere

import rasterizer as rz
from rasterizer.scene.color import linear_from_srgb_bytes

SIZE = (44, 36)
BALL = octasphere(2)
CAMERA = rz.Camera.perspective((1.0, 1.5, 5.5), (0, 0, 0), fov=34, near=1.0, far=20.0)
SUN = rz.DirectionalLight((-0.4, -0.5, -0.8), (0.5, 0.4, 0.3))


def texture_of(rng, least=0.0) -> rz.Texture:
    """A texture of any size, filter and wrap, whose texels are `least` at least."""
    size, filter = rng.integers(1, 9, 2), str(rng.choice(["bilinear", "trilinear", "nearest"]))
    wrap = tuple(str(rng.choice(["repeat", "clamp", "mirror"])) for _ in range(2))
    return rz.Texture(rng.uniform(least, 1.0, (*size, 3)), filter, wrap)


def metal_of(rng) -> rz.Material:
    """A metal: of one roughness or two, with textures of what it reflects, and of where it is metal and how rough."""
    has_texture, follows, is_brushed = rng.uniform(size=3) < (0.7, 0.5, 0.2)
    colors = {name: tuple(rng.uniform(0.1, 1.0, 3)) for name in ("ambient", "diffuse", "metal")}
    return rz.Material(
        **colors,
        reflection="cook-torrance",
        specular=rng.uniform(0.3, 1.0),
        fresnel=None if rng.uniform() < 0.5 else tuple(rng.uniform(0, 1, 3)),
        metallic=float(rng.choice([1.0, rng.uniform()])),
        roughness=(0.6, 0.9) if is_brushed and not follows else rng.uniform(0.5, 1.0),
        distribution="ggx" if follows or is_brushed else str(rng.choice(["ggx", "beckmann"])),
        texture=texture_of(rng) if has_texture else None,
        metallic_roughness=texture_of(rng, 0.6) if follows else None,
        opacity=0.6 if rng.uniform() < 0.2 else 1.0,
    )


def check_random_metals(seeds) -> None:
    """Compare pictures of two balls with the reference's; what has jumps at texels may differ in a few pixels."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        meshes = []
        for center in ((-0.5, 0, 0.3), (0.7, 0.2, -0.4)):
            uv = 1.3 * BALL[0][:, rng.permutation(3)[:2]] + 0.2
            uv = np.concatenate([uv, BALL[0][:, :2] * (2.0, 0.5)], axis=1) if rng.uniform() < 0.5 else uv
            colors = rng.uniform(0, 1, BALL[0].shape) if rng.uniform() < 0.5 else None
            meshes.append(rz.Mesh(BALL[0] + np.array(center), BALL[1], uv=uv, colors=colors, material=metal_of(rng)))
        lights = [rz.AmbientLight(0.1), SUN, rz.PointLight((2, 3, 4), (0.4, 0.3, 0.5), (1, 0.1, 0.05))]
        scene = rz.Scene(meshes, lights[: rng.integers(2, 4)], CAMERA)
        options = {
            "shading": SHADINGS[seed % 3],
            "samples": int(rng.choice([1, 4])),
            "spectral": 5 if rng.uniform() < 0.2 else None,
        }
        tolerance = float(rng.choice([0.0, 1 / 4096]))
        bound = rz.render(scene, SIZE, tolerance=tolerance, **options).stats.error_bound
        try:
            assert_matches_reference(scene, SIZE, bound, ignored=0.1, far=0.01, tolerance=tolerance, **options)
        except AssertionError as fault:
            raise AssertionError(f"seed {seed}, tolerance {tolerance}: {fault}") from fault


def test_metals_are_drawn_as_the_reference_draws_them():
    # Of 23 one mesh alone has texture coordinates for metals; 47 and 260 have all attributes that there are.
    check_random_metals((*range(9), 23, 47, 260))


@pytest.mark.nightly
def test_many_metals_are_drawn_as_the_reference_draws_them():
    check_random_metals(range(9, 300))


def patches(rng):
    """Four rows of four patches of a ball; each is one texel, of which textures know nothing at its borders."""
    positions, uv, faces = [], [], []
    for row in range(4):
        for column in range(4):
            u, v = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 4))
            across, up = (column + u.ravel() - 2) * 0.35, (2 - row - v.ravel()) * 0.35
            normal = np.stack([np.sin(across) * np.cos(up), np.sin(up), np.cos(across) * np.cos(up)], axis=1)
            corner = np.arange(16).reshape(4, 4) + 16 * len(positions)
            a, b, c, d = (corner[i : i + 3, j : j + 3].ravel() for i, j in ((0, 0), (0, 1), (1, 1), (1, 0)))
            faces += [np.concatenate([np.stack([a, d, c], 1), np.stack([a, c, b], 1)])]
            positions.append(normal)
            uv.append(np.tile([(column + 0.5) / 4, (row + 0.5) / 4], (16, 1)))
    return np.float32(np.concatenate(positions)), np.float32(np.concatenate(uv)), np.uint32(faces)


def gltf_of(positions, faces, attributes, materials, images=()) -> bytes:
    """A glTF file of one mesh, a primitive for each of `faces` (n, 3)."""
    names = ["POSITION", "NORMAL", *attributes]
    arrays = [positions, positions, *attributes.values(), *(each.ravel() for each in faces)]
    primitives = [
        {"attributes": {name: k for k, name in enumerate(names)}, "indices": len(names) + k, "material": k}
        for k in range(len(faces))
    ]
    return file_of(
        arrays, *primitives, materials=materials, samplers=[{"magFilter": 9728, "minFilter": 9728}],
        images=[{"uri": picture_uri(image)} for image in images],
        textures=[{"source": k, "sampler": 0} for k in range(len(images))],
    )  # fmt: skip


@pytest.mark.parametrize(
    "laid", ["alike", "by another set", "moved", "without base", "base alone", "as vertex colours"]
)
def test_every_texel_of_a_gltf_metal_is_the_material_that_its_factors_make(laid):
    """A ball of 16 patches, of which each lies within a texel, against 16 materials without textures."""
    rng = np.random.default_rng(5)
    positions, uv, faces = patches(rng)
    base = rng.integers(40, 256, (4, 4, 3), dtype=np.uint8)
    numbers = rng.integers(60, 256, (4, 4, 3), dtype=np.uint8)
    numbers[0, 0, 1:], numbers[3, 3, 1:] = (160, 255), (160, 0)
    base = np.full_like(base, 255) if laid == "without base" else base
    factor, linear = np.array([0.9, 0.8, 0.6]), linear_from_srgb_bytes(base).reshape(16, 3)
    roughness, metallic = (numbers.reshape(16, 3)[:, k] / 255.0 for k in (1, 2))
    if laid in ("base alone", "as vertex colours"):
        metallic, roughness = np.ones(16), np.full(16, 0.5)
    plain = [
        {"pbrMetallicRoughness": {"baseColorFactor": [*(factor * c), 1], "metallicFactor": m, "roughnessFactor": r}}
        for c, m, r in zip(linear, metallic.tolist(), roughness.tolist(), strict=True)
    ]
    expected = rz.load(gltf_of(positions, faces, {}, plain), format="gltf")
    surface, use, images = {"baseColorFactor": [*factor, 1]}, {"index": 1}, [base, numbers]
    attributes = {"TEXCOORD_0": uv}
    if laid == "as vertex colours":
        attributes = {"COLOR_0": np.float32(np.repeat(linear, 16, axis=0))}
        surface, images = surface | {"roughnessFactor": 0.5}, ()
    elif laid == "base alone":
        surface |= {"roughnessFactor": 0.5, "baseColorTexture": {"index": 0}}
    else:
        if laid == "by another set":
            attributes["TEXCOORD_1"], use = np.float32(1.0 - uv), use | {"texCoord": 1}
            images = [base, np.ascontiguousarray(numbers[::-1, ::-1])]
        elif laid == "moved":  # a quarter to the right, and three times as large
            images = [base, np.ascontiguousarray(np.roll(np.repeat(np.repeat(numbers, 3, 0), 3, 1), 3, axis=1))]
            use = use | {"extensions": {"KHR_texture_transform": {"offset": [0.25, 0.0]}}}
        surface = surface | {"metallicRoughnessTexture": use}
        surface = surface if laid == "without base" else surface | {"baseColorTexture": {"index": 0}}
    one = gltf_of(positions, [faces.reshape(-1, 3)], attributes, [{"pbrMetallicRoughness": surface}], images)
    scene = rz.load(one, format="gltf")
    camera, lights = rz.Camera.perspective((0, 0, 4), (0, 0, 0), fov=30), [rz.AmbientLight(0.0), SUN]
    for shading in SHADINGS if laid in ("base alone", "as vertex colours") else ("phong",):
        frames = [
            rz.render(rz.Scene(each.meshes, lights, camera), SIZE, shading=shading, tolerance=0.0)
            for each in (scene, expected)
        ]
        error = np.abs(frames[0].color - frames[1].color).max()
        assert frames[0].color.max() > 0.2, "no highlight is seen"
        assert error <= 3e-6, f"{laid}, {shading}: {error:.3g} > 3e-6"  # also factors, textures and colours are rounded
