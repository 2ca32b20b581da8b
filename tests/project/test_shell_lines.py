"""The shell lines of the pages run, with the exit code that they say, and every command has one."""

import glob
import shlex
import shutil

import pytest
from helpers.pages import PAGES, console_lines
from helpers.raster import ROOT

from rasterizer.cli import main
from rasterizer.cli.commands import COMMANDS

PAGE = "rasterizer/README.md"
LINES = [pytest.param(*found, id=f"{page}-{found[0]}") for page in PAGES for found in console_lines(page)]


@pytest.fixture
def uploads(folder):
    """The current folder, with models, and with uploads one of which is broken."""
    (folder / "models").symlink_to(ROOT / "models")
    (folder / "uploads" / "somebody").mkdir(parents=True)
    shutil.copy(ROOT / "models" / "gear.stl", folder / "uploads" / "somebody")
    (folder / "uploads" / "broken.stl").write_text("solid nothing")
    return folder


@pytest.mark.parametrize(("line", "expected"), LINES)
def test_a_line_of_a_page_runs(line, expected, uploads, capsys):
    words = [found for word in shlex.split(line) for found in (sorted(glob.glob(word)) or [word])]
    code = main(words)
    # A doctor may find something: a store that is switched off, say.
    assert code == expected or (words[0] == "doctor" and code == 1), capsys.readouterr().err
    if words[0] == "batch":
        assert (uploads / "thumbs" / "somebody" / "gear.png").exists()


def test_every_command_is_in_the_table():
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    assert not [name for name in COMMANDS if f"`{name}`" not in text]
