"""A package that came with a store of kernels draws its first picture where nothing can be compiled or written.

`.ci/run` does the same with a wheel that pip builds and installs."""

import os
import shutil
import subprocess
import sys

import pytest
from helpers.raster import ROOT

from rasterizer.compiler import kernels, store

# Importing the compiler fails, though it is installed, and the user has no home.
NO_COMPILER = """
import importlib.machinery, os, pwd, sys

class Refuses:
    def create_module(self, spec):
        return None

    def exec_module(self, module):
        raise ImportError(f"{module.__name__} is imported")

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name != "numba":
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path)
        spec.loader = Refuses()
        return spec

def nobody(number):
    raise KeyError(number)

sys.meta_path.insert(0, Finder())
pwd.getpwuid = nobody
"""
SHOWS = """
import rasterizer
from rasterizer.compiler.kernels import STORE
print(rasterizer.__file__, len(STORE.folders), STORE.own, *STORE.reasons, sep="\\n")
"""
pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(os.name != "posix", reason="homes of POSIX"),
    pytest.mark.skipif(kernels.STORE.own is None, reason="there is no store"),
]


def run(command, cwd, **variables):
    done = subprocess.run(list(map(str, command)), env=variables, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{done.stdout[-500:]}{done.stderr[-1500:]}"
    return done


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder that only the user can write to."""
    found = tmp_path_factory.mktemp("shipped")
    found.chmod(0o700)
    return found


@pytest.fixture(scope="module")
def package(place):
    """What a wheel of the package has in it, with the kernels of this process's store, where packages are installed, in
    an environment in which numba can't be imported."""
    source = place / "source"
    source.mkdir()
    for name in ("setup.cfg", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    leave_out = shutil.ignore_patterns("__pycache__", "kernels")
    shutil.copytree(ROOT / "rasterizer", source / "rasterizer", ignore=leave_out)
    own = kernels.STORE.own
    shutil.copytree(own, source / "rasterizer" / "kernels" / own.name)
    run([sys.executable, "-m", "venv", "--without-pip", "venv"], place, **os.environ)
    (site,) = (place / "venv" / "lib").glob("python*/site-packages")
    run(
        [sys.executable, "-c", "from setuptools import setup; setup()", "-q", "build_py", "-d", site],
        source,
        **os.environ,
    )
    (site / "others.pth").write_text("\n".join(each for each in sys.path if each.endswith("-packages")))
    (site / "sitecustomize.py").write_text(NO_COMPILER)
    return site / "rasterizer"


@pytest.fixture
def python(place, package):
    """The interpreter of the environment in which the package is installed."""
    return place / "venv" / "bin" / "python"


def homeless(place) -> dict:
    """An environment in which no folder can be written."""
    (place / "file").touch()
    return {"HOME": str(place / "file" / "home"), "XDG_CACHE_HOME": str(place / "file"), "PATH": os.defpath}


def test_the_kernels_are_installed_with_the_package(package):
    own = kernels.STORE.own
    stored = {path.name for path in own.iterdir() if not path.name.endswith(store.HALF_WRITTEN)}
    assert len(stored) > 40 and stored <= {path.name for path in (package / "kernels" / own.name).iterdir()}


def test_its_first_picture_is_drawn_without_compiling(place, python):
    told = run([python, "-c", SHOWS], place, **homeless(place)).stdout.splitlines()
    assert told[0].startswith(str(place)) and told[1:3] == ["1", "None"] and len(told) > 3
    command = [python, "-m", "rasterizer", "render", ROOT / "models" / "cube.obj", "-s", "64x48"]
    done = run([*command, "-o", place / "x.png", "--shading", "phong"], place, **homeless(place))
    assert "compiling" not in done.stderr
    here = [sys.executable, "-m", "rasterizer", *command[3:], "-o", place / "y.png", "--shading", "phong"]
    run(here, place, **{**os.environ, "PYTHONPATH": str(ROOT)})
    assert (place / "x.png").read_bytes() == (place / "y.png").read_bytes()


def test_kernels_of_other_sources_are_not_used(place, package, python):
    """Somebody has changed the installed package."""
    changed = package / "pipeline" / "scan.py"
    before = changed.read_bytes()
    try:
        changed.write_bytes(before + b"\n# changed\n")
        told = run([python, "-c", SHOWS], place, **homeless(place)).stdout.splitlines()
    finally:
        changed.write_bytes(before)
    assert told[1:3] == ["0", "None"]


def test_kernels_for_other_settings_are_not_used(place, python):
    told = run([python, "-c", SHOWS], place, NUMBA_OPT="0", **homeless(place)).stdout.splitlines()
    assert told[1:3] == ["0", "None"]
