"""`raster doctor`: what is installed, where kernels are, and that it removes its own files alone."""

import json
import os
import re
import shutil

import pytest
from helpers.command import start

import rasterizer as rz
from rasterizer.cli import doctor_command, main
from rasterizer.compiler import kernels, store

pytestmark = pytest.mark.usefixtures("folder")


def test_the_record_has_what_a_report_needs(capsys):
    code = main(["doctor", "--json"])
    facts = json.loads(capsys.readouterr().out)
    assert code == (1 if facts["problems"] else 0)
    assert facts["version"] == rz.__version__ and facts["threads"] >= 1 and facts["packages"]["numpy"]
    assert facts["extras"]["test"]["pytest"] == pytest.__version__
    assert facts["kernels"]["folder"] == (None if kernels.STORE.own is None else str(kernels.STORE.own))


def test_lines_name_every_package(capsys):
    main(["doctor"])
    out = capsys.readouterr().out
    assert all(word in out for word in ("raster ", "numba ", "threads", "kernels", "[test]"))
    begins = [re.match(r"(\S+  +| +)(?=\S)", line).end() for line in out.splitlines()]
    assert len(set(begins)) == 1, "what is said stands in one column"


def test_a_store_is_measured_and_cleared(folder):
    own = folder / "store" / f"{store.PREFIX}{'0' * 16}"
    own.mkdir(parents=True, mode=0o700)
    (own / store.MARKER).write_bytes(store.MARK)
    (own / f"x{store.SUFFIX}").write_bytes(b"12345")
    (folder / "store" / "mine.txt").write_text("not the program's")
    other = folder / "store" / f"{store.PREFIX}mine"
    other.mkdir()
    environment = {"RASTER_STORE": str(folder / "store")}
    before = json.loads(start_doctor(environment, "--json").stdout)["kernels"]
    assert before["others"] == [{"folder": str(own), "count": 1, "bytes": 5}]
    done = start_doctor(environment, "--clear")
    assert done.returncode == 0 and re.search(rb"cleared +1 kernel,", done.stdout)
    assert sorted(path.name for path in (folder / "store").iterdir()) == ["mine.txt", other.name]
    shutil.rmtree(folder / "store")


def start_doctor(environment, *argv):
    """Run the command as a process of its own, with other settings."""
    before = dict(os.environ)
    os.environ.update(environment)
    try:
        return start("doctor", *argv)
    finally:
        os.environ.clear()
        os.environ.update(before)


def test_problems_are_told_and_change_the_exit_code(monkeypatch, capsys):
    version_of = doctor_command._version_of
    monkeypatch.setattr(doctor_command, "_version_of", lambda name: None if name == "trimesh" else version_of(name))
    assert main(["doctor"]) == 1
    out, err = capsys.readouterr()
    assert re.search(r"\ntrimesh +MISSING\n", out)
    assert "raster: error: trimesh is not installed, and nothing can be drawn without it\n" in err
    done = start_doctor({"RASTER_STORE": "off"})
    assert done.returncode == 1 and b"kernels are not kept, so every run compiles: RASTER_STORE is off" in done.stderr
    assert re.search(rb"\nkernels +not kept\n", done.stdout)


def test_an_extra_of_old_versions_of_python_is_not_missed(monkeypatch):
    texts = ['tomli>=2.0; python_version < "3.4" and extra == "toml"', 'numpy; extra == "x"', "trimesh>=5"]
    monkeypatch.setattr(doctor_command, "_requirements", lambda: texts)
    assert list(doctor_command._list_extras()) == ["x"]
