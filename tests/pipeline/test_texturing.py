"""Textures at the texture coordinates of exact setups."""

import numpy as np

import rasterizer as rz
from rasterizer.pipeline.texcoords import fixed_point
from rasterizer.pipeline.texture_lookup import product_of

SIZE = (120, 90)
RNG = np.random.default_rng(3)
NOISE = RNG.random((48, 80, 3)).astype(np.float32)


def wall(texture, repeats=7.0, **material) -> rz.Scene:
    """A rectangle that goes far beyond the picture: its texture coordinates are too coarse in float32 planes."""
    vertices = [[-300, -300, -40], [300, -300, -2], [300, 300, -30], [-300, 300, -68]]
    uv = np.array([[-1.5, -1], [repeats, -1], [repeats, repeats], [-1.5, repeats]]) * 9
    look = rz.Material(texture=texture, specular=0.0, **material)
    lights = [rz.AmbientLight(0.5), rz.DirectionalLight((0.1, 0.2, -1), 0.5)]
    return rz.Scene([rz.Mesh(vertices, [[0, 1, 2, 3]], uv=uv, material=look)], lights, rz.Camera.perspective((0, 0, 5)))


def drawn(scene, **options):
    return rz.render(scene, SIZE, **{"samples": 1, "threads": 1, "shading": "phong"} | options)


def test_the_border_of_two_texels_belongs_to_the_second_one():
    for n in (1, 2, 3, 5, 7, 10, 640, 1000, 4095, 12345, 16384):
        for k in range(0, n, max(1, n // 50)):
            column = product_of(fixed_point(k / n), np.int32(n))[0] >> 16
            assert column == k, f"the border before texel {k} of {n} lies in {column}"


def test_samples_of_a_material_in_float64_keep_their_own_texels():
    """They lie among those of one in float32, in one batch of a row: a toon's texels were once overwritten there."""
    scene = wall(rz.Texture(NOISE, filter="bilinear"))
    toon = rz.Material(texture=rz.Texture(NOISE[::-1], filter="bilinear"), reflection="toon", specular=0.0)
    uv = np.eye(3)[:, :2] * 90
    bars = ([[x, -300, 1], [x + 0.2, -300, 1], [x + 0.1, 300, 1]] for x in (-0.7, -0.3, 0.1, 0.5))
    cards = [rz.Mesh(bar, [[0, 1, 2]], uv=uv, material=toon) for bar in bars]
    scene = rz.Scene([*scene.meshes, *cards], scene.lights, scene.camera)
    for shading in ("gouraud", "phong"):
        found = drawn(scene, shading=shading, outputs=("color", "material"))
        exact = drawn(scene, shading=shading, tolerance=0.0)
        error = np.abs(found.color - exact.color).max(axis=2)
        bound = found.stats.error_bound
        assert (found.material == 1).mean() > 0.05 and error.max() <= bound, f"{error.max():.3g} > {bound:.3g}"
        assert shading == "gouraud" or error[found.material == 1].max() < 1e-6, "float64, as with tolerance 0"
