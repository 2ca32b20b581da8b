"""A campaign of random scenes: what is promised about a picture, checked on scenes that nobody has chosen.

    python tests/campaign.py SEED INDEX          one scene, and what is wrong with it
    python tests/campaign.py SEED FIRST STOP     a range of scenes
    RASTERIZER_FUZZ_CASES=20000 pytest tests/test_campaign.py

Each scene is drawn with its own tolerance, with tolerance 0, and by the judge; `find_faults` says which promises don't hold.
"""

import sys
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from campaign_scenes import Case, make_case
from judge import EXACT, color_errors, depth_resolution

import rasterizer as rz
from rasterizer import reference
from rasterizer.options import DEFAULT_TOLERANCE

OUTPUTS = ("color", "depth", "face")
UNITS = 2.0**14  # steps of the z-buffer within which two surfaces are equally near, as in `judge.compare`
ROUNDED = 2.0**-23  # relative, of an intensity stored as float32: in the frame, and in its alpha
N_JOLT = 6
JOLTS = {np.dtype(np.float64): 1e-9, np.dtype(np.float32): 4e-6}  # how far a step reaches, relative; see `next_to_step`


class Outcome(NamedTuple):
    """What a case shows."""

    faults: list  # of str; empty where all promises hold
    dtype: np.dtype  # in which the picture was lit
    ratio: float  # largest error over its bound, of the samples that are judged
    n_judged: int  # pixels
    n_step: int  # pixels left out because they lie next to a step


def find_faults(case: Case) -> Outcome:
    """Draw a case in all ways, and check what is promised about it.

    Finite, at least 0, covered and ordered as the judge says; no further from the picture with tolerance 0 and from the
    judge's than the stated bounds; within one level of 8 bits with the default tolerance; same bytes with two threads.
    """
    scene, size, options = case.scene, case.size, case.options
    with rz.Renderer(scene, size, outputs=OUTPUTS, threads=1, **options) as renderer:
        frame = renderer.render()
        plan = renderer._plan_for(scene.camera_for(size).view())
    exact = rz.render(scene, size, outputs=OUTPUTS, threads=1, **(options | {"tolerance": 0.0}))
    dtype = np.dtype(plan.dtype)
    faults = check_alone(case, frame, plan)
    if case.index % 16 == 0:
        other = rz.render(scene, size, outputs=OUTPUTS, threads=2, **options)
        if any(getattr(frame, name).tobytes() != getattr(other, name).tobytes() for name in (*OUTPUTS, "alpha", "rgb")):
            faults.append("other bytes with two threads")
    if faults:
        return Outcome(faults, dtype, np.inf, 0, 0)
    if has_shadows(scene):
        return Outcome(check_shadows(case, frame, exact), dtype, 0.0, 0, 0)
    settings = {name: value for name, value in options.items() if name != "tolerance"}
    with np.errstate(all="ignore"):
        expected = reference.render(scene, size, **settings)
    faults, is_clear = check_surfaces(case, frame, exact, expected)
    if faults:
        return Outcome(faults, dtype, np.inf, 0, 0)
    return check_colors(case, frame, exact, expected, is_clear, dtype)


def has_shadows(scene) -> bool:
    """Tell whether any light casts shadows."""
    return any(getattr(light, "shadow", None) is not None for light in scene.lights)


def check_alone(case, frame, plan) -> list:
    """What can be said of a frame without another one."""
    faults = []
    bound = frame.stats.error_bound
    if not np.isfinite(frame.color).all():
        faults.append(f"{(~np.isfinite(frame.color)).sum()} colours are not finite")
    if np.isnan(frame.depth).any() or (frame.depth[frame.face >= 0] == np.inf).any() or (frame.depth == -np.inf).any():
        faults.append("a depth is not finite")
    is_dark = frame.color.min() < 0.0
    if is_dark and not has_spectra(case):
        faults.append(f"a colour is {frame.color.min():.3g}")
    if not np.isfinite(bound):
        faults.append(f"the stated bound is {bound}")
    if not (0.0 <= frame.alpha.min() and frame.alpha.max() <= 1.0):
        faults.append(f"alpha is within {frame.alpha.min()}..{frame.alpha.max()}")
    return faults


def has_spectra(case) -> bool:
    """Tell whether intensities may be negative, because no display shows pure colours of the spectrum."""
    colors = [light.color for light in case.scene.lights]
    for mesh in case.scene.meshes:
        for material in mesh.palette:
            colors += [material.ambient, material.diffuse, material.specular, material.emissive]
    return case.options["spectral"] is not None or any(hasattr(color, "wavelengths") for color in colors)


def check_shadows(case, frame, exact) -> list:
    """A picture with shadows lies between the one without the lights that cast them, and the one in which they cast none.

    Light only adds; so this holds next to the edges of shadows, too, but not for spectra, whose RGB may be negative.
    """
    if has_spectra(case) or case.options["color_range"] == "global":
        return []
    scene, faults = case.scene, []
    dark = replace(scene, lights=[light for light in scene.lights if getattr(light, "shadow", None) is None])
    bright = replace(scene, lights=[light if isinstance(light, rz.AmbientLight) else replace(light, shadow=None) for light in scene.lights])
    options = case.options | {"tolerance": 0.0, "outputs": OUTPUTS, "threads": 1}
    low, high = (rz.render(each, case.size, **options) for each in (dark, bright))
    for name, one in (("its tolerance", frame), ("tolerance 0", exact)):
        room = one.stats.error_bound + high.stats.error_bound + ROUNDED * np.abs(high.color)
        weight = 1.0 if is_opaque(scene) else frame.alpha[..., None]
        over = weight * np.maximum(one.color - high.color, low.color - one.color) - room
        if over.max() > 0:
            faults.append(f"with {name}, shadows leave what is possible by {over.max():.3g}")
    return faults


def is_opaque(scene) -> bool:
    """Tell whether nothing is seen through any surface."""
    return all(material.is_opaque for mesh in scene.meshes for material in mesh.palette)


def check_surfaces(case, frame, exact, expected):
    """Coverage, faces and depths, exactly where the order of the surfaces is clear; and where that is, (h, w) bool."""
    faults = []
    for name in ("alpha", "face", "depth"):
        if name != "alpha" and (getattr(frame, name) != getattr(exact, name)).any():
            faults.append(f"{name} depends on the tolerance")
    n_wrong = ((frame.face >= 0) != (expected.face >= 0)).sum()
    if n_wrong:
        faults.append(f"{n_wrong} samples covered wrongly")
    if np.abs(frame.alpha - expected.alpha).max() > 1e-6:
        faults.append(f"alpha is off by {np.abs(frame.alpha - expected.alpha).max():.3g}")
    resolution = depth_resolution(case.scene, case.size, expected.depth, UNITS)
    is_clear = expected.margin > resolution
    is_seen = (expected.face >= 0) & is_clear
    wrong = is_seen & (frame.face != expected.face)
    if wrong.any():
        faults.append(f"{wrong.sum()} pixels show the wrong face")
    depth = np.abs(frame.depth[is_seen] / expected.depth[is_seen] - 1)
    if depth.max(initial=0.0) > 1e-6:
        faults.append(f"depths are off by {depth.max():.3g}")
    return faults, is_clear


def check_colors(case, frame, exact, expected, is_clear, dtype) -> Outcome:
    """Colours, against the picture with tolerance 0 and against the judge's."""
    scene, faults, worst, n_step = case.scene, [], 0.0, 0
    full = np.maximum(np.abs(expected.color).max(), 1.0)  # full scale
    stored = ROUNDED * np.abs(expected.color)
    pairs = (
        ("tolerance 0 against the judge", errors(scene, exact, expected), EXACT * full + stored, np.dtype(np.float64)),
        ("its tolerance against tolerance 0", errors(scene, frame, exact), frame.stats.error_bound + exact.stats.error_bound, dtype),
        ("its tolerance against the judge", errors(scene, frame, expected), frame.stats.error_bound + stored, dtype),
    )
    for name, error, bound, kind in pairs:
        is_far = (error > bound).any(axis=-1)
        if is_far.any() and "judge" in name:
            is_far &= is_clear if case.options["samples"] == 1 else clear_pixels(case)
        if is_far.any():
            steps = next_to_step(case, expected, JOLTS[kind], bound)
            n_step += (is_far & steps).sum()
            is_far &= ~steps
        ratio = (error / bound)[is_far] if is_far.any() else np.minimum(error / bound, 1.0)
        worst = max(worst, float(ratio.max(initial=0.0)))
        if is_far.any():
            y, x = np.unravel_index(np.argmax((error / bound).max(axis=-1) * is_far), is_far.shape)
            faults.append(f"{name}: {error[y, x].max():.3g} is {ratio.max():.3g} times the bound, {is_far.sum()} pixels, at {x}, {y}")
    if case.options["tolerance"] <= DEFAULT_TOLERANCE and not faults:
        levels = np.abs(frame.rgb.astype(int) - exact.rgb).max(axis=-1)
        is_far = levels > 1
        if is_far.any():
            is_far &= ~next_to_step(case, expected, JOLTS[dtype], DEFAULT_TOLERANCE)
        if is_far.any():
            faults.append(f"{is_far.sum()} pixels differ by up to {levels[is_far].max()} levels")
    return Outcome(faults, dtype, worst, int((expected.alpha > 0).sum()), int(n_step))


def errors(scene, frame, expected) -> np.ndarray:
    """Differences of linear intensity (h, w, 3)."""
    return color_errors(scene, frame, expected)


def clear_pixels(case) -> np.ndarray:
    """Tell of which pixels (h, w) every sample shows clearly what is in front."""
    settings = {name: case.options[name] for name in ("shading", "cull", "exposure", "spectral")}
    per_axis = round(case.options["samples"] ** 0.5)
    width, height = case.size
    grid = width * per_axis, height * per_axis
    with np.errstate(all="ignore"):
        fine = reference.render(case.scene, grid, samples=1, **settings)
    is_clear = fine.margin > depth_resolution(case.scene, grid, fine.depth, UNITS)
    return is_clear.reshape(height, per_axis, width, per_axis).all(axis=(1, 3))


# ── steps ─────────────────────────────────────────────────────────────────────────────────────────────────


def next_to_step(case, expected, jolt, bound) -> np.ndarray:
    """Tell which pixels (h, w) lie next to a step, where no error is small.

    Steps: the levels of toon, N·L = 0 of highlights that are not weakened by it, sharp cones, the edges of texels without
    filter. The judge draws the scene again with lights, normals and texture coordinates moved by `jolt`, relatively: what
    is continuous moves by a little; next to a step, values jump between groups that lie further apart than each is wide.
    """
    if not has_steps(case):
        return np.zeros(expected.alpha.shape, bool)
    rng = np.random.default_rng(case.index)
    settings = {name: value for name, value in case.options.items() if name != "tolerance"}
    values = [expected.color]
    for _ in range(N_JOLT):
        with np.errstate(all="ignore"):
            values.append(reference.render(jolted(case.scene, rng, jolt), case.size, **settings).color)
    values = np.sort(values, axis=0)
    gaps = np.diff(values, axis=0)
    largest = gaps.max(axis=0)
    rest = gaps.sum(axis=0) - largest
    return ((largest > 4 * rest) & (largest > 0.25 * bound)).any(axis=-1)


def has_steps(case) -> bool:
    """Tell whether anything in a scene jumps."""
    for mesh in case.scene.meshes:
        for material in mesh.palette:
            is_jumping = material.reflection == "toon" or (material.reflection in ("phong", "blinn") and not material.normalized)
            is_nearest = material.texture is not None and material.texture.filter == "nearest"
            if is_jumping or is_nearest:
                return True
    return any(isinstance(light, rz.SpotLight) and light.inner > light.outer * (1 - 1e-3) for light in case.scene.lights)


def jolted(scene, rng, jolt) -> rz.Scene:
    """The scene with lights, normals and texture coordinates moved by a little."""
    center, extent = scene.bounds.mean(axis=0), np.ptp(scene.bounds, axis=0).max()
    lights = [jolted_light(light, rng, jolt, center, extent) for light in scene.lights]
    meshes = []
    for mesh in scene.meshes:
        changes = {}
        if mesh.normals is not None:
            changes["normals"] = mesh.normals + jolt * rng.normal(size=mesh.normals.shape)
        if mesh.uv is not None:
            changes["uv"] = mesh.uv + jolt * rng.normal(size=mesh.uv.shape) * np.maximum(np.abs(mesh.uv), 1)
        meshes.append(replace(mesh, **changes))
    return replace(scene, meshes=meshes, lights=lights)


def jolted_light(light, rng, jolt, center, extent):
    """A light moved by a little, as seen from the scene."""
    changes = {}
    if hasattr(light, "position"):
        away = extent + np.linalg.norm(np.subtract(light.position, center if light.attached == "world" else 0.0))
        changes["position"] = light.position + jolt * away * rng.normal(size=3)
    if hasattr(light, "corner"):
        changes["corner"] = light.corner + jolt * (extent + np.linalg.norm(light.corner)) * rng.normal(size=3)
    if hasattr(light, "direction"):
        changes["direction"] = light.direction + jolt * rng.normal(size=3)
    return replace(light, **changes) if changes else light


def report(case, outcome) -> str:
    """What a person needs to see a fault again."""
    lines = "\n    ".join(outcome.faults)
    return f"seed {case.seed}, scene {case.index}: {case.words}\n    {lines}\n    python tests/campaign.py {case.seed} {case.index}"


def main(seed, first, stop=None) -> int:
    """Check one scene or a range of them, from the command line."""
    n_fault = 0
    for index in range(first, first + 1 if stop is None else stop):
        case = make_case(seed, index)
        outcome = find_faults(case)
        if outcome.faults or stop is None:
            n_fault += bool(outcome.faults)
            print(report(case, outcome), outcome[1:] if stop is None else "", flush=True)
    return int(n_fault > 0)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
