"""Read GLB and glTF: triangles, and with them materials, lights and cameras, which other modules take from the same
JSON tree.

    bytes ─ tree ─ primitives ─ parts ─ placed by their nodes
                   buffers      each as often as nodes show it

Nothing of a file is followed before it has been checked: see `gltf_arrays`. Parts share their arrays; a file may ask
for up to `MOST_COPIES` triangles more than it holds.
Format: Khronos, glTF 2.0 Specification, 2021.
"""

import json
import struct

import numpy as np

from ..errors import ModelError, SceneError, warn_caller
from ..scene.material import Material
from .gltf_arrays import Buffers, item
from .gltf_left_out import USED, count_points_and_lines, list_left_out
from .gltf_material import Paint, Pictures, linear_values, read_paint, uv_from_gltf
from .gltf_nodes import read_lights_and_camera, world_matrices
from .model_file import WHITE, Contents, ModelFile, Part

MOST_COPIES = 2**23  # triangles that are there because nodes or primitives refer to the same ones: some 2 GB
_GLB_MAGIC, _JSON_CHUNK = 0x46546C67, 0x4E4F534A
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_UNREADABLE = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
_NO_PAINT = Paint(Material(), colored=WHITE)  # what names no material is neutral grey here, no metal
_SPARSE_USE = 4  # times as many vertices as corners: then only those in use are taken out


def read_gltf(model: ModelFile) -> Contents:
    """Read the triangle meshes, lights and cameras of a GLB or glTF file.

    Returns
    -------
    Contents whose parts are pairs (part, world_from_mesh (4, 4) float64), one for each node that shows a mesh, in the
    order of the file's meshes

    Raises
    ------
    ModelError : the file can't be read, or a light or camera is not legal

    Warns
    -----
    UserWarning : a texture is missing or can't be read; the file says that it needs an extension that isn't read
    """
    tree, tail = _read_tree(model)
    try:
        _check_version_and_extensions(model, tree)
        lights, camera = read_lights_and_camera(model, tree)
        buffers = Buffers(model, tree, tail)
        shown = _shown_meshes(tree)
        _check_copies(model, tree, shown)
        primitives = {number: _primitives(tree, number) for number, _ in shown}
        listed = [primitive for each in primitives.values() for primitive in each]
        used = {primitive.get("material") for primitive in listed}
        pictures = Pictures(buffers)
        paints = [
            read_paint(source, pictures) if number in used else _NO_PAINT
            for number, source in enumerate(tree.get("materials", []))
        ]
        parts = _make_parts(tree, primitives, buffers, paints)
        others = (*count_points_and_lines(tree, listed), (), list_left_out(tree, listed, used))
    except ModelError:
        raise
    except (TypeError, AttributeError, LookupError, ValueError, ArithmeticError, SceneError) as fault:
        reason = f"{type(fault).__name__}: {' '.join(str(fault).split())[:200]}"
        raise model.error(f"not a readable {'GLB' if model.format == 'glb' else 'glTF'} file ({reason})") from fault
    return Contents([(part, matrix) for number, matrix in shown for part in parts[number]], lights, camera, *others)


def _check_version_and_extensions(model, tree) -> None:
    """Refuse what can't be read, and warn of what may look otherwise than it should."""
    version = str(tree.get("asset", {}).get("version", "2.0"))
    if version.partition(".")[0] != "2":
        raise model.error(f"glTF of version {version[:20]}; 2.0 is read")
    required = [str(name) for name in tree.get("extensionsRequired", [])]
    for extension in _UNREADABLE:
        if extension in required:
            raise model.error(f"compressed with {extension}, which can't be read; export it without compression")
    unknown = sorted({*required} - USED)
    if unknown:
        names = ", ".join(name[:80] for name in unknown[:5])
        warn_caller(f"{model.name}: the file needs {names}, which is not read: it may look otherwise than it should")


def _primitives(tree, number) -> list[dict]:
    """Return the primitives of a mesh; those without positions show nothing."""
    return [each for each in item(tree, "meshes", number)["primitives"] if "POSITION" in each["attributes"]]


def _shown_meshes(tree) -> list[tuple[int, np.ndarray]]:
    """Return the numbers of the meshes that nodes show, and their places, in the order of the meshes."""
    places = sorted(world_matrices(tree).items(), key=lambda place: place[0])
    found = [
        (item(tree, "nodes", number)["mesh"], matrix) for number, matrix in places if "mesh" in tree["nodes"][number]
    ]
    for number, _ in found:
        item(tree, "meshes", number)
    return sorted(found, key=lambda pair: pair[0])


def _check_copies(model, tree, shown) -> None:
    """Raise ModelError where nodes and primitives repeat more triangles than may be made."""
    accessors, wanted = {}, {}
    for number in {number for number, _ in shown}:
        wanted[number] = 0
        for primitive in _primitives(tree, number):
            source = primitive["indices"] if "indices" in primitive else primitive["attributes"]["POSITION"]
            accessors[source] = item(tree, "accessors", source)["count"]
            wanted[number] += accessors[source] // (3 if primitive.get("mode", _TRIANGLES) == _TRIANGLES else 1)
    asked, held = sum(wanted[number] for number, _ in shown), sum(accessors.values())
    if asked > held + MOST_COPIES:
        raise model.error(
            f"its nodes and primitives ask for {asked} triangles, more than {MOST_COPIES} of them copies: too many"
        )


def _make_parts(tree, primitives, buffers, paints) -> dict[int, list[Part]]:
    """Return the parts of each mesh by its number, one a primitive of triangles; each gets a name of its own."""
    parts, names = {}, {}
    for number in sorted(primitives):
        parts[number] = []
        name = str(item(tree, "meshes", number).get("name", "GLTF"))
        for primitive in primitives[number]:
            if primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP, _FAN):
                names[name] = names.get(name, -1) + 1
                own = f"{name}_{names[name]}" if names[name] else name
                part = _part(primitive, buffers, _paint_of(primitive, paints), own)
                parts[number] += [part] if len(part["faces"]) else []
    return parts


def _paint_of(primitive, paints) -> Paint:
    """Return the paint of a primitive, the default one where it names none."""
    number = primitive.get("material")
    return paints[number] if isinstance(number, int) and number < len(paints) else _NO_PAINT


def _read_tree(model):
    """Return the JSON tree, and what follows it in a GLB file."""
    text, tail = model.data, b""
    if model.format == "glb":
        if len(text) < 20:
            raise model.error(f"not a GLB file: {len(text)} bytes")
        magic, version, _, length, kind = struct.unpack("<5I", text[:20])
        if magic != _GLB_MAGIC or version != 2 or kind != _JSON_CHUNK:
            raise model.error("not a GLB file of version 2")
        text, tail = text[20 : 20 + length], text[20 + length :]
    try:
        tree = json.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError) as fault:
        raise model.error(f"not a readable glTF file ({fault})") from fault
    if not isinstance(tree, dict):
        raise model.error("not a glTF file: no object at its top")
    return tree, tail


def _part(primitive, buffers, paint, name) -> Part:
    """Turn one primitive into a part; its vertex colours multiply its base colour."""
    attributes = primitive["attributes"]
    vertices = buffers.array(attributes["POSITION"])
    n_vertex = len(vertices)
    corners = buffers.array(primitive["indices"]) if "indices" in primitive else np.arange(n_vertex)
    if corners.dtype.kind not in "iu" or corners.size != len(corners):
        raise ValueError("indices must be whole numbers, one a row")
    faces = _faces(corners.reshape(-1).astype(np.int64), primitive.get("mode", _TRIANGLES))
    wanted = {"normals": "NORMAL", "uv": f"TEXCOORD_{paint.uv_set}", "colors": "COLOR_0"}
    found = {key: buffers.array(attributes[source]) for key, source in wanted.items() if source in attributes}
    arrays = {"vertices": vertices} | {key: array for key, array in found.items() if len(array) == n_vertex}
    if n_vertex > _SPARSE_USE * faces.size > 0 and faces.max() < n_vertex:
        used, faces = np.unique(faces, return_inverse=True)
        faces = faces.reshape(-1, 3)
        arrays = {key: array[used] for key, array in arrays.items()}
    part = {"vertices": _real(arrays["vertices"], attributes["POSITION"], buffers), "faces": faces, "name": name}
    part["material"] = paint.material
    if np.shape(arrays.get("normals"))[1:] == (3,):
        part["normals"] = _real(arrays["normals"], attributes["NORMAL"], buffers)
    if np.shape(arrays.get("uv"))[1:] == (2,):
        part["uv"] = uv_from_gltf(arrays["uv"], paint.uv_matrix)
    if np.shape(arrays.get("colors"))[1:] in ((3,), (4,)):
        part["colors"] = linear_values(arrays["colors"])
        part["material"] = paint.colored or paint.material
    return part


def _real(rows, number, buffers) -> np.ndarray:
    """Return rows of an accessor as float64; integers that are meant as fractions become such."""
    is_fraction = item(buffers.tree, "accessors", number).get("normalized") is True
    return linear_values(rows) if is_fraction else rows.astype(np.float64)


def _faces(corners, mode) -> np.ndarray:
    """Return the triangles (n, 3) of a list of corners, of a strip or of a fan."""
    if mode == _TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)  # one or two corners more make no triangle
    if mode == _FAN:
        return np.stack([np.broadcast_to(corners[:1], max(len(corners) - 2, 0)), corners[1:-1], corners[2:]], axis=1)
    faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    faces[1::2] = faces[1::2, ::-1]  # every other triangle of a strip is turned round
    return faces
