"""Meshes of a scene file: models in files of their own, arrays beside it, or numbers in it; and where they are
placed."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import ModelError, shown
from ..scene.mesh import Mesh
from ..scene.validate import number, unit3, vector3
from . import formats
from .gltf import MOST_COPIES
from .model_file import MeshSettings
from .models import load_model
from .scene_file_parts import array_of, index_of, keeping_normals, read_material

# In the order of Mesh; all but the first two may be left out.
ARRAYS = ("vertices", "faces", "normals", "colors", "uv", "face_colors", "polygons", "smoothing", "face_material")
_FLOATS = ("vertices", "normals", "colors", "uv", "face_colors")  # of which whole numbers are as good as others
_PLACING = ("transform", "crease_angle", "weighting", "name")


def read_meshes(entry, context) -> tuple[list[Mesh], str]:
    """Read the list of meshes.

    Parameters
    ----------
    entry : Entry, the list
    context : Context

    Returns
    -------
    the meshes; and the up axis of the files where all meshes come from files that agree on one, else "y"

    Raises
    ------
    SceneError : a key or value that is not legal
    ModelError : a file or mesh that is not legal
    """
    meshes, axes = [], set()
    for item in entry.items():
        keys = item.names()
        if sum(key in keys for key in ("file", "arrays", "vertices")) != 1:
            raise item.fault("a mesh needs one of file (a model), arrays (a .npz file), or vertices and faces")
        if "file" in keys:
            found, up = _read_model(item, context)
        else:
            found, up = [_read_arrays(item, context)], "y"
        axes.add(up)
        meshes += found
    if not meshes:
        raise entry.fault("must hold at least one mesh; given none")
    return meshes, axes.pop() if len(axes) == 1 else "y"


def _read_model(entry, context) -> tuple[list[Mesh], str]:
    """Read a model file; its meshes get the transform, name and materials asked for. Its camera and lights aren't
    used."""
    table = entry.table(("file", *_PLACING, "material", "materials"), ("file",))
    if (format := formats.find(Path(table["file"].text()).suffix)) and format.is_scene:
        raise table["file"].fault(f"must be a model, no scene file; given {shown(table['file'].value)}")
    path = context.path(table["file"])
    scene = _load_once(path, table["file"], _crease_angle(table, context), _weighting(table, context), context)
    if "material" in table and "materials" in table:
        raise entry.fault("takes material (for all) or materials (by name); given both")
    meshes = list(scene.meshes)
    if "material" in table:
        material = read_material(table["material"], context)
        meshes = [replace_materials(mesh, dict.fromkeys(mesh.palette, material), entry) for mesh in meshes]
    elif "materials" in table:
        meshes = _with_named(meshes, table["materials"], context)
    return [_placed(mesh, table, entry) for mesh in meshes], scene.up


def _crease_angle(table, context):
    own = table["crease_angle"].value if "crease_angle" in table else None
    return own if context.crease_angle is None else context.crease_angle


def _load_once(path, entry, crease_angle, weighting, context):
    """Return the scene of a model file; one that is used in many places is read once, as long as its copies are not too
    many."""
    key = (path, crease_angle if isinstance(crease_angle, (int, float)) else None, weighting)
    if key in context.models:
        scene = context.models[key]
        context.n_copy += scene.n_face
        if context.n_copy > MOST_COPIES:
            raise entry.fault(
                f"this model has been used so often that it makes more than {MOST_COPIES} triangles", ModelError
            )
        return scene
    context.files.read.append(str(path))
    settings = MeshSettings(crease_angle, weighting, context.drop_bad_faces)
    files = context.files.below(path.parent)
    context.models[key] = entry.call(load_model, path, settings, log=context.log, files=files)
    return context.models[key]


def _weighting(table, context):
    own = table["weighting"].text() if "weighting" in table else None
    return own if context.weighting is None else context.weighting


def _with_named(meshes, entry, context) -> list[Mesh]:
    """Replace the materials that have one of the names."""
    names = sorted({material.name for mesh in meshes for material in mesh.palette} - {""})
    changes = {}
    for name, item in entry.names().items():
        if name not in names:
            raise item.fault(f"the model has no material of this name; it has {', '.join(names) or 'none with a name'}")
        changes[name] = read_material(item, context, name)
    changed = []
    for mesh in meshes:
        of_mesh = {material: changes[material.name] for material in mesh.palette if material.name in changes}
        changed.append(replace_materials(mesh, of_mesh, entry) if of_mesh else mesh)
    return changed


def replace_materials(mesh, changes, entry) -> Mesh:
    """Return a mesh with other materials.

    Parameters
    ----------
    mesh : Mesh
    changes : dict from Material to Material
    entry : Entry, the place that is named where the mesh can't have them

    Raises
    ------
    ModelError : a texture for a mesh without texture coordinates
    """
    palette = tuple(changes.get(material, material) for material in mesh.palette)
    own = {} if mesh.materials is None else {"materials": palette}
    return entry.call(replace, mesh, material=palette[0], **own)


def _read_arrays(entry, context) -> Mesh:
    """Read a mesh from numbers in the scene file, or from a .npz file."""
    is_inline = "arrays" not in entry.value
    source = ARRAYS if is_inline else ("arrays", "mesh")
    needed = ("vertices", "faces") if is_inline else source
    table = entry.table((*source, *_PLACING, "material", "materials", "drop_bad_faces"), needed)
    if is_inline:
        is_given = {key: key in table and (key in needed or table[key].value is not None) for key in ARRAYS}
        arrays = {key: _numbers(table[key], key) for key in ARRAYS if is_given[key]}
    else:
        start = f"mesh{index_of(table['mesh'])}_"
        array_of(table["arrays"], context, f"{start}vertices"), array_of(table["arrays"], context, f"{start}faces")
        stored = context.arrays(table["arrays"])
        arrays = {key: table["arrays"].call(stored.__getitem__, start + key) for key in ARRAYS if start + key in stored}
        context.n_copy += len(arrays["faces"]) if arrays["faces"].ndim else 0
        if context.n_copy > MOST_COPIES + stored.n_byte:
            raise entry.fault(
                f"its arrays have been used for more than {MOST_COPIES} triangles beyond those stored", ModelError
            )
    settings = {"crease_angle": _crease_angle(table, context), "drop_bad_faces": context.drop_bad_faces}
    if (weighting := _weighting(table, context)) is not None:
        settings["weighting"] = weighting
    if "drop_bad_faces" in table:
        settings["drop_bad_faces"] |= table["drop_bad_faces"].flag()
    if "material" in table:
        settings["material"] = read_material(table["material"], context)
    if "materials" in table:
        settings["materials"] = [read_material(item, context) for item in table["materials"].items()]
    mesh = entry.call(Mesh, **arrays, **settings)
    if "normals" in arrays:
        mesh = keeping_normals(mesh, np.asarray(arrays["normals"]))
    return _placed(mesh, table, entry)


def _numbers(entry, key):
    """Return an array of the file as the class takes it; whole numbers among the colours are linear too, not 8-bit
    values."""
    entry.items()
    if key not in _FLOATS:
        return entry.value
    try:
        array = np.asarray(entry.value)
        is_number = array.dtype.kind in "iuf"
    except (ValueError, OverflowError):  # lists of several lengths, or too many digits
        is_number = False
    if not is_number:
        raise entry.fault(
            f"must be a list of lists of numbers, all of one length; given {shown(entry.value)}", ModelError
        )
    return array.astype(np.float64)


# --- where they are placed ----------------------------------------------------------------------------------


def _placed(mesh, table, entry) -> Mesh:
    """Give a mesh its name, and move it."""
    if "name" in table:
        # The mesh is new; a copy by `replace` would normalise its normals once more, which moves them by a rounding.
        object.__setattr__(mesh, "name", table["name"].text())
    if "transform" not in table:
        return mesh
    transform = table["transform"]
    return transform.call(mesh.transformed, read_matrix(transform))


def read_matrix(entry) -> np.ndarray:
    """Read a transform: 4 × 4 numbers, row after row, or a table of translate, rotate and scale.

    Returns
    -------
    (4, 4) float64, world-from-model: scaled first, then rotated, then moved; raises SceneError
    """
    if isinstance(entry.value, list):
        rows = [item.value for item in entry.items()]
        is_matrix = len(rows) == 4 and all(isinstance(row, list) and len(row) == 4 for row in rows)
        if not is_matrix:
            raise entry.fault(f"must be 4 rows of 4 numbers; given {shown(entry.value)}")
        return np.array([[entry.call(number, x, "each number of the matrix") for x in row] for row in rows])
    table = entry.table(("translate", "rotate", "scale"))
    matrix = np.eye(4)
    if "scale" in table:
        scale = table["scale"]
        factors = scale.value if isinstance(scale.value, list) else [scale.value] * 3
        matrix[:3, :3] = np.diag(scale.call(vector3, factors, "the scale (a number, or three)"))
    if "rotate" in table:
        matrix[:3, :3] = _rotation(table["rotate"]) @ matrix[:3, :3]
    if "translate" in table:
        matrix[:3, 3] = table["translate"].call(vector3, table["translate"].value, "the translation")
    return matrix


def _rotation(entry) -> np.ndarray:
    """The rotation (3, 3) about an axis by an angle in degrees, counter-clockwise seen from the axis' tip.

    Source: Rodrigues 1840: R = I + sin a K + (1 - cos a) K², with K v = axis × v.
    """
    table = entry.table(("axis", "angle"), ("axis", "angle"))
    x, y, z = table["axis"].call(unit3, table["axis"].value, "the axis")
    angle = math.radians(math.fmod(table["angle"].call(number, table["angle"].value, "the angle"), 360.0))
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
