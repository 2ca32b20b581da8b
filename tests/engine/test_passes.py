"""Check that any set of outputs can be drawn together: the bytes of each are its own."""

from itertools import combinations

from helpers.small_scenes import SHADINGS, cube, floor, mixed, scene_of

import rasterizer as rz

SIZE = (45, 34)
BUFFERS = ("depth", "face", "normal")
OUTPUTS = ("rgb", "color", *BUFFERS)
SUBSETS = [names for n in range(2, 6) for names in combinations(OUTPUTS, n)]
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


def test_buffers_are_of_one_sample_beside_a_picture_of_four():
    scene = scene_of(cube(), floor())
    frame, alone = draw((scene, {"samples": 4}), "phong", OUTPUTS), draw((scene, {}), "phong", BUFFERS)
    for name in BUFFERS:
        assert frame.array(name).tobytes() == alone.array(name).tobytes(), name
