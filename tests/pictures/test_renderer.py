"""Check a Renderer over many pictures: the same bytes as fresh ones, no memory, no side effects; arrays that are
given, and what buffers hold of surfaces."""

import gc
import hashlib
import itertools
import threading
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pinhole import octasphere, torus
from helpers.processes import at_once
from helpers.raster import COLORED, GREY, ROOT
from helpers.small_scenes import cube, drawn, floor
from helpers.small_scenes import scene_of as small_scene

import rasterizer as rz
from bench import scale
from rasterizer.choices import BUFFERS
from rasterizer.engine import ground_shadow, plan

SIZE = (37, 29)
ALL = ("color", "rgb", "depth", "face", "normal")
ARRAYS = ("color", "alpha", "rgba", "depth", "face", "normal")
AWAY = rz.Camera.perspective((0, 0, 5), (0, 0, 10))
CARRIED = (
    rz.AmbientLight(0.1),
    rz.DirectionalLight((-0.4, -0.5, -0.8), 0.5, "camera"),
    rz.PointLight((-0.5, 0.5, -1), 0.5, (1, 0, 0.01), "camera"),
)

SHADED = (rz.AmbientLight(0.1), rz.PointLight((2, 3, 4), 0.8, shadow=rz.Shadow(64)))


def scene_of(lights=COLORED, **options):
    """A ring round a ball, of different materials, one of them with colours."""
    vertices, faces = octasphere(2)
    colors = np.random.default_rng(0).random(vertices.shape)
    shiny = rz.Material(specular=0.5, shininess=60, reflection="blinn")
    ball = rz.Mesh(vertices * 0.5, faces, material=shiny, colors=colors if lights is COLORED else None)
    return rz.Scene([rz.Mesh(*torus(12, 8)), ball], lights, **options)


def walk(n):
    """Cameras on a way round, through and away from the scene, of every kind."""
    for k in range(n):
        a = 2 * np.pi * k / n
        place = (3 * np.cos(a), 2 * np.sin(3 * a), 3 * np.sin(a))
        yield (
            rz.Camera.perspective(place, fov=30 + 3 * (k % 10)),
            rz.Camera.orthographic(place, height=2 + k % 3),
            rz.Camera.perspective((0.9 * np.cos(a), 0.1, 0.9 * np.sin(a)), (0, 0, 0), fov=100),
            rz.Camera.perspective(place, near=2.5, far=3.6),
            AWAY,
        )[k % 5]


def digest(frame):
    """A fingerprint of everything that a frame holds."""
    content = hashlib.sha256()
    for name in ARRAYS:
        array = getattr(frame, name)
        content.update(f"{name} {array.shape} {array.dtype}".encode() + array.tobytes())
    return content.hexdigest()


SETUPS = [
    ("phong", COLORED, {}), ("gouraud", CARRIED, {}), ("flat", CARRIED, {"tolerance": 0}),
    ("phong", CARRIED, {"samples": 4, "threads": 3}), ("gouraud", COLORED, {"cull": "back", "color_range": "global"}),
    ("phong", CARRIED, {"tolerance": 0}), ("phong", SHADED, {}),
]  # fmt: skip


@pytest.mark.parametrize("shading, lights, setup", SETUPS, ids=range(len(SETUPS)))
def test_many_cameras_give_the_bytes_of_fresh_renders(shading, lights, setup):
    """Whatever was drawn before, from inside, outside or nothing at all, must leave no trace."""
    options = {"size": SIZE, "shading": shading, "outputs": ALL, "samples": 1, **setup}
    scene, cameras = scene_of(lights), [*walk(10)] * 2
    with rz.Renderer(scene, **options) as renderer:
        frames = [renderer.render(camera) for camera in cameras]
    drawn = [digest(frame) for frame in frames]  # after all are drawn: a later one may not change them
    fresh = [digest(rz.render(scene_of(lights, camera=camera), **options)) for camera in cameras[:10]]
    wrong = [k for k in range(20) if drawn[k] != fresh[k % 10]]
    assert not wrong, f"pictures {wrong} depend on those before"
    assert len(set(drawn)) == 9, "two of the cameras see nothing, all others something else"


def test_a_camera_that_is_given_counts_and_the_scenes_own_stays():
    own, other = [*walk(4)][:2]
    scene = scene_of(camera=own)
    with rz.Renderer(scene, SIZE, outputs=ALL) as renderer:
        frames = [
            renderer.render(),
            renderer.render(other),
            renderer.render(camera=None),
            renderer.render(own),
        ]
    digests = [digest(frame) for frame in frames]
    assert digests[0] == digests[2] == digests[3] == digest(rz.render(scene, SIZE, outputs=ALL))
    assert digests[1] == digest(rz.render(replace(scene, camera=other), SIZE, outputs=ALL)) != digests[0]
    assert scene.camera is own


def test_a_scene_without_a_camera_is_framed_for_the_size():
    scene = scene_of()
    for size in ((160, 120), (90, 240)):
        framed = rz.Camera.framing(scene, aspect=size[0] / size[1])
        expected = rz.render(replace(scene, camera=framed), size, outputs=ALL)
        assert digest(rz.render(scene, size, outputs=ALL)) == digest(expected)
        covered = np.argwhere(rz.render(scene, size, samples=1).alpha > 0)
        share = (np.ptp(covered, axis=0) + 1) / (size[1], size[0])
        assert 0.88 < share.max() < 0.92, f"the scene fills {share.max():.2f} of the picture, not 0.9"


def test_what_is_no_camera_is_refused():
    with rz.Renderer(scene_of(), SIZE, samples=1) as renderer:
        for given in ("front", (0, 0, 5), 5):
            with pytest.raises(rz.SceneError, match="camera"):
                renderer.render(given)


# ---------------------------------------------------------------- no side effects


def test_a_caller_may_write_into_a_frame():
    """Frames are his: another picture takes nothing from them, and leaves them alone."""
    with rz.Renderer(scene_of(), SIZE, outputs=ALL) as renderer:
        camera = next(walk(1))
        first = renderer.render(camera)
        expected = digest(first)
        for name in ("color", "rgba", "depth", "face", "normal"):
            getattr(first, name)[...] = 7
        assert digest(renderer.render(camera)) == expected
        assert not differences(first.color, 7) and not differences(first.depth, 7)


# ---------------------------------------------------------------- threads and processes


@pytest.mark.parametrize("is_shared", [True, False], ids=["one scene", "four scenes"])
def test_renderers_in_threads_of_the_caller(is_shared):
    """Each thread has a Renderer; they share kernels, and the scene if the caller likes."""
    scenes = (
        [scene_of(CARRIED)] * 4 if is_shared else [scene_of(lights) for lights in (CARRIED, COLORED, GREY, CARRIED)]
    )
    options = [
        {"size": SIZE, "shading": shading, "outputs": ALL, "threads": threads}
        for shading, threads in (("phong", 1), ("gouraud", 2), ("flat", 1), ("phong", 2))
    ]
    cameras = [*walk(5)] * 2
    expected = [
        [digest(rz.render(replace(scene, camera=camera), **{"samples": 1} | given)) for camera in cameras[:5]]
        for scene, given in zip(scenes, options, strict=True)
    ]

    def draw(k):
        with rz.Renderer(scenes[k], **{"samples": 1} | options[k]) as renderer:
            return [digest(renderer.render(camera)) for camera in cameras]

    assert at_once(draw, 4) == [digests * 2 for digests in expected]


def test_close_ends_the_threads(alone):
    before = threading.active_count()
    with rz.Renderer(scene_of(), SIZE, threads=4, samples=1) as renderer:
        renderer.render()
        assert threading.active_count() > before, "nothing is drawn on other threads"
    assert threading.active_count() == before, f"{threading.active_count() - before} threads are left after close"
    renderer.close()  # once more does no harm


def test_a_closed_renderer_says_so():
    for threads in (1, 2):
        with rz.Renderer(scene_of(), (16, 12), threads=threads, samples=1) as renderer:
            renderer.render()
        with pytest.raises(rz.SceneError, match="closed"):
            renderer.render()


def test_textures_and_the_ground_are_prepared_once_whatever_the_lights_and_not_for_buffers(monkeypatch):
    vertices, faces = octasphere(2)
    papered = rz.Mesh(vertices, faces, uv=vertices[:, :2], material=rz.Material(texture=np.eye(4)))
    sun, look = rz.DirectionalLight((-1, -2, -1), shadow=rz.Shadow()), {"ground": True, "outputs": ("color", "object")}
    expected = rz.render(papered, SIZE, lights=sun, **look)
    with rz.Renderer(papered, SIZE, **look) as first:
        first.render()
        monkeypatch.setattr(plan, "make_textures", None)
        monkeypatch.setattr(ground_shadow, "GroundShadow", None)
        with first.in_lights(sun) as other:
            frame = other.render()
    for name in ("rgba", "color", "object"):
        assert not differences(getattr(frame, name), getattr(expected, name)), name
    assert frame.pick(SIZE[0] // 2, SIZE[1] // 2) is not None


# ---------------------------------------------------------------- into arrays that are given

LAMPS = (*COLORED, rz.PointLight((1, 1, 2), 2.0))  # too bright, so that the range is left
RING = rz.Scene([rz.Mesh(*torus(12, 8))], LAMPS, rz.Camera.perspective((1.5, 2, 4), fov=40))


def test_a_picture_is_drawn_into_the_array_that_is_given():
    for outputs, color_range in (
        ("rgb", "clamp"),
        ("rgb", "global"),
        (("color", "depth"), "clamp"),
        ("color", "global"),
    ):
        out = np.full((SIZE[1], SIZE[0], 4), 77, np.uint8)
        options = {"outputs": outputs, "color_range": color_range, "samples": 1}
        frame, expected = rz.render(RING, SIZE, out=out, **options), rz.render(RING, SIZE, **options).rgba
        assert np.shares_memory(frame.rgba, out) and np.array_equal(out, expected), options
        with rz.Renderer(RING, SIZE, **options) as renderer:
            for _ in range(2):
                assert np.array_equal(renderer.render(out=out).rgba, expected), options


ROOM = np.zeros((SIZE[1], SIZE[0], 4), np.uint8)
READ_ONLY = ROOM.copy()
READ_ONLY.flags.writeable = False


def test_arrays_that_do_not_fit():
    aside = np.zeros(ROOM.size + 1, np.uint8)[1:].reshape(ROOM.shape)
    for out in (ROOM[:-1], ROOM[..., :3], ROOM.astype(np.float32), ROOM[::-1], ROOM.tolist(), READ_ONLY, aside):
        with pytest.raises(rz.SceneError, match=r"out must be a writable array \(29, 37, 4\) of uint8"):
            rz.render(RING, SIZE, out=out, samples=1)


def test_an_array_takes_a_picture_only():
    with pytest.raises(rz.SceneError, match="out takes a picture"):
        rz.render(RING, SIZE, outputs="depth", out=ROOM)


# ---------------------------------------------------------------- memory stays flat

PICTURES = 60  # bench/scale.py --many 10000 measures the same over a night's work


@pytest.mark.nightly  # many pictures, so that a leak stands out from noise
def test_pictures_of_all_kinds_leave_nothing_behind():
    """5 MB over 10 000 pictures are 500 bytes a picture; what leaks at all leaks an array of some kilobytes.

    Python's and numpy's own allocations are counted, which doesn't depend on what the system gives back.
    """
    list(scale.draw_many(16, 1))  # what is kept once: kernels, tables, imports
    gc.collect()
    tracemalloc.start()
    try:
        list(scale.draw_many(8, 1))
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        list(scale.draw_many(PICTURES, 1))
        gc.collect()
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 500 * PICTURES, f"{grown} bytes more after {PICTURES} pictures > {500 * PICTURES}"


def test_one_renderer_holds_no_more_after_many_pictures():
    """What leaks at all leaks an array of some kilobytes in every round; what is made once, by chance, in one of them.

    Python's and numpy's own allocations are counted.
    """
    mesh = rz.load(ROOT / "models" / "cube.obj").meshes[0]
    cameras = rz.Camera.orbit(mesh, 10, size=(48, 32))
    with rz.Renderer(mesh, (48, 32), outputs=("rgb", "depth"), threads=2) as renderer:
        held = []
        for _ in range(6):
            for camera in cameras:
                renderer.render(camera)
            if not held:
                tracemalloc.start()
            gc.collect()
            held.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
    grown = min(after - before for before, after in itertools.pairwise(held[1:]))
    assert grown < 500 * 10, f"at least {grown} bytes more after each 10 pictures > 5000"


# ---------------------------------------------------------------- buffers of surfaces


def two_palettes() -> rz.Scene:
    """Two meshes, faces of several materials, one of which both meshes have."""
    gold, red = rz.Material.named("gold"), rz.Material(diffuse="red")
    box = cube()
    mixed = replace(box, face_material=np.arange(box.n_face) % 2, materials=(gold, red))
    ball = rz.Mesh(*octasphere(2), material=red).transformed(np.diag((0.8, 0.8, 0.8, 1.0)) + 1.5 * np.eye(4, k=3))
    return small_scene(mixed, ball, floor(diffuse="navy"))


def test_materials_are_numbered_as_the_scene_lists_them():
    scene = two_palettes()
    frame = rz.render(scene, (60, 44), outputs=("material", "object"))
    assert [material.name for material in scene.materials][:1] == ["gold"] and len(scene.materials) == 3
    assert set(np.unique(frame.material[frame.object == 1])) == {1}  # red is that of the first mesh, too
    assert set(np.unique(frame.material[frame.object == 0])) == {0, 1}
    assert set(np.unique(frame.material[frame.object == 2])) == {2}


def test_an_empty_view_has_empty_buffers():
    scene = replace(drawn()["a file"][0], camera=rz.Camera.perspective((0, 0, 9), (0, 0, 20)))
    frame = rz.render(scene, 8, outputs=BUFFERS)
    assert not differences(frame.mask, 0) and not differences(frame.object, -1) and not differences(frame.material, -1)
    for name in ("uv", "barycentric", "position", "position_camera"):
        assert np.isnan(frame.array(name)).all(), name
    assert not differences(frame.normal_camera, 0) and not differences(np.signbit(frame.normal_camera), 0)


def test_culled_faces_are_in_no_buffer():
    scene = small_scene(floor(), camera=rz.Camera.perspective((0, -5, 0.1), (0, 0, 0)))
    assert rz.render(scene, 8, outputs="mask").mask.any()
    assert not differences(rz.render(scene, 8, outputs="mask", cull="back").mask, 0)
