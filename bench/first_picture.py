"""Draw a small scene as a program would; print the milliseconds of each step as JSON.

python bench/first_picture.py            in this process
python bench/first_picture.py --spawn    in a worker process, as a pool of processes starts it
"""

import json
import multiprocessing
import os
import sys
from pathlib import Path
from time import monotonic_ns

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed

STEPS = (
    "process",
    "import",
    "first",
    "next",
)  # until the process runs; of rasterizer; the first picture; the same again


def draw(start: int) -> dict:
    """Draw twice; return milliseconds of each step. The first begins at `start` on the clock that processes share."""
    marks = [start, monotonic_ns()]
    import rasterizer as rz

    marks.append(monotonic_ns())
    square = rz.Mesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2, 3]])
    scene = rz.Scene([square])
    for _ in range(2):
        rz.render(scene, (640, 480), samples=1)
        marks.append(monotonic_ns())
    spans = zip(STEPS, marks[:-1], marks[1:], strict=True)
    return {f"{step}_ms": (end - begin) / 1e6 for step, begin, end in spans}


def main() -> None:
    """Draw here, or in a worker."""
    start = int(os.environ.get("BENCH_START", monotonic_ns()))
    if "--spawn" in sys.argv:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            found = pool.apply(draw, (start,))
    else:
        found = draw(start)
    print(json.dumps(found))


if __name__ == "__main__":
    main()
