"""Write tables and figures of the pages from results/, so that none stands there that nobody has measured.

    python bench/tables.py                    write them anew
    python bench/tables.py --check            tell which ones are not what the results say, and which results are older
                                              than the package's code, and what measures them

A table stands between two comments, `<!-- results/NAME.json: TABLE -->` and `<!-- end -->`. The figures of sentences
are those of SENTENCES. Scripts keep their results with --json; measure_all.py runs all of them.
"""

import argparse
import json
import math
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import measure
from bench.measure import BUSY_SHARE, HERE, ROOT, SHADINGS

PAGES, RESULTS = (HERE / "README.md", ROOT / "README.md", ROOT / "rasterizer" / "README.md"), HERE / "results"
MARKED = re.compile(r"(<!-- results/([\w-]+)\.json: ([\w -]+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
USUAL, MACHINE = "frame", "machine"  # whose machine a page tells once; what stands in the place of a table then
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
        filled, wrong = fill(page, path.relative_to(ROOT).as_posix())
        if not args.check and filled != page:
            path.write_text(filled, encoding="utf-8")
        for what in wrong:
            is_left = args.check or "doesn't say" in what
            print(f"{path.relative_to(ROOT)}: {what}" + ("" if is_left else "; written anew"))
            is_wrong |= is_left
    if old := list_old():
        print("older than the code that they measure:", *(f"    {name}: {why}" for name, why in old.items()), sep="\n")
        print(f"measure them again: python bench/measure_all.py --only {' '.join(old)}")
    return int(is_wrong)


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="change nothing; exit code 1 where a figure is wrong")
    return parser


def load(name: str) -> dict:
    """Read what is kept of a script."""
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def list_old() -> dict[str, str]:
    """Name the results that other code was measured for, and say with which version."""
    code, records = measure.code_hash(), {path.stem: load(path.stem) for path in sorted(RESULTS.glob("*.json"))}
    return {name: f"version {record['machine']['rasterizer']}, {record.get('code', 'of unknown code')}"
            for name, record in records.items() if record.get("code") != code}  # fmt: skip


def fill(page: str, name: str) -> tuple[str, list[str]]:
    """Return a page with its tables and figures as the results say, and what was wrong with it."""
    wrong = []

    def table(found) -> str:
        made = make_table(found[2], found[3]) + "\n"
        if made != found[4]:
            wrong.append(f"the table '{found[3]}' isn't what results/{found[2]}.json says")
        return found[1] + made + found[5]

    page = MARKED.sub(table, page)
    for where, text, figures in SENTENCES:
        if where != name:
            continue
        pattern = re.escape(text).replace("\\ ", r"\s+").replace(r"\{\}", r"(-?\d+(?:\.\d+)?)")
        found = re.search(pattern, page)
        if found is None:
            wrong.append(f"it doesn't say {text!r}")
            continue
        figures = figures()
        if list(found.groups()) != figures:
            wrong.append(f"{found[0]!r} isn't what the results say: {', '.join(figures)}")
        for k in range(len(figures), 0, -1):
            page = page[: found.start(k)] + figures[k - 1] + page[found.end(k) :]
    return page, wrong


def make_table(name: str, table: str) -> str:
    """Make a table as Markdown, with the machine that it was measured on where that isn't the usual one."""
    record = load(name)
    said, usual = said_of(record["machine"]), said_of(load(USUAL)["machine"])
    if table == MACHINE:
        return said
    return "\n".join([*TABLES[table](record["rows"]), *([] if said == usual else ["", said])])


def said_of(machine: dict) -> str:
    """A line about a machine."""
    others = machine.get("others") or 0.0
    busy = f" Other work took {100.0 * others:.0f} % of the cores meanwhile: milliseconds mean little."
    return (
        f"Measured with version {machine['rasterizer']} on {machine['cores']} cores of {machine['cpu']}; "
        f"Python {machine['python']}, numpy {machine['numpy']}, numba {machine['numba']}."
        f"{busy if others > BUSY_SHARE else ''}"
    )


# ── figures that stand in sentences ───────────────────────────────────────────────────────────────────────


def column(name, key="ratio", **wanted) -> list[float]:
    """A column of those rows of a result that have it, and these values."""
    rows = [row for row in load(name)["rows"] if row.get(key) is not None]
    return [row[key] for row in rows if all(row.get(field) == value for field, value in wanted.items())]


def span(values, form=".1f") -> list[str]:
    """The least and the largest."""
    return [format(value, form) for value in (min(values), max(values))]


def path(name, scene) -> list[str]:
    """How many times as long a frame takes without a path."""
    return [f"{value:.1f}" for value in column("paths", path=name, scene=scene)]


GUIDE, BENCH, FRONT = "rasterizer/README.md", "bench/README.md", "README.md"
SENTENCES = (  # page, sentence, function that returns its figures
    (GUIDE, "With the corners alone a scan takes {} times as long", lambda: path("planes", "scan")),
    (GUIDE, "a scan takes {} times as long without", lambda: path("boxes filled whole", "scan")),
    (GUIDE, "Without it frames take {} to {} times as long", lambda: span(column("paths", path="float32"))),
    (GUIDE, "takes {} of the time of `import numba`",
     lambda: [f"{column('startup', 'yards', program='first picture')[0]:.2f}"]),
    (GUIDE, "costs at most {} %",
     lambda: [f"{100.0 * max(row['ratio_of_cpu'] for row in load('peers')['rows'] if 'speck' in row) - 100.0:.0f}"]),
    (FRONT, "takes {} to {} ms at 1920×1080",
     lambda: [f"{min(column('frame', 'ms_2', **SCAN)):.0f}", f"{max(column('frame', 'ms_1', **SCAN)):.0f}"]),
    (FRONT, "llvmpipe takes {} to {} times as long", lambda: span(column("peers", peer="llvmpipe"))),
    (BENCH, "would save {} to {} % of the time at most",
     lambda: span([100.0 * saved for saved in column("tolerance", "saved")], ".0f")),
    (BENCH, "| {} to {} of f3d's time; {} with ten million triangles, {} with three million loose ones",
     lambda: [*span([row["ratio"] for row in load("whole")["rows"] if row["model"] not in ("10m-stl", "loose")], ".2f"),
              *(f"{column('whole', model=model)[0]:.1f}" for model in ("10m-stl", "loose"))]),
    (BENCH, "| {} to {} pictures a second on two cores", lambda: span(column("viewer", "per_second"), ".0f")),
)  # fmt: skip
SCAN = {"case": "stanford-bunny", "channels": "mono", "samples": 1}

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


def flat(wanted, **columns):
    """Make a table of rows that have a key: a title, the key and a format a column."""

    def table(rows) -> list[str]:
        found = [[cell(row.get(key), form) for key, form in columns.values()] for row in rows if wanted in row]
        return lines_of([title.replace("_", " ") for title in columns], found)

    return table


def cell(value, form) -> str:
    """A value as it is, in a format, with so many digits, or with its thousands apart."""
    if value is None or form is str:
        return "" if value is None else str(value)
    return form(value) if callable(form) else figure(value, form) if isinstance(form, int) else form.format(value)


def crossed(rows, down, across, cell, head, *more):
    """Make a table with a line a value of `down` and a column a value of `across`.

    Parameters
    ----------
    down, across : key, or function of a row
    cell : function of a row
    head : titles of the columns before
    more : functions of the first row of a line, for the columns between
    """
    down, across = (key if callable(key) else lambda row, key=key: row[key] for key in (down, across))
    of = {(down(row), across(row)): row for row in rows}
    names, titles = (list(dict.fromkeys(key[k] for key in of)) for k in range(2))
    found = []
    for name in names:
        own = [of.get((name, title)) for title in titles]
        first = next(row for row in own if row is not None)
        found.append([str(name), *(each(first) for each in more), *("" if row is None else cell(row) for row in own)])
    return lines_of([*head, *(NAMES.get(title, str(title)) for title in titles)], found)


def several(row, *digits: tuple[str, int]) -> str:
    """Some figures of a row in one cell."""
    return " · ".join(figure(row[key], n) for key, n in digits)


# ── frames, and what tolerances do ────────────────────────────────────────────────────────────────────────


def frames(channels, samples):
    """Make the table of frames: milliseconds with one thread, what two gain, nanoseconds a covered pixel."""

    def table(rows) -> list[str]:
        rows = [row for row in rows if (row["channels"], row["samples"]) == (channels, samples)]
        return crossed(rows, "case", "shading", lambda row: several(row, ("ms_1", 3), ("gain", 3), ("ns_pixel", 2)),
                       ["scene", "triangles"], lambda row: thousands(row["triangles"]))  # fmt: skip

    return table


def frames_in_short(rows) -> list[str]:
    """A scene a row, a shading a column: milliseconds with one thread / with two."""
    rows = [row for row in rows if (row["channels"], row["samples"]) == ("mono", 1) and row["case"] != "quads-back"]

    def name(row) -> str:
        return _SCENES.get(row["case"], f"{row['case']}, {{n}} triangles").format(n=thousands(row["triangles"]))

    return crossed(rows, name, "shading", lambda row: " / ".join(figure(row[key], 3) for key in ("ms_1", "ms_2")
                                                                 if key in row), ["scene"])  # fmt: skip


def tolerances(rows) -> list[str]:
    """By tolerance: the time as a multiple of that of tolerance 0, the largest error, and the error over its bound."""
    rows = [row for row in rows if "tolerance" in row]
    names = list(dict.fromkeys(row["tolerance"] for row in rows))
    of = {(row["model"], row["shading"], row["tolerance"]): row for row in rows}
    found = []
    for model, shading in dict.fromkeys((row["model"], row["shading"]) for row in rows):
        first, *own = (of[model, shading, name] for name in names)
        found.append([model, NAMES[shading], figure(first["ms"], 3), figure(first["max"]),
                      *(several(row, ("of_first", 2), ("max", 2), ("of_bound", 2)) for row in own),
                      figure(first["vertices"])])  # fmt: skip
    return lines_of(["model", "shading", "0: ms", "0: error", *names[1:], "1/256 px"], found)


def exactness(rows) -> list[str]:
    """The largest errors of one model by tolerance, and what becomes of 8-bit values."""
    rows = [row for row in rows if row["model"] == rows[0]["model"] and "tolerance" in row]
    found = []
    for text in dict.fromkeys(row["tolerance"] for row in rows):
        same = {row["shading"]: row for row in rows if row["tolerance"] == text}
        over = sum(row["over_1"] for row in same.values())
        name = f"`tolerance={text}`" + (", the default" if text == "1/4096" else "")
        found.append([name, *(figure(same[shading]["max"], 1) for shading in SHADINGS), str(over or "none")])
    return lines_of(["", "flat", "Gouraud", "Phong", "8-bit values more than a level off"], found)


# ── speed against error ───────────────────────────────────────────────────────────────────────────────────


def methods(rows) -> list[str]:
    """Shadings and subdivisions with four samples a pixel, a model a column."""
    rows = [row for row in rows if row["what"] == "method" and row["samples"] == 4]
    triangles = {row["model"]: thousands(row["triangles"]) for row in rows if not row["subdivisions"]}
    return crossed(rows, lambda row: row["value"].partition(", 4 samples")[0],
                   lambda row: f"{row['model']}, {triangles[row['model']]} triangles",
                   lambda row: several(row, ("ms", 3), ("rms", 2), ("delta_e", 2)), ["method"])  # fmt: skip


def samples(rows) -> list[str]:
    """Phong's shading with more and more samples a pixel: time and error as multiples of those of one."""
    rows = sorted((row for row in rows if row.get("shading") == "phong"), key=lambda row: row["samples"])
    one = {row["model"]: row for row in rows if row["samples"] == 1}

    def cell(row) -> str:
        return " · ".join(figure(row[key] / one[row["model"]][key]) for key in ("ms", "rms"))

    return crossed([row for row in rows if row["samples"] > 1], "model", lambda row: f"{row['samples']} samples", cell,
                   ["model"])  # fmt: skip


def changes(rows) -> list[str]:
    """One thing changed at a time."""
    rows = [row for row in rows if row["what"] != "method"]
    found = []
    for what, model in dict.fromkeys((row["what"], row["model"]) for row in rows):
        own = [row for row in rows if (row["what"], row["model"]) == (what, model)]
        cells = (f"{row['value']}: {figure(row['ratio'])}, {figure(row['rms'])}" for row in own)
        found.append([f"{what}, {model}", " · ".join(cells), own[0]["against"]])
    return lines_of(["what", "value: time, error", "against"], found)


def finer(rows) -> list[str]:
    """Gouraud's method on four times as many triangles, against Phong's: time and error as multiples."""
    phong = {(row["surface"], 4 * row["triangles"]): row for row in rows if row["shading"] == "phong"}
    rows = [row for row in rows if row["shading"] == "gouraud" and row["surface"] != "plane"
            and (row["surface"], row["triangles"]) in phong]  # fmt: skip

    def cell(row) -> str:
        other = phong[row["surface"], row["triangles"]]
        return " · ".join(figure(row[key] / other[key]) for key in ("ms", "rms"))

    return crossed(rows, lambda row: f"{thousands(row['triangles'])} / {thousands(row['triangles'] // 4)}", "surface",
                   cell, ["triangles, Gouraud / Phong"])  # fmt: skip


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
        by_paths = [sum(path in row["path"] for row in own) for path in ("packed", "planes", "exact")]
        found.append([name, str(len(own)), *map(str, by_paths), figure(max(shares)) if shares else ""])
    columns = ["cases", "by packed samples", "by planes", "by exact setups", "largest error / bound"]
    return lines_of(["what happens", *columns], found)


# ── what things cost ──────────────────────────────────────────────────────────────────────────────────────


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
    rows = [row for row in rows if row.get("outputs", "Gouraud") != "Gouraud"]
    return crossed(rows, "scene", "outputs", lambda row: figure(row["ratio_1"]), ["of Gouraud's picture"])


def specks(rows) -> list[str]:
    """What a few pixels cost that need more than the others."""
    rows = [row for row in rows if row.get("speck", "plain") != "plain"]
    return crossed(rows, lambda row: NAMES[row["shading"]], "speck", lambda row: f"{row['ratio_of_cpu']:.2f}", [""])


def writers(rows) -> list[str]:
    """Means of milliseconds and sizes of PNG files."""
    rows = [row for row in rows if row["case"] == "mean"]
    return crossed(rows, "writer", "size", lambda row: f"{figure(row['ms'])} · {row['share']:.2f}", ["writer"])


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


def paths(rows) -> list[str]:
    """Times without a path that is there over those with it, a path a row and a scene a column."""
    rows = [row for row in rows if "(gone)" not in row["path"]]
    return crossed(rows, "path", "scene", lambda row: f"{row['ratio']:.2f}", ["without"])


TABLES = {
    "frames in short": frames_in_short, "frames": frames("mono", 1), "frames of 4 samples": frames("mono", 4),
    "frames in colour": frames("rgb", 1), "frames in colour of 4 samples": frames("rgb", 4), "exactness": exactness,
    "tolerances": tolerances, "methods": methods, "samples": samples, "one thing at a time": changes,
    "finer meshes": finer, "hard cases": hard_cases, "features": features, "buffers": buffers, "specks": specks,
    "writers": writers, "growth": growth, "held memory": held, "paths": paths,
    "peers": flat("peer", case=("case", "`{}`"), triangles=("triangles", thousands), peer=("peer", str),
                  **{"ours, ms": ("ms_ours", "{:.2f}"), "peer, ms": ("ms_peer", "{:.2f}"),
                     "peer/ours": ("ratio", "{:.1f}"), "of CPU": ("ratio_of_cpu", "{:.1f}")}),
    "programs": flat("program", program=("program", "`{}`"), ms=("ms", 3), yards=("yards", 2),
                     peak_MiB=("peak_mib", 3)),
    "throughput": flat("processes", processes=("processes", str), s=("seconds", "{:.2f}"),
                       pictures_a_second=("per_second", "{:.0f}"), gain=("gain", "{:.2f}")),
    "whole": flat("model", model=("model", str),
                  **{"ours, ms": ("ours_ms", "{:.0f}"), "f3d, ms": ("f3d_ms", "{:.0f}"), "ours/f3d": ("ratio", 3),
                     "of CPU": ("cpu_ratio", 3), "MiB": ("ours_mib", 3), "of f3d's": ("mib_ratio", 3)}),
    "viewer": flat("where", where=("where", str), look=("look", str), size_while_it_moves=("moving", str),
                   pictures_a_second=("per_second", 2)),
}  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
