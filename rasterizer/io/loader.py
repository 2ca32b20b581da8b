"""Load whatever is, or holds, a model into a scene.

In: a path, bytes, an open file, or a mesh. Out: a Scene. Which files may be read is said in `files.py`.

source ─┬─ scene file (scene_file.py), which may name models ─┬─ Scene
        ├─ model file (models.py) ────────────────────────────┤
        └─ mesh, arrays, trimesh objects ─────────────────────┘
"""

import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, TypeAlias

from ..choices import Axis, Weighting
from ..errors import ModelError, SceneError, one_file, shown
from ..keywords import checked_keywords
from ..scene.camera import Camera
from ..scene.color import ColorLike
from ..scene.depth_cue import DepthCue
from ..scene.lights import Light
from ..scene.mesh import Mesh
from ..scene.scene import Scene, SceneLike, is_one_mesh
from . import formats
from .files import Folder
from .model_file import MeshSettings
from .models import load_model, name_of, with_changes

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
    format : text, "obj", "stl", "ply", "off", "glb", "gltf" or "3mf", or "json" or "toml" for a scene file, or another
        of the table of formats; None = by the suffix of the path or the file's name
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
