"""What do shading, subdivision, samples, shadows, textures and spectra cost, and what do they buy?

    python bench/choices.py                                            the scenes of the page: two minutes
    python bench/choices.py path/to/scan.obj knot --seconds 60         every method of some models

What `raster bench` measures of one model is measured of some that differ: time and error of every method, in
milliseconds and as the rms of linear intensity. Then one thing is changed at a time in scenes that have it, and
compared with the same picture in which that thing isn't saved at.
"""

import io
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import get_args

from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # a checkout need not be installed
import rasterizer as rz
from bench import measure, scenes
from rasterizer import reference
from rasterizer.analysis import speed_error_plot
from rasterizer.analysis.speed_error import (
    Light,
    draw_ground_truth,
    draw_light,
    list_methods,
    measure_errors,
    study,
)
from rasterizer.choices import Filter
from rasterizer.scene.lights import with_shadows

MODELS = ("teapot", "knot", "globe")
RAYS = (320, 240)  # of a picture whose shadows are followed by the reference, with one sample a pixel
FINEST_AREA, FINEST_SPECTRUM = 6, 401


def add_arguments(parser) -> None:
    """Describe the command line."""
    add = parser.add_argument
    add("models", nargs="*", default=MODELS, metavar="MODEL", help="a model file, or a name in models/")
    add("--size", type=scenes.size_of, default=(640, 480), help="default: 640x480")
    add("--threads", type=int, default=1, help="default: %(default)s")
    add("--seconds", type=float, default=25.0, help="time limit of a model (default: %(default)s)")
    add("--plot", type=Path, metavar="FILE", help="draw time against error of the first model (matplotlib)")


def measure_choices(args):
    """Yield a row for each method of each model, and for each value of what is changed."""
    methods = list_methods(measure.SHADINGS, (0, 1, 2), (1, 4, 16), (1 / 4096,))
    for model in args.models:
        scene, name = rz.load(scenes.find_file(model)), Path(model).stem
        found = study(scene, args.size, methods, args.seconds, lambda *_: None, threads=args.threads)
        for row in found.rows:
            yield {"model": name, "what": "method", "value": str(row.method), "ms": row.ms, **errors_of(row.error),
                   "of_method": row.of_method, "of_sampling": row.of_sampling, **row.method._asdict(),
                   "triangles": scene.n_face * 4**row.method.subdivisions, "is_beaten": row.is_beaten}  # fmt: skip
        if args.plot and model == args.models[0]:
            drawn = io.BytesIO(speed_error_plot.plot(found.rows, f"{name}: time against error", ".png"))
            Image.open(drawn).convert("RGB").quantize(64).save(args.plot, optimize=True)
    for what, make in CHANGES.items():
        yield from measure_change(what, make(), args)


def errors_of(error) -> dict:
    """The figures of an `Errors` that are kept."""
    return {"rms": error.rms, "max": error.max, "delta_e": error.delta_e, "over_one": error.over_one}


# ── one thing at a time ───────────────────────────────────────────────────────────────────────────────────
# Each function returns the scene's name, the scene, value -> (scene, options), what the errors are measured against,
# and a function from the size and the number of samples to that picture, or None where rays tell.


def texture_filters():
    """The filters of a texture."""
    scene = rz.load(scenes.find_file("globe"))

    def filtered(word: Filter) -> rz.Scene:
        (mesh,) = scene.meshes
        texture = replace(mesh.palette[0].texture, filter=word)
        look = replace(mesh.palette[0], texture=texture)
        return replace(scene, meshes=(replace(mesh, material=look, materials=None, face_material=None),))

    values = {word: (filtered(word), {}) for word in get_args(Filter)}
    return "globe", scene, values, "64 samples a pixel", lambda size, _: draw_ground_truth(scene, size)


def table() -> rz.Scene:
    """A table under two lights with shadows."""
    scene = rz.load(scenes.find_file("table"))
    lights = (rz.AmbientLight(0.15), rz.DirectionalLight((-1, -1.2, -0.4), 0.5, shadow=True),
              rz.PointLight((1.6, 2.2, 1.2), 0.4, shadow=True))  # fmt: skip
    return rz.Scene(scene.meshes, lights, rz.Camera.framing(scene, elevation=35))


def with_shadow(scene: rz.Scene, **fields: int) -> rz.Scene:
    """A scene whose shadows have other fields."""
    return replace(scene, lights=with_shadows(scene.lights, lambda own: replace(own, **fields) if own else own))


def shadow_maps():
    """The sizes of shadow maps."""
    values = {f"{n}²": (with_shadow(table(), size=n), {}) for n in (256, 512, 1024, 2048, 4096)}
    return "table", table(), values, "rays", None


def shadow_filters():
    """The sizes of their filters."""
    values = {f"{n} x {n}": (with_shadow(table(), filter=n), {}) for n in (1, 3, 5)}
    return "table", table(), values, "rays", None


def area_lights():
    """The numbers of cells of an area light."""
    scene = rz.load(scenes.MODELS / "room.json")

    def divided(n: int) -> rz.Scene:
        lights = [replace(each, resolution=(n, n)) if isinstance(each, rz.AreaLight) else each for each in scene.lights]
        return replace(scene, lights=tuple(lights))

    values, finest = {f"{n} x {n} cells": (divided(n), {}) for n in (1, 2, 4)}, divided(FINEST_AREA)
    against = f"{FINEST_AREA} x {FINEST_AREA} cells"
    return "room", scene, values, against, lambda size, n: draw(finest, size, n, tolerance=0.0)


def spectra():
    """The numbers of samples of a spectrum."""
    scene = rz.load(scenes.MODELS / "room.json")
    values = {f"{n} samples": (scene, {"spectral": n}) for n in (5, 9, 21, 41, 81)}
    against = f"{FINEST_SPECTRUM} samples of the spectrum"
    return "room", scene, values, against, partial(draw, scene, tolerance=0.0, spectral=FINEST_SPECTRUM)


def draw(scene, size, samples, **options) -> Light:
    """Draw a scene by Phong's shading."""
    return draw_light(scene, size, shading="phong", samples=samples, **options)


CHANGES = {"texture filter": texture_filters, "shadow map": shadow_maps, "shadow filter": shadow_filters,
           "area light": area_lights, "spectrum": spectra}  # fmt: skip


def measure_change(what, change, args):
    """Yield a row for each value; their pictures take turns with the scene as it is."""
    model, scene, values, against, draw_truth = change
    options = {"shading": "phong", "samples": 4, "threads": args.threads}
    pictures = {name: (changed, args.size, options | own) for name, (changed, own) in values.items()}
    ms = measure.medians({"": (scene, args.size, options)} | pictures, 0.2 * args.seconds, 15)
    size, samples = (args.size, 4) if draw_truth else (min(args.size, RAYS), 1)
    if draw_truth:
        truth = draw_truth(size, samples)
    else:
        by_rays = reference.render(scene, size, shading="phong")
        truth = Light(by_rays.color * by_rays.alpha[..., None], by_rays.alpha)
    for name, (changed, own) in values.items():
        error = measure_errors(draw(changed, size, samples, **own), truth)
        yield {"model": model, "what": what, "value": name, "ms": ms[name],
               "ratio": ms[name] / ms[""], **errors_of(error), "against": against}  # fmt: skip


main = measure.script("choices", __doc__, add_arguments, measure_choices)

if __name__ == "__main__":
    sys.exit(main())
