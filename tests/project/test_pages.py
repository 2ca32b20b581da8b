"""The pages: their examples run, their commands make their pictures and end as they say, and what they name exists."""

import glob
import re
import shlex
import shutil
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from helpers.pages import (
    PAGES,
    anchors,
    blocks,
    chapters,
    commands,
    console_lines,
    links,
    named_files,
    shell_lines,
    text_of,
)
from helpers.raster import ROOT
from PIL import Image

from rasterizer.cli import main

PICTURES = ROOT / "models" / "pictures"
GALLERY, RECIPES = "models/README.md", "rasterizer/recipes.md"
LINES = [line for page in PAGES for line in commands(page)]
WRITTEN = (
    "teapot.png",
    "MODEL.png",
    "scene.json",
    "cube.obj",
    "models_info.json",
    "camera.json",
    "transforms.json",
)  # what examples write or only speak of
PYTHON = r"^```python\n(.*?)^```"
nightly = pytest.mark.nightly


def output_of(command) -> str:
    """The name after -o."""
    words = shlex.split(command)
    return words[words.index("-o") + 1]


@pytest.fixture
def checkout(folder):
    """A folder that looks like a checkout, for commands that write where they stand."""
    (folder / "models").symlink_to(ROOT / "models")
    return folder


# ---------------------------------------------------------------- examples


def examples():
    """Every example in Python, of a recipe all of its steps; those that start processes or draw a lot run at night."""
    for page in PAGES:
        recipes = {title: re.findall(PYTHON, text, re.DOTALL | re.MULTILINE) for title, text in chapters(page).items()}
        texts = ["\n".join(steps) for steps in recipes.values() if steps] if page == RECIPES else blocks(page, "python")
        for k, text in enumerate(texts):
            text = text.replace("N_VIEW = 1000", "N_VIEW = 10")
            is_long = "N_VIEW" not in text and re.search(r"render_many|Animation|turntable|speed_error", text)
            yield pytest.param(text, id=f"{page}-{k}", marks=[nightly] if is_long else [])


@pytest.mark.parametrize("example", list(examples()))
def test_an_example_runs(example, checkout, monkeypatch):
    """As a module of its own, because dataclasses and readers are looked up by the name of theirs."""
    for name in set(re.findall(r"^(?:import|from) (cv2|pycocotools)", example, re.MULTILINE)):
        pytest.importorskip(name, reason=f"an example reads files by {name}")
    module = ModuleType("example_of_a_page")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    exec(compile(example, "page", "exec"), vars(module))


# ---------------------------------------------------------------- pictures


def telling() -> set[str]:
    """Few of the commands that have together what all of them have: each command, flag and kind of light."""
    words = {line: set(re.findall(r"^\w+|--[\w-]+|\b[a-z]+(?=:)", line.partition(" -o ")[0])) for line in sorted(LINES)}
    # Sixteen samples take long, and what the room needs is compiled for nothing else.
    words = {line: found for line, found in words.items() if "--samples" not in found and "room" not in line}
    chosen, seen = set(), set()
    while not seen >= set().union(*words.values()):
        best = max(words, key=lambda line: len(words[line] - seen))
        chosen.add(best)
        seen |= words[best]
    return chosen


DRAWN = telling()


@pytest.mark.parametrize(
    "command", [pytest.param(c, marks=[] if c in DRAWN else [nightly]) for c in dict.fromkeys(LINES)]
)
def test_a_picture_is_what_its_command_makes(command, checkout):
    assert main(shlex.split(command)) == 0
    name = output_of(command)
    made, kept = (np.asarray(Image.open(path).convert("RGBA"), int) for path in (name, PICTURES / name))
    assert made.shape == kept.shape
    # Another processor may round the last bit of a float otherwise, and so a level.
    difference = np.abs(made - kept)
    assert difference.max() <= 1, f"levels differ by {difference.max()} > 1"
    assert (difference > 0).mean() <= 0.001, f"{(difference > 0).mean():.4f} of the values differ > 0.001"


def test_the_scene_file_is_one(checkout):
    (text,) = blocks(GALLERY, "json")
    Path("scene.json").write_text(text, encoding="utf-8")
    # Here models is a link that leads out of the folder.
    assert main(["render", "scene.json", "-s", "64x48", "-o", "scene.png", "--allow-outside"]) == 0
    assert len(np.unique(np.asarray(Image.open("scene.png")))) > 50


# ---------------------------------------------------------------- shell lines


def lines():
    """What is typed on the pages, with the exit code that they say; what draws many pictures is run at night."""
    for page in PAGES:
        for line, code in console_lines(page):
            is_long = re.match(r"render models|compare|batch|warmup|sheet|turntable|demo|.*--array all", line)
            yield pytest.param(line, code, id=f"{page}-{line}", marks=[nightly] if is_long else [])


# A triangle with a number at each corner.
SCAN = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
property float quality
element face 1
property list uchar int vertex_indices
end_header
0 0 0 0.5
1 0 0 0.2
0 1 0 0.9
3 0 1 2
"""


@pytest.mark.parametrize(("line", "expected"), list(lines()))
def test_a_line_of_a_page_runs(line, expected, checkout, capsys):
    (checkout / "uploads" / "somebody").mkdir(parents=True)  # one of which is broken
    shutil.copy(ROOT / "models" / "gear.stl", checkout / "uploads" / "somebody")
    (checkout / "uploads" / "broken.stl").write_text("solid nothing")
    (checkout / "scan.ply").write_text(SCAN)
    np.save(checkout / "stress.npy", [0.0, 1.0, 3.0])
    words = [found for word in shlex.split(line) for found in (sorted(glob.glob(word)) or [word])]
    code = main(words)
    # A doctor may find something: a store that is switched off, say.
    assert code == expected or (words[0] == "doctor" and code == 1), capsys.readouterr().err
    if "thumbs/" in words:
        assert (checkout / "thumbs" / "somebody" / "gear.stl.webp").exists()


def test_the_scripts_take_the_arguments_that_the_page_gives_them():
    """Each command of bench/README.md is read by its script."""
    for line in re.findall(r"python bench/(.+?)(?:`|   |$)", text_of("bench/README.md"), re.MULTILINE):
        script, *arguments = shlex.split(line)
        module = import_module(f"bench.{script.removesuffix('.py')}")
        getattr(module, "make_parser", vars(module.main).get("make_parser"))().parse_args(arguments)


# ---------------------------------------------------------------- what is named


def test_every_link_file_and_test_that_is_named_exists():
    """A file as seen from the page's folder, from the root, or from a folder of the package or of the tests."""
    missing = []
    for page in PAGES:
        for target in links(page):
            path, _, anchor = target.partition("#")
            file = (ROOT / page).parent / path if path else ROOT / page
            is_there = file.exists() and (not anchor or anchor in anchors(file.resolve().relative_to(ROOT).as_posix()))
            missing += [] if is_there else [f"{page} links to {target}"]
        bases = [(ROOT / page).parent, ROOT, ROOT / "rasterizer", ROOT / "tests", ROOT / "tests" / "helpers"]
        bases += [path for path in (ROOT / "rasterizer").iterdir() if path.is_dir()]
        for name in named_files(page):
            if name not in WRITTEN and not any((base / name).exists() for base in bases):
                missing.append(f"{page} names {name}")
        words = [word for line in shell_lines(page) for word in line.split() if word.startswith("tests/")]
        missing += [f"{page} runs {word}" for word in words if not (ROOT / word).exists()]
    assert not missing, "; ".join(missing)
