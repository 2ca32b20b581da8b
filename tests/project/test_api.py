"""The public names: complete, sorted, lazily imported, documented; and which module may import which."""

import ast
import inspect
import re
import subprocess
import sys
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


def test_every_option_is_a_parameter_that_render_documents():
    from rasterizer.options import Options

    text = documented(inspect.getdoc(rz.render))["options"]
    for name in inspect.signature(Options).parameters:
        assert name == "size" or name in text


@pytest.mark.parametrize("error", [rz.ModelError, rz.SceneError, rz.OutputError])
def test_one_tree_of_errors(error):
    assert issubclass(error, rz.RasterizerError)
    assert issubclass(error, OSError if error is rz.OutputError else ValueError)


# --- which module may import which --------------------------------------------------------------------------


def imports_of(path) -> set[str]:
    """The package's own modules that a module imports anywhere, as dotted names below the package."""
    found = set()
    parts = ["rasterizer", *path.relative_to(PACKAGE).with_suffix("").parts]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = parts[: -node.level] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            found |= {f"{module}.{alias.name}" for alias in node.names}
    return {name.removeprefix("rasterizer.") for name in found if name.startswith("rasterizer.")}


MODULES = {path.relative_to(PACKAGE).as_posix(): imports_of(path) for path in PACKAGE.rglob("*.py")}
# What joins the scene and the pipeline.
BOTH = (
    "engine/draw.py",
    "renderer.py",
    "engine/plan.py",
    "engine/light_table.py",
    "engine/reflection_table.py",
    "engine/uniforms.py",
    "engine/point_lighting.py",
    "engine/shadow_maps.py",
)


def imported_folders(module) -> set[str]:
    return {name.split(".")[0] for name in MODULES[module]}


@pytest.mark.parametrize("module", sorted(MODULES))
def test_imports_go_one_way(module):
    folders = imported_folders(module)
    home = module.split("/")[0]
    if home == "pipeline":
        assert folders <= {"pipeline", "_kernel", "errors"}
    elif home == "scene":
        assert folders <= {"scene", "_kernel", "errors"}
    elif home == "cli":
        assert "pipeline" not in folders
    elif module in ("errors.py", "_version.py", "compiler/store.py"):
        assert not folders
    elif module == "compiler/kernels.py":
        assert folders == {"_cache"}
    elif module == "options.py":
        assert folders == {"errors"}
    elif module not in BOTH:
        assert not {"pipeline", "scene"} <= folders
    if home != "cli":
        assert "cli" not in folders or module == "__main__.py"


def test_the_judge_imports_nothing_of_the_pipeline():
    judges = [module for module in MODULES if module.startswith("reference")]
    assert len(judges) >= 2
    for module in judges:
        assert not imported_folders(module) & {"pipeline", "_kernel", "plan", "draw", "renderer"}


def test_nothing_imports_trimesh_whose_meshes_are_taken_as_they_are():
    users = [
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if re.search(r"^\s*(import|from) trimesh", path.read_text(), re.MULTILINE)
    ]
    assert users == []
