"""What has become slower since an earlier version?

    python bench/history.py                            the last line beside the one before, and beside the best
    python bench/history.py --add --note TEXT          measure, and add a line
    python bench/history.py --plot history.png         all lines (matplotlib)

A line of history.jsonl holds, for each case, the median of a frame's time over that of the yardstick (measure.py),
which takes turns with the frames; one thread. Lines are compared where their processors are the same. The exit code is
1 where a case is slower than in the line before by more than SLOWER.
"""

import argparse
import datetime
import json
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import measure, scenes
from rasterizer import Renderer
from rasterizer.analysis.speed_error_plot import check_plotting, figure_bytes
from rasterizer.analysis.timing import take_turns

HISTORY = Path(__file__).with_name("history.jsonl")
SLOWER = 1.08  # ratios of one version differ by less on an idle machine
CASES = {  # name: scene, size, options
    "teapot flat": ("teapot", (640, 480), {"shading": "flat"}),
    "teapot Gouraud": ("teapot", (640, 480), {"shading": "gouraud"}),
    "teapot Phong": ("teapot", (640, 480), {"shading": "phong"}),
    "teapot Phong, 4 samples": ("teapot", (640, 480), {"shading": "phong", "samples": 4}),
    "teapot Phong, tolerance 0": ("teapot", (640, 480), {"shading": "phong", "tolerance": 0.0}),
    "globe, trilinear texture": ("globe", (640, 480), {"shading": "phong"}),
    "still life": ("still_life", (640, 480), {"shading": "gouraud"}),
    "dense Gouraud 1080p": ("dense", (1920, 1080), {"shading": "gouraud", "cull": "back"}),
    "dense Phong 1080p": ("dense", (1920, 1080), {"shading": "phong", "cull": "back"}),
    "32 quads Phong 1080p": ("quads-back", (1920, 1080), {"shading": "phong"}),
    "teapot depth": ("teapot", (640, 480), {"outputs": ("depth",)}),
}


COLUMNS = [
    ("case" + " " * 26, "case", ""), ("yards", "yards", ".3f"), ("to before", "to_before", ".2f"),
    ("to best", "to_best", ".2f"),
]  # fmt: skip


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    path, lines = Path(args.file), read_history(Path(args.file))
    if args.add:
        machine = measure.Machine()
        ratios = measure_cases(args)
        lines.append(make_line(machine.finish(), ratios, args.note))
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(lines[-1]) + "\n")
    measure.write_plot(args.plot, plot, lines)
    if not lines:
        print(f"{path} has no lines yet; --add measures")
        return 0
    slower = report(lines)
    for name, ratio in slower:
        print(f"slower: {name}, {ratio:.2f} times the line before")
    return int(bool(slower))


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--add", action="store_true", help="measure, and add a line")
    parser.add_argument("--note", default="", metavar="TEXT", help="what is said of the new line")
    parser.add_argument("--file", default=HISTORY, help="default: %(default)s")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw all lines (matplotlib)")
    parser.add_argument(
        "--cases", nargs="+", default=list(CASES), choices=list(CASES), metavar="CASE", help="some cases alone"
    )
    parser.add_argument("--frames", type=int, default=40, help="most warm frames of each case (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=40.0, help="time limit of all (default: %(default)s)")
    return parser


def read_history(path: Path) -> list[dict]:
    """Return the lines of a file, the oldest first."""
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    return [json.loads(line) for line in text.splitlines() if line.strip()]


def measure_cases(args) -> dict[str, float]:
    """Return each case's time as a multiple of the yardstick's."""
    with ExitStack() as stack:
        calls = {"yardstick": measure.yardstick}
        for name in args.cases:
            scene, size, options = CASES[name]
            channels = "own" if scene in ("globe", "still_life") else "mono"
            settings = {"outputs": ("rgb",), "threads": 1} | options
            renderer = stack.enter_context(
                Renderer(scenes.build(scene, size, "one", channels), size, **{"samples": 1} | settings)
            )
            renderer.render()  # compiles and allocates
            calls[name] = renderer.render
        turns = take_turns(calls, args.seconds, args.frames)
    yard = turns["yardstick"][0]
    return {name: round(float(np.median(turns[name][0] / yard)), 4) for name in args.cases}


def make_line(machine, ratios, note) -> dict:
    """A line of the history."""
    today = datetime.date.today().isoformat()
    head = {"date": today, "version": machine["rasterizer"], "commit": commit(), "note": note}
    return head | {"machine": machine, "ratios": ratios}


def commit() -> str | None:
    """The commit of this checkout, with a + where it was changed; None outside of one."""
    folder = Path(__file__).parent
    try:
        done = subprocess.run(["git", "describe", "--always", "--dirty=+"], cwd=folder, capture_output=True, text=True)
    except OSError:
        return None
    return done.stdout.strip() or None


def comparable(lines) -> list[dict]:
    """The lines of the processor that the last one has."""
    return [line for line in lines if line["machine"]["cpu"] == lines[-1]["machine"]["cpu"]]


def report(lines) -> list[tuple[str, float]]:
    """Print the last line beside the one before and the best one; return what is slower than before."""
    same = comparable(lines)
    last, before = same[-1], same[-2] if len(same) > 1 else None
    print(f"{last['date']} {last['version']} {last['commit'] or ''} {last['note']}".rstrip())
    table = measure.Table(COLUMNS)
    slower = []
    for name, yards in last["ratios"].items():
        others = [line["ratios"][name] for line in same if name in line["ratios"]]
        row = {"case": name, "yards": yards, "to_best": yards / min(others)}
        if before is not None and name in before["ratios"]:
            row["to_before"] = yards / before["ratios"][name]
            slower += [(name, row["to_before"])] if row["to_before"] > SLOWER else []
        table.print(row)
    return slower


def plot(lines, suffix) -> bytes:
    """Plot each case over the lines that can be compared, as multiples of its first."""
    check_plotting()
    from matplotlib.figure import Figure

    same = comparable(lines)
    figure = Figure(figsize=(9.0, 5.5), layout="constrained")
    axes = figure.add_subplot()
    for name in dict.fromkeys(name for line in same for name in line["ratios"]):
        points = [(k, line["ratios"][name]) for k, line in enumerate(same) if name in line["ratios"]]
        axes.plot([k for k, _ in points], [ratio / points[0][1] for _, ratio in points], "o-", label=name)
    axes.set_xticks(
        range(len(same)), [f"{line['date']}\n{line['commit'] or line['version']}" for line in same], fontsize=8
    )
    axes.set_ylabel("time, as a multiple of the first line")
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.25)
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure_bytes(figure, suffix)


if __name__ == "__main__":
    sys.exit(main())
