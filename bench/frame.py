"""How many milliseconds does a frame take?

    python bench/frame.py              every scene, shading and size, with 1 and all threads
    python bench/frame.py path/to/scan.obj --sizes 1080p --cull back --samples 4 --stages

Measured is Renderer.render: from the prepared scene to the array of sRGB bytes, vertex stage included.
"""

import sys
from contextlib import ExitStack
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import measure, scenes
from bench.measure import SHADINGS
from rasterizer import Options
from rasterizer.analysis.timing import take_turns

CASES = (*scenes.MODEL_NAMES, "confetti", "dense", "quad-torus", "quads-front", "quads-back")


def add_arguments(parser) -> None:
    """Describe the command line."""
    add = parser.add_argument
    add("cases", nargs="*", default=CASES, metavar="CASE", help=f"a file, or of {', '.join(scenes.all_names())}")
    add("--sizes", nargs="+", default=["512", "1080p", "4k"], metavar="SIZE")
    add("--shadings", nargs="+", default=SHADINGS, choices=SHADINGS)
    add("--threads", nargs="+", type=int, default=sorted({1, Options().n_thread}), help="(default: %(default)s)")
    add("--cull", choices=("none", "back"), default="none")
    add("--samples", nargs="+", type=int, default=[1])
    add("--channels", nargs="+", choices=("mono", "rgb", "own"), default=["mono"], help="grey, coloured, the model's")
    add("--frames", type=int, default=25, help="most warm frames of each row (default: %(default)s)")
    add("--seconds", type=float, default=2.0, help="time limit of a row (default: %(default)s)")
    add("--stages", action="store_true", help="the milliseconds of each stage as well, with the fewest threads")


def measure_frames(args):
    """Yield a row for every case, size, channels, shading and number of samples; numbers of threads take turns."""
    for case, text, channels in product(args.cases, args.sizes, args.channels):
        size = scenes.size_of(text)
        scene = scenes.build(case, size, "one", channels)
        for shading, samples in product(args.shadings, args.samples):
            options = {"shading": shading, "cull": args.cull, "samples": samples}
            with ExitStack() as stack:
                calls = {n: measure.warm(stack, scene, size, options | {"threads": n}).render for n in args.threads}
                covered = calls[args.threads[0]]().stats.covered
                turns = take_turns(calls, args.seconds, args.frames)
            ms = {n: float(np.median(times)) for n, (times, _) in turns.items()}
            one, stats = ms[args.threads[0]], turns[args.threads[0]][1]
            row = {"case": Path(case).stem, "triangles": scene.n_face, "size": "{}x{}".format(*size),
                   "channels": channels, "shading": shading, "samples": samples, **{f"ms_{n}": ms[n] for n in ms},
                   "spread": max(measure.spread(times) for times, _ in turns.values()),
                   "gain": one / ms[args.threads[-1]], "ns_triangle": 1e6 * one / scene.n_face,
                   "ns_pixel": 1e6 * one * samples / max(covered, 1)}  # fmt: skip
            if args.stages:
                row |= {stage: float(np.median([each.milliseconds.get(stage, 0.0) for each in stats]))
                        for stage in stats[0].milliseconds}  # fmt: skip
            yield row


main = measure.script("frame", __doc__, add_arguments, measure_frames)

if __name__ == "__main__":
    sys.exit(main())
