"""The plan of a picture in words and counts, for a person who asks what was done and why."""

from typing import NamedTuple

from ..pipeline.gradients import EXACT, IN_ENTRIES, LEVEL_PLANES, NORMAL_PLANES
from .plan import Plan
from .uniforms import batch_functions_of

WAYS = {
    IN_ENTRIES: "one intensity in each visibility entry",
    LEVEL_PLANES: "planes of the three channels",
    NORMAL_PLANES: "planes of the normals",
    EXACT: "exact records",
}


class Ways(NamedTuple):
    """Triangles by the way that their attributes took, counted in each band that they meet."""

    entries: int  # intensities in the entries of the visibility buffer
    planes: int  # records of planes
    exact: int  # exact records


class PlanSummary(NamedTuple):
    """What a picture needed, and nothing else was computed.

    Parameters
    ----------
    shading : "flat", "gouraud" or "phong"
    channels : 1 where every colour of the picture is a multiple of one RGB triple, else 3
    dtype : "float32" or "float64", the type of the illumination
    reasons : why it is float64; empty for float32
    way : the cheapest way that attributes may take from the vertices to the samples
    light_functions : names of the compiled functions of lights, each once
    reflection_functions : the same for reflection models
    features : what else the scene uses: "textures", "shadows", "transparency", "depth cueing", "spectra", "tangents"
    bound : the largest intensity that any point may have, linear
    ways : how many triangles took which way; None before anything was drawn
    """

    shading: str
    channels: int
    dtype: str
    reasons: tuple[str, ...]
    way: str
    light_functions: tuple[str, ...]
    reflection_functions: tuple[str, ...]
    features: tuple[str, ...]
    bound: float
    ways: Ways | None = None

    def __repr__(self) -> str:
        why = f" because of {', '.join(self.reasons)}" if self.reasons else ""
        lines = [
            f"{self.shading} shading, {self.channels} channel{'s' * (self.channels > 1)}, {self.dtype}{why}",
            f"attributes: {self.way}",
            f"lights: {', '.join(self.light_functions) or 'none but ambient'}",
            f"reflection: {', '.join(self.reflection_functions) or 'none'}",
            f"also: {', '.join(self.features) or 'nothing'}",
            f"largest intensity: {self.bound:.4g}",
        ]
        if self.ways is not None:
            counts = ", ".join(f"{count} by {name}" for name, count in zip(_WAY_NAMES, self.ways, strict=True))
            lines.append(f"triangles in their bands: {counts}")
        return "\n".join(lines)


_WAY_NAMES = ("entries", "planes", "exact records")


def summarize(plan: Plan, is_perspective: bool, ways: Ways | None = None) -> PlanSummary:
    """Put a plan into words."""
    of_lights, of_materials = batch_functions_of(plan, is_perspective)
    features = {
        "textures": plan.textures is not None,
        "shadows": plan.has_shadows,
        "transparency": plan.opacity is not None,
        "depth cueing": plan.cue is not None,
        "spectra": plan.products is not None,
        "tangents": plan.has_tangents,
    }
    return PlanSummary(
        shading="flat" if plan.is_flat else "phong" if plan.is_lit_per_sample else "gouraud",
        channels=plan.n_channel,
        dtype=str(plan.dtype),
        reasons=plan.reasons,
        way=WAYS[plan.coding],
        light_functions=_names(of_lights),
        reflection_functions=_names(function for functions in of_materials for function in functions),
        features=tuple(name for name, holds in features.items() if holds),
        bound=plan.bound,
        ways=ways,
    )


def _names(functions) -> tuple[str, ...]:
    """The names of functions, each once, in order."""
    return tuple(dict.fromkeys(function.__name__ for function in functions))
