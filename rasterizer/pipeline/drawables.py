"""What is drawn: triangles, their vertices on the screen, and the attributes of their corners.

The vertices come from the transform stage; the clip stage replaces triangles, and the scan stage draws them. A corner
is where a triangle meets a vertex: two triangles that share a vertex may have a corner each there, with normals or
intensities of their own.
"""

from typing import NamedTuple

import numpy as np

from .transform import Vertices


class Triangles(NamedTuple):
    """Index columns: which vertices triangles join, and where the attributes of their corners are.

    The indices are unsigned: signed ones would cost a wrap-around test at every access.
    """

    vertex_idx: np.ndarray  # (3, n) uint32, into the vertices
    corner_idx: np.ndarray  # (3, n) uint32, into the attributes
    is_inverted: np.ndarray  # (n,) uint8: 1 where the shading normals look against the winding
    material: np.ndarray = np.empty(0, np.uint32)  # (n,) uint32; empty where all have one
    clipped_idx: np.ndarray = np.empty(0, np.int32)  # (n,) int32, see clip.Clipped; empty where no face was clipped
    z_ranges: np.ndarray = np.empty((0, 2))  # (n_clipped, 2) float64, as there


class Drawables(NamedTuple):
    """The triangles of a picture with all that they refer to."""

    triangles: Triangles
    vertices: Vertices
    attributes: np.ndarray  # (side, n, n_attribute) float32
    double_attributes: np.ndarray  # the same in float64, of the corners that need it: see Coding.reads_double
