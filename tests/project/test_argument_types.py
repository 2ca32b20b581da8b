"""A sweep: every parameter of every public name is given what it is not for; only errors of the package come out."""

import inspect
import json
import warnings
from itertools import cycle, islice

import numpy as np
import pytest
from helpers.arrays import differences

import rasterizer as rz

BAD = [
    None, "", b"", "x", b"x", object(), float("nan"), float("inf"), -1, 0, 1, 1.5, 10**400, -(10**400), [0] * 10**5,
    1j, True, {},
    {"a": 1}, (), [], [None], [[1, 2], [3]], (1, 2), (1, 2, 3), ("a", "b"), np.zeros((2, 2, 2)), np.zeros(3, complex),
    np.array("x"),
    np.array([object()]), np.float64(2), int, range(3), {1, 2}, slice(3), b"\0", "\0", "\ud800", 2**31, 2**63, 5e-324,
    np.full(3, np.nan), [float("nan")] * 3, [10**400] * 3, ["a"] * 3,
]  # fmt: skip
USUAL = [None, "x", object(), float("nan"), -1, [float("nan")] * 3]  # what each parameter is given by default
MESH = rz.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
SCENE = rz.Scene(MESH)
CAMERA = rz.Camera.perspective((0, 0, 5))
SPECTRUM = rz.Spectrum.blackbody(4000)
PIXELS = np.zeros((2, 2, 3), np.uint8)
SPAN = {"wavelengths": [400, 700]}


def calls(folder):
    """What is called, with arguments that are right."""
    camera = {"opencv": {"K": np.eye(3).tolist(), "R": np.eye(3).tolist(), "t": [0, 0, 1]}}
    line = {"index": 0, "files": {"rgb": "x.png"}, "model": None, "depth_scale": None, "size": [8, 8], "objects": []}
    (folder / "m.jsonl").write_text(json.dumps(line | {"camera": camera}))
    (folder / "x.png").write_bytes(b"")
    frame = rz.render(SCENE, 8, outputs=("color", "depth", "face", "normal"))
    renderer = rz.Renderer(SCENE, 8, samples=1)
    yield from [
        (rz.AmbientLight, {}), (rz.AreaLight, {"corner": (0, 0, 0), "edge_u": (1, 0, 0), "edge_v": (0, 1, 0)}),
        (rz.DirectionalLight, {"direction": (0, 0, -1)}), (rz.PointLight, {"position": (0, 0, 1)}),
        (rz.SpotLight, {"position": (0, 0, 1), "direction": (0, 0, -1)}),
        (rz.Camera, {"position": (0, 0, 5), "fov": 30}),
        (rz.Material, {}), (rz.Mesh, {"vertices": MESH.vertices, "faces": MESH.faces}), (rz.Options, {}),
        (rz.Scene, {"meshes": MESH}),
        (rz.Shadow, {}), (rz.Spectrum, SPAN | {"values": [1, 1]}), (rz.Texture, {"image": PIXELS}),
        (rz.compare, {"a": frame, "b": frame}),
        (rz.color_difference, {"a": frame, "b": frame}),
        (rz.Animation, {"frames": [frame, frame]}), (rz.RenderTask, {"source": MESH, "output": "x.png"}),
        (rz.render_many, {"tasks": ()}), (rz.explain, {"scene": SCENE, "x": 4, "y": 4, "size": 8}),
        (rz.load, {"source": MESH}), (rz.srgb, {"colors": (255, 128, 0)}),
        (rz.mach_bands, {"picture": frame, "scene": SCENE}),
        (rz.render, {"scene": SCENE, "size": 8}),
        (rz.Renderer, {"scene": SCENE, "size": 8}), (rz.sheet, {"frames": [frame]}),
        (rz.Camera.framing, {"subject": MESH}),
        (rz.Camera.orbit, {"subject": MESH, "azimuths": 2}), (rz.Camera.from_pose, {"pose": np.eye(4)}),
        (rz.Camera.random, {"subject": MESH, "seed": 3}), (rz.random_lights, {"seed": 3}),
        (rz.read_manifest, {"path": folder / "m.jsonl"}),
        (rz.write_bop, {"manifest": folder / "m.jsonl", "folder": folder / "bop"}),
        (rz.write_nerf, {"path": folder / "t.json", "cameras": {"x.png": CAMERA}, "size": (8, 8)}),
        (rz.read_nerf, {"path": folder / "t.json"}),
        (rz.write_colmap, {"folder": folder / "sparse", "cameras": {"x.png": CAMERA}, "size": (8, 8)}),
        (rz.read_colmap, {"folder": folder / "sparse"}),
        (CAMERA.project, {"points": [[0, 0, 0]], "size": (8, 8)}),
        (rz.Camera.look_at, {"position": (0, 0, 5)}), (MESH.translated, {"offset": (1, 2, 3)}),
        (MESH.rotated, {"angle": 30}), (MESH.scaled, {"factor": 2}), (MESH.with_material, {"material": "gold"}),
        (rz.Camera.from_opencv, {"K": np.diag([50, 50, 1]), "R": np.eye(3), "t": (0, 0, 5), "size": (16, 16)}),
        (rz.Camera.orthographic, {"position": (0, 0, 5)}), (rz.Camera.perspective, {"position": (0, 0, 5)}),
        (CAMERA.to_opencv, {"size": (4, 4)}), (CAMERA.projection, {"size": (4, 4)}),
        (rz.Mesh.from_any, {"source": MESH}),
        (MESH.subdivide, {}), (MESH.transformed, {"matrix": np.eye(4)}), (SCENE.framed, {"aspect": 1.0}),
        (SCENE.camera_for, {"size": (4, 4)}), (rz.save, {"scene": SCENE, "path": folder / "y.json"}),
        (frame.save, {"path": folder / "x.png"}), (frame.encode, {}), (frame.encode_array, {}),
        (frame.encode_file, {"format": "png"}),
        (frame.has, {"name": "rgb"}),
        (renderer.render, {}), (rz.Spectrum.blackbody, {"kelvin": 4000}), (SPECTRUM.at, {"wavelengths": [500]}),
        (rz.Spectrum.flat, {"value": 1}), (rz.Spectrum.of_power, SPAN | {"power": [1, 1]}),
        (rz.Spectrum.of_rgb, {"color": "red"}),
        (rz.daylight, {"wavelengths": [500]}), (rz.standard_observer, {"wavelengths": [500]}),
        (SPECTRUM.scaled, {"factor": 2}), (rz.DepthCue, {"scale": 2}),
        (rz.illuminate, {"points": [[0, 0, 0]], "normals": [[0, 0, 1]], "material": rz.Material(),
        "lights": rz.AmbientLight(1),
                         "viewer": (0, 0, 3)}),
    ]  # fmt: skip


def parameters(function) -> list[str]:
    names = [name for name in inspect.signature(function).parameters if name not in ("options", "_")]
    own = list(inspect.signature(rz.Options).parameters) if function in (rz.render, rz.Renderer) else []
    return list(dict.fromkeys(names + own))


def fault_of(function, arguments) -> str | None:
    """What is wrong with how a call ends."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            function(**arguments)
        except rz.RasterizerError as fault:
            if "internal error" in str(fault) or "\n" in str(fault) or len(str(fault)) > 1000:
                return f"{type(fault).__name__}: {str(fault)[:300]}"
        except Exception as fault:
            return f"{type(fault).__name__}: {str(fault)[:200]}"
    strange = [warning for warning in caught if warning.category is not UserWarning]
    return f"{strange[0].category.__name__}: {strange[0].message}" if strange else None


@pytest.mark.parametrize("is_whole", [False, pytest.param(True, marks=pytest.mark.nightly)])
def test_wrong_arguments_raise_errors_of_the_package(folder, is_whole):
    """Each parameter is given a few things of the list, the next one others; at night, all of them."""
    rz.save(SCENE, folder / "x.json")
    faults, others = [], cycle(BAD)
    for function, right in calls(folder):
        assert fault_of(function, right) is None, function
        for name in parameters(function):
            for bad in BAD if is_whole else [*USUAL, *islice(others, 8)]:
                if (fault := fault_of(function, right | {name: bad})) is not None:
                    faults.append(f"{function.__qualname__}({name}={type(bad).__name__}): {fault}")
    assert not faults, "\n".join(faults[:30])


def test_the_sweep_calls_all_that_is_public(tmp_path):
    called = {function.__qualname__ for function, _ in calls(tmp_path)}
    public = {name for name in rz.__all__ if not name.startswith("__") and not name.endswith("Error")}
    made_by_us = {"Comparison", "Explanation", "Frame", "MachBands", "MissingArray", "Pick", "RenderRecord"}
    # They start processes, or draw many frames, or need a notebook, or an extra.
    tested_apart = {"turntable", "view", "write_coco", "reference"}
    missing = [
        name
        for name in public - made_by_us - tested_apart
        if name not in called and inspect.signature(getattr(rz, name)).parameters
    ]
    assert not missing


def test_large_values_make_short_messages():
    for value in (10**5000, [[0] * 10**5] * 3, "x" * 10**6):
        with pytest.raises(rz.SceneError) as caught:
            rz.Camera(position=value, fov=30)
        assert len(str(caught.value)) < 300, str(caught.value)[:300]


class OnlyAnArray:
    """What numpy can read, and nothing else."""

    def __init__(self, values):
        self.values = np.asarray(values)

    def __array__(self, dtype=None, copy=None):
        return np.array(self.values, dtype=dtype)


CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
FACES = {"triangles": np.array([[0, 1, 2], [0, 2, 3]]), "quads": np.array([[0, 1, 2, 3]])}
KINDS = {
    "only an array": OnlyAnArray, "big endian": lambda a: a.astype(a.dtype.newbyteorder(">")),
    "Fortran": np.asfortranarray,
    "backwards": lambda a: a[::-1].copy()[::-1], "strided": lambda a: np.repeat(a, 2, axis=1)[:, ::2],
    "memory": memoryview,
    "a mask without a bit": np.ma.array, "small": lambda a: a.astype(np.float16 if a.dtype.kind == "f" else np.int8),
    "large": lambda a: a.astype(np.longdouble if a.dtype.kind == "f" else np.uint64),
    "broadcast": lambda a: np.broadcast_to(a, a.shape),
}  # fmt: skip


def test_arrays_of_any_layout_make_the_same_mesh():
    for faces in FACES.values():
        plain = rz.Mesh(CORNERS, faces)
        for kind, make in KINDS.items():
            mesh = rz.Mesh(make(CORNERS), make(faces))
            assert np.array_equal(mesh.vertices, plain.vertices) and np.array_equal(mesh.faces, plain.faces), kind


def masked(values):
    array = np.ma.array(values, float)
    array[0] = np.ma.masked
    return array


@pytest.mark.filterwarnings("error")
def test_masked_values_are_refused_and_never_read():
    """What a mask hides would else be drawn."""
    light, up = rz.AmbientLight(1.0), (0, 0, 1)
    calls = [
        lambda: rz.Mesh(masked(CORNERS), FACES["quads"]),
        lambda: rz.Mesh(CORNERS, np.ma.array(FACES["triangles"], mask=[[1, 0, 0], [0, 0, 0]])),
        lambda: rz.Mesh(CORNERS, FACES["quads"], uv=masked(CORNERS[:, :2])),
        lambda: rz.Mesh(CORNERS, FACES["quads"], normals=masked(CORNERS)),
        lambda: MESH.transformed(masked(np.eye(4))), lambda: rz.Texture(masked(np.ones((4, 4)))),
        lambda: rz.Spectrum([400, 500], masked([1, 1])),
        lambda: rz.illuminate(masked(CORNERS), up, "gold", light, toward_viewer=up),
        lambda: rz.Camera(position=masked(up), fov=30),
        lambda: rz.Material(diffuse=masked(up)), lambda: rz.Material(shininess=np.ma.masked),
        lambda: rz.render(MESH, 8, exposure=np.ma.masked, samples=1),
        lambda: rz.render(MESH, 8, tolerance=np.ma.masked, samples=1),
        lambda: rz.Mesh(np.full((3, 3), np.longdouble("1e4000")), [[0, 1, 2]]),
    ]  # fmt: skip
    for call in calls:
        with pytest.raises(rz.RasterizerError):
            call()
    assert not differences(np.isfinite(rz.Spectrum.blackbody(1e308).values), True)
