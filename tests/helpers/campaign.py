"""A campaign of random scenes: what is promised about a picture, checked on scenes that nobody has chosen.

    export PYTHONPATH=.:tests
    python -m helpers.campaign SEED INDEX          one scene, and what is wrong with it
    python -m helpers.campaign SEED FIRST STOP     a range of scenes
    python -m helpers.campaign SEED FIRST STOP N   N steps uphill from each of them, towards errors above their bounds
    RASTERIZER_FUZZ_CASES=20000 pytest tests/pictures/test_campaign.py

Each scene is drawn with its own tolerance, with tolerance 0, and by the reference; `find_faults` says which promises
don't hold.
"""

import sys
import warnings
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import rasterizer as rz
from helpers.against_reference import EXACT, clear_pixels, color_errors, depth_resolution
from helpers.campaign_climb import mutated
from helpers.campaign_outputs import output_ratios
from helpers.campaign_scenes import Case, make_case
from helpers.campaign_steps import next_to_step
from rasterizer import reference
from rasterizer.options import DEFAULT_TOLERANCE

OUTPUTS = ("color", "depth", "face", "normal")
LABELS, MEANS = ("mask", "object", "material"), ("uv", "barycentric", "position", "position_camera")
EDGES = ("wire", "crease", "silhouette", ("crease", "silhouette"))
BLACK = {"material": rz.Material(ambient=0, diffuse=0, specular=0), "materials": None}
ROUNDED = 2.0**-23  # relative, of an intensity stored as float32: in the frame, and in its alpha


class Outcome(NamedTuple):
    """What a case shows."""

    faults: list  # of str; empty where all promises hold
    dtype: np.dtype  # in which the picture was lit
    ratio: float  # largest error over its bound, of the samples that are compared
    n_compared: int  # pixels
    n_step: int  # pixels left out because they lie next to a step


def find_faults(case: Case) -> Outcome:
    """Draw a case in all ways, and check what is promised about it.

    Finite, at least 0, covered and ordered as the reference says; no further from the picture with tolerance 0 and from
    the reference's than the stated bounds; within one level of 8 bits with the default tolerance; same bytes with two
    threads.
    """
    scene, size, options = case.scene, case.size, case.options
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        frame, dtype = draw(case)
        exact, _ = draw(case, tolerance=0.0)
        faults = check_alone(case, frame) + check_alone(case, exact, "with tolerance 0, ")
        if case.index % 16 == 0:
            other, _ = draw(case, threads=2)
            if any(
                getattr(frame, name).tobytes() != getattr(other, name).tobytes() for name in (*OUTPUTS, "alpha", "rgb")
            ):
                faults.append("other bytes with two threads")
    faults += sorted({f"a warning: {warning.message}" for warning in caught})
    if has_shadows(scene):
        return Outcome(faults + check_shadows(case, frame, exact), dtype, 0.0, 0, 0)
    settings = {name: value for name, value in options.items() if name != "tolerance"}
    with np.errstate(all="ignore"):
        expected = reference.render(scene, size, **settings)
    found, is_clear = check_surfaces(case, frame, exact, expected)
    if found:
        return Outcome(faults + found, dtype, np.inf, 0, 0)
    faults += check_buffers(case, frame, expected, is_clear) + check_edges(case)
    ratios = output_ratios(case, frame, expected, is_clear, lambda: all_clear(case))
    faults += [f"{name}: the error is {ratio:.3g} times its bound" for name, ratio in ratios.items() if ratio > 1.0]
    outcome = check_colors(case, frame, exact, expected, is_clear, dtype)
    return outcome._replace(faults=faults + outcome.faults)


def draw(case, **others):
    """Draw a case, with some other options; return the frame, and in which dtype it was lit."""
    with rz.Renderer(
        case.scene, case.size, **({"samples": 1} | {"outputs": OUTPUTS, "threads": 1} | case.options | others)
    ) as renderer:
        frame = renderer.render()
        return frame, np.dtype(frame.stats.plan.dtype)


def has_shadows(scene) -> bool:
    """Tell whether any light casts shadows."""
    return any(getattr(light, "shadow", None) is not None for light in scene.lights)


def check_alone(case, frame, which="") -> list:
    """What can be said of a frame without another one."""
    faults = []
    if not np.isfinite(frame.color).all():
        faults.append(f"{which}{(~np.isfinite(frame.color)).sum()} colours are not finite")
    is_hit = frame.face >= 0
    if not np.isfinite(frame.depth[is_hit]).all() or (frame.depth[~is_hit] != np.inf).any():
        faults.append(f"{which}a depth is not finite, or finite where nothing is")
    if frame.color.min() < 0.0 and not has_spectra(case):
        faults.append(f"{which}a colour is {frame.color.min():.3g}")
    most, bound = max(EXACT, 0.0 if which else case.options["tolerance"]), frame.stats.error_bound
    if bound is not None and not bound <= most:
        faults.append(f"{which}the stated bound is {bound:.3g} > {most:.3g}")
    if (bound is None) != any(step[0].startswith("no bound is stated") for step in frame.stats.steps):
        faults.append(f"{which}the stated bound is {bound}, and no reason is given, or one for nothing")
    if not (0.0 <= frame.alpha.min() and frame.alpha.max() <= 1.0):
        faults.append(f"{which}alpha is within {frame.alpha.min()}..{frame.alpha.max()}")
    return faults


def has_spectra(case) -> bool:
    """Tell whether intensities may be negative, because no display shows pure colours of the spectrum."""
    colors = [light.color for light in case.scene.lights]
    for mesh in case.scene.meshes:
        for material in mesh.palette:
            colors += [material.ambient, material.diffuse, material.specular, material.emissive, material.fresnel]
    return case.options["spectral"] is not None or any(hasattr(color, "wavelengths") for color in colors)


def check_shadows(case, frame, exact) -> list:
    """A picture with shadows lies between the one without the lights that cast them, and the one in which they cast
    none.

    Light only adds; so this holds next to the edges of shadows, too, but not for spectra, whose RGB may be negative.
    """
    if has_spectra(case) or case.options["color_range"] == "global":
        return []
    scene, faults = case.scene, []
    dark = replace(scene, lights=[light for light in scene.lights if getattr(light, "shadow", None) is None])
    bare = [light if isinstance(light, rz.AmbientLight) else replace(light, shadow=None) for light in scene.lights]
    bright = replace(scene, lights=bare)
    options = case.options | {"tolerance": 0.0, "outputs": OUTPUTS, "threads": 1}
    low, high = (rz.render(each, case.size, **{"samples": 1} | options) for each in (dark, bright))
    if high.stats.error_bound is None:
        return []
    for name, one in (("its tolerance", frame), ("tolerance 0", exact)):
        if one.stats.error_bound is None:
            continue
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
    for name, one in (("", frame), ("with tolerance 0, ", exact)):
        off = np.abs(one.alpha - expected.alpha)
        is_off = off > 1e-6
        if is_off.any():
            is_off &= all_clear(case) & ~next_to_step(case, one.stats.steps)
        if is_off.any():
            faults.append(f"{name}alpha is off by {off[is_off].max():.3g}")
    resolution = depth_resolution(case.scene, case.size, expected.depth)
    is_clear = expected.margin > resolution
    is_seen = (expected.face >= 0) & is_clear
    wrong = is_seen & (frame.face != expected.face)
    if wrong.any():
        faults.append(f"{wrong.sum()} pixels show the wrong face")
    depth = np.abs(frame.depth[is_seen] / expected.depth[is_seen] - 1)
    if depth.max(initial=0.0) > 1e-6:
        faults.append(f"depths are off by {depth.max():.3g}")
    return faults, is_clear


def check_buffers(case, frame, expected, is_clear) -> list:
    """Every fourth scene's other buffers: labels to the last bit, what is interpolated as float32 rounds it.

    The weights are quotients of whole numbers times 1/w, which is a line in z: off by 2^-50 of the largest 1/w for
    each, so by 2^-50·(far/near) of itself. Far/near is below 2^20 where it is clear which surface is in front.
    """
    if case.options["samples"] > 1 or case.index % 4:
        return []
    with_all, _ = draw(case, outputs=(*OUTPUTS, *LABELS, *MEANS, "normal_camera"))
    is_seen, faults = is_clear & (expected.face >= 0), []
    for name in OUTPUTS:
        if getattr(with_all, name).tobytes() != getattr(frame, name).tobytes():
            faults.append(f"{name} is another one beside other buffers")
    for name in (*LABELS, *MEANS, "normal_camera"):
        found, wanted = with_all.array(name)[is_seen], getattr(expected.surface, name)[is_seen]
        if (np.isnan(found) != np.isnan(wanted)).any():
            faults.append(f"{name} is NaN elsewhere")
        found, wanted = np.nan_to_num(found.astype(float)), np.nan_to_num(wanted.astype(float))
        most = 2.0**-24 * np.abs(wanted) + 2.0**-30 * np.abs(wanted).max(initial=0.0)
        most = 0.0 if name in LABELS else 2.0**-22 if name == "normal_camera" else most
        error = np.abs(found - wanted)
        if (error > most).any():
            faults.append(f"{name} is off by {error.max():.3g} in {(error > most).sum()} values")
    return faults


def check_edges(case) -> list:
    """Every fourth scene's edges, white on black: the reference covers the same share of each pixel, but for a few
    where rounding decides between depths. Left out are units far from 1: depths are kept in float32.
    """
    size = case.size
    if case.index % 4 != 1 or not 1e-5 < float(case.words.split("unit ")[1]) < 1e5:
        return []
    number = case.index // 4
    settings = {"shading": case.options["shading"], "cull": case.options["cull"], "edge_color": "white"}
    settings |= {"edges": EDGES[number % 4], "edge_width": (0.5, 1.0, 2.0, 4.0)[number // 4 % 4]}
    settings["samples"] = case.options["samples"]
    meshes = [replace(mesh, **BLACK, face_material=None) for mesh in case.scene.meshes]
    scene = replace(case.scene, meshes=meshes, lights=(), background=None, depth_cue=None)
    frame = rz.render(scene, size, outputs="color", threads=1, **settings)
    with np.errstate(all="ignore"):
        expected = reference.render(scene, size, **settings)
    shares = [each.color[..., 1] * each.alpha for each in (frame, expected)]
    n_off, most = (np.abs(shares[0] - shares[1]) > 1e-6).sum(), 2 + 0.01 * (shares[1] > 0).sum()
    return [f"edges {settings['edges']} differ in {n_off} > {most:.3g} pixels"] if n_off > most else []


def check_colors(case, frame, exact, expected, is_clear, dtype) -> Outcome:
    """Colours, against the picture with tolerance 0 and against the reference's."""
    scene, faults, worst, n_step = case.scene, [], 0.0, 0
    stored = ROUNDED * np.abs(expected.color)
    promised = EXACT * max(np.abs(expected.color).max(), 1.0)  # of full scale
    bound, least = (np.nan if one.stats.error_bound is None else one.stats.error_bound for one in (frame, exact))
    of_exact, of_both = exact.stats.steps, (*exact.stats.steps, *frame.stats.steps)
    pairs = (
        ("tolerance 0 against the reference", color_errors(scene, exact, expected), promised + stored, of_exact),
        ("against tolerance 0", color_errors(scene, frame, exact), np.full(stored.shape, bound + least), of_both),
        ("against the reference", color_errors(scene, frame, expected), bound + stored, of_both),
    )
    for name, error, limit, steps in pairs:
        is_far = (error > limit).any(axis=-1)
        if is_far.any() and "reference" in name:
            is_far &= is_clear if case.options["samples"] == 1 else all_clear(case)
        if is_far.any():
            is_next = next_to_step(case, steps)
            n_step += (is_far & is_next).sum()
            is_far &= ~is_next
        share = (error / np.maximum(limit, np.finfo(np.float64).tiny)).max(axis=-1)
        share[(share > 1.0) & ~is_far] = 0.0  # not compared
        worst = max(worst, float(share.max(initial=0.0)))
        if is_far.any():
            y, x = np.unravel_index(np.argmax(share), share.shape)
            faults.append(
                f"{name}: {error[y, x].max():.3g} is {share.max():.3g} times the bound, {is_far.sum()} pixels, "
                f"at {x}, {y}"
            )
    if case.options["tolerance"] <= DEFAULT_TOLERANCE and not faults:
        levels = np.abs(frame.rgb.astype(int) - exact.rgb).max(axis=-1)
        is_far = levels > 1
        if is_far.any():
            is_far &= ~next_to_step(case, of_both)
        if is_far.any():
            faults.append(f"{is_far.sum()} pixels differ by up to {levels[is_far].max()} levels")
    return Outcome(faults, dtype, worst, int((expected.alpha > 0).sum()), int(n_step))


def all_clear(case) -> np.ndarray:
    """Tell of which pixels (h, w) every sample shows clearly what is in front."""
    settings = {name: case.options[name] for name in ("shading", "cull", "exposure", "spectral")}
    with np.errstate(all="ignore"):
        return clear_pixels(
            case.scene, case.size, case.options["samples"], lambda grid: reference.render(case.scene, grid, **settings)
        )


# ── climbing, and the command line ────────────────────────────────────────────────────────────────────────


def climb(case: Case, n: int):
    """Change a case's numbers step by step, `n` times, and keep what brings the error nearer to its bound.

    Returns
    -------
    (Case, Outcome) of the highest place; steps that are not legal, or leave nothing to be seen, are not taken
    """
    rng, best = np.random.default_rng((case.seed, case.index, n)), find_faults(case)
    for _ in range(n):
        if best.faults:
            break
        try:  # what isn't legal is told by the scene, or by what draws it: too many lights, say
            neighbour = mutated(case, rng)
            outcome = find_faults(neighbour)
        except rz.RasterizerError:
            continue
        if outcome.faults or (outcome.ratio >= best.ratio and outcome.n_compared > 0):
            case, best = neighbour, outcome
    return case, best


def report(case, outcome, command="") -> str:
    """What a person needs to see a fault again."""
    lines = "".join(f"\n    {fault}" for fault in outcome.faults)
    head = f"seed {case.seed}, scene {case.index}: {case.words}"
    return f"{head}{lines}\n    python -m helpers.campaign {case.seed} {case.index}{command}"


def main(seed, first, stop=None, n_climb=0) -> int:
    """Check one scene or a range of them, from the command line; climb from each."""
    n_fault = 0
    for index in range(first, first + 1 if stop is None else stop):
        case = make_case(seed, index)
        case, outcome = climb(case, n_climb) if n_climb else (case, find_faults(case))
        n_fault += bool(outcome.faults)
        if outcome.faults or stop is None:
            print(report(case, outcome), *([] if outcome.faults else outcome[1:]), flush=True)
    return int(n_fault > 0)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
