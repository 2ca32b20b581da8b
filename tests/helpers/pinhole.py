"""Pinhole geometry written down a second time, small models, and a short way to render them: help for tests.

The cameras stand at the origin and look down -z, so that rays and places can be computed by hand.
"""

import numpy as np

from rasterizer.reference import render
from rasterizer.scene.camera import Camera
from rasterizer.scene.lights import AmbientLight
from rasterizer.scene.material import Material
from rasterizer.scene.mesh import Mesh
from rasterizer.scene.scene import Scene

WHITE = (AmbientLight(1.0),)  # shows the albedo times ka, whichever way a surface faces
ALBEDO = Material(ambient=1.0, diffuse=0.0, specular=0.0)
DULL = Material(diffuse=0.7, specular=0.0)
SHADINGS = ("flat", "gouraud", "phong")
SIZE = (40, 30)
QUAD = np.array([[0, 3, 2], [0, 2, 1]])  # over the corners of `layer`, counter-clockwise for the viewer


def eye_camera(**options):
    """A perspective camera whose pixels are `height / 2` wide at depth 1."""
    return Camera.perspective((0, 0, 0), (0, 0, -1), fov=90, **options)


def sheet_camera(height, **options):
    """An orthographic camera; one scene unit is one pixel, the origin is in the middle of the picture."""
    return Camera.orthographic((0, 0, 0), (0, 0, -1), height=height, **options)


def at_pixel(size, x_px, y_px, depth, is_perspective=True):
    """Return the world point that `eye_camera` (or `sheet_camera(size[1])`) shows at a place."""
    spread = depth / (size[1] / 2) if is_perspective else 1.0
    return [(x_px - size[0] / 2) * spread, (size[1] / 2 - y_px) * spread, -depth]


def sample_rays(size):
    """Return (h, w, 3) directions of `eye_camera` through the pixel centres, of depth 1."""
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    half = size[1] / 2
    return np.stack([(x - size[0] / 2) / half, (half - y) / half, -np.ones_like(x)], axis=-1)


def draw(
    vertices,
    faces,
    size,
    camera=None,
    lights=WHITE,
    material=ALBEDO,
    shading="gouraud",
    background=None,
    samples=1,
    cull="auto",
    color_range="clamp",
    near=None,
    far=None,
    **mesh_options,
):
    """Render one mesh with `eye_camera`, or another."""
    mesh = Mesh(np.array(vertices, float), np.array(faces), material=material, **mesh_options)
    scene = Scene([mesh], lights=lights, camera=camera or eye_camera(), background=background)
    options = {"shading": shading, "samples": samples, "cull": cull, "color_range": color_range}
    return render(scene, size, near=near, far=far, **options)


def unit(vector):
    """Return vectors (..., 3) at length 1."""
    return np.asarray(vector) / np.linalg.norm(vector, axis=-1, keepdims=True)


def octasphere(n_split):
    """Return vertices on the unit sphere and faces, counter-clockwise seen from outside."""
    corners = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    triangles = corners[faces]
    for _ in range(n_split):
        a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
        ab, bc, ca = unit(a + b), unit(b + c), unit(c + a)
        triangles = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    vertices, faces = np.unique(triangles.reshape(-1, 3).round(12), axis=0, return_inverse=True)
    return unit(vertices), faces.reshape(-1, 3)


def torus(n_around, n_through):
    """Return vertices and faces of a closed ring that hides parts of itself."""
    u, v = np.meshgrid(np.arange(n_around), np.arange(n_through), indexing="ij")
    a, b = 2 * np.pi * u / n_around, 2 * np.pi * v / n_through
    radius = 1 + 0.4 * np.cos(b)
    vertices = np.stack([radius * np.cos(a), radius * np.sin(a), 0.4 * np.sin(b)], axis=-1).reshape(-1, 3)

    def index(i, j):
        return (i % n_around) * n_through + j % n_through

    quad = index(u, v), index(u + 1, v), index(u + 1, v + 1), index(u, v + 1)
    return vertices, np.concatenate([np.stack([quad[k].ravel() for k in t], 1) for t in ((0, 1, 2), (0, 2, 3))])


def tilted(is_perspective):
    """Return a triangle with vertices on whole pixels, which need no rounding, and its plane n.p = d."""
    places = (((2, 3), 2.0), ((37, 8), 7.0), ((11, 28), 4.0))
    points = np.array([at_pixel(SIZE, *place, depth, is_perspective) for place, depth in places])
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    return points, normal, normal @ points[0]


def layer(size, depth, is_perspective=True):
    """Return the four corners of a sheet across the whole picture and beyond it, at one depth."""
    width, height = size
    places = ((-9, -9), (width + 9, -9), (width + 9, height + 9), (-9, height + 9))
    return [at_pixel(size, *place, depth, is_perspective) for place in places]
