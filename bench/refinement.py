"""How does the error fall with the number of triangles, and what is better: finer meshes or a dearer shading?

    python bench/refinement.py                                         surfaces x shadings x meshes: some minutes
    python bench/refinement.py sphere --quads 8 16 32 --plot x.png

Meshes of surfaces that formulas give, coarse to fine, are compared with the surface itself, each shading with Phong's
picture of the finest mesh. The slope is the exponent k of error ~ edge^k, from one mesh to the next, while errors
aren't rounding.
Theory says: flat shading 1, as its light is that of one point of a face; Gouraud's and Phong's methods 2, as linear
interpolation leaves what bends; the silhouette's area 2. The last line is JSON.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
import rasterizer as rz
from bench import measure, scenes
from rasterizer.analysis.comparison import root_mean_square
from rasterizer.analysis.speed_error_plot import COLORS, check_plotting, figure_bytes, make_logarithmic
from rasterizer.analysis.timing import take_turns

SHADINGS = ("flat", "gouraud", "phong")
QUADS = (4, 8, 16, 32, 64, 128, 256)
LIGHTS = (rz.AmbientLight(0.1), rz.DirectionalLight((-0.5, -0.6, -1.0), 0.8, attached="camera"))
MATERIAL = rz.Material(specular=0.3, shininess=20.0)
ROUNDED = 3e-6  # errors below are those of float32, of vertices on a grid of 1/256 px, and of the finest mesh
MIN_SILHOUETTE = 100  # pixels: of fewer the samples decide
THEORY = {"flat": 1, "gouraud": 2, "phong": 2, "silhouette": 2}
# Quads along each side of a mesh that stands for the surface itself: errors of Phong's picture fall with the square of
# the edges, and are 256 times as small as at 64.
FINEST = 1024
STEP = 1e-5  # of parameters, for derivatives

# The profile of a teapot's body, radius and height, as a Bézier curve. Source: the data set of M. Newell 1975, as in
# F. Crow 1987, "The Origins of the Teapot", IEEE Computer Graphics and Applications 7(1).
PROFILE = np.array([(1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)])
_ARC = 0.551915  # of a circle's radius: the handles of a cubic Bézier curve for a quarter

COLUMNS = [
    ("surface     ", "surface", ""), ("shading", "shading", ""), ("triangles", "triangles", "d"),
    ("     ms", "ms", ".2f"), ("rms err", "rms", ".1e"), ("max err", "max", ".1e"), ("slope", "slope", ".2f"),
    ("silhouette px", "silhouette", ".1f"), ("slope", "silhouette_slope", ".2f"), ("best", "is_best", ""),
]  # fmt: skip


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    machine, table, rows = measure.Machine(), measure.Table(COLUMNS), []
    for name in args.surfaces:
        found = measure_surface(name, args)
        mark_best(found)
        rows += found
        for row in found:
            table.print(row | {"is_best": "*" if row["is_best"] else ""})
    measure.write_plot(args.plot, plot, rows)
    measure.print_json("refinement", machine, args, rows)
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = tuple(SURFACES)
    parser.add_argument("surfaces", nargs="*", default=names, metavar="SURFACE", help=", ".join(names))
    parser.add_argument("--quads", nargs="+", type=int, default=QUADS, help="along each side of the meshes")
    parser.add_argument("--finest", type=int, default=FINEST, help="of the surface itself (default: %(default)s)")
    parser.add_argument("--size", type=scenes.size_of, default=(512, 512), help="default: 512x512")
    parser.add_argument("--threads", type=int, default=1, help="default: %(default)s")
    parser.add_argument("--frames", type=int, default=15, help="most warm frames of each row (default: %(default)s)")
    parser.add_argument(
        "--seconds", type=float, default=4.0, help="time limit of a surface's frames (default: %(default)s)"
    )
    measure.add_output(parser, "error against triangles and against time")
    return parser


def measure_surface(name, args) -> list[dict]:
    """Return a row for each mesh and shading of a surface."""
    finest = make_mesh(name, args.finest, MATERIAL)
    camera = rz.Camera.framing(finest, fov=scenes.FOV, margin=scenes.MARGIN)
    truth = draw(rz.Scene([finest], LIGHTS, camera), args, shading="phong", tolerance=0.0)
    calls, rows = {}, []
    for n in args.quads:
        mesh = make_mesh(name, n, MATERIAL)
        scene = rz.Scene([mesh], LIGHTS, camera)
        for shading in SHADINGS:
            frame = draw(scene, args, shading=shading)
            rows.append(
                {"surface": name, "shading": shading, "triangles": mesh.n_face, "quads": n} | compare(frame, truth)
            )
            calls[n, shading] = rz.Renderer(
                scene, args.size, shading=shading, outputs=("rgb",), threads=args.threads, samples=1
            ).render
            calls[n, shading]()  # compiles and allocates
    times = take_turns(calls, args.seconds, args.frames)
    for row in rows:
        row["ms"] = float(np.median(times[row["quads"], row["shading"]][0]))
    for shading in SHADINGS:
        add_slopes([row for row in rows if row["shading"] == shading])
    return sorted(rows, key=lambda row: (SHADINGS.index(row["shading"]), row["triangles"]))


def draw(scene, args, **options):
    """Draw a scene with its colours, depths and coverage."""
    with rz.Renderer(
        scene, args.size, outputs=("color", "depth"), threads=args.threads, **{"samples": 1} | options
    ) as renderer:
        return renderer.render()


def compare(frame, truth) -> dict:
    """Errors where both cover a pixel and show the same part of the surface; silhouette: pixels of one alone."""
    with np.errstate(invalid="ignore"):
        is_same = np.abs(frame.depth - truth.depth) < 0.1 * np.ptp(truth.depth[np.isfinite(truth.depth)]) + 1e-3
    is_inner = is_same & (frame.alpha > 0) & (truth.alpha > 0)
    error = np.abs(frame.color - truth.color)[is_inner]
    return {"rms": root_mean_square(error), "max": float(error.max()),
            "silhouette": float(np.abs(frame.alpha - truth.alpha).sum())}  # fmt: skip


def add_slopes(rows) -> None:
    """Add to each row with which power of the edges' length its errors fell since the row before."""
    for before, row in zip(rows, rows[1:], strict=False):
        ratio = np.log(row["quads"] / before["quads"])
        if row["rms"] > ROUNDED:
            row["slope"] = float(np.log(before["rms"] / row["rms"]) / ratio)
        if row["silhouette"] >= MIN_SILHOUETTE:
            row["silhouette_slope"] = float(np.log(before["silhouette"] / row["silhouette"]) / ratio)


def mark_best(rows) -> None:
    """Mark the rows of a surface that no other one beats in time and error."""
    for row in rows:
        row["is_best"] = not any(
            other["ms"] <= row["ms"] and other["rms"] <= row["rms"] and other is not row for other in rows
        )


def last_slopes(rows, shading, key="slope") -> list[float]:
    """The slopes of one shading at the finest meshes of each surface that have one."""
    found = {row["surface"]: row[key] for row in rows if row["shading"] == shading and key in row}
    return list(found.values())


def plot(rows, suffix) -> bytes:
    """Plot error against triangles, and against time, a column a surface."""
    check_plotting()
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator

    names = dict.fromkeys(row["surface"] for row in rows if row["rms"] > ROUNDED)  # a plane has no error
    names = list(names) or [rows[0]["surface"]]
    figure = Figure(figsize=(3.4 * len(names), 6.4), layout="constrained")
    panels = figure.subplots(2, len(names), squeeze=False, sharey="col")
    for column, name in enumerate(names):
        for row, (key, what) in enumerate((("triangles", "triangles"), ("ms", "milliseconds"))):
            axes = panels[row][column]
            for shading in SHADINGS:
                points = [r for r in rows if r["surface"] == name and r["shading"] == shading]
                error = [max(r["rms"], 1e-8) for r in points]
                axes.plot([r[key] for r in points], error, "o-", color=COLORS[shading], markersize=4, label=shading)
            if key == "triangles":
                n = np.array([r["triangles"] for r in points], float)
                for slope, style in ((1, ":"), (2, "--")):
                    axes.plot(n, 0.2 * (n / n[0]) ** (-slope / 2), color="0.6", linestyle=style, linewidth=1,
                                label=f"edge{'²' if slope == 2 else ''}")  # fmt: skip
                axes.set_title(name)
            axes.set_xlabel(what)
            make_logarithmic(axes, y_subs=(1.0,))
            if key == "triangles":
                axes.xaxis.set_major_locator(LogLocator(subs=(1.0,)))
            axes.grid(alpha=0.25)
    for row in panels:
        row[0].set_ylabel("rms error against the surface")
    panels[0][0].legend(fontsize=8)
    return figure_bytes(figure, suffix)


# ── surfaces ──────────────────────────────────────────────────────────────────────────────────────────────


class Surface(NamedTuple):
    """A surface: its points as a function of two parameters within 0..1."""

    points: Callable  # function of u, v (n,) to (n, 3)
    is_closed: tuple[bool, bool] = (False, False)  # whether the parameter 1 is 0 again


def _sphere(u, v):
    around, polar = 2.0 * np.pi * u, np.pi * (0.02 + 0.96 * v)  # without the poles, where quads would be slivers
    return np.stack([np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], axis=-1)


def _torus(u, v):
    around, tube = 2.0 * np.pi * u, 2.0 * np.pi * v
    radius = 1.0 + 0.4 * np.cos(tube)
    return np.stack([radius * np.cos(around), 0.4 * np.sin(tube), radius * np.sin(around)], axis=-1)


def _cylinder(u, v):
    around = 2.0 * np.pi * u
    return np.stack([np.cos(around), 2.0 * v - 1.0, np.sin(around)], axis=-1)


def _plane(u, v):
    return np.stack([2.0 * u - 1.0, 0.0 * u, 1.0 - 2.0 * v], axis=-1)


def _bezier(weights, t):
    """A cubic Bézier curve by Bernstein's polynomials."""
    s = 1.0 - t
    basis = np.stack([s**3, 3.0 * s**2 * t, 3.0 * s * t**2, t**3], axis=-1)
    return basis @ weights


def _teapot(u, v):
    """A bicubic patch of the teapot's body: a quarter of a turn, from the rim to the belly."""
    quarter = _bezier(np.array([(1.0, 0.0), (1.0, _ARC), (_ARC, 1.0), (0.0, 1.0)]), u)
    profile = _bezier(PROFILE, v)
    return np.stack([profile[:, 0] * quarter[:, 0], profile[:, 1], profile[:, 0] * quarter[:, 1]], axis=-1)


SURFACES = {
    "sphere": Surface(_sphere, (True, False)),
    "torus": Surface(_torus, (True, True)),
    "cylinder": Surface(_cylinder, (True, False)),
    "plane": Surface(_plane),
    "teapot patch": Surface(_teapot),
}


def make_mesh(name: str, n: int, material: rz.Material | None = None) -> rz.Mesh:
    """Make a mesh of n by n quads, two triangles each, with the surface's normals at its vertices."""
    surface = SURFACES[name]
    n_u, n_v = (n if is_closed else n + 1 for is_closed in surface.is_closed)
    u, v = (grid.ravel() for grid in np.meshgrid(np.arange(n_u) / n, np.arange(n_v) / n, indexing="ij"))
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    a, b = i * n_v + j, (i + 1) % n_u * n_v + j
    c, d = (i + 1) % n_u * n_v + (j + 1) % n_v, i * n_v + (j + 1) % n_v
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])
    return rz.Mesh(surface.points(u, v), faces, normals=normals_of(surface, u, v), material=material or rz.Material())


def normals_of(surface: Surface, u, v) -> np.ndarray:
    """Compute unit normals by central differences of the points; outwards where the surface has an outside."""
    along_u = surface.points(u + STEP, v) - surface.points(u - STEP, v)
    along_v = surface.points(u, v + STEP) - surface.points(u, v - STEP)
    normals = np.cross(along_v, along_u)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


if __name__ == "__main__":
    sys.exit(main())
