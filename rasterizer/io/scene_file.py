"""A whole scene in one file: JSON or TOML.

    file ─ text ─ tables, duplicate keys refused ─ meshes, materials, lights, camera ─ Scene
           utf-8  json, tomllib

    meshes      list: {file = "part.obj", transform, material, ...}, {vertices, faces, ...} or
                {arrays = "x.npz", mesh = 0, ...}
    materials   table of named materials that meshes refer to
    lights      "studio", "headlight", or a list of these and of {kind = "point", position, ...}
    camera      the fields of Camera, or the words of `Viewpoint`: {view, azimuth, elevation, fov, ortho, zoom, margin}
                to have the scene framed, {eye, target, fov, ortho, zoom}
    background  colour      up  axis      options  those of a picture, as `Options` names them
    depth_cue   a number, or {scale, start, color}
    preset shadows material color reflection crease_angle weighting subdivide drop_bad_faces
                of all meshes and lights: the words of `Look`, with the meanings that `render` and the command line give
                them. How a mesh says itself that it is read comes first

Names of files are relative to the folder of the scene file; which are read is said in `files.py`. `scene_file_write`
writes what is read here. Text may be MAX_JSON or MAX_TOML bytes long: the arrays of large meshes go into .npz files
beside it.
"""

import json
import math
import os
import re
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import fields, replace
from difflib import get_close_matches
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.lib import format as npy

from ..choices import WEIGHTINGS
from ..errors import ModelError, SceneError, cut, one_file, shown
from ..look import Look
from ..options import Options
from ..scene.camera import Camera
from ..scene.color import linear_rgb
from ..scene.lights import LIGHT_TYPES, PRESETS, Shadow, describe_fields
from ..scene.material import NAMED_MATERIALS, Material
from ..scene.mesh import Mesh
from ..scene.scene import DepthCue, Scene, checked_cue
from ..scene.spectrum import Spectrum
from ..scene.texture import Budget, Texture, read_picture
from ..scene.validate import number, picture_size, unit3, vector3
from ..viewpoint import Viewpoint
from . import formats
from .files import Folder, name_of, open_member, read_source
from .loader import SceneFile, load_model
from .model_file import Allowance, MeshSettings, bytes_of_copy, most

_OWN_SETTINGS = MeshSettings()  # of the file, that is
MAX_JSON, MAX_TOML = 2**26, 2**23  # bytes, which take some 2 GB, or 5 seconds
MAX_DOTS = (
    100  # between two of the characters that may stand round a name of TOML; the parser's time grows with their square
)
# The words of Look that are more than what a Scene has.
LOOK = (
    "preset", "shadows", "material", "color", "reflection", "crease_angle", "weighting", "subdivide", "drop_bad_faces",
)  # fmt: skip
KEYS = ("meshes", "materials", "lights", "camera", "background", "depth_cue", "up", "options", *LOOK)


def read_scene(
    source,
    folder=None,
    log=None,
    *,
    format: str | None = None,
    mesh_settings: MeshSettings = _OWN_SETTINGS,
    allow_outside: bool = False,
    files_read: list | None = None,
) -> SceneFile:
    """Read a scene file.

    Parameters
    ----------
    source : path, bytes, or file object
    folder : path to which the names of files are relative; None = that of the path, for bytes the current one
    log : function of one text, called with facts about the files; None = nobody wants them
    format : "json" or "toml"; None = by the suffix of the path, for bytes JSON
    mesh_settings : those of all meshes; where they are not None they are taken in place of the file's
    allow_outside : bool, read also files outside the folder; see `files.py`
    files_read : list that gets the paths of all files that are read

    Returns
    -------
    SceneFile

    Raises
    ------
    ModelError : a file that can't be read or is no JSON or TOML, duplicate keys, a mesh that is not legal
    SceneError : an unknown or missing key, or a value that is not legal; messages name file, place and what is legal
    """
    name = name_of(source, "scene")
    files = Folder(Path(name).parent if folder is None else folder, None, allow_outside, files_read)
    context = Context(name, files, log, mesh_settings)
    with one_file(name):
        root = _parse(source, name, format)
        context.allowance.n_byte += root.n_byte
        return _read_tables(root, context)


def read_camera_file(path: str | os.PathLike[str]) -> Camera | Viewpoint:
    """Read the camera of a scene file, or a file that holds a camera alone.

    Parameters
    ----------
    path : of a JSON or TOML file: a scene, of which only its camera is looked at, or a table of a camera's fields

    Returns
    -------
    Camera, or Viewpoint where it has the words of one

    Raises
    ------
    ModelError : a file that can't be read or is no JSON or TOML
    SceneError : no camera, or one that is not legal
    """
    name = name_of(path, "scene")
    with one_file(name):
        root = _parse(path, name)
        if isinstance(root.value, dict) and "camera" in root.value:
            return read_camera(root.names()["camera"])
        if isinstance(root.value, dict) and "meshes" in root.value:
            raise root.fault("the scene has no camera")
        return read_camera(root)


def _read_tables(root, context) -> SceneFile:
    """Read the tables of a scene file."""
    elsewhere = dict.fromkeys(WORDS, "camera") | {field.name: "options" for field in fields(Options)}
    top = root.table(KEYS, ("meshes",), elsewhere)
    if "materials" in top:
        for key, entry in top["materials"].names().items():
            context.materials[key] = read_material(entry, context, key)
    lights = {"lights": read_lights(top["lights"])} if "lights" in top else {}
    words = {key: _read_word(key, top[key], context) for key in LOOK if key in top and top[key].value is not None}
    for key, value in words.items():
        top[key].call(Look, **{key: value})
    look = Look(**words, **lights if "preset" in words else {}) if words else None
    context.own_settings = MeshSettings(*(words.get(name) for name in MeshSettings._fields))
    meshes, up = read_meshes(top["meshes"], context)
    if context.budget.n_halving:
        context.budget.warn()
        meshes = [_with_fitted(mesh, context.budget) for mesh in meshes]
    settings = {"up": up} | ({} if "preset" in words else lights)
    camera = read_camera(top["camera"]) if "camera" in top else None
    framing = camera if isinstance(camera, Viewpoint) else None
    if "background" in top and top["background"].value not in (None, "transparent"):
        settings["background"] = top["background"].call(linear_rgb, color_value(top["background"]), "the color")
    if "depth_cue" in top and top["depth_cue"].value not in (None, "none"):
        settings["depth_cue"] = read_depth_cue(top["depth_cue"])
    if "up" in top:
        settings["up"] = top["up"].text()
    scene = root.call(Scene, meshes, camera=None if framing else camera, **settings)
    if framing is not None:
        top["camera"].call(framing.camera_of, scene, (4, 3), lambda: scene.meshes[0])
    return SceneFile(scene, _options(top.get("options")), framing, look)


def _read_word(key, entry, context):
    """Return a word of Look as that takes it."""
    if key == "shadows":
        return _read_shadow(entry)
    if key in COLORS:
        return color_value(entry)
    if key == "drop_bad_faces":
        return entry.flag()
    if key == "weighting":
        return entry.choice(WEIGHTINGS)
    if key != "material":
        return entry.value
    if isinstance(entry.value, dict):
        return _material_fields(entry, context)
    if not isinstance(entry.value, str):
        raise entry.fault(f"must be a table, or the name of a material; given {shown(entry.value)}")
    return context.materials.get(entry.value, entry.value)


def _options(entry) -> dict:
    """The options of a picture; lists become tuples, the values are looked at where the picture is made."""
    if entry is None:
        return {}
    items = entry.table([field.name for field in fields(Options)]).items()
    for size in [item for key, item in items if key == "size" and item.value is not None]:
        size.call(picture_size, size.value if isinstance(size.value, list) else (size.value, size.value))
    values = {key: item.value for key, item in items if item.value is not None}
    return {key: tuple(value) if isinstance(value, list) else value for key, value in values.items()}


# --- text to tables -----------------------------------------------------------------------------------------


def _parse(source, name, format=None) -> "Entry":
    """Parse a scene file; its format is that of its name's suffix, else JSON, unless it is told."""
    data = read_source(source, name)
    format = formats.format_of(name, format or Path(name).suffix or "json", is_scene=True).name
    if not data.strip():
        raise ModelError(f"{name}: the file is empty")
    most = MAX_TOML if format == "toml" else MAX_JSON
    if len(data) > most:
        raise ModelError(
            f"{name}: {len(data)} bytes; one in {format.upper()} may have {most}: arrays go into .npz files"
        )
    try:
        text = data.decode("utf-8-sig")
        if format == "toml":
            _check_names(text, name)
            root = Entry(_toml(name).loads(text.replace("\r\n", "\n")), name)
        else:
            root = Entry(json.loads(text, object_pairs_hook=_without_duplicates, parse_constant=_refuse), name)
        root.n_byte = len(data)
        return root
    except ModelError:
        raise
    except UnicodeDecodeError as fault:
        raise ModelError(f"{name}: is not UTF-8 text ({fault.reason} at byte {fault.start})") from fault
    except RecursionError as fault:
        raise ModelError(f"{name}: lists or tables are nested too deeply") from fault
    except ValueError as fault:  # those of json and tomllib, and too many digits
        raise ModelError(f"{name}: is not legal {format.upper()}: {cut(fault)}") from fault


def _check_names(text, name) -> None:
    """Raise ModelError for dotted names of TOML that are so long that parsing them would take minutes."""
    for piece in re.split(r"[\n,=\[\]{}]", text):
        if piece.count(".") > MAX_DOTS:
            raise ModelError(f"{name}: a name or text in TOML may have up to {MAX_DOTS} dots; given {shown(piece)}")


def _without_duplicates(pairs) -> dict:
    """Make a table of JSON, whose keys may be there once only; of two, json itself would drop one silently."""
    table = dict(pairs)
    if len(table) < len(pairs):
        seen = set()
        twice = next(key for key, _ in pairs if key in seen or seen.add(key))
        raise ValueError(f"duplicate key {shown(twice)}")
    return table


def _refuse(word):
    raise ValueError(f"{word} is no number of JSON")


def _toml(name):
    """The parser of TOML: Python's own from 3.11 on, else its elder copy."""
    try:
        import tomllib  # new in Python 3.11
    except ImportError:
        try:
            import tomli as tomllib  # an optional package
        except ImportError:
            raise ModelError(
                f"{name}: TOML needs Python 3.11, or tomli: pip install tomli; JSON needs neither"
            ) from None
    return tomllib


# ----------------------------------------------------------------
# A value of a scene file with the place where it stands, so that every fault names file, place and what is legal.

_MAX_FAULT = 400  # letters, which may hold the names of two files
_TYPE_NAMES = {dict: "a table", list: "a list", str: "text", bool: "true or false"}


class Entry:
    """Hold a value of a scene file.

    Parameters
    ----------
    value : what JSON or TOML has there
    file : text, the file's name
    where : text, the path to the value, such as lights[2].color; empty for the whole file

    Attributes
    ----------
    n_byte : bytes of the whole file, where this is it
    """

    n_byte = 0

    def __init__(self, value, file, where=""):
        self.value, self.file, self.where = value, file, where

    def fault(self, text, error=SceneError) -> Exception:
        """Return the error that says what is wrong here."""
        where = f"{cut(self.where, 100)}: " if self.where else ""
        return error(f"{self.file}: {where}{cut(text, _MAX_FAULT)}")

    def _of_type(self, type_):
        if type(self.value) is not type_:
            raise self.fault(f"must be {_TYPE_NAMES[type_]}; given {shown(self.value)}")
        return self.value

    def text(self) -> str:
        """Return the value, which must be text."""
        return self._of_type(str)

    def choice(self, words) -> str:
        """Return the value, which must be one of some words."""
        if self.text() not in words:
            raise self.fault(f"must be one of {', '.join(words)}; given {shown(self.value)}")
        return self.value

    def flag(self) -> bool:
        """Return the value, which must be true or false."""
        return self._of_type(bool)

    def items(self) -> list["Entry"]:
        """Return the entries of a list."""
        return [Entry(value, self.file, f"{self.where}[{i}]") for i, value in enumerate(self._of_type(list))]

    def names(self) -> dict[str, "Entry"]:
        """Return the entries of a table whose keys are up to the writer."""
        return {key: Entry(value, self.file, self._below(key)) for key, value in self._of_type(dict).items()}

    def table(self, legal, needed=(), elsewhere=None) -> dict[str, "Entry"]:
        """Return the entries of a table.

        Parameters
        ----------
        legal : sequence of text, the keys that it may have
        needed : sequence of text, those that it must have
        elsewhere : dict of keys that another table has, and its name

        Raises
        ------
        SceneError : no table, a key that is unknown or missing
        """
        for key in self._of_type(dict):
            if key not in legal:
                place, near = Entry(None, self.file, self._below(key)), get_close_matches(key, legal, n=1)
                where = (elsewhere or {}).get(key)
                hint = f", which {where} has" if where else f": did you mean {near[0]}?" if near else ""
                raise place.fault(f"unknown key{hint}; legal are {', '.join(legal)}")
        for key in needed:
            if key not in self.value:
                raise self.fault(f"{key} is missing; needed are {', '.join(needed)}")
        return self.names()

    def _below(self, key) -> str:
        """The place of a key of this table."""
        word = key if re.fullmatch(r"[\w-]{1,80}", key) else shown(key)
        return f"{self.where}.{word}" if self.where else word

    def call(self, function, *args, **settings):
        """Call a function, and let its error name the place: that of the field of which it speaks, if it is one
        here."""
        try:
            return function(*args, **settings)
        except (ModelError, SceneError) as fault:
            # Errors of the scene's classes name a field as in "the point light's color must be ..", "the azimuth must
            # be ..".
            named = re.finditer(r"(?:'s|\bthe) (\w+)|^(\w+)", str(fault)) if isinstance(self.value, dict) else ()
            field = next((match[match.lastindex] for match in named if match[match.lastindex] in self.value), None)
            place = self if field is None else Entry(None, self.file, self._below(field))
            raise place.fault(str(fault), type(fault)) from fault


# ----------------------------------------------------------------
# Materials, textures, lights and cameras of a scene file.

COLORS = ("ambient", "diffuse", "specular", "emissive", "fresnel", "metal", "color")  # fields that are colours
TEXTURES = ("texture", "metallic_roughness")
# The words of Viewpoint but `camera`; the last as ortho.
WORDS = (*(field.name for field in fields(Viewpoint) if field.name != "camera"), "orthographic")


class Context:
    """Hold what all parts of one scene file share.

    Parameters
    ----------
    name : text, that of the scene file
    files : Folder to which names of files are relative
    log : function of one text
    mesh_settings : as `read_scene` takes them
    """

    def __init__(self, name: str, files: Folder, log, mesh_settings: MeshSettings):
        self.files, self.log, self.mesh_settings = files, log, mesh_settings
        self.own_settings = _OWN_SETTINGS  # of the file, for meshes that say nothing themselves
        self.materials = {}  # by the name of the file's table
        self.models = {}  # what `load` made of files, by path and settings
        self.allowance = Allowance(0)
        self.budget = Budget(name)
        self._arrays, self._textures = {}, {}

    def path(self, entry) -> Path:
        """Return the path that an entry names, of a file that may be read."""
        text = entry.text()
        if not text or "\0" in text:
            raise entry.fault(f"must be the name of a file; given {shown(text)}")
        try:
            return self.files.find(text)
        except FileNotFoundError:
            raise entry.fault(f"{shown(text)[1:-1]}: no such file", ModelError) from None
        except (OSError, ValueError) as fault:
            reason = getattr(fault, "strerror", None) or fault
            raise entry.fault(f"{shown(text)[1:-1]}: can't be read ({reason})", ModelError) from fault

    def read(self, path, entry) -> BytesIO:
        """Return what a file holds whose path `path` has returned."""
        try:
            return BytesIO(self.files.read_bytes(path))
        except (OSError, ValueError) as fault:
            raise entry.fault(
                f"{path}: can't be read ({getattr(fault, 'strerror', None) or fault})", ModelError
            ) from fault

    def arrays(self, entry) -> "Arrays":
        """Return the arrays of a .npz file, read once."""
        path = self.path(entry)
        if path not in self._arrays:
            self._arrays[path] = entry.call(Arrays, self.read(path, entry), str(path))
            self.allowance.n_byte += self._arrays[path].size
        return self._arrays[path]

    def texture(self, path, entry, make=Texture, **settings) -> Texture:
        """Return the texture that `make` makes of a picture file; the same for the same settings."""
        key = (path, make, *settings.items())
        if key not in self._textures:
            pixels = entry.call(read_picture, self.read(path, entry), str(path), self.budget)
            self._textures[key] = self.budget.add(entry.call(make, pixels, name=str(path), **settings))
        return self._textures[key]


def _with_fitted(mesh, budget) -> Mesh:
    """Return a mesh with textures that are halved as those of the whole file."""
    if mesh.materials is None:
        return replace(mesh, material=budget.fit_material(mesh.material))
    return replace(mesh, materials=[budget.fit_material(material) for material in mesh.materials])


def array_of(entry, context, key) -> np.ndarray:
    """Return an array of a .npz file by its name there."""
    arrays = context.arrays(entry)
    if key not in arrays:
        raise entry.fault(
            f"{cut(entry.value, 80)} has no array {key!r}; it has {shown(', '.join(arrays))[1:-1] or 'none'}",
            ModelError,
        )
    return entry.call(arrays.__getitem__, key)


def index_of(entry) -> int:
    """Return a whole number of at least 0."""
    if type(entry.value) is not int or entry.value < 0:
        raise entry.fault(f"must be a whole number of at least 0; given {shown(entry.value)}")
    return entry.value


# --- colours and materials ----------------------------------------------------------------------------------


def color_value(entry):
    """Return a colour as the classes take it: of a table the Spectrum, else what is there."""
    if not isinstance(entry.value, dict):
        return entry.value
    table = entry.table(("wavelengths", "values"), ("wavelengths", "values"))
    return entry.call(Spectrum, table["wavelengths"].value, table["values"].value)


def read_depth_cue(entry) -> DepthCue:
    """Read a depth cue: its scale, or a table of its fields."""
    if not isinstance(entry.value, dict):
        return entry.call(checked_cue, entry.value)
    table = entry.table([field.name for field in fields(DepthCue)], ("scale",))
    settings = {key: color_value(field) if key in COLORS else field.value for key, field in table.items()}
    return entry.call(DepthCue, **settings)


def read_material(entry, context, name="") -> Material:
    """Read a material: a table, the name of one of the file's materials, or else of one of the classic table's.

    Parameters
    ----------
    entry : Entry
    context : Context
    name : text, that the material gets unless it says one itself

    Raises
    ------
    SceneError : a value or name that is not legal
    ModelError : a texture that can't be read
    """
    if isinstance(entry.value, str) and entry.value in context.materials:
        return context.materials[entry.value]
    if isinstance(entry.value, str) and entry.value in NAMED_MATERIALS:
        return Material.named(entry.value)
    if not isinstance(entry.value, dict):
        known = cut(", ".join(context.materials), 60) or "none"
        classic = cut(", ".join(NAMED_MATERIALS), 80)
        legal = f"a table, or the name of one of the file's materials ({known}) or of the classic ones ({classic})"
        raise entry.fault(f"must be {legal}; given {shown(entry.value)}")
    return entry.call(Material, **{"name": name} | _material_fields(entry, context))


def _material_fields(entry, context) -> dict:
    """Read the fields of a material that a table has, with its textures."""
    settings = {}
    for key, field in entry.table([field.name for field in fields(Material)]).items():
        if key in TEXTURES and field.value is not None:
            settings[key] = _read_texture(field, context, Texture if key == "texture" else Texture.of_numbers)
        else:
            settings[key] = color_value(field) if key in COLORS else field.value
    return settings


def _read_texture(entry, context, make) -> Texture:
    """Read a texture: the name of a picture, or a table with it or with an array in a .npz file.

    make : function that makes it of an image, and of the other fields of Texture
    """
    if not isinstance(entry.value, dict):
        return context.texture(context.path(entry), entry, make)
    table = entry.table(("file", "arrays", "texture", "filter", "wrap", "name"))
    settings = {"filter": table["filter"].text()} if "filter" in table else {}
    if "wrap" in table:
        is_pair = isinstance(table["wrap"].value, list)
        settings["wrap"] = tuple(item.text() for item in table["wrap"].items()) if is_pair else table["wrap"].text()
    if ("file" in table) == ("arrays" in table):
        raise entry.fault("a texture needs either file, or arrays and texture")
    if "file" in table:
        texture = context.texture(context.path(table["file"]), table["file"], make, **settings)
    elif "texture" not in table:
        raise entry.fault("texture is missing: the number of the texture in arrays")
    else:
        image = array_of(table["arrays"], context, f"texture{index_of(table['texture'])}")
        texture = context.budget.add(entry.call(make, image, **settings), 0)
    if "name" not in table:
        return texture
    return context.budget.add_like(replace(texture, name=table["name"].text()), texture)


# --- lights and cameras -------------------------------------------------------------------------------------


def read_lights(entry) -> tuple:
    """Read the lights: a preset's name, or a list of these and of tables; SceneError for anything else."""
    found = []
    for item in [entry] if isinstance(entry.value, str) else entry.items():
        if isinstance(item.value, str):
            if item.value not in PRESETS:
                raise item.fault(f"must be a table, or one of {', '.join(PRESETS)}; given {shown(item.value)}")
            found += PRESETS[item.value]()
            continue
        found.append(_read_light(item))
    return tuple(found)


def _read_light(entry):
    """Read one light; `kind` chooses the class out of the scene's table, the other keys are its fields."""
    kind = entry.names().get("kind")
    if kind is None:
        raise entry.fault(f"kind is missing; legal are {', '.join(LIGHT_TYPES)}")
    kind.choice(LIGHT_TYPES)
    described = describe_fields(LIGHT_TYPES[kind.value])
    needed = [name for name, field in described.items() if field.is_needed]
    table = entry.table(["kind", *described], ["kind", *needed])
    readers = {"shadow": _read_shadow, "flag": Entry.flag, "color": color_value}
    settings = {
        name: readers.get(described[name].holds, lambda field: field.value)(field)  # which the class checks
        for name, field in table.items()
        if name != "kind"
    }
    return entry.call(LIGHT_TYPES[kind.value], **settings)


def _read_shadow(entry):
    """Read a shadow: true, false, or a table."""
    if entry.value is None or isinstance(entry.value, bool):
        return entry.value
    if not isinstance(entry.value, dict):
        raise entry.fault(f"must be true, false, or a table with size and filter; given {shown(entry.value)}")
    table = entry.table([field.name for field in fields(Shadow)])
    return entry.call(Shadow, **{key: field.value for key, field in table.items()})


def read_camera(entry) -> Camera | Viewpoint:
    """Read a camera, or words that say where the scene is seen from."""
    if isinstance(entry.value, str):
        raise entry.fault(f'must be a table, such as {{view = "iso"}}; given {shown(entry.value)}')
    if isinstance(entry.value, dict) and "position" not in entry.value:
        legal = [field.name for field in fields(Camera)]
        for key in entry.value:
            if key in legal and key not in WORDS:
                raise entry.fault(
                    f"position is missing, which goes with {key}; without it, legal are {', '.join(WORDS)}"
                )
        table = entry.table(WORDS)
        if "orthographic" in table:
            table.setdefault("ortho", table.pop("orthographic"))
        words = {key: field.flag() if key == "ortho" else field.value for key, field in table.items()}
        return entry.call(Viewpoint, camera="frame", **words)
    table = entry.table([field.name for field in fields(Camera)])
    return entry.call(Camera, **{key: field.value for key, field in table.items()})


# ----------------------------------------------------------------
# Meshes of a scene file: models in files of their own, arrays beside it, or numbers in it; and where they are placed.

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
    scene = _load_once(path, table["file"], _mesh_settings(table, context), context)
    if "material" in table and "materials" in table:
        raise entry.fault("takes material (for all) or materials (by name); given both")
    meshes = list(scene.meshes)
    if "material" in table:
        material = read_material(table["material"], context)
        meshes = [replace_materials(mesh, dict.fromkeys(mesh.palette, material), entry) for mesh in meshes]
    elif "materials" in table:
        meshes = _with_named(meshes, table["materials"], context)
    return [_placed(mesh, table, entry) for mesh in meshes], scene.up


def _mesh_settings(table, context) -> MeshSettings:
    """Return how the meshes of an entry are made: as the caller says, else as its table does."""
    of_mesh = {}
    if "crease_angle" in table:
        of_mesh["crease_angle"] = table["crease_angle"].value
    if "weighting" in table:
        of_mesh["weighting"] = table["weighting"].text()
    if "drop_bad_faces" in table:
        of_mesh["drop_bad_faces"] = table["drop_bad_faces"].flag()
    asked = context.mesh_settings
    return MeshSettings(**context.own_settings.arguments() | of_mesh | asked.arguments())


def _load_once(path, entry, settings, context):
    """Return the scene of a model file, read once, however often it is used; its uses are counted."""
    angle = settings.crease_angle
    key = (path, angle if isinstance(angle, (int, float)) else None, settings.weighting)
    if key not in context.models:
        context.files.read.append(str(path))
        context.allowance.n_byte += path.stat().st_size
        files = context.files.below(path.parent)
        context.models[key] = entry.call(load_model, path, settings, files, log=context.log)
    scene = context.models[key]
    entry.call(context.allowance.show, len(scene.meshes))
    entry.call(context.allowance.make, sum(map(bytes_of_copy, scene.meshes)))
    return scene


def _with_named(meshes, entry, context) -> list[Mesh]:
    """Replace the materials that have one of the names."""
    names = sorted({material.name for mesh in meshes for material in mesh.palette} - {""})
    changes = {}
    for name, item in entry.names().items():
        if name not in names:
            raise item.fault(
                f"the model has no material of this name; it has {cut(', '.join(names), 150) or 'none with a name'}"
            )
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
        entry.call(context.allowance.make, sum(array.nbytes for array in arrays.values()))
    entry.call(context.allowance.show, 1)
    settings = _mesh_settings(table, context).arguments()
    if "material" in table:
        settings["material"] = read_material(table["material"], context)
    if "materials" in table:
        settings["materials"] = [read_material(item, context) for item in table["materials"].items()]
    return _placed(entry.call(Mesh, **arrays, **settings), table, entry)


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


# ----------------------------------------------------------------
# Arrays of a .npz file, looked at before they are unpacked: a file of some kilobytes may hold gigabytes.
# .npz   a zip file of .npy files: a header, which tells shape and dtype, and the numbers

# What numpy and zipfile have been seen to raise for damaged files, besides their own errors.
_FAULTS = (
    OSError, ValueError, EOFError, TypeError, SyntaxError, LookupError, RuntimeError, MemoryError, ArithmeticError,
    AttributeError, zipfile.BadZipFile, zlib.error, tokenize.TokenError,
)  # fmt: skip


class Arrays(Mapping):
    """Map the names of a .npz file's arrays to the arrays, each unpacked when it is first asked for; no object is ever
    made.

    Parameters
    ----------
    stream : binary file object, or path
    name : text, what messages call it

    Raises
    ------
    ModelError : no .npz file, a damaged or encrypted one, or one that unpacks to more than `most` says; also when an
        array is asked for that is damaged or holds objects
    """

    def __init__(self, stream, name: str):
        self._name, self._found = name, {}
        try:
            self._archive = zipfile.ZipFile(stream)
            members = self._archive.infolist()
            self._archive.fp.seek(0, os.SEEK_END)
            self.size = self._archive.fp.tell()
            limit = most(self.size)
        except _FAULTS as fault:
            raise self._fault(fault) from fault
        total = sum(member.file_size for member in members)
        if total > limit:
            raise ModelError(f"{name}: its arrays would take {total} bytes; an .npz file of its size may have {limit}")
        self._members = {member.filename.removesuffix(".npy"): member for member in members}

    def _fault(self, fault) -> ModelError:
        reason = cut(fault) or type(fault).__name__
        return ModelError(f"{self._name}: can't be read as .npz ({reason})")

    def __len__(self) -> int:
        return len(self._members)

    def __iter__(self):
        return iter(self._members)

    def __contains__(self, key) -> bool:
        return key in self._members

    def __getitem__(self, key) -> np.ndarray:
        if key not in self._found:
            try:
                self._found[key] = self._read(self._members[key])
            except _FAULTS as fault:
                raise self._fault(fault) from fault
        return self._found[key]

    def _read(self, member) -> np.ndarray:
        """Unpack one array, whose header must ask for what the member holds, and no more."""
        with open_member(self._archive, member) as stream:
            version = npy.read_magic(stream)
            read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
            shape, is_fortran, dtype = read_header(stream)
            if dtype.hasobject or dtype.names or dtype.kind not in "biuf":
                raise ValueError(f"{member.filename} holds no numbers, but {str(dtype)[:40]}")
            length = math.prod(shape) * dtype.itemsize
            if min(shape, default=0) < 0 or length > member.file_size:
                raise ValueError(
                    f"{member.filename} must hold {length} bytes for its shape, and has {member.file_size}"
                )
            data = stream.read(length)
            if len(data) < length:
                raise ValueError(f"{member.filename} is cut off")
        return np.frombuffer(data, dtype).reshape(shape, order="F" if is_fortran else "C")
