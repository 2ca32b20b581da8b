"""rasterizer/README.md: the numbers of the triangle that is followed are real."""

import re
import sys

import pytest
from helpers.pages import blocks, text_of
from helpers.raster import ROOT

sys.path.insert(0, str(ROOT / "models"))
import follow_triangle

PAGE = "rasterizer/README.md"
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
CLOSE = 1e-5  # relative: another processor may round the last bit of a float otherwise


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
