"""What is said while kernels are compiled: a bar on a terminal, a line for each elsewhere, nothing with --quiet."""

import os
import re
import sys

import pytest
from helpers.command import errors
from helpers.stores import LIGHT, TINY, environment_with

from rasterizer.cli.messages import BAR_WIDTH, NORMAL, QUIET, VERBOSE, Messages, compilation_shown
from rasterizer.compiler import kernels
from rasterizer.compiler.store import Store

COMPILES = f"""
from rasterizer.cli.messages import Messages, compilation_shown
with compilation_shown(Messages(LEVEL)):
{"".join(f"    {line}" for line in (TINY + LIGHT).splitlines(keepends=True))}
"""


def on_terminal(program, cwd, **variables) -> str:
    """Run a program with a terminal for its stderr; return what the terminal got."""
    import pty
    import subprocess

    master, terminal = pty.openpty()
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, env=environment_with(**variables), cwd=cwd, stderr=terminal) as process:
        os.close(terminal)
        told = b""
        while True:
            try:
                part = os.read(master, 4096)
            except OSError:  # Linux says so where the other end is closed
                break
            if not part:
                break
            told += part
    os.close(master)
    assert process.returncode == 0, told
    return told.decode()


@pytest.mark.skipif(os.name != "posix", reason="there are no pseudo-terminals")
@pytest.mark.parametrize("level", [QUIET, NORMAL, VERBOSE])
def test_on_a_terminal_a_bar_is_shown_and_taken_away(tmp_path, level):
    told = on_terminal(COMPILES.replace("LEVEL", str(level)), tmp_path, RASTER_STORE=tmp_path / "store")
    if level == NORMAL:
        *bars, end = told.split("\x1b[K")
        bars, empty = [bar.removeprefix("\r") for bar in bars[:-1]], bars[-1]
        assert bars == [f"raster: [{'.' * BAR_WIDTH}] 0/1 compiling {name}" for name in ("list_corners", "lambert")]
        assert empty == "\r" and end == "", "the bar is left on the terminal"
    else:
        assert told.count("compiling kernels for the first time") == (2 if level == VERBOSE else 0)
        assert "\x1b" not in told and (told == "" or level == VERBOSE)
    assert on_terminal(COMPILES.replace("LEVEL", str(level)), tmp_path, RASTER_STORE=tmp_path / "store") == ""


def notices(show):
    for n_done, name in enumerate(("scan", "resolve", "clip")):
        show(name, n_done, 3)


def test_without_a_terminal_each_kernel_is_a_line(capsys):
    with compilation_shown(Messages()) as progress:
        notices(progress.show)
    lines = errors(capsys).splitlines()
    assert lines == [
        f"raster: compiling kernels for the first time: {name}, {n_done} of 3 done"
        for n_done, name in enumerate(("scan", "resolve", "clip"))
    ]
    assert progress.n_shown == 3


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


def test_the_bar_grows(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with compilation_shown(Messages()) as progress:
        notices(progress.show)
    filled = [len(bar) for bar in re.findall(r"\[(#*)\.*\]", terminal.told)]
    assert filled == [0, BAR_WIDTH // 3, 2 * BAR_WIDTH // 3]
    assert "\n" not in terminal.told and terminal.told.endswith("\r\x1b[K")


@pytest.mark.parametrize("is_terminal", [True, False])
def test_quiet_says_nothing(capsys, monkeypatch, is_terminal):
    terminal = Terminal()
    if is_terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
    with compilation_shown(Messages(QUIET)) as progress:
        notices(progress.show)
    assert terminal.told == "" and capsys.readouterr() == ("", "")


def test_nothing_is_said_where_nothing_is_compiled_or_there_is_no_stderr(capsys, monkeypatch):
    with compilation_shown(Messages()):
        pass
    assert errors(capsys) == ""
    monkeypatch.setattr(sys, "stderr", None)
    with compilation_shown(Messages()) as progress:
        notices(progress.show)


def test_that_every_run_compiles_is_said_once_where_nothing_is_kept(capsys, monkeypatch):
    monkeypatch.setattr(kernels, "STORE", Store(is_used=True, reasons=("/home: it can't be written",)))
    with compilation_shown(Messages()) as progress:
        notices(progress.show)
    first, *rest = errors(capsys).splitlines()
    assert "takes some seconds in every run" in first and "RASTER_STORE names one" in first and len(rest) == 3
    with compilation_shown(Messages(VERBOSE)):
        pass
    assert errors(capsys) == "raster: the store of kernels: /home: it can't be written\n"


def test_what_the_package_logs_is_a_detail_inside_the_block_alone(capsys):
    import logging

    log = logging.getLogger("rasterizer")
    before = log.level, list(log.handlers)
    for level in (NORMAL, VERBOSE):
        with compilation_shown(Messages(level)):
            log.info("kernel x is damaged")
        assert errors(capsys) == ("raster: kernel x is damaged\n" if level == VERBOSE else "")
    assert (log.level, log.handlers) == before
