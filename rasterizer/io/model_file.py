"""What the readers of model files share; and how much may be made of a file.

In: `ModelFile`, the bytes of a file with its name and format. Out: `Part`, a dict of the arguments of `Mesh`.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..cores import Workers, n_core
from ..errors import ModelError, counted, cut, warn_caller
from ..scene.material import WHITE, Material
from ..scene.mesh_arrays import without_unused
from ..scene.scalars import NO_SCALARS, ScalarWords
from ..scene.texture import Budget
from ..scene.triangulation import CROSSING, Cut, TooManyCorners, cut_polygons
from .files import Folder, LongFile

MAX_MESSAGE = 250  # letters of a message, beside the file's name

Part = dict


class Contents(NamedTuple):
    """What a file holds, and what of it is not used.

    Parameters
    ----------
    parts : list of Part, or of pairs of a part and the matrix (4, 4) of its place
    lights : of rasterizer.scene.lights; None = the file has none
    camera : Camera or None; its target is any point ahead of it
    n_point, n_line : points and lines that the file has as elements of their own; they aren't drawn
    facts : texts, what the file says about itself, as "unit millimeter"
    left_out : texts, what else the file has, and would be seen if it were used, as "normal textures": it is warned of
    unused : texts, what else it has that nobody would see
    up : text, the up axis that the file states; None = that of its format
    """

    parts: list
    lights: tuple | None = None
    camera: object = None
    n_point: int = 0
    n_line: int = 0
    facts: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    up: str | None = None


class Report(str):
    """A fact about a file, as `log` gets it, and what the file has that isn't used.

    Parameters
    ----------
    text : the fact
    left_out : texts, as `left_out` and `unused` of `Contents`
    """

    left_out: tuple[str, ...]

    def __new__(cls, text: str, left_out: Iterable[str] = ()) -> "Report":
        """Make a text that knows more."""
        report = super().__new__(cls, text)
        report.left_out = tuple(left_out)
        return report


class MeshSettings(NamedTuple):
    """How meshes are made of what files hold; the fields are as `load` takes them."""

    crease_angle: float | None = None
    weighting: str | None = None
    drop_bad_faces: bool = False
    scalars: ScalarWords = NO_SCALARS

    def arguments(self) -> dict:
        """Return those that are asked for, as arguments of Mesh."""
        words = self._replace(drop_bad_faces=self.drop_bad_faces or None)._asdict()
        return without_none({name: value for name, value in words.items() if name != "scalars"})


def without_none(words: dict) -> dict:
    """Return the arguments that are given."""
    return {name: value for name, value in words.items() if value is not None}


def bytes_of_copy(mesh) -> int:
    """Return how many bytes count where a mesh is placed once more: a quarter of those of its vertices and normals,
    which are there once then, not four times; and some for its materials."""
    n_byte = mesh.vertices.nbytes + (0 if mesh.normals is None else mesh.normals.nbytes)
    return n_byte // 4 + 256 * len(mesh.palette)


def materials_of(part: Part) -> tuple[Material, ...]:
    """Return the materials of a part, whether it has one or several."""
    return part.get("materials") or (part["material"],)


@dataclass(frozen=True, eq=False)
class ModelFile:
    """One file: name for messages, format, bytes, the files that it may name, who gets facts, and what may be made of
    it."""

    name: str
    format: str
    data: bytes | LongFile  # the latter where the format is read in parts
    beside: Folder
    log: Callable[[str], object] | None  # called with facts about the file
    limits: "Limits" = None  # None = its own, by its size
    textures: Budget = None  # counts those that are made of it

    def __post_init__(self) -> None:
        if self.textures is None:
            object.__setattr__(self, "textures", Budget(self.name))
        if self.limits is None:
            object.__setattr__(self, "limits", Limits(len(self.data), f"{self.name}: "))

    def error(self, fault: object, line: int | None = None) -> ModelError:
        """Make the error `name:line: fault`, whose fault is cut."""
        return ModelError(f"{self._place(line)}: {cut(fault, MAX_MESSAGE)}")

    def warn(self, fault: object, line: int | None = None) -> None:
        """Warn of `name:line: fault`, cut; of a file that has many faults only of the first."""
        self.limits.n_warning += 1
        if self.limits.n_warning < MAX_WARNINGS:
            warn_caller(f"{self._place(line)}: {cut(fault, MAX_MESSAGE)}")
        elif self.limits.n_warning == MAX_WARNINGS:
            warn_caller(f"{self.name}: there is more to warn of, which is left out")

    def tell(self, fact: object, line: int | None = None) -> None:
        """Log `name:line: fact`, cut."""
        if self.log is not None:
            self.log(f"{self._place(line)}: {cut(fact, MAX_MESSAGE)}")

    def mend(self, noun: str, what: str, n: int = 1) -> None:
        """Count `n` of something that is taken otherwise than it stands in the file: of each kind one warning is made,
        as "2 nodes of scale 0: left out", once the whole file has been read."""
        self.limits.mended[noun, what] += int(n)

    def warn_of_mended(self) -> None:
        """Warn of what `mend` has counted."""
        for (noun, what), n in self.limits.mended.items():
            if n:
                self.warn(f"{counted(n, noun)} {what}")

    def _place(self, line) -> str:
        return self.name if line is None else f"{self.name}:{line}"


def text_of(data: bytes) -> str:
    """Decode UTF-8, or Latin-1 where it is none: numbers and keywords are ASCII, only names differ."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def bytes_of(model, colors, white: float | None = None) -> np.ndarray:
    """Return colours (n, 3 or 4) as 8 bit values.

    Parameters
    ----------
    white : what stands for 1; None = 255 where the numbers say so: one is above 2, or whole numbers above 1. A hair
        above 1 is 1
    """
    colors = np.asarray(colors)
    if colors.dtype == np.uint8:
        return colors
    values, most = colors.astype(np.float64), 0.0
    if white is None:
        shown = values[..., :3][np.isfinite(values[..., :3])]
        most = shown.max(initial=0.0)
        white = 255.0 if most > 2.0 or (most > 1.0 and (shown == np.rint(shown)).all()) else 1.0
    return np.rint(within_1(model, values / white) * 255.0).astype(np.uint8)


def within_1(model, colors: np.ndarray, noun: str = "colour") -> np.ndarray:
    """Return colours within 0..1, the nearest there are; what isn't a number becomes 0."""
    if colors.size and not (colors.min() >= 0.0 and colors.max() <= 1.0):  # nan neither
        is_outside = ~((colors >= 0.0) & (colors <= 1.0)).all(axis=-1)
        model.mend(noun, "outside the legal range: taken as the nearest within", is_outside.sum())
        return np.clip(np.nan_to_num(colors, nan=0.0), 0.0, 1.0)
    return colors


def mend_unused(model, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return vertices (n, 3) of which those that no face uses are finite; others are counted."""
    vertices, n_bad = without_unused(np.asarray(vertices, np.float64), faces)
    if n_bad:
        model.mend("vertex", "used by no face, not finite: left out", n_bad)
    return vertices


SCALED_AWAY = "node", "of scale 0: left out"


def make_opaque(model, parts) -> None:
    """Make the materials of all parts opaque where all are invisible: exporters leave the alpha 0, and nobody exports
    what can't be seen."""
    if parts and not any(material.opacity > 0.0 for part in parts for material in materials_of(part)):
        model.warn("all its materials are invisible, opacity 0: drawn as if they were opaque")
        for part in parts:
            part["material"] = replace(part.get("material", WHITE), opacity=1.0)
            if "materials" in part:
                part["materials"] = tuple(replace(material, opacity=1.0) for material in part["materials"])


def cut_faces(model, points, corners, counts, line_of) -> Cut:
    """Cut the polygons of a file, as `scene/triangulation.py` says.

    Parameters
    ----------
    points : (n_vertex, 3) float64
    corners : (n_corner,) int64, legal indices of vertices, polygon by polygon
    counts : (n_polygon,) int64
    line_of : function of the number of a polygon, which returns what stands behind the file's name in the warning, as
        ":12: face"

    Warns
    -----
    UserWarning : polygons that cross themselves

    Raises
    ------
    ModelError : concave polygons with too many corners
    """
    try:
        cut = cut_polygons(points, corners, counts)
    except TooManyCorners as refusal:
        raise ModelError(f"{model.name}{line_of(refusal.polygon)} {refusal.fault}") from None
    if len(cut.crossing):
        more = f"; so do {len(cut.crossing) - 1} more" if len(cut.crossing) > 1 else ""
        warn_caller(f"{model.name}{line_of(int(cut.crossing[0]))} {CROSSING}{more}")
    return cut


def check_indices(model, corners, counts, n_vertex, place_of) -> None:
    """Raise ModelError where a corner of a polygon is no vertex; `place_of` says where a polygon stands, as in
    `cut_faces`."""
    if len(corners) == 0 or (corners.min() >= 0 and corners.max() < n_vertex):
        return
    bad = int(np.argmax((corners < 0) | (corners >= n_vertex)))
    polygon = int(np.searchsorted(np.cumsum(counts), bad, side="right"))
    legal = f"the file has {n_vertex}, legal is 0..{n_vertex - 1}"
    raise ModelError(f"{model.name}{place_of(polygon)} refers to vertex {corners[bad]}; {legal}")


# ----------------------------------------------------------------
# Numbers in text, exactly rounded: of long texts by compiled code (text_kernels.py), else by Python's `float`.

FEW = 1 << 18  # letters of a text that is read without waiting for a compiler, or for the code that it made
_BLANKS = bytes.maketrans(b"\t\n\v\f\r", b" " * 5)  # what C's isspace calls so
_BLOCK = 1 << 18  # letters that a thread reads


def read_words(words: list[bytes]) -> NDArray[np.float64] | None:
    """Return the numbers that words stand for, as `float` reads them; but underscores are not legal. None where one
    stands for none."""
    if b"_" in b"".join(words):
        return None
    try:
        return np.fromiter(map(float, words), np.float64, len(words))
    except ValueError:
        return None


def numbers_in(text: bytes) -> NDArray[np.float64] | None:
    """Return the numbers of a text with blanks or newlines between them, None where it holds anything else."""
    data = text.translate(_BLANKS)
    if len(data) < FEW:
        return read_words(data.split())
    cuts = [0]
    while cuts[-1] < len(data):
        end = data.find(b" ", cuts[-1] + _BLOCK)
        cuts.append(len(data) if end < 0 else end)

    def read(block: tuple[int, int]) -> NDArray[np.float64] | None:
        from .text_kernels import POWERS, read_numbers

        report_progress(block[0], len(data), "reading numbers")
        letters = data[slice(*block)] + b" "
        values = np.empty(len(letters))
        n = read_numbers(np.frombuffer(letters, np.uint8), POWERS, values)
        return read_words(letters.split()) if n < 0 else values[:n].copy()

    with Workers(n_core()) as workers:
        tables = workers.map(read, list(zip(cuts[:-1], cuts[1:], strict=True)))
    return None if any(table is None for table in tables) else np.concatenate(tables)


# ----------------------------------------------------------------
# How much may be made of a file: what it states is counted before it is spent, and its text is cut.
#
# A file of some bytes can ask for any number of others: by packing them, by stating counts, by referring to the same
# ones again and again. So everything that is unpacked, copied or repeated is counted, in bytes and in meshes, and
# together it may have
#
#     bytes    RATIO times those of the files that were read, or LEAST where that is more
#     meshes   one for MESH_BYTES bytes of these files, and LEAST_MESHES
#
# Loading a file below 1 MB takes up to 300 MB and 10 s then: arrays are there four times at most while meshes are made,
# and a mesh takes half a millisecond. Real files stay far below: text of numbers packs to a tenth, quantised vertices
# grow eightfold, and 128 bytes for a mesh are less than its name, place and faces.

RATIO = 32
LEAST = 2**26
LEAST_TEXT = 2**23  # of what is unpacked and then parsed: trees of XML take several times as much
LEAST_MESHES, MESH_BYTES = 2**13, 128
MAX_NAME = 200  # letters of the name of a mesh or material
MAX_WARNINGS = 20  # of one file


def most(n_byte: int, least: int = LEAST) -> int:
    """Return how many bytes may be made of a file of `n_byte` bytes."""
    return max(least, RATIO * n_byte)


def name_in(text: object) -> str:
    """Return a name that stands in a file, cut: it may be as long as the file, and thousands of things may bear it."""
    return text[:MAX_NAME] if isinstance(text, str) else str(text)[:MAX_NAME]


class Limits:
    """Count what is made of one file and those that it names.

    Parameters
    ----------
    n_byte : bytes of the file
    name : text, the file's name in errors, with what follows it; empty = the caller says where
    """

    def __init__(self, n_byte: int, name: str = ""):
        self.n_byte, self.name = n_byte, name
        self.n_made = self.n_mesh = self.n_warning = 0
        self.mended: Counter[tuple[str, str]] = Counter()

    def count_bytes(self, n_byte: int) -> None:
        """Count bytes of arrays before they are made; ModelError where they are too many."""
        self.n_made += n_byte
        if self.n_made > most(self.n_byte):
            size = f"a file of {self.n_byte} bytes"
            raise ModelError(
                f"{self.name}asks for {self.n_made} bytes of arrays: too many for {size}, {most(self.n_byte)} are legal"
            )

    def count_meshes(self, n_mesh: int) -> None:
        """Count meshes, each as often as it is shown; ModelError where they are too many."""
        self.n_mesh += n_mesh
        legal = LEAST_MESHES + self.n_byte // MESH_BYTES
        if self.n_mesh > legal:
            size = f"a file of {self.n_byte} bytes"
            raise ModelError(f"{self.name}shows {self.n_mesh} meshes or nodes: too many for {size}, {legal} are legal")


# ----------------------------------------------------------------
# Tell whoever waits how far the reading of a large file has come.
# Readers call `report_progress` as often as they like; it costs nothing where nobody listens. A listener is there for
# the block of `noticing_progress`, in its own thread.

_listener: ContextVar[Callable[[int, int, str], object] | None] = ContextVar("progress of reading", default=None)


@contextmanager
def noticing_progress(show: Callable[[int, int, str], object] | None) -> Iterator[None]:
    """Call show(n_done, n, what) inside the block whenever a reader has come further; None makes it silent again."""
    token = _listener.set(show)
    try:
        yield
    finally:
        _listener.reset(token)


def report_progress(n_done: int, n: int, what: str) -> None:
    """Say that `n_done` of `n` parts of some work are done."""
    show = _listener.get()
    if show is not None:
        show(n_done, n, what)
