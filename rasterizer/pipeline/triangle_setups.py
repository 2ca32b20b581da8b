"""Setups: what the scan stage leaves for the shade stage of every triangle whose samples are shaded later.

In:  a `Block` of setup.py with the planes of gradients.py.
Out: a row for each such triangle of the band. A setup of planes holds them; an exact one holds the triangle itself.

Setups of planes are of different lengths, multiples of UNIT numbers in a flat array: the index of a setup is that of
its first unit, and is found by a shift. The planes of four attributes stand side by side, for samples.py; behind those
whose samples must stay within the range of the vertices stands that range:

    material  anchor x  anchor y  face  |  4 values  4 d/dx  4 d/dy                          normals, texcoords,
                                        |                                                    affine intensities
                                        |  4 values  4 d/dx  4 d/dy  4 least  4 greatest     weighted intensities,
                                        |                                                    albedo
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper
from . import setup as s
from .gradients import HAS_ALBEDO, HAS_TEXTURE, MAX_CHANNELS
from .samples import PLANE_GROUP, PlaneGroup
from .textures import TEXCOORD_PLANE
from .visibility import SETUP_MASK, SETUP_SHIFT, is_exact, setup_of

# Columns of an exact setup's integers: the first vertex and the two edges that leave it (1/256 px), the triangle, the
# side that is seen, the material.
EDGES, FACE, SIDE, MATERIAL = 0, 6, 7, 8
N_INTEGER = 9
# Columns of an exact setup's reals, each at the three vertices: 1/w; the depth of the triangle's plane where they are
# rounded to, with perspective 1/w of that over the 1/w; each attribute.
INV_W, DEPTH, ATTRIBUTE = 0, 3, 6
# Columns of a setup of planes: the sample where the planes are anchored, then groups of four planes.
PLANES_MATERIAL, PLANES_ANCHOR_X, PLANES_ANCHOR_Y, PLANES_FACE, FIRST_GROUP = 0, 1, 2, 3, 4
# Numbers of a group without and with a range. Where groups stand: the normals or the intensities come first, then the
# texture coordinates, then the albedo, or what a textured surface gives off as a whole.
PLAIN_GROUP, VALUE_GROUP = 3 * PLANE_GROUP, 5 * PLANE_GROUP
NORMALS, BEHIND_NORMALS = FIRST_GROUP, FIRST_GROUP + PLAIN_GROUP
VALUES, BEHIND_VALUES = FIRST_GROUP, FIRST_GROUP + VALUE_GROUP
UNIT_SHIFT = 4
UNIT = 1 << UNIT_SHIFT
LONGEST = -(-(BEHIND_VALUES + PLAIN_GROUP + VALUE_GROUP) // UNIT)  # units of the longest setup


class TriangleSetups(NamedTuple):
    """What the shade stage interpolates, for each triangle of the band whose packed samples hold an index."""

    integers: np.ndarray  # (n, N_INTEGER) int32
    reals: np.ndarray  # (n, ATTRIBUTE + 3 * n_attribute) float64
    int_planes: np.ndarray  # int32, UNIT for each, and room behind the last
    float_planes: np.ndarray  # the same memory as float32


def make_triangle_setups(n, n_attribute) -> TriangleSetups:
    """Return room for n setups of planes and for n exact ones, of a unit each.

    Only what is written to becomes memory, so both may have room for every triangle. Loops without branches read
    the planes of exact setups, too, as far as the longest setup goes: the last has as much behind it.
    """
    integers, reals = np.zeros((n, N_INTEGER), np.int32), np.zeros((n, ATTRIBUTE + 3 * n_attribute))
    int_planes = np.zeros((n + LONGEST - 1) << UNIT_SHIFT, np.int32)
    return TriangleSetups(integers, reals, int_planes, int_planes.view(np.float32))


def max_units(coding) -> int:
    """Return how many units a setup has at most."""
    is_textured = coding.textures is not None
    if coding.is_exact:
        end = UNIT
    elif coding.intensity_scale > 0.0:
        end = BEHIND_VALUES + (PLAIN_GROUP + VALUE_GROUP) * is_textured
    else:
        has_albedo = bool((coding.features & HAS_ALBEDO).any())
        end = BEHIND_NORMALS + PLAIN_GROUP * is_textured + VALUE_GROUP * has_albedo
    return -(-end // UNIT)


@helper
def material_of(packed, setups):
    """Return the material that a packed sample which holds the index of a setup shows."""
    setup = setup_of(packed)
    if is_exact(packed):
        return np.int64(setups.integers[setup, MATERIAL])
    return np.int64(setups.int_planes[(setup << UNIT_SHIFT) + PLANES_MATERIAL])


@helper
def face_of(packed, setups):
    """Return the triangle that a packed sample which holds the index of a setup shows."""
    setup = setup_of(packed)
    if is_exact(packed):
        return setups.integers[setup, FACE]
    return setups.int_planes[(setup << UNIT_SHIFT) + PLANES_FACE]


@helper
def plane_group(setups, column):
    """Return the group of four planes that begins at `column` in each setup."""
    return PlaneGroup(setups.float_planes, SETUP_MASK, UNIT_SHIFT - SETUP_SHIFT, column)


@helper
def begin_planes(setups, n_setup, k, face, block):
    """Write what comes before the planes of setup number `n_setup`; return where it begins.

    Parameters
    ----------
    k : the triangle's column in the block
    face : its index in the picture
    """
    ints, planes = block.ints, setups.int_planes
    setup = n_setup << UNIT_SHIFT
    planes[setup + PLANES_MATERIAL] = ints[s.MATERIAL + k]
    planes[setup + PLANES_ANCHOR_X] = ints[s.ANCHOR_X + k]
    planes[setup + PLANES_ANCHOR_Y] = ints[s.ANCHOR_Y + k]
    planes[setup + PLANES_FACE] = face
    return setup


@helper
def write_values(setups, n_setup, k, face, coding, block):
    """Write setup number `n_setup`, planes of intensities; return its length in units."""
    planes, setup = setups.float_planes, begin_planes(setups, n_setup, k, face, block)
    features = coding.features[block.ints[s.MATERIAL + k]]
    if not block.ints[s.IS_WEIGHTED + k]:
        write_planes(planes, setup + VALUES, k, 0, MAX_CHANNELS, block)
        return units_of(FIRST_GROUP + PLAIN_GROUP)
    write_value_group(planes, setup + VALUES, k, 0, MAX_CHANNELS, block)
    end = BEHIND_VALUES
    if features & HAS_TEXTURE:
        write_textured(planes, setup + end, k, coding.textures, block)
        end += PLAIN_GROUP + VALUE_GROUP
    return units_of(end)


@helper
def write_normals(setups, n_setup, k, face, coding, block):
    """Write setup number `n_setup`: planes of normals and what stands behind them; return its length in units."""
    planes, setup = setups.float_planes, begin_planes(setups, n_setup, k, face, block)
    features = coding.features[block.ints[s.MATERIAL + k]]
    write_planes(planes, setup + NORMALS, k, 0, 3, block)
    end = BEHIND_NORMALS
    if features & HAS_TEXTURE:
        write_texcoords(planes, setup + end, k, coding.textures, block)
        end += PLAIN_GROUP
    if features & HAS_ALBEDO:
        write_albedo(planes, setup + end, k, coding.albedo_tolerance, block)
        end += VALUE_GROUP
    return units_of(end)


@helper
def write_albedo(planes, target, k, tolerance, block):
    """Write the planes of the albedo; `tolerance` is None where none stands behind normals."""
    if tolerance is not None:
        write_value_group(planes, target, k, 3, MAX_CHANNELS, block)


@helper
def write_textured(planes, target, k, textures, block):
    """Write the planes of texture coordinates, and of what the surface gives off as a whole; `textures` is None where
    none stand in planes."""
    if textures is not None:
        write_texcoords(planes, target, k, textures, block)
        write_value_group(planes, target + PLAIN_GROUP, k, MAX_CHANNELS, MAX_CHANNELS, block)


@helper
def write_texcoords(planes, target, k, textures, block):
    """Copy the planes of texture coordinates to a group of a setup; `textures` is None where none stand in planes."""
    if textures is not None:
        write_planes(planes, target, k, TEXCOORD_PLANE, PLANE_GROUP, block)


@helper
def units_of(n_number):
    """Return how many units so many numbers take."""
    return np.int64((n_number + UNIT - 1) >> UNIT_SHIFT)


@helper
def write_planes(planes, target, k, first, n, block):
    """Copy the planes of n attributes from number `first` on to a group of a setup."""
    source = s.PLANE_ATTRIBUTE + first * s.NEXT_PLANE + k
    for attribute in range(n):
        for part in range(3):
            value = block.reals[source + attribute * s.NEXT_PLANE + part * s.NEXT]
            planes[target + attribute + part * PLANE_GROUP] = np.float32(value)


@helper
def write_value_group(planes, target, k, first, n, block):
    """Write the planes of n attributes, three at most, from number `first` on, and the range of each over the vertices.

    All four planes of a group are evaluated. Where the fourth of a group that isn't a setup's first lies, another
    setup may have begun before: integers, which are denormals as float32, and take some processors far longer
    to multiply. So the fourth is 0.
    """
    write_planes(planes, target, k, first, n, block)
    fourth, zero = target + (PLANE_GROUP - 1), np.float32(0)
    planes[fourth], planes[fourth + PLANE_GROUP], planes[fourth + 2 * PLANE_GROUP] = zero, zero, zero
    source = s.ATTRIBUTE + first * s.NEXT_PLANE + k
    for attribute in range(n):
        row = source + attribute * s.NEXT_PLANE
        a0, a1, a2 = block.reals[row], block.reals[row + s.NEXT], block.reals[row + s.NEXT + s.NEXT]
        planes[target + 3 * PLANE_GROUP + attribute] = np.float32(min(a0, a1, a2))
        planes[target + 4 * PLANE_GROUP + attribute] = np.float32(max(a0, a1, a2))


@helper
def write_exact(setups, n_setup, k, face, n_attribute, coding, block):
    """Write setup number `n_setup`: where triangle k lies on the screen; 1/w, depth and attributes of its corners.

    Parameters
    ----------
    face : the triangle's index in the picture
    """
    ints, reals, depths = block.ints, block.reals, coding.depths
    row, integers, out = n_setup, setups.integers, setups.reals
    x0, y0 = np.int64(ints[s.X0 + k]), np.int64(ints[s.Y0 + k])
    edges = (x0, y0, ints[s.X1 + k] - x0, ints[s.Y1 + k] - y0, ints[s.X2 + k] - x0, ints[s.Y2 + k] - y0)
    for column in range(6):
        integers[row, EDGES + column] = edges[column]
    integers[row, FACE] = face
    integers[row, SIDE] = -1 if ints[s.IS_FLIPPED + k] else 1
    integers[row, MATERIAL] = ints[s.MATERIAL + k]
    for corner in range(3):
        z, own = reals[s.Z0 + corner * s.NEXT + k], reals[s.OWN_Z0 + corner * s.NEXT + k]
        out[row, INV_W + corner] = depths.inv_w_offset + depths.inv_w_scale * z
        out[row, DEPTH + corner] = s.depth_at_corner(z, own, depths)
    for column in range(3 * n_attribute):
        out[row, ATTRIBUTE + column] = reals[s.ATTRIBUTE + column * s.NEXT + k]
