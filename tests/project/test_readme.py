"""The front page: short, opening with the two commands of `.ci/run`, and with figures that bench/README.md has."""

import configparser
import re

import pytest
from helpers.pages import PAGES, blocks, links, pictures, text_of
from helpers.raster import ROOT

README = "README.md"
LONGEST = 120  # lines


def rows(page) -> list[list[str]]:
    """The cells of all tables of a page."""
    return [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text_of(page).splitlines()
        if line.startswith("| ")
    ]


def test_it_opens_with_the_two_commands():
    commands = re.findall(r"^    (python3 -m venv .*)$", text_of(README), re.MULTILINE)
    assert [c.rsplit("&& ", 1)[1] for c in commands] == [
        ".venv/bin/raster render models/teapot.obj --shading gouraud -o teapot.png",
        ".venv/bin/python -m pytest",
    ]
    assert text_of(README).splitlines()[2] == f"    {commands[0]}"


def test_it_is_short():
    n_line = len(text_of(README).splitlines())
    assert n_line <= LONGEST, f"{n_line} lines > {LONGEST}"


def test_it_shows_an_example_a_command_and_pictures():
    assert len(blocks(README, "python")) == 1 and len(blocks(README, "sh")) == 1
    assert len(pictures(README)) >= 4


def test_it_leads_to_every_other_page():
    missing = set(PAGES) - {README} - {target.partition("#")[0] for target in links(README)}
    assert not missing


def test_it_is_the_description_of_the_package_and_reads_without_its_pictures():
    """A package index shows it without the files that it links to: each picture says in words what it shows."""
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    assert README in (ROOT / "setup.py").read_text(encoding="utf-8")  # see test_packaging.py
    assert setup["metadata"]["long_description_content_type"] == "text/markdown"
    said = re.findall(r"!\[([^]]*)\]", text_of(README))
    assert all(len(words.split()) >= 4 for words in said), said


def test_its_times_and_errors_are_those_of_the_page_about_speed():
    """Both pages show tables of the same results; test_tables.py compares the tables with them."""
    kept = {page: set(re.findall(r"<!-- results/(\w+)\.json", text_of(page))) for page in (README, "bench/README.md")}
    assert kept[README] == {"frame", "tolerance"} and kept[README] <= kept["bench/README.md"]


@pytest.mark.parametrize("label", ["a sphere of", "32 quads", "`tolerance=0`", "`tolerance=1/4096`, the default"])
def test_its_tables_have_the_rows_that_it_speaks_of(label):
    found = [cells for cells in rows(README) if cells[0].startswith(label)]
    assert found and all(cell for cell in found[0][1:])
