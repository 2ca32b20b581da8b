"""What a caller may choose about a picture; every default stands here, once."""

import operator
import os
from dataclasses import dataclass

from .errors import SceneError, shown

SHADINGS = ("flat", "lambert", "gouraud", "phong")
OUTPUTS = ("color", "rgb", "depth", "face", "normal")
CULLS = ("none", "back")
COLOR_RANGES = ("clamp", "global", "local")
SAMPLES = (1, 4, 9, 16)
MOST_PIXELS = 16_384  # along an axis, samples included: edge functions of the screen stay far below 2^53
LEAST_WAVES, MOST_WAVES = 3, 401  # samples of the spectrum: one a nanometre is the most that the tables can tell
MOST_STOPS = 64

# One level of 8-bit sRGB is 1/3295 where the curve is steepest; an error below that moves a value by one level at most.
DEFAULT_TOLERANCE = 1 / 4096


@dataclass(frozen=True, kw_only=True)
class Options:
    """Hold the options of a picture.

    Parameters
    ----------
    size : (width, height) in pixels
    shading : "flat" (once a polygon; "lambert" is another word for it), "gouraud" (once a vertex), "phong" (once a
        sample)
    tolerance : error accepted, in linear intensity where 1 is white; 0 = as exact as float64. The default keeps every
        8-bit value within one level of the picture with tolerance 0, but next to steps of the illumination
        (`Stats.steps`)
    samples : samples a pixel, on a square grid: 1, 4, 9 or 16
    outputs : names out of "color" (float32 linear, and 8 bits), "rgb" (8 bits only: the fastest), "depth", "face",
        "normal"; buffers are those of the pixels' centres, never averaged
    cull : "none", or "back" to leave out faces that are clockwise as the viewer sees them
    color_range : what becomes of intensities above 1 in 8 bits: "clamp", "global" (divide by the picture's largest) or
        "local" (divide a pixel by its own largest component)
    exposure : stops by which the light of the scene is multiplied, 2^exposure; the background stays what it is
    spectral : number of samples of 380..780 nm, 3 to 401, with which light and colours are multiplied; None = 81 (every
        5 nm) where a light or material has a Spectrum, else red, green and blue alone
    threads : how many; None = as many as the process may use

    Raises
    ------
    SceneError : a value that is not legal
    """

    size: tuple[int, int] = (640, 480)
    shading: str = "gouraud"
    tolerance: float = DEFAULT_TOLERANCE
    samples: int = 1
    outputs: tuple[str, ...] = ("color",)
    cull: str = "none"
    color_range: str = "clamp"
    exposure: float = 0.0
    spectral: int | None = None
    threads: int | None = None

    def __post_init__(self):
        _choose("shading", self.shading, SHADINGS)
        _choose("cull", self.cull, CULLS)
        _choose("color_range", self.color_range, COLOR_RANGES)
        _choose("samples", self.samples, SAMPLES)
        try:
            outputs = (self.outputs,) if isinstance(self.outputs, str) else tuple(self.outputs)
        except TypeError:
            raise SceneError(
                f"outputs must be one or several of {', '.join(OUTPUTS)}; given {shown(self.outputs)}"
            ) from None
        if not outputs:
            raise SceneError(f"outputs must name at least one of {', '.join(OUTPUTS)}; given none")
        for name in outputs:
            _choose("outputs", name, OUTPUTS)
        object.__setattr__(self, "outputs", outputs)
        object.__setattr__(self, "size", self._checked_size())
        try:
            tolerance = _as_float(self.tolerance)
        except (TypeError, ValueError, OverflowError):
            tolerance = -1.0
        if not 0.0 <= tolerance < float("inf"):
            raise SceneError(f"tolerance must be a number from 0 upwards; given {shown(self.tolerance)}")
        object.__setattr__(self, "tolerance", tolerance)
        object.__setattr__(self, "exposure", self._checked_exposure())
        if self.spectral is not None and not (_is_int(self.spectral) and LEAST_WAVES <= self.spectral <= MOST_WAVES):
            raise SceneError(
                f"spectral must be {LEAST_WAVES} to {MOST_WAVES} samples, or None; given {shown(self.spectral)}"
            )
        if self.threads is not None and not (_is_int(self.threads) and 1 <= self.threads <= 1024):
            raise SceneError(f"threads must be 1 to 1024, or None; given {shown(self.threads)}")

    def _checked_exposure(self) -> float:
        """Return the exposure as a number; beyond 64 stops nothing is told apart."""
        try:
            exposure = _as_float(self.exposure)
        except (TypeError, ValueError, OverflowError):
            exposure = float("nan")
        if not -MOST_STOPS <= exposure <= MOST_STOPS:
            raise SceneError(
                f"exposure must be a number within -{MOST_STOPS}..{MOST_STOPS} stops; given {shown(self.exposure)}"
            )
        return exposure

    def _checked_size(self) -> tuple[int, int]:
        """Return the size as two ints; a number alone makes a square."""
        size = (self.size, self.size) if _is_int(self.size) else self.size
        try:
            width, height = size
        except (TypeError, ValueError):
            width = height = None
        most = MOST_PIXELS // self.factor
        if not (_is_int(width) and _is_int(height) and 1 <= width <= most and 1 <= height <= most):
            raise SceneError(
                f"size must be (width, height), each 1 to {most} px with {self.samples} samples; given {shown(self.size)}"
            )
        return int(width), int(height)

    @property
    def factor(self) -> int:
        """Samples a pixel along each axis."""
        return {1: 1, 4: 2, 9: 3, 16: 4}[self.samples]

    @property
    def is_flat(self) -> bool:
        """Whether a polygon has one intensity."""
        return self.shading in ("flat", "lambert")

    @property
    def n_thread(self) -> int:
        """The number of threads asked for, or that the process may use."""
        if self.threads is not None:
            return self.threads
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _as_float(value) -> float:
    """Return `float(value)`, which for numpy's masked constant would warn."""
    return float("nan") if getattr(value, "mask", False) else float(value)


def _is_int(value) -> bool:
    """Tell whether a value is an integer, numpy's included, and no bool."""
    try:
        operator.index(value)
    except TypeError:
        return False
    return not isinstance(value, bool)


def _choose(name, value, legal) -> None:
    """Refuse a value that isn't one of the legal ones."""
    if not isinstance(value, (str, int, float)) or value not in legal:
        raise SceneError(f"{name} must be one of {', '.join(map(str, legal))}; given {shown(value)}")
