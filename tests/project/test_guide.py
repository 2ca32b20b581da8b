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
FOLDERS = [
    "cli", "batch", "viewer", "analysis", "reference", "", "engine", "pipeline", "geometry", "io", "scene", "compiler",
]  # fmt: skip


def chapter(title) -> str:
    """The text of a chapter of the page."""
    return re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", text_of(PAGE), re.DOTALL | re.MULTILINE).group(1)


@pytest.fixture(scope="module")
def printed():
    return follow_triangle.follow()


@pytest.mark.parametrize("stage", follow_triangle.STAGES)
def test_the_page_shows_the_numbers_of_the_script(stage, printed):
    words = [NUMBER.sub("#", block) for block in blocks(PAGE, "text")]
    found = NUMBER.sub("#", printed[stage] + "\n")
    assert found in words, f"the page has no block with these words; run models/follow_triangle.py:\n{printed[stage]}"
    shown = blocks(PAGE, "text")[words.index(found)]
    for ours, theirs in zip(NUMBER.findall(printed[stage]), NUMBER.findall(shown), strict=True):
        # Bits and counts of a few digits are compared as text; long fixed-point numbers may differ in their last bits.
        difference = abs(float(ours) - float(theirs))
        assert difference <= CLOSE * abs(float(ours)), f"{stage}: the script prints {ours}, the page shows {theirs}"


def test_the_stages_stand_in_order(printed):
    text = text_of(PAGE)
    places = [text.index(block.splitlines()[0]) for block in printed.values()]
    assert places == sorted(places)


def test_the_followed_picture_is_the_one_that_render_draws(printed):
    assert "rz.render draws the same picture: True" in printed["resolve"]


def test_every_name_of_the_call_tree_is_defined_in_the_file_beside_it():
    (tree,) = re.findall(r"```text\n(.*?)```", chapter("The call tree"), re.DOTALL)
    lines = [re.fullmatch(r"[ │├└─]*((?:[\w.]+ )+) *([\w/]+\.py)(?: .*)?", line) for line in tree.splitlines()]
    assert len(lines) >= 20 and all(lines), tree
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


def test_the_map_shows_the_folders_in_the_order_of_imports():
    heads = re.findall(r"^\*\*.*\*\*(?:: `(\w+)/`)?$", chapter("The files"), re.MULTILINE)
    assert heads == FOLDERS


def test_the_glossary_is_sorted_and_explains_each_word_once():
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \|$", chapter("Glossary"), re.MULTILINE)[2:]
    words = [word.lower() for word, _ in rows]
    assert len(words) >= 40 and words == sorted(words) and len(words) == len(set(words))
    assert all(text.endswith((".", "`", ").")) for _, text in rows)


def test_every_decision_is_short():
    """A decision takes some lines, so that somebody reads it."""
    for part in re.split(r"^### ", chapter("Decisions"), flags=re.MULTILINE)[1:]:
        title, _, text = part.partition("\n")
        assert 2 <= len(text.strip().splitlines()) <= 7, title
