"""Check materials that share a mesh, each with a texture, alpha, opacity, filter, wrap and reflection model of its own:
drawn as the reference draws them, by every shading, in both types, and with texture coordinates far from 0."""

import numpy as np
import pytest
from helpers.against_reference import assert_matches_reference
from helpers.pinhole import octasphere

import rasterizer as rz
from rasterizer.choices import FILTERS, WRAPS
from rasterizer.options import DEFAULT_TOLERANCE

SIZE = (44, 36)
CAMERA = rz.Camera.perspective((1.0, 1.5, 5.5), (0, 0, 0), fov=34, near=1.0, far=20.0)
LIGHTS = (rz.AmbientLight(0.2), rz.DirectionalLight((-0.4, -0.5, -0.8), (0.5, 0.4, 0.3)))
FAR = (0.0, 0.0, 1e3, -1e5, 1e7, -1e10)  # where texture coordinates lie
IN_FLOAT32, IN_FLOAT64 = ("lambert", "phong", "blinn", "oren-nayar"), ("toon", "cook-torrance")


def texture_of(rng, n_channel) -> rz.Texture:
    """A small picture, of bytes or floats."""
    image = rng.random((*rng.integers(1, 9, 2), n_channel))
    image = (255 * image).astype(np.uint8) if rng.random() < 0.4 else image
    return rz.Texture(image, str(rng.choice(FILTERS)), tuple(str(word) for word in rng.choice(WRAPS, 2)))


def material_of(rng, reflection) -> rz.Material:
    """A material with a texture of colours, with alpha, or none."""
    n_channel = int(rng.choice([0, 3, 3, 4, 4]))
    numbers = {}
    if reflection == "cook-torrance":
        rough = rz.Texture(rng.uniform(0.7, 1.0, (4, 3, 3)), str(rng.choice(FILTERS)))
        numbers = {"metallic": 1.0, "roughness": 0.8, "metallic_roughness": rough}
    return rz.Material(
        diffuse=tuple(rng.uniform(0.2, 1.0, 3)),
        specular=float(rng.choice([0.0, 0.3])) if reflection != "lambert" else 0.0,
        reflection=reflection,
        opacity=float(rng.choice([1.0, 0.8, 0.3])),
        texture=texture_of(rng, n_channel) if n_channel else None,
        **numbers,
    )


def mixed_scene(rng) -> rz.Scene:
    """A ball whose faces take turns: there are always some of float32 and of float64, and alpha in either."""
    models = [str(rng.choice(names)) for names in (IN_FLOAT32, IN_FLOAT64) * 3]
    materials = [material_of(rng, model) for model in models]
    vertices, faces = octasphere(2)
    corners = vertices[faces] if rng.random() < 0.5 else vertices  # of each corner, or of each vertex
    uv = corners[..., rng.permutation(3)[:2]] * rng.uniform(0.5, 4.0) + rng.choice(FAR, 2)
    mesh = rz.Mesh(
        1.4 * vertices, faces, vertices.copy(), uv=uv, materials=materials,
        face_material=rng.integers(0, len(materials), len(faces)),
    )  # fmt: skip
    return rz.Scene([mesh], LIGHTS, CAMERA)


def check_mixed(seeds) -> None:
    """Compare pictures with the reference's; a toon's levels jump, so a few of its pixels may be off."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        scene, shading = mixed_scene(rng), ("phong", "gouraud", "phong", "flat")[seed % 4]
        options = {"samples": int(rng.choice([1, 4])), "shading": shading}
        tolerance = 0.0 if seed % 5 == 4 else DEFAULT_TOLERANCE
        stats = rz.render(scene, SIZE, tolerance=tolerance, **options).stats
        most = max(1.01 * tolerance, 2e-5 * max(stats.plan.bound, 1.0))
        try:
            assert stats.error_bound is not None and stats.error_bound <= most, f"{stats.error_bound} > {most}"
            far = 0.01 if shading == "phong" else 0.0
            budget = stats.error_bound * (1.0 if tolerance else max(stats.plan.bound, 1.0))
            assert_matches_reference(scene, SIZE, budget, ignored=0.08, far=far, tolerance=tolerance, **options)
        except AssertionError as fault:
            raise AssertionError(f"seed {seed}, tolerance {tolerance}: {fault}") from fault


def test_each_material_shows_its_own_texture_and_alpha():
    check_mixed(range(16))


@pytest.mark.nightly
def test_many_materials_show_their_own_textures_and_alpha():
    check_mixed(range(16, 400))


@pytest.mark.parametrize("filter", FILTERS)
def test_texture_coordinates_far_from_0_show_what_those_near_it_do(filter):
    """Moved by whole repeats, however many: multiples of 2^-16 of the picture stay what they are."""
    image = np.random.default_rng(4).random((6, 9, 3))
    vertices = [[-2.0, -2, -3], [2, -2, 1], [2, 2, 1], [-2, 2, -3]]
    uv = np.round(np.array([[-0.4, -0.3], [1.6, 0.2], [2.3, 1.9], [0.1, 1.4]]) * 2**16) / 2**16
    for tolerance, wrap, shading in (
        (DEFAULT_TOLERANCE, "repeat", "phong"), (DEFAULT_TOLERANCE, "repeat", "gouraud"), (0.0, "repeat", "flat"),
        (0.0, ("mirror", "repeat"), "phong"),
    ):  # fmt: skip
        look = rz.Material(texture=rz.Texture(image, filter, wrap), specular=0.0)
        colors = []
        for offset in (0.0, 1e3, 2e10):
            mesh = rz.Mesh(vertices, [[0, 1, 2], [0, 2, 3]], uv=uv + (offset, -offset), material=look)
            frame = rz.render(rz.Scene([mesh], LIGHTS, CAMERA), SIZE, samples=1, tolerance=tolerance, shading=shading)
            colors.append(frame.color)
        off = max(np.abs(color - colors[0]).max() for color in colors[1:])
        assert np.ptp(colors[0]) > 0.1 and off <= 1e-6, f"{wrap}, {shading}, tolerance {tolerance}: {off:.3g} > 1e-6"


def test_samples_of_a_material_in_float64_keep_their_own_texels():
    """They lie among those of one in float32, in one batch of a row: a toon's texels were once overwritten there. The
    wall's texture coordinates are too coarse in float32 planes."""
    noise = np.random.default_rng(3).random((48, 80, 3)).astype(np.float32)
    look, toon = (
        rz.Material(texture=rz.Texture(texels, filter="bilinear"), reflection=name, specular=0.0)
        for texels, name in ((noise, "phong"), (noise[::-1], "toon"))
    )
    corners = [[-300, -300, -40], [300, -300, -2], [300, 300, -30], [-300, 300, -68]]
    uv = np.array([[-1.5, -1], [7, -1], [7, 7], [-1.5, 7]]) * 9
    meshes = [rz.Mesh(corners, [[0, 1, 2, 3]], uv=uv, material=look)]
    bars = ([[x, -300, 1], [x + 0.2, -300, 1], [x + 0.1, 300, 1]] for x in (-0.7, -0.3, 0.1, 0.5))
    meshes += [rz.Mesh(bar, [[0, 1, 2]], uv=np.eye(3)[:, :2] * 90, material=toon) for bar in bars]
    lights = [rz.AmbientLight(0.5), rz.DirectionalLight((0.1, 0.2, -1), 0.5)]
    scene, options = rz.Scene(meshes, lights, rz.Camera.perspective((0, 0, 5))), {"samples": 1, "threads": 1}
    for shading in ("gouraud", "phong"):
        found = rz.render(scene, (120, 90), shading=shading, outputs=("color", "material"), **options)
        exact = rz.render(scene, (120, 90), shading=shading, tolerance=0.0, **options)
        error, bound = np.abs(found.color - exact.color).max(axis=2), found.stats.error_bound
        assert (found.material == 1).mean() > 0.05 and error.max() <= bound, f"{error.max():.3g} > {bound:.3g}"
        assert shading == "gouraud" or error[found.material == 1].max() < 1e-6, "float64, as with tolerance 0"
