"""Load a model: files of every format, and whatever is a mesh already. Which files may be read is said in `_files`.

In: a path, bytes, an open file, or a mesh. Out: a Scene.

    source ─ ModelFile ─ reader of the format ─ parts ─ Mesh ─ Scene
    path     name        obj  stl  ply           plain   checked
    bytes    bytes       off  glb  gltf  3mf     arrays
"""

import os
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import ModelError, SceneError, one_file, shown
from ..scene.mesh import Mesh
from ..scene.mesh_arrays import fixed, has_any_area
from ..scene.scene import Scene
from .files import Folder, read_named
from .gltf import read_gltf
from .model_file import Contents, ModelFile, Part, materials_of, weld
from .obj import read_obj
from .ply import read_ply
from .stl_off import read_off, read_stl
from .threemf import read_3mf

_UP_AXES = {"stl": "z", "3mf": "z"}  # all others: y
_SPLIT_FORMATS = (
    "stl",
    "glb",
    "gltf",
)  # a vertex is repeated for each of its triangles, normals or texture coordinates


def load(
    source,
    *,
    format=None,
    crease_angle=None,
    up=None,
    lights=None,
    camera=None,
    background=None,
    depth_cue=None,
    weighting=None,
    drop_bad_faces=False,
    log=None,
    allow_outside=False,
    files_read=None,
):
    """Load a model into a scene: its meshes, with studio lights and a framed camera unless others are given, here or in
    the file.

    Parameters
    ----------
    source : path (str or PathLike), bytes, file object, trimesh.Trimesh or trimesh.Scene, Mesh, pair
        (vertices, faces), or Scene
    format : text, "obj", "stl", "ply", "off", "glb", "gltf" or "3mf", or "json" or "toml" for a scene file; None = by
        the suffix of the path or the file's name
    crease_angle : degrees within 0..180; an edge between faces that meet at more stays sharp. None = the
        normals of the file if it has any, else its smoothing groups, else 30
    up : text, up axis "x", "y", "z" or with a minus sign; None = z for STL and 3MF, that of a scene file, y for the
        others
    lights : sequence of lights; None = those of the file (GLB, glTF and scene files may have some), else studio lights
    camera : Camera; None = the first of the file, else framed when the picture is made
    background : colour; None = that of a scene file, else transparent
    depth_cue : DepthCue, or a number, its scale; None = that of a scene file, else nothing fades with depth
    weighting : text, "angle", "area" or "uniform": what faces count by where normals are averaged, see `Mesh`; None =
        "angle", or as a scene file says
    drop_bad_faces : bool, leave out faces whose coordinates are NaN or infinite, instead of raising an error
    log : function of one text, called with facts about the file; None = nobody wants them
    allow_outside : bool, read also files outside the folder of the file that names them: textures, buffers, parts of a
        scene
    files_read : list that gets the paths (text) of all other files that were read, each as often as it was;
        None = nobody wants them

    Returns
    -------
    Scene; a Scene given is returned as it is, but for the arguments that are not None

    Raises
    ------
    ModelError : the file can't be read, is no model, has no faces, or is broken; the message names the file,
        the line where there is one, and the fault
    SceneError : another argument is not legal

    Warns
    -----
    UserWarning : materials, textures or texture coordinates that the file uses are missing or unreadable, values of
        materials that are taken otherwise than they stand there, polygons that cross themselves
    """
    from .scene_file import is_scene_file, read_scene  # which loads models in turn

    if log is not None and not callable(log):
        raise SceneError(f"log must be a function of one text, or None; given {shown(log)}")
    log = log or _keep_quiet
    settings = {"lights": lights, "camera": camera, "background": background, "depth_cue": depth_cue, "up": up}
    settings = {key: value for key, value in settings.items() if value is not None}
    if isinstance(source, Scene):
        return _with_changes(source, settings, crease_angle, weighting)
    if is_scene_file(source, format):
        options = {"crease_angle": crease_angle, "weighting": weighting, "drop_bad_faces": drop_bad_faces}
        with one_file(_name_of(source)):
            read = read_scene(
                source, log=log, format=format, allow_outside=allow_outside, files_read=files_read, **options
            )
            return _with_changes(read.framed_scene(), settings, None)
    if not _is_file(source):
        return _with_changes(Scene(_take_meshes(source, crease_angle, drop_bad_faces), **settings), {}, None, weighting)
    files = None
    if isinstance(source, (str, os.PathLike)):
        files = Folder(Path(os.fsdecode(source)).parent, None, allow_outside, files_read)
    return load_file(source, format, crease_angle, weighting, drop_bad_faces, log, files, settings)


def load_file(
    source, format=None, crease_angle=None, weighting=None, drop_bad_faces=False, log=None, files=None, settings=None
) -> Scene:
    """Load a model file, no scene file.

    Parameters
    ----------
    source, format, crease_angle, weighting, drop_bad_faces, log : as `load` takes them
    files : Folder, which other files may be read; None = by the rules of `_files`
    settings : dict of arguments of Scene

    Returns and raises what `load` does.
    """
    settings = dict(settings or {})
    with one_file(_name_of(source)):
        model = _open(source, format, log or _keep_quiet)._replace(files=files)
        settings.setdefault("up", _UP_AXES.get(model.format, "y"))
        contents = _READERS[model.format](model)
        contents = contents if isinstance(contents, Contents) else Contents(contents)
        meshes = _make_meshes(model, contents, crease_angle, drop_bad_faces)
        for key in ("lights", "camera"):
            if getattr(contents, key) is not None:
                settings.setdefault(key, getattr(contents, key))
        return _with_changes(Scene(meshes, **settings), {}, None, weighting)


def _name_of(source) -> str:
    """What messages call a file."""
    label = getattr(source, "name", "model") if hasattr(source, "read") else source
    return os.fsdecode(label) if isinstance(label, (str, os.PathLike)) and label else "model"


def _keep_quiet(_text):
    """Take a fact that nobody wants."""


def _with_changes(scene, settings, crease_angle, weighting=None):
    """Return a scene with other settings."""
    own = {"crease_angle": crease_angle, "weighting": weighting}
    own = {key: value for key, value in own.items() if value is not None}
    if own:
        settings["meshes"] = tuple(replace(mesh, **own) for mesh in scene.meshes)
    return replace(scene, **settings) if settings else scene


# --- where the bytes come from ------------------------------------------------------------------------------


def _is_file(source) -> bool:
    """Tell whether the source is a file: its path, its bytes, or an open one."""
    return isinstance(source, (str, os.PathLike, bytes, bytearray, memoryview)) or hasattr(source, "read")


def _open(source, format, log) -> ModelFile:
    """Read all bytes of a file, and find out its format."""
    if isinstance(source, (bytes, bytearray, memoryview)):
        name, folder, data = "model", None, bytes(source)
    elif hasattr(source, "read"):
        name, folder, data = _read_stream(source)
    else:
        path = Path(os.fsdecode(source))
        name, folder, data = str(path), path.parent, None
    format = _format_of(name, format)
    if data is None:
        data = _read_path(path)
    model = ModelFile(name, format, data, folder, log)
    if not data.strip():
        raise model.error("the file is empty")
    return model


def _read_stream(stream):
    """Return name, folder and bytes of an open file, binary or text."""
    name = getattr(stream, "name", None)
    path = Path(name) if isinstance(name, (str, os.PathLike)) and name else None
    label = str(path) if path else "model"
    try:
        data = stream.read()
    except (OSError, ValueError) as fault:
        raise ModelError(f"{label}: can't be read ({fault})") from fault
    if isinstance(data, str):
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


def _format_of(name, format) -> str:
    """Return the format, in lower case without a dot, and check that it can be read."""
    given = format if format is not None else Path(name).suffix
    if not isinstance(given, str):
        raise SceneError(f"format must be text, one of {', '.join(_READERS)}; given {shown(given)}")
    wanted = given.lower().removeprefix(".")
    if wanted in _READERS:
        return wanted
    legal = ", ".join(_READERS)
    if wanted:
        raise ModelError(f"{name}: unknown format '{wanted}'; readable are {legal}")
    if format is None and os.path.isdir(name):
        raise ModelError(f"{name}: a folder, not a model")
    raise ModelError(f"{name}: the format is unknown without a suffix; give format=, one of {legal}")


# --- meshes -------------------------------------------------------------------------------------------------


def _make_meshes(model, contents, crease_angle, drop_bad_faces) -> list[Mesh]:
    """Check the parts of a file, and place them."""
    placed = [pair if isinstance(pair, tuple) else (pair, None) for pair in contents.parts]
    if not placed:
        raise model.error("no faces")
    for part, _ in placed:
        if part["vertices"].shape[1:] != (3,) or part["faces"].shape[1:] != (3,):
            raise model.error(f"vertices of the shape {part['vertices'].shape}, (n, 3) is needed")
    _report(model, contents, [part for part, _ in placed], crease_angle)
    if len(placed) > 1:
        placed = [pair for pair in placed if _is_worth_drawing(*pair, drop_bad_faces)] or placed[:1]
    return [
        _place(model, _prepare(model, part, crease_angle), matrix, crease_angle, drop_bad_faces)
        for part, matrix in placed
    ]


def _prepare(model, part, crease_angle) -> Part:
    """Join copied vertices if normals are to be averaged across them; mend the file's own normals."""
    is_split = model.format in _SPLIT_FORMATS or (model.format == "ply" and "uv" in part)
    if is_split and (crease_angle is not None or "normals" not in part):
        part = weld(part)
    return _mend_normals(model, _without_useless_textures(model, part))


def _without_useless_textures(model, part: Part) -> Part:
    """Take the textures off the materials of a part that has no texture coordinates."""
    useless = [material.name for material in materials_of(part) if material.texture is not None]
    if "uv" in part or not useless:
        return part
    names = ", ".join(f"'{name}'" for name in useless)
    what = f"{model.name}: mesh '{part['name']}' has no texture coordinates"
    warnings.warn(f"{what}; it is drawn without the texture of its material {names}", stacklevel=2)
    if "materials" in part:
        return {**part, "materials": tuple(replace(material, texture=None) for material in part["materials"])}
    return {**part, "material": replace(part["material"], texture=None)}


def _place(model, part, matrix, crease_angle, drop_bad_faces) -> Mesh:
    """Make the mesh of a part, and move it to where its node is."""
    label = f"mesh '{part['name']}': " if part["name"] else ""
    try:
        # The reader's own arrays, which nobody else has: the mesh needs no copies.
        part = {key: fixed(value) if isinstance(value, np.ndarray) else value for key, value in part.items()}
        mesh = Mesh(**part, crease_angle=crease_angle, drop_bad_faces=drop_bad_faces)
    except ModelError as fault:
        raise model.error(f"{label}{fault}") from fault
    if matrix is None or np.array_equal(matrix, np.eye(4)):
        return mesh
    try:
        return mesh.transformed(matrix)
    except (ModelError, SceneError) as fault:
        raise model.error(f"{label}the transform of its node: {fault}") from fault


def _is_worth_drawing(part: Part, _matrix, drop_bad_faces) -> bool:
    """Tell whether one part of several is kept: it has a face with an area, or a fault that must be seen."""
    faces, n_vertex = part["faces"], len(part["vertices"])
    if faces.min() < 0 or faces.max() >= n_vertex:
        return True
    return has_any_area(part["vertices"], faces) or not (drop_bad_faces or np.isfinite(part["vertices"]).all())


def _mend_normals(model, part: Part) -> Part:
    """Give corners whose normal is zero or not finite the normal of their triangle."""
    normals = part.get("normals")
    if normals is None or part["faces"].max() >= len(part["vertices"]) or part["faces"].min() < 0:
        return part
    with np.errstate(all="ignore"):
        length = np.linalg.norm(normals, axis=-1)
        is_bad = ~((length > 0.0) & np.isfinite(length))
        if not is_bad.any():
            return part
        corners = part["vertices"][part["faces"]]
        of_face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        of_face = np.nan_to_num(of_face / np.linalg.norm(of_face, axis=1, keepdims=True))
    model.log(f"{model.name}: {int(is_bad.sum())} file normals are zero or not finite; the triangles' own are used")
    if normals.ndim == 2:
        normals, is_bad = normals[part["faces"]], is_bad[part["faces"]]
    return {**part, "normals": np.where(is_bad[..., None], of_face[:, None], normals)}


def _report(model, contents, parts, crease_angle):
    """Say in one line what the file had and what is used of it."""
    n_face = sum(len(part["faces"]) for part in parts)
    materials = [material for part in parts for material in materials_of(part)]
    n_material = len({material.name for material in materials} - {""})
    n_texture = len({id(material.texture) for material in materials} - {id(None)})
    n_light = len(contents.lights or ())
    facts = [f"{n_face} faces"]
    facts += [f"{len(parts)} meshes"] if len(parts) > 1 else []
    facts += [f"{n_material} material" + "s" * (n_material > 1)] if n_material else []
    facts += [f"{n_texture} texture" + "s" * (n_texture > 1)] if n_texture else []
    facts += [f"{n_light} light" + "s" * (n_light > 1)] if n_light else []
    facts += ["a camera"] if contents.camera is not None else []
    has = {key for part in parts for key in part}
    facts += ["polygons with more than 3 corners"] if "polygons" in has else []
    facts += ["vertex colours"] if "colors" in has else []
    facts += ["face colours"] if "face_colors" in has else []
    verdict = "used" if crease_angle is None else f"not used: crease angle {crease_angle} asked for"
    if "normals" in has:
        facts.append(f"file normals {verdict}")
    elif "smoothing" in has:
        facts.append(f"smoothing groups {verdict}")
    else:
        facts.append("no file normals")
    model.log(f"{model.name}: {', '.join(facts)}")


def _take_meshes(source, crease_angle, drop_bad_faces):
    """Take meshes from something that is not a file."""
    if hasattr(source, "geometry") and hasattr(source, "graph"):
        return _take_trimesh_scene(source, crease_angle, drop_bad_faces)
    is_pair = isinstance(source, (tuple, list)) and len(source) == 2
    if is_pair and drop_bad_faces:
        return [Mesh(*source, crease_angle=crease_angle, drop_bad_faces=True)]
    mesh = Mesh.from_any(source)
    return [mesh if crease_angle is None else replace(mesh, crease_angle=crease_angle)]


def _take_trimesh_scene(scene, crease_angle, drop_bad_faces) -> list[Mesh]:
    """Place every mesh of a trimesh scene once for each node that shows it."""
    meshes = []
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        if len(getattr(geometry, "faces", ())):
            mesh = replace(Mesh.from_any(geometry), crease_angle=crease_angle, drop_bad_faces=drop_bad_faces)
            meshes.append(mesh.transformed(matrix))
    if not meshes:
        raise ModelError("the trimesh scene has no faces")
    return meshes


_READERS = {
    "obj": read_obj,
    "stl": read_stl,
    "ply": read_ply,
    "off": read_off,
    "glb": read_gltf,
    "gltf": read_gltf,
    "3mf": read_3mf,
}
