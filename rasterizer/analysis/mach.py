"""Mach bands: how much intensity, and its slope, jump where one face meets the next on a smooth surface.

    in:  a picture of one sample a pixel (colour and faces) and its scene       out: `MachBands`

The eye overdraws a jump of the slope into a bright or dark line (Mach 1865), so the jump tells what an error map
doesn't: whether the polygons show. Eight pixels in a row or column, four in each of two faces, give it:

    intensity  i0  i1  i2  i3 ┊ i4  i5  i6  i7     a parabola through three pixels of a face gives value and slope at
    face        A   A   A   A ┊  B   B   B   B     the edge ┊; across the edge the slope is i4 - i3

What the surface itself does there isn't counted. Its curvature is in the parabolas. How fast that changes, as at the
rim of a narrow highlight, the fourth pixels tell: by as much as a cubic through four pixels differs from the parabola,
a surface without any edge may seem to jump, and that is taken off. Of flat shading and Gouraud's it is 0.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..engine.lights import entry_of
from ..engine.points import smooth_part
from ..errors import SceneError, shown
from ..frame import Frame
from ..scene.camera import Camera, View
from ..scene.mesh import Mesh
from ..scene.scene import Scene

# Luminance of linear RGB with the sRGB primaries. Source: ITU-R BT.709-6, section 3.
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

# Corner normals of two faces are one where they differ by less: files hold six decimals, and the mesh makes them unit
# vectors.
_SAME_NORMAL = 4e-6

# Faces seen at more than 60 degrees are left out: a pixel there spans more than two of its widths on the surface, and
# at the outline, where it spans any number, slopes and their jumps are as large as one likes, whatever the method.
_MIN_COSINE = 0.5

# What a third difference adds to value and slope half a pixel beyond, see `_at_edge`.
_VALUE_OF_CHANGE, _SLOPE_OF_CHANGE = 5.0 / 16.0, 23.0 / 24.0


class MachBands(NamedTuple):
    """What a picture's polygon edges look like, in linear intensity where white is 1.

    Attributes
    ----------
    value_jump : largest jump of the intensity at an edge; one that is continuous may have half of the slope's jump, as
        the edge may lie anywhere between two pixels
    slope_jump : largest difference of the intensity's slopes before, across and behind an edge, per pixel; where the
        intensity jumps, as in flat shading, that jump is the slope across the edge
    n_place : places that were looked at; where it is 0, no such faces of four pixels meet, and all jumps are 0
    slope_rms : root mean square of the slope's jumps at all places: what the picture looks like as a whole. The largest
        jump is that of one place. Where Gouraud's method misses a highlight it misses its bands, and Phong's may be the
        larger one there
    """

    value_jump: float
    slope_jump: float
    n_place: int
    slope_rms: float


class _Surface(NamedTuple):
    """A scene's faces, and the edges across which they are smooth."""

    pairs: NDArray[np.uint64]  # (n,) lower face << 32 | higher face
    corners: NDArray[np.float64]  # (n_face, 3, 3) world
    normals: NDArray[np.float64]  # (n_face, 3, 3) unit shading normals of the corners
    is_plain: NDArray[np.bool_]  # (n_face,) whether a face is opaque, and has no texture


def mach_bands(picture: Any, scene: Scene, camera: Camera | None = None) -> MachBands:
    """Measure the largest jumps of intensity, and of its slope, across the polygon edges of a picture.

    Only edges count across which the surface is smooth: two faces of one mesh share them, with the same shading normals
    and colours at both ends. Both must show the viewer the same side, at 60 degrees or less from their normal, and must
    not be crossed by the line where a light's side ends. So outlines, creases and shadow lines, which are to be seen,
    don't count; nor do faces with a texture, or that let something through, because what jumps there is to be seen as
    well. Intensity is the luminance of the linear colours. Its slope is per pixel: pictures of other sizes have others.

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
    rms = float(np.sqrt(np.mean(slope**2))) if len(slope) else 0.0
    return MachBands(float(value.max(initial=0.0)), float(slope.max(initial=0.0)), len(value), rms)


def _buffers(picture: Any, scene: Scene) -> tuple[NDArray, NDArray]:
    """Return the linear colours and the faces of a picture, checked."""
    if isinstance(picture, Frame) and picture.stats.samples != picture.size[0] * picture.size[1]:
        raise SceneError("Mach bands are measured in pictures of one sample a pixel: averages hide them")
    try:
        color, face = np.asarray(picture.color), np.asarray(picture.face)
    except SceneError:
        raise  # of a Frame: what to ask for
    except AttributeError:
        raise SceneError(f"a picture with color and face is needed; given {type(picture).__name__}") from None
    if face.ndim != 2 or face.dtype.kind not in "iu" or color.shape != (*face.shape, 3) or color.dtype.kind != "f":
        legal = "color must be (height, width, 3) linear and face (height, width) integers"
        raise SceneError(f"{legal}; given {color.dtype} {color.shape} and {face.dtype} {face.shape}")
    if face.size and face.max() >= scene.n_face:
        raise SceneError(f"the picture shows face {face.max()}; the scene has {scene.n_face} faces")
    return color, face


def _gather(scene: Scene) -> _Surface:
    """Lay out the faces of all meshes, and find the edges across which their shading normals and colours are
    continuous."""
    pairs, corners, normals, is_plain = [], [], [], []
    for mesh, offset in zip(scene.meshes, scene.face_offsets, strict=False):
        part = smooth_part(mesh)
        corners.append(part.positions[part.vertex])
        normals.append(part.normals[part.corner])
        is_plain.append(_plain_faces(mesh))
        values = part.normals if part.albedo is None else np.concatenate([part.normals, part.albedo], axis=1)
        pairs.append(_mesh_pairs(_by_position(mesh), values[part.corner]) + np.uint64(offset) * np.uint64(2**32 + 1))
    return _Surface(*map(np.concatenate, (pairs, corners, normals, is_plain)))


def _plain_faces(mesh: Mesh) -> NDArray[np.bool_]:
    """Tell which faces are opaque and have no texture."""
    is_plain = np.array([material.is_opaque and material.texture is None for material in mesh.palette], np.bool_)
    material = np.zeros(mesh.n_face, np.int32) if mesh.face_material is None else mesh.face_material
    return is_plain[material]


def _by_position(mesh: Mesh) -> NDArray[np.uint32]:
    """Return the faces (n_face, 3) with one index for all vertices at one place.

    Files cut surfaces at the seams of their textures, and give both sides the same normals. Normals that are averaged
    never cross such a seam, so nothing need be looked for.
    """
    if mesh.normals is None or mesh.crease_angle is not None:
        return mesh.faces
    _, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    return index.ravel().astype(np.uint32)[mesh.faces]


def _mesh_pairs(faces: NDArray[np.uint32], values: NDArray) -> NDArray[np.uint64]:
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


def _face_keys(surface: _Surface, view: View, is_perspective: bool, lights: Sequence[Any]) -> NDArray[np.int64]:
    """Return a number (n_face,) that is equal for faces seen and lit alike; -1 for those that are not looked at.

    Bit 0 tells which side the viewer sees, the others which side each light sees. A face that a light's terminator
    crosses is lit in part, and there the intensity of the surface itself has a kink.
    """
    corners = surface.corners
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    to_viewer = view.eye - corners.mean(axis=1) if is_perspective else np.broadcast_to(-view.forward, area.shape)
    cosine = np.einsum("ij,ij->i", area, to_viewer)
    key = (cosine > 0.0).astype(np.int64)
    is_good = np.abs(cosine) > _MIN_COSINE * np.linalg.norm(area, axis=1) * np.linalg.norm(to_viewer, axis=1)
    is_good &= surface.is_plain
    for k, light in enumerate(lights):
        to_light = _to_light(light, corners, view)
        if to_light is not None:
            is_lit = np.einsum("ijk,ijk->ij", surface.normals, to_light) > 0.0
            is_good &= is_lit.all(axis=1) | ~is_lit.any(axis=1)
            key += is_lit[:, 0].astype(np.int64) << (k % 60 + 1)
    return np.where(is_good, key, -1)


def _to_light(light: Any, points: NDArray, view: View) -> NDArray | None:
    """Return vectors from points (..., 3) to a light, of any length; None where it comes from no single place."""
    beam = entry_of(light).beam(light, view)
    if beam is None:
        return None
    if beam.origin is not None:
        return beam.origin - points
    return None if beam.axis is None else np.broadcast_to(-beam.axis, points.shape)


def _jumps(luminance: NDArray, face: NDArray, pairs: NDArray, key: NDArray) -> tuple[NDArray, NDArray]:
    """Return the jumps of the value and of the slope, (n,) each, along the rows of a picture."""
    n = max(face.shape[1] - 7, 0)
    windows = [face[:, k : n + k] for k in range(8)]
    a, b = windows[3], windows[4]
    is_place = (a != b) & (a >= 0) & (b >= 0)
    for k in range(3):
        is_place &= (windows[k] == a) & (windows[7 - k] == b)
    rows, columns = np.nonzero(is_place)
    a, b = a[rows, columns].astype(np.uint64), b[rows, columns].astype(np.uint64)
    is_seen = (key[a] == key[b]) & (key[a] >= 0)
    is_seen &= np.isin(np.minimum(a, b) << np.uint64(32) | np.maximum(a, b), pairs)
    rows, columns = rows[is_seen], columns[is_seen]
    intensities = [luminance[rows, columns + k] for k in range(8)]
    value_a, slope_a, change_a = _at_edge(intensities[:4])
    value_b, slope_b, change_b = _at_edge(intensities[:3:-1])
    slopes = np.stack([slope_a, intensities[4] - intensities[3], -slope_b])
    change = change_a + change_b
    value_jump = np.abs(value_b - value_a) - _VALUE_OF_CHANGE * change
    return np.maximum(value_jump, 0.0), np.maximum(np.ptp(slopes, axis=0) - _SLOPE_OF_CHANGE * change, 0.0)


def _at_edge(pixels: Sequence[NDArray]) -> tuple[NDArray, NDArray, NDArray]:
    """Return value and slope, towards the edge, half a pixel beyond the last of four pixels, by the parabola through
    the last three; and the size of their third difference.

    Newton's backward formula, s pixels beyond the last, with the differences d, c, t of first to third order:
    i + s d + s(s+1)/2 c + s(s+1)(s+2)/6 t. At s = 1/2 the terms of the value are 1/2, 3/8 and 5/16, those of its
    derivative 1, 1 and 23/24.
    """
    furthest, far, middle, near = pixels
    d, c = near - middle, near - 2.0 * middle + far
    return near + 0.5 * d + 0.375 * c, d + c, np.abs(near - 3.0 * middle + 3.0 * far - furthest)
