"""`raster warmup`: all kernels into a store, the user's own or one that can be shipped."""

import importlib
import os
import pkgutil
import re

import pytest
from helpers.campaign_scenes import make_case
from helpers.command import assert_refused, errors, one_error, raster, start
from helpers.small_scenes import SHADINGS, SIZE, mixed

import rasterizer as rz
from rasterizer.cli.warmup import has_all, hash_package, list_all_kernels
from rasterizer.compiler import kernels
from rasterizer.compiler.store import Store
from rasterizer.engine.kernels_of_plan import list_kernels
from rasterizer.engine.scene_tables import SceneTables
from rasterizer.options import Options

pytestmark = pytest.mark.usefixtures("folder")


@pytest.mark.nightly  # compiles all kernels that there are
def test_kernels_that_are_there_are_not_compiled_again(capsys):
    assert raster("warmup") == 0 and raster("warmup") == 0
    assert re.search(r"^raster: kernels were ready already after [\d.]+ s, in ", errors(capsys), re.MULTILINE)


def test_what_a_store_lists_must_be_there_and_be_listed_by_these_sources(folder, capsys):
    folder.chmod(0o700)
    made, need = Store.into(folder / "kernels"), ("kernel.scan", ("float32",))

    def list_needs(sources):
        made.keep("list-of-kernels", (sources,), repr([need]).encode())

    list_needs("of other sources")
    made.keep(*need, b"code")
    assert not has_all(made)
    list_needs(hash_package())
    assert has_all(made) and raster("warmup", "--into", str(folder / "kernels")) == 0
    assert "raster: kernels were ready already after" in errors(capsys)
    next(made.own.glob("kernel.scan-*")).unlink()
    assert not has_all(made)
    made.keep(*need, b"code")
    for path in made.own.glob("list-of-kernels-*"):
        path.write_bytes(b"damaged")
    assert not has_all(made)


@pytest.mark.skipif(os.name != "posix", reason="modes are looked at on POSIX alone")
def test_a_place_where_no_store_can_be_is_refused_and_the_environment_given_back(folder, capsys, monkeypatch):
    (folder / "file").write_text("precious")
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    before = dict(os.environ)
    argv = ["--into", str(folder / "file"), "--cpu", "x86-64-v2", "-q"]
    assert_refused(capsys, [(argv, "no store can be made in")], "warmup", code=4)
    assert dict(os.environ) == before and (folder / "file").read_text() == "precious"
    folder.chmod(0o777)
    assert raster("warmup", "--into", str(folder / "kernels")) == 4
    assert f"others can write to {folder}" in one_error(capsys)
    done = start("warmup", variables={"RASTER_STORE": str(folder / "file" / "below")})
    assert done.returncode == 4 and done.stderr.startswith(b"raster: error: compiled kernels can't be kept: ")
    assert b"RASTER_STORE names another folder" in done.stderr


@pytest.fixture(scope="module")
def warm():
    """The kernels that are compiled ahead."""
    return set(list_all_kernels())


def assert_warm(warm, what, scene, size, **options):
    """Assert that the kernels of a picture are among them."""
    settings = Options(size=size, threads=1, **options)
    listed = list_kernels(SceneTables(scene, settings), settings, scene.camera_for(settings.size))
    missing = {kernels.title_of(function) for function, _ in {*listed} - warm}
    assert not missing, f"{what}: {sorted(missing)} are compiled at the first picture"


EVERYTHING = ("color", "depth", "face", "normal")


def test_nothing_is_left_to_compile_for_materials_in_any_shading(warm):
    for name, scene in mixed().items():
        for shading in SHADINGS:
            assert_warm(warm, name, scene, SIZE, shading=shading, outputs=EVERYTHING)


def test_nothing_is_left_to_compile_for_scenes_that_nobody_has_chosen(warm):
    for number in range(150):
        case = make_case(11, number)
        size, options = tuple(max(side // 3, 4) for side in case.size), {"samples": 1} | case.options
        options["outputs"] = EVERYTHING if number % 3 == 0 else ("rgb",)
        try:
            assert_warm(warm, case.words, case.scene, size, **options)
        except rz.SceneError:
            continue


def test_no_kernel_of_the_package_is_forgotten(warm):
    """Whatever a kernel is for, warming up compiles it: a wheel that holds the store draws without the compiler."""
    left_out = ("rasterizer.__main__", "rasterizer.viewer.widget")  # a program; a module that needs an extra
    modules = [m.name for m in pkgutil.walk_packages(rz.__path__, "rasterizer.") if m.name not in left_out]
    everything = [value for name in modules for value in vars(importlib.import_module(name)).values()]
    own = {value.py_func for value in everything if isinstance(value, kernels.Kernel)}
    missing = {kernels.title_of(function) for function in own} - {kernels.title_of(function) for function, _ in warm}
    assert len(own) > 40 and not missing
