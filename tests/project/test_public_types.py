"""Every public name has types that another type checker knows, too: all parameters, results and attributes."""

import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec

import pytest
from helpers.raster import ROOT

import rasterizer as rz

pytestmark = pytest.mark.skipif(find_spec("pyright") is None, reason="pyright (the extra `lint`) isn't installed")


@pytest.mark.nightly  # pyright reads numpy's types, and all of the package
@pytest.mark.skipif(os.name != "posix", reason="folders of POSIX")
def test_pyright_knows_the_type_of_every_public_name(tmp_path):
    """pyright wants to see the package where packages are installed; others it finds beside it."""
    python = [sys.executable, "-m", "venv", "--without-pip", str(tmp_path / "venv")]
    subprocess.run(python, check=True, capture_output=True)
    (site,) = (tmp_path / "venv" / "lib").glob("python*/site-packages")
    shutil.copytree(ROOT / "rasterizer", site / "rasterizer", ignore=shutil.ignore_patterns("__pycache__", "kernels"))
    (site / "others.pth").write_text("\n".join(each for each in sys.path if each.endswith("-packages")))
    command = [sys.executable, "-m", "pyright", "--verifytypes", "rasterizer", "--ignoreexternal", "--outputjson"]
    (tmp_path / "empty").mkdir()
    path = f"{tmp_path / 'venv' / 'bin'}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        command, cwd=tmp_path / "empty", env={**os.environ, "PATH": path}, capture_output=True, text=True, check=False
    )
    if not done.stdout.lstrip().startswith("{"):
        pytest.skip(f"pyright doesn't run here: {(done.stderr or done.stdout).strip()[-200:]}")
    symbols = json.loads(done.stdout)["typeCompleteness"]["symbols"]
    values = {name: getattr(rz, name) for name in rz.__all__ if name not in ("__version__", "reference")}
    homes = tuple(f"{value.__module__}.{name}" for name, value in values.items())
    public = [
        each
        for each in symbols
        if each["name"].startswith(tuple(f"{home}." for home in homes)) or each["name"] in homes
    ]
    assert {each["name"] for each in public} >= set(homes) and len(public) > 300
    unknown = [each["name"] for each in public if not each["isTypeKnown"]]
    assert not unknown, f"{len(unknown)} of {len(public)} public names have no known type: {unknown[:10]}"
