"""Do the same pictures take the same time as with another version of the package?

    git worktree add ../before HEAD~1
    python bench/before_after.py ../before
    python bench/before_after.py ../before path/to/scan.obj dense --threads 2

Two processes, one for each version, draw the same scene frame by frame in turns; only one of them works at a time. The
scenes use nothing that is optional: what a picture doesn't need must cost it nothing, in either version.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import measure, scenes

# Triangles of all sizes: below a pixel, some pixels, tens and hundreds of them, as large as the picture; and quads.
CASES = ["dense", "confetti", "teapot", "gear", "quad-torus", "quads-front"]
KINDS = (("flat", "mono"), ("gouraud", "mono"), ("gouraud", "rgb"), ("phong", "mono"))
OWN = (("phong", "own"),)  # of scenes with lights and materials of their own


def add_arguments(parser) -> None:
    """Describe the command line."""
    parser.add_argument("before", type=Path, metavar="FOLDER", help="a checkout of the other version")
    parser.add_argument("cases", nargs="*", type=scenes.find_name, default=CASES, metavar="CASE")
    parser.add_argument("--size", type=scenes.size_of, default=(1920, 1080), help="default: 1080p")
    parser.add_argument("--cull", choices=("none", "back"), default="back")
    measure.add_turns(parser, frames=30, pairs=4)


def measure_versions(args):
    """Yield a row for each scene, shading and number of channels: before, after, and after/before."""
    for case in args.cases:
        kinds = OWN if case in scenes.WHOLE else KINDS
        works = [{"case": case, "size": args.size, "channels": channels,
                  "options": {"shading": shading, "cull": args.cull, "threads": args.threads}}
                 for shading, channels in kinds]  # fmt: skip
        found = measure.compare(works, {"folder": args.before.resolve()}, {}, args)
        for (shading, channels), row in zip(kinds, found, strict=True):
            yield {"case": Path(case).stem, "shading": shading, "channels": channels, "ms_before": row["ms_first"],
                   "ms_after": row["ms_second"], "ratio": row["ratio"], "ratio_of_best": row["ratio_of_best"],
                   "bytes": row["bytes"]}  # fmt: skip


main = measure.script("before_after", __doc__, add_arguments, measure_versions)

if __name__ == "__main__":
    sys.exit(main())
