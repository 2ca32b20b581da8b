"""The errors that the package raises, one small tree, and what its messages are made of.

RasterizerError
├── ModelError    a model that can't be read, is empty or is broken       (also a ValueError)
├── SceneError    an argument, light, material, camera or option that is not legal  (also a ValueError)
│   ├── OptionError   a keyword that a function doesn't have                        (also a TypeError)
│   └── MissingArray  an array that a frame was not asked for; it stands in frame.py  (also an AttributeError)
└── OutputError   a picture or buffer that could not be written           (also an OSError)
"""

import reprlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import import_module
from pathlib import Path
from types import FrameType, ModuleType


class RasterizerError(Exception):
    """Base of every error that this package raises on purpose."""


class ModelError(RasterizerError, ValueError):
    """A model can't be read, is empty, or is broken; the message names the file, the line where there is one, and the
    fault.

    Attributes
    ----------
    is_internal : bool, whether the fault is this package's, not the model's
    """

    is_internal: bool = False


class SceneError(RasterizerError, ValueError):
    """An argument is not legal; the message says what was given and what is legal."""


class OptionError(SceneError, TypeError):
    """A function was given a keyword that it doesn't have; the message names the nearest one that it has.

    It is a TypeError, too, because Python's own error for such a keyword is one.
    """


class OutputError(RasterizerError, OSError):
    """A picture or buffer could not be written."""


def internal_error(name: str, fault: Exception) -> ModelError:
    """Make the error that stands for a fault of this package, met at one model; raised, it has the fault as its
    `__cause__`."""
    text = " ".join(str(fault).split())[:200]
    what = f"{type(fault).__name__}: {text}" if text else type(fault).__name__
    error = ModelError(f"{name}: internal error: {what} (run with -v for the traceback, and please report it)")
    error.is_internal = True
    return error


def error_of(name: str, fault: Exception) -> RasterizerError:
    """Return what is said of whatever went wrong at one model: an error of this package as it is, else one that stands
    for it."""
    if isinstance(fault, RasterizerError):
        return fault
    if isinstance(fault, MemoryError):
        return SceneError(f"not enough memory for {name}" + (f": {fault}" if str(fault) else ""))
    return internal_error(name, fault)


@contextmanager
def one_file(name: str) -> Iterator[None]:
    """Turn what gets out of reading one file, and is no error of ours, into a ModelError that names the file."""
    try:
        yield
    except (RasterizerError, Warning):  # a caller may have made errors of warnings
        raise
    except MemoryError as fault:
        raise ModelError(f"{name}: needs more memory than there is") from fault
    except RecursionError as fault:
        raise ModelError(f"{name}: is nested too deeply") from fault
    except Exception as fault:  # a fault of this package, which must not stop a program that reads many files
        raise internal_error(name, fault) from fault


@contextmanager
def named_in_errors(what: object) -> Iterator[None]:
    """Begin the message of a fault inside the block with what it is about."""
    try:
        yield
    except (ModelError, SceneError) as fault:
        named = type(fault)(f"{what}: {cut(fault, 400)}")
        vars(named).update(vars(fault))  # whether it is internal
        raise named from fault


@contextmanager
def faults_of(whose: str) -> Iterator[None]:
    """Turn what gets out of code that isn't this package's, and is no error of ours, into a SceneError that names
    whose it is."""
    try:
        yield
    except RasterizerError:
        raise
    except Exception as fault:
        raise SceneError(f"{whose} failed: {type(fault).__name__}: {cut(fault)}") from fault


def warn_caller(text: str) -> None:
    """Warn of what a user can change; the warning points at the line outside of this package that led to it. Inside of
    `collected_warnings` it is kept instead."""
    collected = _collected.get()
    if collected is not None:
        collected.extend([text] * (text not in collected))
        return
    import warnings

    level = 1
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] in _INSIDE:
        level, frame = level + 1, frame.f_back
    warnings.warn(text, UserWarning, stacklevel=level + 1)


_collected: ContextVar[list[str] | None] = ContextVar("collected", default=None)


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """Yield a list that gets the texts that this package warns of inside the block, each once. Filters of warnings,
    which all threads of a process share, stay what they are."""
    texts: list[str] = []
    token = _collected.set(texts)
    try:
        yield texts
    finally:
        _collected.reset(token)


# Between a user's line and ours stand calls of the standard library: of `replace`, context managers, finalizers.
_INSIDE = (__name__.partition(".")[0], "dataclasses", "contextlib", "weakref")


# --- extras of the package, which pip installs -----------------------------------------------------------------


def install_command(extra: str) -> str:
    """Return the command that installs an extra: of a checkout, where this is one, as no index has that."""
    root = Path(__file__).resolve().parents[1]
    what = f"-e '{root}" if (root / "setup.cfg").exists() else "'scanline-rasterizer"
    return f"pip install {what}[{extra}]'"


def import_extra(module: str, extra: str, what: str, error: type[RasterizerError] = RasterizerError) -> ModuleType:
    """Return a module that an extra brings; `error` where it is missing. The message begins with `what`, which needs
    it."""
    try:
        return import_module(module)
    except ImportError as fault:
        raise error(f"{what} needs {module.partition('.')[0]}: {install_command(extra)} ({fault})") from fault


# --- what is given, in a message -----------------------------------------------------------------------------


def shown(value: object) -> str:
    """Return `repr(value)`, cut to a length that fits a message; of something large only the beginning is looked at."""
    try:
        text = _SHORT.repr(value)
    except (ValueError, RecursionError):  # a whole number of thousands of digits
        text = f"<{type(value).__name__}>"
    text = " ".join(text.split())
    return text if len(text) <= 80 else text[:77] + "..."


def cut(text: object, length: int = 200) -> str:
    """Return a text on one line, without what a terminal would obey, and its middle left out where it is longer than
    `length` letters."""
    letters = str(text)
    if len(letters) > length:
        letters = f"{letters[: length // 2]} ... {letters[-(length // 2 - 5) :]}"
    return " ".join("".join(each if each.isprintable() else " " for each in letters).split())


def counted(n: int, noun: str) -> str:
    """Return a number with what is counted, as "1 face", "2 faces"."""
    plural = {"mesh": "meshes", "vertex": "vertices", "property": "properties"}.get(noun, f"{noun}s")
    return f"{n} {noun if n == 1 else plural}"


_SHORT = reprlib.Repr()  # writes the beginning of a value: enough for a message
vars(_SHORT).update(maxlevel=5, maxstring=400, maxlong=400, maxother=400)
for _kind in ("dict", "list", "tuple", "set", "frozenset", "deque", "array"):
    setattr(_SHORT, f"max{_kind}", 40)
