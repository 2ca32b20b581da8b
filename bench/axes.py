"""What else decides about time and error, where a scene has it: shadow maps, area lights, textures, spectra.

    python bench/axes.py models/still_life.obj --seconds 20

One thing is changed at a time; the rest stays what the scene says. Each is compared with the same picture in which that
thing isn't saved at.
"""

import argparse
import math
import sys
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # a checkout need not be installed
import rasterizer as rz
from bench import measure
from bench.ray_truth import RayTruth, draw_by_rays, only
from rasterizer import (
    AmbientLight,
    AreaLight,
    DirectionalLight,
    Material,
    Mesh,
    Renderer,
    Scene,
    Shadow,
    SpotLight,
    Texture,
)
from rasterizer.analysis.speed_error import Errors, Light, draw_ground_truth, draw_light, measure_errors
from rasterizer.analysis.timing import take_turns
from rasterizer.choices import REFLECTIONS, Filter
from rasterizer.engine.shadow_maps import MAX_TEXELS
from rasterizer.scene.lights import Light as Lamp
from rasterizer.scene.lights import with_shadows

_SIZES = (256, 512, 1024, 2048, 4096)
_FILTERS = (1, 3, 5)
_CELLS = (1, 2, 4, 8)
_WAVES = (5, 9, 21, 41, 81)
_FINEST_MAPS = (8192, 4096, 2048, 1024, 512)
_FINEST_AREA, _FINEST_SHADOWED_AREA, _FINEST_SPECTRUM = 64, 12, 401
_MAX_ROUNDS = 15


class Variant(NamedTuple):
    """A scene in which one thing is changed, and options that go with it."""

    value: str
    scene: Scene
    options: dict


class Axis(NamedTuple):
    """One thing that is changed.

    Attributes
    ----------
    name : text
    against : what the errors are measured against, in words; "" where there is nothing: another look is no error
    variants : list of Variant
    finest : Variant that the errors are measured against; None = the ground truth of the scene, or nothing
    is_of_shadows : whether rays tell what is right, as far as the time suffices; `finest` where it doesn't
    """

    name: str
    against: str
    variants: list[Variant]
    finest: Variant | None
    is_of_shadows: bool = False


class AxisRow(NamedTuple):
    """What one value of an axis costs: milliseconds, the same as a multiple of the scene's own, and the error."""

    axis: str
    value: str
    ms: float
    ratio: float
    error: Errors | None
    against: str


class AxisStudy(NamedTuple):
    """What `measure_axes` returns: a row for each value of each axis, and the names of axes that there was no time
    for."""

    rows: list[AxisRow]
    left_out: list[str]


def list_axes(scene: Scene, options: dict) -> list[Axis]:
    """List what can be changed in a scene; options are those of `rasterizer.render`."""
    return [axis for axis in (_shadow_size(scene), _shadow_filter(scene), _area(scene), _texture(scene),
                              _spectrum(scene, options), _reflection(scene))
            if axis is not None]  # fmt: skip


def measure_axes(
    scene: Scene,
    size: tuple[int, int],
    seconds: float,
    progress: Callable[[int, int, str], None],
    truth: Light | None = None,
    limit: float = math.inf,
    **options: Any,
) -> AxisStudy:
    """Measure every value of every axis, by Phong's shading with 4 samples a pixel and the default tolerance.

    Shadows are compared with rays, in tiles of the picture: as many as half of the time allows.

    Parameters
    ----------
    scene : Scene
    size : (width, height) in pixels
    seconds : time in which calls take turns, and rays are followed, of all axes together
    progress : is called with the number of axes done, that of all, and the name of the one that is begun
    truth : the ground truth, where `study` has drawn it; None = it is drawn
    limit : seconds, but for compiling kernels and preparing scenes, after which no further axis is begun
    options : further options of `rasterizer.render`
    """
    options = options | {"shading": "phong", "samples": 4}
    axes, rows = list_axes(scene, options), list[AxisRow]()
    truth = draw_ground_truth(scene, size, **options) if truth is None else truth
    rays = None
    if any(axis.is_of_shadows for axis in axes):
        progress(0, len(axes), "shadows by rays")
        seconds *= 0.5
        limit -= seconds
        settings = {name: options[name] for name in ("cull", "exposure", "spectral") if name in options}
        rays = draw_by_rays(scene, size, options["samples"], seconds, **settings)
    for done, axis in enumerate(axes):
        if limit <= 0.0:
            return AxisStudy(rows, [each.name for each in axes[done:]])
        progress(done, len(axes), axis.name)
        expected = _truth_of(axis, size, options, rays, truth)
        found, spent = _measure_axis(axis, _Look(scene, size, options), seconds / len(axes), expected)
        rows += found
        limit -= spent
    return AxisStudy(rows, [])


class _Look(NamedTuple):
    """What all values of an axis are drawn with."""

    scene: Scene
    size: tuple[int, int]
    options: dict


class _Truth(NamedTuple):
    """What an axis' pictures are compared with."""

    light: Light
    against: str  # in words
    is_known: NDArray[np.bool_] | None = None  # (height, width); None = everywhere


def _measure_axis(
    axis: Axis, look: _Look, seconds: float, truth: _Truth | None
) -> tuple[list[AxisRow], float]:  # fmt: skip
    """Return a row for each value, and the seconds that their pictures took; they take turns with the scene as it
    is."""
    (scene, size, options), rows = look, list[AxisRow]()
    with ExitStack() as stack:
        calls = {}
        for variant in (Variant("", scene, {}), *axis.variants):
            settings = options | variant.options | {"outputs": ("rgb",)}
            calls[variant.value] = stack.enter_context(Renderer(variant.scene, size, **settings)).render
            calls[variant.value]()  # compiles and allocates
        turns = {value: times for value, (times, _) in take_turns(calls, seconds, _MAX_ROUNDS).items()}
    for variant in axis.variants:
        error = None
        if truth is not None:
            found = draw_light(variant.scene, size, **options | variant.options)
            error = measure_errors(found if truth.is_known is None else only(found, truth.is_known), truth.light)
        ratio = float(np.median(turns[variant.value] / turns[""]))
        against = "" if truth is None else truth.against
        rows.append(AxisRow(axis.name, variant.value, ratio * float(np.median(turns[""])), ratio, error, against))
    n_draw = len(turns[""]) + 2  # one compiles, one is compared
    return rows, n_draw * sum(float(np.median(times)) for times in turns.values()) / 1000.0


def _truth_of(
    axis: Axis, size: tuple[int, int], options: dict, rays: RayTruth | None, truth: Light
) -> _Truth | None:  # fmt: skip
    """What an axis' pictures are compared with."""
    if axis.is_of_shadows and rays is not None:
        return _Truth(rays.light, f"rays, in {100.0 * rays.share:.3g} % of the picture", rays.is_known)
    if axis.finest is not None:
        settings = options | axis.finest.options | {"tolerance": 0.0}
        return _Truth(draw_light(axis.finest.scene, size, **settings), axis.against)
    return _Truth(truth, axis.against) if axis.against else None


def _changed_lights(scene: Scene, change: Callable[[Lamp], Lamp]) -> Scene:
    return replace(scene, lights=tuple(change(light) for light in scene.lights))


def _with_shadow(scene: Scene, **fields: int) -> Scene:
    """A scene whose shadows have other fields."""
    lights = with_shadows(scene.lights, lambda own: replace(own, **fields) if own else own)
    return replace(scene, lights=lights)


def _shadows(scene: Scene) -> list[Shadow]:
    shadows = (getattr(light, "shadow", None) for light in scene.lights)
    return [shadow for shadow in shadows if shadow is not None]


def _fits(scene: Scene) -> bool:
    """Whether the shadow maps of a scene are within what the renderer allows, six counted of each point light."""
    n_texel = 0
    for light in scene.lights:
        shadow = getattr(light, "shadow", None)
        if shadow is not None:
            n_cell = math.prod(getattr(light, "resolution", (1, 1)))
            n_texel += n_cell * shadow.size**2 * (1 if isinstance(light, (DirectionalLight, SpotLight)) else 6)
    return n_texel <= 0.9 * MAX_TEXELS  # the rest is for what stands beside the texels


def _shadow_axis(scene: Scene, name: str, variants: Iterable[Variant]) -> Axis | None:
    """What changes shadows, against rays or the largest maps."""
    size = next((size for size in _FINEST_MAPS if _fits(_with_shadow(scene, size=size))), None)
    variants = [variant for variant in variants if _fits(variant.scene)]
    if not _shadows(scene) or size is None or not variants:
        return None
    finest = Variant("finest", _with_shadow(scene, size=size, filter=1), {})
    return Axis(name, f"maps of {size}², unfiltered", variants, finest, True)


def _shadow_size(scene: Scene) -> Axis | None:
    sizes = sorted({*_SIZES, *(shadow.size for shadow in _shadows(scene))})
    return _shadow_axis(scene, "shadow map", [Variant(f"{n}²", _with_shadow(scene, size=n), {}) for n in sizes])


def _shadow_filter(scene: Scene) -> Axis | None:
    found = [Variant(f"{n} x {n}", _with_shadow(scene, filter=n), {}) for n in _FILTERS]
    return _shadow_axis(scene, "shadow filter", found)


def _area(scene: Scene) -> Axis | None:
    areas = [light for light in scene.lights if isinstance(light, AreaLight)]
    if not areas:
        return None

    def divided(n: int) -> Scene:
        return _changed_lights(
            scene, lambda light: replace(light, resolution=(n, n)) if isinstance(light, AreaLight) else light
        )

    # The cells of a light that casts shadows have maps each.
    finest = _FINEST_AREA
    if any(light.shadow is not None for light in areas):
        finest = next((n for n in range(_FINEST_SHADOWED_AREA, 0, -1) if _fits(divided(n))), 0)
    variants = [Variant(f"{n} x {n} cells", divided(n), {}) for n in _CELLS if n < finest]
    if not variants:
        return None
    return Axis("area light", f"{finest} x {finest} cells", variants, Variant("finest", divided(finest), {}))


def _texture(scene: Scene) -> Axis | None:
    materials = [material for mesh in scene.meshes for material in mesh.palette]
    if all(material.texture is None for material in materials):
        return None

    def filtered(word: Filter) -> Scene:
        return _changed_materials(
            scene,
            lambda m: replace(m, texture=replace(m.texture, filter=word)) if isinstance(m.texture, Texture) else m,
        )

    return Axis(
        "texture filter", "64 samples a pixel", [Variant(word, filtered(word), {}) for word in get_args(Filter)], None
    )


def _spectrum(scene: Scene, options: dict) -> Axis | None:
    colors: list[Any] = [light.color for light in scene.lights]
    for mesh in scene.meshes:
        for material in mesh.palette:
            colors += [material.ambient, material.diffuse, material.specular, material.emissive]
    if options.get("spectral") is None and not any(hasattr(color, "wavelengths") for color in colors):
        return None
    variants = [Variant(f"{n} samples", scene, {"spectral": n}) for n in _WAVES]
    finest = Variant("finest", scene, {"spectral": _FINEST_SPECTRUM})
    return Axis("spectrum", f"{_FINEST_SPECTRUM} samples of the spectrum", variants, finest)


def _reflection(scene: Scene) -> Axis | None:
    if all(isinstance(light, AmbientLight) for light in scene.lights):
        return None

    def reflected(word: str) -> Scene:
        return _changed_materials(scene, lambda material: replace(material, reflection=word))

    variants = [Variant(word, reflected(word), {}) for word in REFLECTIONS]
    return Axis("reflection", "", variants, None)


def _changed_materials(scene: Scene, change: Callable[[Material], Material]) -> Scene:
    """A scene whose materials are changed."""

    def changed(mesh: Mesh) -> Mesh:
        palette = tuple(change(material) for material in mesh.palette)
        own: dict[str, Any] = {"material": palette[0]} | ({} if mesh.materials is None else {"materials": palette})
        return replace(mesh, **own)

    return replace(scene, meshes=tuple(changed(mesh) for mesh in scene.meshes))


def main(argv=None) -> int:
    """Run the script; the arguments are those of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path, metavar="MODEL", help="a model or a scene file")
    parser.add_argument("--size", default="640x480", help="of the picture (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=10.0, help="for all pictures (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args(argv)
    width, height = map(int, args.size.split("x"))
    found = measure_axes(rz.load(args.model), (width, height), args.seconds, lambda *_: None, threads=args.threads)
    table = measure.Table([("axis          ", "axis", ""), ("value      ", "value", ""), ("      ms", "ms", ".2f"),
                           (" times", "ratio", ".2f"), ("     rms", "rms", ".2e"), ("   max", "max", ".2f"),
                           ("against", "against", "")])  # fmt: skip
    rows = []
    for row in found.rows:
        error = {"rms": math.nan, "max": math.nan} if row.error is None else row.error._asdict()
        table.print(row._asdict() | error)
        rows.append(row._asdict() | {"error": row.error and row.error._asdict()})
    measure.print_json("axes", measure.Machine(), args, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
