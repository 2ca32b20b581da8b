"""Every flag, function, attribute and option that a page names is one that there is."""

import dataclasses
import inspect
import re

import pytest
from helpers.pages import PAGES, text_of
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer import reference
from rasterizer.cli.arguments import make_command_parser
from rasterizer.cli.commands import COMMANDS

# Flags of other programs, by the word that stands before them in the line or span.
OTHERS = (
    "pytest",
    "docker",
    "pip",
    "apt-get",
    "git",
    "ruff",
    "pre-commit",
    "python -m helpers",
    "ssh",
    "timeout",
    "mypy",
)
# Flags of other programs that pages name by themselves.
ALONE = {"--cpuset-cpus", "--cpus", "--read-only", "--user", "--flag"}
FLAGS = {flag for each in COMMANDS.values() for action in make_command_parser(each)._actions
         for flag in action.option_strings} | {"--version"}  # fmt: skip
SCRIPTS = {flag for path in (ROOT / "bench").glob("*.py")
           for flag in re.findall(r"\"(--[a-z][a-z-]*)\"", path.read_text(encoding="utf-8"))}  # fmt: skip


def code_of(page) -> list[str]:
    """Everything on a page that is set as code: lines of blocks, and spans between backquotes."""
    text = text_of(page)
    blocks = re.findall(r"^```.*?^```", text, re.DOTALL | re.MULTILINE)
    rest = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    return [line for block in blocks for line in block.splitlines()[1:-1]] + re.findall(r"`([^`]+)`", rest)


def flags_in(text) -> list[str]:
    return re.findall(r"(?<![\w-])--[a-z][a-z-]*[a-z]", text)


@pytest.mark.parametrize("page", PAGES)
def test_every_flag_exists(page):
    named = {flag for line in code_of(page) if not any(word in line for word in OTHERS) for flag in flags_in(line)}
    known = FLAGS | ALONE | (SCRIPTS if page in ("bench/README.md", "CHANGELOG.md") else set())
    assert not named - known, f"{page} names {sorted(named - known)}"


def attribute(path) -> bool:
    """Tell whether a dotted path leads somewhere: a public name and its attributes, parameters or fields."""
    value = rz
    for part in path.split("."):
        fields = {field.name for field in dataclasses.fields(value)} if dataclasses.is_dataclass(value) else set()
        written = set(getattr(value, "__annotations__", ())) | fields | attributes_of(value)
        if hasattr(value, part):
            value = getattr(value, part)
        else:
            return part in written  # of whose own attributes nothing is known
    return True


def attributes_of(value) -> set[str]:
    """Attributes that a class sets on itself."""
    try:
        return set(re.findall(r"self\.(\w+)", inspect.getsource(value))) if inspect.isclass(value) else set()
    except OSError:
        return set()


PUBLIC = "|".join(name for name in rz.__all__ if name != "__version__")
MODULES = {"Image": "PIL"}  # names of other packages that are like ours


@pytest.mark.parametrize("page", PAGES)
def test_every_name_of_the_package_exists(page):
    text = "\n".join(code_of(page))
    named = set(re.findall(r"\brz\.([A-Za-z_][\w.]*\w)", text)) - {"__version__"}
    named |= set(re.findall(rf"(?<![\w./-])((?:{PUBLIC})\.[a-z_]\w*)", text))
    named -= {name for name in named if name.split(".")[0] in ("registries", "reference", "load")}
    missing = {name for name in named if not attribute(name.removesuffix(".png"))}
    assert not missing, f"{page} names {sorted(missing)}"


def keywords() -> set[str]:
    """Every parameter and field of a public function, class or method."""
    found = set(inspect.signature(reference.render).parameters)
    for name in rz.__all__:
        value = getattr(rz, name)
        members = [value, *(getattr(value, key) for key in dir(value) if not key.startswith("_"))]
        for each in members:
            try:
                found |= set(inspect.signature(each).parameters)
            except (TypeError, ValueError):
                continue
    return found


KEYWORDS = keywords()


@pytest.mark.parametrize("page", [page for page in PAGES if not page.startswith(("tests", "bench"))])
def test_every_option_of_a_call_exists(page):
    """Of calls of the package, as `rz.render(scene, samples=4)`, on one line."""
    lines = [line for line in code_of(page) if re.search(rf"\b(rz|frame|renderer)\.\w+\(|\b({PUBLIC})\(", line)]
    named = {word for line in lines for word in re.findall(r"[(,] ?(\w+)=(?!=)", line)}
    others = {
        "quality",
        "axis",
        "size",
        "strict",
        "dtype",
        "key",
        "reference",
        "drawn",
        "n",
    }  # of Pillow, numpy, kinds of one's own
    assert not named - KEYWORDS - others, f"{page}: {sorted(named - KEYWORDS - others)}"


def test_the_rules_find_what_they_look_for():
    assert attribute("Camera.framing") and attribute("Frame.depth") and attribute("Options.spectral")
    assert not attribute("Camera.framed") and not attribute("rendr") and not attribute("Frame.deep")
    assert flags_in("raster a.obj --no-ground -o b.png --x-y=1 a--b") == ["--no-ground", "--x-y"]
