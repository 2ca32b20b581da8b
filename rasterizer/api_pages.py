"""Pages about the public names, made from their docstrings: `python -m rasterizer.api_pages FOLDER`.

    names ─┬─ docstrings to Markdown ─┬─ pdoc ─ FOLDER/index.html, rasterizer.html …
           └─ signatures as written  ─┘

pdoc (the extra `docs`) expects a type behind the name of a parameter. Docstrings have there what the parameter is:
shapes, spaces, units. So sections become Markdown here. Annotations are shown as the source has them: `ColorLike`, and
not all that it stands for. What classes store is told by their parameters, and not once more.
"""

import argparse
import ast
import inspect
import re
import sys
import textwrap
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any

from .version import __version__

# What public functions and attributes return without having a public name: where it stands.
RESULTS = {
    "Stats": "frame",
    "ErrorBounds": "engine.bounds",
    "ShadowBound": "engine.bounds",
    "FilterBound": "engine.bounds",
    "PlanSummary": "engine.plan_summary",
    "MaterialSummary": "engine.plan_summary",
    "PathCounts": "engine.plan_summary",
    "Batch": "batch.rendering",
    "RenderSummary": "batch.tasks",
    "Sample": "reference.explanation",
    "Layer": "reference.explanation",
    "LightShare": "reference.explanation",
}
# What lights, reflection models, buffers and formats of one's own are made of.
ENTRIES = {
    "Registration": "registries",
    "LightEntry": "engine.light_table",
    "LampKind": "reference.lamp",
    "ReflectionEntry": "engine.reflection_entry",
    "ReflectionKind": "reference.reflection",
    "ReflectionModel": "scene.material",
    "OutputBuffer": "engine.output_buffers",
    "Format": "io.formats",
    "describe_fields": "scene.fields",
}
REGISTRIES = ("add_buffer", "add_format", "add_light", "add_reflection")
REFERENCE = ("Picture", "coverage", "render")
PACKAGE = import_module(__package__)
PUBLIC = tuple(name for name in PACKAGE.__all__ if name != "__version__")


def main(argv: list[str] | None = None) -> int:
    """Write the pages.

    Parameters
    ----------
    argv : list of text, the arguments; None = those of the process

    Returns
    -------
    int, the exit code: 0 done, 2 pdoc is missing
    """
    parser = argparse.ArgumentParser(prog="python -m rasterizer.api_pages", description="Write the pages of the API.")
    parser.add_argument("folder", type=Path, help="where to; it is made, and index.html in it is the first page")
    folder = parser.parse_args(argv).folder
    try:
        pages = make_pages()
    except ModuleNotFoundError as error:
        if error.name != "pdoc":
            raise
        print("rasterizer.api_pages: error: pdoc is missing: pip install 'scanline-rasterizer[docs]'", file=sys.stderr)
        return 2
    for name, text in pages.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    print(folder / "index.html")
    return 0


def make_pages() -> dict[str, str]:
    """Make all pages: the name of each file, and what it holds."""
    import pdoc

    pdoc.render.configure(docformat="markdown", show_source=False, footer_text=f"rasterizer {__version__}")
    modules = {
        each.modulename: each
        for each in (
            _describe_module("rasterizer", dict.fromkeys(PUBLIC, ""), RESULTS),
            _describe_module("rasterizer.registries", dict.fromkeys(REGISTRIES, "registries"), ENTRIES),
            _describe_module("rasterizer.reference", dict.fromkeys(REFERENCE, "reference"), {}),
        )
    }
    modules["rasterizer"].submodules = [module for name, module in modules.items() if name != "rasterizer"]
    pages = {f"{name.replace('.', '/')}.html": pdoc.render.html_module(each, modules) for name, each in modules.items()}
    return {
        "index.html": pdoc.render.html_index(modules),
        "search.js": pdoc.render.search_index(modules),
        **pages,
    }


# --- what pdoc is told of each name -------------------------------------------------------------------------


def _describe_module(name: str, own: dict[str, str], more: dict[str, str]) -> Any:
    """Describe a module: its names, and others that belong to its page, each with the module where it is found."""
    import pdoc

    module = pdoc.doc.Module(import_module(name))
    module.docstring = to_markdown(inspect.getdoc(module.obj) or "")
    members: dict[str, Any] = {}
    for each, home in {**own, **more}.items():
        value = getattr(import_module(f"{__package__}.{home}" if home else __package__), each)
        kind = pdoc.doc.Class if inspect.isclass(value) else pdoc.doc.Function
        members[each] = doc = kind(name, each, value, (name, each))
        if inspect.isclass(value):
            _describe_class(doc, f"It stands in `rasterizer.{home}`." if each in more else "")
        else:
            _describe_function(doc)
    module.members, module.own_members, module.submodules = members, list(members.values()), []
    return module


def _describe_class(doc: Any, note: str) -> None:
    """Give a class the text of its own, the constructor its parameters, and both only what a user may call."""
    before, sections = _halves(inspect.getdoc(doc.obj) or "")
    doc.decorators, doc.inherited_members = [], {}
    doc.bases = [base for base in doc.bases if base[0] == "builtins" or base[2] in PUBLIC]
    found = [each for name, each in doc.members.items() if _is_shown(doc.obj, name)]
    for each in found:
        if each.kind == "function":
            _describe_function(each)
        else:
            each.docstring = to_markdown(each.docstring)
            each.annotation = _named(_definition(_getter(doc.obj, each.name)).returns)
    constructor = doc.members.get("__init__")
    if doc.name in RESULTS:
        sections = re.sub(r"^Parameters\n-+", "Attributes\n----------", sections)
    is_made_by_users = sections.startswith("Parameters\n") or "Parameters are those of" in before
    if constructor is not None and is_made_by_users:
        constructor.signature = constructor.signature_without_self = _constructor_signature(doc.obj)
        constructor.docstring, constructor.decorators = to_markdown(sections), []
        found.insert(0, constructor)
        sections = ""
    doc.docstring = "\n\n".join((to_markdown(before), note, to_markdown(sections)))
    doc.members, doc.own_members = {each.name: each for each in found}, found  # links lead to these alone


def _describe_function(doc: Any) -> None:
    """Give a function or method its text, and its signature as written."""
    doc.docstring = to_markdown(doc.docstring)
    doc.decorators = ["@classmethod"] if doc.is_classmethod else []
    doc.signature = _signature(inspect.signature(doc.obj), _definition(doc.obj))


def _is_shown(cls: type, name: str) -> bool:
    """Tell whether a member of a class is for its users: a method or property of this package with a docstring."""
    owner = next((base for base in cls.__mro__ if name in vars(base)), object)
    if name.startswith("_") or not owner.__module__.startswith("rasterizer"):
        return False
    value = vars(owner)[name]
    return isinstance(value, (property, cached_property, classmethod, staticmethod, FunctionType)) and bool(
        inspect.getdoc(value)
    )


def _getter(cls: type, name: str) -> Any:
    """Return the function behind a property."""
    value: Any = inspect.getattr_static(cls, name)
    return value.func if isinstance(value, cached_property) else value.fget


# --- signatures ---------------------------------------------------------------------------------------------


_PAGES = {**dict.fromkeys([*PUBLIC, *RESULTS], "rasterizer"), **dict.fromkeys(ENTRIES, "rasterizer.registries")}
_LINKED = re.compile(rf"(?<![\w.'\"])({'|'.join(_PAGES)})(?![\w.'\"])")


class _Text(str):
    """An annotation as it is written: shown without quotes."""

    def __repr__(self) -> str:
        return str(self)


def _definition(function: Any) -> Any:
    """Return the node of the syntax tree that defines a function."""
    return ast.parse(textwrap.dedent(inspect.getsource(inspect.unwrap(function)))).body[0]


def _constructor_signature(cls: type) -> inspect.Signature:
    """Return what a class may be called with: its __init__, that which editors see, or the fields of a dataclass."""
    nodes = list(ast.walk(ast.parse(textwrap.dedent(inspect.getsource(cls)))))
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef) and node.name == "__init__"]
    real = inspect.signature(cls).replace(return_annotation=inspect.Signature.empty)
    if functions:
        return _signature(real, functions[0])
    written = {node.target.id: node.annotation for node in nodes if isinstance(node, ast.AnnAssign)}
    return _annotated(real, written)


def _signature(real: inspect.Signature, definition: Any) -> inspect.Signature:
    """Return a signature with the annotations of its definition."""
    arguments = definition.args
    every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg]
    signature = _annotated(real, {each.arg: each.annotation for each in every if each is not None})
    if real.return_annotation is inspect.Signature.empty:
        return signature
    return signature.replace(return_annotation=_named(definition.returns))


def _annotated(signature: inspect.Signature, written: dict[str, Any]) -> inspect.Signature:
    """Return a signature with other annotations; parameters that nothing is written of keep none."""
    empty = inspect.Parameter.empty
    return signature.replace(
        parameters=[
            each.replace(annotation=_named(written[name]) if written.get(name) is not None else empty)
            for name, each in signature.parameters.items()
        ]
    )


def _named(node: Any) -> Any:
    """Return an annotation as text, in which public names are links."""
    if node is None:
        return inspect.Signature.empty
    text = node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ast.unparse(node)
    return _Text(_LINKED.sub(lambda match: f"{_PAGES[match[0]]}.{match[0]}", text))


# --- docstrings ---------------------------------------------------------------------------------------------

_TITLE = re.compile(r"^([A-Z][A-Za-z ]+)\n-{3,}\n", re.MULTILINE)
_LISTS = ("Parameters", "Attributes", "Raises", "Warns")


def to_markdown(text: str) -> str:
    """Turn a docstring into Markdown: sections into lists, examples into code, formulas into plain text.

    Parameters
    ----------
    text : docstring without the indentation of its source; entries of sections are `name : what it is`

    Returns
    -------
    text
    """
    first, *rest = _TITLE.split(text)
    parts = [_prose(first)]
    for title, content in zip(rest[::2], rest[1::2], strict=True):
        entries, _, behind = content.partition("\n\n")
        parts += [f"###### {title}", _entries(entries) if title in _LISTS else _prose(textwrap.dedent(entries))]
        parts.append(_prose(behind))
    return "\n\n".join(part for part in parts if part)


def _halves(text: str) -> tuple[str, str]:
    """Return what stands before the first section, and the rest."""
    match = _TITLE.search(text)
    return (text[: match.start()], text[match.start() :]) if match else (text, "")


def _entries(text: str) -> str:
    """Return the entries of a section as a list: the name, and what is said of it in one line."""
    found = []
    for each in re.findall(r"^\S.*(?:\n[ \t]+.*)*", text, re.MULTILINE):
        name, colon, said = " ".join(each.split()).partition(" : ")
        found.append(f"- **{name}**: {_plain(said)}" if colon else f"- {_plain(name)}")
    return "\n".join(found)


def _prose(text: str) -> str:
    """Return paragraphs as they are, and indented ones as code."""
    parts = []
    for paragraph in re.split(r"\n\s*\n", text.strip("\n")):
        if paragraph.startswith("    "):
            language = "python" if "rz." in paragraph or "import " in paragraph else "text"
            parts.append(f"```{language}\n{textwrap.dedent(paragraph)}\n```")
        else:
            parts.append(_plain(paragraph))
    return "\n\n".join(parts).strip()


def _plain(text: str) -> str:
    """Keep stars and angle brackets of formulas from being marks; what stands between backquotes is code already."""
    spans = re.split(r"(`[^`]*`)", text)
    return "".join(
        each if each.startswith("`") else each.replace("*", r"\*").replace("<", "&lt;").replace("_", r"\_")
        for each in spans
    )


if __name__ == "__main__":
    sys.exit(main())
