"""What is said: of kernels that are compiled, of each picture on a terminal, at each level; and lines of JSON."""

import json
import logging
import re
import subprocess
import sys
import unicodedata
import warnings

import pytest
from helpers.command import CUBE, GEAR, SMALL, errors, raster, run
from helpers.stores import environment_with

from rasterizer.cli.messages import BAR_WIDTH, NORMAL, QUIET, VERBOSE, Bar, Messages, compilation_shown, plain


class Terminal:
    """A stream that says it is a terminal."""

    def __init__(self):
        self.told = ""

    def isatty(self):
        return True

    def write(self, text):
        self.told += text

    def flush(self):
        pass


def show_three(level=NORMAL) -> int:
    """Show three kernels that are compiled; return how many were shown."""
    with compilation_shown(Messages(level)) as progress:
        for n_done, name in enumerate(("scan", "resolve", "clip")):
            progress.show(name, n_done, 3)
    return progress.n_shown


def test_the_bar_grows_on_a_terminal_and_is_taken_away(monkeypatch):
    for level in (NORMAL, QUIET):
        monkeypatch.setattr(sys, "stderr", terminal := Terminal())
        assert show_three(level) == 3
        filled = [len(bar) for bar in re.findall(r"\[(#*)\.*\]", terminal.told)]
        assert filled == ([0, BAR_WIDTH // 3, 2 * BAR_WIDTH // 3] if level == NORMAL else [])
        assert "\n" not in terminal.told and terminal.told.endswith("\r\x1b[K" if level == NORMAL else "")
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    Bar(Messages(NORMAL)).show(0, 1, "drawing a\x1b]0;title\x07.obj")
    assert "\x1b]" not in terminal.told and "\x07" not in terminal.told, "names send nothing to a terminal"
    monkeypatch.setattr(sys, "stderr", None)  # as in a process that was started without one
    assert show_three() == 3


def test_what_names_hold_is_seen_and_changes_nothing(tmp_path, capfd):
    """Neither what a terminal obeys, nor what turns the order of letters or isn't seen, reaches it; letters do."""
    hidden = "\x1b\x7f\x9b\xad\u061c\u200b\u200f\u202e\u2028\u2029\u2066\ufeff\U000e0041"
    model = f"o a{hidden}é א 漢 👍z\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(model, "utf-8", newline="\n")
    raster("info", tmp_path / "a.obj")
    raster("info", tmp_path / f"{hidden}.obj")
    out, err = capfd.readouterr()
    assert not set(hidden) & set(out + err) and "é א 漢 👍z" in out and ".obj: no such file" in err
    others = [chr(k) for k in range(0x110000) if unicodedata.category(chr(k)) not in ("Cc", "Cf", "Zl", "Zp")]
    letters = "".join([*others, "\n\t"])  # the bytes of names that are no UTF-8 among them
    assert plain(letters) == letters


def test_without_a_terminal_a_line_says_how_many_kernels_are_compiled(capsys):
    assert show_three() == 3
    assert errors(capsys) == "raster: compiling 3 kernels for the first time\n"
    assert show_three(QUIET) == 3
    with compilation_shown(Messages()):
        pass
    assert errors(capsys) == ""


def test_that_every_run_compiles_is_said_once_where_nothing_is_kept(tmp_path):
    """In a process of its own: where the store is, is known when the program begins."""
    code = """
from rasterizer.cli.messages import Messages, compilation_shown
with compilation_shown(Messages()) as progress:
    for n_done in range(3): progress.show("scan", n_done, 3)
with compilation_shown(Messages(1)): pass
"""
    (tmp_path / "file").write_text("")
    environment = environment_with(RASTER_STORE=tmp_path / "file" / "below")
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    first, *lines, reason = done.stderr.splitlines()
    assert "takes a while in every run" in first and "RASTER_STORE names one" in first and len(lines) == 1
    assert reason.startswith("raster: the store of kernels: ")


def test_what_the_package_logs_and_libraries_warn_of_is_a_detail_inside_the_block_alone(capsys):
    log = logging.getLogger("rasterizer")
    before = log.level, list(log.handlers)
    for level in (NORMAL, VERBOSE):
        with compilation_shown(Messages(level)), Messages(level).shown_warnings():
            log.info("kernel x is damaged")
            warnings.warn("an old\nname", DeprecationWarning, stacklevel=1)
        told = "raster: kernel x is damaged\nraster: DeprecationWarning: an old name\n"
        assert errors(capsys) == (told if level == VERBOSE else "")
    assert (log.level, log.handlers) == before


def test_each_kind_of_message_is_said_from_its_level_on(capsys):
    said = {}
    for level in (QUIET, NORMAL, VERBOSE):
        messages = Messages(level)
        for tell in (messages.error, messages.warn, messages.notice, messages.detail):
            tell(f"one {tell.__name__}")
        said[level] = [line.removeprefix("raster: ") for line in errors(capsys).splitlines()]
    normal = ["error: one error", "warning: one warn", "one notice"]
    assert said == {QUIET: normal[:1], NORMAL: normal, VERBOSE: [*normal, "one detail"]}


def test_json_is_json_also_where_a_number_is_not_finite(capsys):
    Messages().record(
        {"a": float("inf"), "b": [1.0, float("nan")], "c": {"d": float("-inf")}, "e": (1, float("inf"))}, False
    )

    def refuse(word):
        raise AssertionError(word)

    record = json.loads(capsys.readouterr().out, parse_constant=refuse)
    assert record["a"] is None and record["b"] == [1.0, None]
    assert record["c"]["d"] is None and record["e"] == [1, None]


# --- pictures that are done -------------------------------------------------------------------------------------------


@pytest.fixture
def terminal(folder, monkeypatch, capsys):
    """Stderr that says that it is a terminal."""
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda _: True)


def lines(capsys):
    return [line for line in re.split(r"[\r\n]+", capsys.readouterr().err) if line.startswith("raster: ")]


def test_a_picture_has_a_line(terminal, capsys):
    assert run(CUBE) == 0
    (line,) = lines(capsys)
    assert re.fullmatch(r"raster: cube\.png, 24x16, (\d+ bytes|[\d.]+ kB), \d+\.\d\d s", line)


def test_many_pictures_are_counted(terminal, capsys):
    assert run(CUBE, GEAR, "--view", "top,front,left") == 0
    assert [re.match(r"raster: \[(\d)/6\] ", line)[1] for line in lines(capsys)] == list("123456")


def test_nothing_is_said_where_it_is_not_wanted(folder, capsys, monkeypatch):
    assert run(CUBE) == 0 and capsys.readouterr().err == "", "stderr is no terminal"
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda _: True)
    for flags in (["-q"], ["--json"]):
        assert run(CUBE, *flags) == 0 and lines(capsys) == [], flags


def test_sheets_and_turntables_have_a_line_too(terminal, capsys):
    for argv, name in ((["sheet", CUBE], "cube-sheet.png"), (["turntable", CUBE, "--frames", "2"], "turntable.gif")):
        assert raster(*argv, *SMALL) == 0
        assert f"{name}, " in capsys.readouterr().err
