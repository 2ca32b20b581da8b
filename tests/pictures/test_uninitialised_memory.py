"""Pictures depend neither on memory that nobody has filled, nor on what was drawn in it before.

Every picture is drawn as usual first, which also compiles what it needs; then with memory full of several bytes: the
arrays that are made (`np.empty`), and those that a Renderer keeps for its next picture.
"""

import os
from dataclasses import replace

import numpy as np
import pytest
from helpers.campaign_scenes import make_case
from helpers.dirty_memory import FILLINGS, dirty, dirty_kept, dirty_memory
from helpers.mixed_scenes import mixed
from helpers.pinhole import octasphere
from helpers.raster import COLORED
from helpers.small_scenes import SHADINGS, cube, drawn, floor, scene_of

import rasterizer as rz
from rasterizer.batch.strip_renderer import StripRenderer
from rasterizer.ground_shadow import GroundShadow

SEED = 23
N_CASE = int(os.environ.get("RASTERIZER_FUZZ_CASES", 150))
SIZE = (45, 38)
BUFFERS = (
    "depth", "face", "normal", "mask", "object", "material", "uv", "barycentric", "position", "position_camera",
    "normal_camera",
)  # fmt: skip
LOOKS = {
    "plain": {"samples": 1},
    "four samples": {"samples": 4, "outputs": ("color",)},
    "shaded once": {"samples": 9, "antialias": "shade-once", "outputs": ("color",)},
    "bytes": {"samples": 4, "outputs": "rgb", "color_range": "global"},
    "buffers": {"samples": 1, "outputs": ("color", "rgb", *BUFFERS)},
    "buffers alone": {"outputs": BUFFERS},
    "edges": {"samples": 4, "outputs": ("color",), "edges": "all"},
    "culled": {"samples": 1, "outputs": ("color", "depth"), "cull": "back"},
}


def content_of(frame) -> dict[str, bytes]:
    """The bytes of everything that a frame holds."""
    content = {name: array.tobytes() for name, array in frame._arrays.items()}
    return content | ({} if frame._rgba is None else {"rgba": frame._rgba.tobytes()})


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
                dirty_kept(renderer, filling)
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


@pytest.mark.parametrize("part", range(10))
def test_random_scenes(part):
    """The campaign's scenes, half of them with shadows, with outputs of all kinds."""
    faults = []
    for index in range(part * N_CASE // 10, (part + 1) * N_CASE // 10):
        case, rng = make_case(SEED, index), np.random.default_rng([SEED, index])
        scene = case.scene
        if index % 2:
            scene = replace(scene, lights=tuple(with_shadows(light, rng) for light in scene.lights))
        outputs = BUFFERS if index % 3 == 0 and case.options["samples"] == 1 else ()
        options = case.options | {"outputs": ("color", "rgb", *(rng.choice(outputs, 3, False) if outputs else ()))}
        if index % 5 == 0:
            options["edges"] = str(rng.choice(["wire", "crease", "silhouette", "all"]))
        cameras = [scene.camera, other_view(scene.camera, rng)]
        try:
            found = find_faults(scene, cameras, case.size, options, FILLINGS[index % 2 :: 2])
        except rz.SceneError as fault:  # of a depth buffer or a map that can't hold the scene
            faults += [] if "legal" in str(fault) or "depth" in str(fault) else [f"{case.words}: {fault}"]
            continue
        faults += [f"scene {index}, {case.words}: {fault}" for fault in found]
    assert not faults, "\n".join([f"{len(faults)} differences", *faults[:10]])


@pytest.mark.slow  # seconds each
@pytest.mark.parametrize("look", LOOKS)
@pytest.mark.parametrize("shading", SHADINGS)
def test_every_small_scene(shading, look):
    faults = []
    for number, (name, (scene, options)) in enumerate((drawn() | {k: (s, {}) for k, s in mixed().items()}).items()):
        own = {"shading": shading, **options, **LOOKS[look]}
        cameras = [scene.camera, rz.Camera.perspective((-2.5, -1.6, 3.0), fov=60)]
        if scene.camera is None:
            cameras[0] = scene.camera_for(SIZE)
        found = find_faults(scene, cameras, SIZE, own, FILLINGS[number % 3 :: 3])
        faults += [f"{name}: {fault}" for fault in found]
    assert not faults, "\n".join([f"{len(faults)} differences", *faults[:10]])


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


@pytest.mark.parametrize("lamps", LAMPS)
@pytest.mark.parametrize(
    "shading, tolerance", [("phong", 0.0), ("phong", 2.0**-12), ("gouraud", 2.0**-12), ("flat", 0)]
)
def test_shadow_maps(lamps, shading, tolerance):
    """Maps of cubes, with faces that show nothing; maps that are drawn anew for every picture, in the same memory."""
    vertices, faces = octasphere(2)
    ball = rz.Mesh(vertices * 0.5 + (0.2, 1.5, 0.3), faces, material=rz.Material(specular=0.4))
    below = floor() if lamps != "a lamp whose first map shows nothing" else leaf()
    scene = scene_of(cube(), below, ball, lights=[rz.AmbientLight(0.1), *LAMPS[lamps]])
    cameras = [scene.camera, rz.Camera.perspective((-2.0, 1.6, 3.0), fov=60), rz.Camera.perspective((-3, 4, -4))]
    faults = find_faults(scene, cameras, SIZE, {"shading": shading, "tolerance": tolerance, "samples": 1})
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("look", ["plain", "shaded once", "buffers", "bytes"])
def test_strips_and_rows_and_given_arrays(look, tmp_path):
    """Strips of a picture, files that are written row by row, and pictures in an array of the caller's."""
    faults, options = [], LOOKS[look]
    for name, (scene, own) in drawn().items():
        options, camera = {"shading": "phong", **own, **LOOKS[look]}, scene.camera or scene.camera_for(SIZE)
        contents = []
        for filling in (None, 0x00, 0xFF, 0x40):
            with dirty_memory(filling), StripRenderer(scene, SIZE, threads=2, **options) as renderer:
                content = {}
                for first, end in ((0, 13), (30, 38), (13, 30)):
                    dirty_kept(renderer, filling)
                    part = content_of(renderer.render_strip((first, end), camera, brightest=2.0))
                    content |= {f"{key} {first}": value for key, value in part.items()}
                out = dirty(np.zeros((*SIZE[::-1], 4), np.uint8), filling)
                content |= content_of(renderer.render(camera, out=out))
                renderer.render_to(tmp_path / "picture.tiff", camera)
                content["file"] = (tmp_path / "picture.tiff").read_bytes()
            contents.append(content)
        for other in contents[1:]:
            faults += find_difference(contents[0], other, name)
    assert not faults, "\n".join(faults)


def test_what_is_made_before_the_first_picture():
    """Many fine meshes: splits at creases, averaged normals, subdivided faces, clusters of triangles, ears, ground."""
    vertices, faces = octasphere(5)
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
        for shading in SHADINGS:
            for k, camera in enumerate((scene.camera_for(SIZE), rz.Camera.perspective((0.5, 0.2, 1.4), fov=70))):
                with rz.Renderer(scene, SIZE, shading=shading, cull="back", edges="crease", threads=2) as renderer:
                    content = content_of(renderer.render(camera))
                found |= {f"{shading} {k} {name}": value for name, value in content.items()}
        found["ground"] = GroundShadow(scene, size=40, points=5).opacity.tobytes()
        fine = meshes[0].subdivide()
        found["subdivided"] = fine.vertices.tobytes() + fine.faces.tobytes()
        return found

    expected, faults = draw(), []
    for filling in FILLINGS:
        with dirty_memory(filling):
            faults += find_difference(expected, draw(), f"memory full of {filling}")
    assert not faults, "\n".join(faults)
