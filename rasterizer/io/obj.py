"""Read OBJ: vertices, polygons, normals, texture coordinates, smoothing groups, objects, materials.

    text ─ tidy ─┬─ rows of v, vn, vt ──┐
                 ├─ table of corners ───┼─ triangles (scene/triangulation.py) ─ parts, one an object
                 └─ o, usemtl, s ───────┘

Each `o` line with faces begins a part, which may have several materials; groups (`g`) only name faces, so normals
go across their borders. Faces keep the order of the file; those with fewer than three corners, points and lines are
left out.

Read as other programs do: corners written short (`1/`, `1//`, `2/2/`) have what they name; a `v` of four or five
numbers is a place, of six or more a place and its colour (0..1, or 0..255 where one is above 1), used where all `v`
lines have one; a `vt` after the last is none; `1.#QNAN` and the like are not a number. Format: Wavefront, Advanced
Visualizer manual, appendix B1, 1995.
"""

import re
import warnings
from dataclasses import replace
from itertools import chain

import numpy as np

from ..errors import ModelError
from ..scene.material import Material
from ..scene.triangulation import listed
from .files import OutsideError
from .model_file import WHITE, ModelFile, Part, bytes_of, cut_faces, text_of
from .mtl import LONGEST_NAME, Maps, read_materials
from .obj_corners import (
    Corners,
    MisreadError,
    in_force,
    read_corners,
    read_texture_coordinates,
    read_vectors,
    without_signs,
)
from .obj_fault import find_fault, line_of_face

MOST_LIBRARIES = 256  # material files that an OBJ file may name
_UNNAMED = -1  # material number of faces before the first usemtl


def read_obj(model: ModelFile) -> list[Part]:
    """Read an OBJ file, the MTL files that it names, and the textures that those name.

    Returns
    -------
    one part for each object, in the order of the file

    Raises
    ------
    ModelError : naming the line where one is at fault

    Warns
    -----
    UserWarning : materials, textures or texture coordinates that are missing
    """
    try:
        parts = _read(model)
    except (MisreadError, ModelError) as fault:
        found = find_fault(model.data)
        if found is None and isinstance(fault, ModelError):
            raise
        line, reason = found or (None, f"not a readable OBJ file ({fault})")
        raise model.error(reason, line) from fault
    if not parts and (found := find_fault(model.data)):
        line, reason = found
        raise model.error(reason, line)
    return parts


def _read(model):
    text = _tidy(model.data)
    n_line = text.count("\nf ")
    if n_line == 0:
        return []
    corners = read_corners(text)
    if corners.n_corner.max(initial=0) < 3:
        return []
    part, polygons = _make_part(model, corners, text)
    object_of_line, objects = _named(text, "o", n_line)
    material_of_line, names = _named(text, "usemtl", n_line)
    materials = _find_materials(model, text, names)
    default = replace(part.pop("material"), name="")
    palette = [materials.get(name, replace(default, name=name)) for name in names] + [default]
    part["face_material"] = material_of_line[polygons]
    return [
        _with_materials(model, piece, palette, objects[number] if number >= 0 else _only_group(text))
        for number, piece in _objects(part, object_of_line[polygons])
    ]


def _named(text, keyword, n_line) -> tuple[np.ndarray, list[str]]:
    """Return the number of the name in force at each face line, -1 = none yet, and the names.

    Equal materials have one number; every `o` line begins an object, whatever it is called.
    """
    names = {}

    def number(name):
        return names.setdefault(name if keyword == "usemtl" else (len(names), name), len(names))

    numbers = in_force(text, keyword, number, _UNNAMED, n_line)
    return numbers, [name if keyword == "usemtl" else name[1] for name in names]


def _only_group(text) -> str:
    """Return the name of the group where the file has just one, to name faces that belong to no object."""
    groups = {name.strip() for name in re.findall(r"\ng (.*)", text)}
    return groups.pop() if len(groups) == 1 else ""


# --- text ---------------------------------------------------------------------------------------------------


def _tidy(data: bytes) -> str:
    """Return the text with \\n at the end of each line, nothing before a keyword, and a blank after it."""
    text = without_signs("\n" + text_of(data) + "\n")
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    if "\\" in text:
        text = text.replace("\\\n", " ")
    if "\t" in text:
        text = text.replace("\t", " ")
    if "\n " in text:
        text = re.sub(r"\n +", "\n", text)
    if any(text[mark.start() - 1] != "\n" or "usemtl" in mark[0] for mark in re.finditer("#.*", text)):
        text = re.sub(r"\n((?:v|vn|vt|f|s) [^#\n]*|)#.*", r"\n\1", text)
    return text


# --- triangles ----------------------------------------------------------------------------------------------


def _make_part(model, corners: Corners, text) -> tuple[Part, np.ndarray]:
    """Put all triangles of the file in one part; return it, and which face line each triangle came from."""
    points = read_vectors(text, "v", 3)
    if corners.v.max() >= len(points):
        raise MisreadError("a face refers to a vertex after the last")

    def place(face):
        return f":{line_of_face(model.data, face)}: the face"

    cut = cut_faces(model, points[:, :3], corners.v, corners.n_corner, place)
    v = corners.v[cut.corners]
    n_used, faces = _compact(v)
    used = np.zeros(n_used, np.int64)
    used[faces] = v
    points = points[used]
    part = {"vertices": np.ascontiguousarray(points[:, :3]), "faces": faces, "name": "", "material": Material()}
    if points.shape[1] >= 6 and np.isfinite(points[:, 3:6]).all():
        part |= {"colors": bytes_of(points[:, 3:6]), "material": WHITE}
    normal_idx = corners.vn[cut.corners]
    if normal_idx.max() >= 0:
        normals = read_vectors(text, "vn", 3)
        if normal_idx.max() >= len(normals):
            raise MisreadError("a face refers to a normal after the last")
        part["normals"] = normals[normal_idx, :3]
        part["has_normals"] = (normal_idx >= 0).all(axis=1)
    uv_idx = corners.vt[cut.corners]
    if uv_idx.max() >= 0:
        coordinates = read_texture_coordinates(text)
        is_there = (uv_idx >= 0) & (uv_idx < len(coordinates))
        if is_there.any():
            part["uv"] = np.where(is_there[..., None], coordinates[np.where(is_there, uv_idx, 0)], 0.0)
            part["has_uv"] = is_there.all(axis=1)
    if corners.n_corner.max() > 3:
        part["polygons"] = cut.polygons
    smoothing = corners.smoothing[cut.polygons]
    if smoothing.any():
        part["smoothing"] = smoothing.astype(np.int32)
    return part, cut.polygons


def _compact(v) -> tuple[int, np.ndarray]:
    """Number the vertices in use from 0, in their order; return how many they are, and the faces in new numbers."""
    first, span = int(v.min()), int(np.ptp(v)) + 1
    if span > 8 * v.size:  # few faces, far apart: sorting them is less than looking at all between
        used, faces = np.unique(v, return_inverse=True)
        return len(used), faces.reshape(v.shape)
    is_used = np.zeros(span, bool)
    is_used[v - first] = True
    return int(is_used.sum()), (np.cumsum(is_used) - 1)[v - first]


def _per_vertex(of_corner, faces, n_vertex) -> np.ndarray | None:
    """Return what corners hold as values of their vertices; None where corners of one vertex differ."""
    values = np.empty((n_vertex, of_corner.shape[2]), of_corner.dtype)
    values[faces] = of_corner
    is_real = of_corner.dtype.kind == "f"
    return values if np.array_equal(values[faces], of_corner, equal_nan=is_real) else None


# --- objects ------------------------------------------------------------------------------------------------


def _objects(part: Part, number) -> list[tuple[int, Part]]:
    """Cut a part where the number (n_triangle,) of the object changes.

    Objects without a face that has an area go with their neighbour, so that the faces keep their numbers: a mesh must
    have such a face.
    """
    starts = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
    if len(starts) > 1:
        n_drawable = np.add.reduceat(_has_area(part), starts, dtype=np.int64)
        is_kept = n_drawable > 0
        is_kept[int(is_kept.argmax()) if is_kept.any() else 0] = True
        kept = starts[is_kept]
    else:
        kept = starts
    numbers = number[kept]
    ends = [*kept[1:].tolist(), len(number)]
    begins = [0, *kept[1:].tolist()]
    return [(int(n), _cut(part, a, b)) for n, a, b in zip(numbers, begins, ends, strict=True)]


def _has_area(part: Part) -> np.ndarray:
    """Tell which triangles have finite corners and an area; the limit is that of `Mesh`."""
    with np.errstate(all="ignore"):
        corners = part["vertices"][part["faces"]].astype(np.float64)
        edges = corners[:, 1:] - corners[:, :1]
        edges /= np.maximum(np.abs(edges).max(axis=(1, 2), keepdims=True), np.finfo(np.float64).tiny)
        area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        lengths = np.linalg.norm(edges, axis=2)
        return area > 4 * np.finfo(np.float64).eps * lengths[:, 0] * lengths[:, 1]


def _cut(part: Part, begin, end) -> Part:
    """Return the triangles from `begin` to `end` with what belongs to them; attributes that some lack are left out."""
    faces = part["faces"][begin:end]
    n_used, compact = _compact(faces)
    piece = {"faces": compact, "name": "", "face_material": part["face_material"][begin:end]}
    if n_used == len(part["vertices"]):
        piece |= {key: part[key] for key in ("vertices", "colors") if key in part}
    else:
        used = np.zeros(n_used, np.int64)
        used[compact] = faces
        piece |= {key: part[key][used] for key in ("vertices", "colors") if key in part}
    if "normals" in part and part["has_normals"][begin:end].all():
        piece["normals"] = part["normals"][begin:end]
    if "uv" in part and part["has_uv"][begin:end].any():
        uv = part["uv"][begin:end]
        per_vertex = _per_vertex(uv, compact, n_used)
        piece["uv"] = uv if per_vertex is None else per_vertex
        piece["has_uv"] = part["has_uv"][begin:end]
    if "polygons" in part:
        polygons = part["polygons"][begin:end] - part["polygons"][begin]
        polygons = np.cumsum(np.diff(polygons, prepend=0) > 0)  # lines of fewer than 3 corners leave gaps
        if polygons[-1] + 1 < len(polygons):
            piece["polygons"] = polygons.astype(np.int32)
    if "smoothing" in part and part["smoothing"][begin:end].any():
        piece["smoothing"] = part["smoothing"][begin:end]
    return piece


# --- materials ----------------------------------------------------------------------------------------------


def _with_materials(model, part: Part, palette, name) -> Part:
    """Give a part its name and, of a palette, the materials that its faces use, in the order of their first use.

    Faces without texture coordinates get their material without its texture.
    """
    numbers = part.pop("face_material")
    has_uv = part.pop("has_uv", None)
    palette = list(palette)
    if has_uv is not None and not has_uv.all():
        numbers = numbers.copy()
        for number in np.unique(numbers[~has_uv]).tolist():
            if palette[number].texture is not None:
                is_bare = (numbers == number) & ~has_uv
                palette.insert(-1, replace(palette[number], texture=None))  # the last one is the unnamed, -1
                numbers[is_bare] = len(palette) - 2
                warnings.warn(
                    f"{model.name}: {int(is_bare.sum())} faces of mesh '{name}' with the material "
                    f"'{palette[number].name}' have no texture coordinates; they are drawn without its texture",
                    stacklevel=2,
                )
    used, first, inverse = np.unique(numbers, return_index=True, return_inverse=True)
    order = np.argsort(first)
    part["name"] = name
    if len(used) == 1:
        return part | {"material": palette[used[0]]}
    rank = np.argsort(order).astype(np.int32)
    return part | {"materials": tuple(palette[used[k]] for k in order), "face_material": rank[inverse]}


def _find_materials(model, text, names) -> dict[str, Material]:
    """Read the MTL files that the OBJ names; warn of what is missing."""
    if not names:
        return {}
    materials, missing, maps = {}, [], Maps(model.log)
    lines = dict.fromkeys(line.strip() for line in re.findall(r"\nmtllib (.*)", text))
    # Names with blanks are written like several names; what was read to find out is not read again.
    found = {line: _library(model, line) for line in list(lines)[:MOST_LIBRARIES] if len(line) < 256}
    named = [[line] if found.get(line) else line.split() for line in list(lines)[:MOST_LIBRARIES]]
    named = list(dict.fromkeys(chain.from_iterable(named)))
    if len(named) > MOST_LIBRARIES:
        warnings.warn(
            f"{model.name}: names {len(named)} material files; the first {MOST_LIBRARIES} are looked for", stacklevel=2
        )
    for name in named[:MOST_LIBRARIES]:
        library = found[name] if name in found else _library(model, name)
        if library is None:
            missing.append(name)
        else:
            materials |= read_materials(library, set(names), maps)
    unknown = [name for name in names if name not in materials]
    if missing:
        files = listed([f"'{name[:80]}'" for name in missing])
        warnings.warn(f"{model.name}: material file {files} not found; the default material is used", stacklevel=2)
    elif unknown:
        unknown = listed([f"'{name[:80]}'" for name in unknown])
        warnings.warn(f"{model.name}: no definition of material {unknown}; the default is used", stacklevel=2)
    return materials


def _library(model, name) -> ModelFile | None:
    """Return an MTL file beside the model, or None."""
    if len(name) > LONGEST_NAME:
        return None
    try:
        path = model.beside.find_alike(name)
        data = model.beside.read_bytes(path)
    except OutsideError as fault:
        if model.folder is not None:
            warnings.warn(f"{model.name}: material file '{name}' {fault}", stacklevel=2)
        return None
    except (OSError, ValueError):
        return None
    return ModelFile(str(path), "mtl", data, path.parent, model.log, model.beside.below(path.parent))
