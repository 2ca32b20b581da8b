"""The folders are the architecture: which may import which, read from the source of every module."""

import inspect
import subprocess
import sys

import pytest
from helpers.imports import PATHS, imports_of, own_imports, private_imports, reached_from, way_to

import rasterizer as rz

# The layers, from the top to the bottom: a module imports its own folder and what stands further down.
LAYERS = (
    ("__main__", "api_pages"),
    ("cli",),
    ("batch", "notebook"),
    ("viewer",),
    ("analysis", "animation", "ground_shadow", "registries"),
    ("reference", "renderer"),
    ("kernel_needs",),
    ("frame",),
    ("frame_buffers",),
    ("picking",),
    ("engine",),
    ("pipeline",),
    ("geometry",),
    ("io",),
    ("options",),
    ("scene",),
    ("compiler",),
    ("keywords",),
    ("choices", "cores", "errors", "version"),
)
RANKS = {name: rank for rank, layer in enumerate(reversed(LAYERS)) for name in layer}
# The package itself has the public names of all layers, each imported on first use.
MODULES = [name for name in PATHS if name]

# What one layer may see though it stands beside it, or above: nothing.
FORBIDDEN = {
    "pipeline": ("scene", "io"),
    "scene": ("pipeline", "engine", "geometry", "io", "compiler"),
    "io": ("pipeline", "engine"),
    "geometry": ("pipeline", "engine", "io"),
    "reference": ("pipeline", "engine", "geometry", "compiler"),
    "options": ("pipeline", "engine", "geometry", "io", "compiler"),
    "choices": tuple(RANKS),
    "cores": tuple(RANKS),
    "errors": tuple(RANKS),
}

# Imports inside functions, each with its reason. Any other one hides a circle, or should stand at the top.
IN_FUNCTIONS = {
    ("api_pages", "pdoc"): "optional: the extra docs",
    ("analysis.contact_sheet", "PIL"): "heavy: only sheets and pictures that are saved need it",
    ("analysis.flip", "flip_evaluator"): "optional: only `raster bench --flip` needs it",
    ("analysis.plotting", "matplotlib"): "optional: only plots need it",
    ("analysis.plotting", "matplotlib.ticker"): "as matplotlib",
    ("analysis.speed_error_plot", "matplotlib.figure"): "as matplotlib",
    ("analysis.speed_error_plot", "matplotlib.transforms"): "as matplotlib",
    ("cli", "_thread"): "main must be able to end in one line before anything else is imported",
    ("cli", "gc"): "as _thread",
    ("cli", "signal"): "as _thread",
    ("cli", "threading"): "as _thread",
    ("cli", "errors"): "as _thread",
    ("cli", "cli.arguments"): "as _thread",
    ("cli", "cli.messages"): "as _thread",
    ("cli", "cli.commands"): "as _thread",
    ("cli.arguments", "cli.flags"): "--help lists the commands and no flags: it makes no dataclass of options",
    ("cli.cameras_lights", "io.scene_file"): "only --camera FILE needs it",
    ("cli.doctor_command", "compiler"): "a package that is missing is a finding, and no error",
    ("cli.doctor_command", "compiler.fingerprint"): "as compiler",
    ("cli.doctor_command", "analysis.timing"): "as compiler",
    ("cli.results", "tqdm"): "optional: the extra progress",
    ("cli.suggestions", "difflib"): "only a word that isn't there needs it",
    ("ground_shadow", "concurrent.futures"): "heavy: only a soft shadow on several threads needs it",
    ("io.animation", "PIL"): "heavy: only moving pictures need it",
    ("io.animation", "av"): "optional: the extra video",
    ("io.animation", "io.gif"): "as PIL",
    ("io.gif", "PIL"): "as io.animation",
    ("cli.ground", "ground_shadow"): "only pictures with a ground need it",
    ("cli.arrays", "io.array_files"): "heavy, and only needed where arrays are written",
    ("cli.messages", "json"): "only --json needs it",
    ("cli.messages", "logging"): "only -v needs it",
    ("cli.messages", "traceback"): "only a fault of the program's own needs it",
    ("cli.messages", "warnings"): "--help does without it",
    ("cli.messages", "compiler.kernels"): "heavy: --help does without it",
    ("batch.executors", "dask"): "optional: the extra distributed",
    ("cli.processes", "traceback"): "as cli.messages",
    ("cli.render_command", "cli.processes"): "only -j needs it",
    ("cli.render_command", "io.row_files"): "only large pictures in some formats are written row by row",
    ("cli.targets", "io.picture_formats"): "heavy, and only needed where an output is named",
    ("cli.view_command", "webbrowser"): "only --open needs it",
    ("compiler.fingerprint", "importlib"): "slow, and only needed where numba's version stands elsewhere than usual",
    ("compiler.kernels", "compiler.internals"): "it is numba: only needed where the store has no kernel",
    ("compiler.kernels", "compiler.jobs"): "it starts processes: most runs have no need of it",
    ("compiler.store", "grp"): "not on every platform",
    ("compiler.store", "pwd"): "not on every platform",
    ("engine.prepared_scene", "engine.edge_overlay"): "only pictures with edges need it",
    ("engine.prepared_scene", "engine.shadow_maps"): "only scenes with shadows need it",
    ("engine.reflection_table", "engine.mirror_bounds"): "only Cook-Torrance's mirrors need it",
    ("engine.view_plans", "engine.shadow_views"): "as engine.shadow_maps",
    ("engine.spectral_products", "scene.spectrum"): "its tables are for scenes with spectra",
    ("errors", "warnings"): "--help does without it",
    ("io.formats", "io.other_formats"): "only a file that no reader takes needs it",
    ("io.models", "io.other_formats"): "as io.formats",
    ("io.picture_formats", "PIL"): "heavy: a frame that is only read as arrays does without it",
    ("frame", "PIL"): "as io.picture_formats",
    ("frame", "io.tiff"): "only TIFF files need it",
    ("frame", "io.array_files"): "only arrays that are saved need it",
    ("io.array_files", "OpenEXR"): "optional: only EXR files need it",
    ("io.obj", "io.material_libraries"): "only a file that names materials needs the reader of MTL files",
    ("io.ply", "io.mtl"): "as io.obj: only a file that names pictures needs it",
    ("io.scene_file", "tomllib"): "since Python 3.11",
    ("io.scene_file", "tomli"): "for Python 3.10, which has no tomllib",
    ("io.scene_file_write", "PIL"): "heavy: only scenes with textures need it",
    ("keywords", "difflib"): "only an error needs it",
    ("notebook", "viewer.widget"): "optional: anywidget is in the extra notebook",
    ("options", "scene.color"): "heavy: the flags of a command read the defaults without it",
    ("renderer", "io.row_files"): "only pictures that are written while they are drawn need it",
    ("renderer", "kernel_needs"): "only where kernels are compiled",
    ("scene.color", "PIL"): "heavy: only colours written as text need it",
    ("scene.texture", "PIL"): "heavy: only pictures that are read need it",
    ("scene.texture", "logging"): "as PIL, which imports it",
    ("viewer.session", "PIL"): "heavy: pictures at rest do without it",
}


def layer_of(module) -> str:
    return module.split(".")[0]


def test_every_module_stands_in_a_layer():
    strays = {layer_of(module) for module in MODULES} - RANKS.keys()
    assert not strays, f"{sorted(strays)} are in no layer: LAYERS says where what is new belongs"


@pytest.mark.parametrize("module", MODULES)
def test_imports_go_downwards(module):
    rank = RANKS[layer_of(module)]
    for target in own_imports(module):
        below = layer_of(target) == layer_of(module) or RANKS[layer_of(target)] < rank
        assert below, f"{module} imports {target}, which stands in a layer beside or above it"


@pytest.mark.parametrize(("layer", "forbidden"), [(layer, each) for layer, all_ in FORBIDDEN.items() for each in all_])
def test_no_chain_of_imports_leads_there(layer, forbidden):
    for module in MODULES:
        if layer_of(module) == layer and layer != forbidden:
            found = [target for target in reached_from(module) if layer_of(target) == forbidden]
            assert not found, way_to(module, found[0])


@pytest.mark.parametrize("module", MODULES)
def test_only_the_engine_sees_both_the_scene_and_the_pipeline(module):
    seen = {layer_of(target) for target in own_imports(module)}
    assert layer_of(module) == "engine" or not {"scene", "pipeline"} <= seen


@pytest.mark.parametrize("module", MODULES)
def test_no_module_imports_itself(module):
    assert module not in reached_from(module), way_to(module, module)


@pytest.mark.parametrize("module", MODULES)
def test_imports_stand_at_the_top_but_for_those_with_a_reason(module):
    for each in imports_of(module):
        if each.function is not None and not each.is_for_types:
            allowed = (module, each.name) in IN_FUNCTIONS or (module, each.name.split(".")[0]) in IN_FUNCTIONS
            assert allowed, f"line {each.line}: {each.function} imports {each.name}"


def test_every_reason_has_an_import():
    there = {(module, each.name) for module in PATHS for each in imports_of(module) if each.function}
    there |= {(module, name.split(".")[0]) for module, name in there if not name.startswith("numba")}
    assert not IN_FUNCTIONS.keys() - there


def test_no_module_is_named_like_a_public_function():
    functions = {name for name in rz.__all__ if inspect.isfunction(getattr(rz, name, None))}
    assert len(functions) > 5
    clashes = {name for name in MODULES if name.split(".")[-1] in functions}
    assert not clashes


@pytest.mark.parametrize("module", MODULES)
def test_nothing_private_is_imported_by_another_folder(module):
    assert not private_imports(module)


@pytest.mark.parametrize("module", ["rasterizer", "rasterizer.options", "rasterizer.cli.arguments"])
def test_what_the_help_needs_imports_the_standard_library_alone(module):
    heavy = "{'numpy', 'numba', 'PIL', 'trimesh', 'llvmlite'}"
    assert run_python(f"import sys, {module}; print(sorted({heavy} & set(sys.modules)))") == "[]"


@pytest.mark.parametrize("module", ["rasterizer.reference", "rasterizer.scene.scene"])
def test_what_needs_no_kernel_imports_no_compiler(module):
    assert run_python(f"import sys, {module}; print('numba' in sys.modules)") == "False"


def run_python(code) -> str:
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return result.stdout.strip()
