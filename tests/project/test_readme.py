"""The front page: short, opening with the two commands of `.ci/run`, and with figures that bench/README.md has."""

import re

import pytest
from helpers.pages import PAGES, blocks, links, pictures, text_of

README = "README.md"
LONGEST = 120  # lines
SCENES = {"a scan of 69": "scan", "a torus of 1.3": "dense", "32 quads": "quads-front"}
SHADINGS = ("flat", "Gouraud", "Phong")


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
    missing = set(PAGES) - {README} - set(links(README))
    assert not missing


@pytest.mark.parametrize("title", SCENES)
def test_its_times_are_those_of_the_page_about_speed(title):
    (row,) = [cells for cells in rows(README) if cells[0].startswith(title)]
    measured = {cells[1]: cells[2:4] for cells in rows("bench/README.md") if cells[0] == SCENES[title]}
    for shading, cell in zip(SHADINGS, row[1:], strict=True):
        for shown, exact in zip(cell.split(" / "), measured[shading], strict=True):
            digits = len(shown.partition(".")[2])
            assert f"{float(exact):.{digits}f}" == shown, f"{shading}: {shown} ms, measured {exact}"


def test_its_errors_are_those_of_the_page_about_speed():
    measured = {tuple(cells[1:3]): cells[4] for cells in rows("bench/README.md") if cells[0] == "sphere"}
    power = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    checked = 0
    for tolerance, label in (("0", "`tolerance=0`"), ("1/4096", "`tolerance=1/4096`, the default")):
        (row,) = [cells for cells in rows(README) if cells[0] == label]
        for shading, cell in zip(SHADINGS, row[1:4], strict=True):
            factor, exponent = cell.split("·10")
            digits = len(factor.partition(".")[2])
            mantissa, _, true_exponent = measured[shading, tolerance].partition("e")
            assert int(exponent.translate(power)) == int(true_exponent), f"{shading}, tolerance {tolerance}: {cell}"
            assert f"{float(mantissa):.{digits}f}" == factor, f"{shading}, tolerance {tolerance}: {cell}"
            checked += 1
    assert checked == 6
