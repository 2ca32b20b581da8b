"""Meshes of other libraries, taken by what they hold: none of these libraries is imported.

    PyVista     PolyData: points, and faces as numbers of corners, each before its corners
    Open3D      TriangleMesh: vertices, triangles, vertex_colors, which are sRGB
    meshio      Mesh: points, and cells in blocks of one type

Their normals are not taken: all three average them over creases. What holds no surface is refused with the line that
makes one of it. A `trimesh.Trimesh`, and whatever has vertices and faces, is read in mesh.py.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError
from .arrays import plain_array
from .color import srgb

# What an object has that becomes a surface, and the line that makes it one.
_CONVERSIONS = {
    "extract_surface": "mesh.extract_surface()",  # other data sets of PyVista
    "GetPoints": "pyvista.wrap(mesh)",  # of VTK itself
    "to_legacy": "mesh.to_legacy()",  # Open3D's tensors
}


def is_guest(source: object) -> bool:
    """Tell a mesh of another library, or what can be made one, from a sequence, a file and an array."""
    if isinstance(source, (list, tuple, dict, np.ndarray, type)) or hasattr(source, "meshes"):
        return False
    is_mesh = hasattr(source, "points") and (hasattr(source, "faces") or hasattr(source, "cells"))
    is_mesh |= hasattr(source, "vertices") and hasattr(source, "triangles")
    return is_mesh or any(hasattr(source, name) for name in _CONVERSIONS)


def arguments_of(source: Any) -> dict[str, Any]:
    """Return a guest as arguments of Mesh.

    Raises
    ------
    ModelError : it holds no surface; the message has the line that makes one of it, where there is one
    """
    if hasattr(source, "points") and hasattr(source, "faces"):
        return {"vertices": source.points, "faces": _split(plain_array(source.faces))}
    if hasattr(source, "vertices") and hasattr(source, "triangles"):
        found = {"vertices": np.asarray(source.vertices), "faces": np.asarray(source.triangles)}
        colors = np.asarray(getattr(source, "vertex_colors", ()))
        return found | ({"colors": srgb(np.clip(colors, 0.0, 1.0))} if len(colors) else {})
    name = f"a {type(source).__module__.partition('.')[0]} {type(source).__name__}"
    for has, line in _CONVERSIONS.items():
        if hasattr(source, has):
            raise ModelError(f"{name} is no surface of triangles and polygons; give {line}")
    blocks = {block.type: block.data for block in source.cells}
    faces = [face for kind in ("triangle", "quad", "polygon") for block in source.cells if block.type == kind
             for face in block.data]  # fmt: skip
    if not faces:
        held = ", ".join(blocks) or "nothing"
        raise ModelError(f"{name} needs cells of triangle, quad or polygon, which are drawn; given {held}")
    is_plain = len({len(face) for face in faces}) == 1
    return {"vertices": source.points, "faces": np.array(faces) if is_plain else faces}


def _split(padded: NDArray) -> NDArray | list[NDArray]:
    """Return polygons out of numbers of corners, each before its corners: an array where all have as many."""
    if padded.ndim != 1 or not len(padded):
        return padded
    step = int(padded[0]) + 1
    if step > 1 and len(padded) % step == 0 and (padded[::step] == padded[0]).all():
        return padded.reshape(-1, step)[:, 1:]
    faces, start = [], 0
    while start < len(padded):
        end = start + 1 + int(padded[start])
        faces.append(padded[start + 1 : end])
        start = max(end, start + 1)
    return faces
