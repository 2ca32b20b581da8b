"""How many milliseconds does a frame take?

    python bench/frame.py              every scene, shading and size, with 1 and all threads
    python bench/frame.py path/to/scan.obj --sizes 1080p --cull back --stages
    python bench/frame.py --cold       from nothing to the first picture, cache empty and filled
    python bench/frame.py --memory     peak memory, each scene in a process of its own
    python bench/frame.py --huge       ten million triangles

Measured is Renderer.render: from the prepared scene to the array of sRGB bytes, vertex stage included.
Columns are explained in bench/README.md; the last line of the output is the same as JSON.
"""

import argparse
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import measure, scenes
from rasterizer import Options, Renderer
from rasterizer.analysis.timing import take_turns
from rasterizer.choices import SHADINGS

CASES = (*scenes.MODEL_NAMES, "confetti", "dense", "quad-torus", "quads-front", "quads-back")
HUGE_LIMIT_MIB = 3000


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    args.threads = args.threads or sorted({1, Options().n_thread})
    machine = measure.Machine()
    parts = [part for part in (measure_cold, measure_memory, measure_huge) if getattr(args, part.__name__[8:])]
    rows = [row for part in parts or [measure_frames] for row in part(args)]
    if (peak := measure.peak_mib()) is not None:
        print(f"\npeak memory of this process {peak:.0f} MiB")
    measure.print_json("frame", machine, args, rows)
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", default=CASES, metavar="CASE",
                        help=f"a model file, or one of {', '.join(scenes.all_names())}")  # fmt: skip
    parser.add_argument("--sizes", nargs="+", default=["512", "1080p", "4k"], metavar="SIZE")
    parser.add_argument("--shadings", nargs="+", default=["flat", "gouraud", "phong"], choices=SHADINGS)
    parser.add_argument("--threads", nargs="+", type=int, help="default: 1, and as many as there are cores")
    parser.add_argument("--cull", choices=("none", "back"), default="none")
    parser.add_argument("--samples", type=int, default=1)
    scenes.add_arguments(parser)
    parser.add_argument("--frames", type=int, default=25, help="most warm frames of each row (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=2.0, help="time limit of a row (default: %(default)s)")
    parser.add_argument("--stages", action="store_true", help="print the milliseconds of each stage as well")
    instead = parser.add_argument_group("measured instead of the frames, each in fresh processes")
    instead.add_argument("--cold", action="store_true", help="start-up and compiling; first case and size")
    instead.add_argument("--memory", action="store_true", help="peak memory of each row")
    instead.add_argument("--huge", action="store_true", help="ten million triangles at 1080p, with peak memory")
    measure.add_output(parser)
    return parser


def measure_frames(args):
    """Yield a row for every case, size and shading; the numbers of threads take turns."""
    columns = [("case        ", "case", ""), ("triangles", "triangles", "d"), ("size     ", "size", ""),
               ("shading", "shading", ""), ("prepare", "prepare_ms", ".0f"),
                (" first", "first_ms", ".0f")]  # fmt: skip
    columns += [(f"  ms {n}T", f"ms_{n}", ".2f") for n in args.threads]
    columns += [("spread", "spread", ".0%"), (" yards", "yards", ".2f"), (" gain", "gain", ".2f"),
                ("ns/tri", "ns_triangle", ".1f"), ("ns/px", "ns_pixel", ".2f"),
                 ("covered", "coverage", ".0%")]  # fmt: skip
    table = measure.Table(columns)
    for case in args.cases:
        for text in args.sizes:
            size = scenes.size_of(text)
            scene = scenes.build(case, size, args.lights, args.channels)
            for shading in args.shadings:
                name = Path(case).stem
                row = {
                    "case": name,
                    "triangles": scene.n_face,
                    "size": "{}x{}".format(*size),
                    "shading": shading,
                }
                row |= measure_frame(scene, size, shading, args)
                table.print(row)
                if args.stages:
                    print_stages(row["stages"])
                yield row


def measure_frame(scene, size, shading, args) -> dict:
    """Measure one row: prepare, first call, and warm frames with each number of threads."""
    with ExitStack() as stack:
        start, calls = perf_counter(), {"yard": measure.yardstick}
        marks = []
        for n_thread in args.threads:
            renderer = Renderer(scene, size, shading=shading, cull=args.cull, samples=args.samples,
                                outputs=("rgb",), threads=n_thread)  # fmt: skip
            marks.append(perf_counter())
            calls[n_thread] = stack.enter_context(renderer).render
        before = perf_counter()
        frame = calls[args.threads[0]]()
        first_ms = 1000.0 * (perf_counter() - before)
        covered, coverage = frame.stats.covered, frame.stats.coverage
        del frame
        for n_thread in args.threads[1:]:
            calls[n_thread]()
        turns = take_turns(calls, args.seconds, args.frames)
    median = {name: float(np.median(times)) for name, (times, _) in turns.items()}
    one, all_ = median[args.threads[0]], median[args.threads[-1]]
    stages = {n: median_stages(turns[n][1]) for n in args.threads}
    return {"prepare_ms": 1000.0 * (marks[0] - start), "first_ms": first_ms,
            **{f"ms_{n}": median[n] for n in args.threads}, "n_frame": len(turns["yard"][0]),
            "spread": max(measure.spread(turns[n][0]) for n in args.threads),
            "yard_ms": median["yard"], "yards": one / median["yard"],
            "gain": one / all_ if len(args.threads) > 1 else None,
            "ns_triangle": 1e6 * one / scene.n_face, "ns_pixel": 1e6 * one * args.samples / max(covered, 1),
            "coverage": coverage, "stages": stages}  # fmt: skip


def median_stages(stats: list) -> dict:
    """Median milliseconds of each stage over the frames."""
    return {stage: float(np.median([s.milliseconds.get(stage, 0.0) for s in stats])) for stage in stats[0].milliseconds}


def print_stages(stages: dict) -> None:
    """Print a line for each number of threads."""
    for n_thread, of_stage in stages.items():
        total = sum(of_stage.values())
        shares = "; ".join(f"{stage} {ms:.2f} ({ms / total:.0%})" for stage, ms in of_stage.items())
        print(f"    {n_thread}T: {shares}")


# ── in processes of their own ─────────────────────────────────────────────────────────────────────────────


def settings_of(args, shading, size, n_thread) -> list:
    """The command line of probe.py."""
    return ["--shading", shading, "--size", size, "--threads", n_thread, "--cull", args.cull,
            "--lights", args.lights, "--channels", args.channels, "--samples", args.samples]  # fmt: skip


def measure_cold(args):
    """Yield two rows a shading: with an empty cache of compiled kernels, and with what that left there."""
    table = measure.Table([("case        ", "case", ""), ("shading", "shading", ""), ("cache ", "cache", ""), *STEPS])
    case, size = args.cases[0], args.sizes[0]
    for shading in args.shadings:
        with tempfile.TemporaryDirectory() as cache:
            for state in ("empty", "filled"):
                row = {"case": Path(case).stem, "shading": shading, "cache": state}
                row |= measure.probe(case, *settings_of(args, shading, size, args.threads[-1]), cache=cache)
                table.print(row)
                yield row


def measure_memory(args):
    """Yield a row for every case, size and shading, each with the peak memory of its own process."""
    table = measure.Table([("case        ", "case", ""), ("triangles", "triangles", "d"),
                           ("size     ", "size", ""), ("shading", "shading", ""), *STEPS])  # fmt: skip
    for case in args.cases:
        for size in args.sizes:
            for shading in args.shadings:
                row = {"case": Path(case).stem, "size": size, "shading": shading}
                row |= measure.probe(case, *settings_of(args, shading, size, args.threads[-1]))
                table.print(row)
                yield row


def measure_huge(args):
    """Yield a row a shading for ten million triangles at 1080p; say whether they stay under the limit."""
    args.cases, args.sizes = ["huge"], ["1080p"]
    for row in measure_memory(args):
        if row["peak_mib"] is not None:
            part = row["peak_mib"] / HUGE_LIMIT_MIB
            print(f"    {part:.0%} of the {HUGE_LIMIT_MIB} MiB allowed{', TOO MUCH' if part > 1 else ''}")
        yield row


STEPS = [("import", "import_ms", ".0f"), (" build", "build_ms", ".0f"), ("prepare", "prepare_ms", ".0f"),
         (" first", "first_ms", ".0f"), ("   warm", "warm_ms", ".2f"),
         ("peak MiB", "peak_mib", ".0f")]  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
