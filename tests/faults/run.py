"""Put small faults into copies of the project, one at a time, and see which test finds each.

    python tests/faults/run.py                         # all faults, the default run
    python tests/faults/run.py --only shadow           # those that speak of a shadow
    python tests/faults/run.py --marks "" --keep       # by nightly tests, too; the table goes to bench/results/

Tests run until the first of them fails: those of the faulty file, a few random scenes, the folders that the list names,
then all others. What takes longer than --seconds has found the fault, too: it hangs. A fault in a kernel makes all
kernels stale: of a minute for such a fault, most is compiling.
"""

import argparse
import csv
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from faults import FAULTS, HELD_OUT, Fault

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "bench" / "results" / "faults.csv"
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", ".*_cache", ".hypothesis", "__pycache__", "build", "*.egg-info")
NO_TESTS = 5  # pytest's exit code where nothing was collected
CAMPAIGN = "tests/pictures/test_campaign.py"
N_SCENE = 40  # random scenes, at first: of fewer it is chance how many are lit in float32, which a test asks for
# What takes itself for a frozen program compiles in its own process, which is quicker for a kernel or two at a time.
FROZEN = "import sys; sys.frozen = True; import pytest; sys.exit(pytest.main())"
_printing = threading.Lock()


def main() -> int:
    """Run the command; return 0 where every fault is found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--held-out", action="store_true", help="the list that tests were not written against")
    parser.add_argument("--only", default="", help="faults whose words have this in them")
    parser.add_argument("--marks", default="not nightly", help='which tests, as pytest\'s -m takes it; "" for all')
    parser.add_argument("--tree", type=Path, default=ROOT, help="the project that is copied")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="how many faults at a time")
    parser.add_argument("--seconds", type=float, default=900.0, help="the longest that tests may take")
    parser.add_argument("--near", action="store_true", help="run the folders that a fault names, not all")
    parser.add_argument("--pytest", default="--lazily", help="what pytest is told besides")
    parser.add_argument("--keep", action="store_true", help=f"write {KEPT.relative_to(ROOT)}")
    arguments = parser.parse_args()
    faults = [fault for fault in (HELD_OUT if arguments.held_out else FAULTS) if arguments.only in fault.what]
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(arguments.jobs) as pool:
        rows = list(pool.map(lambda fault: seek(fault, Path(folder), arguments), faults))
    missed = [row["fault"] for row in rows if not row["found"]]
    print(f"{len(rows) - len(missed)} of {len(rows)} faults are found" + "".join(f"\n  not {what}" for what in missed))
    if arguments.keep:
        with open(KEPT, "w", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, rows[0])
            table.writeheader()
            table.writerows(rows)
    return bool(missed)


def seek(fault: Fault, folder: Path, arguments) -> dict:
    """Run tests on a copy with the fault until one fails; return and print what was seen."""
    copy = Path(tempfile.mkdtemp(dir=folder))
    shutil.copytree(arguments.tree, copy, ignore=LEFT_OUT, dirs_exist_ok=True)
    put(fault, copy)
    start = time.perf_counter()
    test, words = "", ""
    for tests in ranges(fault, copy, arguments.near):
        test, words = first_failure(copy, tests, folder / "store", arguments)
        if test:
            break
    seconds = round(time.perf_counter() - start)
    shutil.rmtree(copy, ignore_errors=True)
    with _printing:
        print(f"{'found' if test else 'MISSED':6} {seconds:4} s  {fault.what}\n{'':15}{test}  {words}", flush=True)
    return {
        "fault": fault.what,
        "file": fault.file,
        "found": bool(test),
        "test": test,
        "says": words[:160],
        "seconds": seconds,
    }


def put(fault: Fault, copy: Path) -> None:
    """Change the line."""
    path = copy / "rasterizer" / fault.file
    text = path.read_text(encoding="utf-8")
    if text.count(fault.before) != 1:
        raise SystemExit(
            f"{fault.file} has {text.count(fault.before)} times {fault.before!r}, of {fault.what!r}: mend the list"
        )
    path.write_text(text.replace(fault.before, fault.after), encoding="utf-8")


def ranges(fault: Fault, copy: Path, is_near: bool) -> Iterator[list[str]]:
    """Yield what Python is told to run, the likeliest first: random scenes find most that is wrong in a picture."""
    folder, _, name = fault.file.rpartition("/")
    folders = [f"tests/{each}" for each in fault.folders.split()]
    first = [*(path for path in folders if path.endswith(".py")), f"tests/{folder}/test_{name}", CAMPAIGN]
    first = [path for path in first if (copy / path).is_file() and path.startswith(tuple(folders))]
    yield from (["-c", FROZEN, path] for path in first)
    yield ["-m", "pytest", *folders]
    if not is_near:
        yield ["-m", "pytest", "tests", *(f"--ignore={path}" for path in folders)]


def first_failure(copy: Path, tests: list[str], store: Path, arguments) -> tuple[str, str]:
    """Run tests in one process; return the first that fails with the first line of what it says, or nothing twice."""
    command = [sys.executable, *tests, "-x", "-n", "0", "-m", arguments.marks, "-p", "no:cacheprovider"]
    environment = os.environ | {"PYTHONPATH": str(copy), "RASTER_STORE": str(store), "COLUMNS": "400"}
    environment |= {"RASTERIZER_FUZZ_CASES": str(N_SCENE)} if FROZEN in tests else {}
    store.mkdir(exist_ok=True)
    try:
        done = subprocess.run([*command, *arguments.pytest.split()], cwd=copy, env=environment, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=arguments.seconds)  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"after {arguments.seconds:g} s", "the tests hang"
    if done.returncode in (0, NO_TESTS):
        return "", ""
    line = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - (.*))?$", done.stdout, re.MULTILINE)
    return (line[1], line[2] or "") if line else ("pytest", done.stdout.strip().splitlines()[-1])


if __name__ == "__main__":
    sys.exit(main())
