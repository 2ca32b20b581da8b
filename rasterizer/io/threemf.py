"""Read 3MF: a zip file with a model in XML.

    3D/3dmodel.model     resources: objects, each a mesh or a list of components (other objects, placed)
                         build: objects, placed
    the part of a path   a component may name an object of another .model part of the file (production extension)

Matrices have 12 numbers, the columns of the affine one: the first three are where x goes. Colours etc. aren't read.
The zip's directory tells how large each part is before one is unpacked; a document type (entities) is refused, and
objects may be repeated for up to `gltf.MOST_COPIES` triangles more than the file holds.
Format: 3MF Consortium, Core Specification 1.3, 2021.
"""

import zipfile
import zlib
from array import array
from io import BytesIO
from typing import NamedTuple
from xml.parsers import expat

import numpy as np

from ..scene.material import Material
from .gltf import MOST_COPIES
from .model_file import ModelFile, Part

MOST_UNPACKED = 2**28  # bytes of XML of any file
MOST_RATIO = 40  # of bytes of XML to bytes of the file, beyond MOST_UNPACKED: text of numbers packs to a tenth
_DEEPEST = 100  # components within components
_FAULTS = (
    ValueError,
    LookupError,
    TypeError,
    OSError,
    RuntimeError,
    EOFError,
    ArithmeticError,
    zipfile.BadZipFile,
    zlib.error,
)


class _Item(NamedTuple):
    """An object that is placed: by a component or by the build."""

    part: str
    number: str
    matrix: np.ndarray  # (4, 4)


class _Object:
    """An object: its own triangles, and other objects."""

    def __init__(self, name):
        self.name, self.vertices, self.corners, self.components = name, array("d"), array("q"), []


def read_3mf(model: ModelFile) -> list[tuple[Part, np.ndarray]]:
    """Read a 3MF file.

    Returns
    -------
    pairs (part, world_from_object (4, 4) float64), one for each time that a mesh is built

    Raises ModelError for a file that is damaged, or asks for too much.
    """
    try:
        with zipfile.ZipFile(BytesIO(model.data)) as archive:
            parts = _unpack(archive, len(model.data))
        main = next((name for name in parts if name.lower().endswith("3dmodel.model")), None)
        if main is None:
            raise ValueError("there is no 3D/3dmodel.model in it")
        readers = {name: _Reader(name, text) for name, text in parts.items()}
        return _placed(readers, main)
    except expat.ExpatError as fault:
        raise model.error(f"not a readable 3MF file (its XML: {fault})") from fault
    except _FAULTS as fault:
        reason = " ".join(str(fault).split())[:200] or type(fault).__name__
        raise model.error(f"not a readable 3MF file ({type(fault).__name__}: {reason})") from fault


def _unpack(archive, length) -> dict[str, bytes]:
    """Return the .model parts by name, once their sizes have been looked at."""
    members = [member for member in archive.infolist() if member.filename.lower().endswith(".model")]
    total, limit = sum(member.file_size for member in members), max(MOST_UNPACKED, MOST_RATIO * length)
    if total > limit:
        raise ValueError(f"its models would take {total} bytes; a file of its size may have {limit}")
    if any(member.flag_bits & 1 for member in members):
        raise ValueError("it is encrypted")
    return {member.filename: archive.read(member) for member in members}


class _Reader:
    """Read the objects and the build of one .model part."""

    def __init__(self, name, text):
        self.name, self.objects, self.build, self._open = name, {}, [], None
        parser = expat.ParserCreate(namespace_separator="|")
        parser.StartElementHandler, parser.EndElementHandler = self._start, self._end
        parser.StartDoctypeDeclHandler = self._refuse
        parser.Parse(text, True)

    def _refuse(self, *_):
        raise ValueError("a document type is not legal in 3MF")

    def _start(self, tag, attributes):
        word = tag.rpartition("|")[2]
        if word == "vertex" and self._open:
            self._open.vertices.extend(float(attributes[key]) for key in "xyz")
        elif word == "triangle" and self._open:
            self._open.corners.extend(int(attributes[key]) for key in ("v1", "v2", "v3"))
        elif word == "object":
            self._open = self.objects[attributes["id"]] = _Object(attributes.get("name", ""))
        elif word == "component" and self._open:
            self._open.components.append(self._item(attributes))
        elif word == "item":
            self.build.append(self._item(attributes))

    def _end(self, tag):
        if tag.rpartition("|")[2] == "object":
            self._open = None

    def _item(self, attributes) -> _Item:
        path = next(
            (value.lstrip("/") for key, value in attributes.items() if key.rpartition("|")[2] == "path"), self.name
        )
        return _Item(path, attributes["objectid"], _matrix(attributes.get("transform")))


def _matrix(text) -> np.ndarray:
    """Return the matrix (4, 4) of a transform as it is written."""
    matrix = np.eye(4)
    if text is not None:
        numbers = np.array([float(word) for word in text.split()])
        if numbers.size != 12 or not np.isfinite(numbers).all():
            raise ValueError(f"a transform must have 12 finite numbers; given {text[:60]!r}")
        matrix[:3] = numbers.reshape(4, 3).T
    return matrix


def _placed(readers, main) -> list[tuple[Part, np.ndarray]]:
    """Follow the build down to the meshes."""
    parts, placed, n_copy = {}, [], 0
    names = {name.lower(): name for name in readers}
    waiting = [(item, np.eye(4), 0) for item in reversed(readers[main].build)]
    n_step = 0
    while waiting:
        item, matrix, depth = waiting.pop()
        thing = readers[names[item.part.lower()]].objects[item.number]
        n_step += 1
        n_copy += len(thing.corners) // 3 if (item.part, item.number) in parts else 0
        if depth > _DEEPEST or n_copy > MOST_COPIES or n_step > MOST_COPIES // 64:
            raise ValueError(f"its components are nested more than {_DEEPEST} deep, or repeat too many objects")
        with np.errstate(all="ignore"):
            matrix = matrix @ item.matrix
        if thing.corners:
            key = (item.part, item.number)
            parts.setdefault(key, _part(thing))
            placed.append((parts[key], matrix))
        waiting += [(each, matrix, depth + 1) for each in reversed(thing.components)]
    return placed


def _part(thing) -> Part:
    vertices = np.frombuffer(thing.vertices, np.float64) if thing.vertices else np.empty(0)
    faces = np.frombuffer(thing.corners, np.int64).reshape(-1, 3)
    return {"vertices": vertices.reshape(-1, 3), "faces": faces, "name": thing.name, "material": Material()}
