"""Read OBJ through trimesh, and recover what it loses: normals, smoothing groups, polygons, materials.

trimesh parses the numbers and cuts polygons into triangles. Where the face lines say more than three vertex
numbers, they are read a second time into a table of corners, which is laid beside trimesh's triangles; every
vertex of every triangle must then be the same point in both, which holds the two readers together. A plain
file costs no more than a few searches through its text.

    text ─ tidy ─ number the materials ─┬─ trimesh ──────────┬─ parts, one a material
                                        └─ table of corners ─┘

Parts come in the order in which faces first use their material. Their vertices are those of the file: copies
that trimesh makes of a vertex with several normals or texture coordinates are joined again. Faces keep the
order of the file within their material. Format: Wavefront, Advanced Visualizer manual, appendix B1, 1995.
"""

import re
import warnings
from collections import defaultdict
from typing import NamedTuple

import numpy as np

from rasterizer.errors import ModelError
from rasterizer.scene.material import Material
from rasterizer.scene.mtl import read_materials
from rasterizer.scene.obj_fault import find_fault
from rasterizer.scene.parse import (
    Fans,
    ModelFile,
    Part,
    fans,
    part_from,
    run_trimesh,
    text_of,
    triangle_meshes,
)

_UNNAMED = -1  # material number of faces before the first usemtl

# Ways to write a corner: slashes of one corner * 2 + whether two of them touch. The numbers say which columns
# are v, vt and vn.
_PATTERNS = {0: ("v",), 2: ("v", "vt"), 4: ("v", "vt", "vn"), 5: ("v", "vn")}


class Corners(NamedTuple):
    """What the face lines say, indices counted from 0."""

    v: np.ndarray  # (n_corner,) int64
    vt: np.ndarray  # (n_corner,) int64, -1 where a corner has none
    vn: np.ndarray  # (n_corner,) int64, -1 where a corner has none
    n_corner: np.ndarray  # (n_face,) int64
    material: np.ndarray  # (n_face,) int64, number of the material
    smoothing: np.ndarray  # (n_face,) int64, 0 = none
    is_plain: bool  # trimesh understands the face lines as they are


def read_obj(model: ModelFile) -> list[Part]:
    """Read an OBJ file and the MTL files that it names.

    Returns
    -------
    one part for each material, in the order in which faces first use them

    Raises
    ------
    ModelError : naming the line where one is at fault
    """
    try:
        parts = _read(model)
    except (_MisreadError, ModelError) as fault:
        found = find_fault(model.data)
        if found is None and isinstance(fault, ModelError):
            raise
        line, reason = found or (None, f"not a readable OBJ file ({fault})")
        raise model.error(reason, line) from fault
    if not parts and (found := find_fault(model.data)):
        line, reason = found
        raise model.error(reason, line)
    return parts


class _MisreadError(Exception):
    """The face lines can't be read, or trimesh understands them in another way."""


def _read(model):
    text, names = _number_materials(_tidy(model.data))
    corners = None
    if _needs_table(text):
        corners = _read_corners(text)
        if not corners.is_plain:
            text = _rewrite_faces(text, corners)
    meshes = _run(model, text, names)
    n_triangle = sum(len(mesh.faces) for mesh in meshes.values())
    if corners is None and meshes and n_triangle != text.count("\nf "):
        corners = _read_corners(text)
    normals = _read_normals(text) if corners is not None and (corners.vn >= 0).any() else None
    materials = _find_materials(model, text, names)
    parts = []
    for number in sorted(meshes):
        name = names[number] if number >= 0 else ""
        part = part_from(meshes[number], name)
        if corners is not None:
            part = _recover(part, corners, number, normals)
        if name in materials or "colors" not in part:
            part["material"] = materials.get(name, Material(name=name))
        parts.append(part)
    return parts


# --- text ---------------------------------------------------------------------------------------------------


def _tidy(data: bytes) -> str:
    """Return the text as trimesh expects it: \\n ends a line, nothing before a keyword, a blank after it."""
    text = "\n" + text_of(data) + "\n"
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


def _number_materials(text: str) -> tuple[str, list[str]]:
    """Replace the names after usemtl, which trimesh changes, by numbers; return the text and the names."""
    names = {}

    def number(match):
        return f"\nusemtl {names.setdefault(match[1], len(names))}"

    text = re.sub(r"\nusemtl +(.*?) *(?=\n)", number, text)
    return text, list(names)


def _needs_table(text: str) -> bool:
    """Tell whether the face lines may say more than vertex numbers above 0, or smoothing groups are used."""
    start, last = text.find("\nf "), text.rfind("\nf ")
    if start < 0:
        return False
    end = text.find("\n", last + 1) + 1
    return "\ns " in text or any(text.find(sign, start, end) >= 0 for sign in ("/", "-", " 0 ", " 0\n"))


# --- trimesh ------------------------------------------------------------------------------------------------


def _run(model, text, names) -> dict:
    """Parse the text with trimesh; return a mesh for each number of a material.

    trimesh tells which mesh has which material only if it has found the material, so it gets a file that
    defines just the names.
    """
    library = "".join(f"newmtl {number}\nKd 1 1 1\n" for number in range(len(names))).encode()
    if names:
        text = "\nmtllib names\n" + text
    scene = run_trimesh(model, text, resolver=defaultdict(lambda: library))
    numbers = {str(number): number for number in range(len(names))}
    meshes = {}
    for mesh in triangle_meshes(scene).values():
        number = numbers.get(getattr(getattr(mesh.visual, "material", None), "name", None), _UNNAMED)
        if number in meshes or mesh.vertices.shape[1:] != (3,):
            raise _MisreadError("vertices or materials are mixed up")
        meshes[number] = mesh
    return meshes


# --- table of corners ---------------------------------------------------------------------------------------


def _read_corners(text) -> Corners:
    """Read the face lines, and which material and smoothing group is in force at each."""
    faces = re.findall(r"\nf (.*)", text)
    n_corner, pattern = _patterns(faces)
    columns = _read_mixed(faces, int(n_corner.sum())) if pattern is None else _read_uniform(faces, pattern, int(n_corner.sum()))
    is_plain = pattern is not None
    indices = {}
    for kind in ("v", "vt", "vn"):
        column = columns.get(kind)
        if column is not None and column.min(initial=1) < 0:
            is_plain = False
            column = _count_from_start(column, text, kind, n_corner)
        indices[kind] = np.full(int(n_corner.sum()), -1) if column is None else column - 1
    if indices["v"].min(initial=0) < 0:
        raise _MisreadError("a face refers to a vertex before the first")
    material = _in_force(text, "usemtl", int, _UNNAMED, len(faces))
    smoothing = _in_force(text, "s", _smoothing_group, 0, len(faces))
    return Corners(**indices, n_corner=n_corner, material=material, smoothing=smoothing, is_plain=is_plain)


def _patterns(faces):
    """Return the number of corners of each face line, and their pattern, None if there are several."""
    blob = np.frombuffer("\n".join(faces).encode("utf-8", "replace"), np.uint8)
    is_gap = blob <= ord(" ")
    starts = np.flatnonzero(~is_gap & np.concatenate(([True], is_gap[:-1])))
    line_of_byte = np.cumsum(blob == ord("\n"), dtype=np.int32)
    n_corner = np.bincount(line_of_byte[starts], minlength=len(faces))
    if not len(starts):
        return n_corner, ("v",)
    is_slash = blob == ord("/")
    is_double = is_slash & np.concatenate(([False], is_slash[:-1]))
    code = 2 * np.add.reduceat(is_slash, starts, dtype=np.int32) + np.add.reduceat(
        is_double, starts, dtype=np.int32
    )
    return n_corner, _PATTERNS.get(int(code[0])) if (code == code[0]).all() else None


def _numbers_in(text, dtype, place) -> np.ndarray:
    """Return the numbers of a text with blanks between them; numpy before 2.4 only warns where it stops at anything else."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            return np.fromstring(text, dtype=dtype, sep=" ")
    except (ValueError, DeprecationWarning) as fault:
        raise _MisreadError(f"{place} holds something that is no number") from fault


def _read_uniform(faces, pattern, n_corner) -> dict:
    """Read face lines whose corners are all written alike; return the columns by kind, as in the file."""
    text = " ".join(faces).replace("//", " ").replace("/", " ")
    numbers = _numbers_in(text, np.int64, "a face line")
    if len(numbers) != n_corner * len(pattern):
        raise _MisreadError("a corner of a face lacks a number")
    return dict(zip(pattern, numbers.reshape(-1, len(pattern)).T, strict=True))


def _read_mixed(faces, n_corner) -> dict:
    """Read face lines whose corners are written in different ways, a missing number as 0."""
    words = [[*word.split("/"), "", ""][:3] for word in " ".join(faces).split()]
    if len(words) != n_corner:
        raise _MisreadError("a face line holds a blank that is none of ASCII's")
    try:
        table = np.array([[int(number or 0) for number in word] for word in words], np.int64)
    except (ValueError, OverflowError) as fault:
        raise _MisreadError("a face line holds something that is no number") from fault
    return dict(zip(("v", "vt", "vn"), table.reshape(-1, 3).T, strict=True))


def _count_from_start(column, text, kind, n_corner):
    """Turn negative numbers, which count back from their line, into numbers from 1; 0 if there are none."""
    given_at = [match.start() for match in re.finditer(f"\n{kind} ", text)]
    face_at = [match.start() for match in re.finditer("\nf ", text)]
    so_far = np.repeat(np.searchsorted(given_at, face_at), n_corner)
    return np.where(column < 0, np.maximum(so_far + column + 1, 0), column)


def _in_force(text, keyword, value_of, default, n_face):
    """Return for each face line the value of the last line before it that begins with the keyword."""
    values, n_before, place = [default], [], 0
    for match in re.finditer(rf"\n{keyword} (.*)", text):
        n_before.append(text.count("\nf ", place, match.start() + 1))
        values.append(value_of(match[1].strip()))
        place = match.start()
    n_before = np.cumsum(n_before, dtype=np.int64)
    return np.repeat(np.array(values, np.int64), np.diff(n_before, prepend=0, append=n_face))


def _smoothing_group(word: str) -> int:
    """Return the number of a smoothing group: `off` and anything unknown are 0, `on` is 1."""
    if word == "on":
        return 1
    is_number = word.isascii() and word.isdigit() and len(word) < 10  # within int32
    return int(word) if is_number else 0


def _rewrite_faces(text, corners) -> str:
    """Write the face lines anew for trimesh: numbers from 1; texture coordinates if every corner has one."""
    words = [str(v) for v in (corners.v + 1).tolist()]
    if len(words) and corners.vt.min() >= 0:
        words = [f"{v}/{vt}" for v, vt in zip(words, (corners.vt + 1).tolist(), strict=True)]
    ends = np.cumsum(corners.n_corner).tolist()
    faces = iter(["\nf " + " ".join(words[start:end]) for start, end in zip([0, *ends], ends, strict=False)])
    return re.sub("\nf .*", lambda _: next(faces), text)


def _read_normals(text) -> np.ndarray:
    """Return the three numbers of every vn line, (n, 3) float64."""
    rows = re.findall(r"\nvn (.*)", text)
    numbers = _numbers_in(" ".join(rows), np.float64, "a normal")
    if len(numbers) != 3 * len(rows):
        raise _MisreadError("a normal has not three numbers")
    return numbers.reshape(-1, 3)


# --- alignment ----------------------------------------------------------------------------------------------


def _recover(part: Part, corners: Corners, number: int, normals) -> Part:
    """Lay the table beside the triangles of one material, and take from it what trimesh has lost."""
    is_mine = corners.material == number
    corner_idx = np.flatnonzero(np.repeat(is_mine, corners.n_corner))
    n_corner = corners.n_corner[is_mine]
    triangles = fans(n_corner)
    if len(triangles.polygons) != len(part["faces"]):
        raise _MisreadError("trimesh finds another number of triangles")
    taken = part["faces"][_file_order(n_corner, triangles)]
    corner_idx = corner_idx[triangles.corners]
    merged = _join_seams(part, taken, corners.v[corner_idx])
    if normals is not None and (normal_idx := corners.vn[corner_idx]).min() >= 0:
        if normal_idx.max() >= len(normals):
            raise _MisreadError("a face refers to a normal after the last")
        merged["normals"] = normals[normal_idx]
    if n_corner.max() > 3:
        merged["polygons"] = triangles.polygons.astype(np.int32)
    smoothing = corners.smoothing[is_mine][triangles.polygons]
    if smoothing.any():
        merged["smoothing"] = smoothing.astype(np.int32)
    return merged


def _file_order(n_corner, triangles: Fans):
    """Return where the file's triangles stand in trimesh's list: they are grouped only if all are quads."""
    is_uniform = (n_corner == n_corner[0]).all()
    return np.argsort(triangles.order) if is_uniform else np.arange(len(triangles.order))


def _join_seams(part: Part, taken, v) -> Part:
    """Undo the copies that trimesh makes of a vertex with several normals or texture coordinates.

    Parameters
    ----------
    part : with trimesh's vertices and what belongs to them
    taken : (n_triangle, 3) trimesh's faces, in the order of the file
    v : (n_triangle, 3) the vertices of the same triangles, as the file numbers them
    """
    is_used = np.zeros(int(v.max()) + 1, bool)
    is_used[v] = True
    faces = (np.cumsum(is_used) - 1)[v]
    merged = {**part, "faces": faces}
    merged.pop("normals", None)
    for attribute in ("vertices", "colors", "uv"):
        if attribute not in part:
            continue
        of_corner = part[attribute][taken]
        values = np.empty((int(is_used.sum()), of_corner.shape[2]), of_corner.dtype)
        values[faces] = of_corner
        if np.array_equal(values[faces], of_corner, equal_nan=attribute != "colors"):
            merged[attribute] = values
        elif attribute == "uv":
            merged[attribute] = of_corner
        else:
            raise _MisreadError("trimesh finds other triangles")
    return merged


# --- materials ----------------------------------------------------------------------------------------------


def _find_materials(model, text, names) -> dict[str, Material]:
    """Read the MTL files that the OBJ names; warn of what is missing."""
    if not names:
        return {}
    materials, missing = {}, []
    for line in re.findall(r"\nmtllib +(.*?) *(?=\n)", text):
        # Names with blanks are written like several names.
        for name in [line] if _library(model, line) else line.split():
            library = _library(model, name)
            if library is None:
                missing.append(name)
            else:
                materials |= read_materials(library)
    unknown = [name for name in names if name not in materials]
    if missing:
        listed = ", ".join(f"'{name}'" for name in dict.fromkeys(missing))
        warnings.warn(
            f"{model.name}: material file {listed} not found; the default material is used", stacklevel=2
        )
    elif unknown:
        listed = ", ".join(f"'{name}'" for name in unknown[:5])
        warnings.warn(f"{model.name}: no definition of material {listed}; the default is used", stacklevel=2)
    return materials


def _library(model, name) -> ModelFile | None:
    """Return an MTL file beside the model, or None."""
    if model.folder is None:
        return None
    path = model.folder / name.replace("\\", "/")
    try:
        return ModelFile(str(path), "mtl", path.read_bytes(), model.folder, model.log)
    except (OSError, ValueError):
        return None
