"""Read small faults from faults.txt and held_out.txt, blocks of four lines:

what is wrong, in words
  file below the package's folder | folders or files of tests that could see it, the likeliest first
- what stands once in the file
+ what takes its place
"""

from pathlib import Path
from typing import NamedTuple


class Fault(NamedTuple):
    """One line that is wrong."""

    what: str
    file: str
    before: str
    after: str
    folders: str


def read(name: str) -> list:
    """Read a file of faults; what begins with "#" is for people."""
    text = (Path(__file__).parent / name).read_text(encoding="utf-8")
    faults = []
    for block in text.strip().split("\n\n"):
        if not block.startswith("#"):
            what, where, before, after = block.split("\n")
            file, _, folders = where.strip().partition(" | ")
            faults.append(Fault(what, file, before[2:], after[2:], folders))
    return faults


FAULTS, HELD_OUT = read("faults.txt"), read("held_out.txt")
