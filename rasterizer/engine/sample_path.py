"""How the attributes of one sample reached it in the picture: what `rz.explain` shows beside the reference's values.

The row of the pixel is drawn as in every picture. The triangle that the sample shows is then found by drawing half of
the band's triangles, and half of that half, until one is left: its setup says by which path it went.
"""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from ..options import Options
from ..pipeline import setup as s
from ..pipeline.cull import Band
from ..pipeline.scan import make_deferred, scan
from ..pipeline.triangle_setups import make_triangle_setups
from ..pipeline.visibility import CLEAR, PAYLOAD_BITS, make_extents, make_visibility_buffer
from ..pipeline.workspace import make_picture
from ..scene.camera import Camera
from .depth_range import screen_of
from .draw import NO_CLOCK, draw
from .passes import AS_PASS, ColorPass
from .prepared import PreparedScene
from .scene_tables import SceneTables


class DrawnSample(NamedTuple):
    """What the picture shows at a pixel, and how one of its samples was drawn."""

    color: np.ndarray  # (3,) float32, linear, as in `Frame.color`
    rgba: np.ndarray  # (4,) uint8; not scaled where the colour range is "global"
    path: str | None  # of the nearest opaque surface; None where there is none
    bound: float | None  # of the picture's error, as `Stats.error_bound`
    faces: np.ndarray  # (factor, factor) int32, of the nearest surface at each sample of the pixel; -1 where nothing is
    normals: np.ndarray  # (factor, factor, 3) float32, of it
    positions: np.ndarray  # (factor, factor, 3) float32, world space


def draw_sample(scene, options: Options, camera: Camera, x: int, y: int) -> DrawnSample:
    """Draw the pixel (x, y) as the picture has it, and find out how the sample nearest to its centre was drawn."""
    prepared = PreparedScene(SceneTables(scene, options), options)
    try:
        view, picture = camera.view(), make_picture(options.size, with_color=True)
        screen, is_cut = screen_of(camera, view, prepared.n_sample, prepared.geometry, prepared.tables.bounds)
        seen = prepared.slice_view(view, screen)
        drawing, bound, _ = prepared.see(view, screen, seen)
        render_pass = prepared.color_pass(view, screen, seen, drawing, picture, NO_CLOCK)
        given = {each.name: getattr(render_pass, each.name) for each in fields(ColorPass) if each.init}
        sample = tuple(place * options.factor + (options.factor - 1) // 2 for place in (x, y))
        given["rows"] = y * options.factor, (y + 1) * options.factor
        probe = _Probe(**given, sample=sample, found=[])
        draw(prepared.geometry, probe, screen, prepared.workspaces, prepared.threads, NO_CLOCK)
        buffers, _, _ = prepared.draw_buffers(
            camera, NO_CLOCK, ("face", "normal", "position"), given["rows"], options.factor, min_opacity=0.0
        )
    finally:
        prepared.threads.close()
    pixel = slice(*given["rows"]), slice(x * options.factor, (x + 1) * options.factor)
    shown = (buffers[name][pixel] for name in ("face", "normal", "position"))
    rgba = picture.rgba[y, x : x + 1].view(np.uint8)
    path = probe.found[0] if probe.found else None
    return DrawnSample(picture.color[y, x], rgba, path, None if is_cut else bound, *shown)


@dataclass(**AS_PASS)
class _Probe(ColorPass):
    """A picture of which one sample is looked at between scan and shade."""

    sample: tuple[int, int]
    found: list[str]

    def scan(self, workspace, band, drawn, deferred):
        """Scan as for the picture; say how the sample was drawn."""
        counts, (x, y) = super().scan(workspace, band, drawn, deferred), self.sample
        packed = workspace.visibility.packed[(y - band.y_start) * workspace.visibility.pitch + x]
        if packed < CLEAR:
            self.found.append(self._path_of(drawn.drawables, band.faces, workspace.block))
        return counts

    def _path_of(self, drawables, faces, block) -> str:
        """Describe the path of the triangle, of some, that the sample shows."""
        target, found = self._depth_at_sample(drawables, faces, block), faces
        while len(found) > 1:  # of equally deep ones the earlier is seen
            half = found[: len(found) // 2]
            found = half if self._depth_at_sample(drawables, half, block) == target else found[len(half) :]
        self._depth_at_sample(drawables, found, block)
        return describe_path(block, self.sample[0], self.plan.is_lit_per_sample)

    def _depth_at_sample(self, drawables, faces, block) -> int:
        """Scan some triangles alone; return how deep the nearest is at the sample."""
        (x, y), coding = self.sample, self.coding
        visibility = make_visibility_buffer(self.n_sample[0], 1)
        setups = make_triangle_setups(max(1, len(faces) * self.units_per_setup), self.attributes.shape[2])
        deferred = make_deferred(len(faces), make_extents(1)) if self.opacity is not None else None
        scan(Band(faces, y, y + 1), drawables, coding, block, visibility, setups, deferred)
        return int(visibility.packed[x] >> PAYLOAD_BITS)


def describe_path(block, column: int, of_normals: bool) -> str:
    """Say how the attributes of the first triangle of a block reach the sample in a column."""
    ints, what = block.ints, "normals" if of_normals else "intensities"
    piece = int(ints[s.PIECE])
    if ints[s.HAS_INTENSITY] and piece > 1:
        first = column // piece * piece
        return (
            f"incremental: I += ΔI·Δv between columns {first} and {first + piece} of the samples, where the "
            "intensity is that of perspective"
        )
    if ints[s.HAS_INTENSITY]:
        return "perspective, by a division a sample" if piece == 1 else "incremental: I += ΔI·Δv over the triangle"
    if ints[s.HAS_PLANES]:
        return f"planes of the {what}" + (" over w" if of_normals or ints[s.IS_WEIGHTED] else "")
    return f"exact: the {what} of the corners, weighted by edge functions at the sample"
