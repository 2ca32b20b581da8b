"""The lighting half of the judge: what the faces of a scene look like at any sample, in plain numpy float64.

In: the faces of a scene corner by corner (`Surface`) and what each sample of a picture sees (`Seen`).
Out: the linear colour and the shading normal of every sample. Everything happens in world space.

Letters: N normal, L to the light, V to the viewer, R mirror of L about N, H halfway between L and V.
The *side* of a face is +1 where its shading normals look to the viewer and -1 where they must be turned.
"""

from typing import NamedTuple

import numpy as np

from rasterizer.errors import SceneError
from rasterizer.scene.camera import Projection, View
from rasterizer.scene.lights import AmbientLight, DirectionalLight, PointLight
from rasterizer.scene.mesh import Mesh
from rasterizer.scene.normals import split_creases
from rasterizer.scene.scene import Scene

DEFAULT_CREASE_ANGLE = 30.0
CHUNK = 2**16  # samples lit at a time: bounds the memory of a supersampled picture


class Surface(NamedTuple):
    """All faces of a scene, corner by corner, in the order of loading."""

    corners: np.ndarray  # (n_face, 3, 3) float64, world
    normals: np.ndarray  # (n_face, 3, 3) float64, unit shading normals, world
    albedo: np.ndarray  # (n_face, 3, 3) float64, linear RGB that multiplies ka and kd
    polygon: np.ndarray  # (n_face,) int, polygon that the triangle came from
    material: np.ndarray  # (n_face,) int, row of the table of materials


class Stage(NamedTuple):
    """Everything that lighting needs beside the surface."""

    view: View
    projection: Projection
    materials: np.ndarray  # (n_mesh,) records: ambient, diffuse, specular, emissive (3,), shininess, is_blinn
    lights: tuple
    shading: str


class Seen(NamedTuple):
    """What the samples see that show a surface."""

    rows: np.ndarray  # (n_sample,) int
    columns: np.ndarray  # (n_sample,) int
    face: np.ndarray  # (n_sample,) int
    side: np.ndarray  # (n_sample,) int, +1 or -1
    weights: np.ndarray  # (n_sample, 3) float64, perspective-correct, on the corners of the face
    depth: np.ndarray  # (n_sample,) float64


# ── gather ────────────────────────────────────────────────────────────────────────────────────────────────


def gather(scene: Scene) -> Surface:
    """Lay out the faces of all meshes of a scene corner by corner."""
    parts, n_polygon = [], 0
    for mesh_idx, mesh in enumerate(scene.meshes):
        polygon = np.arange(mesh.n_face) if mesh.polygons is None else np.asarray(mesh.polygons, np.int64)
        material = np.full(mesh.n_face, mesh_idx)
        corners = mesh.vertices[mesh.faces]
        normals, albedo = _corner_normals(mesh), _corner_albedo(mesh)
        parts.append(Surface(corners, normals, albedo, polygon + n_polygon, material))
        n_polygon += int(polygon.max()) + 1
    return Surface(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _corner_normals(mesh: Mesh) -> np.ndarray:
    """Return the (n_face, 3, 3) shading normals: the file's own, or averaged up to the creases."""
    if mesh.normals is not None and mesh.crease_angle is None:
        return mesh.normals if mesh.normals.ndim == 3 else mesh.normals[mesh.faces]
    crease_angle = DEFAULT_CREASE_ANGLE if mesh.crease_angle is None else mesh.crease_angle
    smoothing = mesh.smoothing if mesh.crease_angle is None else None
    split = split_creases(mesh.vertices, mesh.faces, crease_angle, smoothing=smoothing)
    return split.normals[split.faces]


def _corner_albedo(mesh: Mesh) -> np.ndarray:
    """Return the (n_face, 3, 3) linear colours of the corners, 1 where the mesh has none."""
    if mesh.colors is not None:
        return mesh.colors[mesh.faces][..., :3]
    if mesh.face_colors is not None:
        return np.repeat(mesh.face_colors[:, None, :3], 3, axis=1)
    return np.ones((mesh.n_face, 3, 3))


def read_materials(scene: Scene) -> np.ndarray:
    """Return one record of reflection coefficients a mesh."""
    rgb = [(name, np.float64, 3) for name in ("ambient", "diffuse", "specular", "emissive")]
    table = np.zeros(len(scene.meshes), [*rgb, ("shininess", np.float64), ("is_blinn", bool)])
    for row, mesh in zip(table, scene.meshes, strict=True):
        for name in ("diffuse", "specular", "emissive", "shininess"):
            row[name] = getattr(mesh.material, name)
        row["ambient"] = mesh.material.diffuse if mesh.material.ambient is None else mesh.material.ambient
        row["is_blinn"] = mesh.material.reflection == "blinn"
    return table


# ── where the equation is evaluated ───────────────────────────────────────────────────────────────────────


def find_sides(surface: Surface, face, facing) -> np.ndarray:
    """Return by what the shading normals of faces are multiplied to make them look to the viewer.

    Parameters
    ----------
    surface : all faces
    face : (n,) int
    facing : (n,) int, +1 where the face's winding is counter-clockwise as the viewer sees it, else -1

    Returns
    -------
    (n,) int, +1 or -1
    """
    agreement = dot(surface.normals[face].sum(axis=1), _area_vectors(surface.corners[face]))
    return np.where(agreement >= 0, facing, -facing)


def light_samples(surface: Surface, seen: Seen, shape, stage: Stage):
    """Return the linear colour and the shading normal of every sample, (h, w, 3) each; 0 where nothing is.

    Gouraud intensities are interpolated, so their normal is reported and not used.
    Sources: Gouraud 1971, IEEE Trans. Computers C-20(6), 623-629; Phong 1975, Comm. ACM 18(6), 311-317.
    """
    color, normal = np.zeros((2, *shape, 3))
    by_polygon = _light_polygons(surface, stage) if stage.shading == "flat" else None
    for start in range(0, len(seen.face), CHUNK):
        part = Seen(*(column[start : start + CHUNK] for column in seen))
        at = part.rows, part.columns
        if stage.shading == "flat":
            color[at], normal[at] = (values[surface.polygon[part.face]] for values in by_polygon)
            continue
        normal[at] = _unit(_blend(part.weights, surface.normals[part.face])) * part.side[:, None]
        light = _interpolate_corner_light if stage.shading == "gouraud" else _light_points
        color[at] = light(surface, part, normal[at], stage)
    return color, normal


def _light_polygons(surface: Surface, stage: Stage):
    """Light each polygon once, at its centroid; return intensities and normals, (n_polygon, 3) each.

    The normal is Newell's: the sum of the area vectors of the polygon's triangles.
    Source: Sutherland, Sproull & Schumacker 1974, ACM Computing Surveys 6(1), 1-55.
    """
    n_polygon = int(surface.polygon.max()) + 1

    def add_up(values):
        total = np.zeros((n_polygon, *values.shape[1:]))
        np.add.at(total, surface.polygon, values)
        return total

    area_vectors = _area_vectors(surface.corners)
    areas = _length(area_vectors)
    total_area, n_triangle = add_up(areas), add_up(np.ones_like(areas))
    centroids = add_up(areas * surface.corners.mean(axis=1)) / np.where(total_area > 0, total_area, 1)
    albedo = add_up(surface.albedo.mean(axis=1)) / np.maximum(n_triangle, 1)
    normals = _unit(add_up(area_vectors))
    normals[dot(normals, _to_viewer(centroids, stage)) < 0] *= -1
    material = np.zeros(n_polygon, np.int64)
    material[surface.polygon] = surface.material
    return _illuminate(centroids, normals, albedo, material, stage), normals


def _interpolate_corner_light(surface: Surface, part: Seen, _normals, stage: Stage) -> np.ndarray:
    """Light the corners of faces on the sides that are seen; interpolate within the range of the three."""
    seen_sides, sample_seen = np.unique(2 * part.face + (part.side > 0), return_inverse=True)
    face, side = seen_sides // 2, 2 * (seen_sides % 2) - 1
    normals = surface.normals[face] * side[:, None, None]
    corners = [values.reshape(-1, 3) for values in (surface.corners[face], normals, surface.albedo[face])]
    corner_light = _illuminate(*corners, np.repeat(surface.material[face], 3), stage).reshape(-1, 3, 3)
    corner_light = corner_light[sample_seen]
    return np.clip(_blend(part.weights, corner_light), corner_light.min(axis=1), corner_light.max(axis=1))


def _light_points(surface: Surface, part: Seen, normals, stage: Stage) -> np.ndarray:
    """Light the points that the samples see, with their own normals."""
    points = _sample_points(part, stage)
    albedo = _blend(part.weights, surface.albedo[part.face])
    return _illuminate(points, normals, albedo, surface.material[part.face], stage)


def _sample_points(part: Seen, stage: Stage) -> np.ndarray:
    """Return the world points (n, 3) that lie at the samples' depths on the rays through their centres."""
    view, projection, depth = stage.view, stage.projection, part.depth[:, None]
    x = (part.columns + 0.5 - projection.center_x) / projection.scale_x
    y = (projection.center_y - (part.rows + 0.5)) / projection.scale_y
    across = x[:, None] * view.right + y[:, None] * view.up
    return view.eye + (depth if projection.is_perspective else 1.0) * across + depth * view.forward


# ── the illumination equation ─────────────────────────────────────────────────────────────────────────────


def _illuminate(points, normals, albedo, material, stage: Stage) -> np.ndarray:
    """Evaluate the illumination equation at points (n, 3); return (n, 3) intensities, linear.

    I = ke + ka Ia + sum over the lights of f_att Ip (kd max(N.L, 0) + lit ks spec), per channel,
    spec = max(R.V, 0)^n or max(N.H, 0)^n; lit means N.L > 0: no highlight from a light behind the surface.
    Sources: Phong 1975, Comm. ACM 18(6), 311-317; Blinn 1977, Proc. SIGGRAPH, 192-198.
    """
    table = stage.materials[material]
    diffuse, specular, shininess = albedo * table["diffuse"], table["specular"], table["shininess"][:, None]
    to_viewer = _to_viewer(points, stage)
    intensity = table["emissive"].copy()
    for light in stage.lights:
        if isinstance(light, AmbientLight):
            intensity += albedo * table["ambient"] * np.array(light.color)
            continue
        light_dirs, strength = _light_at(light, points, stage.view)
        n_dot_l = dot(normals, light_dirs)[:, None]
        r_dot_v = dot(2 * n_dot_l * normals - light_dirs, to_viewer)
        n_dot_h = dot(normals, _unit(light_dirs + to_viewer))
        highlight = np.maximum(np.where(table["is_blinn"], n_dot_h, r_dot_v), 0)[:, None] ** shininess
        with np.errstate(invalid="ignore"):  # an amplifying light in the very point
            reflected = strength * (diffuse * n_dot_l + specular * highlight)
        intensity += np.where(n_dot_l > 0, reflected, 0)
    return intensity


def _light_at(light, points, view: View):
    """Return the unit vectors (n, 3) to a light and its attenuated colour, (n, 3) or (3,)."""
    is_carried = light.attached == "camera"
    axes = np.array([view.right, view.up, -view.forward]) if is_carried else np.eye(3)
    color = np.array(light.color)
    if isinstance(light, DirectionalLight):
        return np.broadcast_to(-(np.array(light.direction) @ axes), points.shape), color
    if not isinstance(light, PointLight):
        raise SceneError(f"the reference renderer knows no {type(light).__name__}")
    position = np.array(light.position) @ axes + (view.eye if is_carried else 0.0)
    to_light = position - points
    distance = _length(to_light)
    constant, linear, quadratic = light.attenuation
    with np.errstate(divide="ignore"):
        attenuation = 1.0 / (constant + linear * distance + quadratic * distance**2)
    return _unit(to_light), color * (attenuation if light.amplify else np.minimum(attenuation, 1.0))


def _to_viewer(points, stage: Stage) -> np.ndarray:
    """Return the unit vectors (n, 3) from points to the viewer."""
    if stage.projection.is_perspective:
        return _unit(stage.view.eye - points)
    return np.broadcast_to(-stage.view.forward, points.shape)


# ── vectors ───────────────────────────────────────────────────────────────────────────────────────────────


def dot(a, b) -> np.ndarray:
    """Return the dot products over the last axis, added in one fixed order: equal vectors give equal bits."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def _unit(vectors) -> np.ndarray:
    """Return the vectors at length 1; zero stays zero."""
    length = _length(vectors)
    return vectors / np.where(length > 0, length, 1)


def _length(vectors) -> np.ndarray:
    """Return lengths (..., 1); hypot keeps the squares from over- and underflowing."""
    return np.hypot(np.hypot(vectors[..., :1], vectors[..., 1:2]), vectors[..., 2:])


def _blend(weights, corner_values) -> np.ndarray:
    """Return the weighted sums (n, 3) of the values at three corners (n, 3, 3), with weights (n, 3)."""
    return np.einsum("sc,scv->sv", weights, corner_values)


def _area_vectors(corners) -> np.ndarray:
    """Return vectors (n, 3) about which triangles turn counter-clockwise, twice as long as their areas."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
