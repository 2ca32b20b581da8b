"""How all scripts here measure: in turns, by medians, on a machine they describe; one row after the other.

script      a command line: rows are printed as they come, and kept with --json
medians     pictures of this process take turns
compare     two processes draw the same frames in turns (worker.py)
Launcher    programs take turns, a process each (launch.py)
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # a checkout need not be installed
import rasterizer as rz
from rasterizer.analysis.timing import describe_machine, take_turns

HERE = ROOT / "bench"
BUSY_LOAD = 0.3  # load average from which on somebody else is computing
BUSY_SHARE = 0.05  # likewise, their part of all cores while we measure
SHADINGS = ("flat", "gouraud", "phong")


class MissingError(Exception):
    """What a script compares with isn't there; the message says what."""


# ── a script ──────────────────────────────────────────────────────────────────────────────────────────────


def script(name, doc, add_arguments, measure_rows):
    """Make the `main` of a script.

    Parameters
    ----------
    name : of the script, and of its results
    doc : what --help says
    add_arguments : function that is given the parser
    measure_rows : function of the arguments that yields rows, dicts of figures and words. A row with `faults` that
        aren't empty makes the exit code 1
    """

    def make_parser() -> argparse.ArgumentParser:
        parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
        add_arguments(parser)
        parser.add_argument("--json", type=Path, metavar="FILE", help="keep the results, as those in bench/results/")
        return parser

    def main(argv=None) -> int:
        args = make_parser().parse_args(argv)
        machine, code, rows, table = Machine(), code_hash(), [], Table()
        try:
            for row in measure_rows(args):
                table.print(row)
                rows.append(row)
        except MissingError as why:
            print(f"not measured: {why}")
            return 1
        settings = {key: value for key, value in vars(args).items() if key != "json"}
        record = {"bench": name, "machine": machine.finish(), "code": code, "settings": settings, "rows": rows}
        text = json.dumps(record, default=str)
        print(text)
        if args.json:
            keep(json.loads(text), args.json)
        return int(any(row.get("faults") for row in rows))

    main.make_parser = make_parser
    return main


class Table:
    """Print rows as they come, under a new head wherever their keys change."""

    def __init__(self):
        self._widths = {}

    def print(self, row: dict) -> None:
        """Print one row; what holds more than a figure or a word is left out."""
        cells = {key: as_text(value) for key, value in row.items() if not isinstance(value, (dict, list, tuple))}
        if not cells.keys() <= self._widths.keys():
            self._widths = {key: max(len(key), len(text), 8) for key, text in cells.items()}
            print("\n" + "  ".join(key.ljust(width) for key, width in self._widths.items()))
        print("  ".join(cells.get(key, "").ljust(width) for key, width in self._widths.items()), flush=True)


def as_text(value) -> str:
    """A figure or a word, as a cell."""
    return "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)[:40]


def code_hash() -> str:
    """What tells one state of the package's code from another."""
    found = hashlib.sha256()
    for path in sorted((ROOT / "rasterizer").rglob("*.py")):
        found.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes().replace(b"\r\n", b"\n"))
    return found.hexdigest()[:12]


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


# ── the machine ───────────────────────────────────────────────────────────────────────────────────────────


class Machine:
    """Print and hold what `describe_machine` finds; tell before and after measuring whether other work is running."""

    def __init__(self):
        self.found = describe_machine()
        print(", ".join(f"{key} {value}" for key, value in self.found.items() if key != "load"))
        if (self.found["load"] or 0.0) > BUSY_LOAD:
            _warn(f"load average {self.found['load']}")
        self._start = _busy_seconds()

    def finish(self) -> dict:
        """Warn if others have computed meanwhile; return what was found, with their share of the cores."""
        stop, share = _busy_seconds(), None
        if self._start is not None and stop[2] > self._start[2]:
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


def memory_mib(word="VmHWM") -> float | None:
    """MiB that this process holds at most (VmHWM) or now (VmRSS); None where the system does not tell.

    Not by getrusage: Linux counts there what the parent held when it started this process.
    """
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith(word)), None)


# ── calls of this process ─────────────────────────────────────────────────────────────────────────────────


def spread(times) -> float:
    """Distance of the quartiles as a part of the median: how restless the machine was."""
    low, middle, high = np.percentile(times, (25, 50, 75))
    return float((high - low) / middle)


def medians(pictures: dict, seconds: float, max_rounds: int) -> dict[str, float]:
    """Draw pictures in turns; return the median milliseconds of each by name.

    Parameters
    ----------
    pictures : name -> (scene, size, options of a Renderer)
    seconds, max_rounds : limits of all together
    """
    with ExitStack() as stack:
        calls = {name: warm(stack, *picture).render for name, picture in pictures.items()}
        turns = take_turns(calls, seconds, max_rounds)
    return {name: float(np.median(times)) for name, (times, _) in turns.items()}


def warm(stack: ExitStack, scene, size, options) -> rz.Renderer:
    """Return a Renderer that has drawn once: kernels are compiled, memory is there. It is closed with the stack."""
    options = {"samples": 1, "threads": 1, "outputs": ("rgb",)} | options
    renderer = stack.enter_context(rz.Renderer(scene, size, **options))
    renderer.render()
    return renderer


# ── scripts that are asked ────────────────────────────────────────────────────────────────────────────────


class Helper:
    """A script in a process of its own, which answers lines with lines of JSON until its input ends."""

    def __init__(self, *command: str):
        self._process = subprocess.Popen(
            [sys.executable, *command], text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()


# ── two processes that draw ───────────────────────────────────────────────────────────────────────────────


class Worker(Helper):
    """A process that draws frames of works whenever it is asked to; worker.py says what a work is."""

    def __init__(self, works: list[dict], folder: Path = ROOT, painter="ours"):
        super().__init__(str(HERE / "worker.py"), str(folder), painter, json.dumps(works, default=str))
        self._name = painter if folder == ROOT else f"the package in {folder}"

    def hear(self) -> dict:
        """The next answer; the first one comes when every work has been drawn once."""
        line = self._process.stdout.readline()
        answer = json.loads(line) if line else {"failure": f"exit code {self._process.wait()}"}
        if "failure" in answer:
            raise MissingError(f"{self._name} can't draw it: {answer['failure']}")
        return answer

    def ask(self, k: int, save="") -> dict:
        """Draw work number k; return its `ms`, `cpu_ms` and `digest`. Its arrays are saved in a file, if one is
        named."""
        print(k, save, file=self._process.stdin, flush=True)
        return self.hear()


def compare(works: list[dict], first: dict, second: dict, args, other_works=None, has_pictures=False):
    """Draw frames by two processes in turns; only one of them works at a time.

    Parameters
    ----------
    works : what is drawn, one after the other
    first, second : keywords of both `Worker`s
    args : `pairs` of new processes, and the `frames` and `seconds` of each work in each pair
    other_works : what the second one draws, where that isn't the same
    has_pictures : whether the arrays of both pictures are wanted

    Yields of each work what `ratios_of` returns, and the `version` of the second; with pictures, also `pictures`: two
    dicts of `rgba`, and our `depth`
    """
    answers, pictures = [([], []) for _ in works], [{} for _ in works]
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(args.pairs):
            with Worker(works, **first) as one, Worker(other_works or works, **second) as other:
                _, about = one.hear(), other.hear()
                for k, found in enumerate(answers):
                    calls = {of: lambda of=of, k=k: SimpleNamespace(stats=of.ask(k)) for of in (one, other)}
                    turns = take_turns(calls, args.seconds, args.frames)
                    for answer, of in zip(found, (one, other), strict=True):
                        answer += turns[of][1]
                    if has_pictures:
                        files = [Path(folder, f"{name}.npz") for name in ("one", "other")]
                        one.ask(k, files[0]), other.ask(k, files[1])
                        pictures[k] = {"pictures": [dict(np.load(file)) for file in files]}
    for found, pair in zip(answers, pictures, strict=True):
        yield about | ratios_of(*found) | pair


def ratios_of(first: list[dict], second: list[dict]) -> dict:
    """Medians of the milliseconds of two processes, of the ratios of neighbouring frames, and whether bytes differ."""
    (ms, others), (cpu, other_cpu) = ([np.array([each[key] for each in one]) for one in (first, second)]
                                      for key in ("ms", "cpu_ms"))  # fmt: skip
    is_same = [each["digest"] for each in first] == [each["digest"] for each in second]
    return {"ms_first": float(np.median(ms)), "ms_second": float(np.median(others)),
            "ratio": float(np.median(others / ms)), "ratio_of_best": float(others.min() / ms.min()),
            "ratio_of_cpu": float(np.median(other_cpu / np.maximum(cpu, 1e-6))), "n_frame": len(ms),
            "bytes": "same" if is_same else "differ"}  # fmt: skip


def add_turns(parser, frames, pairs=1, seconds=4.0) -> None:
    """Put on a command line what `compare` needs to know."""
    add = parser.add_argument
    add("--pairs", type=int, default=pairs, help="of new processes (default: %(default)s)")
    add("--frames", type=int, default=frames, help="most of a picture in each pair (default: %(default)s)")
    add("--seconds", type=float, default=seconds, help="time limit of a picture (default: %(default)s)")
    add("--threads", type=int, default=1)


# ── programs ──────────────────────────────────────────────────────────────────────────────────────────────

RASTER = [sys.executable, "-c", "import sys; from rasterizer.cli import main; sys.exit(main())"]  # as pip installs it


class Launcher(Helper):
    """Run programs by launch.py."""

    def __init__(self):
        super().__init__("-S", str(HERE / "launch.py"))

    def run(self, command: list, **environment) -> dict:
        """Run a program; return its `ms`, `cpu_ms` and `peak_mib`."""
        environment = os.environ | {"PYTHONPATH": str(ROOT)} | environment
        print(json.dumps([command, environment]), file=self._process.stdin, flush=True)
        found = json.loads(self._process.stdout.readline())
        if found["code"]:
            raise MissingError(f"{command} failed with exit code {found['code']}:\n{found['output']}")
        return found

    def run_turns(self, programs: dict, n_run: int) -> dict:
        """Run programs in turns, once more than `n_run` times; return of each name and figure an array of `n_run`.

        The first turn may still compile, or read files that nobody has read before.
        """
        turns = [{name: self.run(command) for name, command in programs.items()} for _ in range(1 + n_run)][1:]
        return {name: {key: np.array([turn[name][key] for turn in turns], float)
                       for key in ("ms", "cpu_ms", "peak_mib")} for name in programs}  # fmt: skip
