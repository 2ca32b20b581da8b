"""How long does it take to write a picture's PNG file, and how large does it get?

    python bench/encode.py                               models at 640x480 and 1080p, and noise
    python bench/encode.py path/to/scan.obj --sizes 4k --levels 1 6 9

Writers take turns: `rasterizer/io/png.py`, and Pillow at several levels of compression.
Columns are explained in bench/README.md; the last line of the output is the same as JSON.
"""

import argparse
import io
import sys
from pathlib import Path

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import measure, scenes
from rasterizer import render
from rasterizer.analysis.timing import take_turns
from rasterizer.io.png import encode_png

NOISE = "noise"  # what no writer can make smaller
DEFAULT_LEVEL = 6  # Pillow's


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    machine, rows = measure.Machine(), []
    table = measure.Table([("case        ", "case", ""), ("size     ", "size", ""), ("writer   ", "writer", ""),
                           ("    ms", "ms", ".2f"), ("   KiB", "kib", ".0f"),
                           ("of Pillow's", "share", ".3f")])  # fmt: skip
    for text in args.sizes:
        of_size = []
        for case in args.cases:
            pixels = draw(case, scenes.size_of(text))
            shape = {"case": Path(case).stem, "size": f"{pixels.shape[1]}x{pixels.shape[0]}"}
            for row in measure_writers(pixels, args):
                table.print(shape | row)
                of_size.append(shape | row)
        for row in average([row for row in of_size if row["case"] != NOISE]):
            table.print(row)
            of_size.append(row)
        rows += of_size
    measure.print_json("encode", machine, args, rows)
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", default=(*scenes.MODEL_NAMES, NOISE), metavar="CASE",
                        help=f"a model file, {NOISE}, or one of {', '.join(scenes.all_names())}")  # fmt: skip
    parser.add_argument("--sizes", nargs="+", default=["640x480", "1080p"], metavar="SIZE")
    parser.add_argument("--levels", nargs="+", type=int, default=[1, 3, DEFAULT_LEVEL], help="of Pillow's files")
    parser.add_argument("--rounds", type=int, default=15, help="most files of each row (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=2.0, help="time limit of a picture (default: %(default)s)")
    measure.add_output(parser)
    return parser


def draw(case: str, size: tuple[int, int]) -> np.ndarray:
    """A picture (height, width, 4) uint8 with 4 samples a pixel, in the model's own colours."""
    if case == NOISE:
        return np.random.default_rng(1).integers(0, 256, (size[1], size[0], 4), dtype=np.uint8)
    return render(scenes.build(case, size, "studio", "own"), size, samples=4, outputs=("rgb",)).rgba


def measure_writers(pixels: np.ndarray, args) -> list[dict]:
    """Write one picture by all writers in turns; return a row for each."""
    calls = {"own": lambda: encode_png(pixels)}
    calls |= {f"Pillow {level}": lambda level=level: pillow_png(pixels, level) for level in args.levels}
    sizes = {name: len(call()) for name, call in calls.items()}
    turns = take_turns(calls, args.seconds, args.rounds)
    whole = len(pillow_png(pixels, DEFAULT_LEVEL))
    return [{"writer": name, "ms": float(np.median(times)), "kib": sizes[name] / 1024, "share": sizes[name] / whole}
            for name, (times, _) in turns.items()]  # fmt: skip


def pillow_png(pixels: np.ndarray, level: int) -> bytes:
    """The bytes of a file that Pillow writes."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG", compress_level=level)
    return stream.getvalue()


def average(rows: list[dict]) -> list[dict]:
    """Means over the pictures of a size, a row for each writer."""
    of_writer = {}
    for row in rows:
        of_writer.setdefault(row["writer"], []).append(row)
    return [{"case": "mean", "size": same[0]["size"], "writer": writer,
             **{key: float(np.mean([row[key] for row in same])) for key in ("ms", "kib", "share")}}
            for writer, same in of_writer.items()]  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
