"""What each material of a scene needs: one channel or three, float32 or float64, the cheapest way to its samples.

What one object needs costs its own samples and no others. The bounds that justify a cheaper way stand beside the
choice.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..pipeline import gradients as g
from . import light_table, reflection_table
from .bounds import Brightness
from .rounding import SINGLE
from .tint import common_tint

SMALL, LARGE = 2.0**-40, 2.0**60  # scene units: squares of lengths between them keep their digits in float32
TOO_MUCH = "rounding beyond half of the tolerance"
MOST_TURN = 2.0**-12  # radians: how far planes may turn a normal where that decides whether a point lies in a shadow


class MaterialPlans(NamedTuple):
    """A row for each material."""

    ways: NDArray[np.uint8]  # (n,): the cheapest that attributes may take to the samples, see pipeline/gradients.py
    needs: NDArray[np.uint8]  # (n,): bits, as there
    n_attributes: NDArray[np.int64]  # (n,): how many of the attributes are read
    normal_limits: NDArray[np.float64]  # (n,): how far float32 planes may turn a normal, as there
    roundings: NDArray[np.float64]  # (n,): what rounding may add to an intensity, linear; see view_plans.py
    has_albedo: NDArray[np.bool_]  # (n,): colours are given with the model, or a texture
    reasons: tuple[tuple[str, ...], ...]  # why float32 won't do; none where it does

    @property
    def is_double(self) -> NDArray[np.bool_]:
        """Which need float64."""
        return (self.needs & g.NEEDS_DOUBLE) != 0

    def dtype_of(self, material: int) -> np.dtype:
        """The type that a material is lit in."""
        return np.dtype(np.float64 if self.needs[material] & g.NEEDS_DOUBLE else np.float32)

    @property
    def is_looked_up(self) -> NDArray[np.bool_]:
        """Which have textures whose coordinates may stand in planes."""
        return ((self.needs & g.NEEDS_TEXTURE) != 0) & ~self.is_double

    @property
    def reads_double(self) -> NDArray[np.bool_]:
        """Which have attributes in float64: also texture coordinates, of which large pictures need many digits."""
        return self.is_double | self.is_looked_up

    @property
    def is_colored(self) -> NDArray[np.bool_]:
        """Which need three channels."""
        return (self.needs & g.NEEDS_COLORS) != 0

    def is_like(self, other: "MaterialPlans") -> bool:
        """Tell whether others need the same, whatever rounding adds."""
        return self.needs is other.needs or bool((self.needs == other.needs).all() and (self.ways == other.ways).all())

    def doubled(self, which: NDArray[np.bool_], reason: str) -> "MaterialPlans":
        """Return the same with float64 for some materials."""
        singles = np.uint8(255 - g.NEEDS_SINGLE)
        needs = np.where(which, self.needs & singles | np.uint8(g.NEEDS_DOUBLE), self.needs)
        reasons = [(*old, reason) if new else old for new, old in zip(which, self.reasons, strict=True)]
        return self._replace(
            needs=needs.astype(np.uint8), ways=np.where(which, np.uint8(g.EXACT), self.ways), reasons=tuple(reasons)
        )


class Facts(NamedTuple):
    """What is known of a material's surfaces, a row a material."""

    has_albedo: NDArray[np.bool_]  # colours are given with the model, or a texture
    has_vertex_colors: NDArray[np.bool_]  # colours are given with the model
    has_colors: NDArray[np.bool_]  # not only grey ones
    tints: Sequence[NDArray[np.float64] | None]  # (3,): what all intensities are multiples of, None where there is none


def plan_materials(
    sources: Any,
    brightest: Brightness,
    roundings: NDArray[np.float64],
    options: Any,
    facts: Facts,
    tint: NDArray | None,
) -> MaterialPlans:
    """Find out what each material needs.

    Parameters
    ----------
    sources : Sources of the scene (engine/plan.py)
    brightest : as bright as lights are at their clearances
    roundings : (n_material,) the least that float32 adds to an intensity in any view
    options : Options
    tint : (3,) the colour of what has one channel; None where all has three
    """
    materials, bounds = sources.materials, brightest.of_materials
    angles = options.tolerance / 4 / np.maximum(brightest.turn_slopes, 1e-30)
    if sources.has_shadows:  # which depend on normals, however dim the lights are
        angles = np.minimum(angles, MOST_TURN)
    normal_limits = angles / (np.sqrt(3.0) * SINGLE)
    ways, needs, n_attributes, reasons = [], [], [], []
    for k, material in enumerate(materials):
        why = reasons_of(material, sources.lights_of(k), options.tolerance, roundings[k], bounds[k])
        is_colored = tint is None or facts.tints[k] is None or common_tint(facts.tints[k], tint) is None
        ways.append(choose_way(why, options, is_colored or not material.is_opaque, normal_limits[k], bounds.max()))
        needs.append(list_needs(material, bool(why), is_colored, facts.has_vertex_colors[k]))
        n_attributes.append(count_attributes(material, options, sources, facts, k, is_colored))
        reasons.append(why)
    return MaterialPlans(
        np.array(ways, np.uint8), np.array(needs, np.uint8), np.array(n_attributes, np.int64), normal_limits,
        roundings, facts.has_albedo, tuple(reasons),
    )  # fmt: skip


def reasons_of(
    material: Any, lights: Sequence[Any], tolerance: float, rounding: float, bound: float
) -> tuple[str, ...]:
    """Say why float32 won't do for a material in any view, in a few words each; nothing where it does.

    Parameters
    ----------
    lights : those that it reflects
    rounding : the least that float32 adds to an intensity of it
    bound : the largest intensity that it may have; infinite where a light amplifies without limit
    """
    lengths = [length for light in lights for length in light_table.entry_of(light).lengths(light)]
    reasons = {
        "tolerance 0": tolerance == 0,
        TOO_MUCH: not rounding <= tolerance / 2,
        "lights without bound": not np.isfinite(bound),
        "numbers of lights beyond float32": not are_single(lengths),
        reflection_table.entry_of(material).reason_for_float64(material): True,
    }
    return tuple(reason for reason, holds in reasons.items() if reason and holds)


def are_single(lengths: Sequence[float]) -> bool:
    """Tell whether lengths, and their products with squares of lengths, keep their digits in float32."""
    return all(SMALL <= length <= LARGE for length in lengths)


def choose_way(reasons, options, needs_planes: bool, normal_limit: float, bound: float) -> int:
    """Choose the cheapest way that the attributes of a material may take to the samples."""
    if reasons:
        return g.EXACT
    if options.shading == "phong":
        return g.IN_PLANES if normal_limit > 3.0 else g.EXACT
    if not np.isfinite(bound):
        return g.EXACT
    return g.IN_PLANES if needs_planes else g.IN_ENTRIES


def list_needs(material: Any, is_double: bool, is_colored: bool, has_vertex_colors: bool) -> int:
    """Return what a material needs, as bits."""
    needs = g.NEEDS_DOUBLE if is_double else g.NEEDS_SINGLE
    needs |= g.NEEDS_COLORS if is_colored else 0
    needs |= g.NEEDS_ALBEDO if has_vertex_colors else 0
    if material.texture is not None:
        is_nearest = material.texture.filter == "nearest" and not is_double
        needs |= g.NEEDS_TEXTURE | (g.NEEDS_CORNERS if is_nearest else 0)
    needs |= 0 if material.is_opaque else g.NEEDS_BEHIND if material.opacity > 0.0 else g.IS_INVISIBLE
    return needs


def count_attributes(material: Any, options: Any, sources: Any, facts: Facts, k: int, is_colored: bool) -> int:
    """Return how many attributes of the surfaces of material k are read: see engine/attributes.py."""
    if options.shading != "phong":
        return 8 if material.texture is not None else 3 if is_colored else 1
    if material.is_anisotropic and material.tangent == "u":
        return 6 + 3 * bool(facts.has_albedo.any()) + 2 * sources.is_textured
    return 8 if material.texture is not None else 6 if facts.has_albedo[k] else 3
