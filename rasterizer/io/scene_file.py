"""A whole scene in one JSON file.

    file ─ tables, duplicate keys refused ─ meshes, materials, lights, camera ─ Scene

    meshes      list: {"file": "part.obj", "transform", "material", ...}, {"vertices", "faces", ...} or
                {"arrays": "x.npz", "mesh": 0, ...}
    materials   table of named materials that meshes refer to
    lights      "studio", "headlight", or a list of these and of {"kind": "point", "position", ...}
    camera      the fields of Camera, or the words of `Viewpoint`: {view, azimuth, elevation, fov, ortho, zoom, margin}
                to have the scene framed, {eye, target, fov, ortho, zoom}
    background  colour      up  axis      options  those of a picture, as `Options` names them
    depth_cue   a number, or {scale, start, color}
    preset shadows material color reflection crease_angle weighting subdivide drop_bad_faces scalars cmap clim
                of all meshes and lights: the words of `Appearance`, with the meanings that `render` and the command
                line give them. How a mesh says itself that it is read comes first

A table is the fields of a dataclass, which checks them itself; errors name the tables round a fault. Names of files
are relative to the folder of the scene file; which are read is said in `files.py`. `scene_file_write` writes what is
read here. Text may be MAX_JSON bytes long: the arrays of large meshes go into .npz files beside it. What else a file
asks for is bounded before it is spent: MAX_PIXELS of a picture, MAX_CUT_FACES of meshes that are subdivided, and the
limits of lights and of `Limits`.
"""

import json
import os
from collections.abc import Collection, Iterator
from dataclasses import MISSING, fields, replace
from difflib import get_close_matches
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ..appearance import TEXTURES, Appearance
from ..errors import ModelError, SceneError, cut, faults_of, named_in_errors, one_file, shown
from ..options import Options
from ..scene.camera import Camera
from ..scene.framing import rotation
from ..scene.lights import LIGHT_TYPES, MAX_LIGHTS, PRESETS, Shadow, class_of_light
from ..scene.material import NAMED_MATERIALS, Material
from ..scene.mesh import Mesh, meshes_from
from ..scene.scalars import ScalarWords, with_one_scale
from ..scene.scene import DepthCue, Scene
from ..scene.spectrum import Spectrum
from ..scene.texture import Budget, Texture, read_picture
from ..scene.validate import choice, flag, number, store, text, unit3, vector3, whole
from ..viewpoint import Viewpoint
from . import formats
from .array_files import read_npy
from .files import Folder, name_of, read_source, unpack
from .loader import SceneFile, load_model
from .model_file import Limits, MeshSettings, bytes_of_copy, most

MAX_JSON = 2**26  # bytes, whose tables take some 2 GB
MAX_PIXELS = 2**26  # of a picture: 8192 x 8192
MAX_CUT_FACES = 2**21  # of meshes that are subdivided, or one for each byte that was read
# The words of Appearance that are more than what a Scene has.
APPEARANCE = (
    "preset", "shadows", "material", "color", "reflection", "crease_angle", "weighting", "subdivide", "drop_bad_faces",
    "scalars", "cmap", "clim",
)  # fmt: skip
KEYS = ("meshes", "materials", "lights", "camera", "background", "depth_cue", "up", "options", *APPEARANCE)
# Of meshes, in the order of Mesh; all but the first two may be left out.
ARRAYS = ("vertices", "faces", "normals", "colors", "uv", "face_colors", "polygons", "smoothing", "face_material")
_FLOATS = ("vertices", "normals", "colors", "uv", "face_colors")  # of which whole numbers are as good as others
_OF_MESH = ("transform", "name", "crease_angle", "weighting", "drop_bad_faces", "scalars", "material", "materials")
_MADE_BY = ("crease_angle", "weighting", "drop_bad_faces")  # of these, what a mesh is made by
# Tables within a table of fields; those of all other fields are spectra.
_TABLES: dict[str, Any] = {"shadow": Shadow, "shadows": Shadow, "depth_cue": DepthCue}
# The words of Viewpoint but `camera`; the last as ortho.
_VIEWPOINT = (*(field.name for field in fields(Viewpoint) if field.name != "camera"), "orthographic")
_ELSEWHERE = dict.fromkeys(_VIEWPOINT, "camera") | {field.name: "options" for field in fields(Options)}


def read_scene(
    source: Any,
    folder: str | os.PathLike[str] | None = None,
    log: Any = None,
    *,
    mesh_settings: MeshSettings | None = None,
    allow_outside: bool = False,
    files_read: list[str] | None = None,
) -> SceneFile:
    """Read a scene file.

    Parameters
    ----------
    source : path, bytes, or file object
    folder : path to which the names of files are relative; None = that of the path, for bytes the current one
    log : function of one text, called with facts about the files; None = none
    mesh_settings : those of all meshes; where they are not None they are taken in place of the file's
    allow_outside : bool, read also files outside the folder; see `files.py`
    files_read : list that gets the paths of all files that are read

    Returns
    -------
    SceneFile

    Raises
    ------
    ModelError : a file that can't be read or is no JSON, duplicate keys, a mesh that is not legal
    SceneError : an unknown or missing key, or a value that is not legal; messages name file, table and field
    """
    name = name_of(source, "scene")
    files = Folder(Path(name).parent if folder is None else folder, None, allow_outside, files_read)
    reader = _Reader(name, files, log, mesh_settings or MeshSettings())
    with one_file(name):
        data = read_source(source, name)
        reader.limits.n_byte += len(data)
        with named_in_errors(name):
            return reader.read(_parse(data))


def read_camera_file(path: str | os.PathLike[str]) -> Camera | Viewpoint:
    """Read the camera of a scene file, or a file that holds a camera alone.

    Parameters
    ----------
    path : of a JSON file: a scene, of which only its camera is looked at, or a table of a camera's fields

    Returns
    -------
    Camera, or Viewpoint where it has the words of one

    Raises
    ------
    ModelError : a file that can't be read or is no JSON
    SceneError : no camera, or one that is not legal
    """
    name = name_of(path, "scene")
    with one_file(name):
        data = read_source(path, name)
        formats.format_of(name, None, is_scene=True)
        with named_in_errors(name):
            root = _table(_parse(data))
            if "meshes" in root and "camera" not in root:
                raise SceneError("the scene has no camera")
            return _read_camera(root.get("camera", root))


def _parse(data: bytes) -> Any:
    """Return what the text of a file holds."""
    if not data.strip():
        raise ModelError("the file is empty")
    if len(data) > MAX_JSON:
        raise ModelError(f"{len(data)} bytes; a scene file may have {MAX_JSON}: arrays go into .npz files")
    try:
        return json.loads(
            data.decode("utf-8-sig"), object_pairs_hook=_without_duplicates, parse_constant=_refuse_constant
        )
    except UnicodeDecodeError as fault:
        raise ModelError(f"is not UTF-8 text ({fault.reason} at byte {fault.start})") from fault
    except RecursionError as fault:
        raise ModelError("lists or tables are nested too deeply") from fault
    except ValueError as fault:  # also too many digits
        raise ModelError(f"is not legal JSON: {fault}") from fault


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Make a table, whose keys may be there once only; of two, json itself would drop one silently."""
    table = dict(pairs)
    if len(table) < len(pairs):
        seen: set[str] = set()
        twice = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        raise ValueError(f"duplicate key {shown(twice)}")
    return table


def _refuse_constant(word: str) -> None:
    raise ValueError(f"{word} is no number of JSON")


# --- tables to dataclasses ----------------------------------------------------------------------------------


def _table(value: Any, legal: Collection[str] | None = None, needed: Collection[str] = ()) -> dict[str, Any]:
    """Return a table whose keys are among the `legal` ones, None = any; SceneError for anything else."""
    if not isinstance(value, dict):
        raise SceneError(f"must be a table; given {shown(value)}")
    for key in value if legal is not None else ():
        if key not in legal:
            near = get_close_matches(key, legal, n=1)
            hint = f": did you mean {near[0]}?" if near else ""
            raise SceneError(f"unknown key {shown(key)}{hint}; legal are {', '.join(legal)}")
    for key in needed:
        if key not in value:
            raise SceneError(f"{key} is missing; needed are {', '.join(needed)}")
    return value


def _items(value: Any, name: str) -> Iterator[tuple[Any, Any]]:
    """Yield what a list holds, each with a context in which errors name its place."""
    if not isinstance(value, list):
        raise SceneError(f"{name} must be a list; given {shown(value)}")
    for k, item in enumerate(value):
        yield item, named_in_errors(f"{name}[{k}]")


def _make(cls: Any, value: Any) -> Any:
    """Make a dataclass of a table: its keys are the fields, which the class checks."""
    described = {field.name: field.default is MISSING and field.default_factory is MISSING for field in fields(cls)}
    table = _table(value, described, [name for name, is_needed in described.items() if is_needed])
    return cls(**{key: _field(key, item) for key, item in table.items()})


def _field(key: str, value: Any) -> Any:
    """Return a field as the classes take it: of a table what it stands for, else what is there."""
    if not isinstance(value, dict):
        return value
    with named_in_errors(key):
        if key in _TABLES:
            return _make(_TABLES[key], value)
        return Spectrum(**_table(value, ("wavelengths", "values"), ("wavelengths", "values")))


def _read_camera(value: Any) -> Camera | Viewpoint:
    """Read a camera, or words that say where the scene is seen from: which, its fields tell."""
    with named_in_errors("camera"):
        if isinstance(value, str):
            raise SceneError(f'must be a table, such as {{"view": "iso"}}; given {shown(value)}')
        of_camera = {field.name for field in fields(Camera)}.difference(_VIEWPOINT)
        if not of_camera.isdisjoint(_table(value)):
            return _make(Camera, value)
        words = dict(_table(value, _VIEWPOINT))
        if "orthographic" in words:
            words.setdefault("ortho", words.pop("orthographic"))
        return _make(Viewpoint, words | {"camera": "frame"})


def _read_lights(value: Any) -> tuple[Any, ...]:
    """Read the lights: a preset's name, or a list of these and of tables, whose `kind` chooses the class."""
    found: list[Any] = []
    if isinstance(value, list) and len(value) > MAX_LIGHTS:
        raise SceneError(f"lights may be up to {MAX_LIGHTS}; given {len(value)}")
    for item, place in _items([value] if isinstance(value, str) else value, "lights"):
        with place:
            if isinstance(item, str):
                found += PRESETS[choice(item, PRESETS, "a light that is no table")]()
                continue
            table = dict(_table(item))
            if "kind" not in table:
                raise SceneError(f"kind is missing; legal are {', '.join(LIGHT_TYPES)}")
            cls = class_of_light(table.pop("kind"))
            with faults_of(f"{cls.__module__}.{cls.__qualname__}"):
                found.append(_make(cls, table))
    return tuple(found)


def _read_options(value: Any) -> dict[str, Any]:
    """Read the options of a picture: those that a file gives, checked."""
    given = {key: item for key, item in _table(value).items() if item is not None}
    options = _make(Options, given)
    width, height = options.size
    if width * height > MAX_PIXELS:
        raise SceneError(f"size: a scene file may ask for up to {MAX_PIXELS} pixels; given {width} x {height}")
    return {key: getattr(options, key) for key in given}


# --- the scene ----------------------------------------------------------------------------------------------


class _Reader:
    """Read the tables of one scene file, and hold what they share.

    Parameters
    ----------
    name : text, that of the scene file
    files : Folder to which names of files are relative
    log : function of one text
    asked : as `read_scene` takes them
    """

    def __init__(self, name: str, files: Folder, log: Any, asked: MeshSettings):
        self.files, self.log, self.asked = files, log, asked
        self.limits, self.budget = Limits(0), Budget(name)
        self.own = MeshSettings()  # of the file, for meshes that say nothing themselves
        self.scalars: dict[str, Any] = {}  # those of its words that are about scalar fields
        self.materials: dict[str, Material] = {}  # by the names of the file's table
        self._models: dict[Any, Scene] = {}  # by path and settings
        self._arrays: dict[Path, dict[str, np.ndarray]] = {}
        self._textures: dict[Any, Texture] = {}

    def read(self, root: Any) -> SceneFile:
        """Read the whole file."""
        for key in _table(root):
            if key not in KEYS and key in _ELSEWHERE:
                raise SceneError(f"unknown key {key}: {_ELSEWHERE[key]} has it")
        top = _table(root, KEYS, ("meshes",))
        for key, value in _named(top, "materials"):
            with named_in_errors(f"materials.{cut(key, 80)}"):
                self.materials[key] = self._material(value, key)
        words = {key: self._word(key, top[key]) for key in APPEARANCE if top.get(key) is not None}
        lights = {"lights": _read_lights(top["lights"])} if "lights" in top else {}
        appearance = Appearance(**words, **lights if "preset" in words else {}) if words else None
        self.own = MeshSettings(*map(words.get, ("crease_angle", "weighting", "drop_bad_faces")))
        self.scalars = {key: words[key] for key in ("scalars", "cmap", "clim") if key in words}
        meshes, up = self._meshes(top["meshes"])
        if self.scalars.get("clim") is self.asked.scalars.clim is None:
            meshes = with_one_scale(meshes)
        self._check_faces(sum(mesh.n_face for mesh in meshes), words.get("subdivide", 0))
        settings: dict[str, Any] = {"up": top.get("up", up)} | ({} if "preset" in words else lights)
        if top.get("background") != "transparent":
            settings["background"] = _field("background", top.get("background"))
        if top.get("depth_cue") != "none":
            settings["depth_cue"] = _field("depth_cue", top.get("depth_cue"))
        camera = _read_camera(top["camera"]) if "camera" in top else None
        framing = camera if isinstance(camera, Viewpoint) else None
        scene = Scene(meshes, camera=None if framing else camera, **settings)
        with named_in_errors("camera"):
            if framing is not None:
                framing.camera_of(scene, (4, 3), lambda: scene.meshes[0])
        with named_in_errors("options"):
            return SceneFile(scene, _read_options(top.get("options", {})), framing, appearance)

    def _word(self, key: str, value: Any) -> Any:
        """Return a word of Appearance, checked, as that takes it."""
        with named_in_errors(key):
            if key == "material" and isinstance(value, dict):
                value = self._material_fields(value)
            elif key == "material" and isinstance(value, str):
                value = self.materials.get(value, value)
        value = _field(key, value)
        with named_in_errors(key):
            Appearance(**{key: value})
        return value

    def _check_faces(self, n_face: int, times: int) -> None:
        """Refuse meshes that would have too many faces once they are subdivided."""
        legal, n_face = max(MAX_CUT_FACES, self.limits.n_byte), n_face * 4**times
        if times and n_face > legal:
            raise SceneError(f"subdivide: {times} times makes {n_face} faces; a file of its size may have {legal}")

    # --- files beside it

    def _path(self, name: Any) -> Path:
        """Return the path that an entry names, of a file that may be read."""
        if not isinstance(name, str) or not name or "\0" in name:
            raise SceneError(f"must be the name of a file; given {shown(name)}")
        try:
            return self.files.find(name)
        except FileNotFoundError:
            raise ModelError(f"{cut(name)}: no such file") from None
        except (OSError, ValueError) as fault:
            raise _unreadable(name, fault) from fault

    def _bytes(self, path: Path) -> bytes:
        """Return what a file holds whose path `_path` has returned."""
        try:
            return self.files.read_bytes(path)
        except (OSError, ValueError) as fault:
            raise _unreadable(path, fault) from fault

    def _stored(self, name: Any) -> dict[str, np.ndarray]:
        """Return the arrays of a .npz file by their names; it is read once."""
        path = self._path(name)
        if path not in self._arrays:
            data = self._bytes(path)
            self.limits.n_byte += len(data)
            self._arrays[path] = read_arrays(data, str(path))
        return self._arrays[path]

    def _array(self, name: Any, key: str) -> np.ndarray:
        """Return an array of a .npz file."""
        stored = self._stored(name)
        if key not in stored:
            raise ModelError(f"{cut(name, 80)} has no array {key!r}; it has {cut(', '.join(stored), 80) or 'none'}")
        return stored[key]

    # --- materials

    def _material(self, value: Any, name: str = "") -> Material:
        """Read a material: a table, the name of one of the file's materials, or else of one of the classic table's.

        `name` is what it is called unless it says that itself.
        """
        if isinstance(value, str) and value in self.materials:
            return self.materials[value]
        if isinstance(value, str) and value in NAMED_MATERIALS:
            return Material.named(value)
        if not isinstance(value, dict):
            known, classic = cut(", ".join(self.materials), 60) or "none", cut(", ".join(NAMED_MATERIALS), 80)
            legal = f"a table, or the name of one of the file's materials ({known}) or of the classic ones ({classic})"
            raise SceneError(f"must be {legal}; given {shown(value)}")
        return Material(**{"name": name} | self._material_fields(value))

    def _material_fields(self, value: Any) -> dict[str, Any]:
        """Return the fields of a material that a table has, with its textures."""
        found = {}
        for key, item in _table(value, [field.name for field in fields(Material)]).items():
            if key in TEXTURES and item is not None:
                with named_in_errors(key):
                    item = self._texture(item, Texture if key == "texture" else Texture.of_numbers)
            found[key] = _field(key, item)
        return found

    def _texture(self, value: Any, make: Any) -> Texture:
        """Read a texture: the name of a picture, or a table with it or with an array in a .npz file; `make` makes it of
        an image, and of the other fields of Texture."""
        table = value if isinstance(value, dict) else {"file": value}
        _table(table, ("file", "arrays", "texture", "filter", "wrap", "name"))
        settings = {key: table[key] for key in ("filter", "wrap", "name") if key in table}
        if ("file" in table) == ("arrays" in table):
            raise SceneError("a texture needs either file, or arrays and texture")
        if "file" in table:
            path = self._path(table["file"])
            key = path, make, repr(settings)
            if key not in self._textures:
                pixels = read_picture(BytesIO(self._bytes(path)), str(path), self.budget)
                self._textures[key] = self.budget.add(make(pixels, **{"name": str(path)} | settings))
            return self._textures[key]
        image = self._array(table["arrays"], f"texture{whole(table.get('texture'), 'texture', 0)}")
        return self.budget.add(make(image, **settings), 0)

    # --- meshes

    def _meshes(self, value: Any) -> tuple[list[Mesh], str]:
        """Return the meshes; and the up axis of the files where all come from files that agree on one, else "y"."""
        meshes, axes = [], set()
        for item, place in _items(value, "meshes"):
            with place:
                if sum(key in _table(item) for key in ("file", "arrays", "vertices")) != 1:
                    raise SceneError("a mesh needs one of file (a model), arrays (a .npz file), or vertices and faces")
                found, up = self._model(item) if "file" in item else ([self._mesh(item)], "y")
                axes.add(up)
                meshes += [_placed(mesh, item) for mesh in found]
        if not meshes:
            raise SceneError("meshes must hold at least one mesh; given none")
        if self.budget.n_halving:
            self.budget.warn()
            meshes = [_with_materials(mesh, map(self.budget.fit_material, mesh.palette)) for mesh in meshes]
        return meshes, axes.pop() if len(axes) == 1 else "y"

    def _model(self, table: dict[str, Any]) -> tuple[list[Mesh], str]:
        """Return the meshes of a model file with the materials asked for, and its up axis; its camera and lights aren't
        used."""
        _table(table, ("file", *_OF_MESH))
        with named_in_errors("file"):
            path, settings = self._path(table["file"]), self._settings(table)
            if (format := formats.find(path.suffix)) and format.is_scene:
                raise SceneError(f"must be a model, no scene file; given {shown(table['file'])}")
            key = path, json.dumps([table.get(name) for name in (*_MADE_BY, "scalars")])
            if key not in self._models:
                self.files.read.append(str(path))
                self.limits.n_byte += path.stat().st_size
                self._models[key] = load_model(path, settings, self.files.below(path.parent), log=self.log)
        scene = self._models[key]
        self.limits.count_meshes(len(scene.meshes))
        self.limits.count_bytes(sum(map(bytes_of_copy, scene.meshes)))
        if "material" in table and "materials" in table:
            raise SceneError("takes material (for all) or materials (by name); given both")
        meshes, changes = list(scene.meshes), {}
        if "material" in table:
            with named_in_errors("material"):
                material = self._material(table["material"])
            return [_with_materials(mesh, [material] * len(mesh.palette)) for mesh in meshes], scene.up
        names = {material.name for mesh in meshes for material in mesh.palette} - {""}
        for name, item in _named(table, "materials"):
            with named_in_errors(f"materials.{cut(name, 80)}"):
                if name not in names:
                    known = cut(", ".join(sorted(names)), 150) or "none with a name"
                    raise SceneError(f"the model has no material of this name; it has {known}")
                changes[name] = self._material(item, name)
        if changes:
            meshes = [_with_materials(m, [changes.get(each.name, each) for each in m.palette]) for m in meshes]
        return meshes, scene.up

    def _mesh(self, table: dict[str, Any]) -> Mesh:
        """Read a mesh from numbers in the scene file, or from a .npz file."""
        source, needed = (ARRAYS, ARRAYS[:2]) if "vertices" in table else (("arrays", "mesh"),) * 2
        _table(table, (*source, *_OF_MESH), needed)
        if "arrays" in table:
            start, name = f"mesh{whole(table['mesh'], 'mesh', 0)}_", table["arrays"]
            with named_in_errors("arrays"):
                arrays = {key: self._array(name, start + key) for key in ARRAYS[:2]}
                stored = self._stored(name)
            arrays |= {key: stored[start + key] for key in ARRAYS[2:] if start + key in stored}
            self.limits.count_bytes(sum(array.nbytes for array in arrays.values()))
        else:
            arrays = {key: _numbers(table, key) for key in ARRAYS if key in needed or table.get(key) is not None}
        self.limits.count_meshes(1)
        more = self._settings(table).arguments()
        if "material" in table:
            with named_in_errors("material"):
                more["material"] = self._material(table["material"])
        if "materials" in table:
            more["materials"] = found = []
            for item, place in _items(table["materials"], "materials"):
                with place:
                    found.append(self._material(item))
        return meshes_from(Mesh(**arrays, **more), {}, self._settings(table).scalars)[0]

    def _settings(self, table: dict[str, Any]) -> MeshSettings:
        """Return how the meshes of an entry are made: as the caller says, else as its table does, else as the file."""
        of_mesh = {key: table[key] for key in _MADE_BY if key in table}
        flag(of_mesh.get("drop_bad_faces", False), "drop_bad_faces")
        words = self.scalars | {key: table[key] for key in ("scalars",) if key in table}
        words |= {key: value for key, value in vars(self.asked.scalars).items() if value is not None}
        made = self.own.arguments() | of_mesh | self.asked.arguments()
        return MeshSettings(**made, scalars=ScalarWords(**words))


def _named(table: dict[str, Any], key: str) -> list[tuple[str, Any]]:
    """Return the names and values of a table that may be left out."""
    with named_in_errors(key):
        return list(_table(table.get(key, {})).items())


def _unreadable(name: Any, fault: Exception) -> ModelError:
    return ModelError(f"{cut(name)}: can't be read ({getattr(fault, 'strerror', None) or fault})")


def read_arrays(data: bytes, name: str) -> dict[str, np.ndarray]:
    """Return the arrays of a .npz file by their names, none of them of objects; ModelError where it is damaged, or
    unpacks to more than `most` says."""
    try:
        members = unpack(data, most(len(data)))
        return {key.removesuffix(".npy"): read_npy(BytesIO(members[key])) for key in members}
    except Exception as fault:
        raise ModelError(f"{name}: can't be read as .npz ({cut(fault) or type(fault).__name__})") from fault


def _numbers(table: dict[str, Any], key: str) -> Any:
    """Return an array of the file as Mesh takes it; whole numbers among the colours are linear too, no bytes."""
    if not isinstance(table[key], list):
        raise ModelError(f"{key} must be a list; given {shown(table[key])}")
    if key not in _FLOATS:
        return table[key]
    try:
        array = np.asarray(table[key])
    except (ValueError, OverflowError):  # lists of several lengths, or too many digits
        array = np.empty(0, object)
    if array.dtype.kind not in "iuf":
        raise ModelError(f"{key} must be a list of lists of numbers, all of one length; given {shown(table[key])}")
    return array.astype(np.float64)


def _with_materials(mesh: Mesh, materials: Any) -> Mesh:
    """Return a mesh with others in the places of its materials."""
    materials = tuple(materials)
    if materials == mesh.palette:
        return mesh
    return replace(mesh, **{"material": materials[0]} if mesh.materials is None else {"materials": materials})


def _placed(mesh: Mesh, table: dict[str, Any]) -> Mesh:
    """Give a mesh its name, and move it."""
    if "name" in table:
        # The mesh is new; a copy by `replace` would normalise its normals once more, which moves them by a rounding.
        store(mesh, name=text(table["name"], "name"))
    with named_in_errors("transform"):
        return mesh.transformed(_matrix(table["transform"])) if "transform" in table else mesh


def _matrix(value: Any) -> np.ndarray:
    """Read a transform (4, 4), world-from-model: 4 rows of 4 numbers; or a table: scaled, then rotated, then moved."""
    if isinstance(value, list):
        if len(value) != 4 or not all(isinstance(row, list) and len(row) == 4 for row in value):
            raise SceneError(f"must be 4 rows of 4 numbers; given {shown(value)}")
        return np.array([[number(x, "each number of the matrix") for x in row] for row in value])
    table = _table(value, ("translate", "rotate", "scale"))
    matrix, scale = np.eye(4), table.get("scale", 1.0)
    matrix[:3, :3] *= vector3(scale if isinstance(scale, list) else [scale] * 3, "scale (a number, or three)")
    if "rotate" in table:
        with named_in_errors("rotate"):
            turn = _table(table["rotate"], ("axis", "angle"), ("axis", "angle"))
            axis, angle = unit3(turn["axis"], "the axis"), number(turn["angle"], "the angle")
            matrix[:3, :3] = rotation(axis, angle) @ matrix[:3, :3]
    matrix[:3, 3] = vector3(table.get("translate", (0, 0, 0)), "translate")
    return matrix
