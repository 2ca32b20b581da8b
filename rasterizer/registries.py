"""Lights and reflection models of one's own: each is one class, which one call registers.

    CustomLight         what it adds to a point with a normal: a direction and a strength, or an ambient share
    CustomReflection    what a point reflects of a light to the viewer

    from rasterizer import registries

    registries.add_light("hemisphere", HemisphereLight)
    scene = rz.Scene(mesh, HemisphereLight(...))     # and `raster --light hemisphere:...`, {"kind": "hemisphere", ...}

A class says everything twice: to the engine, where a formula for one point is compiled, and to the reference, in plain
numpy. Registration compares both at some points and refuses what disagrees, with the point and both values
(agreement.py). Nobody knows how a formula of one's own rounds: so it is evaluated in float64, and `Stats.steps` says
why no bound is stated.

What else such a class needs can be imported from here, too: what its fields may hold (`Color`, `Vector`, `Attenuation`,
`Shadow`), and what checks them (`linear_rgb`, `unit3`, `number` …), see `__all__`.

Every call returns a `Registration`. It undoes the call: at the end of a `with` block, or by its method `remove`.

A registration holds for this process, and for those to which its lights and materials are pickled, if the class can be
imported there. One that `raster` and scene files know is that of a plug-in, see scene/plugins.py. Formulas of one's own
are compiled in every process: the disk cache keeps only kernels of this package.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from typing import Any, ClassVar

from numpy.typing import NDArray

from . import agreement
from .engine import lights as engine_lights
from .engine import reflections as engine_reflections
from .engine.lights import LIGHT_TABLE, Beam, to_world
from .engine.reflections import REFLECTION_TABLE
from .errors import SceneError, shown
from .reference.lamp import LAMP_TYPES, CustomLamp
from .reference.reflection import REFERENCE_MODELS, ReferenceModel
from .scene.camera import View
from .scene.color import linear_rgb
from .scene.lights import (
    LIGHT_TYPES,
    Attenuation,
    Color,
    Shadow,
    Vector,
    checked_shadow,
    class_of_light,
    describe_fields,
    light_type_of,
)  # fmt: skip
from .scene.material import REFLECTION_MODELS, ReflectionModel
from .scene.validate import choice, flag, number, position3, unit3, vector3

# All that a plug-in needs; the second row is for fields of its classes: what they hold, the third: what checks them.
__all__ = [
    "Beam", "CustomLight", "CustomReflection", "ReflectionModel", "Registration", "add_light", "add_reflection",
    "class_of_light", "to_world",
    "Attenuation", "Color", "Shadow", "Vector",
    "checked_shadow", "choice", "flag", "linear_rgb", "number", "position3", "unit3", "vector3",
]  # fmt: skip

# ---------------------------------------------------------------- what a class says


class CustomLight:
    """Light of one's own: derive a frozen dataclass from it, with a field `color`, stored as linear RGB or a Spectrum.

    Its fields are annotated as `scene.lights.describe_fields` says: so the command line and scene files read them. It
    may have the fields `attached` ("world" or "camera") and `shadow` (Shadow or None), which mean what they mean to
    other lights. Its `__post_init__` checks them, SceneError.

    One of these two is a static method, which is compiled. It gets a point's unit normal and its position, three
    numbers each, and the array that `numbers` returns, in float64:

    share(normal, position, numbers) : how much of the colour is added to the ambient light there, at least 0: the
        material's `ambient` reflects it, to all sides
    arrival(normal, position, numbers) : the unit vector to the light, and how much of the colour arrives, at least 0:
        the reflection model does the rest

    Attributes
    ----------
    needs_position : False where the formula reads no position: then none is computed for it
    """

    def __reduce__(self) -> Any:
        """A copy in another process knows its type of light there."""
        return _restored, (light_type_of(self), type(self)), self.__dict__

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

    # What a light with a field `shadow` says beside: the engine's beam, world space; and the reference's position.
    beam: ClassVar[Callable[[Any, View], Beam] | None] = None

    def reference_position(self, frame: Any) -> Sequence[float] | NDArray | None:
        """Return where it shines from, world space, for the rays of its shadows; None = from infinitely far away."""
        return None


class CustomReflection:
    """A reflection model of one's own: how much of a light that arrives a surface sends to the viewer.

    reflect(normal, light_dir, view_dir, coefficients) : static method, which is compiled: unit vectors, three numbers
        each, and `coefficients.shininess`, `.roughness`, `.levels` and `.numbers` of the material, in float64;
        returns D and S, which the material's `diffuse` and `specular` are multiplied by. It isn't asked where
        N·L <= 0

    Attributes
    ----------
    needs_view : False where it reads no view_dir
    has_highlight : False where S is always 0
    model : what a material that names it may have: as default a roughness within 0..1, and no numbers of its own;
        `ReflectionModel(numbers=(0.5,))` has one, 0.5 where a material doesn't say another
    """

    needs_view: ClassVar[bool] = True
    has_highlight: ClassVar[bool] = True
    model: ClassVar[ReflectionModel] = ReflectionModel()
    reflect: ClassVar[Callable[..., Any]]

    def reference(self, materials: NDArray, normals: NDArray, light_dirs: NDArray, view_dirs: NDArray) -> tuple:
        """Return D and S, (n,) each, in plain numpy: the judge of `reflect`; of no meaning where N·L <= 0.

        Parameters
        ----------
        materials : (n,) records with the fields "shininess", "roughness", "levels", and "numbers", (n, 5)
        normals, light_dirs, view_dirs : (n, 3) float64, unit
        """
        raise NotImplementedError(f"{type(self).__name__} has no `reference`")


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
        field `shadow` without a `beam`; engine and reference that disagree
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
    compared = examples or agreement.make_examples(cls, described)
    return _enter(word, _tables_of_light(cls), "a light", lambda: agreement.compare_light(word, compared))


def _restored(word: str, cls: type[CustomLight]) -> Any:
    """Return what becomes a light of another process, whose type may be unknown here."""
    if word not in LIGHT_TYPES:
        _enter(word, _tables_of_light(cls), "a light", lambda: None)
    return object.__new__(cls)


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
    SceneError : a word that is taken; engine and reference that disagree
    """
    _check_class(cls, CustomReflection)
    tables = _tables_of_reflection(word, cls)
    return _enter(word, tables, "a reflection model", lambda: agreement.compare_reflection(word, cls))


def _tables_of_light(cls: type[CustomLight]) -> list[tuple[dict[str, Any], Any]]:
    """Return the tables that know types of lights, each with what stands there for the class."""
    return [(LIGHT_TYPES, cls), (LIGHT_TABLE, engine_lights.CustomEntry(cls)), (LAMP_TYPES, CustomLamp())]


def _tables_of_reflection(word: str, cls: type[CustomReflection]) -> list[tuple[dict[str, Any], Any]]:
    """Return the tables that know reflection models, each with what stands there for the class."""
    model = cls()

    def reflect(materials: NDArray, *vectors: NDArray) -> tuple:
        return (*model.reference(materials, *vectors[:3]), None)  # None: W(θ) is 1

    return [
        (REFLECTION_MODELS, cls.model._replace(enter=partial(_enter_reflection, word, cls))),
        (REFLECTION_TABLE, engine_reflections.CustomEntry(model)),
        (REFERENCE_MODELS, ReferenceModel(reflect)),
    ]


def _enter_reflection(word: str, cls: type[CustomReflection]) -> None:
    """Enter a reflection model that was compared in another process."""
    _enter(word, _tables_of_reflection(word, cls), "a reflection model", lambda: None)


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
    registration = Registration(word, [table for table, _ in entries])
    try:
        compare()
    except BaseException:
        registration.remove()
        raise
    return registration


def _check_class(cls: Any, base: type) -> None:
    """Raise SceneError where an argument is no class that derives from the one that it must derive from."""
    if not (isinstance(cls, type) and issubclass(cls, base) and cls is not base):
        raise SceneError(f"a class that derives from {base.__name__} is needed; given {shown(cls)}")
