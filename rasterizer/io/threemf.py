"""Read 3MF by lib3mf, the reference implementation of its consortium: meshes, placed, with colours and materials.

    bytes ─ zip members, counted ─ lib3mf ─ build items ─ components ─ meshes, each as often as it is built
                                                                       └ properties: a look for each triangle

What a triangle looks like is a property of a group:

    base materials       a name and a display colour each: a material; its alpha is the opacity
    colours              one for each corner of a triangle
    texture coordinates  of a picture
    composites           mixtures of base materials: the mean of their colours, weighted by their shares
    multi-properties     layers of the others: colours are mixed by the upper one's alpha, or multiplied; the first of
                         a picture counts alone

lib3mf is strict, and it isn't everywhere: without it, or where it refuses a file, trimesh reads the shapes alone, which
is said. Lengths are in the file's unit, which is said, too.
Formats: 3MF Consortium, Core Specification 1.3, 2021; Materials and Properties Extension 1.2, 2021.
"""

import re
from io import BytesIO
from typing import NamedTuple

import numpy as np

from ..errors import ModelError, cut, install_command
from ..scene.color import linear_from_srgb_bytes, srgb_from_linear
from ..scene.material import WHITE, Material
from ..scene.texture import Texture, read_picture
from .model_file import Contents, ModelFile, Part, make_opaque, name_in
from .other_formats import DEEPEST, LAYER, check_3mf, packed, read_by_trimesh, unpacked

# Without one of these, nothing in a model is there twice and no entity stands for others; zeros are those of UTF-16.
_LOOKED_AT = (b"component", b"multi", b"composite", b"<!DOCTYPE", b"\0")
_MIXED = re.compile(rb"""matindices\s*=\s*["']([^"']*)""")
_ITEM, _BEAMS = re.compile(rb"<(?:\w+:)?item\b"), re.compile(rb"<(?:\w+:)?beamlattice\b")
_UNITS = ("micron", "millimeter", "centimeter", "inch", "foot", "meter")
_WRAPS = ("repeat", "mirror", "clamp", "clamp")
_NEAREST = 2
_MULTIPLY = 1  # what lib3mf 2.5 returns, though its own list of names says 2
_BASE, _TEXTURE, _COLORS, _COMPOSITE, _MULTI = 1, 2, 3, 4, 5  # lib3mf's types of properties
_NO_RESOURCE = 32859  # lib3mf's number of this warning
_NO_LOOK = 0  # lib3mf's number of no group


def read_3mf(model: ModelFile) -> Contents:
    """Read a 3MF file.

    Returns
    -------
    Contents whose parts are pairs (part, world_from_object (4, 4) float64), one for each time that a mesh is built

    Raises
    ------
    ModelError : a file that is damaged, or asks for too much; or no package is there that reads it

    Warns
    -----
    UserWarning : colours are left out, or a texture can't be read
    """
    members = unpacked(model)
    texts = [text for name, text in members.items() if name.lower().endswith(".model")]
    if texts and not any(_ITEM.search(text) for text in texts):
        check_3mf(model, members)
        raise model.error("no faces: its build has no item")
    beams = ("beam lattices",) if any(_BEAMS.search(text) for text in texts) else ()
    if any(word in text for text in members.values() for word in _LOOKED_AT):
        check_3mf(model, members)
    try:
        from lib3mf import Lib3MF, get_wrapper
    except (ImportError, OSError):  # there may be no binary for this system
        reason = f"lib3mf is missing ({install_command('formats')})"
    else:
        loaded = get_wrapper().CreateModel()
        try:
            reader = loaded.QueryReader("3mf")
            reader.ReadFromBuffer(packed(members))
            codes = [reader.GetWarning(k)[0] for k in range(reader.GetWarningCount())]
            model.mend("property", "that refers to no resource: drawn grey", codes.count(_NO_RESOURCE))
            contents = _contents_of(model, loaded, members)
            return contents._replace(left_out=contents.left_out + beams)
        except Lib3MF.ELib3MFException as fault:
            reason = f"lib3mf refuses the file ({cut(fault)})"
        except ModelError:
            raise
        except ValueError as fault:
            raise model.error(fault) from fault
    contents = read_by_trimesh(model, members)
    if contents.left_out:
        model.warn(f"{', '.join(contents.left_out)} are left out: {reason}")
    return contents._replace(left_out=beams, unused=contents.left_out)


def _contents_of(model, loaded, members) -> Contents:
    """Follow what lib3mf has read from the build down to the meshes."""
    looks, parts, placed = _Looks(model, loaded, members), {}, []
    waiting = [(item, np.eye(4), 0) for item in _listed(loaded.GetBuildItems())]
    while waiting:
        item, matrix, depth = waiting.pop()
        thing, number = item.GetObjectResource(), item.GetObjectResourceID()
        model.limits.count_meshes(1)
        if depth > DEEPEST:
            raise ValueError(f"its components are nested more than {DEEPEST} deep")
        has_matrix = item.HasTransform() if depth else item.HasObjectTransform()
        if has_matrix:
            own = item.GetTransform() if depth else item.GetObjectTransform()
            matrix = matrix @ _matrix(own)
        if thing.IsComponentsObject():
            whole = loaded.GetComponentsObjectByID(number)
            children = [whole.GetComponent(k) for k in range(whole.GetComponentCount())]
            waiting += [(child, matrix, depth + 1) for child in reversed(children)]
        elif thing.IsMeshObject():
            mesh = loaded.GetMeshObjectByID(number)
            if number not in parts:
                parts[number] = _part(mesh, looks)
            placed.append((parts[number], matrix))
        else:
            looks.left_out.add("level sets")
    placed = [(part, matrix) for part, matrix in placed if len(part["faces"])]
    make_opaque(model, list(parts.values()))
    return Contents(placed, facts=(f"unit {_UNITS[int(loaded.GetUnit())]}",), left_out=tuple(sorted(looks.left_out)))


def _listed(iterator) -> list:
    """Return what an iterator of lib3mf goes through, last first."""
    found = []
    while iterator.MoveNext():
        found.append(iterator.GetCurrent())
    return found[::-1]


def _matrix(transform) -> np.ndarray:
    """Return the matrix (4, 4) of a transform: the columns of the affine one, where x goes first."""
    matrix = np.eye(4)
    matrix[:3] = np.frombuffer(transform.Fields, np.float32).reshape(4, 3).T
    return matrix


def _part(mesh, looks) -> Part:
    """Make the part of a mesh object."""
    vertices = np.frombuffer(b"".join(mesh.GetVertices()), np.float32).reshape(-1, 3).astype(np.float64)
    faces = np.frombuffer(b"".join(mesh.GetTriangleIndices()), np.uint32).reshape(-1, 3).astype(np.int64)
    part = {"vertices": vertices, "faces": faces, "name": name_in(mesh.GetName())}
    group, own, has_own = mesh.GetObjectLevelProperty()
    marks = np.frombuffer(b"".join(mesh.GetAllTriangleProperties()), np.uint32).reshape(-1, 4).astype(np.int64)
    if len(marks) != len(faces):
        marks = np.zeros((len(faces), 4), np.int64)
    if has_own:
        marks[marks[:, 0] == _NO_LOOK] = (group, own, own, own)
    return part | _paint(looks, marks[:, 0], marks[:, 1:])


class _Properties(NamedTuple):
    """Some properties of a group."""

    colors: np.ndarray  # (n, 4) uint8, sRGB and alpha
    names: tuple[str, ...] = ()  # of base materials
    uv: np.ndarray | None = None  # (n, 2) of a texture
    texture: Texture | None = None


class _Looks:
    """The groups of properties of a file.

    Parameters
    ----------
    model : ModelFile, for warnings
    loaded : model of lib3mf
    members : the bytes of the files in the zip file, by name

    Attributes
    ----------
    left_out : set of texts, what isn't used
    """

    def __init__(self, model, loaded, members) -> None:
        self.model, self.left_out = model, set()
        self._loaded, self._members = loaded, {name.lower(): data for name, data in members.items()}
        self._textures = {}
        # lib3mf 2.5 takes the first materials of a group, whichever a composite names.
        mixed = {words for text in members.values() for words in _MIXED.findall(text)}
        self._are_mixes_right = all(words.split() == [b"%d" % k for k in range(len(words.split()))] for words in mixed)

    def find(self, group: int, numbers: list[int]) -> _Properties | None:
        """Return properties of a group by lib3mf's numbers of them; None for a group of a type that isn't read."""
        found = int(self._loaded.GetPropertyTypeByID(group))
        if found == _BASE:
            source = self._loaded.GetBaseMaterialGroupByID(group)
            return _Properties(_rows(map(source.GetDisplayColor, numbers)), tuple(map(source.GetName, numbers)))
        if found == _COLORS:
            colors = _rows(map(self._loaded.GetColorGroupByID(group).GetColor, numbers))
            if (colors[:, 3] < 255).any():
                self.left_out.add("the alpha of colors")
            return _Properties(colors)
        if found == _TEXTURE:
            source = self._loaded.GetTexture2DGroupByID(group)
            places = [source.GetTex2Coord(number) for number in numbers]
            uv = np.array([(place.U, place.V) for place in places]).reshape(-1, 2)
            white = np.full((len(numbers), 4), 255, np.uint8)
            return _Properties(white, uv=uv, texture=self._texture(source.GetTexture2D()))
        if found == _COMPOSITE and self._are_mixes_right:
            return self._composites(self._loaded.GetCompositeMaterialsByID(group), numbers)
        if found == _MULTI:
            return self._layers(self._loaded.GetMultiPropertyGroupByID(group), numbers)
        self.left_out.add(f"the group of properties {group}")
        return None

    def _composites(self, source, numbers) -> _Properties:
        base, mixed = source.GetBaseMaterialGroup(), []
        for number in numbers:
            shares = source.GetComposite(number)
            self.model.limits.count_bytes(LAYER * len(shares))
            colors = _rows(base.GetDisplayColor(share.PropertyID) for share in shares)
            linear = np.concatenate([linear_from_srgb_bytes(colors[:, :3]), colors[:, 3:] / 255.0], axis=1)
            weights = np.array([share.MixingRatio for share in shares])
            mixed.append(weights @ linear / weights.sum() if weights.sum() > 0.0 else np.ones(4))
        return _Properties(_encoded(np.array(mixed)))

    def _layers(self, source, numbers) -> _Properties | None:
        layers = [source.GetLayer(k) for k in range(source.GetLayerCount())]
        self.model.limits.count_bytes(LAYER * len(numbers) * len(layers))
        # lib3mf 2.5 asks for room, though it is asked how much it needs.
        rows = [source.GetMultiProperty(number, [0] * len(layers)) for number in numbers]
        found = None
        for k, layer in enumerate(layers):
            above = self.find(layer.ResourceID, [row[k] for row in rows])
            if found is None or above is None:
                found = found or above
            elif found.texture is not None or above.texture is not None:
                self.left_out.add("layers over or under pictures")
            else:
                found = _Properties(_blended(found.colors, above.colors, layer.TheBlendMethod == _MULTIPLY))
        return found

    def _texture(self, source) -> Texture | None:
        """Return the picture of a texture; None, and a UserWarning, where it can't be read."""
        number = source.GetUniqueResourceID()
        if number not in self._textures:
            name = source.GetAttachment().GetPath().lstrip("/")
            try:
                data = self._members.get(name.lower())
                if data is None:
                    raise ModelError(f"there is no '{name[:80]}' in it")
                pixels = read_picture(BytesIO(data), f"texture '{name[:80]}'", self.model.textures)
                wraps = tuple(_WRAPS[int(style)] for style in source.GetTileStyleUV())
                filtered = "nearest" if int(source.GetFilter()) == _NEAREST else "trilinear"
                texture = Texture(pixels, filter=filtered, wrap=wraps, name=name[:80])
                self._textures[number] = self.model.textures.add(texture)
            except ModelError as fault:
                self.model.warn(f"the texture can't be read ({fault}); its triangles are drawn white")
                self._textures[number] = None
        return self._textures[number]


def _paint(looks: _Looks, groups: np.ndarray, numbers: np.ndarray) -> Part:
    """Return the fields of a part that say what its triangles look like.

    Parameters
    ----------
    groups : (n_face,) int64, number of each triangle's group, _NO_LOOK where it has none
    numbers : (n_face, 3) int64, the property at each corner
    """
    n_face = len(groups)
    palette, face_material = {}, np.zeros(n_face, np.int32)
    colors, uv = np.full((n_face, 3, 3), 255, np.uint8), None

    def number_of(material):
        return palette.setdefault(material, len(palette))

    order = np.argsort(groups, kind="stable")
    for faces in np.split(order, np.flatnonzero(np.diff(groups[order])) + 1) if n_face else ():
        group = int(groups[faces[0]])
        used, rows = np.unique(numbers[faces], return_inverse=True)
        rows = rows.reshape(-1, 3)
        found = None if group == _NO_LOOK else looks.find(group, used.tolist())
        if found is None:
            face_material[faces] = number_of(Material())
        elif found.names:  # one for the whole triangle
            kept, which = np.unique(rows[:, 0], return_inverse=True)
            face_material[faces] = np.array([number_of(_base(found, row)) for row in kept.tolist()])[which.reshape(-1)]
        elif found.uv is not None:
            uv = np.zeros((n_face, 3, 2)) if uv is None else uv
            face_material[faces] = number_of(Material(diffuse=1.0, texture=found.texture))
            uv[faces] = found.uv[rows]
        else:
            face_material[faces] = number_of(WHITE)
            colors[faces] = found.colors[rows, :3]
    part = {"material": next(iter(palette), Material())}
    if len(palette) > 1:
        part = {"materials": tuple(palette), "face_material": face_material}
    if uv is not None:
        part["uv"] = uv
    if (colors < 255).any():
        is_even = (colors == colors[:, :1]).all()
        part |= {"face_colors": colors[:, 0]} if is_even else {"colors": colors}
    return part


def _base(found, row) -> Material:
    """Return the material that a base material is."""
    diffuse = linear_from_srgb_bytes(found.colors[row : row + 1, :3])[0]
    return Material(
        diffuse=tuple(diffuse.tolist()), opacity=float(found.colors[row, 3]) / 255.0, name=name_in(found.names[row])
    )


def _rows(colors) -> np.ndarray:
    """Return colours of lib3mf as (n, 4) uint8."""
    return np.frombuffer(b"".join(colors), np.uint8).reshape(-1, 4)


def _blended(below, above, is_product) -> np.ndarray:
    """Put colours (n, 4) above others."""
    below, above = below.astype(np.float64), above.astype(np.float64)
    alpha = above[:, 3:] / 255.0
    found = below * above / 255.0 if is_product else below + (above - below) * alpha
    found[:, 3] = below[:, 3] if is_product else np.maximum(below[:, 3], above[:, 3])
    return np.rint(found).astype(np.uint8)


def _encoded(linear) -> np.ndarray:
    """Return linear colours (n, 4) within 0..1 as sRGB bytes; the fourth of them is alpha."""
    srgb = np.concatenate([srgb_from_linear(linear[:, :3]), linear[:, 3:]], axis=1)
    return np.rint(255.0 * np.clip(srgb, 0.0, 1.0)).astype(np.uint8)
