"""Which lights light which materials, and which of them reach one point together.

In:  the lights of a scene, the boxes round its meshes, and which materials each mesh has.
Out: `LightSets`. What is left out for a material is neither compiled for it, nor evaluated, nor counted in its bounds;
     what can't reach one point together isn't added up in its bounds.

The boxes are divided into cells of similar lengths, and each cell is asked which lights reach it (reach.py). All points
of a material lie in cells of its meshes. So the sum over the lights of anything is nowhere larger than the largest of
the sums over the cells.

What is found holds for all views in which lit points are computed within SLACK of the scene's size: for all but those
in which the scene covers about a pixel, or float32 sees it from too far away.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.camera import View
from .light_table import UNLIMITED, entry_of, is_carried
from .reach import Boxes, NormalCones, lights_behind_boxes, lights_reaching_boxes, position_error

SLACK = 2.0**-8  # of the diagonal of the scene's box: how far beside their surfaces lit points may be computed
FURTHEST = 2.0**10  # of the same: how far the eye may be from what it sees
MOST_CELLS = 4096  # of all meshes together, but one of each at least
# Radians: how far planes may turn a normal where that decides more than a shade: whether a point lies in a shadow, or
# before a light.
MOST_TURN = 2.0**-12
MOST_MEASURED = 256  # meshes whose cones are measured; of more they are small, and few lights are behind all of one
N_TESTED = 64  # triangles that are looked at first: of most meshes they tell already that normals look anywhere


class LightSets(NamedTuple):
    """Sets of lights that reach one point together."""

    reaches: NDArray[np.bool_]  # (n_material, n_light): the light reaches some point of the material
    sets: NDArray[np.bool_]  # (n_set, n_light): all lights that may reach one point
    starts: NDArray[np.int64]  # (n_material,): where the sets of each material begin
    is_whole: bool  # each material has one set, of all lights
    is_one_sided: bool  # some light is left out because it is behind the surfaces

    @property
    def most_together(self) -> int:
        """How many lights may reach one point at most."""
        return int(self.sets.sum(axis=1).max(initial=0))

    def largest_sums(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the largest sum over lights that may reach one point together, (n_material,).

        Parameters
        ----------
        values : (n_material, n_light) float64, not negative; infinite ones count as far as the light reaches something
        """
        if self.is_whole or values.shape[1] == 0:
            return values.sum(axis=1)
        ends = [*self.starts[1:].tolist(), len(self.sets)]
        of_materials = zip(values, self.starts.tolist(), ends, strict=True)
        with np.errstate(over="ignore"):
            sums = [
                np.where(self.sets[start:end], row, 0.0).sum(axis=1).max(initial=0.0)
                for row, start, end in of_materials
            ]
        return np.array(sums)


def all_lights(n_material: int, n_light: int) -> LightSets:
    """Return sets of all lights: every light may reach every point."""
    everything = np.ones((n_material, n_light), np.bool_)
    return LightSets(everything, everything, np.arange(n_material), True, False)


class LightReach(NamedTuple):
    """Which lights reach what, and in which views that holds."""

    sets: LightSets
    diagonal: float  # of the box round the scene

    def holds_in(self, furthest: float, beside: float) -> bool:
        """Tell whether lit points are computed as near to their surfaces as was assumed.

        Parameters
        ----------
        furthest : distance of the furthest point from the eye, scene units
        beside : how far samples lie beside their triangles, scene units
        """
        return furthest <= FURTHEST * self.diagonal and position_error(furthest, beside) <= SLACK * self.diagonal


def compute_reach(
    lights: Sequence[Any],
    bounds: NDArray[np.float64],
    numbers: Sequence[NDArray[np.int64]],
    cones: NormalCones | None = None,
) -> LightReach:
    """Find out which lights reach which materials; a light that moves with the camera may reach everything.

    Parameters
    ----------
    bounds : (n_mesh, 2, 3) float64, boxes round the meshes, world space
    numbers : for each mesh the materials that it has
    cones : of the meshes' normals, where all that is seen is seen from their side; None = seen from both
    """
    cones = None if cones is None or (cones.cosines <= 0.0).all() else cones
    n_material = 1 + max((int(of_mesh.max()) for of_mesh in numbers), default=-1)
    diagonal = float(np.linalg.norm(bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)))
    has_end = [entry_of(light).limits(light) != UNLIMITED and not is_carried(light) for light in lights]
    if not (any(has_end) or (cones is not None and lights)) or not math.isfinite(diagonal):
        return LightReach(all_lights(n_material, len(lights)), math.inf)
    cells, mesh = divide_boxes(bounds, MOST_CELLS if any(has_end) else 1)
    boxes = Boxes(cells[:, 0], cells[:, 1], SLACK * diagonal, FURTHEST * diagonal)
    carried = np.array([is_carried(light) for light in lights], np.bool_)
    anywhere = View(np.zeros(3), *np.eye(3))
    reaches = lights_reaching_boxes(lights, anywhere, boxes) | carried
    is_one_sided = False
    if cones is not None:
        of_cells = NormalCones(cones.axes[mesh], cones.cosines[mesh])
        is_behind = lights_behind_boxes(lights, anywhere, boxes, of_cells, MOST_TURN) & ~carried
        is_one_sided = bool((reaches & is_behind).any())
        reaches &= ~is_behind
    # A row for each cell and material of its mesh, the same ones once; in the order of materials.
    counts = np.array([len(of_mesh) for of_mesh in numbers])
    first = np.cumsum(counts) - counts
    row = np.repeat(np.arange(len(mesh)), counts[mesh])
    nth = np.arange(len(row)) - np.repeat(np.cumsum(counts[mesh]) - counts[mesh], counts[mesh])
    material = np.concatenate(numbers)[first[mesh[row]] + nth]
    material, sets = list_different(material, reaches[row])
    starts = np.searchsorted(material, np.arange(n_material))
    of_materials = np.logical_or.reduceat(sets, starts)
    is_whole = len(sets) == n_material and bool(sets.all())
    return LightReach(LightSets(of_materials, sets, starts, is_whole, is_one_sided), diagonal)


def list_different(material: NDArray[np.int64], sets: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return each of the pairs of a material, (n,), and a set of its lights, (n, n_light), once, in the order of
    materials.

    Compared as bytes, eight lights in each: thousands of lights are compared with thousands of cells.
    """
    packed = np.column_stack([material.astype(">u8")[:, None].view(np.uint8), np.packbits(sets, axis=1)])
    rows = np.ascontiguousarray(packed).view(f"V{packed.shape[1]}").ravel()
    first = np.unique(rows, return_index=True)[1]
    return material[first], sets[first]


def divide_boxes(bounds: NDArray[np.float64], most: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Divide boxes into cells that are about as long as wide, as many of each box.

    Parameters
    ----------
    bounds : (n, 2, 3) float64
    most : cells of all boxes together, but one of each at least

    Returns
    -------
    (n_cell, 2, 3) float64, the cells, whose borders are the same numbers where they meet; (n_cell,) the box of each
    """
    sizes = bounds[:, 1] - bounds[:, 0]
    longest = np.maximum(sizes.max(axis=1, keepdims=True), np.finfo(float).tiny)
    counts = np.ones((len(bounds), 3), np.int64)
    for n in (2, 4, 8, 16, 32, 64):
        finer = np.maximum(np.ceil(sizes / longest * n), 1.0).astype(np.int64)
        is_fit = finer.prod(axis=1) <= most // len(bounds)
        counts = np.where(is_fit[:, None], finer, counts)
    n_cell = counts.prod(axis=1)
    box = np.repeat(np.arange(len(bounds)), n_cell)
    number = np.arange(len(box)) - np.repeat(np.cumsum(n_cell) - n_cell, n_cell)
    along = counts[box]
    steps = np.stack(
        [number % along[:, 0], number // along[:, 0] % along[:, 1], number // along[:, :2].prod(axis=1)], 1
    )
    low, high = bounds[box, 0], bounds[box, 1]
    ends = [low + sizes[box] * ((steps + k) / along) for k in (0, 1)]
    ends[1] = np.where(steps + 1 == along, high, ends[1])
    return np.stack(ends, axis=1), box


def measure_cones(geometry: Any, n_faces: Sequence[int]) -> NormalCones:
    """Measure the cones of the normals of each mesh; they are open for meshes that have some against their winding, and
    for all where there are more than MOST_MEASURED.

    Parameters
    ----------
    geometry : Geometry whose points are those between which is interpolated
    n_faces : of each mesh, triangles as loaded
    """
    starts = np.cumsum([0, *n_faces])
    if len(geometry.face):  # triangles about centres, in the order of the faces as loaded
        starts = np.searchsorted(np.maximum.accumulate(geometry.face), starts)
    axes, cosines = np.zeros((len(n_faces), 3)), np.full(len(n_faces), -1.0)
    if len(n_faces) > MOST_MEASURED:
        return NormalCones(axes, cosines)
    for k, (start, end) in enumerate(zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)):
        few = geometry.normals[:, geometry.corner[:, start : end : max(1, (end - start) // N_TESTED)].ravel()]
        if end == start or _cone_of(few)[1] <= 0.0 or geometry.is_inverted[start:end].any():
            continue
        axes[k], cosines[k] = _cone_of(geometry.normals[:, geometry.corner[:, start:end].ravel()])
    return NormalCones(axes, cosines)


def _cone_of(normals) -> tuple[NDArray[np.float64], float]:
    """The axis of a cone of unit normals (3, n), and the cosine of its half angle, at least -1."""
    mean = normals.sum(axis=1)
    length = float(np.linalg.norm(mean))
    if not length > 0.0:
        return np.zeros(3), -1.0
    return mean / length, max(float((mean / length @ normals).min()) - 2.0**-40, -1.0)
