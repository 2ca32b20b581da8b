"""`raster doctor`: what is installed, where compiled kernels are kept, and what is wrong with it.

What can't be imported is a finding, so nothing but the standard library is imported before it has been looked for.
"""

import os
import platform
import shutil
import sys
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from .. import __version__
from ..cores import n_core
from ..errors import OutputError, SceneError, counted, install_command
from .flags import add_json, add_messages
from .messages import print_text

ENVIRONMENT = {  # all variables that are read
    "RASTER_STORE": "the only folder of compiled kernels; off: none",
    "RASTER_MOST_TEXELS": "the most texels of a file's texture (default 8192 x 4096)",
    "NUMBA_CACHE_DIR": "as RASTER_STORE, where that is not set",
    "NUMBA_DISABLE_JIT": "1: nothing is compiled; for small pictures, in a debugger",
    "NUMBA_CPU_FEATURES": "instruction sets for kernels, as numba reads it",
    "NUMBA_BOUNDSCHECK": "1: kernels that check every index, compiled for that alone",
    "XDG_CACHE_HOME": "folder above rasterizer/, the kernels' (default ~/.cache)",
}
_EXAMPLES = f"""\
examples:
  raster doctor
  raster doctor --json > machine.json
  raster doctor --clear                    raster warmup makes kernels again

exit codes: 0 all is well, 1 something is missing or broken, and is named,
2 usage, 4 kernels can't be removed, 130 interrupted

variables of the environment:
{"".join(f"  {name:<20}{text}" + chr(10) for name, text in ENVIRONMENT.items())}"""

_NEEDED = ("numpy", "numba", "llvmlite", "loky", "pillow", "trimesh")
_EXTRAS = {  # what each gives, and the modules that it brings
    "completion": ("raster completion", ("shtab",)),
    "dataset": ("annotations of datasets as COCO has them", ("pycocotools",)),
    "distributed": ("batches on Dask's workers", ("distributed",)),
    "exr": ("EXR files", ("OpenEXR",)),
    "formats": ("3MF with its colours, COLLADA (DAE, ZAE), 3DXML and XAML files",
                ("lib3mf", "lxml", "networkx", "collada")),
    "notebook": ("rz.view, a viewer in notebooks", ("anywidget",)),
    "scalars": ("colormaps by name", ("cmap",)),
    "video": ("MP4, MOV and MKV files", ("av",)),
}  # fmt: skip
_MB = 1e6
_LEAST_FREE = 200e6  # bytes of a disk: all kernels take less than a third


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster doctor [options]"
    parser.description = (
        "Print what a bug report should hold: versions, processor, threads, where compiled kernels are kept and how "
        "large they are, what extras give and which of their packages are missing, variables of the environment. "
        "Nothing is drawn."
    )
    parser.epilog = _EXAMPLES
    parser.add_argument("--clear", action="store_true", help="remove all compiled kernels, of other versions, too")
    add_json(parser, "print one line of JSON")
    add_messages(parser)


def run(_request, messages, *, clear, json) -> tuple[list, int]:
    """Say what is there, and remove kernels where that is asked for.

    Returns
    -------
    the problems, one error each; and the number of things that were looked at, which is larger

    Raises
    ------
    OutputError : kernels can't be removed
    """
    cleared = _clear() if clear else None
    facts = {
        "version": __version__,
        "python": platform.python_version(),
        "executable": sys.executable,
        "package": str(Path(__file__).resolve().parents[1]),
        "system": platform.platform(terse=True),
        "cpu": _cpu_name(),
        "threads": n_core(),
        "packages": {name: _version_of(name) for name in _NEEDED},
        "extras": _list_extras(),
        "kernels": _describe_kernels(),
        "settings": {name: os.environ[name] for name in ENVIRONMENT if name in os.environ},
    }
    if cleared is not None:
        facts["cleared"] = cleared
    problems = _list_problems(facts)
    if json:
        messages.record(facts | {"problems": problems})
    else:
        print_text(_text(facts))
    for problem in problems:
        messages.error(problem)
    return [SceneError(problem) for problem in problems], len(problems) + 1


def _version_of(name) -> str | None:
    """The version of a package that is installed, without importing it."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _cpu_name() -> str | None:
    """The processor's model name, and the best level of processors that it belongs to; None where that isn't known."""
    try:
        from ..analysis.timing import describe_machine
        from ..compiler.fingerprint import usable_processors

        return f"{describe_machine()['cpu']} ({', '.join(usable_processors()[1:2]) or 'no level'})"
    except ImportError:  # numpy or llvmlite is missing, which is said elsewhere
        return platform.processor() or platform.machine()


def _list_extras() -> dict[str, dict]:
    """What each extra gives, which of its modules are missing, and the command that installs it."""
    found = {}
    for extra, (what, modules) in _EXTRAS.items():
        missing = [name for name in modules if find_spec(name) is None]
        found[extra] = {"gives": what, "missing": missing, "command": install_command(extra)}
    return found


# --- compiled kernels -----------------------------------------------------------------------------------------------


def _describe_kernels() -> dict:
    """Where kernels are kept and how large they are."""
    try:
        from ..compiler import kernels, store
    except ImportError as fault:
        return {"folder": None, "reasons": [f"{fault}"], "is_used": False}
    own = kernels.STORE.own
    found = {"folder": own and str(own), "is_used": kernels.STORE.is_used, "reasons": list(kernels.STORE.reasons)}
    if own is not None:
        others = [folder for folder in store.list_folders(own.parent) if folder != own]
        found |= _measured([own]) | {"free": shutil.disk_usage(own.parent).free, "others": _measured(others)}
    shipped = [folder for folder in kernels.STORE.folders if folder != own]
    return found | {"processors": [each.partition(" ")[0] for each in kernels.STORE.processors],
                    "shipped": _measured(shipped)}  # fmt: skip


def _measured(folders) -> dict:
    """How many kernels some folders hold, and their bytes."""
    from ..compiler import store

    sizes = [store.measure(folder) for folder in folders]
    return {"count": sum(count for count, _ in sizes), "bytes": sum(n_byte for _, n_byte in sizes)}


def _clear() -> dict:
    """Remove all kernels in the user's folder; return how many there were, and their bytes."""
    try:
        from ..compiler import kernels, store
    except ImportError as fault:
        raise OutputError(f"kernels can't be removed: {fault}") from fault
    base = kernels.STORE.own and kernels.STORE.own.parent
    measured = _measured(store.list_folders(base) if base else [])
    try:
        if base:
            store.clear(base)
    except OSError as fault:
        raise OutputError(f"kernels in {base} can't be removed: {fault.strerror or fault}") from fault
    return measured


# --- what is printed ------------------------------------------------------------------------------------------------


def _list_problems(facts) -> list[str]:
    """What is missing or broken, and what to do."""
    problems = [f"{name} is not installed, and nothing can be drawn without it"
                for name, version in facts["packages"].items() if version is None]  # fmt: skip
    kernels = facts["kernels"]
    if kernels["folder"] is None:
        why = "; ".join(kernels["reasons"]) or "there is no folder for them"
        problems.append(f"compiled kernels are not kept, so every run compiles: {why}; RASTER_STORE names a folder")
    elif kernels["free"] < _LEAST_FREE:
        problems.append(f"the disk of {kernels['folder']} is nearly full: {kernels['free'] / _MB:.0f} MB are free")
    return problems


def _text(facts) -> str:
    """The facts as lines."""
    lines = [
        ("raster", f"{facts['version']}, in {facts['package']}"),
        ("python", f"{facts['python']}, {facts['executable']}"),
        ("system", facts["system"]),
        ("processor", facts["cpu"]),
        ("threads", f"{facts['threads']}"),
        *((name, version or "MISSING") for name, version in facts["packages"].items()),
        *_kernel_lines(facts["kernels"]),
        *((f"[{extra}]", _extra_words(found)) for extra, found in facts["extras"].items()),
        *(("setting", f"{name}={value}") for name, value in facts["settings"].items()),
    ]
    if "cleared" in facts:
        lines.append(("cleared", _kernel_words(facts["cleared"])))
    width = 2 + max(len(name) for name, _ in lines)
    return "".join(f"{name:<{width}}{' '.join(value.split())}\n" for name, value in lines)


def _extra_words(extra) -> str:
    """What an extra gives, and how to get what is missing of it."""
    missing = ", ".join(extra["missing"])
    return f"{extra['gives']}: " + (f"{missing} missing; {extra['command']}" if missing else "installed")


def _kernel_lines(kernels):
    """Where kernels are, and how many."""
    if kernels["folder"] is None:
        yield "kernels", "not kept"
    else:
        yield "kernels", f"{_kernel_words(kernels)}, in {kernels['folder']}; raster warmup makes all"
        yield "", f"{_kernel_words(kernels['others'])} of other versions; raster doctor --clear removes all"
    if "shipped" in kernels:
        yield "", f"{_kernel_words(kernels['shipped'])} that came with the package"


def _kernel_words(facts) -> str:
    return f"{counted(facts['count'], 'kernel')}, {facts['bytes'] / _MB:.1f} MB"
