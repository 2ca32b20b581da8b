"""Check that what is given belongs to the caller, and what was made of it doesn't: writing into any input afterwards
changes no byte of any picture, and no index that was checked can become another."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.raster import GREY, assert_runs
from PIL import Image

import rasterizer as rz

SIZE = (32, 24)
CAMERA = rz.Camera.perspective((1, 2, 4), (0, 0, 0), fov=40)
FAR = 4_000_000_000  # as an index it lies outside everything


def inputs():
    """Arrays of everything that a mesh takes, in the very form that it stores."""
    rng = np.random.default_rng(7)
    vertices = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0.5), (0, 0, 1)], np.float64)
    faces = np.array([(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)], np.uint32)
    given = {
        "vertices": vertices,
        "faces": faces,
        "normals": rng.normal(size=(5, 3)) + (0, 0, 3),
        "colors": rng.uniform(0.2, 1, (5, 3)),
        "uv": rng.uniform(0, 1, (5, 2)),
        "face_colors": rng.uniform(0.2, 1, (4, 3)),
        "polygons": np.array([0, 0, 1, 1], np.int32),
        "smoothing": np.array([1, 1, 2, 2], np.int32),
        "face_material": np.array([0, 0, 1, 1], np.int32),
    }
    return {key: np.ascontiguousarray(value) for key, value in given.items()}


def mesh_of(given, image=None):
    checks = np.kron([[1.0, 0.2], [0.2, 1.0]], np.ones((4, 4))) if image is None else image
    materials = (rz.Material(texture=rz.Texture(checks)), rz.Material(diffuse=0.4))
    return rz.Mesh(**given, materials=materials)


def picture_of(mesh, **options):
    scene = rz.Scene([mesh], GREY, CAMERA)
    outputs = ("color", "depth", "face", "normal")
    frames = [rz.render(scene, SIZE, shading=shading, outputs=outputs, threads=1, **{"samples": 1} | options)
              for shading in ("flat", "gouraud", "phong")]  # fmt: skip
    return b"".join(getattr(f, name).tobytes() for f in frames for name in ("color", "rgba", "depth", "face", "normal"))


def spoil(memory):
    """Write what hurts most: indices far outside, numbers that are none."""
    memory[...] = FAR if memory.dtype.kind == "u" else (2**31 - 1 if memory.dtype.kind == "i" else np.nan)


class Lender:
    """Gives its memory away, as arrays of other libraries do."""

    def __init__(self, memory):
        self.memory = memory

    def __array__(self, dtype=None, copy=None):
        return self.memory if dtype is None else self.memory.astype(dtype, copy=False)

    def __len__(self):
        return len(self.memory)


class Subclass(np.ndarray):
    """As trimesh has one."""


def as_memmap(memory, folder):
    path = folder / f"{len(list(folder.iterdir()))}.bin"
    mapped = np.memmap(path, memory.dtype, "w+", shape=memory.shape)
    mapped[...] = memory
    return mapped, mapped


def read_only_view(memory):
    view = memory[:]
    view.flags.writeable = False
    return memory, view


def read_only_base(memory):
    """A writable view was taken before the array was made read-only."""
    base = memory.copy()
    writable = base[:]
    base.flags.writeable = False
    return writable, base


def frozen_buffer(memory):
    base = memory.copy()
    return base, np.asarray(memoryview(base).toreadonly())


def part_of_a_larger_one(memory):
    larger = np.concatenate([memory, memory])
    return larger, larger[: len(memory)]


WAYS = {
    "itself": lambda memory, _: (memory, memory),
    "a read-only view": lambda memory, _: read_only_view(memory),
    "a read-only base": lambda memory, _: read_only_base(memory),
    "a read-only buffer": lambda memory, _: frozen_buffer(memory),
    "a memory map": as_memmap,
    "a lender": lambda memory, _: (memory, Lender(memory)),
    "a subclass": lambda memory, _: (memory, memory.view(Subclass)),
    "a part of a larger one": lambda memory, _: part_of_a_larger_one(memory),
    "a memoryview": lambda memory, _: (memory, memoryview(memory)),
}


def test_writing_into_any_array_of_a_mesh_changes_nothing(tmp_path):
    """Every array is handed over in some of the ways, each way with some of the arrays: all meet in turns."""
    keys = list(inputs())
    expected = picture_of(mesh_of(inputs()))
    for k, (way, hand) in enumerate(WAYS.items()):
        for key in {keys[k % len(keys)], keys[(k + 4) % len(keys)], "vertices", "faces"}:
            given = inputs()
            memory, handed = hand(given[key], tmp_path)
            mesh = mesh_of(given | {key: handed})
            with rz.Renderer(rz.Scene([mesh], GREY, CAMERA), SIZE, threads=1, samples=1) as renderer:
                before = renderer.render().color.tobytes()
                spoil(memory)
                assert renderer.render().color.tobytes() == before, f"{key} as {way}: a Renderer sees what was written"
            assert picture_of(mesh) == expected, f"{key} as {way}: pictures differ"


def test_no_array_of_a_mesh_can_be_written_to():
    meshes = [mesh_of(inputs())]
    meshes += [copy.deepcopy(meshes[0]), copy.copy(meshes[0])]
    meshes += [pickle.loads(pickle.dumps(meshes[0], protocol)) for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1)]
    n_copy = len(meshes)
    meshes += [replace(meshes[0], name="b"), meshes[0].transformed(np.eye(4)), rz.Mesh.from_any(meshes[0])]
    for name in [*inputs(), "used_vertices", "bounds"]:
        for k, mesh in enumerate(meshes):
            stored = getattr(mesh, name)
            for view in (stored, stored[:1], stored.T, stored.reshape(-1), stored.view()):
                with pytest.raises(ValueError):
                    view[...] = 0
                with pytest.raises(ValueError):
                    view.flags.writeable = True
            assert k >= n_copy or stored.tobytes() == getattr(meshes[0], name).tobytes(), f"{name} of copy {k}"


def test_buffers_of_a_pickle_stay_the_callers():
    """Protocol 5 can hand arrays over outside of the pickle, in memory that its owner writes to."""
    buffers, mesh = [], mesh_of(inputs())
    pickled = pickle.dumps(mesh, protocol=5, buffer_callback=buffers.append)
    memory = [bytearray(buffer.raw()) for buffer in buffers]
    loaded = pickle.loads(pickled, buffers=memory)
    for buffer in memory:
        buffer[:] = b"\xff" * len(buffer)
    assert picture_of(loaded) == picture_of(mesh)


def test_meshes_made_of_others_share_their_memory():
    """Ten million faces are not held twice because a material was changed."""
    mesh = mesh_of(inputs())
    other = replace(mesh, name="other")
    for key in inputs().keys() - {"normals"}:
        assert np.shares_memory(getattr(mesh, key), getattr(other, key)), key
    vertices = inputs()["vertices"].astype(np.float32)
    assert not differences(rz.Mesh(vertices, inputs()["faces"]).vertices, vertices)


def test_writing_into_the_image_of_a_texture_changes_nothing():
    plain = np.random.default_rng(3).uniform(0, 1, (8, 8, 4)).astype(np.float32)
    for kind in ("array", "bytes", "picture", "view"):
        image = (plain * 255).astype(np.uint8) if kind in ("bytes", "picture") else plain.copy()
        handed = Image.fromarray(image) if kind == "picture" else read_only_view(image)[1] if kind == "view" else image
        mesh = mesh_of(inputs(), handed)
        expected = picture_of(mesh)
        image[...] = 0
        if kind == "picture":
            handed.paste((0, 0, 0, 0), (0, 0, 8, 8))
        assert picture_of(mesh) == expected, kind
    texture = mesh.materials[0].texture
    for each in (texture, copy.deepcopy(texture), pickle.loads(pickle.dumps(texture))):
        with pytest.raises(ValueError):
            each.image.flags.writeable = True


def test_writing_into_what_else_a_scene_is_made_of_changes_nothing():
    """Cameras, lights, colours, spectra, lists of meshes and lights."""
    numbers = {key: np.array(value, float) for key, value in {
        "position": (1, 2, 4), "target": (0, 0, 0), "up": (0, 1, 0), "color": (0.5, 0.4, 0.3), "direction": (0, -1, -1),
        "place": (2, 2, 2), "behind": (0.1, 0.2, 0.3), "diffuse": (0.5, 0.6, 0.7), "waves": (400, 500, 700),
        "values": (0.2, 0.9, 0.4),
        "corner": (1, 1, 3), "edge_u": (1, 0, 0), "edge_v": (0, 1, 0), "attenuation": (1, 0.1, 0),
    }.items()}  # fmt: skip
    material = rz.Material(diffuse=numbers["diffuse"], specular=rz.Spectrum(numbers["waves"], numbers["values"]))
    meshes = [rz.Mesh(inputs()["vertices"], inputs()["faces"], material=material)]
    lights = [
        rz.AmbientLight(numbers["color"]),
        rz.DirectionalLight(numbers["direction"], numbers["color"]),
        rz.PointLight(numbers["place"], numbers["color"], numbers["attenuation"]),
        rz.SpotLight(numbers["place"], numbers["direction"], numbers["color"]),
        rz.AreaLight(numbers["corner"], numbers["edge_u"], numbers["edge_v"], numbers["color"], resolution=(2, 2)),
    ]
    camera = rz.Camera.perspective(numbers["position"], numbers["target"], numbers["up"], fov=40)
    scene = rz.Scene(meshes, lights, camera, numbers["behind"])
    matrices = np.array([[40.0, 0, 16], [0, 40, 12], [0, 0, 1]]), np.diag([1.0, -1, -1]), np.array((0.0, 0, 4))
    other = rz.Camera.from_opencv(*matrices, SIZE)

    def pictures():
        found = [
            rz.render(scene, SIZE, spectral=spectral, threads=1, samples=1).color.tobytes() for spectral in (None, 8)
        ]
        with rz.Renderer(scene, SIZE, threads=1, samples=1) as renderer:
            return [*found, renderer.render(other).color.tobytes()]

    expected = pictures()
    for memory in (*numbers.values(), *matrices):
        memory[...] = np.nan
    meshes.clear()
    lights.clear()
    assert pictures() == expected


def test_indices_written_after_the_check_do_not_end_the_process():
    """In a process of its own: it died of reading outside the vertices."""
    assert_runs(
        "import numpy as np, rasterizer as rz\n"
        "vertices = np.random.default_rng(1).normal(size=(300, 3))\n"
        "for dtype in (np.uint32, np.int64):\n"
        "    for crease in (None, 0.0):\n"
        "        faces = np.random.default_rng(2).integers(0, 300, (5000, 3)).astype(dtype)\n"
        "        mesh = rz.Mesh(vertices.copy(), faces, crease_angle=crease)\n"
        "        faces[...] = 2**31 - 1\n"
        "        for shading in ('flat', 'gouraud', 'phong'):\n"
        "            rz.render(mesh, 32, shading=shading, threads=1)\n"
    )
