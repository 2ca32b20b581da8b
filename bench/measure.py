"""How the scripts here measure: in turns, with the median, beside a yardstick, on a machine they describe."""

import argparse
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from rasterizer.analysis.timing import describe_machine

try:
    import resource
except ImportError:  # Windows
    resource = None

BUSY_LOAD = 0.3  # load average from which on somebody else is computing
BUSY_SHARE = 0.05  # likewise, their part of all cores while we measure


class Machine:
    """Print and hold what `describe_machine` finds; tell before and after measuring whether other work is running."""

    def __init__(self):
        self.found = describe_machine()
        print(", ".join(f"{key} {value}" for key, value in self.found.items() if key != "load"))
        load = self.found["load"]
        if load is not None and load > BUSY_LOAD:
            _warn(f"load average {load}")
        self._start = _busy_seconds()

    def finish(self) -> dict:
        """Warn if others have computed meanwhile; return what was found, with their share of the cores."""
        stop, share = _busy_seconds(), None
        if self._start is not None and stop is not None and stop[2] > self._start[2]:
            all_, ours, total = (after - before for before, after in zip(self._start, stop, strict=True))
            share = round(max(0.0, all_ - ours) / total, 3)
            if share > BUSY_SHARE:
                _warn(f"other processes took {share:.0%} of all cores meanwhile")
        return self.found | {"others": share}


def _warn(what: str) -> None:
    print(f"WARNING: {what}: other work is running, so trust ratios only", file=sys.stderr, flush=True)


def _busy_seconds() -> tuple[float, float, float] | None:
    """Seconds of processor time: all spent, spent by us, available; None where the system does not tell."""
    try:
        ticks = [int(field) for field in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]
    except (OSError, ValueError):
        return None
    total, idle = sum(ticks), ticks[3] + ticks[4]  # user nice system idle iowait irq softirq steal
    ours = sum(os.times()[:4])
    return (total - idle) / os.sysconf("SC_CLK_TCK"), ours, total / os.sysconf("SC_CLK_TCK")


def yardstick() -> None:
    """Do a fixed piece of work on one core: what a frame is compared with, measured in the same turns.

    A running sum profits neither from vector units nor from threads: its time follows the clock of the core.
    """
    np.cumsum(_YARD, out=_YARD_SUM)


_YARD = np.full(2**20, 0.5)
_YARD_SUM = np.empty_like(_YARD)


def spread(times: np.ndarray) -> float:
    """Distance of the quartiles as a part of the median: how restless the machine was."""
    low, middle, high = np.percentile(times, (25, 50, 75))
    return float((high - low) / middle)


def peak_mib() -> float | None:
    """Largest memory that this process has held, in MiB; None where the system does not tell."""
    try:
        # Not getrusage here: Linux counts what the parent held when it started this process.
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM"):
                return int(line.split()[1]) / 1024
    except OSError:
        pass
    if resource is None:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


def probe(*arguments, cache: str | None = None) -> dict:
    """Run probe.py in a process of its own, compiled kernels kept in the folder given; return its findings."""
    environment = os.environ | ({"RASTER_STORE": cache} if cache else {})
    command = [sys.executable, str(Path(__file__).with_name("probe.py")), *map(str, arguments)]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


class Table:
    """Print rows as they come, in columns as wide as their titles.

    columns : list of (title, key, format); a title is padded to the width wanted, text stands on the left
    """

    def __init__(self, columns):
        self.columns = columns
        print("\n" + "  ".join(title for title, _, _ in columns))
        print("  ".join("-" * len(title) for title, _, _ in columns))

    def print(self, row: dict) -> None:
        """Print one row; what it lacks, or has as None, is a dash."""
        cells = []
        for title, key, form in self.columns:
            value = row.get(key)
            text = "-" if value is None else format(value, form)
            cells.append(text.ljust(len(title)) if isinstance(value, str) else text.rjust(len(title)))
        print("  ".join(cells), flush=True)


def add_output(parser: argparse.ArgumentParser, plot: str = "") -> None:
    """Put on a command line where results are kept, and where a plot is written of what `plot` says."""
    parser.add_argument("--json", type=Path, metavar="FILE", help="keep the results, as those in bench/results/")
    if plot:
        parser.add_argument("--plot", type=Path, metavar="FILE", help=f"draw {plot} (matplotlib)")


def print_json(bench: str, machine: Machine, args, rows: list) -> None:
    """Print everything once more as one line of JSON, the last line of the output; keep it where --json says."""
    settings = {name: value for name, value in vars(args).items() if name not in ("json", "plot")}
    record = {
        "bench": bench,
        "machine": machine.finish(),
        "settings": settings,
        "rows": rows,
        "peak_mib": peak_mib(),
    }
    text = json.dumps(record, default=str)
    print(text)
    if getattr(args, "json", None):
        keep(json.loads(text), args.json)


def keep(record: dict, path: Path) -> None:
    """Write a record into a file, a row a line; files are named without their folders."""
    record = without_folders(record)
    rows = ",\n  ".join(json.dumps(row) for row in record.pop("rows"))
    head = ",\n ".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in record.items())
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'{{{head},\n "rows": [\n  {rows}\n ]}}\n', encoding="utf-8")


def without_folders(value):
    """Return a value with absolute paths as names alone."""
    if isinstance(value, dict):
        return {key: without_folders(each) for key, each in value.items()}
    if isinstance(value, list):
        return [without_folders(each) for each in value]
    return os.path.basename(value) if isinstance(value, str) and os.path.isabs(value) else value


def write_plot(path: Path | None, plot, rows: list) -> None:
    """Write what `plot(rows, suffix)` draws where --plot says, a PNG file in 64 colours."""
    if path is None:
        return
    drawn = plot(rows, path.suffix)
    if path.suffix == ".png":
        picture, written = Image.open(io.BytesIO(drawn)).convert("RGB"), io.BytesIO()
        picture.quantize(64).save(written, "PNG", optimize=True)
        drawn = written.getvalue()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(drawn)
