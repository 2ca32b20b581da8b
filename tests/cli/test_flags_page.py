"""The page of commands and flags is what the parsers say now, and leaves nothing out."""

import os
import re
import subprocess
import sys

import pytest
from helpers.imports import PATHS
from helpers.raster import ROOT

from rasterizer.cli.arguments import make_command_parser
from rasterizer.cli.commands import COMMANDS
from rasterizer.cli.environment import ENVIRONMENT
from rasterizer.cli.flags_page import EXIT_CODES, list_flags, make_page

PAGE = ROOT / "rasterizer" / "cli" / "README.md"
COMMAND = "python -m rasterizer.cli.flags_page > rasterizer/cli/README.md"


def test_the_page_is_what_the_parsers_say():
    assert PAGE.read_text(encoding="utf-8") == make_page(), f"the page is old: {COMMAND}"


def test_the_page_tells_the_command_that_makes_it():
    assert f"`{COMMAND}`" in make_page()
    command = [sys.executable, "-W", "error", "-m", "rasterizer.cli.flags_page"]
    narrow = {**os.environ, "COLUMNS": "40", "PYTHONUTF8": "1"}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, encoding="utf-8", env=narrow, check=True)
    assert done.stdout == make_page() and not done.stderr


@pytest.mark.parametrize("name", COMMANDS)
def test_every_flag_of_a_command_is_in_its_chapter_and_described(name):
    page = make_page()
    chapter = page.partition(f"\n## raster {name}\n")[2].partition("\n## ")[0]
    for action in make_command_parser(COMMANDS[name])._actions:
        names = [flag for flag in action.option_strings if flag.startswith("--") and flag != "--help"]
        assert not names or any(f"`{flag}" in chapter for flag in names), f"{names} is missing"
        assert all(f"`{flag}" in page for flag in names)
    rows = [row for row in page.splitlines() if row.startswith("| `")]
    assert all(any(flag.row == row for row in rows) for flag in list_flags(make_command_parser(COMMANDS[name])))
    assert all(re.fullmatch(r"\| .+ \| [^|(][^|]+ \|", row.replace(r"\|", "")) for row in rows)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_longer_texts_of_a_command_are_in_its_chapter(name):
    parser = make_command_parser(COMMANDS[name])
    chapter = make_page().partition(f"\n## raster {name}\n")[2].partition("\n## ")[0]
    said = re.sub(r"[^\w/]+", " ", chapter.replace("&lt;", "<")).lower()
    for line in f"{parser.description}\n{parser.epilog or ''}".splitlines():
        words = re.sub(r"[^\w/]+", " ", line).lower().strip()
        assert words in said, f"{line} is missing"


def test_every_exit_code_and_variable_is_on_the_page():
    page = make_page()
    assert all(f"| {code} | {text} |" in page for code, text in EXIT_CODES.items())
    assert all(f"| `{name}` | {text} |" in page for name, text in ENVIRONMENT.items())


def test_every_variable_that_the_package_reads_is_listed():
    """TERM is told beside NO_COLOR; settings of numba that change its code are told by `raster doctor` alone."""
    source = "\n".join(path.read_text(encoding="utf-8") for path in PATHS.values())
    read = set(re.findall(r"environ(?:\.get\(|\[)\"(\w+)\"", source)) | {"RASTER_MOST_TEXELS"}
    assert read - {"TERM"} <= ENVIRONMENT.keys() and "TERM" in make_page()
    unread = [name for name in ENVIRONMENT if not re.search(rf"\b{name}\b|\b{name.removeprefix('NUMBA_')}\b", source)]
    assert not unread
