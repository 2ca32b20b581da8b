"""Measure everything that the pages tell, and write their tables and figures: twenty minutes.

    python bench/measure_all.py --scan path/to/scan.obj --textured path/to/textured.obj
    python bench/measure_all.py --only tolerance choices               some of bench/results/, by their names
    python bench/measure_all.py --quick                                a few frames each: to see whether it all works

Scripts run one after the other, each in a process of its own, and keep what they find in bench/results/, with the
version of the package and a hash of its code. What can't run, as where f3d isn't installed, leaves its earlier results.
Nothing else should run on the machine meanwhile.
"""

import argparse
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import scenes, tables, whole

HERE = Path(__file__).parent
QUICK = {"--frames": "3", "--seconds": "0.1", "--runs": "1", "--pairs": "1", "--rounds": "1", "--cold": "1"}
SMALL = {
    "throughput": ["--models", "4"],
    "paths": ["--scenes", "scan", "packed samples"],
    "refinement": ["--quads", "4", "8", "16", "--finest", "32"],
    "hard_cases": ["--small"],
    "whole": ["--models", "teapot", "layers"],
    "scale": ["--most", "1000"],
    "scale_many": ["--many", "100"],
}


def list_runs(scan: str, textured: str) -> dict[str, list[str]]:
    """List the command lines by the names of their results."""
    usual = ["teapot", "gear", "confetti", "dense", "quad-torus", "quads-front", "quads-back", "--sizes", "1080p"]
    usual += ["--cull", "back", "--threads", "1", "2", "--samples", "1", "4", "--channels", "mono", "rgb"]
    return {
        "frame": ["frame.py", scan, *usual, "--seconds", "0.4"],
        "tolerance": ["tolerance.py", "--seconds", "1"],
        "throughput": ["throughput.py"],
        "paths": ["paths.py", "--scan", scan],
        "choices": ["choices.py", "--seconds", "15", "--plot", "choices.png"],
        "refinement": ["refinement.py", "--seconds", "3"],
        "hard_cases": ["hard_cases.py"],
        "features": ["features.py", "--model", scan, "--seconds", "15"],
        "startup": ["startup.py", scan, "--runs", "11", "--cold", "2"],
        "whole": ["whole.py", "--models", "teapot", scan, *whole.MADE, "--runs", "5"],
        "viewer": ["viewer.py", scan],
        "encode": ["encode.py", "--seconds", "1"],
        "scale": ["scale.py", "--seconds", "1"],
        "scale_many": ["scale.py", "--many", "2000"],
        "peers": ["peers.py", "--model", scan, "--textured-model", textured, "--seconds", "2"],
    }


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    start, failed = perf_counter(), []
    models = (str(scenes.find_file(name).resolve()) for name in (args.scan, args.textured))
    runs = {name: command for name, command in list_runs(*models).items() if not args.only or name in args.only}
    for k, (name, command) in enumerate(runs.items(), 1):
        print(f"--- {k} of {len(runs)} after {(perf_counter() - start) / 60.0:.1f} minutes: {name}", flush=True)
        command = quickened(name, command) if args.quick else command
        print(f"python bench/{' '.join(command)}", flush=True)
        command = [str(args.into / word) if word.endswith(".png") else word for word in command]
        kept = ["--json", str(args.into / f"{name}.json")]
        done = subprocess.run([sys.executable, str(HERE / command[0]), *command[1:], *kept])
        failed += [name] if done.returncode else []
    written = 0 if args.into != tables.RESULTS else tables.main([])
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
    parser.add_argument("--into", type=Path, default=tables.RESULTS, metavar="FOLDER",
                        help="keep results there, and leave the pages alone")  # fmt: skip
    return parser


def parser_of(script: str) -> argparse.ArgumentParser:
    """The command line of a script."""
    return import_module(f"bench.{script.removesuffix('.py')}").main.make_parser()


def quickened(name: str, command: list[str]) -> list[str]:
    """A command line with the smallest settings, as far as the script has them; of two values the last one counts."""
    flags = parser_of(command[0]).format_help()
    few = [word for flag, value in QUICK.items() if flag in flags for word in (flag, value)]
    return [*command, *few, *SMALL.get(name, [])]


if __name__ == "__main__":
    sys.exit(main())
