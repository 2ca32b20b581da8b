"""Stage 5, scan: the triangles of one band into its visibility buffer.

In:  the band's list of triangles, in face order, and the vertices on the screen.
Out: an entry for every sample of the band (visibility.py), and a record for every triangle whose samples are shaded
     later (records.py).

Triangles are set up a block at a time (setup.py), their attributes get planes (gradients.py), and their samples are
filled one after the other (fill.py).
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import choice, helper, index, kernel
from . import setup as s
from .fill import Box, Depths, Plane, Surface, Triangle, fill_box, fill_spans
from .gradients import IS_INVISIBLE, NEEDS_BEHIND, NEEDS_CORNERS, BufferCoding, NormalCoding, compute_gradients
from .records import write_exact, write_index, write_normals, write_values
from .simd import MOST_HIGH, MOST_WIDE
from .visibility import IS_EXACT, IS_WEIGHTED, VisibilityBuffer, id_payload, note_extent, note_material, pack


class Payload(NamedTuple):
    """What stands below the depth in a triangle's entries, int64: at the anchor, and its steps a sample."""

    value: int
    dx: int
    dy: int


class ScanCounts(NamedTuple):
    """What the scan stage found in a band."""

    n_level: int  # triangles by the way that their attributes took
    n_plane: int
    n_exact: int
    needs: int  # what the materials of those that are drawn need, see gradients.py
    material: int  # of all of them; -1 where there are several


class Deferred(NamedTuple):
    """The triangles of a band through which what is behind them is seen: not drawn, but listed (a_buffer.py)."""

    faces: np.ndarray  # (n,) uint32, room for all triangles of the band
    payloads: np.ndarray  # (n,) int64: what stands below the depth in their entries
    extents: VisibilityBuffer  # without entries: where they may be seen, and what materials
    found: np.ndarray  # (4,) int64: how many there are, and of ScanCounts n_plane, n_exact and needs

    @property
    def is_empty(self) -> bool:
        """Nothing is deferred."""
        return self.found[0] == 0

    @property
    def counts(self) -> ScanCounts:
        """What was found of these triangles."""
        _, n_plane, n_exact, needs = self.found.tolist()
        return ScanCounts(0, n_plane, n_exact, needs, -1)

    def listed(self) -> "Deferred":
        """Return them without the room behind them."""
        n = self.found[0]
        return self._replace(faces=self.faces[:n], payloads=self.payloads[:n])


def make_deferred(n, extents) -> Deferred:
    """Return room for n triangles; `extents` is what `make_extents` returns, clear."""
    return Deferred(np.empty(n, np.uint32), np.empty(n, np.int64), extents, np.zeros(4, np.int64))


@kernel
def scan(band, drawables, coding, block, visibility, records, deferred):
    """Draw a band's triangles; return what was found.

    Parameters
    ----------
    band : Band
    drawables : Drawables, all of the picture
    coding : Coding
    block : Block, scratch
    visibility : VisibilityBuffer, clear; written
    records : Records, with room for all triangles; written
    deferred : Deferred, written; or None where all materials are opaque: then nothing of it is compiled

    Returns
    -------
    the fields of ScanCounts
    """
    faces = band.faces
    n_record = n_level = n_plane = n_exact = needs = np.int64(0)
    material = np.int64(0) if len(faces) == 0 else material_of_face(faces[0], drawables.triangles)
    for first in range(0, len(faces), s.BLOCK):
        some = faces[index(first) : index(min(first + s.BLOCK, len(faces)))]
        # Half of the work is done for all triangles of the block side by side: planes of depth and attributes.
        s.gather_vertices(some, drawables.triangles, drawables.vertices, block)
        n_attribute, of_block, has_others = look_at_materials(len(some), material, coding, block, deferred)
        needs |= of_block
        material = np.int64(-1) if has_others else material
        s.order_vertices(block)
        s.gather_attributes(len(some), n_attribute, drawables, coding.reads_double, block)
        s.compute_boxes(band, visibility.width, block)
        s.compute_depth_planes(block)
        compute_gradients(n_attribute, coding, block)
        # The other half goes triangle by triangle: records, where there are any, and samples.
        for k in range(index(len(some))):
            box = box_of(k, block)
            if box.left >= box.right or box.top >= box.bottom:
                continue
            if block.ints[s.HAS_LEVELS + k] != 0:
                payload = level_of(k, block)
                n_level += 1
            else:
                has_planes = block.ints[s.HAS_PLANES + k] != 0
                kind = kind_of_planes(k, block) if has_planes else IS_EXACT
                payload = Payload(id_payload(n_record, kind), np.int64(0), np.int64(0))
                n_unit = np.int64(1)
                if not has_planes or needs_corners(k, coding, block):
                    write_exact(records, n_record, k, some[k], n_attribute, coding, block)
                if has_planes:
                    n_unit = write_record(records, n_record, k, some[k], coding, block)
                n_record += n_unit
                n_plane += has_planes
                n_exact += not has_planes
                if is_deferred(k, some[k], payload.value, box, band, coding, block, deferred):
                    continue
            first_row, end_row = box.top - band.y_start, box.bottom - band.y_start
            note_extent(visibility, box.left, box.right, first_row, end_row)
            if len(coding.ways) > 1:
                here = np.int64(block.ints[s.MATERIAL + k])
                note_material(visibility, box.left, box.right, first_row, end_row, here)
            fill(visibility, band.y_start, box, k, payload, block)
    return n_level, n_plane, n_exact, needs, material


@helper
def material_of_face(face, triangles):
    """Return the material of a triangle."""
    return np.int64(triangles.material[face]) if len(triangles.material) > 0 else np.int64(0)


@helper
def look_at_materials(n, material, coding, block, deferred):
    """Return how many attributes the first n triangles of a block have at most, what the materials of those that are
    not deferred need together, and whether one of all these is another than `material`."""
    n_attribute = needs = others = np.int64(0)
    if s.gather_materials(n, coding, block):
        here = np.int64(block.ints[s.MATERIAL]) if len(coding.ways) > 1 else np.int64(0)
        has_others = len(coding.ways) > 1 and here != material
        return coding.n_attributes[here], needs_when_drawn(coding.needs[here], deferred), has_others
    for k in range(index(n)):
        here = np.int64(block.ints[s.MATERIAL + k])
        n_attribute = max(n_attribute, coding.n_attributes[here])
        needs |= needs_when_drawn(coding.needs[here], deferred)
        others |= here ^ material
    return n_attribute, needs, others != 0


@helper
def needs_when_drawn(needs, deferred):
    """Return what a material needs, int64; nothing where its triangles are deferred."""
    if deferred is not None:
        return np.int64(0) if needs & (NEEDS_BEHIND | IS_INVISIBLE) else np.int64(needs)
    return np.int64(needs)


@helper
def kind_of_planes(k, block):
    """Return the kind of triangle k's planes, see visibility.py."""
    return IS_WEIGHTED if block.ints[s.IS_WEIGHTED + k] != 0 else np.int64(0)


@helper
def needs_corners(k, coding, block):
    """Tell whether triangle k needs an exact record beside its planes."""
    return coding.needs[block.ints[s.MATERIAL + k]] & NEEDS_CORNERS != 0


def choose_writer(records, n_record, k, face, coding, block):
    """Return what is compiled in the place of `write_record`: only what the coding needs."""
    writers = {NormalCoding: write_normals, BufferCoding: write_index}
    return writers.get(coding.instance_class, write_values)


@choice(choose_writer)
def write_record(records, n_record, k, face, coding, block):
    """Write record number `n_record`, the planes of triangle k of the block; return its length in units."""
    writers = {NormalCoding: write_normals, BufferCoding: write_index}
    return writers.get(type(coding), write_values)(records, n_record, k, face, coding, block)


@helper
def is_deferred(k, face, payload, box, band, coding, block, deferred):
    """Tell whether triangle k is not drawn now; append it to the list of these, unless it is invisible."""
    if deferred is not None:
        material = np.int64(block.ints[s.MATERIAL + k])
        needs = coding.needs[material]
        if needs & NEEDS_BEHIND:
            n, found = index(deferred.found[0]), deferred.found
            deferred.faces[n], deferred.payloads[n] = face, payload
            found[0] += 1
            found[1 if payload & IS_EXACT == 0 else 2] += 1
            found[3] |= np.int64(needs)
            first_row, end_row = box.top - band.y_start, box.bottom - band.y_start
            note_extent(deferred.extents, box.left, box.right, first_row, end_row)
            note_material(deferred.extents, box.left, box.right, first_row, end_row, material)
        return needs & (NEEDS_BEHIND | IS_INVISIBLE) != 0
    return False


@helper
def fill(visibility, y_start, box, k, payload, block):
    """Fill triangle k of the block: all samples of a small box side by side, else span by span."""
    surface = surface_of(k, payload, block)
    is_small = block.ints[s.EXTENT_X + k] <= MOST_WIDE and block.ints[s.EXTENT_Y + k] <= MOST_HIGH
    if is_small and not surface.is_sliver:
        fill_box(visibility, y_start, box, surface)
    else:
        fill_spans(visibility, y_start, box, surface, None)


@helper
def box_of(k, block):
    """Return the box of triangle k of the block."""
    ints = block.ints
    return Box(
        np.int64(ints[s.LEFT + k]), np.int64(ints[s.RIGHT + k]), np.int64(ints[s.TOP + k]), np.int64(ints[s.BOTTOM + k])
    )


@helper
def level_of(k, block):
    """Return the plane of levels of triangle k of the block, which has one channel, as payload."""
    longs, first = block.longs, s.PLANE_LEVEL + k
    return Payload(longs[first], longs[first + s.NEXT], longs[first + s.NEXT + s.NEXT])


@helper
def surface_of(k, payload, block):
    """Return what gives the entries of triangle k of the block."""
    ints, longs, reals = block.ints, block.longs, block.reals
    triangle = Triangle(
        np.int64(ints[s.X0 + k]), np.int64(ints[s.Y0 + k]), np.int64(ints[s.X1 + k]), np.int64(ints[s.Y1 + k]),
        np.int64(ints[s.X2 + k]), np.int64(ints[s.Y2 + k]),
    )  # fmt: skip
    anchor_x, anchor_y = np.uint64(np.int64(ints[s.ANCHOR_X + k])), np.uint64(np.int64(ints[s.ANCHOR_Y + k]))
    dx, dy = pack(longs[s.PLANE_Z_DX + k], payload.dx), pack(longs[s.PLANE_Z_DY + k], payload.dy)
    plane = Plane(pack(longs[s.PLANE_Z + k], payload.value) - anchor_x * dx - anchor_y * dy, dx, dy)
    depths = Depths(
        reals[s.Z0 + k], reals[s.Z1 + k], reals[s.Z2 + k], reals[s.LEAST_Z + k], reals[s.LARGEST_Z + k]
    )  # fmt: skip
    return Surface(triangle, ints[s.IS_SLIVER + k] != 0, plane, depths, payload.value)
