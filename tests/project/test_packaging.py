"""What is built, installed and taken away again: names, the long description, the source archive, a wheel."""

import configparser
import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path

import llvmlite
import numpy as np
import PIL
import pytest
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz
from rasterizer.compiler import fingerprint, kernels

NOT_SOURCE = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "dist", "kernels", "*.whl")


def setup_cfg():
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    return setup


def run(command, cwd, **variables):
    environment = {**os.environ, **variables}
    environment.pop("PYTHONPATH", None)
    command = list(map(str, command))
    done = subprocess.run(
        list(map(str, command)), env=environment, cwd=cwd, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{done.stdout[-1500:]}{done.stderr[-1500:]}"
    return done.stdout


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A copy of the tree, in which building leaves what it likes."""
    pytest.importorskip("setuptools.command.bdist_wheel")
    copy = tmp_path_factory.mktemp("source") / "tree"
    shutil.copytree(ROOT, copy, ignore=NOT_SOURCE)
    for name in (".ci", ".pre-commit-config.yaml"):
        if (ROOT / name).exists():
            (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(ROOT / name, copy / name)
    return copy


def build(source, what, folder):
    """Build an archive by the back end that pip calls."""
    code = f"from setuptools import build_meta as b; b.build_{what}({str(folder)!r})"
    run([sys.executable, "-c", code], source)
    (made,) = folder.iterdir()
    return made


@pytest.fixture(scope="module")
def built(source, tmp_path_factory):
    """The source archive; what it holds, unpacked; and the wheel that is built of that, as pip does it."""
    folder = tmp_path_factory.mktemp("built")
    for name in ("sdist", "wheel"):
        (folder / name).mkdir()
    archive = build(source, "sdist", folder / "sdist")
    with tarfile.open(archive) as file:
        file.extractall(folder, filter="data") if hasattr(tarfile, "data_filter") else file.extractall(folder)
    unpacked = folder / archive.name.removesuffix(".tar.gz")
    return archive, unpacked, build(unpacked, "wheel", folder / "wheel")


def files_of(folder) -> set[str]:
    """The files of a folder of this tree that are no leftovers, by their paths in the tree."""
    found = (path.relative_to(ROOT).as_posix() for path in (ROOT / folder).rglob("*.*") if path.is_file())
    return {path for path in found if "__pycache__" not in path and not re.search(r"\.(kernel|pyc)$", path)}


def test_archives_hold_what_they_should_and_nothing_else(built):
    """Of the source all that tests and pages need; of the package its code, types, demonstration and viewer."""
    archive, unpacked, wheel = built
    assert archive.name.replace("-", "_") == f"scanline_rasterizer_{rz.__version__}.tar.gz"
    assert wheel.name == f"scanline_rasterizer-{rz.__version__}-py3-none-any.whl"
    in_source = {path.relative_to(unpacked).as_posix() for path in unpacked.rglob("*") if path.is_file()}
    missing = set.union(*map(files_of, ("tests", "bench", "models", "rasterizer"))) - in_source
    assert not missing, sorted(missing)[:5]
    with zipfile.ZipFile(wheel) as file:
        in_wheel = {name for name in file.namelist() if ".dist-info/" not in name}
    pages = {name for name in files_of("rasterizer") if name.endswith(".md")}
    assert in_wheel == files_of("rasterizer") - pages
    assert {f"rasterizer/{name}" for name in ("py.typed", "__init__.pyi", "demo/still_life.obj")} <= in_wheel


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """A folder with an environment in it that sees the packages of this one, and has none of its own."""
    folder = tmp_path_factory.mktemp("installed")
    run([sys.executable, "-m", "venv", "--without-pip", "venv"], folder)
    return folder


PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check"]


def see_packages(folder):
    """Write what lets a program in an environment find the packages of this one."""
    (folder / "others.py").write_text(
        "import sys\n"
        f"sys.path += {[each for each in sys.path if each.endswith('-packages')]!r}\n"
        "import numpy, llvmlite\n"
    )


@pytest.mark.skipif(os.name != "posix", reason="folders of POSIX")
@pytest.mark.skipif(kernels.STORE.own is None, reason="there is no store")
def test_a_wheel_of_the_source_archive_is_installed_draws_and_leaves_nothing_behind(built, environment, tmp_path):
    pytest.importorskip("pip")
    _, _, wheel = built
    python = environment / "venv" / "bin" / "python"
    (site,) = (environment / "venv" / "lib").glob("python*/site-packages")
    before = set(site.rglob("*"))
    pip = [*PIP, "--python", python]
    run([*pip, "install", "-q", "--no-deps", "--no-index", wheel], tmp_path)
    # What messages propose for an extra is taken, and asks no index for the package itself.
    run([*pip, "install", "-q", "--no-deps", "--no-index", "scanline-rasterizer[exr]"], tmp_path)
    see_packages(environment)
    # Kernels that this process's store has, where the user's cache would keep them: nothing is compiled.
    cache, own = tmp_path / "cache", kernels.STORE.own
    shutil.copytree(own, cache / "rasterizer" / own.name)
    for path in (cache, cache / "rasterizer", cache / "rasterizer" / own.name):
        path.chmod(0o700)
    settings = {"XDG_CACHE_HOME": str(cache), "RASTER_STORE": "", "NUMBA_CACHE_DIR": ""}
    raster = environment / "venv" / "bin" / "raster"
    assert run([raster, "--version"], tmp_path).strip() == f"raster {rz.__version__}"
    program = (
        "exec(open('others.py').read())\n"
        "import rasterizer as rz\n"
        "from rasterizer.compiler.kernels import STORE\n"
        "frame = rz.render(rz.demo_model(), 64)\n"
        "frame.save('picture.png')\n"
        "print(rz.__file__, STORE.own, frame.stats.coverage > 0.1, sep='\\n')"
    )
    told = run([python, "-c", program], environment, **settings).splitlines()
    assert Path(told[0]).is_relative_to(site) and Path(told[1]).is_relative_to(cache) and told[2] == "True"
    with Image.open(environment / "picture.png") as image:
        assert image.size == (64, 64) and image.convert("L").getextrema()[0] < 100
    run([*pip, "uninstall", "-q", "-y", "scanline-rasterizer"], tmp_path)
    left = {path for path in set(site.rglob("*")) - before if path.is_file()}
    assert not left and not raster.exists(), left
    code = "import importlib.util, sys; sys.path[:1] = []; print(importlib.util.find_spec('rasterizer'))"
    assert run([python, "-c", code], tmp_path).strip() == "None"


# Draws without numba, on a processor that can do no more than its level asks for, and prints the levels of the kernels
# that were opened: each file says for which it was made.
FIRST_PICTURES = """
import importlib.util, os, sys
packages, level, version = sys.argv[1:]
sys.path.append(packages)
assert importlib.util.find_spec("numba") is None
from rasterizer.compiler import fingerprint
if level:
    can_do = fingerprint.PROCESSOR_LEVELS[level]
    fingerprint.read_processor = lambda: ("another", list(can_do))
if version:
    fingerprint.numba_version = lambda: version
opened = set()
sys.addaudithook(lambda event, given: opened.add(given[0]) if event == "open" else None)
import rasterizer as rz
for shading in ("flat", "gouraud", "phong"):
    assert rz.render(rz.demo_model(), 64, shading=shading).stats.coverage > 0.1
found = set()
for path in (path for path in opened if str(path).endswith(".kernel") and os.path.exists(path)):
    with open(path, "rb") as file:
        content = file.read()
    found |= {name for name in fingerprint.PROCESSOR_LEVELS if f"'{name}')".encode() in content}
print(*found)
"""


@pytest.fixture
def without_numba(tmp_path):
    """A folder with what draws pictures by kernels that are compiled already: all that is required, but for numba."""
    folder = tmp_path / "packages"
    folder.mkdir()
    for module in (np, PIL, llvmlite):
        package = Path(module.__file__).parent
        for path in {package, package.parent / f"{package.name}.libs", package.parent / "pillow.libs"}:
            if path.exists() and not (folder / path.name).exists():
                (folder / path.name).symlink_to(path)
    return folder


@pytest.mark.nightly  # all kernels are compiled, for two levels
@pytest.mark.skipif(os.name != "posix", reason="folders of POSIX")
def test_a_wheel_with_kernels_is_for_its_platform_and_draws_its_first_picture_without_numba(
    source, without_numba, tmp_path
):
    """It takes the best level that a processor has, whichever version of numba is there, or none."""
    pytest.importorskip("pip")
    tmp_path.chmod(0o700)
    tree = shutil.copytree(source, tmp_path / "tree", ignore=NOT_SOURCE)
    levels = ("x86-64-v2", "x86-64-v3") if platform.machine() in ("x86_64", "AMD64") else ("generic",)
    for level in levels:
        run([sys.executable, "-m", "rasterizer", "warmup", "--into", "rasterizer/kernels", "--cpu", level], tree)
    (tmp_path / "dist").mkdir()
    wheel = build(tree, "wheel", tmp_path / "dist")
    where = re.sub(r"\W", "_", sysconfig.get_platform())
    assert wheel.name == f"scanline_rasterizer-{rz.__version__}-py3-none-{where}.whl"
    run([*PIP, "install", "-q", "--no-deps", "--no-index", "--target", tmp_path / "site", wheel], tmp_path)
    best = next(level for level in fingerprint.usable_processors()[1:] if level in levels)
    for level in ("", *levels[: levels.index(best) + 1]):  # "" is this processor
        for version in ("", "0.61.0", "0.99.0"):
            told = run(
                [sys.executable, "-S", "-c", FIRST_PICTURES, without_numba, level, version], tmp_path / "site",
                XDG_CACHE_HOME=str(tmp_path / "cache"), RASTER_STORE="", NUMBA_CACHE_DIR="", NUMBA_CPU_NAME="",
            )  # fmt: skip
            assert told.strip() == (level or best), (level, version)
    assert not list((tmp_path / "cache").rglob("*.kernel")), "nothing is compiled"
