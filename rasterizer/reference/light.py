"""The lighting half of the judge: what the faces of a scene look like at any sample, in plain numpy float64.

In: the faces of a scene corner by corner (`Surface`) and what each sample of a picture sees (`Seen`).
Out: the linear colour, the opacity and the shading normal of every sample. Everything happens in world space.

    lamp        what arrives from a light at a point       texture      what a texture shows at a sample
    shadow      whether it arrives                         reflection   what goes on to the viewer

Light is split into what the surface's colours multiply, the *matte* part (ambient and diffuse), and the *rest*
(emissive and the highlights): intensity = texel·matte + rest, with the texel of the very sample in all methods of
shading. With spectra the equation is evaluated for each wavelength; both parts then become RGB, and vertex colours and
textures, which are RGB and no spectra, multiply the matte part's RGB.

Letters: N normal, L to the light, V to the viewer. The *side* of a face is +1 where its shading normals look to the
viewer and
-1 where they must be turned.
"""

from typing import NamedTuple

import numpy as np

from ..geometry.normals import split_creases
from ..scene.camera import Projection, View
from ..scene.depth_cue import DepthCue
from ..scene.lights import AmbientLight
from ..scene.mesh import Mesh
from ..scene.scene import Scene
from ..scene.spectrum import rgb_of, samples_of
from .lamp import place_lamps, shine
from .polygons import Rings, about_centers, even_colors
from .reflection import GRAZING, reflect
from .shadow import NO_OWNER, Casters, gather_casters, reaches
from .tangents import corner_tangents, face_tangents, unit_sums
from .texture import look_up
from .vectors import area_vectors, blend, dot, length, unit

DEFAULT_CREASE_ANGLE = 30.0
CHUNK = 2**16  # samples lit at a time: bounds the memory of a supersampled picture
N_WAVE = 81  # samples of the spectrum where a scene has spectra and nobody chose


class Surface(NamedTuple):
    """All faces of a scene, corner by corner, in the order of loading."""

    corners: np.ndarray  # (n_face, 3, 3) float64, world
    normals: np.ndarray  # (n_face, 3, 3) float64, unit shading normals, world
    albedo: np.ndarray  # (n_face, 3, 3) float64, linear RGB that multiplies ka and kd
    polygon: np.ndarray  # (n_face,) int, polygon that the triangle came from
    material: np.ndarray  # (n_face,) int, row of the table of materials
    uv: np.ndarray | None = None  # (n_face, 3, 2) float64, texture coordinates; None where no material needs them
    tangents: np.ndarray | None = (
        None  # (n_face, 3, 3) float64, of the corners; None where no material is brushed along u
    )
    loaded: np.ndarray | None = None  # (n_face,) int, the face as loaded; None = the same
    rings: Rings | None = None  # polygons drawn about their centres; None = none


class Stage(NamedTuple):
    """Everything that lighting needs beside the surface."""

    view: View
    projection: Projection
    materials: np.ndarray  # (n_material,) records of `read_materials`
    lights: tuple
    shading: str
    textures: tuple = ()  # Texture or None of each material; empty where no face has one
    casters: Casters | None = None  # None where no light casts shadows
    n_wave: int | None = None  # samples of the spectrum; None = red, green and blue
    cue: DepthCue | None = None  # None where nothing fades with depth
    exposure: float = 0.0  # stops, by which light is multiplied, but not the colour of the cue


class Seen(NamedTuple):
    """What the samples see that show a surface."""

    rows: np.ndarray  # (n_sample,) int
    columns: np.ndarray  # (n_sample,) int
    face: np.ndarray  # (n_sample,) int
    side: np.ndarray  # (n_sample,) int, +1 or -1
    weights: np.ndarray  # (n_sample, 3) float64, perspective-correct, on the corners of the face
    depth: np.ndarray  # (n_sample,) float64
    steps: np.ndarray | None = (
        None  # (n_sample, 2, 3) float64, change of the weights by one sample to the right, and down
    )


class Start(NamedTuple):
    """Where the rays to the lights start."""

    points: np.ndarray  # (n, 3) float64, world
    owner: np.ndarray  # (n,) int, see `Casters`


# ── gather ────────────────────────────────────────────────────────────────────────────────────────────────


def set_stage(
    scene: Scene, surface: Surface, view: View, projection: Projection, shading: str, spectral, exposure=0.0
) -> Stage:
    """Gather what lighting needs, for one grid of samples; `spectral` is the number of wavelengths asked for, or
    None."""
    palette = palette_of(scene)
    n_wave = count_waves(scene, spectral)
    textures = tuple(material.texture for material in palette)
    casters = None
    if any(getattr(light, "shadow", None) is not None for light in scene.lights):
        is_opaque = np.array([material.is_opaque for material in palette])[surface.material]
        owner = surface.polygon if shading == "flat" else np.arange(len(surface.corners))
        casters = gather_casters(surface.corners, owner, is_opaque)
    has_texture = any(texture is not None for texture in textures)
    table = read_materials(scene, n_wave)
    textures = textures if has_texture else ()
    return Stage(view, projection, table, scene.lights, shading, textures, casters, n_wave, scene.depth_cue, exposure)


def palette_of(scene: Scene) -> list:
    """Return the materials of all meshes, one palette after the other: `Surface.material` counts them through."""
    return [material for mesh in scene.meshes for material in mesh.palette]


def count_waves(scene: Scene, spectral: int | None) -> int | None:
    """Return the number of wavelengths: as asked for, else 81 where a colour is a spectrum, else None for RGB."""
    colors = [light.color for light in scene.lights]
    for material in palette_of(scene):
        colors += [material.ambient, material.diffuse, material.specular, material.emissive, material.fresnel]
    has_spectrum = any(hasattr(color, "wavelengths") for color in colors)
    return N_WAVE if spectral is None and has_spectrum else spectral


def gather(scene: Scene, shading: str = "flat") -> Surface:
    """Lay out the faces of all meshes of a scene corner by corner; but for flat shading, convex polygons about their
    centres."""
    parts, n_polygon, n_material = [], 0, 0
    has_texture = any(material.needs_uv for material in palette_of(scene))
    is_brushed = any(material.is_anisotropic and material.tangent == "u" for material in palette_of(scene))
    for mesh in scene.meshes:
        polygon = np.arange(mesh.n_face) if mesh.polygons is None else np.asarray(mesh.polygons, np.int64)
        material = (
            np.zeros(mesh.n_face, np.int64) if mesh.face_material is None else mesh.face_material.astype(np.int64)
        )
        uv = _corner_uv(mesh) if has_texture else None
        attributes = _corner_normals(mesh), _corner_albedo(mesh)
        part = Surface(mesh.vertices[mesh.faces], *attributes, polygon + n_polygon, material + n_material, uv)
        parts.append(part._replace(tangents=corner_tangents(*part[:2], uv)) if is_brushed else part)
        n_polygon += int(polygon.max()) + 1
        n_material += len(mesh.palette)
    columns = zip(*parts, strict=True)
    surface = Surface(*(None if column[0] is None else np.concatenate(column) for column in columns))
    has_polygons = any(mesh.polygons is not None for mesh in scene.meshes)
    prepare = (even_colors if shading == "flat" else about_centers) if has_polygons else (lambda surface: surface)
    return prepare(surface)


def _corner_normals(mesh: Mesh) -> np.ndarray:
    """Return the (n_face, 3, 3) shading normals: the file's own, or averaged up to the creases."""
    if mesh.normals is not None and mesh.crease_angle is None:
        return mesh.normals if mesh.normals.ndim == 3 else mesh.normals[mesh.faces]
    crease_angle = DEFAULT_CREASE_ANGLE if mesh.crease_angle is None else mesh.crease_angle
    smoothing = mesh.smoothing if mesh.crease_angle is None else None
    split = split_creases(mesh.vertices, mesh.faces, crease_angle, mesh.weighting, smoothing)
    return split.normals[split.faces]


def _corner_albedo(mesh: Mesh) -> np.ndarray:
    """Return the (n_face, 3, 3) linear colours of the corners, 1 where the mesh has none."""
    if mesh.colors is not None:
        return mesh.colors[mesh.faces][..., :3]
    if mesh.face_colors is not None:
        return np.repeat(mesh.face_colors[:, None, :3], 3, axis=1)
    return np.ones((mesh.n_face, 3, 3))


def _corner_uv(mesh: Mesh) -> np.ndarray:
    """Return the (n_face, 3, 2) texture coordinates of the corners, 0 where the mesh has none."""
    if mesh.uv is None:
        return np.zeros((mesh.n_face, 3, 2))
    return mesh.uv if mesh.uv.ndim == 3 else mesh.uv[mesh.faces]


def read_materials(scene: Scene, n_wave: int | None = None) -> np.ndarray:
    """Return one record of reflection coefficients for each material of `palette_of`; colours have `n_wave` values, or
    three."""
    palette = palette_of(scene)
    colors = [
        (name, np.float64, 3 if n_wave is None else n_wave) for name in ("ambient", "diffuse", "specular", "emissive")
    ]
    colors += [("fresnel", *colors[0][1:])]
    numbers = [(name, np.float64) for name in ("shininess", "levels", "opacity")]
    words = [("reflection", "U16"), ("distribution", "U16"), ("normalized", bool)]
    brush = [("roughness", np.float64), ("across", np.float64), ("axis", np.float64, 3), ("is_by_u", bool)]
    table = np.zeros(len(palette), [*colors, *numbers, *words, *brush])
    for row, material in zip(table, palette, strict=True):
        for name, *_ in colors[:-1]:
            row[name] = channels_of(getattr(material, name), n_wave)
        for name, _ in numbers + words:
            row[name] = getattr(material, name)
        absent = 0.04 if material.reflection == "cook-torrance" else 1.0
        fresnel = absent if material.fresnel is None else material.fresnel
        row["fresnel"] = channels_of(fresnel, n_wave) if isinstance(fresnel, tuple) else fresnel
        row["roughness"], row["across"] = np.broadcast_to(material.roughness, 2)
        row["is_by_u"] = material.tangent == "u"
        if material.tangent != "u":
            row["axis"] = material.tangent
    return table


def channels_of(color, n_wave: int | None) -> np.ndarray:
    """Return a colour as red, green and blue (3,), or as samples of its spectrum (n_wave,)."""
    return np.array(color, np.float64) if n_wave is None else samples_of(color, n_wave)


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
    vectors = area_vectors(surface.corners[face])
    agreement = dot(surface.normals[face].sum(axis=1), vectors)
    # Normals at right angles to the face agree with it: the sign of a rounding error decides nothing.
    return np.where(agreement >= -GRAZING * np.abs(vectors).sum(axis=1), facing, -facing)


def light_samples(surface: Surface, seen: Seen, shape, stage: Stage):
    """Light the samples that see a surface.

    Gouraud intensities are interpolated, so their normal is reported and not used.

    Parameters
    ----------
    surface : all faces
    seen : the samples, at most one for each place
    shape : (rows, columns) of the grid of samples
    stage : all else

    Returns
    -------
    color : (h, w, 3) float64, linear; 0 where nothing is, as all of them
    normal : (h, w, 3) float64, unit
    opacity : (h, w) float64

    Sources: Gouraud 1971, IEEE Trans. Computers C-20(6), 623-629; Phong 1975, Comm. ACM 18(6), 311-317.
    """
    color, normal, opacity = np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape)
    methods = {"flat": _light_polygons, "gouraud": _interpolate_corner_light, "phong": _light_points}
    step = CHUNK * 3 // (stage.n_wave or 3)
    for start in range(0, len(seen.face), step):
        part = Seen(*(None if column is None else column[start : start + step] for column in seen))
        at = part.rows, part.columns
        matte, rest, normal[at] = methods[stage.shading](surface, part, stage)
        texels = _find_texels(surface, part, stage)
        color[at] = (texels[:, :3] * matte + rest) * 2.0**stage.exposure
        if stage.cue is not None:
            share = 1 / (1 + np.maximum(part.depth - stage.cue.start, 0) / stage.cue.scale)[:, None]
            color[at] = share * color[at] + (1 - share) * np.array(stage.cue.color)
        opacity[at] = stage.materials["opacity"][surface.material[part.face]] * texels[:, 3]
    return color, normal, opacity


def _find_texels(surface: Surface, part: Seen, stage: Stage) -> np.ndarray:
    """Return what the textures show at samples, (n, 4); 1 where a surface has none."""
    texels = np.ones((len(part.face), 4))
    if not stage.textures:
        return texels
    material = surface.material[part.face]
    for number in np.unique(material):
        if stage.textures[number] is not None:
            at = material == number
            corners = surface.uv[part.face[at]]
            uv, steps = blend(part.weights[at], corners), part.steps[at] @ corners
            texels[at] = look_up(stage.textures[number], uv, steps)
    return texels


def _sample_normals(surface: Surface, part: Seen) -> np.ndarray:
    """Return the unit normals (n, 3) at samples, towards the viewer."""
    return unit(blend(part.weights, surface.normals[part.face])) * part.side[:, None]


def _light_polygons(surface: Surface, part: Seen, stage: Stage):
    """Light each polygon that is seen once, at its centroid; return both parts of the light and the normals, (n, 3)
    each.

    The normal is Newell's: the sum of the area vectors of the polygon's triangles.
    Source: Sutherland, Sproull & Schumacker 1974, ACM Computing Surveys 6(1), 1-55.
    """
    n_polygon = int(surface.polygon.max()) + 1

    def add_up(values):
        total = np.zeros((n_polygon, *values.shape[1:]))
        np.add.at(total, surface.polygon, values)
        return total

    polygon, sample_seen = np.unique(surface.polygon[part.face], return_inverse=True)
    vectors = area_vectors(surface.corners)
    areas = length(vectors)
    total_area, n_triangle = add_up(areas)[polygon], add_up(np.ones_like(areas))[polygon]
    centroids = add_up(areas * surface.corners.mean(axis=1))[polygon] / np.where(total_area > 0, total_area, 1)
    albedo = add_up(surface.albedo.mean(axis=1))[polygon] / n_triangle
    normals = unit(add_up(vectors)[polygon])
    normals[dot(normals, _to_viewer(centroids, stage)) < 0] *= -1
    material = np.zeros(n_polygon, np.int64)
    material[surface.polygon] = surface.material
    tangents = None
    if surface.tangents is not None:
        tangents = unit_sums(face_tangents(surface.corners, surface.uv), surface.polygon)[polygon]
    matte, rest = light_points(centroids, normals, material[polygon], stage, Start(centroids, polygon), tangents)
    return (albedo * matte)[sample_seen], rest[sample_seen], normals[sample_seen]


def _interpolate_corner_light(surface: Surface, part: Seen, stage: Stage):
    """Light the corners of faces on the sides that are seen, each with its face's material; interpolate both parts of
    the light within the range of the three corners. Return them and the normals, (n, 3) each.
    """
    seen_sides, sample_seen = np.unique(2 * part.face + (part.side > 0), return_inverse=True)
    face, side = seen_sides // 2, 2 * (seen_sides % 2) - 1
    light = _corner_light(surface, face, side, slice(None), stage)
    if surface.rings is not None:
        is_piece = surface.rings.of_face[face] >= 0
        if is_piece.any():
            center_light = _center_light(surface, surface.rings.of_face[face[is_piece]], side[is_piece], stage)
            for of_corners, of_centers in zip(light, center_light, strict=True):
                of_corners[is_piece, 2] = of_centers
    lights = []
    for corner_light in light:
        corner_light = corner_light[sample_seen]
        lights.append(np.clip(blend(part.weights, corner_light), corner_light.min(axis=1), corner_light.max(axis=1)))
    return *lights, _sample_normals(surface, part)


def _corner_light(surface: Surface, face, side, which, stage: Stage):
    """Light corners of faces on their sides (n,); `which` is a slice of the three. Return both parts, (n, n_corner, 3)
    each."""
    normals = surface.normals[face, which] * side[:, None, None]
    corners, albedo = surface.corners[face, which], surface.albedo[face, which]
    points, material = corners.reshape(-1, 3), np.repeat(surface.material[face], corners.shape[1])
    start = Start(points, np.full(len(points), NO_OWNER))
    tangents = None if surface.tangents is None else surface.tangents[face, which].reshape(-1, 3)
    matte, rest = light_points(points, normals.reshape(-1, 3), material, stage, start, tangents)
    return albedo * matte.reshape(corners.shape), rest.reshape(corners.shape)


def _center_light(surface: Surface, ring, side, stage: Stage):
    """Average the light of the corners of rings on their sides (n,); return both parts, (n, 3) each."""
    first, count = surface.rings.first[ring], surface.rings.count[ring]
    ends = np.cumsum(count)
    faces = np.repeat(first - (ends - count), count) + np.arange(ends[-1])
    light = _corner_light(surface, faces, np.repeat(side, count), slice(0, 1), stage)
    return [np.add.reduceat(part[:, 0], ends - count) / count[:, None] for part in light]


def _light_points(surface: Surface, part: Seen, stage: Stage):
    """Light the points that the samples see; return both parts of the light and the normals, (n, 3) each.

    The rays to the lights start on the face itself: the rounding of its vertices on the screen may put the sample's
    point a little beside it, and so behind the face next to it.
    """
    points, normals = _sample_points(part, stage), _sample_normals(surface, part)
    albedo = blend(part.weights, surface.albedo[part.face])
    start = Start(blend(part.weights, surface.corners[part.face]), part.face)
    tangents = None if surface.tangents is None else blend(part.weights, surface.tangents[part.face])
    matte, rest = light_points(points, normals, surface.material[part.face], stage, start, tangents)
    return albedo * matte, rest, normals


def _sample_points(part: Seen, stage: Stage) -> np.ndarray:
    """Return the world points (n, 3) that lie at the samples' depths on the rays through their centres."""
    view, projection, depth = stage.view, stage.projection, part.depth[:, None]
    x = (part.columns + 0.5 - projection.center_x) / projection.scale_x
    y = (projection.center_y - (part.rows + 0.5)) / projection.scale_y
    across = x[:, None] * view.right + y[:, None] * view.up
    return view.eye + (depth if projection.is_perspective else 1.0) * across + depth * view.forward


# ── the illumination equation ─────────────────────────────────────────────────────────────────────────────


def light_points(points, normals, material, stage: Stage, start: Start | None = None, tangents=None):
    """Evaluate the illumination equation.

    I = ke + a ka Ia + sum over the lights of S f_att Ip lit (a kd D + ks F), per channel, with D and F as `reflect`
    finds them; lit means N.L > 0: no highlight from a light behind the surface. a is the surface's colour; S is 0 in
    shadow, else 1.

    Parameters
    ----------
    points : (n, 3) float64, world
    normals : (n, 3) float64, unit
    material : (n,) int, rows of the table of materials
    stage : all else
    start : where rays to the lights start; None = nothing lies in shadow
    tangents : (n, 3) float64, the directions in which u grows; None where the scene has no texture coordinates

    Returns
    -------
    matte : (n, 3) float64, linear RGB: what a multiplies
    rest : (n, 3) float64, linear RGB
    """
    table = stage.materials[material]
    to_viewer = _to_viewer(points, stage)
    brush = table["axis"] if tangents is None else np.where(table["is_by_u"][:, None], tangents, table["axis"])
    matte, rest = np.zeros_like(table["diffuse"]), table["emissive"].copy()
    for light in stage.lights:
        if isinstance(light, AmbientLight):
            matte += table["ambient"] * channels_of(light.color, stage.n_wave)
    for lamp in place_lamps(stage.lights, stage.view, lambda color: channels_of(color, stage.n_wave)):
        light_dirs, strength = shine(lamp, points)
        is_lit = dot(normals, light_dirs) > 0
        if start is not None and stage.casters is not None and lamp.light.shadow is not None:
            is_lit[is_lit] = _reaches(lamp, start, is_lit, stage.casters)
        diffuse, specular = reflect(table, normals, light_dirs, to_viewer, brush)
        with np.errstate(invalid="ignore"):  # an amplifying light in the very point
            reflected = strength * table["diffuse"] * diffuse, strength * table["specular"] * specular
        matte += np.where(is_lit[:, None], reflected[0], 0)
        rest += np.where(is_lit[:, None], reflected[1], 0)
    return (matte, rest) if stage.n_wave is None else (rgb_of(matte), rgb_of(rest))


def _reaches(lamp, start: Start, at, casters: Casters) -> np.ndarray:
    """Tell of the starts `at` (n,) bool which ones a lamp reaches."""
    points = start.points[at]
    is_finite = lamp.position is not None
    to_light = lamp.position - points if is_finite else np.broadcast_to(-lamp.axis, points.shape)
    return reaches(casters, points, start.owner[at], to_light, is_finite)


def _to_viewer(points, stage: Stage) -> np.ndarray:
    """Return the unit vectors (n, 3) from points to the viewer."""
    if stage.projection.is_perspective:
        return unit(stage.view.eye - points)
    return np.broadcast_to(-stage.view.forward, points.shape)
