"""The public names: complete, lazily imported, with the same options everywhere; and what editors see of them."""

import ast
import html
import inspect
import re
import subprocess
import sys
from dataclasses import fields, is_dataclass
from importlib.util import find_spec
from pathlib import Path

import pytest
from project import make_words

import rasterizer as rz
from rasterizer.options import Options

PACKAGE = Path(rz.__file__).parent
PUBLIC = [name for name in rz.__all__ if name != "__version__"]


def test_all_is_complete_and_each_name_leads_to_itself():
    assert set(dir(rz)) == set(rz.__all__) and len(set(rz.__all__)) == len(rz.__all__)
    for name in PUBLIC:
        value = getattr(rz, name)
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
        ("rz.render('x.obj').", {"rgba", "depth", "save", "stats"}),
        ("rz.render('x.obj', sha", {"shading=", "shadows="}),
        ("rz.render('x.obj', vi", {"view="}),
        ("rz.Renderer('x.obj', col", {"color=", "color_range="}),
        ("rz.Renderer('x.obj').render(ey", {"eye="}),
        ("rz.turntable('x.obj', mat", {"material="}),
        ("rz.explain('x.obj', 1, 2, mat", {"material="}),
        ("rz.Options(shad", {"shading="}),
        ("rz.Camera.framing(scene, azi", {"azimuth="}),
        ("rz.Material(diff", {"diffuse="}),
        ("rz.explain('x.obj', 1, 2).", {"samples", "rows"}),
    ):
        editor = jedi.Script(f"import rasterizer as rz\n{line}", project=jedi.Project(PACKAGE.parent))
        assert {each.name for each in editor.complete(2, len(line))} >= expected, line
    for line, expected in (("rz.render('x.obj', sha", ["shading=", "shadows="]), ("rz.Renderer(1, mat", ["material="])):
        cell = jedi.Interpreter(line, [{"rz": rz}]).complete()  # as a notebook asks, which has the modules
        assert [each.name for each in cell if each.name.endswith("=")] == expected, line


def test_what_editors_see_of_a_dataclass_is_what_it_takes():
    """Some show editors alone an __init__: they may be given more than they store."""
    n_stub = 0
    for value in (getattr(rz, name) for name in PUBLIC if is_dataclass(getattr(rz, name))):
        nodes = ast.walk(ast.parse(inspect.getsource(value)))
        for stub in (node for node in nodes if isinstance(node, ast.FunctionDef) and node.name == "__init__"):
            n_stub += 1
            real = [each for each in inspect.signature(value).parameters.values() if each.name != "_"]
            shown = [each.arg for each in (*stub.args.args[1:], *stub.args.kwonlyargs)]
            if value is Options:  # the others as **options
                assert shown == [real[0].name]
                continue
            assert [each.name for each in real] == shown, value
            keywords = [each.name for each in real if each.kind is each.KEYWORD_ONLY]
            assert keywords == [each.arg for each in stub.args.kwonlyargs], value
            with_default = len(stub.args.defaults) + sum(each is not None for each in stub.args.kw_defaults)
            assert with_default == sum(each.default is not each.empty for each in real), value
    assert n_stub > 3


@pytest.mark.nightly
@pytest.mark.skipif(find_spec("pdoc") is None, reason="pdoc (the extra `docs`) isn't installed")
def test_the_pages_of_the_api_show_every_name_with_its_text(tmp_path):
    """Made by the command that README.md gives; any warning is an error."""
    command = [sys.executable, "-W", "error", "-m", "pdoc", "rasterizer", "-o", str(tmp_path)]
    done = subprocess.run(command, cwd=PACKAGE.parent, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    page = (tmp_path / "rasterizer.html").read_text(encoding="utf-8")
    parts = re.split(r'<section id="([\w.]+)"', page)
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    assert sections.keys() == set(rz.__all__)
    for name in PUBLIC:
        said = html.unescape(re.sub(r"<[^>]+>", "", sections[name]))
        first_line = re.sub(r"\W+", " ", inspect.getdoc(getattr(rz, name)).splitlines()[0])
        assert first_line in re.sub(r"\W+", " ", said), name


@pytest.mark.nightly  # mypy reads it at any time; its pictures take kernels of their own
def test_the_typed_example_runs(tmp_path):
    """What mypy reads is what works."""
    home = {}
    source = Path(__file__).with_name("typed_example.py")
    exec(compile(source.read_text(encoding="utf-8"), str(source), "exec"), home)
    made = home["draw_pictures"](tmp_path)
    assert [path for path in made if not path.exists()] == [] and len(made) == 3
