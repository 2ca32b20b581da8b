"""Read GLB and glTF through trimesh, but keep coefficients and colours, which it rounds to 8 bits or drops.

The JSON tree is read first. Vertex colours and texture coordinates are renamed to custom attributes, which
trimesh hands on as they are; materials, lights and cameras are taken from the tree: `gltf_material`, `gltf_scene`.
Format: Khronos, glTF 2.0 Specification, 2021.
"""

import json
import struct
from urllib.parse import unquote

import numpy as np

from rasterizer.errors import ModelError, SceneError
from rasterizer.scene.gltf_material import Paint, Pictures, linear_values, read_paint, uv_from_gltf
from rasterizer.scene.gltf_scene import read_lights_and_camera
from rasterizer.scene.material import Material
from rasterizer.scene.parse import Contents, ModelFile, Part, part_from, run_trimesh, triangle_meshes

_GLB_MAGIC, _JSON_CHUNK = 0x46546C67, 0x4E4F534A
_READ_MODES = (0, 1, 4, 5)  # points, lines, triangles, strips: what becomes a geometry in trimesh
_UNREADABLE = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")


class FolderFiles:
    """The files beside a model, by the names that the model gives them."""

    def __init__(self, model: ModelFile):
        self.model = model

    def __getitem__(self, name):
        if self.model.folder is None:
            raise self.model.error(f"needs the file '{name}', but was given without a folder")
        try:
            return (self.model.folder / unquote(name)).read_bytes()
        except (OSError, ValueError) as fault:
            raise self.model.error(f"needs the file '{name}', which can't be read ({fault})") from fault


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
    UserWarning : a texture is missing or can't be read
    """
    tree, tail = _read_tree(model)
    try:
        _check_tree(model, tree)
        lights, camera = read_lights_and_camera(model, tree)
        pictures = Pictures(model, tree, tail, FolderFiles(model))
        primitives = [primitive for mesh in tree.get("meshes", []) for primitive in mesh["primitives"]]
        used = {primitive.get("material") for primitive in primitives}
        paints = [
            read_paint(source, pictures) if number in used else Paint(Material())
            for number, source in enumerate(tree.get("materials", []))
        ]
        primitives = _set_aside(tree, primitives, paints)
    except ModelError:
        raise
    except (TypeError, AttributeError, LookupError, ValueError, OverflowError, SceneError) as fault:
        raise model.error(f"not a readable glTF file ({type(fault).__name__}: {fault})") from fault
    scene = run_trimesh(model, _write_tree(model, tree, tail), FolderFiles(model))
    if len(primitives) != len(scene.geometry):
        raise model.error("not a readable glTF file (another number of meshes than its tree says)")
    by_name = dict(zip(scene.geometry, primitives, strict=True))
    parts = {}
    for name, mesh in triangle_meshes(scene).items():
        number = by_name[name].get("material")
        parts[name] = _part(mesh, name, _paint_of(by_name[name], paints), number is not None)
    return Contents(_instances(scene, parts), lights, camera)


def _paint_of(primitive, paints) -> Paint:
    """Return the paint of a primitive, the default one where it names none."""
    number = primitive.get("material")
    return paints[number] if isinstance(number, int) and number < len(paints) else Paint(Material())


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


def _write_tree(model, tree, tail):
    """Return the file with a changed tree."""
    text = json.dumps(tree).encode()
    if model.format != "glb":
        return text
    text += b" " * (-len(text) % 4)
    return struct.pack("<5I", _GLB_MAGIC, 2, 20 + len(text) + len(tail), len(text), _JSON_CHUNK) + text + tail


def _check_tree(model, tree):
    """Raise for what trimesh would silently replace by zeros."""
    for extension in _UNREADABLE:
        if extension in tree.get("extensionsRequired", []):
            raise model.error(f"compressed with {extension}, which can't be read")
    primitives = [primitive for mesh in tree.get("meshes", []) for primitive in mesh["primitives"]]
    used = {number for primitive in primitives for number in primitive["attributes"].values()}
    used |= {primitive.get("indices") for primitive in primitives}
    for number, accessor in enumerate(tree.get("accessors", [])):
        if number in used and ("sparse" in accessor or "bufferView" not in accessor):
            raise model.error(f"accessor {number} is sparse or has no data, which can't be read")
        if "bufferView" not in accessor:
            accessor["count"] = 0  # of a morph target or an animation; trimesh would make room for it


def _set_aside(tree, primitives, paints) -> list[dict]:
    """Take out of the tree what is read here, or what trimesh would convert; return the primitives that become geometries.

    Vertex colours get a name of their own, as do the texture coordinates that the primitive's texture uses.
    """
    for primitive in primitives:
        attributes = primitive["attributes"]
        wanted = f"TEXCOORD_{_paint_of(primitive, paints).uv_set}"
        for name in [name for name in attributes if name.startswith(("COLOR_", "TEXCOORD_"))]:
            number = attributes.pop(name)
            if name in ("COLOR_0", wanted):
                attributes["_color" if name == "COLOR_0" else "_uv"] = number
        primitive.pop("extensions", None)
    kept = [dict(primitive) for primitive in primitives if primitive.get("mode", 4) in _READ_MODES]
    for primitive in primitives:
        primitive.pop("material", None)
    for key in ("materials", "images", "textures", "samplers", "cameras"):
        tree.pop(key, None)
    for node in tree.get("nodes", []):
        node.pop("camera", None)  # trimesh would leave out all below it
    return kept


def _part(mesh, name, paint, has_material) -> Part:
    """Turn one primitive into a part; its vertex colours multiply its base colour."""
    colors = mesh.vertex_attributes.get("_color")
    part = part_from(mesh, name)
    part["material"] = paint.material
    part.pop("uv", None)
    uv = mesh.vertex_attributes.get("_uv")
    if np.shape(uv) == (len(mesh.vertices), 2):
        part["uv"] = uv_from_gltf(uv, paint.uv_matrix)
    if np.shape(colors) in ((len(mesh.vertices), 3), (len(mesh.vertices), 4)):
        part["colors"] = linear_values(colors)
        part["material"] = paint.material if has_material else Material(diffuse=1.0)
    return part


def _instances(scene, parts) -> list[tuple[Part, np.ndarray]]:
    """Place every part once for each node that shows it."""
    placed = []
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        if name in parts:
            placed.append((parts[name], np.asarray(matrix, np.float64)))
    order = {name: number for number, name in enumerate(parts)}
    return sorted(placed, key=lambda pair: order[pair[0]["name"]])
