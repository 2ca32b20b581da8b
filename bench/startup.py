"""How long does the command line take, from nothing to the picture's file?

    python bench/startup.py                                a torus of 70 000 triangles, 7 processes of each program
    python bench/startup.py path/to/scan.obj --runs 15 --cold 3

Programs take turns: the command line, what a user may compare it with, and parts of it. Each is a process of its own,
timed from its start to its end. `yards` are multiples of the time of `import numba`.
"""

import compileall
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import measure, scenes

YARDSTICK = "import numba"
FIRST_PICTURE = (
    "import rasterizer as rz; rz.render(rz.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), (640, 480))"
)


def add_arguments(parser) -> None:
    """Describe the command line."""
    add = parser.add_argument
    add("model", nargs="?", help="a model file (default: a torus of 70 000 triangles, as OBJ)")
    add("--size", default="640x480")
    add("--runs", type=int, default=7, help="processes of each program (default: %(default)s)")
    add("--cold", type=int, default=1, help="first pictures with no kernel compiled (default: %(default)s)")


def measure_programs(args):
    """Yield a row for each program."""
    compileall.compile_dir(measure.ROOT / "rasterizer", quiet=1)  # as pip does when it installs a package
    with tempfile.TemporaryDirectory() as name, measure.Launcher() as launcher:
        folder = Path(name)
        model = args.model or scenes.write_obj(folder / "torus.obj", *scenes.torus(250, 140))
        drawing = [*measure.RASTER, "render", str(model), "-s", args.size, "-q", "-o", str(folder / "picture.png")]
        codes = {name: [sys.executable, "-c", name] for name in (YARDSTICK, "import numpy", "import rasterizer")}
        programs = {
            **codes,
            "python alone": [sys.executable, "-c", "pass"],
            "raster --help": [*measure.RASTER, "--help"],
            "raster render": drawing,
            "first picture": [sys.executable, "-c", FIRST_PICTURE],
        }
        found = launcher.run_turns(programs, args.runs)
        for name, figures in found.items():
            yield row_of(name, figures, found[YARDSTICK]["ms"])
        stores = [folder / f"store{k}" for k in range(args.cold)]
        for store in stores:
            store.mkdir(mode=0o700)  # code is loaded from it: it must be closed to others
        cold = [launcher.run(drawing, RASTER_STORE=str(store), NUMBA_CACHE_DIR=str(store)) for store in stores]
        if cold:
            figures = {key: np.array([run[key] for run in cold]) for key in ("ms", "peak_mib")}
            yield row_of("raster render, no kernel compiled", figures, np.median(found[YARDSTICK]["ms"]))


def row_of(name: str, figures: dict, yards) -> dict:
    """A program's row."""
    ms = figures["ms"]
    return {"program": name, "ms": float(np.median(ms)), "best_ms": float(ms.min()), "spread": measure.spread(ms),
            "yards": float(np.median(ms / yards)), "peak_mib": float(np.median(figures["peak_mib"]))}  # fmt: skip


main = measure.script("startup", __doc__, add_arguments, measure_programs)

if __name__ == "__main__":
    sys.exit(main())
