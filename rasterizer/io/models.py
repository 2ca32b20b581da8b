"""Load model files: the bytes of a file to the meshes of a scene.

source ─ ModelFile ─ reader of the format ─ parts ─ Mesh ─ Scene
path     name        by the table of        plain   checked
bytes    bytes       formats.py             arrays
"""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import ModelError, SceneError, counted, one_file, warn_caller
from ..scene.camera import Camera
from ..scene.mesh import Mesh
from ..scene.mesh_arrays import fixed, has_any_area
from ..scene.scene import Scene
from . import formats
from .files import Folder, read_named
from .model_file import Contents, MeshSettings, ModelFile, Part, Report, materials_of
from .weld import weld


def load_model(
    source,
    mesh_settings: MeshSettings,
    *,
    format: str | None = None,
    log: Callable[[str], None] | None = None,
    files: Folder | None = None,
    settings: dict | None = None,
) -> Scene:
    """Load a model file, no scene file.

    Parameters
    ----------
    source, format, log : as `load` takes them
    mesh_settings : how its meshes are made
    files : which other files may be read; None = by the rules of `files.py`
    settings : arguments of Scene

    Returns and raises what `load` does.
    """
    with one_file(name_of(source)):
        entry = formats.format_of(name_of(source), format, is_scene=False)
        model = _open(source, entry, log or keep_quiet)._replace(files=files)
        contents = _read(entry, model)
        own = {"up": entry.up, "lights": contents.lights, "camera": contents.camera}
        settings = {key: value for key, value in own.items() if value is not None} | (settings or {})
        scene = Scene(_make_meshes(model, contents, mesh_settings), **settings)
        if contents.camera is not None and scene.camera is contents.camera:
            scene = replace(scene, camera=_aimed(contents.camera, scene.bounds))
        return with_changes(scene, {}, weighting=mesh_settings.weighting)


def _aimed(camera: Camera, bounds) -> Camera:
    """Return a camera whose target is as far ahead as the middle of a box (2, 3), world space. A file says where its
    camera looks, but not how far; whoever turns a camera turns it about its target.

    Behind the eye, or nearer than 2^-20 of the eye's own coordinates, the middle counts for nothing: so the direction,
    which is computed from both points, keeps 32 bits.
    """
    eye, target = np.array(camera.position), np.array(camera.target)
    ahead = (target - eye) / np.linalg.norm(target - eye)
    distance = float((bounds.mean(axis=0) - eye) @ ahead)
    if not distance > 2.0**-20 * float(np.abs(eye).max()):
        return camera
    return replace(camera, target=tuple((eye + distance * ahead).tolist()))


def _read(entry, model) -> Contents:
    """Let the reader of a format read a file; where it finds nothing, the error says what the file looks like."""
    try:
        contents = entry.read()(model)
        contents = contents if isinstance(contents, Contents) else Contents(contents)
        if not contents.parts:
            raise model.error(_why_no_faces(contents))
    except ModelError as fault:
        from .other_formats import hint_for_content

        hint = hint_for_content(model.data, entry.name)
        if hint:
            raise ModelError(f"{fault}{hint}") from fault
        raise
    return contents


def name_of(source) -> str:
    """Return what messages call a file."""
    label = source if isinstance(source, (str, os.PathLike)) else getattr(source, "name", None)
    return os.fsdecode(label) if isinstance(label, (str, os.PathLike)) and label else "model"


def keep_quiet(_text: str) -> None:
    """Take a fact that nobody wants."""


def with_changes(scene: Scene, settings: dict, *, crease_angle=None, weighting=None) -> Scene:
    """Return a scene with other settings of its own and, where they are not None, of its meshes."""
    own = {"crease_angle": crease_angle, "weighting": weighting}
    own = {key: value for key, value in own.items() if value is not None}
    if own:
        settings = settings | {"meshes": tuple(replace(mesh, **own) for mesh in scene.meshes)}
    return replace(scene, **settings) if settings else scene


# --- where the bytes come from ----------------------------------------------------------------------------------------


def _open(source, entry, log) -> ModelFile:
    """Read all bytes of a file."""
    if isinstance(source, (bytes, bytearray, memoryview)):
        name, folder, data = name_of(source), None, bytes(source)
    elif hasattr(source, "read"):
        name, folder, data = _read_stream(source, entry)
    else:
        path = Path(os.fsdecode(source))
        name, folder, data = str(path), path.parent, _read_path(path)
    model = ModelFile(name, entry.name, data, folder, log)
    if not data.strip():
        raise model.error("the file is empty")
    return model


def _read_stream(stream, entry) -> tuple[str, Path | None, bytes]:
    """Return name, folder and bytes of an open file, binary or text."""
    name = getattr(stream, "name", None)
    path = Path(name) if isinstance(name, (str, os.PathLike)) and name else None
    label = str(path) if path else "model"
    try:
        data = stream.read()
    except (OSError, ValueError) as fault:
        raise ModelError(f"{label}: can't be read ({fault})") from fault
    if isinstance(data, str):
        if entry.is_binary:
            raise ModelError(f"{label}: {entry.name} is no text; open the file with mode 'rb'")
        data = data.encode("utf-8", "surrogateescape")
    if not isinstance(data, (bytes, bytearray)):
        raise ModelError(f"{label}: reading the file object gives {type(data).__name__}, not bytes or text")
    return label, path.parent if path and os.path.isfile(path) else None, bytes(data)


def _read_path(path) -> bytes:
    """Return the bytes of a file."""
    try:
        return read_named(path)
    except FileNotFoundError:
        raise ModelError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise ModelError(f"{path}: is a folder, not a model file") from None
    except (OSError, ValueError) as fault:
        raise ModelError(f"{path}: can't be read ({getattr(fault, 'strerror', None) or fault})") from fault


# --- meshes -----------------------------------------------------------------------------------------------------------


def _make_meshes(model, contents, settings) -> list[Mesh]:
    """Check the parts of a file, and place them."""
    placed = [pair if isinstance(pair, tuple) else (pair, None) for pair in contents.parts]
    for part, _ in placed:
        if part["vertices"].shape[1:] != (3,) or part["faces"].shape[1:] != (3,):
            raise model.error(f"vertices of the shape {part['vertices'].shape}, (n, 3) is needed")
    _report(model, contents, [part for part, _ in placed], settings.crease_angle)
    if len(placed) > 1:
        placed = [pair for pair in placed if _is_worth_drawing(pair[0], settings.drop_bad_faces)] or placed[:1]
    return [_place(model, _prepare(model, part, settings), matrix, settings) for part, matrix in placed]


def _why_no_faces(contents) -> str:
    """Say what a file without faces has in their place."""
    if contents.n_line:
        return f"nothing but lines: {counted(contents.n_line, 'line')}, no faces"
    if contents.n_point:
        return f"a point cloud: {counted(contents.n_point, 'point')}, no faces"
    return f"no faces; not used: {', '.join(contents.left_out)}" if contents.left_out else "no faces"


def _prepare(model, part, settings) -> Part:
    """Join copied vertices if normals are to be averaged across them; mend the file's own normals."""
    repeats = formats.FORMATS[model.format].repeats_vertices
    if repeats and (settings.crease_angle is not None or "normals" not in part):
        part = weld(part)
    return _mend_normals(model, _without_useless_textures(model, part))


def _without_useless_textures(model, part: Part) -> Part:
    """Take the textures off the materials of a part that has no texture coordinates."""
    useless = [material.name for material in materials_of(part) if material.texture is not None]
    if "uv" in part or not useless:
        return part
    names = ", ".join(f"'{name}'" for name in useless)
    what = f"{model.name}: mesh '{part['name']}' has no texture coordinates"
    warn_caller(f"{what}; it is drawn without the texture of its material {names}")
    if "materials" in part:
        return {**part, "materials": tuple(replace(material, texture=None) for material in part["materials"])}
    return {**part, "material": replace(part["material"], texture=None)}


def _place(model, part, matrix, settings) -> Mesh:
    """Make the mesh of a part, and move it to where its node is."""
    label = f"mesh '{part['name']}': " if part["name"] else ""
    try:
        # The reader's own arrays, which nobody else has: the mesh needs no copies.
        part = {key: fixed(value) if isinstance(value, np.ndarray) else value for key, value in part.items()}
        mesh = Mesh(**part, crease_angle=settings.crease_angle, drop_bad_faces=settings.drop_bad_faces)
    except ModelError as fault:
        raise model.error(f"{label}{fault}") from fault
    if matrix is None or np.array_equal(matrix, np.eye(4)):
        return mesh
    try:
        return mesh.transformed(matrix)
    except (ModelError, SceneError) as fault:
        raise model.error(f"{label}the transform of its node: {fault}") from fault


def _is_worth_drawing(part: Part, drop_bad_faces) -> bool:
    """Tell whether one part of several is kept: it has a face with an area, or a fault that must be seen."""
    faces, n_vertex = part["faces"], len(part["vertices"])
    if faces.min() < 0 or faces.max() >= n_vertex:
        return True
    return has_any_area(part["vertices"], faces) or not (drop_bad_faces or np.isfinite(part["vertices"]).all())


def _mend_normals(model, part: Part) -> Part:
    """Make normals that are not finite zero, and say how many are: a mesh computes those from its faces."""
    normals = part.get("normals")
    if normals is None or part["faces"].max() >= len(part["vertices"]) or part["faces"].min() < 0:
        return part
    with np.errstate(all="ignore"):
        length = np.linalg.norm(normals, axis=-1)
        is_bad = ~((length > 0.0) & np.isfinite(length))
        if not is_bad.any():
            return part
    what = f"{int(is_bad.sum())} file normals are zero or not finite"
    model.log(f"{model.name}: {what}; they are computed from the faces")
    return {**part, "normals": np.where(is_bad[..., None], 0.0, normals)}


def _report(model, contents, parts, crease_angle):
    """Say in one line what the file had, what is used of it, and what is not."""
    has = {key for part in parts for key in part}
    facts = [counted(sum(len(part["faces"]) for part in parts), "face"), *_counts(contents, parts)]
    facts += [what for key, what in _ATTRIBUTES.items() if key in has]
    left_out = [counted(n, what) for n, what in ((contents.n_point, "point"), (contents.n_line, "line")) if n]
    if "uv" in has and not any(material.needs_uv for part in parts for material in materials_of(part)):
        left_out.append("texture coordinates")
    left_out += contents.left_out
    normals = next((what for key, what in _NORMALS.items() if key in has), None)
    if normals and crease_angle is not None:
        facts.append(f"{normals} not used: crease angle {crease_angle} asked for")
    else:
        facts.append(f"{normals} used" if normals else "no file normals")
    unused = f"; not used: {', '.join(left_out)}" if left_out else ""
    model.log(Report(f"{model.name}: {', '.join([*facts, *contents.facts])}{unused}", left_out))


_ATTRIBUTES = {
    "polygons": "polygons with more than 3 corners",
    "colors": "vertex colours",
    "face_colors": "face colours",
}
_NORMALS = {"normals": "file normals", "smoothing": "smoothing groups"}


def _counts(contents, parts) -> list[str]:
    """Say how many meshes, materials, textures, lights and cameras there are, unless none, or one mesh."""
    materials = [material for part in parts for material in materials_of(part)]
    n_material = len({material.name for material in materials} - {""})
    n_texture = len({id(material.texture) for material in materials} - {id(None)})
    counts = (n_material, "material"), (n_texture, "texture"), (len(contents.lights or ()), "light")
    facts = [counted(len(parts), "mesh")] if len(parts) > 1 else []
    facts += [counted(n, what) for n, what in counts if n]
    return facts + (["a camera"] if contents.camera is not None else [])
