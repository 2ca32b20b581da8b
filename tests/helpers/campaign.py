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
from contextlib import ExitStack
from dataclasses import replace
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

import rasterizer as rz
from helpers.against_reference import EXACT, TEXTURED, clear_pixels, color_errors, depth_resolution
from helpers.campaign_scenes import Case, make_case
from rasterizer import reference
from rasterizer.engine.domains import SHORT_NORMAL
from rasterizer.options import DEFAULT_TOLERANCE
from rasterizer.reference import lamp as lamps
from rasterizer.reference import shading
from rasterizer.reference.light import to_viewer
from rasterizer.reference.reflection import channels_of
from rasterizer.reference.vectors import blend, dot
from rasterizer.vectors import length, unit

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
    the reference's than the stated bounds; within one level of 8 bits with the default tolerance. What holds between
    pictures is in relations.py.
    """
    scene, size, options = case.scene, case.size, case.options
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        frame, dtype = draw(case)
        exact, _ = draw(case, tolerance=0.0)
        faults = check_alone(case, frame) + check_alone(case, exact, "with tolerance 0, ")
    faults += sorted({f"a warning: {warning.message}" for warning in caught})
    if has_shadows(scene):
        return Outcome(faults + check_shadows(case, frame, exact), dtype, 0.0, 0, 0)
    settings = {name: value for name, value in options.items() if name != "tolerance"}
    with np.errstate(all="ignore"):
        expected = reference.render(scene, size, **settings)
    found, is_clear = check_surfaces(case, frame, exact, expected)
    if found:
        return Outcome(faults + found, dtype, np.inf, 0, 0)
    faults += check_buffers(case, expected, is_clear) + check_edges(case)
    ratios = output_ratios(frame, expected, is_clear)
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
    most, bound = max(exact_of(case), 0.0 if which else case.options["tolerance"]), frame.stats.error_bound
    if bound is not None and not bound <= most:
        faults.append(f"{which}the stated bound is {bound:.3g} > {most:.3g}")
    if (bound is None) != any(step[0].startswith("no bound is stated") for step in frame.stats.steps):
        faults.append(f"{which}the stated bound is {bound}, and no reason is given, or one for nothing")
    if not (0.0 <= frame.alpha.min() and frame.alpha.max() <= 1.0):
        faults.append(f"{which}alpha is within {frame.alpha.min()}..{frame.alpha.max()}")
    return faults


def exact_of(case) -> float:
    """What tolerance 0 promises."""
    return TEXTURED if any(each.textures for mesh in case.scene.meshes for each in mesh.palette) else EXACT


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


def check_buffers(case, expected, is_clear) -> list:
    """Every fourth scene's other buffers: labels to the last bit, what is interpolated as float32 rounds it.

    The weights are quotients of whole numbers times 1/w, which is a line in z: off by 2^-50 of the largest 1/w for
    each, so by 2^-50·(far/near) of itself. Far/near is below 2^20 where it is clear which surface is in front.
    """
    if case.options["samples"] > 1 or case.index % 4:
        return []
    with_all, _ = draw(case, outputs=(*OUTPUTS, *LABELS, *MEANS, "normal_camera"))
    is_seen, faults = is_clear & (expected.face >= 0), []
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
    promised = exact_of(case) * max(np.abs(expected.color).max(), 1.0)  # of full scale
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


# ── pixels next to a step ──────────────────────────────────────────────────────────────────────────────────


# Words that the causes of `frame.stats.steps` are known by.
LEVELS, GRAZES, HALF, AWAY, CONE = "toon", "grazes", "half vector", "looks away from the viewer, N·H = 0", "sharp spot"
BASE = "exponent below 1"
OPPOSITE = "opposite to him"
TEXELS, NEAR_LIGHT, SHORT, SHADOW = "texels", "light on a surface", "mean of normals without length", "shadow"
CAUSES = (LEVELS, GRAZES, HALF, AWAY, OPPOSITE, CONE, TEXELS, NEAR_LIGHT, SHADOW, BASE)


def next_to_step(case, steps) -> np.ndarray:
    """Tell which pixels (h, w) have a sample next to one of the steps (cause, near, unit) that a frame states."""
    near = {SHORT: SHORT_NORMAL} if case.options["shading"] == "phong" else {}
    for cause, distance, _ in steps:
        if not np.isfinite(distance):
            continue  # no step, but why nothing is stated
        (word,) = (word for word in CAUSES if word in cause)
        near[word] = max(distance, near.get(word, 0.0))
    if not near:
        return np.zeros((case.size[1], case.size[0]), bool)
    marker = Marker(near)
    settings = {name: value for name, value in case.options.items() if name != "tolerance"}
    with ExitStack() as stack, np.errstate(all="ignore"):
        for name in ("light_points", "sample_normals", "sample_texture"):
            stack.enter_context(patch.object(shading, name, getattr(marker, name)))
        color = reference.render(case.scene, case.size, **settings).color
    return ~np.isfinite(color).all(axis=-1)


class Marker:
    """Stands in for functions of the reference, and marks what lies next to a step with NaN.

    `near` is a dict from a cause's word to how near to it no bound holds.
    """

    def __init__(self, near: dict):
        self.near = near
        self._normals, self._light, self._texels = shading.sample_normals, shading.light_points, shading.sample_texture
        self._is_short = None  # of the samples whose normals were found last

    def sample_normals(self, surface, part, *others):
        """Normals, remembering which of them were interpolated to almost nothing."""
        if SHORT in self.near:
            self._is_short = length(blend(part.weights, surface.normals[part.face]))[:, 0] < self.near[SHORT]
        return self._normals(surface, part, *others)

    def sample_texture(self, texture, uv, steps):
        """Texels; NaN next to the border of one."""
        texels = self._texels(texture, uv, steps)
        if TEXELS in self.near and texture.filter == "nearest":
            height, width = texture.image.shape[:2]
            places = np.stack([uv[:, 0] * width, (1.0 - uv[:, 1]) * height], axis=1)
            texels[(np.abs(places - np.rint(places)) <= self.near[TEXELS]).any(axis=1)] = np.nan
        return texels

    def light_points(self, at, lighting):
        """Both parts of the light; NaN next to a step."""
        diffuse, specular = self._light(at, lighting)
        points, normals, material = at[:3]
        is_near = np.zeros(len(points), bool)
        if self._is_short is not None and len(self._is_short) == len(points):
            is_near |= self._is_short
            self._is_short = None
        table, view_dirs = lighting.materials[material], to_viewer(points, lighting)
        for lamp in lamps.make_lamps(lighting.lights, lighting.view, lambda color: channels_of(color, lighting.n_wave)):
            to_light, _ = lamps.lamp_type_of(lamp.light).attenuate(lamp, points)
            if NEAR_LIGHT in self.near and lamp.position is not None:
                is_near |= length(lamp.position - points)[:, 0] < self.near[NEAR_LIGHT]
            if CONE in self.near and hasattr(lamp.light, "outer"):
                inner, outer = np.cos(np.radians([lamp.light.inner, lamp.light.outer]))
                cosines, near = -dot(to_light, lamp.axis), self.near[CONE]
                is_edge = (outer - near <= cosines) & (cosines <= (inner if inner - outer < near else outer) + near)
                is_near |= is_edge
            is_near |= self._is_near_model_step(table, normals, to_light, view_dirs)
        return np.where(is_near[:, None], np.nan, diffuse), specular

    def _is_near_model_step(self, table, normals, to_light, view_dirs):
        """Tell of points whether their material's model jumps near them, (n,) bool."""
        model, near = table["reflection"], self.near
        is_near = np.zeros(len(table), bool)
        n_dot_l = dot(normals, to_light)
        if LEVELS in near:
            steps = table["levels"] * n_dot_l
            mirrored = dot(2 * n_dot_l[:, None] * normals - to_light, view_dirs)
            is_at = np.abs(steps - np.rint(steps)) <= table["levels"] * near[LEVELS]
            is_at |= np.abs(mirrored - 0.5 ** (1 / table["shininess"])) <= near[LEVELS]
            is_near |= (model == "toon") & is_at
        if GRAZES in near:
            is_near |= np.isin(model, ("phong", "blinn")) & ~table["normalized"] & (np.abs(n_dot_l) <= near[GRAZES])
        if BASE in near:
            halves = dot(normals, unit(to_light + view_dirs))
            bases = np.where(model == "blinn", halves, dot(2 * n_dot_l[:, None] * normals - to_light, view_dirs))
            is_begun = np.isin(model, ("phong", "blinn")) & (table["shininess"] < 1.0)
            is_near |= is_begun & (np.abs(bases) <= near[BASE])
        if HALF in near:
            is_near |= (model == "blinn") & (length(to_light + view_dirs)[:, 0] < near[HALF])
        if OPPOSITE in near:
            is_near |= (model == "cook-torrance") & (length(to_light + view_dirs)[:, 0] < near[OPPOSITE])
        if AWAY in near:
            is_near |= (model == "cook-torrance") & (np.abs(dot(normals, unit(to_light + view_dirs))) <= near[AWAY])
        return is_near


# ── bounds of the other outputs ────────────────────────────────────────────────────────────────────────────


DEPTH, NORMAL = 1e-6, 2.0**-22  # of exact buffers: of a depth itself, and of a component of a normal


def output_ratios(frame, expected, is_clear) -> dict[str, float]:
    """Return the largest error of each exact buffer over what is said of it, {name: ratio}.

    Compared are pixels in which it is clear which surface is in front.

    Parameters
    ----------
    frame : with all outputs
    expected : reference.Picture
    is_clear : (height, width) bool, of the pixels' centres
    """
    is_seen = is_clear & (expected.face >= 0)
    found = {"face": largest((frame.face != expected.face)[is_seen], 0.0)}
    depth, true = frame.depth[is_seen].astype(float), expected.depth[is_seen]
    found["depth"] = largest(np.abs(depth - true) / np.abs(true), DEPTH)
    normal = np.abs(frame.normal - expected.normal).max(axis=-1)
    is_unit = is_seen & (np.linalg.norm(expected.normal, axis=-1) > 0.5)
    found["normal"] = largest(normal[is_unit], NORMAL)
    return found


def largest(errors, bound) -> float:
    """Return the largest error over its bound; 0 where both are 0."""
    error = float(errors.max(initial=0.0))
    return error / bound if bound else (np.inf if error else 0.0)


# ── cases that differ a little from others ─────────────────────────────────────────────────────────────────


def mutated(case, rng):
    """A case whose numbers differ a little, or one of them a lot."""
    scene, options = case.scene, dict(case.options)
    step = 10.0 ** rng.uniform(-4, 0)
    kind = rng.choice(["lights", "light", "normals", "vertices", "material", "camera", "tolerance"])
    if kind in ("lights", "light"):
        one = rng.integers(len(scene.lights)) if kind == "light" and scene.lights else None
        center, extent = scene.bounds.mean(axis=0), np.ptp(scene.bounds, axis=0).max()
        lights = [
            _mutated_light(light, rng, step, center, extent) if one in (None, number) else light
            for number, light in enumerate(scene.lights)
        ]
        scene = replace(scene, lights=lights)
    elif kind == "tolerance":
        options["tolerance"] = float(np.clip(options["tolerance"] * 10.0 ** rng.normal(0, 0.5), 1e-6, 0.1))
    elif kind == "camera":
        camera, turn = scene.camera, step * rng.normal(size=(2, 3))
        away = np.linalg.norm(np.subtract(camera.position, camera.target))
        scene = replace(
            scene, camera=replace(camera, position=camera.position + away * turn[0], up=camera.up + 0.1 * turn[1])
        )
    else:
        scene = replace(scene, meshes=[_mutated_mesh(mesh, rng, step, kind) for mesh in scene.meshes])
    return case._replace(scene=scene, options=options)


def _mutated_light(light, rng, step, center, extent):
    light = _jolted_light(light, rng, step, center, extent)
    changes = {}
    if hasattr(light, "color") and not hasattr(light.color, "wavelengths"):
        changes["color"] = np.multiply(light.color, np.exp(0.3 * step * rng.normal()))
    if getattr(light, "range", None) is not None:
        changes["range"] = light.range * np.exp(step * rng.normal())
    if isinstance(light, rz.SpotLight):
        changes["exponent"] = light.exponent * np.exp(step * rng.normal())
        changes["inner"] = float(np.clip(light.inner + 5 * step * rng.normal(), 0, light.outer))
    return replace(light, **changes)


def _mutated_mesh(mesh, rng, step, kind) -> rz.Mesh:
    if kind == "vertices":
        extent = np.ptp(mesh.bounds, axis=0).max()
        return replace(mesh, vertices=mesh.vertices + step * extent * rng.normal(size=mesh.vertices.shape))
    if kind == "normals":
        if mesh.normals is None:
            return mesh
        return replace(mesh, normals=mesh.normals + step * rng.normal(size=mesh.normals.shape))
    palette = [_mutated_material(material, rng, step) for material in mesh.palette]
    return replace(mesh, material=palette[0], materials=palette if mesh.materials is not None else None)


def _mutated_material(material, rng, step) -> rz.Material:
    changes = {"shininess": float(np.clip(material.shininess * np.exp(2 * step * rng.normal()), 0.05, 1e6))}
    if np.size(material.roughness) == 1:
        least = 0.001 if material.reflection == "cook-torrance" else 0.0
        changes["roughness"] = float(np.clip(material.roughness * np.exp(step * rng.normal()), least, 1.0))
    if not hasattr(material.specular, "wavelengths"):
        changes["specular"] = np.clip(np.add(material.specular, 0.1 * step * rng.normal()), 0.0, 1.0)
    return replace(material, **changes)


def _jolted_light(light, rng, jolt, center, extent):
    """A light moved by a little, as seen from the scene."""
    changes = {}
    for name in ("position", "corner"):
        if hasattr(light, name):
            place = np.array(getattr(light, name))
            away = extent + np.linalg.norm(place - (center if light.attached == "world" else 0.0))
            changes[name] = place + jolt * away * rng.normal(size=3)
    if hasattr(light, "direction"):
        changes["direction"] = light.direction + jolt * rng.normal(size=3)
    return replace(light, **changes) if changes else light


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
