"""How does the error fall with the number of triangles, and what is better: finer meshes or a dearer shading?

    python bench/refinement.py                                         surfaces x shadings x meshes: some minutes
    python bench/refinement.py sphere --quads 8 16 32

Meshes of surfaces that formulas give, coarse to fine, are compared with the surface itself, each shading with Phong's
picture of the finest mesh, with one thread. Theory says that errors fall with a power of the edges' length: flat
shading 1, as its light is that of one point of a face; Gouraud's and Phong's methods 2, as linear interpolation leaves
what bends.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
import rasterizer as rz
from bench import measure, scenes
from rasterizer.analysis.comparison import root_mean_square

LIGHTS = (rz.AmbientLight(0.1), rz.DirectionalLight((-0.5, -0.6, -1.0), 0.8, attached="camera"))
MATERIAL = rz.Material(specular=0.3, shininess=20.0)
# Quads along each side of a mesh that stands for the surface itself: errors of Phong's picture fall with the square of
# the edges, and are 256 times as small as at 64.
FINEST = 1024
STEP = 1e-5  # of parameters, for derivatives

# The profile of a teapot's body, radius and height, as a Bézier curve. Source: the data set of M. Newell 1975, as in
# F. Crow 1987, "The Origins of the Teapot", IEEE Computer Graphics and Applications 7(1).
PROFILE = np.array([(1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)])
_ARC = 0.551915  # of a circle's radius: the handles of a cubic Bézier curve for a quarter


def add_arguments(parser) -> None:
    """Describe the command line."""
    add, names = parser.add_argument, tuple(SURFACES)
    add("surfaces", nargs="*", default=names, metavar="SURFACE", help=", ".join(names))
    add("--quads", nargs="+", type=int, default=(4, 8, 16, 32, 64, 128, 256), help="along each side of the meshes")
    add("--finest", type=int, default=FINEST, help="of the surface itself (default: %(default)s)")
    add("--size", type=scenes.size_of, default=(512, 512), help="default: 512x512")
    add("--frames", type=int, default=15, help="most warm frames of each row (default: %(default)s)")
    add("--seconds", type=float, default=4.0, help="time limit of a surface's frames (default: %(default)s)")


def measure_surfaces(args):
    """Yield a row for each surface, shading and mesh."""
    for name in args.surfaces:
        finest = make_mesh(name, args.finest, MATERIAL)
        camera = rz.Camera.framing(finest, fov=scenes.FOV, margin=scenes.MARGIN)
        truth = draw(rz.Scene([finest], LIGHTS, camera), args.size, shading="phong", tolerance=0.0)
        of_n = {n: rz.Scene([make_mesh(name, n, MATERIAL)], LIGHTS, camera) for n in args.quads}
        pictures = {(shading, n): (scene, args.size, {"shading": shading})
                    for shading in measure.SHADINGS for n, scene in of_n.items()}  # fmt: skip
        ms = measure.medians(pictures, args.seconds, args.frames)
        for shading, n in pictures:
            error = errors(draw(of_n[n], args.size, shading=shading), truth)
            yield {"surface": name, "shading": shading, "triangles": of_n[n].n_face, "quads": n,
                   "ms": ms[shading, n], "rms": root_mean_square(error), "max": float(error.max())}  # fmt: skip


def draw(scene, size, **options):
    """Draw a scene with its colours, depths and coverage."""
    return rz.render(scene, size, outputs=("color", "depth"), threads=1, samples=1, **options)


def errors(frame, truth) -> np.ndarray:
    """Differences of colours where both cover a pixel, and show the same part of the surface."""
    with np.errstate(invalid="ignore"):
        is_same = np.abs(frame.depth - truth.depth) < 0.1 * np.ptp(truth.depth[np.isfinite(truth.depth)]) + 1e-3
    return np.abs(frame.color - truth.color)[is_same & (frame.alpha > 0) & (truth.alpha > 0)]


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


main = measure.script("refinement", __doc__, add_arguments, measure_surfaces)

if __name__ == "__main__":
    sys.exit(main())
