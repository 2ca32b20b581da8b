"""How fast is another renderer of a CPU at the same work, and what do a few pixels cost that need more than the others?

    python bench/peers.py
    python bench/peers.py --model path/to/scan.obj --textured-model path/to/textured.obj --save pictures

The peer is OpenGL by Mesa's llvmpipe; bench/README.md says how to install it. Two processes, one of ours and one of the
peer, draw the same frame in turns; only one of them works at a time. A frame is what happens between the prepared scene
and the array of bytes in memory. Pictures are compared, so that nobody compares different work: counts of covered
pixels, and colours where no silhouette is.

Specks are ours against ours: a square of 16 × 16 pixels in a corner is of another material.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import measure, scenes
from bench.worker import SPECKS
from rasterizer import Options

CASES = {  # whether it is textured, size, shading
    "textured": (True, "1080p", "phong"),
    "model-512-gouraud": (False, "512", "gouraud"),
    "model-1080p-gouraud": (False, "1080p", "gouraud"),
    "model-1080p-phong": (False, "1080p", "phong"),
}
SPECKLED = ("model-1080p-gouraud", "model-1080p-phong")
# A surface whose depth changes by more widths of a pixel from one pixel to the next is a silhouette: it is seen at less
# than 7°, and a step of 1/256 px, by which vertices may differ, is 1/32 px in depth.
STEEPEST = 8.0
MAX_MORE = 0.001  # part of the covered pixels by which counts may differ: 1/256 of the pixels of silhouettes
MAX_OVER_ONE = 0.01  # part of the pixels compared that may differ by more than a level: two roundings may make one


def add_arguments(parser) -> None:
    """Describe the command line."""
    add = parser.add_argument
    add("--cases", nargs="+", choices=(*CASES, "specks"), default=(*CASES, "specks"), metavar="CASE")
    add("--model", type=scenes.find_name, default="dense-torus", help="drawn in grey (default: %(default)s)")
    add("--textured-model", type=scenes.find_name, default="globe", metavar="MODEL", help="(default: %(default)s)")
    add("--size", help="of all pictures instead of their own")
    add("--save", type=Path, metavar="FOLDER", help="write ours, the peer's, and the difference times 32")
    measure.add_turns(parser, frames=40, pairs=2, seconds=3.0)
    parser.set_defaults(threads=Options().n_thread)


def work_of(case: str, args, speck="") -> dict:
    """What both sides draw."""
    is_textured, size, shading = CASES[case]
    options = {"shading": shading, "cull": "back", "threads": args.threads}
    return {"case": args.textured_model if is_textured else args.model, "size": scenes.size_of(args.size or size),
            "texture": is_textured, "options": options, "cores": args.threads, "speck": speck}  # fmt: skip


def measure_peers(args):
    """Yield a row for each case, and for each thing that a few pixels may be made of."""
    for name in (name for name in CASES if name in args.cases):
        (row,) = measure.compare([work_of(name, args)], {}, {"painter": "llvmpipe"}, args, has_pictures=True)
        if args.save:
            args.save.mkdir(parents=True, exist_ok=True)
            sheet(*row["pictures"]).save(args.save / f"{name}.png")
        yield {"case": name, "triangles": row["triangles"], "peer": "llvmpipe", "threads": args.threads,
               **named(row, "ms_ours", "ms_peer"), **compare(*row["pictures"]), "version": row["version"]}  # fmt: skip
    for name in SPECKLED if "specks" in args.cases else ():
        plain, specks = [work_of(name, args, "plain")] * len(SPECKS), [work_of(name, args, speck) for speck in SPECKS]
        found = measure.compare(plain, {}, {}, args, specks)
        for speck, row in zip(SPECKS, found, strict=True):
            yield {"case": name, "speck": speck, "shading": CASES[name][2], "threads": args.threads,
                   **named(row, "ms_plain", "ms_speck")}  # fmt: skip


def named(row: dict, first: str, second: str) -> dict:
    """The figures of a comparison, by the names of the two sides."""
    return {first: row["ms_first"], second: row["ms_second"],
            **{key: row[key] for key in ("ratio", "ratio_of_best", "ratio_of_cpu", "n_frame")}}  # fmt: skip


# ── did both draw the same? ───────────────────────────────────────────────────────────────────────────────


def compare(ours: dict, peer: dict) -> dict:
    """Compare two pictures.

    Parameters
    ----------
    ours : `rgba` (height, width, 4) uint8, and `depth` (height, width) float32, scene units, inf where nothing is
    peer : `rgba`

    Returns
    -------
    covered, covered_peer : pixels; max, over_one : largest difference in 8-bit levels away from silhouettes, and the
    share of pixels there that differ by more than one; faults : what differs by more than it should
    """
    covered, others = ((picture["rgba"][..., 3] > 0) for picture in (ours, peer))
    difference = np.abs(ours["rgba"][..., :3].astype(np.int16) - peer["rgba"][..., :3]).max(axis=2)
    depth = np.where(np.isfinite(ours["depth"]), ours["depth"], 0.0).astype(np.float64)
    pixel = 2.0 * depth * np.tan(np.radians(scenes.FOV) / 2.0) / len(depth)  # its width on the surface, facing us
    # From one end of the 3 × 3 pixels to the other are two steps.
    jumps = around(depth, np.maximum) - around(depth, np.minimum) > 2.0 * STEEPEST * pixel
    away = difference[around(covered & others, np.logical_and) & ~jumps]
    found = {"covered": int(covered.sum()), "covered_peer": int(others.sum()), "max": int(away.max(initial=0)),
             "over_one": float(np.mean(away > 1)) if len(away) else 1.0, "faults": []}  # fmt: skip
    if abs(found["covered"] - found["covered_peer"]) > MAX_MORE * max(found["covered"], found["covered_peer"]):
        found["faults"].append(f"{found['covered']} pixels are covered by ours, {found['covered_peer']} by the peer")
    if found["over_one"] > MAX_OVER_ONE:
        found["faults"].append(f"{found['over_one']:.1%} of the pixels differ by more than a level")
    return found


def around(values: np.ndarray, join) -> np.ndarray:
    """Join each pixel with its eight neighbours by a ufunc of two arguments; the border has itself as neighbour."""
    wide = np.pad(values, 1, mode="edge")
    rows = join(join(wide[:-2], wide[1:-1]), wide[2:])
    return join(join(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:])


def sheet(ours: dict, peer: dict) -> Image.Image:
    """Ours, the other picture, and their difference times 32, side by side."""
    pictures = [picture["rgba"][..., :3].astype(int) for picture in (ours, peer)]
    difference = np.minimum(32 * np.abs(pictures[0] - pictures[1]), 255)
    return Image.fromarray(np.concatenate([*pictures, difference], axis=1).astype(np.uint8))


main = measure.script("peers", __doc__, add_arguments, measure_peers)

if __name__ == "__main__":
    sys.exit(main())
