"""Smooth surfaces given by formulas, and meshes of them as coarse or fine as one likes, with the surface's own normals.

A mesh that is fine enough stands for the surface itself: errors of Phong's picture fall with the square of the edges,
and are 256 times as small at FINEST quads along a side as at 64.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

import rasterizer as rz

FINEST = 1024  # quads along each side
STEP = 1e-5  # of parameters, for derivatives

# The profile of a teapot's body, radius and height, as a Bézier curve. Source: the data set of M. Newell 1975, as in
# F. Crow 1987, "The Origins of the Teapot", IEEE Computer Graphics and Applications 7(1).
PROFILE = np.array([(1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)])
_ARC = 0.551915  # of a circle's radius: the handles of a cubic Bézier curve for a quarter


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
