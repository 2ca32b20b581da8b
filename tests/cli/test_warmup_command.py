"""`raster warmup`: all kernels into a store, the user's own or one that can be shipped."""

import importlib
import os
import pkgutil
import re

import pytest
from helpers.campaign_scenes import make_case
from helpers.command import errors, one_error
from helpers.mixed_scenes import mixed
from helpers.small_scenes import SHADINGS, SIZE

import rasterizer as rz
from rasterizer.cli import main, warmup_command
from rasterizer.compiler import fingerprint, kernels, store
from rasterizer.compiler.store import Store
from rasterizer.pipeline.reflection import lambert

FEW = {(lambert, ("batch function", name)): True for name in ("float32", "float64")}


@pytest.fixture
def few(monkeypatch, tmp_path):
    """All that there is to compile: two batch functions."""
    tmp_path.chmod(0o700)
    monkeypatch.setattr(warmup_command, "list_all_needs", lambda: dict(FEW))
    return tmp_path


def test_kernels_that_are_there_are_not_compiled_again(capsys):
    assert main(["warmup"]) == 0
    assert re.match(r"raster: kernels were ready already after [\d.]+ s, in ", errors(capsys))


def test_no_folder_is_an_error_that_says_why_and_what_to_do(capsys, monkeypatch):
    monkeypatch.setattr(kernels, "STORE", Store(is_used=True, reasons=("/home: it can't be written",)))
    assert main(["warmup"]) == 4
    error = one_error(capsys)
    assert "/home: it can't be written" in error and "RASTER_STORE names another folder" in error


def test_a_store_to_be_shipped_is_made_in_a_folder(capsys, few):
    folder = few / "made" / "kernels"
    for text in ("ready", "were ready already"):
        assert main(["warmup", "--into", str(folder)]) == 0
        assert f"raster: kernels {text} after" in errors(capsys)
    (own,) = folder.iterdir()
    assert own.name == f"{store.PREFIX}{fingerprint.hash_sources()}"
    names = sorted(path.name.rpartition("-")[0] for path in own.iterdir() if path.name != store.MARKER)
    assert names == ["list-of-kernels", *["reflection.lambert"] * 2] and (own / store.MARKER).read_bytes() == store.MARK


def test_what_is_there_is_listed_and_not_looked_for_again(capsys, few, monkeypatch):
    """Unless a kernel is gone, or a source of the package has changed, which may need others."""
    asked, folder, made = [], few / "kernels", Store.into(few / "kernels")
    monkeypatch.setattr(warmup_command, "list_all_needs", lambda: asked.append(True) or dict(FEW))

    def warm_up():
        asked.clear()
        assert main(["warmup", "--into", str(folder)]) == 0
        return bool(asked), "already" in errors(capsys)

    assert not warmup_command.has_all(made)
    assert warm_up() == (True, False) and warmup_command.has_all(made) and warm_up() == (False, True)
    next(made.own.glob("reflection.lambert-*")).unlink()
    assert not warmup_command.has_all(made) and warm_up() == (True, False) and warm_up() == (False, True)
    next(made.own.glob("list-of-kernels-*")).write_bytes(b"damaged")
    assert warm_up() == (True, True) and warm_up() == (False, True)
    monkeypatch.setattr(warmup_command, "hash_package", lambda: "of other sources")
    assert warm_up() == (True, True) and warm_up() == (False, True)


def test_code_for_a_level_of_processors_is_found_where_they_reach_it(capsys, few):
    before = dict(os.environ)
    assert main(["warmup", "--into", str(few / "kernels"), "--cpu", "x86-64-v2", "-q"]) == 0
    assert dict(os.environ) == before, "the environment is given back"
    made = Store.into(few / "kernels")
    reached = "x86-64-v2" in fingerprint.usable_processors()
    assert kernels.missing_in(made, FEW) == ([] if reached else list(FEW))
    assert kernels.missing_in(made._replace(processors=(fingerprint.host_processor(),)), FEW) == list(FEW)
    assert kernels.missing_in(made._replace(processors=("x86-64-v2",)), FEW) == []


def test_the_environment_is_given_back_after_an_error(few, monkeypatch):
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    before = dict(os.environ)
    (few / "file").write_text("precious")
    assert main(["warmup", "--into", str(few / "file"), "--cpu", "x86-64-v2", "-q"]) == 4
    assert dict(os.environ) == before and (few / "file").read_text() == "precious"


@pytest.mark.skipif(os.name != "posix", reason="modes are looked at on POSIX alone")
def test_a_folder_that_others_can_write_to_is_no_place_for_a_store(capsys, few):
    few.chmod(0o777)
    assert main(["warmup", "--into", str(few / "kernels")]) == 4
    assert f"others can write to {few}" in one_error(capsys)


def test_kernels_that_could_not_be_compiled_are_named(capsys, few, monkeypatch):
    monkeypatch.setattr(kernels, "compile_into", lambda _store, _jobs: None)
    assert main(["warmup", "--into", str(few / "kernels")]) == 4
    assert "not all kernels could be compiled into" in (error := one_error(capsys)) and "lambert" in error


@pytest.fixture(scope="module")
def warm():
    """The kernels that are compiled."""
    return set(warmup_command.list_all_needs())


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("name", mixed())
def test_nothing_is_left_to_compile_for_materials_that_need_different_things(name, shading, warm):
    with kernels.noting_needs() as needs:
        rz.render(mixed()[name], SIZE, shading=shading, outputs=("color", "depth", "face", "normal"), threads=1)
    missing = {function.__name__ for function, _ in set(needs) - warm}
    assert not missing, f"{sorted(missing)} are compiled at the first picture"


def test_nothing_is_left_to_compile_for_scenes_that_nobody_has_chosen(warm):
    for number in range(150):
        case = make_case(11, number)
        size, options = tuple(max(side // 3, 4) for side in case.size), dict(case.options)
        options["outputs"] = ("color", "depth", "face", "normal") if number % 3 == 0 else ("rgb",)
        if options["samples"] > 1 and number % 2:
            options["antialias"] = "shade-once"
        with kernels.noting_needs() as needs:
            try:
                rz.render(case.scene, size, threads=1, **{"samples": 1} | options)
            except rz.SceneError:
                continue
        missing = {function.__name__ for function, _ in set(needs) - warm}
        assert not missing, f"{case.words}: {sorted(missing)} are compiled at the first picture"


def test_no_kernel_of_the_package_is_forgotten(warm):
    """Whatever a kernel is for, warming up compiles it: a wheel that holds the store draws without the compiler."""
    left_out = ("rasterizer.__main__", "rasterizer.viewer.widget")  # a program; a module that needs an extra
    modules = [m.name for m in pkgutil.walk_packages(rz.__path__, "rasterizer.") if m.name not in left_out]
    everything = [value for name in modules for value in vars(importlib.import_module(name)).values()]
    own = {value.py_func for value in everything if isinstance(value, kernels.Kernel)}
    missing = {function.__name__ for function in own} - {function.__name__ for function, _ in warm}
    assert len(own) > 40 and not missing
