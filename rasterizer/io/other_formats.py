"""Read what trimesh reads and we don't: 3DXML, XAML, and the shapes of 3MF.

    bytes ─ checks ─ trimesh's reader ─ its arrays, graph and materials ─ parts, placed by their nodes

trimesh gets bytes that we opened, and is imported only then. Its readers trust a file; so what they would spend is
looked at before. A zip file's members are unpacked and counted by us. XML has no document type, and may have so many
elements that its tree fits into memory. Nodes that show others are counted as often as they are shown. Textures are
looked for by the rules of `files.py` and read by us: trimesh gets a picture of one pixel in their place, whose colour
says which one it stands for.

Only the readers of trimesh are used, not its `load`: that would join vertices and take those that are no numbers away.
Left alone are what is no mesh (DXF, SVG, XYZ, binvox), what only a native library with no limits reads (STEP, CTM), and
meshio's formats, which trimesh gives up in 2027.
"""

import logging
import re
import threading
import zipfile
import zlib
from collections.abc import Iterable
from functools import cache
from io import BytesIO
from urllib.parse import unquote
from xml.parsers import expat

import numpy as np

from ..errors import ModelError, cut
from ..scene.material import WHITE, Material
from ..scene.of_gltf import lit_fields
from ..scene.texture import Texture, read_picture
from .files import unpack
from .model_file import LEAST_TEXT, Contents, ModelFile, Part, bytes_of, most, name_in, numbers_in

DEEPEST = 100  # nodes within nodes
_TREE = 3  # times as many bytes as may be made of a file that the trees of its XML may take
_ELEMENT, _ATTRIBUTE = 140, 280  # bytes that libxml2 takes for one
_LEAST_SEARCH = 2**20  # nodes that trimesh looks at for all shapes of any 3DXML file
_LAYERED = {"multiproperties": "pids", "compositematerials": "matindices"}
LAYER = 64  # bytes of a colour in a layer
_TRIANGLE = 24  # bytes, of its corners' numbers
_FACE = re.compile(rb"<(\w+:|)Face([\s/>])")


def read_3dxml(model: ModelFile) -> Contents:
    """Read 3DXML of Dassault's programs: tessellated meshes in XML, with the colours of faces or textures."""
    members = unpacked(model)
    documents = {name: text for name, text in members.items() if text.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] == b"<"}
    check_tree(model, *documents.values())
    graph = Graph(model)
    edge, n_shape = {}, 0

    def start(word, attributes, above):
        nonlocal n_shape
        if word in ("Instance3D", "InstanceRep"):
            edge.clear()
        elif word == "ReferenceRep":
            n_shape += 1
        elif word == "ProductStructure":
            graph.add(attributes["root"], None)

    def characters(word, piece, above):
        if word in ("IsAggregatedBy", "IsInstanceOf"):
            edge[word] = edge.get(word, "") + piece
            if len(edge) == 2:
                graph.add(edge["IsInstanceOf"], edge["IsAggregatedBy"])
                edge.clear()

    for text in documents.values():
        graph.scan(text, start, characters, ())
    n_node = graph.check()
    if n_node * n_shape > _LEAST_SEARCH + len(model.data):  # trimesh looks for each shape in all of them
        raise model.error("its nodes show too many shapes")
    pictures = Pictures(model, lambda name: member_of(members, name))
    stand_ins = {name: pictures.get(name) for name in members if name not in documents}
    # Of several faces in one list trimesh takes the first again with each of the others: each gets a list of its own.
    apart = {name: _FACE.sub(rb"</\1Faces><\1Faces><\1Face\2", text) for name, text in documents.items()}
    return _contents_of(model, _read(model, "3dxml", packed(apart | stand_ins), apart.values(), pictures), pictures)


def read_xaml(model: ModelFile) -> Contents:
    """Read XAML of three dimensions, as SolidWorks writes it: meshes with a colour each."""
    check_tree(model, model.data)
    graph = Graph(model)

    def start(word, attributes, above):
        if word == "GeometryModel3D":
            if above is not None:
                raise ValueError("a GeometryModel3D stands within another")
            graph.open("model", None)

    graph.scan(model.data, start, None, ("GeometryModel3D",))
    return _contents_of(model, _read(model, "xaml", model.data, [model.data]))


def check_3mf(model: ModelFile, members: dict[str, bytes]) -> tuple[str, bool, bool]:
    """Count what the objects of a 3MF file show, and how many colours its layers have: both of its readers follow all
    of it.

    Returns
    -------
    the unit, whether triangles have looks, and whether parts in other members are shown
    """
    graph, unit, has_looks, has_paths, member = Graph(model), "millimeter", False, False, ""
    n_layer = 0

    def start(word, attributes, above):
        nonlocal unit, has_looks, has_paths, n_layer
        if word == "model":
            unit = attributes.get("unit", unit)[:20]
        elif word == "object":
            graph.open(f"{member}#{attributes['id']}", above)
        elif word in ("component", "item"):
            path = next((value for key, value in attributes.items() if key.rpartition("|")[2] == "path"), member)
            has_paths = has_paths or path != member
            graph.add(f"{path.lstrip('/').lower()}#{attributes['objectid']}", above)
        elif word == "triangle":
            graph.weigh(above, 1)
        elif word in _LAYERED:
            n_layer = len(attributes.get(_LAYERED[word], "").split())
        elif word in ("multi", "composite"):  # each has one number for each layer, also where it says none
            model.limits.count_bytes(LAYER * n_layer)
        has_looks = has_looks or "pid" in attributes

    for name, text in members.items():
        if name.lower().endswith(".model"):
            member = name.lower()
            graph.scan(text, start, None, ("object",))
    graph.check()
    return unit, has_looks, has_paths


def read_by_trimesh(model: ModelFile, members: dict[str, bytes]) -> Contents:
    """Read the shapes of a 3MF file, whose parts stand in 3D/3dmodel.model alone."""
    unit, has_looks, has_paths = check_3mf(model, members)
    if has_paths:
        raise model.error("it has parts in other files, which lib3mf alone reads")
    name = next((name for name in members if name.lower() == "3d/3dmodel.model"), None)
    if name is None:
        raise model.error("there is no 3D/3dmodel.model in it")
    check_tree(model, members[name])
    data = packed({"3D/3dmodel.model": members[name]})
    contents = _contents_of(model, _read(model, "3mf", data, [members[name]], postprocess=False))
    return contents._replace(facts=(f"unit {unit}",), left_out=("colours and materials",) if has_looks else ())


# --- before trimesh gets it -------------------------------------------------------------------------------------------


def unpacked(model: ModelFile) -> dict[str, bytes]:
    """Return the members of a zip file by name; ModelError where it is damaged, or they are too long."""
    try:
        return unpack(model.data, most(len(model.data), LEAST_TEXT))
    except (ValueError, LookupError, OSError, RuntimeError, EOFError, zipfile.BadZipFile, zlib.error) as fault:
        raise model.error(f"not a readable {model.format} file ({cut(fault) or type(fault).__name__})") from fault


def packed(members: dict[str, bytes]) -> bytes:
    """Return a zip file of members that have been counted."""
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name), data)
    return stream.getvalue()


def check_tree(model, *texts: bytes) -> None:
    """Raise ModelError where the trees of XML documents wouldn't fit into memory."""
    cost = sum(2 * len(text) + _ELEMENT * text.count(b"<") + _ATTRIBUTE * text.count(b"=") for text in texts)
    if cost > _TREE * most(len(model.data)):
        raise model.error(f"its XML would take some {cost / 1e6:.0f} MB, too much for a file of its size")


class Graph:
    """Count what the nodes of XML documents show, each as often as it is shown, before anybody follows them.

    Parameters
    ----------
    model : ModelFile, for messages and limits

    Attributes
    ----------
    n_opened : how many nodes have been opened
    """

    def __init__(self, model: ModelFile) -> None:
        self.model, self.n_opened = model, 0
        self._children: dict[str, list[str]] = {}
        self._weights: dict[str, int] = {}
        self._roots: list[str] = []
        self._stack: list[str] = []

    def scan(self, text: bytes, start, characters, names: tuple[str, ...]) -> None:
        """Go through a document once.

        Parameters
        ----------
        text : the document
        start : function of an element's name, its attributes, and the name of the node that it is in
        characters : function of an element's name, a piece of its text, and that node; None = text doesn't count
        names : of the elements that are nodes: `start` opens one for each of them

        Raises ModelError for what is no XML, or has a document type, whose entities may be anything.
        """
        open_words = []

        def begin(tag, attributes):
            open_words.append(tag.rpartition("|")[2])
            start(open_words[-1], attributes, self._stack[-1] if self._stack else None)

        def end(_):
            if open_words.pop() in names:
                self._stack.pop()

        def take(piece):
            characters(open_words[-1], piece, self._stack[-1] if self._stack else None)

        parser = expat.ParserCreate(namespace_separator="|")
        parser.StartElementHandler, parser.EndElementHandler, parser.StartDoctypeDeclHandler = begin, end, _refuse
        if characters is not None:
            parser.CharacterDataHandler, parser.buffer_text = take, True
        try:
            parser.Parse(text, True)
        except expat.ExpatError as fault:
            raise self.model.error(f"not a readable {self.model.format} file (its XML: {cut(fault)})") from fault
        except ModelError:
            raise
        except KeyError as fault:
            raise self.model.error(f"a '{open_words[-1][:40]}' element has no {cut(fault)}") from fault
        except (ValueError, LookupError) as fault:  # of an encoding that there is not
            raise self.model.error(fault) from fault

    def open(self, name: str, above: str | None) -> None:
        """Begin a node within another, or None; its elements are in it until it ends."""
        self.n_opened += 1
        self.add(name, above)
        self._stack.append(name)

    def add(self, name: str, above: str | None) -> None:
        """Let a node show another one."""
        if above is None:
            self._roots.append(name)
        else:
            self._children.setdefault(above, []).append(name)

    def weigh(self, name: str | None, n: int) -> None:
        """Add triangles to a node."""
        if name is not None:
            self._weights[name] = self._weights.get(name, 0) + n

    def check(self) -> int:
        """Return how many nodes are shown; ModelError where they are nested too deeply, or show too much."""
        counted: dict[str, tuple[int, int]] = {}

        def count(name, depth) -> tuple[int, int]:
            if depth > DEEPEST:
                raise self.model.error(f"its nodes are nested more than {DEEPEST} deep")
            if name not in counted:
                below = [count(child, depth + 1) for child in self._children.get(name, ())]
                counted[name] = 1 + sum(n for n, _ in below), self._weights.get(name, 0) + sum(n for _, n in below)
            return counted[name]

        totals = [count(name, 0) for name in self._roots]
        n_node, n_triangle = sum(n for n, _ in totals), sum(n for _, n in totals)
        self.model.limits.count_meshes(n_node)
        self.model.limits.count_bytes(_TRIANGLE * n_triangle)
        return n_node


def _refuse(*_):
    raise ValueError("its XML has a document type, which may be anything, and is not read")


# --- trimesh ----------------------------------------------------------------------------------------------------------


class _Log(logging.Handler):
    """Keep what trimesh warns of, in one thread."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts, self._thread = [], threading.get_ident()

    def emit(self, record: logging.LogRecord) -> None:
        """Take a warning."""
        if record.thread == self._thread:
            self.texts.append(cut(record.getMessage()))


_NUMBERS = re.compile(
    rb"\b(?:x|y|z|v[123]|Positions|TriangleIndices|Normals|triangles|strips|fans)\s*=\s*[\"']([^\"']*)"
    rb"|<(?:\w+:)?(?:Positions|Normals)\b[^<>]*>([^<]*)"
)


def check_numbers(model, format: str, texts: Iterable[bytes]) -> None:
    """Raise ModelError for the first text that holds anything but numbers and blanks."""
    for text in texts:
        if numbers_in(text) is None:
            what = f"numbers are wanted where other text stands: '{cut(text.decode('utf-8', 'replace'), 40)}'"
            raise model.error(f"not a readable {format} file: {what}")


@cache
def _is_cut() -> bool:
    """Whether this numpy reads text up to the first word that is no number, where later ones raise an error."""
    try:
        return len(np.fromstring("1 x", sep=" ")) == 1
    except (ValueError, DeprecationWarning):
        return False


def _read(model, format, data, texts, pictures=None, **options) -> dict:
    """Let trimesh's reader of a format read bytes; return the arguments of what trimesh would make of them. `texts` are
    those in it that hold numbers."""
    found_texts = (found for text in texts for found in _NUMBERS.finditer(text)) if _is_cut() else ()
    check_numbers(model, format, (b"".join(filter(None, each.groups())).replace(b",", b" ") for each in found_texts))
    log, logger = _Log(), logging.getLogger("trimesh")
    logger.addHandler(log)
    try:
        from trimesh.exchange.load import mesh_loaders

        found = mesh_loaders[format](BytesIO(data), file_type=format, resolver=pictures, **options)
    except (MemoryError, ModelError):
        raise
    except RecursionError as fault:
        raise model.error("is nested too deeply") from fault
    except Exception as fault:
        reason = f" ({cut(fault)})" if isinstance(fault, ValueError) else ""  # others speak of Python
        raise model.error(f"not a readable {model.format} file{reason}") from fault
    finally:
        logger.removeHandler(log)
    for text in dict.fromkeys(log.texts):
        model.warn(text)
    return found


def _contents_of(model, found, pictures=None) -> Contents:
    """Make parts of what a reader of trimesh returns: one mesh, or a graph of several."""
    geometry = found.get("geometry", {"": found})
    parts = {name: _part(model, name, source, pictures) for name, source in geometry.items()}
    graph = found.get("graph", [{"geometry": name} for name in parts])
    placed = [(parts[node["geometry"]], node.get("matrix")) for node in graph if node.get("geometry") in parts]
    return Contents([(part, matrix) for part, matrix in placed if len(part["faces"])])


def _part(model, name, source, pictures) -> Part:
    """Make the part of the arguments of a Trimesh."""
    vertices = np.asarray(source["vertices"], np.float64).reshape(-1, 3)
    faces = np.asarray(source["faces"], np.int64).reshape(-1, 3)
    part = {"vertices": vertices, "faces": faces, "name": name_in(name), "material": Material()}
    visual = source.get("visual")
    if visual is not None:
        part["material"] = _material(visual.material, pictures)
        if np.shape(visual.uv) == (len(vertices), 2):
            part["uv"] = np.asarray(visual.uv, np.float64)
    for key, ours, n in (("vertex_colors", "colors", len(vertices)), ("face_colors", "face_colors", len(faces))):
        colors = source.get(key)
        if colors is not None and len(colors) == n and np.shape(colors)[1:] in ((3,), (4,)):
            part |= {ours: bytes_of(model, colors)[:, :3], "material": WHITE}
    if np.shape(source.get("vertex_normals")) == vertices.shape:
        part["normals"] = np.asarray(source["vertex_normals"], np.float64)
    return part


def _material(source, pictures) -> Material:
    """Turn a material of trimesh into ours: of metal and roughness as glTF has them, or just a picture."""
    base = getattr(source, "baseColorFactor", None)
    red, green, blue, alpha = np.array([255] * 4 if base is None else base, np.float64) / 255.0
    image = getattr(source, "baseColorTexture", None) or getattr(source, "image", None)
    texture = None if image is None or pictures is None else pictures.texture(image)
    roughness = getattr(source, "roughnessFactor", None)
    surface = {"pbrMetallicRoughness": {"roughnessFactor": 1.0 if roughness is None else float(roughness)}}
    fields = lit_fields(surface, (red, green, blue), texture is not None, lambda _: None, metallic=0.0)
    emission = getattr(source, "emissiveFactor", None)
    emissive = (0.0, 0.0, 0.0) if emission is None else tuple(float(value) for value in emission[:3])
    return Material(**fields, emissive=emissive, opacity=float(alpha), texture=texture)


class Pictures:
    """The pictures that a file names: trimesh gets one of one pixel for each, whose colour is its number.

    Parameters
    ----------
    model : ModelFile, for warnings
    read : function of a name, which returns the bytes of a picture; OSError, ValueError or LookupError where it may not
    """

    def __init__(self, model: ModelFile, read) -> None:
        self._model, self._read = model, read
        self._names: list[str] = []
        self._textures: dict[str, Texture | None] = {}

    def get(self, name: str) -> bytes:
        """Return what stands for a picture: what trimesh calls to read a file."""
        from PIL import Image

        stream, number = BytesIO(), len(self._names)
        self._names.append(str(name))
        Image.new("RGB", (1, 1), (number & 255, number >> 8 & 255, number >> 16)).save(stream, "PNG")
        return stream.getvalue()

    def texture(self, image) -> Texture | None:
        """Return the texture that a picture of one pixel stands for, as `named` does."""
        red, green, blue = image.convert("RGB").getpixel((0, 0))
        return self.named(self._names[red | green << 8 | blue << 16])

    def named(self, name: str) -> Texture | None:
        """Return the texture of a picture; None, and a UserWarning, where it can't be read."""
        if name not in self._textures:
            try:
                pixels = read_picture(BytesIO(self._read(name)), "the picture", self._model.textures)
                self._textures[name] = self._model.textures.add(Texture(pixels, name=name[:80]))
            except (ModelError, OSError, ValueError, LookupError) as fault:
                reason = getattr(fault, "strerror", None) or cut(fault)
                self._model.warn(f"texture '{cut(name)[:80]}': {reason}; its materials keep their plain colour")
                self._textures[name] = None
        return self._textures[name]


def beside(model, name) -> bytes:
    """Return a file beside the model, found by the rules of OBJ: the last part of a path of the author's machine is
    looked for in the folder."""
    folder = model.beside
    return folder.read_bytes(folder.find_alike(unquote(name.removeprefix("file://"))))


def member_of(members, name) -> bytes:
    """Return a member of a zip file by its name or the last part of it, whatever its capitals."""
    for wanted in (name, unquote(name).replace("\\", "/").rsplit("/", 1)[-1]):
        for each, data in members.items():
            if wanted.lower() in (each.lower(), each.lower().rsplit("/", 1)[-1]):
                return data
    raise LookupError("there is no such file in it")
