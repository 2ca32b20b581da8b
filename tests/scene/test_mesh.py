"""Meshes: what is taken, what it becomes, what is refused."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.errors import ModelError, SceneError
from rasterizer.scene.material import Material
from rasterizer.scene.mesh import Mesh

TRIANGLE = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)])
SQUARE = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
TWO = np.array([(0, 1, 2), (0, 2, 3)])
PRISM = [(0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)]
PRISM_VERTICES = np.concatenate([TRIANGLE, TRIANGLE + (0, 0, 1)])


def area_vectors(mesh):
    """Return (n_face, 3) cross products of two edges."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return np.cross(b - a, c - a)


def test_stored_forms():
    mesh = Mesh(TRIANGLE.astype(np.float32), [(0, 1, 2)])
    assert mesh.vertices.dtype == np.float64 and mesh.faces.dtype == np.uint32
    assert (mesh.n_vertex, mesh.n_face, mesh.name, mesh.material) == (3, 1, "", Material())
    for field in ("normals", "colors", "uv", "face_colors", "polygons", "smoothing", "crease_angle"):
        assert getattr(mesh, field) is None
    assert repr(mesh) == "Mesh(3 vertices, 1 face)"
    assert repr(Mesh(SQUARE, [(0, 1, 2, 3)], name="s")) == "Mesh('s', 4 vertices, 2 faces, polygons)"


@pytest.mark.parametrize("dtype", [np.int8, np.int16, np.int32, np.int64, np.uint8, np.uint32, np.uint64, ">i4"])
def test_any_integer_dtype(dtype):
    assert np.array_equal(Mesh(SQUARE, TWO.astype(dtype)).faces, TWO)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.int64, np.uint8, ">f8"])
def test_any_real_vertices(dtype):
    assert np.array_equal(Mesh(SQUARE.astype(dtype), TWO).vertices, SQUARE)


def test_arrays_are_copied_read_only_and_the_callers_stay_writable():
    vertices, faces, normals = SQUARE.copy(), TWO.astype(np.uint32), np.full((4, 3), 2.0)
    mesh = Mesh(vertices, faces, normals, face_colors=np.ones((2, 3)))
    assert not np.shares_memory(mesh.vertices, vertices) and not np.shares_memory(mesh.faces, faces)
    for field in ("vertices", "faces", "normals", "face_colors", "bounds", "used_vertices"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(mesh, field)[0] = 0
    assert vertices.flags.writeable and faces.flags.writeable and normals.flags.writeable
    assert (normals == 2.0).all()


def test_strided_and_transposed_arrays_become_contiguous():
    mesh = Mesh(np.asfortranarray(SQUARE), TWO[:, ::-1])
    assert mesh.vertices.flags.c_contiguous and mesh.faces.flags.c_contiguous
    assert np.array_equal(mesh.faces, TWO[:, ::-1])


def test_quads_become_fans():
    mesh = Mesh(SQUARE, [(0, 1, 2, 3)])
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]] and mesh.polygons.tolist() == [0, 0]
    assert mesh.polygons.dtype == np.int32


@pytest.mark.parametrize("make", [list, lambda faces: [np.array(face) for face in faces]])
def test_ragged_polygons_become_fans(make):
    mesh = Mesh(PRISM_VERTICES, make(PRISM))
    assert mesh.polygons.tolist() == [0, 1, 2, 2, 3, 3, 4, 4]
    assert mesh.faces.tolist()[2:4] == [[0, 3, 4], [0, 4, 1]]
    array = np.empty(5, dtype=object)
    array[:] = PRISM
    assert np.array_equal(Mesh(PRISM_VERTICES, array).faces, mesh.faces)


@given(st.lists(st.integers(3, 7), min_size=1, max_size=8), st.randoms(use_true_random=False))
@settings(max_examples=50)
def test_fans_of_any_lengths(lengths, random):
    """Of polygons that are convex and plane: corners of a circle, in turn."""
    vertices = np.array([(math.cos(i * 0.7), math.sin(i * 0.7), 1) for i in range(9)])
    faces = [tuple(sorted(random.sample(range(9), n))) for n in lengths]
    faces = [face[turn:] + face[:turn] for face in faces for turn in [random.randrange(3)]]
    mesh = Mesh(vertices, faces)
    expected = [(f[0], f[i], f[i + 1]) for f in faces for i in range(1, len(f) - 1)]
    assert [tuple(face) for face in mesh.faces.tolist()] == expected
    owner = [i for i, n in enumerate(lengths) for _ in range(n - 2)]
    assert owner == (list(range(len(faces))) if mesh.polygons is None else mesh.polygons.tolist())


def test_attributes_of_polygons_go_to_their_triangles():
    colors = np.arange(15.0).reshape(5, 3)
    mesh = Mesh(PRISM_VERTICES, PRISM, face_colors=colors, smoothing=[5, 6, 7, 8, 9])
    assert np.array_equal(mesh.face_colors, colors[mesh.polygons])
    assert mesh.smoothing.tolist() == [5, 6, 7, 7, 8, 8, 9, 9] and mesh.smoothing.dtype == np.int32
    mesh = Mesh(PRISM_VERTICES, PRISM, face_colors=np.arange(24.0).reshape(8, 3), smoothing=range(8))
    assert mesh.face_colors[:, 0].tolist() == list(range(0, 24, 3))
    assert mesh.smoothing.tolist() == list(range(8))


def test_polygons_of_triangles_may_be_given():
    mesh = Mesh(SQUARE, TWO, np.ones((2, 3, 3)), polygons=[7, 7], smoothing=[1, 1])
    assert mesh.polygons.tolist() == [7, 7] and mesh.normals.shape == (2, 3, 3)
    again = replace(mesh, name="again")
    assert again.polygons.tolist() == [7, 7] and again.name == "again"


def test_normals_become_unit_length():
    normals = [(0, 0, 3), (1e-200, 0, 1e-200), (0, 1e200, 1e200), (0, 0, 0)]
    root = math.sqrt(0.5)
    mesh = Mesh(SQUARE, TWO, normals)
    assert mesh.normals == pytest.approx(np.array([(0, 0, 1), (root, 0, root), (0, root, root), (0, 0, 1)]))
    corners = np.random.default_rng(0).normal(size=(2, 3, 3))
    mesh = Mesh(SQUARE, TWO, corners)
    assert mesh.normals == pytest.approx(corners / np.linalg.norm(corners, axis=2, keepdims=True))


def test_colours_are_linear():
    mesh = Mesh(SQUARE, TWO, colors=np.full((4, 4), 128, dtype=np.uint8))
    assert mesh.colors[0] == pytest.approx((0.2158605, 0.2158605, 0.2158605, 128 / 255))
    floats = np.full((4, 3), 0.5, dtype=np.float32)
    assert (Mesh(SQUARE, TWO, colors=floats).colors == 0.5).all()
    assert Mesh(SQUARE, TWO, face_colors=np.zeros((2, 3), dtype=np.uint8)).face_colors.dtype == np.float64


def test_uv_by_vertex_or_corner():
    assert Mesh(SQUARE, TWO, uv=SQUARE[:, :2]).uv.shape == (4, 2)
    assert Mesh(SQUARE, TWO, uv=np.zeros((2, 3, 2))).uv.shape == (2, 3, 2)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"vertices": []}, "no vertices"),
        ({"vertices": np.empty((0, 3))}, "no vertices"),
        ({"vertices": None}, "vertices must be an array of numbers"),
        ({"vertices": SQUARE[:, :2]}, r"vertices must have the shape \(n, 3\); given \(4, 2\)"),
        ({"vertices": [(0, 0, 0), (1, 2)]}, "vertices must be an array of numbers"),
        ({"vertices": SQUARE + 1j}, "vertices must be an array of numbers"),
        ({"vertices": SQUARE > 0}, "vertices must be an array of numbers"),
        ({"vertices": [["a", "b", "c"]]}, "vertices must be an array of numbers"),
        ({"vertices": SQUARE.astype(object)}, "vertices must be an array of numbers; given objects: "),
        ({"vertices": np.ma.masked_equal(SQUARE, 0)}, "vertices must be numbers, none of them masked"),
        ({"faces": []}, "no faces"),
        ({"faces": np.empty((0, 3), dtype=int)}, "no faces"),
        ({"faces": None}, "faces must be"),
        ({"faces": [0, 1, 2]}, "faces must have the shape"),
        ({"faces": [(0, 1)]}, "at least 3 corners; face 0 has 2"),
        ({"faces": [(0, 1, 2), (0, 1)]}, "at least 3 corners; face 1 has 2"),
        ({"faces": [(0, 1, 2), ()]}, "at least 3 corners; face 1 has 0"),
        ({"faces": [(0, 1, 2), (0, 1, 2, "3")]}, "faces must be"),
        ({"faces": [(0, 1, 2), None]}, "faces must be"),
        ({"faces": TWO.astype(float)}, "faces must be integers"),
        ({"faces": [(0, 1, 2), (0, 1, 2, 3.0)]}, "faces must be integers"),
        ({"faces": TWO > 0}, "faces must be integers"),
        ({"faces": np.zeros((2, 3, 2), dtype=int)}, "faces must have the shape"),
        (
            {"faces": [(0, 1, 2), (0, 2, 4)]},
            "face 1 refers to vertex 4; the mesh has 4 vertices, legal is 0..3",
        ),
        ({"faces": [(0, 1, 2), (0, -1, 3)]}, "face 1 refers to vertex -1"),
        ({"faces": [(0, 1, 2), (0, 1, 2, 3), (0, 1, 9)]}, "face 2 refers to vertex 9"),
        ({"faces": [(0, 1, 2, 3), (0, 1, 9, 3)]}, "face 1 refers to vertex 9"),
        (
            {"faces": np.array([(0, 1, 2**63)], dtype=np.uint64)},
            "face 0 refers to vertex 9223372036854775808",
        ),
        ({"faces": [(0, 0, 1), (2, 2, 2)]}, "every face has zero area: 2 faces"),
        ({"vertices": np.ones((4, 3))}, "every face has zero area"),
        ({"vertices": np.outer([0, 1, 2, 3], [0.1, 0.7, 0.3])}, "every face has zero area"),
        ({"normals": np.ones((3, 3))}, r"normals must have the shape"),
        ({"normals": np.ones((4, 2))}, r"normals must have the shape"),
        ({"normals": np.ones((3, 3, 3))}, r"normals must have the shape"),
        ({"faces": [(0, 1, 2, 3)], "normals": np.ones((2, 3, 3))}, "one a corner only with triangles"),
        ({"normals": np.full((4, 3), math.nan)}, "normals must be finite; 4 of 4"),
        ({"uv": np.ones((4, 3))}, "uv must have the shape"),
        (
            {"uv": [[0, 0], [0, math.inf], [0, 0], [0, 0]]},
            "uv must be finite; 1 of 4 are not, the first is number 1",
        ),
        ({"colors": np.ones((3, 3))}, r"colors must have the shape \(4, 3 or 4\)"),
        ({"colors": np.ones((4, 2))}, "colors must have the shape"),
        ({"colors": np.ones((3, 3, 3))}, r"colors must have the shape \(4, 3 or 4\) or \(2, 3, 3 or 4\)"),
        ({"colors": np.ones((4, 3), dtype=int)}, "colors must be uint8"),
        ({"colors": -np.ones((4, 3))}, "colors must be finite and at least 0"),
        ({"colors": np.full((4, 3), math.nan)}, "colors must be finite and at least 0"),
        ({"colors": np.full((4, 3), math.inf)}, "colors must be finite and at least 0"),
        ({"colors": np.full((4, 3), math.inf, dtype=np.float32)}, "colors must be finite and at least 0"),
        ({"face_colors": np.ones((4, 3))}, "face_colors must have the shape"),
        ({"smoothing": [1]}, "smoothing must be integers"),
        ({"smoothing": [1.0, 2.0]}, "smoothing must be integers"),
        ({"smoothing": [1, -1]}, "smoothing must be within"),
        ({"polygons": [0]}, "polygons must be integers"),
        ({"polygons": [0, 2**31]}, "polygons must be within"),
        ({"faces": [(0, 1, 2, 3)], "polygons": [0, 0]}, "only with triangles"),
        ({"name": None}, "name"),
    ],
)
def test_broken_models_are_refused(changes, message):
    with pytest.raises(ModelError, match=message):
        Mesh(**({"vertices": SQUARE, "faces": TWO} | changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"material": "gold"}, "material must be a Material"),
        ({"crease_angle": -1}, "crease angle"),
        ({"crease_angle": 181}, "crease angle"),
        ({"crease_angle": math.nan}, "crease angle"),
    ],
)
def test_illegal_options_are_refused(changes, message):
    with pytest.raises(SceneError, match=message):
        Mesh(SQUARE, TWO, **changes)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e101])
def test_coordinates_that_are_not_finite(bad):
    vertices = SQUARE.copy()
    vertices[3, 1] = bad
    with pytest.raises(ModelError, match=r"1 of 4 vertices .* the first is vertex 3: .*drop_bad_faces=True"):
        Mesh(vertices, TWO)
    mesh = Mesh(vertices, TWO, np.ones((2, 3, 3)), face_colors=np.eye(3)[:2], smoothing=[4, 5], drop_bad_faces=True)
    assert mesh.faces.tolist() == [[0, 1, 2]] and mesh.polygons.tolist() == [0]
    assert mesh.normals.shape == (1, 3, 3) and mesh.smoothing.tolist() == [4]
    assert mesh.face_colors.tolist() == [[1, 0, 0]]
    assert np.isfinite(mesh.vertices).all() and np.array_equal(mesh.vertices[:3], SQUARE[:3])
    assert mesh.bounds.tolist() == [[0, 0, 0], [1, 1, 0]]
    assert np.array_equal(vertices[3, 1], bad, equal_nan=True)  # the caller's array is as it was


def test_dropping_goes_by_polygons_and_keeps_their_numbers():
    vertices = PRISM_VERTICES.copy()
    vertices[5] = math.nan
    mesh = Mesh(vertices, PRISM, drop_bad_faces=True)
    assert mesh.polygons.tolist() == [0, 2, 2]
    vertices[0] = math.nan
    with pytest.raises(ModelError, match="no face is left"):
        Mesh(vertices, PRISM, drop_bad_faces=True)


def test_dropping_leaves_good_meshes_alone_and_mends_normals():
    mesh = Mesh(SQUARE, TWO, [(0, 0, 2), (0, 0, math.nan), (0, 0, 1), (math.inf, 0, 1)], drop_bad_faces=True)
    assert mesh.polygons is None and mesh.normals.tolist() == [[0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 1]]


@pytest.mark.parametrize("scale", [1e-150, 1e-6, 1.0, 1e6, 1e99])
def test_area_is_found_at_any_scale(scale):
    assert Mesh(SQUARE * scale, TWO).n_face == 2
    sliver = np.array([(0, 0, 0), (1, 0, 0), (0.5, 1e-12, 0)]) * scale
    assert Mesh(sliver, [(0, 1, 2)]).n_face == 1


def test_one_good_face_among_many_bad_ones_is_enough():
    faces = np.zeros((200_000, 3), dtype=np.uint32)
    with pytest.raises(ModelError, match="zero area"):
        Mesh(SQUARE, faces)
    faces[-1] = (0, 1, 2)
    assert Mesh(SQUARE, faces).n_face == 200_000


def test_bounds_count_used_vertices_only():
    stray = np.concatenate([[(99.0, 99, 99)], SQUARE])
    mesh = Mesh(stray, TWO + 1)
    assert mesh.bounds.tolist() == [[0, 0, 0], [1, 1, 0]]
    assert np.array_equal(mesh.used_vertices, SQUARE)
    whole = Mesh(SQUARE, TWO)
    assert whole.used_vertices is whole.vertices


def test_from_any():
    mesh = Mesh(SQUARE, TWO)
    assert Mesh.from_any(mesh) is mesh
    assert Mesh.from_any((SQUARE, TWO)).n_face == 2
    assert Mesh.from_any(SimpleNamespace(vertices=SQUARE, faces=TWO)).n_face == 2
    for wrong in ("cube.obj", 5, None, (SQUARE,), SimpleNamespace(vertices=SQUARE)):
        with pytest.raises(ModelError, match="a mesh (must be|needs faces)"):
            Mesh.from_any(wrong)


def test_from_trimesh():
    trimesh = pytest.importorskip("trimesh")
    source = trimesh.Trimesh(SQUARE, TWO, process=False, metadata={"name": "square"})
    mesh = Mesh.from_any(source)
    assert np.array_equal(mesh.faces, TWO) and mesh.name == "square"
    assert mesh.normals is None and mesh.colors is None and mesh.face_colors is None
    assert "vertex_normals" not in source._cache and source.vertices.flags.writeable
    source.visual.face_colors = [[255, 0, 0, 255], [0, 255, 0, 255]]
    assert Mesh.from_any(source).face_colors.tolist() == [[1, 0, 0, 1], [0, 1, 0, 1]]
    source.visual.vertex_colors = np.full((4, 4), 255, dtype=np.uint8)
    assert (Mesh.from_any(source).colors == 1.0).all()
    normals = np.tile([0.0, 0.6, 0.8], (4, 1))
    held = trimesh.Trimesh(SQUARE, TWO, vertex_normals=normals, process=False)
    assert Mesh.from_any(held).normals == pytest.approx(normals)
    held.visual = trimesh.visual.TextureVisuals(uv=SQUARE[:, :2])
    assert np.array_equal(Mesh.from_any(held).uv, SQUARE[:, :2])


@given(st.integers(0, 1000))
@settings(max_examples=30)
def test_transformed_normals_stay_perpendicular_and_outside(seed):
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(3, 3))
    outside = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
    corners = np.array([[outside] * 3])
    matrix = np.eye(4)
    matrix[:3] = rng.normal(size=(3, 4))
    for normals in (corners, corners[0]):
        moved = Mesh(vertices, [(0, 1, 2)], normals).transformed(matrix)
        normal = area_vectors(moved)[0]
        assert moved.normals.reshape(3, 3) == pytest.approx(np.tile(normal / np.linalg.norm(normal), (3, 1)), abs=1e-6)
        assert moved.vertices == pytest.approx(vertices @ matrix[:3, :3].T + matrix[:3, 3])


def test_transformed_mirror_turns_the_winding_and_the_corners_with_it():
    corners, colors = np.arange(12.0).reshape(2, 3, 2), np.arange(18.0).reshape(2, 3, 3)
    given = {"uv": corners, "colors": colors, "polygons": [3, 3], "face_colors": np.eye(3)[:2], "smoothing": [1, 2]}
    mesh = Mesh(SQUARE, TWO, **given, name="m")
    moved = mesh.transformed(np.diag([1, 1, -1, 1]))
    assert moved.faces.tolist() == [[0, 2, 1], [0, 3, 2]]
    assert np.array_equal(moved.uv, corners[:, [0, 2, 1]]) and np.array_equal(moved.colors, colors[:, [0, 2, 1]])
    assert (moved.name, moved.polygons.tolist(), moved.smoothing.tolist()) == ("m", [3, 3], [1, 2])
    assert np.array_equal(moved.face_colors, mesh.face_colors)
    assert (area_vectors(moved)[:, 2] == -1.0).all()
    assert mesh.faces.tolist() == TWO.tolist()


@pytest.mark.parametrize("wrong", [np.eye(3), np.full((4, 4), math.nan), np.eye(4) * 2, "turn", None])
def test_transformed_refuses_other_matrices(wrong):
    with pytest.raises(SceneError, match="affine"):
        Mesh(SQUARE, TWO).transformed(wrong)


def test_transformed_to_nothing_is_refused():
    with pytest.raises(ModelError, match="zero area"):
        Mesh(SQUARE, TWO).transformed(np.diag([1, 0, 1, 1]))


# --- several materials ------------------------------------------------------------------------------------------------


RED, BLUE = Material(diffuse="red", name="red"), Material(diffuse="blue", name="blue")


def test_several_materials():
    mesh = Mesh(SQUARE, TWO, materials=[RED, BLUE], face_material=[1, 0])
    assert mesh.palette == mesh.materials == (RED, BLUE) and mesh.material is RED
    assert mesh.face_material.dtype == np.int32 and mesh.face_material.tolist() == [1, 0]
    assert Mesh(SQUARE, TWO, material=BLUE).palette == (BLUE,)
    # One a polygon as given; bad faces take theirs along.
    assert Mesh(SQUARE, [(0, 1, 2, 3)], materials=[RED, BLUE], face_material=[1]).face_material.tolist() == [1, 1]
    holed = np.vstack([SQUARE, [[np.nan, 0, 0]]])
    kept = Mesh(holed, [(0, 1, 4), *TWO], materials=[RED, BLUE], face_material=[0, 1, 0], drop_bad_faces=True)
    assert kept.face_material.tolist() == [1, 0]
    assert replace(mesh, name="other").palette == (RED, BLUE)
    assert replace(mesh, material=BLUE, materials=None, face_material=None).palette == (BLUE,)
    assert mesh.subdivide(1).face_material.tolist() == [1] * 4 + [0] * 4
    mirror = np.diag([-1.0, 1, 1, 1])
    assert mesh.transformed(mirror).face_material.tolist() == [1, 0] and mesh.transformed(mirror).palette == (RED, BLUE)


@pytest.mark.parametrize(
    ("arguments", "error", "what"),
    [
        ({"materials": [RED, BLUE]}, ModelError, "together"),
        ({"face_material": [0, 0]}, ModelError, "together"),
        ({"materials": [], "face_material": [0, 0]}, SceneError, "not empty"),
        ({"materials": [RED, 3], "face_material": [0, 0]}, SceneError, "sequence of Material"),
        ({"materials": 3, "face_material": [0, 0]}, SceneError, "sequence of Material"),
        ({"materials": [RED, BLUE], "face_material": [0, 2]}, ModelError, "within 0..1; given 0 to 2"),
        ({"materials": [RED, BLUE], "face_material": [-1, 0]}, ModelError, "given -1..0"),
        ({"materials": [RED, BLUE], "face_material": [0]}, ModelError, "face_material"),
        ({"materials": [RED, BLUE], "face_material": [0.5, 0]}, ModelError, "face_material"),
        ({"materials": [RED], "face_material": [0, 0], "material": BLUE}, SceneError, "given both"),
        ({"materials": [RED, BLUE], "face_material": [0, 1], "polygons": [4, 4]}, ModelError, "polygon 4 differ"),
        ({"material": Material(texture=np.zeros((2, 2)))}, ModelError, "needs texture coordinates"),
    ],
)
def test_materials_that_are_refused(arguments, error, what):
    with pytest.raises(error, match=what):
        Mesh(SQUARE, TWO, **arguments)
