"""Which module of the package imports which, read from the source: nothing is run."""

import ast
from pathlib import Path
from typing import NamedTuple

import rasterizer

PACKAGE = Path(rasterizer.__file__).parent


class Import(NamedTuple):
    """One import statement's view of one module."""

    name: str  # dotted, "scene.mesh" for the package's own modules, "numpy" or "rasterizer.x" as written for others
    line: int
    is_own: bool  # a module of this package
    function: str | None  # the function that it stands in; None at the top of the module
    is_for_types: bool  # under `if TYPE_CHECKING:`


def module_name(path: Path) -> str:
    """Return the dotted name below the package: "scene.mesh", "cli" for a folder, "" for the package itself."""
    parts = list(path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


PATHS = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in PATHS.items()}


def imports_of(name: str) -> list[Import]:
    """Return everything that a module imports, in functions and for types too."""
    found = []

    def visit(node, function, is_for_types):
        if isinstance(node, ast.Import):
            found.extend(_absolute(alias.name, node.lineno, function, is_for_types) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            found.extend(_from(name, node, function, is_for_types))
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            function = f"{function}.{node.name}" if function else node.name
        for child in ast.iter_child_nodes(node):
            is_guarded = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test) and child in node.body
            visit(child, function, is_for_types or is_guarded)

    visit(TREES[name], None, False)
    return found


def _absolute(target, line, function, is_for_types) -> Import:
    own = target.removeprefix("rasterizer").lstrip(".")
    is_own = target.split(".")[0] == "rasterizer"
    return Import(own if is_own else target, line, is_own, function, is_for_types)


def _from(name, node, function, is_for_types) -> list[Import]:
    """The modules that `from x import a, b` reads: x.a where that is a module, else x."""
    if not node.level:
        return [_absolute(node.module, node.lineno, function, is_for_types)]
    is_folder = PATHS[name].name == "__init__.py"
    parts = name.split(".") if name else []
    base = parts[: len(parts) - node.level + (1 if is_folder else 0)]
    home = ".".join([*base, *(node.module.split(".") if node.module else [])])
    names = [f"{home}.{alias.name}".lstrip(".") for alias in node.names]
    targets = [each if each in PATHS else home for each in names]
    return [Import(target, node.lineno, True, function, is_for_types) for target in dict.fromkeys(targets)]


def private_imports(name: str) -> list[tuple[str, str]]:
    """Return the names that begin with an underscore and are imported from another folder, each with where from."""
    found = []
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.ImportFrom) and node.level:
            (target, *_) = _from(name, node, None, False)
            names = [*target.name.split("."), *(alias.name for alias in node.names)]
            if target.name.split(".")[0] != name.split(".")[0]:
                found += [(target.name, each) for each in names if each.startswith("_") and not each.endswith("__")]
    return found


def own_imports(name: str) -> set[str]:
    """Return the package's own modules that a module imports when it runs, or in a function of it."""
    return {each.name for each in imports_of(name) if each.is_own and not each.is_for_types and each.name in PATHS}


def reached_from(name: str) -> set[str]:
    """Return the package's own modules that a module imports, and those that these import, and so on."""
    reached, waiting = set(), [name]
    while waiting:
        new = own_imports(waiting.pop()) - reached
        reached |= new
        waiting += new
    return reached


def way_to(name: str, target: str) -> str:
    """Return a chain of imports from one module to another, for messages."""
    ways, waiting = {name: name}, [name]
    while waiting:
        at = waiting.pop(0)
        for each in sorted(own_imports(at) - ways.keys()):
            ways[each] = f"{ways[at]} > {each}"
            waiting.append(each)
    return ways.get(target, f"{name} > ? > {target}")
