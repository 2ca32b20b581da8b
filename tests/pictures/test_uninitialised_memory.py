"""Pictures depend neither on memory that nobody has filled, nor on what was drawn in it before.

Every picture is drawn as usual first, which also compiles what it needs; then with memory full of several bytes, and
by a Renderer that has drawn others before.
"""

import os
from dataclasses import replace

import numpy as np
import pytest
from helpers.campaign_scenes import make_case
from helpers.dirty_memory import FILLINGS, dirty_memory
from helpers.pinhole import octasphere
from helpers.raster import COLORED
from helpers.small_scenes import SHADINGS, cube, drawn, floor, mixed, scene_of

import rasterizer as rz
from rasterizer.engine.ground_shadow import GroundShadow

SEED = 23
N_CASE, MANY = 18, 20  # scenes by default, and lights; more are the night's
SIZE = (45, 38)
BUFFERS = (
    "depth", "face", "normal", "mask", "object", "material", "uv", "barycentric", "position", "position_camera",
    "normal_camera",
)  # fmt: skip
LOOKS = {
    "plain": {"samples": 1},
    "four samples": {"samples": 4, "outputs": ("color",)},
    "bytes": {"samples": 4, "outputs": "rgb", "color_range": "global"},
    "buffers": {"samples": 1, "outputs": ("color", "rgb", *BUFFERS)},
    "buffers alone": {"outputs": BUFFERS},
    "edges": {"samples": 4, "outputs": ("color",), "edges": "all"},
    "culled": {"samples": 1, "outputs": ("color", "depth"), "cull": "back"},
}


def content_of(frame) -> dict[str, bytes]:
    """The bytes of everything that a frame holds."""
    content = {name: frame.array(name).tobytes() for name in ("color", *BUFFERS) if frame.has(name)}
    return content | ({"rgba": frame.rgba.tobytes()} if frame.has("rgb") else {})


def find_difference(expected: dict, found: dict, words: str) -> list[str]:
    """Say which arrays of two frames differ, and in how many bytes."""
    assert expected.keys() == found.keys()
    different = [name for name, content in expected.items() if content != found[name]]
    counts = [np.sum(np.frombuffer(expected[k], "u1") != np.frombuffer(found[k], "u1")) for k in different]
    return [f"{words}: {dict(zip(different, counts, strict=True))} bytes differ"] if different else []


def find_faults(scene, cameras, size, options, fillings=FILLINGS) -> list[str]:
    """Draw a scene through cameras as usual, each by a Renderer of its own, and in dirty memory, one after the other by
    one Renderer; say what differs."""
    expected, faults = [], []
    for camera in cameras:
        with rz.Renderer(scene, size, threads=1, **options) as renderer:
            expected.append(content_of(renderer.render(camera)))
    for filling in fillings:
        with dirty_memory(filling), rz.Renderer(scene, size, threads=2, **options) as renderer:
            for k in (*range(len(cameras)), 0):
                words = f"camera {k}, memory full of {filling}"
                faults += find_difference(expected[k], content_of(renderer.render(cameras[k])), words)
    return faults


def with_shadows(light, rng):
    """The light with a shadow map of a random kind, if it can have one; some lights move with the camera."""
    if not hasattr(light, "shadow") or rng.random() < 0.2:
        return light
    shadow = rz.Shadow(int(rng.choice([16, 23, 64])), int(rng.choice([1, 1, 3, 5])))
    return replace(light, shadow=shadow, attached="camera" if rng.random() < 0.3 else light.attached)


def other_view(camera, rng):
    """A camera somewhere else that looks at the same place."""
    eye, target = np.array(camera.position), np.array(camera.target)
    turned = np.linalg.norm(eye - target) * rng.normal(size=3)
    return replace(camera, position=target + turned / np.sqrt(3), up=rng.normal(size=3))


def check_random_scenes(indices):
    """The campaign's scenes, half of them with shadows, with outputs of all kinds."""
    faults = []
    for index in indices:
        case, rng = make_case(SEED, index), np.random.default_rng([SEED, index])
        scene = case.scene
        if len(scene.lights) > MANY and index < N_CASE:
            continue
        if index % 2:
            scene = replace(scene, lights=tuple(with_shadows(light, rng) for light in scene.lights))
        outputs = BUFFERS if index % 3 == 0 and case.options["samples"] == 1 else ()
        options = case.options | {"outputs": ("color", "rgb", *(rng.choice(outputs, 3, False) if outputs else ()))}
        if index % 5 == 0:
            options["edges"] = str(rng.choice(["wire", "crease", "silhouette", "all"]))
        cameras = [scene.camera, other_view(scene.camera, rng)]
        try:
            found = find_faults(scene, cameras, case.size, options, FILLINGS[index % 3 :: 3])
        except rz.SceneError as fault:  # of a depth buffer or a map that can't hold the scene
            faults += [] if "legal" in str(fault) or "depth" in str(fault) else [f"{case.words}: {fault}"]
            continue
        faults += [f"scene {index}, {case.words}: {fault}" for fault in found]
    assert not faults, "\n".join([f"{len(faults)} differences: {faults[0]}", *faults[1:10]])


def test_random_scenes():
    check_random_scenes(range(N_CASE))


@pytest.mark.nightly
def test_many_random_scenes():
    check_random_scenes(range(N_CASE, int(os.environ.get("RASTERIZER_FUZZ_CASES", 150))))


def check_small_scenes(shading, look, scenes, n=6):
    """Draw scenes in one shading and with one set of options, in memory full of every n-th filling."""
    faults = []
    for number, (name, (scene, options)) in enumerate(scenes.items()):
        own = {"shading": shading, **options, **LOOKS[look]}
        cameras = [scene.camera or scene.camera_for(SIZE), rz.Camera.perspective((-2.5, -1.6, 3.0), fov=60)]
        found = find_faults(scene, cameras, SIZE, own, FILLINGS[number % n :: n])
        faults += [f"{name}: {fault}" for fault in found]
    assert not faults, "\n".join([f"{look}, {shading}: {len(faults)} differences: {faults[0]}", *faults[1:10]])


def all_scenes():
    return drawn() | {name: (scene, {}) for name, scene in mixed().items()}


@pytest.mark.parametrize("look", [look for look in LOOKS if look != "culled"])
def test_some_small_scenes(look):
    number = list(LOOKS).index(look)
    scenes = dict(list(all_scenes().items())[number :: len(LOOKS)])
    check_small_scenes(SHADINGS[number % 3 - 1], look, scenes)


@pytest.mark.nightly
@pytest.mark.parametrize("look", LOOKS)
def test_every_small_scene(look):
    for shading in SHADINGS:
        check_small_scenes(shading, look, all_scenes(), 3)


LAMPS = {
    "a lamp whose first map shows nothing": [rz.PointLight((1.4, 0.3, 0.2), 0.9, shadow=rz.Shadow(24, 3))],
    "a lamp below": [rz.PointLight((0.1, -9.0, 0.2), 0.9, shadow=rz.Shadow(24))],
    "a wide spot": [rz.SpotLight((0, 1.9, 0), (0.2, -1, 0), 0.9, outer=89, shadow=rz.Shadow(16, 5))],
    "carried lamps": [
        rz.PointLight((0.2, 0.1, -1.4), 0.7, attached="camera", shadow=rz.Shadow(16, 3)),
        rz.SpotLight((0.0, 0.5, 0.0), (0, 0, -1), 0.5, attached="camera", shadow=rz.Shadow(20)),
        rz.DirectionalLight((0.5, -1, -1), 0.5, "camera", shadow=rz.Shadow(18)),
    ],
    "an area light": [rz.AreaLight((-1, 3, -1), (2, 0, 0), (0, 0, 2), 0.8, resolution=(2, 2), shadow=rz.Shadow(16))],
}


def leaf():
    """A small bent mesh, its normals averaged, that no lamp stands behind."""
    vertices = np.array([(0.9, -1.2, 1.4), (0.9, 0.1, 1.9), (-0.9, 0.1, 1.7), (-0.9, -1.2, 1.4), (0.0, -0.5, 2.1)])
    return rz.Mesh(vertices, [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)], crease_angle=180)


@pytest.mark.parametrize("lamps, shading, tolerance", [
    (lamps, ("phong", "gouraud")[k % 2], 0.0 if k == 3 else 2.0**-12) for k, lamps in enumerate(LAMPS)
])  # fmt: skip
def test_shadow_maps(lamps, shading, tolerance):
    """Maps of cubes, with faces that show nothing; maps that are drawn anew for every picture, in the same memory."""
    vertices, faces = octasphere(2)
    ball = rz.Mesh(vertices * 0.5 + (0.2, 1.5, 0.3), faces, material=rz.Material(specular=0.4))
    below = floor() if lamps != "a lamp whose first map shows nothing" else leaf()
    scene = scene_of(cube(), below, ball, lights=[rz.AmbientLight(0.1), *LAMPS[lamps]])
    cameras = [scene.camera, rz.Camera.perspective((-2.0, 1.6, 3.0), fov=60), rz.Camera.perspective((-3, 4, -4))]
    options = {"shading": shading, "tolerance": tolerance, "samples": 1}
    faults = find_faults(scene, cameras, SIZE, options, FILLINGS[1::2])
    assert not faults, "\n".join(faults)


def test_what_is_made_before_the_first_picture():
    """Many fine meshes: splits at creases, averaged normals, subdivided faces, ears, ground."""
    vertices, faces = octasphere(4)
    bumpy = vertices * (1.0 + 0.05 * np.sin(40 * vertices[:, :1]))
    leaf = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (0, -0.3, 0), (-1, 1, 0)]
    image = np.random.default_rng(1).random((19, 13, 4))

    def draw() -> dict:
        """All that is made."""
        meshes = [
            rz.Mesh(bumpy, faces, crease_angle=12.0, weighting="area"),
            rz.Mesh(np.array(leaf) + (0, 0, 1.5), [(0, 1, 2, 3, 4)], uv=np.array(leaf)[:, :2],
                    material=rz.Material(texture=rz.Texture(image), opacity=0.7)),
        ]  # fmt: skip
        scene = rz.Scene(meshes, COLORED)
        found = {}
        for shading in SHADINGS[1:]:
            for k, camera in enumerate((scene.camera_for(SIZE), rz.Camera.perspective((0.5, 0.2, 1.4), fov=70))):
                with rz.Renderer(scene, SIZE, shading=shading, cull="back", edges="crease", threads=2) as renderer:
                    content = content_of(renderer.render(camera))
                found |= {f"{shading} {k} {name}": value for name, value in content.items()}
        found["ground"] = GroundShadow(scene, size=40, points=5).opacity.tobytes()
        fine = meshes[0].subdivide()
        found["subdivided"] = fine.vertices.tobytes() + fine.faces.tobytes()
        return found

    expected, faults = draw(), []
    for filling in FILLINGS[1::2]:
        with dirty_memory(filling):
            faults += find_difference(expected, draw(), f"memory full of {filling}")
    assert not faults, "\n".join(faults)
