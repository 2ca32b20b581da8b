"""Materials, textures, lights and cameras of a scene file."""

import math
from dataclasses import fields, replace
from io import BytesIO
from pathlib import Path

import numpy as np

from ..errors import ModelError, shown
from ..scene.camera import Camera
from ..scene.color import linear_rgb
from ..scene.depth_cue import DepthCue, checked_cue
from ..scene.fields import describe_fields
from ..scene.light_presets import PRESETS
from ..scene.lights import LIGHT_KINDS
from ..scene.material import Material
from ..scene.named_materials import NAMED_MATERIALS
from ..scene.shadow import Shadow
from ..scene.spectrum import Spectrum
from ..scene.texture import Budget, Texture, read_picture
from .files import Folder
from .scene_file_arrays import Arrays
from .scene_file_entry import Entry

COLORS = ("ambient", "diffuse", "specular", "emissive", "fresnel", "color")  # fields that are colours
FRAMING = ("azimuth", "elevation", "fov", "orthographic", "margin")

# A unit vector that was computed once has n·n = 1 to 10 roundings of 2^-53: 3 of the sum, 1 of the root and 1 of the
# division of each component count twice in the square, 3 of this sum, and 1 to spare.
_UNIT_SLACK = 10 * 2.0**-53


class Context:
    """Hold what all parts of one scene file share.

    Parameters
    ----------
    files : Folder to which names of files are relative
    log : function of one text
    crease_angle, drop_bad_faces, weighting : as `read_scene` takes them
    """

    def __init__(self, files: Folder, log, crease_angle=None, drop_bad_faces=False, weighting=None):
        self.files, self.log, self.weighting = files, log, weighting
        self.crease_angle, self.drop_bad_faces = crease_angle, drop_bad_faces
        self.materials = {}  # by the name of the file's table
        self.models = {}  # what `load` made of files, by path and settings
        self.n_copy = 0  # triangles that are there because meshes refer to the same ones
        self.budget = Budget()
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

    def arrays(self, entry) -> Arrays:
        """Return the arrays of a .npz file, read once."""
        path = self.path(entry)
        if path not in self._arrays:
            self._arrays[path] = entry.call(Arrays, self.read(path, entry), str(path))
        return self._arrays[path]

    def texture(self, path, entry, **settings) -> Texture:
        """Return the texture of a picture file; the same for the same settings."""
        key = (path, *settings.items())
        if key not in self._textures:
            pixels = entry.call(read_picture, self.read(path, entry), str(path), self.budget)
            self.take(pixels, entry)
            self._textures[key] = entry.call(Texture, pixels, name=str(path), **settings)
        return self._textures[key]

    def take(self, image, entry) -> None:
        """Count a texture that is made of an image (h, w, ..)."""
        entry.call(self.budget.take, math.prod(np.shape(image)[:2]), "a texture")


def array_of(entry, context, key) -> np.ndarray:
    """Return an array of a .npz file by its name there."""
    arrays = context.arrays(entry)
    if key not in arrays:
        raise entry.fault(
            f"{entry.value} has no array {key!r}; it has {shown(', '.join(arrays))[1:-1] or 'none'}", ModelError
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


def read_color(entry):
    """Return a colour, checked."""
    return entry.call(linear_rgb, color_value(entry), "the color")


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
        known = ", ".join(context.materials) or "none"
        classic = ", ".join(NAMED_MATERIALS)
        legal = f"a table, or the name of one of the file's materials ({known}) or of the classic ones ({classic})"
        raise entry.fault(f"must be {legal}; given {shown(entry.value)}")
    settings = {"name": name}
    for key, field in entry.table([field.name for field in fields(Material)]).items():
        if key == "texture" and field.value is not None:
            settings[key] = _read_texture(field, context)
        else:
            settings[key] = color_value(field) if key in COLORS else field.value
    return keeping_units(entry.call(Material, **settings), settings, ("tangent",))


def _read_texture(entry, context) -> Texture:
    """Read a texture: the name of a picture, or a table with it or with an array in a .npz file."""
    if not isinstance(entry.value, dict):
        return context.texture(context.path(entry), entry)
    table = entry.table(("file", "arrays", "texture", "filter", "wrap", "name"))
    settings = {"filter": table["filter"].text()} if "filter" in table else {}
    if "wrap" in table:
        is_pair = isinstance(table["wrap"].value, list)
        settings["wrap"] = tuple(item.text() for item in table["wrap"].items()) if is_pair else table["wrap"].text()
    if ("file" in table) == ("arrays" in table):
        raise entry.fault("a texture needs either file, or arrays and texture")
    if "file" in table:
        texture = context.texture(context.path(table["file"]), table["file"], **settings)
    elif "texture" not in table:
        raise entry.fault("texture is missing: the number of the texture in arrays")
    else:
        image = array_of(table["arrays"], context, f"texture{index_of(table['texture'])}")
        context.take(image, entry)
        texture = entry.call(Texture, image, **settings)
    return replace(texture, name=table["name"].text()) if "name" in table else texture


# --- lights and cameras -------------------------------------------------------------------------------------


def read_lights(entry) -> tuple[tuple, tuple[int, ...]]:
    """Read the lights: a preset's name, or a list of these and of tables.

    Returns
    -------
    the lights, and the places of those that say `shadow = false`; raises SceneError
    """
    found, unshadowed = [], []
    for item in [entry] if isinstance(entry.value, str) else entry.items():
        if isinstance(item.value, str):
            if item.value not in PRESETS:
                raise item.fault(f"must be a table, or one of {', '.join(PRESETS)}; given {shown(item.value)}")
            found += PRESETS[item.value]()
            continue
        if isinstance(item.value, dict) and item.value.get("shadow") is False:
            unshadowed.append(len(found))
        found.append(_read_light(item))
    return tuple(found), tuple(unshadowed)


def _read_light(entry):
    """Read one light; `kind` chooses the class out of the scene's table, the other keys are its fields."""
    kind = entry.names().get("kind")
    if kind is None:
        raise entry.fault(f"kind is missing; legal are {', '.join(LIGHT_KINDS)}")
    if kind.text() not in LIGHT_KINDS:
        raise kind.fault(f"must be one of {', '.join(LIGHT_KINDS)}; given {shown(kind.value)}")
    described = describe_fields(LIGHT_KINDS[kind.value])
    needed = [name for name, field in described.items() if field.is_needed]
    table = entry.table(["kind", *described], ["kind", *needed])
    readers = {"shadow": _read_shadow, "flag": Entry.flag, "color": color_value}
    settings = {
        name: readers.get(described[name].holds, _value_of)(field) for name, field in table.items() if name != "kind"
    }
    vectors = [name for name, field in described.items() if field.holds == "vector"]
    return keeping_units(entry.call(LIGHT_KINDS[kind.value], **settings), settings, vectors)


def _value_of(entry):
    """What the file has there, for the class to check."""
    return entry.value


def _read_shadow(entry):
    """Read a shadow: true, false, or a table."""
    if entry.value is None or isinstance(entry.value, bool):
        return entry.value
    if not isinstance(entry.value, dict):
        raise entry.fault(f"must be true, false, or a table with size and filter; given {shown(entry.value)}")
    table = entry.table([field.name for field in fields(Shadow)])
    return entry.call(Shadow, **{key: field.value for key, field in table.items()})


def read_camera(entry) -> tuple[Camera | None, dict | None]:
    """Read a camera, or how to frame the scene: one of both, the other is None."""
    if isinstance(entry.value, dict) and "position" not in entry.value:
        legal = [field.name for field in fields(Camera)]
        for key in entry.value:
            if key in legal and key not in FRAMING:
                raise entry.fault(
                    f"position is missing, which goes with {key}; without it, legal are {', '.join(FRAMING)}"
                )
        table = entry.table(FRAMING)
        framing = {key: field.flag() if key == "orthographic" else field.value for key, field in table.items()}
        return None, framing
    table = entry.table([field.name for field in fields(Camera)])
    settings = {key: field.value for key, field in table.items()}
    return keeping_units(entry.call(Camera, **settings), settings, ("up",)), None


def keeping_units(made, given, names):
    """Give fields of what was made back the unit vectors that were given; to normalise one again moves it by a
    rounding."""
    for name in names:
        vector = given.get(name)
        if not isinstance(vector, list) or not hasattr(made, name):
            continue
        vector = tuple(map(float, vector))
        is_unit = abs(math.fsum(x * x for x in vector) - 1.0) <= _UNIT_SLACK
        if is_unit and all(abs(x - y) <= _UNIT_SLACK for x, y in zip(vector, getattr(made, name), strict=True)):
            object.__setattr__(made, name, vector)
    return made


def keeping_normals(mesh, normals):
    """Give a mesh back the normals (.., 3) that were saved, where all are unit vectors or zero; see `keeping_units`."""
    if mesh.normals is None or mesh.normals.shape != normals.shape or normals.dtype != np.float64:
        return mesh
    squares = np.einsum("...i,...i", normals, normals)
    if (((np.abs(squares - 1.0) <= _UNIT_SLACK) | (squares == 0.0)) & np.isfinite(squares)).all():
        normals.flags.writeable = False
        object.__setattr__(mesh, "normals", normals)
    return mesh
