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
from pathlib import Path

import pytest
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.compiler import kernels

NOT_SOURCE = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "dist", "kernels", "*.whl")


def setup_cfg():
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    return setup


def test_the_distribution_has_a_name_of_its_own_and_no_invented_address():
    found = setup_cfg()["metadata"]
    assert found["name"] == "scanline-rasterizer"
    assert not {"url", "project_urls", "author", "author_email", "maintainer", "download_url"} & set(found)


def test_the_long_description_has_no_link_that_only_a_checkout_has():
    found = setup_cfg()["metadata"]
    assert "rasterizer" in found["long_description"] and "](" not in found["long_description"]


def test_what_is_required_is_used():
    """Of every required package some module is imported by this one."""
    required = re.findall(r"^([\w-]+)", setup_cfg()["options"]["install_requires"], re.MULTILINE)
    modules = {name: {"Pillow": "PIL"}.get(name, name) for name in required}
    text = "\n".join(path.read_text(encoding="utf-8") for path in Path(rz.__file__).parent.rglob("*.py"))
    unused = [
        name for name, module in modules.items() if not re.search(rf"^ *(import|from) {module}\b", text, re.MULTILINE)
    ]
    assert len(required) >= 5 and not unused, unused


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


def modules_of_extras() -> list[str]:
    """The names by which the packages of all extras are imported, but for those that README's test command installs."""
    extras = setup_cfg()["options.extras_require"]
    needed = {name: set(re.findall(r"^[\w-]+", lines, re.MULTILINE)) for name, lines in extras.items()}
    names = set.union(*needed.values()) - needed["test"] - {"scanline-rasterizer"}
    return sorted(name.replace("-", "_") for name in names)


@pytest.mark.nightly  # an archive is built, and all tests are imported
def test_the_tests_of_the_source_archive_can_be_collected(source, tmp_path):
    (tmp_path / "dist").mkdir()
    archive = build(source, "sdist", tmp_path / "dist")
    assert archive.name.replace("-", "_") == f"scanline_rasterizer_{rz.__version__}.tar.gz"
    with tarfile.open(archive) as file:
        names = {member.name.partition("/")[2] for member in file.getmembers() if member.isfile()}
        file.extractall(tmp_path, filter="data") if hasattr(tarfile, "data_filter") else file.extractall(tmp_path)
    for folder in ("tests", "bench", "models", "rasterizer"):
        paths = {path.relative_to(ROOT).as_posix() for path in (ROOT / folder).rglob("*.*") if path.is_file()}
        paths = {path for path in paths if "__pycache__" not in path and not re.search(r"\.(kernel|pyc)$", path)}
        assert paths <= names, sorted(paths - names)[:5]
    unpacked = tmp_path / archive.name.removesuffix(".tar.gz")
    # A module that skips itself where an extra is missing would drop out here: its tests must skip themselves.
    hidden = dict.fromkeys(modules_of_extras())
    code = f"import sys, pytest; sys.modules.update({hidden}); sys.exit(pytest.main(sys.argv[1:]))"
    told = run(
        [sys.executable, "-c", code, "--collect-only", "-q", "-n", "0", "-m", "", "-p", "no:cacheprovider"], unpacked
    )
    counts = dict(re.findall(r"^(tests/[\w/]+\.py): (\d+)$", told, re.MULTILINE))
    assert counts.keys() == {path.relative_to(ROOT).as_posix() for path in (ROOT / "tests").rglob("test_*.py")}


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


@pytest.mark.nightly  # a wheel is built and installed, in an environment of its own
@pytest.mark.skipif(os.name != "posix", reason="folders of POSIX")
@pytest.mark.skipif(kernels.STORE.own is None, reason="there is no store")
def test_after_a_wheel_is_removed_nothing_is_left_to_import(source, environment, tmp_path):
    pytest.importorskip("pip")
    (tmp_path / "dist").mkdir()
    wheel = build(source, "wheel", tmp_path / "dist")
    assert wheel.name == f"scanline_rasterizer-{rz.__version__}-py3-none-any.whl"
    python = environment / "venv" / "bin" / "python"
    (site,) = (environment / "venv" / "lib").glob("python*/site-packages")
    before = set(site.rglob("*"))
    pip = [*PIP, "--python", python]
    run([*pip, "install", "-q", "--no-deps", "--no-index", wheel], tmp_path)
    see_packages(environment)
    # Kernels that this process's store has, where the user's cache would keep them: nothing is compiled.
    cache, own = tmp_path / "cache", kernels.STORE.own
    shutil.copytree(own, cache / "rasterizer" / own.name)
    for path in (cache, cache / "rasterizer", cache / "rasterizer" / own.name):
        path.chmod(0o700)
    settings = {"XDG_CACHE_HOME": str(cache), "RASTER_STORE": "", "NUMBA_CACHE_DIR": ""}
    program = (
        "exec(open('others.py').read())\n"
        "import rasterizer as rz\n"
        "from rasterizer.compiler.kernels import STORE\n"
        "frame = rz.render(rz.demo_model(), 64)\n"
        "print(rz.__file__, STORE.own, frame.stats.coverage > 0.1, sep='\\n')"
    )
    told = run([python, "-c", program], environment, **settings).splitlines()
    assert Path(told[0]).is_relative_to(site) and Path(told[1]).is_relative_to(cache) and told[2] == "True"
    assert (environment / "venv" / "bin" / "raster").exists() and (site / "rasterizer" / "py.typed").exists()
    run([*pip, "uninstall", "-q", "-y", "scanline-rasterizer"], tmp_path)
    left = {path for path in set(site.rglob("*")) - before if path.is_file()}
    assert not left and not (environment / "venv" / "bin" / "raster").exists(), left
    code = "import importlib.util, sys; sys.path[:1] = []; print(importlib.util.find_spec('rasterizer'))"
    assert run([python, "-c", code], tmp_path).strip() == "None"


@pytest.mark.nightly  # all kernels are compiled
@pytest.mark.skipif(os.name != "posix", reason="folders of POSIX")
def test_a_wheel_with_kernels_is_for_its_platform_and_draws_its_first_picture_without_numba(source, tmp_path):
    """Its kernels are for a processor that many have; with another version of numba they are used as well."""
    pytest.importorskip("pip")
    tmp_path.chmod(0o700)
    tree = shutil.copytree(source, tmp_path / "tree", ignore=NOT_SOURCE)
    level = "x86-64-v2" if platform.machine() in ("x86_64", "AMD64") else "generic"
    run([sys.executable, "-m", "rasterizer", "warmup", "--into", "rasterizer/kernels", "--cpu", level], tree)
    (tmp_path / "dist").mkdir()
    wheel = build(tree, "wheel", tmp_path / "dist")
    where = re.sub(r"\W", "_", sysconfig.get_platform())
    assert wheel.name == f"scanline_rasterizer-{rz.__version__}-py3-none-{where}.whl"
    run([*PIP, "install", "-q", "--no-deps", "--no-index", "--target", tmp_path / "site", wheel], tmp_path)
    see_packages(tmp_path / "site")
    program = (
        "exec(open('others.py').read())\n"
        "from rasterizer.compiler import fingerprint\n"
        "fingerprint.numba_version = lambda: {!r}\n"
        "import rasterizer as rz\n"
        "for shading in ('flat', 'gouraud', 'phong'):\n"
        "    assert rz.render(rz.demo_model(), 64, shading=shading).stats.coverage > 0.1\n"
        "print('numba' in sys.modules)"
    )
    for version in ("0.99.0", "0.61.0"):
        told = run(
            [sys.executable, "-c", program.format(version)], tmp_path / "site",
            XDG_CACHE_HOME=str(tmp_path / "cache"), RASTER_STORE="", NUMBA_CACHE_DIR="",
        )  # fmt: skip
        assert told.strip() == "False"
    assert not list((tmp_path / "cache").rglob("*.kernel")), "nothing is compiled"
