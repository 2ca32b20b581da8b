"""Where the illumination equation is evaluated: once a polygon, at the corners of the faces, or at every sample.

In: a `Surface` and what each sample of a picture sees of it (`Fragments`). Out: the linear colour, the opacity and the
shading normal of every sample. Everything happens in world space.

    flat       at the centroid of a polygon, with its plane normal
    Gouraud    at the corners of a face, with the normals there; both parts of the light are interpolated between them
    Phong      at the sample's own point, with the interpolated normal

What a texture shows at a sample: of texture coordinates u, v, and of what they change by from one sample of the picture
to the next. Alpha is interpolated as the colours are, and multiplies nothing there.

    v = 1 ┌───┬───┬───┐ row 0     a picture of w × h texels: texel (i, j) covers i/w <= u < (i + 1)/w and
          │   │   │ · │           j/h < 1 - v <= (j + 1)/h; its centre lies at u·w = i + ½, (1 - v)·h = j + ½
    v = 0 └───┴───┴───┘ row h-1
        u = 0       u = 1

Sources: Gouraud 1971, IEEE Trans. Computers C-20(6), 623-629; Phong 1975, Comm. ACM 18(6), 311-317.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.texture import Texture
from ..vectors import length, unit
from .light import Lighting, Points, light_points, to_viewer
from .shadow import NO_OWNER
from .surface import Surface, face_tangents, unit_sums
from .textures import sample_texture, without_repeats
from .vectors import area_vectors, blend, dot

CHUNK = 2**16  # samples lit at a time: bounds the memory of a supersampled picture


class Fragments(NamedTuple):
    """What the samples see that show a surface."""

    rows: NDArray[np.int64]  # (n_sample,)
    columns: NDArray[np.int64]  # (n_sample,)
    face: NDArray[np.int64]  # (n_sample,) of the `Surface`
    side: NDArray[np.int64]  # (n_sample,) +1 or -1, see surface.py
    weights: NDArray[np.float64]  # (n_sample, 3) perspective-correct, on the corners of the face
    depth: NDArray[np.float64]  # (n_sample,)
    steps: NDArray[np.float64] | None = None  # (n_sample, 2, 3) what a step to the right, and down, adds to the weights

    def part(self, some: slice | NDArray) -> "Fragments":
        """Return some of the samples."""
        return Fragments(*(None if column is None else column[some] for column in self))


def light_samples(
    surface: Surface, fragments: Fragments, shape: tuple[int, int], lighting: Lighting
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Light the samples that see a surface.

    Gouraud intensities are interpolated, so their normal is reported and not used.

    Parameters
    ----------
    surface : all faces
    fragments : the samples, at most one for each place
    shape : (rows, columns) of the grid of samples
    lighting : all else

    Returns
    -------
    color : (h, w, 3) float64, linear; 0 where nothing is, as all of them
    normal : (h, w, 3) float64, unit
    opacity : (h, w) float64
    """
    color, normal, opacity = np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape)
    step = CHUNK * 3 // (lighting.n_wave or 3)
    for start in range(0, len(fragments.face), step):
        part = fragments.part(slice(start, start + step))
        at = part.rows, part.columns
        color[at], normal[at], opacity[at] = light_fragments(surface, part, lighting)
    return color, normal, opacity


def light_fragments(
    surface: Surface, fragments: Fragments, lighting: Lighting
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Light samples, all at once: colours (n, 3), normals (n, 3) and opacities (n,) as in `light_samples`."""
    methods = {"flat": _light_flat, "gouraud": _light_gouraud, "phong": _light_phong}
    diffuse, specular, normals = methods[lighting.shading](surface, fragments, lighting)
    texels = sample_textures(surface, fragments, lighting)
    colors = (texels[:, :3] * diffuse + specular) * 2.0**lighting.exposure
    if lighting.cue is not None:
        left = cue_factors(fragments.depth, lighting)[:, None]
        colors = left * colors + (1 - left) * np.array(lighting.cue.color)
    return colors, normals, opacity_of(surface, fragments, lighting, texels)


def opacity_of(surface: Surface, fragments: Fragments, lighting: Lighting, texels: NDArray) -> NDArray[np.float64]:
    """Return the opacities (n,) of samples; `texels` (n, 4) are what `sample_textures` returns of them."""
    opacity = lighting.materials["opacity"][surface.material[fragments.face]] * texels[:, 3]
    return np.where(lighting.materials["is_cut_out"][surface.material[fragments.face]], 1.0, opacity)


def sample_textures(surface: Surface, fragments: Fragments, lighting: Lighting) -> NDArray[np.float64]:
    """Return what the textures show at samples, (n, 4) linear RGB and alpha; 1 where a surface has none."""
    return _look_up(surface, fragments, lighting.textures, slice(0, 2))


def _look_up(
    surface: Surface, fragments: Fragments, textures: tuple[Texture | None, ...], columns: slice
) -> NDArray[np.float64]:
    """Return what textures, one or None of each material, show at samples: (n, 4); 1 where there is none. `columns` are
    those of the texture coordinates."""
    texels = np.ones((len(fragments.face), 4))
    if not textures:
        return texels
    material = surface.material[fragments.face]
    for number in np.unique(material):
        texture = textures[number]
        if texture is not None:
            at = material == number
            corners = without_repeats(surface.uv[fragments.face[at]][..., columns], texture.wrap)
            uv, steps = blend(fragments.weights[at], corners), fragments.steps[at] @ corners
            texels[at] = sample_texture(texture, uv, steps)
    return texels


def cue_factors(depth: NDArray, lighting: Lighting) -> NDArray[np.float64]:
    """Return what the depth cue leaves of the light at depths (n,); its own colour takes the place of the rest."""
    if lighting.cue is None:
        return np.ones(len(depth))
    with np.errstate(over="ignore"):  # nothing is left beside the smallest scale
        return 1 / (1 + np.maximum(depth - lighting.cue.start, 0) / lighting.cue.scale)


def sample_normals(surface: Surface, fragments: Fragments) -> NDArray[np.float64]:
    """Return the unit normals (n, 3) at samples, towards the viewer."""
    return unit(blend(fragments.weights, surface.normals[fragments.face])) * fragments.side[:, None]


def _light(points: Points, lighting: Lighting) -> tuple[NDArray, NDArray]:
    """Evaluate the equation at points; return both parts of the light, (n, 3) each, the diffuse one with the points'
    colours."""
    diffuse, specular = light_points(points, lighting)
    return points.albedo * diffuse, specular


# --- flat ----------------------------------------------------------------------------------------------------


def _light_flat(surface: Surface, fragments: Fragments, lighting: Lighting):
    """Light each polygon that is seen once; return both parts of the light and the normals, (n, 3) each."""
    polygon, sample_seen = np.unique(surface.polygon[fragments.face], return_inverse=True)
    points = polygon_points(surface, polygon, lighting)
    diffuse, specular = _light(points, lighting)
    return diffuse[sample_seen], specular[sample_seen], points.normals[sample_seen]


def polygon_points(surface: Surface, polygon: NDArray, lighting: Lighting) -> Points:
    """Return the centroids of polygons (n,), with the normals of their planes.

    The normal is Newell's: the sum of the area vectors of the polygon's triangles.
    Source: Sutherland, Sproull & Schumacker 1974, ACM Computing Surveys 6(1), 1-55.
    """
    n_polygon = int(surface.polygon.max()) + 1

    def add_up(values):
        total = np.zeros((n_polygon, *values.shape[1:]))
        np.add.at(total, surface.polygon, values)
        return total

    vectors = area_vectors(surface.corners)
    areas = length(vectors)
    total_area, n_triangle = add_up(areas)[polygon], add_up(np.ones_like(areas))[polygon]
    centroids = add_up(areas * surface.corners.mean(axis=1))[polygon] / np.where(total_area > 0, total_area, 1)
    albedo = add_up(surface.albedo.mean(axis=1))[polygon] / n_triangle
    normals = unit(add_up(vectors)[polygon])
    normals[dot(normals, to_viewer(centroids, lighting)) < 0] *= -1
    material = np.zeros(n_polygon, np.int64)
    material[surface.polygon] = surface.material
    tangents = None
    if surface.tangents is not None:
        tangents = unit_sums(face_tangents(surface.corners, surface.uv), surface.polygon)[polygon]
    return Points(centroids, normals, material[polygon], albedo, centroids, polygon, tangents)


# --- Gouraud -------------------------------------------------------------------------------------------------


def _light_gouraud(surface: Surface, fragments: Fragments, lighting: Lighting):
    """Light the corners of faces on the sides that are seen, each with its face's material; interpolate both parts of
    the light within the range of the three corners. Return them and the normals, (n, 3) each.
    """
    seen_sides, sample_seen = np.unique(2 * fragments.face + (fragments.side > 0), return_inverse=True)
    face, side = seen_sides // 2, 2 * (seen_sides % 2) - 1
    interpolated = []
    for part in _light(corner_points(surface, face, side), lighting):
        corner_light = part.reshape(-1, 3, 3)[sample_seen]
        value = blend(fragments.weights, corner_light)
        interpolated.append(np.clip(value, corner_light.min(axis=1), corner_light.max(axis=1)))
    return *interpolated, sample_normals(surface, fragments)


def corner_points(surface: Surface, face: NDArray, side: NDArray) -> Points:
    """Return the corners of faces on their sides (n,), face by face."""
    points, material = surface.corners[face].reshape(-1, 3), np.repeat(surface.material[face], 3)
    normals = (surface.normals[face] * side[:, None, None]).reshape(-1, 3)
    tangents = None if surface.tangents is None else surface.tangents[face].reshape(-1, 3)
    albedo, owner = surface.albedo[face].reshape(-1, 3), np.full(len(points), NO_OWNER)
    return Points(points, normals, material, albedo, points, owner, tangents)


# --- Phong ---------------------------------------------------------------------------------------------------


def _light_phong(surface: Surface, fragments: Fragments, lighting: Lighting):
    """Light the points that the samples see; return both parts of the light and the normals, (n, 3) each."""
    points = sample_points(surface, fragments, lighting)
    return *_light(points, lighting), points.normals


def sample_points(surface: Surface, fragments: Fragments, lighting: Lighting) -> Points:
    """Return the points that the samples see, with interpolated normals and colours.

    The rays to the lights start on the face itself: the rounding of its vertices on the screen may put the sample's
    point a little beside it, and so behind the face next to it.
    """
    positions, normals = world_positions(fragments, lighting), sample_normals(surface, fragments)
    albedo = blend(fragments.weights, surface.albedo[fragments.face])
    origins = blend(fragments.weights, surface.corners[fragments.face])
    tangents = None if surface.tangents is None else blend(fragments.weights, surface.tangents[fragments.face])
    metals = None
    if lighting.metals:
        texels = _look_up(surface, fragments, lighting.metals, slice(2, 4))
        metals = np.stack([texels[:, 2], texels[:, 1] ** 2], axis=1)
    material = surface.material[fragments.face]
    return Points(positions, normals, material, albedo, origins, fragments.face, tangents, metals)


def world_positions(fragments: Fragments, lighting: Lighting) -> NDArray[np.float64]:
    """Return the world points (n, 3) that lie at the samples' depths on the rays through their centres."""
    rows, columns, depth = fragments.rows, fragments.columns, fragments.depth
    view, projection, depth = lighting.view, lighting.projection, depth[:, None]
    y = (projection.center_y - (rows + 0.5)) / projection.scale_y
    x = (columns + 0.5 - projection.center_x + projection.skew * y) / projection.scale_x
    across = x[:, None] * view.right + y[:, None] * view.up
    return view.eye + (depth if projection.is_perspective else 1.0) * across + depth * view.forward
