"""Docstrings of everything that users see: they are there, and tell shapes and types of arrays, and errors."""

import ast
import inspect
import re
import textwrap
from functools import cache, cached_property
from importlib import import_module

import pytest

import rasterizer as rz
from rasterizer.api_pages import ENTRIES, REFERENCE, REGISTRIES, RESULTS

ERRORS = {"RasterizerError", "SceneError", "OptionError", "ModelError", "OutputError"}
SHAPE = r"\((\.\.\.|[\w.]+)( \+ 1)?(, ?[^()]*|,)?\)"  # (n, 3), (n + 1,), (...), (h, w, 2: grey and alpha)
# What can't be raised, because it has been checked before.
NEVER = {
    "Camera.view": "position, target and up are checked where the camera is made",
    "Camera.pose": "as Camera.view",
}


def shown():
    """Everything on the pages of the API: its qualified name, the class that it belongs to or None, and itself."""
    homes = {name: "" for name in rz.__all__ if name != "__version__"} | RESULTS | ENTRIES
    homes |= dict.fromkeys(REGISTRIES, "registries")
    found = {name: getattr(import_module(f"rasterizer.{home}" if home else "rasterizer"), name)
             for name, home in homes.items()}  # fmt: skip
    found |= {f"reference.{name}": getattr(import_module("rasterizer.reference"), name) for name in REFERENCE}
    for name, value in found.items():
        yield name, None, value
        for key in dir(value) if inspect.isclass(value) else ():
            owner = next((base for base in value.__mro__ if key in vars(base)), object)
            member = vars(owner).get(key)
            is_named = not key.startswith("_") and owner.__module__.startswith("rasterizer.")
            if is_named and isinstance(member, (property, cached_property, classmethod, type(shown))):
                yield f"{name}.{key}", value, member


SHOWN = {name: (owner, value) for name, owner, value in shown()}
CALLED = [name for name, (_, value) in SHOWN.items() if not inspect.isclass(value)]


def function_of(value):
    """The function behind a method, a property or a class: that which checks its fields, for a dataclass."""
    if inspect.isclass(value):
        value = getattr(value, "__post_init__", None) or vars(value).get("__new__") or vars(value).get("__init__")
    value = getattr(value, "fget", None) or getattr(value, "func", None) or getattr(value, "__func__", value)
    return inspect.unwrap(value)


def text_of(name) -> str:
    """What the pages say of a name; of a property also what its class says."""
    owner, value = SHOWN[name]
    text = inspect.getdoc(value) or ""
    if isinstance(value, (property, cached_property)):
        text += f"\n{inspect.getdoc(owner)}"
    return text


@pytest.mark.parametrize("name", SHOWN)
def test_it_has_a_docstring_that_begins_with_a_sentence(name):
    text = inspect.getdoc(SHOWN[name][1]) or ""
    assert re.match(r"[A-Z(]", text), f"{name}: {text[:40]!r}"
    assert re.search(r"[.:…]\)?(\s|$)|\n\n", text), f"{name}: {text[:40]!r} is no sentence"


# --- arrays -------------------------------------------------------------------------------------------------


def written(value) -> ast.FunctionDef:
    return ast.parse(textwrap.dedent(inspect.getsource(function_of(value)))).body[0]


def is_array(node) -> bool:
    return node is not None and re.search(r"NDArray|ndarray|ArrayLike", ast.unparse(node)) is not None


def said_of(text, parameter) -> str:
    """What a docstring says of a parameter: its entry, or all of the text where it is described in prose."""
    entry = re.search(rf"^(?:\w+, )*{parameter}(?:, \w+)* : (.*(?:\n +.*)*)", text, re.MULTILINE)
    return entry[1] if entry else text


@pytest.mark.parametrize("name", CALLED)
def test_arrays_that_it_takes_have_a_shape(name):
    node, text = written(SHOWN[name][1]), text_of(name)
    for each in [*node.args.args, *node.args.kwonlyargs]:
        if is_array(each.annotation):
            assert re.search(SHAPE, said_of(text, each.arg)), f"{name}: which shape has {each.arg}?"


@pytest.mark.parametrize("name", CALLED)
def test_arrays_that_it_returns_have_a_shape_and_a_type(name):
    text = text_of(name)
    if is_array(written(SHOWN[name][1]).returns):
        assert re.search(SHAPE, text), f"{name}: which shape?"
        assert re.search(r"\b(float|u?int)\d+|\bbool\b|`?dtype`?", text), f"{name}: which dtype?"


# --- errors -------------------------------------------------------------------------------------------------


@cache
def functions_in(module) -> dict[str, ast.FunctionDef]:
    nodes = ast.walk(ast.parse(inspect.getsource(import_module(module))))
    return {node.name: node for node in nodes if isinstance(node, ast.FunctionDef)}


def errors_of(node, module, seen) -> set[str]:
    """Errors that a function raises: itself, or in what it calls of its own module or class, or of `scene/`."""
    found = set()
    for each in ast.walk(node):
        if isinstance(each, ast.Raise) and each.exc is not None:
            error = each.exc.func if isinstance(each.exc, ast.Call) else each.exc
            found |= {error.id} & ERRORS if isinstance(error, ast.Name) else set()
        if isinstance(each, ast.Call):
            for home, called in called_by(each.func, module):
                if (home, called.name) not in seen:
                    seen.add((home, called.name))
                    found |= errors_of(called, home, seen)
    return found


def called_by(node, module):
    """The functions that an expression may call, each with its module; none where that isn't known."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("self", "cls"):
        name, home = node.attr, module
    elif isinstance(node, ast.Name):
        name, value = node.id, getattr(import_module(module), node.id, None)
        home = value.__module__ if inspect.isfunction(value) else module
    else:
        return []
    is_near = home == module or home.startswith("rasterizer.scene.")
    return [(home, functions_in(home)[name])] if is_near and name in functions_in(home) else []


@pytest.mark.parametrize("name", SHOWN)
def test_the_errors_that_it_raises_are_told(name):
    value = SHOWN[name][1]
    function, text = function_of(value), text_of(name)
    if name in NEVER or not inspect.isfunction(function) or not function.__code__.co_filename.endswith(".py"):
        return  # a class that checks nothing
    if inspect.isclass(value) and "Parameters\n---" not in text:
        return  # made by the package itself
    raised = errors_of(written(value), function.__module__, set())
    is_by_reference = re.search(r"errors (are|as)\b", text)
    missing = {error for error in raised if error not in text and not is_by_reference}
    assert not missing, f"{name} doesn't say when it raises {sorted(missing)}"


def test_the_exceptions_are_needed():
    for name in NEVER:
        value = SHOWN[name][1]
        assert errors_of(written(value), function_of(value).__module__, set())


def test_the_rules_find_what_they_look_for():
    assert errors_of(functions_in("rasterizer.scene.spectrum")["scaled"], "rasterizer.scene.spectrum", set())
    assert not re.search(SHAPE, "places in the world (as they are, in scene units)")
    assert (
        re.search(SHAPE, "(..., 3) numbers") and re.search(SHAPE, "(n,) float64") and re.search(SHAPE, "(n_mesh + 1,)")
    )
