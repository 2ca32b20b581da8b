"""A picture in a terminal: its colours, its shape, what is transparent, and terminals without colours."""

import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.arrays import deviations
from helpers.command import CUBE, assert_refused, raster, run

from rasterizer.cli.preview import preview

RED, GREEN = (255, 0, 0, 255), (0, 255, 0, 255)


@pytest.fixture(autouse=True)
def colored_terminal(monkeypatch, folder):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")


def test_two_pixels_make_a_character():
    picture = np.array([[RED, (0, 0, 0, 0), RED], [GREEN, GREEN, (0, 0, 0, 0)]], np.uint8)
    text = preview(picture, 3, 1)
    assert text == ("\x1b[38;2;255;0;0;48;2;0;255;0m▀\x1b[0m\x1b[38;2;0;255;0m▄\x1b[0m\x1b[38;2;255;0;0m▀\x1b[0m\n")
    assert preview(np.zeros((4, 4, 4), np.uint8), 4, 2) == "\n\n"


def test_it_fits_into_the_terminal_and_keeps_its_shape():
    for width, height in ((640, 480), (480, 640), (3, 2), (7, 1001), (1001, 7), (1, 1)):
        lines = preview(np.full((height, width, 4), 255, np.uint8), 60, 20).splitlines()
        n_column, size = lines[0].count("▀"), f"{width}x{height}"
        assert 1 <= n_column <= 60 and 1 <= len(lines) <= 20, size
        assert all(line.count("▀") == n_column for line in lines), size
        assert n_column == 60 or len(lines) == 20 or min(width, height) == 1, size
        if min(width, height) > 100:
            assert n_column / (2 * len(lines)) == pytest.approx(width / height, rel=0.05)


def test_colours_are_means_of_what_is_covered():
    picture = np.zeros((8, 4, 4), np.uint8)
    picture[:, ::2] = RED  # half covered, and red where it is
    assert set(re.findall(r"38;2;([\d;]+);48", preview(picture, 1, 1))) == {"255;0;0"}
    rng = np.random.default_rng(1)
    noise = np.dstack([rng.integers(0, 256, (50, 70, 3)), np.full((50, 70), 255)]).astype(np.uint8)
    numbers = list(map(int, re.findall(r"(\d+);(\d+);(\d+)m", preview(noise, 1, 1))[0]))
    assert not deviations(numbers, noise[25:, :, :3].mean(axis=(0, 1)), atol=0.51)


def test_terminals_without_colours_or_utf8_get_letters(monkeypatch):
    picture = np.full((20, 40, 4), 255, np.uint8)
    for name, value in (("NO_COLOR", "1"), ("TERM", "dumb")):
        with monkeypatch.context() as patch:
            patch.setenv(name, value)
            assert preview(picture, 40, 10) == ("@" * 40 + "\n") * 10, name
    for encoding, has_blocks in (("UTF8", True), ("latin-1", False), ("cp437", False), ("nonsense", False)):
        monkeypatch.setattr(sys, "stdout", SimpleNamespace(encoding=encoding))  # what it is written to
        text = preview(picture, 20, 10)
        assert ("▀" in text) == has_blocks and (has_blocks or text.isascii()), encoding


def test_the_command_shows_it_and_writes_only_what_is_asked_for(folder, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    assert run(CUBE, "--preview") == 0
    out, err = capsys.readouterr()
    assert "▀" in out and err == "" and not list(folder.iterdir())
    assert run(CUBE, "--preview", "-o", "x.png") == 0 and (folder / "x.png").exists()
    assert capsys.readouterr().out == out
    assert raster("demo", "--preview", "-s", "30x20", "--json") == 0
    assert '"output": null' in capsys.readouterr().out
    assert_refused(capsys, [([CUBE, "--preview", "--array", "depth"], "an array is asked for")], "render")


def test_beside_a_picture_on_stdout_it_goes_to_stderr(capfdbinary):
    assert run(CUBE, "--preview", "-o", "-") == 0
    out, err = capfdbinary.readouterr()
    assert out.startswith(b"\x89PNG") and "▀".encode() in err
