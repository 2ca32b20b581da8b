"""Files of the grammars in `file_grammar.py`, a seed and a format each: read and drawn, one after the other, under caps
of time and memory.

    python -m helpers.file_fuzz FIRST COUNT            seeds FIRST, FIRST + 1, ... of every format: a line for each case
                                                       that fails, then how many of each format were drawn or refused
    python -m helpers.file_fuzz 0 20000 --of ply,stl   20 000 files of each of two formats
    python -m helpers.file_fuzz 17 1 --of ply --keep D one alone; its files are left in the folder D

A case is good if it draws a picture, or if it ends in an error of the package that names the file; a sound file must be
read. Warnings must be UserWarnings that name a file. Anything else is a fault: another exception, an internal error, a
case that takes too long or too much memory.
"""

import argparse
import contextlib
import io
import json
import logging
import os
import resource
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
from numba.core import event

import rasterizer as rz
from helpers.file_grammar import GRAMMARS, make_case
from rasterizer.cli import main as raster
from rasterizer.io.scene_file import read_camera_file, read_scene
from rasterizer.scene.texture import ENVIRONMENT

SECONDS = 10  # of the processor that a case may take
MEGABYTES = 500  # that a case may add to the largest size of the process
ADDRESSES = 3 * 2**30  # bytes of address space beyond those of the start: what is asked for beyond fails at once
SIZE = (16, 12)
CUBE = str(Path(__file__).parents[2] / "models" / "cube.obj")
OWN = str(Path(rz.__file__).parent)  # other libraries' deprecations are theirs
OUTCOMES = "drawn", "empty", "refused"

logging.getLogger("trimesh").addHandler(logging.NullHandler())  # it warns of packages that it would like to have


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
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
        else:
            raise TooLong

    return ring


def run_case(format, seed, folder) -> str:
    """Write the files of a case, load and draw them; return which of OUTCOMES became of it."""
    name, files, is_sound = make_case(format, seed)
    for old in Path(folder).iterdir():
        old.unlink()
    for each, data in files.items():
        (Path(folder) / each).write_bytes(data)
    path = os.path.join(folder, name) if name else folder
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            outcome = _WAYS.get(format, _load_and_draw)(path)
    except TooLong:
        raise Fault(f"takes more than {SECONDS} s") from None
    except (rz.ModelError, rz.SceneError) as fault:
        text = str(fault)
        if "internal error" in text or "more memory than" in text or folder not in text or len(text) > 2000:
            raise Fault(f"{type(fault).__name__}: {text[:500]}") from fault
        if is_sound:
            raise Fault(f"a sound file is refused: {text[:500]}") from fault
        outcome = "refused"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    if grown > MEGABYTES:
        raise Fault(f"takes {grown:.0f} MB")
    for warning in caught:
        if os.path.basename(os.path.dirname(warning.filename)) == "PIL":  # what Pillow thinks of a picture
            continue
        if issubclass(warning.category, DeprecationWarning) and not warning.filename.startswith(OWN):
            continue
        if warning.category is not UserWarning or not str(warning.message).startswith(folder):
            raise Fault(f"{warning.category.__name__}: {warning.message}")
    return outcome


def _load_and_draw(path) -> str:
    if path.endswith(".json"):
        read = read_scene(path)
        scene, options = read.finished_scene(), dict(read.options)
        rz.Options(**options)
        options |= {"size": SIZE, "samples": 1, "threads": 1}
    else:
        scene, options = rz.load(path), {"size": SIZE, "samples": 1, "threads": 1}
    is_sane = _is_sane(scene)
    with _of_file(path, is_sane):
        frame = rz.render(scene, **options, outputs=("color", "depth", "face"))
    if (frame.face >= scene.n_face).any() or (
        is_sane and not (np.isfinite(frame.color).all() and not np.isnan(frame.depth).any())
    ):
        raise Fault("the picture is not finite")
    return "drawn" if (frame.face >= 0).any() else "empty"


def _draw_by_camera(path) -> str:
    """Read cameras, and draw a cube by each."""
    if path.endswith("transforms.json"):
        cameras = rz.read_nerf(path)
    elif path.endswith(".json"):
        cameras = {"": read_camera_file(path)}
    else:
        cameras = rz.read_colmap(path)
    n_seen = 0
    for camera in cameras.values():
        with _of_file(path):
            frame = rz.render(CUBE, SIZE, camera=camera, samples=1, threads=1, outputs=("color", "depth", "face"))
        if not np.isfinite(frame.color).all() or np.isnan(frame.depth).any():
            raise Fault("the picture is not finite")
        n_seen += (frame.face >= 0).any()
    return "drawn" if n_seen else "empty"


@contextlib.contextmanager
def _of_file(path, is_warned=True):
    """Let what is said of a picture name the file: what is drawn is a scene, which has no name. Warnings count only
    where `is_warned`."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            yield
        except rz.SceneError as fault:
            raise rz.SceneError(f"{path}: {fault}") from fault
    for each in caught if is_warned else ():
        warnings.warn_explicit(f"{path}: {each.message}", each.category, each.filename, each.lineno)


def _draw_scalars(path) -> str:
    """Draw a model by the command line, which reads scalars from a file."""
    folder = os.path.dirname(path)
    words = ["-s", "16x12", "--threads", "1", "--no-ground", "-q", "-o", os.path.join(folder, "out.png")]
    with contextlib.redirect_stderr(io.StringIO()) as said:
        code = raster(["render", os.path.join(folder, "part.obj"), *words, "--scalars", path])
    if code:
        raise rz.ModelError(said.getvalue())
    return "drawn"


_WAYS = {"cameras": _draw_by_camera, "npy": _draw_scalars}


def _is_sane(scene) -> bool:
    """Tell whether float32 can hold all colours, and the square of all distances: beyond it pictures may be too bright
    to be told."""
    palette = [material for mesh in scene.meshes for material in mesh.palette]
    colors = [c for m in palette for c in (*m.ambient, *m.diffuse, *m.specular, *m.emissive)]
    colors += [c for light in scene.lights for c in light.color]
    lengths = np.abs(scene.bounds[1] - scene.bounds[0])
    return max(np.abs(colors)) < 1e10 and 1e-10 < lengths.max() < 1e10 and np.abs(scene.bounds).max() < 1e10


def main():
    """Run the cases that the command line asks for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("first", type=int)
    parser.add_argument("count", type=int)
    parser.add_argument("--of", metavar="FORMATS", default=",".join(GRAMMARS))
    parser.add_argument("--keep", metavar="FOLDER")
    parser.add_argument("--traceback", action="store_true")
    given = parser.parse_args()
    os.environ[ENVIRONMENT] = str(2**18)  # so that no case decodes pictures for seconds
    compiling = Compiling()
    event.register("numba:compiler_lock", compiling)
    signal.signal(signal.SIGPROF, _alarm(compiling))
    rz.render(rz.load(CUBE), SIZE, threads=1, samples=1)
    used = (
        int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        if sys.platform == "linux"
        else 2**40
    )
    resource.setrlimit(resource.RLIMIT_AS, (used + ADDRESSES, resource.RLIM_INFINITY))
    counts, n_fault = {}, 0
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as temporary:
        folder = given.keep or temporary
        os.makedirs(folder, exist_ok=True)
        for format in given.of.split(","):
            found, start = Counter(dict.fromkeys((*OUTCOMES, "faults"), 0)), time.process_time()
            for seed in range(given.first, given.first + given.count):
                try:
                    found[run_case(format, seed, folder)] += 1
                except Exception as fault:
                    found["faults"] += 1
                    text = " ".join(str(fault).replace(folder + os.sep, "").split())[:600]
                    how = f"python -m helpers.file_fuzz {seed} 1 --of {format} --traceback"
                    print(f"{how}: {type(fault).__name__}: {text}", flush=True)
                    if given.traceback:
                        raise
            counts[format] = found | {"seconds": round(time.process_time() - start, 1)}
            n_fault += found["faults"]
    print(json.dumps(counts))
    return 1 if n_fault else 0


if __name__ == "__main__":
    sys.exit(main())
