"""Mach bands: how much intensity, and its slope, jump where one face meets the next on a smooth surface.

    in:  a picture of one sample a pixel (colour and faces) and its scene       out: `MachBands`

The eye overdraws a jump of the slope into a bright or dark line (Mach 1865), so the jump tells what an error map
doesn't: whether the polygons show. Six pixels in a row or column, three in each of two faces, give it:

    intensity  i0  i1  i2 ┊ i3  i4  i5       a parabola through three pixels of a face gives value and slope at the edge ┊,
    face        A   A   A ┊  B   B   B       so that a surface's own curvature doesn't count; across the edge the slope is i3 - i2

"""

from typing import NamedTuple

import numpy as np

from ..engine.light_table import entry_of
from ..errors import SceneError, shown
from ..frame import Frame
from ..geometry.mesh_points import smooth_part

# Luminance of linear RGB with the sRGB primaries. Source: ITU-R BT.709-6, section 3.
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

# Corner normals of two faces are one where they differ by less: files hold six decimals, and the mesh makes them unit
# vectors.
_SAME_NORMAL = 4e-6

# Faces seen at more than 60 degrees are left out: a pixel there spans more than two of its widths on the surface, and
# at the outline, where it spans any number, slopes and their jumps are as large as one likes, whatever the method.
_LEAST_COSINE = 0.5


class MachBands(NamedTuple):
    """What a picture's polygon edges look like, in linear intensity where white is 1.

    Attributes
    ----------
    value_jump : largest jump of the intensity at an edge; one that is continuous may have half of the slope's jump, as
        the edge may lie anywhere between two pixels
    slope_jump : largest difference of the intensity's slopes before, across and behind an edge, per pixel; where the
        intensity jumps, as in flat shading, that jump is the slope across the edge
    n_place : places that were looked at; where it is 0, no such faces of three pixels meet, and both jumps are 0
    """

    value_jump: float
    slope_jump: float
    n_place: int


class _Surface(NamedTuple):
    """A scene's faces, and the edges across which they are smooth."""

    pairs: np.ndarray  # (n,) uint64, ascending: lower face << 32 | higher face
    corners: np.ndarray  # (n_face, 3, 3) float64, world
    normals: np.ndarray  # (n_face, 3, 3) float64, unit shading normals of the corners


def mach_bands(picture, scene, camera=None) -> MachBands:
    """Measure the largest jumps of intensity, and of its slope, across the polygon edges of a picture.

    Only edges count across which the surface is smooth: two faces of one mesh share them, with the same shading normals
    and colours at both ends. Both must show the viewer the same side, at 60 degrees or less from their normal, and must
    not be crossed by the line where a light's side ends. So outlines, creases and shadow lines, which are to be seen,
    don't count. A highlight narrower than some pixels looks like a jump, and counts. Intensity is the luminance of the
    linear colours. Its slope is per pixel: pictures of other sizes have others.

    Parameters
    ----------
    picture : Frame rendered with outputs ("color", "face") and one sample a pixel; or anything with these two arrays,
        (height, width, 3) linear and (height, width) indices of faces, such as the reference's picture
    scene : Scene that it shows
    camera : Camera that saw it; None = the one that `render` takes: the scene's own, or the one that frames it

    Returns
    -------
    MachBands

    Raises
    ------
    SceneError : no such picture, more than one sample a pixel, or faces that the scene doesn't have
    """
    if not hasattr(scene, "camera_for"):
        raise SceneError(f"a Scene is needed; given {shown(scene)}")
    if camera is not None and not hasattr(camera, "is_perspective"):
        raise SceneError(f"a Camera is needed, or None; given {shown(camera)}")
    color, face = _buffers(picture, scene)
    height, width = face.shape
    camera = scene.camera_for((width, height)) if camera is None else camera
    surface = _gather(scene)
    key = _face_keys(surface, camera.view(), camera.is_perspective, scene.lights)
    luminance = color.astype(np.float64) @ _LUMINANCE
    across = _jumps(luminance, face, surface.pairs, key)
    down = _jumps(luminance.T, face.T, surface.pairs, key)
    value, slope = (np.concatenate(pair) for pair in zip(across, down, strict=True))
    return MachBands(float(value.max(initial=0.0)), float(slope.max(initial=0.0)), len(value))


def _buffers(picture, scene):
    """Return the linear colours and the faces of a picture, checked."""
    if isinstance(picture, Frame) and picture.stats.samples != picture.size[0] * picture.size[1]:
        raise SceneError("Mach bands are measured in pictures of one sample a pixel: averages hide them")
    try:
        color, face = np.asarray(picture.color), np.asarray(picture.face)
    except AttributeError:
        raise SceneError(f"a picture with color and face is needed; given {type(picture).__name__}") from None
    if face.ndim != 2 or face.dtype.kind not in "iu" or color.shape != (*face.shape, 3) or color.dtype.kind != "f":
        raise SceneError(
            "color must be (height, width, 3) linear and face (height, width) integers; "
            f"given {color.dtype} {color.shape} and {face.dtype} {face.shape}"
        )
    if face.size and face.max() >= scene.n_face:
        raise SceneError(f"the picture shows face {face.max()}; the scene has {scene.n_face} faces")
    return color, face


def _gather(scene) -> _Surface:
    """Lay out the faces of all meshes, and find the edges across which their shading normals and colours are
    continuous."""
    pairs, corners, normals = [], [], []
    for mesh, offset in zip(scene.meshes, scene.face_offsets, strict=False):
        part = smooth_part(mesh)
        corners.append(part.positions[part.corner])
        normals.append(part.normals[part.corner])
        values = part.normals if part.albedo is None else np.concatenate([part.normals, part.albedo], axis=1)
        pairs.append(_mesh_pairs(_by_place(mesh), values[part.corner]) + np.uint64(offset) * np.uint64(2**32 + 1))
    return _Surface(np.sort(np.concatenate(pairs)), np.concatenate(corners), np.concatenate(normals))


def _by_place(mesh) -> np.ndarray:
    """Return the faces (n_face, 3) with one index for all vertices at one place.

    Files cut surfaces at the seams of their textures, and give both sides the same normals. Normals that are averaged
    never cross such a seam, so nothing need be looked for.
    """
    if mesh.normals is None or mesh.crease_angle is not None:
        return mesh.faces
    _, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    return index.ravel().astype(np.uint32)[mesh.faces]


def _mesh_pairs(faces, values) -> np.ndarray:
    """Return the pairs of faces that share an edge and the `values` (n_face, 3, k) of the corners at its ends.

    An edge with more than two faces has a pair for each two that follow one another by index.
    """
    begin, end = faces, faces[:, [1, 2, 0]]
    is_turned = (begin > end).ravel()
    keys = (np.minimum(begin, end).astype(np.uint64) << np.uint64(32) | np.maximum(begin, end)).ravel()
    at_begin, at_end = values.reshape(len(keys), -1), values[:, [1, 2, 0]].reshape(len(keys), -1)
    low, high = np.where(is_turned[:, None], (at_end, at_begin), (at_begin, at_end))
    order = np.argsort(keys, kind="stable")
    first, second = order[:-1], order[1:]
    is_same = (keys[first] == keys[second]) & (np.abs(low[first] - low[second]).max(axis=1) <= _SAME_NORMAL)
    is_same &= np.abs(high[first] - high[second]).max(axis=1) <= _SAME_NORMAL
    a, b = first[is_same] // 3, second[is_same] // 3
    return np.minimum(a, b).astype(np.uint64) << np.uint64(32) | np.maximum(a, b).astype(np.uint64)


def _face_keys(surface: _Surface, view, is_perspective, lights) -> np.ndarray:
    """Return a number (n_face,) that is equal for faces seen and lit alike; -1 for those that are not looked at.

    Bit 0 tells which side the viewer sees, the others which side each light sees. A face that a light's terminator
    crosses is lit in part, and there the intensity of the surface itself has a kink.
    """
    corners = surface.corners
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    to_viewer = view.eye - corners.mean(axis=1) if is_perspective else np.broadcast_to(-view.forward, area.shape)
    cosine = np.einsum("ij,ij->i", area, to_viewer)
    key = (cosine > 0.0).astype(np.int64)
    is_good = np.abs(cosine) > _LEAST_COSINE * np.linalg.norm(area, axis=1) * np.linalg.norm(to_viewer, axis=1)
    for k, light in enumerate(lights):
        to_light = _to_light(light, corners, view)
        if to_light is not None:
            is_lit = np.einsum("ijk,ijk->ij", surface.normals, to_light) > 0.0
            is_good &= is_lit.all(axis=1) | ~is_lit.any(axis=1)
            key += is_lit[:, 0].astype(np.int64) << (k % 60 + 1)
    return np.where(is_good, key, -1)


def _to_light(light, points, view):
    """Return the way from points (..., 3) to a light, of any length; None for light that comes from no single place."""
    beam = entry_of(light).beam(light, view)
    if beam is None:
        return None
    return np.broadcast_to(-beam.axis, points.shape) if beam.origin is None else beam.origin - points


def _jumps(luminance, face, pairs, key) -> tuple[np.ndarray, np.ndarray]:
    """Return the jumps of the value and of the slope, (n,) each, along the rows of a picture."""
    n = max(face.shape[1] - 5, 0)
    f0, f1, f2, f3, f4, f5 = (face[:, k : n + k] for k in range(6))
    is_place = (f0 == f1) & (f1 == f2) & (f2 != f3) & (f3 == f4) & (f4 == f5) & (f2 >= 0) & (f3 >= 0)
    rows, columns = np.nonzero(is_place)
    a, b = f2[rows, columns].astype(np.uint64), f3[rows, columns].astype(np.uint64)
    is_seen = (key[a] == key[b]) & (key[a] >= 0)
    is_seen &= _is_in(np.minimum(a, b) << np.uint64(32) | np.maximum(a, b), pairs)
    rows, columns = rows[is_seen], columns[is_seen]
    i0, i1, i2, i3, i4, i5 = (luminance[rows, columns + k] for k in range(6))
    slope_a, value_a = _at_edge(i0, i1, i2)
    slope_b, value_b = _at_edge(i5, i4, i3)
    slopes = np.stack([slope_a, i3 - i2, -slope_b])
    return np.abs(value_b - value_a), np.ptp(slopes, axis=0)


def _at_edge(far, middle, near):
    """Return slope, towards the edge, and value half a pixel beyond the last of three pixels, by the parabola through
    them.

    With the differences d = near - middle and c = near - 2 middle + far: the slope half a pixel before `near` is d and
    grows by c a pixel; the value is near + d/2 + c (1/2)(3/2)/2 (Newton's backward formula).
    """
    d, c = near - middle, near - 2.0 * middle + far
    return d + c, near + 0.5 * d + 0.375 * c


def _is_in(keys, table) -> np.ndarray:
    """Tell which keys are in an ascending table."""
    if not len(table):
        return np.zeros(len(keys), bool)
    place = np.minimum(np.searchsorted(table, keys), len(table) - 1)
    return table[place] == keys
