"""Small scenes in which materials need different things: float32 and float64, textures, what is behind them."""

import rasterizer as rz
from helpers.small_scenes import LAMP, checks, cube, floor, scene_of

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
