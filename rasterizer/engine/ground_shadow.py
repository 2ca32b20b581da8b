"""The soft shadow of a scene on the ground under it, for the alpha channel of its pictures.

    scene ─ masks ─ opacity of the ground ─ under a picture
            what each point of an area light      over a square, once    pixels that show the ground
            can't see of the ground               for all pictures       (pipeline/ground_picture.py)

The ground is the plane through the scene's lowest point. It shows nothing but the shadow, so a picture with it lies on
any page. The light is round, far above the scene, and has the same intensity everywhere on the ground. The scene as one
of the light's points sees it, in perspective, covers just the texels of the ground that get no light from there: a
projected shadow (Blinn 1988, "Me and My (Fake) Shadow"). The mean over the points is the shadow of the area light.

Masks are made of bits (pipeline/ground.py): each triangle is drawn once, whatever the number of points. What is
transparent lets a share of the light through: triangles of one opacity a that turn the same side to the light are drawn
into masks of their own. Where the two sides hide the shares h >= k of the light, k is weakened by a twice, as by the
front and the back of a glass body, and h - k once: a·(h + (1 - a)·k) is lost. Opacities are combined as if each hid
points of the light at random, which is exact but in half-shadows. Several surfaces of one opacity and side, one behind
the other, count once, and a texture counts with the mean of its alpha. Cut-outs are cut into pieces about as large as a
texel of the ground, of which those count whose middle is there.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..cores import MIN_PART, Workers
from ..options import Options
from ..pipeline import ground as bits
from ..pipeline.ground_picture import SeenGround, lay_under
from ..scene.camera import Camera
from ..scene.color import LINEAR_OF_BYTE
from ..scene.framing import orbit_axes
from ..scene.material import Material
from ..scene.mesh import Mesh
from ..scene.scene import Scene
from ..scene.texture import Texture

HEIGHT = 5.0  # of the light above the ground, in radii of the scene's box
SPREAD = 0.35  # radius of the light over its height: how fast shadows become soft
RESOLVED = 2.0**-40  # of its distance from the origin: a scene that is smaller is a point
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
POINTS = 256  # of the light
OPACITIES = 32  # that are told apart, each of which costs as much as all that is opaque
MARGIN = 3  # texels beyond the shadow: what a mask may be off by, and nothing
MOST_PIECES = 2**21  # of the cut-outs of a mesh: 100 cards over all of the ground
MIN_FACES = 2**15  # that are worth layers of their own
DECODED = LINEAR_OF_BYTE.astype(np.float32)
OPAQUE = 0xFF000000  # bytes under which no shadow lies
NO_COLOR, NO_ALPHA = np.empty((0, 0, 3), np.float32), np.empty((0, 0), np.float32)


class Ground(NamedTuple):
    """Where the texels of the shadow lie: world space, scene units."""

    center: NDArray[np.float64]  # (3,) of the ground that is looked at
    right: NDArray[np.float64]  # (3,) along a row of texels
    front: NDArray[np.float64]  # (3,) from a row to the next
    up: NDArray[np.float64]  # (3,) away from the ground
    texel: float  # width of one
    shape: tuple[int, int]  # rows and columns of texels
    radius: float  # half the diagonal of the scene's box


class GroundShadow:
    """Hold the shadow of a scene on the ground under it, for all pictures of the scene.

    Parameters
    ----------
    scene : Scene; its `up` says where the ground is. What is transparent lets light through
    strength : opacity of the ground where no light arrives, 0 to 1
    size : texels along the longer side of the shadow
    points : of the light; None = 256
    threads : how many; None = as many as the process may use

    Attributes
    ----------
    opacity : (rows, columns) float32, 0 where all of the light arrives, `strength` where none does
    ground : Ground, where its texels lie; None where the scene is a point
    """

    def __init__(
        self,
        scene: Scene,
        *,
        strength: float = 0.6,
        size: int = 512,
        points: int | None = None,
        threads: int | None = None,
    ) -> None:
        self.ground = _ground_under(scene, size)
        self.opacity: NDArray[np.float32] = np.zeros((4, 4), np.float32)
        if self.ground is not None:
            with Workers(Options(threads=threads).n_thread) as workers:
                self.opacity = np.float32(strength) * _hidden_share(scene, self.ground, points or POINTS, workers)
        self._rimmed = np.pad(self.opacity, 1)  # no shadow beyond the last texel

    def outline(self, share: float = 0.4) -> NDArray[np.float64]:
        """Return points round the part of the shadow that a picture should show.

        Parameters
        ----------
        share : of the deepest shadow; what is fainter lies outside

        Returns
        -------
        (n, 3) float64, world space, scene units; none where there is no shadow
        """
        if self.ground is None:
            return np.empty((0, 3))
        dark = self.opacity > share * self.opacity.max(initial=0.0)
        rows = np.flatnonzero(dark.any(axis=1))
        first, last = dark[rows].argmax(axis=1), dark.shape[1] - 1 - dark[rows, ::-1].argmax(axis=1)
        ground, middle = self.ground, (np.array(dark.shape) - 1) / 2.0
        across = np.concatenate([first, last])[:, None] - middle[1]
        along = np.concatenate([rows, rows])[:, None] - middle[0]
        return ground.center + ground.texel * (across * ground.right + along * ground.front)

    def lay_under(
        self,
        camera: Camera,
        rgba: NDArray[np.uint8],
        color: NDArray[np.float32] | None,
        alpha: NDArray[np.float32] | None,
        background: tuple[float, float, float] | None,
        threads: Workers,
        scale: float = 1.0,
    ) -> None:
        """Lay the shadow under a picture.

        Parameters
        ----------
        camera : Camera that the picture was drawn with
        rgba : (height, width, 4) uint8, sRGB and alpha, not premultiplied, drawn without a background; changed
        color, alpha : (height, width, 3) and (height, width) float32, linear, of the same picture, changed; None where
            nobody needs them
        background : linear colour of what lies behind; None = the picture stays transparent
        threads : that take rows each
        scale : what the bytes show the background multiplied by
        """
        height, width = rgba.shape[:2]
        planes = None if self.ground is None else _texel_planes(self.ground, camera, (width, height))
        if planes is None and background is None:
            return
        planes = np.zeros((3, 3)) if planes is None else planes  # the ground is seen nowhere
        behind = np.array([0, 0, 0, 0] if background is None else [*background, 1], np.float32)
        linear = (NO_COLOR, NO_ALPHA) if color is None or alpha is None else (color, alpha)
        columns = _seen_columns(planes, self.opacity.shape, (width, height))
        ground, words = SeenGround(self._rimmed, planes, columns, *faded((width, height))), rgba.view(np.uint32)[..., 0]
        parts = threads.ranges(height, -(-MIN_PART // width))

        def lay(behind, *picture):
            threads.map(lambda rows: lay_under(ground, behind, DECODED, rows, *picture), parts)

        if scale != 1.0 and len(linear[1]):
            lay(behind, np.full(words.shape, OPAQUE, np.uint32), *linear)
            linear = NO_COLOR, NO_ALPHA
        lay(behind * np.array([scale, scale, scale, 1], np.float32), words, *linear)


def faded(size: tuple[int, int]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return what the shadow is multiplied by in each column and in each row, (width,) and (height,): smoothly from 1
    to exactly 0 at the picture's border, over an eighth of its shorter side."""
    wide = max(min(size) / 8.0, 1.0)
    x, y = (np.minimum(np.minimum(np.arange(n), np.arange(n)[::-1]) / wide, 1.0) for n in size)
    across, along = ((t * t * (3.0 - 2.0 * t)).astype(np.float32) for t in (x, y))
    return across, along


def _ground_under(scene: Scene, size: int) -> Ground | None:
    """Find the rectangle of the ground on which there may be shadow; None for a scene that is a point."""
    right, up, forward = orbit_axes(0.0, 0.0, scene.up)
    front = -forward
    box = np.stack([scene.bounds @ axis for axis in (right, front, up)])
    low, high = box.min(axis=1), box.max(axis=1)
    radius = math.hypot(*(high - low)) / 2.0
    if radius <= RESOLVED * float(np.abs(scene.bounds).max()):
        return None
    half, height = (high - low)[:2] / 2.0, float(high[2] - low[2])
    # The shadow of a point at the height z lies z/(HEIGHT radius - z) times further from the light than the point.
    further = height / (HEIGHT * radius - height)
    half = half + further * (half + SPREAD * HEIGHT * radius)
    middle = (low + high) / 2.0
    texel = 2.0 * float(half.max()) / (size - 2 * MARGIN)
    columns, rows = (min(max(math.ceil(2.0 * side / texel) + 2 * MARGIN, 4), size) for side in half)
    center = middle[0] * right + middle[1] * front + low[2] * up
    return Ground(center, right, front, up, texel, (rows, columns), radius)


def _light_points(n: int) -> NDArray[np.float64]:
    """Return points that share a disc evenly, (2, n), along `right` and `front` from above the centre; its radius is 1.

    Source: Vogel 1979, "A better way to construct the sunflower head".
    """
    k = np.arange(n)
    away = np.sqrt((k + 0.5) / n)
    return np.stack([away * np.cos(k * GOLDEN_ANGLE), away * np.sin(k * GOLDEN_ANGLE)])


def _opacity_of(material: Material) -> float:
    """Return the opacity of a material, rounded to a multiple of 1/OPACITIES; 1 where it is opaque. Of a texture the
    mean of its alpha counts, of cut-outs what is there."""
    alpha, opacity = np.ones(1), material.opacity
    if isinstance(material.texture, Texture) and material.texture.has_alpha:
        alpha = material.texture.image[..., 3]
    if material.alpha_cutoff is not None:
        return float((opacity * alpha >= material.alpha_cutoff).any())
    return round(OPACITIES * opacity * float(alpha.mean(dtype=np.float64))) / OPACITIES


def _hidden_share(scene: Scene, ground: Ground, n: int, workers: Workers) -> NDArray[np.float32]:
    """Return which share of the light of n points each texel doesn't get."""
    opacities = [np.array([_opacity_of(material) for material in mesh.palette]) for mesh in scene.meshes]
    hidden, top = np.zeros(ground.shape, np.float32), float(np.ptp(scene.bounds @ ground.up))
    for opacity in sorted({*np.concatenate(opacities).tolist()} - {0.0}, reverse=True):
        casters = []
        for mesh, of_palette in zip(scene.meshes, opacities, strict=True):
            material = 0 if mesh.face_material is None else mesh.face_material
            is_drawn = np.broadcast_to(of_palette[material] == opacity, mesh.n_face)
            for k, of_mesh in enumerate(mesh.palette):
                if opacity == 1.0 and of_mesh.alpha_cutoff is not None and of_palette[k] == 1.0:
                    casters.append(
                        _pieces(mesh, np.flatnonzero(np.broadcast_to(material == k, mesh.n_face)), of_mesh, ground)
                    )
                    is_drawn = is_drawn & (material != k)
            casters.append((mesh.vertices, mesh.faces if is_drawn.all() else mesh.faces[is_drawn]))
        sides = (None,) if opacity == 1.0 else (1, -1)
        shares = [_count_hidden(casters, side, top, ground, n, workers) for side in sides]
        once, twice = np.maximum.reduce(shares), np.minimum.reduce(shares)
        hidden += (1 - hidden) * np.float32(opacity) * (once + np.float32(1 - opacity) * twice)
    return hidden


def _pieces(mesh: Mesh, chosen: NDArray[np.int64], material: Material, ground: Ground) -> tuple[NDArray, NDArray]:
    """Return vertices (n, 3) and faces (m, 3) of what is there of some faces of a mesh, of a cut-out's material."""
    texture, cutoff = material.texture, material.alpha_cutoff or 0.0
    corners = mesh.vertices[mesh.faces[chosen]]
    if texture is None or not texture.has_alpha or mesh.uv is None:
        return corners.reshape(-1, 3), np.arange(3 * len(chosen), dtype=np.uint32).reshape(-1, 3)
    uv = (mesh.uv[mesh.faces[chosen]] if mesh.uv.ndim == 2 else mesh.uv[chosen])[..., :2]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0) / ground.texel
    sides *= min(1.0, math.sqrt(MOST_PIECES / max(float((sides * sides).sum()), 1.0)))
    counts, parts = np.maximum(np.ceil(sides), 1).astype(int), []
    for n in np.unique(counts).tolist():
        lattice = _split(n)
        middles = np.einsum("pk,fkc->fpc", lattice.mean(axis=1), uv[counts == n])
        face, piece = np.nonzero(material.opacity * _alpha_at(texture, middles) >= cutoff)
        parts.append(np.einsum("pik,pkc->pic", lattice[piece], corners[counts == n][face]).reshape(-1, 3))
    found = np.concatenate(parts) if parts else np.empty((0, 3))
    return found, np.arange(len(found), dtype=np.uint32).reshape(-1, 3)


def _split(n: int) -> NDArray[np.float64]:
    """Return the weights of the corners of n² equal pieces of a triangle, (n², 3, 3)."""
    i, j = (each.ravel() for each in np.mgrid[:n, :n])
    upright = np.stack([(i, j), (i + 1, j), (i, j + 1)], axis=0)[:, :, i + j < n]
    turned = np.stack([(i + 1, j + 1), (i, j + 1), (i + 1, j)], axis=0)[:, :, i + j < n - 1]
    places = np.concatenate([upright, turned], axis=2).transpose(2, 0, 1) / n
    return np.concatenate([1.0 - places.sum(axis=2, keepdims=True), places], axis=2)


def _alpha_at(texture: Texture, uv: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the alpha of the texels that texture coordinates (..., 2) lie in."""
    (height, width), texels = texture.shape, []
    for axis, (n, wrap) in enumerate(zip((width, height), texture.wrap, strict=True)):
        place = uv[..., axis] if wrap != "mirror" else 1.0 - np.abs(uv[..., axis] % 2.0 - 1.0)
        place = place % 1.0 if wrap == "repeat" else place
        texels.append(np.clip(np.nan_to_num(np.floor(place * n)), 0, n - 1).astype(int))
    return texture.image[height - 1 - texels[1], texels[0], 3]


def _count_hidden(
    casters: list[tuple[NDArray, NDArray]], side: int | None, top: float, ground: Ground, n: int, workers: Workers
) -> NDArray[np.float32]:
    """Return which share of n points of the light each texel doesn't see, where all is opaque.

    Parameters
    ----------
    casters : vertices (n_vertex, 3), world space, and faces (n_face, 3) of each mesh
    side : 1 or -1 = of the triangles that turn one or the other side to the light; None = of all
    top : height of the scene above the ground
    """
    height, radius = HEIGHT * ground.radius, SPREAD * HEIGHT * ground.radius / ground.texel
    columns, rows = ground.right / ground.texel, ground.front / ground.texel
    frame = np.array([ground.center, columns, rows, ground.up, (height, radius, 0.0)])
    n_part = max(min(workers.n_thread, sum(len(faces) for _, faces in casters) // MIN_FACES), 1)
    parts = [bits.make_layers(ground.shape, top / (height - top) * radius) for _ in range(n_part)]
    lights, near = _light_points(n), []

    def draw(vertices: NDArray[np.float64], faces: NDArray[np.uint32]) -> None:
        points = np.empty((len(vertices), 3), np.float32)
        workers.map(lambda part: bits.project(vertices, frame, *part, points), workers.ranges(len(vertices)))
        points[:, :2] += (np.array(ground.shape[::-1], np.float32) - 1) / 2
        if side is not None:
            faces = faces[_areas(points, faces) * side > 0]
        is_near, cuts = np.zeros(len(faces), np.bool_), [len(faces) * k // n_part for k in range(n_part + 1)]
        workers.map(lambda k: bits.draw_layers(points, faces, *cuts[k : k + 2], parts[k], is_near), range(n_part))
        near.append(points[faces[is_near]])

    def count(first: int) -> NDArray[np.uint8]:
        some, size = np.ascontiguousarray(lights[:, first : first + bits.CHUNK]), layers.ground.size
        n_light, sums = some.shape[1], np.zeros((bits.CHUNK.bit_length(), size), np.uint64)
        masks = np.zeros((n_light, size + bits.PADDING), np.uint64)
        bits.count_hidden(layers, triangles, some, np.empty(n_light, np.bool_), masks, sums)
        return sum(np.unpackbits(plane.view(np.uint8), bitorder="little") << k for k, plane in enumerate(sums))

    for caster in casters:
        draw(*caster)
    layers, triangles = bits.join(parts), np.concatenate(near)
    counts = sum(workers.map(count, range(0, n, bits.CHUNK)), np.uint32(0))
    return counts.reshape(ground.shape[0], -1)[:, : ground.shape[1]].astype(np.float32) / np.float32(n)


def _areas(points: NDArray[np.float32], faces: NDArray[np.uint32]) -> NDArray[np.float64]:
    """Return twice the signed areas of projected triangles, (n,)."""
    (ax, ay), (bx, by), (cx, cy) = (points[faces[:, k], :2].T.astype(np.float64) for k in range(3))
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def _texel_planes(ground: Ground, camera: Camera, size: tuple[int, int]) -> NDArray[np.float64] | None:
    """Return three planes over a picture, (3, 3): each is a·x + b·y + c at the pixels' coordinates (x, y).

    The ray through a pixel meets the ground in column first/third and row second/third of texels, before the camera
    where the third is above 0. None where the camera is not above the ground.
    """
    view, projection = camera.view(), camera.projection(size)
    scale_x, scale_y, center_x, center_y, is_perspective, _ = projection
    right, up = projection.ray_axes(view)
    across = np.stack([right / scale_x, -up / scale_y, up * (center_y / scale_y) - right * (center_x / scale_x)])
    # The ray's origin and direction as linear functions of (x, y, 1), of which one is constant.
    start, way = (np.outer([0.0, 0.0, 1.0], each) for each in (view.eye - ground.center, view.forward))
    moved = way if is_perspective else start
    moved += across
    height, w = start @ ground.up, -way @ ground.up  # the ray sinks by w, and meets the ground at height/w of its way
    if (height if is_perspective else w)[2] <= 0.0:
        return None
    if is_perspective:
        hits = np.outer(w, start[2]) + way * height[2]
    else:
        hits = start * w[2] + np.outer(height, way[2])
    axes, (rows, columns) = np.stack([ground.right, ground.front]) / ground.texel, ground.shape
    return np.stack([*(axes @ hits.T + np.outer((columns / 2, rows / 2), w)), w])


def _seen_columns(planes: NDArray[np.float64], shape: tuple[int, ...], size: tuple[int, int]) -> NDArray[np.int64]:
    """Return the first and the end of the pixels of each row that may show texels, of which there are `shape`:
    (height, 2); a pixel more on both sides for rounding."""
    (width, height), (rows, columns) = size, shape
    # Above 0 where a ray meets the ground before the camera; and not before, nor behind, its columns and rows.
    inside = np.array([(0, 0, 1), (1, 0, 0.5), (-1, 0, columns + 0.5), (0, 1, 0.5), (0, -1, rows + 0.5)]) @ planes
    step, start = inside[:, :1], inside[:, 1:2] * (np.arange(height) + 0.5) + inside[:, 2:] + 0.5 * inside[:, :1]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = -start / step
    furthest = np.where((step == 0.0) & (start <= 0.0), 0.0, width)
    first, end = np.where(step > 0.0, ends, 0.0).max(axis=0), np.where(step < 0.0, ends, furthest).min(axis=0)
    return np.stack([first - 1.0, end + 2.0], axis=1).clip(0.0, width).astype(np.int64)
