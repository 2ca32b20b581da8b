"""Tests of joining equal vertices: which rows are equal, and that no seam is left in normals."""

import io
import tracemalloc

import numpy as np
import pytest
import trimesh
from helpers.arrays import deviations, differences
from helpers.model_bytes import gltf_with, threemf
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.engine.points import smooth_part
from rasterizer.errors import ModelError
from rasterizer.geometry.weld import unique_rows, weld_triangles
from rasterizer.io.loader import load


@settings(max_examples=30)
@given(st.lists(st.tuples(st.sampled_from([0.0, 1.0, -1.0, np.nan, np.inf]), st.sampled_from([0.0, 2.0])), min_size=1))
def test_unique_rows(rows):
    rows = np.array(rows)
    first, inverse = unique_rows(rows)
    assert rows[first][inverse].tobytes() == rows.tobytes()
    assert len({row.tobytes() for row in rows}) == len(first)
    assert sorted(first) == list(first)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rows_of_several_blocks_are_joined_across_them(dtype):
    """Blocks of 2^16 rows."""
    n = 2**18
    rows = np.random.default_rng(3).integers(0, 4, (n + 699, 3)).astype(dtype)
    rows[rows == 0] *= np.random.default_rng(4).choice([-1, 1], (rows == 0).sum())  # -0 is 0
    rows[-3:] = [(9, 9, 9), (8, 8, 8), (9, 9, 9)]
    distinct = np.arange(3 * n, dtype=dtype).reshape(-1, 3)  # but for some that stand twice, the first in another block
    distinct[-9:], distinct[n // 2 : n // 2 + 9] = distinct[:9], distinct[:9]
    few, both = rows[-999:], np.concatenate([rows[:n], distinct])
    for case, n_unique in ((rows, 66), (few, len(np.unique(few, axis=0))), (np.asfortranarray(rows), 66),
                           (both, n + 45), (distinct, n - 18), (rows[:0], 0)):  # fmt: skip
        first, inverse = unique_rows(case)
        assert len(first) == n_unique and (np.diff(first) > 0).all(), len(first)
        assert not differences(case[first][inverse], case)
        assert (first[inverse] <= np.arange(len(case))).all(), "the first of those that are equal"


@pytest.mark.parametrize("n_copy", [1, 3])
def test_rows_that_share_a_hash_stay_apart(n_copy):
    """Of each row a second one is made with the same hash: by the first column of the next row, and a second one for
    it."""
    random = np.random.default_rng(5)
    bits = random.normal(size=(100, 2)).view(np.uint64)
    hashes = (bits[:, 0] ^ bits[:, 0] >> np.uint64(32)) * np.uint64(0xBF58476D1CE4E5B9)  # as `_sort_rows` has it
    hashes ^= hashes >> np.uint64(29)
    twins = np.stack([bits[1:, 0], hashes[:-1] ^ bits[:-1, 1] ^ hashes[1:]], axis=1)
    rows = np.concatenate([bits, twins[np.isfinite(twins[:, 1].view(float))]]).view(np.float64)
    assert len(rows) > 150
    found = random.permutation(np.repeat(rows, n_copy, axis=0))
    first, inverse = unique_rows(found)
    assert len(first) == len(rows) and not differences(found[first][inverse], found)
    assert (np.diff(first) > 0).all() and (first[inverse] <= np.arange(len(found))).all()


def test_rows_that_differ_in_signs_and_single_bits_are_told_apart():
    """In any two columns, of doubles, floats and whole numbers: patterns that a weak hash can't tell apart."""
    random, flips = np.random.default_rng(6), np.uint64(1) << np.arange(64, dtype=np.uint64)
    for row in (random.normal(size=3), np.array([5.0, 300000.0, 7.0]), np.zeros(3)):
        rows = [row.view(np.uint64)]
        for k, other in ((0, 1), (1, 2), (0, 2), (1, 0)):
            for flip in flips[-1:].tolist() + flips[random.integers(0, 63, 3)].tolist():
                some = np.tile(rows[0], (64, 1))
                some[:, k] ^= np.uint64(flip)
                some[:, other] ^= flips ^ np.uint64(flip)
                rows.extend(some)
        found = np.array(rows).view(np.float64)
        found = found[np.isfinite(found).all(axis=1)] + 0.0
        first, inverse = unique_rows(found)
        assert len(first) == len({each.tobytes() for each in found}) and not differences(found[first][inverse], found)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shared", ["nothing", "far away", "late in a block", "in one block", "near", "all"])
def test_triangles_are_joined_wherever_they_share_corners(shared, dtype):
    """Blocks have 2^16 corners; what the first of a block share decides how it is looked through, and no more."""
    n, random = 60_001, np.random.default_rng(7)
    corners = random.normal(size=(n, 3, 3)).astype(dtype)
    corners[5, 1], corners[n - 1, 2] = (0.0, 1.0, -0.0), (-0.0, 1.0, 0.0)
    if shared == "far away":
        corners[n // 2 :] = corners[random.permutation(n)[: n - n // 2]]
    elif shared == "late in a block":
        corners[20_000:21_000] = corners[19_000:20_000, ::-1]
    elif shared == "in one block":
        corners[50_000:50_900, 0] = corners[50_000, 0]
    elif shared == "near":
        corners[1:, 0] = corners[:-1, 2]
    elif shared == "all":
        corners[:] = corners[0]
    called = []

    def read(begin, end):
        called.append((begin, end))
        return corners[begin:end]

    vertices, faces = weld_triangles(read, n)
    rows = corners.reshape(-1, 3).astype(float) + 0.0
    assert vertices[faces].reshape(-1, 3).tobytes() == rows.tobytes()
    assert len(vertices) == len({row.tobytes() for row in rows})
    _, first_uses = np.unique(faces, return_index=True)
    assert (np.diff(first_uses) > 0).all(), "vertices stand in the order of their first use"
    assert sum(end - begin for begin, end in called) == n, "each triangle is read once"


# --- a roof of two triangles that meet at 20 degrees, whose ridge is there twice ---

RIDGE = np.tan(np.radians(10.0))
ROOF = np.array([(-1, 0, 0), (0, 0, RIDGE), (0, 1, RIDGE), (0, 0, RIDGE), (1, 0, 0), (0, 1, RIDGE)])
FACES = np.array([(0, 1, 2), (3, 4, 5)])
UV = np.array([(0, 0), (0.5, 0), (0.5, 1), (0.6, 0), (1, 0), (0.6, 1)])
COLORS = np.array([(255, 0, 0)] * 3 + [(0, 0, 255)] * 3)


def obj(colors=False, uv=False) -> bytes:
    rows = [" ".join(map(str, row)) for row in (np.hstack([ROOF, COLORS]) if colors else ROOF)]
    lines = [f"v {row}" for row in rows] + [f"vt {a} {b}" for a, b in UV] * uv
    corner = "{0}/{0}" if uv else "{0}"
    return "\n".join([*lines, *("f " + " ".join(corner.format(k + 1) for k in face) for face in FACES)]).encode()


def off() -> bytes:
    rows = [*ROOF, *([3, *face] for face in FACES)]
    return ("OFF\n6 2 0\n" + "\n".join(" ".join(map(str, row)) for row in rows)).encode()


def model_xml() -> str:
    vertices = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*row) for row in ROOF)
    triangles = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*face) for face in FACES)
    mesh = f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"
    objects = f'<resources><object id="1">{mesh}</object></resources>'
    return f'<model>{objects}<build><item objectid="1"/></build></model>'


def exported(format, **visual) -> bytes:
    mesh = trimesh.Trimesh(ROOF, FACES, process=False, **visual)
    data = mesh.export(file_type=format)
    return data if isinstance(data, bytes) else data.encode()


def ridge_normals(mesh) -> np.ndarray:
    """The different normals at the vertices of the ridge."""
    part = smooth_part(mesh)
    return np.unique(np.round(part.normals[np.abs(part.points[:, 0]) < 1e-9], 6), axis=0)


FILES = {
    "obj": obj(), "obj with uv": obj(uv=True), "obj with colours": obj(colors=True), "off": off(),
    "stl": exported("stl"), "ply": exported("ply"), "glb": exported("glb"), "3mf": threemf(model_xml()),
    "ply with colours": exported("ply", vertex_colors=COLORS), "stl_ascii": exported("stl_ascii"),
    "glb with colours": exported("glb", vertex_colors=COLORS),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_a_vertex_that_is_there_twice_makes_no_seam(name):
    """What differs at a joined vertex belongs to the corners."""
    format = "stl" if name == "stl_ascii" else name.split()[0]
    (mesh,) = load(FILES[name], format=format).meshes
    assert not deviations(ridge_normals(mesh), [[0, 0, 1]], atol=1e-06)
    (sharp,) = load(FILES[name], format=format, crease_angle=15).meshes
    assert len(ridge_normals(sharp)) == 2, "creases by angle still decide"
    if "colours" in name:
        assert mesh.n_vertex == 4 and mesh.colors.shape[:2] == (2, 3)
        assert mesh.colors[..., :3].tolist() == [[[1, 0, 0]] * 3, [[0, 0, 1]] * 3]
        part = smooth_part(mesh)
        assert len(part.points) == 6 and sorted(map(tuple, part.albedo)) == [(0, 0, 1)] * 3 + [(1, 0, 0)] * 3


def test_smoothing_groups_polygons_and_parts_are_kept():
    text = obj().replace(b"f 1 2 3", b"s 1\nf 1 2 3").replace(b"f 4 5 6", b"s 2\nf 4 5 6")
    (mesh,) = load(text, format="obj").meshes
    assert len(ridge_normals(mesh)) == 2
    text = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4 5\n"  # repeats a position
    (mesh,) = load(text, format="obj").meshes
    assert not deviations(smooth_part(mesh).normals, (0, 0, 1)) and mesh.n_vertex == 4
    scene = trimesh.Scene({"a": trimesh.creation.box(), "b": trimesh.creation.box()})
    stream = io.BytesIO(scene.export(file_type="glb"))
    assert [mesh.n_vertex for mesh in load(stream, format="glb").meshes] == [8, 8], "parts are not joined"
    broken = gltf_with(lambda tree, primitive: tree["accessors"][primitive["attributes"]["POSITION"]].update(count=4))
    with pytest.raises(ModelError):
        load(broken, format="gltf")


def test_a_large_stl_file_takes_little_more_memory_than_its_mesh():
    """A file of ten million faces has 0.5 GB, and loads within 1.6 GB: 110 bytes a face beside it."""
    k, budget = 400, 110.0
    x = np.arange(k + 1, dtype=np.float32)
    grid = np.stack([*np.meshgrid(x, x), np.zeros((k + 1, k + 1), np.float32)], axis=2)
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    corners = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)], axis=2).reshape(-1, 3, 3)
    rows = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["corners"] = corners
    data = bytes(80) + np.uint32(len(rows)).tobytes() + rows.tobytes()
    tracemalloc.start()
    try:
        (mesh,) = load(data, format="stl").meshes
        peak = tracemalloc.get_traced_memory()[1] / len(rows)
    finally:
        tracemalloc.stop()
    assert mesh.n_vertex == (k + 1) ** 2 and not differences(mesh.vertices[mesh.faces], corners)
    assert peak < budget, f"{peak:.0f} > {budget:.0f} bytes a face"
