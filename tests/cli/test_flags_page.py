"""The page of commands and flags is what the parsers say now, and leaves nothing out."""

import re
import runpy

import pytest
from helpers.raster import ROOT

from rasterizer.cli.arguments import make_command_parser
from rasterizer.cli.commands import COMMANDS
from rasterizer.cli.environment import ENVIRONMENT
from rasterizer.cli.flags_page import EXIT_CODES, list_flags, make_page

PAGE = ROOT / "rasterizer" / "cli" / "README.md"
COMMAND = "python -m rasterizer.cli.flags_page > rasterizer/cli/README.md"


@pytest.mark.filterwarnings("ignore:.*found in sys.modules:RuntimeWarning")
def test_the_page_is_what_the_parsers_say(monkeypatch, capsys):
    assert PAGE.read_text(encoding="utf-8") == make_page(), f"the page is old: {COMMAND}"
    assert f"`{COMMAND}`" in make_page()
    monkeypatch.setenv("COLUMNS", "40")
    runpy.run_module("rasterizer.cli.flags_page", run_name="__main__")
    assert capsys.readouterr() == (make_page(), "")


def test_every_flag_and_every_longer_text_of_a_command_is_in_its_chapter():
    page = make_page()
    for name, command in COMMANDS.items():
        parser = make_command_parser(command)
        chapter = page.partition(f"\n## raster {name}\n")[2].partition("\n## ")[0]
        for action in parser._actions:  # noqa: SLF001 - argparse has no public list
            names = [flag for flag in action.option_strings if flag.startswith("--") and flag != "--help"]
            assert not names or any(f"`{flag}" in chapter for flag in names), f"{name}: {names} is missing"
            assert all(f"`{flag}" in page for flag in names), names
        assert all(flag.row in page.splitlines() for flag in list_flags(parser)), name
        said = re.sub(r"[^\w/]+", " ", chapter.replace("&lt;", "<")).lower()
        for line in f"{parser.description}\n{parser.epilog or ''}".splitlines():
            assert re.sub(r"[^\w/]+", " ", line).lower().strip() in said, f"{name}: {line} is missing"
    assert [(code, text) for code, text in EXIT_CODES.items() if f"| {code} | {text} |" not in page] == []
    assert [(name, text) for name, text in ENVIRONMENT.items() if f"| `{name}` | {text} |" not in page] == []
