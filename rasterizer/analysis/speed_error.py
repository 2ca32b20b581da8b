"""Speed against error: what each method of drawing a scene costs, and how far its picture is from the ground truth.

    list_methods ─ draw and compare ─ time, in turns ─ sort_by_front ─ advise

A row that another row beats in both, time and error, is of no use to anybody. The others are the front: less error
costs more time.

The ground truth is Phong's shading at 64 samples a pixel with tolerance 0: nothing is saved. What a picture's error
consists of is found by comparing pictures that save one thing less, as light on black: colours times the share of a
pixel that is covered.

    error     = against the ground truth                             all of it
    method    = against Phong, same samples, tolerance 0             where light is evaluated: polygons, vertices
    sampling  = Phong, same samples, against the ground truth        edges, highlights and textures between samples
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from fractions import Fraction
from importlib.util import find_spec
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiler import kernels
from ..engine.recorded_kernels import list_kernels
from ..errors import counted
from ..options import Options
from ..renderer import Renderer
from ..scene.scene import Scene
from .comparison import delta_e_2000, flip_map, levels_from_linear, root_mean_square
from .timing import take_turns

MAX_FACES = 2**22  # of a subdivided scene: some 2 GB
MAX_ROUNDS = 25
_MEASURED = 0.6  # share of the time limit in which calls take turns; the rest is for drawing what is compared
_FINER = 2  # of the ground truth: pixels along each axis of a pixel, of 16 samples each, a grid of 8 x 8
_ALIKE = 1.1  # errors within 10 % of each other are alike: no eye tells them apart
_AS_QUICK = 1.05, 1.25  # times within 5 % are, and within 25 % those that vary by more than they differ
_SAMPLES = 4  # a pixel, of the methods that are advised, or the nearest that were measured
_NAMES = {"flat": "flat shading", "lambert": "flat shading", "gouraud": "Gouraud", "phong": "Phong"}
_TIMES = {0: "", 1: ", subdivided once", 2: ", subdivided twice"}


class Method(NamedTuple):
    """A method of drawing a scene."""

    shading: str
    subdivisions: int  # times that every triangle is cut in four
    samples: int  # a pixel
    tolerance: float

    def __str__(self) -> str:
        return f"{self.name}, {counted(self.samples, 'sample')}, tolerance {tolerance_text(self.tolerance)}"

    @property
    def name(self) -> str:
        """Shading and subdivision in words."""
        return _NAMES[self.shading] + _TIMES.get(self.subdivisions, f", subdivided {self.subdivisions} times")

    @property
    def options(self) -> dict:
        """The method as options of `rasterizer.render`."""
        return {"shading": self.shading, "samples": self.samples, "tolerance": self.tolerance}


class Errors(NamedTuple):
    """How far a picture is from another one, over the pixels that either covers.

    Attributes
    ----------
    max, rms : largest, and root mean square, difference of a channel, in linear intensity where 1 is white
    levels : largest difference of an 8-bit value
    over_one : share of the 8-bit values that are more than one level off
    delta_e : mean colour difference (CIEDE2000); about 1 is just noticed; None where scikit-image isn't installed
    flip : mean FLIP, 0 to 1; None where it wasn't asked for
    """

    max: float
    rms: float
    levels: int
    over_one: float
    delta_e: float | None
    flip: float | None = None


class Row(NamedTuple):
    """What one method costs, and what it is worth.

    Attributes
    ----------
    method : Method
    ms : median milliseconds of a warm frame
    error : Errors against the ground truth
    of_method, of_sampling : rms, linear intensity: the parts of the error that the method and the sampling make
    is_beaten : whether another row is quicker and nearer to the ground truth
    spread : half of the range that holds the middle half of its times, as a share of `ms`
    """

    method: Method
    ms: float
    error: Errors
    of_method: float
    of_sampling: float
    is_beaten: bool = False
    spread: float = 0.0


class Study(NamedTuple):
    """The rows of a scene."""

    rows: list[Row]  # the front first, from the quickest on; then the others, by their errors
    left_out: list[Method]  # for want of time or memory
    advice: str


Progress = Callable[[int, int, str], None]


def list_methods(
    shadings: Iterable[str], subdivisions: Sequence[int], samples: Iterable[int], tolerances: Iterable[float]
) -> list[Method]:
    """List the combinations. Only Gouraud's method sees more of a surface that is subdivided: flat shading lights
    polygons, and Phong's lights samples."""
    tolerances, samples = list(tolerances), list(samples)
    return [
        Method(shading, times, n_sample, tolerance)
        for times in subdivisions
        for shading in shadings
        if shading == "gouraud" or times == min(subdivisions)
        for n_sample in samples
        for tolerance in tolerances
    ]


def study(
    scene: Scene,
    size: tuple[int, int],
    methods: Sequence[Method],
    seconds: float,
    progress: Progress,
    with_flip: bool = False,
    **options: Any,
) -> Study:
    """Measure methods on a scene.

    Parameters
    ----------
    scene : Scene
    size : (width, height) in pixels
    methods : sequence of Method, of one or several subdivisions
    seconds : time limit; when it has passed, what hasn't been begun is left out. Compiling kernels isn't counted
    progress : is called with the number of methods done, that of all, and the name of the one that is begun
    with_flip : whether FLIP is measured, too
    options : further options of `rasterizer.render`, the same for all

    Returns
    -------
    Study

    Raises
    ------
    SceneError : an option that isn't legal, or FLIP is asked for and flip-evaluator isn't installed
    """
    compile_kernels(scene, methods, options)
    progress(0, len(methods), "the ground truth")
    work = _Work(scene, size, options)
    start, rows, left_out, anchor_ms = perf_counter(), list[Row](), list[Method](), 0.0
    cost = 0.0  # seconds that a picture took in the group before
    truths = _Truths(work, with_flip)
    for group, finer in _groups(scene, methods):
        left = seconds - (perf_counter() - start)
        is_first = group[0].subdivisions == methods[0].subdivisions  # measured however long it takes
        # A frame of four times as many faces takes up to four times as long, of some models as long as before.
        if finer is None or not (is_first or 2.0 * cost * len(group) < left):
            left_out += group
            continue
        begin, drawn = perf_counter(), dict[Method, tuple[Errors, float, float]]()
        for method in group:
            progress(len(rows) + len(drawn), len(methods), str(method))
            drawn[method] = truths.compare(method, finer)
        cost = (perf_counter() - begin) / len(group)
        share = _MEASURED * max(left, 0.0) * len(group) / (len(methods) - len(rows) - len(left_out))
        ms, ratios = _time_group(work, methods[0], group, finer, share)
        anchor_ms = anchor_ms or ms  # that of the first group counts
        for method in group:
            low, middle, high = ratios[method].tolist()
            spread = 0.5 * (high - low) / middle
            rows.append(Row(method, anchor_ms * middle, *drawn[method], spread=spread))
    rows = sort_by_front(rows)
    return Study(rows, left_out, advise(rows, left_out))


def compile_kernels(scene: Scene, methods: Iterable[Method], options: dict) -> None:
    """Compile what the methods need: that is no part of any time."""
    listed: list[kernels.Job] = []
    truth = {"shading": "phong", "samples": 16, "tolerance": 0.0}
    for chosen in (*(method.options for method in methods), truth):
        listed += list_kernels(scene, Options(**options | chosen | {"outputs": ("color",)}))
    kernels.compile_into(kernels.STORE, kernels.missing_in(kernels.STORE, listed))


def _groups(scene: Scene, methods: Sequence[Method]) -> Iterator[tuple[list[Method], Scene | None]]:
    """Yield the methods that are measured in turns, with what they draw; None where that would be too large."""
    keys = list(dict.fromkeys((method.subdivisions, method.shading) for method in methods))
    finer, done = scene, 0
    for times, shading in keys:
        group = [method for method in methods if (method.subdivisions, method.shading) == (times, shading)]
        if times and scene.n_face * 4**times > MAX_FACES:
            yield group, None
            continue
        if times != done:
            finer, done = subdivided(scene, times), times
        yield group, finer


def subdivided(scene: Scene, times: int) -> Scene:
    """Return a scene whose triangles are cut in four, `times` times."""
    if not times:
        return scene
    return replace(scene, meshes=tuple(mesh.subdivide(times) for mesh in scene.meshes))


# ---------------------------------------------------------------- the ground truth, and how far a picture is from it


class Light(NamedTuple):
    """A picture as the light that it sends out."""

    color: NDArray[np.float64]  # (height, width, 3) linear; 0 where nothing is
    alpha: NDArray[np.float64]  # (height, width) covered share


def draw_light(scene: Scene, size: tuple[int, int], **options: Any) -> Light:
    """Draw a scene; options are those of `rasterizer.render`."""
    with Renderer(scene, size, outputs=("color",), **options) as renderer:
        frame = renderer.render()
    alpha = frame.alpha.astype(np.float64)
    return Light(frame.color * alpha[..., None], alpha)


def draw_ground_truth(scene: Scene, size: tuple[int, int], **options: Any) -> Light:
    """Draw a scene by Phong's shading at 64 samples a pixel with tolerance 0.

    Parameters
    ----------
    scene : Scene
    size : (width, height) in pixels
    options : those of `rasterizer.render`, but for shading, samples and tolerance
    """
    width, height = size
    options = options | {"shading": "phong", "samples": 16, "tolerance": 0.0}
    fine = draw_light(scene, (_FINER * width, _FINER * height), **options)
    return Light(_averaged(fine.color), _averaged(fine.alpha))


def _averaged(values: NDArray) -> NDArray:
    """The means of squares of pixels."""
    height, width, *rest = values.shape
    return values.reshape(height // _FINER, _FINER, width // _FINER, _FINER, *rest).mean(axis=(1, 3))


def measure_errors(found: Light, expected: Light, with_flip: bool = False) -> Errors:
    """Measure how far one picture is from another one of the same size.

    Raises SceneError where FLIP is asked for and flip-evaluator isn't installed.
    """
    is_drawn = _drawn_by_either(found, expected)
    if not is_drawn.any():
        return Errors(0.0, 0.0, 0, 0.0, 0.0, 0.0 if with_flip else None)
    found_color, expected_color = found.color[is_drawn], expected.color[is_drawn]
    difference = np.abs(found_color - expected_color)
    levels = np.abs(levels_from_linear(found_color).astype(np.int16) - levels_from_linear(expected_color))
    has_delta_e = find_spec("skimage") is not None
    return Errors(
        max=float(difference.max()),
        rms=root_mean_square(difference),
        levels=int(levels.max()),
        over_one=float(np.mean(levels > 1)),
        delta_e=float(delta_e_2000(found_color, expected_color).mean()) if has_delta_e else None,
        flip=float(flip_map(found.color, expected.color)[is_drawn].mean()) if with_flip else None,
    )


def rms_error(found: Light, expected: Light) -> float:
    """The `rms` of `measure_errors` alone, which is quicker."""
    is_drawn = _drawn_by_either(found, expected)
    return root_mean_square(found.color[is_drawn] - expected.color[is_drawn])


def _drawn_by_either(found: Light, expected: Light) -> NDArray[np.bool_]:
    """The pixels of which one picture or the other covers a part, (height, width)."""
    return (found.alpha > 0.0) | (expected.alpha > 0.0)


# ---------------------------------------------------------------- a study's pictures


class _Work(NamedTuple):
    """What all methods draw."""

    scene: Scene
    size: tuple[int, int]
    options: dict

    def draw(self, scene: Scene, method: Method) -> Light:
        """Draw a scene, this one or a finer one, by a method."""
        return draw_light(scene, self.size, **self.options | method.options)


class _Truths:
    """Draw what pictures are compared with, each once."""

    def __init__(self, work: _Work, with_flip: bool) -> None:
        self._work, self._with_flip = work, with_flip
        self._truth = draw_ground_truth(work.scene, work.size, **work.options)
        self._of_samples: dict[int, tuple[Light, float]] = {}

    def compare(self, method: Method, finer: Scene) -> tuple[Errors, float, float]:
        """Draw a method's picture; return its error, and what the method and the sampling make of it, as in `Row`."""
        found = self._work.draw(finer, method)
        same_samples, of_sampling = self._phong(method.samples)
        error = measure_errors(found, self._truth, self._with_flip)
        return error, rms_error(found, same_samples), of_sampling

    def _phong(self, samples: int) -> tuple[Light, float]:
        """Phong's picture with tolerance 0, and how far it is from the ground truth."""
        if samples not in self._of_samples:
            light = self._work.draw(self._work.scene, Method("phong", 0, samples, 0.0))
            self._of_samples[samples] = light, rms_error(light, self._truth)
        return self._of_samples[samples]


# ---------------------------------------------------------------- times, and the front


def _time_group(
    work: _Work, anchor: Method, group: Sequence[Method], finer: Scene, seconds: float
) -> tuple[float, dict[Method, NDArray[np.float64]]]:
    """Time methods in turns with the first method of all, so that groups can be compared.

    Returns
    -------
    the milliseconds of the first method; and of each method the quartiles (3,) of its times as multiples of that
    """
    with ExitStack() as stack:
        calls: dict[Method | None, Callable[[], Any]] = {}
        for key, method, scene in [(None, anchor, work.scene), *((method, method, finer) for method in group)]:
            settings = work.options | method.options | {"outputs": ("rgb",)}
            calls[key] = stack.enter_context(Renderer(scene, work.size, **settings)).render
            calls[key]()  # compiles and allocates
        turns = take_turns(calls, seconds, MAX_ROUNDS)
    reference = turns[None][0]
    ratios = {method: np.quantile(turns[method][0] / reference, (0.25, 0.5, 0.75)) for method in group}
    return float(np.median(reference)), ratios


def sort_by_front(rows: Sequence[Row]) -> list[Row]:
    """Mark the rows that another row beats in time and in error (rms), and sort: the front by time, the rest by error.

    A row is beaten where another one isn't worse in either, and better in one. Errors count with three digits, as they
    are printed.
    """
    marked = [row._replace(is_beaten=any(_beats(other, row) for other in rows)) for row in rows]
    return sorted(marked, key=lambda row: (row.is_beaten, row.error.rms if row.is_beaten else row.ms))


def _beats(a: Row, b: Row) -> bool:
    mine, other = (a.ms, printed(a.error.rms)), (b.ms, printed(b.error.rms))
    return mine != other and mine[0] <= other[0] and mine[1] <= other[1]


def printed(error: float) -> float:
    """An error with three digits."""
    return float(f"{error:.2e}")


# ---------------------------------------------------------------- the advice


def advise(rows: Sequence[Row], left_out: Sequence[Method] = ()) -> str:
    """Say in a sentence or two which method to choose.

    With a fixed number of samples, that is the quickest method whose error is within 10 % of the least. Of those whose
    times are too close to call it is the one with the least error, so that another run says the same. Which methods
    were left out is said, too.
    """
    if not rows:
        return ""
    samples = min((row.method.samples for row in rows), key=lambda n: abs(n - _SAMPLES))
    rows = [row for row in rows if row.method.samples == samples]
    best = min(rows, key=lambda row: row.error.rms)
    alike = [row for row in rows if row.error.rms <= _ALIKE * best.error.rms]
    quickest = min(alike, key=lambda row: row.ms)
    close = [row for row in alike if _is_tied(row, quickest)]
    chosen = min(close, key=lambda row: (printed(row.error.rms), row.method.tolerance == 0.0, row.method))
    text = f"Choose {chosen.method}: {_figures(chosen)}."
    if chosen.method.name != best.method.name:
        text += f" The least error with as many samples has {best.method}: {_figures(best)}."
    unknown = " and ".join(dict.fromkeys(method.name for method in left_out))
    return text + (f" Not measured: {unknown}." if unknown else "")


def _is_tied(a: Row, b: Row) -> bool:
    """Tell whether two times are too close to call."""
    low, high = _AS_QUICK
    return max(a.ms, b.ms) <= min(max(low, 1.0 + a.spread + b.spread), high) * min(a.ms, b.ms)


def _figures(row: Row) -> str:
    return f"rms {row.error.rms:.2g} in {row.ms:.3g} ms"


def tolerance_text(tolerance: float) -> str:
    """A tolerance as people write it: 1/4096 where it is one over a whole number."""
    fraction = Fraction(tolerance).limit_denominator(10**6)
    is_inverse = fraction.numerator == 1 and fraction.denominator > 1 and float(fraction) == tolerance
    return str(fraction) if is_inverse else f"{tolerance:g}"
