"""Check that any set of outputs can be drawn together: the bytes of each are its own."""

from itertools import combinations, cycle

import numpy as np
from helpers.small_scenes import SHADINGS, cube, drawn, floor, mixed, scene_of

import rasterizer as rz

SIZE = (45, 34)
BUFFERS = ("depth", "face", "normal")
OUTPUTS = ("rgb", "color", *BUFFERS)
SUBSETS = [names for n in range(2, 6) for names in combinations(OUTPUTS, n)]
SCENES = {name: case for name, case in drawn().items() if case[1].get("samples", 1) == 1}
SCENES |= {f"{name} on a floor": (scene, {}) for name, scene in mixed().items()}
INSIDE = rz.Camera.perspective((0.3, 0.1, 0.9), (0.0, -0.2, 0.0), fov=90, near=0.05)
HARD = {  # more subsets of outputs of these
    "clipped": (scene_of(cube(diffuse=0.7), floor(), camera=INSIDE), {}),
    "clipped and coloured, back faces left out": (
        scene_of(cube(diffuse=(0.8, 0.4, 0.1)), floor(), camera=INSIDE),
        {"cull": "back"},
    ),
    "transparent": (scene_of(cube(opacity=0.4, diffuse=(0.9, 0.3, 0.2)), floor(), cube(opacity=0.0)), {}),
    "textured, and glass": (mixed()["textured, and glass"], {"color_range": "global"}),
}


def bytes_of(frame, name):
    """What an output holds; a picture's linear colours have their alpha with them."""
    if name == "color":
        return frame.color.tobytes() + frame.alpha.tobytes()
    return (frame.rgba if name == "rgb" else frame.array(name)).tobytes()


def draw(case, shading, names, threads=1):
    scene, options = case
    return rz.render(scene, SIZE, shading=shading, outputs=names, threads=threads, **{"samples": 1} | options)


def assert_same(case, name, shading, apart, subsets):
    """Compare each output of each set with what it is in the sets `apart`."""
    expected = {}
    for names in apart:
        frame = draw(case, shading, names)
        expected |= {output: bytes_of(frame, output) for output in names}
    for k, names in enumerate(subsets):
        frame = draw(case, shading, names, threads=(3, 1)[k % 2])
        for output in names:
            assert bytes_of(frame, output) == expected[output], f"{name}, {shading}: {output} of {names}"


def test_every_set_of_outputs_has_the_bytes_of_each():
    for k, (name, case) in enumerate(HARD.items()):
        for j, shading in enumerate(SHADINGS):
            assert_same(case, name, shading, [(output,) for output in OUTPUTS], SUBSETS[(k + j) % 5 :: 5])


def test_buffers_beside_a_picture_have_the_bytes_that_they_have_alone():
    for (name, case), shading in zip(SCENES.items(), cycle(SHADINGS)):
        assert_same(case, name, shading, [("rgb",), ("color",), BUFFERS], [OUTPUTS])


def test_buffers_of_random_triangles_do_not_depend_on_the_picture():
    """Of all sizes, thin and steep ones, through the near plane, in great and small ranges of depth."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        middles, sizes = rng.uniform(-1, 1, (300, 1, 3)), 10.0 ** rng.uniform(-2, 0.5, (300, 1, 3))
        corners = (middles + sizes * rng.normal(size=(300, 3, 3))).reshape(-1, 3) * (1, 1, (0.01, 1.0, 30.0)[seed % 3])
        normals = rng.normal(size=corners.shape)
        mesh = rz.Mesh(corners, np.arange(900).reshape(-1, 3), normals, material=rz.Material(diffuse=(0.6, 0.5, 0.4)))
        camera = rz.Camera.perspective((0, 0, 2.0), (0, 0, 0), fov=60, near=(None, 1e-3)[seed % 2])
        case = rz.Scene([mesh], [rz.DirectionalLight((0, -1, -1))], camera), {"cull": ("none", "back")[seed // 3]}
        shading = SHADINGS[(seed + seed // 3) % 3]
        assert_same(case, f"seed {seed}", shading, [("rgb",), ("color",), BUFFERS], [OUTPUTS, ("rgb", "depth")])


def test_buffers_are_of_one_sample_beside_a_picture_of_four():
    scene = scene_of(cube(), floor())
    frame, alone = draw((scene, {"samples": 4}), "phong", OUTPUTS), draw((scene, {}), "phong", BUFFERS)
    for name in BUFFERS:
        assert frame.array(name).tobytes() == alone.array(name).tobytes(), name
