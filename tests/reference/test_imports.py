"""What the reference and the scene import, followed through every module, also where a function does it."""

import ast
from pathlib import Path

import rasterizer

PACKAGE = Path(rasterizer.__file__).parent
COMPILED = {"numba", "llvmlite"}


def module_path(name) -> Path | None:
    """The file of a module of the package, given by its dotted name."""
    path = PACKAGE.parent.joinpath(*name.split("."))
    return next((each for each in (path.with_suffix(".py"), path / "__init__.py") if each.is_file()), None)


def imports_of(name) -> set[str]:
    """The dotted names of all that a module imports."""
    path = module_path(name)
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else []
            base = ".".join([*base, *([node.module] if node.module else [])])
            found |= {f"{base}.{alias.name}" if module_path(f"{base}.{alias.name}") else base for alias in node.names}
    return found


def reached_from(folder) -> set[str]:
    """All that the modules of a folder import, and what is imported there in turn."""
    waiting = {
        f"rasterizer.{folder}.{path.stem}" for path in (PACKAGE / folder).glob("*.py") if path.stem != "__init__"
    }
    reached = set()
    while waiting:
        name = waiting.pop()
        reached.add(name)
        if module_path(name) is not None:
            waiting |= imports_of(name) - reached
    return reached


def layers_of(reached) -> set[str]:
    """The folders, and the modules beside them, that are reached."""
    return {name.split(".")[1] for name in reached if name.startswith("rasterizer.")}


def test_the_reference_reaches_nothing_compiled():
    reached = reached_from("reference")
    assert "rasterizer.scene.mesh" in reached and "numpy" in reached
    assert layers_of(reached) <= {"reference", "scene", "options", "errors", "keywords", "choices", "cores"}
    assert not COMPILED & {name.split(".")[0] for name in reached}


def test_the_scene_reaches_only_itself():
    reached = reached_from("scene")
    assert layers_of(reached) <= {"scene", "errors", "keywords", "choices"}
    assert not COMPILED & {name.split(".")[0] for name in reached}


def test_geometry_reaches_only_the_scene_and_the_compiler():
    assert layers_of(reached_from("geometry")) <= {
        "geometry",
        "scene",
        "compiler",
        "errors",
        "keywords",
        "choices",
        "cores",
    }
