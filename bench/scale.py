"""How do time and memory grow with the scene, the picture and the machine?

    python bench/scale.py                          all of them, some minutes
    python bench/scale.py triangles lights         some of them
    python bench/scale.py --many 10000             so many small pictures in one process: is memory flat?

One thing grows, the rest stays as it is. Every point is measured in a process of its own, so its peak memory is known.
Times are of processors, which others that compute meanwhile don't lengthen. A slope is the exponent k where a cost
grows as n^k, from the last point but one to the last.
"""

import gc
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
import rasterizer as rz
from bench import measure, scenes
from rasterizer import Options

WORST_SLOPE = 1.2  # of linear work, as it is measured where others use the memory, too
CAMERA = rz.Camera.perspective((0, 0, 4), (0, 0, 0), fov=40)
SUN = rz.DirectionalLight((-0.4, -0.5, -0.8), 0.8)
LIGHT = (rz.AmbientLight(0.1), SUN)


class Work(NamedTuple):
    """What is drawn for one point."""

    scene: rz.Scene
    size: tuple[int, int]
    options: dict


def ring(**attributes):
    """A torus of 16 384 triangles."""
    return rz.Mesh(*scenes.torus(128, 64, 0.9, 0.4), **attributes)


def triangles(n) -> Work:
    """A sphere of n triangles."""
    n_row = max(3, round((n / 4) ** 0.5) + 1)
    return Work(rz.Scene(rz.Mesh(*scenes.uv_sphere(n_row, 2 * (n_row - 1))), LIGHT, CAMERA), scenes.SIZES["1080p"], {})


def pixels(n) -> Work:
    """A torus in a square picture of n pixels."""
    side = round(n**0.5)
    return Work(rz.Scene(ring(), LIGHT, CAMERA), (side, side), {})


def lights(n) -> Work:
    """A torus under n point lights, every sample lit."""
    around = 2 * np.pi * np.arange(n) / n
    lamps = [rz.PointLight((3 * np.cos(a), 3 * np.sin(a), 2), 0.5 / n, (1, 0.1, 0)) for a in around]
    return Work(rz.Scene(ring(), lamps, CAMERA), (512, 512), {"shading": "phong"})


def shadows(n) -> Work:
    """A torus under n directional lights that cast shadows; their maps are drawn for every picture."""
    around = 2 * np.pi * np.arange(n) / n
    suns = [
        rz.DirectionalLight((np.cos(a), np.sin(a), -1), 0.5 / n, "camera", shadow=rz.Shadow(size=256)) for a in around
    ]
    return Work(rz.Scene(ring(), suns, CAMERA), (512, 512), {"shading": "phong"})


def materials(n) -> Work:
    """A torus in stripes of n materials."""
    palette = [rz.Material(diffuse=(0.5, 0.3 + 0.4 * k / n, 0.4)) for k in range(n)]
    return striped(palette)


def textures(n) -> Work:
    """A torus in stripes of n materials, each with a texture of its own."""
    rng = np.random.default_rng(1)
    images = rng.integers(100, 256, (n, 64, 64, 3), np.uint8)
    palette = [rz.Material(texture=rz.Texture(image)) for image in images]
    return striped(palette)


def striped(palette) -> Work:
    """A torus whose triangles have the materials of a palette, stripe by stripe."""
    vertices, _ = scenes.torus(128, 64)
    n_face = 2 * 128 * 64
    stripes = np.arange(n_face) * len(palette) // n_face
    uv = np.random.default_rng(2).random((len(vertices), 2))
    mesh = ring(materials=palette, face_material=stripes, uv=uv)
    return Work(rz.Scene(mesh, LIGHT, CAMERA), (512, 512), {"shading": "phong"})


def objects(n) -> Work:
    """A grid of n meshes, spheres of 80 triangles."""
    vertices, faces = scenes.icosphere(1)
    side = int(np.ceil(n**0.5))
    places = [(2 * (k % side + 0.5) / side - 1, 2 * (k // side + 0.5) / side - 1, 0) for k in range(n)]
    meshes = [rz.Mesh(vertices / side + np.array(place), faces) for place in places]
    return Work(rz.Scene(meshes, LIGHT, CAMERA), (512, 512), {})


def threads(n) -> Work:
    """A sphere of a million triangles, with n threads."""
    return triangles(1_000_000)._replace(options={"shading": "phong", "threads": n})


def thread_counts() -> tuple[int, ...]:
    """1, 2, 4 and so on, and as many as there are cores."""
    n_core = Options().n_thread
    return tuple(sorted({*(2**k for k in range(n_core.bit_length())), n_core}))


DECADES = (1, 10, 100, 1000)
AXES: dict[str, tuple[Callable[[int], Work], tuple[int, ...]]] = {
    "triangles": (triangles, (1_000, 10_000, 100_000, 1_000_000, 3_000_000, 10_000_000)),
    "pixels": (pixels, tuple((256 * 2**k) ** 2 for k in range(7))),
    "lights": (lights, (1, 4, 16, 64)),
    "shadows": (shadows, (1, 4, 16, 64)),
    "materials": (materials, DECADES),
    "textures": (textures, DECADES),
    "objects": (objects, (1, 10, 100, 1000, 10_000)),
    "threads": (threads, thread_counts()),
}
# What is less says nothing of growth: milliseconds, and MiB.
LEAST = {"build_ms": 2.0, "prepare_ms": 2.0, "cpu_ms": 2.0, "mib": 64.0}


def add_arguments(parser) -> None:
    """Describe the command line."""
    add = parser.add_argument
    add("axes", nargs="*", default=list(AXES), metavar="AXIS", help=f"out of {', '.join(AXES)}")
    add("--most", type=int, default=10**9, metavar="N", help="leave out points beyond")
    add("--seconds", type=float, default=3.0, help="time limit of a point (default: %(default)s)")
    add("--many", type=int, metavar="N", help="instead: so many small pictures in one process")


def measure_all(args):
    """Yield a row for each point of each axis, and its slopes; with --many, the memory after each tenth."""
    if args.many:
        start = perf_counter()
        for k, held in enumerate(draw_many(args.many, 10)):
            yield {"axis": "many", "n": (k + 1) * (args.many // 10), "mib": held, "seconds": perf_counter() - start}
        return
    for name in args.axes:
        rows = []
        for count in AXES[name][1]:
            if count <= args.most:
                command = [sys.executable, __file__, "--point", name, str(count), str(args.seconds)]
                done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
                rows.append({"axis": name, "n": count} | json.loads(done.stdout.splitlines()[-1]))
                yield rows[-1]
        slopes = {key: slope_of(rows, key, least) for key, least in LEAST.items()}
        worse = ", ".join(key for key, slope in slopes.items() if (slope or 0.0) > WORST_SLOPE)
        yield {"axis": name, "slopes": slopes, "worse_than_linear": worse}


def slope_of(rows, key, least) -> float | None:
    """The exponent with which a cost grows from the last point but one to the last; None where it does not grow.

    A cost is a part that stays and a part that grows: only a last point that costs twice as much as the first one tells
    how. What stays makes a slope smaller, never larger than 1.
    """
    costs = [row[key] for row in rows]
    if len(costs) < 2 or None in costs or costs[-1] <= max(least, 2.0 * costs[0]):
        return None
    return float(np.log(costs[-1] / costs[-2]) / np.log(rows[-1]["n"] / rows[-2]["n"]))


def measure_point(make, count, seconds) -> dict:
    """Measure one point here: milliseconds, and MiB beyond what a process holds that has drawn next to nothing."""
    settings = {"outputs": ("rgb",), "threads": 1, "samples": 1}
    small = make(1)
    with rz.Renderer(small.scene, (16, 16), **settings | small.options | {"threads": 1}) as renderer:
        renderer.render()  # kernels are loaded, or compiled
    del small, renderer
    before, marks, cpu_ms = measure.memory_mib(), [], []
    for _ in range(2):  # the quicker one counts; a new scene, because textures keep what was made for the first
        work = renderer = None
        gc.collect()
        marks.append([process_time()])
        work = make(count)
        marks[-1].append(process_time())
        renderer = rz.Renderer(work.scene, work.size, **settings | work.options)
        marks[-1].append(process_time())
    build_ms, prepare_ms = (1000.0 * np.diff(marks)).min(axis=0)
    with renderer:
        renderer.render()
        begin = perf_counter()
        while len(cpu_ms) < 3 or (len(cpu_ms) < 9 and perf_counter() - begin < seconds):
            start = process_time()
            renderer.render()
            cpu_ms.append(1000.0 * (process_time() - start))
    after = measure.memory_mib()
    return {"build_ms": build_ms, "prepare_ms": prepare_ms, "cpu_ms": min(cpu_ms),
            "mib": None if after is None else after - before}  # fmt: skip


# ── many pictures ─────────────────────────────────────────────────────────────────────────────────────────


def draw_many(n, n_report):
    """Draw n small pictures, each of a scene of its own and by a Renderer of its own, with all that they may need.

    Yields the memory held, MiB, after each `n_report`-th part of them.
    """
    vertices, faces = scenes.icosphere(1)
    image = np.random.default_rng(0).integers(0, 256, (16, 16, 3), np.uint8)
    kinds = [
        ({}, {"shading": "gouraud"}),
        ({"texture": rz.Texture(image)}, {"shading": "phong"}),
        ({"opacity": 0.5}, {"shading": "flat", "samples": 4}),
        ({"diffuse": (0.8, 0.4, 0.2)}, {"outputs": ("color", "depth", "face", "normal")}),
    ]
    for k in range(n):
        material, options = kinds[k % len(kinds)]
        light = rz.DirectionalLight((-0.4, -0.5, -0.8), 0.8, shadow=rz.Shadow(size=64) if k % 8 == 0 else None)
        scene = rz.Scene(rz.Mesh(vertices, faces, uv=vertices[:, :2], material=rz.Material(**material)), light)
        frame = rz.render(scene, (48 + k % 5, 32), threads=1 + k % 2, **{"samples": 1} | options)
        frame.save(os.devnull, format="png")
        if (k + 1) % (n // n_report) == 0:
            yield measure.memory_mib("VmRSS")


main = measure.script("scale", __doc__, add_arguments, measure_all)

if __name__ == "__main__":
    if sys.argv[1:2] == ["--point"]:
        axis, n, seconds = sys.argv[2:]
        print(json.dumps(measure_point(AXES[axis][0], int(n), float(seconds))))
    else:
        sys.exit(main())
