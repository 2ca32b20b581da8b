"""The passes: what the stages draw, how visible samples are shaded, and what becomes of a finished band.

    InterpolatedPass   flat shading and Gouraud's method: intensities of faces or vertices are interpolated
    LitPass            Phong's method: normals are interpolated, and every visible sample is lit
    BufferPass         exact buffers: depth, face, normal
    ShadowMapPass      what a light sees: depth alone

A pass holds plain arrays and small numbers for one view. `draw` (draw.py) asks it band after band: first `scan`, then
`shade`, then `finish`.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ..locks import cached_property
from ..pipeline.a_buffer import Opacity
from ..pipeline.buffers import CornerTable, VisibleSurfaces, clear_band
from ..pipeline.clip import Clipped
from ..pipeline.cull import Band
from ..pipeline.gradients import DOUBLE_PRECISION, HAS_COLORS, HAS_TEXTURE, SINGLE_PRECISION, Coding
from ..pipeline.interpolate import ScannedBand
from ..pipeline.lighting import Lighting
from ..pipeline.phong_shading import shade_lit
from ..pipeline.records import max_units
from ..pipeline.resolve import Encoding, Picture, SampleGrid, make_grid, resolve
from ..pipeline.scan import Deferred, ScanCounts, scan, scan_index
from ..pipeline.setup import DepthScale
from ..pipeline.shade import fade, shade_interpolated
from ..pipeline.shadow_lookup import write_map
from ..pipeline.texturing import Texturing, shade_textured
from ..pipeline.transform import Screen
from ..pipeline.workspace import Workspace, WorkspaceShape
from .attributes import NONE
from .buffers import BUFFER_TABLE
from .drawn import Drawn
from .plan import Plan

NO_PLANES = np.empty((0, 5))  # of triangles on which no shadow falls
NOTHING_FOUND = ScanCounts(0, 0, 0, 0, -1)


# Methods that nobody calls are not made: making them is most of what a dataclass costs when it is imported.
AS_PASS = {"kw_only": True, "repr": False, "eq": False}


@dataclass(**AS_PASS)
class Pass:
    """What is drawn by the stages, and what becomes of it."""

    attributes: np.ndarray  # (n_side, n_point, n_attribute) float64: interpolated over the triangles
    size: tuple[int, int]  # (width, height) in pixels
    face_planes: np.ndarray | None = None  # (n_face, 5) float64, see pipeline/shadow_lookup.py; None without light
    factor: int = 1  # samples a pixel along each axis
    hidden_sides: np.ndarray | None = None  # see pipeline/cull.py: find_visible; None where all are drawn
    is_filled: bool = False  # bands without triangles are finished, too
    rows: tuple[int, int] | None = None  # (first, end) of the samples that are drawn; None = all

    sample_time: ClassVar[int] = 4  # nanoseconds of a sample, roughly, beside its triangles
    n_channel: ClassVar[int] = 0  # of the intensities
    dtype: ClassVar[np.dtype] = np.dtype(np.float32)
    is_textured: ClassVar[bool] = False
    opacity: ClassVar[Opacity | None] = None  # None where all is opaque
    keeps_planes: ClassVar[bool] = True  # faces are drawn in their own planes, see pipeline/transform.py

    @property
    def n_sample(self) -> tuple[int, int]:
        """Columns and rows of samples."""
        return self.size[0] * self.factor, self.size[1] * self.factor

    @property
    def drawn_rows(self) -> tuple[int, int]:
        """The first row of samples that is drawn, and the one behind the last."""
        return self.rows or (0, self.n_sample[1])

    @property
    def n_attribute(self) -> int:
        """The largest number that a triangle has."""
        return self.attributes.shape[2]

    def workspace_shape(self, n_row) -> WorkspaceShape:
        """The memory that a band of `n_row` rows is drawn in."""
        return WorkspaceShape(
            self.n_sample[0], n_row, self.n_channel, self.n_attribute, self.dtype,
            self.is_textured, self.opacity is not None,
        )  # fmt: skip

    def max_records(self, n_triangle: int) -> int:
        """How many units the records of so many triangles have at most; where there are none, how many numbers entries
        hold."""
        return n_triangle

    def scan(self, workspace: Workspace, band: Band, drawn: Drawn, deferred: Deferred | None) -> ScanCounts:
        """Draw the band's triangles into the clear visibility buffer; `deferred` takes the transparent ones, None where
        all are opaque."""
        scan_index(band, drawn.drawables, workspace.block, workspace.visibility)
        return NOTHING_FOUND

    def of_clipped(self, clipped: Clipped, corner_idx):
        """Return the pass of the triangles that are left after clipping; `corner_idx` (3, n_face) is where the corners
        of those before have their attributes."""
        planes = self.face_planes
        return replace(
            self,
            attributes=clipped.add_values(self.attributes, corner_idx),
            face_planes=planes[clipped.faces] if planes is not None and len(planes) else planes,
            hidden_sides=None if self.hidden_sides is None else self.hidden_sides[clipped.faces],
        )

    def shade(self, workspace: Workspace, band: Band, counts: ScanCounts) -> None:
        """Fill the radiance of the band's visible samples; buffers and shadow maps need none.

        `counts` is what the scan stage found.
        """

    def finish(self, workspace: Workspace, band: Band, counts: ScanCounts, translucent, drawn: Drawn) -> int:
        """Write the band's rows of the output; return how many samples are covered.

        `translucent` is Translucent: samples that nothing opaque is behind, or None where there are none; `drawn` holds
        the triangles.
        """
        raise NotImplementedError


@dataclass(**AS_PASS)
class ColorPass(Pass):
    """What the passes of a picture share: textures before the light, depth cueing after it, and the end in 8 bits."""

    coding: Coding
    plan: Plan
    screen: Screen
    encoding: Encoding
    picture: Picture  # written
    is_filled: bool = True

    @cached_property
    def units_per_record(self) -> int:
        """At most."""
        return max_units(self.coding)

    def max_records(self, n_triangle):
        """As that of `Pass`."""
        return n_triangle * self.units_per_record

    def scan(self, workspace, band, drawn, deferred):
        """As that of `Pass`, with records."""
        return scan(
            band, drawn.drawables, self.coding, workspace.block, workspace.visibility, workspace.records, deferred
        )

    @property
    def n_channel(self) -> int:
        """Of the intensities."""
        return self.plan.n_channel

    @cached_property
    def dtype(self) -> np.dtype:
        """Of the intensities."""
        return self.plan.dtype

    @property
    def sample_time(self) -> int:
        """As that of `Pass`, with shading."""
        return Pass.sample_time + self.plan.sample_time

    @property
    def is_textured(self) -> bool:
        """Whether any material has a texture."""
        return self.plan.textures is not None

    @property
    def opacity(self) -> Opacity | None:
        """None where all is opaque."""
        return self.plan.opacity

    @cached_property
    def grid(self) -> SampleGrid:
        """The samples of a pixel."""
        return make_grid(self.factor)

    def texturing_in(self, workspace: Workspace) -> Texturing:
        """The textures, with a workspace's memory for looking them up."""
        batches = workspace.lookup_batch, workspace.double_batch
        return Texturing(self.plan.textures, self.plan.metals, *batches, workspace.alphas)

    def n_channel_of(self, counts: ScanCounts) -> int:
        """How many channels a band needs."""
        return self.n_channel if counts.features & HAS_COLORS else self.min_channels

    @cached_property
    def min_channels(self) -> int:
        """How many channels any band needs: what fades with depth has as many everywhere.

        One channel is multiplied by the tint when pixels are finished, three are before: of a grey tint, or where there
        is no mean of samples and nothing behind them, the same bits. Elsewhere all bands have as many channels, because
        what else a band shows must not change them.
        """
        if self.plan.cue is not None:
            return self.n_channel
        is_same = self.factor == 1 and self.dtype == np.float32 and self.opacity is None
        return 1 if is_same or bool((self.plan.tint == 1.0).all()) else self.n_channel

    def shade(self, workspace, band, counts):
        """Find the light that comes from the visible samples, or from the points that pixels are shaded at; then let
        what is further away fade."""
        scanned = ScannedBand(workspace.visibility, workspace.records, self.coding, counts, band.y_start, band.n_row)
        radiance = workspace.radiance[: self.n_channel_of(counts)]
        self.light(workspace, scanned, radiance)
        if self.plan.cue is not None:
            fade(scanned.uncoded(), self.coding.depths, self.screen.is_perspective, self.plan.cue, radiance)

    def light(self, workspace: Workspace, band: ScannedBand, radiance: np.ndarray) -> None:
        """Fill the radiance of the visible samples."""
        raise NotImplementedError

    def finish(self, workspace, band, counts, translucent, drawn):
        """Average the samples of each pixel, and write the picture's rows."""
        y_start, y_end = band.y_start // self.factor, band.y_end // self.factor
        n_channel = self.n_channel_of(counts)
        rows = y_start, y_end
        encoding = self.encoding if n_channel == 1 else self.encoding._replace(is_grey=False)
        return resolve(
            workspace.visibility, workspace.radiance[:n_channel], translucent, rows,
            self.grid, encoding, workspace.pixels, self.picture,
        )  # fmt: skip


@dataclass(**AS_PASS)
class InterpolatedPass(ColorPass):
    """Flat shading and Gouraud's method: intensities of faces or vertices are interpolated."""

    @cached_property
    def is_all_textured(self) -> bool:
        """Whether all materials have a texture: `shade_textured` fills all samples."""
        return bool((self.coding.features & HAS_TEXTURE).all())

    def light(self, workspace, band, radiance):
        """Interpolate the intensities, then those of textured surfaces."""
        if not self.is_all_textured:
            shade_interpolated(band, self.plan.tint, workspace.batch, radiance)
        if band.counts.features & HAS_TEXTURE:
            shade_textured(band, self.texturing_in(workspace), workspace.batch, radiance)


@dataclass(**AS_PASS)
class LitPass(ColorPass):
    """Phong's method: normals are interpolated, and the illumination equation is evaluated at every visible sample."""

    lightings: dict[np.dtype, Lighting]  # for each type that materials are lit in

    def light(self, workspace, band, radiance):
        """Interpolate the normals and light the samples: those of float32 first, see `shade_lit`."""
        texturing = self.texturing_in(workspace) if self.is_textured else None
        tangents = self.n_attribute - 3 if self.plan.has_tangents else None  # the last three attributes
        types = (SINGLE_PRECISION, np.float32, workspace.batch), (DOUBLE_PRECISION, np.float64, workspace.double_batch)
        for feature, dtype, batch in types:
            if band.counts.features & feature:
                lighting = self.lightings[np.dtype(dtype)]
                shade_lit(band, self.screen, lighting, self.face_planes, tangents, texturing, batch, radiance)


@dataclass(**AS_PASS)
class BufferPass(Pass):
    """Exact buffers: one sample a pixel, at its centre."""

    depths: DepthScale
    is_perspective: bool
    buffers: dict[str, np.ndarray]  # by name, see buffers.py; written
    tables: dict[str, tuple]  # by name: what those look up that need a table
    is_filled: bool = True

    def of_clipped(self, clipped, corner_idx):
        """Return the pass of the triangles that are left after clipping, with what its buffers look up for them."""
        tables = {name: tuple(clip_table(table, clipped) for table in tables) for name, tables in self.tables.items()}
        return replace(super().of_clipped(clipped, corner_idx), tables=tables)

    def finish(self, workspace, band, counts, translucent, drawn):
        """Write what is visible into each buffer; the rest of the band's rows is empty."""
        surfaces = VisibleSurfaces(
            workspace.visibility, band.faces, drawn.drawables, drawn.source, self.depths, self.is_perspective,
            workspace.batch,
        )  # fmt: skip
        for name, buffer in self.buffers.items():
            buffer[band.y_start : band.y_end] = BUFFER_TABLE[name].empty
            BUFFER_TABLE[name].write(surfaces, band, buffer, *self.tables.get(name, ()))
        return clear_band(workspace.visibility, band.n_row)


def clip_table(table, clipped: Clipped):
    """Return what a buffer looks up, for the triangles that are left after clipping: only values of corners change."""
    if not isinstance(table, CornerTable):
        return table
    rows = clipped.rows_of(table.rows, len(table.values))
    return CornerTable(clipped.add_values(table.values[None], table.rows)[0], rows)


@dataclass(**AS_PASS)
class ShadowMapPass(Pass):
    """What a light sees: a texel for every sample of a square map, and nothing interpolated."""

    # Faces that share an edge must agree at it: the one behind would else show beside it, and shade the other.
    keeps_planes: ClassVar[bool] = False

    depth: tuple[float, float]  # what a texel's depth is found from: offset and scale
    texels: np.ndarray  # (n, n) float32 or float64, written

    def finish(self, workspace, band, counts, translucent, drawn):
        """Write the texels' depths."""
        write_map(workspace.visibility, band.y_start, band.n_row, *self.depth, self.texels)
        return 0


def shadow_map_pass(depths: DepthScale, texels, hidden_sides=None) -> ShadowMapPass:
    """Return the pass that draws a shadow map; `texels` is (n, n) float32 or float64, written; `hidden_sides` are those
    of `Pass`."""
    depth = (depths.inv_w_offset, depths.inv_w_scale)
    if not depths.is_perspective:
        depth = (-depths.depth_offset, -depths.depth_scale)
    return ShadowMapPass(
        attributes=NONE,
        size=texels.shape[::-1],
        hidden_sides=hidden_sides,
        depth=depth,
        texels=texels,
        is_filled=True,
    )
