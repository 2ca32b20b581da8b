"""Run the command line in this process; print what each stage of it takes as a line of JSON.

`startup.py` starts this. Nothing in the package measures: hooks are put around modules while they are imported, and
around the functions of HOOKS. Time belongs to the innermost stage: what numpy takes while the package imports it is
numpy's. The standard library's modules belong to whoever imports them first. Other threads don't count: while they
work, the first one waits in a stage.
"""

from time import monotonic_ns

BEGIN = monotonic_ns()  # the interpreter has started

import functools
import json
import os
import sys
import threading
from importlib.machinery import PathFinder

# Stages by package whose modules they import, in the order of the table.
PACKAGES = {
    "numpy": "numpy",
    "llvmlite": "llvmlite",
    "numba": "numba",
    "PIL": "Pillow",
    "trimesh": "trimesh",
    "scipy": "scipy",
    "rasterizer": "own modules",
}
# Stages by module and function. Of the two of "kernels" one is that of the store, the other that of numba's own way.
HOOKS = {
    "rasterizer.io.loader": {"load": "read"},
    "rasterizer.engine.points": {"gather_geometry": "normals"},
    "rasterizer.compiler.kernels": {"load": "kernels"},
    "numba.core.dispatcher": {"_DispatcherBase._compile_for_args": "kernels"},
    "rasterizer.renderer": {"Renderer.__init__": "prepare", "Renderer.render": "draw"},
    "rasterizer.frame": {"Frame.encode": "encode"},
    "rasterizer.io.files": {"write_whole": "write"},
}
STAGES = ("python", *PACKAGES.values(), "command line", "read", "normals", "kernels", "prepare", "draw",
          "encode", "write", "exit")  # fmt: skip


class Clock:
    """Nanoseconds of each stage, of the main thread; a stage that another one calls interrupts it."""

    def __init__(self, start: int):
        self.nanoseconds = dict.fromkeys(STAGES, 0)
        self._stages, self._last = ["python"], start

    def enter(self, stage: str) -> None:
        """Let time belong to a stage from now on."""
        self._count()
        self._stages.append(stage)

    def leave(self) -> None:
        """Let time belong to the stage that was interrupted."""
        self._count()
        self._stages.pop()

    def _count(self) -> None:
        now = monotonic_ns()
        self.nanoseconds[self._stages[-1]] += now - self._last
        self._last = now

    def around(self, function, stage: str):
        """Return a function that does the same and belongs to a stage, where the main thread calls it."""

        @functools.wraps(function)
        def timed(*arguments, **keywords):
            if threading.current_thread() is not threading.main_thread():
                return function(*arguments, **keywords)
            self.enter(stage)
            try:
                return function(*arguments, **keywords)
            finally:
                self.leave()

        return timed


class Finder:
    """Finds modules as Python does, and puts the clock around their loading and the hooks into them."""

    def __init__(self, clock: Clock):
        self._clock, self.found = clock, set()

    def find_spec(self, name, path=None, target=None):
        """Return the spec of a module; None leaves it to the other finders."""
        package = name.partition(".")[0]
        if package not in PACKAGES:
            return None
        find = self._clock.around(PathFinder.find_spec, PACKAGES[package])
        spec = find(name, path, target)
        if spec is not None and spec.loader is not None:
            loader, execute = spec.loader, spec.loader.exec_module
            loader.create_module = self._clock.around(loader.create_module, PACKAGES[package])

            def exec_module(module):
                execute(module)
                self._put_hooks(module)

            loader.exec_module = self._clock.around(exec_module, PACKAGES[package])
        return spec

    def _put_hooks(self, module) -> None:
        for path, stage in HOOKS.get(module.__name__, {}).items():
            *owners, name = path.split(".")
            owner = functools.reduce(lambda thing, part: getattr(thing, part, None), owners, module)
            if hasattr(owner, name):
                setattr(owner, name, self._clock.around(getattr(owner, name), stage))
                self.found.add(stage)


def main() -> int:
    """Run the command line with this process's arguments; return its exit code."""
    clock = Clock(int(os.environ.get("BENCH_START", BEGIN)))
    finder = Finder(clock)
    clock.enter("command line")
    clock.nanoseconds["python"] -= monotonic_ns() - BEGIN  # the imports of this script are nobody's
    sys.meta_path.insert(0, finder)
    from rasterizer.cli import main as run_command

    code = run_command()
    clock.leave()
    times = {stage: nanoseconds / 1e6 for stage, nanoseconds in clock.nanoseconds.items()}
    hooked = {stage for hooks in HOOKS.values() for stage in hooks.values()}
    print(json.dumps({"ms": times, "missing": sorted(hooked - finder.found), "end": monotonic_ns()}), flush=True)
    return code


if __name__ == "__main__":
    sys.exit(main())
