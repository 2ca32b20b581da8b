"""What does a tolerance cost, and what is left of the error?

    python bench/tolerance.py
    python bench/tolerance.py teapot path/to/part.stl --shadings phong --tolerances 0 1/64 --samples 1 16

For each model, shading and tolerance: the time of a frame, and its error against the float64 reference, which draws the
same mesh by the same method: what rounding and cheaper paths cost. One thread. The reference is slow: seconds for
10 000 triangles.
"""

import sys
from fractions import Fraction
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import margins, measure, scenes
from rasterizer import Options, reference, render
from rasterizer.analysis.comparison import root_mean_square
from rasterizer.choices import SAMPLES

MODELS = ("sphere", "teapot")
TOLERANCES = ("0", "1/4096", "1/256")


def add_arguments(parser) -> None:
    """Describe the command line."""
    add = parser.add_argument
    add("models", nargs="*", default=MODELS, metavar="MODEL", help="a model file, or a name in models/")
    add("--size", type=scenes.size_of, default=(512, 512), help="default: 512x512")
    add("--shadings", nargs="+", default=measure.SHADINGS, choices=measure.SHADINGS)
    add("--tolerances", nargs="+", default=TOLERANCES, metavar="T", help="numbers or fractions")
    add("--samples", nargs="+", type=int, default=[1], choices=SAMPLES)
    add("--frames", type=int, default=25, help="most warm frames of each row (default: %(default)s)")
    add("--seconds", type=float, default=1.0, help="time limit of a row (default: %(default)s)")


def measure_tolerances(args):
    """Yield a row for each model, shading, number of samples and tolerance, and what interpolation could save."""
    for model in args.models:
        scene = scenes.build(model, args.size, "studio", "own")
        head = {"model": Path(model).stem, "triangles": scene.n_face}
        for shading, samples in product(args.shadings, args.samples):
            for row in measure_group(scene, shading, samples, args):
                yield head | row
        yield head | measure_interpolated(scene, args)


def measure_group(scene, shading, samples, args):
    """Yield a row for each tolerance; they are timed in turns and compared with the same reference."""
    settings = {"shading": shading, "samples": samples}
    options = {text: settings | {"tolerance": float(Fraction(text))} for text in args.tolerances}
    pictures = {text: (scene, args.size, own) for text, own in options.items()}
    ms = measure.medians(pictures, args.seconds * len(pictures), args.frames)
    expected = reference.render(scene, args.size, **settings)
    vertices = error_of_vertices(expected, reference.render(scene, args.size, **settings, rounded=False))
    is_clear = margins.clear_pixels(
        scene, args.size, samples, lambda grid: reference.render(scene, grid, shading=shading, samples=1)
    )
    for text, own in options.items():
        frame = render(scene, args.size, outputs=("color", "face"), threads=1, **own)
        yield {"shading": shading, "samples": samples, "tolerance": text, "ms": ms[text],
               "of_first": ms[text] / ms[args.tolerances[0]], **compare_with_reference(frame, expected, is_clear),
               "vertices": vertices}  # fmt: skip


def measure_interpolated(scene, args) -> dict:
    """What there would be to be had if Phong's method interpolated intensities over triangles where that is good
    enough for the default tolerance: the share of samples, times what it takes longer than Gouraud's.

    A triangle is, if none of its visible samples is further from Phong's intensity than the tolerance. The true
    condition is stricter.
    """
    shadings = ("gouraud", "phong")
    ms = measure.medians({each: (scene, args.size, {"shading": each}) for each in shadings}, args.seconds, args.frames)
    options = {"threads": 1, "samples": 1, "tolerance": 0.0, "outputs": ("color", "face")}
    smooth, lit = (render(scene, args.size, shading=each, **options) for each in shadings)
    is_seen = lit.face >= 0
    face, largest = lit.face[is_seen], np.zeros(lit.face.max() + 1)
    np.maximum.at(largest, face, np.abs(smooth.color - lit.color).max(axis=-1)[is_seen])
    share = float((largest[face] <= Options.tolerance).mean())
    return {"interpolated": share, "saved": share * max(0.0, 1.0 - ms["gouraud"] / ms["phong"])}


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


main = measure.script("tolerance", __doc__, add_arguments, measure_tolerances)

if __name__ == "__main__":
    sys.exit(main())
