"""Write a scene to a file that `scene_file.read_scene` reads: JSON or TOML, arrays and textures in files beside it.

    scene.json             meshes, materials, lights, camera: numbers in full, so that they come back as they were
    scene.npz              the arrays of all meshes, and textures that are not 8 bits a channel
    scene-texture0.png     the other textures

All are written in full under other names first, and then renamed, the scene file last.
"""

import io
import json
import os
from dataclasses import fields
from pathlib import Path

import numpy as np

from ..errors import SceneError, shown
from ..keywords import checked_keywords
from ..scene.color import LINEAR_OF_BYTE
from ..scene.lights import describe_fields, light_type_of
from ..scene.material import Material
from ..scene.scene import Scene
from ..scene.spectrum import Spectrum
from ..scene.texture import Texture
from .files import write_all
from .scene_file import ARRAYS, COLORS, TEXTURES


@checked_keywords
def save(scene: Scene, path: str | os.PathLike[str]) -> Path:
    """Write a scene to a file that `load` reads: the same meshes, lights, materials, camera, background, depth cue come
    back.

    Arrays are written beside it as NAME.npz and textures as NAME-texture0.png, or into the .npz where they are no 8-bit
    pictures; files of these names are replaced. Each file appears whole or not at all.

    Parameters
    ----------
    scene : Scene
    path : where to; the suffix chooses the format, .json or .toml

    Returns
    -------
    Path, the same as given

    Raises
    ------
    SceneError : what is no Scene, another suffix, a name that can't be written as Unicode text
    OutputError : a file can't be written
    """
    if not isinstance(scene, Scene):
        raise SceneError(f"what is saved must be a Scene; given {shown(scene)}")
    if not isinstance(path, (str, os.PathLike)):
        raise SceneError(f"a scene is saved to a path; given {shown(path)}")
    path = Path(path)
    format = path.suffix.lower()
    if format not in (".json", ".toml"):
        raise SceneError(f"a scene is saved as .json or .toml; given {shown(path.name)}")
    beside = _Beside(path.stem)
    table = _tables(scene, beside)
    text = json.dumps(table, indent=1, allow_nan=False) if format == ".json" else to_toml(table)
    try:
        content = (text.rstrip("\n") + "\n").encode()
    except UnicodeEncodeError as fault:
        raise SceneError(f"a name in the scene can't be written as Unicode text: {fault.reason}") from fault
    write_all({str(path.parent / name): data for name, data in beside.contents().items()} | {str(path): content})
    return path


# --- the scene as tables ------------------------------------------------------------------------------------


class _Beside:
    """Collect what goes into files beside the scene file."""

    def __init__(self, stem):
        self.npz = f"{stem}.npz"
        self.arrays, self.pictures = {}, {}
        self._stem, self._textures, self._materials = stem, {}, {}
        self.materials = {}  # tables by key

    def material(self, material) -> str:
        """The key of a material, which is written once."""
        if material not in self._materials:
            key = f"material{len(self._materials)}"
            self._materials[material] = key
            self.materials[key] = self._table_of(material)
        return self._materials[material]

    def _table_of(self, material) -> dict:
        """What of a material is not the default."""
        plain = Material(diffuse=material.diffuse)
        table = {"name": material.name}
        for field in fields(Material):
            value = getattr(material, field.name)
            default = Material().diffuse if field.name == "diffuse" else getattr(plain, field.name)
            if field.name in TEXTURES and value is not None:
                table[field.name] = self._texture(value, is_picture=field.name == "texture")
            elif value != default or isinstance(value, Spectrum):
                is_color = field.name in COLORS and isinstance(value, tuple)
                table[field.name] = _color(value) if is_color else _plain(value)
        return table

    def _texture(self, texture, is_picture) -> dict:
        """The table of a texture; it is written once, as a picture where one is decoded to it again."""
        number = self._textures.setdefault((id(texture), is_picture), len(self._textures))
        rest = {"filter": texture.filter, "wrap": list(texture.wrap), "name": texture.name}
        name = f"{self._stem}-texture{number}.png"
        if name not in self.pictures and f"texture{number}" not in self.arrays:
            pixels = bytes_of(texture) if is_picture else None
            if pixels is None:
                self.arrays[f"texture{number}"] = texture.image
            else:
                self.pictures[name] = _png(pixels)
        return ({"file": name} if name in self.pictures else {"arrays": self.npz, "texture": number}) | rest

    def mesh(self, number, mesh) -> dict:
        """The table of a mesh."""
        for key in ARRAYS:
            array = getattr(mesh, key)
            if array is not None:
                self.arrays[f"mesh{number}_{key}"] = array
        table = {"arrays": self.npz, "mesh": number, "name": mesh.name}
        if mesh.crease_angle is not None:
            table["crease_angle"] = mesh.crease_angle
        if mesh.weighting != "angle":
            table["weighting"] = mesh.weighting
        if mesh.drop_bad_faces:
            table["drop_bad_faces"] = True
        if mesh.materials is None:
            return table | {"material": self.material(mesh.material)}
        return table | {"materials": [self.material(material) for material in mesh.materials]}

    def contents(self) -> dict[str, bytes]:
        """The files' bytes by name."""
        stream = io.BytesIO()
        np.savez(stream, **self.arrays)
        return {self.npz: stream.getvalue()} | self.pictures


def _tables(scene, beside) -> dict:
    """The scene as nested tables of text, numbers and lists; meshes first, because they tell the materials."""
    meshes = [beside.mesh(number, mesh) for number, mesh in enumerate(scene.meshes)]
    table = {"up": scene.up}
    if scene.background is not None:
        table["background"] = _color(scene.background)
    if scene.depth_cue is not None:
        cue = scene.depth_cue
        table["depth_cue"] = {"scale": cue.scale, "start": cue.start, "color": _color(cue.color)}
    if scene.camera is not None:
        table["camera"] = _camera(scene.camera)
    lights = [_light(light) for light in scene.lights]
    return table | {"materials": beside.materials, "meshes": meshes, "lights": lights}


def _camera(camera) -> dict:
    """A camera's fields that are set; the field of view of intrinsics follows from them."""
    values = {field.name: getattr(camera, field.name) for field in fields(camera)}
    if camera.intrinsics is not None:
        values["fov"] = None
    if camera.skew == 0.0:
        values["skew"] = None
    return {key: _plain(value) for key, value in values.items() if value is not None}


def _light(light) -> dict:
    """A light's kind and fields, out of the scene's table of kinds."""
    table = {"kind": light_type_of(light)}
    for name, field in describe_fields(type(light)).items():
        value = getattr(light, name)
        if field.holds == "shadow" and value:
            table["shadow"] = {"size": value.size, "filter": value.filter}
        elif value is not None:
            table[name] = _color(value) if field.holds == "color" else _plain(value)
    return table


def _plain(value):
    return list(value) if isinstance(value, tuple) else value


def _color(color):
    """A colour: three numbers, one for a grey, or a spectrum."""
    if isinstance(color, Spectrum):
        return {"wavelengths": np.asarray(color.wavelengths).tolist(), "values": np.asarray(color.values).tolist()}
    red, green, blue = map(float, color)
    return red if red == green == blue else [red, green, blue]


def bytes_of(texture) -> np.ndarray | None:
    """Return the 8-bit picture that a texture was decoded from.

    Parameters
    ----------
    texture : Texture

    Returns
    -------
    (h, w, 3 or 4) uint8, sRGB, with alpha where it isn't 1 everywhere; None where no 8-bit picture decodes to the same
    values
    """
    levels = LINEAR_OF_BYTE.astype(np.float32)
    # Between two levels the next one up is taken: for a value that is none of them it decodes to another, which is seen
    # below.
    colors = np.minimum(np.searchsorted(levels, texture.image[..., :3]), 255)
    alpha = np.rint(texture.image[..., 3:] * 255.0)
    pixels = np.concatenate([colors, alpha] if texture.has_alpha else [colors], axis=2).astype(np.uint8)
    return pixels if np.array_equal(Texture(pixels).image, texture.image) else None


def _png(pixels) -> bytes:
    from PIL import Image  # takes long to import; most scenes have no textures

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()


# --- tables as TOML -----------------------------------------------------------------------------------------


def to_toml(table) -> str:
    """Return a table as TOML 1.0: plain values first, then tables and lists of tables under headings.

    Parameters
    ----------
    table : dict of text, numbers, bools, lists and tables, whose keys are text; no None, because TOML has none
    """
    return "\n".join(_toml_lines(table)) + "\n"


def _toml_lines(table, path=()) -> list[str]:
    """The lines of a table whose heading, if it has one, is written already.

    Two levels of tables have headings; what lies deeper is inline.
    """
    lines, below = [], []
    for key, value in table.items():
        heading = ".".join(map(_toml_key, (*path, key)))
        if isinstance(value, dict) and len(path) < 2:
            below += ["", f"[{heading}]", *_toml_lines(value, (*path, key))]
        elif isinstance(value, list) and value and not path and all(isinstance(item, dict) for item in value):
            for item in value:
                below += ["", f"[[{heading}]]", *_toml_pairs(item)]
        else:
            lines += _toml_pairs({key: value})
    return lines + below


def _toml_pairs(table) -> list[str]:
    return [f"{_toml_key(key)} = {_toml_value(value)}" for key, value in table.items()]


def _toml_key(key) -> str:
    return key if key.isascii() and key.replace("-", "").replace("_", "").isalnum() else _toml_value(key)


def _toml_value(value) -> str:
    """A value on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # The escapes of JSON are those of TOML, which wants DEL escaped besides, and no pairs of surrogates.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, dict):
        return "{" + ", ".join(_toml_pairs(value)) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml_value, value)) + "]"
    return repr(float(value) if isinstance(value, float) else value)
