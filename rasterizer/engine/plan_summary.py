"""The plan of a picture in words and counts, for a person who asks what was done and why."""

from typing import NamedTuple

import numpy as np

from ..errors import counted
from ..pipeline.gradients import IN_ENTRIES, IN_PLANES
from .plan import Plan
from .uniforms import batch_functions_of


class Ways(NamedTuple):
    """Triangles by the way that their attributes took, counted in each band that they meet.

    Parameters
    ----------
    entries : those with intensities in the entries of the visibility buffer
    planes : those with records of planes
    exact : those with exact records
    """

    entries: int
    planes: int
    exact: int


class MaterialNeeds(NamedTuple):
    """What the samples of some materials need.

    Parameters
    ----------
    materials : their numbers, in the order in which the scene has them
    channels : 1 where every colour is a multiple of the picture's tint, else 3
    dtype : "float32" or "float64", the type of the illumination
    reasons : why it is float64; empty for float32
    way : the cheapest way that attributes may take from the vertices to the samples
    lights : how many lights reach them and are reflected; of an area light each of its cells counts
    """

    materials: tuple[int, ...]
    channels: int
    dtype: str
    reasons: tuple[str, ...]
    way: str
    lights: int

    def __repr__(self) -> str:
        why = f" because of {', '.join(self.reasons)}" if self.reasons else ""
        return f"{counted(self.channels, 'channel')}, {self.dtype}{why}; {self.way}; {counted(self.lights, 'light')}"


class PlanSummary(NamedTuple):
    """What a picture needed, and nothing else was computed.

    Parameters
    ----------
    shading : "flat", "gouraud" or "phong"
    channels : 1 where every colour of the picture is a multiple of one RGB triple, else 3
    dtype : the type of the illumination: "float32", or "float64" where all materials need that
    reasons : why some material needs float64; empty where none does
    way : the cheapest way that attributes of any material may take from the vertices to the samples
    needs : what the materials need, those that need the same together
    light_functions : names of the compiled functions of lights, each once
    reflection_functions : the same for reflection models
    features : what else the scene uses: "textures", "shadows", "transparency", "depth cueing", "spectra", "tangents"
    bound : the largest intensity that any point may have, linear
    left_out : how many lights were left out of everything: black ones, and others of which nothing is reflected
    ways : how many triangles took which way; None before anything was drawn
    """

    shading: str
    channels: int
    dtype: str
    reasons: tuple[str, ...]
    way: str
    needs: tuple[MaterialNeeds, ...]
    light_functions: tuple[str, ...]
    reflection_functions: tuple[str, ...]
    features: tuple[str, ...]
    bound: float
    left_out: int = 0
    ways: Ways | None = None

    def __repr__(self) -> str:
        if len(self.needs) == 1:
            lines = [f"{self.shading} shading, {self.needs[0]}"]
        else:
            lines = [f"{self.shading} shading"]
            lines += [f"material{'s' * (len(n.materials) > 1)} {shorten(n.materials)}: {n}" for n in self.needs]
        lines += [
            f"lights: {', '.join(self.light_functions) or 'none but ambient'}",
            f"reflection: {', '.join(self.reflection_functions) or 'none'}",
            f"also: {', '.join(self.features) or 'nothing'}",
            f"largest intensity: {self.bound:.4g}",
        ]
        if self.left_out:
            lines.append(f"left out: {counted(self.left_out, 'light')} that no surface shows")
        if self.ways is not None:
            counts = ", ".join(f"{count} by {name}" for name, count in zip(_WAY_NAMES, self.ways, strict=True))
            lines.append(f"triangles in their bands: {counts}")
        return "\n".join(lines)


MOST_NUMBERS = 8  # of materials that are named in a line


def shorten(numbers: tuple[int, ...]) -> str:
    """Return numbers as text; of many the first ones and how many there are."""
    text = ", ".join(map(str, numbers[:MOST_NUMBERS]))
    return text if len(numbers) <= MOST_NUMBERS else f"{text}, … ({len(numbers)} of them)"


_WAY_NAMES = ("entries", "planes", "exact records")


def summarize(plan: Plan, ways: Ways | None = None) -> PlanSummary:
    """Put a plan into words."""
    of_lights, of_materials = used_functions_of(plan)
    features = {
        "textures": plan.textures is not None,
        "shadows": plan.has_shadows,
        "transparency": plan.opacity is not None,
        "depth cueing": plan.cue is not None,
        "spectra": plan.products is not None,
        "tangents": plan.has_tangents,
    }
    needs = list_needs(plan)
    cheapest = int(plan.of_materials.ways.max()) if (plan.of_materials.ways != IN_ENTRIES).all() else IN_ENTRIES
    return PlanSummary(
        shading="flat" if plan.is_flat else "phong" if plan.is_lit_per_sample else "gouraud",
        channels=plan.n_channel,
        dtype=str(plan.dtype),
        reasons=plan.reasons,
        way=name_way(cheapest, plan.is_lit_per_sample),
        needs=needs,
        light_functions=_names(of_lights),
        reflection_functions=_names(of_materials),
        features=tuple(name for name, holds in features.items() if holds),
        bound=plan.bound,
        left_out=plan.n_left_out,
        ways=ways,
    )


def used_functions_of(plan: Plan) -> tuple[list, list]:
    """Return the batch functions of lights, and those of materials, that are evaluated."""
    of_lights, of_materials = batch_functions_of(plan)
    n_term = len(of_lights) // max(len(plan.lights), 1)
    is_used = np.repeat(plan.is_lit, n_term, axis=1)
    lights = [function for function, used in zip(of_lights, is_used.any(axis=0).tolist(), strict=True) if used]
    pairs = zip(of_materials, is_used.tolist(), strict=True)
    return lights, [f for functions, row in pairs for f, used in zip(functions, row, strict=True) if used]


def list_needs(plan: Plan) -> tuple[MaterialNeeds, ...]:
    """List what the materials need, those that need the same together."""
    rows, groups, n_lights = plan.of_materials, {}, plan.is_lit.sum(axis=1).tolist()
    for k, (way, is_double, is_colored) in enumerate(zip(rows.ways, rows.is_double, rows.is_colored, strict=True)):
        dtype, way = "float64" if is_double else "float32", name_way(int(way), plan.is_lit_per_sample)
        groups.setdefault((3 if is_colored else 1, dtype, rows.reasons[k], way, n_lights[k]), []).append(k)
    return tuple(MaterialNeeds(tuple(numbers), *key) for key, numbers in groups.items())


def name_way(way: int, is_lit_per_sample: bool) -> str:
    """Return a way of attributes in words."""
    if way == IN_ENTRIES:
        return "one intensity in each visibility entry"
    if way == IN_PLANES:
        return "planes of the normals" if is_lit_per_sample else "planes of the intensities"
    return "exact records"


def _names(functions) -> tuple[str, ...]:
    """The names of functions, each once, in order."""
    return tuple(dict.fromkeys(function.__name__ for function in functions))
