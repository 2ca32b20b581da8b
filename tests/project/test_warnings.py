"""Warnings point at the line outside of the package that led to them, through every public door."""

import json
import subprocess
import sys
import warnings
from dataclasses import replace

import numpy as np

import rasterizer as rz

BOW = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 2, 0]], float)  # a polygon that crosses itself
OBJ = b"mtllib none.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def quiet_bow():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return rz.Mesh(BOW, [[0, 1, 2, 3]])


def doors(path, scene):
    """Calls that warn, each on one line of this file."""
    return {
        "load": lambda: rz.load(path),
        "load bytes": lambda: rz.load(OBJ, format="obj"),
        "render": lambda: rz.render(path, 8),
        "Renderer": lambda: rz.Renderer(path, 8),
        "explain": lambda: rz.explain(path, 4, 4, 8),
        "load a scene file": lambda: rz.load(scene),
        "Mesh": lambda: rz.Mesh(BOW, [[0, 1, 2, 3]]),
        "Mesh.from_any": lambda: rz.Mesh.from_any((BOW, [[0, 1, 2, 3]])),
        "Scene": lambda: rz.Scene((BOW, [[0, 1, 2, 3]])),
        "render arrays": lambda: rz.render((BOW, [[0, 1, 2, 3]]), 8),
        "replace": lambda: replace(quiet_bow(), faces=[[0, 1, 2, 3]], polygons=None),
    }


def test_a_warning_points_at_the_line_of_the_call(tmp_path):
    (tmp_path / "x.obj").write_bytes(OBJ)
    (tmp_path / "x.json").write_text(json.dumps({"meshes": [{"file": "x.obj"}]}))
    for name, call in doors(tmp_path / "x.obj", tmp_path / "x.json").items():
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            call()
        assert caught, f"{name}: nothing was warned of"
        for warning in caught:
            assert warning.category is UserWarning, name
            place = warning.filename, warning.lineno
            assert place == (__file__, call.__code__.co_firstlineno), f"{name}: {warning.message}"


def test_a_program_is_shown_its_own_line(tmp_path):
    """As Python prints it, without any frame of a test runner above."""
    (tmp_path / "x.obj").write_bytes(OBJ)
    program = tmp_path / "program.py"
    program.write_text("import rasterizer as rz\n\nrz.load('x.obj')\n")
    done = subprocess.run([sys.executable, program], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr.startswith(f"{program}:3: UserWarning: x.obj: material file 'none.mtl' not found")
    assert "rz.load('x.obj')" in done.stderr
