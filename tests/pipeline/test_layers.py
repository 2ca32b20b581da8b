"""Check what is behind transparent surfaces and beside them: opaque surfaces, ties with them, bands, ranges."""

import numpy as np
import pytest
from helpers.pinhole import QUAD, SHADINGS, layer, octasphere, sheet_camera

import rasterizer as rz
from rasterizer import reference
from rasterizer.engine import draw, transparency
from rasterizer.pipeline import a_buffer

SIZE = (64, 48)
WHITE = (rz.AmbientLight(1.0),)
LIT = (rz.AmbientLight(0.2), rz.DirectionalLight((0.3, -0.4, -1), 0.7))
CAMERA = rz.Camera.orthographic((0, 0, 0), (0, 0, -1), height=SIZE[1], near=1, far=100)
TEXELS = np.random.default_rng(8).random((8, 8, 4))
LOOKS = {
    "plain": rz.Material(diffuse=0.8, specular=0.3, shininess=12),
    "coloured": rz.Material(diffuse=(0.8, 0.4, 0.2)),
    "toon": rz.Material(diffuse=0.7, reflection="toon"),
    "textured": rz.Material(diffuse=0.9, texture=rz.Texture(TEXELS[..., :3])),
}


def paint(color, opacity=1.0, **options):
    """A material that shows one colour under WHITE."""
    return rz.Material(ambient=color, diffuse=0, specular=0, opacity=opacity, **options)


def quad(x, y, width, height, depth, material, tilt=0.0):
    """A rectangle, its lower left corner at (x, y), pixels from the middle of the picture; turned about a vertical axis
    by a depth of `tilt` a pixel."""
    corners = np.array([(x, y), (x + width, y), (x + width, y + height), (x, y + height)], float)
    z = -depth - tilt * corners[:, 0]
    uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    return rz.Mesh(np.column_stack([corners, z]), QUAD, material=material, uv=uv)


def pane(depth, material, tilt=0.0):
    """A rectangle over the whole picture."""
    return quad(-40, -30, 80, 60, depth, material, tilt)


def ball(material, z=-30.0, radius=14.0):
    vertices, faces = octasphere(3)
    uv = (vertices[:, :2] + 1) / 2
    return rz.Mesh(vertices * radius + (0, 0, z), faces, material=material, uv=uv)


def show(meshes, shading="gouraud", lights=LIT, camera=CAMERA, **options):
    return rz.render(
        rz.Scene(meshes, lights, camera), SIZE, shading=shading, **({"samples": 1} | {"threads": 1} | options)
    )


def assert_same_bytes(frame, expected, where=np.s_[:]):
    for name in ("color", "alpha", "rgba"):
        ours, theirs = getattr(frame, name)[where], getattr(expected, name)[where]
        assert ours.tobytes() == theirs.tobytes(), f"{name}: {np.abs(ours.astype(float) - theirs).max():.3g} > 0"


# ---------------------------------------------------------------- a pane in a corner


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("look", LOOKS)
def test_a_pane_in_a_corner_leaves_all_other_pixels_bit_for_bit(shading, samples, look):
    """Rows that it shares with the model are in its bands; its columns are none of the model's. Beside the picture it
    counts for the plan and is not seen."""
    model = ball(LOOKS[look])
    seen = np.zeros(SIZE[::-1], bool)
    seen[24 - 11 : 24 - 4, 32 + 20 : 32 + 29] = seen[24 - 12 : 24, 32 - 30 : 32 - 24] = True
    for glass in (paint(0.4, 0.5), paint((0.2, 0.5, 0.7), 0.3), paint(0.4, 0.5, texture=rz.Texture(TEXELS))):
        expected, frame = (
            show([model, quad(20 + x, 4, 9, 7, 50.0, glass), quad(-30 + x, 0, 6, 12, 5.0, glass)], shading,
                 samples=samples)
            for x in (200, 0)
        )  # fmt: skip
        assert not expected.alpha[seen].all() and (frame.alpha[seen] > 0).all()
        assert (frame.alpha[seen & (expected.alpha == 0)] < 1).all()
        assert_same_bytes(frame, expected, ~seen)


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 4])
def test_opaque_samples_behind_a_pane_are_shaded_as_without_it(shading, samples):
    """The picture through a pane of one colour is a mix of two, and only where nothing is behind is alpha below 1."""
    model, opacity, color = ball(LOOKS["plain"]), 0.25, np.array((0.9, 0.2, 0.1))
    plain = show([model, quad(-32, -24, 64, 48, 90.0, paint(0.1))], shading, lights=LIT, samples=samples, tolerance=0)
    glass = quad(-10, -24, 25, 48, 2.0, paint(tuple(color / 0.2), opacity))
    frame = show(
        [model, quad(-32, -24, 64, 48, 90.0, paint(0.1)), glass], shading, lights=LIT, samples=samples, tolerance=0
    )
    mixed = plain.color.copy()
    mixed[:, 22:47] = opacity * color + (1 - opacity) * plain.color[:, 22:47]
    assert np.abs(frame.color - mixed).max() < 1e-6 and (frame.alpha == 1).all()


def test_memory_is_that_of_the_samples_of_a_pane():
    """The A-buffer of a speck has room for a speck."""
    size, rooms = (640, 480), []
    for width in (10, 640):
        meshes = [rz.Mesh(np.array(layer(size, 9.0, is_perspective=False)), QUAD)]
        meshes.append(quad(-width / 2, -5, width, 10, 4.0, paint(0.5, 0.5)))
        with rz.Renderer(
            rz.Scene(meshes, LIT, sheet_camera(size[1])), size, threads=1, shading="phong", samples=1
        ) as renderer:
            renderer.render()
            (free,) = renderer._prepared.workspaces._free.values()
            rooms.append(sum(workspace.room.n_byte for workspace in free))
    assert rooms[0] < rooms[1] / 10, f"{rooms[0]} bytes > a tenth of {rooms[1]}"


# ---------------------------------------------------------------- ties


def over(layers):
    """Colour and alpha of (colour, opacity), nearest first, weighted by the opacity."""
    color, alpha = np.zeros(3), 0.0
    for here, opacity in reversed(layers):
        color, alpha = opacity * np.asarray(here) + (1 - opacity) * color, opacity + (1 - opacity) * alpha
    return color, alpha


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("tolerance", [0.0, 1 / 4096])
@pytest.mark.parametrize("tilt", [0.0, 0.25])
def test_of_a_pane_on_a_wall_the_lower_face_is_in_front(shading, tolerance, tilt):
    """Walls of one channel carry intensities in their entries, which don't tell their faces."""
    looks = {"wall": ((0.6,) * 3, 1.0), "red wall": ((0.7, 0.2, 0.1), 1.0), "glass": ((0.3,) * 3, 0.5)}
    looks["blue glass"] = ((0.1, 0.2, 0.8), 0.25)
    orders = [("glass", "wall"), ("wall", "glass"), ("blue glass", "wall"), ("glass", "blue glass", "wall", "glass")]
    orders += [("glass", "wall", "blue glass"), ("red wall", "glass", "wall"), ("glass", "red wall"), ("wall",) * 2]
    for order in orders:
        meshes = [pane(20.0, paint(*looks[name]), tilt) for name in order]
        frame = show(meshes, shading, WHITE, tolerance=tolerance)
        first_wall = next(k for k, name in enumerate(order) if "wall" in name)
        color, alpha = over([looks[name] for name in order[: first_wall + 1]])
        off = np.abs(frame.color - color).max()
        assert off <= max(tolerance, 1e-6), f"{order}: {off:.3g} > {tolerance:.3g}"
        assert alpha == 1 and (frame.alpha == 1).all()


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 4])
def test_ties_of_a_heap_of_cards_are_those_of_the_reference(shading, samples):
    """Cards in three planes, half of them glass, in any order: most samples have ties."""
    rng, meshes = np.random.default_rng(samples), []
    for k in range(40):
        x, y, width, height = rng.integers((-30, -20, 4, 4), (20, 12, 30, 24))
        look = paint(round(float(rng.random()), 2), 1.0 if k % 2 else float(rng.choice((0.25, 0.5))))
        meshes.append(quad(x, y, width, height, 10.0 * rng.integers(1, 4), look))
    scene = rz.Scene(meshes, WHITE, CAMERA)
    expected = reference.render(scene, SIZE, shading=shading, samples=samples)
    for tolerance in (0.0, 1 / 4096):
        frame = rz.render(scene, SIZE, shading=shading, samples=samples, tolerance=tolerance)
        off = np.abs((frame.color - expected.color) * expected.alpha[..., None]).max()
        assert off <= max(tolerance, 1e-6), f"{off:.3g} > {tolerance:.3g}"
        assert np.abs(frame.alpha - expected.alpha).max() <= 2.0**-12


def test_bands_are_scanned_again_only_where_a_tie_is(monkeypatch):
    scanned, again = [], transparency.scan_by_index

    def noted(task):
        scanned.append((task.band.y_start, task.band.y_end))
        return again(task)

    monkeypatch.setattr(transparency, "scan_by_index", noted)
    monkeypatch.setattr(draw, "BAND_ENTRIES", 8 * SIZE[0])
    wall, glass = pane(20.0, paint(0.6)), paint(0.3, 0.5)
    show([wall, pane(10.0, glass)], lights=WHITE)
    assert not scanned
    show([wall, pane(10.0, glass), quad(-32, 9, 64, 5, 20.0, glass)], lights=WHITE)
    assert scanned == [(8, 16)]
    scanned.clear()
    show([wall, pane(10.0, glass), quad(-32, 9, 64, 5, 20.0, glass)], lights=WHITE, tolerance=0)
    assert not scanned, "exact records tell their faces"


# ---------------------------------------------------------------- bands, threads, ranges


def mixed_scene(seed, n_layer=6):
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
    return [meshes[k] for k in rng.permutation(len(meshes))]


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 4])
def test_bands_threads_and_ranges_do_not_change_a_byte(monkeypatch, shading, samples):
    meshes = mixed_scene(3)
    expected = show(meshes, shading, samples=samples)
    changes = [(draw, "BAND_ENTRIES", n) for n in (1, 700, 3000)] + [(transparency, "MOST_SHADED", n) for n in (1, 900)]
    changes += [(a_buffer, "MOST_FRAGMENTS", n) for n in (40, 1000)]
    for threads in (1, 3):
        assert_same_bytes(show(meshes, shading, samples=samples, threads=threads), expected)
        for module, name, value in changes:
            with monkeypatch.context() as patch:
                patch.setattr(module, name, value)
                assert_same_bytes(show(meshes, shading, samples=samples, threads=threads), expected)


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("n_layer", [1, 7, 40])
def test_mixed_scenes_are_those_of_the_reference(shading, samples, n_layer):
    """But for the few samples next to where two surfaces cut, and the edges of texels and of toon bands."""
    scene = rz.Scene(mixed_scene(n_layer, n_layer), LIT, CAMERA)
    expected = reference.render(scene, SIZE, shading=shading, samples=samples)
    for tolerance in (0.0, 1 / 4096):
        frame = rz.render(scene, SIZE, shading=shading, samples=samples, tolerance=tolerance)
        off = np.abs(frame.color - expected.color).max(axis=-1) * expected.alpha
        off = np.maximum(off, np.abs(frame.alpha - expected.alpha))
        part = (off > max(tolerance, 1e-6)).mean()
        assert part < 0.01, f"{part:.3g} of the pixels differ > 0.01, by up to {off.max():.3g}"


def test_three_hundred_layers_are_those_of_the_reference():
    """Of all looks, before a plain wall, in any order."""
    rng = np.random.default_rng(4)
    colors = [(0.5,) * 3, (0.9, 0.2, 0.1), (0.1, 0.3, 0.8)]
    looks = [paint(color, opacity) for color in colors for opacity in (0.0, 0.004, 0.02)]
    meshes = [quad(-20, -10, 40, 20, 5 + 0.25 * k, looks[rng.integers(len(looks))]) for k in range(300)]
    meshes = [meshes[k] for k in rng.permutation(300)] + [quad(-32, -24, 40, 48, 90.0, paint(0.4))]
    scene = rz.Scene(meshes, WHITE, CAMERA)
    expected = reference.render(scene, SIZE, shading="gouraud")
    for tolerance in (0.0, 1 / 4096):
        frame = rz.render(scene, SIZE, shading="gouraud", tolerance=tolerance, samples=1)
        off = np.abs((frame.color - expected.color) * expected.alpha[..., None]).max()
        assert off <= max(tolerance, 2e-6), f"{off:.3g} > {tolerance:.3g}"
        assert np.abs(frame.alpha - expected.alpha).max() <= 2.0**-12
