"""A lean start: which modules a process has loaded when it has done its work, and none that it made no use of."""

import json
import platform
import subprocess
import sys

import pytest
from helpers.raster import ROOT

from rasterizer.compiler.kernels import STORE

MODELS = ROOT / "models"
HELP = "from rasterizer.cli import main\ntry:\n    main({})\nexcept SystemExit:\n    pass"
RENDER = "from rasterizer.cli import main; assert main({}) == 0"
HEAVY = {"numpy", "numba", "llvmlite", "PIL", "trimesh"}

# What a picture of a model of triangles makes no use of: of the package's own modules, and of others.
UNUSED = (
    "analysis", "animation", "batch", "reference",
    "registries", "viewer",
    "cli.bench", "cli.batch", "cli.compare", "cli.completion", "cli.demo", "cli.doctor", "cli.info",
    "cli.processes", "cli.sheet", "cli.turntable", "cli.view", "cli.warmup",
    "engine.edges", "engine.ground_shadow", "engine.recorded_kernels", "engine.point_lighting", "engine.shadow_maps",
    "geometry.ears", "geometry.subdivide",
    "io.animation", "io.array_files", "io.gltf", "io.mtl", "io.other_formats",
    "io.ply", "io.scene_file", "io.threemf",
    "scene.cie_tables", "scene.orbit", "scene.spectrum",
)  # fmt: skip
FOREIGN = {
    "numba", "llvmlite.binding",
    "PIL", "trimesh", "OpenEXR", "av", "dask", "matplotlib", "json", "difflib", "asyncio",
    "concurrent.futures.process", "multiprocessing", "subprocess", "importlib.metadata", "inspect", "xml", "zipfile",
    "http", "ssl",
}  # fmt: skip


def modules_after(code: str) -> set[str]:
    """Return the modules that a process of its own has loaded when it has run some lines, without its own at start."""
    lines = f"import sys; before = set(sys.modules)\n{code}\nprint(*sorted(set(sys.modules) - before))"
    done = subprocess.run([sys.executable, "-I", "-c", lines], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


def own_among(modules) -> set[str]:
    """Return the names of the package's own modules below the package, folders themselves left out."""
    names = {name.removeprefix("rasterizer.") for name in modules if name.startswith("rasterizer.")}
    return {name for name in names if not any(other.startswith(f"{name}.") for other in names)}


def test_importing_the_package_and_asking_for_help_load_next_to_nothing():
    modules = modules_after("import rasterizer")
    assert own_among(modules) == set()
    strangers = {name for name in modules if not name.startswith(("rasterizer", "_", "importlib", "warnings"))}
    assert not strangers, f"importing the package loads {strangers}"
    modules = modules_after(HELP.format(["--help"]))
    assert own_among(modules) <= {
        "cli.messages",
        "cli.parser",
        "errors",
    }
    assert not modules & {*HEAVY, "dataclasses", "inspect", "typing", "logging", "pathlib"}
    modules = modules_after(HELP.format(["render", "--help"]) + "\nimport rasterizer.options")
    assert not modules & {*HEAVY, "logging"}, "flags need no arrays"
    unasked = [name for name in own_among(modules) if name.startswith(("engine", "pipeline", "geometry", "reference"))]
    assert not unasked


@pytest.mark.parametrize("suffix", ["obj", pytest.param("stl", marks=pytest.mark.nightly)])
def test_a_picture_loads_only_what_it_uses(suffix, tmp_path):
    model = MODELS / ("cube.obj" if suffix == "obj" else "gear.stl")
    argv = ["render", str(model), "-o", str(tmp_path / "x.png"), "-s", "32x24", "--preset", "studio"]
    loads_itself = sys.platform == "linux" and platform.machine() == "x86_64"  # code, without LLVM
    others = "numpy" if loads_itself else "numpy, llvmlite.binding"
    program = f"import {others}\nbefore |= set(sys.modules)\n" + RENDER.format(argv)
    modules = modules_after(program)
    if "numba" in modules:  # kernels were missing in the store; where there is none, numba imports what it likes
        modules = modules_after(program) if STORE.is_kept else pytest.skip("there is no store of kernels")
    unused = (*UNUSED, "io.obj" if suffix == "stl" else "io.stl")
    strays = {
        name for name in own_among(modules) if any(f"{name}.".startswith((f"{each}.", f"{each}_")) for each in unused)
    }
    assert not strays, f"{sorted(strays)} are loaded for a picture that doesn't use them"
    strays = modules & FOREIGN
    assert not strays, f"{sorted(strays)} are loaded for a picture that doesn't use them"


def test_the_reference_and_scenes_load_no_compiler():
    assert not modules_after("import rasterizer.reference, rasterizer.scene.scene") & {"numba", "llvmlite", "trimesh"}


@pytest.mark.nightly
def test_what_a_picture_does_without_is_there_for_those_that_use_it(tmp_path):
    for module, argv in {
        "io.mtl": [str(MODELS / "globe.obj")],
        "engine.shadow_maps": [str(MODELS / "cube.obj"), "--shadows"],
        "scene.spectrum": [str(MODELS / "cube.obj"), "--spectral", "5"],
    }.items():
        argv = ["render", *argv, "-o", str(tmp_path / "x.png"), "-s", "32x24"]
        assert module in own_among(modules_after(RENDER.format(json.dumps(argv)))), module
