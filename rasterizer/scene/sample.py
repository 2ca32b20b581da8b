"""A sample of a scene: a few faces that are drawn in the same way as the whole, and views that show them.

So what a picture needs is found out in no time, such as the kernels that are to be compiled before it is drawn. That
depends on what its materials need: so there is a face of every kind of material, and a view in which that is seen.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .camera_checks import LEAST_FOV
from .lights import AmbientLight, Light
from .material import Material
from .mesh import Mesh
from .scene import Scene
from .shadow import Shadow
from .texture import Texture

SIZE = 6  # of a picture of it, pixels
MOST_MESHES = 32
MOST_KINDS = 16  # of materials, of a mesh and of all views
SMALL_MAP = 16  # texels
MOST_FACES = 4  # of a mesh of one material, without polygons
THIN = 2.0**-4  # of faces: twice the area over the square of the size
STRETCHED = (0.0, 0.0), (2.0**20, 0.0), (0.0, 2.0**20)  # texture coordinates of corners
DISTANCE = 5.0  # of the furthest point from a camera that shows the whole scene, half diagonals
Kind = Callable[[Material], tuple[object, ...]]
_ATTRIBUTES = "normals", "uv", "colors", "face_colors", "smoothing", "face_material", "polygons"


def choose_meshes(scene: Scene, kind: Kind | None = None) -> list[int]:
    """Return the numbers of meshes of every kind there is, and with every kind of material; see `sample_scene`."""
    met: set[object] = set()
    chosen: list[int] = []
    for k, mesh in enumerate(scene.meshes):
        given = tuple(getattr(mesh, name) is None for name in _ATTRIBUTES)
        kinds = {(given, mesh.weighting, mesh.crease_angle is None), *map(kind or kind_of, mesh.palette)}
        if not kinds <= met and len(chosen) < MOST_MESHES:
            met |= kinds
            chosen.append(k)
    return chosen


def sample_scene(scene: Scene, kind: Kind | None = None, chosen: Sequence[int] | None = None) -> Scene:
    """Return a scene of a few faces that is drawn in the same way: meshes of every kind there is, see `choose_meshes`,
    faces of every kind of material.

    Parameters
    ----------
    kind : tells the kinds of the scene's materials apart; None = `kind_of`
    chosen : the numbers of the meshes; None = what `choose_meshes` returns
    """
    chosen = choose_meshes(scene, kind) if chosen is None else chosen
    meshes = tuple(sample_mesh(scene.meshes[k], kind) for k in chosen)
    camera = None
    if scene.camera is not None and not scene.camera.is_perspective:
        camera = replace(scene, meshes=meshes, camera=None).camera_for((SIZE, SIZE))
    lights = tuple(with_small_map(light) for light in scene.lights)
    return replace(scene, meshes=meshes, camera=camera, lights=lights)


def kind_of(material: Material) -> tuple[object, ...]:
    """Return what decides how samples of a material are computed; of numbers that are their powers of two."""
    specular, roughness = material.specular, material.roughness
    fresnel: Any = material.fresnel
    brightest = np.max([material.ambient, material.diffuse, specular, material.emissive])
    numbers = material.shininess, brightest, *np.atleast_1d(roughness)
    return (
        material.reflection, material.distribution, material.normalized, np.any(specular),
        material.texture is None, material.is_opaque, material.opacity > 0.0,
        material.is_anisotropic, isinstance(material.tangent, str), fresnel is None, np.ndim(fresnel),
        *(math.frexp(value)[1] for value in numbers),
    )  # fmt: skip


def with_small_map(light: Light) -> Light:
    """Return a light whose shadow map, if it has one, is small: Python draws it."""
    shadow = getattr(light, "shadow", None)
    if not isinstance(shadow, Shadow) or isinstance(light, AmbientLight):
        return light
    return replace(light, shadow=replace(shadow, size=SMALL_MAP))


def _with_small_texture(material: Material) -> Material:
    """Return a material whose texture, if it has one, has two texels: the brightest one and the one that lets most
    through."""
    texture = material.texture
    if not isinstance(texture, Texture):
        return material
    texels = texture.image.reshape(-1, 4)
    chosen = texels[[texels[:, :3].max(axis=1).argmax(), texels[:, 3].argmin()]]
    return replace(material, texture=Texture(chosen[None], texture.filter, texture.wrap))


def sample_mesh(mesh: Mesh, kind: Kind | None = None) -> Mesh:
    """Return a mesh of a few faces: the first ones with an area, those of a polygon that has several, and the fattest
    one of each kind of material; where that is too thin to be seen, a fatter one in its place.

    If it has a texture, there is a face twice, once with texture coordinates that float32 has no digits for. `kind` is
    that of `sample_scene`.
    """
    fatness = _fatness_of(mesh.vertices, mesh.faces)
    has_area = fatness > 0.0
    has_area |= not has_area.any()  # too thin for a number: then any face will do
    chosen = np.flatnonzero(has_area)[:2].tolist()
    if mesh.polygons is not None:
        numbers, counts = np.unique(mesh.polygons, return_counts=True)
        several = np.flatnonzero(np.isin(mesh.polygons, numbers[counts > 1][:1]))
        chosen += several[: MOST_FACES * MOST_FACES].tolist()
    kinds = [face for face, _ in _faces_of_kinds(mesh, fatness, kind or kind_of)]
    stretched = [face for face in kinds if _material_of(mesh, face).texture is not None][:1]
    faces = np.array([*np.unique(chosen + kinds), *stretched])
    vertices, inverse = np.unique(mesh.faces[faces], return_inverse=True)
    corners = inverse.reshape(-1, 3).astype(np.uint32)
    thin = np.searchsorted(faces[: len(faces) - len(stretched)], [k for k in kinds if 0.0 < fatness[k] < THIN])
    for row in thin.tolist():  # with vertices of its own
        corners[row] = np.arange(3) + len(vertices)
        vertices = np.append(vertices, mesh.faces[faces[row]])
    if stretched:  # with vertices of its own
        corners[-1] = np.arange(3) + len(vertices)
        vertices = np.append(vertices, mesh.faces[stretched])
    points = mesh.vertices[vertices]
    for row in thin.tolist():
        points[corners[row]] = _fattened(points[corners[row]])
    palette = tuple(map(_with_small_texture, mesh.palette))
    changes: dict[str, Any] = {"material": palette[0], "materials": palette if mesh.materials is not None else None}
    for name in _ATTRIBUTES:
        array = getattr(mesh, name)
        if array is not None:
            of_vertices = name in ("normals", "uv", "colors") and array.ndim == 2
            changes[name] = array[vertices if of_vertices else faces]
    if stretched:
        uv = changes["uv"]
        uv.reshape(-1, 2)[-3:] = STRETCHED
        if "polygons" in changes:
            changes["polygons"][-1] = changes["polygons"].max() + 1
    return replace(mesh, vertices=points, faces=corners, **changes)


def _material_of(mesh: Mesh, face: int) -> Material:
    """Return the material of a face."""
    return mesh.palette[0 if mesh.face_material is None else int(mesh.face_material[face])]


def _fatness_of(vertices: NDArray[np.float64], faces: NDArray[np.uint32]) -> NDArray[np.float64]:
    """Return twice the area of faces over the square of their size, (n,): 0 where that is no number."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    edges = np.stack([b - a, c - a])
    size = np.abs(edges).max(axis=(0, 2), keepdims=True)
    with np.errstate(under="ignore"):
        return np.linalg.norm(np.cross(*edges / np.where(size > 0.0, size, 1.0)), axis=1)


def _fattened(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners (3, 3) of a face that has an area, and is so thin that a small picture of it may show no
    sample, one of them moved: to half of the longest edge beside the middle of that, on the same side."""
    edges = np.roll(corners, -1, axis=0) - corners
    size = np.abs(edges).max()
    first = int(np.abs(edges).max(axis=1).argmax())
    along, normal = edges[first] / size, np.cross(edges[first] / size, edges[first - 2] / size)
    if not normal.any():  # rounded to nothing
        return corners
    across = np.cross(normal / np.abs(normal).max(), along)
    moved = corners.copy()
    moved[first - 1] = corners[first] + 0.5 * edges[first] + 0.5 * size * across / np.linalg.norm(across)
    return moved


def _faces_of_kinds(
    mesh: Mesh, fatness: NDArray[np.float64], kind_of: Kind
) -> Iterable[tuple[int, tuple[object, ...]]]:
    """Yield the fattest face of each kind of material, and the kind."""
    if mesh.face_material is None:
        yield int(fatness.argmax()), kind_of(mesh.palette[0])
        return
    number: dict[tuple[object, ...], int] = {}
    kinds = np.array([number.setdefault(kind_of(material), len(number)) for material in mesh.palette])
    kinds_of_faces = kinds[mesh.face_material]
    for kind, k in list(number.items())[:MOST_KINDS]:
        if (kinds_of_faces == k).any():
            yield int(np.where(kinds_of_faces == k, fatness, -1.0).argmax()), kind


def sample_views(sample: Scene, scene: Scene, camera: Camera | None, kind: Kind | None = None) -> list[Camera]:
    """Return the views in which a picture of SIZE pixels shows what the kinds of materials need, one a kind.

    Each looks at the front of a face, which reaches into most of the picture. The furthest point of the sample is about
    as far away as that of the whole scene is from the camera, because float32 has digits for a distance or not. In
    one more view nothing is seen: rows of a picture where nothing is may be finished in a way of their own. Where the
    camera looks out of the whole scene's box, one more looks across a face, which is cut off behind it.

    Parameters
    ----------
    sample : what is drawn, of `sample_scene`
    scene : what it is a sample of
    camera : that of the whole scene; None = one that shows all of it
    kind : tells the kinds of the sample's materials apart; None = `kind_of`
    """
    (low, high), reach = _bounds_of(scene), 0.5 * math.dist(*_bounds_of(sample))
    furthest = 0.5 * DISTANCE * math.dist(low, high)
    if camera is not None:
        furthest = math.hypot(*np.maximum(abs(low - camera.position), abs(high - camera.position)))
    distance, is_perspective = max(furthest - reach, 0.1 * furthest), camera is None or camera.is_perspective
    views: dict[object, Camera] = {}
    for mesh in sample.meshes:
        fatness = _fatness_of(mesh.vertices, mesh.faces)
        for face, found_kind in _faces_of_kinds(mesh, fatness, kind or kind_of):
            if found_kind not in views and len(views) < MOST_KINDS and fatness[face] > 0.0:
                views[found_kind] = _view_of_face(mesh.vertices[mesh.faces[face]], distance, is_perspective)
    found = list(views.values()) or [sample.camera_for((SIZE, SIZE))]
    found.append(_beside(found[0], distance + reach))
    if camera is not None and is_perspective and _reaches_behind(scene, camera):
        mesh = sample.meshes[0]
        fattest = int(_fatness_of(mesh.vertices, mesh.faces).argmax())
        found.append(_across(mesh.vertices[mesh.faces[fattest]]))
    return found


def _reaches_behind(scene: Scene, camera: Camera) -> bool:
    """Tell whether the box round some mesh reaches behind a camera, so that faces may be cut off."""
    forward = np.subtract(camera.target, camera.position)
    return any(bool(((mesh.bounds - camera.position) * forward).min(axis=0).sum() < 0.0) for mesh in scene.meshes)


def _across(corners: NDArray[np.float64]) -> Camera:
    """Return a camera next to the centre of a face, which looks along it towards a corner."""
    edges = np.roll(corners, -1, axis=0) - corners
    size, center = np.abs(edges).max(), corners.mean(axis=0)
    normal = np.cross(edges[0] / size, edges[1] / size) if size > 0.0 else np.eye(3)[2]
    up = normal / np.linalg.norm(normal) if normal.any() else np.eye(3)[2]
    return Camera.perspective(center + size / 16.0 * up, corners[0], up)


def _bounds_of(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest and the highest coordinates of all meshes, (3,) each."""
    bounds = np.stack([mesh.bounds for mesh in scene.meshes])
    return bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)


def _view_of_face(corners: NDArray[np.float64], distance: float, is_perspective: bool) -> Camera:
    """Return a camera in front of a face that has an area, its longest edge along a diagonal of the picture: however
    thin the face is, its box holds samples."""
    edges = np.roll(corners, -1, axis=0) - corners
    size = np.abs(edges).max()
    edges = edges / size
    lengths = np.linalg.norm(edges, axis=1)
    normal, along = np.cross(edges[0], edges[1]), edges[lengths.argmax()] / lengths.max()
    normal = normal / np.linalg.norm(normal)
    center, half = corners.mean(axis=0), 2.0 / 3.0 * size * lengths.max()
    eye, up = center + distance * normal, along + np.cross(normal, along)
    if not is_perspective:
        return Camera.orthographic(eye, center, up, height=2.0 * half)
    return Camera.perspective(eye, center, up, fov=max(math.degrees(2.0 * math.atan(half / distance)), LEAST_FOV))


def _beside(camera: Camera, distance: float) -> Camera:
    """Return a camera that looks in the same direction, far beside what the other one sees: `distance` is more than any
    that it shows."""
    eye, target = np.array(camera.position), np.array(camera.target)
    along = (eye - target) / np.abs(eye - target).max()
    aside = 10.0 * distance * np.cross(along, np.eye(3)[np.abs(along).argmin()])
    changes: dict[str, Any] = {"position": eye + aside, "target": target + aside}
    return replace(camera, **changes)
