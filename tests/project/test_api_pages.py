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
from rasterizer.api_pages import ENTRIES, REFERENCE, REGISTRIES, RESULTS, main, to_markdown

PAGES = {
    "rasterizer.html": [*(name for name in rz.__all__ if name != "__version__"), *RESULTS],
    "rasterizer/registries.html": [*REGISTRIES, *ENTRIES],
    "rasterizer/reference.html": list(REFERENCE),
}


def sections(text) -> dict[str, str]:
    """What a page says of each name, without marks."""
    parts = re.split(r'<section id="(\w+)">', text)
    return {
        name: html.unescape(re.sub(r"<[^>]+>", "", part)) for name, part in zip(parts[1::2], parts[2::2], strict=True)
    }


@pytest.mark.nightly
@pytest.mark.skipif(find_spec("pdoc") is None, reason="pdoc (the extra `docs`) isn't installed")
def test_every_name_and_member_is_on_its_page_with_text(tmp_path):
    """Made by the command that tests/README.md gives; any warning is an error."""
    command = [sys.executable, "-W", "error", "-m", "rasterizer.api_pages", str(tmp_path / "api")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    assert done.stdout.strip() == str(tmp_path / "api" / "index.html")
    for page, names in PAGES.items():
        text = (tmp_path / "api" / page).read_text(encoding="utf-8")
        found = sections(text)
        assert sorted(found) == sorted(names)
        assert not [name for name, said in found.items() if len(said.split()) <= 8], "names without text"
        missing = set(re.findall(r'href="#([^"]+)"', text)) - set(re.findall(r'id="([^"]+)"', text))
        assert not missing, f"{page} links to {missing}"
        for name, said in found.items():
            assert not re.search(r"typing\.|Annotated|0x[0-9a-f]{6}", said), name
            marks = re.search(r"^-{4,}|^#{2,}|^```|\*\*(?!options)", said.replace("**changes", ""), re.MULTILINE)
            assert not marks, f"{name} has marks: {marks}"
    text = (tmp_path / "api" / "rasterizer.html").read_text(encoding="utf-8")
    for name in PAGES["rasterizer.html"]:
        value = getattr(rz, name, None)
        for key in dir(value) if inspect.isclass(value) else ():
            owner = next(base for base in value.__mro__ if key in vars(base))
            member = vars(owner)[key]
            is_called = inspect.isfunction(member) or isinstance(member, (property, classmethod))
            if not key.startswith("_") and owner.__module__.startswith("rasterizer.") and is_called:
                assert f'id="{name}.{key}"' in text, f"{name}.{key} is missing"
    found = sections(text)
    assert "size: int | Sequence[int] = (640, 480)" in found["render"] and "-> Frame:" in found["render"]
    assert "color: Color = 1.0" in found["PointLight"]
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


def test_without_pdoc_it_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pdoc", None)
    assert main([str(tmp_path / "api")]) == 2 and not (tmp_path / "api").exists()
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "'scanline-rasterizer[docs]'" in said
