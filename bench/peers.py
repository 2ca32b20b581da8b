"""How fast are other renderers of a CPU at the same work?

    python bench/peers.py                                       every peer that is installed, every case
    python bench/peers.py --model path/to/scan.obj --only llvmpipe --threads 2
    python bench/peers.py --cases textured textured-4 --save pictures
    python bench/peers.py --cases specks                        ours against ours: what a few pixels cost

Peers are Mesa's llvmpipe, Panda3D's tinydisplay and VTK; bench/README.md says how to install them. Two processes, one
of ours and one of a peer, draw the same frame in turns; only one of them works at a time. A frame is what happens
between the prepared scene and the array of bytes in memory. Pictures are compared, so that nobody compares different
work. Columns are explained in bench/README.md; the last line of the output is the same as JSON.
"""

import argparse
import ast
import sys
import tempfile
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import measure, peers_compare, scenes
from bench.peers_ours import SPECKS
from bench.peers_process import PEERS, THREAD_VARIABLES, Failure, Process, find_missing
from bench.peers_work import Setup, Work, make_work
from rasterizer import Options
from rasterizer.analysis.timing import MIN_ROUNDS

MODEL, TEXTURED = "torus-70k", "knot"  # meshes that --model and --textured-model take the place of


class Case(NamedTuple):
    """A picture that everybody draws."""

    mesh: str  # one of peers_work.MESHES, or a name of scenes.py
    size: str
    shading: str
    samples: int = 1
    is_textured: bool = False
    is_lit_per_sample: bool = False


CASES = {
    "textured": Case(TEXTURED, "1080p", "phong", is_textured=True),
    "textured-4": Case(TEXTURED, "1080p", "phong", samples=4, is_textured=True),
    "model-512-gouraud": Case(MODEL, "512", "gouraud"),
    "model-1080p-gouraud": Case(MODEL, "1080p", "gouraud"),
    "model-1080p-phong": Case(MODEL, "1080p", "phong"),
    "model-4k-gouraud": Case(MODEL, "4k", "gouraud"),
    "model-4k-phong": Case(MODEL, "4k", "phong"),
    "sphere-512-gouraud": Case("sphere-1.3M", "512", "gouraud"),
    "sphere-1080p-phong": Case("sphere-1.3M", "1080p", "phong"),
    "quads-gouraud": Case("quads-back", "1080p", "gouraud"),
    "quads-phong": Case("quads-back", "1080p", "phong"),
}
MORE_CASES = {  # drawn where they are asked for
    "textured-gouraud": Case(TEXTURED, "1080p", "gouraud", is_textured=True),
    "textured-4-each": Case(TEXTURED, "1080p", "phong", 4, is_textured=True, is_lit_per_sample=True),
    "model-1080p-flat": Case(MODEL, "1080p", "flat"),
    "model-1080p-phong-4": Case(MODEL, "1080p", "phong", samples=4),
}
SPECKLED = ("model-1080p-gouraud", "model-1080p-phong")
ALL_CASES = (*CASES, *MORE_CASES, "specks")


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    peers = [peer for peer in args.only if not report_missing(peer)]
    machine = measure.Machine()
    with tempfile.TemporaryDirectory() as folder:
        arrays = Path(folder, "work.npz")
        rows = list(measure_peers(args, peers, arrays))
        if "specks" in args.cases:
            rows += list(measure_specks(args, arrays))
    measure.print_json("peers", machine, args, rows)
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=PEERS, default=PEERS, metavar="PEER",
                        help=f"of {', '.join(PEERS)} (default: all)")  # fmt: skip
    parser.add_argument("--cases", nargs="+", choices=ALL_CASES, default=[*CASES, "specks"], metavar="CASE",
                        help=f"of {', '.join(ALL_CASES)} (default: all but {', '.join(MORE_CASES)})")  # fmt: skip
    parser.add_argument("--model", default=MODEL, help="a model file, drawn without its colours (default: %(default)s)")
    parser.add_argument("--textured-model", default=TEXTURED, metavar="MODEL",
                        help="a model file with texture coordinates (default: %(default)s)")  # fmt: skip
    parser.add_argument("--size", help="of all pictures instead of their own")
    parser.add_argument("--threads", type=int, default=Options().n_thread,
                        help="of everybody, each on so many cores (default: %(default)s)")  # fmt: skip
    parser.add_argument("--pairs", type=int, default=2, help="of processes, for each row (default: %(default)s)")
    parser.add_argument("--frames", type=int, default=40, help="most of a pair (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=3.0, help="time limit of a pair (default: %(default)s)")
    parser.add_argument("--option", action="append", default=[], type=read_option, metavar="NAME=VALUE",
                        help="another option of our Renderer, as tolerance=0; may be given several times")  # fmt: skip
    parser.add_argument("--save", type=Path, metavar="FOLDER",
                        help="write ours, the peer's and the difference times "
                        f"{peers_compare.AMPLIFIED}, side by side")  # fmt: skip
    measure.add_output(parser)
    return parser


def read_option(text: str) -> tuple[str, object]:
    """Read NAME=VALUE; what is no number is a word."""
    name, _, value = text.partition("=")
    try:
        return name, ast.literal_eval(value)
    except (SyntaxError, ValueError):
        return name, value


def report_missing(peer: str) -> bool:
    """Say that a peer is left out, where it isn't installed."""
    if missing := find_missing(peer):
        print(f"{peer} is left out: {missing}")
    return bool(missing)


def measure_peers(args, peers: list, arrays: Path):
    """Yield a row for every case and peer."""
    cases = {name: case for name, case in (CASES | MORE_CASES).items() if name in args.cases}
    if not (cases and peers):
        return
    print(f"everybody: {' = '.join(THREAD_VARIABLES)} = {args.threads}, on as many cores")
    table, versions = measure.Table(COLUMNS), {}
    for name, case in cases.items():
        work = work_of(case, args)
        work.save(arrays)
        for peer in peers:
            row = {"case": name, "triangles": len(work.faces), "peer": peer}
            try:
                row |= measure_peer(peer, arrays, work.setup, name, args)
            except Failure as failure:
                if failure.renderer != peer:
                    raise SystemExit(f"{name}: {failure}") from None
                print(f"{name}: {failure}")
                continue
            table.print(row)
            for warning in row["warnings"]:
                print(f"WARNING: {name}, {peer}: {warning}", file=sys.stderr, flush=True)
            versions[peer] = row["version"]
            yield row
    print("\n" + "\n".join(f"{peer}: {version}" for peer, version in versions.items()))


COLUMNS = [("case               ", "case", ""), ("triangles", "triangles", "d"), ("peer       ", "peer", ""),
           ("threads", "threads", "d"), ("   ours", "ms_ours", ".2f"), ("   peer", "ms_peer", ".2f"),
           ("peer/ours", "ratio", ".2f"), ("of best", "ratio_of_best", ".2f"), ("of CPU", "ratio_of_cpu", ".2f"),
           ("covered by ours", "covered", ".0f"), ("by peer", "covered_peer", ".0f"), ("max", "max", "d"),
           ("  rms", "rms", ".2f"), (">1 level", "over_one", ".2%"), ("differs in", "difference", "")]  # fmt: skip


def work_of(case: Case, args) -> Work:
    """Make what a case asks for, with the models, the size and the threads of the command line."""
    mesh = {MODEL: args.model, TEXTURED: args.textured_model}.get(case.mesh, case.mesh)
    setup = Setup(size=scenes.size_of(args.size or case.size), shading=case.shading, samples=case.samples,
                  is_lit_per_sample=case.is_lit_per_sample, threads=args.threads)  # fmt: skip
    return make_work(mesh, case.is_textured, setup)


def measure_peer(peer: str, arrays: Path, setup: Setup, name: str, args) -> dict:
    """Draw frames of ours and of a peer in turns; compare the last ones."""
    times = []
    for _ in range(args.pairs):
        with ExitStack() as stack:
            theirs = stack.enter_context(closing(Process(peer, arrays, setup)))
            ours = stack.enter_context(closing(Process("ours", arrays, theirs.setup, dict(args.option))))
            times += take_turns(ours, theirs, args)
            pictures = ours.picture(), theirs.picture()
    if args.save:
        args.save.mkdir(parents=True, exist_ok=True)
        peers_compare.save_sheet(args.save / f"{name}-{peer}.png", *pictures)
    found = peers_compare.compare(*pictures, theirs.setup)
    return {"size": "{}x{}".format(*setup.size), "shading": setup.shading, "samples": setup.samples,
            "threads": theirs.setup.threads, "cores": theirs.cores, **ratios(times, "ms_ours", "ms_peer"), **found,
            "difference": theirs.difference, "warnings": peers_compare.warnings_of(found),
            "version": theirs.version}  # fmt: skip


def measure_specks(args, arrays: Path):
    """Yield a row for each thing that a few pixels in a corner may be made of: ours with it against ours without."""
    table = measure.Table([("speck   ", "speck", ""), ("shading", "shading", ""), ("plain ms", "ms_plain", ".2f"),
                           (" with it", "ms_speck", ".2f"), ("ratio", "ratio", ".3f"),
                           ("of best", "ratio_of_best", ".3f"), ("of CPU", "ratio_of_cpu", ".3f")])  # fmt: skip
    for case in SPECKLED:
        work = work_of(CASES[case], args)
        work.save(arrays)
        for speck in SPECKS:
            times = []
            for _ in range(args.pairs):
                with ExitStack() as stack:
                    pair = [stack.enter_context(closing(Process("ours", arrays, replace(work.setup, speck=each),
                                                                dict(args.option))))
                            for each in ("plain", speck)]  # fmt: skip
                    times += take_turns(*pair, args)
            row = {"case": case, "speck": speck, "shading": work.setup.shading, "threads": args.threads}
            row |= ratios(times, "ms_plain", "ms_speck")
            table.print(row)
            yield row


def take_turns(first: Process, second: Process, args) -> list:
    """Draw frames of two processes in turns, within the limits of the command line; return what both answer."""
    times, start = [], perf_counter()
    while len(times) < MIN_ROUNDS or (len(times) < args.frames and perf_counter() - start < args.seconds):
        times.append((first.draw(), second.draw()))
    return times


def ratios(times: list, first: str, second: str) -> dict:
    """Medians of the milliseconds of two processes, and how many times as long as the first the second one takes."""
    wall, cpu = np.moveaxis(times, 2, 0)  # (n_frame, 2) each
    (first_ms, second_ms), best = np.median(wall, axis=0), wall.min(axis=0)
    return {first: float(first_ms), second: float(second_ms), "ratio": float(np.median(wall[:, 1] / wall[:, 0])),
            "ratio_of_best": float(best[1] / best[0]), "ratio_of_cpu": float(np.median(cpu[:, 1] / cpu[:, 0])),
            "n_frame": len(times), "spread": max(map(measure.spread, wall.T))}  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
