"""Draw pictures of every kind, and note which kernels each calls, with which signatures.

    python -m helpers.record_kernels             in tests/: write rasterizer/engine/recorded_kernels.json anew
    python -m helpers.record_kernels --check     say what is missing there, and what no picture calls any more

Each picture is drawn in a process of its own: a kernel remembers all that it was called with. What people draw first is
kept, and of the other pictures those that need a kernel which none before them needs.
"""

import argparse
import gc
import json
import multiprocessing
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np

import rasterizer as rz
from helpers.campaign_scenes import make_case
from helpers.small_scenes import MODELS, SHADINGS, checks, cube, drawn, floor, mixed, scene_of
from rasterizer.choices import BUFFERS, REFLECTIONS
from rasterizer.compiler import kernels
from rasterizer.compiler.store import title_of
from rasterizer.cores import n_core
from rasterizer.engine.recorded_kernels import FILE, job_of, list_all_kernels, words_of

SIZE = (32, 24)
SEED, N_CASE = 11, 150  # scenes of the campaign
SAMPLES = (1, 4, 9, 16)
TOLERANCES = ({}, {"tolerance": 0.0})
MODEL_FILES = ("teapot.obj", "cone.obj", "gear.stl", "torus.glb", "knot.ply", "globe.obj", "glass.obj",
               "still_life.obj", "room.json")  # fmt: skip

Kernel = tuple[str, str, tuple]  # module, name of the function, signature
Make = Callable[[], tuple[rz.Scene, dict]]  # returns a scene and the options of its picture, where it is drawn


class Called(NamedTuple):
    """What a picture was like, and which kernels it called; `before` are those that making the scene took."""

    words: list[str]
    kernels: set[Kernel]
    before: set[Kernel]


def usual_pictures() -> list[Make]:
    """List what people draw first: each is kept."""
    found = [of_model(name, shading=shading) for shading, name in product(SHADINGS, MODEL_FILES)]
    for shading, samples, tolerance in product(SHADINGS, SAMPLES, TOLERANCES):
        found.append(of_model("cube.obj", shading=shading, samples=samples, **tolerance))
    for more in ({"shadows": True}, {"ground": True}, {"edges": "all"}, {"background": "teal"}, {"depth_cue": 3.0},
                 {"color_range": "global"}, {"outputs": ("rgb", *BUFFERS)}, {"reflection": "blinn"},
                 {"reflection": "cook-torrance"}, {"cull": "none"}):  # fmt: skip
        found += [of_model(name, shading=shading, **more) for shading in SHADINGS for name in ("cube.obj", "glass.obj")]
    return found + [of_model("cube.obj", outputs=buffer) for buffer in BUFFERS]


def of_model(name: str, **options) -> Make:
    """Return what makes the scene of a file in `models`."""
    return lambda: (rz.load(MODELS / name), options)


def other_pictures() -> list[Make]:
    """List what needs kernels that hardly any picture needs."""
    tables = drawn, mixed, surfaces
    found = [
        lambda table=table, name=name, options={"shading": shading, **tolerance}: of_table(table(), name, options)
        for table in tables
        for name in table()
        for shading, tolerance in product(SHADINGS, TOLERANCES)
    ]
    found += [lambda make=make: (make(), {}) for make in (large_obj, large_stl, large_ply, large_parts)]
    found.append(lambda: (scene_of(cube(opacity=0.5)), {"ground": True}))
    return found + [lambda number=number: of_campaign(number) for number in range(N_CASE)]


def of_table(scenes: dict, name: str, options: dict) -> tuple[rz.Scene, dict]:
    """Return a scene of a table, with options beside its own."""
    scene, own = scenes[name] if isinstance(scenes[name], tuple) else (scenes[name], {})
    return scene, {"samples": 1} | own | options


def of_campaign(number: int) -> tuple[rz.Scene, dict]:
    """Return a scene of the campaign, drawn with buffers now and then."""
    case = make_case(SEED, number)
    outputs = ("color", "depth", "face", "normal") if number % 3 == 0 else ("rgb",)
    return case.scene, case.options | {"outputs": outputs}


def surfaces() -> dict[int, rz.Scene]:
    """Number -> scene of all kinds of surfaces, a corner behind the camera, in several lights and in shadows."""
    points = np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.5), (0.0, 0.0, 9.0)])
    faces = [(0, 1, 2), (0, 2, 3), (2, 3, 4)]

    def surface(colors=None, uv=None, **of_material):
        return rz.Mesh(points, faces, colors=colors, uv=uv, material=rz.Material(**of_material))

    def papered(**of_material):
        return surface(uv=points[:, :2], **of_material)

    plain, clear = surface(), surface(opacity=0.5)
    normals = replace(plain, normals=np.tile((0.0, 0.0, 1.0), (len(points), 1)))
    colored = surface(colors=np.linspace(0.0, 1.0, 15).reshape(5, 3))
    texture, brushed = np.eye(4, dtype=np.uint8), papered(reflection="cook-torrance", roughness=(0.2, 0.5))
    models = [surface(reflection=name, **more) for name in REFLECTIONS for more in ({}, {"fresnel": 0.1})]
    models += [surface(reflection="cook-torrance", distribution="beckmann")]
    models += [surface(reflection=name, fresnel=(0.9, 0.5, 0.1), roughness=0.5) for name in ("phong", "cook-torrance")]
    models += [surface(reflection="cook-torrance", roughness=(0.2, 0.5), tangent=(0, 1, 0))]
    meshes = [
        [plain, replace(plain, smoothing=np.ones(3, np.int32)), normals],
        [rz.Mesh(points, [(0, 1, 2, 3), (0, 1, 3, 2, 4)])],
        [colored],
        [colored, clear],
        [plain, clear],
        [papered(texture=texture)],
        [papered(texture=np.zeros((4, 4, 4), np.uint8), opacity=0.5)],  # whose texels let light through
        [brushed],
        [papered(reflection="cook-torrance", texture=texture, metallic=1.0)],
        [papered(reflection="cook-torrance", metallic_roughness=texture, metallic=1.0)],
        models,
    ]
    # Float64 for some surfaces of a picture in float32: without tangents and with them; without a texture and with one.
    for double in (surface(reflection="toon"), brushed):
        for more in ([], [papered(texture=texture)], [papered(texture=texture, reflection="toon")]):
            meshes += [[plain, double, *more], [plain, double, *more, clear]]
    shadow = rz.Shadow(size=16)
    sun, far_away = rz.DirectionalLight((0, -1, -1), 0.5), (50, 50, 50)  # float32 will do
    spot = rz.SpotLight(far_away, (-1, -1, -1), 0.5)
    lights = [
        [rz.AmbientLight(0.1), sun, rz.PointLight(far_away, 0.5, (1, 0.1, 0)), spot, replace(spot, falloff=2.0)],
        [replace(sun, shadow=shadow), rz.PointLight((0, 0, 1), 0.5, shadow=shadow)],
        [replace(sun, shadow=shadow)],  # float32 will do beside surfaces that need float64
    ]
    camera = rz.Camera.perspective((0, 0, 5))
    return dict(enumerate(rz.Scene(each, lamps, camera) for each in meshes for lamps in lights))


def large_obj() -> rz.Scene:
    """The scene of an OBJ file that compiled code reads: many rows of numbers, corners with and without normals."""
    rng = np.random.default_rng(1)
    n = 20_000
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in rng.normal(size=(n, 3))]
    lines += [f"vt {x:.4f} {y:.4f}" for x, y in rng.random((n, 2))]
    lines += [f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in rng.integers(1, n + 1, (n, 3))]
    return rz.load("\n".join(lines).encode(), format="obj")


def large_stl() -> rz.Scene:
    """The scene of an STL file that compiled code reads."""
    rng = np.random.default_rng(2)
    facet = "facet normal 0 0 1\nouter loop\n{}endloop\nendfacet\n"
    corners = rng.normal(size=(6_000, 3, 3))
    body = "".join(facet.format("".join(f"vertex {x:.4f} {y:.4f} {z:.4f}\n" for x, y, z in each)) for each in corners)
    return rz.load(f"solid s\n{body}endsolid s\n".encode(), format="stl")


def large_ply() -> rz.Scene:
    """The scene of a PLY file in ASCII that compiled code reads."""
    rng = np.random.default_rng(4)
    n = 200_000  # numbers of more than four megabytes
    head = f"ply\nformat ascii 1.0\nelement vertex {n}\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 20000\nproperty list uchar int vertex_indices\nend_header\n"
    lines = [f"{x:.4f} {y:.4f} {z:.4f}" for x, y, z in rng.normal(size=(n, 3))]
    lines += [f"3 {a} {b} {c}" for a, b, c in rng.integers(0, n, (20_000, 3))]
    return rz.load((head + "\n".join(lines) + "\n").encode(), format="ply")


def large_parts() -> rz.Scene:
    """A mesh of more corners than are sorted, with texture coordinates, and a polygon whose ears are cut."""
    rng = np.random.default_rng(3)
    faces = np.arange(18_000).reshape(-1, 3)
    many = rz.Mesh(
        rng.normal(size=(18_000, 3)), faces, uv=rng.random((18_000, 2)), material=rz.Material(texture=checks())
    )
    return scene_of(many, floor(), drawn()["a polygon with ears"][0].meshes[0])


# ---------------------------------------------------------------- in the process of one picture


def called() -> set[Kernel]:
    """Return what this process has called: kernels, and functions that kernels call by their address."""
    kinds_of_code = kernels.Kernel, kernels.BatchFunction
    # By `type`: weak references answer for what they refer to.
    found = [thing for thing in gc.get_objects() if issubclass(type(thing), kinds_of_code)]
    own = [thing for thing in found if kernels.is_own(thing.py_func)]
    return {(thing.py_func.__module__, thing.py_func.__name__, each) for thing in own for each in thing.signatures}


def draw(make: Make) -> Called | None:
    """Draw a picture and return what it called; None where the scene is refused."""
    sys.executable = ""  # so nothing is compiled ahead: what the file says by now doesn't count
    scene, options = make()
    before = called()
    try:
        with rz.Renderer(scene, SIZE, **{"threads": 1} | options) as renderer:
            renderer.render()
            words = words_of(renderer.scene, renderer.options)
    except rz.SceneError:
        return None
    return Called(sorted(words), called() - before, before)


# ---------------------------------------------------------------- all of them


@cache
def all_pictures() -> list[Make]:
    """List all of them; made before processes are forked, which share it."""
    return usual_pictures() + other_pictures()


def draw_number(number: int) -> Called | None:
    """Draw one of all pictures, see `draw`."""
    return draw(all_pictures()[number])


def draw_numbers(numbers: Sequence[int]) -> list[Called]:
    """Draw pictures, each in a process of its own, on all cores; without those of scenes that are refused."""
    all_pictures()
    with multiprocessing.get_context("fork").Pool(n_core(), maxtasksperchild=1) as pool:
        return [found for found in pool.imap(draw_number, numbers, chunksize=1) if found is not None]


def record(every: int = 1) -> dict:
    """Draw all pictures, or one of so many, and return what is written."""
    n_usual = len(usual_pictures())
    found = draw_numbers(range(0, len(all_pictures()), every))
    numbers: dict[Kernel, int] = {}
    pictures: dict[tuple[str, ...], set[int]] = {}
    for k, picture in enumerate(found):
        is_kept = k < n_usual or not numbers.keys() >= picture.kernels
        for kernel in sorted(picture.kernels | picture.before, key=repr):
            numbers.setdefault(kernel, len(numbers))
        if is_kept:
            pictures.setdefault(tuple(picture.words), set()).update(numbers[kernel] for kernel in picture.kernels)
    return {"kernels": list(numbers), "pictures": [(words, sorted(used)) for words, used in pictures.items()]}


def write(recorded: dict) -> None:
    """Write the file, a line for each kernel and each picture."""
    parts = [
        f'"{name}": [\n' + ",\n".join(json.dumps(row, separators=(",", ":")) for row in rows) + "\n]"
        for name, rows in recorded.items()
    ]
    FILE.write_text("{" + ",\n".join(parts) + "}\n", encoding="utf-8")


def main() -> int:
    """Run the program."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 where the file is out of date")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="check one of N pictures")
    arguments = parser.parse_args()
    stored = set(list_all_kernels())
    recorded = record(arguments.every)
    found = {job_of(*kernel) for kernel in recorded["kernels"]}
    missing, unused = found - stored, stored - found if arguments.every == 1 else set()
    for words, jobs in (("missing", missing), ("not called", unused)):
        print(f"{words}: {len(jobs)}", *sorted(title_of(function) for function, _ in jobs), sep="\n    ")
    if arguments.check:
        return int(bool(missing or unused))
    write(recorded)
    return 0


if __name__ == "__main__":
    sys.exit(main())
