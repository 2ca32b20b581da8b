"""A lean start: which modules a process has loaded when it has done its work, and none that it made no use of.

What is allowed is listed, so that an import that is new is noticed: put it where it is needed, or say here why it is
always needed.
"""

import subprocess
import sys

import pytest
from helpers.raster import ROOT

MODELS = ROOT / "models"

# What stands behind any picture: numpy, and what loads kernels. Their imports are their own.
ALWAYS = ("numpy", "llvmlite.binding")
# The standard library's modules that a command brings along.
OF_COMMANDS = {"argparse", "gettext", "locale", "signal", "gc", "textwrap", "math"}
# Those that a picture needs beyond numpy's; `heapq` comes with `queue`, `encodings` with the text of a file.
OF_PICTURES = {"copy", "dataclasses", "encodings", "glob", "heapq", "queue", "tempfile", "zlib"}
# Those that the store of kernels is found and told of with; `string` and `traceback` come with `logging`.
OF_STORE = {"ctypes", "hashlib", "logging", "pwd", "string", "traceback"}
# Modules of numpy that `import numpy` leaves out: of all that there are, these alone are used.
OF_NUMPY = ("numpy.typing", "numpy._typing", "numpy.ctypeslib")
# Compiled parts of modules of the standard library begin with an underscore.

# Of the package's own modules, those that every picture of a model of triangles needs: folders or single modules.
OWN = (
    "choices", "cores", "errors", "frame", "frame_buffers", "keywords", "options", "picking", "renderer", "version",
    "compiler", "pipeline",
    "cli.arguments", "cli.arrays", "cli.cameras_lights", "cli.commands", "cli.default_look", "cli.defaults",
    "cli.edge_arguments", "cli.failures", "cli.flags", "cli.ground", "cli.help_texts", "cli.light_arguments",
    "cli.load_scene", "cli.look_flags", "cli.material_arguments", "cli.messages", "cli.preview", "cli.render_command",
    "cli.render_flags", "cli.results", "cli.suggestions", "cli.targets", "cli.values", "cli.warnings",
    "cli.write_targets", "scene.light_presets",
    "engine.attributes", "engine.buffer_tables", "engine.coding", "engine.depth_range", "engine.draw",
    "engine.clock", "engine.error_bounds", "engine.float64_reasons", "engine.highlight_tables",
    "engine.intensity_bounds",
    "engine.light_fall", "engine.light_sets", "engine.light_table",
    "engine.lit_points", "engine.output_bounds", "engine.material_plans", "engine.memory", "engine.output_buffers",
    "engine.passes",
    "engine.plan", "engine.plan_summary", "engine.prepared_scene", "engine.reach", "engine.reflection_entry",
    "engine.reflection_table", "engine.rounding", "engine.spectral_products", "engine.surface_arrays", "engine.tint",
    "engine.transparency", "engine.uniforms", "engine.view_plans",
    "geometry.centers", "geometry.clusters", "geometry.creases", "geometry.mesh_points", "geometry.normals",
    "geometry.points", "geometry.polygons", "geometry.surfaces", "geometry.tangents", "geometry.vectors",
    "io.any_scene", "io.files", "io.formats", "io.loader", "io.model_file", "io.models", "io.picture_formats", "io.png",
    "io.progress",
    "io.scene_contents", "io.weld",
    "scene.arrays", "scene.calibration", "scene.camera", "scene.camera_checks", "scene.color", "scene.depth_cue",
    "scene.fields", "scene.framing", "scene.lights", "scene.material", "scene.mesh", "scene.mesh_arrays",
    "scene.mesh_moves", "scene.named_materials", "scene.scene", "scene.services", "scene.shadow", "scene.texture",
    "scene.triangulation", "scene.validate", "scene.value_class", "scene.projection",
)  # fmt: skip
OF_FORMATS = {
    "obj": ("io.obj", "io.obj_lines", "io.text_numbers"),
    "stl": ("io.stl_off", "io.text_numbers"),
}
RENDER = "from rasterizer.cli import main; assert main({}) == 0"


def modules_after(code: str) -> set[str]:
    """Return the modules that a process of its own has loaded when it has run some lines, without its own at start."""
    lines = f"import sys; before = set(sys.modules)\n{code}\nprint(*sorted(set(sys.modules) - before))"
    done = subprocess.run([sys.executable, "-I", "-c", lines], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


def own_among(modules) -> set[str]:
    """Return the names of the package's own modules below the package, folders themselves left out."""
    names = {name.removeprefix("rasterizer.") for name in modules if name.startswith("rasterizer.")}
    return {name for name in names if not any(other.startswith(f"{name}.") for other in names)}


def foreign_among(modules) -> set[str]:
    """Return the top-level names of the modules that are not the package's own."""
    names = {name.partition(".")[0] for name in modules} - {"rasterizer"}
    return {name for name in names if not name.startswith("_")}


def test_importing_the_package_loads_nothing():
    modules = modules_after("import rasterizer")
    assert own_among(modules) == {"version"}
    assert foreign_among(modules) <= {"importlib", "warnings"}, "importing the package is to cost nothing"


def test_help_loads_what_parses_and_prints():
    modules = modules_after('from rasterizer.cli import main\ntry:\n    main(["--help"])\nexcept SystemExit:\n    pass')
    of_cli = {"cli.arguments", "cli.commands", "cli.messages", "cli.suggestions"}
    assert own_among(modules) <= {*of_cli, "errors", "version"}
    unasked = {"dataclasses", "inspect", "typing", "logging", "pathlib", "numpy", "numba", "llvmlite", "PIL"}
    assert not foreign_among(modules) & unasked


def test_help_of_a_command_loads_its_flags_and_no_numpy():
    modules = modules_after(
        'from rasterizer.cli import main\ntry:\n    main(["render", "--help"])\nexcept SystemExit:\n    pass'
    )
    assert not foreign_among(modules) & {"numpy", "numba", "llvmlite", "PIL", "logging"}
    assert not any(name.startswith(("engine", "pipeline", "geometry", "reference")) for name in own_among(modules))


@pytest.fixture(scope="module")
def always_loaded():
    """The modules that come with numpy and with what loads kernels, whoever imports them."""
    return modules_after("".join(f"import {name}\n" for name in ALWAYS))


def stl_of(folder, kind):
    """Return the path of a model in binary or ASCII STL."""
    if kind == "binary":
        return MODELS / "gear.stl"
    path = folder / "triangle.stl"
    corners = "".join(f"vertex {corner}\n" for corner in ("0 0 0", "1 0 0", "0 1 0"))
    path.write_text(f"solid\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid\n")
    return path


@pytest.mark.parametrize(("suffix", "kind"), [("obj", "text"), ("stl", "binary"), ("stl", "ascii")])
def test_a_picture_loads_only_what_it_uses(suffix, kind, tmp_path, always_loaded):
    model = MODELS / "cube.obj" if suffix == "obj" else stl_of(tmp_path, kind)
    argv = ["render", str(model), "-o", str(tmp_path / "x.png"), "-s", "32x24", "--preset", "studio"]
    modules = modules_after(RENDER.format(argv))
    allowed = (*OWN, *OF_FORMATS[suffix])
    strays = {name for name in own_among(modules) if not any(f"{name}.".startswith(f"{each}.") for each in allowed)}
    assert not strays, f"{sorted(strays)} are loaded for a picture that doesn't use them"
    if "numba" in modules:
        pytest.skip("kernels come from numba here, which imports what it likes")
    others = {name for name in modules - always_loaded if not name.startswith(OF_NUMPY)}
    strays = foreign_among(others) - OF_COMMANDS - OF_PICTURES - OF_STORE
    assert not strays, f"{sorted(strays)} are loaded for a picture that doesn't use them"


def test_mtl_spectra_and_shadow_maps_are_loaded_where_they_are_used(tmp_path):
    """The other side: what the pictures above do without is there for those that use it."""
    used = {
        "io.mtl": [str(MODELS / "globe.obj")],
        "engine.shadow_maps": [str(MODELS / "cube.obj"), "--shadows"],
        "scene.spectrum": [str(MODELS / "cube.obj"), "--spectral", "5"],
    }
    for module, argv in used.items():
        argv = ["render", *argv, "-o", str(tmp_path / "x.png"), "-s", "32x24"]
        assert module in own_among(modules_after(RENDER.format(argv)))
