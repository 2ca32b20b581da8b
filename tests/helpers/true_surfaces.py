"""The true picture of a sphere or torus: rays against the surface itself, lit by the reference's equation.

In: a scene whose one mesh approximates a surface known here. Out: what an endlessly fine mesh would show.
"""

from typing import NamedTuple

import numpy as np

from rasterizer.reference.light import Lighting
from rasterizer.reference.reflection import read_materials
from rasterizer.reference.shading import Fragments, light_samples
from rasterizer.reference.surface import Surface

RING, TUBE = 1.0, 0.4  # radii of the torus of models/make_models.py, about the y axis


class Truth(NamedTuple):
    """A picture of the surface itself."""

    color: np.ndarray  # (h, w, 3) float64, linear, mean over the covered samples
    alpha: np.ndarray  # (h, w) float64, covered share of the samples
    nearest: np.ndarray  # (h, w) float64, depth of the pixel's nearest sample, inf where one is empty
    furthest: np.ndarray  # (h, w) float64


def draw(surface: str, scene, size, samples: int) -> Truth:
    """Draw the surface with the scene's camera, lights and material, on the same samples as the renderer."""
    factor = round(samples**0.5)
    width, height = size[0] * factor, size[1] * factor
    camera = scene.camera_for(size)
    view, projection = camera.view(), camera.projection((width, height))
    x = (np.arange(width) + 0.5 - projection.center_x)[None, :, None] / projection.scale_x * view.right
    y = (projection.center_y - np.arange(height) - 0.5)[:, None, None] / projection.scale_y * view.up
    across = (x + y).reshape(-1, 3)
    if projection.is_perspective:
        origins, directions = view.eye, across + view.forward
    else:
        origins, directions = view.eye + across, view.forward
    depth = _first_hit(surface, *np.broadcast_arrays(origins, directions), view.forward)
    hit = np.flatnonzero(np.isfinite(depth))
    points = (np.broadcast_to(origins, across.shape) + depth[:, None] * directions)[hit]
    lighting = Lighting(view, projection, read_materials(scene), scene.lights, "phong")
    color = _light(points, _normals(surface, points), hit, depth[hit], (height, width), lighting)
    return _mean(color, depth.reshape(height, width), factor)


def _first_hit(surface: str, origins, directions, forward) -> np.ndarray:
    """Return the depths (n,) along `forward` at which rays first meet a surface, inf where they miss it."""
    length = np.linalg.norm(directions, axis=1)
    unit = directions / length[:, None]
    to_closest = -np.sum(origins * unit, axis=1)
    closest = origins + to_closest[:, None] * unit  # point of the ray that is nearest to the surface's centre
    squared = np.sum(closest**2, axis=1)
    hits = np.full(len(unit), np.inf)
    if surface == "sphere":
        inside = squared <= 1.0
        hits[inside] = -np.sqrt(1.0 - squared[inside])
    else:
        inside = squared <= (RING + TUBE) ** 2
        hits[inside] = _torus_hits(closest[inside], unit[inside], squared[inside])
    return (to_closest + hits) * (unit @ forward)


def _torus_hits(closest, unit, squared) -> np.ndarray:
    """Return the smallest distances t from the closest points to a torus, inf without one.

    A point p of the torus has (p.p + R^2 - r^2)^2 = 4 R^2 (x^2 + z^2); with p = c + t u and c.u = 0 this is
    a quartic in t without a cubic term. Its roots are the eigenvalues of its companion matrix.
    """
    k = squared + RING**2 - TUBE**2
    flat_c, flat_u = closest[:, [0, 2]], unit[:, [0, 2]]
    companion = np.zeros((len(k), 4, 4))
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    companion[:, 0, 3] = 4 * RING**2 * np.sum(flat_c**2, axis=1) - k**2
    companion[:, 1, 3] = 8 * RING**2 * np.sum(flat_c * flat_u, axis=1)
    companion[:, 2, 3] = 4 * RING**2 * np.sum(flat_u**2, axis=1) - 2 * k
    roots = np.linalg.eigvals(companion)
    # Where a ray touches the surface two roots meet, and rounding turns them by the root of its size.
    return np.where(np.abs(roots.imag) < 1e-7, roots.real, np.inf).min(axis=1, initial=np.inf)


def _normals(surface: str, points) -> np.ndarray:
    """Return the unit normals (n, 3) that point outwards."""
    if surface == "sphere":
        return points / np.linalg.norm(points, axis=1, keepdims=True)
    x, y, z = points.T
    radius = np.hypot(x, z)
    return np.stack([x * (1 - RING / radius), y, z * (1 - RING / radius)], axis=1) / TUBE


def _light(points, normals, sample, depth, shape, lighting) -> np.ndarray:
    """Light points (n, 3): to the reference each of them is a face of its own, seen in its first corner."""
    n = len(points)
    corners = np.broadcast_to(points[:, None], (n, 3, 3)), np.broadcast_to(normals[:, None], (n, 3, 3))
    faces = Surface(*corners, np.ones((n, 3, 3)), np.arange(n), np.zeros(n, np.int64))
    weights = np.broadcast_to(np.array([1.0, 0.0, 0.0]), (n, 3))
    fragments = Fragments(*np.divmod(sample, shape[1]), np.arange(n), np.ones(n, np.int64), weights, depth)
    return light_samples(faces, fragments, shape, lighting)[0]


def _mean(color, depth, factor: int) -> Truth:
    """Average the samples of each pixel."""
    height, width = depth.shape[0] // factor, depth.shape[1] // factor

    def blocks(values):
        return values.reshape(height, factor, width, factor, -1).swapaxes(1, 2).reshape(height, width, factor**2, -1)

    depth = blocks(depth)[..., 0]
    is_covered = np.isfinite(depth)
    total = blocks(color).sum(axis=2) / np.maximum(is_covered.sum(axis=2), 1)[..., None]
    return Truth(total, is_covered.mean(axis=2), depth.min(axis=2), depth.max(axis=2))
