"""Files that other programs read, though they are not quite legal: drawn, and what is done about it is said."""

import warnings

import pytest
from helpers.model_bytes import CORE, PLY_HEADER, threemf

import rasterizer as rz

ROWS = PLY_HEADER.format(n_face=1, face_properties="property uchar red\n")


def test_rows_of_ply_with_more_values_than_the_header_names():
    vertices = ROWS.replace("0 0 0\n1 0 0", "0 0 0 7 7\n1 0 0 7")
    for text in (ROWS + "3 0 1 2 9 5 5 5 5\n", vertices + "3 0 1 2 9\n", ROWS + "3 0 1 2 9 3 0\n"):
        with pytest.warns(UserWarning, match="rows hold more values than the header names: these are left out"):
            (mesh,) = rz.load(text.encode(), format="ply").meshes
        assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], text
        assert mesh.faces.tolist() == [[0, 1, 2]], text
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        broken = ROWS.replace("1 0 0\n1 1 0", "1 0\n0 1 1 0")  # rows need no lines of their own
        assert rz.load((broken + "3 0 1\n2 9").encode(), format="ply").n_face == 1


def test_elements_of_ply_without_rows():
    head = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
    edges = "element edge 0\nproperty int vertex1\nproperty int vertex2\n"
    face = "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
    text = head.format(3) + edges + face.format(1) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    assert rz.load(text.encode(), format="ply").n_face == 1
    for order in ("ascii", "binary_little_endian"):
        for empty in (head.format(0) + face.format(0), head.format(0) + edges + face.format(0)):
            with pytest.raises(rz.ModelError, match="^model: no faces$"):
                rz.load(empty.replace("ascii", order).encode(), format="ply")


def test_a_3mf_file_whose_only_color_is_invisible_is_drawn_opaque():
    points = "".join(f'<vertex x="{x}" y="{y}" z="0"/>' for x, y in ((0, 0), (1, 0), (0, 1)))
    mesh = f'<mesh><vertices>{points}</vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>'
    base = '<basematerials id="1"><base name="a" displaycolor="#FF000000"/></basematerials>'
    shape = f'<object id="2" pid="1" pindex="0" type="model">{mesh}</object>'
    head, build = f'<model unit="millimeter" xmlns="{CORE}"><resources>', '<build><item objectid="2"/></build></model>'
    text = f"{head}{base}{shape}</resources>{build}"
    with pytest.warns(UserWarning, match="opacity 0: drawn as if they were opaque"):
        (mesh,) = rz.load(threemf(text), format="3mf").meshes
    assert mesh.material.opacity == 1.0 and mesh.material.diffuse[0] == 1.0
