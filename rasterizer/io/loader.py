"""Load whatever is, or holds, a model into a scene.

In: a path, bytes, an open file, or a mesh. Out: a Scene. Which files may be read is said in `files.py`.

source ─┬─ scene file (scene_file.py), which may name models ─┬─ Scene
        ├─ model file (loader.py) ────────────────────────────┤
        └─ mesh, arrays, trimesh objects ─────────────────────┘
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..choices import Axis, Weighting
from ..errors import ModelError, SceneError, counted, cut, install_command, one_file, shown
from ..geometry.weld import weld
from ..keywords import checked_keywords
from ..scene.arrays import fixed
from ..scene.camera import Camera, aimed
from ..scene.color import ColorLike
from ..scene.foreign import is_foreign, lights_and_camera
from ..scene.framing import guess_up
from ..scene.lights import Light
from ..scene.mesh import Mesh, is_one_mesh, meshes_from
from ..scene.mesh_arrays import has_any_area
from ..scene.scalars import NO_SCALARS, Colormap, ScalarWords
from ..scene.scene import DepthCue, Scene, SceneLike
from ..scene.triangulation import listed
from ..scene.validate import COORDINATE_LIMIT, flag, picture_size, store
from . import formats
from .files import Folder, name_of, opened_source
from .model_file import (
    SCALED_AWAY,
    Contents,
    MeshSettings,
    ModelFile,
    Part,
    Report,
    bytes_of_copy,
    materials_of,
    mend_unused,
    name_in,
    within_1,
    without_none,
)

if TYPE_CHECKING:
    from ..appearance import Appearance
    from ..viewpoint import Viewpoint

FileLike: TypeAlias = str | os.PathLike[str] | bytes | bytearray | memoryview | IO[Any]  # a file, or what is in one


class SceneFile(NamedTuple):
    """What a scene file holds, or the scene alone of anything else.

    Parameters
    ----------
    scene : Scene; without a camera where the file asks for framing
    options : dict of options of a picture by name, not checked; once they are, Options
    framing : Viewpoint, or None where the file has a camera or none at all
    appearance : Appearance, what the file says of how its scene is changed, or None; `scene` isn't changed yet
    """

    scene: Scene
    options: Any = {}
    framing: Viewpoint | None = None
    appearance: Appearance | None = None

    def finished_scene(self) -> Scene:
        """Return the scene as the file says that it looks, with a camera where it asks for framing: for a picture of
        the file's size, else of 4:3."""
        scene = self.scene if self.appearance is None else self.appearance.change(self.scene)
        if self.framing is None:
            return scene
        size = self.options.get("size", (4, 3))
        size = picture_size(size if isinstance(size, tuple) else (size, size))
        return replace(scene, camera=self.framing.camera_of(scene, size))


@checked_keywords
def load(
    source: SceneLike | FileLike,
    *,
    format: str | None = None,
    crease_angle: float | None = None,
    up: Axis | Literal["auto"] | None = None,
    lights: Light | Iterable[Any] | None = None,
    camera: Camera | Literal["file"] | None = None,
    background: ColorLike | None = None,
    depth_cue: DepthCue | float | None = None,
    weighting: Weighting | None = None,
    drop_bad_faces: bool = False,
    scalars: ArrayLike | str | None = None,
    cmap: Colormap | None = None,
    clim: Sequence[float] | None = None,
    log: Callable[[str], object] | None = None,
    allow_outside: bool = False,
    files_read: list[str] | None = None,
) -> Scene:
    """Load a model into a scene: its meshes, with studio lights and a framed camera unless others are given, here or in
    the file.

    Parameters
    ----------
    source : path (str or PathLike), bytes, file object, Mesh, pair (vertices, faces), mesh or scene of trimesh,
        PyVista, VTK, Open3D or meshio (see `scene/foreign.py`), sequence of those, or Scene
    format : text, "obj", "stl", "ply", "glb", "gltf", "off", "3mf", "dae", "zae", "3dxml" or "xaml", or "json" for a
        scene file, or another of the table of formats; None = by the suffix of the path or the file's name
    crease_angle : degrees within 0..180; an edge between faces that meet at more stays sharp. None = the
        normals of the file if it has any, else its smoothing groups, else 30
    up : text, up axis "x", "y", "z" or with a minus sign; None = z for STL and 3MF, that of a COLLADA or scene
        file, y for the others; "auto" = that, unless the format doesn't say it and the shape stands on a flat underside
    lights : sequence of lights; None = those of the file (GLB, glTF and scene files may have some), else studio lights
    camera : Camera; "file" = the first that a model file, or a scene of trimesh, brings; None = that of a scene file,
        else framed when the picture is made: cameras of model files are those of their authors' pictures, and see any
        part of the model
    background : colour; None = that of a scene file, else transparent
    depth_cue : DepthCue, or a number, its scale; None = that of a scene file, else nothing fades with depth
    weighting : text, "angle", "area" or "uniform": the weight of faces where normals are averaged, see `Mesh`; None =
        "angle", or as a scene file says
    drop_bad_faces : bool, leave out faces whose coordinates are NaN or infinite, instead of raising an error
    scalars : a scalar field that is shown in the place of the model's own colours: one number for each vertex or face,
        (n,), or the name of one that the model has: a property of a PLY file, an attribute of glTF, an array of
        PyVista, VTK, meshio, trimesh or Open3D. Of PyVista and VTK the active scalars are shown without being asked
        for. Faces with a corner that has no finite value are grey
    cmap : text or (n, 3), colormap: "viridis" (the default), another name that the package `cmap` knows, or colours
        from low to high, uint8 or floats of sRGB
    clim : two numbers, the values at the colormap's ends; None = the least and the largest there are
    log : function of one text, called with facts about the file; None = none
    allow_outside : bool, read also files outside the folder of the file that names them: textures, buffers, parts of a
        scene
    files_read : list that gets the paths (text) of all other files that were read, each as often as it was;
        None = none

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
    return read_source(**locals()).finished_scene()


def read_source(
    source: SceneLike | FileLike | SceneFile, *, up: Axis | Literal["auto"] | None = None, **words: Any
) -> SceneFile:
    """Read what `load` does, without changing and framing it as a scene file says: that is done when all options of a
    picture are known.

    Parameters
    ----------
    source : as `load` takes it; a SceneFile is returned as it is
    up, words : the other arguments of `load`

    Returns and raises what `load` does, but a SceneFile.
    """
    if isinstance(source, SceneFile):
        return source
    is_auto = isinstance(up, str) and up == "auto"
    read = _read(source, **words | ({} if up is None or is_auto else {"up": up}))
    doubt = doubt_of_up(read.scene, source, words.get("format")) if is_auto else None
    return read if doubt is None else read._replace(scene=replace(read.scene, up=doubt[0]))


def _read(
    source: SceneLike | FileLike,
    *,
    crease_angle: float | None = None,
    weighting: str | None = None,
    drop_bad_faces: bool = False,
    scalars: Any = None,
    cmap: Any = None,
    clim: Any = None,
    camera: Camera | Literal["file"] | None = None,
    format: str | None = None,
    log: Callable[[str], object] | None = None,
    allow_outside: bool = False,
    files_read: list[str] | None = None,
    **settings: Any,
) -> SceneFile:
    """Read what `read_source` does, but for an upward axis that the shape tells."""
    words = scalars, cmap, clim
    scalar_words = NO_SCALARS if all(word is None for word in words) else ScalarWords(*words)
    mesh_settings = MeshSettings(crease_angle, weighting, drop_bad_faces, scalar_words)
    if log is not None and not callable(log):
        raise SceneError(f"log must be a function of one text, or None; given {shown(log)}")
    flag(drop_bad_faces, "drop_bad_faces")
    flag(allow_outside, "allow_outside")
    is_own_camera = isinstance(camera, str) and camera == "file"
    camera = None if is_own_camera else camera
    settings = without_none(settings | {"camera": camera})
    if isinstance(source, Scene):
        changes = mesh_settings.arguments()
        if changes or scalars is not None:
            settings["meshes"] = meshes_from(source.meshes, changes, scalar_words)
        return SceneFile(replace(source, **settings) if settings else source)
    if not _is_file(source):
        lights, camera = lights_and_camera(source)
        own = {"lights": lights, "camera": camera if is_own_camera else None, "up": _up_of(source)}
        meshes = meshes_from(source, mesh_settings.arguments(), scalar_words)
        return SceneFile(Scene(meshes, **without_none(own) | settings))
    name = name_of(source)
    if format is None and isinstance(source, (str, os.PathLike)) and not (Path(name).suffix or os.path.exists(name)):
        raise ModelError(f"{name}: no such file")
    entry = formats.format_of(name, format)
    if not entry.is_scene:
        has_folder = os.path.exists(name_of(source, ""))
        files = Folder(Path(name).parent if has_folder else None, None, allow_outside, files_read)
        if not is_own_camera:
            settings = {"camera": None} | settings
        return SceneFile(load_model(source, mesh_settings, files, format=format, log=log, settings=settings))
    with one_file(name):
        read = entry.read()(
            source,
            log=log,
            mesh_settings=mesh_settings,
            allow_outside=allow_outside,
            files_read=files_read,
        )
        if settings:
            read = read._replace(scene=replace(read.scene, **settings))
        if "lights" in settings and read.appearance is not None:
            read = read._replace(appearance=replace(read.appearance, lights=None, preset=None))
        return read if camera is None else read._replace(framing=None)


def _is_file(source) -> bool:
    """Tell a file, or what is in one, from a mesh, of which one of meshio has a function `read`, too."""
    is_named = isinstance(source, (str, os.PathLike, bytes, bytearray, memoryview))
    return is_named or (hasattr(source, "read") and not is_one_mesh(source))


_UNTOLD_UP = ("obj", "stl", "ply", "off")  # formats that don't say which axis points upwards
_MAX_LOOKED_AT = 50_000  # faces, when that is guessed: more make no other share of the area


def doubt_of_up(scene: Scene, source: Any, format: str | None = None) -> tuple[str, str] | None:
    """Return the axis that the shape of a model says points upwards, where that is another than the scene's, and a text
    about it; None where it isn't, and where the source states its axis: a scene, arrays and most formats.

    Parameters
    ----------
    scene : what was loaded
    source, format : as `load` got them
    """
    if _is_file(source):
        entry = formats.find(format or Path(name_of(source)).suffix)
        if entry is None or entry.name not in _UNTOLD_UP:
            return None
    elif not is_foreign(source):
        return None
    step, points, faces, n_point = scene.n_face // _MAX_LOOKED_AT + 1, [], [], 0
    for mesh in scene.meshes:
        faces.append(mesh.faces[::step] + np.int64(n_point))
        points.append(mesh.vertices)
        n_point += len(mesh.vertices)
    vertices = points[0] if len(points) == 1 else np.concatenate(points)
    up, reason = guess_up(vertices, np.concatenate(faces), scene.bounds)
    return None if up in (None, scene.up) else (up, f"drawn with {scene.up} upwards; by its shape {up} is up: {reason}")


def _up_of(source) -> Axis | None:
    """Return the up axis of the file that an object of trimesh was loaded from; None where none is known."""
    entry = formats.FORMATS.get(getattr(getattr(source, "_source", None), "file_type", None))
    return None if entry is None else entry.up


# Written by models/make_models.py: several objects and materials, one of them glass.
_DEMO = Path(__file__).parent.parent / "demo" / "still_life.obj"


def demo_model() -> Path:
    """Return the path of the model that comes with the package: a still life of seven objects, 5198 triangles.

        import rasterizer as rz
        frame = rz.render(rz.demo_model(), (640, 400), shading="phong")

    Returns
    -------
    Path of an OBJ file, beside which its materials stand; it is part of the package, so only read it
    """
    return _DEMO


# ----------------------------------------------------------------
# Model files: the bytes of a file to the meshes of a scene.
#
#     source ─ ModelFile ─ reader of the format ─ parts ─ Mesh ─ Scene
#     path     name        by the table of        plain   checked
#     bytes    bytes       formats.py             arrays


def load_model(
    source,
    mesh_settings: MeshSettings,
    files: Folder,
    *,
    format: str | None = None,
    log: Callable[[str], object] | None = None,
    settings: dict | None = None,
) -> Scene:
    """Load a model file, no scene file.

    Parameters
    ----------
    source, format, log : as `load` takes them
    mesh_settings : how its meshes are made
    files : which other files it may name
    settings : arguments of Scene

    Returns and raises what `load` does.
    """
    name = name_of(source)
    with one_file(name), np.errstate(all="ignore"):  # numbers that aren't finite are refused, or reported
        entry = formats.format_of(name, format, is_scene=False)
        with opened_source(source, name, entry.name if entry.is_binary else "", entry.in_parts) as data:
            if not data[: formats.HEAD].strip() and not data[:].strip():
                raise ModelError(f"{name}: the file is empty")
            model = ModelFile(name, entry.name, data, files, log)
            contents = _contents_of(entry, model)
        own = {"up": contents.up or entry.up, "lights": contents.lights, "camera": contents.camera}
        settings = without_none(own) | (settings or {})
        scene = Scene(_make_meshes(model, contents, mesh_settings), **settings)
        if contents.camera is not None and scene.camera is contents.camera:
            return replace(scene, camera=aimed(contents.camera, scene.bounds))
        return scene


def _contents_of(entry, model) -> Contents:
    """Let the reader of a format read a file; where it finds nothing, the error says what the file looks like."""
    try:
        if entry.missing:
            packages = ", ".join(entry.missing)
            reason = f"are read by packages that are missing, {packages}: {install_command('formats')}"
            raise model.error(f"{entry.name} files {reason}")
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


# --- meshes -----------------------------------------------------------------------------------------------------------


def _make_meshes(model, contents, settings) -> list[Mesh]:
    """Make the meshes of the parts of a file, each once, and move them to where their nodes are."""
    placed, parts = [], {}
    for pair in contents.parts:
        part, matrix = pair if isinstance(pair, tuple) else (pair, None)
        if part["vertices"].shape[1:] != (3,) or part["faces"].shape[1:] != (3,):
            raise model.error(f"vertices of the shape {part['vertices'].shape}, (n, 3) is needed")
        part["name"] = name_in(part["name"])
        placed.append((part, matrix))
        if id(part) not in parts:
            parts[id(part)] = part
            _mend(model, part)
    if settings.scalars.scalars is not None or any("fields" in part for part in parts.values()):
        try:
            settings.scalars.lay(parts.values())
        except ModelError as fault:
            raise model.error(fault) from fault
    if model.textures.n_halving:
        model.textures.warn()
    for part in parts.values() if model.textures.n_halving else ():
        many = "materials" in part
        fitted = tuple(model.textures.fit_material(material) for material in materials_of(part))
        part.update({"materials": fitted} if many else {"material": fitted[0]})
    unused = _list_unused(contents, parts.values())
    if unused:
        model.warn(f"not used: {listed(unused)}")
    if model.log is not None:
        _report(model, contents, [part for part, _ in placed], settings.crease_angle, unused)
    if len(placed) > 1:
        drawn = {key for key, part in parts.items() if _is_worth_drawing(part, settings.drop_bad_faces)}
        placed = [pair for pair in placed if id(pair[0]) in drawn] or placed[:1]
    if model.format != "obj":  # MTL warns of each such material
        if not any(material.is_visible for part, _ in placed for material in materials_of(part)):
            model.warn("all its materials are invisible: their opacity is 0, or below the cutoff")
    made, meshes, unmoved = {}, [], np.eye(4)
    for part, matrix in placed:
        if id(part) not in made:
            made[id(part)] = _make_mesh(model, part, settings)
        mesh = made[id(part)]
        if matrix is not None and not np.array_equal(matrix, unmoved):
            model.limits.count_bytes(bytes_of_copy(mesh))
            try:
                mesh = mesh.transformed(matrix)
            except (ModelError, SceneError) as fault:
                if _is_flat(mesh, matrix):
                    model.mend(*SCALED_AWAY)
                    continue
                raise model.error(f"{_label(part)}the transform of its node: {fault}") from fault
        meshes.append(mesh)
    if not meshes:
        raise model.error("nothing to draw: all its nodes have the scale 0")
    if model.limits.mended:
        model.warn_of_mended()
    return meshes


def _is_flat(mesh, matrix) -> bool:
    """Tell whether a matrix is legal, and leaves no face of a mesh an area."""
    with np.errstate(all="ignore"):
        vertices = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    return bool((np.abs(vertices) <= COORDINATE_LIMIT).all()) and not has_any_area(vertices, mesh.faces)


def _label(part: Part) -> str:
    """Return what begins a message about a part."""
    return f"mesh '{cut(part['name'], 80)}': " if part["name"] else ""


def _why_no_faces(contents) -> str:
    """Say what a file without faces has in their place."""
    if contents.n_line:
        return f"nothing but lines: {counted(contents.n_line, 'line')}, no faces"
    if contents.n_point:
        return f"a point cloud: {counted(contents.n_point, 'point')}, no faces"
    return f"no faces; not used: {', '.join(contents.left_out)}" if contents.left_out else "no faces"


def _make_mesh(model, part, settings) -> Mesh:
    """Make the mesh of a part: copied vertices are joined if normals are to be averaged across them, and the file's own
    normals mended."""
    is_welded = settings.crease_angle is not None or "normals" not in part
    if is_welded and formats.FORMATS[model.format].repeats_vertices:
        part = weld(part)
    words = {}
    for key, value in _without_useless_textures(model, part).items():
        # The reader's own arrays, which nobody else has: the mesh needs no copies.
        words[key] = fixed(value) if isinstance(value, np.ndarray) else value
    try:
        mesh = Mesh(**words, **settings.arguments())
    except ModelError as fault:
        raise model.error(f"{_label(part)}{fault}") from fault
    store(mesh, is_welded=is_welded)
    return mesh


def _without_useless_textures(model, part: Part) -> Part:
    """Take the textures off the materials of a part that has no texture coordinates."""
    if "uv" in part:
        return part
    useless = [material.name for material in materials_of(part) if material.texture is not None]
    if not useless:
        return part
    names = listed([f"'{cut(name, 40)}'" for name in useless])
    what = f"mesh '{cut(part['name'], 80)}' has no texture coordinates"
    model.warn(f"{what}; it is drawn without the texture of its material {names}")
    if "materials" in part:
        return {**part, "materials": tuple(material.without_textures() for material in part["materials"])}
    return {**part, "material": part["material"].without_textures()}


def _is_worth_drawing(part: Part, drop_bad_faces) -> bool:
    """Tell whether one part of several is kept: it has a face with an area, or a fault that must be seen."""
    faces, n_vertex = part["faces"], len(part["vertices"])
    if faces.min() < 0 or faces.max() >= n_vertex:
        return True
    return has_any_area(part["vertices"], faces) or not (drop_bad_faces or np.isfinite(part["vertices"]).all())


def _mend(model, part: Part) -> None:
    """Mend the arrays of a part where that changes nothing that was meant: of every format alike, see `ModelFile.mend`.

    Vertices that no face uses may be anywhere; texture coordinates that aren't finite become 0, colours are brought
    into their range. Normals that are zero or not finite become zero, which is reported: a mesh computes those from its
    faces.
    """
    vertices, faces = part["vertices"], part["faces"]
    if faces.max() >= len(vertices) or faces.min() < 0:
        return  # Mesh refuses it
    part["vertices"] = mend_unused(model, vertices, faces)
    if "uv" in part and not (is_fine := np.isfinite(part["uv"])).all():
        model.mend("texture coordinate", "not finite: taken as 0", (~is_fine.all(axis=-1)).sum())
        part["uv"] = np.where(is_fine, part["uv"], 0.0)
    for key in ("colors", "face_colors"):
        if key in part and part[key].dtype.kind == "f":
            part[key] = within_1(model, part[key])
    if "normals" not in part:
        return
    with np.errstate(all="ignore"):
        length = np.linalg.norm(part["normals"], axis=-1)
        is_bad = ~((length > 0.0) & np.isfinite(length))
    if is_bad.any():
        model.tell(f"{int(is_bad.sum())} file normals are zero or not finite; they are computed from the faces")
        part["normals"] = np.where(is_bad[..., None], 0.0, part["normals"])


def _list_unused(contents, parts) -> list[str]:
    """List what the file has that would be seen if it were used."""
    seen = [counted(contents.n_point, "point")] * bool(contents.n_point)
    seen += [counted(contents.n_line, "line")] * bool(contents.n_line)
    for what in contents.left_out:
        seen.append(cut(what, 80))
    for part in parts:
        for colors in (part.get("colors"), part.get("face_colors")):
            if colors is not None and colors.shape[-1] == 4:
                if colors[..., 3].min(initial=255) < _OPAQUE[colors.dtype.kind]:
                    return [*seen, "the alpha of vertex colours"]
    return seen


def _report(model, contents, parts, crease_angle, seen):
    """Say in one line what the file had, what is used of it, and what is not: `seen`, and what would not be seen."""
    has = {key for part in parts for key in part}
    facts = [counted(sum(len(part["faces"]) for part in parts), "face"), *_counts(contents, parts)]
    facts += [what for key, what in _ATTRIBUTES.items() if key in has]
    left_out = [*seen]
    if "uv" in has and not any(material.needs_uv for part in parts for material in materials_of(part)):
        left_out.append("texture coordinates")
    left_out += contents.unused
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
_OPAQUE = {"u": 255, "f": 1.0}
_NORMALS = {"normals": "file normals", "smoothing": "smoothing groups"}


def _counts(contents, parts) -> list[str]:
    """Say how many meshes, materials, textures, lights and cameras there are, unless none, or one mesh."""
    materials = [material for part in parts for material in materials_of(part)]
    n_material = len({material.name for material in materials} - {""})
    n_texture = len({id(texture) for material in materials for texture in material.textures})
    counts = (n_material, "material"), (n_texture, "texture"), (len(contents.lights or ()), "light")
    facts = [counted(len(parts), "mesh")] if len(parts) > 1 else []
    facts += [counted(n, what) for n, what in counts if n]
    return facts + (["a camera"] if contents.camera is not None else [])
