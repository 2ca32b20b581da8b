"""Check what faces count by where normals are averaged: by hand on a box, on load, in pictures, by the reference."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.engine.points import gather_geometry
from rasterizer.errors import SceneError

# A box of 1 x 2 x 3, each side one polygon; at a corner three right angles meet, and areas of 2, 3 and 6.
CORNERS = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 3.0)])
SIDES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def box(weighting, **more):
    return rz.Mesh(CORNERS, SIDES, crease_angle=180, weighting=weighting, **more)


def normal_at(mesh, corner):
    geometry = gather_geometry(rz.Scene(mesh).meshes, False)
    (at,) = np.flatnonzero((geometry.points == corner).all(axis=1))
    return geometry.normals[at].T


def test_areas_and_numbers_of_triangles_by_hand():
    for weighting in ("area", "uniform"):
        mesh, n_other = box(weighting), 0
        for corner in CORNERS:
            expected = np.zeros(3)
            for face in mesh.faces:
                points = mesh.vertices[face]
                if (points == corner).all(axis=1).any():
                    vector = np.cross(points[1] - points[0], points[2] - points[0])
                    expected += vector if weighting == "area" else vector / np.linalg.norm(vector)
            assert normal_at(mesh, corner) == pytest.approx(expected / np.linalg.norm(expected), abs=1e-15), weighting
            n_other += not np.allclose(normal_at(mesh, corner), normal_at(box("angle"), corner))
        assert n_other >= 4, weighting


def test_it_stays_when_a_mesh_is_changed():
    mesh = box("area")
    assert mesh.transformed(np.diag([2, 3, 1, 1])).weighting == "area"
    finer = mesh.subdivide()
    assert finer.weighting == "area"
    (at,) = np.flatnonzero((finer.vertices[finer.faces].reshape(-1, 3) == CORNERS[7]).all(axis=1))[:1]
    normals = finer.normals if finer.normals.ndim == 3 else finer.normals[finer.faces]
    assert normals.reshape(-1, 3)[at] == pytest.approx(normal_at(mesh, CORNERS[7]), abs=1e-12)
    assert replace(mesh, weighting="uniform").weighting == "uniform"


def test_on_load():
    assert [mesh.weighting for mesh in rz.load(ROOT / "models" / "cube.obj").meshes] == ["angle"]
    assert [mesh.weighting for mesh in rz.load(ROOT / "models" / "cube.obj", weighting="area").meshes] == ["area"]
    assert rz.load(box("area")).meshes[0].weighting == "area"
    assert rz.load(box("area"), weighting="angle").meshes[0].weighting == "angle"
    scene = rz.load(ROOT / "models" / "room.json", weighting="uniform")
    assert {mesh.weighting for mesh in scene.meshes} == {"uniform"}
    assert {mesh.weighting for mesh in rz.load(scene, weighting="area").meshes} == {"area"}


def test_another_word_is_refused():
    with pytest.raises(SceneError, match="weighting must be one of 'angle', 'area', 'uniform'; given 'size'"):
        box("size")
    with pytest.raises(SceneError, match="weighting"):
        rz.load(ROOT / "models" / "cube.obj", weighting="size")
