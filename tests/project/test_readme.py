"""The README: its examples run, and its pictures are what the commands beside them make."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from helpers.raster import HAS_TOML
from PIL import Image

from rasterizer.cli import main

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
PICTURES = re.findall(r"!\[[^]]*\]\((models/pictures/[^)]+)\)", README)
COMMANDS = re.findall(r"`raster ((?:render|compare) [^`]+ -o [^`]+)`", README)


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A folder that looks like a checkout, for commands that write where they stand."""
    (tmp_path / "models").symlink_to(ROOT / "models")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_readme_has_examples_and_pictures():
    assert len(EXAMPLES) >= 3
    assert len(PICTURES) == len(COMMANDS) >= 6


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_runs(example, checkout):
    exec(compile(example, "README.md", "exec"), {})


@pytest.mark.parametrize(("picture", "command"), list(zip(PICTURES, COMMANDS, strict=True)))
def test_a_picture_is_what_its_command_makes(picture, command, checkout):
    assert main(shlex.split(command)) == 0
    made, kept = (np.asarray(Image.open(p).convert("RGBA"), int) for p in (Path(picture).name, ROOT / picture))
    assert made.shape == kept.shape
    # Another processor may round the last bit of a float otherwise, and so a level.
    difference = np.abs(made - kept)
    assert difference.max() <= 1, f"levels differ by {difference.max()} > 1"
    assert (difference > 0).mean() <= 0.001, f"{(difference > 0).mean():.4f} of the values differ > 0.001"


@pytest.mark.skipif(not HAS_TOML, reason="TOML needs Python 3.11, or tomli")
def test_the_scene_file_is_one(checkout):
    (text,) = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    Path("scene.toml").write_text(text, encoding="utf-8")
    # Here models is a link that leads out of the folder.
    assert main(["render", "scene.toml", "-s", "64x48", "-o", "scene.png", "--allow-outside"]) == 0
    assert len(np.unique(np.asarray(Image.open("scene.png")))) > 50


def test_it_opens_with_the_two_commands():
    commands = re.findall(r"^    (python3 -m venv .*)$", README, re.MULTILINE)
    assert [c.rsplit("&& ", 1)[1] for c in commands] == [
        ".venv/bin/raster render models/teapot.obj --shading gouraud -o teapot.png",
        ".venv/bin/python -m pytest",
    ]
