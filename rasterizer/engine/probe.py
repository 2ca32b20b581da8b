"""Which way a pixel took through the stages: its band is drawn once more, and its visibility entries are looked at."""

from dataclasses import dataclass

from ..pipeline.buffers import clear_band
from ..pipeline.visibility import CLEAR, IS_EXACT, IS_ID
from ..pipeline.workspace import make_picture
from ..scene.camera import Camera
from .depth_range import screen_of
from .draw import NO_CLOCK, draw
from .passes import AS_PASS, Pass
from .prepared import PreparedScene

ENTRY, PLANES, EXACT = "packed entry", "plane record", "exact record"


@dataclass(**AS_PASS)
class ProbePass(Pass):
    """Look at the entries of one pixel; nothing is shaded or written."""

    pixel: tuple[int, int]  # column and row
    ways: set[str]  # filled

    def finish(self, workspace, band, counts, translucent, drawn):
        """Note the ways of the pixel's samples in this band."""
        visibility, (x, y), factor = workspace.visibility, self.pixel, self.factor
        for row in range(max(y * factor, band.y_start), min((y + 1) * factor, band.y_end)):
            start = (row - band.y_start) * visibility.pitch + x * factor
            self.ways.update(filter(None, map(way_of, visibility.entries[start : start + factor].tolist())))
        return clear_band(visibility, band.n_row)


def way_of(entry: int) -> str | None:
    """Return the way that a visibility entry tells of; None where nothing is visible."""
    if entry >= CLEAR:
        return None
    if not entry & int(IS_ID):
        return ENTRY
    return EXACT if entry & int(IS_EXACT) else PLANES


def ways_at(prepared: PreparedScene, camera: Camera, pixel: tuple[int, int]) -> list[str]:
    """Return the ways that the samples of a pixel took from the vertices, sorted; none where nothing is visible.

    `pixel` is (column, row), within the picture.
    """
    options, view, ways = prepared.options, camera.view(), set()
    screen = screen_of(camera, view, options.size, options.factor, prepared.geometry, prepared.bounds)
    plan = prepared.view_plans.plan_for(view, screen).plan
    of_picture = prepared.color_pass(view, screen, plan, make_picture(options.size, False), NO_CLOCK)
    # Transparent surfaces are looked at as if they were opaque.
    probe = ProbePass(
        attributes=of_picture.attributes,
        coding=of_picture.coding,
        size=options.size,
        factor=options.factor,
        is_culled=of_picture.is_culled,
        pixel=pixel,
        ways=ways,
    )
    draw(prepared.geometry, probe, screen, prepared.workspaces, prepared.threads, NO_CLOCK)
    return sorted(ways)
