"""How long does the command line take, from nothing to the picture's file?

    python bench/startup.py                                a torus of 70 000 triangles, 7 processes of each program
    python bench/startup.py path/to/scan.obj --runs 15 --cold 3

Programs take turns: the command line, what a user may compare it with, and parts of it. Each is a process of its own,
timed from its start to its end. Columns are explained in bench/README.md; the last line of the output is the same as
JSON.
"""

import argparse
import compileall
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # a checkout need not be installed
from bench import first_picture, measure, scenes, stages

HERE = Path(__file__).parent
RASTER = [sys.executable, "-c", "import sys; from rasterizer.cli import main; sys.exit(main())"]  # as pip installs it
YARDSTICK = "import numba"


class Launcher:
    """Run programs by launch.py."""

    def __init__(self):
        command = [sys.executable, "-S", str(HERE / "launch.py")]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def run(self, command: list, store: str) -> dict:
        """Run a program; return what launch.py finds, and `ms`.

        `store` is the folder of compiled kernels; "" leaves them where they are kept anyway.
        """
        kept = {"RASTER_STORE": store, "NUMBA_CACHE_DIR": store} if store else {}
        environment = os.environ | kept | {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": ""}
        print(json.dumps([command, environment]), file=self._process.stdin, flush=True)
        found = json.loads(self._process.stdout.readline())
        if found["code"]:
            raise SystemExit(f"{command} failed with exit code {found['code']}:\n{found['output']}")
        return found | {"ms": (found["end"] - found["start"]) / 1e6}

    def close(self) -> None:
        """End the process."""
        self._process.stdin.close()
        self._process.wait()


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    machine, launcher = measure.Machine(), Launcher()
    compileall.compile_dir(ROOT / "rasterizer", quiet=1)  # as pip does when it installs a package
    with tempfile.TemporaryDirectory() as folder:
        if args.model is None:
            args.model = write_torus(Path(folder) / "torus.obj")
        drawing = ["render", str(args.model), "-s", args.size, "-q", "-o", str(Path(folder) / "picture.png")]
        store = os.path.join(folder, "store") if args.cold else ""
        cold = measure_cold(launcher, drawing, store, args.cold)
        rows, times = measure_programs(launcher, drawing, store, args)
        rows += print_stages(cold, times)
    launcher.close()
    measure.print_json("startup", machine, args, rows)
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", nargs="?", help="a model file (default: a torus of 70 000 triangles, as OBJ)")
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--runs", type=int, default=7, help="processes of each program (default: %(default)s)")
    parser.add_argument("--cold", type=int, default=1, metavar="N",
                        help="first pictures with no kernel compiled, in a folder of this run; with 0 the kernels "
                        "are used that are there (default: %(default)s)")  # fmt: skip
    measure.add_output(parser)
    return parser


def write_torus(path: Path) -> Path:
    """Write a model as large as a common scan."""
    vertices, faces = scenes.torus(250, 140)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    path.write_text("\n".join(lines) + "\n")
    return path


# --- programs -----------------------------------------------------------------------------------------------


def list_programs(drawing: list) -> dict:
    """Programs by name: the yardstick, the command line, and parts of it."""
    python = [sys.executable, "-c"]
    return {
        YARDSTICK: [*python, YARDSTICK],
        "python alone": [*python, "pass"],
        "import numpy": [*python, "import numpy"],
        "import rasterizer": [*python, "import rasterizer"],
        "raster --help": [*RASTER, "--help"],
        "raster render": [*RASTER, *drawing],
        "stages": [sys.executable, str(HERE / "stages.py"), *drawing],
        "first picture": [sys.executable, str(HERE / "first_picture.py")],
        "in a worker": [sys.executable, str(HERE / "first_picture.py"), "--spawn"],
    }


def list_others(launcher: Launcher, drawing: list, size: str) -> dict:
    """Other programs that draw the same model, by name, as far as they are installed and run here."""
    model, output, numbers = drawing[1], drawing[-1], [str(number) for number in scenes.size_of(size)]
    others, why_not = {}, {"f3d": "it is not installed", "moderngl": "it is not installed, or trimesh is not"}
    if shutil.which("f3d"):
        others["f3d"] = ["f3d", model, "--output", output, "--resolution", ",".join(numbers)]
    if all(importlib.util.find_spec(name) for name in ("moderngl", "trimesh")):
        others["moderngl"] = [sys.executable, str(HERE / "moderngl_picture.py"), model, output, *numbers]
    for name, command in list(others.items()):
        try:
            launcher.run(command, "")
        except SystemExit as fault:  # as where there is no display
            why_not[name] = str(fault).splitlines()[-1]
            del others[name]
    for name in why_not.keys() - others.keys():
        print(f"{name} is left out: {why_not[name]}")
    return others


def measure_programs(launcher: Launcher, drawing: list, store: str, args) -> tuple[list, list]:
    """Run programs in turns; return a row for each, and the milliseconds of each stage in each run."""
    programs = list_programs(drawing) | list_others(launcher, drawing, args.size)
    found = {name: [] for name in programs}
    for turn in range(1 + args.runs):
        for name, command in programs.items():
            run = launcher.run(command, store)
            if turn:  # the first one may still compile, or read files that nobody has read before
                found[name].append(run)
    of_stages = [stages_of(run) for run in found.pop("stages")]
    yards = np.array([run["ms"] for run in found[YARDSTICK]])
    table = measure.Table([("program          ", "program", ""), ("    ms", "ms", ".0f"), ("  best", "best_ms", ".0f"),
                           ("spread", "spread", ".0%"),
                           ("yards", "yards", ".2f"), ("peak MiB", "peak_mib", ".0f"),
                           *((f"{step:>7}", f"{step}_ms", ".0f") for step in first_picture.STEPS)])  # fmt: skip
    rows = []
    for name, runs in found.items():
        times = np.array([run["ms"] for run in runs])
        row = {"program": name, "ms": float(np.median(times)), "best_ms": float(times.min()),
               "spread": measure.spread(times), "yards": float(np.median(times / yards)),
               "peak_mib": median_of(runs, "peak_mib")}  # fmt: skip
        if name in ("first picture", "in a worker"):
            steps = [json.loads(run["output"].splitlines()[-1]) for run in runs]
            row |= {key: median_of(steps, key) for key in steps[0]}
        table.print(row)
        rows.append(row)
    return rows, of_stages


def median_of(runs: list, key: str) -> float | None:
    """The median of one figure; None where the system does not tell it."""
    return None if runs[0][key] is None else float(np.median([run[key] for run in runs]))


# --- stages -------------------------------------------------------------------------------------------------


def measure_cold(launcher: Launcher, drawing: list, store: str, n_run: int) -> list[dict]:
    """Draw with no kernel compiled; return milliseconds by stage of each run. The last one's kernels are kept."""
    times = []
    for _ in range(n_run):
        shutil.rmtree(store, ignore_errors=True)
        os.mkdir(store, 0o700)  # code is loaded from it: it must be closed to others
        times.append(stages_of(launcher.run([sys.executable, str(HERE / "stages.py"), *drawing], store)))
    return times


def stages_of(run: dict) -> dict:
    """The milliseconds of each stage of a process, and of all together."""
    found = json.loads(run["output"].splitlines()[-1])
    if found["missing"]:
        print(f"WARNING: no function was found to time: {', '.join(found['missing'])}", file=sys.stderr)
    return found["ms"] | {"exit": (run["end"] - found["end"]) / 1e6, "whole process": run["ms"]}


def print_stages(cold: list[dict], warm: list[dict]) -> list[dict]:
    """Print medians by stage, and return the rows; a stage that took no time in any run is left out."""
    table = measure.Table([("stage        ", "stage", ""), ("warm ms", "warm_ms", ".1f"), ("share", "share", ".0%"),
                           (" cold ms", "cold_ms", ".0f")])  # fmt: skip
    whole = median_of(warm, "whole process")
    rows = []
    for stage in (*stages.STAGES, "whole process"):
        row = {"stage": stage, "warm_ms": median_of(warm, stage), "cold_ms": median_of(cold, stage) if cold else None}
        if row["warm_ms"] or row["cold_ms"]:
            row["share"] = row["warm_ms"] / whole
            table.print(row)
            rows.append(row)
    return rows


if __name__ == "__main__":
    sys.exit(main())
