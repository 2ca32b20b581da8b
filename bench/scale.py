"""How do time and memory grow with the scene, the picture and the machine?

    python bench/scale.py                          all of them, some minutes
    python bench/scale.py triangles lights         some of them
    python bench/scale.py --plot scale.png         with a plot of each, by matplotlib (pip install '.[bench]')
    python bench/scale.py --many 10000             so many small pictures in one process: is memory flat?

One thing grows, the rest stays as it is. Every point is measured in a process of its own, so its peak memory is known.
A slope is the exponent k where a cost grows as n^k, from the last point but one to the last. Columns are explained in
bench/README.md; the last line of the output is the same as JSON.
"""

import argparse
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
from rasterizer.analysis.speed_error_plot import check_plotting, figure_bytes
from rasterizer.analysis.timing import take_turns

WORST_SLOPE = 1.2  # of linear work, as it is measured where others use the memory, too
MIN_MS, MIN_MIB = 2.0, 64.0  # what is less says nothing of growth
CAMERA = rz.Camera.perspective((0, 0, 4), (0, 0, 0), fov=40)
SUN = rz.DirectionalLight((-0.4, -0.5, -0.8), 0.8)
LIGHT = (rz.AmbientLight(0.1), SUN)


class Work(NamedTuple):
    """What is drawn for one point."""

    scene: rz.Scene
    size: tuple[int, int]
    options: dict


class Axis(NamedTuple):
    """Something that grows."""

    make: Callable[[int], Work]
    counts: tuple[int, ...]
    what: str  # what is drawn, for the title


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
AXES = {
    "triangles": Axis(triangles, (1_000, 10_000, 100_000, 1_000_000, 3_000_000, 10_000_000), "sphere, 1080p"),
    "pixels": Axis(pixels, tuple((256 * 2**k) ** 2 for k in range(7)), "torus, 256² to 16384²"),
    "lights": Axis(lights, (1, 4, 16, 64), "point lights, torus, 512², Phong"),
    "shadows": Axis(shadows, (1, 4, 16, 64), "lights with shadow maps, torus, 512², Phong"),
    "materials": Axis(materials, DECADES, "torus, 512², Phong"),
    "textures": Axis(textures, DECADES, "torus, 512², Phong"),
    "objects": Axis(objects, (1, 10, 100, 1000, 10_000), "spheres of 80 triangles, 512²"),
    "threads": Axis(threads, thread_counts(), "sphere of a million triangles, 1080p, Phong"),
}
# (title, key, what is less says nothing of growth): milliseconds of processor time, which others that compute meanwhile
# don't lengthen, and MiB
COSTS = (
    ("build", "build_ms", MIN_MS),
    ("prepare", "prepare_ms", MIN_MS),
    ("frame", "cpu_ms", MIN_MS),
    ("MiB", "mib", MIN_MIB),
)


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    if args.point:
        name, count = args.point
        print(json.dumps(measure_point(AXES[name].make, int(count), args)))
        return 0
    machine, rows = measure.Machine(), []
    if args.many:
        rows += measure_many(args)
    else:
        for name in args.axes or AXES:
            rows += measure_axis(name, args)
    measure.write_plot(args.plot, plot, rows)
    measure.print_json("scale", machine, args, rows)
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("axes", nargs="*", metavar="AXIS", help=f"out of {', '.join(AXES)}")
    parser.add_argument("--most", type=int, default=10**9, metavar="N", help="leave out points beyond")
    parser.add_argument("--threads", type=int, default=1, help="of all axes but threads (default: %(default)s)")
    parser.add_argument("--frames", type=int, default=9, help="most frames of a point (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=3.0, help="time limit of a point (default: %(default)s)")
    measure.add_output(parser, "the tables into a picture")
    instead = parser.add_argument_group("measured instead")
    instead.add_argument("--many", type=int, metavar="N", help="small pictures in one process")
    parser.add_argument("--point", nargs=2, metavar=("AXIS", "N"), help=argparse.SUPPRESS)
    return parser


# ── what grows ────────────────────────────────────────────────────────────────────────────────────────────


def measure_axis(name, args) -> list[dict]:
    """Measure the points of an axis, print them and the slopes; return the rows."""
    axis = AXES[name]
    print(f"\n{name}: {axis.what}")
    columns = [("         n", "n", "d"), *((f"{title:>9}", key, ".1f") for title, key, _ in COSTS)]
    table = measure.Table([*columns, ("best wall", "best_ms", ".1f")])
    rows = []
    for count in axis.counts:
        if count <= args.most:
            rows.append({"axis": name, "n": count} | run_point(name, count, args))
            table.print(rows[-1])
    slopes = {"axis": name, "slopes": {key: slope_of(rows, key, least) for _, key, least in COSTS}}
    told = [f"{title} {slopes['slopes'][key]:+.2f}" for title, key, _ in COSTS if slopes["slopes"][key] is not None]
    print(f"     slope  {', '.join(told) or 'none: nothing grows'}")
    for title, key, _ in COSTS:
        if (slopes["slopes"][key] or 0.0) > WORST_SLOPE:
            print(f"     WORSE THAN LINEAR: {title}")
    return [*rows, slopes]


def slope_of(rows, key, least) -> float | None:
    """The exponent with which a cost grows from the last point but one to the last; None where it does not grow.

    A cost is a part that stays and a part that grows: only a last point that costs twice as much as the first one tells
    how. What stays makes a slope smaller, never larger than 1.
    """
    costs = [row[key] for row in rows]
    if len(costs) < 2 or None in costs or costs[-1] <= max(least, 2.0 * costs[0]):
        return None
    return float(np.log(costs[-1] / costs[-2]) / np.log(rows[-1]["n"] / rows[-2]["n"]))


def run_point(name, count, args) -> dict:
    """Measure a point in a process of its own."""
    command = [sys.executable, __file__, "--point", name, str(count), "--threads", str(args.threads),
               "--frames", str(args.frames), "--seconds", str(args.seconds)]  # fmt: skip
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def measure_point(make, count, args) -> dict:
    """Measure one point here: milliseconds, and MiB beyond what a process holds that has drawn next to nothing."""
    settings = {"outputs": ("rgb",), "threads": args.threads}
    small = make(1)
    with rz.Renderer(small.scene, (16, 16), **({"samples": 1} | settings | small.options | {"threads": 1})) as renderer:
        renderer.render()  # kernels are loaded, or compiled
    del small, renderer
    gc.collect()
    before = measure.peak_mib()
    marks = []
    for _ in range(2):  # the quicker one counts; a new scene, because textures keep what was made for the first
        work = renderer = None
        gc.collect()
        marks.append([process_time()])
        work = make(count)
        marks[-1].append(process_time())
        renderer = rz.Renderer(work.scene, work.size, **({"samples": 1} | settings | work.options))
        marks[-1].append(process_time())
    build_ms, prepare_ms = (1000.0 * np.diff(marks)).min(axis=0)
    with renderer:
        renderer.render()
        cpu_ms = []

        def draw():
            start = process_time()
            renderer.render()
            cpu_ms.append(1000.0 * (process_time() - start))

        times, _ = take_turns({"frame": draw}, args.seconds, args.frames)["frame"]
    after = measure.peak_mib()
    return {"build_ms": build_ms, "prepare_ms": prepare_ms, "cpu_ms": min(cpu_ms), "best_ms": float(times.min()),
            "mib": None if after is None else after - before}  # fmt: skip


# ── many pictures ─────────────────────────────────────────────────────────────────────────────────────────


def held_mib() -> float:
    """Memory that this process holds now, in MiB (Linux)."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    raise OSError("/proc/self/status has no VmRSS")


def draw_many(n, n_report) -> list[float]:
    """Draw n small pictures, each of a scene of its own and by a Renderer of its own, with all that they may need.

    Returns the memory held, MiB, after each `n_report`-th part of them.
    """
    vertices, faces = scenes.icosphere(1)
    image, held = np.random.default_rng(0).integers(0, 256, (16, 16, 3), np.uint8), []
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
            held.append(held_mib())
    return held


def measure_many(args) -> list[dict]:
    """Draw --many pictures; print and return the memory after each tenth of them."""
    table = measure.Table([("pictures", "n", "d"), ("     MiB", "mib", ".1f")])
    start = perf_counter()
    rows = [{"axis": "many", "n": (k + 1) * (args.many // 10), "mib": held}
            for k, held in enumerate(draw_many(args.many, 10))]  # fmt: skip
    for row in rows:
        table.print(row)
    grown = rows[-1]["mib"] - rows[len(rows) // 2 - 1]["mib"]
    print(f"{1000.0 * (perf_counter() - start) / args.many:.2f} ms a picture; the second half took {grown:+.1f} MiB")
    return rows


# ── plots ─────────────────────────────────────────────────────────────────────────────────────────────────


def plot(rows, suffix) -> bytes:
    """Plot a panel an axis: costs over n, both in logarithms, with a line of slope 1."""
    check_plotting()
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(row["axis"] for row in rows if "slopes" in row))
    n_column = min(4, len(names))
    n_row = -(-len(names) // n_column)
    figure = Figure(figsize=(4 * n_column, 3.2 * n_row), layout="constrained")
    panels = figure.subplots(n_row, n_column, squeeze=False)
    for panel, name in zip(panels.flat, names, strict=False):
        points = [row for row in rows if row["axis"] == name and "n" in row]
        n = np.array([row["n"] for row in points], float)
        for title, key, _ in COSTS:
            cost = np.array([np.nan if row[key] is None else max(row[key], 0.01) for row in points])
            panel.loglog(n, cost, marker="o", markersize=3, label=title)
        panel.loglog(n, points[-1]["cpu_ms"] * n / n[-1], color="0.7", linestyle=":", label="linear")
        panel.set_title(name)
        panel.set_xlabel(AXES[name].what if name in AXES else "", fontsize=7)
        panel.grid(alpha=0.3)
    for row in panels:
        row[0].set_ylabel("processor ms, MiB")
    for panel in panels.flat[len(names) :]:
        panel.set_axis_off()
    panels[0, 0].legend(fontsize=7)
    return figure_bytes(figure, suffix)


if __name__ == "__main__":
    sys.exit(main())
