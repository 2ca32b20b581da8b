"""`raster doctor`: what is installed, where kernels are, and that it removes its own files alone."""

import configparser
import json
import re
from importlib import metadata

import pytest
from helpers.command import raster, start
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.choices import EXTRAS
from rasterizer.compiler import kernels, store

pytestmark = pytest.mark.usefixtures("folder")


def test_the_record_and_the_lines_have_what_a_report_needs(capsys):
    code = raster("doctor", "--json")
    facts = json.loads(capsys.readouterr().out)
    assert code == (1 if facts["problems"] else 0)
    assert facts["version"] == rz.__version__ and facts["threads"] >= 1 and facts["packages"]["numpy"]
    assert facts["extras"]["test"]["packages"]["pytest"] == pytest.__version__
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

    texts = ['tomli>=2.0; python_version < "3.4" and extra == "exr"', 'numpy; extra == "docs"', "trimesh>=5"]
    monkeypatch.setattr(metadata, "version", version)
    monkeypatch.setattr(metadata, "requires", lambda _: texts)
    assert raster("doctor") == 1
    out, err = capsys.readouterr()
    assert re.search(r"\ntrimesh +MISSING\n", out) and "[docs]" in out and "[exr]" not in out
    assert "raster: error: trimesh is not installed, and nothing can be drawn without it\n" in err


def declared(extras) -> list[str]:
    """What setup.cfg says of extras, as the metadata of an installed package have it."""
    found = []
    for extra, lines in extras.items():
        for line in filter(None, lines.splitlines()):
            requirement, _, marker = line.partition(";")
            found.append(f"{requirement}; " + (f"({marker.strip()}) and " if marker else "") + f'extra == "{extra}"')
    return found


def test_every_extra_is_told_with_what_it_gives_and_what_installs_it(monkeypatch, capsys):
    """As if nothing but pytest and an incomplete Dask were installed."""
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    extras = setup["options.extras_require"]
    told_by = {"scanline-rasterizer": declared(extras), "dask": ['distributed==2026; extra == "distributed"', "click"]}
    there = {"pytest": "9.0", "dask": "2026.8", "scanline-rasterizer": "0.2"}

    def version(name):
        if name not in there:
            raise metadata.PackageNotFoundError(name)
        return there[name]

    monkeypatch.setattr(metadata, "version", version)
    monkeypatch.setattr(metadata, "requires", told_by.get)
    raster("doctor", "--json")
    told = json.loads(capsys.readouterr().out)["extras"]
    assert set(told) == set(extras) == set(EXTRAS)
    for name, extra in told.items():
        assert extra["command"] == f"pip install 'scanline-rasterizer[{name}]'" and extra["gives"] == EXTRAS[name]
        assert not extra["installed"] and extra["packages"]
    assert told["distributed"]["packages"] == {"dask": "2026.8", "distributed": None}
    assert told["test"]["packages"]["pytest"] == "9.0" and "pycollada" in told["test"]["packages"]
    used = set().union(*(each["packages"] for name, each in told.items() if name in extras["all"]))
    assert set(told["all"]["packages"]) == used and "scanline-rasterizer" not in used
    raster("doctor")
    out = capsys.readouterr().out
    for name, extra in told.items():
        (line,) = (line for line in out.splitlines() if line.startswith(f"[{name}]"))
        assert extra["gives"] in line and line.endswith(f"missing; {extra['command']}")


def test_markers_of_requirements_are_read_as_pip_reads_them(monkeypatch, capsys):
    markers = pytest.importorskip("packaging.markers")
    versions = [f'python_version {sign} "3.{minor}"' for sign in ("<", ">=", "==", "!=", "~=") for minor in (9, 11, 99)]
    texts = [
        form.format(version)
        for version in versions
        for form in (
            '{} and extra == "exr"',
            '(sys_platform != "linux" or platform_machine == "x86_64") and extra == "exr" or {} and extra == "docs"',
            '"win" in sys_platform and extra == "exr" or ({} and os_name == "posix") and extra != "exr"',
        )
    ]
    monkeypatch.setattr(metadata, "requires", lambda _: [f"p{k}>=1; {text}" for k, text in enumerate(texts)])
    raster("doctor", "--json")
    told = json.loads(capsys.readouterr().out)["extras"]
    for extra in EXTRAS:
        expected = [f"p{k}" for k, text in enumerate(texts) if markers.Marker(text).evaluate({"extra": extra})]
        assert list(told.get(extra, {"packages": ()})["packages"]) == expected, extra
