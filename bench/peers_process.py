"""A renderer in a process of its own, which draws a frame whenever it is asked to.

`Process` starts this file as a script. Lines go in by its standard input, answers come out by its standard output, a
line of JSON each: first what the renderer is and what it draws, then the times of every "frame", and "done" for a
"picture", which is written into a folder. What libraries print goes to a file there.
"""

import importlib
import importlib.util
import json
import os
import re
import subprocess
import sys
import tempfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # a checkout need not be installed
from bench.peers_work import Setup, Unable, Work

N_WARM = 3  # frames before the first that counts: shaders and kernels are compiled, memory is allocated
THREAD_VARIABLES = ("LP_NUM_THREADS", "VTK_SMP_MAX_THREADS", "OMP_NUM_THREADS")  # llvmpipe's, VTK's, anybody's
SOFTWARE = {"LIBGL_ALWAYS_SOFTWARE": "1", "GALLIUM_DRIVER": "llvmpipe"}  # Mesa draws without a GPU, if there is one
MESSAGES, PICTURE = "messages", "picture.npz"


class Library(NamedTuple):
    """What draws."""

    module: str  # of this folder
    needs: str  # what is imported there
    system: str = ""  # what that draws with, by the names of Debian's packages


MESA = "libegl1 and libgl1-mesa-dri"
MODULES = {
    "ours": Library("peers_ours", "rasterizer"),
    "llvmpipe": Library("peers_llvmpipe", "moderngl", MESA),
    "tinydisplay": Library("peers_tinydisplay", "panda3d"),
    "vtk": Library("peers_vtk", "vtk", MESA),
}
PEERS = tuple(name for name in MODULES if name != "ours")


class Failure(Exception):
    """A renderer can't draw; the message names it, and says why in one line."""

    def __init__(self, renderer: str, why: str):
        super().__init__(f"{renderer} can't draw it: {why}")
        self.renderer = renderer


def find_missing(renderer: str) -> str:
    """Say what is missing for a renderer; nothing where it is installed."""
    needs = MODULES[renderer].needs
    return "" if importlib.util.find_spec(needs) else f"{needs} is not installed: pip install {needs}"


def keep_on(n_core: int) -> int:
    """Keep this process on so many cores, as far as the system lets us choose; return on how many it is."""
    if not hasattr(os, "sched_setaffinity"):
        return os.cpu_count()
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:n_core])
    return len(os.sched_getaffinity(0))


class Process:
    """The renderer, seen from outside.

    Parameters
    ----------
    renderer : one of MODULES
    arrays : file of the work's arrays
    setup : the rest of the work, with the number of threads asked for; the process is kept on so many cores
    options : what else this package's Renderer is given

    Attributes
    ----------
    version : text
    cores : how many it has
    setup : what it draws, which may be less than it was asked for
    difference : what it does otherwise nevertheless; text, may be empty

    Raises
    ------
    Failure : it can't draw this work
    """

    def __init__(self, renderer: str, arrays: Path, setup: Setup, options: dict | None = None):
        self._renderer, self._folder = renderer, tempfile.TemporaryDirectory()
        threads = dict.fromkeys(THREAD_VARIABLES, str(setup.threads))
        environment = os.environ | threads | SOFTWARE | {"PYTHONPATH": str(ROOT)}
        command = [sys.executable, __file__, renderer, self._folder.name, str(arrays), setup.to_json(),
                   json.dumps(options or {})]  # fmt: skip
        self._process = subprocess.Popen(command, env=environment, text=True, stdin=subprocess.PIPE,
                                         stdout=subprocess.PIPE)  # fmt: skip
        try:
            found = self._hear()
        except BaseException:
            self.close()
            raise
        self.setup = Setup.from_json(found.pop("setup"))
        self.version, self.cores, self.difference = found["version"], found["cores"], found["difference"]

    def _hear(self):
        """Return the next answer."""
        line = self._process.stdout.readline()
        if not line:
            raise self._failure(f"exit code {self._process.wait()}: {self._last_message()}")
        answer = json.loads(line)
        if isinstance(answer, dict) and "unable" in answer:
            raise Failure(self._renderer, answer["unable"])
        if isinstance(answer, dict) and "failure" in answer:
            raise self._failure(answer["failure"])
        return answer

    def _failure(self, why: str) -> Failure:
        """Return the error that says why, and what may be missing."""
        system = MODULES[self._renderer].system
        return Failure(self._renderer, f"{why} (it draws with {system} of the system)" if system else why)

    def _last_message(self) -> str:
        """The last line that the process has printed."""
        messages = Path(self._folder.name, MESSAGES)
        lines = messages.read_text(errors="replace").splitlines() if messages.exists() else []
        return re.sub(r"\x1b\[[0-9;]*m", "", lines[-1]) if lines else "it said nothing"  # without colours

    def _ask(self, word: str):
        """Say a word; return the answer."""
        with suppress(BrokenPipeError):  # then there is no answer, either
            self._process.stdin.write(word + "\n")
            self._process.stdin.flush()
        return self._hear()

    def draw(self) -> list[float]:
        """Draw a frame; return milliseconds, and milliseconds of processors, those of all threads together."""
        return self._ask("frame")

    def picture(self) -> dict:
        """Return the last picture: `rgba` (height, width, 4) uint8, and `depth` (height, width) float32 of ours."""
        self._ask("picture")
        with np.load(Path(self._folder.name, PICTURE)) as arrays:
            return dict(arrays)

    def close(self) -> None:
        """End the process."""
        with suppress(BrokenPipeError):  # it has ended by itself
            self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()
        self._folder.cleanup()


def main(renderer: str, folder: str, arrays: str, setup: str, options: str) -> None:
    """Be the renderer, until nothing more is asked."""
    # Libraries may print where the answers belong: from here on that is a file.
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    messages = os.open(Path(folder, MESSAGES), os.O_WRONLY | os.O_CREAT)
    os.dup2(messages, 1)
    os.dup2(messages, 2)
    try:
        painter_class = importlib.import_module(f"bench.{MODULES[renderer].module}").Painter
        work = Work.load(Path(arrays), Setup.from_json(setup))
        adapted, difference = painter_class.adapt(work)
        n_core = keep_on(adapted.threads)
        painter = painter_class(replace(work, setup=adapted), **json.loads(options))
        for _ in range(N_WARM):
            painter.draw()
    except Unable as fault:
        print(json.dumps({"unable": str(fault)}), file=answers)
        return
    except Exception as fault:  # whatever a library raises where there is no driver, no display, no memory
        print(json.dumps({"failure": f"{type(fault).__name__}: {fault}".partition("\n")[0]}), file=answers)
        return
    print(json.dumps({"version": painter.version, "cores": n_core, "setup": adapted.to_json(),
                      "difference": difference}), file=answers)  # fmt: skip
    for line in sys.stdin:
        if line.strip() == "frame":
            start, start_cpu = perf_counter(), process_time()
            painter.draw()
            cpu, wall = process_time() - start_cpu, perf_counter() - start
            print(json.dumps([1000.0 * wall, 1000.0 * cpu]), file=answers)
        else:
            depth = {"depth": painter.depth} if hasattr(painter, "depth") else {}
            np.savez(Path(folder, PICTURE), rgba=painter.rgba, **depth)
            print('"done"', file=answers)


if __name__ == "__main__":
    main(*sys.argv[1:])
