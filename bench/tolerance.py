"""What does a tolerance cost, and what is left of the error?

    python bench/tolerance.py
    python bench/tolerance.py teapot path/to/part.stl --shadings phong --tolerances 0 1/64 --samples 1 16

For each model, shading and tolerance: the time of a frame, and its error against the float64 reference, which draws the
same mesh by the same method: what rounding and cheaper paths cost. Columns are explained in bench/README.md; the last
line is JSON. The reference is slow: seconds for 10 000 triangles.
"""

import argparse
import sys
from contextlib import ExitStack
from fractions import Fraction
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import margins, measure, scenes
from rasterizer import Renderer, reference
from rasterizer.analysis.comparison import root_mean_square
from rasterizer.analysis.timing import take_turns
from rasterizer.choices import SAMPLES, SHADINGS

MODELS = ("sphere", "teapot")
TOLERANCES = ("0", "1/4096", "1/256")

COLUMNS = [
    ("model     ", "model", ""), ("shading", "shading", ""), ("samples", "samples", "d"),
    ("tolerance", "tolerance", ""), ("     ms", "ms", ".2f"), ("of the first", "of_first", ".2f"),
    ("max err", "max", ".1e"), ("rms err", "rms", ".1e"), ("  bound", "bound", ".1e"), ("/bound", "of_bound", ".3f"),
    ("levels", "levels", "d"), ("over 1", "over_1", "d"), ("other px", "other", "d"), ("1/256 px", "vertices", ".1e"),
]  # fmt: skip


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    machine = measure.Machine()
    table, rows = measure.Table(COLUMNS), []
    for model in args.models:
        scene = scenes.build(model, args.size, args.lights, args.channels)
        for shading, samples in product(args.shadings, args.samples):
            for row in measure_group(scene, shading, samples, args):
                rows.append({"model": Path(model).stem, "triangles": scene.n_face} | row)
                table.print(rows[-1])
    measure.print_json("tolerance", machine, args, rows)
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", default=MODELS, metavar="MODEL", help="a model file, or a name in models/")
    parser.add_argument("--size", type=scenes.size_of, default=(512, 512), help="default: 512x512")
    parser.add_argument("--shadings", nargs="+", default=["flat", "gouraud", "phong"], choices=SHADINGS)
    parser.add_argument("--tolerances", nargs="+", default=TOLERANCES, metavar="T", help="numbers or fractions")
    parser.add_argument("--samples", nargs="+", type=int, default=[1], choices=SAMPLES)
    parser.add_argument("--threads", type=int, default=1, help="default: %(default)s")
    parser.add_argument("--cull", choices=("none", "back"), default="none")
    scenes.add_arguments(parser, lights="studio", channels="own")
    parser.add_argument("--frames", type=int, default=25, help="most warm frames of each row (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=1.0, help="time limit of a row (default: %(default)s)")
    measure.add_output(parser)
    return parser


def measure_group(scene, shading, samples, args):
    """Yield a row for each tolerance; they are timed in turns and compared with the same reference."""
    settings = {"shading": shading, "samples": samples, "cull": args.cull}
    ms = time_tolerances(scene, settings, args)
    expected = reference.render(scene, args.size, **settings)
    vertices = error_of_vertices(expected, reference.render(scene, args.size, **settings, rounded=False))
    is_clear = margins.clear_pixels(
        scene, args.size, samples, lambda grid: reference.render(scene, grid, **settings | {"samples": 1})
    )
    for text in args.tolerances:
        options = settings | {"tolerance": float(Fraction(text)), "outputs": ("color", "face"), "threads": args.threads}
        with Renderer(scene, args.size, **options) as renderer:
            frame = renderer.render()
        row = {"shading": shading, "samples": samples, "tolerance": text, "ms": ms[text],
               "of_first": ms[text] / ms[args.tolerances[0]]}  # fmt: skip
        yield row | compare_with_reference(frame, expected, is_clear) | {"vertices": vertices}


def time_tolerances(scene, settings, args) -> dict[str, float]:
    """Return the median milliseconds of a frame by tolerance."""
    with ExitStack() as stack:
        calls = {}
        for text in args.tolerances:
            options = settings | {"tolerance": float(Fraction(text)), "outputs": ("rgb",), "threads": args.threads}
            calls[text] = stack.enter_context(Renderer(scene, args.size, **options)).render
            calls[text]()  # compiles and allocates
        turns = take_turns(calls, args.seconds * len(calls), args.frames)
    return {text: float(np.median(times)) for text, (times, _) in turns.items()}


def compare_with_reference(frame, expected, is_clear) -> dict:
    """Numerical error of a frame: the same mesh, the same method, float64.

    Pixels of which another part is covered are counted, not compared; and so are those with a sample in which two
    surfaces are nearer to each other than depth can tell (`is_clear` (h, w) is False), where each may show the other
    one.
    """
    is_other = (frame.face != expected.face) | (np.abs(frame.alpha - expected.alpha) > 1e-6) | ~is_clear
    is_seen = (expected.alpha > 0) & ~is_other
    error = np.abs(frame.color - expected.color)[is_seen]
    levels = np.abs(frame.rgb.astype(int) - expected.rgb)[is_seen]
    largest = float(error.max(initial=0.0))
    bound = np.nan if frame.stats.error_bound is None else frame.stats.error_bound
    return {"max": largest, "rms": root_mean_square(error), "bound": bound, "of_bound": largest / bound,
            "levels": int(levels.max(initial=0)),
            "over_1": int((levels > 1).sum()), "other": int(is_other.sum())}  # fmt: skip


def error_of_vertices(expected, unrounded) -> float:
    """What the rounding of vertices to 1/256 px does to colours, at most: the reference as it is against the reference
    whose colours are those of the polygons as they are, with the same coverage. Pixels whose centres show other faces
    are left out.
    """
    is_same = (expected.face == unrounded.face) & (np.abs(expected.alpha - unrounded.alpha) <= 1e-6)
    return float(np.abs(expected.color - unrounded.color)[is_same].max(initial=0.0))


if __name__ == "__main__":
    sys.exit(main())
