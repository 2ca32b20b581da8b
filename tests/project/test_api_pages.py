"""The pages of the API: one command makes them, without a warning, and they show every public name with its text."""

import html
import inspect
import re
import subprocess
import sys
from importlib.util import find_spec

import pytest
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.api_pages import ENTRIES, REFERENCE, REGISTRIES, RESULTS, to_markdown

needs_pdoc = pytest.mark.skipif(find_spec("pdoc") is None, reason="pdoc (the extra `docs`) isn't installed")
PAGES = {
    "rasterizer.html": [*(name for name in rz.__all__ if name != "__version__"), *RESULTS],
    "rasterizer/registries.html": [*REGISTRIES, *ENTRIES],
    "rasterizer/reference.html": list(REFERENCE),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder of the pages, made by the command that tests/README.md gives; any warning is an error."""
    folder = tmp_path_factory.mktemp("api") / "api"
    command = [sys.executable, "-W", "error", "-m", "rasterizer.api_pages", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    assert done.stdout.strip() == str(folder / "index.html")
    return folder


def sections(text) -> dict[str, str]:
    """What a page says of each name, without marks."""
    parts = re.split(r'<section id="(\w+)">', text)
    return {
        name: html.unescape(re.sub(r"<[^>]+>", "", part)) for name, part in zip(parts[1::2], parts[2::2], strict=True)
    }


def test_one_page_shows_the_command():
    assert "python -m rasterizer.api_pages api" in (ROOT / "tests" / "README.md").read_text(encoding="utf-8")


@needs_pdoc
@pytest.mark.parametrize("page", PAGES)
def test_every_name_is_on_its_page_with_text(page, made):
    found = sections((made / page).read_text(encoding="utf-8"))
    assert sorted(found) == sorted(PAGES[page])
    for name, text in found.items():
        assert len(text.split()) > 8, f"{name}: {text.split()}"


@needs_pdoc
def test_every_member_of_a_public_class_is_on_the_page(made):
    text = (made / "rasterizer.html").read_text(encoding="utf-8")
    for name in PAGES["rasterizer.html"]:
        value = getattr(rz, name, None)
        for key in dir(value) if inspect.isclass(value) else ():
            owner = next(base for base in value.__mro__ if key in vars(base))
            member = vars(owner)[key]
            is_called = inspect.isfunction(member) or isinstance(member, (property, classmethod))
            if not key.startswith("_") and owner.__module__.startswith("rasterizer.") and is_called:
                assert f'id="{name}.{key}"' in text, f"{name}.{key} is missing"


@needs_pdoc
@pytest.mark.parametrize("page", PAGES)
def test_links_inside_a_page_lead_somewhere(page, made):
    text = (made / page).read_text(encoding="utf-8")
    missing = set(re.findall(r'href="#([^"]+)"', text)) - set(re.findall(r'id="([^"]+)"', text))
    assert not missing


@needs_pdoc
def test_signatures_are_shown_as_they_are_written(made):
    found = sections((made / "rasterizer.html").read_text(encoding="utf-8"))
    assert "size: int | Sequence[int] = (640, 480)" in found["render"] and "-> Frame:" in found["render"]
    assert "color: Color = 1.0" in found["PointLight"]
    strangers = [name for name, text in found.items() if re.search(r"typing\.|Annotated|0x[0-9a-f]{6}", text)]
    assert not strangers


@needs_pdoc
def test_sections_are_lists_and_no_marks_are_left(made):
    found = sections((made / "rasterizer.html").read_text(encoding="utf-8"))
    for name, text in found.items():
        assert not re.search(r"^-{4,}|^#{2,}|^```|\*\*(?!options)", text.replace("**changes", ""), re.MULTILINE), name
    assert "tolerance: error accepted, in linear intensity where 1 is white" in found["render"]


def test_a_docstring_becomes_markdown():
    text = (
        "Scale by 2*x < 3.\n\n    import rasterizer as rz\n    rz.srgb(1)\n\nParameters\n----------\n"
        "a, b : (n, 3) float64, `max(x)`: world\n    space\nc : int\n\nBehind them.\n\n"
        "Returns\n-------\n(n,) float64\n\nRaises\n------\nSceneError : c < 0\n\nSource: somebody."
    )
    assert to_markdown(text) == (
        "Scale by 2\\*x &lt; 3.\n\n```python\nimport rasterizer as rz\nrz.srgb(1)\n```\n\n###### Parameters\n\n"
        "- **a, b**: (n, 3) float64, `max(x)`: world space\n- **c**: int\n\nBehind them.\n\n"
        "###### Returns\n\n(n,) float64\n\n###### Raises\n\n- **SceneError**: c &lt; 0\n\nSource: somebody."
    )


def test_without_pdoc_it_says_what_to_install(tmp_path):
    code = (
        "import sys; sys.modules['pdoc'] = None; from rasterizer.api_pages import main; sys.exit(main([sys.argv[1]]))"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "api")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and not (tmp_path / "api").exists()
    assert done.stderr.count("\n") == 1 and "'scanline-rasterizer[docs]'" in done.stderr
