"""Write solids as OBJ, MTL, PLY, STL and GLB, with nothing but numpy and the standard library."""

import json
import struct
from itertools import pairwise
from typing import NamedTuple

import numpy as np

DECIMALS = 6


class Solid(NamedTuple):
    """Points (n_point, 3) float64 in scene units, and faces: index tuples, counter-clockwise from outside."""

    points: np.ndarray
    faces: list


def rounded(values):
    """Round to the decimals that are written, without negative zeros."""
    return np.round(values, DECIMALS) + 0.0


def on_unit_sphere(points):
    """Scale points (..., 3) to length one."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return points / np.sqrt(x * x + y * y + z * z)[..., None]


def number_text(value):
    """Write a number with up to six decimals and no more digits than it needs."""
    text = f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def obj_lines(solid, first=1):
    """List the v and f lines of a solid whose first point has the number `first`."""
    lines = ["v " + " ".join(map(number_text, point)) for point in solid.points]
    return lines + ["f " + " ".join(str(first + i) for i in face) for face in solid.faces]


def obj_bytes(name, solid):
    """Write a Wavefront OBJ with points and polygons only."""
    return "\n".join([f"# {name}, made by make_models.py", f"o {name}", *obj_lines(solid), ""]).encode()


def obj_parts_bytes(parts, library):
    """Write a Wavefront OBJ with one object, group and material for each (name, material, solid)."""
    lines, first = [f"mtllib {library}"], 1
    for name, material, solid in parts:
        lines += [f"o {name}", f"g {name}", f"usemtl {material}", *obj_lines(solid, first)]
        first += len(solid.points)
    return "\n".join([*lines, ""]).encode()


def mtl_bytes(materials):
    """Write a Wavefront MTL."""
    lines = []
    for name, (ka, kd, ks, ns, ke, d) in materials.items():
        lines += [f"newmtl {name}"]
        for key, color in (("Ka", ka), ("Kd", kd), ("Ks", ks), ("Ke", ke)):
            lines += [f"{key} {' '.join(map(number_text, color))}"]
        lines += [f"Ns {ns}", f"d {number_text(d)}", "illum 2", ""]
    return "\n".join(lines).encode()


def fan_triangles(solid):
    """Cut every face into triangles from its first corner: (n_triangle, 3)."""
    return np.array([(face[0], *pair) for face in solid.faces for pair in pairwise(face[1:])])


def ply_bytes(solid, colors):
    """Write a binary little-endian PLY with polygons and a colour for each point."""
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(solid.points)}"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += [f"property uchar {channel}" for channel in ("red", "green", "blue")]
    header += [f"element face {len(solid.faces)}", "property list uchar int vertex_indices", "end_header", ""]
    rows = zip(rounded(solid.points).tolist(), colors.tolist(), strict=True)
    body = [struct.pack("<3f3B", *point, *color) for point, color in rows]
    body += [struct.pack(f"<B{len(face)}i", len(face), *face) for face in solid.faces]
    return "\n".join(header).encode() + b"".join(body)


def stl_bytes(name, solid):
    """Write a binary STL: 80 bytes, the count, and for each triangle its normal, three corners, two bytes."""
    corners = rounded(solid.points)[fan_triangles(solid)]
    a, b, c = corners.transpose(1, 0, 2)
    normals = rounded(on_unit_sphere(np.cross(b - a, c - a)))
    rows = np.concatenate([normals[:, None], corners], axis=1).reshape(-1, 12).tolist()
    header = f"{name}, made by make_models.py".encode().ljust(80)
    return header + struct.pack("<I", len(rows)) + b"".join(struct.pack("<12fH", *row, 0) for row in rows)


def glb_bytes(name, solid, base_color):
    """Write a binary glTF 2.0: one indexed mesh with positions and a base colour (linear).

    Source: Khronos, glTF 2.0 specification, section 4 (GLB file format).
    """
    points = rounded(solid.points).astype("<f4")
    indices = fan_triangles(solid).astype("<u2")
    blob = points.tobytes() + indices.tobytes()
    text = json.dumps(gltf_tree(name, points, indices, base_color), separators=(",", ":")).encode()
    parts = glb_chunk(b"JSON", text, b" ") + glb_chunk(b"BIN\0", blob, b"\0")
    return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


def glb_chunk(kind, data, filler):
    """Write one chunk: length, kind, data filled up to a multiple of four bytes."""
    data += filler * (-len(data) % 4)
    return struct.pack("<I4s", len(data), kind) + data


def gltf_tree(name, points, indices, base_color):
    """Return the JSON part: one mesh in one node; its points come first in the buffer, then its indices."""
    float32, uint16, for_points, for_indices, triangles = 5126, 5123, 34962, 34963, 4
    box = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    paint = {"baseColorFactor": [*base_color, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.5}
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "material": 0, "mode": triangles}
    return {
        "asset": {"version": "2.0", "generator": "make_models.py"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [{"name": name, "primitives": [primitive]}],
        "materials": [{"name": "paint", "pbrMetallicRoughness": paint}],
        "accessors": [
            {"bufferView": 0, "componentType": float32, "count": len(points), "type": "VEC3", **box},
            {"bufferView": 1, "componentType": uint16, "count": indices.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": points.nbytes, "target": for_points},
            {"buffer": 0, "byteOffset": points.nbytes, "byteLength": indices.nbytes, "target": for_indices},
        ],
        "buffers": [{"byteLength": points.nbytes + indices.nbytes}],
    }
