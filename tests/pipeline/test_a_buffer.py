"""Check the lists of the A-buffer: which samples have one, that they are sorted, and that their array grows."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from helpers import stages
from helpers.arrays import differences
from helpers.pairs import pairs
from helpers.pinhole import QUAD, SHADINGS, octasphere, sheet_camera

import rasterizer as rz
from rasterizer import reference
from rasterizer.pipeline.a_buffer import (
    INVISIBLE,
    Fragments,
    Room,
    gather_fragments,
    make_a_buffer,
    min_transmittance,
    number_samples,
    sort_fragments,
)
from rasterizer.pipeline.cull import Band
from rasterizer.pipeline.gradients import IS_TRANSPARENT
from rasterizer.pipeline.scan import make_deferred
from rasterizer.pipeline.transform import compute_z
from rasterizer.pipeline.visibility import make_extents


def test_samples_in_the_extents_are_numbered_row_by_row():
    extents, n_row = make_extents(20), 20
    extents.left[:3], extents.right[:3] = (3, extents.left[1], 0), (7, extents.right[1], 2)  # nothing in rows 8 to 15
    columns, first = np.empty(n_row, np.int64), np.empty(n_row + 1, np.int64)
    assert number_samples(extents, columns, first) == 8 * 4 + 4 * 2
    assert first.tolist() == [*range(0, 32, 4), *[32] * 8, 32, 34, 36, 38, 40]
    assert [int(columns[row]) + left for row, left in ((0, 3), (7, 3), (16, 0), (19, 0))] == [0, 28, 32, 38]


def test_room_grows_and_keeps_what_it_holds():
    room = Room()
    room.grow(3)
    room.entries[:], room.before[:] = (1, 2, 3), (4, 5, 6)
    entries = room.entries
    room.grow(2)
    assert room.entries is entries
    room.grow(5)
    assert [len(each) for each in (room.before, room.entries, room.sorted)] == [5, 5, 5]
    assert room.entries[:3].tolist() == [1, 2, 3] and room.before[:3].tolist() == [4, 5, 6]


def test_lists_are_sorted_in_whatever_order_they_are():
    rng, lists = np.random.default_rng(3), []
    for n in (0, 1, 2, 3, 24, 65, 1000):
        up = np.arange(n)
        lists += [up, up[::-1], rng.permutation(n), rng.integers(0, 5, n), np.zeros(n, int), np.roll(up, n // 2)]
        lists += [up ^ 1, rng.integers(0, 2**62, n)]
    samples = np.repeat(np.arange(len(lists)), [len(each) for each in lists])
    entries, order, n = np.concatenate(lists).astype(np.int64), rng.permutation(len(samples)), len(samples)
    for dealt in (np.arange(n), order):
        last, before = np.full(len(lists), -1, np.int32), np.empty(n, np.int32)
        for k, sample in enumerate(samples[dealt]):
            before[k], last[sample] = last[sample], k
        starts, out = np.full(len(lists) + 1, 7), np.empty(n, np.int64)
        fragments = Fragments(np.empty(0, np.int64), last, before, entries[dealt], np.array([n, 0]))
        sort_fragments(fragments, starts, out)
        assert starts.tolist() == [0, *np.cumsum([len(each) for each in lists])]
        for k, each in enumerate(lists):
            assert np.array_equal(out[starts[k] : starts[k + 1]], np.sort(each)), f"list {k}"


def test_the_array_of_fragments_grows_up_to_a_limit():
    """A band without opaque surfaces: each sample has as many fragments as triangles cover it."""
    size, rng = (24, 18), np.random.default_rng(4)
    triangles = np.concatenate([stages.random_triangles(rng, n, size, reach) for n, reach in ((60, 20.0), (30, 4.0))])
    triangles = np.concatenate([triangles, stages.slivers(rng, 9, size, 2**10, 3)])
    screen = stages.plain_screen(True, (1.0, 4.0))
    coding = stages.plain_coding("exact", screen, 3, np.float64, features=IS_TRANSPARENT)
    depth, extents = rng.uniform(1.0, 4.0, (len(triangles), 3)), make_extents(size[1])
    deferred, values = make_deferred(len(triangles), extents), np.zeros((len(triangles), 3, 3))
    workspace, _ = stages.scan_alone(triangles, depth, values, coding, screen, size, deferred=deferred)
    drawables = stages.drawables_of(triangles, compute_z(depth, screen), values[None])
    a_buffer = make_a_buffer(extents, size[1], 1)
    rest = deferred.listed(), drawables, workspace.block, workspace.visibility, a_buffer
    band = Band(np.arange(len(triangles), dtype=np.uint32), 0, size[1])
    fragments = gather_fragments(band, *rest, Room())
    expected = sum(reference.coverage(triangle, *size).astype(int) for triangle in triangles)
    n, n_sample = int(fragments.found[0]), len(a_buffer.transmittance)
    assert n == expected.sum() > 4 * n_sample and not fragments.found[1]
    starts, entries = np.empty(n_sample + 1, np.int64), np.empty(n, np.int64)
    sort_fragments(fragments, starts, entries)
    counted = np.diff(starts)
    for row in range(size[1]):
        first, end = a_buffer.first_samples[row : row + 2]
        left = first - a_buffer.columns[row]
        assert np.array_equal(counted[first:end], expected[row, left : left + end - first]), f"row {row}"
    with pytest.raises(rz.SceneError, match="more than 900 samples .* opaque"):
        gather_fragments(band, *rest, Room(), most=900)


# ---------------------------------------------------------------- layers

# Check transparent surfaces: closed forms of what they show, whatever the order of the faces, the samples and the
# threads; what is behind and beside them; ties; and that an opaque scene has no part in it.


SIZE, SMALL = (64, 48), (32, 24)  # pixels of the same cards; of what the reference draws, too
WHITE = (rz.AmbientLight(1.0),)
LIT = (rz.AmbientLight(0.2), rz.DirectionalLight((0.3, -0.4, -1), 0.7))
CAMERA = rz.Camera.orthographic((0, 0, 0), (0, 0, -1), height=SIZE[1], near=1, far=100)
COLORS = np.array([(0.9, 0.1, 0.2), (0.2, 0.8, 0.1), (0.1, 0.3, 0.7), (0.6, 0.6, 0.1), (0.3, 0.1, 0.5)])
OPACITIES = (0.5, 0.3, 0.8, 0.25, 0.6)
TEXELS = np.random.default_rng(8).random((8, 8, 4))
LOOKS = {
    "plain": rz.Material(diffuse=0.8, specular=0.3, shininess=12),
    "coloured": rz.Material(diffuse=(0.8, 0.4, 0.2)),
    "toon": rz.Material(diffuse=0.7, reflection="toon"),
    "textured": rz.Material(diffuse=0.9, texture=rz.Texture(TEXELS[..., :3])),
}
PAIRS = pairs(shading=SHADINGS, samples=(1, 4))


class Card(NamedTuple):
    """A rectangle across the view, of one colour under WHITE."""

    depth: float
    color: tuple
    opacity: float = 1.0
    box: tuple = (0, 0, 10**4, 10**4)  # left, top, right, bottom, px


def paint(color, opacity=1.0, **options):
    """A material that shows one colour under WHITE."""
    return rz.Material(ambient=color, diffuse=0, specular=0, opacity=opacity, **options)


def quad(x, y, width, height, depth, material, tilt=0.0):
    """A rectangle, its lower left corner at (x, y), pixels from the middle of the picture; turned about a vertical axis
    by a depth of `tilt` a pixel."""
    corners = np.array([(x, y), (x + width, y), (x + width, y + height), (x, y + height)], float)
    uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    return rz.Mesh(np.column_stack([corners, -depth - tilt * corners[:, 0]]), QUAD, material=material, uv=uv)


def pane(depth, material, tilt=0.0):
    """A rectangle over the whole picture, and beyond it."""
    return quad(-40, -30, 80, 60, depth, material, tilt)


def ball(material, z=-30.0, radius=14.0):
    vertices, faces = octasphere(2)
    return rz.Mesh(vertices * radius + (0, 0, z), faces, material=material, uv=(vertices[:, :2] + 1) / 2)


def mesh_of(cards, size):
    """Cards as one mesh, in their order."""
    boxes = np.array([card.box for card in cards], float)
    boxes[:, 2:] = np.minimum(boxes[:, 2:], np.array(size) + 9.0)
    left, top, right, bottom = (boxes - np.tile(size, 2) / 2).T
    depth = np.array([card.depth for card in cards])
    corners = [np.stack([x, -y, -depth], 1) for x, y in ((left, bottom), (right, bottom), (right, top), (left, top))]
    looks = sorted({card[1:3] for card in cards})
    return rz.Mesh(
        np.stack(corners, axis=1).reshape(-1, 3),
        np.arange(4 * len(cards)).reshape(-1, 4),
        materials=[paint(*look) for look in looks],
        face_material=[looks.index(card[1:3]) for card in cards],
    )


def closed_form(cards, size):
    """Premultiplied colour (h, w, 3) and alpha (h, w): nearest first, at equal depth the lower face first."""
    color, alpha = np.zeros((size[1], size[0], 3)), np.zeros(size[::-1])
    for card in sorted(cards, key=lambda card: card.depth):
        left, top, right, bottom = card.box
        part = np.s_[top:bottom, left:right]
        color[part] += ((1 - alpha[part]) * card.opacity)[..., None] * np.array(card.color)
        alpha[part] += (1 - alpha[part]) * card.opacity
    return color, alpha


def show(meshes, shading="gouraud", lights=WHITE, camera=CAMERA, size=SIZE, background=None, **options):
    scene = rz.Scene(meshes, lights, camera, background)
    return rz.render(scene, size, shading=shading, **({"samples": 1, "threads": 1, "tolerance": 0} | options))


def show_cards(cards, size=SIZE, **options):
    return show([mesh_of(cards, size)], camera=sheet_camera(size[1]), size=size, **options)


def assert_cards(frame, cards, case, budget=1e-6):
    """Refuse a picture that isn't the closed form."""
    color, alpha = closed_form(cards, frame.alpha.shape[::-1])
    off = np.abs(frame.color * frame.alpha[..., None] - color).max(), np.abs(frame.alpha - alpha).max()
    assert max(off) <= budget, f"{case}: colour off by {off[0]:.3g}, alpha by {off[1]:.3g} > {budget:.3g}"
    wrong = np.abs(frame.rgba[..., 3] - 255 * alpha).max()
    assert wrong <= 0.5 + 255 * budget, f"{case}: alpha's byte off by {wrong:.3g} > 0.5"


def assert_same_bytes(frame, expected, case, where=np.s_[:]):
    for name in ("color", "alpha", "rgba"):
        ours, theirs = getattr(frame, name)[where], getattr(expected, name)[where]
        off = np.abs(ours.astype(float) - theirs).max()
        assert ours.tobytes() == theirs.tobytes(), f"{case}: {name} off by {off:.3g} > 0"


# ---------------------------------------------------------------- closed forms


def test_panes_are_laid_over_each_other():
    behind = np.array((0.2, 0.5, 0.9))
    for n in (1, 2, 5):
        cards = [Card(2.0 + k, tuple(COLORS[k]), OPACITIES[k]) for k in range(n)]
        for shading, samples in PAIRS:
            case = f"{n} panes, {shading}, {samples} samples"
            assert_cards(show_cards(cards, shading=shading, samples=samples), cards, case)
            frame = show_cards(cards, shading=shading, samples=samples, background=tuple(behind))
            color, alpha = closed_form(cards, SIZE)
            off = np.abs(frame.color - (color + (1 - alpha[..., None]) * behind)).max()
            assert off <= 1e-6, f"{case}, before a background: {off:.3g} > 1e-6"
            assert (frame.alpha == 1).all() and (frame.rgba[..., 3] == 255).all(), f"{case}, before a background"


def random_cards(rng, n, size, is_grey=False):
    """Cards in three depths, half of them glass, in any order: most samples have ties."""
    cards = []
    for k in range(n):
        left, top = (int(rng.integers(0, side - 4)) for side in size)
        right, bottom = (int(first + rng.integers(4, 40)) for first in (left, top))
        color = (round(float(rng.random()), 2),) * 3 if is_grey else tuple(COLORS[k % 5])
        opacity = 1.0 if k % 2 else float(rng.choice((0.25, 0.5)))
        cards.append(Card(10.0 * rng.integers(1, 4), color, opacity, (left, top, right, bottom)))
    return cards


def test_at_equal_depth_the_lower_face_is_in_front_in_a_heap_of_cards():
    """Intensities of grey cards stand in their entries, which don't tell their faces, where any error is allowed."""
    for k, (shading, samples, is_grey, tolerance) in enumerate(
        pairs(shading=SHADINGS, samples=(1, 4), is_grey=(True, False), tolerance=(0.0, 1 / 4096))
    ):
        cards = random_cards(np.random.default_rng(k), 60, SIZE, is_grey)
        frame = show_cards(cards, shading=shading, samples=samples, tolerance=tolerance)
        assert_cards(frame, cards, f"{shading}, {samples} samples, {is_grey=}, {tolerance=}", max(tolerance, 1e-6))


def test_ties_with_a_wall_that_is_seen_at_an_angle():
    looks = {"wall": ((0.6,) * 3, 1.0), "red wall": ((0.7, 0.2, 0.1), 1.0), "glass": ((0.3,) * 3, 0.5)}
    looks["blue glass"] = ((0.1, 0.2, 0.8), 0.25)
    orders = [("glass", "wall"), ("wall", "glass"), ("blue glass", "wall"), ("glass", "blue glass", "wall", "glass")]
    orders += [("glass", "wall", "blue glass"), ("red wall", "glass", "wall"), ("glass", "red wall"), ("wall",) * 2]
    for order in orders:
        cards = [Card(20.0, *looks[name]) for name in order]
        for shading, tolerance in pairs(shading=SHADINGS, tolerance=(0.0, 1 / 4096)):
            frame = show([pane(20.0, paint(*looks[name]), 0.25) for name in order], shading, tolerance=tolerance)
            assert_cards(frame, cards, f"{order}, {shading}, {tolerance=}", max(tolerance, 1e-6))


def test_bands_and_threads_and_many_fragments():
    """Two bands, the first with more than 2^22 fragments; drawn twice in the same memory."""
    size, rng = (700, 192), np.random.default_rng(6)
    cards = [Card(2.0 + k, tuple(COLORS[k % 5]), 0.02) for k in range(32)] + random_cards(rng, 200, size)
    cards = [cards[k] for k in rng.permutation(len(cards))]
    expected = show_cards(cards, size)
    assert_cards(expected, cards, "one thread", 2e-6)
    scene = rz.Scene([mesh_of(cards, size)], WHITE, sheet_camera(size[1]))
    with rz.Renderer(scene, size, samples=1, threads=3, tolerance=0) as renderer:
        for turn in range(2):
            assert_same_bytes(renderer.render(), expected, f"three threads, time {turn}")


def test_panes_that_cut_each_other_change_places():
    """Two sheets cross in the middle column: each side has the order of its depths."""
    meshes = [pane(5.0, paint(tuple(COLORS[k]), OPACITIES[k]), tilt) for k, tilt in ((0, -0.01), (1, 0.01))]
    for order in ((0, 1), (1, 0)):
        frame = show([meshes[k] for k in order])
        premultiplied = frame.color * frame.alpha[..., None]
        for columns, (front, behind) in ((slice(0, 32), (1, 0)), (slice(32, 64), (0, 1))):
            expected = OPACITIES[front] * COLORS[front] + (1 - OPACITIES[front]) * OPACITIES[behind] * COLORS[behind]
            off = np.abs(premultiplied[:, columns] - expected).max()
            assert off < 1e-6, f"columns {columns}, order {order}: {off:.3g} > 1e-6"


def test_a_thousand_layers_and_what_is_left_out_behind_them():
    """Fragments behind a transmittance of INVISIBLE may change a colour by 2 B t, alpha by t."""
    rng, size, brightest = np.random.default_rng(1), (24, 10), 3.0
    for some, n in (((0.0, 0.001, 0.002), 1000), ((0.02, 0.3, 0.9), 200), ((0.02, 0.3), 20)):
        cards = [Card(2.0 + 0.05 * k, tuple(COLORS[k % 5]), float(rng.choice(some))) for k in range(n)]
        cards = [cards[k] for k in rng.permutation(n)] + [Card(90.0, (brightest, 0.1, 0.1))]
        budget = 2 * brightest * INVISIBLE + 2.0**-23 * brightest
        assert_cards(show_cards(cards, size), cards, f"{n} layers", budget)
    assert min_transmittance(np.inf) == 0.0 and min_transmittance(1e9) == INVISIBLE


def test_opacity_0_shows_nothing_and_1_hides_all():
    clear, solid = paint((0.9, 0.9, 0.9), 0.0), paint((0.3, 0.2, 0.1), 1.0)
    half = pane(4.0, paint((0.7, 0.7, 0.1), 0.5))
    for shading in SHADINGS:
        nothing = show([pane(2.0, clear)], shading)
        assert not nothing.color.any() and not nothing.rgba.any() and nothing.stats.covered == 0, shading
        with_clear = show([pane(2.0, clear), half, pane(3.0, clear)], shading)
        assert np.array_equal(with_clear.color, show([half], shading).color), shading
        hidden = show([half, pane(3.0, solid), pane(3.5, clear)], shading)
        assert np.abs(hidden.color - (0.3, 0.2, 0.1)).max() < 1e-6 and (hidden.alpha == 1).all(), shading


def test_many_surfaces_that_are_not_there():
    """Their material's opacity is 0, or their texture's alpha; the buffers show them, as every surface."""
    size, back = (16, 12), Card(80.0, (0.2, 0.4, 0.6))
    for clear in (paint((1, 1, 1), 0.0), paint((1, 1, 1), texture=rz.Texture(np.zeros((2, 2, 4))))):
        mesh = mesh_of([Card(2.0 + 0.05 * k, (1, 1, 1), 0.0) for k in range(1000)], size)
        mesh = replace(mesh, materials=None, face_material=None, material=clear, uv=np.zeros((mesh.n_vertex, 2)))
        options = {"size": size, "camera": sheet_camera(size[1])}
        frame = show([mesh, mesh_of([back], size)], outputs=("color", "rgb", "face", "depth"), **options)
        assert np.abs(frame.color - (0.2, 0.4, 0.6)).max() < 1e-6 and not differences(frame.alpha, 1)
        assert frame.face.max() < 2 and np.abs(frame.depth - 2.0).max() < 1e-6
        alone = show([mesh], **options)
        assert not differences(alone.rgba, 0) and alone.stats.covered == 0


def test_the_opacity_of_next_to_nothing_keeps_its_digits():
    """1 - (1 - a) would be 0, or anything."""
    for opacity in (1e-4, 1e-7, 1e-12, 1e-30):
        for tolerance in (0, 1 / 4096):
            glass = paint((0.9, 0.3, 0.2), opacity)
            frame = show([pane(2.0, glass), pane(3.0, glass)], tolerance=tolerance)
            off = np.abs(frame.alpha / (2 * opacity - opacity**2) - 1).max(), np.abs(frame.color - glass.ambient).max()
            assert max(off) < 1e-6, f"opacity {opacity}: alpha off by {off[0]:.3g} of it, colour by {off[1]:.3g} > 1e-6"


# ---------------------------------------------------------------- what else opacity meets


def test_the_alpha_of_a_texture_multiplies_the_opacity():
    """Four texels, a quarter of the picture each."""
    texels = np.ones((2, 2, 4))
    texels[..., 3] = [[1.0, 0.5], [0.0, 0.25]]
    front = paint((0.8, 0.4, 0.2), 0.5, texture=rz.Texture(texels, "nearest"))
    mesh, further = (quad(-32, -24, 64, 48, depth, front) for depth in (3.0, 4.0))
    back = pane(5.0, paint((0.1, 0.2, 0.9)))
    alpha = 0.5 * np.kron(texels[..., 3], np.ones((24, 32)))
    expected = alpha[..., None] * (0.8, 0.4, 0.2) + (1 - alpha[..., None]) * (0.1, 0.2, 0.9)
    for shading in SHADINGS:
        assert np.abs(show([mesh], shading).alpha - alpha).max() < 1e-6, shading
        for meshes in ([mesh, back], [back, mesh]):
            assert np.abs(show(meshes, shading).color - expected).max() < 1e-6, shading
        twice = show([further, mesh], shading).alpha
        assert np.abs(twice - (1 - (1 - alpha) ** 2)).max() < 1e-6, f"{shading}, two behind each other"


def test_layers_of_a_grey_scene_take_one_channel():
    meshes = [pane(2.0, paint(0.9, 0.5)), pane(3.0, paint(0.4, 0.25))]
    with rz.Renderer(rz.Scene(meshes, WHITE, CAMERA), SIZE, tolerance=0, samples=1) as renderer:
        assert renderer.plan.channels == 1
        frame = renderer.render()
    assert np.abs(frame.color * frame.alpha[..., None] - (0.45 + 0.5 * 0.25 * 0.4)).max() < 1e-6


def test_policies_for_bright_layers():
    """`global` divides by the largest component of the picture, `local` by that of the pixel; both before the sRGB
    curve."""
    meshes = [pane(2.0, paint((3.0, 0.5, 0.25), 0.5)), pane(3.0, paint((1.0, 2.0, 0.5), 0.5))]
    color = (0.5 * np.array((3.0, 0.5, 0.25)) + 0.25 * np.array((1.0, 2.0, 0.5))) / 0.75
    for policy, x in (("clamp", np.minimum(color, 1)), ("global", color / color.max()), ("local", color / color.max())):
        level = np.rint(255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055))
        for samples in (1, 4):
            frame = show(meshes, color_range=policy, samples=samples)
            assert np.abs(frame.color - color).max() < 1e-5, policy
            assert (frame.rgb == level).all() and (frame.rgba[..., 3] == 191).all(), f"{policy}: {frame.rgba[0, 0]}"


def test_what_is_covered_in_part_counts_by_its_samples():
    """A pane that ends in the middle of column 32, with 2 x 2 samples: alpha is the mean of the samples' alphas."""
    frame = show([quad(-32, -24, 32.5, 48, 2, paint((0.9, 0.3, 0.3), 0.6))], samples=4)
    assert np.abs(frame.alpha[:, [31, 32, 33]] - (0.6, 0.3, 0)).max() < 1e-6
    assert np.abs(frame.color[:, :33] - (0.9, 0.3, 0.3)).max() < 1e-6
    assert not differences(frame.rgba[0, [31, 32, 33], 3], (153, 77, 0))


def test_a_back_is_seen_through_the_front():
    """A glass ball: two layers everywhere but at its outline; without its back one."""
    glass = ball(paint((0.5, 0.6, 0.7), 0.4))
    both, front = show([glass]).alpha, show([glass], cull="back").alpha
    assert np.abs(both[front > 0] - (1 - 0.6**2)).max() < 1e-6 and np.abs(front[front > 0] - 0.4).max() < 1e-6
    assert not differences(both > 0, front > 0) and (front > 0).sum() > 300


# ---------------------------------------------------------------- opaque surfaces behind and beside


def test_an_opaque_scene_plans_no_layers():
    for meshes, is_layered in (([pane(2.0, paint(0.5))], False), ([pane(2.0, paint(0.5, 0.5))], True)):
        with rz.Renderer(rz.Scene(meshes, WHITE, CAMERA), SIZE, samples=1) as renderer:
            assert ("transparency" in renderer.plan.features) == is_layered
    assert replace(paint(0.5), opacity=1.0).is_opaque and not replace(paint(0.5), opacity=0.999).is_opaque


def test_a_pane_in_a_corner_leaves_all_other_pixels_bit_for_bit():
    """Rows that it shares with the model are in its bands; its columns are none of the model's. Beside the picture it
    counts for the plan and is not seen."""
    seen = np.zeros(SIZE[::-1], bool)
    seen[24 - 11 : 24 - 4, 32 + 20 : 32 + 29] = seen[24 - 12 : 24, 32 - 30 : 32 - 24] = True
    glasses = (paint(0.4, 0.5), paint((0.2, 0.5, 0.7), 0.3), paint(0.4, 0.5, texture=rz.Texture(TEXELS)))
    for look, shading, samples, glass in pairs(look=tuple(LOOKS), shading=SHADINGS, samples=(1, 4), glass=glasses):
        case = f"{look}, {shading}, {samples} samples, {glass}"
        expected, frame = (
            show([ball(LOOKS[look]), quad(20 + x, 4, 9, 7, 50.0, glass), quad(-30 + x, 0, 6, 12, 5.0, glass)],
                 shading, LIT, samples=samples, tolerance=1 / 4096)
            for x in (200, 0)
        )  # fmt: skip
        assert not expected.alpha[seen].all() and (frame.alpha[seen] > 0).all(), case
        assert (frame.alpha[seen & (expected.alpha == 0)] < 1).all(), case
        assert_same_bytes(frame, expected, case, ~seen)


def test_opaque_samples_behind_a_pane_are_shaded_as_without_it():
    """The picture through a pane of one colour is a mix of two."""
    opacity, color = 0.25, np.array((0.9, 0.2, 0.1))
    meshes = [ball(LOOKS["plain"]), pane(90.0, paint(0.1))]
    glass = quad(-10, -24, 25, 48, 2.0, paint(tuple(color / 0.2), opacity))
    for shading, samples in PAIRS:
        mixed = show(meshes, shading, LIT, samples=samples).color
        mixed[:, 22:47] = opacity * color + (1 - opacity) * mixed[:, 22:47]
        frame = show([*meshes, glass], shading, LIT, samples=samples)
        off = np.abs(frame.color - mixed).max()
        assert off < 1e-6 and (frame.alpha == 1).all(), f"{shading}, {samples} samples: {off:.3g} > 1e-6"


# ---------------------------------------------------------------- against the reference


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


def assert_matches_reference(scene, part, tolerances=(0,), **options):
    """Refuse a picture of which more than a part is off, in its premultiplied colour or its alpha."""
    judge = reference.render(scene, SMALL, **options)
    for tolerance in tolerances:
        frame, budget = rz.render(scene, SMALL, tolerance=tolerance, **options), max(tolerance, 1e-6)
        off = np.abs(frame.color * frame.alpha[..., None] - judge.color * judge.alpha[..., None]).max(axis=-1)
        off = np.maximum(off, np.abs(frame.alpha - judge.alpha))
        found = (off > budget).mean()
        assert found < part, f"{options}: {found:.3g} of the pixels differ > {part}, by up to {off.max():.3g}"


def test_a_soup_of_triangles_is_that_of_the_reference():
    """But for the few samples where two surfaces are too near to each other for depths to tell."""
    camera = rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=70, near=0.5, far=20)
    for seed, (shading, samples) in enumerate((("flat", 4), ("gouraud", 1), ("phong", 1))):
        assert_matches_reference(rz.Scene([soup(seed + 3)], LIT, camera), 0.003, shading=shading, samples=samples)


def mixed_scene(seed, n_layer):
    """All looks, opaque and not, tilted panes that cut them, ties, and an empty part of the picture."""
    rng = np.random.default_rng(seed)
    meshes = [ball(look, -30.0 - 5 * k, 6 + 3 * k) for k, look in enumerate(LOOKS.values())]
    meshes += [quad(-28, -20, 20, 30, 40.0, paint(0.5)), quad(-24, -16, 20, 20, 40.0, paint(0.7, 0.4))]
    for k in range(n_layer):
        x, y, width, height = rng.integers((-30, -20, 6, 6), (10, 10, 30, 30))
        look = list(LOOKS.values())[k % 4]
        options = {"texture": rz.Texture(TEXELS)} if look.texture is not None else {}
        glass = rz.Material(
            diffuse=look.diffuse, reflection=look.reflection, opacity=float(rng.choice((0, 0.3, 0.6))), **options
        )
        meshes.append(quad(x, y, width, height, rng.uniform(12, 40), glass, rng.uniform(-0.3, 0.3)))
    return rz.Scene([meshes[k] for k in rng.permutation(len(meshes))], LIT, CAMERA)


@pytest.mark.parametrize("shading, samples, n_layer", [("flat", 1, 7), ("gouraud", 4, 7), ("phong", 1, 12)])
def test_mixed_scenes_are_those_of_the_reference(shading, samples, n_layer):
    """But for the few samples next to where two surfaces cut, and the edges of texels and of toon bands."""
    scene = mixed_scene(n_layer, n_layer)
    assert_matches_reference(scene, 0.01, (0.0, 1 / 4096), shading=shading, samples=samples)


@pytest.mark.nightly
@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("n_layer", [1, 40])
def test_mixed_scenes_of_any_number_of_layers_are_those_of_the_reference(shading, samples, n_layer):
    scene = mixed_scene(n_layer, n_layer)
    assert_matches_reference(scene, 0.01, (0.0, 1 / 4096), shading=shading, samples=samples)
