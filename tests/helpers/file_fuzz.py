"""Damaged and generated files of every format, a seed each: loaded and drawn, one after the other, under caps of time
and memory.

    python -m helpers.file_fuzz FIRST COUNT       the seeds FIRST, FIRST + 1, ...: a line for each that fails, a summary
    python -m helpers.file_fuzz SEED 1 --keep D   one alone; its files are left in the folder D

A case is good if it draws a picture, or if it ends in an error of the package that names the file. Warnings must be
UserWarnings that name a file. Anything else is a fault: another exception, an internal error, a case that takes too
long or too much memory.
"""

import argparse
import json
import os
import resource
import signal
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
from numba.core import event

import rasterizer as rz
from helpers.fuzz_cases import make_case
from rasterizer.io.scene_file import read_scene
from rasterizer.scene.texture import ENVIRONMENT

SECONDS = 10  # that a case may take on a machine that does other things, too
MEGABYTES = 700  # that a case may add to the largest size of the process
ADDRESSES = 3 * 2**30  # bytes of address space beyond those of the start: what is asked for beyond fails at once
SIZE = (16, 12)


class Fault(Exception):
    """What must not happen."""


class TooLong(BaseException):
    """Raised by the alarm; no guard catches it."""


class Compiling(event.Listener):
    """Listen to the compiler: while it works, the time of a case doesn't count."""

    depth = 0

    def on_start(self, _event):
        self.depth += 1

    def on_end(self, _event):
        self.depth -= 1


def _alarm(compiling):
    def ring(*_):
        if compiling.depth:
            signal.setitimer(signal.ITIMER_REAL, SECONDS)
        else:
            raise TooLong

    return ring


def run_case(seed, folder) -> str:
    """Write the files of a case, load and draw them; return what became of it: "drawn", "empty" or "refused"."""
    name, files = make_case(np.random.default_rng(seed))
    for old in Path(folder).iterdir():
        old.unlink()
    for each, data in files.items():
        (Path(folder) / each).write_bytes(data)
    path = os.path.join(folder, name)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            outcome = _load_and_draw(path)
    except TooLong:
        raise Fault(f"takes more than {SECONDS} s") from None
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    if grown > MEGABYTES:
        raise Fault(f"takes {grown:.0f} MB")
    for warning in caught:
        if warning.category is not UserWarning or not str(warning.message).startswith(folder):
            raise Fault(f"{warning.category.__name__}: {warning.message}")
    return outcome


def _load_and_draw(path) -> str:
    try:
        if path.endswith((".json", ".toml")):
            read = read_scene(path)
            scene, options = read.framed_scene(), dict(read.options)
            rz.Options(**options)
            options |= {"size": SIZE, "samples": 1, "threads": 1}
        else:
            scene, options = rz.load(path), {"size": SIZE, "threads": 1}
        is_sane = _is_sane(scene)
        with warnings.catch_warnings():
            warnings.simplefilter("always" if is_sane else "ignore")
            frame = rz.render(scene, **{"samples": 1} | options | {"outputs": ("color", "depth", "face")})
    except (rz.ModelError, rz.SceneError) as fault:
        text = str(fault)
        is_ours = os.path.dirname(path) in text or (
            isinstance(fault, rz.SceneError) and not path.endswith((".json", ".toml"))
        )
        is_ours = is_ours or (isinstance(fault, rz.SceneError) and "options" in locals())
        if "internal error" in text or "more memory than" in text or not is_ours or len(text) > 2000:
            raise Fault(f"{type(fault).__name__}: {text[:500]}") from fault
        return "refused"
    if (frame.face >= scene.n_face).any() or (
        is_sane and not (np.isfinite(frame.color).all() and not np.isnan(frame.depth).any())
    ):
        raise Fault("the picture is not finite")
    return "drawn" if (frame.face >= 0).any() else "empty"


def _is_sane(scene) -> bool:
    """Tell whether float32 can hold all colours, and the square of all distances: beyond it pictures may be too bright
    to be told."""
    palette = [material for mesh in scene.meshes for material in mesh.palette]
    colors = [c for m in palette for c in (*m.ambient, *m.diffuse, *m.specular, *m.emissive)]
    colors += [c for light in scene.lights for c in light.color]
    lengths = np.abs(scene.bounds[1] - scene.bounds[0])
    return max(np.abs(colors)) < 1e10 and 1e-10 < lengths.max() < 1e10 and np.abs(scene.bounds).max() < 1e10


def main():
    """Run the seeds that the command line asks for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("first", type=int)
    parser.add_argument("count", type=int)
    parser.add_argument("--keep", metavar="FOLDER")
    parser.add_argument("--traceback", action="store_true")
    given = parser.parse_args()
    os.environ[ENVIRONMENT] = str(2**18)  # so that no case decodes pictures for seconds
    compiling = Compiling()
    event.register("numba:compiler_lock", compiling)
    signal.signal(signal.SIGALRM, _alarm(compiling))
    rz.render(rz.load(Path(__file__).parents[2] / "models" / "cube.obj"), SIZE, threads=1, samples=1)
    used = (
        int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        if sys.platform == "linux"
        else 2**40
    )
    resource.setrlimit(resource.RLIMIT_AS, (used + ADDRESSES, resource.RLIM_INFINITY))
    counts, start = {"drawn": 0, "empty": 0, "refused": 0, "faults": 0}, time.perf_counter()
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as temporary:
        folder = given.keep or temporary
        os.makedirs(folder, exist_ok=True)
        for seed in range(given.first, given.first + given.count):
            try:
                counts[run_case(seed, folder)] += 1
            except Exception as fault:
                counts["faults"] += 1
                text = " ".join(str(fault).replace(folder + os.sep, "").split())[:600]
                print(
                    f"seed {seed} (python {__file__} {seed} 1 --traceback): {type(fault).__name__}: {text}", flush=True
                )
                if given.traceback:
                    raise
    print(json.dumps(counts | {"seconds": round(time.perf_counter() - start, 1)}))
    return 1 if counts["faults"] else 0


if __name__ == "__main__":
    sys.exit(main())
