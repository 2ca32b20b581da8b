"""Check transparent surfaces: sums over layers in closed form, whatever the order of the faces, the samples and the threads."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from pinhole import QUAD, SHADINGS, layer, octasphere, sheet_camera
from raster import assert_runs

import rasterizer as rz
from rasterizer import reference

SIZE = (48, 36)
COLORS = np.array([(0.9, 0.1, 0.2), (0.2, 0.8, 0.1), (0.1, 0.3, 0.7), (0.6, 0.6, 0.1), (0.3, 0.1, 0.5)])
OPACITIES = (0.5, 0.3, 0.8, 0.25, 0.6)
WHITE = (rz.AmbientLight(1.0),)
LIT = (rz.AmbientLight(0.2), rz.DirectionalLight((0.3, -0.4, -1), 0.7))


def paint(color, opacity=1.0, **options):
    """A material that shows one colour under WHITE."""
    return rz.Material(ambient=color, diffuse=0, specular=0, opacity=opacity, **options)


def pane(depth, material, **mesh):
    """A sheet across the whole picture."""
    return rz.Mesh(np.array(layer(SIZE, depth, is_perspective=False)), QUAD, material=material, **mesh)


def panes(n, order=None):
    """The first n panes, the first one nearest, in an order in the file."""
    made = [pane(2.0 + k, paint(tuple(COLORS[k]), OPACITIES[k])) for k in range(n)]
    return made if order is None else [made[k] for k in order]


def show(meshes, shading="gouraud", background=None, lights=WHITE, size=SIZE, **options):
    scene = rz.Scene(meshes, lights, sheet_camera(SIZE[1]), background)
    return rz.render(scene, size, shading=shading, **({"tolerance": 0} | options))


def over(n):
    """Premultiplied colour and alpha of the first n panes: from the back to the front, c = a·C + (1 - a)·c."""
    color, alpha = np.zeros(3), 0.0
    for k in reversed(range(n)):
        color = OPACITIES[k] * COLORS[k] + (1 - OPACITIES[k]) * color
        alpha = OPACITIES[k] + (1 - OPACITIES[k]) * alpha
    return color, alpha


# ── panes in closed form ────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_panes_are_laid_over_each_other(n, samples, shading):
    color, alpha = over(n)
    frame = show(panes(n), shading, samples=samples)
    assert np.abs(frame.color - color / alpha).max() < 1e-6 and np.abs(frame.alpha - alpha).max() < 1e-6
    assert (frame.rgba[..., 3] == np.floor(alpha * 255 + 0.5)).all()
    behind = np.array((0.2, 0.5, 0.9))
    frame = show(panes(n), shading, background=tuple(behind), samples=samples)
    assert np.abs(frame.color - (color + (1 - alpha) * behind)).max() < 1e-6 and (frame.alpha == 1).all()
    assert (frame.rgba[..., 3] == 255).all()


def test_the_order_of_the_faces_does_not_matter():
    expected = show(panes(4))
    for order in itertools.permutations(range(4)):
        frame = show(panes(4, order))
        assert np.abs(frame.color - expected.color).max() < 1e-7 and np.array_equal(frame.alpha, expected.alpha)


def test_at_equal_depth_the_lower_face_is_in_front():
    """Among transparent surfaces, and of these with an opaque one."""
    see_through, other = paint((0.9, 0.1, 0.2), 0.5), paint((0.1, 0.3, 0.7), 0.25)
    solid = paint((0.2, 0.6, 0.4))
    for first, second, expected in (
        (see_through, other, (0.5 * 0.9 + 0.125 * 0.1, 0.5 * 0.1 + 0.125 * 0.3, 0.5 * 0.2 + 0.125 * 0.7)),
        (see_through, solid, (0.5 * 0.9 + 0.5 * 0.2, 0.5 * 0.1 + 0.5 * 0.6, 0.5 * 0.2 + 0.5 * 0.4)),
        (solid, see_through, (0.2, 0.6, 0.4)),
    ):
        for shading in SHADINGS:
            frame = show([pane(3.0, first), pane(3.0, second)], shading, outputs=("color", "face"))
            assert np.abs(frame.color * frame.alpha[..., None] - expected).max() < 1e-6
            assert (frame.face < 2).all()


def test_panes_that_cut_each_other_change_places():
    """Two sheets cross in the middle column: each side has the order of its depths."""
    corners = np.array(layer(SIZE, 0.0, is_perspective=False))
    meshes = []
    for sign, k in ((1, 0), (-1, 1)):
        tilted = corners.copy()
        tilted[:, 2] = -5 - 0.01 * sign * tilted[:, 0]
        meshes.append(rz.Mesh(tilted, QUAD, material=paint(tuple(COLORS[k]), OPACITIES[k])))
    for order in ((0, 1), (1, 0)):
        frame = show([meshes[k] for k in order])
        premultiplied = frame.color * frame.alpha[..., None]
        for columns, (front, behind) in ((slice(0, 24), (0, 1)), (slice(24, 48), (1, 0))):
            expected = OPACITIES[front] * COLORS[front] + (1 - OPACITIES[front]) * OPACITIES[behind] * COLORS[behind]
            assert np.abs(premultiplied[:, columns] - expected).max() < 1e-6


def test_forty_layers():
    meshes = [pane(2.0 + 0.5 * k, paint((0.9, 0.5, 0.1), 0.1)) for k in range(40)]
    frame = show(meshes[20:] + meshes[:20])
    alpha = 1 - 0.9**40
    assert np.abs(frame.alpha - alpha).max() < 1e-6 and np.abs(frame.color - (0.9, 0.5, 0.1)).max() < 1e-6


@pytest.mark.parametrize("shading", SHADINGS)
def test_opacity_0_shows_nothing_and_1_hides_all(shading):
    clear, solid = paint((0.9, 0.9, 0.9), 0.0), paint((0.3, 0.2, 0.1), 1.0)
    assert not show([pane(2.0, clear)], shading).color.any() and not show([pane(2.0, clear)], shading).rgba.any()
    assert show([pane(2.0, clear)], shading).stats.covered == 0
    half = pane(4.0, paint((0.7, 0.7, 0.1), 0.5))
    with_clear = show([pane(2.0, clear), half, pane(3.0, clear)], shading)
    assert np.array_equal(with_clear.color, show([half], shading).color)
    hidden = show([half, pane(3.0, solid), pane(3.5, clear)], shading)
    assert np.abs(hidden.color - (0.3, 0.2, 0.1)).max() < 1e-6 and (hidden.alpha == 1).all()


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 4])
def test_a_face_that_is_not_seen_leaves_an_opaque_picture_as_it_was(shading, samples):
    """Bytes are equal, for models of one and of three channels."""
    for material in (rz.Material(), rz.Material(diffuse=(0.7, 0.4, 0.2))):
        model = rz.Mesh(*(lambda v, f: (v * 10 + (0, 0, -20), f))(*octasphere(2)), material=material)
        behind = pane(60.0, paint(material.diffuse, 0.0))
        # near and far stay the same, and so do depths
        camera = rz.Camera.orthographic((0, 0, 0), (0, 0, -1), height=SIZE[1], near=1, far=100)
        frames = [
            rz.render(rz.Scene(meshes, LIT, camera), SIZE, shading=shading, samples=samples, tolerance=0)
            for meshes in ([model], [model, behind])
        ]
        assert frames[0].color.tobytes() == frames[1].color.tobytes()
        assert frames[0].rgba.tobytes() == frames[1].rgba.tobytes()


# ── what else opacity meets ─────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("shading", SHADINGS)
def test_the_alpha_of_a_texture_multiplies_the_opacity(shading):
    """Four texels, a quarter of the picture each."""
    texels = np.ones((2, 2, 4))
    texels[..., 3] = [[1.0, 0.5], [0.0, 0.25]]
    corners = np.array([(-24, -18, -3), (24, -18, -3), (24, 18, -3), (-24, 18, -3)], float)
    uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    front = paint((0.8, 0.4, 0.2), 0.5, texture=rz.Texture(texels, "nearest"))
    mesh = rz.Mesh(corners, [[0, 1, 2, 3]], uv=uv, material=front)
    back = pane(5.0, paint((0.1, 0.2, 0.9)))
    alpha = 0.5 * np.kron(texels[..., 3], np.ones((18, 24)))
    assert np.abs(show([mesh], shading).alpha - alpha).max() < 1e-6
    expected = alpha[..., None] * (0.8, 0.4, 0.2) + (1 - alpha[..., None]) * (0.1, 0.2, 0.9)
    for meshes in ([mesh, back], [back, mesh]):
        assert np.abs(show(meshes, shading).color - expected).max() < 1e-6
    # two of them behind each other
    further = rz.Mesh(corners + (0, 0, -1), [[0, 1, 2, 3]], uv=uv, material=front)
    assert np.abs(show([further, mesh], shading).alpha - (1 - (1 - alpha) ** 2)).max() < 1e-6


def test_layers_of_a_grey_scene_take_one_channel():
    meshes = [pane(2.0, paint(0.9, 0.5)), pane(3.0, paint(0.4, 0.25))]
    with rz.Renderer(rz.Scene(meshes, WHITE, sheet_camera(SIZE[1])), SIZE, tolerance=0) as renderer:
        assert renderer._plan.n_channel == 1
        frame = renderer.render()
    assert np.abs(frame.color * frame.alpha[..., None] - (0.45 + 0.5 * 0.25 * 0.4)).max() < 1e-6


@pytest.mark.parametrize("samples", [1, 4])
def test_policies_for_bright_layers(samples):
    """`global` divides by the largest component of the picture, `local` by that of the pixel; both before the sRGB curve."""
    meshes = [pane(2.0, paint((3.0, 0.5, 0.25), 0.5)), pane(3.0, paint((1.0, 2.0, 0.5), 0.5))]
    color = (0.5 * np.array((3.0, 0.5, 0.25)) + 0.25 * np.array((1.0, 2.0, 0.5))) / 0.75
    levels = {
        policy: np.rint(255 * np.where((x := value) <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055))
        for policy, value in (("clamp", np.minimum(color, 1)), ("global", color / color.max()), ("local", color / color.max()))
    }
    for policy, expected in levels.items():
        frame = show(meshes, color_range=policy, samples=samples)
        assert np.abs(frame.color - color).max() < 1e-5 and (frame.rgb == expected).all() and (frame.rgba[..., 3] == 191).all()


def test_what_is_covered_in_part_counts_by_its_samples():
    """A pane that ends in the middle of column 24, with 2 x 2 samples: alpha is the mean of the samples' alphas."""
    corners = np.array([(-24, -18, -2), (0.5, -18, -2), (0.5, 18, -2), (-24, 18, -2)], float)
    frame = show([rz.Mesh(corners, [[0, 1, 2, 3]], material=paint((0.9, 0.3, 0.3), 0.6))], samples=4)
    assert np.abs(frame.alpha[:, [23, 24, 25]] - (0.6, 0.3, 0)).max() < 1e-6
    assert np.abs(frame.color[:, :25] - (0.9, 0.3, 0.3)).max() < 1e-6
    assert (frame.rgba[0, [23, 24, 25], 3] == (153, 77, 0)).all()


def soup(seed, n=60):
    """Triangles through each other, also large ones that cross the near plane, and slivers."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 3, 3)) * (2, 2, 1) + (0, 0, -5)
    points[: n // 6, 0] = rng.normal(size=(n // 6, 3)) * 3 + (0, 0, 2)  # behind the eye
    points[n // 6 : n // 3, 2] = points[n // 6 : n // 3, :2].mean(axis=1) + 0.003 * rng.normal(size=(n // 6, 3))
    looks = zip(COLORS, (*OPACITIES[:4], 1.0), strict=True)
    materials = [rz.Material(diffuse=tuple(color), specular=0.2, opacity=opacity) for color, opacity in looks]
    numbers = np.arange(n) % 5
    return rz.Mesh(points.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3), materials=materials, face_material=numbers)


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 4])
def test_a_soup_of_triangles_is_that_of_the_judge(shading, samples):
    """Premultiplied colours; where two surfaces are too near to each other for depths to tell, either may be in front."""
    camera = rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=70, near=0.5, far=20)
    scene = rz.Scene([soup(3)], LIT, camera)
    frame = rz.render(scene, SIZE, shading=shading, samples=samples, tolerance=0)
    judge = reference.render(scene, SIZE, shading=shading, samples=samples)
    off = np.abs(frame.color * frame.alpha[..., None] - judge.color * judge.alpha[..., None]).max(axis=-1)
    assert np.abs(frame.alpha - judge.alpha).max() < 1e-6 and len(np.unique(judge.alpha.round(6))) > 30
    assert (off > 1e-6).mean() < 0.002, f"{(off > 1e-6).sum()} pixels differ, by up to {off.max():.3g}"


@pytest.mark.parametrize("shading", SHADINGS)
def test_threads_and_repetition_do_not_matter(shading):
    scene = rz.Scene([soup(5)], LIT, rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=70))
    expected = rz.render(scene, (200, 150), shading=shading, threads=1)
    for threads in (1, 2, 3):
        with rz.Renderer(scene, (200, 150), shading=shading, threads=threads) as renderer:
            for _ in range(2):
                frame = renderer.render()
                assert frame.color.tobytes() == expected.color.tobytes() and frame.alpha.tobytes() == expected.alpha.tobytes()


def test_a_back_is_seen_through_the_front():
    """A glass ball: two layers everywhere but at its outline; without its back one."""
    vertices, faces = octasphere(3)
    ball = rz.Mesh(vertices * 12 + (0, 0, -20), faces, material=paint((0.5, 0.6, 0.7), 0.4))
    both, front = show([ball]).alpha, show([ball], cull="back").alpha
    assert np.abs(both[front > 0] - (1 - 0.6**2)).max() < 1e-6 and np.abs(front[front > 0] - 0.4).max() < 1e-6
    assert np.array_equal(both > 0, front > 0) and (front > 0).sum() > 300


# ── an opaque scene pays nothing ────────────────────────────────────────────────────────────────────────


def test_an_opaque_scene_plans_no_layers():
    for meshes, is_layered in (([pane(2.0, paint(0.5))], False), (panes(2), True)):
        with rz.Renderer(rz.Scene(meshes, WHITE, sheet_camera(SIZE[1])), SIZE) as renderer:
            renderer.render()
            assert (renderer._plan.opacity is not None) == is_layered
            (kind,) = renderer._scratch._free
            bench = renderer._scratch.take(kind, 1)
            assert kind.is_layered == is_layered and (len(bench.layers.words) > 0) == is_layered
    assert replace(paint(0.5), opacity=1.0).is_opaque and not replace(paint(0.5), opacity=0.999).is_opaque


@pytest.mark.slow
def test_an_opaque_scene_compiles_no_layers():
    assert_runs(
        "import numpy as np, rasterizer as rz\n"
        "from rasterizer.pipeline import layers, shadow, texture\n"
        "scene = rz.Scene([rz.Mesh(np.eye(3), [[0, 1, 2]])])\n"
        "for shading in ('flat', 'gouraud', 'phong'):\n"
        "    rz.render(scene, 16, shading=shading)\n"
        "kernels = [layers.scan_opaque, layers.take_fragments, layers.open_layers, layers.show_first, layers.composite]\n"
        "kernels += [shadow.write_map, texture.take_texels, texture.shade_textured]\n"
        "assert not any(kernel.signatures for kernel in kernels)\n"
        "glass = rz.Scene([rz.Mesh(np.eye(3), [[0, 1, 2]], material=rz.Material(opacity=0.5))])\n"
        "rz.render(glass, 16)\n"
        "assert all(kernel.signatures for kernel in kernels[:5])\n"
    )
