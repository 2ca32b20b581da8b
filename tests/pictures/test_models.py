"""Tests of the committed models: reproducible, small, wound outwards, closed where they should be."""

import importlib.util
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

MODELS = Path(__file__).parents[2] / "models"
CLOSED = ("sphere", "torus", "cube", "cylinder", "cone", "gear")
OPEN = ("teapot", "sawtooth", "floor")


@pytest.fixture(scope="module")
def maker():
    """Load make_models.py by path, with its folder importable for as long as that takes."""
    spec = importlib.util.spec_from_file_location("make_models", MODELS / "make_models.py")
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(MODELS))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(MODELS))
    return module


def read_obj(name):
    """Read points (n, 3) and zero-based faces of a committed OBJ."""
    lines = [line.split() for line in (MODELS / f"{name}.obj").read_text().splitlines()]
    points = np.array([line[1:] for line in lines if line[:1] == ["v"]], dtype=float)
    return points, [tuple(int(i.split("/")[0]) - 1 for i in line[1:]) for line in lines if line[:1] == ["f"]]


def directed_edges(faces):
    return Counter((face[k - 1], face[k]) for face in faces for k in range(len(face)))


def fan(faces):
    return np.array([(face[0], face[k], face[k + 1]) for face in faces for k in range(1, len(face) - 1)])


def area_vectors(points, triangles):
    a, b, c = points[triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a) / 2


def volume(points, faces):
    triangles = fan(faces)
    return (points[triangles[:, 0]] * area_vectors(points, triangles)).sum() / 3


def assert_closed(points, faces):
    """Every edge is used once in each direction, and the faces look outwards."""
    edges = directed_edges(faces)
    assert set(edges.values()) == {1}
    assert [(p, q) for p, q in edges if (q, p) not in edges] == []
    assert volume(points, faces) > 0


def test_files_are_what_the_script_makes(maker):
    for name, data in maker.model_files().items():
        assert (MODELS / name).read_bytes() == data, f"{name} differs from what make_models.py makes"


def test_no_file_is_left_over(maker):
    suffixes = {".obj", ".mtl", ".ply", ".stl", ".glb", ".png"}
    assert {path.name for path in MODELS.iterdir() if path.suffix in suffixes} == set(maker.model_files())


@pytest.mark.parametrize("name", CLOSED + OPEN)
def test_points_and_faces_are_sound(name):
    """Triangles of a polygon's fan face the same way, so it is convex enough for every loader."""
    points, faces = read_obj(name)
    assert {i for face in faces for i in face} == set(range(len(points))), "a point is missing or unused"
    assert len({tuple(point) for point in points.tolist()}) == len(points), "two points are the same"
    assert max(directed_edges(faces).values()) == 1, "neighbours are wound differently"
    assert np.linalg.norm(area_vectors(points, fan(faces)), axis=1).min() > 1e-5
    for face in {len(face): face for face in faces}.values() if name == "teapot" else faces:
        normals = area_vectors(points, fan([face]))
        assert (normals @ normals.sum(axis=0)).min() > 0, f"the fan of {face} folds"
    if name in CLOSED:
        assert_closed(points, faces)
