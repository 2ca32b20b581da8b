"""Meshes of other libraries, read by what they hold: none of these libraries is imported before its objects are met.

    trimesh     Trimesh; Scene, with its graph, camera and lights
    Open3D      TriangleMesh, that of tensors, and TriangleMeshModel
    VTK         PolyData, and PyVista's; other data sets by VTK's own surface filter; MultiBlock, block by block
    meshio      Mesh: cells that are triangles, quads or polygons

    object ─ reader of its library ─ Foreign: arguments of Mesh, places, and what is left out ─ mesh.py

A foreign mesh looks as the file that it was loaded from: colours are 8 bits of sRGB as in PLY and OBJ, materials mean
what they do in MTL and glTF (`of_mtl.py`, `of_gltf.py`), vertices at one position are joined where normals are
averaged. Normals count that a file or the caller gave; those that trimesh computes when they are looked at don't. What
can't be taken is named in one warning.

What these libraries don't keep is lost: trimesh has no samplers of textures, rounds the factors of materials to 8 bits,
and turns polygons into triangles, along other diagonals than ours. Of its SimpleMaterial the grey (102, 102, 102)
stands for a colour that isn't given, and a PBRMaterial without metallicFactor is no metal, as in the files that it
writes.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError, warn_caller
from .arrays import plain_array
from .camera import Camera
from .lights import Light
from .material import Material
from .mesh_arrays import checked_vertices, has_any_area, triangulate, without_unused
from .of_gltf import camera_of, emission_of, light_of, lit_fields, opacity_fields
from .of_mtl import COLORS, NUMBERS, Doubts, material_of, value_of
from .scalars import Fields
from .texture import Texture

_NOT_GIVEN = [102, 102, 102]  # what trimesh has for it
_EMPTY = np.full((2, 2, 4), (100, 100, 100, 255), np.uint8)  # the picture of its material where there is none
_LIGHT_NOT_GIVEN = [60, 60, 60]
_OF_FACES = {"face_colors", "face_material"}
_COLOR_NAMES = ("rgb", "rgba", "color", "colors")


class Foreign:
    """What objects of other libraries hold.

    Attributes
    ----------
    parts : list of the arguments of a Mesh, and the matrix (4, 4) of its place or None
    """

    def __init__(self) -> None:
        self.parts: list[tuple[dict[str, Any], Any]] = []
        self._left_out: dict[str, None] = {}
        self._textures: dict[tuple[Any, ...], tuple[Any, Texture]] = {}

    def add(self, source: object) -> None:
        """Read an object; ModelError where it holds no faces."""
        n_part, read = len(self.parts), _reader_of(source)
        if read is not None:
            read(self, source)
        if len(self.parts) == n_part:
            held = f"; it has {', '.join(self._left_out)}" if self._left_out else ""
            raise ModelError(
                f"{name_of(source)} has no faces, which a mesh needs: points and lines are not drawn{held}"
            )

    def leave_out(self, what: str) -> None:
        """Remember what isn't taken."""
        self._left_out[what] = None

    def warn(self) -> None:
        """Warn, once, of what isn't taken."""
        if self._left_out:
            warn_caller(f"not drawn of the mesh given: {', '.join(self._left_out)}")

    def part(self, vertices: Any, faces: Any, **others: Any) -> dict[str, Any]:
        """Return the arguments of a Mesh, of which those count that are not None."""
        vertices = checked_vertices(vertices)
        faces, cut_from = triangulate(faces, vertices)
        part = {"vertices": without_unused(vertices, faces)[0], "faces": faces}
        part |= {key: value for key, value in others.items() if value is not None and (key != "name" or value)}
        for key in ("colors", "face_colors"):
            if key in part and part[key].shape[-1] == 4:
                if part[key][..., 3].min(initial=255) < (255 if part[key].dtype == np.uint8 else 1.0):
                    self.leave_out("the alpha of vertex colours")
                    part[key] = part[key][..., :3]
        if cut_from is not None:
            part |= {"polygons": cut_from} | {key: part[key][cut_from] for key in _OF_FACES & part.keys()}
        if "normals" in part:
            part["normals"] = np.where(np.isfinite(part["normals"]).all(axis=-1, keepdims=True), part["normals"], 0.0)
        if "uv" in part:
            is_fine = np.isfinite(part["uv"])
            if not is_fine.all():
                self.leave_out("texture coordinates that are not finite: taken as 0")
                part["uv"] = np.where(is_fine, part["uv"], 0.0)
        else:
            for key, value in part.items():
                if key in ("material", "materials"):
                    part[key] = self._without_textures(value)
        return part

    def place(self, part: dict[str, Any], matrix: Any = None) -> None:
        """Add what `part` has returned, also once more, at a place."""
        if matrix is not None and not has_any_area(part["vertices"] @ matrix[:3, :3].T, part["faces"]):
            self.leave_out("a node of scale 0")
            return
        self.parts.append((part, matrix))

    def _without_textures(self, material: Any) -> Any:
        """Return materials that a mesh without texture coordinates can have."""
        if isinstance(material, tuple):
            return tuple(map(self._without_textures, material))
        if material.texture is None:
            return material
        self.leave_out("a texture, for want of texture coordinates")
        return material.without_textures()

    def texture(self, image: Any, make: Callable[[Any], Texture]) -> Texture:
        """Return the texture that is made of an image, each once."""
        key = id(image), make.__name__
        if key not in self._textures:
            self._textures[key] = image, make(image)
        return self._textures[key][1]

    def metallic(self, source: "Surface", has_colors: bool) -> Material:
        """Return a material of metal and roughness, as glTF has them."""
        (red, green, blue, alpha), mode = source.base, source.alpha_mode or "OPAQUE"
        common = opacity_fields(mode, alpha, 0.5 if source.alpha_cutoff is None else source.alpha_cutoff)
        texture = None
        if source.image is not None:
            texture = self.texture(source.image, _opaque if mode == "OPAQUE" else Texture)
        numbers: Any = None
        if source.numbers is not None:
            numbers = self.texture(source.numbers, Texture.of_numbers)
        mean, is_even = (None, True) if numbers is None else (numbers.mean, _is_even(numbers.image[..., 1:3]))
        surface = {"roughnessFactor": 1.0 if source.roughness is None else float(source.roughness)}
        surface |= {} if source.metallic is None else {"metallicFactor": float(source.metallic)}
        surface |= {} if numbers is None else {"metallicRoughnessTexture": numbers}
        described = {"pbrMetallicRoughness": surface}
        described |= {} if source.emissive is None else {"emissiveFactor": source.emissive}
        if source.has_emission_map:
            self.leave_out("emissive textures, with their emission")
            described["emissiveTexture"] = {}
        is_multiplied = texture is not None or has_colors
        fields = lit_fields(
            described, (red, green, blue), is_multiplied, lambda _: mean, 0.0, None if is_even else numbers
        )
        name = source.name if isinstance(source.name, str) else ""
        return Material(**fields, **common, emissive=emission_of(described), texture=texture, name=name)


class Surface(NamedTuple):
    """A material of metal and roughness; what is None isn't given."""

    base: Any  # (4,) linear colour and alpha
    image: Any = None  # that of its colour
    metallic: Any = None
    roughness: Any = None
    numbers: Any = None  # image of them
    emissive: Any = None
    has_emission_map: bool = False
    alpha_mode: str | None = None
    alpha_cutoff: Any = None
    name: Any = ""


def _opaque(image: Any) -> Texture:
    """Return a texture without alpha."""
    texture = Texture(image)
    if not texture.has_alpha:
        return texture
    pixels: Any = texture.image if texture.encoded is None else texture.encoded
    return Texture(pixels[..., :-1], name=texture.name)


def _is_even(values: NDArray[Any]) -> bool:
    return bool((values == values[0, 0]).all())


def name_of(source: object) -> str:
    """Return what an object is called in messages."""
    return f"a {type(source).__module__.partition('.')[0]} {type(source).__name__}"


def is_foreign(source: object) -> bool:
    """Tell an object of another library, which holds a mesh or several, from a sequence, a file and an array."""
    return _reader_of(source) is not None


def has_several(source: object) -> bool:
    """Tell whether an object of another library stands for several meshes."""
    return _reader_of(source) in (_read_trimesh_scene, _read_open3d_model) or hasattr(source, "GetNumberOfBlocks")


def _reader_of(source: object) -> Callable[[Foreign, Any], None] | None:
    if not isinstance(source, (list, tuple, dict, str, bytes, np.ndarray, type)):
        for names, read in _READERS:
            if all(hasattr(source, name) for name in names):
                return read
    return None


def _colors_of_bytes(colors: Any) -> NDArray[np.uint8]:
    """Return sRGB colours as files have them, in bytes; floats count from 0 to 1."""
    colors = plain_array(colors)
    is_bytes = colors.dtype.kind in "iu"
    return np.rint(np.clip(colors if is_bytes else colors * 255.0, 0.0, 255.0)).astype(np.uint8)


# --- trimesh ----------------------------------------------------------------------------------------------------------


def _read_trimesh_scene(found: Foreign, scene: Any) -> None:
    parts: dict[Any, dict[str, Any]] = {}  # each is made once, however many nodes show it
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        if not len(getattr(geometry, "faces", ())):
            found.leave_out(f"the {type(geometry).__name__} '{str(name)[:40]}'")
            continue
        if name not in parts:
            parts[name] = _trimesh_part(found, geometry, str(name))
        found.place(parts[name], matrix)


def _read_trimesh(found: Foreign, mesh: Any) -> None:
    found.place(_trimesh_part(found, mesh))


def _trimesh_part(found: Foreign, mesh: Any, name: str = "") -> dict[str, Any]:
    visual: Any = getattr(mesh, "visual", None)
    kind, n_vertex = getattr(visual, "kind", None), len(mesh.vertices)
    metadata = getattr(mesh, "metadata", None) or {}
    others: dict[str, Any] = {"normals": _given_normals(mesh)}
    if kind in ("vertex", "face"):
        own = plain_array(getattr(visual, f"{kind}_colors"))
        is_linear = "from_gltf_primitive" in metadata  # a file of glTF, where colours of vertices are
        others["colors" if kind == "vertex" else "face_colors"] = own / 255.0 if is_linear else own
    elif kind == "texture":
        colors = getattr(visual, "vertex_attributes", {}).get("color")
        if colors is not None and len(colors) == n_vertex:  # of glTF, where they are linear
            colors = plain_array(colors)
            others["colors"] = colors / np.iinfo(colors.dtype).max if colors.dtype.kind in "iu" else colors
        if np.shape(visual.uv) == (n_vertex, 2):
            others["uv"] = visual.uv
        materials = getattr(visual.material, "materials", None) or [visual.material]
        made = tuple(_trimesh_material(found, each, "colors" in others) for each in materials)
        numbers = getattr(visual, "face_materials", None)
        if len(made) > 1 and numbers is not None and len(numbers) == len(mesh.faces):
            others |= {"materials": made, "face_material": np.asarray(numbers)}
        else:
            others["material"] = made[0]
    name = name or metadata.get("name") or ""
    others["fields"] = Fields(getattr(mesh, "vertex_attributes", {}), getattr(mesh, "face_attributes", {}))
    return found.part(mesh.vertices, mesh.faces, name=name if isinstance(name, str) else "", **others)


def _given_normals(mesh: Any) -> Any:
    """Return the normals that a Trimesh holds, unless they are those that it computes when they are looked at, and
    keeps in the same place: the angle-weighted means in all digits. Those of files are rounded."""
    normals = getattr(mesh, "_cache", {})["vertex_normals"] if "vertex_normals" in getattr(mesh, "_cache", ()) else None
    if normals is None or np.shape(normals) != np.shape(mesh.vertices):
        return None
    from ..geometry.subdivide import average_normals

    vertices, faces = np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.uint32)
    means = average_normals(vertices, faces, 180.0, "angle", None)
    is_computed = means.shape == normals.shape and np.median(np.abs(means - normals).max(axis=1)) < _ROUNDING
    return None if is_computed else np.array(normals)


_ROUNDING = 1e-10  # of normals of float64; of float32, and of numbers in a text, it is from 1e-8 on


def _trimesh_material(found: Foreign, source: Any, has_colors: bool) -> Material | None:
    """Turn a PBRMaterial or SimpleMaterial into ours; None where nothing of it is given."""
    if hasattr(source, "baseColorFactor"):
        base = source.baseColorFactor
        for what in ("normal", "occlusion"):
            if getattr(source, f"{what}Texture", None) is not None:
                found.leave_out(f"{what} textures")
        surface = Surface(
            (1.0, 1.0, 1.0, 1.0) if base is None else tuple((np.asarray(base) / 255.0).tolist()),
            source.baseColorTexture,
            source.metallicFactor,
            source.roughnessFactor,
            source.metallicRoughnessTexture,
            source.emissiveFactor,
            source.emissiveTexture is not None,
            source.alphaMode,
            source.alphaCutoff,
            source.name,
        )
        return found.metallic(surface, has_colors)
    said = getattr(source, "kwargs", None) or {}
    words = {key: value for key, value in said.items() if key in COLORS + NUMBERS}
    if "kd" not in said and "ks" not in said:  # not out of an MTL file
        for key, field in (("kd", "diffuse"), ("ka", "ambient"), ("ks", "specular")):
            color = np.asarray(getattr(source, field, _NOT_GIVEN))
            if color[:3].tolist() != _NOT_GIVEN:
                words[key] = color[:3] / 255.0
            if key == "kd" and len(color) == 4 and color[3] < 255:
                words["d"] = color[3] / 255.0
        words |= {"ns": source._glossiness} if hasattr(source, "_glossiness") else {}
    image = getattr(source, "image", None)
    if not words and (image is None or np.array_equal(np.asarray(image), _EMPTY)):
        return None
    if "map_d" in said:
        found.leave_out("map_d")
    values: dict[str, Any] = {}
    for key, value in words.items():
        number, fault = value_of(key, " ".join(map(str, np.ravel(value).tolist())))
        values |= {} if number is None else {key: (number, 0)}
        if fault:
            found.leave_out(fault)
    texture = None
    if image is not None:
        texture = found.texture(image, Texture)
        values |= {"map_kd": (True, 0)}
    doubts: Doubts = set()
    name = source.name if isinstance(source.name, str) else ""
    material = material_of(name, values, texture, False, doubts, lambda text, line: None)
    for _, doubt in sorted(doubts):
        found.leave_out(doubt)
    return material


def lights_and_camera(source: Any) -> tuple[tuple[Light, ...] | None, Camera | None]:
    """Return the lights and the camera of a scene of trimesh; None of what it hasn't. Lights that it makes by itself,
    when they are looked at, don't count."""
    if _reader_of(source) is not _read_trimesh_scene:
        return None, None
    lights, camera = [], None
    given = getattr(source, "_lights", None) or ()
    is_default = [list(light.color[:3]) == _LIGHT_NOT_GIVEN and light.intensity == 1.0 for light in given]
    for light in () if all(is_default) else given:
        described = {"type": type(light).__name__.removesuffix("Light").lower(), "intensity": light.intensity}
        described |= {"color": (light.color[:3] / 255.0).tolist(), "range": light.radius}
        if hasattr(light, "outerConeAngle"):
            described["spot"] = {name: getattr(light, name) for name in ("innerConeAngle", "outerConeAngle")}
        lights.append(light_of(described, np.asarray(source.graph[light.name][0])))
    if getattr(source, "has_camera", False):
        across, up = np.radians(source.camera.fov) / 2.0
        lens = {"yfov": 2.0 * up, "aspectRatio": np.tan(across) / np.tan(up), "znear": source.camera.z_near}
        camera = camera_of({"type": "perspective", "perspective": lens}, np.asarray(source.camera_transform))
    return tuple(lights) or None, camera


# --- Open3D -----------------------------------------------------------------------------------------------------------


def _read_open3d(found: Foreign, mesh: Any, material: Material | None = None, name: str = "") -> None:
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    names = ("vertex_normals", "vertex_colors", "triangle_uvs")
    normals, colors, uv = (np.asarray(getattr(mesh, name)) for name in names)
    others: dict[str, Any] = {"material": material, "name": name}
    others["normals"] = normals if len(normals) == len(vertices) else None
    others["colors"] = _colors_of_bytes(colors) if len(colors) == len(vertices) else None
    others["uv"] = uv.reshape(-1, 3, 2) if len(uv) == 3 * len(faces) else None
    images, numbers = [np.asarray(image) for image in mesh.textures], np.asarray(mesh.triangle_material_ids)
    if material is None and any(image.ndim > 1 for image in images):
        # Their first row is the lowest one. As the MTL file that Open3D writes has it, they don't shine.
        made = tuple(
            Material(diffuse=1.0, specular=0.0, texture=Texture(image[::-1])) if image.ndim > 1 else Material()
            for image in images
        )
        if len(made) > 1 and len(numbers) == len(faces):
            others |= {"materials": made, "face_material": numbers}
        else:
            others["material"] = made[0]
    if len(faces):
        found.place(found.part(vertices, faces, **others))


def _read_open3d_model(found: Foreign, model: Any) -> None:
    made = [_open3d_material(found, record) for record in model.materials]
    for each in model.meshes:
        _read_open3d(found, each.mesh, made[each.material_idx] if made else None, each.mesh_name)


def _open3d_material(found: Foreign, record: Any) -> Material:
    image = None if record.albedo_img is None else np.asarray(record.albedo_img)
    image = image if image is not None and image.ndim > 1 else None
    base = tuple(map(float, record.base_color))
    mode = "BLEND" if base[3] < 1.0 else None
    return found.metallic(
        Surface(base, image, record.base_metallic, record.base_roughness, alpha_mode=mode), has_colors=False
    )


def _read_open3d_tensor(found: Foreign, mesh: Any) -> None:
    vertex, triangle = ({key: each[key].cpu().numpy() for key in each} for each in (mesh.vertex, mesh.triangle))
    if not len(triangle.get("indices", ())):
        return
    colors, uv, material = vertex.get("colors"), triangle.get("texture_uvs"), None
    if mesh.has_valid_material():
        source = mesh.material
        maps, scalars = dict(source.texture_maps), dict(source.scalar_properties)
        base = [float(value) for value in dict(source.vector_properties).get("base_color", np.ones(4))]
        image = maps.pop("albedo", None)
        for what in maps:
            found.leave_out(f"{what} textures")
        image = None if image is None else image.as_tensor().cpu().numpy()
        metallic = scalars.get("metallic", scalars.get("base_metallic"))
        roughness = scalars.get("roughness", scalars.get("base_roughness"))
        mode = "BLEND" if base[3] < 1.0 else None
        surface = Surface(base, image, metallic, roughness, alpha_mode=mode)
        material = found.metallic(surface, colors is not None)
    part = found.part(
        vertex["positions"],
        triangle["indices"],
        normals=vertex.get("normals"),
        colors=None if colors is None else _colors_of_bytes(colors),
        uv=uv,
        material=material,
        fields=Fields(vertex, triangle),
    )
    found.place(part)


# --- VTK and PyVista --------------------------------------------------------------------------------------------------


def _read_vtk_blocks(found: Foreign, blocks: Any) -> None:
    for k in range(blocks.GetNumberOfBlocks()):
        block = blocks.GetBlock(k)
        if block is not None:
            name = blocks.GetMetaData(k).Get(blocks.NAME()) if blocks.HasMetaData(k) else None
            if hasattr(block, "GetNumberOfBlocks"):
                _read_vtk_blocks(found, block)
            else:
                _read_vtk(found, block, name or "")


def _read_vtk(found: Foreign, mesh: Any, name: str = "") -> None:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    mesh_given = mesh
    if not mesh.IsA("vtkPolyData"):
        from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

        mesh = _filtered(vtkDataSetSurfaceFilter(), mesh)
    if mesh.GetNumberOfStrips():
        from vtkmodules.vtkFiltersCore import vtkTriangleFilter

        mesh = _filtered(vtkTriangleFilter(), mesh)
    n_before = mesh.GetNumberOfVerts() + mesh.GetNumberOfLines()  # whose cells stand before the polygons
    for n, what in ((mesh.GetNumberOfVerts(), "points"), (mesh.GetNumberOfLines(), "lines")):
        if n:
            found.leave_out(what)
    if not mesh.GetNumberOfPolys():
        return
    polygons = mesh.GetPolys()
    corners, ends = map(vtk_to_numpy, (polygons.GetConnectivityArray(), polygons.GetOffsetsArray()))
    counts = np.diff(ends)
    is_plain = (counts == counts[0]).all()
    faces = corners.reshape(-1, counts[0]) if is_plain else np.split(corners, ends[1:-1])
    others: dict[str, Any] = {"name": name}
    of_points, of_cells = mesh.GetPointData(), mesh.GetCellData()
    actives, shown_name = [], None
    for key, array in (("normals", of_points.GetNormals()), ("uv", of_points.GetTCoords())):
        if array is not None and array.GetNumberOfComponents() == (3 if key == "normals" else 2):
            others[key] = vtk_to_numpy(array)
    for key, data in (("colors", of_points), ("face_colors", of_cells)):
        active = data.GetScalars()
        named = [data.GetArray(k) for k in range(data.GetNumberOfArrays())]
        named = [each for each in named if each is not None and str(each.GetName()).lower() in _COLOR_NAMES]
        found_colors = next((each for each in (active, *named) if each is not None and _holds_colors(each)), None)
        if found_colors is not None:
            others[key] = vtk_to_numpy(found_colors)[n_before if key == "face_colors" else 0 :]
        elif active is not None and active.GetNumberOfComponents() == 1:
            actives.append(active.GetName())
        elif active is not None:
            found.leave_out(f"the active array '{active.GetName()}', which isn't one number each")
    if not others.keys() & {"colors", "face_colors"} and actives:
        active_name = getattr(mesh_given, "active_scalars_name", None)
        shown_name = active_name if active_name in actives else actives[0]
    of_places = [
        {each.GetName(): vtk_to_numpy(each)[n:] for each in map(data.GetArray, range(data.GetNumberOfArrays())) if each}
        for data, n in ((of_points, 0), (of_cells, n_before))
    ]
    others["fields"] = Fields(of_places[0], of_places[1], shown_name)
    found.place(found.part(vtk_to_numpy(mesh.GetPoints().GetData()), faces, **others))


def _holds_colors(array: Any) -> bool:
    """Tell whether VTK draws an array as colours: bytes, 3 or 4 each."""
    return array.GetNumberOfComponents() in (3, 4) and array.GetDataTypeAsString() == "unsigned char"


def _filtered(filter: Any, mesh: Any) -> Any:
    filter.SetInputData(mesh)
    filter.Update()
    return filter.GetOutput()


# --- meshio -----------------------------------------------------------------------------------------------------------


def _read_meshio(found: Foreign, mesh: Any) -> None:
    blocks = [(k, block) for k, block in enumerate(mesh.cells) if block.type in ("triangle", "quad", "polygon")]
    for block in mesh.cells:
        if block.type not in ("triangle", "quad", "polygon"):
            found.leave_out(f"cells of {block.type}")
    if not blocks:
        return
    faces: Any = [face for _, block in blocks for face in block.data]
    faces = np.array(faces) if len({len(face) for face in faces}) == 1 else faces
    data, cell_data = mesh.point_data, {}
    for key, columns in mesh.cell_data.items():
        cell_data[key] = np.concatenate([np.asarray(columns[k]) for k, _ in blocks])
    part = found.part(
        mesh.points[:, :3] if mesh.points.shape[1] > 2 else np.pad(mesh.points, ((0, 0), (0, 1))),
        faces,
        normals=_columns(data, ("nx", "ny", "nz"), "obj:vn"),
        uv=_columns(data, ("u", "v"), "obj:vt") if "u" in data or "obj:vt" in data else _columns(data, ("s", "t")),
        colors=_meshio_colors(data),
        face_colors=_meshio_colors(cell_data),
        fields=Fields(data, cell_data),
    )
    found.place(part)


def _meshio_colors(data: Any) -> Any:
    colors = _columns(data, ("red", "green", "blue", "alpha"))
    colors = _columns(data, ("red", "green", "blue")) if colors is None else colors
    return None if colors is None else _colors_of_bytes(colors)


def _columns(data: Any, names: tuple[str, ...], whole_name: str = "") -> Any:
    """Return columns of data that are all there, side by side, or those of one name; None where they aren't."""
    if all(name in data for name in names):
        return np.stack([np.asarray(data[name]) for name in names], axis=1)
    found = np.asarray(data.get(whole_name, ()))
    return found[:, : len(names)] if found.ndim == 2 and found.shape[1] >= len(names) else None


# By what an object has; the first counts.
_READERS: tuple[tuple[tuple[str, ...], Callable[[Foreign, Any], None]], ...] = (
    (("geometry", "graph"), _read_trimesh_scene),
    (("GetNumberOfBlocks", "GetBlock"), _read_vtk_blocks),
    (("GetPointData", "IsA"), _read_vtk),
    (("vertices", "faces"), _read_trimesh),
    (("vertices", "triangles"), _read_open3d),
    (("vertex", "triangle"), _read_open3d_tensor),
    (("meshes", "MeshInfo"), _read_open3d_model),
    (("points", "cells"), _read_meshio),
)
