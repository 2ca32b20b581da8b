"""Draw one scene in a process of its own; print the time of each step and the peak memory as a line of JSON.

`frame.py` runs this for what can't be measured twice in one process: imports, compiling, memory.
"""

import argparse
import json
import sys
from itertools import pairwise
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed


def main(argv=None) -> None:
    """Draw and print; milliseconds, MiB."""
    start = perf_counter()
    from bench import measure, scenes
    from rasterizer import Renderer
    from rasterizer.analysis.timing import take_turns

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case")
    parser.add_argument("--size", type=scenes.size_of, default=(640, 480))
    parser.add_argument("--shading", default="gouraud")
    parser.add_argument("--cull", default="none")
    parser.add_argument("--samples", type=int, default=1)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--frames", type=int, default=5)
    scenes.add_arguments(parser)
    args = parser.parse_args(argv)
    marks = [start, perf_counter()]
    scene = scenes.build(args.case, args.size, args.lights, args.channels)
    marks.append(perf_counter())
    options = {name: getattr(args, name) for name in ("shading", "cull", "samples", "threads")}
    with Renderer(scene, args.size, outputs=("rgb",), **{"samples": 1} | options) as renderer:
        marks.append(perf_counter())
        renderer.render()
        marks.append(perf_counter())
        times, _ = take_turns({"frame": renderer.render}, 10.0, args.frames)["frame"]
    steps = [1000.0 * (after - before) for before, after in pairwise(marks)]
    names = ("import_ms", "build_ms", "prepare_ms", "first_ms")
    found = dict(zip(names, steps, strict=True), warm_ms=sorted(times)[len(times) // 2])
    print(json.dumps(found | {"triangles": scene.n_face, "threads": renderer.options.n_thread,
                              "peak_mib": measure.peak_mib()}))  # fmt: skip


if __name__ == "__main__":
    main()
