"""Small scenes that show between them every stage of the pipeline, and a program that draws one of them.

    python -m helpers.small_scenes NAME...

draws the scenes, (32, 24) pixels each, and writes one `.npz` to stdout: "NAME/shading/buffer" arrays, and
"NAME/shading/fault" where drawing raised something. It is run with NUMBA_DISABLE_JIT=1.
"""

import io
import sys
import traceback
from dataclasses import replace
from pathlib import Path

import numpy as np

import rasterizer as rz

MODELS = Path(__file__).resolve().parents[2] / "models"
SIZE = (32, 24)
BUFFERS = ("color", "rgb", "alpha", "depth", "face", "normal")
SHADINGS = ("flat", "gouraud", "phong")
SUN = rz.DirectionalLight((-0.4, -0.7, -0.6), (0.7, 0.6, 0.5))
DAYLIGHT = (rz.AmbientLight(0.1), SUN)
LAMP = rz.PointLight((2.0, 2.5, 2.0), (0.6, 0.7, 0.9), (1.0, 0.1, 0.05), range=9.0)
SPOT = rz.SpotLight((0.5, 3.0, 2.0), (-0.2, -0.9, -0.6), 0.9, inner=15, outer=35, exponent=2.0)


def cube(**material) -> rz.Mesh:
    """A cube of 12 triangles about the origin, texture coordinates on every face."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    vertices = corners[np.ravel(quads)]
    faces = [(4 * k, 4 * k + i, 4 * k + i + 1) for k in range(6) for i in (1, 2)]
    uv = np.tile([(0.0, 0.0), (1.7, 0.0), (1.7, 1.3), (0.0, 1.3)], (6, 1))
    return rz.Mesh(vertices, faces, uv=uv, material=rz.Material(**material))


def floor(**material) -> rz.Mesh:
    """A square below the cube, which reaches behind the cameras: it is clipped."""
    vertices = np.array([(-40.0, -1.2, -40.0), (40, -1.2, -40), (40, -1.2, 40), (-40, -1.2, 40)])
    uv = 0.5 * vertices[:, [0, 2]]
    return rz.Mesh(vertices, [(0, 2, 1), (0, 3, 2)], uv=uv, material=rz.Material(**material))


def checks() -> np.ndarray:
    """A picture of 8 by 8 texels, one of them clear."""
    image = np.random.default_rng(5).uniform(0.1, 1.0, (8, 8, 4))
    image[..., 3] = 1.0
    return image


def scene_of(*meshes, lights=DAYLIGHT, **options) -> rz.Scene:
    """Meshes seen from above, from the front and the right."""
    options.setdefault("camera", rz.Camera.perspective((2.5, 2.0, 3.5), (0.0, -0.2, 0.0), fov=50))
    return rz.Scene(list(meshes), lights=lights, **options)


def drawn() -> dict:
    """Name -> (scene, options of the picture)."""
    many = [rz.AmbientLight(0.1), SUN, LAMP, SPOT, replace(SPOT, falloff=2.0)]
    area = rz.AreaLight((-1, 3, -1), (2, 0, 0), (0, 0, 2), 0.8, resolution=(2, 2))
    shadows = [replace(SUN, shadow=rz.Shadow(size=32)), replace(SPOT, shadow=rz.Shadow(size=32, filter=3))]
    around = [rz.AmbientLight(0.2), rz.PointLight((0.0, 1.6, 0.0), 0.9, shadow=rz.Shadow(size=16))]
    colors = np.random.default_rng(2).uniform(0, 1, (24, 3))
    bumps = np.random.default_rng(3).uniform(-1, 1, (40, 3, 3))
    soup = rz.Mesh(bumps.reshape(-1, 3), np.arange(120).reshape(-1, 3), material=rz.Material(diffuse="#cc8844"))
    leaf = rz.Mesh([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (0, -0.3, 0), (-1, 1, 0)], [(0, 1, 2, 3, 4)])
    glass = cube(opacity=0.4, diffuse=(0.9, 0.3, 0.2))
    far = rz.Camera.orthographic((2.5, 2.0, 3.5), (0.0, -0.2, 0.0), height=4.0)
    inside = rz.Camera.perspective((0.3, 0.1, 0.9), (0.0, -0.2, 0.0), fov=90, near=0.05)
    scenes = {
        "a file": (rz.load(MODELS / "cube.obj"), {}),
        "grey, one channel": (scene_of(cube(diffuse=0.7)), {}),
        "grey, as exact as float64": (scene_of(cube(diffuse=0.7)), {"tolerance": 0}),
        "many lights": (scene_of(cube(), floor(), lights=many), {}),
        "many lights, as exact as float64": (scene_of(cube(), floor(), lights=many), {"tolerance": 0}),
        "an area light": (scene_of(cube(), lights=[area]), {}),
        "orthographic": (scene_of(cube(), floor(), lights=many, camera=far), {}),
        "clipped all round": (scene_of(cube(), lights=many, camera=inside), {}),
        "colours of vertices": (scene_of(replace(cube(), colors=colors), lights=many), {}),
        "small triangles": (scene_of(soup, lights=many), {}),
        "a polygon with ears": (scene_of(leaf), {}),
        "four samples": (scene_of(cube(), floor(diffuse="navy")), {"samples": 4}),
        "a background, and the local range": (scene_of(cube(), background="teal"), {"color_range": "local"}),
        "exposed, in the global range": (scene_of(cube()), {"exposure": 1.5, "color_range": "global"}),
        "back faces left out": (scene_of(cube()), {"cull": "back"}),
        "depth cueing": (scene_of(cube(), floor(), depth_cue=12.0), {}),
        "transparent": (scene_of(glass, floor(), lights=many), {}),
        "transparent and textured": (scene_of(replace(glass, material=rz.Material(texture=checks(), opacity=0.5))), {}),
        "shadows": (scene_of(cube(), floor(), lights=shadows), {}),
        "shadows of a cube map": (scene_of(cube(), floor(), lights=around), {}),
        "a spectrum": (scene_of(cube(diffuse=(0.8, 0.4, 0.1)), lights=[SUN, LAMP]), {"spectral": 9}),
    }
    for filtering, wrap in (("nearest", "repeat"), ("bilinear", "mirror"), ("trilinear", "clamp")):
        look = rz.Texture(checks(), filter=filtering, wrap=wrap)
        scenes[f"texture, {filtering}"] = (scene_of(cube(texture=look), floor(texture=look)), {})
    for model in ("phong", "blinn", "lambert", "oren-nayar", "cook-torrance", "toon"):
        scenes[f"reflection, {model}"] = (scene_of(cube(reflection=model, specular=0.5), lights=many), {})
        tinted = cube(reflection=model, specular=0.5, fresnel=(0.9, 0.5, 0.1), roughness=0.4)
        scenes[f"reflection, {model}, with W"] = (scene_of(tinted, lights=many), {})
    beckmann = cube(reflection="cook-torrance", specular=0.5, distribution="beckmann", roughness=0.3)
    scenes["reflection, beckmann"] = (scene_of(beckmann, lights=many), {})
    for tangent in ("u", (0.0, 1.0, 0.0)):
        brushed = cube(reflection="cook-torrance", specular=0.6, roughness=(0.1, 0.5), tangent=tangent)
        scenes[f"brushed along {tangent}"] = (scene_of(brushed, lights=[*many, *shadows]), {})
    return scenes


def draw(name, shading) -> dict[str, np.ndarray]:
    """The buffers of one picture."""
    scene, options = drawn()[name]
    frame = rz.render(
        scene,
        SIZE,
        shading=shading,
        outputs=("color", "depth", "face", "normal"),
        threads=1,
        **{"samples": 1} | options,
    )
    return {buffer: getattr(frame, buffer) for buffer in BUFFERS}


def main(names) -> None:
    """Draw scenes in every shading and write them to stdout."""
    arrays = {}
    for name in names:
        for shading in SHADINGS:
            try:
                for buffer, values in draw(name, shading).items():
                    arrays[f"{name}/{shading}/{buffer}"] = values
            except Exception:
                arrays[f"{name}/{shading}/fault"] = np.array(traceback.format_exc())
    packed = io.BytesIO()
    np.savez(packed, **arrays)
    sys.stdout.buffer.write(packed.getvalue())


# ── scenes in which materials need different things ────────────────────────────────────────────────────────


BRUSHED = {"reflection": "cook-torrance", "specular": 0.6, "roughness": (0.1, 0.5)}


def mixed() -> dict[str, rz.Scene]:
    """Name -> scene of a plain floor, computed in float32, and of what is not."""
    texels = checks()
    papered, plain = cube(texture=texels), floor(diffuse=0.7)
    glass, toon = cube(opacity=0.5), cube(reflection="toon")
    brushed, along_axis = cube(**BRUSHED), cube(**BRUSHED, tangent=(0.0, 1.0, 0.0))
    both = rz.Mesh(
        papered.vertices,
        papered.faces,
        uv=papered.uv,
        materials=[rz.Material(diffuse=0.1 * k) for k in range(8)] + [rz.Material(texture=texels)],
        face_material=[8 if k == 7 else k % 8 for k in range(12)],
    )
    speck = rz.Mesh(papered.vertices * 1e-3 + 0.9, papered.faces, uv=papered.uv, material=papered.material)
    lights = [rz.AmbientLight(0.1), LAMP]
    return {
        "textured": scene_of(plain, papered),
        "a textured speck": scene_of(plain, speck),
        "textured, the last of many materials": scene_of(plain, both),
        "textured, and glass": scene_of(plain, papered, glass),
        "textured glass": scene_of(plain, cube(texture=texels, opacity=0.5)),
        "glass": scene_of(plain, glass),
        "glass alone": scene_of(glass),
        "nothing but what is not there": scene_of(cube(opacity=0.0)),
        "what is not there": scene_of(plain, cube(opacity=0.0)),
        "coloured": scene_of(plain, cube(diffuse=(0.1, 0.9, 0.2))),
        "colours of vertices": scene_of(plain, rz.Mesh(glass.vertices, glass.faces, colors=abs(glass.vertices))),
        "toon": scene_of(plain, toon),
        "toon, in the light of a lamp": scene_of(plain, toon, lights=lights),
        "toon and transparent": scene_of(plain, cube(reflection="toon", opacity=0.3)),
        "very shiny": scene_of(plain, cube(shininess=50000.0)),
        "brushed": scene_of(plain, brushed),
        "brushed along an axis": scene_of(plain, along_axis),
        "brushed, and textured": scene_of(plain, brushed, papered),
        "an F0 of a colour": scene_of(plain, papered, cube(fresnel=(0.9, 0.5, 0.1), specular=0.5)),
        "without perspective": scene_of(plain, papered, camera=rz.Camera.orthographic((2.5, 2.0, 3.5), height=4.0)),
        "three models": scene_of(plain, papered, cube(reflection="blinn"), cube(reflection="oren-nayar")),
    }


if __name__ == "__main__":
    main(sys.argv[1:] or list(drawn()))
