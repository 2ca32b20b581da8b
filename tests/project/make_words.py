"""Write rasterizer/words.pyi: what functions take as **words, as type checkers read it, of the fields of dataclasses.

    python tests/project/make_words.py

A field's annotation says what may be given; `Annotated[stored, "given"]` where something else is stored.
"""

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "rasterizer"
HEAD = '''"""The keywords of `render`, for type checkers: tests/project/make_words.py makes them of fields."""

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, TypedDict

from numpy.typing import ArrayLike

'''
CLASS = '''
class {}, total=False):
    """{}"""
'''


def words_of(tree: ast.Module, cls: str, keep=lambda _name: True) -> tuple[str, set[str]]:
    """Return the fields of a dataclass, a line each, and the names in their annotations."""
    (node,) = (each for each in tree.body if isinstance(each, ast.ClassDef) and each.name == cls)
    lines, names = ["\n"], set()
    for field in (each for each in node.body if isinstance(each, ast.AnnAssign) and keep(each.target.id)):
        given = field.annotation
        if isinstance(given, ast.Subscript) and ast.unparse(given.value) == "Annotated":
            given = ast.parse(given.slice.elts[1].value, mode="eval").body
        lines.append(f"    {field.target.id}: {ast.unparse(given).replace(chr(39), chr(34))}\n")
        names |= {each.id for each in ast.walk(given) if isinstance(each, ast.Name)}
    return "".join(lines), names


def text() -> str:
    """Return what the file must hold."""
    options, appearance, viewpoint = trees = [
        ast.parse((PACKAGE / f"{name}.py").read_text(encoding="utf-8"))
        for name in ("options", "appearance", "viewpoint")
    ]
    groups = [
        ("OptionWords(TypedDict", "Fields of `Options`.", words_of(options, "Options", lambda name: name != "size")),
        ("AppearanceWords(TypedDict", "Fields of `Appearance`.", words_of(appearance, "Appearance")),
        (
            "ViewpointWords(TypedDict",
            "Fields of `Viewpoint`.",
            words_of(viewpoint, "Viewpoint", lambda name: name != "camera"),
        ),
        (
            "ViewWords(ViewpointWords",
            "All fields of `Viewpoint`.",
            words_of(viewpoint, "Viewpoint", lambda name: name == "camera"),
        ),
        ("SceneWords(AppearanceWords, OptionWords", "What `Renderer` takes.", ("", set())),
        ("RenderWords(ViewWords, SceneWords", "What `render` takes.", ("", set())),
    ]
    wanted = set().union(*(names for _, _, (_, names) in groups))
    homes: dict[str, set[str]] = {}
    for each in (node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level):
        homes.setdefault(each.module, set()).update({alias.name for alias in each.names} & wanted)
    imports = [f"from .{home} import {', '.join(sorted(names))}\n" for home, names in sorted(homes.items()) if names]
    return HEAD + "".join(imports) + "".join(CLASS.format(name, what) + lines for name, what, (lines, _) in groups)


if __name__ == "__main__":
    (PACKAGE / "words.pyi").write_text(text(), encoding="utf-8")
