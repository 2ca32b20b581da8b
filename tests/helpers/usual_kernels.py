"""The kernels that tests use most: those of a few small scenes, which are compiled before the first test."""

import rasterizer as rz
from helpers.mixed_scenes import mixed
from helpers.small_scenes import checks, cube, drawn, floor, scene_of
from rasterizer.compiler import kernels

OFTEN = ("transparent", "transparent and textured", "shadows", "texture, nearest")
SCENES = (
    "a file", "depth cueing", "a background, and the local range", "a polygon with ears",
    "reflection, beckmann", "reflection, blinn, with W", "reflection, cook-torrance, with W", "reflection, lambert",
    "reflection, oren-nayar", "reflection, toon",
)  # fmt: skip
BUFFERS = ("color", "depth", "face", "normal", "mask", "object", "material", "uv", "barycentric", "position")
TOLERANCES = (0.0, 1 / 4096)


def compile_usual_kernels() -> int:
    """Compile them on all cores, as far as they are not in the store; return how many that were.

    Which they are is found out by Python, that draws the scenes in four pixels' width. What a test needs beside them is
    compiled when it is met.
    """
    with kernels.noting_needs() as needs:
        scenes = drawn()
        for name in (*OFTEN, *SCENES):
            for shading, tolerance in ((s, t) for s in ("flat", "phong") for t in TOLERANCES):
                _draw(*scenes[name], shading=shading, tolerance=tolerance, samples=1)
        for name, tolerance in ((n, t) for n in (*OFTEN, "a file") for t in TOLERANCES):
            _draw(*scenes[name], shading="phong", tolerance=tolerance, samples=4)
            if name != "shadows" or tolerance:
                _draw(*scenes[name], shading="phong", tolerance=tolerance, samples=4, antialias="shade-once")
        _draw(*scenes["brushed along u"], shading="flat", samples=1)
        _draw(mixed()["brushed, and textured"], {}, shading="gouraud", samples=4, antialias="shade-once")
        papered, shadows = {"texture": checks()}, scenes["shadows"][0].lights
        for tolerance in TOLERANCES:
            _draw(
                scene_of(cube(**papered), floor(), lights=shadows), {}, shading="phong", tolerance=tolerance, samples=1
            )
        toon = cube(reflection="toon")
        for scene in (scene_of(toon, floor(**papered)), scene_of(toon, floor(), lights=shadows)):
            _draw(scene, {}, shading="phong", samples=1)
        _draw(mixed()["toon"], {}, shading="phong", samples=4, antialias="shade-once")
        for tolerance, samples in ((TOLERANCES[1], 9), (0.0, 9), (0.0, 16)):
            _draw(*scenes["a file"], tolerance=tolerance, samples=samples)
        _draw(*scenes["transparent and textured"], samples=9)
        for tolerance in TOLERANCES:
            for name in ("a file", "many lights", "texture, nearest"):
                _draw(*scenes[name], shading="gouraud", tolerance=tolerance, samples=1)
            _draw(*scenes["a file"], tolerance=tolerance, samples=1, outputs="rgb")
        _draw(*scenes["transparent"], shading="phong", samples=1, outputs=BUFFERS)
        _draw(*scenes["transparent and textured"], shading="phong", samples=1, edges="all")
    missing = kernels.missing_in(kernels.STORE, needs)
    kernels.compile_into(kernels.STORE, missing)
    return len(missing)


def _draw(scene, options, **others) -> None:
    rz.render(scene, 4, threads=1, **options | others)
