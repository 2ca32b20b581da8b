"""Write tables of the pages from results/, so that no figure stands there that nobody has measured.

    python bench/tables.py                    write the tables anew
    python bench/tables.py --check            tell which ones are not what the results say

A table stands between two comments, `<!-- results/NAME.json: TABLE -->` and `<!-- end -->`. Scripts keep their results
with --json; measure_all.py runs all of them.
"""

import argparse
import json
import math
import re
import sys
from pathlib import Path

FOLDER = Path(__file__).parent

PAGES, RESULTS = (FOLDER / "README.md", FOLDER.parent / "README.md"), FOLDER / "results"
BUSY_SHARE = 0.05  # from which on measure.py warns
MARKED = re.compile(r"(<!-- results/([\w-]+)\.json: ([\w -]+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
USUAL, MACHINE = "frame", "machine"  # whose machine a page tells once; what stands in the place of a table then
SHADINGS = ("flat", "gouraud", "phong")
NAMES = {"flat": "flat", "gouraud": "Gouraud", "phong": "Phong"}
_SCENES = {
    "dense": "a sphere of {n} triangles", "quads-front": "32 quads as large as the picture, the nearest first",
}  # fmt: skip
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    is_wrong = False
    for path in PAGES:
        page = path.read_text(encoding="utf-8")
        for name, table in wrong_tables(page):
            is_wrong = True
            if args.check:
                print(f"results/{name}.json: {table} is not what {path.name} of {path.parent.name} says")
        if not args.check:
            path.write_text(fill(page), encoding="utf-8")
    return int(args.check and is_wrong)


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="change nothing; exit code 1 where a table is wrong")
    return parser


def load(name: str) -> dict:
    """Read what is kept of a script."""
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def fill(page: str) -> str:
    """Return a page with its tables as the results say."""
    return MARKED.sub(lambda found: found[1] + make_table(found[2], found[3]) + "\n" + found[5], page)


def wrong_tables(page: str) -> list[tuple[str, str]]:
    """The (file, table) of a page that are not what the results say."""
    return [(found[2], found[3]) for found in MARKED.finditer(page)
            if found[4] != make_table(found[2], found[3]) + "\n"]  # fmt: skip


def make_table(name: str, table: str) -> str:
    """Make a table as Markdown, with the machine that it was measured on where that isn't the usual one."""
    record = load(name)
    said = said_of(record["machine"])
    usual = said_of(load(USUAL)["machine"]) if (RESULTS / f"{USUAL}.json").exists() else None
    if table == MACHINE:
        return said
    return "\n".join([*TABLES[table](record["rows"]), *([] if said == usual else ["", said])])


def said_of(machine: dict) -> str:
    """A line about a machine."""
    others = machine.get("others") or 0.0
    busy = f" Other work took {100.0 * others:.0f} % of the cores meanwhile: milliseconds mean little."
    return (
        f"Measured on {machine['cores']} cores of {machine['cpu']}; Python {machine['python']}, "
        f"numpy {machine['numpy']}, numba {machine['numba']}.{busy if others > BUSY_SHARE else ''}"
    )


# ── rows of results as lines of Markdown ──────────────────────────────────────────────────────────────────


def lines_of(head, rows) -> list[str]:
    """Cells as lines of a Markdown table."""
    return [f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows)]


def figure(value, n_digit=2) -> str:
    """A number with a few digits, as people write it; nothing for None."""
    if value is None:
        return ""
    if value == 0.0:
        return "0"
    power = math.floor(math.log10(abs(float(f"{value:.{n_digit - 1}e}"))))
    if -3 <= power < 5:
        return f"{value:.{max(n_digit - 1 - power, 0)}f}"
    digits = f"{value / 10.0**power:.{n_digit - 1}f}"
    return f"{digits}·10{str(power).translate(_SUPERSCRIPTS)}"


def thousands(value) -> str:
    """A whole number, its thousands apart."""
    return f"{value:,}".replace(",", " ")


# ── a frame ───────────────────────────────────────────────────────────────────────────────────────────────


def frames(rows) -> list[str]:
    """A scene a row, a shading a column: milliseconds with one thread, what two gain, nanoseconds a covered pixel."""
    of = {(row["case"], row["shading"]): row for row in rows}
    shadings = [shading for shading in SHADINGS if any(row["shading"] == shading for row in rows)]
    found = []
    for case, n in {row["case"]: row["triangles"] for row in rows}.items():
        own = [of[case, shading] for shading in shadings]
        found.append([case, thousands(n), *(f"{figure(row['ms_1'], 3)} · {figure(row['gain'], 3)} · "
                                            f"{figure(row['ns_pixel'])}" for row in own)])  # fmt: skip
    return lines_of(["scene", "triangles", *(NAMES[shading] for shading in shadings)], found)


def frames_in_short(rows) -> list[str]:
    """A scene a row, a shading a column: milliseconds with one thread / with two."""
    of = {(row["case"], row["shading"]): row for row in rows}
    triangles = {row["case"]: row["triangles"] for row in rows if row["case"] != "quads-back"}
    found = []
    for case, n in triangles.items():
        cells = [of.get((case, shading)) for shading in SHADINGS]
        found.append([_SCENES.get(case, f"{case}, {{n}} triangles").format(n=thousands(n)),
                      *("" if row is None else " / ".join(figure(row[key], 3) for key in ("ms_1", "ms_2") if key in row)
                        for row in cells)])  # fmt: skip
    return lines_of(["scene", *(NAMES[shading] for shading in SHADINGS)], found)


def memory(rows) -> list[str]:
    """Peak memory of a process, and the steps to its first picture."""
    found = [[thousands(row["triangles"]), row["size"], NAMES[row["shading"]], figure(row["build_ms"], 3),
              figure(row["prepare_ms"], 3), figure(row["warm_ms"], 3), figure(row["peak_mib"], 4)]
             for row in rows]  # fmt: skip
    return lines_of(["triangles", "size", "shading", "build ms", "prepare ms", "frame ms", "peak MiB"], found)


# ── speed against error ───────────────────────────────────────────────────────────────────────────────────


def tolerances(rows) -> list[str]:
    """By tolerance: the time as a multiple of that of tolerance 0, the largest error, and the error over its bound."""
    names = list(dict.fromkeys(row["tolerance"] for row in rows))
    of = {(row["model"], row["shading"], row["tolerance"]): row for row in rows}
    found = []
    for model, shading in dict.fromkeys((row["model"], row["shading"]) for row in rows):
        own = [of[model, shading, name] for name in names]
        found.append([model, NAMES[shading], figure(own[0]["ms"], 3), figure(own[0]["max"]),
                      *(f"{figure(row['of_first'])} · {figure(row['max'])} · {figure(row['of_bound'])}"
                        for row in own[1:]), figure(own[0]["vertices"])])  # fmt: skip
    return lines_of(["model", "shading", "0: ms", "0: error", *names[1:], "1/256 px"], found)


def exactness(rows) -> list[str]:
    """The largest errors of one model by tolerance, and what becomes of 8-bit values."""
    rows = [row for row in rows if row["model"] == rows[0]["model"]]
    found = []
    for text in dict.fromkeys(row["tolerance"] for row in rows):
        same = {row["shading"]: row for row in rows if row["tolerance"] == text}
        over = sum(row["over_1"] for row in same.values())
        name = f"`tolerance={text}`" + (", the default" if text == "1/4096" else "")
        found.append([name, *(figure(same[shading]["max"], 1) for shading in SHADINGS), str(over or "none")])
    return lines_of(["", "flat", "Gouraud", "Phong", "8-bit values more than a level off"], found)


def methods(rows) -> list[str]:
    """Shadings and subdivisions with four samples a pixel, a model a column."""
    rows = [row for row in method_rows(rows) if row["samples"] == 4]
    of = {(row["model"], row["value"].partition(", 4 samples")[0]): row for row in rows}
    models, names = (list(dict.fromkeys(key[k] for key in of)) for k in range(2))
    cells = {
        key: f"{figure(row['ms'], 3)} · {figure(row['rms'])} · {figure(row['delta_e'])}" for key, row in of.items()
    }
    found = [[name, *(cells.get((model, name), "") for model in models)] for name in names]
    triangles = {row["model"]: thousands(row["triangles"]) for row in rows if not row["subdivisions"]}
    return lines_of(["method", *(f"{model}, {triangles[model]} triangles" for model in models)], found)


def samples(rows) -> list[str]:
    """Phong's shading with more and more samples a pixel: time and error as multiples of those of one."""
    of = {(row["model"], row["samples"]): row for row in method_rows(rows) if row["shading"] == "phong"}
    counts = sorted({n for _, n in of})
    found = []
    for model in dict.fromkeys(model for model, _ in of):
        one = of[model, 1]
        found.append([model, *(f"{figure(row['ms'] / one['ms'])} · {figure(row['rms'] / one['rms'])}"
                               for row in (of[model, n] for n in counts[1:]))])  # fmt: skip
    return lines_of(["model", *(f"{n} samples" for n in counts[1:])], found)


def method_rows(rows) -> list[dict]:
    """The rows of methods, of those of choices.json."""
    return [row for row in rows if row["what"] == "method"]


def axes(rows) -> list[str]:
    """One thing changed at a time, each of one scene: where rays tell what is right, else the first that has it."""
    rows = [row for row in rows if row["what"] not in ("method", "reflection")]
    scene_of = {}
    for row in rows:
        if row["what"] not in scene_of or row["against"].startswith("rays"):
            scene_of[row["what"]] = row["model"]
    found = []
    for what, scene in scene_of.items():
        own = [row for row in rows if (row["what"], row["model"]) == (what, scene)]
        cells = (f"{row['value']}: {figure(row['ratio'])}, {figure(row['rms'])}" for row in own)
        found.append([f"{what}, {scene}", " · ".join(cells), own[0]["against"]])
    return lines_of(["what", "value: time, error", "against"], found)


# ── refinement ────────────────────────────────────────────────────────────────────────────────────────────


def finer(rows) -> list[str]:
    """Gouraud's method on four times as many triangles, against Phong's: time and error as multiples."""
    of = {(row["surface"], row["shading"], row["triangles"]): row for row in rows}
    counts = sorted({row["triangles"] for row in rows if ("sphere", "gouraud", 4 * row["triangles"]) in of})
    surfaces = [name for name in dict.fromkeys(row["surface"] for row in rows) if name != "plane"]
    found = []
    for n in counts:
        cells = []
        for surface in surfaces:
            phong, gouraud = of[surface, "phong", n], of[surface, "gouraud", 4 * n]
            cells.append(f"{figure(gouraud['ms'] / phong['ms'])} · {figure(gouraud['rms'] / phong['rms'])}")
        found.append([f"{thousands(4 * n)} / {thousands(n)}", *cells])
    return lines_of(["triangles, Gouraud / Phong", *surfaces], found)


def hard_cases(rows) -> list[str]:
    """How the hard cases end, how many each path draws a part of, and how much of its bound the largest error takes."""
    found = []
    for name, is_one in (
        ("right", lambda row: row["result"] == "right" and not row["why"].startswith("A limit")),
        ("right, and a limit that the guide states", lambda row: row["result"] == "right"
         and row["why"].startswith("A limit")),
        ("right, but next to a step that `stats.steps` names", lambda row: row["result"].startswith("right, but")),
        ("refused, with the reason", lambda row: row["result"] == "refused"),
    ):  # fmt: skip
        own = [row for row in rows if is_one(row)]
        shares = [row["of_bound"] for row in own if row.get("of_bound") is not None and not row.get("is_at_step")]
        by_paths = [sum(path in row["path"] for row in own) for path in ("entries", "planes", "exact")]
        found.append([name, str(len(own)), *map(str, by_paths), figure(max(shares)) if shares else ""])
    columns = ["cases", "by entries", "by planes", "by exact records", "largest error / bound"]
    return lines_of(["what happens", *columns], found)


# ── features ──────────────────────────────────────────────────────────────────────────────────────────────


def features(rows) -> list[str]:
    """What each thing that a scene may use costs, in two columns of a table; float64 is told."""
    plain = next(row for row in rows if row.get("feature") == "plain")
    cells = [[row["feature"] + (", float64" if row["dtype"] == "float64" and row["feature"] != "float64" else ""),
              figure(row["ms"] / plain["ms"]), "" if row is plain else figure(row["ns_more"])]
             for row in rows if "feature" in row]  # fmt: skip
    half = (len(cells) + 1) // 2
    found = [[*cells[k], *(cells[half + k] if half + k < len(cells) else [""] * 3)] for k in range(half)]
    return lines_of(["feature", "of plain", "more ns/px"] * 2, found)


def buffers(rows) -> list[str]:
    """Outputs, as multiples of Gouraud's picture, with one thread."""
    rows = [row for row in rows if "outputs" in row]
    cases = list(dict.fromkeys(row["scene"] for row in rows))
    of = {(row["scene"], row["outputs"]): row for row in rows}
    outputs = [name for name in dict.fromkeys(row["outputs"] for row in rows) if name != "Gouraud"]
    found = [[case, *(figure(of[case, name]["ratio_1"]) for name in outputs)] for case in cases]
    return lines_of(["of Gouraud's picture", *outputs], found)


# ── peers, start-up, files ────────────────────────────────────────────────────────────────────────────────


def peers(rows) -> list[str]:
    """How many times as long other renderers take."""
    found = [
        [f"`{row['case']}`", thousands(row["triangles"]), row["peer"], f"{row['ms_ours']:.2f}",
         f"{row['ms_peer']:.2f}", f"{row['ratio']:.1f}", f"{row['ratio_of_cpu']:.1f}"]
        for row in rows if "peer" in row
    ]  # fmt: skip
    return lines_of(["case", "triangles", "peer", "ours, ms", "peer, ms", "peer/ours", "of CPU"], found)


def specks(rows) -> list[str]:
    """What a few pixels cost that need more than the others."""
    found = [row for row in rows if "speck" in row and row["speck"] != "plain"]
    names = list(dict.fromkeys(row["speck"] for row in found))
    ratio = {(row["shading"], row["speck"]): f"{row['ratio_of_cpu']:.2f}" for row in found}
    return lines_of(["", *names], [[NAMES[each], *(ratio.get((each, name), "") for name in names)]
                                   for each in SHADINGS[1:]])  # fmt: skip


def programs(rows) -> list[str]:
    """Whole processes."""
    found = [[f"`{row['program']}`", figure(row["ms"], 3), figure(row["yards"]), figure(row["peak_mib"], 3)]
             for row in rows if "program" in row]  # fmt: skip
    return lines_of(["program", "ms", "yards", "peak MiB"], found)


def writers(rows) -> list[str]:
    """Means of milliseconds and sizes of PNG files."""
    rows = [row for row in rows if row["case"] == "mean"]
    sizes = list(dict.fromkeys(row["size"] for row in rows))
    of = {(row["size"], row["writer"]): row for row in rows}
    found = [[writer, *(cell for size in sizes for cell in (figure(of[size, writer]["ms"]),
                                                            f"{of[size, writer]['share']:.2f}"))]
             for writer in dict.fromkeys(row["writer"] for row in rows)]  # fmt: skip
    return lines_of(["writer", *(cell for size in sizes for cell in (f"{size}: ms", "share"))], found)


# ── scale ─────────────────────────────────────────────────────────────────────────────────────────────────

_COSTS = {"build_ms": "build ms", "prepare_ms": "prepare ms", "cpu_ms": "frame ms", "mib": "MiB"}


def growth(rows) -> list[str]:
    """Each cost at the first and the last point of an axis, and with which power it grows."""
    found = []
    for row in rows:
        if "slopes" not in row:
            continue
        points = [each for each in rows if each.get("axis") == row["axis"] and "n" in each]
        first, last = points[0], points[-1]
        cells = []
        for key in _COSTS:
            slope = row["slopes"][key]
            cells.append(f"{figure(first[key])}, {figure(last[key])}" + ("" if slope is None else f" · {slope:.2f}"))
        found.append([row["axis"], f"{thousands(first['n'])}, {thousands(last['n'])}", *cells])
    return lines_of(["what grows", "from, to", *_COSTS.values()], found)


def held(rows) -> list[str]:
    """Memory after so many pictures."""
    return lines_of(["pictures", *(thousands(row["n"]) for row in rows)],
                    [["MiB held", *(f"{row['mib']:.1f}" for row in rows)]])  # fmt: skip


# ── processes and paths ───────────────────────────────────────────────────────────────────────────────────


def throughput(rows) -> list[str]:
    """How many pictures a second so many processes draw."""
    found = [[f"{row['processes']}", f"{row['seconds']:.2f}", f"{row['per_second']:.0f}", f"{row['gain']:.2f}"]
             for row in rows]  # fmt: skip
    return lines_of(["processes", "s", "pictures a second", "gain"], found)


def paths(rows) -> list[str]:
    """Times without a path that is there over those with it, a path a row and a scene a column."""
    of = {(row["path"], row["scene"]): row["ratio"] for row in rows if "(gone)" not in row["path"]}
    names, scenes = (list(dict.fromkeys(key[k] for key in of)) for k in range(2))
    found = [[name, *("" if (name, s) not in of else f"{of[name, s]:.2f}" for s in scenes)] for name in names]
    return lines_of(["without", *scenes], found)


def whole(rows) -> list[str]:
    """What a person waits for, beside f3d."""
    head = ["model", "ours, ms", "f3d, ms", "ours/f3d", "of CPU", "MiB", "of f3d's"]
    keys = ("ours_ms", "f3d_ms", "ratio", "cpu_ratio", "ours_mib", "mib_ratio")
    found = [[row["model"], *("" if row.get(key) is None else figure(row[key], 3) for key in keys)] for row in rows]
    return lines_of(head, found)


def viewer(rows) -> list[str]:
    """Pictures a second in a browser."""
    head = ["where", "look", "size while it moves", "pictures a second"]
    return lines_of(
        head, [[*(row[key] for key in ("where", "look", "moving")), figure(row["per_second"], 2)] for row in rows]
    )


TABLES = {
    "frames in short": frames_in_short, "frames": frames, "memory": memory, "exactness": exactness,
    "tolerances": tolerances, "methods": methods, "samples": samples, "one thing at a time": axes,
    "finer meshes": finer, "hard cases": hard_cases, "features": features, "buffers": buffers, "peers": peers,
    "specks": specks, "programs": programs, "writers": writers, "growth": growth, "held memory": held,
    "throughput": throughput, "paths": paths, "whole": whole, "viewer": viewer,
}  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
