"""The public names: complete, lazily imported, with the same options everywhere; what editors see of them; and what
they load and warn of."""

import inspect
import json
import re
import subprocess
import sys
import warnings
from dataclasses import fields, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from project import make_words

import rasterizer as rz

PACKAGE = Path(rz.__file__).parent
PUBLIC = [name for name in rz.__all__ if name != "__version__"]


def test_all_is_complete_and_each_name_leads_to_itself():
    assert set(dir(rz)) == set(rz.__all__) and len(set(rz.__all__)) == len(rz.__all__)
    for name in PUBLIC:
        value = getattr(rz, name)
        if name == "reference":  # the only module
            assert value.__name__ == "rasterizer.reference" and callable(value.render)
            continue
        assert inspect.isclass(value) or inspect.isfunction(value), name
        assert value.__name__ == name and value.__module__.startswith("rasterizer."), name
        # A module of that name would stand in its place as soon as somebody imports it.
        assert inspect.isclass(value) or find_spec(f"rasterizer.{name}") is None, f"a module hides rz.{name}"
    assert re.fullmatch(r"\d+\.\d+\.\d+.*", rz.__version__)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        rz.nonsense  # noqa: B018


def test_every_option_is_a_keyword_with_the_default_of_options():
    options = {field.name: field.default for field in fields(rz.Options) if field.name != "size"}
    for function in (rz.render, rz.Renderer, rz.Renderer.__init__):
        found = {name: each for name, each in inspect.signature(function).parameters.items() if name in options}
        assert {name: each.default for name, each in found.items()} == options, function.__qualname__
        assert all(each.kind is each.KEYWORD_ONLY for each in found.values())


def test_what_type_checkers_read_of_the_words_is_made_of_the_fields():
    assert (PACKAGE / "words.pyi").read_text(encoding="utf-8") == make_words.text(), "run tests/project/make_words.py"


def test_one_tree_of_errors():
    for error in (rz.ModelError, rz.SceneError, rz.OutputError):
        assert issubclass(error, rz.RasterizerError)
        assert issubclass(error, OSError if error is rz.OutputError else ValueError), error


# ---------------------------------------------------------------- what editors see


def test_an_editor_completes_the_names_and_what_they_return():
    """Jedi, which IPython and JupyterLab ask; mypy reads the same stub."""
    jedi = pytest.importorskip("jedi", reason="jedi (it comes with the extra `browser`) isn't installed")
    editor = jedi.Script("import rasterizer as rz\nrz.\nrz.load('x.obj').\n", project=jedi.Project(PACKAGE.parent))
    assert {each.name for each in editor.complete(2, 3)} >= set(rz.__all__)
    assert {each.name for each in editor.complete(3, 17)} >= {"meshes", "lights", "camera"}
    for line, expected in (
        ("rz.Renderer('x.obj', col", {"color=", "color_range="}),
        ("rz.explain('x.obj', 1, 2).", {"samples", "rows"}),
    ):
        editor = jedi.Script(f"import rasterizer as rz\n{line}", project=jedi.Project(PACKAGE.parent))
        assert {each.name for each in editor.complete(2, len(line))} >= expected, line
    # as a notebook asks, which has the modules
    cell = jedi.Interpreter("rz.render('x.obj', sha", [{"rz": rz}]).complete()
    assert [each.name for each in cell if each.name.endswith("=")] == ["shading=", "shadows="]


@pytest.mark.nightly  # mypy reads it at any time; its pictures take kernels of their own
def test_the_typed_example_runs(tmp_path):
    """What mypy reads is what works."""
    home = {}
    source = Path(__file__).with_name("typed_example.py")
    exec(compile(source.read_text(encoding="utf-8"), str(source), "exec"), home)
    made = home["draw_pictures"](tmp_path)
    assert [path for path in made if not path.exists()] == [] and len(made) == 3


# ---------------------------------------------------------------- a lean start

HELP = "from rasterizer.cli import main\ntry:\n    main({})\nexcept SystemExit:\n    pass"
HEAVY = {"numpy", "numba", "llvmlite", "PIL", "trimesh"}


def modules_after(code: str) -> set[str]:
    """Return the modules that a process of its own has loaded when it has run some lines, without its own at start."""
    lines = f"import sys; before = set(sys.modules)\n{code}\nprint(*sorted(set(sys.modules) - before))"
    done = subprocess.run([sys.executable, "-I", "-c", lines], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


def own_among(modules) -> set[str]:
    """Return the names of the package's own modules below the package, folders themselves left out."""
    names = {name.removeprefix("rasterizer.") for name in modules if name.startswith("rasterizer.")}
    return {name for name in names if not any(other.startswith(f"{name}.") for other in names)}


def test_importing_the_package_and_asking_for_help_load_next_to_nothing():
    modules = modules_after("import rasterizer")
    assert own_among(modules) == set()
    strangers = {name for name in modules if not name.startswith(("rasterizer", "_", "importlib", "warnings"))}
    assert not strangers, f"importing the package loads {strangers}"
    modules = modules_after(HELP.format(["--help"]))
    assert own_among(modules) <= {
        "cli.messages",
        "cli.parser",
        "errors",
    }
    assert not modules & {*HEAVY, "dataclasses", "inspect", "typing", "logging", "pathlib"}
    modules = modules_after(HELP.format(["render", "--help"]) + "\nimport rasterizer.options")
    assert not modules & {*HEAVY, "logging"}, "flags need no arrays"
    unasked = [name for name in own_among(modules) if name.startswith(("engine", "pipeline", "geometry", "reference"))]
    assert not unasked


# ---------------------------------------------------------------- warnings point at the line that led to them

BOW = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 2, 0]], float)  # a polygon that crosses itself
OBJ = b"mtllib none.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def quiet_bow():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return rz.Mesh(BOW, [[0, 1, 2, 3]])


def doors(path, scene):
    """Calls that warn, each on one line of this file."""
    return {
        "load": lambda: rz.load(path),
        "load bytes": lambda: rz.load(OBJ, format="obj"),
        "render": lambda: rz.render(path, 8),
        "Renderer": lambda: rz.Renderer(path, 8),
        "explain": lambda: rz.explain(path, 4, 4, 8),
        "load a scene file": lambda: rz.load(scene),
        "Mesh": lambda: rz.Mesh(BOW, [[0, 1, 2, 3]]),
        "Mesh.from_any": lambda: rz.Mesh.from_any((BOW, [[0, 1, 2, 3]])),
        "Scene": lambda: rz.Scene((BOW, [[0, 1, 2, 3]])),
        "render arrays": lambda: rz.render((BOW, [[0, 1, 2, 3]]), 8),
        "replace": lambda: replace(quiet_bow(), faces=[[0, 1, 2, 3]], polygons=None),
    }


def test_a_warning_points_at_the_line_of_the_call(tmp_path):
    (tmp_path / "x.obj").write_bytes(OBJ)
    (tmp_path / "x.json").write_text(json.dumps({"meshes": [{"file": "x.obj"}]}))
    for name, call in doors(tmp_path / "x.obj", tmp_path / "x.json").items():
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            call()
        assert caught, f"{name}: nothing was warned of"
        for warning in caught:
            assert warning.category is UserWarning, name
            place = warning.filename, warning.lineno
            assert place == (__file__, call.__code__.co_firstlineno), f"{name}: {warning.message}"


def test_a_program_is_shown_its_own_line(tmp_path):
    """As Python prints it, without any frame of a test runner above."""
    (tmp_path / "x.obj").write_bytes(OBJ)
    program = tmp_path / "program.py"
    program.write_text("import rasterizer as rz\n\nrz.load('x.obj')\n")
    done = subprocess.run([sys.executable, program], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr.startswith(f"{program}:3: UserWarning: x.obj: material file 'none.mtl' not found")
    assert "rz.load('x.obj')" in done.stderr
