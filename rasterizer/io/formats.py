"""The table of file formats: what each is called, who reads it, and which files it may name.

Loading, the command line, its help and every message ask this table. A new format is one entry:

    Format(name="tri", reader="rasterizer.io.tri:read_tri")

A reader of a model takes a `ModelFile`, and returns a list of parts or `Contents`; that of a scene file is called as
`scene_file.read_scene` is. This module imports neither numpy nor a reader, so that help is printed at once.
"""

import io
import os
import re
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import ModelError, OutputError, SceneError, shown

if TYPE_CHECKING:
    from PIL import Image


# ----------------------------------------------------------------
# What a file is that can't be read, or isn't what its name says: the hint that goes with the error.
# Only the first bytes are looked at, and only once a reader has failed.

HEAD = 1024  # bytes that are looked at
_CAD = "it holds curved surfaces: export STL, 3MF or OBJ from the CAD program"
_LOOKS_LIKE_A_SCENE = "export glTF (.glb) or OBJ from the program that made it"
_PACKED = "unpack it first"
_CLOUD = "a point cloud has no faces to draw"
_BY_SUFFIX = {
    word: hint
    for words, hint in (
        ("step stp iges igs brep brp sat x_t x_b sldprt sldasm ipt iam f3d fcstd catpart catproduct prt 3dm", _CAD),
        ("fbx blend usd usda usdc usdz max ma mb c4d 3ds x3d wrl vrml lwo skp abc amf vrm", _LOOKS_LIKE_A_SCENE),
        ("zip gz bz2 xz zst 7z rar tar tgz", _PACKED),
        ("pcd las laz e57 pts ptx splat spz", _CLOUD),
        ("toml", "a scene file is written in JSON, with the same keys"),
        ("mtl", "it holds the materials of an .obj file: give that one"),
        ("bin", "it holds the numbers of a .gltf file: give that one"),
        (
            "png jpg jpeg webp tif tiff bmp gif exr npy npz",
            "a picture or an array is no model; outputs stand behind -o",
        ),
    )
    for word in words.split()
}
# What files begin with; where our own name of a format stands, another reader takes it.
_BY_CONTENT = (
    (rb"version https://git-lfs", "the file is a Git LFS pointer, not the model itself: `git lfs pull` fetches it"),
    (rb"(?i)\s*<(!doctype html|html)", "the file is an HTML page, perhaps of a download that failed"),
    (rb"\xff\xfe|\xfe\xff", "the file is text in UTF-16: save it as UTF-8"),
    (rb"\x1f\x8b|BZh|\xfd7zXZ|\x28\xb5\x2f\xfd", f"the file is compressed: {_PACKED}"),
    (rb"ISO-10303-21", f"the file is a STEP file: {_CAD}"),
    (rb"Kaydara FBX|; FBX", f"the file is an FBX file: {_LOOKS_LIKE_A_SCENE}"),
    (rb"BLENDER", f"the file is a Blender file: {_LOOKS_LIKE_A_SCENE}"),
    (rb"(?s)\s*<.{0,400}<?COLLADA", "dae"),
    (rb"glTF", "glb"),
    (rb"ply\s", "ply"),
    (rb"(?s)PK\x03\x04.{26,200}?(3D/|_rels|\[Content_Types)", "3mf"),
    (rb"(?s)PK\x03\x04.{26,200}?(Manifest\.xml|\.3dxml|\.3DRep)", "3dxml"),
    (rb"(?s)PK\x03\x04.{26,200}?\.dae", "zae"),
    (rb"PK\x03\x04", f"the file is a ZIP archive: {_PACKED}"),
    (rb"(\s|#[^\n]*\n)*(ST|C|N)*4?n?OFF[\s\d]", "off"),
    (rb"(?si)\s*solid\b.*\b(facet|endsolid)\b", "stl"),
    (rb"(?s)\s*\{.*\"(asset|accessors|bufferViews|meshes)\"", "gltf"),
    (rb"(?s)(#[^\n]*\n|\s)*((mtllib|o|g) [^\n]+\n(#[^\n]*\n|\s)*)*v[ \t]+[-+.\d]", "obj"),
)


def hint_for_content(data: bytes, format: str) -> str:
    """Return what a file is by its first bytes, as "; what it is".

    Parameters
    ----------
    data : the file's bytes
    format : name of the format that it was read as, without success

    Returns
    -------
    text, empty where the bytes tell nothing else than the name
    """
    head = bytes(data[:HEAD])
    found = next((what for pattern, what in _BY_CONTENT if re.match(pattern, head)), None)
    if found is None and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little") > 84:
        found = "stl"
    if found is None or found == format:
        return ""
    if " " in found:
        return f"; {found}"
    return f"; by its content it is {found}: --input-format {found}, or format='{found}'"


class Format(NamedTuple):
    """Describe a file format.

    Parameters
    ----------
    name : text in lower case, what `format=`, messages and suffixes of files call it
    reader : text "module:function", imported when a file of the format is first read
    is_scene : whether a file is a whole scene, instead of a model
    is_binary : whether it can't be given as a file object of text
    up : text, the up axis of its models
    repeats_vertices : whether vertices at one position are to be joined where normals are averaged: files repeat
        those at which texture coordinates or colours change. False = there are none, or the reader has joined them
    in_parts : whether the reader takes `LongFile` in the place of bytes, so that a file need not fit into memory
    packages : tuples of names of packages, all of one of which the reader imports beside what is required; the extra
        `formats` brings them. Empty = none
    """

    name: str
    reader: str
    is_scene: bool = False
    is_binary: bool = False
    up: str = "y"
    repeats_vertices: bool = True
    in_parts: bool = False
    packages: tuple[tuple[str, ...], ...] = ()

    @property
    def missing(self) -> tuple[str, ...]:
        """The packages that must be installed before files of the format can be read; none of them is imported."""
        if not self.packages:
            return ()
        absent = [tuple(name for name in names if find_spec(name) is None) for names in self.packages]
        return min(absent, key=len)

    def read(self) -> Callable:
        """Return the reader."""
        module, _, function = self.reader.partition(":")
        return getattr(import_module(module), function)


_COLLADA = {"reader": "rasterizer.io.dae:read_dae", "packages": (("collada",),)}
_GLTF = {"reader": "rasterizer.io.gltf:read_gltf"}

FORMATS = {
    each.name: each
    for each in (
        Format(name="obj", reader="rasterizer.io.obj:read_obj"),
        Format(name="stl", reader="rasterizer.io.stl:read_stl", up="z", repeats_vertices=False, in_parts=True),
        Format(name="ply", reader="rasterizer.io.ply:read_ply"),
        Format(name="off", reader="rasterizer.io.off:read_off"),
        Format(name="glb", **_GLTF, is_binary=True),
        Format(name="gltf", **_GLTF),
        Format(
            name="3mf",
            reader="rasterizer.io.threemf:read_3mf",
            up="z",
            is_binary=True,
            packages=(("lib3mf",), ("lxml", "networkx")),
        ),
        Format(name="dae", **_COLLADA),
        Format(name="zae", **_COLLADA, is_binary=True),
        Format(
            name="3dxml",
            reader="rasterizer.io.other_formats:read_3dxml",
            is_binary=True,
            packages=(("lxml", "networkx"),),
        ),
        Format(name="xaml", reader="rasterizer.io.other_formats:read_xaml", packages=(("lxml",),)),
        Format(
            name="json",
            reader="rasterizer.io.scene_file:read_scene",
            is_scene=True,
        ),
    )
}


_BY = {  # whose package reads a format, where it is not our own
    "3mf": "lib3mf or trimesh", "dae": "pycollada", "zae": "pycollada", "3dxml": "trimesh", "xaml": "trimesh",
}  # fmt: skip


def formats() -> list[dict[str, Any]]:
    """Return what is known of each format that can be loaded, one after the other.

    Returns
    -------
    list of dict: name; suffixes; reads ("model" or "scene"); by, the package that reads it ("rasterizer", "trimesh",
    "pycollada" or "lib3mf or trimesh"); needs, packages that are missing; is_readable, whether none is
    """
    found = []
    for entry in FORMATS.values():
        missing = entry.missing
        found.append(
            {
                "name": entry.name,
                "suffixes": [f".{entry.name}"],
                "reads": "scene" if entry.is_scene else "model",
                "by": _BY.get(entry.name, "rasterizer"),
                "needs": list(missing),
                "is_readable": not missing,
            }
        )
    return found


def find(word: str) -> Format | None:
    """Return the format of a name or suffix, whatever its capitals, with a dot or without; None where there is none."""
    return FORMATS.get(word.lower().removeprefix("."))


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
    word = Path(name).suffix if wanted is None else wanted
    found = find(word) if isinstance(word, str) else None
    if found is not None and is_scene in (None, found.is_scene):
        return found
    legal = ", ".join(each.name for each in FORMATS.values() if is_scene in (None, each.is_scene))
    if not isinstance(word, str):
        raise SceneError(f"format must be text, one of {legal}; given {shown(wanted)}")
    if word := word.lower().removeprefix("."):
        what = f"format '{word}'" + " of a scene file" * (is_scene is True)
        hint = f"; {_BY_SUFFIX[word]}" if word in _BY_SUFFIX else ""
        raise ModelError(f"{name}: unknown {what}; readable are {legal}{hint}")
    if wanted is None and os.path.isdir(name):
        raise ModelError(f"{name}: a folder, not a model")
    raise ModelError(f"{name}: the format is unknown without a suffix; give format=, one of {legal}")


# ----------------------------------------------------------------
# Formats of pictures, by name or suffix: what Pillow writes, and what is written without it.

_OWN_FORMATS = {"PNG": "PNG", "TIF": "TIFF", "TIFF": "TIFF"}


def picture_format(name: str) -> str:
    """Return Pillow's name of a format that it writes, given by name or suffix; OutputError if none."""
    if not isinstance(name, str):
        raise SceneError(f"format must be text; given {shown(name)}")
    word = name.upper().lstrip(".")
    if word in _OWN_FORMATS:
        return _OWN_FORMATS[word]  # without importing Pillow, which takes as long as to encode
    from PIL import Image

    Image.init()
    found = Image.EXTENSION.get(f".{word.lower()}", word)
    if found in Image.SAVE:
        return found
    common = "png, jpg, webp, tif, bmp, ppm"
    given = f"{name!r} is unknown" if word else "a file without a suffix has none"
    raise OutputError(f"no format to write: {given}; legal are npy, {common} and others that Pillow writes")


def encoded(image: "Image.Image", name: str, options: dict[str, Any]) -> bytes:
    """Return a `PIL.Image` as the bytes of a file; `name` is Pillow's of the format, `options` are passed on."""
    stream = io.BytesIO()
    image.save(stream, name, **options)
    return stream.getvalue()


def on_white(image: "Image.Image") -> "Image.Image":
    """Return an RGBA picture laid on white, as RGB."""
    from PIL import Image

    paper = Image.new("RGBA", image.size, "white")
    paper.alpha_composite(image)
    return paper.convert("RGB")
