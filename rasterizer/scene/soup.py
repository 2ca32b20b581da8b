"""Read STL, PLY and OFF through trimesh, and check what it takes on trust: lengths, counts, polygons."""

import numpy as np

from rasterizer.errors import ModelError
from rasterizer.scene.parse import (
    WHITE,
    ModelFile,
    Part,
    fans,
    part_from,
    run_trimesh,
    sort_into_file_order,
    text_of,
    triangle_meshes,
)

_STL_HEADER, _STL_FACE = 84, 50  # bytes


def read_stl(model: ModelFile) -> list[Part]:
    """Read binary or ASCII STL; every triangle has its own three vertices."""
    data, length = model.data, len(model.data)
    n_face = int.from_bytes(data[80:84], "little")
    if length >= _STL_HEADER and length == _STL_HEADER + _STL_FACE * n_face:
        scene = run_trimesh(model)
    elif data.lstrip()[:5].lower() == b"solid":
        text = text_of(data)
        if "endsolid" not in text.lower():
            raise model.error("ASCII STL without 'endsolid': the file is cut off")
        scene = run_trimesh(model, text.encode())
    elif length < _STL_HEADER:
        raise model.error(
            f"not an STL file: {length} bytes, a binary one has at least {_STL_HEADER}, "
            "an ASCII one begins with 'solid'"
        )
    else:
        expected = _STL_HEADER + _STL_FACE * n_face
        raise model.error(f"binary STL of {n_face} faces must have {expected} bytes, the file has {length}")
    parts = []
    for name, mesh in triangle_meshes(scene).items():
        part = part_from(mesh, "" if name.startswith("geometry") else name)
        attributes = mesh.face_attributes.get("stl")
        if attributes is not None:
            part.update(_stl_colors(data[:80], np.asarray(attributes).reshape(-1)))
        parts.append(part)
    return parts


def _stl_colors(header: bytes, attributes) -> dict:
    """Decode the colours that two conventions keep in the 16 attribute bits of a binary STL face.

    VisCAM and SolidView: bit 15 set where the face has a colour, then red, green, blue from the high bits
    down, 5 bits each. Materialise Magics: the header holds `COLOR=` and the part's RGBA, bit 15 *clear* where
    the face has its own, red lowest.
    """
    red, green, blue = ((attributes >> shift) & 31 for shift in (10, 5, 0))
    is_own = attributes >= 0x8000
    start = header.find(b"COLOR=")
    common = (255, 255, 255)
    if 0 <= start <= 70:
        red, blue, is_own = blue, red, ~is_own
        common = tuple(header[start + 6 : start + 9])
    elif not is_own.any():
        return {}
    own = np.stack([red, green, blue], axis=1) * 255 // 31
    colors = np.where(is_own[:, None], own, np.array(common))
    return {"face_colors": colors.astype(np.uint8), "material": WHITE}


def read_ply(model: ModelFile) -> list[Part]:
    """Read ASCII or binary PLY with normals, colours and polygons (in binary files all of one size)."""
    if model.data[:3].lower() != b"ply":
        raise model.error("not a PLY file: it does not begin with 'ply'")
    if b"end_header" not in model.data:
        raise model.error("the PLY header has no 'end_header'")
    parts = []
    for mesh in triangle_meshes(_run_ply(model)).values():
        elements = mesh.metadata.get("_ply_raw", {})
        for kind in ("vertex", "face"):
            _check_length(model, kind, elements.get(kind, {}))
        parts.append(sort_into_file_order(part_from(mesh), _ply_corners(elements["face"]["data"])))
    return parts


def _run_ply(model):
    """Parse the file; explain the one refusal that may be a limit of trimesh, not a fault of the file."""
    header, mark, rest = model.data.partition(b"end_header")
    # trimesh refuses comments that are not UTF-8
    ascii_header = header.decode("ascii", "replace").encode("ascii", "replace")
    try:
        return run_trimesh(model, ascii_header + mark + rest, skip_materials=True)
    except ModelError as fault:
        if "unexpected length" not in str(fault):
            raise
        raise model.error(
            "binary PLY of another length than its header says, or with faces of different numbers of "
            "corners (those are read from ASCII PLY only)"
        ) from fault


def _check_length(model, kind, element):
    """Raise if an element has fewer rows than the header promises."""
    data, promised = element.get("data"), element.get("length", 0)
    columns = list(data.values()) if isinstance(data, dict) else [data]
    found = min((len(column) for column in columns if column is not None), default=0)
    if found != promised:
        raise model.error(f"the header promises {promised} {kind} lines, the file has {found}")


def _ply_corners(data):
    """Return the number of corners of each face; nothing where only trimesh knows the name of the indices."""
    names = data.dtype.names if isinstance(data, np.ndarray) else data.keys()
    lists = [data[name] for name in names or () if name in ("vertex_index", "vertex_indices")]
    if not lists:
        return np.empty(0, np.int64)
    indices = lists[0]
    if indices.dtype.names:  # binary: (count, indices)
        indices = indices[indices.dtype.names[-1]]
    if indices.dtype == object:
        return np.array([np.size(row) for row in indices])
    return np.full(len(indices), indices.shape[1] if indices.ndim == 2 else 1)


def read_off(model: ModelFile) -> list[Part]:
    """Read OFF with its polygons; colours of COFF files are reported as not read."""
    text = text_of(model.data)
    if "OFF" not in text[:1000]:
        raise model.error("not an OFF file: 'OFF' is missing at its start")
    if "COFF" in text[:1000]:
        model.log(f"{model.name}: the colours of an OFF file are not read")
    try:
        vertices, faces = _off_lines(model, text)
        n_corner = np.array([int(words[0]) for words in faces], np.int64)
    except ModelError:
        raise
    except (ValueError, IndexError, OverflowError) as fault:
        raise model.error(f"not a readable OFF file ({fault})") from fault
    if n_corner.min(initial=0) < 0:
        raise model.error(f"a face line says that it has {n_corner.min()} corners")
    if any(len(words) <= n for words, n in zip(faces, n_corner, strict=True)):
        raise model.error("a face line has fewer corners than it says")
    if n_corner.max(initial=3) <= 3:
        return [part_from(mesh) for mesh in triangle_meshes(run_trimesh(model, text)).values()]
    triangles = fans(n_corner)
    words = [word for words, n in zip(faces, n_corner, strict=True) for word in words[1 : n + 1]]
    lines = ["3 " + " ".join(words[k] for k in corners) for corners in triangles.corners.tolist()]
    cut = "\n".join(["OFF", f"{len(vertices)} {len(lines)} 0", *map(" ".join, vertices), *lines])
    polygons = {"polygons": triangles.polygons.astype(np.int32)}
    return [part_from(mesh) | polygons for mesh in triangle_meshes(run_trimesh(model, cut)).values()]


def _off_lines(model, text):
    """Return the words of the vertex lines and of the face lines, as many as the header promises."""
    body = text[text.index("OFF") + 3 :]
    lines = [words for line in body.splitlines() if (words := line.partition("#")[0].split())]
    n_vertex, n_face = int(lines[0][0]), int(lines[0][1])
    vertices, faces = lines[1 : 1 + n_vertex], lines[1 + n_vertex : 1 + n_vertex + n_face]
    if (len(vertices), len(faces)) != (n_vertex, n_face):
        found = f"{len(vertices)} and {len(faces)}"
        raise model.error(f"the header promises {n_vertex} vertices and {n_face} faces, the file has {found}")
    return vertices, faces
