"""Read GLB and glTF: triangles, and with them materials, lights and cameras.

    bytes ─ tree ─ primitives ─ parts ─ placed by their nodes
                   buffers      each as often as nodes show it

Nothing of a file is followed before it has been checked, and what it asks for is counted first, see `model_file.py`.
Meshes stand as their nodes, joints and weights of morph targets do: in the pose of the file, without its animations.
Format: Khronos, glTF 2.0 Specification, 2021.
"""

import base64
import binascii
import json
import math
import struct
from collections.abc import Iterable, Iterator
from io import BytesIO
from typing import NamedTuple
from urllib.parse import unquote, unquote_to_bytes

import numpy as np

from ..errors import ModelError, SceneError
from ..scene.arrays import fixed
from ..scene.camera import Camera
from ..scene.material import WHITE, Material
from ..scene.of_gltf import (
    GLOSSY,
    UNLIT,
    Fault,
    camera_of,
    emission_of,
    light_of,
    lit_fields,
    numbers_of,
    opacity_fields,
    unlit_fields,
)
from ..scene.scalars import Fields
from ..scene.texture import Texture, decode_ahead, least_of, mean_of_numbers, read_picture
from .model_file import SCALED_AWAY, Contents, ModelFile, Part, name_in, within_1

_GLB_MAGIC, _JSON_CHUNK = 0x46546C67, 0x4E4F534A
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_UNREADABLE = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
_COMPRESSED = "compressed with {}, which can't be read; export it without compression"
_CARRIED = ("JOINTS_", "WEIGHTS_")  # attributes: four joints and weights each
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
        places = world_matrices(model, tree)
        lights, camera = read_lights_and_camera(model, tree, places)
        buffers = Buffers(model, tree, tail)
        shown = _shown_meshes(model, tree, places)
        # Primitives without positions show nothing.
        primitives = {
            number: [each for each in item(tree, "meshes", number)["primitives"] if "POSITION" in each["attributes"]]
            for number in dict.fromkeys(pose.mesh for pose, _ in shown)
        }
        model.limits.count_meshes(sum(len(primitives[pose.mesh]) for pose, _ in shown))
        poses = {pose: _weights_of(tree, pose) for pose in dict.fromkeys(pose for pose, _ in shown)}
        for pose, weights in poses.items():
            model.limits.count_bytes(sum(_n_byte(tree, each, pose, weights) for each in primitives[pose.mesh]))
        listed = [primitive for each in primitives.values() for primitive in each]
        used = {primitive.get("material") for primitive in listed}
        pictures = Pictures(buffers)
        pictures.decode_ahead(source for number, source in enumerate(tree.get("materials", [])) if number in used)
        paints = [
            read_paint(source, pictures) if number in used else _NO_PAINT
            for number, source in enumerate(tree.get("materials", []))
        ]
        joints = {skin: _joint_matrices(tree, skin, places, buffers) for skin in {pose.skin for pose in poses}}
        parts = _make_parts(tree, poses, primitives, buffers, paints, joints)
        left_out, unused = list_left_out(tree, used)
        counts = count_points_and_lines(tree, listed)
    except ModelError:
        raise
    except (TypeError, AttributeError, LookupError, ValueError, ArithmeticError, SceneError) as fault:
        what = "GLB" if model.format == "glb" else "glTF"
        raise model.error(f"not a readable {what} file ({_reason(fault)})") from fault
    placed = [(part, matrix) for pose, matrix in shown for part in parts[pose]]
    return Contents(placed, lights, camera, *counts, left_out=left_out, unused=unused)


def _reason(fault: Exception) -> str:
    """Say what is wrong in the words of the file: texts of Python's own errors speak of its objects."""
    if isinstance(fault, (Fault, ModelError, SceneError)):
        return str(fault)
    if isinstance(fault, KeyError):
        return f"{fault.args[0]} is missing"
    return "a value is of another kind than its key's"


def _check_version_and_extensions(model, tree) -> None:
    """Refuse what can't be read, and warn of what may look otherwise than it should."""
    version = str(tree.get("asset", {}).get("version", "2.0"))
    if version.partition(".")[0] != "2":
        raise model.error(f"glTF of version {version[:20]}; 2.0 is read")
    required = [str(name) for name in tree.get("extensionsRequired", [])]
    for extension in _UNREADABLE:
        if extension in required:
            raise model.error(_COMPRESSED.format(extension))
    unknown = sorted({*required} - USED)
    if unknown:
        names = ", ".join(name[:80] for name in unknown[:5])
        model.warn(f"the file needs {names}, which is not read: it may look otherwise than it should")


class Pose(NamedTuple):
    """A mesh as a node shows it."""

    mesh: int  # its number
    skin: int | None  # number of the skin whose joints carry it; None = its node does
    node: int | None  # number of the node that has weights for its morph targets; None = its own count


def _shown_meshes(model, tree, places) -> list[tuple[Pose, np.ndarray]]:
    """Return the meshes that nodes show, and their places, in the order of the meshes."""
    nodes, found = tree.get("nodes", []), []
    for number in sorted(places):
        node = nodes[number]
        if "mesh" in node and _is_there(model, tree, "meshes", node["mesh"], "mesh"):
            is_carried = "skin" in node and _is_there(model, tree, "skins", node["skin"], "skin")
            pose = Pose(node["mesh"], node["skin"] if is_carried else None, number if "weights" in node else None)
            # Where joints carry a mesh, its node's place doesn't count: 3.7.3.3.
            found.append((pose, places[number] if pose.skin is None else np.eye(4)))
    return sorted(found, key=lambda pair: pair[0].mesh)


def _weights_of(tree, pose) -> list[float]:
    """Return the weights of the morph targets of a mesh."""
    holder = item(tree, "meshes", pose.mesh) if pose.node is None else item(tree, "nodes", pose.node)
    return [float(weight) for weight in holder.get("weights", ())]


def _n_byte(tree, primitive, pose, weights) -> int:
    """Return how many bytes of arrays a primitive becomes."""
    mode, attributes = primitive.get("mode", _TRIANGLES), primitive["attributes"]
    if mode not in (_TRIANGLES, _STRIP, _FAN):
        return 0
    n_vertex = whole(item(tree, "accessors", attributes["POSITION"]), "count")
    n_corner = whole(item(tree, "accessors", _counted_accessor(primitive)), "count")
    n_number = 3 * len(attributes) + (0 if pose.skin is None else 24) + 6 * sum(map(bool, weights))
    return 8 * n_number * min(n_vertex, _SPARSE_USE * n_corner) + (8 if mode == _TRIANGLES else 24) * n_corner


def _counted_accessor(primitive):
    """Return the number of the accessor that tells how many corners a primitive has."""
    return primitive["indices"] if "indices" in primitive else primitive["attributes"]["POSITION"]


def _make_parts(tree, poses, primitives, buffers, paints, joints) -> dict[Pose, list[Part]]:
    """Return the parts of each mesh in each pose, one a primitive of triangles; each gets a name of its own."""
    parts, names = {}, {}
    for pose, weights in poses.items():
        parts[pose] = []
        name = name_in(item(tree, "meshes", pose.mesh).get("name", "GLTF"))
        for primitive in primitives[pose.mesh]:
            if primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP, _FAN):
                names[name] = names.get(name, -1) + 1
                own = f"{name}_{names[name]}" if names[name] else name
                wanted, paint = primitive.get("material"), _NO_PAINT
                if type(wanted) is int and 0 <= wanted < len(paints):
                    paint = paints[wanted]
                elif wanted is not None:
                    buffers.model.mend("mesh", "of a material that isn't there: drawn grey")
                part = _part(primitive, buffers, paint, own, weights, joints[pose.skin])
                parts[pose] += [part] if len(part["faces"]) else []
    return parts


def _read_tree(model):
    """Return the JSON tree, and what follows it in a GLB file."""
    text, tail = model.data, b""
    if model.format == "glb":
        if len(text) < 20:
            raise model.error(f"not a GLB file: {len(text)} bytes")
        magic, version, _, length, chunk = struct.unpack("<5I", text[:20])
        if magic != _GLB_MAGIC or version != 2 or chunk != _JSON_CHUNK:
            raise model.error("not a GLB file of version 2")
        text, tail = text[20 : 20 + length], memoryview(text)[20 + length :]
    try:
        tree = json.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError) as fault:
        raise model.error(f"not a readable glTF file ({fault})") from fault
    if not isinstance(tree, dict):
        raise model.error("not a glTF file: no object at its top")
    return tree, tail


def _part(primitive, buffers, paint, name, weights, joints) -> Part:
    """Turn one primitive into a part, moved by the weights of its morph targets and by joints (n, 4, 4), if any; its
    vertex colours multiply its base colour."""
    attributes = {
        key: number
        for key, number in primitive["attributes"].items()
        if key == "POSITION" or _is_there(buffers.model, buffers.tree, "accessors", number, "array of a mesh")
    }
    if "bufferView" not in item(buffers.tree, "accessors", attributes["POSITION"]):
        buffers.refuse_compressed(primitive)
    vertices = buffers.array(attributes["POSITION"])
    n_vertex = len(vertices)
    corners = buffers.array(primitive["indices"]) if "indices" in primitive else np.arange(n_vertex)
    if corners.dtype.kind not in "iu" or corners.size != len(corners):
        raise Fault("indices must be whole numbers, one a row")
    dtype = np.uint32 if corners.dtype.kind == "u" else np.int64
    faces = _faces(corners.reshape(-1).astype(dtype), primitive.get("mode", _TRIANGLES))
    wanted = {"normals": "NORMAL", "uv": f"TEXCOORD_{paint.uv_set}", "colors": "COLOR_0"}
    if paint.numbers is not None:
        wanted["numbers"] = f"TEXCOORD_{paint.numbers[0]}"
    found = {key: buffers.array(attributes[source]) for key, source in wanted.items() if source in attributes}
    if joints is not None:
        found |= {key: buffers.array(attributes[key]) for key in attributes if key.startswith(_CARRIED)}
    for key, source in (("vertices", "POSITION"), ("normals", "NORMAL")):
        if source in attributes and any(weights):
            rows = vertices if key == "vertices" else found["normals"]
            found[key] = _morphed(rows, attributes[source], primitive.get("targets", ()), source, weights, buffers)
    arrays = {"vertices": vertices} | {key: array for key, array in found.items() if len(array) == n_vertex}
    if n_vertex > _SPARSE_USE * faces.size > 0 and faces.max() < n_vertex:
        used, faces = np.unique(faces, return_inverse=True)
        faces = faces.reshape(-1, 3)
        arrays = {key: array[used] for key, array in arrays.items()}
    else:
        used = slice(None)
    part = {"vertices": _real(arrays["vertices"], attributes["POSITION"], buffers), "faces": faces, "name": name}
    part["material"] = paint.material
    custom = [key for key in attributes if key.startswith("_")]
    part["fields"] = Fields({key: lambda key=key: buffers.array(attributes[key])[used] for key in custom})
    if np.shape(arrays.get("normals"))[1:] == (3,):
        part["normals"] = _real(arrays["normals"], attributes["NORMAL"], buffers)
    if joints is not None and "JOINTS_0" in arrays and "WEIGHTS_0" in arrays:
        _carry(part, arrays, joints)
    if np.shape(arrays.get("uv"))[1:] == (2,):
        uv = _real(arrays["uv"], attributes[wanted["uv"]], buffers)
        part["uv"] = uv_from_gltf(uv, paint.uv_matrix)
        if paint.numbers is not None and np.shape(arrays.get("numbers"))[1:] == (2,):
            uv = _real(arrays["numbers"], attributes[wanted["numbers"]], buffers)
            part["uv"] = np.concatenate([part["uv"], uv_from_gltf(uv, paint.numbers[1])], axis=1)
    if np.shape(arrays.get("colors"))[1:] in ((3,), (4,)):
        part["colors"] = linear_values(arrays["colors"])
        part["material"] = paint.colored or paint.material
    return part


def _morphed(rows, number, targets, source, weights, buffers) -> np.ndarray:
    """Return the rows of an accessor with what morph targets add to them, float64."""
    moved = _real(rows, number, buffers)
    for target, weight in zip(targets, weights, strict=False):
        if weight and source in target:
            moved = moved + weight * _real(buffers.array(target[source]), target[source], buffers)
    return moved


def _joint_matrices(tree, number, places, buffers) -> np.ndarray | None:
    """Return world-from-bound matrices (n, 4, 4) of a skin's joints; None for no skin. Source: 3.7.3.1."""
    if number is None:
        return None
    skin = item(tree, "skins", number)
    for joint in skin["joints"]:
        item(tree, "nodes", joint)
    world = np.array([places.get(joint, np.eye(4)) for joint in skin["joints"]]).reshape(-1, 4, 4)
    if "inverseBindMatrices" not in skin:
        return world
    bound = buffers.array(skin["inverseBindMatrices"])[: len(world)].astype(np.float64)
    with np.errstate(all="ignore"):  # Mesh refuses vertices that are not finite
        return world @ bound.reshape(-1, 4, 4).transpose(0, 2, 1)


def _carry(part, arrays, joints) -> None:
    """Move the vertices of a part as its joints carry them, each by the sum of their matrices, weighted."""
    numbers = [np.asarray(arrays[key]) for key in sorted(arrays) if key.startswith(_CARRIED[0])]
    weights = [linear_values(arrays[key]) for key in sorted(arrays) if key.startswith(_CARRIED[1])]
    numbers, weights = np.concatenate(numbers, axis=1), np.concatenate(weights, axis=1)
    is_bare = ~weights.any(axis=1)  # what nothing carries would fall into the origin: its first joint does
    weights[is_bare, 0] = 1.0
    numbers[is_bare & ~(numbers[:, 0] < len(joints)), 0] = 0
    vertices, matrices, total = part["vertices"], np.zeros((len(part["vertices"]), 3, 4)), 0.0
    for number, weight in zip(numbers.T, weights.T, strict=True):
        number = np.where(weight == 0.0, 0, number)
        if number.dtype.kind not in "iu" or number.max() >= len(joints):
            raise Fault(f"a vertex is carried by joint {number.max()}; its skin has {len(joints)}")
        matrices += weight[:, None, None] * joints[number, :3]
        total = total + weight
    with np.errstate(all="ignore"):
        matrices /= np.where(total == 0.0, 1.0, total)[:, None, None]
        part["vertices"] = np.einsum("nij,nj->ni", matrices[..., :3], vertices) + matrices[..., 3]
        a, b, c = matrices[:, 0, :3], matrices[:, 1, :3], matrices[:, 2, :3]
        cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        side = np.sign(np.einsum("ni,ni->n", a, cofactors[:, 0]))  # below 0 where the matrix mirrors
        if "normals" in part:
            part["normals"] = side[:, None] * np.einsum("nij,nj->ni", cofactors, part["normals"])
    if (side < 0.0).mean() > 0.5:
        part["faces"] = part["faces"][:, ::-1]


def _real(rows, number, buffers) -> np.ndarray:
    """Return rows of an accessor as float64; integers that are meant as fractions become such."""
    if rows.dtype == np.float64:  # moved by morph targets
        return rows
    is_fraction = item(buffers.tree, "accessors", number).get("normalized") is True
    with np.errstate(invalid="ignore"):  # of a signalling NaN, which Mesh refuses
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


# ----------------------------------------------------------------
# Buffers, views and accessors: bytes to arrays, each number of the tree checked before it is followed.
#
#     buffer      the binary chunk of a GLB file, a data: URI, or a file beside the model; byteLength bytes are read
#     bufferView  a range of a buffer
#     accessor    rows of numbers in a view, byteStride bytes from one to the next; without a view they are 0. A sparse
#                 one replaces some of them
#
# Arrays are views of the bytes that were read: however often accessors refer to a buffer, it is there once. Rows that
# are in no buffer could be any number of them, so they are counted. Specification, 3.6.

_BIN_CHUNK = 0x004E4942
_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


class Buffers:
    """The bytes that a glTF file refers to.

    Parameters
    ----------
    model : ModelFile
    tree : dict, the file's JSON tree
    tail : what follows the tree in a GLB file
    """

    def __init__(self, model: ModelFile, tree: dict, tail: bytes | memoryview):
        self.model, self.tree, self.tail = model, tree, tail
        self._buffers, self._arrays = {}, {}

    def uri(self, uri, max_bytes: int | None = None) -> bytes:
        """Return what a URI holds or names, up to `max_bytes` bytes.

        Raises ModelError for a file that can't be read or may not be, ValueError for a data: URI that is damaged.
        """
        if not isinstance(uri, str):
            raise Fault(f"uri must be text, not {type(uri).__name__}")
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            try:
                data = base64.b64decode(body) if head.endswith(";base64") else unquote_to_bytes(body)
            except binascii.Error as fault:
                raise Fault(f"a data: URI is damaged ({fault})") from fault
            return data[:max_bytes]
        name = uri if len(uri) <= 80 else uri[:77] + "..."
        beside = self.model.beside
        if beside.path is None:
            raise self.model.error(f"needs the file '{name}', but was given without a folder")
        try:
            return beside.read_bytes(beside.find(unquote(uri).replace("\\", "/")), max_bytes)
        except (OSError, ValueError) as fault:
            reason = getattr(fault, "strerror", None) or fault
            raise self.model.error(f"needs the file '{name}', which can't be read ({reason})") from fault

    def refuse_compressed(self, table: dict) -> None:
        """Raise ModelError where a table of the tree has its numbers in a compressed form alone."""
        for extension in _UNREADABLE:
            if extension in table.get("extensions", {}):
                raise self.model.error(_COMPRESSED.format(extension))

    def view(self, number) -> memoryview:
        """Return the bytes of a bufferView."""
        view = item(self.tree, "bufferViews", number)
        if "uri" not in item(self.tree, "buffers", view["buffer"]) and not self.tail:
            self.refuse_compressed(view)
        data = self._buffer(view["buffer"])
        begin, length = whole(view, "byteOffset", 0), whole(view, "byteLength")
        if begin + length > len(data):
            raise Fault(f"bufferViews {number} ends at byte {begin + length} of a buffer of {len(data)}")
        return memoryview(data)[begin : begin + length]

    def _buffer(self, number) -> bytes | memoryview:
        if number not in self._buffers:
            buffer = item(self.tree, "buffers", number)
            length = whole(buffer, "byteLength")
            data = self.uri(buffer["uri"], length) if "uri" in buffer else self._chunk()
            if len(data) < length:
                raise Fault(f"buffer {number} must have {length} bytes, but has {len(data)}")
            if not buffer.get("uri", "data:").startswith("data:"):
                self.model.limits.n_byte += len(data)
            self._buffers[number] = data
        return self._buffers[number]

    def _chunk(self) -> memoryview:
        """Return the binary chunk of a GLB file, the first that follows the tree."""
        if len(self.tail) < 8:
            raise Fault("a buffer has no uri, and there is no binary chunk")
        length, chunk = struct.unpack_from("<2I", self.tail)
        if chunk != _BIN_CHUNK or length > len(self.tail) - 8:
            raise Fault("the binary chunk is cut off, or of another kind")
        return self.tail[8 : 8 + length]

    def array(self, number) -> np.ndarray:
        """Return the rows (count, width) of an accessor, as they are stored.

        Raises
        ------
        TypeError, LookupError, ValueError : what is none of glTF, reaches beyond its buffer, or asks for too many rows
        """
        if number not in self._arrays:
            self._arrays[number] = self._read(number)
        return self._arrays[number]

    def _read(self, number) -> np.ndarray:
        accessor, label = item(self.tree, "accessors", number), f"accessor {number}"
        dtype = np.dtype(_DTYPES[_known(accessor, "componentType", _DTYPES)])
        width, count = _WIDTHS[_known(accessor, "type", _WIDTHS)], whole(accessor, "count")
        has_view = "bufferView" in accessor
        rows = self._rows(accessor, dtype, (count, width), label) if has_view else None
        if rows is not None and "sparse" not in accessor:
            return rows
        if count < 1:
            raise Fault(f"{label}: {count} rows; 1 is needed")
        self.model.limits.count_bytes(count * width * dtype.itemsize)
        made = np.zeros((count, width), dtype) if rows is None else np.array(rows)
        if "sparse" in accessor:
            self._replace(made, accessor["sparse"], label)
        return made

    def _rows(self, table, dtype, shape, label) -> np.ndarray:
        """Return the rows of a view that a table refers to, without a copy."""
        count, width = shape
        data, begin = self.view(table["bufferView"]), whole(table, "byteOffset", 0)
        row = width * dtype.itemsize
        stride = whole(item(self.tree, "bufferViews", table["bufferView"]), "byteStride", row)
        if stride < 1:
            raise Fault(f"byteStride must be above 0; given {stride}")
        end = begin + (count - 1) * stride + row
        if count < 1 or end > len(data):
            raise Fault(f"{label} of {count} rows ends at byte {end} of {len(data)}")
        # The buffer is as long as the last byte of the last row: checked above.
        return np.ndarray((count, width), dtype, data, begin, (stride, dtype.itemsize))

    def _replace(self, rows, sparse, label) -> None:
        """Put the rows of a sparse accessor where its indices say."""
        count, indices, values = whole(sparse, "count"), sparse["indices"], sparse["values"]
        dtype = np.dtype(_DTYPES[_known(indices, "componentType", _DTYPES)])
        places = self._rows(indices, dtype, (count, 1), f"the indices of {label}")[:, 0]
        if dtype.kind != "u" or places.max() >= len(rows):
            raise Fault(f"the indices of {label} must be whole numbers below {len(rows)}")
        rows[places] = self._rows(values, rows.dtype, (count, rows.shape[1]), f"the values of {label}")


def _known(table, key, legal):
    """Return what a table has under a key; a ValueError that says what is legal where it is something else."""
    if table[key] not in legal:
        raise Fault(f"{key} must be one of {', '.join(map(str, legal))}; given {str(table[key])[:40]}")
    return table[key]


def item(tree, key, number) -> dict:
    """Return an item of one of the tree's lists; a LookupError that names it where it is none."""
    items = tree.get(key, [])
    if type(number) is not int or not 0 <= number < len(items):
        raise Fault(f"{key} has no number {str(number)[:40]}")
    if not isinstance(items[number], dict):
        raise Fault(f"{key} {number} is no table")
    return items[number]


def _is_there(model, tree, key, number, noun) -> bool:
    """Tell whether a list of the tree has an item; count it as left out where it hasn't."""
    items = tree.get(key, [])
    is_there = type(number) is int and 0 <= number < len(items)
    if not is_there:
        model.mend(noun, "that isn't there: left out")
    return is_there


def whole(table, key, default=None) -> int:
    """Return a whole number of at least 0 out of a table; TypeError where it is none, KeyError where it is missing."""
    number = table[key] if default is None else table.get(key, default)
    if type(number) is float and number.is_integer():  # 12.0 is a whole number of JSON, too
        number = int(number)
    if type(number) is not int or number < 0:
        raise Fault(f"{key} must be a whole number of at least 0, not {str(number)[:40]}")
    return number


# ----------------------------------------------------------------
# Materials: coefficients, textures with their samplers, and where on a texture a primitive lies.
#
#     baseColorFactor      diffuse and F0, linear, see below; its alpha: see alphaMode
#     baseColorTexture     texture
#     emissiveFactor       emissive, linear; with an emissiveTexture nothing
#     alphaMode OPAQUE     opacity 1; the texture's alpha is not looked at
#               BLEND      opacity = alpha of the factor; the texture's own alpha multiplies it
#               MASK       alpha of factor and texture together at least alphaCutoff: 1, else 0
#     magFilter, minFilter NEAREST: "nearest"; without mipmaps: "bilinear"; else "trilinear"
#     wrapS, wrapT         "repeat", "clamp" or "mirror"
#     doubleSided          not looked at: both sides are lit and drawn, unless faces seen from behind are culled
#
#     metallicRoughnessTexture   metallic_roughness
#
# All others are left out. Specification, 3.8 and 3.9; KHR_texture_transform.

_NEAREST, _LINEAR = 9728, 9729
_WRAPS = {10497: "repeat", 33071: "clamp", 33648: "mirror"}


class Paint(NamedTuple):
    """A material, and how texture coordinates of the file become those of its texture."""

    material: Material
    uv_set: int = 0  # which TEXCOORD_n
    uv_matrix: np.ndarray | None = None  # (2, 3) float64, new from old; None = as they are
    numbers: tuple[int, np.ndarray | None] | None = None  # both, of a metallic-roughness texture laid otherwise
    colored: Material | None = None  # the one for meshes with colours of vertices; None = the same


_NO_PAINT = Paint(Material(), colored=WHITE)  # what names no material is neutral grey here, no metal


class Pictures:
    """The textures of one file; each is made once for every use that materials make of it.

    Parameters
    ----------
    buffers : Buffers of the file
    """

    def __init__(self, buffers: Buffers):
        self.model, self.tree, self._buffers = buffers.model, buffers.tree, buffers
        self._pixels, self._textures, self._numbers, self._means = {}, {}, {}, {}
        self._contents, self._decoded, self._sources = {}, {}, {}

    def decode_ahead(self, materials: Iterable[dict]) -> None:
        """Decode the images of some of the tree's materials on threads."""
        self._decoded = decode_ahead(self._list_images(materials))

    def _list_images(self, materials) -> Iterator[tuple[int, bytes | memoryview]]:
        """Yield the number and the bytes of each image that materials need, up to one that can't be found."""
        try:
            for use in (use for source in materials for use in textures_of(source)):
                number = self._source(use.get("index", -1))[0]
                if number not in self._contents:
                    self._contents[number] = self._bytes_of(number)
                    yield number, self._contents[number]
        except (ModelError, AttributeError, LookupError, TypeError, ValueError):
            return  # what is wrong is said where it is read

    def texture(self, number: int, is_opaque: bool) -> Texture | None:
        """Return a texture, without alpha for a material that is opaque; None, and a UserWarning, if it is missing."""
        image, sampling = self._source(number)
        key = image, sampling, is_opaque
        if key not in self._textures:
            pixels = self._read(image)
            if pixels is not None and is_opaque:
                pixels = _opaque(pixels)
            self._textures[key] = None if pixels is None else self._sampled(pixels, sampling, image)
        return self._textures[key]

    def _sampled(self, pixels, sampling, image, make=Texture) -> Texture:
        """Make a texture of an image's pixels; `sampling` is its filter and its wrap."""
        filter, wrap = sampling
        return self.model.textures.add(make(pixels, filter=filter, wrap=wrap, name=self._label(image)))

    def numbers(self, use: dict) -> Texture | None:
        """Return a texture of numbers within 0..1, whose green and blue count; None where it is missing, or they are
        the same everywhere, so that their mean says all."""
        key = image, sampling = self._source(use.get("index", -1))
        if key not in self._numbers:
            pixels, self._numbers[key] = self._read(image), None
            if pixels is not None:
                has_color = pixels.ndim == 3 and pixels.shape[2] > 2
                pixels = pixels[..., :3] if has_color else pixels.reshape(*pixels.shape[:2], -1)[..., :1]
                first = pixels[0, 0, -2:]
                if any((row[:, -2:] != first).any() for row in pixels):
                    self._numbers[key] = self._sampled(pixels, sampling, image, Texture.of_numbers)
        return self._numbers[key]

    def _source(self, number) -> tuple:
        """Return the number of the image of a texture of the tree, text where there is none, and its filter and its
        wrap."""
        if number not in self._sources:
            self._sources[number] = self._find_source(number)
        return self._sources[number]

    def _find_source(self, number) -> tuple:
        if not 0 <= number < len(self.tree.get("textures", ())):
            return f"texture {str(number)[:40]}", ("trilinear", ("repeat", "repeat"))
        source = item(self.tree, "textures", number)
        extensions = source.get("extensions", {})
        webp = extensions.get("EXT_texture_webp", {}).get("source")
        others = [each["source"] for each in extensions.values() if "source" in each]  # of formats that aren't read
        image = next((each for each in (webp, source.get("source"), *others) if each is not None), None)
        samplers, sampler = self.tree.get("samplers", []), source.get("sampler")
        is_there = type(sampler) is int and 0 <= sampler < len(samplers)
        if sampler is not None and not is_there:
            self.model.mend("texture", "of a sampler that isn't there: smooth, and repeated")
        sampler = samplers[sampler] if is_there else {}
        wraps = [sampler.get(axis, 10497) for axis in ("wrapS", "wrapT")]
        if not all(wrap in _WRAPS for wrap in wraps):
            self.model.mend("texture", "of a wrap that glTF doesn't have: repeated")
        wrap = tuple(_WRAPS.get(wrap, "repeat") for wrap in wraps)
        return image, (_filter(sampler), wrap)

    def mean(self, use: dict) -> np.ndarray | None:
        """Return the mean (4,) of the texels of a texture of numbers, within 0..1; None, and a UserWarning, if it is
        missing."""
        image = self._source(use.get("index", -1))[0]
        pixels = self._read(image)
        if pixels is None:
            return None
        if image not in self._means:
            self._means[image] = mean_of_numbers(pixels)
        return self._means[image]

    def _label(self, number) -> str:
        """What an image is called in reports."""
        images = self.tree.get("images", [])
        image = images[number] if type(number) is int and 0 <= number < len(images) else {}
        if isinstance(number, str):  # of a texture that isn't there
            return number
        uri = str(image.get("uri", ""))
        return str(image.get("name") or (uri if uri and not uri.startswith("data:") else f"image {number}"))[:80]

    def _read(self, number) -> np.ndarray | None:
        """Return the pixels of an image, read at most once; None, and a warning, where that fails."""
        if number not in self._pixels:
            try:
                if number is None:
                    raise self.model.error("the texture has no image")
                data, decoded = self._contents.pop(number, None), self._decoded.pop(number, None)
                data = self._bytes_of(number) if data is None else data
                self._pixels[number] = read_picture(BytesIO(data), f"image {number}", self.model.textures, decoded)
            except (ModelError, LookupError, TypeError, ValueError) as fault:
                reason = _reason(fault).removeprefix(f"{self.model.name}: ")
                what = "a texture" if number is None else f"texture '{self._label(number)}'"
                self.model.warn(f"{what}: {reason}; its materials keep their plain colour")
                self._pixels[number] = None
        pixels = self._pixels[number]
        return None if pixels is None else self.model.textures.fitted(pixels)

    def _bytes_of(self, number) -> bytes | memoryview:
        """Return the bytes of an image."""
        image = item(self.tree, "images", number)
        return self._buffers.view(image["bufferView"]) if "bufferView" in image else self._buffers.uri(image["uri"])


def read_paint(source: dict, pictures: Pictures) -> Paint:
    """Turn a material of the tree into a `Paint`.

    Parameters
    ----------
    source : dict, one of the tree's materials
    pictures : Pictures of the file

    Raises
    ------
    ModelError : a value that is not legal
    TypeError, AttributeError, LookupError, ValueError : a tree that is none of glTF
    """
    base, use = base_of(source)
    if np.isfinite(base).all():
        base = within_1(pictures.model, np.array([base]))[0].tolist()
    red, green, blue, alpha = base
    mode, cutoff = source.get("alphaMode", "OPAQUE"), float(source.get("alphaCutoff", 0.5))
    if mode not in ("OPAQUE", "MASK", "BLEND"):
        raise pictures.model.error(f"alphaMode must be OPAQUE, MASK or BLEND; given {mode!r}")
    texture = None if use is None else pictures.texture(use.get("index", -1), mode == "OPAQUE")
    common = opacity_fields(mode, alpha, cutoff) | {"texture": texture, "name": name_in(source.get("name", ""))}
    place = () if texture is None else _placement(use)
    base = (red, green, blue)
    if UNLIT in source.get("extensions", {}):  # it shows its base color whatever the light
        plain, colored = (Material(**common | unlit_fields(base, many)) for many in (texture is not None, True))
        return Paint(plain, *place)._replace(colored=colored)
    metallic = 0.0 if "trimesh" in str(pictures.tree.get("asset", {}).get("generator", "")) else 1.0
    numbers, place = _metallic_roughness(source, pictures, place)
    common |= {"emissive": tuple(max(value, 0.0) for value in emission_of(source))}
    with np.errstate(all="ignore"):  # what isn't finite is refused by Material
        plain, colored = (
            Material(**common | lit_fields(source, base, many, pictures.mean, metallic, numbers))
            for many in (texture is not None, True)
        )
    return Paint(plain, *place)._replace(colored=colored)


def _metallic_roughness(source, pictures, place) -> tuple[Texture | None, tuple]:
    """Return the texture that says how metallic and rough a material is at every sample, None where none is needed, and
    how the textures are laid; `place` is how that of its colour is, or empty."""
    use = source.get("pbrMetallicRoughness", {}).get("metallicRoughnessTexture")
    if use is None or GLOSSY in source.get("extensions", {}) or (numbers := pictures.numbers(use)) is None:
        return None, place
    own = _placement(use)
    place = place or own
    unmoved = np.eye(2, 3)
    matrices = [unmoved if matrix is None else matrix for _, matrix in (place, own)]
    return numbers, place if place[0] == own[0] and np.array_equal(*matrices) else (*place, own)


def _placement(use) -> tuple[int, np.ndarray | None]:
    """Return which texture coordinates a texture is laid by, and the matrix that KHR_texture_transform applies to them.

    Scale, then rotation, then offset. The rotation is counter-clockwise as seen with v pointing down, as the sample
    model of the extension and its implementations have it; the listing in its text turns the other way
    (KhronosGroup/glTF, issue 1563).
    """
    change = use.get("extensions", {}).get("KHR_texture_transform", {})
    uv_set = change.get("texCoord", use.get("texCoord", 0))
    if not {"offset", "rotation", "scale"} & change.keys():
        return int(uv_set), None
    angle = float(change.get("rotation", 0.0))
    c, s = math.cos(angle), math.sin(angle)
    (x, y), (a, b) = change.get("offset", (0.0, 0.0)), change.get("scale", (1.0, 1.0))
    return int(uv_set), np.array([[c * a, s * b, x], [-s * a, c * b, y]], np.float64)


def uv_from_gltf(uv, matrix) -> np.ndarray:
    """Turn texture coordinates of glTF, whose v points down, into ours.

    Parameters
    ----------
    uv : (n, 2) float64
    matrix : (2, 3) float64, applied before v is turned round; or None

    Returns
    -------
    (n, 2) float64
    """
    if matrix is not None:
        uv = uv @ matrix[:, :2].T + matrix[:, 2]
    return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1)


def linear_values(values) -> np.ndarray:
    """Return the values of an accessor as float64; integers are normalised."""
    values = np.asarray(values)
    scale = np.iinfo(values.dtype).max if values.dtype.kind in "ui" else 1.0
    scaled = values.astype(np.float64) / scale
    return np.maximum(scaled, -1.0) if values.dtype.kind == "i" else scaled


def _filter(sampler) -> str:
    """Return the filter that stands for a sampler's two."""
    large, small = sampler.get("magFilter"), sampler.get("minFilter")
    if large == _NEAREST or (large is None and small == _NEAREST):
        return "nearest"
    return "bilinear" if small in (_NEAREST, _LINEAR) else "trilinear"


def base_of(source: dict) -> tuple[tuple[float, ...], dict | None]:
    """Return the base color and alpha of a material, (4,), and the use of its texture, None where it has none."""
    glossy = source.get("extensions", {}).get(GLOSSY)
    if glossy is not None:
        return numbers_of(glossy.get("diffuseFactor", (1, 1, 1, 1)), 4), glossy.get("diffuseTexture")
    surface = source.get("pbrMetallicRoughness", {})
    return numbers_of(surface.get("baseColorFactor", (1, 1, 1, 1)), 4), surface.get("baseColorTexture")


def textures_of(source: dict) -> list[dict]:
    """Return the uses of the textures of a material that `read_paint` reads."""
    extensions, uses = source.get("extensions", {}), [base_of(source)[1]]
    if GLOSSY in extensions:
        uses.append(extensions[GLOSSY].get("specularGlossinessTexture"))
    elif UNLIT not in extensions:
        uses.append(source.get("pbrMetallicRoughness", {}).get("metallicRoughnessTexture"))
    return [use for use in uses if use is not None]


def _opaque(pixels) -> np.ndarray:
    """Return pixels, (h, w) or (h, w, 1..4), of whose alphas, if they have any, all are 255."""
    pixels = pixels.reshape(*pixels.shape[:2], -1)
    if pixels.shape[2] in (1, 3) or least_of(pixels)[-1] == 255:
        return pixels
    pixels = pixels.copy()
    pixels[..., -1] = 255
    return fixed(pixels)


# ----------------------------------------------------------------
# Lights and cameras, placed by the nodes that hold them. A node's matrix is that of its parents times its own; a light
# shines and a camera looks down -z of its node, with +y up.
#
#     KHR_lights_punctual   color · intensity is the intensity here, a plain number: candela (point, spot) and lux
#                           (directional) are not converted; a white diffuse surface under 1 lux of directional light
#                           has the value 1
#     point, spot           get weaker with 1/d², also nearer than 1 (`amplify`), and end at `range` where the file has
#                           one
#     spot                  innerConeAngle and outerConeAngle in radians, half angles
#     camera                perspective: yfov (radians, vertical), aspectRatio, znear, zfar; orthographic: the frame is
#                           2·xmag wide and 2·ymag high. A picture of another shape shows the whole frame, and more
#
# Specification, 3.5 and 3.10; KHR_lights_punctual.

_LIGHTS = "KHR_lights_punctual"


def read_lights_and_camera(
    model: ModelFile, tree: dict, places: dict[int, np.ndarray]
) -> tuple[tuple | None, Camera | None]:
    """Return the lights of a file's scene in the order of its nodes, and its first camera; None for what it hasn't.

    Parameters
    ----------
    model : ModelFile, for messages
    tree : dict, the file's JSON tree
    places : dict, what `world_matrices` returns of it

    Raises
    ------
    TypeError, AttributeError, LookupError, ValueError : a tree that is none of glTF
    """
    nodes = tree.get("nodes", [])
    sources = tree.get("extensions", {}).get(_LIGHTS, {})
    lights, camera, told = [], None, set()
    for number in sorted(places):
        node, matrix = nodes[number], places[number]
        light = node.get("extensions", {}).get(_LIGHTS, {}).get("light")
        is_flat = not matrix[:3, 2].any()
        if is_flat and (light is not None or "camera" in node):
            model.mend(*SCALED_AWAY)
            continue
        if light is not None and _is_there(model, sources, "lights", light, "light"):
            lights.append(_made(model, "light", light, sources["lights"], light_of, matrix, told))
        if camera is None and "camera" in node and _is_there(model, tree, "cameras", node["camera"], "camera"):
            camera = _made(model, "camera", node["camera"], tree["cameras"], camera_of, matrix, told)
    return tuple(light for light in lights if light is not None) or None, camera


def world_matrices(model: ModelFile, tree: dict) -> dict[int, np.ndarray]:
    """Return world-from-node matrices (4, 4) float64 by the numbers of the nodes that the file's scene shows.

    A file without scenes, or without the one that it names, shows all its nodes.
    """
    if tree.get("scenes") and _is_there(model, tree, "scenes", tree.get("scene", 0), "scene"):
        roots = item(tree, "scenes", tree.get("scene", 0)).get("nodes", [])
    else:
        children = {child for node in tree.get("nodes", []) for child in node.get("children", [])}
        roots = [number for number in range(len(tree.get("nodes", []))) if number not in children]
    found, open_nodes = {}, [(number, np.eye(4)) for number in roots]
    while open_nodes:
        number, parent = open_nodes.pop()
        if not _is_there(model, tree, "nodes", number, "node"):
            continue
        node = item(tree, "nodes", number)
        if number in found:  # not legal; the first place counts
            continue
        with np.errstate(all="ignore"):  # what is not finite is refused where something stands there
            found[number] = parent @ _own_matrix(node) if _PLACES & node.keys() else parent
        open_nodes += [(child, found[number]) for child in node.get("children", [])]
    return found


_PLACES = {"matrix", "rotation", "scale", "translation"}
LAST_ROW = (0.0, 0.0, 0.0, 1.0)  # of an affine matrix
ROUNDED = 2.0**-20  # how far a product of a few matrices in float32 may be from it: sixteen roundings


def _own_matrix(node) -> np.ndarray:
    """Return a node's parent-from-node matrix: given as a whole, or as translation, rotation (x, y, z, w) and scale."""
    if "matrix" in node:
        matrix = np.reshape(np.asarray(node["matrix"], np.float64), (4, 4)).T.copy()
        if (abs(matrix[3] - LAST_ROW) <= ROUNDED).all():
            matrix[3] = LAST_ROW
        return matrix
    x, y, z, w = (float(value) for value in node.get("rotation", (0, 0, 0, 1)))
    length = math.sqrt(x * x + y * y + z * z + w * w) or 1.0
    x, y, z, w = x / length, y / length, z / length, w / length
    # Rotation by a unit quaternion: Shoemake 1985, Animating rotation with quaternion curves, SIGGRAPH.
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.asarray(node.get("scale", (1, 1, 1)), np.float64)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _made(model, word, number, sources, make, matrix, told):
    """Make a light or camera; None where it isn't legal, which is warned of, unless it is one of those that were
    told."""
    source, label = sources[number], f"{word} {number}"
    try:
        label += f" '{name_in(source['name'])}'" if source.get("name") else ""
        return make(source, matrix)
    except KeyError as fault:
        reason = f"{fault.args[0]} is missing"
    except (SceneError, TypeError, ValueError, AttributeError) as fault:
        reason = _reason(fault)
    if label not in told:
        told.add(label)
        model.warn(f"{label}: {reason}; left out")
    return None


# ----------------------------------------------------------------
# What a file has and isn't used: named once a file, for those who ask.

POINTS, LINES, LINE_LOOP, LINE_STRIP = range(4)  # modes of primitives without triangles
USED = {
    "EXT_texture_webp", "KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness", "KHR_materials_specular", "KHR_materials_unlit", "KHR_mesh_quantization",
    "KHR_texture_transform",
}  # fmt: skip
_TEXTURES = {
    "normalTexture": "normal textures",
    "occlusionTexture": "occlusion textures",
    "emissiveTexture": "emissive textures, with their emission",
}


def list_left_out(tree: dict, used: set) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return texts about what isn't used of materials, extensions and motion: what would be seen, and what wouldn't.

    Parameters
    ----------
    tree : the file's JSON tree
    used : the numbers of the materials that are shown
    """
    materials = [source for number, source in enumerate(tree.get("materials", [])) if number in used]
    found = [what for key, what in _TEXTURES.items() if any(key in source for source in materials)]
    surfaces = [source.get("pbrMetallicRoughness", {}) for source in materials]
    glossy = [source.get("extensions", {}).get(GLOSSY) or {} for source in materials]
    if any("specularGlossinessTexture" in surface for surface in glossy):
        found.append("specular-glossiness textures, but for their means")
    if any(
        "baseColorTexture" in surface and UNLIT in source.get("extensions", {})
        for surface, source in zip(surfaces, materials, strict=True)
    ):
        found.append("KHR_materials_unlit of textured materials, which are lit")
    own = (source.get("extensions", ()) for source in materials)
    extensions = {*tree.get("extensionsUsed", [])}.difference(_UNREADABLE).union(*own)
    found += [f"the extension {name[:60]}" for name in sorted(map(str, extensions - USED))]
    found += ["animations"] if tree.get("animations") else []
    is_one_sided = any(not source.get("doubleSided", False) for source in materials)
    return tuple(found), ("doubleSided = false (backs are drawn unless they are culled)",) * is_one_sided


def count_points_and_lines(tree: dict, primitives: list[dict]) -> tuple[int, int]:
    """Return how many points and lines primitives have that are none of triangles."""
    n_point = n_line = 0
    for primitive in primitives:
        n = item(tree, "accessors", _counted_accessor(primitive))["count"]
        lines = {LINES: n // 2, LINE_LOOP: n, LINE_STRIP: n - 1}
        mode = primitive.get("mode")
        n_point += n if mode == POINTS else 0
        n_line += lines.get(mode, 0)
    return n_point, n_line
