"""What does speed cost in error, and where does it come from?

    python bench/speed_vs_error.py
    python bench/speed_vs_error.py teapot path/to/part.stl --shadings phong --tolerances 0 1/64 --samples 1 16

For each model, shading, number of samples and tolerance: the time of a frame, its error against the float64
reference (what rounding and cheaper paths cost) and, where the model approximates a sphere or torus, against
the surface itself (what the mesh and the shading method cost). Columns are explained in bench/README.md; the last
line is JSON.
"""

import argparse
import sys
from contextlib import ExitStack
from fractions import Fraction
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
from bench import analytic, margins, measure, scenes
from rasterizer import Renderer, reference
from rasterizer.options import SAMPLES, SHADINGS
from rasterizer.scene.color import srgb_from_linear

MODELS = ("sphere", "torus", "teapot", "gear", "still_life")
TOLERANCES = ("0", "1/4096", "1/256", "1/64")
OTHER_DEPTH = 0.1  # of the scene's diagonal: where depths differ by more, another part of the surface is seen

COLUMNS = [
    ("model     ", "model", ""), ("shading", "shading", ""), ("samples", "samples", "d"),
    ("tolerance", "tolerance", ""),
    ("     ms", "ms", ".2f"), ("speed", "speed", ".2f"), ("ns/tri", "ns_triangle", ".1f"),
    ("ns/px", "ns_pixel", ".2f"),
    ("max err", "max", ".1e"), ("rms err", "rms", ".1e"), ("/bound", "of_bound", ".3f"),
    ("levels", "levels", "d"),
    ("over 1", "over_1", "d"), ("other px", "other", "d"), ("1/256 px", "vertices", ".1e"),
    ("| true max", "true_max", ".1e"), ("true rms", "true_rms", ".1e"), ("over 1", "true_over_1", ".0%"),
    ("silhouette", "silhouette", "d"),
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
                rows.append({"model": Path(model).stem} | row)
                table.print(rows[-1])
    measure.print_json("speed_vs_error", machine, args, rows)
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", default=MODELS, metavar="MODEL", help="a model file, or a name in models/")
    parser.add_argument("--size", type=scenes.size_of, default=(640, 480), help="default: 640x480")
    parser.add_argument("--shadings", nargs="+", default=["flat", "gouraud", "phong"], choices=SHADINGS)
    parser.add_argument("--tolerances", nargs="+", default=TOLERANCES, metavar="T", help="numbers or fractions")
    parser.add_argument("--samples", nargs="+", type=int, default=[1, 4], choices=SAMPLES)
    parser.add_argument("--threads", type=int, default=1, help="default: %(default)s")
    parser.add_argument("--cull", choices=("none", "back"), default="none")
    scenes.add_arguments(parser, lights="studio", channels="own")
    parser.add_argument("--frames", type=int, default=25, help="most warm frames of each row (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=1.0, help="time limit of a row (default: %(default)s)")
    return parser


def measure_group(scene, shading, samples, args):
    """Yield a row for each tolerance; they are timed in turns and judged by the same reference."""
    settings = {"shading": shading, "samples": samples, "cull": args.cull}
    times, covered = time_tolerances(scene, settings, args)
    judge = reference.render(scene, args.size, **settings)
    vertices = error_of_vertices(judge, reference.render(scene, args.size, **settings, rounded=False))
    is_clear = margins.clear_pixels(
        scene, args.size, samples, lambda grid: reference.render(scene, grid, **settings | {"samples": 1})
    )
    surface = analytic.find_surface(scene)
    truth = None if surface is None else analytic.draw(surface, scene, args.size, samples)
    slowest = times[args.tolerances[0]]
    for text in args.tolerances:
        outputs = ("color", "face", "depth")
        options = settings | {"tolerance": float(Fraction(text)), "outputs": outputs, "threads": args.threads}
        with Renderer(scene, args.size, **options) as renderer:
            frame = renderer.render()
        row = {"shading": shading, "samples": samples, "tolerance": text, "ms": times[text],
               "speed": slowest / times[text], "ns_triangle": 1e6 * times[text] / scene.n_face,
               "ns_pixel": 1e6 * times[text] * samples / max(covered, 1)}  # fmt: skip
        row |= compare_with_reference(frame, judge, is_clear) | {"vertices": vertices}
        if truth is not None:
            diagonal = float(np.linalg.norm(np.diff(scene.bounds, axis=0)))
            row |= compare_with_surface(frame, truth, samples, OTHER_DEPTH * diagonal)
        yield row


def time_tolerances(scene, settings, args) -> tuple[dict, int]:
    """Return the median milliseconds of a frame by tolerance, and the number of samples covered."""
    with ExitStack() as stack:
        calls = {}
        for text in args.tolerances:
            options = settings | {
                "tolerance": float(Fraction(text)),
                "outputs": ("rgb",),
                "threads": args.threads,
            }
            calls[text] = stack.enter_context(Renderer(scene, args.size, **options)).render
            covered = calls[text]().stats.covered  # the first call compiles and allocates
        turns = measure.take_turns(calls, args.seconds * len(calls), args.frames)
    return {text: float(np.median(times)) for text, (times, _) in turns.items()}, covered


def compare_with_reference(frame, judge, is_clear) -> dict:
    """Numerical error of a frame: the same mesh, the same method, float64.

    Pixels of which another part is covered are counted, not compared; and so are those with a sample in which two
    surfaces are nearer to each other than depth can tell (`is_clear` (h, w) is False), where each may show the other
    one.
    """
    is_other = (frame.face != judge.face) | (np.abs(frame.alpha - judge.alpha) > 1e-6) | ~is_clear
    is_seen = (judge.alpha > 0) & ~is_other
    error = np.abs(frame.color - judge.color)[is_seen]
    levels = np.abs(frame.rgb.astype(int) - judge.rgb)[is_seen]
    largest = float(error.max(initial=0.0))
    return {"max": largest, "rms": _rms(error), "bound": frame.stats.error_bound,
            "of_bound": largest / frame.stats.error_bound, "levels": int(levels.max(initial=0)),
            "over_1": int((levels > 1).sum()), "other": int(is_other.sum())}  # fmt: skip


def error_of_vertices(judge, unrounded) -> float:
    """What the rounding of vertices to 1/256 px does to colours, at most: the reference as it is against the reference
    whose colours are those of the polygons as they are, with the same coverage. Pixels whose centres show other faces
    are left out.
    """
    is_same = (judge.face == unrounded.face) & (np.abs(judge.alpha - unrounded.alpha) <= 1e-6)
    return float(np.abs(judge.color - unrounded.color)[is_same].max(initial=0.0))


def compare_with_surface(frame, truth, samples, other_depth) -> dict:
    """Model error of a frame: what the mesh and the shading method make of the true surface.

    Compared are pixels that both cover in full with the same part of the surface. Samples covered in one of
    them only are counted: the silhouette.
    """
    with np.errstate(invalid="ignore"):  # inf - inf where nothing is
        is_near = (frame.depth - truth.nearest < other_depth) & (truth.furthest - frame.depth < other_depth)
    is_inner = (truth.alpha == 1) & (frame.alpha > 1 - 1e-6) & is_near
    error = np.abs(frame.color - truth.color)[is_inner]
    true_rgb = np.rint(255 * srgb_from_linear(np.clip(truth.color, 0, 1))).astype(int)
    levels = np.abs(frame.rgb - true_rgb)[is_inner]
    return {"true_max": float(error.max(initial=0.0)), "true_rms": _rms(error),
            "true_over_1": float((levels > 1).mean()) if levels.size else 0.0,
            "silhouette": round(float(np.abs(frame.alpha - truth.alpha).sum()) * samples)}  # fmt: skip


def _rms(error) -> float:
    """Root of the mean square; 0 without values."""
    return float(np.sqrt(np.mean(np.square(error)))) if error.size else 0.0


if __name__ == "__main__":
    sys.exit(main())
