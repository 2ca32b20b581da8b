"""Every extra that is named anywhere in the tree is one of setup.cfg's, and the other way round; no message names a
package of the index that isn't ours."""

import configparser
import re

import pytest
from helpers.raster import ROOT

NAMED = re.compile(r"(?:pip install[^\n]*|'(?:\.|[\w-]+))\[(\w+(?:, ?\w+)*)\]'|\bextra ([`'\"])(\w+)\2")
FOR_DEVELOPERS = {"test", "browser", "lint", "docs", "bench"}


def extras() -> dict[str, list[str]]:
    """What each extra installs."""
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    return {name: text.split("\n")[1:] for name, text in setup["options.extras_require"].items()}


def texts():
    """Everything that is written in the tree, by people."""
    for pattern in (
        "*.md",
        "*.cfg",
        "*.toml",
        ".ci/*",
        "bench/*",
        "models/*.py",
        "rasterizer/**/*.py",
        "rasterizer/*.md",
        "tests/**/*.py",
    ):
        for path in ROOT.glob(pattern):
            if path.is_file() and path.name != "test_extras.py":
                yield path, path.read_text(errors="replace")


def test_every_extra_that_is_named_exists():
    named = {}
    for path, text in texts():
        for match in NAMED.finditer(text):
            named |= {word.strip(): path for word in (match[1] or match[3]).split(",")}
    assert {"test", "bench", "video"} <= set(named)  # README's own, and those of messages
    missing = {word: str(path) for word, path in named.items() if word not in extras()}
    assert not missing


@pytest.mark.parametrize("name", extras())
def test_every_extra_is_told_of(name):
    assert f"`{name}`" in (ROOT / "README.md").read_text(encoding="utf-8"), f"README.md doesn't say what {name} brings"
    assert all(re.match(r"[\w.-]+(\[\w+(,\w+)*\])?([<>=!~]|$)", each) for each in extras()[name])


def test_all_of_them_are_what_a_user_may_want():
    (everything,) = extras()["all"]
    inside = re.fullmatch(r"scanline-rasterizer\[(.+)\]", everything)[1].split(",")
    assert inside == sorted(extras().keys() - FOR_DEVELOPERS - {"all"})


def test_no_message_installs_a_package_of_this_name_from_an_index():
    for path, text in texts():
        found = re.search(r"pip install[^\n]*['\" ]rasterizer\b", text)
        assert not found, f"{path}: {found[0]}: that is somebody else's"
