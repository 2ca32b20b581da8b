"""A picture of a scene, slowly: plain numpy float64 and Python integers.

In: a `Scene` and the options of a picture. Out: a `Picture` of float64 arrays. It reads in working order:

    surface ─ clip ─ snap ─ cover ─ visibility ─ shading ─ light ─ composite ─ resolve ─ edges

Letters: n_face loaded triangles; n_piece triangles after clipping, a fan for each face that is cut.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..choices import ColorRange, Cull, EdgeType, Samples, Shading
from ..options import Options
from ..scene.camera import Camera
from ..scene.color import ColorLike, linear_rgb, srgb_from_linear
from ..scene.scene import Scene
from .buffers import SurfaceBuffers, describe_surface
from .clip import (
    are_outside,
    choose_range,
    clip_to_view,
    depths_in_view,
    depths_of_boxes,
    depths_on_planes,
    project,
    snap,
    to_eye,
)
from .closed import find_inner_sides
from .cut_outs import are_there
from .edges import cover_samples, find_side, lay_over, list_edges, make_segment
from .light import Lighting, make_lighting
from .reflection import palette_of
from .shading import Fragments, light_samples
from .surface import Surface, compute_sides, gather
from .visibility import NO_KEY, Raster, Window, doubled_area, find_visible, gather_fragments


class Picture(NamedTuple):
    """A rendered picture. Depth, face, normal and margin are those of the pixel centres.

    The margin tells how safe the order of the surfaces is. Where a surface lets something through, the next ones have
    margins too; the least counts. The steps of a z-buffer grow with the depth squared in perspective, so these margins
    are brought to the depth of the nearest surface: as many steps there.

    Attributes
    ----------
    color : (height, width, 3) float64, linear, not clamped, not premultiplied
    alpha : (height, width) float64
    rgb : (height, width, 3) uint8, sRGB
    depth : (height, width) float64, scene units along the viewing axis, of the nearest surface; inf where nothing is
    face : (height, width) int32, index into the faces as loaded, of the nearest surface; -1 where nothing is
    normal : (height, width, 3) float64, unit, world space, towards the viewer, of the nearest surface; 0 where nothing
        is
    margin : (height, width) float64, how much deeper the runner-up lies, inf where there is none
    surface : SurfaceBuffers, masks, labels and coordinates of the nearest surface
    """

    color: NDArray[np.float64]
    alpha: NDArray[np.float64]
    rgb: NDArray[np.uint8]
    depth: NDArray[np.float64]
    face: NDArray[np.int32]
    normal: NDArray[np.float64]
    margin: NDArray[np.float64]
    surface: SurfaceBuffers


class PictureInputs(NamedTuple):
    """What a picture is made from, but for its samples."""

    scene: Scene
    camera: Camera
    surface: Surface
    size: tuple[int, int]  # (width, height) in pixels
    options: Options  # without its size
    limits: tuple[float | None, float | None]  # near and far, as `choose_range` takes them
    boxes: NDArray[np.float64]  # (n_mesh, 2, 3) round the meshes, world
    is_rounded: bool
    inner_sides: NDArray[np.int64]  # (n_face,) see `find_inner_sides`; 0 where nobody asks
    shading: str  # where light is evaluated: "flat", "gouraud" or "phong"


class Layers(NamedTuple):
    """The surfaces that a grid of samples sees, put on each other."""

    color: NDArray[np.float64]  # (h, w, 3) linear, premultiplied
    alpha: NDArray[np.float64]  # (h, w)
    normal: NDArray[np.float64]  # (h, w, 3) of the nearest surface
    face: NDArray[np.int32]  # (h, w) of the nearest surface
    depth: NDArray[np.float64]  # (h, w) of the nearest surface
    margin: NDArray[np.float64]  # (h, w) as in `Picture`
    fragments: Fragments  # of the nearest surface


def render(
    scene: Scene | Any,
    size: tuple[int, int] = (640, 480),
    *,
    shading: Shading = "gouraud",
    samples: Samples = 1,
    cull: Cull = Options.cull,
    color_range: ColorRange = "clamp",
    near: float | None = None,
    far: float | None = None,
    exposure: float = 0.0,
    spectral: int | None = None,
    rounded: bool = True,
    edges: EdgeType | Sequence[EdgeType] | None = None,
    edge_color: ColorLike = "black",
    edge_width: float = 1.0,
) -> Picture:
    """Render a scene slowly, and as exactly as float64 allows.

    Parameters
    ----------
    scene : Scene, or anything that `rz.load` takes
    size : (width, height) in pixels
    shading : "flat" (or "lambert"), "gouraud" or "phong": where the illumination equation is evaluated
    samples : 1, 4, 9 or 16 samples a pixel, on a regular grid, averaged in linear light
    cull : "auto" leaves out the inner sides of closed bodies, where the eye is outside of the mesh's box;
        "none" nothing, "back" faces whose winding is clockwise as the viewer sees it
    color_range : "clamp", "global" or "local": what becomes of values above 1 in `Picture.rgb`
    near, far : clipping distances in scene units; None takes the camera's, and without those the scene's own
    exposure : stops by which all light is multiplied, 2^exposure; not the background
    spectral : samples of 380..780 nm, or None: 81 where a light or material has a spectrum, else RGB alone
    rounded : whether colours, depths and normals are those of the polygons whose vertices are rounded to 1/256 px, as
        in the fast path; False takes them from the polygons as they are, of which a sample at the very edge sees the
        nearest point, and leaves the rounding to what is covered. The difference of both pictures is what the rounding
        of vertices does to colours
    edges, edge_color, edge_width : drawn over the picture, as in `Options`

    Returns
    -------
    Picture

    Raises
    ------
    SceneError : an option is not legal
    """
    # Refuses what isn't legal.
    options = Options(
        shading=shading, samples=samples, cull=cull, color_range=color_range, exposure=exposure,
        spectral=spectral, edges=edges, edge_color=edge_color, edge_width=edge_width,
    )  # fmt: skip
    if not isinstance(scene, Scene):
        from ..io.loader import load  # which imports what is compiled

        scene = load(scene)
    inputs = gather_inputs(scene, size, options, (near, far), rounded)
    per_axis = options.factor
    centres = _draw(inputs, 1)
    fine = _draw(inputs, per_axis) if per_axis > 1 else centres
    color, alpha = resolve(fine.color, fine.alpha, per_axis, scene.background)
    shown = in_range(color, color_range)
    if options.edges:
        share, seen = cover_edges(inputs, fine.depth, per_axis)
        seen = seen if scene.background is None else np.ones_like(seen)
        ink = np.array(linear_rgb(options.edge_color))
        shown, _ = lay_over(shown, alpha, share, seen, ink)
        color, alpha = lay_over(color, alpha, share, seen, ink)
    of_surface = describe_surface(scene, inputs.surface, centres.fragments, centres.normal, inputs.camera.view())
    return Picture(color, alpha, encode(shown), centres.depth, centres.face, centres.normal, centres.margin, of_surface)


def gather_inputs(
    scene: Scene,
    size: tuple[int, int],
    options: Options,
    limits: tuple[float | None, float | None] = (None, None),
    is_rounded: bool = True,
) -> PictureInputs:
    """Gather what a picture is made from; `limits` and `is_rounded` are `near`, `far` and `rounded` of `render`."""
    camera = scene.camera_for(size)
    near, far = (
        given if limit is None else limit for limit, given in zip(limits, (camera.near, camera.far), strict=True)
    )
    boxes = np.stack([mesh.bounds for mesh in scene.meshes])
    shading = "flat" if options.is_flat else options.shading
    surface, is_asked = gather(scene, shading), options.cull == "auto"
    inner = [find_inner_sides(mesh) if is_asked else np.zeros(mesh.n_face, np.int64) for mesh in scene.meshes]
    return PictureInputs(
        scene, camera, surface, size, options, (near, far), boxes, is_rounded, np.concatenate(inner), shading
    )


def spread_samples(inputs: PictureInputs, per_axis: int) -> tuple[Raster, Lighting]:
    """Bring the surface to a grid of per_axis² samples a pixel, and gather what lights it."""
    grid = inputs.size[0] * per_axis, inputs.size[1] * per_axis
    surface, options = inputs.surface, inputs.options
    view, projection = inputs.camera.view(), inputs.camera.projection(grid)
    lighting = make_lighting(
        inputs.scene, surface, view, projection, inputs.shading, options.spectral, options.exposure
    )
    position = to_eye(surface.corners, view)
    shown = depths_in_view(position, projection, grid)
    depths = choose_range(depths_of_boxes(inputs.boxes, view), projection.is_perspective, *inputs.limits, shown)
    pieces = clip_to_view(position, projection, depths)
    screen = snap(pieces.position, projection)
    places, plane_depths = screen, depths_on_planes(pieces.position, projection)
    if not inputs.is_rounded:  # rounding to the grid then decides what is covered, and nothing else
        places, plane_depths = project(pieces.position, projection), pieces.position[..., 2]
    facing = -np.sign(doubled_area(screen))  # counter-clockwise is a negative area where y grows downwards
    n_face = [mesh.n_face for mesh in inputs.scene.meshes]
    is_drawn = facing > 0 if options.cull == "back" else facing != 0
    is_outside = np.repeat(are_outside(inputs.boxes, view, projection, depths.near, grid), n_face)
    is_drawn &= (facing != inputs.inner_sides[pieces.face]) | ~is_outside[pieces.face]
    side = compute_sides(surface, pieces.face, facing)
    window = Window(0, 0, *grid)
    raster = Raster(pieces, screen, places, plane_depths, side, is_drawn, window, projection)
    palette = palette_of(inputs.scene)
    if any(material.alpha_cutoff is not None for material in palette):
        raster = raster._replace(are_there=partial(are_there, surface, palette))
    return raster, lighting


def _draw(inputs: PictureInputs, per_axis: int) -> Layers:
    """Put the layers of surfaces that each sample sees on each other, the nearest first, until one lets nothing
    through.

    Sources: Porter & Duff 1984, Computer Graphics 18(3), 253-259, "over" from front to back; Everitt 2001, NVIDIA,
    "Interactive order-independent transparency", for a picture of the next layer behind the one before.
    """
    raster, lighting = spread_samples(inputs, per_axis)
    surface, shape = inputs.surface, raster.window.shape
    color, through, margin = np.zeros((*shape, 3)), np.ones(shape), np.full(shape, np.inf)
    alpha = np.zeros(shape)  # summed up by itself: 1 - through has no digits where all is next to clear
    nearest = visible = find_visible(raster)
    front = fragments = gather_fragments(visible, raster)
    layer, normal, opacity = light_samples(surface, fragments, shape, lighting)
    face = np.full(shape, -1, np.int32)
    face[fragments.rows, fragments.columns] = fragments.face
    while len(fragments.face):
        at = visible.piece >= 0
        growth = (nearest.depth[at] / visible.depth[at]) ** 2 if raster.projection.is_perspective else 1.0
        margin[at] = np.minimum(margin[at], visible.margin[at] * growth)
        color += (through * opacity)[..., None] * layer
        alpha += through * opacity
        through *= 1.0 - opacity
        is_open = at & (through > 0)
        if not is_open.any():
            break
        visible = find_visible(raster, visible._replace(key=np.where(is_open, visible.key, NO_KEY)))
        fragments = gather_fragments(visible, raster)
        layer, _, opacity = light_samples(surface, fragments, shape, lighting)
    return Layers(color, alpha, normal, face, nearest.depth, margin, front)


def resolve(color: NDArray, alpha: NDArray, per_axis: int, background: object) -> tuple[NDArray, NDArray]:
    """Average blocks of per_axis² samples, their colour premultiplied; return straight colour (h, w, 3), 0 where
    nothing is, and alpha (h, w), over any background.
    """
    height, width = alpha.shape[0] // per_axis, alpha.shape[1] // per_axis
    total_alpha = alpha.reshape(height, per_axis, width, per_axis).sum(axis=(1, 3))
    total = color.reshape(height, per_axis, width, per_axis, 3).sum(axis=(1, 3))
    color, alpha = total / np.where(total_alpha > 0, total_alpha, 1)[..., None], total_alpha / per_axis**2
    if background is None:
        return color, alpha
    opaque = alpha[..., None]
    return color * opaque + np.array(linear_rgb(background)) * (1 - opaque), np.ones_like(alpha)


def cover_edges(inputs: PictureInputs, depth: NDArray, per_axis: int) -> tuple[NDArray, NDArray]:
    """Return which share of each pixel the edges cover that the options ask for, and which share of it sees anything,
    (h, w) each; `depth` is that of a grid of per_axis² samples a pixel."""
    (width, height), view, options = inputs.size, inputs.camera.view(), inputs.options
    projection = inputs.camera.projection((width * per_axis, height * per_axis))
    shown = depths_in_view(to_eye(inputs.surface.corners, view), projection, (width * per_axis, height * per_axis))
    depths = choose_range(depths_of_boxes(inputs.boxes, view), projection.is_perspective, *inputs.limits, shown)
    segments = []
    for edge in (edge for mesh in inputs.scene.meshes for edge in list_edges(mesh)):
        side = find_side(edge, options.edges, view, projection.is_perspective, options.cull == "back")
        if side is not None and len(segment := make_segment(edge, view, projection, depths)):
            segments.append((segment, side))
    share = cover_samples(segments, depth, options.edge_width * per_axis, projection.is_perspective)
    blocks = height, per_axis, width, per_axis
    return share.reshape(blocks).mean(axis=(1, 3)), np.isfinite(depth).reshape(blocks).mean(axis=(1, 3))


def encode(color: NDArray) -> NDArray[np.uint8]:
    """Return linear colours within 0..1 as 8-bit sRGB, rounded to nearest."""
    return np.rint(255 * srgb_from_linear(color)).astype(np.uint8)


def in_range(color: NDArray, color_range: str, largest: float | None = None) -> NDArray[np.float64]:
    """Bring linear colours into 0..1 as the colour range says.

    largest : the largest value of the whole picture, for "global"; None = that of `color`
    """
    if color_range == "global":
        color = color / max(color.max() if largest is None else largest, 1.0)
    elif color_range == "local":
        color = color / np.maximum(color.max(axis=-1, keepdims=True), 1.0)
    return np.clip(color, 0, 1)
