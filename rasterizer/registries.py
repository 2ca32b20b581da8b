"""Lights, reflection models and file formats of one's own: one call enters a kind in every table that must know it.

    scene       what may be written            the command line and scene files read and write it
    engine      what is drawn, and the bounds  plan, uniforms, error bounds, shadow maps, Mach bands ask it
    reference   the same, slowly               tests and reports compare with it
    io          what files are read by         loading, the command line and every message ask it

    from rasterizer import registries

    registries.add_light("slab", SlabLight, drawn=SlabEntry(), reference=SlabKind())
    scene = rz.Scene(mesh, SlabLight(...))     # and `raster --light slab:...`, {"kind": "slab", ...}

Every call returns a `Registration`. It undoes the call: at the end of a `with` block, or by its method `remove`.

A registration holds for this process. What is pickled for another one needs the same registration there. Functions of
one's own that the pipeline calls are compiled in every process: the disk cache keeps only those of this package.
"""

import re
from dataclasses import fields, is_dataclass
from typing import Any

from .choices import BUFFERS, SAVED_ARRAYS
from .engine.buffers import BUFFER_TABLE, OutputBuffer
from .engine.lights import LIGHT_TABLE, LightEntry
from .engine.reflections import REFLECTION_TABLE, ReflectionEntry
from .errors import SceneError, shown
from .io.formats import FORMATS, Format, register
from .reference.lamp import LAMP_KINDS, LampKind
from .reference.reflection import REFLECTION_KINDS, ReflectionKind
from .scene.lights import LIGHT_KINDS, describe_fields
from .scene.material import REFLECTION_MODELS, ReflectionModel


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


def add_light(word: str, cls: type, *, drawn: LightEntry, reference: LampKind) -> Registration:
    """Enter a kind of light.

    Parameters
    ----------
    word : small letters, digits and hyphens: `kind` in scene files, KIND in `--light KIND:...`
    cls : frozen dataclass with a field `color`, stored as linear RGB or a Spectrum; its fields are annotated as
        `describe_fields` says. It may have the fields `attached` ("world" or "camera") and `shadow` (Shadow or None),
        which mean what they mean to the other lights. Its `__post_init__` checks them, SceneError
    drawn : what the engine must know
    reference : how the reference evaluates it

    Returns
    -------
    Registration

    Raises
    ------
    SceneError : a word or class that is taken, or a class that is no such dataclass; fields that nobody can read; a
        field `shadow` where the engine's entry has no `beam`
    """
    _check_type(drawn, LightEntry, "drawn")
    _check_type(reference, LampKind, "reference")
    if not (isinstance(cls, type) and is_dataclass(cls) and any(field.name == "color" for field in fields(cls))):
        raise SceneError(f"the class of a light must be a dataclass with a field color; given {shown(cls)}")
    if cls in LIGHT_KINDS.values():
        raise SceneError(f"{cls.__name__} is the class of another kind of light already")
    try:
        described = describe_fields(cls)
    except TypeError as fault:
        raise SceneError(f"the class of a light can't be read: {fault}") from fault
    is_alone = type(drawn).expand is LightEntry.expand  # no other lights stand for it
    if "shadow" in described and is_alone and type(drawn).beam is LightEntry.beam:
        raise SceneError(f"{cls.__name__} has a shadow, so its entry in the engine needs a beam")
    return _enter(word, [(LIGHT_KINDS, cls), (LIGHT_TABLE, drawn), (LAMP_KINDS, reference)], "a light")


def add_reflection(
    word: str, *, drawn: ReflectionEntry, reference: ReflectionKind, model: ReflectionModel | None = None
) -> Registration:
    """Enter a reflection model.

    Parameters
    ----------
    word : small letters, digits and hyphens: `Material.reflection`
    drawn : what the engine must know. Its function reflects nothing where N·L <= 0: it isn't asked where no point of a
        batch has more
    reference : how the reference evaluates it
    model : what a material checks; None = a roughness within 0..1 and nothing else

    Returns
    -------
    Registration

    Raises
    ------
    SceneError : a word that is taken
    """
    _check_type(drawn, ReflectionEntry, "drawn")
    _check_type(reference, ReflectionKind, "reference")
    model = ReflectionModel() if model is None else model
    _check_type(model, ReflectionModel, "model")
    entries = [(REFLECTION_MODELS, model), (REFLECTION_TABLE, drawn), (REFLECTION_KINDS, reference)]
    return _enter(word, entries, "a reflection model")


def add_format(entry: Format) -> Registration:
    """Enter a file format.

    Parameters
    ----------
    entry : its name, suffixes and reader, see `Format`

    Returns
    -------
    Registration

    Raises
    ------
    SceneError : a name or suffix that is taken
    """
    _check_type(entry, Format, "entry")
    register(entry)
    return Registration(entry.name, [FORMATS])


def _enter(word: str, entries: list[tuple[dict[str, Any], Any]], what: str) -> Registration:
    """Enter a word in all tables, or in none. SceneError where it is no word, or some table has it."""
    if not isinstance(word, str) or not re.fullmatch(r"[a-z][a-z0-9-]*", word):
        raise SceneError(f"the word for {what} must be small letters, digits and hyphens; given {shown(word)}")
    for table, _ in entries:
        if word in table:
            raise SceneError(f"there is {what} {word!r} already; taken are {', '.join(table)}")
    for table, entry in entries:
        table[word] = entry
    return Registration(word, [table for table, _ in entries])


def add_buffer(name: str, holds: str, *, drawn: OutputBuffer) -> Registration:
    """Enter an output buffer.

    Parameters
    ----------
    name : small letters, digits and hyphens: a name for `Options.outputs`, `Frame.array` and `--array`
    holds : what its numbers are, for the help text
    drawn : how it is written

    Returns
    -------
    Registration

    Raises
    ------
    SceneError : a name that is taken
    """
    _check_type(drawn, OutputBuffer, "drawn")
    if name in SAVED_ARRAYS:
        raise SceneError(f"every frame has an array {name!r}; taken are {', '.join((*SAVED_ARRAYS, *BUFFERS))}")
    return _enter(name, [(BUFFERS, holds), (BUFFER_TABLE, drawn)], "an output buffer")


def _check_type(value: Any, cls: type, name: str) -> None:
    """Raise SceneError where an argument is not of the class that it must be of."""
    if not isinstance(value, cls):
        raise SceneError(f"{name} must be a {cls.__name__}; given {shown(value)}")
