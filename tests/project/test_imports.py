"""A lean start: which modules a process has loaded when it has done its work, and none that it made no use of."""

import subprocess
import sys

HELP = "from rasterizer.cli import main\ntry:\n    main({})\nexcept SystemExit:\n    pass"
HEAVY = {"numpy", "numba", "llvmlite", "PIL", "trimesh"}


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
