"""Write tables of the pages from results/, so that no figure stands there that nobody has measured.

    python bench/tables.py                    write the tables anew
    python bench/tables.py --check            tell which ones are not what the results say

A table stands between two comments, `<!-- results/NAME.json: TABLE -->` and `<!-- end -->`. Scripts keep their results
with --json; measure_all.py runs all of them.
"""

import argparse
import json
import re
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
sys.path.insert(0, str(FOLDER.parent))  # a checkout need not be installed
from bench.table_rows import TABLES

PAGES, RESULTS = (FOLDER / "README.md", FOLDER.parent / "README.md"), FOLDER / "results"
MARKED = re.compile(r"(<!-- results/([\w-]+)\.json: ([\w -]+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)


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
    """Make a table as Markdown, with the machine that it was measured on."""
    record = load(name)
    return "\n".join([*TABLES[table](record["rows"]), "", said_of(record["machine"])])


def said_of(machine: dict) -> str:
    """A line about a machine."""
    others = machine.get("others") or 0.0
    busy = f" Other work took {100.0 * others:.0f} % of the cores meanwhile: milliseconds mean little."
    return (
        f"Measured on {machine['cores']} cores of {machine['cpu']}; Python {machine['python']}, "
        f"numpy {machine['numpy']}, numba {machine['numba']}.{busy if others > BUSY_SHARE else ''}"
    )


BUSY_SHARE = 0.05  # from which on measure.py warns

if __name__ == "__main__":
    sys.exit(main())
