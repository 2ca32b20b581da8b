"""Read COLLADA (DAE, and ZAE, which is packed): meshes, placed by their nodes, with materials and textures.

    bytes ─ checks ─ pycollada ─ its nodes ─ geometries ─ polygons, cut as those of OBJ and PLY are ─ parts

pycollada leaves out what it can't read; what that is is warned of. A material that isn't there, or can't be read, is
grey. Holes of polygons are filled, and skins and morphs stand in their bind shape. Where the file says how opaque a
material is (`transparent`, with its `opaque`, times `transparency`), the opacity is

    A_ONE     alpha · transparency         RGB_ONE    luminance · transparency
    A_ZERO    1 - alpha · transparency     RGB_ZERO   1 - luminance · transparency

Formats: Khronos, COLLADA 1.4.1, 2008, p. 7-5; 1.5.0, 2008, p. 249 and 304.
"""

import re
from io import BytesIO

import numpy as np

from ..errors import ModelError, cut
from ..scene.material import WHITE, Material
from ..scene.of_gltf import lit_fields, unlit_fields
from ..vectors import unit
from .model_file import (
    Contents,
    ModelFile,
    Part,
    bytes_of,
    check_indices,
    cut_faces,
    make_opaque,
    mend_unused,
    name_in,
    within_1,
)
from .other_formats import Graph, Pictures, beside, check_numbers, check_tree, member_of, unpacked

_SLOW = 6  # times as long as another mesh takes to be made: a primitive, or where it is shown
_VCOUNT = re.compile(rb"<(?:\w+:)?vcount\b[^<>]*>([^<]*)")
_NAN = re.compile(r"(?:^|\s)[-+]?nan(?!\S)", re.IGNORECASE)
_CORNER = 32  # bytes that pycollada takes for a corner of a polygon before it has seen it
_NODES = ("node", "visual_scene", "geometry", "controller")
_PRIMITIVES = ("triangles", "polylist", "polygons")
_LEFT_OUT = {
    "animation": "animations", "instance_camera": "cameras", "instance_light": "lights", "ph": "holes of polygons",
    "instance_controller": "skins and morphs, but for their bind shape", "lines": "lines", "linestrips": "lines",
}  # fmt: skip
_LUMINANCE = (0.212671, 0.715160, 0.072169)  # of red, green and blue: the format's


def read_dae(model: ModelFile) -> Contents:
    """Read COLLADA; of a ZAE file the first document in it."""
    text, pictures = model.data, Pictures(model, lambda name: beside(model, name))
    if model.format == "zae":
        members = unpacked(model)
        name = next((name for name in sorted(members) if name.lower().endswith(".dae")), None)
        if name is None:
            raise model.error("there is no .dae file in it")
        text, pictures = members[name], Pictures(model, lambda name: member_of(members, name))
    facts = _check(model, text)
    document = _document(model, text)
    scene = document.scene or next(iter(document.scenes), None)
    reader = _Reader(model, document, pictures)
    if scene is not None:
        reader.follow(scene.nodes, np.eye(4))
    faults = list(dict.fromkeys(str(fault).partition(": ")[2] for fault in document.errors))
    if faults and not reader.placed:
        raise model.error(f"no faces: {faults[0]}")
    for fault in faults:
        model.warn(fault)
    make_opaque(model, [part for part, _ in reader.placed])
    return facts._replace(parts=reader.placed)


def _check(model, text) -> Contents:
    """Count what a document asks for before anybody follows it; return what it says of itself."""
    check_tree(model, text)
    for counts in _VCOUNT.findall(text):
        model.limits.count_bytes(_CORNER * sum(int(word[:18]) for word in counts.split() if word.isdigit()))
    graph = Graph(model)
    unit, axis, others, stride, n_corner = "1", "", set(), 1, 1

    def start(word, attributes, above):
        nonlocal unit, stride, n_corner
        if word == "unit":
            unit = attributes.get("meter", unit)[:20]
        elif word in _NODES:
            graph.open(attributes.get("id") or f"a {word} at {graph.n_opened}", above)
        elif word in ("instance_node", "instance_geometry", "instance_controller", "instance_visual_scene"):
            graph.add(attributes.get("url", "").removeprefix("#"), above)
            model.limits.count_meshes(_SLOW)
        elif word in ("skin", "morph"):
            graph.add(attributes.get("source", "").removeprefix("#"), above)
        elif word in _PRIMITIVES:
            model.limits.count_meshes(_SLOW)
            stride, n_corner = 1, 3 if word == "triangles" else 1  # a polygon may have a triangle a corner
        elif word == "input":
            offset = attributes.get("offset", "0")
            stride = max(stride, 1 + int(offset) if offset.isdigit() and len(offset) < 4 else 1)
        if word in _LEFT_OUT:
            others.add(_LEFT_OUT[word])

    def characters(word, piece, above):
        nonlocal axis
        if word == "p":
            graph.weigh(above, len(piece.split()) // (stride * n_corner))
        elif word == "up_axis":
            axis += piece[:20]

    graph.scan(text, start, characters, _NODES)
    graph.check()
    up = {"X_UP": "x", "Z_UP": "z"}.get(axis.strip(), "y")
    return Contents([], facts=(f"unit {unit} meter",), left_out=tuple(sorted(others)), up=up)


def _document(model, text):
    """Return what pycollada makes of a document, with what it can't read in its `errors`."""
    import collada
    from collada.common import DaeBrokenRefError, DaeError, DaeMalformedError

    class Document(collada.Collada):
        """A document of which as little as can be is lost where something is missing."""

        def _loadAssetInfo(self):
            super()._loadAssetInfo()
            holders = (each for each in self.xmlnode.iter() if str(each.tag).rpartition("}")[2] in _NUMBERS)
            check_numbers(model, "dae", ((each.text or "").encode() for each in holders))
            for element in [*self.xmlnode.iter(self.tag("lookat"))]:  # pycollada's matrix lies on its side
                element.tag, element.text = self.tag("matrix"), _looking(element.text or "")
            ids = {element.get("id") for element in self.xmlnode.iter()}
            for above in [*self.xmlnode.iter()]:
                for element in [*above]:
                    url = element.get("url", "")
                    if element.tag == self.tag("ph"):  # its first polygon is the outer one
                        above.append(element.find(self.tag("p")))
                    elif element.tag == self.tag("instance_node") and url[1:] not in ids:
                        above.remove(element)
                        self.errors.append(DaeBrokenRefError(f"Node {url} not found"))

        def _loadGeometry(self):
            for element in self.xmlnode.iter(self.tag("float_array")):  # of a NaN pycollada makes 0
                if element.text and "nan" in element.text.lower():
                    element.text = _NAN.sub(" inf", element.text)
            super()._loadGeometry()

        def _loadEffects(self):
            for element in self.xmlnode.iterfind(f"{self.tag('library_effects')}/{self.tag('effect')}"):
                try:
                    self.effects.append(collada.material.Effect.load(self, {}, element))
                except (DaeError, ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
                    self.errors.append(DaeMalformedError(f"Effect #{element.get('id')} can't be read"))

        def _loadMaterials(self):
            super()._loadMaterials()
            for element in self.xmlnode.iter(self.tag("instance_material")):
                name = element.get("target", "").removeprefix("#")
                if name not in self.materials:
                    element.set("target", f"#{name}")
                    self.errors.append(DaeBrokenRefError(f"Material #{name} not found: it is grey"))
                    self.materials.append(collada.material.Material(name, name, None, self.xmlnode))

    try:
        return Document(BytesIO(text), ignore=[DaeError], aux_file_loader=lambda name: b"")
    except (MemoryError, ModelError):
        raise
    except RecursionError as fault:
        raise model.error("is nested too deeply") from fault
    except Exception as fault:
        reason = f": {cut(fault)}" if isinstance(fault, (DaeError, ValueError)) else ""
        raise model.error(f"not a readable dae file{reason}") from fault


# Elements whose text numpy reads up to the first word that is no number.
_NUMBERS = {"float_array", "p", "v", "vcount", "matrix", "translate", "rotate", "scale", "lookat", "skew"}


def _looking(text: str) -> str:
    """Return the matrix, row by row, of a place that looks from an eye to a point, with a direction that is up; as it
    is where there are no nine numbers. Source: COLLADA 1.4.1, p. 5-60."""
    words = text.split()
    if len(words) != 9:
        return text
    eye, point, up = np.array(words, np.float64).reshape(3, 3)
    with np.errstate(all="ignore"):  # what isn't finite is refused where something stands there
        back = unit(eye - point)
        right = unit(np.cross(up, back))
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, np.cross(back, right), back, eye], axis=1)
    return " ".join(map(repr, matrix.ravel().tolist()))


class _Reader:
    """Make parts of a document's geometries, each once for the materials that it is shown with.

    Attributes
    ----------
    placed : pairs of a part and the matrix (4, 4) of its place
    """

    def __init__(self, model, document, pictures) -> None:
        self.placed: list[tuple[Part, np.ndarray]] = []
        self._model, self._document, self._pictures = model, document, pictures
        self._parts: dict[tuple, list[Part]] = {}
        self._materials: dict[str, Material] = {}

    def follow(self, nodes, matrix) -> None:
        """Place what nodes show."""
        for node in nodes:
            if hasattr(node, "children"):
                self.follow(node.children, matrix @ np.asarray(node.matrix, np.float64))
            elif hasattr(node, "geometry"):
                self._show(node.geometry, node.materials, matrix)
            elif hasattr(node, "controller"):
                whole = node.controller
                own = np.asarray(getattr(whole, "bind_shape_matrix", np.eye(4)), np.float64).reshape(4, 4)
                geometry = whole.geometry if hasattr(whole, "geometry") else whole.source_geometry
                self._show(geometry, node.materials, matrix @ own)

    def _show(self, geometry, uses, matrix) -> None:
        key = geometry.id, *((use.symbol, use.target.id) for use in uses)
        if key not in self._parts:
            materials = {use.symbol: self._material(use.target) for use in uses}
            self._parts[key] = self._parts_of(geometry, materials)
        self.placed += [(part, matrix) for part in self._parts[key]]

    def _parts_of(self, geometry, materials) -> list[Part]:
        """Return the parts of a geometry, one for each primitive that has triangles."""
        parts: list[Part] = []
        for primitive in geometry.primitives:
            if type(primitive).__name__ not in ("TriangleSet", "Polylist", "Polygons") or not len(primitive.index):
                continue
            name = geometry.id if not parts else f"{geometry.id}_{len(parts)}"
            if primitive.material is not None and primitive.material not in materials:
                self._model.mend("mesh", "whose material isn't bound: drawn grey")
            material = materials.get(primitive.material, Material())
            part = {"name": name_in(name), "material": material} | self._part(primitive, name)
            parts += [part] if len(part["faces"]) else []
        for vertices in {id(part["vertices"]): part["vertices"] for part in parts}.values():
            own = [part for part in parts if part["vertices"] is vertices]
            vertices = mend_unused(self._model, vertices, np.concatenate([part["faces"] for part in own]))
            for part in own:
                used, faces = np.unique(part["faces"], return_inverse=True)
                part["vertices"], part["faces"] = vertices[used].astype(np.float64), faces.reshape(-1, 3)
        return parts

    def _part(self, primitive, name) -> Part:
        """Return the arrays of a primitive."""
        table = primitive.index.reshape(-1, primitive.nindices)
        is_of_triangles = type(primitive).__name__ == "TriangleSet"
        counts = np.full(len(table) // 3, 3) if is_of_triangles else np.asarray(primitive.vcounts, np.int64)
        if counts.min(initial=0) < 0 or counts.sum() != len(table):
            raise self._model.error(f"mesh '{cut(name, 80)}': {len(table)} corners, {counts.sum()} are stated")

        def place(polygon):
            return f": mesh '{cut(name, 80)}', polygon {polygon}"

        def corners_of(word):
            offset, _, _, _, source = primitive.sources[word][0]
            check_indices(self._model, table[:, offset], counts, len(source.data), place)
            return table[:, offset].astype(np.int64)

        corners, points = corners_of("VERTEX"), primitive.vertex
        pieces = cut_faces(self._model, points, corners, counts, place)
        part = {"vertices": points, "faces": pieces.of_corners(corners)}
        if counts.max() > 3:
            part["polygons"] = pieces.polygons
        for key, word, n in (("normals", "NORMAL", 3), ("uv", "TEXCOORD", 2), ("colors", "COLOR", 4)):
            if not primitive.sources.get(word):
                continue
            rows = primitive.sources[word][0][4].data[:, :n]
            if key == "colors":
                rows, part["material"] = bytes_of(self._model, rows), WHITE
            part[key] = rows[pieces.of_corners(corners_of(word))]
            part[key] = part[key] if key == "colors" else part[key].astype(np.float64)
        return part

    def _material(self, source) -> Material:
        """Return a material of the document; one that isn't there, or whose effect isn't, is the default's grey."""
        if source.effect is None:
            return Material(name=name_in(source.id))
        if source.id not in self._materials:
            self._materials[source.id] = self._made(source)
        return self._materials[source.id]

    def _made(self, source) -> Material:
        effect = source.effect
        diffuse, emission, shininess = effect.diffuse, _color(effect.emission), effect.shininess
        if effect.shadingtype == "constant":  # it shows its emission, whatever the light; a picture is lit
            diffuse = effect.emission
        name = _picture(diffuse)
        texture = None if name is None else self._pictures.named(name)
        base, tag = _color(diffuse), self._document.tag
        if name is None and effect.xmlnode.find(f".//{tag('diffuse')}/{tag('texture')}") is not None:
            self._model.mend("texture", "of a sampler that isn't there: drawn without")
            base = None
        base = np.ones(3) if base is None else within_1(self._model, base[None, :3])[0]
        common = {"opacity": self._opacity(effect), "texture": texture, "name": name_in(source.name or source.id)}
        if effect.shadingtype == "constant":
            return Material(**common, **unlit_fields(tuple(base.tolist()), texture is not None))
        exponent = max(float(np.nan_to_num(shininess)), 0.0) if isinstance(shininess, float) else 0.0
        surface = {"pbrMetallicRoughness": {"roughnessFactor": float(np.sqrt(2.0 / (2.0 + exponent)))}}
        if emission is not None:
            common["emissive"] = tuple(np.maximum(np.nan_to_num(emission[:3], posinf=0.0), 0.0).tolist())
        return Material(**common, **lit_fields(surface, base, texture is not None, lambda _: None, metallic=0.0))

    def _opacity(self, effect) -> float:
        """Return the opacity of an effect; see the module's docstring. A picture counts by its own alpha, if it is that
        of the colour."""
        tag = self._document.tag
        element = effect.xmlnode.find(f".//{tag('transparent')}")
        mode = "A_ONE" if element is None else element.get("opaque", "A_ONE")
        has_amount = effect.xmlnode.find(f".//{tag('transparency')}") is not None
        amount = effect.transparency if has_amount and isinstance(effect.transparency, float) else 1.0
        color, name = _color(effect.transparent), _picture(effect.transparent)
        if name is not None:
            if name != _picture(effect.diffuse) or mode != "A_ONE":
                self._model.mend("material", "with a picture of its opacity: drawn without")
                return 1.0
            color = np.ones(4)
        elif color is None:
            color = np.array([0.0, 0.0, 0.0, 1.0])
        share = amount * (color[:3] @ _LUMINANCE if mode in ("RGB_ONE", "RGB_ZERO") else color[3])
        opacity = 1.0 - share if mode in ("A_ZERO", "RGB_ZERO") else share
        return float(within_1(self._model, np.array([opacity]), "alpha")[0])


def _picture(value) -> str | None:
    """Return the name of the picture that a value of an effect shows; None for another value."""
    return value.sampler.surface.image.path if hasattr(value, "sampler") else None


def _color(value) -> np.ndarray | None:
    """Return a value of an effect as red, green, blue and alpha; None where it is no colour."""
    if value is None or hasattr(value, "sampler") or np.size(value) not in (3, 4):
        return None
    return np.append(np.asarray(value, np.float64), 1.0)[:4]
