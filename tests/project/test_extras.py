"""Every extra that is named anywhere in the tree is one of setup.cfg's; no message names a package of the index that
isn't ours."""

import configparser
import re

from helpers.raster import ROOT

NAMED = re.compile(r"(?:pip install[^\n]*|'(?:\.|[\w-]+))\[(\w+(?:, ?\w+)*)\]'")


def extras() -> set[str]:
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    return set(setup["options.extras_require"])


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
        "tests/**/*.py",
    ):
        for path in ROOT.glob(pattern):
            if path.is_file() and path.name != "test_extras.py":
                yield path, path.read_text(errors="replace")


def test_every_extra_that_is_named_exists():
    named = {}
    for path, text in texts():
        for match in NAMED.finditer(text):
            named |= {word.strip(): path for word in match[1].split(",")}
    assert "test" in named  # README's own
    missing = {word: str(path) for word, path in named.items() if word not in extras()}
    assert not missing


def test_no_message_installs_a_package_of_this_name_from_an_index():
    for path, text in texts():
        found = re.search(r"pip install[^\n]*['\" ]rasterizer\b", text)
        assert not found, f"{path}: {found[0]}: that is somebody else's"
