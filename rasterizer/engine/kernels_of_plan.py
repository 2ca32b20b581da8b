"""The kernels that draw a picture, each with its signature: they follow from its plan.

So they can be compiled in one round before the picture is drawn. What a kernel is called with is put together here from
the same structures as in the stages, with no room in their arrays: a signature tells of types alone. A kernel that is
missing here costs no more than time: it is compiled when it is met.
"""

from collections.abc import Callable, Collection, Iterator
from typing import Any, NamedTuple

import numpy as np

from ..compiler.kernels import Job
from ..compiler.signatures import signature_of
from ..geometry import ears, normals, surfaces
from ..geometry.points import number_materials
from ..geometry.polygons import fill_means
from ..geometry.surfaces import find_shortest_normal
from ..options import Options
from ..pipeline import a_buffer, buffers, clip, cull, resolve, shade_once, shadow_lookup, textures
from ..pipeline.cull import Band, Rows, compute_outcodes, list_seen, scatter
from ..pipeline.edges import draw_edges
from ..pipeline.gradients import HAS_TEXTURE, Coding
from ..pipeline.interpolate import ScannedBand
from ..pipeline.lighting import ShadowMaps, SurfacePoints, light_points
from ..pipeline.phong_shading import FaceTable, shade_lit
from ..pipeline.resolve import encode_picture
from ..pipeline.scan import ScanCounts, make_deferred, scan
from ..pipeline.shade import fade, shade_interpolated
from ..pipeline.shade_once import make_grid
from ..pipeline.texture_sampling import sample_textures
from ..pipeline.texturing import Texturing, shade_textured
from ..pipeline.transform import Drawables, Screen, Triangles, Vertices, make_screen, transform_range
from ..pipeline.visibility import forget_extents
from ..pipeline.workspace import Workspace, WorkspaceShape, make_picture, make_workspace
from ..scene.camera import Camera
from ..scene.scene import Scene
from . import lights as light_table
from .attributes import make_buffer_coding, make_coding, make_encoding, make_map_coding, sampled_in_double, scale_depths
from .buffers import BUFFER_TABLE
from .depth_range import DEEP, depths_of_boxes, fit_depth_range
from .plan import Plan, list_lights, make_plan
from .shadow_maps import corners_of, leaves_casters_out
from .uniforms import list_materials, used_functions

SIZE = (8, 8)  # of a picture without room, pixels
NO_FANS = normals.Fans(np.empty(0, np.uint32), np.empty(0, np.uint32), np.empty(0, np.uint32), 0)
COUNTS = ScanCounts(0, 0, 0, 0, 0)
NO_MAPS = ShadowMaps(0, np.empty(0, np.int64))
SINGLE, DOUBLE = np.dtype(np.float32), np.dtype(np.float64)


class KernelList:
    """Kernels with their signatures, each once."""

    def __init__(self) -> None:
        self._found: dict[Job, None] = {}

    def add(self, kernel: Callable, *arguments: Any) -> None:
        """Add a kernel that is called with such arguments."""
        self._found[getattr(kernel, "py_func", kernel), signature_of(arguments)] = None

    def add_batch_function(self, function: Callable, dtype: np.dtype) -> None:
        """Add a function that kernels call by its address."""
        self._found[function, ("batch function", dtype.name)] = None

    def __iter__(self) -> Iterator[Job]:
        return iter(self._found)


def list_kernels(scene: Scene, options: Options, camera: Camera | None = None, plan: Plan | None = None) -> list[Job]:
    """List the kernels that draw a picture of a scene.

    Parameters
    ----------
    camera : None = the scene's own
    plan : None = the one that the scene will have in most views, before anything of it is prepared
    """
    found, camera = KernelList(), scene.camera_for(options.size) if camera is None else camera
    plan = plan_of(scene, options, camera) if plan is None else plan
    add_geometry(found, scene, options, plan, camera)
    names = [name for name in options.outputs if name not in ("color", "rgb")]
    if len(names) < len(options.outputs):
        add_picture(found, scene, options, plan, camera)
    if names:
        # Entries of normals hold what buffers look for: no triangles are drawn for these.
        is_shared = len(names) < len(options.outputs) and options.factor == 1 and plan.is_lit_per_sample
        add_buffers(found, scene, options, names, camera, is_shared and plan.opacity is None)
    if options.edges:
        add_edges(found, scene, options, camera)
    return list(found)


def list_mesh_kernels() -> list[Job]:
    """List the kernels that work on meshes outside of pictures: those that cut ears."""
    found, columns = KernelList(), np.empty(0, np.int64)
    polygons = ears.Polygons(np.empty((0, 3)), columns, columns, columns, columns)
    found.add(ears.cut_outlines, polygons, ears.make_ear_scratch(0), np.empty((0, 3), np.int64), np.empty(0, np.bool_))
    return list(found)


def plan_of(scene: Scene, options: Options, camera: Camera) -> Plan:
    """The plan of a scene whose surfaces aren't known yet: lights are as far away as from the nearest vertex."""
    colors = [mesh.face_colors if mesh.colors is None else mesh.colors for mesh in scene.meshes]
    rows = [np.empty((0, 3)), *(each[..., :3].reshape(-1, 3) for each in colors if each is not None)]
    materials, numbers = number_materials(scene.meshes)
    lights = list_lights(scene)[0]
    clearances = np.full((len(materials), len(lights)), np.inf)
    for mesh, of_mesh in zip(scene.meshes, numbers, strict=True):

        def distance(position, vertices=mesh.vertices):
            return float(np.linalg.norm(vertices - np.asarray(position), axis=1).min(initial=np.inf))

        of_lights = [light_table.entry_of(light).clearance(light, camera.view(), distance) for light in lights]
        clearances[of_mesh] = np.minimum(clearances[of_mesh], of_lights)
    return make_plan(scene, options, np.concatenate(rows), 0.5 * clearances)


# ---------------------------------------------------------------- before the first picture


def add_geometry(found: KernelList, scene: Scene, options: Options, plan: Plan, camera: Camera) -> None:
    """Add what gathers the geometry: normals and creases; and what measures how near lights are to it."""
    vertices, faces, of_faces = np.empty((0, 3)), np.empty((0, 3), np.uint32), np.empty(0, np.uint32)
    columns, corners = np.empty((3, 0)), np.empty((3, 0), np.uint32)
    if options.is_flat:
        found.add(normals.sum_by_polygon, vertices, faces, of_faces, vertices, np.empty(0))
    else:
        found.add(surfaces.flag_inverted, columns, columns, corners, np.empty(0, np.uint8))
        if any(mesh.normals is None or mesh.crease_angle is not None for mesh in scene.meshes):
            rule = normals.CreaseRule(np.empty(0, np.int32), 0.0, 0)
            split = normals.SplitVertices(of_faces, vertices)
            found.add(normals.list_corners, of_faces, of_faces, of_faces)
            found.add(normals.split_fans, vertices, NO_FANS, rule, normals.make_fan_scratch(0), 0, 0, of_faces, split)
    if plan.has_shadows:
        found.add(surfaces.compute_shapes, columns, corners, np.empty((0, 5)))
    asked: list = []  # of lights whose clearance is measured
    for light in plan.lights:
        light_table.entry_of(light).clearance(light, camera.view(), lambda position: asked.append(position) or 1.0)
    if asked and plan.is_lit_per_sample:
        found.add(surfaces.compute_clearance, columns, corners, 0.0, 0.0, 0.0)
    elif asked:
        found.add(surfaces.compute_point_clearance, columns, 0.0, 0.0, 0.0)
    if plan.is_lit_per_sample and plan.brightness.turn_slopes.max(initial=0.0) > 0.0:
        found.add(surfaces.find_shortest_normal, columns, corners)


# ---------------------------------------------------------------- what all pictures have


class Parts(NamedTuple):
    """What the kernels of a pass are called with, without room."""

    screen: Screen
    coding: Coding
    workspace: Workspace
    drawables: Drawables
    factor: int = 1  # samples a pixel along each axis

    @property
    def band(self) -> ScannedBand:
        """A band behind the scan stage."""
        return ScannedBand(self.workspace.visibility, self.workspace.records, self.coding, COUNTS, 0, 0)


def screen_of_no_scene(camera: Camera, factor: int) -> Screen:
    """The screen of a camera, fitted to no depths."""
    size = (SIZE[0] * factor, SIZE[1] * factor)
    return make_screen(camera.view(), camera.projection(size), (1.0, 2.0), 1.0, np.inf)


def no_drawables() -> Drawables:
    """No triangles, as all passes take them."""
    corners = np.empty((3, 0), np.uint32)
    vertices = Vertices(np.empty(0, np.int32), np.empty(0, np.int32), np.empty(0))
    triangles = Triangles(corners, corners, np.empty(0, np.uint8))
    return Drawables(triangles, vertices, np.empty((1, 0, 0), np.float32), np.empty((1, 0, 0)))


def add_stages(found: KernelList, parts: Parts, with_deferred=False) -> None:
    """Add the stages up to scan."""
    screen, workspace, drawables = parts.screen, parts.workspace, parts.drawables
    corners, faces, bands = drawables.triangles.vertex_idx, np.empty(0, np.uint32), np.empty(0, np.uint16)
    visible = cull.Visible(faces, bands, bands, np.empty(0, np.int64), 0)
    found.add(transform_range, np.empty((3, 0)), 0, 0, screen, drawables.vertices)
    grid = cull.Grid(*SIZE, 1)
    found.add(cull.find_visible_in, 0, 0, corners, drawables.vertices, grid, False, cull.make_cull_scratch(), visible)
    found.add(scatter, faces, bands, bands, np.empty(0, np.int64), faces)
    deferred = make_deferred(0, workspace.extents) if with_deferred else None
    found.add(scan, Band(faces, 0, 0), drawables, parts.coding, workspace.block, workspace.visibility,
              workspace.records, deferred)  # fmt: skip


def add_clipping(found: KernelList, scene: Scene, camera: Camera, screen: Screen) -> None:
    """Add what clips, where a mesh's box reaches beyond the clip planes."""
    depths = depths_of_boxes(camera.view(), np.stack([mesh.bounds for mesh in scene.meshes]))
    (near, far), far_clip = fit_depth_range(camera, depths)
    positions, corners, faces = np.empty((3, 0)), np.empty((3, 0), np.uint32), np.empty(0, np.uint32)
    scratch, parts = clip.make_clip_scratch(), np.empty((0, 3, clip.N_CORNER_COLUMN))
    if depths[0] < near or depths[1] > far_clip:
        found.add(clip.find_crossing, positions, corners, faces, screen, scratch, faces)
        found.add(clip.clip_faces, positions, corners, faces, screen, scratch, parts, faces)
    if camera.is_perspective and near < far * DEEP:
        found.add(clip.search_nearest, positions, corners, screen, clip.Window(0.0, 0.0, 0.0, 0.0), scratch)


# ---------------------------------------------------------------- the picture


def add_picture(found: KernelList, scene: Scene, options: Options, plan: Plan, camera: Camera) -> None:
    """Add what draws the colours of a picture."""
    factor, is_lit = options.factor, plan.is_lit_per_sample
    once = factor if options.antialias == "shade-once" and factor > 1 and (is_lit or plan.textures) else 0
    kind = WorkspaceShape(8 * factor, 8 * factor, plan.n_channel, int(plan.of_materials.n_attributes.max()), plan.dtype,
                         plan.textures is not None, plan.opacity is not None, once)  # fmt: skip
    screen = screen_of_no_scene(camera, factor)
    coding = make_coding(plan, options.tolerance)._replace(depths=scale_depths(screen))
    parts = Parts(screen, coding, make_workspace(kind, 1), no_drawables(), factor)
    add_stages(found, parts, with_deferred=plan.opacity is not None)
    add_clipping(found, scene, camera, screen)
    add_lights(found, scene, plan, camera)
    if plan.packed_textures is not None:
        add_packing(found)
    (add_lit if is_lit else add_interpolated)(found, scene, plan, parts)
    if plan.cue is not None:
        found.add(fade, parts.band.uncoded(), coding.depths, True, plan.cue, parts.workspace.radiance)
    if plan.opacity is not None:
        add_layers(found, plan, parts)
    add_resolve(found, options, plan, scene, parts)


def add_lights(found: KernelList, scene: Scene, plan: Plan, camera: Camera) -> None:
    """Add the functions of lights and reflection models, and what draws shadow maps."""
    for dtype in plan.dtypes:
        functions = {function for row in used_functions(plan, dtype) for function in row}
        for function in functions - {None}:
            found.add_batch_function(function, dtype)
        if plan.has_shadows:
            found.add_batch_function(shadow_lookup.occlude, dtype)
            add_shadow_map(found, dtype)
    if plan.has_shadows:
        corners = corners_of(np.stack([mesh.bounds for mesh in scene.meshes]))
        if leaves_casters_out(plan.reflected_lights, corners, camera.view()):
            codes, faces = np.empty(0, np.uint8), np.empty(0, np.uint32)
            found.add(compute_outcodes, np.empty((3, 0)), np.empty(3), np.empty((0, 3)), codes)
            found.add(list_seen, np.empty((3, 0), np.uint32), codes, faces)


def add_shadow_map(found: KernelList, dtype: np.dtype) -> None:
    """Add what draws the map of a light."""
    screen = screen_of_no_scene(Camera.perspective((0, 0, 1)), 1)
    workspace = make_workspace(WorkspaceShape(1, 1, 0, 0, SINGLE, False, False), 1)
    add_stages(found, Parts(screen, make_map_coding(screen), workspace, no_drawables()))
    found.add(shadow_lookup.write_map, workspace.visibility, 0, 0, 0.0, 0.0, np.empty((0, 0), dtype))


def add_lit(found: KernelList, scene: Scene, plan: Plan, parts: Parts) -> None:
    """Add what lights every sample: Phong's method."""
    workspace, tangents = parts.workspace, 0 if plan.has_tangents else None
    textures = plan.textures and Texturing(plan.textures, workspace.lookup_batch, workspace.double_batch,
                                           workspace.texels)  # fmt: skip
    table = FaceTable(np.empty((0, 5)))
    for band in shaded_bands(plan, parts):
        add_look_up(found, plan, parts, band)
        for dtype in plan.dtypes:
            batch = workspace.batch if dtype == SINGLE else workspace.double_batch
            found.add(shade_lit, band, parts.screen, lighting_without_functions(plan, dtype), table, tangents, textures,
                      batch, workspace.radiance)  # fmt: skip
    if workspace.points is not None:
        add_points(found, parts, plan)


def add_interpolated(found: KernelList, scene: Scene, plan: Plan, parts: Parts) -> None:
    """Add what lights points and interpolates what they give off: flat shading and Gouraud's method."""
    workspace = parts.workspace
    columns, tangents = np.empty((3, 0)), np.empty((3, 0)) if plan.has_tangents else None
    points = SurfacePoints(columns, columns, tangents, np.empty((0, 3)), np.empty((2, 0)))
    for dtype in plan.dtypes:
        batch = workspace.batch if dtype == SINGLE else workspace.double_batch
        lighting, out = lighting_without_functions(plan, dtype), np.empty((0, 1), dtype)
        found.add(light_points, points, (0, 0), parts.screen, 0, lighting, 0, batch, out)
    if any(mesh.polygons is not None for mesh in scene.meshes) and not plan.is_flat:
        for is_double in set(plan.of_materials.reads_double.tolist()):
            out, rows = np.empty((0, 1), DOUBLE if is_double else SINGLE), np.empty(0, np.int64)
            found.add(fill_means, out, 0, rows, rows, 0, 0)
    has_texture = (parts.coding.features & HAS_TEXTURE) != 0
    if not has_texture.all():
        found.add(shade_interpolated, parts.band, plan.tint, workspace.batch, workspace.radiance)
    if plan.textures is not None:
        texturing = Texturing(plan.textures, workspace.lookup_batch, workspace.double_batch, workspace.texels)
        for band in shaded_bands(plan, parts):
            add_look_up(found, plan, parts, band)
            found.add(shade_textured, band, texturing, workspace.batch, workspace.radiance)
        if workspace.points is not None:
            add_points(found, parts, plan)


def lighting_without_functions(plan: Plan, dtype: np.dtype) -> Any:
    """The illumination in one type, as kernels take it."""
    lighting = list_materials(plan, dtype)
    return lighting._replace(shadows=NO_MAPS if plan.has_shadows else None)


def shaded_bands(plan: Plan, parts: Parts) -> list[ScannedBand]:
    """The bands that the shade stage takes: of points, where a pixel is shaded once a polygon; else of samples, as for
    what is transparent always."""
    points = parts.workspace.points
    return ([parts.band] if points is None or plan.opacity is not None else []) + (
        [points.band(parts.band, 2)] if points is not None else []
    )


def add_packing(found: KernelList) -> None:
    """Add what packs textures for look-ups in float32."""
    found.add(textures.largest_color, np.empty((0, 4), np.float32))
    texels = np.empty((0, 0), np.int16)
    found.add(textures.pack_texels, np.empty((0, 0), np.float32), False, False, 0.0, texels)


def add_look_up(found: KernelList, plan: Plan, parts: Parts, band: ScannedBand) -> None:
    """Add what looks textures up in float64."""
    sampled = plan.textures and sampled_in_double(plan.textures, parts.coding)
    if sampled:
        found.add(sample_textures, band.uncoded(), sampled, parts.workspace.double_batch, parts.workspace.texels)


def add_points(found: KernelList, parts: Parts, plan: Plan) -> None:
    """Add what lists the points where pixels are shaded, and what gives samples their light."""
    workspace, radiance = parts.workspace, parts.workspace.radiance
    grid, order = make_grid(parts.factor), shade_once.order_samples(parts.factor)
    found.add(shade_once.list_points, parts.band, grid, order, False, workspace.points)
    if plan.opacity is not None or plan.cue is not None or not plan.is_lit_per_sample:
        found.add(shade_once.spread_points, workspace.visibility, 0, 0, workspace.points, radiance, radiance)


def add_layers(found: KernelList, plan: Plan, parts: Parts) -> None:
    """Add what sums up the layers of transparent surfaces."""
    workspace, drawables, least = parts.workspace, parts.drawables, 0.0
    extents, rows = workspace.extents, Rows(0, 1)
    buffer = a_buffer.make_a_buffer(workspace.room, extents, 1, plan.n_channel)
    found.add(a_buffer.number_samples, extents, buffer.columns, buffer.first_samples)
    deferred, entries = make_deferred(0, extents), np.empty(0, np.int64)
    lists = a_buffer.FragmentLists(0, 0, 0, entries, *buffer.lists, True, entries)
    found.add(a_buffer.list_fragments, 0, deferred, drawables.triangles, drawables.vertices, rows, workspace.block,
              workspace.visibility, lists)  # fmt: skip
    found.add(a_buffer.divide_room, buffer.cursors, buffer.starts)
    found.add(a_buffer.sort_lists, lists)
    layer = a_buffer.make_layer(workspace.room, extents, rows, workspace.radiance, workspace.texels)
    translucent = a_buffer.Translucent(buffer.opacity, buffer.columns, extents.left, extents.right)
    found.add(a_buffer.show_layer, 0, layer, lists, buffer.transmittance, least)
    found.add(a_buffer.composite, layer, workspace.records, buffer, plan.opacity)
    found.add(a_buffer.put_behind, 0, 0, workspace.visibility, lists, buffer, workspace.radiance, translucent)
    found.add(forget_extents, extents)
    found.add(buffers.clear_band, workspace.visibility, 0)


def add_resolve(found: KernelList, options: Options, plan: Plan, scene: Scene, parts: Parts) -> None:
    """Add what makes pixels of samples."""
    workspace, factor, with_color = parts.workspace, options.factor, "color" in options.outputs
    encoding, grid = make_encoding(plan, scene.background, options.color_range), make_grid(factor)
    picture = make_picture(SIZE, with_color or options.color_range == "global")
    radiance, visibility, batch = workspace.radiance, workspace.visibility, workspace.pixels
    if workspace.points is not None and (plan.is_lit_per_sample or plan.textures is not None):
        found.add(
            resolve.resolve_averages, visibility, radiance, workspace.points, (0, 0), grid, encoding, batch, picture
        )
    if workspace.points is None or plan.opacity is not None or not plan.is_lit_per_sample or plan.cue is not None:
        found.add(resolve.resolve_averages, visibility, radiance, None, (0, 0), grid, encoding, batch, picture)
    if plan.opacity is not None:
        columns, opacity = np.empty(0, np.int64), np.empty(0)
        translucent = a_buffer.Translucent(opacity, columns, columns, columns)
        found.add(
            resolve.resolve_translucent, visibility, radiance, translucent, (0, 0), grid, encoding, batch, picture
        )
    if options.color_range == "global" or scene.background is not None:
        found.add(encode_picture, np.empty((0, 0, 3), np.float32), np.empty((0, 0), np.float32), encoding, picture.rgba)


# ---------------------------------------------------------------- exact buffers


def add_buffers(
    found: KernelList, scene: Scene, options: Options, names: Collection[str], camera: Camera, is_shared: bool
) -> None:
    """Add what draws exact buffers; of their triangles only where they don't share those of a picture."""
    screen = screen_of_no_scene(camera, 1)
    n_attribute = 3 if any(BUFFER_TABLE[name].needs_normals for name in names) else 0
    workspace = make_workspace(WorkspaceShape(1, 1, 0, n_attribute, SINGLE, False, False), 1)
    coding = make_buffer_coding(screen, n_attribute)
    parts = Parts(screen, coding, workspace, no_drawables())
    if not is_shared:
        add_stages(found, parts)
        add_clipping(found, scene, camera, screen)
        found.add(buffers.clear_band, workspace.visibility, 0)
    surfaces = buffers.VisibleSurfaces(
        workspace.visibility, workspace.records, parts.drawables, np.empty(0, np.uint32), coding.depths,
        False, False, False, workspace.batch,
    )  # fmt: skip
    for name in names:
        add_buffer(found, name, surfaces)
    if "normal" in names and not options.is_flat:
        found.add(find_shortest_normal, np.empty((3, 0)), np.empty((3, 0), np.uint32))


def add_buffer(found: KernelList, name: str, surfaces: buffers.VisibleSurfaces) -> None:
    """Add what writes one buffer."""
    buffer, band = BUFFER_TABLE[name], Band(np.empty(0, np.uint32), 0, 0)
    out = buffer.make((0, 0))
    if buffer.write in (buffers.write_normal, buffers.write_turned_normal):
        found.add(buffers.write_normal_rows, surfaces, band, np.empty((0, 0), np.float32))
    elif buffer.write is buffers.write_label:
        found.add(buffer.write, surfaces, band, out, np.empty(0, np.int32))
    elif buffer.write is buffers.write_mean:
        table = buffers.CornerTable(np.empty((0, 2)), np.empty((3, 0), np.uint32))
        found.add(buffers.write_means, surfaces, band, out.reshape(0, 0, buffer.n_component), table)
    elif buffer.table is None:
        found.add(buffer.write, surfaces, band, out)


def add_edges(found: KernelList, scene: Scene, options: Options, camera: Camera) -> None:
    """Add what draws edges over a picture, and the depths that hide them."""
    add_buffers(found, scene, options, ("depth",), camera, is_shared=False)
    samples, lines = np.empty((0, 0), np.float32), np.empty((0, 3))
    found.add(draw_edges, np.empty((0, 6)), lines, float(options.edge_width), True, samples, samples)
