"""Lights, reflection models, buffers and file formats of one's own: each is one class, which one call registers.

    CustomLight         what it adds to a point with a normal: a direction and a strength, or an ambient share
    CustomReflection    what a point reflects of a light to the viewer
    CustomBuffer        a number for each vertex, interpolated; or a whole number for each face
    CustomFormat        a file becomes the parts of a model

    from rasterizer import registries

    registries.add_light("hemisphere", HemisphereLight)
    scene = rz.Scene(mesh, HemisphereLight(...))     # and `raster --light hemisphere:...`, {"kind": "hemisphere", ...}

A class says everything twice: to the engine, where a formula for one point is compiled, and to the reference, in plain
numpy. Registration compares both at some points and refuses what disagrees, with the point and both values
(agreement.py). What tells of errors (`bound`) may be left out: then the engine draws in float64, and `Stats.steps` says
why no bound is stated.

Every call returns a `Registration`. It undoes the call: at the end of a `with` block, or by its method `remove`.

A registration holds for this process. What is pickled for another one needs the same registration there. Formulas of
one's own are compiled in every process: the disk cache keeps only kernels of this package.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from . import agreement
from .choices import BUFFERS, SAVED_ARRAYS
from .engine import lights as engine_lights
from .engine import reflections as engine_reflections
from .engine.buffers import BUFFER_TABLE, draw_custom
from .engine.lights import LIGHT_TABLE, Beam, LightBound
from .engine.reflections import REFLECTION_TABLE, ReflectionBound
from .errors import SceneError, shown
from .io.formats import FORMATS, Format, register
from .reference.buffers import CUSTOM_BUFFERS
from .reference.lamp import LAMP_TYPES, CustomLamp
from .reference.reflection import REFERENCE_MODELS, ReferenceModel
from .scene.camera import View
from .scene.lights import LIGHT_TYPES, describe_fields
from .scene.material import REFLECTION_MODELS, ReflectionModel
from .scene.mesh import Mesh

__all__ = [
    "Beam", "CustomBuffer", "CustomFormat", "CustomLight", "CustomReflection", "LightBound", "ReflectionBound",
    "Registration", "add_buffer", "add_format", "add_light", "add_reflection",
]  # fmt: skip

# ---------------------------------------------------------------- what a class says


class CustomLight:
    """Light of one's own: derive a frozen dataclass from it, with a field `color`, stored as linear RGB or a Spectrum.

    Its fields are annotated as `scene.lights.describe_fields` says: so the command line and scene files read them. It
    may have the fields `attached` ("world" or "camera") and `shadow` (Shadow or None), which mean what they mean to
    other lights. Its `__post_init__` checks them, SceneError.

    One of these two is a static method, which is compiled. It gets a point's unit normal and its position, three
    numbers each, and the array that `numbers` returns, in float32 or float64:

    share(normal, position, numbers) : how much of the colour is added to the ambient light there, at least 0: the
        material's `ambient` reflects it, to all sides
    arrival(normal, position, numbers) : the unit vector to the light, and how much of the colour arrives, at least 0:
        the reflection model does the rest

    Attributes
    ----------
    needs_position : False where the formula reads no position: then none is computed for it
    """

    share: ClassVar[Callable[..., Any] | None] = None
    arrival: ClassVar[Callable[..., Any] | None] = None
    needs_position: ClassVar[bool] = True

    def parts(self) -> Iterable[Any]:
        """Return the lights of this class, or built-in ones, that stand for it: one for each of its colours."""
        return (self,)

    def numbers(self, frame: Any) -> Sequence[float] | NDArray:
        """Return what the formula reads, 15 numbers at most.

        `frame.point(position)` and `frame.vector(direction)` bring what a field holds into the frame of the formula's
        positions and normals, also of a light that moves with the camera.
        """
        return ()

    def reference(self, points: NDArray, normals: NDArray, frame: Any) -> list[tuple]:
        """Return what arrives at points, in plain numpy: the judge of the formula, so it shares nothing with it.

        Parameters
        ----------
        points, normals : (n, 3) float64, world space; the normals are unit vectors
        frame : as that of `numbers`, for these points

        Returns
        -------
        list of (color, light_dirs, strength), one for each colour: light_dirs (n, 3) are unit vectors to the light,
        None of an ambient share; strength is (n,)
        """
        raise NotImplementedError(f"{type(self).__name__} has no `reference`")

    def bound(self) -> LightBound | None:
        """Return how strong it is at most, and how far it magnifies errors; None = nobody knows."""
        return None

    # What a light with a field `shadow` says beside: the engine's beam, world space; and the reference's position.
    beam: ClassVar[Callable[[Any, View], Beam] | None] = None

    def reference_position(self, frame: Any) -> Sequence[float] | NDArray | None:
        """Return where it shines from, world space, for the rays of its shadows; None = from infinitely far away."""
        return None


class CustomReflection:
    """A reflection model of one's own: how much of a light that arrives a surface sends to the viewer.

    reflect(normal, light_dir, view_dir, coefficients) : static method, which is compiled: unit vectors, three numbers
        each, and `coefficients.shininess`, `.roughness` and `.levels` of the material, in float32 or float64; returns D
        and S, which the material's `diffuse` and `specular` are multiplied by. It isn't asked where N·L <= 0

    Attributes
    ----------
    needs_view : False where it reads no view_dir
    has_highlight : False where S is always 0
    bound : None = nobody knows
    model : what a material that names it may have: as default a roughness within 0..1
    """

    needs_view: ClassVar[bool] = True
    has_highlight: ClassVar[bool] = True
    bound: ClassVar[ReflectionBound | None] = None
    model: ClassVar[ReflectionModel] = ReflectionModel()
    reflect: ClassVar[Callable[..., Any]]

    def reference(self, materials: NDArray, normals: NDArray, light_dirs: NDArray, view_dirs: NDArray) -> tuple:
        """Return D and S, (n,) each, in plain numpy: the judge of `reflect`; of no meaning where N·L <= 0.

        Parameters
        ----------
        materials : (n,) records with the fields "shininess", "roughness", "levels"
        normals, light_dirs, view_dirs : (n, 3) float64, unit
        """
        raise NotImplementedError(f"{type(self).__name__} has no `reference`")


class CustomBuffer:
    """An output buffer of one's own: one sample a pixel, at its centre, of the visible surface, never averaged.

    Attributes
    ----------
    holds : what its numbers are, for the help text
    dtype : of the array: of reals, which are interpolated between corners; or int32: labels of faces
    n_component : numbers a pixel
    empty : value where nothing is visible; labels need one, as -1
    write : None = the buffer is made of `values`; else a kernel (surfaces, band, out) that fills a band's pixels by
        itself, see pipeline/buffers.py
    """

    holds: ClassVar[str] = ""
    dtype: ClassVar[DTypeLike] = np.float32
    n_component: ClassVar[int] = 1
    empty: ClassVar[float] = np.nan
    write: ClassVar[Callable[..., None] | None] = None

    def values(self, mesh: Mesh) -> NDArray:
        """Return the values at the mesh's vertices, (n_vertex,) or (n_vertex, n_component), or at the corners of its
        faces, (n_face, 3) or (n_face, 3, n_component); labels of its faces, (n_face,)."""
        raise NotImplementedError(f"{type(self).__name__} has no `values`")

    def reference_values(self, mesh: Mesh) -> NDArray:
        """Return the same, found in another way: the judge of `values`."""
        raise NotImplementedError(f"{type(self).__name__} has no `reference_values`")

    def reference_pixels(self, picture: Any) -> NDArray:
        """Return the buffer of a `reference.Picture`: the judge of `write`."""
        raise NotImplementedError(f"{type(self).__name__} has no `reference_pixels`")

    @property
    def is_label(self) -> bool:
        """It holds labels of faces."""
        return np.issubdtype(np.dtype(self.dtype), np.integer)

    def values_on(self, mesh: Mesh, name: str = "values") -> NDArray:
        """Return `values` or `reference_values`, by name: of corners (n_face, 3, n_component) float64; labels of faces,
        (n_face,) int32. SceneError where their shape doesn't fit."""
        values, n_vertex, n_face = np.asarray(getattr(self, name)(mesh)), len(mesh.vertices), mesh.n_face
        if self.n_component == 1 and not self.is_label and values.shape[-1:] == (1,):
            values = values[..., 0]
        tail = () if self.n_component == 1 else (self.n_component,)
        legal = {(n_face,): "labels of faces"} if self.is_label else {
            (n_vertex, *tail): "of vertices", (n_face, 3, *tail): "of corners"
        }  # fmt: skip
        if values.shape not in legal:
            words = " or ".join(f"{shape}, {what}" for shape, what in legal.items())
            raise SceneError(f"{type(self).__name__}.{name} must be {words}; given {values.shape}")
        if self.is_label:
            return values.astype(np.int32)
        values = values.astype(np.float64)
        at_corners = values[mesh.faces] if len(values.shape) == 1 + len(tail) else values
        return at_corners.reshape(n_face, 3, self.n_component)


class CustomFormat:
    """A file format of one's own; the attributes are those of `io.formats.Format`.

    read(model) : static method that takes a `ModelFile` and returns a list of parts: dicts of the arguments of `Mesh`.
        It names the line of a fault by `model.error`
    """

    suffixes: ClassVar[tuple[str, ...] | None] = None
    is_binary: ClassVar[bool] = False
    companions: ClassVar[str] = ""
    up: ClassVar[str] = "y"
    repeats_vertices: ClassVar[bool] = True
    read: ClassVar[Callable[..., Any]]


# ---------------------------------------------------------------- registering it


class Registration:
    """Hold where a word was entered, and take it back.

    Parameters
    ----------
    word : text, the key in all tables
    tables : those that have it now
    """

    def __init__(self, word: str, tables: list[dict[str, Any]]) -> None:
        self.word = word
        self._tables = tables

    def remove(self) -> None:
        """Take the word out of all tables; scenes that still use it are refused. To do so twice changes nothing."""
        for table in self._tables:
            table.pop(self.word, None)
        self._tables = []

    def __enter__(self) -> "Registration":
        return self

    def __exit__(self, *_: object) -> None:
        self.remove()


def add_light(word: str, cls: type[CustomLight], *, examples: Sequence[Any] = ()) -> Registration:
    """Register a type of light.

    Parameters
    ----------
    word : small letters, digits and hyphens: `kind` in scene files, KIND in `--light KIND:...`
    cls : dataclass that derives from CustomLight
    examples : lights of the class that engine and reference are compared with; else some are made of its fields

    Returns
    -------
    Registration

    Raises
    ------
    SceneError : a word or class that is taken, or a class that is no such dataclass; fields that can't be read; a
        field `shadow` without a `beam`; engine and reference that disagree; a bound that doesn't hold
    """
    _check_class(cls, CustomLight)
    if not (is_dataclass(cls) and any(field.name == "color" for field in fields(cls))):
        raise SceneError(f"the class of a light must be a dataclass with a field color; given {shown(cls)}")
    if cls in LIGHT_TYPES.values():
        raise SceneError(f"{cls.__name__} is the class of another type of light already")
    try:
        described = describe_fields(cls)
    except TypeError as fault:
        raise SceneError(f"the class of a light can't be read: {fault}") from fault
    if (cls.share is None) == (cls.arrival is None):
        raise SceneError(f"{cls.__name__} must have one of the static methods share and arrival")
    if "shadow" in described and (cls.beam is None or cls.share is not None):
        raise SceneError(f"{cls.__name__} has a shadow, so it needs a beam, and an arrival")
    tables = [(LIGHT_TYPES, cls), (LIGHT_TABLE, engine_lights.CustomEntry(cls)), (LAMP_TYPES, CustomLamp())]
    compared = examples or agreement.make_examples(cls, described)
    return _enter(word, tables, "a light", lambda: agreement.compare_light(word, compared))


def add_reflection(word: str, cls: type[CustomReflection]) -> Registration:
    """Register a reflection model.

    Parameters
    ----------
    word : small letters, digits and hyphens: `Material.reflection`
    cls : derives from CustomReflection

    Returns
    -------
    Registration

    Raises
    ------
    SceneError : a word that is taken; engine and reference that disagree; a bound that doesn't hold
    """
    _check_class(cls, CustomReflection)
    model = cls()

    def reflect(materials: NDArray, *vectors: NDArray) -> tuple:
        return (*model.reference(materials, *vectors[:3]), None)  # None: W(θ) is 1

    tables: list[tuple[dict[str, Any], Any]] = [
        (REFLECTION_MODELS, cls.model),
        (REFLECTION_TABLE, engine_reflections.CustomEntry(model)),
        (REFERENCE_MODELS, ReferenceModel(reflect)),
    ]
    return _enter(word, tables, "a reflection model", lambda: agreement.compare_reflection(word, cls))


def add_buffer(name: str, cls: type[CustomBuffer]) -> Registration:
    """Register an output buffer.

    Parameters
    ----------
    name : small letters, digits and hyphens: a name for `Options.outputs`, `Frame.array` and `--array`
    cls : derives from CustomBuffer

    Returns
    -------
    Registration

    Raises
    ------
    SceneError : a name that is taken; labels without a value for where nothing is; engine and reference that disagree
    """
    _check_class(cls, CustomBuffer)
    if name in SAVED_ARRAYS:
        raise SceneError(f"every frame has an array {name!r}; taken are {', '.join((*SAVED_ARRAYS, *BUFFERS))}")
    buffer = cls()
    if buffer.write is None and buffer.is_label and np.isnan(buffer.empty):
        raise SceneError(f"{cls.__name__} holds labels, so it needs a whole number `empty`, as -1")
    tables = [(BUFFERS, cls.holds), (BUFFER_TABLE, draw_custom(buffer)), (CUSTOM_BUFFERS, buffer)]
    return _enter(name, tables, "an output buffer", lambda: agreement.compare_buffer(name, buffer))


def add_format(name: str, cls: type[CustomFormat]) -> Registration:
    """Register a file format.

    Parameters
    ----------
    name : text in lower case, what `format=` and messages call it; it is a suffix of its files where the class names
        none
    cls : derives from CustomFormat

    Returns
    -------
    Registration

    Raises
    ------
    SceneError : a name or suffix that is taken
    """
    _check_class(cls, CustomFormat)
    settings = {each: getattr(cls, each) for each in Format._fields if hasattr(CustomFormat, each)}
    register(Format(name=name, reader=cls.read, **settings))
    return Registration(name, [FORMATS])


def _enter(
    word: str, entries: list[tuple[dict[str, Any], Any]], what: str, compare: Callable[[], None]
) -> Registration:
    """Enter a word in all tables, or in none where it is no word, some table has it, or the comparison raises."""
    if not isinstance(word, str) or not re.fullmatch(r"[a-z][a-z0-9-]*", word):
        raise SceneError(f"the word for {what} must be small letters, digits and hyphens; given {shown(word)}")
    for table, _ in entries:
        if word in table:
            raise SceneError(f"there is {what} {word!r} already; taken are {', '.join(table)}")
    for table, entry in entries:
        table[word] = entry
    with ExitStack() as undo:
        registration = undo.enter_context(Registration(word, [table for table, _ in entries]))
        compare()
        undo.pop_all()
    return registration


def _check_class(cls: Any, base: type) -> None:
    """Raise SceneError where an argument is no class that derives from the one that it must derive from."""
    if not (isinstance(cls, type) and issubclass(cls, base) and cls is not base):
        raise SceneError(f"a class that derives from {base.__name__} is needed; given {shown(cls)}")
