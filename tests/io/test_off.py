"""OFF: what its first words, lines, colours and polygons mean, and what is refused."""

import numpy as np
import pytest
from helpers.model_bytes import box, exported
from helpers.refusals import assert_refused
from helpers.solids import area_of

import rasterizer as rz

POINTS = ("0 0 0", "8 0 0", "8 2 0", "2 2 0", "2 8 0", "0 8 0")
ELL = "\n".join(POINTS) + "\n"
RED, GREEN = [255, 0, 0], [0, 255, 0]


def one(text, **options):
    (mesh,) = rz.load(text.encode(), format="off", **options).meshes
    return mesh


HEADS = (
    "OFF\n6 1 0\n",
    "OFF 6 1 0\n",
    "OFF6 1\n",
    "# OFF\nOFF # d\n# e\n6 1 # f\n",
    "OFF\r\n\r\n6 1 0\r\n",
    " \n\tOFF 6 1 0\n",
)
QUADS = "4 0 1 2 3\n4 0 3 4 5\n", "4 0 1 2 3 4 0 3 4 5", "4 0\n1 2\n3 4 0 3 4 5\n", "4 0 1\n2 3\n4 0 3 4 5"


@pytest.mark.parametrize("head", HEADS)
def test_heads_and_comments_of_a_concave_polygon(head):
    mesh = one(head + ELL + "6 0 1 2 # the ell\n3 4 5\n")
    assert mesh.n_face == 4 and abs(area_of(mesh) - 28) < 1e-12 and (mesh.polygons == 0).all()


@pytest.mark.parametrize("faces", QUADS)
@pytest.mark.parametrize("is_line", [False, True])
def test_lines_do_not_count(faces, is_line):
    text = f"OFF\n6 2 0\n{ELL}{faces}"
    mesh = one(text.replace("\n", " ") if is_line else text)
    assert mesh.n_face == 4 and abs(area_of(mesh) - 28) < 1e-12


def test_what_letters_of_the_head_say():
    def rows(more):
        return "".join(f"{point} {more}\n" for point in POINTS)

    for head, more, keys in (
        ("NOFF", "0 0 2", ["normals"]), ("COFF", "255 0 0 255", ["colors"]), ("COFF", "1.0 0 0", ["colors"]),
        ("CNOFF", "0 0 1 255 0 0", ["normals", "colors"]), ("STOFF", "0.25 0.5", ["uv"]),
        ("STCNOFF", "0 0 1 1 0 0 1 0.25 0.5", ["normals", "colors", "uv"]), ("OFF", "255 0 0", ["colors"]),
        ("4OFF", "2", []), ("ST4OFF", "2 0.25 0.5", ["uv"]),
    ):  # fmt: skip
        mesh = one(f"{head}\n6 1 0\n{rows(more)}6 0 1 2 3 4 5\n")
        assert [key for key in ("normals", "colors", "uv") if getattr(mesh, key) is not None] == keys, head
        assert abs(area_of(mesh) * (4 if "4" in head else 1) - 28) < 1e-12, head
        assert mesh.normals is None or (mesh.normals == (0, 0, 1)).all(), head
        assert mesh.colors is None or (mesh.colors[:, :3] == (1, 0, 0)).all(), head
        assert mesh.uv is None or (mesh.uv == (0.25, 0.5)).all(), head
    # All on one line a colour has four numbers, as the format has it.
    assert (one(f"COFF 6 1 0 {rows('255 0 0 255')} 6 0 1 2 3 4 5".replace("\n", " ")).colors[:, 0] == 1).all()


def test_colours_of_faces():
    head, white = f"OFF\n6 2 0\n{ELL}", [255, 255, 255]
    for first, second, expected in (
        (" 255 0 0", " 0 255 0", [RED, GREEN]), (" 255 0 0 255", " 0 255 0 255", [RED, GREEN]),
        (" 1.0 0 0", " 0 1.0 0", [RED, GREEN]), (" 1 0 0 1", " 0 1 0 1", [RED, GREEN]), (" 255 0 0", "", [RED, white]),
    ):  # fmt: skip
        for split in ("4 0 1 2 3", "4 0 1\n2 3"):
            mesh = one(f"{head}{split}{first}\n4 0 3 4 5{second}\n")
            same = one(f"{head}4 0 1 2 3\n4 0 3 4 5\n")
            expected_colors = rz.srgb(np.repeat(expected, 2, axis=0))
            assert np.allclose(mesh.face_colors[:, :3], expected_colors) and mesh.n_face == same.n_face == 4, first
    with pytest.warns(UserWarning, match="indices of colours"):
        assert one(f"{head}4 0 1 2 3 7\n4 0 3 4 5 8\n").face_colors is None


def test_boxes_that_trimesh_writes_come_back():
    mesh = one(exported(box(), "off").decode())
    assert mesh.n_face == 12 and np.allclose(mesh.bounds, [[-0.5, -1, -1.5], [0.5, 1, 1.5]])


def test_what_is_no_off_file_is_refused():
    head = "OFF\n6 1 0\n"
    assert_refused(one, [
        ("6 1 0\n" + ELL + "6 0 1 2 3 4 5\n", "'OFF' is missing"),
        ("OFF\n3 -1 0\n0 0 0\n", "'3 -1 0' does not say how many"),
        ("OFF\n999999999 999999999 0\n0 0 0\n", "the header promises 999999999 vertices"),
        ("OFF\n6 2 0\n" + ELL + "3 0 1 2\n", "promises 6 vertices and 2 faces, the file has 6 and 1"),
        (head + ELL + "3 0 1 6\n", "refers to vertex 6"),
        (head + ELL + "3 0 1 two\n", "9: 'two' is not a number"),
        (head + ELL.replace("8 2 0", "8 y 0") + "3 0 1 2\n", "5: 'y' is not a number"),
        (head + ELL.replace("8 2 0", "nan 2 0") + "3 0 1 2\n", "1 of 6 vertices"),
        ("OFF\n6 0 0\n" + ELL, "a point cloud: 6 points, no faces"),
        ("nOFF\n3 3 1 0\n", "nOFF, which is not read"),
        ("OFF BINARY\n\0\0\0", "binary OFF, which is not read"),
    ], rz.ModelError, "model")  # fmt: skip
