"""A whole scene in one file: JSON or TOML.

    file ─ text ─ tables, duplicate keys refused ─ meshes, materials, lights, camera ─ Scene
           utf-8  json, tomllib                    scene_file_meshes, scene_file_parts

    meshes      list: {file = "part.obj", transform, material, ...}, {vertices, faces, ...} or
                {arrays = "x.npz", mesh = 0, ...}
    materials   table of named materials that meshes refer to
    lights      "studio", "headlight", or a list of these and of {kind = "point", position, ...}
    camera      the fields of Camera, or {azimuth, elevation, fov, orthographic, margin} to have the scene framed
    background  colour      up  axis      options  those of a picture, as `Options` names them
    depth_cue   a number, or {scale, start, color}

Names of files are relative to the folder of the scene file; which are read is said in `files.py`. `scene_file_write`
writes what is read here. Text may be MOST_JSON or MOST_TOML bytes long: the arrays of large meshes go into .npz files
beside it.
"""

import json
import os
import re
from pathlib import Path

from ..errors import ModelError, SceneError, one_file, shown
from ..scene.camera import Camera
from ..scene.scene import Scene
from ..scene.validate import picture_size
from . import formats
from .files import Folder, read_named
from .model_file import MeshSettings
from .models import keep_quiet
from .scene_contents import SceneFile
from .scene_file_entry import Entry
from .scene_file_meshes import read_meshes
from .scene_file_parts import Context, read_camera, read_color, read_depth_cue, read_lights, read_material

_OWN_SETTINGS = MeshSettings()  # of the file, that is
MOST_JSON, MOST_TOML = 2**26, 2**23  # bytes, which take some 2 GB, or 5 seconds
MOST_DOTS = (
    100  # between two of the characters that may stand round a name of TOML; the parser's time grows with their square
)
KEYS = ("meshes", "materials", "lights", "camera", "background", "depth_cue", "up", "options")
# The fields of Options, which this side of the package doesn't import; a test holds that.
OPTIONS = (
    "size", "shading", "tolerance", "samples", "antialias", "outputs", "cull", "color_range", "exposure", "spectral",
    "threads", "edges", "edge_color", "edge_width", "ground",
)  # fmt: skip


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
    name, data, own_folder = _read(source)
    files = Folder(own_folder if folder is None else folder, None, allow_outside, files_read)
    own = mesh_settings
    context = Context(files, log or keep_quiet, own.crease_angle, own.drop_bad_faces, own.weighting)
    with one_file(name):
        entry = formats.format_of(name, format or Path(name).suffix or "json", is_scene=True)
        return _read_tables(Entry(_parse(data, entry.name, name), name), context)


def read_camera_file(path: str | os.PathLike[str]) -> tuple[Camera | None, dict | None]:
    """Read the camera of a scene file, or a file that holds a camera alone.

    Parameters
    ----------
    path : of a JSON or TOML file: a scene, of which only its camera is looked at, or a table of a camera's fields

    Returns
    -------
    Camera, or None; and a dict of arguments of `Camera.framing`, or None: one of both is there

    Raises
    ------
    ModelError : a file that can't be read or is no JSON or TOML
    SceneError : no camera, or one that is not legal
    """
    name, data, _ = _read(path)
    with one_file(name):
        entry = formats.format_of(name, Path(name).suffix or "json", is_scene=True)
        value = _parse(data, entry.name, name)
        if isinstance(value, dict) and "camera" in value:
            return read_camera(Entry(value["camera"], f"{name}: camera"))
        if isinstance(value, dict) and "meshes" in value:
            raise SceneError(f"{name}: the scene has no camera")
        return read_camera(Entry(value, name))


def _read_tables(root, context) -> SceneFile:
    """Read the tables of a scene file."""
    top = root.table(KEYS, ("meshes",))
    if "materials" in top:
        for key, entry in top["materials"].names().items():
            context.materials[key] = read_material(entry, context, key)
    meshes, up = read_meshes(top["meshes"], context)
    settings = {"up": up}
    unshadowed = ()
    if "lights" in top:
        settings["lights"], unshadowed = read_lights(top["lights"])
    camera, framing = read_camera(top["camera"]) if "camera" in top else (None, None)
    if "background" in top and top["background"].value is not None:
        settings["background"] = read_color(top["background"])
    if "depth_cue" in top and top["depth_cue"].value is not None:
        settings["depth_cue"] = read_depth_cue(top["depth_cue"])
    if "up" in top:
        settings["up"] = top["up"].text()
    scene = root.call(Scene, meshes, camera=camera, **settings)
    if framing is not None:
        top["camera"].call(Camera.framing, scene.meshes[0], up=scene.up, **framing)
    return SceneFile(scene, _options(top.get("options")), framing, unshadowed)


def _options(entry) -> dict:
    """The options of a picture; lists become tuples, the values are looked at where the picture is made."""
    if entry is None:
        return {}
    items = entry.table(OPTIONS).items()
    for size in [item for key, item in items if key == "size" and item.value is not None]:
        size.call(picture_size, size.value if isinstance(size.value, list) else (size.value, size.value))
    values = {key: item.value for key, item in items if item.value is not None}
    return {key: tuple(value) if isinstance(value, list) else value for key, value in values.items()}


# --- text to tables -----------------------------------------------------------------------------------------


def _read(source) -> tuple[str, bytes, Path]:
    """Return name, bytes and folder of a source."""
    if isinstance(source, (bytes, bytearray, memoryview)):
        return "scene", bytes(source), Path()
    try:
        if hasattr(source, "read"):
            label = getattr(source, "name", None)
            name = label if isinstance(label, str) else "scene"
            data = source.read()
            return (
                name,
                data.encode("utf-8", "surrogateescape") if isinstance(data, str) else bytes(data),
                Path(name).parent,
            )
        path = Path(os.fsdecode(source))
        return str(path), read_named(path), path.parent
    except FileNotFoundError:
        raise ModelError(f"{path}: no such file") from None
    except (OSError, ValueError, TypeError) as fault:
        what = source if isinstance(source, (str, os.PathLike)) else shown(source)
        raise ModelError(f"{what}: can't be read ({getattr(fault, 'strerror', None) or fault})") from fault


def _parse(data, format, name):
    """Parse the text of a scene file."""
    if not data.strip():
        raise ModelError(f"{name}: the file is empty")
    most = MOST_TOML if format == "toml" else MOST_JSON
    if len(data) > most:
        raise ModelError(
            f"{name}: {len(data)} bytes; one in {format.upper()} may have {most}: arrays go into .npz files"
        )
    try:
        text = data.decode("utf-8-sig")
        if format == "toml":
            _check_names(text, name)
            return _toml(name).loads(text.replace("\r\n", "\n"))
        return json.loads(text, object_pairs_hook=_without_duplicates, parse_constant=_refuse)
    except UnicodeDecodeError as fault:
        raise ModelError(f"{name}: is not UTF-8 text ({fault.reason} at byte {fault.start})") from fault
    except RecursionError as fault:
        raise ModelError(f"{name}: lists or tables are nested too deeply") from fault
    except ValueError as fault:  # those of json and tomllib, and too many digits
        raise ModelError(f"{name}: is not legal {format.upper()}: {' '.join(str(fault).split())[:200]}") from fault


def _check_names(text, name) -> None:
    """Raise ModelError for dotted names of TOML that are so long that parsing them would take minutes."""
    for piece in re.split(r"[\n,=\[\]{}]", text):
        if piece.count(".") > MOST_DOTS:
            raise ModelError(f"{name}: a name or text in TOML may have up to {MOST_DOTS} dots; given {shown(piece)}")


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
