"""Random scenes over every light, model, texture, layer, camera and unit keep every promise; see campaign.py."""

import os
from collections import Counter
from functools import cache

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.campaign import climb, find_faults, report
from helpers.campaign_scenes import DEFAULT_RUN, make_case

from rasterizer.choices import CULLS, DISTRIBUTIONS, REFLECTIONS
from rasterizer.scene.texture import FILTERS, WRAPS

SEED = 8
N_CASE = int(os.environ.get("RASTERIZER_FUZZ_CASES", DEFAULT_RUN))
NIGHTLY = 3000
MANY = 400  # lights: with thousands a picture of 12 pixels takes a minute, which is the night's
N_SHOWN = 12  # faults, at most
MIN_SINGLE = 0.25  # share of the pictures that are lit in float32
N_CLIMB, N_STEP = 24, 80
LIGHTS = ("AmbientLight", "DirectionalLight", "PointLight", "SpotLight", "AreaLight")


def told(faults) -> str:
    """The first faults, in words; the first line says what is wrong in the first of the scenes."""
    first = faults[0].splitlines() if faults else ["", ""]
    return f"{first[1].strip()} ({len(faults)} scenes at fault, the first is {first[0]})\n" + "\n".join(
        faults[:N_SHOWN]
    )


@cache
def default_case(index):
    """One of the scenes of the default run."""
    return make_case(SEED, index)


def check_cases(indices, most_lights) -> None:
    """Draw scenes with their own tolerance, with tolerance 0, and by the reference."""
    faults, n_single, n_compared, n_step, n_case = [], 0, 0, 0, 0
    for index in indices:
        case = default_case(index) if index < DEFAULT_RUN else make_case(SEED, index)
        if len(case.scene.lights) > most_lights:
            continue
        outcome = find_faults(case)
        n_case, n_single = n_case + 1, n_single + (outcome.dtype == np.float32)
        n_compared, n_step = n_compared + outcome.n_compared, n_step + outcome.n_step
        if outcome.faults:
            faults.append(report(case, outcome))
    assert not faults, told(faults)
    assert n_single >= MIN_SINGLE * n_case, f"{n_single} of {n_case} pictures in float32 < {MIN_SINGLE:.0%}"
    assert n_step <= 0.002 * n_compared, f"{n_step} of {n_compared} pixels left out, next to a step"


def test_random_scenes_keep_their_promises():
    check_cases(range(N_CASE), MANY)


@pytest.mark.nightly
def test_many_more_random_scenes_keep_their_promises():
    check_cases([86, *range(DEFAULT_RUN, NIGHTLY)], np.inf)  # scene 86 has 8047 lights


def features_of(case):
    """Yield what a case has."""
    scene, options = case.scene, case.options
    yield from (f"{name}={options[name]}" for name in ("shading", "samples", "cull", "color_range"))
    yield from (name for name in ("exposure", "spectral") if options[name])
    yield "tolerance 0" if options["tolerance"] == 0 else "a tolerance"
    yield from (word for word in ("inside", "near", "far", "skew", "specks", "slivers", "floor") if word in case.words)
    camera = "calibrated" if scene.camera.intrinsics else "perspective" if scene.camera.is_perspective else "parallel"
    yield from (camera, "depth cue" if scene.depth_cue else "no cue", "background" if scene.background else "none")
    for light in scene.lights:
        kind = type(light).__name__
        yield kind
        yield from (f"{kind}, {name}" for name in ("amplify", "range", "shadow") if getattr(light, name, None))
        yield from (f"{kind}, camera" for _ in "1" if getattr(light, "attached", "") == "camera")
        yield from (f"{kind}, weakened" for _ in "1" if getattr(light, "attenuation", (1, 0, 0)) != (1, 0, 0))
        yield from (name for name, usual in (("falloff", 1), ("exponent", 0)) if getattr(light, name, usual) != usual)
        yield "a spectrum" if hasattr(light.color, "wavelengths") else "a colour"
    for mesh in scene.meshes:
        yield from (name for name in ("colors", "face_colors", "normals") if getattr(mesh, name) is not None)
        yield f"weighting={mesh.weighting}"
        for material in mesh.palette:
            yield material.reflection
            yield from (f"{material.reflection}, F0" for _ in "1" if material.fresnel is not None)
            yield from (f"{material.reflection}, normalised" for _ in "1" if material.normalized)
            yield "cook-torrance, " + ("brushed" if np.size(material.roughness) > 1 else material.distribution)
            yield from (name for name in ("metallic", "metallic_roughness") if getattr(material, name))
            yield "opaque" if material.is_opaque else "clear"
            if material.texture is not None:
                yield from (material.texture.filter, *material.texture.wrap)


WANTED = {
    *LIGHTS, *(f"{kind}, camera" for kind in LIGHTS[1:]), *(f"{kind}, shadow" for kind in LIGHTS[1:]),
    *(f"{kind}, {look}" for kind in LIGHTS[2:] for look in ("amplify", "range", "weakened")), "falloff", "exponent",
    *REFLECTIONS, *(f"{model}, F0" for model in REFLECTIONS), "phong, normalised", "blinn, normalised",
    *(f"cook-torrance, {name}" for name in (*DISTRIBUTIONS, "brushed")), *FILTERS, *WRAPS, "clear", "a spectrum",
    "shading=flat", "shading=gouraud", "shading=phong", *(f"samples={n}" for n in (1, 4, 9, 16)),
    *(f"cull={name}" for name in CULLS),
    "color_range=local", "color_range=global", "exposure", "spectral", "tolerance 0",
    "inside", "near", "far", "skew", "specks", "slivers", "floor", "calibrated", "perspective", "parallel",
    "depth cue", "background", "colors", "face_colors", "normals", "weighting=area", "weighting=uniform",
    "metallic", "metallic_roughness",
}  # fmt: skip


def test_the_default_scenes_hold_everything():
    """What none of the first scenes has, no default run tests: `make_case` sees to it by the scene's number."""
    counts = Counter()
    for index in range(DEFAULT_RUN):
        case = default_case(index)
        if len(case.scene.lights) <= MANY:
            counts.update(set(features_of(case)))
    missing = [name for name in sorted(WANTED) if counts[name] == 0]
    assert not missing, f"no scene has {missing}; they have {dict(counts)}"


@pytest.mark.nightly
def test_nobody_climbs_above_a_bound():
    """From the scenes whose errors come nearest to their bounds, numbers are changed a little, and what raises the
    error is kept."""
    heights = []
    for index in range(400):
        outcome = find_faults(make_case(SEED + 1, index))
        heights.append((min(outcome.ratio, 1.0), index) if outcome.dtype == np.float32 else (0.0, index))
    faults = []
    for _, index in sorted(heights, reverse=True)[:N_CLIMB]:
        case, outcome = climb(make_case(SEED + 1, index), N_STEP)
        if outcome.faults:
            faults.append(report(case, outcome, f" {index + 1} {N_STEP}"))
    assert not faults, told(faults)


def test_cases_are_what_their_numbers_say():
    """The same two numbers make the same picture, another index another one."""
    one, same, other = make_case(SEED, 5), make_case(SEED, 5), make_case(SEED, 6)
    assert one.words == same.words and one.options == same.options and one.scene.lights == same.scene.lights
    assert not differences(one.scene.meshes[0].vertices, same.scene.meshes[0].vertices)
    assert one.words != other.words
