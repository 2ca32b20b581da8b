"""How many pictures a second do several processes draw, and how much faster is that than one?

    python bench/throughput.py                                         100 models x 4 views; 1, 2 … as many as cores
    python bench/throughput.py --models 20 --workers 1 2               fewer; some numbers of processes

Small models, 1000 to 8000 triangles each, lie in OBJ files of a temporary folder. `rz.render_many` loads them, draws
each from four sides with four samples a pixel, and writes PNG files, which are compared: they must be the same for any
number of processes. Measured is all of a call, the start and the end of the processes included. The numbers of
processes take turns, and the best round of each counts. The gain is how many times as fast it is as the first number.
"""

import hashlib
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
import rasterizer as rz
from bench import measure, scenes
from rasterizer.cores import n_core

VIEWS = ("iso", "front", "right", "top")
MIN_TRIANGLES, MAX_TRIANGLES = 1000, 8000


def add_arguments(parser) -> None:
    """Describe the command line."""
    workers = sorted({n for n in (1, 2, 4, 8, 16, 32, 64) if n < n_core()} | {n_core()})
    add = parser.add_argument
    add("--models", type=int, default=100, help="how many (default: %(default)s)")
    add("--workers", nargs="+", type=int, default=workers, metavar="N", help="processes (default: %(default)s)")
    add("--size", type=scenes.size_of, default=(256, 256), metavar="WxH", help="of the pictures (default: 256)")
    add("--rounds", type=int, default=3, help="turns (default: %(default)s)")


def measure_workers(args):
    """Yield a row for each number of processes."""
    random = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as name:
        folder, paths = Path(name), []
        for k in range(args.models):
            n_ring = int(np.sqrt(random.uniform(MIN_TRIANGLES, MAX_TRIANGLES)))
            torus = scenes.torus(n_ring, n_ring // 2, tube_radius=random.uniform(0.1, 0.6))
            paths.append(scenes.write_obj(folder / f"model{k}.obj", *torus))
        draw(paths[:1], folder / "warm", args.size, 1)  # compiles what isn't stored
        rounds = [[draw(paths, folder / "pictures", args.size, n) for n in args.workers] for _ in range(args.rounds)]
    if len({digest for row in rounds for _, digest in row}) != 1:
        raise SystemExit("the pictures differ between numbers of processes")
    seconds, n_picture = np.array([[time for time, _ in row] for row in rounds]), len(paths) * len(VIEWS)
    best = seconds.min(axis=0)
    for k, n in enumerate(args.workers):
        yield {"processes": n, "seconds": float(best[k]), "spread": measure.spread(seconds[:, k]),
               "per_second": float(n_picture / best[k]), "gain": float(best[0] / best[k])}  # fmt: skip


def draw(paths, folder: Path, size, n: int) -> tuple[float, str]:
    """Draw each model from each side by n processes; return the seconds, and a hash of all files."""
    start = perf_counter()
    options = rz.Options(size=size, samples=4, outputs="rgb", threads=1)
    tasks = (rz.RenderTask(path, folder / f"{path.stem}-{view}.png", view, options=options)
             for path in paths for view in VIEWS)  # fmt: skip
    failed = [record for record in rz.render_many(tasks, n_process=n) if record.error is not None]
    if failed:
        raise SystemExit(f"{failed[0].path}: {failed[0].error}")
    seconds, found = perf_counter() - start, hashlib.sha256()
    for path in sorted(folder.iterdir()):
        found.update(path.name.encode() + path.read_bytes())
    return seconds, found.hexdigest()


main = measure.script("throughput", __doc__, add_arguments, measure_workers)

if __name__ == "__main__":
    sys.exit(main())
