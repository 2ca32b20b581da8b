"""Stage 5, scan: the triangles of one band into its visibility buffer.

In:  the band's list of triangles, in face order, and the vertices on the screen.
Out: the nearest packed sample at every sample of the band (visibility.py), and a setup for every triangle whose samples
     are shaded later (triangle_setups.py). Of transparent surfaces a list of triangles instead, for the A-buffer
     (a_buffer.py).

Triangles are set up a block at a time (setup.py), their attributes get planes (gradients.py), and their samples are
filled one after the other.

A plane of packed samples is anchored at the first sample of the part of the triangle's box that lies right of and below
the picture's upper left corner, and integer addition is associative: a packed sample is a function of triangle and
sample alone, not of band, span start or thread. Products may overflow 64 bits on the way; arithmetic modulo 2^64 gives
the right packed sample all the same, because the packed sample itself fits.

    top v0                    Clockwise on the screen (y points down): v0 is the topmost vertex, the leftmost of two.
       /\\                     Left chain v0-v2(-v1), right chain v0-v1(-v2). A sample on a left or top edge belongs to
      /  \\_                   the triangle, on a right or bottom edge it doesn't: spans run from the first sample at or
  v2 /_____\\ v1               beyond the left edge to the last one before the right edge.

Small boxes are filled whole, LANES samples side by side; of other triangles the two chains are walked down the rows.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel, spelled_out
from . import setup as s
from .cull import first_sample
from .cut_outs import cut_out_of, is_there, threshold_of
from .gradients import IS_INVISIBLE, IS_TRANSPARENT, clear_planes, compute_intensities, compute_normals
from .transform import HALF, SUBPIXEL
from .triangle_setups import write_exact, write_normals, write_values
from .visibility import (
    DEPTH_MASK,
    IS_EXACT,
    IS_ID,
    IS_WEIGHTED,
    LANES,
    PADDING,
    VisibilityBuffer,
    id_payload,
    note_extent,
    note_material,
    pack,
)

MAX_EXTENT = 128  # columns and rows together of the box of a triangle whose packed samples tell its depths: buffers.py


class ScanCounts(NamedTuple):
    """What the scan stage found in a band."""

    n_level: int  # triangles by the path that their attributes took
    n_plane: int
    n_exact: int
    features: int  # those of the materials of all that are drawn, see gradients.py
    material: int  # of all of them; -1 where there are several


class Deferred(NamedTuple):
    """The triangles of a band through which what is behind them is seen: not drawn, but listed (a_buffer.py)."""

    faces: np.ndarray  # (n,) uint32, room for all triangles of the band
    payloads: np.ndarray  # (n,) int64: what stands below the depth in their packed samples
    extents: VisibilityBuffer  # without packed samples: where they may be seen, and what materials
    found: np.ndarray  # (4,) int64: how many there are, and of ScanCounts n_plane, n_exact and features

    @property
    def is_empty(self) -> bool:
        """Nothing is deferred."""
        return self.found[0] == 0

    @property
    def counts(self) -> ScanCounts:
        """What was found of these triangles."""
        _, n_plane, n_exact, features = self.found.tolist()
        return ScanCounts(0, n_plane, n_exact, features, -1)

    def listed(self) -> "Deferred":
        """Return them without the room behind them."""
        n = self.found[0]
        return self._replace(faces=self.faces[:n], payloads=self.payloads[:n])


def make_deferred(n, extents) -> Deferred:
    """Return room for n triangles; `extents` is what `make_extents` returns, clear."""
    return Deferred(np.empty(n, np.uint32), np.empty(n, np.int64), extents, np.zeros(4, np.int64))


def scan(band, drawables, coding, block, visibility, setups, deferred) -> ScanCounts:
    """Draw a band's triangles; return what was found.

    Parameters
    ----------
    band : Band
    drawables : Drawables, all of the picture
    coding : Coding
    block : Block, scratch
    visibility : VisibilityBuffer, clear; written
    setups : Setups, with room for all triangles; written
    deferred : Deferred, written; or None where all materials are opaque: then nothing of it is compiled
    """
    kernel = scan_intensities if coding.intensity_scale > 0.0 else scan_normals
    return ScanCounts(*kernel(band, drawables, coding, block, visibility, setups, deferred))


@kernel
def scan_intensities(band, drawables, coding, block, visibility, setups, deferred):
    """Draw a band's triangles, whose attributes are intensities; see `scan`. Return the fields of ScanCounts."""
    out = visibility, setups, deferred
    return scan_blocks(band, drawables, coding, block, out, compute_intensities, write_values, fill_intensities)


@kernel
def scan_normals(band, drawables, coding, block, visibility, setups, deferred):
    """Draw a band's triangles, whose attributes are normals; see `scan`. Return the fields of ScanCounts."""
    out = visibility, setups, deferred
    return scan_blocks(band, drawables, coding, block, out, compute_normals, write_normals, fill)


@helper
def scan_blocks(band, drawables, coding, block, out, compute_gradients, write_setup, fill_samples):
    """Draw a band's triangles as `scan` does into `out`, visibility, setups and deferred ones, with the functions for
    what their attributes are: one computes their planes, one writes these into a setup, one fills the samples."""
    faces, (visibility, setups, deferred) = band.faces, out
    n_setup = n_level = n_plane = n_exact = features = 0
    material = 0 if len(faces) == 0 else material_of_face(faces[0], drawables.triangles)
    for first in range(0, len(faces), s.BLOCK):
        some = faces[first : min(first + s.BLOCK, len(faces))]
        # Half of the work is done for all triangles of the block side by side: planes of depth and attributes.
        s.gather_vertices(some, drawables.triangles, drawables.vertices, block)
        n_attribute, of_block, has_others = look_at_materials(len(some), material, coding, block, deferred)
        features |= of_block
        material = -1 if has_others else material
        s.order_vertices(drawables.vertices.pixel, block)
        s.gather_attributes(len(some), n_attribute, drawables, coding.reads_double, block)
        s.compute_boxes(band, visibility.width, block)
        s.compute_depth_planes(block)
        if coding.is_exact:
            clear_planes(block)
        else:
            compute_gradients(n_attribute, coding, block)
        # The other half goes triangle by triangle: setups, where there are any, and samples.
        for k in range(len(some)):
            box, threshold = box_of(k, block), threshold_of(k, drawables.cut_outs, block)
            if box.left >= box.right or box.top >= box.bottom or threshold > 1.0:
                continue
            if block.ints[s.HAS_INTENSITY + k] != 0:
                payload = level_of(k, block)
                n_level += 1
            else:
                has_planes = block.ints[s.HAS_PLANES + k] != 0
                flags = plane_flags(k, block) if has_planes else IS_EXACT
                payload = Payload(id_payload(n_setup, flags), 0, 0)
                n_unit = 1
                if has_planes:
                    n_unit = write_setup(setups, n_setup, k, some[k], coding, block)
                else:
                    write_exact(setups, n_setup, k, some[k], n_attribute, coding, block)
                n_setup += n_unit
                n_plane += has_planes
                n_exact += not has_planes
                if is_deferred(k, some[k], payload.value, box, band, coding, block, deferred):
                    continue
            first_row, end_row = box.top - band.y_start, box.bottom - band.y_start
            note_extent(visibility, box.left, box.right, first_row, end_row)
            if len(coding.paths) > 1:
                here = np.int64(block.ints[s.MATERIAL + k])
                note_material(visibility, box.left, box.right, first_row, end_row, here)
            if threshold > 0.0:
                fill_cut_out(visibility, band.y_start, box, k, payload, drawables.cut_outs, block)
            else:
                fill_samples(visibility, band.y_start, box, k, payload, block)
    return n_level, n_plane, n_exact, features, material


@kernel
def scan_index(band, drawables, block, visibility):
    """Draw a band's triangles; packed samples hold the place of each in the band's list, for exact buffers.

    Those of triangles whose depths the packed samples don't tell well enough are marked as exact, see buffers.py.

    Parameters
    ----------
    band : Band
    drawables : Drawables, all of the picture
    block : Block, scratch
    visibility : VisibilityBuffer, clear; written
    """
    faces = band.faces
    for first in range(0, len(faces), s.BLOCK):
        some = faces[first : min(first + s.BLOCK, len(faces))]
        s.gather_vertices(some, drawables.triangles, drawables.vertices, block)
        s.order_vertices(drawables.vertices.pixel, block)
        s.compute_boxes(band, visibility.width, block)
        s.compute_depth_planes(block)
        for k in range(len(some)):
            box, threshold = box_of(k, block), threshold_of(k, drawables.cut_outs, block)
            if box.left >= box.right or box.top >= box.bottom or threshold > 1.0:
                continue
            is_small = block.ints[s.EXTENT_X + k] + block.ints[s.EXTENT_Y + k] <= MAX_EXTENT
            flags = 0 if is_small and block.ints[s.HAS_PLANES + k] != 0 else IS_EXACT
            payload = Payload(id_payload(first + k, flags), 0, 0)
            note_extent(visibility, box.left, box.right, box.top - band.y_start, box.bottom - band.y_start)
            if threshold > 0.0:
                fill_cut_out(visibility, band.y_start, box, k, payload, drawables.cut_outs, block)
            else:
                fill(visibility, band.y_start, box, k, payload, block)


@helper
def material_of_face(face, triangles):
    """Return the material of a triangle."""
    return np.int64(triangles.material[face]) if len(triangles.material) > 0 else 0


@helper
def look_at_materials(n, material, coding, block, deferred):
    """Return how many attributes the first n triangles of a block have at most, the features of the materials of those
    that are not deferred, and whether one of all these is another than `material`."""
    n_attribute = features = others = 0
    if s.gather_materials(n, coding, block):
        here = np.int64(block.ints[s.MATERIAL]) if len(coding.paths) > 1 else 0
        has_others = len(coding.paths) > 1 and here != material
        return coding.n_attributes[here], drawn_features(coding.features[here], deferred), has_others
    for k in range(n):
        here = np.int64(block.ints[s.MATERIAL + k])
        n_attribute = max(n_attribute, coding.n_attributes[here])
        features |= drawn_features(coding.features[here], deferred)
        others |= here ^ material
    return n_attribute, features, others != 0


@helper
def drawn_features(features, deferred):
    """Return the features of a material, int64; 0 where its triangles are deferred."""
    if deferred is not None:
        return 0 if features & (IS_TRANSPARENT | IS_INVISIBLE) else np.int64(features)
    return np.int64(features)


@helper
def plane_flags(k, block):
    """Return the flag of triangle k's planes in packed samples, IS_WEIGHTED or 0."""
    return IS_WEIGHTED if block.ints[s.IS_WEIGHTED + k] != 0 else 0


@helper
def is_deferred(k, face, payload, box, band, coding, block, deferred):
    """Tell whether triangle k is not drawn now; append it to the list of these, unless it is invisible."""
    if deferred is not None:
        material = np.int64(block.ints[s.MATERIAL + k])
        features = coding.features[material]
        if features & IS_TRANSPARENT:
            n, found = deferred.found[0], deferred.found
            deferred.faces[n], deferred.payloads[n] = face, payload
            found[0] += 1
            found[1 if payload & IS_EXACT == 0 else 2] += 1
            found[3] |= np.int64(features)
            first_row, end_row = box.top - band.y_start, box.bottom - band.y_start
            note_extent(deferred.extents, box.left, box.right, first_row, end_row)
            note_material(deferred.extents, box.left, box.right, first_row, end_row, material)
        return features & (IS_TRANSPARENT | IS_INVISIBLE) != 0
    return False


# ---------------------------------------------------------------- one triangle

# What is known of one triangle goes from helper to helper in structs. They cost nothing: helpers are inlined, and the
# optimiser takes tuples of numbers apart.


class Triangle(NamedTuple):
    """The vertices of a triangle, int64, 1/256 px, clockwise on the screen, the topmost (then leftmost) first."""

    x0: int
    y0: int
    x1: int
    y1: int
    x2: int
    y2: int


class Box(NamedTuple):
    """The samples that a triangle may cover, int64, half-open, within the picture and the band."""

    left: int
    right: int
    top: int
    bottom: int


class Plane(NamedTuple):
    """A plane of packed samples, uint64: at the picture's sample (0, 0), and its steps a sample; modulo 2^64."""

    value: int
    dx: int
    dy: int


class Payload(NamedTuple):
    """What stands below the depth in a triangle's packed samples, int64: at the anchor, and its steps a sample."""

    value: int
    dx: int
    dy: int


class Depths(NamedTuple):
    """The z of a triangle's plane at its rounded vertices, float64, z-buffer units."""

    z0: float
    z1: float
    z2: float


class Surface(NamedTuple):
    """What gives the packed sample of a triangle at a sample: the plane, or, of a sliver, exact edge functions."""

    triangle: Triangle
    is_sliver: bool
    plane: Plane
    depths: Depths
    payload: int  # of slivers


@helper
def box_of(k, block):
    """Return the box of triangle k of the block."""
    ints = block.ints
    return Box(
        np.int64(ints[s.LEFT + k]), np.int64(ints[s.RIGHT + k]), np.int64(ints[s.TOP + k]), np.int64(ints[s.BOTTOM + k])
    )


@helper
def level_of(k, block):
    """Return the plane of intensity steps of triangle k of the block, which has one channel, as payload."""
    longs, first = block.longs, s.PLANE_INTENSITY + k
    return Payload(longs[first], longs[first + s.NEXT], longs[first + s.NEXT + s.NEXT])


@helper
def surface_of(k, payload, block):
    """Return what gives the packed samples of triangle k of the block."""
    ints, longs, reals = block.ints, block.longs, block.reals
    triangle = Triangle(
        np.int64(ints[s.X0 + k]), np.int64(ints[s.Y0 + k]), np.int64(ints[s.X1 + k]), np.int64(ints[s.Y1 + k]),
        np.int64(ints[s.X2 + k]), np.int64(ints[s.Y2 + k]),
    )  # fmt: skip
    anchor_x, anchor_y = np.uint64(np.int64(ints[s.ANCHOR_X + k])), np.uint64(np.int64(ints[s.ANCHOR_Y + k]))
    dx, dy = pack(longs[s.PLANE_Z_DX + k], payload.dx), pack(longs[s.PLANE_Z_DY + k], payload.dy)
    plane = Plane(pack(longs[s.PLANE_Z + k], payload.value) - anchor_x * dx - anchor_y * dy, dx, dy)
    depths = Depths(reals[s.OWN_Z0 + k], reals[s.OWN_Z1 + k], reals[s.OWN_Z2 + k])
    return Surface(triangle, ints[s.IS_SLIVER + k] != 0, plane, depths, payload.value)


@helper
def fill(visibility, y_start, box, k, payload, block):
    """Fill triangle k of the block: all samples of a small box side by side, else span by span."""
    surface = surface_of(k, payload, block)
    is_small = block.ints[s.EXTENT_X + k] <= MAX_WIDTH and block.ints[s.EXTENT_Y + k] <= MAX_HEIGHT
    if is_small and not surface.is_sliver:
        fill_box(visibility, y_start, box, surface)
    else:
        fill_spans(visibility, y_start, box, surface, None, None)


@helper
def fill_intensities(visibility, y_start, box, k, payload, block):
    """Fill the samples of triangle k of the block, piece by piece where it has pieces."""
    if block.ints[s.HAS_INTENSITY + k] != 0 and block.ints[s.PIECE + k] != 0:
        fill_pieces(visibility, y_start, box, k, block)
    else:
        fill(visibility, y_start, box, k, payload, block)


@helper
def fill_cut_out(visibility, y_start, box, k, payload, cut_outs, block):
    """Fill the samples of triangle k of the block that are there, span by span; without cut-outs there is nothing to
    do."""
    if cut_outs is not None:
        surface = surface_of(k, payload, block)
        fill_spans(visibility, y_start, box, surface, None, cut_out_of(k, surface.triangle, cut_outs, block))


# ---------------------------------------------------------------- small boxes

# Edge functions of a box up to so many samples wide and high fit 32 bits: 2 · (16 · 256) · (128 · 256) = 2^28.
MAX_WIDTH, MAX_HEIGHT = PADDING, 128


@helper
def fill_box(visibility, y_start, box, surface):
    """Test every sample of a small box against the three edges, LANES at a time, without a branch."""
    triangle, plane = surface.triangle, surface.plane
    base = (box.top - y_start) * visibility.pitch
    for first in range(box.left, box.right, LANES):
        sx, sy = first * SUBPIXEL + HALF, box.top * SUBPIXEL + HALF
        e0, e0_dx, e0_dy = edge_function(triangle.x0, triangle.y0, triangle.x1, triangle.y1, sx, sy)
        e1, e1_dx, e1_dy = edge_function(triangle.x1, triangle.y1, triangle.x2, triangle.y2, sx, sy)
        e2, e2_dx, e2_dy = edge_function(triangle.x2, triangle.y2, triangle.x0, triangle.y0, sx, sy)
        edges = (e0, e0_dx, e0_dy, e1, e1_dx, e1_dy, e2, e2_dx, e2_dy)
        packed = (packed_at(plane, first, box.top), plane.dx, plane.dy)
        n_row = box.bottom - box.top
        merge_box(visibility.packed, base + first, visibility.pitch, n_row, packed, edges, DEPTH_MASK)


@helper
def edge_function(xa, ya, xb, yb, sx, sy):
    """Evaluate the edge function of a clockwise edge at a sample: value and steps a sample; >= 0 means inside.

    A sample on the edge is inside only on a top edge (to the right) or a left one (upwards), so the others are moved by
    one. All are int64, 1/256 px.

    Source: Pineda 1988, "A parallel algorithm for polygon rasterization", SIGGRAPH 88, 17-20.
    """
    dx, dy = xb - xa, yb - ya
    is_top_left = (dy < 0) | ((dy == 0) & (dx > 0))
    value = dx * (sy - ya) - dy * (sx - xa) - (0 if is_top_left else 1)
    return value, -dy * SUBPIXEL, dx * SUBPIXEL


@helper
def packed_at(plane, x, y):
    """Evaluate a plane of packed samples at the sample (x, y), uint64."""
    return plane.value + np.uint64(x) * plane.dx + np.uint64(y) * plane.dy


@spelled_out("build_merge_box")
def merge_box(packed, start, pitch, n_row, plane, edges, depth_mask):
    """Merge a box LANES samples wide into a visibility buffer: the inner loop of the scan stage for small triangles.

    Parameters
    ----------
    packed : (n,) int64, the visibility buffer, changed
    start, pitch : int64, the box's first packed sample in it, and packed samples from row to row
    n_row : int64, the height of the box
    plane : (value, d/dx, d/dy) uint64, what is merged; it wraps
    edges : (value, d/dx, d/dy) of each of the three edge functions, nine int64; their lowest 32 bits count, >= 0 is
        inside
    depth_mask : int64, the bits of a packed sample that are compared
    """
    value, dx, dy = plane
    e0, e0_dx, e0_dy, e1, e1_dx, e1_dy, e2, e2_dx, e2_dy = edges
    for row in range(n_row):
        first = start + row * pitch
        for k in range(LANES):
            inside = (e0 + k * e0_dx + row * e0_dy) | (e1 + k * e1_dx + row * e1_dy) | (e2 + k * e2_dx + row * e2_dy)
            new = np.uint64(value + np.uint64(k) * dx + np.uint64(row) * dy).view(np.int64)
            if np.int32(inside) >= 0 and new < packed[first + k] & depth_mask:
                packed[first + k] = new


# ---------------------------------------------------------------- spans


class Edge(NamedTuple):
    """An edge on its way down the rows, int64, as an exact digital differential analyser."""

    x: int  # the first sample at or beyond the edge on this row
    rest: int  # how far beyond, in shares of a sample: rest / divisor
    dx: int  # what the next row adds to x, and to the rest
    d_rest: int
    divisor: int


@helper
def fill_spans(visibility, y_start, box, surface, fragments, cut_out):
    """Walk the left and the right chain down the rows and fill the samples between them.

    Parameters
    ----------
    y_start : the band's first row in the picture
    fragments : None, or the Fragments that take what lies before the buffer, which is then left as it is: see
        a_buffer.py
    cut_out : None, or the CutOut that says which samples are there
    """
    triangle = surface.triangle
    middle = first_sample(min(triangle.y1, triangle.y2))
    for half in range(2):
        top, bottom = (box.top, min(box.bottom, middle)) if half == 0 else (max(box.top, middle), box.bottom)
        if top >= bottom:
            continue
        left, right = left_edge(triangle, half, top), right_edge(triangle, half, top)
        for y in range(top, bottom):
            x_start, x_end = max(left.x, 0), min(right.x, visibility.width)
            if x_start < x_end:
                first = (y - y_start) * visibility.pitch + x_start
                span = visibility.packed[first : first + x_end - x_start]
                if fragments is not None:
                    list_span(span, x_start, y - y_start, y, surface, fragments)
                elif cut_out is not None:
                    fill_cut_out_span(span, x_start, y, surface, cut_out)
                elif surface.is_sliver:
                    fill_sliver_span(span, x_start, y, surface)
                else:
                    fill_span(span, packed_at(surface.plane, x_start, y), surface.plane.dx, DEPTH_MASK)
            left, right = advance(left), advance(right)


class Perspective(NamedTuple):
    """What gives the intensity steps of a triangle in perspective: middle + M/f, float64, two planes beside a
    sample."""

    middle: float
    half_range: float  # of the intensity steps at ends of pieces
    anchor_x: int  # the sample at which the planes have their values
    anchor_y: int
    m: float
    m_dx: float
    m_dy: float
    f: float
    f_dx: float
    f_dy: float


@helper
def perspective_of(k, block):
    """Return what gives the intensity steps of triangle k of the block."""
    reals, m, f = block.reals, s.PLANE_OVER_W + k, s.PLANE_INV_W + k
    return Perspective(
        reals[s.MIDDLE + k], reals[s.HALF_RANGE + k],
        np.int64(block.ints[s.ANCHOR_X + k]), np.int64(block.ints[s.ANCHOR_Y + k]),
        reals[m], reals[m + s.NEXT], reals[m + s.NEXT + s.NEXT],
        reals[f], reals[f + s.NEXT], reals[f + s.NEXT + s.NEXT],
    )  # fmt: skip


@helper
def intensity_at(perspective, x, y):
    """Return the intensity step of a triangle at one of its samples, a whole number, float64; whatever float64 rounds,
    it stays within the range that is left for ends of pieces."""
    across, down = float(x - perspective.anchor_x), float(y - perspective.anchor_y)
    m = perspective.m + across * perspective.m_dx + down * perspective.m_dy
    f = perspective.f + across * perspective.f_dx + down * perspective.f_dy
    return np.rint(perspective.middle + min(max(m / f, -perspective.half_range), perspective.half_range))


@helper
def fill_perspective(span, x, y, plane, perspective):
    """Fill a span by a division a sample, from (x, y) on."""
    packed = packed_at(plane, x, y)
    for k in range(len(span)):
        new = np.int64(packed + np.uint64(k) * plane.dx) + np.int64(np.int32(intensity_at(perspective, x + k, y)))
        span[k] = new if new < (span[k] & DEPTH_MASK) else span[k]


@helper
def fill_pieces(visibility, y_start, box, k, block):
    """Fill the spans of triangle k of the block piece by piece: see gradients.py."""
    surface, perspective = surface_of(k, Payload(0, 0, 0), block), perspective_of(k, block)
    triangle, plane, piece = surface.triangle, surface.plane, np.int64(block.ints[s.PIECE + k])
    middle = first_sample(min(triangle.y1, triangle.y2))
    for half in range(2):
        top, bottom = (box.top, min(box.bottom, middle)) if half == 0 else (max(box.top, middle), box.bottom)
        if top >= bottom:
            continue
        left, right = left_edge(triangle, half, top), right_edge(triangle, half, top)
        for y in range(top, bottom):
            x, x_end, last = max(left.x, 0), min(right.x, visibility.width), right.x - 1
            if x < x_end:
                row = (y - y_start) * visibility.pitch
                intensity = intensity_at(perspective, x, y)
                if piece == 1:
                    fill_perspective(visibility.packed[row + x : row + x_end], x, y, plane, perspective)
                    x = x_end
                while x < x_end:
                    stop = min((x & -piece) + piece, last)
                    at_stop = intensity_at(perspective, stop, y)
                    end = stop + 1 if stop == last else stop
                    step = np.int64(np.rint((at_stop - intensity) / float(max(stop - x, 1))))
                    span = visibility.packed[row + x : row + min(end, x_end)]
                    packed = packed_at(plane, x, y) + np.uint64(np.int64(intensity))
                    fill_span(span, packed, plane.dx + np.uint64(step), DEPTH_MASK)
                    x, intensity = end, at_stop
            left, right = advance(left), advance(right)


@helper
def left_edge(triangle, half, y):
    """Start the left chain on row y of the upper (0) or lower (1) half, which begins at the middle vertex."""
    x0, y0, x1, y1, x2, y2 = triangle
    is_second = half == 1 and y2 < y1
    xa, ya, xb, yb = (x2, y2, x1, y1) if is_second else (x0, y0, x2, y2)
    return start_edge(xa, ya, xb, yb, y)


@helper
def right_edge(triangle, half, y):
    """Start the right chain on row y of the upper (0) or lower (1) half, which begins at the middle vertex."""
    x0, y0, x1, y1, x2, y2 = triangle
    is_second = half == 1 and y1 < y2
    xa, ya, xb, yb = (x1, y1, x2, y2) if is_second else (x0, y0, x1, y1)
    return start_edge(xa, ya, xb, yb, y)


@helper
def start_edge(xa, ya, xb, yb, y):
    """Start the edge a-b, downwards, on a row of samples.

    With sy the height of the samples, the crossing is at x = xa + (sy - ya)·dx/dy; the first sample at or beyond it is
    ceil((x - 128)/256), a quotient of integers below 2^60.
    """
    dx, dy, sy = xb - xa, yb - ya, y * SUBPIXEL + HALF
    divisor = dy * SUBPIXEL
    dividend = (xa - HALF) * dy + (sy - ya) * dx + divisor - 1
    sample = dividend // divisor
    step = dx // dy
    return Edge(sample, dividend - sample * divisor, step, (dx - step * dy) * SUBPIXEL, divisor)


@helper
def advance(edge):
    """Move an edge to the next row: the rest carries one sample when it reaches the divisor."""
    rest = edge.rest + edge.d_rest
    carry = rest >= edge.divisor
    rest -= edge.divisor if carry else 0
    return Edge(edge.x + edge.dx + carry, rest, edge.dx, edge.d_rest, edge.divisor)


@spelled_out("build_fill_span")
def fill_span(span, packed, step, depth_mask):
    """Advance depth and intensity by one addition a sample; the nearer packed sample stays, at equal depth the earlier
    one.

    LANES samples side by side, the last ones beyond the span's end: packed samples there are written back as they are.
    The compiler's own loop takes many more at a time, and the rest, which is most of a span of middle size, one by one.

    Parameters
    ----------
    span : (n,) int64, a row's packed samples, changed
    packed, step : uint64, the first packed sample, and what a sample adds to it
    depth_mask : int64, the bits of a packed sample that are compared
    """
    for k in range(len(span)):
        new = np.int64(packed)
        span[k] = new if new < (span[k] & depth_mask) else span[k]
        packed += step


# ---------------------------------------------------------------- triangles that are too thin or too steep for a plane


@helper
def fill_sliver_span(span, x_start, y, surface):
    """Fill a span of a triangle that is too thin or too steep for a plane."""
    for k in range(len(span)):
        new, old = packed_of_sliver(x_start + k, y, surface), span[k]
        span[k] = new if new < (old & DEPTH_MASK) else old


@helper
def fill_cut_out_span(span, x_start, y, surface, cut_out):
    """Fill the samples of a span that are there."""
    for k in range(len(span)):
        x = x_start + k
        new = packed_of_sliver(x, y, surface) if surface.is_sliver else np.int64(packed_at(surface.plane, x, y))
        if new < (span[k] & DEPTH_MASK) and is_there(cut_out, x, y):
            span[k] = new


@helper
def packed_of_sliver(x, y, surface):
    """Compute the packed sample at a sample from exact edge functions, int64; its z is kept within the z-buffer.

    A weighted mean, none of whose weights is negative: so where a corner lies far before all that is seen, its z
    doesn't take the digits of the others'.
    """
    triangle, depths = surface.triangle, surface.depths
    dx1, dy1 = triangle.x1 - triangle.x0, triangle.y1 - triangle.y0
    dx2, dy2 = triangle.x2 - triangle.x0, triangle.y2 - triangle.y0
    area = dx1 * dy2 - dx2 * dy1
    ux, uy = x * SUBPIXEL + HALF - triangle.x0, y * SUBPIXEL + HALF - triangle.y0
    e1, e2 = ux * dy2 - uy * dx2, uy * dx1 - ux * dy1
    z = (float(area - e1 - e2) * depths.z0 + float(e1) * depths.z1 + float(e2) * depths.z2) / float(area)
    return np.int64(pack(np.rint(min(max(z, 0.0), s.FURTHEST)), surface.payload))


# ---------------------------------------------------------------- fragments of transparent surfaces


@helper
def list_span(span, x_start, row, y, surface, fragments):
    """Append the packed samples of a span that lie before those of the buffer.

    Whole packed samples are compared, so that at equal depth the triangle with the lower index lies in front. Of an
    opaque surface that has its intensity in its packed samples the index is not known: a fragment at its depth is noted
    as a tie.

    Parameters
    ----------
    span : (n,) int64, a row's packed samples
    x_start : its first column
    row, y : the row in the band, and in the picture
    fragments : Fragments, with room for all
    """
    before, packed, count, ties = fragments.before, fragments.packed, fragments.found[0], 0
    last = fragments.last[fragments.columns[row] + x_start :]
    for k in range(len(span)):
        x = x_start + k
        new = packed_of_sliver(x, y, surface) if surface.is_sliver else np.int64(packed_at(surface.plane, x, y))
        # Written in any case, and counted where it lies before: without a branch, which would be a coin toss.
        is_before = (new >= 0) & (new < span[k])
        before[count], packed[count] = last[k], new
        last[k] = np.int32(count) if is_before else last[k]
        count += np.int64(is_before)
        ties |= is_tie(new, span[k])
    fragments.found[0] = count
    fragments.found[1] |= ties


@helper
def is_tie(new, old):
    """Tell whether a packed sample that holds an index is as deep as one that doesn't."""
    return (new ^ old) & (DEPTH_MASK | IS_ID) == IS_ID
