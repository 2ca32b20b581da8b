"""bench/refinement.py: surfaces lie where formulas say, and errors fall as theory says."""

import io
import json

import numpy as np
import pytest
from helpers import true_surfaces
from PIL import Image

import rasterizer as rz
from bench import refinement, surfaces


@pytest.mark.parametrize("name", surfaces.SURFACES)
def test_normals_are_those_of_the_surface(name):
    """Unit, upright on both directions of the surface, on the side of the triangles' front; the mesh is closed."""
    mesh = surfaces.make_mesh(name, 24)
    assert np.abs(np.linalg.norm(mesh.normals, axis=1) - 1).max() < 1e-12 and mesh.n_face == 2 * 24**2
    corners = mesh.vertices[mesh.faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    cosine = np.einsum("ij,ij->i", area, mesh.normals[mesh.faces[:, 0]]) / np.linalg.norm(area, axis=1)
    assert cosine.min() > 0.9, cosine.min()


def test_points_lie_on_the_sphere_torus_and_cylinder():
    for name, distance in (("sphere", lambda x, y, z: np.sqrt(x**2 + y**2 + z**2) - 1),
                           ("torus", lambda x, y, z: np.hypot(np.hypot(x, z) - 1, y) - 0.4),
                           ("cylinder", lambda x, y, z: np.hypot(x, z) - 1)):  # fmt: skip
        assert np.abs(distance(*surfaces.make_mesh(name, 32).vertices.T)).max() < 1e-12, name


def test_the_finest_mesh_stands_for_the_surface():
    """Against rays that meet the torus itself, the finest mesh is off by its rounding alone."""
    scene = rz.Scene([surfaces.make_mesh("torus", 512, rz.Material())], rz.studio())
    size = (48, 36)
    frame = rz.render(scene, size, shading="phong", tolerance=0, outputs=("color", "depth"))
    truth = true_surfaces.draw("torus", scene, size, 1)
    truth_depth = np.where(np.isfinite(truth.nearest), truth.nearest, 0.0)
    is_inner = (truth.alpha == 1) & (frame.alpha == 1) & (np.abs(frame.depth - truth_depth) < 0.05)
    assert is_inner.sum() > 300 and np.abs(frame.color - truth.color)[is_inner].max() < 2e-3
    rms = np.sqrt(np.mean((frame.color - truth.color)[is_inner] ** 2))
    assert rms < 1e-4, rms


def test_errors_fall_as_theory_says(capsys):
    arguments = ["teapot patch", "--quads", "16", "32", "64", "--finest", "512", "--size", "160", "--seconds", "0.1"]
    assert refinement.main(arguments) == 0
    record = json.loads(capsys.readouterr().out.splitlines()[-1])
    rows = record["rows"]
    assert record["bench"] == "refinement" and len(rows) == 3 * 3
    for shading in refinement.SHADINGS:
        slope = refinement.last_slopes(rows, shading)[0]
        assert slope == pytest.approx(refinement.THEORY[shading], abs=0.1), (shading, slope)
    by = {(row["shading"], row["quads"]): row["rms"] for row in rows}
    assert all(by["flat", n] > by["gouraud", n] > by["phong", n] for n in (16, 32, 64))
    assert any(row["is_best"] for row in rows) and all(row["ms"] > 0 for row in rows)


def test_a_plane_has_no_error_and_no_slope(capsys):
    assert refinement.main(["plane", "--quads", "4", "8", "--finest", "16", "--size", "64", "--seconds", "0.1"]) == 0
    rows = json.loads(capsys.readouterr().out.splitlines()[-1])["rows"]
    assert all(row["rms"] < 1e-6 and "slope" not in row for row in rows)


def test_plot(folder):
    pytest.importorskip("matplotlib")
    rows = [{"surface": "sphere", "shading": shading, "triangles": 2 * n * n, "quads": n, "rms": 1 / n, "ms": float(n)}
            for shading in refinement.SHADINGS for n in (4, 8, 16)]  # fmt: skip
    assert Image.open(io.BytesIO(refinement.plot(rows, ".png"))).height > 500
