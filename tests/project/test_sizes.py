"""Sizes that a reader can hold in mind: lines of functions and files, and how many loose values a function takes."""

import ast
import re

import pytest
from helpers.imports import PATHS, TREES

MOST_LINES = 400  # of a file
MOST_BODY = 60  # lines of a function, its docstring left out
MOST_LOOSE = 8  # parameters that are no structs

# Functions that may take more loose parameters, each with its reason.
MANY_PARAMETERS = {
    "renderer.render": "public: each option is a keyword that editors show",
    "renderer.Renderer.__init__": "as render",
    "reference.picture.render": "as render",
    "analysis.pixel.explain": "as render",
    "io.loader.load": "as render",
    "scene.camera.Camera.framing": "public: keywords with defaults",
    "engine.point_lighting.illuminate": "public: keywords with defaults",
    "options.Options.__init__": "what editors show of the fields",
    "scene.mesh.Mesh.__init__": "as Options",
}


def structs() -> set[str]:
    """The names that a parameter has which is a struct: those of the package's NamedTuples and dataclasses."""
    names = {"arguments", "options", "geometry", "messages"}
    for tree in TREES.values():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                names.add(re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", node.name.lstrip("_")).lower())
    return names


STRUCTS = structs()


def is_struct(parameter: ast.arg) -> bool:
    """Tell whether a parameter holds a struct: by its annotation, or by its name."""
    if parameter.annotation is not None:
        words = re.findall(r"\w+", ast.unparse(parameter.annotation))
        if any(re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", word).lower() in STRUCTS for word in words):
            return True
    name = parameter.arg
    endings = {name, name.removesuffix("s"), f"{name}s"}
    return any(end == struct or end.endswith(f"_{struct}") for end in endings for struct in STRUCTS)


def functions():
    """Every function of the package as (module, qualified name, node)."""
    for module, tree in TREES.items():
        waiting = [(module, node) for node in tree.body]
        while waiting:
            name, node = waiting.pop()
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                yield module, f"{name}.{node.name}", node
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                waiting += [(f"{name}.{node.name}", child) for child in node.body]
            elif isinstance(node, ast.If):
                waiting += [(name, child) for child in [*node.body, *node.orelse]]


def body_lines(node) -> int:
    """Lines of a function without its docstring."""
    n_line = node.end_lineno - node.lineno + 1
    first = node.body[0]
    is_docstring = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    return n_line - (first.end_lineno - first.lineno + 1 if is_docstring else 0)


def loose_parameters(node) -> list[str]:
    arguments = node.args
    every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    return [each.arg for each in every if each.arg not in ("self", "cls") and not is_struct(each)]


FOLDERS = sorted({module.split(".")[0] for module in PATHS})


def in_folder(module, folder) -> bool:
    return module.split(".")[0] == folder


@pytest.mark.parametrize("folder", FOLDERS)
def test_files_are_short(folder):
    lengths = {
        module: path.read_text(encoding="utf-8").count("\n")
        for module, path in PATHS.items()
        if in_folder(module, folder)
    }
    long = {module: f"{n_line} > {MOST_LINES} lines" for module, n_line in lengths.items() if n_line > MOST_LINES}
    assert not long


@pytest.mark.parametrize("folder", FOLDERS)
def test_functions_are_short(folder):
    long = {
        name: f"{body_lines(node)} > {MOST_BODY} lines"
        for module, name, node in functions()
        if in_folder(module, folder) and body_lines(node) > MOST_BODY
    }
    assert not long


@pytest.mark.parametrize("folder", FOLDERS)
def test_functions_take_few_loose_parameters(folder):
    many = {
        name: f"{len(loose_parameters(node))} > {MOST_LOOSE}: {', '.join(loose_parameters(node))}"
        for module, name, node in functions()
        if in_folder(module, folder) and len(loose_parameters(node)) > MOST_LOOSE and name not in MANY_PARAMETERS
    }
    assert not many
