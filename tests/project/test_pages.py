"""The pages: their examples run, their commands make their pictures, their links and file names lead somewhere."""

import argparse
import shlex
import sys
from pathlib import Path, PurePosixPath
from types import ModuleType

import numpy as np
import pytest
from helpers.pages import PAGES, anchors, blocks, commands, links, named_files, pictures, shell_lines, text_of
from helpers.raster import HAS_TOML, ROOT
from PIL import Image

from rasterizer.cli import main

sys.path.insert(0, str(ROOT))
from bench import (
    before_after,
    choices,
    encode,
    features,
    frame,
    fuzz,
    hard_cases,
    history,
    measure_all,
    peers,
    refinement,
    scale,
    startup,
    tables,
    throughput,
    tolerance,
    tolerance_modes,
)

PICTURES = ROOT / "models" / "pictures"
GALLERY = "models/README.md"
COMMANDS = {line: page for page in PAGES for line in commands(page)}
STEPS = ("rasterizer/io/README.md", "rasterizer/analysis/README.md")  # whose blocks go on where the last one ended
EXAMPLES = [
    pytest.param(text, id=f"{page}-{k}")
    for page in PAGES
    if page not in STEPS
    for k, text in enumerate(blocks(page, "python"))
] + [pytest.param("\n".join(blocks(page, "python")), id=page) for page in STEPS]
SCRIPT_MODULES = (
    before_after,
    choices,
    measure_all,
    encode,
    features,
    frame,
    peers,
    scale,
    startup,
    tables,
    tolerance,
    fuzz,
    hard_cases,
    history,
    refinement,
    throughput,
    tolerance,
    tolerance_modes,
)
SCRIPTS = {module.__name__.rpartition(".")[2]: module for module in SCRIPT_MODULES}
WRITTEN = ("teapot.png", "MODEL.png", "scene.toml", "cube.obj", "ball.json")  # what examples write or only speak of


def output_of(command) -> str:
    """The name after -o."""
    words = shlex.split(command)
    return words[words.index("-o") + 1]


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A folder that looks like a checkout, for commands that write where they stand."""
    (tmp_path / "models").symlink_to(ROOT / "models")
    monkeypatch.chdir(tmp_path)
    return tmp_path


# ---------------------------------------------------------------- what runs


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_runs(example, checkout, monkeypatch):
    """As a module of its own, because dataclasses and readers are looked up by the name of theirs."""
    module = ModuleType("example_of_a_page")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    exec(compile(example, "page", "exec"), vars(module))


def test_every_picture_of_the_gallery_has_a_command_and_is_shown():
    shown = [PurePosixPath(name).name for name in pictures(GALLERY)]
    assert len(shown) == len(set(shown)) >= 40
    assert sorted(map(output_of, commands(GALLERY))) == sorted(shown)
    kept = {path.name for path in PICTURES.iterdir()}
    assert kept == set(shown), f"only kept: {kept - set(shown)}; only shown: {set(shown) - kept}"


@pytest.mark.parametrize("command", COMMANDS)
def test_a_picture_is_what_its_command_makes(command, checkout):
    assert main(shlex.split(command)) == 0
    name = output_of(command)
    made, kept = (np.asarray(Image.open(path).convert("RGBA"), int) for path in (name, PICTURES / name))
    assert made.shape == kept.shape
    # Another processor may round the last bit of a float otherwise, and so a level.
    difference = np.abs(made - kept)
    assert difference.max() <= 1, f"levels differ by {difference.max()} > 1"
    assert (difference > 0).mean() <= 0.001, f"{(difference > 0).mean():.4f} of the values differ > 0.001"


@pytest.mark.skipif(not HAS_TOML, reason="TOML needs Python 3.11, or tomli")
def test_the_scene_file_is_one(checkout):
    (text,) = blocks(GALLERY, "toml")
    Path("scene.toml").write_text(text, encoding="utf-8")
    # Here models is a link that leads out of the folder.
    assert main(["render", "scene.toml", "-s", "64x48", "-o", "scene.png", "--allow-outside"]) == 0
    assert len(np.unique(np.asarray(Image.open("scene.png")))) > 50


def test_the_scripts_take_the_arguments_that_the_page_gives_them(monkeypatch):
    """Each command of bench/README.md is read by its script, which does nothing more."""

    class Read(Exception):
        """The arguments were understood."""

    parse = argparse.ArgumentParser.parse_args

    def stop(parser, argv=None, namespace=None):
        parse(parser, argv, namespace)
        raise Read

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", stop)
    found = [line.split("&& ")[-1] for line in text_of("bench/README.md").splitlines() if "python bench/" in line]
    found = [line[line.index("python bench/") :].partition("`")[0].partition("   ")[0] for line in found]
    assert len(found) >= 12
    for line in found:
        _, script, *arguments = shlex.split(line)
        with pytest.raises(Read):
            SCRIPTS[PurePosixPath(script).stem].main(arguments)


# ---------------------------------------------------------------- what is named


@pytest.mark.parametrize("page", PAGES)
def test_every_link_leads_somewhere(page):
    assert links(page) or page == "bench/README.md"
    for target in links(page):
        path, _, anchor = target.partition("#")
        file = (ROOT / page).parent / path if path else ROOT / page
        assert file.exists(), f"{page} links to {target}"
        if anchor:
            there = file.resolve().relative_to(ROOT).as_posix()
            assert anchor in anchors(there), f"{page} links to {target}; {there} has {sorted(anchors(there))}"


@pytest.mark.parametrize("page", PAGES)
def test_every_file_that_is_named_exists(page):
    """Seen from the page's folder, from the root, or from a folder of the package or of the tests."""
    bases = [(ROOT / page).parent, ROOT, ROOT / "rasterizer", ROOT / "tests", ROOT / "tests" / "helpers"]
    bases += [path for path in (ROOT / "rasterizer").iterdir() if path.is_dir()]
    for name in named_files(page):
        assert name in WRITTEN or any((base / name).exists() for base in bases), f"{page} names {name}"


def test_the_page_about_tests_lists_every_helper():
    there = {path.name for path in (ROOT / "tests" / "helpers").glob("*.py")} - {"__init__.py"}
    listed = {PurePosixPath(name).name for name in named_files("tests/README.md")}
    assert there <= listed, f"add to tests/README.md: {sorted(there - listed)}"


@pytest.mark.parametrize("page", PAGES)
def test_every_test_that_a_command_runs_exists(page):
    words = [word for line in shell_lines(page) for word in line.split() if word.startswith("tests/")]
    missing = [word for word in words if not (ROOT / word).exists()]
    assert not missing, f"{page}: {missing}"
