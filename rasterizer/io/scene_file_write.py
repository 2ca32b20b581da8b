"""Write a scene to a file that `scene_file.read_scene` reads: JSON, arrays and textures in files beside it.

    scene.json             meshes, materials, lights, camera: numbers in full, so that they come back as they were
    scene.npz              the arrays of all meshes, and textures that are not 8 bits a channel
    scene-texture0.png     the other textures

All are written in full under other names first, and then renamed, the scene file last.
"""

import io
import json
import os
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np

from ..errors import SceneError, shown
from ..keywords import checked_keywords
from ..scene.lights import light_type_of
from ..scene.material import Material
from ..scene.scene import Scene
from ..scene.spectrum import Spectrum
from ..scene.texture import Texture
from .files import write_all
from .scene_file import ARRAYS, TEXTURES


@checked_keywords
def save(scene: Scene, path: str | os.PathLike[str]) -> Path:
    """Write a scene to a file that `load` reads: the same meshes, lights, materials, camera, background, depth cue come
    back.

    Arrays are written beside it as NAME.npz and textures as NAME-texture0.png, or into the .npz where they are no 8-bit
    pictures; files of these names are replaced. Each file appears whole or not at all.

    Parameters
    ----------
    scene : Scene
    path : where to; NAME.json

    Returns
    -------
    Path, the same as given

    Raises
    ------
    SceneError : what is no Scene, another suffix
    OutputError : a file can't be written
    """
    if not isinstance(scene, Scene):
        raise SceneError(f"what is saved must be a Scene; given {shown(scene)}")
    if not isinstance(path, (str, os.PathLike)):
        raise SceneError(f"a scene is saved to a path; given {shown(path)}")
    path = Path(path)
    if path.suffix.lower() != ".json":
        raise SceneError(f"a scene is saved as .json; given {shown(path.name)}")
    beside = _Beside(path.stem)
    text = json.dumps(_tables(scene, beside), indent=1, allow_nan=False) + "\n"
    contents = beside.contents() | {path.name: text.encode()}
    write_all({str(path.parent / name): data for name, data in contents.items()})
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
            default = getattr(plain, field.name)
            if field.name == "diffuse":  # not given, it depends on whether there is a texture
                default = Material(texture=material.texture).diffuse
            if field.name in TEXTURES and value is not None:
                table[field.name] = self._texture(value, is_picture=field.name == "texture")
            elif value != default or isinstance(value, Spectrum):
                table[field.name] = _plain(value)
        return table

    def _texture(self, texture, is_picture) -> dict:
        """The table of a texture; it is written once, as a picture where one is decoded to it again."""
        number = self._textures.setdefault((id(texture), is_picture), len(self._textures))
        rest = {"filter": texture.filter, "wrap": list(texture.wrap), "name": texture.name}
        name = f"{self._stem}-texture{number}.png"
        if name not in self.pictures and f"texture{number}" not in self.arrays:
            pixels = texture.encoded if is_picture else None
            if pixels is not None and np.array_equal(Texture(pixels).image, texture.image):
                self.pictures[name] = _png(pixels)
            else:
                self.arrays[f"texture{number}"] = texture.image
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
    table = {name: _plain(getattr(scene, name)) for name in ("up", "background", "depth_cue", "camera")}
    lights = [{"kind": light_type_of(light)} | _plain(light) for light in scene.lights]
    table |= {"materials": beside.materials, "meshes": meshes, "lights": lights}
    return {key: value for key, value in table.items() if value is not None}


def _plain(value):
    """A value as JSON has it: a dataclass as the table of its fields that aren't None; a spectrum as one, too."""
    if isinstance(value, Spectrum):
        return {"wavelengths": value.wavelengths.tolist(), "values": value.values.tolist()}
    if not is_dataclass(value):
        return list(value) if isinstance(value, tuple) else value
    table = {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if table.get("intrinsics") is not None:
        table["fov"] = None  # of a camera's calibration: it follows from that
    return {key: each for key, each in table.items() if each is not None}


def _png(pixels) -> bytes:
    from PIL import Image  # takes long to import; most scenes have no textures

    stream = io.BytesIO()
    Image.fromarray(pixels[..., 0] if pixels.shape[2] == 1 else pixels).save(stream, "PNG")
    return stream.getvalue()
