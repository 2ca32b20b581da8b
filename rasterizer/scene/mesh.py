"""A mesh: vertices, triangles and what belongs to them, checked once so that no later stage has to.

    in:  arrays as people have them (any real dtype, triangles, quads, ragged polygons)
    out: contiguous read-only arrays: float64 vertices, uint32 triangles, float64 attributes, colours linear

The arrays given are never changed, and copied: writing into them afterwards doesn't change the mesh. Those of another
mesh are shared: nobody can write into them.
"""

from collections.abc import Iterable
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..choices import AXES, WEIGHTINGS, Axis, Weighting
from ..errors import ModelError, SceneError, counted, shown, warn_caller
from ..keywords import checked_fields
from ..locks import cached_property
from . import mesh_arrays
from .arrays import KeepsArrays, VectorLike, fixed, is_fixed, real_array
from .foreign import Foreign, has_several, is_foreign, name_of
from .framing import rotation
from .material import GREY, WHITE, Material
from .scalars import NO_SCALARS, ScalarWords
from .validate import COORDINATE_LIMIT, choice, items_of, number, position3, store, text, unit3, vector3, whole

DEFAULT_CREASE_ANGLE = 30.0  # degrees
MAX_SUBDIVISIONS = 15  # the next makes 2^32 faces of one
_SIDE_BY_SIDE = 256  # vertices
MAX_FACES = 2**31 - 1  # of a mesh and of a scene: face indices are int32, -1 means nothing hit


class HasFaces(Protocol):
    """What is taken for a mesh: `trimesh.Trimesh` and its like."""

    @property
    def vertices(self) -> Any:
        """(n_vertex, 3) numbers."""

    @property
    def faces(self) -> Any:
        """(n_face, 3) integers."""


class HasPoints(Protocol):
    """What is taken for a mesh, too: PyVista's data sets, and the Mesh of meshio."""

    @property
    def points(self) -> Any:
        """(n_vertex, 3) numbers."""


@checked_fields
@dataclass(frozen=True, eq=False, repr=False)
class Mesh(KeepsArrays):
    """Hold a triangle mesh; polygons with more corners are cut into triangles, once and for all: quads along their
    shorter diagonal, see `triangulation.py`.

    Parameters
    ----------
    vertices : (n_vertex, 3) any real dtype, scene units; stored float64
    faces : (n, k) integers, k >= 3, or a list of polygons of any length >= 3, counter-clockwise seen from
        outside; stored (n_face, 3) uint32
    normals : (n_vertex, 3), or (n_face, 3, 3) for each corner of each triangle; stored float64 of unit
        length. Where a zero was given, it is computed from the faces, as if there were none; it stays zero
        where no face with an area meets the vertex
    colors : (n_vertex, 3 or 4), or (n_face, 3, 3 or 4) for each corner of each triangle; uint8 = sRGB-encoded, float =
        linear, as everywhere here; stored float64, linear. They multiply the material's diffuse and ambient
        coefficients, and so does a texture: without a material it is white, and they are drawn as they are. Floats of a
        colormap are sRGB: `colors=rz.srgb(cmap(values))`. A largest float of 2 to 255 is refused: that is uint8. An
        alpha is kept, and not drawn: opacity is the material's, or its texture's
    uv : (n_vertex, 2), or (n_face, 3, 2) for each corner; texture coordinates, stored float64. Four in the place of two
        are those of textures, then those of `metallic_roughness`, which is laid by the others else
    material : Material; not given: neutral grey, or white where there are colours
    crease_angle : degrees within 0..180; an edge between faces that meet at more stays sharp. None = the
        normals given, else the smoothing groups, else 30
    face_colors : (n_face, 3 or 4) as `colors`, one a face: a triangle, or a polygon as given
    polygons : (n_face,) integers, which polygon each triangle came from; only with triangles. Stored int32,
        made where polygons are cut or faces dropped; None where every triangle is its own polygon. Flat shading
        lights a polygon once, and edges are those of polygons
    smoothing : (n_face,) integers, OBJ smoothing groups, 0 = none; one a triangle, or a polygon as given;
        stored int32
    materials : sequence of Material, where faces differ; `material` is then the first of them. Normals are averaged
        across their borders
    face_material : (n_face,) integers, index into `materials`, one a triangle, or a polygon as given; stored int32.
        Needed where `materials` are given, and only there
    weighting : "angle", "area" or "uniform": what the normals of the faces round a vertex count by where they are
        averaged: the angle of the face's corner (Thürmer & Wüthrich 1998: doesn't depend on how a flat polygon is cut),
        the face's area, or all alike (Gouraud 1971). Without effect where the normals given are used
    name : text, for reports
    drop_bad_faces : whether to drop the faces that use vertices whose coordinates are not finite, instead of
        raising an error. Those vertices are then moved onto the first good one, and normals that are not
        finite count as zero

    Raises
    ------
    ModelError : shapes and dtypes that don't fit, indices out of range, values that are not finite, no
        vertices, no faces, no face that has an area
    SceneError : a material, crease angle, weighting or name that is not legal

    Warns
    -----
    UserWarning : polygons that cross themselves; colours with an alpha below 1
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.uint32]
    normals: NDArray[np.float64] | None = None
    colors: NDArray[np.float64] | None = None
    uv: NDArray[np.float64] | None = None
    material: Material = GREY
    crease_angle: float | None = None
    _: KW_ONLY
    face_colors: NDArray[np.float64] | None = None
    polygons: NDArray[np.int32] | None = None
    smoothing: NDArray[np.int32] | None = None
    materials: tuple[Material, ...] | None = None
    face_material: NDArray[np.int32] | None = None
    weighting: Weighting = "angle"
    name: str = ""
    drop_bad_faces: bool = False
    is_welded: ClassVar[bool] = False  # True of a mesh that is known to have no two vertices at one position

    if TYPE_CHECKING:  # more may be given than is stored

        def __init__(
            self,
            vertices: ArrayLike,
            faces: ArrayLike | Iterable[Iterable[int]],
            normals: ArrayLike | None = ...,
            colors: ArrayLike | None = ...,
            uv: ArrayLike | None = ...,
            material: Material = ...,
            crease_angle: float | None = ...,
            *,
            face_colors: ArrayLike | None = ...,
            polygons: ArrayLike | None = ...,
            smoothing: ArrayLike | None = ...,
            materials: Iterable[Material] | None = ...,
            face_material: ArrayLike | None = ...,
            weighting: Weighting = ...,
            name: str = ...,
            drop_bad_faces: bool = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        choice(self.weighting, WEIGHTINGS, "a mesh's weighting")
        text(self.name, "a mesh's name")
        store(self, crease_angle=checked_crease_angle(self.crease_angle))
        if self.material is GREY or self.material is WHITE:  # it isn't given
            is_grey = self.materials is not None or (self.colors is None and self.face_colors is None)
            store(self, material=GREY if is_grey else WHITE)
        store(self, materials=_checked_materials(self.material, self.materials))
        store(self, material=self.palette[0])
        vertices = mesh_arrays.checked_vertices(self.vertices)
        faces, cut_from = mesh_arrays.triangulate(self.faces, vertices)
        attributes = self._checked_attributes(len(vertices), len(faces), cut_from)
        polygons, face_material = attributes["polygons"], attributes["face_material"]
        if (self.materials is None) != (face_material is None):
            raise ModelError("materials and face_material must be given together")
        if polygons is not None and face_material is not None:
            _check_polygon_materials(polygons, face_material)
        for material in self.palette if self.uv is None else ():
            if material.texture is not None:
                raise ModelError("a mesh with a texture needs texture coordinates, uv")
            if material.needs_uv:
                what = "a mesh brushed along u (two numbers of roughness, tangent='u')"
                raise ModelError(f"{what} needs texture coordinates, uv; or give the material's tangent as an axis")
        vertices, keep = mesh_arrays.without_bad_vertices(vertices, faces, polygons, self.drop_bad_faces)
        if keep is not None:
            if polygons is None:
                attributes["polygons"] = np.arange(len(faces), dtype=np.int32)
            faces = faces[keep]
            for key, array in attributes.items():
                if array is not None and (key not in ("normals", "uv", "colors") or array.ndim == 3):
                    attributes[key] = array[keep]
        if not mesh_arrays.has_any_area(vertices, faces):
            raise ModelError(f"every face has zero area: {len(faces)} faces, all of them points or lines")
        attributes |= {"vertices": vertices, "faces": faces}
        if attributes["normals"] is not None and self.crease_angle is None:
            attributes["normals"] = mesh_arrays.filled_normals(attributes, DEFAULT_CREASE_ANGLE, self.weighting)
        for key, array in attributes.items():
            if array is not None:
                store(self, **{key: fixed(array)})

    def _checked_attributes(self, n_vertex: int, n_face: int, cut_from: NDArray[np.int32] | None) -> dict[str, Any]:
        """Return what belongs to vertices, corners and faces, checked; None of what there isn't.

        Parameters
        ----------
        n_vertex, n_face : vertices and triangles
        cut_from : (n_face,) int32 polygon that each triangle was cut from; None where none was cut
        """
        found: dict[str, Any] = {"polygons": cut_from, "face_material": None, "normals": None}
        counts = (n_face,) if cut_from is None else tuple(dict.fromkeys((n_face, int(cut_from[-1]) + 1)))
        n_corner_face = n_face if cut_from is None else None  # whose corners are those of faces as given
        places = n_vertex, n_corner_face
        if self.polygons is not None:
            if cut_from is not None:
                raise ModelError("polygons may be given only with triangles; these faces have more corners")
            found["polygons"] = mesh_arrays.checked_ints(self.polygons, counts, "polygons")
        if self.normals is not None:
            normals = mesh_arrays.checked_floats(self.normals, places, (3,), "normals", self.drop_bad_faces)
            found["normals"] = mesh_arrays.unit_normals(normals)
        if self.uv is not None:
            found["uv"] = mesh_arrays.checked_floats(self.uv, places, (2, 4), "uv", self.drop_bad_faces)
        if self.colors is not None:
            found["colors"] = mesh_arrays.checked_colors(self.colors, (n_vertex,), "colors", n_corner_face)
        if self.face_colors is not None:
            found["face_colors"] = mesh_arrays.checked_colors(self.face_colors, counts, "face_colors")
        for key in ("colors", "face_colors"):
            array, given = found.get(key), getattr(self, key)
            if array is not None and array.shape[-1] == 4 and array[..., 3].min() < 1.0:
                if not (isinstance(given, np.ndarray) and is_fixed(given)):  # else it has been told of
                    warn_caller("the alpha of vertex colours is not drawn: opacity is the material's, or its texture's")
        if self.smoothing is not None:
            found["smoothing"] = mesh_arrays.checked_ints(self.smoothing, counts, "smoothing")
        if self.face_material is not None:
            found["face_material"] = indices = mesh_arrays.checked_ints(self.face_material, counts, "face_material")
            if indices.max() >= len(self.palette):
                given = f"given {indices.min()} to {indices.max()}"
                raise ModelError(f"face_material must be within 0..{len(self.palette) - 1}; {given}")
        for key in ("face_colors", "smoothing", "face_material"):
            if cut_from is not None and found.get(key) is not None and len(found[key]) != n_face:
                found[key] = found[key][cut_from]  # one a polygon was given
        return found

    def __repr__(self) -> str:
        name = f"{self.name!r}, " if self.name else ""
        extras = ("normals", "colors", "uv", "face_colors", "polygons", "smoothing", "face_material")
        given = "".join(f", {key}" for key in extras if getattr(self, key) is not None)
        return f"Mesh({name}{counted(self.n_vertex, 'vertex')}, {counted(self.n_face, 'face')}{given})"

    @classmethod
    def from_any(cls, source: "MeshLike") -> "Mesh":
        """Make a mesh of one of trimesh, PyVista, VTK, Open3D or meshio, with its materials, textures and colours as
        `foreign.py` says, or of (vertices, faces); a Mesh stays what it is.

        Raises
        ------
        ModelError : anything else, what stands for several meshes, and whatever the class itself refuses

        Warns
        -----
        UserWarning : what can't be taken of a foreign mesh
        """
        if has_several(source):
            raise ModelError(f"{name_of(source)} may hold several meshes: give it to load(), render() or Scene")
        return meshes_from(source, {})[0]

    @property
    def palette(self) -> tuple[Material, ...]:
        """The materials that `face_material` numbers: `materials`, or the one material."""
        return (self.material,) if self.materials is None else self.materials

    @property
    def is_opaque(self) -> bool:
        """Whether nothing is seen through it, nor through what is cut out of it."""
        return all(material.is_opaque and not material.is_cut_out for material in self.palette)

    @property
    def creases(self) -> tuple[float, NDArray[np.int32] | None]:
        """Where normals that are computed are split: at edges between faces that meet at more than so many degrees; or
        by smoothing groups (n_face,), which count in its place where they are not None."""
        if self.crease_angle is not None:
            return self.crease_angle, None
        return DEFAULT_CREASE_ANGLE, self.smoothing

    @property
    def n_vertex(self) -> int:
        """Number of vertices."""
        return len(self.vertices)

    @property
    def n_face(self) -> int:
        """Number of triangles."""
        return len(self.faces)

    @cached_property
    def used_vertices(self) -> NDArray[np.float64]:
        """The vertices (n, 3) float64 that at least one face uses: `vertices` itself where all are used."""
        is_used = np.zeros(self.n_vertex, dtype=bool)
        for start in range(0, self.n_face, mesh_arrays.CHUNK):  # numpy would turn all indices into int64 at once
            is_used[self.faces[start : start + mesh_arrays.CHUNK].ravel()] = True
        return self.vertices if is_used.all() else fixed(self.vertices[is_used])

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Lowest and highest corner (2, 3) float64 of the box round the used vertices, scene units."""
        low = high = points = self.used_vertices
        n_row = len(points) // _SIDE_BY_SIDE
        if n_row > 1:  # NumPy is slow down three columns: most vertices are taken for the rows of a wider table
            end = n_row * _SIDE_BY_SIDE
            rows, rest = points[:end].reshape(n_row, 3 * _SIDE_BY_SIDE), points[end:]
            low = np.concatenate([rows.min(axis=0).reshape(-1, 3), rest])
            high = np.concatenate([rows.max(axis=0).reshape(-1, 3), rest])
        return fixed(np.array([low.min(axis=0), high.max(axis=0)]))

    def transformed(self, matrix: ArrayLike) -> "Mesh":
        """Return a copy that is moved by an affine matrix.

        Normals go by the inverse transpose; a matrix that mirrors also turns the faces' winding round, so
        that the outside stays outside.

        Parameters
        ----------
        matrix : (4, 4) new-from-old, its last row (0, 0, 0, 1)

        Raises
        ------
        SceneError : another shape, values that are not finite, a projective matrix
        ModelError : a matrix that leaves no face an area, or moves vertices out of the legal range
        """
        matrix = _checked_affine(matrix)
        linear = matrix[:3, :3]
        is_mirrored = np.linalg.det(linear) < 0.0
        changes: dict[str, Any] = {"vertices": fixed(self.vertices @ linear.T + matrix[:3, 3])}
        if self.normals is not None:
            # the cofactor matrix is the inverse transpose times the determinant; it exists for every matrix
            a, b, c = linear
            cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
            changes["normals"] = self.normals @ (-cofactors.T if is_mirrored else cofactors.T)
        if is_mirrored:
            turn = [0, 2, 1]
            changes["faces"] = self.faces[:, turn]
            for key in ("normals", "uv", "colors"):
                array = changes.get(key, getattr(self, key))
                if array is not None and array.ndim == 3:
                    changes[key] = array[:, turn]
        return replace(self, **changes)

    def translated(self, offset: VectorLike) -> "Mesh":
        """Return a copy that is moved by an `offset` of three numbers, scene units.

        Raises
        ------
        SceneError : an offset that is not legal
        ModelError : vertices that leave the legal range
        """
        matrix = np.eye(4)
        matrix[:3, 3] = position3(offset, "the offset")
        return self.transformed(matrix)

    def rotated(self, angle: float, axis: VectorLike | Axis = "y", about: VectorLike = (0, 0, 0)) -> "Mesh":
        """Return a copy that is turned about an axis.

        Parameters
        ----------
        angle : degrees, counter-clockwise as seen from the axis' tip
        axis : three numbers of any length above 0, or "x", "y", "z", "-x", "-y", "-z"
        about : three numbers, a point of the axis, scene units

        Raises
        ------
        SceneError : a value that is not legal
        ModelError : vertices that leave the legal range
        """
        direction = AXES[choice(axis, AXES, "the axis")] if isinstance(axis, str) else unit3(axis, "the axis")
        return self.transformed(_about(rotation(direction, number(angle, "the angle")), about))

    def scaled(self, factor: float | VectorLike, about: VectorLike = (0, 0, 0)) -> "Mesh":
        """Return a copy that is larger or smaller.

        Parameters
        ----------
        factor : number, or three of them, along x, y and z; not 0. Where an odd number of them is negative, the mesh is
            mirrored, and its outside stays outside
        about : three numbers, the point that stays, scene units

        Raises
        ------
        SceneError : a value that is not legal
        ModelError : vertices that leave the legal range, or no face that has an area left
        """
        is_one = not isinstance(factor, (str, bytes)) and not hasattr(factor, "__len__")
        factors = (number(factor, "the factor"),) * 3 if is_one else vector3(factor, "the factor")
        if 0.0 in factors:
            raise SceneError(f"the factor must not be 0; given {shown(factor)}")
        return self.transformed(_about(np.diag(factors), about))

    def with_material(self, material: Material | str) -> "Mesh":
        """Return a copy all faces of which have one material.

        Parameters
        ----------
        material : Material, or the name of one of the classic table, as `Material.named` takes it

        Raises
        ------
        SceneError : no Material, or an unknown name
        ModelError : a material that needs texture coordinates, which the mesh hasn't
        """
        material = Material.named(material) if isinstance(material, str) else material
        return replace(self, material=material, materials=None, face_material=None)

    def subdivide(self, times: int = 1) -> "Mesh":
        """Return a mesh of the same surface in smaller triangles: a remedy for the faults of Gouraud's method.

        Every triangle is cut at the midpoints of its edges into four that lie in it: face f becomes the faces
        4f..4f + 3. The surface and so its silhouette stay, but for the rounding of the new vertices, which are placed
        to 1/256 px like all.
        Colours and texture coordinates are interpolated. A polygon stays one polygon, so flat shading lights it once.

        Normals that the mesh has are interpolated, and made unit vectors: Gouraud's picture comes nearer to
        Phong's each time, and finds highlights inside large faces. Where they are to be computed, they are computed
        first, up to the creases; the result has its normals as its own, and `crease_angle` None. An edge that leans
        against the normals of both its ends by more than 15 degrees hides a fold, as in a saw-tooth: the faces at
        the edge tell the normal of its middle.

        Parameters
        ----------
        times : whole number, 0 (the mesh itself) to 15; each makes four times as many faces

        Raises
        ------
        SceneError : another number
        ModelError : more than 2^31 - 1 faces
        """
        times = whole(times, "how often a mesh is subdivided", 0, MAX_SUBDIVISIONS)
        n_face, mesh = self.n_face * 4**times, self
        if n_face > MAX_FACES:
            legal = f"a mesh may have up to {MAX_FACES} faces"
            raise ModelError(f"{legal}; subdivided {times} times, its {self.n_face} would be {n_face}")
        for _ in range(times):
            mesh = mesh._cut_once()
        return mesh

    def _cut_once(self) -> "Mesh":
        """Cut every triangle in four."""
        from ..geometry.subdivide import Surface, average_normals, cut_once, unfold

        surface, (angle, smoothing) = Surface(*(getattr(self, name) for name in Surface._fields)), self.creases
        if self.normals is not None and self.crease_angle is None:
            return replace(self, **cut_once(surface)._asdict())
        normals = average_normals(self.vertices, self.faces, angle, self.weighting, smoothing)
        surface = surface._replace(normals=normals)
        cut = cut_once(surface)
        finer = replace(self, crease_angle=None, **cut._asdict())  # whose normals are unit vectors
        groups = None if smoothing is None else cut.smoothing
        found = unfold(surface, cut._replace(normals=finer.normals), angle, self.weighting, groups)
        return finer if found is None else replace(finer, normals=found)


MeshLike: TypeAlias = Mesh | HasFaces | HasPoints | tuple[ArrayLike, ArrayLike]  # what `Mesh.from_any` takes


def meshes_from(source: Any, settings: dict[str, Any], scalars: ScalarWords | None = None) -> list[Mesh]:
    """Return the meshes of a mesh, of an object of another library that holds several, or of a sequence of these.

    Parameters
    ----------
    source : what `Mesh.from_any` takes, a scene of trimesh, blocks of PyVista, or a sequence of these
    settings : arguments of Mesh, taken in place of what the source says
    scalars : which scalar field the meshes show; None = the active ones of foreign meshes

    Raises
    ------
    ModelError : an empty sequence, a scene without faces, and whatever `Mesh.from_any` refuses

    Warns
    -----
    UserWarning : what can't be taken of foreign meshes: once, of all of them
    """
    if isinstance(source, list) and source and scalars is None and not settings:
        if all(isinstance(each, Mesh) for each in source):
            return source
    is_sequence = isinstance(source, Iterable) and not (hasattr(source, "ndim") or isinstance(source, dict))
    if is_one_mesh(source) or not is_sequence:
        source = (source,)
    placed: list[tuple[dict[str, Any], Any]] = []  # the arguments of meshes, and their places, or meshes
    found = Foreign()
    for each in source:
        if isinstance(each, (tuple, list)) and len(each) == 2:
            each = Mesh(each[0], each[1], **settings)
        if isinstance(each, Mesh):
            part = {"vertices": each.vertices, "faces": each.faces, "polygons": each.polygons}
            placed.append((part, replace(each, **settings) if settings else each))
        elif is_foreign(each):
            n_before = len(found.parts)
            found.add(each)
            placed += found.parts[n_before:]
        else:
            raise _no_mesh(each)
    if not placed:
        raise ModelError("a model needs at least one mesh; given an empty sequence")
    found.warn()
    (scalars or NO_SCALARS).lay({id(part): part for part, _ in placed}.values())
    return _placed_meshes(placed, settings)


def is_one_mesh(source: object) -> bool:
    """Tell one mesh from a sequence; a pair is (vertices, faces) where its first item is a list of points."""
    if not isinstance(source, (tuple, list)):
        return isinstance(source, Mesh) or is_foreign(source)
    if len(source) != 2:
        return False
    points = source[0]
    if isinstance(points, (tuple, list)):
        # its first item is a point, or the vertices of the first of two pairs
        return len(points) == 0 or np.size(points[0]) == 3
    return np.ndim(points) == 2 or (hasattr(points, "__dlpack__") and not hasattr(points, "ndim"))


def _placed_meshes(placed: list[tuple[dict[str, Any], Any]], settings: dict[str, Any]) -> list[Mesh]:
    """Make the meshes of foreign parts, each once, and move them to their places; let meshes that are there already
    show a scalar field. Vertices at one position are joined where normals are averaged, as the readers of files do."""
    from ..geometry.weld import weld

    made: dict[int, Mesh] = {}
    meshes = []
    for part, place in placed:
        if isinstance(place, Mesh):
            if "uv" in part:
                plain: dict[str, Any] = dict.fromkeys(("materials", "face_material", "colors", "face_colors"))
                place = replace(place, **plain | {"uv": part["uv"], "material": part["material"]})
            meshes.append(place)
            continue
        if id(part) not in made:
            is_averaged = "normals" not in part or settings.get("crease_angle") is not None
            made[id(part)] = Mesh(**(weld(part) if is_averaged else part) | settings)
        mesh = made[id(part)]
        meshes.append(mesh if place is None or np.array_equal(place, np.eye(4)) else mesh.transformed(place))
    return meshes


def _no_mesh(source: Any) -> ModelError:
    """Return the error for what is no mesh."""
    if any(hasattr(source, name) for name in ("vertices", "points", "point")) or np.shape(source)[1:] == (3,):
        return ModelError(f"a mesh needs faces: points and lines alone are not drawn; given {shown(source)}")
    legal = "a Mesh, one of trimesh, PyVista, VTK, Open3D or meshio, or (vertices, faces)"
    legal += "; load() and render() take a file as well"
    return ModelError(f"a mesh must be {legal}; given {shown(source)}")


def checked_crease_angle(angle: object) -> float | None:
    """Return the crease angle as a float within 0..180 degrees, or None."""
    return None if angle is None else number(angle, "the crease angle", low=0, high=180, unit=" degrees")


def _checked_materials(material: object, materials: Any) -> tuple[Material, ...] | None:
    """Return the materials of a mesh whose faces differ, or None where it has one; the two must not contradict each
    other."""
    if not isinstance(material, Material):
        raise SceneError(f"a mesh's material must be a Material; given {shown(material)}")
    if materials is None:
        return None
    materials = tuple(items_of(materials))
    if not materials or not all(isinstance(each, Material) for each in materials):
        raise SceneError(f"a mesh's materials must be a sequence of Material, not empty; given {shown(materials)}")
    if material not in (GREY, materials[0]):
        raise SceneError("a mesh takes one material, or materials and face_material; given both")
    return materials


def _check_polygon_materials(polygons: NDArray[np.int32], face_material: NDArray[np.int32]) -> None:
    """Refuse polygons whose triangles have different materials: flat shading lights a polygon once."""
    order = np.lexsort((face_material, polygons))
    polygon, material = polygons[order], face_material[order]
    torn = np.flatnonzero((polygon[1:] == polygon[:-1]) & (material[1:] != material[:-1]))
    if len(torn):
        given = f"those of polygon {polygon[torn[0]]} differ"
        raise ModelError(f"the triangles of a polygon must have one material; {given}")


def _about(linear: NDArray[np.float64], about: VectorLike) -> NDArray[np.float64]:
    """Return the affine matrix (4, 4) that leaves a point where it is."""
    point, matrix = np.array(position3(about, "the point that stays")), np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, point - linear @ point
    return matrix


def _checked_affine(matrix: ArrayLike) -> NDArray[np.float64]:
    """Return a 4 × 4 affine matrix as float64."""
    given = real_array(matrix)
    result = np.empty(0) if given is None else given.astype(np.float64)
    # Within the limit of coordinates no product of three numbers overflows.
    is_fine = result.shape == (4, 4) and (np.abs(result) <= COORDINATE_LIMIT).all()
    if not is_fine or (result[3] != (0.0, 0.0, 0.0, 1.0)).any():
        raise SceneError(f"the matrix must be affine: (4, 4), finite, the last row (0, 0, 0, 1); given {shown(matrix)}")
    return result
