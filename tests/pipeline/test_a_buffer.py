"""Check the lists of the A-buffer: which samples have one, that they are sorted, and that their array grows."""

from typing import NamedTuple

import numpy as np
import pytest
from helpers import stages
from helpers.pairs import pairs
from helpers.pinhole import QUAD, SHADINGS, octasphere, sheet_camera

import rasterizer as rz
from rasterizer import reference
from rasterizer.pipeline.a_buffer import (
    INVISIBLE,
    Room,
    gather_fragments,
    make_a_buffer,
    min_transmittance,
    sort_fragments,
)
from rasterizer.pipeline.cull import Band
from rasterizer.pipeline.gradients import IS_TRANSPARENT
from rasterizer.pipeline.scan import make_deferred
from rasterizer.pipeline.transform import compute_z
from rasterizer.pipeline.visibility import make_extents


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
    starts, packed = np.empty(n_sample + 1, np.int64), np.empty(n, np.int64)
    sort_fragments(fragments, starts, packed)
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
    """Intensities of grey cards stand in their packed samples, which don't tell their faces, where any error is
    allowed."""
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


# ---------------------------------------------------------------- against the reference


def assert_matches_reference(scene, part, tolerances=(0,), **options):
    """Refuse a picture of which more than a part is off, in its premultiplied colour or its alpha."""
    judge = reference.render(scene, SMALL, **options)
    for tolerance in tolerances:
        frame, budget = rz.render(scene, SMALL, tolerance=tolerance, **options), max(tolerance, 1e-6)
        off = np.abs(frame.color * frame.alpha[..., None] - judge.color * judge.alpha[..., None]).max(axis=-1)
        off = np.maximum(off, np.abs(frame.alpha - judge.alpha))
        found = (off > budget).mean()
        assert found < part, f"{options}: {found:.3g} of the pixels differ > {part}, by up to {off.max():.3g}"


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
