"""The plan of a picture in words and counts, for a person who asks what was done and why."""

from typing import NamedTuple

from ..errors import counted
from ..pipeline.gradients import IN_ENTRIES, IN_PLANES
from .plan import Plan


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


class PlanSummary(NamedTuple):
    """What a picture needed, and nothing else was computed.

    Parameters
    ----------
    shading : "flat", "gouraud" or "phong"
    channels : 1 where every colour of the picture is a multiple of one RGB triple, else 3
    dtype : the type of the illumination: "float32", or "float64" where all materials need that
    materials : how many different ones there are
    doubles : how many of these are lit in float64
    reasons : why some material needs float64; empty where none does
    path : the cheapest one that attributes of any material may take from the vertices to the samples
    features : what else the scene uses: "textures", "shadows", "transparency", "depth cueing", "spectra", "tangents"
    bound : the largest intensity that any point may have, linear
    lights : how many lights are reflected; of an area light each of its cells counts
    left_out : how many lights were left out of everything: black ones, and others of which nothing is reflected
    paths : how many triangles took which path; None before anything was drawn
    """

    shading: str
    channels: int
    dtype: str
    materials: int
    doubles: int
    reasons: tuple[str, ...]
    path: str
    features: tuple[str, ...]
    bound: float
    lights: int
    left_out: int
    paths: PathCounts | None = None

    def __repr__(self) -> str:
        why = f" because of {', '.join(self.reasons)}" if self.reasons else ""
        of_doubles = f"{self.doubles} in float64{why}" if self.doubles else "all in float32"
        lines = [
            f"{self.shading} shading, {counted(self.channels, 'channel')}; {self.path}",
            f"{counted(self.materials, 'material')}, {of_doubles}; {counted(self.lights, 'light')}",
            f"also: {', '.join(self.features) or 'nothing'}",
            f"largest intensity: {self.bound:.4g}",
        ]
        if self.left_out:
            lines.append(f"left out: {counted(self.left_out, 'light')} that no surface shows")
        if self.paths is not None:
            entries, planes, exact = self.paths
            counts = f"{entries} by entries, {planes} by planes, {exact} by exact records"
            lines.append(f"triangles in their bands: {counts}")
        return "\n".join(lines)


def summarize(plan: Plan) -> PlanSummary:
    """Put a plan into words."""
    tables, table, n_light = plan.tables, plan.of_materials, len(plan.tables.reflected_lights)
    features = {
        "textures": plan.textures is not None,
        "shadows": tables.has_shadows,
        "transparency": plan.opacity is not None,
        "depth cueing": plan.cue is not None,
        "spectra": tables.products is not None,
        "tangents": plan.has_tangents,
    }
    path = "exact records"
    if (table.paths == IN_ENTRIES).any():
        path = "one intensity in each visibility entry"
    elif (table.paths == IN_PLANES).any():
        path = "planes of the normals" if plan.is_lit_per_sample else "planes of the intensities"
    return PlanSummary(
        shading=plan.options.shading,
        channels=plan.n_channel,
        dtype=str(plan.dtype),
        materials=len(tables.materials),
        doubles=int(table.is_double.sum()),
        reasons=tuple(dict.fromkeys(reason for reasons in table.reasons for reason in reasons)),
        path=path,
        features=tuple(name for name, holds in features.items() if holds),
        bound=plan.bound,
        lights=n_light,
        left_out=tables.n_black + len(tables.lights) - n_light,
    )
