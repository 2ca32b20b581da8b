"""Check that any set of outputs can be drawn together: the bytes of each are its own, whichever pass they come from."""

from itertools import combinations

import numpy as np
import pytest
from helpers.mixed_scenes import mixed
from helpers.small_scenes import SHADINGS, cube, drawn, floor, scene_of

import rasterizer as rz
from rasterizer.engine.passes import BufferPass

SIZE = (45, 34)
OUTPUTS = ("rgb", "color", "depth", "face", "normal")
SUBSETS = [names for n in range(2, 6) for names in combinations(OUTPUTS, n)]
SCENES = {name: case for name, case in drawn().items() if case[1].get("samples", 1) == 1}
SCENES |= {f"{name} on a floor": (scene, {}) for name, scene in mixed().items()}
INSIDE = rz.Camera.perspective((0.3, 0.1, 0.9), (0.0, -0.2, 0.0), fov=90, near=0.05)
HARD = {  # every subset of outputs of these
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


def assert_same(case, shading, subsets):
    """Compare each output of each set with what it is alone."""
    alone = {name: bytes_of(draw(case, shading, name), name) for name in OUTPUTS}
    for k, names in enumerate(subsets):
        frame = draw(case, shading, names, threads=(1, 3)[k % 2])
        for name in names:
            assert bytes_of(frame, name) == alone[name], f"{name} of {names}, {shading}"


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("name", HARD)
def test_every_set_of_outputs_has_the_bytes_of_each(name, shading):
    assert_same(HARD[name], shading, SUBSETS)


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("name", SCENES)
def test_buffers_beside_a_picture_have_the_bytes_that_they_have_alone(name, shading):
    assert_same(SCENES[name], shading, [OUTPUTS, ("rgb", "depth"), ("color", "face", "normal"), OUTPUTS])


@pytest.mark.parametrize("seed", range(6))
def test_buffers_of_random_triangles_do_not_depend_on_the_picture(seed):
    """Of all sizes, thin and steep ones, through the near plane, in great and small ranges of depth."""
    rng = np.random.default_rng(seed)
    middles, sizes = rng.uniform(-1, 1, (300, 1, 3)), 10.0 ** rng.uniform(-2, 0.5, (300, 1, 3))
    corners = (middles + sizes * rng.normal(size=(300, 3, 3))).reshape(-1, 3) * (1, 1, (0.01, 1.0, 30.0)[seed % 3])
    normals = rng.normal(size=corners.shape)
    mesh = rz.Mesh(corners, np.arange(900).reshape(-1, 3), normals, material=rz.Material(diffuse=(0.6, 0.5, 0.4)))
    camera = rz.Camera.perspective((0, 0, 2.0), (0, 0, 0), fov=60, near=(None, 1e-3)[seed % 2])
    scene = rz.Scene([mesh], [rz.DirectionalLight((0, -1, -1))], camera)
    for shading in SHADINGS:
        assert_same((scene, {"cull": ("none", "back")[seed // 3]}), shading, [OUTPUTS, ("rgb", "depth", "normal")])


# ---------------------------------------------------------------- who looks at the triangles how often


@pytest.fixture
def ways(monkeypatch):
    """How buffers came to their entries, a word a band: "shared" or "own"."""
    found = []

    def note(method, word):
        def noted(*args):
            found.append(word)
            return method(*args)

        return noted

    monkeypatch.setattr(BufferPass, "share", note(BufferPass.share, "shared"))
    monkeypatch.setattr(BufferPass, "draw", note(BufferPass.draw, "own"))
    return found


@pytest.mark.parametrize(
    ("material", "shading", "expected"),
    [
        ({}, "phong", {"shared"}),
        ({"diffuse": (0.8, 0.4, 0.1)}, "gouraud", {"shared"}),
        ({}, "gouraud", {"own"}),  # intensities stand in the entries
        ({"opacity": 0.5}, "phong", {"own"}),  # behind what is transparent
    ],
)
def test_buffers_take_the_entries_of_a_picture_that_hold_indices(ways, material, shading, expected):
    grey = [rz.AmbientLight(0.1), rz.DirectionalLight((-0.4, -0.7, -0.6), 0.7)]
    camera = rz.Camera.orthographic((2.5, 2.0, 3.5), height=4.0)
    draw((scene_of(cube(**material), lights=grey, camera=camera), {}), shading, OUTPUTS)
    assert set(ways) == expected


def test_buffers_are_of_one_sample_beside_a_picture_of_four(ways):
    """Which needs a way of its own through all stages."""
    case = scene_of(cube(), floor()), {"samples": 4}
    frame, alone = draw(case, "phong", OUTPUTS), draw((case[0], {}), "phong", ("depth", "face", "normal"))
    for name in ("depth", "face", "normal"):
        assert frame.array(name).tobytes() == alone.array(name).tobytes()
    assert not ways
