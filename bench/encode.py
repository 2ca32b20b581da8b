"""How long does it take to write a picture's PNG file, and how large does it get?

    python bench/encode.py                               models at 640x480 and 1080p, and their mean
    python bench/encode.py path/to/scan.obj --sizes 4k --levels 1 6 9

Writers take turns: `rasterizer/io/png.py`, and Pillow at several levels of compression.
"""

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

DEFAULT_LEVEL = 6  # Pillow's


def add_arguments(parser) -> None:
    """Describe the command line."""
    add = parser.add_argument
    add("cases", nargs="*", default=scenes.MODEL_NAMES, metavar="CASE", help="model files, or names of scenes.py")
    add("--sizes", nargs="+", default=["640x480", "1080p"], metavar="SIZE")
    add("--levels", nargs="+", type=int, default=[1, 3, DEFAULT_LEVEL], help="of Pillow's files")
    add("--rounds", type=int, default=15, help="most files of each row (default: %(default)s)")
    add("--seconds", type=float, default=2.0, help="time limit of a picture (default: %(default)s)")


def measure_writers(args):
    """Yield a row for each picture and writer, and their means."""
    for text in args.sizes:
        size, rows = scenes.size_of(text), []
        for case in args.cases:
            scene = scenes.build(case, size, "studio", "own")
            pixels = render(scene, size, samples=4, outputs=("rgb",)).rgba
            calls = {"own": lambda pixels=pixels: encode_png(pixels)}
            calls |= {f"Pillow {n}": lambda pixels=pixels, n=n: pillow_png(pixels, n) for n in args.levels}
            whole = len(pillow_png(pixels, DEFAULT_LEVEL))
            for writer, (times, _) in take_turns(calls, args.seconds, args.rounds).items():
                n_byte = len(calls[writer]())
                rows.append({"case": Path(case).stem, "size": "{}x{}".format(*size), "writer": writer,
                             "ms": float(np.median(times)), "kib": n_byte / 1024, "share": n_byte / whole})  # fmt: skip
        yield from rows
        for writer in calls:
            same = [row for row in rows if row["writer"] == writer]
            yield {**same[0], "case": "mean",
                   **{key: float(np.mean([row[key] for row in same])) for key in ("ms", "kib", "share")}}  # fmt: skip


def pillow_png(pixels: np.ndarray, level: int) -> bytes:
    """The bytes of a file that Pillow writes."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG", compress_level=level)
    return stream.getvalue()


main = measure.script("encode", __doc__, add_arguments, measure_writers)

if __name__ == "__main__":
    sys.exit(main())
