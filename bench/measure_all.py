"""Measure everything that the pages tell, and write their tables: a quarter of an hour.

    python bench/measure_all.py --scan path/to/scan.obj --textured path/to/textured.obj
    python bench/measure_all.py --only tolerance choices               some of bench/results/, by their names
    python bench/measure_all.py --quick                                a few frames each: to see whether it all works

Scripts run one after the other, each in a process of its own, and keep what they find in bench/results/. What fails,
as peers do that aren't installed, leaves its earlier results. Nothing else should run on the machine meanwhile.
"""

import argparse
import subprocess
import sys
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import scenes, tables, whole

HERE = Path(__file__).parent
QUICK = {"--frames": "3", "--seconds": "0.2", "--runs": "3", "--pairs": "1", "--rounds": "3"}  # what takes their place


def list_runs(scan: str, textured: str) -> dict[str, list[str]]:
    """List the command lines by the names of their results."""
    usual = ["teapot", "gear", "confetti", "dense", "quad-torus", "quads-front", "quads-back"]
    usual += ["--sizes", "1080p", "--cull", "back", "--threads", "1", "2", "--seconds", "0.7"]
    peers = ["textured", "model-512-gouraud", "model-1080p-gouraud", "model-1080p-phong", "specks"]
    return {
        "frame": ["frame.py", scan, *usual],
        "frame_4": ["frame.py", scan, *usual, "--samples", "4"],
        "frame_rgb": ["frame.py", scan, *usual, "--channels", "rgb"],
        "frame_rgb_4": ["frame.py", scan, *usual, "--channels", "rgb", "--samples", "4"],
        "frame_huge": ["frame.py", "--huge", "--shadings", "gouraud", "--threads", "2"],
        "tolerance": ["tolerance.py", "--seconds", "1"],
        "tolerance_modes": ["tolerance_modes.py", "--models", "teapot", "sphere", f"{scan}@1080p"],
        "throughput": ["throughput.py"],
        "paths": ["paths.py", "--scan", scan],
        "choices": ["choices.py", "--seconds", "30"],
        "refinement": ["refinement.py", "--seconds", "5"],
        "hard_cases": ["hard_cases.py"],
        "features": ["features.py", "--model", scan, "--seconds", "15"],
        "startup": ["startup.py", scan, "--runs", "11", "--cold", "2"],
        "whole": ["whole.py", "--models", "teapot", scan, *whole.USUAL],
        "viewer": ["viewer.py", scan],
        "encode": ["encode.py", "--seconds", "1"],
        "scale": ["scale.py", "--seconds", "1"],
        "scale_many": ["scale.py", "--many", "5000"],
        "peers": ["peers.py", "--model", scan, "--textured-model", textured, "--only", "llvmpipe", "--cases", *peers],
    }


PLOTTED = ("choices", "features", "refinement", "scale")


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    start, failed = perf_counter(), []
    models = (str(scenes.find_file(name)) for name in (args.scan, args.textured))
    for name, command in list_runs(*models).items():
        if args.only and name not in args.only:
            continue
        begin = perf_counter()
        print(f"--- {name}: python bench/{' '.join(command)}", flush=True)
        if run(name, quickened(command) if args.quick else command):
            failed.append(name)
        print(f"    {perf_counter() - begin:.0f} s", flush=True)
    written = tables.main([])
    print(f"{(perf_counter() - start) / 60.0:.1f} minutes" + (f"; failed: {', '.join(failed)}" if failed else ""))
    return int(bool(failed) or written)


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = list(list_runs("", ""))
    parser.add_argument("--scan", default="teapot", help="a model of some ten thousand triangles (default: teapot)")
    parser.add_argument("--textured", default="globe", help="a model with texture coordinates (default: globe)")
    parser.add_argument("--only", nargs="+", choices=names, metavar="NAME", help=f"of {', '.join(names)}")
    parser.add_argument("--quick", action="store_true", help="few frames each: ratios alone mean something")
    return parser


def quickened(command: list[str]) -> list[str]:
    """A command line with fewer frames, as far as the script has such an option; it measures seconds of a whole."""
    found = list(command)
    for k, word in enumerate(command):
        if word in QUICK:
            found[k + 1] = QUICK[word] if word != "--seconds" else f"{0.2 * float(command[k + 1]):g}"
    return found


def run(name: str, command: list[str]) -> int:
    """Run a script, and keep its results; return its exit code."""
    kept = ["--json", str(tables.RESULTS / f"{name}.json")]
    if name in PLOTTED:
        kept += ["--plot", str(tables.RESULTS / f"{name}.png")]
    return subprocess.run([sys.executable, str(HERE / command[0]), *command[1:], *kept]).returncode


if __name__ == "__main__":
    sys.exit(main())
