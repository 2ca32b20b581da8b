"""How many pictures a second do several processes draw, and how much faster is that than one?

    python bench/throughput.py                                         100 models x 4 views; 1, 2 … as many as cores
    python bench/throughput.py --models 20 --workers 1 2               fewer; some numbers of processes
    python bench/throughput.py --json bench/results/throughput.json    also kept for the table of README.md

Small models, 1000 to 8000 triangles each, lie in OBJ files of a temporary folder. `rz.render_many` loads them, draws
each from four sides with four samples a pixel, and writes PNG files, which are compared: they must be the same for any
number of processes. Measured is all of a call, the start and the end of the processes included. The numbers of
processes take turns, and the best round of each counts. The gain is how many times as fast it is as the first number.
The last line is JSON.
"""

import argparse
import hashlib
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
import rasterizer as rz
from bench import measure, scenes
from rasterizer.cores import n_core

VIEWS = ("iso", "front", "right", "top")
MIN_TRIANGLES, MAX_TRIANGLES = 1000, 8000

COLUMNS = [
    ("processes", "processes", "d"), ("pictures", "pictures", "d"), ("      s", "seconds", ".2f"),
    ("spread", "spread", ".2f"), ("pictures/s", "per_second", ".1f"), ("gain", "gain", ".2f"),
]  # fmt: skip


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    machine = measure.Machine()
    with tempfile.TemporaryDirectory() as folder:
        paths = write_models(Path(folder), args.models, np.random.default_rng(args.seed))
        rows = measure_workers(paths, Path(folder), args)
    table = measure.Table(COLUMNS)
    for row in rows:
        table.print(row)
    measure.print_json("throughput", machine, args, rows)
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    workers = [n for n in (1, 2, 4, 8, 16, 32, 64) if n < n_core()] + [n_core()]
    add = parser.add_argument
    add("--models", type=int, default=100, help="how many (default: %(default)s)")
    add("--workers", nargs="+", type=int, default=workers, metavar="N", help="processes (default: %(default)s)")
    add("--size", type=scenes.size_of, default=(256, 256), metavar="WxH", help="of the pictures (default: 256)")
    add("--shading", choices=("flat", "gouraud", "phong"), default="gouraud", help="(default: %(default)s)")
    add("--rounds", type=int, default=3, help="turns (default: %(default)s)")
    add("--seed", type=int, default=1, help="of the models (default: %(default)s)")
    add(
        "--scheduler",
        metavar="ADDRESS",
        help="draw on the workers of this scheduler of Dask instead, as many as it has",
    )
    measure.add_output(parser)
    return parser


def write_models(folder: Path, n: int, rng: np.random.Generator) -> list[Path]:
    """Write tori of different sizes as OBJ files; return their paths."""
    paths = []
    for k in range(n):
        n_ring = int(np.sqrt(rng.uniform(MIN_TRIANGLES, MAX_TRIANGLES)))
        vertices, faces = scenes.torus(n_ring, n_ring // 2, tube_radius=rng.uniform(0.1, 0.6))
        lines = [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in np.asarray(faces, np.int64) + 1]
        paths.append(folder / f"model{k}.obj")
        paths[-1].write_text("\n".join(lines) + "\n", encoding="utf-8")
    return paths


def measure_workers(paths: list[Path], folder: Path, args) -> list[dict]:
    """Draw all pictures by each number of processes in turns; return a row for each."""
    numbers = [None] if args.scheduler else list(dict.fromkeys(args.workers))
    seconds, hashes = {n: [] for n in numbers}, set()
    draw(paths[:1], folder / "warm", args, numbers[0])  # compiles what isn't stored
    for _ in range(args.rounds):
        for n in numbers:
            start = time.perf_counter()
            draw(paths, folder / "pictures", args, n)
            seconds[n].append(time.perf_counter() - start)
            hashes.add(hash_of(folder / "pictures"))
    if len(hashes) != 1:
        raise SystemExit("the pictures differ between numbers of processes")
    n_picture, first = len(paths) * len(VIEWS), min(seconds[numbers[0]])
    return [
        {
            "processes": n,
            "pictures": n_picture,
            "seconds": min(times),
            "spread": measure.spread(np.array(times)),
            "per_second": n_picture / min(times),
            "gain": first / min(times),
        }
        for n, times in seconds.items()
    ]


def draw(paths, folder: Path, args, n: int | None) -> None:
    """Draw each model from each side by n processes."""
    options = rz.Options(size=args.size, shading=args.shading, samples=4, outputs="rgb", threads=1)
    tasks = (
        rz.RenderTask(path, folder / f"{path.stem}-{view}.png", view, options=options)
        for path in paths
        for view in VIEWS
    )
    failed = [record for record in rz.render_many(tasks, args.scheduler, n_process=n) if record.error is not None]
    if failed:
        raise SystemExit(f"{failed[0].path}: {failed[0].error}")


def hash_of(folder: Path) -> str:
    """Return a hash of all files of a folder."""
    found = hashlib.sha256()
    for path in sorted(folder.iterdir()):
        found.update(path.name.encode() + path.read_bytes())
    return found.hexdigest()


if __name__ == "__main__":
    sys.exit(main())
