"""`raster doctor`: what is installed, where kernels are, and that it removes its own files alone."""

import json
import re
from importlib import metadata

import pytest
from helpers.command import raster, start

import rasterizer as rz
from rasterizer.compiler import kernels, store

pytestmark = pytest.mark.usefixtures("folder")


def test_the_record_and_the_lines_have_what_a_report_needs(capsys):
    code = raster("doctor", "--json")
    facts = json.loads(capsys.readouterr().out)
    assert code == (1 if facts["problems"] else 0)
    assert facts["version"] == rz.__version__ and facts["threads"] >= 1 and facts["packages"]["numpy"]
    assert facts["extras"]["test"]["pytest"] == pytest.__version__
    assert facts["kernels"]["folder"] == (None if kernels.STORE.own is None else str(kernels.STORE.own))
    assert raster("doctor") == code
    out = capsys.readouterr().out
    assert [word for word in ("raster ", "numba ", "threads", "kernels", "[test]") if word not in out] == []
    begins = [re.match(r"(\S+  +| +)(?=\S)", line).end() for line in out.splitlines()]
    assert len(set(begins)) == 1, "what is said stands in one column"


def test_a_store_is_measured_and_cleared(folder):
    """In processes of their own: where the store is, is known when the program begins."""
    own = folder / "store" / f"{store.PREFIX}{'0' * 16}"
    own.mkdir(parents=True, mode=0o700)
    (own / store.MARKER).write_bytes(store.MARK)
    (own / f"x{store.SUFFIX}").write_bytes(b"12345")
    (folder / "store" / "mine.txt").write_text("not the program's")
    (folder / "store" / f"{store.PREFIX}mine").mkdir()
    where = {"RASTER_STORE": str(folder / "store")}
    before = json.loads(start("doctor", "--json", variables=where).stdout)["kernels"]
    assert before["others"] == [{"folder": str(own), "count": 1, "bytes": 5}]
    done = start("doctor", "--clear", variables=where)
    assert done.returncode == 0 and re.search(rb"cleared +1 kernel,", done.stdout)
    assert sorted(path.name for path in (folder / "store").iterdir()) == ["mine.txt", f"{store.PREFIX}mine"]


def test_a_store_that_can_not_be_written_is_a_problem(folder):
    (folder / "file").write_bytes(b"")
    done = start("doctor", variables={"RASTER_STORE": str(folder / "file" / "below")})
    assert done.returncode == 1 and b"kernels are not kept, so every run compiles: " in done.stderr
    assert re.search(rb"\nkernels +not kept\n", done.stdout)


def test_what_is_not_installed_is_told_and_changes_the_exit_code(monkeypatch, capsys):
    """As Python's metadata say: without trimesh, and with an extra that older versions of Python alone need."""
    version_of = metadata.version

    def version(name):
        if name == "trimesh":
            raise metadata.PackageNotFoundError(name)
        return version_of(name)

    texts = ['tomli>=2.0; python_version < "3.4" and extra == "toml"', 'numpy; extra == "x"', "trimesh>=5"]
    monkeypatch.setattr(metadata, "version", version)
    monkeypatch.setattr(metadata, "requires", lambda _: texts)
    assert raster("doctor") == 1
    out, err = capsys.readouterr()
    assert re.search(r"\ntrimesh +MISSING\n", out) and "[x]" in out and "[toml]" not in out
    assert "raster: error: trimesh is not installed, and nothing can be drawn without it\n" in err
