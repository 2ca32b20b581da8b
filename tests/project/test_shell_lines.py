"""The shell lines of rasterizer/README.md run, and every command has one."""

import glob
import shlex

import pytest
from helpers.pages import blocks
from helpers.raster import ROOT

from rasterizer.cli import main
from rasterizer.cli.commands import COMMANDS

PAGE = "rasterizer/README.md"
LINES = [line.removeprefix("$ raster ") for block in blocks(PAGE, "console") for line in block.splitlines()]


@pytest.mark.parametrize("line", LINES)
def test_a_line_of_the_page_runs(line, folder, capsys):
    (folder / "models").symlink_to(ROOT / "models")
    words = [found for word in shlex.split(line) for found in (sorted(glob.glob(word)) or [word])]
    code = main(words)
    # A doctor may find something: a store that is switched off, say.
    assert code == 0 or (words[0] == "doctor" and code == 1), capsys.readouterr().err


def test_every_command_is_in_the_table():
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    assert not [name for name in COMMANDS if f"`{name}`" not in text]
