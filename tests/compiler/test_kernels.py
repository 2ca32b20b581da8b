"""Check where compiled kernels are kept: in a folder of their own, and nowhere if nothing is writable."""

import os
import shutil
import subprocess
import sys
import time

import pytest
from helpers.raster import ROOT

from rasterizer.compiler import kernels

DAY = 24 * 3600
TINY = """
import numpy as np
from rasterizer.compiler import kernels
from rasterizer.geometry.surfaces import compute_clearance

corners = np.array([(0.0, 3.0, 0.0), (0.0, 0.0, 4.0), (0.0, 0.0, 0.0)])
clearance = compute_clearance(corners, np.array([[0], [1], [2]], np.uint32), 101.0, 0.0, 0.0)
assert 97 < clearance < 100, clearance
"""


def run(folder, program, package=ROOT, **variables):
    """Run a program from a file in `folder`, with a copy of the environment; return what it printed."""
    script = folder / "program.py"
    script.write_text(program)
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment |= {"PYTHONPATH": str(package), **{k: str(v) for k, v in variables.items()}}
    done = subprocess.run(
        [sys.executable, script], env=environment, cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"ended with {done.returncode}: {done.stderr[-1500:]}"
    assert not done.stderr, done.stderr
    return done.stdout.strip()


@pytest.fixture
def package(tmp_path):
    """A copy of the package into which no kernel can be written: its __pycache__ is a file."""
    copy = tmp_path / "copy" / "rasterizer"
    shutil.copytree(ROOT / "rasterizer", copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "__pycache__").write_text("")
    return copy.parent


def test_an_asked_folder_holds_the_kernels(tmp_path):
    """The first process compiles, the second one finds what the first has left."""
    folder = tmp_path / "made" / "when needed"
    told = """
hits = sum(compute_clearance.stats.cache_hits.values())
print(kernels.CACHE_FOLDER.parent, cold, kernels.is_cache_cold(), hits)
"""
    program = TINY.replace("corners =", "cold = kernels.is_cache_cold()\ncorners =") + told
    assert run(tmp_path, program, NUMBA_CACHE_DIR=folder) == f"{folder} True False 0"
    assert run(tmp_path, program, NUMBA_CACHE_DIR=folder) == f"{folder} False False 1"


def unwritable(tmp_path, kind):
    """A place in which no folder can be made, or in which nothing can be written by anybody but root."""
    place = tmp_path / "place"
    if kind == "a read-only folder":
        place.mkdir(mode=0o500)
        return place
    place.write_text("precious")
    return place if kind == "a file" else place / "below"


@pytest.mark.parametrize("kind", ["a file", "below a file", "a read-only folder"])
def test_an_asked_folder_that_cannot_be_written_is_done_without(tmp_path, kind):
    place = unwritable(tmp_path, kind)
    told = run(tmp_path, TINY + "\nprint(kernels.CACHE_FOLDER, kernels.is_cache_cold())", NUMBA_CACHE_DIR=place)
    if kind == "a read-only folder" and os.access(place, os.W_OK):
        assert told.startswith(str(place)) and told.endswith("False")  # root may write everywhere
    else:
        assert told == "None True"
    if place.is_file():
        assert place.read_text() == "precious"


def test_whole_pictures_without_a_cache(tmp_path):
    """Batch functions take a way of their own into the cache."""
    program = """
from rasterizer.compiler import kernels
from rasterizer.pipeline.light_kinds import LIGHT_FUNCTIONS
import numpy as np

function = kernels.batch_function(LIGHT_FUNCTIONS["directional"].evaluate, np.float32)
assert function.address and function is kernels.batch_function(LIGHT_FUNCTIONS["directional"].evaluate, np.float32)
print(kernels.CACHE_FOLDER)
"""
    place = tmp_path / "file"
    place.write_text("")
    assert run(tmp_path, program, NUMBA_CACHE_DIR=place) == "None"


def test_a_package_that_cannot_be_written_uses_the_users_cache(tmp_path, package):
    told = TINY + "\nprint(kernels.CACHE_FOLDER)"
    home = tmp_path / "home"
    assert run(tmp_path, told, package, HOME=home, XDG_CACHE_HOME="").startswith(str(home / ".cache" / "rasterizer"))
    cache = tmp_path / "cache"
    assert run(tmp_path, told, package, XDG_CACHE_HOME=cache).startswith(str(cache / "rasterizer"))
    assert list((cache / "rasterizer").rglob("*.kernel"))


def test_nothing_writable_at_all(tmp_path, package):
    program = "import os, pwd\nos.environ.pop('HOME')\n"
    program += "pwd.getpwuid = {}.__getitem__\n"  # nobody has an entry
    file = tmp_path / "file"
    file.write_text("")
    program += TINY + "\nprint(kernels.CACHE_FOLDER)"
    assert run(tmp_path, program, package, XDG_CACHE_HOME=file) == "None"
    assert run(tmp_path, program, package, XDG_CACHE_HOME="relative") == "None"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy", "file", "program.py"]


def test_a_caller_keeps_a_cache_folder_of_his_own(tmp_path):
    """Neither the setting nor his functions may land where ours are, and ours not with his."""
    his, ours = tmp_path / "his", tmp_path / "ours"
    program = f"""
import numba
numba.config.CACHE_DIR = {str(his)!r}
{TINY}
from rasterizer.pipeline.light_kinds import LIGHT_FUNCTIONS
kernels.batch_function(LIGHT_FUNCTIONS["directional"].evaluate, np.float64)
assert numba.config.CACHE_DIR == {str(his)!r}

@numba.njit(cache=True)
def twice(x):
    return 2 * x

assert twice(4) == 8
print(kernels.CACHE_FOLDER.parent)
"""
    assert run(tmp_path, program, NUMBA_CACHE_DIR=ours) == str(ours)
    made = {
        folder.name: {path.name.split("-")[0] for end in ("nbi", "kernel") for path in folder.rglob(f"*.{end}")}
        for folder in (his, ours)
    }
    assert made["his"] == {"program.twice"}
    assert made["ours"] == {"surfaces.compute_clearance", "light_kinds.directional"}


@pytest.mark.parametrize("value", [None, "", "somewhere"])
def test_importing_leaves_the_setting_as_it_was(tmp_path, value):
    variables = {} if value is None else {"NUMBA_CACHE_DIR": tmp_path / value if value else ""}
    program = "import numba\nbefore = numba.config.CACHE_DIR\n" + TINY + "assert numba.config.CACHE_DIR == before\n"
    run(tmp_path, program + "print(before)", **variables)


def test_using_kernels_keeps_them_young(tmp_path):
    """Folders are removed by age: one that is used every day must not look as old as its first day."""
    told = TINY + "print(kernels.CACHE_FOLDER)"
    folder = run(tmp_path, told, NUMBA_CACHE_DIR=tmp_path)
    os.utime(folder, (0, 0))
    assert run(tmp_path, told, NUMBA_CACHE_DIR=tmp_path) == folder
    age = (time.time() - os.stat(folder).st_mtime) / DAY
    assert age < 1, f"used a moment ago, and still {age:.0f} days old > 1"


def test_the_folder_depends_on_the_sources_of_kernels_and_on_nothing_else(tmp_path, package):
    """A helper that changed in any file must not meet kernels that were compiled with the old one."""
    program = "from rasterizer.compiler import kernels\nprint(kernels.CACHE_FOLDER.name)"

    def name():
        return run(tmp_path, program, package, NUMBA_CACHE_DIR=tmp_path / "cache")

    first = name()
    assert first == kernels.CACHE_FOLDER.name
    (package / "rasterizer" / "options.py").open("a").write("\n# no kernel here\n")
    assert name() == first
    for changed in ("pipeline/simd.py", "pipeline/fragments.py", "geometry/creases.py", "compiler/kernels.py"):
        (package / "rasterizer" / changed).open("a").write("\n# changed\n")
        second = name()
        assert second != first, changed
        first = second
