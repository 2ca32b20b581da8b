"""What a user's program writes, for the type checker: `mypy` reads it with the package (see pyproject.toml), and a test
runs it."""

from pathlib import Path

import numpy as np

import rasterizer as rz

SIZE = (32, 24)


def make_scene() -> rz.Scene:
    """Every class of a scene, given what its documentation says that it takes."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    paper = rz.Material(diffuse="white", specular=(0.1, 0.1, 0.1), texture=np.eye(4), fresnel=0.04)
    brass = rz.Material.named("brass", shininess=60.0, roughness=[0.2, 0.4], reflection="cook-torrance", tangent="u")
    lamp = rz.Material(emissive=rz.Spectrum.blackbody(2856), opacity=1)
    square = rz.Mesh(vertices, [[0, 1, 2, 3]], uv=vertices[:, :2], material=paper)
    halves = rz.Mesh(
        vertices + (0, 0, -1),
        [[0, 1, 2], [0, 2, 3]],
        uv=vertices[:, :2],
        materials=[brass, lamp],
        face_material=[0, 1],
        weighting="area",
    )
    lights = [
        rz.AmbientLight(0.1),
        rz.DirectionalLight([0, -1, -1], "#ffddaa", shadow=True),
        rz.PointLight((1, 2, 3), (1, 0.9, 0.8), attenuation="1/d^2", attached="camera"),
        rz.SpotLight(np.array([0, 0, 5]), (0, 0, -1), outer=20, shadow=rz.Shadow(64, filter=3)),
        rz.AreaLight((0, 2, 0), (1, 0, 0), (0, 0, 1), resolution=(2, 2)),
    ]
    return rz.Scene([square, halves.subdivide()], lights, background="#202020", depth_cue=rz.DepthCue(5, color=0.2))


def draw_pictures(folder: Path) -> list[Path]:
    """Every function, as the examples of the documentation call them."""
    scene = make_scene()
    frame = rz.render(scene, SIZE, shading="phong", outputs=["color", "face"], samples=1, threads=1)
    pair = rz.render((scene.meshes[0].vertices, scene.meshes[0].faces), 16, cull="back", exposure=0.5, samples=1)
    options = rz.Options(size=SIZE, samples=1, edges="wire", edge_color="red")
    dressed = rz.render(scene, options=options, view=(30, 10), material={"shininess": 8}, color="teal", shadows=True)
    assert dressed.size == SIZE
    camera = rz.Camera.framing(scene, azimuth=30, aspect=SIZE[0] / SIZE[1], up="z")
    with rz.Renderer(scene, SIZE, shading="gouraud", outputs="color", color_range="global", samples=1) as renderer:
        turned = renderer.render(camera, out=np.empty((*SIZE[::-1], 4), np.uint8))
    covered: int = turned.stats.covered
    assert covered > 0
    assert turned.color.shape == (*SIZE[::-1], 3)
    assert rz.compare(frame, turned.color).rms > 0.0
    assert rz.mach_bands(frame, scene).n_place >= 0
    rz.sheet([frame, turned, pair.rgba], columns=2, background="white", labels=["a", "b", "c"]).save(
        folder / "sheet.png"
    )
    names = [rz.save(scene, folder / "scene.json"), frame.save(folder / "face.npy", array="face")]
    loaded = rz.load(names[0])
    return [*names, rz.render(loaded, SIZE, threads=1, samples=1).save(str(folder / "picture.png"), compress_level=1)]
