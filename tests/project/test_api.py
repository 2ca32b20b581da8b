"""The public names: complete, lazily imported, with the same options everywhere; and what editors see of them."""

import inspect
import re
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path

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
