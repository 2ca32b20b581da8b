"""Write tables of README.md from results/, so that no figure stands there that nobody has measured.

    python bench/tables.py --keep FILE        keep the output of a script, which ends with JSON, in results/; - is stdin
    python bench/tables.py                    write the tables anew
    python bench/tables.py --check            tell which ones are not what the results say

A table stands between two comments, `<!-- results/NAME.json: TABLE -->` and `<!-- end -->`. Paths of models are kept
without their folders.
"""

import argparse
import json
import os
import re
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
PAGE, RESULTS = FOLDER / "README.md", FOLDER / "results"
MARKED = re.compile(r"(<!-- results/([\w-]+)\.json: ([\w -]+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
SHADINGS = ("flat", "gouraud", "phong")
NAMES = {"flat": "flat", "gouraud": "Gouraud", "phong": "Phong"}


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    if args.keep:
        print(keep(sys.stdin.read() if args.keep == "-" else Path(args.keep).read_text(encoding="utf-8")))
        return 0
    page = PAGE.read_text(encoding="utf-8")
    written = fill(page)
    if args.check:
        for name, table in wrong_tables(page):
            print(f"results/{name}.json: {table} is not what README.md says")
    else:
        PAGE.write_text(written, encoding="utf-8")
    return int(args.check and written != page)


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", metavar="FILE", help="keep the output of a script in results/")
    parser.add_argument("--check", action="store_true", help="change nothing; exit code 1 where a table is wrong")
    return parser


def keep(output: str) -> Path:
    """Write the last line of a script's output into results/; return the file."""
    record = without_folders(json.loads(output.strip().splitlines()[-1]))
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{record['bench']}.json"
    rows = ",\n  ".join(json.dumps(row) for row in record.pop("rows"))
    head = ",\n ".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in record.items())
    path.write_text(f'{{{head},\n "rows": [\n  {rows}\n ]}}\n', encoding="utf-8")
    return path


def without_folders(value):
    """Return a value with paths as names alone."""
    if isinstance(value, dict):
        return {key: without_folders(each) for key, each in value.items()}
    if isinstance(value, list):
        return [without_folders(each) for each in value]
    return os.path.basename(value) if isinstance(value, str) and os.path.isabs(value) else value


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
    """Make a table as Markdown, with the machine that it was measured on."""
    record = load(name)
    return "\n".join([*TABLES[table](record["rows"]), "", said_of(record["machine"])])


def said_of(machine: dict) -> str:
    """A line about a machine."""
    return (
        f"Measured on {machine['cores']} cores of {machine['cpu']}; Python {machine['python']}, "
        f"numpy {machine['numpy']}, numba {machine['numba']}."
    )


def lines_of(head, rows) -> list[str]:
    """Cells as lines of a Markdown table."""
    return [f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows)]


# ── the tables ────────────────────────────────────────────────────────────────────────────────────────────


def slopes(rows) -> list[str]:
    """With which power of the edges' length errors fall, at the finest meshes, beside theory."""
    from bench.refinement import ROUNDED, THEORY, last_slopes

    surfaces = [name for name in dict.fromkeys(row["surface"] for row in rows)
                if any(row["surface"] == name and row["rms"] > ROUNDED for row in rows)]  # fmt: skip
    found = []
    for name in (*SHADINGS, "silhouette"):
        cells = []
        for surface in surfaces:
            own = [row for row in rows if row["surface"] == surface]
            key, shading = ("silhouette_slope", "flat") if name == "silhouette" else ("slope", name)
            cells += [f"{slope:.2f}" for slope in last_slopes(own, shading, key)] or [""]
        found.append([NAMES.get(name, "area of the silhouette"), str(THEORY[name]), *cells])
    return lines_of(["", "theory", *surfaces], found)


def hard_cases(rows) -> list[str]:
    """The hard cases, why each is right, its error and its bound."""
    found = [
        [row["case"], row["why"], "" if row.get("error") is None else f"{row['error']:.1e}", f"{row['bound']:.1e}"]
        for row in rows
    ]
    return lines_of(["case", "what happens, and why that is right", "error", "bound"], found)


def peers(rows) -> list[str]:
    """How many times as long other renderers take."""
    found = [
        [f"`{row['case']}`", f"{row['triangles']:,}".replace(",", " "), row["peer"], f"{row['ms_ours']:.2f}",
         f"{row['ms_peer']:.2f}", f"{row['ratio']:.1f}", f"{row['ratio_of_cpu']:.1f}"]
        for row in rows if "peer" in row
    ]  # fmt: skip
    return lines_of(["case", "triangles", "peer", "ours, ms", "peer, ms", "peer/ours", "of CPU"], found)


def specks(rows) -> list[str]:
    """What a few pixels cost that need more than the others."""
    found = [row for row in rows if "speck" in row]
    names = list(dict.fromkeys(row["speck"] for row in found))
    ratio = {(row["speck"], row["shading"]): f"{row['ratio_of_cpu']:.2f}" for row in found}
    return lines_of(["speck", "Gouraud", "Phong"],
                    [[name, *(ratio.get((name, each), "") for each in SHADINGS[1:])] for name in names])  # fmt: skip


TABLES = {"slopes": slopes, "hard cases": hard_cases, "peers": peers, "specks": specks}

if __name__ == "__main__":
    sys.path.insert(0, str(FOLDER.parent))  # a checkout need not be installed
    sys.exit(main())
