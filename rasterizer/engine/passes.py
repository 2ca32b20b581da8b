"""The passes: what the stages draw, how visible samples are shaded, and what becomes of a finished band.

    ColorPass       a picture: intensities are interpolated, or by Phong's method normals, and every sample is lit
    BufferPass      exact buffers: depth, face, normal
    ShadowMapPass   what a light sees: depth alone

A pass holds plain arrays and small numbers for one view. `draw` (draw.py) asks it band after band: first `scan`, then
`shade`, then `finish`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

import numpy as np

from ..pipeline.a_buffer import Opacity
from ..pipeline.buffers import CornerTable, VisibleSurfaces, clear_band
from ..pipeline.clip import Clipped
from ..pipeline.cull import Band
from ..pipeline.cut_outs import CutOuts
from ..pipeline.gradients import DOUBLE_PRECISION, HAS_COLORS, HAS_TEXTURE, SINGLE_PRECISION, Coding
from ..pipeline.interpolate import ScannedBand
from ..pipeline.lighting import Lighting
from ..pipeline.phong_shading import shade_lit
from ..pipeline.resolve import Encoding, Picture, make_grid, resolve
from ..pipeline.scan import Deferred, ScanCounts, scan, scan_index
from ..pipeline.setup import DepthScale
from ..pipeline.shade import fade, shade_interpolated
from ..pipeline.shadow_lookup import write_map
from ..pipeline.texturing import Texturing, shade_textured
from ..pipeline.transform import Drawables, Screen
from ..pipeline.triangle_setups import max_units
from ..pipeline.workspace import Workspace
from .buffers import BUFFER_TABLE
from .plan import Plan

NONE = np.empty((1, 0, 0))  # no attributes
NO_PLANES = np.empty((0, 5))  # of triangles on which no shadow falls
NOTHING_FOUND = ScanCounts(0, 0, 0, 0, -1)


# Methods that nobody calls are not made: making them is most of what a dataclass costs when it is imported.
AS_PASS = {"kw_only": True, "repr": False, "eq": False}


class Drawn(NamedTuple):
    """The triangles that the stages after clip work on."""

    drawables: Drawables
    source: np.ndarray  # (n_triangle,) uint32: the triangle of the scene that each is a part of, or empty


@dataclass(**AS_PASS)
class Pass:
    """What is drawn by the stages, and what becomes of it."""

    attributes: np.ndarray  # (n_side, n_point, n_attribute) float64: interpolated over the triangles
    n_sample: tuple[int, int]  # columns and rows of samples
    factor: int = 1  # samples a pixel along each axis
    face_planes: np.ndarray | None = None  # (n_face, 5) float64, see pipeline/shadow_lookup.py; None without light
    hidden_sides: np.ndarray | None = None  # see pipeline/cull.py: find_visible; None where all are drawn
    rows: tuple[int, int] | None = None  # (first, end) of the samples that are drawn; None = all

    cut_outs: CutOuts | None = None  # see pipeline/cut_outs.py; None where all samples of the triangles are there

    # What gives the attributes of the triangles (n,) that are seen, where they aren't known before.
    light: Callable[[np.ndarray], np.ndarray] | None = None

    # What a picture has more of, see `ColorPass`.
    n_channel: int = field(default=0, init=False)  # of the intensities
    dtype: np.dtype = field(default=np.dtype(np.float32), init=False)  # of the intensities
    is_textured: bool = field(default=False, init=False)
    opacity: Opacity | None = field(default=None, init=False)  # None where all is opaque
    units_per_setup: int = field(default=1, init=False)  # at most; without setups, numbers that a packed sample holds
    sample_time: int = field(default=4, init=False)  # nanoseconds of a sample, roughly, beside its triangles

    keeps_planes: ClassVar[bool] = True  # faces are drawn in their own planes, see pipeline/transform.py

    def scan(self, workspace: Workspace, band: Band, drawn: Drawn, deferred: Deferred | None) -> ScanCounts:
        """Draw the band's triangles into the clear visibility buffer; `deferred` takes the transparent ones, None where
        all are opaque."""
        scan_index(band, drawn.drawables, workspace.block, workspace.visibility)
        return NOTHING_FOUND

    def of_clipped(self, clipped: Clipped, corner_idx):
        """Return the pass of the triangles that are left after clipping; `corner_idx` (3, n_face) is where the corners
        of those before have their attributes."""
        planes, light, cut_outs = self.face_planes, self.light, self.cut_outs
        if cut_outs is not None and len(cut_outs.uv):
            cut_outs = cut_outs._replace(uv=clipped.add_values(cut_outs.uv[None], corner_idx)[0])
        return replace(
            self,
            cut_outs=cut_outs,
            light=light and (lambda faces: clipped.add_values(light(clipped.faces[faces]), corner_idx)),
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
    """A picture: textures before the light, depth cueing after it, and the end in 8 bits."""

    lightings: dict[np.dtype, Lighting]  # for each type that materials are lit in
    coding: Coding
    plan: Plan
    screen: Screen
    encoding: Encoding
    picture: Picture  # written
    grid: tuple[int, ...] | None = field(init=False)  # the samples of a pixel, see `make_grid`
    min_channels: int = field(init=False)  # that any band needs
    has_plain: bool = field(init=False)  # some material has no texture

    def __post_init__(self) -> None:
        """Find out what is the same for all bands.

        One channel is multiplied by the tint when pixels are finished, three are before: of a grey tint, or where there
        is no mean of samples and nothing behind them, the same bits. Elsewhere all bands have as many channels, because
        what else a band shows must not change them. What fades with depth has as many everywhere.
        """
        plan = self.plan
        self.n_channel, self.dtype, self.opacity = plan.n_channel, plan.dtype, plan.opacity
        self.is_textured, self.units_per_setup = plan.textures is not None, max_units(self.coding)
        self.has_plain = not (self.coding.features & HAS_TEXTURE).all()
        self.grid = make_grid(self.factor)
        is_same = self.factor == 1 and self.dtype == np.float32 and self.opacity is None
        is_same |= bool((plan.tint == 1.0).all())
        self.min_channels = 1 if is_same and plan.cue is None else self.n_channel
        # Nanoseconds that it takes to shade a sample, roughly, where a quarter of all samples show something.
        of_light = (2 + 4 * plan.tables.has_shadows) * plan.is_lit_per_sample * len(plan.tables.lights)
        self.sample_time = 4 + of_light + 12 * self.is_textured + 8 * (self.opacity is not None)

    def scan(self, workspace, band, drawn, deferred):
        """As that of `Pass`, with setups."""
        return scan(
            band, drawn.drawables, self.coding, workspace.block, workspace.visibility, workspace.setups, deferred
        )

    def n_channel_of(self, counts: ScanCounts) -> int:
        """How many channels a band needs."""
        return self.n_channel if counts.features & HAS_COLORS else self.min_channels

    def shade(self, workspace, band, counts):
        """Find the light that comes from the visible samples, then let what is further away fade.

        Flat shading and Gouraud's method interpolate the intensities of faces or vertices, Phong's method the normals:
        the illumination equation is evaluated at every sample, those of float32 first, see `shade_lit`.
        """
        plan, batches = self.plan, (workspace.batch, workspace.double_batch)
        scanned = ScannedBand(workspace.visibility, workspace.setups, self.coding, counts, band.y_start, band.n_row)
        radiance, texturing = workspace.radiance[: self.n_channel_of(counts)], None
        if self.is_textured:
            texturing = Texturing(plan.textures, plan.metals, workspace.lookup_batch, batches[1], workspace.alphas)
        if plan.is_lit_per_sample:
            tangents = self.attributes.shape[2] - 3 if plan.has_tangents else None  # the last three attributes
            for feature, batch in zip((SINGLE_PRECISION, DOUBLE_PRECISION), batches, strict=True):
                if counts.features & feature:
                    lighting = self.lightings[batch.dtype]
                    shade_lit(scanned, self.screen, lighting, self.face_planes, tangents, texturing, batch, radiance)
        else:
            if self.has_plain:  # else `shade_textured` fills all samples
                shade_interpolated(scanned, plan.tint, workspace.batch, radiance)
            if counts.features & HAS_TEXTURE:
                shade_textured(scanned, texturing, workspace.batch, radiance)
        if plan.cue is not None:
            fade(scanned.uncoded(), self.coding.depths, self.screen.is_perspective, plan.cue, radiance)

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
class BufferPass(Pass):
    """Exact buffers: one sample a pixel, at its centre."""

    depths: DepthScale
    buffers: dict[str, np.ndarray]  # by name, see buffers.py; written
    tables: dict[str, tuple]  # by name: what those look up that need a table

    def of_clipped(self, clipped, corner_idx):
        """Return the pass of the triangles that are left after clipping, with what its buffers look up for them: only
        values of corners change."""
        tables = dict(self.tables)
        for name, (table,) in self.tables.items():
            if isinstance(table, CornerTable):
                values, rows = clipped.add_values(table.values[None], table.rows)[0], len(table.values)
                tables[name] = (CornerTable(values, clipped.rows_of(table.rows, rows)),)
        return replace(super().of_clipped(clipped, corner_idx), tables=tables)

    def finish(self, workspace, band, counts, translucent, drawn):
        """Write what is visible into each buffer; the rest of the band's rows is empty."""
        surfaces = VisibleSurfaces(
            workspace.visibility, band.faces, drawn.drawables, drawn.source, self.depths, self.depths.is_perspective,
            workspace.batch,
        )  # fmt: skip
        for name, buffer in self.buffers.items():
            buffer[band.y_start : band.y_end] = BUFFER_TABLE[name].empty
            BUFFER_TABLE[name].write(surfaces, band, buffer, *self.tables.get(name, ()))
        return clear_band(workspace.visibility, band.n_row)


@dataclass(**AS_PASS)
class ShadowMapPass(Pass):
    """What a light sees: a texel for every sample of a square map, and nothing interpolated."""

    # Faces that share an edge must agree at it: the one behind would else show beside it, and shade the other.
    keeps_planes: ClassVar[bool] = False

    depths: DepthScale
    texels: np.ndarray  # (n, n) float32 or float64, written

    def finish(self, workspace, band, counts, translucent, drawn):
        """Write the texels' depths, 1/w or negative depths."""
        depths = self.depths
        line = (depths.inv_w_offset, depths.inv_w_scale)
        if not depths.is_perspective:
            line = (-depths.depth_offset, -depths.depth_scale)
        write_map(workspace.visibility, band.y_start, band.n_row, *line, self.texels)
        return 0
