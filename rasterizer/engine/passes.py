"""The passes: what the stages draw, how visible samples are shaded, and what becomes of a finished band.

    InterpolatedPass   flat shading and Gouraud's method: intensities of faces or vertices are interpolated
    LitPass            Phong's method: normals are interpolated, and every visible sample is lit
    BufferPass         exact buffers: depth, face, normal
    ShadowMapPass      what a light sees: depth alone

A pass holds plain arrays and small numbers for one view. `draw` (draw.py) asks it band after band: first `shade`, then
`finish`.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..pipeline.a_buffer import Opacity
from ..pipeline.bands import Band
from ..pipeline.buffers import VisibleSurfaces, clear_band
from ..pipeline.depth_cueing import fade
from ..pipeline.encode import Encoding
from ..pipeline.gradients import EXACT, Coding
from ..pipeline.interpolate import ScannedBand
from ..pipeline.lighting import Lighting
from ..pipeline.resolve import Picture, resolve
from ..pipeline.shade import FaceTable, shade_interpolated, shade_lit
from ..pipeline.shadow_lookup import write_map
from ..pipeline.texture_sampling import Textures, sample_textures, shade_textured
from ..pipeline.transform import Screen
from ..pipeline.workspace import Workspace, WorkspaceKind
from .output_buffers import BUFFER_TABLE
from .plan import Plan

NO_TABLE = FaceTable(np.empty(0, np.uint32), np.empty((0, 5)))


# Methods that nobody calls are not made: making them is most of what a dataclass costs when it is imported.
AS_PASS = {"kw_only": True, "repr": False, "eq": False}


@dataclass(**AS_PASS)
class Pass:
    """One way through the stages."""

    attributes: np.ndarray  # (n_side, n_point, n_attribute), interpolated over the triangles
    coding: Coding
    size: tuple[int, int]  # (width, height) in pixels
    face_table: FaceTable = NO_TABLE
    factor: int = 1  # samples a pixel along each axis
    is_culled: bool = False
    is_filled: bool = False  # bands without triangles are finished, too

    n_channel: ClassVar[int] = 0  # of the intensities
    textures: ClassVar[Textures | None] = None
    opacity: ClassVar[Opacity | None] = None  # None where all is opaque

    @property
    def n_sample(self) -> tuple[int, int]:
        """Columns and rows of samples."""
        return self.size[0] * self.factor, self.size[1] * self.factor

    def workspace_kind(self, n_row) -> WorkspaceKind:
        """The memory that a band of `n_row` rows is drawn in."""
        n_attribute = self.attributes.shape[2]
        n_group = -(-n_attribute // 3) if self.coding.kind != EXACT else 0  # the normals, or the channels; the albedo
        return WorkspaceKind(
            self.n_sample[0], n_row, self.n_channel, n_attribute, n_group, self.attributes.dtype,
            self.textures is not None, self.opacity is not None,
        )  # fmt: skip

    def shade(self, workspace: Workspace, band: Band, n_exact: int, face_table: FaceTable) -> None:
        """Fill the radiance of the band's visible samples; buffers and shadow maps need none.

        `n_exact` is the number of exact records, `face_table` that of the triangles that are drawn, clipped parts
        included.
        """

    def finish(self, workspace: Workspace, band: Band, loaded_face: np.ndarray) -> int:
        """Write the band's rows of the output; return how many samples are covered.

        `loaded_face` is the face as loaded of each triangle, or empty where each is one.
        """
        raise NotImplementedError


@dataclass(**AS_PASS)
class ColorPass(Pass):
    """What the passes of a picture share: textures before the light, depth cueing after it, and the end in 8 bits."""

    plan: Plan
    screen: Screen
    encoding: Encoding
    picture: Picture
    is_filled: bool = True

    @property
    def n_channel(self) -> int:
        """Of the intensities."""
        return self.plan.n_channel

    @property
    def textures(self) -> Textures | None:
        """None where the scene has none."""
        return self.plan.textures

    @property
    def opacity(self) -> Opacity | None:
        """None where all is opaque."""
        return self.plan.opacity

    def shade(self, workspace, band, n_exact, face_table):
        """Find the light that comes from the visible samples, then let what is further away fade."""
        scanned = ScannedBand(
            workspace.visibility, workspace.records, self.coding.kind, n_exact, band.y_start, band.n_row
        )
        if self.textures is not None:
            sample_textures(scanned, self.textures, face_table.materials, workspace.batch, workspace.texels)
        self.light(workspace, scanned, face_table)
        if self.plan.cue is not None:
            fade(scanned, self.screen.is_perspective, self.plan.cue, workspace.radiance)

    def light(self, workspace: Workspace, band: ScannedBand, face_table: FaceTable) -> None:
        """Fill the radiance of the visible samples."""
        raise NotImplementedError

    def finish(self, workspace, band, loaded_face):
        """Average the samples of each pixel, and write the picture's rows."""
        a_buffer = workspace.a_buffer if self.opacity is not None else None
        return resolve(
            workspace.visibility, workspace.radiance, a_buffer, band.y_start // self.factor, band.y_end // self.factor,
            self.factor, self.encoding, workspace.pixels, self.picture,
        )  # fmt: skip


@dataclass(**AS_PASS)
class InterpolatedPass(ColorPass):
    """Flat shading and Gouraud's method: intensities of faces or vertices are interpolated."""

    def light(self, workspace, band, face_table):
        """Interpolate the intensities, with textures those of the parts that these weaken and don't weaken."""
        if self.textures is None:
            shade_interpolated(band, self.n_channel, 1.0 / self.plan.level_scale, workspace.radiance)
        else:
            shade_textured(band, workspace.texels, workspace.radiance)


@dataclass(**AS_PASS)
class LitPass(ColorPass):
    """Phong's method: normals are interpolated, and the illumination equation is evaluated at every visible sample."""

    lighting: Lighting

    def light(self, workspace, band, face_table):
        """Interpolate the normals and light the samples."""
        texels = workspace.texels if self.textures is not None else None
        tangents = self.attributes.shape[2] - 3 if self.plan.has_tangents else None  # the last three attributes
        shade_lit(band, self.screen, self.lighting, face_table, tangents, texels, workspace.batch, workspace.radiance)


@dataclass(**AS_PASS)
class BufferPass(Pass):
    """Exact buffers: one sample a pixel, at its centre, and an exact record for every triangle."""

    screen: Screen
    buffers: dict[str, np.ndarray]  # by name, see output_buffers.py; written

    def finish(self, workspace, band, loaded_face):
        """Write what is visible into each buffer."""
        surfaces = VisibleSurfaces(workspace.visibility, workspace.records, loaded_face, self.screen)
        for name, buffer in self.buffers.items():
            BUFFER_TABLE[name].write(surfaces, band, buffer)
        return clear_band(workspace.visibility, band.n_row)


@dataclass(**AS_PASS)
class ShadowMapPass(Pass):
    """What a light sees: a texel for every sample of a square map, and nothing interpolated."""

    depth: tuple[float, float]  # what a texel's depth is found from: offset and scale
    texels: np.ndarray  # (n, n) float32 or float64, written

    def finish(self, workspace, band, loaded_face):
        """Write the texels' depths."""
        write_map(workspace.visibility, band.y_start, band.n_row, *self.depth, self.texels)
        return 0


def shadow_map_pass(nothing, coding, screen, texels) -> ShadowMapPass:
    """Return the pass that draws a shadow map.

    Parameters
    ----------
    nothing : (1, n_point, 0) float64: no attributes
    texels : (n, n) float32 or float64, written
    """
    depth = (coding.inv_w_offset, coding.inv_w_scale)
    if not screen.is_perspective:
        depth = (-coding.depth_offset, -coding.depth_scale)
    return ShadowMapPass(
        attributes=nothing, coding=coding, size=texels.shape[::-1], depth=depth, texels=texels, is_filled=True
    )
