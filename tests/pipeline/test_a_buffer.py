"""Check transparent surfaces: sums over layers in closed form, whatever the order of the faces, the samples and the
threads."""

import itertools
from dataclasses import replace

import numba
import numpy as np
import pytest
from helpers.pinhole import QUAD, SHADINGS, layer, octasphere, sheet_camera
from helpers.raster import assert_runs

import rasterizer as rz
from rasterizer import reference
from rasterizer.engine import plan as planning
from rasterizer.pipeline import a_buffer, layers

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
    return rz.render(scene, size, shading=shading, **({"samples": 1} | {"tolerance": 0} | options))


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
    with rz.Renderer(rz.Scene(meshes, WHITE, sheet_camera(SIZE[1])), SIZE, tolerance=0, samples=1) as renderer:
        assert renderer.plan.channels == 1
        frame = renderer.render()
    assert np.abs(frame.color * frame.alpha[..., None] - (0.45 + 0.5 * 0.25 * 0.4)).max() < 1e-6


@pytest.mark.parametrize("samples", [1, 4])
def test_policies_for_bright_layers(samples):
    """`global` divides by the largest component of the picture, `local` by that of the pixel; both before the sRGB
    curve."""
    meshes = [pane(2.0, paint((3.0, 0.5, 0.25), 0.5)), pane(3.0, paint((1.0, 2.0, 0.5), 0.5))]
    color = (0.5 * np.array((3.0, 0.5, 0.25)) + 0.25 * np.array((1.0, 2.0, 0.5))) / 0.75
    levels = {
        policy: np.rint(255 * np.where((x := value) <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055))
        for policy, value in (
            ("clamp", np.minimum(color, 1)),
            ("global", color / color.max()),
            ("local", color / color.max()),
        )
    }
    for policy, expected in levels.items():
        frame = show(meshes, color_range=policy, samples=samples)
        assert (
            np.abs(frame.color - color).max() < 1e-5
            and (frame.rgb == expected).all()
            and (frame.rgba[..., 3] == 191).all()
        )


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
    """Premultiplied colours; where two surfaces are too near to each other for depths to tell, either may be in
    front."""
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
    expected = rz.render(scene, (200, 150), shading=shading, threads=1, samples=1)
    for threads in (1, 2, 3):
        with rz.Renderer(scene, (200, 150), shading=shading, threads=threads, samples=1) as renderer:
            for _ in range(2):
                frame = renderer.render()
                assert (
                    frame.color.tobytes() == expected.color.tobytes()
                    and frame.alpha.tobytes() == expected.alpha.tobytes()
                )


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
        with rz.Renderer(rz.Scene(meshes, WHITE, sheet_camera(SIZE[1])), SIZE, samples=1) as renderer:
            renderer.render()
            assert ("transparency" in renderer.plan.features) == is_layered
            (kind,) = renderer._prepared.workspaces._free
            workspace = renderer._prepared.workspaces.acquire(kind, 1)
            assert kind.is_transparent == is_layered and (workspace.room is not None) == is_layered
            assert not is_layered or workspace.room.n_byte > 0
    assert replace(paint(0.5), opacity=1.0).is_opaque and not replace(paint(0.5), opacity=0.999).is_opaque


@pytest.mark.slow
def test_an_opaque_scene_compiles_no_layers():
    assert_runs(
        "import numpy as np, rasterizer as rz\n"
        "from rasterizer.pipeline import a_buffer, layers, resolve, shadow_lookup, texture_sampling, textured_shading\n"
        "scene = rz.Scene([rz.Mesh(np.eye(3), [[0, 1, 2]])])\n"
        "for shading in ('flat', 'gouraud', 'phong'):\n"
        "    rz.render(scene, 16, shading=shading)\n"
        "kernels = [a_buffer.list_fragments, a_buffer.divide_room, a_buffer.sort_lists, layers.show_layer]\n"
        "kernels += [layers.composite, layers.put_behind, resolve.resolve_translucent]\n"
        "kernels += [shadow_lookup.write_map, texture_sampling.sample_textures, textured_shading.shade_textured]\n"
        "assert not any(kernel.signatures for kernel in kernels)\n"
        "glass = rz.Scene([rz.Mesh(np.eye(3), [[0, 1, 2]], material=rz.Material(opacity=0.5))])\n"
        "rz.render(glass, 16)\n"
        "assert all(kernel.signatures for kernel in kernels[:7])\n"
    )


# ── many layers ─────────────────────────────────────────────────────────────────────────────────────────


def stack(opacities, seed=None, tilt=0.0):
    """Sheets behind each other, the first one nearest, as one mesh; in any order in the file."""
    n = len(opacities)
    order = np.arange(n) if seed is None else np.random.default_rng(seed).permutation(n)
    sheet = np.array(layer(SIZE, 0.0, is_perspective=False))
    corners = np.repeat(sheet[None], n, axis=0)
    corners[:, :, 2] = -(2.0 + 50.0 * np.arange(n) / n)[:, None] + tilt * np.array((1, -1, 1, -1))
    levels = np.unique(opacities)
    looks = [paint(tuple(COLORS[k % 5]), float(opacity)) for k, opacity in enumerate(levels)]
    faces = np.arange(4 * n).reshape(-1, 4)
    return rz.Mesh(
        corners[order].reshape(-1, 3),
        faces,
        materials=looks,
        face_material=np.searchsorted(levels, np.asarray(opacities)[order]),
    )


def test_a_thousand_layers_in_closed_form():
    opacities = np.random.default_rng(1).choice((0.0, 0.001, 0.01, 0.02, 0.05), 1000)
    transmitted = np.append(1.0, np.cumprod(1 - opacities))
    colors = COLORS[np.searchsorted(np.unique(opacities), opacities) % 5]
    expected = (transmitted[:-1, None] * opacities[:, None] * colors).sum(axis=0)
    frames = [show([stack(opacities, seed)]) for seed in (None, 2, 3)]
    for frame in frames:
        assert np.abs(frame.alpha - (1 - transmitted[-1])).max() < 1e-6
        assert np.abs(frame.color * frame.alpha[..., None] - expected).max() < 1e-6
        assert frame.color.tobytes() == frames[0].color.tobytes() and frame.alpha.tobytes() == frames[0].alpha.tobytes()


@pytest.mark.parametrize("opacity", [1e-4, 1e-7, 1e-12, 1e-30])
def test_the_opacity_of_next_to_nothing_keeps_its_digits(opacity):
    """1 - (1 - a) would be 0, or anything."""
    for tolerance in (0, 1 / 4096):
        frame = show(
            [pane(2.0, paint((0.9, 0.3, 0.2), opacity)), pane(3.0, paint((0.9, 0.3, 0.2), opacity))],
            tolerance=tolerance,
        )
        assert np.abs(frame.alpha / (2 * opacity - opacity**2) - 1).max() < 1e-6
        assert np.abs(frame.color - (0.9, 0.3, 0.2)).max() < 1e-6


@pytest.mark.parametrize("is_textured", [False, True])
def test_ten_thousand_surfaces_that_are_not_there(is_textured):
    """Their material's opacity is 0, or their texture's alpha; the buffers show them, as every surface."""
    clear = paint((1, 1, 1), 0.0)
    if is_textured:
        clear = paint((1, 1, 1), texture=rz.Texture(np.zeros((2, 2, 4))))
    mesh = stack(np.full(10_000 if not is_textured else 300, 0.0), seed=1)
    mesh = rz.Mesh(mesh.vertices, mesh.faces, polygons=mesh.polygons, material=clear, uv=np.zeros((mesh.n_vertex, 2)))
    frame = show([mesh, pane(80.0, paint((0.2, 0.4, 0.6)))], outputs=("color", "rgb", "face", "depth"))
    assert np.abs(frame.color - (0.2, 0.4, 0.6)).max() < 1e-6 and (frame.alpha == 1).all()
    assert (frame.face < mesh.n_face).all() and np.abs(frame.depth - 2.0).max() < 1e-3
    assert not show([mesh]).rgba.any() and show([mesh]).stats.covered == 0


@pytest.mark.parametrize("tolerance", [0.0, 1 / 4096, 0.01, 0.5])
@pytest.mark.parametrize("samples", [1, 4])
def test_what_is_left_out_behind_many_layers_is_within_the_bound(monkeypatch, tolerance, samples):
    """Against all layers: 2 B t in linear intensity, t in opacity; the frame's own bound counts that."""
    rng, brightest = np.random.default_rng(5), 3.0
    for n in (3, 20, 200):
        opacities = rng.choice((0.02, 0.3, 0.9), n)
        meshes = [stack(opacities, 1, tilt=0.3), pane(90.0, paint((brightest, 0.1, 0.1)))]
        frame = show(meshes, tolerance=tolerance, samples=samples)
        with monkeypatch.context() as patch:
            patch.setattr(planning, "least_transmittance", lambda *_: 0.0)
            full = show(meshes, tolerance=tolerance, samples=samples)
        with rz.Renderer(
            rz.Scene(meshes, WHITE, sheet_camera(SIZE[1])), SIZE, tolerance=tolerance, samples=1
        ) as renderer:
            least = renderer._prepared.view_plans.plan.opacity.least
            assert renderer.plan.bound >= brightest
            budget = 2 * renderer.plan.bound * least + 2.0**-24 * brightest
        assert 0 < least and 2 * renderer.plan.bound * least <= frame.stats.error_bound
        off = np.abs(frame.color - full.color).max()
        assert off <= budget, f"{n} layers: {off:.3g} > {budget:.3g}"
        assert np.abs(frame.alpha - full.alpha).max() <= least + 2.0**-24
        assert np.abs(frame.rgba[..., 3].astype(int) - full.rgba[..., 3]).max() <= 1


def test_an_infinite_bound_leaves_nothing_out():
    assert layers.least_transmittance(np.inf) == 0.0
    assert layers.least_transmittance(1e9) == layers.INVISIBLE


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 4])
def test_ranges_of_samples_do_not_change_a_bit(monkeypatch, shading, samples):
    """Lists are worked on some rows, or some samples of a row, at a time."""
    camera = rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=70)
    scene = rz.Scene([soup(5, 90), pane(60.0, paint((0.2, 0.3, 0.4)))], LIT, camera)
    frames = []
    for most in (a_buffer.MOST_FRAGMENTS, 5000, 300, 7, 1):
        monkeypatch.setattr(a_buffer, "MOST_FRAGMENTS", most)
        frames.append(rz.render(scene, SIZE, shading=shading, samples=samples, threads=1))
        assert frames[-1].color.tobytes() == frames[0].color.tobytes(), most
        assert frames[-1].alpha.tobytes() == frames[0].alpha.tobytes(), most


def test_ranges_are_whole_in_order_and_within_the_limit(monkeypatch):
    rng = np.random.default_rng(2)
    for most in (1, 10, 1000, 10**6):
        monkeypatch.setattr(a_buffer, "MOST_FRAGMENTS", most)
        for pitch, n_row in ((1, 1), (8, 5), (40, 16)):
            for counts in (
                np.zeros(pitch * n_row, int),
                rng.integers(0, 9, pitch * n_row),
                rng.integers(0, 2000, pitch * n_row),
            ):
                start = np.append(0, np.cumsum(counts))
                ranges = list(a_buffer.split_samples(start, np.arange(n_row + 1) * pitch))
                assert [first for first, _ in ranges] == [0, *(last for _, last in ranges[:-1])] and ranges[-1][
                    1
                ] == len(counts)
                assert all(
                    last > first and (last - first == 1 or start[last] - start[first] <= most) for first, last in ranges
                )


@pytest.mark.parametrize("n", [0, 1, 2, 3, 24, 65, 1000, 4097])
def test_lists_are_sorted_in_whatever_order_they_are(n):
    rng = np.random.default_rng(n)
    for entries in (
        np.arange(n), np.arange(n)[::-1], rng.permutation(n), rng.integers(0, 5, n), np.zeros(n),
        np.roll(np.arange(n), n // 2),
        np.arange(n) ^ 1, rng.integers(-(2**62), 2**62, n),
    ):  # fmt: skip
        given = np.array(entries, np.int64)
        sort_list(given)
        assert np.array_equal(given, np.sort(np.array(entries, np.int64)))


@numba.njit
def sort_list(entries):
    """The helper in compiled code, as the pipeline has it."""
    a_buffer.sort(entries)
