"""What a caller may choose about a picture; every default stands here, once."""

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from .choices import (
    COLOR_RANGES,
    CULLS,
    EDGE_TYPES,
    OUTPUTS,
    SAMPLES,
    SHADINGS,
    ColorRange,
    Cull,
    EdgeType,
    Output,
    Samples,
    Shading,
)
from .cores import n_core
from .errors import SceneError, shown
from .keywords import checked_fields
from .scene.validate import is_whole, number

if TYPE_CHECKING:
    from .keywords import Unpack
    from .words import OptionWords

# Samples along an axis, so that a picture may have 65536 pixels with 16 samples. What is counted along an axis has room
# for 2^20, the guard band in which edge functions stay below 2^60: depths keep their order, rounded by half a unit a
# sample beside a margin of 2^23 units (pipeline/transform.py), and columns are exact in float32 up to 2^23.
MAX_PIXELS = 2**18
MIN_WAVES, MAX_WAVES = 3, 401  # samples of the spectrum: one a nanometre is the most that the tables can tell
MAX_STOPS = 64
MAX_THREADS = 1024
MAX_WIDTH = 256  # px, of edges

# One level of 8-bit sRGB is 1/3295 where the curve is steepest; an error below that moves a value by one level at most.
DEFAULT_TOLERANCE = 1 / 4096


@checked_fields
@dataclass(frozen=True, kw_only=True)
class Options:
    """Hold the options of a picture.

    Parameters
    ----------
    size : (width, height) in pixels, or one number for a square; up to 262144 samples along an axis. Stored as a pair
    shading : "flat" (once a polygon; "lambert" is another word for it), "gouraud" (once a vertex), "phong" (once a
        sample)
    tolerance : error accepted, in linear intensity where 1 is white; 0 = all in float64. The default keeps every
        8-bit value within one level of the picture with tolerance 0, but next to steps of the illumination
        (`Stats.steps`). Gouraud's method uses nearly all of that, textures some of it, flat shading and Phong's method
        next to nothing. So a larger one saves little time; `raster bench` tells how much
    samples : samples a pixel, on a square grid: 1, 4, 9 or 16, each with light and textures of its own. Buffers have
        one sample a pixel, whatever is asked for beside them
    outputs : one name or several out of "color" (float32 linear, and 8 bits), "rgb" (8 bits only: the fastest),
        and the buffers "depth", "face", "normal", "mask", "object", "material", "uv", "barycentric", "position",
        "position_camera", "normal_camera", which are those of the pixels' centres, never averaged; stored as a tuple
    cull : "auto", to leave out what nobody can see of closed bodies: faces of which the inner side is seen. A body is
        what triangles make that share edges; it is closed where each edge has two, wound alike, at one position. That
        is done for meshes whose materials are opaque, while the eye is outside of the box round the mesh, and no near
        plane cuts it; the picture is that of "none", but for a few samples at outlines, where back and front are next
        to each other. Of a body that crosses itself so that a part of it is inside out, that part is seen from within.
        "none" leaves out nothing, "back" whatever is clockwise as the viewer sees it
    color_range : what becomes of intensities above 1 in 8 bits: "clamp", "global" (divide by the picture's largest) or
        "local" (divide a pixel by its own largest component)
    exposure : stops by which the light of the scene is multiplied, 2^exposure, within -64..64; the background stays
        what it is
    spectral : number of samples of 380..780 nm, 3 to 401, with which light and colours are multiplied; None = 81 (every
        5 nm) where a light or material has a Spectrum, else red, green and blue alone
    threads : how many, 1 to 1024; None = as many as the process may use
    edges : which edges of polygons are drawn over the picture, where nothing hides them: "wire" (all of them), "crease"
        (where faces end, or shading is split between them: by the mesh's crease angle, else by its smoothing groups; by
        30 degrees where normals are given), "silhouette" (where the surface turns away from the viewer, or ends),
        "all"; one or several; None or () = none. Stored as a tuple. They are drawn inside of what is seen, so alpha
        stays the model's coverage; buffers don't show them
    edge_color : of the edges: "#rrggbb", the name of a CSS colour, or linear (r, g, b); stored as linear RGB
    edge_width : of the edges, in pixels, above 0 to 256
    ground : whether the scene stands on the ground of a tabletop: a soft shadow lies under the picture, in its alpha,
        too; it fades before the border, and pictures are framed on it as well. Buffers show the scene alone. The
        studio's lights, which are the default, become those of `tabletop`, whose key light casts shadows by Phong's
        method; other lights stay

    Raises
    ------
    SceneError : a value that is not legal
    """

    # Where more may be given than is stored, `Annotated` says what: type checkers read it in words.py, which
    # tests/project/make_words.py makes of the fields here and in look.py and viewpoint.py.
    size: tuple[int, int] = (640, 480)
    shading: Shading = "phong"
    tolerance: float = DEFAULT_TOLERANCE
    samples: Samples = 4
    outputs: Annotated[tuple[Output, ...], "Output | Sequence[Output]"] = ("color",)
    cull: Cull = "auto"
    color_range: ColorRange = "clamp"
    exposure: float = 0.0
    spectral: int | None = None
    threads: int | None = None
    edges: Annotated[tuple[EdgeType, ...], "EdgeType | Sequence[EdgeType] | None"] = ()
    edge_color: Annotated[tuple[float, float, float], "ColorLike"] = (0.0, 0.0, 0.0)
    edge_width: float = 1.0
    ground: bool = False

    if TYPE_CHECKING:

        def __init__(self, *, size: int | Sequence[int] = ..., **options: "Unpack[OptionWords]") -> None: ...

    def __post_init__(self) -> None:
        _check_choice("shading", self.shading, SHADINGS)
        _check_choice("cull", self.cull, CULLS)
        _check_choice("color_range", self.color_range, COLOR_RANGES)
        object.__setattr__(self, "outputs", _checked_outputs(self.outputs))
        object.__setattr__(self, "samples", _checked_samples(self.samples))
        object.__setattr__(self, "size", self._checked_size())
        object.__setattr__(self, "tolerance", _checked_tolerance(self.tolerance))
        object.__setattr__(self, "exposure", _checked_exposure(self.exposure))
        object.__setattr__(
            self, "spectral", _checked_count("spectral", self.spectral, MIN_WAVES, MAX_WAVES, " samples")
        )
        object.__setattr__(self, "threads", _checked_count("threads", self.threads, 1, MAX_THREADS))

        from .scene.color import linear_rgb

        object.__setattr__(self, "edges", _checked_edges(self.edges))
        object.__setattr__(self, "edge_color", linear_rgb(self.edge_color, "the edges' color"))
        object.__setattr__(self, "edge_width", _checked_width(self.edge_width))
        if not isinstance(self.ground, bool):
            raise SceneError(f"ground must be True or False; given {shown(self.ground)}")

    def _checked_size(self) -> tuple[int, int]:
        """Return the size as two ints; a number alone makes a square."""
        size: Any = (self.size, self.size) if is_whole(self.size) else self.size
        try:
            width, height = size
        except (TypeError, ValueError):
            width = height = None
        limit = MAX_PIXELS // self.factor
        if not (is_whole(width, 1, limit) and is_whole(height, 1, limit)):
            legal = f"(width, height), each 1 to {limit} px with {self.samples} samples"
            raise SceneError(f"size must be {legal}; given {shown(self.size)}")
        return int(width), int(height)

    @property
    def factor(self) -> int:
        """Samples a pixel along each axis."""
        return math.isqrt(self.samples)

    @property
    def is_flat(self) -> bool:
        """Whether a polygon has one intensity."""
        return self.shading in ("flat", "lambert")

    @property
    def n_thread(self) -> int:
        """The number of threads asked for, or that the process may use."""
        return n_core() if self.threads is None else self.threads


def _check_choice(name: str, value: object, legal: tuple) -> None:
    """Refuse a value that isn't one of the legal words."""
    if not isinstance(value, str) or value not in legal:
        raise SceneError(f"{name} must be one of {', '.join(map(str, legal))}; given {shown(value)}")


def _checked_outputs(outputs: object) -> tuple:
    """Return the names of outputs as a tuple; a name alone is one."""
    try:
        names = (outputs,) if isinstance(outputs, str) else tuple(outputs)  # type: ignore[arg-type]
    except TypeError:
        raise SceneError(f"outputs must be one or several of {', '.join(OUTPUTS)}; given {shown(outputs)}") from None
    if not names:
        raise SceneError(f"outputs must name at least one of {', '.join(OUTPUTS)}; given none")
    for name in names:
        _check_choice("outputs", name, OUTPUTS)
    return names


def _checked_samples(samples: object) -> Samples:
    """Return the samples a pixel as an int."""
    try:
        value = number(samples, "samples")
    except SceneError:
        value = 0.0
    if value not in SAMPLES:
        raise SceneError(f"samples must be one of {', '.join(map(str, SAMPLES))}; given {shown(samples)}")
    return int(value)  # type: ignore[return-value]


def _checked_count(name: str, value: object, low: int, high: int, unit: str = "") -> int | None:
    """Return a whole number as an int, None as it is."""
    if value is not None and not is_whole(value, low, high):
        raise SceneError(f"{name} must be {low} to {high}{unit}, or None; given {shown(value)}")
    return None if value is None else operator.index(value)  # type: ignore[arg-type]


def _checked_edges(edges: object) -> tuple:
    """Return the types of edges as a tuple; one alone is a tuple of it, None is none."""
    try:
        names = () if edges is None else (edges,) if isinstance(edges, str) else tuple(edges)  # type: ignore[arg-type]
    except TypeError:
        raise SceneError(f"edges must be one or several of {', '.join(EDGE_TYPES)}; given {shown(edges)}") from None
    for name in names:
        _check_choice("edges", name, EDGE_TYPES)
    every = tuple(name for name in EDGE_TYPES if name != "all")
    return every if "all" in names else tuple(name for name in every if name in names)


def _checked_width(width: object) -> float:
    """Return the width of edges as a float."""
    value = number(width, "edge_width")
    if not 0.0 < value <= MAX_WIDTH:
        raise SceneError(f"edge_width must be above 0 to {MAX_WIDTH} px; given {shown(width)}")
    return value


def _checked_tolerance(tolerance: object) -> float:
    """Return the tolerance as a float of at least 0."""
    value = number(tolerance, "tolerance")
    if value < 0.0:
        raise SceneError(f"tolerance must be a number from 0 upwards; given {shown(tolerance)}")
    return value


def _checked_exposure(exposure: object) -> float:
    """Return the exposure as a float; beyond 64 stops nothing is told apart."""
    value = number(exposure, "exposure")
    if not -MAX_STOPS <= value <= MAX_STOPS:
        raise SceneError(f"exposure must be a number within -{MAX_STOPS}..{MAX_STOPS} stops; given {shown(exposure)}")
    return value
