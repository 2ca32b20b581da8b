"""Meshes: what is taken, what it becomes, what is refused; and copies that are moved, turned, scaled or repainted."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.model_bytes import gltf_with
from helpers.pinhole import octasphere
from helpers.refusals import assert_refused
from hypothesis import given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer.errors import ModelError, SceneError
from rasterizer.reference.normals import corner_normals
from rasterizer.scene.material import Material
from rasterizer.scene.mesh import Mesh
from rasterizer.scene.mesh_arrays import has_any_area, has_area

TRIANGLE = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)])
SQUARE = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
TWO = np.array([(0, 1, 2), (0, 2, 3)])
PRISM = [(0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)]
PRISM_VERTICES = np.concatenate([TRIANGLE, TRIANGLE + (0, 0, 1)])
RED, BLUE = Material(diffuse="red", name="red"), Material(diffuse="blue", name="blue")


def area_vectors(mesh):
    """Return (n_face, 3) cross products of two edges."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return np.cross(b - a, c - a)


# --- polygons -----------------------------------------------------------------------------------------------


@given(st.lists(st.integers(3, 7), min_size=1, max_size=8), st.randoms(use_true_random=False))
@settings(max_examples=25, deadline=None)
def test_fans_of_any_lengths(lengths, random):
    """Of polygons that are convex: corners of a circle, in turn; and of triangles."""
    vertices = np.array([(math.cos(i * 0.7), math.sin(i * 0.7), 1) for i in range(9)])
    lengths = [n for n in lengths if n != 4] or [3]  # quads are cut along a diagonal
    faces = [tuple(sorted(random.sample(range(9), n))) for n in lengths]
    faces = [face[turn:] + face[:turn] for face in faces for turn in [random.randrange(3)]]
    mesh = Mesh(vertices, faces)
    expected = []
    for face in faces:
        k = min(range(len(face)), key=lambda corner: tuple(vertices[face[corner]])) if len(face) > 3 else 0
        f = face[k:] + face[:k]
        expected += [(f[0], f[i], f[i + 1]) for i in range(1, len(f) - 1)]
    assert [tuple(face) for face in mesh.faces.tolist()] == expected
    owner = [i for i, n in enumerate(lengths) for _ in range(n - 2)]
    assert owner == (list(range(len(faces))) if mesh.polygons is None else mesh.polygons.tolist())


def test_attributes_of_polygons_go_to_their_triangles():
    colors = np.arange(15.0).reshape(5, 3) / 15
    mesh = Mesh(PRISM_VERTICES, PRISM, face_colors=colors, smoothing=[5, 6, 7, 8, 9])
    assert not differences(mesh.face_colors, colors[mesh.polygons])
    assert mesh.smoothing.tolist() == [5, 6, 7, 7, 8, 8, 9, 9] and mesh.smoothing.dtype == np.int32
    mesh = Mesh(PRISM_VERTICES, PRISM, face_colors=np.arange(24.0).reshape(8, 3) / 24, smoothing=range(8))
    assert mesh.face_colors[:, 0].tolist() == [k / 8 for k in range(8)]
    assert mesh.smoothing.tolist() == list(range(8))


# --- attributes ---------------------------------------------------------------------------------------------


def test_normals_become_unit_length():
    normals = [(0, 0, 3), (1e-200, 0, 1e-200), (0, 1e200, 1e200), (0, 0, 0)]
    root = math.sqrt(0.5)
    mesh = Mesh(SQUARE, TWO, normals)
    assert mesh.normals == pytest.approx(np.array([(0, 0, 1), (root, 0, root), (0, root, root), (0, 0, 1)]))
    corners = np.random.default_rng(0).normal(size=(2, 3, 3))
    mesh = Mesh(SQUARE, TWO, corners)
    assert mesh.normals == pytest.approx(corners / np.linalg.norm(corners, axis=2, keepdims=True))
    many = np.random.default_rng(0).normal(size=(1000, 3))
    for first in (many[0], (0, 0, 0), (1e-200, 0, 0)):  # beside what has no length, or has lost digits
        many[0] = first
        mesh = Mesh(np.tile(SQUARE, (250, 1)), np.arange(1, 1000).reshape(-1, 3), many, crease_angle=None)
        assert not differences(replace(mesh, name="again").normals, mesh.normals)


def test_colours_are_linear_and_uv_by_vertex_or_corner():
    mesh = Mesh(SQUARE, TWO, colors=np.full((4, 4), 128, dtype=np.uint8))
    assert mesh.colors[0] == pytest.approx((0.2158605, 0.2158605, 0.2158605, 128 / 255))
    floats = np.full((4, 3), 0.5, dtype=np.float32)
    assert not differences(Mesh(SQUARE, TWO, colors=floats).colors, 0.5)
    assert Mesh(SQUARE, TWO, face_colors=np.zeros((2, 3), dtype=np.uint8)).face_colors.dtype == np.float64
    assert Mesh(SQUARE, TWO, uv=SQUARE[:, :2]).uv.shape == (4, 2)
    assert Mesh(SQUARE, TWO, uv=np.zeros((2, 3, 2))).uv.shape == (2, 3, 2)


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
    assert mesh.with_material(RED).palette == (RED,) and mesh.with_material(RED).face_material is None
    assert mesh.with_material("gold").material == Material.named("gold")


# --- refusals -----------------------------------------------------------------------------------------------


def refused(cases, error=ModelError):
    assert_refused(lambda changes: Mesh(**({"vertices": SQUARE, "faces": TWO} | changes)), cases, error)


def test_broken_vertices_are_refused():
    numbers = "vertices must be an array of numbers, none of them masked"
    wrong = [
        ([], "no vertices"),
        (SQUARE[:, :2], r"vertices must have the shape \(n, 3\); given \(4, 2\)"),
        (SQUARE.astype(object), f"{numbers}; given objects: "),
        (np.ma.masked_equal(SQUARE, 0), numbers),
        *((each, numbers) for each in (None, [(0, 0, 0), (1, 2)], SQUARE + 1j, SQUARE > 0, [["a", "b", "c"]])),
        (np.outer([0, 1, 2, 3], [0.1, 0.7, 0.3]), "every face has zero area"),
    ]
    refused([({"vertices": value}, said) for value, said in wrong])


def test_broken_faces_are_refused():
    wrong = [
        ([], "no faces"),
        ([0, 1, 2], "faces must have the shape"),
        ([(0, 1)], "at least 3 corners; face 0 has 2"),
        ([(0, 1, 2), (0, 1)], "at least 3 corners; face 1 has 2"),
        *((each, "faces must be integers") for each in (TWO.astype(float), [(0, 1, 2), (0, 1, 2, 3.0)], TWO > 0)),
        ([(0, 1, 2), (0, 2, 4)], r"face 1 refers to vertex 4; the mesh has 4 vertices, legal is 0\.\.3"),
        ([(0, 1, 2), (0, -1, 3)], "face 1 refers to vertex -1"),
        ([(0, 1, 2), (0, 1, 2, 3), (0, 1, 9)], "face 2 refers to vertex 9"),
        (np.array([(0, 1, 2**63)], dtype=np.uint64), "face 0 refers to vertex 9223372036854775808"),
        ([(0, 0, 1), (2, 2, 2)], "every face has zero area: 2 faces"),
    ]
    refused([({"faces": value}, said) for value, said in wrong])


def test_broken_attributes_are_refused():
    nan, inf, light = math.nan, math.inf, "colors must be finite and at least 0"
    refused([
        *(({"normals": np.ones(shape)}, "normals must have the shape") for shape in ((3, 3), (4, 2), (3, 3, 3))),
        ({"faces": [(0, 1, 2, 3)], "normals": np.ones((2, 3, 3))}, "one a corner only with triangles"),
        ({"normals": np.full((4, 3), nan)}, "normals must be finite; 4 of 4"),
        ({"uv": np.ones((4, 3))}, "uv must have the shape"),
        ({"uv": [[0, 0], [0, inf], [0, 0], [0, 0]]}, "uv must be finite; 1 of 4 are not, the first is number 1"),
        ({"colors": np.ones((3, 3, 3))}, r"colors must have the shape \(4, 3 or 4\) or \(2, 3, 3 or 4\)"),
        ({"colors": np.ones((4, 3), dtype=int)}, "colors must be uint8"),
        *(({"colors": np.full((4, 3), value)}, light) for value in (-1.0, nan, inf, np.float32(inf))),
        ({"face_colors": np.ones((4, 3))}, "face_colors must have the shape"),
        ({"smoothing": [1]}, "smoothing must be integers"),
        ({"smoothing": [1, -1]}, "smoothing must be within"),
        ({"polygons": [0, 2**31]}, "polygons must be within"),
        ({"faces": [(0, 1, 2, 3)], "polygons": [0, 0]}, "only with triangles"),
    ])  # fmt: skip
    refused([({"material": "gold"}, "material must be a Material"), ({"name": None}, "name")], SceneError)
    refused([({"crease_angle": angle}, "crease angle") for angle in (-1, 181, nan)], SceneError)


def test_broken_materials_are_refused():
    both = [RED, BLUE]
    refused([
        ({"materials": both}, "together"),
        ({"face_material": [0, 0]}, "together"),
        ({"materials": both, "face_material": [0, 2]}, r"within 0\.\.1; given 0 to 2"),
        ({"materials": both, "face_material": [-1, 0]}, r"given -1\.\.0"),
        ({"materials": both, "face_material": [0, 1], "polygons": [4, 4]}, "polygon 4 differ"),
        ({"material": Material(texture=np.zeros((2, 2)))}, "needs texture coordinates"),
    ])  # fmt: skip
    refused([
        ({"materials": [], "face_material": [0, 0]}, "not empty"),
        ({"materials": [RED, 3], "face_material": [0, 0]}, "sequence of Material"),
        ({"materials": [RED], "face_material": [0, 0], "material": BLUE}, "given both"),
    ], SceneError)  # fmt: skip


@pytest.mark.parametrize("bad", [math.nan, -math.inf, 1e101])
def test_faces_with_bad_coordinates_are_refused_or_dropped(bad):
    vertices = SQUARE.copy()
    vertices[3, 1] = bad
    with pytest.raises(ModelError, match=r"1 of 4 vertices .*drop_bad_faces=True.*the first is vertex 3: "):
        Mesh(vertices, TWO)
    mesh = Mesh(vertices, TWO, np.ones((2, 3, 3)), face_colors=np.eye(3)[:2], smoothing=[4, 5], drop_bad_faces=True)
    assert mesh.faces.tolist() == [[0, 1, 2]] and mesh.polygons.tolist() == [0]
    assert mesh.normals.shape == (1, 3, 3) and mesh.smoothing.tolist() == [4]
    assert mesh.face_colors.tolist() == [[1, 0, 0]]
    assert not differences(np.isfinite(mesh.vertices), True) and not differences(mesh.vertices[:3], SQUARE[:3])
    assert mesh.bounds.tolist() == [[0, 0, 0], [1, 1, 0]]
    assert not differences(vertices[3, 1], bad, equal_nan=True)  # the caller's array is as it was


@pytest.mark.parametrize("n", [1, 85, 86, 170, 171, 400, 1000])
def test_the_box_holds_every_vertex_that_is_used(n):
    """Of few and of many vertices, whichever of them is the furthest."""
    random = np.random.default_rng(n)
    for _ in range(12):
        vertices = random.normal(size=(3 * n + 2, 3))
        vertices[-2:] *= 100.0  # unused
        furthest = random.integers(0, 3 * n, 2)
        vertices[furthest[0]] -= 9.0
        vertices[furthest[1]] += 9.0
        used = vertices[: 3 * n]
        assert Mesh(vertices, np.arange(3 * n).reshape(-1, 3)).bounds.tolist() == [
            [used[:, axis].min() for axis in range(3)], [used[:, axis].max() for axis in range(3)],
        ]  # fmt: skip


def test_dropping_goes_by_polygons_and_mends_normals():
    vertices = PRISM_VERTICES.copy()
    vertices[5] = math.nan
    assert Mesh(vertices, PRISM, drop_bad_faces=True).polygons.tolist() == [0, 2, 2], "they keep their numbers"
    vertices[0] = math.nan
    with pytest.raises(ModelError, match="no face is left"):
        Mesh(vertices, PRISM, drop_bad_faces=True)
    mesh = Mesh(SQUARE, TWO, [(0, 0, 2), (0, 0, math.nan), (0, 0, 1), (math.inf, 0, 1)], drop_bad_faces=True)
    assert mesh.polygons is None and mesh.normals.tolist() == [[0, 0, 1]] * 4


# --- other forms --------------------------------------------------------------------------------------------


def test_from_any():
    mesh = Mesh(SQUARE, TWO)
    assert Mesh.from_any(mesh) is mesh
    assert Mesh.from_any((SQUARE, TWO)).n_face == 2
    assert Mesh.from_any(SimpleNamespace(vertices=SQUARE, faces=TWO)).n_face == 2
    wrong = ("cube.obj", 5, None, (SQUARE,), SimpleNamespace(vertices=SQUARE))
    assert_refused(Mesh.from_any, [(each, "a mesh (must be|needs)") for each in wrong], ModelError)


# --- moved, turned, scaled ----------------------------------------------------------------------------------

RANDOM = np.random.default_rng(3)
POINTS = RANDOM.normal(size=(12, 3))
MOVED = Mesh(POINTS, RANDOM.permutation(12).reshape(4, 3), normals=RANDOM.normal(size=(12, 3)), name="a")


@given(st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
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


def test_a_mirror_turns_the_winding_and_the_corners_with_it():
    corners, colors = np.arange(12.0).reshape(2, 3, 2), np.arange(18.0).reshape(2, 3, 3) / 18
    given = {"uv": corners, "colors": colors, "polygons": [3, 3], "face_colors": np.eye(3)[:2], "smoothing": [1, 2]}
    mesh = Mesh(SQUARE, TWO, **given, name="m")
    moved = mesh.transformed(np.diag([1, 1, -1, 1]))
    assert moved.faces.tolist() == [[0, 2, 1], [0, 3, 2]]
    assert not differences(moved.uv, corners[:, [0, 2, 1]]) and not differences(moved.colors, colors[:, [0, 2, 1]])
    assert (moved.name, moved.polygons.tolist(), moved.smoothing.tolist()) == ("m", [3, 3], [1, 2])
    assert not differences(moved.face_colors, mesh.face_colors)
    assert not differences(area_vectors(moved)[:, 2], -1.0) and mesh.faces.tolist() == TWO.tolist()
    assert not differences(MOVED.scaled((-1, 1, 1)).faces, MOVED.faces[:, [0, 2, 1]])
    assert not differences(MOVED.scaled((-1, 1, -1)).faces, MOVED.faces)


def test_a_mesh_is_moved_turned_and_scaled():
    moved = MOVED.translated((1, -2, 3.5))
    assert not differences(moved.vertices, POINTS + (1, -2, 3.5)) and moved.name == "a"
    assert not deviations(moved.normals, MOVED.normals, atol=1e-15)
    axis, about = np.array([0.3, -2.0, 1.1]), np.array([1.0, 2.0, 3.0])
    turned = MOVED.rotated(37, axis, about)
    assert not deviations(np.linalg.norm(turned.vertices - about, axis=1), np.linalg.norm(POINTS - about, axis=1))
    assert not deviations((turned.vertices - POINTS) @ axis, 0.0, atol=1e-14)
    assert not deviations(turned.rotated(-37, axis, about).vertices, POINTS, atol=1e-14)
    assert not deviations(MOVED.scaled(2).vertices, 2 * POINTS)
    grown = MOVED.scaled((2, 3, 0.5), POINTS[0])
    assert not deviations(grown.vertices[0], POINTS[0])
    assert not deviations(grown.vertices - POINTS[0], (POINTS - POINTS[0]) * (2, 3, 0.5))


def test_illegal_moves_are_refused():
    matrices = [np.eye(3), np.full((4, 4), math.nan), np.eye(4) * 2, "turn", None]
    assert_refused(MOVED.transformed, [(each, "affine") for each in matrices], SceneError)
    with pytest.raises(ModelError, match="zero area"):
        Mesh(SQUARE, TWO).transformed(np.diag([1, 0, 1, 1]))
    cases = [
        (("translated", 3), "the offset must be three finite numbers; given 3"),
        (("rotated", "90"), "the angle must be a finite number"),
        (("rotated", 90, "w"), "the axis must be one of 'x', "),
        (("rotated", 90, (0, 0, 0)), "the axis must have a length"),
        (("rotated", 90, "y", 1), "the point that stays must be three"),
        (("scaled", 0), "the factor must not be 0; given 0"),
        (("with_material", None), "a mesh's material must be a Material; given None"),
    ]
    assert_refused(lambda given: getattr(MOVED, given[0])(*given[1:]), cases, SceneError)
    with pytest.raises(ModelError, match="needs texture coordinates"):
        MOVED.with_material(Material(texture=np.eye(4)))


def test_a_small_face_beside_a_huge_one_without_area_counts():
    vertices = np.array([(0, 0, 0), (1e-170, 0, 0), (0, 1e-170, 0), (1e99, 0, 0), (-1e99, 0, 0)])
    assert has_area(vertices, np.array([(0, 1, 2), (0, 3, 4)])).tolist() == [True, False]


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int64])
def test_a_mesh_has_an_area_where_one_of_its_faces_has(dtype):
    """Whichever face that is, and whatever numbers its corners have."""
    numbers = [0, 1, -1, 3, 1e-30, 1e-170, 1e19, 1e160, 1e307, np.nan, np.inf, 1 + 2.0**-20, 1 + 2.0**-50]
    random, n_found = np.random.default_rng(5), 0
    for _ in range(3000):
        with np.errstate(all="ignore"):
            some = np.array(numbers[:4] if dtype == np.int64 else numbers, dtype)
        vertices = random.choice(some[: random.integers(2, len(some) + 1)], (9, 3))
        faces = random.integers(0, 9, (random.integers(1, 4), 3))
        expected = has_area(vertices, faces).any()
        n_found += expected
        assert has_any_area(vertices, faces) == expected, vertices[faces].tolist()
    assert 600 < n_found < 2900


# ── normals without a length ───────────────────────────────────────────────────────────────────────────


VERTICES, FACES = octasphere(2)


def corners_of(mesh):
    """The normals (n_face, 3, 3) of all corners."""
    return mesh.normals if mesh.normals.ndim == 3 else mesh.normals[mesh.faces]


@pytest.mark.parametrize(("weighting", "is_per_corner"), [("angle", False), ("area", True), ("uniform", False)])
def test_a_vertex_without_a_normal_gets_that_of_its_faces(weighting, is_per_corner):
    """The others keep theirs."""
    given = VERTICES + (0.3, 0.1, 0.0)
    given = given[FACES] if is_per_corner else given
    is_zero = np.random.default_rng(3).random(given.shape[:-1]) < 0.4
    mesh = Mesh(
        VERTICES, FACES, np.where(is_zero[..., None], 0.0, given), weighting=weighting, smoothing=[1] * len(FACES)
    )
    whole = Mesh(VERTICES, FACES, given)
    is_zero = is_zero if is_per_corner else is_zero[FACES]
    computed = corner_normals(VERTICES, FACES, 180.0, weighting, None)
    expected = np.where(is_zero[..., None], computed, corners_of(whole))
    assert mesh.normals.shape == given.shape, "no vertex of a ball has two"
    np.testing.assert_allclose(corners_of(mesh), expected, atol=1e-12)


def test_files_say_how_many_they_have(tmp_path):
    """OBJ, PLY and glTF say it in what `-v` prints; scene files keep what was computed."""
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nvn 0 1 0\nf 1//1 2//2 3//1\n")
    properties = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    (tmp_path / "a.ply").write_text(
        f"ply\nformat ascii 1.0\nelement vertex 3\n{properties}element face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0 0 0 0 0\n1 0 0 0 1 0\n0 1 0 0 0 0\n3 0 1 2\n"
    )

    def of_a_triangle(tree, primitive):
        """Positions and normals of a buffer of their own."""
        rows = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [0, 1, 0], [0, 0, 0]], np.float32)
        (tmp_path / "a.bin").write_bytes(rows.tobytes())
        tree["buffers"] = [{"uri": "a.bin", "byteLength": 72}]
        tree["bufferViews"] = [{"buffer": 0, "byteOffset": 36 * k, "byteLength": 36} for k in range(2)]
        tree["accessors"] = [{"bufferView": k, "componentType": 5126, "count": 3, "type": "VEC3"} for k in range(2)]
        primitive["attributes"] = {"POSITION": 0, "NORMAL": 1}
        del primitive["indices"]

    (tmp_path / "a.gltf").write_bytes(gltf_with(of_a_triangle))
    for name in ("a.obj", "a.ply", "a.gltf"):
        facts = []
        (mesh,) = rz.load(tmp_path / name, log=facts.append).meshes
        assert corners_of(mesh).tolist() == [[[0, 0, 1], [0, 1, 0], [0, 0, 1]]], name
        assert any("2 file normals are zero" in fact and "computed from the faces" in fact for fact in facts), facts
    rz.save(rz.Scene(mesh), tmp_path / "a.json")
    assert corners_of(rz.load(tmp_path / "a.json").meshes[0]).tolist() == corners_of(mesh).tolist()
