"""Scenes measured in pixels and sub-pixels, and a process of one's own: help for the pipeline's tests."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

import rasterizer as rz

ROOT = Path(__file__).resolve().parents[2]
GREY = (rz.AmbientLight(0.1), rz.DirectionalLight((-0.4, -0.5, -0.8), 0.8))
COLORED = (
    rz.AmbientLight((0.1, 0.05, 0.02)),
    rz.DirectionalLight((-0.4, -0.5, -0.8), (0.5, 0.6, 0.2)),
    rz.PointLight((2, 3, 3), (0.3, 0.2, 0.4), (1, 0.1, 0.05)),
)


def draw_faces(points, size, depth=None, **options):
    """Draw triangles (n, 3, 2), integer vertices in 1/256 px, depths (n, 3) within 0..1; return (h, w) faces.

    Orthographic, one unit a pixel: coordinates are multiples of 1/256, so that float64 places them without
    rounding. A face outside the picture goes along, because a mesh in which nothing has area is refused.
    """
    points = np.asarray(points, np.int64).reshape(-1, 3, 2)
    points = np.concatenate([points, [[(-900, -900), (-600, -900), (-900, -600)]]])
    depth = 0.5 if depth is None else np.append(np.reshape(depth, -1), [0.5] * 3)
    faces = np.arange(3 * len(points)).reshape(-1, 3)
    normals = np.tile([0.0, 0.0, 1.0], (3 * len(points), 1))
    scene = sheet(size, points.reshape(-1, 2) / 256, 1.0 + depth, faces, normals=normals)
    return rz.render(scene, size, outputs=("face",), **{"samples": 1} | options).face


def sheet(
    size,
    points,
    depth,
    faces,
    lights=GREY,
    is_perspective=False,
    near=None,
    far=None,
    background=None,
    **mesh,
):
    """A scene given by places in the picture (n, 2), in pixels, and depths (n,).

    Depths may be a number; the camera stands at the origin and looks down -z; orthographic: one unit a pixel.
    """
    width, height = size
    points = np.asarray(points, float)
    depth = np.broadcast_to(np.asarray(depth, float), len(points))
    spread = depth / (height / 2) if is_perspective else np.ones(len(points))
    vertices = np.stack([(points[:, 0] - width / 2) * spread, (height / 2 - points[:, 1]) * spread, -depth], axis=1)
    lens = {"fov": 90} if is_perspective else {"height": height}
    make = rz.Camera.perspective if is_perspective else rz.Camera.orthographic
    camera = make((0, 0, 0), (0, 0, -1), near=near, far=far, **lens)
    return rz.Scene([rz.Mesh(vertices, faces, **mesh)], lights, camera, background)


def assert_runs(program: str) -> None:
    """Run a program in a process of its own, because a fault in compiled code would end the tests."""
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=ROOT / "tests",
        env=_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"ended with {done.returncode}: {(done.stderr or done.stdout)[-1500:]}"


def _environment():
    return {**os.environ, "PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}"}
