"""rasterizer/README.md: the triangle's numbers are real, the call tree, the map and the glossary name what there is."""

import re
import sys

import pytest
from helpers.pages import blocks, text_of
from helpers.raster import ROOT

sys.path.insert(0, str(ROOT / "models"))
import follow_triangle

PAGE = "rasterizer/README.md"
PACKAGE = ROOT / "rasterizer"
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
CLOSE = 1e-5  # relative: another processor may round the last bit of a float otherwise


def chapter(title) -> str:
    """The text of a chapter of the page."""
    return re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", text_of(PAGE), re.DOTALL | re.MULTILINE).group(1)


@pytest.fixture(scope="module")
def printed():
    return follow_triangle.follow()


def test_the_page_shows_the_numbers_of_the_script_in_order(printed):
    text, places = text_of(PAGE), []
    for stage, ours in printed.items():
        words = [NUMBER.sub("#", block) for block in blocks(PAGE, "text")]
        found = NUMBER.sub("#", ours + "\n")
        assert found in words, (
            f"{stage}: the page has no block with these words; run models/follow_triangle.py:\n{ours}"
        )
        shown = blocks(PAGE, "text")[words.index(found)]
        places.append(text.index(ours.splitlines()[0]))
        for here, there in zip(NUMBER.findall(ours), NUMBER.findall(shown), strict=True):
            # Bits and counts of a few digits are compared as text; long numbers may differ in their last bits.
            difference = abs(float(here) - float(there))
            assert difference <= CLOSE * abs(float(here)), f"{stage}: the script prints {here}, the page shows {there}"
    assert places == sorted(places) and set(printed) == set(follow_triangle.STAGES)


def test_the_followed_picture_is_the_one_that_render_draws(printed):
    assert "rz.render draws the same picture: True" in printed["resolve"]


def test_every_name_of_the_call_tree_is_defined_in_the_file_beside_it():
    (tree,) = re.findall(r"```text\n(.*?)```", chapter("The call tree"), re.DOTALL)
    lines = [re.fullmatch(r"[ │├└─]*((?:[\w.]+ )+) *([\w/]+\.py)(?: .*)?", line) for line in tree.splitlines()]
    assert lines and all(lines), tree
    for line in lines:
        source = (PACKAGE / line[2]).read_text()
        for name in line[1].split():
            last = name.rpartition(".")[2]
            assert re.search(rf"^\s*(?:def|class) {last}\b", source, re.MULTILINE), f"{line[2]} has no {name}"


def test_the_map_lists_every_file_once_and_none_that_is_not_there():
    listed = []
    for part in re.split(r"^\*\*", chapter("The files"), flags=re.MULTILINE)[1:]:
        folder = re.search(r"`(\w+)/`", part.splitlines()[0])
        listed += [
            f"{folder[1] + '/' if folder else ''}{name}"
            for name in re.findall(r"^\| `([\w.]+)` \|", part, re.MULTILINE)
        ]
    assert len(listed) == len(set(listed))
    there = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if path.name != "__init__.py" or path.stat().st_size
    }
    assert not there - set(listed), f"add to the map in {PAGE}: {sorted(there - set(listed))}"
    assert not set(listed) - there, f"no longer there: {sorted(set(listed) - there)}"
