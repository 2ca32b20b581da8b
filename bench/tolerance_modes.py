"""What does a larger tolerance buy in each way of drawing, and how much of it is used?

    python bench/tolerance_modes.py
    python bench/tolerance_modes.py --models teapot sphere path/to/scan.obj@1080p

First, for each way in which pictures are drawn: the largest error against tolerance 0, as a share of the tolerance, and
the processor time of a frame over that with 1/4096. Samples at edges of shadows aren't compared, nor those that err by
more than the bound: they lie next to a step of the illumination, and are counted apart.

Then, for each model: what there would be to be had if Phong's method interpolated intensities over triangles where that
is good enough. A triangle is, if none of its visible samples is further from Phong's intensity, in float64, than the
tolerance; the true condition is stricter. The most that can be saved is the share of these samples times what Phong's
method takes longer than Gouraud's. Columns are explained in bench/README.md; the last line is JSON.
"""

import argparse
import sys
from contextlib import ExitStack
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from time import process_time

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
import rasterizer as rz
from bench import measure, scenes

TOLERANCES = ("1/65536", "1/4096", "1/1024", "1/256", "1/64")
MIXED = ("1/4096", "1/1024", "1/256", "1/64")
MODELS = ("teapot", "sphere")
TURNS = 15
NEAR = 2  # px from an edge of a shadow
MODE_COLUMNS = [("mode               ", "mode", ""), ("tolerance", "tolerance", ""), ("used", "used", ".4f"),
                ("at steps", "at_steps", "d"), ("cpu ms", "ms", ".2f"), ("of 1/4096", "ratio", ".2f")]  # fmt: skip
MIX_COLUMNS = [("model          ", "model", ""), ("tolerance", "tolerance", ""), ("faces", "faces", ".1%"),
               ("samples", "samples", ".1%"), ("Gouraud/Phong", "gouraud", ".2f"),
               ("saved at most", "saved", ".1%")]  # fmt: skip


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    args = make_parser().parse_args(argv)
    machine, rows = measure.Machine(), []
    table = measure.Table(MODE_COLUMNS)
    for name, (scene, options) in list_modes(args.size).items():
        for row in measure_mode(scene, {"threads": 1, **options}, args):
            rows.append({"mode": name} | row)
            table.print(rows[-1])
    table = measure.Table(MIX_COLUMNS)
    for model in args.models:
        name, _, size = model.rpartition("@") if "@" in model else (model, "", "")
        size = scenes.size_of(size) if size else args.size
        for row in measure_mix(scenes.build(name, size, "studio"), size, args.turns):
            rows.append({"model": Path(name).stem, "size": "x".join(map(str, size))} | row)
            table.print(rows[-1])
    measure.print_json("tolerance_modes", machine, args, rows)
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=scenes.size_of, default=(640, 480), help="default: 640x480")
    parser.add_argument("--models", nargs="*", default=MODELS, metavar="MODEL",
                        help="a model file, or a name in models/; with @SIZE in another size")  # fmt: skip
    parser.add_argument("--turns", type=int, default=TURNS, help="frames of each row (default: %(default)s)")
    measure.add_output(parser)
    return parser


def list_modes(size) -> dict:
    """name -> (scene, options): each way of attributes to the samples, and what else may cost digits."""
    grey, colored = (scenes.build("teapot", size, "studio", channels) for channels in ("mono", "rgb"))
    lamp = rz.PointLight((3, 6, 6), 0.8)
    shadow = rz.Shadow(size=512, filter=3)
    globe = rz.load(scenes.find_file("globe"))
    textured = rz.Scene(globe.meshes, [rz.AmbientLight(0.2), rz.DirectionalLight((-1, -1, -2), 0.8)])
    spectral = replace(colored, lights=[rz.AmbientLight(0.2), replace(lamp, color=rz.Spectrum.blackbody(4000))])
    return {
        "flat": (grey, {"shading": "flat"}),
        "Gouraud, one channel": (grey, {"shading": "gouraud"}),
        "Gouraud, colours": (colored, {"shading": "gouraud"}),
        "Phong": (grey, {"shading": "phong"}),
        "Phong, point light": (replace(grey, lights=[lamp]), {"shading": "phong"}),
        "texture": (textured, {"shading": "gouraud"}),
        "shadow": (replace(grey, lights=[rz.AmbientLight(0.2), replace(lamp, shadow=shadow)]), {"shading": "phong"}),
        "spectrum": (spectral, {"shading": "phong"}),
    }


def measure_mode(scene, options, args):
    """Yield a row for each tolerance."""
    exact = rz.render(scene, args.size, **options, tolerance=0.0)
    is_edge = find_shadow_edges(scene, options, args.size)
    tolerances = [float(Fraction(text)) for text in TOLERANCES]
    pictures = [(scene, options | {"tolerance": tolerance, "outputs": "rgb"}) for tolerance in tolerances]
    times = time_all(pictures, args.size, args.turns)
    for text, tolerance, ms in zip(TOLERANCES, tolerances, times, strict=True):
        frame = rz.render(scene, args.size, **options, tolerance=tolerance)
        error = np.abs(frame.color - exact.color).max(axis=-1)
        bounds = [one.stats.error_bound for one in (frame, exact)]
        is_at_step = is_edge if None in bounds else is_edge | (error > sum(bounds))
        largest = float(error[~is_at_step].max(initial=0.0))
        yield {
            "tolerance": text, "used": largest / tolerance, "at_steps": int(is_at_step.sum()), "ms": ms,
            "ratio": ms / times[tolerances.index(rz.Options.tolerance)],
        }  # fmt: skip


def find_shadow_edges(scene, options, size) -> np.ndarray:
    """Tell which pixels (h, w) lie next to an edge of a shadow: neither lit nor in the dark, or next to such ones."""
    lights = [light for light in scene.lights if getattr(light, "shadow", None) is None]
    is_edge = np.zeros(size[::-1], bool)
    if len(lights) == len(scene.lights):
        return is_edge
    bare = [light if light in lights else replace(light, shadow=None) for light in scene.lights]
    options = options | {"tolerance": 0.0}
    shown, dark, lit = (
        rz.render(each, size, **options).color
        for each in (scene, replace(scene, lights=lights), replace(scene, lights=bare))
    )
    is_dark, is_lit = (np.abs(shown - other).max(axis=-1) < 1e-9 for other in (dark, lit))
    for y in range(-NEAR, NEAR + 1):
        for x in range(-NEAR, NEAR + 1):
            is_edge |= ~np.roll(is_dark, (y, x), (0, 1)) & ~is_lit | ~np.roll(is_lit, (y, x), (0, 1)) & ~is_dark
            is_edge |= ~np.roll(is_dark | is_lit, (y, x), (0, 1))
    return is_edge


def time_all(pictures, size, turns) -> list[float]:
    """Return the least milliseconds of processor time of a frame of each picture, (scene, options); they take turns."""
    with ExitStack() as stack:
        renderers = [stack.enter_context(rz.Renderer(scene, size, **options)) for scene, options in pictures]
        least = [np.inf] * len(renderers)
        for turn in range(turns + 1):
            for k, renderer in enumerate(renderers):
                start = process_time()
                renderer.render()
                if turn > 0:
                    least[k] = min(least[k], 1000.0 * (process_time() - start))
    return least


def measure_mix(scene, size, turns):
    """Yield for each tolerance how many triangles, and samples, could be interpolated, and what that might save."""
    pictures = [(scene, {"shading": shading, "threads": 1, "outputs": "rgb"}) for shading in ("gouraud", "phong")]
    gouraud, phong = time_all(pictures, size, turns)
    options = {"threads": 1, "tolerance": 0.0, "outputs": ("color", "face")}
    smooth, lit = (rz.render(scene, size, shading=shading, **options) for shading in ("gouraud", "phong"))
    face = lit.face.ravel()
    error = np.abs(smooth.color - lit.color).max(axis=-1).ravel()[face >= 0]
    face = face[face >= 0]
    largest = np.zeros(face.max() + 1)
    np.maximum.at(largest, face, error)
    is_seen = np.bincount(face) > 0
    for text in MIXED:
        is_good = largest <= float(Fraction(text))
        share = float(is_good[face].mean())
        yield {
            "tolerance": text, "faces": float(is_good[is_seen].mean()), "samples": share,
            "gouraud": gouraud / phong, "saved": share * max(0.0, 1.0 - gouraud / phong),
        }  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
