"""Do the same pictures take the same time as with another version of the package?

    git worktree add ../before HEAD~1
    python bench/before_after.py ../before
    python bench/before_after.py ../before path/to/scan.obj dense --threads 2

Two processes, one for each version, draw the same scene frame by frame in turns; only one of them works at a time. The
scenes use nothing that is optional: what a picture doesn't need must cost it nothing, in either version. Columns are
explained in bench/README.md.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # a checkout need not be installed
from bench import measure, scenes

CHILD = """
import sys, time
from rasterizer import Renderer
sys.path.insert(0, sys.argv.pop(1))
from bench import scenes
case, size, shading, channels, cull, threads = sys.argv[1:]
size = scenes.size_of(size)
scene = scenes.build(case, size, "one", channels)
renderer = Renderer(scene, size, shading=shading, cull=cull, outputs=("rgb",), threads=int(threads))
renderer.render()
print("ready", flush=True)
for _ in sys.stdin:
    start = time.perf_counter()
    renderer.render()
    print(1000 * (time.perf_counter() - start), flush=True)
"""
# Triangles of all sizes: below a pixel, some pixels, tens and hundreds of them, as large as the picture; and quads.
CASES = ["dense", "confetti", "teapot", "gear", "quad-torus", "quads-front"]
KINDS = (("flat", "mono"), ("gouraud", "mono"), ("gouraud", "rgb"), ("phong", "mono"))
OWN = (("phong", "own"),)  # of scenes with lights and materials of their own


class Version:
    """A process that draws a frame whenever it is asked to."""

    def __init__(self, folder, arguments):
        # The bench of this checkout with the package of that folder: not that of the folder it is called from, which
        # Python would look at first.
        environment = os.environ | {"PYTHONPATH": str(folder)}
        command = [sys.executable, "-c", CHILD, str(ROOT), *map(str, arguments)]
        self._process = subprocess.Popen(command, env=environment, text=True, cwd=ROOT.anchor,
                                         stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # fmt: skip
        if self._process.stdout.readline().strip() != "ready":
            raise SystemExit(f"the package in {folder} can't draw this scene")

    def draw(self) -> float:
        """Milliseconds of one frame."""
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return float(self._process.stdout.readline())

    def close(self) -> None:
        """End the process."""
        self._process.stdin.close()
        self._process.wait()


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path, metavar="FOLDER", help="a checkout of the other version")
    parser.add_argument("cases", nargs="*", default=CASES, metavar="CASE")
    parser.add_argument("--size", default="1080p")
    parser.add_argument("--cull", choices=("none", "back"), default="back")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--frames", type=int, default=30, help="of each pair of processes (default: %(default)s)")
    parser.add_argument("--pairs", type=int, default=4, help="of processes (default: %(default)s)")
    args = parser.parse_args(argv)
    args.cases = [str(Path(case).resolve()) if Path(case).exists() else case for case in args.cases]
    machine, rows = measure.Machine(), []
    table = measure.Table([("case        ", "case", ""), ("shading", "shading", ""), ("channels", "channels", ""),
                           ("before", "ms_before", ".2f"), (" after", "ms_after", ".2f"), ("ratio", "ratio", ".3f"),
                           ("ratio of best", "ratio_of_best", ".3f")])  # fmt: skip
    for case in args.cases:
        for shading, channels in OWN if case in scenes.WHOLE else KINDS:
            row = {"case": Path(case).stem, "shading": shading, "channels": channels}
            row |= compare(args, (case, args.size, shading, channels, args.cull, args.threads))
            table.print(row)
            rows.append(row)
    measure.print_json("before_after", machine, args, rows)
    return 0


def compare(args, arguments) -> dict:
    """Frames of both versions in turns: medians, and the median of the ratios of neighbouring frames."""
    times = np.concatenate([draw_pair(args, arguments) for _ in range(args.pairs)])
    median, best = np.median(times, axis=0), times.min(axis=0)
    return {"ms_before": median[0], "ms_after": median[1], "ratio": float(np.median(times[:, 1] / times[:, 0])),
            "ratio_of_best": float(best[1] / best[0])}  # fmt: skip


def draw_pair(args, arguments) -> np.ndarray:
    """Milliseconds of frames of both versions, (n_frame, 2), by a pair of new processes."""
    before, after = Version(args.before.resolve(), arguments), Version(ROOT, arguments)
    try:
        return np.array([(before.draw(), after.draw()) for _ in range(args.frames)])
    finally:
        before.close()
        after.close()


if __name__ == "__main__":
    sys.exit(main())
