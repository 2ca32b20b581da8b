"""Where opacity times alpha is below a material's cutoff nothing is, for whatever is drawn of it."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import differences

import rasterizer as rz
from rasterizer import reference
from rasterizer.scene.texture import FILTERS, WRAPS

BUFFERS = ("color", "depth", "face", "mask", "object", "normal", "position")
LIGHTS = [rz.AmbientLight(0.3), rz.DirectionalLight((0.3, -0.2, -1))]


def leaf(n=64):
    """A disc of alpha 1 on a clear picture, (n, n, 4) uint8."""
    y, x = np.mgrid[-1 : 1 : n * 1j, -1 : 1 : n * 1j]
    image = np.full((n, n, 4), (40, 200, 60, 0), np.uint8)
    image[x * x + y * y < 0.4, 3] = 255
    return image


def card(image, filter="bilinear", wrap="clamp", size=1.0, z=0.0, **material):
    corners = size * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    vertices = np.column_stack([corners, np.full(4, z)])
    paint = rz.Material(texture=rz.Texture(image, filter=filter, wrap=wrap), **{"alpha_cutoff": 0.5} | material)
    return rz.Mesh(vertices, [(0, 1, 2, 3)], uv=[(0, 0), (1, 0), (1, 1), (0, 1)], material=paint)


def random_scene(rng):
    """Cards with holes, one before the other and through each other, a plain one among them."""
    meshes = []
    for _ in range(3):
        image = rng.integers(0, 256, (*rng.integers(1, 9, 2), 4), np.uint8)
        image[..., 3] = rng.choice([0, 255, 100, 180], image.shape[:2])
        cutoff, opacity = rng.choice([0.2, 0.5, 1.0]), rng.choice([1.0, 0.8])
        mesh = card(image, rng.choice(FILTERS), rng.choice(WRAPS), alpha_cutoff=cutoff, opacity=opacity)
        uv = np.array(mesh.uv) * rng.choice([0.7, 3.0]) + rng.uniform(-2, 2, 2) + rng.choice([0, 1000])
        tilt = rng.normal(size=(4, 3)) * (0.2, 0.2, 0.6)
        meshes.append(replace(mesh, vertices=mesh.vertices + tilt + (0, 0, rng.uniform(-1, 1)), uv=uv))
    meshes.append(rz.Mesh([(-2, -2, -1.5), (2, -2, -1.5), (0, 2, -1.5)], [(0, 1, 2)]))
    near = rng.choice([2.0, 4.0])  # at 2 the near plane may cut a card
    camera = (
        rz.Camera.perspective((0.3, 0.2, near), fov=50)
        if rng.random() < 0.7
        else rz.Camera.orthographic((0.3, 0.2, 4), height=3)
    )
    return rz.Scene(meshes, LIGHTS, camera)


@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
def test_pictures_and_buffers_are_those_of_the_reference(shading):
    n_hole = n_sure = 0
    for seed in range(14):
        rng = np.random.default_rng([seed, len(shading)])
        scene, samples, size = random_scene(rng), int(rng.choice([1, 4])), (48, 40)
        cull = ("auto", "none", "back")[seed % 3]
        frame = rz.render(scene, size, shading=shading, samples=samples, cull=cull, outputs=BUFFERS, threads=1)
        judged = reference.render(scene, size, shading=shading, samples=samples, cull=cull)
        sure = judged.margin > 1e-6  # where alpha is the cutoff itself nothing is sure
        n_sure += sure.sum()
        assert not differences(frame.face[sure], judged.face[sure]), f"seed {seed}"
        near = np.isfinite(judged.depth) & sure
        assert np.allclose(frame.depth[near], judged.depth[near], rtol=2e-6), f"seed {seed}"
        assert (np.isfinite(frame.depth) == frame.mask).all() and ((frame.face >= 0) == frame.mask).all()
        if samples == 1:
            assert ((frame.alpha > 0) == frame.mask).all() and set(np.unique(frame.alpha)) <= {0.0, 1.0}
            error = np.abs(frame.color - judged.color)[sure].max(initial=0.0)
            assert error <= frame.stats.error_bound + 1e-6, f"seed {seed}: {error:.3g}"
        again = rz.render(scene, size, shading=shading, samples=samples, cull=cull, outputs=BUFFERS, threads=3)
        assert not differences(again.color, frame.color) and not differences(again.face, frame.face)
        whole = [replace(mesh, material=replace(mesh.palette[0], alpha_cutoff=None)) for mesh in scene.meshes]
        n_hole += (rz.render(replace(scene, meshes=whole), size, outputs="face", cull=cull).face != frame.face).sum()
    assert n_hole > 1000 and n_sure > 14 * 48 * 40 / 2


def test_a_leaf_is_as_large_as_it_looks_for_every_buffer_pick_and_edge():
    scene = rz.Scene([card(leaf()), card(leaf(), size=3.0, z=-1.0)], LIGHTS, rz.Camera.perspective((0, 0, 4), fov=50))
    frame = rz.render(scene, (120, 90), samples=1, outputs=BUFFERS)
    assert 0.2 < frame.mask.mean() < 0.8 and not differences(frame.mask, frame.alpha > 0)
    assert set(np.unique(frame.object)) == {-1, 0, 1}
    y, x = np.argwhere(~frame.mask)[0]
    assert frame.pick(int(x), int(y)) is None
    drawn = rz.render(scene, (120, 90), samples=1, edges="wire", edge_width=2.0)
    assert not differences(drawn.alpha > 0, frame.mask), "edges beside what is there"


SHADOW = rz.Shadow(1024)
LAMPS = rz.DirectionalLight((0.2, 0.1, -1), shadow=SHADOW), rz.PointLight((0.1, 0.2, 3.0), shadow=SHADOW)


@pytest.mark.parametrize("light", LAMPS, ids=["directional", "point"])
def test_the_shadow_of_a_leaf_has_its_shape(light):
    floor = rz.Mesh([(-3, -3, -1), (3, -3, -1), (3, 3, -1), (-3, 3, -1)], [(0, 1, 2, 3)])
    scene = rz.Scene([card(leaf()), floor], [light, rz.AmbientLight(0.1)], rz.Camera.perspective((2.5, -1, 3), fov=60))
    found = rz.render(scene, (96, 72), shading="phong", samples=1, outputs=("color", "object"))
    judged = reference.render(scene, (96, 72), shading="phong", samples=1)
    on_floor = found.object == 1
    dark, expected = (each[..., 0] < 0.5 * each[..., 0][on_floor].max() for each in (found.color, judged.color))
    assert expected[on_floor].mean() > 0.02 and (dark != expected)[on_floor].mean() < 0.004
    whole = replace(scene, meshes=[card(leaf(), alpha_cutoff=0.0), floor])
    assert (reference.render(whole, (96, 72), shading="phong").color[..., 0][on_floor] < 0.2).mean() > 1.5 * expected[
        on_floor
    ].mean()


def test_glass_counts_from_the_opacity_that_is_asked_for():
    glass = card(leaf(), alpha_cutoff=None, opacity=0.4)
    pane = rz.Mesh(
        [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)], [(0, 1, 2, 3)], material=rz.Material(opacity=0.3)
    )
    scene = rz.Scene([glass, pane], LIGHTS, rz.Camera.perspective((0, 0, 4), fov=50))
    shares = [
        rz.render(scene, (60, 60), outputs="mask", min_opacity=least).mask.mean() for least in (0, 0.3, 0.35, 0.5)
    ]
    assert shares[0] == rz.render(scene, (60, 60), outputs="mask").mask.mean() > shares[2] > shares[3] == 0.0
    objects = rz.render(scene, (60, 60), outputs="object", min_opacity=0.35).object
    assert set(np.unique(objects)) == {-1, 0} and shares[1] >= shares[2]
    assert rz.render(scene, (60, 60)).alpha.max() > 0.3, "pictures don't ask"


def test_what_is_opaque_in_the_picture_counts_from_any_opacity_on():
    faint = leaf()
    faint[..., 3] = 0.7 * faint[..., 3]
    papered = card(faint)
    for mesh in (
        papered,
        card(leaf(), opacity=0.7),
        replace(papered, material=rz.Material(opacity=0.7, alpha_cutoff=0.5)),
    ):
        scene = rz.Scene(mesh, LIGHTS, rz.Camera.perspective((0, 0, 4), fov=50))
        frame = rz.render(scene, (21, 21), samples=1, outputs=("rgb", "mask"), min_opacity=0.9)
        assert frame.mask.any() and not differences(frame.mask, frame.rgba[..., 3] == 255)
        assert frame.pick(10, 10) is not None


def test_without_a_texture_all_of_it_is_there_or_nothing():
    square = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    for opacity, is_there in ((0.4, False), (0.6, True)):
        mesh = rz.Mesh(square, [(0, 1, 2, 3)], material=rz.Material(opacity=opacity, alpha_cutoff=0.5))
        frame = rz.render(mesh, (20, 20), samples=1, outputs=("color", "mask"), view="front")
        assert frame.mask.any() == is_there == (frame.alpha == 1.0).any() and set(np.unique(frame.alpha)) <= {0.0, 1.0}
