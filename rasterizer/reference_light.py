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
from rasterizer.scene.lights import AmbientLight, AreaLight, DirectionalLight, PointLight, SpotLight
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
    materials: np.ndarray  # (n_mesh,) records: ambient, diffuse, specular, emissive (3,), and the numbers and words of the model
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
    numbers = [(name, np.float64) for name in ("shininess", "roughness", "levels")]
    words = [("reflection", "U16"), ("distribution", "U16"), ("normalized", bool)]
    table = np.zeros(len(scene.meshes), [*rgb, *numbers, *words, ("fresnel", np.float64)])
    for row, mesh in zip(table, scene.meshes, strict=True):
        for name in ("diffuse", "specular", "emissive", *(name for name, _ in numbers + words)):
            row[name] = getattr(mesh.material, name)
        row["ambient"] = mesh.material.diffuse if mesh.material.ambient is None else mesh.material.ambient
        absent = 0.04 if mesh.material.reflection == "cook-torrance" else 1.0
        row["fresnel"] = absent if mesh.material.fresnel is None else mesh.material.fresnel
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

    I = ke + ka Ia + sum over the lights of f_att Ip lit (kd D + ks S), per channel, with D and S as `_reflect` finds
    them; lit means N.L > 0: no highlight from a light behind the surface.
    """
    table = stage.materials[material]
    diffuse, specular = albedo * table["diffuse"], table["specular"]
    to_viewer = _to_viewer(points, stage)
    intensity = table["emissive"].copy()
    for light in _point_by_point(stage.lights):
        if isinstance(light, AmbientLight):
            intensity += albedo * table["ambient"] * np.array(light.color)
            continue
        light_dirs, strength = _light_at(light, points, stage.view)
        n_dot_l = dot(normals, light_dirs)[:, None]
        matte, highlight = _reflect(table, normals, light_dirs, to_viewer)
        with np.errstate(invalid="ignore"):  # an amplifying light in the very point
            reflected = strength * (diffuse * matte + specular * highlight)
        intensity += np.where(n_dot_l > 0, reflected, 0)
    return intensity


def _reflect(table, normals, light_dirs, to_viewer):
    """Return D and S (n, 1) of the material of each row of `table`, for unit vectors (n, 3); of no meaning where N.L <= 0."""
    matte, highlight = np.zeros((2, len(table), 1))
    for model in np.unique(table["reflection"]):
        at = table["reflection"] == model
        parts = _MODELS[str(model)](table[at], normals[at], light_dirs[at], to_viewer[at])
        matte[at, 0], highlight[at, 0] = parts
    return matte, highlight


def _reflect_lambert(_table, normals, light_dirs, _to_viewer):
    """Lambert 1760: the cosine of the angle of incidence."""
    return dot(normals, light_dirs), 0.0


def _reflect_phong(table, normals, light_dirs, to_viewer):
    """Phong 1975, Comm. ACM 18(6), 311-317: max(R.V, 0)^n. Normalised: Lafortune & Willems 1994, TR CW197, K.U. Leuven."""
    n_dot_l, n = dot(normals, light_dirs), table["shininess"]
    highlight = np.maximum(dot(2 * n_dot_l[:, None] * normals - light_dirs, to_viewer), 0) ** n
    return n_dot_l, highlight * _schlick(table, n_dot_l) * np.where(table["normalized"], (n / 2 + 1) * n_dot_l, 1.0)


def _reflect_blinn(table, normals, light_dirs, to_viewer):
    """Blinn 1977, Proc. SIGGRAPH, 192-198: max(N.H, 0)^n. Normalised: Giesen 2009, Phong Normalization Factor derivation."""
    n_dot_l, n = dot(normals, light_dirs), table["shininess"]
    highlight = np.maximum(dot(normals, _unit(light_dirs + to_viewer)), 0) ** n
    peak = (n + 2) * (n + 4) / (8 * (np.exp2(-n / 2) + n))
    return n_dot_l, highlight * _schlick(table, n_dot_l) * np.where(table["normalized"], peak * n_dot_l, 1.0)


def _reflect_oren_nayar(table, normals, light_dirs, to_viewer):
    """Oren & Nayar 1994, Proc. SIGGRAPH, 239-246, equation 30, by angles; cos beta is 1/64 at least."""
    theta_l, theta_v = _angle(normals, light_dirs), _angle(normals, to_viewer)
    across_l, across_v = (_unit(d - dot(d, normals)[:, None] * normals) for d in (light_dirs, to_viewer))
    variance = table["roughness"] ** 2
    a, b = 1 - variance / (2 * (variance + 0.33)), 0.45 * variance / (variance + 0.09)
    alpha, beta = np.maximum(theta_l, theta_v), np.minimum(theta_l, theta_v)
    tangent = np.sin(beta) / np.maximum(np.cos(beta), 1 / 64)
    return np.cos(theta_l) * (a + b * np.maximum(dot(across_l, across_v), 0) * np.sin(alpha) * tangent), 0.0


def _reflect_cook_torrance(table, normals, light_dirs, to_viewer):
    """Return pi D F G / (4 N.V): Cook & Torrance 1981; Walter et al. 2007, EGSR, 195-206, equations 25, 27, 33 and 34."""
    half, m = _unit(light_dirs + to_viewer), table["roughness"]
    n_dot_l = dot(normals, light_dirs)
    # Beyond the silhouette the limit at 90 degrees is taken.
    theta_h, theta_l, theta_v = (_angle(normals, d) for d in (half, light_dirs, to_viewer))
    theta_l, theta_v = np.minimum(theta_l, np.pi / 2 - 1e-12), np.minimum(theta_v, np.pi / 2 - 1e-12)
    is_ggx, is_ahead = table["distribution"] == "ggx", theta_h < np.pi / 2
    slope = np.tan(np.where(is_ahead, theta_h, 0.0)) / m
    with np.errstate(over="ignore", under="ignore"):
        shape = np.where(is_ggx, 1 / (1 + slope**2) ** 2, np.exp(-(slope**2)))
        facets = np.where(is_ahead, shape / (m**2 * np.cos(theta_h) ** 4), 0.0)
    masked = np.ones_like(m)
    for theta in (theta_l, theta_v):
        tangent = m * np.tan(theta)
        a = 1 / np.maximum(tangent, 1e-12)
        beckmann = np.where(a < 1.6, np.minimum((3.535 * a + 2.181 * a**2) / (1 + 2.276 * a + 2.577 * a**2), 1), 1)
        masked *= np.where(is_ggx, 2 / (1 + np.hypot(1, tangent)), beckmann)
    return n_dot_l, facets * _schlick(table, dot(light_dirs, half)) * masked / (4 * np.cos(theta_v))


def _reflect_toon(table, normals, light_dirs, to_viewer):
    """Return N.L raised to a multiple of 1/levels, and 1 or 0 where (R.V)^n is above or below one half."""
    n_dot_l, levels = dot(normals, light_dirs), table["levels"]
    steps = np.arange(1, levels.max() + 1)
    step = 1 + (steps < levels[:, None] * n_dot_l[:, None]).sum(axis=1)
    highlight = np.maximum(dot(2 * n_dot_l[:, None] * normals - light_dirs, to_viewer), 0) ** table["shininess"]
    return np.minimum(step, levels) / levels, np.where(highlight >= 0.5, 1.0, 0.0)


_MODELS = {
    "lambert": _reflect_lambert,
    "phong": _reflect_phong,
    "blinn": _reflect_blinn,
    "oren-nayar": _reflect_oren_nayar,
    "cook-torrance": _reflect_cook_torrance,
    "toon": _reflect_toon,
}


def _schlick(table, cosine):
    """Schlick 1994, Computer Graphics Forum 13(3), 233-246: W = F0 + (1 - F0)(1 - cos theta)^5."""
    return table["fresnel"] + (1 - table["fresnel"]) * np.clip(1 - cosine, 0, 1) ** 5


def _angle(a, b):
    """Return the angles (n,) between vectors (n, 3); exact for small ones and right ones."""
    return np.arctan2(_length(np.cross(a, b))[:, 0], dot(a, b))


def _light_at(light, points, view: View):
    """Return the unit vectors (n, 3) to a light and its attenuated colour, (n, 3) or (3,)."""
    is_carried = light.attached == "camera"
    axes = np.array([view.right, view.up, -view.forward]) if is_carried else np.eye(3)
    color = np.array(light.color)
    if isinstance(light, DirectionalLight):
        return np.broadcast_to(-(np.array(light.direction) @ axes), points.shape), color
    if not isinstance(light, PointLight | SpotLight):
        raise SceneError(f"the reference renderer knows no {type(light).__name__}")
    position = np.array(light.position) @ axes + (view.eye if is_carried else 0.0)
    to_light = position - points
    distance = _length(to_light)
    constant, linear, quadratic = light.attenuation
    with np.errstate(divide="ignore"):
        attenuation = 1.0 / (constant + linear * distance + quadratic * distance**2)
    strength = attenuation if light.amplify else np.minimum(attenuation, 1.0)
    if light.range is not None:
        strength = np.where(distance < light.range, strength * (1.0 - (distance / light.range) ** 4), 0.0)
    if isinstance(light, SpotLight):
        strength = strength * _cone(light, np.array(light.direction) @ axes, _unit(to_light))
    return _unit(to_light), color * strength


def _cone(light, axis, light_dirs) -> np.ndarray:
    """Return the part of a spot light (n, 1) that goes into the directions opposite to light_dirs (n, 3)."""
    cosine = -dot(light_dirs, axis)[:, None]
    inner, outer = np.cos(np.radians([light.inner, light.outer]))
    t = np.clip((cosine - outer) / (inner - outer), 0.0, 1.0) if inner > outer else 1.0 * (cosine >= outer)
    return t**2 * (3.0 - 2.0 * t) * np.clip(cosine, 0.0, 1.0) ** light.exponent


def _point_by_point(lights) -> list:
    """Replace every area light by a point light in the centre of each of its cells."""
    points = []
    for light in lights:
        if not isinstance(light, AreaLight):
            points.append(light)
            continue
        corner, u, v = (np.array(vector) for vector in (light.corner, light.edge_u, light.edge_v))
        m, n = light.resolution
        for s, t in np.ndindex(m, n):
            place = corner + u * (s + 0.5) / m + v * (t + 0.5) / n
            share = tuple(np.array(light.color) / (m * n))
            points.append(PointLight(place, share, light.attenuation, light.attached, light.amplify, light.range))
    return points


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
