"""Load whatever is, or holds, a model into a scene.

In: a path, bytes, an open file, or a mesh. Out: a Scene. Which files may be read is said in `files.py`.

source ─┬─ scene file (scene_file.py), which may name models ─┬─ Scene
        ├─ model file (loader.py) ────────────────────────────┤
        └─ mesh, arrays, trimesh objects ─────────────────────┘
"""

import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..choices import Axis, Weighting
from ..errors import ModelError, SceneError, counted, one_file, shown, warn_caller
from ..keywords import checked_keywords
from ..scene.arrays import fixed
from ..scene.camera import Camera
from ..scene.color import ColorLike
from ..scene.lights import Light
from ..scene.mesh import Mesh
from ..scene.mesh_arrays import has_any_area
from ..scene.scene import DepthCue, Scene, SceneLike, is_one_mesh
from ..scene.validate import number
from . import formats
from .files import Folder, read_named
from .model_file import Contents, MeshSettings, ModelFile, Part, Report, materials_of
from .weld import weld

FileLike: TypeAlias = str | os.PathLike[str] | bytes | bytearray | memoryview | IO[Any]  # a file, or what is in one


@checked_keywords
def load(
    source: SceneLike | FileLike,
    *,
    format: str | None = None,
    crease_angle: float | None = None,
    up: Axis | None = None,
    lights: Light | Iterable[Any] | None = None,
    camera: Camera | None = None,
    background: ColorLike | None = None,
    depth_cue: DepthCue | float | None = None,
    weighting: Weighting | None = None,
    drop_bad_faces: bool = False,
    log: Callable[[str], object] | None = None,
    allow_outside: bool = False,
    files_read: list[str] | None = None,
) -> Scene:
    """Load a model into a scene: its meshes, with studio lights and a framed camera unless others are given, here or in
    the file.

    Parameters
    ----------
    source : path (str or PathLike), bytes, file object, trimesh.Trimesh or trimesh.Scene, Mesh, pair
        (vertices, faces), sequence of those three, or Scene
    format : text, "obj", "stl", "ply", "glb", "gltf", "off", "3mf", "dae", "zae", "3dxml" or "xaml", or "json" or
        "toml" for a scene file, or another of the table of formats; None = by the suffix of the path or the file's name
    crease_angle : degrees within 0..180; an edge between faces that meet at more stays sharp. None = the
        normals of the file if it has any, else its smoothing groups, else 30
    up : text, up axis "x", "y", "z" or with a minus sign; None = z for STL and 3MF, that of a COLLADA or scene
        file, y for the others
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
    if log is not None and not callable(log):
        raise SceneError(f"log must be a function of one text, or None; given {shown(log)}")
    settings = {"lights": lights, "camera": camera, "background": background, "depth_cue": depth_cue, "up": up}
    settings = {key: value for key, value in settings.items() if value is not None}
    mesh_settings = MeshSettings(crease_angle, weighting, drop_bad_faces)
    if isinstance(source, Scene):
        return with_changes(source, settings, crease_angle=crease_angle, weighting=weighting)
    if not _is_file(source):
        scene = Scene(_take_meshes(source, crease_angle, drop_bad_faces), **settings)
        return with_changes(scene, {}, weighting=weighting)
    name = name_of(source)
    if format is None and isinstance(source, (str, os.PathLike)) and not (Path(name).suffix or os.path.exists(name)):
        raise ModelError(f"{name}: no such file")
    entry = formats.format_of(name, format)
    if entry.is_scene:
        with one_file(name):
            read = entry.read()(
                source,
                log=log,
                format=format,
                mesh_settings=mesh_settings,
                allow_outside=allow_outside,
                files_read=files_read,
            )
            return with_changes(read.framed_scene(), settings)
    files = None
    if isinstance(source, (str, os.PathLike)):
        files = Folder(Path(name).parent, None, allow_outside, files_read)
    return load_model(source, mesh_settings, format=format, log=log, files=files, settings=settings)


def _is_file(source) -> bool:
    """Tell whether the source is a file: its path, its bytes, or an open one."""
    return isinstance(source, (str, os.PathLike, bytes, bytearray, memoryview)) or hasattr(source, "read")


def _take_meshes(source, crease_angle, drop_bad_faces):
    """Take meshes from something that is not a file."""
    is_sequence = isinstance(source, Iterable) and not (hasattr(source, "ndim") or isinstance(source, (dict, Mesh)))
    if is_sequence and not is_one_mesh(source) and not _is_trimesh_scene(source):
        meshes = [mesh for each in source for mesh in _take_one(each, crease_angle, drop_bad_faces)]
        if not meshes:
            raise ModelError("a model needs at least one mesh; given an empty sequence")
        return meshes
    return _take_one(source, crease_angle, drop_bad_faces)


def _is_trimesh_scene(source) -> bool:
    return hasattr(source, "geometry") and hasattr(source, "graph")


def _take_one(source, crease_angle, drop_bad_faces) -> list[Mesh]:
    """Take the mesh, or the meshes of a trimesh scene."""
    if _is_trimesh_scene(source):
        return _take_trimesh_scene(source, crease_angle, drop_bad_faces)
    if isinstance(source, (tuple, list)) and len(source) == 2 and drop_bad_faces:
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


# ----------------------------------------------------------------
# Whatever a caller has becomes a scene that is looked at as the caller says: what `render` does before it draws.

AZIMUTH, ELEVATION = 35.0, 25.0  # degrees; those of `Camera.framing`, a test holds that


def scene_of(source: SceneLike | FileLike, **settings: Any) -> Scene:
    """Return whatever `load` takes as a scene.

    Parameters
    ----------
    source : Scene, or anything else that `load` takes
    settings : arguments of `load`; None = as the source has it

    Returns
    -------
    Scene, the one given where nothing changes

    Raises
    ------
    ModelError, SceneError : as `load`
    """
    settings = {name: value for name, value in settings.items() if value is not None}
    return source if isinstance(source, Scene) and not settings else load(source, **settings)


def framed_from(
    scene: Scene,
    size: tuple[int, int],
    azimuth: float | None = None,
    elevation: float | None = None,
    subject: Scene | NDArray[np.float64] | None = None,
) -> Camera:
    """Return the camera that frames a scene from a side, for a picture of a size (width, height); `subject` may be
    points (n, 3) that are framed in its place.

    Raises
    ------
    SceneError : angles that are not legal

    Angles are those of `Camera.framing`, and have its defaults where one is None.
    """
    azimuth = AZIMUTH if azimuth is None else number(azimuth, "the azimuth")
    elevation = ELEVATION if elevation is None else number(elevation, "the elevation")
    subject, aspect = scene if subject is None else subject, size[0] / size[1]
    if subject is scene and (azimuth, elevation) == (AZIMUTH, ELEVATION):
        return scene.framed(aspect)  # which is kept
    return Camera.framing(subject, azimuth, elevation, aspect=aspect, up=scene.up)


def check_one_view(camera: Camera | None, **angles: float | None) -> None:
    """Refuse a camera beside angles, which ask for another one; SceneError names them."""
    given = [name for name, value in angles.items() if value is not None]
    if camera is not None and given:
        raise SceneError(f"a picture has a camera, or a side that it is framed from; given camera, {', '.join(given)}")


# ----------------------------------------------------------------
# Model files: the bytes of a file to the meshes of a scene.
#
#     source ─ ModelFile ─ reader of the format ─ parts ─ Mesh ─ Scene
#     path     name        by the table of        plain   checked
#     bytes    bytes       formats.py             arrays


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
        own = {"up": contents.up or entry.up, "lights": contents.lights, "camera": contents.camera}
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
        if entry.missing:
            packages = ", ".join(entry.missing)
            raise model.error(f"{entry.name} files are read by packages that are missing, {packages}: {formats.EXTRA}")
        contents = entry.read()(model)
        contents = contents if isinstance(contents, Contents) else Contents(contents)
        if not contents.parts:
            raise model.error(_why_no_faces(contents))
    except ModelError as fault:
        hint = formats.hint_for_content(model.data, entry.name)
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
