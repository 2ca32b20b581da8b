"""The kernels that tests use most: those of a few small scenes, which are compiled before the first test."""

from collections.abc import Iterator
from itertools import product

import rasterizer as rz
from helpers.mixed_scenes import mixed
from helpers.small_scenes import checks, cube, drawn, floor, scene_of
from rasterizer.compiler import kernels
from rasterizer.engine.kernels_of_plan import list_kernels
from rasterizer.engine.scene_tables import SceneTables
from rasterizer.options import DEFAULT_TOLERANCE, Options

OFTEN = ("transparent", "transparent and textured", "shadows", "texture, nearest")
SOMETIMES = (
    "a file", "depth cueing", "a background, and the local range", "a polygon with ears", "reflection, beckmann",
    "reflection, blinn", "reflection, blinn, with W", "reflection, cook-torrance, with W", "reflection, lambert",
    "reflection, oren-nayar", "reflection, toon",
)  # fmt: skip
BUFFERS = ("color", "depth", "face", "normal", "mask", "object", "material", "uv", "barycentric", "position")
TOLERANCES = (0.0, DEFAULT_TOLERANCE)
ONE, ONCE = {"samples": 1}, {"samples": 4, "antialias": "shade-once"}


def compile_usual_kernels() -> int:
    """Compile them on all cores, as far as they are not in the store; return how many that were.

    What a test needs beside them is compiled when it is met, which takes longer: a process starts for it.
    """
    listed = []
    for scene, options in usual_pictures():
        options = Options(size=4, threads=1, **options)
        listed += list_kernels(SceneTables(scene, options), options, scene.camera_for(options.size))
    missing = kernels.missing_in(kernels.STORE, listed)
    kernels.compile_into(kernels.STORE, missing)
    return len(missing)


def usual_pictures() -> Iterator[tuple[rz.Scene, dict]]:
    """Yield scenes, each with how it is drawn."""
    scenes = drawn()
    flat, gouraud, phong = ({"shading": shading} for shading in ("flat", "gouraud", "phong"))

    def named(name, options):
        scene, own_options = scenes[name]
        return scene, own_options | options

    for tolerance in ({"tolerance": each} for each in TOLERANCES):
        for name, shading in product((*OFTEN, *SOMETIMES), (flat, phong)):
            yield named(name, ONE | shading | tolerance)
        for name, more in product((*OFTEN, "a file"), ({"samples": 4}, ONCE)):
            yield named(name, more | phong | tolerance)
        for name in ("a file", "many lights", "texture, nearest"):
            yield named(name, ONE | gouraud | tolerance)
        yield named("a file", ONE | {"outputs": "rgb"} | tolerance)
        yield named("a file", {"samples": 9} | tolerance)
        camera = rz.Camera.orthographic((2, 2, 3), (0, 0, 0), height=4.0)
        for reflection, normalized, more in product(("phong", "blinn"), (False, True), ({}, {"camera": camera})):
            yield scene_of(cube(reflection=reflection, normalized=normalized), **more), ONE | phong | tolerance
    yield named("a file", {"samples": 16, "tolerance": 0.0})
    yield named("transparent", ONE | phong | {"outputs": BUFFERS})
    yield named("transparent and textured", ONE | phong | {"edges": "all"})
    yield named("transparent and textured", {"samples": 9})
    for name in ("brushed along u", "brushed along (0.0, 1.0, 0.0)"):
        yield named(name, ONE | flat)
    toon, papered, shadows = cube(reflection="toon"), {"texture": checks()}, {"lights": scenes["shadows"][0].lights}
    for tolerance in TOLERANCES:
        yield scene_of(cube(**papered), floor(), **shadows), {"tolerance": tolerance} | ONE | phong
    yield scene_of(toon, floor(**papered)), ONE | phong
    yield scene_of(toon, floor(), **shadows), ONE | phong
    yield mixed()["toon"], ONCE | phong
    yield mixed()["brushed, and textured"], ONCE | gouraud
    yield mixed()["an F0 of a colour"], ONE | flat
