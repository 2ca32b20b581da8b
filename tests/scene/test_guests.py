"""Meshes and arrays of other libraries: by stand-ins with the same protocols, and by the libraries where they are."""

import io
from types import SimpleNamespace

import numpy as np
import pytest

import rasterizer as rz

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]])
MIXED = [[0, 1, 2, 3], [1, 4, 2]]


def same(guest, expected, **options):
    """Tell whether a guest is drawn as a mesh is."""
    found = [rz.render(each, 24, **options).rgba for each in (guest, [guest], rz.Scene(guest))]
    assert all(np.array_equal(each, rz.render(expected, 24, **options).rgba) for each in found), guest
    return True


def block(kind, data):
    return SimpleNamespace(type=kind, data=np.array(data))


def test_meshes_of_other_libraries_are_drawn():
    padded = np.array([4, 0, 1, 2, 3, 3, 1, 4, 2])
    assert same(SimpleNamespace(points=CORNERS, faces=padded), (CORNERS, MIXED))
    assert same(SimpleNamespace(points=CORNERS, faces=padded[:5]), (CORNERS, MIXED[:1]), up="z")
    cells = [block("line", [[0, 1]]), block("quad", MIXED[:1]), block("triangle", MIXED[1:])]
    assert same(SimpleNamespace(points=CORNERS, cells=cells, read=io.BytesIO), (CORNERS, MIXED))
    triangles, colors = [[0, 1, 2], [0, 2, 3]], np.full((5, 3), 0.5)
    tinted = SimpleNamespace(vertices=CORNERS, triangles=np.array(triangles), vertex_colors=colors)
    assert same(tinted, rz.Mesh(CORNERS, triangles, colors=rz.srgb(colors)))
    assert rz.load([tinted, (CORNERS, MIXED)], crease_angle=0).n_face == 2 + 3


def test_polygons_of_any_sizes_are_told_apart_by_the_number_before_each():
    """Whatever all the numbers add up to: convex polygons of corners of one ring."""
    rng, turn = np.random.default_rng(1), np.linspace(0, 2 * np.pi, 9, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    for _ in range(60):
        polygons = [np.sort(rng.permutation(9)[: rng.integers(3, 6)]) for _ in range(rng.integers(1, 6))]
        padded = np.concatenate([[len(polygon), *polygon] for polygon in polygons])
        found, expected = rz.load(SimpleNamespace(points=ring, faces=padded)).meshes[0], rz.Mesh(ring, polygons)
        assert np.array_equal(found.faces, expected.faces) and found.n_face == expected.n_face, polygons


def test_what_is_no_surface_is_refused_with_the_line_that_makes_one():
    for guest, words in (
        (SimpleNamespace(points=CORNERS, cells=[5], extract_surface=None), r"give mesh.extract_surface\(\)"),
        (SimpleNamespace(GetPoints=None), r"give pyvista.wrap\(mesh\)"),
        (SimpleNamespace(vertex={}, triangle={}, to_legacy=None), r"give mesh.to_legacy\(\)"),
        (SimpleNamespace(points=CORNERS, cells=[block("tetra", [[0, 1, 2, 3]])]), "needs cells of .*; given tetra"),
        (SimpleNamespace(points=CORNERS, faces=np.zeros(0, int)), "has no faces"),
        (SimpleNamespace(points=CORNERS, faces=np.array([3, 0, 1])), "at least 3 corners"),
    ):
        with pytest.raises(rz.ModelError, match=words):
            rz.render(guest, 8)


class Shared:
    """An array that knows DLPack alone."""

    def __init__(self, values, fault=None):
        self._array, self._fault = np.array(values), fault

    def __dlpack__(self, **options):
        if self._fault is not None:
            raise self._fault
        return self._array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self._array.__dlpack_device__()


class Tensor(Shared):
    """An array that knows numpy's protocol, too, as torch's do."""

    ndim, shape = 2, (5, 3)

    def __array__(self, dtype=None, copy=None):
        if self._fault is not None:
            raise self._fault
        return self._array


def test_arrays_of_other_libraries_are_read():
    triangles = [[0, 1, 2], [0, 2, 3]]
    for kind in (Shared, Tensor):
        assert same((kind(CORNERS), kind(triangles)), (CORNERS, triangles))
    image = np.linspace(0, 1, 48).reshape(4, 4, 3)
    assert np.array_equal(rz.Texture(Shared(image)).image, rz.Texture(image).image)
    moved = rz.Mesh(CORNERS, triangles).transformed(Tensor(np.diag([2.0, 2, 2, 1])))
    assert moved.bounds[1].tolist() == [2, 2, 0]


def test_arrays_that_numpy_can_not_read_are_refused_with_what_to_do():
    needs_gradient = RuntimeError(
        "Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy() instead."
    )
    on_gpu = TypeError("can't convert cuda:0 device type tensor to numpy. Use Tensor.cpu() first.")
    for tensor in (Tensor(CORNERS, needs_gradient), Tensor(CORNERS, on_gpu), Shared(CORNERS, BufferError("cuda"))):
        for call in (
            lambda given: rz.render((given, [[0, 1, 2]]), 8),
            lambda given: rz.Mesh(CORNERS, given),
            lambda given: rz.Mesh(CORNERS, [[0, 1, 2]], colors=given),
            rz.Texture,
        ):
            with pytest.raises(
                rz.SceneError, match=r"numpy can't read this .*give x.detach\(\).cpu\(\).numpy"
            ) as caught:
                call(tensor)
            assert len(str(caught.value)) < 300


def test_meshes_of_pyvista_itself():
    pyvista = pytest.importorskip("pyvista")
    cube = pyvista.Cube()
    assert same(cube, (np.asarray(cube.points), cube.regular_faces))
    assert rz.load([pyvista.Sphere(), cube]).n_face == 1680 + 12
    with pytest.raises(rz.ModelError, match="extract_surface"):
        rz.render(pyvista.ImageData(dimensions=(3, 3, 3)), 8)


def test_meshes_of_meshio_itself():
    meshio = pytest.importorskip("meshio")
    cells = [("line", [[0, 1]]), ("quad", MIXED[:1]), ("triangle", MIXED[1:])]
    assert same(meshio.Mesh(CORNERS, cells), (CORNERS, MIXED))


def test_meshes_of_open3d_itself():
    open3d = pytest.importorskip("open3d", exc_type=ImportError)
    box = open3d.geometry.TriangleMesh.create_box()
    assert same(box, (np.asarray(box.vertices), np.asarray(box.triangles)))


def test_tensors_of_torch_itself():
    torch = pytest.importorskip("torch")
    assert same((torch.tensor(CORNERS), torch.tensor([[0, 1, 2]])), (CORNERS, [[0, 1, 2]]))
    with pytest.raises(rz.SceneError, match="detach"):
        rz.render((torch.tensor(CORNERS, requires_grad=True), [[0, 1, 2]]), 8)
