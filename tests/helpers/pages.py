"""The pages of the project: their examples, commands, links and the files that they name."""

import re
from functools import cache

from helpers.raster import ROOT

PAGES = (
    "README.md",
    "models/README.md",
    "rasterizer/README.md",
    "rasterizer/recipes.md",
    "bench/README.md",
    "tests/README.md",
    "CHANGELOG.md",
)


@cache
def text_of(page) -> str:
    """Return what a page says."""
    return (ROOT / page).read_text(encoding="utf-8")


def blocks(page, language) -> list[str]:
    """Return the fenced blocks of a language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```", text_of(page), re.DOTALL | re.MULTILINE)


def chapters(page) -> dict[str, str]:
    """Return the text of each chapter of a page by its title; headings in blocks are none."""
    fenced = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
    plain = fenced.sub(lambda found: " " * len(found[0]), text_of(page))
    starts = [*re.finditer(r"^## (.+)$", plain, re.MULTILINE)]
    ends = [*(found.start() for found in starts), len(plain)][1:]
    return {found[1]: text_of(page)[found.end() : end] for found, end in zip(starts, ends, strict=True)}


def shell_lines(page) -> list[str]:
    """Return the lines of shell blocks, without comments."""
    lines = (line.partition(" # ")[0].strip() for block in blocks(page, "sh") for line in block.splitlines())
    return [line for line in lines if line]


def console_lines(page) -> list[tuple[str, int]]:
    """Return the commands `raster ...` of console blocks, without a `timeout` before them, each with its exit code: 0,
    or the number behind `echo $?`."""
    found: list[tuple[str, int]] = []
    for block in blocks(page, "console"):
        lines = iter(block.splitlines())
        for line in lines:
            if line == "$ echo $?":
                found[-1] = (found[-1][0], int(next(lines)))
            else:
                found.append((re.sub(r"^\$ (timeout \d+ )?raster ", "", line), 0))
    return found


def commands(page) -> list[str]:
    """Return the arguments of the commands `raster ...` in shell blocks."""
    return [line.removeprefix("raster ") for line in shell_lines(page) if line.startswith("raster ")]


def links(page) -> list[str]:
    """Return the targets of links and pictures that are no addresses of the web."""
    return [target for target in re.findall(r"\]\(([^)\s]+)\)", text_of(page)) if "://" not in target]


def anchors(page) -> set[str]:
    """Return the names that links may use for the headings of a page: lower case, hyphens for spaces."""
    headings = re.findall(
        r"^#+ (.+)$", re.sub(r"^```.*?^```", "", text_of(page), flags=re.DOTALL | re.MULTILINE), re.MULTILINE
    )
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def named_files(page) -> list[str]:
    """Return what a page names between backquotes and ends like a file of the project, or begins like a folder."""
    names = re.findall(r"`([\w.\-/]+\.(?:py|md|toml|cfg|yaml|json|obj|png|mtl|stl|ply|glb)|[\w.\-/]+/)`", text_of(page))
    return list(dict.fromkeys(names))
