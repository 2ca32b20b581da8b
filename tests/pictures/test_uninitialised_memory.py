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
from helpers.small_scenes import SHADINGS

import rasterizer as rz
from rasterizer.engine.ground_shadow import GroundShadow

SEED = 23
N_CASE, MANY = 18, 20  # scenes by default, and lights; more are the night's
SIZE = (45, 38)
BUFFERS = (
    "depth", "face", "normal", "mask", "object", "material", "uv", "barycentric", "position", "position_camera",
    "normal_camera",
)  # fmt: skip


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
