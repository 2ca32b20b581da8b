"""The table of file formats: what each is called, who reads it, and which files it may name.

Loading, the command line, its help and every message ask this table. A new format is one entry:

    register(Format(name="tri", reader="my_package.tri:read_tri"))

A reader of a model takes a `ModelFile`, and returns a list of parts or `Contents`; that of a scene file is called as
`scene_file.read_scene` is. This module imports neither numpy nor a reader, so that help is printed at once.
"""

import os
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from ..errors import ModelError, SceneError, shown


class Format(NamedTuple):
    """Describe a file format.

    Parameters
    ----------
    name : text in lower case, what `format=` and messages call it
    reader : text "module:function", imported when a file of the format is first read
    suffixes : of files, in lower case without a dot; None = the name alone
    is_scene : whether a file is a whole scene, instead of a model
    is_binary : whether it can't be given as a file object of text
    companions : text, what other files a file may name; empty = none
    up : text, the up axis of its models
    repeats_vertices : whether vertices at one position are to be joined where normals are averaged: files repeat
        those at which texture coordinates or colours change. False = there are none, or the reader has joined them
    """

    name: str
    reader: str
    suffixes: tuple[str, ...] | None = None
    is_scene: bool = False
    is_binary: bool = False
    companions: str = ""
    up: str = "y"
    repeats_vertices: bool = True

    def read(self) -> Callable:
        """Return the reader."""
        module, _, function = self.reader.partition(":")
        return getattr(import_module(module), function)


_SCENE = {"reader": "rasterizer.io.scene_file:read_scene", "is_scene": True, "companions": "models, arrays, textures"}
_GLTF = {"reader": "rasterizer.io.gltf:read_gltf", "companions": "buffers, textures"}

FORMATS = {
    each.name: each
    for each in (
        Format(name="obj", reader="rasterizer.io.obj:read_obj", companions="material libraries (.mtl), textures"),
        Format(name="stl", reader="rasterizer.io.stl_off:read_stl", up="z", repeats_vertices=False),
        Format(name="ply", reader="rasterizer.io.ply:read_ply", companions="textures"),
        Format(name="off", reader="rasterizer.io.stl_off:read_off"),
        Format(name="glb", **_GLTF, is_binary=True),
        Format(name="gltf", **_GLTF),
        Format(name="3mf", reader="rasterizer.io.threemf:read_3mf", up="z", is_binary=True),
        Format(name="json", **_SCENE),
        Format(name="toml", **_SCENE),
    )
}


def register(entry: Format) -> None:
    """Add a format to the table; SceneError where its name or a suffix of it is that of another."""
    for word in (entry.name, *(entry.suffixes or ())):
        if find(word) is not None:
            raise SceneError(f"the format '{entry.name}' can't be added: '{word}' is taken by '{find(word).name}'")
    FORMATS[entry.name] = entry


def names(*, is_scene: bool | None = None) -> tuple[str, ...]:
    """Return the names of the formats of scene files, of models, or (None) of both."""
    return tuple(each.name for each in FORMATS.values() if is_scene in (None, each.is_scene))


def find(word: str) -> Format | None:
    """Return the format of a name or suffix, whatever its capitals, with a dot or without; None where there is none."""
    word = word.lower().removeprefix(".")
    found = FORMATS.get(word)
    return found or next((each for each in FORMATS.values() if word in (each.suffixes or ())), None)


def format_of(name: str, wanted: str | None, *, is_scene: bool | None = None) -> Format:
    """Return the format of a file.

    Parameters
    ----------
    name : the file's name
    wanted : name of the format; None = by the suffix of the file's name
    is_scene : whether only those of scene files are legal, or of models; None = both

    Raises
    ------
    ModelError : no legal format, or no suffix that tells it
    SceneError : `wanted` is no text
    """
    legal = ", ".join(names(is_scene=is_scene))
    if wanted is not None and not isinstance(wanted, str):
        raise SceneError(f"format must be text, one of {legal}; given {shown(wanted)}")
    word = Path(name).suffix if wanted is None else wanted
    found = find(word)
    if found is not None and is_scene in (None, found.is_scene):
        return found
    if word.removeprefix("."):
        from .other_formats import hint_for_suffix

        what = f"format '{word.lower().removeprefix('.')}'" + " of a scene file" * (is_scene is True)
        raise ModelError(f"{name}: unknown {what}; readable are {legal}{hint_for_suffix(word)}")
    if wanted is None and os.path.isdir(name):
        raise ModelError(f"{name}: a folder, not a model")
    raise ModelError(f"{name}: the format is unknown without a suffix; give format=, one of {legal}")
