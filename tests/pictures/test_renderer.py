"""Check a Renderer over many pictures: the same bytes as fresh ones, no memory, no side effects."""

import hashlib
import threading
from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pinhole import octasphere, torus
from helpers.processes import at_once
from helpers.raster import COLORED, GREY

import rasterizer as rz

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
