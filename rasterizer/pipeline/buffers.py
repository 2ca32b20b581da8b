"""Stage 7 for exact buffers: what is visible at each pixel's centre, one kernel a kind of buffer.

In:  the band's visibility buffer, all of its entries indices of exact records, and the records (float64).
Out: the band's rows of a buffer. `clear_band` comes last: it leaves the visibility buffer clear for the next band.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from ..geometry.vectors import length, scale
from .interpolate import corner_vectors, corner_weights, depth_at, exact_triangle, mean_vector
from .records import FACE, SIDE, Records
from .transform import Screen
from .visibility import CLEAR, VisibilityBuffer, clear, record_of, strip_of


class VisibleSurfaces(NamedTuple):
    """What is visible in a band, one sample a pixel."""

    visibility: VisibilityBuffer
    records: Records  # exact ones
    loaded_faces: np.ndarray  # (n_face,) the face that each triangle is a part of; empty where no face was clipped
    screen: Screen


@kernel
def write_depth(surfaces, band, out):
    """Write the distance along the viewing axis where something is visible: out is (height, width) float32."""
    visibility, records, is_perspective = (
        surfaces.visibility,
        surfaces.records,
        surfaces.screen.is_perspective,
    )
    entries = visibility.entries
    for row in range(band.y_end - band.y_start):
        strip, y = strip_of(row), band.y_start + row
        for x in range(visibility.left[strip], visibility.right[strip]):
            entry = entries[index(row * visibility.pitch + x)]
            if entry < CLEAR:
                record = record_of(entry)
                triangle = exact_triangle(records, record)
                q = corner_weights(triangle, x, y)
                out[index(y), index(x)] = depth_at(records, record, triangle, q, is_perspective)


@kernel
def write_face(surfaces, band, out):
    """Write the index of the visible face as loaded: out is (height, width) int32."""
    visibility, records = surfaces.visibility, surfaces.records
    entries, loaded_faces = visibility.entries, surfaces.loaded_faces
    for row in range(band.y_end - band.y_start):
        strip, y = strip_of(row), band.y_start + row
        for x in range(visibility.left[strip], visibility.right[strip]):
            entry = entries[index(row * visibility.pitch + x)]
            if entry < CLEAR:
                face = records.integers[record_of(entry), FACE]
                out[index(y), index(x)] = loaded_faces[index(face)] if len(loaded_faces) > 0 else face


@kernel
def write_normal(surfaces, band, out):
    """Write the unit normal in the world, towards the viewer: out is (height, width, 3) float32.

    Attributes 0-2 of the records are the normals.
    """
    visibility, records = surfaces.visibility, surfaces.records
    entries = visibility.entries
    for row in range(band.y_end - band.y_start):
        strip, y = strip_of(row), band.y_start + row
        for x in range(visibility.left[strip], visibility.right[strip]):
            entry = entries[index(row * visibility.pitch + x)]
            if entry < CLEAR:
                record = record_of(entry)
                q = corner_weights(exact_triangle(records, record), x, y)
                total = q[0] + q[1] + q[2]
                pixel = out[index(y), index(x)]
                pixel[0], pixel[1], pixel[2] = normal_of(records, record, (q[0] / total, q[1] / total, q[2] / total))


@helper
def normal_of(records, record, p):
    """Interpolate the normal of an exact record with weights p_i, Σ p_i = 1: unit length, on the side that is seen."""
    normal = mean_vector(corner_vectors(records, record, index(0)), p)
    norm = length(normal)
    return scale(normal, records.integers[record, SIDE] / norm if norm > 0 else 0.0)


@kernel
def clear_band(visibility, n_row):
    """Clear the first `n_row` rows of the visibility buffer; return how many samples are covered."""
    entries, n_covered = visibility.entries, 0
    for row in range(n_row):
        strip = strip_of(row)
        for x in range(visibility.left[strip], visibility.right[strip]):
            n_covered += entries[index(row * visibility.pitch + x)] < CLEAR
    clear(visibility, n_row)
    return n_covered
