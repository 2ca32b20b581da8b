"""The plan of a picture in words and counts, for a person who asks what was done and why."""

from typing import NamedTuple

from ..errors import counted
from ..pipeline.gradients import IN_ENTRIES, IN_PLANES
from .plan import Plan
from .uniforms import used_functions


class PathCounts(NamedTuple):
    """Triangles by the path that their attributes took, counted in each band that they meet.

    Parameters
    ----------
    entries : those with intensities in the entries of the visibility buffer
    planes : those with records of planes
    exact : those with exact records
    """

    entries: int
    planes: int
    exact: int


class MaterialSummary(NamedTuple):
    """What the samples of some materials need.

    Parameters
    ----------
    materials : their numbers, in the order in which the scene has them
    channels : 1 where every colour is a multiple of the picture's tint, else 3
    dtype : "float32" or "float64", the type of the illumination
    reasons : why it is float64; empty for float32
    path : the cheapest one that attributes may take from the vertices to the samples
    lights : how many lights reach them and are reflected; of an area light each of its cells counts
    """

    materials: tuple[int, ...]
    channels: int
    dtype: str
    reasons: tuple[str, ...]
    path: str
    lights: int

    def __repr__(self) -> str:
        why = f" because of {', '.join(self.reasons)}" if self.reasons else ""
        return f"{counted(self.channels, 'channel')}, {self.dtype}{why}; {self.path}; {counted(self.lights, 'light')}"


class PlanSummary(NamedTuple):
    """What a picture needed, and nothing else was computed.

    Parameters
    ----------
    shading : "flat", "gouraud" or "phong"
    channels : 1 where every colour of the picture is a multiple of one RGB triple, else 3
    dtype : the type of the illumination: "float32", or "float64" where all materials need that
    reasons : why some material needs float64; empty where none does
    path : the cheapest one that attributes of any material may take from the vertices to the samples
    materials : what they need, those that need the same together
    light_functions : names of the compiled functions of lights, each once
    reflection_functions : the same for reflection models
    features : what else the scene uses: "textures", "shadows", "transparency", "depth cueing", "spectra", "tangents"
    bound : the largest intensity that any point may have, linear
    left_out : how many lights were left out of everything: black ones, and others of which nothing is reflected
    paths : how many triangles took which path; None before anything was drawn
    """

    shading: str
    channels: int
    dtype: str
    reasons: tuple[str, ...]
    path: str
    materials: tuple[MaterialSummary, ...]
    light_functions: tuple[str, ...]
    reflection_functions: tuple[str, ...]
    features: tuple[str, ...]
    bound: float
    left_out: int = 0
    paths: PathCounts | None = None

    def __repr__(self) -> str:
        if len(self.materials) == 1:
            lines = [f"{self.shading} shading, {self.materials[0]}"]
        else:
            lines = [f"{self.shading} shading"]
            lines += [f"material{'s' * (len(n.materials) > 1)} {shorten(n.materials)}: {n}" for n in self.materials]
        lines += [
            f"lights: {', '.join(self.light_functions) or 'none but ambient'}",
            f"reflection: {', '.join(self.reflection_functions) or 'none'}",
            f"also: {', '.join(self.features) or 'nothing'}",
            f"largest intensity: {self.bound:.4g}",
        ]
        if self.left_out:
            lines.append(f"left out: {counted(self.left_out, 'light')} that no surface shows")
        if self.paths is not None:
            counts = ", ".join(f"{count} by {name}" for name, count in zip(_PATH_NAMES, self.paths, strict=True))
            lines.append(f"triangles in their bands: {counts}")
        return "\n".join(lines)


MAX_NUMBERS = 8  # of materials that are named in a line


def shorten(numbers: tuple[int, ...]) -> str:
    """Return numbers as text; of many the first ones and how many there are."""
    text = ", ".join(map(str, numbers[:MAX_NUMBERS]))
    return text if len(numbers) <= MAX_NUMBERS else f"{text}, … ({len(numbers)} of them)"


_PATH_NAMES = ("entries", "planes", "exact records")


def summarize(plan: Plan) -> PlanSummary:
    """Put a plan into words."""
    of_lights, *of_materials = used_functions(plan)
    features = {
        "textures": plan.textures is not None,
        "shadows": plan.has_shadows,
        "transparency": plan.opacity is not None,
        "depth cueing": plan.cue is not None,
        "spectra": plan.products is not None,
        "tangents": plan.has_tangents,
    }
    cheapest = int(plan.of_materials.paths.max()) if (plan.of_materials.paths != IN_ENTRIES).all() else IN_ENTRIES
    return PlanSummary(
        shading="flat" if plan.is_flat else "phong" if plan.is_lit_per_sample else "gouraud",
        channels=plan.n_channel,
        dtype=str(plan.dtype),
        reasons=plan.reasons,
        path=name_path(cheapest, plan.is_lit_per_sample),
        materials=summarize_materials(plan),
        light_functions=_names(of_lights),
        reflection_functions=_names(f for row in of_materials for f in row),
        features=tuple(name for name, holds in features.items() if holds),
        bound=plan.bound,
        left_out=plan.n_left_out,
    )


def summarize_materials(plan: Plan) -> tuple[MaterialSummary, ...]:
    """List what the materials need, those that need the same together."""
    rows, groups, n_lights = plan.of_materials, {}, plan.is_lit.sum(axis=1).tolist()
    for k, (path, is_double, is_colored) in enumerate(zip(rows.paths, rows.is_double, rows.is_colored, strict=True)):
        dtype, words = "float64" if is_double else "float32", name_path(int(path), plan.is_lit_per_sample)
        groups.setdefault((3 if is_colored else 1, dtype, rows.reasons[k], words, n_lights[k]), []).append(k)
    return tuple(MaterialSummary(tuple(numbers), *key) for key, numbers in groups.items())


def name_path(path: int, is_lit_per_sample: bool) -> str:
    """Return a path of attributes in words."""
    if path == IN_ENTRIES:
        return "one intensity in each visibility entry"
    if path == IN_PLANES:
        return "planes of the normals" if is_lit_per_sample else "planes of the intensities"
    return "exact records"


def _names(functions) -> tuple[str, ...]:
    """The names of functions, each once, in order; None has none."""
    return tuple(dict.fromkeys(f.__name__ for f in functions if f is not None))
