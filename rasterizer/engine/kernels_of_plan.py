"""The kernels that draw a picture, each with its signature: they follow from its plan.

So they can be compiled in one round before the picture is drawn. What a kernel is called with is put together here from
the same structures as in the stages, with no room in their arrays: a signature tells of types alone. A kernel that is
missing here costs no more than time: it is compiled when it is met.
"""

from collections.abc import Callable, Collection
from typing import Any, NamedTuple

import numpy as np

from ..compiler.kernels import Job
from ..compiler.signatures import signature_of
from ..geometry import closed, ears, equal_rows, normals, surfaces
from ..geometry.weld import FEW
from ..io import text_kernels
from ..options import Options
from ..pipeline import a_buffer, buffers, clip, cull, resolve, shadow_lookup
from ..pipeline import textures as laying
from ..pipeline.cull import Band, Rows, scatter
from ..pipeline.edges import draw_edges
from ..pipeline.gradients import HAS_TEXTURE, Coding
from ..pipeline.interpolate import ScannedBand
from ..pipeline.lighting import ShadowMaps, SurfacePoints, light_points
from ..pipeline.phong_shading import shade_lit
from ..pipeline.resolve import encode_picture
from ..pipeline.scan import ScanCounts, make_deferred, scan, scan_index
from ..pipeline.shade import fade, shade_interpolated
from ..pipeline.texturing import Texturing, shade_textured
from ..pipeline.transform import Drawables, PixelWidth, Screen, Triangles, Vertices, make_screen, transform_range
from ..pipeline.visibility import forget_extents
from ..pipeline.workspace import Workspace, WorkspaceShape, make_picture, make_workspace
from ..scene.camera import Camera
from ..scene.mesh import Mesh
from .attributes import make_coding, make_encoding, scale_depths
from .buffers import BUFFER_TABLE
from .depth_range import DEEP, depths_of_boxes, fit_depth_range
from .domains import nearness_in
from .plan import Plan, make_plan
from .scene_tables import SceneTables
from .shadow_maps import corners_of, leaves_casters_out
from .uniforms import list_materials, used_functions

SIZE = (8, 8)  # of a picture without room, pixels
SINGLE, DOUBLE = np.dtype(np.float32), np.dtype(np.float64)
# Arrays without room, by what they would hold:
ROWS = np.empty((0, 3))  # vectors
CORNERS, FACES = np.empty((3, 0), np.uint32), np.empty(0, np.uint32)
SIDES = np.empty(0, np.int8)
NUMBERS, FLAGS, LENGTHS = np.empty(0, np.int64), np.empty(0, np.uint8), np.empty(0)
PLACES = np.empty(0, np.int32)
WORDS = np.empty((0, 3), np.uint32)
KEYS = np.empty(0, np.uint64)
NO_FANS = normals.Fans(FACES, FACES, FACES, 0)
NO_TRIANGLES = Drawables(
    Triangles(CORNERS, CORNERS, FLAGS),
    Vertices(np.empty(0, np.int32), np.empty(0, np.int32), LENGTHS, LENGTHS, LENGTHS, PixelWidth(0.0, 0.0, 0.0)),
    np.empty((1, 0, 0)),
)  # fmt: skip


def splits_points(mesh: Mesh) -> bool:
    """Tell whether what differs at the corners of a vertex may give it several points."""
    of_corners = any(values is not None and values.ndim == 3 for values in (mesh.normals, mesh.colors))
    return of_corners or mesh.face_colors is not None or mesh.face_material is not None


def list_kernels(tables: SceneTables, options: Options, camera: Camera, plan: Plan | None = None) -> list[Job]:
    """List the kernels that draw a picture of a scene through a camera.

    Parameters
    ----------
    plan : None = the one that the scene will have in most views, before anything of it is prepared
    """
    plan = plan_ahead(tables, options, camera) if plan is None else plan
    found = PictureKernels(tables, options, camera, plan)
    found.add_geometry()
    names = [name for name in options.outputs if name not in ("color", "rgb")]
    if len(names) < len(options.outputs):
        found.add_picture()
    if names:
        found.add_buffers(names)
    if options.edges:
        found.add_edges()
    return list(found.jobs)


def list_mesh_kernels() -> list[Job]:
    """List the kernels that work on meshes outside of pictures: those that read text, cut ears, and weld vertices."""
    found = KernelList()
    found.add(text_kernels.read_rows, FLAGS, NUMBERS, text_kernels.POWERS, ROWS)
    found.add(text_kernels.read_numbers, FLAGS, text_kernels.POWERS, LENGTHS)
    found.add(text_kernels.read_corners, FLAGS, NUMBERS, NUMBERS, np.empty((3, 0), np.int32))
    found.add_equal_rows()
    polygons = ears.Polygons(ROWS, NUMBERS, NUMBERS, NUMBERS, NUMBERS)
    found.add(
        ears.cut_outlines, polygons, ears.make_ear_scratch(0), 0, np.empty((0, 3), np.int64), np.empty(0, np.bool_)
    )
    return list(found.jobs)


def plan_ahead(tables: SceneTables, options: Options, camera: Camera) -> Plan:
    """The plan of a scene in a view, but for what its surfaces are needed for."""
    plan, view = make_plan(tables, options), camera.view()
    roundings = plan.intensities.roundings_at(nearness_in(tables, plan.clearances, view))
    return plan.with_shares(plan.shares_at(roundings, False), False)


class KernelList:
    """Kernels with their signatures, each once."""

    def __init__(self) -> None:
        self.jobs: dict[Job, None] = {}

    def add(self, kernel: Callable, *arguments: Any) -> None:
        """Add a kernel that is called with such arguments."""
        self.jobs[getattr(kernel, "py_func", kernel), signature_of(arguments)] = None

    def add_batch_function(self, function: Callable, dtype: np.dtype) -> None:
        """Add a function that kernels call by its address."""
        self.jobs[function, ("batch function", dtype.name)] = None

    def add_equal_rows(self) -> None:
        """Add what finds equal rows."""
        self.add(equal_rows.deal_rows, WORDS, 0, np.uint64(0), FACES, FACES, KEYS)
        self.add(equal_rows.match_rows, KEYS, WORDS, KEYS, FACES)
        self.add(equal_rows.number_rows, FACES, NUMBERS)


class Parts(NamedTuple):
    """What the kernels of a pass are called with, without room."""

    screen: Screen
    coding: Coding | None  # None where entries hold the places of triangles alone
    workspace: Workspace

    @property
    def band(self) -> ScannedBand:
        """A band behind the scan stage."""
        return ScannedBand(
            self.workspace.visibility, self.workspace.records, self.coding, ScanCounts(0, 0, 0, 0, 0), 0, 0
        )


class PictureKernels(KernelList):
    """The kernels of one picture, stage after stage."""

    def __init__(self, tables: SceneTables, options: Options, camera: Camera, plan: Plan) -> None:
        super().__init__()
        self.tables, self.options, self.camera, self.plan = tables, options, camera, plan

    # ------------------------------------------------ before the first picture

    def add_equal_rows(self) -> None:
        """Add it, where there may be more rows than are sorted."""
        if any(3 * mesh.n_face >= FEW for mesh in self.tables.meshes):
            super().add_equal_rows()

    def add_geometry(self) -> None:
        """Add what gathers the geometry: normals and creases."""
        if self.options.is_flat:
            self.add(
                normals.sum_by_polygon, ROWS, ROWS, np.empty((0, 3), np.uint32), FACES, ROWS, ROWS, np.empty((0, 2))
            )
        else:
            self.add(surfaces.flag_inverted, ROWS, ROWS, CORNERS, CORNERS, (0, 0), FLAGS)
            if any(mesh.normals is None or mesh.crease_angle is not None for mesh in self.tables.meshes):
                rule = normals.CreaseRule(np.empty(0, np.int32), 0.0, 0)
                split, scratch = normals.SplitVertices(FACES, ROWS), normals.make_fan_scratch(0)
                self.add(normals.list_corners, FACES, FACES, FACES)
                self.add(normals.split_fans, ROWS, NO_FANS, rule, scratch, (0, 0), 0, CORNERS, split)
        if any(material.needs_uv for material in self.tables.materials) or any(map(splits_points, self.tables.meshes)):
            self.add_equal_rows()
        if self.options.cull == "auto" and any(mesh.is_opaque for mesh in self.tables.meshes):
            bodies, is_border = closed.Bodies(FACES, LENGTHS, LENGTHS), np.empty(0, np.bool_)
            self.add(normals.list_corners, FACES, FACES, FACES)
            self.add(closed.find_bodies, ROWS, WORDS, NO_FANS, NUMBERS, bodies, SIDES, is_border)
        if self.tables.has_shadows:
            self.add(surfaces.compute_shapes, ROWS, CORNERS, np.empty((0, 5)))

    # ------------------------------------------------ the stages up to scan

    def screen(self, factor: int) -> Screen:
        """The screen of the camera, fitted to no depths; `factor` samples a pixel along each axis."""
        size = (SIZE[0] * factor, SIZE[1] * factor)
        return make_screen(self.camera.view(), self.camera.projection(size), (1.0, 2.0), 1.0, np.inf)

    def add_stages(self, parts: Parts, with_deferred: bool = False) -> None:
        """Add the stages from transform to scan."""
        screen, workspace, (triangles, vertices, *_) = parts.screen, parts.workspace, NO_TRIANGLES
        bands, grid = np.empty(0, np.uint16), cull.Grid(*SIZE, 1)
        visible = cull.Visible(FACES, bands, bands, NUMBERS, 0)
        self.add(transform_range, LENGTHS, 0, 0, screen, vertices)
        self.add(cull.find_visible_in, 0, 0, triangles.vertex_idx, vertices, grid, SIDES, cull.make_cull_scratch(),
                 visible)  # fmt: skip
        self.add(scatter, FACES, bands, bands, NUMBERS, FACES)
        if parts.coding is None:
            self.add(scan_index, Band(FACES, 0, 0), NO_TRIANGLES, workspace.block, workspace.visibility)
            return
        deferred = make_deferred(0, workspace.extents) if with_deferred else None
        self.add(scan, Band(FACES, 0, 0), NO_TRIANGLES, parts.coding, workspace.block, workspace.visibility,
                 workspace.records, deferred)  # fmt: skip

    def add_clipping(self, screen: Screen) -> None:
        """Add what clips, where a mesh's box reaches beyond the clip planes."""
        depths = depths_of_boxes(self.camera.view(), self.tables.bounds)
        (near, far), far_clip = fit_depth_range(self.camera, depths)
        scratch = clip.make_clip_scratch()
        if depths[0] < near or depths[1] > far_clip:
            parts = np.empty((0, 3, clip.N_CORNER_COLUMN))
            self.add(clip.find_crossing, ROWS, CORNERS, FACES, screen, scratch, FACES)
            self.add(clip.clip_faces, ROWS, CORNERS, FACES, screen, scratch, parts, FACES)
        if self.camera.is_perspective and near < far * DEEP:
            self.add(clip.search_nearest, ROWS, CORNERS, screen, clip.Window(0.0, 0.0, 0.0, 0.0), scratch)

    # ------------------------------------------------ the picture

    def add_picture(self) -> None:
        """Add what draws the colours of a picture."""
        options, plan, factor = self.options, self.plan, self.options.factor
        shape = WorkspaceShape(
            SIZE[0] * factor, SIZE[1] * factor, plan.n_channel, int(plan.of_materials.n_attributes.max()), plan.dtype,
            plan.textures is not None, plan.opacity is not None,
        )  # fmt: skip
        screen = self.screen(factor)
        coding = make_coding(plan, options.tolerance)._replace(depths=scale_depths(screen))
        parts = Parts(screen, coding, make_workspace(shape, 1))
        self.add_stages(parts, with_deferred=plan.opacity is not None)
        self.add_clipping(screen)
        self.add_lights()
        rows, listed = np.empty((0, 0), np.float32), [each for one in plan.tables.materials for each in one.textures]
        if listed:
            self.add(laying.largest_steps, rows)
        if any(texture.encoded is not None for texture in listed):
            self.add(laying.decode_texels, np.empty((0, 0), np.uint8), 0, rows, rows)
        if any(texture.n_level > 1 for texture in listed):
            self.add(laying.halve_texels, rows, rows)
        if any(texture.n_level > 1 and texture.has_alpha for texture in listed):
            self.add(laying.halve_weighted_texels, rows, rows)
        if plan.is_lit_per_sample:
            self.add_lit(parts)
        else:
            self.add_interpolated(parts)
        if plan.cue is not None:
            self.add(fade, parts.band.uncoded(), coding.depths, True, plan.cue, parts.workspace.radiance)
        if plan.opacity is not None:
            self.add_layers(parts)
        self.add_resolve(parts)

    def add_lights(self) -> None:
        """Add the functions of lights and reflection models, and what draws shadow maps."""
        plan = self.plan
        for dtype in plan.of_materials.dtypes:
            functions = {function for row in used_functions(plan, dtype) for function in row}
            for function in functions - {None}:
                self.add_batch_function(function, dtype)
            if plan.tables.has_shadows:
                self.add_batch_function(shadow_lookup.occlude, dtype)
                self.add_shadow_map(dtype)
        corners = corners_of(self.tables.bounds)
        if plan.tables.has_shadows and leaves_casters_out(plan.tables.reflected_lights, corners, self.camera.view()):
            self.add(cull.compute_outcodes, ROWS, np.empty(3), ROWS, FLAGS)
            self.add(cull.list_seen, CORNERS, FLAGS, FACES)

    def add_shadow_map(self, dtype: np.dtype) -> None:
        """Add what draws the map of a light."""
        screen, workspace = self.screen(1), make_workspace(WorkspaceShape(1, 1, 0, 0, SINGLE, 0, False), 1)
        self.add_stages(Parts(screen, None, workspace))
        self.add(shadow_lookup.write_map, workspace.visibility, 0, 0, 0.0, 0.0, np.empty((0, 0), dtype))

    def add_lit(self, parts: Parts) -> None:
        """Add what lights every sample: Phong's method."""
        plan, workspace, table = self.plan, parts.workspace, np.empty((0, 5))
        tangents = 0 if plan.has_tangents else None
        for dtype in plan.of_materials.dtypes:
            batch = workspace.batch if dtype == SINGLE else workspace.double_batch
            lighting, texturing = self.lighting(dtype), self.texturing(parts)
            self.add(
                shade_lit, parts.band, parts.screen, lighting, table, tangents, texturing, batch, workspace.radiance
            )

    def add_interpolated(self, parts: Parts) -> None:
        """Add what lights points and interpolates what they give off: flat shading and Gouraud's method."""
        plan, workspace = self.plan, parts.workspace
        points = SurfacePoints(ROWS, ROWS, ROWS if plan.has_tangents else None, ROWS, np.empty((2, 0)))
        for dtype in plan.of_materials.dtypes:
            batch = workspace.batch if dtype == SINGLE else workspace.double_batch
            self.add(light_points, points, (0, 0), parts.screen, 0, self.lighting(dtype), 0, batch, np.empty((0, 1)))
        if not ((parts.coding.features & HAS_TEXTURE) != 0).all():
            self.add(shade_interpolated, parts.band, plan.tint, workspace.batch, workspace.radiance)
        if plan.textures is not None:
            self.add(shade_textured, parts.band, self.texturing(parts), workspace.batch, workspace.radiance)

    def lighting(self, dtype: np.dtype) -> Any:
        """The illumination in one type, as kernels take it."""
        shadows = ShadowMaps(0, NUMBERS) if self.plan.tables.has_shadows else None
        return list_materials(self.plan, dtype)._replace(shadows=shadows)

    def texturing(self, parts: Parts) -> Texturing | None:
        """The textures with memory for looking them up; None where there are none."""
        workspace = parts.workspace
        batches = workspace.lookup_batch, workspace.double_batch
        if self.plan.textures is None:
            return None
        return Texturing(self.plan.textures, self.plan.metals, *batches, workspace.alphas)

    def add_layers(self, parts: Parts) -> None:
        """Add what sums up the layers of transparent surfaces."""
        workspace, extents, rows = parts.workspace, parts.workspace.extents, Rows(0, 1)
        buffer = a_buffer.make_a_buffer(workspace.room, extents, 1, self.plan.n_channel)
        self.add(a_buffer.number_samples, extents, buffer.columns, buffer.first_samples)
        fragments = a_buffer.Fragments(buffer.columns, PLACES, PLACES, NUMBERS, NUMBERS)
        band, deferred = Band(FACES, 0, 0), make_deferred(0, extents)
        self.add(a_buffer.list_fragments, band, deferred, 0, NO_TRIANGLES, workspace.block, workspace.visibility,
                 fragments)  # fmt: skip
        self.add(a_buffer.sort_fragments, fragments, buffer.starts, NUMBERS)
        layer = a_buffer.make_layer(workspace.room, extents, rows, workspace.radiance, workspace.alphas)
        translucent = a_buffer.Translucent(buffer.opacity, buffer.columns, extents.left, extents.right)
        self.add(a_buffer.show_layer, 0, layer, NUMBERS, buffer, 0.0)
        self.add(a_buffer.composite, layer, workspace.records, buffer, self.plan.opacity)
        self.add(a_buffer.put_behind, 0, 0, workspace.visibility, buffer, workspace.radiance, translucent)
        self.add(forget_extents, extents)
        self.add(buffers.clear_band, workspace.visibility, 0)

    def add_resolve(self, parts: Parts) -> None:
        """Add what makes pixels of samples."""
        workspace, options, plan = parts.workspace, self.options, self.plan
        radiance, visibility = workspace.radiance, workspace.visibility
        encoding = make_encoding(plan, self.tables.background, options.color_range)
        picture = make_picture(SIZE, "color" in options.outputs or options.color_range == "global")
        rest = (0, 0), resolve.make_grid(options.factor), encoding, workspace.pixels, picture
        self.add(resolve.resolve_averages, visibility, radiance, *rest)
        if plan.opacity is not None:
            translucent = a_buffer.Translucent(LENGTHS, NUMBERS, NUMBERS, NUMBERS)
            self.add(resolve.resolve_translucent, visibility, radiance, translucent, *rest)
        if options.color_range == "global" or self.tables.background is not None:
            color, alpha = np.empty((0, 0, 3), np.float32), np.empty((0, 0), np.float32)
            self.add(encode_picture, color, alpha, encoding, picture.rgba)

    # ------------------------------------------------ exact buffers

    def add_buffers(self, names: Collection[str]) -> None:
        """Add what draws exact buffers."""
        screen, workspace = self.screen(1), make_workspace(WorkspaceShape(1, 1, 0, 0, SINGLE, 0, False), 1)
        self.add_stages(Parts(screen, None, workspace))
        self.add_clipping(screen)
        self.add(buffers.clear_band, workspace.visibility, 0)
        visible = buffers.VisibleSurfaces(
            workspace.visibility, FACES, NO_TRIANGLES, FACES, scale_depths(screen), False,
            workspace.batch,
        )  # fmt: skip
        for name in names:
            self.add_buffer(name, visible)

    def add_buffer(self, name: str, visible: buffers.VisibleSurfaces) -> None:
        """Add what writes one buffer."""
        buffer, band = BUFFER_TABLE[name], Band(FACES, 0, 0)
        out = buffer.make((0, 0))
        if buffer.write in (buffers.write_normal, buffers.write_turned_normal):
            self.add(buffers.write_normal_rows, visible, band, np.empty((0, 0), np.float32))
        elif buffer.write is buffers.write_label:
            self.add(buffer.write, visible, band, out, np.empty(0, np.int32))
        elif buffer.write is buffers.write_mean:
            values = out.reshape(0, 0, buffer.n_component)
            self.add(buffers.write_means, visible, band, values, buffers.CornerTable(np.empty((0, 2)), CORNERS))
        elif buffer.table is None:
            self.add(buffer.write, visible, band, out)

    def add_edges(self) -> None:
        """Add what draws edges over a picture, and the depths that hide them."""
        self.add_equal_rows()
        self.add_buffers(("depth",))
        samples = np.empty((0, 0), np.float32)
        self.add(draw_edges, np.empty((0, 6)), ROWS, float(self.options.edge_width), True, (0, 0), samples, samples)
