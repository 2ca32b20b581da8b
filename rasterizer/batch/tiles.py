"""`render_tiles`: one picture, which many processes draw.

A tile is some rows of the picture, from its left to its right edge (engine/strips.py): its bytes are those that the
whole picture has there. Every process prepares the whole scene, once; so this pays for pictures that take longer to
draw than their scene to prepare. Tiles come back in any order and go to their rows of the file, or of the picture in
memory where the format has no fixed rows.
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..engine.memory import check_memory, count_pixel_bytes
from ..errors import RasterizerError, SceneError, shown
from ..frame import Frame, Stats
from ..io.files import write_whole
from ..io.row_files import RowFile, row_format_of
from ..options import Options
from ..scene.camera import Camera
from ..scene.validate import whole
from .crew import Crew, Died, Done, Failed, SharedObject, Unit, work_through
from .draw_run import Picture, Run, camera_of, encode, is_seen, load_model_of, make_error, suffix_of
from .executors import identify
from .rendering import make_crew, make_folder_of, source_of
from .strip_renderer import StripRenderer
from .tasks import RenderTask

NO_STATS = Stats(0, 0, 0, 0, 0, 0, 0, 0.0)  # of what was measured alone
_TILES_A_SLOT = 4  # so that nobody waits long for the last one
_MOST_BYTES = 2**25  # of a tile, if a row isn't larger


class Tile(NamedTuple):
    """Some rows of a picture."""

    run: Run  # of that picture alone
    rows: tuple[int, int]  # (first, end)
    brightest: float | None  # largest component of the whole picture; None = that of the tile is asked for


class DrawnTile(NamedTuple):
    """What comes back."""

    first: int
    arrays: dict[str, NDArray]
    stats: Stats
    brightest: float


def render_tiles(
    task: RenderTask, executor: Any = None, *, n_process: int | None = None, n_tile: int | None = None
) -> Stats:
    """Draw one large picture in several processes, and write it: the same file as one process writes.

    TIFF files, and .npy files of "color", "rgb", "rgba" or "alpha", are written while the picture is drawn: it may be
    larger than the memory. Others are put together in memory. With `color_range="global"` the picture is drawn twice.

    Parameters
    ----------
    task : RenderTask, what is drawn, and where it goes
    executor : who draws, as for `render_many`
    n_process : how many processes, as for `render_many`
    n_tile : into how many tiles of rows the picture is cut; None = some for each process

    Returns
    -------
    Stats of the whole picture; its times are the sums of those of the processes

    Raises
    ------
    SceneError : an argument that is not legal, also of the task; a picture that the memory can't hold
    ModelError : the model can't be read
    OutputError : the file can't be written
    RasterizerError : a process died, twice at the same tile
    """
    if not isinstance(task, RenderTask):
        raise SceneError(f"task must be a RenderTask; given {shown(task)}")
    options = task.check()
    if n_tile is not None:
        n_tile = whole(n_tile, "n_tile", 1, options.size[1])
    output, suffix = os.fspath(task.output), suffix_of(task.output)
    array = (task.array or options.outputs[0]) if suffix == ".npy" else None
    with TiledRenderer(task, options, make_crew(executor, n_process), n_tile) as renderer:
        make_folder_of(output)
        kind = row_format_of(suffix.lstrip("."), array)
        if kind is None:
            frame = renderer.render()
            write_whole(output, encode(frame, renderer.picture))
            return frame.stats
        with RowFile(output, kind, options.size) as file:
            stats = renderer.render_rows(file)
            file.move()
        return stats


class TiledRenderer:
    """Draw pictures of one scene tile by tile, as a Renderer draws them alone: its `render` and `render_rows`.

    Parameters
    ----------
    task : RenderTask, what is drawn
    options : its options, complete
    crew : who draws; it is closed at the end
    n_tile : of a picture; None = some for each process
    """

    def __init__(self, task: RenderTask, options: Options, crew: Crew, n_tile: int | None = None) -> None:
        self.options, self._crew, self.n_drawn = options, crew, 0
        path, identity = source_of(task), None
        if path is not None and not crew.is_here:
            path = os.path.abspath(path)
            identity = identify(path)
        self.picture = Picture(0, suffix_of(task.output), task.view, task.camera, options, task.array)
        self._run = Run(task.name, path, identity, dict(task.load), (self.picture,))
        self._shared = None if path is not None else self._share(task.source)
        self._rows = list(self._cut(n_tile))

    def __enter__(self) -> "TiledRenderer":
        return self

    def __exit__(self, *_: object) -> None:
        self._crew.close()

    def _share(self, source: Any) -> SharedObject:
        """Load the model here, so that it is sent; nobody else loads it then."""
        loaded = load_model_of(self._run, source, {}).scene
        self._run = self._run._replace(path=None, identity=None, load={})
        return SharedObject(loaded, "model")

    def _cut(self, n_tile: int | None) -> Iterator[tuple[int, int]]:
        """Yield the rows of each tile."""
        width, height = self.options.size
        if n_tile is None:
            n_byte = height * width * count_pixel_bytes(self.options, has_out=False)
            n_tile = max(_TILES_A_SLOT * self._crew.n_slot, -(-n_byte // _MOST_BYTES))
        n_tile = min(n_tile, height)
        for k in range(n_tile):
            yield height * k // n_tile, height * (k + 1) // n_tile

    def render(self, camera: Camera | None = None) -> Frame:
        """Render the scene, through another camera if one is given; SceneError where the memory can't hold it."""
        check_memory(self.options, has_out=False)
        width, height = self.options.size
        arrays: dict[str, NDArray] = {}

        def put(tile: DrawnTile) -> None:
            for name, part in tile.arrays.items():
                if name not in arrays:
                    arrays[name] = np.empty((height, *part.shape[1:]), part.dtype)
                arrays[name][tile.first : tile.first + len(part)] = part

        stats = self._draw_all(put, camera)
        return Frame(arrays.pop("rgba", None), arrays, stats, (width, height))

    def render_rows(self, file: RowFile, camera: Camera | None = None) -> Stats:
        """Render into a file, tile by tile, and leave it to the caller to move it to its place."""
        file.begin()
        stats = self._draw_all(lambda tile: file.write_rows(tile.first, rows_of(tile.arrays)), camera)
        file.end()
        return stats

    def _draw_all(self, put: Callable[[DrawnTile], None], camera: Camera | None) -> Stats:
        """Draw all tiles, and hand each to `put`; return what was done."""
        if camera is not None:
            self.picture = self.picture._replace(camera=camera, view=None)
            self._run = self._run._replace(pictures=(self.picture,))
        brightest = 0.0
        if self.options.color_range == "global" and {"color", "rgb"} & set(self.options.outputs):
            brightest = max(tile.brightest for tile in self._tiles(None))
        stats: Stats | None = None
        for tile in self._tiles(brightest):
            put(tile)
            stats = add_stats(stats, tile.stats)
        self.n_drawn += 1
        return stats or NO_STATS

    def _tiles(self, brightest: float | None) -> Iterator[DrawnTile]:
        """Yield the tiles as they are drawn, in any order."""
        units = (self._unit(rows, brightest) for rows in self._rows)
        for unit, outcome in work_through(self._crew, units, self._follow_up):
            if isinstance(outcome, Done):
                if isinstance(outcome.value, Exception):
                    raise outcome.value
                yield outcome.value
            elif isinstance(outcome, Died):
                first, end = unit.argument.rows
                rows = f"rows {first} to {end - 1}"
                raise RasterizerError(f"{self._run.name}: the process that drew {rows} {outcome.how}, twice")
            elif outcome is not None:
                what = f"{type(outcome.error).__name__}: {outcome.error}"
                raise SceneError(f"{self._run.name}: can't be drawn by another process: {what}")

    def _unit(self, rows: tuple[int, int], brightest: float | None, is_again: bool = False) -> Unit:
        unit = Unit(draw_tile, Tile(self._run, rows, brightest), self._shared)
        unit.note = is_again
        return unit

    def _follow_up(self, unit: Unit, outcome: Done | Died | Failed) -> list[Unit]:
        """Return what takes the place of a unit: the same once more, or with its model."""
        tile: Tile = unit.argument
        if isinstance(outcome, Died) and not unit.note:
            return [self._unit(tile.rows, tile.brightest, is_again=True)]
        if isinstance(outcome, Done) and outcome.value is None:
            self._shared = self._shared or self._share(None)
            return [self._unit(tile.rows, tile.brightest)]
        return []


def draw_tile(tile: Tile, shared: Any, kept: dict[str, Any]) -> DrawnTile | Exception | None:
    """Draw a tile, or find its brightest component; return what went wrong, or None where this process doesn't see the
    file of the model.

    Parameters
    ----------
    shared : what is loaded where the run has no path
    kept : the model and the Renderer of the tile before; changed
    """
    run, picture = tile.run, tile.run.pictures[0]
    if not is_seen(run):
        return None
    try:
        model = load_model_of(run, shared, kept)
        if "renderer" not in kept or kept["renderer"].options != picture.options:
            if "renderer" in kept:
                kept.pop("renderer").close()
            kept["renderer"] = StripRenderer(model.scene, **vars(picture.options))
        camera = camera_of(model.scene, picture)
        if tile.brightest is None:
            return DrawnTile(tile.rows[0], {}, NO_STATS, kept["renderer"].measure_strip(tile.rows, camera))
        frame = kept["renderer"].render_strip(tile.rows, camera, brightest=tile.brightest)
        names = ("rgba", *{"color", "alpha", *picture.options.outputs} - {"rgb"})
        arrays = {name: frame.array(name) for name in names if frame.has("rgb" if name == "rgba" else name)}
        return DrawnTile(tile.rows[0], arrays, frame.stats, 0.0)
    except Exception as fault:  # noqa: BLE001  whatever it is goes back to who asked for the picture
        return make_error(run.name, fault)


class Rows(NamedTuple):
    """Rows of a picture, as a RowFile takes them."""

    color: NDArray[np.float32]
    rgba: NDArray[np.uint32]
    alpha: NDArray[np.float32]


def rows_of(arrays: dict[str, NDArray]) -> Rows:
    """Return the arrays of a tile as rows of a picture."""
    rgba = np.ascontiguousarray(arrays["rgba"])
    nothing = np.empty((0, rgba.shape[1]), np.float32)
    return Rows(
        arrays.get("color", np.empty((*nothing.shape, 3), np.float32)),
        rgba.view(np.uint32).reshape(rgba.shape[:2]),
        arrays.get("alpha", nothing),
    )


def add_stats(stats: Stats | None, other: Stats) -> Stats:
    """Return the stats of two parts of a picture, in which each triangle was looked at; None is no part."""
    if stats is None:
        return other
    times = dict(stats.milliseconds)
    for stage, time in other.milliseconds.items():
        times[stage] = times.get(stage, 0.0) + time
    n_covered, n_sample = stats.covered + other.covered, stats.samples + other.samples
    return replace(stats, covered=n_covered, samples=n_sample, milliseconds=times)
