"""Does any scene break a promise? Random scenes by the thousand, for hours, and uphill from the worst of them.

    python bench/fuzz.py                              a million scenes; end it when you like, the same line goes on
    python bench/fuzz.py --cases 5000 --seed 3 --processes 1
    python bench/fuzz.py --report                     what has been found so far

The scenes and the promises are those of tests/helpers/campaign.py: every light, material, texture, camera, unit,
tolerance; finite colours, coverage and order as the reference's, errors within their bounds, the same bytes with two
threads. Each batch of scenes is a line of JSON in the state file. From the scenes of a batch whose errors come nearest
to their bounds, numbers are changed step by step towards a larger error. A fault tells how to see it again; it becomes
a test. The exit code is 1 where there are faults.
"""

import argparse
import json
import multiprocessing
import os
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from pathlib import Path
from time import perf_counter

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]  # a checkout need not be installed
from rasterizer.cores import n_core

BATCH = 250  # scenes, some seconds


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    path = Path(args.state)
    done = read_state(path, args.seed)
    starts = [] if args.report else [start for start in range(0, args.cases, args.batch) if start not in done]
    tasks = [(args.seed, start, min(start + args.batch, args.cases), args.climbs, args.steps) for start in starts]
    with ProcessPoolExecutor(args.processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        for record in (map if args.processes == 1 else pool.map)(run_batch, tasks):
            done[record["first"]] = record
            with path.open("a", encoding="utf-8") as file:
                file.write(f"\n{json.dumps(record)}")  # whatever was cut off is a line of its own
            print(f"[{len(done)}/{-(-args.cases // args.batch)}] {summary([record])}", flush=True)
    print(summary(done.values()) if done else "nothing is done yet")
    return int(any(record["faults"] for record in done.values()))


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--cases", type=int, default=1_000_000, help="scenes in all (default: %(default)s)")
    add("--batch", type=int, default=BATCH, help="scenes between two lines (default: %(default)s)")
    add("--seed", type=int, default=1, help="another one makes other scenes (default: %(default)s)")
    add("--climbs", type=int, default=2, help="scenes of a batch to climb from (default: %(default)s)")
    add("--steps", type=int, default=40, help="steps of a climb (default: %(default)s)")
    add("--processes", type=int, default=n_core(), help="default: a core each")
    add("--state", default="fuzz.jsonl", metavar="FILE", help="what is done (default: %(default)s)")
    add("--report", action="store_true", help="print what the state file holds, and end")
    return parser


def read_state(path: Path, seed: int) -> dict[int, dict]:
    """Return the batches of a seed that are done, by their first scene; a line that was cut off is no batch."""
    done = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        with suppress(json.JSONDecodeError):
            record = json.loads(line)
            if record["seed"] == seed:
                done[record["first"]] = record
    return done


def run_batch(task) -> dict:
    """Draw the scenes of a batch, climb from the worst ones, and return what was found."""
    from helpers.campaign import climb, find_faults, report
    from helpers.campaign_scenes import make_case

    seed, first, stop, n_climb, n_step = task
    start, faults, heights, n_compared = perf_counter(), [], [], 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for index in range(first, stop):
            case = make_case(seed, index)
            outcome = find_faults(case)
            n_compared += outcome.n_compared
            heights.append((outcome.ratio, index))
            if outcome.faults:
                faults.append(report(case, outcome))
        tops = sorted((height for height in heights if height[0] < 1.0), reverse=True)[:n_climb]
        climbed = []
        for _, index in tops:
            case, outcome = climb(make_case(seed, index), n_step)
            climbed.append(min(outcome.ratio, 1e9))
            if outcome.faults:
                faults.append(report(case, outcome, f" {index + 1} {n_step}"))
    worst = max(heights)
    return {"seed": seed, "first": first, "stop": stop, "faults": faults, "pixels": n_compared,
            "worst": [min(worst[0], 1e9), worst[1]], "climbed": max(climbed, default=0.0),
            "seconds": round(perf_counter() - start, 1)}  # fmt: skip


def summary(records) -> str:
    """What some batches have found."""
    records = list(records)
    faults = [fault for record in records for fault in record["faults"]]
    worst, scene = max(record["worst"] for record in records)
    line = (
        f"{sum(record['stop'] - record['first'] for record in records)} scenes up to number {records[-1]['stop'] - 1}, "
        f"{sum(record['pixels'] for record in records)} pixels compared, "
        f"{sum(record['seconds'] for record in records):.0f} seconds of a core; error/bound <= {worst:.3g} (scene "
        f"{scene}), uphill <= {max(record['climbed'] for record in records):.3g}; {len(faults)} faults"
    )
    return "\n".join([line, *faults])


if __name__ == "__main__":
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")
    sys.exit(main())
