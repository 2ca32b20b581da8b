"""Read OBJ: vertices, polygons, normals, texture coordinates, smoothing groups, objects, materials.

    lines (obj_lines.py) ─ triangles (scene/triangulation.py) with their attributes ─ parts, one an object

Each `o` line with faces begins a part, which may have several materials; groups (`g`) only name faces, so normals go
across their borders. Faces keep the order of the file. Points, lines, faces with fewer than three corners, and curved
surfaces are left out.

Read as other programs do: corners written short (`1/`, `1//`, `2/2/`) have what they name. A `v` of four or five
numbers is a position, of six or more a position and its colour (0..1, or 0..255 where one is above 1), used where all
`v` lines have one. A `vt` after the last is none. `1.#QNAN` and the like are not a number. Format: Wavefront, Advanced
Visualizer manual, appendix B1, 1995.
"""

from dataclasses import replace

import numpy as np

from ..errors import counted, warn_caller
from ..scene.arrays import distinct
from ..scene.material import Material
from ..scene.mesh_arrays import has_area
from .model_file import WHITE, Contents, ModelFile, Part, bytes_of, cut_faces
from .obj_lines import Corners, LineError, ObjLines


def read_obj(model: ModelFile) -> Contents:
    """Read an OBJ file, the MTL files that it names, and the textures that those name.

    Returns
    -------
    Contents with one part for each object, in the order of the file

    Raises
    ------
    ModelError : naming the first line that is at fault

    Warns
    -----
    UserWarning : materials, textures or texture coordinates that are missing
    """
    lines = ObjLines(model.data)
    try:
        parts = _read_parts(model, lines)
    except LineError:
        parts = []
    if not parts and (fault := lines.first_fault()):
        line, reason = fault
        raise model.error(reason, lines.number_of(line))
    return _with_others(parts, lines)


def _with_others(parts, lines) -> Contents:
    """Say what the file has beside faces that are drawn."""
    n_point, n_line = lines.count_words("p"), len(lines.lines_of("l")) + lines.n_short_face
    curved = [keyword for keyword in ("curv", "curv2", "surf") if len(lines.lines_of(keyword))]
    if not parts and n_point + n_line == 0 and not curved:
        n_point = len(lines.lines_of("v"))
    left_out = (f"curved elements ({', '.join(curved)})",) if curved else ()
    if parts and not all("normals" in part for part in parts) and len(lines.lines_of("vn")):
        left_out += ("normals of meshes in which some faces have none",)
    return Contents(parts, n_point=n_point, n_line=n_line, left_out=left_out)


def _read_parts(model, lines) -> list[Part]:
    """Read the triangles of the file, and divide them into objects."""
    corners = lines.corners()
    if corners.counts.max(initial=0) < 3:
        return []
    points = lines.rows_of("v")

    def place(face):
        return f":{lines.number_of(corners.lines[face])}: the face"

    cut = cut_faces(model, points[:, :3], corners.v, corners.counts, place)
    whole = _make_part(lines, points, corners, cut.corners)
    face_lines = corners.lines[cut.polygons]
    material_of_face, names = _in_force(lines, "usemtl", face_lines)
    object_of_face, objects = _in_force(lines, "o", face_lines)
    # A material has one number, however often its name stands there; an object is another each time.
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    whole["face_material"] = np.array([numbers[name] for name in names] + [-1])[material_of_face]
    materials = _find_materials(model, lines.names_of("mtllib")[1], list(numbers))
    default = replace(whole["material"], name="")
    palette = [materials.get(name, replace(default, name=name)) for name in numbers] + [default]
    groups = set(lines.names_of("g")[1])
    objects.append(groups.pop() if len(groups) == 1 else "")  # the only group names what stands before the first object
    if corners.counts.max() > 3:
        whole["polygons"] = cut.polygons
    group_of_face, groups = _in_force(lines, "s", face_lines)
    if groups:
        whole["smoothing"] = np.array([*map(_smoothing_group, groups), 0], np.int32)[group_of_face]
    return [
        _with_materials(model, _take_range(whole, begin, end), palette, objects[number])
        for number, begin, end in _object_ranges(whole, object_of_face)
    ]


def _make_part(lines, points, corners: Corners, triangles) -> Part:
    """Put all triangles of the file, (n, 3) places in the list of corners, in one part."""
    faces = corners.v[triangles]
    part = {"vertices": points[:, :3], "faces": faces, "material": Material()}
    if points.shape[1] >= 6:
        is_used = np.zeros(len(points), bool)
        is_used[faces] = True
        if np.isfinite(points[is_used, 3:6]).all():
            colors = np.zeros((len(points), 3), np.uint8)
            colors[is_used] = bytes_of(points[is_used, 3:6])
            part |= {"colors": colors, "material": WHITE}
    if corners.vn is not None and corners.vn.max() >= 0:
        vn = corners.vn[triangles]
        part |= {"normals": lines.rows_of("vn")[vn, :3], "has_normals": (vn >= 0).all(axis=1)}
    if corners.vt is not None and corners.vt.max() >= 0:
        vt, texcoords = corners.vt[triangles], lines.rows_of("vt")[:, :2]
        is_there = (vt >= 0) & (vt < len(texcoords))
        if is_there.any():
            part["uv"] = np.where(is_there[..., None], texcoords[np.where(is_there, vt, 0)], 0.0)
            part["has_uv"] = is_there.all(axis=1)
    return part


def _in_force(lines, keyword, face_lines) -> tuple[np.ndarray, list[str]]:
    """Return for each triangle which line of a keyword was the last before it, -1 where none was; and their names."""
    places, names = lines.names_of(keyword)
    return np.searchsorted(places, face_lines) - 1, names


def _smoothing_group(name: str) -> int:
    """Return the number of a smoothing group: `off` and anything unknown are 0, `on` is 1."""
    name = name.partition("#")[0].strip()
    is_number = name.isascii() and name.isdigit() and len(name) < 10  # within int32
    return int(name) if is_number else int(name == "on")


# --- objects --------------------------------------------------------------------------------------------------------


def _object_ranges(whole: Part, object_of_face) -> list[tuple[int, int, int]]:
    """Return for each object its number, and where its triangles begin and end.

    Objects without a face that has an area go with their neighbour, so that the faces keep their numbers: a mesh must
    have such a face.
    """
    begins = np.flatnonzero(np.diff(object_of_face, prepend=object_of_face[0] - 1))
    if len(begins) > 1:
        is_kept = np.logical_or.reduceat(has_area(whole["vertices"], whole["faces"]), begins)
        is_kept[is_kept.argmax()] = True
        begins = begins[is_kept]
    edges = [0, *begins[1:].tolist(), len(object_of_face)]
    return list(zip(object_of_face[begins].tolist(), edges[:-1], edges[1:], strict=True))


def _take_range(whole: Part, begin, end) -> Part:
    """Return the triangles from `begin` to `end` with the vertices that they use; what some lack is left out."""
    used, faces = _compact(whole["faces"][begin:end])
    part = {key: whole[key][used] for key in ("vertices", "colors") if key in whole}
    part |= {"faces": faces, "face_material": whole["face_material"][begin:end]}
    if "normals" in whole and whole["has_normals"][begin:end].all():
        part["normals"] = whole["normals"][begin:end]
    if "uv" in whole and whole["has_uv"][begin:end].any():
        uv = whole["uv"][begin:end]
        of_vertex = np.empty((len(used), 2))
        of_vertex[faces] = uv
        is_same = np.array_equal(of_vertex[faces], uv, equal_nan=True)  # wherever faces share a vertex
        part |= {"uv": of_vertex if is_same else uv, "has_uv": whole["has_uv"][begin:end]}
    if "polygons" in whole:
        polygons = np.cumsum(np.diff(whole["polygons"][begin:end], prepend=whole["polygons"][begin]) > 0)
        if polygons[-1] + 1 < len(polygons):
            part["polygons"] = polygons.astype(np.int32)
    if "smoothing" in whole and whole["smoothing"][begin:end].any():
        part["smoothing"] = whole["smoothing"][begin:end]
    return part


def _compact(faces) -> tuple[np.ndarray, np.ndarray]:
    """Return which vertices faces use, ascending, and the faces with their numbers among these."""
    first, span = int(faces.min()), int(np.ptp(faces)) + 1
    if span > 8 * faces.size:  # few faces, far apart: sorting them is less than looking at all between
        used, faces_of_used = np.unique(faces, return_inverse=True)
        return used, faces_of_used.reshape(faces.shape)
    is_used = np.zeros(span, bool)
    is_used[faces - first] = True
    return np.flatnonzero(is_used) + first, (np.cumsum(is_used) - 1)[faces - first]


# --- materials ------------------------------------------------------------------------------------------------------


def _find_materials(model, libraries, names) -> dict[str, Material]:
    """Return the materials of these names, as `find_materials` does."""
    if not names:
        return {}
    from .material_libraries import find_materials

    return find_materials(model, libraries, names)


def _with_materials(model, part: Part, palette, name) -> Part:
    """Give a part its name and, of a palette, the materials that its faces use, in the order of their first use.

    Faces without texture coordinates get their material without its texture.
    """
    numbers = part.pop("face_material")
    has_uv = part.pop("has_uv", None)
    palette = list(palette)
    if has_uv is not None and not has_uv.all():
        numbers = numbers.copy()
        for number in distinct(numbers[~has_uv]).tolist():
            if palette[number].texture is not None:
                is_bare = (numbers == number) & ~has_uv
                palette.insert(-1, replace(palette[number], texture=None))  # the last one is the unnamed, -1
                numbers[is_bare] = len(palette) - 2
                warn_caller(
                    f"{model.name}: {counted(int(is_bare.sum()), 'face')} of mesh '{name}' without texture "
                    f"coordinates, with the material '{palette[number].name}': drawn without its texture"
                )
    used, first, inverse = np.unique(numbers, return_index=True, return_inverse=True)
    order = np.argsort(first)
    part["name"] = name
    if len(used) == 1:
        return part | {"material": palette[used[0]]}
    rank = np.argsort(order).astype(np.int32)
    return part | {"materials": tuple(palette[used[k]] for k in order), "face_material": rank[inverse]}
