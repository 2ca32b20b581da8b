"""The public names: complete, sorted, lazily imported, documented, typed."""

import ast
import inspect
import re
import subprocess
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest

import rasterizer as rz

PACKAGE = Path(rz.__file__).parent
PUBLIC = [name for name in rz.__all__ if name != "__version__"]


def run_python(code) -> str:
    command = [sys.executable, "-c", code]
    return subprocess.run(command, capture_output=True, text=True, cwd=PACKAGE.parent, check=True).stdout.strip()


def test_all_is_complete_and_sorted():
    assert rz.__all__ == sorted(rz.__all__) and len(set(rz.__all__)) == len(rz.__all__)
    assert set(dir(rz)) == set(rz.__all__)
    for name in PUBLIC:
        value = getattr(rz, name)
        assert inspect.isclass(value) or inspect.isfunction(value), name
        assert value.__name__ == name and value.__module__.startswith("rasterizer.")
    assert re.fullmatch(r"\d+\.\d+\.\d+.*", rz.__version__)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        rz.nonsense  # noqa: B018


def test_names_do_not_depend_on_the_order_of_imports():
    code = (
        "import rasterizer as rz\n"
        "import rasterizer.analysis.comparison, rasterizer.analysis.contact_sheet\n"
        "from rasterizer.analysis.comparison import Comparison\n"
        "rz.Renderer\n"
        "print(all(map(callable, (rz.render, rz.compare, rz.sheet))), Comparison is rz.Comparison)"
    )
    assert run_python(code) == "True True"


def test_importing_the_package_is_cheap():
    code = "import sys, rasterizer; print(sorted({'numpy', 'numba', 'PIL', 'trimesh'} & set(sys.modules)))"
    assert run_python(code) == "[]"


def test_importing_load_imports_no_trimesh():
    code = "import sys, rasterizer as rz; rz.render; rz.load; print('trimesh' in sys.modules)"
    assert run_python(code) == "False"


# --- documented ---------------------------------------------------------------------------------------------


def public_callables():
    """Every public function, class and public method, with its qualified name."""
    for name in PUBLIC:
        value = getattr(rz, name)
        yield name, value
        if inspect.isclass(value):
            for key, member in vars(value).items():
                function = getattr(member, "__func__", member)
                if not key.startswith("_") and inspect.isfunction(function):
                    yield f"{name}.{key}", function


def section(doc, title) -> str | None:
    """The text of a section of a docstring."""
    match = re.search(rf"^{title}\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", doc, re.MULTILINE | re.DOTALL)
    return match and match.group(1)


def documented(doc) -> dict[str, str]:
    """Names out of the section Parameters, each with what is said of it."""
    found = {}
    for names, text in re.findall(r"^(\w[\w, ]*?) : (.*(?:\n(?: .*|$))*)", section(doc, "Parameters"), re.MULTILINE):
        found |= dict.fromkeys(re.split(r",\s*", names), text.strip())
    return found


def parameters(value) -> list[str]:
    try:
        names = inspect.signature(value).parameters
    except ValueError:
        return []
    return [name for name in names if name not in ("self", "cls", "args", "kwargs")]


CALLABLES = dict(public_callables())


@pytest.mark.parametrize("name", CALLABLES)
def test_each_parameter_is_documented_and_exists(name):
    value = CALLABLES[name]
    doc = inspect.getdoc(value) or ""
    assert doc and doc[0].isupper(), f"{name} needs a docstring that begins with a sentence"
    names = parameters(value)
    if section(doc, "Parameters") is not None:
        said = documented(doc)
        assert set(said) == set(names)
        assert all(said.values())
    elif inspect.isclass(value) and section(doc, "Attributes") is not None:
        return  # made by the package itself, not by its users
    else:
        # In prose: one alone by the sentence, each by its name, or all by a reference.
        rest = [word for word in names if not re.search(rf"\b{word}\b", doc)]
        assert not rest or len(names) == 1 or re.search(r"[Pp]arameters .*(as|those)", doc), (
            f"{name} doesn't say what {rest} are"
        )


OPTIONS = {field.name: field.default for field in fields(rz.Options)}


@pytest.mark.parametrize("function", [rz.render, rz.Renderer, rz.Renderer.__init__], ids=lambda each: each.__qualname__)
def test_every_option_is_a_keyword_with_the_default_of_options(function):
    found = {name: each for name, each in inspect.signature(function).parameters.items() if name in OPTIONS}
    assert list(found) == list(OPTIONS)
    assert {name: each.default for name, each in found.items()} == OPTIONS
    assert all(each.kind is each.KEYWORD_ONLY for name, each in found.items() if name != "size")


@pytest.mark.parametrize("error", [rz.ModelError, rz.SceneError, rz.OutputError])
def test_one_tree_of_errors(error):
    assert issubclass(error, rz.RasterizerError)
    assert issubclass(error, OSError if error is rz.OutputError else ValueError)


# --- typed --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name in CALLABLES if not name.endswith("Error")])
def test_each_parameter_and_result_is_annotated(name):
    value = CALLABLES[name]
    signature = inspect.signature(value)
    bare = [each for each, it in signature.parameters.items() if it.annotation is it.empty and each not in SELF]
    assert not bare, f"{name}: {bare} have no type"
    assert inspect.isclass(value) or signature.return_annotation is not signature.empty, f"{name} returns what?"


SELF = ("self", "cls", "args", "kwargs")
HOMES = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))


def test_editors_see_the_names_that_are_there():
    (guard,) = [node for node in HOMES.body if isinstance(node, ast.If)]
    seen = {alias.asname: node.module for node in guard.body for alias in node.names}
    assert seen == rz._HOMES
    assert all(alias.name == alias.asname for node in guard.body for alias in node.names)


def stub_of(value) -> ast.FunctionDef | None:
    """The __init__ that a class shows to editors alone: it may be given more than it stores."""
    nodes = ast.walk(ast.parse(inspect.getsource(value)))
    found = [node for node in nodes if isinstance(node, ast.FunctionDef) and node.name == "__init__"]
    return found[0] if found else None


DATACLASSES = [name for name in PUBLIC if is_dataclass(getattr(rz, name))]


@pytest.mark.parametrize("name", [name for name in DATACLASSES if stub_of(getattr(rz, name))])
def test_what_editors_see_of_a_dataclass_is_what_it_takes(name):
    value = getattr(rz, name)
    stub = stub_of(value)
    real = [each for each in inspect.signature(value).parameters.values() if each.name != "_"]
    assert [each.name for each in real] == [each.arg for each in [*stub.args.args[1:], *stub.args.kwonlyargs]]
    assert [each.name for each in real if each.kind is each.KEYWORD_ONLY] == [each.arg for each in stub.args.kwonlyargs]
    with_default = len(stub.args.defaults) + sum(each is not None for each in stub.args.kw_defaults)
    assert with_default == sum(each.default is not each.empty for each in real)


def test_types_are_shipped():
    assert (PACKAGE / "py.typed").exists()
    assert re.search(r"^rasterizer =\s+py\.typed$", (PACKAGE.parent / "setup.cfg").read_text(), re.MULTILINE)


def test_the_typed_example_runs(tmp_path):
    """What mypy reads is what works."""
    home = {}
    source = Path(__file__).with_name("typed_example.py")
    exec(compile(source.read_text(encoding="utf-8"), str(source), "exec"), home)
    made = home["draw_pictures"](tmp_path)
    assert all(path.exists() for path in made) and len(made) == 3


def test_nothing_imports_trimesh_whose_meshes_are_taken_as_they_are():
    users = [
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if re.search(r"^\s*(import|from) trimesh", path.read_text(), re.MULTILINE)
    ]
    assert users == []
