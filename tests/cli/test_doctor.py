"""`raster doctor`: what is installed, where kernels are, and that it removes its own files alone."""

import configparser
import json
import re
import sys
from importlib import metadata
from importlib.machinery import ModuleSpec
from types import ModuleType

import pytest
from helpers.command import raster, start
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.compiler import kernels, store

pytestmark = pytest.mark.usefixtures("folder")


def test_the_record_and_the_lines_have_what_a_report_needs(capsys):
    code = raster("doctor", "--json")
    facts = json.loads(capsys.readouterr().out)
    assert code == (1 if facts["problems"] else 0)
    assert facts["version"] == rz.__version__ and facts["threads"] >= 1 and facts["packages"]["numpy"]
    assert facts["kernels"]["folder"] == (None if kernels.STORE.own is None else str(kernels.STORE.own))
    assert raster("doctor") == code
    out = capsys.readouterr().out
    assert [word for word in ("raster ", "numba ", "threads", "kernels", "[video]") if word not in out] == []
    begins = [re.match(r"(\S+  +| +)(?=\S)", line).end() for line in out.splitlines()]
    assert len(set(begins)) == 1, "what is said stands in one column"


def test_a_store_is_measured_and_cleared(folder):
    """In processes of their own: where the store is, is known when the program begins."""
    own = folder / "store" / f"{store.PREFIX}{'0' * 16}"
    own.mkdir(parents=True, mode=0o700)
    (own / f"x{store.SUFFIX}").write_bytes(b"12345")
    (folder / "store" / "mine.txt").write_text("not the program's")
    (folder / "store" / f"{store.PREFIX}mine").mkdir()
    where = {"RASTER_STORE": str(folder / "store")}
    before = json.loads(start("doctor", "--json", variables=where).stdout)["kernels"]
    assert before["others"] == {"count": 1, "bytes": 5}
    done = start("doctor", "--clear", variables=where)
    assert done.returncode == 0 and re.search(rb"cleared +1 kernel,", done.stdout)
    assert sorted(path.name for path in (folder / "store").iterdir()) == ["mine.txt", f"{store.PREFIX}mine"]


def test_a_store_that_can_not_be_written_is_a_problem(folder):
    (folder / "file").write_bytes(b"")
    done = start("doctor", variables={"RASTER_STORE": str(folder / "file" / "below")})
    assert done.returncode == 1 and b"kernels are not kept, so every run compiles: " in done.stderr
    assert re.search(rb"\nkernels +not kept\n", done.stdout)


def test_what_is_not_installed_is_told_and_changes_the_exit_code(monkeypatch, capsys):
    version_of = metadata.version

    def version(name):
        if name == "trimesh":
            raise metadata.PackageNotFoundError(name)
        return version_of(name)

    monkeypatch.setattr(metadata, "version", version)
    assert raster("doctor") == 1
    out, err = capsys.readouterr()
    assert re.search(r"\ntrimesh +MISSING\n", out)
    assert "raster: error: trimesh is not installed, and nothing can be drawn without it\n" in err


def test_every_extra_is_told_with_what_it_lacks_and_what_installs_it(monkeypatch, capsys):
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    everything = setup["options.extras_require"]["all"].strip()
    monkeypatch.setitem(sys.modules, "av", None)  # as where it isn't installed
    monkeypatch.setitem(sys.modules, "shtab", shtab := ModuleType("shtab"))
    shtab.__spec__ = ModuleSpec("shtab", None)
    raster("doctor", "--json")
    told = json.loads(capsys.readouterr().out)["extras"]
    assert everything == f"scanline-rasterizer[{','.join(told)}]"
    assert told["video"]["missing"] == ["av"] and told["completion"]["missing"] == []
    raster("doctor")
    out = capsys.readouterr().out
    assert f"av missing; pip install -e '{ROOT}[video]'\n" in out and "raster completion: installed\n" in out
