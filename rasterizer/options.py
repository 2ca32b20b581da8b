"""What a caller may choose about a picture; every default stands here, once."""

import math
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
from .scene.validate import choice, flag, is_whole, items_of, number, several, store, whole

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
    min_opacity : the least opacity, 0 to 1, of surfaces that buffers and picks show, a texture's alpha included; the
        default shows every surface, however transparent. Pictures show all surfaces, whatever it is. Where cut-outs are
        there, they are opaque

    Raises
    ------
    SceneError : a value that is not legal
    """

    # Where more may be given than is stored, `Annotated` says what: type checkers read it in words.pyi, which
    # tests/project/make_words.py makes of the fields here and in appearance.py and viewpoint.py.
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
    min_opacity: float = 0.0

    if TYPE_CHECKING:

        def __init__(self, *, size: int | Sequence[int] = ..., **options: "Unpack[OptionWords]") -> None: ...

    def __post_init__(self) -> None:
        from .scene.color import linear_rgb

        choice(self.shading, SHADINGS, "shading")
        choice(self.cull, CULLS, "cull")
        choice(self.color_range, COLOR_RANGES, "color_range")
        outputs = several(self.outputs, OUTPUTS, "outputs")
        if not outputs:
            raise SceneError(f"outputs must name at least one of {', '.join(OUTPUTS)}; given none")
        if not is_whole(self.samples) or self.samples not in SAMPLES:
            raise SceneError(f"samples must be one of {', '.join(map(str, SAMPLES))}; given {shown(self.samples)}")
        store(self, outputs=outputs, samples=int(self.samples))
        sides: list[Any] = [self.size] * 2 if is_whole(self.size) else items_of(self.size)
        limit = MAX_PIXELS // self.factor
        if len(sides) != 2 or not (is_whole(sides[0], 1, limit) and is_whole(sides[1], 1, limit)):
            legal = f"(width, height), each 1 to {limit} px with {self.samples} samples"
            raise SceneError(f"size must be {legal}; given {shown(self.size)}")
        edges = several(self.edges, EDGE_TYPES, "edges")
        *every, word_for_all = EDGE_TYPES
        stops = number(self.exposure, "exposure", low=-MAX_STOPS, high=MAX_STOPS, unit=" stops")
        store(
            self,
            size=(int(sides[0]), int(sides[1])),
            tolerance=number(self.tolerance, "tolerance", low=0),
            min_opacity=number(self.min_opacity, "min_opacity", low=0, high=1),
            exposure=stops,
            edges=tuple(every) if word_for_all in edges else tuple(filter(edges.__contains__, every)),
            edge_color=linear_rgb(self.edge_color, "the edges' color"),
            edge_width=number(self.edge_width, "edge_width", above=0, high=MAX_WIDTH, unit=" px"),
            ground=flag(self.ground, "ground"),
        )
        if self.spectral is not None:
            store(self, spectral=whole(self.spectral, "spectral", MIN_WAVES, MAX_WAVES, " samples, or None"))
        if self.threads is not None:
            store(self, threads=whole(self.threads, "threads", 1, MAX_THREADS, ", or None"))

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
