"""Read 3MF: a zip file with a model in XML.

    _rels/.rels          names the part to begin with, as a rule this one:
    3D/3dmodel.model     resources: objects, each a mesh or a list of components (other objects, placed)
                         build: objects, placed
    the part of a path   a component may name an object of another .model part of the file (production extension)

Matrices have 12 numbers, the columns of the affine one: the first three are where x goes. Colours, materials and
textures: see `threemf_properties`. Lengths are in the file's unit, which is said.
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

from ..errors import ModelError
from .gltf import MOST_COPIES
from .model_file import Contents, ModelFile, Part
from .threemf_properties import UNSET, PropertyGroups, paint

MOST_UNPACKED = 2**28  # bytes of XML of any file
MOST_RATIO = 40  # of bytes of XML to bytes of the file, beyond MOST_UNPACKED: text of numbers packs to a tenth
_DEEPEST = 100  # components within components
_IGNORED = ("beamlattice", "slicestack", "displacementmesh", "booleans", "volumetricstack", "levelset")
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

    def __init__(self, attributes):
        self.name, self.attributes = attributes.get("name", ""), attributes
        self.vertices, self.corners, self.components = array("d"), array("q"), []
        self.marks = array("q")  # of triangles with properties of their own: triangle, group, a property a corner


def read_3mf(model: ModelFile) -> Contents:
    """Read a 3MF file.

    Returns
    -------
    Contents whose parts are pairs (part, world_from_object (4, 4) float64), one for each time that a mesh is built

    Raises ModelError for a file that is damaged, or asks for too much.
    """
    try:
        with zipfile.ZipFile(BytesIO(model.data)) as archive:
            parts = _unpack(archive, len(model.data))
            main, left_out = _find_start(archive, parts), set()

            def read(name):
                return _read_member(archive, name)

            readers = {
                name: _Reader(name, text, PropertyGroups(read, left_out, model.name)) for name, text in parts.items()
            }
            placed = _placed(readers, main)
    except expat.ExpatError as fault:
        raise model.error(f"not a readable 3MF file (its XML: {fault})") from fault
    except ModelError as fault:
        raise model.error(str(fault)) from fault
    except _FAULTS as fault:
        reason = " ".join(str(fault).split())[:200] or type(fault).__name__
        raise model.error(f"not a readable 3MF file ({reason})") from fault
    others = sorted({f"'{word}' elements" for reader in readers.values() for word in reader.ignored})
    unit = readers[main].unit
    return Contents(placed, facts=(f"unit {unit}",), left_out=(*sorted(left_out), *others))


def _read_member(archive, name) -> bytes:
    """Return a file in the zip file, whatever the case of its name."""
    member = next((each for each in archive.infolist() if each.filename.lower() == name.lower()), None)
    if member is None:
        raise LookupError(f"there is no '{name[:80]}' in it")
    if member.file_size > MOST_UNPACKED:
        raise ValueError(f"'{name[:80]}' would take {member.file_size} bytes; {MOST_UNPACKED} are the most")
    return archive.read(member)


def _unpack(archive, length) -> dict[str, bytes]:
    """Return the .model parts by name, once their sizes have been looked at."""
    members = [member for member in archive.infolist() if member.filename.lower().endswith(".model")]
    total, limit = sum(member.file_size for member in members), max(MOST_UNPACKED, MOST_RATIO * length)
    if total > limit:
        raise ValueError(f"its models would take {total} bytes; a file of its size may have {limit}")
    if any(member.flag_bits & 1 for member in members):
        raise ValueError("it is encrypted")
    return {member.filename: archive.read(member) for member in members}


def _find_start(archive, parts) -> str:
    """Return the name of the part to begin with: what the file's relationships say, or the usual name.

    Format: ISO/IEC 29500-2, Open Packaging Conventions, 2021, 6.5.
    """
    targets = []

    def take(tag, attributes):
        if tag.rpartition("|")[2] == "Relationship" and attributes.get("Type", "").endswith("/3dmodel"):
            targets.append(attributes.get("Target", "").lstrip("/"))

    try:
        _parse(_read_member(archive, "_rels/.rels"), take)
    except LookupError:
        pass  # it should be there; the model is found without it
    names = {name.lower(): name for name in parts}
    usual = [name for name in names if name.endswith("3dmodel.model")]
    for name in (*(target.lower() for target in targets), *usual):
        if name in names:
            return names[name]
    raise ValueError(f"there is no {targets[0][:80] if targets else '3D/3dmodel.model'} in it")


def _parse(text, start, end=None) -> None:
    """Read XML: call `start` with the name of each element and its attributes, and `end` with its name."""

    def begin(tag, attributes):
        try:
            start(tag, attributes)
        except KeyError as fault:
            raise ValueError(f"a '{tag.rpartition('|')[2][:40]}' element has no {fault}") from fault

    parser = expat.ParserCreate(namespace_separator="|")
    parser.StartElementHandler, parser.EndElementHandler, parser.StartDoctypeDeclHandler = begin, end, _refuse
    parser.Parse(text, True)


def _refuse(*_):
    raise ValueError("a document type is not legal in 3MF")


class _Reader:
    """Read the objects, properties and build of one .model part."""

    def __init__(self, name, text, properties):
        self.name, self.objects, self.build, self._open = name, {}, [], None
        self.properties, self.groups, self.unit, self.ignored = properties, [], "millimeter", set()
        self._numbers = {}  # of the groups that triangles name, in `groups`
        _parse(text, self._start, self._end)

    def _start(self, tag, attributes):
        word = tag.rpartition("|")[2]
        if word == "vertex" and self._open:
            self._open.vertices.extend(float(attributes[key]) for key in "xyz")
        elif word == "triangle" and self._open:
            self._open.corners.extend(int(attributes[key]) for key in ("v1", "v2", "v3"))
            if "p1" in attributes or "pid" in attributes:
                self._mark(attributes)
        elif word == "object":
            self._open = self.objects[attributes["id"]] = _Object(attributes)
        elif word == "component" and self._open:
            self._open.components.append(self._item(attributes))
        elif word == "item":
            self.build.append(self._item(attributes))
        elif word == "model":
            self.unit = attributes.get("unit", self.unit)[:20]
        elif word in _IGNORED:
            self.ignored.add(word)
        else:
            self.properties.start(word, attributes)

    def _mark(self, attributes):
        """Note the properties of a triangle; what it doesn't say, its object does."""
        own = self._open.attributes
        first = int(attributes.get("p1", own.get("pindex", 0)))
        others = (int(attributes.get(key, first)) for key in ("p2", "p3"))
        group = self.number_of(attributes.get("pid", own.get("pid")))
        self._open.marks.extend((len(self._open.corners) // 3 - 1, group, first, *others))

    def number_of(self, group) -> int:
        """Return the number by which triangles know a group of properties; UNSET for none."""
        if group is None:
            return UNSET
        if group not in self._numbers:
            self._numbers[group] = len(self.groups)
            self.groups.append(group)
        return self._numbers[group]

    def _end(self, tag):
        word = tag.rpartition("|")[2]
        if word == "object":
            self._open = None
        self.properties.end(word)

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
        reader = readers.get(names.get(item.part.lower(), ""))
        if reader is None:
            raise ValueError(f"there is no part '{item.part[:80]}' in it")
        if item.number not in reader.objects:
            raise ValueError(f"there is no object '{item.number[:40]}' in '{reader.name[:80]}'")
        thing = reader.objects[item.number]
        n_step += 1
        n_copy += len(thing.corners) // 3 if (item.part, item.number) in parts else 0
        if depth > _DEEPEST or n_copy > MOST_COPIES or n_step > MOST_COPIES // 64:
            raise ValueError(f"its components are nested more than {_DEEPEST} deep, or repeat too many objects")
        with np.errstate(all="ignore"):
            matrix = matrix @ item.matrix
        if thing.corners:
            key = (item.part, item.number)
            if key not in parts:
                parts[key] = _part(thing, reader)
            placed.append((parts[key], matrix))
        waiting += [(each, matrix, depth + 1) for each in reversed(thing.components)]
    return placed


def _part(thing, reader) -> Part:
    """Make the part of an object's own triangles."""
    vertices = np.frombuffer(thing.vertices, np.float64) if thing.vertices else np.empty(0)
    faces = np.frombuffer(thing.corners, np.int64).reshape(-1, 3)
    own = thing.attributes
    groups = np.full(len(faces), reader.number_of(own.get("pid")))
    indices = np.full((len(faces), 3), int(own.get("pindex", 0)))
    if thing.marks:
        marks = np.frombuffer(thing.marks, np.int64).reshape(-1, 5)
        groups[marks[:, 0]], indices[marks[:, 0]] = marks[:, 1], marks[:, 2:]
    used = [number for number in np.unique(groups).tolist() if number != UNSET]
    properties = {number: reader.properties.find(reader.groups[number]) for number in used}
    look = paint(len(faces), properties, groups, indices)
    return {"vertices": vertices.reshape(-1, 3), "faces": faces, "name": thing.name, **look}
