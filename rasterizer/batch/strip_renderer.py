"""A Renderer that draws some rows of a picture, for pictures that several processes draw."""

from typing import Any

from ..compiler.kernels import compiling_ahead
from ..engine.clock import Clock
from ..engine.strips import compute_brightest, draw_buffer_strip, draw_strip
from ..errors import SceneError, shown
from ..frame import Frame
from ..renderer import Renderer
from ..scene.camera import Camera
from ..scene.validate import is_whole


class StripRenderer(Renderer):
    """Render strips of many pictures of one scene. Parameters are those of `render`."""

    def render_strip(self, rows: tuple[int, int], camera: Camera | None = None, *, brightest: float = 0.0) -> Frame:
        """Render some rows of the picture: the same bytes as the whole one has there.

        Parameters
        ----------
        rows : (first, end), counted from the top; `end` is the one behind the last
        camera : Camera; None = the scene's own
        brightest : largest component of the whole picture's linear colours, for `color_range="global"`:
            `measure_strip` of all strips tells it

        Returns
        -------
        Frame of as many rows; its stats count the samples of the strip, and the triangles of the picture
        """
        camera, clock, (first, end) = self._checked_camera(camera), Clock(), self._checked_rows(rows)
        outputs, view_plan = self.options.outputs, None
        counts: Any = None
        screen: Any = None
        arrays: dict = {}
        rgba, buffers = None, None
        with self._prepared.threads.turn, compiling_ahead(lambda: self._list_needs(camera)):
            self._check_open()
            self._check_edges()
            if "color" in outputs or "rgb" in outputs:
                drawn = draw_strip(self._prepared, camera, clock, (first, end), brightest)
                rgba, counts, view_plan = drawn.rgba, drawn.counts, drawn.view_plan
                buffers, screen = drawn.buffers, drawn.screen
                self._plan = view_plan.summary._replace(ways=counts.ways)
                if "color" in outputs:
                    arrays.update(color=drawn.color, alpha=drawn.alpha)
            if buffers is None and self._prepared.buffer_names:
                buffers, of_buffers, screen = draw_buffer_strip(self._prepared, camera, clock, (first, end))
                counts = counts or of_buffers
            arrays.update(buffers or {})
            n_sample = self.options.size[0] * (end - first) * (1 if view_plan is None else self.options.samples)
            bounds = self._prepared.bound_outputs(camera, outputs, view_plan, screen)
            stats = self._stats(counts._replace(samples=n_sample), view_plan, clock, bounds)
            return Frame(rgba, arrays, stats, (self.options.size[0], end - first))

    def measure_strip(self, rows: tuple[int, int], camera: Camera | None = None) -> float:
        """Return the largest component of the linear colours of some rows (first, end) of the picture."""
        camera, rows = self._checked_camera(camera), self._checked_rows(rows)
        with self._prepared.threads.turn, compiling_ahead(lambda: self._list_needs(camera)):
            self._check_open()
            return compute_brightest(self._prepared, camera, Clock(), rows)

    def _check_edges(self) -> None:
        """Refuse edges: they are drawn over the whole picture."""
        if self.options.edges:
            raise SceneError(f"a picture that is drawn in strips has no edges; given edges={self.options.edges}")

    def _checked_rows(self, rows: Any) -> tuple[int, int]:
        """Return the rows of a strip as two ints."""
        height = self.options.size[1]
        try:
            first, end = rows
        except (TypeError, ValueError):
            first = end = -1
        if not (is_whole(first, 0, height - 1) and is_whole(end, first + 1, height)):
            raise SceneError(f"rows must be (first, end) within 0..{height}, at least one; given {shown(rows)}")
        return int(first), int(end)
